"""Pairs of siblings of two trees, found in rounds: equal ones first, then alike ones."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass

from terratool.definition.tree import Tree
from terratool.viewing.diff.places import ComparedPlace, child_place, distance, overlap, way_between

_ALIKE = 3
"""Least siblings with one displacement that are taken to have moved together."""
MANY_PAIRS = 1_000_000
"""Most pairs of siblings of one key that are compared; with more, siblings pair in order."""


@dataclass(slots=True)
class Sibling:
    """An element among its siblings, whose place is computed when it is asked for.

    Attributes:
        element: index in the tree.
        tree: tree of the element.
        parent: index of the parent.
        around: place of the parent.
    """

    element: int
    tree: Tree
    parent: int
    around: ComparedPlace
    _at: ComparedPlace | None = None

    @property
    def at(self) -> ComparedPlace:
        """Place of the element."""
        if self._at is None:
            self._at = child_place(self.tree, self.element, self.parent, self.around)
        return self._at


class Matching:
    """Siblings of both sides, and the pairs made of them so far.

    Args:
        old, new: siblings of each side; those left unpaired are attributes of these names.
    """

    def __init__(self, old: list[Sibling], new: list[Sibling]) -> None:
        self.old, self.new = old, new
        self.pairs: list[tuple[Sibling, Sibling]] = []

    @property
    def is_open(self) -> bool:
        """Whether both sides have unpaired siblings."""
        return bool(self.old and self.new)

    def take(
        self, old_key: Callable[[Sibling], Hashable], new_key: Callable[[Sibling], Hashable]
    ) -> None:
        """Pair siblings with equal keys, in their order; None equals no key."""
        if not self.is_open:
            return
        waiting: dict[Hashable, deque[int]] = {}
        for number, one in enumerate(self.old):
            if (key := old_key(one)) is not None:
                waiting.setdefault(key, deque()).append(number)
        chosen = []
        for number, one in enumerate(self.new):
            key = new_key(one)
            if key is not None and (same := waiting.get(key)):
                chosen.append((same.popleft(), number))
        self._pair(chosen)

    def take_moved_alike(
        self, old_key: Callable[[Sibling], Hashable], new_key: Callable[[Sibling], Hashable]
    ) -> None:
        """Pair siblings with a unique key, where several have one displacement."""
        if min(len(self.old), len(self.new)) < _ALIKE:
            return
        ours, theirs = _single(self.old, old_key), _single(self.new, new_key)
        ways: dict[Hashable, list[tuple[int, int]]] = {}
        for key, number in ours.items():
            if key in theirs:
                other = theirs[key]
                way = way_between(self.old[number].at.bounds, self.new[other].at.bounds)
                ways.setdefault(way, []).append((number, other))
        best = max(ways.values(), key=len, default=[])
        if len(best) >= _ALIKE:
            self._pair(best)

    def take_nearest(
        self, old_key: Callable[[Sibling], Hashable], new_key: Callable[[Sibling], Hashable],
        *, overlapping: bool = False,
    ) -> None:  # fmt: skip
        """Pair siblings with equal keys, the nearest first; only overlapping ones on demand."""
        if not self.is_open:
            return
        ours, theirs = _groups(self.old, old_key), _groups(self.new, new_key)
        chosen: list[tuple[int, int]] = []
        for key, mine in ours.items():
            others = theirs.get(key, [])
            if len(mine) * len(others) > MANY_PAIRS:
                chosen += () if overlapping else zip(mine, others, strict=False)
                continue
            near = sorted(
                (distance(self.old[i].at.bounds, self.new[j].at.bounds), i, j)
                for i in mine
                for j in others
                if not overlapping or overlap(self.old[i].at.bounds, self.new[j].at.bounds)
            )
            chosen += _greedy(near)
        self._pair(chosen)

    def take_only(
        self, old_key: Callable[[Sibling], Hashable], new_key: Callable[[Sibling], Hashable]
    ) -> None:
        """Pair siblings whose key is unique among the unpaired ones of each side."""
        if not self.is_open:
            return
        ours, theirs = _single(self.old, old_key), _single(self.new, new_key)
        self._pair([(number, theirs[key]) for key, number in ours.items() if key in theirs])

    def _pair(self, chosen: list[tuple[int, int]]) -> None:
        if not chosen:
            return
        self.pairs += [(self.old[i], self.new[j]) for i, j in chosen]
        mine, others = {i for i, _ in chosen}, {j for _, j in chosen}
        self.old = [one for i, one in enumerate(self.old) if i not in mine]
        self.new = [one for j, one in enumerate(self.new) if j not in others]


def _greedy(near: list[tuple[float, int, int]]) -> Iterator[tuple[int, int]]:
    mine: set[int] = set()
    others: set[int] = set()
    for _, i, j in near:
        if i not in mine and j not in others:
            mine.add(i)
            others.add(j)
            yield i, j


def _groups(
    siblings: list[Sibling], key: Callable[[Sibling], Hashable]
) -> dict[Hashable, list[int]]:
    groups: dict[Hashable, list[int]] = {}
    for number, one in enumerate(siblings):
        groups.setdefault(key(one), []).append(number)
    return groups


def _single(siblings: list[Sibling], key: Callable[[Sibling], Hashable]) -> dict[Hashable, int]:
    return {k: found[0] for k, found in _groups(siblings, key).items() if len(found) == 1}


def common(ours: Iterable[Hashable], theirs: Iterable[Hashable]) -> int:
    """Number of keys that two sequences have in common, repeated keys counted."""
    return sum((Counter(ours) & Counter(theirs)).values())
