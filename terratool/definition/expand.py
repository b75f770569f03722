"""Parts and copies written out: what a definition means, as elements of primitives alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

from msgspec import UNSET, Struct, structs

from terratool.definition.chains import Chain, Chains, with_quarters
from terratool.definition.exact import Exact, Sides, rest_of, side, sides
from terratool.definition.model import Definition, Element, Pair, pair_of
from terratool.definition.scattering import Strewn, strewing, strewn, wanted
from terratool.definition.tree import ROOT, Tree
from terratool.definition.uses import Root, Uses, track_surfaces
from terratool.errors import RequestError
from terratool.report.wording import many

MAX_ELEMENTS = 2_000_000
"""So many elements are written out at most."""


class Expansion(NamedTuple):
    """A definition without parts and copies, and its elements laid flat."""

    definition: Definition
    tree: Tree


_Rests = tuple[float, float, float, float]
"""What the doubles of a place and of its sides lack, along x and y each."""


class _Node(NamedTuple):
    """An element to be written out, in its frame.

    Attributes:
        chain: what it stands for.
        factor: on the heights of all that is around it.
        quarters: turns of what is around it.
        place: its cell, or its free place: attributes of the model.
        rests: what the doubles of its free place lack; None where a text has them, or in a cell.
        around: sides of a cell of the grid that it is in; None at a free place.
        span: how many of these it takes.
        step: the end of its name.
    """

    chain: Chain
    factor: float
    quarters: int
    place: dict[str, Any]
    rests: _Rests | None
    around: Sides | None
    span: tuple[int, int]
    step: str

    @property
    def lengths(self) -> Pair:
        """Sides of its cell, units of the terrain."""
        if self.around is None:
            return pair_of(self.place["extent"], math.nan)
        x, y = self.around.lengths
        return x * self.span[0], y * self.span[1]

    @property
    def cell(self) -> Sides:
        """Sides of the cells of which its own has `span`."""
        if self.around is not None:
            return self.around
        own, rests = self.lengths, self.rests or (None,) * 4
        return Sides(side(own[0], rests[2]), side(own[1], rests[3]))


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


_FreePlaces = tuple[list[Exact], list[Exact], Pair]
"""Columns and rows of the copies of an element, and what the doubles of its sides lack."""


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
        level = [_Node(first, 1.0, 0, {}, None, sides(size), (1, 1), ROOT + first.name)]
        columns: dict[str, list[Any]] = {name: [] for name in _NAMES}
        steps: list[str] = []
        rests: list[_Rests | None] = []
        levels = [0]
        families: list[tuple[int, int, int]] = []
        while level:
            start = len(steps)
            after = start + len(level)
            below: list[_Node] = []
            for index, node in enumerate(level, start):
                self._write(node, columns)
                steps.append(node.step)
                rests.append(node.rests)
                begin = after + len(below)
                below += self._children(node)
                if after + len(below) > begin:
                    families.append((index, begin, after + len(below)))
            levels.append(after)
            level = below
        return Tree([], families, levels, columns, steps=steps, rests=rests)

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
        cell, span = node.cell, node.span
        lengths, around = cell.times(span), cell.block(span, turned)
        found = []
        for index in range(begin, end):
            step = f"/children/{index - begin}"
            own = Root(tree, index, root.home)
            if tree.value("scatter", index) is not UNSET:
                area = area_of(own, around.turned(quarters))
                copies = zip(*strewn_over(own, area)[:4], strict=True)
                for number, (length, x, y, turn) in enumerate(copies):
                    if x != x:  # it has found no place
                        continue
                    middle = area.x + Exact(x, 0.0), area.y + Exact(y, 0.0)
                    at = _turned_place(middle[:1], middle[1:], lengths, quarters)[0][0]
                    inner = self.chains.strewn(own, length, turn)
                    name = f"{step}[{number}]{inner.name}"
                    found.append(_free(inner, factor, quarters, at, length, (0.0, 0.0), name))
                continue
            inner = self.chains.of(own)
            repeat = tree.value("repeat", index)
            counts = (1, 1) if repeat is UNSET else repeat.count
            names = [
                f"{step}{'' if repeat is UNSET else f'[{i},{j}]'}{inner.name}"
                for j in range(counts[1])
                for i in range(counts[0])
            ]
            if (extent := tree.value("extent", index)) is not UNSET:
                if repeat is UNSET and quarters == 0:
                    place = {"at": tree.value("at", index), "extent": extent}
                    found.append(_Node(inner, factor, 0, place, None, None, (1, 1), names[0]))
                    continue
                columns, rows, more = self._free_places(tree, index)
                places = _turned_place(columns, rows, lengths, quarters)
                for at, name in zip((at for row in places for at in row), names, strict=True):
                    found.append(_free(inner, factor, quarters, at, extent, more, name))
                continue
            dx, dy = (0, 0) if repeat is UNSET else map(int, repeat.step)
            x, y, w, h = tree.block(index)
            blocks = (
                (x + i * dx, y + j * dy, w, h) for j in range(counts[1]) for i in range(counts[0])
            )
            for block, name in zip(blocks, names, strict=True):
                own_span, place = turned_block(block, grid, quarters)
                found.append(_Node(inner, factor, quarters, place, None, around, own_span, name))
        return found

    @cached_property
    def _known(self) -> dict[tuple[int, int], _FreePlaces]:
        return {}

    def _free_places(self, tree: Tree, index: int) -> _FreePlaces:
        """Where the copies of an element at a free place stand, which a part has for each use."""
        key = id(tree), index
        if key not in self._known:
            wide, tall = pair_of(tree.value("extent", index), math.nan)
            self._known[key] = *_places(tree, index), (rest_of(wide), rest_of(tall))
        return self._known[key]


def _free(
    chain: Chain, factor: float, quarters: int, at: tuple[Exact, Exact], extent: float | Pair,
    more: Pair, name: str,
) -> _Node:  # fmt: skip
    """An element at a free place, which its doubles and what these lack say."""
    place = {"at": (at[0].near, at[1].near), "extent": extent}
    rests = at[0].rest, at[1].rest, *more
    return _Node(chain, factor, quarters, place, rests, None, (1, 1), name)


def _places(tree: Tree, index: int) -> tuple[list[Exact], list[Exact]]:
    """The columns and the rows in which the copies of an element at a free place stand."""
    at, repeat = tree.value("at", index), tree.value("repeat", index)
    found = []
    for axis in (0, 1):
        first = Exact.typed(at[axis])
        places = [first]
        if repeat is not UNSET:
            step = side(repeat.step[axis])
            copies = range(1, repeat.count[axis])
            places += [first + Exact(k * step.high, k * step.rest) for k in copies]
        found.append(places)
    return found[0], found[1]


def _turned_place(
    x: Sequence[Exact], y: Sequence[Exact], lengths: tuple[Exact, Exact], quarters: int
) -> list[list[tuple[Exact, Exact]]]:
    """Places in columns x and rows y of a cell, row by row, after quarter turns.

    Args:
        x: where the columns stand, from the west side of the cell before it is turned.
        y: where the rows stand, from its south side.
        lengths: sides of the cell after the turns.
        quarters: quarter turns.
    """
    if quarters in (1, 2):
        x = [lengths[quarters % 2] + -at for at in x]
    if quarters in (2, 3):
        y = [lengths[3 - quarters] + -at for at in y]
    return [[(row, column) if quarters % 2 else (column, row) for column in x] for row in y]


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
