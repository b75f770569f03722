"""A section: the ground along a line, its walls upright at their exact place, the void a gap."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.bounds import finest_details
from terratool.field.terrain import Terrain
from terratool.report.numbers import coordinates
from terratool.viewing.layers import surface_colors
from terratool.viewing.options import Line, RenderOptions
from terratool.viewing.plan import NO_MARGINS, Drawn, PlanLayout, SheetMargins, layout, unit_of
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

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EVEN = 8192
"""Number of even stretches of the line whose ends are sampled."""
_PER_DETAIL = 4.0
"""Samples for the finest detail of the curve of each element that the line crosses."""
_LEAST_PARTS, _MOST_PARTS = 16, 4096
"""Fewest and most samples for an element that the line crosses."""
_MOST_PLACES = 1 << 20
"""Most samples, about, for all elements that the line crosses."""
_HALVINGS = 64
"""Number of halvings that always suffice for two doubles to be neighbours."""
_ROUNDS = 8
"""Rounds of searching for walls; each finds one in every stretch that may have some."""
_LEVEL = 1e-9
"""Least height of a wall, as a share of the range of heights."""
_STEEPER = 4.0
"""Least height of a wall, as a multiple of the rise by the slopes beside it."""
_SHAPE = 2e-4
"""Tolerance of the points left out, as a share of the range of heights."""
_MOST_CHOSEN = 1000.0
"""Largest factor on heights that is chosen."""
_LEAST_RELIEF = 0.04
"""Least range of heights that a section shows, as a share of its length."""

Floats = NDArray[np.float64]
"""An array of float64."""


@dataclass(frozen=True, slots=True)
class Section:
    """The ground along a line.

    Attributes:
        line: x and y of both ends, world units.
        distance: (n,) float64 along the line from its first end, world units, not falling; two
            equal ones are the foot and the top of a wall.
        height: (n,) float64 m; NaN between stretches of ground, in the void or outside the terrain.
        surface: (n,) int32, index of the surface from a point to the next; -1 for none.
        walls: (m, 3) float64 distance of each wall, height before it and height behind it.
    """

    line: Line
    distance: Floats
    height: Floats
    surface: NDArray[np.int32]
    walls: Floats

    @property
    def length(self) -> float:
        """Length of the line, seen from above, world units."""
        x0, y0, x1, y1 = self.line
        return math.hypot(x1 - x0, y1 - y0)


def check_section(line: Line, extent: Bounds) -> tuple[float, float]:
    """Shares of a line between which it is on a terrain.

    Args:
        line: x and y of both ends, which differ, world units.
        extent: west, south, east, north of the terrain.

    Raises:
        RequestError: none of the line is.
    """
    begin, end = _crossings(line, np.array(extent)[:, None])[:, 0].tolist()
    if not begin < end:
        raise RequestError(
            f"The section from {coordinates(line[:2])} to {coordinates(line[2:])} misses the "
            "terrain.",
            f"Give a line that crosses {coordinates(extent)}, where the terrain lies.",
        )
    return begin, end


def section(terrain: Terrain, line: Line) -> Section:
    """Sample the ground along a line, with every wall that it crosses.

    Between two samples whose difference in height their slopes do not explain, a wall is searched
    by halving until two doubles are neighbours: its place is exact. Samples are even, with more on
    elements under the line. A slot or a rib is missed only where it is narrower than the distance
    of samples.

    Args:
        terrain: the ground.
        line: x and y of both ends, which differ, world units.

    Raises:
        RequestError: none of the line is on the terrain, or no ground is.
    """
    x0, y0, x1, y1 = line
    length = math.hypot(x1 - x0, y1 - y0)
    probe = _LineProbe(terrain, line, length)
    inside = np.array(check_section(line, terrain.bounds))
    places = _first_distances(terrain, line, length)
    places = np.unique(np.concatenate([places, inside * length]))
    heights = probe.heights(places)
    if np.isnan(heights).all():
        raise RequestError(
            f"There is no ground on the section from {coordinates(line[:2])} to "
            f"{coordinates(line[2:])}: it is void.",
            "Give other ends.",
        )
    span = float(np.nanmax(heights) - np.nanmin(heights))
    level = _LEVEL * max(span, 1e-6 * length, float(np.spacing(np.nanmax(np.abs(heights)))))
    low, high = _find_jumps(probe, places, level)
    # both sides of each wall, and of each end of the ground
    places = np.unique(np.concatenate([places, low, high]))
    seen = probe.sample(places)
    middles = probe.surfaces(0.5 * (places + np.append(places[1:], length)))
    at = np.searchsorted(places, low)
    distance, height = places.copy(), seen.height
    distance[at] = high  # upright, where the ground behind it begins
    walls = np.column_stack([high, height[at], height[at + 1]])
    walls = walls[np.isfinite(walls).all(axis=1)]
    kept = _shape_points(
        distance, height, middles, np.concatenate([at, at + 1]), _SHAPE * (span or 1.0)
    )
    return Section(line, distance[kept], height[kept], middles[kept], walls)


@dataclass(frozen=True, slots=True)
class _LineSamples:
    """Samples of a line, (n,) float64 each: heights, and slopes along it; NaN for no ground."""

    height: Floats
    slope: Floats


class _LineProbe:
    """A probe of the terrain at distances along a line, world units from its first end.

    Attributes:
        length: length of the line, world units.
    """

    def __init__(self, terrain: Terrain, line: Line, length: float) -> None:
        self._terrain, self._line = terrain, line
        x0, y0, x1, y1 = line
        self._along = (x1 - x0) / length, (y1 - y0) / length
        self.length = length

    def points(self, distance: Floats) -> tuple[Floats, Floats]:
        """World x and y at distances; the line's last end is exact to the last bit."""
        x0, y0, x1, y1 = self._line
        x, y = x0 + distance * self._along[0], y0 + distance * self._along[1]
        end = distance >= self.length
        return np.where(end, x1, x), np.where(end, y1, y)

    def heights(self, distance: Floats) -> Floats:
        """Heights at distances, NaN where there is no ground."""
        found: Floats = self._terrain.height(*self.points(distance))
        return found

    def sample(self, distance: Floats) -> _LineSamples:
        """Heights, and slopes along the line, at distances."""
        found = self._terrain.sample(*self.points(distance))
        along = found.normal[:, 0] * self._along[0] + found.normal[:, 1] * self._along[1]
        with np.errstate(invalid="ignore", divide="ignore"):
            return _LineSamples(found.height, -along / found.normal[:, 2])

    def surfaces(self, distance: Floats) -> NDArray[np.int32]:
        """Indices of surfaces at distances, -1 for none."""
        return self._terrain.sample(*self.points(distance)).surface


def _crossings(line: Line, rectangles: Floats) -> Floats:
    """Places where a line enters and leaves rectangles, (2, n), in lengths of the line.

    The first is larger than the second where the line misses the rectangle.

    Args:
        line: x and y of both ends, world units.
        rectangles: (4, n) west, south, east, north of each rectangle.
    """
    enter, leave = np.zeros(rectangles.shape[1]), np.ones(rectangles.shape[1])
    for axis in (0, 1):
        start, way = line[axis], line[axis + 2] - line[axis]
        low, high = rectangles[axis] - start, rectangles[axis + 2] - start
        if way == 0.0:
            leave[(low > 0.0) | (high < 0.0)] = -1.0
            continue
        one, other = low / way, high / way
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other))
    return np.stack([enter, leave])


def _first_distances(terrain: Terrain, line: Line, length: float) -> Floats:
    """Distances of the first samples, rising."""
    found = [np.linspace(0.0, length, EVEN + 1)]
    whole = terrain.written_out_or_none
    if whole is not None:
        enter, leave = _crossings(line, whole.footprints())
        crossed = np.flatnonzero(enter < leave)
        west, south, east, north = whole.cells()
        details = finest_details(whole.arrays, east - west, north - south)[crossed]
        across = (leave - enter)[crossed] * length
        parts = np.clip(_PER_DETAIL * across / details, _LEAST_PARTS, _MOST_PARTS)
        # too many samples are reduced for each element alike
        parts = np.maximum(parts * min(1.0, _MOST_PLACES / max(1.0, float(parts.sum()))), 2.0)
        for index, count in zip(crossed.tolist(), parts.astype(int).tolist(), strict=True):
            found.append(np.linspace(enter[index], leave[index], count + 1) * length)
    return np.unique(np.clip(np.concatenate(found), 0.0, length))


def _find_jumps(probe: _LineProbe, places: Floats, level: float) -> tuple[Floats, Floats]:
    """Find pairs of neighbouring distances between which the ground jumps, begins or ends."""
    low, high = places[:-1], places[1:]
    found: list[tuple[Floats, Floats]] = []
    for _ in range(_ROUNDS):
        one, two = probe.sample(low), probe.sample(high)
        open_ = _height_residual(one, two, high - low) > level
        low, high = low[open_], high[open_]
        if not len(low):
            break
        begin, end = _halve(probe, low, high)
        before, behind = probe.sample(begin), probe.sample(end)
        jump = np.abs(behind.height - before.height)
        slope = np.fmax(np.abs(before.slope), np.abs(behind.slope))
        is_wall = (jump > level) & (jump > _STEEPER * slope * (end - begin))
        is_wall |= np.isnan(before.height) != np.isnan(behind.height)
        found.append((begin[is_wall], end[is_wall]))
        # other walls may stand on both sides
        low, high = (
            np.concatenate([low[is_wall], end[is_wall]]),
            np.concatenate([begin[is_wall], high[is_wall]]),
        )
        wide = low < high
        low, high = low[wide], high[wide]
    begins, ends = (np.concatenate(side) for side in zip(*found, strict=True)) if found else (
        np.empty(0), np.empty(0),
    )  # fmt: skip
    order = np.argsort(begins, kind="stable")
    return begins[order], ends[order]


def _height_residual(one: _LineSamples, two: _LineSamples, width: Floats) -> Floats:
    """The part of the difference of two heights that the slopes there do not explain, m.

    Infinity where only one place has ground, 0 where neither has.
    """
    off = np.abs(two.height - one.height - 0.5 * width * (one.slope + two.slope))
    first, second = np.isnan(one.height), np.isnan(two.height)
    return np.where(first != second, np.inf, np.where(first, 0.0, off))


def _halve(probe: _LineProbe, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Halve stretches until their ends are neighbouring doubles, with the larger residual kept."""
    low, high = low.copy(), high.copy()
    one, two = probe.sample(low), probe.sample(high)
    for _ in range(_HALVINGS):
        middle = low + 0.5 * (high - low)
        if not ((low < middle) & (middle < high)).any():
            break
        at = probe.sample(middle)
        left = _height_residual(one, at, middle - low) >= _height_residual(at, two, high - middle)
        low, high = np.where(left, low, middle), np.where(left, middle, high)
        one = _LineSamples(
            np.where(left, one.height, at.height), np.where(left, one.slope, at.slope)
        )
        two = _LineSamples(
            np.where(left, at.height, two.height), np.where(left, at.slope, two.slope)
        )
    return low, high


def _shape_points(
    distance: Floats, height: Floats, surface: NDArray[np.int32], corners: NDArray[np.int64],
    tolerance: float,
) -> NDArray[np.int64]:  # fmt: skip
    """Indices of the points that the shape of a section needs.

    Points near the chord of their neighbours are left out, every other one at a time. Walls, ends
    of the ground and changes of the surface stay.
    """
    fixed = np.zeros(len(distance), np.bool_)
    fixed[corners], fixed[[0, -1]] = True, True
    fixed[1:] |= surface[1:] != surface[:-1]
    known = np.isfinite(height)
    fixed[1:] |= known[1:] != known[:-1]
    fixed[:-1] |= known[1:] != known[:-1]
    kept = np.flatnonzero(known | fixed)
    rounds = 16
    for turn in range(rounds):
        x, z, stays = distance[kept], height[kept], fixed[kept]
        width = np.maximum(x[2:] - x[:-2], np.finfo(float).tiny)
        chord = z[:-2] + (z[2:] - z[:-2]) * (x[1:-1] - x[:-2]) / width
        near = np.abs(z[1:-1] - chord) <= tolerance / rounds
        drop = np.zeros(len(kept), np.bool_)
        drop[1:-1] = near & ~stays[1:-1]
        drop[turn % 2 :: 2] = False
        kept = kept[~drop]
    return kept


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
    found = section(terrain, line)
    progress("drawing")
    low, high = float(np.nanmin(found.height)), float(np.nanmax(found.height))
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


def _legend(terrain: Terrain, found: Section) -> Legend:
    """The legend of the surfaces of a section."""
    colors, _ = surface_colors(terrain)
    ground = np.isfinite(found.height)
    seen = sorted({*found.surface[ground].tolist()} - {-1})
    is_void = [surface.void is True for surface in terrain.surface_types.values()]
    names = [(index, terrain.surfaces[index]) for index in seen if not is_void[index]]
    swatches = [Swatch(name, _color(colors, index)) for index, name in names]
    if -1 in found.surface[ground]:
        swatches.append(Swatch("no surface", _color(colors, -1)))
    return Legend("surface", tuple(swatches))


def _color(colors: NDArray[np.uint8], surface: int) -> tuple[int, int, int]:
    """Red, green and blue of a surface by its index, -1 for none."""
    red, green, blue = (int(part) for part in colors[surface + 1])
    return red, green, blue


def _draw_ground(
    sheet: Sheet, terrain: Terrain, found: Section, places: PlanLayout, heights: tuple[float, float]
) -> Axes:
    """Draw the ground in the colours of its surfaces, and its line on top."""
    axes = sheet.axes(places.ground)
    axes.set_xlim(0.0, found.length)
    axes.set_ylim(*heights)
    colors, _ = surface_colors(terrain)
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


def _draw_axes(sheet: Sheet, axes: Axes, places: PlanLayout) -> None:
    """Draw the axes, without top and right."""
    set_ticks(axes, "x", max(1, places.ground.width // sheet.pixels(54.0)))
    set_ticks(axes, "y", max(1, places.ground.height // sheet.pixels(24.0)))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)


def _draw_texts(
    sheet: Sheet, terrain: Terrain, found: Section, places: PlanLayout, factor: float
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
