"""Report, or several side by side, in lines of a terminal of at most 80 columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from terratool.report import numbers
from terratool.report.tables import WIDTH, Cell, Table, align, columns_in, truncate, wrap
from terratool.report.wording import join_words
from terratool.text.display import printable
from terratool.traversability.figures import Figures
from terratool.traversability.map_results import MapSummary, fraction_of
from terratool.traversability.report import comparison, wording
from terratool.traversability.report.tables import (
    chances,
    grounds_of,
    likelihoods,
    loads,
    reasons,
    title,
    warnings,
    what_binds,
)
from terratool.traversability.results import Reports, TraversabilityReport, VehicleComparison
from terratool.traversability.verdicts import Reason, Verdict

_NAME = 16
"""Most columns of names of surfaces; longer ones are cut."""
_VEHICLE = 20
"""Most columns of names of vehicles, and of cells in tables on several."""
_VERDICTS = tuple(verdict.label for verdict in Verdict)


def as_lines(reports: Reports) -> Iterator[str]:
    """Report, or comparison, in lines of at most 80 columns.

    A word that cannot be broken, such as a JSON pointer, may be longer.
    """
    if isinstance(reports, VehicleComparison):
        return _several(reports)
    return _one(reports)


def _one(report: TraversabilityReport) -> Iterator[str]:
    yield from wrap(f"{report.verdict.label}: {printable(wording.conclusion(report))}", "")
    for route in report.routes:
        line = printable(wording.route_line(route))
        if line not in printable(wording.conclusion(report)):
            yield from wrap(f"{route.verdict.label}: {line}")
        yield from wrap(wording.along_line(route))
        for number, way in enumerate(route.alternatives, 1):
            yield from wrap(f"alternative {number}: {wording.alternative(way)}")
    if report.reach and (line := wording.reach_line(report.reach)) != wording.conclusion(report):
        yield from wrap(printable(line))
    yield from _mend_lines(report)
    yield ""
    if any(not figures.missing for figures in report.surfaces):
        yield from align(_surfaces(report), words=_VERDICTS)
        yield from wrap(_step_limits(report))
        yield from wrap(_turns(report))
        yield from wrap(_ranges(report))
        yield from wrap(_stops(report))
        yield ""
    for table in (loads(report), chances(report)):
        if table.rows:
            titles = [column.title for column in table.columns]
            yield from align([titles, *map(_texts, table.rows)])
            yield ""
    if report.summary:
        yield from align(_map(report.summary))
        if likely := ", ".join(f"{name} on {part}" for name, part in likelihoods(report).rows):
            yield from wrap(f"Probability of go: {likely}")
        if binding := ", ".join(f"{reason} {part}" for reason, part in reasons(report).rows[:5]):
            yield from wrap(f"What binds: {binding}")
        if (counted := wording.counted_from_line(report)) not in wording.conclusion(report):
            yield from wrap(counted)
        yield ""
    for name, warning in warnings(report):
        yield from wrap(f"{truncate(name, _NAME)}: {warning}")
    for note in report.notes:
        yield from wrap(printable(note))


def _mend_lines(report: TraversabilityReport) -> Iterator[str]:
    """Sentence on surfaces that lack figures of a soil, and the lines of JSON that mend them."""
    mends = list(wording.mends(report))
    if mends:
        lacks = wording.lacking(report)
        if lacks not in wording.conclusion(report):
            yield from wrap(printable(lacks))
        yield "Give them a soil, for example this one; docs/format.md has others:"
        for place, line in mends:
            yield f"  {printable(line)}"
            yield f"    {printable(place)}"


def _texts(row: Sequence[Cell]) -> list[str]:
    """Row of names and numbers as a terminal shows it."""
    return [truncate(str(row[0]), _NAME), *map(str, row[1:])]


def _surfaces(report: TraversabilityReport) -> Iterator[Sequence[str]]:
    yield "surface", "sinkage", "climb", "across", "step", "pull", "level", "what binds"
    for figures in report.surfaces:
        if figures.missing:
            continue
        yield (
            truncate(title(figures), _NAME),
            numbers.length(figures.sinkage if figures.borne_at is None else figures.borne_at),
            wording.climb(figures),
            numbers.degrees(figures.cross_slope),
            numbers.length(figures.step),
            numbers.quantity(figures.drawbar, "N"),
            figures.verdict.label,
            what_binds(figures),
        )


def _step_limits(report: TraversabilityReport) -> str:
    """Sentence on the limits of steps, with the surfaces of each."""
    by_limit: dict[str, list[str]] = {}
    for figures in report.surfaces:
        if figures.step is not None:
            limit = wording.step_limit(figures, report.vehicle)
            by_limit.setdefault(limit, []).append(truncate(title(figures), _NAME))
    by_limit.pop(numbers.NOTHING, None)
    if len(by_limit) == 1:
        return f"Steps are limited by {next(iter(by_limit))}."
    parts = [f"{limit} ({', '.join(surfaces)})" for limit, surfaces in by_limit.items()]
    return f"Steps are limited by {join_words(parts)}." if parts else ""


def _turns(report: TraversabilityReport) -> str:
    """Sentence on the work of turning on the spot, by surface; empty if it takes none."""
    if radius := report.vehicle.turning_radius:
        return f"It does not turn on the spot: its turns have a radius of {numbers.length(radius)}."
    parts = _listed(
        (figures, wording.quarter_turn(figures))
        for figures in report.surfaces
        if figures.turning_work or figures.turning_binding != Reason.NONE
    )
    return f"Work of a turn on the spot by 90°: {parts}." if parts else ""


def _ranges(report: TraversabilityReport) -> str:
    """Sentence on the way on the level that a charge lasts for; empty without a battery."""
    battery = report.vehicle.battery
    parts = _listed(
        (figures, numbers.length(figures.driving_range))
        for figures in report.surfaces
        if figures.driving_range is not None
    )
    if battery is None or not parts:
        return ""
    return f"Range on a charge of {numbers.energy(battery.usable)}: {parts}."


def _stops(report: TraversabilityReport) -> str:
    """Sentence on speeds that stop in time on the level; empty where that is not limited."""
    parts = _listed(
        (figures, f"{numbers.quantity(figures.speed_limit, 'm/s')}")
        for figures in report.surfaces
        if figures.speed_limit is not None
    )
    within = numbers.length(report.vehicle.stopping_distance)
    return f"To stop within {within} on the level, no faster than: {parts}." if parts else ""


def _listed(texts: Iterable[tuple[Figures, str]]) -> str:
    """Texts with the names of the surfaces that have each."""
    by_text: dict[str, list[str]] = {}
    for figures, text in texts:
        by_text.setdefault(text, []).append(truncate(title(figures), _NAME))
    return "; ".join(f"{', '.join(surfaces)} {text}" for text, surfaces in by_text.items())


def _map(summary: MapSummary) -> Iterator[Sequence[str]]:
    kinds = grounds_of(summary)
    yield "ground", *(ground.label for ground in kinds), ""
    for heading, counts in (
        ("best heading", summary.counts),
        ("worst heading", summary.worst_counts),
    ):
        yield heading, *(numbers.share(fraction_of(counts, ground)) for ground in kinds), ""


def _several(found: VehicleComparison) -> Iterator[str]:
    first = found.reports[0]
    yield from wrap(f"{found.verdict.label}: {comparison.conclusion(found)}", "")
    for one in found.reports:
        line = printable(wording.conclusion(one))
        yield from wrap(f"{wording.vehicle_name(one)}: {one.verdict.label}: {line}")
    yield from _mend_lines(first)
    for number, route in enumerate(first.routes):
        yield ""
        yield f"way {wording.ends(route)}"
        yield from align(_rows(comparison.way(found, number)), words=_VERDICTS)
    for table in (comparison.surfaces(found), comparison.shares(found)):
        for part in _parts(table):
            yield ""
            yield from align(_rows(part), left=table.columns[0].title == "surface")
    yield ""
    for name, line in comparison.reaches(found):
        yield from wrap(printable(f"{name}: {line}"))
    if line := comparison.together_line(found):
        yield from wrap(line)
        yield ""
    for note in comparison.notes(found):
        yield from wrap(printable(note))


def _rows(table: Table) -> Iterator[Sequence[str]]:
    """Titles and cells as texts, with names cut, and an empty cell behind a last number."""
    more = [""] * table.columns[-1].numeric
    yield [*(truncate(column.title, _VEHICLE) for column in table.columns), *more]
    for row in table.rows:
        first, *cells = (cell if isinstance(cell, str) else cell.label for cell in row)
        yield [truncate(first, _VEHICLE), *cells, *more]


def _parts(table: Table) -> Iterator[Table]:
    """Table, split by columns into several where it is too wide for a terminal."""
    if not table.rows:
        return
    texts = [list(row) for row in _rows(table)]
    wide = [max(columns_in(row[n]) for row in texts) + 2 for n in range(len(table.columns))]
    begin = 1
    while begin < len(wide):
        end = begin + 1
        while end < len(wide) and wide[0] + sum(wide[begin : end + 1]) - 2 <= WIDTH:
            end += 1
        pick = [0, *range(begin, end)]
        yield Table(
            tuple(table.columns[n] for n in pick),
            tuple(tuple(row[n] for n in pick) for row in table.rows),
        )
        begin = end
