"""Rays against a slow reading that shares no code with them, and by hand."""

from __future__ import annotations

import math
import os
import pickle
from collections import Counter
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.rays import RayHits
from terratool.field.terrain import OUTSIDE, Terrain
from tests.conftest import terrain_of
from tests.oracle import Oracle
from tests.rays import ABOVE, BELOW, RayOracle, Rays, Reading, Stretches, reliefs
from tests.strategies import SURFACES, definitions, landmarks

EXAMPLES = int(os.environ.get("TERRATOOL_FUZZ", "25"))
RAYS = 40
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
    assert hit.surface == terrain.surface_of(hit.element.reshape(1))[0], where
    said = ["loose" if high - low > 2 * slack else "same"]
    return said if ray.beside is None else said + described(terrain, oracle, hit, ray)


def described(terrain: Terrain, oracle: RayOracle, hit: RayHits, ray: Ray) -> list[str]:
    """What could be told of what a ray meets, where the hit says the same."""
    assert ray.beside is not None
    near, where = ray.beside, f"{hit} {ray}"
    pointer, (before, behind) = terrain.pointer(int(hit.element)), near.tops
    if near.depth > 20 * near.smooth and near.depth > 1e-6:
        said = ["wall"]
        assert hit.wall, where
        higher = behind if ray.reading.side == ABOVE else before
        if higher is not None:
            assert pointer == oracle.pointer(higher), where
            said.append("element of a wall")
        return said + upright(terrain, hit, ray)
    if near.jump > 3 * near.smooth:
        return []
    said = ["ground"]
    assert not hit.wall, where
    if before is not None and before == behind:
        assert pointer == oracle.pointer(before), where
        said.append("element of the ground")
    return said + sloped(terrain, hit, ray)


def upright(terrain: Terrain, hit: RayHits, ray: Ray) -> list[str]:
    """The height jumps across the line that is square to the normal of a wall."""
    normal, point, where = hit.normal[:2], hit.point[:2], f"{hit} {ray}"
    assert hit.normal[2] == 0.0, where
    west, south, east, north = terrain.bounds
    aside = 1e-8 * min(east - west, north - south)
    if aside < 1e3 * np.spacing(np.abs(point).max()):
        return []
    along = np.array([-normal[1], normal[0]])
    places = np.array([0.0, 100.0, -100.0])[:, None] * along * aside
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
    around = beside(oracle, rays, readings)
    found: Counter[str] = Counter()
    for n, reading in enumerate(readings):
        hit = RayHits(*(getattr(hits, member.name)[n] for member in fields(hits)))
        ray = Ray(rays.origins[n], rays.ways[n], reading, around.get(n))
        found.update(judged(terrain, oracle, hit, ray))
    return found


# Against the slow reading


def test_rays_over_thin_posts_and_walls_agree_with_the_format() -> None:
    total: Counter[str] = Counter()
    for seed in range(EXAMPLES):
        rng = np.random.default_rng(seed)
        total += compared(crowded(rng), rng, RAYS)
    print(total)
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
        definitions(rutted=data.draw(st.booleans()), free=data.draw(st.booleans()))
    )
    total = compared(definition, np.random.default_rng(data.draw(st.integers(0, 2**32))), RAYS)
    TOTAL.update(total)


TOTAL: Counter[str] = Counter()
