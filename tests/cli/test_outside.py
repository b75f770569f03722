"""What lies outside of a terrain is told before its elements are read, which may take minutes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from terratool.definition.reader import bounds_in
from tests.commands import ROOT, YARD, call

HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"
SENSOR = next((ROOT / "samples" / "sensors").glob("*.json"))
PLACED: dict[str, Any] = {**YARD, "size": [40, 20], "origin": [1000, -300]}


@pytest.mark.parametrize(
    "words",
    [
        ["query", "FILE", 5, 5],
        ["query", "FILE", 1041, -290, 999, -290],
        ["query", "FILE", 1010, -301],
        ["export-dem", "FILE", "out.tif", "--bounds", 0, 0, 5, 5],
        ["export-dem", "FILE", "out.gpkg", "--layer", "contours", "--bounds", 0, 0, 5, 5],
        ["export-mesh", "FILE", "out.ply", "--bounds", 1000, 0, 1005, 5],
        ["render", "FILE", "out.png", "--bounds", 0, -290, 5, -280],
        ["render", "FILE", "out.png", "--profile", 1000, 0, 1040, 0],
        ["traversability", "FILE", "--vehicle", HUSKY, "--bounds", 0, 0, 5, 5],
        ["traversability", "FILE", "--vehicle", HUSKY, "--route", 1001, -290, 1041, -290],
        ["traversability", "FILE", "--vehicle", HUSKY, "--from", 1001, -310],
        ["deform", "FILE", "--output", "out.json", "--vehicle", HUSKY, "--waypoints", "path.csv"],
        ["scan", "FILE", "out.ply", "--sensor", SENSOR, "--pose", 0, 0, 1, 0, 0, 0],
    ],
)
def test_it_is_refused_early(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[Any]
) -> None:
    """In a sentence that says where the terrain lies, and without a look at its elements."""
    file = tmp_path / "yard.json"
    wrong = {**PLACED["elemTree"], "type": "no such"}  # who looks at it ends with 1
    file.write_text(json.dumps({**PLACED, "elemTree": wrong}), encoding="utf-8")
    (tmp_path / "path.csv").write_text("1001,-290\n1041,-290\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    ran = call(*(file if word == "FILE" else word for word in words))
    assert (ran.code, ran.out) == (2, ""), ran.err
    assert "1000" in ran.err and "-300" in ran.err and "1040" in ran.err
    assert {path.name for path in tmp_path.iterdir()} == {"path.csv", "yard.json"}


@pytest.mark.parametrize(
    ("more", "bounds"),
    [
        ({}, (1000, -300, 1040, -280)),
        ({"size": 30}, (1000, -300, 1030, -270)),
        ({"size": -1}, None),
        ({"size": "wide"}, None),
        ({"origin": None}, None),
    ],
)
def test_a_text_says_where_it_is(more: dict[str, Any], bounds: Any) -> None:
    """By its size and origin alone; what is wrong with these is for the rules to say."""
    assert bounds_in(json.dumps({**PLACED, **more}).encode()) == bounds
    assert bounds_in(b'{"size": [1, 2') is None


def test_points_some_of_which_are_inside_are_answered(tmp_path: Path) -> None:
    """Those on the rim are inside, and the note of the others says that they are not."""
    file = tmp_path / "yard.json"
    file.write_text(json.dumps(PLACED), encoding="utf-8")
    ran = call("query", file, 1040, -280, 5, 5)
    assert ran.code == 0
    assert [line.rpartition(",")[2] for line in ran.out.splitlines()] == ["note", "", "outside"]
    # points of a file are answered whatever they are
    points = tmp_path / "points.csv"
    points.write_text("5,5\n", encoding="utf-8")
    ran = call("query", file, "--points", points)
    assert ran.code == 0 and ran.out.endswith(",outside\n")
