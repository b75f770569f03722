"""Conditions on a report, such as `no-go-fraction>0.3`, on which a command is to fail."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from terratool.errors import RequestError
from terratool.text.display import quote
from terratool.text.meaning import spelled_like
from terratool.traversability.results import Extreme, GroundClass, TraversabilityReport, Verdict

_Value = float | None
"""A value of a figure; None if unknown or meaningless."""


@dataclass(frozen=True, slots=True)
class _Figure:
    """A number of a report that conditions may compare with a limit.

    Attributes:
        values: all values of the number in a report; None for one that is unknown or meaningless,
            such as the length of a route that was not found.
        needs: the part of the report that has it, "map", "route" or "reach"; empty for every
            report.
        unit: unit of the number, for people.
        is_share: whether the number lies between 0 and 1.
    """

    values: Callable[[TraversabilityReport], Iterable[_Value]]
    needs: str = ""
    unit: str = ""
    is_share: bool = False


def _value(extreme: Extreme | None) -> _Value:
    """The value of an extreme; None for no extreme."""
    return None if extreme is None else extreme.value


def _steepest(report: TraversabilityReport) -> list[_Value]:
    """The steepest slope of each route, degrees, without sign."""
    values = [_value(route.steepest) for route in report.routes]
    return [None if value is None else math.degrees(abs(value)) for value in values]


def _sinkage(report: TraversabilityReport) -> list[_Value]:
    """The deepest sinkage of each route, m; without routes, the known sinkage of each surface."""
    if report.routes:
        return [_value(route.softest) for route in report.routes]
    return [one.sinkage for one in report.surfaces if one.sinkage is not None]


def _fraction(ground: GroundClass, report: TraversabilityReport) -> list[_Value]:
    """The share of a class in the map's ground, from 0 to 1; None without a map."""
    return [report.summary.fraction(ground) if report.summary else None]


FIGURES: dict[str, _Figure] = {
    **{
        f"{ground.label}-fraction": _Figure(partial(_fraction, ground), "map", is_share=True)
        for ground in GroundClass
    },
    "reachable-fraction": _Figure(
        lambda r: [r.reach.share if r.reach else None], "reach", is_share=True
    ),
    "route-length": _Figure(lambda r: [route.length for route in r.routes], "route", " m"),
    "route-time": _Figure(lambda r: [route.time for route in r.routes], "route", " s"),
    "route-energy": _Figure(lambda r: [route.energy for route in r.routes], "route", " J"),
    "least-margin": _Figure(lambda r: [_value(route.tightest) for route in r.routes], "route"),
    "steepest": _Figure(_steepest, "route", "°"),
    "sinkage": _Figure(_sinkage, unit=" m"),
}
"""Figures of a report that conditions may compare, by name."""

WORDS = {"no-route": "route", "caution": "", "no-go": "", "unknown": "map"}
"""Conditions that are a word, and the part of the report that each needs, as `_Figure.needs`.

`no-route`: a route cannot be driven, or the way back that was asked for. `caution`: the verdict is
not go. `no-go`: the verdict is no-go. `unknown`: the verdict is unknown, or some of the map is.
"""

_OPERATORS: dict[str, Callable[[float, float], bool]] = {
    ">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le,
}  # fmt: skip
"""Comparisons of a figure with a limit, by sign."""
_COMPARISON = re.compile(r"\s*([^<>=!\s]*)\s*([<>=!]+)\s*(\S*)\s*")
"""Pattern of a name, a sign and a number."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A word, or a figure compared with a number.

    Attributes:
        text: the condition as the user wrote it.
        name: the word, or the name of the figure.
        comparison: ">", ">=", "<" or "<="; empty for a word.
        limit: the number that the figure is compared with; 0 for a word.
    """

    text: str
    name: str
    comparison: str = ""
    limit: float = 0.0

    @property
    def needs(self) -> str:
        """The part of a report that it needs, "map", "route" or "reach"; empty for every report."""
        return FIGURES[self.name].needs if self.comparison else WORDS[self.name]

    def why_met(self, report: TraversabilityReport) -> str:
        """Say why a report meets the condition; empty where it does not.

        A condition on an unknown figure, such as the length of a route that was not found, is met:
        nothing shows that the limit is kept.
        """
        if not self.comparison:
            return _why(self.name, report)
        figure = FIGURES[self.name]
        compare = _OPERATORS[self.comparison]
        for value in figure.values(report):
            if value is None or math.isnan(value):
                return f"{self.name} is not known"
            if compare(value, self.limit):
                return f"{self.name} is {value:.6g}{figure.unit}"
        return ""


def parse(text: str) -> Condition:
    """Parse a condition, such as `no-go-fraction>0.3`.

    Raises:
        RequestError: the text is no condition; the message says why.
    """
    word = text.strip()
    if word in WORDS:
        return Condition(text, word)
    match = _COMPARISON.fullmatch(text)
    if match is None:
        if word in FIGURES:
            raise _error(text, f"{word} is compared with nothing", f"Write {word}>0.3, say.")
        raise _error(text, "there is no such condition", _hint(word, [*WORDS, *FIGURES]))
    name, comparison, number = match.groups()
    if name in WORDS:
        raise _error(text, f"{name} is compared with nothing", f"Write {name} alone.")
    if name not in FIGURES:
        raise _error(text, f"there is no figure {quote(name)}", _hint(name, [*FIGURES]))
    if comparison not in _OPERATORS:
        raise _error(text, f"{comparison} compares nothing", "Write >, >=, < or <=.")
    try:
        limit = float(number)
    except ValueError:
        limit = math.nan
    if not math.isfinite(limit):
        raise _error(text, f"{quote(number)} is no number", f"Write {name}{comparison}0.3, say.")
    if FIGURES[name].is_share and not 0.0 <= limit <= 1.0:
        raise _error(text, f"{name} is a share", "Give a number from 0 to 1.")
    return Condition(text, name, comparison, limit)


def _why(word: str, report: TraversabilityReport) -> str:
    """Say why a report meets a condition that is a word; empty where it does not."""
    if word == "no-route":
        lost = sum(not route.holds for route in report.routes)
        count = len(report.routes)
        return f"{lost} of {count} routes cannot be driven" if lost else ""
    if word == "unknown":
        part = report.summary.fraction(GroundClass.UNKNOWN) if report.summary else 0.0
        if part:
            return f"unknown-fraction is {part:.6g}"
        return "the verdict is unknown" if report.verdict == Verdict.UNKNOWN else ""
    good = word == "caution" and report.verdict == Verdict.GO
    good |= word == "no-go" and report.verdict != Verdict.NO_GO
    return "" if good else f"the verdict is {report.verdict.label}"


def _error(text: str, what: str, hint: str) -> RequestError:
    """The error for a text that is no condition, for the reason `what`."""
    return RequestError(f"--fail-on {quote(text)}: {what}.", hint)


def _hint(word: str, known: list[str]) -> str:
    """A sentence that names the known word nearest to a word, or all known words."""
    close = spelled_like(word, known, 1)
    return f"Did you mean {close[0]}?" if close else f"There is {', '.join(known)}."


def answerable(texts: Sequence[str], routed: bool, reaching: bool) -> tuple[str, ...]:
    """Conditions on what is asked for: those on routes and on reach need some.

    Args:
        texts: conditions as the user wrote them.
        routed: whether a route or waypoints are asked for.
        reaching: whether a start is given, from which the ground is reached.
    """
    known = {"route": routed, "reach": reaching}
    return tuple(text for text in texts if known.get(parse(text).needs, True))
