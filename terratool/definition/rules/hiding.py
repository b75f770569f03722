"""Rules on elements whose surface is not visible anywhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.definition.tree import Tree, cover, overlaps
from terratool.text.display import escape, quote

_MANY = 100
"""Most overlapping siblings that are all compared; more would take longer than they help."""


@rule("TT209", "hidden-element", "warning")
def hidden_element(subject: Subject) -> Iterator[Remark]:
    """The surface of an element is hidden all over, by its children or by its siblings.

    Its height still counts, but what it says of soil and colour holds nowhere. An element whose
    surface a child wears, for want of one of its own, is not called hidden. Decks and bores hide
    nothing of what they stand over or are cut through, nor are they hidden by it.

    What is reported is surely hidden, but not all that is hidden is reported. The children of an
    element are looked at by themselves, and so are its siblings: the later ones, and those whose
    children fill their cells. Elements that are radial, or turned by other than half turns, are
    taken to hide nothing. Where more than 100 siblings or children overlap, one of them has to hide
    the element alone.

    Fails:

        {
          "size": 10,
          "surfTypes": {
            "sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18},
            "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0}
          },
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box", "surface": "sand", "cells": [2, 1],
            "children": [{"cellX": 0, "cellY": 0, "span": [2, 1], "type": "box", "surface": "rock"}]
          }
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {
            "sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18},
            "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0}
          },
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {
            "type": "box", "surface": "sand", "cells": [2, 1],
            "children": [{"cellX": 0, "cellY": 0, "type": "box", "surface": "rock"}]
          }
        }

    To mend: leave the surface out, or make room for it.
    """
    tree = subject.tree
    filling = _Filling(subject)
    if not filling.tiled and not subject.shared_cells:
        return
    passed_on = _surface_givers(tree)
    for index in sorted(filling.tiled):
        if tree.column("surface")[index] is not UNSET and index not in passed_on:
            yield _remark(tree, index, "its children")
    sharing = {tree.parents[later] for later, _ in subject.shared_cells}
    for parent, begin, end in tree.families if sharing else ():
        if parent in sharing:
            for index in _hidden_by_siblings(tree, filling, begin, end):
                if index not in passed_on | filling.tiled | subject.storeys:
                    yield _remark(tree, index, "others in its cells")


def _hidden_by_siblings(tree: Tree, filling: _Filling, begin: int, end: int) -> Iterator[int]:
    surfaces = tree.column("surface")
    blocks = [tree.block(index) for index in range(begin, end)]
    alone = {block: index for index, block in enumerate(blocks, begin) if filling.fills(index)}
    for index, block in enumerate(blocks, begin):
        if surfaces[index] is UNSET or block[0] < 0 or _is_copied(tree, index):
            continue
        if alone.get(block, -1) > index:
            yield index
        elif len(blocks) <= _MANY:
            others = [
                blocks[other - begin]
                for other in range(begin, end)
                if other in filling.tiled or (other > index and filling.fills(other))
            ]
            if cover(others, block):
                yield index


def _is_copied(tree: Tree, index: int) -> bool:
    return {tree.value("repeat", index), tree.value("scatter", index)} != {UNSET}


def _remark(tree: Tree, index: int, by: str) -> Remark:
    surface = quote(str(tree.column("surface")[index]))
    return Remark(
        "",
        f"the element's surface {surface} is hidden all over by {by}.",
        'Leave out its "surface", or make room for it.',
        element=index,
    )


def _surface_givers(tree: Tree) -> set[int]:
    """Elements whose surface a child takes over, as it has none of its own."""
    surfaces = tree.column("surface")
    if surfaces.count(UNSET) == 0:
        return set()
    return {tree.parents[index] for index, value in enumerate(surfaces) if value is UNSET}


class _Filling:
    """Elements that fill their cells, and elements whose children fill them together."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._tree = tree = subject.tree
        self._square = {
            name
            for name in tree.distinct("type") - {UNSET}
            if name in subject.primitives
            and subject.primitives[name].combine != "radial"
            and not subject.left_out(f"/elemTypes/{escape(name)}", "combine")
        }
        self.tiled: set[int] = set()
        spans = tree.distinct("span") != {UNSET}
        for index, begin, end in reversed(tree.families):  # children before parents
            columns, rows = tree.grid(index)
            many = spans or end - begin >= columns * rows
            if (
                many
                and index not in subject.storeys
                and self._tiles(range(begin, end), columns, rows)
            ):
                self.tiled.add(index)

    @cached_property
    def _plain(self) -> bool:
        """Whether all elements fill their cells."""
        return (
            not self._subject.unfit
            and not self._subject.storeys
            and self._tree.distinct("type") <= self._square
            and self._tree.distinct("scatter") == {UNSET}
            and all(turn is UNSET or turn % 180 == 0 for turn in self._tree.column("turn_deg"))
        )

    def fills(self, index: int) -> bool:
        """Whether the footprint of an element certainly fills its cell."""
        if self._plain:
            return True
        turn = self._tree.column("turn_deg")[index]
        return (
            self._tree.column("type")[index] in self._square
            and (turn is UNSET or turn % 180 == 0)
            and self._tree.value("scatter", index) is UNSET
            and index not in self._subject.storeys
            and not self._subject.left_out(index, "turnDeg")
        )

    def _tiles(self, children: Sequence[int], columns: int, rows: int) -> bool:
        blocks = [self._tree.block(i) for i in children if i in self.tiled or self.fills(i)]
        if self._tree.distinct("at") != {UNSET}:
            blocks = [block for block in blocks if block[0] >= 0]
        if sum(width * height for _, _, width, height in blocks) < columns * rows:
            return False
        if any(
            x < 0 or y < 0 or x + width > columns or y + height > rows
            for x, y, width, height in blocks
        ):
            return False  # elements outside of the grid hide nothing, and an error tells of them
        if not overlaps(blocks):
            return True  # without overlaps, areas that sum up to the grid fill it
        return len(blocks) <= _MANY and cover(blocks, (0, 0, columns, rows))
