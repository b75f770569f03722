"""Keys of reports about a vehicle."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct, structs

from terratool.definition.vehicle import STEERINGS
from terratool.report.documents import (
    Share,
    one_of,
)
from terratool.traversability.report.keys import (
    Degrees,
    Kilograms,
    Kilopascals,
    Metres,
    MetresPerSecond,
    MetresPerSquareSecond,
    NewtonMetres,
    Newtons,
    ResultMember,
    Seconds,
    WattHours,
    Watts,
    fill_keys,
)
from terratool.traversability.vehicle import GEARS, Vehicle


class WheelKeys(Struct, frozen=True):
    """Wheel of a vehicle."""

    radius_m: Metres
    width_m: Metres
    grouser_height_m: Annotated[Metres, Meta(ge=0)]
    contact_length_m: Annotated[Metres, Meta(ge=0)]
    patch_pressure_kPa: Kilopascals | None
    tread_m: Annotated[Metres, Meta(ge=0)]
    max_torque_Nm: NewtonMetres | None
    max_slip: Share


class AxleKeys(Struct, frozen=True):
    """Axle: wheels side by side, or a section of both tracks, or a pair of feet."""

    x_m: Metres
    wheels: Annotated[int, Meta(ge=1)]
    driven: bool
    wheel: WheelKeys | None


class TracksKeys(Struct, frozen=True):
    """Tracks of a vehicle."""

    length_m: Metres
    width_m: Metres
    radius_m: Metres
    front_height_m: Metres
    approach_deg: Degrees
    max_torque_Nm: NewtonMetres | None


class FeetKeys(Struct, frozen=True):
    """Feet of a vehicle."""

    diameter_m: Metres
    reach_m: Annotated[Metres, Meta(ge=0)]
    step_height_m: Metres
    bearing: Annotated[int, Meta(ge=1)]


class OverhangKeys(Struct, frozen=True):
    """Overhang of the body beyond an outermost axle."""

    length_m: Metres
    height_m: Metres | None


class MarginKeys(Struct, frozen=True):
    """Margins that are kept in reserve."""

    clearance_m: Metres
    step_m: Metres
    tip_deg: Degrees
    slope_deg: Degrees
    soil_deg: Degrees


class ThresholdKeys(Struct, frozen=True):
    """Limits at which go ends and caution ends."""

    utilisation: float
    slip: float
    caution_slip: float
    torque: float
    geometry: float
    drift_deg: Degrees
    caution_drift_deg: Degrees


class LoadKeys(Struct, frozen=True):
    """Load of a vehicle.

    Attributes:
        mass_kg: mass of all.
        cog_ahead_m: distance of the centre of gravity ahead of that of the vehicle.
    """

    mass_kg: Kilograms
    cog_height_m: Metres
    cog_ahead_m: Annotated[float, ResultMember("ahead")]


class BatteryKeys(Struct, frozen=True):
    """Battery of a vehicle.

    Attributes:
        capacity_Wh: energy of a full charge.
        reserve: share of a charge that is not to be used.
    """

    capacity_Wh: WattHours
    reserve: Share


class VehicleKeys(Struct, frozen=True):
    """Vehicle, or a wheel by itself, which has neither mass nor gravity."""

    name: str
    single_wheel: Annotated[bool, ResultMember("is_single")]
    mass_kg: Kilograms | None
    gravity_m_s2: MetresPerSquareSecond | None
    weight_N: Newtons
    wheel: WheelKeys
    axles: Annotated[tuple[AxleKeys, ...], Meta(min_length=1)]
    track_m: Annotated[float, ResultMember("track_width")]
    cog_height_m: Metres
    clearance_m: Metres | None
    height_m: Metres | None
    body_width_m: Metres
    front: OverhangKeys
    rear: OverhangKeys
    loads: tuple[LoadKeys, ...]
    steering: Annotated[str, one_of(STEERINGS)]
    turning_radius_m: Metres
    speed_m_s: MetresPerSecond
    power_W: Watts
    max_drift_m: Metres | None
    efficiency: Share
    battery: BatteryKeys | None
    stopping_distance_m: Metres | None
    reaction_time_s: Seconds
    gear: Annotated[str, one_of(GEARS)]
    tracks: TracksKeys | None
    feet: FeetKeys | None
    margins: MarginKeys
    classes: Annotated[ThresholdKeys, ResultMember("thresholds")]


def keys_of_vehicle(vehicle: Vehicle) -> VehicleKeys:
    """The keys of a vehicle, without mass and gravity for a wheel by itself."""
    found = fill_keys(VehicleKeys, vehicle)
    if vehicle.is_single:
        return structs.replace(found, mass_kg=None, gravity_m_s2=None)
    return found
