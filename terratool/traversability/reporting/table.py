"""A report for a terminal: a short table that fits 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from terratool.text.display import columns_of, printable
from terratool.traversability.reporting import tables, wording
from terratool.traversability.results import Figures, TraversabilityReport, Verdict

WIDTH = 80
_NAME = 16
"""Columns for names of surfaces; longer ones are cut."""


def as_lines(report: TraversabilityReport) -> Iterator[str]:
    """A report in lines of at most 80 columns.

    What cannot be broken, as a JSON pointer, may be longer.
    """
    yield from _wrapped(f"{report.verdict.label}: {printable(report.sentence)}", "")
    for route in report.routes:
        line = printable(wording.route_line(route))
        if line not in printable(report.sentence):
            yield from _wrapped(f"{route.verdict.label}: {line}")
    if report.reach:
        yield from _wrapped(printable(wording.reach_line(report.reach)))
    yield ""
    if report.surfaces:
        yield from _aligned(_surfaces(report))
        yield ""
    yield from _aligned(_map(report))
    yield ""
    for name, warning in tables.warnings(report):
        yield from _wrapped(f"{cut(name, _NAME)}: {warning}")
    for note in report.notes:
        yield from _wrapped(printable(note))


def _surfaces(report: TraversabilityReport) -> Iterator[Sequence[str]]:
    yield "surface", "sinkage", "climb", "across", "step", "pull", "level", "what binds"
    for figures in report.surfaces:
        yield (
            _title(figures),
            wording.length(figures.sinkage),
            wording.degrees(figures.climb),
            wording.degrees(figures.cross_slope),
            wording.length(figures.step),
            wording.quantity(figures.drawbar, "N"),
            figures.verdict.label,
            tables.what_binds(figures),
        )


def _map(report: TraversabilityReport) -> Iterator[Sequence[str]]:
    summary = report.summary
    yield "ground", *(verdict.label for verdict in tables.VERDICTS), "what binds"
    ranked = tables.reasons(report).rows
    binding = ", ".join(f"{reason} {part}" for reason, part in ranked[:2])
    for title, counts, why in (
        ("best heading", summary.counts, binding),
        ("worst heading", summary.worst_counts, ""),
    ):
        total = sum(counts.values())
        parts = (counts.get(verdict, 0) / total if total else 0.0 for verdict in tables.VERDICTS)
        yield title, *map(wording.share, parts), why


def _title(figures: Figures) -> str:
    return cut(tables.title(figures), _NAME)


def cut(text: str, columns: int) -> str:
    """A text that takes at most so many columns of a terminal."""
    if sum(map(columns_of, text)) <= columns:
        return text
    kept, room = "", columns - 1
    for char in text:
        room -= columns_of(char)
        if room < 0:
            break
        kept += char
    return f"{kept.rstrip()}…"


def _aligned(rows: Iterator[Sequence[str]]) -> Iterator[str]:
    """Rows in columns: the first and the last, and verdicts, flush left, the others right.

    The last column gets what the others leave, and goes on below where that is not enough.
    """
    cells = [list(row) for row in rows]
    widths = [max(sum(map(columns_of, row[i])) for row in cells) for i in range(len(cells[0]))]
    widths[-1] = WIDTH - sum(widths[:-1]) - 2 * (len(widths) - 1)
    labels = {verdict.label for verdict in Verdict}
    margin = " " * (WIDTH - widths[-1])
    for row in cells:
        row[-1], *below = _wrapped(row[-1], "", widths[-1]) if row[-1] else [""]
        parts = []
        for index, (whole, width) in enumerate(zip(row, widths, strict=True)):
            text = cut(whole, width)
            room = " " * (width - sum(map(columns_of, text)))
            left = index == 0 or index == len(row) - 1 or cells[1][index] in labels
            parts.append(text + room if left else room + text)
        yield "  ".join(parts).rstrip()
        for text in below:
            yield f"{margin}{cut(text, widths[-1])}"


def _wrapped(text: str, indent: str = "  ", width: int = WIDTH) -> Iterator[str]:
    """Lines of words; the module `textwrap` does not know that some letters take two columns."""
    line = ""
    for word in text.split():
        longer = f"{line} {word}" if line else word
        if line and sum(map(columns_of, longer)) > width:
            yield line
            longer = indent + word
        line = longer
    if line:
        yield line
