"""The residual of a DEM while structures are subtracted, and the noise of its differences."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.structures import PixelPart, shortest

Floats = NDArray[np.float64]
_Gaps = tuple[NDArray[np.int64], ...]

PRECISION = 1e-3
"""Precision of numbers in the definition, as a share of the error that is allowed."""

SINGLE = 2.0**-22
"""Largest error of a sum of four heights rounded to single precision, as a share of the heights."""

CURVES = 1e-7
"""Largest error of curves compiled to cubics and of sums of doubles, as a share of the relief."""

_SAMPLED = 1 << 16

_WORK, _WORK_OF_A_PIXEL = 1.2e6, 1.0
"""Work of a search: some, and more for each pixel, as the rows of a DEM take."""

_FOUND = 700.0
"""Work that a structure makes later, when its numbers are refined and its curves are written."""

QUIET_SHARE = 0.1
"""Least share of mixed differences that vanish in a DEM of structures."""

DOUBLINGS = 40

SHOWS = 0.02
"""Least share of mixed differences that show a rounding of the heights."""

MOSTLY = 0.98
"""Least share of these differences, and of the heights, that are multiples of the rounding's unit.
"""

FINER = 20.0
"""Least ratio of such a unit to the rounding of floats."""


@dataclass(slots=True)
class SearchWork:
    """Work that a search may do, counted so that it ends alike on every machine.

    Attributes:
        left: work that is left, in units of about a microsecond of a processor.
        found: number of structures found so far.
        told: called with that number at each.
    """

    left: float = math.inf
    found: int = 0
    told: Callable[[int], object] | None = None

    @classmethod
    def beside_rows(cls, pixels: int, told: Callable[[int], object] | None) -> SearchWork:
        """Work that takes no more than about twice as long as the rows of a DEM, and a second."""
        return cls(_WORK + _WORK_OF_A_PIXEL * pixels, told=told)

    @property
    def over(self) -> bool:
        """Whether no work is left."""
        return self.left <= 0.0

    def spend(self, count: float, cost: float) -> None:
        """Take `count` pieces of work that cost so much each."""
        self.left -= count * cost

    def tell(self) -> None:
        """Tell of one more structure."""
        self.found += 1
        self.left -= _FOUND
        if self.told is not None:
            self.told(self.found)


@dataclass(frozen=True, slots=True)
class ResidualLimits:
    """Limits of the parts that are sought.

    Attributes:
        noise: largest error of mixed differences.
        height: least height of a part.
        unusual: whether curves without a name are sought, too.
    """

    noise: float
    height: float
    unusual: bool = False

    @property
    def precision(self) -> float:
        """Largest error of rounded heights in the definition."""
        return PRECISION * self.height


@dataclass(frozen=True, slots=True)
class Residual:
    """Heights and their mixed differences, both changed when parts are subtracted.

    Attributes:
        heights: (rows, columns) float64, NaN for none.
        mixed: (rows − 1, columns − 1) float64, 0 where a height is unknown.
        known: (rows − 1, columns − 1) bool, whether all four heights are known.
        rounding: largest size of `mixed` by rounding alone.
        coarse: whether heights were rounded more coarsely than to floats, which hides curves.
        work: work that the search may do; without end by default.
        pivots: cache of the strongest differences by the pixels that a pivot reaches; cleared by
            each change.
    """

    heights: Floats
    mixed: Floats
    known: NDArray[np.bool_]
    rounding: float
    coarse: bool
    work: SearchWork = field(default_factory=SearchWork)
    pivots: dict[tuple[int, int], tuple[Floats, NDArray[np.int64]]] = field(default_factory=dict)

    def window(self, part: PixelPart) -> tuple[_Gaps, Floats]:
        """Return the gaps at which a part has differences, and these for a scale of 1.

        Rows and columns of gaps without a difference are left out: a box has four gaps.
        """
        rows, columns = self.heights.shape
        (south, dy), (west, dx) = part.y.steps(rows), part.x.steps(columns)
        j, i = np.flatnonzero(dy), np.flatnonzero(dx)
        return np.ix_(south + j, west + i), np.multiply.outer(dy[j], dx[i])

    def subtract(self, part: PixelPart) -> None:
        """Subtract a part."""
        self.pivots.clear()
        gaps, shape = self.window(part)
        self.mixed[gaps] = np.where(self.known[gaps], self.mixed[gaps] - part.scale * shape, 0.0)
        inner = slice(part.y.first, part.y.stop), slice(part.x.first, part.x.stop)
        self.heights[inner] -= part.heights()

    def subtract_values(self, row: int, column: int, values: Floats) -> None:
        """Subtract heights from a window whose south-western pixel is given."""
        self.pivots.clear()
        rows, columns = slice(row, row + len(values)), slice(column, column + values.shape[1])
        self.heights[rows, columns] -= values
        south, west = max(0, row - 1), max(0, column - 1)
        around = self.heights[south : rows.stop + 1, west : columns.stop + 1]
        mixed = np.diff(np.diff(around, axis=1), axis=0)
        inner = slice(south, south + mixed.shape[0]), slice(west, west + mixed.shape[1])
        self.mixed[inner] = np.where(self.known[inner], mixed, 0.0)


def residual_of(heights: Floats, work: SearchWork) -> Residual:
    """Return the residual of a whole DEM, whose search may do some work."""
    heights = np.ascontiguousarray(np.where(np.isfinite(heights), heights, np.nan))
    east = heights[:, 1:] - heights[:, :-1]
    mixed = east[1:] - east[:-1]
    known = np.isfinite(mixed)
    mixed[~known] = 0.0
    fine, unit = rounding_error(heights), quantum(heights, mixed, known)
    return Residual(heights, mixed, known, max(fine, 2.0 * unit), unit > 0.0, work)


def rounding_error(heights: Floats) -> float:
    """Largest size of mixed differences that come from the rounding of heights alone."""
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    largest = max(abs(low), abs(high))
    flat = heights.ravel()
    some = flat[:: max(1, len(flat) // _SAMPLED)]
    single = np.array_equal(some.astype(np.float32).astype(np.float64), some, equal_nan=True)
    if single:
        return max(SINGLE * largest, CURVES * (high - low))
    return CURVES * (high - low) + 1e-15 * largest


def quantum(heights: Floats, mixed: Floats, known: NDArray[np.bool_]) -> float:
    """Return the unit that heights were rounded to, such as 0.01, if it shows; otherwise 0.

    It shows if nearly all heights and differences are multiples of it, and more than a few
    differences are not 0.
    """
    sizes = _some_sizes(mixed, known)
    fine = rounding_error(heights)
    steps = sizes[sizes > FINER * fine]
    if len(steps) < SHOWS * len(sizes) or not len(steps):
        return 0.0
    unit = float(np.median(steps[steps <= 1.5 * steps.min()]))
    unit = shortest(unit, 0.01 * unit)
    flat = heights.ravel()[:: max(1, heights.size // _SAMPLED)]
    for values in (sizes, flat[np.isfinite(flat)]):
        off = np.abs(values - unit * np.rint(values / unit))
        if np.count_nonzero(off <= 2.0 * fine) < MOSTLY * len(values):
            return 0.0
    return unit


def share_within(mixed: Floats, known: NDArray[np.bool_], bound: float) -> float:
    """Share of known mixed differences of at most some size, from a sample."""
    sizes = _some_sizes(mixed, known)
    return float((sizes <= bound).mean()) if len(sizes) else 1.0


def noise_level(residual: Residual) -> float:
    """Largest error of mixed differences, from rounding or noise; inf if there is no clear level.

    Noise ends at the level whose double takes in hardly more differences. That is at about 1.65
    standard deviations, and noise stays within four.
    """
    sizes = _some_sizes(residual.mixed, residual.known)
    if not len(sizes):
        return residual.rounding
    level = residual.rounding
    for doubling in range(DOUBLINGS):
        share, wider = (float((sizes <= bound).mean()) for bound in (level, 2.0 * level))
        if share >= QUIET_SHARE and wider <= 1.1 * share:
            return level if doubling == 0 else 2.5 * level
        level *= 2.0
    return np.inf


def _some_sizes(mixed: Floats, known: NDArray[np.bool_]) -> Floats:
    every = max(1, mixed.size // _SAMPLED) | 1
    return np.asarray(np.abs(mixed.ravel()[::every][known.ravel()[::every]]))
