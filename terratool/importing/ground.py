"""Ground among points, told from trees, cars and buildings by a morphological filter.

SMRF: Pingel, Clarke and McBride, An improved simple morphological filter for the terrain
classification of airborne LIDAR data, ISPRS Journal of Photogrammetry and Remote Sensing 77, 2013.
It opens the lowest heights of cells by ever larger windows, as Zhang and others do (2003), and what
an opening takes off by more than a slope allows is no ground. Windows are square here, and the
heights are those above the plane that fits all cells best, so that hillsides are kept at borders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrain.request import fill_gaps
from terratool.importing.types import PixelGrid

Floats = NDArray[np.float64]

CELL = 1.0
"""Least side of the filter's cells, m."""
WINDOW = 18.0
"""Radius of the largest window, m: what is more than twice as wide passes for ground."""
SLOPE = 0.15
"""Steepest slope of the ground against the plane, over the radius of a window."""
THRESHOLD = 0.5
"""Largest height of ground above or below the filtered surface where that is level, m."""
SCALE = 1.25
"""Height that a slope of 1 adds to the threshold, m."""
_PIT = 5.0
"""Slope below which a single low cell is an error of measurement."""


@dataclass(frozen=True, slots=True)
class FilteredGround:
    """Filtered surface, near which points are ground.

    Attributes:
        grid: cells of the filter.
        heights: (rows, columns) float64, heights of the surface at the centres of cells.
        reach: (rows, columns) float64, largest distance of ground from the surface.
    """

    grid: PixelGrid
    heights: Floats
    reach: Floats

    def holds(self, x: Floats, y: Floats, z: Floats) -> NDArray[np.bool_]:
        """Tell which points, (n,) each, are ground."""
        rows, columns = self.heights.shape
        u = np.clip((x - self.grid.west) / self.grid.dx - 0.5, 0.0, columns - 1.0)
        v = np.clip((y - self.grid.south) / self.grid.dy - 0.5, 0.0, rows - 1.0)
        column = np.minimum(u.astype(np.int64), max(columns - 2, 0))
        row = np.minimum(v.astype(np.int64), max(rows - 2, 0))
        east, north = np.minimum(column + 1, columns - 1), np.minimum(row + 1, rows - 1)
        u, v = u - column, v - row
        low = (1.0 - u) * self.heights[row, column] + u * self.heights[row, east]
        high = (1.0 - u) * self.heights[north, column] + u * self.heights[north, east]
        near = self.reach[np.rint(row + v).astype(np.int64), np.rint(column + u).astype(np.int64)]
        found: NDArray[np.bool_] = np.abs(z - ((1.0 - v) * low + v * high)) <= near
        return found


def filter_ground(lowest: Floats, grid: PixelGrid, metre: float = 1.0) -> FilteredGround:
    """Filter the lowest heights of cells.

    Args:
        lowest: (rows, columns) float64, row 0 the southernmost, NaN where there is no point.
        grid: the cells, which are square.
        metre: length of a metre in units of the grid.
    """
    plane = _plane(lowest)
    surface = fill_gaps(lowest - plane)
    surface = np.where(np.isnan(surface), 0.0, surface)
    unknown = np.isnan(lowest) | (opened(-surface, 1) < -surface - _PIT * grid.dx)
    surface = np.nan_to_num(fill_gaps(np.where(unknown, np.nan, surface)))
    largest = min(math.ceil(WINDOW * metre / grid.dx), max(surface.shape))
    last = surface
    for radius in range(1, largest + 1):
        this = opened(last, radius)
        unknown |= last - this > SLOPE * radius * grid.dx
        last = this
    surface = np.nan_to_num(fill_gaps(np.where(unknown, np.nan, surface))) + plane
    steep = [
        np.gradient(surface, grid.dx, axis=axis)
        for axis in (0, 1) if surface.shape[axis] > 1
    ]  # fmt: skip
    slope = np.sqrt(sum((one**2 for one in steep), np.zeros(surface.shape)))
    return FilteredGround(grid, surface, (THRESHOLD + SCALE * slope) * metre)


def opened(heights: Floats, radius: int) -> Floats:
    """Open heights, (rows, columns), by a square of 2 × radius + 1 cells, cut at the borders."""
    for sign in (1.0, -1.0):
        heights = sign * heights
        for axis in (0, 1):
            heights = _least_around(heights, radius, axis)
        heights = sign * heights
    return heights


def _least_around(heights: Floats, radius: int, axis: int) -> Floats:
    """Least height within a radius along an axis, by windows that double in length."""
    heights = np.moveaxis(heights, axis, 0)
    count, width = len(heights), 2 * radius + 1
    pad = np.full((radius, *heights.shape[1:]), np.inf)
    found, length = np.concatenate([pad, heights, pad]), 1
    while 2 * length <= width:
        found = np.minimum(found[:-length], found[length:])
        length *= 2
    rest = width - length
    return np.moveaxis(np.minimum(found[:count], found[rest : rest + count]), 0, axis)


def _plane(heights: Floats) -> Floats:
    """Heights, (rows, columns), of the plane that fits the known ones best by least squares."""
    rows, columns = np.nonzero(~np.isnan(heights))
    known = heights[rows, columns]
    terms = np.stack([np.ones(len(known)), columns, rows], axis=1)
    (base, east, north), *_ = np.linalg.lstsq(terms, known, rcond=None)
    row, column = np.ogrid[: heights.shape[0], : heights.shape[1]]
    return np.asarray(base + east * column + north * row)
