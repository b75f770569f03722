"""Sheets that show by how much two grounds differ, in colours over shaded ground."""

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
    Layout,
    Margins,
    draw_frame,
    draw_margins,
    layout,
    shaded,
    unit_of,
)
from terratool.viewing.sheet import new_sheet, require_matplotlib, write

LIGHT = Light(contrast=0.8, shade=0.55, glare=1.12, steeper=10.0)
_OPTIONS = RenderOptions(size=1200)


class DifferenceSheet(NamedTuple):
    """What is on a sheet.

    Attributes:
        picture: the colours and the ground.
        title: it.
        caption: a sentence or two at the bottom.
        ring: (x, y) of a place that is ringed, if any.
    """

    picture: LayerPicture
    title: str
    caption: str
    ring: tuple[float, float] | None = None


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


def sheet_layout(bounds: Bounds) -> Layout:
    """Where all stands on the sheet of ground with these bounds.

    Raises:
        RequestError: the ground would be too narrow to be seen.
    """
    west, south, east, north = bounds
    margins = Margins(left=48.0, bottom=76.0, right=122.0, top=26.0)
    return layout((east - west, north - south), _OPTIONS, margins)


def shading_factor(picture: LayerPicture) -> float:
    """How many times as steep as they are slopes are shaded."""
    return min(exaggeration(picture.heights, picture.grid.resolution), LIGHT.steeper)


def write_sheet(
    drawn: DifferenceSheet, places: Layout, terrain: Terrain, path: str | Path, overwrite: bool
) -> None:
    """Draw a sheet; within `settings()`.

    Args:
        drawn: what is on it.
        places: as `sheet_layout` has them.
        terrain: what the unit of lengths is of.
        path: a .png.
        overwrite: whether it may be there already.

    Raises:
        WriteError: it exists, or cannot be written.
    """
    picture = drawn.picture
    sheet = new_sheet(places.width, places.height, _OPTIONS.dpi)
    axes = sheet.axes(places.ground)
    west, south, east, north = picture.grid.bounds
    axes.imshow(
        shaded(picture, _OPTIONS.dpi, shading_factor(picture)), extent=(west, east, south, north),
        aspect="auto", interpolation="none", origin="upper",
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
