"""Long vectors are kept as samples, which give what stored pieces give."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.reader import check
from terratool.field import pieces
from terratool.field.bounds import crest_lines, nonzero_edges
from terratool.field.records import SAMPLES
from terratool.field.terrain import Terrain
from terratool.mesh.build import build
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from terratool.text.source import Source
from tests.budget import examples
from tests.conftest import terrain_of, text_of
from tests.field import test_sharing
from tests.strategies import definitions, landmarks, rims

ROUNDING = 1e-12
"""Of heights: leaves of a grid are turned by nothing, those with samples are not."""


@contextmanager
def all_sampled() -> Iterator[None]:
    """Vectors are long from two numbers on."""
    with patch.object(pieces, "LEAST", 2):
        yield


def both(definition: dict[str, Any]) -> tuple[Terrain, Terrain]:
    """A terrain whose curves are stored pieces, and the same with samples."""
    stored = terrain_of(definition)
    _ = stored.written_out  # compiled here, as the other one is there
    with all_sampled():
        sampled = terrain_of(definition)
        _ = sampled.written_out
    return stored, sampled


DRAWN = definitions(free=True, gridded=True)


@settings(max_examples=examples(60))
@given(DRAWN)
def test_points_are_the_same(definition: dict[str, Any]) -> None:
    stored, sampled = both(definition)
    x, y = np.array(landmarks(definition)[:80] + rims(definition)).T
    one, other = stored.sample(x, y), sampled.sample(x, y)
    assert np.array_equal(one.surface, other.surface) and np.array_equal(one.element, other.element)
    for plain, found in zip((one.height, one.normal), (other.height, other.normal), strict=True):
        assert found == pytest.approx(plain, rel=ROUNDING, abs=ROUNDING, nan_ok=True)
    assert np.array_equal(sampled.height(x, y), other.height, equal_nan=True)


@settings(max_examples=examples(60))
@given(DRAWN)
def test_pixels_are_the_same(definition: dict[str, Any]) -> None:
    stored, sampled = both(definition)
    grid = grid_over(stored, min(np.ptp(stored.bounds[::2]), np.ptp(stored.bounds[1::2])) / 9.5)
    one, other = (
        Painter(terrain, grid, np.float64, slopes=True, labels=True).paint(grid.whole)
        for terrain in (stored, sampled)
    )
    assert np.array_equal(one.labels, other.labels)
    for name in ("heights", "slope_x", "slope_y"):
        wanted, found = getattr(one, name), getattr(other, name)
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9, nan_ok=True), name


@settings(max_examples=examples(40))
@given(DRAWN)
def test_meshes_and_edges_are_the_same(definition: dict[str, Any]) -> None:
    stored, sampled = both(definition)
    error = 0.2 * max(1e-3, stored.bounds[2] - stored.bounds[0])
    one, other = build(stored, error), build(sampled, error)
    assert np.array_equal(one.mesh.faces, other.mesh.faces)
    assert np.array_equal(one.mesh.vertices, other.mesh.vertices)
    assert one.error == other.error
    assert np.array_equal(nonzero_edges(stored.arrays), nonzero_edges(sampled.arrays))
    for a, b in zip(crest_lines(stored.arrays), crest_lines(sampled.arrays), strict=True):
        assert np.array_equal(a, b)


@settings(max_examples=examples(40))
@given(DRAWN, st.integers(0, 2**32))
def test_rays_are_the_same(definition: dict[str, Any], seed: int) -> None:
    stored, sampled = both(definition)
    west, south, east, north = stored.bounds
    rng = np.random.default_rng(seed)
    origins = rng.uniform((west, south, 1), (east, north, 4), (60, 3))
    directions = rng.normal(size=(60, 3)) - (0, 0, 1)
    one, other = stored.cast(origins, directions), sampled.cast(origins, directions)
    assert other.distance == pytest.approx(one.distance, rel=1e-9, nan_ok=True)


def test_shared_parts_are_the_same() -> None:
    """Their descent is one of its own; turned, and with others on them."""
    curve = {"x": [0, 2, 1, 3], "y": [1, 0.5, 3]}
    inner = {"type": "hump", "cellX": 1, "cellY": 0, "vScale": 0.3, "turnDeg": 20}
    part = {"type": "dune", "cells": [3, 2], "vScale": 1, "children": [inner]}
    copies = [
        {"part": "yard", "cellX": x, "cellY": y, "turnDeg": 90 * (x + y)}
        for x in range(8) for y in range(5)
    ]  # fmt: skip
    definition = {
        "size": [9, 5],
        "elemTypes": {"dune": curve, "hump": {"x": [0, 1, 0.2], "combine": "radial"}},
        "parts": {"yard": part},
        "elemTree": {"type": "dune", "cells": [8, 5], "children": copies},
    }
    with all_sampled():
        shared, plain = test_sharing.both(definition)
    assert (shared.arrays.kinds["pieces"][..., 0] >= SAMPLES).any()
    test_sharing.compare(shared, plain)
    x, y = np.random.default_rng(8).uniform(0, (9, 5), (500, 2)).T
    stored = terrain_of(definition).height(x, y)
    assert shared.height(x, y) == pytest.approx(stored, abs=ROUNDING)


def test_a_device_has_them_as_pieces() -> None:
    """Two curves in one array, and the end of each."""
    wp = pytest.importorskip("warp", reason="warp-lang is not installed")
    stored, sampled = both(LONG | {"elemTypes": {"dune": {"x": [0, 2, 1], "y": [1, 0.5, 3, 2]}}})
    places = np.stack(np.meshgrid(np.linspace(0, 9, 30), np.linspace(0, 5, 20)), axis=-1)
    fields = [terrain.to_warp("cpu") for terrain in (stored, sampled)]
    for field in fields:
        field.asks_terrain = False  # as on a GPU
    one, other = (field.sample(wp.array(places, dtype=wp.vec2d, device="cpu")) for field in fields)
    assert np.array_equal(one.height.numpy(), other.height.numpy())
    assert np.array_equal(one.normal.numpy(), other.normal.numpy())


LONG: dict[str, Any] = {
    "size": [9, 5],
    "elemTypes": {
        "dune": {"x": np.linspace(0, 1, 1200).tolist(), "y": (np.arange(1001) % 7).tolist()}
    },
    "elemTree": {"type": "dune", "vScale": 2},
}


def test_long_vectors_are_samples_however_they_are_read() -> None:
    """Of a long text they are not even copied: what was read is what kernels follow."""
    terrain = terrain_of(LONG)
    curves = terrain.arrays.curves
    assert len(curves.samples) == 2201
    assert (terrain.arrays.kinds["pieces"][0, :, 0] >= SAMPLES).all()
    more = {str(k): {"x": np.linspace(0, 1 + k, 9000).tolist(), "y": [1]} for k in range(3)}
    children = [{"type": str(k), "cellX": k, "cellY": 2} for k in (1, 0, 2)]
    tree = {**LONG["elemTree"], "children": children}
    types = {**more, **LONG["elemTypes"]}
    text = text_of({**LONG, "elemTypes": types, "elemTree": tree}).encode()
    checked = check(Source("long.json", text))
    assert checked.definition is not None
    samples = Terrain(checked).arrays.curves.samples
    vectors = [one.x.array for one in checked.definition.primitives.values()]
    assert all(np.shares_memory(samples, vector) for vector in vectors)
    assert samples.size == 3 * 9000 + 2201


def test_height_is_linear_between_them() -> None:
    """At t = 1 with the slope before."""
    terrain = terrain_of(LONG)
    y = np.array([0, 0.0025, 0.0075, 5.0])
    assert terrain.height(np.full(4, 9.0), y) == pytest.approx([0, 1.0, 3.0, 2 * 6], abs=1e-9)
    normal = terrain.normal(9.0, 5.0)
    assert -normal[1] / normal[2] == pytest.approx(2 * 200, rel=1e-9)
    assert -normal[0] / normal[2] == pytest.approx(2 * 6 / 9, rel=1e-9)
