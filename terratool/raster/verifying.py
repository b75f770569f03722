"""What other drivers of GDAL made of a raster: read again, held against what they were given."""

from __future__ import annotations

import contextlib
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning

from terratool.errors import WriteError
from terratool.raster.geotiff import complaints
from terratool.raster.layers import Bands

_ASIDE = 1e-3
"""So far, in pixels, a raster may have moved: coordinates are rounded where they are text."""


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
    with complaints(other, "Ask for a .tif instead."), contextlib.ExitStack() as stack:
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
    if largest and bands.kind != "number":
        raise _unfit(other, f"the {bands.kind}s")
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
        abs(p - q) > _ASIDE * a.transform.a for p, q in zip(a.bounds, b.bounds, strict=True)
    ):
        raise _unfit(path, "where the pixels are")
    # many formats write a reference system in their own words, which have no number
    codes = {crs.to_epsg() for crs in (a.crs, b.crs) if crs is not None} - {None}
    if len(codes) > 1:
        raise _unfit(path, "the coordinate reference system")


def _unfit(path: Path, what: str) -> WriteError:
    return WriteError(f"{path.name}: its format does not keep {what}.", "Ask for a .tif instead.")
