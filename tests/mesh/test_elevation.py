"""Terrains as grids of heights: where they are, and what they lose."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from terratool.mesh.elevation import _misses_at, export_elevation_grid
from terratool.mesh.types import HeightGrid
from tests.conftest import terrain_of
from tests.meshes import HILL, box, exported, flat
from tests.programs import program
from tests.viewers import COIN, output, python_with_coin


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
    return np.array(json.loads(output(python_with_coin(), "-c", code, path)))


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
    grid = HeightGrid(
        np.array([[0, 1], [0, 0]], np.float32), np.zeros((2, 2), np.int32), (1.0, 1.0),
        np.zeros(3), (), np.zeros((0, 3), np.uint8),
    )  # fmt: skip
    x, y = np.array([0.5, 0.9, 0.1]), np.array([0.5, 0.9, 0.9])
    # the one diagonal goes from the south-west to the high corner, the other misses it
    assert _misses_at(grid, x, y, np.zeros(3)) == pytest.approx([0.5, 0.9, 0.1])
    assert _misses_at(grid, x, y, np.array([0.5, 0.9, 0.1])) == pytest.approx([0.5, 0.1, 0.1])


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
