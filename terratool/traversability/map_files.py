"""The files of a traversability map: GeoTIFFs, their bands, and the names of their classes."""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands, BandStatistics
from terratool.io.gdal_copy import cog_options, gdal_copy
from terratool.io.geotiff import TILE, Compression, GeoTiff, tile_options
from terratool.io.pam import COMPANIONS, name_categories, pam_bands, pam_path, xml_bytes
from terratool.output import refuse_existing, whole_file
from terratool.raster.export import refuse_full_disk
from terratool.raster.formats import raster_format
from terratool.raster.geotiff import RasterExtent, crs_of, terrain_tiff
from terratool.raster.grid import Grid, Window
from terratool.raster.statistics import band_statistics
from terratool.traversability.route.reach import bits_type
from terratool.traversability.tiles import part_of
from terratool.traversability.verdicts import COLORS, GroundClass, Reason, Verdict

CLASS = "class"
DRIVABLE = "headings that are go or caution, bit by bit"
"""Name of the band whose bit i, the lowest is 0, is heading i, clockwise from north."""

VERDICT = Bands(("verdict, best heading",), ("",), np.dtype(np.uint8), CLASS)
WORST = Bands(("verdict, worst heading",), ("",), np.dtype(np.uint8), CLASS)
"""Band of `GroundClass`, with the verdict of the worst heading where `VERDICT` has a verdict."""
CLASSES = Bands(
    ("verdict, worst heading", "reason, best heading", "reason, worst heading"),
    ("",) * 3, np.dtype(np.uint8), CLASS,
)  # fmt: skip
_NUMBERS = {
    "headings that are go or caution": "",
    "utilisation, best heading": "1",
    "utilisation, worst heading": "1",
    "slope along, best heading": "degree",
    "slope across, best heading": "degree",
    "slope along, worst heading": "degree",
    "slope across, worst heading": "degree",
    "step, highest": "m",
    "roughness, largest": "m",
    "clearance, least": "m",
    "room under overhangs, least": "m",
    "sinkage, deepest": "m",
    "drawbar pull left, least": "N",
    "tip-over margin, least": "degree",
    "headings that are go": "",
    "drift angle, best heading": "degree",
    "drift angle, worst heading": "degree",
}
NUMBERS = Bands(tuple(_NUMBERS), tuple(_NUMBERS.values()), np.dtype(np.float32))
"""Slopes are positive nose up and left side up."""
HEADROOM = "headroom, least"
FOOTHOLD, CHANCE = "foothold margin", "probability of go, best heading"
"""Bands that follow `NUMBERS`: on terrains with storeys, of vehicles on feet, and where figures of
soils are ranges."""

_SUFFIXES = ("", "-worst", "-headings", "-classes", "-numbers")
"""Endings of the stems of a map's files, in the order of `_files`."""


def _files(further: Sequence[str], headings: int) -> tuple[Bands, ...]:
    """Bands of each file of a map, with the names of what follows `NUMBERS`."""
    mask = Bands((DRIVABLE,), ("",), bits_type(headings), "bits", 0.0, ("",))
    return VERDICT, WORST, mask, CLASSES, _numbers(further)


def _numbers(further: Sequence[str]) -> Bands:
    """`NUMBERS`, and what follows them."""
    units = (*NUMBERS.units, *("m" if name == HEADROOM else "1" for name in further))
    return Bands((*NUMBERS.names, *further), units, NUMBERS.dtype)


def further_bands(*, walks: bool, sampled: bool, roofed: bool = False) -> tuple[str, ...]:
    """Names of bands that follow `NUMBERS`.

    Args:
        walks: whether the vehicle walks.
        sampled: whether soils are sampled.
        roofed: whether the terrain has storeys.
    """
    return (HEADROOM,) * roofed + (FOOTHOLD,) * walks + (CHANCE,) * sampled


class MapBands(NamedTuple):
    """A window of a map, (bands, height, width) each.

    Attributes:
        verdict: uint8 `Verdict`, from which `VERDICT` follows once connected ground is known.
        classes: uint8 bands of `CLASSES`.
        numbers: float32 bands of `NUMBERS` and what follows them; NaN where a number is unknown or
            infinite.
    """

    verdict: NDArray[Any]
    classes: NDArray[Any]
    numbers: NDArray[Any]


def empty_bands(flat: tuple[int, int], further: Sequence[str]) -> MapBands:
    """Uninitialised bands of a (height, width) window, with those that follow `NUMBERS`."""
    files = VERDICT, CLASSES, _numbers(further)
    return MapBands(*(np.empty((file.count, *flat), file.dtype) for file in files))


def map_paths(path: str | Path) -> list[Path]:
    """Paths of a map's files: best headings, worst headings, bits of headings, classes, numbers."""
    path = Path(path)
    return [path.with_name(f"{path.stem}{suffix}{path.suffix}") for suffix in _SUFFIXES]


def storey_paths(path: str | Path, sheets: int) -> list[Path]:
    """Paths of the maps of a terrain: that of the lowest tops, and one of each sheet of storeys."""
    path = Path(path)
    further = (f"{path.stem}.storey-{number}{path.suffix}" for number in range(1, sheets))
    return [path, *map(path.with_name, further)]


class MapExtent(NamedTuple):
    """Pixels of a map, the bands that follow `NUMBERS`, and the number of headings."""

    grid: Grid
    further: Sequence[str]
    headings: int


class MapFiles:
    """The files of a map while they are written.

    Args:
        stack: exit stack at whose end, unless it fails, the files take their places.
        terrain: the ground.
        surveyed: pixels of the map, and what is known of them.
        path: path of the verdicts, a .tif.
        overwrite: whether the files may exist already.
        threads: number of threads that compress.

    Raises:
        RequestError: the file is no .tif.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """

    def __init__(
        self, stack: contextlib.ExitStack, terrain: Terrain, surveyed: MapExtent, path: Path,
        overwrite: bool, threads: int,
    ) -> None:  # fmt: skip
        refuse_map(terrain, surveyed, path, overwrite)
        self._grid, extent = surveyed.grid, RasterExtent(terrain, surveyed.grid)
        files = _files(surveyed.further, surveyed.headings)
        parts = [
            stack.enter_context(whole_file(name, overwrite, COMPANIONS, named=name == path))
            for name in map_paths(path)
        ]
        self._files = [
            stack.enter_context(_cog(part, extent, bands, threads))
            for part, bands in zip(parts, files, strict=True)
        ]
        self._statistics = [BandStatistics()] * files[-1].count

    def write(self, window: Window, bands: MapBands) -> None:
        """Write the classes and numbers of a window; windows come in order, row by row."""
        for file, pixels in zip(self._files[-2:], bands[1:], strict=True):
            file.write(pixels, window.row, window.column)
        found = map(band_statistics, bands.numbers)
        self._statistics = list(map(operator.add, self._statistics, found))

    def finish(self, *planes: NDArray[Any]) -> None:
        """Write classes by the best heading, by the worst, and the bits of headings."""
        for window in self._grid.windows(TILE, TILE):
            for file, plane in zip(self._files, planes, strict=False):
                file.write(plane[None, *part_of(window)], window.row, window.column)
        self._files[-1].finish(self._statistics)


def refuse_map(terrain: Terrain, surveyed: MapExtent, path: Path, overwrite: bool) -> None:
    """Refuse a map that cannot be written.

    Raises:
        RequestError: the file is no .tif.
        WriteError: a file exists, cannot be written or does not fit on the disk.
        DefinitionError: the CRS of the terrain is unknown.
    """
    if raster_format(path).driver != "GTiff":
        raise RequestError(f"{path.name}: a map is a GeoTIFF.", "Give a name that ends in .tif.")
    for name in map_paths(path):
        refuse_existing(name, overwrite, COMPANIONS)
    crs_of(terrain)
    files = _files(surveyed.further, surveyed.headings)
    refuse_full_disk(path, surveyed.grid, files, raster_format(path, cog=True))


def refuse_full_disk_of_maps(maps: Sequence[MapExtent], path: Path) -> None:
    """Refuse maps that do not all fit on the disk together; `path` is in their folder.

    Raises:
        WriteError: the maps do not fit.
    """
    largest = max((one.grid for one in maps), key=lambda grid: grid.width * grid.height)
    files = [file for one in maps for file in _files(one.further, one.headings)]
    refuse_full_disk(path, largest, files, raster_format(path, cog=True))


@contextlib.contextmanager
def _cog(path: Path, extent: RasterExtent, bands: Bands, threads: int) -> Iterator[GeoTiff]:
    """Open a cloud-optimised GeoTIFF for writing: a plain one that is copied when complete."""
    first, plain = path.with_name(f"{path.stem}.first.tif"), Compression()
    with terrain_tiff(first, extent, bands, tile_options(bands.dtype, plain, threads)) as file:
        if bands in (VERDICT, WORST):
            file.color({int(key): (*c, 255) for key, c in COLORS.items()})
        yield file
    names = pam_path(first)
    if bands.content == CLASS:
        names.write_bytes(_class_names(bands))
    gdal_copy(first, path, "COG", cog_options(bands, plain), threads)
    first.unlink()
    names.unlink(missing_ok=True)


def _class_names(bands: Bands) -> bytes:
    """The text of an .aux.xml file that names the classes of each band."""
    root, elements = pam_bands(bands.count)
    for band, name in zip(elements, bands.names, strict=True):
        classes: type[GroundClass | Verdict | Reason] = GroundClass if bands.count == 1 else Verdict
        if name.startswith("reason"):
            classes = Reason
        name_categories(band, [value.label for value in classes])
    return xml_bytes(root)
