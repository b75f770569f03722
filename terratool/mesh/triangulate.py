"""Triangulation of the plane along segments, and regions of its triangles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import mesh as kernels
from terratool.mesh.types import (
    COVERING_ELEMENT,
    MeshPlan,
    Regions,
    TileBoundary,
    Triangulation,
)

_ROUNDS = 8
"""Most rounds of welding vertices and leading edges through them."""
_NEAR = 1.5
"""Distance below which a vertex is on a segment, in points of the lattice."""
_ATTEMPTS = 8
"""Most attempts to insert edges, each in another order and with crossings twice as wide."""
_NONE = 0xFFFFFFFF
"""Index of no triangle in pythoncdt."""

Ints = NDArray[np.int64]


def regions_of(
    plan: MeshPlan, points: Ints, triangles: NDArray[np.int32], keys: Ints
) -> tuple[Regions, NDArray[np.int32]]:
    """Return the regions of triangles by key, each as it is in its first triangle.

    Args:
        plan: plan of the terrain.
        points: (n, 2) vertices on the lattice.
        triangles: (m, 3) indices of vertices.
        keys: (m,) keys, equal for triangles of one region.

    Returns:
        The regions, and (m,) the index of each triangle's region.
    """
    _, chosen, region_of = np.unique(keys, return_index=True, return_inverse=True)
    found = kernels.describe_regions(plan.kernel_plan, points, triangles, chosen)
    found["covering"] = found["covering"].view(COVERING_ELEMENT)
    found["voids"], found["affine"] = found["voids"].view(bool), found["affine"].view(bool)
    return Regions(**found), region_of.reshape(-1).astype(np.int32)


def triangulate(
    segments: Ints,
    limits: Ints,
    keys_of: Callable[[Ints, NDArray[np.int32]], Ints],
    boundary: TileBoundary,
) -> tuple[Triangulation, Ints]:
    """Triangulate a rectangle along segments.

    Args:
        segments: (n, 4) int64 x, y, x, y on the lattice, in the rectangle.
        limits: (4,) west, south, east, north of the rectangle.
        keys_of: function of points and triangles that returns keys, (m,), equal wherever no edge is
            needed between two triangles.
        boundary: seams of the rectangle, which meet segments at vertices of the seams only.

    Returns:
        The triangulation, and (m,) keys of its triangles.
    """
    west, south, east, north = limits.tolist()
    around = [[west, south, west, north], [west, south, east, south]]
    around += [[east, south, east, north], [west, north, east, north]]
    outer = np.array(around, np.int64)[boundary.sides < 0]
    points, edges = _index(np.concatenate([segments, outer, boundary.edges]))
    for near in range(2, 2 + _ROUNDS):
        points, edges = _weld(points, edges, limits, boundary.sides, near)
        found, triangles, neighbours = delaunay(points.astype(np.float64), edges)
        points = np.rint(found).astype(np.int64)
        keys = keys_of(points, triangles)
        thin = kernels.find_thin(points, triangles, _NEAR)
        if not len(thin):
            break
        edges = _bend(_borders(triangles, neighbours, keys), thin, len(points))
    return Triangulation(points, triangles, neighbours), keys


def _index(segments: Ints) -> tuple[Ints, Ints]:
    """Return vertices of segments, each once, and segments as indices, (n, 2), each once."""
    ends = segments.reshape(-1, 2)
    # one number sorts faster than two
    packed, index = np.unique((ends[:, 0] << 31) | ends[:, 1], return_inverse=True)
    points = np.column_stack([packed >> 31, packed & ((1 << 31) - 1)])
    return points, _unique_edges(index.reshape(-1, 2), len(points))


def _unique_edges(edges: Ints, count: int) -> Ints:
    """Return edges, (n, 2) indices of `count` vertices, each once, those of no length left out."""
    low, high = edges.min(axis=1), edges.max(axis=1)
    packed = np.unique((low * count + high)[low != high])
    return np.column_stack([packed // count, packed % count])


def _weld(points: Ints, edges: Ints, limits: Ints, seams: Ints, near: int) -> tuple[Ints, Ints]:
    """Merge vertices that are next to each other on the lattice; return vertices and edges."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    points = points[order]
    roots = kernels.weld(points, limits, seams, near)
    edges = roots[rank[edges]]
    used = np.zeros(len(points), bool)
    used[edges] = True
    index = np.cumsum(used) - 1
    return points[used], _unique_edges(index[edges], int(used.sum()))


def delaunay(
    points: NDArray[np.float64], edges: Ints, within: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """Return the constrained Delaunay triangulation of the convex hull; crossings become vertices.

    If `within`, edges must not cross, and the triangles lie within loops of edges: on one side of
    each edge. Then no vertex is added.

    Returns:
        The arrays of a Triangulation, the points not rounded to the lattice.
    """
    import pythoncdt

    crossing = pythoncdt.IntersectingConstraintEdges
    resolve = crossing.NOT_ALLOWED if within else crossing.TRY_RESOLVE
    # the stubs of pythoncdt know buffers from Python 3.12 on only
    vertex_buffer: Any = np.ascontiguousarray(points)
    for attempt in range(_ATTEMPTS):
        near = 0.0 if within else _NEAR * 2**attempt
        cdt = pythoncdt.Triangulation(pythoncdt.VertexInsertionOrder.AUTO, resolve, near)
        cdt.insert_vertices(vertex_buffer)
        order = np.random.default_rng(attempt).permutation(edges) if attempt else edges
        edge_buffer: Any = order.astype(np.uint32)
        try:
            cdt.insert_edges(edge_buffer)
            break
        except RuntimeError:  # edges at tiny angles: hardly any room beside a crossing
            if within or attempt == _ATTEMPTS - 1:
                raise
    outer = 0 if within else 3  # corners of the triangle around all, which are the first vertices
    if within:
        cdt.erase_outer_triangles_and_holes()
    vertices, found = cdt.vertices_array()[outer:], cdt.triangles_array()
    # the library's own way to erase what has an outer corner looks all edges up
    kept: NDArray[np.bool_] = np.asarray((found["vertices"] >= outer).all(axis=1))
    triangles, neighbours = found["vertices"][kept], found["neighbors"][kept]
    index = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1).astype(np.int32)
    neighbours[neighbours == _NONE] = len(kept)
    return (
        np.column_stack([vertices["x"], vertices["y"]]),
        (triangles - np.uint32(outer)).astype(np.int32),
        index[neighbours],
    )


def _borders(triangles: NDArray[np.int32], neighbours: NDArray[np.int32], keys: Ints) -> Ints:
    """Return the edges between triangles with different keys, and of the hull, (n, 2)."""
    beyond = np.where(neighbours < 0, keys[:, None] ^ 1, keys[neighbours])
    border = keys[:, None] != beyond
    border &= (neighbours < 0) | (np.arange(len(triangles))[:, None] < neighbours)
    t, c = np.nonzero(border)
    return np.column_stack([triangles[t, c], triangles[t, (c + 1) % 3]]).astype(np.int64)


def _bend(edges: Ints, thin: Ints, count: int) -> Ints:
    """Lead edges through vertices next to them, so that no edge is a side of a thin triangle.

    Args:
        edges: (n, 2) indices of vertices.
        thin: (k, 3) both ends of the longest side of each thin triangle, and its other corner.
        count: number of vertices.
    """
    a, b, c = thin.T
    keys = edges.min(axis=1) * count + edges.max(axis=1)
    long = np.minimum(a, b) * count + np.maximum(a, b)
    bent = np.isin(keys, long)
    halves = np.isin(long, keys)
    a, b, c = a[halves], b[halves], c[halves]
    return np.concatenate([edges[~bent], np.column_stack([a, c]), np.column_stack([c, b])])
