"""A plan: the terrain from above, shaded, with axes and a legend."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import DefinitionError, RequestError
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.raster.geotiff import crs_of
from terratool.raster.grid import grid_over
from terratool.raster.shading import exaggeration, hillshade
from terratool.report.wording import count_of
from terratool.traversability.judge import Judge
from terratool.viewing.cells import LABEL, Label, cell_lines
from terratool.viewing.contours import draw_contours
from terratool.viewing.layers import (
    FINER,
    NO_GROUND,
    LayerPicture,
    layer_picture,
    level_light,
    light_on,
)
from terratool.viewing.options import RenderOptions
from terratool.viewing.sheet import (
    INK,
    Legend,
    Rectangle,
    Sheet,
    key_width,
    new_sheet,
    number,
    set_ticks,
    width_of,
)
from terratool.viewing.vision import roomiest_places

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BAND = 512
"""Approximate number of painted rows that are shaded at a time."""
_SAMPLED = 4000
"""Most pixels of the longer side on which the steepness of the ground is measured."""
_HATCH = 6.0
"""Distance from one line of hatching to the next, points."""
_LEAST_MAP = 8
"""Fewest pixels of the shorter side of the ground."""

_UNITS = {"metre": "m", "meter": "m", "foot": "ft", "US survey foot": "US ft", "degree": "°"}
"""Short names of units of lengths."""


class PlanLayout(NamedTuple):
    """The layout of a sheet, in pixels.

    Attributes:
        width, height: sides of the sheet.
        ground: rectangle of the picture of the ground.
        key: rectangle of the legend.
    """

    width: int
    height: int
    ground: Rectangle
    key: Rectangle


class SheetMargins(NamedTuple):
    """Widths of the margins around the ground, points."""

    left: float
    bottom: float
    right: float
    top: float


NO_MARGINS = SheetMargins(1.0, 1.0, 1.0, 1.0)
"""Margins of pictures without letters."""


class Drawn(NamedTuple):
    """A finished sheet.

    Attributes:
        sheet: the sheet.
        what: contents of the sheet, in words.
        notes: sentences on choices, and on facts that the sheet does not show.
    """

    sheet: Sheet
    what: str
    notes: tuple[str, ...]


def unit_of(terrain: Terrain) -> str:
    """Unit of x and y, from the reference system; "m" without one, "units" for an unknown one."""
    try:
        crs = crs_of(terrain)
        if crs is None:
            return "m"
        name = "degree" if crs.is_geographic else str(crs.linear_units)
    except (DefinitionError, ValueError):  # the library does not know the system, or its unit
        return "units"
    return _UNITS.get(name, name or "units")


def layout(sides: tuple[float, float], options: RenderOptions, margins: SheetMargins) -> PlanLayout:
    """Lay out a sheet around ground with sides (x, y); its longer side has the wanted size.

    Raises:
        RequestError: the ground would be too narrow to be seen.
    """
    per_point = options.dpi / 72.0
    left, bottom, right, top = (math.ceil(part * per_point) for part in margins)
    across, down = options.pixels - left - right, options.pixels - bottom - top
    if min(across, down) < 3 * _LEAST_MAP:
        raise RequestError(
            "There is no room for the ground beside the letters.",
            "Give more --pixels or a smaller --dpi, or --no-legend.",
        )
    per_pixel = max(sides[0] / across, sides[1] / down)
    width = round(sides[0] / per_pixel)
    height = round(sides[1] / per_pixel)
    if min(width, height) < _LEAST_MAP:
        raise RequestError(
            f"The ground is {sides[0]:,.6g} by {sides[1]:,.6g} units: in the picture it would be "
            f"{max(width, 1)} by {max(height, 1)} pixels.",
            "Look at a part of it with --bounds W S E N.",
        )
    least = 0 if options.bare else min(options.pixels, math.ceil(150.0 * per_point))
    tall = max(height + bottom + top, least)
    wide = max(width + left + right, least)
    ground = Rectangle(left, tall - top - height, width, height)
    beside = left + width + math.ceil(10.0 * per_point)
    low = math.ceil(4.0 * per_point)
    key = Rectangle(beside, low, max(wide - beside - low, 0), tall - top - low)
    return PlanLayout(wide, tall, ground, key)


def draw_plan(
    terrain: Terrain,
    options: RenderOptions,
    judge: Judge | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> Drawn:
    """Draw a plan, within `terratool.viewing.sheet.settings`.

    Raises:
        RequestError: the bounds miss the terrain, the layer has nothing to show, contours would be
            too many, or the ground is too narrow.
    """
    if options.bounds is not None:
        check_bounds(options.bounds, terrain)
    part = clip_bounds(terrain, options.bounds)
    sides = part[2] - part[0], part[3] - part[1]
    # the ground's room depends on the legend, whose width must be known before painting
    room = (150.0 if options.layer == "surface" else 110.0) if options.has_legend else 0.0
    if options.has_legend and options.layer == "surface":
        from terratool.viewing.sheet import Swatch

        names = [Swatch(name, (0, 0, 0)) for name in (*terrain.surfaces, "void, no ground")]
        room = key_width(Legend("", tuple(names)))
    title = options.title_of(terrain.descr)
    margins = (
        NO_MARGINS
        if options.bare
        else SheetMargins(
            left=axis_room(part[1], part[3]),
            bottom=76.0,
            right=room + 20.0 if options.has_legend else 14.0,
            top=26.0 if title else 10.0,
        )
    )
    places = layout(sides, options, margins)
    picture, factor = _paint_layer(terrain, places, part, options, judge, progress)
    progress("drawing")
    sheet = new_sheet(places.width, places.height, options.dpi)
    axes = sheet.axes(places.ground)
    grid, notes = picture.grid, list(picture.notes)
    west, south, east, north = grid.bounds
    axes.imshow(
        shade_picture(picture, options.dpi, factor), extent=(west, east, south, north),
        aspect="auto", interpolation="none", origin="upper",
    )  # fmt: skip
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    unit, captions = unit_of(terrain), []
    if picture.light is not None:
        captions.append(_light_caption(factor))
    if options.contours is not None:
        captions.append(draw_contours(axes, picture, options.contours, options.dpi))
    labels: tuple[Label, ...] = ()
    if options.grid:
        labels, left_out = _draw_cells(axes, terrain, picture, sheet)
        notes += left_out
    if options.has_legend:
        _draw_letters(axes, picture, options.dpi, labels)
    notes += _narrow_note(terrain, part, grid.resolution * FINER)
    if options.bare:
        axes.set_axis_off()
    else:
        draw_frame(sheet, axes, places, unit)
        draw_margins(sheet, places, picture, unit, captions)
    if title:
        left = places.ground.left
        sheet.title(title, left, places.width - left - sheet.pixels(6.0))
    if options.has_legend:
        sheet.key(picture.key, places.key)
    said = "" if options.cut is None else f" below {number(options.cut)}"
    known = picture.heights[np.isfinite(picture.heights)]
    what = (
        f"plan of {sides[0]:,.6g} × {sides[1]:,.6g} {unit}, "
        f"{options.layer}{said}; {grid.resolution * FINER:.3g} {unit} a pixel, heights from "
        f"{known.min():,.4g} to {known.max():,.4g} at the pixels"
    )
    return Drawn(sheet, what, tuple(notes))


def axis_room(low: float, high: float) -> float:
    """Room beside a vertical axis from one number to another, for labels and a title, points."""
    from terratool.raster.shading import ticks

    return width_of([number(place) for place in ticks(low, high, 6)]) + 26.0


def _paint_layer(
    terrain: Terrain, places: PlanLayout, part: Bounds, options: RenderOptions, judge: Judge | None,
    progress: Callable[[str], object],
) -> tuple[LayerPicture, float]:  # fmt: skip
    """Paint the layer at pixels finer than the picture's, and choose the factor on slopes."""
    resolution = (part[2] - part[0]) / (places.ground.width * FINER)
    grid = grid_over(terrain, resolution, part)
    picture = layer_picture(terrain, grid, options.layer, judge, progress, options.cut)
    if options.cut is not None:
        picture = picture.named(NO_GROUND, f"no top below {number(options.cut)}")
    if picture.light is None:
        return picture, 1.0
    stride = 1 + max(picture.heights.shape) // _SAMPLED
    some = picture.heights[::stride, ::stride]
    return picture, min(exaggeration(some, grid.resolution * stride), picture.light.steeper)


def shade_picture(picture: LayerPicture, dpi: float, factor: float) -> NDArray[np.uint8]:
    """Shade a layer, and reduce it to the pixels of the picture, (height, width, 3) uint8.

    Args:
        picture: the layer, at finer pixels.
        dpi: pixels of the picture per inch.
        factor: factor on slopes.
    """
    step = FINER * max(4, round(_HATCH * dpi / 72.0))
    band = step * max(1, _BAND // step)  # bands of rows need less memory, and hatching goes on
    parts = [
        _block_means(light_on(picture.rows(start, start + band), light, step))
        for start in range(0, picture.grid.height, band)
        for light in (_light_factors(picture, start, start + band, factor),)
    ]
    return np.concatenate(parts)


def _light_factors(
    picture: LayerPicture, start: int, stop: int, factor: float
) -> NDArray[np.float64]:
    """Factors on the colours of some rows by light, (rows, width) float64."""
    heights = picture.heights[max(start - 1, 0) : stop + 1]  # with neighbours
    first = min(start, 1)
    rows = min(stop, picture.grid.height) - start
    if (how := picture.light) is None:
        return np.ones((rows, picture.grid.width))
    shade = hillshade(heights, picture.grid.resolution, factor)[first : first + rows]
    return np.asarray(np.clip(1.0 + how.contrast * (shade - level_light()), how.shade, how.glare))


def _block_means(fine: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Means of blocks of FINER × FINER pixels; blocks at the ends repeat the last pixels."""
    rows, columns = (-side % FINER for side in fine.shape[:2])
    fine = np.pad(fine, ((0, rows), (0, columns), (0, 0)), mode="edge")
    blocks = fine.reshape(fine.shape[0] // FINER, FINER, fine.shape[1] // FINER, FINER, 3)
    return np.asarray(np.rint(blocks.mean(axis=(1, 3))), np.uint8)


def _light_caption(factor: float) -> str:
    """A sentence on the light, with the factor on slopes."""
    steeper = f"; slopes shaded {factor:g} times as steep" if factor != 1.0 else ""
    return f"Light from the north-west{steeper}."


def _narrow_note(terrain: Terrain, part: Bounds, pixel: float) -> list[str]:
    """A sentence on elements that are narrower than a pixel; none where there are none."""
    whole = terrain.written_out_or_none
    if whole is None:
        return []
    sheets = () if whole.storeys is None else whole.storeys.sheets
    own = (sheet.top.footprints()[:, sheet.storeys >= 0] for sheet in sheets)
    west, south, east, north = np.concatenate([whole.footprints(), *own], axis=1)
    there = (west < part[2]) & (east > part[0]) & (south < part[3]) & (north > part[1])
    count = int(np.count_nonzero(there & (np.minimum(east - west, north - south) < pixel)))
    return [f"Narrower than a pixel: {count_of(count, 'element')}."] if count else []


def _draw_letters(axes: Axes, picture: LayerPicture, dpi: float, labels: tuple[Label, ...]) -> None:
    """Draw a letter on each surface whose colour looks like another, where there is room."""
    ground = np.where(np.isnan(picture.heights), -1, picture.surfaces.astype(np.int64))
    grid = picture.grid
    for label in labels:
        west, south, east, north = label.box
        rows = [max(0, int((grid.bounds[3] - y) / grid.resolution)) for y in (north, south)]
        columns = [max(0, int((x - grid.west) / grid.resolution)) for x in (west, east)]
        ground[rows[0] : rows[1] + 1, columns[0] : columns[1] + 1] = -1
    places = roomiest_places(ground, [id_ for _, id_ in picture.letters])
    for letter, id_ in picture.letters:
        row, column, room = places.get(id_, (0, 0, 0))
        if room / FINER < 0.6 * LABEL * dpi / 72.0:
            continue
        x = grid.west + (column + 0.5) * grid.resolution
        y = grid.bounds[3] - (row + 0.5) * grid.resolution
        axes.text(
            x, y, letter, fontsize=LABEL + 1.0, fontweight="bold", ha="center",
            va="center_baseline", color=INK,
            bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0.0,
                  "boxstyle": "circle,pad=0.12"},
        )  # fmt: skip


def _draw_cells(
    axes: Axes, terrain: Terrain, picture: LayerPicture, sheet: Sheet
) -> tuple[tuple[Label, ...], tuple[str, ...]]:
    """Draw nested cells, with finer lines for deeper levels; return their labels and notes."""
    from matplotlib.collections import LineCollection

    per_point = picture.grid.resolution * FINER * sheet.dpi / 72.0
    found = cell_lines(terrain, picture.grid.bounds, per_point)
    for level, (lines, outlines) in enumerate(zip(found.grids, found.elements, strict=True)):
        thin, thick = max(0.6 * 0.7**level, 0.2), max(1.6 * 0.75**level, 0.4)
        for those, width, share in ((lines, thin, 0.45), (outlines, thick, 1.0)):
            # dark ground needs the lighter line
            for color, wider in (("white", 0.8), (INK, 0.0)):
                alpha = share if color == INK else 0.5 * share
                style: Any = {"colors": color, "linewidths": width + wider, "alpha": alpha}
                axes.add_collection(LineCollection(list(those), **style))
    for label in found.labels:
        axes.text(
            label.box[0], label.box[3], label.text, fontsize=LABEL, va="top", ha="left", color=INK,
            linespacing=1.1, clip_on=True,
            bbox={"facecolor": "white", "alpha": 0.75, "linewidth": 0.0, "pad": 0.8},
        )  # fmt: skip
    return found.labels, found.notes


def draw_frame(sheet: Sheet, axes: Axes, places: PlanLayout, unit: str) -> None:
    """Draw the axes, with their unit."""
    per_tick = sheet.pixels(54.0)
    set_ticks(axes, "x", max(1, places.ground.width // per_tick))
    set_ticks(axes, "y", max(1, places.ground.height // per_tick))
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)
    left, bottom, width, height = places.ground
    sheet.text(left + width / 2, bottom - sheet.pixels(17.0), f"x ({unit})", ha="center", va="top")
    sheet.text(
        sheet.pixels(5.0), bottom + height / 2, f"y ({unit})", va="center", rotation=90, ha="left"
    )


def draw_margins(
    sheet: Sheet, places: PlanLayout, picture: LayerPicture, unit: str, captions: list[str]
) -> None:
    """Draw the scale bar, the north arrow and the captions below the ground."""
    left, bottom, width, _ = places.ground
    row = bottom - sheet.pixels(54.0)
    per_pixel = picture.grid.resolution * FINER
    sheet.north_arrow(left + sheet.pixels(4.0), row - sheet.pixels(4.0))
    bar_left = left + sheet.pixels(24.0)
    room = max(min(width // 3, sheet.pixels(140.0)), sheet.pixels(24.0))
    sheet.scale_bar(Rectangle(bar_left, row, room, 0), per_pixel, unit)
    if captions:
        sheet.caption([" ".join(captions)], left, sheet.pixels(4.0))
