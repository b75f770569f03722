"""Addresses of cells, level by level, against the slow reading of the format."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.budget import examples
from tests.conftest import terrain_of
from tests.oracle import Element, Oracle, Side
from tests.strategies import definitions, landmarks, points, rims

EXAMPLES = examples(25)

# Oblong in all: a root of 3 × 2 cells, in the cell (2, 0) an element of 4 × 5 cells, in its block
# (1, 2) to (2, 2) a plate; a track over all of it.
NESTED: dict[str, Any] = {
    "size": [60, 26],
    "origin": [-10, 100],
    "surfTypes": {"soil": {}, "rut": {}},
    "elemTypes": {"flat": {"x": [1]}, "disc": {"x": [1, 1], "combine": "radial"}},
    "elemTree": {
        "type": "flat", "surface": "soil", "cells": [3, 2],
        "children": [
            {
                "cellX": 2, "cellY": 0, "type": "flat", "cells": [4, 5],
                "children": [
                    {"cellX": 1, "cellY": 2, "span": [2, 1], "type": "flat"},
                    {"cellX": 3, "cellY": 4, "type": "disc", "cells": 2, "children": [
                        {"cellX": 1, "cellY": 0, "type": "flat"},
                    ]},
                ],
            },
            {"at": [10, 20], "extent": [4, 2], "type": "flat", "cells": [2, 1], "children": [
                {"cellX": 1, "cellY": 0, "type": "flat"},
            ]},
        ],
    },
}  # fmt: skip


def test_levels_of_a_terrain_by_hand() -> None:
    """Cells of 20 × 13, in one of them of 5 × 2.6, and a block there is no cell of its own."""
    terrain = terrain_of(NESTED)
    found = terrain.locate([-5.0, 31.0, 39.0, 42.0, 70.0], [120.0, 101.0, 106.0, 105.3, 100.0])
    none = [-1, -1]
    assert found.cells.tolist() == [
        [[0, 1], none, none],
        [[2, 0], [0, 0], none],
        [[2, 0], [1, 2], none],
        [[2, 0], [2, 2], none],
        [none, none, none],
    ]
    assert found.elements.tolist()[:3] == [[0, -1, -1], [0, 1, -1], [0, 1, -1]]


def test_free_places_have_grids_too() -> None:
    """The element at (−2 … 2, 119 … 121) has two cells; it stands in the root's cell (0, 1)."""
    terrain = terrain_of(NESTED)
    for x, cell in ((-1.0, 0), (1.0, 1)):
        found = terrain.locate(x, 120.0)
        assert found.cells.tolist() == [[0, 1], [cell, 0], [-1, -1]]
        assert terrain.pointer(int(found.elements[1])) == "/elemTree/children/1"


def test_a_turned_footprint_may_lie_beside_its_cell() -> None:
    """It is 2 by 4 after a quarter turn, its cell 4 by 2: to the north of that it has no cells."""
    turned = dict(NESTED["elemTree"]["children"][1], turnDeg=90)
    tree = {**NESTED["elemTree"], "children": [turned]}
    found = terrain_of({**NESTED, "elemTree": tree}).locate([0.0, 0.0], [120.5, 121.5])
    assert found.cells[:, 1].tolist() == [[1, 0], [-1, -1]]
    assert found.elements[:, 1].tolist() == [1, -1]


def test_edges_belong_to_the_east_and_the_north() -> None:
    """But for the terrain's own, which belong to its last cells."""
    terrain = terrain_of(NESTED)
    west = np.nextafter(10.0, -np.inf)
    x = [west, 10.0, 30.0, 50.0, np.nextafter(50.0, np.inf)]
    cells = terrain.locate(x, 126.0).cells[:, 0]
    assert cells.tolist() == [[0, 1], [1, 1], [2, 1], [2, 1], [-1, -1]]


def test_tracks_change_no_address() -> None:
    """A rut has no cells: the address is that of the ground under it."""
    track = {"path": [[31, 101], [45, 112]], "width": 3, "depth": 0.1, "surface": "rut"}
    terrain, driven = terrain_of(NESTED), terrain_of({**NESTED, "tracks": [track]})
    x, y = np.random.default_rng(4).uniform((30, 100), (50, 113), (500, 2)).T
    assert (driven.surface(x, y) == "rut").sum() > 50
    np.testing.assert_array_equal(driven.locate(x, y).cells, terrain.locate(x, y).cells)
    np.testing.assert_array_equal(driven.locate(x, y).elements, terrain.locate(x, y).elements)


def test_shapes_are_those_of_the_points() -> None:
    """Points broadcast, and a root alone has no grid in it."""
    found = terrain_of(NESTED).locate(np.zeros((2, 1)), np.zeros(5))
    assert found.cells.shape == (2, 5, 3, 2)
    assert found.elements.shape == (2, 5, 3)
    alone = {**NESTED, "elemTree": {"type": "flat"}}
    assert terrain_of(alone).locate(0.0, 110.0).cells.shape == (0, 2)


def cell_of(side: Side, count: int, p: float, ground: Side) -> int:
    """Which of so many equal parts of a side holds a coordinate."""
    near = math.floor((Fraction(p) - side.low) / side.length * count)
    around = range(max(near - 1, 0), min(near + 2, count))
    return next((k for k in around if side.part(k, 1, count).holds(p, ground)), count - 1)


def by_format(oracle: Oracle, x: float, y: float) -> list[list[int]] | None:
    """The cells from the root to the deepest element, from exact positions."""
    if not oracle._in_cell(oracle.ground, x, y):
        return []
    covering = oracle._covering(x, y)
    if not covering:
        return []
    winner = max(reversed(covering), key=lambda element: element.level)
    around = {element.pointer: element for element in oracle._around(x, y)}
    pointer, chain = winner.pointer, list[Element]()
    while pointer:
        chain.append(around.get(pointer, winner))
        pointer = pointer.rpartition("/children/")[0]
    found = []
    for element in reversed(chain):
        children = element.node.get("children", [])
        if not children or not oracle._in_cell(element.cell, x, y):
            break
        if all("at" in child for child in children):
            found.append([0, 0])
            continue
        sides = zip(element.cell, element.grid, (x, y), oracle.ground, strict=True)
        found.append([cell_of(*one) for one in sides])
    return found


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_addresses_agree_with_the_format(data: st.DataObject) -> None:
    """At random points, and on, beside and between all edges of cells, to the last bit."""
    definition = data.draw(
        definitions(rutted=data.draw(st.booleans()), free=data.draw(st.booleans()))
    )
    terrain, oracle = terrain_of(definition), Oracle(definition)
    drawn = data.draw(st.lists(points(definition), min_size=4, max_size=12))
    places = landmarks(definition)[:40] + rims(definition) + drawn
    x, y = np.array(places).T
    found = terrain.locate(x, y)
    for place, cells in zip(places, found.cells.tolist(), strict=True):
        if oracle.margin(*place, cells=False) <= 1e-9:
            continue  # on the edge of a turned rectangle or a disc, where rounding decides
        wanted = by_format(oracle, *place)
        assert [cell for cell in cells if cell != [-1, -1]] == wanted, f"at {place}"
