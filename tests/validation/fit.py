"""The constants of the rule, found again from the measured wheels.

`python -m tests.validation fit` prints them with what they are worth: the errors of each set, and
of a set that was left out, alone or with its laboratory; and how far the constants move when
points are drawn again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from tests.validation.rule import RULE, Case, Rule
from tests.validation.series import ALL, Array, Points, Series, rms

FITTED = "reach", "rim_friction", "growth"
"""The constants that the data decide, as attributes of `Rule`."""
TOLERANCE = {"reach": 0.01, "rim_friction": 0.005, "growth": 0.005}
"""How far the program's constants may be from the fit: they are its numbers, rounded."""
DRAWS = 200


class Errors(NamedTuple):
    """By how much a rule is above the measurements of a set.

    Attributes:
        angle: of atan(pull/load), degrees.
        depth: logarithm of sinkage over that measured; empty where none was.
        torque: torque over that measured; empty where none was.
    """

    angle: Array
    depth: Array
    torque: Array


def errors(rule: Rule, series: Series) -> Errors:
    """The errors of a rule on a set."""
    points = series.points
    case = series.case(points.load)
    pull, torque = rule.traction(case, points.slip)
    angle = np.degrees(np.arctan(pull / points.load)) - points.angle
    deep = rule.sunk(case, points.slip)
    known, turned = np.isfinite(points.sinkage), np.isfinite(points.torque)
    return Errors(
        angle, np.log(deep / points.sinkage)[known], (torque / points.torque)[turned]
    )  # fmt: skip


class _Pool(NamedTuple):
    """Points of several sets in one; the squares of the weights of a set sum to 1."""

    case: Case
    points: Points
    weight: Array


def _pool(sets: Iterable[Series], drawn: Callable[[Series], Array] | None) -> _Pool:
    cases, points, weights = [], [], []
    for one in sets:
        count = len(one.points.slip)
        pick = np.arange(count) if drawn is None else drawn(one)
        some = Points(*(column[pick] for column in one.points))
        points.append(some)
        cases.append([np.broadcast_to(value, len(pick)) for value in one.case(some.load)])
        weights.append(np.full(len(pick), len(pick) ** -0.5))
    return _Pool(
        Case(*map(np.concatenate, zip(*cases, strict=True))),
        Points(*map(np.concatenate, zip(*points, strict=True))),
        np.concatenate(weights),
    )


def fit(
    sets: Iterable[Series],
    drawn: Callable[[Series], Array] | None = None,
    start: Rule = RULE,
) -> Rule:
    """The constants for which the mean square errors of sets sum to the least.

    Each set counts alike, however many points it has.

    Args:
        sets: the sets.
        drawn: of a set, the indices of the points that count; all where None.
        start: the constants that are not fitted, and where to begin.
    """
    sets = tuple(sets)
    held = _pool(sets, drawn)
    deep = _pool([one for one in sets if one.tells_depth], drawn)

    def pulled(values: Array) -> Array:
        case, points, weight = held
        rule = replace(start, reach=values[0], rim_friction=values[1])
        angle = np.degrees(np.arctan(rule.traction(case, points.slip)[0] / points.load))
        return weight * (angle - points.angle)

    def sunk(values: Array) -> Array:
        case, points, weight = deep
        depth = replace(start, growth=values[0]).sunk(case, points.slip)
        return weight * np.log(depth / points.sinkage)

    scale = [start.reach, start.rim_friction]
    reach, rim = least_squares(pulled, scale, x_scale=scale, bounds=(0.01, np.inf)).x
    (growth,) = least_squares(sunk, [start.growth], bounds=(0.0, np.inf)).x
    return replace(start, reach=reach, rim_friction=rim, growth=growth)


@cache
def fitted() -> Rule:
    """The fit to all sets."""
    return fit(ALL)


@cache
def without(series: Series, *, whole_laboratory: bool) -> Rule:
    """The fit without a set, or without all of its laboratory."""

    def stays(other: Series) -> bool:
        return other.lab != series.lab if whole_laboratory else other is not series

    return fit(filter(stays, ALL))


@cache
def bootstrap(draws: int = DRAWS) -> Array:
    """Fits to points drawn again within each set, (draws, 3), by the order of `FITTED`."""
    chance = np.random.default_rng(1)

    def drawn(series: Series) -> Array:
        count = len(series.points.slip)
        return chance.integers(0, count, count)

    found = [fit(ALL, drawn) for _ in range(draws)]
    return np.array([[getattr(rule, name) for name in FITTED] for rule in found])


def factor(logarithms: Array) -> str:
    """A mean factor and its range."""
    low, middle, high = np.exp([logarithms.min(), logarithms.mean(), logarithms.max()])
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def _columns(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def report() -> str:
    """What `python -m tests.validation fit` prints."""
    ranges = np.percentile(bootstrap(), [5, 95], axis=0).T
    constants = [("constant", "fit", "program", "5 to 95 % of draws")]
    for name, (low, high) in zip(FITTED, ranges, strict=True):
        constants.append((
            name, f"{getattr(fitted(), name):.4f}", f"{getattr(RULE, name):g}",
            f"{low:.3f} to {high:.3f}",
        ))  # fmt: skip
    sets = [("set", "rms", "bias", "left out", "with its laboratory", "sinkage", "torque")]
    for one in ALL:
        now, alone, lab = (
            errors(rule, one)
            for rule in (
                fitted(),
                without(one, whole_laboratory=False),
                without(one, whole_laboratory=True),
            )
        )
        sets.append((
            one.name, f"{rms(now.angle):.1f}", f"{now.angle.mean():+.1f}",
            f"{rms(alone.angle):.1f} {alone.angle.mean():+.1f}",
            f"{rms(lab.angle):.1f} {lab.angle.mean():+.1f}",
            factor(now.depth) if now.depth.size else "-",
            factor(np.log(now.torque)) if now.torque.size else "-",
        ))  # fmt: skip
    return (
        f"{_columns(constants)}\n\n{_columns(sets)}\n\n"
        "Errors in degrees of atan(pull/load): the rule less the measurement.\n"
        "Sinkage and torque: the rule over the measurement, mean and range."
    )
