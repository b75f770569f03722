"""Boxes, cones, cylinders, spheres and grids of heights as triangles, y up as in VRML97.

Each is its vertices, (n, 3) float64, and its faces, (m, 3) int32, counterclockwise from outside.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SIDES = 64
"""Sides of the polygon that stands for a circle; its corners lie on it."""


class ShapeMesh(NamedTuple):
    """Vertices (n, 3) float64, and faces (m, 3) int32."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def box(size: NDArray[np.float64]) -> ShapeMesh:
    """A box around the origin; `size` is (3,)."""
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = np.array(
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
        np.int32,
    )
    return ShapeMesh(np.array(signs) * (size / 2), halved(quads))


def cone(radius: float, height: float, side: bool, bottom: bool) -> ShapeMesh:
    """A cone around the y axis, half of its height below the origin."""
    rim = _circle(radius, -height / 2)
    vertices = np.vstack((rim, (0, height / 2, 0), (0, -height / 2, 0)))
    faces = [_fan(SIDES, False)] * side + [_fan(SIDES + 1, True)] * bottom
    return ShapeMesh(vertices, _joined(faces))


def cylinder(radius: float, height: float, side: bool, bottom: bool, top: bool) -> ShapeMesh:
    """A cylinder around the y axis, half of its height below the origin."""
    vertices = np.vstack(
        (
            _circle(radius, -height / 2),
            _circle(radius, height / 2),
            (0, -height / 2, 0),
            (0, height / 2, 0),
        )
    )
    one = np.arange(SIDES, dtype=np.int32)
    two = (one + 1) % SIDES
    quads = np.column_stack((one, two, two + SIDES, one + SIDES))
    faces = [halved(quads)] * side + [_fan(2 * SIDES, True)] * bottom
    faces += [_fan(2 * SIDES + 1, False, SIDES)] * top
    return ShapeMesh(vertices, _joined(faces))


def sphere(radius: float) -> ShapeMesh:
    """A sphere around the origin: circles of latitude in steps of 180° by half of `SIDES`."""
    rows = SIDES // 2
    angles = np.linspace(-math.pi / 2, math.pi / 2, rows + 1)[1:-1]
    rings = [_circle(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    vertices = np.vstack((*rings, (0, -radius, 0), (0, radius, 0)))
    one = np.arange((rows - 2) * SIDES, dtype=np.int32)
    two = one // SIDES * SIDES + (one + 1) % SIDES
    quads = np.column_stack((one, two, two + SIDES, one + SIDES))
    poles = len(vertices) - 2
    bottom, top = _fan(poles, True), _fan(poles + 1, False, (rows - 2) * SIDES)
    return ShapeMesh(vertices, _joined([halved(quads), bottom, top]))


def elevation_grid(heights: NDArray[np.float64], across: float, along: float) -> ShapeMesh:
    """A grid of heights over the plane y = 0; squares are cut from least x and most z.

    That is how Coin cuts them; the standard leaves it open.

    Args:
        heights: (rows, columns) float64, along y; rows follow each other along z.
        across: spacing along x.
        along: spacing along z.
    """
    rows, columns = heights.shape
    vertices = np.empty((rows, columns, 3))
    vertices[..., 0] = np.arange(columns) * across
    vertices[..., 1] = heights
    vertices[..., 2] = np.arange(rows)[:, None] * along
    numbers = np.arange(heights.size, dtype=np.int32).reshape(rows, columns)
    north, south = numbers[:-1], numbers[1:]
    around = (south[:, :-1], south[:, 1:], north[:, 1:], north[:, :-1])
    quads = np.stack(around, axis=-1).reshape(-1, 4)
    return ShapeMesh(vertices.reshape(-1, 3), halved(quads))


def _circle(radius: float, y: float) -> NDArray[np.float64]:
    """Counterclockwise as seen from above, that is from x to -z."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    return np.column_stack((radius * np.cos(angles), np.full(SIDES, y), -radius * np.sin(angles)))


def halved(quads: NDArray[np.int32]) -> NDArray[np.int32]:
    """Two triangles of each quadrilateral, (2 m, 3), cut from the first to the third corner."""
    faces = np.empty((len(quads), 2, 3), np.int32)
    faces[:, 0] = quads[:, :3]
    faces[:, 1, 0] = quads[:, 0]
    faces[:, 1, 1:] = quads[:, 2:]
    return faces.reshape(-1, 3)


def _fan(middle: int, turned: bool, first: int = 0) -> NDArray[np.int32]:
    """Triangles from a vertex to the circle from `first` on; `turned` to be seen from below."""
    one = np.arange(SIDES, dtype=np.int32)
    two = (one + 1) % SIDES
    rim = (two, one) if turned else (one, two)
    return np.column_stack((*(first + end for end in rim), np.full(SIDES, middle, np.int32)))


def _joined(faces: list[NDArray[np.int32]]) -> NDArray[np.int32]:
    return np.concatenate([np.empty((0, 3), np.int32), *faces])
