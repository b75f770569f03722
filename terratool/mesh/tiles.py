"""Meshes of terrains too large for one: tiles that fit each other to the last bit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import curve_pieces
from terratool.field.records import COMBINE
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh.build import build_part
from terratool.mesh.plan import PlanOmissions, plan_of
from terratool.mesh.seams import Seam, boundary_of, cut_segments, lay_seams
from terratool.mesh.types import BuiltMesh, MeshPlan

TILE_FACES = 1_000_000
"""Faces of a tile, about, if not said."""
_PER_SEGMENT = 3.5
_PER_EDGE = 5.0
_PER_BEND = 4.0
_PER_TWIST = 0.6
"""Faces, about: for each segment, each edge of a rut, and where elements are bent or twisted
(`faces_of`)."""


class TileLayout(NamedTuple):
    """How a terrain is cut.

    Attributes:
        plan: of the whole.
        left: what it leaves out.
        columns: the seams between columns of tiles, from west to east.
        rows: the seams between rows of tiles, from south to north.
    """

    plan: MeshPlan
    left: PlanOmissions
    columns: list[Seam]
    rows: list[Seam]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns."""
        return len(self.rows) + 1, len(self.columns) + 1

    def limits(self, row: int, column: int) -> tuple[list[int], list[Seam | None]]:
        """West, south, east and north of a tile on the lattice, and the seams there."""
        up = len(self.rows) - row  # rows count from the north
        columns: list[Seam | None] = [None, *self.columns, None]
        rows: list[Seam | None] = [None, *self.rows, None]
        sides = [columns[column], rows[up], columns[column + 1], rows[up + 1]]
        whole = self.plan.bounds.astype(np.int64).tolist()
        return [
            own if seam is None else seam.at for own, seam in zip(whole, sides, strict=True)
        ], sides

    def bounds(self, row: int, column: int) -> NDArray[np.float64]:
        """West, south, east and north of a tile, in the world."""
        limits, _ = self.limits(row, column)
        return np.asarray(np.tile(self.plan.origin, 2) + np.array(limits) * self.plan.pitch)


def lay_out(
    terrain: Terrain,
    max_error: float,
    bounds: tuple[float, float, float, float] | None = None,
    least: float = 0.0,
    *,
    tile_faces: int = TILE_FACES,
    rows: int | None = None,
    columns: int | None = None,
) -> TileLayout:
    """Cut a terrain into tiles.

    Args:
        terrain: the terrain.
        max_error: the largest distance, along z, of the mesh from the terrain, in its units.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        least: elements that change heights by no more are left out, unless it is 0.
        tile_faces: how many faces a tile should have, about; it may be several times as many
            where the terrain is bent or crowded.
        rows: how many rows of tiles there are, instead.
        columns: how many columns.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
        RequestError: edges are too near to each other for a seam between them.
    """
    plan, left = plan_of(terrain, max_error, bounds, least)
    if rows is None or columns is None:
        count = faces_of(plan) / tile_faces
        wide, tall = plan.bounds[2:] - plan.bounds[:2]
        if columns is None:
            columns = math.ceil(count / rows if rows else math.sqrt(count * wide / tall))
        columns = max(columns, 1)
        rows = max(math.ceil(count / columns), 1) if rows is None else rows
    return TileLayout(plan, left, *lay_seams(plan, columns, rows))


def faces_of(plan: MeshPlan) -> float:
    """How many faces the mesh of a plan has, about.

    A curve needs ∫ √(|f''| / 8E) dt chords, a triangle for each two of both directions; a product
    of two straight curves that change by Δx and Δy is a saddle, and needs some ΔxΔy / E. Where the
    tangent of a curve is vertical there are more.
    """
    arrays = plan.arrays
    drawn = np.flatnonzero(plan.frames["drawn"])
    per_kind = np.zeros(len(arrays.kinds))
    for k, kind in enumerate(arrays.kinds):
        pieces = [curve_pieces(arrays, kind, axis)[1] for axis in "xy"]
        bends = [np.sqrt(np.abs(p[:, 2] * 2 + p[:, 3] * 3) / 8).sum() for p in pieces]
        changes = [np.abs(p[:, 1:].sum(axis=1)).sum() for p in pieces]
        per_kind[k] = _PER_BEND * max(bends) ** 2
        if kind["combine"] == COMBINE["product"]:
            per_kind[k] += _PER_TWIST * changes[0] * changes[1]
    elements = arrays.elements[drawn]
    curved = (per_kind[elements["kind"]] * np.abs(elements["scale"])).sum() / plan.error
    count = kernels.count_segments(plan.kept, drawn)
    ruts = _PER_EDGE * len(plan.outlines.edges)
    return float(_PER_SEGMENT * count + curved + ruts)


def build_tile(terrain: Terrain, layout: TileLayout, row: int, column: int) -> BuiltMesh:
    """Mesh a tile: what it shares with others is the same in all of them to the last bit.

    Its vertices are relative to the origin of the whole; what it says is left out is that of the
    whole.
    """
    limits, seams = layout.limits(row, column)
    whole, frames = layout.plan, layout.plan.frames
    west, south, east, north = limits
    near = (
        (frames["drawn"] != 0)
        & (frames["west"] <= east)
        & (frames["east"] >= west)
        & (frames["south"] <= north)
        & (frames["north"] >= south)
    )
    drawn = cut_segments(kernels.segments_of(whole.kept, np.flatnonzero(near)), limits, seams)
    rim = boundary_of(limits, *seams)
    return build_part(terrain, whole, layout.left, drawn, rim, np.array(limits))


def build_tiles(terrain: Terrain, layout: TileLayout) -> Iterator[tuple[int, int, BuiltMesh]]:
    """Row, column and mesh of each tile, row by row from the north-west, one at a time."""
    rows, columns = layout.shape
    for row in range(rows):
        for column in range(columns):
            yield row, column, build_tile(terrain, layout, row, column)
