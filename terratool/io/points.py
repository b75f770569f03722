"""Batches of points of a file: columns of numbers, names, comments and viewpoint.

The modules `csv_`, `las`, `npz`, `pcd` and `ply` each read and write one format. They check the
claims of a header against the file size before they allocate memory.
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
"""Column of indices into the names of a file; -1 for none."""
BATCH = 1 << 20
"""Most points in a batch."""
BATCH_BYTES = 1 << 26
"""Bytes of rows at which a batch ends."""
MOST_NAMES = 1 << 16
"""Most names in a file."""
_MOST_LETTERS = 1 << 20
"""Most characters of all names of a file together."""

Columns = dict[str, NDArray[Any]]
"""Columns of a batch by name, (n,) or (n, width)."""
Wanted = Mapping[str, int]
"""Widths of the wanted columns by name: numbers per row, 0 for a column of shape (n,)."""


class PointBatch(NamedTuple):
    """A batch of points of a file.

    Attributes:
        columns: (n,) or (n, width) numbers by column name, in the file's data types.
        names: names that the column `NAMED` indexes.
        comments: comments of the header, whitespace collapsed.
        viewpoint: (7,) float64, position x, y, z and quaternion w, x, y, z of the points' axes in
            the world; None for world axes.
    """

    columns: Columns
    names: tuple[str, ...] = ()
    comments: tuple[str, ...] = ()
    viewpoint: NDArray[np.float64] | None = None


def plain_columns(names: Iterable[str], wanted: Wanted) -> list[str]:
    """Subset of `names` that is wanted as columns of shape (n,), in order."""
    return [name for name in names if wanted.get(name) == 0]


def check_names(path: Path, names: Iterable[str]) -> tuple[str, ...]:
    """Collect the names of a file and check their number and length.

    Raises:
        RequestError: more than MOST_NAMES names, or more than 1 MiB of text.
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
    """Message of a library's error on one line, at most 100 characters."""
    return " ".join(str(error).split())[:100] or type(error).__name__


def file_size(file: io.BufferedReader) -> int:
    """Size of an open file, bytes."""
    return os.fstat(file.fileno()).st_size
