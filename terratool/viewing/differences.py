"""Sheets that show the difference of two grounds in colours over shaded ground."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.output import refuse_existing, refuse_missing_folder, whole_file
from terratool.raster.shading import exaggeration
from terratool.viewing.layers import LayerPicture, Light
from terratool.viewing.options import RenderOptions
from terratool.viewing.plan import (
    PlanLayout,
    SheetMargins,
    axis_room,
    draw_frame,
    draw_margins,
    layout,
    shade_picture,
    unit_of,
)
from terratool.viewing.sheet import new_sheet, require_matplotlib, write

LIGHT = Light(contrast=0.8, shade=0.55, glare=1.12, steeper=10.0)
"""Light on the colours of differences."""
_OPTIONS = RenderOptions(pixels=1200)
"""Options of all sheets."""


class DifferenceSheet(NamedTuple):
    """The contents of a sheet of differences.

    Attributes:
        picture: colours over the ground.
        title: title of the sheet.
        caption: one or two sentences at the bottom.
        ring: world x and y of a place that is ringed; None for none.
    """

    picture: LayerPicture
    title: str
    caption: str
    ring: tuple[float, float] | None = None


def refuse_picture(path: str | Path, overwrite: bool) -> None:
    """Refuse a picture that cannot be drawn, before any work.

    Raises:
        RequestError: the path is no .png, or Matplotlib is missing.
        WriteError: the picture exists already, or its folder does not.
    """
    if Path(path).suffix.lower() != ".png":
        raise RequestError(f"{Path(path).name}: is no .png.", "Give a name that ends in .png.")
    require_matplotlib()
    refuse_existing(Path(path), overwrite)
    refuse_missing_folder(Path(path))


def sheet_layout(bounds: Bounds) -> PlanLayout:
    """The layout of a sheet of ground with bounds.

    Raises:
        RequestError: the ground would be too narrow to be seen.
    """
    west, south, east, north = bounds
    margins = SheetMargins(left=axis_room(south, north), bottom=76.0, right=122.0, top=26.0)
    return layout((east - west, north - south), _OPTIONS, margins)


def shading_factor(picture: LayerPicture) -> float:
    """Factor on slopes of a picture's ground in its shading."""
    return min(exaggeration(picture.heights, picture.grid.resolution), LIGHT.steeper)


def write_sheet(
    drawn: DifferenceSheet, places: PlanLayout, terrain: Terrain, path: str | Path, overwrite: bool
) -> None:
    """Draw a sheet into a file; within `settings()`.

    Args:
        drawn: contents of the sheet.
        places: layout, from `sheet_layout`.
        terrain: the terrain, whose unit of lengths the axes have.
        path: path of the picture, a .png.
        overwrite: whether the picture may exist already.

    Raises:
        WriteError: the picture exists already, or cannot be written.
    """
    picture = drawn.picture
    sheet = new_sheet(places.width, places.height, _OPTIONS.dpi)
    axes = sheet.axes(places.ground)
    west, south, east, north = picture.grid.bounds
    axes.imshow(
        shade_picture(picture, _OPTIONS.dpi, shading_factor(picture)),
        extent=(west, east, south, north), aspect="auto", interpolation="none", origin="upper",
    )  # fmt: skip
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    if drawn.ring is not None:
        axes.plot(
            *([value] for value in drawn.ring), marker="o", markersize=9.0, markerfacecolor="none",
            markeredgecolor="black", markeredgewidth=1.2,
        )  # fmt: skip
    unit = unit_of(terrain)
    draw_frame(sheet, axes, places, unit)
    draw_margins(sheet, places, picture, unit, [drawn.caption])
    left = places.ground.left
    sheet.title(drawn.title, left, places.width - left - sheet.pixels(6.0))
    sheet.key(picture.key, places.key)
    with whole_file(path, overwrite) as part:
        write(sheet, part)
