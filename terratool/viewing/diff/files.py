"""Files and folders compared: pairs of one name, what is on one side only, what cannot be read."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from terratool.definition.keys import document_kind
from terratool.errors import DefinitionError, ReadError, RequestError, TerratoolError
from terratool.report.wording import counted, many
from terratool.text.source import is_folder, leads_out, read_source, sources
from terratool.traversability.route.headings import Progress
from terratool.viewing.diff.compare import Compared, DiffOptions, diff
from terratool.viewing.diff.results import Comparison, FileDifference
from terratool.viewing.diff.sides import Side, read_side

NOTHING = "/dev/null"
"""What git names in place of a file that is not there."""
_STILL = "The text is the same, and is no valid terrain."


@dataclass(frozen=True, slots=True)
class Reading:
    """How files are read.

    Attributes:
        called: the path that both sides are taken to have, for the libraries that they use; None
            for their own.
        roots: further folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
        met: whether they were met in a folder: then they have to be regular files, and links lead
            no further than libraries.
    """

    called: str | None = None
    roots: tuple[str, ...] = ()
    roughness: bool = True
    met: bool = False

    def refuse_link(self, name: str) -> None:
        """Refuse a file that was met in a folder, and is a link to what lies elsewhere.

        Raises:
            ReadError: it is.
        """
        if self.met and leads_out(name, (".", *self.roots)):
            raise ReadError(
                f"{name}: is a link out of the folders that may be read.",
                "Put the file itself there, or name its folder by --library-root.",
            )

    def side(self, name: str) -> Side:
        """Read a definition; raises what `read_side` and `refuse_link` raise."""
        self.refuse_link(name)
        return read_side(
            name,
            called=self.called,
            roots=self.roots,
            roughness=self.roughness,
            named=not self.met,
        )


Taken = Callable[[Compared], None]
"""Is told of each pair that was compared, for pictures and maps."""


def is_nothing(name: str) -> bool:
    """Whether a name stands for a file that is not there."""
    return name in (NOTHING, os.devnull)


def compare_files(
    old: str, new: str, reading: Reading, options: DiffOptions,
    progress: Progress | None = None, taken: Taken | None = None,
) -> Comparison:  # fmt: skip
    """Compare two definitions, of which one may be `/dev/null`.

    Raises:
        ReadError, DefinitionError: one cannot be read, or is no terrain.
        RequestError: as of `diff`.
    """
    name = reading.called or (old if is_nothing(new) else new)
    if is_nothing(old) or is_nothing(new):
        return Comparison((_alone(old, new, name, reading),))
    return Comparison((_pair(old, new, name, reading, options, progress, taken),))


def _pair(
    old: str, new: str, name: str, reading: Reading, options: DiffOptions,
    progress: Progress | None, taken: Taken | None,
) -> FileDifference:  # fmt: skip
    if progress is not None:
        progress.say(f"reading {Path(name).name}")
    compared = diff(reading.side(old), reading.side(new), options, progress)
    if taken is not None:
        taken(compared)
    found = compared.difference
    return FileDifference(name, "same" if found.same else "different", found)


def _alone(old: str, new: str, name: str, reading: Reading) -> FileDifference:
    """A file that is on one side only; on none, it is the same."""
    if is_nothing(old) and is_nothing(new):
        return FileDifference(name, "same", message="There is no terrain on either side.")
    is_new = is_nothing(old)
    terrain = reading.side(new if is_new else old).terrain
    size = " × ".join(f"{side:.6g}" for side in terrain.size)
    count = (
        counted(terrain.elements, "element")
        if terrain.elements < 1e9
        else f"{many(terrain.elements)} elements"
    )
    return FileDifference(
        name, "added" if is_new else "removed",
        message=f"The terrain {'is new' if is_new else 'is gone'}: {size} m, {count}.",
    )  # fmt: skip


def compare_folders(
    old: str, new: str, reading: Reading, options: DiffOptions, progress: Progress | None = None
) -> Comparison:
    """Compare the terrains of two folders, those with one name below each of them.

    Libraries, vehicles and curricula are left out: what they change shows in the terrains.
    Libraries may lie anywhere below the two folders.

    Raises:
        ReadError: neither folder has a terrain.
        RequestError: as of `diff`.
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
                found.append(_alone(first, second, name, reading))
            else:
                found.append(_pair(first, second, name, reading, options, progress, None))
        except DefinitionError as error:
            if _is_one_text(first, second):
                error = DefinitionError(f"{_STILL} {error.message}", error.hint)
            found.append(FileDifference(name, "invalid", None, error.message, error.hint))
        except ReadError as error:
            found.append(FileDifference(name, "unreadable", None, error.message, error.hint))
        except RequestError as error:
            raise _of(error, name) from error
    return Comparison(tuple(found))


def _is_one_text(old: str, new: str) -> bool:
    """Whether two files have the same text."""
    if NOTHING in (old, new):
        return False
    return read_source(old, named=False).data == read_source(new, named=False).data


def _of(error: RequestError, name: str) -> TerratoolError:
    return RequestError(f"{name}: {error.message}", error.hint)


def _terrains(folder: str, reading: Reading) -> dict[str, str]:
    """The terrains below a folder, by their names there; what is no JSON counts, too."""
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
            kind = None  # which is said when it is compared
        if kind in ("terrain", None):
            found[Path(name).relative_to(folder).as_posix()] = name
    return found


def are_folders(old: str, new: str) -> bool:
    """Whether both names are of folders.

    Raises:
        RequestError: only one is.
    """
    folders = is_folder(old), is_folder(new)
    if folders[0] != folders[1]:
        name, other = (old, new) if folders[0] else (new, old)
        raise RequestError(
            f"{name} is a folder, and {other} is none.", "Name two files, or two folders."
        )
    return folders[0]
