"""Curves along one axis, from mixed differences around one gap.

Where one product of two curves stands alone, all rows of its mixed differences are multiples of one
another, and so are all columns. So the columns that are multiples of the pivot's, over a band of a
few rows, give the differences of the curve along x, and the others are not to be believed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.types import VECTOR, Axis
from terratool.kernels import importing as kernels

Floats = NDArray[np.float64]

GOOD = 0.06
"""The largest misfit of a curve that is believed."""

SLACK = 4
"""How many gaps a curve may go on where its differences vanish in the rounding."""

CELLS = 400
"""So many cells are tried where ends lie hidden below other structures."""

MOST = 0.5
"""So much of a row has to be another one upside down."""

QUIET = 3
"""A curve ends where this many gaps in a row hold nothing."""


@dataclass(frozen=True, slots=True)
class AxisProfile:
    """Differences of a curve along an axis, as multiples of those at a pivot.

    Attributes:
        ratios: (n,) float64, 1 at the pivot.
        valid: (n,) bool, where the band is a multiple of the pivot's.
        tolerance: (n,) float64, how far a ratio may be off.
        pivot: index of the pivot.
    """

    ratios: Floats
    valid: NDArray[np.bool_]
    tolerance: Floats
    pivot: int


def profile_along(
    mixed: Floats, known: NDArray[np.bool_], pivot: tuple[int, int], half: int, noise: float
) -> AxisProfile:
    """The profile along the second axis of an array through a pivot.

    Args:
        mixed: mixed differences, (m, n).
        known: where they are known.
        pivot: indices in both axes.
        half: the band is this many wide to each side.
        noise: how far differences may be off.
    """
    first, last = max(0, pivot[0] - half), pivot[0] + half + 1
    band = mixed[first:last]
    own = band[:, pivot[1]]
    power = float(own @ own)
    ratios = (own @ band) / power
    sizes = np.abs(ratios)
    miss = np.abs(band - np.multiply.outer(own, ratios)).max(axis=0)
    valid = (miss <= 1.2 * noise * (1.0 + sizes)) & known[first:last].all(axis=0)
    tolerance = (1.5 * noise / power**0.5) * (1.0 + sizes)
    return AxisProfile(ratios, valid, tolerance, pivot[1])


def curve_of(profile: AxisProfile, unusual: bool) -> Axis | None:
    """The curve that a profile shows around its pivot, or None.

    Args:
        profile: the profile.
        unusual: whether the curve may begin at the centre of a pixel as well, and be a vector, if
            all of it lies open; if not, it is a named one on whole pixels.
    """
    last = len(profile.ratios) - 1
    east, open_east = _end(profile, 1)
    west, open_west = _end(profile, -1)
    if east - west < 2:
        return None
    begins = np.arange(west, max(open_west, -1) - 1, -1)  # the shortest cells first
    ends = np.arange(east, min(open_east, last + 1) + 1)
    while len(begins) * len(ends) > CELLS:
        # both ends are hidden: the far ones can wait until other structures are gone
        begins = begins[: max(1, CELLS // len(ends), len(begins) // 2)]
        ends = ends[: max(1, len(ends) // 2)]
    for odd in (0, 1) if unusual else (0,):
        code, begin, end = kernels.fit_curve(profile, _edges(begins, odd), _edges(ends, odd), GOOD)
        if code >= 0:
            return Axis(code, begin, end)
        if code == -2:
            return None
    return _vector_of(profile, west, east) if unusual else None


def _edges(gaps: NDArray[np.int64], odd: int) -> NDArray[np.int64]:
    """Edges of cells in half pixels: amid gaps, or also at the centres beside them."""
    amid = 2 * (gaps + 1)
    if not odd:
        return amid.astype(np.int64)
    return np.unique(np.concatenate([amid - 1, amid, amid + 1])).astype(np.int64)


def _end(profile: AxisProfile, way: int) -> tuple[int, int]:
    """The last gap that a curve surely holds in one direction, and the last that it may hold.

    The latter lies one beyond the last gap where the curve may end with the DEM.
    """
    count = len(profile.ratios)
    surely = at = profile.pivot
    quiet = 0
    while quiet < QUIET:
        at += way
        if not 0 <= at < count:
            return surely, at
        if not profile.valid[at]:
            quiet = 0
        elif abs(profile.ratios[at]) > profile.tolerance[at]:
            surely, quiet = at, 0
        else:
            quiet += 1
    return surely, surely + way * SLACK if abs(at - surely) <= QUIET else at - way * quiet


def _vector_of(profile: AxisProfile, west: int, east: int) -> Axis | None:
    """The curve without a name from one gap to another, if all of it lies open and it ends at 0."""
    wide = slice(west - QUIET, east + QUIET + 1)
    if west < QUIET or wide.stop > len(profile.ratios) or not profile.valid[wide].all():
        return None
    values = np.cumsum(profile.ratios[west : east + 1])
    slack = float(np.sqrt((profile.tolerance[west : east + 1] ** 2).sum()))
    top = float(values[np.argmax(np.abs(values))])
    if abs(values[-1]) > slack or abs(top) <= 4.0 * slack:
        return None
    return Axis(VECTOR, 2 * (west + 1), 2 * (east + 1), tuple((values[:-1] / top).tolist()))


def partners(
    mixed: Floats, known: NDArray[np.bool_], pivot: tuple[int, int], curve: Axis, noise: float
) -> NDArray[np.int64]:
    """Rows that hold the pivot's row upside down, over most of a curve's cell; nearest first."""
    across = slice(max(0, curve.first - 1), curve.stop)
    own = mixed[pivot[0], across]
    tells = np.abs(own) > 4.0 * noise
    undone = np.abs(mixed[:, across][:, tells] + own[tells]) <= 2.0 * noise
    share = (undone & known[:, across][:, tells]).mean(axis=1)
    found = np.flatnonzero(share > MOST)
    order: NDArray[np.int64] = found[np.argsort(np.abs(found - pivot[0]), kind="stable")]
    return order
