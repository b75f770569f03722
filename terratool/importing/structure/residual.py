"""What is left of a DEM while structures are taken away, and how far that may be off."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.structures import PixelPart, shortest

Floats = NDArray[np.float64]

PRECISION = 1e-3
"""Numbers are rounded to this share of the error that is allowed."""

SINGLE = 2.0**-22
"""The error that four heights rounded to single precision can make together, in heights."""

CURVES = 1e-7
"""What curves compiled to cubics, and sums of doubles, may be off, in relief."""

_SAMPLED = 1 << 16

QUIET_SHARE = 0.1
"""A DEM of structures has at least so many mixed differences that vanish."""

DOUBLINGS = 40

SHOWS = 0.02
"""So many mixed differences show that heights were rounded, at least."""

MOSTLY = 0.98
"""So many of those, and of the heights, are multiples of what heights were rounded to."""

FINER = 20.0
"""That is so much larger than the rounding of floats."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What counts.

    Attributes:
        noise: how far mixed differences may be off.
        height: parts that are lower are not wanted.
        unusual: whether curves without a name are wanted, too.
    """

    noise: float
    height: float
    unusual: bool = False

    @property
    def precision(self) -> float:
        """How far heights may be rounded in the definition."""
        return PRECISION * self.height


@dataclass(frozen=True, slots=True)
class Residual:
    """Heights and their mixed differences, both changed as parts are taken away.

    Attributes:
        heights: (rows, columns) float64, NaN for none.
        mixed: (rows − 1, columns − 1) float64, 0 where a height is unknown.
        known: where `mixed` is known, bool.
        rounding: how large `mixed` may be by rounding alone.
        coarse: whether heights were rounded to more than floats are, so that curves are lost in it.
        pivots: what is known of the strongest differences, until these change.
    """

    heights: Floats
    mixed: Floats
    known: NDArray[np.bool_]
    rounding: float
    coarse: bool
    pivots: dict[tuple[int, int], tuple[Floats, NDArray[np.int64]]] = field(default_factory=dict)

    def window(self, part: PixelPart) -> tuple[tuple[slice, slice], Floats]:
        """The gaps that a part's differences reach, and its differences there for a scale of 1."""
        rows, columns = self.heights.shape
        south, dy = part.y.steps(rows)
        west, dx = part.x.steps(columns)
        gaps = slice(south, south + len(dy)), slice(west, west + len(dx))
        return gaps, np.multiply.outer(dy, dx)

    def subtract(self, part: PixelPart) -> None:
        """Take a part away."""
        self.pivots.clear()
        gaps, shape = self.window(part)
        self.mixed[gaps] -= part.scale * shape
        self.mixed[gaps][~self.known[gaps]] = 0.0
        inner = slice(part.y.first, part.y.stop), slice(part.x.first, part.x.stop)
        self.heights[inner] -= part.heights()

    def subtract_values(self, row: int, column: int, values: Floats) -> None:
        """Take heights away from a window that begins at a pixel."""
        self.pivots.clear()
        rows, columns = slice(row, row + len(values)), slice(column, column + values.shape[1])
        self.heights[rows, columns] -= values
        south, west = max(0, row - 1), max(0, column - 1)
        around = self.heights[south : rows.stop + 1, west : columns.stop + 1]
        mixed = np.diff(np.diff(around, axis=1), axis=0)
        inner = slice(south, south + mixed.shape[0]), slice(west, west + mixed.shape[1])
        self.mixed[inner] = np.where(self.known[inner], mixed, 0.0)


def residual_of(heights: Floats) -> Residual:
    """The residual of a whole DEM."""
    heights = np.ascontiguousarray(np.where(np.isfinite(heights), heights, np.nan))
    east = heights[:, 1:] - heights[:, :-1]
    mixed = east[1:] - east[:-1]
    known = np.isfinite(mixed)
    mixed[~known] = 0.0
    fine, unit = rounding(heights), quantum(heights, mixed, known)
    return Residual(heights, mixed, known, max(fine, 2.0 * unit), unit > 0.0)


def rounding(heights: Floats) -> float:
    """How large mixed differences may be by the rounding of heights alone."""
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    largest = max(abs(low), abs(high))
    flat = heights.ravel()
    some = flat[:: max(1, len(flat) // _SAMPLED)]
    single = np.array_equal(some.astype(np.float32).astype(np.float64), some, equal_nan=True)
    if single:
        return max(SINGLE * largest, CURVES * (high - low))
    return CURVES * (high - low) + 1e-15 * largest


def quantum(heights: Floats, mixed: Floats, known: NDArray[np.bool_]) -> float:
    """What heights were rounded to, where that shows: in centimetres, say; otherwise 0.

    Then nearly all heights and differences are multiples of it, and not only a few are not 0.
    """
    sizes = _some_sizes(mixed, known)
    fine = rounding(heights)
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
    """The share of known mixed differences of at most some size, from a part of them."""
    sizes = _some_sizes(mixed, known)
    return float((sizes <= bound).mean()) if len(sizes) else 1.0


def noise_level(residual: Residual) -> float:
    """How far mixed differences may be off: by rounding, or by as much noise as there is.

    Noise ends where twice the size takes in hardly more differences; that is at some 1.65 standard
    deviations of it, and it stays within four.
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
