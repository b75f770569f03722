"""Roses on a map: at places of a coarse raster, the headings with which a vehicle drives."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.map_results import Preview

CELLS = 16
"""Number of roses along the longer side of a map."""
LEAST = 0.1
"""Least share of a cell's ground on which headings differ, if it has a rose."""
_ROOM = 0.47
"""Length of a full petal, in sides of a cell."""
_FILLED = 0.8
"""Share of its sector that a petal takes."""
_SHORT = 0.1
"""Share below which a heading has no petal."""


class Rose(NamedTuple):
    """Headings with which a vehicle drives in a square cell, where that depends on the heading.

    Attributes:
        right, down: middle of the cell, in pixels of the map from its north-west corner.
        shares: share of that ground on which each heading is go or caution, clockwise from north.
    """

    right: float
    down: float
    shares: tuple[float, ...]


def roses(preview: Preview) -> Iterator[Rose]:
    """Yield roses of the cells of a map in which headings differ, from the north-west on.

    Ground that is driven with all headings or with none does not count.
    """
    if preview.bits is None:
        return
    side = _side(preview)
    bits = [(preview.bits >> heading) & 1 != 0 for heading in range(preview.headings)]
    mixed = np.logical_or.reduce(bits) & ~np.logical_and.reduce(bits)
    counted, known = _sums(mixed, side), _sums(np.isfinite(preview.heights), side)
    drives = np.stack([_sums(one & mixed, side) for one in bits])
    for row, column in zip(*np.nonzero(counted > LEAST * np.maximum(known, 1)), strict=True):
        shares = drives[:, row, column] / counted[row, column]
        right, down = (column + 0.5) * side, (row + 0.5) * side
        yield Rose(float(right), float(down), tuple(shares.tolist()))


def _side(preview: Preview) -> int:
    """Side of a cell that has a rose, pixels."""
    longer: int = max(preview.heights.shape)
    return -(-longer // CELLS) or 1


def _sums(cells: NDArray[np.bool_], side: int) -> NDArray[np.int64]:
    """Number of pixels in each square of `side` pixels, the last ones cut off by the map's ends."""
    height, width = cells.shape
    rows, columns = np.arange(0, height, side), np.arange(0, width, side)
    by_row = np.add.reduceat(cells, rows, axis=0, dtype=np.int64)
    return np.asarray(np.add.reduceat(by_row, columns, axis=1))


def rose_path(preview: Preview) -> str:
    """Roses of a map as the data of an SVG path in pixels of the map; empty for none.

    A petal points where the vehicle heads, and is as long as its share of the cell.
    """
    side = _side(preview)
    sector = 2.0 * math.pi / preview.headings
    parts = []
    for rose in roses(preview):
        for heading, share in enumerate(rose.shares):
            if share < _SHORT:
                continue
            length = _ROOM * side * share
            at = f"M{rose.right:.1f} {rose.down:.1f}"
            for edge in (-0.5, 0.0, 0.5):
                angle = (heading + _FILLED * edge) * sector
                right, down = math.sin(angle) * length, -math.cos(angle) * length
                at += f"L{rose.right + right:.1f} {rose.down + down:.1f}"
            parts.append(f"{at}Z")
    return "".join(parts)
