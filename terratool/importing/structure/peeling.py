"""Parts are taken away one after the other, the surest first: hills, ridges and ramps, boxes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.boxes import find_boxes
from terratool.importing.structure.profiles import curve_of, partners, profile_along
from terratool.importing.structure.residual import QUIET_SHARE, Floats, Residual, share_within
from terratool.importing.structure.types import Axis, PixelPart
from terratool.kernels import importing as kernels

ROUNDS = 8
BLOCK = 16
"""One pivot is tried in each block of so many gaps to a side, at most, in each round."""

PATIENCE = 150
"""So many pivots in a row may lead to nothing."""

DOUBT = 24
"""So many where nothing was found yet, and hardly anything is flat or sloping evenly."""

GAIN = 0.15
"""A part is believed if it leaves nothing in so much more of its window than before."""

PARTNERS = 6


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


def peel(residual: Residual, limits: Limits, hidden: bool) -> list[PixelPart]:
    """Take away all parts that are found; they come back in the order of being found.

    Args:
        residual: what is left; changed.
        limits: what counts.
        hidden: whether also those are looked for of which corners or all edges but one are hidden.
    """
    parts: list[PixelPart] = []
    failed: Failed = {}
    for _ in range(ROUNDS):
        more = _all_but_boxes(residual, limits, _ridge_x, _ridge_y, failed)
        if is_quiet(residual, limits.noise):
            # among many differences boxes would be found by chance
            more += find_boxes(residual, limits.noise, limits.height, 3 if hidden else 4)
            if hidden and not more:
                more = _all_but_boxes(residual, limits, _hidden_ridge_x, _hidden_ridge_y, failed)
                more += find_boxes(residual, limits.noise, limits.height, 1)
            if hidden and not more:
                more = _all_but_boxes(
                    residual, replace(limits, unusual=True), _ridge_x, _ridge_y, failed
                )
        parts += more
        if not more:
            break
    return parts


Guess = Callable[[Residual, tuple[int, int], Limits], Iterator[PixelPart]]
Failed = dict[tuple[str, bool, int, int], float]


def _all_but_boxes(
    residual: Residual, limits: Limits, ridge_x: Guess, ridge_y: Guess, failed: Failed
) -> list[PixelPart]:
    """Take away hills and ridges."""
    return [
        *_pass(residual, limits, (1, 1), _hill, failed),
        *_pass(residual, limits, (0, 1), ridge_x, failed),
        *_pass(residual, limits, (1, 0), ridge_y, failed),
    ]


def is_quiet(residual: Residual, noise: float) -> bool:
    """Whether enough of the mixed differences vanish."""
    return share_within(residual.mixed, residual.known, 2.0 * noise) >= QUIET_SHARE


def _pass(
    residual: Residual,
    limits: Limits,
    reach: tuple[int, int],
    guess: Guess,
    failed: Failed,
) -> list[PixelPart]:
    """Try pivots from the strongest on, which are so together with neighbours along y and x."""
    found: list[PixelPart] = []
    failures = 0
    patience = PATIENCE if is_quiet(residual, limits.noise) else DOUBT
    for pivot in _pivots(residual, reach, 4.0 * limits.noise):
        row, column = pivot
        # what failed need not be tried again as long as nothing has changed along its lines
        state = float(residual.mixed[row].sum() + residual.mixed[:, column].sum())
        attempt = (guess.__name__, limits.unusual, row, column)
        if failed.get(attempt) == state:
            continue
        if kernels.least_size(residual.mixed, row, column, *reach) <= 4.0 * limits.noise:
            continue  # it went with another one
        best = _best(residual, guess(residual, pivot, limits), limits)
        if best is not None:
            residual.subtract(best)
            found.append(best)
            failures, patience = 0, PATIENCE
        else:
            failed[attempt] = state
            failures += 1
            if failures >= patience:
                break
    return found


def _pivots(residual: Residual, reach: tuple[int, int], least: float) -> Iterator[tuple[int, int]]:
    """The strongest gap of each block, the strongest first."""
    if reach not in residual.pivots:
        residual.pivots[reach] = kernels.find_strongest(residual.mixed, *reach, BLOCK)
    best, at = residual.pivots[reach]
    for block in np.argsort(-best, kind="stable").tolist():
        if best[block] <= least:
            return
        row, column = at[block].tolist()
        yield row, column


def _hill(residual: Residual, pivot: tuple[int, int], limits: Limits) -> Iterator[PixelPart]:
    """Products of two curves through a pivot, the width of the band tried from wide to narrow."""
    row, column = pivot
    for half in (4, 1):
        x = curve_of(
            profile_along(residual.mixed, residual.known, pivot, half, limits.noise), limits.unusual
        )
        if x is None:
            continue
        turned = residual.mixed.T, residual.known.T
        y = curve_of(profile_along(*turned, (column, row), half, limits.noise), limits.unusual)
        if y is not None:
            yield PixelPart(x, y, 0.0)
            return


def _ridge_x(residual: Residual, pivot: tuple[int, int], limits: Limits) -> Iterator[PixelPart]:
    """A curve along x through a pivot, flat along y."""
    mixed, known = residual.mixed, residual.known
    along = _line(mixed, known, pivot, limits)
    if along is not None:
        for flat in _flats(mixed, known, pivot, along, limits.noise):
            yield PixelPart(along, flat, 0.0)


def _ridge_y(residual: Residual, pivot: tuple[int, int], limits: Limits) -> Iterator[PixelPart]:
    """A curve along y through a pivot, flat along x."""
    mixed, known = residual.mixed.T, residual.known.T
    along = _line(mixed, known, pivot[::-1], limits)
    if along is not None:
        for flat in _flats(mixed, known, pivot[::-1], along, limits.noise):
            yield PixelPart(flat, along, 0.0)


def _hidden_ridge_x(
    residual: Residual, pivot: tuple[int, int], limits: Limits
) -> Iterator[PixelPart]:
    """The same where the other edge is hidden or lies on the border."""
    along = _line(residual.mixed, residual.known, pivot, limits)
    if along is not None:
        for flat in _by_height(residual.heights, residual.mixed, pivot, along):
            yield PixelPart(along, flat, 0.0)


def _hidden_ridge_y(
    residual: Residual, pivot: tuple[int, int], limits: Limits
) -> Iterator[PixelPart]:
    """The same where the other edge is hidden or lies on the border."""
    along = _line(residual.mixed.T, residual.known.T, pivot[::-1], limits)
    if along is not None:
        for flat in _by_height(residual.heights.T, residual.mixed.T, pivot[::-1], along):
            yield PixelPart(flat, along, 0.0)


def _line(
    mixed: Floats, known: NDArray[np.bool_], pivot: tuple[int, int], limits: Limits
) -> Axis | None:
    """The curve along the second axis that a line of differences shows."""
    row, column = pivot
    around = np.abs(mixed[max(0, row - 1) : row + 2, column])
    if np.count_nonzero(around > 2.0 * limits.noise) > 1:
        return None
    return curve_of(profile_along(mixed, known, pivot, 1, limits.noise), limits.unusual)


def _flats(
    mixed: Floats, known: NDArray[np.bool_], pivot: tuple[int, int], along: Axis, noise: float
) -> Iterator[Axis]:
    """Flat cells along the first axis with one edge at a pivot, the nearest first."""
    for other in partners(mixed, known, pivot, along, noise)[:PARTNERS].tolist():
        low, high = sorted((pivot[0], other))
        yield Axis(kernels.FLAT, 2 * (low + 1), 2 * (high + 1))


def _by_height(
    heights: Floats, mixed: Floats, pivot: tuple[int, int], along: Axis
) -> Iterator[Axis]:
    """Flat cells with one edge at a pivot, as far as taking the curve away makes rows smoother."""
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
    """The sum of the sizes of second differences of each row."""
    sums: Floats = np.nansum(np.abs(np.diff(heights, 2, axis=1)), axis=1)
    return sums


def _run(flags: NDArray[np.bool_]) -> int:
    """How many are set before the first that is not."""
    return len(flags) if flags.all() else int(flags.argmin())


def _best(residual: Residual, guesses: Iterator[PixelPart], limits: Limits) -> PixelPart | None:
    """The first guess that explains what it covers, with its scale."""
    for guess in guesses:
        part = _scaled(residual, guess, limits)
        if part is not None:
            return part
    return None


def _scaled(residual: Residual, guess: PixelPart, limits: Limits) -> PixelPart | None:
    """A guess with the scale that leaves least, or None if that explains too little."""
    rows, columns, dy, dx = residual.window(guess)
    here, known = residual.mixed[rows, columns], residual.known[rows, columns]
    shape = np.multiply.outer(dy, dx)
    sizes = np.abs(shape)
    # the high end of a ramp is much larger than its slope, but may be hidden
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
    """Where most values lie within a small width: a part's scale wherever it stands alone."""
    values = np.sort(values)
    near = np.searchsorted(values, values + 8.0 * width, side="right") - np.arange(len(values))
    at = int(near.argmax())
    return float(np.median(values[at : at + int(near[at])]))
