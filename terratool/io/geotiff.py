"""GeoTIFF writing: profile, compression, tags, and a check that the file is complete."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.transform import Affine
from rasterio.windows import Window

from terratool._version import __version__
from terratool.errors import RequestError, WriteError, interruption
from terratool.io.bands import Bands, BandStatistics
from terratool.report.inert import xml_text
from terratool.text.meaning import guess

TILE = 512
"""Side of a tile of a GeoTIFF, pixels."""

COMPRESSIONS = ("zstd", "deflate", "lzw", "lerc", "none")
"""Names of the compressions of a GeoTIFF."""

CACHE_BYTES = 1 << 26
"""Bytes of GDAL's block cache; its default is a twentieth of the memory, for finished tiles."""

Colors = Mapping[int, tuple[int, int, int, int]]
"""Colour table: red, green, blue and opacity, 0 to 255, by pixel value."""


@dataclass(frozen=True, slots=True)
class Compression:
    """Compression of a GeoTIFF.

    Attributes:
        name: one of COMPRESSIONS.
        max_z_error: largest error of LERC, in the unit of the band; 0 for lossless.
    """

    name: str = "zstd"
    max_z_error: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in COMPRESSIONS:
            raise RequestError(
                f"There is no compression {self.name!r}.",
                guess(self.name, COMPRESSIONS)
                or f"The compressions are {', '.join(COMPRESSIONS)}.",
            )
        if not (math.isfinite(self.max_z_error) and self.max_z_error >= 0):
            raise RequestError(
                f"The largest error is {self.max_z_error:g}.", "Give a finite number from 0 on."
            )
        if self.max_z_error and self.name != "lerc":
            raise RequestError(
                f"Compression by {self.name} makes no error.",
                'Leave out --max-error, or add "--compress lerc".',
            )

    def options(self, dtype: np.dtype[Any]) -> dict[str, Any]:
        """GDAL creation options for a file of a data type."""
        real = dtype.kind == "f"
        if self.name == "none":
            return {}
        if self.name == "lerc":
            if real:
                return {"compress": "lerc_zstd", "zstd_level": 1, "max_z_error": self.max_z_error}
            return {"compress": "zstd", "zstd_level": 1}  # ids and colours must be exact
        level = {"zstd": {"zstd_level": 1}, "deflate": {"zlevel": 1}, "lzw": {}}[self.name]
        # a predictor does not help ids and colours, often equal but rarely close
        return {"compress": self.name, **level, **({"predictor": 3} if real else {})}


def tile_options(
    dtype: np.dtype[Any], compression: Compression, threads: int = 1, size: tuple[int, int] = (0, 0)
) -> dict[str, Any]:
    """GDAL creation options for a tiled GeoTIFF.

    Args:
        dtype: data type of the bands.
        compression: compression of the tiles.
        threads: threads that compress tiles; 0 for the calling one.
        size: width and height of a tile, pixels, multiples of 16; TILE where 0.
    """
    width, height = size
    return {
        **compression.options(dtype), "tiled": True, "blockxsize": width or TILE,
        "blockysize": height or TILE, "interleave": "band", "bigtiff": "if_safer",
        "num_threads": str(max(1, threads)),
    }  # fmt: skip


def software_tags(descr: str = "", version: str = __version__) -> dict[str, str]:
    """TIFF tags of the software and, if not empty, the description of a file; no time."""
    described = {"TIFFTAG_IMAGEDESCRIPTION": xml_text(descr)} if descr else {}
    return {"TIFFTAG_SOFTWARE": f"terratool {version}", **described}


@dataclass(frozen=True, slots=True)
class TiffProfile:
    """Size, georeference, tags and creation options of a GeoTIFF.

    Attributes:
        width, height: columns and rows of pixels.
        transform: from column and row to world x and y; None without a georeference.
        crs: reference system of x and y; None without one.
        tags: texts by tag name of TIFF or GDAL.
        options: GDAL creation options, as from `tile_options`.
        nodata: nodata value; that of the bands if None.
    """

    width: int
    height: int
    transform: Affine | None = None
    crs: CRS | None = None
    tags: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    nodata: float | None = None


@contextlib.contextmanager
def geotiff(path: Path, bands: Bands, profile: TiffProfile) -> Iterator[GeoTiff]:
    """Create a GeoTIFF to be filled in the block; the file is checked at its end.

    Args:
        path: file to write, often a part of `terratool.output.whole_file`.
        bands: names, units and data type of the bands.
        profile: size, georeference, tags and options.

    Raises:
        WriteError: GDAL cannot write the file, or leaves it incomplete.
    """
    settings: dict[str, Any] = {
        "driver": "GTiff", "dtype": bands.dtype.name, "count": bands.count,
        "nodata": bands.nodata if profile.nodata is None else profile.nodata,
        "width": profile.width, "height": profile.height, "crs": profile.crs,
        "transform": profile.transform, **profile.options,
    }  # fmt: skip
    if bands.content == "color":
        settings |= {"photometric": "rgb", "interleave": "pixel"}
    elif bands.count > 1 and bands.dtype == np.uint8:
        # GDAL would take three bands of bytes for red, green and blue
        settings["photometric"] = "minisblack"
    placed = profile.transform is not None
    with contextlib.nullcontext() if placed else _no_place_warnings(), gdal_write_errors(path):
        with (
            rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES),
            rasterio.open(path, "w", **settings) as file,
        ):
            file.descriptions = bands.names
            file.units = bands.units
            file.update_tags(**profile.tags)
            if bands.content == "number":
                others = [ColorInterp.undefined] * (bands.count - 1)
                file.colorinterp = [ColorInterp.gray, *others]
            yield GeoTiff(file)
        check_blocks(path)


@contextlib.contextmanager
def _no_place_warnings() -> Iterator[None]:
    """Suppress rasterio's warning of a missing georeference; not safe with other threads."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        yield


@dataclass(frozen=True, slots=True)
class GeoTiff:
    """A GeoTIFF open for writing.

    Attributes:
        file: rasterio's dataset.
    """

    file: Any

    def write(self, pixels: NDArray[Any], row: int = 0, column: int = 0) -> None:
        """Write pixels, (bands, height, width), from the pixel at `row` and `column` on."""
        _, height, width = pixels.shape
        self.file.write(pixels, window=Window(column, row, width, height))

    def name(self, names: Sequence[str]) -> None:
        """Set the names of the bands."""
        self.file.descriptions = names

    def color(self, colors: Colors) -> None:
        """Set the colour table of the only band."""
        self.file.write_colormap(1, colors)

    def scale(self, scale: float, offset: float) -> None:
        """Set scale and offset of all bands: value = pixel · scale + offset."""
        self.file.scales = (scale,) * self.file.count
        self.file.offsets = (offset,) * self.file.count

    def finish(self, statistics: Sequence[BandStatistics]) -> None:
        """Write the statistics of the bands, after all pixels."""
        pixels = self.file.width * self.file.height
        for band, part in enumerate(statistics, 1):
            if part.count:
                self.file.update_tags(band, **statistics_tags(part, pixels))


def statistics_tags(statistics: BandStatistics, pixels: int) -> dict[str, str]:
    """GDAL's statistics tags of a band; `pixels` is the number of its pixels, valid or not."""
    return {
        "STATISTICS_MINIMUM": repr(statistics.low),
        "STATISTICS_MAXIMUM": repr(statistics.high),
        "STATISTICS_MEAN": repr(statistics.mean),
        "STATISTICS_STDDEV": repr(statistics.deviation),
        "STATISTICS_VALID_PERCENT": f"{100 * statistics.count / pixels:.4g}",
    }


def check_blocks(path: Path) -> None:
    """Check that all blocks of a GeoTIFF lie within the file: GDAL hides errors on closing.

    Raises:
        WriteError: a block is missing, or ends beyond the end of the file.
    """
    size = path.stat().st_size
    with gdal_write_errors(path), rasterio.open(path) as file:
        for band in file.indexes:
            for (row, column), _ in file.block_windows(band):
                begin, length = (
                    file.get_tag_item(f"BLOCK_{what}_{column}_{row}", "TIFF", bidx=band)
                    for what in ("OFFSET", "SIZE")
                )
                if begin is None or length is None or int(begin) + int(length) > size:
                    raise WriteError(
                        f"{path.name}: could not be written to its end.",
                        "Check the space on the disk.",
                    )


@contextlib.contextmanager
def gdal_write_errors(
    path: Path, hint: str = "Check the folder, its permissions and the space on the disk."
) -> Iterator[None]:
    """Turn errors of GDAL and rasterio in the block into a WriteError.

    Raises:
        WriteError: GDAL cannot write or read `path`.
    """
    try:
        yield
    except (RasterioError, CPLE_BaseError, SystemError, ValueError) as error:
        stopped = interruption(error)
        if stopped is not None:
            raise stopped from None
        # the unfinished file lies in a temporary folder
        reason = str(error.__cause__ or error).rstrip(".").replace(f"{path.parent}/", "")
        if isinstance(error, SystemError):
            reason = "GDAL does not say why"
        raise WriteError(f"{path.name}: cannot be written ({reason}).", hint) from error
