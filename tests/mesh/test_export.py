"""Meshes in files: what they show, what is said of them, and every way of being wrong."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.mesh import export
from terratool.mesh.elevation import export_elevation_grid
from terratool.mesh.export import MeshOptions
from terratool.mesh.formats.table import FORMATS
from terratool.mesh.tiles import export_tiles
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.meshes import HILL, SITE, box, crowd, errors, exported, flat, read


@pytest.mark.parametrize("max_error", [0.3, 0.02])
def test_the_ground_in_the_file_is_within_the_error(tmp_path: Path, max_error: float) -> None:
    """As somebody else reads it, everywhere; and the statement does not flatter."""
    terrain = terrain_of(SITE)
    report = exported(terrain, tmp_path / "a.ply", max_error)
    mesh = read(tmp_path / "a.ply")
    statement = report.statement
    aside = statement.wall_offset + 2e-6
    assert 0 < statement.error <= max_error == statement.allowed == statement.wanted
    found = errors(mesh, terrain, 20_000, statement.error + 1e-6, aside).max()
    assert found <= statement.error + 2e-6
    assert found > 0.3 * statement.error
    assert (report.faces, report.walls) == (len(mesh.faces), mesh.walls.sum())
    assert report.vertices == len(mesh.vertices)
    assert report.surfaces == {
        "rock": (mesh.surfaces == 0).sum(), "hole": 0, "grass": (mesh.surfaces == 2).sum()
    }  # fmt: skip


@pytest.mark.parametrize("suffix", [".obj", ".glb", ".stl", ".ply"])
def test_others_find_the_terrain_where_it_is(tmp_path: Path, suffix: str) -> None:
    """The corners of the bounding box, near 0; in a .glb y is up and north is -z."""
    trimesh = pytest.importorskip("trimesh")
    terrain = terrain_of(SITE)
    report = exported(terrain, tmp_path / f"a{suffix}")
    low, high = trimesh.load_mesh(tmp_path / f"a{suffix}").bounds
    if suffix == ".glb":
        low, high = (low[0], -high[2], low[1]), (high[0], -low[2], high[1])
    assert (low[0], low[1]) == pytest.approx((0, 0), abs=1e-6)
    assert (high[0], high[1]) == pytest.approx((12, 8), abs=1e-6)
    assert report.origin == (500000, 4649776, 0)
    highest = terrain.height(500009, 4649781)
    assert high[2] == pytest.approx(highest, rel=0.1)


def test_coordinates_of_the_world(tmp_path: Path) -> None:
    """They are those near 0 and the origin, which is 0 then."""
    trimesh = pytest.importorskip("trimesh")
    terrain = terrain_of(SITE)
    near = exported(terrain, tmp_path / "near.obj")
    far = exported(terrain, tmp_path / "far.obj", origin="world")
    assert far.origin == (0, 0, 0)
    points = [
        np.array(trimesh.load_mesh(tmp_path / name, process=False).vertices)
        for name in ("near.obj", "far.obj")
    ]
    # trimesh adds up in the order of the file, and that has 15 digits
    assert np.abs(np.float32(points[0]) + near.origin - points[1]).max() < 1e-8
    assert points[1][:, 0].min() == 500000


@pytest.mark.parametrize("origin", ["center", (500010.25, 4649760.0, -3.5)])
def test_zero_is_where_it_is_asked_to_be(tmp_path: Path, origin: Any) -> None:
    """The mesh is moved as a whole: with its zero added it is the one near the corner, base too."""
    terrain = terrain_of(SITE)
    part = 500003.0, 4649777.0, 500011.0, 4649781.0  # oblong, and not in the middle
    options = {"bounds": part, "solid": True}
    near = exported(terrain, tmp_path / "near.ply", 0.05, **options)
    moved = exported(terrain, tmp_path / "moved.ply", 0.05, origin=origin, **options)
    zero = (500007.0, 4649779.0, 0.0) if origin == "center" else origin
    assert moved.origin == zero != near.origin
    assert (moved.faces, moved.bounds) == (near.faces, near.bounds)
    assert moved.base == pytest.approx(near.base, abs=1e-9)
    one, other = read(tmp_path / "near.ply"), read(tmp_path / "moved.ply")
    shift = np.array(near.origin) - zero
    assert np.abs(one.vertices + shift - other.vertices).max() < 1e-5
    x, y, z = other.vertices.T + np.array(zero)[:, None]
    top = z > z.min() + 1e-3
    assert (x.min(), y.min(), x.max(), y.max()) == pytest.approx(part, abs=1e-5)
    height = terrain.height(x[top], y[top])
    assert np.median(np.abs(z[top] - height)[~np.isnan(height)]) < 0.05


def test_bounds(tmp_path: Path) -> None:
    """A part of the terrain is the same ground in fewer faces, and its corner is the zero."""
    terrain = terrain_of(SITE)
    wanted = 500003.5, 4649775, 500009.25, 4649781
    report = exported(terrain, tmp_path / "a.ply", 0.05, bounds=wanted)
    mesh = read(tmp_path / "a.ply")
    assert report.bounds == (500003.5, 4649776, 500009.25, 4649781)
    assert report.origin == (500003.5, 4649776, 0)
    assert mesh.vertices.min(axis=0)[:2] == pytest.approx((0, 0), abs=1e-6)
    assert mesh.vertices.max(axis=0)[:2] == pytest.approx((5.75, 5), abs=1e-6)
    assert errors(mesh, terrain, 5000, 0.05, 2e-6).max() <= 0.05 + 2e-6


def test_files_are_the_same_again(tmp_path: Path) -> None:
    """To the byte, in any folder, and so is what is said of them."""
    terrain = terrain_of(SITE)
    said = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        for suffix in FORMATS:
            exported(terrain_of(SITE), tmp_path / name / f"a{suffix}", 0.1, 300)
        export_elevation_grid(terrain_of(HILL), tmp_path / name / "grid.wrl")
        report = exported(terrain, tmp_path / name / "b.wrl", 0.1, 300)
        said.append({**report.to_json(), "files": None})
    one, two = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()}
                for name in ("one", "two"))  # fmt: skip
    assert one == two and len(one) == len(FORMATS) + 3
    assert said[0] == said[1]


@pytest.mark.parametrize(
    ("size", "error", "words"),
    [
        ([10, 8], 0.005, "the default"),
        ([5, 1], 0.005, "the default"),
        ([2, 500], 0.005, "the default"),
        ([3, 2], 0.003, "1/1000 of the longer side, 3 m"),
        ([60, 2000], 0.02, "1/100,000 of the longer side, 2,000 m"),
    ],
)
def test_the_error_that_is_chosen(size: list[float], error: float, words: str) -> None:
    """Whatever the relief; of a part, by the sides of the part."""
    for height in (0.01, 26):
        terrain = flat(box(2, 3, height), size=size)
        assert MeshOptions().error_for(terrain) == (pytest.approx(error), words)
    part = (0, 0, size[0] / 2, size[1] / 2)
    half, _ = MeshOptions(bounds=part).error_for(terrain)
    assert half == pytest.approx(min(max(0.005, max(size) / 2e5), max(size) / 2e3))


def test_the_default_keeps_what_is_low_on_a_high_terrain(tmp_path: Path) -> None:
    """A bump of 2 cm on a terrain of 26 m relief, measured on the mesh itself."""
    terrain = terrain_of({
        "size": [100, 80],
        "elemTypes": {"ramp": {"x": [0, 1]}, "bump": {"x": "cosbell", "y": []}},
        "elemTree": {"type": "ramp", "vScale": 26, "children": [
            {"type": "bump", "cellX": 2, "cellY": 5, "vScale": 0.02}]},
    })  # fmt: skip
    exported(terrain, tmp_path / "a.ply")
    mesh = read(tmp_path / "a.ply")
    near = np.abs(mesh.vertices[:, :2] - [25, 44]).max(axis=1) < 1
    above = mesh.vertices[near, 2] - 0.26 * mesh.vertices[near, 0]
    assert above.max() > 0.015


def test_the_report(tmp_path: Path) -> None:
    """Its keys are those that programs rely on."""
    said = exported(terrain_of(SITE), tmp_path / "a.obj", 0.5).to_json()
    assert list(said) == [
        "format_version", "geometry", "files", "bounds", "origin", "faces", "wall_faces",
        "vertices", "surfaces", "base", "error_chosen", "losses",
    ]  # fmt: skip
    assert list(said["losses"]) == [
        "wanted_error", "allowed_error", "error", "max_faces", "miss", "miss_measured", "aside",
        "rounding", "walls", "left_out",
    ]  # fmt: skip
    assert list(said["losses"]["walls"]) == ["length", "area", "highest"]
    assert list(said["losses"]["walls"]["highest"]) == ["height", "x", "y"]
    assert list(said["losses"]["left_out"]) == [
        "small", "faint", "faintest", "points", "largest_change",
    ]  # fmt: skip
    assert (said["format_version"], said["geometry"]) == (1, "faces")
    assert said["files"] == [str(tmp_path / "a.obj"), str(tmp_path / "a.mtl")]
    highest = said["losses"]["walls"]["highest"]  # of the turned box
    assert 500008 <= highest["x"] <= 500010 and 4649780 <= highest["y"] <= 4649782
    assert highest["height"] == pytest.approx(5)
    assert json.loads(json.dumps(said)) == said
    grid = export_elevation_grid(terrain_of(HILL), tmp_path / "a.wrl").to_json()
    assert list(grid) == [
        "format_version", "geometry", "files", "bounds", "origin", "columns", "rows", "spacing",
        "resolution_chosen", "losses",
    ]  # fmt: skip
    assert list(grid["losses"]) == ["walls", "points", "miss", "rms"]


def test_a_solid_is_closed(tmp_path: Path) -> None:
    """For trimesh it has an inside, as large as what lies between the ground and the base."""
    trimesh = pytest.importorskip("trimesh")
    report = exported(flat(box(2, 3, 2)), tmp_path / "a.ply", 0.01, solid=True, base=-1.5)
    mesh = trimesh.load_mesh(tmp_path / "a.ply", process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(100 * 1.5 + 2, rel=1e-6)
    assert report.base == -1.5
    # its outer sides are no walls of the terrain
    assert report.statement.walls.length == pytest.approx(4, rel=1e-6)
    assert report.statement.walls.highest.size == 2


def test_a_base_is_chosen(tmp_path: Path) -> None:
    terrain = flat(box(2, 3, -2))
    report = exported(terrain, tmp_path / "a.stl", 0.01, solid=True)
    assert report.base is not None and -5 < report.base < -2


@pytest.mark.nightly
def test_a_solid_with_few_faces(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    report = exported(crowd(), tmp_path / "a.ply", 0.01, 1000, solid=True)
    assert report.faces <= 1000
    assert trimesh.load_mesh(tmp_path / "a.ply", process=False).is_watertight


def test_tiles(tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """All tiles together are the mesh: its area, its walls, where it is."""
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    monkeypatch.chdir(tmp_path)
    arguments = "export-mesh", saved(SITE), "site.ply", "--tile-faces", "300"
    ran = call(*arguments, "--json")
    assert (ran.code, ran.err) == (0, "")
    said = json.loads(ran.out)
    whole = exported(terrain_of(SITE), tmp_path / "whole.ply").to_json()
    assert said["rows"] * said["columns"] > 3
    assert said["bounds"] == whole["bounds"] and said["origin"] == whole["origin"]
    walls, expected = said["losses"]["walls"], whole["losses"]["walls"]
    assert walls["length"] == pytest.approx(expected["length"], rel=1e-6)
    assert walls["area"] == pytest.approx(expected["area"], rel=1e-3)
    assert walls["highest"]["height"] == pytest.approx(expected["highest"]["height"], rel=1e-6)
    index = json.loads((tmp_path / said["index"]).read_text())
    tiles = [
        trimesh.load(tmp_path / "site" / name, process=False)
        for tile in index["tiles"] for name in tile["files"]
    ]  # fmt: skip
    assert sum(len(tile.faces) for tile in tiles) == said["faces"]
    one = trimesh.load(tmp_path / "whole.ply", process=False)
    assert sum(tile.area for tile in tiles) == pytest.approx(one.area, rel=1e-3)
    low = np.min([tile.bounds[0] for tile in tiles], axis=0)
    high = np.max([tile.bounds[1] for tile in tiles], axis=0)
    assert np.allclose([low, high], one.bounds, atol=0.01)
    ran = call(*arguments)
    assert ran.code == 3 and "tiles.json: exists already" in ran.err
    ran = call(*arguments, "--overwrite")
    assert ran.code == 0 and f"{said['faces']:,} faces" in ran.out
    assert f"in {said['rows']} × {said['columns']}" in ran.out


@pytest.mark.parametrize(
    ("arguments", "code", "words", "hint"),
    [
        ("mesh missing.json a.obj", 3, "missing.json: cannot be read", "Check"),
        ("mesh {bad} a.obj", 1, "bad.json", "side length"),
        ("mesh {good} a.3ds", 2, "no mesh format has the suffix '.3ds'", "Try .obj, .wrl"),
        ("mesh {good} a", 2, "has no suffix", "Try .obj, .wrl"),
        ("mesh {good}", 2, "Missing argument 'OUT'", " --help."),
        ("mesh {good} no/folder/a.obj", 3, "the folder", "Create it first"),
        ("mesh missing.json there.obj", 3, "there.obj: exists already", "--overwrite"),
        ("mesh {good} there.obj", 3, "there.obj: exists already", "--overwrite"),
        ("mesh {good} other.obj", 3, "other.mtl: exists already", "--overwrite"),
        ("mesh {named} named.obj --overwrite", 3, "named.mtl: is the definition itself", "another"),
        ("mesh {wrl} named.wrl --overwrite", 3, "named.wrl: is the definition itself", "another"),
        ("obj {good} a.wrl", 2, "export-obj writes .obj files only", "or use export-mesh"),
        ("vrml {good} a.obj", 2, "export-vrml writes .wrl files only", "or use export-mesh"),
        ("obj {good} a.obj --elevation-grid", 2, "There is no option", " --help."),
        ("mesh {good} a.glb --origin world", 2, "too short for coordinates", "one of .obj, .ply"),
        ("mesh {good} a.glb --origin moon", 2, "'moon'", "local"),
        ("mesh {good} a.ply --origin center --origin-at 1 2 3", 2, "exclude each other", ""),
        ("mesh {good} a.ply --origin-at 1 2 nan", 2, "nan is no finite number", ""),
        ("mesh {hill} a.wrl --elevation-grid --origin center", 2, "--origin center is", "Leave"),
        ("mesh {good} a.glb --max-error -1", 2, "largest error is -1", "above 0"),
        ("mesh {good} a.glb --max-error 0", 2, "largest error is 0", "above 0"),
        ("mesh {good} a.glb --max-error nan", 2, "largest error is nan", "above 0"),
        ("mesh {good} a.glb --max-error wide", 2, "'wide'", "--max-error"),
        ("mesh {good} a.glb --max-faces 0", 2, "At most 0 faces", "2 or more"),
        ("mesh {good} a.glb --max-faces 1", 2, "faces at least, and 1 are allowed", "--max-faces"),
        ("mesh {good} a.glb --bounds 0 0 1 1", 2, "miss the terrain", "bounds that overlap 500000"),
        ("mesh {good} a.glb --bounds 9 0 1 1", 2, "are empty", "west below east"),
        ("mesh {good} a.glb --bounds 1 2", 2, "--bounds", ""),
        ("mesh {good} a.glb --base -3", 2, "no solid is asked for", "Add --solid"),
        ("mesh {good} a.glb --solid --base nan", 2, "base is at nan", "Give a height"),
        ("mesh {good} a.glb --solid --base 9", 2, "base", "lower"),
        ("mesh {void} a.glb", 2, "no ground", "terratool info"),
        ("mesh {good} a.glb --bounds 500000 4649782 500002 4649784", 2, "no ground", "--bounds"),
        ("mesh {good} a.glb --tile-faces 9 --solid", 2, "--solid is about one mesh", "Leave out"),
        ("mesh {good} a.glb --tile-faces 9 --max-faces 9", 2, "--max-faces is about", "Leave"),
        ("mesh {inside} folder.ply --tile-faces 9 --overwrite", 3, "holds the", "another"),
        ("mesh {good} a.glb --tile-faces 0", 2, "Tiles of 0 faces", "1 or more"),
        ("mesh {good} a.3ds --tile-faces 9", 2, "no mesh format has the suffix '.3ds'", "Try"),
        ("mesh {good} a.glb --tile-faces 9 --bounds 0 0 1 1", 2, "miss the terrain", "where the"),
        ("mesh {good} a.glb --tile-faces 9 --origin world", 2, "too short for", ".obj, .ply"),
        ("mesh {good} no/a.glb --tile-faces 9", 3, "no does not exist", "Create it first"),
        ("mesh {good} good.glb --tile-faces 9 --max-error 0", 2, "largest error is 0", "above 0"),
        ("mesh {good} other.mtl.obj --tile-faces 9", 3, "other.mtl: is no folder", "of one"),
        ("vrml {hill} a.wrl --elevation-grid --tile-faces 9", 2, "--tile-faces is about", "Leave"),
        ("mesh {good} a.glb --no-normals", 2, "a.glb: has no normals anyway", "Leave out"),
        ("obj {good} a.obj --no-normals --tile-faces 0", 2, "Tiles of 0 faces", "1 or more"),
        ("vrml {good} a.wrl --no-normals", 2, "There is no option", " --help."),
        ("mesh {hill} a.wrl --elevation-grid --no-normals", 2, "--no-normals is about a", "Leave"),
        ("mesh {good} a.glb --resolution 1", 2, "about a grid of heights", "--elevation-grid"),
        ("mesh {hill} a.glb --elevation-grid", 2, "only VRML has", "a .wrl"),
        ("mesh {good} a.wrl --elevation-grid", 2, "can have no holes", "without void"),
        ("vrml {hill} a.wrl --elevation-grid --resolution 0", 2, "resolution is 0", "above 0"),
        ("vrml {hill} a.wrl --elevation-grid --resolution 1e-6", 2, "1.2e+07 × 8e+06", "such as"),
        ("vrml {hill} a.wrl --elevation-grid --solid", 2, "--solid is about a mesh", "Leave out"),
        ("vrml {hill} a.wrl --elevation-grid --max-faces 9", 2, "--max-faces is about", "Leave"),
        ("vrml {hill} a.wrl --elevation-grid --bounds 0 0 1 1", 2, "miss the terrain", "where the"),
        ("vrml {huge} a.wrl --elevation-grid", 2, "beyond float32", ""),
        ("mesh {huge} a.ply --origin world", 2, "beyond float32", ""),
    ],
)  # fmt: skip
def test_wrong(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
    arguments: str, code: int, words: str, hint: str,
) -> None:  # fmt: skip
    """What is wrong, and what to do, on standard error; the right exit code; and no file."""
    huge = {"size": 4, "elemTypes": {"p": {"x": [0, 1e9]}},
            "elemTree": {"type": "p", "vScale": 1e30}}  # fmt: skip
    void = {**SITE, "elemTree": {"type": "box", "surface": "hole"}}
    names = {
        "good": saved(SITE, "good.json"), "bad": saved({**SITE, "size": -1}, "bad.json"),
        "hill": saved(HILL, "hill.json"), "void": saved(void, "void.json"),
        "named": saved(SITE, "named.mtl"), "wrl": saved(SITE, "named.wrl"),
        "huge": saved(huge, "huge.json"),
    }  # fmt: skip
    (tmp_path / "folder").mkdir()
    names["inside"] = saved(SITE, "folder/tiles.json")
    for name in ("there.obj", "other.mtl"):
        (tmp_path / name).write_text("mine")
    monkeypatch.chdir(tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    command, *rest = arguments.split()
    ran = call(f"export-{command}", *(part.format(**names) for part in rest))
    assert (ran.code, ran.out) == (code, ""), ran
    assert words in ran.err and hint in ran.err, ran.err
    assert code == 1 or hint == "" or len(ran.err.strip().splitlines()) >= 2
    after = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert after == before


def test_without_usd_core(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One is told what to install before anything is computed."""
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.setattr(export, "build_all", None)
    ran = call("export-mesh", saved(SITE), tmp_path / "a.usdc")
    assert (ran.code, ran.out) == (2, "")
    assert "usd-core is not installed" in ran.err and "terratool[usd]" in ran.err


@pytest.mark.nightly
def test_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, saved: Callable[..., Path]
) -> None:
    """Neither by Ctrl-C while a file is written nor on a full disk; what was there is kept."""
    folder = tmp_path / "out"
    folder.mkdir()

    def interrupted(_mesh: Any, path: Path, _descr: str) -> None:
        path.write_text("half")
        path.with_suffix(".mtl").write_text("half")
        raise KeyboardInterrupt

    form = replace(FORMATS[".obj"], write=interrupted)
    with monkeypatch.context() as patch:
        patch.setitem(FORMATS, ".obj", form)
        with pytest.raises(KeyboardInterrupt):
            exported(terrain_of(SITE), folder / "a.obj")
    assert list(folder.iterdir()) == []
    (folder / "a.obj").write_text("mine")
    code = (
        "import resource, signal, sys\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "from terratool.cli.main import main\n"
        "main()"
    )
    for name in ("a.obj", "a.usdc", "grid.wrl"):
        more = ["--elevation-grid"] if name == "grid.wrl" else ["--max-error", "0.0005"]
        command = ["export-mesh", saved(HILL), folder / name, "--overwrite", *more]
        done = subprocess.run(
            [sys.executable, "-c", code, *map(str, command)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 3 and done.stdout == "", done.stderr
        assert "cannot be written" in done.stderr and "Traceback" not in done.stderr
    assert [path.name for path in folder.iterdir()] == ["a.obj"]
    assert (folder / "a.obj").read_text() == "mine"


def test_the_commands_say_what_they_did(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    saved(SITE, "site.json")
    ran = call("export-obj", "site.json", "a.obj")
    report = exported(terrain_of(SITE), tmp_path / "b.obj")
    assert (ran.code, ran.err) == (0, "")
    lines = ran.out.splitlines()
    assert lines[0].startswith(f"{report.faces:,} faces, {report.walls} of them upright; an error")
    assert lines[0].endswith("an error of 0.005 m was wanted (the default)")
    assert lines[1] == "a.obj, a.mtl: zero is at 500000 4649776 0"
    assert lines[2].startswith("Walls: 13 m seen") and "5 m high" in lines[2]
    assert lines[3].startswith("Lost: the ground is up to 0.00")
    assert "inside of their arcs" in lines[3]
    ran = call("export-mesh", "site.json", "c.obj", "--json", "--max-faces", "60")
    said = json.loads(ran.out)
    wanted = exported(terrain_of(SITE), tmp_path / "d.obj", max_faces=60).to_json()
    assert said == {**wanted, "files": ["c.obj", "c.mtl"]}
    assert said["faces"] <= 60 and (tmp_path / "c.obj").exists()
    saved(HILL, "hill.json")
    ran = call("export-vrml", "hill.json", "h.wrl", "--elevation-grid", "--resolution", "0.1")
    assert ran.code == 0
    assert ran.out.splitlines()[:2] == [
        "121 × 81 nodes of 0.1 × 0.1 (as asked)",
        "h.wrl: zero is at 500000 4649776 0",
    ]


def test_the_three_commands_write_the_same(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    site = saved(SITE)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    for suffix, command in ((".obj", "export-obj"), (".wrl", "export-vrml")):
        for folder, name in (("one", "export-mesh"), ("two", command)):
            assert call(name, site, tmp_path / folder / f"a{suffix}").code == 0
        one, two = (tmp_path / folder / f"a{suffix}" for folder in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()
    assert call("export-obj", site, one.with_suffix(".obj")).code == 3
    assert call("export-vrml", site, one, "--overwrite").code == 0


def test_a_link_keeps_being_one(tmp_path: Path) -> None:
    """What stands behind it is written, and named."""
    (tmp_path / "real").mkdir()
    (tmp_path / "a.obj").symlink_to(tmp_path / "real" / "b.obj")
    report = exported(terrain_of(SITE), tmp_path / "a.obj", overwrite=True)
    assert (tmp_path / "a.obj").is_symlink()
    assert report.files == (tmp_path / "real" / "b.obj", tmp_path / "real" / "b.mtl")
    assert all(path.is_file() for path in report.files)


def test_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its options, formats and keys are those that there are, and its example says the like."""
    page = (ROOT / "docs" / "mesh.md").read_text(encoding="utf-8")
    help_ = call("export-mesh", "--help").out
    options = set(re.findall(r"^  (--[\w-]+)", help_, re.MULTILINE)) - {"--overwrite"}
    assert set(re.findall(r"`(--[\w-]+)", page.split("## Looking")[0])) == options
    table = page.split("## Formats")[1].split("**Origin.**")[0]
    assert all(f"`{suffix}`" in table for suffix in FORMATS)
    said = exported(terrain_of(SITE), tmp_path / "a.obj", 0.5).to_json()
    grid = export_elevation_grid(terrain_of(HILL), tmp_path / "a.wrl").to_json()
    keys = {*said, *said["losses"], *said["losses"]["left_out"], *grid, *grid["losses"]}
    assert all(
        f"{key}`" in page for key in keys - {"format_version", "left_out", "losses", "walls"}
    )
    command, *lines = page.split("$ terratool ")[1].split("```")[0].strip().splitlines()
    monkeypatch.chdir(tmp_path)
    words = [str(ROOT / word) if word.startswith("samples") else word for word in command.split()]
    numbers = re.compile(r"[\d,.]*\d")
    assert numbers.sub("#", call(*words).out).splitlines() == [
        numbers.sub("#", line) for line in lines
    ]
    code = page.split("```python")[1].split("```")[0].replace("samples/", f"{ROOT}/samples/")
    exec(code, {})
    assert (tmp_path / "site.glb").exists()


def test_scalars_of_numpy_are_numbers_in_json(tmp_path: Path) -> None:
    values = exported(terrain_of(SITE), tmp_path / "a.ply", np.float64(0.25)).to_json()
    assert values["losses"]["wanted_error"] == 0.25 and values["files"] == [str(tmp_path / "a.ply")]


@pytest.mark.parametrize("options", [{"max_faces": 9}, {"solid": True}, {"max_error": 0.0}])
def test_tiles_refuse_what_is_about_one_mesh(tmp_path: Path, options: dict[str, Any]) -> None:
    with pytest.raises(RequestError):
        export_tiles(terrain_of(SITE), tmp_path, ".ply", export.MeshOptions(**options))
    assert list(tmp_path.iterdir()) == []
