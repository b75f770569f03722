"""The tree of elements laid flat, breadth first, without recursion."""

from __future__ import annotations

from collections.abc import Container, Iterator
from functools import cached_property
from itertools import chain, repeat
from operator import add, attrgetter
from typing import Any

from msgspec import UNSET, Struct, field

from terratool.definition.blocks import Block, overlaps
from terratool.definition.findings import Rectangle
from terratool.definition.model import DEFAULT_CELLS, Definition, Element

ROOT = "/elemTree"

Pair = tuple[int, int]


class Tree(Struct, frozen=True, dict=True):
    """All elements, level by level, in document order within a level.

    What a million elements have is looked at in columns, one attribute of all of them.

    Attributes:
        elements: the root first; none where the text has errors and the columns were read alone.
        families: parent, first child and last but one, of each element that has children; siblings
            stand side by side.
        levels: where each level begins, and at the end the number of elements.
        columns: those that were read or looked at before.
    """

    elements: list[Element]
    families: list[tuple[int, int, int]]
    levels: list[int]
    columns: dict[str, list[Any]] = field(default_factory=dict)
    _distinct: dict[str, set[Any]] = field(default_factory=dict)
    _above: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.levels[-1]

    def column(self, name: str) -> list[Any]:
        """One attribute of all elements, `UNSET` where it is left out."""
        if name not in self.columns:
            self.columns[name] = list(map(attrgetter(name), self.elements))
        return self.columns[name]

    def value(self, name: str, index: int) -> Any:
        """One attribute of one element."""
        return getattr(self.elements[index], name) if self.elements else self.column(name)[index]

    def distinct(self, name: str) -> set[Any]:
        """The different values of an attribute."""
        if name not in self._distinct:
            # the columns of these will be wanted, too
            at_once = name in self.columns or name in ("cell_x", "cell_y")
            values = self.column(name) if at_once else map(attrgetter(name), self.elements)
            self._distinct[name] = set(values)
        return self._distinct[name]

    def grid(self, index: int) -> Pair:
        """Columns and rows of the grid of an element."""
        cells = self.value("cells", index)
        if cells is UNSET:
            return DEFAULT_CELLS, DEFAULT_CELLS
        return cells if isinstance(cells, tuple) else (cells, cells)

    def block(self, index: int) -> Block:
        """The cells of an element in its parent's grid; -1 where the first is unknown."""
        x, y = self.column("cell_x")[index], self.column("cell_y")[index]
        x, y = -1 if x is UNSET else x, -1 if y is UNSET else y
        span = self.column("span")[index] if self.distinct("span") != {UNSET} else UNSET
        return (x, y, 1, 1) if span is UNSET else (x, y, *span)

    def having(self, name: str, wanted: Container[Any]) -> Iterator[tuple[int, Any]]:
        """Index and value of the elements whose attribute is one of these."""
        if any(value in wanted for value in self.distinct(name)):
            for index, value in enumerate(self.column(name)):
                if value in wanted:
                    yield index, value

    @cached_property
    def parents(self) -> list[int]:
        """Index of each element's parent; the root's is -1."""
        parents = [-1] * min(1, len(self))
        for parent, begin, end in self.families:
            parents.extend(repeat(parent, end - begin))
        return parents

    @cached_property
    def first_child(self) -> list[int]:
        """Where the children of each element begin, or would."""
        first_child: list[int] = []
        after = 1
        for parent, begin, end in self.families:
            first_child.extend(repeat(begin, parent + 1 - len(first_child)))
            after = end
        first_child.extend(repeat(after, len(self) - len(first_child)))
        return first_child

    @cached_property
    def crowded(self) -> list[tuple[int, int]]:
        """First and last but one of the siblings of which some may share a cell.

        Where cells are missing, nothing can be said.
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

    @cached_property
    def shared(self) -> list[tuple[int, int]]:
        """Elements that share cells with an earlier sibling, and that sibling."""
        xs, ys = self.column("cell_x"), self.column("cell_y")
        spans = self.distinct("span") != {UNSET}
        shared = []
        for begin, end in self.crowded:
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

    def pointer(self, index: int) -> str:
        """JSON pointer of an element."""
        parent = self.parents[index]
        if parent < 0:
            return ROOT
        if parent not in self._above:  # kept for the siblings, which mostly follow
            self._above.clear()
            self._above[parent] = self._path(parent)
        return f"{self._above[parent]}/children/{index - self.first_child[parent]}"

    def _path(self, index: int) -> str:
        steps = []
        while (parent := self.parents[index]) >= 0:
            steps.append(f"/children/{index - self.first_child[parent]}")
            index = parent
        return ROOT + "".join(reversed(steps))

    def rectangle(self, index: int, definition: Definition) -> Rectangle | None:
        """The world rectangle of an element's cell; None where that is not known."""
        from fractions import Fraction

        path = []
        while index >= 0:
            path.append(index)
            index = self.parents[index]
        corner, extent = definition.corner, definition.extent
        if not all(map(_finite, (*corner, *extent))):
            return None
        # exact, so that neither depth nor large coordinates blur it; whole numbers over a common
        # denominator, as reducing fractions takes long where the tree is deep
        low, side, whole = [0, 0], [1, 1], [1, 1]
        for parent, element in zip(reversed(path), reversed(path[:-1]), strict=False):
            grid, block = self.grid(parent), self.block(element)
            if min(block) < 0:
                return None
            for axis in (0, 1):
                low[axis] = low[axis] * grid[axis] + side[axis] * block[axis]
                side[axis] *= block[axis + 2]
                whole[axis] *= grid[axis]
        west, south, east, north = (
            float(Fraction(corner[axis]) + Fraction(extent[axis]) * Fraction(part, whole[axis]))
            for parts in (low, map(add, low, side))
            for axis, part in enumerate(parts)
        )
        return west, south, east, north


def _finite(number: float) -> bool:
    return number - number == 0


def flatten(definition: Definition) -> Tree:
    """Lay the tree of a definition flat; time and memory linear in the number of elements."""
    root = definition.elem_tree
    level = [] if root is UNSET else [root]
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
    return Tree(elements, families, levels)
