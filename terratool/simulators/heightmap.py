"""A picture of heights as Gazebo reads it: square, of 8 bits, north up."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.png import png
from terratool.report.numbers import metres

_SIDES = 129, 257, 513, 1025
"""Possible heights a side, one more than a power of 2, as Gazebo wants it; the fewest are taken."""
_FINE = 0.1
"""Widest spacing of heights, units of the terrain, where a side allows it."""
_POINTS = 20_000
"""Random points at which the picture is compared with the terrain."""
_SEED = 8
"""Seed of the random points."""


class HeightMap(NamedTuple):
    """A picture of heights, and its loss. Lengths are in units of the terrain.

    Attributes:
        side: pixels a side.
        low: height of black.
        range: height of white above black, above 0.
        surface: index of the surface that covers most of the ground; -1 for none.
        points: number of random points with ground, where the picture was compared.
        rms: root mean square difference from the terrain at `points`.
        worst: largest difference from the terrain at `points`.
        void: share of the area without ground, 0 to 1.
    """

    side: int
    low: float
    range: float
    surface: int
    points: int
    rms: float
    worst: float
    void: float


def write_heightmap(terrain: Terrain, path: Path) -> HeightMap:
    """Write heights as a square PNG of 8 bits: black is the lowest height, white the highest.

    Pixels are heights at points that are spaced evenly from border to border, the first row in the
    north. Points without ground are black.

    Raises:
        RequestError: there is no ground.
    """
    west, south, east, north = terrain.bounds
    longer = max(east - west, north - south)
    side = next((n for n in _SIDES if longer / (n - 1) <= _FINE), _SIDES[-1])
    x = np.linspace(west, east, side)
    y = np.linspace(north, south, side)
    heights = np.stack([terrain.height(x, np.full(side, row)) for row in y])
    ground = ~np.isnan(heights)
    if not ground.any():
        raise RequestError(
            "There is no ground for a picture: all of it is void, but for what is narrower than "
            f"{metres(longer / (side - 1))}.",
            "Leave out --heightmap, or ask terratool info what the terrain is.",
        )
    rows, columns = np.nonzero(ground)
    surfaces = terrain.sample(x[columns], y[rows]).surface
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    # a level picture has a range, too, or it could not be scaled
    extent = high - low if high > low else 1.0
    pixels = np.rint(np.where(np.isnan(heights), 0.0, (heights - low) / extent) * 255)
    path.write_bytes(png(pixels.astype(np.uint8)[:, :, None]))
    points, rms, worst = _compare(terrain, low + pixels / 255 * extent)
    return HeightMap(
        side=side,
        low=low,
        range=extent,
        surface=int(np.argmax(np.bincount(surfaces + 1))) - 1,
        points=points,
        rms=rms,
        worst=worst,
        void=1.0 - points / _POINTS,
    )


def _compare(terrain: Terrain, heights: NDArray[np.float64]) -> tuple[int, float, float]:
    """Compare heights, (side, side) from the north, with a terrain at random points.

    Returns:
        The number of points with ground, the root mean square difference, and the largest one.
    """
    west, south, east, north = terrain.bounds
    side = len(heights)
    rng = np.random.default_rng(_SEED)
    u, v = rng.random((2, _POINTS))
    exact = terrain.height(west + u * (east - west), north - v * (north - south))
    column, row = u * (side - 1), v * (side - 1)
    i, j = row.astype(int), column.astype(int)
    s, t = row - i, column - j
    above = (1 - t) * heights[i, j] + t * heights[i, j + 1]
    below = (1 - t) * heights[i + 1, j] + t * heights[i + 1, j + 1]
    off = ((1 - s) * above + s * below - exact)[~np.isnan(exact)]
    rms = math.sqrt(float((off**2).mean())) if len(off) else 0.0
    return len(off), rms, float(np.abs(off).max(initial=0.0))
