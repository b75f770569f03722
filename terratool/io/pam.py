"""GDAL's .aux.xml files beside a raster (PAM): band elements and category names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

COMPANIONS = ("*.aux.xml", "*.ovr", "*.msk")
"""Suffixes of GDAL's sidecar files, which would apply to a new raster, too; * is its name."""


def name_categories(band: ElementTree.Element, names: Sequence[str]) -> None:
    """Add the category names of pixel values from 0 on to the element of a band."""
    categories = ElementTree.SubElement(band, "CategoryNames")
    for name in names:
        ElementTree.SubElement(categories, "Category").text = name


def pam_bands(count: int) -> tuple[ElementTree.Element, list[ElementTree.Element]]:
    """Root element of an .aux.xml file, and its empty band elements."""
    root = ElementTree.Element("PAMDataset")
    return root, [
        ElementTree.SubElement(root, "PAMRasterBand", band=str(number + 1))
        for number in range(count)
    ]


def pam_path(path: Path) -> Path:
    """Path of the .aux.xml file of a raster."""
    return path.with_name(f"{path.name}.aux.xml")


def xml_bytes(root: ElementTree.Element) -> bytes:
    """Indented UTF-8 text of an XML document."""
    ElementTree.indent(root)
    return f"{ElementTree.tostring(root, encoding='unicode')}\n".encode()
