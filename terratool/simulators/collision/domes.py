"""Discs that end upright, such as boulders, as one convex solid each."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.field.bounds import curve_hulls, curve_pieces
from terratool.field.footprints import outline_of
from terratool.field.records import COMBINE
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.simulators.collision.solids import Floats, Solid

_UPRIGHT = 1000.0
"""Slope of the curve at the edge of a disc above which it ends upright, in its largest values."""
_ROUND = 8, 128
"""Least and most corners of a ring, and half of the most rings."""
_SHARE = 0.35
"""Share of the error that facets may take."""


def take_domes(
    terrain: Terrain, max_error: float, most: int, corner: Floats
) -> tuple[Terrain, list[Solid]]:
    """Return a terrain without domes that are one convex solid each, and these solids.

    Args:
        terrain: terrain with all parts written out.
        max_error: largest distance of a solid from the terrain, square to it.
        most: most solids; the largest domes come first.
        corner: (2,) world position of the zero of the solids.
    """
    arrays = terrain.arrays
    elements = arrays.elements
    upright = np.array([_ends_upright(terrain, kind) for kind in arrays.kinds], np.bool_)
    found = upright[elements["kind"]] & (elements["grid"] == 0) & (elements["scale"] > 0.0)
    found &= elements["offset"] == 0.0
    places = np.flatnonzero(found)
    if not len(places):
        return terrain, []
    sizes = elements["scale"][places]
    solids: list[Solid] = []
    taken: list[int] = []
    cells = terrain.cells().T
    for index in places[np.argsort(-sizes, kind="stable")].tolist():
        if len(solids) == most:
            break
        solid = _dome(terrain, index, cells[index], max_error, corner)
        if solid is not None:
            solids.append(solid)
            taken.append(index)
    bare = elements.copy()
    bare["scale"][taken] = 0.0
    return terrain.with_arrays(arrays._replace(elements=bare)), solids


def _ends_upright(terrain: Terrain, kind: NDArray[np.void]) -> bool:
    """Whether a kind is a disc that is 0 at its edge, where its tangent is vertical."""
    if kind["combine"] != COMBINE["radial"] or kind["is_void"]:
        return False
    starts, pieces = curve_pieces(terrain.arrays, kind, "x")
    hulls = curve_hulls(pieces)
    size = float(np.abs(hulls).max())
    length = 1.0 - starts[-1]
    end = float(hulls[3, -1])
    if size == 0.0 or length <= 0.0 or abs(end) > 1e-9 * size:
        return False
    return bool((hulls[2, -1] - end) * 3.0 / length > _UPRIGHT * size)


def _dome(
    terrain: Terrain, index: int, cell: Floats, max_error: float, corner: Floats
) -> Solid | None:
    """Return the solid of a dome by the index of its element; None if it is not convex."""
    west, south, east, north = cell.tolist()
    pose = terrain.arrays.poses[terrain.arrays.elements["pose"][index]]
    rectangle = np.array([[west, south], [east, south], [east, north], [west, north]])
    outline = outline_of(rectangle, pose, disc=True)
    middle = np.array([0.5 * (west + east), 0.5 * (south + north)])
    if len(outline) % 4:
        return None  # its cell cuts a part of it off
    first, second = outline[0] - middle, outline[len(outline) // 4] - middle
    radius = max(np.linalg.norm(first), np.linalg.norm(second))
    height = float(terrain.arrays.elements["scale"][index])
    size = max(float(radius), height)
    corners = int(np.clip(math.ceil(math.pi * math.sqrt(size / (2 * _SHARE * max_error))), *_ROUND))
    corners += corners % 2
    rings = max(2, corners // 4)
    # even angles from the edge, where a dome is upright, to its top
    angle = 0.5 * math.pi * np.arange(rings) / rings
    around = 2.0 * math.pi * np.arange(corners) / corners
    radii = np.cos(angle)
    radii[0] -= 1e-9  # on the disc
    plane = radii[:, None, None] * (
        np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    )
    points = np.concatenate([plane.reshape(-1, 2), np.zeros((1, 2))]) + middle
    heights = terrain.ground(points[:, 0], points[:, 1])
    if not np.isfinite(heights).all():
        return None
    triangles = _fan(rings, corners)
    tops = np.column_stack([points - corner, heights])
    faces = tops[triangles]
    if not kernels.is_roof(faces.reshape(-1, 9), tops, max_error):
        return None
    centres = faces.mean(axis=1)
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    cosines = normals[:, 2] / np.linalg.norm(normals, axis=1)
    there = terrain.ground(centres[:, 0] + corner[0], centres[:, 1] + corner[1])
    if not (np.abs(there - centres[:, 2]) * cosines <= max_error).all():
        return None
    kind = terrain.arrays.kinds[terrain.arrays.elements["kind"][index]]
    return Solid(
        tops,
        False,
        int(terrain.sample(*middle).surface) if kind["surface"] < 0 else int(kind["surface"]),
    )


def _fan(rings: int, corners: int) -> NDArray[np.intp]:
    """Return the triangles between rings of corners and a last point in their middle, (n, 3)."""
    one = np.arange(corners)
    other = (one + 1) % corners
    found = []
    for ring in range(rings - 1):
        low, high = ring * corners, (ring + 1) * corners
        found.append(np.column_stack([low + one, low + other, high + other]))
        found.append(np.column_stack([low + one, high + other, high + one]))
    low = (rings - 1) * corners
    found.append(np.column_stack([low + one, low + other, np.full(corners, rings * corners)]))
    return np.concatenate(found)
