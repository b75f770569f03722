"""Rules on elements at free places, and on copies in rows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import Pair, pair_of
from terratool.definition.part_sizes import Alike, PartSize
from terratool.definition.rules.base import Subject, rule
from terratool.definition.tree import Tree
from terratool.definition.turning import CLOSE, turned_shape
from terratool.definition.uses import Box, Root, box_of_copies, copies
from terratool.report.numbers import located
from terratool.text.display import quote

_CELL_KEYS = {"cellX": "cell_x", "cellY": "cell_y", "span": "span"}


@rule("TT711", "mixed-place")
def mixed_place(subject: Subject) -> Iterator[Remark]:
    """An element has at without extent, extent without at, or a cell beside them.

    An element stands in a cell of its parent's grid, by cellX, cellY and span, or at a free place,
    by at and extent.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"at": [3, 4], "type": "box"}]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"at": [3, 4], "extent": 2, "type": "box"}]}
        }

    To mend: write both at and extent, and no cell.
    """
    tree = subject.tree
    if tree.distinct("at") | tree.distinct("extent") == {UNSET}:
        return
    first = len(tree.roots)
    pairs = list(zip(tree.column("at"), tree.column("extent"), strict=True))
    for index, (at, extent) in enumerate(pairs[first:], first):
        if at is UNSET and extent is UNSET:
            continue
        for key, value in (("at", at), ("extent", extent)):
            if value is UNSET and not subject.left_out(index, key):
                other = "extent" if key == "at" else "at"
                yield Remark(
                    "", f'the element has "{other}", but no "{key}".', f'Add "{key}".',
                    element=index,
                )  # fmt: skip
        for key, name in _CELL_KEYS.items():
            if tree.value(name, index) is not UNSET:
                yield Remark(
                    f"/{key}",
                    f'the element stands at a free place, and has "{key}" beside it.',
                    f'Remove "{key}", or "at" and "extent".',
                    on_key=True,
                    element=index,
                )


@rule("TT712", "turned-parent")
def turned_parent(subject: Subject) -> Iterator[Remark]:
    """An element at a free place has children, but is turned by no multiple of 90 degrees.

    It is turned whole, and grids stay aligned with the axes. The same holds for the root of a part
    that stands at a free place.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [3, 4], "extent": 2, "type": "box", "turnDeg": 30, "children": [
              {"cellX": 0, "cellY": 0, "type": "box"}
            ]}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [3, 4], "extent": 2, "type": "box", "turnDeg": 90, "children": [
              {"cellX": 0, "cellY": 0, "type": "box"}
            ]}
          ]}
        }

    To mend: turn it by a multiple of 90, or place the children beside it.
    """
    tree = subject.tree
    if tree.distinct("at") | tree.distinct("scatter") == {UNSET}:
        return
    places, scatters, turns = (tree.column(key) for key in ("at", "scatter", "turn_deg"))
    for parent, _, _ in tree.families:
        turn = turns[parent]
        free = places[parent] is not UNSET or scatters[parent] is not UNSET
        if free and turn is not UNSET and turn % 90 != 0:
            yield Remark(
                "/turnDeg",
                f"the element has children, and is turned by {quote(turn)} degrees, "
                "which is no multiple of 90.",
                "Turn it by 0, 90, 180 or 270, or place the children beside it.",
                element=parent,
            )
    for index, name in tree.elements_with("part", subject.uses.known_parts):
        end = subject.uses.end(Root(tree, index, subject.document))
        free = places[index] is not UNSET or scatters[index] is not UNSET
        if not free or end is None or end.turn % 90 == 0:
            continue
        begin, after = end.root.tree.brood(end.root.element)
        if begin < after:
            yield Remark(
                "/part",
                f"the root of the part {quote(name)} has children, and is turned by "
                f"{quote(end.turn)} degrees, which is no multiple of 90.",
                "Put the part into a cell, or place the children beside its root.",
                element=index,
            )


@rule("TT713", "outside-cell")
def outside_cell(subject: Subject) -> Iterator[Remark]:
    """The footprint of an element at a free place is not in its parent's cell, or a copy's is not.

    What is turned is turned whole, so its corners reach further than its sides. Places and extents
    in a part are in units of the terrain, too, and do not grow with the cell that the part stands
    in: each size that it stands in is looked at.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"at": [9.5, 4], "extent": 2, "type": "box"}]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{"at": [8.5, 4], "extent": 2, "type": "box"}]}
        }

    To mend: move the element, make it smaller, or make it a child of the element around both.
    """
    if subject.place_sizes is None:
        return
    told: set[int] = set()
    seen: set[PartSize] = set()
    crowds: dict[int, _Crowd] = {}
    for alike in subject.place_sizes.alike():
        crowd = crowds.get(id(alike.elements))
        if crowd is None:
            crowd = crowds[id(alike.elements)] = _Crowd(subject, alike)
        size, parent = alike.size, alike.sides.lengths
        cell = f"the parent's cell of {parent[0]:.9g} × {parent[1]:.9g}"
        if alike.root.tree is subject.tree:
            inside = f", where the part {quote(size.part)} stands." if size.part else "."
            for element, beyond in crowd.taken_beyond(parent):
                what = f"the element's copy {beyond.copy}" if beyond.copy else "the element"
                yield Remark(
                    "/at",
                    f"{what} reaches {beyond.over(parent)} of {cell}{inside}",
                    "Move it inside, or make it smaller.",
                    element=element,
                )
            continue
        for place, beyond in islice(crowd.beyond(parent), 1):
            pointer = f"{alike.root.tree.pointer(place)}{beyond.copy}"
            for element in subject.place_sizes.elements_leading_to(size, seen):
                if element not in told:
                    told.add(element)
                    yield Remark(
                        "/part",
                        f"{pointer} of the part {quote(size.part)} reaches "
                        f"{beyond.over(parent)} of {cell}.",
                        "Give the part more room, or use a smaller one.",
                        element=element,
                    )


class _Excess(NamedTuple):
    """Longest excess of an element, or of one of its copies, beyond a cell.

    Attributes:
        length: how far it reaches, in units of the terrain.
        side: side of the cell, such as "east".
        copy: column and row of the copy that reaches so far, such as "[2,0]"; empty for no copies.
    """

    length: float
    side: str
    copy: str = ""

    def over(self, parent: Pair) -> str:
        """Words for the excess beyond a cell with these sides: "1.5 beyond the east side"."""
        return f"{located([self.length], min(parent) / 1e3)} beyond the {self.side} side"


class _Crowd:
    """Footprints of elements at free places in cells of one size, their copies included."""

    def __init__(self, subject: Subject, alike: Alike) -> None:
        self._tree = alike.root.tree
        self._boxes = {}
        for element in alike.elements:
            box = _box(subject, alike.root.tree, element)
            if box is not None:
                self._boxes[element] = box
        self._surround()

    def _surround(self) -> None:
        """Set the box around all footprints: no box reaches further than this one."""
        boxes = self._boxes.values()
        lows, highs = zip(*boxes, strict=True) if boxes else (((0.0, 0.0),), ((0.0, 0.0),))
        self._whole = tuple(map(min, *lows, lows[0])), tuple(map(max, *highs, highs[0]))

    def beyond(self, parent: Pair) -> Iterator[tuple[int, _Excess]]:
        """Elements that reach out of a parent's cell with these sides, each with its excess."""
        if _out(self._whole, parent):
            for element, box in self._boxes.items():
                if out := _out(box, parent):
                    copy = _copy_at(out.side, self._tree.value("repeat", element))
                    yield element, out._replace(copy=copy)

    def taken_beyond(self, parent: Pair) -> list[tuple[int, _Excess]]:
        """Elements that reach out of the cell, as `beyond`; they are removed from the crowd."""
        found = list(self.beyond(parent))
        for element, _ in found:
            del self._boxes[element]
        if found:
            self._surround()
        return found


def _out(box: Box, parent: Pair) -> _Excess | None:
    """Longest excess of a box beyond a cell that begins at 0; None for a box within the cell."""
    (west, south), (east, north) = box
    sides = (
        (-west, "west", parent[0]), (east - parent[0], "east", parent[0]),
        (-south, "south", parent[1]), (north - parent[1], "north", parent[1]),
    )  # fmt: skip
    out = [_Excess(excess, side) for excess, side, length in sides if excess > CLOSE * length]
    return max(out, default=None)


def _copy_at(side: str, repeat: Any) -> str:
    """Column and row of the copy that reaches furthest to a side; empty where there are no copies.

    Args:
        side: side of the parent's cell, such as "east".
        repeat: `repeat` of the element; `UNSET` for none.
    """
    if copies(repeat) == 1:
        return ""
    axis = 0 if side in ("west", "east") else 1
    forward = repeat.step[axis] > 0.0 if side in ("east", "north") else repeat.step[axis] < 0.0
    place = [0, 0]
    place[axis] = repeat.count[axis] - 1 if forward else 0
    return f"[{place[0]},{place[1]}]"


def _box(subject: Subject, tree: Tree, index: int) -> Box | None:
    """Box around the footprints of an element and its copies; None if they are not known."""
    at, extent, repeat = (tree.value(key, index) for key in ("at", "extent", "repeat"))
    if extent is UNSET or (tree is subject.tree and subject.left_out(index, "repeat", "turnDeg")):
        return None
    end = subject.uses.end(Root(tree, index, subject.document))
    if end is None:
        return None
    primitive = subject.primitives.get(end.root.tree.value("type", end.root.element))
    scattered = tree.value("scatter", index) is not UNSET  # copies stay in the element's cell
    round_ = primitive is not None and primitive.combine == "radial"
    reach = turned_shape(pair_of(extent, math.nan), 0.0 if scattered else end.turn, round_).reach
    return box_of_copies(at, reach, repeat)


@rule("TT714", "copies-outside")
def copies_outside(subject: Subject) -> Iterator[Remark]:
    """A copy of an element would not be in the parent's grid, or between its cells.

    The step of an element in a cell is in whole cells; that of an element at a free place is in
    units of the terrain.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 0, "cellY": 0, "repeat": {"count": [4, 1], "step": [3.5, 0]}, "type": "box"}
          ]}
        }

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 0, "cellY": 0, "repeat": {"count": [5, 1], "step": [3, 0]}, "type": "box"}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 0, "cellY": 0, "repeat": {"count": [4, 1], "step": [3, 0]}, "type": "box"}
          ]}
        }

    To mend: lower the count or the step, or begin further back.
    """
    tree = subject.tree
    if tree.distinct("repeat") == {UNSET}:
        return
    for index, repeat in enumerate(tree.column("repeat")):
        parent = tree.parents[index]
        if repeat is UNSET or parent < 0 or tree.value("at", index) is not UNSET:
            continue
        if subject.left_out(index, "cellX", "cellY", "span", "at"):
            continue
        block = tree.block(index)
        if min(block) < 0:
            continue
        for axis, what in enumerate(("columns", "rows")):
            step, count, cells = repeat.step[axis], repeat.count[axis], tree.grid(parent)[axis]
            if count == 1:
                continue
            if step != int(step) if abs(step) < 1e9 else True:
                yield Remark(
                    f"/repeat/step/{axis}",
                    f"a step of {quote(step)} leads between the cells.",
                    "Write a whole number, or place the element by at and extent.",
                    element=index,
                )
                continue
            if subject.left_out(parent, "cells"):
                continue
            last = block[axis] + int(step) * (count - 1)
            if last < 0 or last + block[axis + 2] > cells:
                yield Remark(
                    f"/repeat/count/{axis}",
                    f"the last copy begins in cell {last}, but the parent has {cells} {what}.",
                    "Lower the count or the step, or give the parent more cells.",
                    element=index,
                )


@rule("TT719", "overlapping-copies", "warning")
def overlapping_copies(subject: Subject) -> Iterator[Remark]:
    """Copies of an element overlap one another.

    Their heights add up where they do. That can be meant; it can also be a step that is too short.
    Neighbours in a row are looked at, but not those of an element at a free place that is turned by
    no multiple of 90.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [2, 2], "extent": 2, "repeat": {"count": [3, 1], "step": [1, 0]}, "type": "box"}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"at": [2, 2], "extent": 2, "repeat": {"count": [3, 1], "step": [2, 0]}, "type": "box"}
          ]}
        }

    To mend: make the step as long as the element, or longer. Where it is meant, silence TT719 by
    x-ignore.
    """
    tree = subject.tree
    if tree.distinct("repeat") == {UNSET}:
        return
    for index, repeat in enumerate(tree.column("repeat")):
        if copies(repeat) == 1 or tree.parents[index] < 0:
            continue
        if tree.value("at", index) is UNSET:
            sides: Pair = tree.block(index)[2:]
        else:
            turn = tree.value("turn_deg", index)
            turn = 0.0 if turn is UNSET else turn
            if turn % 90 != 0:
                continue
            reach = turned_shape(pair_of(tree.value("extent", index), math.nan), turn, False).reach
            sides = 2 * reach[0], 2 * reach[1]
        # neighbours in a row are moved along one axis alone
        for axis in (0, 1):
            step = abs(repeat.step[axis])
            if repeat.count[axis] > 1 and step < sides[axis] * (1 - CLOSE):
                yield Remark(
                    "/repeat/step",
                    f"the copies are {sides[axis]:.6g} long and {step:.6g} apart, and overlap.",
                    "Make the step as long as the element, or longer.",
                    element=index,
                )
                break
