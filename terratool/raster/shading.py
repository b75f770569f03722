"""Hillshade, vertical exaggeration, contour intervals and axis ticks for pictures."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Heights = NDArray[np.float32] | NDArray[np.float64]

LIGHT = np.radians(315.0), np.radians(45.0)
"""Azimuth and elevation of the light, rad."""
_RELIEF = np.tan(np.radians(40.0))
"""Slope to which the 95th percentile of slopes is exaggerated."""
_MOST = 10.0
"""Largest exaggeration."""
_CONTOURS = 8
"""Approximate number of contours."""
_LEVEL = 1e-3
"""Least range of heights with contours, world units."""


def exaggeration(heights: Heights, resolution: float) -> float:
    """Factor on heights for the shading, 1 to 10, so that gentle hills show."""
    east, north = _gradient(heights, resolution)
    steepness = np.hypot(east, north)
    steepness = steepness[steepness > 0.0]
    if not steepness.size:
        return 1.0
    factor = float(np.clip(_RELIEF / np.quantile(steepness, 0.95), 1.0, _MOST))
    return float(f"{factor:.1g}")


def hillshade(heights: Heights, resolution: float, exaggerated: float = 1.0) -> NDArray[np.float64]:
    """Brightness of the ground, 0 to 1, (height, width) float64; level ground has sin 45°.

    Slopes by Horn's formula (B. K. P. Horn, Hill shading and the reflectance map, Proceedings of
    the IEEE 69(1), 1981), light from the north-west; missing neighbours count as level.

    Args:
        heights: (height, width), rows from the north, NaN without ground.
        resolution: side of a pixel, world units.
        exaggerated: factor on heights.
    """
    east, north = _gradient(heights, resolution)
    azimuth, height = LIGHT
    east, north = east * exaggerated, north * exaggerated
    towards = -east * np.sin(azimuth) - north * np.cos(azimuth)
    light = (np.sin(height) + towards * np.cos(height)) / np.sqrt(1.0 + east**2 + north**2)
    return np.asarray(np.clip(light, 0.0, 1.0))


def shade_bytes(heights: Heights, resolution: float) -> NDArray[np.uint8]:
    """Brightness of the ground as `gdaldem hillshade -compute_edges` has it: 1 to 255, 0 for none.

    Args:
        heights: (height, width), rows from the north, NaN without ground.
        resolution: side of a pixel, world units.
    """
    shade = np.rint(1.0 + 254.0 * hillshade(heights, resolution)).astype(np.uint8)
    shade[np.isnan(heights)] = 0
    return shade


def contour_interval(heights: Heights) -> float:
    """Height between contours: 1, 2 or 5 times a power of ten; 0 for level ground."""
    known = heights[np.isfinite(heights)]
    if not known.size or float(np.ptp(known)) < _LEVEL:
        return 0.0
    found = ticks(0.0, float(np.ptp(known)), _CONTOURS)
    return found[1] if len(found) > 1 else 0.0


def ticks(first: float, last: float, count: int) -> list[float]:
    """About `count` round numbers from first to last, 1, 2 or 5 times a power of ten apart."""
    raw = (last - first) / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * 0.999)
    start = math.ceil(first / step - 1e-9)
    return [index * step for index in range(start, math.floor(last / step + 1e-9) + 1)]


def _gradient(
    heights: Heights, resolution: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slopes to the east and to the north by Horn's weights, (height, width); 0 where unknown."""
    padded = np.pad(heights.astype(np.float64), 1, mode="reflect", reflect_type="odd")
    middle = padded[1:-1, 1:-1]
    known = bool(np.isfinite(padded).all())  # as mostly, which takes a third of the time
    rows, columns = middle.shape

    def at(row: int, column: int) -> NDArray[np.float64]:
        near = padded[1 + row : 1 + row + rows, 1 + column : 1 + column + columns]
        return near if known else np.where(np.isfinite(near), near, middle)

    east = at(-1, 1) + 2.0 * at(0, 1) + at(1, 1) - at(-1, -1) - 2.0 * at(0, -1) - at(1, -1)
    north = at(-1, -1) + 2.0 * at(-1, 0) + at(-1, 1) - at(1, -1) - 2.0 * at(1, 0) - at(1, 1)
    east /= 8.0 * resolution
    north /= 8.0 * resolution
    return (east, north) if known else (np.nan_to_num(east), np.nan_to_num(north))
