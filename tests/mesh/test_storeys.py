"""Meshes of decks and bores: what is solid in the columns is solid in the mesh, and closed."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import assume, given, settings

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.mesh.export import MeshOptions, export_mesh, fitted_mesh, loss_of
from terratool.mesh.stacked import build_all
from terratool.mesh.types import BuiltMesh, Mesh
from tests.budget import examples
from tests.conftest import terrain_of
from tests.storey_examples import BRIDGE, CAR_PARK, DEFINITIONS, MUSHROOM, TUNNEL, box, terrain
from tests.storey_trees import lattices
from tests.viewers import READERS

Json = dict[str, Any]
ERROR = 0.01
BASE = -20.0


def ends_of(mesh: Mesh, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights at which vertical rays meet faces, (n, k), from below; NaN where there are fewer.

    They are those of undersides and tops in turn, the first one a top where it is ground.
    """
    corners = (mesh.vertices + mesh.origin)[mesh.faces[~mesh.walls]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    point, face = tree.query(shapely.points(x, y))
    a, b, c = np.moveaxis(corners[face], 1, 0)
    p = np.column_stack([x, y])[point]

    def twice(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])

    whole = twice(b - a, c - a)
    weights = np.array([twice(b[:, :2] - p, c[:, :2] - p), twice(c[:, :2] - p, a[:, :2] - p)])
    weights = np.vstack([weights, whole - weights.sum(axis=0)]) / whole
    hit = (weights > 0).all(axis=0)
    z = (weights[0] * a[:, 2] + weights[1] * b[:, 2] + weights[2] * c[:, 2])[hit]
    point, up = point[hit], whole[hit] > 0
    order = np.lexsort([z, point])
    point, z, up = point[order], z[order], up[order]
    first = np.searchsorted(point, np.arange(len(x) + 1))
    count = np.diff(first)
    place = np.arange(len(z)) - first[point]
    # from above: tops and undersides in turn
    assert (up == ((count[point] - place) % 2 == 1)).all()
    out = np.full((len(x), int(count.max(initial=1))), np.nan)
    out[point, place] = z
    return out


def wanted_ends(terrain: Terrain, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The same of columns."""
    column = terrain.column(x, y)
    both = np.stack([column.bottom, column.top], axis=2).reshape(len(x), -1)
    both[np.isneginf(both)] = np.nan
    order = np.argsort(np.isnan(both), axis=1, kind="stable")
    return np.take_along_axis(both, order, axis=1)


def off(terrain: Terrain, mesh: Mesh, count: int, aside: float) -> np.ndarray:
    """How far rays are from columns at random points, (count,); infinite for other faces.

    A point counts as the nearest of those up to `aside` around it.
    """
    rng = np.random.default_rng(len(mesh.faces))
    x, y = rng.uniform(terrain.bounds[:2], terrain.bounds[2:], (count, 2)).T
    found = ends_of(mesh, x, y)
    best = np.full(count, np.inf)
    shifts = product((1 / 3, 1), (0, 1, -1), (0, 1, -1))
    for dx, dy in ((scale * dx, scale * dy) for scale, dx, dy in shifts):
        left = np.flatnonzero(best > ERROR)
        if not len(left):
            break
        wanted = wanted_ends(terrain, x[left] + dx * aside, y[left] + dy * aside)
        wide = max(found.shape[1], wanted.shape[1])
        ends, own = (
            np.pad(one, ((0, 0), (0, wide - one.shape[1])), constant_values=np.nan)
            for one in (found[left], wanted)
        )
        same = (np.isnan(ends) == np.isnan(own)).all(axis=1)
        apart = np.nan_to_num(np.abs(ends - own)).max(axis=1)
        best[left] = np.minimum(best[left], np.where(same, apart, np.inf))
    return best


def whole(built: BuiltMesh) -> trimesh.Trimesh:
    mesh = built.mesh
    return trimesh.Trimesh(mesh.vertices + mesh.origin, mesh.faces, process=False)


def check_solid(built: BuiltMesh) -> trimesh.Trimesh:
    found = whole(built)
    assert found.is_watertight and found.is_winding_consistent
    edges = np.sort(found.edges, axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", DEFINITIONS)
def test_vertical_rays_meet_what_columns_have(name: str) -> None:
    """Beside the rim of a disc a polygon is right for a place up to `aside` away."""
    terrain = terrain_of(DEFINITIONS[name])
    built = build_all(terrain, ERROR)
    assert built.error <= ERROR
    apart = off(terrain, built.mesh, 10_000, 3 * max(built.loss.wall_offset, 1e-6))
    # a line where surfaces meet is as far aside as the error takes it: of the tunnel 1 cm by 1:5
    assert (apart > built.error + 1e-9).sum() <= 5
    assert apart[np.isfinite(apart)].max() <= 2 * ERROR


@pytest.mark.slow
@pytest.mark.parametrize("name", DEFINITIONS)
def test_solids_are_closed_and_hold_what_columns_do(name: str) -> None:
    terrain = terrain_of(DEFINITIONS[name])
    built = build_all(terrain, ERROR, base=BASE)
    west, south, east, north = terrain.bounds
    x = west + (np.arange(400) + 0.5) / 400 * (east - west)
    y = south + (np.arange(300) + 0.5) / 300 * (north - south)
    column = terrain.column(*np.meshgrid(x, y))
    thick = np.nansum(column.top - np.maximum(column.bottom, BASE), axis=2)
    area = (east - west) * (north - south)
    assert check_solid(built).volume == pytest.approx(thick.mean() * area, abs=0.3 * ERROR * area)


@pytest.mark.slow
@pytest.mark.parametrize("name", DEFINITIONS)
def test_manifold_takes_solids(name: str) -> None:
    manifold = pytest.importorskip("manifold3d", reason="manifold3d is not installed")
    mesh = build_all(terrain_of(DEFINITIONS[name]), 5 * ERROR, base="below").mesh
    taken = manifold.Manifold(
        manifold.Mesh64(vert_properties=mesh.vertices, tri_verts=mesh.faces.astype(np.uint64))
    )
    assert taken.status() == manifold.Error.NoError
    assert taken.volume() == pytest.approx(whole_volume(mesh))


def whole_volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


@settings(max_examples=examples(20), deadline=None)
@given(lattices())
@pytest.mark.nightly
def test_random_terrains(definition: Json) -> None:
    """Faces that touch, decks in decks, bores through bores, voids: every edge has two faces."""
    terrain = terrain_of(definition)
    built = build_all(terrain, 0.1)
    assume(len(built.mesh.faces))  # it may all be void
    check_solid(build_all(terrain, 0.1, base="below"))
    aside = built.loss.wall_offset
    apart = off(terrain, built.mesh, 2000, 3 * aside + 1e-6)
    # in corners beside arcs what is near may be a third thing
    assert (apart > built.error + 1e-6).sum() <= (20 if aside else 5)


# --- by hand --------------------------------------------------------------------------------------


def on_plain(size: list[float], *children: Json) -> Json:
    tree = {"type": "box", "vScale": 0, "surface": "grass", "children": list(children)}
    return terrain(size, tree)


def plate(**more: Any) -> Json:
    return on_plain([12, 8], box(2, 3, 7, 5, **more))


def test_a_deck_alone_is_a_box() -> None:
    """Five by two by half: twelve faces, and the ground is what it was."""
    deck = {"thickness": 0.5}
    built = build_all(terrain_of(plate(vScale=2, surface="road", deck=deck)), ERROR)
    parts = whole(built).split(only_watertight=False, repair=False)
    ground, deck_part = sorted(parts, key=lambda one: one.is_watertight)
    assert deck_part.is_watertight and deck_part.volume == pytest.approx(5 * 2 * 0.5)
    assert np.allclose(deck_part.bounds, [[2, 3, 1.5], [7, 5, 2]])
    assert ground.area == pytest.approx(12 * 8)
    assert built.storeys is not None
    assert built.storeys.volume == pytest.approx(5) and built.storeys.area == pytest.approx(10)
    worn = np.bincount(built.mesh.surfaces, weights=whole(built).area_faces)
    assert worn[:2] == pytest.approx([12 * 8, 2 * 5 * 2 + 2 * (5 + 2) * 0.5])


def test_decks_that_touch_in_an_edge_stay_apart() -> None:
    """Corner to corner: four sides meet in one upright edge, of which each deck has its own."""
    decks = [
        box(k, k, k + 2, k + 2, vScale=2, surface="road", deck={"thickness": 0.5}) for k in (2, 4)
    ]
    built = build_all(terrain_of(on_plain([12, 8], *decks)), ERROR, base=-1.0)
    found = check_solid(built)
    assert [one.volume for one in found.split(repair=False)] == pytest.approx([96, 2, 2])


def test_the_underside_of_an_arch_is_round() -> None:
    """A deck from 1 to 4 over 16 by 4, of which half an ellipse 2.5 high is taken out."""
    arch = {"under": "along", "vScale": 2.5, "vOffset": 1, "datum": True}
    definition = on_plain([20, 8], box(2, 2, 18, 6, vScale=4, surface="rock", deck=arch))
    built = build_all(terrain_of(definition), ERROR)
    part = max(whole(built).split(only_watertight=True, repair=False), key=lambda one: one.volume)
    assert part.volume == pytest.approx((16 * 3 - math.pi / 4 * 16 * 2.5) * 4, abs=ERROR * 64)


def test_the_car_park_by_hand() -> None:
    """The floor of 20 by 20 with a hole of 2 by 2, the roof, and the ramp in the open."""
    built = build_all(terrain_of(CAR_PARK), ERROR, base=BASE)
    foot = 0.25 / 0.3  # where the ramp's underside leaves the ground
    ramp = 4 * (0.3 * foot**2 / 2 + 0.25 * (10 - foot))
    free = 396 * 0.25 + 80 * 0.2 + ramp - 4 * 0.3 * foot**2 / 2
    assert check_solid(built).volume == pytest.approx(600 * 20 + 396 * 0.25 + 80 * 0.2 + ramp)
    assert built.storeys is not None
    assert built.storeys.volume == pytest.approx(free)
    assert built.storeys.area == pytest.approx(396 + 4 * (10 - foot))
    # the ramp grows out of the ground and into the floor; the roof is apart
    assert len(whole(built).split(only_watertight=True, repair=False)) == 2


def test_a_bore_through_a_block_is_open_at_both_ends() -> None:
    """A tunnel 2 wide and 1 high through a block 5 long and 3 high: floor, ceiling and sides."""
    bore = box(0, 3, 12, 5, vScale=0, surface="road", bore={"height": 1, "datum": True})
    block = on_plain([12, 8], box(2, 1, 7, 7, vScale=3, surface="rock"), bore)
    built = build_all(terrain_of(block), ERROR, base=-1.0)
    found = check_solid(built)
    assert found.volume == pytest.approx(12 * 8 * 1 + 5 * 6 * 3 - 5 * 2 * 1)
    assert found.euler_number == 0  # a ring
    mesh = built.mesh
    worn = found.area_faces
    names = np.array([*mesh.names, ""])[mesh.surfaces]
    # in the block the floor, the ceiling and two sides are of the bore; outside it takes nothing
    assert worn[names == "road"].sum() == pytest.approx(5 * (2 + 2 + 1 + 1))
    ways = found.face_normals[names == "road"]
    assert sorted(set(map(tuple, np.round(ways).astype(int).tolist()))) == [
        (0, -1, 0), (0, 0, -1), (0, 0, 1), (0, 1, 0),
    ]  # fmt: skip
    front = names == "rock"
    assert worn[front].sum() == pytest.approx(5 * 6 + 2 * (6 * 3 - 2 * 1) + 2 * 5 * 3)


def test_a_cutting_shows_its_floor() -> None:
    """A bore that is as high as the ground or higher is open to the sky."""
    cutting = plate(vScale=-1, surface="road", bore={"height": 4})
    built = build_all(terrain_of(cutting), ERROR)
    assert set(np.unique(built.mesh.vertices[:, 2])) == {-1.0, 0.0}
    mesh = built.mesh
    level = whole(built).area_faces[~mesh.walls]
    assert level[mesh.surfaces[~mesh.walls] == 1].sum() == pytest.approx(10)
    assert level.sum() == pytest.approx(96)
    # without a solid, the rim of the terrain is all that is open
    edges, counts = np.unique(np.sort(whole(built).edges, axis=1), axis=0, return_counts=True)
    ends = mesh.vertices[edges[counts == 1]]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(40)


def test_undersides_wear_the_surface_of_the_deck_itself() -> None:
    """A pallet on a shelf changes the top alone."""
    built = build_all(terrain_of(MUSHROOM), 0.05)
    mesh, found = built.mesh, whole(built)
    under = (found.face_normals[:, 2] < -0.9) & ~mesh.walls
    assert set(mesh.surfaces[under]) == {mesh.names.index("rock")}


def test_ruts_lie_on_the_tops_that_paths_are_on() -> None:
    """One across the valley over all that is solid from below, and one along the bridge."""
    tracks = [
        {"path": [[20, 2], [20, 18]], "width": 1, "depth": 0.3},
        {"path": [[9, 11, 4], [31, 11, 4]], "width": 0.4, "depth": 0.2},
    ]
    terrain = terrain_of(BRIDGE | {"tracks": tracks})
    built = build_all(terrain, ERROR)
    x, y = np.array([20.1, 20.1, 24.0, 24.0]), np.array([10.0, 11.0, 11.0, 9.0])
    ends = ends_of(built.mesh, x, y)
    assert ends[0] == pytest.approx([-0.3, 3.5, 4.0])
    assert ends[1] == pytest.approx([-0.3, 3.5, 3.8])
    assert ends[2] == pytest.approx([0, 3.5, 3.8])
    assert ends[3] == pytest.approx([0, 3.5, 4.0])


def test_a_rut_in_a_tunnel_is_in_its_floor() -> None:
    """The hill above, as high as its curve says, has none."""
    tracks = [{"path": [[12, 5], [48, 5]], "width": 1, "depth": 0.1}]
    mesh = build_all(terrain_of(TUNNEL | {"tracks": tracks}), 0.2).mesh
    wanted = [-0.1, 5, 8 * (1 - abs(33 - 30) / 20)]
    assert ends_of(mesh, np.array([33.0]), np.array([5.1]))[0] == pytest.approx(wanted)


@pytest.mark.slow
def test_relief_is_on_tops_alone() -> None:
    rough = {"road": {"roughness": {"rms": 0.02, "correlation": 2}}}
    terrain = terrain_of(CAR_PARK | {"surfTypes": CAR_PARK["surfTypes"] | rough})
    built = build_all(terrain, ERROR)
    rng = np.random.default_rng(3)
    x, y = rng.uniform((12, 1), (25, 9), (500, 2)).T
    found, wanted = ends_of(built.mesh, x, y), wanted_ends(terrain, x, y)[:, :3]
    assert np.ptp(wanted[:, 2]) > 0.05
    assert np.abs(found - wanted).max() <= built.error + 1e-9
    assert np.abs(found[:, 1] - 2.75).max() < 1e-9
    check_solid(build_all(terrain, ERROR, base="below"))


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "reader"),
    [(suffix, reader) for suffix, readers in READERS.items() for reader in readers],
)
def test_others_read_all_faces(suffix: str, reader: Any, tmp_path: Path) -> None:
    grey = {name: {"color": [128, 128, 128]} for name in ("grass", "road", "rock")}
    terrain = terrain_of(CAR_PARK | {"surfTypes": CAR_PARK["surfTypes"] | grey})
    report = export_mesh(terrain, tmp_path / f"park{suffix}", MeshOptions(solid=True))
    assert len(reader(tmp_path / f"park{suffix}").triangles) == report.faces


def test_the_statement_counts_storeys() -> None:
    terrain = terrain_of(CAR_PARK)
    options = MeshOptions(max_error=ERROR)
    loss = loss_of(terrain, fitted_mesh(terrain, options).fit, options, ERROR)
    assert list(loss.sentences())[1] == "Storeys: 3 decks; 124 m³ stand over gaps of 433 m²."


def test_a_part_of_a_terrain() -> None:
    """Bounds cut the slab: it is closed where they do."""
    options = MeshOptions(max_error=ERROR, bounds=(16, 6, 22, 10), solid=True, base=-1)
    built = fitted_mesh(terrain_of(BRIDGE), options).fit.built
    found = check_solid(built)
    assert np.allclose(found.bounds, [[16, 6, -1], [22, 10, 4.15]])
    assert found.volume == pytest.approx(6 * 4 + 6 * 2 * 0.5 + 6 * 0.4 * 0.15)
    with pytest.raises(RequestError, match=r"base at 0 is not below"):
        fitted_mesh(terrain_of(BRIDGE), MeshOptions(solid=True, base=0))


def test_a_budget_of_faces() -> None:
    options = MeshOptions(max_error=1e-3, max_faces=1500)
    fit = fitted_mesh(terrain_of(BRIDGE), options).fit
    assert fit.faces <= 1500 and fit.built.storeys is not None
