"""What a terrain consists of."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec import UNSET, to_builtins
from numpy.typing import NDArray

from terratool import __version__
from terratool.definition.findings import Bounds
from terratool.definition.model import Roughness, ranges_of
from terratool.field.terrain import Terrain, clip_bounds
from terratool.field.tracks import track_lengths

_ALONG = 512
"""Points of the grid along the longer side at which the heights are looked at."""

_PLASTIC = 1.32471795724474602596
"""The plastic number spreads points over a square as the golden section does over a line."""


def summarise(terrain: Terrain) -> dict[str, Any]:
    """Size, levels, elements by primitive and surface, heights and memory, ready for JSON.

    `schemas/info.schema.json` describes it. Every key is there; what is not known is None.

    The range of heights is that of the points looked at: an even grid, nine points in the cell of
    each element, corners and edges included, and the ends and the middle of each segment of tracks.
    Where there are too many elements for that, they are left out.
    """
    low, high, points = height_range(terrain)
    bounds = terrain.bounds
    return {
        "format_version": 1,
        "tool": {"name": "terratool", "version": __version__},
        "descr": terrain.descr,
        "size": list(terrain.size),
        "origin": [bounds[0], bounds[1]],
        "bounds": list(bounds),
        "crs": terrain.crs,
        "levels": terrain.levels,
        "elements": terrain.elements,
        "elements_by_primitive": terrain.count_by_primitive(),
        "elements_by_surface": terrain.count_by_surface(),
        "smallest_cell": terrain.smallest_cell,
        "tracks": {
            "count": terrain.tracks,
            "segments": len(terrain.arrays.tracks.segments),
            "length": float(track_lengths(terrain.arrays.tracks).sum()),
        },
        "height": {"low": low, "high": high, "points": points},
        "roughness": [
            {"surface": name, **_roughness(surface.roughness)}
            for name, surface in terrain.surface_types.items()
            if terrain.is_rough and surface.roughness is not UNSET and surface.void is not True
        ],
        "ranges": [one._asdict() for one in ranges_of(terrain.surface_types)],
        "libraries": list(terrain.libraries),
        "bytes": terrain.nbytes,
    }


def _roughness(roughness: Roughness) -> dict[str, float]:
    """What a roughness says, the default of its seed included."""
    values: dict[str, float] = to_builtins(roughness)
    return {"seed": 0} | values


def height_range(
    terrain: Terrain, bounds: Bounds | None = None
) -> tuple[float | None, float | None, int]:
    """Lowest and highest height at the points looked at, and their number; None if all is void.

    Args:
        terrain: the terrain.
        bounds: the part of it to look at, which must hold something; all of it if None.
    """
    part = clip_bounds(terrain, bounds)
    low, high, count = np.inf, -np.inf, 0
    for x, y in (
        _grid_points(part),
        _element_points(terrain, part),
        _track_points(terrain, part),
    ):
        heights = terrain.height(x, y)
        low, high = (
            float(np.fmin.reduce(heights, initial=low)),
            float(np.fmax.reduce(heights, initial=high)),
        )
        count += heights.size
    return (low, high, count) if low <= high else (None, None, count)


def _grid_points(part: Bounds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    west, south, east, north = part
    sides = east - west, north - south
    counts = [max(2, round(_ALONG * side / max(sides))) + 1 for side in sides]
    x, y = np.meshgrid(np.linspace(west, east, counts[0]), np.linspace(south, north, counts[1]))
    return x.ravel(), y.ravel()


def _element_points(
    terrain: Terrain, part: Bounds
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners, edges and middle of what lies of each element's cell in the part.

    They are just inside of its east and north edges.
    """
    by_elements = terrain.by_elements
    if by_elements is None:
        return np.empty(0), np.empty(0)
    cells = by_elements.cells()
    west, south = (np.maximum(cells[n], part[n]) for n in (0, 1))
    east, north = (np.minimum(cells[n], part[n]) for n in (2, 3))
    there = (west < east) & (south < north)
    west, south, east, north = (side[there] for side in (west, south, east, north))
    x = np.stack([west, (west + east) / 2, np.nextafter(east, west)])
    y = np.stack([south, (south + north) / 2, np.nextafter(north, south)])
    x, y = np.broadcast_arrays(x[:, None, :], y[None, :, :])
    return x.ravel(), y.ravel()


def _track_points(
    terrain: Terrain, part: Bounds
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ends and middles of the segments of tracks that lie in the part."""
    west, south, east, north = part
    segments = terrain.arrays.tracks.segments
    x, y = (
        np.concatenate([segments[at], (segments[at] + segments[end]) / 2, segments[end]])
        for at, end in (("x", "end_x"), ("y", "end_y"))
    )
    there = (west <= x) & (x <= east) & (south <= y) & (y <= north)
    return x[there], y[there]


def spread_points(part: Bounds, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The x and the y of so many points that are evenly spread over a rectangle, (count,) each."""
    west, south, east, north = part
    steps = np.arange(1, count + 1)
    return (
        west + np.mod(steps / _PLASTIC, 1.0) * (east - west),
        south + np.mod(steps / _PLASTIC**2, 1.0) * (north - south),
    )
