"""What is said of a mesh: its walls, its rounding, and what is left out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from tests.conftest import terrain_of
from tests.meshes import HILL, box, errors, exported, flat, read


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


def test_small_elements_are_counted(tmp_path: Path) -> None:
    """What is too small for the mesh is left out whatever is asked for, and its height is said."""
    speck = {"type": "floor", "cellX": 9, "cellY": 9, "cells": 1000, "children": [
        {"type": "floor", "cellX": 999, "cellY": 999, "cells": 1000, "children": [
            {"type": "box", "cellX": 999, "cellY": 999, "vScale": 0.3}]}]}  # fmt: skip
    statement = exported(flat(speck), tmp_path / "a.ply", 0.01).statement
    assert (statement.left.small, statement.left.faint) == (1, 0)
    assert statement.miss == pytest.approx(0.3)
    assert "1 element too small for the mesh left out" in "".join(statement.sentences())
