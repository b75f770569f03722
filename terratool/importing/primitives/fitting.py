"""A few products of curves, fitted to scattered heights for the smallest largest misfit.

Curves and offset together are fitted by the method of Levenberg and Marquardt to weighted squares.
Weights |misfit|ᵖ⁻² with growing p lead from least squares to the smallest largest misfit (Lawson
1961), in steps of 1 / (p − 1), which makes them converge (Kahng 1972); the best on the way is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terratool.importing.primitives.rank import REACH
from terratool.importing.primitives.terms import Floats, Points, ProductSum
from terratool.kernels import importing as kernels

_LIGHT = 1e-11
"""Weight of differences between neighbouring values: it decides where no pixel does."""
_DAMPING = 1e-3, 1e-12, 1e6
"""At first, at least, and where no better fit is to be had."""
_FIRM = 1e-9
"""Part of the mean diagonal that damping takes for the least of it."""
_ENOUGH = 1e-4
"""Squares that become smaller by less than this part are as small as they get."""
_EXACT = 1e-10
"""Misfits of this part of the relief are rounding."""
_STEPS = 12
"""So many steps for each power."""
_LONG = 3.0
"""First steps are so many times those that surely converge."""
_HALVINGS = 10
_GAIN = 5e-4
"""A power is left for the next one when its mean becomes smaller by less than this part."""
QUICK = (3.0, 5.0, 8.0, 14.0, 30.0)
THOROUGH = (3.0, 5.0, 8.0, 12.0, 20.0, 40.0, 80.0, 160.0, 320.0)
FURTHER = (20.0, 40.0, 80.0, 160.0, 320.0)
"""Powers of misfits: to compare, to be content with, and to go on from a thorough fit."""


@dataclass(slots=True)
class FitProblem:
    """Points between the nodes of two curves.

    Attributes:
        i, f, j, g: (n,) the node before each point and how far it is on the way to the next one.
        lowest, highest: offsets that are allowed.
    """

    z: Floats
    i: NDArray[np.int64]
    f: Floats
    j: NDArray[np.int64]
    g: Floats
    relief: float
    lowest: float
    highest: float


def problem_of(points: Points, x_nodes: Floats, y_nodes: Floats) -> FitProblem:
    """Heights at points as a problem for curves with these nodes."""
    i, f = kernels.locate(x_nodes, points.u)
    j, g = kernels.locate(y_nodes, points.v)
    low, high = float(points.z.min()), float(points.z.max())
    relief = high - low
    return FitProblem(points.z, i, f, j, g, relief, low - REACH * relief, high + REACH * relief)


def residuals(problem: FitProblem, terms: ProductSum) -> Floats:
    """(n,) heights minus the fit."""
    return kernels.residuals(problem, terms)


def least_squares(
    problem: FitProblem, terms: ProductSum, weights: Floats, steps: int
) -> ProductSum:
    """Better curves and offset by weighted squares, in no more than so many steps.

    Args:
        problem: the heights.
        terms: where to begin.
        weights: (n,), their sum is 1.
        steps: of Levenberg and Marquardt, those in vain included.
    """
    p, q, count = len(terms.x_nodes), len(terms.y_nodes), terms.count
    size = count * (p + q) + 1
    matrix, right = np.empty((size, size)), np.empty(size)
    own, next_one = _stiffness(terms)
    at = np.arange(size)
    damping, least, most = _DAMPING
    cost = _cost(problem, terms, weights)
    fresh = False
    for _ in range(steps):
        if not fresh:
            kernels.normal_equations(problem, terms, weights, matrix, right)
            scale = float(np.trace(matrix)) / size
            values = _packed(terms)
            right -= scale * own * values
            right[:-1] -= scale * next_one * values[1:]
            right[1:] -= scale * next_one * values[:-1]
            matrix[at, at] += scale * own
            matrix[at[:-1], at[1:]] += scale * next_one
            fresh = True
        damped, step = matrix.copy(), right.copy()
        damped[at, at] += damping * (matrix[at, at] + _FIRM * scale)
        better = terms
        after = cost
        if kernels.solve(damped, step):
            better = _moved(problem, terms, step)
            after = _cost(problem, better, weights)
        if after < cost:
            gained = (cost - after) / cost
            terms, cost, fresh = better, after, False
            damping = max(damping * 0.1, least)
            if gained < _ENOUGH:
                break
        else:
            damping *= 10.0
            if damping > most:
                break
        if cost <= (_EXACT * problem.relief) ** 2:
            break
    return terms


def smallest_largest(
    problem: FitProblem, terms: ProductSum, powers: tuple[float, ...]
) -> tuple[ProductSum, float]:
    """The fit with the smallest largest misfit that is met on the way through some powers.

    Args:
        problem: the heights.
        terms: where to begin.
        powers: of the misfits whose sum is made small, ascending, above 2.

    Returns:
        The fit, and its largest misfit.
    """
    off = residuals(problem, terms)
    best, worst = _balanced(terms, off)
    for power in powers:
        for _ in range(_STEPS):
            if worst <= _EXACT * problem.relief:
                return best, worst
            size = np.abs(off)
            weights = (size / size.max()) ** (power - 2.0)
            target = least_squares(problem, terms, weights / weights.sum(), 1)
            terms, moved, gained = _towards(problem, terms, target, power, size)
            off = moved
            balanced, largest = _balanced(terms, off)
            if largest < worst:
                best, worst = balanced, largest
            if gained < _GAIN:
                break
    return best, worst


def _balanced(terms: ProductSum, off: Floats) -> tuple[ProductSum, float]:
    """The same with the offset for which the largest misfits up and down are equal, and those."""
    middle = 0.5 * float(off.max() + off.min())
    return replace(terms, offset=terms.offset + middle), 0.5 * float(off.max() - off.min())


def _towards(
    problem: FitProblem, terms: ProductSum, target: ProductSum, power: float, size: Floats
) -> tuple[ProductSum, Floats, float]:
    """As far towards a target as the powers' sum becomes smaller.

    Returns:
        The terms there, their misfits, and by what part the power's mean became smaller.
    """
    largest = float(size.max())
    before = float(((size / largest) ** power).sum())
    part = min(1.0, _LONG / (power - 1.0))
    for _ in range(_HALVINGS):
        tried = replace(
            terms,
            x=terms.x + part * (target.x - terms.x),
            y=terms.y + part * (target.y - terms.y),
            offset=terms.offset + part * (target.offset - terms.offset),
        )
        off = residuals(problem, tried)
        with np.errstate(over="ignore"):
            after = float(((np.abs(off) / largest) ** power).sum())
        if after < before:
            return tried, off, 1.0 - (after / before) ** (1.0 / power)
        part *= 0.5
    return terms, residuals(problem, terms), 0.0


def _packed(terms: ProductSum) -> Floats:
    return np.concatenate([terms.x.ravel(), terms.y.ravel(), [0.0]])


def _moved(problem: FitProblem, terms: ProductSum, step: Floats) -> ProductSum:
    cut = terms.x.size
    offset = min(max(terms.offset + float(step[-1]), problem.lowest), problem.highest)
    return replace(
        terms,
        x=terms.x + step[:cut].reshape(terms.x.shape),
        y=terms.y + step[cut:-1].reshape(terms.y.shape),
        offset=offset,
    )


def _cost(problem: FitProblem, terms: ProductSum, weights: Floats) -> float:
    off = residuals(problem, terms)
    return float(weights @ (off * off))


def _stiffness(terms: ProductSum) -> tuple[Floats, Floats]:
    """Squares of differences between values of neighbouring nodes, times a light weight.

    Returns:
        (M,) and (M − 1,): the diagonal of a matrix for all unknowns, and the one beside it.
    """
    size = terms.count * (len(terms.x_nodes) + len(terms.y_nodes)) + 1
    own, next_one = np.zeros(size), np.zeros(size - 1)
    first = 0
    for nodes in (*[terms.x_nodes] * terms.count, *[terms.y_nodes] * terms.count):
        gaps = np.diff(nodes)
        pull = np.where(gaps > 0.0, _LIGHT / np.where(gaps > 0.0, gaps, 1.0), 0.0)
        last = first + len(gaps)
        own[first:last] += pull
        own[first + 1 : last + 1] += pull
        next_one[first:last] = -pull
        first = last + 1
    return own, next_one
