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
from terratool.field.relief import relief_bounds
from terratool.field.terrain import Terrain, check_bounds, clip_bounds

DEFAULT_PIXELS = 4096
"""The longer side of a raster has at most this many pixels, if no resolution is given."""

PIXELS_PER_CELL = 10
PIXELS_PER_TRACK = 3
PIXELS_PER_CORRELATION = 4
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


def default_resolution(terrain: Terrain, bounds: Bounds | None = None) -> tuple[float, str]:
    """A resolution for a terrain, or a part of it, and in words why: what shows its features.

    That is the least of a tenth of the smallest cell, the shortest straight stretch of a curve, a
    third of the narrowest track, which then has three pixels across, and a quarter of the shortest
    correlation length of a rough surface. Where the longer side would
    have too many pixels, it is that of `resolution_within`.

    Raises:
        RequestError: the bounds are empty or miss the terrain.
    """
    if bounds is not None:
        check_bounds(bounds, terrain)
    part = clip_bounds(terrain, bounds)
    finest, why = _finest_feature(terrain, part)
    sides = part[2] - part[0], part[3] - part[1]
    pixels = max(sides) / finest
    if pixels > DEFAULT_PIXELS * (1 + _WHOLE):
        resolution, limit = resolution_within(*sides, DEFAULT_PIXELS)
        return resolution, f"{limit}; {why}, {finest:.4g}, would take {pixels:,.0f}"
    return (min(sides), "one row of pixels") if finest > min(sides) else (finest, why)


def _finest_feature(terrain: Terrain, part: Bounds) -> tuple[float, str]:
    """A pixel that shows the finest feature of a part of a terrain, and what that feature is."""
    cell, detail = _finest_element(terrain, part)
    segments = terrain.arrays.tracks.segments
    reach = segments["reach"][
        (np.minimum(segments["x"], segments["end_x"]) - segments["reach"] < part[2])
        & (np.maximum(segments["x"], segments["end_x"]) + segments["reach"] > part[0])
        & (np.minimum(segments["y"], segments["end_y"]) - segments["reach"] < part[3])
        & (np.maximum(segments["y"], segments["end_y"]) + segments["reach"] > part[1])
    ]
    narrowest = 2 * float(reach.min(initial=math.inf))
    features = (
        (cell / PIXELS_PER_CELL, "a tenth of the smallest cell"),
        (detail, "the finest detail of a curve"),
        (narrowest / PIXELS_PER_TRACK, "a third of the narrowest track"),
        (
            relief_bounds(terrain.arrays).finest / PIXELS_PER_CORRELATION,
            "a quarter of the shortest correlation length",
        ),
    )
    finest, why = features[0]
    for side, what in features[1:]:
        if side < finest * (1 - _WHOLE):
            finest, why = side, what
    return finest, why


def _finest_element(terrain: Terrain, part: Bounds) -> tuple[float, float]:
    """The smallest cell, and the finest detail of a curve, in a part of a terrain.

    Where there are too many elements, it is the smallest cell of all, and no curve is looked at.
    """
    least, whole = terrain.smallest_cell, terrain.written_out_or_none
    if whole is None:
        return least, math.inf
    west, south, east, north = whole.footprints()
    there = (west < part[2]) & (east > part[0]) & (south < part[3]) & (north > part[1])
    west, south, east, north = whole.cells()
    wide, tall = east - west, north - south
    cell = min(float(wide[there].min()), float(tall[there].min()))
    # but for the rounding of the cells' edges
    cell = least if cell <= least * (1 + _WHOLE) else cell
    return cell, float(finest_details(whole.arrays, wide, tall)[there].min())


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
    """The grid over the terrain, or over the given bounds.

    Pixels count from the south-west corner, and those are taken whose centres lie within. So, where
    the resolution does not divide a side, the number of pixels is rounded to the nearest, as
    `gdalwarp -tr` does: the last pixels reach over the east and north sides, or end before them, by
    up to half a pixel.

    Raises:
        RequestError: no resolution above 0, bounds that are empty or miss the terrain, or a grid
            that no file can hold or that has no pixel centre on the terrain.
    """
    refuse_resolution(resolution)
    west, south, east, north = terrain.bounds
    if bounds is not None:
        check_bounds(bounds, terrain)
        west, south, east, north = bounds
    width, height = (_count_centres(side, resolution) for side in (east - west, north - south))
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


def _count_centres(side: float, resolution: float) -> int:
    """How many pixels have their centres clearly within a side; at least one."""
    return max(1, math.ceil(min(side / resolution, 2 * MAX_SIDE) - 0.5 - _WHOLE))


def overhang(grid: Grid, part: Bounds) -> tuple[float, float]:
    """How far the pixels reach over the east and the north side of a rectangle.

    Negative where they end before it; 0 where rounding alone makes a difference.
    """
    sides = part[2] - part[0], part[3] - part[1]
    counts = grid.width, grid.height
    beyond = (n * grid.resolution - side for n, side in zip(counts, sides, strict=True))
    limit = _WHOLE * grid.resolution
    east, north = (0.0 if abs(over) <= limit else over for over in beyond)
    return east, north


def _any_centre(start: float, count: int, step: float, low: float, high: float) -> bool:
    first = max(0, math.ceil((low - start) / step - 0.5))
    return first < count and low <= start + (first + 0.5) * step <= high
