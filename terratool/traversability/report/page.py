"""Report, or several side by side, as an HTML page without scripts and links, or Markdown."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool._version import __version__
from terratool.io.png import png
from terratool.raster.shading import contour_interval, exaggeration, ticks
from terratool.report import numbers
from terratool.report.markup import escape_html, escape_markdown, render
from terratool.report.tables import Table, join_tables
from terratool.report.wording import join_words
from terratool.text.display import quote
from terratool.traversability.keep_out import Zone
from terratool.traversability.map_results import Preview, cells_of, fraction_of
from terratool.traversability.report import comparison, curves, tables, wording
from terratool.traversability.report.drawing import chart, map_picture
from terratool.traversability.report.roses import rose_path
from terratool.traversability.report.wording import vehicle_name
from terratool.traversability.results import Reports, TraversabilityReport
from terratool.traversability.route.drifting import corridor
from terratool.traversability.route.results import Location, Route
from terratool.traversability.verdicts import GroundClass

_FOLDER = Path(__file__).parent
_NAME = 14
"""Most characters of a name that a table does not break."""


def as_page(reports: Reports) -> str:
    """Report, or comparison, as the text of an HTML file; equal from run to run."""
    pictures = [list(_pictures_of(one)) for one in reports.reports]
    return render(
        _FOLDER / "page.html.jinja", escape_html, pictures=pictures, **_variables(reports)
    )


def as_markdown(reports: Reports) -> str:
    """Report, or comparison, as the text of a Markdown file (GitHub's, for its tables)."""
    return render(_FOLDER / "page.md.jinja", escape_markdown, **_variables(reports))


def _variables(reports: Reports) -> dict[str, Any]:
    """Variables of both templates."""
    first, several = reports.reports[0], not isinstance(reports, TraversabilityReport)

    def of_all(table: Callable[[TraversabilityReport], Table]) -> Table:
        return join_tables([(vehicle_name(one), table(one)) for one in reports.reports], "vehicle")

    told = {
        "conclusion": wording.conclusion(first),
        "shares": tables.shares(first),
        "together": "",
        "side_by_side": Table((), ()),
        "ways": [None] * len(first.routes),
    }
    if not isinstance(reports, TraversabilityReport):
        told = {
            "conclusion": comparison.conclusion(reports),
            "shares": comparison.shares(reports),
            "together": comparison.together_line(reports),
            "side_by_side": comparison.surfaces(reports),
            "ways": [comparison.way(reports, number) for number in range(len(first.routes))],
        }
    return {
        **told,
        "report": reports,
        "first": first,
        "several": several,
        "drivers": join_words([vehicle_name(one) for one in reports.reports]),
        "mends": list(wording.mends(first)),
        "reaches": comparison.merge_sentences(
            reports, lambda one: [wording.reach_line(one.reach)] if one.reach else []
        ),
        "abilities": of_all(tables.abilities),
        "chances": of_all(tables.chances),
        "loads": of_all(tables.loads),
        "operations": of_all(tables.operations),
        "contact": of_all(tables.contact),
        "soils": of_all(tables.soils),
        "slips": of_all(tables.slips),
        "drifts": of_all(tables.drifts),
        "panels": curves.slip_panels(reports),
        "warnings": comparison.merge_sentences(
            reports, lambda one: (f"{name}: {line}" for name, line in tables.warnings(one))
        ),
        "notes": comparison.notes(reports),
        "counted_from": comparison.merge_sentences(
            reports, lambda one: filter(None, [wording.counted_from_line(one)])
        ),
        "likelihoods": of_all(tables.likelihoods),
        "reasons": of_all(tables.reasons),
        "grounds": of_all(tables.grounds),
        "figures": of_all(lambda one: tables.properties(one.vehicle)),
        "assumptions": comparison.merge_sentences(reports, lambda one: one.assumptions),
        "tables": tables,
        "wording": wording,
        "numbers": numbers,
        "curves": curves,
        "chart": chart,
        "first_width": _first_width,
        "suffix": _suffix,
        "version": __version__,
    }


def _first_width(table: Table) -> int:
    """Least width of a table's first column, in characters."""
    names = [cell for cell, *_ in table.rows if isinstance(cell, str)]
    return min(_NAME, max(map(len, names), default=0)) + 1


def _suffix(report: TraversabilityReport, number: int) -> str:
    """Number that tells a route's pins from those of others; empty if it is the only route."""
    return str(number) if len(report.routes) > 1 else ""


_ROSES = (
    "Where headings differ, white petals point to where the vehicle can head, go or caution; each "
    "is as long as the share on which it can, of the ground around it where headings differ."
)
"""Caption of the roses of a map."""


_ONE_TOP = 1e-3
"""Difference of heights of one top on two maps, m."""


class _Pin(NamedTuple):
    """Mark on the picture: CSS class, text, and position in % of the width and the height."""

    style: str
    text: str
    left: float
    top: float


def _pictures_of(report: TraversabilityReport) -> Iterator[dict[str, Any]]:
    """Variables of maps: of the best heading, of the worst where it differs, and of storeys."""
    preview, summary = report.preview, report.summary
    if preview is None or summary is None:
        return
    yield {
        **_picture_of(report, preview, summary.counts),
        "caption": _caption(report, preview),
        "of": "best heading",
        "roses": "",
        "routed": True,
    }
    worst = _own_worst(preview)
    if worst is not None:
        path = rose_path(preview)
        yield {
            **_picture_of(report, replace(preview, ground=worst), summary.worst_counts),
            "caption": f"The verdict of the worst heading at each place. {_ROSES if path else ''}",
            "of": "worst heading",
            "routed": False,
            "heights": "",
            "roses": path,
        }
    for number, storey in enumerate(preview.storeys, 1):
        of = f" {number} of {len(preview.storeys)}" if len(preview.storeys) > 1 else ""
        classes, counts = np.unique(storey.ground[np.isfinite(storey.heights)], return_counts=True)
        known = {GroundClass(n): count for n, count in zip(classes, counts.tolist(), strict=True)}
        yield {
            **_picture_of(report, preview, known, number),
            "caption": f"Map{of} of decks and bores, by the best heading; shares are of their tops."
            + _FAINT * any(route.profile is not None for route in report.routes),
            "of": f"best heading, decks and bores{of}",
            "heights": _heights(storey),
            "roses": "",
        }


_FAINT = " Ways are faint where they are not on what the map shows."
"""Caption of maps of terrains with storeys."""


def _own_worst(preview: Preview) -> NDArray[np.uint8] | None:
    """Classes by the worst heading; None where they are those by the best."""
    worst = preview.worst
    return None if worst is None or np.array_equal(worst, preview.ground) else worst


def _picture_of(
    report: TraversabilityReport, preview: Preview, counts: dict[GroundClass, int], number: int = 0
) -> dict[str, Any]:
    """Variables of a map: the picture, routes and pins over it, a scale, a legend.

    With a number above 0 it is a map of storeys.
    """
    shown = (preview, *preview.storeys)[number]
    west, south, east, north = preview.grid.bounds
    width, height = east - west, north - south
    drawn = [(way, " thin") for route in report.routes for way in route.alternatives]
    # where a way back is that there, the latter is seen
    drawn += [(route.back, " dashed") for route in report.routes if route.back is not None]
    drawn += [(route, "" if route.found else " dashed") for route in report.routes]
    ways = [way for route, style in drawn for way in _ways(route, preview, number, style)]
    scale = ticks(0.0, width, 4)[1]
    parts = {ground: fraction_of(counts, ground) for ground in wording.GROUNDS}
    return {
        "width": f"{min(60.0, 44.0 * (width / height)):.4g}",
        "png": base64.b64encode(png(map_picture(shown))).decode("ascii"),
        "pixels": preview.ground.shape[::-1],
        "ways": ways,
        "routed": not all(style.endswith("faint") for _, style in ways),
        "zones": [path for zone in report.keep_out if (path := _outline(zone, preview))],
        "strips": [
            _polyline(outline, preview)
            for route in report.routes
            if route.profile is not None
            for outline in corridor(route.profile)
        ],
        "pins": _pins(report, _source(report), preview, number),
        "x_axis": _axis(west, east),
        "y_axis": [(100.0 - at, text) for at, text in _axis(south, north)],
        "y_width": 3 + max(len(text) for _, text in _axis(south, north)),
        "scale": scale,
        "scale_width": 100.0 * scale / width,
        "heights": _heights(preview),
        "legend": [
            (ground.label, part)
            for ground, part in parts.items()
            if ground in (GroundClass.GO, GroundClass.CAUTION, GroundClass.NO_GO) or part
        ],
    }


def _caption(report: TraversabilityReport, preview: Preview) -> str:
    caption = "The verdict of the best heading at each place, over the hills in light from the "
    caption += "north-west"
    factor = exaggeration(preview.heights, preview.grid.resolution)
    caption += f", {numbers.number(factor)} times as steep as they are. " if factor > 1 else ". "
    caption += f"North is up; a pixel is {numbers.length(preview.grid.resolution)}. "
    crs = f" in {preview.crs}" if preview.crs else ""
    caption += f"Along the sides stand x and y{crs}, m."
    if _own_worst(preview) is not None and report.summary is not None:
        barred = numbers.share(fraction_of(report.summary.worst_counts, GroundClass.NO_GO))
        caption += f" With the worst heading {barred} is no-go, as another map shows."
    if report.keep_out:
        names = join_words([quote(zone.name) for zone in report.keep_out])
        caption += f" White dashed outlines: keep-out {names}."
    if any(
        route.profile is not None and any(True for _ in corridor(route.profile))
        for route in report.routes
    ):
        caption += " Beside a way lies the strip over which the vehicle drifts downhill if nobody "
        caption += "steers against it between two corners."
    if preview.storeys:
        caption += " It shows the ground, and shares of all tops; decks and bores have maps of "
        caption += "their own."
        caption += _FAINT * any(route.profile is not None for route in report.routes)
    if any(route.alternatives for route in report.routes):
        caption += " Thin lines with numbers are alternatives."
    if any(route.back is not None for route in report.routes):
        caption += " Ways back are dashed."
    if any(route.found and route.tightest is not None for route in report.routes):
        caption += " T is where the margin of a way is least."
    if report.reach is not None and report.summary is not None:
        caption += f" Blue is the rim of what can be reached from {_source(report)}."
    binding = ", ".join(f"{reason} {part}" for reason, part in tables.reasons(report).rows[:5])
    if binding:
        caption += f" What binds most where it is not simply go, of all ground: {binding}."
    return caption


def _heights(preview: Preview) -> str:
    """Phrase on the heights of contours; empty where there is no ground."""
    known = preview.heights[np.isfinite(preview.heights)]
    if not known.size:
        return ""
    low, high = (numbers.number(float(z), 4) for z in (known.min(), known.max()))
    if low == high:
        return f"height {low} m"
    interval = contour_interval(preview.heights)
    lines = f", lines every {numbers.length(interval)}" if interval else ""
    return f"heights from {low} to {high} m{lines}"


def _axis(first: float, last: float) -> list[tuple[float, str]]:
    """Round coordinates along a side: position in % from the first, and the text."""
    found = ticks(first, last, 4) or [first]
    return [(100.0 * (value - first) / (last - first), numbers.full(value)) for value in found]


def _position(x: float, y: float, preview: Preview) -> tuple[float, float]:
    """Position as shares of the picture's width from the west and height from the north."""
    west, south, east, north = preview.grid.bounds
    return (x - west) / (east - west), (north - y) / (north - south)


def _ways(route: Route, preview: Preview, number: int, style: str) -> Iterator[tuple[str, str]]:
    """Lines of a route on a map of storeys by its number, 0 for the ground, and their styles.

    Where the route is not on what the map shows it is faint.
    """
    profile = route.profile
    if profile is None or len(profile.x) < 2:
        return
    line = np.column_stack([profile.x, profile.y])
    shown = _is_shown(line, profile.height, preview, number)
    ends = np.flatnonzero(np.diff(shown[1:])) + 1
    for first, last in zip([0, *ends], [*ends, len(line) - 1], strict=True):
        points = _polyline(line[first : last + 1], preview)
        if points:
            yield points, style if shown[last] else f"{style} faint"


def _is_shown(
    line: NDArray[np.float64], heights: NDArray[np.float64], preview: Preview, number: int
) -> NDArray[np.bool_]:
    """Whether places, (n, 2) m, with heights, (n,), are on what a map shows, rather than others."""
    if not preview.storeys:
        return np.ones(len(line), np.bool_)
    away = []
    rows, columns = cells_of(preview.grid, *line.T)
    for other in (preview, *preview.storeys):
        far = np.abs(other.heights[rows, columns] - heights)
        away.append(np.where(np.isnan(far), np.inf, far))
    # a storey may be lowest, too
    return np.asarray(away[number] <= np.min(away, axis=0) + _ONE_TOP, np.bool_)


def _polyline(line: NDArray[np.float64], preview: Preview) -> str:
    """Points of a line, (n, 2) m, in thousandths of the picture's sides."""
    points: list[str] = []
    for x, y in line.tolist():
        right, down = _position(x, y, preview)
        point = f"{1000.0 * right:.1f},{1000.0 * down:.1f}"
        if not points or point != points[-1]:
            points.append(point)
    return " ".join(points)


def _outline(zone: Zone, preview: Preview) -> str:
    """Outline of a zone as an SVG path, in thousandths of the picture's sides; empty outside."""
    import shapely

    shape = shapely.intersection(zone.shape, shapely.box(*preview.grid.bounds))
    parts = []
    for polygon in shapely.get_parts(shape).tolist():
        if polygon.geom_type != "Polygon":
            continue  # where it only touches the picture's side
        for ring in (polygon.exterior, *polygon.interiors):
            places = (_position(x, y, preview) for x, y in np.array(ring.coords)[:-1, :2].tolist())
            points = [f"{1000.0 * right:.1f},{1000.0 * down:.1f}" for right, down in places]
            parts.append(f"M{'L'.join(points)}Z")
    return "".join(parts)


def _pins(report: TraversabilityReport, source: str, preview: Preview, picture: int) -> list[_Pin]:
    """Pins on a map of storeys by its number, 0 for the ground."""
    pins: list[tuple[str, str, Location]] = []
    pins += [("pin bar", "✘", bar.place) for route in report.routes for bar in route.barriers]
    if report.reach is not None and source == "S":
        pins.append(("pin", "S", report.reach.start))
    for number, route in enumerate(report.routes, 1):
        suffix = _suffix(report, number)
        for which, way in enumerate(route.alternatives, 1):
            pins.append(("pin other", f"{suffix}{'.' * bool(suffix)}{which}", _halfway(way)))
        if route.found and route.tightest is not None:
            pins.append(("pin tight", f"T{suffix}", route.tightest.place))
        pins += [("pin", f"A{suffix}", route.start), ("pin", f"B{suffix}", route.goal)]
    found = []
    for style, text, place in pins:
        right, down = _position(place.x, place.y, preview)
        z = math.nan if place.height is None else place.height
        here = _is_shown(np.array([[place.x, place.y]]), np.array([z]), preview, picture)
        if 0.0 <= right <= 1.0 and 0.0 <= down <= 1.0 and here[0]:
            found.append(_Pin(style, text, 100.0 * right, 100.0 * down))
    return found


def _halfway(route: Route) -> Location:
    """Place in the middle of a way; its start where it has no profile."""
    profile = route.profile
    if profile is None or not len(profile.distance):
        return route.start
    middle = int(np.searchsorted(profile.distance, 0.5 * profile.distance[-1]))
    x, y, z = (float(line[middle]) for line in (profile.x, profile.y, profile.height))
    return replace(route.start, x=x, y=y, height=z)


def _source(report: TraversabilityReport) -> str:
    """Name of the pin at the start of the reach: a route's that starts there, or its own."""
    for number, route in enumerate(report.routes, 1):
        if report.reach is not None and route.start == report.reach.start:
            return f"A{_suffix(report, number)}"
    return "S"
