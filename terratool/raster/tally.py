"""What is counted while a raster is made: window by window, tile by tile, in their order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.raster.layers import Bands
from terratool.raster.losses import LossCounts
from terratool.raster.statistics import BandStatistics

if TYPE_CHECKING:
    from terratool.raster.windows import WindowContent


@dataclass(frozen=True, slots=True)
class RasterStatistics:
    """What is known of some windows.

    Attributes:
        statistics: for each file that of its bands; none for surfaces and colours.
        counts: (surfaces + 1,) int64 pixels of each surface id; none if no file holds them.
        nodata: pixels without a height.
        lost: what the pixels do not show; nothing where it was not asked for.
    """

    statistics: tuple[tuple[BandStatistics, ...], ...]
    counts: NDArray[np.int64]
    nodata: int
    lost: LossCounts


def window_statistics(made: WindowContent) -> RasterStatistics:
    """What is known of one window.

    Raises:
        RequestError: it has numbers beyond those of its type.
    """
    for statistics in made.statistics:
        if any(math.inf in (-part.low, part.high) for part in statistics if part.count):
            raise RequestError(
                "Some numbers go beyond 3.4e38, the largest ones of the file.",
                "Look at the vScale and vOffset of the elements and at the soils, or add "
                "--dtype float64.",
            )
    return RasterStatistics(made.statistics, made.counts, made.nodata, made.losses or LossCounts())


class StatisticsSum:
    """The sum of what was added to it; the order decides the last bits of means."""

    def __init__(self, files: Sequence[Bands]) -> None:
        self._statistics = [
            [BandStatistics()] * bands.count if bands.kind == "number" else [] for bands in files
        ]
        self._counts = np.zeros(0, np.int64)
        self._nodata = 0
        self._lost = LossCounts()

    def add(self, tally: RasterStatistics) -> None:
        """Add what is known of other windows."""
        for total, parts in zip(self._statistics, tally.statistics, strict=True):
            total[:] = map(BandStatistics.with_, total, parts)
        self._counts = tally.counts + self._counts if self._counts.size else tally.counts
        self._nodata += tally.nodata
        self._lost += tally.lost

    def total(self) -> RasterStatistics:
        """What is known of all that was added."""
        statistics = tuple(map(tuple, self._statistics))
        return RasterStatistics(statistics, self._counts, self._nodata, self._lost)


def in_order(numbered: Iterator[tuple[int, Any]]) -> Iterator[Any]:
    """What comes with the numbers 0, 1, 2, … in any order, by number."""
    waiting: dict[int, Any] = {}
    wanted = 0
    for number, value in numbered:
        waiting[number] = value
        while wanted in waiting:
            yield waiting.pop(wanted)
            wanted += 1
