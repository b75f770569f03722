"""Statistics of bands and whole rasters, summed window by window in a fixed order."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.io.bands import Bands, BandStatistics
from terratool.kernels import raster as kernels
from terratool.raster.loss import LossCounts

_COLUMNS = 512
"""Partial sums kept side by side; the number fixes the rounding of totals."""


def band_statistics(pixels: NDArray[Any], directions: bool = False) -> BandStatistics:
    """Statistics of the pixels of a band that are not NaN.

    Args:
        pixels: (height, width) float32 or float64.
        directions: whether pixels are directions in degrees, which need circular sums.
    """
    shift = kernels.first_number(pixels)  # sums of squares round less near 0
    sums = np.zeros((5, _COLUMNS))
    sums[1:3] = [[math.inf], [-math.inf]]
    kernels.gather(pixels, shift, sums)
    with np.errstate(invalid="ignore", over="ignore"):  # heights beyond float32 are infinite
        count, total, square = (float(sums[row].sum()) for row in (0, 3, 4))
    if not count:
        return BandStatistics()
    mean = total / count
    found = BandStatistics(
        int(count),
        float(sums[1].min()),
        float(sums[2].max()),
        shift + mean,
        max(square - total * mean, 0.0),
    )
    if not directions:
        return found
    angles = np.radians(pixels, dtype=np.float64)
    sine, cosine = float(np.nansum(np.sin(angles))), float(np.nansum(np.cos(angles)))
    return replace(found, sines=sine, cosines=cosine)


@dataclass(frozen=True, slots=True)
class RasterStatistics:
    """Statistics of the pixels of one or more windows.

    Attributes:
        statistics: statistics of each band, by file; empty for surfaces and colours.
        counts: (surfaces + 1,) int64, pixels by surface id; (0,) if no file holds surfaces.
        nodata: number of pixels without a height.
        lost: losses between the pixels; all 0 if not requested.
    """

    statistics: tuple[tuple[BandStatistics, ...], ...]
    counts: NDArray[np.int64]
    nodata: int
    lost: LossCounts


class StatisticsSum:
    """Running sum of the statistics of windows; their order decides the last bits of means."""

    def __init__(self, files: Sequence[Bands]) -> None:
        self._statistics = [
            [BandStatistics()] * bands.count if bands.content == "number" else [] for bands in files
        ]
        self._counts = np.zeros(0, np.int64)
        self._nodata = 0
        self._lost = LossCounts()

    def add(self, part: RasterStatistics) -> None:
        """Add the statistics of other windows."""
        for total, bands in zip(self._statistics, part.statistics, strict=True):
            total[:] = map(operator.add, total, bands)
        self._counts = part.counts + self._counts if self._counts.size else part.counts
        self._nodata += part.nodata
        self._lost += part.lost

    def total(self) -> RasterStatistics:
        """Statistics over all windows."""
        statistics = tuple(map(tuple, self._statistics))
        return RasterStatistics(statistics, self._counts, self._nodata, self._lost)
