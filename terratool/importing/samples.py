"""Heights at the centres of a grid of pixels: what every source is brought to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class PixelLattice:
    """Pixels of equal size, counted from the south-west, and where they lie.

    Attributes:
        west, south: world position of the south-west corner of the south-west pixel.
        dx, dy: sides of a pixel along x and y, in units of the CRS.
        columns, rows: how many there are.
        crs: the reference system as a definition spells it ("EPSG:32633" or WKT), or None.
        unit: what heights and sides are measured in, "m" if not known otherwise; "°" where x and y
            are degrees.
    """

    west: float
    south: float
    dx: float
    dy: float
    columns: int
    rows: int
    crs: str | None = None
    unit: str = "m"

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east, north of the outermost pixels' edges."""
        return (
            self.west,
            self.south,
            self.west + self.columns * self.dx,
            self.south + self.rows * self.dy,
        )


class HeightSource(Protocol):
    """A source of heights that is read by rows, so that it need not fit into memory.

    Attributes:
        lattice: where the heights lie.
        notes: sentences about what a user should know (a unit that was guessed, what was lost).
    """

    @property
    def lattice(self) -> PixelLattice: ...  # noqa: D102

    @property
    def notes(self) -> tuple[str, ...]: ...  # noqa: D102

    def read(self, first: int, count: int) -> NDArray[np.float64]:
        """So many rows from `first`, (count, columns) float64; NaN for none."""
        ...


def extremes(heights: NDArray[np.float64]) -> tuple[float, float, int, int]:
    """Look at (rows, columns) float64 heights; those that are infinite become NaN.

    Returns:
        Lowest and highest height, infinities where there is none; how many are NaN; how many of
        these were infinite.
    """
    low = float(np.fmin.reduce(heights, axis=None, initial=np.inf)) + 0.0  # which is never -0
    high = float(np.fmax.reduce(heights, axis=None, initial=-np.inf)) + 0.0
    if low == -np.inf or high == np.inf:
        infinite = np.isinf(heights)
        heights[infinite] = np.nan
        low, high, unknown, _ = extremes(heights)
        return low, high, unknown, int(infinite.sum())
    return low, high, int(np.count_nonzero(np.isnan(heights))), 0


@dataclass(frozen=True, slots=True)
class SampledHeights:
    """Heights in memory; it is a `HeightSource`.

    Attributes:
        values: (rows, columns) float64 at the pixel centres, row 0 the southernmost, NaN for none.
    """

    lattice: PixelLattice
    values: NDArray[np.float64]
    notes: tuple[str, ...] = ()

    def read(self, first: int, count: int) -> NDArray[np.float64]:
        """So many rows from `first`, (count, columns) float64; NaN for none."""
        return self.values[first : first + count]
