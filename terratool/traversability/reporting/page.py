"""A report as one HTML page: no script, nothing from elsewhere, readable at any width and in print.

Its tags are closed as XML wants it, so that it is well-formed for either kind of reader.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Sequence
from html import escape as _escape
from importlib.resources import files

from terratool.text.display import printable
from terratool.traversability.reporting import tables, wording
from terratool.traversability.reporting.chart import CLASSES, chart
from terratool.traversability.reporting.markdown import MARKS
from terratool.traversability.reporting.tables import Cell, Column, Table
from terratool.traversability.results import Location, Route, Survey, TraversabilityReport, Verdict

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
    style = (files("terratool.traversability.reporting") / "style.css").read_text("utf-8")
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
    from terratool.traversability.reporting import picture

    reached = None
    if report.reach is not None and report.reach.cells.shape == preview.heights.shape:
        reached = report.reach.cells
    west, south, east, north = preview.grid.bounds
    aspect = (east - west) / (north - south)
    data = base64.b64encode(picture.png(picture.paint(preview, reached))).decode("ascii")
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
    factor = picture.exaggeration(preview)
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
    from terratool.traversability.reporting.chart import ticks

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
