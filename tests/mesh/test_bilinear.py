"""Cells over which heights are bilinear: exact errors, few faces, whole sides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.mesh.types import Mesh
from tests.conftest import terrain_of

ERROR = 0.01


def grid_terrain(heights: np.ndarray, **element: Any) -> Terrain:
    """A grid of heights in metres, given by rows from the south, with cells of 1 × 2 m."""
    rows, columns = heights.shape
    return terrain_of(
        {
            "size": [columns - 1, 2 * (rows - 1)],
            "elemTypes": {"grid": {"grid": heights[::-1].tolist()}},
            "elemTree": {"type": "grid", "vScale": 1, **element},
        }
    )


def tents_terrain(heights: np.ndarray) -> Terrain:
    """The same heights by an element for each row, which is a tent along y; all add up."""
    rows, columns = heights.shape
    last = rows - 1
    primitives, children = {}, []
    for row, values in enumerate(heights.tolist()):
        inner = 0 < row < last
        primitives[f"row {row}"] = {
            "x": values, "y": "tent" if inner else [0, 1] if row else [1, 0],
        }  # fmt: skip
        children.append(
            {"type": f"row {row}", "cellX": 0, "cellY": max(row - 1, 0), "vScale": 1}
            | ({"span": [1, 2]} if inner else {})
        )
    root = {"type": "ground", "vScale": 1, "cells": [1, last], "children": children}
    return terrain_of(
        {
            "size": [columns - 1, 2 * last],
            "elemTypes": {"ground": {"x": [0]}, **primitives},
            "elemTree": root,
        }
    )


def largest_miss(terrain: Terrain, mesh: Mesh) -> float:
    """The largest distance, along z, of 28 points of each face from the terrain."""
    shares = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6
    x, y, z = (shares @ (mesh.vertices + mesh.origin)[mesh.faces[~mesh.walls]]).reshape(-1, 3).T
    west, south, east, north = terrain.bounds
    x, y = np.clip(x, west, east), np.clip(y, south, north)  # off by rounding
    return float(np.abs(terrain.height(x, y) - z).max())


def is_whole(mesh: Mesh, sides: tuple[float, float]) -> bool:
    """Whether faces cover the ground once, and each inner edge has two of them."""
    corners = mesh.vertices[mesh.faces][:, :, :2]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    different, faces = np.unique(edges, axis=0, return_counts=True)
    inner = ~np.isin(different, rim_of(mesh, sides)).all(axis=1)
    return bool(
        (areas > 0).all()
        and np.isclose(areas.sum(), sides[0] * sides[1])
        and (faces[inner] == 2).all()
    )


def rim_of(mesh: Mesh, sides: tuple[float, float]) -> np.ndarray:
    """Vertices at the sides of the terrain."""
    x, y, _ = mesh.vertices.T
    return np.flatnonzero((x == 0) | (y == 0) | (x == sides[0]) | (y == sides[1]))


@pytest.mark.parametrize("make", [grid_terrain, tents_terrain])
def test_random_heights_take_few_faces(make: Any) -> None:
    """Within the error anywhere; no more than 1.7 times the least of saddles, as by Pottmann."""
    heights = np.random.default_rng(5).integers(0, 5, (7, 12)) * 0.1
    terrain = make(heights)
    built = build(terrain, ERROR)
    assert largest_miss(terrain, built.mesh) <= built.error <= ERROR
    assert is_whole(built.mesh, (11, 12))
    twists = np.abs(np.diff(np.diff(heights, axis=0), axis=1))
    least = np.maximum(twists / (4 * ERROR) / 1.118, 2).sum()
    assert len(built.mesh.faces) < 1.7 * least


@pytest.mark.parametrize("ratio", [0.9, 1.1, 3.9, 4.9, 7.1, 10.3, 13.5, 15.7, 18.2, 20, 40])
def test_each_pattern_is_within_the_error(ratio: float) -> None:
    """Of a single twisted cell, however many times the error its diagonal misses."""
    terrain = grid_terrain(np.array([[0.0, 0.3], [0.1, 0.4 - 4 * ERROR * ratio]]))
    built = build(terrain, ERROR)
    missed = largest_miss(terrain, built.mesh)
    assert 0.2 * ERROR < missed <= built.error + 1e-9
    assert built.error <= ERROR
    assert is_whole(built.mesh, (1, 2))


def test_sides_of_cells_stay_whole() -> None:
    """A twisted cell asks nothing of the level one beside it, which is two triangles."""
    terrain = grid_terrain(np.array([[0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.5, 0.0]]))
    mesh = build(terrain, ERROR).mesh
    level = (mesh.vertices[mesh.faces][:, :, 0] <= 1).all(axis=1)
    assert level.sum() == 2


@pytest.mark.parametrize("turn", [30, 90])
def test_turned_grids_are_within_the_error(turn: float) -> None:
    """Cells of a turned grid are meshed like those of another."""
    heights = np.random.default_rng(2).integers(0, 4, (4, 6)) * 0.2
    terrain = terrain_of(
        {
            "size": [9, 7],
            "elemTypes": {"flat": {"x": [0]}, "grid": {"grid": heights.tolist()}},
            "elemTree": {
                "type": "flat",
                "children": [
                    {"type": "grid", "at": [4.4, 3.6], "extent": [4, 3], "turnDeg": turn,
                     "vScale": 1},
                ],
            },
        }
    )  # fmt: skip
    built = build(terrain, ERROR)
    rng = np.random.default_rng(1)
    mesh = built.mesh
    ground = mesh.vertices[mesh.faces[~mesh.walls]]
    x, y, z = (rng.dirichlet([1, 1, 1], len(ground))[:, :, None] * ground).sum(axis=1).T
    off = np.abs(terrain.height(x, y) - z)
    assert np.quantile(off, 0.99) <= ERROR  # discs and walls aside
    assert built.error <= ERROR
