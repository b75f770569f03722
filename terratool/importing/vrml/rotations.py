"""Rotations and the poses of Transforms, as matrices that columns are multiplied by."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def rotation(axis: NDArray[np.float64], angle: float) -> Matrix:
    """A turn about an axis by Rodrigues' formula, (3, 3); none about an axis of no length.

    Args:
        axis: (3,) of any length.
        angle: in radians, counterclockwise where the axis points at the viewer.
    """
    largest = float(np.abs(axis).max()) if angle else 0
    if not largest:
        return np.eye(3)
    axis = axis / largest
    x, y, z = (axis / math.sqrt(float(axis @ axis))).tolist()
    cross = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    turn: Matrix = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)
    return turn


def pose(
    center: NDArray[np.float64],
    turn: NDArray[np.float64],
    scale: NDArray[np.float64],
    scale_turn: NDArray[np.float64],
    translation: NDArray[np.float64],
) -> Matrix:
    """The matrix of a Transform, (3, 4): T C R SR S SR⁻¹ C⁻¹ (VRML97, 6.52).

    Args:
        center: (3,), the point that turning and scaling leave where it is.
        turn: axis and angle, (4,).
        scale: (3,).
        scale_turn: the axes along which it scales, as axis and angle, (4,).
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
    """The pose of what has a pose within another one, both (3, 4)."""
    linear = outer[:, :3] @ inner[:, :3]
    return np.column_stack((linear, outer[:, :3] @ inner[:, 3] + outer[:, 3]))


def placed(pose: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) in a pose (3, 4)."""
    x, y, z = points.T
    # BLAS would add in an order that depends on the machine
    return np.column_stack([a * x + b * y + c * z + d for a, b, c, d in pose.tolist()])
