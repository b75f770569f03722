"""What closes a mesh: where its rim runs, and the base below it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.mesh.planar import delaunay

Ints = NDArray[np.int32]


def base_below(lowest: float, highest: float, side: float) -> float:
    """Where a base lies if none is given, in units of the terrain.

    Below the lowest level by a tenth of the relief, and by no less than a hundredth of the longer
    side, so that flat ground becomes a plate.
    """
    return lowest - max(0.1 * (highest - lowest), 0.01 * side)


def check_base(base: float, lowest: float, tolerance: float) -> None:
    """Refuse a base that does not lie below all ground.

    Raises:
        RequestError: it does not.
    """
    if not -np.inf < base < lowest - tolerance:
        raise RequestError(
            f"The base at {base:g} is not below the lowest ground of the mesh, which is at"
            f" {lowest:g}.",
            "Give a base that is lower.",
        )


def outer_edges(neighbours: Ints, ground: NDArray[np.bool_]) -> Ints:
    """Edges that the ground ends at, at the hull or at the void.

    Args:
        neighbours: (m, 3) triangles beyond edges, -1 for none.
        ground: (m,) whether a triangle is ground.

    Returns:
        (k, 2) triangle, and which of its edges.
    """
    ends = ground[:, None] & ((neighbours < 0) | ~ground[neighbours])
    return np.argwhere(ends).astype(np.int32, order="C")


def base_of(points: NDArray[np.int64], edges: Ints) -> Ints:
    """Triangles between loops of edges, without another vertex: (b, 3), counter-clockwise.

    Args:
        points: (n, 2) on the lattice.
        edges: (k, 2) indices of points; what is to be covered lies on one side of each.
    """
    if not len(edges):
        return np.empty((0, 3), np.int32)
    used, index = np.unique(edges, return_inverse=True)
    _, triangles, _ = delaunay(points[used].astype(np.float64), index.reshape(-1, 2), within=True)
    return used[triangles].astype(np.int32)
