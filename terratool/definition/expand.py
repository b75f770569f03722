"""Parts and copies written out: what a definition means, as elements of primitives alone."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec import UNSET, Struct, structs

from terratool.definition.exact import Exact, Sides, rest_of
from terratool.definition.model import Definition, Pair, pair_of
from terratool.definition.scattering import Strewn, strewing, strewn, wanted
from terratool.definition.tree import Tree
from terratool.definition.uses import Root, Uses, track_surfaces
from terratool.errors import RequestError
from terratool.report.wording import many

if TYPE_CHECKING:
    from terratool.definition.written import Written

MAX_ELEMENTS = 2_000_000
"""So many elements are written out at most."""


class Expansion(Struct, frozen=True, dict=True):
    """A definition without parts and copies, and its elements laid flat.

    Attributes:
        definition: the terrain.
        elements: its tree, or what parts and copies come to.
    """

    definition: Definition
    elements: Tree | Written

    @cached_property
    def tree(self) -> Tree:
        """The elements as a tree."""
        return self.elements if isinstance(self.elements, Tree) else self.elements.tree()


def with_names(uses: Uses) -> Definition:
    """A definition with the names of its libraries, and without its parts."""
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
        RequestError: there are more than `MAX_ELEMENTS`.
    """
    definition, tree = with_names(uses), uses.document.decoded.tree
    if not uses.composed and len(tree.roots) == 1:
        names = tree.distinct("surface"), tree.distinct("type")
        return Expansion(with_names_in_use(definition, *names, uses), tree)
    if uses.elements > MAX_ELEMENTS:
        raise RequestError(
            f"{uses.document.source.name}: parts and copies come to {many(uses.elements)} "
            f"elements, and more than {MAX_ELEMENTS:,} are not written out.",
            "Lower the counts, or leave out the smallest parts.",
        )
    from terratool.definition.written import written

    elements = written(uses, definition)
    definition = structs.replace(definition, elem_tree=UNSET)
    surfaces, primitives = map(elements.different, (elements.rows.surface, elements.rows.type))
    return Expansion(with_names_in_use(definition, surfaces, primitives, uses), elements)


def with_names_in_use(
    definition: Definition, surfaces: set[Any], primitives: set[Any], uses: Uses
) -> Definition:
    """A definition without what libraries have and no element names; a file's own names stay."""
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


class Area(NamedTuple):
    """The cell over which copies of an element are scattered.

    Attributes:
        x: west side, from the corner of the cell of the element's parent.
        y: south side, likewise.
        lengths: sides, units of the terrain.
    """

    x: Exact
    y: Exact
    lengths: Pair


def area_of(root: Root, around: Sides | None) -> Area:
    """The area of a scattered element.

    Args:
        root: the element.
        around: sides of the cells of its parent's grid, before quarter turns of what is around;
            it needs none at a free place.
    """
    tree, index = root.tree, root.element
    at, extent = tree.value("at", index), tree.value("extent", index)
    if at is UNSET:
        assert around is not None
        x, y, w, h = tree.block(index)
        lengths = around.x.times(w).near, around.y.times(h).near
        return Area(around.x.times(x), around.y.times(y), lengths)
    lengths = pair_of(extent, math.nan)
    west, south = (
        Exact.typed(middle) + Exact(-0.5 * length, -0.5 * rest_of(length))
        for middle, length in zip(at, lengths, strict=True)
    )
    return Area(west, south, lengths)


def strewn_over(root: Root, area: Area) -> Strewn:
    """The copies of a scattered element in its area."""
    tree, index = root.tree, root.element
    angle, scatter = tree.value("turn_deg", index), tree.value("scatter", index)
    asked = strewing(
        scatter,
        area.lengths,
        by_quarters=tree.value("part", index) is not UNSET,
        tilted=angle is not UNSET and angle % 90 != 0,
    )
    return strewn(asked, wanted(scatter, area.lengths))


def turned_block(
    block: tuple[int, int, int, int], grid: tuple[int, int], quarters: int
) -> tuple[tuple[int, int], dict[str, Any]]:
    """The span, and the place, of a block of cells of a grid after quarter turns."""
    x, y, w, h = block
    if quarters == 1:
        x, y, w, h = y, grid[0] - x - w, h, w
    elif quarters == 2:
        x, y = grid[0] - x - w, grid[1] - y - h
    elif quarters == 3:
        x, y, w, h = grid[1] - y - h, x, h, w
    span = UNSET if (w, h) == (1, 1) else (w, h)
    return (w, h), {"cell_x": x, "cell_y": y, "span": span}
