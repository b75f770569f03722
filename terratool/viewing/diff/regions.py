"""World rectangles in which the ground can differ; no other ground need be compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec import UNSET

from terratool.definition.findings import Bounds
from terratool.definition.model import Track
from terratool.definition.uses import elements_of
from terratool.viewing.diff.elements import RawChange
from terratool.viewing.diff.places import ComparedPlace, child_place, reach_of
from terratool.viewing.diff.sides import DiffSide

MOST_ELEMENTS = 300_000
"""Most elements of a text that is searched for users of an entry; else all ground is compared."""


def reaches(changes: Sequence[RawChange], old: DiffSide, new: DiffSide) -> Iterator[Bounds]:
    """World rectangles of the elements that differ, old and new."""
    for change in changes:
        if change.old_at is not None:
            yield reach_of(old.uses.root.tree, change.old, change.old_at)
        if change.new_at is not None:
            yield reach_of(new.uses.root.tree, change.new, change.new_at)


def users(
    side: DiffSide, surfaces: set[str], primitives: set[str], parts: set[str]
) -> Iterator[Bounds] | None:
    """World rectangles of elements that use any of these names, directly or in their parts.

    None stands for the whole terrain.
    """
    parts = set(parts)
    trees = [(name, root) for name, root in side.roots() if name]
    grows = True
    while grows:
        grows = False
        for name, root in trees:
            if name in parts:
                continue
            tree = root.tree
            if any(
                tree.value("part", index) in parts
                or tree.has_shape(index, primitives)
                or tree.wears(index, surfaces)
                for index in elements_of(root)
            ):
                parts.add(name)
                grows = True
    tree = side.uses.root.tree
    known = (tree.worn, surfaces), (tree.shapes, primitives), (tree.distinct("part"), parts)
    if not any(used & names for used, names in known):
        return iter(())
    if side.uses.root.element != 0 or len(tree) > MOST_ELEMENTS:
        return None
    return _users(side, surfaces, primitives, parts)


def _users(
    side: DiffSide, surfaces: set[str], primitives: set[str], parts: set[str]
) -> Iterator[Bounds]:
    tree = side.uses.root.tree
    pending = [(0, ComparedPlace(side.terrain.bounds, None, None))]
    while pending:
        index, at = pending.pop()
        named = tree.has_shape(index, primitives) or tree.value("part", index) in parts
        if named or tree.wears(index, surfaces):
            yield reach_of(tree, index, at)
            continue  # its children lie in its rectangle
        pending += (
            (child, child_place(tree, child, index, at)) for child in range(*tree.brood(index))
        )


def track_reach(track: Track) -> Bounds:
    """World rectangle around a track, half its width included."""
    reach = 0.5 * (0.0 if track.width is UNSET else track.width)
    x, y = zip(*track.points, strict=True)
    return min(x) - reach, min(y) - reach, max(x) + reach, max(y) + reach


def hull(rectangles: Sequence[Bounds], within: Bounds) -> Bounds | None:
    """Rectangle around the parts of several that lie within another; None if none does."""
    cut = [box for box in (intersection(one, within) for one in rectangles) if box is not None]
    if not cut:
        return None
    return (
        min(box[0] for box in cut), min(box[1] for box in cut),
        max(box[2] for box in cut), max(box[3] for box in cut),
    )  # fmt: skip


def intersection(box: Bounds, within: Bounds) -> Bounds | None:
    """Intersection of two rectangles; None if it has no area."""
    west, south = max(box[0], within[0]), max(box[1], within[1])
    east, north = min(box[2], within[2]), min(box[3], within[3])
    return (west, south, east, north) if west < east and south < north else None
