"""Loops over pixels."""

from __future__ import annotations

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)


@kernel
def first_number(pixels):
    """The first of `pixels`, (height, width), that is not NaN; 0 if there is none."""
    for r in range(pixels.shape[0]):
        for value in pixels[r]:
            if value == value:
                return float(value)
    return 0.0


@kernel
def gather_row(values, shift, count, low, high, total, square):
    """Add a row to the statistics of each column; vector instructions without reordering sums."""
    for n in range(len(values)):
        value = float(values[n])
        valid = value == value
        above = value - shift if valid else 0.0
        count[n] += 1.0 if valid else 0.0
        low[n] = value if value < low[n] else low[n]
        high[n] = value if value > high[n] else high[n]
        total[n] += above
        square[n] += above * above


@kernel
def gather(pixels, shift, sums):
    """Statistics by column of `pixels`, (height, width), into `sums`, modulo its width.

    `sums` is (5, width) float64: number, least, greatest, and the sums of what is above `shift` and
    of its squares.
    """
    width = sums.shape[1]
    for column in range(0, pixels.shape[1], width):
        for r in range(pixels.shape[0]):
            values = pixels[r, column : column + width]
            gather_row(values, shift, sums[0], sums[1], sums[2], sums[3], sums[4])
