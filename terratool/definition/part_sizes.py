"""In what sizes the parts of a terrain stand, as far as that matters to elements in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import lru_cache
from itertools import islice
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.exact import Sides, sides
from terratool.definition.model import Definition, Pair, pair_of
from terratool.definition.scattering import least_drawn
from terratool.definition.tree import Tree
from terratool.definition.uses import Root, Uses, places_of, quarter_turns


class PartSize(NamedTuple):
    """A size that a part stands in.

    Attributes:
        part: its name, empty for the terrain.
        sides: of its cell, as they are before any quarter turn of the part.
        lies: whether it is turned by a quarter or three.
        whole: whether its root is trimmed by no cell: it is that of the terrain, or stands free.
    """

    part: str
    sides: Sides
    lies: bool
    whole: bool


class Limits(NamedTuple):
    """How much is looked at.

    Attributes:
        sizes: so many of them.
        cells: so many different cells in them, when each part was looked at once.
    """

    sizes: int
    cells: int


PLACES = Limits(10_000, 200_000)
"""Of parts in which there are free places."""

_Step = tuple[int, Pair, tuple[int, int]]
"""The cell around and the block and grid in it; or -1 and the sides of a free place."""


class Cells:
    """The cells below a root; those that have the same sides in every size are one.

    Attributes:
        root: where the tree of a terrain or of a part begins.
    """

    def __init__(self, root: Root) -> None:
        self.root = root
        self._numbers = {root.element: 0}
        self._steps: dict[_Step, int] = {(-1, (0.0, 0.0), (0, 0)): 0}
        self._grid = lru_cache(maxsize=1)(root.tree.grid)  # siblings mostly follow
        self._free = is_free(root.tree)

    def __len__(self) -> int:
        return len(self._steps)

    def number(self, index: int) -> int:
        """The number of the cell of an element; that of the root is 0."""
        parents, path = self.root.tree.parents, []
        while index not in self._numbers:
            path.append(index)
            index = parents[index]
        number = self._numbers[index]
        for inner in reversed(path):
            number = self._steps.setdefault(self._step(inner, number), len(self._steps))
            self._numbers[inner] = number
        return number

    def _step(self, index: int, around: int) -> _Step:
        tree = self.root.tree
        if self._free(index):
            scatter, extent = tree.value("scatter", index), tree.value("extent", index)
            if scatter is not UNSET:  # of scattered copies the smallest counts
                smallest = least_drawn(scatter, pair_of(extent, math.nan))
                return -1, (smallest, smallest), (1, 1)
            return -1, pair_of(extent, math.nan), (1, 1)
        return around, tree.block(index)[2:], self._grid(tree.parents[index])

    def sides(self, size: PartSize) -> list[Sides]:
        """The sides of all cells that were numbered, before quarter turns of the part.

        Those of a free place do not turn with the part: in one that lies they are exchanged.
        """
        found = [size.sides]
        for around, own, grid in islice(self._steps, 1, None):
            if around < 0:
                found.append(sides(own).turned(size.lies))
            else:
                found.append(found[around].block((int(own[0]), int(own[1])), grid))
        return found


class Alike(NamedTuple):
    """Elements of one size of a part for which the same holds.

    Attributes:
        size: of the part.
        root: where the part begins.
        sides: of the cell that they name, before quarter turns of the part.
        key: what else is the same.
        elements: by their indices.
    """

    size: PartSize
    root: Root
    sides: Sides
    key: Hashable
    elements: list[int]


Sorted = Callable[[Cells], Iterable[tuple[int, Hashable, int]]]
"""Elements below a root that are looked at: the number of a cell, a key, and their index."""


class _Plan(NamedTuple):
    """What is below a root.

    Attributes:
        uses: of other parts, by cell, quarter turns, name, and whether they stand free; None where
            that is as the root stands.
        groups: of elements that are looked at, by cell and key.
    """

    cells: Cells
    uses: dict[tuple[int, int, str, bool | None], list[int]]
    groups: dict[tuple[int, Hashable], list[int]]

    @property
    def work(self) -> int:
        return len(self.cells) + len(self.uses) + len(self.groups)


class PartSizes:
    """The sizes of a terrain and of parts in it, each with what stands for it in which sizes.

    Attributes:
        found: the sizes; of each the users: a size, and an element in it.
        complete: whether they are all; when there are more than may be, the last ones are missing.
    """

    def __init__(
        self,
        uses: Uses,
        parts: set[str],
        look: Sorted,
        limits: Limits,
        same: Callable[[PartSize], Hashable] = lambda size: size,
    ) -> None:
        """Follow the uses of parts from the terrain on.

        Args:
            uses: of the terrain; none of its parts contains itself.
            parts: names of those that are looked at, and of those that lead to them.
            look: the elements that are looked at.
            limits: how much of it.
            same: sizes for which this is the same count as one.
        """
        self._uses, self._parts, self._look = uses, parts, look
        self._plans: dict[str, _Plan] = {}
        self._followed: list[PartSize] = []
        self.complete = True
        self.found: dict[PartSize, list[tuple[PartSize, list[int]]]] = {}
        definition = uses.document.model
        assert isinstance(definition, Definition)
        start = PartSize("", sides(definition.extent), lies=False, whole=True)
        known = {same(start): start}
        self.found[start] = []
        pending, work = [start], 0
        while pending:
            size = pending.pop()
            again = size.part in self._plans
            plan = self._plan(size.part)
            work += again * plan.work
            if len(self.found) > limits.sizes or work > limits.cells:
                self.complete = False
                break
            self._followed.append(size)
            lengths = plan.cells.sides(size)
            for (cell, quarters, part, free), elements in plan.uses.items():
                below = PartSize(
                    part,
                    lengths[cell].turned(quarters),
                    size.lies ^ (quarters % 2 == 1),
                    size.whole if free is None else free,
                )
                below = known.setdefault(same(below), below)
                if below not in self.found:
                    self.found[below] = []
                    pending.append(below)
                self.found[below].append((size, elements))

    def _plan(self, part: str) -> _Plan:
        if part in self._plans:
            return self._plans[part]
        root = self._uses.part(part) if part else self._uses.root
        tree, cells = root.tree, Cells(root)
        plan = self._plans[part] = _Plan(cells, {}, {})
        turns, free_at = tree.column("turn_deg"), is_free(tree)
        for use in self._uses.within(root):
            if use.part in self._parts:
                quarters = quarter_turns(turns[use.element])
                free = None if use.element == root.element else free_at(use.element)
                key = cells.number(use.element), quarters, use.part, free
                plan.uses.setdefault(key, []).append(use.element)
        for cell, what, index in self._look(cells):
            plan.groups.setdefault((cell, what), []).append(index)
        return plan

    def alike(self) -> Iterator[Alike]:
        """The elements that are looked at, once for each size that they stand in."""
        for size in self._followed:
            plan = self._plan(size.part)
            lengths = plan.cells.sides(size) if plan.groups else []
            for (cell, key), elements in plan.groups.items():
                yield Alike(size, plan.cells.root, lengths[cell], key, elements)

    def leading_to(self, size: PartSize, seen: set[PartSize]) -> Iterator[int]:
        """The elements of the terrain with which a part comes to stand in a size.

        Args:
            size: of the part.
            seen: sizes that are not looked at again.
        """
        pending = [size]
        while pending:
            for user, elements in self.found[pending.pop()]:
                if not user.part:
                    yield from elements
                elif user not in seen:
                    seen.add(user)
                    pending.append(user)


def sizes_of_places(uses: Uses) -> PartSizes | None:
    """The sizes of parts in which there are free places; None where there are none to be had.

    The cells that are looked at are those around the free places.
    """
    definition = uses.document.model
    if not uses.has_root or uses.circles:
        return None
    if not isinstance(definition, Definition) or definition.size is UNSET:
        return None
    parts = uses.leading_to(lambda root: bool(places_of(root)))
    if not parts and not places_of(uses.root):
        return None

    def look(cells: Cells) -> Iterator[tuple[int, Hashable, int]]:
        tree = cells.root.tree
        for index in places_of(cells.root):
            if tree.parents[index] >= 0:
                yield cells.number(tree.parents[index]), None, index

    return PartSizes(uses, parts, look, PLACES)


def is_free(tree: Tree) -> Callable[[int], bool]:
    """What tells whether an element stands at a free place, or its copies do."""
    keys = ("extent", "scatter")
    columns = [tree.column(key) for key in keys if tree.distinct(key) != {UNSET}]
    return lambda index: any(column[index] is not UNSET for column in columns)
