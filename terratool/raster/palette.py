"""What GIS programs are told of surfaces: colours, names and soils, as GDAL keeps them."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.layers import LAYERS, SurfaceValues

# GDAL's numbers for the types and uses of the columns of an attribute table
_INTEGER, _REAL, _STRING = 0, 1, 2
_GENERIC, _PIXEL_COUNT, _NAME, _MIN_MAX, _RED, _GREEN, _BLUE = 0, 1, 2, 5, 6, 7, 8

MOST_COLORS = 65536
"""Colours that the colour table of a file holds."""


_CONTROL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def xml_text(text: str) -> str:
    """A text without the control characters that JSON may hold and XML may not."""
    return _CONTROL.sub("\ufffd", text)


def colormap(terrain: Terrain) -> dict[int, tuple[int, int, int, int]]:
    """Colours by id; no surface is transparent."""
    colors = SurfaceValues(terrain).colors.tolist()
    return {id_: (*color, 255 if id_ else 0) for id_, color in enumerate(colors)}


def describe(
    band: ElementTree.Element, terrain: Terrain, counts: NDArray[np.int64] | None = None
) -> None:
    """Put category names and an attribute table of the surfaces into the element of a band.

    Args:
        band: a PAMRasterBand or VRTRasterBand.
        terrain: whose surfaces are meant.
        counts: (surfaces + 1,) pixels of each id, if known.
    """
    names = ["none", *map(xml_text, terrain.surfaces)]
    categories = ElementTree.SubElement(band, "CategoryNames")
    for name in names:
        ElementTree.SubElement(categories, "Category").text = name
    soils = SurfaceValues(terrain)
    columns: list[tuple[str, int, int, list[object]]] = [
        ("Value", _INTEGER, _MIN_MAX, list(range(len(names)))),
        ("Class", _STRING, _NAME, list(names)),
    ]
    if counts is not None:
        columns.append(("Count", _INTEGER, _PIXEL_COUNT, counts.tolist()))
    for title, use, shades in zip(
        ("Red", "Green", "Blue"), (_RED, _GREEN, _BLUE), soils.colors.T, strict=True
    ):
        columns.append((title, _INTEGER, use, shades.tolist()))
    for layer in LAYERS.values():
        if layer.soil and layer.kind == "number":
            values = soils.values(layer, np.dtype(np.float64)).tolist()
            title = f"{layer.bands[0]} ({layer.unit})" if layer.unit else layer.bands[0]
            columns.append((title, _REAL, _GENERIC, values))
    table = ElementTree.SubElement(band, "GDALRasterAttributeTable", tableType="thematic")
    for index, (title, kind, use, _) in enumerate(columns):
        column = ElementTree.SubElement(table, "FieldDefn", index=str(index))
        for key, value in (("Name", title), ("Type", str(kind)), ("Usage", str(use))):
            ElementTree.SubElement(column, key).text = value
    for index, cells in enumerate(zip(*(column[3] for column in columns), strict=True)):
        row = ElementTree.SubElement(table, "Row", index=str(index))
        for cell in cells:
            ElementTree.SubElement(row, "F").text = (
                "" if isinstance(cell, float) and math.isnan(cell) else str(cell)
            )


def auxiliary(terrain: Terrain, counts: NDArray[np.int64]) -> bytes:
    """The text of an .aux.xml file that names the surfaces of a raster's only band."""
    root = ElementTree.Element("PAMDataset")
    describe(ElementTree.SubElement(root, "PAMRasterBand", band="1"), terrain, counts)
    ElementTree.indent(root)
    return f"{ElementTree.tostring(root, encoding='unicode')}\n".encode()
