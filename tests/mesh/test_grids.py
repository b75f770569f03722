"""Grids of heights in meshes: within the error everywhere, gaps where they are void."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terratool.field.bounds import largest_heights
from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.mesh.elevation import export_elevation_grid
from terratool.mesh.tiles import TileCount, faces_of, lay_out
from terratool.mesh.types import Mesh
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
    freed,
    random_definition,
)
from tests.oracle import Oracle

Json = dict[str, Any]

ERROR = 2e-2


def whole(rows: Any, size: Any = (7, 4), **more: Any) -> Json:
    """A grid of heights over all of a terrain."""
    primitive = {"grid": rows, **more}
    return {"size": list(size), "elemTypes": {"g": primitive}, "elemTree": {"type": "g"}}


def hills(columns: int, rows: int, rough: float = 2.0, seed: int = 0) -> np.ndarray:
    """Heights from 0 to 1 of fractal ground."""
    waves = np.fft.rfft2(np.random.default_rng(seed).normal(size=(rows, columns)))
    pace = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None])
    pace[0, 0] = np.inf
    found = np.fft.irfft2(waves * pace**-rough, s=(rows, columns))
    return np.asarray((found - found.min()) / np.ptp(found))


def spikes(columns: int, rows: int, count: int, seed: int = 0) -> np.ndarray:
    """Level ground with single numbers that stand out."""
    found = np.zeros((rows, columns))
    places = np.random.default_rng(seed).choice(found.size, count, replace=False)
    found.ravel()[places] = 1.0
    return found


def at_places(mesh: Mesh, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights of the ground at points, by the triangle that holds each; nan where none does."""
    found = np.full(x.shape, np.nan)
    for face in mesh.faces[~mesh.walls]:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = mesh.vertices[face] + mesh.origin
        twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        s = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / twice
        r = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / twice
        inside = (s >= -1e-9) & (r >= -1e-9) & (s + r <= 1 + 1e-9)
        found[inside] = (az + s * (bz - az) + r * (cz - az))[inside]
    return found


def check(terrain: Terrain, error: float, points: int = 4000, **options: Any) -> Mesh:
    """A sound mesh within the error."""
    built = build(terrain, error, **options)
    check_faces(built.mesh)
    check_closed(built.mesh, terrain)
    assert built.error <= error
    if (~built.mesh.walls).any():
        assert errors(built.mesh, terrain, points, error, aside=1e-7).max() <= error
    return built.mesh


def test_a_plane_is_two_triangles() -> None:
    """Neither lines nor twisted patches in it."""
    rows = [[4, 5, 6], [2, 3, 4], [0, 1, 2], [-2, -1, 0]]
    mesh = check(terrain_of(whole(rows)), 1e-6)
    assert len(mesh.faces) == 2
    top = mesh.vertices[mesh.vertices[:, 2].argmax()] + mesh.origin
    assert top == pytest.approx([7, 4, 6])


@pytest.mark.parametrize(("error", "more"), [(0.26, False), (0.24, True)])
def test_a_twisted_patch_misses_a_quarter_of_its_twist(error: float, more: bool) -> None:
    mesh = check(terrain_of(whole([[0, 1], [0, 0]])), error)
    assert (len(mesh.faces) > 2) == more


def test_vertices_stand_on_numbers() -> None:
    """A roof whose ridge is one of the lines is no more than its numbers."""
    rows = [[0, 1, 3, 2], [0, 1, 3, 2], [0, 1, 3, 2], [0, 1, 3, 2], [0, 1, 3, 2]]
    mesh = check(terrain_of(whole(rows, (6, 4))), 1e-6)
    assert set(mesh.vertices[:, 0].round(6)) <= {0, 2, 4, 6}
    assert len(mesh.faces) <= 2 * 3 * 4


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
@pytest.mark.parametrize("turn", [False, True])
def test_a_strip_has_chords(registration: str, turn: bool) -> None:
    """A grid of one row is as a curve: triangles as long as it is wide."""
    row = [math.sin(k / 30) for k in range(300)]
    rows = [[z] for z in row] if turn else [row]
    mesh = check(terrain_of(whole(rows, registration=registration)), 1e-3)
    assert len(mesh.faces) < 250


@pytest.mark.parametrize(
    ("registration", "gaps"),
    [
        # cells of 2 × 2 with a void corner; the pixel around the number
        ("gridline", [(2, 0, 6, 4)]),
        ("pixel", [(8 / 3, 2, 16 / 3, 4)]),
    ],
)
def test_gaps_are_where_the_grid_is_void(registration: str, gaps: list[Any]) -> None:
    """In the lower left 8 × 6 of numbers 2 apart the one in the middle of the third row is void."""
    rows = [[1, 1, 1], [1, None, 1], [1, 1, 1]]
    size = (8, 6)
    if registration == "gridline":
        rows = [[1, 1, 1, 1, 1], [1, 1, 1, 1, 1], [1, 1, None, 1, 1], [1, 1, 1, 1, 1]]
    mesh = check(terrain_of(whole(rows, size, registration=registration)), 1e-3)
    (west, south, east, north) = gaps[0]
    assert covered(mesh) == pytest.approx(48 - (east - west) * (north - south), abs=1e-6)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    for a, b in ((west, south), (west, north), (east, south), (east, north)):
        assert (np.hypot(x - a, y - b) < 1e-6).any()


def test_no_ground_in_a_gap_whatever_stands_there() -> None:
    definition = whole([[0, 0, 0], [0, 0, 0], [None, 0, 0]], (10, 10))
    definition["elemTypes"]["box"] = {"x": [1]}
    definition["elemTree"]["children"] = [
        {"type": "box", "cellX": 3, "cellY": 3, "span": [4, 4], "vScale": 2}
    ]
    mesh = check(terrain_of(definition), 1e-3)
    assert covered(mesh) == pytest.approx(75, abs=1e-6)
    top = mesh.faces[(mesh.vertices[mesh.faces, 2] == 2).all(axis=1) & ~mesh.walls]
    a, b, c = (mesh.vertices[top[:, k], :2] for k in range(3))
    u, v = b - a, c - a
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2 == pytest.approx(16 - 4, abs=1e-6)


def test_walls_at_the_rim() -> None:
    """Where a grid does not end at 0: from its height down to the ground."""
    definition = whole([[0]], (10, 10))
    definition["elemTypes"]["it"] = {"grid": [[0, 2], [0, 1]]}
    definition["elemTree"]["children"] = [
        {"type": "it", "cellX": 2, "cellY": 3, "span": [4, 2], "vScale": 1}
    ]
    built = build(terrain_of(definition), 1e-3)
    walls = built.mesh.faces[built.mesh.walls]
    a, b, c = (built.mesh.vertices[walls[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    # south, north, east; none in the west
    assert area == pytest.approx(4 * 1 / 2 + 4 * 2 / 2 + 2 * 1.5, rel=1e-6)


@st.composite
def gridded(draw: st.DrawFn) -> Json:
    """Terrains of grids of heights and all that has straight edges."""
    grids = {f"g{k}": draw(strategies.grids_of_heights()) for k in range(draw(st.integers(1, 4)))}
    seed = draw(st.integers(0, 1000))
    others = {**STRAIGHT, **CURVED} if draw(st.booleans()) else {"ramp": STRAIGHT["ramp"]}
    definition = random_definition(seed, draw(st.integers(2, 16)), {**others, **grids})
    definition["size"] = draw(st.sampled_from([10, [7, 4], [3, 17]]))
    if draw(st.booleans()):
        definition["elemTree"]["type"] = "g0"
    return freed(definition, seed) if draw(st.booleans()) else definition


@pytest.mark.nightly
@settings(max_examples=examples(100))
@given(gridded())
def test_any_grids(definition: Json) -> None:
    """Turned, nested, at free places, void: the heights that the oracle has."""
    terrain, oracle = terrain_of(definition), Oracle(definition)
    mesh = check(terrain, ERROR, 1000)
    west, south, east, north = terrain.bounds
    x, y = np.random.default_rng(0).uniform((west, south), (east, north), (20, 2)).T
    for p, q, z in zip(x.tolist(), y.tolist(), at_places(mesh, x, y).tolist(), strict=True):
        assert z == pytest.approx(oracle.at(p, q).z, abs=ERROR, nan_ok=True)


@pytest.mark.nightly
@settings(max_examples=examples(60))
@given(strategies.definitions(gridded=True, free=True, classed=True))
def test_any_definition(definition: Json) -> None:
    """Whatever else stands there, but for discs, and for cells too small to draw."""
    assume(not re.search(r"\d{4}", str(definition["elemTree"])))
    for primitive in definition["elemTypes"].values():
        if primitive.get("combine") == "radial":
            primitive["combine"] = "min"
    terrain = terrain_of(definition)
    error = max(0.03 * float(largest_heights(terrain.arrays).max()), 1e-3)
    built = build(terrain, error)
    check_faces(built.mesh)
    assert built.error <= error
    if (~built.mesh.walls).any():
        found = errors(built.mesh, terrain, 1000, error, aside=2e-8 * max(terrain.size))
        assert found.max() <= error * (1 + 1e-9)


@pytest.mark.nightly
@settings(max_examples=examples(30))
@given(gridded(), st.integers(0, 1000))
def test_parts_and_tiles_of_any_grids(definition: Json, seed: int) -> None:
    """A window is within the error of the whole terrain; tiles have the same seams."""
    terrain = terrain_of(definition)
    west, south, east, north = terrain.bounds
    x, y = np.sort(np.random.default_rng(seed).uniform((west, south), (east, north), (2, 2)).T)
    part = build(terrain, ERROR, (x[0], y[0], x[1], y[1])).mesh
    check_faces(part)
    if (~part.walls).any():
        assert errors(part, terrain, 1000, ERROR, aside=1e-7).max() <= ERROR
    layout = lay_out(terrain, ERROR, TileCount(rows=2, columns=3))
    tiles = tiles_of(terrain, layout)
    check_seams(layout, tiles)
    mesh = union(list(tiles.values()))
    check_faces(mesh)
    check_closed(mesh, terrain)
    assert covered(mesh) == pytest.approx(covered(build(terrain, ERROR).mesh), rel=1e-6)
    if (~mesh.walls).any():
        assert errors(mesh, terrain, 1000, ERROR, aside=1e-7).max() <= ERROR


@pytest.mark.nightly
@settings(max_examples=examples(30))
@given(gridded())
def test_any_solids(definition: Json) -> None:
    terrain = terrain_of(definition)
    built = build(terrain, ERROR, base=-100.0)
    if len(built.mesh.faces):
        check_solid(built, -100.0)


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
@pytest.mark.parametrize("turn", [0, 25])
def test_no_spike_is_missed(registration: str, turn: float) -> None:
    """Single numbers among many: each is met, wherever blocks of numbers end."""
    rows = spikes(150, 90, 40)
    definition = whole([[0]], (16, 10))
    definition["elemTypes"]["it"] = {"grid": rows.tolist(), "registration": registration}
    definition["elemTree"]["children"] = [
        {"type": "it", "at": [8, 5], "extent": [9, 6], "turnDeg": turn, "vScale": 1}
    ]
    mesh = check(terrain_of(definition), 0.05)
    assert (np.abs(mesh.vertices[:, 2] - 1) < 0.05).sum() >= 40


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("crease", [*range(1, 10), *range(14, 18), *range(30, 34)])
def test_no_crease_is_missed(crease: int, turned: bool) -> None:
    """Ground that begins to rise at a number, wherever blocks of numbers end."""
    rows = np.tile(np.maximum(np.arange(40) - crease, 0.0) / 10, (23, 1))
    terrain = terrain_of(whole((rows.T if turned else rows).tolist()))
    mesh = build(terrain, 0.01).mesh
    assert errors(mesh, terrain, 2000, 0.01).max() <= 0.01


def test_no_spike_is_missed_on_a_seam() -> None:
    """Edges on seams are divided for all numbers there, not for those that are looked at."""
    rows = np.zeros((40, 3000))
    rows[:, 1501::700] = 1.0
    terrain = terrain_of(whole(rows.tolist(), (30, 4)))
    layout = lay_out(terrain, 0.05, TileCount(rows=2, columns=1))
    tiles = tiles_of(terrain, layout)
    assert check_seams(layout, tiles) > 0
    assert errors(union(list(tiles.values())), terrain, 4000, 0.05).max() <= 0.05


@pytest.mark.slow
@pytest.mark.parametrize("rough", [0.0, 1.5, 3.0])
@pytest.mark.parametrize("error", [0.1, 0.01])
def test_many_numbers(rough: float, error: float) -> None:
    """Within the error at any point and all numbers; as many faces as tiles are laid out for."""
    rows = hills(120, 70, rough)
    terrain = terrain_of(whole(rows.tolist(), (12, 7)))
    mesh = check(terrain, error, 20_000)
    plan = lay_out(terrain, error, TileCount(rows=1, columns=1)).plan
    assert len(mesh.faces) / 2 < faces_of(plan) < 2 * len(mesh.faces) + 50


def test_what_is_left_out_has_no_gap() -> None:
    """Where elements are too faint to be kept, grids go as others do, but none with a gap."""
    definition = whole([[0]], (10, 10))
    rough = hills(20, 20, 0.0).tolist()
    gap = [[0, 0, 0], [0, 0, 0], [0, 0, None]]
    definition["elemTypes"] |= {"rough": {"grid": rough}, "gap": {"grid": gap}}
    definition["elemTree"]["children"] = [
        {"type": "rough", "cellX": 1, "cellY": 1, "vScale": 0.2},
        {"type": "gap", "cellX": 4, "cellY": 4, "span": [4, 4]},
    ]
    built = build(terrain_of(definition), 0.01, least=1.0)
    assert built.loss.faint == 1
    assert covered(built.mesh) == pytest.approx(96, abs=1e-6)


def test_an_elevation_grid_has_its_numbers(tmp_path: Path) -> None:
    rows = [[1.5, 2, 3.25], [4, 5, 6], [7, 8.5, 9], [10, 11, 12], [13, 14, 15.5]]
    terrain = terrain_of(whole(rows, (4, 8)))
    report = export_elevation_grid(terrain, tmp_path / "grid.wrl", 2.0)
    assert (report.columns, report.rows) == (3, 5)
    text = (tmp_path / "grid.wrl").read_text()
    found = [
        float(word) for word in text.split("height [")[1].split("]")[0].replace(",", " ").split()
    ]
    assert found == [z for row in rows for z in row]
    assert report.statement.miss.size == pytest.approx(0.125, abs=1e-3)  # a quarter of the twist
