"""Height fields at walls: their cells that stand for lower ground and rise above none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.simulators.collision.height_patch import Bools, Floats, HeightPatch, Indices, runs
from terratool.simulators.collision.solids import SLIVER, GroundTriangles

_ON = 1e-6
"""Distance below which a point is on an edge, in parts of the triangle's height over the edge."""
HALVES = np.array([[[0, 0], [0, 1], [1, 1]], [[0, 0], [1, 1], [1, 0]]])
"""Rows and columns of the nodes of a cell's two triangles, (2, 3, 2), as MuJoCo parts it."""


class Footing(NamedTuple):
    """A height field at walls, and the ground that it does not stand for.

    Attributes:
        patch: height field, the cells above the ground left out.
        triangles: (n,) indices of triangles of the ground; some occur more than once.
        parts: (n,) polygons in which the height field does not stand for these triangles.
    """

    patch: HeightPatch
    triangles: Indices
    parts: NDArray[Any]


def footing_of(patch: HeightPatch, ground: GroundTriangles, error: float) -> Footing:
    """Leave out the cells of a height field that are above the ground at walls.

    Cells at walls are used that are nowhere higher than the ground, and as high as some of it. No
    triangle or edge that is higher somewhere keeps all its nodes.

    Args:
        patch: height field.
        ground: all of the ground, void included.
        error: largest distance of the height field from the ground, along z.
    """
    row, column = np.nonzero(patch.near & np.isfinite(patch.misses))
    at = np.stack([row, column], axis=1)[:, None, None] + HALVES  # (n, 2, 3, 2)
    halves = patch.at(at[..., 0], at[..., 1]).reshape(-1, 3, 3)
    pairs = _pairs(ground, shapely.polygons(halves[:, :, :2]))
    points, which = shapely.get_coordinates(pairs.shared, return_index=True)
    over = heights_of(halves[pairs.first[which]], points)
    over -= heights_of(ground.triangles[pairs.triangle[which]], points)
    above, below = _maxima(over, which), _maxima(-over, which)
    cell = pairs.first // 2
    high = np.unique(pairs.first[above > error])
    higher = np.zeros(patch.near.shape, np.bool_)
    higher[row[high // 2], column[high // 2]] = True
    away = _weights(halves[pairs.first[which]], points)
    edges = np.zeros((len(halves), 3), np.bool_)
    spot, corner = np.nonzero((away < _ON) & (over > error)[:, None])
    edges[pairs.first[which[spot]], corner] = True
    right = (above <= error) & (below <= error)
    area = np.zeros((len(row), int(ground.surfaces.max()) + 2))
    worn = ground.surfaces[pairs.triangle[right]] + 1
    np.add.at(area, (cell[right], worn), shapely.area(pairs.shared[right]))
    surfaces, fits = patch.surfaces.copy(), ~patch.near
    surfaces[row, column] = area.argmax(axis=1) - 1
    fits[row, column] = area.max(axis=1) > SLIVER
    nodes = at.reshape(-1, 3, 2)
    used = _drop_groups(
        patch.used & fits & ~higher, np.concatenate([nodes[high], _ridges(nodes, edges)])
    )
    patch = replace(patch, used=used, surfaces=surfaces)
    apart = (below > error) & used[row[cell], column[cell]]
    loose = _pairs(ground, runs(patch, patch.uncovered))
    return Footing(
        patch,
        np.concatenate([pairs.triangle[apart], loose.triangle]),
        np.concatenate([pairs.shared[apart], loose.shared]),
    )


def with_misses_at(patch: HeightPatch, points: Floats) -> HeightPatch:
    """Return a height field whose misses include those at points of the ground.

    Args:
        patch: height field.
        points: (n, 3) points of the ground, x ascending.
    """
    west, south, east, north = patch.bounds
    begin, end = np.searchsorted(points[:, 0], (west, east))
    points = points[begin:end]
    points = points[(points[:, 1] >= south) & (points[:, 1] <= north)]
    size = np.array(patch.used.shape[::-1])
    place = (points[:, :2] - (west, south)) / patch.cell
    cell = np.minimum(place.astype(np.intp), size - 1)
    u, v = (place - cell).T
    at = cell[:, None, ::-1] + HALVES[(v > u).astype(np.intp)]
    over = heights_of(patch.at(at[..., 0], at[..., 1]), points[:, :2]) - points[:, 2]
    misses = patch.misses.copy()
    np.maximum.at(misses, (cell[:, 1], cell[:, 0]), np.abs(over))
    return replace(patch, misses=misses)


def _ridges(nodes: Indices, high: Bools) -> Indices:
    """Return edges that are higher than the ground on both sides, by nodes, the last one twice.

    An edge that is higher on one side only stands on a wall.

    Args:
        nodes: (n, 3, 2) rows and columns of the nodes of triangles.
        high: (n, 3) whether the edge opposite to a node is higher somewhere in the triangle.
    """
    which, corner = np.nonzero(high)
    ends = nodes[which[:, None], (corner[:, None] + [1, 2]) % 3]
    order = np.lexsort((ends[..., 1], ends[..., 0]))
    ends = np.take_along_axis(ends, order[..., None], axis=1).reshape(-1, 4)
    edges, times = np.unique(ends, axis=0, return_counts=True)
    both = edges[times > 1].reshape(-1, 2, 2)
    return np.concatenate([both, both[:, 1:]], axis=1)


def _drop_groups(used: Bools, wrong: Indices) -> Bools:
    """Drop used cells until no group of nodes, (n, 3, 2), is used as a whole."""
    used = np.pad(used, 1)
    while True:
        nodes = used[:-1, :-1] | used[1:, :-1] | used[:-1, 1:] | used[1:, 1:]
        wrong = wrong[nodes[wrong[..., 0], wrong[..., 1]].all(axis=1)]
        if not len(wrong):
            return used[1:-1, 1:-1]
        count = np.zeros(nodes.shape, np.intp)
        np.add.at(count, (wrong[..., 0], wrong[..., 1]), 1)
        worst = count[wrong[..., 0], wrong[..., 1]].argmax(axis=1)
        i, j = wrong[np.arange(len(wrong)), worst].T
        for down in (0, 1):
            for right in (0, 1):
                used[i + down, j + right] = False


@dataclass(frozen=True)
class _Pairs:
    """Pairs of a shape and a triangle of the ground that share some area.

    Attributes:
        first: (n,) index of each pair's shape.
        triangle: (n,) index of each pair's triangle.
        shared: (n,) polygons of the shared area.
    """

    first: Indices
    triangle: Indices
    shared: NDArray[Any]


def _pairs(ground: GroundTriangles, shapes: NDArray[Any]) -> _Pairs:
    """Return the pairs of shapes and triangles of the ground, by shape, then by triangle."""
    first, triangle = ground.tree.query(shapes, predicate="intersects")
    order = np.lexsort((triangle, first))
    first, triangle = first[order], triangle[order]
    shared = shapely.intersection(shapes[first], ground.tree.geometries[triangle])
    some = shapely.area(shared) > SLIVER
    return _Pairs(first[some], triangle[some], shared[some])


def _maxima(values: Floats, which: Indices) -> Floats:
    """Return the largest of the values of each index in `which`, which ascends."""
    begins = np.flatnonzero(np.append(True, np.diff(which) > 0))[: len(values)]
    return np.maximum.reduceat(values, begins) if len(values) else values


def heights_of(triangles: Floats, points: Floats) -> Floats:
    """Return the heights of triangles' planes, (n, 3, 3), at points, one for each, (n,)."""
    return np.asarray((_weights(triangles, points) * triangles[:, :, 2]).sum(axis=1))


def _weights(triangles: Floats, points: Floats) -> Floats:
    """Return barycentric coordinates of points, one a triangle, seen from above, (n, 3)."""
    a, b, c = np.moveaxis(triangles[:, :, :2], 1, 0)
    u, v, away = b - a, c - a, points - a
    size = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    s = (away[:, 0] * v[:, 1] - away[:, 1] * v[:, 0]) / size
    t = (u[:, 0] * away[:, 1] - u[:, 1] * away[:, 0]) / size
    return np.stack([1.0 - s - t, s, t], axis=1)


def rest_of(footings: list[Footing], ground: GroundTriangles) -> tuple[Indices, Floats]:
    """Return the ground that height fields do not stand for, as triangles.

    The parts of each triangle of the ground are replaced by their convex hull.

    Args:
        footings: footings of all height fields.
        ground: all of the ground.

    Returns:
        (n,) indices of the triangles of the ground, and (n, 3, 3) corners of parts of these.
    """
    triangle = np.concatenate([one.triangles for one in footings])
    parts = np.concatenate([one.parts for one in footings])
    points, which = shapely.get_coordinates(parts, return_index=True)
    order = np.argsort(triangle[which], kind="stable")
    index, line = np.unique(triangle[which][order], return_inverse=True)
    hulls = shapely.convex_hull(shapely.linestrings(points[order], indices=line))
    fans, of = _fans(hulls)
    index = index[of]
    heights = heights_of(np.repeat(ground.triangles[index], 3, axis=0), fans.reshape(-1, 2))
    return index, np.concatenate([fans, heights.reshape(-1, 3, 1)], axis=2)


def _fans(polygons: NDArray[Any]) -> tuple[Floats, Indices]:
    """Part convex polygons into triangles, (n, 3, 2), and the index of each one's polygon, (n,)."""
    corners, of = shapely.get_coordinates(polygons, return_index=True)
    begins = np.flatnonzero(np.append(True, np.diff(of) > 0))[: len(polygons)]
    count = np.diff(np.append(begins, len(corners))) - 3  # the first corner is the last, too
    index = np.repeat(np.arange(len(polygons)), count)
    second = begins[index] + 1 + np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    return corners[np.stack([begins[index], second, second + 1], axis=1)], index
