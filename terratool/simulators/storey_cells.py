"""Tops of the ground and of each sheet of storeys in cells, and what is over them."""

from __future__ import annotations

import contextlib
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew
from terratool.field.terrain import Terrain
from terratool.io.geotiff import TILE
from terratool.raster.grid import Grid, Window, window_name
from terratool.tasks import Work
from terratool.traversability.layers import sheet_of_elements, sheeted_columns, sheets_of


class SheetTops(NamedTuple):
    """Tops at points by their sheets, (sheets, …) each, those of the ground first.

    Where the ground has none, that of the first sheet that has one stands there.

    Attributes:
        top: float64; NaN where there is none.
        ceiling: float64, bottom of what is over the top; NaN for nothing.
        slope_x, slope_y: float64 slopes of the top.
        surface: int32, index of the surface and one, 0 for none.
    """

    top: NDArray[np.float64]
    ceiling: NDArray[np.float64]
    slope_x: NDArray[np.float64]
    slope_y: NDArray[np.float64]
    surface: NDArray[np.int32]

    @classmethod
    def empty(cls, shape: tuple[int, ...]) -> SheetTops:
        """No tops anywhere."""
        top, ceiling, slope_x, slope_y = np.full((4, *shape), np.nan)
        return cls(top, ceiling, slope_x, slope_y, np.zeros(shape, np.int32))


def sheet_tops(terrain: Terrain, x: NDArray[np.float64], y: NDArray[np.float64]) -> SheetTops:
    """Find the tops of all sheets at points, (n,) each, of a terrain with storeys."""
    rows, _, sheets = sheeted_columns(terrain, x, y, sheet_of_elements(terrain))
    point, place = np.nonzero(sheets >= 0)
    size, at = (sheets_of(terrain), len(x)), (sheets[point, place], point)
    over = np.full((len(x), rows.top.shape[1] + 1), np.nan)
    over[:, :-1] = rows.bottom
    found = SheetTops.empty(size)
    for values, each in (
        (found.top, rows.top), (found.ceiling, over[:, 1:]), (found.slope_x, rows.slope_x),
        (found.slope_y, rows.slope_y), (found.surface, rows.surface + 1),
    ):  # fmt: skip
        values[at] = each[point, place]
    first = np.argmax(~np.isnan(found.top), axis=0)
    for values in found:
        values[0] = values[first, np.arange(len(x))]
    return found


def middles_near(
    terrain: Terrain, grid: Grid, window: Window
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Which cells of a window may have storeys at their middles, (height, width); these places."""
    assert terrain.storeys is not None
    x, y = np.meshgrid(grid.columns(window), grid.rows(window))
    near = terrain.storeys.near(x.ravel(), y.ravel()).reshape(x.shape)
    return near, x[near], y[near]


class _RangeFinder:
    """Finder of the least and the largest height of the tops of sheets in windows of cells."""

    def __init__(self, terrain: Terrain, grid: Grid) -> None:
        self._terrain, self._grid = terrain, grid

    def find(self, window: Window) -> NDArray[np.float64]:
        """Return the ends of the ranges of all sheets, (2, sheets), infinite for none."""
        _, x, y = middles_near(self._terrain, self._grid, window)
        top = sheet_tops(self._terrain, x, y).top
        low = np.fmin.reduce(top, axis=1, initial=math.inf)
        return np.stack([low, np.fmax.reduce(top, axis=1, initial=-math.inf)])


def height_ranges(terrain: Terrain, grid: Grid, crew: Crew) -> list[list[float] | None]:
    """Least and largest height of the tops at the middles of cells, of each sheet of storeys.

    They are None where no middle has a top.
    """
    work = Work(_RangeFinder.find, _RangeFinder(terrain, grid), name=window_name)
    ends: Any = np.full((2, sheets_of(terrain)), math.inf) * [[1.0], [-1.0]]
    with contextlib.closing(crew.run(work, grid.windows(TILE, TILE))) as found:
        for low, high in found:
            ends = np.minimum(ends[0], low), np.maximum(ends[1], high)
    return [
        [float(low), float(high)] if low <= high else None
        for low, high in zip(*ends, strict=True)
    ][1:]  # fmt: skip
