"""The tables of a report: the same rows for a terminal, for Markdown and for the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from terratool.text.display import columns_of, printable
from terratool.traversability.report import wording
from terratool.traversability.results import Figures, Route, TraversabilityReport, Verdict
from terratool.traversability.vehicle import Axle, Vehicle

WIDTH = 80
_NAME = 16
"""Columns for names of surfaces; longer ones are cut."""

Cell = str | Verdict


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its title, and whether it holds numbers."""

    title: str
    numeric: bool = True


@dataclass(frozen=True, slots=True)
class Table:
    """A table: each row begins with what it is about."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


def abilities(report: TraversabilityReport) -> Table:
    """What the vehicle can do on each surface, and what binds."""
    columns = (
        Column("surface", False), Column("on the level", False), Column("what binds", False),
        Column("climb"), Column("climb limited by", False),
        Column("cross-slope"), Column("cross-slope limited by", False),
        Column("step"), Column("step limited by", False), Column("gap"),
    )  # fmt: skip
    rows = (
        (
            title(figures), figures.verdict, what_binds(figures),
            wording.degrees(figures.climb), wording.because(figures.climb_binding),
            wording.degrees(figures.cross_slope), wording.because(figures.cross_slope_binding),
            wording.length(figures.step), figures.step_binding or wording.NOTHING,
            wording.length(figures.gap),
        )
        for figures in report.surfaces
    )  # fmt: skip
    return Table(columns, tuple(rows))


def contact(report: TraversabilityReport) -> Table:
    """What wheel and soil do to each other on each surface."""
    columns = (
        Column("surface", False), Column("load, N"), Column("sinkage, mm"),
        Column("contact, mm"), Column("contact, cm²"), Column("pressure, kPa"),
        Column("σmax, kPa"), Column("τmax, kPa"), Column("thrust, N"), Column("resistance, N"),
        Column("drawbar pull, N"), Column("torque, N m"), Column("strength used"), Column("slip"),
    )  # fmt: skip
    rows = (
        (
            title(figures),
            wording.number(figures.load),
            _scaled(figures.sinkage, 1e3),
            _scaled(figures.contact_length, 1e3),
            _scaled(figures.contact_area, 1e4),
            _scaled(figures.pressure, 1e-3),
            _scaled(figures.normal_stress, 1e-3),
            _scaled(figures.shear_stress, 1e-3),
            wording.number(figures.thrust),
            wording.number(figures.resistance),
            wording.number(figures.drawbar),
            wording.number(figures.torque),
            _used(figures.utilisation),
            wording.share(figures.slip),
        )
        for figures in report.surfaces
    )
    return Table(columns, tuple(rows))


def soils(report: TraversabilityReport) -> Table:
    """The soil that each surface was taken for."""
    columns = (
        Column("surface", False), Column("cohesion c, kPa"), Column("friction angle φ"),
        Column("sinkage k, m/kN"), Column("shear modulus K, m"), Column("preset", False),
    )  # fmt: skip
    rows = (
        (
            title(figures),
            _scaled(figures.cohesion, 1e-3),
            wording.degrees(figures.friction),
            _scaled(figures.sinkage_rate, 1e3),
            wording.number(figures.shear_modulus),
            figures.preset or wording.NOTHING,
        )
        for figures in report.surfaces
    )
    return Table(columns, tuple(rows))


def shares(report: TraversabilityReport) -> Table:
    """How much of the ground is what, by the best and by the worst heading."""
    summary = report.summary
    columns = (Column("verdict", False), Column("best heading"), Column("worst heading"))
    rows = (
        (
            verdict,
            wording.share(summary.fraction(verdict)),
            wording.share(_fraction(summary.worst_counts, verdict)),
        )
        for verdict in wording.VERDICTS
    )
    return Table(columns, tuple(rows))


def reasons(report: TraversabilityReport) -> Table:
    """What binds where it is not simply go, the most frequent first."""
    pixels = report.summary.pixels
    ranked = sorted(report.summary.reasons.items(), key=lambda item: (-item[1], item[0]))
    rows = (
        (wording.because(reason), wording.share(count / pixels))
        for reason, count in ranked
        if count and pixels
    )
    return Table((Column("what binds", False), Column("share of the ground")), tuple(rows))


def grounds(report: TraversabilityReport) -> Table:
    """How much of each surface's ground is what, by the best heading."""
    columns = (
        Column("surface", False), Column("share of the ground"),
        *(Column(verdict.label) for verdict in wording.VERDICTS),
    )  # fmt: skip
    pixels = report.summary.pixels
    rows = (
        (
            printable(name) or "(no surface)",
            wording.share(sum(counts.values()) / pixels),
            *(wording.share(_fraction(counts, verdict)) for verdict in wording.VERDICTS),
        )
        for name, counts in report.summary.by_surface.items()
        if sum(counts.values())
    )
    return Table(columns, tuple(rows))


def journey(route: Route) -> tuple[tuple[str, str], ...]:
    """What there is to say of a route: titles and texts."""
    return tuple(_journey(route))


def _journey(route: Route) -> Iterator[tuple[str, str]]:
    yield "from", wording.where(route.start)
    yield "to", wording.where(route.goal)
    if route.note:
        yield "note", route.note
    if not route.found:
        for index, bar in enumerate(route.barriers):
            yield ("cut off by" if index == 0 else "then by"), wording.barrier(bar)
        if route.reached is not None:
            yield "can be reached", wording.where(route.reached)
    for title_, text in (
        ("length", wording.length(route.length)),
        ("time", wording.duration(route.time)),
        ("energy", wording.energy(route.energy)),
    ):
        if text != wording.NOTHING:
            yield title_, text
    if route.steepest is not None:
        pitch = route.steepest.value
        way = (" up" if pitch > 0 else " down") if pitch else ""
        slope = f"{wording.degrees(abs(pitch))}{way}"
        yield "steepest", f"{slope} at {wording.where(route.steepest.place)}"
    if route.softest is not None:
        sunk = wording.length(route.softest.value)
        yield "softest", f"{sunk} of sinkage at {wording.where(route.softest.place)}"
    if caution := wording.careful(route):
        yield "caution", f"on {caution}"
    if route.tightest is not None:
        yield "least margin", wording.margin(route.tightest)


def properties(vehicle: Vehicle) -> Table:
    """The vehicle's figures."""
    rows = tuple((title_, text) for title_, text in _properties(vehicle) if text)
    return Table((Column("figure", False), Column("value", False)), rows)


def _properties(vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    wheel, margins, limits = vehicle.wheel, vehicle.margins, vehicle.thresholds
    yield "wheel", f"radius {wording.length(wheel.radius)}, width {wording.length(wheel.width)}"
    torque = "no limit" if math.isinf(wheel.max_torque) else wording.quantity(
        wheel.max_torque, "N m"
    )  # fmt: skip
    yield "largest torque of a wheel", torque
    yield "largest slip", wording.share(wheel.max_slip)
    if vehicle.is_single:
        yield "load", wording.quantity(vehicle.weight, "N")
    else:
        yield "mass", wording.quantity(vehicle.mass, "kg")
        gravity = wording.quantity(vehicle.gravity, "m/s²")
        yield "weight", f"{wording.quantity(vehicle.weight, 'N')} at {gravity}"
        yield "axles", "; ".join(map(_axle, vehicle.axles))
        yield "wheelbase", wording.length(vehicle.wheelbase)
        yield "track", wording.length(vehicle.track)
        yield "height of the centre of gravity", wording.length(vehicle.cog_height)
        yield "clearance", wording.length(vehicle.clearance)
        yield "width of the body", wording.length(vehicle.body_width) if vehicle.body_width else ""
        for title_, end in (("front overhang", vehicle.front), ("rear overhang", vehicle.rear)):
            if end.length > 0 and math.isfinite(end.height):
                yield title_, f"{wording.length(end.length)}, {wording.length(end.height)} high"
    yield "speed", wording.quantity(vehicle.speed, "m/s")
    yield "power drawn all the time", wording.quantity(vehicle.power, "W") if vehicle.power else ""
    kept = (
        (margins.clearance, "clearance " + wording.length(margins.clearance)),
        (margins.step, "step " + wording.length(margins.step)),
        (margins.tip, "tip-over " + wording.degrees(margins.tip)),
        (margins.slope, "slope " + wording.degrees(margins.slope)),
    )
    yield "kept in reserve", ", ".join(text for value, text in kept if value)
    yield (
        "go up to",
        (
            f"{wording.share(limits.utilisation)} of the soil’s strength, slip "
            f"{wording.share(limits.slip)}, {wording.share(limits.torque)} of the torque, "
            f"{wording.share(limits.geometry)} of a limit of shape"
        ),
    )
    yield (
        "caution up to",
        (
            f"all of the soil’s strength, slip {wording.share(limits.caution_slip)}, all of the "
            "torque, all of a limit of shape"
        ),
    )


def title(figures: Figures) -> str:
    """The name of a surface as a table shows it."""
    return printable(figures.surface) or "(no surface)"


def what_binds(figures: Figures) -> str:
    """What binds on the level, or what is missing."""
    if figures.missing:
        return f"lacks {', '.join(figures.missing)}"
    return wording.because(figures.reason)


def _axle(axle: Axle) -> str:
    kind = "driven" if axle.driven else "towed"
    return f"{axle.wheels} {kind} wheel{'s' * (axle.wheels > 1)} {_ahead(axle.x)}"


def _ahead(x: float) -> str:
    if x == 0.0:
        return "at the centre of gravity"
    return f"{wording.length(abs(x))} {'ahead' if x > 0 else 'behind'}"


def _scaled(value: float | None, factor: float) -> str:
    return wording.number(None if value is None else value * factor)


def _used(value: float | None) -> str:
    return "all" if value is not None and value >= 1.0 else wording.share(value)


def _fraction(counts: dict[Verdict, int], verdict: Verdict) -> float:
    total = sum(counts.values())
    return counts.get(verdict, 0) / total if total else 0.0


def warnings(report: TraversabilityReport) -> tuple[tuple[str, str], ...]:
    """What is doubtful about surfaces: the name of each, and a sentence."""
    return tuple(
        (title(figures), printable(warning))
        for figures in report.surfaces
        for warning in figures.warnings
    )


def as_lines(report: TraversabilityReport) -> Iterator[str]:
    """A report in lines of at most 80 columns.

    What cannot be broken, as a JSON pointer, may be longer.
    """
    yield from _wrapped(f"{report.verdict.label}: {printable(wording.conclusion(report))}", "")
    for route in report.routes:
        line = printable(wording.route_line(route))
        if line not in printable(wording.conclusion(report)):
            yield from _wrapped(f"{route.verdict.label}: {line}")
    if report.reach:
        yield from _wrapped(printable(wording.reach_line(report.reach)))
    yield ""
    if report.surfaces:
        yield from _aligned(_surfaces(report))
        yield ""
    yield from _aligned(_map(report))
    yield ""
    for name, warning in warnings(report):
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
            what_binds(figures),
        )


def _map(report: TraversabilityReport) -> Iterator[Sequence[str]]:
    summary = report.summary
    yield "ground", *(verdict.label for verdict in wording.VERDICTS), "what binds"
    ranked = reasons(report).rows
    binding = ", ".join(f"{reason} {part}" for reason, part in ranked[:2])
    for title, counts, why in (
        ("best heading", summary.counts, binding),
        ("worst heading", summary.worst_counts, ""),
    ):
        total = sum(counts.values())
        parts = (counts.get(verdict, 0) / total if total else 0.0 for verdict in wording.VERDICTS)
        yield title, *map(wording.share, parts), why


def _title(figures: Figures) -> str:
    return cut(title(figures), _NAME)


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
