"""Simulators find decks and bores: from above, from below, from within, and as bodies do."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import terratool
from terratool.simulators.targets import TARGETS
from tests.commands import call
from tests.conftest import terrain_of
from tests.simulators import checks
from tests.simulators.bullet import Bullet
from tests.simulators.checks import RADIUS, Ground, Simulator, written
from tests.simulators.mujoco_adapter import MuJoCo
from tests.simulators.storeyed import DEPOT, SHELVES, TUNNEL

NOTE = "3 decks are not shown: this is the ground without them."
ERROR = 0.0025
"""Of what collides, and of numbers in float32."""


@pytest.fixture
def load() -> Iterator[Callable[[str, Path], Simulator]]:
    """Load the files of a simulator; at the end of the test it goes."""
    opened: list[Bullet] = []

    def one(name: str, folder: Path) -> Simulator:
        pytest.importorskip(name, reason=f"{name} is not installed")
        if name == "mujoco":
            return MuJoCo(folder)
        opened.append(Bullet(folder))
        return opened[-1]

    yield one
    for bullet in opened:
        bullet.close()


class MirroredGround(Ground):
    """East is west."""

    def ends(self, x: Any, y: Any) -> np.ndarray:
        west, _, east, _ = self.bounds
        return super().ends(west + east - np.asarray(x), y)


class TransposedGround(Ground):
    """East is north."""

    def ends(self, x: Any, y: Any) -> np.ndarray:
        return super().ends(y, x)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_rays_and_bodies_find_decks_and_bores(
    name: str, load: Callable[[str, Path], Simulator], tmp_path: Path
) -> None:
    """All floors, undersides and ceilings; and the checks refuse other terrains."""
    folder, ground, _ = written(terrain_of(DEPOT), tmp_path / "out", name, origin="center")
    simulator = load(name, folder)
    assert checks.check_columns(simulator, ground, ERROR, 700) > 900
    assert checks.check_casts(simulator, ground, ERROR) > 80
    assert checks.check_floors(simulator, ground, 12) >= 12
    for other in (
        MirroredGround(ground.terrain, ground.zero),
        TransposedGround(ground.terrain, ground.zero),
        Ground(ground.terrain.ground_alone, ground.zero),
    ):
        with pytest.raises(AssertionError):
            checks.check_columns(simulator, other, ERROR, 700)


class TriangleRays:
    """Rays on triangles, (n, 3, 3), by the formula of T. Möller and B. Trumbore, Fast, minimum
    storage ray/triangle intersection, Journal of Graphics Tools 2 (1997)."""

    def __init__(self, triangles: np.ndarray) -> None:
        self.corner = triangles[:, 0]
        self.sides = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]

    def ray(self, start: list[float], end: list[float]) -> list[float] | None:
        one, other = self.sides
        way, to = np.subtract(end, start), np.array(start) - self.corner
        normal = np.cross(np.broadcast_to(way, other.shape), other)
        size = (one * normal).sum(axis=1)
        size[size == 0] = np.nan
        u = (to * normal).sum(axis=1) / size
        across = np.cross(to, one)
        v, far = (across @ way) / size, (other * across).sum(axis=1) / size
        met = far[(u >= 0) & (v >= 0) & (u + v <= 1) & (far >= 0) & (far <= 1)]
        return (np.array(start) + way * met.min()).tolist() if len(met) else None


def triangles_of_objs(folder: Path, place: Any) -> np.ndarray:
    found = []
    for path in sorted(folder.glob("*.obj")):
        rows = [line.split() for line in path.read_text("utf-8").splitlines()]
        points = np.array([row[1:] for row in rows if row[:1] == ["v"]], float)
        faces = [[end.split("/")[0] for end in row[1:]] for row in rows if row[:1] == ["f"]]
        found.append(points[np.array(faces, int) - 1] + place)
    return np.concatenate(found)


def triangles_of_usd(folder: Path) -> np.ndarray:
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from tests.simulators.test_usd import shapes_of

    shapes = shapes_of(folder / "terrain.usdc")
    return np.concatenate([shape["triangles"] for shape in shapes.values()])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["chrono", "gazebo", "usd"])
def test_meshes_have_undersides_and_ceilings(name: str, tmp_path: Path) -> None:
    """Those that are seen; in Chrono and USD they collide."""
    if name == "usd":
        pytest.importorskip("pxr", reason="usd-core is not installed")
    folder, ground, manifest = written(terrain_of(DEPOT), tmp_path / "out", name, origin="center")
    west, south, _, _ = ground.bounds
    triangles = (
        triangles_of_usd(folder) if name == "usd" else triangles_of_objs(folder, (west, south, 0))
    )
    assert len(triangles) == manifest["faces"]
    assert checks.check_columns(TriangleRays(triangles), ground, ERROR, 400) > 500
    with pytest.raises(AssertionError):
        checks.check_columns(TriangleRays(triangles * (-1, 1, 1)), ground, ERROR, 400)


BOXES = [  # x, y, z of the middle, side lengths, degrees to the left, friction angle
    ((2.2, 2.4, 0.85), (2.4, 0.8, 0.1), -25.0, 20.0),  # turnDeg is clockwise
    ((5.2, 1.7, 1.675), (1.5, 0.5, 0.05), 0.0, 40.0),
    ((6.4, 4.1, 0.725), (1.8, 0.4, 0.15), 0.0, 20.0),
]


def boxes_of(name: str, folder: Path) -> list[tuple[list[float], list[float], float, float]]:
    """Middle, side lengths, turn in radians and friction of the boxes of a file over the ground."""
    found = []
    if name == "mujoco":
        root = ET.parse(folder / "terrain.xml").getroot()
        frictions = {
            str(own.get("class")): contact.get("friction", "")
            for own in root.iter("default")
            if (contact := own.find("geom")) is not None
        }
        for geom in root.iter("geom"):
            if geom.get("type") == "box":
                words = {"xyaxes": "1 0 0 0 1 0", **geom.attrib}
                place, half, axes = (
                    [float(word) for word in words[key].split()]
                    for key in ("pos", "size", "xyaxes")
                )
                contact = float(frictions[words["class"]].split()[0])
                sides = [2 * side for side in half]
                found.append((place, sides, math.atan2(axes[1], axes[0]), contact))
    elif name == "gazebo":
        for shape in ET.parse(folder / "model.sdf").iter("collision"):
            if (size := shape.findtext("geometry/box/size")) is not None:
                pose = [float(word) for word in shape.findtext("pose", "").split()]
                friction = float(shape.findtext("surface/friction/ode/mu", ""))
                assert friction == float(shape.findtext("surface/friction/bullet/friction", ""))
                found.append((pose[:3], [float(word) for word in size.split()], pose[5], friction))
    else:
        for link in ET.parse(folder / "terrain.urdf").iter("link"):
            for shape in link.iter("collision"):
                if (box := shape.find("geometry/box")) is not None:
                    origin, contact = shape.find("origin"), link.find("contact/lateral_friction")
                    assert origin is not None and contact is not None
                    words = (box.get("size", ""), origin.get("xyz", ""), origin.get("rpy", ""))
                    sides, place, turn = ([float(word) for word in one.split()] for one in words)
                    found.append((place, sides, turn[2], float(contact.get("value", ""))))
    return sorted(one for one in found if one[0][2] - 0.5 * one[1][2] > 0.3)


@pytest.mark.parametrize("name", ["mujoco", "gazebo", "pybullet"])
def test_level_decks_are_exact_boxes(name: str, tmp_path: Path) -> None:
    """Turned as they are, whole where a post has taken a corner, with their own friction."""
    folder, _, manifest = written(terrain_of(SHELVES), tmp_path / "out", name, origin="world")
    found = boxes_of(name, folder)
    assert len(found) == len(BOXES)
    for (middle, sides, turn, angle), own in zip(BOXES, found, strict=True):
        assert own[0] == pytest.approx(middle, abs=1e-6)
        assert own[1] == pytest.approx(sides, abs=1e-6)
        assert math.degrees(own[2]) == pytest.approx(turn, abs=1e-4)
        assert own[3] == pytest.approx(math.tan(math.radians(angle)), rel=1e-5)
    if name != "mujoco":  # four around the void, and the post
        assert manifest["boxes"] == len(BOXES) + 5 and manifest["meshed"] == 0


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_a_sphere_that_falls_on_a_shelf_does_not_reach_the_floor(
    name: str, load: Callable[[str, Path], Simulator], tmp_path: Path
) -> None:
    """From 0.8 m above it; at the same x and y one rests on the floor below, and none over void."""
    folder, _, _ = written(terrain_of(SHELVES), tmp_path / "out", name, origin="world")
    simulator = load(name, folder)
    for x, y, top, floor in ((5.6, 1.75, 1.7, 0.2), (1.8, 2.2, 0.9, 0.2), (6.7, 4.15, 0.8, None)):
        fallen = simulator.drop(x, y, top + 0.8, RADIUS)
        assert fallen is None or fallen == pytest.approx(top, abs=0.004)
        assert simulator.drop(x, y, top, RADIUS) == pytest.approx(top, abs=0.004)
        below = simulator.drop(x, y, 0.2, RADIUS)
        assert below is None if floor is None else below == pytest.approx(floor, abs=0.004)


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_a_deck_over_void_alone(
    name: str, load: Callable[[str, Path], Simulator], tmp_path: Path
) -> None:
    """There is no ground at all, and one box."""
    tree = {
        **SHELVES["elemTree"],
        "surface": "pit",
        "children": SHELVES["elemTree"]["children"][:1],
    }
    value = {**SHELVES, "elemTree": tree}
    folder, ground, manifest = written(terrain_of(value), tmp_path / "out", name)
    assert (manifest["collision"]["box"] if name == "mujoco" else manifest["boxes"]) == 1
    assert checks.check_columns(load(name, folder), ground, ERROR, 300) > 20


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_a_sphere_rolls_through_a_tunnel(
    name: str, load: Callable[[str, Path], Simulator], tmp_path: Path
) -> None:
    """From one portal to the other, on its floor; beside the tunnel the hill stops it."""
    folder, _, _ = written(terrain_of(TUNNEL), tmp_path / "out", name, origin="world")
    simulator = load(name, folder)
    x, y, z = simulator.roll([2.6, 2.1, RADIUS + 0.001], [1, 0], RADIUS)
    assert x > 5 and y == pytest.approx(2.1, abs=0.3) and z == pytest.approx(RADIUS, abs=0.004)
    x, _, z = simulator.roll([2.6, 3.4, RADIUS + 0.001], [1, 0], RADIUS)
    assert x == pytest.approx(3 - RADIUS, abs=0.01) and z == pytest.approx(RADIUS, abs=0.004)


@pytest.mark.slow
def test_what_shows_the_ground_alone_says_so(tmp_path: Path) -> None:
    """A picture of heights, and no target: neither in the manifest, nor in the README."""
    (tmp_path / "shelves.json").write_text(json.dumps(SHELVES), "utf-8")
    names = [name for name, one in TARGETS.items() if not one.needs or find_spec(one.needs[0])]
    words = [word for name in names for word in ("--target", name)]
    ran = call("export-sim", tmp_path / "shelves.json", tmp_path / "a", *words,
               "--resolution", 0.5, "--json")  # fmt: skip
    assert ran.code == 0 and ran.err == ""
    for name, found in json.loads(ran.out)["targets"].items():
        readme = (tmp_path / "a" / name / "README.md").read_text("utf-8")
        assert NOTE not in found["losses"] and NOTE not in readme, name
        counted = any(line.startswith("Storeys: 3 decks;") for line in found["losses"])
        assert counted == (name not in ("nav2", "grid-map"))
    ran = call("export-sim", tmp_path / "shelves.json", tmp_path / "b", "--target", "gazebo",
               "--heightmap")  # fmt: skip
    assert NOTE in ran.out and NOTE in (tmp_path / "b/gazebo/README.md").read_text("utf-8")
    picture = Image.open(tmp_path / "b/gazebo/heights.png")
    assert 0 < np.count_nonzero(np.asarray(picture)) < 12  # the post alone is above the ground


@pytest.mark.slow
def test_flexes_and_grids_have_storeys(tmp_path: Path) -> None:
    """The mesh of all is the flex; a root that is one grid is no height field below a deck."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    folder, ground, _ = written(terrain_of(SHELVES), tmp_path / "a", "mujoco", flex=True)
    assert checks.check_columns(MuJoCo(folder, group=2), ground, ERROR, 200) > 100
    grid = {"grid": [[0, 0.3, 0.1], [0.2, 0.4, 0]]}
    tree = {**SHELVES["elemTree"], "type": "grid", "children": SHELVES["elemTree"]["children"][:1]}
    value = {**SHELVES, "elemTypes": {**SHELVES["elemTypes"], "grid": grid}, "elemTree": tree}
    folder, ground, manifest = written(terrain_of(value), tmp_path / "b", "mujoco")
    assert manifest["collision"]["box"] >= 1
    assert checks.check_columns(MuJoCo(folder), ground, ERROR, 300) > 200


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
@pytest.mark.parametrize("sample", ["car-park", "rack-hall", "gorge"])
def test_samples(
    sample: str, name: str, load: Callable[[str, Path], Simulator], tmp_path: Path
) -> None:
    """Rays from within all gaps, and spheres on all floors."""
    terrain = terratool.load(f"samples/{sample}.json")
    folder, ground, manifest = written(terrain, tmp_path / "out", name, origin="center")
    error = 1.01 * manifest["collision"]["error"] + 5e-4 if name == "mujoco" else ERROR
    simulator = load(name, folder)
    assert checks.check_columns(simulator, ground, error, 3000) > 3000
    if sample != "gorge":  # where next to nothing is level
        assert checks.check_floors(simulator, ground, 12) >= 12


@pytest.mark.nightly
def test_a_cave_in_mujoco(tmp_path: Path) -> None:
    """Curved floors and ceilings, within the error that is told."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    terrain = terratool.load("samples/cave.json")
    folder, ground, manifest = written(terrain, tmp_path / "out", "mujoco", max_error=0.1)
    counts = manifest["collision"]
    assert sum(counts[kind] for kind in ("box", "mesh", "hfield")) <= 2000
    assert counts["error"] < 0.5
    checks.check_columns(MuJoCo(folder, group=2), ground, 0.11, 3000)
