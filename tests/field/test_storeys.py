"""Columns of decks and bores against two slow readings of the format that share no code."""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from tests import composition
from tests.reduction import Reduction
from tests.storey_examples import DEFINITIONS, WORKED, Worked, pointer
from tests.storeys import Interval, Storeys

Json = dict[str, Any]


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
