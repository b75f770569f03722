"""Places of elements in the texts of a terrain: file, line and keys."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from msgspec import Struct

from terratool.definition.libraries import SourceDocument, path_between
from terratool.definition.reader import Checked, load_checked
from terratool.field.terrain import Terrain
from terratool.text.display import unescape
from terratool.text.locate import Address, offsets
from terratool.text.numbers import parse_whole
from terratool.text.values import read_values

MOST_ITEMS = 16
"""Most items of a list or keys of an object that are shown."""
MOST_LETTERS = 400
"""Most letters of a text that are shown."""

_link = re.compile(r">(?=(?:[^>]*#)?/parts/)")
"""Pattern between two names of a chain; a slash in the name of a part is written ~1."""
_copy = re.compile(r"(/children/\d+)\[[^\]/]*\]")
"""Pattern of an element that stands for several, with the number of one of these."""
_INNER = "children"
"""Key of an element's children."""


class Site(NamedTuple):
    """A terrain with the texts that it was made from.

    Attributes:
        terrain: the ground of the terrain, with all parts written out.
        checked: the definition and its libraries, checked.
    """

    terrain: Terrain
    checked: Checked

    @property
    def name(self) -> str:
        """Name of the definition's file, without its folder."""
        return Path(self.checked.name).name


def read_site(path: str, library_roots: tuple[str, ...] = (), *, roughness: bool = True) -> Site:
    """Read, check and compile a definition.

    Args:
        path: path of the definition.
        library_roots: further folders under which the libraries that it uses may lie.
        roughness: whether rough surfaces have their relief.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the file is no valid terrain.
        RequestError: parts and copies come to too many elements to be shown.
    """
    return site_of(load_checked(path, library_roots), roughness=roughness)


def site_of(checked: Checked, *, roughness: bool = True) -> Site:
    """Compile a checked definition without errors, as `read_site` does."""
    return Site(Terrain(checked, roughness=roughness).written_out, checked)


class Place(NamedTuple):
    """The place of a value in a text.

    Attributes:
        file: index of the text: 0 is the terrain, others are libraries.
        pointer: JSON pointer of the value in the text.
    """

    file: int
    pointer: str


class Places(Struct, frozen=True, dict=True):
    """The texts of a terrain, in which places of elements are looked up."""

    checked: Checked

    @cached_property
    def documents(self) -> Mapping[str, SourceDocument]:
        """Texts by the path with which names of elements begin; "" for the terrain."""
        own = self.checked.document
        assert own is not None
        return {"": own, **{path_between(own, one): one for one in own.all_libraries}}

    @property
    def files(self) -> list[str]:
        """Names of the files: the terrain's without folder, libraries' relative to it."""
        return [Path(self.checked.name).name, *list(self.documents)[1:]]

    def of(self, name: str) -> tuple[Place, ...]:
        """The places of an element by its name: from the use in the terrain to its own text."""
        return tuple(self._chain(name))

    def _chain(self, name: str) -> Iterator[Place]:
        """The places of an element by its name, see `of`."""
        known, file = list(self.documents), 0
        for part in _link.split(name):
            path, _, pointer = part.rpartition("#/parts/")
            if path in known and part.startswith(f"{path}#"):
                file, part = known.index(path), f"/parts/{pointer}"
            yield Place(file, _copy.sub(r"\1", part))

    def lines(self, places: Iterable[Place]) -> dict[Place, int]:
        """Numbers of the lines in which places begin, from 1, ordered by file and line."""
        found = {}
        by_file: dict[int, list[Place]] = {}
        for place in dict.fromkeys(places):
            by_file.setdefault(place.file, []).append(place)
        documents = list(self.documents.values())
        for file, wanted in by_file.items():
            data = documents[file].source.data
            at = offsets(data, [Address(place.pointer) for place in wanted])
            order = sorted(range(len(at)), key=at.__getitem__)
            line, before = 1, 0
            for index in order:
                # CRLF, LF and CR end a line
                passed = data[before : at[index]]
                line += passed.count(b"\n") + passed.count(b"\r") - passed.count(b"\r\n")
                before = at[index]
                found[wanted[index]] = line
        return found

    def value(self, place: Place) -> Any:
        """The value at a place, as plain Python values; None where there is none."""
        found = self._values[place.file]
        for token in place.pointer.split("/")[1:]:
            if isinstance(found, list):
                index = parse_whole(token)
                found = None if index is None or index >= len(found) else found[index]
            elif isinstance(found, dict):
                found = found.get(unescape(token))
        return found

    @cached_property
    def _values(self) -> list[Any]:
        """Plain Python values of all texts."""
        return [read_values(one.source.data) for one in self.documents.values()]

    def keys(self, place: Place) -> dict[str, Any]:
        """Keys and shortened values of an element; a number in the place of its children."""
        value = self.value(place)
        if not isinstance(value, dict):
            return {}
        return {
            key: f"{len(item)} elements"
            if key == _INNER and isinstance(item, list)
            else shorten(item)
            for key, item in value.items()
        }


def shorten(value: Any) -> Any:
    """Shorten a value: long lists, objects and texts are cut off, and end with their length."""
    if isinstance(value, str) and len(value) > MOST_LETTERS:
        return f"{value[:MOST_LETTERS]}… ({len(value)} letters)"
    if isinstance(value, list):
        items = [shorten(item) for item in value[:MOST_ITEMS]]
        return items if len(value) <= MOST_ITEMS else [*items, f"… ({len(value)} items)"]
    if isinstance(value, dict):
        members = {key: shorten(item) for key, item in list(value.items())[:MOST_ITEMS]}
        return members if len(value) <= MOST_ITEMS else {**members, "…": f"{len(value)} keys"}
    return value
