"""PLY point clouds, read and written, and the header of PLY meshes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.errors import DAMAGED, ReadError
from terratool.io.points import PointBatch, Wanted, check_names
from terratool.io.rows import Fields, RowLayout, header_line, read_rows, write_after
from terratool.text.display import quote
from terratool.text.files import open_file
from terratool.text.numbers import parse_whole

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_WORDS = {form: word for word, form in reversed(_TYPES.items())}
"""PLY type names by data type, the older ones that every reader knows."""
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}


def read_points(path: Path, wanted: Wanted) -> Iterator[PointBatch]:
    """Read the vertices of a PLY; its comments may hold the names of the column `NAMED`.

    Raises:
        ReadError: the file is no PLY, has elements before its vertices, or lists in these.
    """
    with open_file(path) as file:
        if file.readline(8).strip() != b"ply":
            raise ReadError(f"{path}: is no PLY.", "Check the file; a PLY begins with ply.")
        form, element, count = "", "", -1
        names: list[str] = []
        comments: list[str] = []
        fields: Fields = []
        while (words := (line := header_line(path, file)).split()) != ["end_header"]:
            match words:
                case ["format", form, *_]:
                    pass
                case ["comment", "surface", _, _, *_]:
                    names += _names_in(line.split(None, 3)[3])
                case ["comment", *rest]:
                    comments.append(" ".join(rest))
                case ["element", element, claimed]:
                    if element == "vertex" and not fields and count < 0:
                        found = parse_whole(claimed)
                        count = -1 if found is None else found
                    elif count < 0:
                        raise ReadError(
                            f"{path}: other elements stand before its vertices.",
                            "Write the vertices first.",
                        )
                case ["property", kind, name] if element == "vertex" and kind in _TYPES:
                    fields.append((name, _TYPES[kind], 1))
                case ["property", *_] if element == "vertex":
                    raise ReadError(
                        f"{path}: its vertices have a property {quote(' '.join(words[1:]))}.",
                        "A cloud has numbers alone.",
                    )
        order = _ORDERS.get(form)
        if order is None or count < 0:
            raise ReadError(f"{path}: its header says no format, or no vertices.", DAMAGED)
        checked, said = check_names(path, names), tuple(comments)
        for columns in read_rows(path, file, RowLayout(fields, count, order), wanted):
            yield PointBatch(columns, checked, said)


def _names_in(text: str) -> list[str]:
    """Name in a comment, as a JSON string; an empty list for other comments."""
    try:
        return [msgspec.json.decode(text, type=str)]
    except (msgspec.MsgspecError, UnicodeError):
        return []


def write_points(
    path: Path, batches: Iterable[NDArray[Any]], kind: np.dtype[Any], comments: Sequence[str]
) -> None:
    """Write a binary little-endian PLY with a vertex for each row of `kind`."""
    properties = [f"{_WORDS[kind[name].str[1:]]} {name}" for name in kind.names or ()]
    write_after(path, batches, lambda count: ply_header(comments, [("vertex", count, properties)]))


def name_comments(names: Iterable[str]) -> list[str]:
    """Comments with the names that the column `NAMED` indexes, one each."""
    return [f"surface {index} {json.dumps(name)}" for index, name in enumerate(names)]


def ply_header(
    comments: Iterable[str], elements: Iterable[tuple[str, int, Sequence[str]]]
) -> bytes:
    """Header of a binary little-endian PLY.

    Args:
        comments: texts of one line each.
        elements: name, count and properties, such as "float x", of each element.
    """
    # headers are ASCII, and some readers search for end_header anywhere
    plain = [line.encode("ascii", "replace").decode() for line in comments]
    plain = [line.replace("end_header", "end\\u005fheader") for line in plain]
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {line}".rstrip() for line in plain]
    for name, count, properties in elements:
        lines += [f"element {name} {count}", *(f"property {one}" for one in properties)]
    return "".join(f"{line}\n" for line in [*lines, "end_header"]).encode()
