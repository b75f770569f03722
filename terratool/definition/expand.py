"""Parts and copies written out: what a definition means, as elements of primitives alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

from msgspec import UNSET, Struct, structs

from terratool.definition.chains import Chain, Chains, with_quarters
from terratool.definition.model import Definition, Element, Pair, pair_of
from terratool.definition.scattering import Strewn, strewn
from terratool.definition.sides import Side, side
from terratool.definition.tree import ROOT, Tree
from terratool.definition.uses import Root, Uses, track_surfaces
from terratool.errors import RequestError
from terratool.text.display import many

MAX_ELEMENTS = 2_000_000
"""So many elements are written out at most."""


class Expansion(NamedTuple):
    """A definition without parts and copies, and its elements laid flat."""

    definition: Definition
    tree: Tree


_ONCE = (1, 1), (0.0, 0.0)


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

    chain: Chain
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
        return _with_names_in_use(Expansion(definition, tree), uses)
    if uses.elements > MAX_ELEMENTS:
        raise RequestError(
            f"{uses.document.source.name}: parts and copies come to {many(uses.elements)} "
            f"elements, and more than {MAX_ELEMENTS:,} are not written out.",
            "Lower the counts, or leave out the smallest parts.",
        )
    written = Expansion(
        structs.replace(definition, elem_tree=UNSET), _Writer(uses, definition).tree()
    )
    return _with_names_in_use(written, uses)


def _with_names_in_use(expansion: Expansion, uses: Uses) -> Expansion:
    definition, tree = expansion
    worn, wearing = tree.distinct("surface"), tree.distinct("type")
    return Expansion(with_names_in_use(definition, worn, wearing, uses), tree)


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


_NAMES = tuple(name for name in Element.__struct_fields__ if name != "children")


class _Writer(Struct, frozen=True, dict=True):
    """Writes elements level by level, column by column."""

    uses: Uses
    definition: Definition

    @cached_property
    def chains(self) -> Chains:
        """What elements stand for."""
        return Chains(self.uses)

    def tree(self) -> Tree:
        """All elements."""
        size = self.definition.extent
        first = self.chains.of(self.uses.root)
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
        cells = tree.value("cells", index)
        if quarters % 2 and isinstance(cells, tuple):
            cells = cells[::-1]
        factor, scale = node.factor * chain.factor, chain.scale
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
            "turn_deg": with_quarters(chain.turn, quarters),
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
            step = f"/children/{index - begin}"
            if tree.value("scatter", index) is not UNSET:
                found += self._strewn(node, Root(tree, index, root.home), step)
                continue
            inner = self.chains.of(Root(tree, index, root.home))
            repeat, at = tree.value("repeat", index), tree.value("at", index)
            count, (dx, dy) = _ONCE if repeat is UNSET else (repeat.count, repeat.step)
            for j in range(count[1]):
                for i in range(count[0]):
                    copy = f"{step}{'' if repeat is UNSET else f'[{i},{j}]'}{inner.name}"
                    if at is UNSET:
                        x, y, w, h = tree.block(index)
                        x, y = x + i * int(dx), y + j * int(dy)
                        span, place = turned_block((x, y, w, h), grid, quarters)
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

    def _strewn(self, node: _Node, root: Root, step: str) -> list[_Node]:
        """The copies of a scattered element in the cell of its parent."""
        tree, index, parent = root.tree, root.element, node.chain.root
        quarters = (node.quarters + node.chain.quarters) % 4
        factor = node.factor * node.chain.factor
        around = node.lengths[::-1] if quarters % 2 else node.lengths
        if tree.value("at", index) is UNSET:
            grid, block = tree.grid(parent.element), tree.block(index)
            pitches = (around[0] / grid[0], around[1] / grid[1])
            area = pitches[0] * block[2], pitches[1] * block[3]
            copies = _strewn_over(root, (pitches[0] * block[0], pitches[1] * block[1]), area)
        else:
            copies = strewn_at_place(root)
        found = []
        for number, (middle, copy) in enumerate(copies):
            inner = self.chains.strewn(root, copy)
            place = {"at": _turned_place(middle, node.lengths, quarters), "extent": copy.side}
            own, name = side(copy.side), f"{step}[{number}]{inner.name}"
            found.append(_Node(inner, factor, quarters, place, (own, own), (1, 1), name))
        return found


def strewn_at_place(root: Root) -> Iterator[tuple[Pair, Strewn]]:
    """The copies of an element that is scattered over a free cell, and their middles."""
    tree, index = root.tree, root.element
    at, area = tree.value("at", index), pair_of(tree.value("extent", index), math.nan)
    return _strewn_over(root, (at[0] - area[0] / 2, at[1] - area[1] / 2), area)


def _strewn_over(root: Root, corner: Pair, area: Pair) -> Iterator[tuple[Pair, Strewn]]:
    tree, index = root.tree, root.element
    angle = tree.value("turn_deg", index)
    copies = strewn(
        tree.value("scatter", index),
        area,
        by_quarters=tree.value("part", index) is not UNSET,
        tilted=angle is not UNSET and angle % 90 != 0,
    )
    for copy in copies:
        yield (corner[0] + copy.middle[0], corner[1] + copy.middle[1]), copy


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
