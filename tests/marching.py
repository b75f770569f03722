"""Rays on terrains with storeys, marched in small steps through columns, for tests to compare with.

What is solid is read off `Terrain.column` at each step; nothing is shared with the search of rays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.rays import RayHits
from terratool.field.storeys import FIRST_STOREY
from terratool.field.terrain import Terrain

Floats = NDArray[np.float64]
AIR, OVER_VOID, GROUND, SOLID = range(4)
"""Nothing, over ground or over a void; the ground; and what else is solid."""
_POINTS = 1 << 20
"""Most points that are looked at together."""
_FINER = 2000
"""Steps in place of one, where marching finds what a ray does not."""
_BESIDE = 10.0 ** np.arange(-9, -3)
"""Distances from a hit at which it is to be seen that it is one."""


class Marched(NamedTuple):
    """Steps between which rays first come into something solid, or out of it; (n,), inf for none.

    Attributes:
        before: distance of the last step before that.
        behind: distance of the first step behind it.
    """

    before: Floats
    behind: Floats


def matter(terrain: Terrain, points: Floats) -> NDArray[np.int64]:
    """What is at points (…, 3).

    The rim of the ground at a void is no boundary; sides of decks and bores are.
    """
    x, y, z = (one[..., None] for one in np.moveaxis(points, -1, 0))
    column = terrain.column(x[..., 0], y[..., 0])
    ground, own = terrain.ground_alone.height(x, y), column.element < FIRST_STOREY
    within = (column.bottom <= z) & (z <= column.top)
    solid = np.where((within & (own | (z <= ground))).any(-1), GROUND, SOLID)
    air = np.where(np.isnan(ground[..., 0]), OVER_VOID, AIR)
    return np.where(within.any(-1), solid, air)


def is_boundary(one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether there is a boundary of what is solid between two kinds of matter."""
    rim = (one == GROUND) & (other == OVER_VOID) | (one == OVER_VOID) & (other == GROUND)
    return ((one >= GROUND) != (other >= GROUND)) & ~rim


def march(terrain: Terrain, origins: Floats, ways: Floats, steps: int) -> Marched:
    """March along rays (n, 3) of unit directions as far as the terrain reaches."""
    bounds = np.array(terrain.bounds)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(ways[:, :2] > 0, bounds[2:], bounds[:2]) - origins[:, :2]
        far = np.nanmin(np.where(ways[:, :2] == 0, np.inf, ends / ways[:, :2]), axis=1)
    found = Marched(*np.full((2, len(origins)), np.inf))
    size = max(1, _POINTS // steps)
    for begin in range(0, len(origins), size):
        part = slice(begin, begin + size)
        at = far[part, None] * (np.arange(steps) + 0.5) / steps
        known = matter(terrain, origins[part, None] + ways[part, None] * at[..., None])
        changes = is_boundary(known[:, :-1], known[:, 1:])
        rays, first = np.arange(len(at)), changes.argmax(axis=1)
        some = changes.any(axis=1)
        found.before[part] = np.where(some, at[rays, first], np.inf)
        found.behind[part] = np.where(some, at[rays, np.minimum(first + 1, steps - 1)], np.inf)
    return found


def aimed(terrain: Terrain, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Origins anywhere over a terrain, in it and above it, and unit ways to ends of columns."""
    west, south, east, north = terrain.bounds
    x, y = rng.uniform([[west], [south]], [[east], [north]], (2, 2 * count))
    column = terrain.column(x, y)
    ends = np.concatenate([column.bottom, column.top], axis=1)
    some = np.isfinite(ends)
    low, high = ends[some].min(initial=0.0), ends[some].max(initial=0.0)
    tall = max(high - low, 1.0)
    anywhere = rng.uniform(low - 0.2 * tall, high + 0.5 * tall, 2 * count)
    picked = np.where(some, rng.random(ends.shape), -1.0).argmax(axis=1)
    end = ends[np.arange(2 * count), picked]
    z = np.where(np.isfinite(end) & (rng.random(2 * count) < 0.6), end, anywhere)
    z[:count] = anywhere[:count]
    points = np.column_stack([x, y, z])
    ways = points[count:] - points[:count]
    return points[:count], ways / np.linalg.norm(ways, axis=1)[:, None]


def wrong(
    terrain: Terrain, hits: RayHits, origins: Floats, ways: Floats, steps: int
) -> NDArray[np.int64]:
    """Rays whose hits are none, or behind what was found by marching; their indices."""
    marched = march(terrain, origins, ways, steps)
    slack = 1e-7 * (1.0 + np.where(np.isfinite(hits.distance), hits.distance, 0.0))
    late = hits.distance > marched.behind + slack
    for ray in np.flatnonzero(late):  # a corner of a void may be thinner than a step
        at = np.linspace(marched.before[ray], marched.behind[ray], _FINER)
        known = matter(terrain, origins[ray] + ways[ray] * at[:, None])
        late[ray] = is_boundary(known[:-1], known[1:]).any()
    early = np.flatnonzero(hits.distance < marched.before - slack)  # marching may step over it
    distance = hits.distance[early, None] + np.zeros(len(_BESIDE))
    before, behind = (
        matter(terrain, origins[early, None] + ways[early, None] * at[..., None])
        for at in (np.maximum(distance - _BESIDE, 0.0), distance + _BESIDE)
    )
    late[early] = ~is_boundary(before, behind).any(axis=1)
    return np.flatnonzero(late)
