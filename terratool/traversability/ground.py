"""Ground under wheels: painted on pixels fine enough for them, with its walls and steep faces."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import nonzero_edges
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import Painter

STEEP = 1.0
"""Tangent from which on a face counts as a step even if the model has no wall there."""
_WALLS = 4
"""So many walls between two pixels count."""


@dataclass(frozen=True, slots=True)
class Ground:
    """What lies in a window of the fine grid.

    Attributes:
        heights: (height, width) float32, minus infinity where there is no ground.
        surfaces: index of the surface and one, 0 for none.
        slope_x, slope_y: float32, 0 where there is no ground; None where not asked for.
        pairs: neighbours with a wall or a steep face between them: twice the index of the first
            pixel, and one for a pair from north to south.
        jumps: heights of these walls, m, or of the step that a wheel meets where another one
            follows close by; infinity for a face without one.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    slope_x: NDArray[np.float32] | None
    slope_y: NDArray[np.float32] | None
    pairs: NDArray[np.int64]
    jumps: NDArray[np.float64]


class Grounds:
    """Paints windows of ground; may be used by several threads at a time.

    Windows may reach beyond the grid: what a pixel is worth depends on no window.

    Args:
        terrain: the terrain.
        grid: the pixels.
        least: walls and faces lower than this, m, are left out.
        slopes: whether slopes are wanted.
        radius: of the wheels, m.
    """

    def __init__(
        self, terrain: Terrain, grid: Grid, least: float, slopes: bool, radius: float
    ) -> None:
        self._terrain, self._grid, self._least, self._radius = terrain, grid, least, radius
        self._painter = Painter(terrain, grid, slopes=slopes, labels=True)
        self._edges = nonzero_edges(terrain.arrays)
        self._idle: deque[kernels.WallFinder] = deque()

    def of(self, window: Window) -> Ground:
        """The ground of a window."""
        planes = self._painter.paint(window)
        assert planes.surfaces is not None and planes.labels is not None
        heights = planes.heights
        pairs, same = _rises(heights, planes.labels, self._least, self._grid.resolution)
        jumps = np.full(len(pairs), np.inf)
        jumps[~same] = self._walls(window, pairs[~same])
        found = jumps >= self._least
        # where no wall is found the ground itself may still be too steep
        steep = ~found & (_rise(heights, pairs) > STEEP * self._grid.resolution)
        jumps[steep] = np.inf
        pairs, jumps = pairs[found | steep], jumps[found | steep]
        hole = np.isnan(heights)
        if hole.any():
            heights[hole] = -np.inf
            for slope in (planes.slope_x, planes.slope_y):
                if slope is not None:
                    slope[hole] = 0.0
        return Ground(heights, planes.surfaces, planes.slope_x, planes.slope_y, pairs, jumps)

    def _walls(self, window: Window, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        places, jumps = np.empty((len(pairs), _WALLS)), np.empty((len(pairs), _WALLS))
        if not len(pairs):
            return jumps[:, 0]
        try:
            finder = self._idle.pop()
        except IndexError:
            finder = kernels.WallFinder(self._terrain.field, self._edges)
        kernels.walls_between(
            finder, pairs, self._grid.columns(window), self._grid.rows(window),
            self._grid.resolution, 0.5 * self._least, places, jumps,
        )  # fmt: skip
        self._idle.append(finder)
        return steps_met(pairs, window.width, places, jumps, self._radius)


def steps_met(
    pairs: NDArray[np.int64],
    width: int,
    places: NDArray[np.float64],
    jumps: NDArray[np.float64],
    radius: float,
) -> NDArray[np.float64]:
    """The step that a wheel meets at each pair: its highest wall, or more if two stand close by.

    A wheel that touches the edges of two walls, the upper one h above the other and t behind it,
    touches the upper at γ + β from the downward vertical: tan γ = h/t, sin β = √(t² + h²)/D. That
    is so if t² < 2 r h − h²; where they stand farther apart it rolls up one after the other.

    Args:
        pairs: as in `Ground`.
        width: of the window, pixels.
        places: (pairs, walls) where each wall stands along its axis, m.
        jumps: (pairs, walls) how much the ground rises there along it, m; 0 for no wall.
        radius: of the wheels, m.

    Returns:
        (pairs,) heights, m; 0 without a wall.
    """
    met: NDArray[np.float64] = np.abs(jumps).max(axis=1, initial=0.0)
    index, which = np.nonzero(jumps)
    pixel, down = pairs[index] >> 1, pairs[index] & 1
    line = 2 * np.where(down, pixel % width, pixel // width) + down
    place, jump = places[index, which], jumps[index, which]
    order = np.lexsort([place, line])
    index, line, place, jump = index[order], line[order], place[order], jump[order]
    apart, up = np.diff(place), jump[1:] > 0.0
    upper = np.minimum(np.abs(np.where(up, jump[1:], jump[:-1])), radius)
    both = (np.diff(line) == 0) & (up == (jump[:-1] > 0.0))
    both &= apart**2 < upper * (2.0 * radius - upper)
    chord = np.minimum(np.hypot(apart, upper) / (2.0 * radius), 1.0)
    angle = np.minimum(np.arctan2(upper, apart) + np.arcsin(chord), 0.5 * np.pi)
    height = radius * (1.0 - np.cos(angle))
    for side in (index[:-1], index[1:]):
        np.maximum.at(met, side[both], height[both])
    return met


def _rises(
    heights: NDArray[np.float32], labels: NDArray[np.uint32], least: float, resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Pairs that rise enough to be looked at, ascending, and whether they are of one label."""
    pairs, same = [], []
    for down in (0, 1):
        first = np.s_[:-1] if down else np.s_[:, :-1]
        second = np.s_[1:] if down else np.s_[:, 1:]
        rise = np.abs(heights[second] - heights[first])
        alike = labels[second] == labels[first]
        row, column = np.nonzero((rise >= least) & (~alike | (rise > STEEP * resolution)))
        pairs.append(2 * (row * heights.shape[1] + column) + down)
        same.append(alike[row, column])
    return np.concatenate(pairs), np.concatenate(same)


def _rise(heights: NDArray[np.float32], pairs: NDArray[np.int64]) -> NDArray[np.float32]:
    flat, pixel = heights.reshape(-1), pairs >> 1
    other = pixel + np.where(pairs & 1, heights.shape[1], 1)
    return np.asarray(np.abs(flat[other] - flat[pixel]), np.float32)
