"""Large batches on large fields: points are visited place by place, so the field stays cached."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from terratool.field import kernels
from terratool.field.types import Arrays

CHUNK = 1 << 21
SIDE = 64
"""Points of a chunk are sorted into SIDE × SIDE places."""

SMALL_FIELD = 1 << 20
"""A field of fewer bytes stays in the cache anyway."""

_SMALL_BATCH = 1 << 13


@njit(cache=True, nogil=True, error_model="numpy")
def sort_by_place(x, y, bounds, counts, order, sorted_x, sorted_y):
    """Counting sort of points by place: `order` is where each sorted point came from.

    `counts` is (SIDE² + 1,) scratch. Points outside go with those at the nearest edge.
    """
    per_x = SIDE / (bounds[2] - bounds[0])
    per_y = SIDE / (bounds[3] - bounds[1])
    counts[:] = 0
    for n in range(len(x)):
        counts[place(x[n], bounds[0], per_x) + SIDE * place(y[n], bounds[1], per_y) + 1] += 1
    for k in range(1, len(counts)):
        counts[k] += counts[k - 1]
    for n in range(len(x)):
        k = place(x[n], bounds[0], per_x) + SIDE * place(y[n], bounds[1], per_y)
        at = counts[k]
        counts[k] += 1
        order[at] = n
        sorted_x[at] = x[n]
        sorted_y[at] = y[n]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def place(coordinate, start, per):
    """Which of the SIDE strips along an axis; NaN goes to the first."""
    s = (coordinate - start) * per
    return int(min(s, SIDE - 1.0)) if s > 0.0 else 0


def batch_heights(
    arrays: Arrays, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heights at points: `x`, `y` and the answer are (n,) float64."""
    out = np.empty(len(x))
    scratch = arrays.scratch()
    if arrays.busy_nbytes < SMALL_FIELD or len(x) < _SMALL_BATCH:
        kernels.heights(arrays, x, y, scratch, out)
        return out
    size = min(CHUNK, len(x))
    counts = np.empty(SIDE * SIDE + 1, np.int64)
    order = np.empty(size, np.int64)
    sorted_x, sorted_y, heights = np.empty(size), np.empty(size), np.empty(size)
    for begin in range(0, len(x), size):
        part = slice(begin, begin + size)
        count = len(x[part])
        sort_by_place(x[part], y[part], arrays.bounds, counts, order, sorted_x, sorted_y)
        kernels.heights(arrays, sorted_x[:count], sorted_y[:count], scratch, heights[:count])
        out[part][order[:count]] = heights[:count]
    return out
