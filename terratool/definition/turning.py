"""Turned rectangles and ellipses in cells of their own sides, and the parts that the cells trim."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeVar

from terratool.definition.model import Pair

CLOSE = 1e-9
"""Share of a side below which a part outside of the cell counts as rounding."""
THINNEST = 1e-150
"""Ratio of the sides below which a shape counts as without area, as the inverse may overflow."""
_CORNERS = (-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)

Point = tuple[float, float]
Whole = TypeVar("Whole", int, Any)
"""A whole number, or an array of int64."""
Block = tuple[Whole, Whole, Whole, Whole]
"""First column and row of a block of cells, and its columns and rows."""


class Turned(NamedTuple):
    """Rectangle or ellipse, turned in a cell of its own sides.

    Attributes:
        lengths: sides of the cell.
        turn: turn, degrees clockwise.
        is_round: whether the shape is an ellipse.
        axes: cosine and sine of the turn.
    """

    lengths: Pair
    turn: float
    is_round: bool
    axes: Pair

    @property
    def reach(self) -> Pair:
        """Half the sides of the bounding box."""
        w, h = self.lengths[0] / 2, self.lengths[1] / 2
        cosine, sine = map(abs, self.axes)
        add = math.hypot if self.is_round else float.__add__
        return add(w * cosine, h * sine), add(w * sine, h * cosine)

    @property
    def beyond(self) -> Pair:
        """Lengths by which the shape reaches out of its cell, along x and along y."""
        return tuple(  # type: ignore[return-value]
            max(0.0, reach - length / 2)
            for reach, length in zip(self.reach, self.lengths, strict=True)
        )

    @property
    def is_trimmed(self) -> bool:
        """Whether any of the shape lies outside its cell."""
        (w, h), (across, along) = self.lengths, self.reach
        if min(w, h) <= THINNEST * max(w, h):
            return False
        return across - w / 2 > CLOSE * w or along - h / 2 > CLOSE * h

    def place(self, x: float, y: float) -> Point:
        """Turned place of a point of the shape; both from the middle, in sides of the cell."""
        (w, h), (cosine, sine) = self.lengths, self.axes
        return x * cosine + y * sine * (h / w), y * cosine - x * sine * (w / h)

    def is_beyond(self, x: float, y: float) -> bool:
        """Whether a point of the shape lies outside its cell after the turn."""
        return max(map(abs, self.place(x, y))) > 0.5 + CLOSE

    @property
    def lost_share(self) -> float:
        """Share of the shape's area that lies outside its cell."""
        if self.is_round:
            # segments, which are disjoint: no ellipse in a cell reaches the cell's corners
            shares = (
                min(1.0, length / 2 / reach)
                for length, reach in zip(self.lengths, self.reach, strict=True)
            )
            return sum(2 / math.pi * (math.acos(k) - k * math.sqrt(1 - k * k)) for k in shares)
        kept = [self.place(*corner) for corner in _CORNERS]
        for axis in (0, 1):
            for side in (-1.0, 1.0):
                kept = _clip(kept, axis, side)
        return 1 - _area(kept)

    def sentence(self) -> str:
        """Sentence on the area that the cell takes off the shape."""
        w, h = self.lengths
        area = w * h * (math.pi / 4 if self.is_round else 1)
        names = ("to the west and east", "to the south and north")
        out = " and ".join(
            f"up to {out:.4g} {name}"
            for out, name, length in zip(self.beyond, names, self.lengths, strict=True)
            if out > CLOSE * length
        )
        what = "ellipse" if self.is_round else "footprint"
        lost = self.lost_share
        return (
            f"the {what} of {w:.6g} × {h:.6g}, turned by {self.turn:.6g} degrees, loses "
            f"{100 * lost:.3g} % to its cell: {area * lost:.4g} of {area:.4g} square units, {out}."
        )


def turned_shape(lengths: Pair, turn: float, is_round: bool) -> Turned:
    """Rectangle or ellipse with these sides, turned; quarter turns are exact."""
    angle = math.fmod(turn, 360.0)
    if angle % 90 == 0:
        axes = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(angle // 90) % 4]
    else:
        axes = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return Turned(lengths, turn, is_round, axes)


def _clip(outline: list[Point], axis: int, side: float) -> list[Point]:
    """Part of a convex polygon within 0.5 of an axis, after Sutherland and Hodgman (1974)."""
    kept: list[Point] = []
    for here, there in zip(outline, [*outline[1:], *outline[:1]], strict=True):
        a, b = here[axis] * side - 0.5, there[axis] * side - 0.5
        if a <= 0:
            kept.append(here)
        if a * b < 0:
            t = a / (a - b)
            kept.append((here[0] + (there[0] - here[0]) * t, here[1] + (there[1] - here[1]) * t))
    return kept


def _area(outline: list[Point]) -> float:
    pairs = zip(outline, [*outline[1:], *outline[:1]], strict=True)
    return abs(sum(x * v - u * y for (x, y), (u, v) in pairs)) / 2


def turn_block(block: Block[Whole], grid: tuple[Whole, Whole], quarters: int) -> Block[Whole]:
    """Turn a block of cells with its grid.

    Args:
        block: first column and row, columns and rows; whole numbers, or arrays of them.
        grid: columns and rows of the grid before the turn.
        quarters: quarter turns clockwise, 0 to 3.
    """
    x, y, w, h = block
    if quarters == 0:
        return block
    right, top = grid[0] - x - w, grid[1] - y - h
    return ((y, right, h, w), (right, top, w, h), (top, x, h, w))[quarters - 1]
