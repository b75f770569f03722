"""Zero of the coordinates in a file, by a word or a point of the world."""

from __future__ import annotations

import math
from typing import Literal

from terratool.errors import RequestError

Point = tuple[float, float, float]
Origin = Literal["local", "center", "world"] | Point
"""South-west corner of what is written, its middle, the zero of the world, or a point of it."""


def zero_of(origin: Origin, bounds: tuple[float, float, float, float]) -> Point:
    """World position of the zero of a file.

    Args:
        origin: choice of the zero.
        bounds: west, south, east, north of what is written.
    """
    west, south, east, north = bounds
    match origin:
        case "local":
            return west, south, 0.0
        case "center":
            return 0.5 * (west + east), 0.5 * (south + north), 0.0
        case "world":
            return 0.0, 0.0, 0.0
        case point:
            return point


def check_origin(origin: Origin) -> None:
    """Refuse a point that is no place.

    Raises:
        RequestError: a number is not finite.
    """
    if isinstance(origin, tuple) and not all(map(math.isfinite, origin)):
        raise RequestError(
            f"The origin is {' '.join(f'{x:g}' for x in origin)}.", "Give three finite numbers."
        )
