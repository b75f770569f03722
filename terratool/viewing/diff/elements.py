"""Comparison of two trees: elements matched by place and kind; added, removed, moved, changed.

Siblings of matched parents are compared in rounds, from equal ones to alike ones, so that one more
sibling does not make all behind it differ. Subtrees that are equal are not entered.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Hashable, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from msgspec import UNSET, Struct, field

from terratool.definition.keys import SLOTS
from terratool.definition.model import STOREYS, pair_of
from terratool.definition.tree import Tree
from terratool.definition.uses import Root
from terratool.viewing.diff.matching import MANY_PAIRS, Matching, Sibling, common
from terratool.viewing.diff.places import ComparedPlace, overlap, round_box, within_cell
from terratool.viewing.diff.results import ChangeKind, KeyChange, Pair
from terratool.viewing.diff.sides import DiffSide
from terratool.viewing.diff.signed import NewNames, SignedTree, as_written, class_key, storey_key


class RawChange(NamedTuple):
    """A difference in an element, by its indices in both trees; -1 where it is not there."""

    kind: ChangeKind
    old: int
    new: int
    old_at: ComparedPlace | None
    new_at: ComparedPlace | None
    shift: Pair | None
    keys: tuple[KeyChange, ...]


class TreeDifference(Struct):
    """Differences below two roots.

    Attributes:
        changes: elements that differ, in no order.
        descriptions: number of elements whose descriptions differ.
        written: number of elements that are written otherwise and mean the same.
    """

    changes: list[RawChange] = field(default_factory=list)
    descriptions: int = 0
    written: int = 0


class _Match(NamedTuple):
    """Two elements that are taken to be one; `stays` if their places in the parents are settled."""

    old: int
    old_at: ComparedPlace
    new: int
    new_at: ComparedPlace
    stays: bool


class _ChildMatches(NamedTuple):
    """Children of two elements: matched pairs, removed and added ones.

    `regrid` is whether the grids differ and more children keep their cells than their places.
    """

    pairs: list[tuple[Sibling, Sibling]]
    removed: list[Sibling]
    added: list[Sibling]
    regrid: bool


class TreeComparison(Struct, frozen=True):
    """Comparison of all elements below two roots: of both terrains, or of a part in both.

    Attributes:
        old, new: both definitions.
        old_root, new_root: roots to compare.
        old_tree, new_tree: trees of the texts that have the roots.
        names: new names of renamed entries.
        in_part: whether the roots are those of a part, whose cell has no single place.
    """

    old: DiffSide
    new: DiffSide
    old_root: Root
    new_root: Root
    old_tree: SignedTree
    new_tree: SignedTree
    names: NewNames
    in_part: bool

    def run(self) -> TreeDifference:
        """Compare both trees."""
        found = TreeDifference()
        a, b = self.old_root.element, self.new_root.element
        pending = [_Match(a, self._top(self.old, a), b, self._top(self.new, b), True)]
        while pending:
            pair = pending.pop()
            a, b = pair.old, pair.new
            if self.old_tree.full[a] == self.new_tree.full[b]:
                continue
            if self.old_tree.plain[a] == self.new_tree.plain[b]:
                found.descriptions += self._count_described(a, b)
                continue
            self._compare(pair, found, pending)
        self._reunite(found)
        return found

    def _top(self, side: DiffSide, root: int) -> ComparedPlace:
        surface = self._tree(side).tree.value("surface", root)
        bounds = (0.0, 0.0, 1.0, 1.0) if self.in_part else side.terrain.bounds
        return ComparedPlace(bounds, None if surface is UNSET else surface, None)

    def _tree(self, side: DiffSide) -> SignedTree:
        return self.old_tree if side is self.old else self.new_tree

    def _count_described(self, a: int, b: int) -> int:
        """Count elements of equal trees whose descriptions differ."""
        count, pending = 0, [(a, b)]
        old, new = self.old_tree, self.new_tree
        while pending:
            a, b = pending.pop()
            if old.full[a] == new.full[b]:
                continue
            count += old.tree.value("descr", a) != new.tree.value("descr", b)
            pending += zip(old.children(a), new.children(b), strict=True)
        return count

    def _compare(self, pair: _Match, found: TreeDifference, pending: list[_Match]) -> None:
        """Compare two matched elements, and match their children."""
        old, new = self.old_tree, self.new_tree
        a, at, b, bt, stays = pair
        keys = list(self._keys(a, at, b, bt))
        shift, resized = (None, []) if stays else self._movement(a, at, b, bt)
        keys = [*resized, *keys]
        matches = self._match(a, at, b, bt)
        pairs, removed, added = matches.pairs, matches.removed, matches.added
        if matches.regrid:
            keys.append(
                KeyChange("cells", _count_pair(old.tree.grid(a)), _count_pair(new.tree.grid(b)))
            )
        if old.tree.value("descr", a) != new.tree.value("descr", b):
            found.descriptions += 1
        if keys or shift is not None:
            kind: ChangeKind = "changed" if keys else "moved"
            found.changes.append(RawChange(kind, a, b, at, bt, shift, tuple(keys)))
        elif not (removed or added or pairs):
            found.written += 1
        for one in removed:
            found.changes.append(RawChange("removed", one.element, -1, one.at, None, None, ()))
        for one in added:
            found.changes.append(RawChange("added", -1, one.element, None, one.at, None, ()))
        for ours, theirs in pairs:
            stays = old.place[ours.element] == new.place[theirs.element] or (
                matches.regrid
                and as_written(old.tree, ours.element) == as_written(new.tree, theirs.element)
            )
            if not stays and old.plain[ours.element] == new.plain[theirs.element]:
                self._add_move(ours, theirs, found)
            if old.full[ours.element] != new.full[theirs.element]:
                moved = stays or old.plain[ours.element] == new.plain[theirs.element]
                pending.append(_Match(ours.element, ours.at, theirs.element, theirs.at, moved))
        found.changes += self._order_changes(pairs)

    def _add_move(self, ours: Sibling, theirs: Sibling, found: TreeDifference) -> None:
        """Record the move of an element that is equal on both sides."""
        shift, resized = self._movement(ours.element, ours.at, theirs.element, theirs.at)
        if shift is None and not resized:
            found.written += 1  # one place, as a cell on one side and as a free place on the other
            return
        kind: ChangeKind = "changed" if resized else "moved"
        found.changes.append(
            RawChange(kind, ours.element, theirs.element, ours.at, theirs.at, shift, tuple(resized))
        )

    def _movement(
        self, a: int, at: ComparedPlace, b: int, bt: ComparedPlace
    ) -> tuple[Pair | None, list[KeyChange]]:
        """Movement of a cell's middle in its parent, and differences of its copies and sides."""
        old, new = self.old_tree, self.new_tree
        keys = []
        repeats = [tree.tree.value("repeat", index) for tree, index in ((old, a), (new, b))]
        texts = [_repeat_text(repeat) for repeat in repeats]
        if texts[0] != texts[1]:
            keys.append(KeyChange("repeat", *texts))
        if self.in_part and not _both_free(old.place[a], new.place[b]):
            places = _place_text(old.tree, a), _place_text(new.tree, b)
            if places[0] != places[1] and round_box(at.bounds) != round_box(bt.bounds):
                keys.append(KeyChange("place", *places))
            return None, keys
        sides = [(box[2] - box[0], box[3] - box[1]) for box in (at.bounds, bt.bounds)]
        scale = max(*sides[0], *sides[1])
        middles = [((box[0] + box[2]) / 2, (box[1] + box[3]) / 2) for box in (at.bounds, bt.bounds)]
        shift = tuple(
            0.0 if abs(n - o) <= 1e-9 * max(scale, abs(n), abs(o)) else n - o
            for o, n in zip(*middles, strict=True)
        )
        if any(abs(n - o) > 1e-9 * scale for o, n in zip(*sides, strict=True)):
            keys.append(KeyChange("extent", *(f"{w:.6g} × {h:.6g}" for w, h in sides)))
        return (shift if any(shift) else None), keys  # type: ignore[return-value]

    def _keys(self, a: int, at: ComparedPlace, b: int, bt: ComparedPlace) -> Iterator[KeyChange]:
        """Differences of two elements themselves, without their children and places."""
        old, new = self.old_tree.tree, self.new_tree.tree
        names = self.names
        for key, attribute, known in (
            ("type", "type", names.primitives), ("part", "part", names.parts)
        ):  # fmt: skip
            was, now = old.value(attribute, a), new.value(attribute, b)
            if known.get(was, was) != now:
                yield KeyChange(key, _text(was), _text(now))
        wears = names.surfaces.get(at.surface, at.surface)
        if wears != bt.surface:
            # a surface that comes from the parent is reported there
            given = old.value("surface", a), new.value("surface", b)
            if given != (UNSET, UNSET):
                around = "that around it"
                yield KeyChange(
                    "surface",
                    *(_text(one if one is not UNSET else place.surface, around)
                      for one, place in zip(given, (at, bt), strict=True)),
                )  # fmt: skip
        classes = old.value("surface_grid", a), new.value("surface_grid", b)
        if class_key(classes[0], names.surfaces) != class_key(classes[1], {}):
            was, now = map(_classes_text, classes)
            now += ", other classes" if was == now else ""
            yield KeyChange("surfaceGrid", was, now)
        for key in STOREYS:
            storeys = old.value(key, a), new.value(key, b)
            if storey_key(storeys[0], names.primitives) != storey_key(storeys[1], {}):
                yield KeyChange(key, *map(_storey_text, storeys))
        yield from self._scales(a, at, b, bt)
        for key, attribute in ("vOffset", "v_offset"), ("turnDeg", "turn_deg"):
            was, now = (
                0.0 if value is UNSET else value
                for value in (old.value(attribute, a), new.value(attribute, b))
            )
            if key == "turnDeg":
                was, now = math.fmod(was, 360.0), math.fmod(now, 360.0)
            if was != now:
                yield KeyChange(key, _number(was), _number(now))
        was, now = old.value("scatter", a), new.value("scatter", b)
        if was != now:
            yield from _scatter_keys(was, now)

    def _scales(self, a: int, at: ComparedPlace, b: int, bt: ComparedPlace) -> Iterator[KeyChange]:
        """Difference of the factor on the curves, or on a part."""
        old, new = self.old_tree.tree, self.new_tree.tree
        given = old.value("v_scale", a), new.value("v_scale", b)
        values, texts = [], []
        for scale, tree, index, side, place in (
            (given[0], old, a, self.old, at), (given[1], new, b, self.new, bt)
        ):  # fmt: skip
            value: float | None = None if scale is UNSET else scale
            text = "" if value is None else _number(value)
            if value is None:
                if tree.value("part", index) is not UNSET:
                    value, text = 1.0, "1"
                elif tree.value("scatter", index) is not UNSET:
                    text = "by default"
                elif not self.in_part:
                    west, south, east, north = place.bounds
                    size = side.terrain.size
                    value = min((east - west) / size[0], (north - south) / size[1])
                    text = f"{value:.6g} by default"
                else:
                    text = "by default"
            values.append(value)
            texts.append(text)
        if given == (UNSET, UNSET) and (None in values or _local_same(at, bt)):
            return
        first, second = values
        if first is None or second is None:
            differs = given[0] is not given[1]
        else:
            by_default = UNSET in given
            differs = abs(first - second) > (1e-12 * abs(first) if by_default else 0.0)
        if differs and not (given == (UNSET, UNSET) and first is None):
            yield KeyChange("vScale", *texts)

    # Matching

    def _siblings(self, side: DiffSide, parent: int, at: ComparedPlace) -> list[Sibling]:
        tree = self._tree(side)
        return [Sibling(child, tree.tree, parent, at) for child in tree.children(parent)]

    def _match(self, a: int, at: ComparedPlace, b: int, bt: ComparedPlace) -> _ChildMatches:
        """Match the children of two elements."""
        old, new, names = self.old_tree, self.new_tree, self.names

        def exact(one: Sibling) -> Hashable:
            return old.place[one.element], old.plain[one.element]

        def new_exact(one: Sibling) -> Hashable:
            return new.place[one.element], new.plain[one.element]

        def text_place(one: Sibling) -> Hashable:
            return as_written(old.tree, one.element), old.plain[one.element]

        def new_text_place(one: Sibling) -> Hashable:
            return as_written(new.tree, one.element), new.plain[one.element]

        def cell(one: Sibling) -> Hashable:
            return within_cell(one.at.bounds, at.bounds)

        def new_cell(one: Sibling) -> Hashable:
            return within_cell(one.at.bounds, bt.bounds)

        def kind(one: Sibling) -> Hashable:
            return old.kind(one.element, names)

        def new_kind(one: Sibling) -> Hashable:
            return new.kind(one.element, _NOTHING)

        def content(one: Sibling) -> Hashable:
            return old.plain[one.element]

        def new_content(one: Sibling) -> Hashable:
            return new.plain[one.element]

        ours, theirs = self._siblings(self.old, a, at), self._siblings(self.new, b, bt)
        regrid = old.tree.grid(a) != new.tree.grid(b) and (
            common(map(text_place, ours), map(new_text_place, theirs))
            > common(map(exact, ours), map(new_exact, theirs))
        )
        matching = Matching(ours, theirs)
        if regrid:
            matching.take(text_place, new_text_place)
        matching.take(exact, new_exact)
        matching.take_moved_alike(content, new_content)
        matching.take(
            lambda one: (cell(one), kind(one)), lambda one: (new_cell(one), new_kind(one))
        )
        matching.take_nearest(content, new_content)
        matching.take(cell, new_cell)
        matching.take(
            lambda one: _description_key(old.tree, one.element, kind(one)),
            lambda one: _description_key(new.tree, one.element, new_kind(one)),
        )
        matching.take_nearest(kind, new_kind, overlapping=True)
        matching.take_only(kind, new_kind)
        return _ChildMatches(matching.pairs, matching.old, matching.new, regrid)

    def _reunite(self, found: TreeDifference) -> None:
        """Turn an equal element removed from one parent and added to another into a moved one."""
        old, new = self.old_tree, self.new_tree
        gone: dict[int, deque[RawChange]] = {}
        for change in found.changes:
            if change.kind == "removed":
                gone.setdefault(old.plain[change.old], deque()).append(change)
        if not gone:
            return
        kept, used = [], set()
        for change in found.changes:
            same = gone.get(new.plain[change.new]) if change.kind == "added" else None
            if not same:
                kept.append(change)
                continue
            was = same.popleft()
            used.add(was.old)
            assert was.old_at is not None and change.new_at is not None
            keys = (
                KeyChange(
                    "parent",
                    self.old.pointer(self.old_root, old.tree.parents[was.old]),
                    self.new.pointer(self.new_root, new.tree.parents[change.new]),
                ),
            )
            shift, resized = self._movement(was.old, was.old_at, change.new, change.new_at)
            kept.append(
                RawChange(
                    "changed" if resized else "moved", was.old, change.new, was.old_at,
                    change.new_at, shift, (*keys, *resized),
                )
            )  # fmt: skip
        found.changes[:] = [c for c in kept if c.kind != "removed" or c.old not in used]

    def _order_changes(self, pairs: Sequence[tuple[Sibling, Sibling]]) -> Iterator[RawChange]:
        """Differences in the order of overlapping siblings: the later has its surface on top."""
        ordered = sorted(pairs, key=lambda pair: pair[0].element)
        ranks = [theirs.element for _, theirs in ordered]
        if all(first < second for first, second in pairwise(ranks)):
            return
        stay = _longest_rising(ranks)
        out = [number for number in range(len(ranks)) if number not in stay]
        if len(out) * len(ranks) > MANY_PAIRS:
            out = out[: MANY_PAIRS // len(ranks)]
        moved = set(out)
        begin_old = min(pair[0].element for pair in pairs)
        begin_new = min(ranks)
        for number in out:
            ours, theirs = ordered[number]
            for other in range(len(ranks)):
                crossed = (other < number) != (ranks[other] < ranks[number])
                if other == number or not crossed or (other in moved and other < number):
                    continue
                if overlap(theirs.at.bounds, ordered[other][1].at.bounds):
                    places = ours.element - begin_old + 1, theirs.element - begin_new + 1
                    key = KeyChange("order", *map(str, places))
                    yield RawChange(
                        "changed", ours.element, theirs.element, ours.at, theirs.at, None, (key,)
                    )
                    break


_NOTHING = NewNames({}, {}, {})


def _local_same(at: ComparedPlace, bt: ComparedPlace) -> bool:
    return round_box(at.bounds) == round_box(bt.bounds)


def _description_key(tree: Tree, index: int, kind: Hashable) -> Hashable:
    descr = tree.value("descr", index)
    return None if descr is UNSET or not descr else (descr, kind)


def _both_free(first: Any, second: Any) -> bool:
    return bool(first[0] == second[0] == "at")


def _longest_rising(numbers: Sequence[int]) -> set[int]:
    """Positions of the longest rising subsequence of different numbers."""
    from bisect import bisect_left

    tails: list[int] = []
    places: list[int] = []
    before: list[int] = []
    for place, number in enumerate(numbers):
        at = bisect_left(tails, number)
        before.append(places[at - 1] if at else -1)
        if at == len(tails):
            tails.append(number)
            places.append(place)
        else:
            tails[at], places[at] = number, place
    found, place = set(), places[-1] if places else -1
    while place >= 0:
        found.add(place)
        place = before[place]
    return found


# Values as text


def _number(value: float) -> str:
    return f"{value:.12g}"


def _text(value: Any, absent: str = "none") -> str:
    return absent if value is UNSET or value is None else str(value)


def _storey_text(storey: Any) -> str:
    """Keys of a deck or a bore and their values; `UNSET` is none."""
    if storey is UNSET:
        return "none"
    given = [(key, getattr(storey, slot.name)) for key, slot in SLOTS[type(storey)].items()]
    words = [
        key if value is True else f"{key} {value if isinstance(value, str) else _number(value)}"
        for key, value in given
        if value is not UNSET and value is not False
    ]
    return ", ".join(words)


def _classes_text(grid: Any) -> str:
    """Raster of classes, and what these stand for; `UNSET` is none."""
    if grid is UNSET:
        return "none"
    band = "" if grid.band_number == 1 else f", band {grid.band_number}"
    return ", ".join([grid.file + band, *(f"{key} {name}" for key, name in grid.names.items())])


def _count_pair(pair: tuple[int, int]) -> str:
    return f"{pair[0]} × {pair[1]}"


def _repeat_text(repeat: Any) -> str:
    if repeat is UNSET:
        return "no copies"
    (nx, ny), (dx, dy) = repeat.count, repeat.step
    return f"{nx} × {ny} by ({dx:.12g}, {dy:.12g})"


def _place_text(tree: Tree, index: int) -> str:
    at = tree.value("at", index)
    if at is not UNSET:
        w, h = pair_of(tree.value("extent", index), 0.0)
        return f"at ({at[0]:.12g}, {at[1]:.12g}), {w:.12g} × {h:.12g}"
    x, y, w, h = tree.block(index)
    nx, ny = tree.grid(tree.parents[index])
    return f"cell {x} {y}, {w} × {h} of {nx} × {ny}"


def _scatter_keys(old: Any, new: Any) -> Iterator[KeyChange]:
    if old is UNSET or new is UNSET:
        texts = ("none" if one is UNSET else "strewn copies" for one in (old, new))
        yield KeyChange("scatter", *texts)
        return
    for name in old.__struct_fields__:
        was, now = getattr(old, name), getattr(new, name)
        if was != now:
            yield KeyChange(f"scatter {name}", _text(was, "by default"), _text(now, "by default"))
