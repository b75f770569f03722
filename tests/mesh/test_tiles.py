"""Tiles: the same on both sides of a seam to the last bit, and together as good as one mesh."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from terratool.errors import RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh import seams
from terratool.mesh.build import build
from terratool.mesh.formats.table import FORMATS
from terratool.mesh.tiles import (
    INDEX,
    TileCount,
    TileLayout,
    build_tile,
    faces_of,
    lay_out,
)
from terratool.mesh.types import Mesh, TileBoundary, Triangulation
from tests.conftest import terrain_of
from tests.meshes import (
    CURVED,
    ROUND,
    STRAIGHT,
    check_closed,
    check_faces,
    covered,
    errors,
    exported_tiles,
    flat_areas,
    freed,
    open_edges,
    random_definition,
    read,
)


def tiles_of(terrain: Terrain, layout: TileLayout) -> dict[tuple[int, int], Mesh]:
    rows, columns = layout.shape
    places = [(row, column) for row in range(rows) for column in range(columns)]
    return {place: build_tile(terrain, layout, *place).mesh for place in places}


def union(meshes: list[Mesh]) -> Mesh:
    """Meshes as one, in which vertices are one only if all of their bits are the same."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    begins = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    bits = np.ascontiguousarray(vertices + 0.0).view("V24").reshape(-1)
    _, first, index = np.unique(bits, return_index=True, return_inverse=True)
    faces = [index.reshape(-1)[m.faces + begin] for m, begin in zip(meshes, begins, strict=False)]
    return replace(
        meshes[0],
        vertices=vertices[first],
        faces=np.concatenate(faces).astype(np.int32),
        surfaces=np.concatenate([mesh.surfaces for mesh in meshes]),
        walls=np.concatenate([mesh.walls for mesh in meshes]),
    )


def on_seam(mesh: Mesh, axis: int, at: float) -> set[tuple[bytes, bytes]]:
    """Open edges on a seam, as the bits of their ends, each with the smaller one first."""
    p, q = (mesh.vertices[open_edges(mesh)[:, k]] for k in range(2))
    there = (p[:, axis] == at) & (q[:, axis] == at)
    pairs = zip(p[there] + 0.0, q[there] + 0.0, strict=True)
    return {(min(a, b), max(a, b)) for a, b in ((p.tobytes(), q.tobytes()) for p, q in pairs)}


def check_seams(layout: TileLayout, tiles: dict[tuple[int, int], Mesh]) -> int:
    """Both tiles at a seam have the same open edges there; returns their number."""
    rows, columns = layout.shape
    pitch = layout.plan.pitch
    count = 0
    for row in range(rows):
        for column in range(columns):
            own = tiles[row, column]
            beyond = (
                [((row, column + 1), 0, layout.columns[column].at)] if column + 1 < columns else []
            )
            if row + 1 < rows:
                beyond.append(((row + 1, column), 1, layout.rows[rows - 2 - row].at))
            for other, axis, at in beyond:
                edges = on_seam(own, axis, at * pitch)
                assert edges == on_seam(tiles[other], axis, at * pitch)
                count += len(edges)
    return count


def wild(seed: int, free: bool = False) -> tuple[Terrain, float, float, TileLayout]:
    """A terrain, the error of its mesh, how far its walls stand aside, and how it is cut."""
    rng = np.random.default_rng(seed)
    primitives, error, aside = (
        (STRAIGHT, 1e-3, 1e-7),
        ({**STRAIGHT, **CURVED}, 2e-2, 1e-7),
        ({**STRAIGHT, **ROUND}, 2e-2, 4e-2),
    )[seed % 3]
    # discs of the void are polygons, whose border lies aside
    surfaces = ("grass", "rock") if seed % 3 == 2 else ("grass", "rock", "hole")
    definition = random_definition(seed, int(rng.integers(10, 60)), primitives, surfaces)
    if seed % 2:
        definition["size"] = [float(rng.choice([3, 10, 47])), float(rng.choice([5, 10, 100]))]
    if seed % 5 == 0:
        definition["origin"] = [1e5, -3e4]
    terrain = terrain_of(freed(definition, seed) if free else definition)
    rows, columns = (int(n) for n in rng.integers(1, 5, 2))
    return (
        terrain,
        error,
        aside,
        lay_out(terrain, error, TileCount(rows=rows, columns=columns + (rows == 1))),
    )


@pytest.mark.parametrize(
    ("seed", "free"),
    [*((seed, False) for seed in range(30)), *((seed, True) for seed in range(12))],
)
def test_tiles_fit(seed: int, free: bool) -> None:
    """Turned, nested, round, void: no crack, no vertex on another's edge, all within the error."""
    terrain, error, aside, layout = wild(seed, free)
    tiles = tiles_of(terrain, layout)
    assert check_seams(layout, tiles) > 0
    mesh = union(list(tiles.values()))
    check_faces(mesh)
    check_closed(mesh, terrain, aside if seed % 3 == 2 else 1e-8)
    whole = build(terrain, error).mesh
    assert abs(covered(mesh) - covered(whole)) < 1e-6 * covered(whole)
    if seed % 3 != 2:  # what discs do far from seams is told elsewhere
        assert errors(mesh, terrain, 30000, error, aside).max() < error


def test_one_tile_is_the_whole_mesh() -> None:
    terrain = terrain_of(random_definition(3, 60, {**STRAIGHT, **CURVED}))
    mesh = build(terrain, 1e-2).mesh
    tile = build_tile(terrain, lay_out(terrain, 1e-2, TileCount(rows=1, columns=1)), 0, 0).mesh
    assert tile.vertices.tobytes() == mesh.vertices.tobytes()
    assert tile.faces.tobytes() == mesh.faces.tobytes()


def test_tiles_are_the_same_every_time_and_in_any_order() -> None:
    definition = random_definition(4, 40, {**STRAIGHT, **CURVED})
    terrain, other = terrain_of(definition), terrain_of(definition)
    layout, again = (lay_out(one, 2e-2, TileCount(rows=2, columns=3)) for one in (terrain, other))
    tiles = tiles_of(terrain, layout)
    for row, column in sorted(tiles, reverse=True):
        mesh = build_tile(other, again, row, column).mesh
        assert mesh.vertices.tobytes() == tiles[row, column].vertices.tobytes()
        assert mesh.faces.tobytes() == tiles[row, column].faces.tobytes()


def test_tiles_lie_row_by_row_from_the_north_west() -> None:
    terrain = terrain_of(
        {"size": [4, 3], "elemTypes": {"f": {"x": [0]}}, "elemTree": {"type": "f"}}
    )
    layout = lay_out(terrain, 0.1, TileCount(rows=2, columns=3))
    tiles = tiles_of(terrain, layout)
    assert list(tiles) == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    for (row, column), mesh in tiles.items():
        west, south, east, north = layout.bounds(row, column)
        assert (mesh.origin == 0).all()
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        assert [*low[:2], *high[:2]] == [west, south, east, north]
        assert abs(west - 4 * column / 3) < 0.1 and abs(north - (3 - 1.5 * row)) < 0.1
        assert len(mesh.faces) == 2
    assert layout.bounds(0, 0)[0] == 0 and layout.bounds(0, 2)[3] == 3


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("how", ["shifted", "mirrored", "raised", "finer"])
def test_tiles_that_do_not_fit_are_caught(how: str, axis: int) -> None:
    """What the other tests call fitting is no less than that."""
    terrain, _, _, _ = wild(1)
    layout = lay_out(terrain, 2e-2, TileCount(rows=1 + axis, columns=2 - axis))
    tiles = tiles_of(terrain, layout)
    check_closed(union(list(tiles.values())), terrain)
    last = max(tiles)
    vertices, faces = tiles[last].vertices.copy(), tiles[last].faces
    seam = (layout.columns + layout.rows)[0]
    there = vertices[:, axis] == seam.at * layout.plan.pitch
    along = 1 - axis
    if how == "shifted":
        vertices[:, along] += layout.plan.pitch
    elif how == "raised":
        vertices[np.flatnonzero(there)[len(faces) % there.sum()], 2] += 1e-12
    elif how == "mirrored":
        vertices[:, along] = terrain.size[along] - vertices[:, along]
        faces = faces[:, ::-1]
    else:  # an edge on the seam has a vertex more, as refinement would make it
        edge = next(e for e in open_edges(tiles[last]) if there[e].all())
        t = np.flatnonzero(np.isin(faces, edge).sum(axis=1) == 2)[0]
        k = int(np.flatnonzero(~np.isin(faces[t], edge))[0])
        a, b, c = np.roll(faces[t], -k)
        vertices = np.vstack([vertices, 0.5 * (vertices[b] + vertices[c])])
        p = len(vertices) - 1
        faces = np.vstack([np.delete(faces, t, 0), [[a, b, p], [a, p, c]]]).astype(np.int32)
        walls = np.append(np.delete(tiles[last].walls, t), [False, False])
        tiles[last] = replace(tiles[last], walls=walls)
    tiles[last] = replace(tiles[last], vertices=vertices, faces=faces)
    with pytest.raises(AssertionError):
        check_seams(layout, tiles)
    with pytest.raises(AssertionError):
        check_closed(union(list(tiles.values())), terrain)


def test_walls_that_cross_a_seam_have_the_same_levels() -> None:
    """Three storeys, a void beside and a wall whose higher side changes."""
    types = {
        "floor": {"x": [0]},
        "box": {"x": [1]},
        "stairs": {"x": [0.2], "y": STRAIGHT["stairs"]["x"]},
        "rise": {"x": [-1, 1]},
    }
    box = {"type": "box", "vScale": 1, "cellY": 1, "cellX": 0, "span": [3, 1]}
    children = [
        box,
        {**box, "vScale": 0.5},
        {**box, "type": "stairs", "cellY": 2},
        {**box, "type": "rise", "cellY": 3},
        {**box, "surface": "hole", "cellY": 4},
    ]
    root = {"type": "floor", "cells": [3, 6], "children": children, "surface": "rock"}
    surfaces = {"rock": {}, "hole": {"void": True}}
    terrain = terrain_of({"size": 6, "surfTypes": surfaces, "elemTypes": types, "elemTree": root})
    layout = lay_out(terrain, 0.01, TileCount(rows=1, columns=2))
    tiles = tiles_of(terrain, layout)
    check_seams(layout, tiles)
    at = layout.columns[0].at * layout.plan.pitch
    for mesh in tiles.values():
        x, y, z = mesh.vertices.T
        levels: dict[float, list[float]] = {}
        for place, level in sorted(zip(y[x == at].round(6), z[x == at].round(6), strict=True)):
            levels.setdefault(place, []).append(level)
        assert levels[1.0] == [0, 1.5] and levels[4.0] == [levels[4.0][0]]
        assert levels[2.3] == [0.02, 0.08] and levels[2.6] == [0.08, 0.2]
        walls = mesh.vertices[mesh.faces[mesh.walls]]
        assert (walls[:, :, 0].min(axis=1) < at).any() or (walls[:, :, 0].max(axis=1) > at).any()


def test_heights_that_are_one_but_for_rounding_have_the_same_bits() -> None:
    """0.1 + 0.2 beside 0.3: which of them it is must not depend on the tile."""
    children = []
    for row in range(40):
        for scale in (0.3,) if row % 2 else (0.1, 0.2):
            cell = {"cellX": 0, "cellY": row, "span": [3, 1]}
            children.append({"type": "box", "vScale": scale, **cell})
    root = {"type": "floor", "cells": [3, 40], "children": children}
    types = {"floor": {"x": [0]}, "box": {"x": [1]}}
    terrain = terrain_of({"size": 10, "elemTypes": types, "elemTree": root})
    layout = lay_out(terrain, 0.01, TileCount(rows=1, columns=3))
    tiles = tiles_of(terrain, layout)
    check_seams(layout, tiles)
    for seam in layout.columns:
        assert (seam.heights[1:, 0] == seam.heights[:-1, 1]).all()


def test_corners_take_the_heights_of_the_seam() -> None:
    """Of the edge that they belong to, or the nearest that is there."""
    points = np.array([[0, 0], [9, 0], [0, 9], [0, 20], [9, 20]])
    triangles = np.array([[0, 1, 2], [2, 1, 4], [2, 4, 3]], np.int32)
    neighbours = np.array([[-1, 1, -1], [0, -1, 2], [1, -1, -1]], np.int32)
    plane = Triangulation(points, triangles, neighbours)
    boundary = TileBoundary(
        np.array([0, -1, -1, -1]),
        np.array([[0, 9, 0, 20], [0, 0, 0, 9]]),
        np.array([[5.0, 6.0], [1.0, 2.0]]),
    )
    triangle, corner = seams.boundary_triangles(plane, boundary)
    assert triangle.tolist() == [2, 0] and corner.tolist() == [2, 2]
    heights = np.array([[1.1, 0, 2.1], [4.9, 0, 0], [5.1, 0, 6.1]])
    seams.pin_heights(plane, boundary, triangle, corner, np.zeros(3, bool), heights)
    assert heights.tolist() == [[1, 0, 2], [5, 0, 0], [5, 0, 6]]
    with pytest.raises(RuntimeError, match="edges of its seams"):
        seams.boundary_triangles(plane, boundary._replace(edges=np.roll(boundary.edges, 1, axis=1)))


def test_vertices_of_a_seam_are_not_moved() -> None:
    points = np.array([[0, 50], [0, 52], [1, 51], [1, 70]])
    limits = np.array([0, 0, 99, 99])
    for side, expected in ((0, [0, 1, 0, 3]), (-1, [0, 0, 0, 3])):
        roots = kernels.weld(points, limits, np.array([side, -1, -1, -1]), 2)
        assert roots.tolist() == expected


class TestSeams:
    """Seams alone."""

    @pytest.mark.parametrize("seed", range(0, 12, 2))
    def test_no_segment_ends_near_them_and_none_runs_along(self, seed: int) -> None:
        _, _, _, layout = wild(seed)
        plan = layout.plan
        drawn = kernels.segments_of(plan.kernel_plan, np.arange(len(plan.frames)))
        for seam in (*layout.columns, *layout.rows):
            ends = drawn[:, [seam.axis, seam.axis + 2]]
            assert np.abs(ends - seam.at).min() > seams.CLEARANCE
            assert (np.diff(seam.places) >= 4).all()
            assert set(seam.passes) <= set(seam.places)
            assert np.isfinite(seam.heights).all()

    @pytest.mark.parametrize("seed", [1, 4, 7])
    def test_chords_miss_by_half_the_error(self, seed: int) -> None:
        terrain, error, _, layout = wild(seed)
        for seam in (*layout.columns, *layout.rows):
            share = np.linspace(0.02, 0.98, 49)[:, None]
            along = seam.places[:-1] + share * np.diff(seam.places)
            points = np.empty((*along.shape, 2))
            points[..., seam.axis], points[..., 1 - seam.axis] = seam.at, along
            world = points * layout.plan.pitch + layout.plan.origin
            chord = (1 - share) * seam.heights[:, 0] + share * seam.heights[:, 1]
            # edges of a few points of the lattice are shorter than what the world resolves
            long = np.diff(seam.places) > 100
            missed = np.abs(chord - terrain.height(world[..., 0], world[..., 1]))[:, long]
            assert np.nanmax(missed) < 0.5 * error

    def test_segments_pass_at_their_exact_place_rounded(self) -> None:
        rng = np.random.default_rng(0)
        drawn = rng.integers(0, 1 << 30, (1000, 4))
        at = (drawn[:, 0] + drawn[:, 2]) // 2
        for k in range(0, 1000, 7):
            x0, y0, x1, y1 = (int(n) for n in drawn[k])
            exact = y0 + Fraction(int(at[k]) - x0, x1 - x0) * (y1 - y0)
            place = int(seams.passing_places(drawn[k : k + 1], 0, int(at[k]))[0])
            assert abs(place - exact) <= Fraction(1, 2)
            # and the same from the other end, and along the other axis
            turned = drawn[k : k + 1, [3, 2, 1, 0]]
            assert abs(int(seams.passing_places(turned, 1, int(at[k]))[0]) - exact) <= Fraction(
                1, 2
            )

    def test_lines_near_ends_and_crossings_are_none(self) -> None:
        def box(x: int, turn: float) -> dict[str, Any]:
            return {"type": "b", "cellX": x, "cellY": 1, "vScale": 1, "turnDeg": turn}

        root = {"type": "b", "cells": [4, 4], "children": [box(0, 0), box(2, 45)]}
        terrain = terrain_of({"size": 4, "elemTypes": {"b": {"x": [1]}}, "elemTree": root})
        plan = lay_out(terrain, 0.1, TileCount(rows=1, columns=1)).plan
        drawn = kernels.segments_of(plan.kernel_plan, np.arange(3))
        unit = round(1 / plan.pitch)
        # two more that cross in (3.5, 3.5), one of them steep
        crossing = np.array([[6, 6, 8, 8], [6, 8, 8, 6]]) * unit // 2

        def is_seam(at: int) -> bool:
            return seams._line(plan, 0, at, np.concatenate([drawn, crossing]), []) is not None

        corner = round((2.5 + (2**0.5 - 1) / 2) / plan.pitch)  # of an octagon
        for near in (unit, corner, 7 * unit // 2):
            assert [is_seam(near + k) for k in (-90, -8, 0, 8, 90)] == [True, *[False] * 3, True]

    def test_edges_that_leave_no_room_are_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        terrain, error, _, _ = wild(0)
        monkeypatch.setattr(seams, "CLEARANCE", 1 << 28)
        with pytest.raises(RequestError, match="no seam"):
            lay_out(terrain, error, TileCount(rows=1, columns=2))

    def test_seams_do_not_lie_on_the_lines_of_grids(self) -> None:
        """The middle of the terrain is where edges are."""
        children = [{"type": "b", "cellX": 5, "cellY": 5, "cells": 7, "children": [
            {"type": "b", "cellX": 3, "cellY": 3}]}]  # fmt: skip
        root = {"type": "b", "cells": 10, "children": children}
        terrain = terrain_of({"size": 10, "elemTypes": {"b": {"x": [1]}}, "elemTree": root})
        layout = lay_out(terrain, 0.1, TileCount(rows=2, columns=2))
        check_closed(union(list(tiles_of(terrain, layout).values())), terrain)


class TestLayout:
    """How many tiles there are."""

    def test_crowded_terrains_have_more_tiles(self) -> None:
        terrain = terrain_of(random_definition(0, 60, STRAIGHT))
        small = lay_out(terrain, 1e-2, TileCount(faces=300)).shape
        large = lay_out(terrain, 1e-2, TileCount(faces=100_000)).shape
        assert large == (1, 1) and small[0] * small[1] > 4

    @pytest.mark.parametrize("error", [3e-2, 3e-3])
    @pytest.mark.parametrize("name", ["block", "pyramid", "bell", "saddle", "wave", "tent"])
    def test_faces_are_foreseen(self, name: str, error: float) -> None:
        """Up to a factor of three: what has few elements may have many faces."""
        types = {**STRAIGHT, **CURVED}
        children = [{"type": name, "cellX": k, "cellY": k, "vScale": 1} for k in range(10)]
        root = {"type": "floor", "children": children}
        terrain = terrain_of({"size": 10, "elemTypes": types, "elemTree": root})
        plan = lay_out(terrain, error, TileCount(rows=1, columns=1)).plan
        count = len(build(terrain, error).mesh.faces)
        assert count / 3 < faces_of(plan) < 3 * count

    def test_tiles_are_about_square(self) -> None:
        definition = random_definition(0, 60, STRAIGHT)
        definition["size"] = [40, 10]
        rows, columns = lay_out(terrain_of(definition), 1e-2, TileCount(faces=300)).shape
        assert 2 * rows <= columns

    def test_rows_or_columns_alone(self) -> None:
        terrain = terrain_of(random_definition(0, 60, STRAIGHT))
        assert lay_out(terrain, 1e-2, TileCount(rows=3)).shape == (3, 1)
        assert lay_out(terrain, 1e-2, TileCount(columns=2, faces=300)).shape[1] == 2

    def test_bounds_are_cut_too(self) -> None:
        terrain = terrain_of(random_definition(6, 60, STRAIGHT))
        bounds = (1.3, 2.1, 8.2, 9.7)
        layout = lay_out(terrain, 1e-3, TileCount(rows=2, columns=2), bounds)
        tiles = tiles_of(terrain, layout)
        check_seams(layout, tiles)
        mesh, whole = union(list(tiles.values())), build(terrain, 1e-3, bounds).mesh
        check_faces(mesh)
        assert flat_areas(mesh).sum() == pytest.approx(flat_areas(whole).sum(), rel=1e-7)

    def test_tiles_look_at_what_is_near(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A tile costs what lies in it."""
        terrain = terrain_of(random_definition(6, 60, STRAIGHT))
        layout = lay_out(terrain, 1e-2, TileCount(rows=4, columns=4))
        asked = []

        def spy(plan: Any, chosen: Any) -> Any:
            asked.append(len(chosen))
            return segments_of(plan, chosen)

        segments_of = kernels.segments_of
        monkeypatch.setattr(kernels, "segments_of", spy)
        tiles_of(terrain, layout)
        assert min(asked) < len(terrain.arrays.elements) / 3


# --- files and their index


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return terrain_of(random_definition(1, 30, STRAIGHT, ("grass", "rock")))


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_for_each_tile_and_an_index(terrain: Terrain, tmp_path: Path, suffix: str) -> None:
    report = exported_tiles(terrain, tmp_path / "site", suffix, 0.01, rows=2, columns=2)
    companions = FORMATS[suffix].companions
    expected = [
        f"mesh_0{r}_0{c}{end}" for r in (0, 1) for c in (0, 1) for end in (suffix, *companions)
    ]
    assert names_in(tmp_path / "site") == sorted([*expected, INDEX])
    index = json.loads((tmp_path / "site" / INDEX).read_text())
    assert [index[key] for key in ("version", "rows", "columns")] == [1, 2, 2]
    assert index["error"] == report.statement.error <= 0.01
    assert index["bounds"] == [0, 0, 10, 10] == list(report.bounds)
    assert index["origin"] == [0, 0, 0]
    assert index["faces"] == report.faces == sum(tile["faces"] for tile in index["tiles"])
    assert [(tile["row"], tile["column"]) for tile in index["tiles"]] == [
        (0, 0), (0, 1), (1, 0), (1, 1)
    ]  # fmt: skip
    assert [name for tile in index["tiles"] for name in tile["files"]] == expected
    west, south, east, north = zip(*(tile["bounds"] for tile in index["tiles"]), strict=True)
    assert west[0] == 0 and west[1] == east[0] == west[3] and south[0] == north[2]


@pytest.mark.parametrize(
    ("origin", "zero"),
    [("local", (1000, 2000, 0)), ("center", (1005, 2005, 0)), ("world", (0, 0, 0)),
     ((990.25, 2017.5, -2.0), (990.25, 2017.5, -2.0))],
)  # fmt: skip
def test_the_files_fit(tmp_path: Path, origin: Any, zero: tuple[float, ...]) -> None:
    """Loaded together they are one closed surface, and lie where the terrain is."""
    definition = random_definition(1, 30, STRAIGHT, ("grass", "rock"))
    definition["origin"] = [1000, 2000]
    terrain = terrain_of(definition)
    report = exported_tiles(terrain, tmp_path, ".ply", 0.01, rows=2, columns=2, origin=origin)
    meshes = [trimesh.load(tmp_path / tile.files[0], process=False) for tile in report.tiles]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    begins = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([m.faces + b for m, b in zip(meshes, begins, strict=False)])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert report.origin == zero
    assert np.allclose(low[:2] + report.origin[:2], (1000, 2000))
    assert np.allclose(high[:2] + report.origin[:2], (1010, 2010))
    unique, index = np.unique(vertices, axis=0, return_inverse=True)
    edges = np.sort(index.reshape(-1)[faces][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    pairs, runs = np.unique(edges, axis=0, return_counts=True)
    p, q = (unique[pairs[runs % 2 == 1][:, k]] for k in range(2))
    rim = np.zeros(len(p), bool)
    for axis in (0, 1):
        for side in (low[axis], high[axis]):
            rim |= (p[:, axis] == side) & (q[:, axis] == side)
    assert len(rim) and rim.all()


def test_what_is_there_is_refused_or_replaced(terrain: Terrain, tmp_path: Path) -> None:
    def export(**options: Any) -> None:
        exported_tiles(terrain, tmp_path, ".obj", 0.01, **options)

    (tmp_path / "mesh_of_mine.obj").write_text("mine")
    export(rows=2, columns=2)
    before = (tmp_path / INDEX).read_bytes()
    with pytest.raises(WriteError, match="exists already"):
        export(rows=1, columns=1)
    (tmp_path / INDEX).unlink()
    with pytest.raises(WriteError, match="exists already"):
        export(rows=1, columns=1)
    export(rows=1, columns=1, overwrite=True)
    assert names_in(tmp_path) == [
        "mesh_00_00.mtl", "mesh_00_00.obj", "mesh_of_mine.obj", INDEX
    ]  # fmt: skip
    export(rows=2, columns=2, overwrite=True)
    assert (tmp_path / INDEX).read_bytes() == before


def test_where_there_is_an_index_all_is_whole(terrain: Terrain, tmp_path: Path) -> None:
    exported_tiles(terrain, tmp_path, ".stl", 0.01, rows=1, columns=2)
    told = []

    def stop(done: int, count: int, faces: int) -> None:
        told.append((done, count, faces > 0))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        exported_tiles(
            terrain, tmp_path, ".stl", 0.01, rows=2, columns=2, overwrite=True, progress=stop
        )
    assert told == [(1, 4, True), (2, 4, True)]
    assert names_in(tmp_path) == ["mesh_00_00.stl", "mesh_00_01.stl"]


def test_a_tile_without_ground_has_no_file(tmp_path: Path) -> None:
    hole = {"type": "f", "cellX": 0, "cellY": 0, "surface": "hole", "span": [3, 1]}
    definition: dict[str, Any] = {
        "size": 4,
        "surfTypes": {"hole": {"void": True}},
        "elemTypes": {"f": {"x": [0]}},
        "elemTree": {"type": "f", "cells": [4, 1], "children": [hole]},
    }
    report = exported_tiles(terrain_of(definition), tmp_path, ".ply", 0.1, rows=1, columns=2)
    assert [tile.files for tile in report.tiles] == [(), ("mesh_00_01.ply",)]
    assert [tile.faces for tile in report.tiles] == [0, 2]
    assert covered(read(tmp_path / "mesh_00_01.ply")) == pytest.approx(4)
    hole["span"] = [4, 1]
    with pytest.raises(RequestError, match="no ground"):
        exported_tiles(
            terrain_of(definition), tmp_path, ".ply", 0.1, rows=1, columns=2, overwrite=True
        )
    assert INDEX not in names_in(tmp_path)


def test_what_makes_no_sense_is_refused(terrain: Terrain, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="suffix"):
        exported_tiles(terrain, tmp_path, ".xyz", 0.1)
    with pytest.raises(RequestError, match="too short"):
        exported_tiles(terrain, tmp_path, ".stl", 0.1, origin="world")
    with pytest.raises(WriteError, match="does not exist"):
        exported_tiles(terrain, tmp_path / "a" / "b", ".stl", 0.1)
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="is no folder"):
        exported_tiles(terrain, tmp_path / "file", ".stl", 0.1)
    assert names_in(tmp_path) == ["file"]
