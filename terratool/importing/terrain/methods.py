"""Ways of writing a DEM as elements, and which of them is the smallest when compressed.

All of them are linear between the centres of pixels along x and y, so that the sum is bilinear
there, as the DEM between its pixels is said to be; in the outer half pixel the nearest centre's
height goes on. The elements lie in a grid of half pixels, whose corners are the pixels' corners and
centres.

Rows: an element carries one row of pixels. Every `spacing`-th row stands by itself (it is nodal):
its element is a tent over the rows up to the neighbouring nodal ones. Every other row is midway
between two that came before, and its element adds what it differs from their mean.

Hats: an element is a tent along x and y at one pixel, coarse ones first. A hat stands where the DEM
differs by more than half a step from what the coarser ones make of it, so that flat and smooth
ground costs nothing.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import ROUND_FLOOR, Decimal
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.importing.terrain.writing import (
    Chunk,
    ElementText,
    SizeCounter,
    Spool,
    Writer,
    WrittenRows,
    curve,
    element,
)
from terratool.kernels import importing as kernels

BLOCK = 64
"""Rows that are worked on at a time."""

_FEW = 16
"""So many zeros at the ends of a row, and a quarter of it, are written rather than left out."""

_HAT_BYTES = 6
"""A hat takes about so many bytes when compressed, or more."""

_MARGIN = 1e-3
"""Of the error, left for the rounding of sums."""

_DIGITS = 3
_FINEST = 2.0**-48
"""An error below this part of the largest height drowns in the rounding of doubles."""

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

Read = Callable[[int, int], Floats]
"""Rows from a first one on, a number of them, (count, columns) float64."""


@dataclass(frozen=True, slots=True)
class Method:
    """A way of writing a DEM.

    Attributes:
        kind: "rows", "columns" or "hats".
        spacing: from one nodal row to the next; 1 if all are.
    """

    kind: str
    spacing: int = BLOCK

    @property
    def sentence(self) -> str:
        """In words."""
        if self.kind == "hats":
            return "sparse hats"
        return f"nodal {self.kind}" if self.spacing == 1 else f"hierarchical {self.kind}"


METHODS = (
    Method("rows"), Method("rows", 16), Method("rows", 1),
    Method("columns"), Method("columns", 16), Method("columns", 1),
    Method("hats"),
)  # fmt: skip


def methods_named(name: str) -> tuple[Method, ...]:
    """The methods of a name: rows, columns, nodal-rows, nodal-columns or hats."""
    kind = name.removeprefix("nodal-")
    return tuple(
        method
        for method in METHODS
        if method.kind == kind and (method.spacing == 1) == (name != kind)
    )


@dataclass(frozen=True, slots=True)
class Rounding:
    """What heights are rounded to: whole steps above a base."""

    step: float
    base: float


def step_for(max_error: float, highest: float) -> float:
    """The largest number of three digits that heights may be rounded to within an error.

    Heights that are exported as single precision stay within the error, too, where that can hold
    them that exactly.

    Args:
        max_error: in units of the heights.
        highest: the largest height in size.

    Raises:
        RequestError: no error above 0, or one that doubles cannot keep at such heights.
    """
    if not (math.isfinite(max_error) and max_error > 0):
        raise RequestError(
            f"The largest error is {max_error:g}.", "Give a number above 0 with --max-error."
        )
    if max_error < _FINEST * highest:
        raise RequestError(
            f"Heights of {highest:g} cannot be told apart to {max_error:g}.",
            f"Give an error of {_FINEST * highest:.1g} or more with --max-error.",
        )
    single = math.ulp(highest) * 2.0**28  # half a unit in the last place of a float32
    room = max_error * (1 - _MARGIN)
    if single < max_error / 2:
        room -= single
    exact = Decimal(2 * room)
    digit = Decimal(1).scaleb(exact.adjusted() - _DIGITS + 1)
    return float(exact.quantize(digit, rounding=ROUND_FLOOR))


def cuts(rows: int, size: int) -> list[int]:
    """Rows at which blocks end: the multiples of `size`, then ever smaller powers of two."""
    at = [0]
    while at[-1] < rows - 1:
        rest = rows - 1 - at[-1]
        at.append(at[-1] + min(size, 1 << (rest.bit_length() - 1)))
    return at


def support(row: int, nodal: list[int], rows: int) -> tuple[str, int, int]:
    """The curve of a nodal row across the rows, and the half pixels where it begins and ends."""
    place = bisect_left(nodal, row)
    middle = 2 * row + 1
    begin = 2 * nodal[place - 1] + 1 if place else 0
    end = 2 * nodal[place + 1] + 1 if place + 1 < len(nodal) else 2 * rows
    before, behind = middle - begin, end - middle
    south, north = int(place == 0), int(place + 1 == len(nodal))
    if south and north:
        text = '"flat"'
    elif before == behind and not south and not north:
        text = '"tent"'
    else:
        text = f"[[0,{south}],[{before / (before + behind)!r},1],[1,{north}]]"
    return text, begin, end


# --- rows ----------------------------------------------------------------------------------------


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

    def text(self, transposed: bool, step: float) -> ElementText:
        """Primitive and element; with x and y exchanged if `transposed`."""
        curves, cell, span = (self.x, self.y), self.cell, self.span
        if transposed:
            curves, cell, span = curves[::-1], cell[::-1], span[::-1]
        members = [
            b'"%s":%s' % (axis, curve(values))
            for axis, values in zip((b"x", b"y"), curves, strict=True)
            if values is not None
        ]
        primitive = b'"%s":{%s}' % (self.name.encode(), b",".join(members))
        return ElementText(primitive, element(self.name, cell, span, vScale=step))


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


def write_rows(
    writer: Writer,
    read: Read,
    shape: tuple[int, int],
    method: Method,
    rounding: Rounding,
    check: Callable[[Chunk], object] | None = None,
) -> WrittenRows:
    """Write a DEM by rows, or by columns.

    Args:
        writer: what is written to.
        read: the DEM by rows; by columns, if these are to be written.
        shape: how many rows, and columns of them.
        method: how.
        rounding: of the heights.
        check: gets each block before it is written.
    """
    rows, columns = shape
    nodal = cuts(rows, method.spacing)
    ends, counts = np.empty((2, rows)), np.zeros((2, rows), np.int64)
    transposed = method.kind == "columns"
    above = heights = None
    # neighbouring blocks share a row
    for first, last in reversed(list(pairwise(cuts(rows, BLOCK))) or [(0, 0)]):
        # the block to the north has read the row that both have
        new = read(first, last - first + (heights is None))
        heights = new if heights is None else np.concatenate([new, heights[:1]])
        block = _round_block(heights, first, method.spacing, rounding, above)
        entries = _row_elements(block, nodal, rows)
        chunk = Chunk(first, heights, [entry.text(transposed, rounding.step) for entry in entries])
        if check:
            check(chunk)
        writer.beyond |= bool(block.counts.min() < 0 or block.counts.max() > 1)
        shared = b'"%d"' % last  # the row that the block to the north has written
        writer.write(
            *(t for t in chunk.texts if above is None or not t.primitive.startswith(shared))
        )
        ends[:, first : last + 1] = block.levels[:, [0, -1]].T
        counts[:, first : last + 1] = block.counts[:, [0, -1]].T
        above = block.counts[0]
    outer = [
        entry.text(transposed, rounding.step)
        for entry in _outer_elements(counts, nodal, method.spacing, columns)
    ]
    writer.write(*outer)
    return WrittenRows(ends, outer)


def _round_block(
    heights: Floats, first: int, spacing: int, rounding: Rounding, above: Ints | None
) -> RowBlock:
    """Round a block of rows.

    Args:
        heights: (rows, columns), NaN where unknown.
        first: the southernmost row.
        spacing: from one nodal row to the next; a power of two.
        rounding: of the heights.
        above: what was counted in the last row, if that is known of the block to the north.
    """
    size = max(1, min(spacing, len(heights) - 1))
    counts, levels = np.empty(heights.shape, np.int64), np.empty(heights.shape)
    kernels.round_rows(
        np.ascontiguousarray(heights), size, rounding.step, rounding.base, above, counts, levels
    )
    return RowBlock(first, size, counts, levels)


def _row_elements(block: RowBlock, nodal: list[int], rows: int) -> Iterator[RowElement]:
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
        counts = block.counts[row]
        filled = np.flatnonzero(counts)
        # zeros at the ends are left out, but for one
        first, last = max(0, int(filled[0]) - 1), min(len(counts) - 1, int(filled[-1]) + 1)
        if len(counts) - (last - first) <= _FEW + len(counts) // 4:
            first, last = 0, len(counts) - 1
        cell, span = (2 * first + 1, begin), (2 * (last - first), end - begin)
        return RowElement(str(block.first + row), counts[first : last + 1], y, cell, span)

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


def _outer_elements(
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
        heights = numbers[nodal].tolist()
        if len(set(np.diff(nodal).tolist())) == 1:
            span = (1, 2 * (rows - 1))
            if any(heights):
                yield RowElement(side, None, numbers[nodal], (column, 1), span)
            # what lies beyond the outermost rows
            for name, height, row in (("s", heights[0], 0), ("n", heights[-1], 2 * rows - 1)):
                if height:
                    one = np.array([height])
                    yield RowElement(f"{side}-{name}", None, one, (column, row), (1, 1))
        elif any(heights):
            where = [(2 * row + 1) / (2 * rows) for row in nodal]
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


# --- hats ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class HatLevel:
    """Hats of one fineness.

    Attributes:
        rows, columns: ascending, the rows and columns of pixels at which hats may stand.
        counts: (len(rows), len(columns)) int64, steps that each is high.
    """

    rows: Ints
    columns: Ints
    counts: Ints


def hats_of(heights: Floats, rounding: Rounding) -> list[HatLevel]:
    """The hats that make a DEM, coarse ones first.

    Args:
        heights: (rows, columns), NaN where unknown; there they are what comes of the others.
        rounding: of the heights.
    """
    axes = [np.array(cuts(count, BLOCK)) for count in heights.shape]
    levels = np.full([len(axis) for axis in axes], rounding.base)
    fresh = np.ones(levels.shape, bool)
    found = []
    size = BLOCK
    while True:
        known = heights[np.ix_(*axes)]
        counts = np.where(fresh & ~np.isnan(known), np.rint((known - levels) / rounding.step), 0.0)
        levels += counts * rounding.step
        found.append(HatLevel(axes[0], axes[1], counts.astype(np.int64)))
        if size == 1:
            return found
        size //= 2
        finer = [_halved(axis, size) for axis in axes]
        for axis in range(2):
            levels = _between(levels, axes[axis], finer[axis], axis)
        old = [np.isin(new, axis) for new, axis in zip(finer, axes, strict=True)]
        fresh = ~np.logical_and.outer(*old)
        axes = finer


def hat_texts(levels: list[HatLevel], shape: tuple[int, int], step: float) -> Iterator[ElementText]:
    """The hats that are not 0 high as text.

    Args:
        levels: the hats, coarse ones first.
        shape: rows and columns of the DEM.
        step: what heights were rounded to.

    Yields:
        A primitive, empty where it came before, or one element or several with commas between.
    """
    names: dict[tuple[str, str], bytes] = {}
    for level in levels:
        rows, columns = level.rows.tolist(), level.columns.tolist()
        ys = [support(row, rows, shape[0]) for row in rows]
        xs = [support(column, columns, shape[1]) for column in columns]
        for row in np.flatnonzero(level.counts.any(axis=1)).tolist():
            y, south, north = ys[row]
            line: list[bytes] = []
            for column in np.flatnonzero(level.counts[row]).tolist():
                x, west, east = xs[column]
                if (x, y) not in names:
                    names[x, y] = b"hat-%d" % (len(names) + 1) if names else b"hat"
                    members = (names[x, y], x.encode(), y.encode())
                    yield ElementText(b'"%s":{"x":%s,"y":%s}' % members, b"")
                height = int(level.counts[row, column]) * step
                line.append(
                    b'{"type":"%s","cellX":%d,"cellY":%d,"span":[%d,%d],"vScale":%.15g}'
                    % (names[x, y], west, south, east - west, north - south, height)
                )
            yield ElementText(b"", b",\n".join(line))


def _halved(axis: Ints, size: int) -> Ints:
    """Positions with the middles of all gaps wider than `size`."""
    wide = np.flatnonzero(np.diff(axis) > size)
    return np.insert(axis, wide + 1, (axis[wide] + axis[wide + 1]) // 2)


def _between(levels: Floats, old: Ints, new: Ints, axis: int) -> Floats:
    """Levels at new positions along an axis, linear between those at the old ones."""
    place = np.clip(np.searchsorted(old, new, side="right") - 1, 0, max(0, len(old) - 2))
    after = np.minimum(place + 1, len(old) - 1)
    gap = np.maximum(old[after] - old[place], 1)
    share = ((new - old[place]) / gap).reshape((-1, 1) if axis == 0 else (1, -1))
    return np.asarray(
        np.take(levels, place, axis) * (1 - share) + np.take(levels, after, axis) * share
    )


# --- sizes ---------------------------------------------------------------------------------------


def smallest(
    parts: list[Floats], rounding: Rounding, methods: tuple[Method, ...] = METHODS
) -> Method:
    """The method by which parts of a DEM take the fewest bytes when compressed.

    Args:
        parts: (rows, columns) each, row 0 the southernmost, NaN where unknown.
        rounding: of the heights.
        methods: those to try.
    """
    best, fewest = methods[0], -1
    for method in methods:
        size = sum(size_of(part, method, rounding, fewest) for part in parts)
        if fewest < 0 or size < fewest:
            best, fewest = method, size
    return best


def size_of(heights: Floats, method: Method, rounding: Rounding, most: int = -1) -> int:
    """Bytes that a DEM takes when compressed; for hats at least, if that is more than `most`."""
    counter = SizeCounter()
    writer = Writer(counter, {"size": 1})
    rows, columns = heights.shape
    if method.kind == "hats":
        levels = hats_of(heights, rounding)
        least = _HAT_BYTES * sum(int(np.count_nonzero(level.counts)) for level in levels)
        if 0 <= most < least:
            return least
        writer.write(*hat_texts(levels, (rows, columns), rounding.step))
    else:
        part = np.ascontiguousarray(heights.T) if method.kind == "columns" else heights
        write_rows(writer, rows_of(part), (part.shape[0], part.shape[1]), method, rounding)
    root = {"type": "flat", "vScale": rounding.base, "cells": [2 * columns, 2 * rows]}
    writer.finish({}, root, Spool())
    return counter.size


def rows_of(heights: Floats) -> Read:
    """What reads rows of an array."""
    return lambda first, count: heights[first : first + count]
