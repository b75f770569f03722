"""Bands of a raster file: their names, units and numbers, and which number stands for none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np


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
