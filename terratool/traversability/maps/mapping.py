"""A traversability map: GeoTIFFs with a verdict for each pixel, and what adds up of it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.parts import Bounds, check_bounds, clip_bounds
from terratool.field.terrain import Terrain
from terratool.output import refuse_existing, whole_file
from terratool.raster.export import COMPANIONS, checked_threads, refuse_full_disk
from terratool.raster.formats import raster_format
from terratool.raster.geotiff import Compression, GeoTiff, crs_of, geotiff
from terratool.raster.grid import DEFAULT_PIXELS, Grid, Window
from terratool.raster.layers import Bands
from terratool.raster.statistics import BandStatistics, band_statistics
from terratool.raster.windows import TILE, prefetch
from terratool.traversability.maps.bands import CLASSES, NUMBERS, VERDICT, MapBands, map_bands
from terratool.traversability.maps.surveying import Surveyor, coarsest_resolution
from terratool.traversability.results import COLORS, HEADINGS, MapSummary, Reason, Verdict
from terratool.traversability.types import Vehicle

_FILES = (VERDICT, CLASSES, NUMBERS)
_SUFFIXES = ("", "-classes", "-numbers")
_WHEEL_PART = 4


def default_resolution(
    terrain: Terrain, vehicle: Vehicle, bounds: Bounds | None = None, most: int = DEFAULT_PIXELS
) -> tuple[float, str]:
    """A resolution for a map, and in words why: a quarter of the wheel's radius, within reason.

    Args:
        terrain: the terrain.
        vehicle: the vehicle.
        bounds: what is looked at; all if None.
        most: pixels on the longer side of what is looked at.

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
        folded: what its files hold.
        statistics: of the numbers.
        counts: (surfaces + 1, verdicts) int64, pixels with ground by surface and best verdict.
        worst: (verdicts,) by the verdict of the worst heading.
        reasons: (reasons,) of the best heading, where it is caution or no-go.
    """

    window: Window
    folded: MapBands
    statistics: tuple[BandStatistics, ...]
    counts: NDArray[np.int64]
    worst: NDArray[np.int64]
    reasons: NDArray[np.int64]


def map_to_tif(
    terrain: Terrain,
    vehicle: Vehicle,
    grid: Grid,
    path: str | Path | None,
    *,
    headings: int = HEADINGS,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Callable[[int], object] | None = None,
    stack: contextlib.ExitStack | None = None,
) -> MapSummary:
    """Judge a vehicle at every pixel of a grid, and write what is found out.

    `path` gets the verdict of the best heading, with a colour table; beside it NAME-classes.tif has
    that of the worst heading and what binds, and NAME-numbers.tif the measures (`bands`). Pixels
    beyond the terrain are nodata. Memory is bounded by some tiles, whatever the size of the grid.

    Args:
        terrain: the terrain.
        vehicle: the vehicle.
        grid: the pixels.
        path: a .tif; None for none, only to count.
        headings: a multiple of 4 from 4 to 64.
        threads: number of threads; as many as there are processors, if not said.
        overwrite: whether the files may be there already.
        progress: is told the number of pixels of each tile that is done.
        stack: the files take their places when it ends, together with what else is in it; when
            they are complete, if not said.

    Raises:
        RequestError: as `survey`, or the file is no .tif.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """
    threads = checked_threads(threads)
    surveyor = Surveyor(terrain, vehicle, grid, headings)
    with contextlib.nullcontext(stack) if stack else contextlib.ExitStack() as files:
        sinks: list[GeoTiff] = []
        if path is not None:
            sinks = _opened(files, terrain, grid, Path(path), overwrite, threads)
        count = np.zeros((len(terrain.surfaces) + 1, len(Verdict)), np.int64)
        worst, reasons = np.zeros(len(Verdict), np.int64), np.zeros(len(Reason), np.int64)
        statistics = [BandStatistics()] * NUMBERS.count
        make = partial(_made, surveyor, terrain, grid)
        for made in prefetch(make, grid.windows(TILE, TILE), threads):
            parts: tuple[NDArray[Any], ...] = (
                made.folded.verdict,
                made.folded.classes,
                made.folded.numbers,
            )
            for sink, pixels in zip(sinks, parts, strict=False):
                sink.write(made.window, pixels)
            statistics = list(map(BandStatistics.with_, statistics, made.statistics))
            count, worst, reasons = count + made.counts, worst + made.worst, reasons + made.reasons
            if progress:
                progress(made.window.height * made.window.width)
        if sinks:
            sinks[-1].finish(statistics)
    names = ("", *terrain.surfaces)
    return MapSummary(
        grid,
        headings,
        _by_verdict(count.sum(axis=0)),
        _by_verdict(worst),
        {Reason(n): number for n, number in enumerate(reasons.tolist()) if number},
        {name: _by_verdict(row) for name, row in zip(names, count, strict=True) if row.any()},
    )


def _by_verdict(counts: NDArray[np.int64]) -> dict[Verdict, int]:
    return dict(zip(Verdict, counts.tolist(), strict=True))


def _made(surveyor: Surveyor, terrain: Terrain, grid: Grid, window: Window) -> _Made:
    """Judge a tile, block by block."""
    west, south, east, north = terrain.bounds
    flat = (window.height, window.width)
    whole = MapBands(*(np.empty((file.count, *flat), file.dtype) for file in _FILES))
    ground, surfaces = np.empty(flat, np.bool_), np.empty(flat, np.int64)
    for block in surveyor.blocks(window):
        measures = surveyor.measure(block)
        x, y = grid.columns(block), grid.rows(block)
        inside = ((y >= south) & (y <= north))[:, None] & ((x >= west) & (x <= east))[None]
        folded = map_bands(measures, inside)
        row, column = block.row - window.row, block.column - window.column
        part = np.s_[row : row + block.height, column : column + block.width]
        whole.verdict[:, *part], whole.classes[:, *part] = folded.verdict, folded.classes
        whole.numbers[:, *part] = folded.numbers
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
    sinks = []
    for part, bands in zip(parts, _FILES, strict=True):
        nodata = None if bands is NUMBERS else 0.0
        file = stack.enter_context(
            geotiff(part, terrain, grid, bands, Compression(), threads, nodata)
        )
        if bands is VERDICT:
            file.file.write_colormap(1, {int(key): (*c, 255) for key, c in COLORS.items()})
        if bands is not NUMBERS:
            names = part.with_name(f"{part.name}.aux.xml")
            names.write_bytes(_class_names(bands))
        sinks.append(file)
    return sinks


def _class_names(bands: Bands) -> bytes:
    """The text of an .aux.xml file that names the classes of each band."""
    root = ElementTree.Element("PAMDataset")
    for number, name in enumerate(bands.names, 1):
        band = ElementTree.SubElement(root, "PAMRasterBand", band=str(number))
        kind: type[Verdict] | type[Reason] = Verdict if name.startswith("verdict") else Reason
        categories = ElementTree.SubElement(band, "CategoryNames")
        for value in kind:
            ElementTree.SubElement(categories, "Category").text = value.label
    ElementTree.indent(root)
    return f"{ElementTree.tostring(root, encoding='unicode')}\n".encode()
