"""Polygons cut into triangles: the same area, wound the same way, with no overlap."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from terratool.kernels import importing as kernels


def cut(points: NDArray[np.float64]) -> tuple[NDArray[np.int32], int, int]:
    """One polygon with all the points in their order."""
    return kernels.triangulate(points, np.arange(len(points), dtype=np.int32))


def normals(points: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Of each triangle, as long as twice its area."""
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return np.cross(b - a, c - a)


def star(radii: list[float], seed: int) -> NDArray[np.float64]:
    """A polygon that sees all of its corners from within, somewhere in space."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(0, 2 * math.pi, len(radii), endpoint=False)
    flat = np.column_stack(
        (3 * np.cos(angles) * radii, np.sin(angles) * radii, np.zeros(len(radii)))
    )
    turned = Rotation.from_rotvec(rng.uniform(-2, 2, 3)).apply(flat)
    return np.ascontiguousarray(turned) + rng.uniform(-50, 50, 3)


def area_vector(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice the area of a polygon, along its normal."""
    return np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)


@given(st.lists(st.floats(0.05, 4), min_size=4, max_size=60), st.integers(0, 10**6))
def test_stars(radii: list[float], seed: int) -> None:
    """No triangle is turned over, and so none overlaps, as their areas have the right sum."""
    points = star(radii, seed)
    faces, flat, crossed = cut(points)
    assert (flat, crossed) == (0, 0)
    assert len(faces) == len(points) - 2
    whole = area_vector(points)
    each = normals(points, faces)
    assert (each @ whole > 0).all()
    assert np.allclose(np.linalg.norm(each, axis=1).sum(), np.linalg.norm(whole))
    # every corner is used, every side is the side of one triangle
    sides = {(int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3)}
    assert {(n, (n + 1) % len(points)) for n in range(len(points))} <= sides


def spiral(turns: int, steps: int) -> NDArray[np.float64]:
    """A band that winds up, oblong: it sees little of itself."""
    angle = np.linspace(0, turns * 2 * math.pi, turns * steps)
    radius = 1 + angle
    inner = np.column_stack((2 * radius * np.cos(angle), radius * np.sin(angle), 0 * angle))
    outer = inner * ((radius + 2.5) / radius)[:, None]
    return np.vstack((outer, inner[::-1]))


@pytest.mark.parametrize("turned", [False, True])
def test_spiral(turned: bool) -> None:
    points = spiral(5, 40)
    points = points[::-1].copy() if turned else points
    faces, flat, crossed = cut(points)
    assert (len(faces), flat, crossed) == (len(points) - 2, 0, 0)
    whole, each = area_vector(points), normals(points, faces)
    assert (each[:, 2] * whole[2] > 0).all()
    assert np.isclose(np.abs(each[:, 2]).sum(), abs(whole[2]))


def test_comb_of_many_corners() -> None:
    """200,000 corners would take hours if each were held against each."""
    count = 100_000
    x = np.arange(count) / 7
    low = np.column_stack((x, np.zeros(count), x * 0))
    teeth = np.column_stack((x[::-1], 3 + 20.0 * (np.arange(count) % 2), x * 0))
    points = np.vstack((low, teeth))
    faces, _, crossed = cut(points)
    whole, each = area_vector(points), normals(points, faces)
    assert crossed == 0
    assert (each[:, 2] > 0).all()
    assert np.isclose(each[:, 2].sum(), whole[2])


def test_corners_on_straight_sides() -> None:
    """They are corners of triangles, too, so that neighbours fit; none has no area."""
    points = np.array(
        [(0, 0), (1, 0), (2, 0), (5, 0), (5, 1), (5, 3), (2, 3), (2, 2), (2, 1), (1, 1), (0, 1)]
    )
    points = np.column_stack((points, points @ (0.5, -0.25)))
    faces, flat, crossed = cut(points)
    assert (len(faces), flat, crossed) == (len(points) - 2, 0, 0)
    assert (normals(points, faces)[:, 2] > 0).all()


def test_hole_by_a_cut() -> None:
    """A ring as one polygon that goes in and out along the same line."""
    outer = [(0, 0), (7, 0), (7, 5), (0, 5)]
    inner = [(2, 2), (2, 4), (4, 4), (4, 2)]
    points = np.array([*outer, outer[0], *inner, inner[0]], float)
    points = np.column_stack((points, np.zeros(len(points))))
    faces, flat, crossed = cut(points)
    each = normals(points, faces)[:, 2]
    assert (flat, crossed) == (0, 0)
    assert (each > 0).all()
    assert each.sum() == 2 * (35 - 4)
    centres = points[faces].mean(axis=1)
    assert not ((centres > (2, 2, -1)).all(axis=1) & (centres < (4, 4, 1)).all(axis=1)).any()


def test_many_polygons_and_their_ends() -> None:
    """Also with the first corner repeated, an empty one, and none behind the last."""
    points = star([1, 2, 1.5, 2.5, 1, 3, 2], 5)
    indices = [0, 1, 2, 0, -1, -1, 2, 3, 3, 4, -7, 4, 5, -1, 6, 0, 1, 2]
    faces, flat, crossed = kernels.triangulate(points, np.array(indices, np.int32))
    assert faces[:2].tolist() == [[0, 1, 2], [2, 3, 4]]
    assert flat == 2  # the empty one and the one of two corners
    assert crossed == 0
    assert len(faces) == 4
    assert set(faces[2:].ravel().tolist()) == {6, 0, 1, 2}


def test_nothing() -> None:
    faces, flat, crossed = kernels.triangulate(np.empty((0, 3)), np.empty(0, np.int32))
    assert (faces.shape, flat, crossed) == ((0, 3), 0, 0)


def test_what_crosses_itself_is_counted() -> None:
    bow = np.array([(0, 0, 0), (4, 4, 0), (4, 0, 0), (0, 3, 0)], float)
    pentagram = np.array([(math.cos(a), math.sin(a), 0) for a in np.arange(5) * (4 * math.pi / 5)])
    for points in (bow, pentagram):
        faces, _, crossed = cut(points)
        assert crossed == 1
        assert len(faces) >= 1
    _, flat, _ = cut(np.array([(0, 0, 0), (1, 1, 1), (2, 2, 2), (3, 3, 3)], float))
    assert flat == 1
