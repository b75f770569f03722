"""Drawing of sections: the ground in the colours of its surfaces, with axes and a legend."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.viewing.layers import surface_colors
from terratool.viewing.options import RenderOptions
from terratool.viewing.plan import NO_MARGINS, Drawn, PlanLayout, SheetMargins, layout, unit_of
from terratool.viewing.profile import Section, section
from terratool.viewing.sheet import (
    INK,
    Legend,
    Sheet,
    Swatch,
    chosen_exaggeration,
    exaggeration_text,
    key_width,
    new_sheet,
    note_of_chosen,
    number,
    set_ticks,
    width_of,
)
from terratool.viewing.solids import SolidSection, solid_section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_CHOSEN = 1000.0
"""Largest factor on heights that is chosen."""
_LEAST_RELIEF = 0.04
"""Least range of heights that a section shows, as a share of its length."""


def draw_section(
    terrain: Terrain,
    options: RenderOptions,
    progress: Callable[[str], object] = lambda _: None,
) -> Drawn:
    """Draw a section, within `terratool.viewing.sheet.settings`.

    Raises:
        RequestError: none of the line is on the terrain, or no ground is.
    """
    line = options.profile
    assert line is not None
    progress("following the line")
    found: Section | SolidSection
    if terrain.storeys is None:
        found = section(terrain, line)
    else:
        found = solid_section(terrain, terrain.storeys, line)
    progress("drawing")
    low, high = found.heights
    relief = high - low
    factor = options.exaggeration or chosen_exaggeration(found.length, relief, _MOST_CHOSEN)
    room = max(relief, _LEAST_RELIEF * found.length / factor)
    low, high = low - 0.25 * room, high + 0.15 * room
    key = _legend(terrain, found) if options.has_legend else Legend()
    title = options.title_of(terrain.descr)
    margins = (
        NO_MARGINS
        if options.bare
        else SheetMargins(
            left=width_of([number(place) for place in _tick_heights(low, high)]) + 26.0,
            bottom=48.0 if factor == 1.0 else 52.0,
            right=key_width(key) + 20.0 if options.has_legend else 20.0,
            top=44.0 if title else 28.0,
        )
    )
    places = layout((found.length, (high - low) * factor), options, margins)
    sheet = new_sheet(places.width, places.height, options.dpi)
    axes = _draw_ground(sheet, terrain, found, places, (low, high))
    if options.bare:
        axes.set_axis_off()
    else:
        _draw_axes(sheet, axes, places)
        _draw_texts(sheet, terrain, found, places, factor)
    if title:
        left = places.ground.left
        sheet.title(title, left, places.width - left - sheet.pixels(6.0))
    if options.has_legend:
        sheet.key(key, places.key)
    x0, y0, x1, y1 = line
    walls = len(found.walls)
    what = (
        f"section from {number(x0)} {number(y0)} to {number(x1)} {number(y1)}, "
        f"{found.length:,.6g} {unit_of(terrain)} long; {exaggeration_text(factor)}, "
        f"{walls} wall{'s' * (walls != 1)}"
    )
    notes: list[str] = [*note_of_chosen(factor, options.exaggeration)]
    if terrain.written_out_or_none is None:
        notes.append("There are too many elements to look at each: narrow ones may be missing.")
    return Drawn(sheet, what, tuple(notes))


def _tick_heights(low: float, high: float) -> list[float]:
    """Round heights between two, for the labels of an axis."""
    from terratool.raster.shading import ticks

    return ticks(low, high, 5)


def _legend(terrain: Terrain, found: Section | SolidSection) -> Legend:
    """The legend of the surfaces of a section."""
    colors, _ = surface_colors(terrain)
    seen = sorted(found.seen - {-1})
    is_void = [surface.void is True for surface in terrain.surface_types.values()]
    names = [(index, terrain.surfaces[index]) for index in seen if not is_void[index]]
    swatches = [Swatch(name, _color(colors, index)) for index, name in names]
    if -1 in found.seen:
        swatches.append(Swatch("no surface", _color(colors, -1)))
    return Legend("surface", tuple(swatches))


def _color(colors: NDArray[np.uint8], surface: int) -> tuple[int, int, int]:
    """Red, green and blue of a surface by its index, -1 for none."""
    red, green, blue = (int(part) for part in colors[surface + 1])
    return red, green, blue


def _draw_ground(
    sheet: Sheet,
    terrain: Terrain,
    found: Section | SolidSection,
    places: PlanLayout,
    heights: tuple[float, float],
) -> Axes:
    """Draw the ground in the colours of its surfaces, and its line on top."""
    axes = sheet.axes(places.ground)
    axes.set_xlim(0.0, found.length)
    axes.set_ylim(*heights)
    colors, _ = surface_colors(terrain)
    if isinstance(found, SolidSection):
        _draw_solids(axes, found, colors, heights[0])
        return axes
    ground = np.isfinite(found.height)
    breaks = np.flatnonzero((found.surface[1:] != found.surface[:-1]) | (ground[1:] != ground[:-1]))
    for begin, end in zip([0, *(breaks + 1)], [*(breaks + 1), len(ground) - 1], strict=True):
        part = slice(begin, end + 1)
        if not ground[begin]:
            continue
        known = ground[part]
        red, green, blue = (value / 255.0 for value in _color(colors, found.surface[begin]))
        axes.fill_between(
            found.distance[part][known], found.height[part][known], heights[0],
            facecolor=(red, green, blue), linewidth=0.0,
        )  # fmt: skip
    axes.plot(
        found.distance, found.height, color=INK, linewidth=1.0, solid_joinstyle="miter",
        gid="ground",
    )  # fmt: skip
    return axes


def _draw_solids(axes: Axes, found: SolidSection, colors: NDArray[np.uint8], floor: float) -> None:
    """Draw what is solid in the colours of its tops, and a line around it; gaps are open."""
    # fills with thin edges leave no bright seam where two meet; the line covers what juts out
    for solid in found.solids:
        red, green, blue = (value / 255.0 for value in _color(colors, solid.surface))
        axes.fill_between(
            solid.distance, solid.top, np.maximum(solid.bottom, floor),
            color=(red, green, blue), linewidth=0.6,
        )  # fmt: skip
    distance, height = found.outline
    axes.plot(
        distance, height, color=INK, linewidth=1.0, solid_capstyle="round", gid="ground",
    )  # fmt: skip


def _draw_axes(sheet: Sheet, axes: Axes, places: PlanLayout) -> None:
    """Draw the axes, without top and right."""
    set_ticks(axes, "x", max(1, places.ground.width // sheet.pixels(54.0)))
    set_ticks(axes, "y", max(1, places.ground.height // sheet.pixels(24.0)))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)


def _draw_texts(
    sheet: Sheet, terrain: Terrain, found: Section | SolidSection, places: PlanLayout, factor: float
) -> None:
    """Draw the titles of the axes, the ends of the line and the exaggeration."""
    left, bottom, width, height = places.ground
    unit, top = unit_of(terrain), bottom + height + sheet.pixels(4.0)
    x0, y0, x1, y1 = map(number, found.line)
    sheet.text(left, top, f"A ({x0}, {y0})", va="bottom", ha="left", fontweight="bold")
    sheet.text(left + width, top, f"B ({x1}, {y1})", va="bottom", ha="right", fontweight="bold")
    row = bottom - sheet.pixels(17.0)
    sheet.text(left + width / 2, row, f"distance from A ({unit})", ha="center", va="top")
    middle = bottom + height / 2
    sheet.text(sheet.pixels(5.0), middle, "height (m)", va="center", rotation=90, ha="left")
    if factor == 1.0:
        sheet.caption([f"{exaggeration_text(factor).capitalize()}."], left, sheet.pixels(4.0))
    else:
        sheet.warning(factor, left, sheet.pixels(4.0))
