"""Meshes that are joined of tiles are those of one piece, with further edges."""

from __future__ import annotations

import numpy as np
import pytest

from terratool.mesh import joined
from terratool.mesh.build import build
from tests.conftest import terrain_of
from tests.mesh.test_bilinear import largest_miss
from tests.meshes import SITE

YARD = {
    "size": [12, 7],
    "origin": [500000, 4649776],
    "surfTypes": {"floor": {"color": [10, 20, 30]}, "box": {}},
    "elemTypes": {
        "rough": {"grid": np.random.default_rng(4).integers(0, 5, (15, 25)).tolist()},
        "level": {"x": [1]},
    },
    "elemTree": {
        "type": "rough", "surface": "floor", "vScale": 0.05, "cells": 1,
        "children": [
            {"type": "level", "surface": "box", "at": [5.9, 3.4], "extent": [9.3, 1.7],
             "turnDeg": 11, "vScale": 0.4},
        ],
    },
}  # fmt: skip


@pytest.fixture
def small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joined, "_TILE", 300)


@pytest.mark.usefixtures("small_tiles")
def test_tiles_meet_in_shared_edges() -> None:
    """Each edge has two faces but at the rim, also along a wall that passes from tile to tile."""
    terrain = terrain_of(YARD)
    found, whole = joined.build_joined(terrain, 0.01), build(terrain, 0.01)
    mesh = found.mesh
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    different, count = np.unique(edges, axis=0, return_counts=True)
    x, y, _ = mesh.vertices.T
    on_rim = [(x == 0), (x == 12), (y == 0), (y == 7)]
    rim = np.any([side[different].all(axis=1) for side in on_rim], axis=0)
    assert (count[~rim] == 2).all()
    assert (count[rim] == 1).all()
    assert np.unique(mesh.faces).tolist() == list(range(len(mesh.vertices)))
    assert found.shell == len(mesh.faces) == len(mesh.surfaces) == len(mesh.walls)
    assert found.error <= 0.01
    assert len(mesh.faces) < 1.5 * len(whole.mesh.faces)
    assert mesh.origin.tolist() == whole.mesh.origin.tolist()


@pytest.mark.usefixtures("small_tiles")
def test_joined_ground_is_that_of_the_terrain() -> None:
    terrain = terrain_of({**YARD, "elemTree": {**YARD["elemTree"], "children": []}})
    found = joined.build_joined(terrain, 0.01)
    assert largest_miss(terrain, found.mesh) <= found.error
    areas = [area_by_surface(built.mesh) for built in (found, build(terrain, 0.01))]
    assert areas[0] == pytest.approx(areas[1])


@pytest.mark.usefixtures("small_tiles")
def test_surfaces_and_void_stay() -> None:
    """Of the same area each, seen from above; walls have the same area, too."""
    terrain = terrain_of(SITE)
    found, whole = joined.build_joined(terrain, 0.01).mesh, build(terrain, 0.01).mesh
    assert area_by_surface(found) == pytest.approx(area_by_surface(whole), rel=1e-3)


def area_by_surface(mesh: object) -> dict[int, float]:
    """Area of the ground of each surface from above, and of walls at -2."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    found = {-2: 0.5 * float(np.linalg.norm(normal[mesh.walls], axis=1).sum())}
    for surface in np.unique(mesh.surfaces).tolist():
        own = (mesh.surfaces == surface) & ~mesh.walls
        found[surface] = 0.5 * float(normal[own, 2].sum())
    return found


def test_faces_follow_a_curve() -> None:
    """Hilbert's: it meets each cell once, and goes from each to one beside it."""
    cells = np.stack(np.meshgrid(*2 * [np.arange(256.0)]), -1).reshape(-1, 2)
    order = np.argsort(joined._hilbert(cells))
    assert len(np.unique(joined._hilbert(cells))) == len(cells)
    assert (np.abs(np.diff(cells[order], axis=0)).sum(axis=1) == 1).all()
