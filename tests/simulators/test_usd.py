"""USD physics: what Pixar's library and Newton read back."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import terrain_of
from tests.meshes import SITE
from tests.simulators.checks import FRICTION_ANGLES, bytes_of, slopes, written

pytest.importorskip("pxr", reason="usd-core is not installed")

# ground without a surface, too
BARE: dict[str, Any] = {
    **SITE,
    "surfTypes": {**SITE["surfTypes"], "grass": {"fricAngle": 20}},
    "elemTree": {key: value for key, value in SITE["elemTree"].items() if key != "surface"},
}


def shapes_of(path: Path) -> dict[str, dict[str, Any]]:
    """What collides, by its path: points in the stage, approximation, and friction."""
    from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    found = {}
    for prim in stage.Traverse():
        if not prim.HasAPI(UsdPhysics.CollisionAPI):
            continue
        mesh = UsdGeom.Mesh(prim)
        turn = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0))
        points = np.array(mesh.GetPointsAttr().Get(), np.float64) @ turn[:3, :3] + turn[3, :3]
        faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
        bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        physics = UsdPhysics.MaterialAPI(bound)
        found[str(prim.GetPath())] = {
            "points": points,
            "triangles": points[faces],
            "faces": len(faces),
            "approximation": UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get(),
            "friction": (
                physics.GetStaticFrictionAttr().Get(),
                physics.GetDynamicFrictionAttr().Get(),
            ),
        }
    return found


def test_one_surface_is_one_mesh(tmp_path: Path) -> None:
    value = {"size": [3, 2], "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}
    *_, manifest = written(terrain_of(value), tmp_path / "one", "usd")
    assert manifest["summary"] == "1 Mesh collides, of 2 faces"
    *_, manifest = written(slopes(0.0), tmp_path / "more", "usd")
    count = len(FRICTION_ANGLES)
    words = rf"a Mesh for each of {count} surfaces collides, of \d+ faces together"
    assert re.fullmatch(words, manifest["summary"])


def test_each_surface_collides_with_its_friction(tmp_path: Path) -> None:
    folder, _, manifest = written(slopes(0.0), tmp_path / "out", "usd")
    found = shapes_of(folder / "terrain.usdc")
    assert list(found) == manifest["prims"]
    assert {one["approximation"] for one in found.values()} == {"none"}
    assert {path: one["friction"] for path, one in found.items()} == {
        f"/Terrain/Surface_{name}": pytest.approx([math.tan(math.radians(angle))] * 2, rel=1e-6)
        for name, angle in FRICTION_ANGLES.items()
    }
    assert sum(one["faces"] for one in found.values()) == manifest["faces"]


def test_assumed_friction_is_in_the_file(tmp_path: Path) -> None:
    """Of a surface without a friction angle, and of ground without a surface."""
    for definition, name in ((SITE, "rock"), (BARE, "none")):
        terrain = terrain_of(definition)
        folder, _, manifest = written(terrain, tmp_path / name, "usd", friction=0.25)
        found = shapes_of(folder / "terrain.usdc")
        assert found[f"/Terrain/Surface_{name}"]["friction"] == (0.25, 0.25)
        assert manifest["surfaces"][name]["friction"] == 0.25
    known = found["/Terrain/Surface_grass"]["friction"][0]
    assert known == pytest.approx(math.tan(math.radians(20)))


@pytest.mark.parametrize(
    ("origin", "zero"),
    [
        ("local", (500000, 4649776, 0)),
        ("center", (500006, 4649780, 0)),
        ((500002.5, 4649777.25, -1.5), (500002.5, 4649777.25, -1.5)),
    ],
)
def test_points_are_where_the_terrain_is(origin: Any, zero: Any, tmp_path: Path) -> None:
    """Bounds are those of the terrain; the column in the south-east is where it was."""
    terrain = terrain_of(SITE)
    folder, ground, manifest = written(terrain, tmp_path / "out", "usd", origin=origin)
    found = shapes_of(folder / "terrain.usdc")
    points = np.concatenate([one["points"] for one in found.values()])
    west, south, east, north = ground.bounds
    assert points.min(axis=0)[:2] == pytest.approx([west, south], abs=1e-5)
    assert points.max(axis=0)[:2] == pytest.approx([east, north], abs=1e-5)
    assert manifest["origin"] == list(zero)
    column = found["/Terrain/Surface_grass"]["points"]
    assert 0.5 * (column.min(axis=0) + column.max(axis=0))[:2] == pytest.approx(
        [500011 - zero[0], 4649777 - zero[1]], abs=1e-4
    )
    triangles = np.concatenate([one["triangles"] for one in found.values()])
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    level = normal[:, 2] > 1e-6
    x, y, z = triangles[level].mean(axis=1).T
    assert level.sum() > 100
    assert np.abs(ground.height(x, y) - z).max() < 0.0021


@pytest.mark.nightly
def test_newton_takes_all_shapes(tmp_path: Path) -> None:
    """With their friction and place, where Newton is installed."""
    newton = pytest.importorskip("newton", reason="newton is not installed")
    pytest.importorskip("newton_usd_schemas", reason="newton-usd-schemas is not installed")
    folder, _, manifest = written(slopes(0.0), tmp_path / "out", "usd", origin=(1.0, 2.0, 3.0))
    builder = newton.ModelBuilder()
    builder.add_usd(str(folder / "terrain.usdc"))
    tangents = [math.tan(math.radians(angle)) for angle in FRICTION_ANGLES.values()]
    assert builder.shape_material_mu == pytest.approx(tangents)
    assert sum(len(one.indices) // 3 for one in builder.shape_source) == manifest["faces"]
    collide = newton.ShapeFlags.COLLIDE_SHAPES
    assert all(flags & collide for flags in builder.shape_flags)
    assert list(builder.shape_transform[0])[:3] == [-1.0, -2.0, -3.0]


def test_the_same_bytes(tmp_path: Path) -> None:
    found = []
    for run in range(2):
        folder, _, _ = written(terrain_of(BARE), tmp_path / str(run), "usd", origin="center")
        found.append(bytes_of(folder))
    assert found[0] == found[1]
