"""Numbers for people: rounded, with a unit, and a dash for unknown values."""

from __future__ import annotations

import math
from collections.abc import Iterable

_NOISE = 1e-12
"""Largest share of another number that counts as left over from rounding."""
NOTHING = "–"
"""Text for an unknown or meaningless value."""


def round_down(value: float) -> float:
    """Round a value above 0 down to 1, 2 or 5 times a power of ten."""
    power = math.floor(math.log10(value))
    sides = (float(f"{part}e{power + more}") for part, more in ((5, 0), (2, 0), (1, 0), (5, -1)))
    return next(one for one in sides if one <= value * (1 + _NOISE))


def round_up(value: float, parts: tuple[int, ...] = (1, 2, 5)) -> float:
    """Round a value above 0 up to one of some parts, from 1 on, times a power of ten."""
    power = math.floor(math.log10(value))
    sides = (float(f"{part}e{power + more}") for more in (0, 1) for part in parts)
    return next(one for one in sides if one >= value * (1 - _NOISE))


def number(value: float | None, digits: int = 3) -> str:
    """Format a number to `digits` significant digits, integer parts in full, thousands separated.

    None, NaN and −inf become a dash, inf "no limit".
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
    """Format a number with its unit; a dash or "no limit" has none."""
    text = number(value, digits)
    return f"{text} {unit}" if text[-1].isdigit() else text


def length(metres: float | None) -> str:
    """Format a length in mm, m or km."""
    if metres is None or not math.isfinite(metres):
        return number(metres)
    if abs(metres) >= 9999.5:
        return quantity(metres / 1e3, "km")
    if 0.0 < abs(metres) < 0.0995:
        return quantity(metres * 1e3, "mm", 2)
    return quantity(metres, "m", 4 if abs(metres) >= 999.5 else 3)


def degrees(radians: float | None) -> str:
    """Format an angle to a tenth of a degree."""
    if radians is None or not math.isfinite(radians):
        return number(radians)
    return f"{math.degrees(radians) + 0.0:.1f}°".replace("-", "−").replace("−0.0", "0.0")


def share(value: float | None) -> str:
    """Format a share in per cent; 0 % and 100 % stand for exactly none and all."""
    if value is None or not math.isfinite(value):
        return number(value)
    per_cent = 100.0 * value
    if 0.0 < per_cent < 0.1:
        return "<0.1 %"
    if 99.9 < per_cent < 100.0:
        return ">99.9 %"
    return quantity(per_cent, "%").replace("100.0", "100")


def duration(seconds: float | None) -> str:
    """Format a duration in s, in min and s, or in h and min."""
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
    """Format an energy in J, Wh or kWh; a dash for None, NaN and infinity."""
    if joules is None or not math.isfinite(joules):
        return NOTHING
    if abs(joules) < 3600.0:
        return quantity(joules, "J")
    hours = joules / 3600.0
    return quantity(hours / 1e3, "kWh") if abs(hours) >= 1e4 else quantity(hours, "Wh")


def metres(metres: float) -> str:
    """Format a length for sentences: to three digits, or to 1 m from 1 km on."""
    return f"{metres:.3g} m" if abs(metres) < 1000 else f"{metres:,.0f} m"


def full(value: float) -> str:
    """Format a coordinate with up to twelve significant digits."""
    return f"{value + 0.0:.12g}".replace("-", "−")


def coordinates(values: Iterable[float]) -> str:
    """Format coordinates for a command line, separated by spaces."""
    return " ".join(f"{value:.12g}" for value in values)


def place(values: Iterable[float]) -> str:
    """Format a place for a command line: X Y, or X Y,Z with a height."""
    x, *others = (f"{value:.12g}" for value in values)
    return f"{x} {','.join(others)}"


def located(values: Iterable[float], step: float, least: int = 6) -> str:
    """Format coordinates to a hundredth of a step, or to some digits where these say more.

    Args:
        values: coordinates, in the unit of the step.
        step: length above 0 that tells places apart, such as the side of a pixel.
        least: fewest significant digits.
    """
    places = max(0, 2 - math.floor(math.log10(step)))
    texts = []
    for value in values:
        whole = len(f"{abs(value):.0f}") if abs(value) >= 1.0 else 0
        texts.append(f"{value + 0.0:.{min(max(least, whole + places), 15)}g}")
    return " ".join(texts)


def pixels(width: int, height: int, side: float) -> str:
    """Format the number of pixels along x and y and the side of a pixel, m."""
    return f"{width} × {height} pixels of {side:.4g} m"


def per_cent(share: float, digits: int = 3) -> str:
    """Format a share in per cent to `digits` significant digits."""
    return f"{100.0 * share:.{digits}g} %"


def tenths(share: float) -> str:
    """Format a share in per cent to a tenth."""
    return f"{share:.1%}"


def never_quite(share: float) -> str:
    """Format a share in per cent to a tenth, without rounding to 0 or 100: "less than 0.1 %"."""
    text = f"{100.0 * share:.1f}"
    if 0.0 < share < 1.0 and text in ("0.0", "100.0"):
        return "less than 0.1 %" if share < 0.5 else "more than 99.9 %"
    return f"{text} %"


def without_noise(*values: float) -> tuple[float, ...]:
    """Numbers of which those that only rounding has made, against the largest, are 0."""
    least = _NOISE * max(map(abs, values), default=0.0)
    return tuple(value if abs(value) > least else 0.0 for value in values)


def exact(value: float | None) -> float | None:
    """Round a number for programs to twelve digits; None for one that is not finite.

    This removes digits that come from conversion of units alone.
    """
    return float(f"{value:.12g}") if value is not None and math.isfinite(value) else None
