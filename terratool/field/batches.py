"""Large batches on large fields: points are visited place by place, so the field stays cached."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.field.types import FieldArrays
from terratool.kernels import field as kernels

CHUNK = 1 << 21

SMALL_FIELD = 1 << 20
"""A field of fewer bytes stays in the cache anyway."""

_SMALL_BATCH = 1 << 13


def batch_heights(
    arrays: FieldArrays, field: kernels.Field, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heights at points: `x`, `y` and the answer are (n,) float64."""
    out = np.empty(len(x))
    if arrays.busy_nbytes < SMALL_FIELD or len(x) < _SMALL_BATCH:
        kernels.heights(field, x, y, out)
        return out
    size = min(CHUNK, len(x))
    order = np.empty(size, np.int64)
    sorted_x, sorted_y, heights = np.empty(size), np.empty(size), np.empty(size)
    for begin in range(0, len(x), size):
        part = slice(begin, begin + size)
        count = len(x[part])
        by_place = order[:count], sorted_x[:count], sorted_y[:count]
        kernels.sort_by_place(x[part], y[part], arrays.bounds, *by_place)
        kernels.heights(field, *by_place[1:], heights[:count])
        out[part][by_place[0]] = heights[:count]
    return out
