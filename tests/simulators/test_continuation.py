"""Height fields at walls: lower ground goes on, and nothing rises above the ground."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely

from terratool.simulators.collision.continuation import continue_ground
from terratool.simulators.collision.footing import footing_of, rest_of, with_misses_at
from terratool.simulators.collision.height_patch import HeightPatch
from terratool.simulators.collision.solids import GroundTriangles, areas_of


@pytest.mark.parametrize("angle", [0.0, 90.0, 180.0, -90.0, 33.0, 45.0, 110.0, 250.0])
@pytest.mark.parametrize("place", [5.0, 5.2, 5.9, 5.0000003])
def test_a_plane_goes_on_under_a_plateau(angle: float, place: float) -> None:
    """One wall at any angle, through nodes or not: the next nodes behind it are on the plane."""
    across = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    along = np.array([-across[1], across[0]])
    middle = np.array([6.0, 5.0])
    edge = place - 5.0

    def plane(x: Any, y: Any) -> Any:
        return 0.3 + 0.2 * x - 0.07 * y

    def behind(x: Any, y: Any) -> Any:
        return (x - middle[0]) * across[0] + (y - middle[1]) * across[1] - edge

    def height(x: Any, y: Any) -> Any:
        return plane(x, y) + 1.5 * (behind(x, y) >= 0)

    x, y = np.meshgrid(np.arange(13.0), np.arange(11.0))
    foot = middle + edge * across
    walls = np.array([[foot - 30 * along, foot + 30 * along]])
    found = continue_ground(height(x, y), walls, height, 0.01)
    away = behind(x, y)
    low = found < height(x, y) - 1.0
    assert not low[away < -1e-6].any()
    assert np.allclose(found[low], plane(x, y)[low], atol=1e-9)
    # each node that a link ties to the lower ground is low
    for right, up in ((1, 0), (0, 1), (1, 1)):
        for sign in (1, -1):
            other = behind(x + sign * right, y + sign * up)
            inside = (x + sign * right >= 0) & (x + sign * right <= 12)
            inside &= (y + sign * up >= 0) & (y + sign * up <= 10)
            assert low[inside & (away > 1e-5) & (other < -1e-5)].all()
    assert not low[away > 1.5].any()


def test_a_fence_pulls_no_node_and_a_ditch_none() -> None:
    """Between two nodes, what rises and falls again leaves both as they are."""
    for step in (1.0, -1.0):

        def height(x: Any, y: Any, step: float = step) -> Any:
            return 0.1 * x + step * ((x >= 3.4) & (x < 3.6)) + 0.0 * y

        x, y = np.meshgrid(np.arange(8.0), np.arange(5.0))
        walls = np.array([[[at, -1.0], [at, 6.0]] for at in (3.4, 3.6)])
        nodes = height(x, y)
        assert np.array_equal(continue_ground(nodes, walls, height, 0.01), nodes)


def strips(heights: dict[tuple[float, float], float]) -> GroundTriangles:
    """Level strips from west to east by their ends; 5 long from south to north."""
    found = []
    for (west, east), z in heights.items():
        a, b, c, d = ([x, y, z] for x, y in ((west, 0), (east, 0), (east, 5), (west, 5)))
        found += [[a, b, c], [a, c, d]]
    ends = [x for one in heights for x in one]
    sharp = [[[x, 0.0], [x, 5.0]] for x in sorted(set(ends))]
    return GroundTriangles(np.array(found, float), np.zeros(len(found), np.int32), np.array(sharp))


def level(z: float, near: slice) -> HeightPatch:
    """A height field of 8 by 5 cells of 1."""
    shape = 5, 8
    cells = np.zeros(shape, np.bool_)
    cells[:, near] = True
    return HeightPatch(
        (0.0, 0.0, 8.0, 5.0),
        np.full((6, 9), z),
        np.ones(shape, np.bool_),
        np.zeros(shape, np.bool_),
        cells,
        np.zeros(shape, np.int32),
        np.zeros(shape, np.bool_),
        np.zeros(shape),
    )


def nodes_of(used: Any) -> Any:
    """The nodes that used cells keep."""
    padded = np.pad(used, 1)
    return padded[:-1, :-1] | padded[1:, :-1] | padded[:-1, 1:] | padded[1:, 1:]


def test_no_cell_bridges_a_ditch() -> None:
    """All four nodes of a cell over a narrow ditch are good; yet they are not all kept."""
    ground = strips({(0, 3.4): 0.0, (3.4, 3.5): -1.0, (3.5, 8): 0.0})
    found = footing_of(level(0.0, slice(3, 4)), ground, 0.01)
    kept = nodes_of(found.patch.used)
    # nor an edge of one: it would be a blade in the ditch
    assert not (kept[:, 3] & kept[:, 4]).any()
    assert not (kept[:-1, 3] & kept[1:, 4]).any()
    # what it gives up is told: the ditch, and ground beside it
    index, pieces = rest_of([found], ground)
    assert areas_of(pieces).sum() >= 40.0 - np.count_nonzero(found.patch.used) - 1e-9
    assert set(ground.triangles[index, 0, 2].tolist()) == {0.0, -1.0}


@pytest.mark.parametrize("seed", range(12))
def test_nothing_stands_in_slanting_ditches(seed: int) -> None:
    """Two narrow ditches that cross: no triangle and no edge of what is kept is over them."""
    rng = np.random.default_rng(seed)
    ditches = []
    for _ in range(2):
        begin, end = (rng.uniform(0, 8), -1.0), (rng.uniform(0, 8), 6.0)
        ditches.append(shapely.LineString([begin, end]).buffer(0.03, cap_style="flat"))
    low = shapely.union_all(ditches).intersection(shapely.box(0, 0, 8, 5))
    triangles = []
    for shape, z in ((shapely.box(0, 0, 8, 5).difference(low), 0.0), (low, -1.0)):
        for one in shapely.constrained_delaunay_triangles(shape).geoms:
            corners = shapely.get_coordinates(shapely.geometry.polygon.orient(one))[:3]
            triangles.append(np.column_stack([corners, np.full(3, z)]))
    ground = GroundTriangles(
        np.array(triangles), np.zeros(len(triangles), np.int32), np.empty((0, 2, 2))
    )
    patch = level(0.0, slice(0, 8))
    cells = shapely.box(*np.meshgrid(np.arange(8), np.arange(5)), *np.meshgrid(
        np.arange(1, 9), np.arange(1, 6)
    ))  # fmt: skip
    patch = replace(patch, near=shapely.intersects(cells, low))
    found = footing_of(patch, ground, 0.01)
    assert found.patch.used.any()
    kept = nodes_of(found.patch.used)
    nodes = [(i, j) for i in range(6) for j in range(9) if kept[i, j]]
    for i, j in nodes:
        for up, right in ((0, 1), (1, 0), (1, 1)):
            if (i + up, j + right) in nodes:
                edge = shapely.LineString([(j, i), (j + right, i + up)])
                assert edge.intersection(low).length < 1e-6, edge


def test_lower_ground_goes_on_under_higher() -> None:
    """Cells at a wall are used for the lower ground, and the higher is left."""
    ground = strips({(0, 3.4): 0.0, (3.4, 8): 2.0})
    patch = level(0.0, slice(3, 8))
    found = footing_of(patch, ground, 0.01)
    assert found.patch.used[:, :4].all()
    assert not found.patch.used[:, 4:].any()
    _, pieces = rest_of([found], ground)
    assert np.allclose(pieces[:, :, 2], 2.0)
    assert areas_of(pieces).sum() == pytest.approx(4.6 * 5)


def test_cells_are_held_against_corners_of_the_ground() -> None:
    """A height field of a plane with oblong cells: points off it are found in their cell."""
    shape = 3, 4
    x, y = np.meshgrid(2 + 0.5 * np.arange(5), 1 + 0.25 * np.arange(4))
    cells, zero = np.ones(shape, np.bool_), np.zeros(shape)
    patch = HeightPatch(
        (2.0, 1.0, 4.0, 1.75), 3 * x - y, cells, ~cells, ~cells, zero.astype(np.int32), ~cells, zero
    )
    rng = np.random.default_rng(3)
    points = rng.uniform((1.5, 0.5), (4.5, 2.0), (200, 2))
    points = points[np.argsort(points[:, 0])]
    off = rng.uniform(-0.1, 0.1, 200)
    found = with_misses_at(patch, np.column_stack([points, 3 * points[:, 0] - points[:, 1] + off]))
    expected = np.zeros(shape)
    for (east, north), by in zip(points.tolist(), off.tolist(), strict=True):
        if 2 <= east <= 4 and 1 <= north <= 1.75:
            row, column = int((north - 1) / 0.25), int((east - 2) / 0.5)
            expected[row, column] = max(expected[row, column], abs(by))
    assert np.allclose(found.misses, expected, atol=1e-12)
    assert np.count_nonzero(expected) > 8


def test_what_is_higher_than_the_ground_is_left_out() -> None:
    found = footing_of(level(0.5, slice(0, 8)), strips({(0, 8): 0.0}), 0.01)
    assert not found.patch.used.any()
