"""Every key of terrains, vehicles and sensors: its value in words and in numbers."""

from __future__ import annotations

import math
import re
from math import inf
from typing import Any, Literal, NamedTuple, cast

import msgspec
from msgspec import Struct

from terratool.definition.model import (
    LARGEST,
    MAX_CELLS,
    MAX_SCATTERED,
    MAX_SEED,
    SMALLEST,
    Definition,
    Element,
    Library,
    Primitive,
    Repeat,
    Roughness,
    Scatter,
    Surface,
    Track,
    names_of,
)
from terratool.definition.sensor import (
    PATTERNS,
    TURN,
    CameraText,
    LidarText,
    NoiseText,
    SensorText,
    SonarText,
)
from terratool.definition.vehicle import (
    GRAVITIES,
    KINDS,
    STEERINGS,
    AxleText,
    ClassesText,
    CogText,
    MarginsText,
    OverhangText,
    VehicleText,
    WheelsText,
)

MAX_PASSES = 10**9
"""Sums of passes stay whole in doubles."""
COMBINES = ("product", "sum", "min", "max", "radial")


class Key(Struct, frozen=True):
    """A key: its value in words, its type, and the range of its number or numbers.

    Attributes:
        words: what a message asks for.
        kind: what the value, or each item of it, is.
        alone: one such value stands by itself.
        length: so many of them stand in a list, or at most so many in `numbers`; 0 where a list is
            not taken.
        choices: the texts that are taken; none means all. A number's are those that stand for one.
        noun: what one of the choices is.
    """

    words: str
    kind: Literal[
        "text",
        "number",
        "whole",
        "flag",
        "object",
        "list",
        "curve",
        "path",
        "depth",
        "members",
        "paths",
        "numbers",
        "any",
    ]
    low: float = -inf
    high: float = inf
    open_low: bool = False
    open_high: bool = False
    alone: bool = True
    length: int = 0
    choices: tuple[str, ...] = ()
    noun: str = ""

    def holds(self, number: float) -> bool:
        """Whether a number lies in the range."""
        above = number > self.low if self.open_low else number >= self.low
        below = number < self.high if self.open_high else number <= self.high
        return above and below


_TEXT = Key("a text", "text")
_SCHEMA = Key("the address of the JSON Schema, a text", "text")
_USE = Key("a list of paths of libraries", "paths")
_SURFACES = Key("a dictionary of surfaces, an object", "object")
_PRIMITIVES = Key("a dictionary of primitives, an object", "object")
_PARTS = Key("a dictionary of parts, an object", "object")
_NUMBER = Key("a number up to 1e30 in size", "number", -LARGEST, LARGEST)
_CURVE = Key(
    "a curve: numbers up to 1e30 in size, [t, z] knots, a name or an expression", "curve",
    -LARGEST, LARGEST,
)  # fmt: skip


def _figure(
    what: str, low: float, high: float = inf, *, open_low: bool = False, open_high: bool = False
) -> Key:
    """Of a soil: a number, or a range of them."""
    words = f"{what}, or a range [low, high]"
    return Key(words, "number", low, high, open_low, open_high, length=2)


KEYS: dict[type, dict[str, Key]] = {
    Definition: {
        "$schema": _SCHEMA,
        "descr": _TEXT,
        "use": _USE,
        "size": Key(
            "a side length above 0, from 1e-30 to 1e30, or a pair [x, y] of them", "number",
            SMALLEST, LARGEST, length=2,
        ),
        "origin": Key(
            "the position [x, y] of the south-west corner, two numbers up to 1e30 in size",
            "number", -LARGEST, LARGEST, alone=False, length=2,
        ),
        "crs": Key('a coordinate reference system such as "EPSG:32633"', "any"),
        "surfTypes": _SURFACES,
        "elemTypes": _PRIMITIVES,
        "parts": _PARTS,
        "elemTree": Key("the root element, an object", "object"),
        "tracks": Key("a list of tracks", "list"),
    },
    Library: {
        "$schema": _SCHEMA,
        "descr": _TEXT,
        "use": _USE,
        "surfTypes": _SURFACES,
        "elemTypes": _PRIMITIVES,
        "parts": _PARTS,
    },
    Surface: {
        "descr": _TEXT,
        "preset": Key("the name of a soil, a text", "text"),
        "cohesion": _figure("a cohesion in kPa, 0 or more", 0),
        "fricAngle": _figure(
            "a friction angle in degrees, from 0 to below 90", 0, 90, open_high=True
        ),
        "sinkage": _figure("metres of sinkage per kN of wheel load, 0 or more", 0),
        "color": Key(
            "three whole numbers [red, green, blue] from 0 to 255", "whole", 0, 255,
            alone=False, length=3,
        ),
        "sonarRefl": Key("a reflection from 0 to 1", "number", 0, 1),
        "shearModulus": _figure("a shear modulus in metres, above 0", 0, open_low=True),
        "void": Key("true or false", "flag"),
        "roughness": Key(
            'a relief, an object { "rms": …, "correlation": … }', "object"
        ),
    },
    Roughness: {
        "rms": Key(
            "the standard deviation of the relief in units of the terrain, from 0 to 1e30",
            "number", 0, LARGEST,
        ),
        "correlation": Key(
            "a correlation length above 0 in units of the terrain, from 1e-30 to 1e30", "number",
            SMALLEST, LARGEST,
        ),
        "seed": Key(f"a whole number from 0 to {MAX_SEED}", "whole", 0, MAX_SEED),
    },
    Primitive: {
        "descr": _TEXT,
        "x": _CURVE,
        "y": _CURVE,
        "combine": Key(
            "one of " + ", ".join(f'"{name}"' for name in COMBINES), "text", choices=COMBINES,
            noun="way to combine two curves",
        ),
    },
    Element: {
        "cellX": Key(
            "a column of the parent's grid, a whole number from 0", "whole", 0, MAX_CELLS - 1
        ),
        "cellY": Key(
            "a row of the parent's grid, a whole number from 0", "whole", 0, MAX_CELLS - 1
        ),
        "span": Key(
            f"two whole numbers [w, h] of cells from 1 to {MAX_CELLS}", "whole", 1, MAX_CELLS,
            alone=False, length=2,
        ),
        "at": Key(
            "the place [x, y] of the middle in the parent's cell, two numbers up to 1e30 in size",
            "number", -LARGEST, LARGEST, alone=False, length=2,
        ),
        "extent": Key(
            "a side length above 0, from 1e-30 to 1e30, or a pair [w, h] of them", "number",
            SMALLEST, LARGEST, length=2,
        ),
        "repeat": Key(
            'an object { "count": [nx, ny], "step": [dx, dy] }, counts from 1 to '
            f"{MAX_CELLS}", "members",
        ),
        "scatter": Key(
            'an object { "count": n, "sizes": [least, most], … }', "members",
        ),
        "descr": _TEXT,
        "type": Key("the name of a primitive, a text", "text"),
        "part": Key("the name of a part, a text", "text"),
        "surface": Key("the name of a surface, a text", "text"),
        "vScale": _NUMBER,
        "vOffset": _NUMBER,
        "turnDeg": Key(
            "an angle in degrees, a number up to 1e30 in size", "number", -LARGEST, LARGEST
        ),
        "cells": Key(
            f"a whole number from 1 to {MAX_CELLS}, or a pair of them", "whole", 1, MAX_CELLS,
            length=2,
        ),
        "children": Key("a list of elements", "list"),
    },
    Repeat: {
        "count": Key(
            f"two whole numbers [nx, ny] of copies from 1 to {MAX_CELLS}", "whole", 1, MAX_CELLS,
            alone=False, length=2,
        ),
        "step": Key(
            "two steps [dx, dy], numbers up to 1e30 in size", "number", -LARGEST, LARGEST,
            alone=False, length=2,
        ),
    },
    Scatter: {
        "count": Key(
            f"a whole number of copies from 1 to {MAX_SCATTERED:,}", "whole", 1, MAX_SCATTERED
        ),
        "density": Key("copies in a square unit, above 0 and up to 1e30", "number", SMALLEST,
            LARGEST),
        "sizes": Key(
            "the least and the largest side [least, most], from 1e-30 to 1e30", "number",
            SMALLEST, LARGEST, alone=False, length=2,
        ),
        "distance": Key("a distance from 0 to 1e30", "number", 0, LARGEST),
        "turned": Key("true or false", "flag"),
        "seed": Key(f"a whole number from 0 to {MAX_SEED}", "whole", 0, MAX_SEED),
    },
    Track: {
        "descr": _TEXT,
        "path": Key(
            "a list of two points [x, y] or more, numbers up to 1e30 in size", "path",
            -LARGEST, LARGEST,
        ),
        "width": Key(
            "a width above 0, from 1e-30 to 1e30", "number", SMALLEST, LARGEST
        ),
        "load": Key("the load of the wheel in kN, from 0 to 1e30", "number", 0, LARGEST),
        "depth": Key(
            "a depth from 0 to 1e30, or depths by the names of surfaces", "depth", 0, LARGEST
        ),
        "passes": Key(
            f"a whole number from 1 to {MAX_PASSES}", "whole", 1, MAX_PASSES
        ),
        "multipass": Key("an exponent of 1 or more, up to 1e30", "number", 1, LARGEST),
        "surface": Key("the name of a surface, a text", "text"),
    },
}  # fmt: skip


LEAST, MOST = 1e-6, 1e6
"""Of lengths and other measures of a vehicle; their products then stay finite."""
MAX_AXLES = 16
MAX_WHEELS = 16


def _measure(what: str, unit: str, most: float = MOST) -> Key:
    return Key(f"{what} in {unit}, from {LEAST:g} to {most:g}", "number", LEAST, most)


def _reserve(what: str, unit: str, most: float = MOST) -> Key:
    return Key(f"{what} in {unit}, from 0 to {most:g}", "number", 0, most)


def _share(what: str) -> Key:
    return Key(f"{what}, above 0 and up to 1", "number", 0, 1, open_low=True)


_ANGLE = Key("an angle in degrees, from 0 to below 90", "number", 0, 90, open_high=True)
_X = Key("a position in metres, positive ahead, up to 1e6 in size", "number", -MOST, MOST)

_WHEEL = {
    "radius": _measure("a radius", "metres"),
    "width": _measure("a width", "metres"),
    "kind": Key(
        "one of " + ", ".join(f'"{name}"' for name in KINDS), "text", choices=KINDS,
        noun="kind of wheel",
    ),
    "grouserHeight": _reserve("a height", "metres"),
    "tyrePressure": _measure("a pressure", "kPa"),
    "carcassStiffness": _reserve("a pressure", "kPa"),
    "contactLength": _reserve("a length", "metres"),
    "exitAngleRatio": Key("a ratio, from 0 to below 1", "number", 0, 1, open_high=True),
    "maxTorque": _measure("a torque", "N m", 1e9),
}  # fmt: skip
"""Of wheels in common, and of an axle's own."""

VEHICLE_KEYS: dict[type, dict[str, Key]] = {
    VehicleText: {
        "$schema": Key("the address of the JSON Schema, a text", "text"),
        "descr": Key("a text", "text"),
        "mass": _measure("a mass", "kg", 1e9),
        "gravity": Key(
            "a gravity in m/s², from 1e-06 to 1e+06, or one of "
            + ", ".join(f'"{name}"' for name in GRAVITIES),
            "number", LEAST, MOST, choices=tuple(GRAVITIES), noun="gravity that has a name",
        ),
        "wheels": Key("the wheels, an object", "object"),
        "axles": Key(f"a list of 2 to {MAX_AXLES} axles, objects", "list"),
        "wheelbase": _measure("a wheelbase", "metres"),
        "track": _measure("a track", "metres"),
        "cog": Key("the centre of gravity, an object", "object"),
        "clearance": _measure("a clearance", "metres"),
        "bodyWidth": _measure("a width", "metres"),
        "overhang": Key("the overhangs, an object", "object"),
        "steering": Key(
            "one of " + ", ".join(f'"{name}"' for name in STEERINGS), "text", choices=STEERINGS,
            noun="way to steer",
        ),
        "speed": _measure("a speed", "m/s"),
        "power": _reserve("a power", "W", 1e9),
        "margins": Key("the margins, an object", "object"),
        "classes": Key("the thresholds of the classes, an object", "object"),
    },
    WheelsText: {**_WHEEL, "maxSlip": _share("a slip")},
    AxleText: {
        "x": _X,
        "wheels": Key(f"a whole number from 1 to {MAX_WHEELS}", "whole", 1, MAX_WHEELS),
        "driven": Key("true or false", "flag"),
        **_WHEEL,
    },
    CogText: {"x": _X, "height": _measure("a height", "metres")},
    OverhangText: {
        "front": _measure("a length", "metres"),
        "frontHeight": _measure("a height", "metres"),
        "rear": _measure("a length", "metres"),
        "rearHeight": _measure("a height", "metres"),
    },
    MarginsText: {
        "clearance": _reserve("a height", "metres"),
        "step": _reserve("a height", "metres"),
        "tip": _ANGLE,
        "slope": _ANGLE,
    },
    ClassesText: {
        "utilisation": _share("a share of the soil's strength"),
        "slip": _share("a slip"),
        "cautionSlip": _share("a slip"),
        "torque": _share("a share of the largest torque"),
        "geometry": _share("a share of a limit"),
    },
}  # fmt: skip

MAX_BEAMS = 1024
"""Of a lidar, one above the other."""
MAX_PIXELS = 16384
"""Along a side of a camera's picture."""
MAX_FRAME = 10_000_000
"""Rays of a turn, a picture or a ping: some 3 GB of memory."""
MAX_BOUNCES = 4

SENSOR_KEYS: dict[type, dict[str, Key]] = {
    SensorText: {
        "$schema": _SCHEMA,
        "descr": _TEXT,
        "range": Key(
            f"the least and the largest range [least, most] in metres, from 0 to {MOST:g}",
            "number", 0, MOST, alone=False, length=2,
        ),
        "rate": _measure("turns, pictures or pings in a second", "Hz"),
        "noise": Key("what readings are off by, an object", "object"),
        "lidar": Key("a lidar, an object", "object"),
        "camera": Key("a camera, an object", "object"),
        "sonar": Key("a sonar, an object", "object"),
    },
    NoiseText: {
        "sigma": _reserve("a standard deviation", "metres"),
        "perMetre": _reserve("what a metre of range adds to the deviation", "metres"),
        "perSquareMetre": _reserve("what the square of the range adds to it", "metres"),
        "dropout": Key("a share of readings, from 0 to 1", "number", 0, 1),
    },
    LidarText: {
        "elevations": Key(
            f"a list of 1 to {MAX_BEAMS} elevations in degrees, from -90 to 90", "numbers",
            -90, 90, alone=False, length=MAX_BEAMS,
        ),
        "beams": Key(f"a whole number from 2 to {MAX_BEAMS}", "whole", 2, MAX_BEAMS),
        "azimuths": Key(
            "two angles [from, to] in degrees, from -360 to 360", "number", -TURN, TURN,
            alone=False, length=2,
        ),
        "azimuthStep": Key("an angle in degrees, from 1e-06 to 360", "number", LEAST, TURN),
        "clockwise": Key("true or false", "flag"),
        "firingInterval": Key("a time in seconds, from 0 to 1", "number", 0, 1),
    },
    CameraText: {
        "width": Key(
            f"a number of pixels, a whole number from 1 to {MAX_PIXELS}", "whole", 1, MAX_PIXELS
        ),
        "height": Key(
            f"a number of pixels, a whole number from 1 to {MAX_PIXELS}", "whole", 1, MAX_PIXELS
        ),
        "fov": Key(
            "the angle of view along the width in degrees, from 1e-06 to below 180", "number",
            LEAST, 180, open_high=True,
        ),
        "focal": Key(
            "a focal length in pixels, from 1e-06 to 1e+06, or a pair [fx, fy]", "number",
            LEAST, MOST, length=2,
        ),
        "principal": Key(
            "the place [cx, cy] of the axis in pixels, two numbers up to 1e6 in size", "number",
            -MOST, MOST, alone=False, length=2,
        ),
    },
    SonarText: {
        "beamWidth": Key(
            "an angle in degrees, from 0.01 to below 180", "number", 0.01, 180,
            open_high=True,
        ),
        "pattern": Key(
            "one of " + ", ".join(f'"{name}"' for name in PATTERNS), "text", choices=PATTERNS,
            noun="beam pattern",
        ),
        "cone": Key(
            "an angle in degrees, from 0.01 to 180", "number", 0.01, 180
        ),
        "rays": Key("a whole number from 16 to 1,000,000", "whole", 16, 1_000_000),
        "threshold": Key("an amplitude, from 1e-12 to 1e+06", "number", 1e-12, MOST),
        "pulseLength": _measure("a length", "metres"),
        "absorption": _reserve("an absorption", "dB/m"),
        "diffuse": Key("a share, from 0 to 1", "number", 0, 1),
        "lobe": Key("an angle in degrees, from 0.1 to 45", "number", 0.1, 45),
        "bounces": Key(
            f"a whole number from 1 to {MAX_BOUNCES}", "whole", 1, MAX_BOUNCES
        ),
        "sonarRefl": Key("a reflection from 0 to 1", "number", 0, 1),
    },
}  # fmt: skip

REQUIRED: dict[type, tuple[str, ...]] = {
    VehicleText: ("mass", "wheels", "track", "cog", "clearance"),
    WheelsText: ("radius", "width"),
    AxleText: ("x",),
    CogText: ("height",),
    Roughness: ("rms", "correlation"),
    SensorText: ("range",),
    LidarText: ("elevations", "azimuthStep"),
    CameraText: ("width", "height"),
    SonarText: ("beamWidth", "threshold"),
}
"""Keys of vehicles, of roughnesses and of sensors that must be there."""
ALTERNATIVES: dict[type, dict[tuple[str, str], str]] = {
    VehicleText: {
        ("axles", "wheelbase"): 'Add "axles", or "wheelbase" for two driven axles.',
    },
    CameraText: {
        ("fov", "focal"): 'Add "fov", the angle of view in degrees, or "focal" in pixels.',
    },
}
"""Two keys of which one must be there, and what to do where neither is."""

ALL_KEYS = {**KEYS, **VEHICLE_KEYS, **SENSOR_KEYS}
"""Of terrains, of vehicles and of sensors."""


class Nested(NamedTuple):
    """A key whose value is an object of the format, or holds such objects.

    Attributes:
        kind: class of the model.
        form: how they are held.
        item: one of those that are held, in words; {} is its name or index.
        words: what a message asks for in its place.
        least, most: how many a list holds.
    """

    kind: type[Struct]
    form: Literal["object", "list", "dictionary", "tree"] = "object"
    item: str = ""
    words: str = "an object"
    least: int = 0
    most: float = inf


NESTED: dict[type, dict[str, Nested]] = {
    Definition: {
        "surfTypes": Nested(Surface, "dictionary", "the surface {}"),
        "elemTypes": Nested(Primitive, "dictionary", "the primitive {}"),
        "tracks": Nested(Track, "list", "a track"),
        "parts": Nested(Element, "tree", "the part {}"),
        "elemTree": Nested(Element, "tree", "an element"),
    },
    Library: {
        "surfTypes": Nested(Surface, "dictionary", "the surface {}"),
        "elemTypes": Nested(Primitive, "dictionary", "the primitive {}"),
        "parts": Nested(Element, "tree", "the part {}"),
    },
    Surface: {"roughness": Nested(Roughness)},
    Element: {"children": Nested(Element, "list", "an element")},
    VehicleText: {
        "wheels": Nested(WheelsText),
        "cog": Nested(CogText),
        "overhang": Nested(OverhangText),
        "margins": Nested(MarginsText),
        "classes": Nested(ClassesText),
        "axles": Nested(AxleText, "list", 'item {} of "axles"', "an axle, an object", 2, MAX_AXLES),
    },
    SensorText: {
        "noise": Nested(NoiseText),
        "lidar": Nested(LidarText),
        "camera": Nested(CameraText),
        "sonar": Nested(SonarText),
    },
}
"""The objects in objects, in the order in which they are decoded."""


BIGGEST = math.nextafter(math.inf, 0)
"""The largest double."""

JSON_TYPES: dict[str, frozenset[type]] = {
    "text": frozenset([str]), "flag": frozenset([bool]), "whole": frozenset([int]),
    "number": frozenset([int, float]), "object": frozenset([dict]), "list": frozenset([list]),
}  # fmt: skip
_NO_TYPES: frozenset[type] = frozenset()
NEVER = frozenset([str, bool, dict, type(None)])
"""Types that an element's key takes as they are, or not at all."""


class QuickCheck(NamedTuple):
    """What a value is compared with first; what passes is good, the others are looked at closely.

    Attributes:
        name: attribute of the model.
        types: exact types that need no conversion, none if the value never stands alone.
        low: least number.
        high: largest number.
        number: whole numbers become floats.
    """

    name: str
    types: frozenset[type]
    low: float
    high: float
    number: bool


def _slot(name: str, key: Key) -> QuickCheck:
    low = math.nextafter(key.low, math.inf) if key.open_low else key.low
    high = math.nextafter(key.high, -math.inf) if key.open_high else key.high
    plain = key.alone and not key.choices
    types = JSON_TYPES.get(key.kind, _NO_TYPES) if plain else _NO_TYPES
    return QuickCheck(name, types, max(low, -BIGGEST), min(high, BIGGEST), key.kind == "number")


def _slots(kind: type, keys: dict[str, Key]) -> dict[str, QuickCheck]:
    names = {key: name for name, key in names_of(kind)}
    return {key: _slot(names[key], value) for key, value in keys.items()}


SLOTS: dict[type, dict[str, QuickCheck]] = {
    kind: _slots(kind, keys) for kind, keys in ALL_KEYS.items()
}


def fits_double(number: float) -> bool:
    """Whether a double holds a number."""
    return -BIGGEST <= number <= BIGGEST


CURRICULUM_KEYS = (
    "$schema", "descr", "rows", "columns", "tile", "border", "origin", "seed", "curriculum",
    "difficulty", "jitter", "surface", "kinds", "patches",
)  # fmt: skip
"""Those of the spec of a grid of training tiles, in the order of its canonical layout."""

Kind = Literal["terrain", "library", "vehicle", "curriculum", "sensor"]

_named = re.compile(
    r"(?:^|.*[/:])(terrain|library|vehicle|curriculum|sensor)(?:\.schema\.json)?"
).fullmatch
_terrain = KEYS[Definition].keys() - VEHICLE_KEYS[VehicleText].keys()
_own = KEYS[Definition].keys() - KEYS[Library].keys()
_library = KEYS[Library].keys() - {"$schema", "descr"}
_vehicle = VEHICLE_KEYS[VehicleText].keys() - KEYS[Definition].keys()
_curriculum = {*CURRICULUM_KEYS} - KEYS[Definition].keys()
_sensor = SENSOR_KEYS[SensorText].keys() - KEYS[Definition].keys()


def document_kind(data: bytes) -> Kind | None:
    """What a text is by its `$schema`, else by most of its keys; None if neither tells.

    What has only such keys of terrains as libraries have, too, is a library.

    Args:
        data: a text in UTF-8; one that is no JSON object is neither.
    """
    try:
        members: Any = msgspec.json.decode(data, type=dict[str, msgspec.Raw])
        schema = msgspec.json.decode(members.get("$schema", b"null"))
    except (msgspec.MsgspecError, UnicodeError):
        return None
    except RecursionError:  # nested too deep for skipping
        members = _deep_members(data)
        schema = members.get("$schema")
    if isinstance(schema, str) and (match := _named(schema)):
        return cast("Kind", match[1])
    counts: dict[Kind, int] = {
        "terrain": len(_terrain & members.keys()),
        "vehicle": len(_vehicle & members.keys()),
        "curriculum": len(_curriculum & members.keys()),
        "sensor": len(_sensor & members.keys()),
    }
    kind, *others = sorted(counts, key=counts.__getitem__, reverse=True)
    if counts[kind] == counts[others[0]]:
        return None
    if kind != "terrain":
        return kind
    return "terrain" if _own & members.keys() or not _library & members.keys() else "library"


def _deep_members(data: bytes) -> dict[str, Any]:
    """The members of an object, however deep it is; none where the text is no object."""
    from terratool.text.syntax import JsonSyntaxError
    from terratool.text.values import read_values

    try:
        value = read_values(data)
    except JsonSyntaxError:
        return {}
    return value if isinstance(value, dict) else {}
