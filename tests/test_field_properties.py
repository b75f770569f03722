"""The field against a slow reading of the format that shares no code with it."""

from __future__ import annotations

import json
import math

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from terratool.definition.reader import check
from terratool.definition.source import Source
from terratool.field.terrain import Terrain
from tests.oracle import Oracle
from tests.strategies import definitions, points


def compile_(definition: dict) -> Terrain:
    checked = check(Source("test.json", json.dumps(definition).encode()))
    assert checked.definition is not None, checked.findings
    return Terrain(checked.definition)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_height_surface_and_element_agree_with_the_format(data: st.DataObject) -> None:
    """Every point of every terrain, the exact edges of cells included."""
    definition = data.draw(definitions())
    terrain, oracle = compile_(definition), Oracle(definition)
    scale = largest_scale(definition)
    for x, y in data.draw(st.lists(points(definition), min_size=8, max_size=24)):
        wanted = oracle.at(x, y)
        found = terrain.sample(x, y)
        where = f"at {x!r}, {y!r}"
        assert terrain.pointer(int(found.element)) == wanted.element, where
        assert terrain.surface(x, y) == wanted.surface, where
        assert math.isnan(found.height) == math.isnan(wanted.z), where
        if not math.isnan(wanted.z):
            assert abs(found.height - wanted.z) <= 1e-6 * scale, where
        assert np.array_equal(terrain.height(x, y), found.height, equal_nan=True)


def largest_scale(definition: dict) -> float:
    """The sum of the elements' scales, by which an error of 1e-6 each can add up."""
    total, pending = 1.0, [definition["elemTree"]]
    while pending:
        element = pending.pop()
        total += abs(element.get("vScale", 1.0))
        pending.extend(element.get("children", []))
    return total
