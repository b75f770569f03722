"""Peeling: parts are found and subtracted one after the other, hills, ridges, ramps and boxes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.boxes import find_boxes
from terratool.importing.structure.residual import (
    QUIET_SHARE,
    Floats,
    Residual,
    ResidualLimits,
    SearchWork,
    share_within,
)
from terratool.importing.structure.structures import VECTOR, Axis, PixelPart
from terratool.kernels import importing as kernels

GOOD = 0.06
"""Largest error of a fitted curve, relative to its size."""

SLACK = 4
"""Gaps that a curve may extend beyond the last visible difference."""

CELLS = 400
"""Most cells that are tried where ends lie hidden below other structures."""

MOST = 0.5
"""Least share of a row that has to equal another row with opposite sign."""

QUIET = 3
"""Number of empty gaps in a row at which a curve ends."""

ROUNDS = 8

BLOCK = 16
"""Side, in gaps, of the blocks in each of which one pivot is tried per round."""

PATIENCE = 150
"""Number of failed pivots in a row after which a pass ends."""

DOUBT = 24
"""As PATIENCE, while nothing was found and few differences vanish."""

GAIN = 0.15
"""Least increase of the explained share of its window for which a part is accepted."""

PARTNERS = 6

_PIVOT, _FIT, _SCALE, _SCALE_PIXEL = 60.0, 0.015, 100.0, 0.1
"""Work of a guess at a pivot, of each cell of a curve and gap in it, of a guess of a scale, and of
each gap that tells of that."""


@dataclass(frozen=True, slots=True)
class AxisProfile:
    """Differences of a curve along an axis, as multiples of those at a pivot.

    Attributes:
        ratios: (n,) float64, 1 at the pivot.
        valid: (n,) bool, whether the band is a multiple of the pivot's.
        tolerance: (n,) float64, largest error of each ratio.
        pivot: index of the pivot.
    """

    ratios: Floats
    valid: NDArray[np.bool_]
    tolerance: Floats
    pivot: int


def profile_along(
    mixed: Floats, known: NDArray[np.bool_], pivot: tuple[int, int], half: int, noise: float
) -> AxisProfile:
    """Return the profile along the second axis of an array through a pivot.

    Args:
        mixed: mixed differences, (m, n).
        known: mask of known differences, (m, n).
        pivot: indices in both axes.
        half: half width of the band, without the pivot's row.
        noise: largest error of differences.
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


def curve_of(profile: AxisProfile, unusual: bool, work: SearchWork) -> Axis | None:
    """Return the curve that a profile shows around its pivot, or None.

    Args:
        profile: the profile.
        unusual: whether the curve may also begin at the centre of a pixel, and be a vector if all
            of it lies open; if not, it is a named curve on whole pixels.
        work: work that the search may do.
    """
    last = len(profile.ratios) - 1
    east, open_east = _end(profile, 1)
    west, open_west = _end(profile, -1)
    if east - west < 2:
        return None
    begins = np.arange(west, max(open_west, -1) - 1, -1)  # the shortest cells first
    ends = np.arange(east, min(open_east, last + 1) + 1)
    while len(begins) * len(ends) > CELLS:
        # with both ends hidden, far ends wait until other structures are gone
        begins = begins[: max(1, CELLS // len(ends), len(begins) // 2)]
        ends = ends[: max(1, len(ends) // 2)]
    for odd in (0, 1) if unusual else (0,):
        starts, stops = _edges(begins, odd), _edges(ends, odd)
        work.spend(len(starts) * len(stops) * (east - west), _FIT)
        code, begin, end = kernels.fit_curve(profile, starts, stops, GOOD)
        if code >= 0:
            return Axis(code, begin, end)
        if code == -2:
            return None
    return _vector_of(profile, west, east) if unusual else None


def _edges(gaps: NDArray[np.int64], odd: int) -> NDArray[np.int64]:
    """Return edges of cells in half pixels: between pixels, and if `odd` also at their centres."""
    amid = 2 * (gaps + 1)
    if not odd:
        return amid.astype(np.int64)
    return np.unique(np.concatenate([amid - 1, amid, amid + 1])).astype(np.int64)


def _end(profile: AxisProfile, way: int) -> tuple[int, int]:
    """Return the last gap that a curve surely reaches in one direction, and the last possible one.

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
    """Return the curve without a name between two gaps; None unless it lies open and ends at 0."""
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
    """Return rows that equal the pivot's row with opposite sign along a curve; nearest first."""
    across = slice(max(0, curve.first - 1), curve.stop)
    own = mixed[pivot[0], across]
    tells = np.abs(own) > 4.0 * noise
    undone = np.abs(mixed[:, across][:, tells] + own[tells]) <= 2.0 * noise
    share = (undone & known[:, across][:, tells]).mean(axis=1)
    found = np.flatnonzero(share > MOST)
    return np.asarray(found[np.argsort(np.abs(found - pivot[0]), kind="stable")])


def peel(residual: Residual, limits: ResidualLimits, hidden: bool) -> list[PixelPart]:
    """Find parts, subtract them, and return them in the order of being found.

    Args:
        residual: heights without the parts found so far; changed.
        limits: limits of the parts.
        hidden: whether to look also for parts of which corners or all edges but one are hidden.
    """
    parts: list[PixelPart] = []
    failed: Failed = {}
    for _ in range(ROUNDS):
        more = _all_but_boxes(residual, limits, failed)
        if is_quiet(residual, limits.noise):
            # among many differences boxes would be found by chance
            more += find_boxes(residual, limits.noise, limits.height, 3 if hidden else 4)
            if hidden and not more:
                more = _all_but_boxes(residual, limits, failed, hidden=True)
                more += find_boxes(residual, limits.noise, limits.height, 1)
            if hidden and not more:
                more = _all_but_boxes(residual, replace(limits, unusual=True), failed)
        parts += more
        if not more:
            break
    return parts


Guess = Callable[[Residual, tuple[int, int], ResidualLimits], Iterator[PixelPart]]
"""Guess of the parts at a pivot, their scales still open."""

Failed = dict[tuple[Guess, bool, int, int], float]
"""Sum of the differences along a pivot's lines at which a guess failed there."""


def _all_but_boxes(
    residual: Residual, limits: ResidualLimits, failed: Failed, hidden: bool = False
) -> list[PixelPart]:
    """Find and subtract hills and ridges."""
    return [
        *_pass(residual, limits, (1, 1), _hill, failed),
        *_pass(residual, limits, (0, 1), _Ridge(True, hidden), failed),
        *_pass(residual, limits, (1, 0), _Ridge(False, hidden), failed),
    ]


def is_quiet(residual: Residual, noise: float) -> bool:
    """Tell whether enough mixed differences vanish to look for parts."""
    return share_within(residual.mixed, residual.known, 2.0 * noise) >= QUIET_SHARE


def _pass(
    residual: Residual,
    limits: ResidualLimits,
    reach: tuple[int, int],
    guess: Guess,
    failed: Failed,
) -> list[PixelPart]:
    """Try a guess at pivots from the strongest on; return the parts found, which are subtracted.

    A pivot's strength is the least difference among its neighbours within `reach` along y and x.
    """
    found: list[PixelPart] = []
    failures = 0
    patience = PATIENCE if is_quiet(residual, limits.noise) else DOUBT
    for pivot in _pivots(residual, reach, 4.0 * limits.noise):
        if residual.work.over:
            break
        row, column = pivot
        # do not retry a guess while the differences along its lines are the same
        state = float(residual.mixed[row].sum() + residual.mixed[:, column].sum())
        attempt = (guess, limits.unusual, row, column)
        if failed.get(attempt) == state:
            continue
        if kernels.least_size(residual.mixed, row, column, *reach) <= 4.0 * limits.noise:
            continue  # explained by another part meanwhile
        residual.work.spend(1.0, _PIVOT)
        tried = (_scale_guess(residual, part, limits) for part in guess(residual, pivot, limits))
        part = next((part for part in tried if part is not None), None)
        if part is not None:
            residual.subtract(part)
            residual.work.tell()
            found.append(part)
            failures, patience = 0, PATIENCE
        else:
            failed[attempt] = state
            failures += 1
            if failures >= patience:
                break
    return found


def _pivots(residual: Residual, reach: tuple[int, int], least: float) -> Iterator[tuple[int, int]]:
    """Yield the strongest gap of each block, the strongest first."""
    if reach not in residual.pivots:
        residual.pivots[reach] = kernels.find_strongest(residual.mixed, *reach, BLOCK)
    best, at = residual.pivots[reach]
    for block in np.argsort(-best, kind="stable").tolist():
        if best[block] <= least:
            return
        row, column = at[block].tolist()
        yield row, column


def _hill(
    residual: Residual, pivot: tuple[int, int], limits: ResidualLimits
) -> Iterator[PixelPart]:
    """Guess a product of two curves through a pivot, from a wide band or else from a narrow one."""
    row, column = pivot
    for half in (4, 1):
        x = curve_of(
            profile_along(residual.mixed, residual.known, pivot, half, limits.noise),
            limits.unusual,
            residual.work,
        )
        if x is None:
            continue
        turned = residual.mixed.T, residual.known.T
        profile = profile_along(*turned, (column, row), half, limits.noise)
        y = curve_of(profile, limits.unusual, residual.work)
        if y is not None:
            yield PixelPart(x, y, 0.0)
            return


@dataclass(frozen=True, slots=True)
class _Ridge:
    """Guess of parts with a curve along one axis through a pivot, and flat along the other.

    Attributes:
        along_x: whether the curve runs along x rather than y.
        hidden: whether the other edge of the flat cell may be hidden, or lie on the border.
    """

    along_x: bool
    hidden: bool

    def __call__(
        self, residual: Residual, pivot: tuple[int, int], limits: ResidualLimits
    ) -> Iterator[PixelPart]:
        heights, mixed, known = residual.heights, residual.mixed, residual.known
        if not self.along_x:
            heights, mixed, known, pivot = heights.T, mixed.T, known.T, pivot[::-1]
        along = _line(mixed, known, pivot, limits, residual.work)
        if along is None:
            return
        if self.hidden:
            flats = _by_height(heights, mixed, pivot, along)
        else:
            flats = _flats(mixed, known, pivot, along, limits.noise)
        for flat in flats:
            x, y = (along, flat) if self.along_x else (flat, along)
            yield PixelPart(x, y, 0.0)


def _line(
    mixed: Floats,
    known: NDArray[np.bool_],
    pivot: tuple[int, int],
    limits: ResidualLimits,
    work: SearchWork,
) -> Axis | None:
    """Return the curve along the second axis that a single row of differences shows, or None."""
    row, column = pivot
    around = np.abs(mixed[max(0, row - 1) : row + 2, column])
    if np.count_nonzero(around > 2.0 * limits.noise) > 1:
        return None
    return curve_of(profile_along(mixed, known, pivot, 1, limits.noise), limits.unusual, work)


def _flats(
    mixed: Floats, known: NDArray[np.bool_], pivot: tuple[int, int], along: Axis, noise: float
) -> Iterator[Axis]:
    """Yield flat cells along the first axis with one edge at a pivot, the nearest first."""
    for other in partners(mixed, known, pivot, along, noise)[:PARTNERS].tolist():
        low, high = sorted((pivot[0], other))
        yield Axis(kernels.FLAT, 2 * (low + 1), 2 * (high + 1))


def _by_height(
    heights: Floats, mixed: Floats, pivot: tuple[int, int], along: Axis
) -> Iterator[Axis]:
    """Yield flat cells with one edge at a pivot, as far as subtracting the curve smooths rows."""
    gap = pivot[0]
    first, steps = along.steps(heights.shape[1])
    line = mixed[gap, first : first + len(steps)]
    tells = np.abs(steps) >= 0.25 * np.abs(steps).max()
    scale = float(np.median(line[tells] / steps[tells]))
    west = max(0, along.first - 2)
    across = heights[:, west : along.stop + 2]
    shape = np.zeros(across.shape[1])
    shape[along.first - west : along.stop - west] = along.samples()
    rough = _roughness(across)
    north = rough - _roughness(across - scale * shape) > 0.0
    south = rough - _roughness(across + scale * shape) > 0.0
    edge = gap + 1
    end = edge + _run(north[edge:])
    if end > edge:
        yield Axis(kernels.FLAT, 2 * edge, 2 * end)
    begin = edge - _run(south[:edge][::-1])
    if begin < edge:
        yield Axis(kernels.FLAT, 2 * begin, 2 * edge)


def _roughness(heights: Floats) -> Floats:
    """Sum of the sizes of second differences of each row."""
    return np.asarray(np.nansum(np.abs(np.diff(heights, 2, axis=1)), axis=1))


def _run(flags: NDArray[np.bool_]) -> int:
    """Number of flags that are set before the first that is not."""
    return len(flags) if flags.all() else int(flags.argmin())


def _scale_guess(residual: Residual, guess: PixelPart, limits: ResidualLimits) -> PixelPart | None:
    """Return a guess with the scale that leaves least, or None if that explains too little."""
    gaps, shape = residual.window(guess)
    here, known = residual.mixed[gaps], residual.known[gaps]
    residual.work.spend(1.0, _SCALE + _SCALE_PIXEL * shape.size)
    sizes = np.abs(shape)
    # a ramp's high end exceeds its slope by far, but may be hidden
    least = min(0.25 * float(sizes.max()), float(np.median(sizes[sizes > 0.0])))
    tells = known & (sizes >= least)
    if not tells.any():
        return None
    scale = _mode(here[tells] / shape[tells], limits.noise / least)
    for slack in (8.0, 3.0, 2.0):
        clean = known & (np.abs(here - scale * shape) <= slack * limits.noise)
        power = float((shape[clean] ** 2).sum())
        if power > 0.0:
            scale = float((here[clean] * shape[clean]).sum()) / power
    tall = np.abs(np.multiply.outer(guess.y.samples(), guess.x.samples())).max()
    if abs(scale) * tall < limits.height:
        return None
    reach = known & (np.abs(scale) * sizes > 4.0 * limits.noise)
    before = np.abs(here[reach]) <= 2.0 * limits.noise
    after = np.abs(here - scale * shape)[reach] <= 2.0 * limits.noise
    if not len(before) or after.mean() - before.mean() < GAIN:
        return None
    return PixelPart(guess.x, guess.y, scale)


def _mode(values: NDArray[np.float64], width: float) -> float:
    """Return the value with most others near it: the scale of a part wherever it lies open."""
    values = np.sort(values)
    near = np.searchsorted(values, values + 8.0 * width, side="right") - np.arange(len(values))
    at = int(near.argmax())
    return float(np.median(values[at : at + int(near[at])]))
