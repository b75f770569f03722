"""Rules on vehicles that do not fit their own geometry."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import ends_of
from terratool.definition.rules.base import VehicleSubject, rule
from terratool.definition.vehicle import AxleText
from terratool.text.display import quote

_CLOSE = 1e-9
_AGREE = 1e-3
"""Share of the wheelbase by which two statements of it may differ, as figures are rounded."""


@rule("TT501", "axles-overlap", kind="vehicle")
def axles_overlap(subject: VehicleSubject) -> Iterator[Remark]:
    """The wheels of two axles stand in each other's place.

    Axles whose wheels run in one track need a distance of twice the wheels' radius at least, or of
    2 √(r1 r2) where they have radii of their own; a single wheel in the middle may stand between
    two that are farther apart than its width.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.25}, {"x": 0}, {"x": -0.35}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.3,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.35}, {"x": 0}, {"x": -0.35}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: look whether it is the radius that is wanted, not the diameter, and whether all lengths
    are in metres.
    """
    vehicle = subject.vehicle
    radii, widths, track = subject.figures("radius"), subject.figures("width"), vehicle.track
    if not radii or not widths or track is UNSET:
        return
    axles = sorted(enumerate(subject.axles), key=lambda item: -_x(item[1]))
    for place, (index, axle) in enumerate(axles):
        for ahead, other in axles[:place]:
            apart = _x(other) - _x(axle)
            # circles on level ground touch at this distance
            least = 2 * math.sqrt(radii[index] * radii[ahead])
            if apart >= least * (1 - _CLOSE):
                continue
            if _beside(axle, other, track) < 0.5 * (widths[index] + widths[ahead]):
                yield Remark(
                    "/wheelbase" if vehicle.axles is UNSET else f"/axles/{index}/x",
                    f"the wheels of this axle and those of the one {quote(_short(apart))} m ahead "
                    f"stand in each other's place: their axles need {quote(_short(least))} m.",
                    'Check the positions, and "radius", which is half a diameter, in metres.',
                )
                break


def _x(axle: AxleText) -> float:
    return 0.0 if axle.x is UNSET else axle.x


def _short(number: float) -> float:
    return float(f"{number:.6g}")


def _beside(axle: AxleText, other: AxleText, track: float) -> float:
    """Smallest distance across between wheels of two axles, m."""
    return min(abs(a - b) for a, b in product(_across(axle, track), _across(other, track)))


def _across(axle: AxleText, track: float) -> list[float]:
    """Positions of the wheels of an axle, m left of the middle, evenly over the track."""
    count = axle.count
    return [track * (place / (count - 1) - 0.5) for place in range(count)] if count > 1 else [0.0]


@rule("TT502", "narrow-track", kind="vehicle")
def narrow_track(subject: VehicleSubject) -> Iterator[Remark]:
    """The track is too narrow for wheels, tracks or feet to stand side by side.

    The track is the distance of the middles of the outermost wheels; with two of them, it is their
    width at least. So it is for tracks, and for feet.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.6}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Fails:

        {
          "mass": 50, "tracks": {"length": 0.7, "width": 0.6, "radius": 0.1},
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.08
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: look whether "width" is that of one wheel, and "track" the whole distance.
    """
    track = subject.vehicle.track
    rows = [
        (width * (axle.count - 1), width, axle.count)
        for axle, width in zip(subject.axles, subject.figures("width"), strict=False)
    ]
    what = "wheels"
    for gear, figure in (("tracks", "width"), ("feet", "diameter")):
        text = getattr(subject.vehicle, gear)
        if text is not UNSET and (width := getattr(text, figure)) is not UNSET:
            rows, what = [(width, width, 2)], gear
    if track is UNSET or not rows:
        return
    least, width, most = max(rows)
    if track < least * (1 - _CLOSE):
        yield Remark(
            "/track",
            f"{most} {what} of {quote(width)} m do not stand side by side in a track of "
            f"{quote(track)} m.",
            'Give the width of one wheel, track or foot, and from middle to middle as "track".',
        )


@rule("TT503", "wheelbase-differs", kind="vehicle")
def wheelbase_differs(subject: VehicleSubject) -> Iterator[Remark]:
    """The wheelbase is not the distance of the outermost axles.

    One of the two is enough; where both stand they agree to a thousandth.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.25}, {"x": -0.25}], "wheelbase": 0.6,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.25}, {"x": -0.25}], "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: remove "wheelbase", or correct what is wrong.
    """
    vehicle = subject.vehicle
    if vehicle.axles is UNSET or vehicle.wheelbase is UNSET or not subject.axles:
        return
    front, rear = vehicle.ends
    if abs(front - rear - vehicle.wheelbase) > _AGREE * vehicle.wheelbase:
        yield Remark(
            "/wheelbase",
            f"the wheelbase is {quote(vehicle.wheelbase)} m, but the outermost axles are "
            f"{quote(_short(front - rear))} m apart.",
            'Remove "wheelbase", or correct the one that is wrong.',
        )


@rule("TT504", "tips-over", kind="vehicle")
def tips_over(subject: VehicleSubject) -> Iterator[Remark]:
    """The vehicle tips over on level ground.

    The centre of gravity has to lie between the foremost and the rearmost axle, and one axle at
    least has to have two wheels. It has to lie above the tracks, or between the feet, whose middle
    is at x = 0.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"x": 0.3, "height": 0.2}, "clearance": 0.13
        }

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.25, "wheels": 1}, {"x": -0.25, "wheels": 1}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Fails:

        {
          "mass": 50, "tracks": {"length": 0.7, "width": 0.15, "radius": 0.1},
          "track": 0.55, "cog": {"x": 0.4, "height": 0.2}, "clearance": 0.08
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.5}, {"x": 0, "wheels": 1}],
          "track": 0.55, "cog": {"x": 0.3, "height": 0.2}, "clearance": 0.13
        }

    To mend: the x of "cog" is in the same frame as that of the axles; without "axles", it counts
    from the middle of the wheelbase, positive ahead.
    """
    vehicle = subject.vehicle
    gear = next((one for one in ("tracks", "feet") if getattr(vehicle, one) is not UNSET), "axles")
    if gear == "axles" and not subject.axles:
        return
    front, rear = vehicle.ends
    # another rule reports axles that are all in one place
    out = (
        []
        if vehicle.cog.x is UNSET
        else [x for x in ends_of(vehicle.cog.x) if not rear < x < front]
    )
    if out and rear < front:
        yield Remark(
            "/cog/x",
            f"the centre of gravity at {quote(out[0])} m is not between the "
            f"{'axles' if gear == 'axles' else f'ends of the {gear}'} at {quote(front)} and "
            f"{quote(rear)} m, so the vehicle tips over on level ground.",
            "Write it in the frame of the axles, in metres, positive ahead; tracks and feet have "
            "their middle at 0.",
        )
    if subject.axles and all(axle.count < 2 for axle in subject.axles):
        yield Remark(
            "/axles",
            "no axle has two wheels, so the vehicle falls over sideways.",
            'Give "wheels" of one axle at least as 2; the model has no balance.',
        )


@rule("TT505", "nothing-driven", kind="vehicle")
def nothing_driven(subject: VehicleSubject) -> Iterator[Remark]:
    """No axle is driven, so that the vehicle cannot move by itself.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.25, "driven": false}, {"x": -0.25, "driven": false}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11},
          "axles": [{"x": 0.25}, {"x": -0.25, "driven": false}],
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13
        }

    To mend: remove "driven": false from the axles that have motors.
    """
    if subject.axles and not any(axle.is_driven for axle in subject.axles):
        yield Remark(
            "/axles",
            "no axle is driven.",
            'Remove "driven": false from the axles that have motors.',
        )


@rule("TT518", "low-height", kind="vehicle")
def low_height(subject: VehicleSubject) -> Iterator[Remark]:
    """The height of the whole vehicle is less than that of what it has.

    Its centre of gravity and the underside of its body lie below its top.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5, "track": 0.55,
          "cog": {"height": 0.2}, "clearance": 0.13, "height": 0.13
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5, "track": 0.55,
          "cog": {"height": 0.2}, "clearance": 0.13, "height": 0.39
        }

    To mend: give the height from the feet of its wheels to its top, or leave it out.
    """
    vehicle = subject.vehicle
    if vehicle.height is UNSET:
        return
    inner = {"clearance": vehicle.clearance, "centre of gravity": vehicle.cog.height}
    known = {name: max(ends_of(height)) for name, height in inner.items() if height is not UNSET}
    if known and vehicle.height <= max(known.values()):
        name = max(known, key=known.__getitem__)
        yield Remark(
            "/height",
            f"the height of {quote(vehicle.height)} m is not above the {name} at "
            f"{quote(known[name])} m.",
            "Give the height from the feet of its wheels to its top, or leave it out.",
        )


@rule("TT509", "idle-overhang", "warning", kind="vehicle")
def idle_overhang(subject: VehicleSubject) -> Iterator[Remark]:
    """An overhang can touch nothing before a wheel does, so that it has no effect.

    The end of the body lies within the outline of the wheel as seen from the side, or its height
    is given and its length is not. The length counts from the middle of the outermost wheels, not
    from their rims.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "overhang": {"front": 0.1, "frontHeight": 0.13}
        }

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "overhang": {"rearHeight": 0.13}
        }

    Passes:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.13,
          "overhang": {"front": 0.25, "frontHeight": 0.13}
        }

    To mend: measure from the middle of the wheel to the end of the body, or leave both keys out.
    """
    overhang = subject.vehicle.overhang
    placed = sorted(zip(map(_x, subject.axles), subject.figures("radius"), strict=False))
    for key, length, height, end in (
        ("front", overhang.front, overhang.front_height, placed[-1:]),
        ("rear", overhang.rear, overhang.rear_height, placed[:1]),
    ):
        if height is UNSET or subject.left_out("/overhang", key, f"{key}Height"):
            continue
        if length is UNSET:
            yield Remark(
                f"/overhang/{key}Height",
                f'"{key}Height" has no effect without "{key}".',
                f'Add "{key}", from the middle of the wheels to the end of the body, in metres.',
            )
        elif any(length**2 + (height - radius) ** 2 <= radius**2 for _, radius in end):
            yield Remark(
                f"/overhang/{key}",
                f"the {key} end of the body lies within the outline of the wheel and touches "
                "nothing before it.",
                "Measure it from the middle of the wheels, or leave both keys out.",
            )
