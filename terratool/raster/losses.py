"""What a grid of pixels cannot keep of a terrain: walls that become ramps, and what is narrow."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike, NDArray

from terratool.field.extents import largest_heights, nonzero_edges
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.misfit import interpolation_error
from terratool.raster.narrow import subpixel_features
from terratool.raster.painting import Planes
from terratool.raster.statement import RasterLoss, Wall

_LEVEL = 1e-7
"""A jump is one from here on, in parts of what any one element is worth …"""
_LOW = 1e-3
"""… and of a pixel: what is lower makes a ramp of less than 0.06°."""

_SHARE = 0.5
"""A ramp between two pixels is that of the wall between them if so much of it is."""

_TESTS = 1 << 15
_PIXELS_PER_TEST = 1 << 14
_LEAST_TESTS = 32
"""So many pairs are tested, or one for so many pixels if these are more. A window has its share of
them by its pixels, but no fewer than the last."""

_UNIT = 1 << 20
"""Lengths are added as whole numbers of such parts of a pixel: in any order they are the same."""


@dataclass(frozen=True, slots=True)
class LossCounts:
    """What is lost in a part of a grid; parts add up, in any order, to that of the whole.

    Attributes:
        candidates: pairs of neighbours that may have a wall between them.
        tested: how many of them were looked at.
        pairs: how many have a wall, as far as the tested ones tell.
        length: of these walls, in parts of a pixel.
        steepest: the largest difference of heights in a pair with a wall, and the pair, negative.
        highest: the highest wall that was looked at, and its pair, negative.
    """

    candidates: int = 0
    tested: int = 0
    pairs: int = 0
    length: int = 0
    steepest: tuple[float, int] = (0.0, 0)
    highest: tuple[float, int] = (0.0, 0)

    def __add__(self, other: LossCounts) -> LossCounts:
        return LossCounts(
            self.candidates + other.candidates,
            self.tested + other.tested,
            self.pairs + other.pairs,
            self.length + other.length,
            max(self.steepest, other.steepest),
            max(self.highest, other.highest),
        )


class LossFinder:
    """Looks for what a grid loses, window by window; may be used by several threads at a time.

    A window with more candidates than can be looked at has some of them tested, evenly spread, and
    the rest estimated; which ones depends on the window and on nothing else. The steepest ramp is
    exact even so: whatever is steeper than the steepest so far is tested too, up to as many pairs
    again. A ramp is a wall's if the wall is at least half of it.

    Args:
        terrain: the terrain.
        grid: the pixels.
        dtype: of the heights in the file.
    """

    def __init__(self, terrain: Terrain, grid: Grid, dtype: DTypeLike = np.float32) -> None:
        self._terrain = terrain
        self._grid = grid
        self._dtype = np.dtype(dtype)
        self._edges = nonzero_edges(terrain.arrays)
        self._idle: deque[kernels.WallFinder] = deque()
        largest = float(largest_heights(terrain.arrays).max())
        self._level = max(_LEVEL * largest, _LOW * grid.resolution)

    def margins(self, window: Window) -> Window:
        """The window, and one more row to the south and column to the east if the grid has them."""
        return Window(
            window.row,
            window.column,
            min(window.height + 1, self._grid.height - window.row),
            min(window.width + 1, self._grid.width - window.column),
        )

    def of(self, window: Window, planes: Planes) -> LossCounts:
        """What is lost between the pixels of a window and their neighbours to the east and south.

        Args:
            window: the window.
            planes: heights and labels of its margins.
        """
        whole, resolution = self.margins(window), self._grid.resolution
        heights, labels = planes.heights, planes.labels
        if labels is None or not labels.shape == heights.shape == (whole.height, whole.width):
            raise ValueError(f"heights and labels of {whole.height} × {whole.width} are wanted")
        pairs, rises = kernels.find_candidates(labels, heights, window.height, window.width)
        count = len(pairs)
        if not count:
            return LossCounts()
        pixels, all_pixels = window.height * window.width, self._grid.height * self._grid.width
        tests = max(_TESTS, all_pixels // _PIXELS_PER_TEST)
        chosen = _spread(count, max(_LEAST_TESTS, tests * pixels // all_pixels))

        try:
            finder = self._idle.pop()
        except IndexError:
            finder = kernels.WallFinder(self._terrain.field, self._edges)
        x, y = self._grid.columns(whole), self._grid.rows(whole)
        jumps, lengths = np.empty(len(chosen)), np.empty(len(chosen))
        kernels.measure_walls(finder, pairs[chosen], x, y, resolution, self._level, jumps, lengths)
        share = count / len(chosen)
        steepest, highest = (0.0, 0), (0.0, 0)
        if jumps.any():
            at = int(jumps.argmax())
            highest = float(jumps[at]), -self._name(whole, int(pairs[chosen[at]]))
            risen = np.where(jumps >= _SHARE * rises[chosen], rises[chosen], -1.0)
            at = int(risen.argmax())
            if risen[at] > 0:
                steepest = float(risen[at]), -self._name(whole, int(pairs[chosen[at]]))
        if len(chosen) < count:
            steeper = np.flatnonzero(rises > steepest[0])
            steeper = steeper[np.argsort(-rises[steeper], kind="stable")][: len(chosen)]
            at, jump = kernels.first_wall(
                finder, pairs[steeper], _SHARE * rises[steeper], x, y, resolution, self._level
            )
            if at >= 0:
                name = -self._name(whole, int(pairs[steeper[at]]))
                steepest = float(rises[steeper[at]]), name
                highest = max(highest, (float(jump), name))
        self._idle.append(finder)
        return LossCounts(
            candidates=count,
            tested=len(chosen),
            pairs=round(share * int((jumps > 0).sum())),
            length=round(share * math.fsum(lengths) * _UNIT),
            steepest=steepest,
            highest=highest,
        )

    def statement(self, part: LossCounts, nodata: int) -> RasterLoss:
        """What the whole grid loses.

        Args:
            part: the sum of those of its windows.
            nodata: pixels without a height.
        """
        resolution = self._grid.resolution
        narrow, details = subpixel_features(self._terrain, self._grid)
        return RasterLoss(
            resolution=resolution,
            wall_length=part.length / _UNIT * resolution,
            wall_pairs=part.pairs,
            estimated=part.tested < part.candidates,
            steepest=self._wall(part.steepest),
            highest=self._wall(part.highest),
            narrow=narrow,
            details=details,
            nodata=nodata,
            misfit=interpolation_error(self._terrain, self._grid, self._dtype),
        )

    def _name(self, window: Window, pair: int) -> int:
        """The number of a pair of a window in the grid, counted from 1."""
        row, column = divmod(pair >> 1, window.width)
        pixel = (window.row + row) * self._grid.width + window.column + column
        return 2 * pixel + (pair & 1) + 1

    def _wall(self, found: tuple[float, int]) -> Wall | None:
        size, name = found
        if not name:
            return None
        pair = -name - 1
        row, column = divmod(pair >> 1, self._grid.width)
        two = Window(row, column, 1 + (pair & 1), 2 - (pair & 1))
        x, y = float(self._grid.columns(two).mean()), float(self._grid.rows(two).mean())
        return Wall(size, x, y)


def _spread(count: int, limit: int) -> NDArray[np.int64]:
    """At most `limit` of `count` indices, one from each of as many stretches, ascending."""
    if count <= limit:
        return np.arange(count)
    stretches = np.arange(limit + 1) * count // limit
    # multiples of the golden section fall in step with nothing
    places = np.mod(np.arange(limit) * 0.6180339887498949, 1.0)
    indices: NDArray[np.int64] = stretches[:-1] + (places * np.diff(stretches)).astype(np.int64)
    return indices
