"""Rows: a DEM as elements that each carry one row of pixels, exact at the pixels.

Every `spacing`-th row stands by itself (it is nodal): its element is a tent over the rows up to the
neighbouring nodal ones. Every other row is midway between two that came before, and its element
adds what it differs from their mean. All of them are linear between the centres of pixels along x
and y, so that the sum is bilinear there, as the DEM between its pixels is said to be. In the outer
half pixel the nearest centre's height goes on.

The elements lie in a grid of half pixels, whose corners are the pixels' corners and centres.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import importing as kernels

BLOCK = 64
"""Rows that are worked on at a time."""

_FEW = 16
"""So many zeros at the ends of a row, and a quarter of it, are written rather than left out."""

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RowElement:
    """One element with a primitive of its own, but for its scale, which all share.

    Attributes:
        name: of the primitive.
        x, y: its curves; whole numbers, or JSON; None for 1 everywhere.
        cell, span: columns and rows of half pixels.
    """

    name: str
    x: Ints | str | None
    y: Ints | str | None
    cell: tuple[int, int]
    span: tuple[int, int]

    def turned(self) -> RowElement:
        """The same with x and y exchanged."""
        return RowElement(self.name, self.y, self.x, self.cell[::-1], self.span[::-1])


@dataclass(frozen=True, slots=True)
class RowBlock:
    """Some rows, rounded.

    Attributes:
        first: the southernmost row.
        spacing: from one nodal row to the next.
        counts: (rows, columns) int64, steps above the base, or above the mean of two other rows.
        levels: (rows, columns) float64, the heights that come of it.
    """

    first: int
    spacing: int
    counts: Ints
    levels: Floats


def cuts(rows: int, size: int) -> list[int]:
    """Rows at which blocks end: the multiples of `size`, then ever smaller powers of two."""
    at = [0]
    while at[-1] < rows - 1:
        rest = rows - 1 - at[-1]
        at.append(at[-1] + min(size, 1 << (rest.bit_length() - 1)))
    return at


def blocks_of(rows: int) -> list[tuple[int, int]]:
    """First and last row of each block, from the south; neighbours share a row."""
    return list(pairwise(cuts(rows, BLOCK))) or [(0, 0)]


def round_block(
    heights: Floats, first: int, spacing: int, step: float, base: float, above: Ints | None
) -> RowBlock:
    """Round a block of rows.

    Args:
        heights: (rows, columns), NaN where unknown.
        first: the southernmost row.
        spacing: from one nodal row to the next; a power of two.
        step: what is rounded to.
        base: where counting begins.
        above: what was counted in the last row, if that is known of the block to the north.
    """
    size = max(1, min(spacing, len(heights) - 1))
    counts, levels = np.empty(heights.shape, np.int64), np.empty(heights.shape)
    kernels.round_rows(np.ascontiguousarray(heights), size, step, base, above, counts, levels)
    return RowBlock(first, size, counts, levels)


def entries(block: RowBlock, nodal: list[int], rows: int) -> Iterator[RowElement]:
    """The elements of a block's rows that are not zero, the last row's included.

    Args:
        block: the rows.
        nodal: all nodal rows of the DEM, ascending.
        rows: how many rows the DEM has.
    """
    last = len(block.counts) - 1
    if block.counts.shape[1] == 1:
        return  # there is nothing between the outer half pixels

    def entry(row: int, y: str, begin: int, end: int) -> RowElement:
        name, counts = str(block.first + row), block.counts[row]
        filled = np.flatnonzero(counts)
        # zeros at the ends are left out, but for one
        first, last = max(0, filled[0] - 1), min(len(counts) - 1, filled[-1] + 1)
        if len(counts) - (last - first) <= _FEW + len(counts) // 4:
            first, last = 0, len(counts) - 1
        span = (2 * int(last - first), end - begin)
        return RowElement(name, counts[first : last + 1], y, (2 * int(first) + 1, begin), span)

    filled = np.asarray(block.counts.any(axis=1))
    for row in range(0, last + 1, block.spacing):
        if filled[row]:
            yield entry(row, *support(block.first + row, nodal, rows))
    size = block.spacing
    while size >= 2:
        for row in range(size // 2, last, size):
            if filled[row]:
                middle = 2 * (block.first + row) + 1
                yield entry(row, '"tent"', middle - size, middle + size)
        size //= 2


def support(row: int, nodal: list[int], rows: int) -> tuple[str, int, int]:
    """The curve of a nodal row across the rows, and the half pixels where it begins and ends."""
    place = bisect_left(nodal, row)
    middle = 2 * row + 1
    begin = 2 * nodal[place - 1] + 1 if place else 0
    end = 2 * nodal[place + 1] + 1 if place + 1 < len(nodal) else 2 * rows
    before, behind = middle - begin, end - middle
    south, north = int(place == 0), int(place + 1 == len(nodal))
    if south and north:
        curve = '"flat"'
    elif before == behind and not south and not north:
        curve = '"tent"'
    else:
        curve = f"[[0,{south}],[{before / (before + behind)!r},1],[1,{north}]]"
    return curve, begin, end


def outer_elements(
    counts: Ints, nodal: list[int], spacing: int, columns: int
) -> Iterator[RowElement]:
    """The elements of the outer half pixels to the west and to the east.

    Args:
        counts: (2, rows) int64, of the first and of the last column.
        nodal: all nodal rows.
        spacing: from one nodal row to the next, at most.
        columns: how many columns the DEM has.
    """
    rows = counts.shape[1]
    for side, numbers, column in zip("we", counts, (0, 2 * columns - 1), strict=True):
        where = [(2 * row + 1) / (2 * rows) for row in nodal]
        heights = [int(numbers[row]) for row in nodal]
        even = len(set(np.diff(nodal).tolist())) == 1
        if even:
            span = (1, 2 * (rows - 1))
            ends = (f"{side}-s", heights[0], 0), (f"{side}-n", heights[-1], 2 * rows - 1)
            if any(heights):
                yield RowElement(side, None, numbers[nodal], (column, 1), span)
            for name, height, row in ends:  # what lies beyond the outermost rows
                if height:
                    yield RowElement(name, None, np.array([height]), (column, row), (1, 1))
        elif any(heights):
            knots = [(0.0, heights[0]), *zip(where, heights, strict=True), (1.0, heights[-1])]
            text = ",".join(f"[{t!r},{z}]" for t, z in knots)
            yield RowElement(side, None, f"[{text}]", (column, 0), (1, 2 * rows))
        size = spacing
        while size >= 2:
            end = max((b for a, b in pairwise(nodal) if b - a >= size), default=0)
            between = np.zeros(2 * end // size + 1, np.int64)
            between[1::2] = numbers[size // 2 : end : size]
            if between.any():
                yield RowElement(f"{side}-{size}", None, between, (column, 1), (1, 2 * end))
            size //= 2
