"""Several meshes of one plane as one triangulation, in which each triangle is in one of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.mesh.seams import NO_SEAMS
from terratool.mesh.triangulate import triangulate
from terratool.mesh.types import Triangulation

_BESIDE = -2.0
"""Least distance of a point from the sides of its triangle, in points of the lattice: vertices
move by about one when they are welded."""
_FEWEST = 2
"""Fewest ends of a chord."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class MeshLayer:
    """Triangles of one mesh of the plane that count, with a height at each corner.

    Attributes:
        triangles: (m, 3) int32 indices of vertices of the triangles that count.
        heights: (m, 3) float64 heights at the corners.
        surfaces: (m,) int32 index of the surface; -1 for none.
        edges: (n, 4) int64 x, y, x, y of their sides on the lattice.
    """

    def __init__(
        self, plane: Triangulation, counts: Bools, heights: Floats, surfaces: NDArray[np.int32]
    ) -> None:
        points, triangles, neighbours = plane
        t, c = np.nonzero(counts[:, None] & ((neighbours < 0) | ~counts[neighbours]
                          | (np.arange(len(triangles))[:, None] < neighbours)))  # fmt: skip
        ends = triangles[t, c], triangles[t, (c + 1) % 3]
        self.edges = np.hstack([points[ends[0]], points[ends[1]]])
        self.triangles = triangles[counts]
        self.heights, self.surfaces = heights[counts], surfaces[counts]
        self._corners = points[self.triangles]
        sides = (np.roll(self._corners, -1, axis=1) - self._corners).astype(np.float64)
        self._sides = sides / np.hypot(sides[..., :1], sides[..., 1:])
        low, high = self._corners.min(axis=1), self._corners.max(axis=1)
        none = np.full((1, 2), -1)
        self._low = np.min(low if len(low) else none, axis=0)
        self._high = np.max(high if len(high) else none, axis=0)
        self._tree = shapely.STRtree(shapely.box(*(low - 1.0).T, *(high + 1.0).T))

    def find(self, points: Floats, geometries: NDArray[Any]) -> NDArray[np.int32]:
        """Index of the triangle that each point is in, (n,); -1 beside all.

        Args:
            points: (n, 2) places on the lattice.
            geometries: (n,) the same as points of shapely.
        """
        found = np.full(len(points), -1, np.int32)
        if not len(self.triangles):
            return found
        near = np.flatnonzero(
            (points >= self._low).all(axis=1) & (points <= self._high).all(axis=1)
        )
        point, triangle = self._tree.query(geometries[near])
        point = near[point]
        p = points[point]
        least = np.full(len(point), np.inf)
        for k in range(3):
            begin = self._corners[triangle, k]
            along = self._sides[triangle, k]
            to = p - begin
            np.minimum(least, along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0], out=least)
        inside = least > 0.0
        found[point[inside]] = triangle[inside]
        # the others are on sides, or beside all by the rounding of vertices: the deepest one counts
        rest = np.flatnonzero((least >= _BESIDE) & ~inside)
        rest = rest[found[point[rest]] < 0]
        rest = rest[np.argsort(least[rest], kind="stable")]
        found[point[rest]] = triangle[rest]
        return found

    def heights_at(self, which: NDArray[np.integer], points: NDArray[Any]) -> Floats:
        """Heights of triangles at points in or close to them, (n, k); NaN for -1.

        Args:
            which: (n,) indices of triangles.
            points: (n, k, 2) points on the lattice.
        """
        out = np.full(points.shape[:2], np.nan)
        some = which >= 0
        corners, z = self._corners[which[some]], self.heights[which[some]]
        p = points[some]
        weights = np.empty((*p.shape[:2], 3))
        for k in range(3):
            u = corners[:, None, (k + 1) % 3] - p
            v = corners[:, None, (k + 2) % 3] - p
            weights[..., k] = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
        # a point beside takes the height of the nearest place, so that no steep face runs away
        np.maximum(weights, 0.0, out=weights)
        weights /= weights.sum(axis=2, keepdims=True)
        low, high = z.min(axis=1)[:, None], z.max(axis=1)[:, None]
        own = np.clip((weights * z[:, None]).sum(axis=2), low, high)
        flat = low == high
        out[some] = np.where(flat, low, own)
        return out


class Overlay(NamedTuple):
    """A triangulation along the sides of all triangles of some layers.

    Attributes:
        plane: the triangulation.
        found: (m, layers) int32 triangle of each layer that each is in; -1 for none.
    """

    plane: Triangulation
    found: NDArray[np.int32]

    @property
    def corners(self) -> Ints:
        """Corners of the triangles on the lattice, (m, 3, 2)."""
        return self.plane.points[self.plane.triangles]

    @classmethod
    def of(
        cls,
        layers: list[MeshLayer],
        bounds: Ints,
        segments: Ints | None = None,
        more_of: Callable[[Floats, NDArray[np.int32]], NDArray[np.int32]] | None = None,
    ) -> Overlay:
        """Overlay of layers in a rectangle, along their sides or other segments.

        Args:
            layers: the layers.
            bounds: west, south, east, north on the lattice.
            segments: (n, 4) int64 x, y, x, y on the lattice; the sides if None.
            more_of: function of the middles of triangles and of their places in the layers, whose
                rows differ where an edge is needed between two triangles of one place.
        """
        if segments is None:
            segments = np.concatenate([layer.edges for layer in layers])
        places: list[NDArray[np.int32]] = []

        def keys_of(points: Ints, triangles: NDArray[np.int32]) -> Ints:
            middles = points[triangles].mean(axis=1)
            geometries = shapely.points(middles)
            places[:] = [layer.find(middles, geometries) for layer in layers]
            found = np.column_stack(places)
            return hash_rows(
                found if more_of is None else np.hstack([found, more_of(middles, found)])
            )

        plane, _ = triangulate(segments, bounds, keys_of, NO_SEAMS)
        return cls(plane, np.column_stack(places))

    def borders(self) -> tuple[Ints, Ints]:
        """Sides that triangles of different places share, or of the hull: triangle, and corner."""
        t, c = self.plane.sides()
        beyond = self.plane.neighbours[t, c]
        differ = (beyond < 0) | (self.found[t] != self.found[beyond]).any(axis=1)
        return t[differ], c[differ]


def hash_rows(rows: NDArray[np.integer]) -> Ints:
    """One number for each row, (n,): equal for equal rows, and hardly ever for others."""
    key = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        key = (key ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(32)
    return key.view(np.int64)


class Cuts(NamedTuple):
    """Where surfaces over triangles cross each other.

    Attributes:
        edge: (n,) index of the side on which each crossing lies.
        at: (n, 2) int64 place of each crossing on the lattice.
        chords: (k, 4) int64 x, y, x, y of the lines within triangles.
    """

    edge: Ints
    at: Ints
    chords: Ints


def sides_of(triangles: NDArray[np.int32], count: int) -> tuple[Ints, Ints]:
    """Sides of triangles, each once: (k, 2) low and high vertex, and (m, 3) each one's three."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).astype(np.int64)
    low, high = ends.min(axis=2), ends.max(axis=2)
    sides, own = np.unique((low * count + high).ravel(), return_inverse=True)
    return np.column_stack([sides // count, sides % count]), own.reshape(-1, 3)


def cuts_of(
    plane: Triangulation, sides: Ints, own: Ints, which: Ints, z: Floats, tolerance: float
) -> Cuts:
    """Lines along which surfaces over triangles cross.

    Args:
        plane: the triangles.
        sides: (k, 2) vertices of their sides.
        own: (m, 3) sides of each triangle.
        which: (n,) triangles to look at.
        z: (n, e, 3) heights of surfaces at their corners; NaN where there is none.
        tolerance: largest difference of heights that count as one.
    """
    edges, ats, chords = [np.empty(0, np.int64)], [np.empty((0, 2), np.int64)], []
    for i in range(z.shape[1]):
        for j in range(i):
            off = z[:, i] - z[:, j]
            sign = np.where(np.abs(off) <= tolerance, 0, np.sign(off))
            sign = np.where(np.isnan(sign), 0, sign)
            mixed = (sign.min(axis=1) < 0) & (sign.max(axis=1) > 0)
            t, d, s = which[mixed], off[mixed], sign[mixed]
            crossed = s * np.roll(s, -1, axis=1) < 0  # the side from a corner to the next
            row, c = np.nonzero(crossed)
            at = crossings(plane.points, sides, own[t[row], c], plane.triangles[t[row], c],
                           d[row, c], d[row, (c + 1) % 3])  # fmt: skip
            edges.append(own[t[row], c])
            ats.append(at)
            through = np.argwhere(s == 0)  # corners that the line begins at
            rows = np.concatenate([row, through[:, 0]])
            places = np.concatenate([at, plane.points[plane.triangles[t[through[:, 0]],
                                                                      through[:, 1]]]])  # fmt: skip
            order = np.argsort(rows, kind="stable")
            rows, places = rows[order], places[order]
            two = np.flatnonzero(rows[1:] == rows[:-1])
            chords.append(np.hstack([places[two], places[two + 1]]))
    return Cuts(
        np.concatenate(edges), np.concatenate(ats),
        np.concatenate(chords) if chords else np.empty((0, 4), np.int64),
    )  # fmt: skip


def crossings(
    points: Ints, sides: Ints, side: Ints, begins: NDArray[np.int32], here: Floats, there: Floats
) -> Ints:
    """Places on sides where differences of heights are 0, (n, 2), on the lattice.

    Args:
        points: (p, 2) vertices on the lattice.
        sides: (k, 2) vertices of all sides.
        side: (n,) sides.
        begins: (n,) vertex of each at which the difference is `here`.
        here: (n,) difference at one end.
        there: (n,) difference at the other end, of another sign.
    """
    low, high = sides[side].T
    swapped = begins != low
    d0, d1 = np.where(swapped, there, here), np.where(swapped, here, there)
    share = (d0 / (d0 - d1))[:, None]
    return np.asarray(np.rint(points[low] + share * (points[high] - points[low])).astype(np.int64))


def split(points: Ints, sides: Ints, kept: Ints, cuts: Cuts) -> Ints:
    """Sides as segments that end where surfaces cross, and the chords, (n, 4).

    Args:
        points: (p, 2) vertices on the lattice.
        sides: (k, 2) vertices of all sides.
        kept: indices of the sides that are wanted, in any case those that are crossed.
        cuts: where surfaces cross.
    """
    kept = np.union1d(kept, cuts.edge)
    ends = points[sides[kept]]
    edge = np.concatenate([kept, kept, cuts.edge])
    at = np.concatenate([ends[:, 0], ends[:, 1], cuts.at])
    begin = points[sides[edge, 0]]
    along = np.abs(at - begin).sum(axis=1)
    order = np.lexsort([along, edge])
    edge, at = edge[order], at[order]
    same = np.flatnonzero(edge[1:] == edge[:-1])
    return np.concatenate([np.hstack([at[same], at[same + 1]]), cuts.chords])
