"""Zero of the coordinates in a file, by a word or a point of the world."""

from __future__ import annotations

import math
from typing import Literal, get_args

from terratool.errors import RequestError

Point = tuple[float, float, float]
OriginName = Literal["local", "center", "world"]
Origin = OriginName | Point
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
    """Refuse a word that there is not, and a point that is no place.

    Raises:
        RequestError: the word is unknown, or a number is not finite.
    """
    if isinstance(origin, str):
        if origin not in get_args(OriginName):
            raise RequestError(
                f"The origin is {origin!r}.", "Give local, center, world, or three numbers."
            )
    elif not all(map(math.isfinite, origin)):
        raise RequestError(
            f"The origin is {' '.join(f'{x:g}' for x in origin)}.", "Give three finite numbers."
        )
