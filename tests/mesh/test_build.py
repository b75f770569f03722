"""Meshes: exact walls, no cracks, no degenerate faces, within the error."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh import build as building
from terratool.mesh.build import build
from terratool.mesh.plan import plan_of
from terratool.mesh.types import Mesh
from tests.conftest import terrain_of
from tests.meshes import (
    CURVED,
    ROUND,
    STRAIGHT,
    beside_arcs,
    check_closed,
    check_faces,
    covered,
    errors,
    flat_areas,
    freed,
    random_definition,
)


def meshed(terrain: Terrain, max_error: float, **options: Any) -> Mesh:
    return build(terrain, max_error, **options).mesh


def one(primitive: Any, **element: Any) -> dict[str, Any]:
    """A flat terrain of 10 × 10 with one element, in the cell from (2, 3) to (3, 4)."""
    return {
        "size": 10,
        "elemTypes": {"floor": {"x": [0]}, "it": primitive},
        "elemTree": {
            "type": "floor",
            "children": [{"type": "it", "cellX": 2, "cellY": 3, "vScale": 1, **element}],
        },
    }


def counted(mesh: Any) -> tuple[int, int]:
    return int((~mesh.walls).sum()), int(mesh.walls.sum())


class TestSingle:
    def test_a_flat_terrain_is_two_triangles(self) -> None:
        mesh = meshed(
            terrain_of({"size": [4, 3], "elemTypes": {"f": {"x": [0]}}, "elemTree": {"type": "f"}}),
            0.1,
        )
        assert counted(mesh) == (2, 0)
        assert covered(mesh) == 12

    def test_a_box_has_two_triangles_on_top_and_two_on_each_side(self) -> None:
        terrain = terrain_of(one({"x": [1]}))
        mesh = meshed(terrain, 0.1)
        check_faces(mesh)
        check_closed(mesh, terrain)
        assert counted(mesh) == (2 + 8, 8)
        top = mesh.vertices[mesh.vertices[:, 2] == 1]
        assert np.abs(top.min(axis=0) - (2, 3, 1)).max() < 1e-8
        assert np.abs(top.max(axis=0) - (3, 4, 1)).max() < 1e-8

    def test_walls_face_the_lower_side(self) -> None:
        for scale in (1, -1):
            mesh = meshed(terrain_of(one({"x": [1]}, vScale=scale)), 0.1)
            a, b, c = (mesh.vertices[mesh.faces[mesh.walls, k]] for k in range(3))
            normals = np.cross(b - a, c - a)
            outward = ((a + b + c) / 3 - (2.5, 3.5, 0))[:, :2]
            assert (np.sign((normals[:, :2] * outward).sum(axis=1)) == scale).all()

    def test_walls_take_the_surface_of_the_higher_side(self) -> None:
        definition = one({"x": [1]}, surface="rock")
        definition["surfTypes"] = {"grass": {}, "rock": {"color": [1, 2, 3]}}
        definition["elemTree"]["surface"] = "grass"
        for scale, name in ((1, "rock"), (-1, "grass")):
            definition["elemTree"]["children"][0]["vScale"] = scale
            mesh = meshed(terrain_of(definition), 0.1)
            assert {mesh.names[s] for s in mesh.surfaces[mesh.walls]} == {name}
            assert mesh.colors[1].tolist() == [1, 2, 3]

    def test_a_ramp_has_walls_on_three_sides_and_none_where_it_begins(self) -> None:
        terrain = terrain_of(one({"x": [0, 1]}))
        mesh = meshed(terrain, 1e-6)
        check_faces(mesh)
        check_closed(mesh, terrain)
        assert counted(mesh) == (10, 4)

    def test_stairs_have_their_risers_where_they_are(self) -> None:
        terrain = terrain_of(one({"x": [[0, 1], [0.5, 1], [0.5, 2], [1, 2]]}))
        mesh = meshed(terrain, 1e-6)
        check_faces(mesh)
        check_closed(mesh, terrain)
        steps = mesh.vertices[np.isin(mesh.vertices[:, 2], (1, 2))]
        assert set(np.round(steps[:, 0], 7)) == {2, 2.5, 3}
        assert errors(mesh, terrain, 1000, 1e-6).max() < 1e-6

    def test_void_leaves_a_gap(self) -> None:
        definition = one({"x": [1]}, surface="hole")
        definition["surfTypes"] = {"hole": {"void": True}}
        mesh = meshed(terrain_of(definition), 0.1)
        assert counted(mesh) == (8, 0)
        assert abs(covered(mesh) - 99) < 1e-6

    def test_bounds_cut_elements(self) -> None:
        terrain = terrain_of(one({"x": [1]}))
        mesh = meshed(terrain, 0.1, bounds=(2.5, 0, 20, 3.5))
        check_faces(mesh)
        assert mesh.origin.tolist() == [2.5, 0, 0]
        assert covered(mesh) == pytest.approx(7.5 * 3.5, rel=1e-8)
        areas = flat_areas(mesh)[~mesh.walls]
        high = (mesh.vertices[mesh.faces[~mesh.walls], 2] == 1).all(axis=1)
        assert areas[high].sum() / 2 == pytest.approx(0.25, rel=1e-8)

    @pytest.mark.parametrize("bounds", [(20, 0, 30, 10), (0, 0, 0, 10)])
    def test_bounds_that_hold_nothing_are_refused(self, bounds: Any) -> None:
        with pytest.raises(ValueError, match="hold nothing"):
            meshed(terrain_of(one({"x": [1]})), 0.1, bounds=bounds)


@pytest.mark.parametrize("name", STRAIGHT)
@pytest.mark.parametrize("turn", [0, 30, 90, 225])
def test_straight_primitives_are_exact(name: str, turn: int) -> None:
    """Creases, steps and footprints fall on edges."""
    terrain = terrain_of(one(STRAIGHT[name], turnDeg=turn))
    mesh = meshed(terrain, 1e-7)
    check_faces(mesh)
    check_closed(mesh, terrain)
    assert abs(covered(mesh) - 100) < 1e-6
    assert errors(mesh, terrain, 5000, 2e-7).max() < 2e-7


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_random_straight_terrains(seed: int, free: bool) -> None:
    """Everything straight, void included, stands exactly where it should."""
    definition = random_definition(seed, 60, STRAIGHT)
    terrain = terrain_of(freed(definition, seed) if free else definition)
    mesh = meshed(terrain, 1e-3)
    check_faces(mesh)
    check_closed(mesh, terrain)
    assert errors(mesh, terrain, 30000, 1e-3, aside=1e-7).max() < 1e-3


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_random_curved_terrains(seed: int, free: bool) -> None:
    """Formulas and products of bent curves are refined."""
    definition = random_definition(seed, 40, {**STRAIGHT, **CURVED})
    terrain = terrain_of(freed(definition, seed) if free else definition)
    mesh = meshed(terrain, 2e-2)
    check_faces(mesh)
    check_closed(mesh, terrain)
    assert errors(mesh, terrain, 30000, 2e-2, aside=1e-7).max() < 2e-2


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_random_round_terrains(seed: int, free: bool) -> None:
    """Discs are polygons: as far inside of an arc as is said heights may be others."""
    primitives = {**STRAIGHT, **CURVED, **ROUND}
    definition = random_definition(seed, 40, primitives, ("grass", "rock"))
    definition = freed(definition, seed) if free else definition
    terrain = terrain_of(definition)
    built = build(terrain, 2e-2)
    check_faces(built.mesh)
    check_closed(built.mesh, terrain)
    assert built.error <= 2e-2
    assert built.loss.wall_offset <= 2.1e-2
    excluded = partial(beside_arcs, definition, aside=built.loss.wall_offset)
    found = errors(built.mesh, terrain, 30000, 2e-2, aside=1e-7, excluded=excluded)
    assert len(found) > 20000
    assert found.max() < 2e-2


@pytest.mark.nightly
@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4, 1e-6])
def test_a_steep_place_within_a_disc(width: float) -> None:
    """It is as far off as is said, or sideways by no more than is said."""
    ramp = {"x": [[0, 0], [0.72, 0], [0.72 + width, 1], [1, 1]], "combine": "radial"}
    definition = {
        "size": [10, 17],
        "elemTypes": {"floor": {"x": [0]}, "ramp": ramp},
        "elemTree": {
            "type": "floor", "cells": [1, 1],
            "children": [{"type": "ramp", "cellX": 0, "cellY": 0, "vScale": 1}],
        },
    }  # fmt: skip
    terrain = terrain_of(definition)
    built = build(terrain, 2e-2)
    excluded = partial(beside_arcs, definition, aside=built.loss.wall_offset)
    found = errors(built.mesh, terrain, 30000, built.error, aside=1e-7, excluded=excluded)
    assert found.max() < built.error + 1e-6
    if width > 1e-4:
        assert built.error <= 2e-2


@pytest.mark.parametrize("max_error", [0.003, 0.001, 0.0002])
def test_long_sides_with_a_vertical_tangent_take_few_faces(max_error: float) -> None:
    """The chords of half a circle are as many as 1 / √error, however long the half-pipe is.

    Beside its sides the lattice is too coarse for chords: there the stated error is larger.
    """
    terrain = terrain_of(
        {
            "size": [60, 20],
            "elemTypes": {"floor": {"x": [1]}, "pipe": {"x": "flat", "y": "dome"}},
            "elemTree": {
                "type": "floor",
                "children": [{"type": "pipe", "at": [30, 15], "extent": [60, 6], "vScale": 4}],
            },
        }
    )
    built = build(terrain, max_error)
    assert len(built.mesh.faces) < 30 / max_error**0.5

    def beside_sides(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.minimum(np.abs(y - 12), np.abs(y - 18)) < 1e-6

    off = errors(built.mesh, terrain, 2000, max_error, excluded=beside_sides)
    assert off.max() <= max_error
    assert errors(built.mesh, terrain, 2000, max_error).max() <= built.error


def test_discs_that_overlap_keep_to_the_error() -> None:
    definition = {
        "size": [12, 10],
        "elemTypes": {
            "floor": {"x": [0]}, "cone": {"x": "min(2*t, 1, 3 - 3*t)", "combine": "radial"},
        },
        "elemTree": {
            "type": "floor", "cells": [30, 20],
            "children": [
                {"type": "cone", "cellX": i, "cellY": i, "span": [18, 11],
                 "vScale": 0.6 + 0.2 * i, "turnDeg": 10 * i}
                for i in range(6)
            ],
        },
    }  # fmt: skip
    terrain = terrain_of(definition)
    built = build(terrain, 0.05)
    assert built.error <= 0.05
    excluded = partial(beside_arcs, definition, aside=built.loss.wall_offset)
    assert errors(built.mesh, terrain, 30000, 0.05, 1e-7, excluded).max() < 0.05


@pytest.mark.parametrize("seed", range(6))
def test_void_discs(seed: int) -> None:
    terrain = terrain_of(random_definition(seed, 40, {**STRAIGHT, **ROUND}))
    check_faces(meshed(terrain, 2e-2))


def test_a_block_in_a_grid_finer_than_doubles() -> None:
    """The place in its parent's cell says which of its elements are where."""
    block = {"type": "box", "cellX": 15000, "cellY": 6000, "span": [20000, 30000], "vScale": 5}
    tree = {"type": "flat", "cells": 60000, "children": [block]}
    types = {"flat": {"x": [0]}, "box": {"x": [1]}}
    t = terrain_of({"size": 1e-5, "origin": [1e5, 2e5], "elemTypes": types, "elemTree": tree})
    mesh = build(t, 0.1).mesh
    top = mesh.vertices[mesh.vertices[:, 2] > 2.5]
    assert set(mesh.vertices[:, 2]) == {0, 5}
    sides = (top[:, :2].min(0) - mesh.vertices[:, :2].min(0), np.ptp(top[:, :2], axis=0))
    assert np.array(sides) / 1e-5 == pytest.approx(
        np.array([[1 / 4, 1 / 10], [1 / 3, 1 / 2]]),
        abs=1e-5,  # a few spacings of doubles
    )


def test_walls_that_cross() -> None:
    """Where the higher side of an edge changes, both sides have one vertex."""
    definition = one({"x": [1]})
    definition["elemTypes"] |= {"rise": {"x": [-1, 1]}}
    definition["elemTree"]["children"][0] |= {"type": "rise"}
    terrain = terrain_of(definition)
    mesh = meshed(terrain, 1e-6)
    check_faces(mesh)
    check_closed(mesh, terrain)
    sides = mesh.vertices[np.abs(mesh.vertices[:, 0] - 2.5) < 1e-8]
    assert np.abs(sides[:, 2]).max() < 1e-8 and len(sides) == 2


def test_walls_have_the_area_that_they_should() -> None:
    mesh = meshed(terrain_of(one({"x": [1]}, turnDeg=45)), 1e-3)
    a, b, c = (mesh.vertices[mesh.faces[mesh.walls, k]] for k in range(3))
    # an octagon: the turned square trimmed to the cell
    side = 2**0.5 - 1
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(8 * side, abs=1e-6)


def test_a_mesh_is_the_same_every_time() -> None:
    definition = random_definition(3, 60, {**STRAIGHT, **ROUND})
    one_, two = (meshed(terrain_of(definition), 1e-2) for _ in range(2))
    assert one_.vertices.tobytes() == two.vertices.tobytes()
    assert one_.faces.tobytes() == two.faces.tobytes()


def test_triangles_are_refined_a_few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that whoever interrupts gets a turn; it makes no other difference."""
    terrain = terrain_of(random_definition(3, 30, {**STRAIGHT, **CURVED}))
    whole = meshed(terrain, 1e-3)
    monkeypatch.setattr(building, "_BATCH", 7)
    again = meshed(terrain, 1e-3)
    for name in ("vertices", "faces", "surfaces", "walls"):
        assert np.array_equal(getattr(whole, name), getattr(again, name))


@pytest.mark.parametrize("name", ["groups", "piece_bounds", "turns", "axes"])
def test_plans_that_lead_nowhere_are_refused(name: str) -> None:
    plan, _ = plan_of(terrain_of(random_definition(3, 30, {**STRAIGHT, **CURVED})), 1e-3)
    assert isinstance(plan.kernel_plan, kernels.Plan)
    with pytest.raises(TypeError, match="leads nowhere"):
        kernels.Plan(replace(plan, **{name: getattr(plan, name)[:-1]}))


def test_the_volume_is_that_of_the_terrain() -> None:
    """The ground's prisms down to 0 add up to the integral of the height."""
    definition = one({"x": "cosbell", "y": []}, vScale=2)
    definition["elemTree"]["children"] += [
        {"type": "box", "cellX": 5, "cellY": 5, "turnDeg": 45, "vScale": 1},
        {"type": "box", "cellX": 7, "cellY": 7, "vScale": 3},
    ]
    definition["elemTypes"]["box"] = {"x": [1]}
    mesh = meshed(terrain_of(definition), 1e-3)
    ground = mesh.faces[~mesh.walls]
    volume = (flat_areas(mesh)[~mesh.walls] / 2 * mesh.vertices[ground, 2].mean(axis=1)).sum()
    octagon = 2 * (2**0.5 - 1)
    assert volume == pytest.approx(2 * 0.25 + octagon + 3, rel=1e-3)


def test_a_thousand_boxes_are_lean() -> None:
    """A box has a top of two triangles, four walls of two, and ground beside it."""
    rng = np.random.default_rng(0)
    cells = rng.choice(40 * 40, 1000, replace=False)
    definition = {
        "size": 10,
        "elemTypes": {"floor": {"x": [0]}, "box": {"x": [1]}},
        "elemTree": {
            "type": "floor",
            "cells": 40,
            "children": [
                {"type": "box", "cellX": int(c % 40), "cellY": int(c // 40), "vScale": 1 + i / 1e4}
                for i, c in enumerate(cells)
            ],
        },
    }
    terrain = terrain_of(definition)
    mesh = meshed(terrain, 0.1)
    check_faces(mesh)
    check_closed(mesh, terrain)
    assert len(mesh.faces) < 16 * 1000


def test_surfaces_bring_their_friction() -> None:
    """Tan φ: of a range that of its middle; what a surface says goes before its preset."""
    surfaces = {
        "smooth": {"fricAngle": 0},
        "even": {"fricAngle": 45},
        "range": {"fricAngle": [20, 40]},
        "preset": {"preset": "concrete"},
        "both": {"preset": "concrete", "fricAngle": 45},
        "unknown": {"color": [1, 2, 3]},
    }
    mesh = meshed(terrain_of(one({"x": [1]}) | {"surfTypes": surfaces}), 0.1)
    assert mesh.names == tuple(surfaces)
    wanted = [0, 1, 3**-0.5, 0.75, 1, np.nan]
    # a preset keeps the angle to a tenth of a degree
    assert mesh.frictions == pytest.approx(wanted, abs=2e-3, nan_ok=True)
