"""Files that GDAL keeps beside a raster: names of its values, as XML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

COMPANIONS = ("*.aux.xml", "*.ovr", "*.msk")
"""Files that GDAL keeps beside a raster, and would believe of a newer one, too; * is its name."""


def name_categories(band: ElementTree.Element, names: Sequence[str]) -> None:
    """Put the names of the values 0, 1, … into the element of a band."""
    categories = ElementTree.SubElement(band, "CategoryNames")
    for name in names:
        ElementTree.SubElement(categories, "Category").text = name


def pam_bands(count: int) -> tuple[ElementTree.Element, list[ElementTree.Element]]:
    """A document of an .aux.xml file, and its elements of bands, still empty."""
    root = ElementTree.Element("PAMDataset")
    return root, [
        ElementTree.SubElement(root, "PAMRasterBand", band=str(number + 1))
        for number in range(count)
    ]


def pam_path(path: Path) -> Path:
    """The .aux.xml file of a raster."""
    return path.with_name(f"{path.name}.aux.xml")


def xml_bytes(root: ElementTree.Element) -> bytes:
    """The indented text of a document."""
    ElementTree.indent(root)
    return f"{ElementTree.tostring(root, encoding='unicode')}\n".encode()
