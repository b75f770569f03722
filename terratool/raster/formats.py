"""Raster formats by suffix: their limits, and the coding of values as pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rasterio.drivers import raster_driver_extensions

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands, BandStatistics
from terratool.raster.geotiff import crs_of
from terratool.raster.grid import Grid

Pixels = NDArray[Any]

_ESRI_NODATA = -9999.0
_HGT_NODATA = -32768
_HGT_SIDES = (1201, 3601)


@dataclass(frozen=True, slots=True)
class Coding:
    """Coding of values as pixels: value = pixel · scale + offset.

    Attributes:
        dtype: data type of the pixels.
        nodata: nodata pixel; None for none.
        scale, offset: 1 and 0 where pixels are the values themselves.
        difference: largest difference of a decoded pixel from its value, in the unit of the band.
    """

    dtype: np.dtype[Any]
    nodata: float | None
    scale: float = 1.0
    offset: float = 0.0
    difference: float = 0.0

    @property
    def exact(self) -> bool:
        """Whether pixels are the values themselves, as floats."""
        return self.dtype.kind == "f"

    def encode(self, numbers: Pixels) -> Pixels:
        """Code values as pixels; NaN becomes nodata.

        Raises:
            RequestError: a value equals nodata, or is out of range.
        """
        none = np.isnan(numbers)
        if self.exact:
            if (numbers == self.nodata).any():
                raise RequestError(
                    f"A number is {self.nodata:.9g}, which stands for none.",
                    "Give another --nodata, or ask for a .tif without it.",
                )
            return np.where(none, self.dtype.type(self.nodata), numbers)
        pixels = np.rint((numbers.astype(np.float64) - self.offset) / self.scale)
        pixels[none] = self.nodata
        limits = np.iinfo(self.dtype)
        if pixels.min() < limits.min or pixels.max() > limits.max:
            raise RequestError(
                f"Some numbers are not between {limits.min} and {limits.max}, as the format "
                "wants them.",
                "Ask for a .tif instead.",
            )
        return pixels.astype(self.dtype)


@dataclass(frozen=True, slots=True)
class RasterFormat:
    """A raster format.

    Attributes:
        driver: GDAL's name of the driver, or "NPY".
        options: creation options of the driver.
        bits: bits of the integers that values are coded as, negative for signed ones; 0 for none.
        nodata: nodata value of the format; NaN by default.
        one_band: whether a file holds only one band of numbers.
        text_bytes: bytes of text per float32 and per float64 value; 0 for binary formats.
        companions: suffixes of files that the driver may write beside.
    """

    driver: str
    options: dict[str, Any] = field(default_factory=dict)
    bits: int = 0
    nodata: float = math.nan
    one_band: bool = False
    text_bytes: tuple[int, int] = (0, 0)
    companions: tuple[str, ...] = ()


_FORMATS = {
    ".tif": RasterFormat("GTiff"),
    ".tiff": RasterFormat("GTiff"),
    ".npy": RasterFormat("NPY"),
    ".png": RasterFormat("PNG", {"zlevel": 6}, bits=16, nodata=0, one_band=True),
    ".asc": RasterFormat(
        "AAIGrid",
        {"force_cellsize": True},
        nodata=_ESRI_NODATA,
        one_band=True,
        text_bytes=(14, 24),
        companions=(".prj",),
    ),
    ".xyz": RasterFormat("XYZ", nodata=_ESRI_NODATA, one_band=True, text_bytes=(60, 70)),
    ".hgt": RasterFormat("SRTMHGT", bits=-16, nodata=_HGT_NODATA, one_band=True),
}


def raster_format(path: Path, cog: bool = False) -> RasterFormat:
    """Format of a file by its suffix, or cloud-optimised GeoTIFF if `cog`.

    Raises:
        RequestError: no format that can be written has the suffix, or `cog` conflicts with it.
    """
    suffix = path.suffix.lower()
    if cog:
        if suffix not in (".tif", ".tiff"):
            raise RequestError(
                f"{path.name}: a cloud-optimised GeoTIFF is a .tif.",
                "Give such a name, or leave out --cog.",
            )
        return RasterFormat("COG")
    if suffix in _FORMATS:
        return _FORMATS[suffix]
    known: dict[str, str] = raster_driver_extensions()
    if suffix[1:] not in known or suffix == ".vrt":
        names = ", ".join([*sorted(_FORMATS), ".img", ".bil", ".nc"])
        raise RequestError(
            f"{path.name}: no raster format has the suffix {suffix!r}."
            if suffix
            else f"{path.name}: has no suffix, so its format is unknown.",
            "A .vrt is the index of a mosaic: give --tiles with it."
            if suffix == ".vrt"
            else f"Try {names}.",
        )
    driver = known[suffix[1:]]
    # a netCDF would record time and path of its writing
    return RasterFormat(driver, {"write_gdal_history": "no"} if driver == "netCDF" else {})


def check_fit(
    form: RasterFormat,
    path: Path,
    bands: Bands,
    terrain: Terrain,
    grid: Grid,
    nodata: float | None,
) -> None:
    """Refuse bands that a format cannot hold.

    Args:
        form: format of the file.
        path: path of the file.
        bands: bands of the file.
        terrain: terrain of the raster.
        grid: pixels of the raster.
        nodata: requested nodata value; None for the default.

    Raises:
        RequestError: the format does not hold the bands, the nodata value or the grid.
    """
    asked = nodata not in (None, form.nodata) and bands.content == "number"
    lacks_nan = math.isnan(bands.empty) and not math.isnan(form.nodata)
    if asked and (form.bits or lacks_nan):
        held = "whole numbers" if form.bits else "no NaN"
        raise RequestError(
            f"{path.name}: a {path.suffix} holds {held}, {form.nodata:g} for none.",
            "Leave out --nodata, or ask for a .tif.",
        )
    if (
        form.one_band
        and bands.count > 1
        and not (form.driver == "PNG" and bands.content == "color")
    ):
        raise RequestError(
            f"{path.name}: a {path.suffix} holds one band, but these are {bands.count}: "
            f"{', '.join(bands.names)}.",
            "Ask for one layer at a time, or for a .tif.",
        )
    if form.driver == "SRTMHGT" and (
        bands.content != "number" or path.name != _degree(terrain, grid)
    ):
        raise RequestError(
            f"{path.name}: a .hgt is a degree in EPSG:4326 at 1201² or 3601² points, with the name "
            f"of its south-west corner; this is {_degree(terrain, grid) or 'none'}.",
            "Ask for a .tif instead.",
        )


def _degree(terrain: Terrain, grid: Grid) -> str:
    """Name of the SRTM tile whose points are the grid's pixel centres; empty for none."""
    crs = crs_of(terrain)
    side, step = grid.width, grid.resolution
    east, north = grid.west + step / 2, grid.south + step / 2
    if (
        crs is None
        or crs.to_epsg() != 4326
        or side != grid.height
        or side not in _HGT_SIDES
        or max(abs(step * (side - 1) - 1), abs(east - round(east)), abs(north - round(north)))
        > 1e-3 * step
    ):
        return ""
    return (
        f"{'N' if north > -0.5 else 'S'}{abs(round(north)):02}"
        f"{'E' if east > -0.5 else 'W'}{abs(round(east)):03}.hgt"
    )


def coding_of(form: RasterFormat, bands: Bands, range_: BandStatistics | None) -> Coding | None:
    """Coding of bands in a format; None to store values as they are.

    Args:
        form: format of the file.
        bands: bands of the file.
        range_: statistics of the values, where `wants_range`; else None.
    """
    if bands.content != "number":
        return None
    if not form.bits:
        nodata = form.nodata if math.isnan(bands.empty) else bands.empty
        return None if math.isnan(nodata) else Coding(bands.dtype, nodata)
    if form.bits < 0:
        return Coding(np.dtype(np.int16), form.nodata, difference=0.5)
    low, high = (range_.low, range_.high) if range_ and range_.count else (0.0, 0.0)
    levels = (1 << form.bits) - 2  # 0 is nodata
    scale = (high - low) / levels
    lost = scale / 2
    scale = scale or 1.0  # level ground
    return Coding(np.dtype(f"u{form.bits // 8}"), form.nodata, scale, low - scale, lost)


def plain_coding(bands: Bands) -> Coding:
    """Coding of pixels that are the painted values."""
    return Coding(bands.dtype, bands.nodata)


def wants_range(form: RasterFormat, bands: Bands) -> bool:
    """Return whether coding needs the range of the values before they are written."""
    return form.bits > 0 and bands.content == "number"
