"""Meshes that look as if another axis were up; ground, steep ground, walls and solids."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import terratool
from terratool.importing.meshes import read_triangles
from terratool.importing.types import Triangles
from terratool.importing.upright import turn_up, up_note
from tests.commands import ROOT


def sheet(heights: Any, across: float = 100.0, along: float = 60.0) -> Triangles:
    """A field of heights over an oblong, z up, as a function of x and y."""
    x, y = np.meshgrid(np.linspace(0, across, 31), np.linspace(0, along, 19))
    points = np.column_stack(
        [x.ravel(), y.ravel(), np.broadcast_to(heights(x, y), x.shape).ravel()]
    )
    n = np.arange(31 * 19).reshape(19, 31)
    a, b, c, d = (each.ravel() for each in (n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Triangles(points, faces.astype(np.int32))


def solid(
    heights: Any, across: float = 100.0, along: float = 60.0, base: float = -9.0
) -> Triangles:
    """The same with a flat underside, and sides."""
    top = sheet(heights, across, along)
    count = len(top.vertices)
    points = np.concatenate([top.vertices, top.vertices * (1, 1, 0) + (0, 0, base)])
    n = np.arange(count).reshape(19, 31)
    rim = np.concatenate([n[0, :-1], n[:-1, -1], n[-1, :0:-1], n[:0:-1, 0]])
    after = np.roll(rim, -1)
    faces = [top.faces, top.faces[:, ::-1] + count, np.column_stack([rim, after + count, after]),
             np.column_stack([rim, rim + count, after + count])]  # fmt: skip
    return Triangles(points, np.concatenate(faces).astype(np.int32))


def scene(*parts: trimesh.Trimesh) -> Triangles:
    mesh = trimesh.util.concatenate(list(parts))
    return Triangles(np.array(mesh.vertices), np.asarray(mesh.faces, np.int32))


def block(size: Any, at: Any) -> trimesh.Trimesh:
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


def bumps(x: Any, y: Any) -> Any:
    return 3 * np.sin(x / 9) * np.cos(y / 7) + 0.02 * x


GROUND = {
    "bumps": sheet(bumps),
    "a ridge": sheet(lambda x, y: 9 * np.sin(np.pi * x / 100)),
    "a tilt": sheet(lambda x, y: 0.2 * y + bumps(x, y)),
    "even": sheet(lambda x, y: 0.0),
    "an even tilt": sheet(lambda x, y: 0.1 * y),
    "inside out": Triangles(sheet(bumps).vertices, sheet(bumps).faces[:, ::-1]),
    "a solid": solid(bumps),
    "a solid strip": solid(bumps, 25.0),
    "shelves": scene(
        block((100, 60, 1), (50, 30, -0.5)),
        *(block((3, 50, 8), (x, 30, 4)) for x in range(10, 100, 10)),
    ),
}
"""Ground, z up, that is neither steep nor a wall."""
OTHERS = {
    "steep": sheet(lambda x, y: 1.7 * y + bumps(x, y)),
    "very steep": sheet(lambda x, y: 2.7 * y + 0.3 * bumps(x, y)),
    "a quarry": sheet(lambda x, y: np.clip((y - 25) * 12, 0, 100) + 0.2 * bumps(x, y)),
    "a wall": scene(block((20, 0.5, 3), (10, 0, 1.5))),
    "a fence on a strip": scene(block((90, 4, 1), (45, 2, -0.5)), block((90, 0.3, 9), (45, 2, 4))),
    "a ball": scene(trimesh.creation.icosphere(2)),
    "a high strip": solid(bumps, 4.0, -20.0),
}
"""Meshes, z up, that could be something else; steep ones and walls."""


def y_up(triangles: Triangles) -> Triangles:
    x, y, z = triangles.vertices.T
    return Triangles(np.column_stack([x, z, -y]), triangles.faces)


@pytest.mark.parametrize("name", GROUND)
def test_ground_that_lies_on_its_side_is_told(name: str) -> None:
    """In both directions: y up taken for z, and z up taken for y; what is right needs no note."""
    right = GROUND[name]
    tipped = y_up(right)
    (note,) = up_note(tipped, "z")
    assert note.endswith("If so, say --up y.")
    (note,) = up_note(right, "y")
    assert note.endswith("If so, say --up z.")
    assert up_note(right, "z") == up_note(tipped, "y") == ()


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("swapped", [False, True])
def test_steep_ground_and_walls_are_believed(name: str, swapped: bool) -> None:
    """Also where x and y are exchanged."""
    triangles = OTHERS[name]
    if swapped:
        turned = triangles.vertices[:, [1, 0, 2]] * (-1, 1, 1)
        triangles = Triangles(turned, triangles.faces)
    assert up_note(triangles, "z") == ()
    assert up_note(y_up(triangles), "y") == ()


@pytest.mark.parametrize("name", ["ramp-yard", "stairs-and-kerbs", "warehouse"])
@pytest.mark.parametrize("solid", [False, True])
def test_samples_draw_no_note(name: str, solid: bool, tmp_path: Path) -> None:
    terrain = terratool.load(ROOT / "samples" / f"{name}.json")
    for suffix in (".stl", ".glb"):
        path = tmp_path / f"{name}{suffix}"
        terrain.write_mesh(path, max_error=0.5, solid=solid)
        assert not any("--up" in note for note in read_triangles(path).notes)


def test_the_note_comes_with_the_file_and_goes_with_the_option(tmp_path: Path) -> None:
    path = tmp_path / "side.obj"
    mesh = y_up(sheet(bumps))
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    found = read_triangles(path)
    assert np.allclose(np.ptp(found.vertices, axis=0)[[0, 2]], (100, 60))  # nothing is turned
    assert [note for note in found.notes if "--up y" in note] == list(found.notes)
    told = read_triangles(path, up="y")
    assert told.notes == ("The file has y up: x stays east, and its z points south.",)
    assert np.allclose(told.vertices, sheet(bumps).vertices, atol=1e-6)
    assert not any("--up" in note for note in read_triangles(path, up="z").notes)


def test_each_axis_is_turned_without_a_mirror() -> None:
    points = np.array([(1.0, 2, 3), (-4, 5, 6), (7, -8, 9)])
    for up in "xyz":
        turned = turn_up(points, up)
        assert (turned[:, 2] == points[:, "xyz".index(up)]).all()
        assert np.linalg.det(turned) == pytest.approx(np.linalg.det(points))
