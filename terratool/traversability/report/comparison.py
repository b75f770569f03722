"""Comparison of several vehicles in reports: a conclusion, tables, shares of ground, notes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from terratool.report import numbers
from terratool.report.tables import Cell, Column, Judged, Table
from terratool.report.wording import count_of, join_words
from terratool.text.display import printable
from terratool.traversability.figures import Figures
from terratool.traversability.map_results import fraction_of
from terratool.traversability.report import wording
from terratool.traversability.report.tables import grounds_of, title, what_binds
from terratool.traversability.report.wording import vehicle_name
from terratool.traversability.results import Reports, TraversabilityReport, VehicleComparison
from terratool.traversability.route.results import Route
from terratool.traversability.verdicts import GroundClass, Verdict


class Together(NamedTuple):
    """Ground that is go or caution for exactly these vehicles.

    Attributes:
        vehicles: names of the vehicles; none where the ground is so for no vehicle.
        share: share of all ground, from 0 to 1.
    """

    vehicles: tuple[str, ...]
    share: float


def conclusion(found: VehicleComparison) -> str:
    """Sentence on which of the vehicles can drive there."""
    able: list[str] = []
    cannot: list[str] = []
    unknown: list[str] = []
    for one in found.reports:
        if one.drives:
            able.append(f"{vehicle_name(one)} ({one.verdict.label})")
        else:
            kind = unknown if one.verdict == Verdict.UNKNOWN else cannot
            kind.append(vehicle_name(one))
    count = count_of(len(found.reports), "vehicle")
    if able:
        number = "All" if not cannot and not unknown else str(len(able))
        parts = [f"{number} of {count} can drive there: {join_words(able)}"]
    else:
        parts = [f"None of {count} {'is known to' if unknown else 'can'} drive there"]
    if cannot:
        parts.append(f"{join_words(cannot)} cannot")
    if unknown:
        parts.append(f"of {join_words(unknown)} it is not known")
    return f"{'; '.join(parts)}."


def surfaces(found: VehicleComparison) -> Table:
    """Table of surfaces: for each vehicle, verdict on the level, largest climb and its limit."""
    rows: list[tuple[Cell, ...]] = [
        (title(row[0]), *(Judged(one.verdict, _ability(one)) for one in row))
        for row in zip(*(one.surfaces for one in found.reports), strict=True)
    ]
    return Table(_columns(found, "surface"), tuple(rows))


def _ability(figures: Figures) -> str:
    if figures.missing or figures.climb is None:
        return what_binds(figures)
    return f"{wording.climb(figures)}, {wording.because(figures.climb_binding)}"


def way(found: VehicleComparison, number: int) -> Table:
    """Table of vehicles on one of the routes that were asked for, by its index."""
    columns = (
        Column("vehicle", False), Column("verdict", False), Column("length"), Column("time"),
        Column("energy"), Column("least margin"), Column("binds or bars", False),
    )  # fmt: skip
    rows = ((vehicle_name(one), *_journey(one.routes[number])) for one in found.reports)
    return Table(columns, tuple(rows))


def _journey(route: Route) -> tuple[Cell, ...]:
    margin, binds = route.tightest, numbers.NOTHING
    if route.barriers:
        more = len(route.barriers) - 1
        binds = wording.because(route.barriers[0].reason)
        binds += f" (and {count_of(more, 'more place')})" * bool(more)
    elif route.charge is not None and route.charge.verdict == Verdict.NO_GO:
        binds = "battery"
    elif margin is not None:
        binds = wording.because(margin.reason)
    return (
        route.verdict,
        numbers.length(route.length),
        numbers.duration(route.time),
        numbers.energy(route.energy),
        numbers.NOTHING if margin is None else numbers.share(max(margin.value, 0.0)),
        binds,
    )


def reaches(reports: Reports) -> list[tuple[str, str]]:
    """Names of vehicles, each with a sentence on its reach; none where reach was not asked for."""
    return [
        (vehicle_name(one), wording.reach_line(one.reach))
        for one in reports.reports
        if one.reach is not None
    ]


def shares(found: VehicleComparison) -> Table:
    """Table of the shares of ground in each class for each vehicle, by the best heading."""
    summaries = [one.summary for one in found.reports if one.summary is not None]
    if len(summaries) < len(found.reports):
        return Table((), ())
    kinds = [
        ground for ground in wording.GROUNDS if any(ground in grounds_of(one) for one in summaries)
    ]
    rows: list[tuple[Cell, ...]] = [
        (ground, *(numbers.share(fraction_of(one.counts, ground)) for one in summaries))
        for ground in kinds
    ]
    return Table(_columns(found, "ground", True), tuple(rows))


def together(found: VehicleComparison) -> list[Together]:
    """Shares of ground that is go or caution for the same vehicles, the largest first.

    The pixels of the pictures are counted that are at the edge for none of the vehicles; none if
    there are no pictures, or their grids differ.
    """
    previews = [one.preview for one in found.reports if one.preview is not None]
    if len(previews) < len(found.reports) or len({one.grid for one in previews}) > 1:
        return []
    classes = np.stack([one.ground for one in previews], axis=-1)
    able = (classes == GroundClass.GO) | (classes == GroundClass.CAUTION)
    counted = np.isfinite(previews[0].heights) & (classes != GroundClass.EDGE).all(axis=-1)
    kinds, count = np.unique(able[counted], axis=0, return_counts=True)
    names = [one.vehicle.name for one in found.reports]
    shares = [
        Together(tuple(name for name, can in zip(names, kind, strict=True) if can), float(share))
        for kind, share in zip(kinds.tolist(), count / max(count.sum(), 1), strict=True)
    ]
    return sorted(shares, key=lambda one: -one.share)


def together_line(found: VehicleComparison) -> str:
    """Sentence on the shares of `together`; empty if there are none."""
    parts = []
    for vehicles, share in together(found):
        who = join_words([*map(printable, vehicles)])
        if not vehicles:
            who = "none"
        elif len(vehicles) == len(found.reports):
            who = "all"
        elif len(vehicles) == 1:
            who = f"{who} alone"
        parts.append(f"{who} {numbers.share(share)}")
    return f"Go or caution, of the ground: {', '.join(parts)}." if parts else ""


def _columns(found: VehicleComparison, first: str, numeric: bool = False) -> tuple[Column, ...]:
    names = map(vehicle_name, found.reports)
    return (Column(first, False), *(Column(name, numeric) for name in names))


def notes(reports: Reports) -> list[str]:
    """Sentences on how all results were computed, then those on one vehicle, with its name."""
    on_grids = reports.notes if isinstance(reports, VehicleComparison) else ()
    return [*on_grids, *merge_sentences(reports, lambda one: one.notes)]


def merge_sentences(
    reports: Reports, sentences: Callable[[TraversabilityReport], Iterable[str]]
) -> list[str]:
    """Sentences that hold for all vehicles, then those for one, with the vehicle's name."""
    each = [list(sentences(one)) for one in reports.reports]
    same = [one for one in each[0] if all(one in others for others in each)]
    own = (
        f"{vehicle_name(report)}: {one}"
        for report, found in zip(reports.reports, each, strict=True)
        for one in found
        if one not in same
    )
    return [*same, *own]
