"""USD physics: what Pixar's library, Newton and Isaac Lab's way to read a terrain get of it."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import terratool
from terratool.field.terrain import Terrain
from terratool.mesh.formats.usd import prim_names
from terratool.simulators.export import scene_of
from terratool.simulators.options import SceneOptions
from terratool.simulators.usd import stage_of
from tests.conftest import terrain_of
from tests.meshes import SITE
from tests.simulators.checks import FRICTION_ANGLES, bytes_of, slopes, written
from tests.viewers import usd_parts

pytest.importorskip("pxr", reason="usd-core is not installed")

# ground without a surface, too
BARE: dict[str, Any] = {
    **SITE,
    "surfTypes": {**SITE["surfTypes"], "grass": {"fricAngle": 20}},
    "elemTree": {key: value for key, value in SITE["elemTree"].items() if key != "surface"},
}
PER_SURFACE = pytest.mark.parametrize("per_surface", [False, True])


def stage_at(path: Path) -> Any:
    from pxr import Usd

    return Usd.Stage.Open(str(path))


def shapes_of(path: Path | Any) -> dict[str, dict[str, Any]]:
    """What collides, by the name of its surface: points in the stage, triangles and friction."""
    from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

    stage = stage_at(path) if isinstance(path, Path) else path
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    found = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot()):
        if not prim.HasAPI(UsdPhysics.CollisionAPI):
            continue
        assert UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "none"
        mesh = UsdGeom.Mesh(prim)
        turn = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0))
        points = np.array(mesh.GetPointsAttr().Get(), np.float64) @ turn[:3, :3] + turn[3, :3]
        faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
        for part, own in usd_parts(prim):
            bound, _ = UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial("physics")
            physics = UsdPhysics.MaterialAPI(bound)
            triangles = points[faces[own]]
            found[part.GetDisplayName()] = {
                "path": str(part.GetPath()),
                "points": triangles.reshape(-1, 3),
                "triangles": triangles,
                "faces": len(own),
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
    assert manifest["prims"] == ["/terrain/Mesh"]
    assert "Newton" not in manifest["losses"][0]
    *_, manifest = written(slopes(0.0), tmp_path / "more", "usd")
    count = len(FRICTION_ANGLES)
    assert re.fullmatch(
        rf"1 Mesh collides, of \d+ faces in {count} GeomSubsets", manifest["summary"]
    )
    *_, manifest = written(slopes(0.0), tmp_path / "apart", "usd", per_surface=True)
    words = rf"a Mesh for each of {count} surfaces collides, of \d+ faces together"
    assert re.fullmatch(words, manifest["summary"])


@PER_SURFACE
def test_each_surface_has_its_friction(per_surface: bool, tmp_path: Path) -> None:
    folder, _, manifest = written(slopes(0.0), tmp_path / "out", "usd", per_surface=per_surface)
    found = shapes_of(folder / "terrain.usdc")
    scope = "Surfaces" if per_surface else "Mesh"
    assert {one["path"] for one in found.values()} == {
        f"/terrain/{scope}/{name}" for name in FRICTION_ANGLES
    }
    assert set(manifest["prims"]) - {"/terrain/Mesh"} == {one["path"] for one in found.values()}
    assert {name: one["friction"] for name, one in found.items()} == {
        name: pytest.approx([math.tan(math.radians(angle))] * 2, rel=1e-6)
        for name, angle in FRICTION_ANGLES.items()
    }
    assert sum(one["faces"] for one in found.values()) == manifest["faces"]


@PER_SURFACE
def test_both_layouts_pass_pixars_validators(per_surface: bool, tmp_path: Path) -> None:
    pytest.importorskip("pxr.UsdValidation", reason="usd-core has no validators before 25.2")
    from pxr import UsdValidation

    folder, *_ = written(terrain_of(BARE), tmp_path / "out", "usd", per_surface=per_surface)
    context = UsdValidation.ValidationContext(
        UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    )
    errors = context.Validate(stage_at(folder / "terrain.usdc"))
    assert [(error.GetName(), error.GetMessage()) for error in errors] == []


@PER_SURFACE
def test_assumed_friction_is_in_the_file(per_surface: bool, tmp_path: Path) -> None:
    """Of a surface without a friction angle, and of ground without a surface."""
    for definition, name in ((SITE, "rock"), (BARE, "none")):
        folder, _, manifest = written(
            terrain_of(definition), tmp_path / name, "usd", friction=0.25, per_surface=per_surface
        )
        found = shapes_of(folder / "terrain.usdc")
        assert found[name]["friction"] == (0.25, 0.25)
        assert manifest["surfaces"][name]["friction"] == 0.25
    assert found["grass"]["friction"][0] == pytest.approx(math.tan(math.radians(20)))


def test_losses_say_what_readers_do_not_see(tmp_path: Path) -> None:
    *_, manifest = written(terrain_of(SITE), tmp_path / "one", "usd")
    said = " ".join(manifest["losses"])
    assert "Newton takes one friction for a Mesh, that of the first GeomSubset (rock)" in said
    assert "RayCaster" not in said
    *_, manifest = written(terrain_of(SITE), tmp_path / "apart", "usd", per_surface=True)
    said = " ".join(manifest["losses"])
    assert "RayCaster, and so its height scanner, meets the first Mesh alone" in said
    assert "Newton takes one friction" not in said


def test_names_are_identifiers() -> None:
    assert prim_names(["2 mm grit", "_2_mm_grit", "Löß", "砂", "Kies!"]) == [
        "_2_mm_grit", "_2_mm_grit_2", "Lo_", "surface", "Kies_",
    ]  # fmt: skip


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
    column = found["grass"]["points"]
    assert 0.5 * (column.min(axis=0) + column.max(axis=0))[:2] == pytest.approx(
        [500011 - zero[0], 4649777 - zero[1]], abs=1e-4
    )
    triangles = np.concatenate([one["triangles"] for one in found.values()])
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    level = normal[:, 2] > 1e-6
    x, y, z = triangles[level].mean(axis=1).T
    assert level.sum() > 100
    assert np.abs(ground.height(x, y) - z).max() < 0.0021


# --- in memory ------------------------------------------------------------------------------------


def user_terrain(value: dict[str, Any]) -> Any:
    return terratool.load(value)


def test_a_stage_in_memory_is_that_of_the_file(tmp_path: Path) -> None:
    """To the last character, but for where zero is: that of the world, unless asked otherwise."""
    terrain = user_terrain(SITE)
    for origin in ("world", (500002.5, 4649777.25, -1.5)):
        folder, *_ = written(
            terrain, tmp_path / str(origin)[:5], "usd", origin=origin, max_error=0.1
        )
        stage = terrain.to_usd_stage(origin=origin, max_error=0.1)
        file = stage_at(folder / "terrain.usdc")
        assert stage.GetRootLayer().ExportToString() == file.GetRootLayer().ExportToString()
    stage = terrain.to_usd_stage(max_error=0.1, per_surface=True)
    assert stage.GetRootLayer().anonymous
    points = np.concatenate([one["points"] for one in shapes_of(stage).values()])
    x, y, _ = points.T
    west, south, east, north = terrain.bounds
    assert (x.min(), y.min()) == pytest.approx((west, south), abs=1e-5)
    assert (x.max(), y.max()) == pytest.approx((east, north), abs=1e-5)


def test_a_stage_refuses_what_an_export_refuses() -> None:
    terrain = user_terrain(SITE)
    with pytest.raises(terratool.RequestError, match="largest error is 0"):
        terrain.to_usd_stage(max_error=0)
    with pytest.raises(terratool.RequestError, match="takes no 'max_geoms'"):
        terrain.to_usd_stage(max_geoms=3)


# --- Isaac Lab ------------------------------------------------------------------------------------


def first_mesh(stage: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points in the stage and triangles of the Mesh that Isaac Lab's RayCaster takes.

    As `_initialize_warp_meshes` of `isaaclab/sensors/ray_caster/ray_caster.py` does in 2.3: the
    first prim of the type Mesh below a path, level by level; its corners as triangles, whatever
    its faces are.
    """
    from pxr import UsdGeom

    pending = [stage.GetDefaultPrim()]
    while pending[0].GetTypeName() != "Mesh":
        pending += pending.pop(0).GetChildren()
    mesh = UsdGeom.Mesh(pending[0])
    turn = np.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(0)).T
    points = np.asarray(mesh.GetPointsAttr().Get()) @ turn[:3, :3].T + turn[:3, 3]
    return points, np.asarray(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)


def heights_below(
    points: NDArray[np.float64], faces: NDArray[np.int64], x: NDArray[Any], y: NDArray[Any]
) -> NDArray[np.float64]:
    """Heights at which rays from above end; NaN where they pass."""
    a, b, c = points[faces].transpose(1, 2, 0)
    twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    some = np.abs(twice) > 1e-12
    a, b, c, twice = a[:, some], b[:, some], c[:, some], twice[some]
    px, py = x[:, None] - a[0], y[:, None] - a[1]
    s = (px * (c[1] - a[1]) - (c[0] - a[0]) * py) / twice
    t = ((b[0] - a[0]) * py - px * (b[1] - a[1])) / twice
    z = a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2])
    hit = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
    return np.where(hit.any(axis=1), np.where(hit, z, -np.inf).max(axis=1), np.nan)


def share_seen(terrain: Terrain, stage: Any) -> float:
    """Share of rays of a height scanner that are within the error of the terrain."""
    west, south, east, north = terrain.bounds
    x, y = np.random.default_rng(3).uniform(0.001, 0.999, (2, 400))
    x, y = west + x * (east - west), south + y * (north - south)
    found, wanted = heights_below(*first_mesh(stage), x, y), terrain.height(x, y)
    same = np.isnan(found) & np.isnan(wanted)
    return float((same | (np.abs(found - wanted) < 0.011)).mean())


def test_isaac_labs_height_scanner_sees_all_of_it() -> None:
    """By rays on the first Mesh, which is all of it; a mirrored one is caught."""
    terrain = user_terrain(SITE)
    stage = terrain.to_usd_stage(max_error=0.01)
    assert share_seen(terrain, stage) > 0.99  # but for rays along walls
    from pxr import UsdGeom, Vt

    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/terrain/Mesh"))
    points = np.array(mesh.GetPointsAttr().Get())
    points[:, 0] = points[:, 0].max() - points[:, 0]
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points))
    assert share_seen(terrain, stage) < 0.95


def test_isaac_labs_height_scanner_sees_one_surface_of_several_meshes() -> None:
    terrain = slopes(0.1)
    for per_surface, least, most in ((False, 0.99, 1.0), (True, 0.0, 1.5 / len(FRICTION_ANGLES))):
        options = SceneOptions(origin="world", per_surface=per_surface)
        assert least <= share_seen(terrain, stage_of(scene_of(terrain, "", options))) <= most


# --- Newton ---------------------------------------------------------------------------------------


def newton_builder(path: Path) -> Any:
    newton = pytest.importorskip("newton", reason="newton is not installed")
    pytest.importorskip("newton_usd_schemas", reason="newton-usd-schemas is not installed")
    builder = newton.ModelBuilder()
    builder.add_usd(str(path))
    collide = newton.ShapeFlags.COLLIDE_SHAPES
    assert all(flags & collide for flags in builder.shape_flags)
    return builder


@pytest.mark.nightly
@PER_SURFACE
def test_newton_takes_all_faces(per_surface: bool, tmp_path: Path) -> None:
    """In their place; with the friction of each surface, or of the first of one Mesh alone."""
    folder, _, manifest = written(
        slopes(0.0), tmp_path / "out", "usd", origin=(1.0, 2.0, 3.0), per_surface=per_surface
    )
    builder = newton_builder(folder / "terrain.usdc")
    tangents = {name: math.tan(math.radians(angle)) for name, angle in FRICTION_ANGLES.items()}
    if per_surface:
        assert builder.shape_material_mu == pytest.approx(list(tangents.values()))
    else:
        said = " ".join(manifest["losses"])
        [first] = re.findall(r"first GeomSubset \((.+?)\)", said)
        assert builder.shape_material_mu == pytest.approx([tangents[first]])
    assert sum(len(one.indices) // 3 for one in builder.shape_source) == manifest["faces"]
    assert list(builder.shape_transform[0])[:3] == [-1.0, -2.0, -3.0]


@PER_SURFACE
def test_the_same_bytes(per_surface: bool, tmp_path: Path) -> None:
    found = []
    for run in range(2):
        folder, _, _ = written(
            terrain_of(BARE), tmp_path / str(run), "usd", origin="center", per_surface=per_surface
        )
        found.append(bytes_of(folder))
    assert found[0] == found[1]
