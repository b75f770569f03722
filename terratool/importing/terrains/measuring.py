"""How far a definition is from the heights that it was made of, asked of the compiled field."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.definition.model import Definition
from terratool.errors import WriteError
from terratool.field.terrain import Terrain
from terratool.importing.samples import PixelLattice
from terratool.kernels import importing as kernels
from terratool.raster.grid import Window
from terratool.raster.painting import Painter

Floats = NDArray[np.float64]


class BoundError(WriteError):
    """What was written is not what was meant; no file appears."""

    def __init__(self, what: str) -> None:
        super().__init__(
            f"The definition is not as near to the source as it must be ({what}).",
            "Nothing was written. Please report it together with the source.",
        )


@dataclass(frozen=True, slots=True)
class Centres:
    """The pixel centres of a lattice, as a painter asks for them; pixels may be oblong."""

    lattice: PixelLattice

    @property
    def resolution(self) -> float:
        """Distance of neighbouring columns."""
        return self.lattice.dx

    def columns(self, window: Window) -> Floats:
        """The x of the centres of a window's columns, (width,) float64."""
        steps = np.arange(window.column, window.column + window.width)
        return np.asarray(self.lattice.west + (steps + 0.5) * self.lattice.dx)

    def rows(self, window: Window) -> Floats:
        """The y of the centres of a window's rows from north to south, (height,) float64."""
        steps = np.arange(window.row, window.row + window.height)
        return np.asarray(self.lattice.south + (self.lattice.rows - steps - 0.5) * self.lattice.dy)


def terrain_of(text: bytes) -> Terrain:
    """Compile a definition that was written here."""
    return Terrain(msgspec.json.decode(text, type=Definition))


def painted(terrain: Terrain, lattice: PixelLattice, window: Window) -> Floats:
    """Heights of the field at pixel centres, float64, row 0 the southernmost.

    Args:
        terrain: the field.
        lattice: the pixels.
        window: which of them; its rows count from the north.
    """
    centres: Any = Centres(lattice)
    painter = Painter(terrain, centres, np.float64, surfaces=False)
    return np.asarray(painter.paint(window).heights[::-1])


@dataclass(slots=True)
class MeasuredError:
    """What was measured so far.

    Attributes:
        where: place of the largest difference in the world.
        count: pixels with a height.
    """

    lattice: PixelLattice
    where: tuple[float, float] | None = None
    count: int = 0
    _sums: Floats = field(default_factory=lambda: np.array([0.0, -1.0]))

    def add(self, heights: Floats, ours: Floats, row: int, column: int = 0) -> None:
        """Compare rows from `row` on, columns from `column` on; NaN heights do not count.

        Raises:
            BoundError: a height is missing in the field.
        """
        at, count = kernels.compare(np.ravel(heights), np.ravel(ours), self._sums)
        if np.isnan(self._sums[1]):
            raise BoundError("a height is missing in the compiled field")
        self.count += count
        if at >= 0:
            i, j = divmod(at, heights.shape[1])
            self.where = (
                self.lattice.west + (column + j + 0.5) * self.lattice.dx,
                self.lattice.south + (row + i + 0.5) * self.lattice.dy,
            )

    @property
    def largest(self) -> float:
        """The largest difference."""
        return max(0.0, float(self._sums[1]))

    @property
    def rms(self) -> float:
        """Root of the mean square of the differences."""
        return math.sqrt(float(self._sums[0]) / self.count) if self.count else 0.0
