"""Places where a residual holds something that no part explained, with the ground around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrains.structure.residual import Floats, Residual

BLOCKS = (8, 16, 32)
"""What lies in neighbouring blocks of so many gaps belongs together; then the same more and more
coarsely, as the stairs of a rim that runs nearly along an axis are long."""

MOST = 400
"""So many places are looked at, the largest first."""

LARGEST = 400
"""Places of more pixels to a side are left alone."""

RING = 3


@dataclass(frozen=True, slots=True)
class Island:
    """A rectangle of pixels that stands out of even ground.

    Attributes:
        row, column: its south-western pixel.
        heights: (h, w) float64, heights above the ground, NaN for none.
        stop_row, stop_column: the pixels after its last.
        around: heights above the ground in a wider window, for cells that reach farther.
        south, west: how many pixels that window reaches farther to the south and west.
        off: how far the ground around it is off from the slope that was fitted.
    """

    row: int
    column: int
    heights: Floats
    around: Floats
    south: int
    west: int
    off: float


def islands(residual: Residual, noise: float, block: int) -> Iterator[Island]:
    """Each place that stands out of even ground, the largest first.

    Args:
        residual: heights and their differences.
        noise: how far differences may be off.
        block: what lies in neighbouring blocks of so many gaps belongs together.
    """
    busy = np.abs(residual.mixed) > 2.0 * noise
    rectangles = []
    for blocks in _components(_occupied(busy, block)):
        low, high = blocks.min(axis=0) * block, (blocks.max(axis=0) + 1) * block
        j, i = np.nonzero(busy[low[0] : high[0], low[1] : high[1]])
        # from the gap before the first pixel to the gap after the last
        south, west = int(low[0] + j.min()) + 1, int(low[1] + i.min()) + 1
        north, east = int(low[0] + j.max()) + 1, int(low[1] + i.max()) + 1
        sides = north - south, east - west
        if min(sides) >= 4 and max(sides) <= LARGEST:
            rectangles.append((south, west, north, east))
    rectangles.sort(key=lambda one: (-(one[2] - one[0]) * (one[3] - one[1]), one))
    for rectangle in rectangles[:MOST]:
        island = _island(residual, *rectangle)
        if island is not None:
            yield island


def _occupied(busy: NDArray[np.bool_], block: int) -> NDArray[np.bool_]:
    """Which blocks hold something."""
    rows, columns = (-(-side // block) * block for side in busy.shape)
    padded = np.zeros((rows, columns), np.bool_)
    padded[: busy.shape[0], : busy.shape[1]] = busy
    blocks = padded.reshape(rows // block, block, columns // block, block)
    return np.logical_or.reduce(blocks, axis=(1, 3))  # type: ignore[no-any-return]


def _components(occupied: NDArray[np.bool_]) -> Iterator[NDArray[np.int64]]:
    """Blocks that touch one another, also at corners: (n, 2) rows and columns for each group."""
    waiting = dict.fromkeys(map(tuple, np.argwhere(occupied).tolist()))
    while waiting:
        seed, _ = waiting.popitem()
        group, stack = [seed], [seed]
        while stack:
            row, column = stack.pop()
            for place in ((row + j, column + i) for j in (-1, 0, 1) for i in (-1, 0, 1) if j or i):
                if place in waiting:
                    del waiting[place]
                    group.append(place)
                    stack.append(place)
        yield np.array(group)


def _island(residual: Residual, south: int, west: int, north: int, east: int) -> Island | None:
    """The heights of a rectangle above the slope around it, or None if that is not even."""
    low = max(0, south - RING), max(0, west - RING)
    window = residual.heights[low[0] : north + RING, low[1] : east + RING]
    ring = np.isfinite(window)
    ring[south - low[0] : north - low[0], west - low[1] : east - low[1]] = False
    j, i = np.nonzero(ring)
    if len(j) < 8:
        return None
    terms = np.column_stack([np.ones(len(j)), i, j])
    z = window[ring]
    found, *_ = np.linalg.lstsq(terms, z, rcond=None)
    jj, ii = np.mgrid[0 : window.shape[0], 0 : window.shape[1]]
    around = window - (found[0] + found[1] * ii + found[2] * jj)
    off = float(np.abs(around[ring]).max())
    inner = around[south - low[0] : north - low[0], west - low[1] : east - low[1]]
    return Island(south, west, inner, around, south - low[0], west - low[1], off)
