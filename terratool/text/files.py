"""Opening files of others for reading, so that none of them blocks a command."""

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
    """Open a regular file for reading; refuse pipes, sockets and devices unless a user named them.

    A pipe without a writer blocks for ever, and some devices never end. A file that a command finds
    in a folder, in a list of another file or behind a watch is therefore checked to be regular,
    before and after it is opened.

    Args:
        path: the file; links are followed.
        named: whether a user named the file, on the command line or from Python. Then a pipe is
            waited for, as ``<(…)`` of a shell is one, and a terminal and the null device are read.

    Raises:
        OSError: the file cannot be opened, or is a pipe, a socket or a device.
        ValueError: the path is no file name.
    """
    _refuse(Path(path).stat(), named)  # before opening, which makes some devices act
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
    """Read at most so many bytes of an open file, without allocating more than they take.

    Args:
        file: open file, read to its end or to the limit.
        most: limit in bytes.

    Raises:
        OSError: the file cannot be read, or has no data yet, as some files of the kernel.
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
    """Tell whether a path leads to a regular file, without opening it."""
    return stat.S_ISREG(_mode(path))


def is_pipe(path: str | Path) -> bool:
    """Tell whether a path leads to a pipe, without opening it."""
    return stat.S_ISFIFO(_mode(path))


def _mode(path: str | Path) -> int:
    """Return the mode of the file that a path leads to, as `stat` gives it; 0 if there is none."""
    try:
        return Path(path).stat().st_mode
    except (OSError, ValueError):
        return 0


def _refuse(found: os.stat_result, named: bool) -> None:
    """Refuse a file that is not regular, unless it is a pipe or terminal that a user named."""
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
