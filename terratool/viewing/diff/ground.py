"""Comparison of the ground: volumes cut and filled, areas, and the largest change.

Volumes and areas are sums over the centres of pixels. Windows in which nothing can differ are left
out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_bounds
from terratool.raster.grid import Grid, Window, default_resolution, grid_over
from terratool.raster.painter import Painter
from terratool.tasks import prefetch, processors
from terratool.viewing.diff.regions import hull, intersection
from terratool.viewing.diff.results import ComparedGrid, GroundChange, LargestChange, SurfaceArea

SIDE = 128
"""Side of a window, pixels."""
MOST_WINDOWS = 1 << 22
"""Most windows of a grid, with those that are left out."""
FIRST_PIXELS = 1 << 20
"""Most pixels that may differ in the first grid, where no resolution is given."""
MOST_PIXELS = 1 << 22
"""Most pixels that may differ in the last grid, where no resolution is given."""
ENOUGH = 1e-3
"""Relative error of the volumes at which a grid is fine enough, where no resolution is given."""
_EDGES = 16
"""Most rectangles of differing elements whose edges are aligned with edges of pixels."""
_FINER = 16
"""Largest factor on the number of pixels along a side for that alignment."""
_WHOLE = 1e-6
"""Largest distance of a quotient from a whole number that counts as one."""


class ComparedWindow(NamedTuple):
    """Pixels of a window on both terrains, (height, width) each.

    Attributes:
        old, new: float64 heights, NaN where there is no ground.
        old_surface, new_surface: int64 numbers of surfaces, indices of `Both.names`; 0 for none.
    """

    old: NDArray[np.float64]
    new: NDArray[np.float64]
    old_surface: NDArray[np.int64]
    new_surface: NDArray[np.int64]

    @property
    def change(self) -> NDArray[np.float64]:
        """New heights less old ones, NaN where either side has no ground."""
        return self.new - self.old


@dataclass(frozen=True, slots=True)
class Both:
    """Two terrains, and the part of the world in which they are compared.

    Attributes:
        old, new: both terrains.
        bounds: world rectangle that both have in common.
        regions: world rectangles outside of which nothing differs; None where anything may.
        surfaces: new names of renamed surfaces, by their old names.
        whole: both terrains with their decks and bores; None if neither has any.
    """

    old: Terrain
    new: Terrain
    bounds: Bounds
    regions: tuple[Bounds, ...] | None
    surfaces: Mapping[str, str]
    whole: tuple[Terrain, Terrain] | None = None

    @property
    def names(self) -> list[str | None]:
        """Names of the surfaces of both terrains, new ones, each once; None first, for none."""
        known = [self.surfaces.get(name, name) for name in self.old.surfaces]
        return [None, *dict.fromkeys([*known, *self.new.surfaces])]

    def numbers(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Indices of `names` for the surfaces of the old terrain and of the new one, none first."""
        index = {name: number for number, name in enumerate(self.names)}
        old = [0, *(index[self.surfaces.get(name, name)] for name in self.old.surfaces)]
        return np.array(old), np.array([0, *(index[name] for name in self.new.surfaces)])

    def windows(self, grid: Grid) -> list[Window]:
        """Windows of a grid in which anything may differ.

        Raises:
            RequestError: the grid has too many windows.
        """
        rows, columns = -(-grid.height // SIDE), -(-grid.width // SIDE)
        if rows * columns > MOST_WINDOWS:
            raise RequestError(
                f"{grid.width:,} × {grid.height:,} pixels are more than can be compared.",
                "Give a coarser resolution, or smaller bounds.",
            )
        if self.regions is None:
            return list(grid.windows(SIDE, SIDE))
        west, south, east, north = np.array(self.regions or np.empty((0, 4))).reshape(-1, 4).T
        left, right = _spans(west - grid.west, east - grid.west, grid.resolution, columns)
        top = grid.bounds[3]
        upper, lower = _spans(top - north, top - south, grid.resolution, rows)
        # steps at corners of rectangles, whose double sum counts the rectangles over a window
        over = np.zeros((rows + 1, columns + 1), np.int64)
        for row, column, step in (
            (upper, left, 1), (upper, right, -1), (lower, left, -1), (lower, right, 1)
        ):  # fmt: skip
            np.add.at(over, (row, column), step)
        hit = (over.cumsum(axis=0).cumsum(axis=1) > 0)[:-1, :-1]
        return [
            window
            for window, wanted in zip(grid.windows(SIDE, SIDE), hit.ravel().tolist(), strict=True)
            if wanted
        ]


def _spans(
    low: NDArray[np.float64], high: NDArray[np.float64], resolution: float, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First window that each stretch meets, and the one behind its last, int64.

    A stretch is widened by a pixel at both ends, as edges are rounded.
    """
    first = np.floor((low / resolution - 1) / SIDE)
    last = np.floor((high / resolution + 1) / SIDE) + 1
    first, last = np.clip(first, 0, count), np.clip(last, 0, count)
    return first.astype(np.int64), np.maximum(first, last).astype(np.int64)


class BothPainter:
    """Painter of windows of two terrains; several threads may use it at a time."""

    def __init__(self, both: Both, grid: Grid) -> None:
        self._old = Painter(both.old, grid, np.float64)
        self._new = Painter(both.new, grid, np.float64)
        self._old_numbers, self._new_numbers = both.numbers()

    def paint(self, window: Window) -> ComparedWindow:
        """Paint a window of both terrains."""
        old, new = self._old.paint(window), self._new.paint(window)
        assert old.surfaces is not None
        assert new.surfaces is not None
        return ComparedWindow(
            old.heights,
            new.heights,
            self._old_numbers[old.surfaces],
            self._new_numbers[new.surfaces],
        )


Exact = tuple[float, float]
"""Sum of doubles, and its rounding error."""


def exact_sum(numbers: NDArray[np.float64]) -> Exact:
    """Sum doubles to twice their precision, so that the result does not depend on their order."""
    values = numbers.tolist()
    total = math.fsum(values)
    return total, math.fsum([*values, -total])


class LargestPixel(NamedTuple):
    """Pixel of a grid with the largest difference of heights.

    Attributes:
        size: absolute difference.
        row, column: indices in the grid.
        old, new: old and new height.
    """

    size: float
    row: int
    column: int
    old: float
    new: float


class WindowSums(NamedTuple):
    """Sums over a window.

    Attributes:
        cut, fill: sums of heights, old over new and new over old.
        changed: number of pixels whose heights differ by more than the tolerance.
        lost, gained: number of pixels where ground became void, and void became ground.
        around: first row, first column, last row, last column of changed pixels; None for none.
        largest: pixel with the largest difference of heights; None for none.
        surfaces: number of pixels by old and new number of the surface, where these differ.
    """

    cut: Exact
    fill: Exact
    changed: int
    lost: int
    gained: int
    around: tuple[int, int, int, int] | None
    largest: LargestPixel | None
    surfaces: dict[tuple[int, int], int]


def measure(window: Window, seen: ComparedWindow, tolerance: float) -> WindowSums:
    """Sum up the differences in a window."""
    change = seen.change
    size = np.abs(change)
    was, now = np.isfinite(seen.old), np.isfinite(seen.new)
    beyond = size > tolerance  # False for NaN
    around = largest = None
    if beyond.any():
        rows, columns = np.flatnonzero(beyond.any(axis=1)), np.flatnonzero(beyond.any(axis=0))
        around = (
            window.row + int(rows[0]), window.column + int(columns[0]),
            window.row + int(rows[-1]), window.column + int(columns[-1]),
        )  # fmt: skip
    known = np.where(was & now, size, -1.0)
    at = int(np.argmax(known))
    row, column = divmod(at, window.width)
    if known[row, column] > 0.0:
        largest = LargestPixel(
            float(known[row, column]), window.row + row, window.column + column,
            float(seen.old[row, column]), float(seen.new[row, column]),
        )  # fmt: skip
    other = (seen.old_surface != seen.new_surface) & (was | now)
    pairs, counts = np.unique(
        np.column_stack([seen.old_surface[other], seen.new_surface[other]]), axis=0,
        return_counts=True,
    )  # fmt: skip
    return WindowSums(
        exact_sum(-change[change < 0.0]),
        exact_sum(change[change > 0.0]),
        int(np.count_nonzero(beyond)),
        int(np.count_nonzero(was & ~now)),
        int(np.count_nonzero(now & ~was)),
        around,
        largest,
        {(a, b): n for (a, b), n in zip(pairs.tolist(), counts.tolist(), strict=True)},
    )


class GridSums(NamedTuple):
    """Volumes over all windows of a grid, and the sums of each window."""

    cut: float
    fill: float
    parts: list[WindowSums]


def sum_windows(both: Both, grid: Grid, tolerance: float, threads: int) -> GridSums:
    """Measure all windows of a grid in which anything may differ."""
    painter = BothPainter(both, grid)
    parts = list(
        prefetch(
            lambda window: measure(window, painter.paint(window), tolerance),
            both.windows(grid),
            threads,
        )
    )
    pixel = grid.resolution**2
    cut = math.fsum(number for part in parts for number in part.cut) * pixel
    fill = math.fsum(number for part in parts for number in part.fill) * pixel
    return GridSums(cut, fill, parts)


def compare_ground(
    both: Both,
    *,
    tolerance: float,
    resolution: float | None,
    threads: int | None = None,
) -> GroundChange:
    """Compare heights, surfaces and voids at the centres of pixels.

    Without a resolution the grid covers the regions that can differ. Its first pixels show the
    finest feature there, with edges on those of differing elements if possible. They are halved
    until the volumes stay the same, or there are too many. The error is the change by the last
    halving; with a resolution, the difference from pixels twice as wide.

    Args:
        both: both terrains.
        tolerance: largest difference of heights that does not count as changed ground.
        resolution: side of a pixel, for a grid over all that is compared; None to choose it.
        threads: number of threads; that of processors if None.

    Raises:
        RequestError: the resolution makes no grid.
    """
    threads = processors() if threads is None else threads
    if resolution is not None:
        grid = grid_over(both.old, resolution, both.bounds)
        sums = sum_windows(both, grid, tolerance, threads)
        error = _coarse_error(both, grid, sums, tolerance, threads)
        return _ground_change(both, grid, sums, tolerance, error)
    part = both.bounds if both.regions is None else hull(both.regions, both.bounds)
    if part is None:
        part = both.bounds
    grid = _first_grid(both, part)
    sums = sum_windows(both, grid, tolerance, threads)
    while True:
        finer = grid_over(both.old, grid.resolution / 2, part)
        before, sums, grid = sums, sum_windows(both, finer, tolerance, threads), finer
        error = _volume_difference(before, sums)
        enough = error <= ENOUGH * (sums.cut + sums.fill)
        if enough or 4 * _pixels(both, grid) > MOST_PIXELS:
            return _ground_change(both, grid, sums, tolerance, error)


def _first_grid(both: Both, part: Bounds) -> Grid:
    """Grid over the regions that can differ, whose pixels show the finest feature there.

    Smaller pixels are taken if the edges of differing elements lie on theirs, and larger ones if
    there would be more than `FIRST_PIXELS`.
    """
    finest = min(default_resolution(terrain, part)[0] for terrain in (both.old, both.new))
    sides = part[2] - part[0], part[3] - part[1]
    edges = [*sides]
    for box in (both.regions or ())[:_EDGES]:
        edges += (abs(box[k] - part[k % 2]) for k in range(4))
    count = max(1, math.ceil(min(sides) / finest - _WHOLE))
    best = _aligned_count(range(count, _FINER * count + 1), min(sides), edges) or count
    while count > 1 and _pixels(both, grid_over(both.old, min(sides) / best, part)) > FIRST_PIXELS:
        count = count // 2
        best = _aligned_count(range(count, count // 2, -1), min(sides), edges) or count
    return grid_over(both.old, min(sides) / best, part)


def _aligned_count(counts: Iterable[int], side: float, edges: Sequence[float]) -> int | None:
    """First number of pixels along a side for which all edges lie between pixels; None if none."""
    for count in counts:
        resolution = side / count
        if all(abs(edge / resolution - round(edge / resolution)) < _WHOLE for edge in edges):
            return count
    return None


def _pixels(both: Both, grid: Grid) -> int:
    return sum(window.width * window.height for window in both.windows(grid))


def _coarse_error(both: Both, grid: Grid, sums: GridSums, tolerance: float, threads: int) -> float:
    """Largest difference of the volumes from those of pixels twice as wide."""
    if sums.cut == sums.fill == 0.0:
        return 0.0
    try:
        coarser = grid_over(both.old, 2 * grid.resolution, grid.bounds)
    except RequestError:  # no pixel has its centre on the terrain
        return sums.cut + sums.fill
    return _volume_difference(sum_windows(both, coarser, tolerance, threads), sums)


def _volume_difference(one: GridSums, other: GridSums) -> float:
    return max(abs(one.cut - other.cut), abs(one.fill - other.fill))


def _ground_change(
    both: Both, grid: Grid, sums: GridSums, tolerance: float, error: float
) -> GroundChange:
    pixel, parts = grid.resolution**2, sums.parts
    pairs: dict[tuple[int, int], int] = {}
    for part in parts:
        for pair, count in part.surfaces.items():
            pairs[pair] = pairs.get(pair, 0) + count
    names = both.names
    surfaces = [
        SurfaceArea(names[old], names[new], count * pixel)
        for (old, new), count in sorted(pairs.items(), key=lambda item: (-item[1], item[0]))
    ]
    common = area_of(both.bounds)
    return GroundChange(
        grid=ComparedGrid(grid.bounds, grid.resolution, grid.width, grid.height),
        tolerance=tolerance,
        common=common,
        cut=sums.cut,
        fill=sums.fill,
        error=error,
        changed=sum(part.changed for part in parts) * pixel,
        around=_around(grid, [part.around for part in parts if part.around is not None]),
        largest=_largest(both, grid, [p.largest for p in parts if p.largest is not None]),
        lost=sum(part.lost for part in parts) * pixel,
        gained=sum(part.gained for part in parts) * pixel,
        surfaces=tuple(surfaces),
    )


def _around(grid: Grid, boxes: Sequence[tuple[int, int, int, int]]) -> Bounds | None:
    if not boxes:
        return None
    top, left = min(box[0] for box in boxes), min(box[1] for box in boxes)
    bottom, right = max(box[2] for box in boxes), max(box[3] for box in boxes)
    side, north = grid.resolution, grid.bounds[3]
    return (
        grid.west + left * side, north - (bottom + 1) * side,
        grid.west + (right + 1) * side, north - top * side,
    )  # fmt: skip


def _largest(both: Both, grid: Grid, found: Sequence[LargestPixel]) -> LargestChange | None:
    """Largest difference of heights; the first from the north-west among equal ones."""
    if not found:
        return None
    _, row, column, old, new = min(found, key=lambda one: (-one.size, one.row, one.column))
    at = Window(row, column, 1, 1)
    x, y = float(grid.columns(at)[0]), float(grid.rows(at)[0])
    return LargestChange(x, y, old, new, both.old.element(x, y), both.new.element(x, y))


def area_of(bounds: Bounds) -> float:
    """Area of a rectangle."""
    return (bounds[2] - bounds[0]) * (bounds[3] - bounds[1])


def common_bounds(old: Terrain, new: Terrain, bounds: Bounds | None) -> Bounds | None:
    """Rectangle that two terrains, and the bounds asked for, have in common; None if it is empty.

    Raises:
        RequestError: the bounds are empty, or miss both terrains.
    """
    both = intersection(old.bounds, new.bounds)
    if bounds is None:
        return both
    check_bounds(bounds, new)
    return None if both is None else intersection(both, bounds)


def paint_windows(
    both: Both, grid: Grid, windows: Sequence[Window], threads: int
) -> Iterator[tuple[Window, ComparedWindow]]:
    """Yield windows in their order, each with the pixels of both terrains."""
    painter = BothPainter(both, grid)
    yield from prefetch(lambda window: (window, painter.paint(window)), windows, threads)
