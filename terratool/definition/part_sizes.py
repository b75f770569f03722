"""Sizes in which the parts of a terrain stand, as far as they matter to the elements in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import lru_cache
from itertools import islice
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.exact import Sides, sides
from terratool.definition.model import Definition, Pair, pair_of
from terratool.definition.scattering import smallest_side
from terratool.definition.tree import Tree
from terratool.definition.uses import Root, Uses, places_of, quarter_turns


class PartSize(NamedTuple):
    """Size in which a part stands.

    Attributes:
        part: name of the part, empty for the terrain.
        sides: sides of the part's cell before any quarter turn of the part.
        lies: whether the part is turned by a quarter or three.
        whole: whether no cell trims the part's root: the root is the terrain's, or stands free.
    """

    part: str
    sides: Sides
    lies: bool
    whole: bool


class SizeLimits(NamedTuple):
    """Limits of the search for sizes.

    Attributes:
        sizes: most sizes.
        cells: most cells, uses and groups in parts that were followed before.
    """

    sizes: int
    cells: int


PLACES = SizeLimits(10_000, 200_000)
"""Limits for parts in which there are free places."""

_Step = tuple[int, Pair, tuple[int, int]]
"""Number of the cell around with the block and grid in it; or -1 and the sides of a free place."""


class Cells:
    """Cells below a root; cells that have the same sides in every size count as one.

    Attributes:
        root: root of the tree of a terrain or of a part.
    """

    def __init__(self, root: Root) -> None:
        self.root = root
        self._numbers = {root.element: 0}
        self._steps: dict[_Step, int] = {(-1, (0.0, 0.0), (0, 0)): 0}
        self._grid = lru_cache(maxsize=1)(root.tree.grid)  # siblings mostly follow each other
        self._free = is_free(root.tree)

    def __len__(self) -> int:
        return len(self._steps)

    def number(self, index: int) -> int:
        """Number of the cell of an element; the root's cell is 0."""
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
            if scatter is not UNSET:  # the smallest of scattered copies counts
                smallest = smallest_side(scatter, pair_of(extent, math.nan))
                return -1, (smallest, smallest), (1, 1)
            return -1, pair_of(extent, math.nan), (1, 1)
        return around, tree.block(index)[2:], self._grid(tree.parents[index])

    def sides(self, size: PartSize) -> list[Sides]:
        """Sides of all cells that were numbered, before quarter turns of the part.

        Sides of a free place do not turn with the part, so they are exchanged in one that lies.
        """
        found = [size.sides]
        for around, own, grid in islice(self._steps, 1, None):
            if around < 0:
                found.append(sides(own).turn_by(size.lies))
            else:
                found.append(found[around].block((int(own[0]), int(own[1])), grid))
        return found


class Alike(NamedTuple):
    """Elements in one size of a part that have a cell and a key in common.

    Attributes:
        size: size of the part.
        root: root of the part.
        sides: sides of the elements' cell, before quarter turns of the part.
        key: further properties that the elements have in common.
        elements: indices of the elements.
    """

    size: PartSize
    root: Root
    sides: Sides
    key: Hashable
    elements: list[int]


Sorted = Callable[[Cells], Iterable[tuple[int, Hashable, int]]]
"""Function that yields the elements below a root to look at: number of a cell, key, index."""


class _PartContents(NamedTuple):
    """Elements below a root that matter to the search.

    Attributes:
        uses: elements that use other parts, by cell, quarter turns, name, and whether they stand
            free; None where that is as the root stands.
        groups: elements that are looked at, by cell and key.
    """

    cells: Cells
    uses: dict[tuple[int, int, str, bool | None], list[int]]
    groups: dict[tuple[int, Hashable], list[int]]

    @property
    def work(self) -> int:
        return len(self.cells) + len(self.uses) + len(self.groups)


class PartSizes:
    """Sizes of a terrain and of the parts in it, with the elements that put a part in a size.

    Attributes:
        found: users of each size: a size, and the elements in it.
        complete: whether all sizes were found; the last ones are missing where a limit was reached.
    """

    def __init__(
        self,
        uses: Uses,
        parts: set[str],
        look: Sorted,
        limits: SizeLimits,
        same: Callable[[PartSize], Hashable] = lambda size: size,
    ) -> None:
        """Follow the uses of parts from the terrain on.

        Args:
            uses: uses of the terrain, of whose parts none contains itself.
            parts: names of the parts that are looked at, and of those that lead to them.
            look: function that yields the elements to look at.
            limits: limits of the search.
            same: key of a size; sizes with one key count as one.
        """
        self._uses, self._parts, self._look = uses, parts, look
        self._plans: dict[str, _PartContents] = {}
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
                    lengths[cell].turn_by(quarters),
                    size.lies ^ (quarters % 2 == 1),
                    size.whole if free is None else free,
                )
                below = known.setdefault(same(below), below)
                if below not in self.found:
                    self.found[below] = []
                    pending.append(below)
                self.found[below].append((size, elements))

    def _plan(self, part: str) -> _PartContents:
        if part in self._plans:
            return self._plans[part]
        root = self._uses.part(part) if part else self._uses.root
        tree, cells = root.tree, Cells(root)
        plan = self._plans[part] = _PartContents(cells, {}, {})
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
        """Elements that are looked at, once for each size that they stand in."""
        for size in self._followed:
            plan = self._plan(size.part)
            lengths = plan.cells.sides(size) if plan.groups else []
            for (cell, key), elements in plan.groups.items():
                yield Alike(size, plan.cells.root, lengths[cell], key, elements)

    def elements_leading_to(self, size: PartSize, seen: set[PartSize]) -> Iterator[int]:
        """Elements of the terrain through which a part comes to stand in a size.

        Args:
            size: size of the part.
            seen: sizes that are not followed again; sizes that are followed are added.
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
    """Sizes of parts in which there are free places; None where there are none, or no sizes.

    The elements that are looked at stand at free places, and have the key of the cell around.
    """
    definition = uses.document.model
    if not uses.has_root or uses.circles:
        return None
    if not isinstance(definition, Definition) or definition.size is UNSET:
        return None
    parts = uses.parts_leading_to(lambda root: bool(places_of(root)))
    if not parts and not places_of(uses.root):
        return None

    def look(cells: Cells) -> Iterator[tuple[int, Hashable, int]]:
        tree = cells.root.tree
        for index in places_of(cells.root):
            if tree.parents[index] >= 0:
                yield cells.number(tree.parents[index]), None, index

    return PartSizes(uses, parts, look, PLACES)


def is_free(tree: Tree) -> Callable[[int], bool]:
    """Function that tells whether an element, or its copies, stand at a free place."""
    keys = ("extent", "scatter")
    columns = [tree.column(key) for key in keys if tree.distinct(key) != {UNSET}]
    return lambda index: any(column[index] is not UNSET for column in columns)
