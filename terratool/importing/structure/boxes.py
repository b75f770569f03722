"""Boxes found from the four mixed differences at their corners, and merging of boxes into ramps."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from terratool.importing.structure.residual import Floats, Residual
from terratool.importing.structure.structures import Axis, PixelPart
from terratool.kernels import importing as kernels

SPIKES = 20_000
"""Number of the largest mixed differences that are tried."""

NEAREST = 12
"""Number of nearest candidates for a corner in each direction."""

PATIENCE = 200
"""Number of failures in a row after which a search ends."""

STICKS_OUT = 2.0
"""Least ratio of a corner's difference to those around it."""

SIDES = {4: 3, 3: 2, 2: 3, 1: 3}
"""Number of sides that need walls of the box's height, by the number of corners that lie open."""

EVEN = 0.3
"""Largest error of the jump along a wall, in heights of the box, where corners do not suffice."""

_PLACE, _SPIKE, _CANDIDATE, _WALLS = 1.0, 60.0, 0.5, 40.0
"""Work of a difference, of a spike among these, of each cell that is tried at it, and of looking at
the walls of one."""

_SIGNS = np.array([[1.0], [-1.0], [-1.0], [1.0]])
"""Signs of the differences at the corners of a box that is 1 high."""

CLOSE = 1e-3
"""Largest difference of heights that count as equal, in steps of a ramp."""


def find_boxes(
    residual: Residual, noise: float, height: float, least_corners: int = 1
) -> list[PixelPart]:
    """Find boxes, and subtract each from the residual.

    Args:
        residual: heights without the parts found so far; changed.
        noise: largest error of mixed differences.
        height: least height of a box.
        least_corners: least number of corners of a box that lie open; with 4, boxes also need walls
            of their height on all sides, unlike the stairs of a turned edge.
    """
    found: list[PixelPart] = []
    least, work = max(4.0 * noise, height), residual.work
    # boxes with more open corners first; without them other corners are open
    for wanted in range(4, least_corners - 1, -1):
        failures = 0
        changed: set[tuple[int, int]] = set()
        places = _spikes(residual, least)
        for (row, column), stood_out in zip(places, _stand_out(residual, places), strict=True):
            if work.over:
                return found
            work.spend(1.0, _PLACE)
            value = residual.mixed[row, column]
            if (row, column) in changed:
                stood_out = _stands_out(residual, row, column)
            if abs(value) <= least or not stood_out:
                continue
            work.spend(1.0, _SPIKE)
            box = _best(
                residual, row, column, noise, wanted, SIDES[wanted] if least_corners < 4 else 4
            )
            if box is None:
                failures += 1
                if failures >= PATIENCE:
                    break
                continue
            residual.subtract(box)
            work.tell()
            found.append(box)
            failures = 0
            changed |= _around(box)
    return found


def _around(box: PixelPart) -> set[tuple[int, int]]:
    """Gaps at the corners of a box, and beside these."""
    rows, columns = ((axis.first - 1, axis.stop - 1) for axis in (box.y, box.x))
    near = (-1, 0, 1)
    return {(j + dj, i + di) for j in rows for i in columns for dj in near for di in near}


def _spikes(residual: Residual, least: float) -> list[tuple[int, int]]:
    """Return row and column of the gaps with the largest mixed differences, the largest first."""
    sizes = np.abs(residual.mixed).ravel()
    places = np.flatnonzero(sizes > least)
    if len(places) > SPIKES:
        places = places[np.argpartition(-sizes[places], SPIKES)[:SPIKES]]
    places = places[np.lexsort((places, -sizes[places]))]
    columns = residual.mixed.shape[1]
    return list(zip((places // columns).tolist(), (places % columns).tolist(), strict=True))


def _stand_out(residual: Residual, places: list[tuple[int, int]]) -> NDArray[np.bool_]:
    """Tell which differences are much larger than those around them, unlike a part of a curve.

    The next corner of a box that is one pixel wide has the opposite sign.

    Args:
        residual: heights and their differences.
        places: rows and columns of n gaps.

    Returns:
        (n,) bool.
    """
    mixed = residual.mixed
    rows, columns = np.array(places, np.int64).reshape(-1, 2).T
    values = mixed[rows, columns]
    alone, large = np.ones(len(values), np.bool_), np.ones(len(values), np.int64)
    for dj, di in product((-1, 0, 1), repeat=2):
        if dj == di == 0:
            continue
        j, i = rows + dj, columns + di
        inside = (j >= 0) & (j < mixed.shape[0]) & (i >= 0) & (i < mixed.shape[1])
        beside = np.where(inside, mixed[np.where(inside, j, 0), np.where(inside, i, 0)], 0.0)
        is_large = np.abs(beside) * STICKS_OUT > np.abs(values)
        large += is_large
        if (dj + di) % 2:
            alone &= ~is_large | (beside * values < 0.0)
    return alone & (large <= 4)


def _stands_out(residual: Residual, row: int, column: int) -> bool:
    """Tell the same of one difference, which is quicker without arrays."""
    mixed = residual.mixed
    value, large = float(mixed[row, column]), 1
    for j in range(max(0, row - 1), min(mixed.shape[0], row + 2)):
        for i in range(max(0, column - 1), min(mixed.shape[1], column + 2)):
            beside = float(mixed[j, i])
            if (j, i) == (row, column) or abs(beside) * STICKS_OUT <= abs(value):
                continue
            large += 1
            if (j - row + i - column) % 2 and beside * value >= 0.0:
                return False
    return large <= 4


def _best(
    residual: Residual, row: int, column: int, noise: float, wanted: int, sides: int
) -> PixelPart | None:
    """Return the smallest box with a corner at a gap that explains `wanted` corners, or None."""
    value = float(residual.mixed[row, column])
    ends = _far_corners(residual, row, column, noise, wanted)
    residual.work.spend(len(ends), _CANDIDATE)
    if not len(ends):
        return None
    cells = _BoxCells(residual, (row, column), ends, value)
    cleared, corners = cells.count_cleared(noise)
    fits = cleared >= np.minimum(wanted, corners)
    if wanted > 2:
        fits &= corners >= wanted
    order = np.flatnonzero(fits)
    for at in order[np.argsort(cells.areas[order], kind="stable")].tolist():
        if residual.work.over:
            return None
        box = cells.box(at)
        if _has_walls(residual, box, sides):
            return box
    return None


class _BoxCells:
    """Cells of boxes that have one corner in common, and are as high as the difference there.

    Args:
        residual: heights and their differences.
        corner: row and column of the common gap.
        ends: (n, 2) int64, rows and columns of the gaps at the opposite corners.
        value: mixed difference at the common gap.

    Attributes:
        areas: (n,) int64, numbers of pixels.
    """

    def __init__(
        self, residual: Residual, corner: tuple[int, int], ends: NDArray[np.int64], value: float
    ) -> None:
        own = np.array(corner)
        self._residual = residual
        self._low, self._high = np.minimum(ends, own), np.maximum(ends, own)
        self.areas = np.prod(self._high - self._low, axis=1)
        # a difference is positive in the south-west and in the north-east
        self._scales = np.prod(np.where(own == self._low, 1.0, -1.0), axis=1) * value

    def box(self, at: int) -> PixelPart:
        """Return a box on whole pixels."""
        (south, west), (north, east) = (2 * (ends[at] + 1) for ends in (self._low, self._high))
        x = Axis(kernels.FLAT, int(west), int(east))
        y = Axis(kernels.FLAT, int(south), int(north))
        return PixelPart(x, y, float(self._scales[at]))

    def count_cleared(self, noise: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Count corners that each box clears of a difference, minus twice those that it spoils.

        Returns:
            That count, and the number of corners within the DEM.
        """
        mixed, known = self._residual.mixed, self._residual.known
        near, low, high = 2.0 * noise, self._low, self._high
        # all corners at once: south-west, south-east, north-west, north-east
        rows = np.array([low[:, 0], low[:, 0], high[:, 0], high[:, 0]])
        columns = np.array([low[:, 1], high[:, 1], low[:, 1], high[:, 1]])
        inside = (rows >= 0) & (rows < mixed.shape[0])
        inside &= (columns >= 0) & (columns < mixed.shape[1])
        rows[~inside] = columns[~inside] = 0
        inside &= known[rows, columns]
        before = mixed[rows, columns]
        after_is_near = np.abs(before - _SIGNS * self._scales) <= near
        before_is_near = np.abs(before) <= near
        cleared = (inside & after_is_near & ~before_is_near).sum(axis=0)
        spoiled = (inside & before_is_near & ~after_is_near).sum(axis=0)
        return cleared - 2 * spoiled, inside.sum(axis=0)


def _far_corners(
    residual: Residual, row: int, column: int, noise: float, wanted: int
) -> NDArray[np.int64]:
    """Return the gaps, (n, 2) int64, at which a box may have the corner opposite to one at a gap.

    Rows and columns of −1, and beyond the last gap, are the border of the DEM.
    """
    mixed = residual.mixed
    value = mixed[row, column]
    near = 2.0 * noise
    columns = _nearest(np.abs(mixed[row] + value) <= near, column)
    rows = _nearest(np.abs(mixed[:, column] + value) <= near, row)
    pairs = {(j, i): None for j in rows for i in columns}
    if wanted < 4:
        for j in rows:
            pairs.update({(j, i): None for i in _nearest(np.abs(mixed[j] - value) <= near, column)})
        for i in columns:
            hits = _nearest(np.abs(mixed[:, i] - value) <= near, row)
            pairs.update({(j, i): None for j in hits})
    if wanted == 2:
        own_row, own_column = mixed[row], mixed[:, column]
        for j in rows:
            both = (own_row * value < 0.0) & (np.abs(own_row + mixed[j]) <= near)
            both &= np.abs(own_row) > 2.0 * near
            pairs.update({(j, i): None for i in _nearest(both, column)})
        for i in columns:
            both = (own_column * value < 0.0) & (np.abs(own_column + mixed[:, i]) <= near)
            both &= np.abs(own_column) > 2.0 * near
            pairs.update({(j, i): None for j in _nearest(both, row)})
        pairs.update({(j, i): None for j in rows for i in (-1, mixed.shape[1])})
        pairs.update({(j, i): None for j in (-1, mixed.shape[0]) for i in columns})
    if wanted == 1:
        pairs.update({(j, i): None for j in (-1, mixed.shape[0]) for i in (-1, mixed.shape[1])})
    found = [pair for pair in pairs if pair[0] != row and pair[1] != column]
    return np.array(found, np.int64).reshape(-1, 2)


def _nearest(hits: NDArray[np.bool_], place: int) -> list[int]:
    found = np.flatnonzero(hits)
    order = np.argsort(np.abs(found - place), kind="stable")[:NEAREST]
    return [one for one in found[order].tolist() if one != place]


def jumps(residual: Residual, box: PixelPart) -> list[Floats]:
    """Heights of a box's walls above the neighbouring pixels, for each side within the DEM."""
    heights = residual.heights
    rows, columns = slice(box.y.first, box.y.stop), slice(box.x.first, box.x.stop)
    sides = []
    if box.x.first > 0:
        sides.append(heights[rows, box.x.first] - heights[rows, box.x.first - 1])
    if box.x.stop < heights.shape[1]:
        sides.append(heights[rows, box.x.stop - 1] - heights[rows, box.x.stop])
    if box.y.first > 0:
        sides.append(heights[box.y.first, columns] - heights[box.y.first - 1, columns])
    if box.y.stop < heights.shape[0]:
        sides.append(heights[box.y.stop - 1, columns] - heights[box.y.stop, columns])
    return [side[np.isfinite(side)] for side in sides]


def _has_walls(residual: Residual, box: PixelPart, sides_wanted: int) -> bool:
    """Tell whether a box has walls of its height on `sides_wanted` sides, or on all in the DEM."""
    residual.work.spend(1, _WALLS)
    sides = [side for side in jumps(residual, box) if len(side)]
    good = [abs(_median(side) - box.scale) <= EVEN * abs(box.scale) for side in sides]
    return bool(good) and sum(good) >= min(len(good), sides_wanted)


def _median(values: Floats) -> float:
    """Return the median of a line, faster than NumPy's general one."""
    values, middle = np.sort(values), len(values) // 2
    return float(values[middle] + values[(len(values) - 1) // 2]) / 2.0


def merge_ramps(parts: list[PixelPart]) -> list[PixelPart]:
    """Return parts without boxes that are only the high end of a ramp.

    Where a ramp leads up to a platform of its own height, its high end has no wall. Then a ramp
    that is one pixel shorter, with a box of one pixel beside it, fits equally well.
    """
    places = {(part.x, part.y): index for index, part in enumerate(parts)}
    out: list[PixelPart | None] = list(parts)
    for index, part in enumerate(parts):
        for along_x in (True, False):
            ramp, across = (part.x, part.y) if along_x else (part.y, part.x)
            if ramp.code not in (kernels.RAMP, kernels.FALL) or across.code != kernels.FLAT:
                continue
            step = part.scale / (ramp.stop - ramp.first)
            end = ramp.end if ramp.code == kernels.RAMP else ramp.begin - 2
            last = Axis(kernels.FLAT, end, end + 2)
            place = places.get((last, across) if along_x else (across, last))
            box = None if place is None else out[place]
            if place is None or box is None:
                continue
            if abs(box.scale - part.scale - step / 2.0) > CLOSE * abs(step):
                continue
            longer = Axis(ramp.code, min(ramp.begin, end), max(ramp.end, end + 2))
            x, y = (longer, across) if along_x else (across, longer)
            out[index], out[place] = PixelPart(x, y, part.scale + step), None
    return [part for part in out if part is not None]
