"""The picture of a difference: what was cut and filled, in red and blue over the new ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terratool.errors import RequestError
from terratool.output import refuse_existing, refuse_missing_folder, whole_file
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.prefetch import TILE, processors
from terratool.raster.shading import exaggeration
from terratool.viewing.diff.ground import Both, windows_painted
from terratool.viewing.diff.ground import Difference as Seen
from terratool.viewing.diff.results import Difference
from terratool.viewing.layers import FINER, LayerPicture, Light
from terratool.viewing.options import RenderOptions
from terratool.viewing.plan import (
    Margins,
    draw_frame,
    draw_margins,
    layout,
    shaded,
    unit_of,
)
from terratool.viewing.sheet import (
    Key,
    Scale,
    Swatch,
    new_sheet,
    number,
    require_matplotlib,
    settings,
    write,
)

_COLORS = "RdBu"
"""Red for what was cut, blue for what was filled: distinct for any kind of colour vision."""
_SAME = (226, 226, 222)
_LOST, _GAINED, _SURFACE = (40, 40, 40), (240, 228, 66), (204, 187, 214)
_LIGHT = Light(contrast=0.8, shade=0.55, glare=1.12, steeper=10.0)


def refuse_picture(path: str | Path, overwrite: bool) -> None:
    """Refuse a picture that cannot be drawn, before any work.

    Raises:
        RequestError: it is no .png, or Matplotlib is missing.
        WriteError: it exists, or its folder does not.
    """
    if Path(path).suffix.lower() != ".png":
        raise RequestError(f"{Path(path).name}: is no .png.", "Give a name that ends in .png.")
    require_matplotlib()
    refuse_existing(Path(path), overwrite)
    refuse_missing_folder(Path(path))


def write_picture(
    both: Both, difference: Difference, path: str | Path, *, tolerance: float,
    overwrite: bool = False,
) -> None:  # fmt: skip
    """Draw a difference. The same definitions give the same bytes.

    Args:
        both: the terrains.
        difference: what is known of them, for the title.
        path: a .png.
        tolerance: heights that differ by less are not coloured.
        overwrite: whether it may be there already.

    Raises:
        RequestError: it is no .png, Matplotlib is missing, or the ground is too narrow to be seen.
        WriteError: it exists, or cannot be written.
    """
    refuse_picture(path, overwrite)
    options = RenderOptions(size=1200)
    west, south, east, north = both.bounds
    sides = east - west, north - south
    margins = Margins(left=48.0, bottom=76.0, right=122.0, top=26.0)
    with settings():
        places = layout(sides, options, margins)
        grid = grid_over(both.old, sides[0] / (places.ground.width * FINER), both.bounds)
        picture = _picture(both, grid, tolerance)
        factor = min(exaggeration(picture.heights, grid.resolution), _LIGHT.steeper)
        sheet = new_sheet(places.width, places.height, options.dpi)
        axes = sheet.axes(places.ground)
        box = grid.bounds
        axes.imshow(
            shaded(picture, options.dpi, factor), extent=(box[0], box[2], box[1], box[3]),
            aspect="auto", interpolation="none", origin="upper",
        )  # fmt: skip
        axes.set_xlim(box[0], box[2])
        axes.set_ylim(box[1], box[3])
        unit = unit_of(both.new)
        draw_frame(sheet, axes, places, unit)
        steeper = f"; slopes shaded {factor:g} times as steep" if factor != 1.0 else ""
        caption = (
            f"Red was cut, blue was filled; the new ground, light from the north-west{steeper}."
        )
        draw_margins(sheet, places, picture, unit, [caption])
        left = places.ground.left
        sheet.title(_title(difference), left, places.width - left - sheet.pixels(6.0))
        sheet.key(picture.key, places.key)
        with whole_file(path, overwrite) as part:
            write(sheet, part)


def _title(difference: Difference) -> str:
    ground = difference.ground
    if ground is None:
        return "Same ground"
    cut, fill = (number(float(f"{volume:.4g}")) for volume in (ground.cut, ground.fill))
    return f"Cut {cut} m³, filled {fill} m³"


def _picture(both: Both, grid: Grid, tolerance: float) -> LayerPicture:
    """The colours of all pixels."""
    from matplotlib import colormaps

    seen = _painted(both, grid)
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
    key = Key("Ground", tuple(swatches), scale)
    surfaces = np.zeros(change.shape, np.uint8)
    return LayerPicture(grid, heights, surfaces, colors, key, _LIGHT)


def _painted(both: Both, grid: Grid) -> Seen:
    """Both terrains at all pixels."""
    shape = grid.height, grid.width
    planes = Seen(
        np.empty(shape), np.empty(shape), np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    )
    windows = list(grid.windows(TILE, TILE))
    for window, seen in windows_painted(both, grid, windows, processors()):
        for whole, part in zip(planes, seen, strict=True):
            whole[_rows(window)] = part
    return planes


def _rows(window: Window) -> tuple[slice, slice]:
    return (
        slice(window.row, window.row + window.height),
        slice(window.column, window.column + window.width),
    )
