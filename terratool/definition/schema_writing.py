"""JSON Schemas of terrains, libraries, vehicles, sensors and curricula, from the table of keys.

This module adds the rules beyond single keys: keys that go together, and the kinds of elements.
"""

from __future__ import annotations

import json
from math import inf
from typing import Any, NamedTuple

from terratool.definition.curriculum import CurriculumText, PatchText
from terratool.definition.expression import MAX_LENGTH
from terratool.definition.key import FORMULA, Key, Shape
from terratool.definition.keys import KEYS, MEMBERS, NESTED, REQUIRED
from terratool.definition.model import (
    CLASS,
    FACE_KEYS,
    FACES,
    GAPS,
    POINT_LENGTHS,
    STOREYS,
    Bore,
    Deck,
    Definition,
    Element,
    GridFile,
    Library,
    Primitive,
    Repeat,
    Scatter,
    Storey,
    Surface,
    SurfaceGrid,
    Track,
)
from terratool.definition.presets import PRESETS
from terratool.definition.rules.presence import PLACEMENT
from terratool.definition.rules.tile_faults import NAME, RESERVED
from terratool.definition.sensor import CameraText, LidarText, SensorText
from terratool.definition.tile_kinds import KINDS
from terratool.definition.vehicle import AxleText, VehicleText

Json = dict[str, Any]


class _Document(NamedTuple):
    """Kind of text that has a published schema.

    Attributes:
        shape: class of the whole text.
        title: title of the schema, without the name of the project.
        descr: description of the whole text.
        own: example of a key of the user's own.
        code: example of a warning that is not wanted.
    """

    shape: type
    title: str
    descr: str
    own: str
    code: str


_DOCUMENTS = {
    "terrain": _Document(
        Definition, "terrain definition",
        "A terrain: a dictionary of surfaces, a dictionary of primitives, and a tree of elements "
        "placed in nested grids.", "surveyed 2015", "TT208",
    ),
    "library": _Document(
        Library, "library",
        "A library: surfaces, primitives and parts for terrains and other libraries to use.",
        "surveyed 2015", "TT208",
    ),
    "vehicle": _Document(
        VehicleText, "vehicle",
        "A vehicle: its mass, wheels and axles, the space under its body, and what counts as go, "
        "caution and no-go.", "figures of the manual", "TT508",
    ),
    "sensor": _Document(
        SensorText, "sensor",
        "A sensor: a lidar, a depth camera or a sonar, its range and its noise.",
        "figures of the manual", "TT508",
    ),
    "curriculum": _Document(
        CurriculumText, "curriculum spec",
        "A grid of training tiles: rows along x, columns along y. Lengths are in metres. Ranges "
        "are [least, greatest].", "as in Isaac Lab", "TT401",
    ),
}  # fmt: skip
NAMES = tuple(_DOCUMENTS)
"""Names of the schemas that are made from the table of keys."""


def _needs(*keys: str, **properties: Any) -> Json:
    """Schema of objects that have some keys, with schemas for the values of some of them."""
    return {"required": list(keys)} | ({"properties": properties} if properties else {})


def _one_of(*keys: str, by: str = "anyOf") -> Json:
    """Schema of objects that have one of some keys."""
    return {by: [_needs(key) for key in keys]}


_GIVEN = {"$ref": "#/$defs/given"}
_RADIAL = _needs("combine", combine={"const": "radial"})
_BESIDE_PART = dict.fromkeys(("surfaceGrid", *STOREYS, "cells", "children"), False)
_TYPE_OR_PART = {
    "oneOf": [_needs("type"), _needs("part", **_BESIDE_PART)],
    "not": _needs(*STOREYS),
}
_IN_A_CELL = _needs(
    "cellX", "cellY", at=False, extent=False,
    repeat={"properties": {"step": {"items": {"type": "integer"}}}},
)  # fmt: skip
_AT_A_PLACE = _needs("at", "extent", cellX=False, cellY=False, span=False)


def _face(kind: type[Storey]) -> Json:
    """Schema of the other face of a storey: a distance, or a primitive with its numbers."""
    gap, face = GAPS[kind], FACES[kind]
    beside = dict.fromkeys((face, *FACE_KEYS), False)
    return {"oneOf": [_needs(gap, **beside), _needs(face, **{gap: False})]}


_BEYOND_KEYS: dict[Shape, Json] = {
    Definition: {"required": ["size", "elemTree"], **_one_of("elemTypes", "use")},
    Primitive: {
        "anyOf": [
            _RADIAL,
            _needs("x", x=_GIVEN),
            _needs("y", y=_GIVEN),
            _needs("grid", x=False, y=False, combine=False),
        ],
        "dependentRequired": {"registration": ["grid"]},
        "if": _RADIAL,
        "then": _needs("x", x=_GIVEN, y=False),
    },
    Element: {"allOf": [_TYPE_OR_PART, {"oneOf": [_IN_A_CELL, _AT_A_PLACE]}]},
    GridFile: {"required": ["file"]},
    SurfaceGrid: {"required": ["file", "names"]},
    Repeat: {"required": ["count", "step"]},
    Deck: _face(Deck),
    Bore: _face(Bore),
    Scatter: {"required": ["sizes"], **_one_of("count", "density", by="oneOf")},
    Track: {"required": ["path", "width"], **_one_of("load", "depth")},
    VehicleText: {
        "oneOf": [
            {"required": ["wheels"], **_one_of("axles", "wheelbase")},
            *(_needs(key, axles=False, wheelbase=False) for key in ("tracks", "feet")),
        ]
    },
    SensorText: _one_of("lidar", "camera", "sonar", by="oneOf"),
    LidarText: {
        "dependentSchemas": {
            "beams": {"properties": {"elevations": {"minItems": 2, "maxItems": 2}}}
        }
    },
    CameraText: _one_of("fov", "focal", by="oneOf"),
}
"""Schemas of the combinations of keys that an object may have."""

_OBJECTS: dict[Shape, Json] = {
    Surface: {
        "description": "A surface: soil, friction, colour, sonar and roughness. Each key is "
        "optional; what needs one that is missing says so.",
        "default": {},
        "examples": [{"cohesion": 1.04, "fricAngle": 28, "color": [194, 178, 128]}],
    },
    Primitive: {
        "description": "Two cross-section curves and how they combine.",
        "default": {},
        "examples": [{"x": [0, 1, 0], "y": []}],
    },
    Element: {
        "description": "An element: a primitive or a part, placed in a cell of its parent's grid "
        "or at a free place.",
        "default": None,
        "examples": [
            {"type": "hill", "surface": "grass", "cellX": 2, "cellY": 1, "vScale": 0.1},
            {"part": "rack", "at": [12.3, 4.5], "extent": [2.5, 0.8], "turnDeg": 90},
        ],
    },
    Track: {
        "description": "The rut of one wheel: all points no farther than half the width from the "
        "path, lowered.",
        "default": None,
        "examples": [{"path": [[2, 3], [30, 3.5]], "width": 0.2, "load": 0.25}],
    },
    AxleText: {
        "description": "An axle: wheels side by side, and what of them differs from the others.",
        "default": None,
        "examples": [
            {"x": 0.256},
            {"x": -0.37, "wheels": 1, "driven": False, "radius": 0.06, "kind": "rigid"},
        ],
    },
    PatchText: {"description": "Discs that are level."},
}
"""Texts of the schemas of objects in lists and dictionaries; other objects have those of keys."""
_PART: Json = {
    "description": "A part: an element without a place, which stands wherever elements name it.",
    "default": None,
    "examples": [
        {"type": "box", "cells": [4, 1], "children": [{"cellX": 0, "cellY": 0, "type": "box"}]}
    ],
}

_WITHOUT = {"root": frozenset((*PLACEMENT, *STOREYS)), "part": frozenset(PLACEMENT)}
"""Keys that elements without a place do not have."""

_POINT = {"type": "number", "minimum": -1e30, "maximum": 1e30}
_VALUES: dict[str, Json] = {
    "text": {"type": "string"},
    "flag": {"type": "boolean"},
    "any": {"type": ["string", "integer", "object"]},
    "paths": {"type": "array", "items": {"type": "string"}},
    "names": {
        "type": "object",
        "propertyNames": {"pattern": f"^{CLASS}$"},
        "additionalProperties": {"type": "string"},
    },
    "curve": {"anyOf": [
        {
            "description": "Samples at evenly spaced t, linear in between; one is a constant; none "
            "copies the other curve.",
            "type": "array",
            "items": _POINT,
        },
        {
            "description": "Knots [t, z] from t = 0 to t = 1, sorted by t; two at one t are a "
            "vertical step.",
            "type": "array",
            "minItems": 1,
            "items": {
                "type": "array",
                "prefixItems": [{"type": "number", "minimum": 0, "maximum": 1}, _POINT],
                "minItems": 2,
                "maxItems": 2,
                "items": False,
            },
        },
        {
            "description": "A named curve, or an expression in t.",
            "type": "string",
            "minLength": 1,
            "maxLength": MAX_LENGTH,
        },
    ]},
}  # fmt: skip
"""Schemas of values that have no range, by type."""
_EXACT = 2.0**53
"""Bound below which whole numbers are the same in every reader of JSON."""


def _list(item: Json, least: int = 0, most: float = inf) -> Json:
    """Schema of lists with a least and a largest number of items."""
    found: Json = {"type": "array", "items": item}
    if least:
        found["minItems"] = least
    if most < inf:
        found["maxItems"] = most
    return found


def _plain(value: Any) -> Any:
    """JSON value with floats that are whole and below `_EXACT` in size as integers."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    whole = isinstance(value, float) and value.is_integer() and abs(value) < _EXACT
    return int(value) if whole else value


def _number(key: Key) -> Json:
    """Schema of one number of a key."""
    found: Json = {"type": "integer" if key.kind == "whole" else "number"}
    if key.low > -inf:
        found["exclusiveMinimum" if key.open_low else "minimum"] = key.low
    if key.high < inf:
        found["exclusiveMaximum" if key.open_high else "maximum"] = key.high
    return found


def _value(key: Key) -> Json:
    """Schema of the values of a key that is no object and holds none."""
    if key.kind == "path":
        return {"anyOf": [_list(_list(_number(key), n, n), 2) for n in POINT_LENGTHS]}
    if key.kind == "grid":
        return _list(
            _list({"type": ["number", "null"], "minimum": key.low, "maximum": key.high}, 1), 1
        )
    if key.kind == "depth":
        by_name = {"type": "object", "additionalProperties": _number(key)}
        return {"anyOf": [_number(key), by_name]}
    if key.kind == "numbers":
        return _list(_number(key), 1, key.length)
    if key.kind == "formula":
        expression = {"type": "string", "minLength": 1, "maxLength": MAX_LENGTH}
        return {"anyOf": [_number(key), expression]}
    if key.kind == "formulas":
        return {"type": "object", "additionalProperties": _value(FORMULA)}
    if key.kind not in ("number", "whole"):
        return {"enum": list(key.choices)} if key.choices else _VALUES[key.kind]
    forms = [_number(key)] if key.alone else []
    if key.length:
        forms.append(_list(_number(key), key.length, key.length))
    if key.choices:
        forms.append({"enum": list(key.choices)})
    return {"anyOf": forms} if forms[1:] else forms[0]


def _texts(key: Key) -> tuple[Json, Json]:
    """Texts of a key that stand before the schema of its value, and those after it."""
    after: Json = {}
    if key.default is not None or key.examples:
        after["default"] = key.default
    if key.examples:
        after["examples"] = list(key.examples)
    return {"description": key.descr} if key.descr else {}, after


class _SchemaWriter:
    """Writer of schemas of the objects of a document, each once among the definitions.

    Attributes:
        definitions: schemas of objects by name, for `$defs`.
    """

    def __init__(self, document: _Document) -> None:
        self._document = document
        self.definitions: Json = {
            "own": {
                "description": "A key of your own: kept and ignored.",
                "default": None,
                "examples": [document.own],
            },
            "ignore": {
                "description": "Codes of warnings, or beginnings of codes, that are not wanted for "
                "this object and all in it.",
                "default": [],
                "examples": [[document.code]],
            },
        }

    def object(self, shape: Shape, without: frozenset[str] = frozenset()) -> Json:
        """Schema of an object, without its texts."""
        properties = {
            name: self._property(shape, name, key)
            for name, key in KEYS[shape].items()
            if name not in without
        }
        if not isinstance(shape, str) and shape not in (GridFile, *MEMBERS.values(), PatchText):
            properties["x-ignore"] = {"$ref": "#/$defs/ignore"}
        required = (*(("kind",) if isinstance(shape, str) else ()), *REQUIRED.get(shape, ()))
        return {
            "type": "object",
            "properties": properties,
            "patternProperties": {"^x-": {"$ref": "#/$defs/own"}},
            "additionalProperties": False,
            **({"required": list(required)} if required else {}),
            **(_TYPE_OR_PART if without else _BEYOND_KEYS.get(shape, {})),
        }

    def _property(self, shape: Shape, name: str, key: Key) -> Json:
        if isinstance(shape, str) and name == "kind":
            return {"const": shape}
        before, after = _texts(key)
        if (shape, name) == (Surface, "preset"):
            return before | {"type": "string", "enum": list(PRESETS)} | after
        if key.kind == "grid":
            return before | {"anyOf": [_value(key), self.object(GridFile)]} | after
        if key.kind == "members":
            return before | self.object(MEMBERS[name]) | after
        nested = NESTED.get(shape, {}).get(name) if isinstance(shape, type) else None
        if nested is None:
            return before | _value(key) | after
        if name == "elemTree":
            return self._reference("root", Element, before | after)
        if nested.form == "object" and shape is Surface:
            return before | self.object(nested.kind) | after
        if nested.form == "object" and nested.kind in _OBJECTS:
            return before | self._reference(name, nested.kind, _OBJECTS[nested.kind]) | after
        if nested.form == "object":
            return self._reference(name, nested.kind, before | after)
        if nested.chosen:
            return before | self._tiles() | after
        if name == "parts":
            held = self._reference("part", nested.kind, _PART)
        else:
            called = {Element: "element", PatchText: "patch"}.get(nested.kind)
            called = called or nested.kind.__name__.removesuffix("Text").lower()
            held = self._reference(called, nested.kind, _OBJECTS[nested.kind])
        if nested.form == "list":
            return before | _list(held, nested.least, nested.most) | after
        names = {"propertyNames": self._names()} if shape is CurriculumText else {}
        return before | {"type": "object", **names, "additionalProperties": held} | after

    def _reference(self, name: str, shape: Shape, texts: Json) -> Json:
        """Reference to the definition of an object, which is added where there is none."""
        if name not in self.definitions:
            self.definitions[name] = texts  # keeps the order while elements in elements are added
            without = _WITHOUT.get(name, frozenset[str]())
            after = {key: texts[key] for key in ("default", "examples") if key in texts}
            before = {"description": texts["description"]}
            self.definitions[name] = before | self.object(shape, without) | after
            if shape is Primitive:
                self.definitions["given"] = {
                    "anyOf": [{"type": "string"}, {"type": "array", "minItems": 1}],
                    "description": "A curve with values of its own.",
                    "default": None,
                    "examples": ["cos"],
                }
        return {"$ref": f"#/$defs/{name}"}

    def _names(self) -> Json:
        """Reference to the schema of names of kinds of tiles and of level places."""
        self.definitions["name"] = {
            "description": "Letters, digits, spaces, dots, _ and -.",
            "type": "string",
            "pattern": f"^{NAME}$",
            "not": {"enum": list(RESERVED)},
        }
        return {"$ref": "#/$defs/name"}

    def _tiles(self) -> Json:
        """Schema of kinds of tiles by name, each with the keys of its `kind`."""
        chosen = [
            {
                "if": _needs("kind", kind={"const": name}),
                "then": self._reference(name, name, {"description": kind.descr}),
            }
            for name, kind in KINDS.items()
        ]
        kind = {**_needs("kind", kind={"enum": list(KINDS)}), "type": "object", "allOf": chosen}
        return {
            "type": "object",
            "minProperties": 1,
            "propertyNames": self._names(),
            "additionalProperties": kind,
        }


def schema_text(name: str) -> str:
    """Text of a schema, one of `NAMES`."""
    document = _DOCUMENTS[name]
    writer = _SchemaWriter(document)
    found: Json = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:terratool:schema:{name}",
        "title": f"terratool {document.title}",
        "description": document.descr,
        **writer.object(document.shape),
        "$defs": writer.definitions,
    }
    return json.dumps(_plain(found), indent=2, ensure_ascii=False) + "\n"
