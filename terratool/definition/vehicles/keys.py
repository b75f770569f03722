"""Every key of a vehicle file: what its value must be, in words and in numbers."""

from __future__ import annotations

from terratool.definition.keys import Key
from terratool.definition.vehicles.model import (
    GRAVITIES,
    AxleText,
    ClassesText,
    CogText,
    MarginsText,
    OverhangText,
    VehicleText,
    WheelsText,
)

LEAST, MOST = 1e-6, 1e6
"""Of lengths and other measures of a vehicle; their products then stay finite."""
MAX_AXLES = 64
MAX_WHEELS = 16


def _measure(what: str, unit: str, most: float = MOST) -> Key:
    return Key(f"{what} in {unit}, from {LEAST:g} to {most:g}", "number", LEAST, most)


def _reserve(what: str, unit: str, most: float = MOST) -> Key:
    return Key(f"{what} in {unit}, from 0 to {most:g}", "number", 0, most)


def _share(what: str) -> Key:
    return Key(f"{what}, above 0 and up to 1", "number", 0, 1, open_low=True)


_ANGLE = Key("an angle in degrees, from 0 to below 90", "number", 0, 90, open_high=True)
_X = Key("a position in metres, positive ahead, up to 1e6 in size", "number", -MOST, MOST)

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
        "speed": _measure("a speed", "m/s"),
        "power": _reserve("a power", "W", 1e9),
        "margins": Key("the margins, an object", "object"),
        "classes": Key("the thresholds of the classes, an object", "object"),
    },
    WheelsText: {
        "radius": _measure("a radius", "metres"),
        "width": _measure("a width", "metres"),
        "maxTorque": _measure("a torque", "N m", 1e9),
        "maxSlip": _share("a slip"),
    },
    AxleText: {
        "x": _X,
        "wheels": Key(f"a whole number from 1 to {MAX_WHEELS}", "whole", 1, MAX_WHEELS),
        "driven": Key("true or false", "flag"),
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

REQUIRED: dict[type, tuple[str, ...]] = {
    VehicleText: ("mass", "wheels", "track", "cog", "clearance"),
    WheelsText: ("radius", "width"),
    AxleText: ("x",),
    CogText: ("height",),
}
"""Keys that must be there; of axles and wheelbase one must be, too."""
