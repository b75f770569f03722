"""Meshes of large terrains in less memory: tiles that are built by themselves, and joined."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from terratool.field.terrain import Terrain
from terratool.mesh.export import collapse_degenerate
from terratool.mesh.tiles import TileCount, TileLayout, build_tile, faces_of, lay_out
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.tasks import prefetch, processors

_TILE = 80_000
"""Number of faces of a tile, about."""
_BITS = 8
"""Halvings of a tile along each axis by the curve that its faces are sorted along."""


def build_joined(terrain: Terrain, max_error: float) -> BuiltMesh:
    """Mesh a terrain without storeys by tiles, and join these where they meet.

    The mesh is as near to the terrain as that of `build`, and has further edges between tiles.
    Faces that follow each other are near each other, and so are their vertices.

    Args:
        terrain: terrain to mesh, with all parts written out.
        max_error: largest distance, along z, of the mesh from the terrain, in units of the terrain.

    Raises:
        RequestError: edges are too near to each other for a tile to end between them.
    """
    layout = lay_out(terrain, max_error, TileCount(_TILE))
    rows, columns = layout.shape

    def build(place: tuple[int, int]) -> BuiltMesh:
        built = collapse_degenerate(build_tile(terrain, layout, *place))
        return replace(built, mesh=_in_order(built.mesh)) if len(built.mesh.faces) else built

    room = int(faces_of(layout.plan))
    vertices = _GrowingArray(room // 2, (3,), np.float64)
    faces = _GrowingArray(room, (3,), np.int32)
    surfaces, walls = _GrowingArray(room, (), np.int32), _GrowingArray(room, (), np.bool_)
    known: dict[bytes, int] = {}  # vertices on the sides of tiles
    error = 0.0
    for built in prefetch(build, product(range(rows), range(columns)), processors()):
        mesh = built.mesh
        error = max(error, built.error)
        shared = np.flatnonzero(_is_on_seam(layout, mesh))
        keys = [vertex.tobytes() for vertex in mesh.vertices[shared]]
        is_new = np.ones(len(mesh.vertices), bool)
        is_new[shared] = [key not in known for key in keys]
        index = np.cumsum(is_new, dtype=np.int32) + np.int32(vertices.count - 1)
        for key, at in zip(keys, index[shared].tolist(), strict=True):
            known.setdefault(key, at)
        index[shared] = [known[key] for key in keys]
        vertices.append(mesh.vertices[is_new])
        faces.append(index[mesh.faces])
        surfaces.append(mesh.surfaces)
        walls.append(mesh.walls)
    joined = replace(
        mesh, vertices=vertices.rows, faces=faces.rows, surfaces=surfaces.rows, walls=walls.rows
    )
    return replace(built, mesh=joined, shell=faces.count, error=error)


class _GrowingArray:
    """Array that grows by rows; room that is not used yet takes no memory."""

    def __init__(self, room: int, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self._array = np.empty((room, *shape), dtype)
        self.count = 0

    def append(self, more: NDArray[Any]) -> None:
        """Append rows."""
        end = self.count + len(more)
        if end > len(self._array):
            grown = np.empty((2 * end, *self._array.shape[1:]), self._array.dtype)
            grown[: self.count] = self.rows
            self._array = grown
        self._array[self.count : end] = more
        self.count = end

    @property
    def rows(self) -> NDArray[Any]:
        """Rows so far."""
        return self._array[: self.count]


def _is_on_seam(layout: TileLayout, mesh: Mesh) -> NDArray[np.bool_]:
    """Return whether vertices of a tile lie where it may meet another one, (n,)."""
    pitch = layout.plan.pitch
    x, y, _ = mesh.vertices.T
    found: NDArray[np.bool_] = np.isin(x, [seam.at * pitch for seam in layout.columns])
    return found | np.isin(y, [seam.at * pitch for seam in layout.rows])


def _in_order(mesh: Mesh) -> Mesh:
    """Return a mesh with faces in the order of a curve, and vertices in that of faces.

    A .usdc holds by how much a number differs from the one before, so it is shorter, and sooner
    written, where these are near each other.
    """
    along = _hilbert(mesh.vertices[:, :2])
    order = np.argsort(along[mesh.faces[:, 0]], kind="stable")
    faces = mesh.faces[order]
    corners = faces.ravel()
    first = np.full(len(mesh.vertices), len(corners), np.int32)
    first[corners[::-1]] = np.arange(len(corners) - 1, -1, -1, dtype=np.int32)
    by_first = np.argsort(first)
    rank = np.empty(len(first), np.int32)
    rank[by_first] = np.arange(len(first), dtype=np.int32)
    return replace(
        mesh,
        vertices=mesh.vertices[by_first],
        faces=rank[faces],
        surfaces=mesh.surfaces[order],
        walls=mesh.walls[order],
    )


def _hilbert(points: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return places of points, (n, 2), along Hilbert's curve over their bounds, (n,)."""
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = ((points - low) * ((2**_BITS - 1) / (high - low))).astype(np.int32).T
    along = np.zeros(len(points), np.int32)
    for bit in range(_BITS - 1, -1, -1):
        side = 1 << bit
        east, north = (x & side) > 0, (y & side) > 0
        along += side * side * ((3 * east) ^ north)
        x, y = x & (side - 1), y & (side - 1)
        turned = east & ~north
        x, y = np.where(turned, side - 1 - x, x), np.where(turned, side - 1 - y, y)
        x, y = np.where(north, x, y), np.where(north, y, x)
    return along.astype(np.uint16)  # which sort fastest
