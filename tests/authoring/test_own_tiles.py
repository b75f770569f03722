"""Tiles of a user's own files, the ring that hangs, and grids whose middle is at 0, 0."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terratool
from terratool.authoring.curriculum import build
from terratool.authoring.curriculum.build import curriculum
from terratool.definition.reader import check
from terratool.errors import DefinitionError
from terratool.text.source import Source

TILE = (10.0, 8.0)
YARD: dict[str, Any] = {
    "size": [7, 5],
    "surfTypes": {"floor": {"color": [9, 8, 7]}, "hole": {"color": [200, 0, 0]}},
    "elemTypes": {"level": {"x": [0, 1]}, "ground": {"x": [1], "y": [0, 0.5, 1]}},
    "elemTree": {
        "type": "ground",
        "cells": [7, 5],
        "children": [
            {"cellX": 1, "cellY": 3, "type": "level", "surface": "hole", "vScale": 0.4},
            {"cellX": 4, "cellY": 0, "span": [2, 1], "part": "post"},
            {
                "cellX": 0,
                "cellY": 1,
                "span": [3, 1],
                "type": "level",
                "vScale": 2,
                "deck": {"thickness": 0.2},
            },
            {
                "cellX": 0,
                "cellY": 0,
                "type": "level",
                "vScale": 0.3,
                "repeat": {"count": [1, 1], "step": [1, 1]},
            },
        ],
    },
    "parts": {"post": {"type": "ground", "surface": "floor", "turnDeg": 90}},
}
"""A terrain without any symmetry, with names that definitions of tiles have, too."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a terrain and a library."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "yard.json").write_text(json.dumps(YARD))
    library = {
        "elemTypes": {"wedge": {"x": [0, 1]}},
        "parts": {"wedge": {"type": "wedge", "vScale": 0.5, "turnDeg": 270}},
    }
    (tmp_path / "kit.json").write_text(json.dumps(library))
    return tmp_path


def own(difficulty: float = 0.5, **keys: Any) -> build.Curriculum:
    """A row of three tiles of a difficulty; the second is of a file."""
    return curriculum(spec_of(difficulty, **keys))


def spec_of(difficulty: float, **keys: Any) -> dict[str, Any]:
    return {
        "rows": 1,
        "columns": 3,
        "tile": list(TILE),
        "difficulty": [difficulty] * 2,
        "origin": [3, 4],
        "kinds": {
            "a": {"kind": "flat"},
            "own": {"kind": "definition", "file": "yard.json", **keys},
            "b": {"kind": "box"},
        },
    }


def strewn(sides: tuple[float, float], count: int = 3000) -> Any:
    return np.random.default_rng(2).uniform((0, 0), sides, (count, 2)).T


def corner(sides: tuple[float, float]) -> tuple[float, float]:
    """World position of what stands in the middle of the second tile."""
    return 3 + (TILE[0] - sides[0]) / 2, 4 + TILE[1] + (TILE[1] - sides[1]) / 2


def assert_same(made: build.Curriculum, alone: Any, factor: float = 1.0) -> None:
    """The tile is the terrain, and there is level ground around it."""
    sides = alone.bounds[2:]
    x, y = strewn(sides)
    east, north = corner(sides)
    wanted, got = alone.column(x, y), made.terrain.column(x + east, y + north)
    assert got.top == pytest.approx(wanted.top * factor, abs=1e-9, nan_ok=True)
    assert got.bottom == pytest.approx(wanted.bottom * factor, abs=1e-9, nan_ok=True)
    rim = strewn(TILE)
    beside = (np.abs(rim[0] - TILE[0] / 2) > sides[0] / 2) | (
        np.abs(rim[1] - TILE[1] / 2) > sides[1] / 2
    )
    assert not made.terrain.height(rim[0][beside] + 3, rim[1][beside] + 4 + TILE[1]).any()


def test_a_tile_of_a_file_is_the_terrain_in_its_middle(folder: Path) -> None:
    made = own()
    assert_same(made, terratool.load("yard.json"))
    east, north = corner((7, 5))
    assert made.terrain.surface(1.5 + east, 3.5 + north) == "own: hole"
    assert made.terrain.surface(4.5 + east, 0.5 + north) == "own: floor"
    assert made.terrain.surface(6.5 + east, 3.5 + north) == "floor"  # that of the spec
    checked = check(Source("it", made.text.encode()))
    assert not [one for one in checked.findings if one.severity == "error"]


def test_a_factor_follows_the_difficulty(folder: Path) -> None:
    for difficulty in (0.0, 0.3, 1.0):
        made = own(difficulty, vScale="0.5 + 2 * difficulty**2")
        assert_same(made, terratool.load("yard.json"), 0.5 + 2 * difficulty**2)


def test_values_follow_the_difficulty(folder: Path) -> None:
    values = {
        "/elemTree/children/0/vScale": "0.1 + difficulty",
        "/elemTree/children/2/deck/thickness": "0.1 + 0.4*difficulty",
        "/elemTree/children/3/repeat/count/0": "1 + 4*difficulty",
        "/elemTypes/level/x/1": 0.75,
    }
    for difficulty, count in ((0.0, 1), (0.49, 2), (0.75, 4)):
        wanted = copy.deepcopy(YARD)
        children = wanted["elemTree"]["children"]
        children[0]["vScale"] = 0.1 + difficulty
        children[2]["deck"]["thickness"] = 0.1 + 0.4 * difficulty
        children[3]["repeat"]["count"][0] = count
        wanted["elemTypes"]["level"]["x"][1] = 0.75
        assert_same(own(difficulty, values=values), terratool.load(wanted))


def test_what_difficulty_does_not_change_is_written_once(folder: Path) -> None:
    spec = spec_of(0.0) | {"rows": 4, "difficulty": [0, 1], "jitter": 0}
    spec["kinds"]["own"]["values"] = {"/elemTypes/level/x/1": "0.1 + difficulty"}
    made = json.loads(curriculum(spec).text)
    names = [name for name in made["elemTypes"] if name.startswith("own")]
    assert names == [
        "own, 0: level",
        "own: ground",
        *(f"own, {d}: level" for d in (0.25, 0.5, 0.75)),
    ]
    assert sorted(made["surfTypes"]) == ["floor", "own: floor", "own: hole"]


def test_parts_of_a_file_follow_the_difficulty_too(folder: Path) -> None:
    """A part is written alike at two difficulties, and stands for two shapes."""
    yard = copy.deepcopy(YARD)
    yard["parts"]["post"]["vScale"] = 0.7  # else all parts are written out
    (folder / "yard.json").write_text(json.dumps(yard))
    spec = {
        "rows": 2, "columns": 1, "tile": [7, 5], "jitter": 0,
        "kinds": {
            "own": {
                "kind": "definition", "file": "yard.json",
                "values": {"/elemTypes/ground/y/2": "1 + 4*difficulty"},
            }
        },
    }  # fmt: skip
    made = curriculum(spec)
    x, y = strewn((7, 5))
    for row, highest in enumerate((1.0, 3.0)):
        yard["elemTypes"]["ground"]["y"][2] = highest
        wanted = terratool.load(yard).height(x, y)
        assert made.terrain.height(x + 7 * row, y) == pytest.approx(wanted, abs=1e-9)


def test_a_part_of_a_library_stands_in_the_middle(folder: Path) -> None:
    made = own(0.25, file="kit.json", part="wedge", extent=[4, 2], vScale="4*difficulty")
    x, y = strewn((4.0, 2.0))
    east, north = corner((4.0, 2.0))
    # turned by 270 it rises to the north; in an oblong cell it is trimmed to a square
    inside = np.abs(x - 2) < 1
    z = made.terrain.height(x + east, y + north)
    at = 0.5 + (y[inside] - 1) / 4
    assert z[inside] == pytest.approx(0.5 * at, abs=1e-9)
    assert not z[~inside].any()


def test_the_same_names_in_two_files_do_not_meet(folder: Path) -> None:
    other = copy.deepcopy(YARD)
    other["elemTypes"]["ground"] = {"x": [3]}
    (folder / "other.json").write_text(json.dumps(other))
    spec = spec_of(0.5)
    spec["kinds"]["b"] = {"kind": "definition", "file": "other.json"}
    made = curriculum(spec)
    assert_same(made, terratool.load("yard.json"))
    east, north = corner((7, 5))
    assert made.terrain.height(6.5 + east, 4.5 + north + TILE[1]) == 3.0


@pytest.mark.parametrize(
    ("keys", "pointer", "said"),
    [
        ({"file": "none.json"}, "/file", "no file"),
        ({"file": "../yard.json"}, "/file", "outside"),
        ({"file": "/yard.json"}, "/file", "absolute"),
        ({"file": "https://a.b/yard.json"}, "/file", "address"),
        ({"file": "spec.json"}, "/file", "is a curriculum"),
        ({"file": "car.json"}, "/file", "is a vehicle"),
        ({"file": "cut.json"}, "/file", "the file ends"),
        ({"file": "wrong.json"}, "/file", "has an error"),
        ({"file": "large.json"}, "/file", "more than the tile"),
        ({"file": "tracks.json"}, "/file", "tracks"),
        ({"file": "deep.json"}, "/file", "deeper than 64"),
        ({"file": "kit.json"}, "/file", "which part"),
        ({"file": "kit.json", "part": "wegde"}, "/part", "no part"),
        ({"file": "kit.json", "part": "wedge", "extent": 9}, "/file", "more than the tile"),
        ({"file": "kit.json", "part": "wedge", "values": {"/a": 1}}, "/values", "for terrains"),
        ({"part": "post"}, "/part", "for libraries"),
        ({"extent": 3}, "/extent", "for libraries"),
        ({"vScale": "2*t"}, "/vScale", "no known name"),
        ({"vScale": "1/difficulty"}, "/vScale", "not a finite number at difficulty = 0"),
        ({"values": {"/elemTree/children": 1}}, "/values/~1elemTree~1children", "no number"),
        ({"values": {"size": 1}}, "/values/size", "no number"),
        ({"values": {"/size/0/0": 1}}, "/values/~1size~10~10", "no number"),
        ({"values": {"/size/7": 1}}, "/values/~1size~17", "no number"),
        ({"values": {f"/size/{n}": 1 for n in range(1001)}}, "/values", "more than 1,000"),
        ({"values": {"/size/0": "1**"}}, "/values/~1size~10", "value is missing"),
        (
            {"values": {"/elemTree/children/0/cellX": "9*difficulty"}},
            "/values",
            'at difficulty 1, "yard.json" would be invalid',
        ),
    ],
)
def test_what_is_wrong_is_said_where_it_stands(
    folder: Path, keys: dict[str, Any], pointer: str, said: str
) -> None:
    files: dict[str, Any] = {
        "wrong.json": {**YARD, "elemTypes": {}},
        "large.json": {**YARD, "size": [7, 8.5]},
        "tracks.json": {**YARD, "tracks": [{"path": [[1, 1], [2, 2]], "width": 0.2, "depth": 0.1}]},
        "car.json": {"mass": 3, "wheels": {}, "wheelbase": 1},
    }
    root: dict[str, Any] = {"type": "level"}
    for _ in range(64):
        root = {"type": "level", "cells": 1, "children": [{"cellX": 0, "cellY": 0, **root}]}
    files["deep.json"] = {**YARD, "elemTree": root}
    for name, value in files.items():
        (folder / name).write_text(json.dumps(value))
    (folder / "cut.json").write_text(json.dumps(YARD)[:-1])
    spec = {**spec_of(0.5, **keys), "difficulty": [0, 1]}
    (folder / "spec.json").write_text(json.dumps(spec))
    with pytest.raises(DefinitionError) as caught:
        curriculum("spec.json")
    (finding,) = caught.value.findings
    assert (finding.code, finding.pointer) == ("TT801", f"/kinds/own{pointer}")
    assert said in finding.message
    assert finding.hint


def test_a_file_beside_the_spec_is_read_from_elsewhere(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "there").mkdir()
    (folder / "yard.json").rename(folder / "there" / "yard.json")
    (folder / "there" / "spec.json").write_text(json.dumps(spec_of(0.5)))
    monkeypatch.chdir("/")
    made = curriculum(folder / "there" / "spec.json")
    assert_same(made, terratool.load(folder / "there" / "yard.json"))


# --- the floating ring ---------------------------------------------------------------------------


@pytest.mark.parametrize("difficulty", [0.0, 0.37, 1.0])
def test_the_ring_is_that_of_isaac_lab(difficulty: float) -> None:
    """`mesh_terrains.floating_ring_terrain`: a border of boxes over level ground."""
    spec = {
        "rows": 1,
        "columns": 1,
        "tile": list(TILE),
        "difficulty": [difficulty] * 2,
        "patches": {"spawn": {"radius": 0.2, "count": 20}},
        "kinds": {"it": {"kind": "floatingRing", "platform": 2, "thickness": 0.07}},
    }
    made = curriculum(spec)
    height, width = 1.0 - 0.6 * difficulty, 0.5 + 0.5 * difficulty
    x, y = strewn(TILE)
    away = np.maximum(np.abs(x - TILE[0] / 2), np.abs(y - TILE[1] / 2))
    below = (away > 1) & (away < 1 + width)
    found = made.terrain.column(x, y)
    assert found.top[:, 0] == pytest.approx(np.zeros(x.shape))
    assert (found.top.shape[1] == 2) and (np.isfinite(found.top[:, 1]) == below).all()
    assert found.bottom[below, 1] == pytest.approx(height, abs=1e-4)
    assert found.top[below, 1] == pytest.approx(height + 0.07, abs=1e-4)
    # robots begin on the ground, and not where the ring hangs over them
    assert made.origins[0, 0].tolist() == [5.0, 4.0, 0.0]
    spawn = made.patches["spawn"][0, 0]
    far = np.maximum(*np.abs(spawn[:, :2] - np.array(TILE) / 2).T)
    assert ((far < 1) | (far > 1 + width)).all() and not spawn[:, 2].any()


# --- the middle at 0, 0 --------------------------------------------------------------------------


def test_a_grid_is_centred_on_request() -> None:
    spec = {
        "rows": 3,
        "columns": 2,
        "tile": list(TILE),
        "border": 2.5,
        "kinds": {"a": {"kind": "box"}},
    }
    corner, middle = curriculum(spec), curriculum({**spec, "origin": "center"})
    assert middle.terrain.bounds == (-17.5, -10.5, 17.5, 10.5)
    assert middle.origins.mean(axis=(0, 1))[:2] == pytest.approx([0, 0])
    assert middle.origins - corner.origins == pytest.approx(
        np.broadcast_to([-15.0, -8.0, 0.0], (3, 2, 3))
    )
    assert middle.origins[2, 0, :2].tolist() == [10.0, -4.0]  # rows along x
