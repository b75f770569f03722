"""Results about a vehicle on a terrain: verdicts, their reasons, routes, reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.traversability.vehicle import Vehicle

HEADINGS = 8
"""Headings of a survey by default: 0 is north, then clockwise."""
FINER_HEADINGS = (16, 32)
"""Where nobody has chosen a number and these show no way, so many are tried one after the other.

64 are not: their moves are longer, and bends that 32 do not show are not shown by them."""
MOST_HEADINGS = 64


_GROUNDS = ("unknown", "go", "caution", "no-go", "cut-off", "edge", "one-way")
_SIGNS = "?✔!✘⊘▫→"


class Verdict(IntEnum):
    """Whether the vehicle can be driven; the larger, the worse."""

    UNKNOWN = 0
    GO = 1
    CAUTION = 2
    NO_GO = 3

    @property
    def label(self) -> str:
        """For people."""
        return _GROUNDS[self]

    @property
    def sign(self) -> str:
        """One character for those who see no colours."""
        return _SIGNS[self]


RANKS = np.array([2, 0, 1, 3], np.uint8)
"""What is worse, by `Verdict`: what is not known is worse than caution and better than no-go."""


class GroundClass(IntEnum):
    """What a place is to the vehicle: the verdict of its best heading, and whether it gets there.

    The first four are those of `Verdict`.
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
        """For people, and the names of classes in files."""
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
"""Distinct for any kind of colour vision; the verdicts in grey, too: L* 88, 65, 31, unknown 65."""

_LABELS = (
    "nothing", "no ground", "edge of the terrain", "soil unknown", "traction", "motor torque",
    "slip", "sinkage", "side-slip", "tip-over", "step", "high-centred", "approach or departure",
    "roughness", "turning on the spot",
)  # fmt: skip


class Reason(IntEnum):
    """What binds: the measure that is nearest to its limit, or farthest beyond it."""

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

    @property
    def label(self) -> str:
        """For people, and the names of classes in files."""
        return _LABELS[self]


kernels.check_enumerations(Verdict, Reason)


@dataclass(frozen=True, slots=True)
class SlipCurve:
    """The slip of a vehicle that drives straight up a slope, or down, by the slope.

    Every half degree, and at the largest climb.

    Attributes:
        slope: rad, rising; below 0 downhill.
        slip: of the driven wheel that slips most; NaN where it cannot drive.
    """

    slope: tuple[float, ...]
    slip: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Chances:
    """How likely a vehicle can drive on level ground of a surface, as shares of samples.

    Attributes:
        go: it is go.
        drives: it is go or caution.
        climb_low, climb_high: 5 % of the samples climb less, and 5 % more, rad; None where it
            cannot even drive on the level.
    """

    go: float
    drives: float
    climb_low: float | None
    climb_high: float | None


@dataclass(frozen=True, slots=True)
class Figures:
    """A surface and a wheel: what ground and vehicle do to each other on it.

    Numbers are None where they mean nothing (a rigid surface has no contact area), or cannot be
    known (`missing` says what the surface lacks). Forces are those of the wheel that bears most.

    Attributes:
        surface: its name.
        preset: the soil that it takes its figures from; empty for none.
        missing: parameters that it lacks; then all else is None.
        load: W, N.
        cohesion: c, Pa.
        friction: φ, rad.
        sinkage_rate: k, m/N.
        shear_modulus: K, m; None where all strength is mobilised.
        sinkage: z, m.
        contact_length: r sin θ1, of the ground that it touches, m.
        contact_area: that times the width, m².
        pressure: mean, Pa.
        normal_stress: σmax at the largest thrust, Pa.
        shear_stress: τmax, Pa.
        entry_angle: θ1, rad, at rest.
        strength: in the model `paper` c + σ tan φ, Pa: what the soil bears, with the σ that the
            motor's largest torque makes, or σmax where that is not limited.
        motor_stress: in the model `paper` τ of the motor's largest torque, Pa.
        limit_torque: that belongs to σmax and τmax, N m.
        thrust, resistance, drawbar: at the largest torque and slip allowed, N.
        torque: needed on the level, N m.
        utilisation: of the strength on the level.
        slip: on the level; None where it is not known.
        climb: largest slope, rad; None where it cannot even drive on the level.
        climb_binding: what binds there.
        cross_slope: largest, rad.
        cross_slope_binding: what binds there.
        step: highest, m.
        step_binding: what binds there, in words.
        step_axle: that does not get up a higher one, 1 for the foremost; None where it is the body,
            or the wheel is by itself.
        gap: widest, m.
        verdict: on level ground.
        reason: what binds on level ground.
        warnings: sentences.
        slip_curve: None where slip is not known.
        chances: where some figures of the soil are ranges; all else is that of their middles.
        turning: moment that resists turning on the spot, N m; as far as it gets where it cannot.
        turning_work: of the wheels for a quarter turn, J; None where it cannot turn.
        turning_slip: of its treads meanwhile; likewise.
        turning_binding: what forbids it.
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


@dataclass(frozen=True, slots=True)
class Survey:
    """A vehicle at the pixel centres of a grid, heading by heading.

    Rows run from the north. What depends on the heading is (headings, height, width); heading i
    is 360°·i/headings clockwise from north. At each pixel centre stands the vehicle's `middle`.

    Attributes:
        grid: the pixels.
        heights: (height, width) float32, NaN where there is no ground.
        surfaces: (height, width) index of the surface and one, 0 for none.
        verdict: uint8 `Verdict`.
        reason: uint8 `Reason`; NONE only where the verdict is UNKNOWN for want of nothing.
        utilisation: float32, the largest share that any measure takes of its limit: 1 is the
            limit, infinity where nothing would help; NaN where the verdict is unknown. The margin
            is 1 − it.
        pitch: float32 rad, nose up is positive.
        roll: float32 rad, left side up is positive.
        sinkage: float32 m, of the wheel that sinks deepest.
        slip: float32, of the worst wheel; NaN where it is not known.
        energy: float32 J for each metre of ground, all wheels, motors without loss; infinity where
            it does not move.
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

    @property
    def headings(self) -> int:
        """Their number."""
        return len(self.verdict)


@dataclass(frozen=True, slots=True)
class Location:
    """A place on the terrain.

    Attributes:
        x, y: world.
        height: z; None where there is no ground.
        surface: its name; empty for none.
        element: JSON pointer of what decides the surface; empty for none.
    """

    x: float
    y: float
    height: float | None
    surface: str
    element: str


@dataclass(frozen=True, slots=True)
class Extreme:
    """Where a measure along a route is largest or smallest.

    Attributes:
        value: of the measure.
        place: where.
        reason: what binds, for margins.
    """

    value: float
    place: Location
    reason: Reason = Reason.NONE


@dataclass(frozen=True, slots=True)
class RouteProfile:
    """Samples along a route, (n,) float64 each where nothing else stands.

    Attributes:
        x, y: world.
        heading: degrees clockwise from north.
        distance: m along the ground as seen from above.
        height: of the ground.
        sinkage: m.
        pitch, roll: rad.
        slip: NaN where unknown.
        utilisation: share of the nearest limit.
        verdict: uint8 `Verdict`.
        reason: uint8 `Reason`.
        surface: tuple of names, empty for none.
        element: tuple of JSON pointers of what decides the surface, empty for none.
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


@dataclass(frozen=True, slots=True)
class Barrier:
    """What bars the way at one place.

    Attributes:
        place: the first place on the way of least resistance where it cannot be driven.
        reason: what binds there.
        bars: what decides the ground there, for people: element and surface, and how steep it is
            where that matters.
        width: m of the way that cannot be driven there.
    """

    place: Location
    reason: Reason
    bars: str
    width: float


@dataclass(frozen=True, slots=True)
class Route:
    """A way from a start to a goal, or why there is none.

    Attributes:
        start, goal: where from and to.
        found: whether there is a way.
        planned: whether it was searched for; False for waypoints that were checked.
        verdict: the worst along it; caution at least where it is one-way; with a way back the
            worse of both, no-go where that was asked for and there is none.
        length: m over ground, heights included; None if there is no way.
        energy: J, with what is drawn all the time; None if there is no way.
        time: s; None if there is no way.
        steepest: the pitch of the largest size, rad, nose up is positive.
        softest: deepest sinkage, m.
        tightest: smallest margin, 1 − utilisation.
        profile: along it; along what was checked even if it cannot be driven; None if there is no
            way.
        barriers: where it is cut off, in the order of the way; none if there is a way.
        reached: the reachable place that is nearest to the goal; None if there is a way.
        note: a sentence where there is more to say, as that the goal itself cannot be driven.
        one_way: whether it cannot be driven back the same way, by backing up or turning round.
        against: what bars the same way back, from the goal on; none where that can be driven.
        back: the best way back; None where it was not asked for.
        headings: at each place of the survey that shows this.
        tried_headings: numbers of headings with which it was looked for, one after the other.
        ruled_out_headings: with no number of headings up to this one is there a way; None where
            that is not known.
        chance: probability that all of it is go; None where no figures of soils are ranges.
        least_chance: the smallest probability of go along it; likewise.
        turning: the part of the energy that turns on the spot take, J; None if there is no way.
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

    @property
    def holds(self) -> bool:
        """Whether there is a way, and one back if that was asked for."""
        return self.found and (self.back is None or self.back.found)


@dataclass(frozen=True, slots=True)
class Reach:
    """How much of a terrain can be reached from a place, and returned from.

    Attributes:
        start: where from.
        share: of all pixels with ground.
        returnable: share of all pixels with ground that can be reached and left again to the start.
        cells: (height, width) bool, which pixels; rows from the north.
        note: a sentence where there is more to say: that the vehicle cannot stand at the start.
    """

    start: Location
    share: float
    returnable: float
    cells: NDArray[np.bool_]
    note: str = ""


CHANCE_BOUNDS = (0.95, 0.5, 0.05, 0.0)
"""Probabilities of go from which on ground is counted together."""


@dataclass(frozen=True, slots=True)
class LargestPart:
    """The largest connected part of the ground.

    Attributes:
        place: x and y of a place in it, from which all of it can be reached.
        share: of all pixels with ground, those that can be reached, and left again to it.
    """

    place: tuple[float, float]
    share: float


@dataclass(frozen=True, slots=True)
class MapSummary:
    """A map in numbers.

    Attributes:
        grid: the pixels.
        headings: their number.
        counts: pixels by `GroundClass`.
        worst_counts: likewise, with the verdict of their worst heading where they are go, caution,
            no-go or unknown.
        reasons: pixels that are caution or no-go at their best heading by `Reason`.
        by_surface: for each surface's name ("" for none) its counts by `GroundClass`.
        start: where what can be reached begins; None for the largest part of the ground.
        largest: that part; None where there is a start, or no part.
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
        """With ground."""
        return sum(self.counts.values())

    def fraction(self, ground: GroundClass) -> float:
        """Share of the pixels with ground that are this; 0 where there are none."""
        return fraction_of(self.counts, ground)


def fraction_of(counts: dict[GroundClass, int], ground: GroundClass) -> float:
    """Share of counted pixels that are this; 0 where there are none."""
    total = sum(counts.values())
    return counts.get(ground, 0) / total if total else 0.0


@dataclass(frozen=True, slots=True)
class Preview:
    """A map for a picture.

    Attributes:
        grid: the pixels; of a large map one for several.
        heights: (height, width) float32, NaN where there is no ground.
        ground: (height, width) uint8, `GroundClass`.
        crs: name of the reference system of its coordinates; empty for none.
    """

    grid: Grid
    heights: NDArray[np.float32]
    ground: NDArray[np.uint8]
    crs: str = ""


@dataclass(frozen=True, slots=True)
class Sampling:
    """How figures of soils that are ranges were sampled.

    Attributes:
        samples: their number.
        seed: of the generator.
        error: how far a share of the samples is off at most, 19 times of 20.
        ranges: name of the surface, key, least and largest value of each.
    """

    samples: int
    seed: int
    error: float
    ranges: tuple[tuple[str, str, float, float], ...]


@dataclass(frozen=True, slots=True)
class TraversabilityReport:
    """All that one run has found out.

    Attributes:
        terrain: name of the definition's file.
        descr: of the terrain.
        bounds: of it, west, south, east, north.
        vehicle: the vehicle.
        surfaces: a row for each.
        summary: of the map; None where only routes were asked for.
        verdict: of the whole: of the worst route if there is one, else of the map.
        routes: as asked for.
        reach: if asked for.
        preview: the map, coarse enough for a picture; None where no picture is wanted.
        assumptions: sentences.
        notes: sentences on how it was computed: resolutions, and who chose them.
        geojson: a feature collection without features, with the terrain's reference system.
        sampling: of soils; None where no figures are ranges.
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

    @property
    def drives(self) -> bool:
        """Whether the vehicle can: go or caution."""
        return self.verdict in (Verdict.GO, Verdict.CAUTION)

    @property
    def reports(self) -> tuple[TraversabilityReport]:
        """Itself, as `VehicleComparison` has it."""
        return (self,)


@dataclass(frozen=True, slots=True)
class VehicleComparison:
    """Reports of several vehicles of which the same was asked on one terrain, one or more.

    Attributes:
        reports: one for each vehicle, in the order in which they were given.
        notes: sentences on their grids.
    """

    reports: tuple[TraversabilityReport, ...]
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Of the worst."""
        return max((one.verdict for one in self.reports), key=RANKS.__getitem__)

    @property
    def terrain(self) -> str:
        """Name of the definition's file."""
        return self.reports[0].terrain

    @property
    def descr(self) -> str:
        """Of the terrain."""
        return self.reports[0].descr


Reports = TraversabilityReport | VehicleComparison
"""What was found out for one vehicle, or for several: both have `reports`."""
