"""Vehicles and soils as frozen values in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from terratool.definition.keys import default_of
from terratool.definition.vehicle import STEERINGS, ClassesText
from terratool.errors import RequestError
from terratool.kernels import traversability as kernels
from terratool.report.wording import count_of
from terratool.text.display import printable
from terratool.traversability.track import SECTIONS, track_gap


@dataclass(frozen=True, slots=True)
class Soil:
    """The soil of a surface; numbers, or arrays that broadcast together.

    Attributes:
        cohesion: cohesion c, Pa, 0 or more.
        friction: friction angle φ, rad, 0 or more and below π/2.
        sinkage: sinkage per load k, m/N, 0 or more; 0 is rigid ground. z = k·W.
        shear_modulus: K of Janosi and Hanamoto, m, above 0; 0 where it is not known, and then all
            of the shear strength is mobilised whatever the slip.
        exponent: n, the power of its sinkage with which the pressure under a track grows; 1 where
            z = k·W is all that is known.
        factors: factors of k for each wheel of a vehicle, in the order of its layout; all are 1 if
            None.
        rolling: coefficient of rolling resistance of the ground, beside what sinking in takes.
    """

    cohesion: Any
    friction: Any
    sinkage: Any
    shear_modulus: Any = 0.0
    exponent: Any = 1.0
    factors: tuple[float, ...] | None = None
    rolling: Any = 0.0

    @classmethod
    def of(
        cls, cohesion: Any, friction: Any, sinkage: Any, shear_modulus: Any = 0.0,
        rolling: Any = 0.0,
    ) -> Soil:  # fmt: skip
        """Convert figures in the units of a definition: kPa, degrees, m/kN, m, force over load."""
        radians = friction * (math.pi / 180.0)
        return cls(cohesion * 1e3, radians, sinkage * 1e-3, shear_modulus, rolling=rolling)


GEARS = ("wheels", "tracks", "feet")
"""Kinds of running gear, by number in the kernels: kernels/traversability/track.hpp."""
MODELS = ("slip", "paper")
"""Models of wheel and soil; kernels/traversability/terramechanics.hpp explains them."""
FLAT = 0.4
"""Least shear length of a wheel, in radii: the flat of a rim that gives by 2 % of its radius. An
assumption; docs/validation.md says what it is worth."""


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel: a rigid rim, with or without lugs, or a tyre.

    Attributes:
        radius: radius r, m, without lugs.
        width: width b, m.
        max_torque: largest torque of its motor, N m; infinity where it is not limited.
        max_slip: largest slip at which it may be driven, above 0 and up to 1.
        grouser_height: height of its lugs, m; 0 for a smooth rim.
        contact_length: least length of its flat patch on hard ground, m; 0 where it is not known.
        patch_pressure: mean pressure on hard ground, Pa: a tyre's pressure and that of its carcass;
            infinity for a rigid rim, or where it is not known.
        tyre: whether it is a tyre, whose tread grips the soil as lugs do.
        slips: whether slip counts: the model `slip`, else `paper`.
        rolling: coefficient of rolling resistance of the wheel itself, force over load.
        gear: index of `GEARS`: 1 for a section of a track, whose radius is that of the sprocket, 2
            for a foot, whose radius is the height of its highest step.
        length: length of the track that it is a section of, m.
        area: area of that whole track on the ground, or of a foot, m².
    """

    radius: float
    width: float
    max_torque: float = math.inf
    max_slip: float = 1.0
    grouser_height: float = 0.0
    contact_length: float = 0.0
    patch_pressure: float = math.inf
    tyre: bool = False
    slips: bool = True
    rolling: float = 0.0
    gear: int = 0
    length: float = 0.0
    area: float = 0.0

    @property
    def shear_length(self) -> float:
        """Length along which the wheel shears the ground under no load, m.

        The largest of the patch, of the chord that the tips of lugs reach through level ground
        under the rim, 2 √((r + h)² − r²), and of 0.4 r.
        """
        chord = 2.0 * math.sqrt(self.grouser_height * (2.0 * self.radius + self.grouser_height))
        return max(self.contact_length, chord, FLAT * self.radius)

    @property
    def tread(self) -> float:
        """Height of what grips the soil, m: of the lugs, or of a tyre's tread, 0 for a bare rim."""
        return max(self.grouser_height, kernels.FULL_LUG) if self.tyre else self.grouser_height


@dataclass(frozen=True, slots=True)
class Tracks:
    """A left and a right track.

    Attributes:
        length: length L on level ground, m.
        width: width b, m.
        radius: radius of sprocket and idlers with the belt, m.
        front_height: height of the front idler's middle over level ground, m.
        approach: angle at which the belt rises to that, rad.
        max_torque: largest torque at each sprocket, N m; infinity where it is not limited.
    """

    length: float
    width: float
    radius: float
    front_height: float
    approach: float
    max_torque: float = math.inf

    @property
    def front(self) -> float:
        """Length of the front idler and the rise beyond the end of the track on the ground, m."""
        return (self.front_height - self.radius) / math.tan(self.approach) + self.radius

    @property
    def section(self) -> float:
        """Length of a section, m."""
        return self.length / SECTIONS


@dataclass(frozen=True, slots=True)
class Feet:
    """Pairs of feet.

    Attributes:
        diameter: diameter of the disc on which a foot stands, m.
        reach: how far from its own place a foot may be set, m.
        step_height: highest step that a foot is lifted up, m.
        bearing: fewest feet that bear the vehicle while it walks.
    """

    diameter: float
    reach: float
    step_height: float
    bearing: int


@dataclass(frozen=True, slots=True)
class Axle:
    """An axle: wheels side by side.

    Attributes:
        x: distance ahead of the centre of gravity, m.
        wheels: number of wheels.
        driven: whether its wheels are driven.
        wheel: each of its wheels; the vehicle's `wheel` if None.
    """

    x: float
    wheels: int = 2
    driven: bool = True
    wheel: Wheel | None = None


@dataclass(frozen=True, slots=True)
class Overhang:
    """The part of the body beyond the outermost axle at one end.

    Attributes:
        length: distance from the axle to the end of the body, m; 0 for no overhang.
        height: height of the body's end over level ground, m; infinity where nothing can touch.
    """

    length: float = 0.0
    height: float = math.inf


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of safety, taken off each limit before anything is compared with it.

    Attributes:
        clearance: margin under the body, m.
        step: margin of a step's height, m.
        tip: margin of the tip-over angle, rad.
        slope: margin of the climb and of the cross-slope, rad.
        soil: further margin of the climb and of the cross-slope on soft soil, rad, less on firmer
            ground; 0 unless the error of the model is to count.
    """

    clearance: float = 0.0
    step: float = 0.0
    tip: float = 0.0
    slope: float = 0.0
    soil: float = 0.0


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The largest figures that are go, and that are caution.

    Attributes:
        utilisation: largest share U of the soil's strength that is go; caution up to 1.
        slip: largest slip s that is go.
        caution_slip: largest slip s that is caution.
        torque: largest share of the motor's torque that is go; caution up to 1.
        geometry: largest share of a limit of shape (step, clearance, tip-over, cross-slope,
            breakover, approach) that is go; caution up to 1.
        drift: largest crab angle on a side slope that is go, rad.
        caution_drift: largest crab angle that is caution, rad.
    """

    utilisation: float = default_of(ClassesText, "utilisation")
    slip: float = default_of(ClassesText, "slip")
    caution_slip: float = default_of(ClassesText, "cautionSlip")
    torque: float = default_of(ClassesText, "torque")
    geometry: float = default_of(ClassesText, "geometry")
    drift: float = math.radians(default_of(ClassesText, "drift"))
    caution_drift: float = math.radians(default_of(ClassesText, "cautionDrift"))


@dataclass(frozen=True, slots=True)
class Battery:
    """A battery.

    Attributes:
        capacity: energy of a full charge, J.
        reserve: share of a charge that is not to be used, from 0 to below 1.
    """

    capacity: float
    reserve: float = 0.0

    @property
    def usable(self) -> float:
        """Energy of a charge without its reserve, J."""
        return self.capacity * (1.0 - self.reserve)


@dataclass(frozen=True, slots=True)
class Load:
    """A vehicle's mass and centre of gravity with one of its loads.

    Attributes:
        mass: mass of all, kg.
        cog_height: height of the centre of gravity over level ground, m.
        ahead: distance of the centre of gravity ahead of that of the vehicle, m.
    """

    mass: float
    cog_height: float
    ahead: float = 0.0


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle, or a wheel by itself, in SI units.

    Where loads differ, `loads` has the corners of their ranges, and `cases` a vehicle for each.
    The figures of the vehicle itself are then the largest mass and height, and the middle of the
    range of the centre of gravity along it.

    Attributes:
        wheel: each wheel of axles that have no wheels of their own; a section of a track; or a
            foot.
        axles: axles from the front to the rear; pairs of sections of the tracks, or of feet.
        mass: mass with all loads, kg.
        gravity: acceleration of gravity, m/s².
        track_width: distance between the middles of left and right wheels, m; 0 for a wheel by
            itself.
        cog_height: height of the centre of gravity over level ground, m; 0 for a wheel by itself.
        clearance: height of the body between the outermost axles over level ground, m; infinity
            for no body.
        height: height of all of it over level ground, m; None where it is not known.
        body_width: width of the body, m; 0 for none. Wheels may stand out of it or under it.
        front: overhang at the front.
        rear: overhang at the rear.
        steering: way of turning on the spot: "skid" slides the wheels sideways, "wheels" turns or
            swivels each into its path.
        turning_radius: least radius of the way of its middle, m; 0 if it turns on the spot.
        speed: speed of the wheels' treads, m/s.
        power: power that is drawn whether the vehicle drives or not, W.
        max_drift: largest drift between two corners of a route that is go, m; infinity for no
            limit.
        efficiency: share of the motors' electrical power that arrives at the wheels.
        battery: the battery; None where it is not known.
        stopping_distance: distance within which the vehicle is to stop anywhere, m; infinity for
            no such limit.
        reaction_time: time that it drives on before it brakes, s.
        margins: margins taken off its limits.
        thresholds: thresholds of go and caution.
        name: name for reports; may be empty.
        loads: loads that are judged, if they differ; none for the vehicle as it is.
        tracks: tracks that it stands on; None for wheels or feet.
        feet: feet that it stands on; None for wheels or tracks.
    """

    wheel: Wheel
    axles: tuple[Axle, ...]
    mass: float
    gravity: float = 9.80665
    track_width: float = 0.0
    cog_height: float = 0.0
    clearance: float = math.inf
    height: float | None = None
    body_width: float = 0.0
    front: Overhang = field(default_factory=Overhang)
    rear: Overhang = field(default_factory=Overhang)
    steering: str = STEERINGS[0]
    turning_radius: float = 0.0
    speed: float = 1.0
    power: float = 0.0
    max_drift: float = math.inf
    efficiency: float = 1.0
    battery: Battery | None = None
    stopping_distance: float = math.inf
    reaction_time: float = 0.0
    margins: Margins = field(default_factory=Margins)
    thresholds: Thresholds = field(default_factory=Thresholds)
    name: str = ""
    loads: tuple[Load, ...] = ()
    tracks: Tracks | None = None
    feet: Feet | None = None

    def __repr__(self) -> str:
        name = f" {printable(self.name)}" if self.name else ""
        gear = count_of(self.wheels, "wheel")
        if self.tracks or self.feet:
            gear = "2 tracks" if self.tracks else f"{self.wheels} feet"
        return f"<Vehicle{name}: {gear}, {self.mass:.6g} kg>"

    @classmethod
    def single(cls, wheel: Wheel, load: float) -> Vehicle:
        """A driven wheel by itself that bears `load` newtons."""
        return cls(wheel, (Axle(0.0, 1),), load, 1.0)

    @property
    def cases(self) -> tuple[Vehicle, ...]:
        """The vehicle with each of its loads; itself where it has none."""
        if not self.loads:
            return (self,)
        return tuple(
            replace(
                self,
                mass=load.mass,
                cog_height=load.cog_height,
                axles=tuple(replace(axle, x=axle.x - load.ahead) for axle in self.axles),
                loads=(),
            )
            for load in self.loads
        )

    def wheel_of(self, axle: Axle) -> Wheel:
        """The wheels of an axle."""
        return axle.wheel or self.wheel

    @property
    def all_wheels(self) -> tuple[Wheel, ...]:
        """All wheels one by one: axles from the front, on each from left to right."""
        return tuple(self.wheel_of(axle) for axle in self.axles for _ in range(axle.wheels))

    @property
    def smallest_radius(self) -> float:
        """Smallest radius of all wheels, m."""
        return min(wheel.radius for wheel in self.all_wheels)

    @property
    def model(self) -> str:
        """Model of wheel and soil that the vehicle is computed with, one of `MODELS`."""
        return MODELS[0] if self.wheel.slips else MODELS[1]

    def by_model(self, model: str) -> Vehicle:
        """Return a copy of the vehicle that is computed with one of `MODELS`.

        Raises:
            RequestError: the model is `paper`, and the vehicle stands on tracks or feet.
        """
        if model != MODELS[0] and self.gear != "wheels":
            raise RequestError(
                f"The model {model} has formulas of wheels alone, and the vehicle stands on "
                f"{self.gear}.",
                f"Take --model {MODELS[0]}, or a vehicle on wheels.",
            )
        slips = model == MODELS[0]
        axles = (
            replace(axle, wheel=replace(axle.wheel, slips=slips)) if axle.wheel else axle
            for axle in self.axles
        )
        return replace(self, wheel=replace(self.wheel, slips=slips), axles=tuple(axles))

    @property
    def gear(self) -> str:
        """Kind of running gear of the vehicle, one of `GEARS`."""
        return GEARS[self.wheel.gear]

    @property
    def size_words(self) -> str:
        """Wheels, tracks or feet that decide how fine the ground must be, with a size, in words."""
        if self.feet:
            return f"feet of diameter {self.feet.diameter:g}"
        if self.tracks:
            return f"tracks with sprockets of radius {self.tracks.radius:g}"
        return f"wheels of radius {self.smallest_radius:g}"

    @property
    def bridges(self) -> float:
        """Widest gap that tracks or feet pass as if it were not there, m; 0 for wheels."""
        if self.tracks:
            return track_gap(*self._ends)
        # beside the gap all of a foot stands on ground
        return max(2.0 * self.feet.reach - self.feet.diameter, 0.0) if self.feet else 0.0

    @property
    def _ends(self) -> tuple[float, float]:
        """Distances from the centre of gravity to the ends of what stands on the ground, m."""
        half = 0.5 * self.wheelbase
        return half + self.middle, half - self.middle

    @property
    def is_single(self) -> bool:
        """Whether the vehicle is a wheel by itself, without a body and without tip-over."""
        return len(self.axles) == 1 and self.axles[0].wheels == 1

    @property
    def weight(self) -> float:
        """Mass times gravity, or the load of a wheel by itself, N."""
        return self.mass * self.gravity

    @property
    def wheels(self) -> int:
        """Number of wheels."""
        return sum(axle.wheels for axle in self.axles)

    @property
    def wheelbase(self) -> float:
        """Distance from the foremost to the rearmost axle, m; 0 for one axle.

        The length of tracks on the ground.
        """
        if self.tracks:
            return self.tracks.length
        return self.axles[0].x - self.axles[-1].x

    @property
    def middle(self) -> float:
        """Middle of the wheelbase, the reference point, m ahead of the centre of gravity."""
        return 0.5 * (self.axles[0].x + self.axles[-1].x)

    @property
    def rectangle(self) -> tuple[float, float, float]:
        """Extent seen from above, m: ahead of, behind and to each side of `middle`."""
        half, middle = 0.5 * self.wheelbase, self.middle
        if self.tracks or self.feet:
            rear = self.tracks.radius if self.tracks else 0.5 * self.wheel.width
            front = self.tracks.front if self.tracks else rear
            return (
                half + max(self.front.length, front), half + max(self.rear.length, rear),
                0.5 * max(self.body_width, self.track_width + self.wheel.width),
            )  # fmt: skip
        placed = [(axle, self.wheel_of(axle)) for axle in self.axles]
        track = self.track_width
        return (
            max(half + self.front.length, *(a.x - middle + w.radius for a, w in placed)),
            max(half + self.rear.length, *(middle - a.x + w.radius for a, w in placed)),
            0.5 * max(self.body_width, *(track * (a.wheels > 1) + w.width for a, w in placed)),
        )

    @property
    def area(self) -> float:
        """Area of the vehicle's rectangle seen from above, m²."""
        front, rear, side = self.rectangle
        return (front + rear) * 2.0 * side
