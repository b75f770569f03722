"""Rows that grow on the disk, as their number stands before them in a file."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray


class Spool:
    """Bytes that are written before it is known how many there will be.

    Args:
        path: a name for them; nothing is there after the block.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = open(path, "wb")  # noqa: SIM115, it is closed when its bytes are taken

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()
        self._path.unlink(missing_ok=True)

    def add(self, rows: NDArray[Any]) -> None:
        """Add the bytes of an array."""
        self._file.write(np.ascontiguousarray(rows).tobytes())

    def moved_to(self, file: BinaryIO) -> None:
        """Copy all of it into a file."""
        self._file.close()
        with open(self._path, "rb") as source:
            shutil.copyfileobj(source, file, 1 << 20)

    def chunks(self, kind: np.dtype[Any], count: int) -> Iterator[NDArray[Any]]:
        """All of it as rows, so many at a time."""
        self._file.close()
        with open(self._path, "rb") as source:
            while data := source.read(count * kind.itemsize):
                yield np.frombuffer(data, kind)


def write_after(
    path: Path, batches: Iterable[NDArray[Any]], header: Callable[[int], bytes]
) -> None:
    """Write rows behind a header that is made of their number."""
    count = 0
    with Spool(path.with_name(path.name + ".rows")) as spool:
        for rows in batches:
            count += len(rows)
            spool.add(rows)
        with open(path, "wb") as file:
            file.write(header(count))
            spool.moved_to(file)
