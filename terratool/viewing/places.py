"""Where elements stand in the texts that say them: file, line and keys."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from msgspec import Struct

from terratool.definition.libraries import Document, path_between
from terratool.definition.reader import Checked, load_checked
from terratool.field.terrain import Terrain
from terratool.text.display import unescape
from terratool.text.locate import Address, offsets
from terratool.text.numbers import parse_whole
from terratool.text.values import read_values

MOST_ITEMS = 16
"""A list of more items is said by its first ones and their number …"""
MOST_LETTERS = 400
"""… and a text of more letters by its first ones."""

_link = re.compile(r">(?=(?:[^>]*#)?/parts/)")
"""Between two names of a chain; a slash in the name of a part is written ~1."""
_copy = re.compile(r"(/children/\d+)\[[^\]/]*\]")
"""An element that stands for several, and which of them is meant."""
_INNER = "children"


class Site(NamedTuple):
    """A terrain, and the texts that it was made of."""

    terrain: Terrain
    checked: Checked

    @property
    def name(self) -> str:
        """Of the file, without its folder."""
        return Path(self.checked.name).name


def read_site(path: str, library_roots: tuple[str, ...] = (), *, roughness: bool = True) -> Site:
    """Read, check and compile a definition.

    Args:
        path: of the file.
        library_roots: further folders under which the libraries that it uses may lie.
        roughness: whether rough surfaces have their relief.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no valid terrain.
        RequestError: parts and copies come to too many elements to be shown.
    """
    return site_of(load_checked(path, library_roots), roughness=roughness)


def site_of(checked: Checked, *, roughness: bool = True) -> Site:
    """The same of a definition that was checked and has no errors."""
    return Site(Terrain(checked, roughness=roughness).written_out, checked)


class Place(NamedTuple):
    """A value of a text.

    Attributes:
        file: index of the text: 0 is the terrain, others are libraries.
        pointer: JSON pointer in it.
    """

    file: int
    pointer: str


class Places(Struct, frozen=True, dict=True):
    """The texts of a terrain, and what stands where in them."""

    checked: Checked

    @cached_property
    def documents(self) -> Mapping[str, Document]:
        """The texts by the path that names of elements have for them; empty for the terrain."""
        own = self.checked.document
        assert own is not None
        return {"": own, **{path_between(own, one): one for one in own.reached}}

    @property
    def files(self) -> list[str]:
        """Their names: of the terrain without its folder, of libraries from there on."""
        return [Path(self.checked.name).name, *list(self.documents)[1:]]

    def of(self, name: str) -> tuple[Place, ...]:
        """The places of an element by its name, from the one in the terrain to its own."""
        return tuple(self._along(name))

    def _along(self, name: str) -> Iterator[Place]:
        known, file = list(self.documents), 0
        for part in _link.split(name):
            path, _, pointer = part.rpartition("#/parts/")
            if path in known and part.startswith(f"{path}#"):
                file, part = known.index(path), f"/parts/{pointer}"
            yield Place(file, _copy.sub(r"\1", part))

    def lines(self, places: Iterable[Place]) -> dict[Place, int]:
        """The lines that places begin in, from 1."""
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
        """What stands there, as plain values; None where nothing does."""
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
        return [read_values(one.source.data) for one in self.documents.values()]

    def keys(self, place: Place) -> dict[str, Any]:
        """The keys of an element and their values; its children are counted."""
        value = self.value(place)
        if not isinstance(value, dict):
            return {}
        return {
            key: f"{len(item)} elements"
            if key == _INNER and isinstance(item, list)
            else shortened(item)
            for key, item in value.items()
        }


def shortened(value: Any) -> Any:
    """A value with long lists and texts cut off, which says how long they are."""
    if isinstance(value, str) and len(value) > MOST_LETTERS:
        return f"{value[:MOST_LETTERS]}… ({len(value)} letters)"
    if isinstance(value, list):
        items = [shortened(item) for item in value[:MOST_ITEMS]]
        return items if len(value) <= MOST_ITEMS else [*items, f"… ({len(value)} items)"]
    if isinstance(value, dict):
        members = {key: shortened(item) for key, item in list(value.items())[:MOST_ITEMS]}
        return members if len(value) <= MOST_ITEMS else {**members, "…": f"{len(value)} keys"}
    return value
