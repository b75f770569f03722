"""Shapes of tiles, as elements and primitives of a definition.

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

Members = dict[str, Any]
"""Members of a JSON object of the definition, by key."""

MM = 1000
"""Millimetres per metre."""
DIGITS = 4
"""Decimals to which heights in metres are rounded."""
HYPERBOLA_ROWS = 32
"""Number of stretches that approximate the curved rim of a slope's platform."""


@dataclass(frozen=True, slots=True)
class TextLines:
    """Items of a JSON list that are text already, in the canonical layout without indentation."""

    items: tuple[str, ...]

    def __add__(self, other: TextLines) -> TextLines:
        """Join the items of two lists."""
        return TextLines(self.items + other.items)


class TileRectangle(NamedTuple):
    """Rectangle of a plan: corner (x, y) from the tile's south-west corner and sides (w, h), mm."""

    x: int
    y: int
    w: int
    h: int

    def inset(self, by: int) -> TileRectangle:
        """Return the rectangle without a frame of a width, mm; a negative width adds a frame."""
        return TileRectangle(self.x + by, self.y + by, self.w - 2 * by, self.h - 2 * by)

    @property
    def place(self) -> Members:
        """Keys of an element that fills the rectangle, in a grid of millimetres."""
        return {"cellX": self.x, "cellY": self.y, "span": [self.w, self.h]}


class Box(NamedTuple):
    """Rectangle with a level top, and its height, m."""

    plan: TileRectangle
    height: float


@dataclass(frozen=True, slots=True)
class TileShape:
    """Element without its place, and the primitives that it needs.

    Attributes:
        element: members of the element.
        primitives: members of the primitives, by name.
    """

    element: Members
    primitives: Mapping[str, Members] = field(default_factory=dict)


PRIMITIVES: dict[str, Members] = {
    "ground": {"descr": "Level, and no height of its own", "x": [0], "x-ignore": ["TT308"]},
    "level": {"descr": "Level, as high as vScale", "x": [1]},
    "pyramid": {"descr": "Four faces that meet in a point", "x": "tent", "y": [], "combine": "min"},
    "column": {"descr": "A round column", "x": [1], "combine": "radial"},
}
"""Primitives that tiles of any kind may use, by name."""


def mm(metres: float) -> int:
    """Length in whole millimetres, rounded to the nearest."""
    return math.floor(metres * MM + 0.5)


def square(tile: TileRectangle, side: float) -> TileRectangle:
    """Square with a side in m, in the middle of a tile and no larger than it."""
    return rectangle_within(tile, min(mm(side), tile.w), min(mm(side), tile.h))


def rectangle_within(tile: TileRectangle, w: int, h: int) -> TileRectangle:
    """Rectangle of two sides, mm, in the middle of a tile."""
    return TileRectangle(tile.x + (tile.w - w) // 2, tile.y + (tile.h - h) // 2, w, h)


def ratio_within(tile: TileRectangle, inner: TileRectangle, ratio: float) -> TileRectangle:
    """Rectangle around an inner one, up to a share `ratio` of the way to the tile's edges."""
    w, h = (
        n + 2 * mm((whole - n) * ratio / 2 / MM)
        for n, whole in ((inner.w, tile.w), (inner.h, tile.h))
    )
    return rectangle_within(tile, w, h)


def level_ground(tile: TileRectangle, children: Any, **more: Any) -> Members:
    """Members of level ground with children in a grid of millimetres."""
    base = {"type": "ground", "vScale": 1, **more}
    return {**base, "cells": [tile.w, tile.h], "children": children}


# --- boxes -------------------------------------------------------------------------------------


def box_lines(boxes: Iterable[Box], raised: float = 0.0) -> TextLines:
    """Elements of boxes, each as a line of text; boxes without height or area are left out.

    Args:
        boxes: boxes that do not overlap, as heights add up.
        raised: height added to each box, m.
    """
    items = []
    for (x, y, w, h), height in boxes:
        z = round(height + raised, DIGITS)
        if z and w and h:
            items.append(
                f'{{ "cellX": {x}, "cellY": {y}, "span": [{w}, {h}], "type": "level", '
                f'"vScale": {_number(z)} }}'
            )
    return TextLines(tuple(items))


def _number(value: float) -> str:
    """Number as the canonical layout has it: 0.5, 2, 1e-4."""
    return repr(int(value)) if value == int(value) else repr(value)


def without(plan: TileRectangle, hole: TileRectangle) -> Iterator[TileRectangle]:
    """Up to four rectangles that cover the area of one rectangle outside of another."""
    west, east = max(plan.x, hole.x), min(plan.x + plan.w, hole.x + hole.w)
    south, north = max(plan.y, hole.y), min(plan.y + plan.h, hole.y + hole.h)
    if west >= east or south >= north:
        yield plan
        return
    parts = (
        TileRectangle(plan.x, plan.y, plan.w, south - plan.y),
        TileRectangle(plan.x, south, west - plan.x, north - south),
        TileRectangle(east, south, plan.x + plan.w - east, north - south),
        TileRectangle(plan.x, north, plan.w, plan.y + plan.h - north),
    )
    yield from (part for part in parts if part.w > 0 and part.h > 0)


def outside(boxes: Iterable[Box], holes: Sequence[TileRectangle]) -> list[Box]:
    """Boxes that cover the areas of boxes outside of all holes."""
    kept = list(boxes)
    for hole in holes:
        kept = [Box(part, height) for plan, height in kept for part in without(plan, hole)]
    return kept


def frame(outer: TileRectangle, thickness: int, height: float) -> list[Box]:
    """Four boxes along the inner edges of a rectangle; their thickness in mm, their height in m."""
    return [Box(plan, height) for plan in without(outer, outer.inset(thickness))]


def corners(tile: TileRectangle, arms: float) -> list[TileRectangle]:
    """Four corners of a tile beside the arms of a cross through its middle, `arms` m wide."""
    middle = square(tile, arms)
    w, h = middle.x - tile.x, middle.y - tile.y
    places = itertools.product(
        (tile.y, tile.y + tile.h - h) if h else (), (tile.x, tile.x + tile.w - w) if w else ()
    )
    return [TileRectangle(x, y, w, h) for y, x in places]


def hole_lines(holes: Iterable[TileRectangle]) -> TextLines:
    """Elements of rectangles without ground, each as a line of text."""
    return TextLines(
        tuple(
            f'{{ "cellX": {x}, "cellY": {y}, "span": [{w}, {h}], "type": "ground", '
            '"surface": "hole", "vScale": 1 }'
            for x, y, w, h in holes
        )
    )


def level_rectangles(levels: NDArray[np.int64], pixel: int) -> list[tuple[TileRectangle, int]]:
    """Rectangles of equal level that cover the pixels that are not at level 0.

    Args:
        levels: (rows, columns) int64 levels, from the south and the west.
        pixel: side of a pixel, mm.
    """
    found = []
    begun: dict[tuple[int, int, int], int] = {}
    for row in range(len(levels) + 1):
        runs = set(_runs(levels[row])) if row < len(levels) else set()
        for run in [run for run in begun if run not in runs]:
            first, end, level = run
            since = begun.pop(run)
            plan = (first, since, end - first, row - since)
            found.append((TileRectangle(*(n * pixel for n in plan)), level))
        for run in sorted(runs):
            begun.setdefault(run, row)
    return found


def _runs(row: NDArray[np.int64]) -> Iterator[tuple[int, int, int]]:
    """Stretches of one level other than 0 in a row: first pixel, end, level."""
    edges = [0, *(np.flatnonzero(np.diff(row)) + 1).tolist(), len(row)]
    for first, end in itertools.pairwise(edges):
        if row[first]:
            yield first, end, int(row[first])


# --- relief ------------------------------------------------------------------------------------


def relief(
    name: str, plan: TileRectangle, heights: NDArray[np.int64], step: float, lowest: float
) -> TileShape:
    """Heights at the nodes of a grid, bilinear in between.

    Args:
        name: name of the primitive.
        plan: rectangle whose corners are the outermost nodes.
        heights: (rows, columns) int64 from the south and the west, 0 or more, in steps.
        step: height of a step, m.
        lowest: height that 0 stands for, m.
    """
    element = {
        **plan.place, "descr": "Random heights", "type": name, "vScale": step, "vOffset": lowest,
    }  # fmt: skip
    if not lowest:
        del element["vOffset"]
    rows = tuple(f"[{', '.join(map(str, row))}]" for row in heights[::-1].tolist())
    descr = f"{len(rows)} rows of random heights, in steps of {step:g} m"
    return TileShape(element, {name: {"descr": descr, "grid": TextLines(rows)}})


# --- pyramids ------------------------------------------------------------------------------------


def _curve(points: Iterable[tuple[float, float]]) -> list[list[float]]:
    """Knots of a curve through points; level before a first point after t = 0 and after a last."""
    knots = [[round(t, 9), round(z, 9)] for t, z in points]
    if knots[0][0] > 0.0:
        knots.insert(0, [0, knots[0][1]])
    if knots[-1][0] < 1.0:
        knots.append([1, knots[-1][1]])
    return [[t if t != int(t) else int(t), z if z != int(z) else int(z)] for t, z in knots]


def _with_mirror_image(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Points up to the middle and their mirror image behind; a point in the middle stands once."""
    behind = [(1.0 - t, z) for t, z in reversed(points)]
    return [*points, *(behind[1:] if points[-1][0] == 0.5 else behind)]


def stairs(tile: TileRectangle, border: int, width: int, steps: int) -> Members:
    """Primitive of stairs on four sides, whose heights count steps.

    Args:
        tile: rectangle that the stairs fill.
        border: distance from the tile's edges to the first step, mm.
        width: depth of a step, mm.
        steps: number of risers.
    """

    def across(side: int) -> list[list[float]]:
        points = [
            ((border + k * width) / side, float(level))
            for k in range(steps)
            for level in (k, k + 1)
        ]
        # without a border the first riser is the tile's edge
        return _curve(_with_mirror_image(points if border else points[1:]))

    primitive = {
        "descr": f"Steps on four sides: the height is counted in steps, of which there are {steps}",
        "x": across(tile.w),
        "y": [] if tile.w == tile.h else across(tile.h),
        "combine": "min",
    }
    return {**primitive, "x-ignore": ["TT306"]} if steps > 1 else primitive


def pyramid_slope(name: str, tile: TileRectangle, border: int, platform: float) -> TileShape:
    """Even slopes of 1 along the axes, as high as the published generators make them.

    The height is w/2 · min(X·Y, c): X and Y rise from 0 at the border to 1 in the middle, and c
    is X·Y at the platform's corners, so that the platform is larger than a square, with a curved
    rim. X·Y up to c is a product of two curves. Above, each row along y is a trapezoid along x, and
    rows are joined by straight lines.

    Args:
        name: beginning of the names of the primitives.
        tile: rectangle that the slopes fill.
        border: width of the level border, mm.
        platform: side of the platform, m.
    """
    inner = tile.inset(border)
    x_rim, y_rim = (1.0 - mm(platform) / side for side in (inner.w, inner.h))
    cut = x_rim * y_rim
    rows = HYPERBOLA_ROWS if cut < 1.0 else 0
    ways = [cut + (1.0 - cut) * k / max(1, rows) for k in range(rows + 1)]

    def at(way: float, side: int) -> float:
        """Position from the edge where X, or Y, reaches `way`, mm."""
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
        # a row is a strip of whole mm, up to the rows beside it; the last row lies on both sides
        first = math.floor(hat[0][0])
        end = math.ceil(hat[-1][0]) if k < rows else tile.h - first
        strip = [((y - first) / (end - first), z) for y, z in hat]
        primitives[own] = {
            "x": _curve(_with_mirror_image(along)),
            "y": _curve(strip if k < rows else _with_mirror_image(strip)),
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
    return TileShape(element, primitives)
