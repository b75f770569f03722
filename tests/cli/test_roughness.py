"""Rough surfaces on the command line: in every product, and left out of every one."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from tests.commands import ROOT, call

Json = dict[str, Any]
HUSKY = ROOT / "samples" / "vehicles" / "husky-a200.json"


def stones(rms: float = 0.03, correlation: float = 0.35) -> Json:
    """A level floor, the eastern half of it stony."""
    return {
        "size": [8, 5], "origin": [2, -7],
        "surfTypes": {
            "stones": {
                "preset": "gravel", "roughness": {"rms": rms, "correlation": correlation, "seed": 6}
            },
            "floor": {"preset": "concrete"},
        },
        "elemTypes": {"flat": {"x": [0]}},
        "elemTree": {
            "type": "flat", "surface": "floor", "cells": [2, 1],
            "children": [{"type": "flat", "surface": "stones", "cellX": 1, "cellY": 0}],
        },
    }  # fmt: skip


@pytest.fixture
def yard(saved: Callable[..., Path]) -> Path:
    return saved(stones())


def heights(answer: str) -> np.ndarray:
    return np.array([float(row["z"]) for row in csv.DictReader(answer.splitlines())])


def test_query(yard: Path) -> None:
    """Heights with the relief, and the level ground without."""
    points = [n for x in np.linspace(6.1, 9.9, 50) for n in (x, -5.0)]
    found = heights(call("query", yard, *points).out)
    assert 0.005 < found.std() < 0.1
    assert (heights(call("query", yard, "--no-roughness", *points).out) == 0).all()
    assert (heights(call("query", yard, 3, -5).out) == 0).all()


def test_info(yard: Path) -> None:
    """What each rough surface has; nothing of it where it is left out."""
    assert "roughness      stones: rms 0.03, correlation 0.35, seed 6\n" in call("info", yard).out
    summary = json.loads(call("info", yard, "--json").out)
    assert summary["roughness"] == [
        {"surface": "stones", "rms": 0.03, "correlation": 0.35, "seed": 6}
    ]
    smooth = json.loads(call("info", yard, "--json", "--no-roughness").out)
    assert smooth["roughness"] == [] and smooth["height"]["high"] == 0
    assert 0.04 < summary["height"]["high"] < 0.2


def test_export_dem(yard: Path, tmp_path: Path) -> None:
    """In pixels, by default as fine as the relief needs."""
    whole, smooth = tmp_path / "dem.tif", tmp_path / "smooth.tif"
    said = call("export-dem", yard, whole)
    assert "of 0.0875 (a quarter of the shortest correlation length)" in said.out
    assert "wall became ramps" in said.out
    assert call("export-dem", yard, smooth, "--no-roughness").code == 0
    with rasterio.open(whole) as one:
        values = one.read(1)
    half = values.shape[1] // 2
    assert values[:, half + 1 :].std() == pytest.approx(0.03, rel=0.3)
    assert (values[:, : half - 1] == 0).all()
    with rasterio.open(smooth) as one:
        assert (one.read(1) == 0).all()


def test_tiles_are_those_of_one_raster(yard: Path, tmp_path: Path) -> None:
    """Bit for bit; and those of the smooth terrain are others."""
    whole, tiles = tmp_path / "dem.tif", tmp_path / "tiles"
    finely = "--resolution", 0.01, "--no-losses"
    assert call("export-dem", yard, whole, *finely).code == 0
    mosaic = "export-dem", yard, "--tiles", tiles, "--tile-size", 512, *finely
    assert call(*mosaic).code == 0
    with rasterio.open(whole) as one, rasterio.open(tiles / "mosaic.vrt") as other:
        assert np.array_equal(one.read(1), other.read(1))
    assert "definition" in call(*mosaic, "--no-roughness").err


@pytest.mark.parametrize(
    ("command", "name"),
    [("export-mesh", "a.ply"), ("export-obj", "a.obj"), ("export-vrml", "a.wrl")],
)
def test_meshes(command: str, name: str, yard: Path, tmp_path: Path) -> None:
    """Faces enough for the relief, and few without."""
    rough = json.loads(call(command, yard, tmp_path / name, "--json").out)
    smooth = json.loads(
        call(command, yard, tmp_path / name, "--json", "--no-roughness", "--overwrite").out
    )
    assert rough["faces"] > 500 and rough["wall_faces"] > 0
    assert (smooth["faces"], smooth["wall_faces"]) == (4, 0)


def test_an_elevation_grid(yard: Path, tmp_path: Path) -> None:
    """As a mesh of faces."""
    words = "export-mesh", yard, tmp_path / "a.wrl", "--elevation-grid", "--resolution", 0.1
    assert "the grid is up to" in call(*words).out
    assert "Lost: nothing." in call(*words, "--no-roughness", "--overwrite").out


def test_the_verdict(saved: Callable[..., Path]) -> None:
    """Stones bar ways that level ground does not."""
    words = "traversability", saved(stones(0.08, 0.5)), "--vehicle", HUSKY, "--json"
    rough = json.loads(call(*words).out)["map"]
    smooth = json.loads(call(*words, "--no-roughness").out)["map"]
    assert smooth["fractions"]["no-go"] == 0 < rough["fractions"]["no-go"]
    on_floor, on_stones = (
        next(row for row in rough["by_surface"] if row["surface"] == name)
        for name in ("floor", "stones")
    )
    assert on_stones["go"] < 0.98 * on_floor["go"] and on_floor["caution"] < on_stones["caution"]


def test_a_relief_finer_than_the_pixels_is_noted(saved: Callable[..., Path]) -> None:
    """It is not seen as wheels meet it; where pixels are fine enough nothing is said."""
    note = "Rough surfaces have a correlation length of 0.02 m"
    fine = " ".join(
        call("traversability", saved(stones(0.002, 0.02)), "--vehicle", HUSKY).out.split()
    )
    assert note in fine
    coarse = call("traversability", saved(stones(), "coarse.json"), "--vehicle", HUSKY).out
    assert "Rough surfaces" not in coarse
