"""Tiles of a mesh as files, and their index."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from terratool.errors import RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.mesh.formats.table import FORMATS
from terratool.mesh.tiles import INDEX
from tests.conftest import terrain_of
from tests.meshes import STRAIGHT, exported_tiles, random_definition


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return terrain_of(random_definition(1, 30, STRAIGHT, ("grass", "rock")))


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_for_each_tile_and_an_index(terrain: Terrain, tmp_path: Path, suffix: str) -> None:
    report = exported_tiles(terrain, tmp_path / "site", suffix, 0.01, rows=2, columns=2)
    companions = FORMATS[suffix].companions
    expected = [
        f"mesh_0{r}_0{c}{end}" for r in (0, 1) for c in (0, 1) for end in (suffix, *companions)
    ]
    assert names_in(tmp_path / "site") == sorted([*expected, INDEX])
    index = json.loads((tmp_path / "site" / INDEX).read_text())
    assert [index[key] for key in ("version", "rows", "columns")] == [1, 2, 2]
    assert index["error"] == report.statement.error <= 0.01
    assert index["bounds"] == [0, 0, 10, 10] == list(report.bounds)
    assert index["origin"] == [0, 0, 0]
    assert index["faces"] == report.faces == sum(tile["faces"] for tile in index["tiles"])
    assert [(tile["row"], tile["column"]) for tile in index["tiles"]] == [
        (0, 0), (0, 1), (1, 0), (1, 1)
    ]  # fmt: skip
    assert [name for tile in index["tiles"] for name in tile["files"]] == expected
    west, south, east, north = zip(*(tile["bounds"] for tile in index["tiles"]), strict=True)
    assert west[0] == 0 and west[1] == east[0] == west[3] and south[0] == north[2]


@pytest.mark.parametrize("world", [False, True])
def test_the_files_fit(tmp_path: Path, world: bool) -> None:
    """Loaded together they are one closed surface, and lie where the terrain is."""
    definition = random_definition(1, 30, STRAIGHT, ("grass", "rock"))
    definition["origin"] = [1000, 2000]
    terrain = terrain_of(definition)
    report = exported_tiles(terrain, tmp_path, ".ply", 0.01, rows=2, columns=2, world=world)
    meshes = [trimesh.load(tmp_path / tile.files[0], process=False) for tile in report.tiles]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    begins = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([m.faces + b for m, b in zip(meshes, begins, strict=False)])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert report.origin == ((0, 0, 0) if world else (1000, 2000, 0))
    assert np.allclose(low[:2] + report.origin[:2], (1000, 2000))
    assert np.allclose(high[:2] + report.origin[:2], (1010, 2010))
    unique, index = np.unique(vertices, axis=0, return_inverse=True)
    edges = np.sort(index.reshape(-1)[faces][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    pairs, runs = np.unique(edges, axis=0, return_counts=True)
    p, q = (unique[pairs[runs % 2 == 1][:, k]] for k in range(2))
    rim = np.zeros(len(p), bool)
    for axis in (0, 1):
        for side in (low[axis], high[axis]):
            rim |= (p[:, axis] == side) & (q[:, axis] == side)
    assert len(rim) and rim.all()


def test_what_is_there_is_refused_or_replaced(terrain: Terrain, tmp_path: Path) -> None:
    def export(**options: Any) -> None:
        exported_tiles(terrain, tmp_path, ".obj", 0.01, **options)

    (tmp_path / "mesh_of_mine.obj").write_text("mine")
    export(rows=2, columns=2)
    before = (tmp_path / INDEX).read_bytes()
    with pytest.raises(WriteError, match="exists already"):
        export(rows=1, columns=1)
    (tmp_path / INDEX).unlink()
    with pytest.raises(WriteError, match="exists already"):
        export(rows=1, columns=1)
    export(rows=1, columns=1, overwrite=True)
    assert names_in(tmp_path) == [
        "mesh_00_00.mtl", "mesh_00_00.obj", "mesh_of_mine.obj", INDEX
    ]  # fmt: skip
    export(rows=2, columns=2, overwrite=True)
    assert (tmp_path / INDEX).read_bytes() == before


def test_where_there_is_an_index_all_is_whole(terrain: Terrain, tmp_path: Path) -> None:
    exported_tiles(terrain, tmp_path, ".stl", 0.01, rows=1, columns=2)
    told = []

    def stop(done: int, count: int, faces: int) -> None:
        told.append((done, count, faces > 0))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        exported_tiles(
            terrain, tmp_path, ".stl", 0.01, rows=2, columns=2, overwrite=True, progress=stop
        )
    assert told == [(1, 4, True), (2, 4, True)]
    assert names_in(tmp_path) == ["mesh_00_00.stl", "mesh_00_01.stl"]


def test_a_tile_without_ground_has_no_file(tmp_path: Path) -> None:
    hole = {"type": "f", "cellX": 0, "cellY": 0, "surface": "hole", "span": [3, 1]}
    definition: dict[str, Any] = {
        "size": 4,
        "surfTypes": {"hole": {"void": True}},
        "elemTypes": {"f": {"x": [0]}},
        "elemTree": {"type": "f", "cells": [4, 1], "children": [hole]},
    }
    report = exported_tiles(terrain_of(definition), tmp_path, ".stl", 0.1, rows=1, columns=2)
    assert [tile.files for tile in report.tiles] == [(), ("mesh_00_01.stl",)]
    hole["span"] = [4, 1]
    with pytest.raises(RequestError, match="no ground"):
        exported_tiles(
            terrain_of(definition), tmp_path, ".stl", 0.1, rows=1, columns=2, overwrite=True
        )
    assert INDEX not in names_in(tmp_path)


def test_what_makes_no_sense_is_refused(terrain: Terrain, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="suffix"):
        exported_tiles(terrain, tmp_path, ".xyz", 0.1)
    with pytest.raises(RequestError, match="too short"):
        exported_tiles(terrain, tmp_path, ".stl", 0.1, world=True)
    with pytest.raises(WriteError, match="does not exist"):
        exported_tiles(terrain, tmp_path / "a" / "b", ".stl", 0.1)
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="is no folder"):
        exported_tiles(terrain, tmp_path / "file", ".stl", 0.1)
    assert names_in(tmp_path) == ["file"]
