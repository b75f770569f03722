"""Turned elements that their cells trim."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache

from msgspec import UNSET

from terratool.definition.curves import problems, shape_of
from terratool.definition.findings import Remark
from terratool.definition.model import Primitive, pair_of
from terratool.definition.rules.base import Subject, rule
from terratool.definition.sides import Sides, sides
from terratool.definition.summaries import combine_values, curve_values
from terratool.definition.tree import ROOT
from terratool.definition.turning import CLOSE, Point, Turned, turned

_STEPS = 128
"""Along each side, between points at which a shape is asked for."""


@rule("TT213", "trimmed-element", "warning")
def trimmed_element(subject: Subject) -> Iterator[Remark]:
    """An element is turned, and its cell cuts off what reaches beyond it.

    The footprint of an element in a cell of the grid ends where that cell ends. So a quarter turn
    in an oblong block leaves a part of the length, and any other turn takes the corners off.
    Nothing is lost by half turns, by quarter turns in square blocks, of discs in these, and where
    the shape is 0 and has neither surface nor vOffset. The root is left out: beyond the terrain
    there is nothing. So is what stands in a part, where the sides of its cell depend on those of
    the part's.

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
    tree = subject.tree
    if all(turn is UNSET or turn % 180 == 0 for turn in tree.distinct("turn_deg")):
        return
    cells = _Cells(subject)
    parts, places, scatters = (tree.column(key) for key in ("part", "at", "scatter"))
    for index, turn in enumerate(tree.column("turn_deg")):
        if turn is UNSET or turn % 180 == 0:
            continue
        whole = not (parts[index] is places[index] is scatters[index] is UNSET)
        if whole or tree.parents[index] < 0:
            continue
        cell = cells.of(index)
        if cell is None:
            continue
        primitive = subject.primitives.get(tree.value("type", index))
        shape = turned(cell.lengths, turn, primitive is not None and primitive.combine == "radial")
        if shape.is_trimmed and not _is_bare(subject, index, shape):
            around = cells.of(tree.parents[index])
            assert around is not None
            yield Remark(
                "/turnDeg", shape.sentence(), _hint(subject, index, shape, around), element=index
            )


class _Cells:
    """The sides of cells, as far as they are known: in parts they may not be."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._known: dict[int, Sides | None] = {}

    def of(self, index: int) -> Sides | None:
        """The sides of an element's cell."""
        tree, path = self._subject.tree, []
        while index not in self._known:
            path.append(index)
            if tree.parents[index] < 0 or tree.value("extent", index) is not UNSET:
                self._known[index] = self._begin(index)
                break
            index = tree.parents[index]
        for inner in reversed(path):
            if inner not in self._known:
                self._known[inner] = self._within(inner, self._known[tree.parents[inner]])
        return self._known[path[0] if path else index]

    def _begin(self, index: int) -> Sides | None:
        """Of an element whose cell has sides of its own."""
        subject, tree = self._subject, self._subject.tree
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
        subject, tree = self._subject, self._subject.tree
        block, parent = tree.block(index), tree.parents[index]
        unknown = subject.left_out(parent, "cells") or subject.left_out(index, "span", "extent")
        if around is None or unknown or min(block) < 0:
            return None
        return around.block(block[2:], tree.grid(parent))


def _is_bare(subject: Subject, index: int, shape: Turned) -> bool:
    """Whether an element adds nothing where it is cut off: no height, and no surface."""
    tree = subject.tree
    offset, scale = tree.value("v_offset", index), tree.value("v_scale", index)
    if tree.value("surface", index) is not UNSET or (offset is not UNSET and offset != 0):
        return False
    if scale is not UNSET and scale == 0:
        return True
    primitive = subject.primitives.get(tree.value("type", index))
    if primitive is None or problems(primitive):
        return False
    return not any(shape.is_beyond(*point) for point in _hull(primitive))


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


def _hint(subject: Subject, index: int, shape: Turned, around: Sides) -> str:
    """How to keep all of an element."""
    tree, parent = subject.tree, around.lengths
    block, grid = tree.block(index), tree.grid(tree.parents[index])
    middle = [
        Fraction(parent[axis]) * Fraction(2 * block[axis] + block[axis + 2], 2 * grid[axis])
        for axis in (0, 1)
    ]
    place = f'"at": {_pair(*map(float, middle))}, "extent": {_pair(*shape.lengths)}'
    repeat = tree.value("repeat", index)
    ends = [(0.0, 0.0)]
    if repeat is not UNSET:
        step = [
            float(Fraction(parent[axis]) * Fraction(repeat.step[axis]) / grid[axis])
            for axis in (0, 1)
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
