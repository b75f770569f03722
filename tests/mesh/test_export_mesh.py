"""Meshes in files: what they show, what is said of them, and every way of being wrong."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from msgspec import structs

from terratool.cli.main import main
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.mesh import budget, export
from terratool.mesh.build import build
from terratool.mesh.elevation import export_elevation_grid
from terratool.mesh.formats.table import FORMATS
from terratool.mesh.types import BuiltMesh, Mesh, PlanLoss
from tests.commands import ROOT
from tests.conftest import terrain_of
from tests.meshes import CURVED, ROUND, STRAIGHT, errors, exported, random_definition
from tests.viewers import COIN, output, program, python_with_coin

# oblong, far away and symmetric in no way: a flip, a transposition or a shift shows
SITE: dict[str, Any] = {
    "descr": "A site",
    "size": [12, 8],
    "origin": [500000, 4649776],
    "surfTypes": {"rock": {"color": [90, 80, 70]}, "hole": {"void": True}, "grass": {}},
    "elemTypes": {
        "slope": {"x": [0, 1, 1.5], "y": [1, 3]},
        "box": {"x": [1]},
        "bell": {"x": "cosbell", "y": []},
        "column": {"combine": "radial", "x": [1]},
    },
    "elemTree": {
        "type": "slope",
        "surface": "rock",
        "cells": [6, 4],
        "children": [
            {"type": "box", "cellX": 4, "cellY": 2, "vScale": 5, "turnDeg": 30},
            {"type": "box", "cellX": 0, "cellY": 3, "surface": "hole"},
            {"type": "bell", "cellX": 1, "cellY": 0, "span": [2, 1], "vScale": 2},
            {"type": "column", "cellX": 5, "cellY": 0, "surface": "grass"},
        ],
    },
}
# no walls, no void
HILL: dict[str, Any] = {
    **{key: SITE[key] for key in ("descr", "size", "origin", "surfTypes", "elemTypes")},
    "elemTree": {
        "type": "slope",
        "surface": "rock",
        "cells": [6, 4],
        "children": [
            {"type": "bell", "cellX": 1, "cellY": 0, "span": [3, 2], "vScale": 2},
            {"type": "bell", "cellX": 4, "cellY": 3, "surface": "grass", "vScale": -1},
        ],
    },
}


def flat(*children: dict[str, Any], size: Any = 10, **more: Any) -> Terrain:
    """A level floor with elements in cells of 1 × 1; `box` is as high as its vScale."""
    definition = {
        "size": size,
        "surfTypes": {"hole": {"void": True}},
        "elemTypes": {
            "floor": {"x": [0]},
            "box": {"x": [1]},
            "bell": {"x": "cosbell", "y": []},
            "column": {"combine": "radial", "x": [1]},
        },
        "elemTree": {"type": "floor", "cells": 10, "children": list(children)},
        **more,
    }
    return terrain_of(definition)


def box(x: int, y: int, height: float, **more: Any) -> dict[str, Any]:
    return {"type": "box", "cellX": x, "cellY": y, "vScale": height, **more}


def crowd(seed: int = 3) -> Terrain:
    """Straight, curved and round elements, turned and nested."""
    return terrain_of(random_definition(seed, 120, STRAIGHT | CURVED | ROUND, ("grass", "rock")))


def read(path: Path) -> Mesh:
    """A .ply as trimesh reads it, where the file says that it is."""
    trimesh = pytest.importorskip("trimesh")
    found = trimesh.load_mesh(path, process=False)
    rows = found.metadata["_ply_raw"]["face"]["data"]
    (origin,) = re.findall(rb"comment origin (.*)\n", path.read_bytes())
    return Mesh(
        vertices=np.array(found.vertices, np.float64),
        faces=np.array(found.faces, np.int32),
        surfaces=rows["surface"].ravel().astype(np.int32),
        walls=rows["wall"].ravel().astype(bool),
        origin=np.array([float(word) for word in origin.split()]),
        names=(),
        colors=np.zeros((0, 3), np.uint8),
    )


def told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: object
) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    monkeypatch.setattr(sys, "argv", ["terratool", *map(str, arguments)])
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert isinstance(ended.value.code, int)
    return ended.value.code, out, err


# --- what a file shows -----------------------------------------------------------------------


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
    far = exported(terrain, tmp_path / "far.obj", world=True)
    assert far.origin == (0, 0, 0)
    points = [
        np.array(trimesh.load_mesh(tmp_path / name, process=False).vertices)
        for name in ("near.obj", "far.obj")
    ]
    # trimesh adds up in the order of the file, and that has 15 digits
    assert np.abs(np.float32(points[0]) + near.origin - points[1]).max() < 1e-8
    assert points[1][:, 0].min() == 500000


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


# --- what is said ----------------------------------------------------------------------------


def walls(terrain: Terrain, tmp_path: Path, **options: Any) -> Any:
    path = tmp_path / f"{len(list(tmp_path.iterdir()))}.ply"
    return exported(terrain, path, 0.01, **options).statement.walls


def test_walls_of_boxes(tmp_path: Path) -> None:
    """Their length seen from above, their area, and the highest one and its place."""
    found = walls(flat(box(2, 3, 2)), tmp_path)
    assert (found.length, found.area) == pytest.approx((4, 8), rel=1e-6)
    assert found.highest.size == 2
    assert found.highest.x == pytest.approx(2.5, abs=0.5 + 1e-6)
    assert {round(found.highest.x, 6), round(found.highest.y, 6)} <= {2, 3, 4}
    # two next to each other: what is between them is 1 high
    found = walls(flat(box(2, 3, 2), box(3, 3, 3)), tmp_path)
    assert (found.length, found.area) == pytest.approx((7, 3 * 2 + 3 * 3 + 1), rel=1e-6)
    assert found.highest.size == 3
    # pits have walls, too; one on top of the other has two of different heights in one place
    found = walls(flat(box(2, 3, -2), box(2, 3, 0.5), box(7, 7, 1)), tmp_path)
    assert (found.length, found.area) == pytest.approx((8, 4 * 1.5 + 4), rel=1e-6)
    assert found.highest.size == 1.5
    # trimmed to its cell, one that is turned by 45° is a regular octagon
    found = walls(flat(box(2, 3, 2, turnDeg=45)), tmp_path)
    assert found.length == pytest.approx(8 * math.tan(math.pi / 8), rel=1e-6)
    found = walls(flat({"type": "column", "cellX": 4, "cellY": 4, "vScale": 3}), tmp_path)
    assert 0.99 * math.pi < found.length < math.pi
    assert found.area == pytest.approx(3 * found.length, rel=1e-6)


def test_what_is_no_wall(tmp_path: Path) -> None:
    """The edge of the void, the edge of the terrain, and where bounds cut a box."""
    assert walls(flat({**box(2, 3, 2), "surface": "hole"}), tmp_path).highest is None
    assert walls(flat(box(2, 3, 2)), tmp_path, bounds=(2.5, 0, 10, 10)).length == pytest.approx(2)
    assert walls(flat(box(0, 0, 2)), tmp_path).length == pytest.approx(2)
    found = walls(flat(box(2, 3, 2), {**box(3, 3, 1), "surface": "hole"}), tmp_path)
    assert found.length == pytest.approx(3)
    assert walls(terrain_of(HILL), tmp_path).length == 0


def test_a_wall_that_becomes_higher(tmp_path: Path) -> None:
    """It is as high as at its highest, and its area is that of the triangles that it is."""
    definition = {
        "size": 2,
        "elemTypes": {"floor": {"x": [0]}, "ramp": {"x": [0, 3]}},
        "elemTree": {"type": "floor", "cells": 2,
                     "children": [{"type": "ramp", "cellX": 1, "cellY": 1}]},
    }  # fmt: skip
    found = walls(terrain_of(definition), tmp_path)
    assert (found.length, found.area) == pytest.approx((1, 0.75), rel=1e-6)
    assert found.highest.size == 1.5
    assert (found.highest.x, found.highest.y) == pytest.approx((2, 1), abs=1e-6)


@pytest.mark.parametrize(
    ("height", "error", "words"),
    [(20, 0.02, "1/1000 of the relief, 20 m"), (0.5, 0.001, "1 mm, as 1/1000"), (0, 0.001, "1 mm")],
)
def test_the_error_that_is_chosen(tmp_path: Path, height: float, error: float, words: str) -> None:
    report = exported(flat(box(2, 3, height)), tmp_path / "a.stl")
    assert report.statement.wanted == pytest.approx(error)
    assert words in report.chosen
    part = exported(flat(box(2, 3, height)), tmp_path / "b.stl", bounds=(2, 5, 9, 9))
    assert part.statement.wanted == 0.001  # there it is level


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


def test_rounding_is_said(tmp_path: Path) -> None:
    """Where single precision is not enough for the heights."""
    high = flat({"type": "bell", "cellX": 4, "cellY": 4}, box(0, 0, 1e6))
    statement = exported(high, tmp_path / "a.ply", 0.01).statement
    mesh = build(high, 0.01).mesh
    stored = read(tmp_path / "a.ply").vertices
    assert statement.rounding == np.abs(stored - mesh.vertices).max() < 0.1
    tower = flat({"type": "bell", "cellX": 4, "cellY": 4, "vOffset": 123456.7})
    statement = exported(tower, tmp_path / "b.ply", 0.001).statement
    assert 0.0004 < statement.rounding < 0.004
    assert "coordinates are rounded by up to 0.00" in "".join(statement.sentences())


# --- a limit of faces ------------------------------------------------------------------------


@pytest.mark.parametrize("most", [6_000, 4_000, 1_200, 300, 2])
def test_faces_are_limited(tmp_path: Path, most: int) -> None:
    """The statement holds for what somebody else finds in the file, whatever was left out."""
    terrain = crowd()
    report = exported(terrain, tmp_path / "a.ply", 0.001, most)
    mesh, statement = read(tmp_path / "a.ply"), report.statement
    assert len(mesh.faces) == report.faces <= most
    aside = statement.wall_offset + 2e-6
    found = errors(mesh, terrain, 20_000, statement.miss, aside)
    # what is left out is measured at points; there may be more between them
    assert np.quantile(found, 0.999) <= statement.miss + 1e-5
    assert found.max() <= 1.1 * statement.miss + 1e-5
    left = statement.left
    assert (left.change is None) == (left.faint == 0)
    if left.faint:
        assert left.faintest <= 5.0 * statement.allowed
        assert found.max() > 0.5 * statement.miss
        assert f"{left.faint} elements left out to keep to" in "".join(statement.sentences())
    else:
        assert statement.miss == statement.error and report.faces > 0.7 * most


def test_enough_faces_change_nothing(tmp_path: Path) -> None:
    terrain = crowd()
    free = exported(terrain, tmp_path / "a.ply", 0.05)
    bound = exported(terrain, tmp_path / "b.ply", 0.05, free.faces)
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
    assert structs.replace(bound.statement, max_faces=None) == free.statement
    fewer = exported(terrain, tmp_path / "c.ply", 0.05, free.faces - 1)
    assert fewer.faces < free.faces and fewer.statement.allowed > 0.05


def test_smooth_ground_gets_nearly_all_faces(tmp_path: Path) -> None:
    """The error grows no more than it has to."""
    terrain = terrain_of({**HILL, "elemTree": {"type": "bell", "vScale": 5}})
    sizes = {}
    for most in (20_000, 5_000, 500):
        report = exported(terrain, tmp_path / f"{most}.ply", 1e-5, most)
        assert 0.9 * most < report.faces <= most
        assert report.statement.left.faint == 0
        sizes[most] = report.statement.error
    # faces are as the inverse of the error
    assert 2.5 < sizes[5_000] / sizes[20_000] < 6
    assert 6 < sizes[500] / sizes[5_000] < 16


def test_the_lowest_elements_are_left_out(tmp_path: Path) -> None:
    """Of boxes no error makes fewer faces: the highest ones stay, exactly."""
    heights = {(x, y): round(0.1 + 0.01 * (10 * x + y), 2) for x in range(10) for y in range(10)}
    alone = {place: height for place, height in heights.items() if sum(place) % 2}
    terrain = flat(*(box(*place, height) for place, height in alone.items()))
    all_faces = exported(terrain, tmp_path / "a.ply", 0.01).faces
    report = exported(terrain, tmp_path / "b.ply", 0.01, all_faces // 2)
    left = report.statement.left
    gone = sorted(alone.values())[: left.faint]
    assert 0 < left.faint < len(alone)
    assert left.faintest == gone[-1] == pytest.approx(report.statement.miss)
    assert left.change and left.change.size == pytest.approx(gone[-1])
    place = int(left.change.x), int(left.change.y)
    assert alone[place] == gone[-1]
    kept = len(alone) - left.faint
    mesh = read(tmp_path / "b.ply")
    tops = {round(float(z), 2) for z in mesh.vertices[:, 2]} - {0}
    assert tops == set(sorted(alone.values())[left.faint :]) and len(tops) == kept
    assert report.statement.error == pytest.approx(0, abs=1e-12)


def test_pebbles_go_before_the_hill_does(tmp_path: Path) -> None:
    """An error for all that spoils the ground is worse than leaving out what is low."""
    hill = {"type": "bell", "cellX": 0, "cellY": 0, "span": [10, 10], "vScale": 5}
    pebbles = [box(x, y, 0.05) for x in range(0, 10, 2) for y in range(0, 10, 2)]
    report = exported(flat(hill, *pebbles), tmp_path / "a.ply", 0.01, 300)
    assert report.faces <= 300
    assert report.statement.left.faint == len(pebbles)
    assert report.statement.miss < 0.2


@pytest.mark.parametrize("wanted", [1e-6, 0.001, 0.03])
def test_the_best_of_several_bargains(wanted: float) -> None:
    """Ground whose faces are as the inverse of the error, and pebbles that cost 400 faces."""
    tries = []

    def attempt(error: float, least: float) -> Any:
        tries.append(error)
        pebbles = least < 0.05
        faces = range(round(10 + 10 / error + 400 * pebbles))
        mesh: Any = SimpleNamespace(faces=faces)
        loss = PlanLoss() if pebbles else PlanLoss(faint=40, faintest=0.05)
        return BuiltMesh(mesh, 0, error, loss)

    def fitted(most: int) -> budget.BudgetedMesh:
        tries.clear()
        fit = budget.within_budget(attempt, wanted, 5.0, 5.0, most)
        assert fit.faces <= most and len(tries) <= 3 * budget.BUILDS
        assert max(10 / error for error in tries) <= max(10 * most, 10 / wanted)
        return fit

    # all stay at an error of 0.33, or the pebbles go at 0.024
    fit = fitted(440)
    assert fit.built.loss.faint == 40 and fit.miss < max(0.08, wanted + 0.06)
    assert fit.error >= wanted
    # at an error of 0.1 they may stay
    fit = fitted(520)
    assert fit.built.loss.faint == 0 and 0.09 < fit.miss < 0.11
    enough = round(411 + 10 / wanted)
    assert fitted(enough).error == wanted


def test_overlapping_elements_that_are_left_out_add_up(tmp_path: Path) -> None:
    """Each of them changes little, all of them together more: that is measured."""
    children = [box(4, 4, 0.1) for _ in range(10)] + [box(n, 0, 3) for n in range(0, 10, 2)]
    terrain = flat(*children)
    most = exported(flat(*children[10:]), tmp_path / "a.ply", 0.01).faces
    statement = exported(terrain, tmp_path / "b.ply", 0.01, most).statement
    assert (statement.left.faint, statement.left.faintest) == (10, pytest.approx(0.1))
    assert statement.miss == pytest.approx(1.0)
    found = errors(read(tmp_path / "b.ply"), terrain, 20_000, 1.0).max()
    assert found == pytest.approx(1.0, abs=1e-6)


def test_peaks_that_are_left_out_are_measured(tmp_path: Path) -> None:
    """In the middle of an element, where it is highest."""
    peaks = [{"type": "peak", "cellX": n, "cellY": 3, "vScale": 0.3} for n in range(10)]
    towers = [box(n, 0, 3) for n in range(0, 10, 2)]
    types = {"floor": {"x": [0]}, "box": {"x": [1]}, "peak": {"x": [0, 1, 0], "y": []}}
    most = exported(flat(*towers), tmp_path / "a.ply", 0.01).faces
    terrain = flat(*peaks, *towers, elemTypes=types)
    left = exported(terrain, tmp_path / "b.ply", 0.01, most).statement.left
    assert (left.faint, left.faintest) == (10, pytest.approx(0.3))
    assert left.change and left.change.size == pytest.approx(0.3, abs=1e-12)
    assert left.change.x % 1 == pytest.approx(0.5) and left.change.y == pytest.approx(3.5)


def test_holes_stay(tmp_path: Path) -> None:
    """A hole is more than a change of heights, however little its own height is."""
    pebbles = [box(x, y, 0.2) for x in range(0, 10, 2) for y in range(0, 10, 2)]
    terrain = flat(*pebbles, {**box(5, 5, 0.001), "surface": "hole"})
    report = exported(terrain, tmp_path / "a.ply", 0.01, 20)
    assert report.statement.left.faint == len(pebbles)
    mesh = read(tmp_path / "a.ply")
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    (u, v) = (b - a, c - a)
    area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2
    assert area == pytest.approx(99, rel=1e-6)


def test_a_limit_that_cannot_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One is told the least that is possible, after a bounded number of tries."""
    tries = []

    def counting(*arguments: Any, **options: Any) -> Any:
        tries.append(arguments[1])
        return build(*arguments, **options)

    monkeypatch.setattr(export, "build", counting)
    for terrain, least in ((crowd(), 2), (flat({**box(5, 5, 1), "surface": "hole"}), 8)):
        tries.clear()
        with pytest.raises(RequestError, match=rf"has {least} faces at least, and 1 are allowed"):
            exported(terrain, tmp_path / "a.ply", 0.001, 1)
        assert len(tries) <= 3 * budget.BUILDS
    assert exported(crowd(), tmp_path / "a.ply", 1e9, 2).faces == 2
    (path,) = tmp_path.iterdir()
    assert path.name == "a.ply"


def test_small_elements_are_counted(tmp_path: Path) -> None:
    """What is too small for the mesh is left out whatever is asked for, and its height is said."""
    speck = {"type": "floor", "cellX": 9, "cellY": 9, "cells": 1000, "children": [
        {"type": "floor", "cellX": 999, "cellY": 999, "cells": 1000, "children": [
            {"type": "box", "cellX": 999, "cellY": 999, "vScale": 0.3}]}]}  # fmt: skip
    statement = exported(flat(speck), tmp_path / "a.ply", 0.01).statement
    assert (statement.left.small, statement.left.faint) == (1, 0)
    assert statement.miss == pytest.approx(0.3)
    assert "1 element too small for the mesh left out" in "".join(statement.sentences())


# --- grids of heights ------------------------------------------------------------------------


def grid_by_castle(path: Path) -> np.ndarray:
    """Nodes of an ElevationGrid as view3dscene's converter reads it, where they are put."""
    text = output(program("tovrmlx3d"), path, "--encoding=xml")
    (transform,) = ElementTree.fromstring(text.encode()).iter("Transform")
    (grid,) = transform.iter("ElevationGrid")

    def numbers(node: ElementTree.Element, name: str) -> np.ndarray:
        return np.array([float(word) for word in str(node.get(name)).replace(",", " ").split()])

    columns, rows = int(grid.get("xDimension", 0)), int(grid.get("zDimension", 0))
    j, i = np.meshgrid(np.arange(columns), np.arange(rows))
    heights = numbers(grid, "height").reshape(rows, columns)
    points = np.stack([j * numbers(grid, "xSpacing")[0], heights, i * numbers(grid, "zSpacing")[0]])
    *axis, angle = numbers(transform, "rotation")
    assert np.allclose(axis, (1, 0, 0))
    turn = np.array([[1, 0, 0], [0, math.cos(angle), -math.sin(angle)],
                     [0, math.sin(angle), math.cos(angle)]])  # fmt: skip
    points = turn @ points.reshape(3, -1) + numbers(transform, "translation")[:, None]
    return np.asarray(points.T)


def grid_by_coin(path: Path) -> np.ndarray:
    """Corners of the triangles that Coin makes of an ElevationGrid, in the world of the file."""
    python = python_with_coin()
    if python is None:
        pytest.skip("python3-pivy is not installed")
    code = COIN[: COIN.index("search =")] + (
        "found = []\n"
        "def triangle(_, action, *vertices):\n"
        "    matrix = action.getModelMatrix()\n"
        "    found.extend(matrix.multVecMatrix(v.getPoint()).getValue() for v in vertices)\n"
        "action = coin.SoCallbackAction()\n"
        "action.addTriangleCallback(coin.SoVRMLElevationGrid.getClassTypeId(), triangle, None)\n"
        "action.apply(root)\n"
        "json.dump(found, sys.stdout)\n"
    )
    return np.array(json.loads(output(python, "-c", code, path)))


@pytest.mark.parametrize("reader", [grid_by_castle, grid_by_coin])
def test_others_find_the_grid_where_the_terrain_is(
    tmp_path: Path, reader: Callable[[Path], np.ndarray]
) -> None:
    """Its nodes have the heights of the terrain, both edges included, and a mirrored one not."""
    terrain = terrain_of(HILL)
    report = export_elevation_grid(terrain, tmp_path / "a.wrl", 0.3)
    assert (report.columns, report.rows) == (41, 28)
    assert report.spacing == pytest.approx((0.3, 8 / 27))
    x, y, z = reader(tmp_path / "a.wrl").T
    assert len(np.unique(np.round([x, y], 3), axis=1).T) == 41 * 28
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((0, 12, 0, 8), abs=1e-5)

    def off(x: Any, y: Any) -> float:
        # nodes are in single precision, and may lie beyond the edge by that
        at = np.clip(x, 0, 12) + 500000, np.clip(y, 0, 8) + 4649776
        return float(np.abs(terrain.height(*at) - z).max())

    assert off(x, y) < 1e-4
    for wrong in ((12 - x, y), (x, 8 - y), (12 - x, 8 - y), (y * 1.5, x / 1.5)):
        assert off(*wrong) > 0.1


def test_the_grid_is_where_the_mesh_is(tmp_path: Path) -> None:
    """The same place in the same axes: every node is on the mesh of the same terrain."""
    terrain = terrain_of(HILL)
    grid = export_elevation_grid(terrain, tmp_path / "grid.wrl", 0.5)
    mesh = exported(terrain, tmp_path / "mesh.wrl", 0.01)
    assert grid.origin == mesh.origin and grid.bounds == mesh.bounds
    texts = [(tmp_path / name).read_text() for name in ("grid.wrl", "mesh.wrl")]
    origins = [re.findall(r"# origin (.*)", text) for text in texts]
    assert origins[0] == origins[1] == ["500000 4649776 0"]


def test_what_a_grid_loses(tmp_path: Path) -> None:
    """Its largest difference, measured, and the walls that became ramps."""
    wave = terrain_of({"size": [6, 3], "elemTypes": {"w": {"x": "sin(6*t)"}},
                       "elemTree": {"type": "w"}})  # fmt: skip
    statement = export_elevation_grid(wave, tmp_path / "a.wrl", 0.25).statement
    # that of a chord: a quarter of a half of a step, squared, and the steepest curvature
    assert statement.miss.size == pytest.approx(0.25**2 / 8, rel=0.01)
    assert statement.walls.highest is None
    boxes = flat(box(2, 3, 2), box(3, 3, 3))
    statement = export_elevation_grid(boxes, tmp_path / "b.wrl", 0.25).statement
    assert statement.walls.length == pytest.approx(7, rel=1e-6)
    assert 2.9 < statement.miss.size <= 3
    (said,) = statement.sentences(0.25)
    assert said.startswith("Lost: 7 m of wall, up to 3 m high, became ramps; the grid is up to")
    ramp = {"size": 2, "elemTypes": {"r": {"x": [0, 1]}}, "elemTree": {"type": "r"}}
    statement = export_elevation_grid(terrain_of(ramp), tmp_path / "c.wrl", 0.25).statement
    assert list(statement.sentences(0.25)) == ["Lost: nothing."]


def test_either_way_of_halving_squares_counts() -> None:
    """A saddle is off in the middle of its squares, to one side or the other."""
    from terratool.mesh.elevation import _off
    from terratool.mesh.types import HeightGrid

    grid = HeightGrid(
        np.array([[0, 1], [0, 0]], np.float32), np.zeros((2, 2), np.int32), (1.0, 1.0),
        np.zeros(3), (), np.zeros((0, 3), np.uint8),
    )  # fmt: skip
    x, y = np.array([0.5, 0.9, 0.1]), np.array([0.5, 0.9, 0.9])
    # the one diagonal goes from the south-west to the high corner, the other misses it
    assert _off(grid, x, y, np.zeros(3)) == pytest.approx([0.5, 0.9, 0.1])
    assert _off(grid, x, y, np.array([0.5, 0.9, 0.1])) == pytest.approx([0.5, 0.1, 0.1])


def test_colors_of_a_grid(tmp_path: Path) -> None:
    """One material for one surface, else a colour for each node, row by row from the north."""
    export_elevation_grid(terrain_of(HILL), tmp_path / "a.wrl", 1)
    text = output(program("tovrmlx3d"), tmp_path / "a.wrl", "--encoding=xml")
    (color,) = ElementTree.fromstring(text.encode()).iter("Color")
    numbers = str(color.get("color")).replace(",", " ").split()
    shades = np.array([float(word) for word in numbers]).reshape(9, 13, 3)
    rock = np.abs(shades * 255 - (90, 80, 70)).max(axis=2) < 1
    grass = np.zeros((9, 13), bool)
    grass[0:3, 8:10] = True  # the north and east edges are the neighbours', but for the terrain's
    assert (rock != grass).all()
    plain = {**HILL, "elemTree": {"type": "slope", "surface": "rock"}}
    export_elevation_grid(terrain_of(plain), tmp_path / "b.wrl", 1)
    text = (tmp_path / "b.wrl").read_text()
    assert "Color {" not in text and "diffuseColor 0.353 0.3138 0.2746" in text


# --- solids ----------------------------------------------------------------------------------


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


def test_a_solid_with_few_faces(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    report = exported(crowd(), tmp_path / "a.ply", 0.01, 1000, solid=True)
    assert report.faces <= 1000
    assert trimesh.load_mesh(tmp_path / "a.ply", process=False).is_watertight


def test_tiles(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """All tiles together are the mesh: its area, its walls, where it is."""
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    monkeypatch.chdir(tmp_path)
    arguments = "export-mesh", saved(SITE), "site.ply", "--tile-faces", "300"
    code, out, err = told(monkeypatch, capsys, *arguments, "--json")
    assert (code, err) == (0, "")
    said = json.loads(out)
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
    code, _, err = told(monkeypatch, capsys, *arguments)
    assert code == 3 and "tiles.json: exists already" in err
    code, out, _ = told(monkeypatch, capsys, *arguments, "--overwrite")
    assert code == 0
    assert f"{said['faces']:,} faces" in out and f"in {said['rows']} × {said['columns']}" in out


# --- every way of being wrong ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "code", "words", "hint"),
    [
        ("mesh missing.json a.obj", 3, "missing.json: cannot be read", "Check"),
        ("mesh {bad} a.obj", 1, "bad.json", "side length"),
        ("mesh {good} a.3ds", 2, "no mesh format has the suffix '.3ds'", "Try .obj, .wrl"),
        ("mesh {good} a", 2, "has no suffix", "Try .obj, .wrl"),
        ("mesh {good}", 2, "Missing argument 'OUTPUT'", "Usage"),
        ("mesh {good} no/folder/a.obj", 3, "the folder", "Create it first"),
        ("mesh {good} there.obj", 3, "there.obj: exists already", "--overwrite"),
        ("mesh {good} other.obj", 3, "other.mtl: exists already", "--overwrite"),
        ("mesh {named} named.obj --overwrite", 3, "named.mtl: is the definition itself", "another"),
        ("mesh {wrl} named.wrl --overwrite", 3, "named.wrl: is the definition itself", "another"),
        ("obj {good} a.wrl", 2, "export-obj writes .obj files only", "or use export-mesh"),
        ("vrml {good} a.obj", 2, "export-vrml writes .wrl files only", "or use export-mesh"),
        ("obj {good} a.obj --elevation-grid", 2, "No such option", "Usage"),
        ("mesh {good} a.glb --origin world", 2, "too short for coordinates", "one of .obj, .ply"),
        ("mesh {good} a.glb --origin moon", 2, "'moon'", "local"),
        ("mesh {good} a.glb --max-error -1", 2, "largest error is -1", "above 0"),
        ("mesh {good} a.glb --max-error 0", 2, "largest error is 0", "above 0"),
        ("mesh {good} a.glb --max-error nan", 2, "largest error is nan", "above 0"),
        ("mesh {good} a.glb --max-error wide", 2, "'wide'", "--max-error"),
        ("mesh {good} a.glb --max-faces 0", 2, "At most 0 faces", "2 or more"),
        ("mesh {good} a.glb --max-faces 1", 2, "faces at least, and 1 are allowed", "--max-faces"),
        ("mesh {good} a.glb --bounds 0 0 1 1", 2, "miss the terrain", "It lies in 500000"),
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
        ("mesh {good} a.glb --tile-faces 9 --bounds 0 0 1 1", 2, "miss the terrain", "It lies in"),
        ("mesh {good} a.glb --tile-faces 9 --origin world", 2, "too short for", ".obj or .ply"),
        ("mesh {good} no/a.glb --tile-faces 9", 3, "no does not exist", "Create it first"),
        ("mesh {good} good.glb --tile-faces 9 --max-error 0", 2, "largest error is 0", "above 0"),
        ("mesh {good} other.mtl.obj --tile-faces 9", 3, "other.mtl: is no folder", "of one"),
        ("vrml {hill} a.wrl --elevation-grid --tile-faces 9", 2, "--tile-faces is about", "Leave"),
        ("mesh {good} a.glb --resolution 1", 2, "about a grid of heights", "--elevation-grid"),
        ("mesh {hill} a.glb --elevation-grid", 2, "only VRML has", "a .wrl"),
        ("mesh {good} a.wrl --elevation-grid", 2, "can have no holes", "without void"),
        ("vrml {hill} a.wrl --elevation-grid --resolution 0", 2, "resolution is 0", "above 0"),
        ("vrml {hill} a.wrl --elevation-grid --resolution 1e-6", 2, "1.2e+07 × 8e+06", "such as"),
        ("vrml {hill} a.wrl --elevation-grid --solid", 2, "--solid is about a mesh", "Leave out"),
        ("vrml {hill} a.wrl --elevation-grid --max-faces 9", 2, "--max-faces is about", "Leave"),
        ("vrml {hill} a.wrl --elevation-grid --bounds 0 0 1 1", 2, "miss the terrain", "It lies"),
        ("vrml {huge} a.wrl --elevation-grid", 2, "beyond float32", ""),
        ("mesh {huge} a.ply --origin world", 2, "beyond float32", ""),
    ],
)  # fmt: skip
def test_wrong(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], arguments: str, code: int, words: str, hint: str,
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
    said = told(monkeypatch, capsys, f"export-{command}", *(part.format(**names) for part in rest))
    assert said[:2] == (code, ""), said
    assert words in said[2] and hint in said[2], said[2]
    assert code == 1 or hint == "" or len(said[2].strip().splitlines()) >= 2
    after = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert after == before


def test_without_usd_core(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """One is told what to install before anything is computed."""
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.setattr(export, "build", None)
    said = told(monkeypatch, capsys, "export-mesh", saved(SITE), tmp_path / "a.usdc")
    assert said[:2] == (2, "")
    assert "usd-core is not installed" in said[2] and "terratool[usd]" in said[2]


def test_what_is_there_is_refused_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before the definition is read, which may take long."""
    (tmp_path / "a.obj").write_text("mine")
    code, _, err = told(monkeypatch, capsys, "export-obj", "missing.json", tmp_path / "a.obj")
    assert code == 3 and "a.obj: exists already" in err


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
    for name in ("a.obj", "grid.wrl"):
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


# --- the commands ----------------------------------------------------------------------------


def test_the_commands_say_what_they_did(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    saved(SITE, "site.json")
    code, out, err = told(monkeypatch, capsys, "export-obj", "site.json", "a.obj")
    report = exported(terrain_of(SITE), tmp_path / "b.obj")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith(f"{report.faces:,} faces, {report.walls} of them upright; an error")
    assert lines[0].endswith("an error of 0.00819 m was wanted (1/1000 of the relief, 8.19 m)")
    assert lines[1] == "a.obj, a.mtl: zero is at 500000 4649776 0"
    assert lines[2].startswith("Walls: 13 m seen") and "5 m high" in lines[2]
    assert lines[3].startswith("Lost: the ground is up to 0.00")
    assert "inside of their arcs" in lines[3]
    code, out, err = told(
        monkeypatch, capsys, "export-mesh", "site.json", "c.obj", "--json", "--max-faces", "60"
    )
    said = json.loads(out)
    wanted = exported(terrain_of(SITE), tmp_path / "d.obj", max_faces=60).to_json()
    assert said == {**wanted, "files": ["c.obj", "c.mtl"]}
    assert said["faces"] <= 60 and (tmp_path / "c.obj").exists()
    saved(HILL, "hill.json")
    code, out, err = told(
        monkeypatch, capsys, "export-vrml", "hill.json", "h.wrl", "--elevation-grid",
        "--resolution", "0.1",
    )  # fmt: skip
    assert code == 0
    assert out.splitlines()[:2] == [
        "121 × 81 nodes of 0.1 × 0.1 (as asked)",
        "h.wrl: zero is at 500000 4649776 0",
    ]


def test_the_three_commands_write_the_same(
    tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    site = saved(SITE)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    for suffix, command in ((".obj", "export-obj"), (".wrl", "export-vrml")):
        for folder, name in (("one", "export-mesh"), ("two", command)):
            done = told(monkeypatch, capsys, name, site, tmp_path / folder / f"a{suffix}")
            assert done[0] == 0
        one, two = (tmp_path / folder / f"a{suffix}" for folder in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()
    assert told(monkeypatch, capsys, "export-obj", site, one.with_suffix(".obj"))[0] == 3
    again = told(monkeypatch, capsys, "export-vrml", site, one, "--overwrite")
    assert again[0] == 0


def test_a_link_keeps_being_one(tmp_path: Path) -> None:
    """What stands behind it is written, and named."""
    (tmp_path / "real").mkdir()
    (tmp_path / "a.obj").symlink_to(tmp_path / "real" / "b.obj")
    report = exported(terrain_of(SITE), tmp_path / "a.obj", overwrite=True)
    assert (tmp_path / "a.obj").is_symlink()
    assert report.files == (tmp_path / "real" / "b.obj", tmp_path / "real" / "b.mtl")
    assert all(path.is_file() for path in report.files)


# --- docs/mesh.md ----------------------------------------------------------------------------


def test_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                  capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    """Its options, formats and keys are those that there are, and its example says the like."""
    page = (ROOT / "docs" / "mesh.md").read_text(encoding="utf-8")
    _, told_help, _ = told(monkeypatch, capsys, "export-mesh", "--help")
    options = set(re.findall(r"^  (--[\w-]+)", told_help, re.MULTILINE)) - {"--overwrite"}
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
    _, out, _ = told(monkeypatch, capsys, *words)
    numbers = re.compile(r"[\d,.]*\d")
    assert numbers.sub("#", out).splitlines() == [numbers.sub("#", line) for line in lines]
    code = page.split("```python")[1].split("```")[0].replace("samples/", f"{ROOT}/samples/")
    exec(code, {})
    assert (tmp_path / "site.glb").exists()
