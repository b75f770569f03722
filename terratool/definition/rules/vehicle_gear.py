"""Rules on what vehicles stand on: wheels, tracks or feet."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import VehicleSubject, rule
from terratool.definition.vehicle import VehicleText, WheelsText
from terratool.report.wording import join_words
from terratool.text.display import quote


def _gears(vehicle: VehicleText) -> list[str]:
    """Keys of what a vehicle stands on, in the order of the format."""
    wheels = ["wheels"] if vehicle.wheels != WheelsText() else []
    return wheels + [key for key in ("tracks", "feet") if getattr(vehicle, key) is not UNSET]


@rule("TT514", "several-gears", kind="vehicle")
def several_gears(subject: VehicleSubject) -> Iterator[Remark]:
    """A vehicle has more than one of wheels, tracks and feet, or no wheels for axles or steering.

    Half-tracks, and legs with wheels at their ends, are not known.

    Fails:

        {
          "mass": 50, "wheels": {"radius": 0.16, "width": 0.11}, "wheelbase": 0.5,
          "tracks": {"length": 0.7, "width": 0.15, "radius": 0.1},
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.08
        }

    Fails:

        {
          "mass": 50, "tracks": {"length": 0.7, "width": 0.15, "radius": 0.1},
          "wheelbase": 0.5, "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.08
        }

    Passes:

        {
          "mass": 50, "tracks": {"length": 0.7, "width": 0.15, "radius": 0.1},
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.08
        }

    To mend: keep the one that it stands on, and remove the others.
    """
    vehicle, gears = subject.vehicle, _gears(subject.vehicle)
    if len(gears) > 1:
        yield Remark(
            f"/{gears[-1]}",
            f"the vehicle has {join_words([quote(key) for key in gears])}, but stands on one of "
            "them.",
            "Keep the one that it stands on, and remove the others.",
        )
    elif gears in (["tracks"], ["feet"]):
        for key in ("axles", "wheelbase"):
            if getattr(vehicle, key) is not UNSET:
                yield Remark(
                    f"/{key}",
                    f'"{key}" belongs to wheels, and the vehicle has "{gears[0]}".',
                    f'Remove it; "length" in "{gears[0]}" says how long it stands.',
                )
        if vehicle.steering == "wheels":
            turns = "skids" if gears == ["tracks"] else "steps around"
            yield Remark(
                "/steering",
                f'"steering" is "wheels", and the vehicle has "{gears[0]}".',
                f"Remove it; such a vehicle {turns} as it turns.",
            )


@rule("TT515", "low-front", kind="vehicle")
def low_front(subject: VehicleSubject) -> Iterator[Remark]:
    """The middle of the tracks' front idler is lower than the idler's radius.

    Fails:

        {
          "mass": 50,
          "tracks": {"length": 0.7, "width": 0.15, "radius": 0.1, "frontHeight": 0.05},
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.08
        }

    Passes:

        {
          "mass": 50,
          "tracks": {"length": 0.7, "width": 0.15, "radius": 0.1, "frontHeight": 0.18},
          "track": 0.55, "cog": {"height": 0.2}, "clearance": 0.08
        }

    To mend: give the height of the idler's middle over level ground, or leave it out.
    """
    tracks = subject.vehicle.tracks
    if tracks is UNSET or tracks.radius is UNSET or tracks.front_height is UNSET:
        return
    if tracks.front_height < tracks.radius:
        yield Remark(
            "/tracks/frontHeight",
            f"the front idler's middle at {quote(tracks.front_height)} m is lower than its radius "
            f"of {quote(tracks.radius)} m, so the idler would reach into the ground.",
            "Give the height of its middle over level ground, or leave it out.",
        )


@rule("TT516", "missing-feet", kind="vehicle")
def missing_feet(subject: VehicleSubject) -> Iterator[Remark]:
    """More feet bear the vehicle than it has, or feet of one side stand in each other's place.

    Fails:

        {
          "mass": 50,
          "feet": {"diameter": 0.05, "length": 0.6, "stepHeight": 0.2, "bearingFeet": 6},
          "track": 0.4, "cog": {"height": 0.4}, "clearance": 0.3
        }

    Fails:

        {
          "mass": 50, "feet": {"diameter": 0.05, "length": 0.04, "stepHeight": 0.2},
          "track": 0.4, "cog": {"height": 0.4}, "clearance": 0.3
        }

    Passes:

        {
          "mass": 50,
          "feet": {"diameter": 0.05, "length": 0.6, "stepHeight": 0.2, "bearingFeet": 3},
          "track": 0.4, "cog": {"height": 0.4}, "clearance": 0.3
        }

    To mend: count left and right feet, and give lengths in metres.
    """
    feet = subject.vehicle.feet
    if feet is UNSET or subject.left_out("/feet", "pairs"):
        return
    pairs = 2 if feet.pairs is UNSET else feet.pairs
    if feet.bearing_feet is not UNSET and feet.bearing_feet > 2 * pairs:
        yield Remark(
            "/feet/bearingFeet",
            f"{feet.bearing_feet} feet bear it, and it has {2 * pairs}.",
            'Give the fewest that bear it while it walks, and "pairs" if there are more.',
        )
    if feet.diameter is UNSET or feet.length is UNSET:
        return
    if feet.length < feet.diameter * (pairs - 1):
        yield Remark(
            "/feet/length",
            f"{pairs} feet of {quote(feet.diameter)} m do not stand behind each other in "
            f"{quote(feet.length)} m.",
            "Give the distance of the foremost and the rearmost feet, in metres.",
        )
