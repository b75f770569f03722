"""GeoTIFFs written window by window, and what GDAL is told of their surfaces."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio._err import CPLE_BaseError
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.errors import CRSError, RasterioError
from rasterio.transform import Affine
from rasterio.windows import Window as RasterioWindow

from terratool._version import __version__
from terratool.definition.crs import FORMS, CrsValue, authority_code, crs_problem, is_known
from terratool.errors import DefinitionError, RequestError, WriteError, interruption
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import LAYERS, Bands, SurfaceValues
from terratool.raster.prefetch import TILE
from terratool.raster.statistics import BandStatistics
from terratool.report.inert import xml_text
from terratool.text.display import shown

# GDAL's numbers for the types and uses of the columns of an attribute table
_INTEGER, _REAL, _STRING = 0, 1, 2
_GENERIC, _PIXEL_COUNT, _NAME, _MIN_MAX, _RED, _GREEN, _BLUE = 0, 1, 2, 5, 6, 7, 8

MOST_COLORS = 65536
"""Colours that the colour table of a file holds."""

COMPRESSIONS = ("zstd", "deflate", "lzw", "lerc", "none")

CACHE_BYTES = 1 << 26
"""GDAL would take a twentieth of the machine's memory for tiles that are complete anyway."""


def colormap(terrain: Terrain) -> dict[int, tuple[int, int, int, int]]:
    """Colours by id; no surface is transparent."""
    colors = SurfaceValues(terrain).colors.tolist()
    return {id_: (*color, 255 if id_ else 0) for id_, color in enumerate(colors)}


def name_categories(band: ElementTree.Element, names: Sequence[str]) -> None:
    """Put the names of the values 0, 1, … into the element of a band."""
    categories = ElementTree.SubElement(band, "CategoryNames")
    for name in names:
        ElementTree.SubElement(categories, "Category").text = name


def describe_surfaces(
    band: ElementTree.Element, terrain: Terrain, counts: NDArray[np.int64]
) -> None:
    """Put category names and an attribute table of the surfaces into the element of a band.

    `counts` are (surfaces + 1,) pixels of each id.
    """
    names = ["none", *map(xml_text, terrain.surfaces)]
    name_categories(band, names)
    soils = SurfaceValues(terrain)
    columns: list[tuple[str, int, int, list[object]]] = [
        ("Value", _INTEGER, _MIN_MAX, list(range(len(names)))),
        ("Class", _STRING, _NAME, list(names)),
        ("Count", _INTEGER, _PIXEL_COUNT, counts.tolist()),
    ]
    for title, use, shades in zip(
        ("Red", "Green", "Blue"), (_RED, _GREEN, _BLUE), soils.colors.T, strict=True
    ):
        columns.append((title, _INTEGER, use, shades.tolist()))
    for layer in LAYERS.values():
        if layer.soil and layer.content == "number":
            values = soils.values(layer, np.dtype(np.float64)).tolist()
            columns.append((layer.title, _REAL, _GENERIC, values))
    table = ElementTree.SubElement(band, "GDALRasterAttributeTable", tableType="thematic")
    for index, (title, type_, use, _) in enumerate(columns):
        column = ElementTree.SubElement(table, "FieldDefn", index=str(index))
        for key, value in (("Name", title), ("Type", str(type_)), ("Usage", str(use))):
            ElementTree.SubElement(column, key).text = value
    for index, cells in enumerate(zip(*(column[3] for column in columns), strict=True)):
        row = ElementTree.SubElement(table, "Row", index=str(index))
        for cell in cells:
            ElementTree.SubElement(row, "F").text = (
                "" if isinstance(cell, float) and math.isnan(cell) else str(cell)
            )


@dataclass(frozen=True, slots=True)
class Compression:
    """How a GeoTIFF is compressed.

    Attributes:
        name: one of COMPRESSIONS.
        max_z_error: how far LERC may be off, in units of the values; 0 for not at all.
    """

    name: str = "zstd"
    max_z_error: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in COMPRESSIONS:
            raise RequestError(
                f"There is no compression {self.name!r}.",
                f"The compressions are {', '.join(COMPRESSIONS)}.",
            )
        if not (math.isfinite(self.max_z_error) and self.max_z_error >= 0):
            raise RequestError(
                f"The largest error is {self.max_z_error:g}.", "Give a finite number from 0 on."
            )
        if self.max_z_error and self.name != "lerc":
            raise RequestError(
                f"Compression by {self.name} makes no error.",
                'Leave out --max-z-error, or add "--compress lerc".',
            )

    def options(self, bands: Bands) -> dict[str, Any]:
        """What GDAL is told for a file."""
        real = bands.dtype.kind == "f"
        if self.name == "none":
            return {}
        if self.name == "lerc":
            if real:
                return {"compress": "lerc_zstd", "zstd_level": 1, "max_z_error": self.max_z_error}
            return {"compress": "zstd", "zstd_level": 1}  # ids and colours bear no error
        level = {"zstd": {"zstd_level": 1}, "deflate": {"zlevel": 1}, "lzw": {}}[self.name]
        # neighbouring ids and colours are equal more often than they are near
        return {"compress": self.name, **level, **({"predictor": 3} if real else {})}


@dataclass(frozen=True, slots=True)
class RasterExtent:
    """The pixels of a file.

    Attributes:
        terrain: the terrain.
        grid: the grid over it.
        window: the part of the grid that the file holds; all of it if None.
    """

    terrain: Terrain
    grid: Grid
    window: Window | None = None

    @property
    def pixels(self) -> Window:
        """The window of the grid that the file holds."""
        return self.window or self.grid.whole


@contextlib.contextmanager
def geotiff(
    path: Path,
    extent: RasterExtent,
    bands: Bands,
    compression: Compression,
    threads: int,
    nodata: float | None = None,
    colors: int = MOST_COLORS,
) -> Iterator[GeoTiff]:
    """A tiled GeoTIFF; complete when the block has ended.

    Args:
        path: the file.
        extent: its pixels.
        bands: what it holds.
        compression: how it is compressed.
        threads: that compress it; 0 for the calling one.
        nodata: the pixel that stands for nothing; that of the bands, if not said.
        colors: surfaces get a colour table if they are fewer.

    Raises:
        WriteError: GDAL cannot write it.
    """
    terrain, window = extent.terrain, extent.pixels
    profile: dict[str, Any] = {
        "driver": "GTiff", "dtype": bands.dtype.name, "count": bands.count,
        "nodata": bands.nodata if nodata is None else nodata,
        "width": window.width, "height": window.height, "crs": crs_of(terrain),
        "transform": transform_of(extent.grid, window),
        **tiff_options(bands, compression, threads),
    }  # fmt: skip
    if bands.content == "color":
        profile |= {"photometric": "rgb", "interleave": "pixel"}
    elif bands.count > 1 and bands.dtype == np.uint8:
        profile["photometric"] = "minisblack"  # three bands of bytes are not red, green and blue
    with (
        complaints(path),
        rasterio.Env(GDAL_CACHEMAX=CACHE_BYTES),
        rasterio.open(path, "w", **profile) as file,
    ):
        file.descriptions = bands.names
        file.units = bands.units
        tags = {"TIFFTAG_SOFTWARE": f"terratool {__version__}"}
        if terrain.descr:
            tags["TIFFTAG_IMAGEDESCRIPTION"] = xml_text(terrain.descr)
        file.update_tags(**tags)
        if bands.content == "surface":
            if len(terrain.surfaces) < colors:
                file.write_colormap(1, colormap(terrain))
        elif bands.content == "number":
            file.colorinterp = [ColorInterp.gray] + [ColorInterp.undefined] * (bands.count - 1)
        yield GeoTiff(file, window)
    check_blocks(path)


def tiff_options(bands: Bands, compression: Compression, threads: int) -> dict[str, Any]:
    """How the pixels of a GeoTIFF lie in its file."""
    return {
        **compression.options(bands), "tiled": True, "blockxsize": TILE, "blockysize": TILE,
        "interleave": "band", "bigtiff": "if_safer", "num_threads": str(max(1, threads)),
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class GeoTiff:
    """A GeoTIFF that is being written.

    Attributes:
        file: rasterio's.
        extent: the window of the grid that it holds.
    """

    file: Any
    extent: Window

    def write(self, window: Window, pixels: NDArray[Any]) -> None:
        """Write the bands of a window of the grid, (bands, height, width)."""
        column, row = window.column - self.extent.column, window.row - self.extent.row
        self.file.write(pixels, window=RasterioWindow(column, row, window.width, window.height))

    def finish(self, statistics: Sequence[BandStatistics]) -> None:
        """Write what is known of the bands when all windows are."""
        pixels = self.file.width * self.file.height
        for band, part in enumerate(statistics, 1):
            if part.count:
                self.file.update_tags(band, **statistics_tags(part, pixels))


def statistics_tags(statistics: BandStatistics, pixels: int) -> dict[str, str]:
    """Statistics as GDAL keeps them with a band."""
    return {
        "STATISTICS_MINIMUM": repr(statistics.low),
        "STATISTICS_MAXIMUM": repr(statistics.high),
        "STATISTICS_MEAN": repr(statistics.mean),
        "STATISTICS_STDDEV": repr(statistics.deviation),
        "STATISTICS_VALID_PERCENT": f"{100 * statistics.count / pixels:.4g}",
    }


def name_surfaces(path: Path, terrain: Terrain, counts: NDArray[np.int64]) -> None:
    """Write the names, colours and soils of the surfaces into the .aux.xml of a raster of ids."""
    root = ElementTree.Element("PAMDataset")
    describe_surfaces(ElementTree.SubElement(root, "PAMRasterBand", band="1"), terrain, counts)
    path.with_name(path.name + ".aux.xml").write_bytes(xml_bytes(root))


def xml_bytes(root: ElementTree.Element) -> bytes:
    """The indented text of a document."""
    ElementTree.indent(root)
    return f"{ElementTree.tostring(root, encoding='unicode')}\n".encode()


def check_blocks(path: Path) -> None:
    """Make sure that all blocks of a GeoTIFF are in it: GDAL keeps errors at closing to itself.

    Raises:
        WriteError: it is not complete.
    """
    size = path.stat().st_size
    with complaints(path), rasterio.open(path) as file:
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


def cog_options(bands: Bands, compression: Compression, own: bool = False) -> dict[str, Any]:
    """What the driver of cloud-optimised GeoTIFFs is told for a file.

    With `own` it takes the overviews that are there.
    """
    plain = compression.options(bands)
    average = set(bands.means) == {"number"}
    options: dict[str, Any] = {
        "compress": plain.get("compress", "none"),
        "blocksize": TILE,
        "bigtiff": "if_safer",
        **({"overviews": "force_use_existing"} if own else {}),
        "overview_resampling": "average" if average else "nearest",
    }
    if "zstd_level" in plain or "zlevel" in plain:
        options["level"] = 1
    if "predictor" in plain:
        options["predictor"] = "floating_point"
    if "max_z_error" in plain:
        options["max_z_error"] = plain["max_z_error"]
    return options


@contextlib.contextmanager
def complaints(
    path: Path, hint: str = "Check the folder, its permissions and the space on the disk."
) -> Iterator[None]:
    """Turn GDAL's errors into sentences.

    Raises:
        WriteError: instead of any of them.
    """
    try:
        yield
    except (RasterioError, CPLE_BaseError, SystemError, ValueError) as error:
        stopped = interruption(error)
        if stopped is not None:
            raise stopped from None
        # without the folder of the unfinished file
        reason = str(error.__cause__ or error).rstrip(".").replace(f"{path.parent}/", "")
        if isinstance(error, SystemError):
            reason = "GDAL does not say why"
        raise WriteError(f"{path.name}: cannot be written ({reason}).", hint) from error


def transform_of(grid: Grid, window: Window | None = None) -> Affine:
    """From columns and rows of a window, or the whole, of a grid to the world."""
    west, _, _, north = grid.bounds
    size = grid.resolution
    if window is not None:
        west, north = west + window.column * size, north - window.row * size
    return Affine(size, 0.0, west, 0.0, -size, north)


def crs_of(terrain: Terrain) -> CRS | None:
    """The coordinate reference system of a terrain.

    Raises:
        DefinitionError: it is none that is taken, or the library does not know it.
    """
    if terrain.crs is None:
        return None
    try:
        return read_crs(terrain.crs)
    except RequestError as error:
        raise DefinitionError(
            f'The "crs" of the definition, {shown_crs(terrain.crs)}, is unknown.', error.hint
        ) from error


def read_crs(crs: CrsValue) -> CRS:
    """A coordinate reference system; nothing that it says makes PROJ or GDAL open a file.

    Raises:
        RequestError: it is none that is taken, or the library does not know it.
    """
    problem = crs_problem(crs)
    if problem is not None:
        raise RequestError(f"{shown_crs(crs)} names no reference system.", problem.hint)
    entry = authority_code(crs)
    try:
        with rasterio.Env():  # GDAL's own complaint goes to its log rather than to the terminal
            if entry is None:
                return CRS.from_user_input(crs)
            # what is not in the database is not tried as the name of a file
            if is_known(entry) is False:
                raise CRSError("not in the database")
            return CRS.from_user_input(f"{entry.authority}:{entry.code}")
    except CRSError as error:
        raise RequestError(f"{shown_crs(crs)} names no reference system.", FORMS) from error


def shown_crs(crs: CrsValue) -> str:
    """A reference system as a message shows it."""
    return shown(crs) if isinstance(crs, str | int) else "an object"
