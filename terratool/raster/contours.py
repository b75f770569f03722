"""Contours: the lines on which the ground passes a height."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Window, grid_over
from terratool.raster.painter import Painter
from terratool.report.numbers import coordinates
from terratool.tasks import prefetch, processors

_HALVINGS = 32
"""Halvings of the way between two nodes; the place of a contour is off by 2⁻³² of it."""
_AT_NODE = 1e-9
"""Distance from a node, in distances of nodes, that counts as rounding."""
_ROWS = 128
"""Rows of a window that a thread paints."""
_MOST_NODES = 1 << 25
"""Most nodes whose contours are traced, which takes a gigabyte."""

Floats = NDArray[np.float64]


def contour_heights(low: float, high: float, interval: float, most: int) -> list[float]:
    """Heights of contours between two heights, whole multiples of an interval as decimals.

    Raises:
        RequestError: there would be more than `most`.
    """
    first, last = math.floor(low / interval) + 1, math.ceil(high / interval) - 1
    if last - first >= most:
        raise RequestError(
            f"Contours {interval:g} apart would be {last - first + 1:,} on heights from {low:.4g} "
            f"to {high:.4g}.",
            f"Give at least {(high - low) / most:.2g}, or no number.",
        )
    step = Decimal(repr(interval))
    return [float(index * step) for index in range(first, last + 1)]


def trace_contours(z: Floats, heights: Sequence[float]) -> Iterator[tuple[float, list[Floats]]]:
    """Yield the contours of each height, as lines of (n, 2) columns and rows of the nodes.

    A line ends at the rim, at nodes without a height, or where it began. Ground exactly at the
    height counts as below.

    Args:
        z: (rows, columns) heights of the nodes, NaN where there is none; two of each at least.
        heights: heights of the contours.
    """
    import contourpy

    known = np.ma.masked_invalid(z)
    tracer = contourpy.contour_generator(
        z=known, name="serial", line_type=contourpy.LineType.Separate
    )
    for height in heights:
        lines: Any = tracer.lines(height)
        yield height, lines


class Contour(NamedTuple):
    """A line on which the ground passes a height.

    Attributes:
        height: the height, world units.
        line: (n, 2) world x and y, two points at least; a ring ends where it began.
    """

    height: float
    line: Floats


@dataclass(frozen=True, slots=True)
class ContourNodes:
    """Nodes over a rectangle of a terrain: the pixel centres of a grid, and points on its rim.

    Attributes:
        terrain: terrain that is asked.
        x: (columns,) world x from the west.
        y: (rows,) world y from the north.
        z: (rows, columns) heights; NaN where there is no ground.
    """

    terrain: Terrain
    x: Floats
    y: Floats
    z: Floats

    @classmethod
    def over(cls, terrain: Terrain, part: Bounds, resolution: float) -> ContourNodes:
        """Ask for the heights at nodes a resolution apart, and on the rim of a rectangle.

        Args:
            terrain: terrain that is asked.
            part: west, south, east, north within the terrain.
            resolution: distance of neighbouring nodes, world units.

        Raises:
            RequestError: the resolution is not above 0, or too coarse for the rectangle, or the
                nodes are too many.
        """
        grid = grid_over(terrain, resolution, part)
        if grid.width * grid.height > _MOST_NODES:
            raise RequestError(
                f"Contours on {grid.width:,} × {grid.height:,} pixels do not fit into memory.",
                "Give a coarser --resolution, which misses only what is narrower, or smaller "
                "--bounds.",
            )
        west, south, east, north = part
        side = min(east - west, north - south)
        if 2 * side < resolution:
            raise RequestError(
                f"At a resolution of {resolution:g} no pixel has its centre in "
                f"{coordinates(part)}.",
                f"Give a --resolution of at most {2 * side:g}, or wider --bounds.",
            )
        x = np.concatenate([[west], grid.columns(grid.whole), [east]])
        y = np.concatenate([[north], grid.rows(grid.whole), [south]])
        z = np.empty((len(y), len(x)))
        painter = Painter(terrain, grid, np.float64, surfaces=False, storeys=0)

        def paint(window: Window) -> None:
            rows = slice(window.row + 1, window.row + 1 + window.height)
            z[rows, 1:-1] = painter.paint(window).heights

        for _ in prefetch(paint, grid.windows(_ROWS, grid.width), processors()):
            pass
        for row in (0, -1):
            z[row] = terrain.height(x, y[row])
        for column in (0, -1):
            z[:, column] = terrain.height(x[column], y)
        return cls(terrain, x, y, z)

    def contours(self, heights: Sequence[float]) -> Iterator[Contour]:
        """Yield the contours of each height, in the order of the heights.

        Between two nodes they pass where the ground itself does, at walls upon the wall.
        """
        for height, lines in trace_contours(self.z, heights):
            if (self.z == height).any():
                # a line would run through such nodes, perhaps a pixel off a wall
                above = np.where(np.isnan(self.z), np.nan, self.z > height)
                ((_, lines),) = trace_contours(above, [0.5])
            if not lines:
                continue
            ends = np.cumsum([len(line) for line in lines])[:-1]
            x, y = self._exact(np.concatenate(lines), height)
            for line in np.split(np.column_stack([x, y]), ends):
                moves = np.append(True, (np.diff(line, axis=0) != 0.0).any(axis=1))
                if np.count_nonzero(moves) > 1:
                    yield Contour(height, line[moves])

    def _exact(self, found: Floats, height: float) -> tuple[Floats, Floats]:
        """Places in the world where the ground passes a height.

        Args:
            found: (n, 2) columns and rows between two nodes, or at one.
            height: height of the ground there.
        """
        nearest = np.rint(found)
        found = np.where(np.abs(found - nearest) < _AT_NODE, nearest, found)
        low, high = np.floor(found).astype(np.int64), np.ceil(found).astype(np.int64)
        x, y = (self._place(found[:, axis], axis) for axis in (0, 1))
        # at the corner of a void a contour may end on the diagonal of four nodes, where it stays
        between = (low != high).sum(axis=1) == 1
        (west, south), (east, north) = (
            (self.x[at[between, 0]], self.y[at[between, 1]]) for at in (low, high)
        )
        above = self.z[low[between, 1], low[between, 0]] > height
        begin, end = np.zeros(len(west)), np.ones(len(west))
        for _ in range(_HALVINGS):
            middle = (begin + end) / 2
            ground = self.terrain.height(
                west + middle * (east - west), south + middle * (north - south)
            )
            same = (ground > height) == above
            begin, end = np.where(same, middle, begin), np.where(same, end, middle)
        x[between], y[between] = west + end * (east - west), south + end * (north - south)
        return x, y

    def _place(self, at: Floats, axis: int) -> Floats:
        """World x of columns for axis 0, or y of rows for axis 1."""
        nodes = (self.x, self.y)[axis]
        return np.interp(at, np.arange(len(nodes)), nodes)
