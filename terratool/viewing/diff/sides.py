"""The old and the new definition, each checked and compiled, and keys for equal entries."""

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
from terratool.field.rasters import grid_digest
from terratool.field.terrain import Terrain
from terratool.text.source import Source, read_source


class DiffSide(Struct, frozen=True, dict=True):
    """One of two definitions that are compared.

    Attributes:
        checked: checked text, without errors.
        terrain: terrain compiled from it.
    """

    checked: Checked
    terrain: Terrain

    @property
    def ground(self) -> Terrain:
        """The terrain without its storeys."""
        return self.terrain.ground_alone

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.checked.name

    @cached_property
    def uses(self) -> Uses:
        """Parts and names that the definition knows and uses."""
        uses = self.checked.uses
        assert uses is not None
        return uses

    @property
    def document(self) -> SourceDocument:
        """Text of the definition."""
        return self.uses.document

    @property
    def definition(self) -> Definition:
        """Model of the text; its elements may be in its tree alone."""
        assert self.checked.terrain is not None
        return self.checked.terrain

    @cached_property
    def surfaces(self) -> dict[str, Surface]:
        """Surfaces by name: its own, and those of libraries that are in use."""
        known, needed = self.uses.names.surfaces, self.uses.needed_names["surfTypes"]
        own = self.document.entries["surfTypes"]
        return {n: named.value for n, named in known.items() if n in needed or n in own}

    @cached_property
    def primitives(self) -> dict[str, Primitive]:
        """Primitives by name: its own, and those of libraries that are in use."""
        known, needed = self.uses.names.primitives, self.uses.needed_names["elemTypes"]
        own = self.document.entries["elemTypes"]
        return {n: named.value for n, named in known.items() if n in needed or n in own}

    @property
    def parts(self) -> dict[str, Root]:
        """Roots of the parts in the terrain, directly or in other parts, by name."""
        return {name: self.uses.part(name) for name in self.uses.parts_in_use}

    def uses_name(self, dictionary: str, name: str) -> bool:
        """Whether the terrain needs an entry of `surfTypes` or `elemTypes`."""
        return name in self.uses.needed_names[dictionary]  # type: ignore[index]

    def roots(self) -> Iterator[tuple[str, Root]]:
        """Names and roots of the terrain and of each part in it; the terrain's name is empty."""
        yield "", self.uses.root
        yield from self.parts.items()

    def pointer(self, root: Root, index: int) -> str:
        """JSON pointer of an element, with the file before it in a library."""
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
) -> DiffSide:
    """Read, check and compile one definition.

    Args:
        name: name of the file.
        called: path that the file is taken to have, from which libraries are looked for.
        roots: further folders under which libraries may lie.
        roughness: whether rough surfaces have their relief.
        named: whether a user named the file; a file met in a folder must be a regular one.

    Raises:
        ReadError: the file cannot be read.
        DefinitionError: the text is no valid terrain.
    """
    source = read_source(name, named=named)
    if called is not None:
        source = Source(called, source.data, source.packed, source.marked)
    return side_of(source, roots=roots, roughness=roughness)


def side_of(source: Source, *, roots: tuple[str, ...] = (), roughness: bool = True) -> DiffSide:
    """Check and compile a text; errors are those of `read_side`."""
    checked = check(source, CheckOptions(warnings=False, library_roots=roots))
    if checked.terrain is None:
        raise no_terrain(source, checked)
    return DiffSide(checked, Terrain(checked, roughness=roughness))


def shape_key(primitive: Primitive) -> Any:
    """Key of a primitive's shape, equal for equal shapes however they are written."""
    shape = shape_of(primitive)
    if shape.grid is not None:
        return shape.combine, grid_digest(shape.grid)
    return shape.combine, shape.x, shape.y


def surface_key(surface: Surface) -> Any:
    """Key of a surface's figures, equal for equal figures; the description does not count."""
    values = {key: getattr(surface, key) for key in Surface.__struct_fields__ if key != "descr"}
    values["void"] = surface.void is True
    return tuple(sorted((key, repr(value)) for key, value in values.items() if value is not UNSET))


def find_renames(old: dict[str, Any], new: dict[str, Any]) -> dict[str, str]:
    """New names of renamed entries, by their old names: an old and a new one of equal keys.

    Args:
        old: keys of the old entries by name.
        new: keys of the new entries by name.
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
