"""Every file in example-files and samples: dropping one there adds a test."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from msgspec import structs

from terratool.definition.layout import canonical
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.rules import RULES
from terratool.field.unseen import unseen_storeys
from terratool.text.source import read_source

HERE = Path(__file__).parents[1]
VALID = sorted((HERE / "example-files" / "valid").glob("*.json"))
SAMPLES = sorted((HERE.parent / "samples").glob("*.json"))
VEHICLES = sorted((HERE.parent / "samples" / "vehicles").glob("*.json"))
SENSORS = sorted((HERE.parent / "samples" / "sensors").glob("*.json"))
CURRICULA = sorted((HERE.parent / "samples" / "curricula").glob("*.json"))
INVALID = sorted((HERE.parent / "samples" / "invalid").glob("*.json"))
NO_SAMPLE = {"TT112"}  # it wants a file of more than 10 MB


def expected(path: Path) -> tuple[CheckOptions, list[tuple[str, str, str]]]:
    """Place, code and pointer, from lines such as ``3:14 TT105 /elemTree/cells``.

    A first line ``--max-step 0.15`` gives that option.
    """
    options, found = CheckOptions(look=unseen_storeys), []
    for line in path.with_suffix(".expected").read_text("utf-8").splitlines():
        place, code, *pointer = line.split(" ", 2)
        if place == "--max-step":
            options = CheckOptions(max_step=float(code), look=unseen_storeys)
        else:
            found.append((place, code, pointer[0] if pointer else ""))
    return options, found


def places(checked: Checked) -> list[tuple[str, str, str]]:
    return [(f"{f.line}:{f.column}", f.code, f.pointer) for f in checked.findings]


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_invalid_sample(path: Path) -> None:
    """An invalid file has the findings that are listed beside it, all of them, and no others."""
    options, findings = expected(path)
    checked = check(read_source(path), options, kind=None)
    assert places(checked) == findings
    errors = [code for _, code, _ in findings if RULES[code].severity == "error"]
    read = (checked.definition, checked.vehicle, checked.sensor)
    assert (read == (None, None, None)) == bool(errors)


@pytest.mark.parametrize("path", VALID, ids=lambda path: path.stem)
def test_valid_example(path: Path) -> None:
    """A valid file has no errors."""
    checked = check(read_source(path), kind=None)
    assert [f for f in checked.findings if f.severity == "error"] == []
    assert checked.definition is not None


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_sample(path: Path) -> None:
    """A sample is a good example: nothing is wrong with it, and nothing to remark on."""
    checked = check(read_source(path), CheckOptions(look=unseen_storeys), kind=None)
    assert checked.findings == ()
    assert checked.definition is not None


@pytest.mark.parametrize("path", VEHICLES, ids=lambda path: path.stem)
def test_vehicle(path: Path) -> None:
    """So is a sample of a vehicle, which says what it is and where each figure comes from."""
    checked = check(read_source(path), kind=None)
    assert checked.findings == ()
    assert checked.vehicle is not None
    value = json.loads(path.read_text("utf-8"))
    assert 20 < len(value["descr"]) < 130
    told = {name for names in value["x-source"] for name in names.split(", ")}
    asked = {"mass", "track", "cog", "clearance", "speed", "power", "bodyWidth"}
    asked |= {"axles"} & value.keys()
    assert told >= asked
    assert path.name in (HERE.parent / "docs" / "vehicle.md").read_text("utf-8")


@pytest.mark.parametrize("path", SENSORS, ids=lambda path: path.stem)
def test_sensor(path: Path) -> None:
    """And one of a sensor, each figure of which has its source, and docs/scan.md names it."""
    checked = check(read_source(path), kind=None)
    assert checked.findings == ()
    assert checked.sensor is not None
    value = json.loads(path.read_text("utf-8"))
    assert 20 < len(value["descr"]) < 130
    told = {name for names in value["x-source"] for name in names.split(", ")}
    figures = {"range", "rate", *value.get("noise", {}), *value[checked.sensor.kinds[0]]}
    assert told == figures
    assert path.name in (HERE.parent / "docs" / "scan.md").read_text("utf-8")


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_sample_says_what_it_is(path: Path) -> None:
    """In one line, and so does docs/samples.md."""
    text = path.read_text("utf-8")
    assert 20 < len(json.loads(text)["descr"]) < 130
    assert f"samples/{path.name}" in (HERE.parent / "docs" / "samples.md").read_text("utf-8")


@pytest.mark.parametrize("path", CURRICULA, ids=lambda path: path.stem)
def test_curriculum_is_valid(path: Path) -> None:
    """A sample of training tiles has no findings, known by its `$schema` and by its keys alone."""
    source = read_source(path)
    bare = source.data.replace(b'"$schema"', b'"x-schema"')
    for data in (source.data, bare):
        checked = check(structs.replace(source, data=data), kind=None)
        assert (checked.findings, checked.readable) == ((), True)


@pytest.mark.parametrize(
    "path", SAMPLES + VEHICLES + SENSORS + CURRICULA, ids=lambda path: path.stem
)
def test_sample_is_laid_out(path: Path) -> None:
    """Laying it out anew changes nothing."""
    text = path.read_text("utf-8")
    assert canonical(text) == text


def test_every_rule_has_a_sample() -> None:
    """Each code stands in one of the lists at least, and each list belongs to a file."""
    lists = sorted((HERE.parent / "samples" / "invalid").glob("*.expected"))
    assert [path.stem for path in lists] == [path.stem for path in INVALID]
    codes = {code for path in INVALID for _, code, _ in expected(path)[1]}
    assert codes == set(RULES) - NO_SAMPLE
    assert VALID
    assert len(SAMPLES) >= 10
    assert len(VEHICLES) >= 4
    assert len(CURRICULA) >= 2
    assert len(SENSORS) >= 4
