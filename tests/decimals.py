"""What a number of a definition means, by itself: the shortest decimal that reads back as it."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction


def meant(number: float | Fraction) -> Fraction:
    """The decimal of a number as JSON has it; of a fraction, which was computed, itself."""
    if isinstance(number, Fraction):
        return number
    return Fraction(Decimal(repr(float(number))))
