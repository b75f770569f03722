"""The graph of a survey against a slow reading of its rules, searched by networkx."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.errors import RequestError
from terratool.traversability.route.graph import (
    BACKWARD,
    build_graph,
    cells_between,
    cheapest_paths,
    heading_offsets,
    reached,
    trace,
)

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


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from([(1, 1), (1, 6), (5, 3), (4, 7), (6, 6)]),
    headings=st.sampled_from([4, 8, 12, 16]),
    share=st.sampled_from([0.3, 0.6, 0.8, 1.0]),
)
def test_graph_has_the_moves_of_the_rules_and_finds_the_cheapest_way(
    seed: int, shape: tuple[int, int], headings: int, share: float
) -> None:
    rng = np.random.default_rng(seed)
    can = rng.random((headings, *shape)) < share
    rate = rng.uniform(0.1, 3.0, can.shape).astype(np.float32)
    heights = rng.uniform(-1.0, 1.0, shape).astype(np.float32)
    expected = slow(rate, can, heights)
    graph = build_graph(rate, can, can, heights, RESOLUTION, ARC)
    states = list(zip(*(part.tolist() for part in graph.place(np.arange(can.sum()))), strict=True))
    rows, columns = graph.matrix.nonzero()
    assert {(states[a], states[b]) for a, b in zip(rows, columns, strict=True)} == set(
        expected.edges
    )
    if not states:
        return
    begin = states[rng.integers(len(states))]
    starts = graph.at(*begin[1:])
    cost, before = cheapest_paths(graph, starts)
    known = networkx.multi_source_dijkstra_path_length(expected, {states[n] for n in starts})
    assert {states[n] for n in np.flatnonzero(np.isfinite(cost))} == set(known)
    for state, least in known.items():
        number = states.index(state)
        assert cost[number] == pytest.approx(least, rel=1e-5)
        way = [states[n] for n in trace(before, number).tolist()]
        assert way[0][1:] == begin[1:] and way[-1] == state
        paid = sum(expected.edges[pair]["weight"] for pair in pairwise(way))
        assert paid == pytest.approx(least, rel=1e-5)
    there, back = reached(graph, starts), reached(graph, starts, back=True)
    assert {states[n] for n in np.flatnonzero(there)} == set(known)
    reverse = networkx.multi_source_dijkstra_path_length(
        expected.reverse(), {states[n] for n in starts}
    )
    assert {states[n] for n in np.flatnonzero(back)} == set(reverse)


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
