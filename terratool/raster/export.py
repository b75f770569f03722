"""Raster files of a terrain: painted, written and reported."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from terratool.errors import RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands, BandStatistics
from terratool.io.geotiff import Compression
from terratool.io.pam import COMPANIONS
from terratool.output import free_bytes, refuse_existing, whole_file
from terratool.raster.formats import (
    Coding,
    RasterFormat,
    check_fit,
    coding_of,
    plain_coding,
    raster_format,
    wants_range,
)
from terratool.raster.geotiff import RasterExtent, crs_of
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import LayerBands, SurfaceValues, files_of, layers_named
from terratool.raster.loss import LossFinder, RasterLoss
from terratool.raster.overviews import OVERVIEWS_FROM, by_gdal, factors
from terratool.raster.prefetch import WindowMaker, prefetch, processors, windows_of
from terratool.raster.statistics import RasterStatistics, StatisticsSum
from terratool.raster.writers import Storage, open_writer

DTYPES = ("float32", "float64")

Progress = Callable[[int], object]


@dataclass(frozen=True, slots=True)
class WrittenFile:
    """One file that was written.

    Attributes:
        path: where.
        bands: what it holds.
        statistics: of its bands; none for surfaces and colours.
        coding: how its numbers became pixels.
        difference: how far its numbers may be from those that were painted.
        overviews: by how much each of its overviews is coarser; none where it is one tile, None
            where they were not wanted.
    """

    path: Path
    bands: LayerBands
    statistics: tuple[BandStatistics, ...]
    coding: Coding
    difference: float
    overviews: tuple[int, ...] | None = None


@dataclass(frozen=True, slots=True)
class MosaicSummary:
    """What a mosaic consists of.

    Attributes:
        folder: where the tiles are.
        size: pixels on the side of a tile.
        rows, columns: of tiles.
        kept: tiles that an earlier run had finished.
        made: tiles that this one has.
    """

    folder: Path
    size: int
    rows: int
    columns: int
    kept: int
    made: int


@dataclass(frozen=True, slots=True)
class RasterReport:
    """What an export has written, and what it could not keep.

    Attributes:
        grid: the pixels.
        files: in the order of the layers.
        nodata: pixels without a height.
        surfaces: pixels by name of the surface, where a file holds them.
        lacking: for each layer the surfaces that have no value for it.
        ranged: for each layer the surfaces of which it has the middle of a range, if any.
        losses: what the pixels do not show; None where it was not asked for.
        tiles: of a mosaic; None for single files.
    """

    grid: Grid
    files: tuple[WrittenFile, ...]
    nodata: int
    surfaces: dict[str, int]
    lacking: dict[str, list[str]]
    losses: RasterLoss | None
    tiles: MosaicSummary | None = None
    ranged: dict[str, list[str]] = field(default_factory=dict)

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.grid.width * self.grid.height


@dataclass(frozen=True, slots=True)
class RasterRequest:
    """What is written of a terrain, and how.

    Attributes:
        layers: names from `terratool.raster.layers.LAYERS`.
        dtype: "float32" or "float64", of all layers of numbers.
        compression: how GeoTIFFs are compressed; by ZSTD if None.
        nodata: the number that stands for none in layers of numbers; NaN, or what the format has,
            if None.
        overviews: whether a GeoTIFF has them; if None, one that is larger than `OVERVIEWS_FROM`.
        overwrite: whether files may be there already.
        losses: whether to find out what the pixels do not show.
        threads: number of threads; as many as there are processors if None.
    """

    layers: Sequence[str] = ("height",)
    dtype: str = "float32"
    compression: Compression | None = None
    nodata: float | None = None
    overviews: bool | None = None
    overwrite: bool = False
    losses: bool = True
    threads: int | None = None

    def files(self, terrain: Terrain) -> tuple[LayerBands, ...]:
        """The files that the layers take.

        Raises:
            RequestError: there is no such layer or type, or nodata is no number of the type.
        """
        layers = layers_named(self.layers)
        if self.dtype not in DTYPES:
            raise RequestError(
                f"There is no type {self.dtype!r}.", f"The types are {', '.join(DTYPES)}."
            )
        empty = math.nan if self.nodata is None else self.nodata
        if math.isinf(empty):
            raise RequestError(
                "Infinity cannot stand for none.", "Give another number, such as -9999."
            )
        if not _is_of_type(empty, self.dtype):
            raise RequestError(
                f"No {self.dtype} is {empty!r}, which is to stand for none.",
                "Give another number, such as -9999, or add --dtype float64.",
            )
        files = files_of(layers, terrain, np.dtype(self.dtype), empty)
        if self.nodata is not None and all(bands.content != "number" for bands in files):
            raise RequestError(
                "--nodata is about layers of numbers, but there are none.",
                "Leave it out: 0 stands for no surface, and colours have nothing for none.",
            )
        return files

    def has_overviews(self, form: RasterFormat, grid: Grid) -> bool:
        """Whether files of a format over a grid have overviews.

        Raises:
            RequestError: that was asked for, but does not go with the format.
        """
        if form.driver == "COG":
            if self.overviews is False:
                raise RequestError(
                    "A cloud-optimised GeoTIFF has overviews.",
                    "Leave out --no-overviews or --cog.",
                )
            return True
        if form.driver != "GTiff":
            if self.overviews:
                raise RequestError(
                    "Only a .tif has overviews.", "Leave out --overviews, or ask for a .tif."
                )
            return False
        large = max(grid.width, grid.height) > OVERVIEWS_FROM
        return large if self.overviews is None else self.overviews


def _is_of_type(number: float, dtype: str) -> bool:
    """Whether a type has exactly this number."""
    with np.errstate(over="ignore"):
        return math.isnan(number) or float(np.dtype(dtype).type(number)) == number


HEIGHTS = RasterRequest()
"""The heights alone."""


def export_dem(
    terrain: Terrain,
    grid: Grid,
    path: str | Path,
    request: RasterRequest = HEIGHTS,
    *,
    cog: bool = False,
    progress: Progress | None = None,
) -> RasterReport:
    """Write layers of a terrain at the pixel centres of a grid.

    All layers of numbers are bands of one file; surfaces and colours get one of their own each. The
    file of the first layer is `path`, the others have the name of their layer before the suffix.
    Memory is bounded by some windows, whatever the size of the raster.

    Args:
        terrain: the terrain.
        grid: the pixels.
        path: the file; its suffix names the format.
        request: what is written, and how.
        cog: whether a GeoTIFF is to be cloud-optimised.
        progress: is told the number of pixels of each window that is done.

    Raises:
        WriteError: a file exists, cannot be written or does not fit on the disk.
        RequestError: layers, type or format do not go together, or numbers are beyond the type.
        DefinitionError: the CRS of the terrain is unknown.
    """
    path = Path(path)
    threads = checked_threads(request.threads)
    form = raster_format(path, cog)
    if request.compression is not None and form.driver not in ("GTiff", "COG"):
        raise RequestError(
            f"{path.name}: only a .tif is compressed as one likes.",
            "Leave out --compress and --max-z-error, or ask for a .tif.",
        )
    files, overviews = request.files(terrain), request.has_overviews(form, grid)
    paths = paths_of(path, files)
    companions = (*COMPANIONS, *form.companions)
    for name, bands in zip(paths, files, strict=True):
        refuse_existing(name, request.overwrite, companions)
        check_fit(form, name, bands, terrain, grid, request.nodata)
    crs_of(terrain)
    refuse_full_disk(path, grid, files, form, overviews=overviews)

    ranges = _ranges(terrain, grid, files, form, threads)
    codings = list(map(partial(coding_of, form), files, ranges))
    storage = Storage(form, request.compression or Compression(), threads, overviews)
    with contextlib.ExitStack() as stack:
        # every file is complete before the first one takes its place
        parts = [
            stack.enter_context(whole_file(name, request.overwrite, companions, named=name == path))
            for name in paths
        ]
        maker = WindowMaker(terrain, grid, files, request.losses)
        filled = fill_files(parts, maker, storage, codings, progress=progress)
    written = (
        WrittenFile(
            name,
            bands,
            statistics,
            coding or plain_coding(bands),
            difference,
            tuple(factors(grid.width, grid.height)) if overviews else None,
        )
        for name, bands, statistics, coding, difference in zip(
            paths, files, filled.statistics.statistics, codings, filled.differences, strict=True
        )
    )
    return report_of(terrain, grid, tuple(written), filled.statistics, maker.losses)


@dataclass(frozen=True, slots=True)
class FilledFiles:
    """What came of painting a window into files.

    Attributes:
        statistics: of its pixels.
        differences: how far the numbers of each file may be from those that were painted.
    """

    statistics: RasterStatistics
    differences: tuple[float, ...]


def fill_files(
    paths: Sequence[Path],
    maker: WindowMaker,
    storage: Storage,
    codings: Sequence[Coding | None] = (),
    *,
    window: Window | None = None,
    progress: Progress | None = None,
) -> FilledFiles:
    """Paint a window, or the whole, of a grid into files, which are complete afterwards.

    Args:
        paths: the files.
        maker: paints them.
        storage: how each file is stored.
        codings: how the numbers of each file are coded; for formats that want no range of theirs
            they need not be said.
        window: of the grid; all of it, if not said. Only GeoTIFFs hold less.
        progress: is told the number of pixels of each window that is done.
    """
    files, extent = maker.files, RasterExtent(maker.terrain, maker.grid, window)
    codings = codings or [coding_of(storage.form, bands, None) for bands in files]
    total = StatisticsSum(files)
    with contextlib.ExitStack() as stack:
        writers = [
            stack.enter_context(open_writer(path, extent, bands, storage, coding))
            for path, bands, coding in zip(paths, files, codings, strict=True)
        ]
        for made in prefetch(maker.make, windows_of(extent.pixels, files), storage.threads):
            for writer, pixels in zip(writers, made.buffer.pixels, strict=True):
                writer.write(made.window, pixels)
            total.add(made.statistics)
            maker.reuse(made)
            if progress:
                progress(made.window.width * made.window.height)
        statistics = total.total()
        for writer, bands_of_file in zip(writers, statistics.statistics, strict=True):
            writer.finish(bands_of_file, statistics.counts)
    return FilledFiles(statistics, tuple(writer.difference for writer in writers))


def report_of(
    terrain: Terrain,
    grid: Grid,
    written: tuple[WrittenFile, ...],
    statistics: RasterStatistics,
    losses: LossFinder | None,
    tiles: MosaicSummary | None = None,
) -> RasterReport:
    """What there is to say when all is written."""
    soils = SurfaceValues(terrain)
    layers = [layer for file in written for layer in file.bands.layers]
    lacking = {layer.name: names for layer in layers if (names := soils.lacking(layer))}
    ranged = {layer.name: names for layer in layers if (names := soils.ranged(layer))}
    return RasterReport(
        grid,
        written,
        statistics.nodata,
        dict(zip(terrain.surfaces, statistics.counts[1:].tolist(), strict=False)),
        lacking,
        losses.statement(statistics.lost, statistics.nodata) if losses else None,
        tiles,
        ranged,
    )


def paths_of(path: Path, files: Sequence[LayerBands]) -> list[Path]:
    """Where the files go: the first to `path`, the others with what they hold before the suffix."""
    names = (
        "numbers" if bands.content == "number" and bands.count > 1 else bands.layers[0].name
        for bands in files[1:]
    )
    return [path, *(path.with_name(f"{path.stem}-{name}{path.suffix}") for name in names)]


def checked_threads(threads: int | None) -> int:
    """The number of threads; as many as there are processors, if not said.

    Raises:
        RequestError: it is below 1.
    """
    if threads is not None and threads < 1:
        raise RequestError(f"The number of threads is {threads}.", "Give 1 or more.")
    return threads or processors()


def _ranges(
    terrain: Terrain, grid: Grid, files: Sequence[LayerBands], form: RasterFormat, threads: int
) -> list[BandStatistics | None]:
    """Ranges of the numbers of each file whose format wants them: all is painted once for that."""
    if not any(wants_range(form, bands) for bands in files):
        return [None] * len(files)
    wanting = [bands for bands in files if wants_range(form, bands)]
    maker = WindowMaker(terrain, grid, wanting)
    total = StatisticsSum(wanting)
    for made in prefetch(maker.make, windows_of(grid.whole, wanting), threads):
        total.add(made.statistics)
        maker.reuse(made)
    ranges = (sum(bands, BandStatistics()) for bands in total.total().statistics)
    return [next(ranges) if wants_range(form, bands) else None for bands in files]


def refuse_full_disk(
    path: Path,
    grid: Grid,
    files: Sequence[Bands],
    form: RasterFormat,
    finished: int = 0,
    overviews: bool = False,
) -> None:
    """Refuse what may not fit on the disk; so many pixels are finished.

    Raises:
        WriteError: there is less free than the pixels may take.
    """
    if not path.absolute().parent.is_dir():
        return  # whole_file says so
    pixels = grid.width * grid.height - finished
    needed = pixels * sum(bands.pixel_bytes for bands in files)
    if form.driver == "COG" or (overviews and not all(map(by_gdal, files))):
        needed += needed + needed // 3  # what it is copied from, and its overviews
    elif overviews:
        needed += needed // 3
    elif form.text_bytes[0]:
        short, long = form.text_bytes
        needed += pixels * sum(long if bands.dtype.itemsize == 8 else short for bands in files)
    elif form.driver not in ("GTiff", "NPY"):
        needed *= 2
    free = free_bytes(path)
    if needed > free:
        rest = "the rest of " if finished else ""
        raise WriteError(
            f"{path}: {rest}{grid.width} × {grid.height} pixels may take "
            f"{needed:,} bytes, but {free:,} are free.",
            "Give a coarser resolution or smaller bounds, or another disk.",
        )
