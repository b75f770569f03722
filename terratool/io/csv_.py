"""CSV point clouds, read and written: a header, then one line per point."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import DAMAGED, ReadError
from terratool.io.points import NAMED, Columns, PointBatch, Wanted, check_names
from terratool.io.rows import LINES, LineReader
from terratool.text.display import quote
from terratool.text.files import open_file
from terratool.text.numbers import parse_number


def read_points(path: Path, wanted: Wanted) -> Iterator[PointBatch]:
    """Read points of a CSV file; empty cells are NaN, and the column `NAMED` holds names.

    Raises:
        ReadError: the file is no CSV in UTF-8, or a cell is no number.
    """
    known: dict[str, int] = {}
    opened = open_file(path, named=True)
    with io.TextIOWrapper(opened, encoding="utf-8-sig", newline="") as file:
        lines = LineReader(path, file)
        rows = csv.reader(iter(lines))
        try:
            header = [cell.strip().lower() for cell in next(rows, [])]
            names = [name for name, width in wanted.items() if name in header and not width]
            places = [header.index(name) for name in names]
            while some := lines.batch(_cells(rows, places), LINES):
                columns: Columns = {}
                for index, name in enumerate(names):
                    cells = [row[index] for row in some]
                    if name == NAMED:
                        columns[name] = _indices(cells, known)
                    else:
                        columns[name] = _numbers(path, cells, name)
                yield PointBatch(columns, check_names(path, known))
        except UnicodeDecodeError as error:
            raise ReadError(f"{path}: is no UTF-8 text.", "Save it as UTF-8 CSV.") from error
        except csv.Error as error:
            raise ReadError(f"{path}:{rows.line_num}: is no CSV ({error}).", DAMAGED) from error


def _cells(rows: Iterator[list[str]], places: list[int]) -> Iterator[Sequence[str | None]]:
    """Yield the cells at the given column indices of each row; None where a row is too short."""
    pick = itemgetter(*places, -1)  # with one index alone it returns no tuple
    longest = max(places, default=0)
    for row in filter(None, rows):
        if len(row) > longest:
            yield pick(row)
        else:
            yield [row[place] if place < len(row) else None for place in places]


def _numbers(path: Path, cells: list[str | None], name: str) -> NDArray[np.float64]:
    """Parse a column of numbers, (n,) float64; NaN for empty cells.

    Raises:
        ReadError: a cell is no number, or a row is too short to have one.
    """
    values = [parse_number(cell or "nan") if cell is not None else None for cell in cells]
    if None in values:
        cell = cells[values.index(None)] or ""
        raise ReadError(
            f"{path}: {quote(cell)} is no number, in the column {name}.",
            "Write numbers with a point, and nothing where there is none.",
        )
    return np.array(values, np.float64)


def _indices(cells: list[str | None], known: dict[str, int]) -> NDArray[np.int64]:
    """Indices of names, (n,) int64, -1 for none; new names are added to `known`."""
    return np.array([known.setdefault(cell, len(known)) if cell else -1 for cell in cells])


def write_points(
    path: Path, batches: Iterable[Sequence[Sequence[Any]]], names: Sequence[str]
) -> None:
    """Write a header and one line per point; a batch is a list of columns as from `cells_of`."""
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for columns in batches:
            writer.writerows(zip(*columns, strict=True))


def cells_of(values: NDArray[Any]) -> list[Any]:
    """Cells of a column: shortest digits that read back as the same float; empty for NaN."""
    if values.dtype == np.float32:
        return ["" if number != number else str(number) for number in values]
    return ["" if number != number else number for number in values.tolist()]
