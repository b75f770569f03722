"""Point clouds as lines of numbers: x, y and z first, or named by a line above them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terratool.definition.exact import powers_of_ten
from terratool.errors import DAMAGED, ReadError
from terratool.io.axis_names import axis_columns
from terratool.io.points import PointBatch, Wanted
from terratool.kernels import importing as kernels
from terratool.text.display import quote
from terratool.text.files import open_file
from terratool.text.numbers import parse_number

_CHUNK = 1 << 20
"""Bytes that are read at a time, and most bytes of a line."""
_BOM = b"\xef\xbb\xbf"

_word = re.compile(rb"[^\s,]*").match
_comma_number = re.compile(r"[+-]?\d+(?:,\d+)?(?:[eE][+-]?\d+)?").fullmatch
_TABLES: dict[tuple[str, bool], bytes] = {
    (";", False): bytes.maketrans(b";", b","),
    (";", True): bytes.maketrans(b",;", b".,"),
    ("", True): bytes.maketrans(b",", b"."),
}
"""Translations of bytes by what parts fields, nothing for blanks, and by decimal commas."""


@dataclass(frozen=True, slots=True)
class TextLayout:
    """Layout of the lines of a text.

    Attributes:
        places: indices of the fields of x, y and z in a line, from 0.
        skipped: bytes before the first line of numbers.
        table: translation of bytes that makes commas the separators, and points those of decimals;
            None for none.
    """

    places: tuple[int, int, int]
    skipped: int
    table: bytes | None = None


def layout_of(head: bytes) -> TextLayout | None:
    """Layout of a text by its first bytes; None if it holds no lines of x, y and z.

    Lines that begin with # or / are comments; a comment, or the first line, may name the fields.
    """
    places = (0, 1, 2)
    at = len(_BOM) if head.startswith(_BOM) else 0
    while at < len(head):
        end = head.find(b"\n", at)
        end = len(head) if end < 0 else end
        line = head[at:end].decode("utf-8", "replace").replace("\r", " ").strip()
        named = axis_columns(_parted(line.lstrip("#/ ")))
        if named is not None:
            places = named
        elif line and line[0] not in "#/":
            between = _separator(line)
            # between blanks, a later line may be the first with decimals
            other = line if between or b"," not in head[at:] else _line_with_comma(head[at:])
            commas = between != "," and "," in other and (between == ";" or _has_decimals(other))
            numbers = (
                [field.replace(",", ".") for field in _parted(line)] if commas else _parted(line)
            )
            table = table_of(between, commas)
            if len(numbers) <= max(places):
                return None
            if any(parse_number(numbers[place] or "nan") is None for place in places):
                return None
            return TextLayout(places, at, table)
        at = end + 1
    return None


def table_of(separator: str, decimal_comma: bool) -> bytes | None:
    """Translation that makes commas the separators, and points those of decimals; None for none.

    Args:
        separator: sign between two fields; empty for blanks.
        decimal_comma: whether numbers have a comma in place of the point.
    """
    return _TABLES.get((separator, decimal_comma))


def _line_with_comma(text: bytes) -> str:
    """First line of a text with a comma, which it has."""
    at = text.index(b",")
    begin, end = text.rfind(b"\n", 0, at) + 1, text.find(b"\n", at)
    return text[begin : None if end < 0 else end].decode("utf-8", "replace")


def _separator(line: str) -> str:
    """Sign that parts the fields of a line: a semicolon or a comma; empty for blanks."""
    if ";" in line:
        return ";"
    return "," if "," in line and not _has_decimals(line) else ""


def _has_decimals(line: str) -> bool:
    """Whether a line has numbers between blanks, of which some have a comma for the point."""
    return "," in line and len(line.split()) > 2 and all(map(_comma_number, line.split()))


def _parted(line: str) -> list[str]:
    """Fields of a line."""
    return [field.strip() for field in line.split(_separator(line) or None)]


def numbers_in(path: Path, text: bytes, layout: TextLayout) -> NDArray[np.float64]:
    """Numbers x, y and z of whole lines, (n, 3) float64; NaN for empty fields.

    Raises:
        ReadError: a line has too few fields, or a field is no number.
    """
    if layout.table is not None:
        text = text.translate(layout.table)
    order = np.argsort(layout.places)
    places = np.array(layout.places, np.int64)[order]
    found = kernels.read_rows(np.frombuffer(text, np.uint8), places, powers_of_ten())
    numbers, odd, bad = found
    if bad >= 0:
        line = text[bad : bad + 200].splitlines()[0].decode("utf-8", "replace")
        raise ReadError(f"{path}: has no x, y and z in the line {quote(line.strip())}.", DAMAGED)
    for index, at in odd:
        word = _word(text, at)[0].decode("utf-8", "replace")  # type: ignore[index]
        number = parse_number(word)
        if number is None:
            raise ReadError(
                f"{path}: {quote(word)} is no number.",
                "Write lines of x, y and z, with points in the numbers.",
            )
        numbers[index] = number
    rows: NDArray[np.float64] = numbers.reshape(-1, 3)[:, np.argsort(order)]
    return rows


def read_points(path: Path, wanted: Wanted) -> Iterator[PointBatch]:  # noqa: ARG001, x, y, z alone
    """Read the points of a text, whose fields are parted by blanks, commas or semicolons.

    Raises:
        ReadError: a line is longer than 1 MiB, has too few fields, or is no row of numbers.
    """
    with open_file(path, named=True) as file:
        left = file.read(_CHUNK)
        layout = layout_of(left)
        if layout is None:
            raise ReadError(
                f"{path}: holds no lines of x, y and z.",
                "Write three numbers a line, or a line of names above them.",
            )
        left = left[layout.skipped :]
        while left:
            more = file.read(_CHUNK)
            end = left.rfind(b"\n") + 1 if more else len(left)
            if not end and len(left) > _CHUNK:
                raise ReadError(f"{path}: has a line of more than 1 MiB.", DAMAGED)
            rows = numbers_in(path, left[:end], layout)
            if len(rows):
                yield PointBatch(dict(zip("xyz", rows.T, strict=True)))
            left = left[end:] + more
