"""What is written is compiled, block by block, and held against the DEM before it appears."""

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
from terratool.importing.terrain.methods import Chunk
from terratool.kernels import importing as kernels
from terratool.raster.grid import Window
from terratool.raster.painter import Painter

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


FLAT = b'"flat":{"x":"flat","y":"flat"}'
"""The primitive of the root and of what covers it."""

Texts = list[tuple[bytes, bytes]]

_CRACK = 1e-6
"""Heights on the two sides of an edge agree to this part of a step, which is rounding."""


@dataclass(slots=True)
class Checker:
    """Compiles parts of a definition and measures how far they are from the DEM.

    That is done with pixels of 1 × 1 and the origin at 0, where all centres and edges are doubles:
    at large coordinates they are rounded, and beside a wall that would count as an error.

    Attributes:
        lattice: the pixels.
        base: the height without any element.
        always: texts of elements that stand everywhere, besides the rows.
        added: (rows, columns) float64, or (columns, rows) where columns are written: what these
            elements add at the pixel centres; None if there are none.
        turned: whether columns are written.
        deviation: how far structures may be from the DEM in the outer half pixels; None where they
            have upright walls, so that nothing is known of that.
        misfit: what was measured.
        last: rows from a first one on, and the last pixel of each, which the rims carry.
    """

    lattice: PixelLattice
    base: float
    always: Texts
    added: Floats | None
    turned: bool
    deviation: float | None
    misfit: MeasuredError
    last: list[tuple[int, Floats]] = field(default_factory=list)

    @property
    def _plain(self) -> PixelLattice:
        """As many pixels of 1 × 1 from 0 on."""
        return PixelLattice(0.0, 0.0, 1.0, 1.0, self.lattice.columns, self.lattice.rows)

    def chunk(self, chunk: Chunk) -> None:
        """Measure a block of rows, or of columns; the last pixel of each is the rim's."""
        first, count = chunk.first, len(chunk.heights)
        wanted = chunk.heights
        if self.added is not None:
            wanted = wanted + self.added[first : first + count]
        # the next block to the south has the first row of this one, too
        skip = int(first > 0)
        wanted, first, count = wanted[skip:], first + skip, count - skip
        self.last.append((first, wanted[:, -1].copy()))
        across = wanted.shape[1] - 1
        if not across:
            return
        place = (0, first, across, count) if self.turned else (first, 0, count, across)
        ours = self._painted(chunk.texts, *place)
        self._add(wanted[:, :-1], ours.T if self.turned else ours, first, 0)

    def rims(self, texts: Texts, levels: Floats, step: float) -> None:
        """Measure the outer half pixels.

        Args:
            texts: what carries on the heights there.
            levels: (2, rows) float64, heights of the first and last pixel of each row.
            step: what heights were rounded to.

        Raises:
            BoundError: they do not meet the rows.
        """
        at = self._plain
        alone = self.deviation is None or self.added is None
        terrain = terrain_of(self._text(texts, [] if alone else self.always))
        whole = levels if self.added is None else levels + self.added[:, [0, -1]].T
        along = np.arange(levels.shape[1]) + 0.5
        for side, wanted in enumerate(levels if alone else whole):
            beyond = 0.25 if side == 0 else (at.rows if self.turned else at.columns) - 0.25
            ours = terrain.height(along, beyond) if self.turned else terrain.height(beyond, along)
            slack = _CRACK * step + 1e-12 * float(np.abs(wanted).max(initial=0.0))
            slack += 0.0 if alone else self.deviation or 0.0
            if not float(np.abs(ours - wanted).max()) <= slack:
                raise BoundError("the outer half pixels do not meet the rows")
        across = (at.rows if self.turned else at.columns) - 1
        for first, column in self.last:
            ours = whole[1, first : first + len(column)]
            self._add(column[:, np.newaxis], ours[:, np.newaxis], first, across)

    def _add(self, wanted: Floats, ours: Floats, first: int, across: int) -> None:
        if self.turned:
            self.misfit.add(wanted.T, ours.T, across, first)
        else:
            self.misfit.add(wanted, ours, first, across)

    def whole(self, texts: Texts, wanted: Floats) -> None:
        """Measure a definition that was written all at once against (rows, columns) heights."""
        self.misfit.add(wanted, self._painted(texts, 0, 0, *wanted.shape), 0)

    def _painted(self, texts: Texts, row: int, column: int, height: int, width: int) -> Floats:
        north = self._plain.rows - row - height
        window = Window(north, column, height, width)
        return painted(terrain_of(self._text(texts, self.always)), self._plain, window)

    def _text(self, texts: Texts, always: Texts) -> bytes:
        head = msgspec.json.encode({"size": [self._plain.columns, self._plain.rows]})
        head = head.removesuffix(b"}")
        every = [*always, *texts]
        root = msgspec.json.encode(root_of(self.lattice, self.base)).removesuffix(b"}")
        types = dict.fromkeys((text for text, _ in every if text))
        return b'%s,"elemTypes":{%s},"elemTree":%s,"children":[%s]}}' % (
            head,
            b",".join([FLAT, *types]),
            root,
            b",".join(text for _, text in every if text),
        )


def root_of(lattice: PixelLattice, base: float) -> dict[str, Any]:
    """The root: level ground, and a grid of half pixels."""
    cells = [2 * lattice.columns, 2 * lattice.rows]
    return {"type": "flat", "vScale": base, "cells": cells}
