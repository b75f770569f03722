"""Writing out of parts and copies, level by level, as columns of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.chains import Chain, Chains
from terratool.definition.exact import Exact, ExactSide, Sides, rest_of, rests_of, side, sides
from terratool.definition.model import (
    DEFAULT_CELLS,
    Deck,
    Definition,
    Element,
    Storey,
    pair_of,
)
from terratool.definition.scatter_areas import area_of, copies_over
from terratool.definition.tree import ROOT, Tree, with_classes
from terratool.definition.turning import turn_block
from terratool.definition.uses import MAX_ELEMENTS, Root, Uses
from terratool.errors import RequestError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Share = Literal["all", "ground", "storeys"]
"""Elements of a terrain that are written out."""


class ValueCodes:
    """Values that stand in columns as whole numbers (codes), in the order of their first use."""

    def __init__(self, *values: Any) -> None:
        self.values: list[Any] = list(values)
        self._numbers = {value: number for number, value in enumerate(values)}

    def number(self, value: Any) -> int:
        """Code of a value, a new one for a new value."""
        if value not in self._numbers:
            self._numbers[value] = len(self.values)
            self.values.append(value)
        return self._numbers[value]

    def numbers(self, values: Sequence[Any]) -> Ints:
        """Codes of values, (n,) int64."""
        known = {value: self.number(value) for value in dict.fromkeys(values)}
        return np.fromiter(map(known.__getitem__, values), np.int64, len(values))


class Rows(NamedTuple):
    """Elements of a terrain without parts and copies, column by column.

    NaN stands for an attribute that is left out; codes are numbers of `Written.names`.

    Attributes:
        element: (n,) index, among all texts, of the element that gives the grid and the primitive.
        source: (n,) index, among all texts, of the element that gives the place.
        quarters: (n,) quarter turns of the elements in the cell, 0 to 3.
        factor: (n,) factor on the heights of the elements in the cell.
        free: (n,) whether the element stands at a free place, in no cell.
        cell: (n, 2) first column and row; 0 at a free place.
        span: (n, 2) columns and rows of cells taken; 1 at a free place.
        at: (n, 2) middle of a free place; NaN in a cell.
        extent: (n, 2) sides of a free place; NaN in a cell.
        rests: (n, 4) differences of the exact `at` and `extent` and their doubles.
        typed: (n,) whether `at` and `extent` are decimals of a text.
        is_pair: (n,) whether the text gives both sides of a free place.
        around: (n, 2, 2) sides of the cells of which `span` are taken, each as two doubles.
        scale: (n,) factor on the curves.
        offset: (n,) height added.
        turn: (n,) turn, degrees.
        type: (n,) code of the primitive.
        surface: (n,) code of the surface.
        surface_grid: (n,) code of the raster of classes.
        storey: (n,) code of the deck or bore of the text, whose heights are to be multiplied by
            `factor`.
        descr: (n,) code of the description.
        child: (n,) index among the children in the text.
        copy: (n, 2) column and row among copies in rows, or the number among scattered ones and -1;
            -1 twice where there are no copies.
        chain: (n,) code of the end of the name.
    """

    element: Ints
    source: Ints
    quarters: Ints
    factor: Floats
    free: NDArray[np.bool_]
    cell: Ints
    span: Ints
    at: Floats
    extent: Floats
    rests: Floats
    typed: NDArray[np.bool_]
    is_pair: NDArray[np.bool_]
    around: Floats
    scale: Floats
    offset: Floats
    turn: Floats
    type: Ints
    surface: Ints
    surface_grid: Ints
    storey: Ints
    descr: Ints
    child: Ints
    copy: Ints
    chain: Ints


class Written(NamedTuple):
    """Elements of a terrain, written out level by level.

    Attributes:
        rows: attributes of the elements.
        parent: (n,) int64, index of each element's parent; -1 for the root.
        cells: (n,) code of the `cells` of each element; `names` has the value of the text.
        levels: first element of each level, and the number of elements.
        names: values of all codes; the first is `UNSET`.
    """

    rows: Rows
    parent: Ints
    cells: Ints
    levels: list[int]
    names: ValueCodes

    def __len__(self) -> int:
        return self.levels[-1]

    def step(self, index: int) -> str:
        """End of an element's name, behind that of its parent."""
        rows, first = self.rows, self.parent[index] < 0
        i, j = rows.copy[index].tolist()
        copy = "" if i < 0 else f"[{i}]" if j < 0 else f"[{i},{j}]"
        own = ROOT if first else f"/children/{rows.child[index]}{copy}"
        return own + str(self.names.values[rows.chain[index]])

    def values_of(self, column: Ints) -> list[Any]:
        """Values of a column of codes."""
        return list(map(self.names.values.__getitem__, column.tolist()))

    def different(self, column: Ints) -> set[Any]:
        """Different values of a column of codes."""
        return set(self.values_of(np.unique(column)))

    def only(self, kept: NDArray[np.bool_]) -> Written:
        """Return some of the elements, with all that they are in; `kept` is their mask, (n,)."""
        place = np.cumsum(kept) - 1
        parent = self.parent[kept]
        starts = np.concatenate([[0], place + 1])[self.levels]
        return Written(
            Rows._make(column[kept] for column in self.rows),
            np.where(parent < 0, -1, place[parent]),
            self.cells[kept],
            np.unique(starts).tolist(),
            self.names,
        )

    def storeys(self) -> dict[int, Storey]:
        """Decks and bores by their index, with the heights that they have there."""
        own = np.flatnonzero(self.rows.storey)
        factors = self.rows.factor[own].tolist()
        texts = self.values_of(self.rows.storey[own])
        return {
            index: text.times(factor)
            for index, text, factor in zip(own.tolist(), texts, factors, strict=True)
        }

    @property
    def shapes(self) -> set[Any]:
        """Names of the primitives of elements, and of the other faces of storeys."""
        faces = {one.face for one in self.different(self.rows.storey) if one is not UNSET}
        return self.different(self.rows.type) | faces - {UNSET}

    @property
    def worn(self) -> set[Any]:
        """Names of the surfaces of elements, their own and those of classes; `UNSET` for none."""
        rows = self.rows
        return with_classes(self.different(rows.surface), self.different(rows.surface_grid))

    def tree(self) -> Tree:
        """Elements as a tree, as a text would give it."""
        rows, count = self.rows, len(self)
        columns: dict[str, list[Any]] = {
            name: [UNSET] * count for name in Element.__struct_fields__ if name != "children"
        }
        for name, codes in (
            ("type", rows.type), ("surface", rows.surface), ("descr", rows.descr),
            ("cells", self.cells), ("surface_grid", rows.surface_grid),
        ):  # fmt: skip
            columns[name] = self.values_of(codes)
        for name, numbers in (
            ("v_scale", rows.scale), ("v_offset", rows.offset), ("turn_deg", rows.turn)
        ):  # fmt: skip
            known = ~np.isnan(numbers)
            _put(columns[name], known, numbers[known].tolist())
        placed = ~rows.free
        placed[0] = False  # the root
        _put(columns["cell_x"], placed, rows.cell[placed, 0].tolist())
        _put(columns["cell_y"], placed, rows.cell[placed, 1].tolist())
        for index, storey in self.storeys().items():
            columns["deck" if isinstance(storey, Deck) else "bore"][index] = storey
        wide = placed & (rows.span != 1).any(axis=1)
        _put(columns["span"], wide, map(tuple, rows.span[wide].tolist()))
        _put(columns["at"], rows.free, map(tuple, rows.at[rows.free].tolist()))
        pairs = rows.free & rows.is_pair
        single = rows.free & ~rows.is_pair
        _put(columns["extent"], pairs, map(tuple, rows.extent[pairs].tolist()))
        _put(columns["extent"], single, rows.extent[single, 0].tolist())
        rests: list[Any] = [None] * count
        drawn = rows.free & ~rows.typed
        _put(rests, drawn, map(tuple, rows.rests[drawn].tolist()))
        begins = np.flatnonzero(np.diff(self.parent, prepend=-1))
        ends = np.append(begins, count)[1:]
        table = np.column_stack([self.parent[begins], begins, ends])
        families = [(parent, begin, end) for parent, begin, end in table.tolist()]
        steps = list(map(self.step, range(count)))
        return Tree([], families, self.levels, columns, steps=steps, rests=rests)


def _put(values: list[Any], where: NDArray[np.bool_], found: Any) -> None:
    for index, value in zip(np.flatnonzero(where).tolist(), found, strict=True):
        values[index] = value


def write_out(uses: Uses, definition: Definition, share: Share = "all") -> Written:
    """Write out the parts and copies of a valid definition.

    Args:
        uses: file of the definition, and the parts that it uses.
        definition: the terrain, with the names of its libraries.
        share: elements that are written: all; the ground, without storeys and what is in them; or
            the storeys with what is in them, and the elements in whose cells they are, and perhaps
            some more of the ground.

    Raises:
        RequestError: the storeys come to more than `MAX_ELEMENTS`; for other shares the elements
            are to be counted before.
    """
    return _Writer(uses, definition, share).write()


class _Text:
    """Elements of all texts that a terrain consists of, column by column.

    Attributes:
        roots: text and file of each tree, with the index of its first element.
    """

    def __init__(self, uses: Uses, names: ValueCodes) -> None:
        roots = [uses.root, *map(uses.part, uses.parts_in_use)]
        trees = {id(root.tree): root for root in roots}
        self._first: dict[int, int] = {}
        self._homes: list[tuple[int, Root]] = []
        count = 0
        for key, root in trees.items():
            self._first[key] = count
            self._homes.append((count, root))
            count += len(root.tree)
        self._starts = np.array([first for first, _ in self._homes])
        own = [root.tree for root in trees.values()]

        def values(name: str) -> list[Any]:
            return [value for tree in own for value in tree.column(name)]

        def numbers(name: str) -> Floats:
            found = values(name)
            return np.array([math.nan if value is UNSET else value for value in found], np.float64)

        def pairs(name: str, default: Any) -> NDArray[Any]:
            found = values(name)
            known = {value: pair_of(value, default) for value in dict.fromkeys(found)}
            if len(known) == 1:
                return np.tile(np.array(known[found[0]]), (len(found), 1))
            return np.array(list(map(known.__getitem__, found)))

        def whole(name: str) -> Ints:
            return np.array([-1 if value is UNSET else value for value in values(name)], np.int64)

        offsets = np.repeat(list(self._first.values()), list(map(len, own)))
        self.begin = np.concatenate([tree.first_child for tree in own]).astype(np.int64)
        ends = [[*tree.first_child[1:], len(tree)] for tree in own]
        self.count = np.concatenate(ends).astype(np.int64) - self.begin
        self.begin += offsets
        self.cells = pairs("cells", DEFAULT_CELLS).astype(np.int64)
        self.cells_code = names.numbers(values("cells"))
        self.cell = np.column_stack([whole("cell_x"), whole("cell_y")])
        self.span = pairs("span", 1).astype(np.int64)
        self.at = pairs("at", math.nan).astype(np.float64)
        self.extent = pairs("extent", math.nan).astype(np.float64)
        self.free = ~np.isnan(self.extent[:, 0])
        self.is_pair = np.array([isinstance(value, tuple) for value in values("extent")], np.bool_)
        self._places = np.hstack([self.at, self.extent])
        self.rests = np.zeros_like(self._places)
        if self.free.any():
            self.rests[self.free] = rests_of(self._places[self.free])
        self._exact = np.full_like(self._places, math.nan)
        repeats = values("repeat")
        self.repeated = np.array([value is not UNSET for value in repeats], np.bool_)
        self.copies = np.ones((len(repeats), 2), np.int64)
        self.step, self.step_rest = np.zeros((2, len(repeats), 2))
        if self.repeated.any():
            given = [value for value in repeats if value is not UNSET]
            self.copies[self.repeated] = [value.count for value in given]
            self.step[self.repeated] = [value.step for value in given]
            self.step_rest[self.repeated] = [list(map(rest_of, value.step)) for value in given]
        self.scattered = np.array([value is not UNSET for value in values("scatter")], np.bool_)
        self.composed = np.array([value is not UNSET for value in values("part")], np.bool_)
        self.scale, self.offset = numbers("v_scale"), numbers("v_offset")
        self.turn = numbers("turn_deg")
        self.type = names.numbers(values("type"))
        self.surface = names.numbers(values("surface"))
        self.surface_grid = names.numbers(values("surface_grid"))
        decks, bores = values("deck"), values("bore")
        self.storey = names.numbers(
            [bore if deck is UNSET else deck for deck, bore in zip(decks, bores, strict=True)]
        )
        self.descr = names.numbers(values("descr"))

    def exact_rests(self, elements: Ints) -> Floats:
        """Rests of the doubles of free places, (n, 4), rounded from decimals to the last bit."""
        unique = np.unique(elements)
        for index in unique[np.isnan(self._exact[unique, 0])].tolist():
            self._exact[index] = list(map(rest_of, self._places[index].tolist()))
        return self._exact[elements]

    def index(self, root: Root) -> int:
        """Index of an element among all texts."""
        return self._first[id(root.tree)] + root.element

    def has(self, root: Root) -> bool:
        """Whether an element is in one of the texts."""
        return id(root.tree) in self._first

    def root(self, index: int) -> Root:
        """Element at an index among all texts."""
        home = int(np.searchsorted(self._starts, index, "right")) - 1
        first, root = self._homes[home]
        return Root(root.tree, index - first, root.home)


class _Writer:
    """Writer of elements, level by level."""

    def __init__(self, uses: Uses, definition: Definition, share: Share) -> None:
        self._uses, self._size = uses, definition.extent
        self._chains = Chains(uses)
        self._names = ValueCodes(UNSET, "")
        self._text = _Text(uses, self._names)
        self._left_out = self._elements_outside(share)
        self._limited, self._elements = share == "storeys", 0
        turned = [
            value[::-1] if isinstance(value, tuple) else value for value in self._names.values
        ]
        self._turned_cells = self._names.numbers(turned)

    def write(self) -> Written:
        """Write all elements."""
        level = self._first()
        found = [level]
        parents = [np.array([-1])]
        levels = [0, 1]
        while True:
            parent, level = self._below(level)
            if not len(parent):
                break
            parents.append(parent + levels[-2])
            levels.append(levels[-1] + len(parent))
            found.append(level)
        found = [level._replace(around=level.around[:, :0]) for level in found]
        rows = Rows._make(map(np.concatenate, zip(*found, strict=True)))
        codes = self._text.cells_code[rows.element]
        cells = np.where(rows.quarters % 2 == 1, self._turned_cells[codes], codes)
        return Written(rows, np.concatenate(parents), cells, levels, self._names)

    def _elements_outside(self, share: Share) -> NDArray[np.bool_] | None:
        """Mask of the elements of all texts that a share has not; None for none."""
        text = self._text
        if share == "all":
            return None
        ends = np.arange(len(text.storey))
        for index in np.flatnonzero(text.composed).tolist():
            end = self._chains.of(text.root(index)).root
            if text.has(end):  # a part that is not in use may lead to a file that is not
                ends[index] = text.index(end)
        storeys = text.storey[ends] > 0
        if share == "ground":
            return storeys
        parents = np.full(len(ends), -1)
        for index in np.flatnonzero(text.count).tolist():
            parents[text.begin[index] : text.begin[index] + text.count[index]] = index
        wanted = storeys.copy()
        found = np.flatnonzero(storeys)
        while len(found):  # what is in them
            inner = np.unique(ends[found])
            inner = np.repeat(text.begin[inner], text.count[inner]) + _places(text.count[inner])
            found = inner[~wanted[inner]]
            wanted[found] = True
        found = np.flatnonzero(storeys)
        while len(found):  # and what they are in
            around = np.union1d(parents[found], np.flatnonzero(np.isin(ends, found)))
            found = around[around >= 0]
            found = found[~wanted[found]]
            wanted[found] = True
        return ~wanted

    def _first(self) -> Rows:
        """Row of the root."""
        whole = sides(self._size)
        blank = _blank(1)._replace(
            around=np.array([[whole.x, whole.y]]), child=np.zeros(1, np.int64),
        )  # fmt: skip
        element = np.array([self._text.index(self._uses.root)])
        return self._with_ends(blank, element, np.ones(1), np.zeros(1, np.int64))

    def _below(self, level: Rows) -> tuple[Ints, Rows]:
        """Index of each parent in a level, and rows of the elements below that level."""
        text = self._text
        counts = text.count[level.element]
        parent = np.repeat(np.arange(len(counts)), counts)
        child = _places(counts)
        element = text.begin[level.element][parent] + child
        if self._left_out is not None:
            kept = ~self._left_out[element]
            parent, child, element = parent[kept], child[kept], element[kept]
        if not len(parent):
            return parent, level
        quarters, grid = level.quarters, text.cells[level.element]
        grid = np.where((quarters % 2 == 1)[:, None], grid[:, ::-1], grid)
        own = self._own_cells(level)
        frame = _Frame(
            _times(own, level.span), _shares(own, level.span, grid), text.cells[level.element],
            quarters, level.factor,
        )  # fmt: skip
        times = text.copies[element].prod(axis=1)
        strewn = self._strew(frame, parent, element, np.flatnonzero(text.scattered[element]))
        for index, copies in strewn.items():
            times[index] = len(copies.number)
        self._elements += int(times.sum())
        if self._limited and self._elements > MAX_ELEMENTS:
            raise RequestError(
                f"{self._uses.document.source.name}: decks and bores, with what is in them, come "
                f"to more than {MAX_ELEMENTS:,} elements, and so many are not looked at.",
                "Lower the counts of their copies, or put less on them.",
            )
        row = np.repeat(np.arange(len(parent)), times)
        copy = _places(times)
        placed = self._place_rows(frame, parent[row], element[row], copy)
        placed = placed._replace(child=child[row])
        found = self._with_ends(
            placed, element[row], frame.factor[parent[row]], frame.quarters[parent[row]]
        )
        if strewn:
            self._put_strewn(found, strewn, frame, parent, np.cumsum(times) - times)
        return parent[row], found

    def _own_cells(self, level: Rows) -> Floats:
        """Sides of the cells of which elements take `span`, (n, 2, 2), each as two doubles."""
        own = level.around.copy()
        free = np.flatnonzero(level.free & (self._text.count[level.element] > 0))
        rests = level.rests[free, 2:]
        typed = level.typed[free]
        rests[typed] = self._text.exact_rests(level.source[free][typed])[:, 2:]
        for axis in (0, 1):
            one = side(level.extent[free, axis], rests[:, axis])
            own[free, axis, 0], own[free, axis, 1] = one
        return own

    def _place_rows(self, frame: _Frame, parent: Ints, element: Ints, copy: Ints) -> Rows:
        """Rows with the places of elements that are not scattered."""
        text, count = self._text, len(element)
        quarters = frame.quarters[parent]
        repeated = text.repeated[element]
        columns = text.copies[element, 0]
        at_copy = np.column_stack([copy % columns, copy // columns])
        found = _blank(count)._replace(
            source=element,
            free=text.free[element],
            is_pair=text.is_pair[element],
            copy=np.where(repeated[:, None], at_copy, -1),
        )
        grid = frame.grid[parent]
        steps = np.where(found.free[:, None], 0, np.trunc(text.step[element])).astype(np.int64)
        block = np.hstack([text.cell[element] + at_copy * steps, text.span[element]])
        block = _turn_blocks(block, grid, quarters)
        found.cell[:], found.span[:] = block[:, :2], block[:, 2:]
        found.around[:] = frame.around[parent]
        free = np.flatnonzero(found.free)
        found.cell[free], found.span[free] = 0, 1
        if len(free):
            found.at[free], found.extent[free] = text.at[element[free]], text.extent[element[free]]
            found.rests[free] = text.rests[element[free]]
            typed = (quarters[free] == 0) & ~repeated[free]
            found.typed[free] = typed
            moved = free[~typed]
            found.rests[moved, 2:] = text.exact_rests(element[moved])[:, 2:]
            found.at[moved], found.rests[moved, :2] = self._free_places(
                frame, parent[moved], element[moved], at_copy[moved]
            )
        return found

    def _free_places(
        self, frame: _Frame, parent: Ints, element: Ints, copy: Ints
    ) -> tuple[Floats, Floats]:
        """Middles of free elements that are copied or turned, (n, 2), and their rests, (n, 2)."""
        text, quarters = self._text, frame.quarters[parent]
        rests = text.exact_rests(element)
        axes = []
        for axis in (0, 1):
            at = Exact(text.at[element, axis], rests[:, axis])
            step = side(text.step[element, axis], text.step_rest[element, axis])
            number = copy[:, axis]
            moved = at + Exact(number * step.high, number * step.rest)
            axes.append(_where(number > 0, moved, at))
        return _turn_places(axes[0], axes[1], frame.lengths_of(parent), quarters)

    def _with_ends(self, placed: Rows, element: Ints, factor: Floats, quarters: Ints) -> Rows:
        """Fill rows with the ends of their elements' chains.

        Args:
            placed: rows with the places of the elements.
            element: (n,) indices of the elements among all texts.
            factor: (n,) factor on the heights of the elements.
            quarters: (n,) quarter turns of the elements.
        """
        text = self._text
        ends = _ChainEnds(
            element, text.scale[element], text.turn[element], np.ones(len(element)),
            text.offset[element], np.zeros(len(element), np.int64), text.surface[element],
            text.descr[element], np.ones(len(element), np.int64),
        )  # fmt: skip
        through = np.flatnonzero(text.composed[element] & ~text.scattered[element])
        if len(through):
            unique, which = np.unique(element[through], return_inverse=True)
            chains = [self._ends(self._chains.of(text.root(index))) for index in unique.tolist()]
            for column, values in zip(ends, zip(*chains, strict=True), strict=True):
                column[through] = np.array(values)[which]
        return self._finish(placed, ends, factor, quarters)

    def _ends(self, chain: Chain) -> _ChainEnds:
        """End of a chain in numbers."""
        turn = math.nan if chain.turn is UNSET else chain.turn
        scale = math.nan if chain.scale is UNSET else chain.scale
        offset = math.nan if chain.offset is UNSET else chain.offset
        number = self._names.number
        return _ChainEnds(
            self._text.index(chain.root), scale, turn, chain.factor, offset, chain.quarters,
            number(chain.surface), number(chain.descr), number(chain.name),
        )  # fmt: skip

    def _finish(self, placed: Rows, ends: _ChainEnds, factor: Floats, quarters: Ints) -> Rows:
        """Fill rows with all attributes, from the elements around and from the ends of chains."""
        quarters = (quarters + ends.quarters) % 4
        inner = factor * ends.factor
        lengths = np.where(
            placed.free[:, None], placed.extent, placed.around.sum(axis=2) * placed.span
        )
        scale = ends.scale
        scaled = inner != 1.0
        if scaled.any():
            share = np.minimum(lengths[:, 0] / self._size[0], lengths[:, 1] / self._size[1])
            scale = np.where(scaled, inner * np.where(np.isnan(scale), share, scale), scale)
        turn = ends.turn
        if quarters.any():
            base = np.fmod(np.where(np.isnan(turn), 0.0, turn), 360.0)
            turn = np.where(quarters == 0, turn, np.mod(base + 90.0 * quarters, 360.0))
        return placed._replace(
            element=ends.element, quarters=quarters, factor=inner, scale=scale,
            offset=factor * ends.offset, turn=turn, type=self._text.type[ends.element],
            surface=ends.surface, surface_grid=self._text.surface_grid[ends.element],
            storey=self._text.storey[ends.element],
            descr=ends.descr, chain=ends.name,
        )  # fmt: skip

    def _strew(
        self, frame: _Frame, parent: Ints, element: Ints, scattered: Ints
    ) -> dict[int, _Strewn]:
        """Copies of each of the scattered elements, by its index."""
        known: dict[Any, _Strewn] = {}
        found = {}
        for index in scattered.tolist():
            own, around = int(element[index]), None
            if not self._text.free[own]:
                around = Sides(*(ExactSide(*pair) for pair in frame.around[parent[index]].tolist()))
                around = around.turn_by(int(frame.quarters[parent[index]]))
            key = own, around
            if key not in known:
                known[key] = self._scatter_copies(self._text.root(own), around)
            found[index] = known[key]
        return found

    def _scatter_copies(self, root: Root, around: Sides | None) -> _Strewn:
        """Copies of a scattered element that have found a place."""
        area = area_of(root, around)
        lengths, x, y, turns = map(np.frombuffer, copies_over(root, area)[:4])
        number = np.flatnonzero(~np.isnan(x))
        lengths, x, y, turns = (column[number] for column in (lengths, x, y, turns))
        zero = np.zeros(len(x))
        is_part = root.tree.value("part", root.element) is not UNSET
        chain = self._chains.of_copies(root, lengths, 0.0 if is_part else turns)
        own = self._ends(chain)
        if is_part:
            own = own._replace(quarters=(own.quarters + (turns // 90).astype(np.int64)) % 4)
        at = area.x + Exact(x, zero), area.y + Exact(y, zero)
        return _Strewn(number, lengths, at, own)

    def _put_strewn(
        self, rows: Rows, strewn: dict[int, _Strewn], frame: _Frame, parent: Ints, first: Ints
    ) -> None:
        """Put scattered copies into their rows.

        Args:
            rows: rows of the elements, which are changed.
            strewn: copies of each scattered element, by its index.
            frame: elements around.
            parent: (m,) index of each element's parent in the frame.
            first: (m,) first row of each element.
        """
        for index, copies in strewn.items():
            own = np.arange(first[index], first[index] + len(copies.number))
            inside = np.full(len(own), parent[index])
            ends = _ChainEnds.of(len(own), copies.ends)
            placed = _blank(len(own))
            at = _turn_places(*copies.at, frame.lengths_of(inside), frame.quarters[inside])
            placed.at[:], placed.rests[:, :2] = at
            placed.extent[:] = copies.lengths[:, None]
            placed.free[:] = True
            placed.child[:] = rows.child[own]
            placed.copy[:, 0] = copies.number
            finished = self._finish(placed, ends, frame.factor[inside], frame.quarters[inside])
            for column, values in zip(rows, finished, strict=True):
                column[own] = values


class _ChainEnds(NamedTuple):
    """Ends of chains (`chains.Chain`): the numbers of one, or columns of many."""

    element: Any
    scale: Any
    turn: Any
    factor: Any
    offset: Any
    quarters: Any
    surface: Any
    descr: Any
    name: Any

    @classmethod
    def of(cls, count: int, one: _ChainEnds) -> _ChainEnds:
        """Columns of `count` rows from the numbers of one, or from columns of that length."""
        return cls._make(np.broadcast_to(value, count) for value in one)


class _Strewn(NamedTuple):
    """Copies of a scattered element.

    Attributes:
        number: (n,) indices of the copies in their list by size.
        lengths: (n,) sides of the copies, units of the terrain.
        at: middles along x and y in the parent's cell, before quarter turns, (n,) each.
        ends: ends of the chains of the copies.
    """

    number: Ints
    lengths: Floats
    at: tuple[Exact, Exact]
    ends: _ChainEnds


class _Frame(NamedTuple):
    """Elements of a level, as the surroundings of the elements in them.

    Attributes:
        lengths: (n,) sides of the elements' cells along x and y.
        around: (n, 2, 2) sides of the cells of the elements' grids, each as two doubles.
        grid: (n, 2) columns and rows of the elements' grids, before quarter turns.
        quarters: (n,) quarter turns of the elements in them.
        factor: (n,) factor on the heights of the elements in them.
    """

    lengths: tuple[Exact, Exact]
    around: Floats
    grid: Ints
    quarters: Ints
    factor: Floats

    def lengths_of(self, rows: Ints) -> tuple[Exact, Exact]:
        """Sides along x and y of the cells of some elements, by their indices."""
        x, y = (Exact(length.near[rows], length.rest[rows]) for length in self.lengths)
        return x, y


def _blank(count: int) -> Rows:
    """Rows with the values of elements that have no attributes."""

    def whole() -> Ints:
        return np.zeros(count, np.int64)

    def flags() -> NDArray[np.bool_]:
        return np.zeros(count, np.bool_)

    return Rows(
        element=whole(), source=whole(), quarters=whole(), factor=np.ones(count), free=flags(),
        cell=np.zeros((count, 2), np.int64), span=np.ones((count, 2), np.int64),
        at=np.full((count, 2), math.nan), extent=np.full((count, 2), math.nan),
        rests=np.zeros((count, 4)), typed=flags(), is_pair=flags(),
        around=np.zeros((count, 2, 2)), scale=np.zeros(count), offset=np.zeros(count),
        turn=np.zeros(count), type=whole(), surface=whole(), surface_grid=whole(),
        storey=whole(), descr=whole(), child=whole(), copy=np.full((count, 2), -1), chain=whole(),
    )  # fmt: skip


def _places(counts: Ints) -> Ints:
    """Positions 0, 1, … in each of several runs of given lengths, one run after the other."""
    first = np.cumsum(counts) - counts
    return np.arange(int(counts.sum())) - np.repeat(first, counts)


def _times(own: Floats, span: Ints) -> tuple[Exact, Exact]:
    """Sides of blocks of `span` cells along x and y."""
    x, y = (ExactSide(own[:, axis, 0], own[:, axis, 1]).times(span[:, axis]) for axis in (0, 1))
    return x, y


def _shares(own: Floats, span: Ints, grid: Ints) -> Floats:
    """Sides of the cells of the grids that divide blocks of cells, (n, 2, 2)."""
    found = np.empty_like(own)
    for axis in (0, 1):
        one = ExactSide(own[:, axis, 0], own[:, axis, 1])
        found[:, axis, 0], found[:, axis, 1] = one.share(span[:, axis], grid[:, axis])
    return found


def _where(condition: NDArray[np.bool_], one: Exact, other: Exact) -> Exact:
    return Exact(
        np.where(condition, one.near, other.near), np.where(condition, one.rest, other.rest)
    )


def _turn_places(
    x: Exact, y: Exact, lengths: tuple[Exact, Exact], quarters: Ints
) -> tuple[Floats, Floats]:
    """Places in cells after quarter turns, (n, 2), and the rests of these doubles, (n, 2).

    Args:
        x: (n,) distance from the west side of the cell before it is turned.
        y: (n,) distance from the south side of the cell before it is turned.
        lengths: (n,) sides of the cells after the turns.
        quarters: (n,) quarter turns.
    """
    odd = quarters % 2 == 1
    x = _where((quarters == 1) | (quarters == 2), _where(odd, lengths[1], lengths[0]) + -x, x)
    y = _where(quarters >= 2, _where(odd, lengths[0], lengths[1]) + -y, y)
    first, second = _where(odd, y, x), _where(odd, x, y)
    return np.column_stack([first.near, second.near]), np.column_stack([first.rest, second.rest])


def _turn_blocks(block: Ints, grid: Ints, quarters: Ints) -> Ints:
    """Blocks of cells, (n, 4) column, row, columns, rows, after quarter turns of their grids."""
    if not quarters.any():
        return block
    columns, rows = grid.T
    found = block.copy()
    for quarter in (1, 2, 3):
        own = quarters == quarter
        x, y, w, h = block[own].T
        found[own] = np.column_stack(turn_block((x, y, w, h), (columns[own], rows[own]), quarter))
    return found
