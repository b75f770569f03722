"""Files appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from uuid import uuid4

from terratool.errors import WriteError


@contextlib.contextmanager
def whole_file(path: str | Path, overwrite: bool = False) -> Iterator[Path]:
    """A temporary path beside `path`, which takes its place when the block ends well.

    The temporary is removed on any failure, Ctrl-C, SIGTERM and SIGHUP included.

    Raises:
        WriteError: `path` exists and is not to be overwritten, or its folder cannot be written.
    """
    path = Path(os.path.realpath(path))  # behind a link stands what is meant
    refuse_existing(path, overwrite)
    if not path.parent.is_dir():
        raise WriteError(f"{path}: the folder {path.parent} does not exist.", "Create it first.")
    part = path.with_name(f".terratool-{uuid4().hex[:12]}.part")
    try:
        with _stop_on_signals():
            yield part
            with open(part, "rb+") as file:
                os.fsync(file.fileno())
            part.replace(path)
    except OSError as error:
        raise WriteError(
            f"{path}: cannot be written ({(error.strerror or str(error)).lower()}).",
            "Check the folder, its permissions and the space on the disk.",
        ) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def refuse_existing(path: Path, overwrite: bool) -> None:
    """Refuse a path that is there already.

    Raises:
        WriteError: it is, and `overwrite` is not set; or it is a folder.
    """
    if path.is_dir():
        raise WriteError(f"{path}: is a folder.", "Give the name of a file.")
    if path.exists() and not path.is_file():
        raise WriteError(f"{path}: is no regular file.", "Give the name of a file.")
    if path.exists() and not overwrite:
        raise WriteError(f"{path}: exists already.", "Choose another name, or add --overwrite.")


def free_bytes(path: Path) -> int:
    """Free space, in bytes, on the disk that will hold `path`."""
    return shutil.disk_usage(path.absolute().parent).free


@contextlib.contextmanager
def _stop_on_signals() -> Iterator[None]:
    # only the main thread may set handlers; elsewhere its exception ends the work
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, _frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
