"""Rows of numbers behind a header, text or binary, read in batches and written as a stream."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import IO, Any, AnyStr, BinaryIO, Generic

import numpy as np
from numpy.typing import NDArray

from terratool.errors import DAMAGED, ReadError
from terratool.io.points import (
    BATCH,
    BATCH_BYTES,
    Columns,
    Wanted,
    file_size,
    plain_columns,
    short_text,
)

LINES = 1 << 17
"""Most lines of a text read at a time."""
_FEW = 64
"""Lines read between two checks of a batch's length in bytes."""
_MOST_LINE = 1 << 20
_MOST_HEADER = 1 << 20
_MOST_ROW = (1 << 31) - 1

Fields = list[tuple[str, str, int]]
"""Columns of a row: name, data type and number of adjacent values of each."""


@dataclass
class LineReader(Generic[AnyStr]):
    """Reads lines of a text of limited length.

    Iteration raises a ReadError for a line of more than 1 MiB.

    Attributes:
        path: path of the file, for messages.
        file: open file.
        taken: bytes, or characters, read so far.
    """

    path: Path
    file: IO[AnyStr]
    taken: int = field(default=0, init=False)

    def __iter__(self) -> Iterator[AnyStr]:
        while line := self.file.readline(_MOST_LINE):
            if len(line) == _MOST_LINE:
                raise ReadError(
                    f"{self.path}: has a line of more than {_MOST_LINE >> 20} MiB.", DAMAGED
                )
            self.taken += len(line)
            yield line

    def batch(self, rows: Iterator[Any], most: int) -> list[Any]:
        """Take up to `most` rows, parsed from these lines; fewer once BATCH_BYTES are read."""
        until = self.taken + BATCH_BYTES
        found: list[Any] = []
        while self.taken < until and (more := list(islice(rows, min(_FEW, most - len(found))))):
            found += more
        return found


def header_line(path: Path, file: io.BufferedReader) -> str:
    """Read the next line of a header.

    Raises:
        ReadError: the file ends, or the header exceeds 1 MiB.
    """
    line = file.readline(4096)
    if not line or file.tell() > _MOST_HEADER:
        raise ReadError(f"{path}: its header does not end.", DAMAGED)
    return line.decode("utf-8", "replace")


@dataclass(frozen=True, slots=True)
class RowLayout:
    """Layout of the rows behind a header.

    Attributes:
        fields: columns of a row.
        count: number of rows.
        order: byte order of binary numbers, "<" or ">"; empty for text.
    """

    fields: Fields
    count: int
    order: str


def read_rows(
    path: Path, file: io.BufferedReader, layout: RowLayout, wanted: Wanted
) -> Iterator[Columns]:
    """Yield the wanted columns of an open file, batch by batch.

    Raises:
        ReadError: two columns have one name, or the file has fewer rows than the header says.
    """
    fields, count, order = layout.fields, layout.count, layout.order
    if not fields:
        yield {}
        return
    names = plain_columns((name for name, _, _ in fields), wanted)
    if len(set(names)) < len(names):
        raise ReadError(f"{path}: has two columns of one name.", "Keep one of each.")
    size = sum(np.dtype(form).itemsize * many for _, form, many in fields)
    width = sum(many for _, _, many in fields)
    # a number in text takes two bytes at least: a digit and a separator
    least = count * (size if order else 2 * width) - (not order)
    if least > file_size(file) - file.tell() or (order and size > _MOST_ROW):
        raise ReadError(f"{path}: ends before its points do.", DAMAGED)
    places, forms, offsets, column, offset = [], [], [], 0, 0
    for name, form, many in fields:
        if name in names:
            places.append(column)
            forms.append(f"{order}{form}")
            offsets.append(offset)
        column += many
        offset += np.dtype(form).itemsize * many
    if not names or not count:
        yield {name: np.zeros(0) for name in names}
    elif order:
        kind = np.dtype({"names": names, "formats": forms, "offsets": offsets, "itemsize": size})
        yield from _binary_rows(path, file, kind, count)
    else:
        for rows in _text_rows(path, file, places, count):
            yield dict(zip(names, rows.T, strict=True))


def _binary_rows(
    path: Path, file: io.BufferedReader, kind: np.dtype[Any], count: int
) -> Iterator[Columns]:
    many = max(1, min(BATCH, BATCH_BYTES // kind.itemsize))
    for begin in range(0, count, many):
        size = min(many, count - begin) * kind.itemsize
        data = file.read(size)
        if len(data) < size:
            raise ReadError(f"{path}: ends before its points do.", DAMAGED)
        rows = np.frombuffer(data, kind)
        yield {name: rows[name] for name in kind.names or ()}


def _text_rows(
    path: Path, file: io.BufferedReader, places: list[int], count: int
) -> Iterator[NDArray[np.float64]]:
    """Yield the numbers at column indices `places` of `count` lines, (n, len(places)) float64."""
    lines = LineReader(path, file)
    each = iter(lines)
    while count > 0:
        some = lines.batch(each, min(LINES, count))
        count -= len(some)
        try:
            if not all(map(bytes.strip, some)) or not some:
                raise ReadError(f"{path}: ends before its points do.", DAMAGED)
            text = [line.decode("ascii") for line in some]
            yield np.loadtxt(text, comments=None, usecols=places, ndmin=2)
        except ValueError as error:
            what = short_text(error).partition(" at row ")[0]  # a row of the batch, not of the file
            raise ReadError(
                f"{path}: has a line that is no row of numbers ({what}).", DAMAGED
            ) from error


class Spool:
    """Temporary file of rows, for formats whose header needs their number first.

    Args:
        path: path of the temporary file, removed at the end of the block.
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

    def copy_to(self, file: BinaryIO) -> None:
        """Copy all bytes into an open file."""
        self._file.close()
        with open(self._path, "rb") as source:
            shutil.copyfileobj(source, file, 1 << 20)

    def chunks(self, kind: np.dtype[Any], count: int) -> Iterator[NDArray[Any]]:
        """Yield all rows, as arrays of `kind` of at most `count` rows."""
        self._file.close()
        with open(self._path, "rb") as source:
            while data := source.read(count * kind.itemsize):
                yield np.frombuffer(data, kind)


def write_after(
    path: Path, batches: Iterable[NDArray[Any]], header: Callable[[int], bytes]
) -> None:
    """Write rows behind the header that `header` makes of their number."""
    count = 0
    with Spool(path.with_name(path.name + ".rows")) as spool:
        for rows in batches:
            count += len(rows)
            spool.add(rows)
        with open(path, "wb") as file:
            file.write(header(count))
            spool.copy_to(file)
