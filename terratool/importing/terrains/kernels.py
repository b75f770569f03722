"""Kernels that round heights to steps, and write whole numbers as text."""

from __future__ import annotations

import numpy as np
from numba import njit

_kernel = njit(cache=True, nogil=True, error_model="numpy")
_COMMA, _MINUS, _ZERO = 44, 45, 48
_SWATH = 64
"""Columns that are worked on at once, so that a band's columns stay in the cache."""


@_kernel
def round_row(heights, step, base, counts, levels):
    """Round one row to whole steps above `base`: (w,) int64 counts, float64 levels.

    Unknown heights take the nearest known one's to the west, else to the east; where none is known
    they keep what `counts` holds.
    """
    known = -1
    for i in range(len(heights)):
        if not np.isnan(heights[i]):
            counts[i] = np.int64(np.rint((heights[i] - base) / step))
            if known < 0:
                counts[:i] = counts[i]
            known = i
        elif known >= 0:
            counts[i] = counts[known]
    for i in range(len(heights)):
        levels[i] = base + counts[i] * step


@_kernel
def round_rows(heights, size, step, base, counts, levels, given):
    """Round a block of rows: every `size`-th by itself, the others against two that came before.

    Args:
        heights: (n + 1, w) float64, n a multiple of `size`; NaN for unknown.
        size: a power of two.
        step: what is rounded to.
        base: what the counts of rows by themselves begin at.
        counts: (n + 1, w) int64; gets how many steps a row lies above the base, or above the mean
            of the two rows that it is midway between, where unknown heights add nothing.
        levels: (n + 1, w) float64; gets the heights that come of it.
        given: whether the last row is in both already.
    """
    last = len(heights) - 1
    for row in range(last - size if given else last, -1, -size):
        if row < last:
            counts[row] = counts[row + size]  # what a row without any height takes
        round_row(heights[row], step, base, counts[row], levels[row])
    width = heights.shape[1]
    for west in range(0, width, _SWATH):
        east = min(width, west + _SWATH)
        distance = size
        while distance >= 2:
            half = distance // 2
            for row in range(half, last, distance):
                for i in range(west, east):
                    mean = (levels[row - half, i] + levels[row + half, i]) / 2
                    height = heights[row, i]
                    count = 0.0 if np.isnan(height) else np.rint((height - mean) / step)
                    counts[row, i] = np.int64(count)
                    levels[row, i] = mean + count * step
            distance = half


@_kernel
def write_integers(numbers, out):
    """Write int64 numbers with commas between them into uint8 `out`; returns how many bytes.

    `out` has room for 21 bytes a number.
    """
    at = 0
    digits = np.empty(20, np.uint8)
    for i in range(len(numbers)):
        if i:
            out[at] = _COMMA
            at += 1
        value = numbers[i]
        if value < 0:
            out[at] = _MINUS
            at += 1
            value = -value
        count = 0
        while value >= 10:
            digits[count] = _ZERO + value % 10
            value //= 10
            count += 1
        out[at] = _ZERO + value
        at += 1
        while count:
            count -= 1
            out[at] = digits[count]
            at += 1
    return at


@_kernel
def rectangles(classes, known, out):
    """Cut a raster of classes into rectangles: runs of rows, joined where they repeat below.

    Args:
        classes: (h, w) int64, negative for what is left out.
        known: (w,) int64, scratch.
        out: (n, 5) int64, gets column, row, width, height and class; n suffices for one per pixel.

    Returns:
        How many there are.
    """
    height, width = classes.shape
    count = 0
    known[:] = -1  # by its first column, the rectangle that ended in the row before
    for row in range(height):
        column = 0
        while column < width:
            value = classes[row, column]
            end = column + 1
            while end < width and classes[row, end] == value:
                end += 1
            if value >= 0:
                old = known[column]
                if (
                    old >= 0
                    and out[old, 1] + out[old, 3] == row
                    and out[old, 0] == column
                    and out[old, 2] == end - column
                    and out[old, 4] == value
                ):
                    out[old, 3] += 1
                else:
                    out[count] = column, row, end - column, 1, value
                    known[column] = count
                    count += 1
            column = end
    return count


@_kernel
def misfit(heights, ours, sums):
    """Compare heights with those of the field, (rows, columns) float64 both; NaN does not count.

    Args:
        heights: what is wanted.
        ours: what came about.
        sums: (2,) float64; gets the sum of squares added, and the largest difference.

    Returns:
        Row and column of the largest difference, and how many were compared; the row is -1 if
        none is larger than `sums` had, and -2 if a height is missing.
    """
    count = 0
    at = -1, -1
    for row in range(heights.shape[0]):
        for column in range(heights.shape[1]):
            height = heights[row, column]
            if np.isnan(height):
                continue
            apart = abs(height - ours[row, column])
            if not apart <= sums[1]:
                if np.isnan(apart):
                    return -2, column, count
                sums[1] = apart
                at = row, column
            sums[0] += apart * apart
            count += 1
    return at[0], at[1], count
