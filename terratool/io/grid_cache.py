"""Cache of unpacked grids of heights: files that processes map, in a folder of the user.

A file has a head, the heights row by row from the north, and a checksum of each piece of them. It
appears whole or not at all, is never changed, and is named after the raster and its state. Those
least recently used go when all take more than `MOST_BYTES`.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import stat
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import msgspec
from msgspec import Struct

from terratool.definition.grid_files import GridSource
from terratool.errors import WriteError
from terratool.output import free_bytes, os_errors, whole_file

MOST_BYTES = 8 << 30
"""Most bytes of all files of the cache together; one that is larger stands alone."""
_ENDING = ".grid"
_MAGIC = b"terratool grid 1\n"
_PAGE = 4096
"""Divisor of the offset at which heights begin, for maps."""
PIECE = 1 << 22
"""Bytes of heights with one checksum."""
_CHECKED = 4 * PIECE
"""Most bytes of heights that are checked whole when they are mapped."""
_SPARE = 512
"""Bytes that numbers in a head may grow by when they become known."""


class GridFacts(Struct, frozen=True):
    """Facts on the heights of a grid.

    Attributes:
        source: band that they come from.
        single: whether they are float32, else float64.
        low: least height; 0 where there is none.
        high: greatest height; 0 where there is none.
        voids: whether some are void, NaN.
        edged: whether some on the rim are void, or other than 0.
    """

    source: GridSource
    single: bool
    low: float
    high: float
    voids: bool
    edged: bool

    @property
    def nbytes(self) -> int:
        """Bytes of all heights."""
        return self.source.columns * self.source.rows * (4 if self.single else 8)


class _Head(Struct, frozen=True):
    """Head of a file of the cache: facts, their checksum, and that of the checksums of pieces."""

    facts: GridFacts
    pieces: int


class MappedGrid(NamedTuple):
    """Heights of a grid in memory, or in a file that is mapped.

    Attributes:
        data: (bytes,) uint8, numbers row by row from the north.
        facts: what is known of them.
    """

    data: Any
    facts: GridFacts


def folder() -> Path:
    """Return the folder of the cache, which may not exist.

    Raises:
        WriteError: the system knows no home.
    """
    named = os.environ.get("XDG_CACHE_HOME", "")
    try:
        base = Path(named) if named.startswith("/") else Path.home() / ".cache"
    except RuntimeError as error:
        raise WriteError(
            "There is no home for a cache.", "Name a folder by the variable XDG_CACHE_HOME."
        ) from error
    return base / "terratool" / "grids"


def _is_ours(status: os.stat_result, forbidden: int) -> bool:
    """Whether a file or folder belongs to this user, and others do not have forbidden rights."""
    mine = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
    return mine and not status.st_mode & forbidden


def _own_folder(make: bool = False) -> Path | None:
    """Return the folder of the cache; None where there is none that is this user's alone."""
    try:
        place = folder()
        if make:
            place.mkdir(0o700, parents=True, exist_ok=True)
        status = place.lstat()
    except (OSError, WriteError):
        return None
    return place if stat.S_ISDIR(status.st_mode) and _is_ours(status, 0o077) else None


class _Opened(NamedTuple):
    """File of the cache that is open, its head, and the offset of its heights."""

    file: BinaryIO
    head: _Head
    begin: int


@contextlib.contextmanager
def _opened(key: str) -> Iterator[_Opened | None]:
    """Open a file of the cache for the block; None where there is none that is whole and ours."""
    place = _own_folder()
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        number = -1 if place is None else os.open(place / (key + _ENDING), flags)
    except OSError:
        number = -1
    if number < 0:
        yield None
        return
    with open(number, "rb") as file:
        try:
            yield _read_head(file)
        except OSError:
            yield None


def _read_head(file: BinaryIO) -> _Opened | None:
    """Read the head of a file; None where the file is not whole, or not this user's."""
    status = os.fstat(file.fileno())
    if not stat.S_ISREG(status.st_mode) or not _is_ours(status, 0o022):
        return None
    first = file.read(len(_MAGIC) + 8)
    length = int.from_bytes(first[len(_MAGIC) : -4], "little")
    if not first.startswith(_MAGIC) or length > status.st_size:
        return None
    text = file.read(length)
    if zlib.crc32(text) != int.from_bytes(first[-4:], "little"):
        return None
    try:
        head = msgspec.json.decode(text.rstrip(), type=_Head)
    except msgspec.MsgspecError:  # of another version
        return None
    begin, size = _begin(length), head.facts.nbytes
    whole = status.st_size == begin + size + 4 * _pieces(size)
    return _Opened(file, head, begin) if whole else None


def _begin(length: int) -> int:
    """Offset of the heights behind a head of a length."""
    return -(-(len(_MAGIC) + 8 + length) // _PAGE) * _PAGE


def _pieces(size: int) -> int:
    return -(-size // PIECE)


def facts(key: str) -> GridFacts | None:
    """Return what is known of the heights of a key; None where they are not in the cache."""
    with _opened(key) as found:
        return None if found is None else found.head.facts


def mapped(key: str) -> MappedGrid | None:
    """Map the heights of a key; None where they are not in the cache, or are damaged there."""
    with _opened(key) as found:
        if found is None:
            return None
        grid = _map(found)
        if grid is not None:
            with contextlib.suppress(OSError):
                os.utime(found.file.fileno())
        return grid


def _map(found: _Opened) -> MappedGrid | None:
    """Map the heights of an open file; None where checksums do not agree."""
    import numpy as np

    size = found.head.facts.nbytes
    try:
        bytes_ = np.frombuffer(mmap.mmap(found.file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)
    except (OSError, ValueError):
        return None
    data, sums = bytes_[found.begin :][:size], bytes_[found.begin + size :].tobytes()
    if zlib.crc32(sums) != found.head.pieces:
        return None
    if size <= _CHECKED and _sums(data) != sums:
        return None
    return MappedGrid(data, found.head.facts)


def _sums(data: Any) -> bytes:
    """Checksums of the pieces of heights."""
    return b"".join(
        zlib.crc32(data[at : at + PIECE]).to_bytes(4, "little") for at in range(0, len(data), PIECE)
    )


Put = Callable[[int, bytes | memoryview], None]
"""Function that writes bytes at an offset among the heights."""


def keep(key: str, expected: GridFacts, write: Callable[[Put], GridFacts]) -> MappedGrid | None:
    """Write heights into the cache, and map them; None where the cache cannot have them.

    Args:
        key: name of the heights.
        expected: facts on the heights, of which the range is not yet known.
        write: function that writes all heights, and returns the facts on them.
    """
    place = _own_folder(make=True)
    if place is None:
        return None
    try:
        if free_bytes(place) < 2 * expected.nbytes:
            return None
        with whole_file(place / (key + _ENDING), overwrite=True, named=False) as part:
            _write(part, expected, write)
        _trim(place, key + _ENDING)
    except (OSError, WriteError):
        return None
    return mapped(key)


def _write(part: Path, expected: GridFacts, write: Callable[[Put], GridFacts]) -> None:
    """Write a file of the cache."""
    length, size = len(msgspec.json.encode(expected)) + _SPARE, expected.nbytes
    begin = _begin(length)
    number = os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    with open(number, "r+b") as file:

        def put(at: int, data: bytes | memoryview) -> None:
            file.seek(begin + at)
            file.write(data)

        found = write(put)
        file.flush()
        sums = b""
        file.seek(begin)
        for at in range(0, size, PIECE):
            sums += zlib.crc32(file.read(min(PIECE, size - at))).to_bytes(4, "little")
        file.seek(begin + size)
        file.write(sums)
        text = msgspec.json.encode(_Head(found, zlib.crc32(sums))).ljust(length)
        file.seek(0)
        file.write(_MAGIC + length.to_bytes(4, "little") + zlib.crc32(text).to_bytes(4, "little"))
        file.write(text)


class CachedFile(NamedTuple):
    """File of the cache, its size in bytes, and when it was last used, ns."""

    path: Path
    nbytes: int
    used: int


def files() -> list[CachedFile]:
    """Return the files of the cache, the least recently used first."""
    place, found = _own_folder(), []
    with contextlib.suppress(OSError):
        for entry in os.scandir(place) if place is not None else ():
            if entry.name.endswith(_ENDING) and entry.is_file(follow_symlinks=False):
                status = entry.stat(follow_symlinks=False)
                found.append(CachedFile(Path(entry.path), status.st_size, status.st_mtime_ns))
    return sorted(found, key=lambda one: (one.used, one.path))


def _trim(place: Path, newest: str) -> None:
    """Remove the least recently used files beyond the size of the cache, but not the newest."""
    listed = files()
    total = sum(one.nbytes for one in listed)
    for one in listed:
        if total <= MOST_BYTES:
            return
        if one.path != place / newest:
            one.path.unlink(missing_ok=True)
            total -= one.nbytes


def clear() -> list[CachedFile]:
    """Remove all files of the cache, and return them.

    Raises:
        WriteError: a file cannot be removed.
    """
    listed = files()
    for one in listed:
        with os_errors(one.path):
            one.path.unlink(missing_ok=True)
    return listed
