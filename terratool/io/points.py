"""Points of a file, batch by batch: columns of numbers, and what a file says of them.

Each format is a module of its own, `csv_`, `las`, `npz`, `pcd` or `ply`, which reads and writes it.
What a header claims is held against the size of its file before anything is made of it.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError

NAMED = "surface"
"""The column whose numbers count names, which a file may hold as well; -1 is none."""
BATCH = 1 << 20
"""Most points that are in memory at a time."""
BATCH_BYTES = 1 << 26
"""Bytes of rows after which no more are read at a time."""
MOST_NAMES = 1 << 16
"""Most names that the column `NAMED` may count."""
_MOST_LETTERS = 1 << 20
"""Most characters of all these names together."""

Columns = dict[str, NDArray[Any]]
Wanted = Mapping[str, int]
"""Numbers that each row of a column has, by the names of columns; 0 for a plain column."""


class Points(NamedTuple):
    """Some points of a file.

    Attributes:
        columns: (n,) or (n, width) numbers by name, as the file has them.
        names: those that the column `NAMED` counts.
        comments: of the header, their words one space apart.
        viewpoint: (7,) float64 position and quaternion w, x, y, z of the axes that points are in;
            None where these are the world's.
    """

    columns: Columns
    names: tuple[str, ...] = ()
    comments: tuple[str, ...] = ()
    viewpoint: NDArray[np.float64] | None = None


def plain_columns(names: Iterable[str], wanted: Wanted) -> list[str]:
    """Names that are wanted as plain columns, in their order."""
    return [name for name in names if wanted.get(name) == 0]


def check_names(path: Path, names: Iterable[str]) -> tuple[str, ...]:
    """Names, if they are not too many or too long.

    Raises:
        RequestError: they are.
    """
    checked, size = [], 0
    for name in names:
        checked.append(name)
        size += len(name)
        if len(checked) > MOST_NAMES or size > _MOST_LETTERS:
            raise RequestError(
                f"{path}: names more than {MOST_NAMES:,} surfaces, or more than "
                f"{_MOST_LETTERS >> 20} MiB of them.",
                "Rename the column surface, if it holds something else.",
            )
    return tuple(checked)


def short_text(error: BaseException) -> str:
    """The message of a library's error, in a line of up to 100 characters."""
    return " ".join(str(error).split())[:100] or type(error).__name__


def file_size(file: io.BufferedReader) -> int:
    """Bytes of an open file."""
    return os.fstat(file.fileno()).st_size
