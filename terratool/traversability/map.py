"""A traversability map: GeoTIFFs with a verdict for each pixel, and what adds up of it."""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
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
    crs_of,
    geotiff,
    name_categories,
    xml_bytes,
)
from terratool.raster.grid import DEFAULT_PIXELS, Grid, Window
from terratool.raster.layers import Bands, Layer
from terratool.raster.prefetch import TILE, prefetch
from terratool.raster.statistics import BandStatistics, band_statistics
from terratool.traversability.results import COLORS, RANKS, MapSummary, Reason, Verdict
from terratool.traversability.survey import Surveyor, WindowMeasures, coarsest_resolution
from terratool.traversability.vehicle import Vehicle

CLASS, NUMBER = "class", "number"

MOST = 10.0
"""Shares of limits beyond that are written as that."""

VERDICT = Bands((Layer("verdict", ("verdict, best heading",), "", CLASS),), np.dtype(np.uint8))
CLASSES = Bands(
    tuple(
        Layer(name, (name,), "", CLASS)
        for name in ("verdict, worst heading", "reason, best heading", "reason, worst heading")
    ),
    np.dtype(np.uint8),
)
NUMBERS = Bands(
    tuple(
        Layer(name, (name,), unit, NUMBER)
        for name, unit in (
            ("headings that are go or caution", ""),
            ("utilisation, best heading", ""),
            ("utilisation, worst heading", ""),
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

_FILES = (VERDICT, CLASSES, NUMBERS)
_SUFFIXES = ("", "-classes", "-numbers")
_WHEEL_PART = 4


class MapBands(NamedTuple):
    """A window of a map, (bands, height, width) each.

    Attributes:
        verdict: uint8, of `VERDICT`.
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
            f"{longest:.6g} is too long for a map of {most} pixels: wheels of radius "
            f"{vehicle.wheel.radius:g} take pixels of at most {coarsest:.6g}.",
            "Look at a part of it by bounds, or give a resolution.",
        )
    return min(resolution, shortest), f"{most} pixels on the longer side"


def map_paths(path: str | Path) -> list[Path]:
    """The files of a map: verdicts of the best headings, other classes, numbers."""
    path = Path(path)
    return [path.with_name(f"{path.stem}{suffix}{path.suffix}") for suffix in _SUFFIXES]


@dataclass(frozen=True, slots=True)
class _Made:
    """A tile of a map.

    Attributes:
        window: of the grid.
        bands: what its files hold.
        statistics: of the numbers.
        counts: (surfaces + 1, verdicts) int64, pixels with ground by surface and best verdict.
        worst: (verdicts,) by the verdict of the worst heading.
        reasons: (reasons,) of the best heading, where it is caution or no-go.
    """

    window: Window
    bands: MapBands
    statistics: tuple[BandStatistics, ...]
    counts: NDArray[np.int64]
    worst: NDArray[np.int64]
    reasons: NDArray[np.int64]


def write_map(
    surveyor: Surveyor,
    path: str | Path | None,
    *,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Callable[[int], object] | None = None,
    stack: contextlib.ExitStack | None = None,
) -> MapSummary:
    """Judge a vehicle at every pixel of a grid, and write the results as GeoTIFFs.

    `path` gets the verdict of the best heading, with a colour table; beside it NAME-classes.tif has
    that of the worst heading and what binds, and NAME-numbers.tif the measures. Pixels beyond the
    terrain are nodata. Memory is bounded by some tiles, whatever the size of the grid.

    Args:
        surveyor: of a vehicle on a terrain, on the pixels of the map.
        path: a .tif; None to count only.
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
    threads = checked_threads(threads)
    terrain, grid = surveyor.terrain, surveyor.grid
    with contextlib.nullcontext(stack) if stack else contextlib.ExitStack() as opened:
        files: list[GeoTiff] = []
        if path is not None:
            files = _opened(opened, terrain, grid, Path(path), overwrite, threads)
        count = np.zeros((len(terrain.surfaces) + 1, len(Verdict)), np.int64)
        worst, reasons = np.zeros(len(Verdict), np.int64), np.zeros(len(Reason), np.int64)
        statistics = [BandStatistics()] * NUMBERS.count
        for made in prefetch(partial(_made, surveyor), grid.windows(TILE, TILE), threads):
            for file, pixels in zip(files, made.bands, strict=False):
                file.write(made.window, pixels)
            statistics = list(map(operator.add, statistics, made.statistics))
            count, worst, reasons = count + made.counts, worst + made.worst, reasons + made.reasons
            if progress:
                progress(made.window.height * made.window.width)
        if files:
            files[-1].finish(statistics)
    names = ("", *terrain.surfaces)
    return MapSummary(
        grid,
        surveyor.headings,
        _by_verdict(count.sum(axis=0)),
        _by_verdict(worst),
        {Reason(n): number for n, number in enumerate(reasons.tolist()) if number},
        {name: _by_verdict(row) for name, row in zip(names, count, strict=True) if row.any()},
    )


def _by_verdict(counts: NDArray[np.int64]) -> dict[Verdict, int]:
    return dict(zip(Verdict, counts.tolist(), strict=True))


def _made(surveyor: Surveyor, window: Window) -> _Made:
    """Judge a tile, window by window."""
    terrain, grid = surveyor.terrain, surveyor.grid
    west, south, east, north = terrain.bounds
    flat = (window.height, window.width)
    whole = MapBands(*(np.empty((file.count, *flat), file.dtype) for file in _FILES))
    ground, surfaces = np.empty(flat, np.bool_), np.empty(flat, np.int64)
    for inner in surveyor.windows(window):
        measures = surveyor.measure(inner)
        x, y = grid.columns(inner), grid.rows(inner)
        inside = ((y >= south) & (y <= north))[:, None] & ((x >= west) & (x <= east))[None]
        folded = map_bands(measures, inside)
        row, column = inner.row - window.row, inner.column - window.column
        part = np.s_[row : row + inner.height, column : column + inner.width]
        for bands, pixels in zip(whole, folded, strict=True):
            bands[:, *part] = pixels
        ground[part], surfaces[part] = ~np.isnan(measures.heights), measures.surfaces
    best, worst, reasons = whole.verdict[0][ground], *whole.classes[:2, ground]
    shape = (len(terrain.surfaces) + 1, len(Verdict))
    pairs = surfaces[ground] * len(Verdict) + best
    return _Made(
        window,
        whole,
        tuple(map(band_statistics, whole.numbers)),
        np.bincount(pairs, minlength=math.prod(shape)).reshape(shape),
        np.bincount(worst, minlength=len(Verdict)),
        np.bincount(reasons[best >= Verdict.CAUTION], minlength=len(Reason)),
    )


def _opened(
    stack: contextlib.ExitStack,
    terrain: Terrain,
    grid: Grid,
    path: Path,
    overwrite: bool,
    threads: int,
) -> list[GeoTiff]:
    """The files of a map, which take their places together when the stack ends well."""
    form = raster_format(path)
    if form.driver != "GTiff":
        raise RequestError(f"{path.name}: a map is a GeoTIFF.", "Give a name that ends in .tif.")
    paths = map_paths(path)
    for name in paths:
        refuse_existing(name, overwrite, COMPANIONS)
    crs_of(terrain)
    refuse_full_disk(path, grid, _FILES, form)
    parts = [stack.enter_context(whole_file(name, overwrite, COMPANIONS)) for name in paths]
    files = []
    for part, bands in zip(parts, _FILES, strict=True):
        file = stack.enter_context(
            geotiff(part, RasterExtent(terrain, grid), bands, Compression(), threads)
        )
        if bands is VERDICT:
            file.file.write_colormap(1, {int(key): (*c, 255) for key, c in COLORS.items()})
        if bands is not NUMBERS:
            names = part.with_name(f"{part.name}.aux.xml")
            names.write_bytes(_class_names(bands))
        files.append(file)
    return files


def _class_names(bands: Bands) -> bytes:
    """The text of an .aux.xml file that names the classes of each band."""
    root = ElementTree.Element("PAMDataset")
    for number, name in enumerate(bands.names, 1):
        band = ElementTree.SubElement(root, "PAMRasterBand", band=str(number))
        classes: type[Verdict] | type[Reason] = Verdict if name.startswith("verdict") else Reason
        name_categories(band, [value.label for value in classes])
    return xml_bytes(root)
