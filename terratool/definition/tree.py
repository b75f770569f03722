"""Trees of elements as flat columns, breadth first, without recursion."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush
from itertools import chain, pairwise, repeat
from operator import add, attrgetter
from typing import Any

from msgspec import UNSET, Struct, field, structs

from terratool.definition.exact import exact
from terratool.definition.findings import Bounds
from terratool.definition.model import DEFAULT_CELLS, Definition, Element, Library, pair_of
from terratool.text.display import escape

ROOT = "/elemTree"
PARTS = "/parts"

Pair = tuple[int, int]
Block = tuple[int, int, int, int]
"""First column, first row, columns, rows."""


MANY_COPIES = 20_000
"""Most cells of copies of siblings that are compared."""


def part_pointer(name: str) -> str:
    """JSON pointer of a part."""
    return f"{PARTS}/{escape(name)}"


def overlaps(blocks: Sequence[Block]) -> list[tuple[int, int]]:
    """Pairs (later, earlier) of blocks that share a cell, sorted.

    Each block is named as the later one at most once; blocks that are not share no cell. A line
    sweeps over the columns, with the blocks on it that overlap no other so far: n log n steps,
    however large the blocks are.
    """
    found = []
    line: list[tuple[int, int]] = []  # first row and index, in order
    ends: list[tuple[int, int]] = []  # column where a block ends, and its index
    for index in sorted(range(len(blocks)), key=lambda index: blocks[index][0]):
        x, y, width, height = blocks[index]
        while ends and ends[0][0] <= x:
            _, over = heappop(ends)
            at = bisect_left(line, (blocks[over][1], over))
            if line[at : at + 1] == [(blocks[over][1], over)]:  # still on the line
                del line[at]
        first = bisect_left(line, (y, -1))
        if first and y < line[first - 1][0] + blocks[line[first - 1][1]][3]:
            first -= 1
        last = bisect_left(line, (y + height, -1))
        sharing = [other for _, other in line[first:last]]
        earliest = min(sharing, default=index)
        if earliest < index:
            found.append((index, earliest))
            continue
        found += [(other, index) for other in sharing]
        del line[first:last]
        insort(line, (y, index))
        heappush(ends, (x + width, index))
    return sorted(found)


def cover(blocks: Sequence[Block], target: Block) -> bool:
    """Whether blocks together cover another one; time about quadratic in their number."""
    x, y, width, height = target
    near = sorted(
        (low, low + high, left, left + wide)
        for left, low, wide, high in blocks
        if left < x + width and x < left + wide and low < y + height and y < low + high
    )
    edges = {x, *(edge for block in near for edge in block[2:] if x < edge < x + width)}
    for edge in edges:
        reached = y
        for low, high, left, right in near:
            if left <= edge < right:
                if low > reached:
                    return False
                if high > reached:
                    reached = high
        if reached < y + height:
            return False
    return True


def with_classes(surfaces: set[Any], grids: Iterable[Any]) -> set[Any]:
    """Names of surfaces, and of those that classes of rasters stand for, `UNSET` for none."""
    return surfaces.union(*(grid.names.values() for grid in grids if grid is not UNSET))


class Tree(Struct, frozen=True, dict=True):
    """Elements of a terrain or a library, level by level, in document order within a level.

    Values are read by columns, one attribute of all elements, as there may be a million of them.

    Attributes:
        elements: elements, the root first; empty where the text has errors and has only columns.
        families: parent, first child and end (exclusive) of each element with children; siblings
            stand side by side.
        levels: first element of each level, and at the end the number of elements.
        columns: columns by attribute that were read or asked for before.
        roots: pointers of the elements of the first level: the root, and the roots of parts.
        steps: end of each element's name, behind that of its parent, where it was written out from
            parts or copies; None where the place among its siblings gives it.
        rests: differences of the decimals and the doubles of `at` and `extent`, along x and y each,
            of each element at a free place; None where the doubles stand for a text's decimals.
        notes: results of others about the tree, by name.
    """

    elements: list[Element]
    families: list[tuple[int, int, int]]
    levels: list[int]
    columns: dict[str, list[Any]] = field(default_factory=dict)
    roots: tuple[str, ...] = (ROOT,)
    steps: list[str] | None = None
    rests: list[tuple[float, float, float, float] | None] | None = None
    notes: dict[str, Any] = field(default_factory=dict)
    _distinct: dict[str, set[Any]] = field(default_factory=dict)
    _above: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.levels[-1]

    def column(self, name: str) -> list[Any]:
        """Values of an attribute of all elements, `UNSET` where it is left out."""
        if name not in self.columns:
            self.columns[name] = list(map(attrgetter(name), self.elements))
        return self.columns[name]

    def value(self, name: str, index: int) -> Any:
        """Value of an attribute of an element."""
        return getattr(self.elements[index], name) if self.elements else self.column(name)[index]

    def distinct(self, name: str) -> set[Any]:
        """Different values of an attribute."""
        if name not in self._distinct:
            self._distinct[name] = set(self.column(name))
        return self._distinct[name]

    def first_of(self, name: str) -> dict[Any, int]:
        """Return the first element with each value of an attribute that is not absent, in order."""
        found: dict[Any, int] = {}
        if self.distinct(name) <= {UNSET}:
            return found
        for index, value in enumerate(self.column(name)):
            if value is not UNSET:
                found.setdefault(value, index)
        return found

    def replace(self, name: str, values: Mapping[Any, Any]) -> None:
        """Replace values of an attribute of all elements by others, in the column and in these."""
        column = self.column(name)
        for index, value in enumerate(column):
            if value in values:
                column[index] = values[value]
                if self.elements:
                    structs.force_setattr(self.elements[index], name, values[value])
        self._distinct.pop(name, None)

    @property
    def worn(self) -> set[Any]:
        """Names of the surfaces of elements, their own and those of classes; `UNSET` for none."""
        return with_classes(self.distinct("surface"), self.distinct("surface_grid"))

    def storey(self, index: int) -> Any:
        """Deck or bore that an element is; `UNSET` for the ground."""
        deck = self.value("deck", index)
        return self.value("bore", index) if deck is UNSET else deck

    @cached_property
    def has_storeys(self) -> bool:
        """Whether any element is a deck or a bore."""
        return any(self.distinct(key) != {UNSET} for key in ("deck", "bore"))

    def wears(self, index: int, surfaces: set[str]) -> bool:
        """Whether an element has one of some surfaces, its own or that of a class."""
        own = {self.value("surface", index)}
        return not with_classes(own, (self.value("surface_grid", index),)).isdisjoint(surfaces)

    @property
    def shapes(self) -> set[Any]:
        """Names of primitives of elements, and of other faces of storeys; `UNSET` for none."""
        storeys = self.distinct("deck") | self.distinct("bore")
        return self.distinct("type").union(one.face for one in storeys if one is not UNSET)

    def has_shape(self, index: int, primitives: set[str]) -> bool:
        """Whether an element has one of some primitives, its own or that of its other face."""
        if self.value("type", index) in primitives:
            return True
        storey = self.storey(index) if self.has_storeys else UNSET
        return storey is not UNSET and storey.face in primitives

    def count_lacking(self, name: str) -> int:
        """Number of elements without an attribute."""
        key = f"lacking {name}"
        if key not in self.notes:
            self.notes[key] = self.column(name).count(UNSET)
        count: int = self.notes[key]
        return count

    def grid(self, index: int) -> Pair:
        """Columns and rows of the grid of an element."""
        return pair_of(self.value("cells", index), DEFAULT_CELLS)

    def block(self, index: int) -> Block:
        """Cells of an element in its parent's grid; -1 where the first is unknown."""
        xs, ys, spans = self._cell_columns
        x, y = xs[index], ys[index]
        x, y = -1 if x is UNSET else x, -1 if y is UNSET else y
        span = UNSET if spans is None else spans[index]
        return (x, y, 1, 1) if span is UNSET else (x, y, *span)

    @cached_property
    def _cell_columns(self) -> tuple[list[Any], list[Any], list[Any] | None]:
        spans = self.column("span") if self.distinct("span") != {UNSET} else None
        return self.column("cell_x"), self.column("cell_y"), spans

    def place(self, index: int) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Middle and side along x, and along y, of an element's free place; None for a cell."""
        at, extent = self.column("at")[index], self.column("extent")[index]
        if at is UNSET or extent is UNSET:
            return None
        wide, tall = pair_of(extent, 0.0)
        return None if not all(map(_finite, (*at, wide, tall))) else ((at[0], wide), (at[1], tall))

    def elements_with(self, name: str, wanted: Container[Any]) -> Iterator[tuple[int, Any]]:
        """Indices and values of the elements whose attribute is one of some values."""
        if any(value in wanted for value in self.distinct(name)):
            for index, value in enumerate(self.column(name)):
                if value in wanted:
                    yield index, value

    @cached_property
    def parents(self) -> list[int]:
        """Index of each element's parent; -1 for a root."""
        parents = [-1] * min(len(self.roots), len(self))
        for parent, begin, end in self.families:
            parents.extend(repeat(parent, end - begin))
        return parents

    @cached_property
    def root_at(self) -> dict[str, int]:
        """Index of each root by its pointer."""
        return {pointer: index for index, pointer in enumerate(self.roots[: len(self)])}

    @cached_property
    def root_of(self) -> list[int]:
        """Index of the root of each element; a root's own."""
        root_of = list(range(min(len(self.roots), len(self))))
        for parent, begin, end in self.families:
            root_of.extend(repeat(root_of[parent], end - begin))
        return root_of

    @cached_property
    def first_child(self) -> list[int]:
        """Index at which the children of each element begin, or would begin."""
        first_child: list[int] = []
        after = len(self.roots)
        for parent, begin, end in self.families:
            first_child.extend(repeat(begin, parent + 1 - len(first_child)))
            after = end
        first_child.extend(repeat(after, len(self) - len(first_child)))
        return first_child

    def brood(self, index: int) -> tuple[int, int]:
        """First and end (exclusive) of the children of an element."""
        begin = self.first_child[index]
        end = self.first_child[index + 1] if index + 1 < len(self) else len(self)
        return begin, end

    @cached_property
    def crowded_siblings(self) -> list[tuple[int, int]]:
        """First and end (exclusive) of the siblings of which some may share a cell.

        Siblings with a missing cell are left out, as nothing can be said of them.
        """
        xs, ys = self.column("cell_x"), self.column("cell_y")
        spans = self.distinct("span") != {UNSET} and self.column("span")
        crowded = []
        for _, begin, end in self.families:
            if begin + 1 < end:
                cells = set(zip(xs[begin:end], ys[begin:end], strict=True))
                few = len(cells) < end - begin
                wide = spans and spans[begin:end].count(UNSET) < end - begin
                if (few or wide) and UNSET not in chain.from_iterable(cells):
                    crowded.append((begin, end))
        return crowded

    def shared_cells(self, apart: Container[int] = ()) -> list[tuple[int, int]]:
        """Elements that share cells with an earlier sibling, each with that sibling.

        Args:
            apart: elements that are not looked at.
        """
        xs, ys = self.column("cell_x"), self.column("cell_y")
        spans = self.distinct("span") != {UNSET}
        if apart or any(self.distinct(key) != {UNSET} for key in ("at", "repeat", "scatter")):
            return [
                pair
                for _, begin, end in self.families
                for pair in self._shared_cells_of(begin, end, apart)
            ]
        shared = []
        for begin, end in self.crowded_siblings:
            if spans:
                blocks = [self.block(index) for index in range(begin, end)]
                shared += [(begin + later, begin + other) for later, other in overlaps(blocks)]
                continue
            first: dict[tuple[int, int], int] = {}
            for index in range(begin, end):
                other = first.setdefault((xs[index], ys[index]), index)
                if other != index:
                    shared.append((index, other))
        return shared

    def _shared_cells_of(
        self, begin: int, end: int, apart: Container[int]
    ) -> list[tuple[int, int]]:
        """Siblings in a range that share cells with an earlier one, some copied or at free places.

        Where there are very many copies, only the first ones are compared.
        """
        blocks: list[Block] = []
        owners: list[int] = []
        for index in range(begin, end):
            x, y, w, h = self.block(index)
            if index in apart or (
                {self.value("at", index), self.value("scatter", index)} != {UNSET}
            ):
                continue
            if min(x, y) < 0:
                return []
            again = self.value("repeat", index)
            count, step = ((1, 1), (0, 0)) if again is UNSET else (again.count, again.step)
            if len(blocks) + count[0] * count[1] > MANY_COPIES:
                count = (1, 1)
            for j in range(count[1]):
                for i in range(count[0]):
                    blocks.append((x + i * int(step[0]), y + j * int(step[1]), w, h))
                    owners.append(index)
        pairs = {(owners[later], owners[other]) for later, other in overlaps(blocks)}
        first: dict[int, int] = {}
        for later, other in sorted(pairs):
            if later != other:
                first.setdefault(later, other)
        return list(first.items())

    def pointer(self, index: int) -> str:
        """JSON pointer of an element."""
        parent = self.parents[index]
        if parent < 0:
            return self.roots[index]
        if parent not in self._above:  # kept for the siblings, which mostly follow each other
            self._above.clear()
            self._above[parent] = self._path(parent)
        return f"{self._above[parent]}/children/{index - self.first_child[parent]}"

    def _path(self, index: int) -> str:
        steps = []
        while (parent := self.parents[index]) >= 0:
            steps.append(f"/children/{index - self.first_child[parent]}")
            index = parent
        return self.roots[index] + "".join(reversed(steps))

    def rectangle(self, index: int, definition: Definition) -> Bounds | None:
        """World rectangle of an element's cell; None where it is not known.

        For a turned element at a free place it is the rectangle before the turn.
        """
        path = []
        while index >= 0:
            path.append(index)
            index = self.parents[index]
        corner, extent = definition.corner, definition.extent
        if not all(map(_finite, (*corner, *extent))):
            return None
        # exact, so that neither depth nor large coordinates add errors; whole numbers over a common
        # denominator, as reducing fractions takes long where the tree is deep
        low, side, whole = [0, 0], [1, 1], [1, 1]
        corners, extents = [*map(exact, corner)], [*map(exact, extent)]
        free = self.distinct("at") != {UNSET}
        for parent, element in zip(reversed(path), reversed(path[:-1]), strict=False):
            if free and (place := self.place(element)):
                # start again: the place counts from the corner of the parent's cell
                for axis, (at, length) in enumerate(place):
                    corners[axis] += extents[axis] * Fraction(low[axis], whole[axis])
                    corners[axis] += exact(at) - exact(length) / 2
                    extents[axis] = exact(length)
                low, side, whole = [0, 0], [1, 1], [1, 1]
                continue
            grid, block = self.grid(parent), self.block(element)
            if min(block) < 0:
                return None
            for axis in (0, 1):
                low[axis] = low[axis] * grid[axis] + side[axis] * block[axis]
                side[axis] *= block[axis + 2]
                whole[axis] *= grid[axis]
        west, south, east, north = (
            float(corners[axis] + extents[axis] * Fraction(part, whole[axis]))
            for parts in (low, map(add, low, side))
            for axis, part in enumerate(parts)
        )
        return west, south, east, north


def _finite(number: float) -> bool:
    return number - number == 0


def flatten(definition: Library, absent: Iterable[str] = ()) -> Tree:
    """Flatten the tree of a terrain, with the trees of its parts or of a library's.

    Time and memory are linear in the number of elements.

    Args:
        definition: terrain or library.
        absent: attributes that no element has.
    """
    root = definition.elem_tree if isinstance(definition, Definition) else UNSET
    parts = definition.assemblies
    roots = ((ROOT,) if root is not UNSET else ()) + tuple(map(part_pointer, parts))
    level = [*(() if root is UNSET else (root,)), *parts.values()]
    elements: list[Element] = []
    families: list[tuple[int, int, int]] = []
    levels = [0]
    while level:
        start = len(elements)
        elements.extend(level)
        after = len(elements)
        levels.append(after)
        broods = list(map(attrgetter("children"), level))
        level = []
        if broods.count(UNSET) < len(broods):  # most elements are in the last level
            for index, children in enumerate(broods, start):
                if children:  # UNSET counts as empty
                    begin = after + len(level)
                    level.extend(children)
                    families.append((index, begin, after + len(level)))
    columns = dict.fromkeys(absent, [UNSET] * len(elements)) if elements else {}
    distinct: dict[str, set[Any]] = {name: {UNSET} for name in columns}
    return Tree(elements, families, levels, columns, roots=roots or (ROOT,), _distinct=distinct)


def complete(definition: Definition, tree: Tree) -> Definition:
    """Return a definition with its elements, taken from the columns of the tree if it has none."""
    if tree.elements:
        return definition
    broods: list[Any] = [UNSET] * len(tree)
    families = list(tree.families)
    elements: list[Element] = []  # elements of the level below
    names = Element.__struct_fields__[:-1]  # without the children
    for begin, end in reversed(list(pairwise(tree.levels))):
        while families and families[-1][0] >= begin:
            parent, first, last = families.pop()
            broods[parent] = tuple(elements[first - end : last - end])
        columns = [tree.column(name)[begin:end] for name in names]
        elements = list(map(Element, *columns, broods[begin:end]))
    given = dict(zip(tree.roots, elements, strict=True))
    parts = definition.parts
    if parts is not UNSET:
        parts = {name: given[part_pointer(name)] for name in parts}
    return structs.replace(definition, elem_tree=given.get(ROOT, UNSET), parts=parts)
