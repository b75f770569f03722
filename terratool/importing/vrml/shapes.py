"""Triangles of the shapes of VRML97 and X3D, and poses; y up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import importing as kernels

Matrix = NDArray[np.float64]
SIDES = 64
"""Sides of the polygon that stands for a circle; its corners lie on the circle."""

_STRAIGHT = 1e-7
"""Sine of the angle below which segments of a spine lie on one line, which float32 cannot resolve.
"""


def rotation(axis: NDArray[np.float64], angle: float) -> Matrix:
    """Return the rotation about an axis by Rodrigues' formula, (3, 3); no rotation for axis 0.

    Args:
        axis: (3,) of any length.
        angle: angle in radians, counterclockwise where the axis points at the viewer.
    """
    largest = float(np.abs(axis).max()) if angle else 0
    if not largest:
        return np.eye(3)
    axis = axis / largest
    x, y, z = (axis / math.sqrt(float(axis @ axis))).tolist()
    cross = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross))


def pose(
    center: NDArray[np.float64],
    turn: NDArray[np.float64],
    scale: NDArray[np.float64],
    scale_turn: NDArray[np.float64],
    translation: NDArray[np.float64],
) -> Matrix:
    """Return the matrix of a Transform, (3, 4): T C R SR S SR⁻¹ C⁻¹ (VRML97, 6.52).

    Args:
        center: (3,), the fixed point of rotation and scaling.
        turn: axis and angle of the rotation, (4,).
        scale: factors along the axes, (3,).
        scale_turn: axis and angle, (4,), that turn the axes along which it scales.
        translation: (3,).
    """
    linear = np.diag(scale)
    if scale_turn[3]:
        along = rotation(scale_turn[:3], float(scale_turn[3]))
        linear = (along * scale) @ along.T
    if turn[3]:
        linear = rotation(turn[:3], float(turn[3])) @ linear
    return np.column_stack((linear, translation + center - linear @ center))


def product(outer: Matrix, inner: Matrix) -> Matrix:
    """Return the pose in the world of a pose within another one, all (3, 4)."""
    linear = outer[:, :3] @ inner[:, :3]
    return np.column_stack((linear, outer[:, :3] @ inner[:, 3] + outer[:, 3]))


def transform(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points, (n, 3), transformed by a pose, (3, 4)."""
    x, y, z = points.T
    # BLAS would add in an order that depends on the machine
    return np.column_stack([a * x + b * y + c * z + d for a, b, c, d in pose.tolist()])


class ShapeMesh(NamedTuple):
    """Vertices (n, 3) float64, and faces (m, 3) int32."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def placed(mesh: ShapeMesh, pose: Matrix) -> ShapeMesh:
    """Return a mesh in a pose, (3, 4); a mirror keeps its outside outside."""
    faces = mesh.faces[:, ::-1] if np.linalg.det(pose[:, :3]) < 0 else mesh.faces
    return ShapeMesh(transform(pose, mesh.vertices), faces)


def box(size: NDArray[np.float64]) -> ShapeMesh:
    """Return a box around the origin with sides `size`, (3,)."""
    signs = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = np.array(
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
        np.int32,
    )
    return ShapeMesh(np.array(signs) * (size / 2), halve_quads(quads))


def cone(radius: float, height: float, side: bool, bottom: bool) -> ShapeMesh:
    """Return a cone around the y axis, half of its height below the origin."""
    circle = _circle(radius, -height / 2)
    vertices = np.vstack((circle, (0, height / 2, 0), (0, -height / 2, 0)))
    faces = [_fan(SIDES, False)] * side + [_fan(SIDES + 1, True)] * bottom
    return ShapeMesh(vertices, _join_faces(faces))


def cylinder(radius: float, height: float, side: bool, bottom: bool, top: bool) -> ShapeMesh:
    """Return a cylinder around the y axis, half of its height below the origin."""
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
    faces = [halve_quads(quads)] * side + [_fan(2 * SIDES, True)] * bottom
    faces += [_fan(2 * SIDES + 1, False, SIDES)] * top
    return ShapeMesh(vertices, _join_faces(faces))


def sphere(radius: float) -> ShapeMesh:
    """Return a sphere around the origin: circles of latitude, half as many as `SIDES`, less one."""
    rows = SIDES // 2
    angles = np.linspace(-math.pi / 2, math.pi / 2, rows + 1)[1:-1]
    rings = [_circle(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    vertices = np.vstack((*rings, (0, -radius, 0), (0, radius, 0)))
    one = np.arange((rows - 2) * SIDES, dtype=np.int32)
    two = one // SIDES * SIDES + (one + 1) % SIDES
    quads = np.column_stack((one, two, two + SIDES, one + SIDES))
    poles = len(vertices) - 2
    bottom, top = _fan(poles, True), _fan(poles + 1, False, (rows - 2) * SIDES)
    return ShapeMesh(vertices, _join_faces([halve_quads(quads), bottom, top]))


def elevation_grid(heights: NDArray[np.float64], across: float, along: float) -> ShapeMesh:
    """Return a grid of heights over the plane y = 0, squares cut from least x and most z.

    The standard leaves the cut open; Coin cuts them so.

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
    return ShapeMesh(vertices.reshape(-1, 3), halve_quads(quads))


Ints = NDArray[np.int32]


class FaceRule(NamedTuple):
    """Rule by which a node of X3D makes triangles of points.

    Attributes:
        numbers: field with the points' indices; "" to take points in order.
        counts: field with the number of points of each strip or fan; "" for none.
        faces: returns (m, 3) vertex indices for (n,) indices and the counts.
    """

    numbers: str
    counts: str
    faces: Callable[[Ints, NDArray[np.float64] | None], Ints]


def _by_threes(numbers: Ints, _: object) -> Ints:
    """Return whole triangles (11.4.8); leftover indices make none."""
    return _drop_negative(numbers[: len(numbers) // 3 * 3].reshape(-1, 3))


def _by_fours(numbers: Ints, _: object) -> Ints:
    return _drop_negative(halve_quads(numbers[: len(numbers) // 4 * 4].reshape(-1, 4)))


def _strips(numbers: Ints, counts: NDArray[np.float64] | None) -> Ints:
    """Return triangles of each corner and the two before, every second one reversed (11.4.10)."""
    place = _places(numbers, counts)
    ends = np.flatnonzero((place >= 2) & (numbers >= 0))
    before, last = numbers[ends - 2], numbers[ends - 1]
    odd = place[ends] % 2 == 1
    faces = np.column_stack((np.where(odd, last, before), np.where(odd, before, last)))
    return _drop_negative(np.column_stack((faces, numbers[ends])))


def _fans(numbers: Ints, counts: NDArray[np.float64] | None) -> Ints:
    """Return triangles of each corner, the one before it and the first (11.4.7)."""
    place = _places(numbers, counts)
    ends = np.flatnonzero((place >= 2) & (numbers >= 0))
    return _drop_negative(
        np.column_stack((numbers[ends - place[ends]], numbers[ends - 1], numbers[ends]))
    )


def _places(numbers: Ints, counts: NDArray[np.float64] | None) -> NDArray[np.int64]:
    """Return the position of each corner in its strip or fan, which a number below 0 ends."""
    everywhere = np.arange(len(numbers))
    begins = np.zeros(len(numbers), np.int64)
    if counts is None:
        ends = np.flatnonzero(numbers[:-1] < 0) + 1
    else:
        ends = np.cumsum(counts).astype(np.int64)[:-1]
    begins[ends] = ends
    return everywhere - np.maximum.accumulate(begins)


def _drop_negative(faces: Ints) -> Ints:
    """Return faces without those that have a corner below 0."""
    return np.ascontiguousarray(faces[(faces >= 0).all(axis=1)], np.int32)


PARTS = {
    "IndexedQuadSet": FaceRule("index", "", _by_fours),
    "IndexedTriangleFanSet": FaceRule("index", "", _fans),
    "IndexedTriangleSet": FaceRule("index", "", _by_threes),
    "IndexedTriangleStripSet": FaceRule("index", "", _strips),
    "QuadSet": FaceRule("", "", _by_fours),
    "TriangleFanSet": FaceRule("", "fanCount", _fans),
    "TriangleSet": FaceRule("", "", _by_threes),
    "TriangleStripSet": FaceRule("", "stripCount", _strips),
}
"""Rules by node of X3D, for nodes that VRML97 does not have."""


def _circle(radius: float, y: float) -> NDArray[np.float64]:
    """Return the corners of a circle, counterclockwise as seen from above, that is from x to -z."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    return np.column_stack((radius * np.cos(angles), np.full(SIDES, y), -radius * np.sin(angles)))


def halve_quads(quads: NDArray[np.int32]) -> NDArray[np.int32]:
    """Cut each quadrilateral into two triangles, (2 m, 3), from the first to the third corner."""
    faces = np.empty((len(quads), 2, 3), np.int32)
    faces[:, 0] = quads[:, :3]
    faces[:, 1, 0] = quads[:, 0]
    faces[:, 1, 1:] = quads[:, 2:]
    return faces.reshape(-1, 3)


def _fan(middle: int, turned: bool, first: int = 0) -> NDArray[np.int32]:
    """Return triangles from a vertex to the circle at `first`, seen from below if `turned`."""
    one = np.arange(SIDES, dtype=np.int32)
    two = (one + 1) % SIDES
    ends = (two, one) if turned else (one, two)
    return np.column_stack((*(first + end for end in ends), np.full(SIDES, middle, np.int32)))


def _join_faces(faces: list[NDArray[np.int32]]) -> NDArray[np.int32]:
    return np.concatenate([np.empty((0, 3), np.int32), *faces])


def extrusion(
    section: NDArray[np.float64],
    spine: NDArray[np.float64],
    scales: NDArray[np.float64],
    turns: NDArray[np.float64],
    begin: bool,
    end: bool,
) -> ShapeMesh:
    """Return sides and caps, seen from outside where the section runs counterclockwise from above.

    Args:
        section: (n, 2) float64, x and z; n is 2 or more.
        spine: (m, 3) float64; m is 2 or more.
        scales: (m, 2) float64, or (1, 2) for all points of the spine.
        turns: (m, 4) or (1, 4) float64, axis and angle relative to the plane of the section.
        begin: whether there is a cap at the first point of the spine.
        end: whether there is a cap at the last point.
    """
    count, length = len(section), len(spine)
    flat = np.zeros((count, 3))
    rings = []
    planes = planes_along(spine)
    for n in range(length):
        flat[:, ::2] = section * scales[n if len(scales) > 1 else 0]
        x, y, z, angle = turns[n if len(turns) > 1 else 0].tolist()
        linear = planes[n] @ rotation(np.array([x, y, z]), angle)
        rings.append(flat @ linear.T + spine[n])
    vertices = np.concatenate(rings)
    # a closed section or spine shares its first vertices with its last ones
    columns = np.arange(count, dtype=np.int32)
    closed = count > 2 and bool((section[0] == section[-1]).all())
    if closed:
        columns[-1] = 0
    rows = np.arange(length, dtype=np.int32) * np.int32(count)
    if length > 2 and bool((rings[0] == rings[-1]).all()):
        rows[-1] = 0
    low, high = rows[:-1, None], rows[1:, None]
    one, two = columns[:-1], columns[1:]
    quads = np.stack((low + one, low + two, high + two, high + one), axis=-1).reshape(-1, 4)
    around = columns[:-1] if closed else columns
    faces = [halve_quads(quads)]
    if begin:
        faces.append(kernels.triangulate(vertices, (rows[0] + around)[::-1].copy())[0])
    if end:
        faces.append(kernels.triangulate(vertices, rows[-1] + around)[0])
    return ShapeMesh(vertices, np.concatenate(faces))


def planes_along(spine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the planes of the cross-sections: matrices whose columns are their x, y and z axes.

    If the whole spine lies on one line, all planes turn the y axis to its first segment; about the
    z axis if that points down. The standard leaves this open; Coin does so.

    Args:
        spine: (m, 3) float64.

    Returns:
        (m, 3, 3) float64, one plane for each point; coinciding points share one.
    """
    moves = np.ones(len(spine), np.bool_)
    moves[1:] = (spine[1:] != spine[:-1]).any(axis=1)
    own = np.cumsum(moves) - 1
    points = spine[moves]
    if len(points) == 1:
        return np.broadcast_to(np.eye(3), (len(spine), 3, 3))
    steps = _unit(points[1:] - points[:-1])
    closed = bool((points[0] == points[-1]).all())
    # segments before and behind each point; y runs from neighbour to neighbour
    before, behind = np.vstack((steps[-1], steps)), np.vstack((steps, steps[0]))
    normals = np.cross(behind, -before)
    middle = np.zeros_like(points)
    middle[1:-1] = points[2:] - points[:-2]
    if closed:
        middle[0] = middle[-1] = points[1] - points[-2]
    else:
        normals[0] = normals[-1] = 0
        middle[0], middle[-1] = steps[0], steps[-1]
    bent = np.sqrt((normals**2).sum(axis=1)) > _STRAIGHT
    if not bent.any():
        return np.broadcast_to(_turn_from_y(steps[0]), (len(spine), 3, 3))
    first = int(np.argmax(bent))
    z = normals[first]
    y = steps[0]
    planes = np.empty((len(points), 3, 3))
    for n in range(len(points)):
        if bent[n]:
            z = -normals[n] if normals[n] @ z < 0 else normals[n]
        if middle[n].any():
            y = middle[n]
        axes = _unit(np.array([np.cross(y, z), y, z]))
        planes[n] = axes.T
    if closed:
        planes[-1] = planes[0]
    return np.asarray(planes[own])


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.sqrt((vectors**2).sum(axis=1, keepdims=True)))


def _turn_from_y(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the smallest rotation of the y axis to a direction of length 1, (3, 3)."""
    x, y, z = direction.tolist()
    across = math.hypot(x, z)
    if across == 0:
        return np.diag([1.0, 1.0, 1.0] if y > 0 else [-1.0, -1.0, 1.0])
    return rotation(np.array([z, 0.0, -x]), math.atan2(across, y))
