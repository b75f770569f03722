"""Bands of a raster file: names, units, data types and statistics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

_NO_LENGTH = 1e-9
"""Least length of a mean unit vector of directions, so that its logarithm is finite."""


@dataclass(frozen=True)
class Bands:
    """Bands of one file, all of one data type.

    Attributes:
        names: band names, in file order.
        units: unit of each band; "1" for a share or a ratio, empty for counts and categories.
        dtype: data type of all bands.
        content: meaning of the pixels: "number", "surface", "color", "shade", "class" or
            "bits".
        empty: nodata value of bands of numbers; NaN by default.
        means: averaging of each band: "number", "direction" in degrees, "vector" over all bands of
            that kind, or empty for none. Default: "number", but empty for surfaces and classes.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    dtype: np.dtype[Any]
    content: str = "number"
    empty: float = math.nan
    means: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.means:
            plain = "" if self.content in ("surface", "class") else "number"
            object.__setattr__(self, "means", (plain,) * self.count)

    @property
    def count(self) -> int:
        """Number of bands."""
        return len(self.names)

    @property
    def nodata(self) -> float | None:
        """Nodata value: `empty` for numbers, None for colours, 0 for all else."""
        return {"number": self.empty, "color": None}.get(self.content, 0.0)

    @property
    def pixel_bytes(self) -> int:
        """Bytes of a pixel over all bands."""
        return self.count * self.dtype.itemsize


@dataclass(frozen=True, slots=True)
class BandStatistics:
    """Statistics of the valid pixels of a band.

    Attributes:
        count: number of valid pixels.
        low, high: least and largest value; inf and -inf without valid pixels.
        middle: arithmetic mean.
        square: sum of squared differences from `middle`.
        sines, cosines: sums of sines and cosines in a band of directions; None in other bands.
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
        """Mean of the valid pixels; for directions the circular mean, 0 to 360 degrees."""
        if self.sines is None or self.cosines is None:
            return self.middle
        return math.degrees(math.atan2(self.sines, self.cosines)) % 360.0 % 360.0

    @property
    def deviation(self) -> float:
        """Population standard deviation of the valid pixels, as in GDAL; NaN without any.

        For directions it is the circular one in degrees, √(−2 ln R), with R the length of the mean
        vector: Mardia & Jupp (2000), Directional Statistics, 2.3.14.
        """
        if not self.count:
            return math.nan
        if self.sines is None or self.cosines is None:
            return math.sqrt(self.square / self.count)
        length = math.hypot(self.sines, self.cosines) / self.count
        return math.degrees(math.sqrt(-2.0 * math.log(min(1.0, max(length, _NO_LENGTH)))))

    def __add__(self, other: BandStatistics) -> BandStatistics:
        """Merge two sets of pixels: Chan, Golub & LeVeque (1979), Stanford STAN-CS-79-773."""
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
