"""NumPy's .npz archives of point columns, read and written in batches of rows."""

from __future__ import annotations

import io
import math
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import DAMAGED, ReadError
from terratool.io.points import BATCH, MOST_NAMES, NAMED, PointBatch, Wanted, check_names, file_size
from terratool.io.rows import Spool
from terratool.text.files import open_file
from terratool.text.packing import PackingError, refuse_members

NAMES = f"{NAMED}s"
"""Name of the array of names that the column `NAMED` indexes."""
_ARCHIVE_ERRORS = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, OverflowError,
    ValueError,
)  # fmt: skip
"""Errors that zipfile and NumPy raise for a broken archive."""
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Fixed time of all members, for reproducible archives."""


def read_points(path: Path, wanted: Wanted) -> Iterator[PointBatch]:
    """Read columns of an archive, all arrays side by side in batches of rows.

    Raises:
        ReadError: the file is no NumPy archive, or its arrays are no columns of one length.
    """
    with ExitStack() as stack:
        file = stack.enter_context(open_file(path))
        try:
            archive = stack.enter_context(zipfile.ZipFile(file))
            stored = {name.removesuffix(".npy"): name for name in archive.namelist()}
            found = {
                name: archive.getinfo(stored[name]) for name in (*wanted, NAMES) if name in stored
            }
            refuse_members(archive, [one.filename for one in found.values()], file_size(file))
            members = {
                name: _Member(path, stack.enter_context(archive.open(one)), one.file_size)
                for name, one in found.items()
            }
            named = members.pop(NAMES, None)
            names = () if named is None else check_names(path, named.texts())
            if any(not member.has_rows(wanted[name]) for name, member in members.items()):
                raise ReadError(
                    f"{path}: has an array that is no column of numbers.",
                    "Save one of a dimension for each column; origin has three numbers a row.",
                )
            counts = {member.shape[0] for member in members.values()}
            if len(counts) > 1:
                raise ReadError(f"{path}: its arrays are not of one length.", DAMAGED)
            total = max(counts, default=0)
            for begin in range(0, total, BATCH):
                count = min(BATCH, total - begin)
                columns = {name: member.read(count) for name, member in members.items()}
                yield PointBatch(columns, names)
            if not counts:
                yield PointBatch({}, names)
        except PackingError as error:
            raise ReadError(f"{path}: {error.message}", error.hint) from error
        except _ARCHIVE_ERRORS as error:
            raise ReadError(f"{path}: is no archive of NumPy, or damaged.", DAMAGED) from error


class _Member:
    """Array in an archive whose rows are read in order.

    Args:
        path: path of the archive, for messages.
        file: open member of the archive.
        size: unpacked size of the member by the archive, bytes.

    Attributes:
        shape: shape of the array.

    Raises:
        ReadError: the header of the array is broken, or claims more than the member has.
    """

    def __init__(self, path: Path, file: Any, size: int) -> None:
        self._path, self._file = path, file
        try:
            with warnings.catch_warnings():  # headers of Python 2 raise a warning
                warnings.simplefilter("ignore")
                self.shape, self._by_columns, self._type = _array_header(file)
        except Exception as error:  # many types: a header is a Python expression
            deep = isinstance(error, MemoryError)  # of the parser, for nested expressions
            raise ReadError(f"{path}: has an array whose header is none.", DAMAGED) from (
                None if deep else error
            )
        if any(type(side) is not int or side < 0 for side in self.shape):
            raise ReadError(f"{path}: has an array without a length.", DAMAGED)
        if math.prod(self.shape) * self._type.itemsize > size - file.tell():
            raise ReadError(f"{path}: ends before its arrays do.", DAMAGED)

    def has_rows(self, width: int) -> bool:
        """Return whether each row has `width` numbers, or one without an axis if `width` is 0."""
        plain = self._type.kind in "fiub" and not (self._by_columns and width)
        return plain and self.shape[1:] == (width,) * bool(width) and len(self.shape) > 0

    def read(self, count: int) -> NDArray[Any]:
        """Read the next `count` rows."""
        shape = (count, *self.shape[1:])
        size = math.prod(shape) * self._type.itemsize
        data = self._file.read(size)
        if len(data) < size:
            raise ReadError(f"{self._path}: ends before its arrays do.", DAMAGED)
        return np.frombuffer(data, self._type).reshape(shape)

    def texts(self) -> list[str]:
        """Read the array as texts, at most MOST_NAMES + 1 of them.

        Raises:
            ReadError: the array is not one-dimensional text.
        """
        if self._type.kind != "U" or len(self.shape) != 1 or not self._type.itemsize:
            raise ReadError(f"{self._path}: its {NAMES} are no list of names.", DAMAGED)
        found: list[str] = self.read(min(self.shape[0], MOST_NAMES + 1)).tolist()
        return found


def _array_header(file: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether in Fortran order, and data type, from an array's header."""
    version = np.lib.format.read_magic(file)
    read = {(1, 0): np.lib.format.read_array_header_1_0}.get(
        version, np.lib.format.read_array_header_2_0
    )
    found: tuple[tuple[int, ...], bool, np.dtype[Any]] = read(file)
    return found


def write_points(
    path: Path,
    batches: Iterable[Mapping[str, NDArray[Any]]],
    kinds: Mapping[str, np.dtype[Any]],
    small: Callable[[], Mapping[str, NDArray[Any]]],
) -> None:
    """Write an uncompressed archive for `numpy.load`.

    Args:
        path: file to write.
        batches: columns by name, of equal length in a batch.
        kinds: data types of the columns, with the shape of a row that is no single number.
        small: makes the other arrays, called after the last batch.
    """
    count = 0
    with ExitStack() as stack:
        spools = {
            name: stack.enter_context(Spool(path.with_name(f"{path.name}.{name}")))
            for name in kinds
        }
        for columns in batches:
            count += len(next(iter(columns.values())))
            for name, spool in spools.items():
                spool.add(columns[name])
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, spool in spools.items():
                kind = kinds[name]
                with _member(archive, name) as file:
                    file.write(_header(kind.base, (count, *kind.shape)))
                    spool.copy_to(file)
            for name, value in small().items():
                with _member(archive, name) as file:
                    np.lib.format.write_array(file, value, (1, 0), allow_pickle=False)


def _member(archive: zipfile.ZipFile, name: str) -> Any:
    return archive.open(zipfile.ZipInfo(f"{name}.npy", _EPOCH), "w", force_zip64=True)


def _header(kind: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    buffer = io.BytesIO()
    described = {"descr": kind.str, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(buffer, described)
    return buffer.getvalue()
