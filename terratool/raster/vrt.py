"""The index of a mosaic: a virtual raster (.vrt) of GDAL that opens as one."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from terratool.field.terrain import Terrain
from terratool.raster.geotiff import (
    MOST_COLORS,
    colormap,
    crs_of,
    describe,
    statistics_tags,
    transform_of,
    xml_bytes,
)
from terratool.raster.layers import Bands
from terratool.raster.prefetch import TILE
from terratool.raster.statistics import RasterStatistics
from terratool.raster.tiles import MosaicPlan
from terratool.text.display import xml_text

_TYPES = {
    "uint8": "Byte", "uint16": "UInt16", "uint32": "UInt32",
    "float32": "Float32", "float64": "Float64",
}  # fmt: skip


def index_of(
    path: Path, plan: MosaicPlan, file: int, terrain: Terrain, statistics: RasterStatistics
) -> bytes:
    """The text of an index; it names the tiles relative to where it is.

    Args:
        path: where it will be.
        plan: the tiles.
        file: which file of each tile it is of.
        terrain: the terrain.
        statistics: of all pixels.
    """
    grid, bands = plan.grid, plan.files[file]
    root = Element("VRTDataset", rasterXSize=str(grid.width), rasterYSize=str(grid.height))
    crs = crs_of(terrain)
    if crs is not None:
        SubElement(root, "SRS").text = crs.to_wkt()
    SubElement(root, "GeoTransform").text = ", ".join(map(repr, transform_of(grid).to_gdal()))
    about = {"AREA_OR_POINT": "Area"}
    if terrain.descr:
        about["TIFFTAG_IMAGEDESCRIPTION"] = xml_text(terrain.descr)
    _metadata(root, about)
    if bands.kind == "color":
        _metadata(root, {"INTERLEAVE": "PIXEL"}, domain="IMAGE_STRUCTURE")
    for number in range(bands.count):
        band = _band(root, bands, number, terrain, statistics)
        own = statistics.statistics[file]
        if own and own[number].count and not plan.compression.max_z_error:
            # before all else: GDAL's schema of these files has an order
            band.insert(0, Element("Metadata"))
            _items(band[0], statistics_tags(own[number], grid.width * grid.height))
        _sources(band, path, plan, file, number + 1)
    return xml_bytes(root)


def _band(
    root: Element, bands: Bands, number: int, terrain: Terrain, statistics: RasterStatistics
) -> Element:
    band = SubElement(
        root, "VRTRasterBand", dataType=_TYPES[bands.dtype.name], band=str(number + 1),
        blockXSize=str(TILE), blockYSize=str(TILE),
    )  # fmt: skip
    SubElement(band, "Description").text = bands.names[number]
    if bands.units[number]:
        SubElement(band, "UnitType").text = bands.units[number]
    if bands.nodata is not None:
        nodata = "nan" if math.isnan(bands.nodata) else f"{bands.nodata:g}"
        SubElement(band, "NoDataValue").text = nodata
    interpretation = SubElement(band, "ColorInterp")
    interpretation.text = _interpretation(bands, number, terrain)
    if interpretation.text == "Palette":
        table = SubElement(band, "ColorTable")
        for color in colormap(terrain).values():
            SubElement(table, "Entry", {f"c{n}": str(c) for n, c in enumerate(color, 1)})
    if bands.kind == "surface":
        describe(band, terrain, statistics.counts)
    return band


def _interpretation(bands: Bands, number: int, terrain: Terrain) -> str:
    if bands.kind == "color":
        return ("Red", "Green", "Blue")[number]
    if bands.kind == "surface":
        return "Palette" if len(terrain.surfaces) < MOST_COLORS else "Gray"
    return "Gray" if number == 0 else "Undefined"


def _sources(band: Element, path: Path, plan: MosaicPlan, file: int, number: int) -> None:
    """Where each tile is from which the band reads."""
    folder = Path(os.path.relpath(plan.folder.resolve(), path.resolve().parent))
    for tile in plan.tiles():
        window = tile.window
        source = SubElement(band, "SimpleSource")
        name = (folder / plan.paths(tile)[file].name).as_posix()
        SubElement(source, "SourceFilename", relativeToVRT="1").text = name
        SubElement(source, "SourceBand").text = str(number)
        # so that a tile is opened when it is read and not before
        SubElement(
            source, "SourceProperties", RasterXSize=str(window.width),
            RasterYSize=str(window.height), DataType=band.attrib["dataType"],
            BlockXSize=str(TILE), BlockYSize=str(TILE),
        )  # fmt: skip
        _rectangle(source, "SrcRect", (0, 0, window.width, window.height))
        _rectangle(source, "DstRect", (window.column, window.row, window.width, window.height))


def _rectangle(source: Element, name: str, sides: Sequence[int]) -> None:
    keys = ("xOff", "yOff", "xSize", "ySize")
    SubElement(source, name, dict(zip(keys, map(str, sides), strict=True)))


def _metadata(parent: Element, values: dict[str, str], **attributes: str) -> None:
    _items(SubElement(parent, "Metadata", attributes), values)


def _items(metadata: Element, values: dict[str, str]) -> None:
    for key, value in values.items():
        SubElement(metadata, "MDI", key=key).text = value
