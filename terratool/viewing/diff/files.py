"""Comparison of files and folders: pairs of one name, files on one side only, unreadable ones."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from terratool.definition.keys import document_kind
from terratool.errors import DefinitionError, ReadError, RequestError, TerratoolError
from terratool.report.wording import count_of, many
from terratool.text.source import is_folder, leads_out, read_source, sources
from terratool.traversability.route.headings import Progress
from terratool.viewing.diff.compare import ComparedDefinitions, DiffOptions, diff
from terratool.viewing.diff.results import Comparison, FileDifference
from terratool.viewing.diff.sides import DiffSide, read_side

NOTHING = "/dev/null"
"""Name that git gives in place of a file that does not exist."""
_STILL = "The text is the same, and is no valid terrain."


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Options for reading files.

    Attributes:
        called: path that both sides are taken to have, from which libraries are looked for; None
            for the paths of the files.
        roots: further folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
        met: whether the files were met in a folder: they must be regular files then, and links
            lead no further than libraries may lie.
    """

    called: str | None = None
    roots: tuple[str, ...] = ()
    roughness: bool = True
    met: bool = False

    def refuse_link(self, name: str) -> None:
        """Refuse a file that was met in a folder, and is a link out of the allowed folders.

        Raises:
            ReadError: the file is such a link.
        """
        if self.met and leads_out(name, (".", *self.roots)):
            raise ReadError(
                f"{name}: is a link out of the folders that may be read.",
                "Put the file itself there, or name its folder by --library-root.",
            )

    def side(self, name: str) -> DiffSide:
        """Read a definition; raises what `read_side` and `refuse_link` raise."""
        self.refuse_link(name)
        return read_side(
            name,
            called=self.called,
            roots=self.roots,
            roughness=self.roughness,
            named=not self.met,
        )


PairCallback = Callable[[ComparedDefinitions], None]
"""Function that is called with each pair that was compared, for pictures and maps."""


def is_nothing(name: str) -> bool:
    """Whether a name stands for a file that does not exist."""
    return name in (NOTHING, os.devnull)


def compare_files(
    old: str, new: str, reading: ReadOptions, options: DiffOptions,
    progress: Progress | None = None, on_compared: PairCallback | None = None,
) -> Comparison:  # fmt: skip
    """Compare two definitions, of which one may be `/dev/null`.

    Raises:
        ReadError, DefinitionError: a file cannot be read, or is no terrain.
        RequestError: `diff` raises it.
    """
    name = reading.called or (old if is_nothing(new) else new)
    if is_nothing(old) or is_nothing(new):
        return Comparison((_lone_file(old, new, name, reading),))
    return Comparison((_pair(old, new, name, reading, options, progress, on_compared),))


def _pair(
    old: str, new: str, name: str, reading: ReadOptions, options: DiffOptions,
    progress: Progress | None, on_compared: PairCallback | None,
) -> FileDifference:  # fmt: skip
    if progress is not None:
        progress.say(f"reading {Path(name).name}")
    compared = diff(reading.side(old), reading.side(new), options, progress)
    if on_compared is not None:
        on_compared(compared)
    return FileDifference.of(name, compared.difference)


def _lone_file(old: str, new: str, name: str, reading: ReadOptions) -> FileDifference:
    """Result for a terrain on one side only; "same" if there is none on either side."""
    if is_nothing(old) and is_nothing(new):
        return FileDifference(name, "same", message="There is no terrain on either side.")
    is_new = is_nothing(old)
    terrain = reading.side(new if is_new else old).terrain
    size = " × ".join(f"{side:.6g}" for side in terrain.size)
    count = (
        count_of(terrain.elements, "element")
        if terrain.elements < 1e9
        else f"{many(terrain.elements)} elements"
    )
    return FileDifference(
        name, "added" if is_new else "removed",
        message=f"The terrain {'is new' if is_new else 'is gone'}: {size} m, {count}.",
    )  # fmt: skip


def compare_folders(
    old: str, new: str, reading: ReadOptions, options: DiffOptions, progress: Progress | None = None
) -> Comparison:
    """Compare the terrains of two folders, pair by pair of one name.

    Libraries, vehicles and curricula are left out, as their changes show in the terrains.
    Libraries may lie anywhere below the two folders.

    Raises:
        ReadError: neither folder has a terrain.
        RequestError: `diff` raises it.
    """
    reading = replace(reading, roots=(*reading.roots, old, new), met=True)
    before, after = _terrains(old, reading), _terrains(new, reading)
    if not before and not after:
        raise ReadError(
            f"{old}: has no terrain, nor has {new}.", "Name two files, or folders with terrains."
        )
    found = []
    for name in sorted(before.keys() | after.keys()):
        first, second = before.get(name, NOTHING), after.get(name, NOTHING)
        try:
            if NOTHING in (first, second):
                found.append(_lone_file(first, second, name, reading))
            else:
                found.append(_pair(first, second, name, reading, options, progress, None))
        except DefinitionError as error:
            if _is_one_text(first, second):
                error = DefinitionError(f"{_STILL} {error.message}", error.hint)
            found.append(FileDifference(name, "invalid", None, error.message, error.hint))
        except ReadError as error:
            found.append(FileDifference(name, "unreadable", None, error.message, error.hint))
        except RequestError as error:
            raise _with_name(error, name) from error
    return Comparison(tuple(found))


def _is_one_text(old: str, new: str) -> bool:
    """Whether two files have the same text."""
    if NOTHING in (old, new):
        return False
    return read_source(old, named=False).data == read_source(new, named=False).data


def _with_name(error: RequestError, name: str) -> TerratoolError:
    return RequestError(f"{name}: {error.message}", error.hint)


def _terrains(folder: str, reading: ReadOptions) -> dict[str, str]:
    """Paths of the terrains below a folder, by their names there; files without JSON included."""
    found = {}
    try:
        names = list(sources(folder))
    except ReadError:
        return {}
    for name in names:
        try:
            reading.refuse_link(name)
            kind = document_kind(read_source(name, named=False).data)
        except ReadError:
            kind = None  # the comparison reports it
        if kind in ("terrain", None):
            found[Path(name).relative_to(folder).as_posix()] = name
    return found


def are_folders(old: str, new: str) -> bool:
    """Whether both names are those of folders.

    Raises:
        RequestError: only one name is that of a folder.
    """
    folders = is_folder(old), is_folder(new)
    if folders[0] != folders[1]:
        name, other = (old, new) if folders[0] else (new, old)
        raise RequestError(
            f"{name} is a folder, and {other} is none.", "Name two files, or two folders."
        )
    return folders[0]
