"""The ground under a vehicle: heights, surfaces, walls, crests and ruts of a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import crest_lines, curve_weights
from terratool.field.terrain import Terrain
from terratool.field.walls import WallFinders
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import Painter, Planes
from terratool.traversability.walls import Gaps, MetWalls, Walls, meet_walls, walls_in_order

Axis = NDArray[np.float64]
"""World coordinates of the centres of pixels along an axis, (n,) float64, m."""
STEEP = 1.0
"""Tangent from which on a face counts as a step even if the model has no wall there."""
LOW_CREST = 1.0 / 2000.0
"""Height below which crests are left out, in radii of the smallest wheel."""
_WALLS = 4
"""Most walls that count between two pixels."""


class Crests(NamedTuple):
    """Crests: places between the centres of pixels where ground stands out, (n,) each.

    A pixel has up to two crests. `kernels.find_crests` finds them.

    Attributes:
        row, column: int64 row and column of the pixel.
        height: float32 height of the ground, m.
        east, north: float32 distances from the pixel's centre, m.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    height: NDArray[np.float32]
    east: NDArray[np.float32]
    north: NDArray[np.float32]


class Ruts(NamedTuple):
    """Ground that wheels have pressed, (height, width) float32 each; 0 where none have.

    Attributes:
        first: z_1, depth of the deepest first pass, m.
        passes: n, number of passes.
        exponent: a of z_n = z_1 n^(1/a).
    """

    first: NDArray[np.float32]
    passes: NDArray[np.float32]
    exponent: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class StanceGround:
    """The ground in a window of the fine grid; beyond the terrain it goes on as it is at the rim.

    Attributes:
        heights: (height, width) float32, minus infinity where there is no ground.
        surfaces: index of the surface and one, 0 for none.
        slope_x, slope_y: float32 dz/dx and dz/dy, 0 where there is no ground; None if not wanted.
        pairs: (pairs,) neighbours with a wall or a steep face between them, as twice the index of
            the first pixel, plus one for a pair from north to south.
        met: walls and trenches that wheels of each size meet at the pairs.
        crests: crests between the centres of pixels.
        ruts: ruts of wheels; None where no pixel has any.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    slope_x: NDArray[np.float32] | None
    slope_y: NDArray[np.float32] | None
    pairs: NDArray[np.int64]
    met: tuple[MetWalls, ...]
    crests: Crests
    ruts: Ruts | None


class GroundPainter:
    """A painter of windows of ground; several threads may use it at a time.

    Windows may reach beyond the grid, and beyond the terrain: there each pixel is like the nearest
    one on the terrain, but for crests. No pixel depends on the window.

    Args:
        terrain: the ground.
        grid: the fine grid.
        least: height below which walls and faces are left out, m.
        slopes: whether slopes are wanted.
        radii: radii of the wheels, m, as in `HeadingFootprint.treads`.
    """

    def __init__(
        self, terrain: Terrain, grid: Grid, least: float, slopes: bool, radii: Sequence[float]
    ) -> None:
        terrain = terrain.written_out
        self._terrain, self._grid, self._least, self._radii = terrain, grid, least, radii
        self._painter = Painter(terrain, grid, slopes=slopes, labels=True)
        self._finders = WallFinders(terrain)
        self._lines = crest_lines(terrain.arrays)
        self._weights = curve_weights(terrain.arrays)

    def paint(self, window: Window) -> StanceGround:
        """Paint the ground of a window."""
        planes = self._painter.paint(window)
        assert planes.surfaces is not None and planes.labels is not None
        x, y = self._grid.columns(window), self._grid.rows(window)
        crests = self._find_crests(x, y, planes.heights)
        planes, x, y = self._go_on(planes, x, y)
        heights = planes.heights
        assert planes.surfaces is not None and planes.labels is not None
        pairs, same = _rises(heights, planes.labels, self._least, self._grid.resolution)
        walls = self._find_walls(x, y, pairs[~same])
        steep = _rise(heights, pairs) > STEEP * self._grid.resolution
        kept, met = steep.copy(), []
        for radius in self._radii:
            here = meet_walls(walls, same, radius)
            found = here.jumps >= self._least
            # ground without a wall may still be too steep
            here.jumps[steep & ~found] = np.inf
            kept |= found
            met.append(here)
        pairs = pairs[kept]
        hole = np.isnan(heights)
        if hole.any():
            heights[hole] = -np.inf
            for slope in (planes.slope_x, planes.slope_y):
                if slope is not None:
                    slope[hole] = 0.0
        return StanceGround(
            heights, planes.surfaces, planes.slope_x, planes.slope_y, pairs,
            tuple(
                MetWalls(here.jumps[kept], Gaps(*(plane[kept] for plane in here.gaps)))
                for here in met
            ),
            crests, self._find_ruts(x, y, planes.surfaces),
        )  # fmt: skip

    def _go_on(self, planes: Planes, x: Axis, y: Axis) -> tuple[Planes, Axis, Axis]:
        """Let the ground go on beyond the rim, level away from it; with the places it is like."""
        columns, rows = map(_nearest_inside, inside_of(self._terrain, x, y))
        if columns is None and rows is None:
            return planes, x, y
        columns = np.arange(len(x)) if columns is None else columns
        rows = np.arange(len(y)) if rows is None else rows
        like = np.ix_(rows, columns)
        slope_x, slope_y = planes.slope_x, planes.slope_y
        if slope_x is not None and slope_y is not None:
            slope_x, slope_y = slope_x[like], slope_y[like]
            slope_x[:, columns != np.arange(len(x))] = 0.0
            slope_y[rows != np.arange(len(y))] = 0.0
        assert planes.surfaces is not None and planes.labels is not None
        heights, surfaces, labels = (
            np.ascontiguousarray(plane[like])
            for plane in (planes.heights, planes.surfaces, planes.labels)
        )
        return Planes(heights, surfaces, slope_x, slope_y, labels), x[columns], y[rows]

    def _find_ruts(self, x: Axis, y: Axis, surfaces: NDArray[Any]) -> Ruts | None:
        """Find the ruts at the centres of pixels; None where no pixel has any."""
        found = Ruts(*np.empty((3, *surfaces.shape), np.float32))
        south_up = np.ascontiguousarray(y[::-1])
        any_there = kernels.find_ruts(self._terrain.field, x, south_up, surfaces, *found)
        return found if any_there else None

    def _find_crests(self, x: Axis, y: Axis, heights: NDArray[np.float32]) -> Crests:
        """Find the crests in pixels, which need not be beyond the rim."""
        return Crests(
            *kernels.find_crests(
                self._terrain.field, self._lines, self._weights, x, y, self._grid.resolution,
                LOW_CREST * min(self._radii), heights,
            )
        )  # fmt: skip

    def _find_walls(self, x: Axis, y: Axis, pairs: NDArray[np.int64]) -> Walls:
        """Find up to `_WALLS` walls between the pixels of each pair."""
        places, jumps = np.empty((len(pairs), _WALLS)), np.zeros((len(pairs), _WALLS))
        if len(pairs):
            with self._finders.one() as finder:
                kernels.walls_between(
                    finder, pairs, x, y, self._grid.resolution, 0.5 * self._least, places, jumps,
                )  # fmt: skip
        return walls_in_order(pairs, len(x), places, jumps, self._grid.resolution)


def inside_of(terrain: Terrain, x: Axis, y: Axis) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether columns at x, and rows at y, lie on the terrain, (n,) bool each."""
    west, south, east, north = terrain.bounds
    return (x >= west) & (x <= east), (y >= south) & (y <= north)


def _nearest_inside(inside: NDArray[np.bool_]) -> NDArray[np.int64] | None:
    """Index of the nearest pixel inside for each along an axis; None where all or none are."""
    if inside.all() or not inside.any():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    return np.clip(np.arange(len(inside)), first, last)


def _rises(
    heights: NDArray[np.float32], labels: NDArray[np.uint32], least: float, resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Pairs of pixels that rise enough for a step, ascending, and whether both have one label."""
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
    """Height differences of the pixels of pairs, m, without sign."""
    flat, pixel = heights.reshape(-1), pairs >> 1
    other = pixel + np.where(pairs & 1, heights.shape[1], 1)
    return np.asarray(np.abs(flat[other] - flat[pixel]), np.float32)
