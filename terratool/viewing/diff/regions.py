"""Where ground can differ: world rectangles of what differs; all else need not be looked at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec import UNSET

from terratool.definition.findings import Bounds
from terratool.definition.model import Track
from terratool.definition.uses import elements_of
from terratool.viewing.diff.elements import RawChange
from terratool.viewing.diff.places import Placed, placed_child, reach_of
from terratool.viewing.diff.sides import Side

MOST_ELEMENTS = 300_000
"""Of a text with more elements all ground is looked at where an entry differs."""


def reaches(changes: Sequence[RawChange], old: Side, new: Side) -> Iterator[Bounds]:
    """The rectangles that elements which differ had, and have."""
    for change in changes:
        if change.old_at is not None:
            yield reach_of(old.uses.root.tree, change.old, change.old_at)
        if change.new_at is not None:
            yield reach_of(new.uses.root.tree, change.new, change.new_at)


def users(
    side: Side, surfaces: set[str], primitives: set[str], parts: set[str]
) -> Iterator[Bounds] | None:
    """The rectangles of elements that have any of these, directly or in their parts.

    None for the whole terrain.
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
                or tree.value("type", index) in primitives
                or tree.value("surface", index) in surfaces
                for index in elements_of(root)
            ):
                parts.add(name)
                grows = True
    tree = side.uses.root.tree
    wanted = (("surface", surfaces), ("type", primitives), ("part", parts))
    if not any(tree.distinct(key) & names for key, names in wanted):
        return iter(())
    if side.uses.root.element != 0 or len(tree) > MOST_ELEMENTS:
        return None
    return _users(side, wanted)


def _users(side: Side, wanted: Sequence[tuple[str, set[str]]]) -> Iterator[Bounds]:
    tree = side.uses.root.tree
    pending = [(0, Placed(side.terrain.bounds, None, None))]
    while pending:
        index, at = pending.pop()
        if any(tree.value(key, index) in names for key, names in wanted):
            yield reach_of(tree, index, at)
            continue  # what is in it lies in its cell
        pending += (
            (child, placed_child(tree, child, index, at)) for child in range(*tree.brood(index))
        )


def track_reach(track: Track) -> Bounds:
    """The rectangle around a track."""
    reach = 0.5 * (0.0 if track.width is UNSET else track.width)
    x, y = zip(*track.points, strict=True)
    return min(x) - reach, min(y) - reach, max(x) + reach, max(y) + reach


def hull(rectangles: Sequence[Bounds], within: Bounds) -> Bounds | None:
    """The rectangle around several, as far as it lies within another; None where none does."""
    cut = [box for box in (clipped(one, within) for one in rectangles) if box is not None]
    if not cut:
        return None
    return (
        min(box[0] for box in cut), min(box[1] for box in cut),
        max(box[2] for box in cut), max(box[3] for box in cut),
    )  # fmt: skip


def clipped(box: Bounds, within: Bounds) -> Bounds | None:
    """What of a rectangle lies within another; None where nothing does."""
    west, south = max(box[0], within[0]), max(box[1], within[1])
    east, north = min(box[2], within[2]), min(box[3], within[3])
    return (west, south, east, north) if west < east and south < north else None
