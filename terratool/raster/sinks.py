"""Where the windows of a file go: GeoTIFFs, arrays, and by way of GeoTIFFs all other formats."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.copying import copied
from terratool.raster.formats import Coding, RasterFormat
from terratool.raster.geotiff import Compression, cog_options, geotiff, name_surfaces
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import Bands
from terratool.raster.palette import MOST_COLORS
from terratool.raster.statistics import BandStatistics
from terratool.raster.verifying import difference

Pixels = NDArray[Any]


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


@contextlib.contextmanager
def open_writer(
    path: Path,
    form: RasterFormat,
    terrain: Terrain,
    grid: Grid,
    bands: Bands,
    compression: Compression,
    coding: Coding | None,
    threads: int,
    window: Window | None = None,
) -> Iterator[RasterWriter]:
    """A file of a format to be written; complete when the block has ended.

    A GeoTIFF may hold a `window` of the grid; the names of its surfaces do not stand beside it, but
    in the index of the mosaic that it is a tile of.
    """
    if form.driver == "NPY":
        yield _Array(path, bands, grid)
        return
    direct = form.driver == "GTiff"
    first = path if direct else path.with_name(f"{path.stem}.first.tif")
    # what is copied is not compressed for long, and loses nothing on the way
    first_compression = compression if direct else Compression("zstd")
    coded = bands if coding is None else replace(bands, dtype=coding.dtype)
    nodata = None if coding is None else coding.nodata
    tiff = form.driver in ("GTiff", "COG")
    colors = MOST_COLORS if tiff else 256
    with geotiff(
        first, terrain, grid, coded, first_compression, threads, nodata, window, colors
    ) as file:
        if coding is not None and not coding.exact:
            file.file.scales = (coding.scale,) * bands.count
            file.file.offsets = (coding.offset,) * bands.count
        into = _Raster(file, None if window else first, terrain, bands, coding)
        if tiff and bands.kind == "number":
            into.difference = compression.max_z_error
        yield into
    if direct:
        return
    options = cog_options(bands, compression) if form.driver == "COG" else dict(form.options)
    if form.driver == "AAIGrid" and bands.kind == "number":
        options["significant_digits"] = 9 if bands.dtype == np.float32 else 17
    copied(first, path, form.driver, options, threads)
    if form.driver != "COG":
        nothing = form.nodata if bands.kind == "number" else math.nan
        into.difference += difference(first, path, coded, nothing)
    first.unlink()
    first.with_name(first.name + ".aux.xml").unlink(missing_ok=True)


class _Array:
    """A .npy file: (height, width), or (bands, height, width) if there are several."""

    difference = 0.0

    def __init__(self, path: Path, bands: Bands, grid: Grid) -> None:
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
        self._array.reshape((-1, *self._array.shape[-2:]))[:, rows, columns] = pixels

    def finish(self, _statistics: Sequence[BandStatistics], _counts: NDArray[np.int64]) -> None:
        self._array.flush()


class _Raster:
    """A GeoTIFF, the file itself or what it is copied from."""

    def __init__(
        self, file: Any, named: Path | None, terrain: Terrain, bands: Bands, coding: Coding | None
    ) -> None:
        self._file, self._named, self._terrain, self._bands = file, named, terrain, bands
        self._coding = coding
        self.difference = 0.0
        if coding is not None:
            self.difference = coding.difference

    def write(self, window: Window, pixels: Pixels) -> None:
        self._file.write(window, pixels if self._coding is None else self._coding.encode(pixels))

    def finish(self, statistics: Sequence[BandStatistics], counts: NDArray[np.int64]) -> None:
        if not self.difference:  # or they would be those of other numbers
            self._file.finish(statistics)
        if self._bands.kind == "surface" and self._named:
            name_surfaces(self._named, self._terrain, counts)
