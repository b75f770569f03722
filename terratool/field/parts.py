"""Parts of a terrain: rectangles in the world that a user asks for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from terratool.errors import RequestError

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain

Bounds = tuple[float, float, float, float]
"""West, south, east, north."""


def check_bounds(bounds: Bounds, terrain: Terrain) -> None:
    """Refuse a rectangle that holds nothing of a terrain.

    Raises:
        RequestError: it is empty, or misses the terrain.
    """
    check_overlap(bounds, terrain.bounds, "the terrain")


def check_overlap(bounds: Bounds, extent: Bounds, name: str) -> None:
    """Refuse a rectangle that has nothing in common with the extent of what is called `name`.

    Raises:
        RequestError: it is empty, or has not.
    """
    refuse_empty(bounds)
    west, south, east, north = bounds
    if west >= extent[2] or east <= extent[0] or south >= extent[3] or north <= extent[1]:
        raise RequestError(
            f"The bounds {' '.join(f'{side:.12g}' for side in bounds)} miss {name}.",
            f"It lies in {' '.join(f'{side:.12g}' for side in extent)}.",
        )


def refuse_empty(bounds: Bounds) -> None:
    """Refuse a rectangle that holds nothing.

    Raises:
        RequestError: it is empty, or has a side that is no number.
    """
    west, south, east, north = bounds
    if not all(map(math.isfinite, bounds)) or west >= east or south >= north:
        raise RequestError(
            f"The bounds {' '.join(f'{side:.12g}' for side in bounds)} are empty.",
            "Give west south east north, west below east and south below north.",
        )


def clip_bounds(terrain: Terrain, bounds: Bounds | None) -> Bounds:
    """The part of a terrain that lies within the bounds; all of it if None."""
    west, south, east, north = terrain.bounds
    if bounds is None:
        return west, south, east, north
    return max(west, bounds[0]), max(south, bounds[1]), min(east, bounds[2]), min(north, bounds[3])
