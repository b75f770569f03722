"""The graph of a survey against a slow reading of its rules, searched by networkx."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import networkx
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terratool.errors import RequestError
from terratool.traversability.route.graph import (
    ALLOWED,
    BACKING,
    BACKWARD,
    Costs,
    Turns,
    cells_between,
    cheapest_way,
    heading_offsets,
    rates,
)
from terratool.traversability.route.reach import (
    Bits,
    begin_at,
    begin_in_largest,
    can_turn_back,
    connected_cells,
    heading_bits,
    place_in,
    spread,
)
from tests.budget import examples
from tests.surveys import ROVER, drawn

RESOLUTION, ARC = 0.5, 0.3


def slow(
    rate: np.ndarray[Any, Any], can: np.ndarray[Any, Any], heights: np.ndarray[Any, Any]
) -> networkx.DiGraph:
    """States are (heading, row, column); each rule as the docstrings put it."""
    headings, rows, columns = can.shape
    graph = networkx.DiGraph()
    for heading, row, column in np.ndindex(can.shape):
        if not can[heading, row, column]:
            continue
        here = (heading, row, column)
        graph.add_node(here)
        for other in ((heading + 1) % headings, (heading - 1) % headings):
            if can[other, row, column]:
                mean = 0.5 * (float(rate[here]) + float(rate[other, row, column]))
                graph.add_edge(here, (other, row, column), weight=mean * ARC)
        opposite = (heading + headings // 2) % headings
        south, east = heading_offsets(headings)[heading]
        for sign, judged in ((1, heading), (-1, opposite)):
            there = (row + sign * south, column + sign * east)
            if not (0 <= there[0] < rows and 0 <= there[1] < columns):
                continue
            steps = max(abs(south), abs(east))
            stops = []
            for step in range(steps + 1):
                exact = (sign * south * step / steps, sign * east * step / steps)
                stops.append(
                    {(row + a, column + b)
                     for a in (math.floor(exact[0]), math.ceil(exact[0]))
                     for b in (math.floor(exact[1]), math.ceil(exact[1]))}
                )  # fmt: skip
            if not all(
                can[judged, *cell] and (sign > 0 or can[heading, *cell])
                for stop in stops
                for cell in stop
            ):
                continue
            prices = [max(float(rate[judged, *cell]) for cell in stop) for stop in stops]
            near = [
                (row + round(sign * south * n / steps), column + round(sign * east * n / steps))
                for n in range(steps + 1)
            ]
            level = [float(heights[cell]) for cell in near]
            stride = RESOLUTION * math.hypot(south, east) / steps
            weight = sum(
                math.hypot(stride, level[n + 1] - level[n]) * 0.5 * (prices[n] + prices[n + 1])
                for n in range(steps)
            )
            graph.add_edge(
                here, (heading, *there), weight=weight if sign > 0 else BACKWARD * weight
            )
    return graph


def drawn_case(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> tuple[np.random.Generator, Any, Any, Any]:
    rng = np.random.default_rng(seed)
    can = rng.random((headings, *shape)) < share
    rate = rng.uniform(0.1, 3.0, can.shape).astype(np.float32)
    heights = rng.uniform(-1.0, 1.0, shape).astype(np.float32)
    return rng, can, rate, heights


def costs_of(rate: Any, can: Any, heights: Any, tile: int = 0) -> Costs:
    flags = np.where(can, ALLOWED | BACKING, 0).astype(np.uint8)
    least = float(rate.min()) if rate.size else 1.0
    return Costs.of(rate, flags, heights, RESOLUTION, Turns(ARC), least, tile)


def states_at(can: Any, cell: tuple[int, int]) -> np.ndarray[Any, Any]:
    headings = np.flatnonzero(can[:, *cell]).tolist()
    return np.array([(heading, *cell) for heading in headings], np.int64).reshape(-1, 3)


def states_of(bits: Bits, headings: int) -> list[tuple[int, ...]]:
    planes = [bits >> heading & 1 for heading in range(headings)]
    return [tuple(state) for state in np.argwhere(planes).tolist()]


CASES = given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from([(1, 1), (1, 6), (5, 3), (4, 7), (6, 6)]),
    headings=st.sampled_from([4, 8, 12, 16]),
    share=st.sampled_from([0.3, 0.6, 0.8, 1.0]),
)


@settings(max_examples=examples(60), deadline=None)
@CASES
def test_the_search_finds_the_cheapest_way_by_the_moves_of_the_rules(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> None:
    """To every cell, as networkx finds it in a graph that is built move by move."""
    rng, can, rate, heights = drawn_case(seed, shape, headings, share)
    expected = slow(rate, can, heights)
    begin = tuple(int(rng.integers(side)) for side in shape)
    starts = states_at(can, begin)
    known = {}
    if len(starts):
        known = networkx.multi_source_dijkstra_path_length(
            expected, {tuple(state) for state in starts.tolist()}
        )
    for cell in np.ndindex(shape):
        found = cheapest_way(costs_of(rate, can, heights), starts, cell)
        best = min((cost for state, cost in known.items() if state[1:] == cell), default=math.inf)
        assert found.cost == pytest.approx(best, rel=1e-5)
        way = [tuple(state) for state in found.states.tolist()]
        assert bool(way) == math.isfinite(best)
        if way:
            assert way[0][1:] == begin and way[-1][1:] == cell
            paid = sum(expected.edges[pair]["weight"] for pair in pairwise(way))
            assert paid == pytest.approx(best, rel=1e-5)
        else:
            cells = {(int(r), int(c)) for r, c in np.argwhere(found.reached)}
            assert cells == {state[1:] for state in known}


@settings(max_examples=examples(60), deadline=None)
@CASES
def test_tiles_that_are_asked_for_are_enough(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> None:
    """What is filled in tile by tile gives the same way, state by state; no tile is asked twice."""
    rng, can, rate, heights = drawn_case(seed, shape, headings, share)
    begin, end = (tuple(int(rng.integers(side)) for side in shape) for _ in range(2))
    whole = cheapest_way(costs_of(rate, can, heights), states_at(can, begin), end)
    side = int(rng.integers(1, 4))
    blank = costs_of(np.full_like(rate, 99.0), np.zeros_like(can), heights, side)
    least = float(rate.min())
    lazy = Costs.of(blank.rate, blank.flags, heights, RESOLUTION, Turns(ARC), least, side)
    asked: list[int] = []

    def ask(tile: int) -> None:
        row, column = (at * side for at in divmod(tile, lazy.known.shape[1]))
        part = np.s_[:, row : row + side, column : column + side]
        lazy.rate[part] = rate[part]
        lazy.flags[part] = np.where(can[part], ALLOWED | BACKING, 0)
        lazy.known.reshape(-1)[tile] = True
        asked.append(tile)

    found = cheapest_way(lazy, states_at(can, begin), end, ask)
    assert found.cost == whole.cost
    assert np.array_equal(found.states, whole.states)
    assert np.array_equal(found.reached, whole.reached)
    assert len(set(asked)) == len(asked)


def test_a_way_nearby_asks_for_little() -> None:
    """On even ground of 40 × 60 cells, from one corner to near it, far tiles are not asked for."""
    can = np.ones((8, 40, 60), np.bool_)
    rate, heights = np.ones(can.shape, np.float32), np.zeros(can.shape[1:], np.float32)
    costs = costs_of(rate, can, heights, 10)
    asked: list[int] = []

    def ask(tile: int) -> None:
        costs.known.reshape(-1)[tile] = True
        asked.append(tile)

    cheapest_way(costs, states_at(can, (2, 2)), (5, 14), ask)
    assert {0, 1} <= set(asked) <= {0, 1, 2, 6, 7, 8}


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@CASES
def test_floods_reach_what_the_moves_reach(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> None:
    """Along the moves, against them, and back to where they begin, as networkx has them."""
    rng, can, rate, heights = drawn_case(seed, shape, headings, share)
    graph = slow(rate, can, heights)
    begin = np.zeros_like(can)
    begin[tuple(int(rng.integers(side)) for side in can.shape)] = True
    begin &= can
    seeds = {tuple(state) for state in np.argwhere(begin).tolist()}
    bits, first = heading_bits(can), heading_bits(begin)
    for against, one in ((False, graph), (True, graph.reverse())):
        wanted = set().union(seeds, *(networkx.descendants(one, state) for state in seeds))
        told: list[float] = []
        found = spread(bits, headings, first, against, told.append)
        assert set(states_of(found, headings)) == wanted
        assert min(told) >= 0.0
        assert sum(told) == pytest.approx(1.0)
    both = connected_cells(bits, headings, first)
    there = set().union(seeds, *(networkx.descendants(graph, state) for state in seeds))
    back = {state for state in there if seeds & ({state} | networkx.descendants(graph, state))}
    assert {tuple(cell) for cell in np.argwhere(both.reached).tolist()} == {s[1:] for s in there}
    assert {tuple(cell) for cell in np.argwhere(both.returned).tolist()} == {s[1:] for s in back}


@settings(max_examples=examples(60), deadline=None)
@CASES
def test_the_largest_part_is_that_of_moves_that_go_both_ways(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> None:
    _, can, rate, heights = drawn_case(seed, shape, headings, share)
    graph = slow(rate, can, heights)
    mutual = networkx.Graph()
    mutual.add_nodes_from(graph)
    mutual.add_edges_from((a, b) for a, b in graph.edges if graph.has_edge(b, a))
    parts = sorted(map(len, networkx.connected_components(mutual)))
    told: list[float] = []
    states = states_of(begin_in_largest(heading_bits(can), headings, told.append), headings)
    assert sum(told) == pytest.approx(1.0)
    assert len(states) == bool(parts)
    if parts:
        (state,) = states
        assert len(networkx.node_connected_component(mutual, state)) == parts[-1]
    pairs = can & np.roll(can, headings // 2, axis=0)
    assert np.array_equal(can_turn_back(heading_bits(can), headings), pairs.any(axis=0))


@pytest.mark.parametrize("headings", [8, 16, 20, 64])
def test_headings_are_bits_from_the_lowest_on(headings: int) -> None:
    """Each in the smallest type that has room, on an oblong ground."""
    can = np.zeros((headings, 2, 5), np.bool_)
    can[0, 1, 3] = can[headings - 1, 1, 3] = can[2, 0, 4] = True
    bits = heading_bits(can)
    assert bits.dtype.itemsize == {8: 1, 16: 2, 20: 4, 64: 8}[headings]
    assert {cell: int(bits[cell]) for cell in np.ndindex(2, 5) if bits[cell]} == {
        (1, 3): 1 + 2 ** (headings - 1),
        (0, 4): 4,
    }


@settings(max_examples=examples(100), deadline=None)
@CASES
def test_a_place_in_the_largest_part_stands_for_all_of_it(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> None:
    """Whoever sets out there reaches the same cells, if it can turn to all that it can drive."""
    _, can, _, _ = drawn_case(seed, shape, headings, share)
    bits = heading_bits(can)
    found = connected_cells(bits, headings, begin_in_largest(bits, headings))
    assume(found.returned.any())
    cell = place_in(bits, headings, found)
    assert found.returned[cell]
    turns = np.count_nonzero(can & ~np.roll(can, 1, axis=0), axis=0) <= 1
    if (turns & found.returned).any():
        assert turns[cell]
        again = connected_cells(bits, headings, begin_at(bits, cell))
        assert np.array_equal(again.reached, found.reached)
        assert np.array_equal(again.returned, found.returned)


def test_a_place_in_the_largest_part_is_near_its_middle() -> None:
    """Of two yards the larger, east of a wall; oblong, so that no axis is taken for the other."""
    can = np.ones((8, 9, 40), np.bool_)
    can[:, :, 12] = False
    bits = heading_bits(can)
    found = connected_cells(bits, 8, begin_in_largest(bits, 8))
    assert place_in(bits, 8, found) in {(4, 26), (4, 25)}
    can[:, 3:6, 20:32] = False  # a block in the middle: beside it
    bits = heading_bits(can)
    row, column = place_in(bits, 8, connected_cells(bits, 8, begin_in_largest(bits, 8)))
    assert row in {2, 6} and 20 <= column < 32


def test_eight_headings_point_to_the_neighbours_clockwise_from_north() -> None:
    clockwise = [(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)]
    assert list(heading_offsets(8)) == clockwise
    assert list(heading_offsets(4)) == clockwise[::2]


@pytest.mark.parametrize("headings", range(4, 65, 4))
def test_headings_point_where_they_look_and_back(headings: int) -> None:
    found = heading_offsets(headings)
    assert len(set(found)) == headings
    for n, (south, east) in enumerate(found):
        off = math.degrees(math.atan2(east, -south)) - 360.0 * n / headings
        assert abs((off + 180.0) % 360.0 - 180.0) <= 90.0 / headings
        assert math.gcd(south, east) == 1
        assert found[(n + headings // 2) % headings] == (-south, -east)


def test_a_knight_passes_two_cells() -> None:
    assert {cell for pair in cells_between((-2, 1)) for cell in pair} == {(-1, 0), (-1, 1)}
    assert cells_between((1, -1)) == [] and cells_between((0, 0)) == []


@pytest.mark.parametrize("headings", [0, 1, 2, 6, 10, -4])
def test_headings_are_a_multiple_of_four(headings: int) -> None:
    with pytest.raises(RequestError, match=f"with {headings} headings"):
        heading_offsets(headings)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("power", [0.0, 3.0])
def test_energy_of_wheels_that_spin_on_the_spot(power: float) -> None:
    """A slip of 1 takes for ever, which costs nothing where nothing is drawn all the time."""
    seen = drawn("..", slip=np.array([[0.5, 1.0]]), energy=20.0)
    found = rates(seen, replace(ROVER, power=power), "energy")[0, 0]
    assert found.tolist() == ([20.0, 20.0] if power == 0.0 else [20.0 + 3.0 / 0.25, math.inf])
