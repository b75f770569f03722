"""Results that show themselves: in lines as the command, in notebooks as tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from html import escape

from msgspec import structs

from terratool.report.tables import Table
from terratool.text.display import printable
from terratool.traversability.report import comparison, tables, wording
from terratool.traversability.report.lines import as_lines
from terratool.traversability.results import Reports, TraversabilityReport, VehicleComparison
from terratool.viewing.diff import report as diff_report
from terratool.viewing.diff.results import Comparison, Difference, FileDifference

OTHER = "the other terrain"
"""Name of the new side of a difference whose sides are of one file."""
_REST = "; its attributes have all"
"""Words behind a list of which some lines are left out."""


class ShownReport(TraversabilityReport):
    """A report that says what it found, in a terminal and in a notebook."""

    __slots__ = ()

    def __str__(self) -> str:
        return _text(self)

    def _repr_html_(self) -> str:
        """Verdict, ways, and tables of ground and surfaces, for notebooks."""
        said = [f"{route.verdict}: {wording.route_line(route)}" for route in self.routes]
        conclusion = wording.conclusion(self)
        parts = [
            _headline(str(self.verdict), conclusion),
            *(f"<p>{escape(printable(line))}</p>" for line in said if conclusion not in line),
            *map(_table, (tables.shares(self), tables.abilities(self))),
        ]
        return f"<div>{''.join(parts)}</div>"


class ShownComparison(VehicleComparison):
    """A comparison that says what it found, in a terminal and in a notebook."""

    __slots__ = ()

    def __str__(self) -> str:
        return _text(self)

    def _repr_html_(self) -> str:
        """Verdict, and tables of vehicles by way, ground and surface, for notebooks."""
        ways = range(len(self.reports[0].routes))
        found = [comparison.way(self, number) for number in ways]
        found += [comparison.shares(self), comparison.surfaces(self)]
        headline = _headline(str(self.verdict), comparison.conclusion(self))
        return f"<div>{headline}{''.join(map(_table, found))}</div>"


class ShownDifference(Difference, frozen=True):
    """A difference that says what it found, in a terminal and in a notebook."""

    def __repr__(self) -> str:
        old, new = map(printable, (self.old, self.new))
        return f"<Difference from {old} to {new}: {self._file.status}>"

    def __str__(self) -> str:
        return diff_report.as_text(Comparison((self._file,)), diff_report.MOST, _REST)

    def _repr_html_(self) -> str:
        """Lines of the difference, for notebooks."""
        return f"<pre>{escape(str(self))}</pre>"

    @property
    def _file(self) -> FileDifference:
        return FileDifference.of(self.new, self)


def shown_difference(found: Difference) -> ShownDifference:
    """Difference that shows itself, and whose sides have different names."""
    new = OTHER if found.old == found.new else found.new
    return ShownDifference(**{**structs.asdict(found), "new": new})


def shown_report(found: Reports) -> ShownReport | ShownComparison:
    """Report, or comparison with its reports, that shows itself."""
    if isinstance(found, VehicleComparison):
        return ShownComparison(tuple(map(_alone, found.reports)), found.notes)
    return _alone(found)


def _alone(report: TraversabilityReport) -> ShownReport:
    return ShownReport(*(getattr(report, one.name) for one in fields(report)))


def _text(found: Reports) -> str:
    """Lines that the command prints."""
    return "\n".join(as_lines(found))


def _headline(verdict: str, conclusion: str) -> str:
    """Paragraph that begins with the verdict."""
    return f"<p><b>{escape(verdict)}</b>: {escape(printable(conclusion))}</p>"


def _table(table: Table) -> str:
    """HTML of a table; empty if it has no rows."""
    if not table.rows:
        return ""
    return f"<table>{''.join(_rows(table))}</table>"


def _rows(table: Table) -> Iterator[str]:
    """HTML of the rows of a table, the titles first."""
    sides = ["right" if column.numeric else "left" for column in table.columns]
    texts = [[cell if isinstance(cell, str) else cell.label for cell in row] for row in table.rows]
    for tag, row in [("th", [one.title for one in table.columns]), *(("td", row) for row in texts)]:
        cells = zip(sides, row, strict=True)
        yield (
            "<tr>"
            + "".join(
                f"<{tag} style='text-align: {side}'>{escape(text)}</{tag}>" for side, text in cells
            )
            + "</tr>"
        )
