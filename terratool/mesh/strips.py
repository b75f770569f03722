"""Sides of what is solid: walls between the stacks of two triangles beside each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.stacks import BELOW, Stacks
from terratool.mesh.types import Triangulation

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


class StackSides(NamedTuple):
    """Stacks over triangles, with a level for each corner of each end of an interval.

    Attributes:
        plane: the triangles.
        stacks: intervals over them, i at most.
        low: (n, i, 3) int32 level at each corner of the bottom of each interval; `BELOW`, or
            negative for none.
        high: (n, i, 3) int32 level at each corner of the top of each interval.
        begins: (p + 1,) first level of each vertex.
        levels: heights, those of a vertex from below.
        closed: whether the first level where something solid from below ends is that of a base.
    """

    plane: Triangulation
    stacks: Stacks
    low: Ints
    high: Ints
    begins: Longs
    levels: NDArray[np.float64]
    closed: bool


class StackWalls(NamedTuple):
    """Faces that stand upright.

    Attributes:
        faces: (k, 3) levels.
        owner: (k,) triangle with the interval whose side each face is.
        interval: (k,) index of this interval.
        empty: (k,) triangle in front; -1 for none.
        under: (k,) index of the highest interval below the face there; -1 for none.
        outer: (k,) bool, whether the ground ends there.
    """

    faces: Ints
    owner: Longs
    interval: Longs
    empty: Longs
    under: Longs
    outer: NDArray[np.bool_]


class _Edges(NamedTuple):
    """Sides of triangles: the triangles on the left and on the right, and the corner of each."""

    left: Longs
    begin: Longs
    right: Longs
    end: Longs


def raise_sides(sides: StackSides) -> StackWalls:
    """Walls wherever there is something solid on one side of an edge alone."""
    edges = _edges_that_differ(sides)
    ends = _in_order(_ends_of(sides, edges))
    if not len(ends):  # all is void
        none = np.empty(0, np.int64)
        return StackWalls(np.empty((0, 3), np.int32), none, none, none, none, none.astype(np.bool_))
    bad = np.flatnonzero((ends[1:, 0] == ends[:-1, 0]) & (ends[1:, 2] < ends[:-1, 2]))
    crossed = np.unique(ends[bad, 0])
    if len(crossed):
        ends = _apart(ends, crossed, len(edges.left))
    return _strips(sides, edges, ends)


def _edges_that_differ(sides: StackSides) -> _Edges:
    plane, low, high = sides.plane, sides.low, sides.high
    neighbours = plane.neighbours
    t, c = plane.sides()
    beyond = neighbours[t, c].astype(np.int64)
    back = (neighbours[beyond] == t[:, None]).argmax(axis=1)  # corner of the side that leads here
    same = np.asarray(beyond >= 0)
    for one in (low, high):
        for own, other in ((c, (back + 1) % 3), ((c + 1) % 3, back)):
            same &= (one[t, :, own] == one[beyond, :, other]).all(axis=1)
    t, c, beyond, back = (one[~same] for one in (t, c, beyond, back))
    return _Edges(t, c, beyond, back)


def _ends_of(sides: StackSides, edges: _Edges) -> Longs:
    """Ends of the intervals on both sides of edges.

    (n, 6): edge, level at its begin, level at its end, 1 for a top, 0 or 1 for left or right, 1 for
    an interval from below.
    """
    rows = []
    for side, triangle, begin, end in (
        (0, edges.left, edges.begin, (edges.begin + 1) % 3),
        (1, edges.right, (edges.end + 1) % 3, edges.end),
    ):
        for is_top, own in ((0, sides.low), (1, sides.high)):
            first, last = own[triangle, :, begin], own[triangle, :, end]
            there = (triangle >= 0)[:, None] & (sides.high[triangle, :, 0] >= 0)
            edge, interval = np.nonzero(there)
            from_below = sides.low[triangle[edge], interval, 0] == BELOW
            rows.append(
                np.column_stack(
                    [edge, first[edge, interval], last[edge, interval],
                     np.full(len(edge), is_top), np.full(len(edge), side), from_below]
                )
            )  # fmt: skip
    return np.concatenate(rows).astype(np.int64)


def _apart(ends: Longs, crossed: Longs, count: int) -> Longs:
    """Ends with those of some edges as if each of their sides were alone.

    What is solid from below on both sides begins with the lowest of the other ends.
    """
    ends = ends.copy()
    edge, side, from_below = ends[:, 0], ends[:, 4], ends[:, 5]
    some = np.isin(edge, crossed)
    grounded = np.zeros((2, count), np.bool_)
    own = some & (from_below == 1)
    grounded[side[own], edge[own]] = True
    both = some & (grounded[0] & grounded[1])[edge]
    for column in (1, 2):
        lowest = np.full(count, np.iinfo(np.int64).max)
        finite = np.flatnonzero(both & (ends[:, column] >= 0))
        np.minimum.at(lowest, edge[finite], ends[finite, column])
        ends[both, column] = np.maximum(ends[both, column], lowest[edge[both]])
    ends[both, 5] = 0
    ends[some & (side == 1), 0] += count
    return _in_order(ends)


def _in_order(ends: Longs) -> Longs:
    """Ends of each edge from below."""
    return ends[np.lexsort([ends[:, 3], ends[:, 2], ends[:, 1], ends[:, 0]])]


def _strips(sides: StackSides, edges: _Edges, ends: Longs) -> StackWalls:
    """Walls between the ends of intervals at edges, one above the other."""
    edge, low_p, low_q, is_top, side, from_below = ends.T
    count = len(edges.left)
    first = np.flatnonzero(np.diff(edge, prepend=-1))
    group = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(edge))))

    def by_side(values: Longs) -> Longs:
        """Sums of values up to each end of its edge, on the left and on the right, (2, n)."""
        total = np.cumsum(values * (side == np.array([[0], [1]])), axis=1)
        before = np.where(first > 0, total[:, first - 1], 0)
        return np.asarray(total - before[:, group])

    step = 1 - 2 * is_top
    inside, from_ground = by_side(step) > 0, by_side(step * from_below) > 0
    passed = by_side(is_top)
    last = np.append(first[1:], len(edge)) - 1
    grounded = by_side(from_below * is_top)[:, last][:, group] > 0
    after = np.minimum(np.arange(len(edge)) + 1, len(edge) - 1)
    there = (edge[after] == edge) & (inside[0] != inside[1])
    there &= (low_p[after] != low_p) | (low_q[after] != low_q)
    at = np.flatnonzero(there)
    solid = inside[1, at].astype(np.int64)  # which of the two it is
    outer = from_ground[solid, at] & ~grounded[1 - solid, at]
    if not sides.closed:
        at, solid, outer = at[~outer], solid[~outer], outer[~outer]
    own = edge[at] % count
    t = np.stack([edges.left[own], edges.right[own]])
    p = sides.plane.triangles[t[0], edges.begin[own]]
    q = sides.plane.triangles[t[0], (edges.begin[own] + 1) % 3]
    chains = LevelChains(
        np.where(low_p[at] < 0, sides.begins[p], low_p[at]), low_p[at + 1],
        np.where(low_q[at] < 0, sides.begins[q], low_q[at]), low_q[at + 1],
    )  # fmt: skip
    faces, slab = _zip(chains.swapped(solid == 1), sides.levels)
    alone = edge[at] >= count  # the other side of an edge whose sides stand apart
    return StackWalls(
        faces,
        t[solid, np.arange(len(at))][slab],
        passed[solid, at][slab],
        np.where(alone, -1, t[1 - solid, np.arange(len(at))])[slab],
        passed[1 - solid, at][slab] - 1,
        outer[slab],
    )


class LevelChains(NamedTuple):
    """First and last levels at two vertices, (n,) each: at p, which is on the left, and at q."""

    p_first: Longs
    p_last: Longs
    q_first: Longs
    q_last: Longs

    def swapped(self, which: NDArray[np.bool_]) -> LevelChains:
        """Return these chains with p and q in place of each other where a mask is set."""
        first, last, third, fourth = self
        pairs = (first, third), (last, fourth), (third, first), (fourth, last)
        return LevelChains(*(np.where(which, other, one) for one, other in pairs))


def _zip(chains: LevelChains, levels: NDArray[np.float64]) -> tuple[Ints, Longs]:
    """Faces between chains of levels, (k, 3), and the index of the chains of each, (k,)."""
    p0, p1, q0, q1 = chains
    counts = np.stack([p1 - p0, q1 - q0])
    slab = np.concatenate([np.repeat(np.arange(len(p0)), own) for own in counts])
    of_q = np.repeat([0, 1], counts.sum(axis=1))
    firsts = np.concatenate([np.repeat(p0, counts[0]), np.repeat(q0, counts[1])])
    starts = np.concatenate([np.repeat(np.cumsum(own) - own, own) for own in counts])
    within = np.concatenate([np.arange(own.sum()) for own in counts]) - starts
    new = firsts + within + 1
    # the lower one of the next levels comes first
    order = np.lexsort([of_q, levels[new], slab])
    slab, of_q, new = slab[order], of_q[order], new[order]
    begin = np.cumsum(counts.sum(axis=0)) - counts.sum(axis=0)
    q_before = np.cumsum(of_q) - of_q
    q_before -= np.append(q_before, 0)[begin[slab]]
    p_before = np.arange(len(slab)) - begin[slab] - q_before
    faces = np.column_stack([p0[slab] + p_before, q0[slab] + q_before, new])
    return faces.astype(np.int32), slab
