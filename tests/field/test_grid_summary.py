"""What the summary of a terrain says of grids of heights."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.summary import height_range
from tests.budget import examples
from tests.conftest import terrain_of
from tests.strategies import grids_of_heights

ROWS = [[0.5, -3.25, 1, 4, 2], [9, 2.5, 0, 1, -7], [3, 3, 3, 12.5, 1]]


def field_of(primitive: dict[str, Any], root: dict[str, Any], **more: Any) -> Any:
    """An oblong terrain of one primitive, `d`."""
    types = {"d": primitive, "flat": {"x": [0]}}
    return terrain_of({"size": [7, 4], "elemTypes": types, "elemTree": root, **more})


@settings(max_examples=examples(40))
@given(primitive=grids_of_heights(), turn=st.sampled_from([0, 180]))
def test_extremes_of_a_grid_alone_are_numbers(primitive: dict[str, Any], turn: int) -> None:
    """Least and greatest number that has ground, or a mean of neighbours at the rim of a void."""
    terrain = field_of(primitive, {"type": "d", "vScale": 2, "vOffset": 1, "turnDeg": turn})
    low, high, _ = height_range(terrain)
    numbers = [2 * z + 1 for row in primitive["grid"] for z in row if z is not None]
    x, y = np.random.default_rng(1).uniform((0, 0), (7, 4), (4000, 2)).T
    seen = terrain.height(x, y)
    if low is None or high is None:
        assert np.isnan(seen).all()
        return
    assert np.nanmin(seen, initial=low) >= low - 1e-9
    assert np.nanmax(seen, initial=high) <= high + 1e-9
    assert min(numbers) - 1e-9 <= low and high <= max(numbers) + 1e-9
    if all(z is not None for row in primitive["grid"] for z in row):
        assert (low, high) == pytest.approx((min(numbers), max(numbers)), abs=1e-9)


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
@pytest.mark.parametrize("turn", [0, 30, 90])
def test_a_narrow_peak_is_found_in_a_part(registration: str, turn: float) -> None:
    """One number of a million in a small free place, turned as a whole, in a part."""
    heights = np.zeros((400, 300))
    heights[123, 271], heights[33, 7] = 5, -4
    part = {"type": "d", "vScale": 1, "turnDeg": turn}
    holder = {"type": "flat", "cells": 1}
    place = {"at": [2.5, 1.75], "extent": [1.5, 2]}
    terrain = field_of(
        {"grid": heights.tolist(), "registration": registration},
        {**holder, "children": [{**place, **part}, {**place, "at": [5.5, 2], **part}]},
    )
    low, high, _ = height_range(terrain)
    assert (low, high) == pytest.approx((-4, 5), abs=1e-6)


def test_a_corner_beside_a_void_counts() -> None:
    """The ground ends at a number that is the greatest, and belongs to the void itself."""
    rows = [[0, 0, 0, None], [0, 0, 9, 0], [0, 0, 0, 0]]
    terrain = field_of({"grid": rows}, {"type": "d", "vScale": 1})
    assert height_range(terrain)[:2] == (0, pytest.approx(9, abs=1e-9))


def test_of_too_many_numbers_the_extremes_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terratool.field.summary._WORK", 4000)
    heights = np.zeros((157, 211))
    heights[100, 37], heights[17, 200] = 5, -4
    terrain = field_of({"grid": heights.tolist()}, {"type": "d", "vScale": 1})
    assert height_range(terrain)[:2] == (-4, 5)


def test_extremes_are_those_of_numbers_by_hand() -> None:
    """Of an oblong grid under a bump that makes none of its numbers the greatest."""
    bump = {"cellX": 0, "cellY": 1, "type": "flat", "vOffset": 5}
    root = {"type": "d", "vScale": 1, "cells": [7, 4], "children": [bump]}
    low, high, _ = height_range(field_of({"grid": ROWS}, root))
    assert (low, high) == pytest.approx((-7, 14), abs=1e-6)
