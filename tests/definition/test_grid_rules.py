"""What rules say of grids of heights, and how these are laid out."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.layout import canonical
from terratool.definition.reader import CheckOptions, check
from terratool.text.source import Source
from tests.oracle import grid_value
from tests.strategies import grids_of_heights


def codes(grid: dict[str, Any], child: dict[str, Any] | None = None, **options: Any) -> list[str]:
    """Codes of the remarks on an oblong terrain of a grid, alone or on level ground."""
    types: dict[str, Any] = {"dem": grid}
    root: dict[str, Any] = {"type": "dem", "vScale": 1}
    if child is not None:
        types["level"] = {"x": [1]}
        root = {
            "type": "level",
            "vScale": 1,
            "cells": [4, 2],
            "children": [{**child, "type": "dem"}],
        }
    text = json.dumps({"size": [12, 6], "elemTypes": types, "elemTree": root})
    checked = check(Source("t.json", text.encode()), CheckOptions(**options))
    assert checked.terrain is not None, checked.findings
    return [finding.code for finding in checked.findings]


def test_heights_of_grids_have_any_size() -> None:
    assert codes({"grid": [[0, 250], [-3, 17]]}) == []


def test_a_grid_of_zeros_is_remarked_on_but_for_one_that_takes_ground_away() -> None:
    assert codes({"grid": [[0, 0], [0, 0]]}) == ["TT308"]
    assert codes({"grid": [[0, 0, 0], [0, 0, None]]}) == []
    assert codes({"grid": [[None]]}) == []


@pytest.mark.parametrize(
    ("rows", "tall"),
    [
        ([[0, 0, 0], [0, 9, 0], [0, 0, 0]], False),
        ([[0, 0, 0.3], [0, 0, 0], [0, 0, 0]], True),
        ([[0, 0, 0], [0, 0, 0], [0, -0.3, 0]], True),
        ([[0, 0, 0], [0.3, 9, 0], [0, 0, 0]], True),
        ([[0.1, 0, None], [0, 9, 0], [0, 0, 0.1]], False),
    ],
)
def test_a_step_is_where_the_rim_is_not_0(rows: Any, tall: bool) -> None:
    """Inside a grid nothing jumps; where it is void there is no ground to jump to."""
    child = {"cellX": 1, "cellY": 0, "vScale": 1}
    assert ("TT211" in codes({"grid": rows}, child, max_step=0.2)) == tall


@given(grids_of_heights(), st.sampled_from([30, 45, 90, -100]))
def test_what_is_cut_off_is_remarked_on(grid: dict[str, Any], turn: float) -> None:
    """A turned grid without the remark is 0 wherever its oblong cell of 6 × 3 cuts it off."""
    child = {"cellX": 0, "cellY": 0, "span": [2, 1], "vScale": 1, "turnDeg": turn}
    if "TT213" in codes(grid, child):
        return
    n = len(grid["grid"][0]), len(grid["grid"])
    pixel = grid.get("registration") == "pixel"
    cells = [count if pixel else max(count - 1, 1) for count in n]
    for u, v in np.random.default_rng(3).uniform(0, 1, (300, 2)).tolist():
        a, b, angle = (u - 0.5) * 6, (v - 0.5) * 3, math.radians(turn)
        x, y = a * math.cos(angle) + b * math.sin(angle), b * math.cos(angle) - a * math.sin(angle)
        if abs(x) > 3 or abs(y) > 1.5:
            cell = min(int(u * cells[0]), cells[0] - 1), min(int(v * cells[1]), cells[1] - 1)
            assert grid_value(grid, (u, v), cell) == 0


def test_a_hill_in_the_middle_of_a_grid_is_not_cut_off() -> None:
    hill = {"grid": [[0] * 9, [0] * 9, [0, 0, 0, 0, 7, 0, 0, 0, 0], [0] * 9, [0] * 9]}
    child = {"cellX": 0, "cellY": 0, "span": [2, 1], "vScale": 1, "turnDeg": 30}
    assert codes(hill, child) == []
    hill["grid"][0][8] = 1
    assert codes(hill, child) == ["TT213"]


@pytest.mark.parametrize(("row", "cut"), [(0, False), (8, True)])
def test_the_first_row_is_the_north(row: int, cut: bool) -> None:
    """Turned by 30° the cell cuts off the south-east of the southern edge, not of the northern."""
    rows = [[0] * 9 for _ in range(9)]
    rows[row][6] = 1
    child = {"cellX": 0, "cellY": 0, "span": [2, 1], "vScale": 1, "turnDeg": 30}
    assert codes({"grid": rows}, child) == ["TT213"] * cut


def test_a_row_of_a_grid_is_a_line_however_long() -> None:
    """Numbers stay as they are spelled."""
    row = ", ".join(["1.50", "null", "-2e3"] * 50)
    text = f'{{"elemTypes":{{"d":{{"grid":[[{row}],[{row}]],"registration":"pixel"}}}}}}'
    assert canonical(text).splitlines()[2:8] == [
        '    "d": {',
        '      "registration": "pixel",',
        '      "grid": [',
        f"        [{row}],",
        f"        [{row}]",
        "      ]",
    ]
    assert canonical(canonical(text)) == canonical(text)
