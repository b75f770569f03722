"""Picture of a difference: cut and fill in red and blue over the new ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terratool.io.geotiff import TILE
from terratool.raster.grid import Grid, Window, grid_over
from terratool.tasks import processors
from terratool.viewing.diff.ground import Both, ComparedWindow, paint_windows
from terratool.viewing.diff.results import Difference
from terratool.viewing.differences import (
    LIGHT,
    DifferenceSheet,
    refuse_picture,
    shading_factor,
    sheet_layout,
    write_sheet,
)
from terratool.viewing.layers import FINER, LayerPicture
from terratool.viewing.sheet import Legend, Scale, Swatch, number, settings

_COLORS = "RdBu"
"""Matplotlib's map from red (cut) to blue (fill), distinct for any kind of colour vision."""
_SAME = (226, 226, 222)
_LOST, _GAINED, _SURFACE = (40, 40, 40), (240, 228, 66), (204, 187, 214)


def write_picture(
    both: Both, difference: Difference, path: str | Path, *, tolerance: float,
    overwrite: bool = False,
) -> None:  # fmt: skip
    """Draw a difference. Equal definitions give equal bytes.

    Args:
        both: both terrains.
        difference: differences, for the title.
        path: file of the picture, a .png.
        tolerance: largest difference of heights that is not coloured.
        overwrite: whether an existing file is replaced.

    Raises:
        RequestError: the file is no .png, Matplotlib is missing, or the ground is too narrow.
        WriteError: the file exists, or cannot be written.
    """
    refuse_picture(path, overwrite)
    wide = both.bounds[2] - both.bounds[0]
    with settings():
        places = sheet_layout(both.bounds)
        grid = grid_over(both.old, wide / (places.ground.width * FINER), both.bounds)
        picture = _picture(both, grid, tolerance)
        factor = shading_factor(picture)
        steeper = f"; slopes shaded {factor:g} times as steep" if factor != 1.0 else ""
        caption = (
            f"Red was cut, blue was filled; the new ground, light from the north-west{steeper}."
        )
        drawn = DifferenceSheet(picture, _title(difference), caption)
        write_sheet(drawn, places, both.new, path, overwrite)


def _title(difference: Difference) -> str:
    ground = difference.ground
    if ground is None:
        return "Same ground"
    cut, fill = (number(float(f"{volume:.4g}")) for volume in (ground.cut, ground.fill))
    return f"Cut {cut} m³, filled {fill} m³"


def _picture(both: Both, grid: Grid, tolerance: float) -> LayerPicture:
    """Colours and legend of all pixels."""
    from matplotlib import colormaps

    seen = _paint(both, grid)
    change, was, now = seen.change, np.isfinite(seen.old), np.isfinite(seen.new)
    size = np.abs(change)
    beyond = size > tolerance
    most = float(np.max(size, where=was & now, initial=0.0))
    colors = np.empty((*change.shape, 3))
    colors[:] = _SAME
    other = was & now & (seen.old_surface != seen.new_surface)
    colors[other] = _SURFACE
    if beyond.any():
        colors[beyond] = 255.0 * colormaps[_COLORS](0.5 + 0.5 * change[beyond] / most)[:, :3]
    lost, gained = was & ~now, now & ~was
    colors[lost], colors[gained] = _LOST, _GAINED
    swatches = [Swatch("no change", _SAME)]
    for mask, label, color in (
        (other & ~beyond, "other surface", _SURFACE), (lost, "became void", _LOST),
        (gained, "was void", _GAINED),
    ):  # fmt: skip
        if mask.any():
            swatches.append(Swatch(label, color))
    heights = np.where(now, seen.new, np.where(lost, seen.old, np.nan))
    scale = Scale("new less old (m)", -most, most, _COLORS) if beyond.any() else None
    key = Legend("Ground", tuple(swatches), scale)
    surfaces = np.zeros(change.shape, np.uint8)
    return LayerPicture(grid, heights, surfaces, colors, key, LIGHT)


def _paint(both: Both, grid: Grid) -> ComparedWindow:
    """Pixels of a grid on both terrains."""
    shape = grid.height, grid.width
    planes = ComparedWindow(
        np.empty(shape), np.empty(shape), np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    )
    windows = list(grid.windows(TILE, TILE))
    for window, seen in paint_windows(both, grid, windows, processors()):
        for whole, part in zip(planes, seen, strict=True):
            whole[_rows(window)] = part
    return planes


def _rows(window: Window) -> tuple[slice, slice]:
    return (
        slice(window.row, window.row + window.height),
        slice(window.column, window.column + window.width),
    )
