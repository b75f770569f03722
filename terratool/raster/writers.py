"""Writers of raster files by window: GeoTIFF and .npy, and other formats by a GeoTIFF copy."""

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
from terratool.raster.overviews import add_overviews, is_averaged_by_gdal, with_overviews

_SHIFT = 1e-3
"""Largest shift of a copy, pixels; text formats round coordinates."""

Pixels = NDArray[Any]


def difference(one: Path, other: Path, bands: Bands, nodata: float) -> float:
    """Largest difference between the values of a GeoTIFF and of its copy, in the unit of the band.

    Args:
        one: the GeoTIFF.
        other: copy in another format.
        bands: bands of both files, as coded.
        nodata: nodata value of the copy, for formats that do not store it; NaN for none.

    Raises:
        WriteError: the copy cannot be read, or differs in shape, position, reference system, nodata
            pixels, surfaces or colours.
    """
    largest = 0.0
    with gdal_write_errors(other, "Ask for a .tif instead."), contextlib.ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        if bands.dtype == np.float64:  # GDAL reads text as single precision by default
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
    # many formats rewrite the reference system in a form without an EPSG code
    codes = {crs.to_epsg() for crs in (a.crs, b.crs) if crs is not None} - {None}
    if len(codes) > 1:
        raise _unfit(path, "the coordinate reference system")


def _unfit(path: Path, what: str) -> WriteError:
    return WriteError(f"{path.name}: its format does not keep {what}.", "Ask for a .tif instead.")


class RasterWriter(Protocol):
    """Writer of one file, window by window.

    Attributes:
        difference: largest difference of the values in the file from those written, in the unit of
            the band.
    """

    difference: float

    def write(self, window: Window, pixels: Pixels) -> None:
        """Write the bands of a window, (bands, height, width)."""

    def finish(self, statistics: Sequence[BandStatistics], counts: NDArray[np.int64], /) -> None:
        """Write statistics by band and pixel counts by surface id, after all windows."""


@dataclass(frozen=True, slots=True)
class Storage:
    """Format and options of the files of an export.

    Attributes:
        form: format of all files.
        compression: compression of GeoTIFFs.
        threads: threads that paint and compress; 0 for the calling one alone.
        overviews: whether GeoTIFFs have overviews.
    """

    form: RasterFormat
    compression: Compression
    threads: int = 0
    overviews: bool = False


@contextlib.contextmanager
def open_writer(
    path: Path, extent: RasterExtent, bands: Bands, storage: Storage, coding: Coding | None
) -> Iterator[RasterWriter]:
    """Open a writer of a file for the block, which completes the file at its end.

    Only a GeoTIFF may hold a part of its grid: a tile of a mosaic, whose index names the surfaces.

    Args:
        path: file to write.
        extent: pixels of the file.
        bands: bands of the file.
        storage: format and options.
        coding: coding of values as pixels; None to store them as they are.
    """
    form, compression, threads = storage.form, storage.compression, storage.threads
    if form.driver == "NPY":
        yield _NpyWriter(path, bands, extent.grid, coding)
        return
    # GDAL resamples all bands of a file by one method
    own = storage.overviews and bands.content == "number" and not is_averaged_by_gdal(bands)
    direct = form.driver == "GTiff" and not own
    first = path if direct else path.with_name(f"{path.stem}.first.tif")
    # the intermediate file is lossless and fast to compress
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
        writer = _TiffWriter(file, named, extent, coding)
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
    """Creation options for the copy into the final format; `own` if the source has overviews."""
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


class _NpyWriter:
    """Writer of a .npy file: (height, width), or (bands, height, width) for several bands."""

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
            # writing to mapped memory on a full disk kills the process
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


class _TiffWriter:
    """Writer of a GeoTIFF: the final file, or the source of its copy."""

    def __init__(
        self, file: GeoTiff, named: Path | None, extent: RasterExtent, coding: Coding | None
    ) -> None:
        """Wrap an open GeoTIFF; `named` is the file to get surface names, None for none."""
        self._file, self._named, self._extent, self._coding = file, named, extent, coding
        self.difference = coding.difference if coding else 0.0

    def write(self, window: Window, pixels: Pixels) -> None:
        coded = pixels if self._coding is None else self._coding.encode(pixels)
        first = self._extent.pixels
        self._file.write(coded, window.row - first.row, window.column - first.column)

    def finish(self, statistics: Sequence[BandStatistics], counts: NDArray[np.int64]) -> None:
        if not self.difference:  # statistics are of the uncoded values
            self._file.finish(statistics)
        if self._named:
            name_surfaces(self._named, self._extent.terrain, counts)
