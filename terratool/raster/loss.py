"""Losses of rasterisation: walls, features narrower than a pixel, and interpolation error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import DTypeLike, NDArray

from terratool.field.bounds import finest_details, largest_heights
from terratool.field.storeys import StoreySheet
from terratool.field.summary import spread_points
from terratool.field.terrain import Terrain
from terratool.field.walls import WallFinders
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window
from terratool.raster.hidden import NOTHING_HIDDEN, HiddenCounts, HiddenFinder, HiddenLoss
from terratool.raster.painter import Planes
from terratool.report.numbers import metres
from terratool.report.wording import count_of

Floats = NDArray[np.float64]

FIRST = 20
"""Most narrow features listed by name."""

POINTS = 100_000
"""Most points at which the interpolation error is measured."""

_NOISE = 1e-6
"""Least interpolation error in the sentence, pixels."""

_LEVEL = 1e-7
"""Least jump that counts, as a share of the largest height of an element."""
_LOW = 1e-3
"""Least jump that counts, pixels: a ramp of 0.06°."""

_SHARE = 0.5
"""Least share of the rise between two pixels that a wall must have for the ramp to count."""

_TESTS = 1 << 15
"""Least number of pairs tested over a grid, divided among windows by their pixels."""
_PIXELS_PER_TEST = 1 << 14
"""Pixels per tested pair in grids too large for `_TESTS`."""
_LEAST_TESTS = 32
"""Least number of pairs tested in a window."""

_UNIT = 1 << 20
"""Parts of a pixel in which lengths are summed, as integers: the order has no effect."""


@dataclass(frozen=True, slots=True)
class SteepestRamp:
    """The steepest ramp that replaces a wall, between two pixels.

    Attributes:
        degrees: slope of the ramp.
        rise: difference of the two stored heights, world units.
        x, y: middle between the pixel centres, world units.
    """

    degrees: float
    rise: float
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class LargestJump:
    """The highest wall between two neighbouring pixels.

    Attributes:
        height: height of the wall, world units.
        x, y: middle between the pixel centres, world units.
    """

    height: float
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class WallLoss:
    """Walls that became ramps.

    Attributes:
        length: length of all walls in plan, world units; corrected for their direction, so that
            oblique and round walls count in full.
        pairs: number of pairs of neighbours with a wall between them.
        estimated: whether `length` and `pairs` are estimates from a sample of the walls;
            `largest_jump` is then the largest of the sample.
        steepest_ramp: steepest ramp of which a wall makes up half or more; None without one.
        largest_jump: highest wall; None without walls.
    """

    length: float
    pairs: int
    estimated: bool
    steepest_ramp: SteepestRamp | None
    largest_jump: LargestJump | None


@dataclass(frozen=True, slots=True)
class SubpixelFeature:
    """An element, or a detail of its curves, that is narrower than a pixel.

    Attributes:
        element: JSON pointer of the element or track.
        width: width of the element or the detail, world units.
    """

    element: str
    width: float


@dataclass(frozen=True, slots=True)
class SubpixelFeatures:
    """All features narrower than a pixel.

    Attributes:
        count: number of features.
        first: up to FIRST of the features, in the order of the definition.
    """

    count: int
    first: tuple[SubpixelFeature, ...]


@dataclass(frozen=True, slots=True)
class InterpolationError:
    """Error of bilinear interpolation between the pixels, against the terrain.

    Attributes:
        points: number of points measured.
        largest: largest absolute difference, world units.
        rms: root mean square difference, world units.
        x, y: position of the largest difference, world units.
        element: JSON pointer of the element at that position; None for none.
    """

    points: int
    largest: float
    rms: float
    x: float
    y: float
    element: str | None


@dataclass(frozen=True, slots=True)
class RasterLoss:
    """Losses of a grid over a terrain; lengths are in world units.

    Attributes:
        walls: walls that became ramps.
        narrow_elements: elements and tracks narrower than a pixel.
        narrow_details: other elements with a straight stretch of a curve narrower than a pixel.
        nodata: number of pixels without a height.
        interpolation: error between the pixels; None where no four neighbours have heights.
        left_out: number of elements, where they are too many for walls and narrow features to be
            looked for; else 0.
        hidden: what is below the highest top; unset for terrains without storeys.
    """

    walls: WallLoss
    narrow_elements: SubpixelFeatures
    narrow_details: SubpixelFeatures
    nodata: int
    interpolation: InterpolationError | None
    left_out: int = 0
    hidden: HiddenLoss | UnsetType = UNSET

    def sentence(self, resolution: float, pixel: str = "pixel") -> str:
        """One line about all losses; `resolution` is the side of a pixel, `pixel` its name."""
        parts = [] if self.hidden is UNSET else self.hidden.phrases(resolution, pixel)
        ramp, jump = self.walls.steepest_ramp, self.walls.largest_jump
        if jump:
            about = "about " if self.walls.estimated else ""
            slope = f" of up to {ramp.degrees:.1f}°" if ramp else ""
            parts.append(
                f"{about}{metres(self.walls.length)} of wall became ramps{slope} "
                f"({metres(jump.height)} in one {pixel})"
            )
        for features, (one, several), what in (
            (self.narrow_elements, ("is", "are"), f"narrower than a {pixel}"),
            (self.narrow_details, ("has", "have"), f"details narrower than a {pixel}"),
        ):
            if features.count:
                verb = one if features.count == 1 else several
                parts.append(f"{count_of(features.count, 'element')} {verb} {what}")
        if self.interpolation and self.interpolation.largest > _NOISE * resolution:
            parts.append(
                f"{pixel}s differ from the model by up to {metres(self.interpolation.largest)}"
            )
        if self.left_out:
            parts.append(
                f"walls and what is narrower than a {pixel} were not looked for, among "
                f"{count_of(self.left_out, 'element')}"
            )
        if not parts:
            return f"Lost: nothing; no walls, nothing narrower than a {pixel}."
        return f"Lost: {'; '.join(parts)}."


def subpixel_features(terrain: Terrain, grid: Grid) -> tuple[SubpixelFeatures, SubpixelFeatures]:
    """Find elements and tracks narrower than a pixel, then other elements with narrower details.

    The width of an element is the shorter side of its cells. Details are those of `finest_details`.
    """
    # less the rounding of cell edges far from the origin
    side = grid.resolution * (1 - 1e-9) - 4 * np.spacing(np.abs(terrain.bounds).max())
    narrow, detailed = _narrow_elements(terrain, grid, side)
    slim, track_widths = _tracks(terrain, grid)
    slim &= track_widths < side
    tracks = terrain.first_track + np.flatnonzero(slim)
    found = [narrow, _Widths(tracks, track_widths[slim])], [detailed]
    for sheet in _sheets(terrain):
        for kind, one in zip(found, _narrow_elements(sheet.top, grid, side), strict=True):
            own = sheet.storeys[one.elements] >= 0
            kind.append(_Widths(sheet.numbers[one.elements[own]], one.widths[own]))
    narrow, detailed = (_Widths(*map(np.concatenate, zip(*kind, strict=True))) for kind in found)
    return _features(terrain, narrow), _features(terrain, detailed)


def _sheets(terrain: Terrain) -> tuple[StoreySheet, ...]:
    return () if terrain.storeys is None else terrain.storeys.sheets


class _Widths(NamedTuple):
    """Elements by their numbers, and widths of them or of their details, (n,) each."""

    elements: NDArray[np.int64]
    widths: Floats


def _narrow_elements(terrain: Terrain, grid: Grid, side: float) -> tuple[_Widths, _Widths]:
    """Elements of a plain terrain narrower than a side, and others with narrower details."""
    west, south, east, north = terrain.footprints()
    low_x, low_y, high_x, high_y = grid.bounds
    within = (west < high_x) & (east > low_x) & (south < high_y) & (north > low_y)
    west, south, east, north = terrain.cells()
    wide, tall = east - west, north - south
    widths = np.minimum(wide, tall)
    narrow = within & (widths < side)
    details = finest_details(terrain.arrays, wide, tall)
    detailed = within & ~narrow & (details < side)
    return (
        _Widths(np.flatnonzero(narrow), widths[narrow]),
        _Widths(np.flatnonzero(detailed), details[detailed]),
    )


def _tracks(terrain: Terrain, grid: Grid) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which tracks may reach the grid, by rectangles around their segments, and track widths."""
    tracks = terrain.arrays.tracks
    segments, reach = tracks.segments, tracks.segments["reach"]
    west, south, east, north = grid.bounds
    within = (
        (np.minimum(segments["x"], segments["end_x"]) - reach < east)
        & (np.maximum(segments["x"], segments["end_x"]) + reach > west)
        & (np.minimum(segments["y"], segments["end_y"]) - reach < north)
        & (np.maximum(segments["y"], segments["end_y"]) + reach > south)
    )
    reached = np.zeros(terrain.tracks, np.bool_)
    reached[segments["track"][within]] = True
    return reached, 2.0 * reach[tracks.first[:-1]]


def _features(terrain: Terrain, found: _Widths) -> SubpixelFeatures:
    first = tuple(
        SubpixelFeature(str(terrain.pointer(number)), width)
        for number, width in zip(
            found.elements[:FIRST].tolist(), found.widths[:FIRST].tolist(), strict=True
        )
    )
    return SubpixelFeatures(len(found.elements), first)


def interpolation_error(
    terrain: Terrain, grid: Grid, dtype: np.dtype[Any]
) -> InterpolationError | None:
    """Measure the interpolation error at up to POINTS points; None if no point has four heights.

    Half of the points are evenly spread, half are the middles of elements. Pixels have the heights
    of queries at their centres, rounded to `dtype`.
    """
    columns = grid.columns(Window(0, 0, 1, grid.width))
    rows = grid.rows(Window(0, 0, grid.height, 1))[::-1]
    x, y = _points(terrain, columns, rows)
    at_x, part_x = _between(columns, x)
    at_y, part_y = _between(rows, y)
    next_x, next_y = np.minimum(at_x + 1, grid.width - 1), np.minimum(at_y + 1, grid.height - 1)

    def pixels(i: NDArray[np.int64], j: NDArray[np.int64]) -> Floats:
        with np.errstate(over="ignore"):
            stored = terrain.height(columns[i], rows[j]).astype(dtype)
        return np.asarray(stored, np.float64)

    south = (1 - part_x) * pixels(at_x, at_y) + part_x * pixels(next_x, at_y)
    north = (1 - part_x) * pixels(at_x, next_y) + part_x * pixels(next_x, next_y)
    off = np.abs((1 - part_y) * south + part_y * north - terrain.height(x, y))
    known = np.flatnonzero(np.isfinite(off))
    if not len(known):
        return None
    worst = known[off[known].argmax()]
    largest = float(off[worst])
    scaled = off[known] / largest if largest else off[known]
    return InterpolationError(
        points=len(known),
        largest=largest,
        rms=largest * float(np.sqrt(np.mean(scaled**2))),
        x=float(x[worst]),
        y=float(y[worst]),
        element=terrain.element(x[worst], y[worst]),
    )


def _points(terrain: Terrain, columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """X and y of points on the terrain between the outermost pixel centres."""
    west, south, east, north = terrain.bounds
    low_x, high_x = max(west, columns[0]), min(east, columns[-1])
    low_y, high_y = max(south, rows[0]), min(north, rows[-1])
    half = min(POINTS, 4 * len(columns) * len(rows)) // 2
    x, y = spread_points((low_x, low_y, high_x, high_y), half)
    whole = terrain.written_out_or_none
    cells = [np.empty((4, 0)) if whole is None else whole.cells()]
    cells += [sheet.top.cells()[:, sheet.storeys >= 0] for sheet in _sheets(terrain)]
    left, bottom, right, top = np.concatenate(cells, axis=1)
    middle_x, middle_y = left + (right - left) / 2, bottom + (top - bottom) / 2
    inside = np.flatnonzero(
        (low_x <= middle_x) & (middle_x <= high_x) & (low_y <= middle_y) & (middle_y <= high_y)
    )
    if len(inside) > half:
        inside = inside[np.arange(half) * len(inside) // half]
    return np.concatenate([x, middle_x[inside]]), np.concatenate([y, middle_y[inside]])


def _between(centres: Floats, at: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Index of the last centre at or before each coordinate, and the share of the gap behind it."""
    i = np.clip(np.searchsorted(centres, at, side="right") - 1, 0, max(0, len(centres) - 2))
    if len(centres) == 1:
        return i, np.zeros(len(at))
    gap = centres[i + 1] - centres[i]
    part = np.divide(at - centres[i], gap, out=np.zeros(len(at)), where=gap > 0)
    return i, np.clip(part, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class LossCounts:
    """Wall losses of a part of a grid; parts can be summed in any order.

    Pairs are negative numbers by `LossFinder`, so that of equal losses the first pair is largest.

    Attributes:
        candidates: number of pairs of neighbours that may have a wall between them.
        tested: number of candidates tested.
        pairs: number of pairs with a wall, extrapolated from the tested ones.
        length: length of these walls in plan, 2⁻²⁰ pixels.
        steepest: largest rise in a pair with a wall, world units, and the pair.
        highest: highest wall tested, world units, and the pair.
        hidden: what is below the highest tops.
    """

    candidates: int = 0
    tested: int = 0
    pairs: int = 0
    length: int = 0
    steepest: tuple[float, int] = (0.0, 0)
    highest: tuple[float, int] = (0.0, 0)
    hidden: HiddenCounts = NOTHING_HIDDEN

    def __add__(self, other: LossCounts) -> LossCounts:
        return LossCounts(
            self.candidates + other.candidates,
            self.tested + other.tested,
            self.pairs + other.pairs,
            self.length + other.length,
            max(self.steepest, other.steepest),
            max(self.highest, other.highest),
            self.hidden + other.hidden,
        )


class LossFinder:
    """Finder of the losses of a grid, window by window; thread-safe.

    In a window with too many candidates an evenly spread sample is tested, and the rest estimated;
    the sample depends on the window alone. The steepest ramp stays exact: candidates steeper than
    the steepest of the sample are tested, too, up to as many again. A ramp counts as a wall's if
    the wall makes up half or more of the rise. With too many elements no walls are looked for.

    Args:
        terrain: terrain of the grid.
        grid: pixels over the terrain.
        dtype: data type of the heights in the file.
        storeys: whether the heights are those of the highest tops, rather than of the ground alone.
    """

    def __init__(
        self,
        terrain: Terrain,
        grid: Grid,
        dtype: DTypeLike = np.float32,
        *,
        storeys: bool = False,
    ) -> None:
        whole = terrain.written_out_or_none
        self.for_walls = whole is not None
        """Whether walls are looked for, which needs labels."""
        terrain = whole or terrain
        self._terrain = terrain = terrain if storeys else terrain.ground_alone
        self._grid = grid
        self._dtype = np.dtype(dtype)
        self.hidden = None if terrain.storeys is None else HiddenFinder(terrain, grid)
        """Finder of what is below the highest tops; None without storeys."""
        self._finders = WallFinders(terrain, storeys)
        fields = [terrain, *(sheet.top for sheet in _sheets(terrain))]
        largest = max(float(largest_heights(field.arrays).max()) for field in fields)
        self._level = max(_LEVEL * largest, _LOW * grid.resolution)

    def with_neighbours(self, window: Window) -> Window:
        """Window with one more row to the south and column to the east, within the grid."""
        return Window(
            window.row,
            window.column,
            min(window.height + 1, self._grid.height - window.row),
            min(window.width + 1, self._grid.width - window.column),
        )

    def of(self, window: Window, planes: Planes) -> LossCounts:
        """Count wall losses between the pixels of a window and their east and south neighbours.

        Args:
            window: window of the grid.
            planes: heights and labels of the window `with_neighbours`.
        """
        if not self.for_walls:
            return LossCounts()
        whole, resolution = self.with_neighbours(window), self._grid.resolution
        heights, labels = planes.heights, planes.labels
        if labels is None or not labels.shape == heights.shape == (whole.height, whole.width):
            raise ValueError(f"heights and labels of {whole.height} × {whole.width} are wanted")
        heights, labels = np.ascontiguousarray(heights), np.ascontiguousarray(labels)
        pairs, rises = kernels.find_candidates(labels, heights, window.height, window.width)
        count = len(pairs)
        if not count:
            return LossCounts()
        pixels, all_pixels = window.height * window.width, self._grid.height * self._grid.width
        tests = max(_TESTS, all_pixels // _PIXELS_PER_TEST)
        chosen = _spread(count, max(_LEAST_TESTS, tests * pixels // all_pixels))
        x, y = self._grid.columns(whole), self._grid.rows(whole)
        jumps, lengths = np.empty(len(chosen)), np.empty(len(chosen))
        with self._finders.one() as finder:
            kernels.measure_walls(
                finder, pairs[chosen], x, y, resolution, self._level, jumps, lengths
            )
        share = count / len(chosen)
        steepest, highest = (0.0, 0), (0.0, 0)
        if jumps.any():
            at = int(jumps.argmax())
            highest = float(jumps[at]), -self._name(whole, int(pairs[chosen[at]]))
            risen = np.where(jumps >= _SHARE * rises[chosen], rises[chosen], -1.0)
            at = int(risen.argmax())
            if risen[at] > 0:
                steepest = float(risen[at]), -self._name(whole, int(pairs[chosen[at]]))
        if len(chosen) < count:
            steeper = np.flatnonzero(rises > steepest[0])
            steeper = steeper[np.argsort(-rises[steeper], kind="stable")][: len(chosen)]
            with self._finders.one() as finder:
                at, jump = kernels.first_wall(
                    finder, pairs[steeper], _SHARE * rises[steeper], x, y, resolution, self._level
                )
            if at >= 0:
                name = -self._name(whole, int(pairs[steeper[at]]))
                steepest = float(rises[steeper[at]]), name
                highest = max(highest, (float(jump), name))
        return LossCounts(
            candidates=count,
            tested=len(chosen),
            pairs=round(share * int((jumps > 0).sum())),
            length=round(share * math.fsum(lengths) * _UNIT),
            steepest=steepest,
            highest=highest,
        )

    def statement(self, part: LossCounts, nodata: int) -> RasterLoss:
        """Losses of the whole grid, from the sum of its windows and its number of nodata pixels."""
        resolution = self._grid.resolution
        (rise, ramp), (height, jump) = part.steepest, part.highest
        degrees = math.degrees(math.atan2(rise, resolution))
        walls = WallLoss(
            length=part.length / _UNIT * resolution,
            pairs=part.pairs,
            estimated=part.tested < part.candidates,
            steepest_ramp=SteepestRamp(degrees, rise, *self._middle(ramp)) if ramp else None,
            largest_jump=LargestJump(height, *self._middle(jump)) if jump else None,
        )
        narrow = details = SubpixelFeatures(0, ())
        if self.for_walls:
            narrow, details = subpixel_features(self._terrain, self._grid)
        interpolation = interpolation_error(self._terrain, self._grid, self._dtype)
        left_out = 0 if self.for_walls else self._terrain.elements
        hidden = UNSET if self.hidden is None else self.hidden.loss(part.hidden)
        return RasterLoss(walls, narrow, details, nodata, interpolation, left_out, hidden)

    def _name(self, window: Window, pair: int) -> int:
        """Number of a pair in the grid, from 1, by its number in a window."""
        row, column = divmod(pair >> 1, window.width)
        pixel = (window.row + row) * self._grid.width + window.column + column
        return 2 * pixel + (pair & 1) + 1

    def _middle(self, name: int) -> tuple[float, float]:
        """World x and y of the middle between two pixels, by the negative number of the pair."""
        pair = -name - 1
        row, column = divmod(pair >> 1, self._grid.width)
        two = Window(row, column, 1 + (pair & 1), 2 - (pair & 1))
        return float(self._grid.columns(two).mean()), float(self._grid.rows(two).mean())


def _spread(count: int, limit: int) -> NDArray[np.int64]:
    """At most `limit` of `count` indices, ascending, one from each of equal stretches."""
    if count <= limit:
        return np.arange(count)
    stretches = np.arange(limit + 1) * count // limit
    # multiples of the golden section avoid aliasing with regular terrains
    places = np.mod(np.arange(limit) * 0.6180339887498949, 1.0)
    indices: NDArray[np.int64] = stretches[:-1] + (places * np.diff(stretches)).astype(np.int64)
    return indices
