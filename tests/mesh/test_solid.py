"""Solids: closed down to a base, every edge with two faces, the volume of the model."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.kernels import mesh as kernels
from terratool.mesh.build import assemble, base_below, build, coarse_mesh
from terratool.mesh.plan import plan_of
from terratool.mesh.types import BuiltMesh, RegionMesh
from tests.conftest import terrain_of
from tests.meshes import (
    CURVED,
    ROUND,
    STRAIGHT,
    check_closed,
    check_solid,
    covered,
    errors,
    integral,
    random_definition,
    volume,
)

BASE = -1.5


def site(children: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """A flat terrain of 10 × 7 cells, one unit each, with blocks and holes in them."""
    return {
        "size": [10, 7],
        "surfTypes": {"grass": {}, "rock": {}, "hole": {"void": True}},
        "elemTypes": {"floor": {"x": [0]}, "box": {"x": [1]}, **more},
        "elemTree": {"type": "floor", "surface": "grass", "cells": [10, 7], "children": children},
    }


def at(x: int, y: int, **more: Any) -> dict[str, Any]:
    return {"type": "box", "cellX": x, "cellY": y, "vScale": 1, **more}


def hole(x: int, y: int, **more: Any) -> dict[str, Any]:
    return at(x, y, surface="hole", **more)


def solid_of(definition: dict[str, Any], max_error: float = 1e-3, **options: Any) -> BuiltMesh:
    built = build(terrain_of(definition), max_error, **{"base": BASE, **options})
    check_solid(built, built.mesh.vertices[:, 2].min())
    return built


def vertices_at(built: BuiltMesh, x: float, y: float, z: float) -> int:
    return int((np.abs(built.mesh.vertices - (x, y, z)).max(axis=1) < 1e-7).sum())


class TestExact:
    def test_a_box_on_a_plate(self) -> None:
        built = solid_of(site([at(2, 3)]))
        assert built.shell == 10 + 8
        assert len(built.mesh.faces) == built.shell + 8 + 2
        assert volume(built) == pytest.approx(70 * 1.5 + 1, rel=1e-8)

    def test_bounds_cut_it(self) -> None:
        built = solid_of(site([at(2, 3)]), bounds=(2.25, -5, 20, 3.5))
        assert volume(built) == pytest.approx(7.75 * 3.5 * 1.5 + 0.75 * 0.5, rel=1e-7)

    def test_stairs_and_ramps_at_the_rim(self) -> None:
        """The skirt leads through every level of its vertices."""
        definition = site(
            [
                at(0, 0, type="steps"),
                at(9, 6, type="rise"),
                at(0, 3, vScale=3),
                at(9, 3, vScale=-1),
            ],
            steps={"x": [[0, 1], [0.5, 1], [0.5, 2], [1, 2]]},
            rise={"x": [1, 2]},
        )
        assert volume(solid_of(definition)) == pytest.approx(105 + 1.5 + 1.5 + 3 - 1, rel=1e-7)

    def test_the_void_leaves_holes_down_to_the_base(self) -> None:
        built = solid_of(site([hole(0, 0), hole(4, 2, span=[3, 2]), at(4, 4), hole(9, 1)]))
        assert volume(built) == pytest.approx(62 * 1.5 + 1, rel=1e-7)

    def test_islands_in_holes(self) -> None:
        """A ring of the void, ground within it, a hole in that, and a block in the hole."""
        block = {**at(1, 1), "surface": "rock"}
        inner = hole(1, 1, cells=3, children=[block])
        island = {**at(1, 1), "surface": "grass", "cells": 3, "children": [inner]}
        ring = hole(2, 1, span=[6, 3], cells=3, children=[island])
        built = solid_of(site([ring]))
        assert len(trimesh_bodies(built)) == 3
        cell = 18 / 9
        # the heights of the ring, the island, the hole in it and the block add up
        expected = (70 - 18) * 1.5 + cell * 8 / 9 * (2 + 1.5) + cell / 9 / 9 * (4 + 1.5)
        assert volume(built) == pytest.approx(expected, rel=1e-6)

    def test_nothing_but_void(self) -> None:
        definition = site([])
        definition["elemTree"]["surface"] = "hole"
        for base in (BASE, "below"):
            built = build(terrain_of(definition), 0.1, base=base)  # type: ignore[arg-type]
            assert (len(built.mesh.faces), len(built.mesh.vertices), built.shell) == (0, 0, 0)


def trimesh_bodies(built: BuiltMesh) -> list[Any]:
    import trimesh

    mesh = trimesh.Trimesh(built.mesh.vertices, built.mesh.faces, process=False)
    labels = trimesh.graph.connected_component_labels(mesh.face_adjacency, len(mesh.faces))
    return sorted(set(labels))


class TestWedges:
    def test_boxes_that_touch_have_vertices_of_their_own(self) -> None:
        built = solid_of(site([at(2, 3), at(3, 4, vScale=2)]))
        assert volume(built) == pytest.approx(108, rel=1e-8)
        # the lower part of the edge is of both, the upper one of the higher box alone
        assert [vertices_at(built, 3, 4, z) for z in (0, 1, 2)] == [1, 2, 1]

    def test_three_boxes_around_a_place_are_one_wedge(self) -> None:
        built = solid_of(site([at(2, 3), at(3, 4, vScale=2), at(2, 4)]))
        assert [vertices_at(built, 3, 4, z) for z in (0, 1, 2)] == [1, 1, 1]

    def test_holes_that_touch(self) -> None:
        built = solid_of(site([hole(2, 3), hole(3, 4), at(3, 3, vScale=2)]))
        assert volume(built) == pytest.approx(68 * 1.5 + 2, rel=1e-8)
        assert [vertices_at(built, 3, 4, z) for z in (BASE, 0, 2)] == [2, 2, 1]

    def test_a_hole_and_the_rim(self) -> None:
        """Ground on both sides of a corner that the void touches the rim with."""
        definition = site([hole(4, 0, turnDeg=45), hole(0, 0, turnDeg=45, span=[2, 2])])
        octagon = 2 * (2**0.5 - 1)
        assert volume(solid_of(definition)) == pytest.approx((70 - 5 * octagon) * 1.5, rel=1e-7)

    def test_blades_around_one_place(self) -> None:
        """Turned boxes in one cell cross each other, wedges of many heights meet in its middle."""
        blades = [at(4, 3, type="blade", turnDeg=20 * k, vScale=1 + k / 10) for k in range(9)]
        blade = {"x": [[0, 0], [0.45, 0], [0.45, 1], [0.55, 1], [0.55, 0], [1, 0]]}
        solid_of(site(blades, blade=blade))

    def test_blocks_like_on_a_board(self) -> None:
        """Every inner place is a pinch, of blocks in one half and of holes in the other."""
        squares = [(x, y) for x in range(10) for y in range(7) if (x + y) % 2]
        built = solid_of(site([(at if x < 5 else hole)(x, y) for x, y in squares]))
        low = sum(x >= 5 for x, y in squares)
        assert volume(built) == pytest.approx((70 - low) * 1.5 + len(squares) - low, rel=1e-8)

    def test_walls_that_cross(self) -> None:
        rise = {"x": [-1, 1], "y": [-1, 1]}
        built = solid_of(site([at(4, 3, type="rise"), at(5, 4, type="rise")], rise=rise))
        assert volume(built) == pytest.approx(105, rel=1e-6)

    def test_an_open_mesh_shares_its_vertices(self) -> None:
        built = build(terrain_of(site([at(2, 3), at(3, 4)])), 0.1)
        assert built.shell == len(built.mesh.faces)
        assert len(np.unique(built.mesh.vertices, axis=0)) == len(built.mesh.vertices)


class TestBase:
    def test_the_skirt_takes_the_surface_above_and_the_base_none(self) -> None:
        built = solid_of(site([at(0, 0, surface="rock"), at(5, 3, surface="rock")]))
        mesh = built.mesh
        a, b, c = (mesh.vertices[mesh.faces[built.shell :, k]] for k in range(3))
        middle = (a + b + c) / 3
        skirt = mesh.walls[built.shell :]
        rocky = (middle[:, :2] < 1).all(axis=1)
        names = np.array([*mesh.names, None])[mesh.surfaces[built.shell :]]
        assert (names[skirt & rocky] == "rock").all() and (skirt & rocky).sum() >= 4
        assert (names[skirt & ~rocky] == "grass").all()
        assert (names[~skirt] == None).all()  # noqa: E711

    def test_the_shell_is_the_open_mesh(self) -> None:
        definition = random_definition(5, 40, STRAIGHT, ("grass", "rock"))
        definition["size"] = [10, 6]
        open_ = build(terrain_of(definition), 1e-3).mesh
        built = solid_of(definition, base=-20)
        ends = slice(built.shell)
        faces = built.mesh.vertices[built.mesh.faces[ends]]
        assert (faces == open_.vertices[open_.faces]).all()
        assert (built.mesh.surfaces[ends] == open_.surfaces).all()
        assert (built.mesh.walls[ends] == open_.walls).all()

    @pytest.mark.parametrize("base", [0, -1, -0.999999, 2, math.nan, math.inf, -math.inf])
    def test_it_must_lie_below_all_ground(self, base: float) -> None:
        with pytest.raises(RequestError, match=r"lowest ground of the mesh, which is at -1\. Give"):
            build(terrain_of(site([at(2, 3, vScale=-1)])), 0.1, base=base)

    def test_only_the_part_that_is_meshed_counts(self) -> None:
        definition = site([at(2, 3, vScale=-1)])
        solid_of(definition, bounds=(5, 0, 10, 7), base=-0.5)
        assert volume(solid_of(definition, base=-1 - 1e-6)) > 0

    def test_the_default_is_a_tenth_of_the_relief_below(self) -> None:
        definition = site([at(2, 3, vScale=-1), at(5, 5, vScale=4)])
        assert solid_of(definition, base="below").mesh.vertices[:, 2].min() == -1.5
        assert base_below(-1, 4, 10) == -1.5

    def test_flat_ground_becomes_a_plate(self) -> None:
        built = solid_of(site([]), base="below")
        assert built.mesh.vertices[:, 2].min() == pytest.approx(-0.1, rel=1e-6)
        assert volume(built) == pytest.approx(7, rel=1e-6)


def oblong(seed: int, definition: dict[str, Any]) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    return {**definition, "size": [10, float(rng.integers(3, 30))], "origin": [-70, 1200]}


@pytest.mark.parametrize(
    ("primitives", "max_error"),
    [(STRAIGHT, 1e-3), ({**STRAIGHT, **CURVED}, 3e-2), ({**STRAIGHT, **CURVED, **ROUND}, 3e-2)],
    ids=["straight", "curved", "round"],
)
@pytest.mark.parametrize("seed", range(4))
def test_random_solids(seed: int, primitives: dict[str, Any], max_error: float) -> None:
    """Turned, nested, sharing cells, with the void; the volume is the integral of the height."""
    definition = oblong(seed, random_definition(seed + 100, 50, primitives))
    terrain = terrain_of(definition)
    built = solid_of(definition, max_error, base="below")
    mesh, end = built.mesh, built.shell
    shell = replace(mesh, faces=mesh.faces[:end], walls=mesh.walls[:end])
    if "column" not in primitives:  # sickles between arcs and polygons are wide at sharp corners
        assert errors(shell, terrain, 5000, max_error, aside=1e-6).max() < max_error
    expected = integral(terrain, mesh.vertices[:, 2].min())
    assert volume(built) == pytest.approx(expected, rel=1e-3, abs=0.3 * max_error * covered(shell))
    if primitives is STRAIGHT:
        check_closed(build(terrain, max_error).mesh, terrain)


@pytest.mark.parametrize("seed", range(20))
def test_any_heights_make_a_solid(seed: int) -> None:
    """Every triangle with heights of its own, and some void: all kinds of walls, and of pinches."""
    rng = np.random.default_rng(seed)
    terrain = terrain_of(oblong(seed, random_definition(seed, 30, STRAIGHT)))
    plan, loss = plan_of(terrain, 1e-3)
    segments = kernels.segments_of(plan.kernel_plan, np.flatnonzero(plan.frames["drawn"]))
    coarse = coarse_mesh(plan, segments)
    triangles = coarse.triangulation.triangles
    count = len(triangles)
    regions = coarse.regions._replace(
        voids=rng.random(count) < 0.2, surfaces=rng.integers(0, 2, count).astype(np.int32)
    )
    heights = rng.integers(0, 2 + seed % 4, triangles.shape).astype(float)
    one_each = np.arange(count, dtype=np.int32)
    parts = RegionMesh(coarse.triangulation, regions, one_each, heights)
    mesh, shell, _ = assemble(terrain, plan, parts, -1.0)
    check_solid(BuiltMesh(mesh, shell, 0.0, loss), -1.0)
    assert covered(mesh) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("name", ROUND)
def test_round_solids(name: str) -> None:
    """An oblong, turned disc with another in it, and one of the void."""
    definition = site(
        [
            at(1, 1, type=name, span=[3, 2], turnDeg=30, vScale=2, cells=2)
            | {"children": [at(1, 0, type=name)]},
            hole(6, 2, type="column", span=[2, 3]),
        ],
        **ROUND,
    )
    built = solid_of(definition, 1e-2)
    assert volume(built) == pytest.approx(integral(terrain_of(definition), BASE), rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_parts_of_random_terrains(seed: int) -> None:
    definition = oblong(seed, random_definition(seed + 200, 60, {**STRAIGHT, **ROUND}))
    rng = np.random.default_rng(seed)
    west, south, east, north = terrain_of(definition).bounds
    x, y = np.sort(rng.uniform(west, east, 2)), np.sort(rng.uniform(south, north, 2))
    solid_of(definition, 1e-2, base="below", bounds=(x[0], y[0], x[1], y[1]))


def hardly_turned(seed: int) -> dict[str, Any]:
    """Elements that share cells, turned by almost nothing: edges that cross at tiny angles."""
    rng = np.random.default_rng(seed)
    primitives = {**STRAIGHT, **{name: ROUND[name] for name in ("column", "tower", "cone")}}
    names = list(primitives)

    def element() -> dict[str, Any]:
        x, y = int(rng.integers(4)), int(rng.integers(3))
        out = at(x, y, type=names[rng.integers(len(names))], vScale=rng.integers(-10, 11) / 10)
        if rng.random() < 0.7:
            little = 10 ** rng.uniform(-9, 0) * rng.choice([-1, 1])
            out["turnDeg"] = float(rng.choice([0, 90, 45]) + little)
        if rng.random() < 0.3:
            out["surface"] = str(rng.choice(["grass", "rock", "hole"]))
        if rng.random() < 0.3:
            out["span"] = [int(rng.integers(1, 5 - x)), int(rng.integers(1, 4 - y))]
        if rng.random() < 0.3:
            out["cells"] = [int(rng.integers(1, 60000)), 1]
            blade = at(out["cells"][0] // 2, 0, turnDeg=float(rng.choice([0, 1e-4, 30])))
            out["children"] = [blade]
        return out

    definition = site([element() for _ in range(25)], **primitives)
    definition["elemTree"] |= {"type": "ramp", "cells": [4, 3]}
    return definition


@pytest.mark.parametrize("seed", [0, 1, 2, 258])  # 258: crossings cannot be found at once
def test_edges_that_are_nearly_parallel(seed: int) -> None:
    definition = hardly_turned(seed)
    built = solid_of(definition, 1e-2, base=-30)
    assert volume(built) == pytest.approx(integral(terrain_of(definition), -30), rel=1e-3)


def test_a_thousand_levels() -> None:
    element: dict[str, Any] = {"type": "box", "vScale": 0.001}
    for level in range(1000):
        child = {**element, "cellX": level % 2, "cellY": 0}
        element = {"type": "box", "vScale": 0.001, "cells": [2, 1], "children": [child]}
    definition = site([])
    definition["elemTree"] = element
    built = solid_of(definition)
    # each level covers half of the one above it
    assert volume(built) == pytest.approx(70 * 1.5 + 70 * 0.001 * 2, rel=1e-6)


def test_ten_thousand_boxes() -> None:
    rng = np.random.default_rng(0)
    cells = rng.choice(150 * 100, 10_000, replace=False)
    heights = 1 + rng.integers(0, 5, 10_000) / 10
    definition = site([])
    definition["elemTree"]["cells"] = [150, 100]
    definition["elemTree"]["children"] = [
        at(int(c % 150), int(c // 150), vScale=h) for c, h in zip(cells, heights, strict=True)
    ]
    built = solid_of(definition)
    assert volume(built) == pytest.approx(105 + heights.sum() * 70 / 15_000, rel=1e-6)
