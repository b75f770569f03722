"""Where the windows of a file go: GeoTIFFs, arrays, and by way of GeoTIFFs all other formats."""

from __future__ import annotations

import contextlib
import math
import os
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning

from terratool.errors import WriteError
from terratool.io.bands import Bands, BandStatistics
from terratool.io.gdal_copy import cog_options, gdal_copy
from terratool.io.geotiff import Compression, GeoTiff, gdal_write_errors, tile_options
from terratool.io.pam import pam_path
from terratool.raster.formats import Coding, RasterFormat
from terratool.raster.geotiff import MOST_COLORS, RasterExtent, name_surfaces, terrain_tiff
from terratool.raster.grid import Grid, Window
from terratool.raster.overviews import add_overviews, by_gdal, with_overviews

_SHIFT = 1e-3
"""So far, in pixels, a raster may have moved: coordinates are rounded where they are text."""

Pixels = NDArray[Any]


def difference(one: Path, other: Path, bands: Bands, nodata: float) -> float:
    """The largest difference between the numbers of two rasters, in units of the numbers.

    Args:
        one: a GeoTIFF.
        other: what was made of it.
        bands: what both hold, as coded.
        nodata: what stands for none in the other one, if it cannot say so itself; or NaN.

    Raises:
        WriteError: the other one has other pixels, another place in the world, other surfaces, or
            cannot be read.
    """
    largest = 0.0
    with gdal_write_errors(other, "Ask for a .tif instead."), contextlib.ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        if bands.dtype == np.float64:  # text is read as single precision, if nothing else is said
            stack.enter_context(rasterio.Env(AAIGRID_DATATYPE="Float64"))
        a, b = stack.enter_context(rasterio.open(one)), stack.enter_context(rasterio.open(other))
        _compare_places(a, b, other)
        for _, window in a.block_windows(1):
            for band in range(1, a.count + 1):
                first = _numbers(a.read(band, window=window), a.nodata)
                second = _numbers(b.read(band, window=window), b.nodata, nodata)
                if not np.array_equal(np.isnan(first), np.isnan(second)):
                    raise _unfit(other, "pixels that hold nothing")
                apart = np.abs(first - second)
                if not np.isnan(apart).all():
                    largest = max(largest, float(np.nanmax(apart)) * abs(a.scales[band - 1]))
    if largest and bands.content != "number":
        raise _unfit(other, f"the {bands.content}s")
    return largest


def _numbers(pixels: NDArray[Any], *nothing: float | None) -> NDArray[np.float64]:
    numbers = pixels.astype(np.float64)
    for nodata in nothing:
        if nodata is not None and not math.isnan(nodata):
            numbers[numbers == nodata] = np.nan
    return numbers


def _compare_places(a: Any, b: Any, path: Path) -> None:
    if (a.count, a.width, a.height) != (b.count, b.width, b.height):
        raise _unfit(path, f"{a.count} × {a.height} × {a.width} pixels")
    nowhere = b.transform.is_identity and b.crs is None
    if not nowhere and any(
        abs(p - q) > _SHIFT * a.transform.a for p, q in zip(a.bounds, b.bounds, strict=True)
    ):
        raise _unfit(path, "where the pixels are")
    # many formats write a reference system in their own words, which have no number
    codes = {crs.to_epsg() for crs in (a.crs, b.crs) if crs is not None} - {None}
    if len(codes) > 1:
        raise _unfit(path, "the coordinate reference system")


def _unfit(path: Path, what: str) -> WriteError:
    return WriteError(f"{path.name}: its format does not keep {what}.", "Ask for a .tif instead.")


class RasterWriter(Protocol):
    """Where the windows of one file go.

    Attributes:
        difference: how far the numbers of the file may be from those that were written to it.
    """

    difference: float

    def write(self, window: Window, pixels: Pixels) -> None:
        """Take the bands of a window, (bands, height, width)."""

    def finish(self, statistics: Sequence[BandStatistics], counts: NDArray[np.int64], /) -> None:
        """Take what is known when all windows are written."""


@dataclass(frozen=True, slots=True)
class Storage:
    """How files are stored.

    Attributes:
        form: their format.
        compression: of GeoTIFFs.
        threads: that paint and compress; 0 for the calling one alone.
        overviews: whether GeoTIFFs have them.
    """

    form: RasterFormat
    compression: Compression
    threads: int = 0
    overviews: bool = False


@contextlib.contextmanager
def open_writer(
    path: Path, extent: RasterExtent, bands: Bands, storage: Storage, coding: Coding | None
) -> Iterator[RasterWriter]:
    """A file of a format to be written; complete when the block has ended.

    Only a GeoTIFF may hold less than its grid. It is then a tile of a mosaic, whose index has the
    names of the surfaces.
    """
    form, compression, threads = storage.form, storage.compression, storage.threads
    if form.driver == "NPY":
        yield _Array(path, bands, extent.grid, coding)
        return
    # GDAL averages all bands of a file alike
    own = storage.overviews and bands.content == "number" and not by_gdal(bands)
    direct = form.driver == "GTiff" and not own
    first = path if direct else path.with_name(f"{path.stem}.first.tif")
    # what is copied is not compressed for long, and loses nothing on the way
    first_compression = compression if direct else Compression("zstd")
    coded = bands if coding is None else replace(bands, dtype=coding.dtype)
    nodata = None if coding is None else coding.nodata
    tiff = form.driver in ("GTiff", "COG")
    colors = MOST_COLORS if tiff else 256
    options = tile_options(coded.dtype, first_compression, threads)
    with terrain_tiff(first, extent, coded, options, nodata, colors) as file:
        if coding is not None and not coding.exact:
            file.scale(coding.scale, coding.offset)
        named = None if extent.window or bands.content != "surface" else first
        writer = _Raster(file, named, extent, coding)
        if tiff and bands.content == "number":
            writer.difference = compression.max_z_error
        yield writer
    if direct:
        if storage.overviews:
            add_overviews(path, bands, threads)
        return
    with with_overviews(first, coded) if own else contextlib.nullcontext(first) as source:
        gdal_copy(source, path, form.driver, _options(storage, bands, own), threads)
    if not tiff:
        nothing = math.nan if coding is None or coding.nodata is None else coding.nodata
        writer.difference += difference(first, path, coded, nothing)
    first.unlink()
    pam_path(first).unlink(missing_ok=True)


def _options(storage: Storage, bands: Bands, own: bool) -> dict[str, Any]:
    """What a driver is told that copies a file; `own` if the overviews are there."""
    form = storage.form
    if form.driver == "COG":
        return cog_options(bands, storage.compression, own)
    if form.driver == "GTiff":
        options = tile_options(bands.dtype, storage.compression, storage.threads)
        return {**options, "copy_src_overviews": True}
    options = dict(form.options)
    if form.driver == "AAIGrid" and bands.content == "number":
        options["significant_digits"] = 9 if bands.dtype == np.float32 else 17
    return options


class _Array:
    """A .npy file: (height, width), or (bands, height, width) if there are several."""

    difference = 0.0

    def __init__(self, path: Path, bands: Bands, grid: Grid, coding: Coding | None) -> None:
        self._coding = coding
        shape: tuple[int, ...] = (bands.count, grid.height, grid.width)
        shape = shape[1:] if bands.count == 1 else shape
        header = {"descr": bands.dtype.str, "fortran_order": False, "shape": shape}
        with open(path, "wb") as file:
            np.lib.format.write_array_header_1_0(file, header)
            begin = file.tell()
            size = begin + bands.pixel_bytes * grid.height * grid.width
            # a process that writes to memory for which the disk has no room is ended by the system
            allocate = getattr(os, "posix_fallocate", lambda file, _, size: os.truncate(file, size))
            allocate(file.fileno(), 0, size)
        self._array = np.memmap(path, bands.dtype, "r+", begin, shape)

    def write(self, window: Window, pixels: Pixels) -> None:
        rows = slice(window.row, window.row + window.height)
        columns = slice(window.column, window.column + window.width)
        coded = pixels if self._coding is None else self._coding.encode(pixels)
        self._array.reshape((-1, *self._array.shape[-2:]))[:, rows, columns] = coded

    def finish(self, _statistics: Sequence[BandStatistics], _counts: NDArray[np.int64]) -> None:
        self._array.flush()


class _Raster:
    """A GeoTIFF, the file itself or what it is copied from."""

    def __init__(
        self, file: GeoTiff, named: Path | None, extent: RasterExtent, coding: Coding | None
    ) -> None:
        """`named` is the file whose surfaces get names; None if it has none."""
        self._file, self._named, self._extent, self._coding = file, named, extent, coding
        self.difference = coding.difference if coding else 0.0

    def write(self, window: Window, pixels: Pixels) -> None:
        coded = pixels if self._coding is None else self._coding.encode(pixels)
        first = self._extent.pixels
        self._file.write(coded, window.row - first.row, window.column - first.column)

    def finish(self, statistics: Sequence[BandStatistics], counts: NDArray[np.int64]) -> None:
        if not self.difference:  # or they would be those of other numbers
            self._file.finish(statistics)
        if self._named:
            name_surfaces(self._named, self._extent.terrain, counts)
