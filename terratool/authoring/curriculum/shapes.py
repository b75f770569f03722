"""Shapes that tiles are made of, as text of a definition.

Plans are in whole millimetres: a tile's grid has a cell for each, so that neighbours share their
edges exactly.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.text.format import WIDTH

Members = dict[str, Any]
"""Of an object of the definition."""

MM = 1000
"""mm in a metre."""
DIGITS = 4
"""Heights are rounded to so many digits behind the point, in metres."""
HYPERBOLA_ROWS = 32
"""Stretches by which the curved rim of a slope's platform is drawn."""


@dataclass(frozen=True, slots=True)
class Lines:
    """Items of a list that are text already, in the canonical layout but for their indentation."""

    items: tuple[str, ...]

    def __add__(self, other: Lines) -> Lines:
        """Both, one after the other."""
        return Lines(self.items + other.items)


class Rectangle(NamedTuple):
    """Of a plan, in mm from the tile's south-west corner."""

    x: int
    y: int
    w: int
    h: int

    def inset(self, by: int) -> Rectangle:
        """The same without a frame so wide."""
        return Rectangle(self.x + by, self.y + by, self.w - 2 * by, self.h - 2 * by)

    @property
    def place(self) -> Members:
        """Its keys in an element."""
        return {"cellX": self.x, "cellY": self.y, "span": [self.w, self.h]}


class Box(NamedTuple):
    """A level rectangle and its height, m."""

    plan: Rectangle
    height: float


@dataclass(frozen=True, slots=True)
class Shape:
    """An element without its place, and the primitives that it needs.

    Attributes:
        element: its members.
        primitives: by name.
    """

    element: Members
    primitives: Mapping[str, Members] = field(default_factory=dict)


PRIMITIVES: dict[str, Members] = {
    "ground": {"descr": "Level, and no height of its own", "x": [0], "x-ignore": ["TT308"]},
    "level": {"descr": "Level, as high as vScale", "x": [1]},
    "pyramid": {"descr": "Four faces that meet in a point", "x": "tent", "y": [], "combine": "min"},
    "column": {"descr": "A round column", "x": [1], "combine": "radial"},
}
"""What any tile may be made of."""


def mm(metres: float) -> int:
    """Metres in whole millimetres."""
    return math.floor(metres * MM + 0.5)


def square(tile: Rectangle, side: float) -> Rectangle:
    """A square, `side` in m, in the middle of a tile."""
    w, h = min(mm(side), tile.w), min(mm(side), tile.h)
    return Rectangle(tile.x + (tile.w - w) // 2, tile.y + (tile.h - h) // 2, w, h)


def ratio_within(tile: Rectangle, inner: Rectangle, ratio: float) -> Rectangle:
    """A rectangle around an inner one that leaves of the room in each direction a share."""
    w, h = (
        n + 2 * mm((whole - n) * ratio / 2 / MM)
        for n, whole in ((inner.w, tile.w), (inner.h, tile.h))
    )
    return Rectangle(tile.x + (tile.w - w) // 2, tile.y + (tile.h - h) // 2, w, h)


def grounded(tile: Rectangle, children: Any, **more: Any) -> Members:
    """Level ground with children in a grid of millimetres."""
    base = {"type": "ground", "vScale": 1, **more}
    return {**base, "cells": [tile.w, tile.h], "children": children}


# --- boxes -------------------------------------------------------------------------------------


def box_lines(boxes: Iterable[Box], raised: float = 0.0) -> Lines:
    """Boxes as elements, each on a line; those without a height are left out.

    Args:
        boxes: which must not overlap, as heights add up.
        raised: is added to the height of each.
    """
    items = []
    for (x, y, w, h), height in boxes:
        z = round(height + raised, DIGITS)
        if z and w and h:
            items.append(
                f'{{ "cellX": {x}, "cellY": {y}, "span": [{w}, {h}], "type": "level", '
                f'"vScale": {_number(z)} }}'
            )
    return Lines(tuple(items))


def _number(value: float) -> str:
    """As JSON has it: 0.5, 2, 1e-4."""
    return repr(int(value)) if value == int(value) else repr(value)


def without(plan: Rectangle, hole: Rectangle) -> Iterator[Rectangle]:
    """What of a rectangle lies outside another: up to four rectangles."""
    west, east = max(plan.x, hole.x), min(plan.x + plan.w, hole.x + hole.w)
    south, north = max(plan.y, hole.y), min(plan.y + plan.h, hole.y + hole.h)
    if west >= east or south >= north:
        yield plan
        return
    parts = (
        Rectangle(plan.x, plan.y, plan.w, south - plan.y),
        Rectangle(plan.x, south, west - plan.x, north - south),
        Rectangle(east, south, plan.x + plan.w - east, north - south),
        Rectangle(plan.x, north, plan.w, plan.y + plan.h - north),
    )
    yield from (part for part in parts if part.w > 0 and part.h > 0)


def outside(boxes: Iterable[Box], holes: Sequence[Rectangle]) -> list[Box]:
    """What of boxes lies outside of all of some rectangles."""
    kept = list(boxes)
    for hole in holes:
        kept = [Box(part, height) for plan, height in kept for part in without(plan, hole)]
    return kept


def frame(outer: Rectangle, thickness: int, height: float) -> list[Box]:
    """Four boxes along the inner edges of a rectangle."""
    return [Box(plan, height) for plan in without(outer, outer.inset(thickness))]


def corners(tile: Rectangle, arms: float) -> list[Rectangle]:
    """The four corners of a tile beside arms of a width, m, from its middle to its sides."""
    middle = square(tile, arms)
    w, h = middle.x - tile.x, middle.y - tile.y
    places = itertools.product(
        (tile.y, tile.y + tile.h - h) if h else (), (tile.x, tile.x + tile.w - w) if w else ()
    )
    return [Rectangle(x, y, w, h) for y, x in places]


def hole_lines(holes: Iterable[Rectangle]) -> Lines:
    """Rectangles without ground as elements, each on a line."""
    return Lines(
        tuple(
            f'{{ "cellX": {x}, "cellY": {y}, "span": [{w}, {h}], "type": "ground", '
            '"surface": "hole", "vScale": 1 }'
            for x, y, w, h in holes
        )
    )


def merged(levels: NDArray[np.int64], pixel: int) -> list[tuple[Rectangle, int]]:
    """Rectangles of equal level that cover what is not at level 0.

    Args:
        levels: (rows, columns) from the south and the west.
        pixel: mm.
    """
    found = []
    begun: dict[tuple[int, int, int], int] = {}
    for row in range(len(levels) + 1):
        runs = set(_runs(levels[row])) if row < len(levels) else set()
        for run in [run for run in begun if run not in runs]:
            first, end, level = run
            since = begun.pop(run)
            plan = (first, since, end - first, row - since)
            found.append((Rectangle(*(n * pixel for n in plan)), level))
        for run in sorted(runs):
            begun.setdefault(run, row)
    return found


def _runs(row: NDArray[np.int64]) -> Iterator[tuple[int, int, int]]:
    """Stretches of one level other than 0: first, end, level."""
    edges = [0, *(np.flatnonzero(np.diff(row)) + 1).tolist(), len(row)]
    for first, end in itertools.pairwise(edges):
        if row[first]:
            yield first, end, int(row[first])


# --- relief ------------------------------------------------------------------------------------


def relief(
    name: str, plan: Rectangle, heights: NDArray[np.int64], step: float, lowest: float
) -> Shape:
    """Heights at the nodes of a grid, bilinear in between: each row is a tent along y.

    Args:
        name: that primitives begin with.
        plan: whose corners are the outermost nodes.
        heights: (rows, columns) from the south and the west, 0 or more, in steps.
        step: m.
        lowest: m, of height 0.
    """
    last = len(heights) - 1
    primitives: dict[str, Members] = {}
    items = []
    there: NDArray[np.bool_] = np.asarray(heights.any(axis=1))
    for row, values in enumerate(heights.tolist()):
        if not there[row]:
            continue
        curve = [1, 0] if row == 0 else [0, 1] if row == last else "tent"
        own = f"{name} row {row}"
        primitives[own] = {"x": number_rows(values), "y": curve}
        span = "" if curve != "tent" else '"span": [1, 2], '
        items.append(
            f'{{ "cellX": 0, "cellY": {max(0, row - 1)}, {span}"type": "{own}", '
            f'"vScale": {_number(step)} }}'
        )
    element = {
        **plan.place,
        "descr": "Random heights: each row is a tent along y, all add up",
        "type": "ground",
        "vScale": 1,
        "vOffset": lowest,
        "cells": [1, last],
        "children": Lines(tuple(items)),
    }
    if not lowest:
        del element["vOffset"]
    if (there[1:] & there[:-1]).any():  # neighbours share a cell
        element["x-ignore"] = ["TT208"]
    return Shape(element, primitives)


_INNER = WIDTH - 8
"""Characters of a row of a curve's numbers, which are indented by eight."""


def number_rows(values: Sequence[int]) -> Lines | list[int]:
    """Numbers in rows as wide as the canonical layout has them; a list if they fit on one line."""
    text = ", ".join(map(str, values))
    if len(text) <= WIDTH:
        return list(values)
    rows = []
    while len(text) > _INNER:
        end = text.rindex(", ", 0, _INNER + 1)
        rows.append(text[:end])
        text = text[end + 2 :]
    return Lines((*rows, text))


# --- pyramids ------------------------------------------------------------------------------------


def _curve(points: Iterable[tuple[float, float]]) -> list[list[float]]:
    """Knots of points that may begin after 0 and end before 1, where it is level."""
    knots = [[round(t, 9), round(z, 9)] for t, z in points]
    if knots[0][0] > 0.0:
        knots.insert(0, [0, knots[0][1]])
    if knots[-1][0] < 1.0:
        knots.append([1, knots[-1][1]])
    return [[t if t != int(t) else int(t), z if z != int(z) else int(z)] for t, z in knots]


def _mirrored(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Points up to the middle, and the same backwards behind it; one in the middle stands once."""
    behind = [(1.0 - t, z) for t, z in reversed(points)]
    return [*points, *(behind[1:] if points[-1][0] == 0.5 else behind)]


def stairs(tile: Rectangle, border: int, width: int, steps: int) -> Members:
    """The primitive of stairs on four sides; heights in steps.

    Args:
        tile: which it fills.
        border: mm from the tile's edges to the first step.
        width: of a step, mm.
        steps: how many risers.
    """

    def across(side: int) -> list[list[float]]:
        points = [
            ((border + k * width) / side, float(level))
            for k in range(steps)
            for level in (k, k + 1)
        ]
        # without a border the first riser is the tile's edge
        return _curve(_mirrored(points if border else points[1:]))

    primitive = {
        "descr": f"Steps on four sides: the height is counted in steps, of which there are {steps}",
        "x": across(tile.w),
        "y": [] if tile.w == tile.h else across(tile.h),
        "combine": "min",
    }
    return {**primitive, "x-ignore": ["TT306"]} if steps > 1 else primitive


def pyramid_slope(name: str, tile: Rectangle, border: int, platform: float) -> Shape:
    """Even slopes of 1 along the axes, as high as the published generators make them.

    Their height is w/2 · min(X·Y, c): X and Y rise from 0 at the border to 1 in the middle, and c
    is X·Y at the platform's corners, so that the platform is larger than a square, with a curved
    rim. X·Y up to c is a product of two curves. Above, each row along y is a trapezoid along x, and
    rows are joined by straight lines.

    Args:
        name: that primitives begin with.
        tile: which it fills.
        border: mm.
        platform: m.
    """
    inner = tile.inset(border)
    x_rim, y_rim = (1.0 - mm(platform) / side for side in (inner.w, inner.h))
    cut = x_rim * y_rim
    rows = HYPERBOLA_ROWS if cut < 1.0 else 0
    ways = [cut + (1.0 - cut) * k / max(1, rows) for k in range(rows + 1)]

    def at(way: float, side: int) -> float:
        """Where X, or Y, is so much, mm."""
        return border + way / 2 * (side - 2 * border)

    scale = round(cut * inner.w / 2 / MM, 6)
    primitives: dict[str, Members] = {}
    children = []
    for k, way in enumerate(ways):
        own = f"{name} {k}"
        along = [(at(0.0, tile.w) / tile.w, 0.0), (at(cut / way, tile.w) / tile.w, 1.0)]
        hat = [(at(ways[k - 1] if k else 0.0, tile.h), 0.0), (at(way, tile.h), 1.0)]
        if k < rows:
            hat.append((at(ways[k + 1], tile.h), 0.0))
        # a row is a strip of whole mm, up to the rows beside it; the last lies on both sides
        first = math.floor(hat[0][0])
        end = math.ceil(hat[-1][0]) if k < rows else tile.h - first
        strip = [((y - first) / (end - first), z) for y, z in hat]
        primitives[own] = {
            "x": _curve(_mirrored(along)),
            "y": _curve(strip if k < rows else _mirrored(strip)),
        }
        for y, turn in [(first, 0), (tile.h - end, 180)][: 1 + (k < rows)]:
            place = {"cellX": 0, "cellY": y, "span": [1, end - first]}
            turned = {"turnDeg": turn} if turn else {}
            children.append({**place, "type": own, "vScale": scale, **turned})
    element = {
        "descr": "Slopes of 1 on four sides: X times Y up to the platform, all add up",
        "type": "ground",
        "vScale": 1,
        "cells": [1, tile.h],
        "children": children,
    }
    if len(children) > 1:
        element["x-ignore"] = ["TT208"]
    return Shape(element, primitives)
