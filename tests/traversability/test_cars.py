"""Car-like vehicles: arcs of the turning radius, against slow graphs, and Reeds and Shepp."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.raster.grid import grid_over
from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report import wording
from terratool.traversability.report.lines import as_lines
from terratool.traversability.request import Request
from terratool.traversability.route.graph import (
    ALLOWED,
    BACKING,
    BACKWARD,
    SHIFT,
    Costs,
    Turns,
    arc_of,
    cells_between,
    cheapest_way,
    heading_offsets,
    moves_of,
)
from terratool.traversability.route.reach import FloodPlaces, heading_bits, spread
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import check_route, plan_route, reach
from terratool.traversability.tiles import survey as survey_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import Reason, Verdict
from tests.budget import examples
from tests.surveys import ROVER, drawn, level
from tests.traversability.reeds_shepp import shortest
from tests.traversability.test_alternatives import yard


def car(radius: float) -> Vehicle:
    return replace(ROVER, turning_radius=radius)


@settings(max_examples=examples(60), deadline=None)
@given(
    headings=st.sampled_from([4, 8, 12, 16, 32]),
    radius=st.floats(0.2, 30.0),
    number=st.integers(0, 31),
    side=st.sampled_from([-1, 1]),
)
def test_arcs_keep_the_radius_and_end_where_they_say(
    headings: int, radius: float, number: int, side: int
) -> None:
    """By their samples: no piece is bent more, both ends point along their moves."""
    offsets = heading_offsets(headings)
    begin, end = offsets[number % headings], offsets[(number + side) % headings]
    arc = arc_of(begin, end, radius)
    for offset, place, direction in (
        (begin, (0.0, 0.0), arc.directions[0]), (end, arc.offset, arc.directions[-1]),
    ):  # fmt: skip
        towards = math.degrees(math.atan2(offset[1], -offset[0]))
        assert abs((towards - direction + 180.0) % 360.0 - 180.0) < 1e-6
        at = arc.places[0] if place == (0.0, 0.0) else arc.places[-1]
        assert at == pytest.approx(place, abs=1e-9 * max(1.0, radius))
    steps = np.diff(arc.places, axis=0)
    runs = np.hypot(*steps.T)
    assert runs.sum() == pytest.approx(arc.length, rel=1e-3)
    assert runs.max() <= 0.1 + 1e-9
    turned = np.radians((np.diff(arc.directions) + 180.0) % 360.0 - 180.0)
    assert np.all(np.abs(turned) <= runs / radius * (1.0 + 1e-3) + 1e-9)
    assert np.sign(turned[np.abs(turned) > 1e-9]).tolist() == [side] * np.count_nonzero(
        np.abs(turned) > 1e-9
    )
    # where it goes is where it looks
    middle = np.radians(arc.directions[:-1]) + 0.5 * turned
    ahead = np.stack([-np.cos(middle), np.sin(middle)], axis=-1)
    assert steps == pytest.approx(ahead * runs[:, None], abs=1e-3)
    # in the cells that it names, which lie between its ends
    cells = {tuple(cell) for cell in arc.cells.tolist()}
    assert {tuple(cell) for cell in np.round(arc.places).astype(int).tolist()} <= cells
    box = np.sort([(0, 0), arc.offset], axis=0)
    assert np.all((arc.cells >= box[0]) & (arc.cells <= box[1]))
    # no move less would leave room: the straight rest is shorter than the longer move
    longest = max(math.hypot(*begin), math.hypot(*end))
    tangent = radius * math.tan(0.5 * abs(float(turned.sum())))
    assert arc.length <= 2.0 * (max(tangent, longest) + longest) + 1e-6


def test_arcs_of_north_lead_north_and_to_their_sides() -> None:
    """For 8 headings and 3 cells: tangents of 3 tan 22.5° = 1.24 cells, so two moves and one."""
    left, right = moves_of(8, 3.0).arcs[:2].tolist()
    assert left == [-3, -1] and right == [-3, 1]
    assert moves_of(8).arcs.shape == (0, 2)


def slow(rate: Any, can: Any, heights: Any, resolution: float, radius: float) -> networkx.DiGraph:
    """States are (gear, heading, row, column); rules as the docstrings put them."""
    headings, rows, columns = can.shape
    offsets, graph = heading_offsets(headings), networkx.DiGraph()
    for gear, heading, row, column in np.ndindex(2, *can.shape):
        if not can[heading, row, column]:
            continue
        here, sign = (gear, heading, row, column), -1 if gear else 1
        price = SHIFT * radius * resolution * float(rate[heading, row, column])
        graph.add_edge(here, (1 - gear, heading, row, column), weight=price)
        weight = BACKWARD if gear else 1.0
        for side in (-1, 0, 1):
            other = (heading + side) % headings
            if side:
                arc = arc_of(offsets[heading], offsets[other], radius)
                offset, cells = arc.offset, arc.cells.tolist()
                length = arc.length
            else:
                offset = offsets[heading]
                cells = [cell for pair in cells_between(offset) for cell in pair]
                cells += [(0, 0), offset]
                length = math.hypot(*offset)
            to = (row + sign * offset[0], column + sign * offset[1])
            if not (0 <= to[0] < rows and 0 <= to[1] < columns):
                continue
            passed = [(row + sign * r, column + sign * c) for r, c in cells]
            looks = {heading, other}
            judged = {(h + headings // 2 * gear) % headings for h in looks}
            if not all(can[h, *cell] for h in looks | judged for cell in passed):
                continue
            if side:
                mean = np.mean([max(float(rate[h, *cell]) for h in judged) for cell in passed])
                rise = float(heights[to]) - float(heights[row, column])
                paid = math.hypot(length * resolution, rise) * mean
                graph.add_edge(here, (gear, other, *to), weight=weight * paid)
            else:
                (one,) = judged
                assert max(map(abs, offset)) == 1  # no cells between
                mean = 0.5 * (float(rate[one, row, column]) + float(rate[one, *to]))
                rise = float(heights[to]) - float(heights[row, column])
                paid = math.hypot(length * resolution, rise) * mean
                graph.add_edge(here, (gear, other, *to), weight=weight * paid)
    return graph


@settings(max_examples=examples(25), deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    headings=st.sampled_from([4, 8]),
    radius=st.sampled_from([0.7, 1.5, 2.6]),
    share=st.sampled_from([0.8, 0.95, 1.0]),
)
def test_search_and_floods_follow_the_rules(
    seed: int, headings: int, radius: float, share: float
) -> None:
    """On oblong random ground: costs, ways and what is reached, there and back, as networkx has."""
    rng = np.random.default_rng(seed)
    shape = (headings, 8, 11)
    can = rng.random(shape) < share
    rate = rng.uniform(0.5, 2.0, shape).astype(np.float32)
    heights = rng.uniform(0.0, 0.3, shape[1:]).astype(np.float32)
    graph = slow(rate, can, heights, 0.5, radius)
    cell = tuple(int(rng.integers(side)) for side in shape[1:])
    starts = [(int(h), *cell) for h in np.flatnonzero(can[:, *cell])]
    if not starts:
        return
    flags = np.where(can, ALLOWED | BACKING, 0).astype(np.uint8)
    costs = Costs.of(rate, flags, heights, 0.5, Turns(0.3, radius * 0.5), float(rate.min()))
    known = networkx.multi_source_dijkstra_path_length(
        graph, {(gear, *state) for state in starts for gear in (0, 1)}
    )
    for _ in range(6):
        goal = tuple(int(rng.integers(side)) for side in shape[1:])
        best = min((cost for state, cost in known.items() if state[2:] == goal), default=math.inf)
        found = cheapest_way(costs, np.array(starts, np.int64), goal)
        assert found.cost == pytest.approx(best, rel=1e-5)
        if math.isfinite(best):
            states = [tuple(state) for state in found.states.tolist()]
            assert states[0][1:] == cell and states[-1][1:] == goal
            for one, other in pairwise(states):
                assert any(
                    graph.has_edge((gear, *one), (gear, *other)) for gear in (0, 1)
                )  # fmt: skip
    begin = np.zeros_like(can)
    begin[tuple(np.array(starts).T)] = True
    nowhere = np.zeros(shape[1:], np.bool_)
    for against, one in ((False, graph), (True, graph.reverse())):
        seeds = {(gear, *state) for state in starts for gear in (0, 1)}
        wanted = set().union(seeds, *(networkx.descendants(one, state) for state in seeds))
        bits = spread(
            heading_bits(can),
            headings,
            heading_bits(begin),
            against,
            None,
            FloodPlaces(nowhere),
            radius,
        )
        reached = {(h, int(r), int(c)) for h in range(headings)
                   for r, c in np.argwhere(bits >> h & 1)}  # fmt: skip
        assert reached == {state[1:] for state in wanted}


def test_the_reference_knows_what_can_be_worked_out_by_hand() -> None:
    """Straight on, back, a quarter circle, and a turn round in three moves."""
    assert shortest(5.0, 0.0, 0.0, 2.0) == pytest.approx(5.0)
    assert shortest(-5.0, 0.0, 0.0, 2.0) == pytest.approx(5.0)
    assert shortest(2.0, 2.0, math.pi / 2, 2.0) == pytest.approx(math.pi)
    assert shortest(2.0, -2.0, -math.pi / 2, 2.0) == pytest.approx(math.pi)
    assert shortest(0.0, 0.0, math.pi, 1.0) == pytest.approx(math.pi)
    assert shortest(1.0, 0.0, 0.0, 9.0) == pytest.approx(1.0)


@pytest.mark.parametrize(("headings", "gap", "mean"), [(8, 0.75, 0.12), (16, 0.2, 0.04)])
def test_lengths_on_open_ground_are_near_the_shortest(
    headings: int, gap: float, mean: float
) -> None:
    """Never less than Reeds and Shepp's, and from two radii on by a bounded share more."""
    rng = np.random.default_rng(2)
    side, radius, ratios = 81, 8.0, []
    shape = (headings, side, side)
    rate, heights = np.ones(shape, np.float32), np.zeros(shape[1:], np.float32)
    offsets = heading_offsets(headings)
    towards = [math.atan2(column, -row) for row, column in offsets]
    flags = np.full(shape, ALLOWED | BACKING, np.uint8)
    costs = replace(
        Costs.of(rate, flags, heights, 1.0, Turns(0.3, radius), 1.0), backward=1.0, shift=0.0
    )
    for _ in range(30):
        begin = int(rng.integers(0, headings))
        row, column = rng.integers(5, side - 5, 2).tolist()
        found = cheapest_way(costs, np.array([(begin, 40, 40)], np.int64), (row, column))
        north, east = 40 - row, column - 40
        ahead = north * math.cos(towards[begin]) + east * math.sin(towards[begin])
        left = north * math.sin(towards[begin]) - east * math.cos(towards[begin])
        least = min(
            shortest(ahead, left, towards[begin] - end, radius)
            for end in np.linspace(0.0, 2.0 * math.pi, 181)
        )
        assert found.cost >= least * (1.0 - 1e-3)  # of end headings 2° apart
        if math.hypot(north, east) > 2.0 * radius:
            ratios.append(found.cost / least - 1.0)
    assert max(ratios) < gap and np.mean(ratios) < mean and len(ratios) > 15


def bends(route: Route) -> float:
    """Radius of the sharpest bend of a route, m, from its places; infinity for none."""
    assert route.profile is not None
    x, y, heading = route.profile.x, route.profile.y, route.profile.heading
    runs = np.hypot(np.diff(x), np.diff(y))
    assert np.all(runs > 0.0)  # no turn on the spot
    turned = np.abs(np.radians((np.diff(heading) + 180.0) % 360.0 - 180.0))
    # a chord is shorter than its arc by a little
    return float(np.min(np.where(turned > 1e-9, runs / np.maximum(turned, 1e-9), np.inf)))


@pytest.mark.parametrize("radius", [1.0, 2.5])
def test_a_car_goes_round_a_wall_by_bends(radius: float) -> None:
    """A wall from the south with its end in the north: the same end takes a longer way."""
    picture = ["." * 60 for _ in range(60)]
    for row in range(20, 60):
        picture[row] = picture[row][:30] + "#" + picture[row][31:]
    survey, terrain = drawn("\n".join(picture), resolution=0.25), level(15, 15)
    ends = (2.125, 2.125), (12.875, 2.125)
    turner = plan_route(terrain, ROVER, survey, *ends, "length")
    route = plan_route(terrain, car(radius), survey, *ends, "length")
    assert route.found and route.turning == 0.0 and route.verdict == Verdict.GO
    assert bends(route) >= 0.97 * radius
    assert turner.length is not None and route.length is not None
    assert turner.length < route.length < 1.25 * turner.length
    assert route.profile is not None
    # in order from its start to its goal, at cells that can be driven
    assert np.all(route.profile.verdict == Verdict.GO)
    assert (route.profile.x[-1], route.profile.y[-1]) == ends[1]


def test_a_yard_too_narrow_to_turn_in_bars_and_says_so() -> None:
    """An alley with a corner of one cell: who turns on the spot gets round it, a car does not."""
    picture = "\n".join(["." * 12] + ["#" * 11 + "."] * 11)
    survey, terrain = drawn(picture), level(12, 12)
    ends = (0.5, 11.5), (11.5, 0.5)
    # its moves cut the corner by one cell, as the survey lets them
    assert plan_route(terrain, ROVER, survey, *ends).found
    route = plan_route(terrain, car(4.0), survey, *ends)
    assert not route.found and route.barriers
    corner = [(0.5, 11.5), (11.5, 11.5), (11.5, 0.5)]
    # an arc of 4 m leads over the ground inside of the corner; one of 12 m is longer than the legs
    rounded = check_route(terrain, car(4.0), survey, corner)
    assert not rounded.found and rounded.barriers[0].reason == Reason.STEP
    (bar,) = check_route(terrain, car(12.0), survey, corner).barriers
    assert bar.reason == Reason.TURNING and "turning on the spot at (11.5, 11.5)" in (
        wording.barrier(bar)
    )


def test_backing_up_is_used_where_there_is_no_room_ahead() -> None:
    """Nose ahead out of a lane, and nose ahead into one beside it, nearer than two radii."""
    picture = ["." * 30 for _ in range(14)] + ["#" * 12 + "." + "##" + "." + "#" * 14] * 10
    survey, terrain = drawn("\n".join(picture), resolution=0.5), level(15, 12)
    survey.verdict[4, 14:, 12] = survey.verdict[0, 14:, 15] = Verdict.NO_GO
    radius = 2.0
    route = plan_route(terrain, car(radius), survey, (6.25, 0.75), (7.75, 0.75), "length")
    assert route.found and route.profile is not None
    x, y = np.diff(route.profile.x), np.diff(route.profile.y)
    heading = np.radians(route.profile.heading[1:])
    gears = np.sign(x * np.sin(heading) + y * np.cos(heading))
    assert 1 <= np.count_nonzero(np.diff(gears)) <= 4
    assert bends(route) >= 0.97 * radius
    assert (route.profile.heading[0], route.profile.heading[-1]) == (0.0, 180.0)


@pytest.mark.slow
def test_maps_and_reach_count_a_cars_moves() -> None:
    """A corner that it cannot get round cuts off what is behind it; reports say how it turns."""
    corner = yard([(0, 0, 34, 34)], 40, 40)
    lost, cells = {}, {}
    for vehicle in (ROVER, car(1.0), car(8.0)):
        wanted = Request(resolution=0.1, start=(1.5, 9.25))
        report = assess(prepare_assessment(corner, vehicle, wanted))
        assert report.summary is not None and report.reach is not None
        lost[vehicle.turning_radius] = report.reach.share
        said = " ".join(" ".join(as_lines(report)).split())
        assert ("It does not turn on the spot" in said) == bool(vehicle.turning_radius)
        survey = survey_of(corner, vehicle, grid_over(corner, 0.1), 16)
        own = reach(corner, survey, (1.5, 9.25), vehicle)
        cells[vehicle.turning_radius] = np.count_nonzero(own.cells)
        assert np.count_nonzero(own.cells[80:]) > 0 or vehicle.turning_radius == 8.0
    # along the corridor alone, in lines: there is no room to change them
    for found in (lost, cells):
        assert found[0.0] == pytest.approx(found[1.0], rel=0.02) and found[8.0] < 0.2 * found[0.0]


@pytest.mark.slow
def test_a_way_that_only_runs_beside_another_is_no_alternative() -> None:
    """On open ground there is none, round an island there is one."""
    for blocks, count in (([], 0), ([(20, 14, 20, 12)], 1)):
        wanted = Request(
            routes=((1.5, 5.0, 13.5, 5.0),), alternatives=1, mapped=False, resolution=0.2
        )
        (route,) = assess(prepare_assessment(yard(blocks), car(0.8), wanted)).routes
        assert route.found and len(route.alternatives) == count
        for way in (route, *route.alternatives):
            assert bends(way) >= 0.95 * 0.8
