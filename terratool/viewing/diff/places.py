"""Places of elements in the world, and the rectangles in which they can have an effect."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.findings import Bounds
from terratool.definition.model import pair_of
from terratool.definition.tree import Tree


class ComparedPlace(NamedTuple):
    """Place of an element, with what follows from the elements around it.

    Attributes:
        bounds: world rectangle of the cell; in a part, with a cell of side 1 for the part.
        surface: name of the surface; None where it is not known.
        cover: world rectangle that holds all copies; None if neither the element nor one around it
            is copied.
    """

    bounds: Bounds
    surface: Any
    cover: Bounds | None


def child_place(tree: Tree, index: int, parent: int, at: ComparedPlace) -> ComparedPlace:
    """Place of a child, from that of its parent."""
    west, south, east, north = at.bounds
    place = tree.value("at", index)
    if place is not UNSET:
        extent = tree.value("extent", index)
        w, h = pair_of(extent, 0.0)
        x, y = west + place[0], south + place[1]
        box = x - w / 2, y - h / 2, x + w / 2, y + h / 2
    else:
        nx, ny = tree.grid(parent)
        x, y, w, h = tree.block(index)
        wide, tall = east - west, north - south
        box = (
            west + wide * x / nx, south + tall * y / ny,
            west + wide * (x + w) / nx, south + tall * (y + h) / ny,
        )  # fmt: skip
    surface = tree.value("surface", index)
    cover = at.cover
    copied = tree.value("repeat", index) is not UNSET or tree.value("scatter", index) is not UNSET
    if cover is None and copied:
        cover = at.bounds
    return ComparedPlace(box, at.surface if surface is UNSET else surface, cover)


def reach_of(tree: Tree, index: int, at: ComparedPlace) -> Bounds:
    """World rectangle in which an element, all in it and its copies can have an effect."""
    if at.cover is not None:
        return at.cover
    turn = tree.value("turn_deg", index)
    if tree.value("at", index) is UNSET or turn is UNSET or math.fmod(turn, 180.0) == 0.0:
        return at.bounds
    west, south, east, north = at.bounds
    x, y = (west + east) / 2, (south + north) / 2
    angle = math.radians(math.fmod(turn, 180.0))
    cos, sin = abs(math.cos(angle)) / 2, abs(math.sin(angle)) / 2
    wide, tall = east - west, north - south
    across, up = cos * wide + sin * tall, sin * wide + cos * tall
    begin, end = tree.brood(index)
    if begin < end or tree.value("part", index) is not UNSET:
        # elements in it may fill the cell as it was before the turn
        across, up = max(across, wide / 2), max(up, tall / 2)
    return x - across, y - up, x + across, y + up


def within_cell(box: Bounds, around: Bounds) -> Hashable:
    """Sides of a rectangle relative to another, in shares of its longer side, nine digits."""
    side = max(around[2] - around[0], around[3] - around[1]) or 1.0
    west, south = around[:2]
    return tuple(
        round((value - low) / side, 9)
        for value, low in zip(box, (west, south, west, south), strict=True)
    )


def round_box(box: Bounds) -> Hashable:
    """Round the sides of a rectangle to nine digits, so that equal ones compare equal."""
    return tuple(round(value, 9) for value in box)


def way_between(box: Bounds, other: Bounds) -> Hashable:
    """Displacements of the sides between two rectangles, in shares of the first's longer side."""
    side = max(box[2] - box[0], box[3] - box[1], 1e-300)
    return tuple(round((other[k] - box[k]) / side, 6) for k in range(4))


def distance(box: Bounds, other: Bounds) -> float:
    """Twice the distance between the middles of two rectangles."""
    return math.hypot(box[0] + box[2] - other[0] - other[2], box[1] + box[3] - other[1] - other[3])


def overlap(box: Bounds, other: Bounds) -> bool:
    """Whether two rectangles share an area."""
    return box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3]
