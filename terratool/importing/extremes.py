"""A kernel that looks at heights once: how low, how high, how many are none."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def extremes(heights):
    """Look at (rows, columns) float64 heights; those that are infinite become NaN.

    Returns:
        Lowest and highest height, infinities where there is none; how many are NaN; how many of
        these were infinite.
    """
    low, high = np.inf, -np.inf
    unknown = infinite = 0
    for row in range(heights.shape[0]):
        for column in range(heights.shape[1]):
            height = heights[row, column]
            if abs(height) < np.inf:
                low = min(low, height)
                high = max(high, height)
                continue
            unknown += 1
            if height == height:
                infinite += 1
                heights[row, column] = np.nan
    return low, high, unknown, infinite
