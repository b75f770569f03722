"""Headers of classic netCDF files, which say how long the file has to be.

The format: Unidata, "NetCDF Classic Format Specifications", and CDF-5 of PnetCDF.
"""

from __future__ import annotations

import math
import os
from io import BufferedReader
from typing import NamedTuple

CLASSIC = b"CDF"
"""First bytes of a classic netCDF, of any version."""

_LARGE_FILES, _LARGE_COUNTS = 2, 5
"""Versions from which on places in the file, and all counts, have 64 bits."""
_VERSIONS = (1, _LARGE_FILES, _LARGE_COUNTS)
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
"""Bytes of a number by the code of its type."""
_ALIGNED = 4
_MOST_RANK = 1024


class _BrokenHeaderError(Exception):
    """A header that ends early, or holds what no header does."""


class _Variable(NamedTuple):
    """Place of a variable.

    Attributes:
        begin: first byte of its numbers.
        size: bytes of its numbers, or of those of one record, without padding.
        by_record: whether it has numbers in each record.
    """

    begin: int
    size: int
    by_record: bool


class _ClassicHeader:
    """Reader of a header's items, from an open file behind its first three bytes."""

    def __init__(self, file: BufferedReader) -> None:
        self._file = file
        self._left = os.fstat(file.fileno()).st_size - file.tell()
        self._wide = 4
        version = self.number(1)
        if version not in _VERSIONS:
            raise _BrokenHeaderError
        self._wide = 8 if version == _LARGE_COUNTS else 4
        self._place = 4 if version == 1 else 8

    def number(self, size: int = 0) -> int:
        """Read a whole number of `size` bytes; of those of a count if that is 0."""
        return int.from_bytes(self._take(size or self._wide), "big")

    def variables(self) -> tuple[int | None, list[_Variable]]:
        """Read the number of records, None where it is not known, and all variables."""
        records = self.number()
        unknown = records == (1 << 8 * self._wide) - 1
        lengths = []
        for _ in range(self._items()):
            self._pass(self.number())
            lengths.append(self.number())
        self._pass_attributes()
        found = []
        for _ in range(self._items()):
            self._pass(self.number())
            rank = self.number()
            if rank > _MOST_RANK:
                raise _BrokenHeaderError
            axes = [self.number() for _ in range(rank)]
            self._pass_attributes()
            size = _BYTES.get(self.number(4), 0)
            self.number()  # the same size with padding, which is capped at 32 bits
            begin = self.number(self._place)
            if not size or any(axis >= len(lengths) for axis in axes):
                raise _BrokenHeaderError
            sides = [lengths[axis] for axis in axes]
            by_record = bool(sides) and sides[0] == 0
            found.append(_Variable(begin, size * math.prod(sides[by_record:]), by_record))
        return None if unknown else records, found

    def _take(self, size: int) -> bytes:
        self._left -= size
        data = self._file.read(size) if self._left >= 0 else b""
        if len(data) < size:
            raise _BrokenHeaderError
        return data

    def _pass(self, size: int) -> None:
        """Skip bytes with their padding."""
        size = _padded(size)
        self._left -= size
        if self._left < 0:
            raise _BrokenHeaderError
        self._file.seek(size, os.SEEK_CUR)

    def _items(self) -> int:
        """Read the number of items of a list, behind what kind of list it is."""
        self.number(4)
        return self.number()

    def _pass_attributes(self) -> None:
        for _ in range(self._items()):
            self._pass(self.number())
            size = _BYTES.get(self.number(4), 0)
            self._pass(size * self.number())


def _padded(size: int) -> int:
    return -(-size // _ALIGNED) * _ALIGNED


def classic_bytes(file: BufferedReader) -> int | None:
    """Return the least number of bytes that a classic netCDF has by its header.

    The padding behind the last number may be missing.

    Args:
        file: file open at its begin.

    Returns:
        The number of bytes; None for another file, or for a broken header.
    """
    if file.read(len(CLASSIC)) != CLASSIC:
        return None
    try:
        records, variables = _ClassicHeader(file).variables()
    except _BrokenHeaderError:
        return None
    repeated = [one for one in variables if one.by_record]
    # a record of one variable alone is not padded
    step = sum(one.size if len(repeated) == 1 else _padded(one.size) for one in repeated)
    ends = [one.begin + one.size for one in variables if not one.by_record]
    if records:
        ends += [one.begin + (records - 1) * step + one.size for one in repeated]
    return max(ends, default=0)
