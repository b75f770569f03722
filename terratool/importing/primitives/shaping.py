"""From a patch to curves: how many values they need, and which ones fit all pixels best."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from terratool.importing.primitives import fitting, rank
from terratool.importing.primitives.terms import Floats, Patch, Points, ProductSum, nodes
from terratool.kernels import importing as kernels

SLACK = 1.05
"""The fewest values are taken whose error is no more than so many times the smallest."""
EXACT = 1e-6
"""An error of this part of the relief is as good as none."""
_COUNTS = (*range(1, 18), 21, 25, 33, 41, 49, 65)
_VALUES, _FEWEST = 320, 17
"""Curves of all terms together have no more values along a side, but as many of each at least."""
_COARSE, _FINE = 64, 128
"""Columns and rows of pixels to choose by, and to begin the fit with."""
_BLOCKS = 64
"""Along each side; the worst pixel of each joins the fit."""
_JOINS = 4
_NEAR = 1.002
_SHORT, _VAIN, _GAIN = 17, 2, 0.98
"""Behind so many values, so many longer curves in vain are enough: that gain less than this."""


@dataclass(frozen=True, slots=True)
class CurveForm:
    """What curves are to be: so many terms, with steps, added or multiplied.

    Attributes:
        terms: how many products.
        x_steps, y_steps: places from 0 to 1 of vertical steps.
        summed: the two curves are added.
    """

    terms: int = 1
    x_steps: tuple[float, ...] = ()
    y_steps: tuple[float, ...] = ()
    summed: bool = False

    def nodes(self, counts: tuple[int, int]) -> tuple[Floats, Floats]:
        """Nodes of curves with so many values each."""
        return nodes(counts[0], self.x_steps), nodes(counts[1], self.y_steps)


def shape(patch: Patch, curves: CurveForm, counts: tuple[int, int]) -> tuple[ProductSum, float]:
    """The curves of so many values that fit all pixels best, and their largest misfit.

    Pixels in columns and rows are fitted first; then the worst of all are added, block by block,
    until none is worse than those that were fitted.
    """
    points = rank.points_of(patch, _FINE)
    terms, worst = _fitted(patch, points, curves, counts, _FINE, fitting.THOROUGH)
    if max(patch.values.shape) <= _FINE:
        return terms, worst
    best, least = terms, math.inf
    for _ in range(_JOINS):
        others, largest = _worst(patch, terms)
        if largest < least:
            best, least = terms, largest
        if largest <= max(_NEAR * worst, EXACT * relief_of(patch)):
            break
        points = Points(*(
            np.concatenate([getattr(points, name), getattr(others, name)]) for name in "uvz"
        ))  # fmt: skip
        problem = fitting.problem_of(points, terms.x_nodes, terms.y_nodes)
        terms, worst = fitting.smallest_largest(problem, terms, fitting.FURTHER)
    return best, least


def fewest(patch: Patch, curves: CurveForm) -> tuple[int, int]:
    """How many values x and y need, for an error close to the smallest that is possible."""
    rows, columns = patch.values.shape
    points = rank.points_of(patch, _COARSE)

    def error(counts: tuple[int, int]) -> float:
        return _fitted(patch, points, curves, counts, _COARSE, fitting.QUICK)[1]

    most = max(min(columns, _COARSE), min(rows, _COARSE))
    most = min(most, max(_FEWEST, _VALUES // curves.terms))
    both = [(min(n, columns), min(n, rows)) for n in _COUNTS if n <= most]
    errors: list[float] = []
    for counts in both:
        errors.append(error(counts))
        if errors[-1] <= EXACT * relief_of(patch):
            break
        if max(counts) > _SHORT and min(errors[-_VAIN:]) > _GAIN * min(errors[:-_VAIN]):
            break
    limit = max(SLACK * min(errors), EXACT * relief_of(patch))
    counts = next(n for n, off in zip(both, errors, strict=False) if off <= limit)
    for axis in (1, 0):
        counts = _shortened(counts, axis, limit, error)
    return counts


def _shortened(
    counts: tuple[int, int], axis: int, limit: float, error: Callable[[tuple[int, int]], float]
) -> tuple[int, int]:
    """The fewest values of one curve for which the error stays below a limit."""
    # one after the other: a curve of five values is one of nine, but none of seven
    for n in [n for n in _COUNTS if n < counts[axis]]:
        fewer = (n, counts[1]) if axis == 0 else (counts[0], n)
        if error(fewer) <= limit:
            return fewer
    return counts


def _fitted(
    patch: Patch,
    points: Points,
    curves: CurveForm,
    counts: tuple[int, int],
    most: int,
    powers: tuple[float, ...],
) -> tuple[ProductSum, float]:
    """A fit to points that begins with what least squares on a grid say for several offsets."""
    x_nodes, y_nodes = curves.nodes(counts)
    problem = fitting.problem_of(points, x_nodes, y_nodes)
    even = np.full(len(points.z), 1.0 / len(points.z))
    if curves.summed:
        begin = ProductSum(
            x_nodes, y_nodes, np.zeros((1, len(x_nodes))), np.zeros((1, len(y_nodes))),
            float(points.z.mean()), summed=True,
        )  # fmt: skip
        terms = fitting.least_squares(problem, begin, even, 5)
        return fitting.smallest_largest(problem, terms, powers)
    begins = rank.fits(rank.grid_of(patch, most), x_nodes, y_nodes, curves.terms)
    tried = [
        fitting.smallest_largest(
            problem, fitting.least_squares(problem, begin, even, 20), fitting.QUICK
        )
        for begin in begins
    ]
    terms, worst = min(tried, key=lambda fit: fit[1])
    if powers == fitting.QUICK:
        return terms, worst
    return fitting.smallest_largest(problem, terms, powers)


def _worst(patch: Patch, terms: ProductSum) -> tuple[Points, float]:
    """The pixel of each block that is fitted worst, and the largest misfit."""
    rows, columns = patch.values.shape
    block = math.ceil(max(rows, columns) / _BLOCKS)
    pixels, largest = kernels.worst_pixels(patch.values, patch.affine, terms, block)
    row, column = np.divmod(pixels, columns)
    return rank.points_at(patch, row, column), largest


def relief_of(patch: Patch) -> float:
    """Highest minus lowest height."""
    return float(np.nanmax(patch.values) - np.nanmin(patch.values))


def balanced(patch: Patch, terms: ProductSum) -> tuple[float, ProductSum]:
    """The largest misfit of all pixels with the offset that makes it smallest, and such terms."""
    low, high = kernels.error_range(patch.values, patch.affine, terms)
    return 0.5 * (high - low), replace(terms, offset=terms.offset + 0.5 * (low + high))
