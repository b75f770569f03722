"""Heights in pictures: grey ones in three channels, and terrain-RGB."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rasterio.enums import ColorInterp
from rasterio.windows import Window

from terratool.errors import ReadError, RequestError

EncodingName = Literal["terrarium", "mapbox"]

_CHANNELS = (ColorInterp.red, ColorInterp.green, ColorInterp.blue)
_COLORS = (*_CHANNELS, ColorInterp.palette)
_STRIP = 1 << 22
"""Pixels that are compared at a time."""


class Encoding(NamedTuple):
    """A way in which a picture has heights in metres, height = factor · Σ weight · value + offset.

    Attributes:
        weights: weights of red, green and blue.
        factor: factor on their sum.
        offset: height of a black pixel.
    """

    weights: tuple[float, float, float]
    factor: float
    offset: float

    def heights(self, pixels: NDArray[Any]) -> NDArray[np.float64]:
        """Heights of (3, rows, columns) values, masked or not, (rows, columns); NaN for none.

        A pixel has no height where all of its channels are masked: one alone may well be 0.
        """
        values = np.ma.getdata(pixels).astype(np.float64)
        found = np.tensordot(np.array(self.weights), values, 1) * self.factor + self.offset
        found[np.ma.getmaskarray(pixels).all(axis=0)] = np.nan
        return np.asarray(found)


ENCODINGS: dict[str, Encoding] = {
    "terrarium": Encoding((256.0, 1.0, 1 / 256), 1.0, -32768.0),
    "mapbox": Encoding((65536.0, 256.0, 1.0), 0.1, -10000.0),
}
"""Terrain-RGB by the names of those who publish it: tiles on AWS, and Mapbox."""


def is_picture(file: Any) -> bool:
    """Whether a raster that rasterio opened has colours."""
    return any(kind in _COLORS for kind in file.colorinterp)


def channels(name: str, file: Any) -> tuple[int, int, int]:
    """Numbers of the red, green and blue band of terrain-RGB, from 1.

    Raises:
        RequestError: there are no three bands of bytes.
    """
    kinds = tuple(file.colorinterp)
    if all(kind in kinds for kind in _CHANNELS):
        red, green, blue = (kinds.index(kind) + 1 for kind in _CHANNELS)
    else:
        red, green, blue = 1, 2, 3
    if file.count < 3 or any(file.dtypes[one - 1] != "uint8" for one in (red, green, blue)):
        raise RequestError(
            f"{name}: is no terrain-RGB, which has three channels of 8 bits.",
            "Leave out --encoding, or name a picture with red, green and blue.",
        )
    return red, green, blue


def grey_band(name: str, file: Any) -> int:
    """Number of the band to be read of a picture that is grey: red, green and blue are equal.

    Raises:
        ReadError: the picture has other colours, or a palette.
    """
    kinds = tuple(file.colorinterp)
    if all(kind in kinds for kind in _CHANNELS):
        bands = [kinds.index(kind) + 1 for kind in _CHANNELS]
        if _are_equal(file, bands):
            return bands[0]
    raise ReadError(
        f"{name}: is a picture ({', '.join(kind.name for kind in kinds)}), "
        "not a raster of heights.",
        "Make a grey picture of it, as with gdal_translate -expand gray."
        if ColorInterp.palette in kinds
        else "Name the band that holds heights with --band, or say how colours do with --encoding.",
    )


def _are_equal(file: Any, bands: list[int]) -> bool:
    """Whether bands have equal numbers wherever a pixel counts; read by strips."""
    step = max(1, _STRIP // file.width)
    for row in range(0, file.height, step):
        window = Window(0, row, file.width, min(step, file.height - row))
        first, *others = file.read(bands, window=window, masked=True)
        if any(bool(np.ma.any(first != other)) for other in others):
            return False
    return True
