"""Overviews of GeoTIFFs, at a half, a quarter, … of the resolution."""

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
"""Pixels on the longer side above which a GeoTIFF has overviews by default."""

_SIDE = TILE
_NOWHERE = 1e-6
"""Length of a mean unit vector below which directions have no mean."""

Floats = NDArray[np.float64]


def factors(width: int, height: int) -> list[int]:
    """Factors of the overviews, 2, 4, …, down to one tile; empty for a raster of one tile."""
    longer = max(width, height)
    found = [2]
    while -(-longer // found[-1]) > TILE:
        found.append(2 * found[-1])
    return found if longer > TILE else []


def is_averaged_by_gdal(bands: Bands) -> bool:
    """Return whether GDAL's resampling suits all bands of a file."""
    return len(set(bands.means)) == 1 and bands.means[0] in ("number", "")


def add_overviews(path: Path, bands: Bands, threads: int) -> None:
    """Add overviews by GDAL to a GeoTIFF of bands that `is_averaged_by_gdal` accepts.

    Numbers and colours are averaged, surfaces resampled to the nearest pixel.

    Raises:
        WriteError: GDAL cannot write the overviews.
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
    """Make a temporary VRT for the block, with the pixels of a GeoTIFF of numbers and overviews.

    Each overview is made from the one before: numbers by their mean, directions by the mean of
    their unit vectors, vectors by their normalised mean. Nodata pixels are left out of means.

    Raises:
        WriteError: the overviews cannot be written.
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
        down, across = _shares_of(file.height), _shares_of(file.width)
        with geotiff(target, bands, profile) as out:
            for row in range(0, height, _SIDE):
                for column in range(0, width, _SIDE):
                    rows, columns = down.part(row, row + _SIDE), across.part(column, column + _SIDE)
                    pixels = file.read(window=Window(
                        columns.first, rows.first, columns.count, rows.count
                    )).astype(np.float64)  # fmt: skip
                    if file.nodata is not None:
                        pixels[pixels == file.nodata] = np.nan
                    half = _averages(pixels, bands.means, rows, columns)
                    if file.nodata is not None:
                        half[np.isnan(half)] = file.nodata
                    out.write(half.astype(bands.dtype), row, column)


@dataclass(frozen=True, slots=True)
class _Shares:
    """Pixels of a line, and their shares, covered by each of n pixels at half the resolution.

    Attributes:
        indices: (n, 3) indices of the covered pixels.
        weights: (n, 3) covered shares, 0 to 1; fractions occur in lines of odd length.
    """

    indices: NDArray[np.int64]
    weights: Floats

    @property
    def first(self) -> int:
        """Index of the first covered pixel."""
        return int(self.indices[0, 0])

    @property
    def count(self) -> int:
        """Number of covered pixels."""
        return int(self.indices[-1].max()) + 1 - self.first

    def part(self, begin: int, end: int) -> _Shares:
        """Shares of the pixels at half the resolution from `begin` up to `end`."""
        return _Shares(self.indices[begin:end], self.weights[begin:end])

    def sums(self, values: Floats, axis: int) -> Floats:
        """Weighted sums of the covered values along axis 1, rows, or axis 2, columns."""
        if (self.weights == [1.0, 1.0, 0.0]).all():  # two whole pixels each: the fast path
            end = 2 * len(self.weights)
            if axis == 1:
                return np.asarray(values[:, :end:2] + values[:, 1:end:2])
            return np.asarray(values[..., :end:2] + values[..., 1:end:2])
        total = np.zeros(())
        for indices, weights in zip((self.indices - self.first).T, self.weights.T, strict=True):
            shape = (1, -1, 1) if axis == 1 else (1, 1, -1)
            total = total + np.take(values, indices, axis) * weights.reshape(shape)
        return np.asarray(total)


def _shares_of(count: int) -> _Shares:
    """Shares of a line of `count` pixels in ⌈count / 2⌉ equal parts."""
    half = -(-count // 2)
    edges = np.arange(half + 1) * count / half
    indices = np.floor(edges[:-1, None]).astype(np.int64) + np.arange(3)
    weights = np.minimum(indices + 1, edges[1:, None]) - np.maximum(indices, edges[:-1, None])
    return _Shares(np.minimum(indices, count - 1), np.maximum(weights, 0.0))


def _averages(pixels: Floats, means: tuple[str, ...], rows: _Shares, columns: _Shares) -> Floats:
    """Means over the pixels at half the resolution, (bands, rows, columns).

    Args:
        pixels: (bands, height, width), NaN for nodata.
        means: averaging of each band, as in `Bands`.
        rows: shares of the rows of pixels.
        columns: shares of the columns of pixels.
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
            out[band][out[band].astype(np.float32) >= 360.0] = 0.0  # angles just below 360 round up
            out[band][np.hypot(east, north) < _NOWHERE] = np.nan
        else:
            out[band] = mean(values)[0]
    vectors = [band for band, kind in enumerate(means) if kind == "vector"]
    if vectors:
        with np.errstate(invalid="ignore", divide="ignore"):
            out[vectors] /= np.sqrt((out[vectors] ** 2).sum(axis=0))
    return out
