"""A report as one HTML page with a map and charts: no script, nothing from elsewhere."""

from __future__ import annotations

import base64
import math
import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape as _escape
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from terratool.text.display import printable
from terratool.traversability.report import tables, wording
from terratool.traversability.report.tables import MARKS, Cell, Column, Table
from terratool.traversability.results import (
    COLORS,
    RANKS,
    Location,
    Route,
    RouteProfile,
    Survey,
    TraversabilityReport,
    Verdict,
)

_LEFT, _RIGHT, _TOP = 52, 12, 22
"""Margins for the numbers of the axes, and for what the upper axis is of."""
_HILL, _STRIP, _GAP, _SUNK, _BELOW = 130, 10, 30, 56, 40
"""Heights: of the ground's panel, the strip, the room between, the sinkage's panel, the x axis."""

CLASSES = {
    Verdict.UNKNOWN: "unknown", Verdict.GO: "go", Verdict.CAUTION: "caution",
    Verdict.NO_GO: "no-go",
}  # fmt: skip
"""Names of verdicts in style sheets."""


@dataclass(frozen=True, slots=True)
class _Bins:
    """A profile at the columns of a picture: low and high ground, deepest sinkage, worst verdict.

    A verdict that is not known counts as worse than go and better than no-go.
    """

    x: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    verdict: NDArray[np.int64]


def chart(profile: RouteProfile, width: int) -> str:
    """A profile as an SVG element of this width in pixels; empty where it has no length.

    Args:
        profile: along a route.
        width: of the picture, 240 or more.
    """
    total = float(profile.distance[-1] - profile.distance[0]) if len(profile.distance) else 0.0
    if not total > 0.0:
        return ""
    bins = _binned(profile, total, width - _LEFT - _RIGHT)
    bottom = _TOP + _HILL + _STRIP + _GAP + _SUNK
    finite = bins.high[np.isfinite(bins.high)]
    low, high = (float(np.nanmin(bins.low)), float(finite.max())) if finite.size else (0.0, 1.0)
    if high - low < 1e-9 * max(1.0, abs(high)):
        low, high = low - 0.5, high + 0.5
    sunk = np.nan_to_num(bins.sinkage)
    deepest = float(sunk.max())
    parts = [
        f'<svg class="profile" xmlns="http://www.w3.org/2000/svg" role="img" '
        f'viewBox="0 0 {width} {bottom + _BELOW}" width="{width}" height="{bottom + _BELOW}" '
        f'aria-label="{_escape(_described(profile, total))}">',
        *_axis(low, high, _TOP + _HILL, _TOP, width, "height, m"),
        _ground(bins, low, high),
        *_strip(bins),
    ]
    zero = _TOP + _HILL + _STRIP + _GAP
    most = deepest * 1e3 if deepest > 0.0 else 1.0
    parts += _axis(0.0, most, zero, zero + _SUNK, width, "sinkage, mm")
    if deepest > 0.0:
        parts.append(_sunken(bins.x, sunk / deepest * _SUNK, zero))
    parts += [*_distances(total, width, bottom), "</svg>"]
    return "".join(parts)


def _binned(profile: RouteProfile, total: float, columns: int) -> _Bins:
    along = (profile.distance - profile.distance[0]) / total * columns
    index = np.minimum(np.floor(along), columns - 1).astype(np.int64)
    starts = np.flatnonzero(np.diff(index, prepend=-1))
    rank = np.array([1.5, 1.0, 2.0, 3.0])[profile.verdict]
    worst = np.maximum.reduceat(rank, starts)
    codes = {1.0: Verdict.GO, 1.5: Verdict.UNKNOWN, 2.0: Verdict.CAUTION, 3.0: Verdict.NO_GO}
    x = along[starts]
    x[-1] = columns
    return _Bins(
        x + _LEFT,
        np.fmin.reduceat(profile.height, starts),
        np.fmax.reduceat(profile.height, starts),
        np.fmax.reduceat(profile.sinkage, starts),
        np.array([codes[value] for value in worst.tolist()], np.int64),
    )


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
            f'<rect class="{CLASSES[verdict]}" x="{start:.1f}" y="{_TOP + _HILL}" '
            f'width="{max(end - start, 1.0):.1f}" height="{_STRIP}"/>'
        )
        start = end


def _sunken(x: NDArray[np.float64], depth: NDArray[np.float64], zero: int) -> str:
    line = "".join(
        f"L{at:.1f} {zero + deep:.1f}" for at, deep in zip(x.tolist(), depth.tolist(), strict=True)
    )
    return f'<path class="sunken" d="M{x[0]:.1f} {zero}{line}L{x[-1]:.1f} {zero}Z"/>'


def _axis(
    first: float, last: float, y_first: float, y_last: float, width: int, title: str
) -> Iterator[str]:
    """Lines and numbers of an axis that goes from `first` at `y_first` to `last` at `y_last`."""
    for value in ticks(first, last, round(abs(y_last - y_first) / 32)):
        y = y_first + (value - first) / (last - first) * (y_last - y_first)
        yield f'<path class="rule" d="M{_LEFT} {y:.1f}H{width - _RIGHT}"/>'
        text = wording.number(value)
        yield f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'
    yield f'<text class="title" x="{_LEFT}" y="{min(y_first, y_last) - 8:.1f}">{title}</text>'


def _distances(total: float, width: int, bottom: float) -> Iterator[str]:
    room = width - _LEFT - _RIGHT
    for value in ticks(0.0, total, max(3, room // 90)):
        x = _LEFT + value / total * room
        yield f'<path class="tick" d="M{x:.1f} {bottom}v5"/>'
        text = wording.number(value)
        yield f'<text x="{x:.1f}" y="{bottom + 18}" text-anchor="middle">{text}</text>'
    yield f'<path class="tick" d="M{_LEFT} {bottom}H{width - _RIGHT}"/>'
    yield (
        f'<text class="title" x="{width - _RIGHT}" y="{bottom + 34}" text-anchor="end">'
        "distance, m</text>"
    )


def ticks(first: float, last: float, count: int) -> list[float]:
    """Round numbers from first to last: about so many, 1, 2 or 5 times a power of ten apart."""
    raw = (last - first) / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * 0.999)
    start = math.ceil(first / step - 1e-9)
    return [index * step for index in range(start, math.floor(last / step + 1e-9) + 1)]


def _described(profile: RouteProfile, total: float) -> str:
    known = profile.height[np.isfinite(profile.height)]
    heights = ""
    if known.size:
        low, high = (wording.length(float(height)) for height in (known.min(), known.max()))
        heights = f"heights from {low} to {high}, "
    sunk = profile.sinkage[np.isfinite(profile.sinkage)]
    deepest = wording.length(float(sunk.max())) if sunk.size else "no"
    return f"Profile over {wording.length(total)}: {heights}{deepest} of sinkage at most."


SHADING = 0.8, 1.08
"""Shares of a colour that are left in the shade and in full light."""

_SIDE = 720
"""Pixels that the longer side has at least, so that the hatching is fine."""
_HATCH = 12
"""Pixels from one line of the hatching to the next."""
_OUTLINE = (11, 61, 145)
"""Colour of the outline of what can be reached."""
_LIGHT = np.radians(315.0), np.radians(45.0)
"""Azimuth and height of the light."""
_RELIEF = np.tan(np.radians(40.0))
"""Slope that the steeper ground of a flat terrain is exaggerated to."""
_MOST = 10.0


def best(survey: Survey) -> NDArray[np.uint8]:
    """The verdict of the best heading at each pixel, (height, width) uint8.

    What is not known is better than no-go, as it is in the map.
    """
    verdicts = np.argsort(RANKS).astype(np.uint8)  # by their ranks
    out: NDArray[np.uint8] = verdicts[RANKS[survey.verdict].min(axis=0)]
    return out


def exaggeration(survey: Survey) -> float:
    """How much steeper the shading shows the ground, 1 to 10: so that gentle hills are seen."""
    east, north = _gradient(survey.heights, survey.grid.resolution)
    steepness = np.hypot(east, north)
    steepness = steepness[steepness > 0.0]
    if not steepness.size:
        return 1.0
    factor = float(np.clip(_RELIEF / np.quantile(steepness, 0.95), 1.0, _MOST))
    return float(f"{factor:.1g}")


def hillshade(
    heights: NDArray[np.float32], resolution: float, exaggerated: float = 1.0
) -> NDArray[np.float64]:
    """Light on the ground, 0 to 1, (height, width) float64; level ground has sin 45°.

    Slopes by Horn's formula (B. K. P. Horn, Hill shading and the reflectance map, Proceedings of
    the IEEE 69(1), 1981), light from the north-west; missing neighbours count as level.

    Args:
        heights: (height, width), rows from the north, NaN where there is no ground.
        resolution: side of a pixel.
        exaggerated: factor on heights.
    """
    east, north = _gradient(heights, resolution)
    azimuth, height = _LIGHT
    east, north = east * exaggerated, north * exaggerated
    towards = -east * np.sin(azimuth) - north * np.cos(azimuth)
    light = (np.sin(height) + towards * np.cos(height)) / np.sqrt(1.0 + east**2 + north**2)
    return np.asarray(np.clip(light, 0.0, 1.0))


def paint(survey: Survey, reached: NDArray[np.bool_] | None = None) -> NDArray[np.uint8]:
    """The picture, (height, width, 4) uint8 RGBA, transparent where there is no ground.

    A pixel of the survey is a square of as many pixels as it takes for the longer side to have 720.

    Args:
        survey: of a vehicle.
        reached: (height, width) what can be reached; gets an outline.
    """
    shade = hillshade(survey.heights, survey.grid.resolution, exaggeration(survey))
    verdict = best(survey)
    palette = np.array([COLORS[code] for code in sorted(COLORS)], np.float64)
    level = np.sin(_LIGHT[1])
    # shading must not turn one verdict's lightness to another's
    light = np.clip(1.0 + 0.4 * (shade - level), *SHADING)
    painted = palette[verdict] * light[..., np.newaxis]
    scale = max(1, -(-_SIDE // max(verdict.shape)))
    painted = painted.repeat(scale, axis=0).repeat(scale, axis=1)
    verdict = verdict.repeat(scale, axis=0).repeat(scale, axis=1)
    row, column = np.indices(verdict.shape, np.int32)
    line = (row + column) % _HATCH < 3
    painted[line & (verdict == Verdict.NO_GO)] *= 0.55
    dot = (row % _HATCH < 4) & (column % _HATCH < 4)
    painted[dot & (verdict == Verdict.UNKNOWN)] *= 0.6
    if reached is not None:
        inside = reached.repeat(scale, axis=0).repeat(scale, axis=1)
        painted[_rim(inside)] = _OUTLINE
    ground = np.isfinite(survey.heights).repeat(scale, axis=0).repeat(scale, axis=1)
    rgba = np.empty((*verdict.shape, 4), np.uint8)
    rgba[..., :3] = np.clip(np.rint(painted), 0.0, 255.0)
    rgba[..., 3] = np.where(ground, 255, 0)
    rgba[~ground, :3] = 0
    return rgba


def _rim(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The outermost two pixels of an area."""
    core = np.pad(inside, 2, mode="edge")
    rows, columns = inside.shape
    shrunk = np.ones_like(inside)
    for row, column in ((0, 2), (4, 2), (2, 0), (2, 4)):
        shrunk &= core[row : row + rows, column : column + columns]
    return inside & ~shrunk


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A picture as the bytes of a PNG file.

    Args:
        pixels: (height, width, bands) uint8.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.io import MemoryFile

    height, width, bands = pixels.shape
    with rasterio.Env(GDAL_PAM_ENABLED=False), MemoryFile(ext=".png") as memory:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with memory.open(
                driver="PNG", height=height, width=width, count=bands, dtype="uint8", ZLEVEL=9
            ) as file:
                file.write(np.moveaxis(pixels, -1, 0))
        return bytes(memory.getbuffer())


def _gradient(
    heights: NDArray[np.float32], resolution: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rise for each unit to the east and to the north, by Horn's weights; 0 where unknown."""
    padded = np.pad(heights.astype(np.float64), 1, mode="reflect", reflect_type="odd")
    middle = padded[1:-1, 1:-1]
    rows, columns = middle.shape

    def at(row: int, column: int) -> NDArray[np.float64]:
        near = padded[1 + row : 1 + row + rows, 1 + column : 1 + column + columns]
        return np.where(np.isfinite(near), near, middle)

    east = at(-1, 1) + 2.0 * at(0, 1) + at(1, 1) - at(-1, -1) - 2.0 * at(0, -1) - at(1, -1)
    north = at(-1, -1) + 2.0 * at(-1, 0) + at(-1, 1) - at(1, -1) - 2.0 * at(1, 0) - at(1, 1)
    span = 8.0 * resolution
    return np.nan_to_num(east / span), np.nan_to_num(north / span)


_WIDE, _NARROW = 900, 330
"""Widths of the two drawings of a profile, of which a page shows the one that fits."""

_NAME = 14
"""Characters of a name that a table does not break."""

_MANY = 8
"""Columns from which on a table is printed in a smaller type."""

_UNIT = re.compile(r"(?<=\d) (?=%|(?:mm|km|m|s|min|h|J|Wh|kWh|N|kg|W)\b)")

# in the legend and the profile as in the picture: lines for no-go, dots for unknown
_PATTERNS = """<svg width="0" height="0" style="position:absolute" aria-hidden="true"><defs>
<pattern id="hatched" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">
<rect width="6" height="6" style="fill:var(--no-go)"/><rect width="2" height="6" style="fill:#4d0f25"/></pattern>
<pattern id="dotted" width="6" height="6" patternUnits="userSpaceOnUse">
<rect width="6" height="6" style="fill:var(--unknown)"/><rect width="2" height="2" style="fill:#5f5f5f"/></pattern>
</defs></svg>"""  # noqa: E501


def as_page(report: TraversabilityReport) -> str:
    """A report as the text of an HTML file; the same from run to run."""
    return "\n".join(_page(report)) + "\n"


def escape(text: str) -> str:
    """A text on one line, none of it markup, with numbers and their units kept together."""
    return _UNIT.sub("\u00a0", _escape(printable(text)))


def _page(report: TraversabilityReport) -> Iterator[str]:
    title = f"{report.verdict.label}: {report.terrain}"
    style = (files("terratool.traversability.report") / "style.css").read_text("utf-8")
    yield '<!DOCTYPE html>\n<html lang="en" xmlns="http://www.w3.org/1999/xhtml">\n<head>'
    yield '<meta charset="utf-8"/>'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
    yield (
        '<meta http-equiv="Content-Security-Policy" '
        "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\"/>"
    )
    yield f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>"
    yield _PATTERNS
    yield from _head(report)
    yield "<main>"
    if report.preview is not None:
        yield from _picture(report, report.preview)
    for index, route in enumerate(report.routes):
        yield from _route(route, _suffix(index, report))
    if report.reach is not None:
        yield _heading("Reach")
        yield f"<p>{escape(wording.reach_line(report.reach))}</p>"
    yield from _surfaces(report)
    yield from _map(report)
    yield _heading("Vehicle")
    yield from _table(tables.properties(report.vehicle), "")
    if report.assumptions:
        yield _heading("Limits and assumptions")
        yield from _list(report.assumptions)
    yield "</main>\n</body>\n</html>"


def _head(report: TraversabilityReport) -> Iterator[str]:
    vehicle = escape(report.vehicle.name) or "a wheel by itself"
    yield f"<header>\n<h1>{escape(report.terrain)}</h1>"
    if report.descr:
        yield f"<p>{escape(report.descr)}</p>"
    yield f"<p>Driven by {vehicle}</p>\n</header>"
    yield '<section class="verdict" aria-label="Verdict">'
    mark = f"{MARKS[report.verdict]} {report.verdict.label}"
    yield f'<strong class="{CLASSES[report.verdict]}">{mark}</strong>'
    yield f"<p>{escape(report.sentence)}</p>\n</section>"


def _picture(report: TraversabilityReport, preview: Survey) -> Iterator[str]:

    reached = None
    if report.reach is not None and report.reach.cells.shape == preview.heights.shape:
        reached = report.reach.cells
    west, south, east, north = preview.grid.bounds
    aspect = (east - west) / (north - south)
    data = base64.b64encode(png(paint(preview, reached))).decode("ascii")
    said = escape(f"Map of {report.terrain} from above, north up. {report.sentence}")
    yield "<figure>"
    yield f'<div class="frame" style="max-width:{min(60.0, 44.0 * aspect):.4g}rem">'
    yield f'<img alt="{said}" src="data:image/png;base64,{data}"/>'
    ways = "".join(_way(route, preview) for route in report.routes)
    if ways:
        yield (
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 1000" '
            f'preserveAspectRatio="none" aria-hidden="true">{ways}</svg>'
        )
    yield from _pins(report, preview)
    yield "</div>"
    yield from _scale(east - west, min(60.0, 44.0 * aspect))
    yield '<ul class="legend">'
    for verdict in tables.VERDICTS:
        part = report.summary.fraction(verdict)
        if verdict != Verdict.UNKNOWN or part:
            yield f"<li>{_swatch(verdict)}{verdict.label} {wording.share(part)}</li>"
    yield "</ul>"
    caption = "The verdict of the best heading at each place, over the hills in light from the "
    caption += "north-west"
    factor = exaggeration(preview)
    caption += f", {wording.number(factor)} times as steep as they are. " if factor > 1 else ". "
    caption += f"North is up; a pixel is {wording.length(preview.grid.resolution)}."
    if reached is not None:
        caption += f" Blue is the rim of what can be reached from {_source(report)}."
    binding = ", ".join(f"{reason} {part}" for reason, part in tables.reasons(report).rows[:5])
    if binding:
        caption += f" What binds most where it is not simply go, of all ground: {binding}."
    yield f"<figcaption>{escape(caption)}</figcaption>\n</figure>"


def _position(place: Location, preview: Survey) -> tuple[float, float]:
    """Shares of the picture's width from the west and height from the north."""
    west, south, east, north = preview.grid.bounds
    return (place.x - west) / (east - west), (north - place.y) / (north - south)


def _way(route: Route, preview: Survey) -> str:
    if route.profile is None or len(route.profile.x) < 2:
        return ""
    west, south, east, north = preview.grid.bounds
    points: list[str] = []
    for x, y in zip(route.profile.x.tolist(), route.profile.y.tolist(), strict=True):
        right, down = (x - west) / (east - west), (north - y) / (north - south)
        point = f"{1000.0 * right:.1f},{1000.0 * down:.1f}"
        if not points or point != points[-1]:
            points.append(point)
    line = f'points="{" ".join(points)}" vector-effect="non-scaling-stroke"'
    dashed = "" if route.found else " dashed"
    return f'<polyline class="casing" {line}/><polyline class="way{dashed}" {line}/>'


def _pins(report: TraversabilityReport, preview: Survey) -> Iterator[str]:
    pins = [("pin bar", "✘", bar.place) for route in report.routes for bar in route.barriers]
    if report.reach is not None and _source(report) == "S":
        pins.append(("pin", "S", report.reach.start))
    for index, route in enumerate(report.routes):
        number = _suffix(index, report)
        pins += [("pin", f"A{number}", route.start), ("pin", f"B{number}", route.goal)]
    for kind, text, place in pins:
        right, down = _position(place, preview)
        if 0.0 <= right <= 1.0 and 0.0 <= down <= 1.0:
            yield (
                f'<span class="{kind}" style="left:{100.0 * right:.2f}%;top:{100.0 * down:.2f}%" '
                f'aria-hidden="true">{text}</span>'
            )


def _source(report: TraversabilityReport) -> str:
    """The pin from which reach is told: that of a route that starts there, or one of its own."""
    for index, route in enumerate(report.routes):
        if report.reach is not None and route.start == report.reach.start:
            return f"A{_suffix(index, report)}"
    return "S"


def _scale(side: float, widest: float) -> Iterator[str]:

    mark = ticks(0.0, side, 4)[1]
    yield f'<div style="max-width:{widest:.4g}rem" aria-hidden="true">'
    yield f'<div class="scale" style="width:{100.0 * mark / side:.2f}%"></div>'
    yield f"<p>{wording.length(mark)}</p></div>"


def _swatch(verdict: Verdict) -> str:
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" aria-hidden="true">'
        f'<rect class="{CLASSES[verdict]}" width="100%" height="100%"/></svg>'
    )


def _suffix(index: int, report: TraversabilityReport) -> str:
    return str(index + 1) if len(report.routes) > 1 else ""


def _route(route: Route, number: str) -> Iterator[str]:
    kind = "Route" if route.planned else "Waypoints"
    yield _heading(f"{kind} {number}".rstrip())
    yield f"<p>{_mark(route.verdict)} {escape(wording.route_line(route))}</p>"
    yield "<dl>"
    for title, text in tables.journey(route):
        yield f"<dt>{escape(title)}</dt><dd>{escape(text)}</dd>"
    yield "</dl>"
    if route.profile is None:
        return
    wide, narrow = chart(route.profile, _WIDE), chart(route.profile, _NARROW)
    if wide:
        yield "<figure>"
        yield f'<div class="wide">{wide}</div>\n<div class="narrow">{narrow}</div>'
        yield (
            f"<figcaption>The ground along the way from A{number} to B{number}, the verdict under "
            "it, and how deep the wheels sink, on a scale of its own.</figcaption>\n</figure>"
        )


def _surfaces(report: TraversabilityReport) -> Iterator[str]:
    yield _heading("Surfaces")
    if not report.surfaces:
        yield "<p>The terrain has none.</p>"
        return
    yield from _table(tables.abilities(report), "What the vehicle can do on each")
    yield from _table(
        tables.contact(report),
        "The wheel that bears most, and the soil under it: stresses, thrust, resistance and pull "
        "at the largest torque and slip allowed, the others on the level",
    )
    yield from _table(tables.soils(report), "What each was taken for")
    if tables.warnings(report):
        yield from _list([f"{name}: {warning}" for name, warning in tables.warnings(report)])


def _map(report: TraversabilityReport) -> Iterator[str]:
    yield _heading("Map")
    if report.notes:
        yield from _list(report.notes)
    yield from _table(tables.shares(report), "Shares of the ground")
    yield from _table(tables.reasons(report), "What binds where it is not simply go")
    yield from _table(tables.grounds(report), "By surface, for the best heading")


def _heading(text: str) -> str:
    return f"<h2>{escape(text)}</h2>"


def _list(sentences: Sequence[str]) -> Iterator[str]:
    yield "<ul>"
    for sentence in sentences:
        yield f"<li>{escape(sentence)}</li>"
    yield "</ul>"


def _mark(verdict: Verdict) -> str:
    return f'<span class="mark {CLASSES[verdict]}">{MARKS[verdict]} {verdict.label}</span>'


def _table(table: Table, caption: str) -> Iterator[str]:
    """A table whose cells know their titles, for screens too narrow for columns."""
    if not table.rows:
        return
    many = ' class="many"' if len(table.columns) > _MANY else ""
    yield f'<div class="sheet"><table role="table"{many}>'
    if caption:
        yield f"<caption>{escape(caption)}</caption>"
    names = [cell for cell, *_ in table.rows if isinstance(cell, str)]
    room = min(_NAME, max(map(len, names), default=0)) + 1
    first, *others = (escape(column.title) for column in table.columns)
    head = f'<th scope="col" role="columnheader" style="min-width:{room}ch">{first}</th>'
    head += "".join(
        f'<th scope="col" role="columnheader"{_kind(column)}>{title}</th>'
        for column, title in zip(table.columns[1:], others, strict=True)
    )
    yield f'<thead role="rowgroup"><tr role="row">{head}</tr></thead>\n<tbody role="rowgroup">'
    for row in table.rows:
        cells = "".join(
            f'<td role="cell" data-title="{escape(column.title)}"{_kind(column)}>{_cell(cell)}</td>'
            for column, cell in zip(table.columns[1:], row[1:], strict=True)
        )
        name = f'<th scope="row" role="rowheader">{_cell(row[0])}</th>'
        yield f'<tr role="row">{name}{cells}</tr>'
    yield "</tbody></table></div>"


def _kind(column: Column) -> str:
    return ' class="number"' if column.numeric else ""


def _cell(cell: Cell) -> str:
    if isinstance(cell, Verdict):
        return _mark(cell)
    return f"<span>{escape(cell)}</span>"
