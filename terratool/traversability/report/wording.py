"""Results in words: numbers with three digits and a unit, and no sentence on unknown ones."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from terratool.report import numbers
from terratool.report.wording import count_of, join_words
from terratool.text.display import printable, quote
from terratool.traversability.figures import Figures
from terratool.traversability.map_results import (
    CHANCE_BOUNDS,
    FINER_HEADINGS,
    MOST_HEADINGS,
    fraction_of,
)
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Barrier, Extreme, Location, Reach, Route
from terratool.traversability.vehicle import Load, Vehicle
from terratool.traversability.verdicts import RANKS, GroundClass, Reason, Verdict

GROUNDS = (
    GroundClass.GO,
    GroundClass.CAUTION,
    GroundClass.NO_GO,
    GroundClass.UNKNOWN,
    GroundClass.ONE_WAY,
    GroundClass.CUT_OFF,
    GroundClass.EDGE,
)
"""Classes of ground in the order of reports."""

_PHRASES = {
    GroundClass.GO: "is go",
    GroundClass.CAUTION: "is caution",
    GroundClass.NO_GO: "is no-go",
    GroundClass.UNKNOWN: "is unknown",
    GroundClass.ONE_WAY: "can be reached, but not left again",
    GroundClass.CUT_OFF: "is cut off",
    GroundClass.EDGE: "lies at the edge, where the ground ends under the vehicle or in its way",
}

_DRIFT, _MUCH_DRIFT = 0.05, 0.5
"""Least drift, m, that is told of a route, and that its sentence has."""

_LEVEL = math.radians(0.05)
"""Least slope of a route that is said, rad: less is shown as none."""

_MUCH = 0.1
"""Difference of shares by the best and by the worst heading that is said."""

EXAMPLE = {"cohesion": 1.72, "fricAngle": 29, "sinkage": 0.0397}
"""Figures of the soil of `PRESET`, an example for surfaces without a soil."""
PRESET = "sandy-loam-15"
"""Name of the preset of `EXAMPLE`."""


def turning_share(route: Route) -> str:
    """Share of a route's energy that turns on the spot take; empty where they take none."""
    if not (route.turning and route.energy and math.isfinite(route.energy)):
        return ""
    return numbers.share(route.turning / route.energy)


def climb(figures: Figures) -> str:
    """Largest climb, with its error band where the model has one; a dash for none."""
    if figures.climb is None or not figures.climb_error:
        return numbers.degrees(figures.climb)
    return f"{numbers.degrees(figures.climb)} ± {numbers.degrees(figures.climb_error)}"


def charge_used(route: Route) -> str:
    """Phrase on the share of a charge that a route uses; empty where that is not known."""
    used = route.charge
    if used is None:
        return ""
    back = " there and back" if route.back is not None and route.back.found else ""
    line = f"{numbers.share(used.share)} of a charge{back}"
    if used.verdict == Verdict.CAUTION:
        line += f", of which {numbers.share(used.reserve)} is to be kept"
    return line


def load(one: Load) -> str:
    """Phrase on a load: mass and centre of gravity."""
    line = f"{numbers.quantity(one.mass, 'kg')}, centre of gravity {numbers.length(one.cog_height)}"
    side = "" if not one.ahead else " ahead" if one.ahead > 0.0 else " behind"
    shifted = f" and {numbers.length(abs(one.ahead))}{side}" if side else ""
    return f"{line} high{shifted}"


def one_load(vehicle: Vehicle) -> str:
    """Sentence on a vehicle whose load does not differ; empty for others, and a wheel by itself."""
    if vehicle.loads or not vehicle.axles or not vehicle.name:
        return ""
    return (
        f"All of this holds for a mass of {numbers.quantity(vehicle.mass, 'kg')}. With a range, "
        '"mass": [low, high], in the vehicle file it holds for all loads.'
    )


def empty_battery(route: Route) -> str:
    """Sentence on a battery that does not last for a route; empty where it does."""
    used = route.charge
    if used is None or used.verdict != Verdict.NO_GO:
        return ""
    line = f"But the battery does not last: it takes {charge_used(route)}"
    if used.emptied is None:
        return f"{line}, and is empty on the way back."
    place = coordinates(used.emptied.place)
    return f"{line}, and is empty after {numbers.length(used.emptied.value)}, at {place}."


def stop(metres: float | None) -> str:
    """Distance to stop; "cannot stop" for infinity."""
    return "cannot stop" if metres == math.inf else numbers.length(metres)


def slow_phrase(route: Route) -> str:
    """Phrase on the least speed that stops in time; empty where the vehicle's own speed does."""
    profile, slowest = route.profile, route.slowest
    if profile is None or slowest is None or slowest.value >= float(profile.speed.max()):
        return ""
    return f"{numbers.quantity(slowest.value, 'm/s')} at {coordinates(slowest.place)}"


def quarter_turn(figures: Figures) -> str:
    """Work of a quarter turn on the spot, or the measure that forbids it."""
    if figures.turning_binding == Reason.TURNING:
        return "never"
    if figures.turning_binding != Reason.NONE:
        return f"cannot, by {figures.turning_binding.label}"
    return numbers.energy(figures.turning_work)


def coordinates(place: Location) -> str:
    """World x and y, to a millimetre; with the height of what is over another top."""
    known = (place.x, place.y, *((place.height,) if place.above and place.height else ()))
    return f"({', '.join(numbers.full(round(value, 3)) for value in known)})"


def vehicle_name(report: TraversabilityReport) -> str:
    """Name of the vehicle on one line; empty for a wheel by itself."""
    return printable(report.vehicle.name)


def point(place: tuple[float, ...]) -> str:
    """World coordinates of a place, with the height that it is given by, if it is."""
    x, y, *z = place
    return coordinates(Location(x, y, z[0] if z else None, "", "", bool(z)))


def where(place: Location) -> str:
    """Coordinates of a place, with surface and element."""
    return f"{coordinates(place)}{on_ground(place)}"


def on_ground(place: Location) -> str:
    """Surface and element of a place, as they follow its coordinates; empty for neither."""
    known = [part for part in (name(place.surface), place.element) if part]
    return f"{' on ' if known else ''}{', '.join(known)}"


def name(surface: str) -> str:
    """Name of a surface in quotes, on one line; empty for no surface."""
    return f'"{printable(surface)}"' if surface else ""


def because(reason: Reason) -> str:
    """Name of the measure that binds; a dash for none."""
    return numbers.NOTHING if reason == Reason.NONE else reason.label


def step_limit(figures: Figures, vehicle: Vehicle) -> str:
    """Measure that limits steps, and the axle; a dash for none."""
    if figures.step_axle is None:
        return figures.step_binding or numbers.NOTHING
    return f"{figures.step_binding} at the {axle(figures.step_axle, len(vehicle.axles))} axle"


def axle(number: int, axles: int) -> str:
    """Word for the axle of a number, 1 for the foremost, among the axles of a vehicle."""
    if number in (1, axles):
        return "front" if number == 1 else "rear"
    if axles == 3:
        return "middle"
    endings = {1: "st", 2: "nd", 3: "rd"}
    ending = "th" if 10 < number % 100 < 14 else endings.get(number % 10, "th")
    return f"{number}{ending}"


def barrier(bar: Barrier) -> str:
    """Phrase on a barrier: the measure, the place and the width."""
    what = "something" if bar.reason == Reason.NONE else bar.reason.label
    by = f", {printable(bar.bars)}" if bar.bars and bar.reason != Reason.EDGE else ""
    wide = f", for {numbers.length(bar.width)}" if bar.width > 0 else ""
    if bar.reason == Reason.HEADROOM:
        return f"{what} {printable(bar.bars)} at {coordinates(bar.place)}{wide}"
    return f"{what} at {coordinates(bar.place)}{by}{wide}"


def margin(extreme: Extreme) -> str:
    """Phrase on the smallest margin: its value, place and measure."""
    left = numbers.share(max(extreme.value, 0.0)) if math.isfinite(extreme.value) else "none"
    which = f", {extreme.reason.label}" if extreme.reason != Reason.NONE else ""
    return f"{left}{which}, at {where(extreme.place)}"


def drift(route: Route) -> str:
    """Phrase on the drift of a route on side slopes; empty where it hardly drifts."""
    if route.drift is None or route.drift.value < _DRIFT:
        return ""
    line = f"{numbers.length(route.drift.value)} downhill by {coordinates(route.drift.place)}"
    far = "" if route.crab is None else f"up to {numbers.degrees(route.crab.value)} "
    return f"{line} unless it heads {far}uphill"


def _drift_line(route: Route) -> str:
    """Sentence on a drift that is long, or more than the vehicle's largest; empty for others."""
    if route.drift is None or not (route.strays or route.drift.value >= _MUCH_DRIFT):
        return ""
    line = f"It drifts {numbers.length(route.drift.value)} downhill"
    return f"{line}, more than its maxDrift." if route.strays else f"{line} unless steered uphill."


def along_line(route: Route) -> str:
    """Sentence on what a route takes and meets beside what `route_line` says; empty for none."""
    parts = []
    if turns := turning_share(route):
        parts.append(f"turns on the spot take {turns} of the energy")
    if route.steepest is not None and abs(route.steepest.value) >= _LEVEL:
        parts.append(f"steepest {pitch(route.steepest)}")
    if route.softest is not None and route.softest.value > 0.0:
        sunk = numbers.length(route.softest.value)
        parts.append(f"deepest sinkage {sunk} at {coordinates(route.softest.place)}")
    if drifts := drift(route):
        parts.append(f"drift {drifts}")
    return f"Along it: {'; '.join(parts)}." if parts else ""


def pitch(steepest: Extreme) -> str:
    """Phrase on the steepest place of a route: the slope, up or down, and where it is."""
    angle = steepest.value
    way = (" up" if angle > 0 else " down") if angle else ""
    return f"{numbers.degrees(abs(angle))}{way} at {coordinates(steepest.place)}"


def caution_length(route: Route) -> str:
    """Phrase on the length of a route that is caution, with reasons; empty for none."""
    length, found = _caution(route)
    reasons = ", ".join(because(code) for code in found[:3])
    return f"{numbers.length(length)} of it: {reasons}" if found else ""


def _caution(route: Route) -> tuple[float, list[Reason]]:
    """Length of a route that is caution, m, and the reasons, that of the longest part first."""
    profile = route.profile
    if profile is None or len(profile.distance) < 2:
        return 0.0, []
    # a sample stands for half the way to each of its neighbours
    steps = np.diff(profile.distance)
    parts = 0.5 * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0))
    parts[profile.verdict != Verdict.CAUTION] = 0.0
    by_reason = np.bincount(profile.reason, parts, len(Reason))
    found = [Reason(code) for code in np.argsort(-by_reason, kind="stable") if by_reason[code] > 0]
    return float(parts.sum()), found


def ends(route: Route) -> str:
    """Phrase on the start and the goal of a route."""
    return f"{coordinates(route.start)} to {coordinates(route.goal)}"


def route_line(route: Route) -> str:
    """Sentences on a route, what matters most first: whether there is a way, and what it takes.

    Then follow where it is tight, drift that is long, and whether another way is better.
    """
    lines = [_way(route)]
    if route.found:
        lines += _tight_line(route), _drift_line(route), empty_battery(route), all_go_line(route)
    if route.found or not route.note:
        lines.append(headings_line(route))
    lines.append(return_line(route))
    return " ".join(filter(None, lines))


def all_go_line(route: Route) -> str:
    """Sentence on a way that is go all along, where that found is not; empty for none."""
    more = route.all_go_longer
    if more is None:
        return ""
    how = f"{numbers.length(abs(more))} {'longer' if more > 0.0 else 'shorter'}"
    how = how if abs(more) >= 1e-3 else "as long"
    return f"An all-go way is {how}: --prefer margin finds it."


def alternative(route: Route) -> str:
    """Phrase on an alternative: what it takes, its verdict and margin, and what it shares."""
    parts = [_journey(route), route.verdict.label]
    if route.tightest is not None:
        parts.append(f"least margin {numbers.share(max(route.tightest.value, 0.0))}")
    parts.append(f"shares {numbers.share(route.shared or 0.0)} with ways before")
    return "; ".join(parts)


def _way(route: Route) -> str:
    if not route.found:
        if not route.planned:
            what = "The way through the waypoints cannot be driven"
        else:
            what = f"There is no way from {ends(route)}"
        if route.note or not route.barriers:  # the note says what bars it
            return f"{what}."
        more = len(route.barriers) - 1
        rest = f" (and {count_of(more, 'more place')})" if more else ""
        return f"{what}: {barrier(route.barriers[0])}{rest}."
    what = "There is a way" if route.planned else "The way through the waypoints can be driven"
    line = f"{what} from {ends(route)}: {_journey(route)}"
    if route.charge is not None and route.charge.verdict != Verdict.NO_GO:
        line += f", {charge_used(route)}"
    if slow := slow_phrase(route):
        line += f"; to stop in time no faster than {slow}"
    if route.chance is not None:
        line += f"; probability of go {numbers.share(route.chance)}"
    return f"{line}."


def _tight_line(route: Route) -> str:
    """Sentence on where a route is tight, why, and how much of it is caution; empty for none."""
    tightest = route.tightest
    length, reasons = _caution(route)
    caution = f"caution on {numbers.length(length)}" if reasons else ""
    if tightest is None:
        return f"{caution.capitalize()} of it." if caution else ""
    of = f" ({tightest.reason.label})" if tightest.reason != Reason.NONE else ""
    line = f"Least margin {numbers.share(max(tightest.value, 0.0))}{of}"
    line += f" at {coordinates(tightest.place)}"
    if route.load is not None:
        line += f", with a load of {load(route.load)}"
    if caution:
        line += f"; {caution}"
        if reasons != [tightest.reason]:
            line += f" of it: {', '.join(because(code) for code in reasons[:3])}"
    return f"{line}."


def headings_line(route: Route) -> str:
    """Sentence on the numbers of headings that were tried; empty where the first one sufficed."""
    tried = route.tried_headings
    if route.found:
        few = join_words([str(headings) for headings in tried[:-1]])
        return f"It takes {tried[-1]} headings at each place; {few} do not show it." if few else ""
    if route.ruled_out_headings is not None:
        return f"More headings at each place, up to {route.ruled_out_headings}, do not change that."
    if not tried:
        return ""
    numbers = join_words([str(headings) for headings in tried])
    line = f"This holds with {numbers} headings at each place"
    asked, most = len(tried) == 1 and tried[0] < MOST_HEADINGS, FINER_HEADINGS[-1]
    more = f"; more may show a way, up to --headings {MOST_HEADINGS}"
    return f"{line}{more * (asked or tried[-1] < most)}."


def _journey(route: Route) -> str:
    line = f"{numbers.length(route.length)}, {numbers.duration(route.time)}"
    if route.energy is not None and math.isfinite(route.energy):
        line += f", {numbers.energy(route.energy)}"
    return line


def return_line(route: Route) -> str:
    """Sentence on driving the way back; empty where it can be, and was not asked for."""
    line = ""
    if route.one_way:
        line = "It is one-way: it cannot be driven back the same way"
        if route.against:
            bar = route.against[0]
            line += f", for {because(bar.reason)} at {coordinates(bar.place)}"
        line += "."
    if route.back is None:
        return line
    if not route.back.found:
        bars = route.back.barriers
        line += f" There is no way back{f': {barrier(bars[0])}' if bars else ''}."
    else:
        other = "Another way back" if route.one_way else "The way back"
        line += f" {other} is {_journey(route.back)}."
    alike = route.back.found and route.back.tried_headings == route.tried_headings
    return f"{line} {'' if alike else headings_line(route.back)}".strip()


def reach_line(reach: Reach) -> str:
    """Sentence on the ground that can be reached."""
    if reach.note:
        return reach.note
    line = (
        f"From {coordinates(reach.start)} {numbers.share(reach.share)} of the ground can be reached"
    )
    if reach.returnable == reach.share:
        return f"{line}, and left again."
    if numbers.share(reach.returnable) == numbers.share(reach.share):
        return f"{line}, and left again from nearly all of that."
    return f"{line}, and left again from {numbers.share(reach.returnable)}."


def counted_from_line(report: TraversabilityReport) -> str:
    """Sentence on the place from which ground counts as reached; empty where all ground is."""
    summary = report.summary
    if summary is None or summary.largest is None:
        return ""
    if not any(summary.fraction(ground) for ground in (GroundClass.ONE_WAY, GroundClass.CUT_OFF)):
        return ""
    place = numbers.place(round(value, 3) + 0.0 for value in summary.largest.place)
    return (
        "What can be reached is counted from the largest connected part of the ground, "
        f"{numbers.share(summary.largest.share)} of it, as with --from {place}."
    )


def likely_line(report: TraversabilityReport) -> str:
    """Sentence on the share of ground that is likely go; empty where no soils are ranges."""
    summary = report.summary
    if summary is None or summary.chances is None or not summary.counted:
        return ""
    most = CHANCE_BOUNDS[0]
    part = numbers.share(summary.chances[most] / summary.counted)
    return f"With a probability of {numbers.share(most)} or more {part} of the ground is go."


def lacking(report: TraversabilityReport) -> str:
    """Sentence on the surfaces of a report that lack figures; empty where none does."""
    return lacking_of(
        {one.surface: one.missing for one in report.surfaces}, without_surface(report)
    )


def lacking_of(missing: Mapping[str, Sequence[str]], bare: bool) -> str:
    """Sentence on surfaces that lack figures; empty where none does.

    Args:
        missing: keys that each surface lacks, by its name.
        bare: whether there is ground without a surface.
    """
    lacks = [
        f"surface {quote(name)} lacks {join_words(keys)}" for name, keys in missing.items() if keys
    ]
    if bare:
        lacks.append(f"{'some of ' * bool(missing)}the ground has no surface")
    text = "; ".join(lacks)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def without_surface(report: TraversabilityReport) -> bool:
    """Whether there is ground without a surface, on which no verdict is known."""
    if report.summary is None:
        return not report.surfaces
    return bool(report.summary.by_surface.get("", {}).get(GroundClass.UNKNOWN))


def slip_unknown(report: TraversabilityReport) -> str:
    """Sentence on why and where slip is not known; empty where it is."""
    if report.vehicle.model == "paper":
        return "There is no slip in the model paper."
    if report.vehicle.feet:
        return "Feet hold or slide; they have no slip."
    without = [one for one in report.surfaces if one.load and one.slip_curve is None]
    hard = [name(one.surface) for one in without if not one.sinkage_rate]
    soft = [name(one.surface) for one in without if one.sinkage_rate]
    parts = []
    if soft:
        have = "has" if len(soft) == 1 else "have"
        parts.append(f"Slip is not known on {join_words(soft)}, which {have} no shearModulus.")
    if hard:
        yields = "does" if len(hard) == 1 else "do"
        parts.append(f"Slip counts as none on {join_words(hard)}, which {yields} not yield.")
    return " ".join(parts)


def slip_caption(vehicle: Vehicle) -> str:
    """Caption of a chart of slip against slope."""
    reserve = vehicle.margins.slope
    kept = f", which keeps {numbers.degrees(reserve)} in reserve" if reserve else ""
    return (
        "Slip of the wheel that slips most, by the slope that the vehicle drives straight up, or "
        f"down. A dot is the largest climb{kept}; what lies beyond it is pale. The area along a "
        "curve is its error band."
    )


def mends(report: TraversabilityReport) -> Iterator[tuple[str, str]]:
    """Yield places and lines of JSON that give surfaces an example of a soil."""
    known = [one.surface for one in report.surfaces if not one.missing]
    for one in report.surfaces:
        if one.missing:
            where_to = f'in "surfTypes", {json.dumps(one.surface, ensure_ascii=False)}'
            own = json.dumps({key: EXAMPLE[key] for key in one.missing})[1:-1]
            yield where_to, f"{own},"
            yield f"{where_to}, or all of it", f'"preset": "{PRESET}",'
    if without_surface(report):
        if not report.surfaces:
            yield "at the top of the file", f'"surfTypes": {{"ground": {{"preset": "{PRESET}"}}}},'
        surface = known[0] if known else (report.surfaces or (Figures("ground"),))[0].surface
        yield 'in "elemTree"', f'"surface": {json.dumps(surface, ensure_ascii=False)},'


def conclusion(report: TraversabilityReport) -> str:
    """Sentence on the verdict, with the measure that binds most."""
    if report.routes:
        worst = max(report.routes, key=lambda route: RANKS[route.verdict])
        line = f"{route_line(worst)} {worst.note}".rstrip()
        if worst.verdict == Verdict.UNKNOWN and (lacks := lacking(report)):
            line += f" {lacks}"
        return line
    summary = report.summary
    if summary is None or not summary.pixels:
        return "There is no ground to drive on."
    if report.reach is not None and report.reach.note:
        return reach_line(report.reach)
    counts = {ground for ground in GROUNDS if summary.fraction(ground)}
    edge = ""
    if GroundClass.EDGE in counts and counts - {GroundClass.EDGE}:
        part = numbers.share(summary.fraction(GroundClass.EDGE))
        edge = f"The edge of the terrain, {part} of the ground, does not count."
    inner = counts - {GroundClass.EDGE} or counts
    if inner == {GroundClass.GO}:
        every = fraction_of(summary.worst_counts, GroundClass.GO)
        text = "All of the ground is go, with the best heading at each place"
        text += f"; {numbers.share(every)} with every heading." if every < 1.0 else "."
        return " ".join(filter(None, (text, likely_line(report), edge)))
    if inner == {GroundClass.UNKNOWN}:
        return " ".join(filter(None, ("Nothing is known of the ground.", lacking(report), edge)))
    parts = [
        f"{numbers.share(summary.fraction(ground))} {_PHRASES[ground]}"
        for ground in GROUNDS
        if ground in inner
    ]
    parts[0] = parts[0].replace(" %", " % of the ground", 1)
    text = join_words(parts)
    every = fraction_of(summary.worst_counts, GroundClass.GO)
    if GroundClass.GO in inner and summary.fraction(GroundClass.GO) - every > _MUCH:
        first = f"{parts[0]} with the best heading, {numbers.share(every)} with every heading"
        text = "; ".join(filter(None, (first, join_words(parts[1:]))))
    elif (barred := fraction_of(summary.worst_counts, GroundClass.NO_GO)) - summary.fraction(
        GroundClass.NO_GO
    ) > _MUCH:
        text += f"; {numbers.share(barred)} is no-go with the worst heading"
    about, lost = {GroundClass.GO, GroundClass.CAUTION}, {GroundClass.ONE_WAY, GroundClass.CUT_OFF}
    if not counts & about and counts & lost:
        text = f"There is no place that the vehicle can drive to and back from: {text}"
    known = {reason: count for reason, count in summary.reasons.items() if reason != Reason.NONE}
    if known:
        most = max(known, key=lambda reason: (known[reason], -reason))
        text += (
            f"; what binds most is {most.label}, on {numbers.share(known[most] / summary.counted)}"
        )
    lacks = lacking(report) if GroundClass.UNKNOWN in counts else ""
    return " ".join(
        filter(None, (f"{text}.", likely_line(report), counted_from_line(report), lacks, edge))
    )
