"""Reading and writing the bytes of a definition, from files, folders and standard input."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from msgspec import Struct

from terratool.errors import ReadError, RequestError
from terratool.output import is_same_file, whole_file
from terratool.text.files import open_file, read_up_to
from terratool.text.packing import GZIP, PackingError, gunzip, pack

MAX_BYTES = 2 * 1024**3
_SPLIT = "Split the terrain, or describe it by primitives rather than by points."
_BOM = b"\xef\xbb\xbf"


class Source(Struct, frozen=True):
    """A named text, with gzip undone and a byte order mark removed.

    Attributes:
        name: name of the file.
        data: text in UTF-8.
        packed: whether the file was a gzip.
        marked: whether a byte order mark stood before the text.
        seen: whether users see the text, so that lines say where in it something stands.
    """

    name: str
    data: bytes
    packed: bool = False
    marked: bool = False
    seen: bool = True

    @property
    def size(self) -> int:
        """Size of the text in bytes."""
        return len(self.data)

    @property
    def file_bytes(self) -> bytes:
        """Bytes of a file of the text, as gzip and with a byte order mark if the source says so."""
        data = _BOM + self.data if self.marked else self.data
        if not self.packed:
            return data
        import gzip

        return pack(data, partial(gzip.compress, mtime=0))


def read_source(
    path: str | Path, most: int = MAX_BYTES, hint: str = _SPLIT, *, named: bool = True
) -> Source:
    """Read a file, or standard input for ``-``.

    Args:
        path: the file.
        most: most bytes of its unpacked text.
        hint: remedy for a file that holds more.
        named: whether a user named it, as in `open_file`; otherwise it has to be a regular file.

    Raises:
        ReadError: the file is missing, unreadable, too large, broken gzip or a gzip that unpacks to
            far more than its size.
    """
    name = str(path)
    try:
        if name == "-":
            if sys.stdin is None:  # None if it was closed
                raise OSError("it is closed")
            data = sys.stdin.buffer.read(most + 1)
            name = "<stdin>"
        elif not name:
            raise ValueError("it is empty")
        else:
            with open_file(path, named=named) as file:
                data = read_up_to(file, most + 1)
    except OSError as error:
        raise ReadError.of(name, error) from error
    except (ValueError, TypeError) as error:  # empty, with NUL, or of no type that paths have
        raise ReadError(f"{name!r}: is no name of a file.", "Check the path.") from error
    data = _within_limit(name, data, most, hint)
    packed = data.startswith(GZIP)
    if packed:
        try:
            data = _within_limit(name, gunzip(data, most), most, hint)
        except PackingError as error:
            raise ReadError(f"{name}: {error.message}", error.hint) from error
    return Source(name, data.removeprefix(_BOM), packed, data.startswith(_BOM))


def write_source(source: Source, path: str | Path, overwrite: bool) -> None:
    """Write a text whole or not at all, as gzip and with a byte order mark if the source says so.

    Raises:
        WriteError: the file cannot be written, or exists already and must not be overwritten.
    """
    own = is_same_file(path, source.name)
    with whole_file(path, overwrite) as part:
        part.write_bytes(source.file_bytes)
        if own:
            shutil.copymode(path, part)


PLAIN, ALL = (".json",), (".json", ".json.gz")


def refuse_name(path: str | Path, endings: tuple[str, ...] = ALL) -> None:
    """Refuse the name of a file that a definition cannot have.

    Raises:
        RequestError: the name does not end as those of definitions do, or is nothing but that.
    """
    if not str(path).endswith(endings) or Path(path).name in endings:
        raise RequestError(
            f"{path}: is no name of a definition.", f"Let it end in {' or '.join(endings)}."
        )


def is_folder(name: str) -> bool:
    """Tell whether a name is that of a directory."""
    return name != "-" and os.path.isdir(name)  # noqa: PTH112, that of Path raises


def refuse_absent(name: str) -> None:
    """Refuse the name of a file that does not exist.

    Raises:
        ReadError: there is no such file, or it is out of reach.
    """
    try:
        if name != "-":
            os.stat(name)  # noqa: PTH116, names with NUL raise as in `read_source`
    except OSError as error:
        raise ReadError.of(name, error) from error
    except ValueError as error:
        raise ReadError(f"{name!r}: is no name of a file.", "Check the path.") from error


def real_path(name: str) -> str:
    """Return the path of a file with links resolved, or the name itself if it can be no path."""
    return name if "\0" in name else os.path.realpath(name)


def sources(name: str, endings: tuple[str, ...] = ALL) -> Iterator[str]:
    """Yield the file of a name, or all files with these endings in a directory, sorted.

    Raises:
        ReadError: the directory has no such file, or one in it cannot be listed; raised last.
    """
    if not is_folder(name):
        yield name
        return
    found = False
    errors: list[OSError] = []
    for directory, below, files in os.walk(name, onerror=errors.append):
        below[:] = sorted(part for part in below if not part.startswith("."))
        for file in sorted(files):
            if file.endswith(endings) and not file.startswith("."):
                found = True
                yield str(Path(directory, file))
    for error in errors:
        raise ReadError.of(str(Path(error.filename)), error) from error
    if not found:
        raise ReadError(
            f"{name}: has no {' and no '.join('*' + ending for ending in endings)}.",
            "Name a file, or another directory.",
        )


def leads_out(name: str, folders: Iterable[str]) -> bool:
    """Tell whether a file is a link to a target outside of all of some folders."""
    if not os.path.islink(name):  # noqa: PTH114, that of Path raises
        return False
    real = Path(real_path(name))
    return not any(real.is_relative_to(real_path(folder)) for folder in folders)


def _within_limit(name: str, data: bytes, most: int, hint: str) -> bytes:
    if len(data) > most:
        size = f"{most >> 20:,} MiB" if most % 1024**3 else f"{most >> 30} GiB"
        raise ReadError(f"{name}: holds more than {size} of text.", hint)
    return data
