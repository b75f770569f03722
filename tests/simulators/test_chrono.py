"""Project Chrono: the files say what the terrain is; Chrono itself is not asked."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import terrain_of
from tests.meshes import SITE
from tests.simulators.checks import bytes_of, written

SURFACES: dict[str, Any] = {
    "rock": {"preset": "concrete", "color": [51, 0, 255]},
    "grass": {"preset": "dry-sand", "cohesion": [1, 4], "shearModulus": 0.03},
    "hole": {"void": True},
}
SOILS = {**SITE, "surfTypes": SURFACES}


def read(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


def test_a_patch_for_each_surface(tmp_path: Path) -> None:
    """As Chrono's RigidMesh.json is: keys, friction, colour, and where zero is."""
    folder, _, _ = written(terrain_of(SOILS), tmp_path / "o", "chrono", origin="center")
    found = read(folder / "terrain.json")
    assert (found["Type"], found["Template"]) == ("Terrain", "RigidTerrain")
    rock, grass = found["Patches"]
    assert rock["Location"] == grass["Location"] == [-6, -4, 0]
    assert rock["Orientation"] == [1, 0, 0, 0]
    assert rock["Geometry"]["Mesh Filename"] == "rock.obj"
    frictions = [one["Contact Material"]["Coefficient of Friction"] for one in (rock, grass)]
    # 0.75 of concrete, by an angle of one decimal, and 28 degrees
    assert frictions == pytest.approx([0.75, math.tan(math.radians(28))], abs=1e-3)
    assert all("Coefficient of Restitution" in one["Contact Material"] for one in (rock, grass))
    assert rock["Visualization"]["Color"] == [0.2, 0, 1]


@pytest.mark.parametrize("origin", ["local", "center", "world", (500003.0, 4649775.0, 2.0)])
def test_meshes_are_where_the_terrain_is(origin: Any, tmp_path: Path) -> None:
    """Points of the column in the south-east, by the place of its patch."""
    folder, ground, _ = written(terrain_of(SOILS), tmp_path / "o", "chrono", origin=origin)
    for patch in read(folder / "terrain.json")["Patches"]:
        lines = (folder / patch["Geometry"]["Mesh Filename"]).read_text("utf-8").splitlines()
        points = np.array([line.split()[1:] for line in lines if line[:2] == "v "], np.float64)
        points += patch["Location"]
        faces = np.array(
            [
                [int(corner.split("//")[0]) - 1 for corner in line.split()[1:]]
                for line in lines
                if line[:2] == "f "
            ]
        )
        triangles = points[faces]
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        x, y, z = triangles[normal[:, 2] > 1e-6].mean(axis=1).T
        assert np.abs(ground.height(x, y) - z).max() < 0.0021
        assert (np.unique(ground.terrain.surface(x + ground.zero[0], y + ground.zero[1]))) == [
            patch["Geometry"]["Mesh Name"]
        ]


def test_soils_are_in_si_units(tmp_path: Path) -> None:
    """Wong's dry sand: kφ 1528.43 kN/m^(n+2), kc 0.99 kN/m^(n+1), n 1.1, φ 28°."""
    folder, _, manifest = written(terrain_of(SOILS), tmp_path / "o", "chrono")
    found = read(folder / "scm.json")
    assert found["surfaces"] == {
        "rock": {
            "Bekker Kphi": None,
            "Bekker Kc": None,
            "Bekker n": None,
            "Mohr Cohesion": 0,
            "Mohr Friction": 36.9,
            "Janosi Shear": None,
            "Elastic K": None,
            "Damping R": None,
        },
        "grass": {
            "Bekker Kphi": 1528430,
            "Bekker Kc": 990,
            "Bekker n": 1.1,
            "Mohr Cohesion": 2500,  # the middle of 1 to 4 kPa
            "Mohr Friction": 28,
            "Janosi Shear": 0.03,
            "Elastic K": None,
            "Damping R": None,
        },
    }
    for named in ("units", "from"):
        assert list(found[named]) == list(found["surfaces"]["grass"])
    assert any("no Bekker figures" in line and "rock" in line for line in manifest["losses"])
    assert any("has not read" in line for line in manifest["losses"])


def test_what_has_no_figures_has_nulls(tmp_path: Path) -> None:
    """A surface that says nothing, and ground without a surface."""
    tree = {key: value for key, value in SITE["elemTree"].items() if key != "surface"}
    folder, _, _ = written(terrain_of({**SITE, "elemTree": tree}), tmp_path / "o", "chrono")
    found = read(folder / "scm.json")["surfaces"]
    assert list(found) == ["grass", "none"]
    assert {value for soil in found.values() for value in soil.values()} == {None}


def test_the_same_bytes(tmp_path: Path) -> None:
    found = []
    for run in range(2):
        folder, _, _ = written(terrain_of(SOILS), tmp_path / str(run), "chrono")
        found.append(bytes_of(folder))
    assert found[0] == found[1]
