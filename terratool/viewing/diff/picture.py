"""Picture of a difference: cut and fill in red and blue over the new ground, or the new tops."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.io.geotiff import TILE
from terratool.raster.grid import Grid, Window, grid_over
from terratool.report.wording import count_of
from terratool.tasks import processors
from terratool.viewing.diff.ground import Both, ComparedWindow, paint_windows
from terratool.viewing.diff.results import Difference
from terratool.viewing.diff.tops import paint_tops
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
_LOST, _GAINED, _SURFACE, _BELOW = (40, 40, 40), (240, 228, 66), (204, 187, 214), (230, 159, 0)


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
        what = (
            "Red was cut, blue was filled; the new ground" if both.whole is None
            else "Red is lower, blue is higher: the new tops, seen from above"
        )  # fmt: skip
        caption = f"{what}, light from the north-west{steeper}."
        drawn = DifferenceSheet(picture, _title(difference), caption)
        write_sheet(drawn, places, both.new, path, overwrite)


def _title(difference: Difference) -> str:
    ground = difference.ground
    if ground is None:
        return "Same ground"
    cut, fill = (number(float(f"{volume:.4g}")) for volume in (ground.cut, ground.fill))
    title = f"Cut {cut} m³, filled {fill} m³"
    if difference.storeys is UNSET:
        return title
    count = len(difference.storeys)
    return f"{title}; {count_of(count, 'storey')} differ{'s' * (count == 1)}"


def _picture(both: Both, grid: Grid, tolerance: float) -> LayerPicture:
    """Colours and legend of all pixels."""
    from matplotlib import colormaps

    seen, below = _paint(both, grid, tolerance)
    change, was, now = seen.change, np.isfinite(seen.old), np.isfinite(seen.new)
    size = np.abs(change)
    beyond = size > tolerance
    most = float(np.max(size, where=was & now, initial=0.0))
    colors = np.empty((*change.shape, 3))
    colors[:] = _SAME
    other = was & now & (seen.old_surface != seen.new_surface)
    colors[other] = _SURFACE
    colors[below] = _BELOW
    if beyond.any():
        colors[beyond] = 255.0 * colormaps[_COLORS](0.5 + 0.5 * change[beyond] / most)[:, :3]
    lost, gained = was & ~now, now & ~was
    colors[lost], colors[gained] = _LOST, _GAINED
    swatches = [Swatch("no change", _SAME)]
    for mask, label, color in (
        (other & ~beyond & ~below, "other surface", _SURFACE),
        (below & ~beyond & (was == now), "changed below", _BELOW), (lost, "became void", _LOST),
        (gained, "was void", _GAINED),
    ):  # fmt: skip
        if mask.any():
            swatches.append(Swatch(label, color))
    heights = np.where(now, seen.new, np.where(lost, seen.old, np.nan))
    scale = Scale("new less old (m)", -most, most, _COLORS) if beyond.any() else None
    key = Legend("Ground" if both.whole is None else "Tops", tuple(swatches), scale)
    surfaces = np.zeros(change.shape, np.uint8)
    return LayerPicture(grid, heights, surfaces, colors, key, LIGHT)


def _paint(both: Both, grid: Grid, tolerance: float) -> tuple[ComparedWindow, NDArray[np.bool_]]:
    """Pixels of a grid on both terrains, and where anything of their columns differs."""
    shape = grid.height, grid.width
    planes = ComparedWindow(
        np.empty(shape), np.empty(shape), np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    )
    below = np.zeros(shape, np.bool_)
    windows = list(grid.windows(TILE, TILE))
    if both.whole is None:
        painted = paint_windows(both, grid, windows, processors())
    else:
        painted = _tops(both, grid, windows, tolerance, below)
    for window, seen in painted:
        for whole, part in zip(planes, seen, strict=True):
            whole[_rows(window)] = part
    return planes, below


def _tops(
    both: Both, grid: Grid, windows: list[Window], tolerance: float, below: NDArray[np.bool_]
) -> Iterator[tuple[Window, ComparedWindow]]:
    """Yield windows with the highest tops, and mark where anything differs."""
    for window, tops in paint_tops(both, grid, windows, tolerance, processors()):
        below[_rows(window)] = tops.other
        yield window, tops.seen


def _rows(window: Window) -> tuple[slice, slice]:
    return (
        slice(window.row, window.row + window.height),
        slice(window.column, window.column + window.width),
    )
