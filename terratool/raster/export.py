"""Raster export: layers of a terrain painted into files, and a report."""

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
from terratool.raster.layers import (
    LayerBands,
    SurfaceValues,
    files_of,
    layers_named,
    with_tops,
)
from terratool.raster.loss import LossFinder, RasterLoss
from terratool.raster.overviews import OVERVIEWS_FROM, factors, is_averaged_by_gdal
from terratool.raster.painter import most_tops
from terratool.raster.statistics import RasterStatistics, StatisticsSum
from terratool.raster.windows import WindowMaker, windows_of
from terratool.raster.writers import Storage, open_writer
from terratool.tasks import prefetch, thread_count
from terratool.text.meaning import guess

DTYPES = ("float32", "float64")
"""Data types of layers of numbers."""

Progress = Callable[[int], object]
"""Function called with the number of pixels done since its last call."""


@dataclass(frozen=True, slots=True)
class WrittenFile:
    """A file of an export.

    Attributes:
        path: path of the file.
        bands: bands of the file.
        statistics: statistics of each band; empty for what is no number.
        coding: coding of values as pixels.
        difference: largest difference of stored from painted values, in the unit of the band.
        overviews: factors of the overviews; empty where one tile holds all, None without
            overviews.
    """

    path: Path
    bands: LayerBands
    statistics: tuple[BandStatistics, ...]
    coding: Coding
    difference: float
    overviews: tuple[int, ...] | None = None


@dataclass(frozen=True, slots=True)
class MosaicSummary:
    """Tiles of a mosaic.

    Attributes:
        folder: folder of the tiles.
        size: side of a tile, pixels.
        rows, columns: numbers of rows and columns of tiles.
        kept: number of tiles kept from an earlier run.
        made: number of tiles made by this run.
    """

    folder: Path
    size: int
    rows: int
    columns: int
    kept: int
    made: int


@dataclass(frozen=True, slots=True)
class RasterReport:
    """Report of an export: files, statistics and losses.

    Attributes:
        grid: pixels of the raster.
        files: files in the order of their first layers.
        nodata: number of pixels without a height.
        surfaces: number of pixels by surface name; empty if no file holds surfaces.
        lacking: by layer, names of the surfaces without a value.
        ranged: by layer, names of the surfaces that give a range, whose middle is shown.
        losses: losses between the pixels; None if not requested.
        tiles: tiles of a mosaic; None for single files.
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
        """Number of pixels of the grid."""
        return self.grid.width * self.grid.height


@dataclass(frozen=True, slots=True)
class RasterRequest:
    """Layers and options of a raster export.

    Attributes:
        layers: names from `terratool.raster.layers.LAYERS`.
        dtype: data type of all layers of numbers, "float32" or "float64".
        compress: compression of GeoTIFFs: zstd, deflate, lzw, lerc or none; zstd if None.
        max_error: largest error of lerc, in the unit of the band; 0 if None.
        nodata: nodata value of layers of numbers; if None, NaN or the format's own.
        overviews: whether GeoTIFFs have overviews; if None, those larger than `OVERVIEWS_FROM`.
        overwrite: whether to replace existing files.
        losses: whether to measure losses between the pixels.
        threads: number of threads; the number of processors if None.
    """

    layers: Sequence[str] = ("height",)
    dtype: str = "float32"
    compress: str | None = None
    max_error: float | None = None
    nodata: float | None = None
    overviews: bool | None = None
    overwrite: bool = False
    losses: bool = True
    threads: int | None = None

    @property
    def compression(self) -> Compression | None:
        """Compression of GeoTIFFs; None where nothing is said.

        Raises:
            RequestError: there is no such compression, or it makes no such error.
        """
        if self.compress is None and self.max_error is None:
            return None
        return Compression(self.compress or "zstd", self.max_error or 0.0)

    def files(self, terrain: Terrain, grid: Grid) -> tuple[LayerBands, ...]:
        """Bands of the files that the layers need on a grid.

        Raises:
            RequestError: a layer or the data type is unknown, `nodata` is infinite, no value of the
                data type, or without a layer of numbers, or a layer has slopes of a terrain in
                degrees.
        """
        layers = layers_named(self.layers)
        for layer in layers:
            if layer.slopes or layer.content == "shade":
                terrain.refuse_degrees(f"The layer {layer.name}")
        if self.dtype not in DTYPES:
            raise RequestError(
                f"There is no type {self.dtype!r}.",
                guess(self.dtype, DTYPES) or f"The types are {', '.join(DTYPES)}.",
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
        if any(layer.name == "columns" for layer in layers):
            most = most_tops(terrain, grid)
            layers = tuple(with_tops(layer, most) for layer in layers)
        files = files_of(layers, terrain, np.dtype(self.dtype), empty)
        if self.nodata is not None and all(bands.content != "number" for bands in files):
            raise RequestError(
                "--nodata is about layers of numbers, but there are none.",
                "Leave it out: 0 stands for no surface and no shade, and colours have nothing.",
            )
        return files

    def has_overviews(self, form: RasterFormat, grid: Grid) -> bool:
        """Return whether files of a format over a grid get overviews.

        Raises:
            RequestError: `overviews` conflicts with the format.
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
    """Return whether a data type holds a number exactly, or the number is NaN."""
    with np.errstate(over="ignore"):
        return math.isnan(number) or float(np.dtype(dtype).type(number)) == number


HEIGHTS = RasterRequest()
"""Request of heights alone, with default options."""


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

    All layers of numbers are bands of one file; surfaces, colours and hillshade get a file each.
    The file of the first layer is `path`, further files have the layer's name before the suffix.
    Memory use is that of a few windows, whatever the size of the raster.

    Args:
        terrain: terrain to be exported.
        grid: pixels over the terrain.
        path: file to write; the suffix selects the format.
        request: layers and options.
        cog: whether to write a cloud-optimised GeoTIFF.
        progress: called with the number of pixels of each finished window.

    Raises:
        WriteError: a file exists, cannot be written or does not fit on the disk.
        RequestError: layers, data type and format conflict, or values exceed the data type.
        DefinitionError: the CRS of the terrain is unknown.
    """
    path = Path(path)
    threads = thread_count(request.threads)
    form = raster_format(path, cog)
    if request.compression is not None and form.driver not in ("GTiff", "COG"):
        raise RequestError(
            f"{path.name}: only a .tif is compressed as one likes.",
            "Leave out --compress and --max-error, or ask for a .tif.",
        )
    files, overviews = request.files(terrain, grid), request.has_overviews(form, grid)
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
        # all files are complete before the first is moved into place
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
    """Result of painting a window into files.

    Attributes:
        statistics: statistics of the pixels.
        differences: largest difference of stored from painted values, by file.
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
    """Paint a grid, or a window of it, into complete files.

    Args:
        paths: files to write.
        maker: maker of windows, with terrain, grid and bands.
        storage: format and options of the files.
        codings: coding of each file; by default those of a format that needs no range.
        window: window of the grid; all of it if None. Only GeoTIFFs can hold a part.
        progress: called with the number of pixels of each finished window.
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
    """Build the report of written files."""
    soils = SurfaceValues(terrain)
    layers = [layer for file in written for layer in file.bands.layers]
    lacking = {layer.name: names for layer in layers if (names := soils.lacking(layer))}
    ranged = {layer.name: names for layer in layers if (names := soils.given_as_range(layer))}
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
    """Paths of the files: `path`, then names with the layer, or "numbers", before the suffix."""
    names = (
        "numbers" if bands.content == "number" and bands.count > 1 else bands.layers[0].name
        for bands in files[1:]
    )
    return [path, *(path.with_name(f"{path.stem}-{name}{path.suffix}") for name in names)]


def _ranges(
    terrain: Terrain, grid: Grid, files: Sequence[LayerBands], form: RasterFormat, threads: int
) -> list[BandStatistics | None]:
    """Statistics of each file that `wants_range`, from a first painting; None for the others."""
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
    """Refuse an export that may not fit on the disk.

    Args:
        path: file or folder to write to.
        grid: pixels of the raster.
        files: bands of the files.
        form: format of the files.
        finished: number of pixels already written.
        overviews: whether files have overviews.

    Raises:
        WriteError: the disk has fewer free bytes than the pixels may take.
    """
    if not path.absolute().parent.is_dir():
        return  # whole_file reports the missing folder
    pixels = grid.width * grid.height - finished
    needed = pixels * sum(bands.pixel_bytes for bands in files)
    if form.driver == "COG" or (overviews and not all(map(is_averaged_by_gdal, files))):
        needed += needed + needed // 3  # the source of the copy, and overviews
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
