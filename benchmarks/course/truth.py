"""The course by its measures, without terratool: all representations are held against it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LENGTH, WIDTH = 12.0, 3.0
HIGHEST = 0.85
SURFACES = {"asphalt": 38.0, "concrete": 35.0, "wood": 27.0}
"""Friction angles, degrees."""
_TURN = math.radians(20.0)


class Solid(NamedTuple):
    """A block, seen from above a rectangle.

    Attributes:
        middle: of the rectangle, m.
        sides: along its own axes, m.
        heights: at its ends along its own x, m.
        surface: what covers it.
        turn: counterclockwise, radians.
    """

    middle: tuple[float, float]
    sides: tuple[float, float]
    heights: tuple[float, float]
    surface: str
    turn: float = 0.0

    def local(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Along its own axes, from its middle."""
        dx, dy = x - self.middle[0], y - self.middle[1]
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return dx * cos + dy * sin, dy * cos - dx * sin


def _across(west: float, east: float, heights: tuple[float, float], surface: str) -> Solid:
    return Solid(((west + east) / 2, 1.4), (east - west, 2.0), heights, surface)


SOLIDS = (
    Solid((0.575, 1.5), (0.15, 4.0), (0.12, 0.12), "concrete"),  # past both borders
    *(_across(1.2 + 0.3 * n, 1.5 + 0.3 * n, (0.17 * (n + 1),) * 2, "concrete") for n in range(5)),
    _across(2.7, 3.7, (0.85, 0.85), "concrete"),
    _across(3.7, 10.5, (0.85, 0.0), "wood"),
    Solid((11.25, 1.7), (0.6, 0.4), (0.35, 0.35), "wood", _TURN),
)


def _inside(x: Array, y: Array) -> Iterator[tuple[Solid, Array, NDArray[np.bool_]]]:
    """Each solid, how far points are along it from 0 to 1, and which are in it.

    Western and southern edges belong to it, with what rounding takes from them; others do not.
    """
    for solid in SOLIDS:
        (u, v), (w, h), edge = solid.local(x, y), solid.sides, 1e-9
        held = (u >= -w / 2 - edge) & (u < w / 2 - edge) & (v >= -h / 2 - edge) & (v < h / 2 - edge)
        yield solid, u / w + 0.5, held


def height(x: Array, y: Array) -> Array:
    """Height of the ground at points of the course, m."""
    z = np.zeros(np.broadcast(x, y).shape)
    for solid, along, held in _inside(x, y):
        low, high = solid.heights
        z = np.where(held, low + (high - low) * along, z)
    return z


def friction(x: Array, y: Array) -> Array:
    """Coefficient of friction at points of the course."""
    mu = np.full(np.broadcast(x, y).shape, math.tan(math.radians(SURFACES["asphalt"])))
    for solid, _, held in _inside(x, y):
        mu = np.where(held, math.tan(math.radians(SURFACES[solid.surface])), mu)
    return mu


def _corners(solid: Solid) -> Array:
    """The corners of a solid, counterclockwise from its own south-west, (4, 2)."""
    u, v = (np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * solid.sides).T / 2
    cos, sin = math.cos(solid.turn), math.sin(solid.turn)
    return np.stack([u * cos - v * sin, u * sin + v * cos], axis=1) + solid.middle


def walls() -> Array:
    """Walls as segments on the ground: x and y of one end and of the other, (walls, 4)."""
    found = []
    for solid in SOLIDS:
        ends = _corners(solid)
        for begin, end in zip(ends, np.roll(ends, -1, axis=0), strict=True):
            middle, way = (begin + end) / 2, (end - begin) / np.linalg.norm(end - begin)
            aside = 1e-6 * np.array([-way[1], way[0]])
            x, y = np.array([middle + aside, middle - aside]).T
            inside, outside = height(x, y)
            if inside > outside + 1e-3 and np.all((y > 0.0) & (y < WIDTH)):
                found.append([*begin, *end])
    return np.clip(found, 0.0, [LENGTH, WIDTH, LENGTH, WIDTH])
