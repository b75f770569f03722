"""New terrains from Python: the options of the table, and errors in words of Python."""

from __future__ import annotations

import inspect

import pytest

import terratool
from terratool.api.starting import starter_options
from terratool.authoring.starters.build import KINDS
from tests.commands import call


def test_a_new_terrain_is_what_the_command_writes() -> None:
    text = terratool.new("stairs", rise=0.15, steps=4)
    assert text == call("new", "stairs", "-", "--rise", 0.15, "--steps", 4).out
    assert terratool.load(text).relief == (0.0, pytest.approx(0.6))


@pytest.mark.parametrize("kind", KINDS)
def test_options_are_those_of_the_table(kind: str) -> None:
    """Each by its name, with a meaning; its default is what is left out."""
    options = starter_options(kind)
    assert list(options) == [one.key for one in KINDS[kind].options]
    given = {name: one.default for name, one in options.items()}
    assert terratool.new(kind, **given) == terratool.new(kind)
    for one in options.values():
        assert one.descr.startswith(tuple(option.descr for option in KINDS[kind].options))
    assert f"\n    {kind}: {KINDS[kind].descr}" in (inspect.getdoc(terratool.new) or "")


@pytest.mark.parametrize("kind", KINDS)
def test_errors_say_names_of_arguments(kind: str) -> None:
    for name in starter_options(kind):
        for value in (-1e9, "mud", (1, 2, 3), float("nan")):
            with pytest.raises(terratool.RequestError) as error:
                terratool.new(kind, **{name: value})
            assert name in str(error.value) and "--" not in str(error.value)


def test_what_does_not_fit_together_is_said_in_python() -> None:
    """The hints name options, too."""
    with pytest.raises(terratool.RequestError) as error:
        terratool.new("stairs", steps=20, size=(2, 2))
    assert "--" not in str(error.value)
    assert "steps" in str(error.value) or "size" in str(error.value)
    with pytest.raises(terratool.RequestError, match=r"stairs takes no 'ris'. Did you mean rise"):
        terratool.new("stairs", ris=1)
    with pytest.raises(terratool.RequestError, match=r"There is no kind 'stair'. Did you mean st"):
        terratool.new("stair")
