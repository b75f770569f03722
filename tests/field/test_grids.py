"""Grids of heights in the text: what lies beside void cells, and heights to the last bit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terratool.field.rays import cast
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from tests.conftest import terrain_of
from tests.oracle import grid_value

VOID_SECOND: list[list[float | None]] = [[100, None, 0, 0, 0, 0], [100, None, 0, 0, 0, 0]]
"""Level ground in the east, and a high number beyond the void cells in the west."""


def grid(rows: Any, size: list[float], **primitive: Any) -> dict[str, Any]:
    return {
        "size": size,
        "elemTypes": {"dem": {"grid": rows, **primitive}},
        "elemTree": {"type": "dem", "vScale": 1},
    }


@pytest.mark.parametrize("across", [False, True], ids=["along x", "along y"])
def test_beside_a_void_cell_the_ground_is_its_own(across: bool) -> None:
    """On the edge of the void, whose place no double has, the slope is that of the ground."""
    rows: Any = VOID_SECOND
    if across:  # from the south to the north
        rows = np.array(VOID_SECOND, object).T[::-1].tolist()
    terrain = terrain_of(grid(rows, [1, 7] if across else [7, 1]))
    near = [np.nextafter(2.8, -9), 2.8, np.nextafter(2.8, 9)]
    x, y = (np.full(3, 0.5), np.array(near)) if across else (np.array(near), np.full(3, 0.5))
    found = terrain.sample(x, y)
    assert np.array_equal(found.height, [math.nan, 0, 0], equal_nan=True)
    assert np.array_equal(found.normal[1:], [[0, 0, 1]] * 2)
    edge = (0.1, 2.4, 0.9, 3.2) if across else (2.4, 0.1, 3.2, 0.9)
    pixel = grid_over(terrain, 0.8, edge)
    assert pixel.columns(pixel.whole)[0] in x[1:] and pixel.rows(pixel.whole)[0] in y[1:]
    drawn = Painter(terrain, pixel, slopes=True).paint(pixel.whole)
    assert drawn.slope_x == drawn.slope_y == drawn.heights == 0.0
    down = cast(terrain, [[x[1], y[1], 5]], [[0, 0, -1]])
    assert down.distance == 5 and np.array_equal(down.normal, [[0, 0, 1]])


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
def test_heights_to_the_last_bit(registration: str) -> None:
    """Where places are exact in doubles, heights are those of the formula in doubles."""
    pixel = registration == "pixel"
    rng = np.random.default_rng(11)
    rows = rng.uniform(-7, 7, (4, 8) if pixel else (5, 9))
    terrain = terrain_of(grid(rows.tolist(), [8, 4], registration=registration))
    primitive = {"grid": rows.tolist(), "registration": registration}
    x, y = (a.ravel() for a in np.meshgrid(np.arange(64) / 8 + 1 / 16, np.arange(32) / 8 + 1 / 16))
    wanted = [
        grid_value(primitive, (at_x / 8, at_y / 4), (int(at_x), int(at_y)))
        for at_x, at_y in zip(x.tolist(), y.tolist(), strict=True)
    ]
    assert np.array_equal(terrain.height(x, y), wanted)
    assert [terrain.height(*at) for at in zip(x.tolist(), y.tolist(), strict=True)] == wanted
