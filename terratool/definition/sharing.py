"""A definition as templates: each part once, however often and wherever it stands.

A template is what stands in the cell of an element of the text: of the root, or of that of a part,
once for each of its quarter turns and for each surface that it takes from around.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from msgspec import UNSET, UnsetType

from terratool.definition.chains import Chain, Chains, with_quarters
from terratool.definition.expand import (
    MAX_ELEMENTS,
    strewn_at_place,
    turned_block,
    with_names,
    with_names_in_use,
)
from terratool.definition.model import Definition, Pair, pair_of
from terratool.definition.sides import Sides, sides
from terratool.definition.tree import ROOT
from terratool.definition.uses import Root, Uses, copies
from terratool.errors import RequestError
from terratool.text.display import counted

MANY_SIZES = 20_000
"""In so many sizes of their cells templates are looked at for the smallest cell."""

ONE = (1, 1)


class Copies(NamedTuple):
    """Copies of an element along x and y; `across` says that their rows stand along y."""

    counts: tuple[int, int]
    step: Pair
    across: bool


class Node(NamedTuple):
    """An element of a template.

    Attributes:
        chain: what it stands for.
        surface: what it wears, its own or one from around.
        turn: of its primitive, degrees.
        cells: the grid that it has.
        cell: its first cell and how many it takes, of its first copy; (0, 0), (1, 1) where it has
            a place.
        span: how many cells it takes.
        at: its place before a quarter turn mirrors it; None in a cell.
        extent: the sides of its free cell.
        copies: of it.
        inner: the template of what is in it; -1 where that is in this one, or nothing.
        step: the end of its name, before and after the place among the copies.
    """

    chain: Chain
    surface: str | UnsetType
    turn: float
    cells: tuple[int, int]
    cell: tuple[int, int]
    span: tuple[int, int]
    at: Pair | None
    extent: Pair | None
    copies: Copies | None
    inner: int
    step: tuple[str, str]

    @property
    def many(self) -> int:
        """How many copies there are."""
        return 1 if self.copies is None else self.copies.counts[0] * self.copies.counts[1]


class Template(NamedTuple):
    """What stands in the cell of an element.

    Attributes:
        cells: the grid of that.
        quarters: turns of it.
        nodes: elements, breadth first.
        families: parent, first and last but one of the nodes that are siblings; -1 for the root.
        levels: where each level begins, and the number of nodes.
    """

    cells: tuple[int, int]
    quarters: int
    nodes: list[Node]
    families: list[tuple[int, int, int]]
    levels: list[int]


class Blueprint(NamedTuple):
    """A terrain as templates.

    Attributes:
        definition: the terrain, with the names of its libraries.
        root: its root.
        templates: users before what they use; the first is the terrain's.
    """

    definition: Definition
    root: Node
    templates: list[Template]


_Key = tuple[int, int, int, Any]


class _Sketch(NamedTuple):
    """A template whose nodes name what is in them by the keys of templates."""

    template: Template
    inner: list[_Key | None]


def is_shareable(uses: Uses) -> bool:
    """Whether what stands in a part is the same wherever that stands.

    Copies that are scattered over a cell of a grid depend on its sides.
    """
    if not uses.composed:
        return False
    trees = {id(root.tree): root.tree for root in (uses.root, *map(uses.part, uses.reached))}
    return not any(
        scatter is not UNSET and tree.value("at", index) is UNSET
        for tree in trees.values()
        if tree.distinct("scatter") != {UNSET}
        for index, scatter in enumerate(tree.column("scatter"))
    )


def blueprint(uses: Uses) -> Blueprint:
    """The templates of a valid definition, which is shareable.

    Raises:
        RequestError: they come to too many elements.
    """
    return _Drafter(uses).draw()


class _Drafter:
    def __init__(self, uses: Uses) -> None:
        self.uses = uses
        self.chains = Chains(uses)
        self.sketches: dict[_Key, _Sketch] = {}
        self.roots: dict[_Key, Root] = {}
        self.total = 0

    def draw(self) -> Blueprint:
        chain = self.chains.of(self.uses.root)
        tree, element = chain.root.tree, chain.root.element
        first = self._key(chain.root, chain.quarters, chain.surface)
        order = self._sketch_all(first)
        number = {key: index for index, key in enumerate(order)}
        templates = []
        for key in order:
            template, inner = self.sketches[key]
            nodes = [
                node if name is None else node._replace(inner=number[name])
                for node, name in zip(template.nodes, inner, strict=True)
            ]
            templates.append(template._replace(nodes=nodes))
        root = Node(
            chain, chain.surface, _turn(chain, chain.quarters), templates[0].cells, (0, 0), ONE,
            None, None, None, 0 if tree.brood(element)[0] < tree.brood(element)[1] else -1,
            (ROOT, chain.name),
        )  # fmt: skip
        nodes = [root, *(node for template in templates for node in template.nodes)]
        definition = with_names_in_use(
            with_names(self.uses),
            {node.chain.surface for node in nodes},
            {node.chain.root.tree.value("type", node.chain.root.element) for node in nodes},
            self.uses,
        )
        return Blueprint(definition, root, templates)

    def _key(self, root: Root, quarters: int, surface: Any) -> _Key:
        key = id(root.tree), root.element, quarters, surface
        self.roots[key] = root
        return key

    def _sketch_all(self, first: _Key) -> list[_Key]:
        """All templates that one leads to, users before what they use."""
        done: list[_Key] = []
        pending = [(first, False)]
        while pending:
            key, known = pending.pop()
            if known:
                done.append(key)
            elif key not in self.sketches:
                self.sketches[key] = self._sketch(key)
                pending.append((key, True))
                pending += [(name, False) for name in self.sketches[key].inner if name is not None]
        return done[::-1]

    def _sketch(self, key: _Key) -> _Sketch:
        root = self.roots[key]
        *_, quarters, surface = key
        tree = root.tree
        nodes: list[Node] = []
        inner: list[_Key | None] = []
        families: list[tuple[int, int, int]] = []
        levels = [0]
        level = [(-1, root.element, surface)]
        while level:
            below = []
            for parent, element, around in level:
                begin, end = tree.brood(element)
                if begin == end:
                    continue
                families.append((parent, len(nodes), len(nodes)))
                for index in range(begin, end):
                    step = f"/children/{index - begin}"
                    for node in self._nodes(Root(tree, index, root.home), around, quarters, step):
                        chain, name = node.chain, None
                        if chain.root.tree is not tree or chain.root.element != index:
                            first, last = chain.root.tree.brood(chain.root.element)
                            if first < last:
                                turns = (quarters + chain.quarters) % 4
                                name = self._key(chain.root, turns, node.surface)
                        else:
                            below.append((len(nodes), index, node.surface))
                        nodes.append(node)
                        inner.append(name)
                families[-1] = parent, families[-1][1], len(nodes)
            if len(nodes) > levels[-1]:
                levels.append(len(nodes))
            level = below
        self.total += len(nodes)
        if self.total > MAX_ELEMENTS:
            raise RequestError(
                f"{self.uses.document.source.name}: its parts, in all their turns and surfaces, "
                f"come to more than {counted(MAX_ELEMENTS, 'element')}.",
                "Use fewer of them, or name their surfaces in the parts.",
            )
        cells = _turned_cells(root, quarters)
        return _Sketch(Template(cells, quarters, nodes, families, levels), inner)

    def _nodes(self, root: Root, around: Any, quarters: int, step: str) -> Iterator[Node]:
        """An element of the text, or the copies of a scattered one."""
        scatter = root.tree.value("scatter", root.element)
        if scatter is UNSET:
            chain = self.chains.of(root)
            worn = around if chain.surface is UNSET else chain.surface
            yield _node(root, chain, worn, quarters, step)
            return
        for number, (middle, copy) in enumerate(strewn_at_place(root)):
            chain = self.chains.strewn(root, copy)
            worn = around if chain.surface is UNSET else chain.surface
            inner = (quarters + chain.quarters) % 4
            yield Node(
                chain, worn, _turn(chain, inner), _turned_cells(chain.root, inner), (0, 0), ONE,
                middle[::-1] if quarters % 2 else middle, (copy.side, copy.side), None, -1,
                (f"{step}[{number}]", chain.name),
            )  # fmt: skip


def _turn(chain: Chain, quarters: int) -> float:
    turn = with_quarters(chain.turn, quarters)
    return 0.0 if turn is UNSET else turn


def _turned_cells(root: Root, quarters: int) -> tuple[int, int]:
    cells = root.tree.grid(root.element)
    return cells[::-1] if quarters % 2 else cells


def _node(root: Root, chain: Chain, surface: Any, quarters: int, name: str) -> Node:
    """An element that stands in a template of so many quarter turns."""
    tree, index = root.tree, root.element
    repeat, at = tree.value("repeat", index), tree.value("at", index)
    inner_quarters = (quarters + chain.quarters) % 4
    step = name, chain.name
    cell, span, place, extent = (0, 0), ONE, None, None
    odd = quarters % 2 == 1
    if at is UNSET:
        grid = tree.grid(tree.parents[index])
        span, turned = turned_block(tree.block(index), grid, quarters)
        cell = turned["cell_x"], turned["cell_y"]
    else:
        extent = pair_of(tree.value("extent", index), math.nan)
        place = at[::-1] if odd else at
    of = None
    if copies(repeat) > 1:
        count = repeat.count
        dx, dy = (one if many > 1 else 0.0 for one, many in zip(repeat.step, count, strict=True))
        if at is UNSET:  # the place of the first copy is turned, the steps are turned likewise
            dx, dy = float(int(dx)), float(int(dy))
            dx, dy = ((dx, dy), (dy, -dx), (-dx, -dy), (-dy, dx))[quarters]
        elif odd:
            dx, dy = dy, dx
        of = Copies(count[::-1] if odd else count, (dx, dy), odd)
    if repeat is not UNSET and of is None:
        step = f"{step[0]}[0,0]", step[1]
    return Node(
        chain, surface, _turn(chain, inner_quarters), _turned_cells(chain.root, inner_quarters),
        cell, span, place, extent, of, -1, step,
    )  # fmt: skip


def smallest_cell(plan: Blueprint) -> float:
    """The shortest side of any element's cell.

    Exact, as the field has it, unless parts stand in very many sizes; then of those looked at.
    """
    start = sides(plan.definition.extent)
    smallest = min(start.lengths)
    seen = {(0, start)}
    pending = [(0, start)]
    while pending:
        number, extent = pending.pop()
        template = plan.templates[number]
        cells: dict[int, Sides] = {-1: extent}
        for parent, begin, end in template.families:
            around = cells[parent]
            grid = template.cells if parent < 0 else template.nodes[parent].cells
            known: dict[Any, Sides] = {}
            for index in range(begin, end):
                node = template.nodes[index]
                key = node.extent or node.span
                if key not in known:
                    own = sides(node.extent) if node.extent else around.block(node.span, grid)
                    known[key] = own
                    smallest = min(smallest, *_lengths(around, node, grid))
                cells[index] = known[key]
                below = node.inner, known[key]
                if node.inner >= 0 and below not in seen and len(seen) < MANY_SIZES:
                    seen.add(below)
                    pending.append(below)
    return smallest


def _lengths(around: Sides, node: Node, grid: tuple[int, int]) -> Pair:
    if node.extent:
        return node.extent
    cell = around.block(ONE, grid).lengths
    return cell[0] * node.span[0], cell[1] * node.span[1]
