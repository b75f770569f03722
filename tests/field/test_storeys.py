"""Columns of decks and bores against two slow readings of the format that share no code."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import composition
from tests.budget import examples
from tests.reduction import Reduction
from tests.storey_examples import DEFINITIONS, WORKED, Worked, pointer
from tests.storey_trees import lattices, on_lattice, with_storeys
from tests.storeys import Interval, Storeys
from tests.strategies import Point, definitions, landmarks
from tests.strategies import points as st_points

Json = dict[str, Any]
TOLERANCE = 2e-6
"""How far curves that are cut in pieces may be off, as in tests/field/test_properties.py."""


def plain(definition: Json) -> composition.Plain:
    return composition.plain({"terrain.json": json.dumps(definition)}, "terrain.json")


def spelled(column: list[Interval]) -> list[tuple[Any, ...]]:
    return [(one.surface, one.element, one.under) for one in column]


def assert_same(found: list[Interval], wanted: list[Interval], within: float) -> None:
    """Two columns of the same intervals, whose ends are as far apart as they may be."""
    assert spelled(found) == spelled(wanted)
    for a, b in zip(found, wanted, strict=True):
        assert a.bottom == b.bottom or abs(a.bottom - b.bottom) <= within, (found, wanted)
        assert abs(a.top - b.top) <= within, (found, wanted)


def by_hand(worked: Worked) -> list[Interval]:
    return [
        Interval(bottom, top, surface, pointer(element), pointer(under))
        for bottom, top, surface, element, under in worked.column
    ]


@pytest.mark.parametrize("worked", WORKED, ids=lambda w: f"{w.of} {w.x} {w.y}: {w.why}")
def test_the_readings_agree_with_columns_by_hand(worked: Worked) -> None:
    definition = plain(DEFINITIONS[worked.of]).definition
    assert_same(Storeys(definition).column(worked.x, worked.y), by_hand(worked), 1e-12)


@pytest.mark.parametrize("name", DEFINITIONS)
def test_the_reduction_to_plain_terrains_agrees_with_columns_by_hand(name: str) -> None:
    mine = [worked for worked in WORKED if worked.of == name]
    x, y = np.array([(worked.x, worked.y) for worked in mine], float).T
    reduction = Reduction(whole(plain(DEFINITIONS[name]).definition))
    for worked, found in zip(mine, reduction.columns(x, y), strict=True):
        assert_same(found, by_hand(worked), 1e-6)


def whole(value: Any) -> Any:
    """A definition whose places are fractions, with the nearest numbers in their stead."""
    if isinstance(value, dict):
        return {key: whole(item) for key, item in value.items()}
    if isinstance(value, list):
        return [whole(item) for item in value]
    return float(value) if isinstance(value, Fraction) else value


def unsure(oracle: Storeys, x: float, y: float, within: float) -> bool:
    """Whether rounding decides which of two faces is the higher one, or what holds the point."""
    if oracle.margin(x, y) <= 1e-9:
        return True
    ground, storeys = oracle.faces(x, y)
    faces = sorted([ground.z, *(z for one in storeys for z in (one.top.z, one.other))])
    return any(0 < b - a <= within for a, b in pairwise(faces))


def agree(definition: Json, points: list[Point], within: float) -> int:
    """Compare the two readings; the number of points that could be compared."""
    oracle, reduction = Storeys(definition), Reduction(definition)
    x, y = np.array(points, float).T
    count = 0
    for point, other in zip(points, reduction.columns(x, y), strict=True):
        apart = within + oracle.slack(*point)
        if not unsure(oracle, *point, apart):
            count += 1
            assert_same(other, oracle.column(*point), apart)
    return count


@settings(max_examples=examples(40))
@given(st.data())
def test_the_readings_agree_where_faces_meet(data: st.DataObject) -> None:
    definition = data.draw(lattices())
    points = data.draw(st.lists(on_lattice(definition), min_size=30, max_size=30))
    points += landmarks(definition)
    agree(definition, points, 1e-12)


@pytest.mark.nightly
@settings(max_examples=examples(40))
@given(st.data())
def test_the_readings_agree_on_terrains_of_all_kinds(data: st.DataObject) -> None:
    definition = data.draw(with_storeys(definitions(free=True, gridded=True, classed=True)))
    drawn = data.draw(st.lists(st_points(definition), min_size=10, max_size=10))
    agree(definition, landmarks(definition)[:60] + drawn, TOLERANCE)
