"""Seams between the tiles of a terrain, and the vertices on them, which the tiles share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.kernels import mesh as kernels
from terratool.mesh.triangulate import regions_of
from terratool.mesh.types import MeshPlan, TileBoundary, Triangulation

NO_SEAMS = TileBoundary(np.full(4, -1), np.empty((0, 4), np.int64), np.empty((0, 2)))
"""The boundary of a mesh that stands alone."""
CLEARANCE = 16
"""Least distance of a segment's end, or of a crossing, from a seam, in points of the lattice."""
_SAME = 3.0
"""Largest distance of segments that pass a seam at one vertex, in points of the lattice."""
_WIDEST = 64.0
"""Largest distance, as far as both go, of segments that pass a seam at one vertex, in points of the
lattice; between them lies a crack of walls."""
_TRIES = 400
"""Most places that are tried for a seam."""
_SPREAD = 0.125
"""Width in which a seam is sought around its regular place, in parts of a tile."""
_GOLDEN = 0.6180339887498949
"""Golden ratio: order in which places for a seam are tried."""

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


class Seam(NamedTuple):
    """A line that tiles meet in.

    Attributes:
        axis: 0 if x is constant along the line, 1 if y is.
        at: constant x or y of the line, on the lattice.
        passes: (n,) places along the line of its ends, of passing segments and of other seams.
        begins: (n,) places from which on, up to the next one, segments pass at a vertex of
            `passes`.
        places: (m,) places of all vertices along the line, `passes` included, ascending.
        heights: (m - 1, 2) float64 heights at the two ends of each edge.
    """

    axis: int
    at: int
    passes: Ints
    begins: Ints
    places: Ints
    heights: Floats


class _Line(NamedTuple):
    """A seam of which only the place is known.

    Attributes:
        axis: 0 if x is constant along the line, 1 if y is.
        at: constant x or y of the line, on the lattice.
        passes: (n,) places along the line, as in `Seam`.
        begins: (n,) places along the line, as in `Seam`.
        slants: (n,) steepest slant of passing segments, their length for a step across the line.
    """

    axis: int
    at: int
    passes: Ints
    begins: Ints
    slants: Floats


def lay_seams(plan: MeshPlan, columns: int, rows: int) -> tuple[list[Seam], list[Seam]]:
    """Return the seams between columns of tiles, west to east, and between rows, south to north.

    Raises:
        RequestError: edges are too near to each other for a seam between them.
    """
    across = [_find_line(plan, 1, row, rows, []) for row in range(1, rows)]
    along = [_find_line(plan, 0, column, columns, across) for column in range(1, columns)]
    crossings = [line.at for line in along]
    across = [_with_vertices(line, crossings) for line in across]
    horizontal = [_with_heights(plan, line) for line in across]
    vertical = [_with_heights(plan, line) for line in along]
    for seam in vertical:  # where two seams cross, heights are those of one of them
        for other in horizontal:
            k, n = np.searchsorted(seam.places, other.at), np.searchsorted(other.places, seam.at)
            seam.heights[k - 1, 1], seam.heights[k, 0] = (
                other.heights[n - 1, 1],
                other.heights[n, 0],
            )
    return vertical, horizontal


def _find_line(
    plan: MeshPlan, axis: int, number: int, count: int, others: Sequence[_Line]
) -> _Line:
    """Return the first line that may be a seam, of those near its regular place."""
    low, high = plan.bounds[axis], plan.bounds[axis + 2]
    side = (high - low) / count
    wanted = low + number * side
    reach = 0.5 * _SPREAD * side
    begins, ends = plan.footprints[:, axis], plan.footprints[:, axis + 2]
    near = (begins <= wanted + reach + CLEARANCE) & (ends >= wanted - reach - CLEARANCE)
    chosen = np.flatnonzero(near & (plan.frames["drawn"] != 0))
    begins, ends = begins[chosen], ends[chosen]
    for k in range(_TRIES):
        # an irrational step: cells of all sizes have their edges at fractions
        at = round(wanted + reach * (2.0 * (((k + 0.5) * _GOLDEN) % 1.0) - 1.0))
        there = (begins <= at + CLEARANCE) & (ends >= at - CLEARANCE)
        line = _line(plan, axis, at, kernels.segments_of(plan.kernel_plan, chosen[there]), others)
        if line is not None:
            return line
    raise RequestError(
        "The terrain has edges so near to each other that no seam fits between them.",
        "Ask for fewer tiles, or leave out small elements.",
    )


def _line(
    plan: MeshPlan, axis: int, at: int, segments: Ints, others: Sequence[_Line]
) -> _Line | None:
    """Return a line as a seam, or None if it may not be one.

    Args:
        plan: plan of the terrain.
        axis: 0 if x is constant along the line, 1 if y is.
        at: constant x or y of the line, on the lattice.
        segments: (n, 4) segments, all that are near the line.
        others: seams that the line crosses.
    """
    for other in others:
        if (np.abs(other.passes - at) < CLEARANCE * other.slants).any():
            return None
    # sides of the whole terrain and other seams pass, too; they come first
    b = plan.bounds.astype(np.int64)
    fixed = np.array([b[1 - axis], b[3 - axis], *(other.at for other in others)], np.int64)
    straight = np.empty((len(fixed), 4), np.int64)
    straight[:, axis], straight[:, axis + 2] = b[axis], b[axis + 2]
    straight[:, 1 - axis] = straight[:, 3 - axis] = fixed
    segments = np.concatenate([straight, segments])
    if (np.abs(segments[:, [axis, axis + 2]] - at) <= CLEARANCE).any():
        return None
    passing = np.flatnonzero((segments[:, axis] < at) != (segments[:, axis + 2] < at))
    passing = passing[np.argsort(_places_at(segments[passing], axis, at), kind="stable")]
    segments = segments[passing]
    first, slants = _bundles(segments, axis, at)
    if first is None:
        return None
    passes = passing_places(segments, axis, at)[first]
    begins = np.floor(_places_at(segments, axis, at)[first]).astype(np.int64)
    bundle = np.searchsorted(first, np.arange(len(segments)), "right") - 1
    own = np.flatnonzero(passing < len(fixed))
    passes[bundle[own]] = fixed[passing[own]]
    # nothing else passes where seams cross
    crossings = bundle[own[passing[own] >= 2]]
    if (np.bincount(bundle)[crossings] > 1).any():
        return None
    return _Line(axis, at, passes, begins, slants)


def _bundles(segments: Ints, axis: int, at: int) -> tuple[Ints | None, Floats]:
    """Bundle segments that pass a line at one vertex.

    Args:
        segments: (n, 4) segments that pass the line, in the order in which they do.
        axis: 0 if x is constant along the line, 1 if y is.
        at: constant x or y of the line, on the lattice.

    Returns:
        (m,) indices of the bundles' first segments, or None if some segments are neither one nor
        apart; (m,) steepest slant of each bundle, the length of a segment for a step across the
        line.
    """
    run, rise = (
        segments[:, axis + 2] - segments[:, axis],
        segments[:, 3 - axis] - segments[:, 1 - axis],
    )
    slants = np.hypot(run, rise) / np.abs(run)
    place = _places_at(segments, axis, at)
    steeper = np.maximum(slants[1:], slants[:-1])
    same = np.diff(place) <= _SAME * steeper
    if not _are_one(segments[:-1][same], segments[1:][same], axis, steeper[same]):
        return None, slants
    first = np.flatnonzero(np.concatenate([[True], ~same]))
    last = np.append(first[1:], len(place)) - 1
    slants = np.maximum.reduceat(slants, first)
    if (place[last] - place[first] > 4 * _SAME * slants).any():
        return None, slants
    steeper = np.maximum(slants[1:], slants[:-1])
    for offset in (-CLEARANCE, CLEARANCE):  # one order there: none cross in between
        there = _places_at(segments, axis, at + offset)
        low, high = np.minimum.reduceat(there, first), np.maximum.reduceat(there, first)
        if (low[1:] - high[:-1] < 0.5 * _SAME * steeper).any():
            return None, slants
    return first, slants


def _places_at(segments: Ints, axis: int, at: int | Ints) -> Floats:
    """Return the places where lines through segments pass a line, (n,), not rounded."""
    begin, end = segments[:, axis], segments[:, axis + 2]
    low, high = segments[:, 1 - axis], segments[:, 3 - axis]
    return np.asarray(low + (at - begin) / (end - begin) * (high - low))


def _are_one(one: Ints, two: Ints, axis: int, slants: Floats) -> bool:
    """Whether pairs of segments run side by side as far as both go."""
    ends = np.sort(one[:, [axis, axis + 2]], axis=1), np.sort(two[:, [axis, axis + 2]], axis=1)
    for at in (np.maximum(ends[0][:, 0], ends[1][:, 0]), np.minimum(ends[0][:, 1], ends[1][:, 1])):
        if (np.abs(_places_at(one, axis, at) - _places_at(two, axis, at)) > _WIDEST * slants).any():
            return False
    return True


def passing_places(segments: Ints, axis: int, at: int) -> Ints:
    """Return the places where segments pass a line, (n,), exact ones rounded to the lattice."""
    run = segments[:, axis + 2] - segments[:, axis]
    rise = (segments[:, 3 - axis] - segments[:, 1 - axis]) * np.sign(run)
    run = np.abs(run)
    # twice the product of two numbers of 30 bits fits in 64
    return np.asarray(
        segments[:, 1 - axis] + (2 * (at - segments[:, axis]) * rise + run) // (2 * run)
    )


def _with_vertices(line: _Line, places: Sequence[int]) -> _Line:
    """Return a line with further vertices at places, where other seams cross."""
    more = np.array(places, np.int64)
    passes = np.append(line.passes, more)
    order = np.argsort(passes)
    slants = np.append(line.slants, np.ones(len(more)))
    begins = np.append(line.begins, more)
    return line._replace(passes=passes[order], begins=begins[order], slants=slants[order])


def _with_heights(plan: MeshPlan, line: _Line) -> Seam:
    """Return a line as a seam with heights, and with as many vertices as these need."""
    axis, at, passes, begins, slants = line
    points = np.empty((len(passes), 2), np.int64)
    points[:, axis], points[:, 1 - axis] = at, passes
    first = np.arange(len(passes) - 1, dtype=np.int32)
    stretches = np.column_stack([first, first, first + 1])  # their middles lie on the seam
    keys = kernels.region_keys(plan.kernel_plan, points, stretches)
    regions, region_of = regions_of(plan, points, stretches, keys)
    # vertices stay away from segments that pass at a slant
    clearance = np.maximum(np.ceil(3 * _SAME * slants), kernels.SHORTEST_SEAM)
    ends, heights = kernels.divide_seam(
        plan.kernel_plan, regions, region_of, axis, at, passes, clearance
    )
    # heights that are one in a mesh are one number
    one = np.abs(heights[1:, 0] - heights[:-1, 1]) <= plan.tolerance
    heights[1:, 0] = np.where(one, heights[:-1, 1], heights[1:, 0])
    return Seam(axis, at, passes, begins, np.concatenate([passes[:1], ends]), heights)


def boundary_of(bounds: Sequence[int], seams: Sequence[Seam | None]) -> TileBoundary:
    """Return the boundary of a tile.

    Args:
        bounds: west, south, east, north of the tile, on the lattice.
        seams: seams on the west, south, east and north side; None where no tile is beyond.
    """
    sides = np.full(4, -1)
    edges, heights = [np.empty((0, 4), np.int64)], [np.empty((0, 2))]
    for side, seam in enumerate(seams):
        if seam is None:
            continue
        sides[side] = seam.at
        begin, end = np.searchsorted(
            seam.places, [bounds[1 - seam.axis], bounds[3 - seam.axis]]
        ).tolist()
        places = seam.places[begin : end + 1]
        own = np.empty((end - begin, 4), np.int64)
        own[:, seam.axis] = own[:, seam.axis + 2] = seam.at
        own[:, 1 - seam.axis], own[:, 3 - seam.axis] = places[:-1], places[1:]
        edges.append(own)
        heights.append(seam.heights[begin:end])
    return TileBoundary(sides, np.concatenate(edges), np.concatenate(heights))


def cut_segments(segments: Ints, bounds: Sequence[int], seams: Sequence[Seam | None]) -> Ints:
    """Return the parts of segments within a tile, (n, 4), which end in vertices of its seams.

    Args:
        segments: (n, 4) segments of the whole terrain.
        bounds: west, south, east, north of the tile, on the lattice.
        seams: seams on the west, south, east and north side; None where no tile is beyond.
    """
    west, south, east, north = bounds
    low, high = segments[:, :2], segments[:, 2:]
    points, inside = [low, high], []
    for point in (low, high):
        x, y = point.T
        inside.append((x >= west) & (x <= east) & (y >= south) & (y <= north))
    for seam in seams:
        if seam is None:
            continue
        axis, at = seam.axis, seam.at
        passing = np.flatnonzero((segments[:, axis] < at) != (segments[:, axis + 2] < at))
        place = np.zeros(len(segments), np.int64)
        place[passing] = passing_places(segments[passing], axis, at)
        place = seam.passes[np.searchsorted(seam.begins, place, "right") - 1]
        point = np.empty((len(segments), 2), np.int64)
        point[:, axis], point[:, 1 - axis] = at, place
        points.append(point)
        within = np.zeros(len(segments), bool)
        within[passing] = True
        within &= (place >= bounds[1 - axis]) & (place <= bounds[3 - axis])
        inside.append(within)
    of, which = np.nonzero(np.column_stack(inside))
    both = np.flatnonzero(of[1:] == of[:-1])
    ends = np.stack(points, axis=1)
    return np.hstack([ends[of[both], which[both]], ends[of[both], which[both + 1]]])


def boundary_triangles(plane: Triangulation, boundary: TileBoundary) -> tuple[Ints, Ints]:
    """Return the triangle beside each edge of a boundary, (n,), and its corner that begins it.

    Raises:
        RuntimeError: the triangles have other edges on the seams.
    """
    points, triangles, neighbours = plane
    t, c = np.nonzero(neighbours < 0)
    a, b = points[triangles[t, c]], points[triangles[t, (c + 1) % 3]]
    on_seam = _on_sides(a, boundary.sides) & _on_sides(b, boundary.sides)
    on_seam = (on_seam & np.hstack([a == b, a == b])).any(axis=1)
    t, c, a, b = t[on_seam], c[on_seam], a[on_seam], b[on_seam]
    ends = np.sort(np.column_stack([_pack(a), _pack(b)]), axis=1)
    wanted = np.column_stack([_pack(boundary.edges[:, :2]), _pack(boundary.edges[:, 2:])])
    order, order_wanted = np.lexsort(ends.T), np.lexsort(wanted.T)
    if not np.array_equal(ends[order], wanted[order_wanted]):
        raise RuntimeError("a tile does not have the edges of its seams")
    found = np.empty(len(order), np.int64)
    found[order_wanted] = order
    return t[found], c[found]


def pin_heights(
    plane: Triangulation,
    boundary: TileBoundary,
    triangle: Ints,
    corner: Ints,
    voids: NDArray[np.bool_],
    heights: NDArray[np.float64],
) -> None:
    """Give the corners of triangles at vertices of a boundary the heights of the boundary.

    Args:
        plane: triangulation of m triangles.
        boundary: boundary of n edges.
        triangle: (n,) index of the triangle beside each edge.
        corner: (n,) corner of the triangle, 0 to 2, that begins each edge.
        voids: (m,) bool, whether a triangle has no ground.
        heights: (m, 3) heights at the corners of triangles; changed in place.
    """
    points, triangles, _ = plane
    after = (corner + 1) % 3
    begins = _pack(points[triangles[triangle, corner]]) == _pack(boundary.edges[:, :2])
    ends = np.where(begins[:, None], boundary.heights, boundary.heights[:, ::-1])

    # lowest and highest height of each vertex; other corners there take the nearer one
    low, high = np.full(len(points), np.inf), np.full(len(points), -np.inf)
    solid = ~voids[triangle]
    for k, z in ((corner, ends[:, 0]), (after, ends[:, 1])):
        vertex = triangles[triangle, k][solid]
        np.minimum.at(low, vertex, z[solid])
        np.maximum.at(high, vertex, z[solid])
    t, c = np.nonzero(np.isfinite(low)[triangles])
    own, vertex = heights[t, c], triangles[t, c]
    nearer = np.abs(own - low[vertex]) <= np.abs(own - high[vertex])
    heights[t, c] = np.where(nearer, low[vertex], high[vertex])
    heights[triangle, corner], heights[triangle, after] = ends.T


def _pack(points: Ints) -> Ints:
    """Return one number for each vertex, (n,)."""
    return (points[:, 0] << 31) | points[:, 1]


def _on_sides(points: Ints, sides: Ints) -> NDArray[np.bool_]:
    """Whether vertices lie on each of the sides, (n, 4)."""
    return np.asarray(points[:, [0, 1, 0, 1]] == sides)
