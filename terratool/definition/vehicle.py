"""What the user wrote of a vehicle, as frozen typed values; absent keys are `UNSET`.

The classes mirror the text key by key, in its units. `terratool.traversability.vehicle` makes of
them the vehicle that is computed with.
"""

from __future__ import annotations

import math

import msgspec
from msgspec import UNSET, Struct, UnsetType, structs

GRAVITIES = {"earth": 9.80665, "mars": 3.71, "moon": 1.62}
"""Gravities that have a name, m/s²."""


KINDS = ("rigid", "lugged", "tyre")
"""A smooth rim, a rim with lugs, and a tyre with or without."""
STEERINGS = ("skid", "wheels")
"""To turn on the spot wheels slide sideways, or are turned into their ways."""
_OF_A_KIND = ("kind", "grouser_height", "tyre_pressure", "carcass_stiffness", "contact_length")
"""What an axle does not take over from wheels of another kind."""


class WheelText(Struct, frozen=True, rename="camel", kw_only=True):
    """A wheel: what an axle may have of its own."""

    radius: float | UnsetType = UNSET
    width: float | UnsetType = UNSET
    kind: str | UnsetType = UNSET
    grouser_height: float | UnsetType = UNSET
    tyre_pressure: float | UnsetType = UNSET
    carcass_stiffness: float | UnsetType = UNSET
    contact_length: float | UnsetType = UNSET
    exit_angle_ratio: float | UnsetType = UNSET
    max_torque: float | UnsetType = UNSET

    @property
    def known_kind(self) -> str:
        """Its kind; where that is absent, what its other keys stand for."""
        if self.kind is not UNSET:
            return self.kind
        if self.tyre_pressure is not UNSET or self.carcass_stiffness is not UNSET:
            return "tyre"
        return "rigid" if self.grouser_height is UNSET else "lugged"


OWN = WheelText.__struct_fields__
"""Attributes of a wheel that an axle may have of its own."""


class WheelsText(WheelText, frozen=True, rename="camel", kw_only=True):
    """What wheels have in common, where their axle says nothing else."""

    max_slip: float | UnsetType = UNSET


class AxleText(WheelText, frozen=True, rename="camel", kw_only=True):
    """Wheels side by side; of their own is what differs from the others."""

    x: float | UnsetType = UNSET
    wheels: int | UnsetType = UNSET
    driven: bool | UnsetType = UNSET

    @property
    def has_own(self) -> bool:
        """Whether its wheels differ from the others in anything."""
        return any(getattr(self, name) is not UNSET for name in OWN)

    @property
    def count(self) -> int:
        """Number of wheels, two where absent."""
        return 2 if self.wheels is UNSET else self.wheels

    @property
    def is_driven(self) -> bool:
        """Whether they are driven, as they are where it is absent."""
        return self.driven is not False


class CogText(Struct, frozen=True, rename="camel", kw_only=True):
    """The centre of gravity."""

    x: float | UnsetType = UNSET
    height: float | UnsetType = UNSET


class OverhangText(Struct, frozen=True, rename="camel", kw_only=True):
    """What of the body lies beyond the outermost axles."""

    front: float | UnsetType = UNSET
    front_height: float | UnsetType = UNSET
    rear: float | UnsetType = UNSET
    rear_height: float | UnsetType = UNSET


class MarginsText(Struct, frozen=True, rename="camel", kw_only=True):
    """What is kept in reserve."""

    clearance: float | UnsetType = UNSET
    step: float | UnsetType = UNSET
    tip: float | UnsetType = UNSET
    slope: float | UnsetType = UNSET


class ClassesText(Struct, frozen=True, rename="camel", kw_only=True):
    """Where go ends and caution ends."""

    utilisation: float | UnsetType = UNSET
    slip: float | UnsetType = UNSET
    caution_slip: float | UnsetType = UNSET
    torque: float | UnsetType = UNSET
    geometry: float | UnsetType = UNSET


class VehicleText(Struct, frozen=True, rename="camel", kw_only=True):
    """One vehicle."""

    schema: str | UnsetType = msgspec.field(default=UNSET, name="$schema")
    descr: str | UnsetType = UNSET
    mass: float | UnsetType = UNSET
    gravity: float | str | UnsetType = UNSET
    wheels: WheelsText = WheelsText()
    axles: tuple[AxleText, ...] | UnsetType = UNSET
    wheelbase: float | UnsetType = UNSET
    track: float | UnsetType = UNSET
    cog: CogText = CogText()
    clearance: float | UnsetType = UNSET
    body_width: float | UnsetType = UNSET
    overhang: OverhangText = OverhangText()
    steering: str | UnsetType = UNSET
    speed: float | UnsetType = UNSET
    power: float | UnsetType = UNSET
    margins: MarginsText = MarginsText()
    classes: ClassesText = ClassesText()

    @property
    def acceleration(self) -> float:
        """Gravity in m/s², the earth's where absent."""
        if self.gravity is UNSET:
            return GRAVITIES["earth"]
        return GRAVITIES[self.gravity] if isinstance(self.gravity, str) else self.gravity

    @property
    def all_axles(self) -> tuple[AxleText, ...]:
        """The axles, also those that only a wheelbase stands for; none if neither is there."""
        if self.axles is not UNSET:
            return self.axles
        if self.wheelbase is UNSET:
            return ()
        return AxleText(x=0.5 * self.wheelbase), AxleText(x=-0.5 * self.wheelbase)

    def wheels_of(self, axle: AxleText) -> WheelsText:
        """The wheels of an axle: its own keys, and those in common where it has none.

        Wheels that are said to be of another kind take over nothing that belongs to the kind.
        """
        common, own = self.wheels, {name: getattr(axle, name) for name in OWN}
        if axle.kind is not UNSET and axle.kind != common.known_kind:
            common = structs.replace(common, **dict.fromkeys(_OF_A_KIND, UNSET))
        given = {name: value for name, value in own.items() if value is not UNSET}
        return structs.replace(common, **given)

    @property
    def ends(self) -> tuple[float, float]:
        """Where the foremost and the rearmost axle stand, in the axles' frame."""
        xs = [axle.x for axle in self.all_axles if axle.x is not UNSET]
        return (max(xs), min(xs)) if xs else (math.nan, math.nan)

    @property
    def cog_x(self) -> float:
        """The centre of gravity in the axles' frame, the middle of the wheelbase where absent."""
        return 0.5 * sum(self.ends) if self.cog.x is UNSET else self.cog.x
