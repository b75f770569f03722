"""What a terrain consists of."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain

_ALONG = 512
"""Points of the grid along the longer side at which the heights are looked at."""


def summarise(terrain: Terrain) -> dict[str, Any]:
    """Size, levels, elements by primitive and surface, heights and memory, ready for JSON.

    The range of heights is that of the points looked at: an even grid, and nine points in the cell
    of each element, corners and edges included.
    """
    low, high, points = height_range(terrain)
    bounds = terrain.bounds
    return {
        "format_version": 1,
        "descr": terrain.descr,
        "size": list(terrain.size),
        "origin": [bounds[0], bounds[1]],
        "bounds": list(bounds),
        "crs": terrain.crs,
        "levels": terrain.levels,
        "elements": len(terrain.arrays.elements),
        "elements_by_primitive": terrain.count_by_primitive(),
        "elements_by_surface": terrain.count_by_surface(),
        "smallest_cell": terrain.smallest_cell,
        "height": {"low": low, "high": high, "points": points},
        "bytes": terrain.nbytes,
    }


def height_range(terrain: Terrain) -> tuple[float | None, float | None, int]:
    """Lowest and highest height at the points looked at, and their number; None if all is void."""
    low, high, count = np.inf, -np.inf, 0
    for x, y in (_grid_points(terrain), _element_points(terrain)):
        heights = terrain.height(x, y)
        low, high = (
            float(np.fmin.reduce(heights, initial=low)),
            float(np.fmax.reduce(heights, initial=high)),
        )
        count += heights.size
    return (low, high, count) if low <= high else (None, None, count)


def _grid_points(terrain: Terrain) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    west, south, east, north = terrain.bounds
    longest = max(terrain.size)
    counts = [max(2, round(_ALONG * side / longest)) + 1 for side in terrain.size]
    x, y = np.meshgrid(np.linspace(west, east, counts[0]), np.linspace(south, north, counts[1]))
    return x.ravel(), y.ravel()


def _element_points(terrain: Terrain) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners, edges and middle of each element's cell, just inside of its east and north edges."""
    west, south, east, north = terrain.cells()
    x = np.stack([west, (west + east) / 2, np.nextafter(east, west)])
    y = np.stack([south, (south + north) / 2, np.nextafter(north, south)])
    x, y = np.broadcast_arrays(x[:, None, :], y[None, :, :])
    return x.ravel(), y.ravel()
