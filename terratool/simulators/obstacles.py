"""Cells that a robot with limits of slope and step cannot pass, without a model of the robot.

Walls are looked for on the lines between cells and on those through their middles, so that every
wall that enters a cell is met where it does; what is so narrow that it lies between these lines is
found by its crests. Heights come from the terrain itself, not from a raster of it.
"""

from __future__ import annotations

import contextlib
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew, Threads
from terratool.field.bounds import crest_lines, curve_weights
from terratool.field.terrain import Terrain
from terratool.field.walls import WallFinders
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window, window_name
from terratool.raster.painter import Painter
from terratool.tasks import Work, processors

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
"""Values of cells, those of `nav_msgs/OccupancyGrid`."""

_WINDOW = 256
"""Side of a window, in cells."""
_BESIDE = 1e-6
"""Distance of nodes to the north-east of the lines between cells, in sides of a cell."""
_ACROSS = 1e-4
"""Distance from a wall (in cells) or crest (in steps of nodes) at which heights are compared."""
_LEAST = 1e-6
"""Least height of a step, in sides of a cell, even where none is allowed."""
_ROUNDING = 1e-6
"""Relative rounding up to which a slope beyond the limit is at the limit."""
_WALLS = 4
"""Most walls that count between two nodes."""

Points = NDArray[np.float64]


class DrivingLimits(NamedTuple):
    """Slopes and steps that a robot can drive.

    Attributes:
        slope: tangent of the steepest slope.
        step: height of the highest step, units of the terrain.
    """

    slope: float
    step: float

    @classmethod
    def of(cls, max_slope: float, max_step: float) -> DrivingLimits:
        """Return the limits for a slope in degrees and a step in units of the terrain."""
        return cls(math.tan(math.radians(max_slope)) * (1.0 + _ROUNDING), max_step)


class _WindowObstacles(NamedTuple):
    """Obstacles in a window of cells.

    Attributes:
        window: window of the grid.
        steep: (height, width) bool, whether a cell has a slope that is too steep.
        unknown: (height, width) bool, whether void or the outside reaches into a cell.
        walls: (n, 2) float64 x, y of walls that are too high, perhaps in cells beside the window.
    """

    window: Window
    steep: NDArray[np.bool_]
    unknown: NDArray[np.bool_]
    walls: Points


def occupancy(
    terrain: Terrain, grid: Grid, limits: DrivingLimits, crew: Crew | None = None
) -> NDArray[np.int8]:
    """Return `FREE`, `OCCUPIED` or `UNKNOWN` for each cell, (height, width), from the north.

    A cell is occupied if it has a slope that is too steep or a wall that is too high, be it
    narrower than the cell. A wall on the line between two cells is that of the upper one. Other
    cells are unknown if void or the outside reaches into them.

    Args:
        terrain: the ground.
        grid: the cells.
        limits: slopes and steps that can be driven.
        crew: crew that looks for obstacles; as many threads as processors if None.
    """
    crew = crew or Threads(processors())
    work = Work(ObstacleFinder.find, ObstacleFinder(terrain, grid, limits), name=window_name)
    out = np.empty((grid.height, grid.width), np.int8)
    walls = []
    with contextlib.closing(crew.run(work, grid.windows(_WINDOW, _WINDOW))) as windows:
        for found in windows:
            row, column = found.window.row, found.window.column
            cells = np.where(found.unknown, np.int8(UNKNOWN), np.int8(FREE))
            cells[found.steep] = OCCUPIED
            out[row : row + found.window.height, column : column + found.window.width] = cells
            walls.append(found.walls)
    for places in walls:  # a wall may stand in a cell of another window
        columns, rows = np.floor((places - (grid.west, grid.south)) / grid.resolution).T
        rows = grid.height - 1 - np.clip(rows, 0, grid.height - 1).astype(np.int64)
        out[rows, np.clip(columns, 0, grid.width - 1).astype(np.int64)] = OCCUPIED
    return out


def _hair_of(grid: Grid) -> float:
    """Distance of nodes to the north-east of the lines between cells."""
    far = float(np.abs(np.array([*grid.bounds])).max())
    return max(_BESIDE * grid.resolution, 8.0 * float(np.spacing(far)))


def node_grid(grid: Grid) -> Grid:
    """Grid whose pixels have the nodes of cells in their middles, half a cell apart.

    Cell (row, column) has the nodes of two rows from 2·row + 1 on, and two columns from 2·column
    on. Nodes of one more row in the north and one more column in the east are beyond all cells.
    """
    half, hair = 0.5 * grid.resolution, _hair_of(grid)
    return Grid(
        grid.west + hair - 0.5 * half, grid.south + hair - 0.5 * half, half,
        2 * grid.height + 1, 2 * grid.width + 1,
    )  # fmt: skip


def holes_in(
    terrain: Terrain, grid: Grid, window: Window, near: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which of some cells of a window, (height, width), have void or outside at corners or middles.

    The middles of their sides count, too.
    """
    found = near.copy()
    rows, columns = np.nonzero(near)
    # a hair within the cell, as nodes on its border may be those of neighbours
    within = (0.5 * grid.resolution - _hair_of(grid)) * np.array([-1.0, 0.0, 1.0])
    x = grid.columns(window)[columns, None, None] + within[:, None]
    y = grid.rows(window)[rows, None, None] + within
    found[rows, columns] = np.isnan(terrain.height(x, y)).any(axis=(1, 2))
    return found


class ObstacleFinder:
    """Finder of obstacles in windows of cells; several threads may use one at a time.

    Each cell has four nodes: its south-west corner, the middles of its south and west side, and its
    own middle, all a hair to the north-east of there. Lines run from them to the next nodes to the
    east and north.
    """

    def __init__(self, terrain: Terrain, grid: Grid, limits: DrivingLimits) -> None:
        terrain = terrain.written_out
        self._terrain, self._grid, self._limits = terrain, grid, limits
        self._least = max(0.5 * limits.step, _LEAST * grid.resolution)
        self._hair, self._nodes = _hair_of(grid), node_grid(grid)
        self._painter = Painter(
            terrain, self._nodes, np.float64, surfaces=False, slopes=True, labels=True
        )
        self._finders = WallFinders(terrain)
        self._lines = crest_lines(terrain.arrays)
        self._weights = curve_weights(terrain.arrays)

    def __reduce__(self) -> tuple[Any, ...]:
        return ObstacleFinder, (self._terrain, self._grid, self._limits)

    def find(self, window: Window) -> _WindowObstacles:
        """Return the obstacles in the cells of a window."""
        nodes = Window(
            2 * window.row, 2 * window.column, 2 * window.height + 1, 2 * window.width + 1
        )
        planes = self._painter.paint(nodes)
        heights, labels = planes.heights, planes.labels
        assert labels is not None and planes.slope_x is not None and planes.slope_y is not None
        x, y = self._nodes.columns(nodes), self._nodes.rows(nodes)
        steep = np.hypot(planes.slope_x, planes.slope_y) > self._limits.slope
        # lines from each node to the next one to the east, and to the north; rows run south
        for begin, end in (
            (np.s_[1:, :-1], np.s_[1:, 1:]),
            (np.s_[1:, :-1], np.s_[:-1, :-1]),
        ):
            # between two places of smooth ground some slope is no less than that of their chord
            chord = np.abs(heights[end] - heights[begin])
            high = chord > self._limits.slope * self._nodes.resolution
            steep[begin] |= high & (labels[end] == labels[begin])
        walls = np.concatenate([self._walls(heights, labels, x, y), self._crests(heights, x, y)])
        steep = steep[1:, :-1].reshape(window.height, 2, window.width, 2).any(axis=(1, 3))
        return _WindowObstacles(window, steep, self._holes(window, np.isnan(heights)), walls)

    def _holes(self, window: Window, hole: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether cells have void or outside at corners or middles, (height, width) bool."""
        near = np.zeros((window.height, window.width), np.bool_)
        for row in range(3):
            for column in range(3):
                near |= hole[row : row + 2 * window.height : 2, column:][:, : 2 * window.width : 2]
        return holes_in(self._terrain, self._grid, window, near)

    def _walls(
        self, heights: NDArray[np.float64], labels: NDArray[np.uint32], x: Points, y: Points
    ) -> Points:
        """Return x, y in the cells that walls between nodes stand in or go into, (n, 2)."""
        pairs, rises = kernels.find_candidates(labels, heights, len(y), len(x))
        # where ground rises less, slopes are too steep, or walls lead up and down, with crests
        pairs = pairs[rises > self._limits.step - self._limits.slope * self._nodes.resolution]
        places, jumps = np.empty((len(pairs), _WALLS)), np.zeros((len(pairs), _WALLS))
        if len(pairs):
            with self._finders.one() as finder:
                kernels.walls_between(
                    finder, pairs, x, y, self._nodes.resolution, self._least, places, jumps
                )
        index, which = np.nonzero(np.abs(jumps) > self._limits.step)
        rows, columns = np.divmod(pairs[index] >> 1, len(x))
        down = (pairs[index] & 1)[:, None] == 1
        along = np.where(down, (0.0, 1.0), (1.0, 0.0))
        # of two cells the upper one has the wall
        place = places[index, which] + np.sign(jumps[index, which]) * self._hair
        at = np.where(along == 1.0, place[:, None], np.column_stack([x[columns], y[rows]]))
        # a line between two cells is that of the one to the north or east
        between = np.where(down[:, 0], columns, len(y) - 1 - rows) % 2 == 0
        along, beside = along[between], at[between]
        beside = beside - (1.0 - along) * 2.0 * self._hair
        # the wall may go on into the other cell
        across = along * _ACROSS * self._grid.resolution
        rise = self._terrain.height(*(beside + across).T)
        rise -= self._terrain.height(*(beside - across).T)
        return np.concatenate([at, beside[np.abs(rise) > self._limits.step]])

    def _crests(self, heights: NDArray[np.float64], x: Points, y: Points) -> Points:
        """Return x, y of crests between nodes with too high a wall or too steep a slope, (n, 2)."""
        side = self._nodes.resolution
        row, column, _, east, north = kernels.find_crests(
            self._terrain.field, self._lines, self._weights, x, y, side, self._least,
            heights.astype(np.float32),
        )  # fmt: skip
        at = np.column_stack([x[column] + east, y[row] + north])
        around = at[:, None] + _ACROSS * side * np.array(
            [(0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)]
        )
        seen = self._terrain.sample(around[..., 0], around[..., 1])
        low, high = np.fmin.reduce(seen.height, axis=1), np.fmax.reduce(seen.height, axis=1)
        slope = np.hypot(seen.normal[..., 0], seen.normal[..., 1])
        steep = (slope > self._limits.slope * seen.normal[..., 2]).any(axis=1)
        bars = (high - low > self._limits.step) | steep
        # of two cells the upper one has the wall
        top = np.argmax(np.where(np.isnan(seen.height), -np.inf, seen.height), axis=1)
        return np.asarray(around[np.arange(len(at)), top][bars])
