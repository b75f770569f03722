"""Files of others, opened for reading in a way that none of them holds a command up."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

_AT_ONCE = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
_STEP = 1 << 20
_KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


def open_file(path: str | Path, *, named: bool = False) -> BufferedReader:
    """Open a file for reading, and nothing that is none.

    A pipe never begins where nobody writes into it, and some devices never end. What a command
    meets in a folder, in a list of another file or behind a watch is therefore a regular file,
    before and after it is opened, or is refused.

    Args:
        path: the file, links followed.
        named: whether a user named it, on the command line or from Python: then a pipe is waited
            for, as ``<(…)`` of a shell is one, and a terminal and the null device are read.

    Raises:
        OSError: it cannot be opened, or is a pipe, a socket or a device.
        ValueError: it is no name of a file.
    """
    _refuse(Path(path).stat(), named)  # as opening alone makes some devices act
    flags = 0 if named else _AT_ONCE
    file = open(path, "rb", opener=lambda name, mode: os.open(name, mode | flags))  # noqa: SIM115
    try:
        found = os.fstat(file.fileno())
        _refuse(found, named)
        if stat.S_ISCHR(found.st_mode) and not (file.isatty() or _is_null(found)):
            raise _no_file("a device")
    except OSError:
        file.close()
        raise
    return file


def read_up_to(file: BufferedReader, most: int) -> bytes:
    """The bytes of an open file, of which no more memory is asked for than they take.

    Args:
        file: which is read to its end, or to so many bytes.
        most: how many.

    Raises:
        OSError: it cannot be read, or has nothing to say yet, as some files of the kernel.
    """
    parts: list[bytes] = []
    left, step = most, os.fstat(file.fileno()).st_size + 1
    while left > 0:
        part = file.read(min(left, step))
        if part is None:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        if not part:
            break
        parts.append(part)
        left, step = left - len(part), max(step, _STEP)
    return b"".join(parts)


def is_regular(path: str | Path) -> bool:
    """Whether a path leads to a regular file; it is not opened."""
    return stat.S_ISREG(_mode(path))


def is_pipe(path: str | Path) -> bool:
    """Whether a path leads to a pipe; it is not opened."""
    return stat.S_ISFIFO(_mode(path))


def _mode(path: str | Path) -> int:
    """What a path leads to, as `stat` has it; 0 where that is nothing."""
    try:
        return Path(path).stat().st_mode
    except (OSError, ValueError):
        return 0


def _refuse(found: os.stat_result, named: bool) -> None:
    """Refuse what is no regular file, but for what may be meant if a user named it."""
    kind = stat.S_IFMT(found.st_mode)
    if kind == stat.S_IFREG or (named and kind in (stat.S_IFIFO, stat.S_IFCHR)):
        return
    if kind == stat.S_IFDIR:
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise _no_file(_KINDS.get(kind, "a device"))


def _no_file(what: str) -> OSError:
    return OSError(errno.EINVAL, f"it is {what}, and no regular file")


def _is_null(found: os.stat_result) -> bool:
    return found.st_rdev == Path(os.devnull).stat().st_rdev
