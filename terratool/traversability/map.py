"""A traversability map: GeoTIFFs with a verdict for each pixel, and what adds up of it."""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.kernels import traversability as kernels
from terratool.output import refuse_existing, whole_file
from terratool.raster.export import COMPANIONS, checked_threads, refuse_full_disk
from terratool.raster.formats import raster_format
from terratool.raster.geotiff import (
    Compression,
    GeoTiff,
    RasterExtent,
    cog_options,
    crs_of,
    geotiff,
    name_categories,
    shown_crs,
    xml_bytes,
)
from terratool.raster.grid import DEFAULT_PIXELS, Grid, Window
from terratool.raster.layers import Bands, Layer
from terratool.raster.painter import id_type
from terratool.raster.prefetch import TILE, prefetch
from terratool.raster.statistics import BandStatistics, band_statistics
from terratool.raster.writers import copied
from terratool.traversability.results import (
    COLORS,
    RANKS,
    GroundClass,
    LargestPart,
    MapSummary,
    Preview,
    Reason,
    Verdict,
)
from terratool.traversability.route.reach import (
    Bits,
    Connected,
    begin_from,
    begin_in_largest,
    bits_type,
    can_turn_back,
    connected,
    heading_bits,
    place_in,
)
from terratool.traversability.survey import Surveyor, WindowMeasures, coarsest_resolution
from terratool.traversability.tiles import part_of
from terratool.traversability.vehicle import Vehicle

CLASS, NUMBER = "class", "number"

MOST = 10.0
"""Shares of limits beyond that are written as that."""

VERDICT = Bands(
    (Layer("verdict", ("verdict, best heading",), "", CLASS, mean=""),), np.dtype(np.uint8)
)
CLASSES = Bands(
    tuple(
        Layer(name, (name,), "", CLASS, mean="")
        for name in ("verdict, worst heading", "reason, best heading", "reason, worst heading")
    ),
    np.dtype(np.uint8),
)
NUMBERS = Bands(
    tuple(
        Layer(name, (name,), unit, NUMBER)
        for name, unit in (
            ("headings that are go or caution", ""),
            ("utilisation, best heading", "1"),
            ("utilisation, worst heading", "1"),
            ("slope along, best heading", "degree"),
            ("slope across, best heading", "degree"),
            ("slope along, worst heading", "degree"),
            ("slope across, worst heading", "degree"),
            ("step, highest", "m"),
            ("roughness, largest", "m"),
            ("clearance, least", "m"),
            ("room under overhangs, least", "m"),
            ("sinkage, deepest", "m"),
            ("drawbar pull left, least", "N"),
            ("tip-over margin, least", "degree"),
        )
    ),
    np.dtype(np.float32),
)
"""Slopes are positive nose up and left side up."""

PICTURE = 1600
"""The longer side of a map for a picture has at most so many pixels."""

_FILES = (VERDICT, CLASSES, NUMBERS)
_SUFFIXES = ("", "-classes", "-numbers")
_WHEEL_PART = 4


class MapBands(NamedTuple):
    """A window of a map, (bands, height, width) each.

    Attributes:
        verdict: uint8 `Verdict`, of `VERDICT` before it is known where the vehicle gets to.
        classes: uint8, of `CLASSES`.
        numbers: float32, of `NUMBERS`, NaN for what is not known or has no limit.
    """

    verdict: NDArray[Any]
    classes: NDArray[Any]
    numbers: NDArray[Any]


def map_bands(measures: WindowMeasures, inside: NDArray[np.bool_]) -> MapBands:
    """One number for all headings of a pixel; nothing where a pixel is not `inside` the terrain.

    The best heading is that of the best verdict, and of those the one with the most in reserve;
    the worst likewise. Of equals it is the first from north.
    """
    share = measures.numbers[:, kernels.UTILISATION].astype(np.float64)
    reserve = np.ones_like(share)
    np.divide(share, 1.0 + share, out=reserve, where=np.isfinite(share))
    order = 2.0 * RANKS[measures.verdict] + reserve
    best, worst = (chosen(order, axis=0)[None] for chosen in (np.argmin, np.argmax))

    def at(heading: Any, values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(np.take_along_axis(values, heading, axis=0)[0])

    along, across = (measures.numbers[:, n] for n in (kernels.PITCH, kernels.ROLL))
    drives = (measures.verdict == Verdict.GO) | (measures.verdict == Verdict.CAUTION)
    bands = (
        drives.sum(axis=0),
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
    )
    numbers = np.stack(bands).astype(np.float32)
    reserve_band = numbers[-1]
    reserve_band[reserve_band >= np.float32(math.pi)] = np.nan
    np.degrees(reserve_band, out=reserve_band)
    numbers[:, ~inside] = np.nan
    numbers[~np.isfinite(numbers)] = np.nan
    verdict = at(best, measures.verdict)
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
    """A resolution for a map, and in words why: a quarter of the wheel's radius, within reason.

    `most` is how many pixels the longer side of the bounds, or of the terrain, may have.

    Raises:
        RequestError: the bounds are empty or miss the terrain; or so many pixels are too few.
    """
    finest = vehicle.wheel.radius / _WHEEL_PART
    if bounds is not None:
        check_bounds(bounds, terrain)
    west, south, east, north = clip_bounds(terrain, bounds)
    longest, shortest = max(east - west, north - south), min(east - west, north - south)
    if longest / finest <= most:
        return min(finest, shortest), "a quarter of the wheel's radius"
    resolution, coarsest = longest / most, coarsest_resolution(vehicle)
    if resolution > coarsest:
        raise RequestError(
            f"The ground is {longest:.12g} m long, too long for the {most} pixels that a map has "
            f"by default: they would be {resolution:.4g} m, and wheels of radius "
            f"{vehicle.wheel.radius:g} m take at most {coarsest:.4g} m.",
            "Look at a part of it with --bounds W S E N, or choose the pixels with --resolution.",
        )
    return min(resolution, shortest), f"{most} pixels on the longer side"


def map_paths(path: str | Path) -> list[Path]:
    """The files of a map: verdicts of the best headings, other classes, numbers."""
    path = Path(path)
    return [path.with_name(f"{path.stem}{suffix}{path.suffix}") for suffix in _SUFFIXES]


class MapBuilder:
    """Gathers a map from windows, which several threads may bring in any order.

    Memory is 5 bytes for each pixel, or one more where there are more than 8 headings; 60 where
    all bands are kept.

    Args:
        terrain: the ground.
        grid: the pixels.
        headings: their number.
        keep: whether all bands are kept.
    """

    def __init__(self, terrain: Terrain, grid: Grid, headings: int, keep: bool) -> None:
        flat = (grid.height, grid.width)
        self.terrain, self.grid, self.headings = terrain, grid, headings
        self.kept = _empty_bands(flat) if keep else None
        self.reason = np.zeros(flat, np.uint8)
        self.verdict, self.worst = np.zeros((2, *flat), np.uint8)
        self.ground = np.zeros(flat, np.bool_)
        self.surfaces = np.zeros(flat, id_type(terrain))
        self.bits = np.zeros(flat, bits_type(headings))
        self._stride = -(-max(flat) // PICTURE)
        self._heights = np.full(
            tuple(-(-side // self._stride) for side in flat), np.nan, np.float32
        )

    def take(self, window: Window, measures: WindowMeasures) -> MapBands:
        """Take what was found out about a window; what the files have of it."""
        west, south, east, north = self.terrain.bounds
        x, y = self.grid.columns(window), self.grid.rows(window)
        inside = ((y >= south) & (y <= north))[:, None] & ((x >= west) & (x <= east))[None]
        bands, part = map_bands(measures, inside), part_of(window)
        self.verdict[part], self.reason[part] = bands.verdict[0], bands.classes[1]
        self.worst[part] = bands.classes[0]
        self.ground[part], self.surfaces[part] = ~np.isnan(measures.heights), measures.surfaces
        drives = (measures.verdict == Verdict.GO) | (measures.verdict == Verdict.CAUTION)
        drives &= np.isfinite(measures.numbers[:, kernels.ENERGY])
        self.bits[part] = heading_bits(drives & self.ground[part])
        if self.kept is not None:
            for whole, pixels in zip(self.kept, bands, strict=True):
                whole[:, *part] = pixels
        rows, columns = (
            np.arange(-(-first // self._stride), -(-(first + count) // self._stride))
            for first, count in ((window.row, window.height), (window.column, window.width))
        )
        if len(rows) and len(columns):
            at = np.ix_(rows * self._stride - window.row, columns * self._stride - window.column)
            self._heights[np.ix_(rows, columns)] = measures.heights[at]
        return bands

    def bands(self, window: Window) -> MapBands:
        """What was kept of a window."""
        assert self.kept is not None
        parts = (whole[:, *part_of(window)] for whole in self.kept)
        return MapBands(*map(np.ascontiguousarray, parts))

    def preview(self, classes: NDArray[np.uint8]) -> Preview:
        """The map for a picture: one pixel of each few, the first from the north-west."""
        grid, stride = self.grid, self._stride
        size, (height, width) = grid.resolution * stride, self._heights.shape
        north = grid.bounds[3]
        return Preview(
            Grid(grid.west, north - height * size, size, height, width),
            self._heights,
            classes[::stride, ::stride],
            "" if self.terrain.crs is None else shown_crs(self.terrain.crs).strip('"'),
        )

    def classes(
        self, begin: Bits | None, area: float, progress: Callable[[float], object] | None = None
    ) -> tuple[NDArray[np.uint8], Connected]:
        """What each pixel is, (height, width) uint8 `GroundClass`, and what is connected.

        Args:
            begin: states from which the vehicle sets out; the largest part of the ground if None,
                unless it is smaller than the vehicle.
            area: of the vehicle, seen from above, m².
            progress: is told what share more of the pixels is done.
        """
        floods = 3 if begin is None else 2
        tell = (lambda more: progress(more / floods)) if progress else None
        first = begin_in_largest(self.bits, self.headings, tell) if begin is None else begin
        found = connected(self.bits, self.headings, first, tell)
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
        return classes, found

    def largest(self, found: Connected) -> LargestPart | None:
        """The part that was found; None where there is none."""
        if not found.returned.any():
            return None
        row, column = place_in(self.bits, self.headings, found)
        window = Window(row, column, 1, 1)
        x, y = self.grid.columns(window)[0], self.grid.rows(window)[0]
        share = np.count_nonzero(found.returned) / np.count_nonzero(self.ground)
        return LargestPart((float(x), float(y)), share)

    def summary(
        self, classes: NDArray[np.uint8], found: Connected,
        start: tuple[float, float] | None = None,
    ) -> MapSummary:  # fmt: skip
        """The pixels with ground, counted, and what is connected to a start, or largest."""
        ground, names = self.ground, ("", *self.terrain.surfaces)
        here, judged = classes[ground], classes <= GroundClass.NO_GO
        worst = np.where(judged, self.worst, classes)[ground]
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
            self.largest(found) if start is None else None,
        )


def _by_ground(counts: NDArray[np.int64]) -> dict[GroundClass, int]:
    return dict(zip(GroundClass, counts.tolist(), strict=True))


def _empty_bands(flat: tuple[int, int]) -> MapBands:
    return MapBands(*(np.empty((file.count, *flat), file.dtype) for file in _FILES))


class MapFiles:
    """The files of a map while they are written; they take their places when the stack ends well.

    Args:
        stack: of what is written.
        terrain: the ground.
        grid: the pixels.
        path: a .tif, of the verdicts.
        overwrite: whether the files may be there already.
        threads: that compress them.

    Raises:
        RequestError: the file is no .tif.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """

    def __init__(
        self, stack: contextlib.ExitStack, terrain: Terrain, grid: Grid, path: Path,
        overwrite: bool, threads: int,
    ) -> None:  # fmt: skip
        refuse_map(terrain, grid, path, overwrite)
        extent = RasterExtent(terrain, grid)
        parts = [
            stack.enter_context(whole_file(name, overwrite, COMPANIONS)) for name in map_paths(path)
        ]
        self._files = [
            stack.enter_context(_cog(part, extent, bands, threads))
            for part, bands in zip(parts, _FILES, strict=True)
        ]
        self._statistics = [BandStatistics()] * NUMBERS.count

    def write(self, window: Window, bands: MapBands) -> None:
        """Write all of a window but what it takes to know the whole map for; windows in order."""
        for file, pixels in zip(self._files[1:], bands[1:], strict=True):
            file.write(window, pixels)
        found = map(band_statistics, bands.numbers)
        self._statistics = list(map(operator.add, self._statistics, found))

    def finish(self, classes: NDArray[np.uint8]) -> None:
        """Write what each pixel is."""
        for window in self._files[0].extent.cut(TILE, TILE):
            self._files[0].write(window, classes[None, *part_of(window)])
        self._files[-1].finish(self._statistics)


def write_map(
    surveyor: Surveyor,
    path: str | Path | None,
    *,
    start: tuple[float, float] | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Callable[[int], object] | None = None,
    stack: contextlib.ExitStack | None = None,
) -> MapSummary:
    """Judge a vehicle at every pixel of a grid, and write the results as GeoTIFFs.

    `path` gets what each pixel is, with a colour table; beside it NAME-classes.tif has the verdict
    of the worst heading and what binds, and NAME-numbers.tif the measures. All are
    cloud-optimised. Pixels beyond the terrain are nodata. Memory is that of a `MapBuilder`, and
    of some tiles.

    Args:
        surveyor: of a vehicle on a terrain, on the pixels of the map.
        path: a .tif; None to count only.
        start: x and y of where the vehicle sets out; the largest part of the ground if None.
        threads: number of threads; as many as there are processors if None.
        overwrite: whether the files may be there already.
        progress: called with the number of pixels of each tile that is done.
        stack: the files take their places when it ends, together with what else is in it; when
            they are complete if None.

    Raises:
        RequestError: the file is no .tif, or the number of threads makes no sense.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """
    terrain, grid = surveyor.terrain, surveyor.grid
    builder = MapBuilder(terrain, grid, surveyor.headings, keep=False)
    threads = checked_threads(threads)
    with contextlib.nullcontext(stack) if stack else contextlib.ExitStack() as opened:
        files = None
        if path is not None:
            files = MapFiles(opened, terrain, grid, Path(path), overwrite, threads)
        stream_map(surveyor, builder, files, threads, progress)
        classes, found = builder.classes(begin_of(builder, start), surveyor.vehicle.area)
        if files:
            files.finish(classes)
    return builder.summary(classes, found, start)


def stream_map(
    surveyor: Surveyor,
    builder: MapBuilder,
    files: MapFiles | None,
    threads: int,
    progress: Callable[[int], object] | None = None,
) -> None:
    """Judge tile by tile, write what is known of each, and keep what is needed in the end."""

    def made(window: Window) -> tuple[Window, MapBands]:
        whole = _empty_bands((window.height, window.width))
        for inner in surveyor.windows(window):
            bands = builder.take(inner, surveyor.measure(inner))
            local = Window(
                inner.row - window.row, inner.column - window.column, inner.height, inner.width
            )
            for target, pixels in zip(whole, bands, strict=True):
                target[:, *part_of(local)] = pixels
        return window, whole

    for window, bands in prefetch(made, builder.grid.windows(TILE, TILE), threads):
        if files:
            files.write(window, bands)
        if progress:
            progress(window.height * window.width)


def begin_of(builder: MapBuilder, start: tuple[float, float] | None) -> Bits | None:
    """The states from which the vehicle sets out; None for no start."""
    return None if start is None else begin_from(builder.bits, builder.terrain, builder.grid, start)


def refuse_map(terrain: Terrain, grid: Grid, path: Path, overwrite: bool) -> None:
    """Refuse a map that cannot be written.

    Raises:
        RequestError: the file is no .tif.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """
    if raster_format(path).driver != "GTiff":
        raise RequestError(f"{path.name}: a map is a GeoTIFF.", "Give a name that ends in .tif.")
    for name in map_paths(path):
        refuse_existing(name, overwrite, COMPANIONS)
    crs_of(terrain)
    refuse_full_disk(path, grid, _FILES, raster_format(path, cog=True))


@contextlib.contextmanager
def _cog(path: Path, extent: RasterExtent, bands: Bands, threads: int) -> Iterator[GeoTiff]:
    """A cloud-optimised GeoTIFF: a plain one first, which is copied when it is complete."""
    first, plain = path.with_name(f"{path.stem}.first.tif"), Compression()
    with geotiff(first, extent, bands, plain, threads) as file:
        if bands is VERDICT:
            file.file.write_colormap(1, {int(key): (*c, 255) for key, c in COLORS.items()})
        yield file
    names = first.with_name(f"{first.name}.aux.xml")
    if bands is not NUMBERS:
        names.write_bytes(_class_names(bands))
    copied(first, path, "COG", cog_options(bands, plain), threads)
    first.unlink()
    names.unlink(missing_ok=True)


def _class_names(bands: Bands) -> bytes:
    """The text of an .aux.xml file that names the classes of each band."""
    root = ElementTree.Element("PAMDataset")
    for number, name in enumerate(bands.names, 1):
        band = ElementTree.SubElement(root, "PAMRasterBand", band=str(number))
        classes: type[GroundClass | Verdict | Reason] = GroundClass if bands is VERDICT else Verdict
        if name.startswith("reason"):
            classes = Reason
        name_categories(band, [value.label for value in classes])
    return xml_bytes(root)
