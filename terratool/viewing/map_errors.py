"""The picture of a robot's map: where it is too high, too low or unknown, over the ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, grid_over
from terratool.report.numbers import round_down, tenths
from terratool.sensing.comparison import MapComparison
from terratool.viewing.differences import (
    LIGHT,
    DifferenceSheet,
    refuse_picture,
    sheet_layout,
    write_sheet,
)
from terratool.viewing.layers import FINER, LayerPicture
from terratool.viewing.sheet import Legend, Scale, Swatch, settings

_COLORS = "RdBu_r"
"""Colour map of errors: red is too high, blue too low, for any kind of colour vision."""
_NEVER, _GROUNDLESS = (150, 150, 146), (240, 228, 66)
"""Colours of cells never seen, and of known cells where the terrain has no ground."""
_MOST = 90.0
"""Percentile of the sizes of errors at which the colours end, so that no wall takes them all."""
_LEAST = 1e-3
"""Least size of errors at which the colours end, m."""


def write_picture(
    comparison: MapComparison, terrain: Terrain, path: str | Path, *, overwrite: bool = False
) -> None:
    """Draw the errors of a map. Equal maps and terrains give equal bytes.

    Args:
        comparison: the map, compared with the terrain.
        terrain: the terrain of the map.
        path: path of the picture, a .png.
        overwrite: whether the picture may exist already.

    Raises:
        RequestError: the path is no .png, Matplotlib is missing, or the ground is too narrow to be
            seen.
        WriteError: the picture exists already, or cannot be written.
    """
    refuse_picture(path, overwrite)
    with settings():
        places = sheet_layout(terrain.bounds)
        wide = terrain.bounds[2] - terrain.bounds[0]
        grid = grid_over(terrain, wide / (places.ground.width * FINER))
        size = np.abs(_errors(comparison))
        size = size[np.isfinite(size)]
        most = max(float(np.percentile(size, _MOST)) if size.size else 0.0, _LEAST)
        most = 1.0 / round_down(1.0 / most)  # the next of 1, 2 or 5 times a power of ten
        worst = comparison.worst
        caption = "Red is too high, blue too low."
        if comparison.map.gap is not None:
            caption += " Of several patches the one that is off most is drawn."
        if worst is not None:
            caption += " The ring is the worst place."
        if beyond := float((size > most).sum()):
            caption += f" Beyond the colours: {tenths(beyond / size.size)}."
        picture = _picture(comparison, terrain, grid, most)
        ring = None if worst is None else (worst.x, worst.y)
        drawn = DifferenceSheet(picture, _title(comparison), caption, ring)
        write_sheet(drawn, places, terrain, path, overwrite)


def _title(comparison: MapComparison) -> str:
    of = "the ground" if comparison.face != "nearest" else "all tops"
    known = f"{tenths(comparison.coverage)} of {of}" if comparison.ground else "No ground"
    if not comparison.errors.cells:
        return known
    return f"{known}, RMSE {comparison.errors.rmse:.3g} m"


def _errors(comparison: MapComparison) -> NDArray[np.float64]:
    """Map less terrain, (height, width) float64 m by cell; NaN where map or ground is unknown.

    Of several patches of a cell the one counts that is off most.
    """
    truth = comparison.truth.reshape(-1, *comparison.truth.shape[-2:])
    mapped = np.stack([one.elevation for one in comparison.map.storeys])
    errors = mapped - truth
    size = np.where(np.isnan(errors), -1.0, np.abs(errors)).argmax(axis=0)
    out: NDArray[np.float64] = np.take_along_axis(errors, size[None], axis=0)[0]
    return out


def _picture(comparison: MapComparison, terrain: Terrain, grid: Grid, most: float) -> LayerPicture:
    """The layer of errors: each pixel has the colour of the cell that holds its middle."""
    from matplotlib import colormaps

    level = comparison.map.level
    errors = _errors(comparison)
    heights = terrain.height(grid.columns(grid.whole)[None, :], grid.rows(grid.whole)[:, None])
    shares = np.clip(0.5 + 0.5 * errors / most, 0.0, 1.0)
    of_cells = 255.0 * colormaps[_COLORS](np.nan_to_num(shares, nan=0.5))[..., :3]
    of_cells[np.isnan(errors)] = _NEVER
    groundless = np.isfinite(level.elevation) & np.isnan(errors)
    of_cells[groundless] = _GROUNDLESS
    cells = level.grid
    column = np.floor((grid.columns(grid.whole) - cells.west) / cells.resolution).astype(np.int64)
    row = np.floor((cells.bounds[3] - grid.rows(grid.whole)) / cells.resolution).astype(np.int64)
    colors = _cell_colors(of_cells, row, column)
    swatches = [Swatch("never seen", _NEVER)]
    if groundless.any():
        swatches.append(Swatch("no ground there", _GROUNDLESS))
    key = Legend("Map", tuple(swatches), Scale("map less terrain (m)", -most, most, _COLORS))
    return LayerPicture(grid, heights, np.zeros(heights.shape, np.uint8), colors, key, LIGHT)


def _cell_colors(
    of_cells: NDArray[np.float64], row: NDArray[np.int64], column: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Colours at rows and columns of cells; beyond the cells that of cells never seen."""
    height, width, _ = of_cells.shape
    colors = of_cells[np.clip(row, 0, height - 1)[:, None], np.clip(column, 0, width - 1)]
    colors[(row < 0) | (row >= height)] = _NEVER
    colors[:, (column < 0) | (column >= width)] = _NEVER
    return colors
