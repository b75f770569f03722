"""The options that name a vehicle or a wheel, as a command has them."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import click  # noqa: TID251, a command is what is tested
import pytest
from click.testing import CliRunner  # noqa: TID251

from terratool.cli.command import Command
from terratool.cli.options import vehicle_from, vehicle_option, wheel_options
from terratool.definition.vehicle import ROLLING
from terratool.errors import DefinitionError, ReadError
from terratool.traversability.vehicle import Vehicle, Wheel
from tests.commands import SAMPLE, call
from tests.vehicles import SMALLEST

WHEEL = ["--wheel-radius", "0.2", "--wheel-width", "0.1", "--load", "100"]


@click.command(cls=Command)
@vehicle_option
@wheel_options
@click.pass_context
def drive(ctx: click.Context, **values: Any) -> None:
    ctx.obj.append(vehicle_from(values))
    assert values == {}  # what is left is the command's own


def given(*arguments: object) -> Vehicle:
    got: list[Vehicle] = []
    result = CliRunner().invoke(drive, list(map(str, arguments)), obj=got)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    if result.exit_code:
        raise click.UsageError(" ".join(result.output.replace("│", " ").split()))
    return got[0]


def test_a_vehicle_by_its_file(tmp_path: Path) -> None:
    """--vehicle reads it."""
    path = tmp_path / "rover.json"
    path.write_text(json.dumps(SMALLEST))
    assert given("--vehicle", path).mass == 50


def test_a_wheel_by_its_figures() -> None:
    """Radius and width in metres, load in N, torque in N m; without torque there is no limit."""
    assert given(*WHEEL) == Vehicle.single(Wheel(0.2, 0.1, math.inf, 1.0), 100.0)
    assert given(*WHEEL, "--torque", 5, "--max-slip", 0.3) == Vehicle.single(
        Wheel(0.2, 0.1, 5.0, 0.3), 100.0
    )
    assert given(*WHEEL).weight == 100


@pytest.mark.parametrize(
    ("arguments", "wheel"),
    [
        (["--grouser-height", 0.02], Wheel(0.2, 0.1, grouser_height=0.02)),
        (["--contact-length", 0.15], Wheel(0.2, 0.1, contact_length=0.15)),
        (["--tyre-pressure", 70], Wheel(0.2, 0.1, patch_pressure=90e3, tyre=True, rolling=ROLLING)),
        (
            ["--tyre-pressure", 70, "--grouser-height", 0.2, "--contact-length", 0.4],
            Wheel(
                0.2,
                0.1,
                grouser_height=0.2,
                contact_length=0.4,
                patch_pressure=90e3,
                tyre=True,
                rolling=ROLLING,
            ),
        ),
    ],
)
def test_a_wheel_has_lugs_or_a_tyre(arguments: list[object], wheel: Wheel) -> None:
    """As those of a vehicle file: a carcass of 20 kPa adds to the pressure, given in kPa."""
    assert given(*WHEEL, *arguments) == Vehicle.single(wheel, 100.0)


def test_the_help_has_the_units() -> None:
    """Newtons and not kilograms, newton metres, metres; all eight in two lines."""
    text = CliRunner().invoke(drive, ["--help"], terminal_width=100).output
    head, *lines = text[text.index("A wheel in place of") : text.index("Also")].splitlines()
    shown = re.findall(r"--([\w-]+) (\w+)", " ".join(lines))
    assert shown == [
        ("wheel-radius", "M"), ("wheel-width", "M"), ("load", "N"), ("grouser-height", "M"),
        ("tyre-pressure", "KPA"), ("contact-length", "M"), ("torque", "NM"), ("max-slip", "SHARE"),
    ]  # fmt: skip
    assert len(lines) == 2
    assert "M metres, N newtons, KPA kilopascals, NM newton metres" in head


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "There is no vehicle. Give --vehicle V.json, or a wheel by"),
        (["--torque", 5], "A wheel needs --wheel-radius, --wheel-width and --load, too"),
        (WHEEL[:4], "A wheel needs --load, too. Add what is missing, or give"),
        ([*WHEEL, "--vehicle", "v.json"], "Give a vehicle or a wheel, not both."),
        (["--load", 9, "--vehicle", "v.json"], "--load says what --vehicle says in its file."),
        ([*WHEEL[:4], "--load", 0], "'--load': 0 is not from 1e-06 to 1e+09."),
        ([*WHEEL[:4], "--load", -5], "'--load': -5 is not from 1e-06 to 1e+09."),
        ([*WHEEL[:4], "--load", "nan"], "'--load': nan is no number."),
        ([*WHEEL[:4], "--load", "inf"], "'--load': inf is not from"),
        ([*WHEEL[:4], "--load", "heavy"], "'--load': 'heavy' is not a valid float"),
        (["--wheel-radius", 0, *WHEEL[2:]], "'--wheel-radius': 0 is not from"),
        (["--wheel-radius", 0.2, "--wheel-width", "-inf"], "'--wheel-width': -inf is not from"),
        ([*WHEEL, "--torque", 0], "'--torque': 0 is not from"),
        ([*WHEEL, "--tyre-pressure", 0], "'--tyre-pressure': 0 is not from 1e-06 to"),
        (
            [*WHEEL, "--grouser-height", 0.21],
            "height is 0.21 m, but the wheel's radius is only 0.2",
        ),
        ([*WHEEL, "--contact-length", 0.41], "wheel's diameter is only 0.4 m. Give both in metres"),
        (["--tyre-pressure", 9, "--vehicle", "v.json"], "--tyre-pressure says what --vehicle says"),
        ([*WHEEL, "--max-slip", 0], "'--max-slip': 0 is not above 0 and up to 1."),
        ([*WHEEL, "--max-slip", 1.01], "'--max-slip': 1.01 is not above 0 and up to 1."),
        ([*WHEEL, "--max-slip", "nan"], "'--max-slip': nan is not above 0 and up to 1."),
    ],
)
def test_bad_combinations_are_refused(arguments: list[object], words: str) -> None:
    """Both, neither, half a wheel, or a figure that none can have: a sentence each, wrong usage."""
    with pytest.raises(click.UsageError) as raised:
        given(*arguments)
    assert words in raised.value.message


def test_a_file_that_is_none_is_told_by_its_reader(tmp_path: Path) -> None:
    """Errors of the file are not errors of usage."""
    with pytest.raises(ReadError):
        given("--vehicle", tmp_path / "absent.json")
    with pytest.raises(DefinitionError, match="is a terrain"):
        given("--vehicle", SAMPLE)


@pytest.mark.parametrize(
    ("arguments", "guess"),
    [
        (("export-dem", "a.json", "a.tif", "--layer", "heigth"), "Did you mean height?"),
        (("export-dem", "a.json", "a.tif", "--compress", "Zst"), "Did you mean zstd?"),
        (("export-dem", "a.json", "a.tif", "--layer", "qqqqq"), "is not one of"),
        (("export-sim", "a.json", "out", "--target", "isac"), "Did you mean usd?"),
    ],
)
def test_names_that_are_nearly_right_are_guessed_at(arguments: tuple[str, ...], guess: str) -> None:
    ran = call(*arguments)
    assert ran.code == 2 and guess in ran.err
    assert ("Did you mean" in ran.err) == guess.startswith("Did")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("traversability a.json --route 1 2 3", "--route takes 4 numbers, X0 Y0 X1 Y1, not 3."),
        ("traversability a.json --route 1 2 3 --json", 'Y1, not 3 before "--json".'),
        ("traversability a.json --route 1 2 3 4 --route 5 -6", "X0 Y0 X1 Y1, not 2."),
        ("traversability --route 1 2 3 a.json --json", 'X0 Y0 X1 Y1, not 3 before "a.json".'),
        ("traversability a.json --route 1,2,3,4", "Give X0 Y0 X1 Y1 as separate words,"),
        ("traversability a.json --route=1,2,3,4 --threads 1 --json", "--route 1,2,3,4 has commas."),
        ("traversability a.json --route 1, 2, 3, 4", "--route 1, 2, 3, 4 has commas."),
        ("scan a.json b.ply --pose 1 2 3", "6 numbers, X Y Z YAW PITCH ROLL, not 3."),
        ("add a.json --cell 1", "--cell takes 2 numbers, X Y, not 1."),
        ("add a.json --cell --type b", '--cell takes 2 numbers, X Y, not 0 before "--type".'),
        ("new stairs a.json --size 1", "--size takes 2 numbers, X Y, not 1."),
    ],
)
def test_a_wrong_number_of_values_is_told_by_their_names(arguments: str, words: str) -> None:
    """As the help has them, and the help is that of the command."""
    ran = call(*arguments.split())
    assert (ran.code, ran.out) == (2, "") and words in ran.err
    command = " ".join(arguments.split()[: 2 if arguments.startswith("new") else 1])
    assert ran.err.endswith(f"terratool {command} --help.\n")


@pytest.mark.parametrize(
    "arguments",
    [
        "export-dem a.tif site.json", "export-mesh a.GLB site.json.gz", "render a.svg site.json",
        "scan a.ply site.json --sensor s.json", "export-dem a.tif -o site.json",
        "export-dem a.img site.json", "export-sim out/world site.json",
    ],
)  # fmt: skip
def test_words_in_the_wrong_order_are_asked_about(
    arguments: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody is told to overwrite a definition."""
    monkeypatch.chdir(tmp_path)
    for name in ("site.json", "site.json.gz"):
        Path(name).write_text("{}", "utf-8")
    command, made, *others = arguments.split()
    site = next(word for word in others if word.startswith("site"))
    ran = call(*arguments.split())
    assert ran.code == 2 and "--overwrite" not in ran.err
    assert "Is it the other way round?" in ran.err
    assert f"terratool {command} {site} {made}\n" in ran.err


def test_a_section_is_a_profile() -> None:
    ran = call("render", "a.json", "a.png", "--section", 0, 0, 1, 1)
    assert ran.code == 2 and "Did you mean --profile?" in ran.err


@pytest.mark.parametrize("words", [(), ("query",), ("new",), ("new", "stairs")])
def test_help_is_a_word_too(words: tuple[str, ...]) -> None:
    """Alone and before a command it gives what --help does."""
    ran = call("help", *words)
    assert ran.code == 0 and ran.err == ""
    assert ran.out == call(*words, "--help").out
    ran = call("help", "qury")
    assert ran.code == 2 and "Did you mean query?" in ran.err


def test_an_output_before_its_kind_is_put_behind_it() -> None:
    ran = call("new", "a.json", "stairs")
    assert ran.code == 2 and "terratool new stairs a.json" in ran.err
