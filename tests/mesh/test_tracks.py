"""Ruts in meshes: upright sides where tracks say, level floors below the ground, nothing torn."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.bounds import largest_depths
from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.mesh.formats.table import FORMATS
from terratool.mesh.loss import wall_summary
from terratool.mesh.tiles import TileCount, lay_out
from terratool.mesh.types import BuiltMesh, Mesh
from tests import strategies
from tests.budget import examples
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
    exported_tiles,
    flat_areas,
    random_definition,
)

Json = dict[str, Any]

SOILS: Json = {
    "sand": {"sinkage": 0.1, "color": [200, 180, 100]},
    "clay": {"sinkage": 0.03},
    "rock": {"sinkage": 0, "color": [90, 90, 90]},
    "worn": {"color": [80, 50, 20]},
    "hole": {"void": True},
}
PRIMITIVES: Json = {"floor": {"x": [0]}, "ramp": {"x": [0, 1]}, "block": {"x": [1]}}


def ground(*tracks: Json, children: tuple[Json, ...] = (), **root: Any) -> Json:
    """Level sand of 10 × 6, whose origin is not 0, with tracks in it."""
    tree = {"type": "floor", "surface": "sand", "cells": [10, 6], "children": [*children], **root}
    return {
        "size": [10, 6], "origin": [100, 50], "surfTypes": SOILS, "elemTypes": PRIMITIVES,
        "elemTree": tree, "tracks": [*tracks],
    }  # fmt: skip


def track(*path: tuple[float, float], **more: Any) -> Json:
    """A track of 0.4 whose path is relative to the corner of the ground."""
    return {"path": [[100 + x, 50 + y] for x, y in path], "width": 0.4, "depth": 0.1} | more


def level(mesh: Mesh, z: float) -> np.ndarray:
    """Faces of the ground at a height."""
    found: np.ndarray = ~mesh.walls & (np.abs(mesh.vertices[mesh.faces, 2] - z) < 1e-9).all(axis=1)
    return found


def area(mesh: Mesh, faces: np.ndarray) -> float:
    return float(flat_areas(mesh)[faces].sum() / 2)


def distances(path: Any, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """From points to a polyline."""
    out = np.full(x.shape, np.inf)
    points = np.array(path, float)
    for a, d in zip(points[:-1], np.diff(points, axis=0), strict=True):
        square = max(float(d @ d), 1e-300)
        s = np.clip(((x - a[0]) * d[0] + (y - a[1]) * d[1]) / square, 0, 1)
        out = np.minimum(out, np.hypot(x - a[0] - s * d[0], y - a[1] - s * d[1]))
    return out


def beside_ruts(definition: Json, aside: float) -> Callable[..., np.ndarray]:
    """Which points are as near to the side of a rut as that may be off."""

    def near(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        out = np.zeros(x.shape, bool)
        for one in definition["tracks"]:
            out |= np.abs(distances(one["path"], x, y) - one["width"] / 2) < aside
        return out

    return near


def check(definition: Json, error: float, points: int = 4000) -> BuiltMesh:
    """A mesh of it, sound, closed, and as high as the terrain away from the sides of ruts."""
    terrain = terrain_of(definition)
    built = build(terrain, error)
    check_mesh(built.mesh, definition, terrain, error, built.loss.ruts.wall_offset, points)
    return built


def check_mesh(
    mesh: Mesh, definition: Json, terrain: Terrain, error: float, beside: float, points: int
) -> None:
    check_faces(mesh)
    check_closed(mesh, terrain)
    scale = 1e-7 * max(terrain.size) / 10
    excluded = beside_ruts(definition, beside + scale)
    assert errors(mesh, terrain, points, error, scale, excluded).max() <= error * (1 + 1e-9)


# --- one rut ---------------------------------------------------------------------------------


def test_a_straight_rut_by_hand() -> None:
    """Its sides are as long as its path and as high as it is deep, its ends half polygons."""
    built = check(ground(track((2, 1), (7, 1), depth=0.25)), 1e-3)
    mesh = built.mesh
    walls = mesh.vertices[np.unique(mesh.faces[mesh.walls])]
    assert set(np.round(np.unique(walls[:, 2]), 12)) == {-0.25, 0.0}
    straight = walls[(walls[:, 0] > 1.9999999) & (walls[:, 0] < 7.0000001)]
    assert np.abs(np.abs(straight[:, 1] - 1) - 0.2).max() < 1e-8
    assert abs(walls[:, 0].min() - 1.8) < 1e-8 and abs(walls[:, 0].max() - 7.2) < 1e-8
    # a polygon of n chords has 2 n r sin(π / n) around it, and n/2 r² sin(2π / n) in it
    assert built.loss.ruts.wall_offset <= 1e-3 / 2
    corners = math.pi / math.acos(1 - built.loss.ruts.wall_offset / 0.2)
    assert corners == pytest.approx(round(corners)) and round(corners) % 4 == 0
    around = 10 + 2 * corners * 0.2 * math.sin(math.pi / corners)
    inside = 5 * 0.4 + corners / 2 * 0.04 * math.sin(2 * math.pi / corners)
    found = wall_summary(mesh)
    assert found.length == pytest.approx(around, rel=1e-7)
    assert found.area == pytest.approx(0.25 * around, rel=1e-7)
    assert found.highest and found.highest.size == pytest.approx(0.25)
    assert area(mesh, level(mesh, -0.25)) == pytest.approx(inside, rel=1e-7)
    assert area(mesh, level(mesh, 0)) == pytest.approx(60 - inside, rel=1e-7)


def test_a_slanting_rut_is_as_wide() -> None:
    path = (1.3, 0.7), (6.1, 4.9)
    mesh = check(ground(track(*path)), 1e-3).mesh
    x, y = mesh.vertices[np.unique(mesh.faces[mesh.walls]), :2].T
    along = ((x - 1.3) * 4.8 + (y - 0.7) * 4.2) / math.hypot(4.8, 4.2)
    beside = (along > -1e-8) & (along < math.hypot(4.8, 4.2) + 1e-8)
    across = ((x - 1.3) * 4.2 - (y - 0.7) * 4.8) / math.hypot(4.8, 4.2)
    assert beside.sum() == 8
    assert np.abs(np.abs(across[beside]) - 0.2).max() < 2e-8


def test_what_lies_east_is_not_west() -> None:
    """A hook in the south-east of an oblong terrain, asked where it is and where it is not."""
    mesh = check(ground(track((7, 1), (9, 1), (9, 3), depth=0.5)), 1e-3).mesh
    low = mesh.vertices[mesh.vertices[:, 2] < -0.4]
    assert np.abs(low.min(axis=0) - (6.8, 0.8, -0.5)).max() < 1e-8
    assert np.abs(low.max(axis=0) - (9.2, 3.2, -0.5)).max() < 1e-8
    middles = mesh.vertices[mesh.faces[level(mesh, -0.5)]].mean(axis=1)
    assert (distances([[7, 1], [9, 1], [9, 3]], *middles[:, :2].T) < 0.2).all()
    assert not ((middles[:, 0] < 8.7) & (middles[:, 1] > 1.3)).any()


def test_walls_of_a_rut_face_into_it() -> None:
    mesh = check(ground(track((2, 2), (7, 2))), 1e-3).mesh
    a, b, c = (mesh.vertices[mesh.faces[mesh.walls, k]] for k in range(3))
    normals, middles = np.cross(b - a, c - a), (a + b + c) / 3
    nearest = np.column_stack([np.clip(middles[:, 0], 2, 7), np.full(len(a), 2.0)])
    assert ((normals[:, :2] * (nearest - middles[:, :2])).sum(axis=1) > 0).all()


def test_joins_are_round() -> None:
    """Beyond a bend the rut is an arc about it, and not a mitre."""
    mesh = check(ground(track((2, 1), (6, 1), (6, 5))), 1e-3).mesh
    low = mesh.vertices[mesh.vertices[:, 2] < -0.05, :2]
    corner = low[(low[:, 0] > 6) & (low[:, 1] < 1)]
    assert len(corner) > 2
    assert np.abs(np.hypot(corner[:, 0] - 6, corner[:, 1] - 1) - 0.2).max() < 1e-8


@pytest.mark.nightly
def test_a_fine_path_has_few_edges() -> None:
    """A bend of a thousand pieces is as coarse as the error allows, and as near as it says."""
    turn = np.linspace(0, math.pi, 1000)
    path = np.round(np.column_stack([5 + 3 * np.cos(turn), 1 + 3 * np.sin(turn)]), 9)
    definition = ground(track(*path.tolist()))
    coarse, fine = (check(definition, error) for error in (1e-2, 1e-4))
    assert len(coarse.mesh.faces) < 400 < len(fine.mesh.faces)
    for built, error in ((coarse, 1e-2), (fine, 1e-4)):
        assert 0 < built.loss.ruts.wall_offset <= error
        walls = built.mesh.vertices[np.unique(built.mesh.faces[built.mesh.walls])] + (100, 50, 0)
        off = np.abs(distances(definition["tracks"][0]["path"], walls[:, 0], walls[:, 1]) - 0.2)
        assert off.max() <= built.loss.ruts.wall_offset


# --- several, and the ground below -----------------------------------------------------------


def test_passes_add_up_where_tracks_cross() -> None:
    """z₁ n^(1/a) with the largest z₁ and all passes; each track alone beside the crossing."""
    one = track((1, 3), (9, 3), depth=0.1, passes=2, multipass=2)
    two = track((5, 1), (5, 5), depth=0.2, passes=7, multipass=4)
    mesh = check(ground(one, two), 1e-3).mesh
    depths = [0.1 * 2**0.5, 0.2 * 7**0.25, 0.2 * 9**0.25]
    assert area(mesh, level(mesh, -depths[2])) == pytest.approx(0.16, rel=1e-6)
    faces = [level(mesh, -depth) for depth in (0, *depths)]
    assert sum(map(np.count_nonzero, faces)) == (~mesh.walls).sum()
    assert area(mesh, faces[1]) == pytest.approx(8 * 0.4 + 0.04 * math.pi - 0.16, rel=3e-3)


def test_a_wall_across_where_the_ground_changes() -> None:
    """The patch is as high as the sand around, so it has walls in the rut alone."""
    patch = {"type": "floor", "surface": "clay", "cellX": 4, "cellY": 2, "span": [3, 3]}
    built = check(ground(track((1, 3), (9, 3), load=2, depth={}), children=(patch,)), 1e-3)
    mesh = built.mesh
    x, y, z = (mesh.vertices[mesh.faces[mesh.walls], k] for k in range(3))
    for at in (4, 7):
        across = (np.abs(x - at) < 1e-8).all(axis=1) & (np.abs(y - 3) < 0.2001).all(axis=1)
        assert across.sum() >= 2
        assert z[across].min() == pytest.approx(-0.2) and z[across].max() == pytest.approx(-0.06)
        assert y[across].min() == pytest.approx(2.8) and y[across].max() == pytest.approx(3.2)
    assert area(mesh, level(mesh, -0.06)) == pytest.approx(3 * 0.4, rel=1e-6)


def test_no_rut_in_what_is_rigid() -> None:
    """Nor an edge, if it has no surface of its own and sinks nowhere."""
    rigid = ground(track((1, 3), (9, 3), depth=0), surface="rock")
    assert len(check(rigid, 1e-3).mesh.faces) == 2
    half = {"type": "floor", "surface": "rock", "cellX": 0, "cellY": 0, "span": [5, 6]}
    mesh = check(ground(track((1, 3), (9, 3), load=1, depth={}), children=(half,)), 1e-3).mesh
    x = mesh.vertices[mesh.faces[mesh.walls], 0]
    assert x.min() == pytest.approx(5) and x.max() == pytest.approx(9.2)


def test_a_track_is_as_deep_as_what_is_worn_lets_it() -> None:
    """Soft sand that only stands in the dictionary says nothing; under a track it does."""
    tracks = track((1, 3), (9, 3), load=2, depth={}), track((1, 5), (9, 5), load=1, depth={})
    clay = terrain_of(ground(*tracks, surface="clay"))
    assert largest_depths(clay.arrays) == pytest.approx([2 * 0.03, 0.03])
    sanded = terrain_of(ground(*tracks, track((1, 1), (9, 1), surface="sand"), surface="clay"))
    assert largest_depths(sanded.arrays) == pytest.approx([2 * 0.1, 0.1, 0.1])


def test_a_track_across_the_void() -> None:
    """There is no ground to press, and the hole is no deeper, nor its rim."""
    hole = {"type": "floor", "surface": "hole", "cellX": 4, "cellY": 2, "span": [2, 2]}
    definition = ground(track((1, 3), (9, 3), surface="worn"), children=(hole,))
    mesh = check(definition, 1e-3).mesh
    assert covered(mesh) == pytest.approx(56, rel=1e-9)
    assert area(mesh, level(mesh, -0.1)) == pytest.approx(6 * 0.4 + 0.04 * math.pi, rel=3e-3)
    check_solid(build(terrain_of(definition), 1e-3, base=-1.0), -1.0)


def test_the_surface_of_a_track_is_on_its_floor() -> None:
    """The latest track with a surface wins; walls keep that of the ground above."""
    one = track((1, 3), (9, 3), surface="worn")
    two = track((3, 1), (3, 5), surface="clay")
    three = track((6, 1), (6, 5))
    mesh = check(ground(one, two, three), 1e-3).mesh
    names = dict(enumerate(mesh.names))
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    x, y = middles[:, :2].T
    floors = ~mesh.walls & (middles[:, 2] < -0.01)
    clay, worn = distances([[3, 1], [3, 5]], x, y), distances([[1, 3], [9, 3]], x, y)
    wanted = np.where(clay < 0.2, "clay", np.where(worn < 0.2, "worn", "sand"))
    found = np.array([names[n] for n in mesh.surfaces.tolist()])
    assert (found[floors] == wanted[floors]).all()
    assert set(wanted[floors]) == {"clay", "worn", "sand"}
    outer = mesh.walls & (clay > 0.19) & (worn > 0.19) & (middles[:, 2] > -0.1)
    assert outer.any() and (found[outer] == "sand").all()
    assert mesh.colors[mesh.names.index("worn")].tolist() == [80, 50, 20]


def test_a_rut_of_no_depth_may_have_a_surface() -> None:
    mesh = check(ground(track((2, 3), (7, 3), depth=0, surface="worn")), 1e-3).mesh
    assert not mesh.walls.any()
    worn = mesh.surfaces == mesh.names.index("worn")
    assert area(mesh, worn) == pytest.approx(5 * 0.4 + 0.04 * math.pi, rel=3e-3)


# --- hard cases ------------------------------------------------------------------------------

STEPS = np.linspace(0, 8 * math.pi, 240)
SPIRAL = np.column_stack([5 + STEPS / 9 * np.cos(STEPS), 3 + STEPS / 9 * np.sin(STEPS)]).tolist()
NOISE = np.random.default_rng(0).normal(0, 1, (len(SPIRAL), 2))
HARD: dict[str, Json] = {
    "the same path twice": ground(track((1, 1), (9, 5)), track((9, 5), (1, 1))),
    "there and back": ground(track((1, 1), (9, 5), (1, 1), (9, 5))),
    "along the rim of the terrain": ground(track((0, 0), (10, 0), (10, 6)), track((0, 6), (3, 6))),
    "out of the terrain": ground(track((-3, 2), (14, 5), (14, 9)), track((4, -1), (5, 7))),
    "wider than the terrain": ground(track((1, 1), (3, 2), width=40), track((8, 3), (9, 3))),
    "a spiral over itself": ground(track(*SPIRAL, width=1.7)),
    "a dot": ground(track((4, 2), (4.000001, 2)), track((8, 4), (8.1, 4.1), width=2)),
    "edges that touch": ground(track((1, 2), (9, 2)), track((1, 2.4), (9, 2.4))),
    "sides on the edges of cells": ground(
        track((1, 2.2), (9, 2.2)), children=({"type": "block", "cellX": 3, "cellY": 2},)
    ),
    **{
        f"wheels behind each other, {off:g} apart": ground(
            track(*SPIRAL), track(*(np.array(SPIRAL) + off * NOISE).tolist())
        )
        for off in (1e-9, 1e-8, 1e-7, 1e-5, 1e-3)
    },
}


@pytest.mark.parametrize("name", HARD)
def test_hard_cases(name: str) -> None:
    definition = HARD[name]
    check(definition, 1e-3)
    check_solid(build(terrain_of(definition), 1e-3, base=-2.0), -2.0)


def rutted(seed: int, error: float) -> Json:
    """Elements of all kinds but discs, and tracks over them."""
    primitives = STRAIGHT if error < 0.01 else {**STRAIGHT, **CURVED}
    definition = random_definition(seed, 15, primitives)
    rng = np.random.default_rng(seed)
    definition["size"] = [20, 5] if seed % 2 else [7, 11]
    tracks = []
    for _ in range(4):
        path = rng.uniform(-0.1, 1.1, (5, 2)) * definition["size"]
        tracks.append({"path": path.tolist(), "width": float(rng.uniform(0.1, 1)),
                       "depth": float(rng.uniform(0, 0.4))})  # fmt: skip
    tracks[1]["surface"] = "rock"
    tracks[2]["depth"] = {"grass": 0.2, "rock": 0.05}
    return {**definition, "tracks": tracks}


@pytest.mark.parametrize("seed", range(4))
def test_tiles_fit(seed: int) -> None:
    """Ruts pass a seam at the same vertices on both of its sides."""
    error = (1e-3, 2e-2)[seed % 2]
    definition = rutted(seed, error)
    terrain = terrain_of(definition)
    layout = lay_out(terrain, error, TileCount(rows=2, columns=3))
    tiles = tiles_of(terrain, layout)
    assert check_seams(layout, tiles) > 0
    mesh = union(list(tiles.values()))
    whole = check(definition, error)
    check_mesh(mesh, definition, terrain, error, layout.loss.ruts.wall_offset, 4000)
    assert layout.loss.ruts == whole.loss.ruts
    assert covered(mesh) == pytest.approx(covered(whole.mesh), rel=1e-6)


def test_more_faces_more_tiles() -> None:
    """Ruts count where tiles are to have so many faces."""
    wide = [track((1, y), *((x / 10, y + x % 2 / 10) for x in range(20, 80)), (9, y)) for y in
            (1, 2, 3, 4)]  # fmt: skip
    terrain = terrain_of(ground(*wide))
    rows, columns = lay_out(terrain, 1e-3, TileCount(faces=500)).shape
    faces = len(build(terrain, 1e-3).mesh.faces)
    assert faces / 1000 < rows * columns < faces / 125


@pytest.mark.parametrize("bounds", [(103, 51, 106, 54), (101, 52.9, 102, 53.05)])
def test_a_part(bounds: tuple[float, float, float, float]) -> None:
    """What lies in it is as in the whole; ruts end at its border, open."""
    definition = ground(track((1, 3), (9, 3)), track((4, 0), (5, 6), width=0.7))
    terrain = terrain_of(definition)
    built = build(terrain, 1e-3, bounds)
    mesh = built.mesh
    check_faces(mesh)
    west, south, east, north = bounds
    assert covered(mesh) == pytest.approx((east - west) * (north - south), rel=1e-6)
    excluded = beside_ruts(definition, built.loss.ruts.wall_offset + 1e-7)
    assert errors(mesh, terrain, 2000, 1e-9, 1e-7, excluded).max() < 1e-9
    assert (mesh.vertices[:, 2] < -0.05).any()
    check_solid(build(terrain, 1e-3, bounds, base=-1.0), -1.0)


def test_a_part_in_the_crook_of_a_track() -> None:
    """No piece of it comes near, though its box holds the part."""
    terrain = terrain_of(ground(track((1, 1), (9, 1), (9, 5))))
    assert len(build(terrain, 1e-3, (102, 53, 104, 55)).mesh.faces) == 2


@settings(max_examples=examples(30))
@given(st.data())
def test_any_tracks(data: st.DataObject) -> None:
    """Wherever they lie, and however wide, deep and often they are, over all that has straight
    edges: a sound mesh, with the heights that are asked for."""
    seed = data.draw(st.integers(0, 5))
    definition = random_definition(seed, 12, STRAIGHT)
    definition["size"] = data.draw(st.sampled_from([10, [3, 17], [40, 0.5]]))
    tracks = st.lists(strategies.tracks(definition), min_size=1, max_size=4)
    definition["tracks"] = data.draw(tracks)
    # what is too narrow is left out, and told elsewhere
    definition["tracks"] = [one for one in definition["tracks"] if one["width"] > 1e-4]
    depth = max((d for one in definition["tracks"] for d in depths_of(one)), default=0)
    check(definition, 1e-3 * max(1, depth), 1000)


def depths_of(one: Json) -> list[float]:
    depth = one.get("depth", {})
    return list(depth.values()) if isinstance(depth, dict) else [depth]


# --- what is lost ----------------------------------------------------------------------------


def test_the_statement_says_how_far_sides_are_off(tmp_path: Path) -> None:
    terrain = terrain_of(ground(track((2, 3), (7, 3))))
    report = exported(terrain, tmp_path / "a.ply", 0.01)
    ruts = report.statement.ruts
    assert ruts and 0 < ruts.wall_offset <= 0.01
    assert report.to_json()["losses"]["ruts"] == {
        "beside": ruts.wall_offset, "narrow": 0, "shallow": 0, "deepest": 0.0,
    }  # fmt: skip
    said = list(report.statement.sentences())
    assert said[-1] == f"Lost: sides of ruts lie up to {ruts.wall_offset:.3g} m aside."
    plain = exported(terrain_of(ground()), tmp_path / "b.ply", 0.01)
    assert "ruts" not in plain.to_json()["losses"]


def test_what_is_too_narrow_is_left_out_and_said(tmp_path: Path) -> None:
    """The other one stays; what the narrow ones change is measured along them."""
    narrow = [track((1, y), (9, y), width=1e-6, depth=0.3) for y in (1, 2)]
    terrain = terrain_of(ground(*narrow, track((1, 5), (9, 5))))
    report = exported(terrain, tmp_path / "a.ply", 0.01)
    statement = report.statement
    assert statement.ruts and statement.ruts.narrow == 2
    assert statement.left.change and statement.left.change.size == pytest.approx(0.3)
    assert statement.walls.highest and statement.walls.highest.size == pytest.approx(0.1)
    assert "2 tracks too narrow for the mesh left out" in " ".join(statement.sentences())
    part = exported(terrain, tmp_path / "b.ply", 0.01, bounds=(104, 50.9999, 104.0002, 51.0001))
    assert part.statement.ruts and part.statement.ruts.narrow == 0
    assert part.statement.walls.highest and part.statement.walls.highest.size == pytest.approx(0.3)


def test_shallow_ruts_go_first_to_keep_to_a_number_of_faces(tmp_path: Path) -> None:
    shallow = [track((1 + x, 0.5), (1 + x, 5.5), width=0.2, depth=0.01 * (1 + x % 2)) for x in
               range(8)]  # fmt: skip
    deep = track((0.5, 3), (9.5, 3.1), depth=0.5)
    terrain = terrain_of(ground(*shallow[:4], deep, *shallow[4:], children=(
        {"type": "block", "cellX": 0, "cellY": 0, "vScale": 0.9},)))  # fmt: skip
    report = exported(terrain, tmp_path / "a.ply", 1e-3, 250)
    ruts = report.statement.ruts
    assert report.faces <= 250 and ruts and ruts.shallow == 8
    assert ruts.deepest == pytest.approx(0.02)
    # where they cross the deep one, that is a second pass less
    change = report.statement.left.change
    assert change and change.size == pytest.approx(0.5 * 2 ** (1 / 3) - 0.5)
    assert "8 tracks left out to keep to 250 faces" in " ".join(report.statement.sentences())
    assert report.statement.walls.highest and report.statement.walls.highest.size > 0.5


def test_tiles_say_it_too(tmp_path: Path) -> None:
    terrain = terrain_of(ground(track((2, 3), (7, 3)), track((1, 1), (9, 1), width=1e-6)))
    report = exported_tiles(terrain, tmp_path / "tiles", ".ply", 0.01, rows=2, columns=2)
    ruts = report.statement.ruts
    assert ruts and ruts.narrow == 1 and 0 < ruts.wall_offset <= 0.01
    assert report.to_json()["losses"]["ruts"]["narrow"] == 1


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_files_hold_the_rut(tmp_path: Path, suffix: str) -> None:
    """As trimesh reads them: its depth, its place, its faces."""
    import trimesh

    assert suffix in FORMATS
    terrain = terrain_of(ground(track((7, 1), (9, 1), depth=0.5)))
    path = tmp_path / f"a{suffix}"
    report = exported(terrain, path, 1e-3, solid=True, base=-1.0)
    shape = trimesh.load_mesh(path, process=suffix == ".stl")
    assert len(shape.faces) == report.faces
    inside = 2 * 0.4 + 0.04 * math.pi
    assert shape.volume == pytest.approx(60 - 0.5 * inside, rel=1e-4)
    low = shape.vertices[np.abs(shape.vertices[:, 2] + 0.5) < 1e-6]
    assert np.abs(low.min(axis=0) - (6.8, 0.8, -0.5)).max() < 1e-6


def test_the_same_bytes_every_time(tmp_path: Path) -> None:
    definition = rutted(1, 2e-2)
    for name in ("a.ply", "b.ply"):
        exported(terrain_of(json.loads(json.dumps(definition))), tmp_path / name, 0.02)
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
