"""Meshes of rough surfaces: within the error everywhere, upright where a relief ends."""

from __future__ import annotations

import math
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.mesh.build import build
from terratool.mesh.export import RELIEF_FACES, MeshOptions
from terratool.mesh.loss import wall_summary
from terratool.mesh.tiles import TileCount, lay_out
from tests.conftest import terrain_of
from tests.mesh.test_tiles import check_seams, tiles_of, union
from tests.meshes import (
    CURVED,
    STRAIGHT,
    check_closed,
    check_faces,
    check_solid,
    covered,
    errors,
    exported,
    random_definition,
)

Json = dict[str, Any]

GRAVEL: Json = {"roughness": {"rms": 0.02, "correlation": 0.3}}
ROCK: Json = {"roughness": {"rms": 0.05, "correlation": 1, "seed": 4}}


def site(**more: Any) -> Json:
    """Oblong gravel with a smooth turned plate, a rock and a hill of gravel on it."""
    children = [
        {"type": "hill", "cellX": 1, "cellY": 1, "turnDeg": 30, "surface": "plate"},
        {"type": "floor", "cellX": 3, "cellY": 0, "surface": "rock"},
        {"type": "hill", "cellX": 2, "cellY": 0},
    ]
    tree = {"type": "floor", "surface": "gravel", "cells": [4, 2], "children": children}
    return {
        "size": [8, 5], "origin": [100, 50],
        "surfTypes": {"gravel": GRAVEL, "rock": ROCK, "plate": {}, "hole": {"void": True}},
        "elemTypes": {"floor": {"x": [0]}, "hill": {"x": "tent", "y": "cos"}},
        "elemTree": tree, **more,
    }  # fmt: skip


@pytest.mark.parametrize("error", [0.05, 0.02, 0.005, 0.001])
def test_no_point_is_farther_than_the_error(error: float) -> None:
    """At random points of every face, from errors above the rms to far below it."""
    terrain = terrain_of(site())
    built = build(terrain, error)
    check_faces(built.mesh)
    check_closed(built.mesh, terrain)
    assert built.error <= error
    assert errors(built.mesh, terrain, 20_000, built.error * (1 + 1e-9)).max() <= error * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_whatever_lies_on_it(seed: int) -> None:
    """Turned, nested, curved and stepped elements whose reliefs meet, voids among them."""
    definition = deepcopy(random_definition(seed, 30, {**STRAIGHT, **CURVED}))
    definition["surfTypes"]["grass"]["roughness"] = {"rms": 0.1, "correlation": 2.5, "seed": seed}
    definition["surfTypes"]["rock"]["roughness"] = {"rms": 0.3, "correlation": 6}
    terrain = terrain_of(definition)
    built = build(terrain, 0.05)
    check_faces(built.mesh)
    check_closed(built.mesh, terrain)
    assert errors(built.mesh, terrain, 5000, 0.05).max() <= 0.05 * (1 + 1e-9)


def test_a_relief_ends_upright() -> None:
    """At the edge of another surface a wall as high as the relief stands, and none within it."""
    definition = site()
    definition["elemTree"]["children"] = [
        {"type": "floor", "cellX": 1, "cellY": 0, "surface": "plate"},
        {"type": "floor", "cellX": 3, "cellY": 1},  # gravel, as all around
    ]
    terrain = terrain_of(definition)
    mesh = build(terrain, 1e-3).mesh
    walls = mesh.vertices[mesh.faces[mesh.walls]] + mesh.origin
    x, y = walls[..., 0], walls[..., 1]
    beside = np.minimum(np.abs(x - 102), np.abs(x - 104)) < 1e-7
    assert (beside | (np.abs(y - 52.5) < 1e-7)).all() and ((x < 104.1) & (y < 52.6)).all()
    # the relief crosses the plate's height again and again; nothing else is left of the edge
    assert wall_summary(mesh).length == pytest.approx(2 * 2.5 + 2, rel=1e-6)
    assert wall_summary(mesh).area == pytest.approx(7 * 0.02 * math.sqrt(2 / math.pi), rel=0.35)


def test_ruts_in_it() -> None:
    """Their floors have the relief of the ground, or that of their own surface."""
    tracks = [
        {"path": [[101, 51], [107, 51.5]], "width": 0.5, "depth": 0.1},
        {"path": [[101, 54], [107, 53.5]], "width": 0.5, "depth": 0.1, "surface": "plate"},
    ]
    terrain = terrain_of(site(tracks=tracks))
    built = build(terrain, 0.003)
    check_faces(built.mesh)
    check_closed(built.mesh, terrain)
    aside = built.loss.ruts.wall_offset + 1e-7
    assert errors(built.mesh, terrain, 10_000, 0.003, aside).max() <= 0.003 * (1 + 1e-9)


def test_tiles_fit() -> None:
    """Seams through a relief have the same vertices on both sides, and the error holds."""
    terrain = terrain_of(site())
    layout = lay_out(terrain, 0.005, TileCount(rows=2, columns=3))
    tiles = tiles_of(terrain, layout)
    assert check_seams(layout, tiles) > 100
    mesh = union(list(tiles.values()))
    check_faces(mesh)
    check_closed(mesh, terrain)
    assert errors(mesh, terrain, 10_000, 0.005).max() <= 0.005 * (1 + 1e-9)
    assert covered(mesh) == pytest.approx(40)


def test_a_solid_of_it() -> None:
    """Closed, its base below the deepest hollow."""
    built = build(terrain_of(site()), 0.01, base="below")
    check_solid(built, float(built.mesh.vertices[:, 2].min()))


def test_without_roughness_there_is_nothing_of_it() -> None:
    """Two triangles where the ground is level."""
    definition = site()
    definition["elemTree"]["children"] = []
    assert len(build(terrain_of(definition, roughness=False), 0.001).mesh.faces) == 2
    assert len(build(terrain_of(definition), 0.001).mesh.faces) > 1000


def test_a_budget_is_kept(tmp_path: Path) -> None:
    """The error grows until the relief takes no more faces."""
    report = exported(terrain_of(site()), tmp_path / "site.ply", max_faces=1000)
    assert report.faces <= 1000
    assert 0.005 < report.statement.allowed < 0.1


@pytest.mark.parametrize("error", [0.01, 0.003, 0.001])
def test_faces_are_foreseen(error: float) -> None:
    """By the area, the rms, the correlation and the error, as the default supposes."""
    definition = site()
    definition["elemTree"]["children"] = []
    faces = len(build(terrain_of(definition), error).mesh.faces)
    wanted = 2.0 * 40 * 0.02 * (1.016 / 0.3) ** 2 / error
    assert faces == pytest.approx(wanted, rel=0.25)


def test_the_default_error_knows_it() -> None:
    """Where the relief would take too many faces, the error is larger, and that is said."""
    definition = site(size=[80, 50])
    definition["elemTree"]["children"] = []
    assert MeshOptions().error_for(terrain_of(definition)) == (0.005, "the default")
    definition["surfTypes"]["gravel"] = {"roughness": {"rms": 0.02, "correlation": 0.05}}
    error, why = MeshOptions().error_for(terrain_of(definition))
    assert error == pytest.approx(2.0 * 4000 * 0.02 * (1.016 / 0.05) ** 2 / RELIEF_FACES, rel=1e-4)
    assert why == "so that the relief takes about 2,000,000 faces"
    assert MeshOptions(max_error=0.001).error_for(terrain_of(definition)) == (0.001, "as asked")
    assert MeshOptions().error_for(terrain_of(definition, roughness=False))[0] == 0.005
