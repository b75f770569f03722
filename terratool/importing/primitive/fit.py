"""Fitting curves to a patch: their number of values, their values, and the angle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from terratool.importing.primitive import products
from terratool.importing.primitive.products import REACH, Floats, Patch, Points, ProductSum, nodes
from terratool.kernels import importing as kernels

_LIGHT = 1e-11
"""Weight of differences between neighbouring values, which decides where no pixel does."""

_FIRST_DAMPING = 1e-3
_LEAST_DAMPING = 1e-12
_MOST_DAMPING = 1e6
"""Damping at which least squares end, as no better fit is to be had."""

_FIRM = 1e-9
"""Share of the mean diagonal that damping assumes at least for each entry."""

_ENOUGH = 1e-4
"""Relative decrease of the sum of squares below which least squares end."""

_EXACT = 1e-10
"""Share of the relief below which an error is rounding."""

_STEPS = 12
"""Most steps for each power."""

_LONG = 3.0
"""First step of each power, as a multiple of the step that surely converges."""

_HALVINGS = 10
_LEAST_GAIN = 5e-4
"""Relative decrease of a power's mean below which the next power begins."""

QUICK = (3.0, 5.0, 8.0, 14.0, 30.0)
THOROUGH = (3.0, 5.0, 8.0, 12.0, 20.0, 40.0, 80.0, 160.0, 320.0)
FURTHER = (20.0, 40.0, 80.0, 160.0, 320.0)
"""Powers of residuals: for comparing, for a final fit, and for continuing a thorough fit."""

SLACK = 1.05
"""Largest ratio of an error to the smallest one for which fewer values are taken."""

EXACT = 1e-6
"""Share of the relief below which an error counts as none."""

_COUNTS = (*range(1, 18), 21, 25, 33, 41, 49, 65)
_VALUES, _FEWEST = 320, 17
"""Most values of all terms along a side, and the number of values that each may have at least."""

_COARSE, _FINE = 64, 128
"""Columns and rows of pixels for choosing the number of values, and for beginning the fit."""

_BLOCKS = 64
"""Blocks along each side; the worst pixel of each joins the fit."""

_JOINS = 4
_NEAR = 1.002
_SHORT, _VAIN, _GAIN = 17, 2, 0.98
"""Number of values beyond which a search ends after `_VAIN` longer curves whose error exceeds
`_GAIN` times the smallest."""

_ANGLES = 9
"""Angles tried at first over 90°; a product turned by 90° is a product again."""

_BEST = 2
"""Number of best angles that are refined to within tenths of a degree; the best one is refined to
within hundredths."""

_CLOSE = 0.2, 0.005
"""Width in degrees of the range at which each of the two refinements ends."""

_FEW, _SOME, _MANY = 64, 96, 256
"""Columns and rows of pixels for trying angles, for refining them, and for the last digits."""

_NODES = 17
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(slots=True)
class FitProblem:
    """Heights at points, and their positions between the nodes of two curves.

    Attributes:
        z: (n,) heights.
        i: (n,) node of x before each point.
        f: (n,) fraction of the way from node i to the next one.
        j: (n,) node of y before each point.
        g: (n,) fraction of the way from node j to the next one.
        relief: highest minus lowest height.
        lowest: least offset allowed.
        highest: greatest offset allowed.
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
    """Return the fitting problem of heights at points for curves with these nodes."""
    i, f = kernels.locate(x_nodes, points.u)
    j, g = kernels.locate(y_nodes, points.v)
    low, high = float(points.z.min()), float(points.z.max())
    relief = high - low
    return FitProblem(points.z, i, f, j, g, relief, low - REACH * relief, high + REACH * relief)


def least_squares(
    problem: FitProblem, terms: ProductSum, steps: int, weights: Floats | None = None
) -> ProductSum:
    """Improve curves and offset by weighted least squares.

    Args:
        problem: the heights.
        terms: fit to begin with.
        steps: most steps of Levenberg and Marquardt, failed ones included.
        weights: (n,) with the sum 1; equal weights if None.
    """
    if weights is None:
        weights = np.full(len(problem.z), 1.0 / len(problem.z))
    size = terms.count * (len(terms.x_nodes) + len(terms.y_nodes)) + 1
    matrix, right = np.empty((size, size)), np.empty(size)
    own, next_one = _stiffness(terms)
    at = np.arange(size)
    damping = _FIRST_DAMPING
    cost = _cost(problem, terms, weights)
    fresh = False
    for _ in range(steps):
        if not fresh:
            kernels.normal_equations(problem, terms, weights, matrix, right)
            scale = float(np.trace(matrix)) / size
            values = np.concatenate([terms.x.ravel(), terms.y.ravel(), [0.0]])
            right -= scale * own * values
            right[:-1] -= scale * next_one * values[1:]
            right[1:] -= scale * next_one * values[:-1]
            matrix[at, at] += scale * own
            matrix[at[:-1], at[1:]] += scale * next_one
            fresh = True
        damped, step = matrix.copy(), right.copy()
        damped[at, at] += damping * (matrix[at, at] + _FIRM * scale)
        better, after = terms, cost
        if kernels.solve(damped, step):
            better = _apply_step(problem, terms, step)
            after = _cost(problem, better, weights)
        if after < cost:
            gained = (cost - after) / cost
            terms, cost, fresh = better, after, False
            damping = max(damping * 0.1, _LEAST_DAMPING)
            if gained < _ENOUGH:
                break
        else:
            damping *= 10.0
            if damping > _MOST_DAMPING:
                break
        if cost <= (_EXACT * problem.relief) ** 2:
            break
    return terms


def smallest_largest(
    problem: FitProblem, terms: ProductSum, powers: tuple[float, ...]
) -> tuple[ProductSum, float]:
    """Find a fit with a small largest error by least powers, and return it with that error.

    Args:
        problem: the heights.
        terms: fit to begin with.
        powers: powers of the residuals whose sum is minimised in turn, ascending, above 2.

    Returns:
        The best fit met on the way, and its largest error.
    """
    off = kernels.residuals(problem, terms)
    best, worst = _balance(terms, off)
    for power in powers:
        for _ in range(_STEPS):
            if worst <= _EXACT * problem.relief:
                return best, worst
            size = np.abs(off)
            weights = (size / size.max()) ** (power - 2.0)
            target = least_squares(problem, terms, 1, weights / weights.sum())
            terms, off, gained = _towards(problem, terms, target, power, size)
            balanced, largest = _balance(terms, off)
            if largest < worst:
                best, worst = balanced, largest
            if gained < _LEAST_GAIN:
                break
    return best, worst


def _balance(terms: ProductSum, off: Floats) -> tuple[ProductSum, float]:
    """Shift the offset until the largest errors up and down are equal; return terms and error."""
    middle = 0.5 * float(off.max() + off.min())
    return replace(terms, offset=terms.offset + middle), 0.5 * float(off.max() - off.min())


def _towards(
    problem: FitProblem, terms: ProductSum, target: ProductSum, power: float, size: Floats
) -> tuple[ProductSum, Floats, float]:
    """Go towards a target as far as the sum of powers decreases.

    Returns:
        The terms there, their residuals, and the relative decrease of the power's mean.
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
        off = kernels.residuals(problem, tried)
        with np.errstate(over="ignore"):
            after = float(((np.abs(off) / largest) ** power).sum())
        if after < before:
            return tried, off, 1.0 - (after / before) ** (1.0 / power)
        part *= 0.5
    return terms, kernels.residuals(problem, terms), 0.0


def _apply_step(problem: FitProblem, terms: ProductSum, step: Floats) -> ProductSum:
    cut = terms.x.size
    offset = min(max(terms.offset + float(step[-1]), problem.lowest), problem.highest)
    return replace(
        terms,
        x=terms.x + step[:cut].reshape(terms.x.shape),
        y=terms.y + step[cut:-1].reshape(terms.y.shape),
        offset=offset,
    )


def _cost(problem: FitProblem, terms: ProductSum, weights: Floats) -> float:
    off = kernels.residuals(problem, terms)
    # threads of BLAS would wait for each other on a busy machine
    return float(np.einsum("i,i,i", weights, off, off))


def _stiffness(terms: ProductSum) -> tuple[Floats, Floats]:
    """Second differences of node values with a light weight, as a tridiagonal matrix.

    Returns:
        (M,) and (M − 1,): the diagonal of a matrix for all unknowns, and the one beside it.
    """
    size = terms.count * (len(terms.x_nodes) + len(terms.y_nodes)) + 1
    own, next_one = np.zeros(size), np.zeros(size - 1)
    first = 0
    for places in (*[terms.x_nodes] * terms.count, *[terms.y_nodes] * terms.count):
        gaps = np.diff(places)
        pull = np.where(gaps > 0.0, _LIGHT / np.where(gaps > 0.0, gaps, 1.0), 0.0)
        last = first + len(gaps)
        own[first:last] += pull
        own[first + 1 : last + 1] += pull
        next_one[first:last] = -pull
        first = last + 1
    return own, next_one


@dataclass(frozen=True, slots=True)
class CurveForm:
    """Form of the curves to fit.

    Attributes:
        terms: number of products.
        x_steps: positions along x, 0 to 1, of vertical steps.
        y_steps: positions along y, 0 to 1, of vertical steps.
        summed: whether the two curves are added rather than multiplied.
    """

    terms: int = 1
    x_steps: tuple[float, ...] = ()
    y_steps: tuple[float, ...] = ()
    summed: bool = False

    def nodes(self, counts: tuple[int, int]) -> tuple[Floats, Floats]:
        """Return the nodes of curves with `counts` values along x and y."""
        return nodes(counts[0], self.x_steps), nodes(counts[1], self.y_steps)


def fit_terms(patch: Patch, curves: CurveForm, counts: tuple[int, int]) -> tuple[ProductSum, float]:
    """Fit curves of `counts` values to all pixels; return the best and its largest error.

    Pixels in columns and rows are fitted first. Then the worst pixel of each block joins the fit,
    until no pixel is worse than those fitted.
    """
    points = products.points_of(patch, _FINE)
    terms, worst = _fit_points(patch, points, curves, counts, _FINE, THOROUGH)
    if max(patch.values.shape) <= _FINE:
        return terms, worst
    best, least = terms, math.inf
    for _ in range(_JOINS):
        others, largest = _worst(patch, terms)
        if largest < least:
            best, least = terms, largest
        if largest <= max(_NEAR * worst, EXACT * patch.relief):
            break
        points = points.join(others)
        problem = problem_of(points, terms.x_nodes, terms.y_nodes)
        terms, worst = smallest_largest(problem, terms, FURTHER)
    return best, least


def fewest_values(patch: Patch, curves: CurveForm) -> tuple[int, int]:
    """Fewest values along x and y whose error is close to the smallest possible one."""
    rows, columns = patch.values.shape
    points = products.points_of(patch, _COARSE)

    def error(counts: tuple[int, int]) -> float:
        return _fit_points(patch, points, curves, counts, _COARSE, QUICK)[1]

    most = max(min(columns, _COARSE), min(rows, _COARSE))
    most = min(most, max(_FEWEST, _VALUES // curves.terms))
    both = [(min(n, columns), min(n, rows)) for n in _COUNTS if n <= most]
    errors: list[float] = []
    for counts in both:
        errors.append(error(counts))
        if errors[-1] <= EXACT * patch.relief:
            break
        if max(counts) > _SHORT and min(errors[-_VAIN:]) > _GAIN * min(errors[:-_VAIN]):
            break
    limit = max(SLACK * min(errors), EXACT * patch.relief)
    counts = next(n for n, off in zip(both, errors, strict=False) if off <= limit)
    across, along = counts
    along = _fewest(along, lambda n: error((across, n)) <= limit)
    return _fewest(across, lambda n: error((n, along)) <= limit), along


def _fewest(most: int, is_enough: Callable[[int], bool]) -> int:
    """Return the fewest of the numbers of values below `most` that are enough, or `most`.

    A curve of five values is one of nine, but none of seven, so short ones are tried one after the
    other. Of long ones those are that are longer than one which is not enough.
    """
    for n in reversed(_COUNTS):
        if _SHORT < n < most:
            if not is_enough(n):
                return most
            most = n
    return next((n for n in _COUNTS if n < min(most, _SHORT + 1) and is_enough(n)), most)


def _fit_points(
    patch: Patch,
    points: Points,
    curves: CurveForm,
    counts: tuple[int, int],
    most: int,
    powers: tuple[float, ...],
) -> tuple[ProductSum, float]:
    """Fit curves to points, beginning with least squares on a grid for several offsets."""
    x_nodes, y_nodes = curves.nodes(counts)
    problem = problem_of(points, x_nodes, y_nodes)
    if curves.summed:
        begin = ProductSum(
            x_nodes, y_nodes, np.zeros((1, len(x_nodes))), np.zeros((1, len(y_nodes))),
            float(points.z.mean()), summed=True,
        )  # fmt: skip
        terms = least_squares(problem, begin, 5)
        return smallest_largest(problem, terms, powers)
    begins = products.best_sums(products.grid_of(patch, most), x_nodes, y_nodes, curves.terms)
    tried = [
        smallest_largest(problem, least_squares(problem, begin, 20), QUICK) for begin in begins
    ]
    terms, worst = min(tried, key=lambda fit: fit[1])
    if powers == QUICK:
        return terms, worst
    return smallest_largest(problem, terms, powers)


def _worst(patch: Patch, terms: ProductSum) -> tuple[Points, float]:
    """Return the worst pixel of each block, and the largest error."""
    rows, columns = patch.values.shape
    block = math.ceil(max(rows, columns) / _BLOCKS)
    pixels, largest = kernels.worst_pixels(patch.values, patch.affine, terms, block)
    return products.points_at(patch, *np.divmod(pixels, columns)), largest


def center_error(patch: Patch, terms: ProductSum) -> tuple[float, ProductSum]:
    """Return the largest error over all pixels with the best offset, and the terms with it."""
    low, high = kernels.error_range(patch.values, patch.affine, terms)
    return 0.5 * (high - low), replace(terms, offset=terms.offset + 0.5 * (low + high))


def best_turn(patch: Patch, terms: int, counts: tuple[int, int] | None) -> float:
    """Return the turn in degrees, −45 to 45, with the smallest RMS error of the covered pixels.

    Least squares decide, as single pixels count little in them. The turn is good to some hundredths
    of a degree, and has two decimals.

    Args:
        patch: the patch; its own turn is ignored.
        terms: number of products.
        counts: number of values along x and y; 17 each if None.
    """
    rows, columns = patch.values.shape
    across, along = counts or (_NODES, _NODES)
    x_nodes, y_nodes = nodes(min(across, columns)), nodes(min(along, rows))
    step = 90.0 / _ANGLES
    coarse = []
    for n in range(_ANGLES):
        turned = replace(patch, turn=step * (n - _ANGLES // 2))
        points = products.points_of(turned, _FEW)
        if not len(points.z):
            continue
        begin = products.best_sums(products.grid_of(turned, _FEW), x_nodes, y_nodes, terms, 1)[0]
        coarse.append((*_fit_turned(points, begin), turned.turn))
    coarse.sort(key=lambda fit: fit[0])
    fine = [(*_refine(patch, begin, turn, step, 0), begin) for _, begin, turn in coarse[:_BEST]]
    _, turn, begin = min(fine, key=lambda fit: fit[0])
    turn = _refine(patch, begin, turn, 5 * _CLOSE[0], 1)[1]
    return round((turn + 45.0) % 90.0 - 45.0, 2) + 0.0  # no negative zero


def _error_at(
    patch: Patch, begin: ProductSum, ends: tuple[float, float], most: int, turn: float
) -> float:
    """RMS error at a turn, over the pixels that are covered there and at both ends of a range.

    Pixels that come and go would weigh more than a small turn does.
    """
    row, column = products.pick_pixels(patch, most)
    for end in (*ends, turn):
        within = replace(patch, turn=end).covers(row, column)
        row, column = row[within], column[within]
    points = products.points_at(replace(patch, turn=turn), row, column)
    if not len(points.z):
        return math.inf
    return _fit_turned(points, begin)[0]


def _fit_turned(points: Points, begin: ProductSum) -> tuple[float, ProductSum]:
    problem = problem_of(points, begin.x_nodes, begin.y_nodes)
    fit = least_squares(problem, begin, 20)
    return float(np.sqrt(np.mean(kernels.residuals(problem, fit) ** 2))), fit


def _refine(
    patch: Patch, begin: ProductSum, turn: float, reach: float, stage: int
) -> tuple[float, float]:
    """Return the smallest RMS error within `reach` of a turn, and its turn, by golden section."""
    low, high = turn - reach, turn + reach
    error = partial(_error_at, patch, begin, (low, high), (_SOME, _MANY)[stage])
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = error(left), error(right)
    while high - low > _CLOSE[stage]:
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = error(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = error(right)
    return min((at_left, left), (at_right, right))
