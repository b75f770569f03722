"""Grids of pixels over a terrain, and windows into them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.bounds import finest_details
from terratool.field.terrain import Terrain, check_bounds

DEFAULT_PIXELS = 4096
"""The longer side of a raster has at most this many pixels, if no resolution is given."""

PIXELS_PER_CELL = 10
MAX_SIDE = 2**31 - 1
_WHOLE = 1e-6
"""A quotient this near to a whole number of pixels is one."""


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of pixels: first row and column from the north-west, height and width."""

    row: int
    column: int
    height: int
    width: int

    def cut(self, height: int, width: int) -> Iterator[Window]:
        """Windows of at most this size that cover it, row by row from the north-west."""
        for row in range(0, self.height, height):
            for column in range(0, self.width, width):
                yield Window(
                    self.row + row,
                    self.column + column,
                    min(height, self.height - row),
                    min(width, self.width - column),
                )


@dataclass(frozen=True, slots=True)
class Grid:
    """Square pixels counted from a south-west corner, rows stored from the north.

    Attributes:
        west, south: world position of the south-west corner.
        resolution: side of a pixel in units of the terrain.
        height, width: rows and columns.
    """

    west: float
    south: float
    resolution: float
    height: int
    width: int

    @property
    def whole(self) -> Window:
        """The window of all pixels."""
        return Window(0, 0, self.height, self.width)

    @property
    def bounds(self) -> Bounds:
        """West, south, east, north of the outermost pixels' edges."""
        return (
            self.west,
            self.south,
            self.west + self.width * self.resolution,
            self.south + self.height * self.resolution,
        )

    def columns(self, window: Window) -> NDArray[np.float64]:
        """The x of the pixel centres of a window, (width,) float64."""
        steps = np.arange(window.column, window.column + window.width)
        return np.asarray(self.west + (steps + 0.5) * self.resolution, np.float64)

    def rows(self, window: Window) -> NDArray[np.float64]:
        """The y of the pixel centres of a window from north to south, (height,) float64.

        Counted from the north, as readers of a geotransform do, to the same last bit.
        """
        steps = np.arange(window.row, window.row + window.height)
        return np.asarray(self.bounds[3] - (steps + 0.5) * self.resolution, np.float64)

    def windows(self, height: int, width: int) -> Iterator[Window]:
        """Cut the grid into windows of at most this size, row by row from the north-west."""
        return self.whole.cut(height, width)


def default_resolution(terrain: Terrain) -> tuple[float, str]:
    """A resolution for a terrain, and in words why: a tenth of its smallest cell, within reason.

    A curve with details finer than that gets a pixel for each. Where the longer side would have too
    many pixels, it is that of `resolution_within`.
    """
    finest, why = terrain.smallest_cell / PIXELS_PER_CELL, "a tenth of the smallest cell"
    west, south, east, north = terrain.cells()
    detail = float(finest_details(terrain.arrays, east - west, north - south).min())
    if detail < finest * (1 - _WHOLE):
        finest, why = detail, "the finest detail of a curve"
    if max(terrain.size) / finest > DEFAULT_PIXELS * (1 + _WHOLE):
        return resolution_within(*terrain.size, DEFAULT_PIXELS)
    return finest, why


def resolution_within(width: float, depth: float, most: int) -> tuple[float, str]:
    """A resolution for at most so many pixels on the longer side of a rectangle, and in words why.

    There is one row of pixels where they would be wider than the shorter side. There are fewer,
    down to half as many, where the shorter side has whole pixels then.
    """
    longest, shortest = max(width, depth), min(width, depth)
    if longest / most > shortest:
        return shortest, "one row of pixels"

    def is_whole(pixels: int) -> bool:
        across = pixels * (shortest / longest)
        return abs(across - round(across)) < _WHOLE

    pixels = next(filter(is_whole, range(most, most // 2, -1)), most)
    return longest / pixels, f"{pixels} pixels on the longer side"


def refuse_resolution(resolution: float) -> None:
    """Refuse what is no side of a pixel.

    Raises:
        RequestError: it is no number above 0.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise RequestError(
            f"The resolution is {resolution:g}.", "Give the side of a pixel, a number above 0."
        )


def grid_over(terrain: Terrain, resolution: float, bounds: Bounds | None = None) -> Grid:
    """The grid that covers the terrain, or the given bounds.

    Pixels count from the south-west corner. Where the resolution does not divide a side, the last
    pixels reach beyond the east and north edges, and have no height if their centres do.

    Raises:
        RequestError: no resolution above 0, bounds that are empty or miss the terrain, or a grid
            that no file can hold or that has no pixel centre on the terrain.
    """
    refuse_resolution(resolution)
    west, south, east, north = terrain.bounds
    if bounds is not None:
        check_bounds(bounds, terrain)
        west, south, east, north = bounds
    width, height = count_pixels(east - west, resolution), count_pixels(north - south, resolution)
    if max(width, height) > MAX_SIDE:
        raise RequestError(
            f"A resolution of {resolution:g} makes {width:.4g} × {height:.4g} pixels, more than a "
            "file can hold.",
            "Give a coarser resolution or smaller bounds.",
        )
    grid = Grid(west, south, resolution, height, width)
    t_west, t_south, t_east, t_north = terrain.bounds
    if not (_any_centre(west, width, resolution, t_west, t_east)) or not (
        _any_centre(south, height, resolution, t_south, t_north)
    ):
        side = _overlap(grid.bounds, terrain.bounds)
        raise RequestError(
            f"At a resolution of {resolution:g} no pixel has its centre on the terrain.",
            f"Give at most {side:g}, the shorter side of what is to be written.",
        )
    return grid


def _overlap(one: Bounds, other: Bounds) -> float:
    """Shorter side of the rectangle that two have in common."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    return min(width, min(one[3], other[3]) - max(one[1], other[1]))


def count_pixels(side: float, resolution: float) -> int:
    """How many pixels cover a side; it ends at a pixel's edge where rounding alone hides that."""
    quotient = side / resolution
    if quotient > 2 * MAX_SIDE:
        return 2 * MAX_SIDE
    nearest = round(quotient)
    if nearest and abs(quotient - nearest) <= _WHOLE * min(1.0, 1e6 / nearest):
        return nearest
    return max(1, math.ceil(quotient))


def _any_centre(start: float, count: int, step: float, low: float, high: float) -> bool:
    first = max(0, math.ceil((low - start) / step - 0.5))
    return first < count and low <= start + (first + 0.5) * step <= high
