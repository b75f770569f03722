"""Normals: smooth where the terrain is smooth, creased where it is creased, and in an OBJ."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.mesh.export import write_mesh
from terratool.mesh.normals import with_normals
from terratool.mesh.types import BuiltMesh, Mesh, PlanLoss
from tests.commands import call
from tests.conftest import terrain_of
from tests.meshes import exported, exported_tiles
from tests.programs import program
from tests.viewers import mirrored, oblong, output

Floats = NDArray[np.float64]


def terrain(x: Any, y: Any = (1,), **element: Any) -> Terrain:
    """Level ground of 10 × 4 with one element from x = 4 to 8, y = 1 to 3."""
    return terrain_of(
        {
            "size": [10, 4],
            "elemTypes": {"floor": {"x": [0]}, "it": {"x": x, "y": y}},
            "elemTree": {
                "type": "floor",
                "cells": [5, 4],
                "children": [
                    {"type": "it", "cellX": 2, "cellY": 1, "span": [2, 2], "vScale": 1, **element}
                ],
            },
        }
    )


def normals_of(mesh: Mesh) -> Floats:
    """The normals of the corners of faces: (m, 3, 3)."""
    assert mesh.normals
    return mesh.normals.directions[mesh.normals.corners].astype(np.float64)


def flat_normals(mesh: Mesh) -> Floats:
    """Those of faces that are planes, in the same shape."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    found = np.cross(b - a, c - a)
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    return np.repeat(found[:, None], 3, axis=1)


def between(a: Floats, b: Floats) -> Floats:
    """Angles in degrees between two arrays of vectors."""
    found: Floats = np.degrees(2 * np.arcsin(np.linalg.norm(a - b, axis=-1) / 2))
    return found


def with_error(mesh: Mesh, error: float) -> Mesh:
    """A mesh with normals that are right if it is within an error of its terrain."""
    return with_normals(BuiltMesh(mesh, len(mesh.faces), error, PlanLoss()))


def test_a_box_has_five_normals() -> None:
    """All level ground shares one, on whatever level; each side has its own."""
    mesh = with_normals(build(terrain([1]), 0.1))
    assert mesh.normals
    assert sorted(mesh.normals.directions.tolist()) == [
        [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]
    ]  # fmt: skip
    assert np.array_equal(normals_of(mesh), flat_normals(mesh))


@pytest.mark.parametrize("steep", [0.1, 0.4, 1.5])
def test_ramps_and_ridges_are_creased(steep: float) -> None:
    """Where planes meet, each keeps its own normal up to the edge, even with the default error."""
    mesh = with_error(build(terrain([0, 1, 0.4, 0.4], vScale=steep), 0.005).mesh, 0.005)
    assert between(normals_of(mesh), flat_normals(mesh)).max() < 0.05
    assert len(mesh.vertices) < 200


def test_dunes_are_smooth() -> None:
    """At a corner that lies inside of a dune there is one normal, close to that of the terrain."""
    dune = terrain("cosbell", "cosbell", vScale=0.8)
    mesh = with_normals(build(dune, 0.002))
    normals, corners = normals_of(mesh), mesh.vertices[mesh.faces]
    x, y = (corners + mesh.origin)[..., :2].reshape(-1, 2).T
    inside = ((x > 4.3) & (x < 7.7) & (y > 1.3) & (y < 2.7)).reshape(-1, 3)
    assert inside.sum() > 400
    found, vertices = normals[inside], mesh.faces[inside]
    for vertex in np.unique(vertices).tolist():
        assert len(np.unique(found[vertices == vertex], axis=0)) == 1
    true = dune.sample(x, y).normal.reshape(-1, 3, 3)
    smooth, flat = (between(n, true)[inside].mean() for n in (normals, flat_normals(mesh)))
    assert smooth < 0.4 * flat


def test_surfaces_do_not_crease() -> None:
    """A dune that is half sand and half rock is as smooth as one of sand."""
    mesh = build(terrain("cosbell", "cosbell"), 0.01).mesh
    parted = replace(mesh, surfaces=np.arange(len(mesh.faces), dtype=np.int32) % 2)
    assert np.array_equal(normals_of(with_error(mesh, 0.01)), normals_of(with_error(parted, 0.01)))


def roof(*faces: tuple[int, int, int], walls: tuple[int, ...] = ()) -> Mesh:
    """Two planes that meet along x = 0 at 5.7°: 3 wide in the west, 1 in the east."""
    points = [(-3, 0, 0), (0, 0, 0), (0, 4, 0), (-3, 4, 0), (1, 0, -0.1), (1, 4, -0.1)]
    return replace(
        oblong(),
        vertices=np.array(points, float),
        faces=np.array(faces or [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2)], np.int32),
        surfaces=np.zeros(4, np.int32),
        walls=np.isin(np.arange(4), walls),
    )


def test_the_error_decides_what_is_a_crease() -> None:
    """A surface that turns by θ over the wider face, of width w, is θ w / 8 above it."""
    limit = 0.1 * 3 / 8  # the angle is 0.0997
    for error, creased in ((0.98 * limit, True), (1.02 * limit, False)):
        mesh = with_error(roof(), error)
        west, east = normals_of(mesh)[0, 1], normals_of(mesh)[2, 0]
        assert (not np.array_equal(west, east)) == creased
    # by area: three faces of 6 in the west, two of 2 in the east, of which vertex 1 has 1 and 2
    wanted = 6 * np.array([0, 0, 1]) + 4.02 * np.array([0.0995, 0, 0.995])
    assert between(west, wanted / np.linalg.norm(wanted)) < 0.1
    assert np.array_equal(normals_of(mesh)[0, 0], [0, 0, 1])


def test_walls_are_flat() -> None:
    """Even where a wall shares an edge with faces that it hardly turns from."""
    mesh = with_error(roof(walls=(2, 3)), 10.0)
    assert between(normals_of(mesh), flat_normals(mesh)).max() < 0.05


def test_sharp_edges_are_creases_whatever_the_error() -> None:
    """More than 45 degrees are no bend, but 40 may be one."""
    for degrees, creased in ((50, True), (40, False)):
        mesh = roof()
        mesh.vertices[4:, 2] = -np.tan(np.radians(degrees))
        mesh = with_error(mesh, 10.0)
        assert (not np.array_equal(normals_of(mesh)[0, 1], normals_of(mesh)[2, 0])) == creased


@pytest.mark.parametrize("axis", range(3))
def test_normals_of_a_mirrored_mesh(axis: int) -> None:
    """They are mirrored, up to the rounding of what lies in the middle of two."""
    mesh = build(terrain("cosbell", [0, 1, 0.3], turnDeg=20), 0.02).mesh
    found = normals_of(with_error(mirrored(mesh, axis), 0.02))[:, ::-1]
    found[..., axis] *= -1
    assert np.abs(found - normals_of(with_error(mesh, 0.02))).max() < 1.1e-3


def test_faces_without_area() -> None:
    """They have some normal of length 1, and their neighbours are not disturbed."""
    mesh = roof((0, 1, 2), (0, 2, 3), (1, 2, 2), (1, 1, 1))
    assert np.array_equal(normals_of(with_error(mesh, 0.1)), np.full((4, 3, 3), [0, 0, 1]))


# --- in a file ----------------------------------------------------------------------------------


def corners_by_trimesh(path: Path) -> tuple[Floats, Floats]:
    """Corners and their normals as trimesh reads them: (m, 3, 3) each."""
    trimesh = pytest.importorskip("trimesh")
    shapes = trimesh.load_scene(path, process=False).geometry.values()
    return (
        np.concatenate([shape.vertices[shape.faces] for shape in shapes]),
        np.concatenate([shape.vertex_normals[shape.faces] for shape in shapes]),
    )


def corners_by_assimp(path: Path) -> tuple[Floats, Floats]:
    """The same by assimp."""
    into = path.with_name(path.name + ".assjson")
    output(program("assimp"), "export", path, into, "-fassjson")
    shapes = json.loads(into.read_text(encoding="utf-8"), strict=False)["meshes"]
    assert all(len(shape["normals"]) == len(shape["vertices"]) for shape in shapes)
    points, normals = (
        np.concatenate([np.reshape(shape[key], (-1, 3))[shape["faces"]] for shape in shapes])
        for key in ("vertices", "normals")
    )
    return points, normals


@pytest.mark.parametrize("read", [corners_by_trimesh, corners_by_assimp])
def test_others_read_the_normals(
    read: Callable[[Path], tuple[Floats, Floats]], tmp_path: Path
) -> None:
    """Each corner has the normal that it should have; there are three surfaces."""
    mesh = with_error(oblong(), 0.5)
    points, normals = read(write_mesh(mesh, tmp_path / "t.obj")[0])
    found, wanted = places_of(points), places_of(mesh.vertices[mesh.faces])
    far = np.linalg.norm(found[:, None] - wanted, axis=-1)
    assert far.min(axis=1).max() < 0.01
    nearest = far.argmin(axis=1)
    assert sorted(nearest.tolist()) == list(range(36))
    normals = normals.reshape(-1, 3)
    assert normals == pytest.approx(normals_of(mesh).reshape(-1, 3)[nearest], abs=1.5e-3)


def places_of(points: Floats) -> Floats:
    """Each corner with the middle of its face: these differ, whatever the order of the faces is."""
    middles = np.repeat(points.mean(axis=1, keepdims=True), 3, axis=1)
    return np.concatenate([points, middles], axis=2).reshape(-1, 6)


def test_mujoco_takes_all_faces(tmp_path: Path) -> None:
    """A mesh of one surface with normals is an asset as it is."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    path = tmp_path / "t.obj"
    report = exported(terrain("cosbell", [0, 1, 0.3]), path)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" file="{path}"/></asset>'
        '<worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>'
    )
    assert model.nmeshface == report.faces


def test_lines_of_an_obj(tmp_path: Path) -> None:
    """Without normals a file is what it was; normals are said once, after the vertices."""
    path, bare = tmp_path / "t.obj", tmp_path / "bare.obj"
    report = exported(terrain([1]), path, 0.1)
    exported(terrain([1]), bare, 0.1, normals=False)
    lines = path.read_text().splitlines()
    assert sum(line.startswith("vn ") for line in lines) == 5
    faces = [line.split()[1:] for line in lines if line.startswith("f ")]
    assert len(faces) == report.faces
    assert {int(corner.split("//")[1]) for face in faces for corner in face} == set(range(1, 6))
    less = [" ".join(part.split("//")[0] for part in line.split(" ")) for line in lines]
    less = [line for line in less if not line.startswith("vn ")]
    assert less == bare.read_text().replace("bare.mtl", "t.mtl").splitlines()


def test_tiles_have_normals(tmp_path: Path) -> None:
    """All of them."""
    exported_tiles(terrain("cosbell", [0, 1, 0.3]), tmp_path / "t", ".obj", 0.01, 1, 2)
    for path in sorted((tmp_path / "t").glob("*.obj")):
        assert path.read_text().count("\nvn ") >= 5


def test_the_option(tmp_path: Path) -> None:
    """--no-normals is for an OBJ only, and other files are said to have none before any work."""
    file = tmp_path / "t.json"
    file.write_text(
        json.dumps({"size": 3, "elemTypes": {"f": {"x": [0]}}, "elemTree": {"type": "f"}})
    )
    for command in ("export-obj", "export-mesh"):
        for options, count in (((), 1), (("--no-normals",), 0)):
            ran = call(command, file, tmp_path / "t.obj", "--overwrite", *options)
            assert ran.code == 0, ran.err
            assert (tmp_path / "t.obj").read_text().count("\nvn ") == count
