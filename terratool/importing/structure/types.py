"""What a DEM is taken apart into: structures as a definition spells them, and parts on pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import importing as kernels

CurveText = str | tuple[float, ...] | tuple[tuple[float, float], ...]
"""A curve as the definition spells it: a name or an expression, a vector, knots."""

VECTOR = -1
"""The code of a curve that has no name."""


def curve_at(code: int, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of a known curve at any t, 0 where that is not in [0, 1); in the shape of `t`."""
    return kernels.sample_curve(code, np.ravel(t)).reshape(t.shape)


@dataclass(frozen=True, slots=True)
class Structure:
    """An element that explains a part of a DEM, in a grid of half pixels.

    That grid divides the DEM into 2 · columns × 2 · rows cells, so that the edges of pixels and
    their centres are corners of cells. Over its footprint the element adds
    v_scale · shape(u, v) + v_offset.

    Attributes:
        kind: what it is: "box", "ramp-e", "cosbell-hill" and so on.
        name: a name for its primitive; structures of one name have the same curves.
        x, y: curves; y is None where `combine` is "radial".
        combine: "product", "sum" or "radial".
        column, row: the south-western cell.
        span: how many cells it takes to the east and to the north.
        v_scale, v_offset: factor and offset, in units of the heights.
        turn_deg: degrees clockwise.
    """

    kind: str
    name: str
    x: CurveText
    y: CurveText | None
    combine: str
    column: int
    row: int
    span: tuple[int, int]
    v_scale: float
    v_offset: float = 0.0
    turn_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Axis:
    """A curve along one axis of the pixels.

    Attributes:
        code: one of the known curves, or `VECTOR`.
        begin, end: where its cell begins and ends, in half pixels.
        values: of a vector, what it is at the pixel centres within the cell.
    """

    code: int
    begin: int
    end: int
    values: tuple[float, ...] = ()

    @property
    def first(self) -> int:
        """The first pixel whose centre the cell holds."""
        return self.begin // 2

    @property
    def stop(self) -> int:
        """The pixel after the last whose centre the cell holds."""
        return self.end // 2

    def samples(self) -> NDArray[np.float64]:
        """Values at the centres of the pixels from `first` to before `stop`, float64."""
        if self.code == VECTOR:
            return np.array(self.values)
        centres = 2.0 * np.arange(self.first, self.stop) + 1.0
        t = (centres - self.begin) / (self.end - self.begin)
        return curve_at(self.code, t)

    def steps(self, count: int) -> tuple[int, NDArray[np.float64]]:
        """Differences between neighbouring pixels, 0 beyond the cell.

        Args:
            count: pixels along the axis.

        Returns:
            The first gap and the differences from there on, those that lie within the DEM.
        """
        steps = np.diff(self.samples(), prepend=0.0, append=0.0)
        first = self.first - 1
        if self.stop == count:
            steps = steps[:-1]
        if first < 0:
            first, steps = 0, steps[1:]
        return first, steps


@dataclass(frozen=True, slots=True)
class PixelPart:
    """A product of two curves, `scale` high, on pixels."""

    x: Axis
    y: Axis
    scale: float

    def heights(self) -> NDArray[np.float64]:
        """What it adds at the centres of its pixels, (rows, columns) float64."""
        return self.scale * np.multiply.outer(self.y.samples(), self.x.samples())
