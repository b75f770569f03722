"""Blocks of cells in one grid: which overlap, and what they cover together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isqrt

Block = tuple[int, int, int, int]
"""First column, first row, columns, rows."""


def overlaps(blocks: Sequence[Block]) -> Iterator[tuple[int, int]]:
    """(later, earlier) for each block that shares a cell with an earlier one.

    A block that is named takes no part in what follows. Time and memory about linear: blocks are
    sorted into bins as large as a block on average.
    """
    area = sum(width * height for _, _, width, height in blocks)
    side = max(1, isqrt(area // max(1, len(blocks))))
    bins: dict[tuple[int, int], list[int]] = {}
    for index, (x, y, width, height) in enumerate(blocks):
        its = [
            (i, j)
            for i in range(x // side, (x + width - 1) // side + 1)
            for j in range(y // side, (y + height - 1) // side + 1)
        ]
        for other in (other for key in its for other in bins.get(key, ())):
            left, low, wide, high = blocks[other]
            if x < left + wide and left < x + width and y < low + high and low < y + height:
                yield index, other
                break
        else:
            for key in its:
                bins.setdefault(key, []).append(index)


def cover(blocks: Sequence[Block], target: Block) -> bool:
    """Whether blocks together cover another; time at most cubic in their number."""
    x, y, width, height = target
    near = [
        (left, low, left + wide, low + high)
        for left, low, wide, high in blocks
        if left < x + width and x < left + wide and low < y + height and y < low + high
    ]
    edges = sorted({x, x + width, *(e for b in near for e in (b[0], b[2]) if x < e < x + width)})
    for edge in edges[:-1]:
        reached = y
        for _, low, _, high in sorted(
            (b for b in near if b[0] <= edge < b[2]), key=lambda block: block[1]
        ):
            if low > reached:
                break
            reached = max(reached, high)
        if reached < y + height:
            return False
    return True
