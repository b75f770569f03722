"""Bands of a raster file: their names, units and numbers, and statistics of these."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

_NO_LENGTH = 1e-9
"""Directions whose mean vector is shorter point nowhere; the length counts as this."""


@dataclass(frozen=True)
class Bands:
    """Bands of one file, which share a type of number.

    Attributes:
        names: of the bands.
        units: of their values, one a band; "1" for a share or a ratio, empty for what is counted
            or chosen.
        dtype: type of every band.
        content: of the pixels: "number", "surface", "color" or "class".
        empty: number that stands for none, in bands of numbers.
        means: way to average the values of each band: as "number", as "direction" in degrees, as
            "vector" of all bands; empty where they have no mean. Numbers, if not said.
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
        """Pixel that stands for none: `empty` of numbers, 0 of surfaces and classes; no colour."""
        return {"number": self.empty, "color": None}.get(self.content, 0.0)

    @property
    def pixel_bytes(self) -> int:
        """Bytes of a pixel in all bands."""
        return self.count * self.dtype.itemsize


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
