"""The angle at which products of two curves fit a patch best."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from terratool.importing.primitives import fitting, rank
from terratool.importing.primitives.terms import Patch, Points, ProductSum, nodes

_COARSE = 9
"""Angles that are tried at first; a product turned by 90° is a product again."""
_BEST = 2
"""So many of them are refined, to within some tenths, and the best to within hundredths."""
_CLOSE = 0.2, 0.005
_FEW, _SOME, _MANY = 64, 96, 256
"""Columns and rows of pixels for trying, for refining, and for the last digits."""
_VALUES = 17
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


def best_turn(patch: Patch, terms: int, counts: tuple[int, int] | None) -> float:
    """The turn in degrees, from −45 to 45, with the smallest RMS misfit of the pixels it covers.

    Least squares decide, as single pixels count little for them; the turn is good to some
    hundredths of a degree, and has two decimals.

    Args:
        patch: its own turn counts for nothing.
        terms: how many products.
        counts: how many values x and y have; 17, if not said.
    """
    rows, columns = patch.values.shape
    across, along = counts or (_VALUES, _VALUES)
    x_nodes, y_nodes = nodes(min(across, columns)), nodes(min(along, rows))
    step = 90.0 / _COARSE
    coarse = []
    for n in range(_COARSE):
        turned = replace(patch, turn=step * (n - _COARSE // 2))
        points = rank.points_of(turned, _FEW)
        if not len(points.z):
            continue
        begin = rank.fits(rank.grid_of(turned, _FEW), x_nodes, y_nodes, terms, 1)[0]
        coarse.append((*_turned_fit(points, begin), turned.turn))
    coarse.sort(key=lambda fit: fit[0])
    fine = []
    for _, begin, turn in coarse[:_BEST]:
        fine.append((*_refined(patch, begin, turn, step, 0), begin))
    _, turn, begin = min(fine, key=lambda fit: fit[0])
    turn = _refined(patch, begin, turn, 5 * _CLOSE[0], 1)[1]
    return round((turn + 45.0) % 90.0 - 45.0, 2) + 0.0  # no negative zero


def _misfit(
    patch: Patch, begin: ProductSum, ends: tuple[float, float], most: int, turn: float
) -> float:
    """RMS misfit at a turn, of the pixels that are covered there and at both ends.

    Pixels that come and go would count for more than a small turn does.
    """
    row, column = rank.picked(patch, most)
    for end in (*ends, turn):
        u, v = replace(patch, turn=end).unit(row, column)
        within = (abs(u - 0.5) <= 0.5) & (abs(v - 0.5) <= 0.5)
        row, column = row[within], column[within]
    points = rank.points_at(replace(patch, turn=turn), row, column)
    if not len(points.z):
        return math.inf
    return _turned_fit(points, begin)[0]


def _turned_fit(points: Points, begin: ProductSum) -> tuple[float, ProductSum]:
    problem = fitting.problem_of(points, begin.x_nodes, begin.y_nodes)
    even = np.full(len(points.z), 1.0 / len(points.z))
    fit = fitting.least_squares(problem, begin, even, 20)
    return float(np.sqrt(np.mean(fitting.residuals(problem, fit) ** 2))), fit


def _refined(
    patch: Patch, begin: ProductSum, turn: float, reach: float, stage: int
) -> tuple[float, float]:
    """The smallest misfit within `reach` of a turn and where it is, by golden sections."""
    low, high = turn - reach, turn + reach
    misfit = partial(_misfit, patch, begin, (low, high), (_SOME, _MANY)[stage])
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = misfit(left), misfit(right)
    while high - low > _CLOSE[stage]:
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = misfit(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = misfit(right)
    return min((at_left, left), (at_right, right))
