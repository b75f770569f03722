"""Journal of a mosaic: its finished tiles, in lines with checksums.

The first line holds the request, each other one a finished tile or an index about to be written. A
line is a JSON list of a CRC-32 and the text of an entry; torn or altered lines are ignored. Only
one process at a time writes a journal.
"""

from __future__ import annotations

import base64
import contextlib
import errno
import json
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO
from xml.sax.saxutils import escape

import msgspec
import numpy as np

from terratool.errors import WriteError
from terratool.output import part_folder, refuse_missing_folder
from terratool.raster.statistics import RasterStatistics
from terratool.raster.tiles import (
    OWNED,
    SCRATCH,
    FileState,
    FinishedTile,
    checksum,
    remove_scratch,
    scratch_in,
)
from terratool.report.documents import plain

NAME = "mosaic.journal"
"""Name of the journal in the folder of the tiles."""

_HINT = "Choose another folder, or add --overwrite to begin anew."


class Journal:
    """Open journal of a mosaic.

    Attributes:
        header: request of the mosaic; None for a journal without a valid first line.
        known: finished tiles by row and column.
        indexes: checksums of the indexes by path relative to the folder.
    """

    def __init__(self, folder: Path, file: BinaryIO | None, request: dict[str, Any]) -> None:
        self._folder, self._file, self._request = folder, file, request
        self.header: dict[str, Any] | None = None
        self.known: dict[tuple[int, int], FinishedTile] = {}
        self.indexes: dict[str, str] = {}
        self._end = 0
        if file is not None:
            self._read(file)

    def _read(self, file: BinaryIO) -> None:
        for line in file:
            if line.endswith(b"\n"):
                self._end += len(line)
            # torn or foreign lines are ignored
            with contextlib.suppress(
                ValueError, TypeError, KeyError, RecursionError, msgspec.MsgspecError
            ):
                self._take(_entry_of(line))

    def _take(self, entry: dict[str, Any]) -> None:
        if "mosaic" in entry:
            self.header = dict(entry["mosaic"])
        elif "tile" in entry:
            finished = _tile_of(entry)
            self.known[finished.row, finished.column] = finished
        else:
            self.indexes[str(entry["index"])] = str(entry["checksum"])

    def begin(self, overwrite: bool) -> Path:
        """Prepare the folder, which is made if missing, and the journal for new entries.

        Scratch folders of earlier runs are removed; with `overwrite`, or without a valid journal,
        also their tiles and indexes, and nothing else.

        Returns:
            A new folder, in that of the mosaic, for unfinished files.
        """
        with _os_errors(self._folder):
            self._folder.mkdir(exist_ok=True)
            if overwrite or self.header is None:
                self._clear()
                self._begin_anew()
            assert self._file is not None
            self._file.truncate(self._end)
            self._file.seek(self._end)
            for left in self._folder.glob(f"{SCRATCH}*.part"):
                remove_scratch(left)
            scratch = scratch_in(self._folder)
            scratch.mkdir()
        return scratch

    def _begin_anew(self) -> None:
        """Replace the journal by one of the first line alone, in one step."""
        path, old = self._folder / NAME, self._file
        line = _line_of({"mosaic": self._request})
        with part_folder(self._folder) as part:
            with open(part / NAME, "xb") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
            if old is None:
                _put_new(part / NAME, path)
            else:
                if os.name == "nt":  # Windows cannot replace an open file, and locks none
                    old.close()
                (part / NAME).replace(path)
        self._end = len(line)
        self._file = open(path, "r+b")  # noqa: SIM115 # close() does
        try:
            _lock(self._file, self._folder)
        finally:
            if old is not None:  # keeps its lock until the new one is locked
                old.close()

    def _clear(self) -> None:
        """Remove the tiles and indexes of an earlier run."""
        for name, known in self.indexes.items():
            path = self._folder / name
            own = not path.is_symlink() and path.is_file() and checksum(path) == known
            if own and _is_index_of(path, self._folder):  # the journal may be forged
                path.unlink()
        for path in own_files(self._folder):
            path.unlink()
        self.known, self.indexes = {}, {}

    def add_tile(self, finished: FinishedTile) -> None:
        """Append a finished tile; the entry is on disk on return."""
        statistics = msgspec.msgpack.encode(finished.statistics, enc_hook=_encode)
        self._add(
            {
                "tile": [finished.row, finished.column],
                "files": [[file.name, file.size, file.checksum] for file in finished.files],
                "tally": base64.b64encode(statistics).decode(),
            }
        )

    def add_index(self, name: str, known: str) -> None:
        """Append the checksum of an index that is about to be written."""
        if self.indexes.get(name) != known:
            self.indexes[name] = known
            self._add({"index": name, "checksum": known})

    def _add(self, entry: dict[str, Any]) -> None:
        with _os_errors(self._folder):
            assert self._file is not None
            self._file.write(_line_of(entry))
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close and unlock the journal."""
        if self._file is not None:
            self._file.close()


@contextlib.contextmanager
def journal_of(folder: Path, request: dict[str, Any], overwrite: bool) -> Iterator[Journal]:
    """Open and lock the journal of a folder for the block, without writing.

    Args:
        folder: folder of the mosaic; may be missing.
        request: everything that determines the mosaic, as plain JSON values.
        overwrite: whether to accept another mosaic in the folder.

    Raises:
        WriteError: the folder holds another mosaic, or tiles without a journal, or another process
            writes there.
    """
    if folder.exists() and not folder.is_dir():
        raise WriteError(f"{folder}: is no folder.", "Give the name of one for the tiles.")
    refuse_missing_folder(folder)
    with _os_errors(folder):
        path = folder / NAME
        file = None
        if path.is_symlink() or path.exists():
            file = open(path, "r+b", opener=_no_link)  # noqa: SIM115 # closed below
    try:
        if file is not None:
            _lock(file, folder)
            _refuse_replaced(file, folder)
        journal = Journal(folder, file, request)
    except BaseException:
        if file is not None:
            file.close()
        raise
    try:
        if not overwrite:
            _refuse_another(journal, folder, request)
        yield journal
    finally:
        journal.close()


def _refuse_another(journal: Journal, folder: Path, request: dict[str, Any]) -> None:
    if journal.header is None:
        for path in own_files(folder):
            raise WriteError(f"{path}: exists already, but no journal tells of it.", _HINT)
    elif not journal.known and not any(own_files(folder)):
        journal.header = None  # the earlier run finished nothing
    else:
        for key, value in request.items():
            if journal.header.get(key) != value:
                raise WriteError(f"{folder}: holds a mosaic with another {key}.", _HINT)


def own_files(folder: Path) -> Iterator[Path]:
    """Yield files and links in a folder with names of tiles, indexes or their sidecars."""
    if folder.is_dir():
        with os.scandir(folder) as entries:
            for entry in entries:
                is_file = entry.is_file(follow_symlinks=False) or entry.is_symlink()
                if OWNED.fullmatch(entry.name) and is_file:
                    yield folder / entry.name


def _no_link(path: str, flags: int) -> int:
    """Open a file unless it is a symbolic link."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0))


def _is_index_of(path: Path, folder: Path) -> bool:
    """Return whether a file is the index of a mosaic with tiles in a folder."""
    tiles = Path(os.path.relpath(folder.resolve(), path.resolve().parent)) / "tile-"
    return f'relativeToVRT="1">{escape(tiles.as_posix())}'.encode() in path.read_bytes()


def _line_of(entry: dict[str, Any]) -> bytes:
    """Line of an entry, with its checksum."""
    text = json.dumps(entry, ensure_ascii=False)
    return json.dumps([zlib.crc32(text.encode()), text]).encode() + b"\n"


def _put_new(part: Path, path: Path) -> None:
    """Move a file to a path that must not exist.

    Raises:
        FileExistsError: the path exists.
    """
    try:
        os.link(part, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        if path.exists():
            raise FileExistsError(errno.EEXIST, "exists", str(path)) from None
        part.replace(path)


def _entry_of(line: bytes) -> dict[str, Any]:
    """Parse the entry of a line.

    Raises:
        ValueError, TypeError: the line is torn or altered.
    """
    known, text = json.loads(line)
    if zlib.crc32(str(text).encode()) != known:
        raise ValueError
    return dict(json.loads(text))


def _tile_of(entry: dict[str, Any]) -> FinishedTile:
    """Decode the finished tile of an entry."""
    statistics = msgspec.msgpack.decode(
        base64.b64decode(entry["tally"]), type=RasterStatistics, dec_hook=_decode
    )
    row, column = entry["tile"]
    return FinishedTile(row, column, tuple(FileState(*file) for file in entry["files"]), statistics)


def _encode(value: Any) -> Any:
    """Encode an array as data type, shape and bytes, for msgspec."""
    if isinstance(value, np.ndarray):
        return [value.dtype.str, value.shape, value.tobytes()]
    return plain(value)


def _decode(_type: Any, value: Any) -> Any:
    """Decode an array of `_encode`."""
    dtype, shape, content = value
    return np.frombuffer(content, dtype).reshape(shape)


def _lock(file: BinaryIO, folder: Path) -> None:
    """Lock a journal against other processes, where the system has locks.

    Raises:
        WriteError: another process holds the lock.
    """
    try:
        import fcntl
    except ImportError:  # not there on Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise WriteError(
            f"{folder}: another process is writing this mosaic.",
            "Wait until it is done, or choose another folder.",
        ) from error
    except OSError:  # some network file systems have no locks
        return


def _refuse_replaced(file: BinaryIO, folder: Path) -> None:
    """Refuse a journal that another process replaced before it was locked."""
    with _os_errors(folder):
        if not os.path.samestat(os.fstat(file.fileno()), os.lstat(folder / NAME)):
            raise FileExistsError(errno.EEXIST, "exists", str(folder))


@contextlib.contextmanager
def _os_errors(folder: Path) -> Iterator[None]:
    """Turn operating system errors in the block into a WriteError."""
    try:
        yield
    except FileExistsError as error:
        raise WriteError(
            f"{folder}: another process has just begun a mosaic there.",
            "Wait until it is done, or choose another folder.",
        ) from error
    except OSError as error:
        raise WriteError.of(folder, error) from error
