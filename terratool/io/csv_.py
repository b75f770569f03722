"""CSV: a line for each point behind a header, read and written."""

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
from terratool.io.points import NAMED, Columns, Points, Wanted, check_names
from terratool.io.rows import LINES, Lines
from terratool.text.display import shown
from terratool.text.files import open_file
from terratool.text.numbers import parse_number


def read_points(path: Path, wanted: Wanted) -> Iterator[Points]:
    """Lines behind a header; empty cells are no numbers, and the column `NAMED` holds the names.

    Raises:
        ReadError: it is no CSV in UTF-8, or a cell is no number.
    """
    known: dict[str, int] = {}
    opened = open_file(path, named=True)
    with io.TextIOWrapper(opened, encoding="utf-8-sig", newline="") as file:
        lines = Lines(path, file)
        rows = csv.reader(iter(lines))
        try:
            header = [cell.strip().lower() for cell in next(rows, [])]
            names = [name for name, width in wanted.items() if name in header and not width]
            places = [header.index(name) for name in names]
            while some := lines.some(_picked(rows, places), LINES):
                columns: Columns = {}
                for index, name in enumerate(names):
                    cells = [row[index] for row in some]
                    if name == NAMED:
                        columns[name] = _indices(cells, known)
                    else:
                        columns[name] = _numbers(path, cells, name)
                yield Points(columns, check_names(path, known))
        except UnicodeDecodeError as error:
            raise ReadError(f"{path}: is no UTF-8 text.", "Save it as UTF-8 CSV.") from error
        except csv.Error as error:
            raise ReadError(f"{path}:{rows.line_num}: is no CSV ({error}).", DAMAGED) from error


def _picked(rows: Iterator[list[str]], places: list[int]) -> Iterator[Sequence[str | None]]:
    """The cells at some places of each row; None where a row ends before."""
    pick = itemgetter(*places, -1)  # of one place alone it would give no tuple
    longest = max(places, default=0)
    for row in filter(None, rows):
        if len(row) > longest:
            yield pick(row)
        else:
            yield [row[place] if place < len(row) else None for place in places]


def _numbers(path: Path, cells: list[str | None], name: str) -> NDArray[np.float64]:
    """A column of numbers; NaN where there is nothing.

    Raises:
        ReadError: a cell is no number, or lacks.
    """
    values = [parse_number(cell or "nan") if cell is not None else None for cell in cells]
    if None in values:
        cell = cells[values.index(None)] or ""
        raise ReadError(
            f"{path}: {shown(cell)} is no number, in the column {name}.",
            "Write numbers with a point, and nothing where there is none.",
        )
    return np.array(values, np.float64)


def _indices(cells: list[str | None], known: dict[str, int]) -> NDArray[np.int64]:
    """Indices of names, of which more become known."""
    return np.array([known.setdefault(cell, len(known)) if cell else -1 for cell in cells])


def write_points(
    path: Path, batches: Iterable[Sequence[Sequence[Any]]], names: Sequence[str]
) -> None:
    """Write a header and a line for each point; batches are columns of cells, as of `cells_of`."""
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for columns in batches:
            writer.writerows(zip(*columns, strict=True))


def cells_of(values: NDArray[Any]) -> list[Any]:
    """Numbers with as many digits as bring back the same double, or float32; nothing for NaN."""
    if values.dtype == np.float32:
        return ["" if number != number else str(number) for number in values]
    return ["" if number != number else number for number in values.tolist()]
