"""What is fitted: a few products of two curves and an offset; the patch that it is fitted to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.samples import SampledHeights

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ProductSum:
    """Heights over the unit square: `offset` + Σₖ xₖ(u) · yₖ(v), or `offset` + x(u) + y(v).

    Attributes:
        x_nodes, y_nodes: (p,), (q,) ascending from 0 to 1; two equal ones are a vertical step, a
            single one is a constant.
        x, y: (K, p), (K, q) values at the nodes, straight in between.
        offset: is added.
        summed: the two curves are added; K is 1.
    """

    x_nodes: Floats
    y_nodes: Floats
    x: Floats
    y: Floats
    offset: float
    summed: bool = False

    @property
    def count(self) -> int:
        """How many terms."""
        return len(self.x)


@dataclass(frozen=True, slots=True)
class Patch:
    """Heights of pixels, and the unit square that a primitive spans over them.

    Attributes:
        samples: the pixels, row 0 the southernmost.
        turn: of the primitive in degrees, clockwise as seen from above.
    """

    samples: SampledHeights
    turn: float = 0.0

    @property
    def values(self) -> Floats:
        """(rows, columns) heights, NaN for none."""
        return np.ascontiguousarray(self.samples.values)

    @property
    def affine(self) -> Floats:
        """(4,) how u and v change by column and by row: docs/format.md, footprints and turning."""
        lattice = self.samples.lattice
        columns, rows = lattice.columns, lattice.rows
        if self.turn == 0.0:
            return np.array([1.0 / columns, 0.0, 0.0, 1.0 / rows])
        angle = math.radians(self.turn)
        cos, sin = math.cos(angle), math.sin(angle)
        stretch = lattice.dy / lattice.dx
        return np.array([cos / columns, -sin * stretch / columns, sin / stretch / rows, cos / rows])

    def unit(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Places u and v of pixel centres, in the shape of row and column together."""
        rows, columns = self.values.shape
        dx, dy = column + 0.5 - 0.5 * columns, row + 0.5 - 0.5 * rows
        a, b, c, d = self.affine
        return 0.5 + (a * dx + b * dy), 0.5 + (c * dx + d * dy)


@dataclass(frozen=True, slots=True)
class Points:
    """Scattered heights: (n,) float64 each, u and v in the unit square."""

    u: Floats
    v: Floats
    z: Floats


def nodes(count: int, steps: tuple[float, ...] = ()) -> Floats:
    """So many evenly spaced nodes from 0 to 1, and two at each step; those close to a step go.

    Args:
        count: 1 is a constant, where there are no steps.
        steps: places of vertical steps; those at 0 and 1, and beyond, are none.
    """
    inner = sorted({step for step in steps if 0.0 < step < 1.0})
    if count == 1 and not inner:
        return np.zeros(1)
    count = max(count, 2)
    spacing = 1.0 / (count - 1)
    even = [
        t
        for t in (np.arange(count) / (count - 1)).tolist()
        if t in (0.0, 1.0) or all(abs(t - step) > 0.5 * spacing for step in inner)
    ]
    return np.array(sorted([*even, *inner, *inner]))
