"""PyBullet finds the ground, the walls and the friction of the terrain."""

from __future__ import annotations

import math
import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.field.terrain import Terrain
from tests.conftest import terrain_of
from tests.meshes import SITE
from tests.simulators import checks
from tests.simulators.bullet import Bullet
from tests.simulators.checks import Ground, bytes_of, written

pytest.importorskip("pybullet", reason="pybullet is not installed")

SAMPLES = ("warehouse", "stairs-and-kerbs", "ramp-yard", "obstacle-course")
ERROR = 0.0021
"""Of the mesh, and of numbers in float32."""

Load = Callable[[Path], Bullet]


@pytest.fixture
def load() -> Iterator[Load]:
    """Load a folder; at the end of the test the simulator goes."""
    opened: list[Bullet] = []

    def one(folder: Path) -> Bullet:
        opened.append(Bullet(folder))
        return opened[-1]

    yield one
    for bullet in opened:
        bullet.close()


def sample(name: str) -> Terrain:
    return terratool.load(f"samples/{name}.json")


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_rays_and_bodies_find_the_terrain(name: str, load: Load, tmp_path: Path) -> None:
    """Ground, both sides of walls, rests, and where a sphere stops that rolls to a wall."""
    folder, ground, _ = written(sample(name), tmp_path / "out", "pybullet", origin="center")
    bullet = load(folder)
    checks.check_rays(bullet, ground, ERROR)
    checks.check_walls(bullet, ground, ERROR)
    checks.check_rest(bullet, ground)
    checks.check_roll(bullet, ground)


@pytest.mark.parametrize("origin", ["local", "world", (500003.5, 4649777.25, 1.5)])
def test_void_lets_through(origin: Any, load: Load, tmp_path: Path) -> None:
    """Rays and spheres, wherever zero is; what is around it is solid."""
    folder, ground, _ = written(terrain_of(SITE), tmp_path / "out", "pybullet", origin=origin)
    bullet = load(folder)
    checks.check_void(bullet, ground)
    checks.check_rays(bullet, ground, ERROR)
    checks.check_rest(bullet, ground)


def test_boxes_slide_as_friction_says(load: Load, tmp_path: Path) -> None:
    """Two degrees below the friction angle of each surface they hold, two above they slide."""

    def simulator(terrain: Terrain) -> Bullet:
        place = tmp_path / str(len(list(tmp_path.iterdir())))
        return load(written(terrain, place, "pybullet")[0])

    checks.check_slopes(simulator)


def test_level_ground_is_boxes_and_cylinders(load: Load, tmp_path: Path) -> None:
    """Exact from above and from aside, without a mesh; boxes slide on it as they should."""
    folder, ground, manifest = written(terrain_of(checks.LEVEL), tmp_path / "out", "pybullet")
    assert (manifest["boxes"], manifest["cylinders"], manifest["meshed"]) == (2, 1, 0)
    bullet = load(folder)
    checks.check_rays(bullet, ground, 1e-4)
    checks.check_rest(bullet, ground, count=12)
    disc = ET.parse(folder / "terrain.urdf").find("link/collision/geometry/cylinder")
    assert disc is not None and float(disc.get("radius", "")) == pytest.approx(1.5, abs=1e-5)
    for angle in (0.0, 0.1, 2.0):
        way = np.array([math.cos(angle), math.sin(angle), 0.0])
        middle = np.array([6.5, 3.2, 0.4])
        hit = bullet.ray((middle + 1.7 * way).tolist(), (middle + way).tolist())
        assert hit is not None and math.dist(hit, middle) == pytest.approx(1.5, abs=5e-4)
    import pybullet

    for surface, place in checks.SPOTS.items():
        ways = []
        for more in (-2, 2):
            pybullet.setGravity(*checks.tilted(checks.FRICTION_ANGLES[surface] + more))
            ways.append(bullet.slide([*place], 0.0, 0.5))
        gained = checks.pull(checks.FRICTION_ANGLES[surface], 2)
        assert ways[0] < 0.005 and ways[1] == pytest.approx(0.125 * gained, rel=0.3), surface


def mirrored(folder: Path, ground: Ground) -> None:
    """East is west."""
    west, _, east, _ = ground.bounds
    checks.change_shapes(folder, lambda points: points * (-1, 1, 1) + (east + west, 0, 0))


def transposed(folder: Path, ground: Ground) -> None:
    """East is north."""
    checks.change_shapes(folder, lambda points: points[:, [1, 0, 2]])


def hulled(folder: Path) -> None:
    """Convex hulls collide."""
    path = folder / "terrain.urdf"
    path.write_text(path.read_text("utf-8").replace(' concave="yes"', ""), "utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [mirrored, transposed])
def test_checks_refuse_wrong_files(
    spoil: Callable[[Path, Ground], None], load: Load, tmp_path: Path
) -> None:
    """Each check of bodies and rays does; or it would be worth nothing."""
    folder, ground, _ = written(sample("warehouse"), tmp_path / "out", "pybullet")
    spoil(folder, ground)
    bullet = load(folder)
    for check in (checks.check_rest, checks.check_roll):
        with pytest.raises(AssertionError):
            check(bullet, ground)
    for measured in (checks.check_rays, checks.check_walls):
        with pytest.raises(AssertionError):
            measured(bullet, ground, ERROR)


@pytest.mark.slow
def test_checks_refuse_hulls(load: Load, tmp_path: Path) -> None:
    """Of the meshes that collide, where ground is curved."""
    folder, ground, _ = written(sample("stairs-and-kerbs"), tmp_path / "out", "pybullet")
    hulled(folder)
    bullet = load(folder)
    with pytest.raises(AssertionError):
        checks.check_rest(bullet, ground)
    with pytest.raises(AssertionError):
        checks.check_rays(bullet, ground, ERROR)


def test_checks_refuse_one_friction_for_all(load: Load, tmp_path: Path) -> None:
    def simulator(terrain: Terrain) -> Bullet:
        place = tmp_path / str(len(list(tmp_path.iterdir())))
        folder, _, _ = written(terrain, place, "pybullet")
        path = folder / "terrain.urdf"
        text = path.read_text("utf-8")
        path.write_text(re.sub(r'friction value="[^"]*"', 'friction value="0.5"', text), "utf-8")
        return load(folder)

    with pytest.raises(AssertionError):
        checks.check_slopes(simulator)


def test_checks_refuse_a_filled_void(load: Load, tmp_path: Path) -> None:
    filled = {**SITE, "surfTypes": {**SITE["surfTypes"], "hole": {}}}
    folder, _, _ = written(terrain_of(filled), tmp_path / "out", "pybullet")
    ground = Ground(terrain_of(SITE), (500000, 4649776, 0))
    with pytest.raises(AssertionError):
        checks.check_void(load(folder), ground)


def test_links_are_surfaces(load: Load, tmp_path: Path) -> None:
    """Each has its colour and friction; a ray names the one that it meets."""
    folder, ground, manifest = written(terrain_of(SITE), tmp_path / "out", "pybullet", friction=0.3)
    urdf = ET.parse(folder / "terrain.urdf").getroot()
    found = {
        link.get("name"): (
            link.find("contact/lateral_friction").get("value"),  # type: ignore[union-attr]
            link.find("visual/material/color").get("rgba"),  # type: ignore[union-attr]
        )
        for link in urdf.findall("link")[1:]
    }
    assert found == {
        "terrain/rock": ("0.3", "0.3529 0.3137 0.2745 1"),
        "terrain/grass": ("0.3", "0.6275 0.6275 0.6275 1"),
    }
    assert manifest["links"] == list(found)
    import pybullet

    load(folder)
    column = [11.0, 1.0]  # in the south-east, of grass; all around is rock
    assert ground.terrain.surface(500011, 4649777) == "grass"
    for place, link in ((column, 1), ([1.0, 1.0], 0)):
        [(_, hit, *_)] = pybullet.rayTest([*place, 50], [*place, -50])
        assert hit == link


def test_the_same_bytes(tmp_path: Path) -> None:
    one, _, _ = written(terrain_of(SITE), tmp_path / "a", "pybullet", origin="center")
    shutil.move(one, tmp_path / "first")
    two, _, _ = written(terrain_of(SITE), tmp_path / "a", "pybullet", origin="center")
    assert bytes_of(tmp_path / "first") == bytes_of(two)
