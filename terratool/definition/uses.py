"""Which parts a definition uses, how many elements they come to, and in what sizes they stand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

from msgspec import UNSET, Struct

from terratool.definition.libraries import Dictionary, Document, Names
from terratool.definition.model import Definition, Pair
from terratool.definition.sides import Sides, sides
from terratool.definition.tree import ROOT, Tree, part_pointer

MAX_SIZES = 10_000
"""In so many sizes may parts stand in which there are free places."""


class Root(NamedTuple):
    """Where the tree of a terrain or of a part begins."""

    tree: Tree
    element: int
    home: Document


class SizedElement(NamedTuple):
    """An element at a free place, the sides of its parent's cell, and the part that it is in.

    The sides are those before any quarter turn of the part, whose name is empty in the terrain.
    """

    tree: Tree
    element: int
    parent: Pair
    part: str


class PartUse(NamedTuple):
    """An element in whose cell a part stands."""

    element: int
    part: str


class Uses(Struct, frozen=True, dict=True):
    """The parts that a file knows, and their uses.

    Attributes:
        document: the file.
        names: what it knows.
    """

    document: Document
    names: Names

    @cached_property
    def composed(self) -> bool:
        """Whether anything has to be written out: a part, or copies."""
        tree = self.document.decoded.tree
        return tree.distinct("part") | tree.distinct("repeat") != {UNSET}

    @property
    def has_root(self) -> bool:
        """Whether there is a terrain, and no library."""
        return ROOT in self.document.decoded.tree.root_at

    @property
    def root(self) -> Root:
        """Where the terrain begins."""
        return Root(self.document.decoded.tree, 0, self.document)

    def part(self, name: str) -> Root:
        """Where a part begins."""
        home = self.names.parts[name].home
        tree = home.decoded.tree
        return Root(tree, tree.root_at[part_pointer(name)], home)

    def within(self, root: Root) -> list[PartUse]:
        """The elements below a root, or that itself, that stand for parts which are known."""
        return [
            use for use in _part_uses(root.tree).get(root.element, ()) if use.part in self.known
        ]

    @cached_property
    def known(self) -> set[str]:
        """Names of all parts that are known, and that could be read."""
        return {
            name
            for name, part in self.names.parts.items()
            if part_pointer(name) in part.home.decoded.tree.root_at
        }

    @cached_property
    def circles(self) -> set[str]:
        """Parts that contain themselves, or parts that do."""
        inner = {name: {use.part for use in self.within(self.part(name))} for name in self.known}
        users: dict[str, list[str]] = {name: [] for name in self.known}
        for name, used in inner.items():
            for other in used:
                users[other].append(name)
        open_uses = {name: len(used) for name, used in inner.items()}
        ready = [name for name, count in open_uses.items() if count == 0]
        while ready:
            for user in users[ready.pop()]:
                open_uses[user] -= 1
                if open_uses[user] == 0:
                    ready.append(user)
        return {name for name, count in open_uses.items() if count}

    @cached_property
    def reached(self) -> dict[str, None]:
        """Parts that stand in the terrain, directly or in others."""
        found: dict[str, None] = {}
        pending = [self.root] if self.has_root else []
        while pending:
            for use in self.within(pending.pop()):
                if use.part not in found:
                    found[use.part] = None
                    pending.append(self.part(use.part))
        return found

    def behind(self, name: str) -> set[str]:
        """The parts within a part, and that itself."""
        found = {name}
        pending = [name]
        while pending:
            for use in self.within(self.part(pending.pop())):
                if use.part not in found:
                    found.add(use.part)
                    pending.append(use.part)
        return found

    def leading_to(self, name: str) -> list[PartUse]:
        """The elements of the file itself in whose parts a part is."""
        tree = self.document.decoded.tree
        return [
            PartUse(index, part)
            for index, part in enumerate(tree.column("part"))
            if part in self.known and name in self.behind(part)
        ]

    @cached_property
    def unknown(self) -> bool:
        """Whether an element stands for a part that is not known."""
        tree = self.document.decoded.tree
        return bool(tree.distinct("part") - self.known - {UNSET})

    @cached_property
    def needed(self) -> dict[Dictionary, dict[str, None]]:
        """The names that the terrain needs, in the order in which they come up."""
        terrain = self.document.model
        surfaces: dict[str, None] = {}
        primitives: dict[str, None] = {}
        for root in (self.root, *map(self.part, self.reached)):
            tree = root.tree
            for index, root_of in enumerate(tree.root_of):
                if root_of == root.element:
                    surfaces[tree.value("surface", index)] = None
                    primitives[tree.value("type", index)] = None
        for track in terrain.ruts if isinstance(terrain, Definition) else ():
            surfaces[track.surface] = None  # type: ignore[index]
            surfaces |= dict.fromkeys(track.depth if isinstance(track.depth, dict) else ())
        for names in (surfaces, primitives):
            names.pop(UNSET, None)  # type: ignore[call-overload]
        return {"surfTypes": surfaces, "elemTypes": primitives, "parts": dict(self.reached)}

    def tallest(self) -> Iterator[tuple[PartUse, float]]:
        """For each element of the terrain in whose cell a part stands, the largest factor in it."""
        largest: dict[str, float] = {}

        def factor(root: Root, use: PartUse) -> float:
            own = root.tree.value("v_scale", use.element)
            return (1.0 if own is UNSET else abs(own)) * max(1.0, largest[use.part])

        pending = list(self.known)
        while pending:
            name = pending[-1]
            uses = self.within(self.part(name))
            missing = [use.part for use in uses if use.part not in largest]
            if missing:
                pending += missing
                continue
            largest[pending.pop()] = max(
                (factor(self.part(name), use) for use in uses), default=1.0
            )
        if self.has_root:
            for use in self.within(self.root):
                yield use, factor(self.root, use)

    @cached_property
    def counts(self) -> dict[str, int]:
        """How many elements each part comes to; without those in circles."""
        counts: dict[str, int] = {}
        pending = [name for name in self.known if name not in self.circles]
        while pending:
            name = pending[-1]
            root = self.part(name)
            missing = [use.part for use in self.within(root) if use.part not in counts]
            if missing:
                pending += missing
                continue
            counts[pending.pop()] = _count(root, counts)
        return counts

    @property
    def elements(self) -> int:
        """How many elements the terrain comes to."""
        return _count(self.root, self.counts)

    def free_places(self) -> Iterator[SizedElement | None]:
        """Each element at a free place, once for each size of its parent's cell; None for too many.

        Those in parts that the terrain does not have are left out.
        """
        definition = self.document.model
        assert isinstance(definition, Definition)
        trees = [self.root, *map(self.part, self.reached)]
        if not self.has_root or self.circles:
            return
        if all(root.tree.distinct("at") == {UNSET} for root in trees):
            return
        start = sides(definition.extent)
        seen = {("", start)}
        pending = [("", start)]
        while pending:
            part, extent = pending.pop()
            root = self.part(part) if part else self.root
            lengths = _lengths(root, extent)
            yield from _sized(root, lengths, part)
            for use in self.within(root):
                _, within = lengths[use.element]
                turn = root.tree.value("turn_deg", use.element)
                below = (use.part, within.turned(quarter_turns(turn)))
                if below not in seen:
                    seen.add(below)
                    pending.append(below)
            if len(seen) > MAX_SIZES:
                yield None
                return


class _Lengths(NamedTuple):
    """The sides of an element's cell as numbers, and in full."""

    plain: Pair
    full: Sides


def quarter_turns(turn: Any) -> int:
    """How many quarters an element turns the part in it, 0 to 3."""
    return 0 if turn is UNSET else int(math.fmod(turn, 360.0) // 90) % 4


def copies(repeat: Any) -> int:
    """How many elements a `repeat` stands for."""
    return 1 if repeat is UNSET else repeat.count[0] * repeat.count[1]


def _part_uses(tree: Tree) -> dict[int, list[PartUse]]:
    """The elements that stand for parts, by the root that they are below."""
    known: dict[int, list[PartUse]] | None = tree.notes.get("part uses")
    if known is None:
        known = {}
        for index, name in enumerate(tree.column("part")) if len(tree) else ():
            if name is not UNSET:
                known.setdefault(tree.root_of[index], []).append(PartUse(index, name))
        tree.notes["part uses"] = known
    return known


def _count(root: Root, counts: dict[str, int]) -> int:
    tree = root.tree
    if tree.distinct("part") == {UNSET} and tree.distinct("repeat") == {UNSET}:
        return tree.root_of.count(root.element) if len(tree.roots) > 1 else len(tree)
    parts, repeats = tree.column("part"), tree.column("repeat")
    below = [0] * len(tree)
    for index in range(len(tree) - 1, root.element, -1):
        if tree.root_of[index] == root.element:
            own = below[index] + (1 if parts[index] is UNSET else counts.get(parts[index], 0))
            below[tree.parents[index]] += own * copies(repeats[index])
    part = parts[root.element]
    return below[root.element] + (1 if part is UNSET else counts.get(part, 0))


def _lengths(root: Root, extent: Sides) -> dict[int, _Lengths]:
    """The sides of the cells below a root whose own has these."""
    tree = root.tree
    found = {root.element: _Lengths(extent.lengths, extent)}
    for parent, begin, end in tree.families:
        if parent not in found:
            continue
        around = found[parent].full
        for index in range(begin, end):
            extents = tree.column("extent")[index]
            if extents is not UNSET:
                own = sides(extents if isinstance(extents, tuple) else (extents, extents))
            else:
                own = around.block(tree.block(index)[2:], tree.grid(parent))
            found[index] = _Lengths(own.lengths, own)
    return found


def _sized(root: Root, lengths: dict[int, _Lengths], part: str) -> Iterator[SizedElement]:
    tree = root.tree
    places = tree.column("at")
    for index in lengths:
        parent = tree.parents[index]
        if places[index] is not UNSET and parent >= 0:
            yield SizedElement(tree, index, lengths[parent].plain, part)
