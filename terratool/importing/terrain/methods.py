"""Which way of writing a DEM is the smallest when compressed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrain.hats import hats_of, texts_of
from terratool.importing.terrain.rows import (
    BLOCK,
    RowElement,
    blocks_of,
    cuts,
    entries,
    outer_elements,
    round_block,
)
from terratool.importing.terrain.writing import Counter, Elements, Writer, element, primitive

Floats = NDArray[np.float64]
Read = Callable[[int, int], Floats]
"""Rows from a first one on, a number of them, (count, columns) float64."""

_HAT_BYTES = 6
"""A hat takes about so many bytes when compressed, or more."""


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


def named(name: str) -> tuple[Method, ...]:
    """The methods of a name: rows, columns, nodal-rows, nodal-columns or hats."""
    kind = name.removeprefix("nodal-")
    return tuple(
        method
        for method in METHODS
        if method.kind == kind and (method.spacing == 1) == (name != kind)
    )


@dataclass(frozen=True, slots=True)
class Chunk:
    """A block of rows as text, and what it was made of.

    Attributes:
        first: the southernmost row.
        heights: (rows, columns) float64, what was asked for.
        texts: primitive and element of each row.
    """

    first: int
    heights: Floats
    texts: list[tuple[bytes, bytes]]


Check = Callable[[Chunk], object]


def write_rows(
    writer: Writer,
    read: Read,
    shape: tuple[int, int],
    method: Method,
    step: float,
    base: float,
    check: Check | None = None,
) -> tuple[Floats, list[tuple[bytes, bytes]]]:
    """Write a DEM by rows, or by columns.

    Args:
        writer: what is written to.
        read: the DEM by rows; by columns, if these are to be written.
        shape: how many rows, and columns of them.
        method: how.
        step: what heights are rounded to.
        base: the height without any element.
        check: gets each block before it is written.

    Returns:
        (2, rows) float64, the heights of the first and of the last column, and what carries them
        on over the outer half pixels: primitives and elements, written already.
    """
    rows, columns = shape
    nodal = cuts(rows, method.spacing)
    levels, counts = np.empty((2, rows)), np.zeros((2, rows), np.int64)
    turned = method.kind == "columns"
    above = None
    heights = None
    for first, last in reversed(blocks_of(rows)):
        # the block to the north has read the row that both have
        new = read(first, last - first + (heights is None))
        heights = new if heights is None else np.concatenate([new, heights[:1]])
        block = round_block(heights, first, method.spacing, step, base, above)
        chunk = Chunk(first, heights, list(_texts(entries(block, nodal, rows), turned, step)))
        if check:
            check(chunk)
        writer.beyond |= bool(block.counts.min() < 0 or block.counts.max() > 1)
        for text in chunk.texts:
            if above is None or not text[0].startswith(b'"%d"' % last):
                writer.pair(text)
        levels[:, first : last + 1] = block.levels[:, [0, -1]].T
        counts[:, first : last + 1] = block.counts[:, [0, -1]].T
        above = block.counts[0]
    beyond = list(_texts(outer_elements(counts, nodal, method.spacing, columns), turned, step))
    for text in beyond:
        writer.pair(text)
    return levels, beyond


def _texts(some: Iterator[RowElement], turned: bool, step: float) -> Iterator[tuple[bytes, bytes]]:
    for entry in some:
        one = entry.turned() if turned else entry
        yield primitive(one), element(one.name, one.cell, one.span, vScale=step)


def smallest(
    parts: list[Floats], step: float, base: float, methods: tuple[Method, ...] = METHODS
) -> Method:
    """The method by which parts of a DEM take the fewest bytes when compressed.

    Args:
        parts: (rows, columns) each, row 0 the southernmost, NaN where unknown.
        step: what heights are rounded to.
        base: the height without any element.
        methods: those to try.
    """
    best, fewest = methods[0], -1
    for method in methods:
        size = sum(size_of(part, method, step, base, fewest) for part in parts)
        if fewest < 0 or size < fewest:
            best, fewest = method, size
    return best


def size_of(heights: Floats, method: Method, step: float, base: float, most: int = -1) -> int:
    """Bytes that a DEM takes when compressed; for hats at least, if that is more than `most`."""
    counter = Counter()
    writer = Writer(counter, {"size": 1})
    rows, columns = heights.shape
    if method.kind == "hats":
        some = hats_of(heights, step, base)
        least = _HAT_BYTES * sum(int(np.count_nonzero(level.counts)) for level in some)
        if 0 <= most < least:
            return least
        for text in texts_of(some, (rows, columns), step):
            writer.pair(text)
    else:
        part = np.ascontiguousarray(heights.T) if method.kind == "columns" else heights
        read = rows_of(part)
        write_rows(writer, read, (part.shape[0], part.shape[1]), method, step, base)
    writer.finish(
        {}, {"type": "flat", "vScale": base, "cells": [2 * columns, 2 * rows]}, Elements()
    )
    return counter.size


def rows_of(heights: Floats) -> Read:
    """What reads rows of an array."""
    return lambda first, count: heights[first : first + count]
