"""A traversability map: a verdict for each pixel, connected ground, and a summary."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Crew
from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.io.crs import shown_crs
from terratool.io.geotiff import TILE
from terratool.kernels import traversability as kernels
from terratool.raster.grid import DEFAULT_PIXELS, Grid, Window, window_name
from terratool.raster.painter import id_type
from terratool.tasks import Work
from terratool.traversability.fineness import coarsest_resolution
from terratool.traversability.layers import (
    copy_from_owners,
    ground_tops,
    rings,
    top_of_layer,
    tops_of_sheet,
)
from terratool.traversability.map_files import MapBands, MapFiles, empty_bands, further_bands
from terratool.traversability.map_results import CHANCE_BOUNDS, LargestPart, MapSummary, Preview
from terratool.traversability.route.reach import (
    Bits,
    Connected,
    FloodPlaces,
    begin_at,
    begin_in_largest,
    bits_type,
    can_turn_back,
    connected_cells,
    heading_bits,
    place_in,
)
from terratool.traversability.survey import Surveyor, WindowMeasures
from terratool.traversability.tiles import part_of
from terratool.traversability.turning import Turning
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import RANKS, GroundClass, Reason, Verdict

MOST = 10.0
"""Largest share of a limit that is written; larger ones are written as this."""

PICTURE = 1600
"""Most pixels on the longer side of a map for a picture."""

_WHEEL_PART = 4
"""Pixels of a map per wheel radius by default."""


def map_bands(measures: WindowMeasures, inside: NDArray[np.bool_]) -> MapBands:
    """Reduce the measures of all headings to one number for each pixel and band of a map.

    The best heading has the best verdict, and among equal verdicts the most in reserve; the worst
    heading has the worst verdict, and the least in reserve. Of equals the first from north counts.
    Headings with which the vehicle stands over the rim count only where there are no others.
    Pixels not `inside` the terrain, (height, width), are NaN, or 0 in bands of integers.
    """
    share = measures.numbers[:, kernels.UTILISATION].astype(np.float64)
    reserve = np.ones_like(share)
    np.divide(share, 1.0 + share, out=reserve, where=np.isfinite(share))
    order = 2.0 * RANKS[measures.verdict] + reserve
    over = measures.reason == Reason.EDGE
    best = np.argmin(np.where(over, np.inf, order), axis=0)[None]
    worst = np.argmax(np.where(over, -1.0, order), axis=0)[None]

    def at(heading: Any, values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(np.take_along_axis(values, heading, axis=0)[0])

    along, across = (measures.numbers[:, n] for n in (kernels.PITCH, kernels.ROLL))
    go = measures.verdict == Verdict.GO
    verdict = at(best, measures.verdict)
    bands = (
        (go | (measures.verdict == Verdict.CAUTION)).sum(axis=0),
        np.minimum(at(best, share), MOST),
        np.minimum(at(worst, share), MOST),
        *(np.degrees(at(heading, slope)) for heading in (best, worst) for slope in (along, across)),
        measures.step.max(axis=0),
        np.fmax.reduce(measures.rough),
        np.fmin.reduce(measures.clearance),
        np.fmin.reduce(measures.overhang),
        np.fmax.reduce(measures.numbers[:, kernels.SINKAGE]),
        np.fmin.reduce(measures.numbers[:, kernels.DRAWBAR]),
        np.fmin.reduce(measures.numbers[:, kernels.RESERVE]),
        go.sum(axis=0),
        *(np.degrees(at(heading, measures.numbers[:, kernels.CRAB])) for heading in (best, worst)),
    )
    numbers = np.stack(bands).astype(np.float32)
    reserve_band = numbers[-4]
    reserve_band[reserve_band >= np.float32(math.pi)] = np.nan
    np.degrees(reserve_band, out=reserve_band)
    if measures.headroom is not None:
        numbers = np.concatenate([numbers, np.fmin.reduce(measures.headroom)[None]])
    if measures.foothold is not None:
        numbers = np.concatenate([numbers, (1.0 - measures.foothold)[None]])
    if measures.chance is not None:
        known = verdict != Verdict.UNKNOWN
        numbers = np.concatenate([numbers, np.where(known, measures.chance, np.nan)[None]])
    numbers[:, ~inside] = np.nan
    numbers[~np.isfinite(numbers)] = np.nan
    classes = np.stack(
        [at(worst, measures.verdict), at(best, measures.reason), at(worst, measures.reason)]
    )
    return MapBands(
        np.where(inside, verdict, 0).astype(np.uint8)[None],
        np.where(inside, classes, 0).astype(np.uint8),
        numbers,
    )


def default_resolution(
    terrain: Terrain, vehicle: Vehicle, bounds: Bounds | None = None, most: int = DEFAULT_PIXELS
) -> tuple[float, str]:
    """A resolution for a map, m, and in words why: a quarter of the wheel's radius, or coarser.

    `most` is the largest number of pixels on the longer side of the bounds, or of the terrain.

    Raises:
        RequestError: the bounds are empty or miss the terrain; or `most` pixels are too few.
    """
    finest, of = vehicle.wheel.radius / _WHEEL_PART, "the wheel's radius"
    if vehicle.tracks or vehicle.feet:
        of = "the sprocket's radius" if vehicle.tracks else "a foot's step"
    if bounds is not None:
        check_bounds(bounds, terrain)
    west, south, east, north = clip_bounds(terrain, bounds)
    longest, shortest = max(east - west, north - south), min(east - west, north - south)
    if longest / finest <= most:
        return min(finest, shortest), f"a quarter of {of}"
    resolution, coarsest = longest / most, coarsest_resolution(vehicle)
    if resolution > coarsest:
        raise RequestError(
            f"The ground is {longest:.12g} m long, too long for the {most} pixels that a map has "
            f"by default: they would be {resolution:.4g} m, and {vehicle.size_words} m take at "
            f"most {coarsest:.4g} m.",
            "Look at a part of it with --bounds W S E N, or choose the pixels with --resolution.",
        )
    return min(resolution, shortest), f"{most} pixels on the longer side"


class WindowParts(NamedTuple):
    """Parts of the measures of a window that a map keeps, (height, width) unless said otherwise.

    Attributes:
        bands: bands for files.
        ground: bool, whether there is ground.
        surfaces: index of the surface and one, 0 for none.
        bits: headings with which the vehicle drives, as bits.
        onward: the same if the ground went on beyond the rim.
        heights: (rows, columns) float32 heights of the pixels of the preview in the window, m.
        own: bool, whether a layer has them; None on terrains without storeys.
        shown: int16 sheet that a layer shows; None on terrains without storeys.
    """

    bands: MapBands
    ground: NDArray[np.bool_]
    surfaces: NDArray[Any]
    bits: Bits
    onward: Bits
    heights: NDArray[np.float32]
    own: NDArray[np.bool_] | None = None
    shown: NDArray[np.int16] | None = None

    @classmethod
    def of(cls, surveyor: Surveyor, window: Window, measures: WindowMeasures) -> WindowParts:
        """Take what a map keeps of the measures of a window of a surveyor's grid."""
        ground = ~np.isnan(measures.heights)
        drives = (measures.verdict == Verdict.GO) | (measures.verdict == Verdict.CAUTION)
        drives &= np.isfinite(measures.numbers[:, kernels.ENERGY])
        stride = _stride(surveyor.grid)
        _, flat = surveyor.stack.split(window)
        rows, columns = _thinned(flat, stride)
        at = np.ix_(rows * stride - flat.row, columns * stride - flat.column)
        inside = surveyor.is_inside(window) if measures.own is None else measures.own
        return cls(
            map_bands(measures, inside),
            ground,
            measures.surfaces,
            heading_bits(drives & ground),
            heading_bits((measures.onward != 0) & ground),
            measures.heights[at],
            measures.own,
            measures.shown,
        )


def _stride(grid: Grid) -> int:
    """Pixels of a map for each pixel of its preview, along each side."""
    return -(-max(grid.height, grid.width) // PICTURE)


def _thinned(window: Window, stride: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of a preview whose pixels lie in a window of the map."""
    rows, columns = (
        np.arange(-(-first // stride), -(-(first + count) // stride))
        for first, count in ((window.row, window.height), (window.column, window.width))
    )
    return rows, columns


class MapBuilder:
    """A map that is built from windows, in any order.

    On a terrain with storeys arrays have all layers, one below the other.

    Memory is 6 bytes for each pixel, two bytes more for over 8 headings; 73 bytes where all bands
    are kept, and 4 more where soils are sampled.

    Args:
        terrain: the ground.
        surveyor: the surveyor, whose grid and headings the map has.
        keep: whether all bands are kept.
        turns: turning on the spot on each surface, by id; possible everywhere if empty.
    """

    def __init__(
        self, terrain: Terrain, surveyor: Surveyor, keep: bool, turns: Sequence[Turning] = ()
    ) -> None:
        grid = surveyor.grid
        self.stack = surveyor.stack
        flat = self.stack.shape
        self.surveyor = surveyor
        self.terrain, self.grid, self.headings = terrain, grid, surveyor.headings
        self.sampled = surveyor.uncertainty is not None
        self.further = further_bands(
            roofed=self.stack.layers > 1, walks=surveyor.vehicle.feet is not None,
            sampled=self.sampled,
        )  # fmt: skip
        self.kept = empty_bands(flat, self.further) if keep else None
        self.chance = np.full(flat, np.nan, np.float32) if self.sampled else None
        self.reason = np.zeros(flat, np.uint8)
        self.verdict, self.worst = np.zeros((2, *flat), np.uint8)
        self.ground = np.zeros(flat, np.bool_)
        self.surfaces = np.zeros(flat, id_type(terrain))
        self.bits, self.onward = np.zeros((2, *flat), bits_type(self.headings))
        self._able = np.array([turn.possible for turn in turns], np.bool_)
        self._stride = _stride(grid)
        size = tuple(-(-side // self._stride) for side in (grid.height, grid.width))
        self._heights = np.full((self.stack.layers, *size), np.nan, np.float32)
        self.own = np.zeros(flat, np.bool_) if self.stack.layers > 1 else None
        self._shown = np.full(flat, -1, np.int16) if self.stack.layers > 1 else None

    def take(self, window: Window, measures: WindowMeasures) -> None:
        """Add the measures of a window to the map."""
        self.add(window, WindowParts.of(self.surveyor, window, measures))

    def add(self, window: Window, parts: WindowParts) -> None:
        """Add what a map keeps of a window."""
        if parts.shown is not None and (parts.shown < 0).all() and not np.any(parts.own):
            return  # a layer that has and shows nothing there
        bands, part = parts.bands, part_of(window)
        self.verdict[part], self.reason[part] = bands.verdict[0], bands.classes[1]
        self.worst[part] = bands.classes[0]
        if self.chance is not None:
            self.chance[part] = bands.numbers[-1]
        self.ground[part], self.surfaces[part] = parts.ground, parts.surfaces
        self.bits[part], self.onward[part] = parts.bits, parts.onward
        if self.kept is not None:
            for whole, pixels in zip(self.kept, bands, strict=True):
                whole[:, *part] = pixels
        number, flat_window = self.stack.split(window)
        self._heights[number][np.ix_(*_thinned(flat_window, self._stride))] = parts.heights
        if self.own is not None and self._shown is not None:
            assert parts.own is not None and parts.shown is not None
            self.own[part], self._shown[part] = parts.own, parts.shown

    def write(self, files: MapFiles, number: int) -> None:
        """Write the bands that were kept into files, those of a sheet as in `of_sheet`."""
        assert self.kept is not None
        whole = [self.of_sheet(plane, number) for plane in self.kept]
        for window in self.grid.windows(TILE, TILE):
            parts = (np.ascontiguousarray(plane[:, *part_of(window)]) for plane in whole)
            files.write(window, MapBands(*parts))

    def of_sheet(self, plane: NDArray[Any], number: int) -> NDArray[Any]:
        """Values of a sheet of storeys by its number from 1 on; those of the ground for 0."""
        if self.own is None:
            return plane
        if number == 0:
            return ground_tops(plane, self.own, self.ground, self.stack)
        return tops_of_sheet(plane, self.own, number, self.stack)

    def preview(self, classes: NDArray[np.uint8], reached: NDArray[np.bool_] | None) -> Preview:
        """The map for pictures, thinned by a stride from the north-west."""
        first, *storeys = (
            self._preview(classes, reached, number) for number in range(self.stack.sheets)
        )
        return replace(first, storeys=tuple(storeys))

    def _preview(
        self, classes: NDArray[np.uint8], reached: NDArray[np.bool_] | None, number: int
    ) -> Preview:
        """The picture of a sheet, as in `of_sheet`."""
        grid, stride = self.grid, self._stride
        size, (_, height, width) = grid.resolution * stride, self._heights.shape
        north = grid.bounds[3]
        heights = self._heights[number].copy()
        sheets = self.stack.sheets
        for layer in (
            self.stack.by_sheets if number == 0 else range(number, len(self._heights), sheets)
        ):
            np.copyto(heights, self._heights[layer], where=np.isnan(heights))

        def thinned(plane: NDArray[Any]) -> NDArray[Any]:
            return self.of_sheet(plane, number)[::stride, ::stride]

        return Preview(
            Grid(grid.west, north - height * size, size, height, width),
            heights,
            thinned(classes),
            "" if self.terrain.crs is None else shown_crs(self.terrain.crs).strip('"'),
            thinned(self.worst_classes(classes)),
            thinned(self.bits | self.onward),
            self.headings,
            None if reached is None else thinned(reached),
        )

    def worst_classes(self, classes: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Classes with the verdict of the worst heading where they are verdicts of the best."""
        judged = classes <= GroundClass.NO_GO
        return np.asarray(np.where(judged, self.worst, classes), np.uint8)

    def classes(
        self, begin: Bits | None, area: float, progress: Callable[[float], object] | None = None
    ) -> tuple[NDArray[np.uint8], Connected]:
        """Classes of the pixels, (height, width) uint8 `GroundClass`, and the connected ground.

        Ground that is barred, cut off or one-way only as the terrain ends there is EDGE.

        Args:
            begin: states from which the vehicle sets out; the largest part of the ground if None,
                unless it is smaller than the vehicle.
            area: area of the vehicle seen from above, m².
            progress: called with the further share of the pixels that is done.
        """
        floods = 5 if begin is None else 4
        tell = (lambda more: progress(more / floods)) if progress else None
        places, first = self._places(), begin
        bits, onward = self.bits, self.onward
        if self.own is not None:
            bits, onward = self._copied(bits), self._copied(onward)
        radius = self.surveyor.vehicle.turning_radius / self.grid.resolution
        if first is None:
            first = begin_in_largest(bits, self.headings, tell, places, radius)
        found = connected_cells(bits, self.headings, first, tell, places, radius)
        if self.own is not None:
            found = Connected(found.reached & self.own, found.returned & self.own)
        classes = self.verdict.copy()
        drives = self.bits != 0
        least = area / self.grid.resolution**2
        if begin is None and np.count_nonzero(found.returned) < max(least, 2.0):
            nothing = np.zeros_like(drives)
            found = Connected(nothing, nothing)
            one_way = ~can_turn_back(self.bits, self.headings)
        else:
            one_way = found.reached & ~found.returned
        classes[drives & ~found.reached] = GroundClass.CUT_OFF
        classes[drives & one_way] = GroundClass.ONE_WAY
        edge = self.ground & (self.verdict == Verdict.NO_GO) & (self.reason == Reason.EDGE)
        classes[edge] = GroundClass.EDGE
        barred = (self.onward != 0) & (classes > GroundClass.CAUTION) & ~edge
        if found.returned.any() and (onward != bits).any() and barred.any():
            # nothing but the end of the file bars what is reached if the ground goes on there
            more = connected_cells(onward, self.headings, first, tell, places, radius)
            classes[barred & more.returned] = GroundClass.EDGE
        elif tell:
            tell(2.0)
        return classes, found

    def _copied(self, plane: NDArray[Any]) -> NDArray[Any]:
        """Values of all layers, with those of what each layer shows of others."""
        assert self.own is not None and self._shown is not None
        return copy_from_owners(plane, self.own, self._shown, self.stack)

    def _places(self) -> FloodPlaces:
        """Pixels where the vehicle can turn on the spot, and those that are the same place."""
        turns = None if self._able.all() else self._able[self.surfaces]
        if self._shown is None:
            return FloodPlaces(turns)
        return FloodPlaces(
            None if turns is None else self._copied(turns), rings(self._shown, self.stack)
        )

    def counted(self, classes: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Pixels that count in shares of the ground: those with ground, but EDGE."""
        counted: NDArray[np.bool_] = self.ground & (classes != GroundClass.EDGE)
        return counted

    def _largest(self, counted: NDArray[np.bool_], found: Connected) -> LargestPart | None:
        """The largest part, from the connected ground that was found; None where there is none."""
        if not found.returned.any():
            return None
        row, column = place_in(self.bits, self.headings, found, self._places())
        number, window = self.stack.split(Window(row, column, 1, 1))
        x, y = self.grid.columns(window)[0], self.grid.rows(window)[0]
        z = top_of_layer(self.terrain, x, y, self.stack.layer(number).sheet)
        share = np.count_nonzero(found.returned & counted) / np.count_nonzero(counted)
        return LargestPart((float(x), float(y), *z), share)

    def summary(
        self, classes: NDArray[np.uint8], found: Connected,
        start: tuple[float, ...] | None = None,
    ) -> MapSummary:  # fmt: skip
        """Count pixels with ground by class, reason and surface, and find the largest part.

        Args:
            classes: (height, width) uint8 `GroundClass`.
            found: connected ground.
            start: x and y from which ground counts as reached, m; None for the largest part.
        """
        ground, names = self.ground, ("", *self.terrain.surfaces)
        counted = self.counted(classes)
        here, worst = classes[ground], self.worst_classes(classes)[ground]
        shape = (len(names), len(GroundClass))
        pairs = self.surfaces[ground].astype(np.int64) * len(GroundClass) + here
        count = np.bincount(pairs, minlength=math.prod(shape)).reshape(shape)
        bound = ground & ((classes == GroundClass.CAUTION) | (classes == GroundClass.NO_GO))
        reasons = np.bincount(self.reason[bound], minlength=len(Reason)).tolist()
        return MapSummary(
            self.grid,
            self.headings,
            _by_ground(count.sum(axis=0)),
            _by_ground(np.bincount(worst, minlength=len(GroundClass))),
            {Reason(n): number for n, number in enumerate(reasons) if number},
            {name: _by_ground(row) for name, row in zip(names, count, strict=True) if row.any()},
            start,
            self._largest(counted, found) if start is None else None,
            None if self.chance is None else self._chances(counted),
        )

    def _chances(self, counted: NDArray[np.bool_]) -> dict[float, int]:
        """Number of pixels that count by the largest of `CHANCE_BOUNDS` they reach."""
        assert self.chance is not None
        known = self.chance[counted & np.isfinite(self.chance)]
        found, before = {}, 0
        for bound in CHANCE_BOUNDS:
            above = int(np.count_nonzero(known >= np.float32(bound)))
            found[bound] = above - before
            before = above
        return found


def _by_ground(counts: NDArray[np.int64]) -> dict[GroundClass, int]:
    """Label counts by class."""
    return dict(zip(GroundClass, counts.tolist(), strict=True))


def stream_map(
    surveyor: Surveyor,
    builder: MapBuilder,
    files: MapFiles | None,
    crew: Crew,
    progress: Callable[[int], object] | None = None,
) -> None:
    """Judge a grid tile by tile: give each to the builder, and its bands to the files."""
    tiles = list(builder.stack.windows(TILE, TILE))
    work = Work(_judge_tile, surveyor, name=window_name)
    with contextlib.closing(crew.run(work, tiles)) as judged:
        for window, found in zip(tiles, judged, strict=True):
            whole = empty_bands((window.height, window.width), builder.further)
            for inner, parts in found:
                builder.add(inner, parts)
                local = Window(
                    inner.row - window.row, inner.column - window.column, inner.height, inner.width
                )
                for target, pixels in zip(whole, parts.bands, strict=True):
                    target[:, *part_of(local)] = pixels
            if files:
                files.write(window, whole)
            if progress:
                progress(window.height * window.width)


def _judge_tile(surveyor: Surveyor, window: Window) -> list[tuple[Window, WindowParts]]:
    """Judge a tile in windows that are small enough to be measured at once."""
    return [
        (inner, WindowParts.of(surveyor, inner, surveyor.measure(inner)))
        for inner in surveyor.windows(window)
    ]


def begin_of(builder: MapBuilder, start: tuple[float, ...] | None) -> Bits | None:
    """States at a start from which the vehicle sets out, headings as bits; None for no start."""
    if start is None:
        return None
    cell = builder.surveyor.cell_of(start)
    return np.zeros_like(builder.bits) if cell is None else begin_at(builder.bits, cell)
