"""Patches of the cells of a map: what stands over other ground is a patch of its own.

After Triebel, Pfaff and Burgard, Multi-Level Surface Maps for Outdoor Terrain Mapping and Loop
Closing, IROS 2006: a cell has a list of patches, each with a height, its variance, and a depth. A
reading that is farther than a gap from all patches of its cell starts one, and patches that are
closer become one. So a patch is a chain of readings none of which is farther than the gap from the
next one, whatever order they came in.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.sensing.fusion import Floats, Fusion, Ints

GAP = 0.5
"""Default gap, m."""


def chains(cell: Ints, low: Floats, high: Floats, gap: float) -> Ints:
    """Numbers of the patches of intervals of heights, (n,), ascending by cell and from below.

    Intervals of a cell are of one patch if the gap between them, or from each to the next of a
    chain, is no more than `gap`.

    Args:
        cell: (n,) cells of the intervals.
        low: (n,) their lower ends, m.
        high: (n,) their upper ends, m.
        gap: largest gap within a patch, m.
    """
    count = len(cell)
    order = np.lexsort((low, cell))
    cells = cell[order]
    begins = np.concatenate([[True], cells[1:] != cells[:-1]])[:count]
    # the highest end so far within the cell, found by ranks of ends
    ends, rank = np.unique(high[order], return_inverse=True)
    base = (np.cumsum(begins) - 1) * count
    reached = ends[np.maximum.accumulate(base + rank) - base]
    begins[1:] |= low[order][1:] - reached[:-1] > gap
    label = np.empty(count, np.int64)
    label[order] = np.cumsum(begins) - 1
    return label


class LevelPatches(NamedTuple):
    """Patches of the cells of a level, (p,) each, ascending by cell and from below.

    Attributes:
        cell: int64 index of the cell.
        storey: int64 number of the patch in its cell, 0 for the lowest.
        seen: int64 number of finest cells.
        label: (finest patches,) number of the patch that has each patch of the finest cells.
        top: (finest patches,) whether each is the highest of its cell in that patch.
    """

    cell: Ints
    storey: Ints
    seen: Ints
    label: Ints
    top: NDArray[np.bool_]


class Patches:
    """Patches of cells with what is fused in each.

    Attributes:
        gap: largest gap within a patch, m.
        cell: (p,) int64 cell of each patch, ascending; those of a cell follow from below.
        fusion: fused readings, of which each patch is a slot.
    """

    def __init__(self, gap: float, fusion: Fusion) -> None:
        self.gap, self.cell, self.fusion = gap, np.zeros(0, np.int64), fusion

    def place(self, cell: Ints, height: Floats) -> Ints:
        """Patches of readings, (n,), which start some and join others."""
        known = len(self.cell)
        cells = np.concatenate([self.cell, cell])
        low = np.concatenate([self.fusion.low, height])
        high = np.concatenate([self.fusion.high, height])
        label = chains(cells, low, high, self.gap)
        slots = int(label.max(initial=-1)) + 1
        self.fusion = self.fusion.joined(label[:known], slots)
        self.cell = np.empty(slots, np.int64)
        self.cell[label] = cells
        return label[known:]

    def of_level(self, cell: Ints) -> LevelPatches:
        """Patches of larger cells.

        Args:
            cell: (p,) larger cell that holds the cell of each patch.
        """
        label = chains(cell, self.fusion.low, self.fusion.high, self.gap)
        count = int(label.max(initial=-1)) + 1
        cells = np.empty(count, np.int64)
        cells[label] = cell
        first = np.searchsorted(cells, cells)
        order = np.lexsort((self.cell, label))
        last = (np.diff(label[order], append=-1) != 0) | (np.diff(self.cell[order], append=-1) != 0)
        top = np.zeros(len(label), np.bool_)
        top[order[last]] = True
        seen = np.bincount(label[top], minlength=count)
        return LevelPatches(cells, np.arange(count) - first, seen, label, top)


def storeys_of(values: NDArray[Any], patches: LevelPatches, shape: tuple[int, int, int],
               empty: float) -> NDArray[Any]:  # fmt: skip
    """Values of patches, (p,), in arrays of (storeys, height, width); patches beyond are left out.

    Args:
        values: value of each patch.
        patches: the patches.
        shape: number of storeys, and of cells.
        empty: what stands where there is no patch.
    """
    out = np.full(shape, empty, values.dtype)
    kept = patches.storey < shape[0]
    out.reshape(shape[0], -1)[patches.storey[kept], patches.cell[kept]] = values[kept]
    return out
