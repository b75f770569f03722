"""Rule on turned elements that their cells trim."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache, partial
from itertools import compress, product, repeat
from operator import eq
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.cell_kinds import FREE, cell_kinds
from terratool.definition.curves import GridShape, problems, shape_of
from terratool.definition.exact import Sides, sides
from terratool.definition.findings import Remark, RemarkBatch
from terratool.definition.libraries import path_between
from terratool.definition.model import STOREYS, Primitive
from terratool.definition.part_sizes import Cells, PartSize, PartSizes, SizeLimits, is_free
from terratool.definition.rules.base import Subject, rule
from terratool.definition.summaries import combine_values, curve_values
from terratool.definition.tree import ROOT, Tree
from terratool.definition.turning import CLOSE, Point, Turned, turned_shape
from terratool.definition.uses import Uses, elements_of
from terratool.text.display import quote

_STEPS = 128
"""Intervals along each side between the points at which a shape is sampled."""


@rule("TT213", "trimmed-element", "warning")
def trimmed_element(subject: Subject) -> Iterator[Remark | RemarkBatch]:
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


def _in_sight(subject: Subject) -> Iterator[RemarkBatch]:
    """Yield remarks on elements of the terrain itself, and on those at free places of a library."""
    tree = subject.tree
    turns = {turn for turn in tree.distinct("turn_deg") if turn is not UNSET and turn % 180 != 0}
    if not turns:
        return
    found = [index for index, turn in enumerate(tree.column("turn_deg")) if turn in turns]
    found = found[bisect_left(found, len(tree.roots)) :]
    for key in ("part", "at", "extent", "scatter"):
        if tree.distinct(key) != {UNSET}:
            column = tree.column(key)
            found = [index for index in found if column[index] is UNSET]
    if len(tree.roots) > 1 and subject.uses.has_root:
        found = [index for index in found if not tree.root_of[index]]
    cells = _Cells(subject)
    verdicts = _Verdicts(cells)
    if not cells.all_known:
        found = list(filter(cells.is_known, found))
    columns = [tree.column(key) for key in ("turn_deg", "type", "surface", "v_offset")]
    if tree.distinct("surface_grid") != {UNSET}:
        pairs = zip(columns[2], tree.column("surface_grid"), strict=True)
        columns[2] = [own if own is not UNSET else classes for own, classes in pairs]
    if tree.has_storeys:  # what is cut off a storey is a gap, however high it is there
        storeys = map(tree.storey, range(len(tree)))
        columns[2] = [
            own if own is not UNSET else storey
            for own, storey in zip(columns[2], storeys, strict=True)
        ]
    flat = map(eq, map(tree.column("v_scale").__getitem__, found), repeat(0))
    # one verdict for each combination, looked up at the speed of C
    looks = zip(
        *(map(column.__getitem__, found) for column in (cell_kinds(tree).of, *columns)),
        flat,
        strict=False,
    )
    yield RemarkBatch(
        list(compress(found, map(verdicts.__getitem__, looks))), partial(_remark, cells)
    )


class _Verdicts(dict[Any, bool]):
    """Verdicts whether elements are trimmed, by the kind of their cells and their attributes."""

    def __init__(self, cells: _Cells) -> None:
        self._cells = cells

    def __missing__(self, key: tuple[int, float, Any, Any, Any, bool]) -> bool:
        kind, turn, name, surface, offset, flat = key
        primitive = self._cells.subject.primitives.get(name)
        shape = self._cells.shape(kind, turn, primitive)
        self[key] = found = shape.is_trimmed and not (
            surface is UNSET
            and (offset is UNSET or offset == 0)
            and (flat or (primitive is not None and _is_bare(primitive, shape)))
        )
        return found


def _remark(cells: _Cells, index: int) -> Remark:
    tree, kinds = cells.subject.tree, cell_kinds(cells.subject.tree).of
    primitive = cells.subject.primitives.get(tree.value("type", index))
    shape = cells.shape(kinds[index], tree.value("turn_deg", index), primitive)
    hint = _hint(tree, index, shape, cells.sides(kinds[tree.parents[index]]))
    return Remark("/turnDeg", shape.sentence(), hint, element=index)


class _Cells:
    """Sides of cells, as far as they are known; in parts they may not be.

    Attributes:
        subject: subject whose tree has the cells.
        all_known: whether the sides of all elements' cells are known.
    """

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        tree = subject.tree
        self._kinds = cell_kinds(tree)
        self._sides: dict[int, Sides] = {}
        self._extents = tree.column("extent")
        self._known: dict[int, bool] = {}
        for index, pointer in enumerate(tree.roots[: len(tree)]):
            size = subject.definition.extent
            self._known[index] = has_size = (
                pointer == ROOT
                and not subject.left_out("", "size")
                and all(map(math.isfinite, size))
            )
            if has_size:
                self._sides[index] = sides(size)
        self.all_known = (
            all(self._known.values())
            and not subject.unfit
            and all(tree.count_lacking(key) == len(tree.roots) for key in ("cell_x", "cell_y"))
        )

    def is_known(self, index: int) -> bool:
        """Whether the sides of an element's cell are known."""
        parents, path = self.subject.tree.parents, []
        while index not in self._known:
            path.append(index)
            if self._extents[index] is not UNSET:
                self._known[index] = True
                break
            index = parents[index]
        known = self._known[index]
        for inner in reversed(path):
            known = self._known[inner] = known and (inner == index or self._has_block(inner))
        return known

    def _has_block(self, index: int) -> bool:
        """Whether the cells of the grid that an element takes are known."""
        subject, tree = self.subject, self.subject.tree
        if min(tree.block(index)) < 0 or subject.left_out(tree.parents[index], "cells"):
            return False
        return not subject.left_out(index, "span", "extent")

    def shape(self, kind: int, turn: float, primitive: Primitive | None) -> Turned:
        """Shape of an element that is turned in a cell of a known kind."""
        is_round = primitive is not None and primitive.combine == "radial"
        return turned_shape(self.sides(kind).lengths, turn, is_round)

    def sides(self, kind: int) -> Sides:
        """Sides of cells of a known kind."""
        path = []
        while kind not in self._sides:
            origin = self._kinds.origins[kind]
            assert origin is not None
            if origin.around == FREE:
                self._sides[kind] = sides(origin.span)
                break
            path.append((kind, origin))
            kind = origin.around
        found = self._sides[kind]
        for inner, (_, (w, h), grid) in reversed(path):
            found = self._sides[inner] = found.block((int(w), int(h)), grid)
        return found


def _is_aligned(tree: Tree) -> bool:
    """Whether no element is turned by other than half turns."""
    return all(turn is UNSET or turn % 180 == 0 for turn in tree.distinct("turn_deg"))


class _TrimKey(NamedTuple):
    """Properties of elements in parts that lose the same share in equal cells."""

    turn: float
    primitive: str
    may_be_bare: bool
    is_root: bool


def _in_parts(subject: Subject) -> Iterator[Remark]:
    """Yield remarks on elements that are trimmed where a part stands in the terrain."""
    uses = subject.uses
    if not uses.has_root or uses.circles or subject.definition.size is UNSET:
        return
    trees = {id(root.tree): root.tree for root in (uses.root, *map(uses.part, uses.parts_in_use))}
    if not uses.parts_in_use or all(map(_is_aligned, trees.values())):
        return
    sizes = PartSizes(
        uses, set(uses.parts_in_use), partial(_group_elements, subject), _LIMITS, _proportions
    )
    told: set[int] = set()
    seen: set[PartSize] = set()
    users: set[int] = set()
    for alike in sizes.alike():
        size, kind = alike.size, alike.key
        assert isinstance(kind, _TrimKey)
        own = alike.root.tree is subject.tree
        mark = id(alike.elements) if own else id(sizes.found[size])
        if mark in told or (kind.is_root and size.whole) or (not own and kind.turn % 90 != 0):
            continue
        primitive = subject.primitives[kind.primitive]
        lengths, cell = (each.turn_by(size.lies).lengths for each in (alike.sides, size.sides))
        turn = math.fmod(kind.turn + 90 * size.lies, 360.0)
        shape = turned_shape(lengths, turn, primitive.combine == "radial")
        bare = kind.may_be_bare and not (kind.is_root and _is_added_to(uses, sizes.found[size]))
        if not shape.is_trimmed or (bare and _is_bare(primitive, shape)):
            continue
        told.add(mark)
        lost = shape.sentence()[:-1]
        where = f"where the part {quote(size.part)} stands in {cell[0]:.6g} × {cell[1]:.6g}"
        hint = 'Place it by "at" and "extent" in its part, or turn the part by 180.'
        if kind.is_root:
            hint = "Give the part a square cell or a free place there, or turn it by 180."
        if own:
            for index in alike.elements:
                yield Remark("", f"{lost}, {where}.", hint, element=index)
            continue
        library = path_between(subject.document, alike.root.home)
        place = f"{library}#{alike.root.tree.pointer(alike.elements[0])}"
        for user in sizes.elements_leading_to(size, seen):
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


_LIMITS = SizeLimits(1_000, 20_000)


def _proportions(size: PartSize) -> tuple[str, float, bool, bool]:
    """Key of sizes of a part in which the same share of an element is cut off."""
    w, h = size.sides.lengths
    ratio = round(math.log(w) - math.log(h), 9) if min(w, h) > 0 else 0.0
    return size.part, ratio, size.lies, size.whole


def _group_elements(subject: Subject, cells: Cells) -> Iterator[tuple[int, _TrimKey, int]]:
    """Elements of a part that cells of the grid may trim, by cell and kind."""
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
            kind = _TrimKey(turn, name, bare, index == root.element)
            yield cells.number(index), kind, index


def _may_be_bare(tree: Tree, index: int) -> bool:
    """Whether an element adds nothing where its shape is 0: neither surface nor offset."""
    offset = tree.value("v_offset", index)
    given = {tree.value(key, index) for key in ("surface", "surface_grid", *STOREYS)} != {UNSET}
    return not given and (offset is UNSET or offset == 0)


def _is_bare(primitive: Primitive, shape: Turned) -> bool:
    """Whether a shape has no height where it is cut off."""
    return not problems(primitive) and not any(
        shape.is_beyond(*point) for point in _hull(primitive)
    )


@lru_cache(maxsize=4096)
def _hull(primitive: Primitive) -> tuple[Point, ...]:
    """Points around the area in which a primitive is not 0, judged by evenly spaced samples.

    They lie around the primitive's middle, in units of its sides. As a cell is convex, the area
    between these points lies in the cell if the points do.
    """
    shape = shape_of(primitive)
    if shape.grid is not None:
        return tuple(_grid_hull(shape.grid))
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


def _grid_hull(grid: GridShape) -> Iterator[Point]:
    """Points around the numbers of a grid that are not 0, as far as these have an effect.

    Those of a file are not read: they may be anything anywhere.
    """
    if not grid.rows:
        yield from product((-0.5, 0.5), repeat=2)
        return
    pixel, rows = grid.registration == "pixel", grid.rows[::-1]  # from the south
    counts = len(rows[0]), len(rows)

    def place(axis: int, number: int) -> float:
        if not 0 <= number < counts[axis] or counts[axis] == 1:
            return -0.5 if number < 0 or number < counts[axis] - 1 else 0.5
        return (number + 0.5) / counts[axis] - 0.5 if pixel else number / (counts[axis] - 1) - 0.5

    for j, row in enumerate(rows):
        there = [i for i, height in enumerate(row) if height != 0]
        for i in (there[0] - 1, there[-1] + 1) if there else ():
            yield from ((place(0, i), place(1, j + side)) for side in (-1, 1))


def _hint(tree: Tree, index: int, shape: Turned, around: Sides) -> str:
    """Hint that tells how to keep all of an element."""
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
