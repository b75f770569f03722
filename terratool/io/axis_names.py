"""Names that texts of points give to the columns of x, y and z."""

from __future__ import annotations

import re
from collections.abc import Sequence

_AXES = (
    ("x", "lon", "east"), ("y", "lat", "north"), ("z", "alt", "height", "elev", "dem"),
)  # fmt: skip
"""Beginnings of the names of columns; x, y and z have to be the whole name."""


def axis_columns(names: Sequence[str]) -> tuple[int, int, int] | None:
    """Return the columns of x, y and z by their names, from 0; None where one is not named.

    Case, quotes, and what stands in brackets, such as a unit, do not count.
    """
    plain = [re.split(r"[(\[]", name.strip("\"' ").lower())[0].strip() for name in names]
    found = []
    for whole, *starts in _AXES:
        known = (
            at for at, name in enumerate(plain) if name == whole or name.startswith(tuple(starts))
        )
        found.append(next(known, -1))
    x, y, z = found
    return (x, y, z) if min(found) >= 0 and len(set(found)) == 3 else None
