"""Libraries: the files that a definition uses, opened once each, and the names they define."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from msgspec import Struct, field, structs

from terratool.definition.decode import Decoded
from terratool.definition.findings import Remark, RemarkLog
from terratool.definition.grid_files import (
    GridSource,
    LinkedGrid,
    LinkedSurfaceGrid,
    Rasters,
    no_rasters,
)
from terratool.definition.keys import Kind, document_kind
from terratool.definition.model import (
    Element,
    GridFile,
    Library,
    Primitive,
    Surface,
    SurfaceGrid,
)
from terratool.errors import ReadError, reason
from terratool.text.display import escape, quote
from terratool.text.source import Source, read_source, real_path

if TYPE_CHECKING:
    from terratool.text.syntax import JsonSyntaxError

MAX_LIBRARIES = 1000
"""Most files that a definition may use, directly or through others."""
MAX_ENTRIES = 10_000
"""Most entries of `use` in a definition and its libraries together."""
MAX_BYTES = 1 << 30
"""Most bytes of text of all libraries together."""
_SMALLER = "Split the library, or describe shapes by curves rather than by points."
_address = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:").match
_drive = re.compile(r"[A-Za-z]:").match

Dictionary = Literal["surfTypes", "elemTypes", "parts"]
_Problem = tuple[str, str, str]
"""Code, message and hint on a path."""
_Value = TypeVar("_Value", Surface, Primitive, Element)
_Read = TypeVar("_Read")


class SourceDocument(Struct, eq=False, dict=True):
    """Text of a terrain or a library that was read.

    Attributes:
        source: text, under the name that findings give it.
        decoded: model of the text; empty where the text is no JSON.
        found: remarks so far.
        real: path without links; empty where the text has none.
        uses: library of each entry of `use`; None where it cannot be had.
        problems: remarks on entries of `use` and on grid files, by code.
        broken: error of syntax; None if there is none.
        kind: kind that the text was read as.
        linked: whether its libraries were looked for.
        tiles: of a spec of training tiles, what the files of its kinds of tiles hold, by name.
    """

    source: Source
    decoded: Decoded
    found: RemarkLog
    real: str = ""
    uses: list[SourceDocument | None] = field(default_factory=list)
    problems: list[tuple[str, Remark]] = field(default_factory=list)
    broken: JsonSyntaxError | None = None
    kind: Kind = "library"
    linked: bool = False
    tiles: Mapping[str, Any] = {}
    _catalogue: Catalogue | None = None

    @property
    def catalogue(self) -> Catalogue:
        """Files in which the names of the document's libraries stand."""
        if self._catalogue is None:
            Catalogue((self, *self.all_libraries))
        assert self._catalogue is not None
        return self._catalogue

    @property
    def model(self) -> Library:
        """Library or terrain of the text; an empty library where there is neither."""
        return self.decoded.definition or self.decoded.library or Library()

    @property
    def folder(self) -> str:
        """Folder at which the paths of `use` begin."""
        return "." if self.source.name == "<stdin>" else str(Path(self.source.name).parent)

    @cached_property
    def all_libraries(self) -> tuple[SourceDocument, ...]:
        """Libraries that the document uses, directly or through others, each once, in order."""
        return tuple(self._walk_libraries())

    @cached_property
    def entries(self) -> dict[Dictionary, dict[str, Any]]:
        """Entries of the document's own dictionaries by name, empty where absent."""
        model = self.model
        return {
            "surfTypes": model.surfaces,
            "elemTypes": model.primitives,
            "parts": model.assemblies,
        }

    @property
    def rasters(self) -> list[GridSource]:
        """Rasters of the primitives and elements of the document and of all its libraries."""
        grids = [
            grid
            for document in (self, *self.all_libraries)
            for grid in (
                *(primitive.grid for primitive in document.model.primitives.values()),
                *document.decoded.tree.distinct("surface_grid"),
            )
        ]
        return [one.source for one in grids if isinstance(one, LinkedGrid | LinkedSurfaceGrid)]

    def _walk_libraries(self) -> Iterator[SourceDocument]:
        seen = {id(self)}
        pending = [iter(self.uses)]
        while pending:
            for library in pending[-1]:
                if library is not None and id(library) not in seen:
                    seen.add(id(library))
                    yield library
                    pending.append(iter(library.uses))
                    break
            else:
                pending.pop()


class Named(Struct, Generic[_Value], frozen=True):
    """Surface, primitive or part, with the file that it stands in."""

    value: _Value
    home: SourceDocument


class KnownNames(Struct, frozen=True):
    """Names that a file knows: its own, and those of the libraries that it uses."""

    surfaces: Mapping[str, Named[Surface]] = {}
    primitives: Mapping[str, Named[Primitive]] = {}
    parts: Mapping[str, Named[Element]] = {}

    def of(self, dictionary: Dictionary) -> Mapping[str, Named[Any]]:
        """Names in one dictionary."""
        known: dict[Dictionary, Mapping[str, Any]] = {
            "surfTypes": self.surfaces, "elemTypes": self.primitives, "parts": self.parts,
        }  # fmt: skip
        return known[dictionary]


class Clash(Struct, frozen=True):
    """Name that two libraries define."""

    dictionary: Dictionary
    name: str
    first: SourceDocument
    second: SourceDocument


DICTIONARIES: tuple[Dictionary, ...] = ("surfTypes", "elemTypes", "parts")


class Catalogue:
    """Files that use one another: the libraries that each reaches, and the files of each name.

    Many libraries may each reach nearly all others, so nothing here is listed for each file:
    sets of files are whole numbers, with a bit for each.

    Attributes:
        notes: results of rules and readers about all of the files, by name.
    """

    def __init__(self, documents: Sequence[SourceDocument]) -> None:
        """Index files, which include all files that they use, and set their `catalogue`."""
        self._documents = tuple(documents)
        self._numbers = {id(document): n for n, document in enumerate(documents)}
        used = [
            [self._numbers[id(library)] for library in document.uses if library is not None]
            for document in documents
        ]
        self._reach = [0] * len(documents)
        changed = True
        while changed:  # a pass for each step against the order of the files, and a last one
            changed = False
            for n in range(len(documents) - 1, -1, -1):
                reach = self._reach[n]
                for other in used[n]:
                    reach |= 1 << other | self._reach[other]
                changed |= reach != self._reach[n]
                self._reach[n] = reach
        self._kept: dict[Callable[[SourceDocument], bool], int] = {}
        self.notes: dict[str, Any] = {}
        for document in documents:
            document._catalogue = self

    @cached_property
    def _homes(self) -> dict[Dictionary, dict[str, list[int]]]:
        """Numbers of the files in which each name stands, by dictionary."""
        homes: dict[Dictionary, dict[str, list[int]]] = {key: {} for key in DICTIONARIES}
        for n, document in enumerate(self._documents):
            for dictionary in DICTIONARIES:
                for name in document.entries[dictionary]:
                    homes[dictionary].setdefault(name, []).append(n)
        return homes

    @cached_property
    def repeated_names(self) -> dict[Dictionary, list[str]]:
        """Names that stand in several files, by dictionary."""
        return {
            dictionary: [name for name, homes in known.items() if len(homes) > 1]
            for dictionary, known in self._homes.items()
        }

    def reaches(self, document: SourceDocument, library: SourceDocument) -> bool:
        """Whether a file uses a library, directly or through others."""
        return bool(self._reach[self._number(document)] >> self._number(library) & 1)

    def libraries_where(
        self, document: SourceDocument, wanted: Callable[[SourceDocument], bool]
    ) -> list[SourceDocument]:
        """Libraries that a file reaches and that are wanted; `wanted` is called once for each."""
        if wanted not in self._kept:
            those = (1 << n for n, one in enumerate(self._documents) if wanted(one))
            self._kept[wanted] = sum(those)
        found = self._kept[wanted] & self._others(document)
        return [one for n, one in enumerate(self._documents) if found >> n & 1] if found else []

    def homes(
        self, document: SourceDocument, dictionary: Dictionary, name: str
    ) -> list[SourceDocument]:
        """Libraries with a name that a file reaches, in the order of `all_libraries`."""
        reach = self._others(document)
        found = [
            self._documents[n] for n in self._homes[dictionary].get(name, ()) if reach >> n & 1
        ]
        if len(found) < 2:
            return found
        order = {id(library): place for place, library in enumerate(document.all_libraries)}
        return sorted(found, key=lambda library: order[id(library)])

    def all_names(self, dictionary: Dictionary) -> dict[str, Named[Any]]:
        """All names of a dictionary, each with the first file in which it stands."""
        return {
            name: Named(self._documents[first].entries[dictionary][name], self._documents[first])
            for name, (first, *_) in self._homes[dictionary].items()
        }

    def _number(self, document: SourceDocument) -> int:
        return self._numbers[id(document)]

    def _others(self, document: SourceDocument) -> int:
        """Files that a file reaches, itself excluded, as a bit set."""
        number = self._number(document)
        return self._reach[number] & ~(1 << number)


class _Known(Mapping[str, Named[Any]]):
    """Names of one dictionary that a file knows: its own, then those of its libraries."""

    def __init__(self, document: SourceDocument, dictionary: Dictionary) -> None:
        self._document, self._dictionary = document, dictionary
        self._own = document.entries[dictionary]
        self._found: dict[str, Named[Any]] = {}

    def __getitem__(self, name: str) -> Named[Any]:
        if name not in self._found:
            home = self._document
            if name not in self._own:
                homes = home.catalogue.homes(home, self._dictionary, name)
                if not homes:
                    raise KeyError(name)
                home = homes[0]
            self._found[name] = Named(home.entries[self._dictionary][name], home)
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @cached_property
    def _names(self) -> dict[str, None]:
        names = dict.fromkeys(self._own)
        for library in self._document.all_libraries:
            names |= dict.fromkeys(library.entries[self._dictionary])
        return names


def known_names(document: SourceDocument) -> KnownNames:
    """Names that a file knows; for a name in two libraries the first library counts."""
    return KnownNames(*(_Known(document, dictionary) for dictionary in DICTIONARIES))


def clashes_of(document: SourceDocument) -> list[Clash]:
    """Names that a file cannot know, as two of its libraries define them."""
    catalogue, found = document.catalogue, []
    for dictionary in DICTIONARIES:
        for name in catalogue.repeated_names[dictionary]:
            if name not in document.entries[dictionary]:
                first, *others = catalogue.homes(document, dictionary, name) or [document]
                found += [Clash(dictionary, name, first, other) for other in others]
    if not found:
        return []
    order = {id(library): place for place, library in enumerate(document.all_libraries)}
    return sorted(found, key=lambda c: (DICTIONARIES.index(c.dictionary), order[id(c.second)]))


class Shelf:
    """Libraries and rasters that were opened, by real paths, and the folders that they may lie in.

    Attributes:
        files: names of all files that were looked for, whether they exist or not.
    """

    def __init__(self, read: Callable[[Source], SourceDocument], roots: Sequence[str] = ()) -> None:
        """Open a shelf without libraries.

        Args:
            read: function that makes a document of the text of a library.
            roots: folders beside the current one under which libraries may lie.
        """
        self._roots = [real_path(root) for root in (".", *roots)]
        self._read = read
        self._documents: dict[str, SourceDocument | _Problem] = {}
        self._grids: dict[tuple[str, int, bool], GridSource | _Problem] = {}
        self._room = MAX_BYTES
        self.files: dict[str, None] = {}

    def link(self, document: SourceDocument) -> None:
        """Open all libraries that a file uses, directly or through others, and their rasters."""
        base = real_path(document.folder)
        if document.real and document.kind == "library":
            self._documents.setdefault(document.real, document)
        pending, count = [document], 0
        met: set[int] = set()
        while pending:
            user = pending.pop()
            if user.linked:
                continue
            user.linked = True
            self._link_grids(user, base)
            self._link_classes(user, base)
            paths = user.model.library_paths
            count += len(paths)
            for index, path in enumerate(paths):
                if count > MAX_ENTRIES or len(met) >= MAX_LIBRARIES:
                    what = (
                        f"names libraries more than {MAX_ENTRIES:,} times."
                        if count > MAX_ENTRIES
                        else f"uses more than {MAX_LIBRARIES:,} libraries."
                    )
                    hint = "Put several of them into one file."
                    remark = Remark(f"/use/{index}", f"the definition {what}", hint)
                    user.problems.append(("TT701", remark))
                    user.uses.append(None)
                    break
                found = self._open(user, path, base)
                if isinstance(found, SourceDocument):
                    user.uses.append(found)
                    pending.append(found)
                    met.add(id(found))
                else:
                    code, message, hint = found
                    user.problems.append((code, Remark(f"/use/{index}", message, hint)))
                    user.uses.append(None)
        Catalogue((document, *document.all_libraries))

    def _open(self, user: SourceDocument, path: str, base: str) -> SourceDocument | _Problem:
        """Library at a path; code, message and hint where the path is wrong."""
        wrong = self._refusal(user, path, base, "library")
        if wrong is not None:
            return "TT702", *wrong
        name, real = plain_path(user.folder, path), real_path(str(Path(user.folder, path)))
        if real not in self._documents:
            self._documents[real] = self._load(name, real)
        return self._documents[real]

    def _refusal(
        self, user: SourceDocument, path: str, base: str, what: str
    ) -> tuple[str, str] | None:
        """Message and hint on a path of a library or raster that may not be followed."""
        wrong = _path_problem(path, what)
        if wrong is not None:
            return wrong
        name, real = plain_path(user.folder, path), real_path(str(Path(user.folder, path)))
        self.files[name] = self.files[str(Path(user.folder, path))] = None
        if not any(_is_under(real, root) for root in (base, *self._roots)):
            return (
                f"the {what} {quote(path)} lies outside of the folders that may be read.",
                "Move it below the folder of the terrain, or name its folder by --library-root.",
            )
        return None

    def _link_grids(self, user: SourceDocument, base: str) -> None:
        """Look for the rasters of a file's own primitives, which get what was found."""
        primitives = user.model.primitives
        for name, primitive in primitives.items():
            grid = primitive.grid
            if not isinstance(grid, GridFile):
                continue
            found = self._source(user, grid, base)
            if isinstance(found, GridSource):
                linked = LinkedGrid(file=grid.file, band=grid.band, source=found)
                primitives[name] = structs.replace(primitive, grid=linked)
            else:
                code, message, hint = found
                pointer = f"/elemTypes/{escape(name)}/grid/file"
                user.problems.append((code, Remark(pointer, message, hint)))

    def _link_classes(self, user: SourceDocument, base: str) -> None:
        """Look for the rasters of classes of a file's own elements, which get what was found."""
        tree, linked = user.decoded.tree, {}
        for grid, element in tree.first_of("surface_grid").items():
            found = self._source(user, grid, base)
            if isinstance(found, GridSource):
                linked[grid] = LinkedSurfaceGrid(
                    file=grid.file, band=grid.band, names=grid.names, source=found
                )
            else:
                code, message, hint = found
                remark = Remark("/surfaceGrid/file", message, hint, element=element)
                user.problems.append((code, remark))
        if linked:
            tree.replace("surface_grid", linked)

    def _source(self, user: SourceDocument, grid: GridFile, base: str) -> GridSource | _Problem:
        """Raster of a grid; code, message and hint where there is none."""
        wrong = self._refusal(user, grid.file, base, "raster")
        if wrong is not None:
            return "TT313", *wrong
        real, classes = real_path(str(Path(user.folder, grid.file))), isinstance(grid, SurfaceGrid)
        key = real, grid.band_number, classes
        if key not in self._grids:
            wanted = "Name a raster, as a GeoTIFF."
            self._grids[key] = _read_file(
                "TT312", f"raster {quote(grid.file)}", wanted, real,
                lambda _: self._rasters.source(*key),
            )  # fmt: skip
        return self._grids[key]

    @cached_property
    def _rasters(self) -> Rasters:
        return no_rasters()

    def text_of(self, user: SourceDocument, path: str) -> Source | tuple[str, str]:
        """Text at a path that a file names; message and hint where the path is wrong."""
        wrong = self._refusal(user, path, real_path(user.folder), "file")
        if wrong is not None:
            return wrong
        name, real = plain_path(user.folder, path), real_path(str(Path(user.folder, path)))
        found = self._text(name, real, "file")
        return found if isinstance(found, Source) else found[1:]

    def _text(self, name: str, real: str, what: str) -> Source | _Problem:
        """Text of a regular file; code, message and hint if it cannot be had."""

        def read(size: int) -> Source:
            if size > self._room:
                raise ReadError(f"{real}: holds more than 1 GiB, with those before.", _SMALLER)
            return read_source(real, self._room, _SMALLER, named=False)

        source = _read_file("TT701", f"{what} {quote(name)}", "Name a JSON file.", real, read)
        if not isinstance(source, Source):
            return source
        self._room -= source.size
        return structs.replace(source, name=name)

    def _load(self, name: str, real: str) -> SourceDocument | _Problem:
        said, source = quote(name), self._text(name, real, "library")
        if not isinstance(source, Source):
            return source
        document = self._read(source)
        document.real = real
        looks = document_kind(source.data)
        foreign = any(
            code == "TT103" and remark.pointer.count("/") == 1
            for code, remark in document.found.kept
        )
        if document.broken is None and foreign and looks not in ("library", None):
            return (
                "TT703",
                f"the file {said} is a {looks}, where a library is wanted.",
                'A library has "surfTypes", "elemTypes" and "parts", and no "size" or "elemTree".',
            )
        return document


def _read_file(
    code: str, named: str, wanted: str, real: str, read: Callable[[int], _Read]
) -> _Read | _Problem:
    """Result of `read` for a regular file, of so many bytes; code, message and hint if it fails."""
    try:
        status = Path(real).stat()
        if not stat.S_ISREG(status.st_mode):
            what = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
            return code, f"the {named} is {what}.", wanted
        return read(status.st_size)
    except FileNotFoundError:
        return (
            code,
            f"there is no {named}.",
            "Check the path; it begins at the folder of this file.",
        )
    except (OSError, ValueError) as error:
        why = reason(error) if isinstance(error, OSError) else "its name cannot be one"
        return code, f"the {named} cannot be read ({why}).", "Check the path."
    except ReadError as error:
        return code, f"the {named} {error.message.removeprefix(real + ': ')}", error.hint


def plain_path(folder: str, path: str) -> str:
    """Path relative to a folder, without dots; the real path where dots lead out of a link."""
    name, real = os.path.normpath(Path(folder, path)), real_path(str(Path(folder, path)))
    return name if real_path(name) == real else real


def _path_problem(path: str, what: str) -> tuple[str, str] | None:
    """Message and hint on a path that is wrong as it is written; None for a good one."""
    hint = "Write a path relative to this file, with forward slashes."
    if not path or "\0" in path:
        return f"{quote(path)} is no path of a {what}.", hint
    if _address(path):
        return (
            f"the {what} {quote(path)} is an address, and nothing is read from the net.",
            "Save the file beside the terrain, and write its path relative to this file.",
        )
    if path.startswith("/") or _drive(path):
        return f"the path {quote(path)} is absolute.", hint
    if "\\" in path:
        return f"the path {quote(path)} has backslashes.", hint
    return None


def _is_under(path: str, folder: str) -> bool:
    return path.startswith(folder if folder.endswith(os.sep) else folder + os.sep)


def path_between(user: SourceDocument, library: SourceDocument) -> str:
    """Path of a library relative to the file that uses it, with forward slashes."""
    return os.path.relpath(library.source.name, user.folder).replace(os.sep, "/")
