"""The text of a sensor: schema and reader of one mind, findings in their places, rules."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

import terratool
from terratool.definition.keys import KEYS, document_kind
from terratool.definition.layout import canonical
from terratool.definition.reader import check
from terratool.definition.sensor import CameraText, LidarText, NoiseText, SensorText, SonarText
from terratool.text.source import Source
from tests.commands import ROOT, run
from tests.schemas import subschemas
from tests.strategies import Json

SCHEMA = terratool.schema("sensor")
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
STRUCTURAL = {"TT103", "TT104", "TT105", "TT106", "TT901", "TT903", "TT905"}
"""Codes of what a schema can see: not what is larger than what."""
SUBSCHEMAS = list(subschemas(SCHEMA))

LIDAR: Json = {
    "descr": "A lidar",
    "range": [0.5, 100],
    "rate": 10,
    "noise": {"sigma": 0.01, "perMetre": 0.001, "perSquareMetre": 0, "dropout": 0.5},
    "lidar": {
        "elevations": [-15, 15], "beams": 16, "azimuths": [-90, 180], "azimuthStep": 0.5,
        "clockwise": True, "firingInterval": 1e-6,
    },
}  # fmt: skip
CAMERA: Json = {
    "range": [0.1, 3],
    "camera": {"width": 64, "height": 48, "focal": [50, 51], "principal": [31, 20]},
}
SONAR: Json = {
    "range": [0, 9],
    "sonar": {
        "beamWidth": 10, "pattern": "uniform", "cone": 12, "rays": 99, "threshold": 1e-4,
        "pulseLength": 0.1, "absorption": 1, "diffuse": 0.1, "lobe": 2, "bounces": 3,
        "sonarRefl": 0.5,
    },
}  # fmt: skip
SLOW: Json = {"elevations": [-9, 9], "beams": 6, "azimuthStep": 1.8}


def resolved(schema: Json) -> Json:
    if "$ref" in schema:
        schema = SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema


def source(value: Any) -> Source:
    return Source("s.json", json.dumps(value).encode())


def codes(value: Any) -> list[str]:
    return [finding.code for finding in check(source(value), kind="sensor").findings]


def test_is_a_valid_schema() -> None:
    """It is JSON Schema 2020-12, and comes as the file that is published."""
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert json.loads((ROOT / "schemas" / "sensor.schema.json").read_text("utf-8")) == SCHEMA


@pytest.mark.parametrize(("pointer", "inner"), SUBSCHEMAS, ids=[p for p, _ in SUBSCHEMAS])
def test_each_key_is_explained(pointer: str, inner: Json) -> None:
    """Each key has a description, a default and examples that fit, for editors to show."""
    inner = resolved(inner)
    assert inner["description"].endswith((".", ")"))
    assert inner["examples"]
    defaults = [] if inner["default"] is None else [inner["default"]]
    here = jsonschema.Draft202012Validator({**inner, "$defs": SCHEMA["$defs"]})
    for example in inner["examples"] + defaults:
        here.validate(example)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (SensorText, ""), (NoiseText, "noise"), (LidarText, "lidar"), (CameraText, "camera"),
        (SonarText, "sonar"),
    ],
)  # fmt: skip
def test_has_the_keys_of_the_reader(kind: type, name: str) -> None:
    """Its keys are those that the reader knows, in their order, no more and no fewer."""
    properties = (SCHEMA["$defs"][name] if name else SCHEMA)["properties"]
    assert list(properties) == [*KEYS[kind], "x-ignore"]


def agree(value: Any) -> None:
    """What the reader takes the schema takes; what is wrong by structure alone it refuses."""
    checked = check(source(value), kind="sensor")
    found = {f.code for f in checked.findings if f.severity == "error"}
    assert (checked.sensor is None) == bool(found)
    valid = VALIDATOR.is_valid(value)
    if not found:
        assert valid, next(VALIDATOR.iter_errors(value))
    elif found <= STRUCTURAL:
        assert not valid, checked.findings


@pytest.mark.parametrize("value", [LIDAR, CAMERA, SONAR])
def test_accepts_what_the_schema_accepts(value: Json) -> None:
    """A sensor in order is one to both, whatever it is; each key of it is decoded."""
    checked = check(source(value), kind=None)
    assert checked.findings == ()
    assert checked.sensor is not None
    VALIDATOR.validate(value)
    (kind,) = checked.sensor.kinds
    part = getattr(checked.sensor, kind)
    attributes = zip(KEYS[type(part)], part.__struct_fields__, strict=True)
    for key, attribute in attributes:
        if key in value[kind]:
            read = getattr(part, attribute)
            assert (list(read) if isinstance(read, tuple) else read) == value[kind][key]


REPLACEMENTS = [
    None, True, False, "", "piston", "Piston", 0, -1, 1, 2, 2.0, 1.5, 1e-7, 1e6, 1e7, 1e-12, 1e-13,
    45, 46, 90, 91, 180, 181, 360, 361, 16, 16384, 16385, 1024, 1025, [], [0], [0, 1], [1, 0],
    [0, 0], [-361, 0], [-90, 91], [0, 1, 2], ["0", 1], [None, 1], [0.1] * 1024, [0.1] * 1025, {},
    {"sigma": 1}, {"elevations": [0], "azimuthStep": 1}, {"width": 1, "height": 1, "fov": 1},
    {"beamWidth": 1, "threshold": 1},
]  # fmt: skip
NEW_KEYS = [
    "x-note", "x-ignore", "X", "fov", "focal", "beams", "lidar", "camera", "sonar", "noise",
    "sigma", "descr", "$schema", "rate", "range", "dropOut",
]  # fmt: skip


def containers(value: Any, key: str = "") -> Iterator[Any]:
    """Every object and list of a sensor but those that are a user's own."""
    if isinstance(value, dict | list) and not key.startswith("x-"):
        yield value
        for name, item in value.items() if isinstance(value, dict) else (("", i) for i in value):
            yield from containers(item, name)


@given(st.sampled_from([LIDAR, CAMERA, SONAR]).map(copy.deepcopy), st.data())
def test_agrees_with_the_reader_on_mutations(value: Json, data: st.DataObject) -> None:
    """With keys dropped, added or of another value, the schema and the reader have one verdict."""
    for _ in range(data.draw(st.integers(1, 3))):
        owner = data.draw(st.sampled_from(list(containers(value))))
        spots = list(owner) if isinstance(owner, dict) else list(range(len(owner)))
        action = data.draw(
            st.sampled_from(["drop", "retype", "retype", "add"] if spots else ["add"])
        )
        new = copy.deepcopy(data.draw(st.sampled_from(REPLACEMENTS)))
        if action == "drop":
            owner.pop(data.draw(st.sampled_from(spots)))
        elif action == "retype":
            owner[data.draw(st.sampled_from(spots))] = new
        elif isinstance(owner, dict):
            owner[data.draw(st.sampled_from(NEW_KEYS))] = new
        else:
            owner.append(new)
    agree(value)


@pytest.mark.parametrize("example", [LIDAR, CAMERA, SONAR], ids=["lidar", "camera", "sonar"])
def test_agrees_with_the_reader_on_each_key(example: Json) -> None:
    """For every key, any one value is taken by both or refused by both."""
    keys: list[tuple[str, ...]] = [(key,) for key in example]
    keys += [
        (key, inner) for key, item in example.items() if isinstance(item, dict) for inner in item
    ]
    for steps in keys:
        for new in REPLACEMENTS:
            value = copy.deepcopy(example)
            owner = value if len(steps) == 1 else value[steps[0]]
            owner[steps[-1]] = copy.deepcopy(new)
            agree(value)


@pytest.mark.parametrize("value", [None, True, 1, "", []])
def test_nothing_but_an_object_is_a_sensor(value: Any) -> None:
    (finding,) = check(source(value), kind="sensor").findings
    assert finding.code == "TT105"
    assert finding.message.startswith("the sensor is ")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"range": [1, 1]}, ["TT902"]),
        ({"range": [0, 1e-6]}, []),
        ({"lidar": {"elevations": [0], "azimuths": [0, 360], "azimuthStep": 1}}, []),
        ({"lidar": {"elevations": [0], "azimuths": [-1, 359.5], "azimuthStep": 1}}, ["TT902"]),
        ({"lidar": {"elevations": [3, 1], "beams": 2, "azimuthStep": 1}}, []),
        ({"lidar": {"elevations": [3], "beams": 2, "azimuthStep": 1}}, ["TT903"]),
        # 1,000 beams of 10,000 columns are 10,000,000 rays
        ({"lidar": {"elevations": [0, 1], "beams": 1000, "azimuthStep": 0.036}}, []),
        ({"lidar": {"elevations": [0, 1], "beams": 1001, "azimuthStep": 0.036}}, ["TT904"]),
        # columns of 1.8 degrees come each 0.0005 s at 10 Hz; 5 gaps between 6 beams
        ({"lidar": {**SLOW, "firingInterval": 1e-4}}, []),
        ({"lidar": {**SLOW, "firingInterval": 1.001e-4}}, ["TT906"]),
        ({"lidar": {**SLOW, "firingInterval": 1e-4}, "rate": 10.1}, ["TT906"]),
        ({"lidar": {**SLOW, "firingInterval": 1.001e-4}, "rate": 9.9}, []),
        ({"lidar": {**SLOW, "beams": 7, "firingInterval": 1e-4}}, ["TT906"]),
        ({"lidar": {**SLOW, "firingInterval": 1}, "rate": "9"}, ["TT105"]),
        ({"lidar": {"elevations": [1], "azimuthStep": 1, "firingInterval": 1}}, []),
        ({"lidar": {"elevations": [0], "azimuthStep": 1, "beams": "2"}}, ["TT105"]),
        ({"lidar": 3}, ["TT105"]),
        ({"sonar": SONAR["sonar"]}, ["TT901"]),
    ],
)
def test_rules_at_their_limits(change: Json, expected: list[str]) -> None:
    """Each draws its line where arithmetic has it, and says nothing of what only follows."""
    assert codes({**LIDAR, **change}) == expected


def test_findings_stand_where_they_are() -> None:
    """With the line, and with what to do."""
    text = '{\n  "range": [0.1, 9],\n  "sonar": {"beamWidth": 9, "treshold": 1}\n}'
    found = check(Source("s.json", text.encode()), kind=None).findings
    assert [(f.code, f.line, f.pointer) for f in found] == [
        ("TT104", 3, "/sonar"), ("TT103", 3, "/sonar/treshold"),
    ]  # fmt: skip
    assert 'Did you mean "threshold"?' in found[1].hint


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ('{"$schema": "../../schemas/sensor.schema.json"}', "sensor"),
        ('{"range": [1, 2], "lidar": {}}', "sensor"),
        ('{"sonar": {}}', "sensor"),
        ('{"range": [1, 2], "mass": 1}', None),
        ('{"range": [1, 2], "size": 1, "elemTree": {}}', "terrain"),
    ],
)
def test_schema_and_keys_tell_what_a_text_is(text: str, kind: str | None) -> None:
    assert document_kind(text.encode()) == kind


def test_a_sensor_has_a_canonical_layout() -> None:
    """Keys in the format's order, one a line."""
    text = canonical(json.dumps(dict(reversed(LIDAR.items()))))
    assert [*json.loads(text)] == [*LIDAR]
    assert canonical(text) == text
    assert '  "noise": {' in text


def test_commands_say_what_a_sensor_is_not(tmp_path: Any) -> None:
    """A sensor is no terrain, and validate knows it among others."""
    (tmp_path / "s.json").write_text(json.dumps(SONAR))
    assert run("validate", tmp_path).out == "1 file checked, no errors, no warnings.\n"
    ran = run("info", tmp_path / "s.json")
    assert ran.code == 1
    assert "is a sensor, where a terrain is wanted" in ran.err
