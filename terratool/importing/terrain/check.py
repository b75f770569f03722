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
from terratool.importing.sampling import paint_pixels
from terratool.importing.sources import PixelGrid
from terratool.importing.terrain.methods import Chunk, WrittenRows
from terratool.importing.terrain.writing import ElementText
from terratool.kernels import importing as kernels
from terratool.raster.grid import Window

FLAT = b'"flat":{"x":"flat","y":"flat"}'
"""The primitive of the root and of what covers it."""

_CRACK = 1e-6
"""Heights on the two sides of an edge agree to this part of a step, which is rounding."""

Floats = NDArray[np.float64]


class BoundError(WriteError):
    """What was written is not what was meant; no file appears."""

    def __init__(self, what: str) -> None:
        super().__init__(
            f"The definition is not as near to the source as it must be ({what}).",
            "Nothing was written. Please report it together with the source.",
        )


@dataclass(slots=True)
class MeasuredError:
    """What was measured so far.

    Attributes:
        where: place of the largest difference in the world.
        count: pixels with a height.
    """

    grid: PixelGrid
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
                self.grid.west + (column + j + 0.5) * self.grid.dx,
                self.grid.south + (row + i + 0.5) * self.grid.dy,
            )

    @property
    def largest(self) -> float:
        """The largest difference."""
        return max(0.0, float(self._sums[1]))

    @property
    def rms(self) -> float:
        """Root of the mean square of the differences."""
        return math.sqrt(float(self._sums[0]) / self.count) if self.count else 0.0


@dataclass(slots=True)
class Checker:
    """Compiles parts of a definition and measures how far they are from the DEM.

    That is done with pixels of 1 × 1 and the origin at 0, where all centres and edges are doubles:
    at large coordinates they are rounded, and beside a wall that would count as an error.

    Attributes:
        grid: the pixels.
        base: the height without any element.
        always: texts of elements that stand everywhere, besides the rows.
        added: (rows, columns) float64, or (columns, rows) where columns are written: what these
            elements add at the pixel centres; None if there are none.
        transposed: whether columns are written.
        deviation: how far structures may be from the DEM in the outer half pixels; None where they
            have upright walls, so that nothing is known of that.
        error: what was measured.
        last: rows from a first one on, and the last pixel of each, which the outer elements carry.
    """

    grid: PixelGrid
    base: float
    always: list[ElementText]
    added: Floats | None
    transposed: bool
    deviation: float | None
    error: MeasuredError
    last: list[tuple[int, Floats]] = field(default_factory=list)

    def check_chunk(self, chunk: Chunk) -> None:
        """Measure a block of rows, or of columns; but the last pixel of each."""
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
        if self.transposed:
            ours = self._painted(chunk.texts, 0, first, across, count).T
        else:
            ours = self._painted(chunk.texts, first, 0, count, across)
        self._add(wanted[:, :-1], ours, first, 0)

    def check_borders(self, written: WrittenRows, step: float) -> None:
        """Measure the outer half pixels.

        Args:
            written: what they have to meet, and what carries on the heights there.
            step: what heights were rounded to.

        Raises:
            BoundError: they do not meet the rows.
        """
        along_x = self.grid.rows if self.transposed else self.grid.columns
        alone = self.deviation is None or self.added is None
        terrain = terrain_of(self._text(written.outer, [] if alone else self.always))
        ends = written.ends
        whole = ends if self.added is None else ends + self.added[:, [0, -1]].T
        along = np.arange(ends.shape[1]) + 0.5
        for across, wanted in zip((0.25, along_x - 0.25), ends if alone else whole, strict=True):
            x, y = (along, across) if self.transposed else (across, along)
            slack = _CRACK * step + 1e-12 * float(np.abs(wanted).max(initial=0.0))
            slack += 0.0 if alone else self.deviation or 0.0
            if not float(np.abs(terrain.height(x, y) - wanted).max()) <= slack:
                raise BoundError("the outer half pixels do not meet the rows")
        for first, column in self.last:
            ours = whole[1, first : first + len(column)]
            self._add(column[:, np.newaxis], ours[:, np.newaxis], first, along_x - 1)

    def check_whole(self, texts: list[ElementText], wanted: Floats) -> None:
        """Measure a definition that was written all at once against (rows, columns) heights."""
        self.error.add(wanted, self._painted(texts, 0, 0, *wanted.shape), 0)

    def _add(self, wanted: Floats, ours: Floats, first: int, across: int) -> None:
        if self.transposed:
            self.error.add(wanted.T, ours.T, across, first)
        else:
            self.error.add(wanted, ours, first, across)

    def _painted(
        self, texts: list[ElementText], row: int, column: int, height: int, width: int
    ) -> Floats:
        shape = self.grid.rows, self.grid.columns
        window = Window(shape[0] - row - height, column, height, width)
        return paint_pixels(terrain_of(self._text(texts, self.always)), shape, window)

    def _text(self, texts: list[ElementText], always: list[ElementText]) -> bytes:
        head = msgspec.json.encode({"size": [self.grid.columns, self.grid.rows]})
        every = [*always, *texts]
        root = msgspec.json.encode(root_of(self.grid, self.base))
        types = dict.fromkeys(text.primitive for text in every if text.primitive)
        return b'%s,"elemTypes":{%s},"elemTree":%s,"children":[%s]}}' % (
            head.removesuffix(b"}"),
            b",".join([FLAT, *types]),
            root.removesuffix(b"}"),
            b",".join(text.element for text in every if text.element),
        )


def terrain_of(text: bytes) -> Terrain:
    """Compile a definition that was written here."""
    return Terrain(msgspec.json.decode(text, type=Definition))


def root_of(grid: PixelGrid, base: float) -> dict[str, Any]:
    """The root: level ground, and a grid of half pixels."""
    cells = [2 * grid.columns, 2 * grid.rows]
    return {"type": "flat", "vScale": base, "cells": cells}
