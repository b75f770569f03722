"""Numbers of grids of heights as arrays, and what they reach."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.records import FieldArrays

_PIECE = 1 << 20
"""Numbers that are looked at together; arrays of them stay in caches of processors."""

Numbers = NDArray[np.floating[Any]]


def grid_numbers(arrays: FieldArrays, kind: Any) -> Numbers:
    """Return the numbers of the grid of a kind, (rows, columns) from the north, float32 or float64.

    Void ones are NaN. The array shows the memory that the field has, or a mapped file.
    """
    raster = arrays.curves.rasters[kind["raster"]]
    if raster["file"] >= 0:
        return arrays.curves.mapped.numbers(raster["file"])
    columns, rows = map(int, raster["count"])
    first = int(raster["first"])
    return arrays.curves.heights[first : first + rows * columns].reshape(rows, columns)


def row_blocks(numbers: Numbers) -> Iterator[slice]:
    """Yield stretches of rows that hold some million numbers."""
    step = max(1, _PIECE // max(1, numbers.shape[1]))
    for row in range(0, len(numbers), step):
        yield slice(row, min(row + step, len(numbers)))


class Extremes(NamedTuple):
    """Rows from the north and columns of the least and the greatest number of a grid."""

    low: tuple[int, int]
    high: tuple[int, int]


def extremes(numbers: Numbers) -> Extremes | None:
    """Return where the least and the greatest of numbers stand; None where all are void."""
    low, high = np.inf, -np.inf
    rows_of = [slice(0), slice(0)]
    for rows in row_blocks(numbers):
        block = numbers[rows]
        least, most = np.fmin.reduce(block, None), np.fmax.reduce(block, None)
        if least < low:
            low, rows_of[0] = least, rows
        if most > high:
            high, rows_of[1] = most, rows
    if low > high:
        return None
    found = []
    for rows, z in zip(rows_of, (low, high), strict=True):
        row, column = np.unravel_index(np.argmax(numbers[rows] == z), numbers[rows].shape)
        found.append((rows.start + int(row), int(column)))
    return Extremes(*found)


def is_edged(numbers: Numbers) -> bool:
    """Whether some numbers on the rim of a grid are void, or other than 0."""
    rim = numbers[0], numbers[-1], numbers[:, 0], numbers[:, -1]
    return any(bool((side != 0.0).any()) for side in rim)
