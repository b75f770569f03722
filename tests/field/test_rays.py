"""Rays against a slow reading that shares no code with them, and by hand."""

from __future__ import annotations

import math
import pickle
from collections import Counter
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.rays import RayHits
from terratool.field.terrain import Terrain
from terratool.field.types import OUTSIDE
from tests.budget import examples
from tests.conftest import terrain_of
from tests.oracle import Oracle
from tests.rays import ABOVE, RayOracle, Rays, Reading, Stretches
from tests.strategies import SURFACES, definitions, landmarks

EXAMPLES = examples(25)
RAYS = 40
TOLERANCE = 2e-6  # of heights, as in test_properties
Json = dict[str, Any]
Floats = NDArray[np.float64]

SHAPES: Json = {
    "post": {"x": [1]},
    "ramp": {"x": [0, 1]},
    "dome": {"x": "dome", "y": []},
    "gauss": {"x": "gauss", "y": "cosbell"},
    "saddle": {"x": [-1, 1], "y": [-1, 0.5, 1]},
    "sum": {"x": [0, 0.3], "y": "t**2", "combine": "sum"},
    "pyramid": {"x": "tent", "y": [], "combine": "min"},
    "trough": {"x": [1, 0, 1], "y": [0.5, 0.2, 0.9], "combine": "max"},
    "stairs": {"x": [[0, 0.1], [0.3, 0.1], [0.3, 0.4], [0.6, 0.5], [0.6, 1], [1, 0.9]]},
    "kerbs": {
        "x": [[0, 0], [0.5, 0], [0.5, 0.3], [1, 0.5]],
        "y": [[0, 0.4], [0.25, 0.1], [0.25, 0.7], [1, 0]],
        "combine": "sum",
    },
    "column": {"x": [1], "combine": "radial"},
    "tower": {"x": [[0, 0], [0.75, 1], [0.75, 0.4], [1, 0.4]], "combine": "radial"},
    "mound": {"x": "cosbell", "combine": "radial"},
    "ball": {"x": "dome", "combine": "radial"},
    "waves": {"x": "sin(6*pi*t)", "y": [[0, 0], [0.3, 1], [1, 0.2]]},
    "dunes": {"grid": [[0, 0.4, 0.1, 0.7, 0.3], [0.9, 0, 0.6, 1, 0.2], [0.2, 0.5, 0.1, 0, 0.8]]},
    "pits": {
        "grid": [[0.3, 0.1, None, 0.6, 0.2], [0.8, 0.5, 0, 1, 0.4], [None, 0.2, 0.7, 0.1, 0.9]],
        "registration": "pixel",
    },
}


def crowded(rng: np.random.Generator) -> Json:
    """An oblong terrain of many shapes with thin posts, at free places and deep in cells."""
    w, h = rng.uniform(5, 40, 2).round(3)
    solid = ["grass", "rock", "sand", "gravel", "stony"]

    def element(kind: str, place: Json) -> Json:
        found = {"type": kind, **place}
        if rng.random() < 0.5:
            found["surface"] = str(rng.choice([*solid, "grass", "hole"]))
        found["vScale"] = round(float(rng.uniform(-1, 3)), 3)
        if rng.random() < 0.3:
            found["vOffset"] = round(float(rng.uniform(-1, 1)), 3)
        if rng.random() < 0.5:
            found["turnDeg"] = float(rng.choice([90, 180, 30, 45, rng.uniform(-180, 180)]))
        return found

    children: list[Json] = []
    for _ in range(rng.integers(3, 9)):
        kind = str(rng.choice([*SHAPES]))
        if rng.random() < 0.5:  # thin ones among them
            extent = [float(min(w, h) * rng.choice([1e-4, 1e-3, 0.05, 0.3])) for _ in "xy"]
            reach = math.hypot(*extent) / 2
            at = [float(rng.uniform(reach, side - reach)) for side in (w, h)]
            children.append(element(kind, {"at": at, "extent": extent}))
        else:
            i, j = (int(k) for k in rng.integers(0, 4, 2))
            span = [int(rng.integers(1, 5 - i)), int(rng.integers(1, 5 - j))]
            children.append(element(kind, {"cellX": i, "cellY": j, "span": span}))
    nested: Json = {}
    for _ in range(rng.integers(0, 7)):  # from the finest out
        i, j = (int(k) for k in rng.integers(0, 3, 2))
        nested = {
            **element(str(rng.choice([*SHAPES])), {"cellX": i, "cellY": j}),
            "cells": 3, "children": [nested] if nested else [],
        }  # fmt: skip
    if nested:
        children.append({**nested, "cellX": 1, "cellY": 2})
    post = {"type": "post", "cellX": 4321, "cellY": 77, "vScale": 2.5}
    children.append({"type": "ramp", "cellX": 3, "cellY": 0, "cells": 9999, "children": [post]})
    found = {
        "size": [float(w), float(h)],
        "origin": [[0, 0], [-3.25, 7.1], [500000.25, 4649776.5]][rng.integers(3)],
        "surfTypes": SURFACES,
        "elemTypes": SHAPES,
        "elemTree": {
            "type": str(rng.choice(["ramp", "sum", "saddle", "post"])),
            "surface": "rock", "cells": 4, "children": children,
        },
    }  # fmt: skip
    if rng.random() < 0.4:
        low = found["origin"]
        path = [[low[0] + w * rng.uniform(-0.1, 1.1), low[1] + h * rng.uniform()] for _ in range(4)]
        track = {"path": path, "width": float(0.1 * min(w, h)), "depth": 0.3}
        found["tracks"] = [track, {**track, "path": path[::-1][:2], "surface": "sand"}]
    return found


def aimed(rng: np.random.Generator, terrain: Terrain, count: int) -> tuple[Floats, Floats]:
    """Rays from anywhere around a terrain to what stands on it, in it and beside it."""
    west, south, east, north = terrain.bounds
    sides = np.array([east - west, north - south])
    cells = terrain.cells().T[rng.integers(0, terrain.elements, count)]
    low, wide = cells[:, :2], cells[:, 2:] - cells[:, :2]
    parts = rng.uniform(0, 1, (count, 2))
    near_edge = rng.random((count, 2)) < 0.2
    parts = np.where(near_edge, rng.choice([0.0, 1.0], (count, 2)) + parts * 1e-3, parts)
    target = np.column_stack([low + parts * wide, np.zeros(count)])
    ground = terrain.height(target[:, 0], target[:, 1])
    heights = terrain.height(*(np.array([[west], [south]]) + sides[:, None] * rng.random((2, 200))))
    least, most = np.nanmin([*heights, 0]), np.nanmax([*heights, 0])
    tall = max(most - least, 0.1 * sides.max())
    target[:, 2] = np.where(
        np.isnan(ground) | (rng.random(count) < 0.4), rng.uniform(least, most, count), ground
    )
    beyond = np.where(rng.random((count, 1)) < 0.2, 1.0, 0.0)
    across = rng.uniform(-beyond, 1 + beyond, (count, 2))
    origin = np.column_stack(
        [[west, south] + sides * across, rng.uniform(least - 0.3 * tall, most + tall, count)]
    )
    way = target - origin
    kind = rng.integers(0, 12, count)  # one in four of them along one of the axes' planes
    for axis in range(3):
        origin[kind == axis, axis] = target[kind == axis, axis]
        way[kind == axis, axis] = 0.0
    return origin, way * 10.0 ** rng.integers(-3, 4, (count, 1))


@dataclass(frozen=True)
class Beside:
    """The ground a little before a ray gets through it and a little behind, by the slow reading.

    Attributes:
        jump: how far it is from the one to the other.
        smooth: how far it may be where the ground does not jump.
        depth: how far the ray is from both at least.
        tops: the elements that decide there; None where that is not sure.
    """

    jump: float
    smooth: float
    depth: float
    tops: tuple[int | None, int | None]


def beside(oracle: RayOracle, rays: Rays, readings: list[Reading]) -> dict[int, Beside]:
    """What is beside the crossings of rays, by their numbers; not where an edge is too near."""
    which = [n for n, reading in enumerate(readings) if reading.crossing is not None]
    grain = 16 * np.spacing(np.abs(rays.origins).max())
    steps = np.array([max(readings[n].least / 16, grain) for n in which])
    ends = np.array([readings[n].crossing for n in which]).reshape(-1, 2)
    places = np.column_stack(
        [ends[:, 0] - 3 * steps, ends[:, 0] - steps, ends[:, 1] + steps, ends[:, 1] + 3 * steps]
    )
    flat = places.ravel()
    ground = oracle.below(rays, Stretches(np.repeat(np.array(which, np.int64), 4), flat, flat))
    spread = (ground.z.high - ground.z.low).reshape(-1, 4)
    z = ground.z.low.reshape(-1, 4) + spread / 2
    heights = rays.origins[which, 2:] + rays.ways[which, 2:] * places
    tops = np.where(ground.one_top, ground.top, -9).reshape(-1, 4)[:, 1:3]
    slopes = np.maximum(abs(z[:, 1] - z[:, 0]), abs(z[:, 3] - z[:, 2])) / (2 * steps)
    smooth = slopes * (places[:, 2] - places[:, 1]) + 2 * ground.rounding.reshape(-1, 4).max(axis=1)
    return {
        n: Beside(
            float(abs(z[k, 2] - z[k, 1])),
            float(smooth[k]),
            float(np.abs(heights[k, 1:3] - z[k, 1:3]).min()),
            tuple(None if top == -9 else int(top) for top in tops[k]),  # type: ignore[arg-type]
        )
        for k, n in enumerate(which)
        if (spread[k] <= 1e-3 * (1.0 + np.abs(z[k]))).all()
    }


@dataclass(frozen=True)
class Ray:
    """One ray, and what the slow reading says of it.

    Attributes:
        origin: (3,) where it begins.
        way: (3,) where it goes, 1 long.
        reading: where it gets through the ground.
        beside: what is there, where that could be told.
    """

    origin: Floats
    way: Floats
    reading: Reading
    beside: Beside | None

    def __str__(self) -> str:
        return f"{self.origin.tolist()} {self.way.tolist()} {self.reading}"


def judged(terrain: Terrain, oracle: RayOracle, hit: RayHits, ray: Ray) -> list[str]:
    """What could be told of a ray, where its hit says the same.

    Raises:
        AssertionError: it does not.
    """
    reading, distance = ray.reading, float(hit.distance)
    slack, where = 10 * reading.least, f"{hit} {ray}"
    if any(low - slack <= distance <= high + slack for low, high in reading.grazes):
        return ["graze"]
    if not reading.told:
        return ["not told"]
    if reading.crossing is None:
        assert distance == math.inf or abs(distance - reading.last) <= slack, where
        return ["nothing"]
    low, high = reading.crossing
    assert low - slack <= distance <= high + slack, where
    point = ray.origin + ray.way * distance
    scale = np.abs([*ray.origin, *point]).max()
    assert np.allclose(hit.point, point, rtol=0, atol=1e-14 * scale), where
    assert abs(np.linalg.norm(hit.normal) - 1.0) <= 1e-12, where
    assert hit.normal @ ray.way <= 1e-9, where
    if told_from_rounding(terrain):
        assert hit.surface in surfaces_near(terrain, hit), where
    said = ["loose" if high - low > 2 * slack else "same"]
    return said if ray.beside is None else said + described(terrain, oracle, hit, ray)


def described(terrain: Terrain, oracle: RayOracle, hit: RayHits, ray: Ray) -> list[str]:
    """What could be told of what a ray meets, where the hit says the same."""
    assert ray.beside is not None
    near, where = ray.beside, f"{hit} {ray}"
    assert ray.reading.crossing is not None
    loose = np.ptp(ray.reading.crossing) > 20 * ray.reading.least  # may begin at a dome's rim
    pointer, (before, behind) = terrain.pointer(int(hit.element)), near.tops
    if near.depth > 20 * near.smooth and near.depth > 1e-6 and not loose:
        said = ["wall"]
        assert hit.wall, where
        higher = behind if ray.reading.side == ABOVE else before
        if higher is not None:
            assert pointer == oracle.pointer(higher), where
            said.append("element of a wall")
        return said + upright(terrain, hit, ray)
    if loose or near.jump > 3 * near.smooth:
        return []
    said = ["ground"]
    assert not hit.wall, where
    if before is not None and before == behind:
        assert pointer == oracle.pointer(before), where
        said.append("element of the ground")
    return said + sloped(terrain, hit, ray)


def finest_cell(terrain: Terrain) -> float:
    """The shortest side of all cells."""
    west, south, east, north = terrain.cells()
    return float(min((east - west).min(), (north - south).min()))


def upright(terrain: Terrain, hit: RayHits, ray: Ray) -> list[str]:
    """The height jumps across the line that is square to the normal of a wall."""
    normal, point, where = hit.normal[:2], hit.point[:2], f"{hit} {ray}"
    assert hit.normal[2] == 0.0, where
    west, south, east, north = terrain.bounds
    aside = 1e-8 * min(east - west, north - south)
    if aside < 1e3 * np.spacing(np.abs(point).max()) or aside > 1e-3 * finest_cell(terrain):
        return []
    along = np.array([-normal[1], normal[0]])
    ways = [
        0.0,
        *(side * far for far in (100.0, 10.0, 3.0) for side in (1, -1)),
    ]  # walls may be short
    places = np.array(ways)[:, None] * along * aside
    ahead, behind = (
        terrain.height(*(point + places + side * aside * normal).T) for side in (-1, 1)
    )
    jumps = ahead - behind if ray.reading.side == ABOVE else behind - ahead
    if np.isnan(jumps).any():
        return []
    assert (jumps[1:] > 0.5 * abs(jumps[0])).any(), f"{jumps} {where}"
    return ["normal of a wall"]


def sloped(terrain: Terrain, hit: RayHits, ray: Ray) -> list[str]:
    """The normal is that of the ground there, or where it bends, on one side of there."""
    point = hit.point[:2]
    west, south, east, north = terrain.bounds
    aside = 1e-9 * min(east - west, north - south) + 4 * np.spacing(np.abs(point).max())
    around = aside * np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
    normals = terrain.normal(*(point + around).T) * ray.reading.side
    off = np.abs(normals - hit.normal).max(axis=1)
    bend = np.ptp(normals, axis=0).max()
    if np.isnan(off).any() or bend > 0.1:
        return []
    assert off.min() <= 1e-6 + 10 * bend, f"{off} {hit} {ray}"
    return ["normal of the ground"]


def surfaces_near(terrain: Terrain, hit: RayHits) -> set[int]:
    """Surfaces where a ray hits, and beside it."""
    west, south, east, north = terrain.bounds
    aside = 4e-9 * (east - west + north - south) + 16 * np.spacing(np.abs(hit.point[:2]).max())
    around = hit.point[:2] + aside * np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
    return set(terrain.sample(*around.T).surface.tolist())


def told_from_rounding(terrain: Terrain) -> bool:
    """Whether edges of all cells are far enough from each other to tell on which side a hit is."""
    return finest_cell(terrain) > 1e4 * float(np.spacing(np.abs(terrain.bounds).max()))


def compared(definition: Json, rng: np.random.Generator, count: int) -> Counter[str]:
    """How rays over a terrain agree with the slow reading."""
    terrain, oracle = terrain_of(definition), RayOracle(definition)
    origins, ways = aimed(rng, terrain, count)
    level = (ways[:, :2] == 0.0).all(axis=1)
    ways[level, 0] = ways[level, 2] = 1.0  # upright ones have tests of their own
    most = np.where(rng.random(count) < 0.8, math.inf, rng.uniform(0, 50, count))
    hits = terrain.cast(origins, ways, most, threads=1)
    rays = Rays(origins, ways / np.linalg.norm(ways, axis=1)[:, None])
    readings = oracle.march(rays, most)
    around = beside(oracle, rays, readings) if told_from_rounding(terrain) else {}
    found: Counter[str] = Counter()
    finest = finest_cell(terrain)
    for n, reading in enumerate(readings):
        hit = RayHits(*(getattr(hits, member.name)[n] for member in fields(hits)))
        told = reading.least < 1e-3 * finest  # of edges of narrow cells, what is beside which
        ray = Ray(rays.origins[n], rays.ways[n], reading, around.get(n) if told else None)
        found.update(judged(terrain, oracle, hit, ray))
    return found


# Against the slow reading


@pytest.mark.slow
def test_rays_over_thin_posts_and_walls_agree_with_the_format() -> None:
    total: Counter[str] = Counter()
    for seed in range(EXAMPLES):
        rng = np.random.default_rng(seed)
        total += compared(crowded(rng), rng, RAYS)
    rays = EXAMPLES * RAYS
    assert total["same"] + total["nothing"] > 0.6 * rays
    assert total["wall"] > 0.1 * rays
    assert total["element of a wall"] > 0.5 * total["wall"]
    assert total["normal of a wall"] > 0.5 * total["wall"]
    assert total["ground"] > 0.2 * rays
    assert total["element of the ground"] > 0.9 * total["ground"]


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_rays_agree_with_the_format(data: st.DataObject) -> None:
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    # narrower ones are as narrow as what tells edges from rounding
    assume(all(track["width"] >= 1e-6 for track in definition.get("tracks", [])))
    compared(definition, np.random.default_rng(data.draw(st.integers(0, 2**32))), RAYS)


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_upright_rays_meet_the_height_to_the_last_bit(data: st.DataObject) -> None:
    """On all edges and corners too, from above and from below."""
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    terrain = terrain_of(definition)
    x, y = np.array(landmarks(definition)[:80]).T
    found = terrain.sample(x, y)
    there = ~np.isnan(found.height)
    for z, up in ((1e6, -1.0), (-1e6, 1.0)):  # ruts of many passes may be deep
        hits = terrain.cast(np.column_stack([x, y, np.full(len(x), z)]), [0.0, 0.0, up])
        wanted = np.where(there, (found.height - z) * up, math.inf)
        assert np.array_equal(hits.distance, wanted)
        assert np.array_equal(hits.point[there], np.column_stack([x, y, found.height])[there])
        assert np.isnan(hits.point[~there]).all()
        assert np.array_equal(hits.element, np.where(there, found.element, OUTSIDE))
        assert np.array_equal(hits.surface, np.where(there, found.surface, -1))
        assert np.array_equal(hits.normal[there], found.normal[there] * -up)
        assert not hits.wall.any()


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_along_edges_the_ground_is_that_of_the_points_on_them(data: st.DataObject) -> None:
    """In the planes of the edges of all cells: up to a hit the ground is on one side, at it there.

    Nothing is known of what is beside such a plane, only the heights in it.
    """
    definition = data.draw(definitions(free=data.draw(st.booleans()), gridded=True, classed=True))
    for surface in definition.get("surfTypes", {}).values():
        surface.pop("roughness", None)
        surface.pop("void", None)  # through which a ray may get below the ground
    for primitive in definition["elemTypes"].values():
        if "grid" in primitive:
            primitive["grid"] = [[z or 0 for z in row] for row in primitive["grid"]]
    terrain = terrain_of(definition)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    origins, ways = aimed(rng, terrain, RAYS)
    cells = terrain.cells()
    west, south, east, north = terrain.bounds
    for n in range(RAYS):
        axis, element = n % 2, int(rng.integers(0, terrain.elements))
        origins[n, axis] = cells[axis + 2 * int(rng.integers(0, 2)), element]
        if origins[n, axis] == terrain.bounds[2 + axis]:  # there a step at t = 1 is a line
            origins[n, axis] = terrain.bounds[axis]
        ways[n, axis] = 0.0
        if ways[n, 1 - axis] == 0.0:
            ways[n, 1 - axis] = 1.0
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    reach = 3.0 * (east - west + north - south)
    hits = terrain.cast(origins, ways, reach)
    oracle = Oracle(definition)
    grounds = 0
    for n, distance in enumerate(hits.distance.tolist()):
        far = min(distance, reach)
        rounding = 1e-15 * np.abs(origins[n]).max() / max(far * abs(ways[n, 1 - n % 2]), 1e-300)
        last = max(1 - 1e-7 - rounding, 0.0)
        at = far * np.concatenate([[0.0], np.sort(rng.uniform(0, last, 12)), [last]])
        x, y, z = (origins[n, axis] + ways[n, axis] * at for axis in range(3))
        height = terrain.height(x, y)
        # what is turned, and rounding, may decide beside the plane
        clear = [oracle.margin(*point, cells=False) > 1e-6 for point in zip(x, y, strict=True)]
        told = np.array(clear) & (np.abs(z - height) > TOLERANCE)
        where = f"{origins[n].tolist()} {ways[n].tolist()} {distance}"
        assert np.ptp(np.sign(z - height)[told]) == 0 if told.any() else True, where
        if distance < math.inf and not hits.wall[n]:
            # rounding may put what is met at the rim beyond it
            x, y = np.clip(hits.point[n, :2], [west, south], [east, north]).tolist()
            z = float(hits.point[n, 2])
            if oracle.margin(x, y, cells=False) > 1e-6:
                grounds += 1
                off = oracle.slack(x, y)
                assert abs(terrain.height(x, y) - z) <= TOLERANCE + off, where
    # all edges of what is turned may lie where nothing is told
    turned = "turnDeg" in repr(definition)
    assert grounds > 0 or turned or not np.isfinite(hits.distance).any() or hits.wall.any()


# By hand

FLOOR: Json = {"floor": {"x": [0]}, "box": {"x": [1]}, "disc": {"x": [1], "combine": "radial"}}


def with_floor(*children: Json, **keys: Any) -> Terrain:
    """A level oblong floor with elements on it."""
    root = {"type": "floor", "cells": [20, 12], "children": [*children]}
    found = {"size": [20, 12], "elemTypes": {**FLOOR, **SHAPES}, "elemTree": root}
    return terrain_of({**found, "surfTypes": SURFACES, **keys})


BOX = {"type": "box", "at": [7, 5], "extent": [4, 2], "vScale": 2}


@pytest.mark.parametrize("origin", [[0, 0], [500000, 4649776]])
@pytest.mark.parametrize("degrees", [0, 90, 30, -62.5])
@pytest.mark.parametrize("side", range(4))
def test_a_box_is_seen_from_all_four_sides(side: int, degrees: float, origin: list[int]) -> None:
    """From 3 in front of the middle of each side, and half a metre to the left of that."""
    terrain = with_floor({**BOX, "turnDeg": degrees}, origin=origin)
    turn = -math.radians(degrees)  # clockwise
    ahead = turn + side * math.pi / 2
    normal = np.array([math.cos(ahead), math.sin(ahead), 0.0])
    left = np.array([normal[1], -normal[0], 0.0])
    middle = np.array([origin[0] + 7.0, origin[1] + 5.0, 1.25])
    reach = [2.0, 1.0][side % 2]
    near = 1e-12 if origin == [0, 0] else 2e-9
    near += 4e-9 if degrees else 0.0  # what is turned reaches 1e-9 of its sides further
    hit = terrain.cast(middle + (reach + 3.0) * normal + 0.5 * left, -5.0 * normal)
    assert abs(hit.distance - 3.0) <= near
    assert np.allclose(hit.normal, normal, rtol=0, atol=1e-12)
    assert hit.wall and hit.element == 1
    over = terrain.cast(middle + (reach + 3.0) * normal + [0, 0, 1], -normal)
    assert over.distance == math.inf
    beside = terrain.cast(middle + (reach + 3.0) * normal + 1.5 * left, -normal)
    assert (beside.distance == math.inf) == (side % 2 == 0)


def test_a_disc_is_seen_from_all_around() -> None:
    """In an oblong cell it is an ellipse: (x / 3)² + (y / 1.5)² = 1."""
    for shape, height in (("disc", 2.0), ("tower", 0.5)):
        disc = {"type": shape, "at": [9, 6], "extent": [6, 3], "vScale": 2}
        terrain = with_floor(disc)
        angles = np.linspace(0.1, 6.2, 33)
        rim = np.column_stack([3 * np.cos(angles), 1.5 * np.sin(angles), np.zeros(33)])
        normal = np.column_stack([np.cos(angles) / 3, np.sin(angles) / 1.5, np.zeros(33)])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        askew = normal + 0.3 * np.column_stack([-normal[:, 1], normal[:, 0], 0.2 * normal[:, 0]])
        askew /= np.linalg.norm(askew, axis=1)[:, None]
        start = rim + 2.0 * askew + [9, 6, 0.9 * height]
        hits = terrain.cast(start, -askew)
        assert np.allclose(hits.distance, 2.0, rtol=0, atol=1e-8)  # its rim reaches 1e-9 further
        assert np.allclose(hits.normal, normal, rtol=0, atol=1e-7)
        assert hits.wall.all() and (hits.element == 1).all()
    # and the step inside, at three quarters of the curve, half way out: 0.8 to 1.9
    hits = terrain.cast(rim / 2 + 0.5 * normal + [9, 6, 1.5], -normal)
    assert hits.wall.all()
    assert np.allclose(hits.point[:, :2], rim[:, :2] / 2 + [9, 6], rtol=0, atol=0.15)


def test_a_post_of_a_millimetre_is_not_missed_from_50_metres() -> None:
    """And a ray a millimetre beside it is not stopped."""
    post = {"type": "box", "at": [60, 33], "extent": 0.001, "vScale": 2}
    terrain = terrain_of(
        {"size": [120, 80], "origin": [500000, 4649776], "elemTypes": FLOOR,
         "elemTree": {"type": "floor", "children": [post]}}
    )  # fmt: skip
    middle = np.array([500060.0, 4649809.0, 1.0])
    angles = np.linspace(0.0, 2 * math.pi, 2000)
    ways = np.column_stack([np.cos(angles), np.sin(angles), 0.01 * np.sin(7 * angles)])
    away = np.maximum(np.abs(ways[:, 0]), np.abs(ways[:, 1]))
    for distance in (0.1, 30.0):
        hits = terrain.cast(middle - distance * ways, ways)
        assert hits.wall.all() and (hits.element == 1).all()
        length = np.linalg.norm(ways, axis=1)
        wanted = (distance - 0.0005 / away) * length
        assert np.allclose(hits.distance, wanted, rtol=0, atol=1e-8)
        aside = 0.001 * np.column_stack([-ways[:, 1], ways[:, 0], 0 * angles])
        assert not terrain.cast(middle - distance * ways + aside, ways).wall.any()


def test_steps_inside_a_curve_are_walls() -> None:
    """Stairs along x in an oblong cell: risers at 30 and at 60 hundredths."""
    stairs = {"type": "stairs", "at": [10, 6], "extent": [10, 4], "vScale": 1}
    terrain = with_floor(stairs)
    hits = terrain.cast(
        [[5.5, 6, 0.3], [9.0, 4.5, 0.8], [16, 6, 0.5]], [[1, 0, 0]] * 2 + [[-1, 0, 0]]
    )
    assert np.allclose(hits.distance, [2.5, 2.0, 1.0], rtol=0, atol=1e-12)
    assert hits.wall.all()
    assert hits.normal.tolist() == [[-1, 0, 0], [-1, 0, 0], [1, 0, 0]]
    down = terrain.cast([4.0, 6, 1.4], [1, 0, -0.1])  # over the first, and at 0.7 into the second
    assert down.wall and abs(down.point[0] - 11.0) <= 1e-12


def test_a_step_in_a_cell_of_a_tenth_of_a_millimetre_far_from_zero_is_a_wall() -> None:
    """Coordinates there tell a ten-thousandth of the cell; its step down is at 0.7 of it."""
    step = {"x": [1], "y": [[0, 0], [0.7, 1], [0.7, 0], [1, 0]]}
    origin = [500000.25, 4649776.5]
    post = {"type": "step", "cellX": 0, "cellY": 0, "vScale": 1e-4}
    root = {"type": "floor", "cells": 65536, "children": [post]}
    terrain = terrain_of(
        {"size": 5, "origin": origin, "elemTypes": {**FLOOR, "step": step}, "elemTree": root}
    )
    side = 5 / 65536
    across = np.linspace(0.1, 0.9, 50) * side
    starts = np.column_stack([origin[0] + across + 0.5, np.full(50, origin[1] + 1 + 0.7 * side)])
    hits = terrain.cast(np.column_stack([starts, np.full(50, 5e-5)]), [-0.5, -1, 0])
    assert hits.wall.all() and (hits.normal == [0, 1, 0]).all()
    assert np.allclose(hits.point[:, 1] - origin[1], 0.7 * side, rtol=0, atol=4e-9)


@pytest.mark.parametrize(
    "kind", ["stairs", "kerbs", "sum", "trough", "waves", "tower", "ball", "dunes", "pits"]
)
def test_what_is_turned_by_quarters_is_seen_as_from_elsewhere(kind: str) -> None:
    """The rays turned with it meet the same."""
    rng = np.random.default_rng(3)
    count = 300
    target = np.column_stack([rng.uniform(7, 13, count), rng.uniform(4.5, 7.5, count)])
    starts = np.column_stack([rng.uniform(0, 20, (count, 2)) * [1, 0.6], rng.uniform(0, 3, count)])
    ways = np.column_stack([target, rng.uniform(0, 0.8, count)]) - starts
    middle = np.array([10.0, 6.0, 0.0])

    def hits(quarters: int) -> RayHits:
        turn = math.radians(-90 * quarters)  # clockwise
        turned = np.array(
            [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
        ).round()
        there = {"type": kind, "at": [10, 6], "extent": [6, 3], "vScale": 1.5}
        found = with_floor({**there, "turnDeg": 90 * quarters}).cast(
            (starts - middle) @ turned.T + middle, ways @ turned.T
        )
        return replace(found, point=(found.point - middle) @ turned + middle,
                       normal=found.normal @ turned)  # fmt: skip

    plain = hits(0)
    on_it = plain.element == 1  # the oblong floor does not turn with it
    assert on_it.sum() > 0.4 * count and (kind != "stairs" or plain.wall.sum() > 50)
    for quarters in (1, 2, 3, -1):
        turned = hits(quarters)
        assert np.array_equal(turned.element[on_it], plain.element[on_it])
        assert np.array_equal(turned.wall[on_it], plain.wall[on_it])
        # what is turned reaches 1e-9 of its sides further
        off = np.abs(turned.point - plain.point).max(axis=1)
        assert off[on_it].max() <= 1e-6
        assert np.abs(turned.normal - plain.normal)[on_it].max() <= 1e-5


def test_the_wall_beside_a_ramp_is_of_the_ramp() -> None:
    """Below its surface, on all of its sides but the lowest, among other things."""
    boxes = [{"type": "box", "cellX": k, "cellY": 1, "vScale": 0.5} for k in (1, 18)]
    terrain = with_floor(*boxes, {"type": "ramp", "at": [10, 6], "extent": [6, 4], "vScale": 2})
    y = np.linspace(4.2, 7.8, 20)
    east = terrain.cast(np.column_stack([np.full(20, 16), y, y / 4]), [-1, 0.01, -0.01])
    assert east.wall.all() and (east.element == 3).all() and (east.normal == [1, 0, 0]).all()
    x = np.linspace(9.5, 12.8, 20)
    for start, way in ((2.0, 1.0), (10.0, -1.0)):
        beside = terrain.cast(np.column_stack([x, np.full(20, start), x / 30]), [0.01, way, 0.01])
        assert beside.wall.all() and (beside.element == 3).all()
        assert (beside.normal == [0, -way, 0]).all()


# Between four numbers 0 0 / 1 1, south and north, that are turned against each other, the height is
# a + b − 2ab: along the diagonal a = b = t it is 2t − 2t².
SADDLE: Json = {"saddle": {"grid": [[1, 0], [0, 1]]}}


@pytest.mark.parametrize("origin", [[0, 0], [500000, 4649776.5]])
def test_between_four_numbers_a_ray_meets_a_saddle(origin: list[int]) -> None:
    """Over 8 × 4: level along both diagonals, up to the height of a quarter of the way."""
    found = {"size": [8, 4], "origin": origin, "elemTypes": SADDLE, "elemTree": {"type": "saddle"}}
    terrain = terrain_of(found)
    west, south = origin
    near = 1e-14 * max(*origin, 100)
    up = terrain.cast([west, south, 0.375], [8, 4, 0])
    assert np.allclose(up.point, [west + 2, south + 1, 0.375], rtol=0, atol=near)
    # there a = b = 1/4: slopes of 1/2 to the east of 8 and to the north of 4
    wanted = np.array([-0.5 / 8, -0.5 / 4, 1])
    assert np.allclose(up.normal, wanted / np.linalg.norm(wanted), rtol=0, atol=1e-9)
    assert not up.wall and up.element == 0
    down = terrain.cast([west + 8, south, 0.625], [-8, 4, 0])  # from 1 in the corner, below it
    assert np.allclose(down.point, [west + 6, south + 1, 0.625], rtol=0, atol=near)
    assert down.normal[2] < 0
    assert terrain.cast([west, south, 0.5 + 1e-9], [8, 4, 0]).distance == math.inf


HOLED: Json = {"holed": {"grid": [[1, 1, 1, None, 1], [1, 1, 1, 1, 1], [1, 1, 1, 1, 1]]}}


@pytest.mark.parametrize(("registration", "low", "high"), [("gridline", 5, 10), ("pixel", 6, 8)])
def test_rays_go_through_void_numbers(registration: str, low: float, high: float) -> None:
    """A sheet of 10 × 6 at 1, void in the north from `low` to `high` of x, whatever is on it."""
    sheet = {"holed": {**HOLED["holed"], "registration": registration}}
    post = {"type": "box", "at": [7, 5.5], "extent": [1, 0.5], "vScale": 3}
    terrain = terrain_of(
        {"size": [10, 6], "elemTypes": {**FLOOR, **sheet},
         "elemTree": {"type": "holed", "vScale": 1, "children": [post]}}
    )  # fmt: skip
    south = 3 if registration == "gridline" else 4
    x = np.array([low - 1e-6, low + 1e-6, high - 1e-6, min(high, 9.999998) + 1e-6])
    met = np.array([True, False, False, registration == "pixel"])
    for z, up in ((3.0, -1.0), (-1.0, 1.0)):
        lean = [1e-9, 1e-9, up]
        across = terrain.cast(np.column_stack([x, np.full(4, 5.5), np.full(4, z)]), lean)
        assert np.array_equal(np.isfinite(across.distance), met)
        assert not across.wall.any()
        y = south + np.array([-1e-6, 1e-6])
        along = terrain.cast(np.column_stack([[7, 7], y, [z, z]]), lean)
        assert np.isfinite(along.distance).tolist() == [True, False]
    # level, through the post; aslant, in at one end and out under the sheet, from either side
    assert terrain.cast([0.5, 5.5, 1.5], [1, 0, 0]).distance == math.inf
    begins, middle = np.array([7, 5, 1.25]), np.array([7, 5, 1])
    ways = np.array([[0.1, -1.1, -0.4], [0.1, 1.1, -0.4], [-0.9, 0.1, -0.7], [0.9, 0.1, -0.7]])
    hits = terrain.cast(begins, ways)
    out = middle + 0.25 / -ways[:, 2:] * ways[:, :2] @ np.eye(2, 3)
    holds = (low < out[:, 0]) & (out[:, 0] < high) & (out[:, 1] > south)
    assert np.array_equal(np.isfinite(hits.distance), ~holds)


def test_what_borders_on_void_numbers_has_its_own_slope() -> None:
    """A ramp up to 4 in the west of a void cell; a ray from above it meets it at the line."""
    ramp = {"ramp": {"grid": [[0, 2, 4, 9, None], [0, 2, 4, 9, 9], [0, 2, 4, 9, 9]]}}
    terrain = terrain_of(
        {"size": [8, 4], "elemTypes": ramp, "elemTree": {"type": "ramp", "vScale": 1}}
    )
    for x, slope in ((4 + 1e-9, 2.5), (6 - 1e-9, 2.5), (4 - 1e-9, 1.0)):
        z = float(terrain.height(x, 3.0))
        normal = np.array([-slope, 0, 1]) / math.hypot(slope, 1)
        for way in (np.array([-0.1, 0, -1]), np.array([0.1, 0, -1])):
            hit = terrain.cast([x, 3.0, z] - way, way)
            assert abs(hit.point[0] - x) <= 1e-12
            assert np.allclose(hit.normal, normal, rtol=0, atol=1e-9)
    begins = terrain.cast([6, 3.0, 9], [-1, 0, 1])  # on the ground, where there is none eastward
    assert begins.distance == 0
    towards = np.array([2.5, 0, -1]) / math.hypot(2.5, 1)  # where it comes from
    assert np.allclose(begins.normal, towards, rtol=0, atol=1e-9)


@pytest.mark.parametrize("degrees", [0, 90, 30])
def test_beyond_the_outermost_numbers_of_pixels_the_nearest_goes_on(degrees: float) -> None:
    """A slope of 8 × 4, 8 down ahead, 1 up to the left; it is level along a quarter at each end."""
    slope = {"grid": [[8, 0], [7, -1]], "registration": "pixel"}
    block = {"type": "slope", "at": [10, 6], "extent": [8, 4], "vScale": 1, "turnDeg": degrees}
    shallow = {"path": [[0, 6], [20, 6]], "width": 30, "depth": 0}  # nothing is known beforehand
    terrain = with_floor(block, elemTypes={**FLOOR, "slope": slope}, tracks=[shallow])
    turn = -math.radians(degrees)
    ahead, left = [np.array([math.cos(turn + q), math.sin(turn + q), 0]) for q in (0, math.pi / 2)]
    normal = np.array([0, 0, 1]) - 0.5 * left
    for begins, z in ((-3.9, 7.5), (2.2, -0.5)):  # sinking by 0.05 over 1
        start = np.array([10.0, 6.0, z + 0.05]) + begins * ahead
        hit = terrain.cast(start, ahead - [0, 0, 0.05])
        assert abs(hit.distance - math.hypot(1, 0.05)) <= 1e-12 and not hit.wall
        assert hit.element == 1
        assert np.allclose(hit.normal, normal / np.linalg.norm(normal), rtol=0, atol=1e-12)


@pytest.mark.parametrize("degrees", [0, 90, 30])
def test_the_rim_of_a_grid_is_a_wall(degrees: float) -> None:
    """A block of 4 × 2 in a floor; its heights, on it and beside, are those of queries."""
    block = {"type": "dunes", "at": [7, 5], "extent": [4, 2], "vScale": 2, "vOffset": 0.5}
    terrain = with_floor({**block, "turnDeg": degrees})
    turn = -math.radians(degrees)
    ahead, left = [
        np.array([math.cos(turn + q), math.sin(turn + q), 0.0]) for q in (0, math.pi / 2)
    ]
    # of the east side the numbers are 0.8, 0.2 and 0.3 from the south: at its middle 0.9 are above
    middle = np.array([7.0, 5.0, 0.0])
    for above, met in ((0.88, True), (0.92, False)):
        hit = terrain.cast(middle + 5 * ahead + [0, 0, above], -ahead)
        near = abs(hit.distance - 3.0) <= 1e-8
        assert near == met and (not met or (hit.wall and hit.element == 1))
        if met:
            assert np.allclose(hit.normal, ahead, rtol=0, atol=1e-12)
    # and of the north side 0, 0.4, 0.1, 0.7, 0.3 from the west
    for aside, number in zip(np.arange(-1, 2), (0.4, 0.1, 0.7), strict=True):
        start = middle + aside * ahead + 4 * left
        low, high = (
            terrain.cast([*start[:2], 0.5 + 2 * number + more], -left) for more in (-0.02, 0.02)
        )
        assert low.wall and abs(low.distance - 3.0) <= 1e-8
        assert not high.wall


@pytest.mark.parametrize("origin", [[0, 0], [500000, 4649776.5]])
def test_in_the_plane_of_a_step_what_begins_there_decides(origin: list[float]) -> None:
    """Along all risers of stairs in both directions, at a height between their treads."""
    treads = [[0, 1], *([k / 8, 1 + (k + one) % 2] for k in range(1, 8) for one in (1, 0)), [1, 2]]
    for axis, shape in enumerate(({"x": treads}, {"x": [1], "y": treads})):
        block = {"type": "treads", "at": [7, 6], "extent": [5, 3], "vScale": 1}
        terrain = with_floor(block, origin=origin, elemTypes={**FLOOR, "treads": shape})
        low, length = [(4.5, 5.0), (4.5, 3.0)][axis]
        for k in range(1, 8):
            for beside in (0.0, -1e-6, 1e-6):
                start = np.array([origin[0] + 1, origin[1] + 1, 1.5])
                middle = np.array([origin[0] + 7.0, origin[1] + 6.0])
                start[axis] = middle[axis] = origin[axis] + low + k / 8 * length + beside
                high = terrain.height(*middle) > 1.5
                assert high == ((k - (beside < 0)) % 2 == 1)
                assert terrain.cast(start, np.eye(3)[1 - axis]).wall == high, (axis, k, beside)


# What belongs to which side of an edge is what the format says of points: see docs/format.md.


def test_in_the_plane_of_a_wall_the_cell_that_has_the_edge_decides() -> None:
    """A cell has its west and south edges, so a ray in their planes meets the other walls."""
    terrain = with_floor(BOX)  # from 5, 4 to 9, 6
    along = terrain.cast(
        [[5, 1, 1], [9, 1, 1], [1, 4, 1], [1, 6, 1]], [[0, 1, 0]] * 2 + [[1, 0, 0]] * 2
    )
    assert along.distance.tolist() == [3.0, math.inf, 4.0, math.inf]
    assert along.wall.tolist() == [True, False, True, False]
    assert along.normal[[0, 2]].tolist() == [[0, -1, 0], [-1, 0, 0]]
    # and the floor in the plane of its east wall is the floor, also where the box is
    down = terrain.cast([9, 1, 1], [0, 1, -0.25])
    assert abs(down.distance - math.hypot(1, 4)) <= 1e-12 and not down.wall
    onto = terrain.cast([5, 1, 3], [0, 1, -0.25])
    assert onto.point.tolist() == [5, 5, 2] and onto.element == 1


def test_a_ray_that_only_touches_a_corner_passes_it() -> None:
    """There is nothing of the box along it, on whichever side of the corner."""
    terrain = with_floor(BOX)
    for x, y in ((5, 4), (9, 4), (9, 6), (5, 6)):
        way = np.array([1, -1, 0]) if (x - 7) * (y - 5) > 0 else np.array([1, 1, 0])
        for start in (-way, way):
            hit = terrain.cast([x, y, 1] + 2.0 * start, -start)
            assert hit.distance == math.inf, (x, y)


def test_a_ray_into_a_corner_meets_a_wall_of_it() -> None:
    terrain = with_floor(BOX)
    for x, y in ((5, 4), (9, 4), (9, 6), (5, 6)):
        out = np.sign([x - 7.0, y - 5.0, 0.0])
        hit = terrain.cast([x, y, 1] + 2.0 * out, -out)
        assert hit.wall and hit.element == 1
        assert abs(hit.distance - 2 * math.sqrt(2)) <= 1e-12
        assert hit.normal.tolist() in ([out[0], 0, 0], [0, out[1], 0])


def test_between_two_boxes_that_share_a_corner_a_ray_passes() -> None:
    """Of the corner itself the cell to the north-east has the height, and that is the floor."""
    terrain = with_floor(
        {"type": "box", "cellX": 4, "cellY": 6, "vScale": 2},
        {"type": "box", "cellX": 5, "cellY": 5, "vScale": 3},
    )
    for way in ([1, 1, 0], [-1, -1, 0]):
        assert terrain.cast(np.array([5, 6, 1]) - 2.0 * np.array(way), way).distance == math.inf
    across = terrain.cast([3, 8, 1], [1, -1, 0])  # into the one, along the diagonal
    assert across.wall and abs(across.distance - math.sqrt(2)) <= 1e-12
    assert terrain.pointer(int(across.element)) == "/elemTree/children/0"


def test_a_ray_that_only_touches_a_disc_passes_it() -> None:
    """Its rim is a line in the plane of the cell's edge, and reaches 1e-9 further."""
    disc = {"type": "disc", "at": [8, 6], "extent": [4, 2], "vScale": 2}
    terrain = with_floor(disc)
    for x, y, way in (
        (8, 5, [1, 0, 0]),
        (8, 7, [-1, 0, 0]),
        (6, 6, [0, 1, 0]),
        (10, 6, [0, -1, 0]),
    ):
        start = np.array([x, y, 1]) - 3.0 * np.array(way)
        hit = terrain.cast(start, way)
        assert hit.distance == math.inf or abs(hit.distance - 3) < 1e-3  # of the rim
        out = np.sign([x - 8.0, y - 6.0, 0.0])
        assert terrain.cast(start + 1e-7 * out, way).distance == math.inf
        inside = terrain.cast(start - 1e-4 * out, way)
        assert inside.wall and inside.element == 1 and 2.9 < inside.distance < 3


@pytest.mark.parametrize("origin", [[0, 0], [500000, 5200000]])
@pytest.mark.parametrize(("rows", "row"), [(2, 1), (4, 1), (10, 3), (3, 1), (7, 3)])
def test_no_wall_stands_where_a_step_and_an_edge_cancel(
    rows: int, row: int, origin: list[int]
) -> None:
    """A step up where an element begins that goes as far down: level, and nothing above it."""
    at = row / rows
    lower = {"cellX": 0, "cellY": row, "span": [1, rows - row], "type": "one", "vScale": -1}
    tree = {"type": "step", "vScale": 1, "cells": [1, rows], "children": [lower]}
    types = {
        "step": {"x": [1], "y": [[0, 0], [at, 0], [at, 1], [1, 1]]},
        "one": {"x": [1], "y": [1]},
    }
    terrain = terrain_of({"size": [7, 10], "origin": origin, "elemTypes": types, "elemTree": tree})
    rng = np.random.default_rng(rows)
    count = 20_000
    starts = rng.uniform(0, 1, (count, 3)) * [7, 10, 1] + [*origin, 0.1]
    for steep in (1.0, 1e-2, 1e-4):  # some nearly along the step
        ways = rng.normal(size=(count, 3)) * [1.0, steep, 0.0]
        assert np.isinf(terrain.cast(starts, ways).distance).all()
        assert np.isinf(terrain.cast(starts - [0, 0, 2], ways).distance).all()


def with_post(origin: list[float]) -> Terrain:
    """One metre high, from 2 to 3 along x and from 1 to 2 along y."""
    post = {"cellX": 2, "cellY": 1, "type": "box", "vScale": 1}
    root = {"type": "floor", "cells": [4, 3], "children": [post]}
    return terrain_of({"size": [4, 3], "origin": origin, "elemTypes": FLOOR, "elemTree": root})


@pytest.mark.parametrize("origin", [[0, 0], [500000, 5200000], [1e7, 1e7]])
def test_walls_beside_a_corner_have_their_own_normal(origin: list[float]) -> None:
    """A post of 1 m that rays meet from 1 mm to the last corner on, from all sides."""
    terrain, offset = with_post(origin), 0.499
    middle = np.array([origin[0] + 2.5, origin[1] + 1.5, 0.5])
    for side in range(4):
        way = np.array([[0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]][side])
        along = np.array([-way[1], way[0], 0])
        for place in (-offset, offset):
            for slant in (-1, 1):
                aim = way + slant * along
                hit = terrain.cast(middle - 0.5 * way + place * along - 1.0 * aim, aim)
                assert hit.wall and np.array_equal(hit.normal, -way), (side, place, slant)


def test_walls_of_relief_alone_have_a_normal() -> None:
    """A level square on its corner, rough, whose edges lie among ground without relief."""
    rough = {"gravel": {"roughness": {"rms": 0.04, "correlation": 0.7}}}
    tree = {"type": "floor", "surface": "gravel", "vScale": 0, "turnDeg": 45}
    terrain = terrain_of({"size": 1, "surfTypes": rough, "elemTypes": FLOOR, "elemTree": tree})
    origin = np.array([0.7573620123571221, 0.8459573439320407, 0.014638247483454783])
    hit = terrain.cast(origin, [-0.9645384848545545, 0.2398911262117531, -0.11008069221864893])
    assert hit.wall and terrain.height(0.2619, 0.9692) == 0.0 > terrain.height(0.2622, 0.969)
    assert np.allclose(hit.normal, [math.sqrt(0.5), -math.sqrt(0.5), 0.0], rtol=0, atol=1e-12)


def test_the_relief_of_a_track_on_smooth_ground_is_met() -> None:
    """No place of a ray before its hit lies below the ground, of which only the track is rough."""
    track = {"path": [[1, 6], [19, 6]], "width": 6, "depth": 0, "surface": "stony"}
    terrain = with_floor(tracks=[track])
    rng = np.random.default_rng(1)
    starts = np.column_stack(
        [rng.uniform(0, 20, 200), np.full(200, 0.5), rng.uniform(0.01, 1, 200)]
    )
    ways = np.column_stack([rng.uniform(-0.3, 0.3, 200), np.ones(200), rng.uniform(-0.1, 0.1, 200)])
    hits = terrain.cast(starts, ways)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    until = np.minimum(hits.distance, 11.0)
    assert (hits.distance < 11.0).sum() > 50
    places = (
        starts[:, None] + ways[:, None] * (until[:, None] * np.linspace(0, 0.999, 500))[..., None]
    )
    x, y, z = (places[..., axis].ravel() for axis in range(3))
    assert not (z < terrain.height(x, y) - 1e-9).any()


def test_the_normal_of_a_wall_is_of_the_wall_whatever_was_passed_before() -> None:
    """Past a hill, the line of whose west side goes through the point of the box that is met."""
    hill = {"type": "ball", "cellX": 5, "cellY": 1, "span": [3, 2], "vScale": 1}
    box = {"type": "box", "cellX": 0, "cellY": 7, "span": [10, 3], "vScale": 2}
    hit = with_floor(hill, box).cast([8, 1, 0.8], [-1, 2, -0.02])
    assert hit.wall and hit.normal.tolist() == [0, -1, 0] and hit.element == 2


@pytest.mark.parametrize("extent", [[5, 1e-7], [1e-7, 5], [5, 1e-6]])
@pytest.mark.parametrize("origin", [[0, 0], [500000, 4649776]])
def test_strips_a_little_wider_than_rounding_are_met(
    origin: list[float], extent: list[float]
) -> None:
    """Ramps upon ramps, of a tenth of a micrometre; coordinates there tell a nanometre."""
    strip = {"x": [0.5, 1], "y": [0.5, 1], "combine": "sum"}
    found = {"type": "strip", "at": [10.3, 5.7], "extent": extent, "vScale": 2}
    terrain = with_floor(found, origin=origin, elemTypes={**FLOOR, "strip": strip})
    across = 0 if extent[0] < extent[1] else 1
    starts = np.tile([origin[0] + 10.3, origin[1] + 5.7, 0.8], (20, 1))
    starts[:, across] -= 4.0
    starts[:, 1 - across] += np.linspace(-2, 2, 20)
    hits = terrain.cast(starts, np.eye(3)[across])
    assert hits.wall.all() and np.allclose(hits.distance, 4.0, rtol=0, atol=1e-5)


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_in_the_plane_of_a_turned_step_what_begins_there_decides(degrees: int) -> None:
    """The double nearest to a step, and those beside it: the ground is that of the points there."""
    knots = [[0, 0], *([k / 10, (k + one) % 2] for k in range(1, 10) for one in (1, 0)), [1, 1]]
    for size in ([20, 12], [0.7, 0.3], [37.3, 29.9]):
        block = {"type": "block", "cellX": 1, "cellY": 1, "turnDeg": degrees, "vScale": 1}
        terrain = terrain_of(
            {
                "size": size,
                "elemTypes": {**FLOOR, "block": {"x": knots}},
                "elemTree": {"type": "floor", "cells": 3, "children": [block]},
            }
        )
        axis = degrees // 90 % 2
        middle, side = np.array(size) / 2, size[0] / 3
        for k in range(1, 10):
            plane = middle[axis] + side * (k / 10 - 0.5)
            for at in (plane, np.nextafter(plane, -math.inf), np.nextafter(plane, math.inf)):
                start = np.array([*middle, 2.0])
                start[axis] = at
                height = terrain.height(*start[:2])
                hit = terrain.cast(start, np.eye(3)[1 - axis] * 1e-3 * min(size) - [0, 0, 1])
                assert abs(hit.point[2] - height) <= 1e-9, (k, at)


def test_the_closed_edges_of_a_small_turned_box_far_from_zero_are_met() -> None:
    """A ray in the plane of any of its sides, which are the box's by the format."""
    box = {"type": "box", "at": [10, 6], "extent": [0.03, 0.03], "vScale": 2, "turnDeg": 180}
    origin = [500000, 4649776]
    terrain = with_floor(box, origin=origin)
    for axis in (0, 1):
        for side in (-0.015, 0.015):
            start = np.array([origin[0] + 10, origin[1] + 6, 1.0])
            start[axis] += side
            assert terrain.height(*start[:2]) == 2.0
            start[1 - axis] -= 3.0
            assert terrain.cast(start, np.eye(3)[1 - axis]).wall, (axis, side)


def test_from_far_away_hits_are_as_good_as_the_numbers() -> None:
    """A steep rise met from 9,000 km away; a number there has steps of 2 nm."""
    steep = {"x": [[0, 0], [0.3, 0], [0.3001, 1], [1, 1]]}
    rise = {"type": "steep", "cellX": 1, "cellY": 1, "vScale": 1}
    terrain = terrain_of(
        {
            "size": [20, 20],
            "elemTypes": {**FLOOR, "steep": steep},
            "elemTree": {"type": "floor", "cells": 4, "children": [rise]},
        }
    )
    z = np.linspace(0.05, 0.95, 40)
    target = np.column_stack([6.5 + 5e-4 * z, np.linspace(5.5, 9.5, 40), z])
    way = np.array([0.92, -0.31, -0.23])
    hits = terrain.cast(target - 9e6 * way, way)
    assert (hits.element == 1).all()
    assert np.abs(hits.point - target).max() <= 1e-6
    height = terrain.height(hits.point[:, 0], hits.point[:, 1])
    assert np.abs(hits.point[:, 2] - height).max() <= 2e-5
    above = terrain.cast(
        [-9236568.321071876, 3082919.529173709, 2276253.039288377],
        [0.9236574768950039, -0.3082914043008569, -0.2276252960682557],
    )
    assert abs(above.point[2] - terrain.height(*above.point[:2])) <= 2e-5


def test_behind_a_sliver_the_normal_is_of_the_edge() -> None:
    """Through the crossing of an edge and of a mere border of the tree."""
    steep = {"x": [[0, 0], [0.3, 0], [0.3001, 1], [0.7, 1], [0.70001, 0], [1, 0]]}
    block = {"type": "steep", "vScale": 2.027}
    block |= {"at": [35.880345544584664, 7.860012103669112], "extent": [0.3333, 0.03333]}
    terrain = terrain_of(
        {
            "size": [39.68, 33.33],
            "elemTypes": {"steep": steep, "saddle": SHAPES["saddle"]},
            "elemTree": {"type": "saddle", "vScale": 1, "cells": 4, "children": [block]},
        }
    )
    hit = terrain.cast(
        [2.4457803807215663, 1.1126100670763812, 10.084971956607934],
        [0.033434565163863096, 0.006730737036592731, -0.009605427105160862],
    )
    assert hit.wall and hit.normal.tolist() == [0, -1, 0]


def test_behind_a_sliver_no_wall_stands_on_level_ground() -> None:
    """Up from below the floor, which begins behind two lines that lie 1.8e-15 from each other."""
    shapes = {kind: SHAPES[kind] for kind in ("column", "saddle")}
    disc = {"type": "column", "cellX": 2, "cellY": 3, "span": [2, 1], "vScale": 2.85}
    box = {"type": "box", "at": [19.99, 13.992999999999999], "extent": [5.997, 1.9989999999999999]}
    saddle = {"type": "saddle", "cellX": 1, "cellY": 2, "vScale": -0.295}
    rough: Json = {"surface": "gravel"}
    children = [
        {**disc, **rough, "vOffset": -0.479, "turnDeg": 90},
        {**box, "vScale": 2.205},
        {**saddle, **rough, "turnDeg": 45},
    ]
    root = {"type": "floor", "surface": "grass", "vScale": 1, "cells": 4, "children": children}
    terrain = terrain_of(
        {
            "size": [27.67, 19.99],
            "surfTypes": SURFACES,
            "elemTypes": {**FLOOR, **shapes},
            "elemTree": root,
        }
    )
    hit = terrain.cast(
        [26.739790238181968, 14.51273130407896, -0.1299494828553136],
        [0, 4.797686959210399, 1.299494828553136],
    )
    assert not hit.wall and hit.normal.tolist() == [0, 0, -1] and hit.element == 0


def test_directions_may_be_as_small_as_numbers_are() -> None:
    terrain = with_post([0, 0])
    for tiny in (0.0, 1e-290, 1e-310, 5e-324):
        assert terrain.cast([2, 0, 0.5], [tiny, 1, 0]).distance == 1.0
        assert terrain.cast([2, 1, 3], [tiny, tiny, -1]).point.tolist() == [2, 1, 1]
        assert terrain.cast([2, 1, 3], np.array([0, 0, -1]) * max(tiny, 1e-310)).distance == 2.0


def test_where_elements_cancel_rays_close_to_them_end() -> None:
    """Bounds of a sum tell nothing then; a ray just above a saddle's ridge, and one that dips."""
    curves = {"x": "(2*t-1)**2", "y": "-(2*t-1)**2", "combine": "sum"}
    terrain = terrain_of({"size": 2, "elemTypes": {"s": curves}, "elemTree": {"type": "s"}})
    for above in (1e-6, 1e-10, 1e-14, 1e-16):
        assert terrain.cast([0, 0, above], [1, 1, 0]).distance == math.inf
    hit = terrain.cast([0, 0, 1e-3], [1, 1, -1e-3])
    assert abs(hit.distance - math.sqrt(2 + 1e-6)) <= 1e-9


def test_an_index_keeps_in_the_size_of_what_it_is_of() -> None:
    """Bumps that all lie over everything, and a step wherever one looks."""
    steps = [
        point for n in range(500) for point in ([n / 500, n / 500], [n / 500, n / 500 + 0.002])
    ]
    types = {"bump": {"x": "cosbell"}, "stairs": {"x": [[0, 0], *steps[1:], [1, 1]], "y": [1]}}
    bumps = [{"cellX": 0, "cellY": 0, "type": "bump", "vScale": 0.01} for _ in range(300)]
    tree = {"type": "stairs", "vScale": 1, "cells": 1, "children": bumps}
    terrain = terrain_of({"size": 100, "elemTypes": types, "elemTree": tree})
    assert terrain.ray_index.nbytes < 50e6
    x = np.array([3.3, 51.7, 80.1])
    hits = terrain.cast(np.column_stack([x - 1, x, np.full(3, 9.0)]), [1.0, 0.0, -1.0])
    assert not hits.wall.any()
    assert np.allclose(hits.point[:, 2], terrain.height(hits.point[:, 0], x), rtol=0, atol=1e-9)


def test_a_large_grid_has_an_index_of_its_size() -> None:
    """Of 400 × 250 numbers; rays through all of it meet what queries have."""
    rng = np.random.default_rng(4)
    heights = rng.uniform(0, 1, (250, 400)).round(2)
    grid = {"rough": {"grid": heights.tolist(), "registration": "pixel"}}
    terrain = terrain_of(
        {"size": [400, 250], "elemTypes": grid, "elemTree": {"type": "rough", "vScale": 1}}
    )
    assert terrain.ray_index.nbytes < 2 * heights.nbytes
    over = terrain.cast([1, 1, 1.001], [398, 248, 0])
    assert over.distance == math.inf
    x, y = rng.uniform(10, 390, 500), rng.uniform(10, 240, 500)
    ways = np.column_stack([rng.uniform(-1, 1, (500, 2)), np.full(500, -0.05)])
    hits = terrain.cast(np.column_stack([x, y, np.full(500, 1.1)]), ways)
    met = np.isfinite(hits.distance)
    assert met.mean() > 0.9 and not hits.wall.any()
    off = terrain.height(*hits.point[met, :2].T) - hits.point[met, 2]
    assert np.abs(off).max() <= 1e-12
    # before that they are above it
    for part in np.linspace(0.001, 0.999, 400):
        at = np.column_stack([x, y, np.full(500, 1.1)])[met]
        at += part * (hits.point[met] - at)
        assert (at[:, 2] > terrain.height(at[:, 0], at[:, 1])).all()


def test_rays_that_begin_on_the_ground_meet_it_there() -> None:
    terrain = with_floor(BOX)
    ways = [[1, 0, 0], [0, 0, 1], [0.3, 0.2, -1], [1, 2, 3], [0, -1, 1e-9], [0, 0, -1]]
    for origin, element in (([2, 3, 0], 0), ([7.5, 5.25, 2], 1)):
        hits = terrain.cast(origin, ways)
        assert (hits.distance == 0).all() and (hits.element == element).all()
        assert not hits.wall.any()
        assert (hits.point == origin).all()


def test_rays_that_begin_below_the_ground_meet_it_from_there() -> None:
    terrain = with_floor(BOX)
    up = terrain.cast([[2, 3, -3], [7, 4.1, -4]], [0, 0.3, 0.4 * 3])
    assert np.allclose(up.point, [[2, 3.75, 0], [7, 5.6, 2]], rtol=0, atol=1e-12)
    assert np.allclose(up.normal, [0, 0, -1], rtol=0, atol=1e-15)
    inside = terrain.cast([6, 5, 1], [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    assert np.allclose(inside.distance, [3, 1, 1, 1], rtol=0, atol=1e-15)
    assert inside.normal.tolist() == [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]]
    assert inside.wall.all() and (inside.element == 1).all()


def test_rays_that_begin_outside_meet_no_rim() -> None:
    floor = {"type": "floor", "vOffset": 2}
    terrain = terrain_of({"size": [20, 12], "elemTypes": FLOOR, "elemTree": floor})
    under = terrain.cast([-3, 5, 1], [[1, 0, 0], [1, 0, 0.2], [1, 0, 2], [-1, 0, 1], [1, 0, -1]])
    assert np.allclose(under.distance, [math.inf, 5 * math.hypot(1, 0.2), *[math.inf] * 3])
    assert under.normal[1].tolist() == [0, 0, -1]
    over = terrain.cast([25, 5, 3], [-1, 0.01, -0.1])
    assert np.allclose(over.point, [15, 5.1, 2]) and over.normal.tolist() == [0, 0, 1]


def test_rays_pass_the_void() -> None:
    """Through a hole in a sheet, and through a block of void; its rim has no walls."""
    hole = {**BOX, "surface": "hole", "turnDeg": 20}
    terrain = with_floor(hole, {"type": "box", "at": [14, 5], "extent": 1, "vScale": 2})
    assert terrain.cast([7, 5, 1], [0.1, 0.1, -1]).distance == math.inf
    assert terrain.cast([7, 5, -1], [0.1, 0.1, 1]).distance == math.inf
    below = terrain.cast([1, 5, -1], [1, 0, 0])  # beneath the floor, the hole and the box
    assert below.distance == math.inf
    through = terrain.cast([3, 5, 0.5], [1, 0, -0.1])  # down in the hole, under the floor again
    assert through.distance == math.inf
    over = terrain.cast([1, 5, 1], [1, 0, 0])
    assert over.wall and abs(over.distance - 12.5) <= 1e-12
    up = terrain.cast([6, 5, -0.2], [1, 0, 0.05])  # out of the hole under the floor, at x = 10
    assert np.allclose(up.point, [10, 5, 0]) and up.normal.tolist() == [0, 0, -1]
    begins = terrain.cast([7, 5, 0.5], [1, 0, 0])
    assert begins.wall and abs(begins.distance - 6.5) <= 1e-12


@pytest.mark.parametrize("aside", [0.0, 0.01])
def test_what_stands_beside_a_void_has_no_wall_there(aside: float) -> None:
    """A ray comes into a box out of a hole, and meets the wall behind, from within."""
    box = {"type": "box", "at": [9.5, 5], "extent": [1, 2], "vScale": 2}
    way = [1.0, aside, 0.0]
    for surface, x in (("grass", 9.0), ("hole", 10.0)):
        flat = {**BOX, "vScale": 1e-3, "surface": surface}
        hit = with_floor(flat, box).cast([1, 4.95, 1], way)
        assert hit.wall and abs(hit.point[0] - x) <= 1e-12, surface
        assert hit.normal.tolist() == [-1, 0, 0] and hit.element == 2
    # the same from below the floor: into the hole, and out of the ground behind it
    hole = with_floor({**BOX, "surface": "hole"})
    assert hole.cast([1, 4.95, -1], [*way[:2], 0.05]).distance == math.inf
    up = hole.cast([6, 4.95, -0.5], [*way[:2], 0.1])
    assert np.allclose(up.point[::2], [11, 0]) and not up.wall


def test_the_range_has_its_end() -> None:
    """What lies at it exactly is met; the ground, a wall and straight down."""
    terrain = with_floor(BOX)
    for origin, way in (([2, 3, 2], [0, 0, -1]), ([2, 5, 1], [1, 0, 0]), ([2, 2, 4], [3, 0, -4])):
        free = float(terrain.cast(origin, way).distance)
        assert terrain.cast(origin, way, free).distance == free
        short = terrain.cast(origin, way, free * (1 - 1e-14))
        assert short.distance == math.inf and short.element == OUTSIDE and short.surface == -1
        assert np.isnan(short.point).all() and np.isnan(short.normal).all() and not short.wall
    assert terrain.cast([2, 3, 0], [0, 1, 1], 0.0).distance == 0.0
    several = terrain.cast([2, 3, 2], [0, 0, -1], [[1.0], [2.0], [3.0]])
    assert several.distance.tolist() == [[math.inf], [2.0], [2.0]]


@pytest.mark.parametrize("length", [1.0, 2.0**-1060, 2.0**900, 5e-324])
def test_directions_have_any_length(length: float) -> None:
    terrain = with_floor(BOX)
    ways = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0], [1, 0, -1], [1, 1, -1]], float)
    wanted = terrain.cast([5.5, 1, 1], ways)
    found = terrain.cast([5.5, 1, 1], ways * length)
    assert np.array_equal(found.distance, wanted.distance)
    assert np.array_equal(found.point, wanted.point, equal_nan=True)


def test_numbers_of_any_size_are_answered() -> None:
    """From as far as doubles go, and nearly along an axis."""
    terrain = with_floor(BOX)
    far = np.array([1e300, -1e300, 1e18, -1e18, 1e9, 0.5, 1e-300, 0.0])
    grid = np.stack(np.meshgrid(far, far, far, indexing="ij"), axis=-1).reshape(-1, 3)
    ways = np.array([[0, 0, -1], [1, 0, 1e-300], [1e-300, 1e300, 1], [-1, 1e-9, 0], [0.6, 0.8, -1]])
    hits = terrain.cast(grid[:, None], ways)
    met = np.isfinite(hits.distance)
    assert met.any() and not np.isnan(hits.distance).any()
    assert (hits.distance[met] >= 0).all()
    assert np.isfinite(hits.point[met]).all() and np.isnan(hits.point[~met]).all()
    upright = terrain.cast([7, 5, 1e300], [1e-300, 0, -1])
    assert upright.distance == 1e300 and upright.element == 1
    level = terrain.cast([1, 5, 1], [1, 1e-300, -1e-300])
    assert level.wall and level.distance == 4.0


def test_rays_nearly_upright_are_as_good_as_upright() -> None:
    terrain = with_floor(BOX)
    for lean in (1e-3, 1e-9, 1e-15, 1e-30):
        hits = terrain.cast([[7, 5, 10], [2, 3, 10]], [lean, lean, -1])
        assert np.allclose(hits.distance, [8, 10], rtol=0, atol=2e-5 * (lean / 1e-3))
        assert hits.element.tolist() == [1, 0]


def test_shapes_are_those_of_the_rays() -> None:
    terrain = with_floor(BOX)
    origins = np.array([[[2, 3, 1]], [[7, 5, 3]], [[2, 3, -1]]])
    ways = np.array([[0, 0, -1], [0, 0, 1], [0, 0, -2], [0, 1, 0]])
    hits = terrain.cast(origins, ways)
    for one, shape in (
        (hits.distance, (3, 4)), (hits.point, (3, 4, 3)), (hits.normal, (3, 4, 3)),
        (hits.surface, (3, 4)), (hits.element, (3, 4)), (hits.wall, (3, 4)),
    ):  # fmt: skip
        assert one.shape == shape
    wanted = [
        [1, math.inf, 1, math.inf],
        [1, math.inf, 1, math.inf],
        [math.inf, 1, math.inf, math.inf],
    ]
    assert hits.distance.tolist() == wanted
    assert terrain.cast([2, 3, 1], [0, 0, -1]).distance.shape == ()
    assert terrain.cast(np.zeros((0, 3)), [0, 0, -1]).point.shape == (0, 3)
    assert terrain.cast([2, 3, 1], [0, 0, -1], np.ones((5, 2))).wall.shape == (5, 2)


@pytest.mark.parametrize(
    ("origin", "way", "most", "said"),
    [
        ([math.nan, 0, 0], [0, 0, 1], 1, "The origins have a NaN"),
        ([0, 0, math.inf], [0, 0, 1], 1, "The origins have a NaN or an infinity"),
        ([0, 0, 0], [0, math.nan, 1], 1, "The directions have a NaN"),
        ([0, 0, 0], [0, -math.inf, 1], 1, "The directions have a NaN or an infinity"),
        ([0, 0, 0], [[0, 0, 1], [0, 0, 0]], 1, "A direction is 0 0 0"),
        ([0, 0, 0], [0, 0, 1], math.nan, "A range is below 0, or NaN"),
        ([0, 0, 0], [0, 0, 1], [-1e-9], "A range is below 0, or NaN"),
        ([0, 0], [0, 0, 1], 1, "The origins have the shape"),
        (0, [0, 0, 1], 1, "The origins have the shape"),
        ([0, 0, 0], [[0, 0, 1, 0]], 1, "The directions have the shape"),
        (np.zeros((3, 3)), np.ones((2, 3)), 1, "do not fit together"),
        (np.zeros((3, 3)), [0, 0, 1], np.ones(2), "do not fit together"),
    ],
)
def test_what_is_no_ray_is_refused_in_a_sentence(
    origin: Any, way: Any, most: Any, said: str
) -> None:
    with pytest.raises(RequestError, match=said) as refused:
        with_floor(BOX).cast(origin, way, most)
    assert refused.value.hint


@pytest.mark.slow
def test_parts_that_are_shared_are_written_out_or_refused() -> None:
    """What comes to 10^12 elements has no answer; 100,000 have that of their own."""
    brick = {"type": "box", "at": [0.4, 0.5], "extent": [0.2, 0.1], "vScale": 3}

    def wall(*levels: int) -> Json:
        parts: Json = {"p0": {"type": "floor", "children": [brick]}}
        for k, n in enumerate(levels, 1):
            copies = {"part": f"p{k - 1}", "cellX": 0, "cellY": 0, "vScale": 1,
                      "repeat": {"count": [n, n], "step": [1, 1]}}  # fmt: skip
            parts[f"p{k}"] = {"type": "floor", "cells": n, "children": [copies]}
        return {"size": [200, 200], "elemTypes": FLOOR, "parts": parts,
                "elemTree": {"type": "floor", "cells": 1, "children": [
                    {"part": f"p{len(levels)}", "cellX": 0, "cellY": 0}]}}  # fmt: skip

    terrain = terrain_of(wall(200))
    assert terrain.is_shared and terrain.elements > 80_000
    hit = terrain.cast([100.05, 57.5, 1], [1, 0, 0])
    assert hit.wall and abs(hit.distance - 0.25) <= 1e-12
    assert terrain.pointer(int(hit.element)) == terrain.element(100.4, 57.5)
    brick = {"type": "box", "cellX": 3, "cellY": 5}
    with pytest.raises(RequestError, match=r"elements, and more than .* are not written out"):
        terrain_of(wall(1000, 1000)).cast([1, 1, 1], [1, 0, 0])


def test_threads_change_no_bit_and_neither_does_pickling() -> None:
    rng = np.random.default_rng(5)
    definition = crowded(rng)
    terrain = terrain_of(definition)
    origins, ways = aimed(rng, terrain, 50_000)
    one = terrain.cast(origins, ways, threads=1)
    again = pickle.loads(pickle.dumps(terrain))
    some = rng.choice(50_000, 100)
    single = [terrain.cast(origins[n], ways[n]) for n in some]
    for member in fields(RayHits):
        wanted = getattr(one, member.name)
        for other in (terrain, again):
            found = getattr(other.cast(origins, ways, threads=3), member.name)
            assert np.array_equal(found, wanted, equal_nan=wanted.dtype.kind == "f"), member.name
        alone = np.array([getattr(hit, member.name) for hit in single])
        assert np.array_equal(alone, wanted[some], equal_nan=wanted.dtype.kind == "f")


# The slow reading itself


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_bounds_of_the_slow_reading_hold(data: st.DataObject) -> None:
    """At points of stretches of any length the ground is that of the oracle."""
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    oracle, terrain = RayOracle(definition), terrain_of(definition)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    origins, ways = aimed(rng, terrain, RAYS)
    ways[:, 2] = 0.0
    ways /= np.maximum(np.linalg.norm(ways, axis=1), 1e-300)[:, None]
    rays = Rays(origins, ways)
    box = (*oracle.box, (-math.inf, math.inf))
    begin, end = oracle.clipped(rays, np.full(RAYS, math.inf), box)
    inside = np.flatnonzero((begin < end) & (end < math.inf))
    width = (end - begin)[inside] * 10.0 ** rng.uniform(-9, 0, len(inside))
    first = begin[inside] + rng.random(len(inside)) * ((end - begin)[inside] - width)
    ground = oracle.below(rays, Stretches(inside, first, first + width))
    for k, n in enumerate(inside):
        at = first[k] + width[k] * rng.random()
        x, y = (origins[n] + ways[n] * at)[:2].tolist()
        wanted = oracle.oracle.at(x, y)
        if math.isnan(wanted.z):
            assert ground.any_void[k] or wanted.surface is None
            continue
        off = ground.rounding[k]
        assert not ground.all_void[k]
        assert ground.z.low[k] - off <= wanted.z <= ground.z.high[k] + off
        if ground.one_top[k]:
            assert oracle.pointer(int(ground.top[k])) == wanted.element
