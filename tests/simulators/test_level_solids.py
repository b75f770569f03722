"""Boxes and cylinders stand for level ground, and what they cover is in no mesh."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import terratool
from terratool.mesh.types import Mesh
from terratool.simulators.level_solids import LevelSolid
from terratool.simulators.options import SceneOptions
from terratool.simulators.scene import Scene
from terratool.simulators.uncovered import uncovered
from tests.conftest import terrain_of
from tests.meshes import ROUND, SITE, STRAIGHT, SURFACES, random_definition
from tests.simulators.checks import written
from tests.simulators.storeyed import thing

ERROR = 0.002
TYPES: dict[str, Any] = {
    "block": {"x": [1]}, "rise": {"x": [0, 1]}, "column": {"x": [1], "combine": "radial"},
    "tower": {"x": [[0, 1], [0.8, 1], [0.8, 2], [1, 2]], "combine": "radial"},
}  # fmt: skip


def yard(*children: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A level floor at 0.2 m, of soil, with things on it."""
    surfaces = {"soil": {"fricAngle": 30}, "ice": {"fricAngle": 9}, "pit": {"void": True}}
    tree = {"type": "block", "surface": "soil", "vScale": 0.2, "children": list(children)}
    return {
        "size": [9, 5], "surfTypes": surfaces, "elemTypes": TYPES, "elemTree": {**tree, **more},
    }  # fmt: skip


CRATE = thing("block", [2.2, 1.4], [1.2, 0.8], turnDeg=25, vScale=0.9, surface="ice")
COLUMN = thing("column", [6.5, 3.5], 1.4, vScale=0.5, surface="ice")
PIT = thing("block", [4.5, 1], [1, 0.6], vScale=-0.3)
ROUND_PIT = thing("column", [4.4, 3.4], 1.0, vScale=-0.5)
HOLE = thing("block", [7.6, 1.2], [1.1, 0.7], surface="pit")
RUG = thing("block", [1.5, 3.9], [1.6, 0.7], vScale=0, surface="ice")
RAMP = thing("rise", [4.2, 4.4], [1.5, 0.6], vScale=0.3)
EVERYTHING = yard(CRATE, COLUMN, PIT, ROUND_PIT, HOLE, RUG, RAMP)


def scene_of(definition: dict[str, Any]) -> Scene:
    return Scene(terrain_of(definition), "yard", SceneOptions(max_error=ERROR))


def only(scene: Scene, surface: str) -> LevelSolid:
    [one] = [s for s in scene.level_solids if scene.material(s.surface).name == surface]
    return one


def test_a_turned_crate_is_a_box() -> None:
    """On a floor that is one box, which goes on under it."""
    scene = scene_of(yard(CRATE))
    box = only(scene, "ice")
    assert box.middle == pytest.approx((2.2, 1.4), abs=1e-6)
    assert 2 * np.array(box.half) == pytest.approx((1.2, 0.8), abs=1e-6)
    assert math.degrees(box.turn) == pytest.approx(-25, abs=1e-4)  # turnDeg is clockwise
    assert (box.top, box.is_round) == (pytest.approx(1.1, abs=1e-9), False)
    floor = only(scene, "soil")
    assert floor.middle == pytest.approx((4.5, 2.5)) and floor.half == pytest.approx((4.5, 2.5))
    assert floor.under == box.under == pytest.approx(0.2 - 1.0)
    assert not shapely.Polygon(box.corners()).covers(shapely.Point(floor.seen))


def test_a_round_column_is_a_cylinder() -> None:
    scene = scene_of(yard(COLUMN))
    one = only(scene, "ice")
    assert one.is_round
    assert one.middle == pytest.approx((6.5, 3.5), abs=1e-6)
    assert one.half == pytest.approx((0.7, 0.7), abs=1e-5)
    assert one.top == pytest.approx(0.7)
    assert not len(uncovered(scene.mesh, scene.level_solids, ERROR).faces)


@pytest.mark.parametrize(
    ("extent", "found"),
    [([1.4, 1.2], 0), ([1.4, 1.4], 1)],
)
def test_what_is_no_circle_is_no_cylinder(extent: list[float], found: int) -> None:
    """An ellipse."""
    scene = scene_of(yard({**COLUMN, "extent": extent}))
    assert sum(one.is_round for one in scene.level_solids) == found


def test_an_oval_pit_is_no_cylinder() -> None:
    """Its floor is a box, which goes on under what is around it."""
    oval = {**ROUND_PIT, "extent": [1.4, 1.2]}
    scene = scene_of(yard(oval))
    [floor] = [one for one in scene.level_solids if one.top < 0]
    assert not floor.is_round and floor.half == pytest.approx((0.7, 0.6), abs=0.01)
    assert check_covers(scene, scene.level_solids, 300) > 200


def test_an_octagon_is_no_cylinder() -> None:
    """Two squares, one turned by 45 degrees, on a pedestal: level, and not round."""
    square = thing("block", [3, 2], [1, 1], vScale=0.5)
    scene = scene_of(yard(square, {**square, "turnDeg": 45, "vScale": 0.5}))
    assert not any(one.is_round for one in scene.level_solids)


@pytest.mark.parametrize(
    ("more", "count"),
    [
        ([PIT], 4 + 1),  # around it, and its floor
        ([HOLE], 4),
        ([RUG], 4 + 1),
        ([ROUND_PIT], 4 + 1),
        ([RAMP], 1),
        ([CRATE, COLUMN, RAMP], 1 + 1 + 1),
        ([{**PIT, "at": [0.5, 0.3]}], 2 + 1),  # in the corner
        ([thing("tower", [3, 3], 1.0, vScale=0.5)], 1 + 1),  # its ring is no disc
    ],
)
def test_floors_are_cut_around_what_is_lower(more: list[dict[str, Any]], count: int) -> None:
    scene = scene_of(yard(*more))
    assert len(scene.level_solids) == count


def test_a_slope_has_none() -> None:
    assert scene_of(yard(type="rise", vScale=1)).level_solids == []


def test_there_are_no_more_than_simulators_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the losses say so."""
    said = "boxes and cylinders at most"
    _, _, manifest = written(terrain_of(EVERYTHING), tmp_path / "all", "pybullet")
    assert said not in " ".join(manifest["losses"])
    for module in ("level_solids", "pieces"):
        monkeypatch.setattr(f"terratool.simulators.{module}.MOST_SOLIDS", 2)
    scene = scene_of(EVERYTHING)
    assert len(scene.level_solids) == 2
    check_covers(scene, scene.level_solids, 300)
    for target in ("pybullet", "gazebo"):
        _, _, manifest = written(terrain_of(EVERYTHING), tmp_path / "few", target)
        assert said in " ".join(manifest["losses"]) and manifest["boxes"] == 2


def check_covers(scene: Scene, solids: list[LevelSolid], count: int) -> int:
    """Each place is the top of a solid or on a face that is left, and never both.

    No solid stands out of the ground; those that are tops have the surface of the ground.
    Returns the number of places that are tops of solids.
    """
    left = uncovered(scene.mesh, solids, ERROR)
    faces = left.vertices[left.faces[~left.walls]]
    tree = shapely.STRtree(shapely.polygons(faces[:, :, :2]))
    rng = np.random.default_rng(5)
    west, south, east, north = scene.terrain.bounds
    points = rng.uniform((0, 0), (east - west, north - south), (count, 2))
    around = points[:, None] + 0.004 * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
    heights = scene.terrain.height(*np.moveaxis(around + scene.terrain.bounds[:2], 2, 0))
    worn = scene.terrain.surface(*(points + scene.terrain.bounds[:2]).T)
    clear = np.isnan(heights).all(axis=1) | (np.ptp(heights, axis=1) < 0.02)
    on_tops = 0
    for point, z, surface in zip(points[clear], heights[clear, 0], worn[clear], strict=True):
        holding = [one for one in solids if one.holds(point, -0.003)]
        if np.isnan(z):
            assert not holding, f"a solid is over the void at {point}"
            continue
        assert all(one.top < z + 2 * ERROR for one in holding), f"one is too high at {point}"
        top = [one for one in holding if abs(one.top - z) < 1e-6]
        assert all(scene.material(one.surface).name == (surface or "none") for one in top)
        near = any(one.holds(point, 0.003) for one in solids if one not in holding)
        found = tree.query(shapely.Point(point), predicate="intersects")
        meshed = sum(abs(height_in(faces[k], point) - z) < 2 * ERROR for k in found)
        assert near or (len(top) > 0) != (meshed > 0), f"{len(top)} and {meshed} at {point}"
        on_tops += len(top) > 0
    return on_tops


def height_in(triangle: np.ndarray, point: np.ndarray) -> float:
    """Height of a triangle's plane at a point."""
    (a, b), origin = triangle[1:] - triangle[0], triangle[0]
    u, v = np.linalg.solve(np.array([a[:2], b[:2]]).T, point - origin[:2])
    return float(origin[2] + u * a[2] + v * b[2])


def test_solids_and_faces_cover_all_once() -> None:
    scene = scene_of(EVERYTHING)
    assert check_covers(scene, scene.level_solids, 400) > 250


def spoilt(scene: Scene, how: str) -> list[LevelSolid]:
    width, height = 9, 5
    found = []
    for one in scene.level_solids:
        x, y = one.middle
        if how == "mirrored":
            one = one._replace(middle=(width - x, y), turn=-one.turn)
        elif how == "transposed":
            one = one._replace(middle=(y * width / height, x * height / width))
        elif how == "raised":
            one = one._replace(top=one.top + 0.01)
        elif how == "wide":
            one = one._replace(half=(one.half[0] + 0.05, one.half[1]))
        found.append(one)
    return found


@pytest.mark.parametrize("how", ["mirrored", "transposed", "raised", "wide"])
def test_the_check_refuses_others(how: str) -> None:
    scene = scene_of(EVERYTHING)
    with pytest.raises(AssertionError):
        check_covers(scene, spoilt(scene, how), 800)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_terrains_are_covered_once(seed: int) -> None:
    """Turned, nested, void and round elements, several in one place."""
    kinds = {**{k: STRAIGHT[k] for k in ("floor", "block", "stairs", "ramp")}, **ROUND}
    scene = scene_of(random_definition(seed, 25, kinds))
    check_covers(scene, scene.level_solids, 300)


def test_walls_go_with_their_boxes() -> None:
    """Those of the site's box are slopes on top, so they stay; a crate's and a column's go."""
    assert not uncovered(*of(scene_of(yard(CRATE, COLUMN, PIT, HOLE))), ERROR).walls.any()
    scene = scene_of({**SITE, "surfTypes": SURFACES})
    assert scene.level_solids == []
    left = uncovered(*of(scene_of(yard(CRATE, RAMP))), ERROR)
    walls = left.vertices[left.faces[left.walls]]
    assert len(walls) and walls[:, :, 0].min() > 3.4  # of the ramp alone


def test_walls_above_a_box_stay() -> None:
    """Those of a slope that begins at the top of a crate beside it."""
    crate = thing("block", [3, 2], [1, 1.2], vScale=0.3)
    slope = thing("rise", [4, 2], [1, 1], vScale=0.3, vOffset=0.5)
    left = uncovered(*of(scene_of(yard(crate, slope))), ERROR)
    walls = left.vertices[left.faces[left.walls]]
    between = walls[(np.abs(walls[:, :, 0] - 3.5) < 1e-6).all(axis=1)]
    assert len(between) and between[:, :, 2].min() == pytest.approx(0.5)
    assert between[:, :, 2].max() == pytest.approx(0.7)


def of(scene: Scene) -> tuple[Mesh, list[LevelSolid]]:
    return scene.mesh, scene.level_solids


@pytest.mark.nightly
def test_samples_are_covered_once() -> None:
    for name in ("warehouse", "stairs-and-kerbs"):
        scene = Scene(terratool.load(f"samples/{name}.json"), name, SceneOptions())
        assert check_covers(scene, scene.level_solids, 800) > 300
