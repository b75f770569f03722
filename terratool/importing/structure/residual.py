"""What is left of a DEM while structures are taken away, and islands that stand out of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.spelling import shortest
from terratool.importing.structure.types import PixelPart

Floats = NDArray[np.float64]

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

    def window(self, part: PixelPart) -> tuple[slice, slice, Floats, Floats]:
        """The gaps that a part's differences reach, rows first, and its differences there."""
        rows, columns = self.heights.shape
        south, dy = part.y.steps(rows)
        west, dx = part.x.steps(columns)
        return slice(south, south + len(dy)), slice(west, west + len(dx)), dy, dx

    def subtract(self, part: PixelPart) -> None:
        """Take a part away."""
        self.pivots.clear()
        rows, columns, dy, dx = self.window(part)
        self.mixed[rows, columns] -= part.scale * np.multiply.outer(dy, dx)
        self.mixed[rows, columns][~self.known[rows, columns]] = 0.0
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
    sizes: Floats = np.abs(mixed.ravel()[::every][known.ravel()[::every]])
    return sizes


BLOCKS = (8, 16, 32)
"""What lies in neighbouring blocks of so many gaps belongs together; then the same more and more
coarsely, as the stairs of a rim that runs nearly along an axis are long."""

MOST = 400
"""So many places are looked at, the largest first."""

LARGEST = 400
"""Places of more pixels to a side are left alone."""

RING = 3


@dataclass(frozen=True, slots=True)
class Island:
    """A rectangle of pixels that stands out of even ground.

    Attributes:
        row, column: its south-western pixel.
        heights: (h, w) float64, heights above the ground, NaN for none.
        stop_row, stop_column: the pixels after its last.
        around: heights above the ground in a wider window, for cells that reach farther.
        south, west: how many pixels that window reaches farther to the south and west.
        off: how far the ground around it is off from the slope that was fitted.
    """

    row: int
    column: int
    heights: Floats
    around: Floats
    south: int
    west: int
    off: float


def islands(residual: Residual, noise: float, block: int) -> Iterator[Island]:
    """Each place that stands out of even ground, the largest first.

    Args:
        residual: heights and their differences.
        noise: how far differences may be off.
        block: what lies in neighbouring blocks of so many gaps belongs together.
    """
    busy = np.abs(residual.mixed) > 2.0 * noise
    rectangles = []
    for blocks in _components(_occupied(busy, block)):
        low, high = blocks.min(axis=0) * block, (blocks.max(axis=0) + 1) * block
        j, i = np.nonzero(busy[low[0] : high[0], low[1] : high[1]])
        # from the gap before the first pixel to the gap after the last
        south, west = int(low[0] + j.min()) + 1, int(low[1] + i.min()) + 1
        north, east = int(low[0] + j.max()) + 1, int(low[1] + i.max()) + 1
        sides = north - south, east - west
        if min(sides) >= 4 and max(sides) <= LARGEST:
            rectangles.append((south, west, north, east))
    rectangles.sort(key=lambda one: (-(one[2] - one[0]) * (one[3] - one[1]), one))
    for rectangle in rectangles[:MOST]:
        island = _island(residual, *rectangle)
        if island is not None:
            yield island


def _occupied(busy: NDArray[np.bool_], block: int) -> NDArray[np.bool_]:
    """Which blocks hold something."""
    rows, columns = (-(-side // block) * block for side in busy.shape)
    padded = np.zeros((rows, columns), np.bool_)
    padded[: busy.shape[0], : busy.shape[1]] = busy
    blocks = padded.reshape(rows // block, block, columns // block, block)
    return np.logical_or.reduce(blocks, axis=(1, 3))  # type: ignore[no-any-return]


def _components(occupied: NDArray[np.bool_]) -> Iterator[NDArray[np.int64]]:
    """Blocks that touch one another, also at corners: (n, 2) rows and columns for each group."""
    waiting = dict.fromkeys(map(tuple, np.argwhere(occupied).tolist()))
    while waiting:
        seed, _ = waiting.popitem()
        group, stack = [seed], [seed]
        while stack:
            row, column = stack.pop()
            for place in ((row + j, column + i) for j in (-1, 0, 1) for i in (-1, 0, 1) if j or i):
                if place in waiting:
                    del waiting[place]
                    group.append(place)
                    stack.append(place)
        yield np.array(group)


def _island(residual: Residual, south: int, west: int, north: int, east: int) -> Island | None:
    """The heights of a rectangle above the slope around it, or None if that is not even."""
    low = max(0, south - RING), max(0, west - RING)
    window = residual.heights[low[0] : north + RING, low[1] : east + RING]
    ring = np.isfinite(window)
    ring[south - low[0] : north - low[0], west - low[1] : east - low[1]] = False
    j, i = np.nonzero(ring)
    if len(j) < 8:
        return None
    terms = np.column_stack([np.ones(len(j)), i, j])
    z = window[ring]
    found, *_ = np.linalg.lstsq(terms, z, rcond=None)
    jj, ii = np.mgrid[0 : window.shape[0], 0 : window.shape[1]]
    around = window - (found[0] + found[1] * ii + found[2] * jj)
    off = float(np.abs(around[ring]).max())
    inner = around[south - low[0] : north - low[0], west - low[1] : east - low[1]]
    return Island(south, west, inner, around, south - low[0], west - low[1], off)
