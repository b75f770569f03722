"""Vehicles as they are written: frozen typed values, absent keys `UNSET`.

The classes mirror the text key by key, in its units. The vehicles that are computed with are made
of them by `terratool.traversability.vehicle_files`.
"""

from __future__ import annotations

import math
from itertools import product

import msgspec
from msgspec import UNSET, Struct, UnsetType, structs

from terratool.definition.key import (
    FLAG,
    LEAST,
    MOST,
    SCHEMA,
    TEXT,
    Key,
    Shape,
    choice,
    measure,
    ranged,
    reserve,
    share,
)
from terratool.definition.model import Pair, ends_of

GRAVITIES = {"earth": 9.80665, "mars": 3.71, "moon": 1.62}
"""Gravities that have a name, m/s²."""


KINDS = ("rigid", "lugged", "tyre")
"""Kinds of wheels: a smooth rim, a rim with lugs, and a tyre with or without lugs."""
STEERINGS = ("skid", "wheels")
"""Ways to turn on the spot: wheels slide sideways, or are steered into their ways."""
_OF_A_KIND = (
    "kind", "grouser_height", "tyre_pressure", "carcass_stiffness", "contact_length",
    "rolling_resistance",
)  # fmt: skip
"""Attributes that an axle does not take over from wheels of another kind."""


class WheelText(Struct, frozen=True, rename="camel", kw_only=True):
    """Attributes of a wheel, each of which an axle may have of its own."""

    radius: float | UnsetType = UNSET
    width: float | UnsetType = UNSET
    kind: str | UnsetType = UNSET
    grouser_height: float | UnsetType = UNSET
    tyre_pressure: float | UnsetType = UNSET
    carcass_stiffness: float | UnsetType = UNSET
    contact_length: float | UnsetType = UNSET
    max_torque: float | UnsetType = UNSET
    rolling_resistance: float | UnsetType = UNSET

    @property
    def known_kind(self) -> str:
        """Kind of the wheel; where it is absent, the kind that other keys stand for."""
        if self.kind is not UNSET:
            return self.kind
        if self.tyre_pressure is not UNSET or self.carcass_stiffness is not UNSET:
            return "tyre"
        return "rigid" if self.grouser_height is UNSET else "lugged"


OWN = WheelText.__struct_fields__
"""Attributes of a wheel that an axle may have of its own."""


class WheelsText(WheelText, frozen=True, rename="camel", kw_only=True):
    """Common attributes of wheels, for axles that do not have them of their own."""

    max_slip: float | UnsetType = UNSET


class AxleText(WheelText, frozen=True, rename="camel", kw_only=True):
    """Wheels side by side, with the attributes in which they differ from the common ones."""

    x: float | UnsetType = UNSET
    wheels: int | UnsetType = UNSET
    driven: bool | UnsetType = UNSET

    @property
    def has_own(self) -> bool:
        """Whether the wheels differ from the common ones in any attribute."""
        return any(getattr(self, name) is not UNSET for name in OWN)

    @property
    def count(self) -> int:
        """Number of wheels, two where absent."""
        return 2 if self.wheels is UNSET else self.wheels

    @property
    def is_driven(self) -> bool:
        """Whether the wheels are driven; true where the key is absent."""
        return self.driven is not False


class TracksText(Struct, frozen=True, rename="camel", kw_only=True):
    """A pair of tracks, in place of wheels."""

    length: float | UnsetType = UNSET
    width: float | UnsetType = UNSET
    radius: float | UnsetType = UNSET
    front_height: float | UnsetType = UNSET
    approach_angle: float | UnsetType = UNSET
    max_torque: float | UnsetType = UNSET
    max_slip: float | UnsetType = UNSET


class FeetText(Struct, frozen=True, rename="camel", kw_only=True):
    """Pairs of feet, in place of wheels."""

    diameter: float | UnsetType = UNSET
    length: float | UnsetType = UNSET
    step_height: float | UnsetType = UNSET
    reach: float | UnsetType = UNSET
    pairs: int | UnsetType = UNSET
    bearing_feet: int | UnsetType = UNSET


class CogText(Struct, frozen=True, rename="camel", kw_only=True):
    """Centre of gravity; ranges of its place go with different loads."""

    x: float | Pair | UnsetType = UNSET
    height: float | Pair | UnsetType = UNSET


class OverhangText(Struct, frozen=True, rename="camel", kw_only=True):
    """Lengths and heights of the body beyond the outermost axles."""

    front: float | UnsetType = UNSET
    front_height: float | UnsetType = UNSET
    rear: float | UnsetType = UNSET
    rear_height: float | UnsetType = UNSET


class MarginsText(Struct, frozen=True, rename="camel", kw_only=True):
    """Reserves that are taken off each limit."""

    clearance: float | UnsetType = UNSET
    step: float | UnsetType = UNSET
    tip: float | UnsetType = UNSET
    slope: float | UnsetType = UNSET


class ClassesText(Struct, frozen=True, rename="camel", kw_only=True):
    """Thresholds at which go ends and caution ends."""

    utilisation: float | UnsetType = UNSET
    slip: float | UnsetType = UNSET
    caution_slip: float | UnsetType = UNSET
    torque: float | UnsetType = UNSET
    geometry: float | UnsetType = UNSET
    drift: float | UnsetType = UNSET
    caution_drift: float | UnsetType = UNSET


class BatteryText(Struct, frozen=True, rename="camel", kw_only=True):
    """Battery: its energy, and the share of it that is not to be used."""

    capacity: float | UnsetType = UNSET
    reserve: float | UnsetType = UNSET


class VehicleText(Struct, frozen=True, rename="camel", kw_only=True):
    """Vehicle as it is written."""

    schema: str | UnsetType = msgspec.field(default=UNSET, name="$schema")
    descr: str | UnsetType = UNSET
    mass: float | Pair | UnsetType = UNSET
    gravity: float | str | UnsetType = UNSET
    wheels: WheelsText = WheelsText()
    tracks: TracksText | UnsetType = UNSET
    feet: FeetText | UnsetType = UNSET
    axles: tuple[AxleText, ...] | UnsetType = UNSET
    wheelbase: float | UnsetType = UNSET
    track: float | UnsetType = UNSET
    cog: CogText = CogText()
    clearance: float | UnsetType = UNSET
    height: float | UnsetType = UNSET
    body_width: float | UnsetType = UNSET
    overhang: OverhangText = OverhangText()
    steering: str | UnsetType = UNSET
    turning_radius: float | UnsetType = UNSET
    speed: float | UnsetType = UNSET
    power: float | UnsetType = UNSET
    max_drift: float | UnsetType = UNSET
    efficiency: float | UnsetType = UNSET
    battery: BatteryText | UnsetType = UNSET
    stopping_distance: float | UnsetType = UNSET
    reaction_time: float | UnsetType = UNSET
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
        """Axles, also the two that a wheelbase stands for; empty if neither key is there."""
        if self.axles is not UNSET:
            return self.axles
        if self.wheelbase is UNSET:
            return ()
        return AxleText(x=0.5 * self.wheelbase), AxleText(x=-0.5 * self.wheelbase)

    def wheels_of(self, axle: AxleText) -> WheelsText:
        """Wheels of an axle: its own keys, and the common ones where it has none.

        Wheels with another kind of their own take over no key that belongs to the kind.
        """
        common, own = self.wheels, {name: getattr(axle, name) for name in OWN}
        if axle.kind is not UNSET and axle.kind != common.known_kind:
            common = structs.replace(common, **dict.fromkeys(_OF_A_KIND, UNSET))
        given = {name: value for name, value in own.items() if value is not UNSET}
        return structs.replace(common, **given)

    @property
    def ends(self) -> tuple[float, float]:
        """Positions x of the foremost and the rearmost axle, m; NaN where no axle has one.

        Those of tracks and feet are the ends of what stands on the ground.
        """
        for gear in (self.tracks, self.feet):
            if gear is not UNSET:
                half = math.nan if gear.length is UNSET else 0.5 * gear.length
                return half, -half
        xs = [axle.x for axle in self.all_axles if axle.x is not UNSET]
        return (max(xs), min(xs)) if xs else (math.nan, math.nan)

    @property
    def cog_ends(self) -> Pair:
        """Least and largest x of the centre of gravity, m; the middle of the wheelbase if absent.

        Both are NaN where no axle has an x.
        """
        return ends_of(0.5 * sum(self.ends) if self.cog.x is UNSET else self.cog.x)

    @property
    def loads(self) -> tuple[tuple[float, float, float], ...]:
        """Mass, height and x of the centre of gravity at the corners of their ranges.

        One where none of them is a range, and at most eight; empty where mass or height is absent.
        """
        if self.mass is UNSET or self.cog.height is UNSET:
            return ()
        masses, heights, places = (
            tuple(dict.fromkeys(pair))
            for pair in (ends_of(self.mass), ends_of(self.cog.height), self.cog_ends)
        )
        return tuple(product(masses, heights, places))


# --- keys -----------------------------------------------------------------------------------------

MAX_AXLES = 16
"""Most axles of a vehicle."""
MAX_WHEELS = 16
"""Most wheels of an axle."""
MAX_PAIRS = 4
"""Most pairs of feet of a vehicle."""
_ANGLE = Key("an angle in degrees, from 0 to below 90", "number", 0, 90, open_high=True)
_DRIFT = Key(
    "an angle in degrees, above 0 and below 90", "number", 0, 90, open_low=True, open_high=True
)
_X = Key("a position in metres, positive ahead, up to 1e6 in size", "number", -MOST, MOST)
_ROLLING = Key("a coefficient, from 0 to below 1", "number", 0, 1, open_high=True)
ROLLING = 0.02
"""Default coefficient of rolling resistance of a tyre: an assumption, for small tyres. Worn roads
have 0.02 (Carvill, Mechanical Engineer's Data Handbook, 1993)."""
LUGS = 0.1
"""Default height of a lugged wheel's lugs, in radii: 25 mm on 0.25 m, as on the wheel of NASA's
MGRU3."""
_WHEEL = {
    "radius": measure("a radius", "metres").describe(
        "Radius of the rim or the tyre, without lugs, m.", 0.1651,
    ),
    "width": measure("a width", "metres").describe("Width of the tread, m.", 0.1143),
    "kind": choice("kind of wheel", KINDS).describe(
        "What wheel it is: a rigid smooth rim, a rigid rim with lugs, or a tyre with or "
        "without lugs. Without it, a pressure stands for a tyre, lugs alone for a lugged "
        "wheel, neither for a rigid one.", "tyre", default="rigid",
    ),
    "grouserHeight": reserve("a height", "metres").describe(
        "Height of the lugs over the rim, m. A lugged wheel without it has a tenth of its "
        "radius, others have none.", 0.025,
    ),
    "tyrePressure": measure("a pressure", "kPa").describe(
        "Gauge pressure of the tyre, kPa. Without it, the contact of a tyre is no longer "
        "than that of a rigid wheel.", 68.5,
    ),
    "carcassStiffness": reserve("a pressure", "kPa").describe(
        "What the tyre's carcass adds to its pressure on the ground, kPa.", 20, default=20,
    ),
    "contactLength": reserve("a length", "metres").describe(
        "Length of the flat patch on which it stands on hard ground, at least, m.", 0.12,
        default=0,
    ),
    "maxTorque": measure("a torque", "N m", 1e9).describe(
        "Largest torque at each driven wheel, behind the gear, N m. Without it, the soil "
        "alone limits the thrust.", 14,
    ),
    "rollingResistance": _ROLLING.describe(
        "Force over load with which the wheel resists rolling, whatever it stands on: "
        f"{ROLLING} of a tyre if it is left out, 0 of a rigid rim. Where that of the ground is "
        "larger it counts.",
        ROLLING,
    ),
}  # fmt: skip
"""Keys of the common wheels, and of the wheels of an axle."""

VEHICLE_KEYS: dict[Shape, dict[str, Key]] = {
    VehicleText: {
        "$schema": SCHEMA.describe(
            "Address of this schema, for editors; it also tells that this is a vehicle.",
            "../../schemas/vehicle.schema.json", default="",
        ),
        "descr": TEXT.describe(
            "What the vehicle is, in a line.", "Small rover, four wheels, skid steered", default="",
        ),
        "mass": ranged(measure("a mass", "kg", 1e9)).describe(
            "Mass of the whole vehicle, kg; a range where its load differs, of which both ends are "
            "judged.", 50, [50, 75],
        ),
        "gravity": Key(
            "a gravity in m/s², from 1e-06 to 1e+06, or one of "
            + ", ".join(f'"{name}"' for name in GRAVITIES),
            "number", LEAST, MOST, choices=tuple(GRAVITIES), noun="gravity that has a name",
        ).describe(
            "Gravity in m/s², or that of the earth (9.80665), mars (3.71) or the moon (1.62) by "
            "name.", "mars", 3.71, default="earth",
        ),
        "wheels": Key("the wheels, an object", "object").describe(
            "What all wheels have in common, but for what an axle says otherwise.",
            {"radius": 0.1651, "width": 0.1143},
            {"radius": 0.1651, "width": 0.1143, "tyrePressure": 68.5},
        ),
        "tracks": Key("the tracks, an object", "object").describe(
            "A left and a right track, in place of wheels and axles.",
            {"length": 0.7, "width": 0.15, "radius": 0.1, "maxTorque": 60},
        ),
        "feet": Key("the feet, an object", "object").describe(
            "Left and right feet, in place of wheels and axles.",
            {"diameter": 0.05, "length": 0.6, "stepHeight": 0.2, "reach": 0.1},
        ),
        "axles": Key(f"a list of 2 to {MAX_AXLES} axles, objects", "list").describe(
            "The axles, in any order; instead of wheelbase.", [{"x": 0.256}, {"x": -0.256}],
        ),
        "wheelbase": measure("a wheelbase", "metres").describe(
            "Distance of the outermost axles, m. Without axles, it stands for two of two driven "
            "wheels; with them, it has to agree.", 0.512,
        ),
        "track": measure("a track", "metres").describe(
            "Distance of the middles of the left and the right wheels, tracks or feet, m.", 0.5708,
        ),
        "cog": Key("the centre of gravity, an object", "object").describe(
            "The centre of gravity.", {"height": 0.19},
        ),
        "clearance": measure("a clearance", "metres").describe(
            "Height of the body's underside over level ground, m.", 0.13,
        ),
        "height": measure("a height", "metres").describe(
            "Height of all of it over level ground, from the feet of its wheels to its top, m, for "
            "decks and ceilings above it. Without it, headroom is not judged.", 0.39,
        ),
        "bodyWidth": measure("a width", "metres").describe(
            "Width of the body, m; it may stand out over the wheels or lie between them. Without "
            "it, the body is not looked at beside the wheels.", 0.57,
        ),
        "overhang": Key("the overhangs, an object", "object").describe(
            "What of the body lies beyond the outermost axles.",
            {"front": 0.24, "frontHeight": 0.13}, default={},
        ),
        "steering": choice("way to steer", STEERINGS).describe(
            'How it turns on the spot: "skid", left and right wheels run against each other '
            'and slide sideways; or "wheels", wheels are steered into their ways, or swivel as '
            "castors do, and only roll.", "wheels", default="skid",
        ),
        "turningRadius": reserve("a radius", "metres", 1e4).describe(
            "Least radius of the way of its middle, m, of a vehicle that steers as a car does; 0 "
            "for one that turns on the spot.", 4.5, default=0,
        ),
        "speed": measure("a speed", "m/s").describe(
            "Speed of the wheels' treads or of the tracks, or at which it walks, m/s; for the time "
            "of a route.", 0.5, default=1,
        ),
        "power": reserve("a power", "W", 1e9).describe(
            "Power that is drawn all the time, whether it drives or not, W; for the energy of a "
            "route.", 40, default=0,
        ),
        "maxDrift": measure("a length", "metres").describe(
            "How far it may drift downhill between two corners of a route, m; a route on which it "
            "would drift farther is caution. Without it, there is no limit.", 0.5,
        ),
        "efficiency": Key("an efficiency, from 1e-06 to 1", "number", LEAST, 1).describe(
            "Share of the electrical power of motors that arrives at the wheels; nothing is gained "
            "where they brake.", 0.7, default=1,
        ),
        "battery": Key("the battery, an object", "object").describe(
            "What a charge holds, for ranges and for the charge that a route uses.",
            {"capacity": 480}, {"capacity": 480, "reserve": 0.2},
        ),
        "stoppingDistance": measure("a distance", "metres").describe(
            "Distance within which it is to stop anywhere, such as the range of its sensors, m. It "
            "drives no faster than that allows.", 2,
        ),
        "reactionTime": reserve("a time", "seconds").describe(
            "Time that it drives on before it brakes, s.", 0.2, default=0,
        ),
        "margins": Key("the margins, an object", "object").describe(
            "What is kept in reserve: taken off each limit before anything is compared with it.",
            {"clearance": 0.02, "tip": 10}, default={},
        ),
        "classes": Key("the thresholds of the classes, an object", "object").describe(
            "Where go ends and caution ends; beyond caution it is no-go.",
            {"slip": 0.1, "cautionSlip": 0.4}, default={},
        ),
    },
    WheelsText: {
        **_WHEEL,
        "maxSlip": share("a slip").describe(
            "Slip beyond which a wheel is not to be driven.", 0.6, default=1,
        ),
    },
    AxleText: {
        "x": _X.describe(
            "Where it stands, m, positive ahead, in a frame of your own that cog shares.", 0.256,
        ),
        "wheels": Key(f"a whole number from 1 to {MAX_WHEELS}", "whole", 1, MAX_WHEELS).describe(
            "Number of its wheels, evenly over the track; one stands in the middle.", 2, default=2,
        ),
        "driven": FLAG.describe(
            "Whether its wheels are driven.", False, default=True,
        ),
        **{
            key: wheel.describe("As in wheels, for this axle alone.", *wheel.examples)
            for key, wheel in _WHEEL.items()
        },
        "kind": _WHEEL["kind"].describe(
            "As in wheels, for this axle alone; where it is another one, nothing that belongs to "
            "the kind is taken over from wheels.", "tyre",
        ),
    },
    TracksText: {
        "length": measure("a length", "metres").describe(
            "Length of each track on level ground, m.", 0.7,
        ),
        "width": measure("a width", "metres").describe("Width of each track, m.", 0.15),
        "radius": measure("a radius", "metres").describe(
            "Radius of sprocket and idlers with their belt, m.", 0.1,
        ),
        "frontHeight": measure("a height", "metres").describe(
            "Height of the front idler's middle over level ground, m; the radius if it is left "
            "out, which is an idler that stands on the ground.", 0.18,
        ),
        "approachAngle": Key(
            "an angle in degrees, above 0 and below 90", "number", 0, 90, open_low=True,
            open_high=True,
        ).describe(
            "Angle at which the belt rises to a front idler that is higher than its radius, "
            "degrees.", 40, default=45,
        ),
        "maxTorque": measure("a torque", "N m", 1e9).describe(
            "Largest torque at the sprocket of each track, behind the gear, N m. Without it, the "
            "soil alone limits the thrust.", 60,
        ),
        "maxSlip": share("a slip").describe(
            "Slip beyond which a track is not to be driven.", 0.6, default=1,
        ),
    },
    FeetText: {
        "diameter": measure("a diameter", "metres").describe(
            "Diameter of the disc on which a foot stands, m.", 0.05,
        ),
        "length": measure("a length", "metres").describe(
            "Distance of the foremost and the rearmost feet where they stand by default, m.", 0.6,
        ),
        "stepHeight": measure("a height", "metres").describe(
            "How much higher or lower a foot may be set than its neighbours, and the highest step "
            "that it is lifted up, m.", 0.2,
        ),
        "reach": reserve("a length", "metres").describe(
            "How far from its own place a foot may be set where the ground is better, m.", 0.1,
            default=0,
        ),
        "pairs": Key(f"a whole number from 2 to {MAX_PAIRS}", "whole", 2, MAX_PAIRS).describe(
            "Number of pairs of feet, a left and a right one each, evenly over the length.", 3,
            default=2,
        ),
        "bearingFeet": Key(
            f"a whole number from 1 to {2 * MAX_PAIRS}", "whole", 1, 2 * MAX_PAIRS,
        ).describe(
            "Fewest feet that bear the vehicle while it walks; half of them if it is left out, as "
            "in a trot.", 3,
        ),
    },
    CogText: {
        "x": ranged(_X).describe(
            "Where it lies, m, positive ahead, in the frame of the axles. The middle of the "
            "wheelbase if it is left out; without axles, that is 0. A range, as of mass, if the "
            "load may lie elsewhere.", -0.02, [-0.05, 0.05],
        ),
        "height": ranged(measure("a height", "metres")).describe(
            "Its height over level ground, m; a range, as of mass, if the load may lie higher.",
            0.19, [0.19, 0.3],
        ),
    },
    OverhangText: {
        "front": measure("a length", "metres").describe(
            "From the middle of the foremost wheels to the front end of the body, m. Without it, "
            "nothing is there to touch.", 0.24,
        ),
        "frontHeight": measure("a height", "metres").describe(
            "Height of that end over level ground, m; the clearance if it is left out.", 0.13,
        ),
        "rear": measure("a length", "metres").describe(
            "From the middle of the rearmost wheels to the rear end of the body, m. Without it, "
            "nothing is there to touch.", 0.24,
        ),
        "rearHeight": measure("a height", "metres").describe(
            "Height of that end over level ground, m; the clearance if it is left out.", 0.13,
        ),
    },
    BatteryText: {
        "capacity": measure("an energy", "Wh", 1e9).describe(
            "Energy of a full charge, Wh.", 480,
        ),
        "reserve": Key("a share, from 0 to below 1", "number", 0, 1, open_high=True).describe(
            "Share of a charge that is not to be used.", 0.2, default=0,
        ),
    },
    MarginsText: {
        "clearance": reserve("a height", "metres").describe(
            "Of the clearance under the body, m.", 0.02, default=0,
        ),
        "step": reserve("a height", "metres").describe(
            "Of the height of a step, m.", 0.02, default=0,
        ),
        "tip": _ANGLE.describe(
            "Of the angle at which the vehicle tips over, degrees.", 10, default=0,
        ),
        "slope": _ANGLE.describe("Of the climb and the cross-slope, degrees.", 5, default=0),
    },
    ClassesText: {
        "utilisation": share("a share of the soil's strength").describe(
            "Share of the soil's strength up to which it is go; caution up to all of it.", 0.5,
            default=0.7,
        ),
        "slip": share("a slip").describe("Slip up to which it is go.", 0.1, default=0.2),
        "cautionSlip": share("a slip").describe(
            "Slip up to which it is caution; no less than slip.", 0.4, default=0.6,
        ),
        "torque": share("a share of the largest torque").describe(
            "Share of the largest torque up to which it is go; caution up to all of it.", 0.5,
            default=0.7,
        ),
        "geometry": share("a share of a limit").describe(
            "Share of a limit of shape (step, clearance, tip-over, cross-slope, breakover, "
            "approach) up to which it is go; caution up to all of it.", 0.8, default=0.7,
        ),
        "drift": _DRIFT.describe(
            "Angle up to which it is go, degrees, by which it drifts downhill on a side slope.", 5,
            default=10,
        ),
        "cautionDrift": _DRIFT.describe(
            "Angle of drift up to which it is caution, degrees; no less than drift.", 20,
            default=30,
        ),
    },
}  # fmt: skip
