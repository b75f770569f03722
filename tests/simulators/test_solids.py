"""Roofs of solids: what is convex, what triangles cover, and when so many are given up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from terratool.kernels import mesh as kernels
from terratool.mesh.triangulate import delaunay
from terratool.simulators.collision.solids import Budget


def ground(seed: int, count: int = 60) -> Any:
    """Triangles over an oblong, (n, 3, 3), of a bent hill with dents; and its points."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform((2.0, -5.0), (6.0, 1.0), (count, 2)).T
    z = 3.0 - 0.2 * (x - 3.0) ** 2 - 0.05 * (y + 1.0) ** 2 + 0.7 * x + rng.normal(0.0, 0.01, count)
    points = np.column_stack([x, y, z])
    rim = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points[:, :2])))[:-1]
    first = [int(np.flatnonzero((points[:, :2] == corner).all(axis=1))[0]) for corner in rim]
    edges = np.column_stack([first, np.roll(first, -1)]).astype(np.int32)
    _, triangles, _ = delaunay(points[:, :2], edges, within=True)
    return points[triangles], points


@pytest.mark.parametrize("seed", range(8))
def test_a_roof_is_no_farther_below_its_corners(seed: int) -> None:
    """By the distance of each corner from each plane, one after the other."""
    triangles, points = ground(seed, 5 + 9 * seed)
    farthest = 0.0
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal) * np.sign(normal[2])
        farthest = max(farthest, *((point - a) @ normal for point in points))
    rows = triangles.reshape(-1, 9)
    assert kernels.is_roof(rows, points, farthest + 1e-9)
    assert not kernels.is_roof(rows, points, farthest - 1e-6)
    # the last corner alone, too
    assert not kernels.is_roof(rows, np.append(points, [[4.0, -2.0, 90.0]], axis=0), farthest)


def test_points_are_covered_where_triangles_are() -> None:
    triangles, _ = ground(3)
    some = triangles[np.arange(0, len(triangles), 3)]
    x, y = np.random.default_rng(7).uniform((1.0, -6.0), (7.0, 2.0), (2000, 2)).T
    points = np.concatenate([np.column_stack([x, y]), some[:, 1, :2]])  # corners as well
    found = np.empty(len(points), np.bool_)
    kernels.covered_points(some.reshape(-1, 9), points, found)
    shape = shapely.union_all(shapely.polygons(some[:, :, :2]))
    assert found[2000:].all()
    assert (found[:2000] == shapely.intersects_xy(shape, x, y)).all()
    assert 200 < found[:2000].sum() < 1800


def test_ground_that_will_take_too_many_is_given_up_early() -> None:
    """An even stream of solids ends soon where it would be ten times too long, else not at all."""
    for times, ends in ((10.0, True), (1.0, False), (0.5, False)):
        budget = Budget(most=200, area=40.0)
        for _ in range(int(200 * times)):
            if budget.is_spent:
                break
            budget.count += 1
            budget.done += 40.0 / (200 * times)
        assert budget.is_spent == ends
        assert not ends or budget.done < 0.2 * budget.area


def test_all_that_is_allowed_may_be_used_and_no_more() -> None:
    budget = Budget(most=200, area=40.0, done=39.0, count=200)
    assert not budget.is_spent
    budget.count += 1
    assert budget.is_spent
