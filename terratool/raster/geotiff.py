"""GeoTIFFs of a terrain: georeference, colour table and attribute table of surfaces."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.transform import Affine

from terratool.errors import DefinitionError, RequestError
from terratool.field.terrain import Terrain
from terratool.io.bands import Bands
from terratool.io.crs import read_crs, shown_crs
from terratool.io.geotiff import GeoTiff, TiffProfile, geotiff, software_tags
from terratool.io.pam import name_categories, pam_bands, pam_path, xml_bytes
from terratool.raster.grid import Grid, Window
from terratool.raster.layers import LAYERS, SurfaceValues
from terratool.report.inert import xml_text

# GDAL's codes for types and usages of attribute table columns
_INTEGER, _REAL, _STRING = 0, 1, 2
_GENERIC, _PIXEL_COUNT, _NAME, _MIN_MAX, _RED, _GREEN, _BLUE = 0, 1, 2, 5, 6, 7, 8

MOST_COLORS = 65536
"""Most entries of a GeoTIFF's colour table."""


@dataclass(frozen=True, slots=True)
class RasterExtent:
    """Extent of a raster file.

    Attributes:
        terrain: terrain of the raster.
        grid: pixels over the terrain.
        window: window of the grid in the file; all of it if None.
    """

    terrain: Terrain
    grid: Grid
    window: Window | None = None

    @property
    def pixels(self) -> Window:
        """Window of the grid in the file."""
        return self.window or self.grid.whole


@contextlib.contextmanager
def terrain_tiff(
    path: Path,
    extent: RasterExtent,
    bands: Bands,
    options: Mapping[str, Any],
    nodata: float | None = None,
    colors: int = MOST_COLORS,
) -> Iterator[GeoTiff]:
    """Create a GeoTIFF with a terrain's georeference and description, to be filled in the block.

    Args:
        path: file to write.
        extent: terrain and pixels of the file.
        bands: bands of the file.
        options: GDAL creation options, as from `terratool.io.geotiff.tile_options`.
        nodata: nodata value; that of the bands if None.
        colors: number of surfaces below which they get a colour table.

    Raises:
        DefinitionError: the CRS of the terrain is unknown.
        WriteError: GDAL cannot write it.
    """
    terrain, window = extent.terrain, extent.pixels
    profile = TiffProfile(
        window.width, window.height, transform_of(extent.grid, window), crs_of(terrain),
        software_tags(terrain.descr), options, nodata,
    )  # fmt: skip
    with geotiff(path, bands, profile) as file:
        if bands.content == "surface" and len(terrain.surfaces) < colors:
            file.color(colormap(terrain))
        yield file


def colormap(terrain: Terrain) -> dict[int, tuple[int, int, int, int]]:
    """Red, green, blue and opacity by surface id; id 0, no surface, is transparent."""
    colors = SurfaceValues(terrain).colors.tolist()
    return {id_: (*color, 255 if id_ else 0) for id_, color in enumerate(colors)}


def describe_surfaces(
    band: ElementTree.Element, terrain: Terrain, counts: NDArray[np.int64]
) -> None:
    """Add category names and the attribute table of surfaces to the element of a band.

    Args:
        band: element of a band in a .vrt or .aux.xml.
        terrain: terrain with the surfaces.
        counts: (surfaces + 1,) pixels by surface id.
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


def name_surfaces(path: Path, terrain: Terrain, counts: NDArray[np.int64]) -> None:
    """Write names, colours and soils of the surfaces to the .aux.xml of a raster of surface ids."""
    root, (band,) = pam_bands(1)
    describe_surfaces(band, terrain, counts)
    pam_path(path).write_bytes(xml_bytes(root))


def transform_of(grid: Grid, window: Window | None = None) -> Affine:
    """Affine transform from column and row of a grid, or of a window of it, to world x and y."""
    west, _, _, north = grid.bounds
    size = grid.resolution
    if window is not None:
        west, north = west + window.column * size, north - window.row * size
    return Affine(size, 0.0, west, 0.0, -size, north)


def crs_of(terrain: Terrain) -> CRS | None:
    """Coordinate reference system of a terrain; None without one.

    Raises:
        DefinitionError: the form is not accepted, or PROJ does not know the system.
    """
    if terrain.crs is None:
        return None
    try:
        return read_crs(terrain.crs)
    except RequestError as error:
        raise DefinitionError(
            f'The "crs" of the definition, {shown_crs(terrain.crs)}, is unknown.', error.hint
        ) from error
