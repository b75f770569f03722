"""Reach on random terrains with decks, ramps, bores and pits, against a plain flood over tops.

The flood knows columns and one rule: from a top a small wheel goes to the highest solid beside it
whose bottom is not above its own top by more than a step, if that top is no higher and no lower
than a step, and if there is room above it. Walls are where pixels meet. What a wheel has of a width
makes the tool more careful at rims, and there alone.
"""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from terratool.raster.grid import grid_over
from terratool.traversability.layers import sheet_of, sheet_of_elements
from tests.conftest import terrain_of
from tests.storey_examples import Json, box
from tests.traversability.test_storeys import Judged, site, wheel

WIDTH, HEIGHT, PIXEL = 10, 8, 0.25
STEP, CLIMB = 0.06, 0.07
"""A step that the wheel gets up, and what a slope of 1 in 4 rises by over a pixel, m."""
SLOPES: Json = {
    "box": {"x": [1]}, "east": {"x": [0, 1]}, "west": {"x": [1, 0]},
    "north": {"x": [1], "y": [0, 1]}, "south": {"x": [1], "y": [1, 0]},
}  # fmt: skip


def rectangle(rng: random.Random, wide: float, tall: float) -> tuple[float, ...]:
    x, y = (rng.randrange(int(2 * (most - one)) + 1) / 2
            for most, one in ((WIDTH, wide), (HEIGHT, tall)))  # fmt: skip
    return x, y, x + wide, y + tall


def random_site(rng: random.Random) -> Json:
    """Blocks and pits, decks with ramps up to one of their four sides, a tunnel, a hole."""
    deck = {"thickness": 0.25, "datum": True}
    parts = [
        box(*rectangle(rng, rng.choice([1, 2, 3]), rng.choice([1, 2])),
            vScale=rng.choice([0.75, 1, 2, -1]), surface="rock")
        for _ in range(rng.randrange(3))
    ]  # fmt: skip
    for _ in range(rng.randrange(1, 4)):
        top = rng.choice([0.75, 1, 1.25, 1.5, 2])
        west, south, east, north = place = rectangle(rng, *rng.choice([(3, 2), (4, 3), (2, 5)]))
        parts.append(box(*place, vScale=top, surface="road", deck=deck))
        run = 4 * top
        kind, ramp = rng.choice([
            ("east", (west - run, south, west, south + 1)),
            ("west", (east, south, east + run, south + 1)),
            ("north", (west, south - run, west + 1, south)),
            ("south", (west, north, west + 1, north + run)),
        ])  # fmt: skip
        if ramp[0] >= 0 and ramp[1] >= 0 and ramp[2] <= WIDTH and ramp[3] <= HEIGHT:
            parts.append(box(*ramp, type=kind, vScale=top, surface="wood", deck=deck))
    if rng.random() < 0.6:
        bore = {"height": rng.choice([0.5, 1, 3]), "datum": True}
        parts.append(box(*rectangle(rng, 3, 2), vScale=0, surface="road", bore=bore))
    if rng.random() < 0.3:
        parts.append(box(*rectangle(rng, 1, 1), vScale=0, surface="hole"))
    found = site([WIDTH, HEIGHT], *parts)
    found["elemTypes"] = SLOPES
    return found


class Flood:
    """States (row, column, number of the top) that a wheel comes to from one of them."""

    def __init__(self, definition: Json, room: float) -> None:
        self.terrain = terrain_of(definition)
        self.grid = grid_over(self.terrain, PIXEL)
        self.x, self.y = self.grid.columns(self.grid.whole), self.grid.rows(self.grid.whole)
        x, y = (one.ravel() for one in np.meshgrid(self.x, self.y))
        rows = self.terrain.columns_at(x, y)
        shape = (self.grid.height, self.grid.width, -1)
        self.top, self.bottom = rows.top.reshape(shape), rows.bottom.reshape(shape)
        self.sheet = sheet_of(sheet_of_elements(self.terrain), rows.element).reshape(shape)
        self.sheet[np.isnan(self.top)] = -1
        over = np.full_like(self.bottom, np.inf)
        over[..., :-1] = np.nan_to_num(self.bottom[..., 1:], nan=np.inf)
        self.fits = over - self.top >= room

    def beside(self, state: tuple[int, int, int], row: int, column: int) -> int:
        """The top that is driven on to at a pixel beside a state; -1 for none."""
        if not (0 <= row < self.grid.height and 0 <= column < self.grid.width):
            return -1
        z = self.top[state]
        seen = int(np.count_nonzero(self.bottom[row, column] <= z + STEP)) - 1
        if seen < 0 or abs(self.top[row, column, seen] - z) > CLIMB:
            return -1
        return seen if self.fits[row, column, seen] else -1

    def around(self, state: tuple[int, int, int], reach: int) -> list[int]:
        """What `beside` says of the neighbours, four for a `reach` of 1, and eight for 2."""
        row, column, _ = state
        return [
            self.beside(state, row + down, column + right)
            for down in (-1, 0, 1) for right in (-1, 0, 1)
            if 0 < abs(down) + abs(right) <= reach
        ]  # fmt: skip

    def reached(self, start: tuple[int, int, int]) -> Any:
        found = np.zeros(self.top.shape, np.bool_)
        found[start], todo = True, [start]
        while todo:
            state = todo.pop()
            for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                row, column = state[0] + down, state[1] + right
                top = self.beside(state, row, column)
                if top >= 0 and not found[row, column, top]:
                    found[row, column, top] = True
                    todo.append((row, column, top))
        return found


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4, 9, 14, 21, 43, 56, 78, 85, 116])
def test_what_is_reached_is_what_a_flood_over_tops_reaches(seed: int) -> None:
    """Nothing more; and all but rims, from where something beside is not driven on to."""
    rng = random.Random(seed)
    definition, room = random_site(rng), rng.choice([0.45, 0.8])
    flood = Flood(definition, room)
    states = [
        tuple(state) for state in np.argwhere(flood.fits).tolist()
        if min(flood.around(tuple(state), 2)) >= 0
    ]  # fmt: skip
    start = rng.choice(states)
    wanted = flood.reached(start)
    place = flood.x[start[1]], flood.y[start[0]], flood.top[start]
    judged = Judged(definition, wheel(room), place, PIXEL)
    found = np.zeros_like(wanted)
    for number in range(judged.stack.sheets):
        here = flood.sheet == number
        found |= here & (judged.sheet(judged.reached, number) > 0)[..., None]
    assert not (found & ~wanted).any() and found.sum() > 20
    inner = [
        state for state in map(tuple, np.argwhere(wanted & ~found).tolist())
        if min(flood.around(state, 2)) >= 0
    ]  # fmt: skip
    assert inner == []
