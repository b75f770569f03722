"""What collides in MuJoCo is chosen by the ground: height fields, solids, or both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain
from terratool.simulators.collision.areas import smooth_areas, walls_of
from terratool.simulators.collision.lattices import GroundSampler
from tests.conftest import terrain_of
from tests.simulators import checks
from tests.simulators.checks import bytes_of, written
from tests.simulators.mujoco_adapter import MuJoCo

pytest.importorskip("mujoco", reason="mujoco is not installed")

# curved, oblong and symmetric in no way
WAVES: dict[str, Any] = {
    "size": [9, 5],
    "surfTypes": {"soil": {"fricAngle": 30}, "stone": {"fricAngle": 40}},
    "elemTypes": {
        "wave": {"x": "0.5 - 0.5*cos(2*pi*t)", "y": "0.4*t*t", "combine": "sum"},
        "boulder": {"x": "dome", "combine": "radial"},
        "block": {"x": [1]},
    },
    "elemTree": {"type": "wave", "surface": "soil", "vScale": 0.3},
}


def waves_with(*children: dict[str, Any]) -> Terrain:
    return terrain_of({**WAVES, "elemTree": {**WAVES["elemTree"], "children": list(children)}})


def block(x: float, y: float, **more: Any) -> dict[str, Any]:
    return {"type": "block", "at": [x, y], "extent": [1.5, 0.7], "vScale": 0.4, **more}


def kinds(manifest: dict[str, Any]) -> tuple[int, int, int]:
    """Numbers of boxes, convex meshes and height fields."""
    counts = manifest["collision"]
    return counts["box"], counts["mesh"], counts["hfield"]


def test_ground_without_walls_is_height_fields_alone(tmp_path: Path) -> None:
    """They are seen, too: there is no mesh. The same terrain gives the same bytes."""
    folder, ground, manifest = written(waves_with(), tmp_path / "a", "mujoco")
    assert kinds(manifest)[:2] == (0, 0)
    assert manifest["collision"]["error"] <= 0.002
    assert not list(folder.glob("*.msh"))
    for group in (2, 3):
        checks.check_rays(MuJoCo(folder, group=group), ground, 0.0021)
    checks.check_rest(MuJoCo(folder), ground, count=6)
    again, _, _ = written(waves_with(), tmp_path / "b", "mujoco")
    assert bytes_of(folder) == bytes_of(again)


def test_a_boulder_is_one_solid(tmp_path: Path) -> None:
    """Right 2 mm inside its rim, where it is upright, and beside it."""
    dome = {"type": "boulder", "at": [3.2, 2.1], "extent": [1.4, 1.0], "vScale": 0.5,
            "surface": "stone"}  # fmt: skip
    folder, ground, manifest = written(waves_with(dome), tmp_path / "a", "mujoco", origin="world")
    assert kinds(manifest)[:2] == (0, 1)
    simulator = MuJoCo(folder)
    checks.check_rays(simulator, ground, 0.0045)
    for angle in np.linspace(0.1, 6.2, 30).tolist():
        way = np.array([0.7 * np.cos(angle), 0.5 * np.sin(angle)])
        x, y = np.array([3.2, 2.1]) + 1.01 * way
        found = simulator.ray_down(x, y)
        assert found == pytest.approx(float(ground.height(x, y)), abs=0.003)
        begin, end = ([*(np.array([3.2, 2.1]) + k * way), 0.4] for k in (1.5, 0.2))
        hit = simulator.ray(begin, end)
        assert hit is not None
        assert hit[2] - float(ground.height(hit[0], hit[1])) == pytest.approx(0.0, abs=0.02)


def test_walls_on_curved_ground_are_upright(tmp_path: Path) -> None:
    """Height fields end at walls along the axes; solids stand beside others alone."""
    straight = waves_with(block(3.1, 1.9), block(6.0, 3.2, vScale=-0.3))
    folder, ground, manifest = written(straight, tmp_path / "a", "mujoco")
    boxes, meshes, _ = kinds(manifest)
    assert boxes + meshes == 0
    checks.check_walls(MuJoCo(folder), ground, 0.0025, count=8)
    turned = waves_with(block(3.1, 1.9, turnDeg=25))
    folder, ground, manifest = written(turned, tmp_path / "b", "mujoco")
    boxes, meshes, fields = kinds(manifest)
    assert meshes
    assert fields
    checks.check_rays(MuJoCo(folder), ground, 0.0025)


def _jumps(terrain: Terrain, area: Bounds) -> float:
    """Largest rise over a hair within an area."""
    west, south, east, north = area
    x, y = np.random.default_rng(5).uniform((west, south), (east, north), (20_000, 2)).T
    aside = 1e-6 * (east - west)
    rise = np.abs(terrain.ground(x, y) - terrain.ground(np.minimum(x + aside, east), y))
    return float(np.nanmax(rise))


@pytest.mark.parametrize("turn", [0, 25])
def test_no_area_has_a_wall_in_it(turn: int) -> None:
    terrain = waves_with(block(3.1, 1.9, turnDeg=turn), block(6.0, 3.2, vScale=-0.3))
    areas = smooth_areas(GroundSampler(terrain), walls_of(terrain, 0.001), 0.002)
    assert sum((a[2] - a[0]) * (a[3] - a[1]) for a in areas) > 0.8 * 45
    for area in areas:
        inner = *(np.array(area[:2]) + 1e-6), *(np.array(area[2:]) - 1e-6)
        assert _jumps(terrain, inner) < 1e-4
    assert _jumps(terrain, terrain.bounds) > 0 or turn == 0


def test_rough_ground_is_one_field_of_its_own_nodes(tmp_path: Path) -> None:
    """Cells of half the distance of its random heights; the error of that is stated."""
    spec = {"rows": 1, "columns": 1, "tile": [4, 3], "kinds": {"r": {"kind": "randomRough"}}}
    made = terratool.curriculum(spec, seed=3).terrain
    folder, ground, manifest = written(made, tmp_path / "a", "mujoco", origin="world")
    assert kinds(manifest)[2] == 1
    error = manifest["collision"]["height_fields_error"]
    # a bilinear cell is off two triangles by a quarter of its twist: 4 · 0.08 / 4 at most, of
    # cells of 0.1 m, and a quarter of that in halves of these
    assert 0.002 < error <= 0.0101
    [field] = folder.glob("*.bin")
    assert np.fromfile(field, "<i4", 2).tolist() == [51, 71]
    checks.check_rays(MuJoCo(folder), ground, 1.01 * error)


def test_height_fields_alone_make_slopes_of_walls(tmp_path: Path) -> None:
    terrain = waves_with(block(3.1, 1.9))
    folder, ground, manifest = written(
        terrain, tmp_path / "a", "mujoco", collision="hfield", origin="world"
    )
    assert kinds(manifest)[:2] == (0, 0)
    assert "steeper than" in manifest["losses"][-1]
    simulator = MuJoCo(folder)
    for x, y in ((1.0, 1.0), (3.1, 1.9), (7.0, 4.0)):
        assert simulator.ray_down(x, y) == pytest.approx(float(ground.height(x, y)), abs=0.0021)


def test_what_time_took_away_is_said(tmp_path: Path) -> None:
    terrain = waves_with(block(3.1, 1.9, turnDeg=25), block(6.0, 3.2, turnDeg=-31))
    folder, ground, manifest = written(terrain, tmp_path / "a", "mujoco", max_seconds=1e-9)
    counts = manifest["collision"]
    assert any("--max-seconds N allows more" in line for line in manifest["losses"])
    checks.check_rays(MuJoCo(folder), ground, 1.01 * counts["error"])


def test_high_curved_ground_has_its_walls(tmp_path: Path) -> None:
    """A hill on a tower: rays from aside meet the tower's sides, far below its top."""
    tower = {
        "type": "block", "at": [4, 2.4], "extent": [3, 2], "vScale": 6,
        "children": [{"type": "wave", "at": [1.5, 1], "extent": [3, 2], "vScale": 0.2}],
    }  # fmt: skip
    definition = {**WAVES, "elemTree": {"type": "block", "vScale": 0, "children": [tower]}}
    definition["surfTypes"] = {}
    folder, ground, manifest = written(
        terrain_of(definition), tmp_path / "a", "mujoco", origin="world"
    )
    assert kinds(manifest)[2] > 0
    simulator = MuJoCo(folder)
    checks.check_rays(simulator, ground, 0.0025)
    for z in (0.3, 2.0, 4.5, 5.9):
        for begin, end, met in (
            ([0.5, 2.3, z], [8.5, 2.3, z], [2.5, 2.3, z]),
            ([8.5, 2.1, z], [0.5, 2.1, z], [5.5, 2.1, z]),
            ([4.3, 0.2, z], [4.3, 4.8, z], [4.3, 1.4, z]),
            ([3.7, 4.8, z], [3.7, 0.2, z], [3.7, 3.4, z]),
        ):
            assert simulator.ray(begin, end) == pytest.approx(met, abs=0.003), (begin, z)


def test_narrow_things_on_wide_ground_are_within_the_error(tmp_path: Path) -> None:
    """A bump of 0.6 m on 60 m of gentle ground: it has cells of its own."""
    bump = {"type": "bell", "at": [41.3, 9.7], "extent": [0.6, 0.9], "vScale": 0.1}
    definition = {
        **WAVES,
        "size": [60, 23],
        "elemTypes": {**WAVES["elemTypes"], "bell": {"x": "cosbell", "y": []}},
        "elemTree": {**WAVES["elemTree"], "vScale": 0.1, "children": [bump]},
    }
    folder, ground, manifest = written(
        terrain_of(definition), tmp_path / "a", "mujoco", origin="world"
    )
    assert manifest["collision"]["height_fields_error"] <= 0.002
    simulator = MuJoCo(folder)
    for x, y in np.random.default_rng(2).uniform((41, 9.25), (41.6, 10.15), (200, 2)).tolist():
        found = simulator.ray_down(x, y)
        assert found == pytest.approx(float(ground.height(x, y)), abs=0.0022)


def test_height_fields_alone_leave_the_void_open(tmp_path: Path) -> None:
    hole = block(3.1, 1.9, surface="gap")
    definition = {**WAVES, "surfTypes": {**WAVES["surfTypes"], "gap": {"void": True}}}
    definition["elemTree"] = {**WAVES["elemTree"], "children": [hole]}
    folder, ground, manifest = written(
        terrain_of(definition), tmp_path / "a", "mujoco", collision="hfield", origin="world"
    )
    assert kinds(manifest)[:2] == (0, 0)
    simulator = MuJoCo(folder)
    for x, y in ((3.1, 1.9), (2.6, 1.7), (3.6, 2.1)):
        assert np.isnan(ground.height(x, y))
        found = simulator.ray_down(x, y)
        assert found is None or found < -1.0  # a pit at most, as height fields have no holes
    assert simulator.ray_down(1.0, 1.0) == pytest.approx(float(ground.height(1, 1)), abs=0.0021)
