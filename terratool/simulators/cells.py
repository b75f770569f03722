"""Cells of maps for navigation: square, over all of a terrain."""

from __future__ import annotations

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, count_pixels, refuse_resolution, resolution_within
from terratool.report.wording import count_of

DEFAULT_SIDE = 0.05
"""Default side of a cell, units of the terrain: that of most maps of Nav2."""
MOST = 4096
"""Most cells on the longer side, if no resolution is given."""
MOST_CELLS = 1 << 28
"""Most cells of a map; they take up to 2 GB."""
_WHOLE = 1e-6
"""Relative excess over a side of the terrain up to which a cell is no larger than the side."""


def cell_grid(terrain: Terrain, resolution: float | None, most: int = MOST) -> Grid:
    """Return a grid of cells that covers all of a terrain, counted from its south-west corner.

    Where a cell's side does not divide that of the terrain, the last cells reach over its edge.

    Args:
        terrain: terrain to cover.
        resolution: side of a cell, units of the terrain; if None `DEFAULT_SIDE`, or more where that
            makes too many cells.
        most: most cells on the longer side, if `resolution` is None.

    Raises:
        RequestError: the resolution is no number above 0, is larger than a side of the terrain, or
            makes too many cells.
    """
    west, south, east, north = terrain.bounds
    width, depth = east - west, north - south
    if resolution is None:
        resolution = min(DEFAULT_SIDE, width, depth)
        if count_pixels(max(width, depth), resolution) > most:
            resolution, _ = resolution_within(width, depth, most)
    refuse_resolution(resolution)
    if resolution > min(width, depth) * (1.0 + _WHOLE):
        raise RequestError(
            f"Cells of {resolution:g} are larger than the terrain, of {width:g} × {depth:g}.",
            f"Give at most {min(width, depth):g} with --resolution.",
        )
    columns, rows = count_pixels(width, resolution), count_pixels(depth, resolution)
    if columns * rows > MOST_CELLS:
        raise RequestError(
            f"A resolution of {resolution:g} makes more than {count_of(MOST_CELLS, 'cell')}.",
            "Give a coarser one with --resolution.",
        )
    return Grid(west, south, resolution, rows, columns)
