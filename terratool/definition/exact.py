"""Exact numbers and lengths: what the numbers of a text mean beyond their doubles.

A number means the shortest decimal that reads back as its double: for all that people type, the
decimal that they typed. Edges follow from these decimals exactly and are rounded to a double once,
at the end (docs/format.md, where exactly an edge stands). What a double lacks to the number that it
stands for is kept beside it as a second double, its rest.
"""

from __future__ import annotations

import math
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from terratool.definition.model import Pair

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_LEADING = 2.0**36
_UNROUNDED = Context(prec=1500)
"""Sums of decimals and of doubles from 1e-300 to 1e30 have fewer digits."""


def exact(number: float) -> Fraction:
    """The decimal that a number of a text means."""
    return Fraction(repr(float(number)))


def decimal_sum(*numbers: float) -> float:
    """The double nearest to the sum of the decimals that numbers of a text mean."""
    return float(sum(map(exact, numbers)))


def rest_of(number: float) -> float:
    """What a double lacks to the decimal that it means."""
    number = float(number)
    return float(_UNROUNDED.subtract(Decimal(repr(number)), Decimal(number)))


def rests_of(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """What finite doubles lack to the decimals that they mean, float64 in their shape."""
    import msgspec
    import numpy as np

    from terratool.kernels import definition as kernels

    flat = np.ascontiguousarray(numbers, np.float64).ravel()
    text = msgspec.json.encode(flat.tolist())  # the shortest decimals
    rests = np.empty(len(flat))
    kernels.decimal_rests(np.frombuffer(text, np.uint8), powers_of_ten(), flat, rests)
    return rests.reshape(np.shape(numbers))


@cache
def powers_of_ten() -> NDArray[np.float64]:
    """Powers of ten from -`MAX_EXPONENT` of the kernels on, (n, 2), as sums of two doubles."""
    import numpy as np

    from terratool.kernels import definition as kernels

    most = kernels.MAX_EXPONENT
    powers = [Fraction(10) ** exponent for exponent in range(-most, most + 1)]
    return np.array([(float(power), float(power - Fraction(float(power)))) for power in powers])


class Exact(NamedTuple):
    """A number as the double nearest to it, and what that lacks; or arrays of both.

    Sums are those of `place_of_copy` in kernels/field/sharing.hpp, to the last bit.
    """

    near: Any
    rest: Any

    @classmethod
    def typed(cls, number: float) -> Exact:
        """The decimal that a number of a text means."""
        return cls(number, rest_of(number))

    def __add__(self, other: Exact) -> Exact:  # type: ignore[override]
        total, lost = _exact_sum(self.near, other.near)
        return Exact(*_exact_sum(total, lost + (self.rest + other.rest)))

    def __neg__(self) -> Exact:
        return Exact(-self.near, -self.rest)


def _exact_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """The sum of two doubles, and what rounding took from it (Knuth)."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


class Side(NamedTuple):
    """A length as the sum of two doubles, of which the first has 36 bits; or arrays of both."""

    high: Any
    rest: Any

    @property
    def length(self) -> Any:
        """The double nearest to it."""
        return self.high + self.rest

    @property
    def value(self) -> Fraction:
        """The sum of the two doubles."""
        return Fraction(self.high) + Fraction(self.rest)

    def times(self, count: Any) -> Exact:
        """A whole number of up to 17 bits of such lengths."""
        return Exact(*_exact_sum(count * self.high, count * self.rest))

    def share(self, cells: Any, of: Any) -> Side:
        """The side of one of `of` equal cells in a block of so many of these."""
        high = _leading((self.high * cells + self.rest * cells) / of)
        return Side(high, ((self.high * cells - high * of) + self.rest * cells) / of)


def side(length: Any, rest: Any = None) -> Side:
    """A length as a `Side`: the decimal that its double means, or the double and this rest."""
    high = _leading(length)
    return Side(high, (length - high) + (rest_of(length) if rest is None else rest))


def _leading(value: Any) -> Any:
    """The leading 36 bits of a number, or of each number of an array."""
    if not isinstance(value, (int, float)):
        import numpy as np

        mantissas, exponents = np.frexp(value)
        return np.ldexp(np.floor(mantissas * _LEADING), exponents - 36)
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * _LEADING), exponent - 36)


class Sides(NamedTuple):
    """Sides of a cell along x and y."""

    x: Side
    y: Side

    @property
    def lengths(self) -> Pair:
        """The doubles nearest to the two sides."""
        return self.x.length, self.y.length

    def turned(self, quarters: int) -> Sides:
        """The sides after so many quarter turns."""
        return Sides(self.y, self.x) if quarters % 2 else self

    def times(self, span: tuple[int, int]) -> tuple[Exact, Exact]:
        """The sides of a block of such cells."""
        return self.x.times(span[0]), self.y.times(span[1])

    def block(self, span: tuple[int, int], grid: tuple[int, int]) -> Sides:
        """The sides of a block of the cells of the grid that divides this cell."""
        return Sides(self.x.share(span[0], grid[0]), self.y.share(span[1], grid[1]))


def sides(lengths: Pair) -> Sides:
    """Sides of the lengths that a text gives."""
    return Sides(side(lengths[0]), side(lengths[1]))
