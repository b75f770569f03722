"""Results about a vehicle on a terrain: verdicts, reasons, routes, maps, reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.definition.model import Range
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.report.wording import count_of
from terratool.text.display import printable
from terratool.traversability.keep_out import Zone
from terratool.traversability.vehicle import Load, Vehicle

HEADINGS = 8
"""Default number of headings of a survey, clockwise from north."""
FINER_HEADINGS = (16, 32)
"""Numbers of headings tried in turn where HEADINGS show no route and the user chose no number.

64 headings are not tried: their moves are longer, and show no bends that 32 headings miss."""
MOST_HEADINGS = 64
"""Largest number of headings of a survey."""


_GROUNDS = ("unknown", "go", "caution", "no-go", "cut-off", "edge", "one-way")
_SIGNS = "?✔!✘⊘▫→"


class NamedNumber(IntEnum):
    """A number with a name for people, which is its text."""

    @property
    def label(self) -> str:
        """Name for people and in files."""
        raise NotImplementedError

    def __str__(self) -> str:
        return self.label

    def __format__(self, spec: str) -> str:
        return format(self.label, spec)


class Verdict(NamedNumber):
    """Verdict on driving the vehicle at a place; see `RANKS` for which is worse."""

    UNKNOWN = 0
    GO = 1
    CAUTION = 2
    NO_GO = 3

    @property
    def label(self) -> str:
        """Name of the verdict for people."""
        return _GROUNDS[self]

    @property
    def sign(self) -> str:
        """One character for those who see no colours."""
        return _SIGNS[self]


RANKS = np.array([2, 0, 1, 3], np.uint8)
"""Rank of each `Verdict`, the larger, the worse: go, caution, unknown, no-go."""


class GroundClass(NamedNumber):
    """Class of a place on a map: the verdict of its best heading, and whether it is connected.

    The first four have the names and numbers of `Verdict`.
    """

    UNKNOWN = 0
    GO = 1
    CAUTION = 2
    NO_GO = 3
    CUT_OFF = 4
    EDGE = 5
    ONE_WAY = 6

    @property
    def label(self) -> str:
        """Name of the class, for people and in files."""
        return _GROUNDS[self]

    @property
    def sign(self) -> str:
        """One character for those who see no colours."""
        return _SIGNS[self]


COLORS: dict[GroundClass, tuple[int, int, int]] = {
    GroundClass.UNKNOWN: (158, 158, 158),
    GroundClass.GO: (190, 232, 218),
    GroundClass.CAUTION: (224, 138, 30),
    GroundClass.NO_GO: (140, 28, 68),
    GroundClass.CUT_OFF: (120, 140, 190),
    GroundClass.EDGE: (228, 228, 228),
    GroundClass.ONE_WAY: (246, 214, 96),
}
"""Red, green, blue of each class, from 0 to 255, distinct for any kind of colour vision.

In grey the verdicts differ, too: L* 88, 65, 31, unknown 65."""

_LABELS = (
    "nothing", "no ground", "edge of the terrain", "soil unknown", "traction", "motor torque",
    "slip", "sinkage", "side-slip", "tip-over", "step", "high-centred", "approach or departure",
    "roughness", "turning on the spot", "drift", "foothold", "keep-out",
)  # fmt: skip
"""Names of the measures, by `Reason`."""


class Reason(NamedNumber):
    """The measure that binds: the one nearest to its limit, or farthest beyond it."""

    NONE = 0
    NO_GROUND = 1
    EDGE = 2
    SOIL_UNKNOWN = 3
    TRACTION = 4
    TORQUE = 5
    SLIP = 6
    SINKAGE = 7
    SIDE_SLIP = 8
    TIP_OVER = 9
    STEP = 10
    HIGH_CENTRED = 11
    APPROACH = 12
    ROUGHNESS = 13
    TURNING = 14
    DRIFT = 15
    FOOTHOLD = 16
    KEEP_OUT = 17

    @property
    def label(self) -> str:
        """Name of the measure, for people and in files."""
        return _LABELS[self]


kernels.check_enumerations(Verdict, Reason)


@dataclass(frozen=True, slots=True)
class SlipCurve:
    """Slip against slope of a vehicle that drives straight up or down, (n,) each.

    Slopes lie half a degree apart, with the largest climb among them.

    Attributes:
        slope: slopes, rad, rising; below 0 downhill.
        slip: slip of the driven wheel that slips most; NaN where the vehicle cannot drive.
    """

    slope: tuple[float, ...]
    slip: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class DriftCurve:
    """Crab angle against side slope of a vehicle that drives straight across, (n,) each.

    Attributes:
        slope: side slopes, rad, each 5 degrees from 0 to the largest cross-slope.
        crab: crab angle, rad: by how much the vehicle heads uphill to hold its line, and drifts
            downhill if it does not.
    """

    slope: tuple[float, ...]
    crab: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Chances:
    """Probabilities of driving on level ground of a surface, as shares of samples of its soil.

    Attributes:
        go: probability of go, from 0 to 1.
        drives: probability of go or caution, from 0 to 1.
        climb_low: climb that 5 % of the samples stay below, rad; None where the vehicle cannot
            even drive on the level.
        climb_high: climb that 5 % of the samples exceed, rad; None likewise.
    """

    go: float
    drives: float
    climb_low: float | None
    climb_high: float | None


@dataclass(frozen=True, slots=True)
class LoadSpan:
    """Least and largest figures of a vehicle on a surface, with each of its loads.

    Attributes:
        load: load with which it can do least, whose figures those of the surface are.
        climb: steepest slope that is climbed, rad; None where it cannot even drive on the level.
        cross_slope: steepest cross-slope, rad; None likewise.
        step: height of the highest step that is climbed, m.
    """

    load: Load
    climb: tuple[float | None, float | None]
    cross_slope: tuple[float | None, float | None]
    step: tuple[float | None, float | None]


@dataclass(frozen=True, slots=True)
class Figures:
    """Figures of a vehicle on level ground of a surface, and the slopes and steps that it takes.

    Numbers are None where they mean nothing (a rigid surface has no contact area), or cannot be
    known (`missing` says what the surface lacks). Forces are those of the wheel that bears most,
    of a track, or of a foot as it walks.

    Attributes:
        surface: name of the surface.
        preset: name of the preset that the surface takes its soil from; empty for none.
        missing: keys that the surface lacks; if there are any, all numbers are None.
        load: load W, N.
        cohesion: cohesion c, Pa.
        friction: friction angle φ, rad.
        sinkage_rate: sinkage per load k, m/N.
        shear_modulus: shear modulus K, m; None where all strength is mobilised.
        sinkage: sinkage z, m.
        contact_length: length of the ground that the wheel touches, r sin θ1, m.
        contact_area: contact length times the wheel's width, m².
        pressure: mean pressure on the contact area, Pa.
        normal_stress: peak normal stress σmax at the largest thrust, Pa.
        shear_stress: peak shear stress τmax at the largest thrust, Pa.
        entry_angle: entry angle θ1 at rest, rad, from the downward vertical.
        strength: shear strength of the soil in the model `paper`, c + σ tan φ, Pa, with the σ that
            the motor's largest torque makes, or σmax where that is not limited.
        motor_stress: shear stress τ of the motor's largest torque in the model `paper`, Pa.
        limit_torque: torque that belongs to σmax and τmax, N m.
        thrust: thrust at the largest torque and slip allowed, N.
        resistance: resistance at the largest torque and slip allowed, N.
        drawbar: drawbar pull at the largest torque and slip allowed, N.
        torque: torque needed on the level, N m.
        utilisation: share of the soil's strength used on the level.
        slip: slip on the level; None where it is not known.
        climb: steepest slope that is climbed, rad; None where the vehicle cannot even drive on the
            level.
        climb_binding: measure that binds at the climb.
        cross_slope: steepest cross-slope, rad; None like the climb.
        cross_slope_binding: measure that binds at the cross-slope, or on the level.
        step: height of the highest step that is climbed, m; None like the climb.
        step_binding: measure that binds at the step, in words.
        step_axle: axle that does not get up a higher step, 1 for the foremost; None where the body
            does not, or the wheel is by itself.
        gap: width of the widest gap that is crossed, m; None like the climb.
        verdict: verdict on level ground.
        reason: measure that binds on level ground.
        warnings: sentences on what is unusual.
        slip_curve: slip against slope; None where slip is not known.
        chances: probabilities where figures of the soil are ranges, whose middles all other
            figures take; None where none are.
        turning: moment that resists turning on the spot, N m; the largest that is reached where the
            vehicle cannot turn.
        turning_work: work of the wheels for a quarter turn, J; None where the vehicle cannot turn.
        turning_slip: slip of the treads in a turn; None where the vehicle cannot turn.
        turning_binding: measure that forbids turning.
        climb_error: error band of the climb to both sides, rad: less on firmer soil, 0 on ground
            that does not yield, in the model `paper`, and where it is kept in reserve; None like
            the climb.
        drift_curve: crab angle against side slope; None where slip is not known.
        rolling: coefficient of rolling resistance that counts, the larger of ground and wheel.
        energy: energy of a charge for a metre on the level, J: that of the wheels by the motors'
            efficiency, and the power drawn all the time; None where the vehicle cannot drive.
        driving_range: way on the level that a charge without its reserve lasts for, m; None without
            a battery, or where the vehicle cannot drive.
        braking: deceleration on the level as a share of gravity.
        stopping: distance to stop from the vehicle's speed on the level, m.
        speed_limit: largest speed that stops within the vehicle's stopping distance on the level,
            m/s; None where that is not limited.
        loads: what it can do with each of its loads, if these differ; other figures are then those
            of the load with which it can do least, and of energy and stopping the worst of all.
        bearing: load that the soil bears on a foot, N; None for wheels, tracks and rigid ground.
    """

    surface: str
    preset: str = ""
    missing: tuple[str, ...] = ()
    load: float | None = None
    cohesion: float | None = None
    friction: float | None = None
    sinkage_rate: float | None = None
    shear_modulus: float | None = None
    sinkage: float | None = None
    contact_length: float | None = None
    contact_area: float | None = None
    pressure: float | None = None
    normal_stress: float | None = None
    shear_stress: float | None = None
    entry_angle: float | None = None
    strength: float | None = None
    motor_stress: float | None = None
    limit_torque: float | None = None
    thrust: float | None = None
    resistance: float | None = None
    drawbar: float | None = None
    torque: float | None = None
    utilisation: float | None = None
    slip: float | None = None
    climb: float | None = None
    climb_binding: Reason = Reason.NONE
    cross_slope: float | None = None
    cross_slope_binding: Reason = Reason.NONE
    step: float | None = None
    step_binding: str = ""
    step_axle: int | None = None
    gap: float | None = None
    verdict: Verdict = Verdict.UNKNOWN
    reason: Reason = Reason.NONE
    warnings: tuple[str, ...] = ()
    slip_curve: SlipCurve | None = None
    chances: Chances | None = None
    turning: float | None = None
    turning_work: float | None = None
    turning_slip: float | None = None
    turning_binding: Reason = Reason.NONE
    climb_error: float | None = None
    drift_curve: DriftCurve | None = None
    rolling: float | None = None
    energy: float | None = None
    driving_range: float | None = None
    braking: float | None = None
    stopping: float | None = None
    speed_limit: float | None = None
    loads: LoadSpan | None = None
    bearing: float | None = None


@dataclass(frozen=True, slots=True)
class Survey:
    """A vehicle at the pixel centres of a grid, heading by heading.

    Rows run from the north. What depends on the heading is (headings, height, width); heading i
    is 360°·i/headings clockwise from north. At each pixel centre stands the vehicle's `middle`.

    Attributes:
        grid: the pixels.
        heights: (height, width) float32 m, NaN where there is no ground.
        surfaces: (height, width) index of the surface and one, 0 for none.
        verdict: uint8 `Verdict`.
        reason: uint8 `Reason` of the measure that binds; NONE where the verdict is UNKNOWN although
            nothing is missing.
        utilisation: float32, the largest share that any measure takes of its limit: 1 is the
            limit, infinity where nothing would help; NaN where the verdict is unknown. The margin
            is 1 − it.
        pitch: float32 rad, nose up is positive.
        roll: float32 rad, left side up is positive.
        sinkage: float32 sinkage of the wheel that sinks deepest, m.
        slip: float32 slip of the wheel that slips most; NaN where it is not known.
        energy: float32 energy of all wheels for each metre of ground, J/m, motors without loss;
            infinity where the vehicle does not move.
        crab: float32 crab angle, rad: by how much the vehicle heads uphill to hold its line, and
            drifts downhill if it does not; NaN where slip is not known.
        reserve: float32 angle by which the vehicle may lean more until it tips over, rad.
        load: uint8 index of the vehicle's load that binds; None where it has no different loads.
    """

    grid: Grid
    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    utilisation: NDArray[np.float32]
    pitch: NDArray[np.float32]
    roll: NDArray[np.float32]
    sinkage: NDArray[np.float32]
    slip: NDArray[np.float32]
    energy: NDArray[np.float32]
    crab: NDArray[np.float32]
    reserve: NDArray[np.float32]
    load: NDArray[np.uint8] | None = None

    @property
    def headings(self) -> int:
        """Number of headings."""
        return len(self.verdict)


@dataclass(frozen=True, slots=True)
class Location:
    """A place on the terrain.

    Attributes:
        x, y: world coordinates, m.
        height: height of the ground, m; None where there is no ground.
        surface: name of the surface; empty for none.
        element: JSON pointer of the element that decides the surface; empty for none.
    """

    x: float
    y: float
    height: float | None
    surface: str
    element: str


@dataclass(frozen=True, slots=True)
class Extreme:
    """The largest or smallest value of a measure along a route, with its place.

    Attributes:
        value: the largest or smallest value, in the measure's unit.
        place: place of that value.
        reason: the measure that binds, for margins; NONE for others.
    """

    value: float
    place: Location
    reason: Reason = Reason.NONE


@dataclass(frozen=True, slots=True)
class RouteProfile:
    """Samples along a route, (n,) float64 each unless another type is given.

    Attributes:
        x, y: world coordinates, m.
        heading: heading, degrees clockwise from north.
        distance: distance along the route as seen from above, m.
        height: height of the ground, m.
        sinkage: sinkage of the wheel that sinks deepest, m.
        pitch, roll: pitch and roll, rad; nose up and left side up are positive.
        slip: slip of the wheel that slips most; NaN where unknown.
        utilisation: largest share that any measure takes of its limit.
        verdict: uint8 `Verdict`.
        reason: uint8 `Reason`.
        surface: names of surfaces, empty for none.
        element: JSON pointers of the elements that decide the surface, empty for none.
        crab: crab angle, rad: by how much the vehicle heads to the left of its way to hold its
            line on a side slope; below 0 to the right; NaN where unknown.
        drift: how far it is to the left of its line, m, if nobody steers against the drift since
            the last corner; below 0 to the right.
        reserve: angle by which the vehicle may lean more until it tips over, rad.
        stopping: distance to stop from the vehicle's speed, m; NaN where it is not known.
        speed: speed of the treads, m/s, no more than stops within the vehicle's stopping distance.
        time: time since the start, s.
        energy: energy since the start, J.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]
    distance: NDArray[np.float64]
    height: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    pitch: NDArray[np.float64]
    roll: NDArray[np.float64]
    slip: NDArray[np.float64]
    utilisation: NDArray[np.float64]
    verdict: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    surface: tuple[str, ...]
    element: tuple[str, ...]
    crab: NDArray[np.float64]
    drift: NDArray[np.float64]
    reserve: NDArray[np.float64]
    stopping: NDArray[np.float64]
    speed: NDArray[np.float64]
    time: NDArray[np.float64]
    energy: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ChargeUse:
    """The charge that a route uses, there and, if that was asked for, back.

    Attributes:
        energy: energy of all of it, J.
        share: share of a full charge that it uses; above 1 if the battery does not last.
        reserve: share of a charge that is not to be used.
        emptied: place where the battery is empty, and how far on the way it is, m, in a straight
            line from sample to sample seen from above; None where it lasts, or is empty on the way
            back.
    """

    energy: float
    share: float
    reserve: float
    emptied: Extreme | None = None

    @property
    def verdict(self) -> Verdict:
        """Go within the charge without its reserve, caution within all of it, else no-go."""
        if self.share > 1.0:
            return Verdict.NO_GO
        return Verdict.CAUTION if self.share > 1.0 - self.reserve else Verdict.GO


@dataclass(frozen=True, slots=True)
class Barrier:
    """A stretch of a way that bars the vehicle.

    Attributes:
        place: first place of the stretch, on the way of least resistance.
        reason: measure that binds there.
        bars: element and surface that decide the ground there, for people, with the slope where
            that matters.
        width: length of the stretch, m.
        pointer: JSON pointer of the element that bars, in the terrain's own file; empty for none.
    """

    place: Location
    reason: Reason
    bars: str
    width: float
    pointer: str = ""


@dataclass(frozen=True, slots=True)
class Route:
    """A route from a start to a goal, or the barriers where there is none.

    Attributes:
        start, goal: first and last place.
        found: whether there is a way.
        planned: whether a way was searched for, rather than waypoints checked.
        verdict: worst verdict along the way; caution at least where it is one-way; with a way back
            the worse of both, no-go where that was asked for and there is none.
        length: length over ground, heights included, m; None if there is no way.
        energy: energy of the wheels, and of the power drawn all the time, J; None if there is no
            way.
        time: driving time at the vehicle's speed less slip, s; None if there is no way.
        steepest: place of the largest pitch, rad, nose up is positive; None if there is no way.
        softest: place of the deepest sinkage, m; None if there is no way.
        tightest: place of the smallest margin, 1 − utilisation; None if there is no way.
        profile: samples along the way, or along checked waypoints even if they cannot be driven;
            None if there is no way.
        barriers: barriers in the order of the way; none if there is a way.
        reached: reachable place that is nearest to the goal; None if there is a way.
        note: a sentence on anything special, such as a goal that itself cannot be driven; else
            empty.
        one_way: whether the way cannot be driven back, by backing up or turning round.
        against: barriers on the same way back, from the goal on; none where that can be driven.
        back: best way back; None where it was not asked for.
        headings: number of headings at each place of the survey that shows the way.
        tried_headings: numbers of headings that the search tried, in turn.
        ruled_out_headings: largest number of headings up to which it is known that there is no way;
            None where that is not known.
        chance: probability that the whole way is go; None where no figures of soils are ranges.
        least_chance: smallest probability of go along the way; None where no figures of soils are
            ranges.
        turning: part of the energy that turns on the spot take, J; None if there is no way.
        drift: largest drift between two corners, m, if nobody steers against it; None if there is
            no way.
        crab: largest crab angle to hold the line, rad; None if there is no way, or
            it is not known.
        drift_total: sum of all drift, to either side, m; None if there is no way.
        strays: whether the drift is more than the vehicle's largest; the verdict is caution then.
        charge: charge that the way uses; None if there is no way, or no battery.
        stop: place of the longest distance to stop from the vehicle's speed, m, infinity where it
            cannot; None if that is not known, or there is no way.
        slowest: place of the least speed that stops within the vehicle's stopping distance, m/s;
            None where that is not limited, or there is no way.
        load: load of the vehicle with the smallest margin; None where it has no different loads, or
            there is no way.
        all_go_longer: how much longer the best way by margin is, m, if that is go all along, and
            this is not; None where it is not, or was not looked for.
        alternatives: further ways, of those that were asked for.
        shared: share of the length of an alternative that lies beside the best way and alternatives
            before it; None for no alternative.
    """

    start: Location
    goal: Location
    found: bool
    planned: bool
    verdict: Verdict
    length: float | None = None
    energy: float | None = None
    time: float | None = None
    steepest: Extreme | None = None
    softest: Extreme | None = None
    tightest: Extreme | None = None
    profile: RouteProfile | None = None
    barriers: tuple[Barrier, ...] = ()
    reached: Location | None = None
    note: str = ""
    one_way: bool = False
    against: tuple[Barrier, ...] = ()
    back: Route | None = None
    headings: int = HEADINGS
    tried_headings: tuple[int, ...] = ()
    ruled_out_headings: int | None = None
    chance: float | None = None
    least_chance: Extreme | None = None
    turning: float | None = None
    drift: Extreme | None = None
    crab: Extreme | None = None
    drift_total: float | None = None
    strays: bool = False
    charge: ChargeUse | None = None
    stop: Extreme | None = None
    slowest: Extreme | None = None
    load: Load | None = None
    all_go_longer: float | None = None
    alternatives: tuple[Route, ...] = ()
    shared: float | None = None

    @property
    def holds(self) -> bool:
        """Whether there is a way, and one back if that was asked for, and the battery lasts."""
        lasts = self.charge is None or self.charge.verdict != Verdict.NO_GO
        return self.found and (self.back is None or self.back.found) and lasts


@dataclass(frozen=True, slots=True)
class Reach:
    """The part of a terrain that can be reached from a place, and returned from.

    Attributes:
        start: place that the vehicle starts from.
        share: share of the pixels with ground, but those at the edge, that can be reached.
        returnable: share of the pixels with ground, but those at the edge, that can be reached and
            left again to the start.
        cells: (height, width) bool, pixels that can be reached; rows from the north.
        note: a sentence where the vehicle cannot stand at the start; else empty.
        pointer: JSON pointer of the element that bars the vehicle there, in the terrain's own file;
            empty for none.
    """

    start: Location
    share: float
    returnable: float
    cells: NDArray[np.bool_]
    note: str = ""
    pointer: str = ""


CHANCE_BOUNDS = (0.95, 0.5, 0.05, 0.0)
"""Lower bounds of the classes in which ground is counted by its probability of go."""


@dataclass(frozen=True, slots=True)
class LargestPart:
    """The largest connected part of the ground.

    Attributes:
        place: x and y of a place in the part, m, from which all of the part can be reached.
        share: share of the pixels with ground, but those at the edge, that the part has.
    """

    place: tuple[float, float]
    share: float


@dataclass(frozen=True, slots=True)
class MapSummary:
    """A map in numbers.

    Attributes:
        grid: the pixels.
        headings: number of headings at each pixel.
        counts: number of pixels by `GroundClass`.
        worst_counts: number of pixels by `GroundClass`, where those that are go, caution, no-go or
            unknown have the verdict of their worst heading.
        reasons: number of pixels that are caution or no-go at their best heading, by `Reason`.
        by_surface: number of pixels by `GroundClass`, by the surface's name ("" for none).
        start: x and y from which ground counts as reached, m; None for the largest part.
        largest: largest connected part; None where there is a start, or no part.
        chances: pixels with ground by the largest of `CHANCE_BOUNDS` that the probability of go
            reaches, where it is known; None where no figures of soils are ranges.
    """

    grid: Grid
    headings: int
    counts: dict[GroundClass, int]
    worst_counts: dict[GroundClass, int]
    reasons: dict[Reason, int]
    by_surface: dict[str, dict[GroundClass, int]]
    start: tuple[float, float] | None = None
    largest: LargestPart | None = None
    chances: dict[float, int] | None = None

    @property
    def pixels(self) -> int:
        """Number of pixels with ground."""
        return sum(self.counts.values())

    @property
    def counted(self) -> int:
        """Number of pixels with ground of which shares are: all but those at the edge."""
        return self.pixels - self.counts.get(GroundClass.EDGE, 0)

    def fraction(self, ground: GroundClass) -> float:
        """Share of the pixels with ground that are of a class, as `fraction_of` has it."""
        return fraction_of(self.counts, ground)


def fraction_of(counts: dict[GroundClass, int], ground: GroundClass) -> float:
    """Share of pixels that are of a class; 0 where there are none.

    The share of the edge is one of all pixels, all others are shares of what is not at the edge.
    """
    total = sum(counts.values())
    if ground != GroundClass.EDGE:
        total -= counts.get(GroundClass.EDGE, 0)
    return counts.get(ground, 0) / total if total else 0.0


@dataclass(frozen=True, slots=True)
class Preview:
    """A map for a picture.

    Attributes:
        grid: pixels of the picture, each for several of a large map.
        heights: (height, width) float32 m, NaN where there is no ground.
        ground: (height, width) uint8 `GroundClass`.
        crs: name of the coordinates' reference system; empty for none.
        worst: (height, width) uint8 `GroundClass`, with the verdict of the worst heading where
            ground is go, caution, no-go or unknown; None where it is not known.
        bits: (height, width) headings with which the vehicle drives, as bits, the first in the
            lowest; the ground is taken to go on beyond the rim. None where they are not known.
        headings: number of headings of `bits`.
    """

    grid: Grid
    heights: NDArray[np.float32]
    ground: NDArray[np.uint8]
    crs: str = ""
    worst: NDArray[np.uint8] | None = None
    bits: NDArray[np.unsignedinteger[Any]] | None = None
    headings: int = HEADINGS


@dataclass(frozen=True, slots=True)
class Sampling:
    """Sampling of the figures of soils that are ranges, and of errors of heights.

    Attributes:
        samples: number of samples.
        seed: seed of the generator.
        error: largest error of a share of the samples, at 95 % confidence.
        ranges: ranges that were sampled, every value in them equally likely.
        height_error: standard deviation of heights, m; None where heights are exact.
        correlation: correlation length of errors of heights, m; None likewise.
    """

    samples: int
    seed: int
    error: float
    ranges: tuple[Range, ...]
    height_error: float | None = None
    correlation: float | None = None


@dataclass(frozen=True, slots=True)
class TraversabilityReport:
    """The results of one run for a vehicle on a terrain.

    Attributes:
        terrain: name of the definition's file.
        descr: description of the terrain.
        bounds: west, south, east, north of the terrain, m.
        vehicle: the vehicle.
        surfaces: figures of each surface.
        summary: the map in numbers; None where only routes were asked for.
        verdict: verdict of the worst route; without routes, of the map: go where all of the ground
            is, caution where some of it is go or caution, unknown where nothing is known, else
            no-go. The edge does not count.
        routes: routes and checked waypoints, in the order of the request.
        reach: ground that can be reached; None where it was not asked for.
        preview: the map, coarse enough for a picture; None where no map is wanted.
        assumptions: assumptions of the models, in sentences.
        notes: sentences on how the results were computed: resolutions, and why.
        geojson: a feature collection without features, with the terrain's reference system.
        sampling: sampling of the soils; None where no figures are ranges.
        keep_out: zones that the vehicle keeps out of.
    """

    terrain: str
    descr: str
    bounds: tuple[float, float, float, float]
    vehicle: Vehicle
    surfaces: tuple[Figures, ...]
    summary: MapSummary | None
    verdict: Verdict
    routes: tuple[Route, ...] = ()
    reach: Reach | None = None
    preview: Preview | None = None
    assumptions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    geojson: dict[str, Any] = field(default_factory=lambda: {"type": "FeatureCollection"})
    sampling: Sampling | None = None
    keep_out: tuple[Zone, ...] = ()

    def __repr__(self) -> str:
        about = " on ".join(printable(name) for name in (self.vehicle.name, self.terrain) if name)
        ways = f", {count_of(len(self.routes), 'way')}" if self.routes else ""
        return f"<TraversabilityReport{' of ' if about else ''}{about}: {self.verdict}{ways}>"

    @property
    def drives(self) -> bool:
        """Whether the vehicle can drive: the verdict is go or caution."""
        return self.verdict in (Verdict.GO, Verdict.CAUTION)

    @property
    def reports(self) -> tuple[TraversabilityReport]:
        """The report alone, in a tuple, for functions that also take a `VehicleComparison`."""
        return (self,)


@dataclass(frozen=True, slots=True)
class VehicleComparison:
    """Reports of several vehicles of which the same was asked on one terrain, one or more.

    Attributes:
        reports: one for each vehicle, in the order in which they were given.
        notes: sentences on the grids of all vehicles.
    """

    reports: tuple[TraversabilityReport, ...]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        each = (f"{printable(one.vehicle.name)} {one.verdict}" for one in self.reports)
        return f"<VehicleComparison: {', '.join(each)}>"

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of all vehicles."""
        return max((one.verdict for one in self.reports), key=RANKS.__getitem__)

    @property
    def terrain(self) -> str:
        """Name of the definition's file."""
        return self.reports[0].terrain

    @property
    def descr(self) -> str:
        """Description of the terrain."""
        return self.reports[0].descr


Reports = TraversabilityReport | VehicleComparison
"""Results for one vehicle, or for several; both have `reports`."""
