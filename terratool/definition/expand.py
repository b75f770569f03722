"""Expansion: a definition with parts and copies written out, as elements of primitives alone."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from msgspec import UNSET, Struct, structs

from terratool.definition.model import Definition
from terratool.definition.tree import Tree
from terratool.definition.uses import MAX_ELEMENTS, Uses, track_surfaces
from terratool.errors import RequestError
from terratool.report.wording import many

if TYPE_CHECKING:
    from terratool.definition.written import Written


class Expansion(Struct, frozen=True, dict=True):
    """Definition without parts and copies, with all its elements.

    Attributes:
        definition: the terrain.
        elements: tree of the definition, or the elements that parts and copies come to.
    """

    definition: Definition
    elements: Tree | Written

    @cached_property
    def tree(self) -> Tree:
        """Elements as a tree."""
        return self.elements if isinstance(self.elements, Tree) else self.elements.tree()


def with_names(uses: Uses) -> Definition:
    """Definition with the names of its libraries, and without its parts."""
    definition = uses.document.model
    assert isinstance(definition, Definition)
    names = uses.names
    return structs.replace(
        definition,
        use=UNSET,
        parts=UNSET,
        surf_types={name: named.value for name, named in names.surfaces.items()}
        if names.surfaces
        else definition.surf_types,
        elem_types={name: named.value for name, named in names.primitives.items()}
        if names.primitives
        else definition.elem_types,
    )


def expand(uses: Uses) -> Expansion:
    """Write out the parts and copies of a valid definition.

    Raises:
        RequestError: the definition comes to more than `MAX_ELEMENTS`.
    """
    definition, tree = with_names(uses), uses.document.decoded.tree
    if not uses.is_composed and len(tree.roots) == 1:
        names = tree.worn, tree.shapes
        return Expansion(with_names_in_use(definition, *names, uses), tree)
    if uses.elements > MAX_ELEMENTS:
        raise RequestError(
            f"{uses.document.source.name}: parts and copies come to {many(uses.elements)} "
            f"elements, and more than {MAX_ELEMENTS:,} are not written out.",
            "Lower the counts, or leave out the smallest parts.",
        )
    from terratool.definition.written import write_out

    elements = write_out(uses, definition)
    definition = structs.replace(definition, elem_tree=UNSET)
    names = elements.worn, elements.shapes
    return Expansion(with_names_in_use(definition, *names, uses), elements)


def with_names_in_use(
    definition: Definition, surfaces: set[Any], primitives: set[Any], uses: Uses
) -> Definition:
    """Definition without entries of libraries that no element names; a file's own entries stay."""
    if not uses.document.uses:
        return definition
    own = uses.document.entries
    surfaces = surfaces | track_surfaces(definition) | own["surfTypes"].keys()
    primitives = primitives | own["elemTypes"].keys()
    return structs.replace(
        definition,
        surf_types={n: value for n, value in definition.surfaces.items() if n in surfaces},
        elem_types={n: value for n, value in definition.primitives.items() if n in primitives},
    )
