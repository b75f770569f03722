"""Blocks of cells in one grid: which overlap, and what they cover together."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Sequence
from heapq import heappop, heappush

Block = tuple[int, int, int, int]
"""First column, first row, columns, rows."""


def overlaps(blocks: Sequence[Block]) -> list[tuple[int, int]]:
    """Pairs (later, earlier) of blocks that share a cell, sorted.

    Each block is named as the later one at most once, and those that are not share no cell. A line
    sweeps over the columns, with those blocks on it that overlap no other so far: n log n steps,
    however large the blocks are.
    """
    found = []
    line: list[tuple[int, int]] = []  # first row and index, in order
    ends: list[tuple[int, int]] = []  # column where a block ends, and its index
    for index in sorted(range(len(blocks)), key=lambda index: blocks[index][0]):
        x, y, width, height = blocks[index]
        while ends and ends[0][0] <= x:
            _, over = heappop(ends)
            at = bisect_left(line, (blocks[over][1], over))
            if line[at : at + 1] == [(blocks[over][1], over)]:  # not taken off before
                del line[at]
        first = bisect_left(line, (y, -1))
        if first and y < line[first - 1][0] + blocks[line[first - 1][1]][3]:
            first -= 1
        last = bisect_left(line, (y + height, -1))
        sharing = [other for _, other in line[first:last]]
        earliest = min(sharing, default=index)
        if earliest < index:
            found.append((index, earliest))
            continue
        found += [(other, index) for other in sharing]
        del line[first:last]
        insort(line, (y, index))
        heappush(ends, (x + width, index))
    return sorted(found)


def cover(blocks: Sequence[Block], target: Block) -> bool:
    """Whether blocks together cover another; time about quadratic in their number."""
    x, y, width, height = target
    near = sorted(
        (low, low + high, left, left + wide)
        for left, low, wide, high in blocks
        if left < x + width and x < left + wide and low < y + height and y < low + high
    )
    edges = {x, *(edge for block in near for edge in block[2:] if x < edge < x + width)}
    for edge in edges:
        reached = y
        for low, high, left, right in near:
            if left <= edge < right:
                if low > reached:
                    return False
                if high > reached:
                    reached = high
        if reached < y + height:
            return False
    return True
