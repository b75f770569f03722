"""Uses of parts: the parts that a definition uses, and the numbers of elements in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

from msgspec import UNSET, Struct

from terratool.definition.libraries import Dictionary, KnownNames, Named, SourceDocument
from terratool.definition.model import Definition, Element, Library, Pair, pair_of
from terratool.definition.scattering import copy_count
from terratool.definition.tree import ROOT, Tree, part_pointer

MAX_ELEMENTS = 2_000_000
"""Most elements that are written out."""
MAX_DEPTH = 1000
"""Most parts that may stand in one another."""


class Root(NamedTuple):
    """Root element of the tree of a terrain or of a part."""

    tree: Tree
    element: int
    home: SourceDocument


class PartUse(NamedTuple):
    """Element in whose cell a part stands."""

    element: int
    part: str


class End(NamedTuple):
    """Element of a primitive that an element stands for, and its turn through parts, degrees."""

    root: Root
    turn: float


class PartGraph(Struct, frozen=True, dict=True):
    """Parts that contain one another.

    Attributes:
        named: parts by name.
    """

    named: Mapping[str, Named[Element]]

    def root(self, name: str) -> Root:
        """Root of a part."""
        home = self.named[name].home
        tree = home.decoded.tree
        return Root(tree, tree.root_at[part_pointer(name)], home)

    @cached_property
    def known_parts(self) -> set[str]:
        """Names of all parts that could be read."""
        return {
            name
            for name, part in self.named.items()
            if part_pointer(name) in part.home.decoded.tree.root_at
        }

    @cached_property
    def inner(self) -> dict[str, set[str]]:
        """Parts that stand in each part, directly."""
        return {
            name: {use.part for use in uses_below(self.root(name)) if use.part in self.known_parts}
            for name in self.known_parts
        }

    @cached_property
    def inner_first(self) -> list[str]:
        """Parts that do not lead into a circle, each behind the parts that stand in it."""
        users: dict[str, list[str]] = {name: [] for name in self.known_parts}
        for name, used in self.inner.items():
            for other in used:
                users[other].append(name)
        open_uses = {name: len(used) for name, used in self.inner.items()}
        order = [name for name, count in open_uses.items() if count == 0]
        for name in order:
            for user in users[name]:
                open_uses[user] -= 1
                if open_uses[user] == 0:
                    order.append(user)
        return order

    @cached_property
    def circles(self) -> set[str]:
        """Parts that contain themselves, or parts that do."""
        return self.known_parts.difference(self.inner_first)

    @cached_property
    def circle_of(self) -> dict[str, int]:
        """Number of the circle of each part of `circles`; parts in each other have the same."""
        found: dict[str, int] = {}
        lowest: dict[str, int] = {}
        path: list[str] = []
        for start in self.circles:
            pending = [] if start in lowest else [(start, iter(self.inner[start]), len(path))]
            while pending:
                name, inner, place = pending[-1]
                if name not in lowest:
                    lowest[name] = place
                    path.append(name)
                below = next((part for part in inner if part in self.circles), None)
                if below is None:
                    pending.pop()
                    if pending:
                        outer = pending[-1][0]
                        lowest[outer] = min(lowest[outer], lowest[name])
                    if lowest[name] == place:
                        found |= dict.fromkeys(path[place:], len(found))
                        del path[place:]
                elif below not in lowest:
                    pending.append((below, iter(self.inner[below]), len(path)))
                elif below not in found:
                    lowest[name] = min(lowest[name], lowest[below])
        return found

    @cached_property
    def depths(self) -> dict[str, int]:
        """Levels of parts in each part, itself included; parts in circles are left out."""
        depths: dict[str, int] = {}
        for name in self.inner_first:
            depths[name] = 1 + max((depths[inner] for inner in self.inner[name]), default=0)
        return depths

    @cached_property
    def ends(self) -> dict[str, End]:
        """Primitive's element that each part stands for; parts in circles are left out."""
        ends: dict[str, End] = {}
        for name in self.inner_first:
            ends[name] = _end(self.root(name), ends)
        return ends

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of elements of each part, written out; parts in circles are left out."""
        counts: dict[str, int] = {}
        for name in self.inner_first:
            counts[name] = _count(self.root(name), counts)
        return counts

    @cached_property
    def scattered_counts(self) -> dict[str, int]:
        """Number of scattered copies of each part, written out; parts in circles are left out."""
        counts: dict[str, int] = {}
        for name in self.inner_first:
            counts[name] = _count(self.root(name), counts, scattered=True)
        return counts

    @cached_property
    def heights(self) -> dict[str, HeightBounds]:
        """Largest factors and offsets of heights in each part; parts in circles are left out."""
        known: dict[str, HeightBounds] = {}
        for name in self.inner_first:
            root = self.root(name)
            top, *below = (_heights(root.tree, index, known) for index in elements_of(root))
            known[name] = HeightBounds(
                max([top.below, *(one.largest for one in below)]),
                top.offset,
                min(one.thinnest for one in (top, *below)),
                max(one.thickest for one in (top, *below)),
            )
        return known


class Uses(Struct, frozen=True, dict=True):
    """Parts that a file knows, and their uses.

    Attributes:
        document: file that uses parts.
        names: names that the file knows.
    """

    document: SourceDocument
    names: KnownNames

    @cached_property
    def graph(self) -> PartGraph:
        """Graph of the parts of all files that are read with this one.

        Files share a graph if each name that stands in several files means the same to them.
        """
        catalogue, parts = self.document.catalogue, self.names.parts
        meant = {name: parts[name] for name in catalogue.repeated_names["parts"] if name in parts}
        graphs: dict[Any, PartGraph] = catalogue.notes.setdefault("part graphs", {})
        key = tuple((name, id(part.home)) for name, part in meant.items())
        if key not in graphs:
            graphs[key] = PartGraph({**catalogue.all_names("parts"), **meant})
        return graphs[key]

    @cached_property
    def is_composed(self) -> bool:
        """Whether parts or copies have to be written out."""
        tree = self.document.decoded.tree
        return any(tree.distinct(key) != {UNSET} for key in ("part", "repeat", "scatter"))

    @cached_property
    def has_storeys(self) -> bool:
        """Whether any element of the terrain is a deck or a bore, directly or in a part."""
        roots = (self.root, *map(self.part, self.parts_in_use)) if self.has_root else ()
        return any(
            root.tree.has_storeys and any(root.tree.storey(one) for one in elements_of(root))
            for root in roots
        )

    @property
    def has_root(self) -> bool:
        """Whether the file is a terrain with a root, rather than a library."""
        return ROOT in self.document.decoded.tree.root_at

    @property
    def root(self) -> Root:
        """Root of the terrain."""
        return Root(self.document.decoded.tree, 0, self.document)

    def part(self, name: str) -> Root:
        """Root of a part."""
        return self.graph.root(name)

    def is_known(self, name: Any) -> bool:
        """Whether the file knows a part, and the part could be read."""
        return name in self.graph.known_parts and name in self.names.parts

    def within(self, root: Root) -> list[PartUse]:
        """Elements that stand for known parts, of a root and all elements below."""
        return [use for use in uses_below(root) if self.is_known(use.part)]

    @cached_property
    def known_parts(self) -> set[str]:
        """Names of the known parts for which elements of the file stand."""
        return set(filter(self.is_known, self.document.decoded.tree.distinct("part")))

    @cached_property
    def circles(self) -> set[str]:
        """Parts that the file has, or names, and that contain themselves, or parts that do."""
        own = self.known_parts.union(self.document.entries["parts"])
        return self.graph.circles.intersection(own)

    @property
    def circle_of(self) -> dict[str, int]:
        """Number of the circle of each part of `circles`; parts in each other have the same."""
        return self.graph.circle_of

    @property
    def depths(self) -> dict[str, int]:
        """Levels of parts in each part, itself included; parts in circles are left out."""
        return self.graph.depths

    def end(self, root: Root) -> End | None:
        """Primitive's element that an element stands for; None if a part between is not known."""
        ends, name = self.graph.ends, root.tree.value("part", root.element)
        if name is UNSET or (name in ends and self.is_known(name)):
            return _end(root, ends)
        return None

    @cached_property
    def parts_in_use(self) -> dict[str, None]:
        """Parts that stand in the terrain, directly or in others, in the order of their use."""
        found: dict[str, None] = {}
        pending = [self.root] if self.has_root else []
        while pending:
            for use in self.within(pending.pop()):
                if use.part not in found:
                    found[use.part] = None
                    pending.append(self.part(use.part))
        return found

    @cached_property
    def has_unknown_part(self) -> bool:
        """Whether an element stands for a part that is not known."""
        tree = self.document.decoded.tree
        return bool(tree.distinct("part") - self.known_parts - {UNSET})

    @cached_property
    def needed_names(self) -> dict[Dictionary, dict[str, None]]:
        """Names that the terrain needs by dictionary, in the order of their first use."""
        terrain = self.document.model
        surfaces: dict[str, None] = {}
        primitives: dict[str, None] = {}
        for root in (self.root, *map(self.part, self.parts_in_use)):
            for names, key in (surfaces, "surface"), (primitives, "type"):
                names |= dict.fromkeys(map(root.tree.column(key).__getitem__, elements_of(root)))
            if root.tree.has_storeys:
                storeys = filter(None, map(root.tree.storey, elements_of(root)))
                primitives |= dict.fromkeys(storey.face for storey in storeys)
            if root.tree.distinct("surface_grid") != {UNSET}:
                classes = map(root.tree.column("surface_grid").__getitem__, elements_of(root))
                for grid in dict.fromkeys(classes):
                    surfaces |= {} if grid is UNSET else dict.fromkeys(grid.names.values())
        surfaces |= dict.fromkeys(sorted(track_surfaces(terrain)))
        for names in (surfaces, primitives):
            names.pop(UNSET, None)  # type: ignore[call-overload]
        return {"surfTypes": surfaces, "elemTypes": primitives, "parts": dict(self.parts_in_use)}

    def height_bounds(self) -> Iterator[tuple[PartUse, HeightBounds]]:
        """Elements of the terrain that stand for parts, each with the numbers in the part.

        The numbers are the factors and offsets of heights when the part is written out.
        """
        if self.has_root:
            for use in self.within(self.root):
                if use.part in self.graph.heights:
                    yield use, _heights(self.root.tree, use.element, self.graph.heights)

    @property
    def elements(self) -> int:
        """Number of elements of the terrain, written out."""
        return _count(self.root, self.graph.counts)

    @property
    def scattered_count(self) -> int:
        """Number of scattered copies of the terrain, written out."""
        return _count(self.root, self.graph.scattered_counts, scattered=True)

    def parts_leading_to(self, wanted: Callable[[Root], bool]) -> set[str]:
        """Parts whose root is wanted, and all parts in which they stand; circles are left out."""
        found: set[str] = set()
        for name in self.graph.inner_first:
            if not found.isdisjoint(self.graph.inner[name]) or wanted(self.part(name)):
                found.add(name)
        return found


class HeightBounds(NamedTuple):
    """Numbers of heights of an element, and of all elements of the part that it stands for.

    Attributes:
        below: largest of all numbers but the offset of the element.
        offset: offset of the element.
        thinnest: least thickness of a deck, or height of a bore; infinite without any.
        thickest: greatest thickness of a deck, or height of a bore; minus infinity without any.
    """

    below: float
    offset: float
    thinnest: float = math.inf
    thickest: float = -math.inf

    @property
    def largest(self) -> float:
        """Largest number."""
        return max(self.below, abs(self.offset), self.thickest)


def _heights(tree: Tree, index: int, known: dict[str, HeightBounds]) -> HeightBounds:
    """Numbers of an element; a vScale that it leaves out is 1 at most."""
    own, offset = tree.value("v_scale", index), tree.value("v_offset", index)
    scatter, inner = tree.value("scatter", index), known.get(tree.value("part", index))
    scale = 1.0 if own is UNSET else own
    sizes = (1.0, 1.0) if scatter is UNSET else scatter.sizes
    offset = 0.0 if offset is UNSET else offset
    below = abs(scale * sizes[1])
    gaps: list[float] = []
    if inner is not None:
        below *= max(1.0, inner.below)
        offset += scale * sizes[1] * inner.offset
        gaps += (inner.thinnest, inner.thickest) if inner.thinnest < math.inf else ()
        sizes = sizes[0] * scale, sizes[1] * scale
    elif tree.has_storeys and (storey := tree.storey(index)) is not UNSET:
        faces = (storey.v_scale, storey.v_offset)
        below = max([below, *(sizes[1] * abs(one) for one in faces if one is not UNSET)])
        gaps += () if storey.gap is UNSET else (storey.gap,)
    products = [size * gap for size in sizes for gap in gaps]
    return HeightBounds(
        below, offset, min(products, default=math.inf), max(products, default=-math.inf)
    )


def track_surfaces(terrain: Library) -> set[str]:
    """Names of surfaces that tracks have, or have depths on."""
    tracks = terrain.ruts if isinstance(terrain, Definition) else ()
    worn = {track.surface for track in tracks if track.surface is not UNSET}
    return worn.union(*(track.depth for track in tracks if isinstance(track.depth, dict)))


def quarter_turns(turn: Any) -> int:
    """Quarter turns of the part in an element, 0 to 3."""
    return 0 if turn is UNSET else int(math.fmod(turn, 360.0) // 90) % 4


def copies(repeat: Any) -> int:
    """Number of elements that a `repeat` stands for."""
    return 1 if repeat is UNSET else repeat.count[0] * repeat.count[1]


Box = tuple[Pair, Pair]
"""South-west and north-east corner of a box."""


def box_of_copies(at: Pair, reach: Pair, repeat: Any) -> Box:
    """Box around the footprints of an element at a free place and of its copies.

    Args:
        at: middle of the element.
        reach: half the sides of the box around its own footprint.
        repeat: `repeat` of the element; `UNSET` for none.
    """
    count, step = ((1, 1), (0.0, 0.0)) if repeat is UNSET else (repeat.count, repeat.step)
    last = at[0] + (count[0] - 1) * step[0], at[1] + (count[1] - 1) * step[1]
    return (
        (min(at[0], last[0]) - reach[0], min(at[1], last[1]) - reach[1]),
        (max(at[0], last[0]) + reach[0], max(at[1], last[1]) + reach[1]),
    )


def uses_below(root: Root) -> list[PartUse]:
    """Elements that stand for parts, known or not, of a root and all elements below."""
    tree = root.tree
    known: dict[int, list[PartUse]] | None = tree.notes.get("part uses")
    if known is None:
        known = {}
        for index, name in enumerate(tree.column("part")) if len(tree) else ():
            if name is not UNSET:
                known.setdefault(tree.root_of[index], []).append(PartUse(index, name))
        tree.notes["part uses"] = known
    return known.get(root.element, [])


def _end(root: Root, ends: dict[str, End]) -> End:
    own = root.tree.value("turn_deg", root.element)
    turn = 0.0 if own is UNSET else math.fmod(own, 360.0)
    name = root.tree.value("part", root.element)
    if name not in ends:
        return End(root, turn)
    return End(ends[name].root, ends[name].turn + turn)


def elements_of(root: Root) -> Sequence[int]:
    """Indices of a root and all elements below, level by level."""
    tree = root.tree
    if len(tree.roots) == 1:
        return range(len(tree))
    known: dict[int, list[int]] | None = tree.notes.get("elements")
    if known is None:
        known = {}
        for index, own in enumerate(tree.root_of):
            known.setdefault(own, []).append(index)
        tree.notes["elements"] = known
    return known[root.element]


def scatters_over_cells(root: Root) -> bool:
    """Whether copies are scattered over a cell of a grid below a root."""
    tree = root.tree
    if tree.distinct("scatter") == {UNSET}:
        return False
    scatters, extents = tree.column("scatter"), tree.column("extent")
    return any(
        scatters[index] is not UNSET and extents[index] is UNSET for index in elements_of(root)
    )


def places_of(root: Root) -> list[int]:
    """Elements below a root that stand at free places."""
    tree = root.tree
    known: dict[int, list[int]] | None = tree.notes.get("places")
    if known is None:
        known = {}
        for index, at in enumerate(tree.column("at")) if tree.distinct("at") != {UNSET} else ():
            if at is not UNSET:
                known.setdefault(tree.root_of[index], []).append(index)
        tree.notes["places"] = known
    return known.get(root.element, [])


def _count(root: Root, counts: dict[str, int], *, scattered: bool = False) -> int:
    """Number of elements of a root and all below, written out, or of scattered copies."""
    tree = root.tree
    members = elements_of(root)
    if all(tree.distinct(key) == {UNSET} for key in ("part", "repeat", "scatter")):
        return 0 if scattered else len(members)
    parts, repeats, scatters = (tree.column(key) for key in ("part", "repeat", "scatter"))
    below = dict.fromkeys(members, 0)
    for index in reversed(members):
        own = not scattered if parts[index] is UNSET else counts.get(parts[index], 0)
        below[index] += own
        if index == root.element:
            break
        times = copies(repeats[index])
        if scatters[index] is not UNSET:
            times = copy_count(scatters[index], pair_of(tree.value("extent", index), math.nan))
            below[index] += scattered
        below[tree.parents[index]] += below[index] * times
    return below[root.element]
