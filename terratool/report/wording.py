"""Counts and lists in words."""

from __future__ import annotations

from collections.abc import Sequence


def count_of(count: int, noun: str) -> str:
    """Format a count with its noun: 1 file, 2,000 files, 3 libraries, 4 boxes."""
    plural = "es" if noun.endswith(("x", "sh", "ch")) else "s"
    many = f"{noun[:-1]}ies" if noun.endswith("ry") else f"{noun}{plural}"
    return f"{count:,} {noun if count == 1 else many}"


def many(count: int) -> str:
    """Format a whole number of any size: 2,000, or about 10^450."""
    return f"{count:,}" if count < 10**30 else f"about 10^{round(count.bit_length() * 0.30103)}"


def join_words(words: Sequence[str]) -> str:
    """List words with commas and "and"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if words[1:] else "".join(words)


def decks_and_bores(decks: int, bores: int) -> str:
    """Format numbers of decks and bores, not both 0: 2 decks and 1 bore."""
    counts = {"deck": decks, "bore": bores}
    return join_words([count_of(count, noun) for noun, count in counts.items() if count])


def hidden_storeys(decks: int, bores: int, of: str = "") -> str:
    """Sentence on decks and bores that are not shown.

    Args:
        decks: number of decks.
        bores: number of bores.
        of: name of the terrain; empty where it is clear.
    """
    verb, them = ("is", "it") if decks + bores == 1 else ("are", "them")
    said = decks_and_bores(decks, bores) + f" of {of}" * bool(of)
    return f"{said} {verb} not shown: this is the ground without {them}."
