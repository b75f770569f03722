"""Numbers spelled in ASCII alone, which is stricter than Python.

`float` and `int` accept digits of all scripts, and underscores between them; `str.isdigit` is true
of superscripts, which `int` refuses; and `int` raises on thousands of digits.
"""

from __future__ import annotations

_MOST_DIGITS = 18
"""Most digits of a whole number that always fits into 64 bits."""


def parse_number(text: str) -> float | None:
    """Return the number that a text spells, maybe NaN or infinite; None if it spells none."""
    if not text.isascii() or "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def parse_whole(text: str) -> int | None:
    """Return the whole number from 0 on that up to 18 digits spell; None if the text is no such."""
    digits = text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS
    return int(text) if digits else None
