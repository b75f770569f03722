"""Numbers for people: so many digits, a unit, and a dash for what is not known."""

from __future__ import annotations

import math
from collections.abc import Iterable

NOTHING = "–"
"""Stands for what means nothing or is not known."""


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


def metres(metres: float) -> str:
    """A length in words, to three digits, or to a metre from a kilometre on."""
    return f"{metres:.3g} m" if abs(metres) < 1000 else f"{metres:,.0f} m"


def full(value: float) -> str:
    """A coordinate in full, up to twelve digits."""
    return f"{value + 0.0:.12g}".replace("-", "−")


def spelled(values: Iterable[float]) -> str:
    """Coordinates in full with spaces between, as commands take them."""
    return " ".join(f"{value:.12g}" for value in values)


def pixels(width: int, height: int, side: float) -> str:
    """Number of pixels along x and y, and the side of one, m."""
    return f"{width} × {height} pixels of {side:.4g} m"


def per_cent(share: float, digits: int = 3) -> str:
    """A share in per cent to so many significant digits."""
    return f"{100.0 * share:.{digits}g} %"


def tenths(share: float) -> str:
    """A share in per cent to a tenth."""
    return f"{share:.1%}"


def never_quite(share: float) -> str:
    """A share in per cent to a tenth, in words where that would be none, or all, and it is not."""
    text = f"{100.0 * share:.1f}"
    if 0.0 < share < 1.0 and text in ("0.0", "100.0"):
        return "less than 0.1 %" if share < 0.5 else "more than 99.9 %"
    return f"{text} %"


def exact(value: float | None) -> float | None:
    """A number for programs, to twelve digits; None for what is not finite.

    So no digits stand there that only come from factors of units.
    """
    return float(f"{value:.12g}") if value is not None and math.isfinite(value) else None
