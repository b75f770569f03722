"""Height fields, where ground is curved and no wall is near, split where they are worst."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

CELLS = 96
"""Cells of a height field along its longer side."""
_SAMPLES = 4
"""Each cell is held against the terrain at so many points a side, and its end."""
_MARGIN = 0.3
"""Cells are left out that are nearer than this part of their side to a wall."""
_NODES = 4_000_000
"""So many nodes all height fields have together, about."""
_FEWEST = 4
"""Beside the void, fewer rows of cells are no height field."""


@dataclass(frozen=True)
class HeightPatch:
    """A height field: heights at evenly spaced nodes, where it has any ground.

    Attributes:
        bounds: west, south, east, north of its nodes.
        heights: (n, m) float64, rows from the south.
        used: (n - 1, m - 1) bool, the cells that it stands for.
        surfaces: (n - 1, m - 1) int32 of these, -1 for none.
        misses: (n - 1, m - 1) how far they are from the terrain, as measured.
    """

    bounds: Bounds
    heights: Floats
    used: Bools
    surfaces: Ints
    misses: Floats

    @property
    def error(self) -> float:
        """How far any used cell is from the terrain, as measured."""
        return float(self.misses[self.used].max(initial=0.0))

    @property
    def worn(self) -> list[int]:
        """The surfaces of used cells."""
        worn: list[int] = np.unique(self.surfaces[self.used]).tolist()
        return worn

    def cropped(self, bottom: int, top: int, left: int, right: int) -> HeightPatch:
        """The rows from `bottom` to before `top`, and columns likewise."""
        west, south, east, north = self.bounds
        n, m = self.used.shape
        dx, dy = (east - west) / m, (north - south) / n
        rows, columns = slice(bottom, top), slice(left, right)
        return HeightPatch(
            (west + left * dx, south + bottom * dy, west + right * dx, south + top * dy),
            self.heights[bottom : top + 1, left : right + 1],
            self.used[rows, columns],
            self.surfaces[rows, columns],
            self.misses[rows, columns],
        )

    def runs(self) -> NDArray[Any]:
        """Rectangles of used cells side by side from west to east."""
        west, south, east, north = self.bounds
        n, m = self.used.shape
        dx, dy = (east - west) / m, (north - south) / n
        row, column = np.nonzero(self.used)
        begin = np.flatnonzero(np.append(True, (np.diff(row) != 0) | (np.diff(column) != 1)))
        end = np.append(begin[1:], len(row)) - 1
        return np.asarray(
            shapely.box(
                west + column[begin] * dx,
                south + row[begin] * dy,
                west + (column[end] + 1) * dx,
                south + (row[end] + 1) * dy,
            )
        )


@dataclass(frozen=True)
class Surroundings:
    """What height fields stand for, and what they keep away from.

    Attributes:
        terrain: its heights.
        corner: (2,) float64, world position of the zero of …
        sharp: … (n, 2, 2) float64 ends of walls, rims of the ground and creases …
        held: … and what needs no height field, prepared.
    """

    terrain: Terrain
    corner: Floats
    sharp: Floats
    held: shapely.Geometry

    def height(self, x: Floats, y: Floats) -> Floats:
        """Heights of the terrain."""
        return np.asarray(self.terrain.height(x + self.corner[0], y + self.corner[1]))

    def surface(self, x: Floats, y: Floats) -> Ints:
        """Indices of its surfaces."""
        return self.terrain.sample(x + self.corner[0], y + self.corner[1]).surface


def lay_patches(
    around: Surroundings, extent: Bounds, max_error: float, most: int
) -> list[HeightPatch]:
    """Height fields for all that solids do not hold.

    They are split in four where they are worst, until they are good or too many.

    Args:
        around: what they stand for.
        extent: west, south, east, north of it.
        max_error: how far they may be from the terrain, along z.
        most: so many are enough.
    """
    queue: list[tuple[float, int, HeightPatch]] = []
    number = nodes = 0
    parts = [extent]
    while True:
        for bounds in parts:
            for patch in _without_void(_patch(around, bounds)):
                number += 1
                nodes += patch.heights.size
                heapq.heappush(queue, (-patch.error, number, patch))
        if not queue or -queue[0][0] <= max_error or len(queue) > most or nodes > _NODES:
            return [patch for _, _, patch in sorted(queue, key=lambda one: one[1])]
        _, _, worst = heapq.heappop(queue)
        nodes -= worst.heights.size
        west, south, east, north = worst.bounds
        x, y = 0.5 * (west + east), 0.5 * (south + north)
        parts = [
            (left, bottom, right, top)
            for bottom, top in ((south, y), (y, north))
            for left, right in ((west, x), (x, east))
        ]


def _patch(around: Surroundings, bounds: Bounds) -> HeightPatch:
    west, south, east, north = bounds
    longer = max(east - west, north - south)
    columns = max(_FEWEST, round(CELLS * (east - west) / longer))
    rows = max(_FEWEST, round(CELLS * (north - south) / longer))
    k = _SAMPLES
    x, y = np.linspace(west, east, columns * k + 1), np.linspace(south, north, rows * k + 1)
    heights = around.height(x[None, :], y[:, None])
    misses = _misses(heights, k)
    cell = (east - west) / columns, (north - south) / rows
    used = np.isfinite(misses) & ~_near(around.sharp, bounds, (rows, columns), cell)
    left, bottom = np.meshgrid(x[:-1:k], y[:-1:k])
    boxes = shapely.box(left, bottom, left + cell[0], bottom + cell[1])
    used &= ~shapely.covers(around.held, boxes)
    surfaces = around.surface(left + 0.5 * cell[0], bottom + 0.5 * cell[1])
    return HeightPatch(bounds, heights[::k, ::k], used, surfaces, misses)


def _misses(heights: Floats, k: int) -> Floats:
    """How far cells are from the terrain at most, (n, m), where each has k + 1 samples a side.

    MuJoCo parts each cell from its south-west to its north-east corner.
    """
    nodes = heights[::k, ::k]
    southwest, southeast = nodes[:-1, :-1], nodes[:-1, 1:]
    northwest, northeast = nodes[1:, :-1], nodes[1:, 1:]
    found = np.zeros(southwest.shape)
    n, m = heights.shape
    for j in range(k + 1):
        for i in range(k + 1):
            u, v = i / k, j / k
            if v <= u:
                level = southwest + u * (southeast - southwest) + v * (northeast - southeast)
            else:
                level = southwest + v * (northwest - southwest) + u * (northeast - northwest)
            there = heights[j : n - k + j : k, i : m - k + i : k]
            np.maximum(found, np.abs(there - level), out=found)
    return found


def _without_void(patch: HeightPatch) -> Iterator[HeightPatch]:
    """Parts of a patch that have no cell without ground, as a height field has no holes."""
    void = np.isnan(patch.misses)
    rows, columns = np.flatnonzero(void.any(axis=1)), np.flatnonzero(void.any(axis=0))
    if not patch.used.any():
        return
    if not len(rows):
        yield patch
        return
    n, m = void.shape
    bottom, top, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    around = [(0, bottom, 0, m), (top, n, 0, m), (bottom, top, 0, left), (bottom, top, right, m)]
    for a, b, c, d in around:
        if a < b and c < d:
            yield from _without_void(patch.cropped(a, b, c, d))
    middle = patch.cropped(bottom, top, left, right)
    if min(middle.used.shape) < _FEWEST or void[bottom:top, left:right].all():
        return
    n, m = middle.used.shape
    if n > m:
        halves = (0, n // 2, 0, m), (n // 2, n, 0, m)
    else:
        halves = (0, n, 0, m // 2), (0, n, m // 2, m)
    for half in halves:
        yield from _without_void(middle.cropped(*half))


def _near(
    sharp: Floats, bounds: Bounds, shape: tuple[int, int], cell: tuple[float, float]
) -> Bools:
    """Whether each cell of a shape, (rows, columns), is near to a wall, a rim or a crease."""
    out = np.zeros(shape, bool)
    rows, columns = shape
    west, south, east, north = bounds
    low, high = sharp.min(axis=1), sharp.max(axis=1)
    margin = _MARGIN * np.array(cell)
    far, near = np.array([east, north]) + margin, np.array([west, south]) - margin
    here = ((low < far) & (high > near)).all(axis=1)
    ends = sharp[here]
    steps = np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / (0.25 * min(cell)))
    steps = np.maximum(steps.astype(np.int64), 1) + 1
    which = np.repeat(np.arange(len(ends)), steps)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)) / np.maximum(
        np.repeat(steps, steps) - 1, 1
    )
    points = ends[which, 0] + share[:, None] * (ends[which, 1] - ends[which, 0])
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            at = np.floor((points + margin * [dx, dy] - [west, south]) / cell).astype(np.int64)
            inside = ((at >= 0) & (at < [columns, rows])).all(axis=1)
            out[at[inside, 1], at[inside, 0]] = True
    return out
