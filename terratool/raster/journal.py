"""The journal of a mosaic: which of its tiles are finished, in lines that are whole or ignored.

The first line says what the mosaic is of, each other one what was finished: a tile, or an index
that is about to be written. A line is a list of a checksum and the text that it is of, so that a
line that was torn, or changed later, does not count. Only one process at a time writes it.
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

_HINT = "Choose another folder, or add --overwrite to begin anew."


class Journal:
    """An open journal.

    Attributes:
        known: the finished tiles by row and column.
        indexes: checksums of the indexes by name, as seen from the folder.
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
            # what is not whole, or says something else, is as good as not there
            with contextlib.suppress(
                ValueError, TypeError, KeyError, RecursionError, msgspec.MsgspecError
            ):
                self._take(_entry_of(line))

    def _take(self, entry: dict[str, Any]) -> None:
        if "mosaic" in entry:
            self.header = dict(entry["mosaic"])
        elif "tile" in entry:
            finished = _finished(entry)
            self.known[finished.row, finished.column] = finished
        else:
            self.indexes[str(entry["index"])] = str(entry["checksum"])

    def begin(self, overwrite: bool) -> Path:
        """Be ready for entries, in a folder that is made if need be.

        What an earlier run was in the middle of is removed; if this one begins anew, so are its
        tiles and indexes, and nothing else.

        Returns:
            A folder in that of the mosaic for what is not yet complete.
        """
        with _sentences(self._folder):
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
        """Have a journal with its first line alone; it appears with that line whole."""
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
                if os.name == "nt":  # where an open file cannot be replaced, and none is locked
                    old.close()
                (part / NAME).replace(path)
        self._end = len(line)
        self._file = open(path, "r+b")  # noqa: SIM115 # close() does
        try:
            _lock(self._file, self._folder)
        finally:
            if old is not None:  # it was locked until now
                old.close()

    def _clear(self) -> None:
        for name, known in self.indexes.items():
            path = self._folder / name
            own = not path.is_symlink() and path.is_file() and checksum(path) == known
            if own and _is_index_of(path, self._folder):  # anyone may have written the journal
                path.unlink()
        for path in owned(self._folder):
            path.unlink()
        self.known, self.indexes = {}, {}

    def add_tile(self, finished: FinishedTile) -> None:
        """Note that a tile is finished; it is on the disk when this returns."""
        statistics = msgspec.msgpack.encode(finished.statistics, enc_hook=_encoded)
        self._add(
            {
                "tile": [finished.row, finished.column],
                "files": [[file.name, file.size, file.checksum] for file in finished.files],
                "tally": base64.b64encode(statistics).decode(),
            }
        )

    def add_index(self, name: str, known: str) -> None:
        """Note that an index with this checksum is about to be written."""
        if self.indexes.get(name) != known:
            self.indexes[name] = known
            self._add({"index": name, "checksum": known})

    def _add(self, entry: dict[str, Any]) -> None:
        with _sentences(self._folder):
            assert self._file is not None
            self._file.write(_line_of(entry))
            self._file.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Let other processes write it."""
        if self._file is not None:
            self._file.close()


@contextlib.contextmanager
def journal_of(folder: Path, request: dict[str, Any], overwrite: bool) -> Iterator[Journal]:
    """The journal of a folder, which nobody else can open meanwhile; nothing is written yet.

    Args:
        folder: of the mosaic; need not exist.
        request: what the mosaic is to be of, ready for JSON.
        overwrite: whether another mosaic may be there.

    Raises:
        WriteError: there is, or tiles that no journal tells of, or another process at work.
    """
    if folder.exists() and not folder.is_dir():
        raise WriteError(f"{folder}: is no folder.", "Give the name of one for the tiles.")
    refuse_missing_folder(folder)
    with _sentences(folder):
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
        for path in owned(folder):
            raise WriteError(f"{path}: exists already, but no journal tells of it.", _HINT)
    elif not journal.known and not any(owned(folder)):
        journal.header = None  # of a run that came to nothing
    else:
        for key, value in request.items():
            if journal.header.get(key) != value:
                raise WriteError(f"{folder}: holds a mosaic with another {key}.", _HINT)


def owned(folder: Path) -> Iterator[Path]:
    """Files in a folder, and links, that have the names of tiles or indexes, or belong to such."""
    if folder.is_dir():
        with os.scandir(folder) as entries:
            for entry in entries:
                is_file = entry.is_file(follow_symlinks=False) or entry.is_symlink()
                if OWNED.fullmatch(entry.name) and is_file:
                    yield folder / entry.name


def _no_link(path: str, flags: int) -> int:
    """Open a file, but not what a link leads to."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0))


def _is_index_of(path: Path, folder: Path) -> bool:
    """Whether a file is an index of a mosaic whose tiles are in a folder."""
    tiles = Path(os.path.relpath(folder.resolve(), path.resolve().parent)) / "tile-"
    return f'relativeToVRT="1">{escape(tiles.as_posix())}'.encode() in path.read_bytes()


def _line_of(entry: dict[str, Any]) -> bytes:
    """A line with an entry."""
    text = json.dumps(entry, ensure_ascii=False)
    return json.dumps([zlib.crc32(text.encode()), text]).encode() + b"\n"


def _put_new(part: Path, path: Path) -> None:
    """Have a file appear under a name that is free.

    Raises:
        FileExistsError: it is not.
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
    """The entry of a line.

    Raises:
        ValueError, TypeError: the line is not whole.
    """
    known, text = json.loads(line)
    if zlib.crc32(str(text).encode()) != known:
        raise ValueError
    return dict(json.loads(text))


def _finished(entry: dict[str, Any]) -> FinishedTile:
    statistics = msgspec.msgpack.decode(
        base64.b64decode(entry["tally"]), type=RasterStatistics, dec_hook=_decoded
    )
    row, column = entry["tile"]
    return FinishedTile(row, column, tuple(FileState(*file) for file in entry["files"]), statistics)


def _encoded(value: Any) -> Any:
    """What msgspec does not know, in terms that it does."""
    if isinstance(value, np.ndarray):
        return [value.dtype.str, value.shape, value.tobytes()]
    return plain(value)


def _decoded(_type: Any, value: Any) -> Any:
    dtype, shape, content = value
    return np.frombuffer(content, dtype).reshape(shape)


def _lock(file: BinaryIO, folder: Path) -> None:
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
    """Refuse a journal in whose place another one has come before it was locked."""
    with _sentences(folder):
        if not os.path.samestat(os.fstat(file.fileno()), os.lstat(folder / NAME)):
            raise FileExistsError(errno.EEXIST, "exists", str(folder))


@contextlib.contextmanager
def _sentences(folder: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError as error:
        raise WriteError(
            f"{folder}: another process has just begun a mosaic there.",
            "Wait until it is done, or choose another folder.",
        ) from error
    except OSError as error:
        raise WriteError.of(folder, error) from error
