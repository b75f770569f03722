"""Table of all keys: terrains, libraries, vehicles, sensors and specs of training tiles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from math import inf
from typing import Any, Literal, NamedTuple, cast

import msgspec
from msgspec import Struct

from terratool.definition.curriculum import (
    CURRICULUM_KEYS,
    TILE_KEYS,
    TILE_OF_A_FILE,
    CurriculumText,
    PatchText,
    TileText,
)
from terratool.definition.key import Key, Shape
from terratool.definition.model import (
    STOREYS,
    TERRAIN_KEYS,
    Definition,
    Element,
    Library,
    Primitive,
    Repeat,
    Roughness,
    Scatter,
    Surface,
    SurfaceGrid,
    Track,
    names_of,
)
from terratool.definition.sensor import (
    SENSOR_KEYS,
    CameraText,
    LidarText,
    NoiseText,
    SensorText,
    SonarText,
)
from terratool.definition.vehicle import (
    MAX_AXLES,
    VEHICLE_KEYS,
    AxleText,
    BatteryText,
    ClassesText,
    CogText,
    FeetText,
    MarginsText,
    OverhangText,
    TracksText,
    VehicleText,
    WheelsText,
)

REQUIRED: dict[Shape, tuple[str, ...]] = {
    VehicleText: ("mass", "track", "cog", "clearance"),
    WheelsText: ("radius", "width"),
    AxleText: ("x",),
    CogText: ("height",),
    BatteryText: ("capacity",),
    TracksText: ("length", "width", "radius"),
    FeetText: ("diameter", "length", "stepHeight"),
    Roughness: ("rms", "correlation"),
    SensorText: ("range",),
    LidarText: ("elevations", "azimuthStep"),
    CameraText: ("width", "height"),
    SonarText: ("beamWidth", "threshold"),
    CurriculumText: ("rows", "columns", "kinds"),
    PatchText: ("radius",),
    TILE_OF_A_FILE: ("file",),
}
"""Keys that an object must have; rules look for those of terrains, elements and tracks."""
GEARS = ("wheels", "tracks", "feet")
"""Keys of a vehicle of which it has one: what it stands on."""
ALTERNATIVES: dict[type, dict[tuple[str, ...], str]] = {
    VehicleText: {
        GEARS: 'Add what it stands on: "wheels", "tracks" or "feet", an object.',
        ("axles", "wheelbase"): 'Add "axles", or "wheelbase" for two driven axles.',
    },
    CameraText: {
        ("fov", "focal"): 'Add "fov", the angle of view in degrees, or "focal" in pixels.',
    },
}
"""Keys of which an object must have one, and the hint where it has none."""
UNNEEDED: dict[tuple[str, ...], tuple[str, ...]] = {("axles", "wheelbase"): ("tracks", "feet")}
"""Keys beside which none of some alternatives is needed."""


class _Keys(dict[Shape, dict[str, Key]]):
    """Keys by kind of object; keys of a kind of tiles are built when they are first asked for."""

    def __missing__(self, shape: Shape) -> dict[str, Key]:
        from terratool.definition.tile_kinds import KINDS

        if not isinstance(shape, str):
            raise KeyError(shape)
        self[shape] = TILE_KEYS | KINDS[shape].keys
        return self[shape]


KEYS: Mapping[Shape, dict[str, Key]] = _Keys(
    TERRAIN_KEYS | VEHICLE_KEYS | SENSOR_KEYS | CURRICULUM_KEYS
)
"""Keys of each kind of object, in the order of the canonical layout."""


class Nested(NamedTuple):
    """Key whose value is an object of the format, or holds such objects.

    Attributes:
        kind: class of the model of the objects.
        form: container of the objects; `object` for one alone.
        item: one of the items in words, for messages; {} stands for its name or index.
        words: description of an item, as messages ask for it.
        least: fewest items of a list or a dictionary.
        most: most items of a list.
        chosen: whether the member `kind` of an item, a key of `KEYS`, decides which keys it has.
    """

    kind: type[Struct]
    form: Literal["object", "list", "dictionary", "tree"] = "object"
    item: str = ""
    words: str = "an object"
    least: int = 0
    most: float = inf
    chosen: bool = False


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
        "tracks": Nested(TracksText),
        "feet": Nested(FeetText),
        "cog": Nested(CogText),
        "overhang": Nested(OverhangText),
        "battery": Nested(BatteryText),
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
    CurriculumText: {
        "surface": Nested(Surface),
        "kinds": Nested(
            TileText, "dictionary", "the kind of tiles {}", 'an object such as {"kind": "waves"}',
            least=1, chosen=True,
        ),
        "patches": Nested(
            PatchText, "dictionary", "the level place {}", 'an object such as {"radius": 0.5}'
        ),
    },
}  # fmt: skip
"""Objects in objects by key, in the order in which they are decoded."""


MEMBERS: dict[str, type[Struct]] = {
    "repeat": Repeat, "scatter": Scatter, "surfaceGrid": SurfaceGrid, **STOREYS,
}  # fmt: skip
"""Classes of the objects that keys of elements hold, and that hold no other objects."""


BIGGEST = math.nextafter(math.inf, 0)
"""Largest double."""

JSON_TYPES: dict[str, frozenset[type]] = {
    "text": frozenset([str]), "flag": frozenset([bool]), "whole": frozenset([int]),
    "number": frozenset([int, float]), "object": frozenset([dict]), "list": frozenset([list]),
}  # fmt: skip
_NO_TYPES: frozenset[type] = frozenset()
NEVER = frozenset([str, bool, dict, type(None)])
"""Types that an element's key takes as they are, or not at all."""


class QuickCheck(NamedTuple):
    """Quick test of a value; a value that passes is valid, and others are looked at closely.

    Attributes:
        name: attribute of the model.
        types: exact types that need no conversion; empty if the value never stands alone.
        low: least number, included.
        high: largest number, included.
        number: whether whole numbers become floats.
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


class _Slots(dict[Shape, dict[str, QuickCheck]]):
    """Quick checks by kind of object, each built when it is first asked for."""

    def __missing__(self, shape: Shape) -> dict[str, QuickCheck]:
        keys = KEYS[shape]
        pairs = zip(keys, keys, strict=True) if isinstance(shape, str) else names_of(shape)
        names = {key: name for name, key in pairs}
        self[shape] = {key: _slot(names[key], value) for key, value in keys.items()}
        return self[shape]


SLOTS: Mapping[Shape, dict[str, QuickCheck]] = _Slots()
"""Quick checks of each kind of object, by key."""


def default_of(shape: Shape, key: str) -> Any:
    """Value that an absent key stands for, in the units of the text."""
    return KEYS[shape][key].default


def fits_double(number: float) -> bool:
    """Whether a double holds a number."""
    return -BIGGEST <= number <= BIGGEST


Kind = Literal["terrain", "library", "vehicle", "curriculum", "sensor"]

_TERRAIN = KEYS[Definition].keys()
_LIBRARY = KEYS[Library].keys()
_OWN: dict[Kind, Set[str]] = {
    "terrain": _TERRAIN - KEYS[VehicleText].keys(),
    "vehicle": KEYS[VehicleText].keys() - _TERRAIN,
    "curriculum": KEYS[CurriculumText].keys() - _TERRAIN,
    "sensor": KEYS[SensorText].keys() - _TERRAIN,
}
"""Keys that only texts of one kind have, by which `document_kind` tells the kind."""


def document_kind(data: bytes) -> Kind | None:
    """Kind of a text by its `$schema`, else by most of its keys; None if neither tells.

    A text whose keys of terrains are all keys of libraries, too, is a library.

    Args:
        data: text in UTF-8; None is returned for a text that is no JSON object.
    """
    try:
        members: Any = msgspec.json.decode(data, type=dict[str, msgspec.Raw])
        schema = msgspec.json.decode(members.get("$schema", b"null"))
    except (msgspec.MsgspecError, UnicodeError):
        return None
    except RecursionError:  # nested too deep for skipping
        members = _deep_members(data)
        schema = members.get("$schema")
    if isinstance(schema, str):
        name = schema.removesuffix(".schema.json").replace(":", "/").rpartition("/")[2]
        if name in _OWN or name == "library":
            return cast("Kind", name)
    counts = {kind: len(own & members.keys()) for kind, own in _OWN.items()}
    kind, *others = sorted(counts, key=counts.__getitem__, reverse=True)
    if counts[kind] == counts[others[0]]:
        return None
    if kind != "terrain":
        return kind
    if (_TERRAIN - _LIBRARY) & members.keys():
        return "terrain"
    return "library" if (_LIBRARY - {"$schema", "descr"}) & members.keys() else "terrain"


def _deep_members(data: bytes) -> dict[str, Any]:
    """Members of a JSON object, however deep it is nested; empty where the text is no object."""
    from terratool.text.syntax import JsonSyntaxError
    from terratool.text.values import read_values

    try:
        value = read_values(data)
    except JsonSyntaxError:
        return {}
    return value if isinstance(value, dict) else {}
