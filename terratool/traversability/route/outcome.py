"""Routes with their outcome: the way with its figures, or barriers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from terratool.kernels import traversability as kernels
from terratool.traversability.route.barriers import (
    RouteSite,
    barriers,
)
from terratool.traversability.route.drifting import drift_total
from terratool.traversability.route.graph import (
    drivable,
    turnable,
)
from terratool.traversability.route.paths import (
    Path,
    driving_cost,
    find_extreme,
    profile,
    reversed_path,
    worst_verdict,
)
from terratool.traversability.route.reach import (
    FloodPlaces,
    begin_at,
    heading_bits,
    spread,
)
from terratool.traversability.route.results import (
    Barrier,
    Extreme,
    Location,
    Route,
    RouteProfile,
)
from terratool.traversability.vehicle import Load
from terratool.traversability.verdicts import Reason, Verdict


def with_way(route: Route, path: Path, on: RouteSite, one_way: bool) -> Route:
    """Complete a route by a way that was found: its cost, extremes, profile and verdict.

    The way is one-way if its cells, and those beside them, do not lead back.
    """
    terrain, survey = on.terrain, on.survey
    cost = driving_cost(path, survey, on.vehicle, on.turns, on.brakes)
    along_it = profile(path, survey, terrain, cost)
    steepest = find_extreme(terrain, along_it.pitch, along_it, of_size=True)
    softest = find_extreme(terrain, along_it.sinkage, along_it)
    tightest = find_extreme(terrain, along_it.utilisation, along_it)
    crab = find_extreme(terrain, np.abs(along_it.crab), along_it)
    drift = find_extreme(terrain, np.abs(along_it.drift), along_it)
    verdict = worst_verdict(along_it.verdict)
    chance, least_chance = _chances(path, along_it, on)
    strays = drift is not None and drift.value > on.vehicle.max_drift
    if (one_way or strays) and verdict == Verdict.GO:
        verdict = Verdict.CAUTION
    return replace(
        route,
        found=True,
        verdict=verdict,
        length=cost.length,
        energy=cost.energy,
        time=cost.time,
        turning=cost.turning,
        stop=_without_reason(find_extreme(terrain, along_it.stopping, along_it)),
        slowest=_slowest(along_it, on),
        load=_binding_load(path, along_it, on),
        steepest=_without_reason(steepest),
        softest=_without_reason(softest),
        tightest=tightest and replace(tightest, value=1.0 - tightest.value),
        profile=along_it,
        one_way=one_way,
        against=barriers(on, reversed_path(path, survey.headings)) if one_way else (),
        chance=chance,
        least_chance=least_chance,
        drift=drift and replace(drift, reason=Reason.NONE),
        crab=crab and replace(crab, reason=Reason.NONE),
        drift_total=drift_total(along_it),
        strays=strays,
    )


def _without_reason(extreme: Extreme | None) -> Extreme | None:
    """An extreme of what has no limit, and so no measure that binds."""
    return extreme and replace(extreme, reason=Reason.NONE)


def _slowest(along_it: RouteProfile, on: RouteSite) -> Extreme | None:
    """The least speed along a way; None where stopping distances are not limited."""
    if not math.isfinite(on.vehicle.stopping_distance):
        return None
    found = _without_reason(find_extreme(on.terrain, -along_it.speed, along_it))
    return found and replace(found, value=-found.value)


def _binding_load(path: Path, along_it: RouteProfile, on: RouteSite) -> Load | None:
    """The load with the smallest margin along a way; None where loads do not differ."""
    loads = on.survey.load
    if loads is None or np.isnan(along_it.utilisation).all():
        return None
    at = int(np.nanargmax(along_it.utilisation))
    return on.vehicle.loads[int(path.values_of(loads)[at])]


def _chances(
    path: Path, along_it: RouteProfile, on: RouteSite
) -> tuple[float | None, Extreme | None]:
    """The probability that a whole path is go, and the smallest along it; None without ranges."""
    marked = on.tiles.samples_passing(path.judged, path.row, path.column)
    sampled = on.tiles.uncertainty
    if marked is None or sampled is None:
        return None, None
    together = np.bitwise_and.reduce(marked, axis=0)
    counts = np.empty((len(marked) + 1, 1), np.uint32)
    kernels.count_samples(np.concatenate([marked, together[None]])[:, None], counts)
    shares = counts[:, 0] / sampled.samples
    least = find_extreme(on.terrain, -shares[:-1], along_it)
    assert least is not None
    return float(shares[-1]), replace(least, value=-least.value, reason=Reason.NONE)


def leads_back(path: Path, on: RouteSite) -> bool:
    """Whether the cells of a path, and those beside them, can be driven back to its beginning."""
    grid = on.survey.grid
    height, width = on.survey.heights.shape
    top, left = max(path.row.min() - 1, 0), max(path.column.min() - 1, 0)
    low, right = min(path.row.max() + 2, height), min(path.column.max() + 2, width)
    if on.survey.stack is not None:  # twins are numbered in all of it
        top, left, low, right = 0, 0, height, width
    own = np.zeros((low - top, right - left), np.bool_)
    rows, columns = path.row - top, path.column - left
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            own[
                np.clip(rows + down, 0, own.shape[0] - 1),
                np.clip(columns + right, 0, own.shape[1] - 1),
            ] = True
    at = np.nonzero(own)
    survey = on.tiles.complete(at[0] + top, at[1] + left)
    part = np.s_[top : top + own.shape[0], left : left + own.shape[1]]
    twins = survey.twins
    if twins is not None:
        assert survey.stack is not None
        for _ in range(survey.stack.layers):
            own.flat[twins[own]] = True
    bits = heading_bits(drivable(survey, part) & own)
    begin = begin_at(bits, (int(rows[-1]), int(columns[-1])))
    turns = turnable(survey, on.turns, part)
    radius = on.vehicle.turning_radius / grid.resolution
    back = spread(bits, survey.headings, begin, places=FloodPlaces(turns, twins), radius=radius)
    return bool(back[rows[0], columns[0]])


def with_barriers(
    route: Route, found: tuple[Barrier, ...], nearest: Location | None, note: str = ""
) -> Route:
    """Complete a route by its barriers; unknown where these are all unknown soil, else no-go."""
    unknown = all(barrier.reason == Reason.SOIL_UNKNOWN for barrier in found)
    verdict = Verdict.UNKNOWN if unknown else Verdict.NO_GO
    return replace(route, verdict=verdict, barriers=found, reached=nearest, note=note)
