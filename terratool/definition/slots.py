"""What the keys of the model take at first sight: exact types and ranges, for columns of values."""

from __future__ import annotations

import math
from typing import NamedTuple

from terratool.definition.keys import KEYS, Key
from terratool.definition.model import names_of
from terratool.definition.vehicles.keys import VEHICLE_KEYS

BIGGEST = math.nextafter(math.inf, 0)
"""The largest double."""

JSON_TYPES: dict[str, frozenset[type]] = {
    "text": frozenset([str]), "flag": frozenset([bool]), "whole": frozenset([int]),
    "number": frozenset([int, float]), "object": frozenset([dict]), "list": frozenset([list]),
}  # fmt: skip
_NO_TYPES: frozenset[type] = frozenset()
NEVER = frozenset([str, bool, dict, type(None)])
"""Types that an element's key takes as they are, or not at all."""


class QuickCheck(NamedTuple):
    """What a value is compared with first; what passes is good, the others are looked at closely.

    Attributes:
        name: attribute of the model.
        types: exact types that need no conversion, none if the value never stands alone.
        low: least number.
        high: largest number.
        number: whole numbers become floats.
    """

    name: str
    types: frozenset[type]
    low: float
    high: float
    number: bool


def _slot(name: str, key: Key) -> QuickCheck:
    low = math.nextafter(key.low, math.inf) if key.open_low else key.low
    high = math.nextafter(key.high, -math.inf) if key.open_high else key.high
    plain = key.alone and not key.choices
    types = JSON_TYPES.get(key.kind, _NO_TYPES) if plain else _NO_TYPES
    return QuickCheck(name, types, max(low, -BIGGEST), min(high, BIGGEST), key.kind == "number")


ALL_KEYS = {**KEYS, **VEHICLE_KEYS}
"""Of terrains and of vehicles."""

SLOTS: dict[type, dict[str, QuickCheck]] = {
    kind: {key: _slot(name, keys[key]) for name, key in names_of(kind)}
    for kind, keys in ALL_KEYS.items()
}


def fits_double(number: float) -> bool:
    """Whether a double holds a number."""
    return -BIGGEST <= number <= BIGGEST
