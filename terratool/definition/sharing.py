"""Blueprints: a definition as templates, each part once, however often and wherever it stands.

A template has the elements in the cell of an element of the text: of the root, of a scattered one,
or of a part's. A part has a template for each of its quarter turns, for each surface that it takes
from around, and, where copies are scattered over cells of it, for each size of its cell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.chains import Chain, Chains, with_quarters
from terratool.definition.exact import Exact, Sides, side, sides
from terratool.definition.expand import with_names, with_names_in_use
from terratool.definition.model import Definition, Pair, pair_of
from terratool.definition.scatter_areas import area_of, copies_over
from terratool.definition.tree import ROOT, with_classes
from terratool.definition.turning import turn_block
from terratool.definition.uses import MAX_ELEMENTS, Root, Uses, copies, scatters_over_cells
from terratool.errors import RequestError
from terratool.report.wording import count_of

MANY_SIZES = 20_000
"""Most sizes of cells of templates that are compared for the smallest cell."""

ONE = (1, 1)


class Copies(NamedTuple):
    """Copies of an element along x and y; `across` tells that their rows stand along y."""

    counts: tuple[int, int]
    step: Pair
    across: bool


class BlueprintNode(NamedTuple):
    """Element of a template, or all copies of a scattered one.

    For a scattered element `turn`, `cells`, `at`, `rests`, `extent`, `inner` and numbers of the
    chain may be arrays with a row for each copy that has found a place.

    Attributes:
        chain: chain from the element to its primitive.
        surface: name of the surface of the element, its own or one from around.
        turn: turn of the element's primitive, degrees.
        cells: columns and rows of the element's grid.
        cell: first cell of the first copy; (0, 0) at a free place.
        span: columns and rows of cells that the element takes; (1, 1) at a free place.
        at: free place before a quarter turn mirrors it; None in a cell.
        rests: rests of the doubles of the places of scattered copies; None for other elements.
        extent: sides of the free cell; None in a cell of a grid.
        copies: rows of copies of the element; None where it stands alone.
        numbers: indices of scattered copies in their list by size; None for other elements.
        inner: number of the template of the elements in it; -1 where there are none, or they are in
            this template.
        step: end of the element's name, before and after the place among the copies.
    """

    chain: Chain
    surface: Any
    turn: Any
    cells: Any
    cell: tuple[int, int]
    span: tuple[int, int]
    at: Any
    rests: Any
    extent: Any
    copies: Copies | None
    numbers: NDArray[np.int64] | None
    inner: Any
    step: tuple[str, str]

    @property
    def rows(self) -> int:
        """Number of rows in a table of elements: one, or one for each scattered copy."""
        return 1 if self.numbers is None else len(self.numbers)

    @property
    def many(self) -> int:
        """Number of elements that each row stands for."""
        return 1 if self.copies is None else self.copies.counts[0] * self.copies.counts[1]


class Template(NamedTuple):
    """Elements in the cell of an element.

    Attributes:
        cells: columns and rows of the grid of that element.
        quarters: quarter turns of the template, 0 to 3.
        nodes: elements, breadth first.
        families: parent, first and end (exclusive) of the nodes that are siblings; parent -1 is the
            root.
        levels: first node of each level, and the number of nodes.
    """

    cells: tuple[int, int]
    quarters: int
    nodes: list[BlueprintNode]
    families: list[tuple[int, int, int]]
    levels: list[int]


class Blueprint(NamedTuple):
    """Terrain as templates.

    Attributes:
        definition: terrain, with the names of its libraries.
        root: root of the terrain.
        templates: templates, users before those that they use; the terrain's is the first.
    """

    definition: Definition
    root: BlueprintNode
    templates: list[Template]


class _Cell(NamedTuple):
    """Cell of an element, before quarter turns of the part that it is in.

    Attributes:
        sides: sides of the cells of which the cell takes `span`.
        span: columns and rows of these cells.
    """

    sides: Sides
    span: tuple[int, int]

    def turn_by(self, quarters: int) -> _Cell:
        """Return the cell after quarter turns."""
        return _Cell(self.sides.turn_by(quarters), self.span[::-1] if quarters % 2 else self.span)


class _Key(NamedTuple):
    """Key of a template: the place of its text, and all that it takes from around.

    Attributes:
        tree: identity of the tree of the element whose cell it fills.
        element: index of that element in the tree.
        quarters: quarter turns of the template.
        surface: surface around the element.
        cell: cell that the template fills; None unless the template depends on its size.
    """

    tree: int
    element: int
    quarters: int
    surface: Any
    cell: _Cell | None


class _Inner(NamedTuple):
    """Templates of the elements in an element: one for all its copies, or one of `keys` each."""

    keys: list[_Key]
    which: NDArray[np.int64] | None = None


class _Sketch(NamedTuple):
    """Template whose nodes refer to templates by keys rather than numbers."""

    template: Template
    inner: list[_Inner]


class _Site(NamedTuple):
    """Place of an element of the text in a template.

    Attributes:
        root: element of the text.
        step: end of the element's name.
        surface: surface around the element.
        quarters: quarter turns of the template.
        around: cell of the element's parent before these turns; None where nothing depends on it.
    """

    root: Root
    step: str
    surface: Any
    quarters: int
    around: _Cell | None

    @property
    def pitches(self) -> Sides | None:
        """Sides of the cells of the parent's grid; None where nothing depends on them."""
        tree = self.root.tree
        if self.around is None:
            return None
        return self.around.sides.block(self.around.span, tree.grid(tree.parents[self.root.element]))

    @property
    def cell(self) -> _Cell | None:
        """Cell of the element; None where nothing depends on it."""
        tree, index = self.root.tree, self.root.element
        extent = tree.value("extent", index)
        if extent is not UNSET:
            return _Cell(sides(pair_of(extent, math.nan)), ONE).turn_by(self.quarters)
        return None if self.pitches is None else _Cell(self.pitches, tree.block(index)[2:])


def blueprint(uses: Uses, surfaces: set[Any], primitives: set[Any]) -> Blueprint:
    """Templates of a valid definition, without its storeys and what is in them.

    Args:
        uses: file of the definition, and the parts that it uses.
        surfaces: names of surfaces that the definition keeps beside those of the templates.
        primitives: names of primitives that it keeps likewise.

    Raises:
        RequestError: templates come to too many elements.
    """
    return _Drafter(uses).draw(surfaces, primitives)


class _Drafter:
    def __init__(self, uses: Uses) -> None:
        self.uses = uses
        self.chains = Chains(uses)
        self.sketches: dict[_Key, _Sketch] = {}
        self.roots: dict[_Key, Root] = {}
        self.total = 0
        self._sized = uses.parts_leading_to(scatters_over_cells)
        self._depending: dict[tuple[int, int], bool] = {}

    def draw(self, surfaces: set[Any], primitives: set[Any]) -> Blueprint:
        chain = self.chains.of(self.uses.root)
        whole = _Cell(sides(with_names(self.uses).extent), ONE)
        whole = whole.turn_by(chain.quarters)
        first = self._key(chain.root, chain.quarters, chain.surface, whole)
        order = self._sketch_all(first)
        number = {key: index for index, key in enumerate(order)}
        templates = []
        for key in order:
            template, inner = self.sketches[key]
            nodes = [
                node._replace(inner=_numbers(one, number))
                for node, one in zip(template.nodes, inner, strict=True)
            ]
            templates.append(template._replace(nodes=nodes))
        root = BlueprintNode(
            chain, chain.surface, _turn(chain, chain.quarters), templates[0].cells, (0, 0), ONE,
            None, None, None, None, None,
            0 if self._children(chain.root) else -1, (ROOT, chain.name),
        )  # fmt: skip
        nodes = [root, *(node for template in templates for node in template.nodes)]
        types, grids = (
            {node.chain.root.tree.value(name, node.chain.root.element) for node in nodes}
            for name in ("type", "surface_grid")
        )
        worn = with_classes({node.chain.surface for node in nodes}, grids)
        definition = with_names_in_use(
            with_names(self.uses), worn | surfaces, types | primitives, self.uses
        )
        return Blueprint(definition, root, templates)

    def _children(self, root: Root) -> Sequence[int]:
        """Indices of the children of an element that are no storeys."""
        children = range(*root.tree.brood(root.element))
        if not self.uses.has_storeys:
            return children
        ends = (self.chains.of(root._replace(element=index)).root for index in children)
        return [
            index
            for index, end in zip(children, ends, strict=True)
            if end.tree.storey(end.element) is UNSET
        ]

    def _key(self, root: Root, quarters: int, surface: Any, cell: _Cell | None) -> _Key:
        """Key of the template of the elements in the cell of an element."""
        cell = cell if self._depends_on_size(root) else None
        key = _Key(id(root.tree), root.element, quarters, surface, cell)
        self.roots[key] = root
        return key

    def _depends_on_size(self, root: Root) -> bool:
        """Whether copies are scattered over cells whose sides follow from those of an element."""
        tree, place = root.tree, (id(root.tree), root.element)
        if place not in self._depending:
            pending, found = [root.element], False
            while pending and not found:
                for child in range(*tree.brood(pending.pop())):
                    if tree.value("extent", child) is UNSET:
                        scattered = tree.value("scatter", child) is not UNSET
                        found |= scattered or tree.value("part", child) in self._sized
                        pending.append(child)
            self._depending[place] = found
        return self._depending[place]

    def _sketch_all(self, first: _Key) -> list[_Key]:
        """Keys of all templates that one leads to, users before those that they use."""
        done: list[_Key] = []
        pending = [(first, False)]
        while pending:
            key, known = pending.pop()
            if known:
                done.append(key)
            elif key not in self.sketches:
                self.sketches[key] = self._sketch(key)
                pending.append((key, True))
                inner = self.sketches[key].inner
                pending += [(name, False) for one in inner for name in one.keys]
        return done[::-1]

    def _sketch(self, key: _Key) -> _Sketch:
        root = self.roots[key]
        tree, quarters = root.tree, key.quarters
        nodes: list[BlueprintNode] = []
        inner: list[_Inner] = []
        families: list[tuple[int, int, int]] = []
        levels = [0]
        level = [(-1, root.element, key.surface, key.cell)]
        while level:
            below = []
            for parent, element, around, cell in level:
                begin, _ = tree.brood(element)
                children = self._children(Root(tree, element, root.home))
                if not children:
                    continue
                families.append((parent, len(nodes), len(nodes) + len(children)))
                for index in children:
                    own = Root(tree, index, root.home)
                    site = _Site(own, f"/children/{index - begin}", around, quarters, cell)
                    scattered = tree.value("scatter", index) is not UNSET
                    node, found = (
                        self._scattered_node(site) if scattered else self._single_node(site)
                    )
                    if node.chain.root == own and not scattered and self._children(own):
                        below.append((len(nodes), index, node.surface, site.cell))
                    nodes.append(node)
                    inner.append(found)
            if len(nodes) > levels[-1]:
                levels.append(len(nodes))
            level = below
        self.total += sum(node.numbers is None for node in nodes)
        if self.total > MAX_ELEMENTS:
            raise RequestError(
                f"{self.uses.document.source.name}: its parts, in all their turns and surfaces, "
                f"come to more than {count_of(MAX_ELEMENTS, 'element')}.",
                "Use fewer of them, or name their surfaces in the parts.",
            )
        cells = _grid_after_turns(root, quarters)
        return _Sketch(Template(cells, quarters, nodes, families, levels), inner)

    def _single_node(self, site: _Site) -> tuple[BlueprintNode, _Inner]:
        """Node of an element that is not scattered, and its inner template where it has another."""
        chain = self.chains.of(site.root)
        worn = site.surface if chain.surface is UNSET else chain.surface
        node = _node(site, chain, worn)
        if chain.root == site.root or not self._children(chain.root):
            return node, _Inner([])
        cell = None
        if self._depends_on_size(chain.root) and site.cell is not None:
            cell = site.cell.turn_by(chain.quarters)
        turns = (site.quarters + chain.quarters) % 4
        return node, _Inner([self._key(chain.root, turns, worn, cell)])

    def _scattered_node(self, site: _Site) -> tuple[BlueprintNode, _Inner]:
        """Node of the copies of a scattered element that have a place, and inner templates."""
        root, odd = site.root, site.quarters % 2 == 1
        area = area_of(root, site.pitches)
        found = copies_over(root, area)
        lengths, x, y, turns = map(np.frombuffer, found[:4])
        numbers = np.flatnonzero(~np.isnan(x))
        lengths, x, y, turns = (column[numbers] for column in (lengths, x, y, turns))
        at = area.x + Exact(x, np.zeros(len(x))), area.y + Exact(y, np.zeros(len(y)))
        at = at[::-1] if odd else at
        is_part = root.tree.value("part", root.element) is not UNSET
        chain = self.chains.of_copies(root, lengths, 0.0 if is_part else turns)
        worn = site.surface if chain.surface is UNSET else chain.surface
        quarters = np.full(len(x), site.quarters + chain.quarters)
        if is_part:
            quarters += (turns // 90).astype(np.int64)
        quarters %= 4
        turn, cells = _turn(chain, site.quarters), _grid_after_turns(chain.root, site.quarters)
        if is_part:
            each = range(4)
            turn = np.array([_turn(chain, turned) for turned in each])[quarters]
            cells = np.array([_grid_after_turns(chain.root, turned) for turned in each])[quarters]
        node = BlueprintNode(
            chain, worn, turn, cells, (0, 0), ONE, np.column_stack([at[0].near, at[1].near]),
            np.column_stack([at[0].rest, at[1].rest]),
            np.broadcast_to(lengths[:, None], (len(x), 2)), None, numbers, -1,
            (site.step, chain.name),
        )  # fmt: skip
        if not self._children(chain.root):
            return node, _Inner([])
        sized = self._depends_on_size(chain.root)
        kinds = np.column_stack([quarters, lengths if sized else np.zeros(len(x))])
        kinds, which = np.unique(kinds, axis=0, return_inverse=True)
        keys = []
        for turned, length in kinds.tolist():
            cell = _Cell(Sides(side(length, 0.0), side(length, 0.0)), ONE) if sized else None
            keys.append(self._key(chain.root, int(turned), worn, cell))
        return node, _Inner(keys, which.reshape(-1))


def _numbers(inner: _Inner, number: dict[_Key, int]) -> Any:
    """Numbers of the inner templates of an element, or of each of its copies; -1 for none."""
    if not inner.keys:
        return -1
    numbers = [number[key] for key in inner.keys]
    return numbers[0] if inner.which is None else np.array(numbers)[inner.which]


def _turn(chain: Chain, quarters: int) -> Any:
    """Turn of an element in a template with quarter turns, degrees."""
    turn = chain.turn
    if isinstance(turn, np.ndarray):
        return turn if quarters == 0 else np.mod(np.fmod(turn, 360.0) + 90.0 * quarters, 360.0)
    turn = with_quarters(turn, quarters)
    return 0.0 if turn is UNSET else turn


def _grid_after_turns(root: Root, quarters: int) -> tuple[int, int]:
    cells = root.tree.grid(root.element)
    return cells[::-1] if quarters % 2 else cells


def _node(site: _Site, chain: Chain, surface: Any) -> BlueprintNode:
    """Node of an element in a template, with its copies in rows."""
    tree, index, quarters = site.root.tree, site.root.element, site.quarters
    repeat, at = tree.value("repeat", index), tree.value("at", index)
    inner_quarters = (quarters + chain.quarters) % 4
    step = site.step, chain.name
    cell, span, place, extent = (0, 0), ONE, None, None
    odd = quarters % 2 == 1
    if at is UNSET:
        grid = tree.grid(tree.parents[index])
        column, row, columns, rows = turn_block(tree.block(index), grid, quarters)
        cell, span = (column, row), (columns, rows)
    else:
        extent = pair_of(tree.value("extent", index), math.nan)
        place = at[::-1] if odd else at
    of = None
    if copies(repeat) > 1:
        count = repeat.count
        dx, dy = (one if many > 1 else 0.0 for one, many in zip(repeat.step, count, strict=True))
        if at is UNSET:  # the first copy's place is turned, and so must be the steps
            dx, dy = float(int(dx)), float(int(dy))
            dx, dy = ((dx, dy), (dy, -dx), (-dx, -dy), (-dy, dx))[quarters]
        elif odd:
            dx, dy = dy, dx
        of = Copies(count[::-1] if odd else count, (dx, dy), odd)
    if repeat is not UNSET and of is None:
        step = f"{step[0]}[0,0]", step[1]
    return BlueprintNode(
        chain, surface, _turn(chain, inner_quarters), _grid_after_turns(chain.root, inner_quarters),
        cell, span, place, None, extent, of, None, -1, step,
    )  # fmt: skip


def smallest_cell(plan: Blueprint) -> float:
    """Shortest side of any element's cell, units of the terrain.

    Exact as in the field, unless parts stand in very many sizes; then over those compared.
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
                for inner, key in _smallest_of(node):
                    if key not in known:
                        known[key] = (
                            key if isinstance(key, Sides) else around.block(node.span, grid)
                        )
                        smallest = min(smallest, *_lengths(around, node.span, key, grid))
                    cells[index] = known[key]
                    below = inner, known[key]
                    if inner >= 0 and below not in seen and len(seen) < MANY_SIZES:
                        seen.add(below)
                        pending.append(below)
    return smallest


def _smallest_of(node: BlueprintNode) -> list[tuple[int, Sides | tuple[int, int]]]:
    """Inner templates of an element with its free sides, or the span of its cell.

    Scattered copies with one template count by the smallest: cells in the others are no smaller.
    """
    if node.numbers is None:
        return [(node.inner, sides(node.extent) if node.extent else node.span)]
    found: dict[int, Sides] = {}
    inner = np.broadcast_to(node.inner, len(node.extent))
    for number in np.unique(inner).tolist():
        own = side(float(node.extent[inner == number].min()), 0.0)
        found[number] = Sides(own, own)
    return list(found.items())


def _lengths(
    around: Sides, span: tuple[int, int], own: Sides | tuple[int, int], grid: tuple[int, int]
) -> Pair:
    if isinstance(own, Sides):
        return own.lengths
    cell = around.block(ONE, grid).lengths
    return cell[0] * span[0], cell[1] * span[1]
