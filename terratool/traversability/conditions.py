"""Conditions on a report, such as `no-go-fraction>0.3`, on which a command is to fail."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from terratool.errors import RequestError
from terratool.text.display import quote
from terratool.text.meaning import spelled_like
from terratool.traversability.report.wording import coordinates, ends
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.results import Extreme, Route
from terratool.traversability.verdicts import GroundClass, Verdict

_Found = tuple[float | None, str]
"""A value of a figure, None if unknown or meaningless, and words on where it is."""


@dataclass(frozen=True, slots=True)
class _Figure:
    """A number of a report that conditions may compare with a limit.

    Attributes:
        values: all values of the number in a report, with words on where they are.
        needs: the part of the report that has it, "map", "route" or "reach"; empty for every
            report.
        unit: unit of the number, for people.
        is_share: whether the number lies between 0 and 1.
    """

    values: Callable[[TraversabilityReport], Iterable[_Found]]
    needs: str = ""
    unit: str = ""
    is_share: bool = False


def _along(take: Callable[[Route], Extreme | float | None]) -> Callable[..., Iterator[_Found]]:
    """Function that yields a figure of each route of a report, with the route and its place.

    A route that cannot be driven fails by itself: what is not known of it is left out.
    """

    def values(report: TraversabilityReport) -> Iterator[_Found]:
        for route in report.routes:
            found = take(route)
            where = f" on the way from {ends(route)}"
            if isinstance(found, Extreme):
                yield found.value, f"{where}, at {coordinates(found.place)}"
            elif found is not None or route.holds:
                yield found, where

    return values


def _steepest(route: Route) -> Extreme | None:
    """The steepest slope of a route, degrees, without sign."""
    if (most := route.steepest) is None:
        return None
    return replace(most, value=math.degrees(abs(most.value)))


_softest = _along(lambda route: route.softest)


def _sinkage(report: TraversabilityReport) -> Iterator[_Found]:
    """The deepest sinkage of each route, m; without routes, the known sinkage of each surface."""
    if report.routes:
        yield from _softest(report)
        return
    for one in report.surfaces:
        if one.sinkage is not None:
            yield one.sinkage, f" on {quote(one.surface)}"


def _fraction(ground: GroundClass, report: TraversabilityReport) -> list[_Found]:
    """The share of a class in the map's ground, from 0 to 1; None without a map."""
    return [(report.summary.fraction(ground) if report.summary else None, "")]


FIGURES: dict[str, _Figure] = {
    **{
        f"{ground.label}-fraction": _Figure(partial(_fraction, ground), "map", is_share=True)
        for ground in GroundClass
    },
    "reachable-fraction": _Figure(
        lambda r: [(r.reach.share if r.reach else None, "")], "reach", is_share=True
    ),
    "route-length": _Figure(_along(lambda route: route.length), "route", " m"),
    "route-time": _Figure(_along(lambda route: route.time), "route", " s"),
    "charge": _Figure(_along(lambda route: route.charge.share if route.charge else None), "route"),
    "route-energy": _Figure(_along(lambda route: route.energy), "route", " J"),
    "least-margin": _Figure(_along(lambda route: route.tightest), "route"),
    "drift": _Figure(_along(lambda route: route.drift), "route", " m"),
    "steepest": _Figure(_along(_steepest), "route", "°"),
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

        A condition on an unknown figure is met: nothing shows that the limit is kept. Figures of a
        route that was not found do not count, as that fails by itself.
        """
        if not self.comparison:
            return _why(self.name, report)
        figure = FIGURES[self.name]
        compare = _OPERATORS[self.comparison]
        for value, where in figure.values(report):
            if value is None or math.isnan(value):
                return f"{self.name} is not known{where}"
            if compare(value, self.limit):
                return f"{self.name} is {value:.6g}{figure.unit}{where}"
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
