"""Tables of a report, with equal rows for a terminal, Markdown and the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from terratool.report import numbers
from terratool.report.tables import Cell, Column, Table
from terratool.report.wording import count_of
from terratool.text.display import printable
from terratool.traversability.figures import Figures
from terratool.traversability.map_results import CHANCE_BOUNDS, MapSummary, fraction_of
from terratool.traversability.report import wording
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Route
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.verdicts import GroundClass

_SLOPES, _STEEPEST = 5, 45
"""Step and largest of the slopes in the table of slips, degrees."""

STEERING = {
    "skid": "left and right wheels against each other",
    "wheels": "wheels turned into their ways",
}
"""Phrases on turning on the spot, by the kind of steering."""


def _by_surface(
    report: TraversabilityReport, *columns: tuple[Column, Callable[[Figures], Cell]]
) -> Table:
    """Rows for the surfaces whose soil is known: a title, and cells made of the figures."""
    rows = (
        (title(figures), *(cell(figures) for _, cell in columns))
        for figures in report.surfaces
        if not figures.missing
    )
    return Table((Column("surface", False), *(column for column, _ in columns)), tuple(rows))


def _without_empty(table: Table) -> Table:
    """The table without columns in which all cells are dashes, such as what is a wheel's alone."""
    kept = [
        number
        for number in range(len(table.columns))
        if not table.rows or any(row[number] != numbers.NOTHING for row in table.rows)
    ]
    return Table(
        tuple(table.columns[number] for number in kept),
        tuple(tuple(row[number] for number in kept) for row in table.rows),
    )


def abilities(report: TraversabilityReport) -> Table:
    """Table of abilities on each surface, with the measures that bind."""
    return _by_surface(
        report,
        (Column("on the level", False), lambda f: f.verdict),
        (Column("what binds", False), what_binds),
        (Column("climb"), wording.climb),
        (Column("climb limited by", False), lambda f: wording.because(f.climb_binding)),
        (Column("cross-slope"), lambda f: numbers.degrees(f.cross_slope)),
        (Column("cross-slope limited by", False), lambda f: wording.because(f.cross_slope_binding)),
        (Column("step"), lambda f: numbers.length(f.step)),
        (Column("step limited by", False), lambda f: wording.step_limit(f, report.vehicle)),
        (Column("gap"), lambda f: numbers.length(f.gap)),
        (Column("turning resistance, N m"), lambda f: numbers.number(f.turning)),
        (Column("turn by 90°"), wording.quarter_turn),
        (Column("slip in turning"), lambda f: numbers.share(f.turning_slip)),
    )


def operations(report: TraversabilityReport) -> Table:
    """Table of energy, ranges and stopping on the level of each surface."""
    vehicle = report.vehicle
    ranged = (Column("range on a charge"), lambda f: numbers.length(f.driving_range))
    slowed = (Column("speed to stop in time, m/s"), lambda f: numbers.number(f.speed_limit))
    return _by_surface(
        report,
        (Column("rolling resistance"), lambda f: numbers.number(f.rolling)),
        (Column("energy, Wh/km"), lambda f: _scaled_text(f.energy, 1.0 / 3.6)),
        *((ranged,) if vehicle.battery else ()),
        (Column("braking"), lambda f: numbers.number(f.braking)),
        (Column("stops within"), lambda f: wording.stop(f.stopping)),
        *((slowed,) if math.isfinite(vehicle.stopping_distance) else ()),
    )


def loads(report: TraversabilityReport) -> Table:
    """Table of what the vehicle can do on each surface with the worst and the best of its loads."""
    columns = (
        Column("surface", False), Column("climb"), Column("across"), Column("step"),
        Column("least with", False),
    )  # fmt: skip
    rows = []
    for figures in report.surfaces:
        if (found := figures.loads) is not None:
            spans = (
                (found.climb, numbers.degrees), (found.cross_slope, numbers.degrees),
                (found.step, numbers.length),
            )  # fmt: skip
            texts = (" to ".join(map(words, span)) for span, words in spans)
            rows.append((title(figures), *texts, wording.load(found.load)))
    return Table(columns, tuple(rows))


def contact(report: TraversabilityReport) -> Table:
    """Table of stresses and forces between wheel and soil on each surface."""
    table = _by_surface(
        report,
        (Column("load, N"), lambda f: numbers.number(f.load)),
        (Column("sinkage, mm"), lambda f: _scaled_text(f.sinkage, 1e3)),
        (Column("contact, mm"), lambda f: _scaled_text(f.contact_length, 1e3)),
        (Column("contact, cm²"), lambda f: _scaled_text(f.contact_area, 1e4)),
        (Column("pressure, kPa"), lambda f: _scaled_text(f.pressure, 1e-3)),
        (Column("σmax, kPa"), lambda f: _scaled_text(f.normal_stress, 1e-3)),
        (Column("τmax, kPa"), lambda f: _scaled_text(f.shear_stress, 1e-3)),
        *(
            (
                (Column("c + σ tan φ, kPa"), lambda f: _scaled_text(f.strength, 1e-3)),
                (Column("τ of the motor, kPa"), lambda f: _scaled_text(f.motor_stress, 1e-3)),
            )
            if report.vehicle.model == "paper"
            else ()
        ),
        (Column("torque of these, N m"), lambda f: numbers.number(f.limit_torque)),
        (Column("θ1"), lambda f: numbers.degrees(f.entry_angle)),
        (Column("thrust, N"), lambda f: numbers.number(f.thrust)),
        (Column("resistance, N"), lambda f: numbers.number(f.resistance)),
        (Column("drawbar pull, N"), lambda f: numbers.number(f.drawbar)),
        *(
            (
                (Column("bears, N"), lambda f: numbers.number(f.bearing)),
                (Column("stands, mm deep"), lambda f: _scaled_text(f.borne_at, 1e3)),
            )
            if report.vehicle.feet
            else ()
        ),
        (Column("torque on the level, N m"), lambda f: numbers.number(f.torque)),
        (Column("strength used"), lambda f: _used_share(f.utilisation)),
        (Column("slip"), lambda f: numbers.share(f.slip)),
    )
    return _without_empty(table)


def soils(report: TraversabilityReport) -> Table:
    """Table of the soil of each surface."""
    return _by_surface(
        report,
        (Column("cohesion c, kPa"), lambda f: _scaled_text(f.cohesion, 1e-3)),
        (Column("friction angle φ"), lambda f: numbers.degrees(f.friction)),
        (Column("sinkage k, m/kN"), lambda f: _scaled_text(f.sinkage_rate, 1e3)),
        (Column("shear modulus K, m"), lambda f: numbers.number(f.shear_modulus)),
        (Column("preset", False), lambda f: f.preset or numbers.NOTHING),
    )


def slips(report: TraversabilityReport) -> Table:
    """Table of the slip on slopes of 0, 5, 10° and so on, as far as the vehicle climbs."""
    known = [one for one in report.surfaces if one.slip_curve is not None]
    most = max((math.degrees(one.climb) for one in known if one.climb is not None), default=0.0)
    slopes = range(0, min(math.floor(most), _STEEPEST) + 1, _SLOPES)
    columns = (Column("surface", False), *(Column(f"{slope}°") for slope in slopes))
    return Table(
        columns, tuple((title(one), *(_slip_on(one, slope) for slope in slopes)) for one in known)
    )


def drifts(report: TraversabilityReport) -> Table:
    """Table of the crab angle on side slopes of 5, 10° and so on, as far as the vehicle crosses."""
    known = [(title(one), one.drift_curve) for one in report.surfaces if one.drift_curve]
    slopes = max((curve.slope for _, curve in known), key=len, default=())
    columns = (Column("surface", False), *(Column(f"{math.degrees(one):.0f}°") for one in slopes))
    rows = []
    for name, curve in known:
        beyond = [numbers.NOTHING] * (len(slopes) - len(curve.slope))
        rows.append((name, *map(numbers.degrees, curve.crab), *beyond))
    return Table(columns, tuple(rows))


def _slip_on(figures: Figures, slope: int) -> str:
    """Text of the slip on a slope, degrees; a dash where the vehicle does not climb the slope."""
    curve, angle = figures.slip_curve, math.radians(slope)
    if curve is None or figures.climb is None or angle > figures.climb:
        return numbers.NOTHING
    return numbers.share(curve.slip[curve.slope.index(angle)])


def chances(report: TraversabilityReport) -> Table:
    """Table of the probabilities of driving on the level of surfaces that have ranges."""
    columns = (
        Column("surface", False), Column("go"), Column("go or caution"),
        Column("climb, 5 to 95 %"), Column("ranges", False),
    )  # fmt: skip
    if report.sampling is None:
        return Table(columns, ())
    ranges: dict[str, list[str]] = {}
    for one in report.sampling.ranges:
        text = f"{one.key} {numbers.number(one.low, 4)} to {numbers.number(one.high, 4)}"
        ranges.setdefault(one.surface, []).append(text)
    rows = []
    for figures in report.surfaces:
        if (found := figures.chances) is not None:
            climbs = map(numbers.degrees, (found.climb_low, found.climb_high))
            row = numbers.share(found.go), numbers.share(found.drives), " to ".join(climbs)
            rows.append((title(figures), *row, ", ".join(ranges[figures.surface])))
    return Table(columns, tuple(rows))


def likelihoods(report: TraversabilityReport) -> Table:
    """Table of the shares of ground by probability of go, by the best heading."""
    columns = (Column("probability of go", False), Column("share of the ground"))
    summary = report.summary
    if summary is None or summary.chances is None or not summary.counted:
        return Table(columns, ())
    rows, above = [], 1.0
    for bound in CHANCE_BOUNDS:
        name = f"{numbers.share(bound)} to {numbers.share(above)}"
        if bound == CHANCE_BOUNDS[-1]:
            name = f"below {numbers.share(above)}"
        rows.append((name, numbers.share(summary.chances[bound] / summary.counted)))
        above = bound
    if unknown := summary.counted - sum(summary.chances.values()):
        rows.append(("not known", numbers.share(unknown / summary.counted)))
    return Table(columns, tuple(rows))


def shares(report: TraversabilityReport) -> Table:
    """Table of the shares of ground in each class, by the best and by the worst heading."""
    summary = report.summary
    columns = (Column("ground", False), Column("best heading"), Column("worst heading"))
    rows = (
        (
            ground,
            numbers.share(summary.fraction(ground)),
            numbers.share(fraction_of(summary.worst_counts, ground)),
        )
        for ground in (grounds_of(summary) if summary else ())
        if summary
    )
    return Table(columns, tuple(rows))


def grounds_of(summary: MapSummary) -> list[GroundClass]:
    """Classes of ground in reports: the verdicts always, other classes if there is any."""
    return [
        ground
        for ground in wording.GROUNDS
        if ground <= GroundClass.NO_GO or summary.fraction(ground)
    ]


def reasons(report: TraversabilityReport) -> Table:
    """Table of the reasons for ground that is not go, the most frequent first."""
    columns = (Column("what binds", False), Column("share of the ground"))
    if report.summary is None or not report.summary.counted:
        return Table(columns, ())
    pixels = report.summary.counted
    ranked = sorted(report.summary.reasons.items(), key=lambda item: (-item[1], item[0]))
    rows = (
        (wording.because(reason), numbers.share(count / pixels))
        for reason, count in ranked
        if count
    )
    return Table(columns, tuple(rows))


def grounds(report: TraversabilityReport) -> Table:
    """Table of the shares of each surface's ground in each class, by the best heading."""
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
            numbers.share(sum(counts.values()) / pixels),
            *(numbers.share(fraction_of(counts, ground)) for ground in kinds),
        )
        for name, counts in report.summary.by_surface.items()
        if sum(counts.values())
    )
    return Table(columns, tuple(rows))


def journey(route: Route) -> Iterator[tuple[str, str]]:
    """Yield titles and texts on a route."""
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
        ("length", numbers.length(route.length)),
        ("time", numbers.duration(route.time)),
        ("energy", numbers.energy(route.energy)),
    ):
        if text != numbers.NOTHING:
            part = wording.turning_share(route) if name == "energy" else ""
            yield name, f"{text}, {part} of it for turns on the spot" if part else text
    if used := wording.charge_used(route):
        yield "battery", used
    if route.tightest is not None:
        yield "least margin", wording.margin(route.tightest)
    if caution := wording.caution_length(route):
        yield "caution", f"on {caution}"
    if route.least_chance is not None and route.chance is not None:
        least = numbers.share(route.least_chance.value)
        place = wording.where(route.least_chance.place)
        yield "probability of go", f"{numbers.share(route.chance)} for all of it"
        yield "least probability", f"{least} at {place}"
    for index, bar in enumerate(route.against):
        yield ("one-way" if index == 0 else "and"), f"no way back by {wording.barrier(bar)}"
    if route.one_way and not route.against:
        yield "one-way", "it cannot be driven back the same way"
    if drift := wording.drift(route):
        yield "drift", f"{drift}; {numbers.length(route.drift_total)} in all"
    if route.steepest is not None:
        ground = wording.on_ground(route.steepest.place)
        yield "steepest", f"{wording.pitch(route.steepest)}{ground}"
    if route.softest is not None:
        sunk = numbers.length(route.softest.value)
        yield "softest", f"{sunk} of sinkage at {wording.where(route.softest.place)}"
    if slow := wording.slow_phrase(route):
        yield "slowest to stop in time", slow
    if route.stop is not None:
        yield "longest stop", f"{wording.stop(route.stop.value)}, {wording.where(route.stop.place)}"
    if looked := wording.headings_line(route):
        yield "headings", looked
    for number, other in enumerate(route.alternatives, 1):
        yield f"alternative {number}", wording.alternative(other)
    if route.back is not None:
        yield "way back", wording.route_line(route.back)


def properties(vehicle: Vehicle) -> Table:
    """Table of the vehicle's figures."""
    rows = tuple((name, text) for name, text in _properties(vehicle) if text)
    return Table((Column("figure", False), Column("value", False)), rows)


def _properties(vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    wheel, margins, limits = vehicle.wheel, vehicle.margins, vehicle.thresholds
    yield "model", vehicle.model
    if vehicle.tracks or vehicle.feet:
        yield from _gear(vehicle)
    else:
        yield "wheel", _sizes(wheel)
        yield "largest torque of a wheel", numbers.quantity(wheel.max_torque, "N m")
    if not vehicle.feet:
        yield "largest slip", numbers.share(wheel.max_slip)
    if not vehicle.is_single and vehicle.gear == "wheels":
        radius = vehicle.turning_radius
        yield "steering", "as a car does" if radius else STEERING[vehicle.steering]
        yield "turning radius", numbers.length(radius) if radius else ""
    if vehicle.is_single:
        yield "load", numbers.quantity(vehicle.weight, "N")
    else:
        yield "mass", numbers.quantity(vehicle.mass, "kg")
        yield "loads", "; ".join(map(wording.load, vehicle.loads))
        gravity = numbers.quantity(vehicle.gravity, "m/s²")
        yield "weight", f"{numbers.quantity(vehicle.weight, 'N')} at {gravity}"
        if vehicle.gear == "wheels":
            yield "axles", "; ".join(map(_axle, vehicle.axles))
            yield "wheelbase", numbers.length(vehicle.wheelbase)
        yield "track", numbers.length(vehicle.track_width)
        yield "height of the centre of gravity", numbers.length(vehicle.cog_height)
        yield "clearance", numbers.length(vehicle.clearance)
        yield "height", "" if vehicle.height is None else numbers.length(vehicle.height)
        yield "width of the body", numbers.length(vehicle.body_width) if vehicle.body_width else ""
        for name, end in (("front overhang", vehicle.front), ("rear overhang", vehicle.rear)):
            if end.length > 0 and math.isfinite(end.height):
                yield name, f"{numbers.length(end.length)}, {numbers.length(end.height)} high"
    yield "speed", numbers.quantity(vehicle.speed, "m/s")
    yield "power drawn all the time", numbers.quantity(vehicle.power, "W") if vehicle.power else ""
    if math.isfinite(vehicle.max_drift):
        yield "largest drift", numbers.length(vehicle.max_drift)
    yield "efficiency", numbers.share(vehicle.efficiency) if vehicle.efficiency < 1.0 else ""
    if vehicle.battery is not None:
        unused = f", {numbers.share(vehicle.battery.reserve)} of it kept"
        charge = numbers.energy(vehicle.battery.capacity)
        yield "battery", f"{charge}{unused if vehicle.battery.reserve else ''}"
    if math.isfinite(vehicle.stopping_distance):
        yield "is to stop within", numbers.length(vehicle.stopping_distance)
    late = vehicle.reaction_time
    yield "reaction time", numbers.duration(late) if late else ""
    kept = (
        ("clearance", margins.clearance, numbers.length), ("step", margins.step, numbers.length),
        ("tip-over", margins.tip, numbers.degrees), ("slope", margins.slope, numbers.degrees),
        ("slope on soft soil", margins.soil, numbers.degrees),
    )  # fmt: skip
    reserve = ", ".join(f"{name} {words(value)}" for name, value, words in kept if value)
    yield "kept in reserve", reserve
    go = f"{numbers.share(limits.utilisation)} of the soil’s strength, slip "
    go += f"{numbers.share(limits.slip)}, {numbers.share(limits.torque)} of the torque, "
    go += f"{numbers.share(limits.geometry)} of a limit of shape, a drift of "
    yield "go up to", f"{go}{numbers.degrees(limits.drift)}"
    caution = f"all of the soil’s strength, slip {numbers.share(limits.caution_slip)}, all of the "
    caution += "torque, all of a limit of shape, a drift of "
    yield "caution up to", f"{caution}{numbers.degrees(limits.caution_drift)}"


def _gear(vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    """Yield titles and texts on tracks or feet."""
    if tracks := vehicle.tracks:
        size = f"{numbers.length(tracks.length)} long, {numbers.length(tracks.width)} wide"
        yield "tracks", f"{size}, sprockets of radius {numbers.length(tracks.radius)}"
        yield "front idler", f"{numbers.length(tracks.front_height)} high"
        yield "largest torque of a track", numbers.quantity(tracks.max_torque, "N m")
    if feet := vehicle.feet:
        yield "feet", f"{vehicle.wheels} of diameter {numbers.length(feet.diameter)}"
        yield "length of the stance", numbers.length(vehicle.wheelbase)
        yield "height of a step", numbers.length(feet.step_height)
        yield "reach of a foot", numbers.length(feet.reach)
        yield "feet that bear it as it walks", str(feet.bearing)


def title(figures: Figures) -> str:
    """Name of a surface in tables."""
    return printable(figures.surface) or "(no surface)"


def what_binds(figures: Figures) -> str:
    """Measure that binds on the level, or the keys that the surface lacks."""
    if figures.missing:
        return f"lacks {', '.join(figures.missing)}"
    return wording.because(figures.reason)


def _axle(axle: Axle) -> str:
    wheels = count_of(axle.wheels, "driven wheel" if axle.driven else "towed wheel")
    own = ""
    if axle.wheel is not None:
        own = f", of {_sizes(axle.wheel)}"
        if axle.driven and math.isfinite(axle.wheel.max_torque):
            own += f", at most {numbers.quantity(axle.wheel.max_torque, 'N m')}"
    return f"{wheels} {_ahead(axle.x)}{own}"


def _sizes(wheel: Wheel) -> str:
    """Radius and width of a wheel, with grousers, tyre pressure and the like if it has any."""
    line = f"radius {numbers.length(wheel.radius)}, width {numbers.length(wheel.width)}"
    if wheel.grouser_height > 0.0:
        line += f", lugs of {numbers.length(wheel.grouser_height)}"
    if math.isfinite(wheel.patch_pressure):
        line += f", {numbers.quantity(wheel.patch_pressure / 1e3, 'kPa')} on hard ground"
    if wheel.contact_length > 0.0:
        line += f", a contact of {numbers.length(wheel.contact_length)} or more"
    return line


def _ahead(x: float) -> str:
    if x == 0.0:
        return "at the centre of gravity"
    return f"{numbers.length(abs(x))} {'ahead' if x > 0 else 'behind'}"


def _scaled_text(value: float | None, factor: float) -> str:
    return numbers.number(None if value is None else value * factor)


def _used_share(value: float | None) -> str:
    return "all" if value is not None and value >= 1.0 else numbers.share(value)


def warnings(report: TraversabilityReport) -> tuple[tuple[str, str], ...]:
    """Names of surfaces with sentences on what is unusual about each."""
    return tuple(
        (title(figures), printable(warning))
        for figures in report.surfaces
        for warning in figures.warnings
    )
