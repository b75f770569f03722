"""Where vertical walls of a mesh run all across a patch, so that a curve can have a step there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.field.parts import Bounds
from terratool.importing.triangles import Triangles

NEAR = 1e-6
"""Positions that differ by no more than this part of a side of the patch are one."""


def steps(triangles: Triangles, bounds: Bounds) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Vertical walls that stand across the whole of a patch, parallel to one of its sides.

    A wall may consist of any number of vertical faces in one plane that together leave no gap, be
    they above one another or hidden by something higher. Walls on the rim of the patch do not
    count, as there is nothing beyond them.

    Args:
        triangles: a mesh, z up.
        bounds: west, south, east, north of the patch.

    Returns:
        The x of walls that run from south to north, and the y of those from west to east: two
        float64 arrays in world coordinates, sorted, without duplicates; empty for none.
    """
    west, south, east, north = bounds
    return (
        _across(triangles, 0, (west, east), (south, north)),
        _across(triangles, 1, (south, north), (west, east)),
    )


def _across(
    triangles: Triangles, axis: int, side: tuple[float, float], other: tuple[float, float]
) -> NDArray[np.float64]:
    """Positions on one axis at which walls cover a range of the other one."""
    near, gap = NEAR * (side[1] - side[0]), NEAR * (other[1] - other[0])
    low, high = _range(triangles, axis)
    begin, end = _range(triangles, 1 - axis)
    bottom, top = _range(triangles, 2)
    middle = 0.5 * (low + high)
    chosen = (high - low <= near) & (top > bottom) & (end > begin)
    chosen &= (middle > side[0] + near) & (middle < side[1] - near)
    chosen &= (end >= other[0]) & (begin <= other[1])
    where = np.flatnonzero(chosen)
    where = where[np.argsort(middle[where], kind="stable")]
    planes = np.split(where, np.flatnonzero(np.diff(middle[where]) > near) + 1)
    found = [
        0.5 * (middle[plane[0]] + middle[plane[-1]])
        for plane in planes
        if len(plane) and _cover(begin[plane], end[plane], other, gap)
    ]
    return np.array(found, np.float64)


def _range(triangles: Triangles, axis: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest coordinate of each face, two (m,) float64."""
    corners = triangles.vertices[:, axis][triangles.faces]
    return corners.min(axis=1), corners.max(axis=1)


def _cover(
    begin: NDArray[np.float64], end: NDArray[np.float64], other: tuple[float, float], gap: float
) -> bool:
    """Whether intervals, (k,) float64 each, leave nothing of another one bare."""
    order = np.argsort(begin, kind="stable")
    begin, reached = begin[order], np.maximum.accumulate(end[order])
    if begin[0] > other[0] + gap or reached[-1] < other[1] - gap:
        return False
    return bool((begin[1:] <= reached[:-1] + gap).all())
