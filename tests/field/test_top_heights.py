"""Heights where there are storeys, asked in batches, against columns, to the last bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from tests.budget import examples
from tests.conftest import terrain_of
from tests.storey_examples import DEFINITIONS
from tests.storey_trees import lattices, with_storeys
from tests.strategies import definitions

Floats = NDArray[np.float64]


def assert_tops(terrain: Terrain, x: Floats, y: Floats) -> None:
    """The highest top, and the highest not above some heights, tops among them."""
    top = terrain.column(x, y).top
    highest = np.where(np.isnan(top), -np.inf, top).max(axis=-1)
    wanted = np.where(np.isneginf(highest), np.nan, highest)
    np.testing.assert_array_equal(terrain.height(x, y), wanted)
    for below in (top[:, 0], np.nextafter(top[:, -1], -np.inf), np.full(len(x), 1.0)):
        low = np.where(top <= below[:, None], top, -np.inf).max(axis=-1)
        wanted = np.where(np.isneginf(low), np.nan, low)
        np.testing.assert_array_equal(terrain.height(x, y, below), wanted)


def points_of(terrain: Terrain, count: int) -> tuple[Floats, Floats]:
    """Points of an even lattice, on edges and beyond, in no order of place."""
    west, south, east, north = terrain.bounds
    at = np.random.default_rng(5).permutation(count * count)
    x = np.linspace(west - 1, east + 1, count)[at // count]
    y = np.linspace(south - 1, north + 1, count)[at % count]
    return np.append(x, [west, east, 0.5 * (west + east)]), np.append(y, [south, north, north])


@pytest.mark.parametrize("name", DEFINITIONS)
def test_heights_in_batches_are_the_highest_tops(name: str) -> None:
    terrain = terrain_of(DEFINITIONS[name])
    for count in (23, 97):
        assert_tops(terrain, *points_of(terrain, count))


@given(definition=lattices())
@settings(max_examples=examples(30), deadline=None)
def test_heights_where_faces_meet(definition: Any) -> None:
    terrain = terrain_of(definition)
    west, south, east, north = terrain.bounds
    x, y = np.meshgrid(np.arange(west, east + 0.2, 0.25), np.arange(south, north + 0.2, 0.25))
    assert_tops(terrain, x.ravel(), y.ravel())


@given(definition=with_storeys(definitions()))
@settings(max_examples=examples(30), deadline=None)
def test_heights_of_random_storeys(definition: Any) -> None:
    terrain = terrain_of(definition)
    assert_tops(terrain, *points_of(terrain, 31))
