"""Conditions on a report, such as `no-go-fraction>0.3`, on which a command is to fail."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from terratool.errors import RequestError
from terratool.text.display import shown
from terratool.traversability.results import Extreme, GroundClass, TraversabilityReport, Verdict

_Value = float | None


@dataclass(frozen=True, slots=True)
class _Figure:
    """A number of a report that may be compared.

    Attributes:
        values: all that there are of it; None where there is one that is not known, or means
            nothing, as the length of a way that there is not.
        needs: what must have been asked for, "map", "route" or "reach"; empty for nothing.
        unit: of the number, for people.
        is_share: whether it lies between 0 and 1.
    """

    values: Callable[[TraversabilityReport], Iterable[_Value]]
    needs: str = ""
    unit: str = ""
    is_share: bool = False


def _value(extreme: Extreme | None) -> _Value:
    return None if extreme is None else extreme.value


def _steepest(report: TraversabilityReport) -> list[_Value]:
    values = [_value(route.steepest) for route in report.routes]
    return [None if value is None else math.degrees(abs(value)) for value in values]


def _sinkage(report: TraversabilityReport) -> list[_Value]:
    """Along the routes; without one that of each surface, where it is known."""
    if report.routes:
        return [_value(route.softest) for route in report.routes]
    return [one.sinkage for one in report.surfaces if one.sinkage is not None]


def _fraction(ground: GroundClass, report: TraversabilityReport) -> list[_Value]:
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
"""What may be compared with a number, by name."""

WORDS = {"no-route": "route", "caution": "", "no-go": "", "unknown": "map"}
"""Conditions that are a word, and what must have been asked for.

`no-route`: a route cannot be driven, or the way back that was asked for. `caution`: the verdict is
not go. `no-go`: it is no-go.
`unknown`: it is unknown, or some of the map is.
"""

_OPERATORS: dict[str, Callable[[float, float], bool]] = {
    ">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le,
}  # fmt: skip
_COMPARISON = re.compile(r"\s*([^<>=!\s]*)\s*([<>=!]+)\s*(\S*)\s*")


@dataclass(frozen=True, slots=True)
class Condition:
    """A word, or a figure compared with a number.

    Attributes:
        text: as it was given.
        name: the word, or the name of the figure.
        comparison: ">", ">=", "<" or "<="; empty for a word.
        limit: what the figure is compared with.
    """

    text: str
    name: str
    comparison: str = ""
    limit: float = 0.0

    @property
    def needs(self) -> str:
        """What must be asked for, "map", "route" or "reach"; empty for nothing."""
        return FIGURES[self.name].needs if self.comparison else WORDS[self.name]

    def held(self, report: TraversabilityReport) -> str:
        """Why it holds, in words; empty where it does not.

        A figure that is not known, as the length of a way that there is not, holds: a limit on it
        is not kept.
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
    """A condition from its text.

    Raises:
        RequestError: it is none; the message says what is wrong with it.
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
        raise _error(text, f"there is no figure {shown(name)}", _hint(name, [*FIGURES]))
    if comparison not in _OPERATORS:
        raise _error(text, f"{comparison} compares nothing", "Write >, >=, < or <=.")
    try:
        limit = float(number)
    except ValueError:
        limit = math.nan
    if not math.isfinite(limit):
        raise _error(text, f"{shown(number)} is no number", f"Write {name}{comparison}0.3, say.")
    if FIGURES[name].is_share and not 0.0 <= limit <= 1.0:
        raise _error(text, f"{name} is a share", "Give a number from 0 to 1.")
    return Condition(text, name, comparison, limit)


def _why(word: str, report: TraversabilityReport) -> str:
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
    return RequestError(f"--fail-on {shown(text)}: {what}.", hint)


def _hint(word: str, known: list[str]) -> str:
    from difflib import get_close_matches

    close = get_close_matches(word, known, 1)
    return f"Did you mean {close[0]}?" if close else f"There is {', '.join(known)}."
