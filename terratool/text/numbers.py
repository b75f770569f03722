"""Numbers as texts spell them, in ASCII alone: Python itself takes more for one.

`float` and `int` take digits of all scripts, and underscores between them; `str.isdigit` is true of
superscripts, of which `int` makes nothing; and `int` raises on thousands of digits.
"""

from __future__ import annotations

_MOST_DIGITS = 18
"""Whole numbers of so many fit into 64 bits."""


def parse_number(text: str) -> float | None:
    """The number that a text is, which may be NaN or infinite; None where it is none."""
    if not text.isascii() or "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def parse_whole(text: str) -> int | None:
    """The whole number from 0 on that a text is, of up to 18 digits; None where it is none."""
    digits = text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS
    return int(text) if digits else None
