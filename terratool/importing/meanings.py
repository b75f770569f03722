"""Meanings of the numbers of a raster: which bands are heights, their scale, units, and its CRS."""

from __future__ import annotations

import math
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.windows import Window

from terratool.definition.crs import LOCAL, CrsValue, metric_crs
from terratool.errors import ReadError, RequestError
from terratool.importing.pictures import ENCODINGS, Encoding, channels, grey_band, is_picture
from terratool.importing.types import SourceOptions, sample_range
from terratool.io.crs import crs_in_metres, horizontal_crs, read_crs, shown_crs, vertical_unit
from terratool.io.guards import is_placed
from terratool.io.opening import gdal_errors, refuse_band
from terratool.io.units import METRE, LengthUnit, length_named, length_of, unit_text
from terratool.report.wording import count_of
from terratool.text.files import open_file

UNKNOWN_UNIT = "The unit of the heights is not known: add --source-units, as ft, to say it."

_PICTURES = frozenset(["BMP", "GIF", "JPEG", "PNG", "PNM", "SGI", "WEBP"])
"""Drivers of files that are pictures, whatever they show."""
_WHOLE_RANGE = 2
"""Most bytes of whole numbers whose whole range counts for --height-range."""
_MOST_NAMED = 9
"""Most bands or variables that a message names."""
_HEAD = 1 << 10
"""Bytes of a file of PNM in which its header stands."""
_STRIP = 1 << 22
"""Pixels that are read at a time to find their range."""


class NumberScale(NamedTuple):
    """Factor and offset that make heights of the numbers of a file."""

    factor: float
    offset: float

    def times(self, factor: float) -> NumberScale:
        """Return the scale to heights in another unit."""
        return NumberScale(self.factor * factor, self.offset * factor)


UNSCALED = NumberScale(1.0, 0.0)


class PixelBands(NamedTuple):
    """Bands of a raster with the heights.

    Attributes:
        numbers: numbers of the bands, from 1; three for terrain-RGB.
        encoding: way in which these have heights; None for one band.
    """

    numbers: tuple[int, ...]
    encoding: Encoding | None = None

    def read(
        self, name: str, file: Any, window: Window, nodata: float | None
    ) -> NDArray[np.float64]:
        """Read numbers of a window, (rows, columns) float64; NaN for none.

        Args:
            name: name of the raster, for messages.
            file: the raster.
            window: the window.
            nodata: a number more that stands for none.

        Raises:
            ReadError: the file is broken there.
        """
        with gdal_errors(name):
            pixels = file.read(list(self.numbers), window=window, masked=True)
        if self.encoding is not None:
            found = self.encoding.heights(pixels)
        else:
            with np.errstate(invalid="ignore"):  # signalling NaN count as NaN
                found = np.ma.filled(pixels[0].astype(np.float64), math.nan)
        if nodata is not None:
            found[found == nodata] = math.nan
        return found


def bands_of(name: str, file: Any, band: int | None, encoding: str | None) -> PixelBands:
    """Bands of a raster with the heights.

    Args:
        name: name of the raster, for messages.
        file: the raster.
        band: number of the band, from 1; None where the raster has to tell.
        encoding: name of a kind of terrain-RGB; None for none.

    Raises:
        ReadError: the raster is a picture of other colours than grey, or has no band.
        RequestError: there are several bands, or not the one that is named.
    """
    if file.count == 0:
        inner = file.subdatasets
        if not inner:
            raise ReadError(f"{name}: has no band of its own.", "Name a raster of heights.")
        what = "variable" if file.driver == "netCDF" else "raster"
        known = ", ".join(one.rpartition(":")[2] for one in inner[:_MOST_NAMED])
        raise ReadError(
            f"{name}: holds {count_of(len(inner), what)}: {known}.",
            f"Name one of them, as {inner[0]}.",
        )
    if encoding is not None:
        return PixelBands(channels(name, file), ENCODINGS[encoding])
    if band is None and is_picture(file):
        band = grey_band(name, file)
    if band is None and file.count > 1:
        named = [f"{i} {text}" for i, text in enumerate(file.descriptions, 1) if text]
        alpha = [kind is ColorInterp.alpha for kind in file.colorinterp]
        if alpha.count(False) > 1:
            raise RequestError(
                f"{name}: has {file.count} bands{': ' if named else ''}"
                f"{', '.join(named[:_MOST_NAMED])}.",
                "Choose one with --band.",
            )
        band = alpha.index(False) + 1
    band = 1 if band is None else band
    refuse_band(name, file.dtypes, band, missing=RequestError)
    return PixelBands((band,))


# --- heights -------------------------------------------------------------------------------------


def scale_of(
    name: str, file: Any, bands: PixelBands, options: SourceOptions, about: list[str]
) -> NumberScale:
    """Scale of the numbers of a raster: that of --height-range, or else its own.

    Args:
        name: name of the raster, for messages.
        file: the raster.
        bands: its bands with the heights.
        options: options about the source.
        about: list that gets a note where the heights are counts for all that the file says.
    """
    band = bands.numbers[0]
    if bands.encoding is not None:
        return UNSCALED
    if options.height_range is not None:
        low, high = options.height_range
        least, most = _range(name, file, bands, options.nodata)
        factor = (high - low) / (most - least) if most > least else 0.0
        return NumberScale(factor, low - factor * least)
    found = NumberScale(file.scales[band - 1], file.offsets[band - 1])
    says = unit_text(file.units[band - 1]) or options.source_units or found != UNSCALED
    if not says and (not is_placed(file) or file.driver in _PICTURES):
        whole = np.dtype(file.dtypes[band - 1]).kind in "iu"
        about.append(
            f"Heights are the raw {'counts' if whole else 'numbers'} of the file: --height-range "
            "LOW HIGH makes others of them."
        )
    return found


def _range(name: str, file: Any, bands: PixelBands, nodata: float | None) -> tuple[float, float]:
    """Numbers that become the ends of --height-range.

    They are the least and the greatest that a pixel of 8 or 16 bits can hold, and those that
    the whole raster has where pixels are wider or floats.
    """
    (band,) = bands.numbers
    kind = np.dtype(file.dtypes[band - 1])
    if kind.kind in "iu" and kind.itemsize <= _WHOLE_RANGE:
        if file.driver == "PNM" and (white := _white(file.name)):
            return 0.0, white
        bits = file.tags(band, ns="IMAGE_STRUCTURE").get("NBITS", "")
        if kind.kind == "u" and bits.isdecimal():
            return 0.0, 2.0 ** int(bits) - 1.0
        return float(np.iinfo(kind).min), float(np.iinfo(kind).max)
    low, high = math.inf, -math.inf
    step = max(1, _STRIP // file.width)
    for row in range(0, file.height, step):
        window = Window(0, row, file.width, min(step, file.height - row))
        part = sample_range(bands.read(name, file, window, nodata))
        low, high = min(low, part.low), max(high, part.high)
    return low, high


def _white(name: str) -> float | None:
    """Number of white in a file of PNM, which stands behind its sides; None if it is not found."""
    try:
        with open_file(name) as file:
            words = re.sub(rb"#[^\n]*", b"", file.read(_HEAD)).split(maxsplit=4)
    except OSError:  # in an archive
        return None
    return float(words[3]) if len(words) > 3 and words[3].isdigit() else None


def height_unit(name: str, file: Any, bands: PixelBands, crs: CRS | None, said: str | None) -> str:
    """Unit of heights: what the band, the encoding or a vertical system says, or else the user.

    Args:
        name: name of the raster, for messages.
        file: the raster.
        bands: its bands with the heights.
        crs: its reference system.
        said: symbol of the unit that the user states; None for none.

    Returns:
        Symbol of the unit, or its text in the file if that is unknown; "" for none.

    Raises:
        RequestError: the user states another unit than the file.
    """
    stated = unit_text(file.units[bands.numbers[0] - 1])
    if bands.encoding is not None:
        stated = METRE.symbol
    elif not stated and crs is not None:
        stated = unit_text(vertical_unit(crs))
    if said is None:
        return stated
    known = length_named(stated)
    if known is not None and known.symbol != said:
        raise RequestError(
            f"{name}: says that its heights are in {known.plural}.", "Leave out --source-units."
        )
    return said


# --- x and y -------------------------------------------------------------------------------------


def system_of(name: str, file: Any, said: CrsValue | CRS | None) -> CRS | None:
    """Reference system of a raster, or else the one that the user names; None for none.

    Raises:
        RequestError: the raster has another one, or the name is none.
    """
    own: CRS | None = file.crs or None
    if said is None:
        return own
    named = read_crs(said)
    if own is not None and (own.is_geographic or own.is_projected) and own != named:
        text = f"{own.to_epsg()}" if own.to_epsg() else ""
        raise RequestError(
            f"{name}: has a reference system of its own{f', EPSG:{text}' if text else ''}, which "
            f"is not {'that one' if isinstance(said, CRS) else shown_crs(said)}.",
            "Leave out --source-crs; --crs reprojects.",
        )
    return named


def side_unit(crs: CRS) -> LengthUnit:
    """Unit of x and y of a projection."""
    name, metres = crs.linear_units_factor
    return length_of(metres, name)


def is_metric(crs: CRS | None) -> bool:
    """Whether x and y are metres, as far as it is known."""
    return crs is not None and crs.is_projected and side_unit(crs) == METRE


def unit_notes(crs: CRS | None, unit: str, middle: tuple[float, float]) -> list[str]:
    """Sentences on units that do not go with each other, and on degrees.

    Args:
        crs: reference system of x and y.
        unit: unit of the heights; "" where it is not known.
        middle: x and y of the middle.
    """
    known = length_named(unit)
    heights = known.plural if known else unit
    if crs is not None and crs.is_geographic:
        found = metric_crs(crs.to_wkt(), *middle)
        other = "" if found == LOCAL else f", or --crs {LOCAL},"
        return [
            f"x and y are degrees, so that no slope is right: add --crs {found}{other} to "
            "reproject."
        ]
    sides = side_unit(crs) if crs is not None and crs.is_projected else None
    if sides is None or sides == METRE:
        if unit in ("", METRE.symbol):
            return []
        first = "Heights are in" if sides is None else "x and y are in metres, heights in"
        return [f"{first} {heights}{_CONVERTED if known else _KEPT}"]
    if not unit:
        first = f"x and y are in {sides.plural}, and stay so; --units m makes metres of them."
        return [first, UNKNOWN_UNIT]
    if known == sides:
        return [f"x, y and heights are in {heights}{_CONVERTED}"]
    return [f"x and y are in {sides.plural}, heights in {heights}{_CONVERTED if known else _KEPT}"]


_CONVERTED = ": --units m makes metres of them, for which other commands take them."
_KEPT = "; they are kept as they are."


class InMetres(NamedTuple):
    """A place and a scale in metres.

    Attributes:
        factor: factor on x and y.
        crs: reference system of these.
        unit: unit of the heights.
        scale: scale of the heights.
    """

    factor: float
    crs: CRS | None
    unit: str
    scale: NumberScale


def in_metres(name: str, crs: CRS | None, unit: str, scale: NumberScale) -> InMetres:
    """Make metres of heights, and of x and y of a projection in another unit.

    Args:
        name: name of the raster, for messages.
        crs: reference system of x and y; degrees, and places without one, stay as they are.
        unit: unit of the heights.
        scale: scale of the heights.

    Raises:
        RequestError: the unit of the heights is not known.
    """
    known = length_named(unit)
    if known is None:
        what = f"{unit!r}, which is no known unit" if unit else "not known"
        raise RequestError(
            f"{name}: the unit of its heights is {what}, so that they cannot be made metres.",
            "Say it with --source-units, as ft, us-ft, cm or m.",
        )
    factor = 1.0
    if crs is not None and crs.is_projected and (sides := side_unit(crs)) != METRE:
        factor, crs = sides.metres, crs_in_metres(crs)
    elif crs is not None and unit_text(vertical_unit(crs)) not in ("", METRE.symbol):
        crs = horizontal_crs(crs)
    if known != METRE:
        scale = scale.times(known.metres)
    return InMetres(factor, crs, METRE.symbol, scale)
