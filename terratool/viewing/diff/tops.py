"""Comparison of columns at pixels: highest tops, what is below them, and the room over the ground.

Pictures and maps of terrains with decks or bores show it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.raster.grid import Grid, Window
from terratool.raster.painter import (
    CLEARANCE_BAND,
    COLUMN_BANDS,
    Painter,
    most_tops,
)
from terratool.tasks import prefetch
from terratool.viewing.diff.ground import Both, ComparedWindow


class ComparedTops(NamedTuple):
    """Pixels of a window on both terrains with their decks and bores, (height, width) each.

    Attributes:
        seen: highest tops.
        room: float64, new room from the ground up to what stands over it, less the old one; NaN
            where either is open to the sky.
        other: whether any end of what is solid differs by more than the tolerance.
    """

    seen: ComparedWindow
    room: NDArray[np.float64]
    other: NDArray[np.bool_]


class _TopsPainter:
    """Painter of windows of two terrains with their storeys; several threads may use it."""

    def __init__(self, both: Both, grid: Grid, tolerance: float) -> None:
        assert both.whole is not None
        self._tolerance = tolerance
        self._numbers = both.numbers()
        bands = COLUMN_BANDS + 2 * max(most_tops(one, grid) for one in both.whole) - 1
        self._painters = [Painter(one, grid, np.float64, storeys=bands) for one in both.whole]

    def paint(self, window: Window) -> ComparedTops:
        """Paint a window of both terrains."""
        old, new = (painter.paint(window) for painter in self._painters)
        assert old.columns is not None and new.columns is not None
        assert old.surfaces is not None and new.surfaces is not None
        first, second = self._numbers
        seen = ComparedWindow(
            old.heights, new.heights, first[old.surfaces], second[new.surfaces]
        )  # fmt: skip
        room = new.columns[CLEARANCE_BAND] - old.columns[CLEARANCE_BAND]
        before, after = old.columns[COLUMN_BANDS:], new.columns[COLUMN_BANDS:]
        other = np.isnan(before) != np.isnan(after)
        other |= np.abs(after - before) > self._tolerance  # False for NaN
        return ComparedTops(seen, room, other.any(axis=0))


def paint_tops(
    both: Both, grid: Grid, windows: Sequence[Window], tolerance: float, threads: int
) -> Iterator[tuple[Window, ComparedTops]]:
    """Yield windows in their order, each with the columns of both terrains compared."""
    painter = _TopsPainter(both, grid, tolerance)
    yield from prefetch(lambda window: (window, painter.paint(window)), windows, threads)
