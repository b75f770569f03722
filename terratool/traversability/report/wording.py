"""Numbers, places and findings in words: three digits, a unit, and nothing that is not known."""

from __future__ import annotations

import math

import numpy as np

from terratool.text.display import counted, printable
from terratool.traversability.results import (
    RANKS,
    Barrier,
    Extreme,
    Location,
    Reach,
    Reason,
    Route,
    TraversabilityReport,
    Verdict,
)

NOTHING = "–"
"""Stands for what means nothing or is not known."""

VERDICTS = (Verdict.GO, Verdict.CAUTION, Verdict.NO_GO, Verdict.UNKNOWN)
"""In the order of reports."""


def number(value: float | None, digits: int = 3) -> str:
    """A number to so many significant digits, whole ones in full, with thousands set apart.

    None and NaN are a dash, infinity is "no limit".
    """
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "no limit" if value > 0 else NOTHING
    if value == 0.0 or not 1e-6 <= abs(value) < 1e9:
        return f"{value + 0.0:.{digits}g}".replace("-", "−")
    places = max(0, digits - 1 - math.floor(math.log10(float(f"{abs(value):.{digits - 1}e}"))))
    text = f"{value:,.{places}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", "−")


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """A number and its unit; what is no number goes without."""
    text = number(value, digits)
    return f"{text} {unit}" if text[-1].isdigit() else text


def length(metres: float | None) -> str:
    """In mm, m or km."""
    if metres is None or not math.isfinite(metres):
        return number(metres)
    if abs(metres) >= 9999.5:
        return quantity(metres / 1e3, "km")
    if 0.0 < abs(metres) < 0.0995:
        return quantity(metres * 1e3, "mm", 2)
    return quantity(metres, "m", 4 if abs(metres) >= 999.5 else 3)


def degrees(radians: float | None) -> str:
    """An angle, to a tenth of a degree."""
    if radians is None or not math.isfinite(radians):
        return number(radians)
    return f"{math.degrees(radians) + 0.0:.1f}°".replace("-", "−").replace("−0.0", "0.0")


def share(value: float | None) -> str:
    """A share in per cent; 0 and 100 stand only for nothing and all."""
    if value is None or not math.isfinite(value):
        return number(value)
    per_cent = 100.0 * value
    if 0.0 < per_cent < 0.1:
        return "<0.1 %"
    if 99.9 < per_cent < 100.0:
        return ">99.9 %"
    return quantity(per_cent, "%").replace("100.0", "100")


def duration(seconds: float | None) -> str:
    """In s, min and s, or h and min."""
    if seconds is None or not math.isfinite(seconds):
        return number(seconds)
    if seconds < 59.5:
        return quantity(seconds, "s", 2)
    if seconds < 3570.0:
        minutes, rest = divmod(round(seconds), 60)
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours:,} h {minutes} min" if minutes else f"{hours:,} h"


def energy(joules: float | None) -> str:
    """In J, Wh or kWh; a dash where it does not move, or is not known."""
    if joules is None or not math.isfinite(joules):
        return NOTHING
    if abs(joules) < 3600.0:
        return quantity(joules, "J")
    hours = joules / 3600.0
    return quantity(hours / 1e3, "kWh") if abs(hours) >= 1e4 else quantity(hours, "Wh")


def coordinates(place: Location) -> str:
    """World x and y, to a millimetre."""
    x, y = (f"{round(value, 3) + 0.0:.12g}".replace("-", "−") for value in (place.x, place.y))
    return f"({x}, {y})"


def where(place: Location) -> str:
    """Coordinates, and what the ground is there."""
    ground = [part for part in (name(place.surface), place.element) if part]
    return f"{coordinates(place)}{' on ' if ground else ''}{', '.join(ground)}"


def name(surface: str) -> str:
    """A surface's name in quotes, on one line; nothing for none."""
    return f'"{printable(surface)}"' if surface else ""


def because(reason: Reason) -> str:
    """What binds; a dash for nothing."""
    return NOTHING if reason == Reason.NONE else reason.label


def barrier(bar: Barrier) -> str:
    """What bars the way at one place, in words."""
    what = "something" if bar.reason == Reason.NONE else bar.reason.label
    by = f", {printable(bar.bars)}" if bar.bars and bar.reason != Reason.EDGE else ""
    wide = f", for {length(bar.width)}" if bar.width > 0 else ""
    return f"{what} at {coordinates(bar.place)}{by}{wide}"


def margin(extreme: Extreme) -> str:
    """How far the nearest limit is, where, and which."""
    left = share(max(extreme.value, 0.0)) if math.isfinite(extreme.value) else "none"
    which = f", {extreme.reason.label}" if extreme.reason != Reason.NONE else ""
    return f"{left}{which}, at {where(extreme.place)}"


def careful(route: Route) -> str:
    """How much of a route's length is caution, and for what; empty for none of it."""
    profile = route.profile
    if profile is None or len(profile.distance) < 2:
        return ""
    # a sample stands for the way half to the one before and half to the one behind it
    steps = np.diff(profile.distance)
    parts = 0.5 * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0))
    parts[profile.verdict != Verdict.CAUTION] = 0.0
    by_reason = np.bincount(profile.reason, parts, len(Reason))
    found = [Reason(code) for code in np.argsort(-by_reason, kind="stable") if by_reason[code] > 0]
    if not found:
        return ""
    return f"{length(float(parts.sum()))} of it: {', '.join(because(code) for code in found[:3])}"


def ends(route: Route) -> str:
    """Where a route goes from and to."""
    return f"{coordinates(route.start)} to {coordinates(route.goal)}"


def route_line(route: Route) -> str:
    """A route in a sentence."""
    if not route.found:
        if not route.planned:
            what = "The way through the waypoints cannot be driven"
        else:
            what = f"There is no way from {ends(route)}"
        if not route.barriers:
            return f"{what}."
        more = len(route.barriers) - 1
        rest = f" (and {counted(more, 'more place')})" if more else ""
        return f"{what}: {barrier(route.barriers[0])}{rest}."
    what = "There is a way" if route.planned else "The way through the waypoints can be driven"
    line = f"{what} from {ends(route)}: {length(route.length)}, {duration(route.time)}"
    if route.energy is not None and math.isfinite(route.energy):
        line += f", {energy(route.energy)}"
    if caution := careful(route):
        line += f"; caution on {caution}"
    if route.tightest is not None:
        reason = route.tightest.reason
        of = f" ({reason.label})" if reason != Reason.NONE else ""
        line += f"; least margin {share(max(route.tightest.value, 0.0))}{of}"
        line += f" at {coordinates(route.tightest.place)}"
    return f"{line}."


def reach_line(reach: Reach) -> str:
    """What can be reached, in a sentence."""
    line = f"From {coordinates(reach.start)} {share(reach.share)} of the ground can be reached"
    if reach.returnable == reach.share:
        return f"{line}, and left again."
    return f"{line}, and left again from {share(reach.returnable)}."


def conclusion(report: TraversabilityReport) -> str:
    """The verdict in a sentence, and what binds most."""
    summary = report.summary
    if report.routes:
        worst = max(report.routes, key=lambda route: RANKS[route.verdict])
        line = route_line(worst)
        return f"{line} {worst.note}" if worst.note else line
    if not summary.pixels:
        return "There is no ground to drive on."
    go, caution, no_go, unknown = map(summary.fraction, VERDICTS)
    known = {reason: count for reason, count in summary.reasons.items() if reason != Reason.NONE}
    edge = ""
    if known.keys() == {Reason.EDGE} and not caution:
        edge = (
            f", but for the edge of the terrain, on {share(no_go)}, where the vehicle would stand "
            "over it"
        )
    if go == 1.0 or (edge and go and not unknown):
        return f"All of the ground is go, with the best heading at each place{edge}."
    if unknown == 1.0 or (edge and unknown and not go):
        return f"Nothing is known of the ground: its surfaces lack what the formulas need{edge}."
    parts = [f"{share(go)} of the ground is go"]
    parts += [
        f"{share(part)} {verdict.label}"
        for verdict, part in zip(VERDICTS[1:], (caution, no_go, unknown), strict=True)
        if part
    ]
    text = f"{', '.join(parts[:-1])} and {parts[-1]}" if parts[1:] else parts[0]
    if not known:
        return f"{text}."
    most = max(known, key=lambda reason: (known[reason], -reason))
    return f"{text}; what binds most is {most.label}, on {share(known[most] / summary.pixels)}."
