"""Pictures of a report: a map as PNG, and profiles along routes as SVG."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from terratool.raster.shading import LIGHT, contour_interval, exaggeration, hillshade, ticks
from terratool.report import numbers
from terratool.traversability.map_results import Preview
from terratool.traversability.route.results import RouteProfile
from terratool.traversability.vehicle import Battery
from terratool.traversability.verdicts import COLORS, GroundClass, Verdict

_LEFT, _RIGHT, _TOP = 52, 12, 22
"""Margins for the numbers of the axes, and for the title of the upper one, pixels."""
_HILL, _STRIP, _GAP, _SUNK, _BELOW = 130, 10, 30, 56, 40
"""Heights of the ground's panel, strip, gap, sinkage's panel and x axis, pixels."""

_LEANS = 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0
"""Ends of the axis of pitch and roll, degrees, of which numbers stand at both and in the middle."""

SHADING = 0.8, 1.08
"""Factors on a colour in the shade and in full light."""

_SIDE = 720
"""Least pixels of the longer side of a picture, so that the hatching is fine."""
_HATCH = 12
"""Distance between lines of the hatching, pixels."""
_OUTLINE = (11, 61, 145)
"""Colour (red, green, blue) of the outline of ground that can be reached."""
_CONTOUR = 0.6
"""Factor on a colour on a contour."""


@dataclass(frozen=True, slots=True)
class _Bins:
    """Profile at the columns of a picture, (n,) each.

    Attributes:
        x: position of the column, pixels.
        low, high: lowest and highest ground, m.
        sinkage: deepest sinkage, m.
        verdict: worst verdict; unknown counts as worse than go and better than caution.
        starts: int64 index of the first sample of each column.
    """

    x: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    verdict: NDArray[np.int64]
    starts: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Panel:
    """Panel of lines along a profile.

    Attributes:
        title: title, with the unit.
        lines: values along the profile, (n,) float64 each; the second is dashed.
        low, high: ends of the axis.
    """

    title: str
    lines: tuple[NDArray[np.float64], ...]
    low: float
    high: float


def chart(profile: RouteProfile, width: int, battery: Battery | None = None) -> str:
    """Profile as an SVG element, `width` pixels wide, 240 or more; empty if it has no length.

    Under the ground and the sinkage are slip, pitch and roll, the margin, and what is left of a
    charge of the battery.
    """
    total = float(profile.distance[-1] - profile.distance[0]) if len(profile.distance) else 0.0
    if not total > 0.0:
        return ""
    bins = _bin(profile, total, width - _LEFT - _RIGHT)
    panels = _panels(profile, battery)
    bottom = _TOP + _HILL + _STRIP + (_GAP + _SUNK) * (1 + len(panels))
    finite = bins.high[np.isfinite(bins.high)]
    low, high = (float(np.nanmin(bins.low)), float(finite.max())) if finite.size else (0.0, 1.0)
    if high - low < 1e-9 * max(1.0, abs(high)):
        low, high = low - 0.5, high + 0.5
    sunk = np.nan_to_num(bins.sinkage)
    deepest = float(sunk.max())
    parts = [
        f'<svg class="profile" xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {width} {bottom + _BELOW}" width="{width}" height="{bottom + _BELOW}" '
        f'aria-label="{escape(_description(profile, total))}">',
        *_axis(low, high, _TOP + _HILL, _TOP, width, "height, m"),
        _ground(bins, low, high),
        *_strip(bins),
    ]
    zero = _TOP + _HILL + _STRIP + _GAP
    most = deepest * 1e3 if deepest > 0.0 else 1.0
    parts += _axis(0.0, most, zero, zero + _SUNK, width, "sinkage, mm")
    if deepest > 0.0:
        parts.append(_sinkage_area(bins.x, sunk / deepest * _SUNK, zero))
    for number, panel in enumerate(panels, 1):
        parts += _lines(panel, bins, zero + number * (_GAP + _SUNK), width)
    parts += [*_distances(total, width, bottom), "</svg>"]
    return "".join(parts)


def _bin(profile: RouteProfile, total: float, columns: int) -> _Bins:
    along = (profile.distance - profile.distance[0]) / total * columns
    index = np.minimum(np.floor(along), columns - 1).astype(np.int64)
    starts = np.flatnonzero(np.diff(index, prepend=-1))
    order = np.array([Verdict.GO, Verdict.UNKNOWN, Verdict.CAUTION, Verdict.NO_GO])
    worst = np.maximum.reduceat(np.argsort(order)[profile.verdict], starts)
    x = along[starts]
    x[-1] = columns
    return _Bins(
        x + _LEFT,
        np.fmin.reduceat(profile.height, starts),
        np.fmax.reduceat(profile.height, starts),
        np.fmax.reduceat(profile.sinkage, starts),
        order[worst],
        starts,
    )


def _panels(profile: RouteProfile, battery: Battery | None) -> list[_Panel]:
    """Panels of what is known along a profile."""
    leans = np.degrees(profile.pitch), np.degrees(profile.roll)
    lean = max(float(np.nanmax(np.abs(lean), initial=1.0)) for lean in leans)
    most = next(angle for angle in _LEANS if angle >= lean)
    margin = 100.0 * (1.0 - np.clip(profile.utilisation, 0.0, 1.0))
    found = [
        _Panel("slip, %", (100.0 * np.clip(profile.slip, 0.0, 1.0),), 0.0, 100.0),
        _Panel("pitch, and roll (dashed), °", leans, -most, most),
        _Panel("margin to the nearest limit, %", (margin,), 0.0, 100.0),
    ]
    if battery is not None:
        left = 100.0 * np.clip(1.0 - profile.energy / battery.capacity, 0.0, 1.0)
        found.append(_Panel("charge left, %", (left,), 0.0, 100.0))
    if not np.nan_to_num(profile.slip).any():
        del found[0]  # feet, and wheels that never slip
    return [one for one in found if any(np.isfinite(line).any() for line in one.lines)]


def _lines(panel: _Panel, bins: _Bins, top: int, width: int) -> Iterator[str]:
    """Axis and lines of a panel; of each column the value of the largest size, or the least."""
    yield from _axis(panel.low, panel.high, top + _SUNK, top, width, panel.title)
    for dashed, values in enumerate(panel.lines):
        largest = np.fmax.reduceat(values, bins.starts)
        least = np.fmin.reduceat(values, bins.starts)
        # where little is left is what matters of a margin, else what is most
        shown = np.where(np.abs(largest) >= np.abs(least), largest, least)
        if panel.low == 0.0 and panel.title != "slip, %":
            shown = least
        path, drawing = [], False
        scale = _SUNK / (panel.high - panel.low)
        for x, value in zip(bins.x.tolist(), shown.tolist(), strict=True):
            if not math.isfinite(value):
                drawing = False
                continue
            y = top + (panel.high - value) * scale
            path.append(f"{'L' if drawing else 'M'}{x:.1f} {y:.1f}")
            drawing = True
        dash = ' stroke-dasharray="5 3"' if dashed else ""
        yield f'<path class="ground"{dash} d="{"".join(path)}"/>'


def _ground(bins: _Bins, low: float, high: float) -> str:
    scale = _HILL / (high - low)
    path, drawing = [], False
    for x, least, most in zip(bins.x.tolist(), bins.low.tolist(), bins.high.tolist(), strict=True):
        if not math.isfinite(least):
            drawing = False
            continue
        top, foot = _TOP + (high - most) * scale, _TOP + (high - least) * scale
        path.append(f"{'L' if drawing else 'M'}{x:.1f} {foot:.1f}")
        if foot - top >= 0.1:
            path.append(f"L{x:.1f} {top:.1f}")
        drawing = True
    return f'<path class="ground" d="{"".join(path)}"/>'


def _strip(bins: _Bins) -> Iterator[str]:
    ends = [*np.flatnonzero(np.diff(bins.verdict)).tolist(), len(bins.x) - 1]
    start = float(bins.x[0])
    for last in ends:
        end = float(bins.x[min(last + 1, len(bins.x) - 1)])
        verdict = Verdict(int(bins.verdict[last]))
        yield (
            f'<rect class="{verdict.label}" x="{start:.1f}" y="{_TOP + _HILL}" '
            f'width="{max(end - start, 1.0):.1f}" height="{_STRIP}"/>'
        )
        start = end


def _sinkage_area(x: NDArray[np.float64], depth: NDArray[np.float64], zero: int) -> str:
    line = "".join(
        f"L{at:.1f} {zero + deep:.1f}" for at, deep in zip(x.tolist(), depth.tolist(), strict=True)
    )
    return f'<path class="sunken" d="M{x[0]:.1f} {zero}{line}L{x[-1]:.1f} {zero}Z"/>'


def _axis(
    first: float, last: float, y_first: float, y_last: float, width: int, title: str
) -> Iterator[str]:
    """Lines and numbers of an axis from `first` at `y_first` to `last` at `y_last`."""
    for value in ticks(first, last, round(abs(y_last - y_first) / 32)):
        y = y_first + (value - first) / (last - first) * (y_last - y_first)
        yield f'<path class="rule" d="M{_LEFT} {y:.1f}H{width - _RIGHT}"/>'
        text = numbers.number(value)
        yield f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'
    yield f'<text class="title" x="{_LEFT}" y="{min(y_first, y_last) - 8:.1f}">{title}</text>'


def _distances(total: float, width: int, bottom: float) -> Iterator[str]:
    room = width - _LEFT - _RIGHT
    for value in ticks(0.0, total, max(3, room // 90)):
        x = _LEFT + value / total * room
        yield f'<path class="tick" d="M{x:.1f} {bottom}v5"/>'
        text = numbers.number(value)
        yield f'<text x="{x:.1f}" y="{bottom + 18}" text-anchor="middle">{text}</text>'
    yield f'<path class="tick" d="M{_LEFT} {bottom}H{width - _RIGHT}"/>'
    yield (
        f'<text class="title" x="{width - _RIGHT}" y="{bottom + 34}" text-anchor="end">'
        "distance, m</text>"
    )


def _description(profile: RouteProfile, total: float) -> str:
    known = profile.height[np.isfinite(profile.height)]
    heights = ""
    if known.size:
        low, high = (numbers.length(float(height)) for height in (known.min(), known.max()))
        heights = f"heights from {low} to {high}, "
    sunk = profile.sinkage[np.isfinite(profile.sinkage)]
    deepest = numbers.length(float(sunk.max())) if sunk.size else "no"
    return f"Profile over {numbers.length(total)}: {heights}{deepest} of sinkage at most."


def _contours(heights: NDArray[np.float32], interval: float) -> NDArray[np.bool_]:
    """Pixels on contours, bool: the next one to the east or south is in another interval."""
    level = np.floor(heights.astype(np.float64) / interval)
    lines = np.zeros(heights.shape, np.bool_)
    # differences from NaN are NaN, and so no contours
    lines[:, :-1] |= np.abs(np.diff(level, axis=1)) > 0.0
    lines[:-1] |= np.abs(np.diff(level, axis=0)) > 0.0
    return lines


def map_picture(map_: Preview) -> NDArray[np.uint8]:
    """Picture of a map, (height, width, 4) uint8 RGBA, transparent where there is no ground.

    A pixel of the map becomes a square of pixels, so that the longer side has 720 or more. The
    ground that can be reached gets an outline.
    """
    shade = hillshade(
        map_.heights, map_.grid.resolution, exaggeration(map_.heights, map_.grid.resolution)
    )
    palette = np.array([COLORS[code] for code in sorted(COLORS)], np.float64)
    level = np.sin(LIGHT[1])
    # shading must not turn one verdict's lightness to another's
    light = np.clip(1.0 + 0.4 * (shade - level), *SHADING)
    painted = palette[map_.ground] * light[..., np.newaxis]
    interval = contour_interval(map_.heights)
    if interval:
        painted[_contours(map_.heights, interval)] *= _CONTOUR
    scale = max(1, -(-_SIDE // max(map_.ground.shape)))
    painted = painted.repeat(scale, axis=0).repeat(scale, axis=1)
    what = map_.ground.repeat(scale, axis=0).repeat(scale, axis=1)
    hatch(painted, what)
    if map_.reached is not None:
        inside = map_.reached.repeat(scale, axis=0).repeat(scale, axis=1)
        painted[_outline(inside)] = _OUTLINE
    ground = np.isfinite(map_.heights).repeat(scale, axis=0).repeat(scale, axis=1)
    rgba = np.empty((*what.shape, 4), np.uint8)
    rgba[..., :3] = np.clip(np.rint(painted), 0.0, 255.0)
    rgba[..., 3] = np.where(ground, 255, 0)
    rgba[~ground, :3] = 0
    return rgba


def hatch(painted: NDArray[np.float64], what: NDArray[np.uint8], step: int = _HATCH) -> None:
    """Darken lines and dots of a picture, so that classes differ without colour, too.

    Args:
        painted: (height, width, 3) float64 colours, which are changed in place.
        what: (height, width) uint8 `GroundClass`.
        step: distance between lines, pixels.
    """
    row, column = np.ogrid[: what.shape[0], : what.shape[1]]
    line = (row + column) % step < step // 4
    painted[line & (what == GroundClass.NO_GO)] *= 0.55
    other = (row - column) % step < step // 6
    painted[other & ((what == GroundClass.CUT_OFF) | (what == GroundClass.ONE_WAY))] *= 0.7
    dot = (row % step < step // 3) & (column % step < step // 3)
    painted[dot & (what == GroundClass.UNKNOWN)] *= 0.6


def _outline(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The outermost two pixels of an area."""
    core = np.pad(inside, 2, mode="edge")
    rows, columns = inside.shape
    shrunk = np.ones_like(inside)
    for row, column in ((0, 2), (4, 2), (2, 0), (2, 4)):
        shrunk &= core[row : row + rows, column : column + columns]
    return inside & ~shrunk
