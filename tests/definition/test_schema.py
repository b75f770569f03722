"""The published JSON Schema: well made, and of one mind with the reader."""

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
from terratool.cli import output_schemas
from terratool.definition import schemas
from terratool.definition.keys import KEYS, MEMBERS
from terratool.definition.model import (
    STOREYS,
    Bore,
    Deck,
    Definition,
    Element,
    Library,
    Primitive,
    Repeat,
    Roughness,
    Scatter,
    Surface,
    Track,
)
from terratool.definition.reader import Checked, check
from terratool.definition.rules.presence import PLACEMENT
from terratool.definition.schema_writing import NAMES, schema_text
from terratool.text.source import Source
from tests.budget import thinned
from tests.schemas import subschemas
from tests.strategies import Json, definitions

SCHEMA = terratool.schema()
LIBRARY = terratool.schema("library")
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
HERE = Path(__file__).parents[1]
STRUCTURAL = {"TT103", "TT104", "TT105", "TT106", "TT110", "TT303", "TT305", "TT405"}
STRUCTURAL |= {"TT215", "TT216", "TT217", "TT218", "TT601", "TT602", "TT607", "TT709", "TT711"}
"""Codes of what a schema can see: not names, grids, formulas or the order of knots."""

GOOD: Json = {
    "size": 10,
    "origin": [1, 2],
    "surfTypes": {
        "s": {"preset": "dry-sand", "color": [0, 0, 0], "cohesion": 1, "void": False},
        "g": {"roughness": {"rms": 0.01, "correlation": 0.2, "seed": 7}},
        "r": {
            "cohesion": [1, 2],
            "fricAngle": [25, 31.5],
            "sinkage": [0, 0.1],
            "shearModulus": [0.01, 0.025],
        },
    },
    "elemTypes": {"p": {"x": [1, 2], "y": "t"}, "r": {"x": "cos", "combine": "radial"}},
    "elemTree": {
        "type": "p",
        "surface": "s",
        "cells": [3, 3],
        "children": [
            {"type": "r", "cellX": 1, "cellY": 1, "span": [1, 2], "vScale": 2},
            {"part": "q", "cellX": 0, "cellY": 0, "repeat": {"count": [2, 3], "step": [1, 1]}},
            {"at": [2, 3], "extent": [1, 2], "type": "p", "turnDeg": 30},
            {"at": [5, 5], "extent": 4, "type": "p", "scatter": {"count": 3, "sizes": [1, 2]}},
            {"cellX": 2, "cellY": 2, "type": "p", "deck": {"thickness": 0.5, "datum": True}},
            {
                "cellX": 2,
                "cellY": 0,
                "type": "p",
                "vScale": -9,
                "bore": {"roof": "p", "vScale": 2, "vOffset": -5},
            },
        ],
    },
    "parts": {
        "q": {"type": "p", "children": [{"at": [0.1, 0.1], "extent": 0.1, "type": "r"}]},
        "u": {"type": "p", "deck": {"under": "p", "vOffset": -1}},
    },
    "tracks": [
        {"path": [[1, 2], [8, 2], [8, 4]], "width": 0.5, "load": 1, "depth": {"s": 0.5}},
        {"path": [[2, 2], [2, 9]], "width": 1, "depth": 0.25, "passes": 2, "multipass": 2},
        {"path": [[2, 2, 1], [2, 9, 1.5]], "width": 1, "depth": 0.25},
    ],
}


SUBSCHEMAS = list(subschemas(SCHEMA))
IDS = [pointer for pointer, _ in SUBSCHEMAS]


def resolved(schema: Json) -> Json:
    if "$ref" in schema:
        schema = SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema


def test_is_a_valid_schema() -> None:
    """It is JSON Schema 2020-12 by that standard's own schema."""
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("name", schemas.NAMES)
def test_the_files_are_fresh(name: str) -> None:
    """The files say what the table of keys and the records say; `make schemas` writes them."""
    path = HERE.parent / "schemas" / f"{name}.schema.json"
    text = schema_text(name) if name in NAMES else output_schemas.schema_text(name)
    assert path.read_text("utf-8") == text, "run make schemas"


@pytest.mark.parametrize("name", output_schemas.OUTPUTS)
def test_each_key_of_an_output_is_told(name: str) -> None:
    """By a sentence that is of JSON, as nothing of Python or of other units is in it."""
    schema = terratool.schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    for kind in (schema, *schema["$defs"].values()):
        for one in (kind, *kind["properties"].values()):
            assert re.fullmatch(r"[A-Z1].*\.", one["description"])
            assert not re.search(r"\b(None|NaN|False|infinity|Pa|rad)\b", one["description"])


@pytest.mark.parametrize(("pointer", "inner"), SUBSCHEMAS, ids=IDS)
def test_each_key_is_explained(pointer: str, inner: Json) -> None:
    """Each key has a description, a default and examples, for editors to show."""
    inner = resolved(inner)
    assert inner["description"].endswith((".", ")"))
    assert "default" in inner
    assert inner["examples"]


@pytest.mark.parametrize(
    ("kind", "properties"),
    [
        (Definition, SCHEMA["properties"]),
        (Library, LIBRARY["properties"]),
        (Scatter, SCHEMA["$defs"]["element"]["properties"]["scatter"]["properties"]),
        (Repeat, SCHEMA["$defs"]["element"]["properties"]["repeat"]["properties"]),
        (Deck, SCHEMA["$defs"]["element"]["properties"]["deck"]["properties"]),
        (Bore, SCHEMA["$defs"]["part"]["properties"]["bore"]["properties"]),
        (Surface, SCHEMA["$defs"]["surface"]["properties"]),
        (Roughness, SCHEMA["$defs"]["surface"]["properties"]["roughness"]["properties"]),
        (Primitive, SCHEMA["$defs"]["primitive"]["properties"]),
        (Element, SCHEMA["$defs"]["element"]["properties"]),
        (Element, SCHEMA["$defs"]["root"]["properties"]),
        (Element, SCHEMA["$defs"]["part"]["properties"]),
        (Track, SCHEMA["$defs"]["track"]["properties"]),
    ],
)
def test_has_the_keys_of_the_reader(kind: type, properties: Json) -> None:
    """Its keys are those that the reader knows, no more and no fewer."""
    keys = {*KEYS[kind], "x-ignore"} if kind not in MEMBERS.values() else {*KEYS[kind]}
    if properties in (SCHEMA["$defs"][name]["properties"] for name in ("root", "part")):
        keys -= PLACEMENT.keys()
    if properties == SCHEMA["$defs"]["root"]["properties"]:
        keys -= STOREYS.keys()
    assert set(properties) == keys


@pytest.mark.parametrize(("pointer", "inner"), SUBSCHEMAS, ids=IDS)
def test_its_examples_are_examples(pointer: str, inner: Json) -> None:
    """Each example, and each default that is a value, fits the key that it stands at."""
    inner = resolved(inner)
    here = {**inner, "$defs": SCHEMA["$defs"]}
    defaults = [] if inner["default"] is None else [inner["default"]]
    for example in inner["examples"] + (defaults if "primitive" not in pointer else []):
        jsonschema.Draft202012Validator(here).validate(example)


def read(definition: Any) -> Checked:
    return check(Source("t.json", json.dumps(definition).encode()))


def agree(definition: Any) -> None:
    """What the reader takes the schema takes; what is wrong by structure alone it refuses."""
    checked = read(definition)
    codes = {f.code for f in checked.findings if f.severity == "error"}
    valid = VALIDATOR.is_valid(definition)
    if not codes:
        assert valid, next(VALIDATOR.iter_errors(definition))
    elif codes <= STRUCTURAL:
        assert not valid, checked.findings


@given(definitions(rutted=True, storeyed=True))
def test_accepts_what_the_reader_accepts(definition: Json) -> None:
    """A valid definition of any kind is valid by the schema."""
    assert read(definition).definition is not None
    VALIDATOR.validate(definition)


REPLACEMENTS = [
    None, True, False, "", "t", "sum", "radial", 0, -1, 1, 3, 3.0, -0.0, 0.5, 1.5, 89.9, 90, 255,
    256, 65535, 65536, 65537, 1e6, [], [0], [1, 1], [1.0, 2.0], [1.5, 2], [0, 0], [1, 2, 3],
    [255, 256, 0], [1, 2, 3, 4], [2, 1], [0.5, 89.9], [-1, 1], [89, 90],
    [True, 1], ["1", 1], [None], [[0, 0], [1, 1]], [[0, 0], [2, 1]],
    [[0, 0, 0], [1, 1, 1]], [[]], [1, [1, 1]], {}, {"type": "p"}, {"x": [1]}, {"x": []},
    {"a": [1]}, {"combine": "radial"}, "dry-sand", "Dry-sand", 1e-31, "p", {"thickness": 1},
    {"height": 2.5}, {"under": "p"}, {"roof": "p", "vOffset": 1}, {"height": 1, "roof": "p"},
    {"thickness": 0}, {"thickness": 1, "vScale": 2}, {"datum": True}, {"thickness": 1, "x-note": 0},
    {"under": "p", "datum": 1}, [[1, 2, 3], [2, 3, 4]], [[1, 2, 3], [2, 3]], [1, 2, 1e31],
]  # fmt: skip
NEW_KEYS = ["x-note", "x-ignore",
            "x-", "X-note", "x", "y", "z", "cellx", "cellX", "cellY", "span", "type",
            "at", "extent", "repeat", "deck", "bore", "thickness", "under", "roof", "height",
            "datum", "vScale", "vOffset", "part", "parts", "use", "count", "step",
            "combine", "preset", "color", "descr", "size", "$schema", "crs", "origin", "children",
            ""]  # fmt: skip


def containers(value: Any, key: str = "") -> Iterator[Any]:
    """Every object and list of a definition but those that are a user's own."""
    if isinstance(value, dict | list) and not key.startswith("x-") and key != "crs":
        yield value
        inside = value.items() if isinstance(value, dict) else (("", item) for item in value)
        for name, item in inside:
            yield from containers(item, name)


@given(definitions(rutted=True, storeyed=True) | st.just(GOOD).map(copy.deepcopy), st.data())
def test_agrees_with_the_reader_on_mutations(definition: Json, data: st.DataObject) -> None:
    """With keys dropped, added or of another value, the schema and the reader have one verdict."""
    for _ in range(data.draw(st.integers(1, 3))):
        owner = data.draw(st.sampled_from(list(containers(definition))))
        spots = list(owner) if isinstance(owner, dict) else list(range(len(owner)))
        action = data.draw(
            st.sampled_from(["drop", "retype", "retype", "add"] if spots else ["add"])
        )
        value = copy.deepcopy(data.draw(st.sampled_from(REPLACEMENTS)))
        if action == "drop":
            owner.pop(data.draw(st.sampled_from(spots)))
        elif action == "retype":
            owner[data.draw(st.sampled_from(spots))] = value
        elif isinstance(owner, dict):
            owner[data.draw(st.sampled_from(NEW_KEYS))] = value
        else:
            owner.append(value)
    agree(definition)


@pytest.mark.parametrize("pointer", [
    "size", "origin", "crs", "descr", "$schema", "surfTypes", "surfTypes/s", "surfTypes/s/descr",
    "surfTypes/s/preset",
    "surfTypes/s/cohesion", "surfTypes/s/fricAngle", "surfTypes/s/sinkage", "surfTypes/s/color",
    "surfTypes/s/sonarRefl", "surfTypes/s/shearModulus", "surfTypes/s/void", "elemTypes",
    "elemTypes/p", "elemTypes/p/x", "elemTypes/p/y", "elemTypes/p/combine", "elemTypes/r/x",
    "elemTypes/r/y", "elemTree", "elemTree/type", "elemTree/surface", "elemTree/vScale",
    "elemTree/vOffset", "elemTree/turnDeg", "elemTree/cells", "elemTree/children", "elemTree/cellX",
    "elemTree/span", "elemTree/children/0", "elemTree/children/0/cellX",
    "elemTree/children/0/span", "elemTree/children/0/cells", "elemTree/children/0/type",
    "use", "parts", "parts/q", "parts/q/type", "parts/q/children/0/at", "elemTree/children/1/part",
    "elemTree/children/1/repeat", "elemTree/children/1/repeat/count",
    "elemTree/children/1/repeat/step", "elemTree/children/1/cells", "elemTree/children/1/type",
    "elemTree/children/1/children", "elemTree/children/1/at", "elemTree/children/2/at",
    "elemTree/children/2/extent", "elemTree/children/2/cellX", "elemTree/children/2/span",
    "elemTree/children/3/scatter", "elemTree/children/3/scatter/count",
    "elemTree/children/3/scatter/sizes", "elemTree/children/3/scatter/turned",
    "elemTree/at", "elemTree/repeat", "parts/q/cellX", "parts/q/extent",
    "elemTree/deck", "elemTree/bore", "elemTree/children/0/deck", "elemTree/children/1/deck",
    "elemTree/children/1/bore", "elemTree/children/4/deck", "elemTree/children/4/bore",
    "elemTree/children/4/deck/thickness", "elemTree/children/4/deck/under",
    "elemTree/children/4/deck/vScale", "elemTree/children/4/deck/datum",
    "elemTree/children/4/deck/height", "elemTree/children/5/bore/height",
    "elemTree/children/5/bore/roof", "elemTree/children/5/bore/vScale",
    "elemTree/children/5/bore/vOffset", "elemTree/children/5/bore/datum", "parts/u/deck",
    "parts/u/bore", "parts/u/deck/thickness", "parts/u/deck/under", "tracks/0/path",
    "tracks/0/path/1", "tracks/2/path", "tracks/2/path/0", "tracks/2/path/1/2",
])  # fmt: skip
def test_agrees_with_the_reader_on_each_key(pointer: str) -> None:
    """For every key, any one value is taken by both or refused by both; a third of them quickly."""
    *steps, last = pointer.split("/")
    for value in thinned(REPLACEMENTS, pointer):
        definition = copy.deepcopy(GOOD)
        owner: Any = definition
        for step in steps:
            owner = owner[int(step) if isinstance(owner, list) else step]
        owner[int(last) if isinstance(owner, list) else last] = copy.deepcopy(value)
        agree(definition)


def test_the_schemas_say_the_same_of_what_both_have() -> None:
    """What libraries and terrains have in common is told alike."""
    for key, inner in LIBRARY["properties"].items():
        if key != "$schema":
            assert inner == SCHEMA["properties"][key]
    for name, inner in LIBRARY["$defs"].items():
        assert inner == SCHEMA["$defs"][name]
    jsonschema.Draft202012Validator.check_schema(LIBRARY)


@given(st.sampled_from(["parts", "elemTypes", "surfTypes", "use", "size", "descr"]), st.data())
def test_the_schema_of_libraries_agrees_with_the_reader(key: str, data: st.DataObject) -> None:
    """A library whose keys are dropped or changed has one verdict, too."""
    library = {name: copy.deepcopy(GOOD[name]) for name in ("surfTypes", "elemTypes", "parts")}
    library[key] = copy.deepcopy(data.draw(st.sampled_from(REPLACEMENTS)))
    checked = check(Source("t.json", json.dumps(library).encode()), kind="library")
    codes = {f.code for f in checked.findings if f.severity == "error"}
    valid = jsonschema.Draft202012Validator(LIBRARY).is_valid(library)
    if not codes:
        assert valid
    elif codes <= STRUCTURAL:
        assert not valid, checked.findings


@pytest.mark.parametrize("value", [2.0, 1e20, 9007199254740992.0, -3, 1.5, 10**30, 10**200])
def test_agrees_on_what_a_whole_number_is(value: float) -> None:
    """3.0 and 1e20 are whole numbers to a JSON Schema, and so to the reader."""
    agree({**GOOD, "crs": value})
    agree({**GOOD, "elemTree": {"type": "p", "cells": value}})


@pytest.mark.parametrize("value", [None, True, 1, "", [], [GOOD]])
def test_agrees_that_a_definition_is_an_object(value: Any) -> None:
    """Nothing else is one."""
    assert read(value).definition is None
    assert not VALIDATOR.is_valid(value)


@pytest.mark.parametrize(
    "path", sorted((HERE / "example-files").glob("*/*.json")), ids=lambda path: path.stem
)
def test_agrees_on_the_examples(path: Path) -> None:
    """So it is for the examples that are JSON at all."""
    try:
        definition = json.loads(path.read_text("utf-8-sig"))
    except (ValueError, RecursionError):
        assert path.parent.name == "invalid"
        return
    agree(definition)
