"""Results about ways: routes with their profiles or barriers, and what can be reached."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.map_results import HEADINGS
from terratool.traversability.vehicle import Load
from terratool.traversability.verdicts import Reason, Verdict


@dataclass(frozen=True, slots=True)
class Location:
    """A place on the terrain.

    Attributes:
        x, y: world coordinates, m.
        height: height of the ground, m; None where there is no ground.
        surface: name of the surface; empty for none.
        element: JSON pointer of the element that decides the surface; empty for none.
        above: whether it is on a storey, over another top.
    """

    x: float
    y: float
    height: float | None
    surface: str
    element: str
    above: bool = False


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
        cells: (height, width) bool, pixels of the ground that can be reached; rows from the north.
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
