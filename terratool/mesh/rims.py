"""Rims of tiles: triangles beside a seam take its heights, so that both of its sides are alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.planar import Triangulation
from terratool.mesh.types import TileBoundary

NO_SEAMS = TileBoundary(np.full(4, -1), np.empty((0, 4), np.int64), np.empty((0, 2)))
"""The rim of a mesh that stands alone."""

Ints = NDArray[np.int64]


def boundary_triangles(plane: Triangulation, rim: TileBoundary) -> tuple[Ints, Ints]:
    """The triangle beside each edge of a rim, (n,), and which of its corners begins the edge.

    Raises:
        RuntimeError: the triangles have other edges on the seams.
    """
    points, triangles, neighbours = plane
    t, c = np.nonzero(neighbours < 0)
    a, b = points[triangles[t, c]], points[triangles[t, (c + 1) % 3]]
    on_seam = _on_sides(a, rim.sides) & _on_sides(b, rim.sides)
    on_seam = (on_seam & np.hstack([a == b, a == b])).any(axis=1)
    t, c, a, b = t[on_seam], c[on_seam], a[on_seam], b[on_seam]
    ends = np.sort(np.column_stack([_packed(a), _packed(b)]), axis=1)
    wanted = np.column_stack([_packed(rim.edges[:, :2]), _packed(rim.edges[:, 2:])])
    order, order_wanted = np.lexsort(ends.T), np.lexsort(wanted.T)
    if not np.array_equal(ends[order], wanted[order_wanted]):
        raise RuntimeError("a tile does not have the edges of its seams")
    found = np.empty(len(order), np.int64)
    found[order_wanted] = order
    return t[found], c[found]


def pin_heights(
    plane: Triangulation,
    rim: TileBoundary,
    triangle: Ints,
    corner: Ints,
    voids: NDArray[np.bool_],
    heights: NDArray[np.float64],
) -> None:
    """Give the corners of triangles that are vertices of a rim the heights that it has there.

    Args:
        plane: m triangles.
        rim: n edges.
        triangle: (n,) which is beside each edge.
        corner: (n,) which of its corners begins the edge.
        voids: (m,) whether there is no ground in each triangle.
        heights: (m, 3) of their corners; changed.
    """
    points, triangles, _ = plane
    after = (corner + 1) % 3
    begins = _packed(points[triangles[triangle, corner]]) == _packed(rim.edges[:, :2])
    ends = np.where(begins[:, None], rim.heights, rim.heights[:, ::-1])

    # the lowest and the highest height of each vertex; others that meet in it take the nearer one
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


def _packed(points: Ints) -> Ints:
    """One number for each vertex, (n,)."""
    return (points[:, 0] << 31) | points[:, 1]


def _on_sides(points: Ints, sides: Ints) -> NDArray[np.bool_]:
    """Whether vertices lie on each of the sides, (n, 4)."""
    return np.asarray(points[:, [0, 1, 0, 1]] == sides)
