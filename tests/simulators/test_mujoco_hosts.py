"""A terrain in models of others: their defaults, their masses and their folders change nothing."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from tests.conftest import terrain_of
from tests.simulators import checks
from tests.simulators.checks import Ground, written
from tests.simulators.mujoco_adapter import MuJoCo

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")

ERROR = 0.02
# boxes, turned too, convex meshes and a height field
LOT: dict[str, Any] = {
    "size": [9, 5],
    "surfTypes": {"soil": {"fricAngle": 30}, "ice": {"fricAngle": 6}, "a b/c": {"fricAngle": 40}},
    "elemTypes": {"flat": {"x": [0]}, "block": {"x": [1]}, "hump": {"x": "cosbell", "y": []},
                  "slope": {"x": "ramp"}},
    "parts": {
        "pile": {
            "type": "block", "surface": "ice", "vScale": 1, "cells": [2, 1],
            "children": [{"type": "block", "cellX": 1, "cellY": 0, "vScale": 0.3}],
        }
    },
    "elemTree": {
        "type": "flat", "surface": "soil",
        "children": [
            {"type": "block", "at": [2, 1.5], "extent": [2, 0.7], "turnDeg": 25, "vScale": 0.6,
             "surface": "a b/c"},
            {"part": "pile", "at": [7, 1.5], "extent": [2, 1], "vScale": 0.4},
            {"type": "hump", "at": [5.5, 3.6], "extent": [4, 2], "vScale": 0.5},
            {"type": "slope", "at": [1.5, 3.6], "extent": [1.6, 0.9], "turnDeg": 20, "vScale": 0.4},
        ],
    },
}  # fmt: skip
ROBOT = (
    '<worldbody><body name="robot" pos="2 4 2"><freejoint/><geom name="foot" type="sphere"'
    ' size="0.1" friction="0 0 0"/></body></worldbody>'
)
# what a default of another model can set, and a value that spoils a terrain
HOSTILE: dict[str, dict[str, str]] = {
    "geom": {
        "type": "capsule", "contype": "0", "conaffinity": "0", "condim": "6", "group": "4",
        "priority": "7", "size": "0.3 0.2 0.1", "material": "odd", "friction": "0 0 0",
        "mass": "5", "density": "3", "shellinertia": "true", "solmix": "9", "solref": "0.5 0.1",
        "solimp": "0 0.1 0.2 0.1 1", "margin": "0.7", "gap": "0.5", "pos": "9 8 7",
        "quat": "0 1 0 0", "axisangle": "1 0 0 40", "xyaxes": "0 1 0 0 0 1", "zaxis": "1 1 0",
        "euler": "30 40 50", "hfield": "odd", "mesh": "odd", "fitscale": "3", "rgba": "1 0 0 1",
        "fluidshape": "ellipsoid", "fluidcoef": "1 1 1 1 1",
    },
    "mesh": {"scale": "0.001 0.002 0.001", "inertia": "convex", "maxhullvert": "4"},
    "material": {
        "texture": "odd", "emission": "1", "specular": "1", "shininess": "1", "reflectance": "1",
        "metallic": "1", "roughness": "1", "rgba": "1 0 0 1", "texrepeat": "3 3",
        "texuniform": "true",
    },
}  # fmt: skip
# what MuJoCo refuses of a mesh, or learnt after version 3.2
REFUSED = {"fromto": "0 0 0 1 1 1", "adhesion": "0.3", "surfacevel": "1 0 0 0 0 0"}
ODD = (
    '<asset><texture name="odd" type="2d" builtin="flat" width="4" height="4"/>'
    '<material name="odd"/><hfield name="odd" nrow="2" ncol="2" size="1 1 1 1"/>'
    '<mesh name="odd" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
)


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ground]:
    """Files of a terrain of three kinds of geoms, and it in their coordinates."""
    folder = tmp_path_factory.mktemp("hosts") / "lot"
    found, ground, manifest = written(terrain_of(LOT), folder, "mujoco", max_error=ERROR)
    assert all(manifest["collision"][kind] for kind in ("box", "mesh", "hfield"))
    return found, ground


def host(folder: Path, file: str, default: str = "", more: str = "", first: bool = True) -> Any:
    """Model that includes a file, and has a default before that or behind it."""
    include, default = f'<include file="{file}"/>', f"<default>{default}</default>"
    text = f"{default}{include}" if first else f"{include}{default}"
    path = folder / "host.xml"
    path.write_text(f"<mujoco>{more}{text}{ODD}</mujoco>", "utf-8")
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    finally:
        path.unlink()


def own(model: Any) -> dict[str, np.ndarray]:
    """Arrays of a model's geoms, materials and meshes that are the terrain's."""
    found = {}
    for kind in ("geom", "mat"):
        count = model.ngeom if kind == "geom" else model.nmat
        names = [getattr(model, kind)(k).name for k in range(count)]
        mine = [k for k, name in enumerate(names) if "terrain/" in name]
        found[f"{kind} names"] = np.array([names[k].rpartition("terrain/")[2] for k in mine])
        for name in dir(model):
            array = getattr(model, name) if name.startswith(f"{kind}_") else None
            if isinstance(array, np.ndarray) and len(array) == count and name != "geom_user":
                found[name] = array[mine]
    meshes = [k for k in range(model.nmesh) if "terrain/" in model.mesh(k).name]
    for k in meshes:
        begin, number = model.mesh_vertadr[k], model.mesh_vertnum[k]
        found[f"mesh {k}"] = model.mesh_vert[begin : begin + number]
    return found


def assert_same(one: dict[str, np.ndarray], other: dict[str, np.ndarray], told: str) -> None:
    assert one.keys() == other.keys(), told
    for name, array in one.items():
        assert np.array_equal(array, other[name], equal_nan=array.dtype.kind == "f"), (told, name)


@pytest.mark.parametrize(
    ("file", "first"),
    [
        ("terrain.xml", True),
        *(
            pytest.param(*one, marks=pytest.mark.nightly)
            for one in (("terrain.xml", False), ("include.xml", True), ("include.xml", False))
        ),
    ],
)
def test_no_default_of_a_model_reaches_the_terrain(
    file: str, first: bool, lot: tuple[Path, Ground]
) -> None:
    """Whatever attribute it sets, before the terrain or behind it."""
    folder, _ = lot
    plain = own(host(folder, file))
    for tag, attributes in HOSTILE.items():
        for name, value in attributes.items():
            spoilt = host(folder, file, f'<{tag} {name}="{value}"/>', first=first)
            assert_same(own(spoilt), plain, f"{tag} {name}")


def test_what_the_classes_cannot_hold_off_is_held_off_by_attaching(
    lot: tuple[Path, Ground],
) -> None:
    """Ends of a capsule, attributes of new versions, and folders of another's meshes."""
    folder, _ = lot
    plain = own(host(folder, "include.xml"))
    known = str(mujoco.mj_printSchema(False, False))
    for name, value in REFUSED.items():
        if name in known:
            default = f'<geom type="capsule" {name}="{value}"/>'
            assert_same(own(host(folder, "include.xml", default)), plain, name)
    units = '<compiler meshdir="meshes" assetdir="more" angle="radian" eulerseq="zyx"/>'
    assert_same(own(host(folder, "include.xml", more=units)), plain, "compiler")


def test_a_terrain_weighs_nothing(lot: tuple[Path, Ground]) -> None:
    """Masses, the mean size and the mean mass of a model are those of its robot."""
    folder, _ = lot
    alone = mujoco.MjModel.from_xml_string(f"<mujoco>{ROBOT}</mujoco>")
    for file in ("terrain.xml", "include.xml"):
        both = host(folder, file, more=ROBOT)
        assert both.ngeom > 10
        assert both.body_mass.tolist() == alone.body_mass.tolist()
        assert both.body_subtreemass.tolist() == alone.body_subtreemass.tolist()
        for name in ("meansize", "meanmass", "meaninertia"):
            assert getattr(both.stat, name) == getattr(alone.stat, name), name
        mujoco.mj_setTotalmass(both, 12.5)
        assert both.body_mass.sum() == pytest.approx(12.5)


def element_of(name: str) -> tuple[str, str, str]:
    """Terrain, surface and element of a geom, by its name."""
    terrain, surface, element, number = name.split("/")
    assert number.isdecimal()
    return terrain, surface, element


def test_contacts_tell_surface_and_element(lot: tuple[Path, Ground]) -> None:
    """A ball names what it lies on: the floor, a turned block, a part, a hill."""
    folder, _ = lot
    model = host(folder, "terrain.xml", more=ROBOT)
    data = mujoco.MjData(model)
    foot = model.geom("foot").id
    for x, y, z, surface, element in (
        (0.5, 4.5, 0, "soil", "flat"),
        (2, 1.5, 0.6, "a_b_c", "block"),
        (6.5, 1.5, 0.4, "ice", "pile"),
        (7.5, 1.5, 0.52, "ice", "pile"),
        (5.5, 3.6, 0.5, "soil", "hump"),
    ):
        data.qpos[:3] = x, y, z + 0.09
        mujoco.mj_forward(model, data)
        met = {int(one) for contact in data.contact for one in contact.geom} - {foot}
        found = {element_of(model.geom(one).name) for one in met}
        assert found == {("terrain", surface, element)}, (x, y)
    names = [model.geom(k).name for k in range(model.ngeom)]
    assert len(set(names)) == len(names)


def yard(*children: dict[str, Any]) -> terratool.Terrain:
    """The floor of the lot with other things on it; its place in the world is far from zero."""
    tree = {**LOT["elemTree"], "children": list(children)}
    return terratool.load({**LOT, "origin": [40, 30], "elemTree": tree})


CRATE = {"type": "block", "at": [2, 1.5], "extent": [2, 0.7], "vScale": 0.6, "surface": "ice"}
RAMP = {"type": "slope", "at": [6, 3], "extent": [3, 2], "vScale": 1.2}


@pytest.mark.parametrize("prefix", [True, False])
def test_two_terrains_in_one_model(prefix: bool, tmp_path: Path) -> None:
    """With prefixes or without, from memory: each keeps its own meshes."""
    scene, apart, terrains = mujoco.MjSpec(), 100.0, []
    for number, child in enumerate((CRATE, RAMP)):
        path = tmp_path / f"yard-{number * (not prefix)}.json"
        path.write_text(yard(child).text, "utf-8")
        terrains.append(terratool.load(path))
        frame = scene.worldbody.add_frame(pos=[apart * number, 0, 0])
        spec = terrains[-1].to_mjspec(max_error=ERROR)
        scene.attach(spec, frame=frame, **({"prefix": f"{number}/"} if prefix else {}))
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(4)
    for group in (2, 3):
        model.geom_rgba[:, 3] = 1
        groups = (np.arange(6) == group).astype(np.uint8)
        for number, terrain in enumerate(terrains):
            west, south, east, north = terrain.bounds
            for x, y in rng.uniform((west, south), (east, north), (40, 2)).tolist():
                begin, geom = np.array([x + apart * number, y, 50.0]), np.zeros(1, np.int32)
                far = mujoco.mj_ray(model, data, begin, np.array([0, 0, -1.0]), groups, 1, -1, geom)
                near = terrain.height(x + np.array([-1e-3, 0, 1e-3]), y)
                assert near.min() - ERROR < 50.0 - far < near.max() + ERROR, (number, x, y)
                assert f"yard-{number * (not prefix)}/" in model.geom(int(geom[0])).name


def test_a_spec_is_the_files(tmp_path: Path) -> None:
    """In memory: the same geoms, at the world's places unless told otherwise."""
    terrain = yard(CRATE)
    folder, _, _ = written(terrain, tmp_path / "o", "mujoco", max_error=ERROR)
    files = own(mujoco.MjModel.from_xml_path(str(folder / "terrain.xml")))
    local = terrain.to_mjspec(max_error=ERROR, origin="local")
    assert_same(own(local.compile()), files, "spec")
    world = own(terrain.to_mjspec(max_error=ERROR).compile())
    assert np.allclose(world["geom_pos"], files["geom_pos"] + [40, 30, 0], atol=1e-6)


def test_spheres_rest_on_what_is_attached(lot: tuple[Path, Ground]) -> None:
    folder, ground = lot
    simulator = MuJoCo(folder)
    checks.check_rays(simulator, ground, ERROR + 5e-4)
    checks.check_rest(simulator, ground, ERROR + 5e-3)


def test_degrees_and_no_ground_are_refused() -> None:
    """In a sentence, as the command does."""
    hole = {**LOT, "surfTypes": {**LOT["surfTypes"], "soil": {"void": True}}}
    hole["elemTree"] = {"type": "flat", "surface": "soil"}
    with pytest.raises(terratool.RequestError, match="all of it is void"):
        terratool.load(hole).to_mjspec()
    degrees = terratool.load({**LOT, "crs": "EPSG:4326"})
    with pytest.raises(terratool.RequestError, match="degrees"):
        degrees.to_mjspec()


WALKERS = (
    "ant", "half_cheetah", "hopper", "humanoid", "humanoidstandup", "point", "walker2d",
    "walker2d_v5",
)  # fmt: skip
"""Models of Gymnasium that stand on a floor; what collides of others are arms and rods."""


@pytest.fixture(scope="module")
def level(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of level ground with a crate and a ramp far from its middle, where zero is."""
    far = [{**CRATE, "at": [3, 3]}, {**RAMP, "at": [25, 13]}]
    tree = {**LOT["elemTree"], "children": far}
    terrain = terrain_of({**LOT, "size": [30, 17], "elemTree": tree})
    folder = tmp_path_factory.mktemp("level") / "out"
    return written(terrain, folder, "mujoco", max_error=ERROR, origin="center")[0]


def gymnasium_model(name: str) -> ET.ElementTree[ET.Element]:
    """MJCF of a robot of Gymnasium, without its floor."""
    gymnasium = pytest.importorskip("gymnasium", reason="gymnasium is not installed")
    assets = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
    tree = ET.parse(assets / f"{name}.xml")
    world, compiler = tree.getroot().find("worldbody"), tree.getroot().find("compiler")
    assert world is not None and compiler is not None
    compiler.attrib.pop("settotalmass", None)  # MuJoCo warns of it, in a file
    for geom in world.findall("geom"):
        if geom.get("type") == "plane":
            world.remove(geom)
    return tree


def stand(model: Any) -> tuple[float, set[str]]:
    """Least height of a middle of a robot's geoms after 3 s, and the geoms that touch then."""
    data = mujoco.MjData(model)
    for _ in range(round(3.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    met = {int(one) for contact in data.contact for one in contact.geom}
    own = model.geom_bodyid > 0
    return float(data.geom_xpos[own, 2].min()), {model.geom(one).name for one in met}


@pytest.mark.parametrize(
    ("name", "way"),
    [
        pytest.param(name, way, marks=[pytest.mark.nightly] * ((name, way) != ("ant", "terrain")))
        for name in WALKERS
        for way in ("terrain", "include", "attach")
    ],
)
def test_robots_of_gymnasium_stand(name: str, way: str, level: Path) -> None:
    """Whatever their defaults are, whichever way the terrain comes into their models."""
    tree = gymnasium_model(name)
    path = level / "robot.xml"
    if way != "attach":
        ET.SubElement(tree.getroot(), "include", file=f"{way}.xml")
    tree.write(path)
    try:
        scene = mujoco.MjSpec.from_file(str(path))
        if way == "attach":
            terrain = mujoco.MjSpec.from_file(str(level / "terrain.xml"))
            scene.attach(terrain, prefix="ground/", frame=scene.worldbody.add_frame())
        lowest, met = stand(scene.compile())
    finally:
        path.unlink()
    assert lowest > -1e-3
    assert any(one.endswith("terrain/soil/flat/0") for one in met)
