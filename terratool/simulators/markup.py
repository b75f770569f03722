"""XML as simulators read it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from terratool.mesh.formats.common import lines_of


def child(parent: ET.Element, tag: str, text: object = None, **attributes: object) -> ET.Element:
    """Add an element to another one, with text and attributes, and return it."""
    found = ET.SubElement(parent, tag, {key: str(value) for key, value in attributes.items()})
    if text is not None:
        found.text = str(text)
    return found


def comment(parent: ET.Element, text: str) -> None:
    """Add a comment to an element; no two `-` follow each other, as XML wants it."""
    parent.append(ET.Comment(f" {one_line(text).replace('--', '- -').replace('--', '- -')} "))


def one_line(text: str) -> str:
    """Return a text on one line, of characters that XML allows."""
    return " ".join(" ".join(lines_of(text)).split())


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them, each rounded to 1e-7."""
    return " ".join(f"{round(float(value), 7) + 0.0:.12g}" for value in values)


def rgba(color: tuple[int, int, int]) -> str:
    """Return an opaque colour as four numbers from 0 to 1."""
    return numbers([*(round(shade / 255, 4) for shade in color), 1.0])


def xml_text(root: ET.Element) -> str:
    """Return an element and its content as the text of an XML file, indented."""
    ET.indent(root)
    text = ET.tostring(root, "unicode", short_empty_elements=True)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'


def write_xml(root: ET.Element, path: Path) -> None:
    """Write an element and its content as an XML file, indented."""
    path.write_text(xml_text(root), "utf-8")
