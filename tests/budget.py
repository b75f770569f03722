"""Numbers of examples that properties are tried with."""

import os
import zlib
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")

SHARE = float(os.environ.get("TERRATOOL_EXAMPLES", "0.25"))
"""Part of the full number of examples that properties are tried with; 1 in nightly runs."""

LEAST = 5
"""Least number of examples, where a property has as many in full."""


def examples(full: int) -> int:
    """Number of examples of a property with so many in full; TERRATOOL_FUZZ names another one."""
    if number := os.environ.get("TERRATOOL_FUZZ"):
        return int(number)
    return max(min(LEAST, full), round(full * SHARE))


def thinned(values: Sequence[T], name: str) -> Sequence[T]:
    """Every third of some values, which third depends on a name; all of them in nightly runs."""
    return values if SHARE >= 1 else values[zlib.crc32(name.encode()) % 3 :: 3]
