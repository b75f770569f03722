"""Turned elements that their cells trim."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache, partial
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.curves import problems, shape_of
from terratool.definition.exact import Sides, sides
from terratool.definition.findings import Remark
from terratool.definition.libraries import path_between
from terratool.definition.model import Primitive, pair_of
from terratool.definition.part_sizes import Cells, Limits, PartSize, PartSizes, is_free
from terratool.definition.rules.base import Subject, rule
from terratool.definition.summaries import combine_values, curve_values
from terratool.definition.tree import ROOT, Tree
from terratool.definition.turning import CLOSE, THINNEST, Point, Turned, is_slanted, turned
from terratool.definition.uses import Uses, elements_of
from terratool.text.display import shown

_STEPS = 128
"""Along each side, between points at which a shape is asked for."""


@rule("TT213", "trimmed-element", "warning")
def trimmed_element(subject: Subject) -> Iterator[Remark]:
    """An element is turned, and its cell cuts off what reaches beyond it.

    The footprint of an element in a cell of the grid ends where that cell ends. So a quarter turn
    in an oblong block leaves a part of the length, and any other turn takes the corners off.
    Nothing is lost by half turns, by quarter turns in square blocks, of discs in these, and where
    the shape is 0 and has neither surface nor vOffset. The root is left out: beyond the terrain
    there is nothing.

    A part turns with all that is in it, and each element is trimmed to its cell as it lies then.
    Parts are looked at in the proportions of the cells that they stand in, turned and unturned: up
    to 1,000 of these, with 20,000 cells in all; cells that are alike in a part count once. What is
    trimmed is told of once, in the part. If that is in a library, it is told of where the part
    stands, but for what is turned by no multiple of 90 in the library itself.

    Fails:

        {
          "size": 10, "elemTypes": {"flat": {"x": [1]}, "ramp": {"x": [0, 1]}},
          "elemTree": {"type": "flat", "children": [
            {"cellX": 2, "cellY": 1, "span": [3, 6], "type": "ramp", "turnDeg": 270, "vScale": 1}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"flat": {"x": [1]}, "ramp": {"x": [0, 1]}},
          "elemTree": {"type": "flat", "children": [
            {"at": [3.5, 4], "extent": [3, 6], "type": "ramp", "turnDeg": 270, "vScale": 1}
          ]}
        }

    To mend: place the element by at and extent, which turn it whole. Where the cut is meant,
    silence TT213 by x-ignore.
    """
    yield from _in_sight(subject)
    yield from _in_parts(subject)


def _in_sight(subject: Subject) -> Iterator[Remark]:
    """What is trimmed in the terrain itself, and in a library on free places in its parts."""
    tree = subject.tree
    if _is_aligned(tree):
        return
    cells = _Cells(subject)
    elsewhere = [tree.column(key) for key in ("part", "at", "extent", "scatter")]
    types, scales, parents = tree.column("type"), tree.column("v_scale"), tree.parents
    named = [name for name in tree.distinct("type") if name in subject.primitives]
    cornered = {name for name in named if subject.primitives[name].combine != "radial"}
    for index, turn in enumerate(tree.column("turn_deg")):
        if turn is UNSET or turn % 180 == 0:
            continue
        whole = any(column[index] is not UNSET for column in elsewhere)
        if whole or parents[index] < 0 or (subject.uses.has_root and tree.root_of[index]):
            continue
        may_be_bare = _may_be_bare(tree, index)
        slanted = is_slanted(turn) and types[index] in cornered
        if may_be_bare or not slanted or not cells.has_one(index):
            shape = cells.shape(index)
            if shape is None or not shape.is_trimmed:
                continue
            primitive = subject.primitives.get(types[index])
            flat = scales[index] == 0
            if may_be_bare and (flat or (primitive and _is_bare(primitive, shape))):
                continue
        yield Remark("/turnDeg", "", "", element=index, tell=partial(_told, cells, index))


def _told(cells: _Cells, index: int) -> tuple[str, str]:
    tree = cells.subject.tree
    shape, around = cells.shape(index), cells.of(tree.parents[index])
    assert shape is not None and around is not None
    return shape.sentence(), _hint(tree, index, shape, around)


class _Cells:
    """The sides of cells, as far as they are known: in parts they may not be.

    Attributes:
        subject: whose elements they are of.
    """

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self._known: dict[int, Sides | None] = {}
        self._blocks: dict[tuple[int, int, int], Sides] = {}  # by parent and span
        self._extents = subject.tree.column("extent")
        self._divided: dict[int, bool] = {}  # whether blocks of it are known, and have an area

    def has_one(self, index: int) -> bool:
        """Whether an element is certain to stand in a cell that is known and has an area."""
        tree, parent = self.subject.tree, self.subject.tree.parents[index]
        if parent not in self._divided:
            around = None if self.subject.unfit else self.of(parent)
            self._divided[parent] = around is not None and (
                min(around.lengths) > 1e10 * THINNEST * max(around.lengths)  # so are its cells
            )
        return self._divided[parent] and min(tree.block(index)) >= 0

    def shape(self, index: int) -> Turned | None:
        """The shape of an element as it is turned in its cell; None if that is not known."""
        cell, tree = self.of(index), self.subject.tree
        if cell is None:
            return None
        primitive = self.subject.primitives.get(tree.value("type", index))
        is_round = primitive is not None and primitive.combine == "radial"
        return turned(cell.lengths, tree.value("turn_deg", index), is_round)

    def of(self, index: int) -> Sides | None:
        """The sides of an element's cell."""
        known, path = self._known, []
        parents, extents = self.subject.tree.parents, self._extents
        while index not in known:
            path.append(index)
            if parents[index] < 0 or extents[index] is not UNSET:
                known[index] = self._begin(index)
                break
            index = parents[index]
        found = known[index]
        for inner in reversed(path):
            if inner != index:
                found = known[inner] = self._within(inner, found)
        return found

    def _begin(self, index: int) -> Sides | None:
        """Of an element whose cell has sides of its own."""
        subject, tree = self.subject, self.subject.tree
        extent = tree.value("extent", index)
        if tree.parents[index] >= 0:
            return sides(pair_of(extent, math.nan))
        is_root = tree.roots[tree.root_of[index]] == ROOT
        if not is_root or subject.left_out("", "size"):
            return None
        whole = subject.definition.extent
        return sides(whole) if all(map(math.isfinite, whole)) else None

    def _within(self, index: int, around: Sides | None) -> Sides | None:
        """Of an element in a cell of the grid of one with these sides."""
        subject, tree = self.subject, self.subject.tree
        (x, y, w, h), parent = tree.block(index), tree.parents[index]
        if around is None or x < 0 or y < 0 or w < 0 or h < 0:
            return None
        if subject.left_out(parent, "cells") or subject.left_out(index, "span", "extent"):
            return None
        key = parent, w, h
        if key not in self._blocks:
            self._blocks[key] = around.block((w, h), tree.grid(parent))
        return self._blocks[key]


def _is_aligned(tree: Tree) -> bool:
    """Whether nothing is turned by other than half turns."""
    return all(turn is UNSET or turn % 180 == 0 for turn in tree.distinct("turn_deg"))


class _Kind(NamedTuple):
    """Elements of parts that lose the same where their cells are the same."""

    turn: float
    primitive: str
    may_be_bare: bool
    is_root: bool


def _in_parts(subject: Subject) -> Iterator[Remark]:
    """What is trimmed where a part stands in the terrain."""
    uses = subject.uses
    if not uses.has_root or uses.circles or subject.definition.size is UNSET:
        return
    trees = {id(root.tree): root.tree for root in (uses.root, *map(uses.part, uses.reached))}
    if not uses.reached or all(map(_is_aligned, trees.values())):
        return
    sizes = PartSizes(uses, set(uses.reached), partial(_grouped, subject), _LIMITS, _proportions)
    told: set[int] = set()
    seen: set[PartSize] = set()
    users: set[int] = set()
    for alike in sizes.alike():
        size, kind = alike.size, alike.key
        assert isinstance(kind, _Kind)
        own = alike.root.tree is subject.tree
        mark = id(alike.elements) if own else id(sizes.found[size])
        if mark in told or (kind.is_root and size.whole) or (not own and kind.turn % 90 != 0):
            continue
        primitive = subject.primitives[kind.primitive]
        lengths, cell = (each.turned(size.lies).lengths for each in (alike.sides, size.sides))
        turn = math.fmod(kind.turn + 90 * size.lies, 360.0)
        shape = turned(lengths, turn, primitive.combine == "radial")
        bare = kind.may_be_bare and not (kind.is_root and _is_added_to(uses, sizes.found[size]))
        if not shape.is_trimmed or (bare and _is_bare(primitive, shape)):
            continue
        told.add(mark)
        lost = shape.sentence()[:-1]
        where = f"where the part {shown(size.part)} stands in {cell[0]:.6g} × {cell[1]:.6g}"
        hint = 'Place it by "at" and "extent" in its part, or turn the part by 180.'
        if kind.is_root:
            hint = "Give the part a square cell or a free place there, or turn it by 180."
        if own:
            for index in alike.elements:
                yield Remark("", f"{lost}, {where}.", hint, element=index)
            continue
        library = path_between(subject.document, alike.root.home)
        place = f"{library}#{alike.root.tree.pointer(alike.elements[0])}"
        for user in sizes.leading_to(size, seen):
            if user not in users:
                users.add(user)
                yield Remark("/part", f"in {place}, {lost}, {where}.", hint, element=user)


def _is_added_to(uses: Uses, users: list[tuple[PartSize, list[int]]]) -> bool:
    """Whether an element that stands for a part gives its root a surface or an offset."""
    return any(
        not _may_be_bare((uses.part(user.part) if user.part else uses.root).tree, element)
        for user, elements in users
        for element in elements
    )


_LIMITS = Limits(1_000, 20_000)


def _proportions(size: PartSize) -> tuple[str, float, bool, bool]:
    """What is the same where the same share of an element is cut off."""
    w, h = size.sides.lengths
    ratio = round(math.log(w) - math.log(h), 9) if min(w, h) > 0 else 0.0
    return size.part, ratio, size.lies, size.whole


def _grouped(subject: Subject, cells: Cells) -> Iterator[tuple[int, _Kind, int]]:
    """The elements of a part that cells of the grid may trim."""
    root, tree = cells.root, cells.root.tree
    if root == subject.uses.root:
        return
    free = is_free(tree)
    for index in elements_of(root):
        name, turn = tree.value("type", index), tree.value("turn_deg", index)
        if name not in subject.primitives or free(index):
            continue
        bare = _may_be_bare(tree, index)
        if not bare or tree.value("v_scale", index) != 0:
            turn = 0.0 if turn is UNSET else math.fmod(turn, 360.0)
            kind = _Kind(turn, name, bare, index == root.element)
            yield cells.number(index), kind, index


def _may_be_bare(tree: Tree, index: int) -> bool:
    """Whether an element adds nothing where its shape is 0: neither surface nor offset."""
    offset = tree.value("v_offset", index)
    return tree.value("surface", index) is UNSET and (offset is UNSET or offset == 0)


def _is_bare(primitive: Primitive, shape: Turned) -> bool:
    """Whether a shape has no height where it is cut off."""
    return not problems(primitive) and not any(
        shape.is_beyond(*point) for point in _hull(primitive)
    )


@lru_cache(maxsize=4096)
def _hull(primitive: Primitive) -> tuple[Point, ...]:
    """Points around all of a primitive that is not 0, as far as evenly spaced ones tell.

    They lie around its middle, in units of its sides. As a cell is convex, what is between these
    points lies in it if they do.
    """
    shape = shape_of(primitive)
    x_at = curve_values(shape.x)
    times = [k / _STEPS for k in range(_STEPS + 1)]
    if shape.y is None:
        reach = max((t for t in times[_STEPS // 2 :] if x_at(t) != 0), default=0.5) - 0.5
        steps = (2 * math.pi * k / _STEPS for k in range(_STEPS))
        return tuple((reach * math.cos(step), reach * math.sin(step)) for step in steps)
    xs, ys = list(map(x_at, times)), list(map(curve_values(shape.y), times))
    found: list[Point] = []
    by_column: dict[float, list[float]] = {}
    for u, x in zip(times, xs, strict=True):
        if x not in by_column:
            by_column[x] = [
                v for v, y in zip(times, ys, strict=True)
                if combine_values(shape.combine, x, y) != 0
            ]  # fmt: skip
        column = by_column[x]
        if column:
            found += [(u - 0.5, column[0] - 0.5), (u - 0.5, column[-1] - 0.5)]
    return tuple(found)


def _hint(tree: Tree, index: int, shape: Turned, around: Sides) -> str:
    """How to keep all of an element."""
    parent = around.lengths
    block, grid = tree.block(index), tree.grid(tree.parents[index])
    middle = [
        around[axis].value * Fraction(2 * block[axis] + block[axis + 2], 2 * grid[axis])
        for axis in (0, 1)
    ]
    place = f'"at": {_pair(*map(float, middle))}, "extent": {_pair(*shape.lengths)}'
    repeat = tree.value("repeat", index)
    ends = [(0.0, 0.0)]
    if repeat is not UNSET:
        step = [
            float(around[axis].value * Fraction(repeat.step[axis]) / grid[axis]) for axis in (0, 1)
        ]
        place += f' and "step": {_pair(*step)}'
        ends.append(((repeat.count[0] - 1) * step[0], (repeat.count[1] - 1) * step[1]))
    for axis, (reach, side) in enumerate(zip(shape.reach, parent, strict=True)):
        at = [float(middle[axis]) + end[axis] for end in ends]
        if min(at) - reach < -CLOSE * side or max(at) + reach > side * (1 + CLOSE):
            w, h = (2 * half for half in shape.reach)
            return (
                f"Turned whole it needs {w:.6g} × {h:.6g}, which its parent's cell does not have "
                'there: move it or make it smaller, by "at" and "extent".'
            )
    begin, end = tree.brood(index)
    if shape.turn % 90 != 0 and begin < end:
        return f"Give its children to one that is not turned, and write {place} to keep all of it."
    return f"Write {place} in place of its cell to keep all of it."


def _pair(x: float, y: float) -> str:
    return f"[{_number(x)}, {_number(y)}]"


def _number(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
