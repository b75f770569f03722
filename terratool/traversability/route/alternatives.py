"""Further ways beside the best one: alternatives that differ truly, and one that is go all along.

Alternatives are found by the penalty method, and kept by the criteria of Abraham, Delling, Goldberg
and Werneck (Alternative routes in road networks, ACM Journal of Experimental Algorithmics 18,
2013): limited sharing, bounded stretch, and no detour that a shorter way replaces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from terratool.raster.grid import Grid
from terratool.traversability.map_results import cells_of
from terratool.traversability.route.graph import Preference
from terratool.traversability.route.results import Route

MOST = 9
"""Most alternatives to a route."""

SHARED = 0.6
"""Largest share of an alternative's length that lies beside ways found before it."""
STRETCH = 1.5
"""Largest cost of an alternative, in costs of the best way, and length of each of its detours."""

_PENALTY = 1.4
"""Factor on the costs beside a way that was found."""
_TRIES = 5
"""Searches for each alternative that is wanted, at most."""

Penalties = NDArray[np.float32]
"""(height, width) float32, factors of 1 or more on the costs of cells."""


def find_alternatives(
    best: Route,
    grid: Grid,
    width: float,
    prefer: Preference,
    count: int,
    search: Callable[[Penalties], Route],
    barred: Callable[[], NDArray[np.bool_]] | None = None,
) -> tuple[Route, ...]:
    """Alternatives to a route, `count` at most, the cheapest of what each search shows first.

    Each search pays more beside the ways that were found before. A way is kept if at most `SHARED`
    of it lies within a vehicle's width of the best way and of alternatives kept before, if it costs
    at most `STRETCH` times what the best does, and if none of its detours is longer than `STRETCH`
    times the stretch of the best way that it leaves out. All ways are pulled straight.

    Args:
        best: a route that was found.
        grid: cells of its survey.
        width: width of the vehicle, m.
        prefer: the quantity that routes minimise.
        count: number of alternatives that are wanted.
        search: searches for the best way with factors on the costs of cells.
        barred: cells where the vehicle cannot stand, some of which must lie between an alternative
            and the best way; None where ways are pulled straight, which shows that, too.
    """
    penalties = np.ones((grid.height, grid.width), np.float32)
    beside = beside_way(best, grid, width)
    penalties[beside] *= _PENALTY
    found: list[Route] = []
    misses = 0
    for _ in range(_TRIES * count):
        if len(found) == count:
            break
        route = search(penalties)
        if not route.found or route.profile is None:
            break
        # what comes back to a way that is known already ran beside what was paid more for
        penalties[beside_way(route, grid, (1 + misses) * width)] *= _PENALTY
        misses += 1
        shared = _shared(route, grid, beside)
        if shared > SHARED or not _is_near(route, best, prefer):
            continue
        if _longest_detour(route, best, grid, width) > STRETCH:
            continue
        if barred is not None and not _goes_round(route, best, grid, barred()):
            continue
        found.append(replace(route, shared=shared))
        misses = 0
        beside |= beside_way(route, grid, width)
    return tuple(found)


def beside_way(route: Route, grid: Grid, width: float) -> NDArray[np.bool_]:
    """Cells within `width` of a route along each axis, (height, width) bool."""
    out = np.zeros((grid.height, grid.width), np.bool_)
    assert route.profile is not None
    rows, columns = cells_of(grid, route.profile.x, route.profile.y)
    near = max(1, round(width / grid.resolution))
    for row, column in set(zip(rows.tolist(), columns.tolist(), strict=True)):
        top, left = max(row - near, 0), max(column - near, 0)
        out[top : row + near + 1, left : column + near + 1] = True
    return out


def _shared(route: Route, grid: Grid, beside: NDArray[np.bool_]) -> float:
    """Share of a route's length, seen from above, that lies in cells, (height, width) bool."""
    assert route.profile is not None
    legs = np.diff(route.profile.distance)
    inside = beside[cells_of(grid, route.profile.x, route.profile.y)]
    total = float(legs.sum())
    return float((legs * (inside[1:] & inside[:-1])).sum()) / total if total else 1.0


def _is_near(route: Route, best: Route, prefer: Preference) -> bool:
    """Whether a route takes at most `STRETCH` times what the best does of what is preferred."""
    name = prefer if prefer in ("length", "energy") else "time"
    own, least = (getattr(one, name) for one in (route, best))
    return own is not None and least is not None and own <= STRETCH * least


def _longest_detour(route: Route, best: Route, grid: Grid, width: float) -> float:
    """Largest ratio of a detour from the best way to the stretch of that which it leaves out."""
    assert route.profile is not None and best.profile is not None
    x, y = route.profile.x, route.profile.y
    away = ~beside_way(best, grid, width)[cells_of(grid, x, y)]
    edges = np.flatnonzero(np.diff(np.r_[False, away, False].astype(np.int8)))
    worst = 0.0
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        ends = max(first - 1, 0), min(end, len(x) - 1)
        own = abs(float(np.diff(route.profile.distance[list(ends)])[0]))
        near = [
            int(np.argmin(np.hypot(best.profile.x - x[n], best.profile.y - y[n]))) for n in ends
        ]
        left_out = abs(float(np.diff(best.profile.distance[near])[0]))
        worst = max(worst, own / max(left_out, width))
    return worst


def _goes_round(route: Route, best: Route, grid: Grid, barred: NDArray[np.bool_]) -> bool:
    """Whether cells, (height, width) bool, lie between two ways with the same ends."""
    import shapely

    profiles = [one.profile for one in (route, best) if one.profile is not None]
    ways = [np.column_stack([one.x, one.y]) for one in profiles]
    ring = shapely.make_valid(shapely.Polygon(np.concatenate([ways[0], ways[1][::-1]])))
    rows, columns = np.nonzero(barred)
    x, y = grid.columns(grid.whole)[columns], grid.rows(grid.whole)[rows]
    return bool(shapely.contains_xy(ring, x, y).any())
