"""Kernels that fit the named curves to a profile of differences."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

FLAT, RAMP, FALL, TENT, COS, COSBELL, DOME, GAUSS, RISE, SINK = range(10)
"""The curves that are known: `FALL` and `SINK` are the ramp and the smoothstep from 1 to 0."""

LAST = SINK
LOOSE = 4.0
"""How many tolerances a value may be off to take part in finding the scale."""

CLEAR = 0.9
"""A curve must fit so much better than it does in any other cell, in gaps that do not fit."""

kernel = njit(cache=True, nogil=True, error_model="numpy")


@kernel
def curve(code, t):
    """Value of a known curve at t; 0 where t is not in [0, 1)."""
    if t < 0.0 or t >= 1.0:
        return 0.0
    if code == FLAT:
        return 1.0
    if code == RAMP:
        return t
    if code == FALL:
        return 1.0 - t
    if code == TENT:
        return 1.0 - abs(2.0 * t - 1.0)
    if code == COS:
        return math.cos(math.pi * (t - 0.5))
    if code == COSBELL:
        return 0.5 - 0.5 * math.cos(2.0 * math.pi * t)
    if code == DOME:
        return math.sqrt(max(0.0, 1.0 - (2.0 * t - 1.0) ** 2))
    if code == GAUSS:
        return math.exp(-18.0 * (t - 0.5) ** 2)
    rise = t * t * (3.0 - 2.0 * t)
    return rise if code == RISE else 1.0 - rise


@kernel
def fill(code, t, out):
    """Write the values of a known curve at `t`, (n,) float64, into `out`."""
    for i in range(len(t)):
        out[i] = curve(code, t[i])


@kernel
def step(code, begin, end, gap):
    """Difference of a curve's values at the centres of the pixels `gap` + 1 and `gap`.

    Args:
        code: the curve.
        begin: where its cell begins, in half pixels.
        end: where it ends.
        gap: index of the first of the two pixels.
    """
    length = float(end - begin)
    west = curve(code, (2 * gap + 1 - begin) / length)
    return curve(code, (2 * gap + 3 - begin) / length) - west


@kernel
def misfit(found, valid, tolerance, pivot, code, begin, end):
    """How badly a curve fits over its cell and two gaps beyond, and over how many gaps.

    The sum of squared errors in tolerances, each at most 1, over what is valid; a count of 0 where
    the curve does not fit at all.
    """
    at_pivot = step(code, begin, end, pivot)
    if at_pivot == 0.0:
        return 0.0, 0
    first = max(0, begin // 2 - 3)
    last = min(len(found) - 1, end // 2 + 2)
    scale = found[pivot] / at_pivot
    for i in range(max(first, pivot - 2), min(last, pivot + 2) + 1):
        # next to the pivot nothing may be wrong: most curves need not be looked at further
        if valid[i]:
            miss = found[i] - scale * step(code, begin, end, i)
            if abs(miss) > LOOSE * tolerance[i]:
                return 0.0, 0
    for _ in range(2):
        above = below = 0.0
        for i in range(first, last + 1):
            if valid[i]:
                one = step(code, begin, end, i)
                if abs(found[i] - scale * one) <= LOOSE * tolerance[i]:
                    above += found[i] * one
                    below += one * one
        if below == 0.0:
            return 0.0, 0
        scale = above / below
    total, count = 0.0, 0
    for i in range(first, last + 1):
        if valid[i]:
            miss = (found[i] - scale * step(code, begin, end, i)) / tolerance[i]
            total += min(1.0, miss * miss)
            count += 1
    if count < 3 or 3 * count < last - first + 1:
        return 0.0, 0
    return total, count


@kernel
def best_fit(found, valid, tolerance, pivot, begins, ends, good):
    """The curve and cell that fit a profile of differences best, if none other fits as well.

    Args:
        found: (n,) float64 differences between neighbouring pixels, to a common factor.
        valid: (n,) bool, which of them are to be believed.
        tolerance: (n,) float64, how far they may be off.
        pivot: a gap that belongs to the curve.
        begins: (k,) int64, where the cell may begin, in half pixels.
        ends: (m,) int64, where it may end.
        good: the largest mean misfit that counts as fitting.

    Returns:
        Curve, begin, end; the curve is -1 where none fits, and -2 where several do.
    """
    least, second = np.inf, np.inf
    best, best_begin, best_end = -1, 0, 0
    for begin in begins:
        for end in ends:
            if end - begin < 4:
                continue
            for code in range(RAMP, LAST + 1):
                total, count = misfit(found, valid, tolerance, pivot, code, begin, end)
                if count == 0 or total > good * count + 0.5:
                    continue
                if total < least:
                    if begin != best_begin or end != best_end:
                        second = least
                    least, best, best_begin, best_end = total, code, begin, end
                elif total < second and (begin != best_begin or end != best_end):
                    second = total
    if best >= 0 and second < least + CLEAR:
        return -2, best_begin, best_end
    return best, best_begin, best_end


@kernel
def least(mixed, row, column, down, across):
    """The least size of a difference and its neighbours; 0 where one lies outside.

    Args:
        mixed: (rows, columns) float64.
        row: where, along y.
        column: where, along x.
        down: neighbours to each side along y.
        across: neighbours to each side along x.
    """
    rows, columns = mixed.shape
    if row < down or column < across or row + down >= rows or column + across >= columns:
        return 0.0
    found = math.inf
    for j in range(row - down, row + down + 1):
        for i in range(column - across, column + across + 1):
            found = min(found, abs(mixed[j, i]))
    return found


@kernel
def strongest(mixed, down, across, block, best, at):
    """The place in each block of differences where `least` is largest, the first of equal ones.

    Args:
        mixed: (rows, columns) float64.
        down: neighbours to each side along y.
        across: neighbours to each side along x.
        block: side of a block.
        best: (blocks along y, blocks along x) float64, gets what it is there.
        at: (blocks along y, blocks along x, 2) int64, gets row and column.
    """
    rows, columns = mixed.shape
    best[:] = -1.0
    for row in range(rows):
        for column in range(columns):
            j, i = row // block, column // block
            if abs(mixed[row, column]) <= best[j, i]:
                continue
            strength = least(mixed, row, column, down, across)
            if strength > best[j, i]:
                best[j, i] = strength
                at[j, i] = row, column
