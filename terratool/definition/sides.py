"""Sides of cells as the field has them, to the last bit."""

from __future__ import annotations

import math
from typing import NamedTuple

from terratool.definition.model import Pair

_LEADING = 2.0**36


class Side(NamedTuple):
    """A side of a cell as the sum of two numbers, of which the first has 36 bits."""

    high: float
    rest: float

    @property
    def length(self) -> float:
        """The double nearest to it."""
        return self.high + self.rest

    def share(self, cells: int, of: int) -> Side:
        """The side of one of `of` equal cells in a block of so many of these."""
        high = _leading((self.high * cells + self.rest * cells) / of)
        return Side(high, ((self.high * cells - high * of) + self.rest * cells) / of)


def side(length: float) -> Side:
    """A length as a side."""
    high = _leading(length)
    return Side(high, length - high)


def _leading(value: float) -> float:
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * _LEADING), exponent - 36)


class Sides(NamedTuple):
    """The sides of a cell along x and y."""

    x: Side
    y: Side

    @property
    def lengths(self) -> Pair:
        """Their lengths."""
        return self.x.length, self.y.length

    def turned(self, quarters: int) -> Sides:
        """The sides after so many quarter turns."""
        return Sides(self.y, self.x) if quarters % 2 else self

    def block(self, span: tuple[int, int], grid: tuple[int, int]) -> Sides:
        """A block of the cells of the grid that divides it."""
        return Sides(self.x.share(span[0], grid[0]), self.y.share(span[1], grid[1]))


def sides(lengths: Pair) -> Sides:
    """Sides of these lengths."""
    return Sides(side(lengths[0]), side(lengths[1]))
