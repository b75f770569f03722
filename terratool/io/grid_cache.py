"""Cache of unpacked grids of heights: files that processes map, in a folder of the user.

A file has a head, and the heights row by row from the north. It appears whole or not at all, is
never changed, and is named after the raster and its state. It is read against its checksum once,
and again when the file system says that it is another or was changed: a mark beside it keeps the
state in which it was found whole. Those least recently used go when all take more than
`MOST_BYTES`.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import shutil
import stat
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import msgspec
from msgspec import Struct

from terratool.definition.grid_files import GridSource
from terratool.errors import WriteError
from terratool.io.grid_blocks import GridBlocks
from terratool.output import PART, free_bytes, is_being_written, os_errors, whole_file

MOST_BYTES = 8 << 30
"""Most bytes of all files of the cache together, and of one of them."""
_ENDING = ".grid"
_MARK = ".whole"
"""Ending, after the name of a file, of its mark."""
_MAGIC = b"terratool grid 2\n"
_PAGE = 4096
"""Divisor of the offset at which heights begin, for maps."""
_PIECE = 1 << 20
"""Bytes that are read at a time for a checksum."""
_SETTLED = 2 * 10**9
"""Least time since the last change of a file, ns, after which it is marked: file systems count time
in steps of up to 2 s."""
_SPARE = 512
"""Bytes that numbers in a head may grow by when they become known."""
_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
_MAKE = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_NOFOLLOW", 0)


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
    """Head of a file of the cache: facts on the heights, and the checksum of these."""

    facts: GridFacts
    sum: int


class MappedGrid(NamedTuple):
    """Heights of a grid in memory, or in a file that is mapped.

    Attributes:
        data: (bytes,) uint8, numbers row by row from the north.
        facts: what is known of them.
        blocks: reader of the blocks that are not yet in `data`; None where all are there.
    """

    data: Any
    facts: GridFacts
    blocks: GridBlocks | None = None


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
    """File of the cache that is open, its mark, its head, and the offset of its heights."""

    file: BinaryIO
    mark: Path
    head: _Head
    begin: int


def _open(key: str) -> _Opened | None:
    """Open a file of the cache; None where there is none that has a head and is this user's."""
    place = _own_folder()
    if place is None:
        return None
    with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
        path = place / (key + _ENDING)
        file = stack.enter_context(os.fdopen(os.open(path, _READ), "rb"))
        found = _read_head(file, path)
        if found is not None:
            stack.pop_all()
        return found
    return None


def _read_head(file: BinaryIO, path: Path) -> _Opened | None:
    """Read the head of a file; None where it has none, or is not this user's."""
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
    return _Opened(file, _mark_of(path), head, _begin(length))


def _mark_of(path: Path) -> Path:
    return path.with_name(path.name + _MARK)


def _begin(length: int) -> int:
    """Offset of the heights behind a head of a length."""
    return -(-(len(_MAGIC) + 8 + length) // _PAGE) * _PAGE


def facts(key: str) -> GridFacts | None:
    """Return what is known of the heights of a key; None where they are not in the cache."""
    found = _open(key)
    if found is None:
        return None
    with found.file:
        return found.head.facts


def mapped(key: str) -> MappedGrid | None:
    """Map the heights of a key; None where they are not in the cache, or are damaged there."""
    import numpy as np

    found = _open(key)
    if found is None:
        return None
    with found.file as file:
        try:
            if not _is_marked(found) and not _is_whole(found):
                return None
            memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError):
            return None
    return MappedGrid(np.frombuffer(memory, np.uint8)[found.begin :], found.head.facts)


class _State(NamedTuple):
    """State of a file that tells whether it is the same one, and was not changed since."""

    device: int
    inode: int
    size: int
    modified: int
    changed: int

    @classmethod
    def of(cls, file: BinaryIO) -> _State:
        """State of an open file."""
        now = os.fstat(file.fileno())
        return cls(now.st_dev, now.st_ino, now.st_size, now.st_mtime_ns, now.st_ctime_ns)


def _is_marked(found: _Opened) -> bool:
    """Whether the mark of a file says that it was whole in its state; the mark is used now."""
    try:
        with os.fdopen(os.open(found.mark, _READ), "rb") as mark:
            status = os.fstat(mark.fileno())
            if not stat.S_ISREG(status.st_mode) or not _is_ours(status, 0o022):
                return False
            if mark.read(_PAGE) != msgspec.json.encode(_State.of(found.file)):
                return False
            with contextlib.suppress(OSError):
                os.utime(mark.fileno())
    except OSError:
        return False
    return True


def _is_whole(found: _Opened) -> bool:
    """Whether the heights of an open file have their checksum; if so, it is marked."""
    state, now = _State.of(found.file), time.time_ns()
    if _sum(found.file, found.begin) != found.head.sum:
        return False
    # a change soon after another one may have the same time
    if now - max(state.modified, state.changed) > _SETTLED:
        with (
            contextlib.suppress(OSError),  # without a mark it is read again
            os.fdopen(os.open(found.mark, _MAKE, 0o600), "wb") as mark,
        ):
            mark.write(msgspec.json.encode(state))
    return True


def _sum(file: BinaryIO, begin: int) -> int:
    """Checksum of a file from an offset to its end."""
    found = 0
    file.seek(begin)
    while piece := file.read(_PIECE):
        found = zlib.crc32(piece, found)
    return found


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
    if place is None or expected.nbytes > MOST_BYTES:
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
    length = len(msgspec.json.encode(expected)) + _SPARE
    begin = _begin(length)
    number = os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    with open(number, "r+b") as file:

        def put(at: int, data: bytes | memoryview) -> None:
            file.seek(begin + at)
            file.write(data)

        found = write(put)
        file.flush()
        text = msgspec.json.encode(_Head(found, _sum(file, begin))).ljust(length)
        file.seek(0)
        file.write(_MAGIC + length.to_bytes(4, "little") + zlib.crc32(text).to_bytes(4, "little"))
        file.write(text)


class CachedFile(NamedTuple):
    """File of the cache, its size in bytes, and when it was last used, ns.

    What a process left behind that was killed as it wrote is a folder.
    """

    path: Path
    nbytes: int
    used: int


def files() -> list[CachedFile]:
    """Return the files of the cache, the least recently used first.

    What a running process of this machine is writing is none of them.
    """
    place, found = _own_folder(), []
    with contextlib.suppress(OSError):
        for path in place.iterdir() if place is not None else ():
            left = path.name.startswith(PART) and not is_being_written(path.name)
            if left or path.name.endswith(_ENDING):
                with contextlib.suppress(FileNotFoundError):
                    found.append(_listed(path))
    return sorted(found, key=lambda one: (one.used, one.path))


def _listed(path: Path) -> CachedFile:
    """File of the cache, with what is in it where it is a folder."""
    mark = _mark_of(path)
    inside = path.rglob("*") if path.is_dir() and not path.is_symlink() else ()
    size = sum(one.lstat().st_size for one in (path, *inside) if not one.is_dir())
    return CachedFile(path, size, (mark if mark.exists() else path).lstat().st_mtime_ns)


def _remove(one: CachedFile) -> None:
    """Remove a file of the cache with its mark."""
    if one.path.is_dir() and not one.path.is_symlink():
        shutil.rmtree(one.path)
        return
    one.path.unlink(missing_ok=True)
    _mark_of(one.path).unlink(missing_ok=True)


def _trim(place: Path, newest: str) -> None:
    """Remove the least recently used files beyond the size of the cache, but not the newest."""
    listed = files()
    total = sum(one.nbytes for one in listed)
    for one in listed:
        if total <= MOST_BYTES:
            return
        if one.path != place / newest:
            _remove(one)
            total -= one.nbytes


def clear() -> list[CachedFile]:
    """Remove all files of the cache, and return them.

    Raises:
        WriteError: a file cannot be removed.
    """
    listed = files()
    for one in listed:
        with os_errors(one.path):
            _remove(one)
    return listed
