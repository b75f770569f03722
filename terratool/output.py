"""Files appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import platform
import re
import shlex
import shutil
import signal
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import FrameType
from uuid import uuid4

from terratool.errors import WriteError

PART = ".terratool-"
"""Prefix of the names of temporaries: files and folders that are not yet whole."""
_parts: set[Path] = set()
"""Folders that `abandon_parts` removes."""
_renaming = threading.RLock()
"""Lock that is held while names change that must change together."""


@contextlib.contextmanager
def whole_file(
    path: str | Path,
    overwrite: bool = False,
    companions: tuple[str, ...] = (),
    within: Path | None = None,
    *,
    named: bool = True,
) -> Iterator[Path]:
    """Yield a temporary path that takes the place of `path` when the block ends well.

    Other files in the temporary's folder are moved beside `path` just before. The temporary is
    removed on any failure, Ctrl-C, SIGTERM and SIGHUP included. Leftovers of a killed process are
    removed by the next one that writes there.

    Args:
        path: file to write.
        overwrite: whether `path` may exist.
        companions: suffixes of files that belong to `path`, in place of its own suffix, or after
            its name where they begin with a star; older companions are removed.
        within: folder on the same disk for the temporary; that of `path` if None.
        named: whether the user named this very file: then a link at `path` is followed. Any other
            link is replaced, and its target left alone.

    Raises:
        WriteError: `path` exists and is not to be overwritten, or its folder cannot be written.
    """
    path = target_of(path, named)
    refuse_existing(path, overwrite, companions, named=named)
    refuse_missing_folder(path)
    with os_errors(path), stop_on_signals(), part_folder(within or path.parent) as folder:
        yield folder / path.name
        # other files go first, as their reader comes by way of `path`
        parts = sorted(folder.iterdir(), key=lambda part: part.name == path.name)
        for part in parts:
            with open(part, "rb+") as file:
                os.fsync(file.fileno())
        for part in parts:
            refuse_existing(path.with_name(part.name), overwrite, named=False)
        with hold_signals():
            for old in _companions_of(path, companions):
                old.unlink(missing_ok=True)
            for part in parts:
                part.replace(path.with_name(part.name))
        _sync_folder(path.parent)


def target_of(path: str | Path, named: bool = True) -> Path:
    """Return a file's path without links; a link at `path` itself is followed only if `named`."""
    path = Path(path)
    return Path(os.path.realpath(path)) if named else Path(os.path.realpath(path.parent), path.name)


@contextlib.contextmanager
def whole_folder(path: Path, overwrite: bool, own: Iterable[str]) -> Iterator[Path]:
    """Yield a temporary folder that takes the place of `path` when the block ends well.

    Args:
        path: folder to write.
        overwrite: whether a folder of this kind may exist.
        own: names of all files that such a folder has.

    Raises:
        WriteError: `path` exists and is not to be overwritten, holds something else, or cannot be
            written.
    """
    path = Path(os.path.realpath(path))
    refuse_folder(path, overwrite, own)
    with os_errors(path), stop_on_signals(), part_folder(path.parent) as folder:
        yield folder / path.name
        for part in (folder / path.name).iterdir():
            with open(part, "rb+") as file:
                os.fsync(file.fileno())
        old = folder / "old"
        with hold_signals():
            if os.path.lexists(path):
                path.replace(old)
            try:
                if os.path.lexists(old):  # something may have come since
                    refuse_folder(old, overwrite, own, called=path)
                (folder / path.name).replace(path)
            except BaseException:
                if os.path.lexists(old):
                    old.replace(path)
                raise
        _sync_folder(path.parent)


@contextlib.contextmanager
def part_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder within another one; it is removed on leaving.

    Temporaries of processes that are gone are removed, too.
    """
    _remove_leftovers(folder)
    part = folder / part_name()
    with remove_if_abandoned(part):
        try:
            part.mkdir()
            yield part
        finally:
            shutil.rmtree(part, ignore_errors=True)


@contextlib.contextmanager
def remove_if_abandoned(part: Path) -> Iterator[None]:
    """Have `abandon_parts` remove a folder while the block lasts."""
    _parts.add(part)
    try:
        yield
    finally:
        _parts.discard(part)


def abandon_parts() -> None:
    """Remove all temporaries, as the process is to end at once; any thread may call.

    The call waits for blocks of `hold_signals`; afterwards none begins.
    """
    _renaming.acquire()
    for part in list(_parts):
        shutil.rmtree(part, ignore_errors=True)


@contextlib.contextmanager
def os_errors(path: Path) -> Iterator[None]:
    """Turn the system's errors within the block into terratool's.

    Raises:
        WriteError: the system raised an OSError.
    """
    try:
        yield
    except OSError as error:
        raise WriteError.of(path, error) from error


def _machine_mark() -> str:
    """Return a mark of the machine, or container, whose processes are known here: 8 hex digits."""
    try:
        namespace = os.readlink("/proc/self/ns/pid")  # noqa: PTH115, it is no path
    except OSError:
        namespace = ""
    # machines may share a folder and a name
    boot = Path("/proc/sys/kernel/random/boot_id")
    started = boot.read_text("ascii") if boot.is_file() else ""
    return f"{zlib.crc32(f'{platform.node()} {namespace} {started}'.encode()):08x}"


_SELF = _machine_mark()
"""Mark of this machine in the names of its temporaries."""
_temporary = re.compile(
    re.escape(PART) + r"(?:tiles-)?" + re.escape(_SELF) + r"-([0-9]+)-[0-9a-f]{12}\.part"
).fullmatch
"""Match the name of a temporary of this machine; group 1 is the process."""


def part_name(of: str = "") -> str:
    """Return a new name of a temporary, with this machine and process in it.

    Args:
        of: prefix of a kind of temporary: "tiles-" or empty.
    """
    return f"{PART}{of}{_SELF}-{os.getpid()}-{uuid4().hex[:12]}.part"


def _remove_leftovers(folder: Path) -> None:
    """Remove temporaries of processes of this machine that are gone."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = _temporary(entry.name)
            if match and not _is_running(int(match[1])):
                shutil.rmtree(entry.path, ignore_errors=True)


def is_being_written(name: str) -> bool:
    """Whether a name is that of a temporary of a process of this machine that is running."""
    match = _temporary(name)
    return match is not None and _is_running(int(match[1]))


def _is_running(process: int) -> bool:
    """Whether a process of this machine is running; True where that cannot be known."""
    if os.name != "posix":  # elsewhere signal 0 is not harmless
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        pass
    return True


def _companions_of(path: Path, companions: tuple[str, ...]) -> list[Path]:
    """Return the companions of a file, by suffixes as in `whole_file`."""
    return [
        path.with_name(path.name + suffix[1:]) if suffix[0] == "*" else path.with_suffix(suffix)
        for suffix in companions
    ]


def _sync_folder(folder: Path) -> None:
    """Make the new names in a folder survive a loss of power, where the system can."""
    if hasattr(os, "O_DIRECTORY"):
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def is_same_file(one: str | Path, other: str | Path) -> bool:
    """Whether two paths name one file, which exists."""
    try:
        return Path(one).samefile(other)
    except (OSError, ValueError):
        return False


def refuse_existing(
    path: Path, overwrite: bool, companions: tuple[str, ...] = (), *, named: bool = True
) -> None:
    """Refuse a path that exists, has existing companions, or cannot be a file.

    Args:
        path: file to write.
        overwrite: whether `path` and its companions may exist.
        companions: suffixes of files that belong to `path`, as in `whole_file`.
        named: whether `path` may be a link that leads to nothing yet.

    Raises:
        WriteError: `path` or a companion exists and `overwrite` is not set, or `path` is a folder,
            no regular file, or no name in UTF-8.
    """
    try:
        if "\0" in str(path):
            raise ValueError
        str(path).encode()
    except ValueError as error:
        raise WriteError(f"{str(path)!r}: is no name in UTF-8.", "Choose another name.") from error
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise WriteError.of(path, error, "Choose another name or folder.") from error
    for companion in _companions_of(path, companions) if path.name else []:
        refuse_existing(companion, overwrite, named=False)
    if path.is_dir():
        raise WriteError(f"{path}: is a folder.", "Give the name of a file.")
    if path.exists() and not path.is_file():
        raise WriteError(f"{path}: is no regular file.", "Give the name of a file.")
    if (path.exists() or (path.is_symlink() and not named)) and not overwrite:
        raise WriteError(f"{path}: exists already.", "Choose another name, or add --overwrite.")


def refuse_folder(
    path: Path, overwrite: bool, own: Iterable[str], called: Path | None = None
) -> None:
    """Refuse a folder that exists, unless it may be replaced and holds its own files only.

    Args:
        path: folder to write.
        overwrite: whether a folder of this kind may be replaced.
        own: names of all files that such a folder has.
        called: name of the folder in messages; `path` if None.

    Raises:
        WriteError: the folder is refused, or `path` is no folder.
    """
    own, called = set(own), called or path
    if not path.is_dir():
        refuse_existing(path, overwrite=False)
        return
    if not overwrite:
        raise WriteError(f"{called}: exists already.", "Choose another name, or add --overwrite.")
    hint = "Choose another name, or move it elsewhere."
    with os_errors(path), os.scandir(path) as entries:
        found = {entry.name: entry.is_file(follow_symlinks=False) for entry in entries}
    for name in sorted(found):
        if name not in own or not found[name]:
            raise WriteError(f"{called}: holds {name}, which terratool did not write.", hint)
    if found.keys() != own:
        raise WriteError(f"{called}: was not written by terratool.", hint)


def refuse_missing_folder(path: Path) -> None:
    """Refuse a path whose folder does not exist.

    Raises:
        WriteError: the folder does not exist.
    """
    if not path.parent.is_dir():
        raise WriteError(
            f"{path}: the folder {path.parent} does not exist.",
            f"Create it first: mkdir -p {shlex.quote(str(path.parent))}",
        )


def refuse_unmade_folder(path: Path) -> None:
    """Refuse a path whose folder neither exists nor can be made by `make_folder`.

    Raises:
        WriteError: what is to be the folder, or to hold it, is something else.
    """
    found = next(one for one in path.absolute().parents if os.path.lexists(one))
    if not found.is_dir():
        raise WriteError(f"{path}: {found} is no folder.", "Choose another name, or move it.")


def make_folder(path: Path) -> None:
    """Make the folder of a file, and those that hold it, where they do not exist.

    Raises:
        WriteError: a folder cannot be made.
    """
    with os_errors(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)


def free_bytes(path: Path) -> int:
    """Return the free bytes on the disk of a folder, or of a file that is to be written."""
    path = Path(os.path.realpath(path))
    return shutil.disk_usage(path if path.is_dir() else path.parent).free


@contextlib.contextmanager
def stop_on_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block by SystemExit, as Ctrl-C does by KeyboardInterrupt."""

    def stop(number: int, _frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    with _on_signals(stop, "SIGTERM", "SIGHUP"):
        yield


@contextlib.contextmanager
def hold_signals() -> Iterator[None]:
    """Hold Ctrl-C, SIGTERM and SIGHUP until the end of the block, which is short."""
    held: list[int] = []
    try:
        with (
            _on_signals(lambda number, _: held.append(number), "SIGINT", "SIGTERM", "SIGHUP"),
            _renaming,
        ):
            yield
    finally:
        for number in held[:1]:
            signal.raise_signal(number)


@contextlib.contextmanager
def _on_signals(handler: Callable[[int, FrameType | None], None], *names: str) -> Iterator[None]:
    """Have a function handle signals, by name, while the block lasts, where the system can."""
    # only the main thread may set handlers; elsewhere its exception ends the work
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)
