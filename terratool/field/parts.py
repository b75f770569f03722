"""Parts of a terrain: rectangles in the world that a user asks for."""

from __future__ import annotations

import math

from terratool.errors import RequestError
from terratool.field.terrain import Terrain

Bounds = tuple[float, float, float, float]
"""West, south, east, north."""


def check_bounds(bounds: Bounds, terrain: Terrain) -> None:
    """Refuse a rectangle that holds nothing of a terrain.

    Raises:
        RequestError: it is empty, or misses the terrain.
    """
    west, south, east, north = bounds
    if not all(map(math.isfinite, bounds)) or west >= east or south >= north:
        raise RequestError(
            f"The bounds {' '.join(f'{side:.12g}' for side in bounds)} are empty.",
            "Give west south east north, west below east and south below north.",
        )
    t_west, t_south, t_east, t_north = terrain.bounds
    if west >= t_east or east <= t_west or south >= t_north or north <= t_south:
        raise RequestError(
            f"The bounds {' '.join(f'{side:.12g}' for side in bounds)} miss the terrain.",
            f"It lies in {' '.join(f'{side:.12g}' for side in terrain.bounds)}.",
        )


def part_within(terrain: Terrain, bounds: Bounds | None) -> Bounds:
    """The part of a terrain that lies within the bounds; all of it if None."""
    west, south, east, north = terrain.bounds
    if bounds is None:
        return west, south, east, north
    return max(west, bounds[0]), max(south, bounds[1]), min(east, bounds[2]), min(north, bounds[3])
