"""Units of length, by the names that files and people give them."""

from __future__ import annotations

import math
import re
from typing import NamedTuple


class LengthUnit(NamedTuple):
    """A unit of length.

    Attributes:
        symbol: text behind a number, which options take, too.
        plural: name in a sentence.
        metres: its length in metres.
        names: other spellings, in small letters, words parted by spaces.
    """

    symbol: str
    plural: str
    metres: float
    names: tuple[str, ...] = ()


METRE = LengthUnit("m", "metres", 1.0, ("metre", "meter", "metres", "meters", "mtr"))
LENGTHS = (
    METRE,
    LengthUnit("ft", "feet", 0.3048, ("foot", "feet", "international foot", "international feet",
                                      "foot international", "feet international", "'")),
    LengthUnit("us-ft", "US survey feet", 1200 / 3937,
               ("us survey foot", "us survey feet", "survey foot", "survey feet", "foot us",
                "feet us", "us foot", "us feet", "us ft", "ftus", "ft us", "usft", "usfoot",
                "foot us survey", "us survey ft", "u.s. survey foot", "u.s. survey feet",
                "u.s. foot", "sft")),
    LengthUnit("cm", "centimetres", 0.01,
               ("centimetre", "centimeter", "centimetres", "centimeters")),
    LengthUnit("dm", "decimetres", 0.1, ("decimetre", "decimeter", "decimetres", "decimeters")),
    LengthUnit("mm", "millimetres", 1e-3,
               ("millimetre", "millimeter", "millimetres", "millimeters")),
    LengthUnit("km", "kilometres", 1e3, ("kilometre", "kilometer", "kilometres", "kilometers")),
)  # fmt: skip
"""Units that heights and coordinates come in; those of 1927 and 2022 differ by 2 · 10⁻⁶."""

_NOTHING = frozenset(
    ["", "-", "--", "?", "1", "n/a", "na", "none", "null", "other", "undefined", "undetermined",
     "unit", "unitless", "units", "unknown", "unnamed", "unspecified", "user defined"]
)  # fmt: skip
"""Texts in the place of a unit that name none."""
_AS_LONG = 1e-7
"""Largest difference of two lengths of one unit, as a share: definitions are rounded."""


def unit_text(text: str | None) -> str:
    """Symbol of the unit that a text names; the text itself if it is unknown, "" if it names none.

    Case, brackets and the signs between words do not count.
    """
    plain = " ".join(re.sub(r"[\s_\[\](){},]+|(?<=\w)-(?=\w)", " ", text or "").lower().split())
    if plain in _NOTHING:
        return ""
    for unit in LENGTHS:
        if plain in (unit.symbol, *unit.names):
            return unit.symbol
    return str(text).strip()


def length_named(symbol: str) -> LengthUnit | None:
    """Unit of a symbol; None where it names no unit of length."""
    return next((unit for unit in LENGTHS if unit.symbol == symbol), None)


def length_of(metres: float, name: str) -> LengthUnit:
    """Unit of a length in metres, or else a new one with the name that a file gives it."""
    for unit in LENGTHS:
        if math.isclose(metres, unit.metres, rel_tol=_AS_LONG):
            return unit
    return LengthUnit(name, name, metres)
