"""Statistics of bands and of whole rasters, gathered window by window, in their order."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.io.bands import Bands
from terratool.kernels import raster as kernels
from terratool.raster.loss import LossCounts

_COLUMNS = 512
_NO_LENGTH = 1e-9
"""Directions whose mean vector is shorter point nowhere; the length counts as this."""


@dataclass(frozen=True, slots=True)
class BandStatistics:
    """What the valid pixels of a band are like.

    Attributes:
        count: how many there are.
        low, high: their range; infinite the wrong way round where there are none.
        middle: their arithmetic mean.
        square: sum of their squared differences from it.
        sines, cosines: their sums, of a band of directions; None for others.
    """

    count: int = 0
    low: float = math.inf
    high: float = -math.inf
    middle: float = 0.0
    square: float = 0.0
    sines: float | None = None
    cosines: float | None = None

    @property
    def mean(self) -> float:
        """The mean; of directions the circular one, from 0 to 360 degrees."""
        if self.sines is None or self.cosines is None:
            return self.middle
        return math.degrees(math.atan2(self.sines, self.cosines)) % 360.0 % 360.0

    @property
    def deviation(self) -> float:
        """Standard deviation of the pixels themselves, as GDAL has it.

        Of directions it is the circular one in degrees, √(−2 ln R), with R the length of the mean
        vector: Mardia & Jupp (2000), Directional Statistics, 2.3.14.
        """
        if not self.count:
            return math.nan
        if self.sines is None or self.cosines is None:
            return math.sqrt(self.square / self.count)
        length = math.hypot(self.sines, self.cosines) / self.count
        return math.degrees(math.sqrt(-2.0 * math.log(min(1.0, max(length, _NO_LENGTH)))))

    def __add__(self, other: BandStatistics) -> BandStatistics:
        """Of the pixels of both. Chan, Golub & LeVeque (1979), Stanford STAN-CS-79-773."""
        count = self.count + other.count
        if not other.count or not self.count:
            return self if self.count else other
        delta = other.middle - self.middle
        return BandStatistics(
            count,
            min(self.low, other.low),
            max(self.high, other.high),
            self.middle + delta * (other.count / count),
            self.square + other.square + delta * delta * (self.count * (other.count / count)),
            _sum(self.sines, other.sines),
            _sum(self.cosines, other.cosines),
        )


def _sum(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one + other


def band_statistics(pixels: NDArray[Any], directions: bool = False) -> BandStatistics:
    """Statistics of what is not NaN in `pixels`, (height, width) of floats.

    Directions are in degrees.
    """
    shift = kernels.first_number(pixels)  # sums of squares lose less near 0
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
    """What is known of the pixels of some windows.

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


class StatisticsSum:
    """The statistics of all windows added to it; their order decides the last bits of means."""

    def __init__(self, files: Sequence[Bands]) -> None:
        self._statistics = [
            [BandStatistics()] * bands.count if bands.content == "number" else [] for bands in files
        ]
        self._counts = np.zeros(0, np.int64)
        self._nodata = 0
        self._lost = LossCounts()

    def add(self, part: RasterStatistics) -> None:
        """Add those of other windows."""
        for total, bands in zip(self._statistics, part.statistics, strict=True):
            total[:] = map(operator.add, total, bands)
        self._counts = part.counts + self._counts if self._counts.size else part.counts
        self._nodata += part.nodata
        self._lost += part.lost

    def total(self) -> RasterStatistics:
        """Those of all windows."""
        statistics = tuple(map(tuple, self._statistics))
        return RasterStatistics(statistics, self._counts, self._nodata, self._lost)
