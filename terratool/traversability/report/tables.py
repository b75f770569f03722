"""The tables of a report: the same rows for a terminal, for Markdown and for the page."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from terratool.text.display import columns_of, counted, listed, printable
from terratool.traversability.report import wording
from terratool.traversability.results import (
    CHANCE_BOUNDS,
    Figures,
    GroundClass,
    MapSummary,
    Reason,
    Route,
    TraversabilityReport,
    Verdict,
    fraction_of,
)
from terratool.traversability.vehicle import Axle, Vehicle, Wheel

WIDTH = 80
_NAME = 16
"""Columns for names of surfaces; longer ones are cut."""

_SLOPES, _STEEPEST = 5, 45
"""Slopes of which a table has the slip, degrees: so many apart, up to the last."""

_SPACE = re.compile(r"\s+(?!%|J\b|k?Wh\b)")
"""Where a line may be broken; not between a number and its "%", or its unit of energy."""

STEERING = {
    "skid": "left and right wheels against each other",
    "wheels": "wheels turned into their ways",
}
"""How a vehicle turns on the spot, in words."""


class Judged(NamedTuple):
    """A verdict, and what there is to say of it."""

    verdict: Verdict
    text: str

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.verdict.label}, {self.text}"


Cell = str | Verdict | GroundClass | Judged


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


def _by_surface(
    report: TraversabilityReport, *columns: tuple[Column, Callable[[Figures], Cell]]
) -> Table:
    """A row for each surface whose soil is known: its title, and cells made of its figures."""
    rows = (
        (title(figures), *(cell(figures) for _, cell in columns))
        for figures in report.surfaces
        if not figures.missing
    )
    return Table((Column("surface", False), *(column for column, _ in columns)), tuple(rows))


def abilities(report: TraversabilityReport) -> Table:
    """What the vehicle can do on each surface, and what binds."""
    return _by_surface(
        report,
        (Column("on the level", False), lambda f: f.verdict),
        (Column("what binds", False), what_binds),
        (Column("climb"), lambda f: wording.degrees(f.climb)),
        (Column("climb limited by", False), lambda f: wording.because(f.climb_binding)),
        (Column("cross-slope"), lambda f: wording.degrees(f.cross_slope)),
        (Column("cross-slope limited by", False), lambda f: wording.because(f.cross_slope_binding)),
        (Column("step"), lambda f: wording.length(f.step)),
        (Column("step limited by", False), lambda f: wording.step_limit(f, report.vehicle)),
        (Column("gap"), lambda f: wording.length(f.gap)),
        (Column("turning resistance, N m"), lambda f: wording.number(f.turning)),
        (Column("turn by 90°"), wording.quarter_turn),
        (Column("slip in turning"), lambda f: wording.share(f.turning_slip)),
    )


def contact(report: TraversabilityReport) -> Table:
    """What wheel and soil do to each other on each surface."""
    return _by_surface(
        report,
        (Column("load, N"), lambda f: wording.number(f.load)),
        (Column("sinkage, mm"), lambda f: _scaled(f.sinkage, 1e3)),
        (Column("contact, mm"), lambda f: _scaled(f.contact_length, 1e3)),
        (Column("contact, cm²"), lambda f: _scaled(f.contact_area, 1e4)),
        (Column("pressure, kPa"), lambda f: _scaled(f.pressure, 1e-3)),
        (Column("σmax, kPa"), lambda f: _scaled(f.normal_stress, 1e-3)),
        (Column("τmax, kPa"), lambda f: _scaled(f.shear_stress, 1e-3)),
        *(
            (
                (Column("c + σ tan φ, kPa"), lambda f: _scaled(f.strength, 1e-3)),
                (Column("τ of the motor, kPa"), lambda f: _scaled(f.motor_stress, 1e-3)),
            )
            if report.vehicle.model == "paper"
            else ()
        ),
        (Column("torque of these, N m"), lambda f: wording.number(f.limit_torque)),
        (Column("θ1"), lambda f: wording.degrees(f.entry_angle)),
        (Column("thrust, N"), lambda f: wording.number(f.thrust)),
        (Column("resistance, N"), lambda f: wording.number(f.resistance)),
        (Column("drawbar pull, N"), lambda f: wording.number(f.drawbar)),
        (Column("torque on the level, N m"), lambda f: wording.number(f.torque)),
        (Column("strength used"), lambda f: _used(f.utilisation)),
        (Column("slip"), lambda f: wording.share(f.slip)),
    )


def soils(report: TraversabilityReport) -> Table:
    """The soil that each surface was taken for."""
    return _by_surface(
        report,
        (Column("cohesion c, kPa"), lambda f: _scaled(f.cohesion, 1e-3)),
        (Column("friction angle φ"), lambda f: wording.degrees(f.friction)),
        (Column("sinkage k, m/kN"), lambda f: _scaled(f.sinkage_rate, 1e3)),
        (Column("shear modulus K, m"), lambda f: wording.number(f.shear_modulus)),
        (Column("preset", False), lambda f: f.preset or wording.NOTHING),
    )


def slips(report: TraversabilityReport) -> Table:
    """The slip on slopes of 0, 5, 10° and so on, as far as the vehicle climbs."""
    known = [one for one in report.surfaces if one.slip_curve is not None]
    most = max((math.degrees(one.climb) for one in known if one.climb is not None), default=0.0)
    slopes = range(0, min(math.floor(most), _STEEPEST) + 1, _SLOPES)
    columns = (Column("surface", False), *(Column(f"{slope}°") for slope in slopes))
    return Table(
        columns, tuple((title(one), *(_slip_on(one, slope) for slope in slopes)) for one in known)
    )


def _slip_on(figures: Figures, slope: int) -> str:
    """The slip on a slope, degrees; a dash where the vehicle does not climb it."""
    curve, angle = figures.slip_curve, math.radians(slope)
    if curve is None or figures.climb is None or angle > figures.climb:
        return wording.NOTHING
    return wording.share(curve.slip[curve.slope.index(angle)])


def chances(report: TraversabilityReport) -> Table:
    """How likely the vehicle can drive on surfaces of which ranges are known, on the level."""
    columns = (
        Column("surface", False), Column("go"), Column("go or caution"),
        Column("climb, 5 to 95 %"), Column("ranges", False),
    )  # fmt: skip
    if report.sampling is None:
        return Table(columns, ())
    ranges: dict[str, list[str]] = {}
    for surface, key, low, high in report.sampling.ranges:
        text = f"{key} {wording.number(low, 4)} to {wording.number(high, 4)}"
        ranges.setdefault(surface, []).append(text)
    rows = []
    for one in report.surfaces:
        if (found := one.chances) is not None:
            climbs = map(wording.degrees, (found.climb_low, found.climb_high))
            row = wording.share(found.go), wording.share(found.drives), " to ".join(climbs)
            rows.append((title(one), *row, ", ".join(ranges[one.surface])))
    return Table(columns, tuple(rows))


def likelihoods(report: TraversabilityReport) -> Table:
    """How much of the ground is go with which probability, by the best heading."""
    columns = (Column("probability of go", False), Column("share of the ground"))
    summary = report.summary
    if summary is None or summary.chances is None or not summary.pixels:
        return Table(columns, ())
    rows, above = [], 1.0
    for bound in CHANCE_BOUNDS:
        name = f"{wording.share(bound)} to {wording.share(above)}"
        if bound == CHANCE_BOUNDS[-1]:
            name = f"below {wording.share(above)}"
        rows.append((name, wording.share(summary.chances[bound] / summary.pixels)))
        above = bound
    if unknown := summary.pixels - sum(summary.chances.values()):
        rows.append(("not known", wording.share(unknown / summary.pixels)))
    return Table(columns, tuple(rows))


def shares(report: TraversabilityReport) -> Table:
    """How much of the ground is what, by the best and by the worst heading."""
    summary = report.summary
    columns = (Column("ground", False), Column("best heading"), Column("worst heading"))
    rows = (
        (
            ground,
            wording.share(summary.fraction(ground)),
            wording.share(fraction_of(summary.worst_counts, ground)),
        )
        for ground in (grounds_of(summary) if summary else ())
        if summary
    )
    return Table(columns, tuple(rows))


def grounds_of(summary: MapSummary) -> list[GroundClass]:
    """What ground there is to be told of: the verdicts always, the rest if there is any."""
    return [
        ground
        for ground in wording.GROUNDS
        if ground <= GroundClass.NO_GO or summary.fraction(ground)
    ]


def reasons(report: TraversabilityReport) -> Table:
    """What binds where it is not simply go, the most frequent first."""
    columns = (Column("what binds", False), Column("share of the ground"))
    if report.summary is None or not report.summary.pixels:
        return Table(columns, ())
    pixels = report.summary.pixels
    ranked = sorted(report.summary.reasons.items(), key=lambda item: (-item[1], item[0]))
    rows = (
        (wording.because(reason), wording.share(count / pixels))
        for reason, count in ranked
        if count
    )
    return Table(columns, tuple(rows))


def grounds(report: TraversabilityReport) -> Table:
    """How much of each surface's ground is what, by the best heading."""
    if report.summary is None:
        return Table((), ())
    kinds, pixels = grounds_of(report.summary), report.summary.pixels
    columns = (
        Column("surface", False), Column("share of the ground"),
        *(Column(ground.label) for ground in kinds),
    )  # fmt: skip
    rows = (
        (
            printable(name) or "(no surface)",
            wording.share(sum(counts.values()) / pixels),
            *(wording.share(fraction_of(counts, ground)) for ground in kinds),
        )
        for name, counts in report.summary.by_surface.items()
        if sum(counts.values())
    )
    return Table(columns, tuple(rows))


def journey(route: Route) -> Iterator[tuple[str, str]]:
    """What there is to say of a route: titles and texts."""
    yield "from", wording.where(route.start)
    yield "to", wording.where(route.goal)
    if route.note:
        yield "note", route.note
    if not route.found:
        for index, bar in enumerate(route.barriers):
            yield ("cut off by" if index == 0 else "then by"), wording.barrier(bar)
        if route.reached is not None:
            yield "can be reached", wording.where(route.reached)
    for name, text in (
        ("length", wording.length(route.length)),
        ("time", wording.duration(route.time)),
        ("energy", wording.energy(route.energy)),
    ):
        if text != wording.NOTHING:
            part = wording.turning(route) if name == "energy" else ""
            yield name, f"{text}, {part}" if part else text
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
    if route.least_chance is not None and route.chance is not None:
        least = wording.share(route.least_chance.value)
        place = wording.where(route.least_chance.place)
        yield "probability of go", f"{wording.share(route.chance)} for all of it"
        yield "least probability", f"{least} at {place}"
    if route.tightest is not None:
        yield "least margin", wording.margin(route.tightest)
    for index, bar in enumerate(route.against):
        yield ("one-way" if index == 0 else "and"), f"no way back by {wording.barrier(bar)}"
    if route.one_way and not route.against:
        yield "one-way", "it cannot be driven back the same way"
    if looked := wording.looked_with(route):
        yield "headings", looked
    if route.back is not None:
        yield "way back", wording.route_line(route.back)


def properties(vehicle: Vehicle) -> Table:
    """The vehicle's figures."""
    rows = tuple((name, text) for name, text in _properties(vehicle) if text)
    return Table((Column("figure", False), Column("value", False)), rows)


def _properties(vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    wheel, margins, limits = vehicle.wheel, vehicle.margins, vehicle.thresholds
    yield "model", vehicle.model
    yield "wheel", _sizes(wheel)
    yield "largest torque of a wheel", wording.quantity(wheel.max_torque, "N m")
    yield "largest slip", wording.share(wheel.max_slip)
    if not vehicle.is_single:
        yield "steering", STEERING[vehicle.steering]
    if vehicle.is_single:
        yield "load", wording.quantity(vehicle.weight, "N")
    else:
        yield "mass", wording.quantity(vehicle.mass, "kg")
        gravity = wording.quantity(vehicle.gravity, "m/s²")
        yield "weight", f"{wording.quantity(vehicle.weight, 'N')} at {gravity}"
        yield "axles", "; ".join(map(_axle, vehicle.axles))
        yield "wheelbase", wording.length(vehicle.wheelbase)
        yield "track", wording.length(vehicle.track_width)
        yield "height of the centre of gravity", wording.length(vehicle.cog_height)
        yield "clearance", wording.length(vehicle.clearance)
        yield "width of the body", wording.length(vehicle.body_width) if vehicle.body_width else ""
        for name, end in (("front overhang", vehicle.front), ("rear overhang", vehicle.rear)):
            if end.length > 0 and math.isfinite(end.height):
                yield name, f"{wording.length(end.length)}, {wording.length(end.height)} high"
    yield "speed", wording.quantity(vehicle.speed, "m/s")
    yield "power drawn all the time", wording.quantity(vehicle.power, "W") if vehicle.power else ""
    kept = (
        ("clearance", margins.clearance, wording.length), ("step", margins.step, wording.length),
        ("tip-over", margins.tip, wording.degrees), ("slope", margins.slope, wording.degrees),
    )  # fmt: skip
    reserve = ", ".join(f"{name} {words(value)}" for name, value, words in kept if value)
    yield "kept in reserve", reserve
    go = f"{wording.share(limits.utilisation)} of the soil’s strength, slip "
    go += f"{wording.share(limits.slip)}, {wording.share(limits.torque)} of the torque, "
    yield "go up to", f"{go}{wording.share(limits.geometry)} of a limit of shape"
    caution = f"all of the soil’s strength, slip {wording.share(limits.caution_slip)}, all of the "
    yield "caution up to", f"{caution}torque, all of a limit of shape"


def title(figures: Figures) -> str:
    """The name of a surface as a table shows it."""
    return printable(figures.surface) or "(no surface)"


def what_binds(figures: Figures) -> str:
    """What binds on the level, or what is missing."""
    if figures.missing:
        return f"lacks {', '.join(figures.missing)}"
    return wording.because(figures.reason)


def _axle(axle: Axle) -> str:
    wheels = counted(axle.wheels, "driven wheel" if axle.driven else "towed wheel")
    own = ""
    if axle.wheel is not None:
        own = f", of {_sizes(axle.wheel)}"
        if axle.driven and math.isfinite(axle.wheel.max_torque):
            own += f", at most {wording.quantity(axle.wheel.max_torque, 'N m')}"
    return f"{wheels} {_ahead(axle.x)}{own}"


def _sizes(wheel: Wheel) -> str:
    """Radius and width, and what makes it more than a smooth rigid rim."""
    line = f"radius {wording.length(wheel.radius)}, width {wording.length(wheel.width)}"
    if wheel.grouser_height > 0.0:
        line += f", lugs of {wording.length(wheel.grouser_height)}"
    if math.isfinite(wheel.patch_pressure):
        line += f", {wording.quantity(wheel.patch_pressure / 1e3, 'kPa')} on hard ground"
    if wheel.contact_length > 0.0:
        line += f", a contact of {wording.length(wheel.contact_length)} or more"
    return line


def _ahead(x: float) -> str:
    if x == 0.0:
        return "at the centre of gravity"
    return f"{wording.length(abs(x))} {'ahead' if x > 0 else 'behind'}"


def _scaled(value: float | None, factor: float) -> str:
    return wording.number(None if value is None else value * factor)


def _used(value: float | None) -> str:
    return "all" if value is not None and value >= 1.0 else wording.share(value)


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
    yield from wrapped(f"{report.verdict.label}: {printable(wording.conclusion(report))}", "")
    for route in report.routes:
        line = printable(wording.route_line(route))
        if line not in printable(wording.conclusion(report)):
            yield from wrapped(f"{route.verdict.label}: {line}")
    if report.reach and (line := wording.reach_line(report.reach)) != wording.conclusion(report):
        yield from wrapped(printable(line))
    yield from mending_lines(report)
    yield ""
    if any(not figures.missing for figures in report.surfaces):
        yield from aligned(_surfaces(report))
        yield from wrapped(_step_limits(report))
        yield from wrapped(_turns(report))
        yield ""
    if (table := chances(report)).rows:
        titles = [column.title for column in table.columns]
        yield from aligned(iter([titles, *map(_texts, table.rows)]))
        yield ""
    if report.summary:
        yield from aligned(_map(report.summary))
        if likely := ", ".join(f"{name} on {part}" for name, part in likelihoods(report).rows):
            yield from wrapped(f"Probability of go: {likely}")
        if binding := ", ".join(f"{reason} {part}" for reason, part in reasons(report).rows[:5]):
            yield from wrapped(f"What binds: {binding}")
        if (counted := wording.counted_from(report)) not in wording.conclusion(report):
            yield from wrapped(counted)
        yield ""
    for name, warning in warnings(report):
        yield from wrapped(f"{cut(name, _NAME)}: {warning}")
    for note in report.notes:
        yield from wrapped(printable(note))


def mending_lines(report: TraversabilityReport) -> Iterator[str]:
    """Which surfaces lack what of a soil, and the lines of JSON that mend it."""
    mends = list(wording.mending(report))
    if mends:
        lacks = wording.lacking(report)
        if lacks not in wording.conclusion(report):
            yield from wrapped(printable(lacks))
        yield "Give them a soil, for example this one; docs/format.md has others:"
        for place, line in mends:
            yield f"  {printable(line)}"
            yield f"    {printable(place)}"


def _texts(row: Sequence[Cell]) -> list[str]:
    """A row of names and numbers as a terminal shows it."""
    return [cut(str(row[0]), _NAME), *map(str, row[1:])]


def _surfaces(report: TraversabilityReport) -> Iterator[Sequence[str]]:
    yield "surface", "sinkage", "climb", "across", "step", "pull", "level", "what binds"
    for figures in report.surfaces:
        if figures.missing:
            continue
        yield (
            cut(title(figures), _NAME),
            wording.length(figures.sinkage),
            wording.degrees(figures.climb),
            wording.degrees(figures.cross_slope),
            wording.length(figures.step),
            wording.quantity(figures.drawbar, "N"),
            figures.verdict.label,
            what_binds(figures),
        )


def _step_limits(report: TraversabilityReport) -> str:
    """What limits steps on which surfaces, in a sentence."""
    by_limit: dict[str, list[str]] = {}
    for figures in report.surfaces:
        if not figures.missing:
            limit = wording.step_limit(figures, report.vehicle)
            by_limit.setdefault(limit, []).append(cut(title(figures), _NAME))
    by_limit.pop(wording.NOTHING, None)
    if len(by_limit) == 1:
        return f"Steps are limited by {next(iter(by_limit))}."
    parts = [f"{limit} ({', '.join(surfaces)})" for limit, surfaces in by_limit.items()]
    return f"Steps are limited by {listed(parts)}." if parts else ""


def _turns(report: TraversabilityReport) -> str:
    """What turning on the spot takes on which surfaces, in a sentence; empty for nothing."""
    by_work: dict[str, list[str]] = {}
    for figures in report.surfaces:
        if figures.turning_work or figures.turning_binding != Reason.NONE:
            work = wording.quarter_turn(figures)
            by_work.setdefault(work, []).append(cut(title(figures), _NAME))
    parts = [f"{', '.join(surfaces)} {work}" for work, surfaces in by_work.items()]
    return f"Work of a turn on the spot by 90°: {'; '.join(parts)}." if parts else ""


def _map(summary: MapSummary) -> Iterator[Sequence[str]]:
    kinds = grounds_of(summary)
    yield "ground", *(ground.label for ground in kinds), ""
    for heading, counts in (
        ("best heading", summary.counts),
        ("worst heading", summary.worst_counts),
    ):
        yield heading, *(wording.share(fraction_of(counts, ground)) for ground in kinds), ""


def cut(text: str, columns: int) -> str:
    """A text that takes at most so many columns of a terminal."""
    if columns_in(text) <= columns:
        return text
    kept, room = "", columns - 1
    for char in text:
        room -= columns_of(char)
        if room < 0:
            break
        kept += char
    return f"{kept.rstrip()}…"


def aligned(rows: Iterator[Sequence[str]], left: bool = False) -> Iterator[str]:
    """Rows in columns: the first and the last, and verdicts, flush left, the others right.

    With `left` all are flush left. The last column gets what the others leave, and goes on below
    where that is not enough.
    """
    cells = [list(row) for row in rows]
    widths = [max(columns_in(row[i]) for row in cells) for i in range(len(cells[0]))]
    widths[-1] = WIDTH - sum(widths[:-1]) - 2 * (len(widths) - 1)
    labels = {verdict.label for verdict in Verdict}
    indent = " " * (WIDTH - widths[-1])
    for row in cells:
        row[-1], *below = wrapped(row[-1], "", widths[-1]) if row[-1] else [""]
        parts = []
        for index, (whole, width) in enumerate(zip(row, widths, strict=True)):
            text = cut(whole, width)
            room = " " * (width - columns_in(text))
            first = left or index in (0, len(row) - 1) or cells[1][index] in labels
            parts.append(text + room if first else room + text)
        yield "  ".join(parts).rstrip()
        for text in below:
            yield f"{indent}{cut(text, widths[-1])}"


def columns_in(text: str) -> int:
    """Columns that a text takes of a terminal."""
    return sum(map(columns_of, text))


def wrapped(text: str, indent: str = "  ", width: int = WIDTH) -> Iterator[str]:
    """Lines of words; the module `textwrap` does not know that some letters take two columns."""
    line = ""
    for word in _SPACE.split(text.strip()):
        longer = f"{line} {word}" if line else word
        if line and columns_in(longer) > width:
            yield line
            longer = indent + word
        line = longer
    if line:
        yield line
