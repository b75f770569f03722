"""Grids of square pixels over a terrain, windows of a grid, and default resolutions."""

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
"""Most pixels on the longer side at the default resolution."""

PIXELS_PER_CELL = 10
"""Pixels across the smallest cell at the default resolution."""
PIXELS_PER_TRACK = 3
"""Pixels across the narrowest track at the default resolution."""
PIXELS_PER_CORRELATION = 4
"""Pixels per shortest correlation length at the default resolution."""
MAX_SIDE = 2**31 - 1
"""Most pixels on a side of a raster file."""
_WHOLE = 1e-6
"""Distance from a whole number of pixels, in pixels, that counts as rounding."""


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of pixels of a grid.

    Attributes:
        row, column: first row and column, from the north-west.
        height, width: rows and columns.
    """

    row: int
    column: int
    height: int
    width: int

    def cut(self, height: int, width: int) -> Iterator[Window]:
        """Divide the window into windows of at most this size, row by row from the north-west."""
        for row in range(0, self.height, height):
            for column in range(0, self.width, width):
                yield Window(
                    self.row + row,
                    self.column + column,
                    min(height, self.height - row),
                    min(width, self.width - column),
                )

    def within(self, other: Window) -> tuple[slice, slice]:
        """Rows and columns of the window in the pixels of another one that holds it."""
        row, column = self.row - other.row, self.column - other.column
        return slice(row, row + self.height), slice(column, column + self.width)


def window_name(window: Window) -> str:
    """Name of a window in messages."""
    return f"cells from row {window.row}, column {window.column} on"


@dataclass(frozen=True, slots=True)
class Grid:
    """Square pixels counted from a south-west corner, rows stored from the north.

    Attributes:
        west, south: world position of the south-west corner.
        resolution: side of a pixel, world units.
        height, width: rows and columns.
    """

    west: float
    south: float
    resolution: float
    height: int
    width: int

    @property
    def whole(self) -> Window:
        """Window of all pixels."""
        return Window(0, 0, self.height, self.width)

    @property
    def bounds(self) -> Bounds:
        """West, south, east and north edge of the grid, world units."""
        return (
            self.west,
            self.south,
            self.west + self.width * self.resolution,
            self.south + self.height * self.resolution,
        )

    def around(self, window: Window) -> Window:
        """Window with one more row and column to each side, within the grid."""
        row, column = max(window.row - 1, 0), max(window.column - 1, 0)
        south = min(window.row + window.height + 1, self.height)
        east = min(window.column + window.width + 1, self.width)
        return Window(row, column, south - row, east - column)

    def columns(self, window: Window) -> NDArray[np.float64]:
        """World x of the pixel centres of a window, (width,) float64."""
        steps = np.arange(window.column, window.column + window.width)
        return np.asarray(self.west + (steps + 0.5) * self.resolution, np.float64)

    def rows(self, window: Window) -> NDArray[np.float64]:
        """World y of the pixel centres of a window from north to south, (height,) float64.

        Computed from the north edge as readers of a geotransform do, to the same bit.
        """
        steps = np.arange(window.row, window.row + window.height)
        return np.asarray(self.bounds[3] - (steps + 0.5) * self.resolution, np.float64)

    def windows(self, height: int, width: int) -> Iterator[Window]:
        """Divide the grid into windows of at most this size, row by row from the north-west."""
        return self.whole.cut(height, width)


def default_resolution(terrain: Terrain, bounds: Bounds | None = None) -> tuple[float, str]:
    """Choose a resolution, world units, that shows the features of a terrain, and say why.

    The resolution is the least of a tenth of the smallest cell, the shortest straight stretch of a
    curve, a third of the narrowest track, and a quarter of the shortest correlation length of a
    rough surface. Where that makes too many pixels, `resolution_within` applies.

    Args:
        terrain: terrain of the raster.
        bounds: part of the terrain; all of it if None.

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
    """Side of a pixel that shows the finest feature of a part of a terrain, and its name."""
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
    """Side of the smallest cell and of the finest curve detail in a part of a terrain.

    With too many elements, the smallest cell of the whole terrain, and infinity for the detail.
    """
    least, whole = terrain.smallest_cell, terrain.written_out_or_none
    if whole is None:
        return least, math.inf
    cell, detail = _finest_among(whole, part)
    # cell edges are rounded
    cell = least if cell <= least * (1 + _WHOLE) else cell
    for sheet in () if whole.storeys is None else whole.storeys.sheets:
        own_cell, own_detail = _finest_among(sheet.top, part, sheet.storeys >= 0)
        cell, detail = min(cell, own_cell), min(detail, own_detail)
    return cell, detail


def _finest_among(
    terrain: Terrain, part: Bounds, which: NDArray[np.bool_] | bool = True
) -> tuple[float, float]:
    """Side of the smallest cell and of the finest detail of some elements in a part of a terrain.

    They are infinite without elements there.
    """
    west, south, east, north = terrain.footprints()
    there = (west < part[2]) & (east > part[0]) & (south < part[3]) & (north > part[1]) & which
    west, south, east, north = terrain.cells()
    wide, tall = east - west, north - south
    cell = min(float(side[there].min(initial=math.inf)) for side in (wide, tall))
    details = finest_details(terrain.arrays, wide, tall)[there]
    return cell, float(details.min(initial=math.inf))


def resolution_within(width: float, depth: float, most: int) -> tuple[float, str]:
    """Choose a resolution for at most `most` pixels on the longer side, and say why.

    One row of pixels results where they would be wider than the shorter side. Fewer pixels, down to
    half, are chosen where they divide the shorter side, too.
    """
    longest, shortest = max(width, depth), min(width, depth)
    if longest / most > shortest:
        return shortest, "one row of pixels"

    def is_whole(pixels: int) -> bool:
        across = pixels * (shortest / longest)
        return abs(across - round(across)) < _WHOLE

    pixels = next(filter(is_whole, range(most, most // 2, -1)), most)
    return longest / pixels, f"{pixels} pixels on the longer side"


def thresholds(
    values: NDArray[np.float64], start: float, side: float, count: int
) -> NDArray[np.int64]:
    """Ψ: index of the interval that holds each value, by exact comparison with its edges.

    Intervals are half-open, but the last one includes its far edge.

    Args:
        values: coordinates, (n,) float64.
        start: near edge of the first interval.
        side: length of an interval.
        count: number of intervals.

    Returns:
        (n,) int64; -1 for values outside.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        index = np.clip(np.floor((values - start) / side), -1, count).astype(np.int64)
    index -= values < start + index * side
    index += values >= start + (index + 1) * side
    index[values == start + count * side] = count - 1
    return np.where((index < 0) | (index >= count), -1, index)


def refuse_resolution(resolution: float) -> None:
    """Refuse a resolution that is not finite and above 0.

    Raises:
        RequestError: the resolution is not.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise RequestError(
            f"The resolution is {resolution:g}.", "Give the side of a pixel, a number above 0."
        )


def grid_over(terrain: Terrain, resolution: float, bounds: Bounds | None = None) -> Grid:
    """Grid over a terrain, or over the given bounds.

    Pixels count from the south-west corner and have their centres within the bounds. Where the
    resolution does not divide a side, the number of pixels is rounded to the nearest as by
    `gdalwarp -tr`: the grid ends up to half a pixel beyond or before the east and north side.

    Raises:
        RequestError: the resolution is not above 0, the bounds are empty or miss the terrain, or
            the grid is too large for a file or has no pixel centre on the terrain.
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
    """Shorter side of the intersection of two rectangles."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    return min(width, min(one[3], other[3]) - max(one[1], other[1]))


def count_pixels(side: float, resolution: float) -> int:
    """Number of pixels that cover a side; a remainder within rounding needs no further pixel."""
    quotient = side / resolution
    if quotient > 2 * MAX_SIDE:
        return 2 * MAX_SIDE
    nearest = round(quotient)
    if nearest and abs(quotient - nearest) <= _WHOLE * min(1.0, 1e6 / nearest):
        return nearest
    return max(1, math.ceil(quotient))


def _count_centres(side: float, resolution: float) -> int:
    """Number of pixels with centres clearly within a side; at least one."""
    return max(1, math.ceil(min(side / resolution, 2 * MAX_SIDE) - 0.5 - _WHOLE))


def overhang(grid: Grid, part: Bounds) -> tuple[float, float]:
    """Overhang of the pixels beyond the east and the north side of a rectangle, world units.

    Negative where the grid ends before the side; 0 within rounding.
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
