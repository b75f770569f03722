"""Rules that a terrain fails on where vehicles are judged on many, beside those on its text."""

from __future__ import annotations

from inspect import cleandoc

from terratool.definition.rules.base import Rule


def _rule(code: str, name: str, manual: str) -> Rule:
    return Rule(code, name, "error", cleandoc(manual))


GATES = (
    _rule(
        "TD101",
        "no-route",
        """A route, or a way back that was asked for, cannot be driven.

        The place is that of the element that bars it, and the message says by which measure.

        To mend: make room there, or ask for another way.""",
    ),
    _rule(
        "TD102",
        "no-start",
        """The vehicle cannot stand at the start or goal of a route, or at --from.

        The message says why, and has a place near there where it can stand and move.

        To mend: make room there, or move the start or goal.""",
    ),
    _rule(
        "TD103",
        "condition",
        """A condition of --fail-on, or of fail-on in the settings, holds.

        To mend: change the ground, or the limit.""",
    ),
    _rule(
        "TD104",
        "refused",
        """What was asked makes no sense on this terrain.

        A route begins or ends outside, say, or the terrain is in degrees.

        To mend: ask for something else of this file, by its pattern in the settings.""",
    ),
    _rule(
        "TD105",
        "broken-off",
        """The judgement ended before it was done, as for want of memory.

        To mend: judge the file by itself, on coarser pixels or fewer threads.""",
    ),
)
"""Rules of `judge_file`, in the order of their codes."""
