"""The ground under a vehicle: heights, surfaces, walls, crests and ruts of a window.

Where a terrain has storeys it is that of a layer, with what is over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import crest_lines, curve_weights
from terratool.field.terrain import Terrain
from terratool.field.tracks import without_tracks
from terratool.field.walls import WallFinders
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import Painter, Planes
from terratool.traversability.layers import DrivingLayer, LayerGround, LayerPainter, PathHeights
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
        layer: what a layer of a terrain with storeys shows; None for ground alone.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[Any]
    slope_x: NDArray[np.float32] | None
    slope_y: NDArray[np.float32] | None
    pairs: NDArray[np.int64]
    met: tuple[MetWalls, ...]
    crests: Crests
    ruts: Ruts | None
    layer: LayerGround | None = None


class _Made(NamedTuple):
    """A plain terrain and what its crests and walls are found with."""

    terrain: Terrain
    finders: WallFinders
    lines: Any
    weights: Any

    @classmethod
    def of(cls, terrain: Terrain) -> _Made:
        arrays = terrain.arrays
        return cls(terrain, WallFinders(terrain), crest_lines(arrays), curve_weights(arrays))


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
        layers: painter of the layers of a terrain with storeys; None for others.
    """

    def __init__(
        self, terrain: Terrain, grid: Grid, least: float, slopes: bool, radii: Sequence[float],
        layers: LayerPainter | None = None,
    ) -> None:  # fmt: skip
        terrain = terrain.written_out
        self._terrain, self._grid, self._least, self._radii = terrain, grid, least, radii
        self._painter = Painter(terrain, grid, slopes=slopes, labels=True)
        self._layers, sheets = layers, []
        if layers is not None:
            sheets = [sheet.top for sheet in layers.storeys.sheets]
        self._made = [_Made.of(one) for one in (terrain, *sheets)]
        self._finders = [made.finders for made in self._made]
        if terrain.tracks and np.isfinite(terrain.arrays.tracks.segments["z"]).any():
            # where tops stand over each other not each track lies on the ground
            self._finders.append(WallFinders(terrain.with_arrays(without_tracks(terrain.arrays))))
        self._slopes = slopes

    def paint(self, window: Window) -> StanceGround:
        """Paint the ground of a window."""
        planes = self._painter.paint(window)
        x, y = self._grid.columns(window), self._grid.rows(window)
        crests = self._find_crests(self._made[0], x, y, planes.heights)
        rows, columns = self._like(x, y)
        planes = self._go_on(planes, rows, columns)
        return self._ground(planes, x[columns], y[rows], crests)

    def paint_layer(self, window: Window, layer: DrivingLayer) -> StanceGround | None:
        """Paint what a layer shows in a window; None where it has no tops of its own."""
        assert self._layers is not None
        shown = self._layers.find(window, layer)
        if shown is None:
            return self.paint(window) if layer == DrivingLayer(0, False) else None
        if not (shown.own | shown.joined).any():
            return None
        x, y = self._grid.columns(window), self._grid.rows(window)
        found = []
        for sheet in np.unique(shown.sheet[shown.sheet >= 0]).tolist():
            here = shown.sheet == sheet
            heights = np.where(here, shown.planes.heights, np.float32(np.nan))
            crests = self._find_crests(self._made[sheet], x, y, heights)
            kept = here[crests.row, crests.column]
            found.append([one[kept] for one in crests])
        joined = Crests(*map(np.concatenate, zip(*found, strict=True))) if found else None
        rows, columns = self._like(x, y)
        planes = self._go_on(shown.planes, rows, columns)
        if not self._slopes:
            planes = planes._replace(slope_x=None, slope_y=None)
        shown = shown.part(rows, columns)._replace(planes=planes)
        return self._ground(planes, x[columns], y[rows], joined or _NO_CRESTS, shown)

    def _ground(
        self, planes: Planes, x: Axis, y: Axis, crests: Crests, shown: LayerGround | None = None
    ) -> StanceGround:
        """The ground of planes that go on beyond the rim, at the places they are like."""
        heights = planes.heights
        assert planes.surfaces is not None and planes.labels is not None
        pairs, same = _rises(heights, planes.labels, self._least, self._grid.resolution)
        walls = self._find_walls(x, y, pairs[~same], shown)
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
            crests, self._find_ruts(x, y, planes.surfaces, shown), shown,
        )  # fmt: skip

    def _like(self, x: Axis, y: Axis) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns on the terrain that those of a window are like, beyond the rim, too."""
        columns, rows = map(_nearest_inside, inside_of(self._terrain, x, y))
        columns = np.arange(len(x)) if columns is None else columns
        return np.arange(len(y)) if rows is None else rows, columns

    def _go_on(self, planes: Planes, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Planes:
        """Let the ground go on beyond the rim, level away from it."""
        if _is_all(rows) and _is_all(columns):
            return planes
        like = np.ix_(rows, columns)
        slope_x, slope_y = planes.slope_x, planes.slope_y
        if slope_x is not None and slope_y is not None:
            slope_x, slope_y = slope_x[like], slope_y[like]
            slope_x[:, columns != np.arange(len(columns))] = 0.0
            slope_y[rows != np.arange(len(rows))] = 0.0
        assert planes.surfaces is not None and planes.labels is not None
        heights, surfaces, labels = (
            np.ascontiguousarray(plane[like])
            for plane in (planes.heights, planes.surfaces, planes.labels)
        )
        return Planes(heights, surfaces, slope_x, slope_y, labels)

    def _find_ruts(
        self, x: Axis, y: Axis, surfaces: NDArray[Any], shown: LayerGround | None
    ) -> Ruts | None:
        """Find the ruts at the centres of pixels; None where no pixel has any."""
        found = Ruts(*np.empty((3, *surfaces.shape), np.float32))
        south_up = np.ascontiguousarray(y[::-1])
        heights = PathHeights() if shown is None else shown.paths
        any_there = kernels.find_ruts(self._terrain.field, x, south_up, surfaces, heights, *found)
        return found if any_there else None

    def _find_crests(self, of: _Made, x: Axis, y: Axis, heights: NDArray[np.float32]) -> Crests:
        """Find the crests in pixels, which need not be beyond the rim."""
        return Crests(
            *kernels.find_crests(
                of.terrain.field, of.lines, of.weights, x, y, self._grid.resolution,
                LOW_CREST * min(self._radii), heights,
            )
        )  # fmt: skip

    def _find_walls(
        self, x: Axis, y: Axis, pairs: NDArray[np.int64], shown: LayerGround | None
    ) -> Walls:
        """Find up to `_WALLS` walls between the pixels of each pair."""
        places, jumps = np.empty((len(pairs), _WALLS)), np.zeros((len(pairs), _WALLS))
        groups: list[tuple[int, Any]] = [(0, np.s_[:])] if len(pairs) else []
        if shown is not None:
            places[:, 0], jumps[:, 0] = _wall_amid(x, y, pairs, shown.planes.heights)
            one, other = (shown.sheet.reshape(-1)[n] for n in _ends(pairs, len(x)))
            alike = np.where(one == other, one, -1)
            if len(self._finders) > len(self._made):
                lone = shown.lone.reshape(-1)
                shared = ~np.logical_and(*(lone[n] for n in _ends(pairs, len(x))))
                alike[(alike == 0) & shared] = len(self._made)
            groups = [(n, np.flatnonzero(alike == n)) for n in np.unique(alike[alike >= 0])]
        for finders, at in groups:
            part = pairs[at], np.empty_like(places[at]), np.zeros_like(jumps[at])
            with self._finders[finders].one() as finder:
                kernels.walls_between(
                    finder, part[0], x, y, self._grid.resolution, 0.5 * self._least, *part[1:]
                )
            if shown is not None and finders and self._terrain.tracks:
                place, jump = _wall_amid(x, y, part[0], -shown.rut)
                rutted = np.abs(jump) >= 0.5 * self._least
                part[1][rutted, -1], part[2][rutted, -1] = place[rutted], jump[rutted]
            places[at], jumps[at] = part[1:]
        return walls_in_order(pairs, len(x), places, jumps, self._grid.resolution)


def inside_of(terrain: Terrain, x: Axis, y: Axis) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether columns at x, and rows at y, lie on the terrain, (n,) bool each."""
    west, south, east, north = terrain.bounds
    return (x >= west) & (x <= east), (y >= south) & (y <= north)


def _is_all(index: NDArray[np.int64]) -> bool:
    """Whether an index along an axis is that of all in order."""
    return bool((index == np.arange(len(index))).all())


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
    flat = heights.reshape(-1)
    pixel, other = _ends(pairs, heights.shape[1])
    return np.asarray(np.abs(flat[other] - flat[pixel]), np.float32)


def _ends(pairs: NDArray[np.int64], width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of both pixels of pairs, in windows of a width."""
    pixel = pairs >> 1
    return pixel, pixel + np.where(pairs & 1, width, 1)


def _wall_amid(
    x: Axis, y: Axis, pairs: NDArray[np.int64], heights: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Place and jump of a wall amid each of pairs, of all that their pixels differ by."""
    one, other = _ends(pairs, len(x))
    flat, down = heights.reshape(-1).astype(np.float64), (pairs & 1) == 1
    rise = np.where(down, flat[one] - flat[other], flat[other] - flat[one])
    column, row, below = one % len(x), one // len(x), other // len(x)
    along = 0.5 * (x[column] + x[other % len(x)])
    return np.where(down, 0.5 * (y[row] + y[below]), along), rise


_NO_CRESTS = Crests(*np.empty((2, 0), np.int64), *np.empty((3, 0), np.float32))
