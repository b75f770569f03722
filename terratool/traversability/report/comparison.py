"""Reports of several vehicles side by side: tables, lines, JSON, Markdown, a page, pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from terratool._version import __version__
from terratool.text.display import counted, listed, printable
from terratool.traversability.report import curves, document, wording
from terratool.traversability.report.page import picture_of, rendered_html, rendered_markdown
from terratool.traversability.report.routes import route_features
from terratool.traversability.report.tables import (
    WIDTH,
    Cell,
    Column,
    Judged,
    Table,
    aligned,
    columns_in,
    cut,
    grounds_of,
    mending_lines,
    properties,
    slips,
    title,
    what_binds,
    wrapped,
)
from terratool.traversability.results import (
    Comparison,
    Figures,
    GroundClass,
    Route,
    Verdict,
    fraction_of,
)

_NAME = 20
"""Columns for names of vehicles on a terminal; longer ones are cut."""
_PANEL, _NARROW = 460.0, 330.0
"""Width of the picture of a surface, on a page and on a phone."""


class Together(NamedTuple):
    """Ground that is go or caution for some vehicles, and for no others.

    Attributes:
        vehicles: which, by name; none where it is for none.
        share: of all ground.
    """

    vehicles: tuple[str, ...]
    share: float


def vehicle_name(comparison: Comparison, number: int) -> str:
    """What one of the vehicles is called."""
    return printable(comparison.reports[number].vehicle.name)


def conclusion(comparison: Comparison) -> str:
    """Which of the vehicles can drive there, in a sentence."""
    able: list[str] = []
    cannot: list[str] = []
    unknown: list[str] = []
    for n, one in enumerate(comparison.reports):
        if one.drives:
            able.append(f"{vehicle_name(comparison, n)} ({one.verdict.label})")
        else:
            kind = unknown if one.verdict == Verdict.UNKNOWN else cannot
            kind.append(vehicle_name(comparison, n))
    count = counted(len(comparison.reports), "vehicle")
    if able:
        number = "All" if not cannot and not unknown else str(len(able))
        parts = [f"{number} of {count} can drive there: {listed(able)}"]
    else:
        parts = [f"None of {count} {'is known to' if unknown else 'can'} drive there"]
    if cannot:
        parts.append(f"{listed(cannot)} cannot")
    if unknown:
        parts.append(f"of {listed(unknown)} it is not known")
    return f"{'; '.join(parts)}."


def surfaces(comparison: Comparison) -> Table:
    """Of each surface the verdict on the level for each vehicle, its climb, and what limits it."""
    rows: list[tuple[Cell, ...]] = [
        (title(row[0]), *(Judged(one.verdict, _ability(one)) for one in row))
        for row in zip(*(one.surfaces for one in comparison.reports), strict=True)
    ]
    return Table(_columns(comparison, "surface"), tuple(rows))


def _ability(figures: Figures) -> str:
    if figures.missing or figures.climb is None:
        return what_binds(figures)
    return f"{wording.degrees(figures.climb)}, {wording.because(figures.climb_binding)}"


def way(comparison: Comparison, number: int, brief: bool = False) -> Table:
    """What each vehicle makes of one of the ways that were asked for; places left out if brief."""
    routes = [one.routes[number] for one in comparison.reports]
    titles = [("verdict", False), ("length", True), ("time", True), ("energy", True)]
    titles += [("least margin", True), ("binds or bars", False)]
    if any(route.one_way or route.back for route in routes) and not brief:
        titles.append(("way back", False))
    rows: list[tuple[Cell, ...]] = [
        (vehicle_name(comparison, n), *_journey(route, brief)[: len(titles)])
        for n, route in enumerate(routes)
    ]
    return Table((Column("vehicle", False), *(Column(*one) for one in titles)), tuple(rows))


def _journey(route: Route, brief: bool) -> tuple[Cell, ...]:
    margin, binds = route.tightest, wording.NOTHING
    if route.barriers:
        more = len(route.barriers) - 1
        first = route.barriers[0]
        binds = wording.because(first.reason) if brief else wording.barrier(first)
        binds += f" (and {counted(more, 'more place')})" * bool(more)
    elif margin is not None:
        binds = wording.because(margin.reason)
        binds += f" at {wording.coordinates(margin.place)}" * (not brief)
    return (
        route.verdict,
        wording.length(route.length),
        wording.duration(route.time),
        wording.energy(route.energy),
        wording.NOTHING if margin is None else wording.share(max(margin.value, 0.0)),
        binds,
        _back(route),
    )


def _back(route: Route) -> str:
    """The way back, in brief."""
    if route.back is None:
        return "not the same way" if route.one_way else wording.NOTHING
    if not route.back.found:
        return "none"
    return f"{wording.length(route.back.length)}, {wording.duration(route.back.time)}"


def reaches(comparison: Comparison) -> list[tuple[str, str]]:
    """Names of vehicles, and what each can reach, in a sentence; none where nobody asked."""
    return [
        (vehicle_name(comparison, n), wording.reach_line(one.reach))
        for n, one in enumerate(comparison.reports)
        if one.reach is not None
    ]


def shares(comparison: Comparison) -> Table:
    """How much of the ground is what for each vehicle, by the best heading."""
    summaries = [one.summary for one in comparison.reports if one.summary is not None]
    if len(summaries) < len(comparison.reports):
        return Table((), ())
    kinds = [
        ground for ground in wording.GROUNDS if any(ground in grounds_of(one) for one in summaries)
    ]
    rows: list[tuple[Cell, ...]] = [
        (ground, *(wording.share(fraction_of(one.counts, ground)) for one in summaries))
        for ground in kinds
    ]
    return Table(_columns(comparison, "ground", True), tuple(rows))


def together(comparison: Comparison) -> list[Together]:
    """How much of the ground is go or caution for which vehicles, the most first.

    Counted on the pixels of the pictures: none where there are none, or their grids differ.
    """
    previews = [one.preview for one in comparison.reports if one.preview is not None]
    if len(previews) < len(comparison.reports) or len({one.grid for one in previews}) > 1:
        return []
    able = np.stack([one.ground for one in previews], axis=-1)
    able = (able == GroundClass.GO) | (able == GroundClass.CAUTION)
    kinds, count = np.unique(able[np.isfinite(previews[0].heights)], axis=0, return_counts=True)
    names = [one.vehicle.name for one in comparison.reports]
    found = [
        Together(tuple(name for name, can in zip(names, kind, strict=True) if can), float(share))
        for kind, share in zip(kinds.tolist(), count / max(count.sum(), 1), strict=True)
    ]
    return sorted(found, key=lambda one: -one.share)


def together_line(comparison: Comparison) -> str:
    """The same in a sentence; nothing where it is not known."""
    parts = []
    for vehicles, share in together(comparison):
        who = listed([*map(printable, vehicles)])
        if not vehicles:
            who = "none"
        elif len(vehicles) == len(comparison.reports):
            who = "all"
        elif len(vehicles) == 1:
            who = f"{who} alone"
        parts.append(f"{who} {wording.share(share)}")
    return f"Go or caution, of the ground: {', '.join(parts)}." if parts else ""


def figures(comparison: Comparison) -> Table:
    """The figures of the vehicles, in the order of the one that has most."""
    each = [
        {str(name): str(value) for name, value in properties(one.vehicle).rows}
        for one in comparison.reports
    ]
    names = dict.fromkeys(name for one in sorted(each, key=len, reverse=True) for name in one)
    rows = ((name, *(one.get(name, wording.NOTHING) for one in each)) for name in names)
    return Table(_columns(comparison, "figure"), tuple(rows))


def slopes(comparison: Comparison) -> Table:
    """The slip of each vehicle on slopes, surface by surface."""
    each = [slips(one) for one in comparison.reports]
    longest = max(each, key=lambda table: len(table.columns))
    if not longest.rows:
        return Table((), ())
    by_name = [{row[0]: row[1:] for row in table.rows} for table in each]
    rows = []
    for surface in dict.fromkeys(name for one in by_name for name in one):
        for n, one in enumerate(by_name):
            cells = one.get(surface, ())
            blank = (wording.NOTHING,) * (len(longest.columns) - 1 - len(cells))
            rows.append((f"{surface}, {vehicle_name(comparison, n)}", *cells, *blank))
    return Table((Column("surface, vehicle", False), *longest.columns[1:]), tuple(rows))


def _columns(comparison: Comparison, first: str, numeric: bool = False) -> tuple[Column, ...]:
    names = (vehicle_name(comparison, n) for n in range(len(comparison.reports)))
    return (Column(first, False), *(Column(name, numeric) for name in names))


def panels(comparison: Comparison, narrow: bool = False) -> list[str]:
    """A picture of slip against slope for each surface, with a line for each vehicle; as SVG."""
    wide = _NARROW if narrow else _PANEL
    charts = (
        curves.slip_chart(lines, marks, wide, name) for lines, marks, name in _panels(comparison)
    )
    return [chart for chart in charts if chart]


def _panels(
    comparison: Comparison,
) -> Iterator[tuple[list[curves.Line], list[tuple[float, str]], str]]:
    """Lines, marks and the name of each surface whose slip is known for a vehicle."""
    marks = curves.slip_marks([one.vehicle for one in comparison.reports])
    for row in zip(*(one.surfaces for one in comparison.reports), strict=True):
        lines = [
            curves.Line(vehicle_name(comparison, n), one.slip_curve, one.climb)
            for n, one in enumerate(row)
            if one.slip_curve is not None
        ]
        if lines:
            yield lines, marks, title(row[0])


def slip_unknown(comparison: Comparison) -> str:
    """Why slip is not known, and where; it is so for one vehicle as for the others."""
    return wording.slip_unknown(comparison.reports[0])


def common_notes(comparison: Comparison) -> tuple[str, ...]:
    """Sentences on how all were computed."""
    first, *others = (one.notes for one in comparison.reports)
    same = (note for note in first if all(note in notes for notes in others))
    return (*comparison.notes, *same)


def own_notes(comparison: Comparison) -> tuple[tuple[str, str], ...]:
    """Names of vehicles, and sentences on how only these were computed."""
    same = common_notes(comparison)
    return tuple(
        (printable(one.vehicle.name), printable(note))
        for one in comparison.reports
        for note in one.notes
        if note not in same
    )


def as_lines(comparison: Comparison) -> Iterator[str]:
    """A comparison in lines of at most 80 columns."""
    yield from wrapped(f"{comparison.verdict.label}: {conclusion(comparison)}", "")
    for n, one in enumerate(comparison.reports):
        line = printable(wording.conclusion(one))
        yield from wrapped(f"{vehicle_name(comparison, n)}: {one.verdict.label}: {line}")
    yield from mending_lines(comparison.reports[0])
    for number in range(len(comparison.reports[0].routes)):
        yield ""
        yield f"way {wording.ends(comparison.reports[0].routes[number])}"
        yield from aligned(_rows(way(comparison, number, brief=True)))
    for table in (surfaces(comparison), shares(comparison)):
        for part in _parts(table):
            yield ""
            yield from aligned(_rows(part), left=table.columns[0].title == "surface")
    yield ""
    for name, line in reaches(comparison):
        yield from wrapped(printable(f"{name}: {line}"))
    if line := together_line(comparison):
        yield from wrapped(line)
        yield ""
    for note in common_notes(comparison):
        yield from wrapped(printable(note))
    for name, note in own_notes(comparison):
        yield from wrapped(f"{name}: {note}")


def _rows(table: Table) -> Iterator[Sequence[str]]:
    """Titles and cells as texts, names cut; a last column of numbers is not the last then."""
    more = [""] * table.columns[-1].numeric
    yield [*(cut(column.title, _NAME) for column in table.columns), *more]
    for row in table.rows:
        first, *cells = (cell if isinstance(cell, str) else cell.label for cell in row)
        yield [cut(first, _NAME), *cells, *more]


def _parts(table: Table) -> Iterator[Table]:
    """A table, or several with some of its columns each, where it is too wide for a terminal."""
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


def as_dict(comparison: Comparison) -> dict[str, Any]:
    """A comparison as dictionaries, lists, texts and finite numbers, with all of the reports."""
    reports = [document.as_dict(one) for one in comparison.reports]
    names = [one.vehicle.name for one in comparison.reports]
    return {
        "format_version": document.FORMAT_VERSION,
        "tool": {"name": "terratool", "version": __version__},
        "verdict": comparison.verdict.label,
        "sentence": conclusion(comparison),
        "vehicles": [
            {"vehicle": name, "drives": one.drives, "verdict": one.verdict.label}
            for name, one in zip(names, comparison.reports, strict=True)
        ],
        "surfaces": [
            {
                "surface": row[0]["surface"],
                "vehicles": _picked(names, row, "verdict binding climb_deg climb_binding"),
            }
            for row in zip(*(one["surfaces"] for one in reports), strict=True)
        ],
        "routes": [
            {
                "start": row[0]["start"],
                "goal": row[0]["goal"],
                "vehicles": _picked(
                    names, row, "found verdict length_m time_s energy_J tightest barriers"
                ),
            }
            for row in zip(*(one["routes"] for one in reports), strict=True)
        ],
        "map": _map(comparison, names, reports),
        "notes": list(comparison.notes),
        "reports": reports,
    }


def _picked(names: list[str], row: Sequence[dict[str, Any]], keys: str) -> list[dict[str, Any]]:
    """Some keys of what the reports have of one thing."""
    return [
        {"vehicle": name, **{key: one[key] for key in keys.split()}}
        for name, one in zip(names, row, strict=True)
    ]


def _map(
    comparison: Comparison, names: list[str], reports: list[dict[str, Any]]
) -> dict[str, Any] | None:
    maps = [one["map"] for one in reports]
    if None in maps:
        return None
    grids = [[one[key] for key in ("resolution_m", "width", "height", "bounds")] for one in maps]
    return {
        "one_grid": all(grid == grids[0] for grid in grids),
        "vehicles": _picked(names, maps, "resolution_m fractions"),
        "together": [
            {"vehicles": list(vehicles), "share": float(f"{share:.12g}")}
            for vehicles, share in together(comparison)
        ],
    }


def as_json(comparison: Comparison) -> str:
    """A comparison as the text of a JSON file."""
    return document.file_text(as_dict(comparison))


def as_geojson(comparison: Comparison) -> str:
    """The routes of all vehicles as the text of a GeoJSON file; each feature names its own."""
    found = []
    for one in comparison.reports:
        for feature in route_features(one.routes):
            own = {"vehicle": one.vehicle.name, **feature["properties"]}
            found.append({**feature, "properties": own})
    return document.geojson_text(comparison.reports[0], found)


def as_svg(comparison: Comparison) -> str:
    """Slip against slope, surface by surface, as the text of an SVG file."""
    sheet = curves.slip_sheet(list(_panels(comparison)), _PANEL)
    return curves.alone(sheet, slip_unknown(comparison) or curves.NO_SURFACE)


def as_markdown(comparison: Comparison) -> str:
    """A comparison as the text of a Markdown file."""
    return rendered_markdown("comparison.md.jinja", **_told(comparison))


def as_page(comparison: Comparison) -> str:
    """A comparison as the text of an HTML file; the same from run to run."""
    pictures = [
        None if one.preview is None else picture_of(one, one.preview) for one in comparison.reports
    ]
    charts = {"panels": panels(comparison), "narrow": panels(comparison, narrow=True)}
    told = {**_told(comparison), **charts, "pictures": pictures}
    return rendered_html("comparison.html.jinja", **told)


def _told(comparison: Comparison) -> dict[str, Any]:
    """What both templates tell."""
    first, *_ = comparison.reports
    ways = range(len(first.routes))
    vehicles = [(vehicle_name(comparison, n), one) for n, one in enumerate(comparison.reports)]
    assumptions = (note for one in comparison.reports for note in one.assumptions)
    return {
        "report": comparison,
        "conclusion": conclusion(comparison),
        "vehicles": vehicles,
        "ways": [(wording.ends(first.routes[n]), way(comparison, n)) for n in ways],
        "reaches": reaches(comparison),
        "surfaces": surfaces(comparison),
        "slopes": slopes(comparison),
        "shares": shares(comparison),
        "together": together_line(comparison),
        "unknown": slip_unknown(comparison),
        "figures": figures(comparison),
        "notes": [*common_notes(comparison), *(f"{a}: {b}" for a, b in own_notes(comparison))],
        "assumptions": list(dict.fromkeys(assumptions)),
    }


FORMATS: dict[str, Callable[[Comparison], str]] = {
    ".json": as_json,
    ".md": as_markdown,
    ".html": as_page,
    ".geojson": as_geojson,
    ".svg": as_svg,
}
"""What makes the text of a comparison's file, by its suffix."""
