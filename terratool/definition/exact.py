"""Exact numbers and lengths: the decimals that the numbers of a text mean, beyond their doubles.

A number means the shortest decimal that reads back as its double: for all that people type, the
decimal that they typed. Edges follow from these decimals exactly and are rounded to a double once,
at the end (docs/format.md, where exactly an edge stands). The difference of that number and its
double is kept as a second double, its rest.
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
"""Context of 1500 digits, more than sums of decimals and doubles from 1e-300 to 1e30 have."""


def exact(number: float) -> Fraction:
    """Decimal that a number of a text means."""
    return Fraction(repr(float(number)))


def decimal_sum(*numbers: float) -> float:
    """Double nearest to the sum of the decimals that numbers of a text mean."""
    return float(sum(map(exact, numbers)))


def rest_of(number: float) -> float:
    """Difference of the decimal that a double means and the double."""
    number = float(number)
    return float(_UNROUNDED.subtract(Decimal(repr(number)), Decimal(number)))


def rests_of(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences of the decimals that finite doubles mean and the doubles, float64, same shape."""
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
    """Powers of ten from -`MAX_EXPONENT` to `MAX_EXPONENT` of the kernels, (n, 2) double pairs."""
    import numpy as np

    from terratool.kernels import definition as kernels

    most = kernels.MAX_EXPONENT
    powers = [Fraction(10) ** exponent for exponent in range(-most, most + 1)]
    return np.array([(float(power), float(power - Fraction(float(power)))) for power in powers])


class Exact(NamedTuple):
    """Number as the nearest double and the rest to the number; or arrays of both.

    Sums agree with those of `place_of_copy` in kernels/field/sharing.hpp to the last bit.
    """

    near: Any
    rest: Any

    @classmethod
    def of_decimal(cls, number: float) -> Exact:
        """Number of a text, as the decimal that it means."""
        return cls(number, rest_of(number))

    def __add__(self, other: Exact) -> Exact:  # type: ignore[override]
        total, lost = _exact_sum(self.near, other.near)
        return Exact(*_exact_sum(total, lost + (self.rest + other.rest)))

    def __neg__(self) -> Exact:
        return Exact(-self.near, -self.rest)


def _exact_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """Sum of two doubles, and the error of its rounding (Knuth's TwoSum)."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


class ExactSide(NamedTuple):
    """Length as the sum of two doubles, of which the first has 36 bits; or arrays of both."""

    high: Any
    rest: Any

    @property
    def length(self) -> Any:
        """Double nearest to the length."""
        return self.high + self.rest

    @property
    def value(self) -> Fraction:
        """Exact sum of the two doubles."""
        return Fraction(self.high) + Fraction(self.rest)

    def times(self, count: Any) -> Exact:
        """Product of the length and a whole number of up to 17 bits."""
        return Exact(*_exact_sum(count * self.high, count * self.rest))

    def share(self, cells: Any, of: Any) -> ExactSide:
        """Side of a block of `cells` of the `of` equal cells into which this side is divided."""
        high = _leading_bits((self.high * cells + self.rest * cells) / of)
        return ExactSide(high, ((self.high * cells - high * of) + self.rest * cells) / of)


def side(length: Any, rest: Any = None) -> ExactSide:
    """Side of a length: the decimal that its double means, or the double and a given rest."""
    high = _leading_bits(length)
    return ExactSide(high, (length - high) + (rest_of(length) if rest is None else rest))


def _leading_bits(value: Any) -> Any:
    """Leading 36 bits of a number, or of each number of an array."""
    if not isinstance(value, (int, float)):
        import numpy as np

        mantissas, exponents = np.frexp(value)
        return np.ldexp(np.floor(mantissas * _LEADING), exponents - 36)
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * _LEADING), exponent - 36)


class Sides(NamedTuple):
    """Sides of a cell along x and y."""

    x: ExactSide
    y: ExactSide

    @property
    def lengths(self) -> Pair:
        """Doubles nearest to the two sides."""
        return self.x.length, self.y.length

    def turn_by(self, quarters: int) -> Sides:
        """Return the sides after a number of quarter turns."""
        return Sides(self.y, self.x) if quarters % 2 else self

    def times(self, span: tuple[int, int]) -> tuple[Exact, Exact]:
        """Sides of a block of `span` such cells."""
        return self.x.times(span[0]), self.y.times(span[1])

    def block(self, span: tuple[int, int], grid: tuple[int, int]) -> Sides:
        """Sides of a block of `span` cells of the grid that divides this cell."""
        return Sides(self.x.share(span[0], grid[0]), self.y.share(span[1], grid[1]))


def sides(lengths: Pair) -> Sides:
    """Sides of a cell with the lengths that a text gives."""
    return Sides(side(lengths[0]), side(lengths[1]))
