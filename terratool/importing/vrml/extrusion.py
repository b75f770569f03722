"""Cross-sections drawn along a spine (VRML97, 6.18)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.importing.vrml.rotations import rotation
from terratool.importing.vrml.shapes import ShapeMesh, halved
from terratool.kernels import importing as kernels

_STRAIGHT = 1e-7
"""Sine of the angle below which the segments of a spine lie on one line: float32 knows no less."""


def extrusion(
    section: NDArray[np.float64],
    spine: NDArray[np.float64],
    scales: NDArray[np.float64],
    turns: NDArray[np.float64],
    begin: bool,
    end: bool,
) -> ShapeMesh:
    """Sides and caps, seen from outside where the section runs counterclockwise from above.

    Args:
        section: (n, 2) float64, x and z; n is 2 or more.
        spine: (m, 3) float64; m is 2 or more.
        scales: (m, 2) float64, or (1, 2) for all points of the spine.
        turns: (m, 4) or (1, 4) float64, axis and angle relative to the plane of the section.
        begin: whether there is a cap at the first point of the spine.
        end: whether there is one at the last.
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
    # what is closed has its first vertices for its last ones, too
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
    faces = [halved(quads)]
    if begin:
        faces.append(kernels.triangulate(vertices, (rows[0] + around)[::-1].copy())[0])
    if end:
        faces.append(kernels.triangulate(vertices, rows[-1] + around)[0])
    return ShapeMesh(vertices, np.concatenate(faces))


def planes_along(spine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Planes of the cross-sections: matrices whose columns are their x, y and z axes.

    Where all of the spine is on one line, all turn the y axis to its first segment; about the z
    axis if that points down, which the standard leaves open and Coin does so.

    Args:
        spine: (m, 3) float64.

    Returns:
        (m, 3, 3) float64, one for each point; points that coincide have one together.
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
    each: NDArray[np.float64] = planes[own]
    return each


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.sqrt((vectors**2).sum(axis=1, keepdims=True))
    unit: NDArray[np.float64] = vectors / lengths
    return unit


def _turn_from_y(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest turn of the y axis to a direction of length 1."""
    x, y, z = direction.tolist()
    across = math.hypot(x, z)
    if across == 0:
        return np.diag([1.0, 1.0, 1.0] if y > 0 else [-1.0, -1.0, 1.0])
    return rotation(np.array([z, 0.0, -x]), math.atan2(across, y))
