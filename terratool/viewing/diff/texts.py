"""Comparison of two texts: entries, parts, elements and tracks, matched and named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from msgspec import UNSET

from terratool.definition.findings import Bounds
from terratool.definition.model import DEFAULT_MULTIPASS, Track, names_of
from terratool.definition.tree import Tree
from terratool.definition.uses import Root
from terratool.report.wording import count_of
from terratool.text.locate import Address, locate
from terratool.text.numbers import parse_whole
from terratool.viewing.diff.elements import RawChange, TreeComparison, TreeDifference
from terratool.viewing.diff.entries import (
    EntryDifference,
    compare_entries,
    part_entry,
    value_text,
)
from terratool.viewing.diff.places import ComparedPlace
from terratool.viewing.diff.regions import track_reach
from terratool.viewing.diff.results import ElementChange, ElementPlace, EntryChange, KeyChange
from terratool.viewing.diff.sides import DiffSide, find_renames
from terratool.viewing.diff.signed import Interner, NewNames, SignedTree

MOST_PLACED = 10_000
"""Most elements whose lines are looked up; the others have line 0."""


@dataclass(frozen=True, slots=True)
class TextDifference:
    """Differences between two texts.

    Attributes:
        entries: differences in surfaces and primitives.
        parts: parts that differ.
        elements: elements that differ, first those of the terrain itself.
        raw: elements of the terrain itself that differ, by their indices.
        dirty: old and new name of each part whose elements differ.
        tracks: tracks that differ.
        notes: sentences on differences that leave the ground equal.
    """

    entries: EntryDifference
    parts: tuple[EntryChange, ...] = ()
    elements: tuple[ElementChange, ...] = ()
    raw: tuple[RawChange, ...] = ()
    dirty: tuple[tuple[str, str], ...] = ()
    tracks: tuple[ElementChange, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nothing differs that could change the terrain."""
        return not (self.entries.changes or self.parts or self.elements or self.tracks)

    @property
    def places(self) -> int:
        """Number of entries, parts, elements and tracks that differ."""
        found = self.entries.changes, self.parts, self.elements, self.tracks
        return sum(map(len, found))


def compare_texts(old: DiffSide, new: DiffSide) -> TextDifference:
    """Compare the texts of two definitions."""
    entries = compare_entries(old, new)
    names = entries.names
    signed = _SignedTrees(old, new, names)
    parts = signed.renamed_parts()
    if parts:
        names = NewNames(names.surfaces, names.primitives, parts)
        signed = _SignedTrees(old, new, names)
    notes = list(entries.notes)
    notes += (f"The part {was} is called {now} now; it is the same." for was, now in parts.items())
    changes, elements, dirty, descriptions = [], [], [], 0
    found = _compare_trees(old, new, "", "", signed, names)
    raw = tuple(found.changes)
    descriptions += found.descriptions
    elements += _element_changes(found.changes, old, new, "", "")
    for was in old.parts:
        now = parts.get(was, was)
        if now not in new.parts:
            changes.append(part_entry("removed", was, old))
            continue
        found = _compare_trees(old, new, was, now, signed, names)
        descriptions += found.descriptions
        if found.changes:
            dirty.append((was, now))
            changes.append(part_entry("changed", now, new))
            elements += _element_changes(found.changes, old, new, was, now)
    known = {parts.get(was, was) for was in old.parts}
    changes += (part_entry("added", now, new) for now in new.parts if now not in known)
    if descriptions:
        verb = "is" if descriptions == 1 else "are"
        notes.append(f"{count_of(descriptions, 'element')} {verb} described otherwise.")
    if old.terrain.descr != new.terrain.descr:
        notes.append("The terrain is described otherwise.")
    return TextDifference(
        entries, tuple(changes), tuple(elements), raw, tuple(dirty),
        tuple(_tracks(old, new, names)), tuple(notes),
    )  # fmt: skip


class _SignedTrees:
    """Signed trees of both sides, each made once."""

    def __init__(self, old: DiffSide, new: DiffSide, names: NewNames) -> None:
        self._names = names
        self._interner = Interner()
        self._known: dict[int, SignedTree] = {}
        self._old, self._new = old, new

    def of(self, side: DiffSide, tree: Tree) -> SignedTree:
        """Signed tree of a tree of one side."""
        if id(tree) not in self._known:
            names = self._names if side is self._old else NewNames({}, {}, {})
            self._known[id(tree)] = SignedTree(tree, names, self._interner)
        return self._known[id(tree)]

    def renamed_parts(self) -> dict[str, str]:
        """New names of renamed parts, by their old names."""
        old, new = (
            {
                name: self.of(side, root.tree).plain[root.element]
                for name, root in side.parts.items()
            }
            for side in (self._old, self._new)
        )
        return find_renames(old, new)


def _root(side: DiffSide, part: str) -> Root:
    return side.parts[part] if part else side.uses.root


def _compare_trees(
    old: DiffSide, new: DiffSide, was: str, now: str, signed: _SignedTrees, names: NewNames
) -> TreeDifference:
    """Differences in the terrain, or in the part `was`, `now` where these are not empty."""
    first, second = _root(old, was), _root(new, now)
    trees = signed.of(old, first.tree), signed.of(new, second.tree)
    return TreeComparison(old, new, first, second, *trees, names, bool(now)).run()


def _element_changes(
    changes: Sequence[RawChange], old: DiffSide, new: DiffSide, was: str, now: str
) -> list[ElementChange]:
    """Differences with JSON pointers in place of indices, in the order of the text."""
    first, second = _root(old, was), _root(new, now)
    places: list[dict[int, ElementPlace]] = []
    for side, root, indices, spots in (
        (old, first, [c.old for c in changes], [c.old_at for c in changes]),
        (new, second, [c.new for c in changes], [c.new_at for c in changes]),
    ):
        there = [(i, at) for i, at in zip(indices, spots, strict=True) if at is not None]
        places.append(_places(side, root, there, bool(now)))
    found = []
    for change in changes:
        tree, index = (second.tree, change.new) if change.new >= 0 else (first.tree, change.old)
        told = ElementChange(
            kind=change.kind,
            what=_what(tree, index),
            descr=_descr(tree, index),
            old=places[0].get(change.old),
            new=places[1].get(change.new),
            shift=change.shift,
            keys=change.keys,
            elements=_count(tree, index),
            part=now,
        )
        found.append((_order(tree.pointer(index)), told))
    found.sort(key=lambda one: one[0])
    return [told for _, told in found]


def _places(
    side: DiffSide, root: Root, there: Sequence[tuple[int, ComparedPlace]], in_part: bool
) -> dict[int, ElementPlace]:
    pointers = {index: root.tree.pointer(index) for index, _ in there}
    looked = list(pointers)[:MOST_PLACED]
    source = root.home.source
    found = locate(source.data, [Address(pointers[index]) for index in looked]) if looked else []
    lines = {index: place.line for index, place in zip(looked, found, strict=True)}
    return {
        index: ElementPlace(
            side.pointer(root, index), source.name, lines.get(index, 0),
            None if in_part else at.bounds,
        )
        for index, at in there
    }  # fmt: skip


def _what(tree: Tree, index: int) -> str:
    part = tree.value("part", index)
    return str(tree.value("type", index)) if part is UNSET else f"part {part}"


def _descr(tree: Tree, index: int) -> str:
    descr = tree.value("descr", index)
    return "" if descr is UNSET else str(descr)


def _count(tree: Tree, index: int) -> int:
    count, pending = 0, [index]
    while pending:
        count += 1
        pending += range(*tree.brood(pending.pop()))
    return count


def _order(pointer: str) -> tuple[int, ...]:
    numbers = map(parse_whole, pointer.split("/"))
    return tuple(number for number in numbers if number is not None)


# Tracks


def _tracks(old: DiffSide, new: DiffSide, names: NewNames) -> Iterator[ElementChange]:
    """Differences of tracks, which are matched as a whole, then by their paths."""
    ours = {number: _track(track, names) for number, track in enumerate(old.definition.ruts)}
    theirs = {number: _track(track, None) for number, track in enumerate(new.definition.ruts)}
    for key in _whole, _path:
        waiting: dict[str, list[int]] = {}
        for number, track in ours.items():
            waiting.setdefault(key(track), []).append(number)
        for number, track in list(theirs.items()):
            same = waiting.get(key(track))
            if not same:
                continue
            at = same.pop(0)
            before = ours.pop(at)
            del theirs[number]
            changes = tuple(
                KeyChange(name, value_text(before[name]), value_text(track[name]))
                for name in track
                if before[name] != track[name]
            )
            if changes:
                box = track_reach(new.definition.ruts[number])
                was, now = _track_place(old, at, box), _track_place(new, number, box)
                yield ElementChange("changed", "track", "", was, now, None, changes)
    for number in ours:
        box = track_reach(old.definition.ruts[number])
        yield ElementChange("removed", "track", "", _track_place(old, number, box), None)
    for number in theirs:
        box = track_reach(new.definition.ruts[number])
        yield ElementChange("added", "track", "", None, _track_place(new, number, box))


def _whole(track: dict[str, Any]) -> str:
    return repr(track)


def _path(track: dict[str, Any]) -> str:
    return repr(track["path"])


def _track(track: Track, names: NewNames | None) -> dict[str, Any]:
    """Values of a track by key, without its description, in new names and with defaults."""
    known = names.surfaces if names else {}
    found = {key: getattr(track, name) for name, key in names_of(Track) if name != "descr"}
    found["passes"] = 1 if track.passes is UNSET else track.passes
    found["multipass"] = DEFAULT_MULTIPASS if track.multipass is UNSET else track.multipass
    found["surface"] = known.get(track.surface, track.surface)  # type: ignore[arg-type]
    if isinstance(track.depth, dict):
        found["depth"] = {known.get(name, name): depth for name, depth in track.depth.items()}
    return found


def _track_place(side: DiffSide, number: int, box: Bounds) -> ElementPlace:
    pointer, source = f"/tracks/{number}", side.document.source
    (found,) = locate(source.data, [Address(pointer)])
    return ElementPlace(pointer, source.name, found.line, box)
