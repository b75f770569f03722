"""LAS and LAZ, by laspy: points, read as far as a file bears out its header, and written."""

from __future__ import annotations

import contextlib
import datetime
import logging
import math
import os
import struct
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BufferedReader
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import DAMAGED, ReadError
from terratool.io.points import BATCH, NAMED, Columns, Points, Wanted, check_names, short_text
from terratool.io.rows import Spool
from terratool.processes import limit_memory, python_calling
from terratool.text.files import open_file
from terratool.text.packing import TIMES, most_unpacked

_BATCH_BYTES = 1 << 25
_APART_BYTES = 400 << 20
"""Memory that a process which unpacks LAZ may take beyond its start."""
_VLR_BYTES = 54
_PACKED = 0xC0
"""Bits of a point format that say LAZ."""
_FINEST = 1e-4
"""Finest step of coordinates, units; coarser where points lie too far apart for 31 bits of it."""
_CHUNK = 1 << 16
"""Rows that are encoded together."""
_RECORD = "terratool", 1
"""User and number of the record of variable length that has the names."""
_DIMENSIONS = {"gps_time": "time", "range": "range", "surface": NAMED}
"""Columns by the names that LAS, or a file that is written here, has for them."""

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


def read_points(path: Path, wanted: Wanted) -> Iterator[Points]:
    """Points of LAS and LAZ, and what is added to them where they were written here.

    Raises:
        ReadError: it is none, or its header claims more than the file has.
    """
    with _open(path) as file:
        names: tuple[str, ...] = ()
        for record in file.header.vlrs:
            if (record.user_id, record.record_id) == _RECORD:
                text = record.record_data_bytes().decode("utf-8", "replace")
                names = check_names(path, text.split("\n"))
        held = {*file.header.point_format.dimension_names}
        for points in file.batches(BATCH):
            with np.errstate(all="ignore"):  # what is no number is left out
                columns: Columns = {name: np.asarray(getattr(points, name)) for name in "xyz"}
                for dimension, name in _DIMENSIONS.items():
                    if dimension in held and name in wanted:
                        columns[name] = np.asarray(points[dimension])
            if any(column.ndim != 1 for column in columns.values()):
                raise ReadError(f"{path}: has a column of several numbers a point.", DAMAGED)
            yield Points(columns, names)


class _OpenPoints:
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
def _open(path: Path) -> Iterator[_OpenPoints]:
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
            yield _OpenPoints(path, header, claims.points, file)
            return
    child = subprocess.Popen(
        **python_calling(__name__, "unpack", str(path)),
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    assert child.stdout is not None
    try:
        yield _OpenPoints(path, header, claims.points, child.stdout)
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
        raise ReadError(
            f"{path}: its header is no LAS's ({short_text(error)}).", DAMAGED
        ) from error
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


@dataclass(frozen=True, slots=True)
class LasHeader:
    """Texts that a LAS has besides its points.

    Attributes:
        system: the instrument that made them.
        names: those that the column `NAMED` counts.
        wkt: their reference system as WKT; empty for none.
        extra: descriptions, of 32 characters at most, of columns that are none of LAS, by name.
    """

    system: str
    names: tuple[str, ...] = ()
    wkt: str = ""
    extra: Mapping[str, str] = field(default_factory=dict)


def write_points(
    path: Path, batches: Iterable[NDArray[Any]], kind: np.dtype[Any], said: LasHeader
) -> None:
    """Write LAS 1.4, or LAZ by the suffix, of points of format 6, each the only return of its ray.

    Rows have fields of a `kind`: x, y, z, others of format 6 by laspy's names, and extra ones. The
    names are a line each of a record of variable length. Offsets are whole, below all points.
    """
    import laspy

    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = datetime.date(1980, 1, 1)  # no clock
    header.generating_software = "terratool"
    header.system_identifier = said.system
    header.global_encoding.wkt = True  # as formats 6 and up want it, whether there is any or not
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(name=name, type=kind[name].str[1:], description=text)
            for name, text in said.extra.items()
        ]
    )
    names = "\n".join(said.names).encode()
    header.vlrs.append(laspy.VLR(*_RECORD, "names of surfaces", names[: 2**16 - 1]))
    if said.wkt:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(said.wkt))
    lowest, highest = np.full(3, np.inf), np.full(3, -np.inf)
    with Spool(path.with_name(path.name + ".rows")) as spool:
        for rows in batches:
            spool.add(rows)
            for axis, name in enumerate("xyz"):
                lowest[axis] = min(lowest[axis], rows[name].min(initial=np.inf))
                highest[axis] = max(highest[axis], rows[name].max(initial=-np.inf))
        header.offsets = np.floor(lowest) if np.isfinite(lowest).all() else np.zeros(3)
        reach = max(float((highest - header.offsets).max()), 1.0)
        step = max(_FINEST, 10.0 ** math.ceil(math.log10(reach / (2**31 - 1))))
        header.scales = np.full(3, step)
        with laspy.open(path, "w", header=header, do_compress=path.suffix == ".laz") as file:
            for rows in spool.chunks(kind, _CHUNK):
                file.write_points(_encoded(rows, header))


def _encoded(rows: NDArray[Any], header: Any) -> Any:
    """Rows as points of a header."""
    import laspy

    points: Any = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
    points.return_number[:] = points.number_of_returns[:] = 1
    for name in rows.dtype.names or ():
        if name in ("x", "y", "z"):
            setattr(points, name, rows[name])
        else:
            points[name] = rows[name]
    return points
