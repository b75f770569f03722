"""A report in Markdown, as code hosts show it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from terratool.text.display import printable
from terratool.traversability.reporting import tables, wording
from terratool.traversability.reporting.tables import Cell, Table
from terratool.traversability.results import TraversabilityReport, Verdict

MARKS = {Verdict.GO: "✔", Verdict.CAUTION: "!", Verdict.NO_GO: "✘", Verdict.UNKNOWN: "?"}

# what begins markup anywhere in a line, a cell of a table and HTML included
_MARKUP = re.compile(r"([\\`*_{}\[\]<>&|~#$])")


def as_markdown(report: TraversabilityReport) -> str:
    """A report as the text of a Markdown file (GitHub's flavour, for its tables)."""
    return "\n".join(_lines(report)) + "\n"


def escaped(text: str) -> str:
    """A text of the user's on one line, none of it markup."""
    return _MARKUP.sub(r"\\\1", printable(text))


def _lines(report: TraversabilityReport) -> Iterator[str]:
    yield f"# {_cell(report.verdict)}: {escaped(report.terrain)}"
    yield ""
    yield f"**{escaped(report.sentence)}**"
    yield ""
    vehicle = escaped(report.vehicle.name) or "a wheel"
    descr = f" ({escaped(report.descr)})" if report.descr else ""
    yield f"Terrain {escaped(report.terrain)}{descr}, driven by {vehicle}."
    yield ""
    for route in report.routes:
        yield f"## {'Route' if route.planned else 'Waypoints'} {escaped(wording.ends(route))}"
        yield ""
        yield f"{_cell(route.verdict)}. {escaped(wording.route_line(route))}"
        yield ""
        for title, text in tables.journey(route):
            yield f"- {title}: {escaped(text)}"
        yield ""
    if report.reach:
        yield "## Reach"
        yield ""
        yield escaped(wording.reach_line(report.reach))
        yield ""
    yield "## Surfaces"
    yield ""
    yield "What the vehicle can do on each."
    yield ""
    yield from _table(tables.abilities(report))
    yield "The wheel that bears most, and the soil under it."
    yield ""
    yield from _table(tables.contact(report))
    yield "What each was taken for."
    yield ""
    yield from _table(tables.soils(report))
    for name, warning in tables.warnings(report):
        yield f"- {escaped(name)}: {escaped(warning)}"
    yield from [""] if tables.warnings(report) else []
    yield "## Map"
    yield ""
    for note in report.notes:
        yield f"- {escaped(note)}"
    yield from [""] if report.notes else []
    for table in (tables.shares(report), tables.reasons(report), tables.grounds(report)):
        yield from _table(table)
    yield "## Vehicle"
    yield ""
    yield from _table(tables.properties(report.vehicle))
    yield "## Limits and assumptions"
    yield ""
    for sentence in report.assumptions:
        yield f"- {escaped(sentence)}"


def _table(table: Table) -> Iterator[str]:
    if not table.rows:
        return
    yield _row([column.title for column in table.columns])
    yield _row(["--:" if column.numeric else ":--" for column in table.columns], plain=True)
    for row in table.rows:
        yield _row(row)
    yield ""


def _row(cells: tuple[Cell, ...] | list[str], plain: bool = False) -> str:
    return f"| {' | '.join(str(cell) if plain else _cell(cell) for cell in cells)} |"


def _cell(cell: Cell) -> str:
    return f"{MARKS[cell]} {cell.label}" if isinstance(cell, Verdict) else escaped(cell)
