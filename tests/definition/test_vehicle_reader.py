"""The text of a vehicle: schema and reader of one mind, findings in their places, rules."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

import terratool
from terratool.cli.report import REPORTERS
from terratool.definition.keys import KEYS, document_kind
from terratool.definition.layout import canonical
from terratool.definition.reader import Checked, CheckOptions, check
from terratool.definition.vehicle import (
    AxleText,
    BatteryText,
    ClassesText,
    CogText,
    MarginsText,
    OverhangText,
    VehicleText,
    WheelsText,
)
from terratool.text.source import Source
from tests.commands import ROOT, run
from tests.schemas import subschemas
from tests.strategies import Json, definitions
from tests.vehicles import LOPSIDED, SMALLEST, TRACKED, WALKING, source, vehicles

SCHEMA = terratool.schema("vehicle")
WHEELS: Json = SMALLEST["wheels"]
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
STRUCTURAL = {"TT103", "TT104", "TT105", "TT106"}
"""Codes of what a schema can see: not what follows from several figures together."""


# The schema


SUBSCHEMAS = list(subschemas(SCHEMA))
IDS = [pointer for pointer, _ in SUBSCHEMAS]


def resolved(schema: Json) -> Json:
    if "$ref" in schema:
        schema = SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema


def test_is_a_valid_schema() -> None:
    """It is JSON Schema 2020-12, and comes as the file that is published."""
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert json.loads((ROOT / "schemas" / "vehicle.schema.json").read_text("utf-8")) == SCHEMA
    with pytest.raises(terratool.RequestError, match="There is no schema"):
        terratool.schema("rover")


@pytest.mark.parametrize(("pointer", "inner"), SUBSCHEMAS, ids=IDS)
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
        (VehicleText, ""), (WheelsText, "wheels"), (AxleText, "axle"), (CogText, "cog"),
        (OverhangText, "overhang"), (BatteryText, "battery"), (MarginsText, "margins"),
        (ClassesText, "classes"),
    ],
)  # fmt: skip
def test_has_the_keys_of_the_reader(kind: type, name: str) -> None:
    """Its keys are those that the reader knows, in their order, no more and no fewer."""
    properties = (SCHEMA["$defs"][name] if name else SCHEMA)["properties"]
    assert list(properties) == [*KEYS[kind], "x-ignore"]


def agree(value: Any) -> None:
    """What the reader takes the schema takes; what is wrong by structure alone it refuses."""
    checked = check(source(value), kind="vehicle")
    codes = {f.code for f in checked.findings if f.severity == "error"}
    assert (checked.vehicle is None) == bool(codes)
    valid = VALIDATOR.is_valid(value)
    if not codes:
        assert valid, next(VALIDATOR.iter_errors(value))
    elif codes <= STRUCTURAL:
        assert not valid, checked.findings


@given(vehicles())
def test_accepts_what_the_schema_accepts(value: Json) -> None:
    """A vehicle in order is one to both."""
    assert check(source(value), CheckOptions(warnings=False), kind="vehicle").findings == ()
    VALIDATOR.validate(value)


REPLACEMENTS = [
    None, True, False, "", "tyre", "Tyre", "earth", "Earth", "venus", 0, -1, 1, 2, 2.0, 1.5, 1e-6,
    9e-7, 1e6, 1e7, 1e9, 2e9, -1e6, 89.9, 90, 16, 17, [], [{}], [{"x": 1}],
    [{"x": 1}, {"x": -1}], [1, 2], {}, {"radius": 0.1, "width": 0.1},
    {"height": 1}, {"x": 0}, {"step": 0}, {"slip": 0.1}, [2, 1], [1, 2, 3], {"capacity": 1},
    {"length": 0.7, "width": 0.15, "radius": 0.1},
    {"diameter": 0.05, "length": 0.6, "stepHeight": 0.2},
    [{"x": place} for place in range(65)],
]  # fmt: skip
NEW_KEYS = [
    "x-note",
    "x-ignore",
    "X",
    "x",
    "front",
    "wheels",
    "gravity",
    "slip",
    "descr",
    "$schema",
    "kind",
    "grouserHeight",
    "tyrePressure",
    "tracks",
    "feet",
    "battery",
    "reserve",
    "pairs",
    "frontHeight",
    "efficiency",
    "rollingResistance",
]


def containers(value: Any, key: str = "") -> Iterator[Any]:
    """Every object and list of a vehicle but those that are a user's own."""
    if isinstance(value, dict | list) and not key.startswith("x-"):
        yield value
        for name, item in value.items() if isinstance(value, dict) else (("", i) for i in value):
            yield from containers(item, name)


@given(vehicles() | st.sampled_from([LOPSIDED, TRACKED, WALKING]).map(copy.deepcopy), st.data())
def test_agrees_with_the_reader_on_mutations(value: Json, data: st.DataObject) -> None:
    """With keys dropped, added or of another value, the schema and the reader have one verdict."""
    for _ in range(data.draw(st.integers(1, 3))):
        owner = data.draw(st.sampled_from(list(containers(value))))
        spots = list(owner) if isinstance(owner, dict) else list(range(len(owner)))
        action = data.draw(st.sampled_from(["drop", "retype", "add"] if spots else ["add"]))
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


@pytest.mark.parametrize("key", [
    *LOPSIDED, "wheels/radius", "wheels/width", "wheels/maxTorque", "wheels/maxSlip", "wheels/kind",
    "wheels/grouserHeight", "wheels/tyrePressure", "wheels/carcassStiffness",
    "wheels/contactLength", "axles/0",
    "axles/0/radius", "axles/0/width", "axles/0/kind", "axles/0/grouserHeight",
    "axles/0/tyrePressure", "axles/0/carcassStiffness", "axles/0/contactLength",
    "axles/0/maxTorque", "axles/0/maxSlip",
    "axles/0/x", "axles/0/wheels", "axles/0/driven", "cog/x", "cog/height", "overhang/front",
    "overhang/rear", "overhang/rearHeight", "margins/clearance", "margins/step", "margins/tip",
    "margins/slope", "classes/utilisation", "classes/slip", "classes/cautionSlip",
    "classes/torque", "classes/geometry", "classes/drift", "classes/cautionDrift", "$schema",
])  # fmt: skip
def test_agrees_with_the_reader_on_each_key(key: str) -> None:
    """For every key, any one value is taken by both or refused by both."""
    *steps, last = key.split("/")
    for new in REPLACEMENTS:
        value = copy.deepcopy(LOPSIDED)
        owner: Any = value
        for step in steps:
            owner = owner[int(step) if isinstance(owner, list) else step]
        owner[int(last) if isinstance(owner, list) else last] = copy.deepcopy(new)
        agree(value)


@pytest.mark.parametrize("value", [None, True, 1, "", [], [SMALLEST]])
def test_nothing_but_an_object_is_a_vehicle(value: Any) -> None:
    """Both say so, and the reader says what it found."""
    agree(value)
    (finding,) = check(source(value), kind="vehicle").findings
    assert finding.code == "TT105"
    assert finding.message.startswith("the vehicle is ")


# Findings and their places


def places(text: str) -> list[tuple[int, int, str, str]]:
    findings = check(Source("v.json", text.encode()), kind="vehicle").findings
    return [(f.line, f.column, f.code, f.pointer) for f in findings]


def test_findings_stand_where_the_fault_is() -> None:
    """At the value, at the key if that is wrong, at the object that lacks one."""
    text = """{
  "mass": 50, "mass": 60,
  "wheels": {"radius": -1, "widht": 0.1},
  "axles": [{"x": 1}, {"driven": 1}],
  "track": 0.6,
  "cog": {"height": 0.2},
  "clearence": 0.1
}"""
    assert places(text) == [
        (1, 1, "TT104", ""),
        (2, 15, "TT102", "/mass"),
        (3, 13, "TT104", "/wheels"),
        (3, 24, "TT106", "/wheels/radius"),
        (3, 28, "TT103", "/wheels/widht"),
        (4, 23, "TT104", "/axles/1"),
        (4, 34, "TT105", "/axles/1/driven"),
        (7, 3, "TT103", "/clearence"),
    ]


@pytest.mark.parametrize(
    ("change", "message", "hint"),
    [
        ({"gravity": "venus"}, '"venus" is no gravity that has a name.', '"earth", "mars", "moon"'),
        ({"steering": "ackermann"}, '"ackermann" is no way to steer.', '"skid", "wheels"'),
        ({"bodywidth": 1}, '"bodywidth" is no key of a vehicle.', 'Did you mean "bodyWidth"?'),
        ({"cog": {"height": 1, "y": 0}}, "of the centre of gravity.", "It has x, height."),
        ({"margins": {"tips": 1}}, '"tips" is no key of the margins.', 'Did you mean "tip"?'),
        ({"clearance": 0}, '"clearance" is 0, out of its range.', "from 1e-06 to 1e+06"),
        ({"axles": [{"x": 1}]}, '"axles" is a list of 1 item, which', "2 to 16 axles"),
        ({"cog": {}}, '"cog" has no "height".', 'Add "height", a height in metres'),
        ({"wheels": {**WHEELS, "tyrePressure": 0}}, '"tyrePressure" is 0, out of its', "in kPa"),
        ({"wheels": {**WHEELS, "kind": "tire"}}, '"tire" is no kind of wheel.', '"lugged", "tyre"'),
        ({"wheels": {**WHEELS, "tyrePresure": 9}}, "of the wheels.", 'mean "tyrePressure"?'),
        ({"axles": [{"x": 1, "wheels": 0}, {"x": 2}]}, '"wheels" is 0, out of its', "from 1 to 16"),
        ({"axles": [{"x": 1, "maxSlip": 1}, {"x": 2}]}, '"maxSlip" is no key of an axle.', "maxT"),
        ({"classes": {"torque": 1.5}}, '"torque" is 1.5, out of its', "above 0 and up to 1."),
    ],
)
def test_findings_are_sentences_with_a_hint(change: Json, message: str, hint: str) -> None:
    """What is wrong, and what to write instead."""
    value = {**SMALLEST, **change}
    if "axles" in change:
        del value["wheelbase"]
    (finding,) = check(source(value), kind="vehicle").findings
    assert message in finding.message
    assert hint in finding.hint


def test_neither_axles_nor_wheelbase_is_one_finding() -> None:
    """It is said once, and both ways out are named."""
    value = {key: item for key, item in SMALLEST.items() if key != "wheelbase"}
    (finding,) = check(source(value), kind="vehicle").findings
    assert finding.code == "TT104"
    assert "axles" in finding.message
    assert "wheelbase" in finding.message


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("{'mass': 1}", "TT101"), ('{"mass": NaN}', "TT107"), ('{"mass": 1,}', "TT101"),
        ('{"mass": "\xff"}', "TT109"), ("", "TT101"), ("[" * 20_000, "TT108"),
    ],
)  # fmt: skip
def test_what_is_no_json_is_told_as_of_a_terrain(text: str, code: str) -> None:
    """By the same words; it is the only finding."""
    checked = check(Source("v.json", text.encode("latin-1")), kind="vehicle")
    assert not checked.readable
    assert [finding.code for finding in checked.findings] == [code]


def test_findings_are_selected_and_limited() -> None:
    """By code and by number; the others are counted."""
    value = {**SMALLEST, "mass": 0, "track": -1, "speed": 1e5, "depth": 2}
    assert codes(value) == ["TT106", "TT106", "TT508", "TT103"]
    assert codes(value, CheckOptions(warnings=False)) == ["TT106", "TT106", "TT103"]
    assert codes(value, CheckOptions(select=("TT5",))) == ["TT508"]
    assert codes(value, CheckOptions(ignore=("TT1",))) == ["TT508"]
    checked = check(source(value), CheckOptions(limit=1), kind="vehicle")
    assert len(checked.findings) == 1
    assert checked.counts.total() == 4


def codes(value: Any, options: CheckOptions | None = None) -> list[str]:
    return [finding.code for finding in check(source(value), options, kind="vehicle").findings]


def test_warnings_can_be_ignored_where_they_arise() -> None:
    """By x-ignore in the vehicle or in the object; what silences nothing is told."""
    heavy = {"radius": 3, "width": 0.1}
    value = {**SMALLEST, "wheelbase": 9, "wheels": heavy, "speed": 50}
    assert codes(value) == ["TT508", "TT508"]
    assert codes({**value, "x-ignore": ["TT508"]}) == []
    value["wheels"] = {**heavy, "x-ignore": ["TT5"]}
    assert codes(value) == ["TT508"]
    assert codes({**SMALLEST, "cog": {"height": 0.2, "x-ignore": ["TT508"]}}) == ["TT113"]
    assert codes({**SMALLEST, "x-ignore": ["TT505"]}) == ["TT113"]


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from([*NEW_KEYS, *LOPSIDED, "height", "radius"]), inner, max_size=4
        )
    ),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from([*LOPSIDED, "$schema", "x-ignore"]), anything) | anything)
def test_nothing_is_a_crash(value: Any) -> None:
    """Whatever stands under whatever key, the answer is findings, each with a place."""
    checked = check(source(value), kind=None)
    assert checked.vehicle is None or checked.definition is None
    for finding in (*checked.findings, *check(source(value), kind="vehicle").findings):
        assert finding.line == 1
        assert finding.message.endswith(".")
        assert finding.hint.endswith((".", "?"))


# Rules


def changed(**change: Any) -> Json:
    value = {**SMALLEST, **change}
    if "axles" in change:
        del value["wheelbase"]
    return value


LEVEL: Json = {"cog": {"height": 0.3}}
SIDES = [{"x": 0.25}, {"x": -0.25}]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        # the wheels are 0.32 m long; those of one track touch at that distance
        ({"wheelbase": 0.32}, []),
        ({"wheelbase": 0.319}, ["TT501"]),
        ({"axles": [{"x": 0.1}, {"x": -0.1}]}, ["TT501"]),
        ({"axles": [{"x": -0.1}, {"x": 0.1}]}, ["TT501"]),
        ({"axles": [*SIDES, {"x": 0.25}]}, ["TT501"]),
        # a wheel in the middle stands between two others, and a third is in its place
        ({"axles": [*SIDES, {"x": 0.2, "wheels": 1}]}, []),
        ({"axles": [*SIDES, {"x": 0.2, "wheels": 3}]}, ["TT501"]),
        ({"axles": [{"x": 0.25, "wheels": 3}, {"x": -0.25}, {"x": 0, "wheels": 1}]}, ["TT501"]),
        # with a narrow track, it rubs
        ({"axles": [*SIDES, {"x": 0.2, "wheels": 1}], "track": 0.2}, ["TT501"]),
        # width 0.11: so wide a track has room for two, for three, for four
        ({"track": 0.11}, []),
        ({"track": 0.109}, ["TT502"]),
        ({"axles": [{"x": 0.25, "wheels": 4}, {"x": -0.25}], "track": 0.33}, []),
        ({"axles": [{"x": 0.25, "wheels": 4}, {"x": -0.25}], "track": 0.32}, ["TT502"]),
        ({"cog": {"x": 0.249, "height": 0.2}}, []),
        ({"cog": {"x": 0.25, "height": 0.2}}, ["TT504"]),
        ({"cog": {"x": -0.25, "height": 0.2}}, ["TT504"]),
        ({"axles": [{"x": 5.5}, {"x": 5}], "cog": {"x": 5.2, "height": 0.2}}, []),
        ({"axles": [{"x": 5.5}, {"x": 5}], "cog": {"x": 0, "height": 0.2}}, ["TT504"]),
        ({"axles": [{"x": 0.25, "wheels": 1}, {"x": -0.25, "wheels": 2}]}, []),
        ({"axles": [{"x": 0.25, "driven": False}, {"x": -0.25}]}, []),
        ({"classes": {"slip": 0.6}}, []),
        ({"classes": {"slip": 0.61}}, ["TT506"]),
        ({"classes": {"cautionSlip": 0.19}}, ["TT506"]),
        ({"classes": {"slip": 0.3, "cautionSlip": 0.3}}, []),
        ({"classes": {"drift": 30}}, []),
        ({"classes": {"drift": 30.1}}, ["TT506"]),
        ({"classes": {"cautionDrift": 9.9}}, ["TT506"]),
        ({"classes": {"drift": 40, "cautionDrift": 50}}, []),
        ({"classes": {"slip": 0.7, "drift": 40}}, ["TT506", "TT506"]),
        ({"classes": {"drift": 0}}, ["TT106"]),
        ({"classes": {"cautionDrift": 90}}, ["TT106"]),
        ({"maxDrift": 0}, ["TT106"]),
        ({"height": 0}, ["TT106"]),
        ({"height": -0.4}, ["TT106"]),
        ({"height": "low"}, ["TT105"]),
        # its centre of gravity is 0.2 m high, its underside 0.13 m
        ({"height": 0.2}, ["TT518"]),
        ({"height": 0.201}, []),
        ({"cog": {"height": [0.1, 0.3]}, "height": 0.25}, ["TT518"]),
        # 4 wheels, r = 0.16: a hundredth of 490.3 N takes 0.1961 N m at each of them
        ({"wheels": {"radius": 0.16, "width": 0.11, "maxTorque": 0.197}}, []),
        ({"wheels": {"radius": 0.16, "width": 0.11, "maxTorque": 0.196}}, ["TT507"]),
        (
            {"wheels": {"radius": 0.16, "width": 0.11, "maxTorque": 0.1}, "gravity": "moon"},
            [],
        ),
        # it tips over sideways at atan(0.275 / 0.2) = 53.97, lengthways at atan(0.25 / 0.2) = 51.34
        ({"margins": {"tip": 51.3}}, []),
        ({"margins": {"tip": 51.4}}, ["TT510"]),
        ({"margins": {"tip": 50}, "track": 0.45}, ["TT510"]),
        ({"margins": {"tip": 45}, "cog": {"x": 0.1, "height": 0.2}}, ["TT510"]),
        ({"margins": {"tip": 45}, "cog": {"x": -0.1, "height": 0.2}}, ["TT510"]),
        ({"margins": {"tip": 36}, "cog": {"x": -0.1, "height": 0.2}}, []),
        ({"margins": {"step": 0.12, "clearance": 0.12}}, []),
        ({"margins": {"step": 0.16}, "clearance": 0.5}, ["TT510"]),
        # the outline of the wheel: 0.1² + 0.12² = 0.1562², and 0.1065² + 0.12² = 0.1604²
        ({"overhang": {"front": 0.1, "frontHeight": 0.04}}, ["TT509"]),
        ({"overhang": {"front": 0.107, "frontHeight": 0.04}}, []),
        ({"overhang": {"rear": 0.1, "rearHeight": 0.28}}, ["TT509"]),
        ({"overhang": {"rear": 0.1}}, []),
        # circles of 0.16 and 0.04 m on the level touch at 2 √(0.16 · 0.04) = 0.16 m
        ({"axles": [SIDES[0], {"x": 0.09, "radius": 0.04}]}, []),
        ({"axles": [SIDES[0], {"x": 0.091, "radius": 0.04}]}, ["TT501"]),
        ({"axles": [{"x": 0.091, "radius": 0.04}, SIDES[0]]}, ["TT501"]),
        # in a track of 0.2 m they are 0.1 m beside it: half of 0.11 m and of 0.09 m
        ({"axles": [*SIDES, {"x": 0.2, "wheels": 1, "width": 0.09}], "track": 0.2}, []),
        ({"axles": [*SIDES, {"x": 0.2, "wheels": 1, "width": 0.0901}], "track": 0.2}, ["TT501"]),
        ({"axles": [{"x": 0.25, "width": 0.4}, SIDES[1]], "track": 0.4}, []),
        ({"axles": [{"x": 0.25, "width": 0.41}, SIDES[1]], "track": 0.4}, ["TT502"]),
        ({"axles": [SIDES[0], {"x": -0.25, "width": 0.41}], "track": 0.4}, ["TT502"]),
        ({"axles": [{"x": 0.25, "wheels": 4, "width": 0.2}, {"x": -0.25}]}, ["TT502"]),
        # 0.16 m behind the rear axle, 0.04 m high: within a wheel of 0.2 m, not of the front's
        (
            {
                "axles": [{"x": 0.3}, {"x": -0.3, "radius": 0.2}],
                "overhang": {"rear": 0.119, "rearHeight": 0.04},
            },
            ["TT509"],
        ),
        (
            {
                "axles": [{"x": 0.3, "radius": 0.2}, {"x": -0.3}],
                "overhang": {"rear": 0.119, "rearHeight": 0.04},
            },
            [],
        ),
        (
            {
                "axles": [{"x": 0.3, "radius": 0.2}, {"x": -0.3}],
                "overhang": {"front": 0.119, "frontHeight": 0.04},
            },
            ["TT509"],
        ),
        # 490.3 N: 2 · 0.1 / 0.16 and 2 · 0.15 / 0.08 N push with 0.01020 of it, 0.0102 / 2 alone
        (
            {
                "wheels": {**WHEELS, "maxTorque": 0.1},
                "axles": [SIDES[0], {"x": -0.25, "radius": 0.08, "maxTorque": 0.15}],
            },
            [],
        ),
        (
            {
                "wheels": {**WHEELS, "maxTorque": 0.1},
                "axles": [SIDES[0], {"x": -0.25, "radius": 0.08, "maxTorque": 0.14}],
            },
            ["TT507"],
        ),
        (
            {
                "wheels": {**WHEELS, "maxTorque": 0.1},
                "axles": [SIDES[0], {"x": -0.25, "radius": 0.08, "maxTorque": 9, "driven": False}],
            },
            ["TT507"],
        ),
        # what a castor's motor would give is not asked for, what a driven wheel's gives is
        ({"axles": [{"x": 0.25, "maxTorque": 0.1}, {"x": -0.25, "driven": False}]}, ["TT507"]),
        ({"axles": [{"x": 0.25, "maxTorque": 0.1}, {"x": -0.25}]}, []),
        ({"margins": {"step": 0.1}, "axles": [SIDES[0], {"x": -0.25, "radius": 0.1}]}, ["TT510"]),
        ({"wheels": {**WHEELS, "kind": "rigid", "grouserHeight": 0.01}}, ["TT511"]),
        ({"wheels": {**WHEELS, "kind": "rigid", "grouserHeight": 0}}, []),
        ({"wheels": {**WHEELS, "kind": "rigid", "contactLength": 0.1}}, []),
        (
            {"wheels": {**WHEELS, "kind": "lugged", "tyrePressure": 9, "grouserHeight": 0.01}},
            ["TT511"],
        ),
        ({"wheels": {**WHEELS, "kind": "tyre", "tyrePressure": 9, "grouserHeight": 0.01}}, []),
        ({"wheels": {**WHEELS, "tyrePressure": 9, "grouserHeight": 0.01}}, []),
        (
            {"wheels": {**WHEELS, "kind": "rigid", "tyrePressure": 9, "carcassStiffness": 9}},
            ["TT511", "TT511"],
        ),
        ({"wheels": {**WHEELS, "grouserHeight": 0.16}}, []),
        ({"wheels": {**WHEELS, "grouserHeight": 0.161}}, ["TT512"]),
        ({"wheels": {**WHEELS, "contactLength": 0.32}}, []),
        ({"wheels": {**WHEELS, "contactLength": 0.321}}, ["TT512"]),
        ({"wheels": {**WHEELS, "carcassStiffness": 9}}, ["TT513"]),
        (
            {
                "wheels": {**WHEELS, "carcassStiffness": 9},
                "axles": [{"x": 0.25, "tyrePressure": 9}, SIDES[1]],
            },
            [],
        ),
        ({"axles": [{"x": 0.25, "carcassStiffness": 9}, SIDES[1]]}, ["TT513"]),
        (
            {
                "wheels": {**WHEELS, "tyrePressure": 9},
                "axles": [{"x": 0.25, "carcassStiffness": 9}, SIDES[1]],
            },
            [],
        ),
        # the most likely unit of these is Pa, bar, cm, mm
        ({"wheels": {**WHEELS, "tyrePressure": 68_500}}, ["TT508"]),
        ({"wheels": {**WHEELS, "tyrePressure": 1.4}}, ["TT508"]),
        ({"axles": [{"x": 0.25, "radius": 0.005}, SIDES[1]]}, ["TT508"]),
        ({"wheels": {**WHEELS, "grouserHeight": 25}}, ["TT512"]),
        ({"efficiency": 1e-6}, ["TT508"]),
        ({"efficiency": 1e-300}, ["TT106"]),
        ({"battery": {"capacity": 1, "reserve": 1}}, ["TT106"]),
        ({"mass": [60, 50]}, ["TT517"]),
        ({"mass": [50, 60, 70]}, ["TT105"]),
        ({"cog": {"x": [-0.1, 0.25], "height": 0.2}}, ["TT504"]),
    ],
)
def test_rules_at_their_limits(change: Json, expected: list[str]) -> None:
    """Each draws its line where geometry, by hand, has it."""
    assert codes(changed(**change)) == expected


@pytest.mark.parametrize(
    ("vehicle", "change", "expected"),
    [
        (TRACKED, {"wheels": WHEELS}, ["TT514"]),
        (TRACKED, {"feet": WALKING["feet"]}, ["TT514"]),
        (TRACKED, {"wheelbase": 0.7, "axles": SIDES}, ["TT514", "TT514"]),
        (TRACKED, {"steering": "skid"}, []),
        (TRACKED, {"steering": "wheels"}, ["TT514"]),
        (WALKING, {"steering": "wheels"}, ["TT514"]),
        (TRACKED, {"tracks": {**TRACKED["tracks"], "frontHeight": 0.1}}, []),
        (TRACKED, {"tracks": {**TRACKED["tracks"], "frontHeight": 0.099}}, ["TT515"]),
        (TRACKED, {"cog": {"x": [-0.05, 0.349], "height": 0.2}}, []),
        (TRACKED, {"cog": {"x": [-0.05, 0.35], "height": 0.2}}, ["TT504"]),
        (WALKING, {"feet": {**WALKING["feet"], "bearingFeet": 6}}, []),
        (WALKING, {"feet": {**WALKING["feet"], "bearingFeet": 7}}, ["TT516"]),
        (WALKING, {**LEVEL, "feet": {**WALKING["feet"], "length": 0.1}}, []),
        (WALKING, {**LEVEL, "feet": {**WALKING["feet"], "length": 0.09}}, ["TT516"]),
    ],
)
def test_rules_of_tracks_and_feet(vehicle: Json, change: Json, expected: list[str]) -> None:
    """What belongs to wheels is theirs alone, and idlers and feet have room."""
    assert codes(vehicle | change) == expected


def test_a_wheelbase_agrees_to_a_thousandth() -> None:
    """Figures are rounded; 1 in 1000 is agreement."""
    for wheelbase, expected in ((0.5, []), (0.5004, []), (0.5006, ["TT503"]), (1, ["TT503"])):
        assert codes({**SMALLEST, "axles": SIDES, "wheelbase": wheelbase}) == expected


def test_rules_say_nothing_of_what_only_follows() -> None:
    """Where a figure did not fit, what needs it is not looked at."""
    for key, wrong in (
        ("radius", "3"), ("width", -1), ("maxTorque", None),
    ):  # fmt: skip
        assert len(codes(changed(wheels={**SMALLEST["wheels"], key: wrong}))) == 1
    for change in (
        {"axles": [{"x": 0.1}, {"x": "0.1"}]},
        {"axles": [{"x": 0.25, "driven": 0}, {"x": -0.25, "driven": False}]},
        {"axles": 3},
        {"cog": 3},
        {"cog": {"x": "9", "height": 0.2}, "margins": {"tip": 89}},
        {"classes": {"slip": 0.9, "cautionSlip": 2}},
        {"classes": {"drift": 50, "cautionDrift": "60"}},
        {"overhang": {"front": "1", "frontHeight": 1}},
        {"wheels": {**WHEELS, "kind": "tire", "grouserHeight": 1}},
        {"wheels": {**WHEELS, "kind": "tyre", "tyrePressure": 0, "carcassStiffness": 9}},
        {"axles": [SIDES[0], {"x": 0.2, "radius": "0.2"}]},
        {"axles": [SIDES[0], {"x": -0.25, "width": "9"}], "track": 0.1},
        {
            "wheels": {**WHEELS, "kind": "rigid"},
            "axles": [SIDES[0], {"x": -0.25, "kind": "lug", "grouserHeight": 0.02}],
        },
        {
            "wheels": {**WHEELS, "maxTorque": 0.001},
            "axles": [SIDES[0], {"x": -0.25, "maxTorque": "9"}],
        },
        {"gravity": "Earth", "wheels": {"radius": 0.16, "width": 0.11, "maxTorque": 0.01}},
    ):
        assert len(codes(changed(**change))) == 1, change


@pytest.mark.parametrize(
    ("wheels", "axle", "code", "pointer"),
    [
        ({"kind": "lugged"}, {"tyrePressure": 80}, "TT511", "/axles/1/tyrePressure"),
        ({"grouserHeight": 0.02}, {"kind": "rigid", "tyrePressure": 80}, "TT511",
         "/axles/1/tyrePressure"),
        ({"kind": "lugged", "grouserHeight": 0.1}, {"radius": 0.09}, "TT512", "/axles/1/radius"),
        ({}, {"radius": 0.09, "grouserHeight": 0.1}, "TT512", "/axles/1/grouserHeight"),
        ({"contactLength": 0.2}, {"radius": 0.09}, "TT512", "/axles/1/radius"),
        ({"contactLength": 0.4}, {"width": 0.1}, "TT512", "/wheels/contactLength"),
        ({"kind": "rigid", "tyrePressure": 80}, {"kind": "rigid", "radius": 0.1}, "TT511",
         "/wheels/tyrePressure"),
        ({"contactLength": 0.4, "radius": 0.1}, {"radius": 0.15}, "TT512", None),
        # another kind takes over neither lugs nor pressure nor contact
        ({"kind": "lugged", "grouserHeight": 0.1}, {"kind": "tyre", "radius": 0.09}, None, ""),
        ({"tyrePressure": 80}, {"kind": "rigid"}, None, ""),
        ({"tyrePressure": 80, "contactLength": 0.2}, {"kind": "rigid", "radius": 0.09}, None, ""),
        # the same kind does, and so does none
        ({"tyrePressure": 80, "contactLength": 0.2}, {"kind": "tyre", "radius": 0.09}, "TT512",
         "/axles/1/radius"),
        ({"tyrePressure": 80}, {"grouserHeight": 0.02}, None, ""),
        ({"grouserHeight": 0.02}, {"tyrePressure": 80}, None, ""),
    ],
)  # fmt: skip
def test_an_axle_and_the_common_wheels_are_seen_together(
    wheels: Json, axle: Json, code: str | None, pointer: str | None
) -> None:
    """A finding stands where the axle wrote what is wrong, and once."""
    value = changed(wheels={**WHEELS, **wheels}, axles=[{"x": 0.3}, {"x": -0.3, **axle}])
    found = [(f.code, f.pointer) for f in check(source(value), kind="vehicle").findings]
    if pointer is None:
        assert found == [(code, "/wheels/contactLength"), (code, "/axles/1/radius")]
    else:
        assert found == ([(code, pointer)] if code else [])


# Recognising


@given(definitions())
def test_a_terrain_is_recognised(definition: Json) -> None:
    """By its keys."""
    assert document_kind(json.dumps(definition).encode()) == "terrain"


@given(vehicles())
def test_a_vehicle_is_recognised(value: Json) -> None:
    """By its keys."""
    assert document_kind(json.dumps(value).encode()) == "vehicle"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ('{"$schema": "../schemas/vehicle.schema.json", "size": 1}', "vehicle"),
        ('{"$schema": "urn:terratool:schema:terrain", "mass": 1}', "terrain"),
        ('{"$schema": "urn:terratool:schema:vehicle"}', "vehicle"),
        ('{"$schema": "https://json-schema.org/draft/2020-12/schema", "mass": 1}', "vehicle"),
        ('{"$schema": 3, "mass": 1}', "vehicle"),
        ('{"$schema": "../../schemas/curriculum.schema.json", "size": 1}', "curriculum"),
        ('{"rows": 2, "columns": 3, "kinds": {}}', "curriculum"),
        ('{"rows": 2, "mass": 1}', None), ('{"rows": 2, "mass": 1, "wheels": {}}', "vehicle"),
        ('{"kinds": {}, "size": 1, "elemTree": {}}', "terrain"),
        ('{"descr": "a vehicle"}', None),
        ('{"size": 1, "mass": 1}', None),
        ("[]", None), ("3", None), ("{", None), ("", None), ("[" * 5000, None),
        ('{"mass": 1e999, "wheels": {}}', "vehicle"),
    ],
)  # fmt: skip
def test_schema_and_keys_tell_what_a_text_is(text: str, kind: str | None) -> None:
    """The schema first, then the keys; where neither does, it is read as a terrain."""
    assert document_kind(text.encode()) == kind


def test_what_is_neither_is_read_as_a_terrain() -> None:
    """So nothing changes for terrains that are far from valid."""
    checked: Checked = check(Source("t.json", b'{"descr": 3}'), kind=None)
    assert 'the terrain has no "size".' in [finding.message for finding in checked.findings]


# The command line


@pytest.mark.slow
@pytest.mark.parametrize("form", sorted(REPORTERS))
def test_validate_knows_vehicles_among_terrains(form: str, tmp_path: Path) -> None:
    """In each format of reports; the exit code counts both."""
    (tmp_path / "a.json").write_text((ROOT / "samples" / "paper-example.json").read_text("utf-8"))
    (tmp_path / "b.json").write_text(json.dumps(SMALLEST))
    assert run("validate", "--strict", "--format", form, tmp_path).code == 0
    (tmp_path / "c.json").write_text(json.dumps({**SMALLEST, "track": 0.01}))
    ran = run("validate", "--strict", "--format", form, tmp_path)
    assert ran.code == 1
    assert "c.json" in ran.out
    assert "TT502" in ran.out
    assert ran.err == ""


def test_a_vehicle_has_a_canonical_layout() -> None:
    """Keys in the format's order, one a line; the user's own come last."""
    text = canonical(json.dumps({**dict(reversed(LOPSIDED.items())), "$schema": "vehicle"}))
    lines = text.splitlines()
    keys = re.findall(r'^  "([^"]+)"', text, re.MULTILINE)
    assert keys == ["$schema", *LOPSIDED]
    assert '    "kind": "lugged",' in lines
    assert '    { "x": -0.3, "driven": true, "grouserHeight": 0.025, "maxTorque": 45 }' in lines
    assert canonical(text) == text
    assert json.loads(text) == {**LOPSIDED, "$schema": "vehicle"}
