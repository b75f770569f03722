"""How far bilinear interpolation between pixels is from the terrain, on a sample of points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window
from terratool.raster.statement import InterpolationError

POINTS = 100_000
_PLASTIC = 1.32471795724474602596
"""The plastic number spreads points over a square as the golden section does over a line."""

Floats = NDArray[np.float64]


def interpolation_error(
    terrain: Terrain, grid: Grid, dtype: np.dtype[Any]
) -> InterpolationError | None:
    """Compare at up to POINTS points; None where no four pixels with heights lie around one.

    Half of the points are evenly spread, half are the middles of elements. Pixels are worth what
    the queries say at their centres, rounded to `dtype`.
    """
    columns = grid.columns(Window(0, 0, 1, grid.width))
    rows = grid.rows(Window(0, 0, grid.height, 1))[::-1]
    x, y = _points(terrain, columns, rows)
    at_x, part_x = _between(columns, x)
    at_y, part_y = _between(rows, y)
    next_x, next_y = np.minimum(at_x + 1, grid.width - 1), np.minimum(at_y + 1, grid.height - 1)

    def pixels(i: NDArray[np.int64], j: NDArray[np.int64]) -> Floats:
        with np.errstate(over="ignore"):
            stored = terrain.height(columns[i], rows[j]).astype(dtype)
        return np.asarray(stored, np.float64)

    south = (1 - part_x) * pixels(at_x, at_y) + part_x * pixels(next_x, at_y)
    north = (1 - part_x) * pixels(at_x, next_y) + part_x * pixels(next_x, next_y)
    off = np.abs((1 - part_y) * south + part_y * north - terrain.height(x, y))
    known = np.flatnonzero(np.isfinite(off))
    if not len(known):
        return None
    worst = known[off[known].argmax()]
    largest = float(off[worst])
    scaled = off[known] / largest if largest else off[known]
    return InterpolationError(
        points=len(known),
        largest=largest,
        rms=largest * float(np.sqrt(np.mean(scaled**2))),
        x=float(x[worst]),
        y=float(y[worst]),
        element=terrain.locate(x[worst], y[worst]),
    )


def _points(terrain: Terrain, columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Points between the outermost centres, on the terrain."""
    west, south, east, north = terrain.bounds
    low_x, high_x = max(west, columns[0]), min(east, columns[-1])
    low_y, high_y = max(south, rows[0]), min(north, rows[-1])
    half = min(POINTS, 4 * len(columns) * len(rows)) // 2
    steps = np.arange(1, half + 1)
    x = low_x + np.mod(steps / _PLASTIC, 1.0) * (high_x - low_x)
    y = low_y + np.mod(steps / _PLASTIC**2, 1.0) * (high_y - low_y)
    left, bottom, right, top = terrain.cells()
    middle_x, middle_y = left + (right - left) / 2, bottom + (top - bottom) / 2
    inside = np.flatnonzero(
        (low_x <= middle_x) & (middle_x <= high_x) & (low_y <= middle_y) & (middle_y <= high_y)
    )
    if len(inside) > half:
        inside = inside[np.arange(half) * len(inside) // half]
    return np.concatenate([x, middle_x[inside]]), np.concatenate([y, middle_y[inside]])


def _between(centres: Floats, at: Floats) -> tuple[NDArray[np.int64], Floats]:
    """The last centre at or before each place, and how far on to the next it is, from 0 to 1."""
    i = np.clip(np.searchsorted(centres, at, side="right") - 1, 0, max(0, len(centres) - 2))
    if len(centres) == 1:
        return i, np.zeros(len(at))
    gap = centres[i + 1] - centres[i]
    part = np.divide(at - centres[i], gap, out=np.zeros(len(at)), where=gap > 0)
    return i, np.clip(part, 0.0, 1.0)
