"""The points of LAS and LAZ, by laspy, as far as a file bears out what its header claims."""

from __future__ import annotations

import contextlib
import logging
import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import IO, Any, NamedTuple

from terratool.errors import DAMAGED, ReadError
from terratool.processes import limit_memory, python_calling
from terratool.text.files import open_file
from terratool.text.packing import TIMES, most_unpacked

_BATCH_BYTES = 1 << 25
_APART_BYTES = 400 << 20
"""Memory that a process which unpacks LAZ may take beyond its start."""
_VLR_BYTES = 54
_PACKED = 0xC0
"""Bits of a point format that say LAZ."""

# ASPRS, LAS 1.4 R15, table 3: the sizes of the header, the place of the points, how many records of
# variable length there are, the format and the size of points and, in two ways, their count
_fields = struct.Struct("<4s20x2B68xHIIBHI")
_count = struct.Struct("<247xQ")


class _Claims(NamedTuple):
    """What a header says of the rest of its file."""

    magic: bytes
    major: int
    minor: int
    header: int
    offset: int
    records: int
    form: int
    size: int
    points: int


class LasPoints:
    """An open file of points.

    Attributes:
        header: as laspy has it.
    """

    def __init__(self, path: Path, header: Any, count: int, source: IO[bytes]) -> None:
        self.header = header
        self._path, self._count, self._source = path, count, source

    def batches(self, most: int) -> Iterator[Any]:
        """All points, up to so many at a time, as laspy's records, which scale coordinates.

        Raises:
            ReadError: there are fewer than the header says.
        """
        import laspy

        form, left = self.header.point_format, self._count
        many = max(1, min(most, _BATCH_BYTES // form.size))
        while left > 0:
            data = self._source.read(min(many, left) * form.size)
            if len(data) < min(many, left) * form.size:
                raise ReadError(f"{self._path}: its points are broken, or end too early.", DAMAGED)
            record = laspy.PackedPointRecord.from_buffer(data, form)
            yield laspy.ScaleAwarePointRecord(
                record.array, form, self.header.scales, self.header.offsets
            )
            left -= many


@contextlib.contextmanager
def open_las(path: Path) -> Iterator[LasPoints]:
    """Open a file of LAS or LAZ.

    LAZ is unpacked by a process of its own: lazrs takes the sizes in a broken file at their word,
    and ends the process where there is less memory.

    Raises:
        ReadError: it is none, or its header claims more than the file has.
    """
    with open_file(path) as file:
        claims = _checked(path, file)
        file.seek(0)
        with _quiet():
            header = _header(path, file)
        if not claims.form & _PACKED or not claims.points:
            file.seek(claims.offset)
            yield LasPoints(path, header, claims.points, file)
            return
    child = subprocess.Popen(
        **python_calling(__name__, "unpack", str(path)),
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    assert child.stdout is not None
    try:
        yield LasPoints(path, header, claims.points, child.stdout)
    finally:
        child.kill()
        child.stdout.close()
        child.wait()


def _checked(path: Path, file: BufferedReader) -> _Claims:
    """What the header claims, if the file can have so much.

    Raises:
        ReadError: it cannot, or is no LAS.
    """
    size, head = os.fstat(file.fileno()).st_size, file.read(_count.size)
    if len(head) < _fields.size or not head.startswith(b"LASF"):
        raise ReadError(f"{path}: is no LAS.", DAMAGED)
    claims = _Claims(*_fields.unpack_from(head))
    if claims.minor >= 4 and len(head) == _count.size:
        claims = claims._replace(points=_count.unpack_from(head)[0])
    inside = _fields.size <= claims.header <= claims.offset <= size
    if not inside or claims.records * _VLR_BYTES > claims.offset - claims.header:
        raise ReadError(f"{path}: its header claims more than the file has.", DAMAGED)
    unpacked = claims.points * claims.size
    if claims.form & _PACKED:
        if unpacked > most_unpacked(size):
            raise ReadError(
                f"{path}: comes to more than {TIMES} times its size.", "Save it as plain LAS."
            )
    elif unpacked > size - claims.offset:
        raise ReadError(f"{path}: ends before its points do.", DAMAGED)
    return claims


def _header(path: Path, file: BufferedReader) -> Any:
    """The header and the records of variable length.

    Raises:
        ReadError: they are broken.
    """
    import laspy

    try:
        header = laspy.LasHeader.read_from(file)
        header.point_format.dtype()  # which points cannot have where it is broken
    except MemoryError:
        raise
    except Exception as error:  # of many kinds, as it looks at nothing before it takes it apart
        words = " ".join(str(error).split())[:100]
        raise ReadError(f"{path}: its header is no LAS's ({words}).", DAMAGED) from error
    return header


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep laspy from printing what it thinks of a header."""
    log = logging.getLogger("laspy")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(level)


def unpack() -> None:
    """Write the points of the LAZ that the command line names to standard output, unpacked."""
    import laspy

    limit_memory(_APART_BYTES)
    with (
        _quiet(),
        laspy.open(
            open_file(sys.argv[1]), laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False
        ) as file,
    ):
        many = max(1, _BATCH_BYTES // file.header.point_format.size)
        for points in file.chunk_iterator(many):
            sys.stdout.buffer.write(points.array.tobytes())
    sys.stdout.flush()
    os._exit(0)  # what the library still holds need not be tidied up
