"""Counts and lists in words."""

from __future__ import annotations

from collections.abc import Sequence


def count_of(count: int, noun: str) -> str:
    """Format a count with its noun: 1 file, 2,000 files, 3 libraries, 4 boxes."""
    plural = "es" if noun.endswith(("x", "sh")) else "s"
    many = f"{noun[:-1]}ies" if noun.endswith("ry") else f"{noun}{plural}"
    return f"{count:,} {noun if count == 1 else many}"


def many(count: int) -> str:
    """Format a whole number of any size: 2,000, or about 10^450."""
    return f"{count:,}" if count < 10**30 else f"about 10^{round(count.bit_length() * 0.30103)}"


def join_words(words: Sequence[str]) -> str:
    """List words with commas and "and"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if words[1:] else "".join(words)
