"""The ground of a page as a grid of heights, where a mesh would take too long to build."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.summary import spread_points
from terratool.field.terrain import Terrain
from terratool.mesh.elevation import grid_misses
from terratool.mesh.types import BuiltMesh, Mesh, PlanLoss
from terratool.report.wording import count_of

_POINTS = 100_000
"""Number of points at which a grid is compared with the terrain."""


class GroundGrid(NamedTuple):
    """A grid of heights as a mesh.

    Attributes:
        built: the mesh, without walls and surfaces, with its measured error.
        shape: number of rows and of columns of nodes.
        step: distance between neighbouring nodes along the coarser axis, world units.
    """

    built: BuiltMesh
    shape: tuple[int, int]
    step: float


def ground_grid(terrain: Terrain, faces: int) -> GroundGrid:
    """Build a grid of at most `faces` faces over a whole terrain.

    A square of four nodes has two faces, or none where a node is void. Walls become ramps as wide
    as a step.

    Raises:
        RequestError: there is ground, but no square has ground at all four nodes.
    """
    west, south, east, north = terrain.bounds
    wide, tall = east - west, north - south
    squares = max(faces // 2, 1)
    columns = min(max(round(math.sqrt(squares * wide / tall)), 1), squares)
    rows = max(squares // columns, 1)
    x, y = np.linspace(west, east, columns + 1), np.linspace(south, north, rows + 1)
    heights = terrain.height(*np.meshgrid(x, y))
    known = np.isfinite(heights)
    index = np.arange(heights.size, dtype=np.int32).reshape(heights.shape)
    corners = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, 1:] & known[1:, :-1]
    if known.any() and not whole.any():
        raise RequestError(
            f"In a grid of {count_of(faces, 'face')} no square has ground at all four corners.",
            "Allow more with --max-faces.",
        )
    sw, se, ne, nw = (corner[whole] for corner in corners)
    made = np.concatenate([np.stack([sw, se, ne], axis=-1), np.stack([sw, ne, nw], axis=-1)])
    local = np.meshgrid(x - west, y - south)
    vertices = np.column_stack([local[0].ravel(), local[1].ravel(), heights.ravel()])
    used = np.unique(made)
    number = np.zeros(heights.size, np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    made = number[made]
    mesh = Mesh(
        vertices=vertices[used],
        faces=made,
        surfaces=np.full(len(made), -1, np.int32),
        walls=np.zeros(len(made), np.bool_),
        origin=np.array([west, south, 0.0]),
        names=(),
        colors=np.empty((0, 3), np.uint8),
        frictions=np.empty(0),
    )
    spacing = wide / columns, tall / rows
    error = _miss(terrain, heights, spacing)
    return GroundGrid(
        BuiltMesh(mesh, len(made), error, PlanLoss()), (rows + 1, columns + 1), max(spacing)
    )


def _miss(terrain: Terrain, heights: NDArray[np.float64], spacing: tuple[float, float]) -> float:
    """Largest measured distance of a grid from the terrain, along z, at `_POINTS` points."""
    west, south, _, _ = terrain.bounds
    x, y = spread_points(terrain.bounds, _POINTS)
    off = grid_misses(heights, (x - west, y - south), spacing, terrain.height(x, y))
    off = off[np.isfinite(off)]
    return float(off.max()) if len(off) else 0.0
