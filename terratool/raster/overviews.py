"""Overviews of GeoTIFFs: the same pixels at half the resolution, a quarter, and so on."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import rasterio
import rasterio.shutil
from numpy.typing import NDArray
from rasterio.enums import Resampling
from rasterio.windows import Window

from terratool.io.bands import Bands
from terratool.io.geotiff import (
    CACHE_BYTES,
    TILE,
    Compression,
    TiffProfile,
    gdal_write_errors,
    geotiff,
    tile_options,
)

OVERVIEWS_FROM = 4096
"""A plain GeoTIFF has overviews if its longer side has more pixels, and nothing else is said."""

_SIDE = TILE
_NOWHERE = 1e-6
"""Directions whose mean vector is shorter have no mean."""

Floats = NDArray[np.float64]


def factors(width: int, height: int) -> list[int]:
    """By how much overviews are coarser: until the last of them is one tile."""
    longer = max(width, height)
    found = [2]
    while -(-longer // found[-1]) > TILE:
        found.append(2 * found[-1])
    return found if longer > TILE else []


def by_gdal(bands: Bands) -> bool:
    """Whether GDAL averages all bands of a file as they are to be."""
    return len(set(bands.means)) == 1 and bands.means[0] in ("number", "")


def add_overviews(path: Path, bands: Bands, threads: int) -> None:
    """Add overviews to a GeoTIFF whose bands GDAL averages as they are to be.

    Numbers and colours are averaged; of surfaces the nearest pixel is taken.

    Raises:
        WriteError: GDAL cannot write them.
    """
    resampling = Resampling.average if bands.means[0] else Resampling.nearest
    settings = {"GDAL_NUM_THREADS": str(max(1, threads)), "GDAL_TIFF_OVR_BLOCKSIZE": str(TILE)}
    with (
        gdal_write_errors(path),
        rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES, ZSTD_LEVEL_OVERVIEW="1", **settings),
        rasterio.open(path, "r+", num_threads=str(max(1, threads))) as file,
    ):
        file.build_overviews(factors(file.width, file.height), resampling)


@contextlib.contextmanager
def with_overviews(path: Path, bands: Bands) -> Iterator[Path]:
    """A raster that has the pixels of a GeoTIFF of numbers and overviews of our own, for a while.

    Each is made of the one before: numbers by their mean, directions by the mean of their unit
    vectors, vectors by their mean at length 1. What is known of some of four pixels is that of all.

    Raises:
        WriteError: there is no place for it.
    """
    levels = []
    virtual = path.with_name(f"{path.stem}.overviews.vrt")
    try:
        with gdal_write_errors(path), rasterio.open(path) as file:
            count = len(factors(file.width, file.height))
        for level in range(1, count + 1):
            levels.append(path.with_name(f"{path.stem}.{level}.tif"))
            _halve(levels[-2] if level > 1 else path, levels[-1], bands)
        with gdal_write_errors(path):
            rasterio.shutil.copy(path, virtual, driver="VRT")
        root = ElementTree.fromstring(virtual.read_bytes())
        for number, band in enumerate(root.iter("VRTRasterBand"), 1):
            for level_path in levels:
                overview = ElementTree.SubElement(band, "Overview")
                name = ElementTree.SubElement(overview, "SourceFilename", relativeToVRT="1")
                name.text = level_path.name
                ElementTree.SubElement(overview, "SourceBand").text = str(number)
        virtual.write_bytes(ElementTree.tostring(root))
        yield virtual
    finally:
        for made in (*levels, virtual):
            made.unlink(missing_ok=True)


def _halve(source: Path, target: Path, bands: Bands) -> None:
    """Write a GeoTIFF at half the resolution of another one."""
    with gdal_write_errors(source), rasterio.open(source) as file:
        width, height = -(-file.width // 2), -(-file.height // 2)
        profile = TiffProfile(
            width, height, file.transform, options=tile_options(bands.dtype, Compression()),
            nodata=file.nodata,
        )  # fmt: skip
        down, across = _shares(file.height), _shares(file.width)
        with geotiff(target, bands, profile) as out:
            for row in range(0, height, _SIDE):
                for column in range(0, width, _SIDE):
                    rows, columns = down.part(row, row + _SIDE), across.part(column, column + _SIDE)
                    pixels = file.read(window=Window(
                        columns.first, rows.first, columns.count, rows.count
                    )).astype(np.float64)  # fmt: skip
                    if file.nodata is not None:
                        pixels[pixels == file.nodata] = np.nan
                    half = _averaged(pixels, bands.means, rows, columns)
                    if file.nodata is not None:
                        half[np.isnan(half)] = file.nodata
                    out.write(half.astype(bands.dtype), row, column)


@dataclass(frozen=True, slots=True)
class _Shares:
    """Which pixels of a line, and how much of them, each pixel at half the resolution covers.

    Attributes:
        indices: (n, 3) of pixels.
        weights: (n, 3) 1 for a whole one, 0 for none; where the number is odd, parts.
    """

    indices: NDArray[np.int64]
    weights: Floats

    @property
    def first(self) -> int:
        """The first pixel that is covered."""
        return int(self.indices[0, 0])

    @property
    def count(self) -> int:
        """How many are covered."""
        return int(self.indices[-1].max()) + 1 - self.first

    def part(self, begin: int, end: int) -> _Shares:
        """Those of some pixels at half the resolution."""
        return _Shares(self.indices[begin:end], self.weights[begin:end])

    def sums(self, values: Floats, axis: int) -> Floats:
        """Weighted sums of what is covered along the axis of rows, 1, or of columns, 2."""
        if (self.weights == [1.0, 1.0, 0.0]).all():  # two whole pixels each: no need to look
            end = 2 * len(self.weights)
            if axis == 1:
                return np.asarray(values[:, :end:2] + values[:, 1:end:2])
            return np.asarray(values[..., :end:2] + values[..., 1:end:2])
        total = np.zeros(())
        for indices, weights in zip((self.indices - self.first).T, self.weights.T, strict=True):
            shape = (1, -1, 1) if axis == 1 else (1, 1, -1)
            total = total + np.take(values, indices, axis) * weights.reshape(shape)
        return np.asarray(total)


def _shares(count: int) -> _Shares:
    """Of a line of so many pixels, ⌈count / 2⌉ equal parts."""
    half = -(-count // 2)
    edges = np.arange(half + 1) * count / half
    indices = np.floor(edges[:-1, None]).astype(np.int64) + np.arange(3)
    weights = np.minimum(indices + 1, edges[1:, None]) - np.maximum(indices, edges[:-1, None])
    return _Shares(np.minimum(indices, count - 1), np.maximum(weights, 0.0))


def _averaged(pixels: Floats, means: tuple[str, ...], rows: _Shares, columns: _Shares) -> Floats:
    """Means of what pixels at half the resolution cover, (bands, rows, columns).

    Args:
        pixels: (bands, height, width), NaN for none.
        means: how each band is averaged, as `Bands` has it.
        rows: of the pixels.
        columns: of them.
    """

    def mean(values: Floats) -> Floats:
        known = ~np.isnan(values)
        parts = (np.where(known, values, 0.0), known.astype(np.float64))
        total, weight = (columns.sums(rows.sums(part, 1), 2) for part in parts)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(total / weight)

    out = np.empty((len(pixels), len(rows.weights), len(columns.weights)))
    for band, kind in enumerate(means):
        values = pixels[band : band + 1]
        if kind == "direction":
            angles = np.radians(values)
            east, north = mean(np.sin(angles))[0], mean(np.cos(angles))[0]
            out[band] = np.degrees(np.arctan2(east, north)) % 360.0
            out[band][out[band].astype(np.float32) >= 360.0] = 0.0  # what is just below rounds up
            out[band][np.hypot(east, north) < _NOWHERE] = np.nan
        else:
            out[band] = mean(values)[0]
    vectors = [band for band, kind in enumerate(means) if kind == "vector"]
    if vectors:
        with np.errstate(invalid="ignore", divide="ignore"):
            out[vectors] /= np.sqrt((out[vectors] ** 2).sum(axis=0))
    return out
