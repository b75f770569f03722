"""Elements at free places, and copies."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import UNSET, UnsetType

from terratool.definition.findings import Remark
from terratool.definition.model import Pair, pair_of
from terratool.definition.rules.base import Subject, rule
from terratool.definition.uses import MAX_SIZES, SizedElement, copies
from terratool.text.display import shown

_CLOSE = 1e-9
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

    It is turned whole, and grids stay aligned with the axes.

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
    if tree.distinct("at") == {UNSET}:
        return
    places, turns = tree.column("at"), tree.column("turn_deg")
    for parent, _, _ in tree.families:
        turn = turns[parent]
        if places[parent] is not UNSET and turn is not UNSET and turn % 90 != 0:
            yield Remark(
                "/turnDeg",
                f"the element has children, and is turned by {shown(turn)} degrees, "
                "which is no multiple of 90.",
                "Turn it by 0, 90, 180 or 270, or place the children beside it.",
                element=parent,
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
    if subject.is_library or subject.definition.size is UNSET:
        return
    told: set[int] = set()
    for sized in subject.uses.free_places():
        if sized is None:
            yield Remark(
                "",
                f"parts with free places stand in more than {MAX_SIZES:,} sizes.",
                "Give the part the same size in more places.",
            )
            return
        at = sized.tree.value("at", sized.element)
        beyond = _beyond(subject, sized, at)
        if not beyond:
            continue
        w, h = sized.parent
        message = f"reaches {beyond:.6g} beyond the parent's cell of {w:.9g} × {h:.9g}."
        if sized.tree is not subject.tree:
            place = f"{sized.tree.pointer(sized.element)} of the part {shown(sized.part)}"
            for use in subject.uses.leading_to(sized.part):
                if use.element not in told:
                    told.add(use.element)
                    hint = "Give the part more room, or use a smaller one."
                    yield Remark("/part", f"{place} {message}", hint, element=use.element)
        elif sized.element not in told:
            told.add(sized.element)
            inside = f", where the part {shown(sized.part)} stands" if sized.part else ""
            yield Remark(
                "/at",
                f"the element {message[:-1]}{inside}.",
                "Move it inside, or make it smaller.",
                element=sized.element,
            )


def _beyond(subject: Subject, sized: SizedElement, at: Pair) -> float:
    """How far the footprints of an element and of its copies reach out of the parent's cell."""
    tree, index = sized.tree, sized.element
    extent, repeat = tree.value("extent", index), tree.value("repeat", index)
    if extent is UNSET or (tree is subject.tree and subject.left_out(index, "repeat", "turnDeg")):
        return 0.0
    primitive = subject.primitives.get(tree.value("type", index))
    round_ = primitive is not None and primitive.combine == "radial"
    reach = _reach(pair_of(extent, math.nan), tree.value("turn_deg", index), round_)
    count, step = ((1, 1), (0.0, 0.0)) if repeat is UNSET else (repeat.count, repeat.step)
    beyond = 0.0
    for axis in (0, 1):
        ends = at[axis], at[axis] + (count[axis] - 1) * step[axis]
        low, high = min(ends) - reach[axis], max(ends) + reach[axis]
        out = max(-low, high - sized.parent[axis])
        if out > _CLOSE * sized.parent[axis]:
            beyond = max(beyond, out)
    return beyond


def _reach(extent: Pair, turn: float | UnsetType, is_round: bool) -> Pair:
    """Half the sides of the box around a turned rectangle or ellipse."""
    w, h = extent[0] / 2, extent[1] / 2
    if turn is UNSET or turn % 180 == 0:
        return w, h
    if turn % 90 == 0:
        return h, w
    angle = math.radians(math.fmod(turn, 360.0))
    cosine, sine = abs(math.cos(angle)), abs(math.sin(angle))
    add = math.hypot if is_round else float.__add__
    return add(w * cosine, h * sine), add(w * sine, h * cosine)


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
            if step != int(step) if abs(step) < 1e9 else True:
                yield Remark(
                    f"/repeat/step/{axis}",
                    f"a step of {shown(step)} leads between the cells.",
                    "Write a whole number, or place the element by at and extent.",
                    element=index,
                )
                continue
            if subject.left_out(parent, "cells"):
                continue
            last = block[axis] + int(step) * (count - 1)
            if count > 1 and (last < 0 or last + block[axis + 2] > cells):
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
            primitive = subject.primitives.get(tree.value("type", index))
            if primitive is not None and primitive.combine == "radial":
                continue  # discs may lie closer than their boxes
            turn = tree.value("turn_deg", index)
            if turn is not UNSET and turn % 90 != 0:
                continue
            reach = _reach(pair_of(tree.value("extent", index), math.nan), turn, False)
            sides = 2 * reach[0], 2 * reach[1]
        # neighbours in a row are moved by one axis alone
        for axis in (0, 1):
            step = abs(repeat.step[axis])
            if repeat.count[axis] > 1 and step < sides[axis] * (1 - _CLOSE):
                yield Remark(
                    "/repeat/step",
                    f"the copies are {sides[axis]:.6g} long and {step:.6g} apart, and overlap.",
                    "Make the step as long as the element, or longer.",
                    element=index,
                )
                break
