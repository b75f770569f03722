"""LAS and LAZ point clouds, read and written by laspy; headers are checked against file sizes."""

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
from terratool.io.points import BATCH, NAMED, Columns, PointBatch, Wanted, check_names, short_text
from terratool.io.rows import Spool
from terratool.processes import limit_memory, python_calling
from terratool.text.files import open_file
from terratool.text.packing import TIMES, most_unpacked

_BATCH_BYTES = 1 << 25
_APART_BYTES = 400 << 20
"""Bytes of memory that the child process that unpacks LAZ may allocate."""
_VLR_BYTES = 54
_PACKED = 0xC0
"""Bits of the point format that mark LAZ."""
_FINEST = 1e-4
"""Finest step of coordinates, world units; coarser where the extent needs more than 31 bits."""
_CHUNK = 1 << 16
"""Rows encoded at a time."""
_RECORD = "terratool", 1
"""User ID and record ID of the variable length record of names."""
_DIMENSIONS = {
    "gps_time": "time", "range": "range", "surface": NAMED,
    "classification": "class", "withheld": "withheld",
}  # fmt: skip
"""Columns by dimension name, in LAS or in files of this module."""

# ASPRS, LAS 1.4 R15, table 3: header size, offset of the points, number of variable length records,
# format, size and number of points; then the 64-bit number of points of version 1.4
_fields = struct.Struct("<4s20x2B68xHIIBHI")
_count = struct.Struct("<247xQ")
_extended_fields = struct.Struct("<235xQI")
_extended_head = struct.Struct("<2x16sHQ32x")
_PROJECTION = "LASF_Projection"
"""User ID of the records of reference systems."""
_WKT, _GEO_KEYS = 2112, 34735
_SYSTEM_KEYS = 3072, 2048
"""GeoTIFF keys of the code of a projected, and of a geographic system."""
_USER_DEFINED = 32767
_MOST_EXTENDED = 1000
_MOST_WKT = 1 << 20
"""Most bytes of a reference system that are read behind the points."""


class _Claims(NamedTuple):
    """Fields of a LAS header that the file size bounds.

    Attributes:
        magic: file signature.
        major, minor: version of LAS.
        header: size of the header, bytes.
        offset: offset of the points, bytes.
        records: number of variable length records.
        form: point format; the bits `_PACKED` mark LAZ.
        size: size of a point, bytes.
        points: number of points.
    """

    magic: bytes
    major: int
    minor: int
    header: int
    offset: int
    records: int
    form: int
    size: int
    points: int


def read_points(path: Path, wanted: Wanted) -> Iterator[PointBatch]:
    """Read points of LAS or LAZ, with the extra columns and names of files of `write_points`.

    Raises:
        ReadError: the file is no LAS, or its header claims more than the file has.
    """
    with _open(path) as file:
        names: tuple[str, ...] = ()
        for record in file.header.vlrs:
            if (record.user_id, record.record_id) == _RECORD:
                text = record.record_data_bytes().decode("utf-8", "replace")
                names = check_names(path, text.split("\n"))
        held = {*file.header.point_format.dimension_names}
        for points in file.batches(BATCH):
            with np.errstate(all="ignore"):  # NaN is left out later
                columns: Columns = {name: np.asarray(getattr(points, name)) for name in "xyz"}
                for dimension, name in _DIMENSIONS.items():
                    if dimension in held and name in wanted:
                        columns[name] = np.asarray(points[dimension])
            if any(column.ndim != 1 for column in columns.values()):
                raise ReadError(f"{path}: has a column of several numbers a point.", DAMAGED)
            yield PointBatch(columns, names)


def read_system(path: Path) -> str:
    """Reference system that the header of LAS or LAZ states, as WKT or EPSG:N; empty for none.

    A WKT record counts before GeoTIFF keys, of which the code of the system is read (ASPRS, LAS 1.4
    R15, "Coordinate Reference System Representation"; GeoTIFF 1.0, section 6.2).

    Raises:
        ReadError: the file is no LAS, or its header claims more than the file has.
    """
    with open_file(path) as file:
        claims = _read_claims(path, file)
        file.seek(0)
        with _silent_log():
            header = _header(path, file)
        records = [*header.vlrs, *_extended(file, claims)]
    texts = {record.record_id: record for record in records if record.user_id == _PROJECTION}
    if _WKT in texts:
        return _bytes_of(texts[_WKT]).split(b"\0")[0].decode("utf-8", "replace").strip()
    if _GEO_KEYS in texts:
        data = _bytes_of(texts[_GEO_KEYS])
        keys = dict(struct.unpack_from("<H4xH", data, at) for at in range(8, len(data) - 7, 8))
        for key in _SYSTEM_KEYS:
            if 0 < keys.get(key, 0) < _USER_DEFINED:
                return f"EPSG:{keys[key]}"
    return ""


class _Record(NamedTuple):
    """Extended variable length record of a projection."""

    user_id: str
    record_id: int
    data: bytes


def _extended(file: BufferedReader, claims: _Claims) -> Iterator[_Record]:
    """Yield the records of the projection that stand behind the points of LAS 1.4."""
    file.seek(0)
    head = file.read(_extended_fields.size)
    if claims.minor < 4 or len(head) < _extended_fields.size:
        return
    at, count = _extended_fields.unpack(head)
    size = os.fstat(file.fileno()).st_size
    for _ in range(min(count, _MOST_EXTENDED)):
        if not claims.offset <= at <= size - _extended_head.size:
            return
        file.seek(at)
        user, number, length = _extended_head.unpack(file.read(_extended_head.size))
        if user.rstrip(b"\0") == _PROJECTION.encode() and number == _WKT:
            yield _Record(_PROJECTION, number, file.read(min(length, _MOST_WKT)))
        at += _extended_head.size + length


def _bytes_of(record: Any) -> bytes:
    """Bytes of a record, of whichever class laspy made it."""
    return record.data if isinstance(record, _Record) else bytes(record.record_data_bytes())


class _OpenPoints:
    """Point records of an open LAS or unpacked LAZ.

    Attributes:
        header: laspy's header.
    """

    def __init__(self, path: Path, header: Any, count: int, source: IO[bytes]) -> None:
        self.header = header
        self._path, self._count, self._source = path, count, source

    def batches(self, most: int) -> Iterator[Any]:
        """Yield all points as laspy's scaling records, at most `most` at a time.

        Raises:
            ReadError: the file has fewer points than its header says.
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
    """Open LAS or LAZ for the block.

    LAZ is unpacked in a child process: lazrs trusts the sizes in a broken file, and aborts the
    process when memory runs out.

    Raises:
        ReadError: the file is no LAS, or its header claims more than the file has.
    """
    with open_file(path) as file:
        claims = _read_claims(path, file)
        file.seek(0)
        with _silent_log():
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


def _read_claims(path: Path, file: BufferedReader) -> _Claims:
    """Read the claims of a header and check them against the file size.

    Raises:
        ReadError: the file is no LAS, or too small for its claims.
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
    """Read laspy's header, with the variable length records.

    Raises:
        ReadError: the header or a record is broken.
    """
    import laspy

    try:
        header = laspy.LasHeader.read_from(file)
        header.point_format.dtype()  # raises for a broken point format
    except MemoryError:
        raise
    except Exception as error:  # laspy validates nothing, and raises errors of many types
        raise ReadError(
            f"{path}: its header is no LAS's ({short_text(error)}).", DAMAGED
        ) from error
    return header


@contextlib.contextmanager
def _silent_log() -> Iterator[None]:
    """Silence laspy's log in the block."""
    log = logging.getLogger("laspy")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(level)


def unpack() -> None:
    """Write the unpacked points of the LAZ that the command line names to standard output."""
    import laspy

    limit_memory(_APART_BYTES)
    with (
        _silent_log(),
        laspy.open(
            open_file(sys.argv[1]), laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False
        ) as file,
    ):
        many = max(1, _BATCH_BYTES // file.header.point_format.size)
        for points in file.chunk_iterator(many):
            sys.stdout.buffer.write(points.array.tobytes())
    sys.stdout.flush()
    os._exit(0)  # skips the slow cleanup of the library


@dataclass(frozen=True, slots=True)
class LasHeader:
    """Texts of a LAS besides its points.

    Attributes:
        system: system identifier, the instrument that measured the points.
        names: names by the index in the column `NAMED`.
        wkt: reference system of the points as WKT; empty for none.
        extra: descriptions of the extra columns by name, of 32 characters at most.
    """

    system: str
    names: tuple[str, ...] = ()
    wkt: str = ""
    extra: Mapping[str, str] = field(default_factory=dict)


def write_points(
    path: Path, batches: Iterable[NDArray[Any]], kind: np.dtype[Any], said: LasHeader
) -> None:
    """Write LAS 1.4 of point format 6, or LAZ by the suffix; each point is its ray's only return.

    Names are lines of a variable length record. Offsets are whole numbers below all points.

    Args:
        path: file to write.
        batches: rows of points, (n,) of `kind`.
        kind: fields x, y, z, others of format 6 by laspy's names, and the extra ones.
        said: texts of the header.
    """
    import laspy

    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = datetime.date(1980, 1, 1)  # no clock
    header.generating_software = "terratool"
    header.system_identifier = said.system
    header.global_encoding.wkt = True  # required by formats 6 and up, even without a WKT
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
                file.write_points(_las_record(rows, header))


def _las_record(rows: NDArray[Any], header: Any) -> Any:
    """Convert rows to laspy's point record, with the scales and offsets of a header."""
    import laspy

    points: Any = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
    points.return_number[:] = points.number_of_returns[:] = 1
    for name in rows.dtype.names or ():
        if name in ("x", "y", "z"):
            setattr(points, name, rows[name])
        else:
            points[name] = rows[name]
    return points
