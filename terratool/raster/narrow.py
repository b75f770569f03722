"""What is narrower than a pixel: elements, tracks, and details of curves. All elements at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.field.extents import finest_details
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.raster.statement import SubpixelFeature, SubpixelFeatures

FIRST = 20
"""So many are named."""


def subpixel_features(terrain: Terrain, grid: Grid) -> tuple[SubpixelFeatures, SubpixelFeatures]:
    """Elements and tracks within the grid that are narrower than a pixel; others with such details.

    An element is as wide as the shorter side of its block of cells. Details are those of
    `finest_details`.
    """
    west, south, east, north = terrain.cells()
    low_x, low_y, high_x, high_y = grid.bounds
    within = (west < high_x) & (east > low_x) & (south < high_y) & (north > low_y)
    wide, tall = east - west, north - south
    # as far as the edges of far cells can be told
    side = grid.resolution * (1 - 1e-9) - 4 * np.spacing(np.abs(terrain.bounds).max())
    widths = np.minimum(wide, tall)
    narrow = within & (widths < side)
    details = finest_details(terrain.arrays, wide, tall)
    detailed = within & ~narrow & (details < side)
    slim, track_widths = _tracks(terrain, grid)
    narrow, widths = (
        np.append(narrow, slim & (track_widths < side)),
        np.append(widths, track_widths),
    )
    return _named(terrain, narrow, widths), _named(terrain, detailed, details)


def _tracks(terrain: Terrain, grid: Grid) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which tracks may reach the grid, by the rectangles around their segments; their widths."""
    tracks = terrain.arrays.tracks
    segments, reach = tracks.segments, tracks.segments["reach"]
    west, south, east, north = grid.bounds
    within = (
        (np.minimum(segments["x"], segments["end_x"]) - reach < east)
        & (np.maximum(segments["x"], segments["end_x"]) + reach > west)
        & (np.minimum(segments["y"], segments["end_y"]) - reach < north)
        & (np.maximum(segments["y"], segments["end_y"]) + reach > south)
    )
    reached = np.zeros(terrain.tracks, np.bool_)
    reached[segments["track"][within]] = True
    return reached, 2.0 * reach[tracks.first[:-1]]


def _named(
    terrain: Terrain, which: NDArray[np.bool_], widths: NDArray[np.float64]
) -> SubpixelFeatures:
    indices = np.flatnonzero(which)
    first = tuple(
        SubpixelFeature(str(terrain.pointer(index)), float(widths[index]))
        for index in indices[:FIRST].tolist()
    )
    return SubpixelFeatures(len(indices), first)
