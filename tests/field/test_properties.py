"""The field against a slow reading of the format that shares no code with it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.budget import examples
from tests.conftest import terrain_of
from tests.oracle import Oracle
from tests.strategies import definitions, landmarks, points, rims

EXAMPLES = examples(75)

# Curves are kept to 1e-8 each; up to 31 elements with |vScale| up to 5 and two curves with values
# up to about 3 can add up to this.
TOLERANCE = 2e-6


@pytest.mark.nightly
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_height_surface_and_element_agree_with_the_format(data: st.DataObject) -> None:
    """At random points, and on, beside and between all edges of cells, to the last bit."""
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    terrain, oracle = terrain_of(definition), Oracle(definition)
    drawn = data.draw(st.lists(points(definition), min_size=4, max_size=12))
    for x, y in landmarks(definition)[:120] + rims(definition) + drawn:
        wanted = oracle.at(x, y)
        found = terrain.sample(x, y)
        where = f"at {x!r}, {y!r}"
        if oracle.margin(x, y, cells=False) <= 1e-9:
            continue  # on the edge of a turned rectangle or a disc, where rounding decides
        assert terrain.pointer(int(found.element)) == wanted.element, where
        assert terrain.surface(x, y) == wanted.surface, where
        assert math.isnan(found.height) == math.isnan(wanted.z), where
        if not math.isnan(wanted.z):
            error = abs(found.height - wanted.z)
            assert error <= TOLERANCE + oracle.slack(x, y), where


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_batches_and_single_points_agree_bit_for_bit(data: st.DataObject) -> None:
    """However many points are asked at a time, and together with whatever else."""
    definition = data.draw(
        definitions(
            rutted=data.draw(st.booleans()),
            free=data.draw(st.booleans()),
            gridded=True,
            classed=True,
        )
    )
    terrain = terrain_of(definition)
    x, y = np.array(landmarks(definition)[:80] + rims(definition)).T
    batch = terrain.height(x, y)
    assert np.array_equal(batch, terrain.sample(x, y).height, equal_nan=True)
    single = [terrain.height(*point) for point in zip(x, y, strict=True)]
    assert np.array_equal(batch, single, equal_nan=True)


@settings(max_examples=EXAMPLES)
@given(definitions(), st.sampled_from([(1024.0, -4096.0), (0.5, 0.25), (-65536.0, 131072.0)]))
def test_origin_only_translates(definition: dict[str, Any], shift: tuple[float, float]) -> None:
    """A terrain on a lattice of doubles moved by whole steps of it stays the same."""
    definition = {**definition, "size": [64, 32], "origin": [0, 0]}
    for surface in definition.get("surfTypes", {}).values():
        surface.pop("roughness", None)  # of the world, not of the terrain
    moved = {**definition, "origin": list(shift)}
    terrain, other = terrain_of(definition), terrain_of(moved)
    x, y = np.random.default_rng(1).integers(0, (257, 129), (60, 2)).T * 0.25
    oracle = Oracle(definition)
    clear = np.array([oracle.margin(*point) > 1e-6 for point in zip(x, y, strict=True)])
    a = terrain.sample(x[clear], y[clear])
    b = other.sample(x[clear] + shift[0], y[clear] + shift[1])
    assert np.array_equal(a.element, b.element)
    assert np.allclose(a.height, b.height, rtol=0, atol=1e-6, equal_nan=True)
