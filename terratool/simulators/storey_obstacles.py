"""Cells that a robot with limits of slope and step cannot pass, on decks, in bores and below.

Tops and what lies before who stands on them are those of the layers of driving. Between them walls
are looked for from node to node, half a cell apart.
"""

from __future__ import annotations

import contextlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew, Threads
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window, window_name
from terratool.simulators.obstacles import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    DrivingLimits,
    holes_in,
    node_grid,
    occupancy,
)
from terratool.tasks import Work, processors
from terratool.traversability.layers import DrivingLayer, LayerGround, LayerPainter, sheets_of

_WINDOW = 256
"""Side of a window, in cells."""
_REACH = 1
"""Nodes beside the tops of a layer that matter."""
_LEAST = 1e-3
"""Least height of a wall between nodes, in their distances, even where no step is allowed."""


class _SheetWindow(NamedTuple):
    """Cells of a window of one sheet, (height, width) each.

    Attributes:
        cells: int8, occupancy.
        own: whether the sheet has a top at the middle.
        plain: whether nothing but ground is at the nodes of a cell and around them.
    """

    cells: NDArray[np.int8]
    own: NDArray[np.bool_]
    plain: NDArray[np.bool_]


class _StoreyWindow(NamedTuple):
    """Cells of a window, sheet by sheet, the ground's first; none where no storeys are near."""

    window: Window
    sheets: list[_SheetWindow]


def storey_occupancy(
    terrain: Terrain, grid: Grid, limits: DrivingLimits, crew: Crew | None = None
) -> NDArray[np.int8]:
    """Return `occupancy` for the ground and each sheet of storeys, (sheets, height, width).

    In the first are the lowest tops. A cell is unknown where no top of the sheet is at its middle.

    Args:
        terrain: terrain with storeys.
        grid: the cells.
        limits: slopes and steps that can be driven.
        crew: crew that looks for obstacles; as many threads as processors if None.
    """
    crew = crew or Threads(processors())
    finder = StoreyObstacleFinder(terrain, grid, limits)
    out = np.full((sheets_of(terrain), grid.height, grid.width), UNKNOWN, np.int8)
    out[0] = occupancy(terrain.ground_alone, grid, limits, crew)
    work = Work(StoreyObstacleFinder.find, finder, name=window_name)
    with contextlib.closing(crew.run(work, grid.windows(_WINDOW, _WINDOW))) as windows:
        for window, sheets in windows:
            if not sheets:
                continue
            part = np.s_[
                window.row : window.row + window.height,
                window.column : window.column + window.width,
            ]
            ground, *storeys = sheets
            known = ground.own.copy()
            lowest = np.where(ground.plain, out[0][part], ground.cells)
            for number, sheet in enumerate(storeys, 1):
                out[number][part] = sheet.cells
                here = sheet.own & ~known
                lowest[here], known = sheet.cells[here], known | here
            out[0][part] = lowest
    return out


class StoreyObstacleFinder:
    """Finder of obstacles in windows of cells; several threads may use one at a time.

    Nodes are those of `ObstacleFinder`. Of two nodes the upper one has the wall between them.
    """

    def __init__(self, terrain: Terrain, grid: Grid, limits: DrivingLimits) -> None:
        self._terrain, self._grid, self._limits = terrain, grid, limits
        self._side = 0.5 * grid.resolution
        self._step = max(limits.step, _LEAST * self._side)
        rise = self._step + limits.slope * self._side
        self._painter = LayerPainter(terrain, node_grid(grid), rise, _REACH)

    def __reduce__(self) -> tuple[Any, ...]:
        return StoreyObstacleFinder, (self._terrain, self._grid, self._limits)

    def find(self, window: Window) -> _StoreyWindow:
        """Return the cells of a window."""
        # with the nodes all around those of the window
        nodes = Window(
            2 * window.row, 2 * window.column - 1, 2 * window.height + 2, 2 * window.width + 2
        )
        found = []
        for sheet in range(sheets_of(self._terrain)):
            layers = [
                self._painter.find(nodes, DrivingLayer(sheet, apart)) for apart in (False, True)
            ]
            seen = [layer for layer in layers if layer is not None]
            if not seen:
                break
            found.append(self._cells(window, sheet, seen))
        return _StoreyWindow(window, found)

    def _cells(self, window: Window, sheet: int, layers: list[LayerGround]) -> _SheetWindow:
        """Cells of a sheet in a window, by its layers."""
        shape = window.height, window.width
        cells = np.full(shape, UNKNOWN, np.int8)
        own, bars, plain = np.zeros((3, *shape), np.bool_)
        for layer in layers:
            mine = layer.own & (layer.sheet == sheet)
            middle = mine[1:-1, 1:-1][::2, 1::2]
            bars |= _by_cell(mine & self._barred(layer))
            hole = np.isnan(layer.planes.heights)
            holed = holes_in(self._terrain, self._grid, window, middle & _around(hole))
            cells[middle & ~holed & ~_by_cell(hole)] = FREE
            storeyed = (layer.sheet > 0) | (hole & ~layer.own)
            plain |= middle & ~holed & ~_around(storeyed, 1)
            own |= middle
        cells[bars] = OCCUPIED
        return _SheetWindow(cells, own, plain)

    def _barred(self, layer: LayerGround) -> NDArray[np.bool_]:
        """Nodes of too steep a slope, or over too high a wall to a node beside them."""
        z, slope_x, slope_y = layer.planes.heights, layer.planes.slope_x, layer.planes.slope_y
        assert slope_x is not None and slope_y is not None
        barred = np.asarray(np.hypot(slope_x, slope_y) > self._limits.slope)
        # rows run south
        for slope, low, high in (
            (slope_x, np.s_[:, :-1], np.s_[:, 1:]),
            (slope_y, np.s_[1:, :], np.s_[:-1, :]),
        ):
            rise = z[high] - z[low]
            wall = np.abs(rise - 0.5 * self._side * (slope[low] + slope[high])) > self._step
            barred[high] |= wall & (rise > 0.0)
            barred[low] |= wall & (rise < 0.0)
        return barred


def _by_cell(nodes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether any of the four nodes of a cell is set, of nodes with those around the window."""
    inner = nodes[1:-1, 1:-1]
    height, width = (side // 2 for side in inner.shape)
    return np.asarray(inner.reshape(height, 2, width, 2).any(axis=(1, 3)))


def _around(nodes: NDArray[np.bool_], wider: int = 0) -> NDArray[np.bool_]:
    """Whether any node at the corners, sides and middle of a cell is set; with `wider`, beside it.

    Nodes are those of a window and all around.
    """
    height, width = (side // 2 - 1 for side in nodes.shape)
    found = np.zeros((height, width), np.bool_)
    for row in range(3 + wider):
        for column in range(1 - wider, 4):
            found |= nodes[row : row + 2 * height : 2, column : column + 2 * width : 2]
    return found
