"""Gazebo's own libraries find the terrain: its checker of SDF, and its physics with DART."""

from __future__ import annotations

import math
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.errors import NotGeoreferencedWarning

import terratool
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from tests.conftest import terrain_of
from tests.meshes import HILL, SITE
from tests.programs import lacking, program
from tests.simulators import checks
from tests.simulators.checks import RADIUS, Ground, bytes_of, written
from tests.simulators.storeyed import SHELVES

PACKAGES = (
    *(f"ignition-physics5{part}" for part in ("", "-sdf", "-mesh", "-heightmap")),
    *("ignition-plugin1-loader", "ignition-common4-graphics", "ignition-math6-eigen3"),
    "sdformat12",
)
Drop = Callable[[Path, list[str]], list[float]]


@pytest.fixture(scope="module")
def drop(tmp_path_factory: pytest.TempPathFactory) -> Drop:
    """Let bodies move in a world for half a second; where they rest, or how far they slid."""
    plugins = list(Path("/usr/lib").glob("*/ign-physics-5/engine-plugins/*physics-dartsim*.so"))
    config, compiler = program("pkg-config"), program("c++")
    flags = [config, "--cflags", "--libs", *PACKAGES]
    asked = subprocess.run(flags, capture_output=True, text=True)
    if asked.returncode or not plugins:
        lacking("ignition-physics")
    dropper = tmp_path_factory.mktemp("drop") / "drop"
    source = Path(__file__).with_name("drop.cpp")
    define = f'-DPLUGIN="{plugins[0]}"'
    options = ["-std=c++17", "-w", define, "-o", dropper, source, *asked.stdout.split()]
    subprocess.run([compiler, *options], check=True)

    def run(folder: Path, bodies: list[str]) -> list[float]:
        world = folder / "world.sdf"
        ran = subprocess.run(
            [dropper, world, "0.5"], input="\n".join(bodies), capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stderr
        lines = [line.split() for line in ran.stdout.splitlines()]
        values = [float(line[1]) for line in lines if line[:1] in (["rest"], ["slid"])]
        assert len(values) == len(bodies)
        return values

    return run


def worst_rest(drop: Drop, folder: Path, ground: Ground) -> float:
    """How far from where it should, at most, a sphere rests."""
    places = checks.rests_of(ground, 24)
    found = drop(folder, [f"drop {x} {y} {z} {RADIUS}" for x, y, z in places])
    return float(np.abs(np.array(found) - np.array(places)[:, 2]).max())


def check_sdf(path: Path) -> None:
    """Valid for Gazebo's own checker."""
    ran = subprocess.run([program("ign"), "sdf", "--check", path], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout.strip()) == (0, "Valid."), ran.stdout + ran.stderr


@pytest.mark.slow
@pytest.mark.parametrize("heightmap", [False, True])
def test_sdf_is_valid(heightmap: bool, tmp_path: Path) -> None:
    folder, _, _ = written(terrain_of(SITE), tmp_path / "out", "gazebo", heightmap=heightmap)
    for name in ("model.sdf", "world.sdf"):
        check_sdf(folder / name)
    config = ET.parse(folder / "model.config").getroot()
    assert config.findtext("sdf") == "model.sdf"
    files = {uri.text for uri in ET.parse(folder / "world.sdf").iter("uri")}
    assert files <= set(bytes_of(folder))


def tilt(folder: Path, degrees: float) -> None:
    """Have gravity pull to the east, as if all of a world sloped so much."""
    x, _, z = checks.tilted(degrees)
    path = folder / "world.sdf"
    text = path.read_text("utf-8")
    assert "<gravity>0 0 -9.81</gravity>" in text
    path.write_text(text.replace("0 0 -9.81", f"{x} 0 {z}"), "utf-8")


@pytest.mark.slow
def test_dart_has_the_friction_of_boxes_and_cylinders(drop: Drop, tmp_path: Path) -> None:
    """Two degrees below the friction angle of each surface a box holds, two above it slides."""
    for surface, (x, y, z) in checks.SPOTS.items():
        angle = checks.FRICTION_ANGLES[surface]
        ways = []
        for degrees in (angle - 2, angle + 2):
            place = tmp_path / f"{degrees}"
            folder, _, manifest = written(terrain_of(checks.LEVEL), place, "gazebo")
            assert (manifest["boxes"], manifest["cylinders"], manifest["meshed"]) == (2, 1, 0)
            tilt(folder, degrees)
            ways += drop(folder, [f"slide {x} {y} {z} 0"])
        assert ways[0] < 0.005, surface
        assert ways[1] == pytest.approx(0.5 * checks.pull(angle, 2) * 0.5**2, rel=0.3), surface
    assert not any("DART" in line for line in manifest["losses"])


def test_collisions_are_named_by_their_elements(tmp_path: Path) -> None:
    """Each shape of the link, boxes and cylinders with their place; and Gazebo takes the names."""
    folder, _, _ = written(terrain_of(checks.LEVEL), tmp_path / "out", "gazebo")
    check_sdf(folder / "world.sdf")
    model = ET.parse(folder / "model.sdf").getroot()
    found = {str(one.get("name")): one for one in model.iter("collision")}
    names = ["terrain/ice/block/0", "terrain/steel/column/0", "terrain/gravel/block/0"]
    assert list(found) == names
    disc, crate = found[names[1]], found[names[2]]
    assert disc.findtext("geometry/cylinder/length") == "1.3"  # down to a metre below the floor
    assert disc.findtext("pose") == "6.5 3.2 -0.15 0 0 0"
    assert checks.pose_of(crate)[5] == pytest.approx(math.radians(-10), abs=1e-6)
    assert {visual.get("name") for visual in model.iter("visual")} == {
        f"terrain/{surface}/visual" for surface in checks.FRICTION_ANGLES
    }


@pytest.mark.nightly
def test_wheels_rest_on_boxes_and_cylinders(drop: Drop, tmp_path: Path) -> None:
    folder, _, _ = written(terrain_of(checks.LEVEL), tmp_path / "out", "gazebo")
    places = [*checks.SPOTS.values(), (6.5, 3.2, 0.5), (0.02, 0.3, 0.2)]
    found = drop(folder, ["wheel {} {} {} {}".format(*place, RADIUS) for place in places])
    assert found == pytest.approx([z for _, _, z in places], abs=0.002)


def sample(name: str) -> Terrain:
    return terrain_of(SITE) if name == "site" else terratool.load(f"samples/{name}.json")


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "origin"),
    [("warehouse", "center"), ("stairs-and-kerbs", (3.0, -2.0, 0.5)), ("site", "local")],
)
def test_spheres_rest_on_the_ground(name: str, origin: Any, drop: Drop, tmp_path: Path) -> None:
    """Within 5 mm, at random places, wherever zero is."""
    folder, ground, _ = written(sample(name), tmp_path / "out", "gazebo", origin=origin)
    assert worst_rest(drop, folder, ground) < 0.005


@pytest.mark.slow
def test_spheres_rest_on_both_floors(drop: Drop, tmp_path: Path) -> None:
    """On decks that are boxes, and at the same x and y on the floor below."""
    folder, _, _ = written(terrain_of(SHELVES), tmp_path / "out", "gazebo", origin="world")
    check_sdf(folder / "world.sdf")
    places = [
        (5.6, 1.75, 1.7),
        (5.6, 1.75, 0.2),
        (1.8, 2.2, 0.9),
        (1.8, 2.2, 0.2),
        (6.7, 4.15, 0.8),
    ]
    for place in places:
        [found] = drop(folder, ["drop {} {} {} {}".format(*place, RADIUS)])
        assert found == pytest.approx(place[2], abs=0.005)


@pytest.mark.nightly
@pytest.mark.parametrize("spoil", ["mirrored", "transposed", "pose"])
def test_a_wrong_model_is_found(spoil: str, drop: Drop, tmp_path: Path) -> None:
    folder, ground, _ = written(sample("warehouse"), tmp_path / "out", "gazebo", origin="center")
    west, _, east, _ = ground.bounds
    if spoil == "mirrored":
        checks.change_shapes(folder, lambda at: at * (-1, 1, 1) + (east - west, 0, 0))
    elif spoil == "transposed":
        checks.change_shapes(folder, lambda at: at[:, [1, 0, 2]])
    else:
        checks.change_shapes(folder, lambda at: at + np.array([7, -7, 0]))
    assert worst_rest(drop, folder, ground) > 0.005


@pytest.mark.slow
def test_friction_is_in_the_file_and_dart_does_not_read_it(drop: Drop, tmp_path: Path) -> None:
    """As the README says: DART takes 1, and a box on ice of 9 degrees holds on 42."""
    folder, _, manifest = written(checks.slopes(5.0), tmp_path / "out", "gazebo")
    link = ET.parse(folder / "model.sdf").getroot().find("model/link")
    assert link is not None
    found = {}
    for one in link.findall("collision"):
        ode = [one.findtext(f"surface/friction/ode/{key}") for key in ("mu", "mu2")]
        found[one.get("name")] = [float(value) for value in ode if value]
    assert found == {
        f"terrain/{name}/mesh": [pytest.approx(math.tan(math.radians(angle)), rel=1e-5)] * 2
        for name, angle in checks.FRICTION_ANGLES.items()
    }
    assert any("takes the friction of meshes for 1" in line for line in manifest["losses"])
    ways = []
    for steep in (42.0, 48.0):  # below and above 45 degrees, whose tangent is 1
        terrain = checks.slopes(steep - checks.FRICTION_ANGLES["ice"])
        folder, _, _ = written(terrain, tmp_path / str(steep), "gazebo")
        slope = math.tan(math.radians(steep))
        ways += drop(folder, [f"slide 3.5 0.9 {3.5 * slope} {slope}"])
    assert ways[0] < 0.01 and ways[1] > 0.05


def test_a_file_for_each_surface(tmp_path: Path) -> None:
    """With normals, the colour in its visual, and the reflectivity where it is known."""
    surfaces = {**SITE["surfTypes"], "grass": {"sonarRefl": 0.25, "color": [0, 51, 255]}}
    terrain = terrain_of({**SITE, "surfTypes": surfaces})
    folder, _, _ = written(terrain, tmp_path / "out", "gazebo", origin="world")
    link = ET.parse(folder / "world.sdf").getroot().find("world/model/link")
    assert link is not None
    shapes = {shape.get("name"): shape for shape in link}
    assert list(shapes) == [
        f"terrain/{name}/{kind}" for name in ("rock", "grass") for kind in ("mesh", "visual")
    ]
    for name, shape in shapes.items():
        file = shape.findtext("geometry/mesh/uri")
        assert file == f"{str(name).split('/')[1]}.obj"
        lines = (folder / file).read_text().splitlines()
        assert sum(line.startswith("vn ") for line in lines) > 0
        assert len({line for line in lines if line.startswith("g ")}) == 1
        assert shape.findtext("pose") == "500000 4649776 0 0 0 0"
    assert shapes["terrain/grass/visual"].findtext("material/diffuse") == "0 0.2 1 1"
    assert shapes["terrain/grass/mesh"].findtext("laser_retro") == "0.25"
    assert shapes["terrain/rock/mesh"].find("laser_retro") is None


def test_heightmap_is_square_and_full(tmp_path: Path) -> None:
    """Of 2ⁿ + 1 pixels, from 0 to 255, north up, as large and high as the terrain."""
    terrain = terrain_of(HILL)
    folder, ground, manifest = written(terrain, tmp_path / "o", "gazebo", heightmap=True)
    with pytest.warns(NotGeoreferencedWarning), rasterio.open(folder / "heights.png") as file:
        pixels = file.read(1)
    assert (pixels.shape, pixels.dtype) == ((129, 129), np.uint8)
    assert (pixels.min(), pixels.max()) == (0, 255)
    link = ET.parse(folder / "model.sdf").getroot().find("model/link")
    assert link is not None
    wide, tall, high = map(float, str(link.findtext("visual/geometry/heightmap/size")).split())
    x, y, low = map(float, str(link.findtext("visual/geometry/heightmap/pos")).split())
    assert str(link.findtext("collision/pose")).split()[:3] == [f"{v:g}" for v in (x, y, low)]
    assert (wide, tall, x, y) == (12, 8, 6, 4)
    # marks that a flip, a turn or a shift would miss
    for column, row in ((0, 128), (128, 0), (40, 110), (100, 20)):
        at = x - wide / 2 + wide * column / 128, y + tall / 2 - tall * row / 128
        found = low + high * pixels[row, column] / 255
        assert found == pytest.approx(float(ground.height(*at)), abs=high / 500)
    assert "mesh" not in manifest
    assert manifest["heightmap"]["max_error"] < high / 255


@pytest.mark.nightly
def test_heightmap_in_dart(drop: Drop, tmp_path: Path) -> None:
    """Rests agree within what the README says of steps and of DART's spacing."""
    folder, ground, manifest = written(
        terrain_of(HILL), tmp_path / "o", "gazebo", heightmap=True, origin="center"
    )
    aside, steepest = 0.5 * 12 / 129, 1.2
    limit = manifest["heightmap"]["max_error"] + steepest * aside
    assert worst_rest(drop, folder, ground) < limit
    flipped = Ground(
        terrain_of({**HILL, "elemTree": {**HILL["elemTree"], "turnDeg": 180}}), ground.zero
    )
    assert worst_rest(drop, folder, flipped) > 2 * limit


def test_heightmap_says_what_is_lost(tmp_path: Path) -> None:
    """The void and the walls, in figures."""
    folder, _, manifest = written(terrain_of(SITE), tmp_path / "o", "gazebo", heightmap=True)
    figures = manifest["heightmap"]
    assert figures["void"] == pytest.approx(1 / 24, rel=0.1)
    assert figures["max_error"] > 1  # at the sides of a box that is 5 m high
    text = " ".join(manifest["losses"])
    assert "walls become slopes" in text
    assert "friction and colour of rock" in text
    readme = (folder / "README.md").read_text("utf-8")
    assert "| rock |" in readme and "| grass |" not in readme


def test_heightmap_of_little_ground(tmp_path: Path) -> None:
    """Its friction is that of the ground, be it so little that no random point meets it."""
    island = {"at": [3, 6 - 86 * 6 / 128], "extent": [0.03, 0.02], "type": "box", "surface": "rock"}
    text: dict[str, Any] = {
        "size": [8, 6], "surfTypes": {"rock": {"fricAngle": 20}, "hole": {"void": True}},
        "elemTypes": {"box": {"x": [1]}},
        "elemTree": {"type": "box", "vScale": 0, "surface": "hole", "children": [island]},
    }  # fmt: skip
    folder, _, manifest = written(terrain_of(text), tmp_path / "o", "gazebo", heightmap=True)
    assert "At 0 random points" in " ".join(manifest["losses"])
    mu = {one.text for one in ET.parse(folder / "model.sdf").iter("mu")}
    assert mu == {f"{math.tan(math.radians(20)):.6g}"}
    text["elemTree"]["children"] = [{**island, "at": [3.03, 2]}]  # between pixels
    with pytest.raises(RequestError, match=r"narrower than 0\.0625 m"):
        written(terrain_of(text), tmp_path / "none", "gazebo", heightmap=True)


def test_the_same_bytes(tmp_path: Path) -> None:
    for heightmap in (False, True):
        found = []
        for run in range(2):
            place = tmp_path / f"{heightmap}{run}"
            folder, _, _ = written(terrain_of(SITE), place, "gazebo", heightmap=heightmap)
            found.append(bytes_of(folder))
        assert found[0] == found[1]
