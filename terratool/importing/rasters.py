"""Rasters as sources of heights: whatever GDAL opens, read by rows from the south."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError
from rasterio.crs import CRS
from rasterio.enums import ColorInterp, Resampling
from rasterio.errors import CRSError, NotGeoreferencedWarning, RasterioError, WarpOperationError
from rasterio.vrt import WarpedVRT
from rasterio.windows import Window

from terratool.errors import ReadError, RequestError
from terratool.field.terrain import Bounds
from terratool.importing.samples import PixelLattice, extremes

HIGHEST = 1e9
"""A definition's heights stay below this in size."""

SUSPECTS = (-999.0, -9999.0, -32767.0, -32768.0, -99999.0, 9999.0, 32767.0, 65535.0, 99999.0)
"""Numbers that often stand for nodata in files that do not say so."""

_CACHE_BYTES = 1 << 27
_ON_LATTICE = 1e-6
_COLORS = (ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.palette)


@dataclass(slots=True)
class RasterHeights:
    """One band of an open raster, as a `Heights`.

    Attributes:
        file: what rasterio opened, or a warp of it.
        window: the pixels that are read.
        flips: whether the file's rows begin in the south, its columns in the east.
        infinite: pixels that were.
        suspects: pixels that may be nodata, by their height.
        others: lowest and highest height of the others.
    """

    name: str
    file: Any
    band: int
    window: Window
    flips: tuple[bool, bool]
    lattice: PixelLattice
    nodata: float | None
    scale: tuple[float, float]
    about: list[str]
    infinite: int = 0
    suspects: dict[float, int] = field(default_factory=dict)
    others: list[float] = field(default_factory=lambda: [math.inf, -math.inf])

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about what a user should know, after the reading."""
        count = self.infinite
        what = "1 pixel is" if count == 1 else f"{count:,} pixels are"
        extra = [f"{what} infinite: taken as nodata."] if count else []
        low, high = self.others
        for height, pixels in self.suspects.items():
            if low < high and max(low - height, height - high) > high - low:
                what = "1 pixel is" if pixels == 1 else f"{pixels:,} pixels are"
                extra.append(
                    f"{what} {height:g}, far from all others: if that stands for nodata, add "
                    f"--nodata {height:g}."
                )
        return (*self.about, *extra)

    def _look(self, heights: NDArray[np.float64], low: float, high: float) -> None:
        """See whether the lowest or the highest heights are suspect."""
        for height in (low, high):
            if height in SUSPECTS:
                at = heights == height
                self.suspects[height] = self.suspects.get(height, 0) + int(at.sum())
                heights = np.where(at, math.nan, heights)
                low, high, *_ = extremes(heights)
        self.others[0] = min(self.others[0], low)
        self.others[1] = max(self.others[1], high)

    def read(self, first: int, count: int) -> NDArray[np.float64]:
        """So many rows from `first`, (count, columns) float64; NaN for none.

        Raises:
            ReadError: the file is broken there, or holds numbers that are no heights.
        """
        south_up, east_first = self.flips
        row = first if south_up else self.lattice.rows - first - count
        window = Window(self.window.col_off, self.window.row_off + row, self.window.width, count)
        with complaints(self.name):
            pixels = self.file.read(self.band, window=window, masked=True)
        heights = np.ma.filled(pixels.astype(np.float64), math.nan)
        if self.nodata is not None:
            heights[heights == self.nodata] = math.nan
        raw = heights
        if self.scale != (1.0, 0.0):
            heights = heights * self.scale[0] + self.scale[1]
        low, high, _, infinite = extremes(heights)
        self.infinite += infinite
        self._look(heights, low, high)
        if max(-low, high) >= HIGHEST:
            at = np.nanargmax(np.abs(heights))
            raise ReadError(
                f"{self.name}: holds a height of {heights.flat[at]:g}, more than a definition "
                "takes.",
                f"If it stands for nodata, add --nodata {float(raw.flat[at])!r}.",
            )
        heights = heights[:: 1 if south_up else -1, :: -1 if east_first else 1]
        return np.ascontiguousarray(heights)


@contextlib.contextmanager
def open_raster(
    name: str,
    *,
    band: int | None = None,
    bounds: Bounds | None = None,
    window: tuple[int, int, int, int] | None = None,
    crs: str | None = None,
    nodata: float | None = None,
) -> Iterator[RasterHeights]:
    """Open a raster as heights.

    Args:
        name: a path, or whatever else GDAL opens.
        band: from 1; the only one, if not said.
        bounds: west, south, east, north in the raster's reference system (after `crs`): the pixels
            whose centres lie within.
        window: column and row of the north-west pixel, width and height in pixels of the file.
        crs: a reference system to reproject to, bilinearly.
        nodata: a number that stands for none, besides what the file says.

    Raises:
        ReadError: it cannot be read, or is no raster of heights.
        RequestError: the band, bounds or window are not in it.
    """
    with contextlib.ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        stack.enter_context(rasterio.Env(GDAL_CACHEMAX=_CACHE_BYTES, AAIGRID_DATATYPE="Float64"))
        with complaints(name):
            file = stack.enter_context(rasterio.open(name))
        number = _band(name, file, band)
        about: list[str] = []
        scaled = file.scales[number - 1], file.offsets[number - 1]
        if crs is not None:
            file = stack.enter_context(_warped(name, file, crs, nodata))
            about.append(f"Reprojected to {crs}, bilinearly.")
        yield _heights(name, file, number, scaled, bounds, window, nodata, about)


def _band(name: str, file: Any, band: int | None) -> int:
    """The band that holds the heights."""
    if file.count == 0:
        inner = ", ".join(file.subdatasets[:5])
        raise ReadError(
            f"{name}: has no band of its own" + (f", but holds {inner}." if inner else "."),
            "Name one of these." if inner else "Name a raster of heights.",
        )
    if band is not None and not 1 <= band <= file.count:
        raise RequestError(f"{name}: has no band {band}.", f"Its bands are 1 to {file.count}.")
    colors = [kind for kind in file.colorinterp if kind in _COLORS]
    if band is None and colors:
        raise ReadError(
            f"{name}: is a picture ({', '.join(kind.name for kind in file.colorinterp)}), "
            "not a raster of heights.",
            "Name another file, or the band that holds heights with --band.",
        )
    if band is None and file.count > 1:
        named = [f"{i} {text}" for i, text in enumerate(file.descriptions, 1) if text]
        alpha = [kind is ColorInterp.alpha for kind in file.colorinterp]
        if alpha.count(False) > 1:
            raise RequestError(
                f"{name}: has {file.count} bands{': ' if named else ''}{', '.join(named[:9])}.",
                "Choose one with --band.",
            )
        band = alpha.index(False) + 1
    number = band or 1
    kind = (
        np.dtype(file.dtypes[number - 1]).kind if "complex" not in file.dtypes[number - 1] else "c"
    )
    if kind == "c":
        raise ReadError(
            f"{name}: holds complex numbers, not heights.", "Name a raster of real numbers."
        )
    return number


def _warped(name: str, file: Any, crs: str, nodata: float | None) -> Any:
    try:
        target = CRS.from_user_input(crs)
    except CRSError as error:
        raise RequestError(
            f"{crs!r} names no reference system.", 'Write one as in "EPSG:32633".'
        ) from error
    if file.crs is None:
        raise RequestError(
            f"{name}: does not say its reference system, so that it cannot be reprojected.",
            "Leave out --crs, or give the file one with gdal_edit.py -a_srs.",
        )
    if nodata not in (None, file.nodata) and not math.isnan(file.nodata or math.nan):
        raise RequestError(
            f"{name}: its nodata is {file.nodata:g}, and only one number can be left out where "
            "pixels are resampled.",
            "Leave out --nodata or --crs, or change the file's with gdal_edit.py -a_nodata.",
        )
    with complaints(name):
        return WarpedVRT(
            file,
            crs=target,
            resampling=Resampling.bilinear,
            dtype="float64",
            src_nodata=file.nodata if nodata is None else nodata,
            nodata=math.nan,
        )


def _heights(
    name: str,
    file: Any,
    band: int,
    scale: tuple[float, float],
    bounds: Bounds | None,
    window: tuple[int, int, int, int] | None,
    nodata: float | None,
    about: list[str],
) -> RasterHeights:
    transform = file.transform
    if abs(transform.b) + abs(transform.d) > 1e-9 * (abs(transform.a) + abs(transform.e)):
        raise ReadError(
            f"{name}: its pixels are turned against its reference system.",
            "Add --crs with a reference system, to have it resampled north up.",
        )
    west, south, east, north = file.bounds
    south_up, east_first = transform.e > 0, transform.a < 0
    west, east, south, north = (
        min(west, east),
        max(west, east),
        min(south, north),
        max(south, north),
    )
    dx, dy = abs(transform.a), abs(transform.e)
    if file.crs is None and transform.is_identity:
        about.append("The raster does not say where it lies: a pixel is taken as 1 × 1.")
        south, north = 0.0, float(file.height)
        south_up = False
    # columns from the west and rows from the north of what is wanted
    columns, rows = (0, file.width), (0, file.height)
    if window is not None:
        column, row, width, height = window
        if (
            min(width, height) < 1
            or min(column, row) < 0
            or (column + width > file.width or row + height > file.height)
        ):
            raise RequestError(
                f"{name}: the window {column} {row} {width} {height} is not within its "
                f"{file.width} × {file.height} pixels.",
                "Give column, row, width and height; columns and rows count from 0.",
            )
        columns = (column, column + width)
        rows = (row, row + height)
        if east_first:
            columns = file.width - columns[1], file.width - columns[0]
        if south_up:
            rows = file.height - rows[1], file.height - rows[0]
    if bounds is not None:
        if not all(map(math.isfinite, bounds)):
            raise RequestError(
                f"The bounds are {' '.join(f'{side:g}' for side in bounds)}.",
                "Give four finite numbers: west, south, east, north.",
            )
        columns = _within(columns, bounds[0] - west, bounds[2] - west, dx)
        rows = _within(rows, north - bounds[3], north - bounds[1], dy)
        if columns[0] >= columns[1] or rows[0] >= rows[1]:
            raise RequestError(
                f"{name}: no pixel has its centre in the bounds "
                f"{' '.join(f'{side:.12g}' for side in bounds)}.",
                f"It lies in {west:.12g} {south:.12g} {east:.12g} {north:.12g}.",
            )
    lattice = PixelLattice(
        west + columns[0] * dx,
        north - rows[1] * dy,
        dx,
        dy,
        columns[1] - columns[0],
        rows[1] - rows[0],
        _spelled(file.crs),
        _unit(file, band, west, east, south, north, about),
    )
    first_column = file.width - columns[1] if east_first else columns[0]
    first_row = file.height - rows[1] if south_up else rows[0]
    part = Window(first_column, first_row, lattice.columns, lattice.rows)
    return RasterHeights(
        name, file, band, part, (south_up, east_first), lattice, nodata, scale, about
    )


def _within(pixels: tuple[int, int], low: float, high: float, side: float) -> tuple[int, int]:
    """Pixels whose centres lie from `low` to `high`, but for rounding."""
    first = math.ceil(low / side - 0.5 - _ON_LATTICE)
    last = math.floor(high / side - 0.5 + _ON_LATTICE)
    return max(pixels[0], first), min(pixels[1], last + 1)


def _spelled(crs: CRS | None) -> str | None:
    """A reference system as a definition spells it."""
    if crs is None or not crs.to_wkt():
        return None
    number = crs.to_epsg()
    return f"EPSG:{number}" if number else str(crs.to_wkt())


def _unit(
    file: Any, band: int, west: float, east: float, south: float, north: float, about: list[str]
) -> str:
    """What heights are measured in; what is odd is noted."""
    vertical = (file.units[band - 1] or "").strip()
    unit = "m" if vertical.lower() in ("", "m", "metre", "meter", "metres", "meters") else vertical
    if file.crs is not None and file.crs.is_geographic:
        zone = min(60, int(((west + east) / 2 + 180) // 6) + 1)
        code = (32600 if south + north >= 0 else 32700) + zone
        about.append(
            f"x and y are degrees and heights {unit}, so that no slope is right: "
            f"add --crs EPSG:{code} to reproject."
        )
    elif file.crs is not None and file.crs.is_projected:
        linear = str(file.crs.linear_units)
        if linear.lower() not in ("metre", "meter", "m", "unknown") or unit != "m":
            about.append(f"x and y are in {linear}, heights in {unit}; they are kept as they are.")
    elif unit != "m":
        about.append(f"Heights are in {unit}; they are kept as they are.")
    return unit


@contextlib.contextmanager
def complaints(name: str) -> Iterator[None]:
    """GDAL's errors as ours."""
    try:
        yield
    except (RasterioError, CPLE_BaseError, WarpOperationError, OSError, ValueError) as error:
        reason = str(error.__cause__ or error).strip().rstrip(".")
        reason = reason.removeprefix(f"{name}: ").removeprefix(f"'{name}' ")
        raise ReadError(
            f"{name}: cannot be read as a raster ({reason or type(error).__name__}).",
            "Check the path, and the file with gdalinfo -checksum.",
        ) from error
