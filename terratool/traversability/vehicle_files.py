"""Vehicles read from files and texts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from msgspec import UNSET, Struct, structs

from terratool.definition.keys import default_of, document_kind
from terratool.definition.model import middle_of
from terratool.definition.reader import CheckOptions, check, refusal
from terratool.definition.vehicle import (
    LUGS,
    ROLLING,
    AxleText,
    FeetText,
    TracksText,
    VehicleText,
    WheelsText,
)
from terratool.errors import DefinitionError
from terratool.text.source import read_source
from terratool.traversability.foot import disc_area
from terratool.traversability.track import SECTIONS
from terratool.traversability.vehicle import (
    GEARS,
    Axle,
    Battery,
    Feet,
    Load,
    Margins,
    Overhang,
    Thresholds,
    Tracks,
    Vehicle,
    Wheel,
)

_PLAIN = (
    "clearance", "height", "body_width", "steering", "turning_radius", "speed", "power",
    "efficiency", "stopping_distance", "reaction_time", "max_drift",
)  # fmt: skip
"""Keys of a vehicle's text that are attributes of `Vehicle` in the same units."""
WATT_HOUR = 3600.0
"""Joules in a watt-hour."""
CARCASS: float = 1e3 * default_of(WheelsText, "carcassStiffness")
"""Default pressure that a tyre's carcass adds to that of its air, Pa: an assumption."""


def load_vehicle(path: str | Path) -> Vehicle:
    """Read a vehicle file that has no errors; ``-`` is standard input.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the file has errors, listed in `findings`, or is a terrain.
    """
    source = read_source(path)
    checked = check(source, CheckOptions(warnings=False), kind="vehicle")
    if checked.vehicle is None:
        kind = document_kind(source.data)
        if kind not in ("vehicle", None):
            raise DefinitionError(
                f"{source.name}: is a {kind}, where a vehicle is wanted.",
                "Name a vehicle file here, such as samples/vehicles/husky-a200.json.",
            )
        raise refusal(checked)
    return vehicle_of(checked.vehicle, name_of(source.name))


def name_of(path: str | Path) -> str:
    """Name of a vehicle: its file's, without folder and endings."""
    return Path(path).name.removesuffix(".gz").removesuffix(".json")


def vehicle_of(text: VehicleText, name: str = "") -> Vehicle:
    """Convert a vehicle's text without errors to SI units; `name` is for reports."""
    tracks = None if text.tracks is UNSET else _tracks_of(text.tracks)
    feet = None if text.feet is UNSET else _feet_of(text.feet)
    if text.tracks is not UNSET and tracks is not None:
        common = _section_of(tracks, _set_members(text.tracks).get("max_slip", 1.0))
        half = 0.5 * (tracks.length - tracks.section)
        xs = [half - tracks.section * place for place in range(SECTIONS)]
    elif text.feet is not UNSET and feet is not None:
        pairs = _set_members(text.feet).get("pairs", 2)
        common, length = _foot_of(feet, pairs), text.ends[0] - text.ends[1]
        xs = [length * (0.5 - place / (pairs - 1)) for place in range(pairs)]
    else:
        common, xs = wheel_of(text.wheels), []
    cog_x = middle_of(text.cog_ends)
    masses, heights, _ = zip(*text.loads, strict=True)
    loads = tuple(Load(mass, height, x - cog_x) for mass, height, x in text.loads)
    placed = [Axle(x - cog_x) for x in xs] or [
        Axle(axle.x - cog_x, axle.count, axle.is_driven, _own_wheel(text, axle, common))
        for axle in text.all_axles
        if axle.x is not UNSET
    ]
    given = _set_members(text)
    if tracks is not None:
        # what is between the tracks
        given.setdefault("body_width", max(given["track"] - tracks.width, 0.0))
    elif feet is not None:
        given.setdefault("body_width", given["track"])
    overhangs, margins = _set_members(text.overhang), _set_members(text.margins)
    classes = _set_members(text.classes)
    for angles in (margins, classes):
        for key in angles.keys() & {"tip", "slope", "drift", "caution_drift"}:
            angles[key] = math.radians(angles[key])
    return Vehicle(
        wheel=common,
        # from the front to the rear, whatever the order in the file
        axles=tuple(sorted(placed, key=lambda axle: -axle.x)),
        mass=max(masses),
        gravity=text.acceleration,
        track_width=given["track"],
        cog_height=max(heights),
        front=_overhang(overhangs, "front", given["clearance"]),
        rear=_overhang(overhangs, "rear", given["clearance"]),
        margins=Margins(**margins),
        thresholds=Thresholds(**classes),
        battery=_battery(text),
        name=name,
        loads=loads if len(loads) > 1 else (),
        tracks=tracks,
        feet=feet,
        **{key: given[key] for key in _PLAIN if key in given},
    )


def _battery(text: VehicleText) -> Battery | None:
    """The battery of a vehicle's text; None where it has none."""
    if text.battery is UNSET or text.battery.capacity is UNSET:
        return None
    reserve = text.battery.reserve
    return Battery(text.battery.capacity * WATT_HOUR, 0.0 if reserve is UNSET else reserve)


def wheel_of(text: WheelsText) -> Wheel:
    """Convert a wheel's text without errors to SI units."""
    given = _set_members(text)
    lugs, pressure = 0.0, math.inf
    if text.known_kind == "lugged":
        lugs = LUGS * given["radius"]
    if "tyre_pressure" in given:
        carcass = given.get("carcass_stiffness")
        pressure = given["tyre_pressure"] * 1e3 + (CARCASS if carcass is None else carcass * 1e3)
    return Wheel(
        radius=given["radius"],
        width=given["width"],
        max_torque=given.get("max_torque", math.inf),
        max_slip=given.get("max_slip", 1.0),
        grouser_height=given.get("grouser_height", lugs),
        contact_length=given.get("contact_length", 0.0),
        patch_pressure=pressure,
        tyre=text.known_kind == "tyre",
        rolling=given.get("rolling_resistance", ROLLING * (text.known_kind == "tyre")),
    )


def _tracks_of(text: TracksText) -> Tracks:
    """Convert the text of tracks without errors to SI units."""
    given = _set_members(text)
    angle = given.get("approach_angle", default_of(TracksText, "approachAngle"))
    return Tracks(
        given["length"], given["width"], given["radius"],
        given.get("front_height", given["radius"]), math.radians(angle),
        given.get("max_torque", math.inf),
    )  # fmt: skip


def _section_of(tracks: Tracks, max_slip: float) -> Wheel:
    """A section of tracks, with the torque and the area of its whole track."""
    return Wheel(
        tracks.radius, tracks.width, tracks.max_torque, max_slip, gear=GEARS.index("tracks"),
        length=tracks.length, area=tracks.length * tracks.width,
    )  # fmt: skip


def _feet_of(text: FeetText) -> Feet:
    """Convert the text of feet without errors to SI units."""
    given = _set_members(text)
    return Feet(
        given["diameter"], given.get("reach", 0.0), given["step_height"],
        given.get("bearing_feet", given.get("pairs", 2)),
    )  # fmt: skip


def _foot_of(feet: Feet, pairs: int) -> Wheel:
    """A foot, with its share of the area of the feet that bear the vehicle as it walks."""
    area = disc_area(feet.diameter) * feet.bearing / (2 * pairs)
    return Wheel(feet.step_height, feet.diameter, gear=GEARS.index("feet"), area=area)


def _own_wheel(text: VehicleText, axle: AxleText, common: Wheel) -> Wheel | None:
    """The wheel of an axle that has wheels of its own; None for the vehicle's common wheel."""
    own = wheel_of(text.wheels_of(axle))
    return None if own == common else own


def _set_members(text: Struct) -> dict[str, Any]:
    """Members of a text that are set, by name of attribute; absent ones are left out."""
    members = structs.asdict(text).items()
    return {name: value for name, value in members if value is not UNSET}


def _overhang(given: dict[str, float], end: str, clearance: float) -> Overhang:
    """The overhang at an end, "front" or "rear"; as high as `clearance` unless the text says so."""
    if end not in given:
        return Overhang()
    return Overhang(given[end], given.get(f"{end}_height", clearance))
