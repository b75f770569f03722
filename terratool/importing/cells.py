"""Square cells that gather points: a height for each cell, and the commonest class."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.importing.types import PixelGrid
from terratool.raster.grid import refuse_resolution, thresholds
from terratool.report.numbers import coordinates, round_up

Floats = NDArray[np.float64]
Height = Literal["mean", "highest", "lowest"]
"""Height of a cell, by its points."""
HEIGHTS: tuple[Height, ...] = get_args(Height)

MOST_VOTES = 1 << 28
"""Most counts of classes in cells; these take 1 GiB."""

_ON_GRID = 1e-6
_FARTHEST = 2.0**40
"""Most cells between a cell and 0, so that doubles tell them apart."""


class CellRange(NamedTuple):
    """Cells along an axis, whose edges are multiples of their side.

    A point on an edge belongs to the cell to the east, or to the north; on the last edge of all to
    the last cell.

    Attributes:
        first: near edge of all cells, in sides from 0 on.
        side: side of a cell.
        total: number of all cells.
        begin, end: first of the cells that are taken, and the one behind the last.
    """

    first: int
    side: float
    total: int
    begin: int
    end: int

    @classmethod
    def over(cls, low: float, high: float, side: float, part: tuple[float, float]) -> CellRange:
        """Cells over all places from `low` to `high`; those with centres in a part are taken."""
        first = math.floor(low / side)
        while _edge(first, side) > low:
            first -= 1
        while _edge(first + 1, side) <= low:
            first += 1
        start = _edge(first, side)
        count = max(math.ceil((high - start) / side) - 1, 1)
        while start + count * side < high:
            count += 1
        begin, end = 0, count
        if part[0] > -math.inf:
            begin = max(0, math.ceil((part[0] - start) / side - 0.5 - _ON_GRID))
            end = min(count, math.floor((part[1] - start) / side - 0.5 + _ON_GRID) + 1)
        return cls(first, side, count, begin, end)

    @property
    def start(self) -> float:
        """Near edge of the cells that are taken."""
        return _edge(self.first + self.begin, self.side)

    def of(self, places: Floats) -> NDArray[np.int64]:
        """Index of the cell of each place, (n,) int64, among those taken; -1 for none."""
        found = thresholds(places, _edge(self.first, self.side), self.side, self.total)
        return np.where((found >= self.begin) & (found < self.end), found - self.begin, -1)


def _edge(index: int, side: float) -> float:
    """Whole multiple of a side, which is a decimal: 3 × 0.1 is 0.3."""
    return float(index * Decimal(repr(side)))


class PointCells:
    """Cells over a rectangle, filled batch by batch.

    Attributes:
        grid: the cells as pixels.
        counts: (rows × columns,) int32, number of points.
    """

    def __init__(self, x: CellRange, y: CellRange, kind: Height = "mean") -> None:
        columns, rows = x.end - x.begin, y.end - y.begin
        self.grid = PixelGrid(x.start, y.start, x.side, y.side, columns, rows)
        self._x, self._y, self._kind = x, y, kind
        empty = {"mean": 0.0, "highest": -math.inf, "lowest": math.inf}[kind]
        self._heights = np.full(rows * columns, empty)
        self.counts = np.zeros(rows * columns, np.int32)
        self._base: float | None = None

    def add(self, x: Floats, y: Floats, z: Floats) -> None:
        """Add points, (n,) each; those outside count for nothing."""
        cell = _cells_of(self._x, self._y, x, y)
        if cell.min(initial=0) < 0:
            cell, z = cell[cell >= 0], z[cell >= 0]
        if not len(cell):
            return
        np.add.at(self.counts, cell, 1)
        if self._kind == "mean":
            # sums of differences from one height round less
            self._base = float(z[0]) if self._base is None else self._base
            np.add.at(self._heights, cell, z - self._base)
        else:
            (np.maximum if self._kind == "highest" else np.minimum).at(self._heights, cell, z)

    @property
    def heights(self) -> Floats:
        """Heights, (rows, columns) float64, row 0 the southernmost; NaN where there is no point."""
        empty = self.counts == 0
        if self._kind == "mean":
            found = self._heights / np.maximum(self.counts, 1) + (self._base or 0.0)
        else:
            found = self._heights
        return np.where(empty, np.nan, found).reshape(self.grid.rows, self.grid.columns)


def _cells_of(x: CellRange, y: CellRange, xs: Floats, ys: Floats) -> NDArray[np.int64]:
    """Index of the cell of each point, (n,) int64, row by row from the south; -1 for none."""
    column, row = x.of(xs), y.of(ys)
    return np.where((column < 0) | (row < 0), -1, row * (x.end - x.begin) + column)


class Votes:
    """Classes of the points of each cell, counted batch by batch.

    Args:
        x, y: the cells.
        present: (k,) numbers of the classes that points may have, ascending, up to 255.

    Raises:
        RequestError: there are too many cells for so many classes.
    """

    def __init__(self, x: CellRange, y: CellRange, present: NDArray[np.int64]) -> None:
        self._x, self._y, self._present = x, y, present
        self._shape = y.end - y.begin, x.end - x.begin
        self._cells = self._shape[0] * self._shape[1]
        if self._cells * len(present) > MOST_VOTES:
            raise RequestError(
                f"Points of {len(present)} classes in {self._cells:,} cells are too much to count.",
                "Give a coarser --resolution, or take a part by --bounds.",
            )
        self._index = np.zeros(256, np.int64)
        self._index[present] = np.arange(len(present))
        self._votes = np.zeros(len(present) * self._cells, np.int32)

    def add(self, x: Floats, y: Floats, classes: NDArray[np.uint8]) -> None:
        """Add points, (n,) each; those outside count for nothing."""
        cell = _cells_of(self._x, self._y, x, y)
        inside = cell >= 0
        np.add.at(self._votes, (self._index[classes] * self._cells + cell)[inside], 1)

    @property
    def commonest(self) -> NDArray[np.int16]:
        """Commonest class, (rows, columns) int16, of equals the lower one; -1 for no points."""
        votes = self._votes.reshape(-1, *self._shape)
        found: NDArray[np.int16] = self._present[votes.argmax(axis=0)].astype(
            np.int16
        )  # the first of equals
        found[votes.max(axis=0) == 0] = -1
        return found


def cells_over(
    extent: Bounds,
    resolution: float,
    bounds: Bounds | None,
    most: int,
    proposed: Callable[[], float],
) -> tuple[CellRange, CellRange]:
    """Cells over an extent, along x and along y; of these, those with their centres in bounds.

    Args:
        extent: west, south, east and north of all points.
        resolution: side of a cell.
        bounds: part that is taken; all if None.
        most: most cells.
        proposed: finds the side of a cell that the points suggest.

    Raises:
        RequestError: the resolution makes no sense, or makes too many cells or none.
    """
    refuse_resolution(resolution)
    parts = ((-math.inf, math.inf),) * 2 if bounds is None else (bounds[::2], bounds[1::2])
    sides = [
        min(high, part[1]) - max(low, part[0])
        for low, high, part in zip(extent[:2], extent[2:], parts, strict=True)
    ]
    if min(sides) >= 0.0 and (sides[0] / resolution + 1) * (sides[1] / resolution + 1) > most:
        width, depth = sides
        enough = math.sqrt(width * depth / most) + (width + depth) / most
        raise RequestError(
            f"Cells of {resolution:g} over {width:.6g} × {depth:.6g} are more than {most:,}, too "
            "many for so many points.",
            f"Give --resolution {round_up(max(enough, proposed())):g} or more, or take a "
            "part by --bounds.",
        )
    if max(map(abs, extent)) / resolution > _FARTHEST:
        raise RequestError(
            f"Cells of {resolution:g} are too small for places as far off as these.",
            f"Give --resolution {proposed():g} or so.",
        )
    side = float(resolution)
    x, y = (
        CellRange.over(low, high, side, (part[0], part[1]))
        for low, high, part in zip(extent[:2], extent[2:], parts, strict=True)
    )
    if bounds is not None and (x.begin >= x.end or y.begin >= y.end):
        raise RequestError(
            f"No cell has its centre in the bounds {coordinates(bounds)}.",
            f"Give bounds that overlap {coordinates(extent)}, where the points lie.",
        )
    return x, y
