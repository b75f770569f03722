"""Rules on vehicles whose figures contradict each other, or are implausible."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from msgspec import UNSET, to_builtins

from terratool.definition.findings import Remark
from terratool.definition.keys import default_of
from terratool.definition.model import ends_of
from terratool.definition.rules.base import VehicleSubject, rule
from terratool.definition.vehicle import ClassesText
from terratool.text.display import quote

_ORDERED = (
    ("slip", "cautionSlip"),
    ("drift", "cautionDrift"),
)
"""Keys of thresholds for go and for caution."""

_ROLLING = 0.01
"""Resistance of hard ground, as a share of the weight: road tyres have 0.01 to 0.02."""

_PLAUSIBLE_WHEEL = (
    # key, low, high, unit
    ("radius", 0.01, 2, "m"),
    ("width", 0.003, 2, "m"),
    ("tyrePressure", 3, 1500, "kPa"),
    ("carcassStiffness", 0, 500, "kPa"),
    ("maxTorque", 1e-3, 1e5, "N m"),
    ("rollingResistance", 0, 0.5, ""),
)
_PLAUSIBLE = (
    # pointer, low, high, unit
    ("mass", 0.1, 1e5, "kg"),
    ("wheelbase", 0.03, 20, "m"),
    ("track", 0.03, 10, "m"),
    ("cog/height", 0.01, 5, "m"),
    ("clearance", 0.001, 2, "m"),
    ("bodyWidth", 0.03, 10, "m"),
    ("overhang/front", 0, 10, "m"),
    ("overhang/rear", 0, 10, "m"),
    ("overhang/frontHeight", 0.001, 5, "m"),
    ("overhang/rearHeight", 0.001, 5, "m"),
    ("speed", 0, 30, "m/s"),
    ("power", 0, 1e5, "W"),
    ("efficiency", 0.05, 1, ""),
    ("battery/capacity", 1, 1e6, "Wh"),
    ("stoppingDistance", 0.01, 1000, "m"),
    ("reactionTime", 0, 10, "s"),
)


@rule("TT506", "class-order", kind="vehicle")
def class_order(subject: VehicleSubject) -> Iterator[Remark]:
    """The slip, or the drift, up to which it is go is larger than that up to which it is caution.

    Where one of the two is left out its default counts: 0.2 for slip and 0.6 for cautionSlip, 10°
    for drift and 30° for cautionDrift.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "classes": {"slip": 0.7}
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "classes": {"slip": 0.7, "cautionSlip": 0.9}
        }

    To mend: give both, the smaller one as slip, or as drift.
    """
    if subject.left_out("", "classes"):
        return
    for key, caution_key in _ORDERED:
        if subject.left_out("/classes", key, caution_key):
            continue
        written = to_builtins(subject.vehicle.classes)
        go = written.get(key, default_of(ClassesText, key))
        caution = written.get(caution_key, default_of(ClassesText, caution_key))
        if go > caution:
            by_default = ["" if one in written else ", its default" for one in (key, caution_key)]
            yield Remark(
                f"/classes/{key if key in written else caution_key}",
                f"the {key} for go is {quote(go)}{by_default[0]}, and that for caution "
                f"{quote(caution)}{by_default[1]}, which is less.",
                f'Give both "{key}" and "{caution_key}", the smaller one as "{key}".',
            )


@rule("TT507", "weak-drive", "warning", kind="vehicle")
def weak_drive(subject: VehicleSubject) -> Iterator[Remark]:
    """The motors hardly move the vehicle on hard level ground.

    All driven wheels together push with less than a hundredth of the weight; tyres on a road
    resist with a hundredth to a fiftieth of it. The torque is that at each wheel, behind the gear.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "maxTorque": 0.1},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11, "maxTorque": 14},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: give the torque at the wheel, that of the motor times the gear ratio, in N m.
    """
    vehicle, mass = subject.vehicle, subject.vehicle.mass
    if mass is UNSET or subject.left_out("", "gravity"):
        return
    driven = [index for index, axle in enumerate(subject.axles) if axle.is_driven]
    push, count = 0.0, 0
    for index in driven:
        radius, torque = subject.figure(index, "radius"), subject.figure(index, "maxTorque")
        if radius is UNSET or torque is UNSET:
            return
        count += subject.axles[index].count
        push += subject.axles[index].count * torque / radius
    share = push / (max(ends_of(mass)) * vehicle.acceleration)
    if driven and share < _ROLLING:
        yield Remark(
            subject.place(driven[0], "maxTorque"),
            f"{count} driven wheels push with {share:.2g} of the weight by their motors, which is "
            "less than hard level ground resists with.",
            "Give the torque at the wheel, behind the gear, in N m.",
        )


@rule("TT508", "implausible-vehicle", "warning", kind="vehicle")
def implausible_vehicle(subject: VehicleSubject) -> Iterator[Remark]:
    """A value is one that hardly any vehicle has; most often it is in another unit.

    Looked at are mass (0.1 kg to 100 t), the wheels' radius (1 cm to 2 m) and width, pressure
    (3 to 1500 kPa), stiffness of the carcass and torque, in common and of an axle's own; wheelbase,
    track, the height of the centre of gravity, clearance, width of the body, overhangs, speed (up
    to 30 m/s; nothing here knows of dynamics) and power. Lugs and contact lengths have TT512.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 130
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: write lengths in metres, masses in kg, pressures in kPa and speeds in m/s; where the
    value is meant, silence TT508 by x-ignore beside it.
    """
    vehicle = subject.vehicle
    yield from _implausible(vehicle, "", _PLAUSIBLE)
    yield from _implausible(vehicle.wheels, "/wheels", _PLAUSIBLE_WHEEL)
    for index, axle in enumerate(() if vehicle.axles is UNSET else vehicle.axles):
        yield from _implausible(axle, f"/axles/{index}", _PLAUSIBLE_WHEEL)


def _implausible(
    owner: object, pointer: str, ranges: Iterable[tuple[str, float, float, str]]
) -> Iterator[Remark]:
    for path, low, high, unit in ranges:
        found = _value(owner, path)
        for value in found if isinstance(found, tuple) else (found,):
            if isinstance(value, float) and not low <= value <= high:
                of = f" {unit}" if unit else ""
                yield Remark(
                    f"{pointer}/{path}",
                    f'"{path.rpartition("/")[2]}" is {quote(value)}{of}, which hardly any vehicle '
                    f"has: they have {low:g} to {high:g}{of}.",
                    f"Check its unit, which is {unit}." if unit else "Check it; it is a share.",
                )
                break


def _value(owner: object, path: str) -> object:
    for key in path.split("/"):
        name = "".join(f"_{c.lower()}" if c.isupper() else c for c in key)
        owner = getattr(owner, name, UNSET)
    return owner


@rule("TT516", "reversed-load", kind="vehicle")
def reversed_load(subject: VehicleSubject) -> Iterator[Remark]:
    """A range of mass or of the centre of gravity is upside down: its first number is larger.

    A range is [low, high]. Which of the two numbers is mistaken cannot be told, so nothing is
    swapped.

    Fails:

        {
          "mass": [75, 50], "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": [50, 75], "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: write the smaller number first.
    """
    vehicle = subject.vehicle
    for pointer, figure in (
        ("/mass", vehicle.mass), ("/cog/height", vehicle.cog.height), ("/cog/x", vehicle.cog.x),
    ):  # fmt: skip
        if isinstance(figure, tuple) and figure[0] > figure[1]:
            name = pointer.rpartition("/")[2]
            yield Remark(
                pointer,
                f'the range of "{name}" begins with {quote(figure[0])} and ends with '
                f"{quote(figure[1])}, which is less.",
                "Write the smaller number first.",
            )


@rule("TT510", "used-up-margin", "warning", kind="vehicle")
def used_up_margin(subject: VehicleSubject) -> Iterator[Remark]:
    """A margin leaves nothing of its limit, so that no ground is good enough.

    The margin of clearance is the clearance or more, that of steps is as high as the wheels'
    radius or the clearance, or that of tipping is as large as the angle at which the vehicle tips
    over.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "margins": {"clearance": 0.13}
        }

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "margins": {"tip": 52}
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "margins": {"clearance": 0.02, "tip": 10}
        }

    To mend: give as a margin what is to be left, in metres or degrees.
    """
    vehicle, margins = subject.vehicle, subject.vehicle.margins
    for key, margin, limit, what, unit in (
        ("clearance", margins.clearance, vehicle.clearance, "the clearance is", "m"),
        ("step", margins.step, _highest_step(subject), "no step is climbed above", "m"),
        ("tip", margins.tip, _tip(subject), "it tips over at", "degrees"),
    ):
        if margin is not UNSET and limit is not UNSET and margin >= limit:
            yield Remark(
                f"/margins/{key}",
                f"a margin of {quote(margin)} {unit} leaves nothing: {what} "
                f"{quote(float(f'{limit:.6g}'))} {unit}.",
                "Give what is to be left of the limit, or leave the margin out.",
            )


def _highest_step(subject: VehicleSubject) -> float:
    clearance = subject.vehicle.clearance
    known = subject.figures("radius") + (() if clearance is UNSET else (clearance,))
    return min(known, default=math.inf)


def _tip(subject: VehicleSubject) -> float:
    """Smallest angle at which the vehicle tips over, degrees; infinity where it is not known."""
    vehicle, height = subject.vehicle, subject.vehicle.cog.height
    if height is UNSET or vehicle.track is UNSET or not subject.axles:
        return math.inf
    (front, rear), (low, high) = vehicle.ends, vehicle.cog_ends
    if subject.left_out("/cog", "x") or not rear < low <= high < front:
        return math.inf
    reach = min(0.5 * vehicle.track, front - high, low - rear)
    return math.degrees(math.atan(reach / max(ends_of(height))))
