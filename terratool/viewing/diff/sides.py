"""The old and the new definition, each checked and compiled, and what both call alike."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

from msgspec import UNSET, Struct

from terratool.definition.curves import shape_of
from terratool.definition.libraries import SourceDocument, path_between
from terratool.definition.model import Definition, Primitive, Surface
from terratool.definition.reader import Checked, CheckOptions, check, no_terrain
from terratool.definition.uses import Root, Uses
from terratool.field.terrain import Terrain
from terratool.text.source import Source, read_source


class Side(Struct, frozen=True, dict=True):
    """One of two definitions.

    Attributes:
        checked: the text, without errors.
        terrain: what it means.
    """

    checked: Checked
    terrain: Terrain

    @property
    def name(self) -> str:
        """Of the file."""
        return self.checked.name

    @cached_property
    def uses(self) -> Uses:
        """The parts that it knows and uses."""
        uses = self.checked.uses
        assert uses is not None
        return uses

    @property
    def document(self) -> SourceDocument:
        """The text."""
        return self.uses.document

    @property
    def definition(self) -> Definition:
        """The model of it; its elements may be in its tree alone."""
        assert self.checked.terrain is not None
        return self.checked.terrain

    @cached_property
    def surfaces(self) -> dict[str, Surface]:
        """All surfaces that it knows, those of libraries where they are in use."""
        known, needed = self.uses.names.surfaces, self.uses.needed_names["surfTypes"]
        own = self.document.entries["surfTypes"]
        return {n: named.value for n, named in known.items() if n in needed or n in own}

    @cached_property
    def primitives(self) -> dict[str, Primitive]:
        """All primitives that it knows, likewise."""
        known, needed = self.uses.names.primitives, self.uses.needed_names["elemTypes"]
        own = self.document.entries["elemTypes"]
        return {n: named.value for n, named in known.items() if n in needed or n in own}

    @property
    def parts(self) -> dict[str, Root]:
        """The parts that stand in the terrain, directly or in others."""
        return {name: self.uses.part(name) for name in self.uses.parts_in_use}

    def uses_name(self, dictionary: str, name: str) -> bool:
        """Whether the terrain needs an entry of `surfTypes` or `elemTypes`."""
        return name in self.uses.needed_names[dictionary]  # type: ignore[index]

    def roots(self) -> Iterator[tuple[str, Root]]:
        """The terrain, and each part in it, by name; that of the terrain is empty."""
        yield "", self.uses.root
        yield from self.parts.items()

    def pointer(self, root: Root, index: int) -> str:
        """The name of an element as it stands in its text."""
        pointer = root.tree.pointer(index)
        if root.home is self.document:
            return pointer
        return f"{path_between(self.document, root.home)}#{pointer}"


def read_side(
    name: str,
    *,
    called: str | None = None,
    roots: tuple[str, ...] = (),
    roughness: bool = True,
    named: bool = True,
) -> Side:
    """Read, check and compile one definition.

    Args:
        name: of the file.
        called: the path that it is taken to have: its libraries are looked for from there on.
        roots: further folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
        named: whether a user named the file; one that was met has to be a regular file.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: it is no valid terrain.
    """
    source = read_source(name, named=named)
    if called is not None:
        source = Source(called, source.data, source.packed, source.marked)
    return side_of(source, roots=roots, roughness=roughness)


def side_of(source: Source, *, roots: tuple[str, ...] = (), roughness: bool = True) -> Side:
    """Check and compile a text; raises as `read_side` does."""
    checked = check(source, CheckOptions(warnings=False, library_roots=roots))
    if checked.terrain is None:
        raise no_terrain(source, checked)
    return Side(checked, Terrain(checked, roughness=roughness))


def shape_key(primitive: Primitive) -> Any:
    """What primitives of one shape have in common, however they are written."""
    shape = shape_of(primitive)
    return shape.combine, repr(shape.x), repr(shape.y)


def surface_key(surface: Surface) -> Any:
    """What surfaces of the same figures have in common; what one says of itself does not count."""
    values = {key: getattr(surface, key) for key in Surface.__struct_fields__ if key != "descr"}
    values["void"] = surface.void is True
    return tuple(sorted((key, repr(value)) for key, value in values.items() if value is not UNSET))


def renamed(old: dict[str, Any], new: dict[str, Any]) -> dict[str, str]:
    """Names that only the old side has, each with that of the new one for the same; of one key.

    Args:
        old: keys by name …
        new: … of both sides.
    """
    left: dict[Any, list[str]] = {}
    for name, key in new.items():
        if name not in old:
            left.setdefault(key, []).append(name)
    gone = [name for name in old if name not in new]
    found = {}
    for name in gone:
        names = left.get(old[name])
        if names:
            found[name] = names.pop(0)
    return found
