"""XML as simulators read it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from terratool.mesh.formats.common import lines_of


def child(parent: ET.Element, tag: str, text: object = None, **attributes: object) -> ET.Element:
    """A new element in another one, with text and attributes."""
    found = ET.SubElement(parent, tag, {key: str(value) for key, value in attributes.items()})
    if text is not None:
        found.text = str(text)
    return found


def comment(parent: ET.Element, text: str) -> None:
    """A comment in an element; no two `-` follow each other, as XML wants it."""
    parent.append(ET.Comment(f" {one_line(text).replace('--', '- -').replace('--', '- -')} "))


def one_line(text: str) -> str:
    """A text on one line, of characters that XML allows."""
    return " ".join(" ".join(lines_of(text)).split())


def numbers(values: Iterable[float]) -> str:
    """Numbers with blanks between them, each to a tenth of a micrometre."""
    return " ".join(f"{round(float(value), 7) + 0.0:.12g}" for value in values)


def rgba(color: tuple[int, int, int]) -> str:
    """A colour without transparency, each channel from 0 to 1."""
    return numbers([*(round(shade / 255, 4) for shade in color), 1.0])


def write_xml(root: ET.Element, path: Path) -> None:
    """Write an element and all that is in it, indented."""
    ET.indent(root)
    text = ET.tostring(root, "unicode", short_empty_elements=True)
    path.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n', "utf-8")
