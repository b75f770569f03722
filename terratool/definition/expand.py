"""Parts and copies written out: what a definition means, as elements of primitives alone."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from msgspec import UNSET, Struct, UnsetType, structs

from terratool.definition.libraries import Document, entries, path_between
from terratool.definition.model import Definition, Element, Pair, pair_of
from terratool.definition.sides import Side, side
from terratool.definition.tree import ROOT, Tree
from terratool.definition.uses import Root, Uses, quarter_turns
from terratool.errors import RequestError
from terratool.text.display import escape

MAX_ELEMENTS = 2_000_000
"""So many elements are written out at most."""


class Expansion(NamedTuple):
    """A definition without parts and copies, and its elements laid flat."""

    definition: Definition
    tree: Tree


_ONCE = (1, 1), (0.0, 0.0)


class _Chain(NamedTuple):
    """An element of a primitive, and what the elements that stand for it add, inner ones first.

    Attributes:
        root: where the element of the primitive stands.
        factor: on every height of the part.
        offset: of the element, with those of the others and under their factors.
        quarters: turns of the whole part.
        surface: what it wears.
        descr: what it is.
        name: the end of its name.
    """

    root: Root
    factor: float
    offset: float | UnsetType
    quarters: int
    surface: Any
    descr: Any
    name: str


class _Node(NamedTuple):
    """An element to be written out, in its frame.

    Attributes:
        chain: what it stands for.
        factor: on the heights of all that is around it.
        quarters: turns of what is around it.
        place: its cell, or its free place: attributes of the model.
        cell: a cell of the grid that it is in, or its own where that is free, along x and y.
        span: how many of these it takes.
        step: the end of its name.
    """

    chain: _Chain
    factor: float
    quarters: int
    place: dict[str, Any]
    cell: tuple[Side, Side]
    span: tuple[int, int]
    step: str

    @property
    def lengths(self) -> Pair:
        """The sides of its cell."""
        return self.cell[0].length * self.span[0], self.cell[1].length * self.span[1]


def expand(uses: Uses) -> Expansion:
    """Write out the parts and copies of a valid definition.

    Raises:
        RequestError: there are more than `MAX_ELEMENTS`.
    """
    definition = uses.document.model
    assert isinstance(definition, Definition)
    tree = uses.document.decoded.tree
    names = uses.names
    definition = structs.replace(
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
    if not uses.composed and len(tree.roots) == 1:
        return _with_names_in_use(Expansion(definition, tree), uses)
    if uses.elements > MAX_ELEMENTS:
        raise RequestError(
            f"{uses.document.source.name}: parts and copies come to {uses.elements:,} elements, "
            f"and more than {MAX_ELEMENTS:,} are not written out.",
            "Lower the counts, or leave out the smallest parts.",
        )
    written = Expansion(
        structs.replace(definition, elem_tree=UNSET), _Writer(uses, definition).tree()
    )
    return _with_names_in_use(written, uses)


def _with_names_in_use(expansion: Expansion, uses: Uses) -> Expansion:
    """Without what libraries have and nothing wears; a file's own names stay."""
    if not uses.document.uses:
        return expansion
    definition, tree = expansion
    own = uses.document.model
    tracks = () if definition.tracks is UNSET else definition.tracks
    surfaces = {*tree.distinct("surface"), *(track.surface for track in tracks)}
    surfaces |= entries(own, "surfTypes").keys()
    primitives = tree.distinct("type") | entries(own, "elemTypes").keys()
    definition = structs.replace(
        definition,
        surf_types={n: value for n, value in definition.surfaces.items() if n in surfaces},
        elem_types={n: value for n, value in definition.primitives.items() if n in primitives},
    )
    return Expansion(definition, tree)


_NAMES = tuple(name for name in Element.__struct_fields__ if name != "children")


class _Writer(Struct, frozen=True, dict=True):
    """Writes elements level by level, column by column."""

    uses: Uses
    definition: Definition

    def tree(self) -> Tree:
        """All elements."""
        size = self.definition.extent
        first = self._chain(self.uses.root)
        level = [
            _Node(first, 1.0, 0, {}, (side(size[0]), side(size[1])), (1, 1), ROOT + first.name)
        ]
        columns: dict[str, list[Any]] = {name: [] for name in _NAMES}
        steps: list[str] = []
        levels = [0]
        families: list[tuple[int, int, int]] = []
        while level:
            start = len(steps)
            after = start + len(level)
            below: list[_Node] = []
            for index, node in enumerate(level, start):
                self._write(node, columns)
                steps.append(node.step)
                begin = after + len(below)
                below += self._children(node)
                if after + len(below) > begin:
                    families.append((index, begin, after + len(below)))
            levels.append(after)
            level = below
        return Tree([], families, levels, columns, steps=steps)

    def _write(self, node: _Node, columns: dict[str, list[Any]]) -> None:
        chain, tree, index = node.chain, node.chain.root.tree, node.chain.root.element
        quarters = (node.quarters + chain.quarters) % 4
        turn, cells = tree.value("turn_deg", index), tree.value("cells", index)
        if quarters:
            turn = (math.fmod(0.0 if turn is UNSET else turn, 360.0) + 90.0 * quarters) % 360.0
            if quarters % 2 and isinstance(cells, tuple):
                cells = cells[::-1]
        factor, scale = node.factor * chain.factor, tree.value("v_scale", index)
        if factor != 1.0:
            if scale is UNSET:
                lengths, size = node.lengths, self.definition.extent
                scale = min(lengths[0] / size[0], lengths[1] / size[1])
            scale = factor * scale
        offset = chain.offset
        written = dict.fromkeys(_NAMES, UNSET) | node.place
        written |= {
            "descr": chain.descr,
            "type": tree.value("type", index),
            "surface": chain.surface,
            "v_scale": scale,
            "v_offset": offset if offset is UNSET else node.factor * offset,
            "turn_deg": turn,
            "cells": cells,
        }
        for name, value in written.items():
            columns[name].append(value)

    def _children(self, node: _Node) -> list[_Node]:
        chain, root = node.chain, node.chain.root
        tree = root.tree
        begin, end = tree.brood(root.element)
        if begin == end:
            return []
        quarters = (node.quarters + chain.quarters) % 4
        factor = node.factor * chain.factor
        grid = tree.grid(root.element)
        turned = grid[::-1] if quarters % 2 else grid
        cell = (
            node.cell[0].share(node.span[0], turned[0]),
            node.cell[1].share(node.span[1], turned[1]),
        )
        lengths = node.lengths
        found = []
        for index in range(begin, end):
            inner = self._chain(Root(tree, index, root.home))
            step = f"/children/{index - begin}"
            repeat, at = tree.value("repeat", index), tree.value("at", index)
            count, (dx, dy) = _ONCE if repeat is UNSET else (repeat.count, repeat.step)
            for j in range(count[1]):
                for i in range(count[0]):
                    copy = f"{step}{'' if repeat is UNSET else f'[{i},{j}]'}{inner.name}"
                    if at is UNSET:
                        x, y, w, h = tree.block(index)
                        x, y = x + i * int(dx), y + j * int(dy)
                        span, place = _turned_block((x, y, w, h), grid, quarters)
                        found.append(_Node(inner, factor, quarters, place, cell, span, copy))
                    else:
                        extent = pair_of(tree.value("extent", index), math.nan)
                        middle = at if repeat is UNSET else (at[0] + i * dx, at[1] + j * dy)
                        place = {
                            "at": _turned_place(middle, lengths, quarters),
                            "extent": tree.value("extent", index),
                        }
                        own = side(extent[0]), side(extent[1])
                        found.append(_Node(inner, factor, quarters, place, own, (1, 1), copy))
        return found

    def _chain(self, root: Root) -> _Chain:
        """What an element stands for."""
        known: dict[tuple[int, int], _Chain] = self.__dict__.setdefault("_chains", {})
        key = id(root.tree), root.element
        if key in known:
            return known[key]
        places = []
        names = []
        inner = root
        while (name := inner.tree.value("part", inner.element)) is not UNSET:
            places.append(inner)
            outer, inner = inner, self.uses.part(name)
            names.append(self._name(name, outer.home, inner.home))
        tree = inner.tree
        offset, surface, descr = (
            tree.value(key, inner.element) for key in ("v_offset", "surface", "descr")
        )
        quarters, factor = 0, 1.0
        for place in places:
            by = place.tree.value("v_scale", place.element)
            factor *= 1.0 if by is UNSET else by
        for place in reversed(places):
            own = {
                key: place.tree.value(key, place.element)
                for key in ("v_scale", "v_offset", "surface", "descr", "turn_deg")
            }
            if offset is not UNSET and own["v_scale"] is not UNSET:
                offset = own["v_scale"] * offset
            if own["v_offset"] is not UNSET:
                offset = own["v_offset"] if offset is UNSET else offset + own["v_offset"]
            surface = own["surface"] if surface is UNSET else surface
            descr = descr if own["descr"] is UNSET else own["descr"]
            quarters += quarter_turns(own["turn_deg"])
        chain = _Chain(inner, factor, offset, quarters % 4, surface, descr, "".join(names))
        known[key] = chain
        return chain

    def _name(self, part: str, outer: Document, home: Document) -> str:
        where = "" if home is outer else f"{path_between(self.uses.document, home)}#"
        return f">{where}/parts/{escape(part)}"


def _turned_block(
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


def _turned_place(at: Pair, lengths: Pair, quarters: int) -> Pair:
    """A place in a cell after quarter turns, of which the cell has these sides then."""
    x, y = at
    if quarters == 1:
        return y, lengths[1] - x
    if quarters == 2:
        return lengths[0] - x, lengths[1] - y
    if quarters == 3:
        return lengths[0] - y, x
    return at
