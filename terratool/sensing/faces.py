"""Faces of a terrain in the cells of a map: the truth that heights of the map are held against."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.field.types import PointColumns
from terratool.raster.grid import Window
from terratool.sensing.lines import Face
from terratool.sensing.robot_map import MapLevel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GROUND, TOP, UNDERSIDE = 0, 1, 2
"""Kinds of faces: the top of what is solid from below, other tops, and undersides."""


class Truth(NamedTuple):
    """Faces of a terrain in the cells of a map, (storeys, height, width) each.

    Attributes:
        height: float64 heights, m; NaN where there is none.
        surface: int32 index of the surface, -1 for none.
        kind: int8 kind of the face, -1 for none.
        of: int64 index of the interval of the column that has the face, -1 for none.
        tops: (height, width, n) int32 surfaces of the tops that a cell has, -1 for none, and -2
            where there is no top.
    """

    height: Floats
    surface: NDArray[np.int32]
    kind: NDArray[np.int8]
    of: Ints
    tops: NDArray[np.int32]

    def known(self, patches: Sequence[MapLevel]) -> NDArray[np.int32]:
        """Surfaces of the tops that patches know, (tops,), by the top itself or its underside."""
        seen = np.zeros(self.tops.shape, np.bool_)
        for patch, of in zip(patches, np.broadcast_to(self.of, (len(patches), *self.of.shape[1:])),
                             strict=True):  # fmt: skip
            at = np.nonzero(np.isfinite(patch.elevation) & (of >= 0))
            seen[*at, of[at]] = True
        return self.tops[seen]


class _CellFaces(NamedTuple):
    """Faces of columns from below, (…, 2 n) each, a bottom before its top.

    Attributes:
        height: float64 m; NaN where there is none.
        surface: int32 index of the surface, -1 for none.
        kind: int8 kind of the face.
    """

    height: Floats
    surface: NDArray[np.int32]
    kind: NDArray[np.int8]


class CellPlaces(NamedTuple):
    """Places in the cells of a window of a level.

    Attributes:
        level: the level.
        window: the window; its row and column may be negative.
    """

    level: MapLevel
    window: Window

    def at(self, shares: Floats) -> tuple[Floats, Floats]:
        """World x, (1, width · n), and y, (height · n, 1), at shares of the sides of each cell."""
        window, grid = self.window, self.level.grid
        columns = window.column + np.arange(window.width)
        rows = window.row + np.arange(window.height)
        x = grid.west + (columns[:, None] + shares).ravel() * grid.resolution
        y = grid.bounds[3] - (rows[:, None] + shares).ravel() * grid.resolution
        return x[None, :], y[:, None]

    @property
    def parts(self) -> int:
        """Finest cells along a side of a cell."""
        return int(2**self.level.level)

    def middles(self) -> tuple[Floats, Floats]:
        """World x and y of the middles of cells."""
        return self.at(np.array([0.5]))

    def fine(self) -> tuple[Floats, Floats]:
        """World x and y of the middles of the finest cells."""
        return self.at((np.arange(self.parts) + 0.5) / self.parts)

    def blocks(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of finest cells, (rows, columns, …), as (height, width, finest cells, …)."""
        window, parts = self.window, self.parts
        blocks = values.reshape(window.height, parts, window.width, parts, *values.shape[2:])
        blocks = np.moveaxis(blocks, 2, 1)
        return blocks.reshape(window.height, window.width, parts * parts, *values.shape[2:])


def truth(
    face: Face, places: CellPlaces, patches: Sequence[MapLevel], gap: float, terrain: Terrain
) -> Truth:
    """Heights of a terrain that the heights of a map are held against.

    Args:
        face: what the heights of the map are of.
        places: cells of the window.
        patches: cells of the window, for each patch from below; heights are NaN beyond the map.
        gap: distance from a patch up to which a face is one of it, m, in coarse cells.
        terrain: the terrain.
    """
    if face == "nearest":
        return _nearest(places, patches, gap, terrain)
    if face == "top":
        middle = terrain.sample(*places.middles())
        height, surface = middle.height, middle.surface
        if places.parts > 1:
            height = _mean(places, terrain.height(*places.fine()))
    else:
        column = terrain.column(*places.middles())
        low = np.isneginf(column.bottom[..., 0])
        height = np.where(low, column.top[..., 0], np.nan)
        surface = np.where(low, column.surface[..., 0], -1).astype(np.int32)
        if places.parts > 1:
            height = _mean(places, terrain.ground(*places.fine()))
    kind = np.where(np.isfinite(height), GROUND, -1).astype(np.int8)
    tops = np.where(np.isfinite(height), surface, -2).astype(np.int32)[..., None]
    of = np.where(np.isfinite(height), 0, -1)
    return Truth(height[None], surface[None], kind[None], of[None], tops)


def _mean(places: CellPlaces, fine: Floats) -> Floats:
    """Mean of the heights of the finest cells that have some."""
    parts, window = places.parts, places.window
    blocks = fine.reshape(window.height, parts, window.width, parts)
    known = np.isfinite(blocks)
    counts = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    return np.where(counts, total / np.maximum(counts, 1), np.nan)


def _nearest(
    places: CellPlaces, patches: Sequence[MapLevel], gap: float, terrain: Terrain
) -> Truth:
    column = terrain.column(*places.middles())
    middle = _faces(column, terrain)
    fine = middle.height[:, :, None]
    if places.parts > 1:
        fine = places.blocks(_faces(terrain.column(*places.fine()), terrain).height)
    found = [_nearest_to(one, middle, fine, gap) for one in patches]
    height, surface, kind, of = (np.stack(part) for part in zip(*found, strict=True))
    tops = np.where(np.isfinite(column.top), column.surface, -2)
    return Truth(height, surface, kind, of, tops)


def _nearest_to(patch: MapLevel, middle: _CellFaces, fine: Floats, gap: float) -> tuple[
    Floats, NDArray[np.int32], NDArray[np.int8], Ints
]:  # fmt: skip
    """Height of the face nearest to a patch in each cell; surface, kind and interval at middles.

    Of two faces that are as near the lower one counts. In a coarse cell it is the mean of the tops
    at the middles of the finest ones, or that of the undersides there.
    """
    top = patch.elevation[..., None]
    low = top - np.nan_to_num(patch.depth)[..., None]
    off = np.abs(middle.height - top)
    at, known = _least(off)
    if fine.shape[2] == 1:
        height = _picked(fine[:, :, 0], at, known)
    else:
        sides = [
            _mean_nearest(fine[..., side::2], top[..., None], low[..., None], gap)
            for side in (0, 1)
        ]
        both = np.stack(sides, axis=-1)
        height = _picked(both, *_least(np.abs(both - top)))
    height = np.where(np.isfinite(patch.elevation), height, np.nan)
    some = known & np.isfinite(height)
    surface = np.where(some, _picked(middle.surface, at, some, -1), -1).astype(np.int32)
    kind = np.where(some, _picked(middle.kind, at, some, -1), -1).astype(np.int8)
    return height, surface, kind, np.where(some, at // 2, -1)


def _mean_nearest(fine: Floats, top: Floats, low: Floats, gap: float) -> Floats:
    """Mean height of the faces of the finest cells, (height, width, cells, n), near a patch.

    Those count that are no farther than the gap from the patch, and the nearest of each place;
    where there are none, the one that is nearest of all.
    """
    off = np.abs(fine - top)
    near = np.where(np.maximum(fine - top, low - fine) <= gap, off, np.nan)
    at, known = _least(near)
    counts = known.sum(axis=2)
    total = _picked(fine, at, known, 0.0).sum(axis=2)
    every = off.reshape(*off.shape[:2], -1)
    nearest = _picked(fine.reshape(every.shape), *_least(every))
    return np.where(counts, total / np.maximum(counts, 1), nearest)


def _least(off: Floats) -> tuple[Ints, NDArray[np.bool_]]:
    """Index of the least number along the last axis, and whether there is any."""
    return np.where(np.isnan(off), np.inf, off).argmin(axis=-1), np.any(np.isfinite(off), axis=-1)


def _picked(
    values: NDArray[Any], at: Ints, known: NDArray[np.bool_], empty: float = np.nan
) -> NDArray[Any]:
    """Values at indices along the last axis, where they are known."""
    return np.where(known, np.take_along_axis(values, at[..., None], axis=-1)[..., 0], empty)


def _faces(column: PointColumns, terrain: Terrain) -> _CellFaces:
    shape = *column.top.shape[:-1], 2 * column.top.shape[-1]

    def woven(bottom: NDArray[Any], top: NDArray[Any]) -> NDArray[Any]:
        return np.stack([bottom, top], axis=-1).reshape(shape)

    low = np.isneginf(column.bottom)
    return _CellFaces(
        woven(np.where(low, np.nan, column.bottom), column.top),
        woven(_surface_below(column, terrain), column.surface),
        woven(np.full(low.shape, UNDERSIDE, np.int8), np.where(low, GROUND, TOP).astype(np.int8)),
    )


def _surface_below(column: PointColumns, terrain: Terrain) -> NDArray[np.int32]:
    """Index of the surface of each bottom, -1 for none: that of the storey's own element."""
    out = np.full(column.under.shape, -1, np.int32)
    if terrain.storeys is not None:
        table = terrain.storeys.table
        order = np.argsort(table.numbers)
        at = np.searchsorted(table.numbers[order], column.under)
        at = order[np.minimum(at, len(order) - 1)]
        own = table.numbers[at] == column.under
        out[own] = table.surface[at][own]
    return out
