"""The package as a whole: names, help, types, and how fast it is there."""

from __future__ import annotations

import copy
import inspect
import pickle
import pydoc
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import terratool
from terratool.api.verbs import VERBS
from terratool.cli.main import _COMMANDS
from tests import stubs
from tests.commands import ENVIRONMENT, ROOT, SAMPLE

NAMES = ["Definition", "Terrain", "check", "import_primitive", "import_terrain", "load", "new"]


@pytest.fixture(scope="module")
def terrain() -> terratool.Terrain:
    return terratool.load(SAMPLE)


def test_it_is_there_at_once_and_without_numpy() -> None:
    """Within 50 ms, even on a machine that does something else; completion loads nothing."""
    code = "import terratool, sys; dir(terratool); assert 'numpy' not in sys.modules"
    fastest = 1e9
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-X", "importtime", "-c", code],
            capture_output=True, text=True, cwd=ROOT, env=ENVIRONMENT, check=True,
        )  # fmt: skip
        [line] = re.findall(
            r"^import time: +\d+ \| +(\d+) \| terratool$", done.stderr, re.MULTILINE
        )
        fastest = min(fastest, int(line) / 1000)
    assert fastest < 50


def test_completion_and_stars_find_the_public_names() -> None:
    assert set(NAMES) <= set(dir(terratool))
    assert set(terratool.__all__) <= set(dir(terratool))
    assert not any(name.startswith("_") for name in terratool.__all__)
    names: dict[str, object] = {}
    exec("from terratool import *", names)
    assert set(terratool.__all__) <= set(names)
    with pytest.raises(AttributeError, match="lod"):
        terratool.lod  # noqa: B018


def test_help_shows_what_there_is() -> None:
    """Classes and functions with their names and options, and nothing of how they are found."""
    shown = pydoc.plain(pydoc.render_doc(terratool))
    assert "__getattr__(name" not in shown and "_HOMES" not in shown
    for name in terratool.__all__:
        kind = "class " if inspect.isclass(getattr(terratool, name)) else ""
        assert re.search(rf"^    {kind}{name}\(", shown, re.MULTILINE), name
    assert not re.search(r"UserTerrain|Builder|_from\b|doctest|`make |\.pyi", shown)
    assert "exaggeration: factor on heights of a section" in shown  # an option of render
    assert "stairs: " in shown and "steps" in shown  # a kind of new terrain


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: terratool.Terrain(), "Terrain.__init__() missing"),
        (lambda: terratool.load(SAMPLE).height(1), "Terrain.height() missing"),
        (lambda: terratool.load(SAMPLE).write_mesh(), "Terrain.write_mesh() missing"),
        (lambda: terratool.Definition(1, 2), "Definition.__init__() takes"),
        (lambda: terratool.Definition(1).add(1, 2), "Definition.add() takes"),
        (lambda: terratool.Definition(1).add("b").add(1, 2), "Element.add() takes"),
        (lambda: terratool.import_terrain(max_error=1), "import_terrain() missing"),
        (lambda: terratool.check(), "check() missing"),
    ],
)  # fmt: skip
def test_errors_of_python_name_what_users_know(wrong: Any, said: str) -> None:
    with pytest.raises(TypeError) as error:
        wrong()
    assert str(error.value).startswith(said)


def test_signatures_name_what_users_know() -> None:
    def returned(function: Any) -> str:
        return str(inspect.signature(function).return_annotation)

    assert returned(terratool.load) == returned(terratool.Definition.compile) == "Terrain"
    assert returned(terratool.Element.add) == "Element"
    assert returned(terratool.import_terrain) == "ImportReport | Terrain"


def test_everything_public_is_explained() -> None:
    for name in terratool.__all__:
        found = getattr(terratool, name)
        assert inspect.getdoc(found), name
        for own, member in vars(found).items() if name in ("Terrain", "Definition") else ():
            if not own.startswith("_"):
                assert inspect.getdoc(member), f"{name}.{own}"


def test_types_are_those_of_the_records() -> None:
    """`make stubs` has been run since an option changed."""
    assert stubs.same(stubs.StubWriter().text(), stubs.STUB.read_text("utf-8"))
    assert (stubs.STUB.parent / "py.typed").exists()


RIGHT = """
import terratool
text: str = terratool.new("stairs", rise=0.15, size=(8, 4))
terrain = terratool.load(text)
width: int = terrain.to_dem(resolution=0.5, layers=["slope"]).shape[1]
terrain.render("a.png", contours="auto", overwrite=True).width
terrain.render(layer="slope").savefig("b.png")
terrain.write_mesh("a.obj", origin="world", max_error=0.1)
definition = terratool.Definition(size=(20, 12), crs="EPSG:32633")
definition.surface("sand", preset="dry-sand", fric_angle=[26, 30])
definition.add("box", at=(1, 2), extent=3, repeat={"count": (2, 2), "step": (1, 1)}).add("box")
terrain.diff(definition, vehicles="v.json").same
terratool.import_terrain("dem.tif", max_error=0.1).elements
terratool.import_terrain("dem.tif", "site.json", max_error=0.1).bound
"""
WRONG = """
import terratool
terratool.new("stairs", rize=0.15)
terratool.new("flat", preset="mud")
terrain = terratool.load("a.json")
terrain.write_mesh("a.obj", origin="centre")
terrain.to_dem(resolutoin=0.5)
terrain.render("a.png").savefig("b.png")
terratool.Definition(size=(20, 12)).add("box", vscale=3)
"""


def members_of_the_page() -> set[str]:
    """Names that docs/api.md lists below `Terrain`, and the attributes that its table has."""
    page = (ROOT / "docs/api.md").read_text("utf-8")
    [listed] = re.findall(r"autoclass:: Terrain\n +:members: ((?:.|\n)+?)\n```", page)
    return {"descr", "storeys", *re.split(r",\s+", listed)}


def test_completion_of_a_terrain_has_what_the_page_has(terrain: terratool.Terrain) -> None:
    assert {name for name in dir(terrain) if not name.startswith("_")} == members_of_the_page()
    for name in (*members_of_the_page(), "ray_index", "__class__"):
        assert hasattr(terrain, name), name
    assert {"__class__", "__str__", "_repr_html_"} <= set(dir(terrain))


@pytest.mark.parametrize("command", [*_COMMANDS, "load", "check"])
def test_a_command_that_is_no_verb_is_answered_with_what_is(
    command: str, terrain: terratool.Terrain
) -> None:
    """By names that there are; the page has the same ones beside the command."""
    name = command.replace("-", "_")
    if name in members_of_the_page():
        return
    assert not hasattr(terrain, name) and getattr(terrain, name, 7) == 7
    with pytest.raises(AttributeError, match=rf"^A Terrain has no '{name}'\. Use .+\.$") as error:
        getattr(terrain, name)
    said = str(error.value).partition("Use ")[2]
    for path in re.findall(r"terratool\.([\w.]*\w)", said):
        assert pydoc.locate(f"terratool.{path}") is not None, path
    assert name in terratool.__all__ or not re.search(rf"\bterratool\.{name}\b", said)
    for word in re.findall(r"(?<![\w.])(?:to|write)_\w+|height|surface|sample|facts", said):
        assert word in members_of_the_page(), word


def test_a_wrong_name_is_told_as_such(terrain: terratool.Terrain) -> None:
    with pytest.raises(AttributeError, match=r"^A Terrain has no 'heigth'\.$") as error:
        terrain.heigth  # type: ignore[attr-defined]  # noqa: B018
    assert (error.value.name, error.value.obj) == ("heigth", terrain)  # Python adds the nearest
    assert pickle.loads(pickle.dumps(terrain)).height(1.0, 1.0) == terrain.height(1.0, 1.0)
    assert copy.copy(terrain).elements == terrain.elements


@pytest.mark.nightly
def test_a_type_checker_knows_the_options(tmp_path: Path) -> None:
    """What is right passes, and each line but the first and the fourth of what is wrong fails."""
    pytest.importorskip("mypy")
    (tmp_path / "right.py").write_text(RIGHT)
    (tmp_path / "wrong.py").write_text(WRONG)
    command = [sys.executable, "-m", "mypy", "--no-incremental", "--strict", "--no-error-summary"]
    settings = ["--config-file", str(ROOT / "pyproject.toml"), "--follow-imports", "silent"]
    done = subprocess.run(
        [*command, *settings, "right.py", "wrong.py"],
        capture_output=True, text=True, cwd=tmp_path, env=ENVIRONMENT, check=False,
    )  # fmt: skip
    found = {tuple(found) for found in re.findall(r"^(\w+)\.py:(\d+): error", done.stdout, re.M)}
    assert found == {("wrong", str(line)) for line in (3, 4, 6, 7, 8, 9)}, done.stdout


def test_the_page_names_the_commands_without_a_verb() -> None:
    text = (ROOT / "docs/api.md").read_text("utf-8")
    for name, words in VERBS.items():
        if words.startswith("the command, "):
            assert f"`{name}`" in text.rpartition("## Below the verbs")[2], name
