"""Rays on terrains with decks and bores: columns to the bit, marching in small steps, by hand."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.reader import check
from terratool.field.rays import RayHits
from terratool.field.terrain import Terrain
from terratool.text.source import Source
from tests.budget import examples
from tests.conftest import terrain_of, text_of
from tests.marching import aimed, wrong
from tests.storey_examples import BRIDGE, CAR_PARK, DEFINITIONS, RACK, RIVER, TUNNEL, box
from tests.storey_examples import terrain as storeyed
from tests.storey_trees import lattices, with_storeys
from tests.strategies import definitions

Json = dict[str, Any]
Floats = NDArray[np.float64]

ROUGH: Json = {
    **BRIDGE,
    "surfTypes": {
        **BRIDGE["surfTypes"],
        "road": {"roughness": {"rms": 0.02, "correlation": 0.5}},
        "grass": {"roughness": {"rms": 0.05, "correlation": 0.8, "seed": 3}},
    },
    "tracks": [
        {"path": [[3, 9.7, 4], [37, 9.7, 4]], "width": 0.5, "depth": 0.1},
        {"path": [[20, 1], [20.5, 19]], "width": 0.6, "depth": 0.15, "surface": "rock"},
    ],
}
"""The bridge on rough ground, with a track that leads over it and one below it."""


def one(hits: RayHits, terrain: Terrain) -> tuple[float, str | None, str | None, bool]:
    """Distance, element, surface and wall of one hit."""
    surface = terrain.surfaces[int(hits.surface)] if hits.surface >= 0 else None
    return float(hits.distance), terrain.pointer(int(hits.element)), surface, bool(hits.wall)


@pytest.mark.parametrize("name", DEFINITIONS)
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_upright_rays_meet_the_ends_of_columns_to_the_last_bit(name: str, way: float) -> None:
    terrain = terrain_of(DEFINITIONS[name])
    rng = np.random.default_rng(7)
    west, south, east, north = terrain.bounds
    x, y = rng.uniform([[west], [south]], [[east], [north]], (2, 1000))
    column = terrain.column(x, y)
    ends = np.concatenate([column.bottom, column.top], axis=1)
    numbers = np.concatenate([column.under, column.element], axis=1)
    ends[~np.isfinite(ends)] = np.nan
    z = rng.uniform(np.nanmin(ends) - 1, np.nanmax(ends) + 1, len(x))
    z[::5] = np.where(np.isnan(ends[::5, -1]), z[::5], ends[::5, -1])  # on an end: it is met there
    ahead = np.where((ends - z[:, None]) * way >= 0, ends, np.nan)
    hits = terrain.cast(np.column_stack([x, y, z]), [0, 0, way])
    some = np.isfinite(hits.distance)
    assert np.array_equal(some, ~np.isnan(ahead).all(axis=1))
    nearest = np.nanargmin(ahead[some] * way, axis=1)
    rays = np.arange(some.sum())
    assert np.array_equal(hits.point[some, 2], ahead[some][rays, nearest])
    assert np.array_equal(hits.element[some], numbers[some][rays, nearest])
    assert (hits.normal[some, 2] * way < 0).all()
    tops = nearest >= column.top.shape[1]
    place = nearest[tops] - column.top.shape[1]
    assert np.array_equal(
        np.abs(hits.normal[some][tops]),
        np.abs(column.normal[some][np.flatnonzero(tops), place]),
    )


def compared(terrain: Terrain, seed: int, rays: int, steps: int) -> RayHits:
    origins, ways = aimed(terrain, np.random.default_rng(seed), rays)
    hits = terrain.cast(origins, ways)
    found = wrong(terrain, hits, origins, ways, steps)
    assert not len(found), (origins[found[0]].tolist(), ways[found[0]].tolist(), len(found))
    some = np.isfinite(hits.distance)
    facing = np.einsum("ni,ni->n", hits.normal, ways)[some]
    assert (facing <= 1e-9).all()
    assert np.allclose(np.linalg.norm(hits.normal[some], axis=1), 1)
    assert np.allclose(origins[some] + ways[some] * hits.distance[some, None], hits.point[some])
    return hits


@pytest.mark.parametrize("name", [*DEFINITIONS, "rough"])
def test_slanted_rays_meet_what_marching_does(name: str) -> None:
    compared(terrain_of(DEFINITIONS.get(name, ROUGH)), 3, 100, 300)


@pytest.mark.nightly
@pytest.mark.parametrize("name", [*DEFINITIONS, "rough"])
def test_many_slanted_rays_meet_what_marching_does(name: str) -> None:
    compared(terrain_of(DEFINITIONS.get(name, ROUGH)), 4, 100_000 // len(DEFINITIONS), 1000)


@pytest.mark.slow
@settings(max_examples=examples(100), deadline=None)
@given(st.data())
def test_rays_on_random_storeys_meet_what_marching_does(data: st.DataObject) -> None:
    """Without reliefs, which end where a top meets another one, beside no edge."""
    definition = data.draw(lattices() | with_storeys(definitions()))
    definition.pop("tracks", None)
    terrain = terrain_of(definition, roughness=False)
    compared(terrain, data.draw(st.integers(0, 1000)), 40, 200)


def test_between_deck_and_ground_a_ray_passes_and_from_below_it_meets_the_underside() -> None:
    terrain = terrain_of(BRIDGE)
    slab, arch = "/elemTree/children/0", "/elemTree/children/1"
    below = terrain.cast([20, 5, 2], [0, 1, 0])
    assert one(below, terrain) == (math.inf, None, None, False)
    along = terrain.cast([20, 10, 2], [1, 0, 0])
    assert one(along, terrain) == (pytest.approx(7.5), "/elemTree", "grass", False)
    # a slope of 3.5 in 4 upwards: the underside at y = 8 + 3.5 · 4 / 7
    under = terrain.cast([20, 8, 1.5], [0, 4, 4])
    assert one(under, terrain) == (pytest.approx(math.sqrt(8)), slab, "road", False)
    assert under.normal.tolist() == [0, 0, -1]
    side = terrain.cast([20, 5, 3.75], [0, 1, 0])
    assert one(side, terrain)[0] == pytest.approx(3) and bool(side.wall)
    assert side.normal.tolist() == [0, -1, 0]
    other = terrain.cast([20, 13, 3.75], [0, -2, 0])
    assert one(other, terrain) == (pytest.approx(1), slab, "road", True)
    # under the arch: 1 + 2.5 · √(1 − (2u − 1)²) = 2 where 2u − 1 = −√0.84
    inside = terrain.cast([20, 16, 2], [-1, 0, 0])
    assert one(inside, terrain) == (pytest.approx(8 * math.sqrt(0.84)), arch, "rock", False)
    assert inside.normal[2] < 0 < inside.normal[0]


def test_within_a_bore_are_its_floor_its_ceiling_and_its_sides() -> None:
    terrain = terrain_of(TUNNEL)
    bore, hill = "/elemTree/children/1", "/elemTree/children/0"
    through = terrain.cast([1, 5, 2.5], [1, 0, 0])
    assert one(through, terrain) == (math.inf, None, None, False)
    beside = terrain.cast([1, 10, 2.5], [1, 0, 0])  # the hill, 8 · (x − 10) / 20 high
    assert one(beside, terrain) == (pytest.approx(9 + 2.5 / 0.4), hill, "grass", False)
    up = terrain.cast([28, 5, 3], [1, 0, 1])
    assert one(up, terrain) == (pytest.approx(2 * math.sqrt(2)), bore, "road", False)
    assert up.normal.tolist() == [0, 0, -1]
    down = terrain.cast([28, 5, 3], [1, 0, -1])
    assert one(down, terrain) == (pytest.approx(3 * math.sqrt(2)), bore, "road", False)
    north = terrain.cast([28, 5, 3], [0, 1, 0])
    assert one(north, terrain) == (pytest.approx(3), hill, "grass", True)
    assert north.normal.tolist() == [0, -1, 0]
    kerb = terrain.cast([28, 5, 0.1], [0, -1, 0])
    assert one(kerb, terrain) == (
        pytest.approx(2), "/elemTree/children/1/children/0", "rock", True
    )  # fmt: skip
    above = terrain.cast([30, 5, 6], [1, 0, -1])  # begins in the hill, and comes out of the ceiling
    assert one(above, terrain) == (pytest.approx(math.sqrt(2)), bore, "road", False)


def test_in_the_plane_of_an_edge_the_storey_that_has_the_edge_decides() -> None:
    """The south edge of a bore is its own, the north edge is not."""
    terrain = terrain_of(TUNNEL)
    south = terrain.cast([1, 2, 2.5], [1, 0, 0])
    north = terrain.cast([1, 8, 2.5], [1, 0, 0])
    assert south.distance == math.inf
    assert float(north.distance) == pytest.approx(9 + 2.5 / 0.4)
    bridge = terrain_of(BRIDGE)
    south, north = (bridge.cast([20, y, 3.9], [1, 0, 0]) for y in (8, 12))
    assert south.distance == math.inf  # it begins in the deck, and goes on in the bank
    assert float(north.distance) == pytest.approx(9.875)  # the bank is 3.9 high there


def test_along_a_ceiling_a_ray_comes_to_what_is_behind() -> None:
    terrain = terrain_of(TUNNEL)
    low = terrain.cast([21, 5, 5 - 1e-6], [1, 0, 0])
    assert low.distance == math.inf
    high = terrain.cast([21, 5, 5 + 1e-6], [1, 0, 0])  # above the hill until it is 5 m high
    assert float(high.distance) == pytest.approx(1.5, abs=1e-4)


def test_through_a_hole_a_ray_comes_to_the_ground() -> None:
    terrain = terrain_of(CAR_PARK)
    ground = terrain.cast([20.5, 11, 5], [0.1, 0, -1])
    assert one(ground, terrain)[1:] == ("/elemTree", "grass", False)
    beside = terrain.cast([20.5, 11, 5], [1, 0, -1])  # past the rim of the hole
    assert float(beside.point[2]) == 3
    rim = terrain.cast([20.5, 11, 3.4], [1, 0, -0.4])  # z = 2.8 at x = 22
    assert bool(rim.wall) and rim.point[0] == pytest.approx(22)
    assert rim.normal.tolist() == [-1, 0, 0]


def test_the_rim_of_a_void_has_no_wall_and_a_plank_over_it_has_sides() -> None:
    terrain = terrain_of(RIVER)
    bank = terrain.cast([10, 2, 0.5], [-1, 0, 0])  # into the ground beside the void, and on
    assert bank.distance == math.inf
    side = terrain.cast([10, 8, 1.15], [0, 1, 0])
    assert float(side.distance) == pytest.approx(1.5) and bool(side.wall)


def test_a_void_bore_has_a_ceiling_and_sides_and_no_floor() -> None:
    shaft = box(8, 0, 20, 10, vScale=-4, surface="hole", bore={"height": 3})  # 4 - 4 + 3
    root = {"type": "box", "vScale": 4, "surface": "grass", "children": [shaft]}
    terrain = terrain_of(storeyed([30, 10], root))
    above = terrain.cast([12, 5, 5], [1, 0, -1])
    assert one(above, terrain) == (pytest.approx(math.sqrt(2)), "/elemTree", "grass", False)
    below = terrain.cast([12, 5, 1], [1, 0, 1])
    assert one(below, terrain) == (
        pytest.approx(2 * math.sqrt(2)), "/elemTree/children/0", "hole", False
    )  # fmt: skip
    side = terrain.cast([12, 5, 1], [1, 0, 0])
    assert one(side, terrain) == (pytest.approx(8), "/elemTree", "grass", True)
    assert terrain.cast([12, 5, 1], [0.1, 0, -1]).distance == pytest.approx(80 * math.hypot(1, 0.1))


def test_storeys_of_shared_parts_have_the_same_hits_and_names() -> None:
    definition = check(Source("test.json", text_of(RACK).encode()))
    shared, plain = Terrain(definition, share_above=0), terrain_of(RACK)
    assert shared.is_shared and not plain.is_shared
    origins, ways = aimed(plain, np.random.default_rng(5), 300)
    one_way, other = shared.cast(origins, ways), plain.cast(origins, ways)
    assert np.array_equal(one_way.distance, other.distance)
    names = [
        [terrain.pointer(number) for number in hits.element.tolist()]
        for terrain, hits in ((shared, one_way), (plain, other))
    ]
    assert names[0] == names[1]


def test_threads_change_no_bit() -> None:
    terrain = terrain_of(CAR_PARK)
    origins, ways = aimed(terrain, np.random.default_rng(6), 20_000)
    once = terrain.cast(origins, ways, threads=1)
    again = terrain.cast(origins, ways, threads=2)
    for field in fields(once):
        assert getattr(once, field.name).tobytes() == getattr(again, field.name).tobytes()


def test_short_numbers_name_the_same_elements() -> None:
    terrain = terrain_of(ROUGH)
    origins, ways = aimed(terrain, np.random.default_rng(8), 500)
    numbers = np.unique(terrain.cast(origins, ways).element)
    short = terrain.short_numbers(numbers)
    assert short.max() < 100 and len(np.unique(short)) == len(numbers)
    assert [terrain.pointer(n) for n in short.tolist()] == [
        terrain.pointer(n) for n in numbers.tolist()
    ]


def test_where_no_storey_is_hits_are_those_of_the_ground() -> None:
    definition = deepcopy(TUNNEL)
    del definition["elemTree"]["children"][1:]
    ground, terrain = terrain_of(definition), terrain_of(TUNNEL)
    rng = np.random.default_rng(9)
    origins = rng.uniform([0, 8.5, 0], [60, 11.5, 9], (2000, 3))
    ways = rng.normal(size=(2000, 3)) * [1, 0.01, 1]
    once, again = ground.cast(origins, ways), terrain.cast(origins, ways)
    assert np.isfinite(once.distance).sum() > 500
    beside = (np.abs(once.point[:, 1] - 10) < 2) | np.isinf(once.distance)
    for field in fields(once):
        one_way, other = getattr(once, field.name)[beside], getattr(again, field.name)[beside]
        assert one_way.tobytes() == other.tobytes()
