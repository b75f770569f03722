"""MuJoCo finds the ground, the walls and the friction of the terrain."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.field.terrain import Terrain
from terratool.report.numbers import metres
from terratool.simulators.collision.footing import HALVES, heights_of
from terratool.simulators.collision.height_patch import HeightPatch, misses_of
from tests.conftest import terrain_of
from tests.meshes import SITE
from tests.simulators import checks
from tests.simulators.checks import Ground, bytes_of, written
from tests.simulators.mujoco_adapter import MuJoCo

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")

ERROR = 0.0025
"""Of what collides, and of numbers in float32."""

# curved ground, oblong and symmetric in no way, with what is hard: narrow, round, turned, low, void
YARD: dict[str, Any] = {
    "size": [12, 7],
    "surfTypes": {"soil": {"fricAngle": 30}, "stone": {"fricAngle": 40}, "gap": {"void": True}},
    "elemTypes": {
        "ground": {"x": "0.5 - 0.5*cos(2*pi*t)", "y": "0.4*t*t", "combine": "sum"},
        "block": {"x": [1]},
        "tub": {"x": [1], "combine": "radial"},
        "hump": {"x": "cosbell", "combine": "radial"},
    },
    "elemTree": {
        "type": "ground",
        "surface": "soil",
        "vScale": 0.5,
        "children": [
            {"type": kind, "at": at, "extent": extent, "vScale": up, **more}
            for kind, at, extent, up, more in [
                ("block", [2.1, 1.6], [2.3, 1.7], 0.4, {"turnDeg": 25, "surface": "stone"}),
                ("tub", [5, 2], [2, 2.2], 0.3, {}),
                ("tub", [8, 2.2], [2.1, 3], -0.35, {"surface": "stone"}),
                ("block", [9.805, 3.5], [0.012, 6], -0.3, {}),
                ("block", [10.805, 3.5], [0.012, 6], 0.5, {}),
                ("block", [1.3, 5.2], [0.3, 2.5], 0, {"surface": "gap"}),
                ("hump", [3.5, 5], [3, 2], 0.3, {}),
                ("block", [7.3, 5.3], [2.5, 1.5], 0.03, {"surface": "stone"}),
            ]
        ],
    },
}


def sample(name: str) -> Terrain:
    return terratool.load(f"samples/{name}.json")


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name", ["warehouse", "stairs-and-kerbs", "paper-example", "sandy-cove", "yard"]
)
def test_rays_and_bodies_find_the_terrain(name: str, tmp_path: Path) -> None:
    """Ground, both sides of walls, rests, and where a sphere stops that rolls to a wall."""
    terrain = terrain_of(YARD) if name == "yard" else sample(name)
    folder, ground, manifest = written(terrain, tmp_path / "out", "mujoco", origin="center")
    simulator = MuJoCo(folder)
    assert sum(manifest["collision"][kind] for kind in ("box", "mesh", "hfield")) <= 2000
    checks.check_rays(simulator, ground, ERROR)
    checks.check_rest(simulator, ground)
    if name != "sandy-cove":  # it has no walls
        checks.check_walls(simulator, ground, ERROR)
    if name in ("warehouse", "stairs-and-kerbs"):  # others have no level ground before walls
        checks.check_roll(simulator, ground)
    seen = MuJoCo(folder, group=2)
    checks.check_rays(seen, ground, ERROR)


def test_names_and_single_triangles(tmp_path: Path) -> None:
    """Surfaces called as geoms are, or alike but for case, and one of three corners: it loads."""
    plate = {"type": "one", "at": [2.5, 2], "extent": [1, 1], "surface": "box_0"}
    aside = 0.4 / 2**0.5  # its edge is a diagonal of the plate
    half = {"at": [2.5 + aside, 2 - aside], "extent": [3, 0.8], "turnDeg": -45}
    cover = {"type": "one", "surface": "Box_0", **half}
    tree = {"type": "one", "surface": "mesh_0", "children": [plate, cover]}
    terrain = terrain_of(
        {
            "size": [5, 4],
            "surfTypes": {name: {} for name in ("box_0", "Box_0", "mesh_0", "a|b")},
            "elemTypes": {"one": {"x": [0]}},
            "elemTree": tree,
        }
    )
    folder, ground, _ = written(terrain, tmp_path / "out", "mujoco")
    corner = (folder / "box_0_2.msh", folder / "box_0.msh")
    faces = [int(np.fromfile(path, "<i4", 4)[3]) for path in corner]
    assert 1 in faces
    checks.check_rays(MuJoCo(folder, group=2), ground, ERROR)
    checks.check_rays(MuJoCo(folder), ground, ERROR)


@pytest.mark.nightly
@pytest.mark.parametrize("most", [3, 15])
def test_few_geoms_leave_the_void_open(most: int, tmp_path: Path) -> None:
    """However large the error grows: a round void, and a narrow one; what are too many is said."""
    children = [
        {"type": kind, "at": at, "extent": extent, "vScale": 0, "surface": "gap"}
        for kind, at, extent in (("tub", [4, 3.5], [4, 3.4]), ("block", [9.31, 3], [0.03, 5]))
    ]
    tree = {**YARD["elemTree"], "children": children}
    folder, ground, manifest = written(
        terrain_of({**YARD, "elemTree": tree}), tmp_path / "out", "mujoco", max_geoms=most
    )
    simulator = MuJoCo(folder)
    checks.check_void(simulator, ground)
    for y in np.linspace(0.6, 5.4, 40).tolist():
        assert simulator.ray_down(9.31, y) is None
    counts = manifest["collision"]
    geoms = sum(counts[kind] for kind in ("box", "mesh", "hfield"))
    said = f"{geoms:,}" in manifest["losses"][-1]
    assert geoms <= most or said
    checks.check_rays(simulator, ground, 1.01 * counts["error"])


def test_narrow_surfaces_keep_their_friction(tmp_path: Path) -> None:
    """A strip on curved ground that is narrower than cells of a height field at first."""
    strip = {"type": "block", "at": [20, 30], "extent": [0.5, 20], "vScale": 0, "surface": "ice"}
    terrain = terrain_of(
        {
            **YARD,
            "size": [100, 60],
            "surfTypes": {"soil": {"fricAngle": 30}, "ice": {"fricAngle": 5}},
            "elemTree": {**YARD["elemTree"], "children": [strip]},
        }
    )
    folder, ground, manifest = written(terrain, tmp_path / "out", "mujoco", max_error=0.01)
    simulator = MuJoCo(folder)
    assert "lines between surfaces" in manifest["losses"][-1]
    for y in np.linspace(21, 39, 60).tolist():
        assert simulator.friction_down(20 - ground.zero[0], y) == pytest.approx(
            np.tan(np.radians(5)), rel=1e-5
        )


def test_turned_boxes(tmp_path: Path) -> None:
    """An oblong block that is turned, on level ground, is one box, and turned the same way."""
    block = {"type": "one", "at": [3, 2], "extent": [2.4, 0.8], "turnDeg": 25, "vScale": 0.5}
    tree = {"type": "flat", "children": [block]}
    terrain = terrain_of(
        {"size": [7, 5], "elemTypes": {"flat": {"x": [0]}, "one": {"x": [1]}}, "elemTree": tree}
    )
    folder, ground, manifest = written(terrain, tmp_path / "out", "mujoco", origin="world")
    assert manifest["collision"]["box"] == 2
    simulator = MuJoCo(folder)
    for x, y in ground.points(400, 9).tolist():
        found = simulator.ray_down(x, y)
        assert found == pytest.approx(float(ground.height(x, y)), abs=1e-6)


def test_each_surface_has_its_friction(tmp_path: Path) -> None:
    """On one level: L-shaped and turned surfaces, to the seam between them."""
    plates = [
        {"type": "flat", "at": at, "extent": extent, "surface": name, "turnDeg": turn}
        for name, at, extent, turn in [
            ("ice", [2, 1], [3, 1], 0),
            ("ice", [1, 2.5], [1, 2.5], 0),
            ("rock", [4.5, 3], [1.5, 2.5], 30),
        ]
    ]
    surfaces = {"ice": {"fricAngle": 5}, "rock": {"fricAngle": 40}, "soil": {"fricAngle": 25}}
    terrain = terrain_of(
        {
            "size": [7, 5],
            "surfTypes": surfaces,
            "elemTypes": {"flat": {"x": [0]}},
            "elemTree": {"type": "flat", "surface": "soil", "children": plates},
        }
    )
    folder, ground, _ = written(terrain, tmp_path / "out", "mujoco", origin="world")
    simulator = MuJoCo(folder)
    angle = np.linspace(0, 2 * np.pi, 24)
    met = set()
    for x, y in ground.points(500, 10, 0.05).tolist():
        around = terrain.sample(x + 0.025 * np.cos(angle), y + 0.025 * np.sin(angle)).surface
        if np.ptp(around):
            continue
        name = terrain.surfaces[int(around[0])]
        met.add(name)
        expected = np.tan(np.radians(surfaces[name]["fricAngle"]))
        assert simulator.friction_down(x, y) == pytest.approx(expected, rel=1e-5), (x, y, name)
    assert met == set(surfaces)


def test_cells_are_parted_as_mujoco_parts_them(tmp_path: Path) -> None:
    """Rays on a height field of four nodes: its planes, and how far it is from other heights."""
    rng = np.random.default_rng(11)
    for number in range(6):
        nodes = np.array([[0.0, 1.0], [1.0, 0.0]]) if number == 0 else rng.uniform(0, 1, (2, 2))
        ray = _field_of(nodes, tmp_path / f"{number}.bin")
        yes, zero = np.ones((1, 1), np.bool_), np.zeros((1, 1))
        patch = HeightPatch((0, 0, 1, 1), nodes, yes, ~yes, ~yes, zero.astype(np.int32), ~yes, zero)
        halves = patch.at(HALVES[..., 0], HALVES[..., 1])
        for x, y in rng.uniform(0.02, 0.98, (30, 2)).tolist():
            level = heights_of(halves[[int(y > x)]], np.array([[x, y]]))
            assert level[0] == pytest.approx(ray(x, y), abs=1e-5)
        places = [(min(max(i / 4, 1e-6), 1 - 1e-6), j) for j in range(5) for i in range(5)]
        own = np.array([ray(x, min(max(j / 4, 1e-6), 1 - 1e-6)) for x, j in places]).reshape(5, 5)
        assert misses_of(own, 4)[0, 0] < 1e-4
        other = own.copy()
        other[1:4, 1:4] += rng.uniform(-1, 1, (3, 3))
        assert misses_of(other, 4)[0, 0] == pytest.approx(np.abs(other - own).max(), abs=1e-4)


def _field_of(nodes: np.ndarray, path: Path) -> Callable[[float, float], float]:
    """Rays from above on a cell of 1 × 1 with these nodes, rows from the south."""
    low, high = float(nodes.min()), float(nodes.max())
    path.write_bytes(np.array([2, 2], "<i4").tobytes() + nodes.astype("<f4").tobytes())
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><hfield name="h" file="{path}" size="0.5 0.5 {high - low} 1"/></asset>'
        f'<worldbody><geom type="hfield" hfield="h" pos="0.5 0.5 {low}"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    def ray(x: float, y: float) -> float:
        way, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
        return 9.0 - float(
            mujoco.mj_ray(model, data, np.array([x, y, 9.0]), way, None, 1, -1, geom)
        )

    return ray


@pytest.mark.nightly
def test_narrow_things_are_there(tmp_path: Path) -> None:
    """A ditch and a fence of 12 mm, found to a millimetre of their walls; a slot is open."""
    folder, ground, manifest = written(terrain_of(YARD), tmp_path / "out", "mujoco", origin="world")
    assert manifest["collision"]["hfield"] > 0
    simulator = MuJoCo(folder)
    y = np.random.default_rng(8).uniform(0.6, 6.4, 60)
    for middle in (9.805, 10.805):
        for aside in (-0.007, -0.005, 0.0, 0.005, 0.007):
            for at in y.tolist():
                found = simulator.ray_down(middle + aside, at)
                assert found is not None
                assert abs(found - float(ground.height(middle + aside, at))) < ERROR
    for at in y[(y > 3.96) & (y < 6.44)].tolist():
        for x in (1.152, 1.3, 1.448):
            assert simulator.ray_down(x, at) is None
        for x in (1.148, 1.452):
            found = simulator.ray_down(x, at)
            assert found is not None and abs(found - float(ground.height(x, at))) < ERROR


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("origin", "flex"), [((500003.5, 4649777.25, 1.5), False), ("local", True)]
)
def test_void_lets_through(origin: Any, flex: bool, tmp_path: Path) -> None:
    """Rays and spheres, wherever zero is; what is around it is solid."""
    folder, ground, _ = written(
        terrain_of(SITE), tmp_path / "out", "mujoco", origin=origin, flex=flex, max_error=0.01
    )
    simulator = MuJoCo(folder, group=2 if flex else 3)
    checks.check_void(simulator, ground)
    checks.check_rays(simulator, ground, 0.0105)
    checks.check_rest(simulator, ground, 0.012)


def test_boxes_slide_as_friction_says(tmp_path: Path) -> None:
    """Two degrees below the friction angle of each surface they hold, two above they slide."""

    def simulator(terrain: Terrain) -> MuJoCo:
        place = tmp_path / str(len(list(tmp_path.iterdir())))
        return MuJoCo(written(terrain, place, "mujoco")[0])

    checks.check_slopes(simulator)


def mirrored(geom: ET.Element, ground: Ground) -> None:
    """East is west."""
    west, _, east, _ = ground.bounds
    if "pos" in geom.attrib:
        x, y, z = geom.attrib["pos"].split()
        geom.set("pos", f"{east + west - float(x)} {y} {z}")


def transposed(geom: ET.Element, ground: Ground) -> None:
    """East is north."""
    for key in ("pos", "size"):
        if key in geom.attrib:
            x, y, z = geom.attrib[key].split()
            geom.set(key, f"{y} {x} {z}")


def hulled(geom: ET.Element, ground: Ground) -> None:
    """The mesh of the paving collides, too: as its hull, as MuJoCo takes a mesh."""
    if geom.get("mesh") == "terrain/paving/seen":
        geom.attrib.update(group="3", contype="1", conaffinity="1", rgba="0 0 0 0")


@pytest.mark.nightly
@pytest.mark.parametrize("spoil", [mirrored, transposed, hulled])
def test_checks_refuse_wrong_files(
    spoil: Callable[[ET.Element, Ground], None], tmp_path: Path
) -> None:
    """Those of bodies and rays do; rays do not see hulls, which lift spheres at rest."""
    name = "stairs-and-kerbs" if spoil is hulled else "warehouse"
    folder, ground, _ = written(sample(name), tmp_path / "out", "mujoco", max_error=0.01)
    tree = ET.parse(folder / "terrain.xml")
    for geom in tree.getroot().iter("geom"):
        spoil(geom, ground)
    tree.write(folder / "terrain.xml")
    simulator = MuJoCo(folder)
    with pytest.raises(AssertionError):
        checks.check_rest(simulator, ground)
    if spoil is hulled:
        return
    with pytest.raises(AssertionError):
        checks.check_roll(simulator, ground)
    for measured in (checks.check_rays, checks.check_walls):
        with pytest.raises(AssertionError):
            measured(simulator, ground, ERROR)


def test_checks_refuse_one_friction_for_all(tmp_path: Path) -> None:
    def simulator(terrain: Terrain) -> MuJoCo:
        place = tmp_path / str(len(list(tmp_path.iterdir())))
        folder, _, _ = written(terrain, place, "mujoco")
        path = folder / "terrain.xml"
        text = path.read_text("utf-8")
        path.write_text(re.sub(r'friction="\S+ ', 'friction="0.5 ', text), "utf-8")
        return MuJoCo(folder)

    with pytest.raises(AssertionError):
        checks.check_slopes(simulator)


def test_ways_to_load(tmp_path: Path) -> None:
    """As it is, by the README's lines; included; and attached, as the README says."""
    folder, _, _ = written(sample("warehouse"), tmp_path / "out", "mujoco")
    (folder / "scene.xml").write_text('<mujoco><include file="terrain.xml"/></mujoco>', "utf-8")
    robot = '<body name="robot"><freejoint/><geom size="0.1"/></body>'
    robot = f"<mujoco><worldbody>{robot}</worldbody></mujoco>"
    (folder / "robot.xml").write_text(robot, "utf-8")
    first, second = re.findall(r"```python\n(.*?)```", (folder / "README.md").read_text(), re.S)
    models = []
    for code in (first, first.replace("terrain.xml", "scene.xml"), second):
        names: dict[str, Any] = {"mujoco": mujoco}
        for file in ("terrain.xml", "scene.xml", "robot.xml"):
            code = code.replace(f'"{file}"', f'"{folder / file}"')
        exec(code, names)
        models.append(names["model"])
    assert models[0].ngeom == models[1].ngeom == models[2].ngeom - 1 > 100
    assert models[2].nq == 7


def test_geoms_are_of_surfaces(tmp_path: Path) -> None:
    """Each geom that collides has friction and colour of a surface, and comes before a robot's."""
    folder, _, manifest = written(
        terrain_of(SITE), tmp_path / "out", "mujoco", friction=0.3, max_error=0.05
    )
    simulator = MuJoCo(folder)
    model = simulator.model
    assert simulator.hidden
    collide = np.flatnonzero(model.geom_group == 3)
    assert len(collide) == sum(manifest["collision"][kind] for kind in ("box", "mesh", "hfield"))
    assert (model.geom_priority[collide] == 1).all()
    expected = {tuple(np.array(one["color"])) for one in manifest["surfaces"].values()}
    colors = np.rint(255 * model.geom_rgba[collide, :3]).astype(int)
    assert set(map(tuple, colors.tolist())) == expected
    assert np.allclose(model.geom_friction[collide, 0], 0.3)


@pytest.mark.nightly
def test_the_same_bytes(tmp_path: Path) -> None:
    terrain = sample("sandy-cove")
    one, _, _ = written(terrain, tmp_path / "a", "mujoco", origin="center")
    shutil.move(one, tmp_path / "first")
    two, _, _ = written(terrain, tmp_path / "a", "mujoco", origin="center")
    assert bytes_of(tmp_path / "first") == bytes_of(two)


@pytest.mark.nightly
def test_fewer_geoms_cost_error(tmp_path: Path) -> None:
    """The error grows where there are to be few of them, and that is said."""
    terrain = sample("sandy-cove")
    _, _, fine = written(terrain, tmp_path / "fine", "mujoco", collision="convex")
    folder, ground, coarse = written(
        terrain, tmp_path / "coarse", "mujoco", max_geoms=12, collision="convex"
    )
    counts = coarse["collision"]
    assert sum(counts[kind] for kind in ("box", "mesh", "hfield")) <= 12
    assert counts["error"] > fine["collision"]["error"]
    assert any("12 geoms" in line for line in coarse["losses"])
    checks.check_rays(MuJoCo(folder), ground, 1.01 * counts["error"])


def test_descriptions_are_escaped(tmp_path: Path) -> None:
    nasty = '<--"&\x01 --->'
    folder, _, _ = written(
        terrain_of({**SITE, "descr": nasty}), tmp_path / "a", "mujoco", max_error=0.1
    )
    ET.parse(folder / "terrain.xml")


def test_one_geom_is_not_enough(tmp_path: Path) -> None:
    """What cannot be kept is said, and the ground is there all the same."""
    terrain = terrain_of(SITE)
    folder, ground, manifest = written(
        terrain, tmp_path / "a", "mujoco", max_geoms=1, max_error=0.1
    )
    counts = manifest["collision"]
    assert 1 < sum(counts[kind] for kind in ("box", "mesh", "hfield")) < 100
    (said,) = (line for line in manifest["losses"] if "1 geom would be too far off" in line)
    assert "--max-geoms N allows more, and --flex is exact" in said
    checks.check_rays(MuJoCo(folder), ground, 1.01 * counts["error"])


@pytest.mark.slow
def test_ground_of_many_faces_is_cut_from_a_coarser_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What collides is farther off then, and no farther than is said; the picture is as asked."""
    monkeypatch.setattr("terratool.simulators.mujoco._FINE", 1_000)
    monkeypatch.setattr("terratool.simulators.mujoco._MANY", 3_000)
    folder, ground, manifest = written(
        sample("sandy-cove"), tmp_path / "a", "mujoco", collision="convex"
    )
    counts = manifest["collision"]
    assert manifest["max_error"] == 0.002
    assert 0.004 < counts["solids_error"] < 0.1
    said = f"{metres(counts['solids_error'])} off the terrain, square to it, to keep to 2,000 geoms"
    assert said in manifest["losses"][-1]
    checks.check_rays(MuJoCo(folder), ground, 1.01 * counts["error"])


@pytest.mark.nightly
def test_height_fields_go_on_over_creases_where_there_are_too_many(tmp_path: Path) -> None:
    """Each pyramid of a field of them would take four solids."""
    pyramids = {"type": "pyramid", "at": [0.9, 0.7], "extent": [0.8, 0.6], "vScale": 1,
                "repeat": {"count": [24, 18], "step": [0.9, 0.7]}}  # fmt: skip
    terrain = terrain_of(
        {"size": [24, 15], "surfTypes": {"soil": {"fricAngle": 30}},
         "elemTypes": {"hill": {"x": "dome", "y": "dome"},
                       "pyramid": {"x": "tent", "y": "tent", "combine": "min"}},
         "elemTree": {"type": "hill", "surface": "soil", "vScale": 0.1, "children": [pyramids]}}
    )  # fmt: skip
    folder, ground, manifest = written(terrain, tmp_path / "a", "mujoco", max_geoms=300)
    counts = manifest["collision"]
    assert sum(counts[kind] for kind in ("box", "mesh", "hfield")) <= 300
    assert counts["error"] < 0.1
    checks.check_rays(MuJoCo(folder), ground, 1.01 * counts["error"])


@pytest.mark.slow
def test_a_pit_in_a_hill_stays_open(tmp_path: Path) -> None:
    """A dome is one solid, but for what is dug into it."""
    terrain = terrain_of(
        {"size": [20, 12], "surfTypes": {"soil": {"fricAngle": 30}},
         "elemTypes": {"hill": {"x": "dome", "y": "dome"}, "pit": {"x": [1]}},
         "elemTree": {"type": "hill", "surface": "soil", "vScale": 0.2, "children": [
             {"type": "pit", "at": [12, 7], "extent": [0.12, 0.12], "vScale": -0.5}]}}
    )  # fmt: skip
    folder, ground, manifest = written(terrain, tmp_path / "a", "mujoco")
    mujoco = MuJoCo(folder)
    x, y = (middle - offset for middle, offset in zip((12, 7), ground.zero[:2], strict=True))
    for dx, dy in ((0.0, 0.0), (0.05, 0.05), (-0.05, 0.03), (0.02, -0.05)):
        height = mujoco.ray_down(x + dx, y + dy)
        assert height == pytest.approx(ground.height(x + dx, y + dy), abs=0.002)
    checks.check_rays(mujoco, ground, 1.01 * manifest["collision"]["error"])


def test_a_steep_groove_has_no_burr(tmp_path: Path) -> None:
    """Beside its lip the ground is level, and nothing stands above it."""
    terrain = terrain_of(
        {"size": [6, 4], "surfTypes": {"soil": {"fricAngle": 30}},
         "elemTypes": {"flat": {"x": [0]}, "ridge": {"x": "cosbell"}},
         "elemTree": {"type": "flat", "surface": "soil", "vScale": 1, "children": [
             {"type": "ridge", "at": [3, 2], "extent": [0.02, 3], "turnDeg": 20, "vScale": -1}]}}
    )  # fmt: skip
    folder, _, _ = written(terrain, tmp_path / "a", "mujoco", origin="world")
    mujoco = MuJoCo(folder)
    turn = np.radians(20.0)
    across, along = (np.random.default_rng(3).uniform(-reach, reach, 400) for reach in (0.015, 1.4))
    for u, v in zip(across, along, strict=True):
        x, y = 3 + np.cos(turn) * u + np.sin(turn) * v, 2 - np.sin(turn) * u + np.cos(turn) * v
        height = mujoco.ray_down(x, y)
        assert height is not None
        assert height <= 0.0021


def test_round_walls_on_waves_leave_no_spikes(tmp_path: Path) -> None:
    """Walls of the mesh are chords of a disc: what is true ground before them is not higher."""
    terrain = terrain_of(
        {"size": [29, 10], "surfTypes": {"soil": {"fricAngle": 30}},
         "elemTypes": {"wave": {"x": "0.5 - 0.5*cos(4*pi*t)", "y": "0.4*t*t", "combine": "sum"},
                       "tub": {"x": [1], "combine": "radial"}},
         "elemTree": {"type": "wave", "surface": "soil", "vScale": 0.03, "children": [
             {"type": "tub", "at": [24.507, 6.608], "extent": [1.183, 0.745], "vScale": 0.6,
              "turnDeg": 7.3},
             {"type": "tub", "at": [14.507, 4.608], "extent": [5.183, 4.745], "vScale": 0.6}]}}
    )  # fmt: skip
    _, _, manifest = written(terrain, tmp_path / "a", "mujoco")
    assert 0.0 < manifest["collision"]["height_fields_error"] <= 0.002


@pytest.mark.nightly
def test_slivers_of_a_mesh_are_no_geoms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo takes no mesh whose corners lie on a line; it loads what is cut from a coarse mesh."""
    monkeypatch.setattr("terratool.simulators.mujoco._FINE", 0)
    folder, ground, manifest = written(terrain_of(YARD), tmp_path / "a", "mujoco")
    checks.check_rays(MuJoCo(folder), ground, 1.01 * manifest["collision"]["error"])
