"""Routes through surveys whose answers are known by hand."""

from __future__ import annotations

import math
import re
import sys
from dataclasses import replace
from itertools import pairwise
from typing import Any

import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.traversability.assess import assess
from terratool.traversability.map_results import Survey
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.route import routes
from terratool.traversability.route.graph import PREFERENCES
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import check_route, plan_route, reach, route_grid
from terratool.traversability.turning import turn_on_spot
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel
from terratool.traversability.verdicts import GroundClass, Reason, Verdict
from tests.budget import examples
from tests.conftest import terrain_of
from tests.surveys import ROVER, barred, drawn, level
from tests.traversability.test_route_graph import slow

DIAGONAL = math.sqrt(2.0)

FLOOR = Soil.of(0, 35, 0)
TURN = turn_on_spot(ROVER, FLOOR)
"""On the ground of `level`, for a radian: tests/traversability/test_turning.py is about these."""

MAZE = """
.........
########.
.........
.########
.........
"""


def steps(route: Route) -> list[tuple[float, float]]:
    """Places of a route, each once."""
    assert route.profile is not None
    places = zip(route.profile.x.tolist(), route.profile.y.tolist(), strict=True)
    return [one for one, other in pairwise([*places, None]) if one != other and one is not None]


def test_maze_is_driven_its_shortest_way() -> None:
    terrain, survey = level(9, 5), drawn(MAZE)
    route = plan_route(terrain, ROVER, survey, (0.5, 4.5), (8.5, 0.5), "length")
    # seven cells east, round two corners to the lower row, back west, and the same again: the
    # corners are cut, as the survey says nothing against it
    assert route.found and route.planned and route.verdict == Verdict.GO
    assert route.length == pytest.approx(7 + 2 * DIAGONAL + 6 + 2 * DIAGONAL + 7)
    way = steps(route)
    assert way[0] == (0.5, 4.5) and way[-1] == (8.5, 0.5)
    assert (8.5, 3.5) in way and (0.5, 1.5) in way
    assert route.barriers == () and route.reached is None and route.note == ""


def test_maze_with_four_headings_is_driven_along_its_walls() -> None:
    route = plan_route(
        level(9, 5), ROVER, drawn(MAZE, headings=4), (0.5, 4.5), (8.5, 0.5), "length"
    )
    assert route.length == pytest.approx(8 + 2 + 8 + 2 + 8)


def test_rows_run_from_the_north_and_columns_from_the_west() -> None:
    """Oblong, off the origin, with its door in the north-west: mirrors and turns would not fit."""
    survey = drawn(
        """
......
.#####
......
......
""",
        resolution=0.5,
        origin=(100.0, -7.0),
    )
    terrain = level(3, 2, (100.0, -7.0))
    route = plan_route(terrain, ROVER, survey, (102.9, -5.1), (102.8, -6.9), "length")
    way = steps(route)
    assert way[0] == (102.75, -5.25) and way[-1] == (102.75, -6.75)
    assert (100.25, -5.75) in way
    assert route.profile is not None
    looks = dict(zip(zip(route.profile.x, route.profile.y, strict=True), route.profile.heading,
                     strict=True))  # fmt: skip
    assert looks[101.75, -5.25] == 270.0  # to the west, with the wall on its left


def test_what_the_survey_does_not_cover_is_refused() -> None:
    """The terrain is larger: the survey begins 1 m from its edges."""
    part = drawn(MAZE, origin=(1, 1))
    with pytest.raises(RequestError, match=r"start, 0.5 2.5, lies outside the part .* looked at"):
        plan_route(level(11, 7), ROVER, part, (0.5, 2.5), (8.5, 2.5))


@settings(max_examples=examples(30), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), shape=st.sampled_from([(3, 6), (7, 4)]))
def test_no_route_costs_less_and_the_way_back_is_as_long(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    rows, columns = shape
    picture = "\n".join("".join(rng.choice([*"...c#"], columns)) for _ in range(rows))
    energy = rng.uniform(5.0, 50.0, shape)  # alike for all headings: what goes one way goes back
    # so little is left that no way is pulled straight: see test_pulling.py
    survey = drawn(picture, energy=energy, slip=rng.uniform(0.0, 0.5, shape), utilisation=0.95)
    terrain = level(columns, rows)
    free = np.argwhere(survey.verdict[0] < Verdict.NO_GO)
    if len(free) < 2:
        return
    a, b = free[rng.choice(len(free), 2, replace=False)].tolist()
    start, goal = ((cell[1] + 0.5, rows - cell[0] - 0.5) for cell in (a, b))
    there, back = (
        plan_route(terrain, ROVER, survey, *ends, "length")
        for ends in ((start, goal), (goal, start))
    )
    assert there.found == back.found
    if not there.found:
        assert there.barriers and back.barriers
        return
    assert there.length == pytest.approx(back.length)
    least = plan_route(terrain, ROVER, survey, start, goal, "energy")
    rate = energy + ROVER.power / (ROVER.speed * (1.0 - survey.slip[0]))
    can = survey.verdict < Verdict.NO_GO
    graph = slow(np.broadcast_to(rate, can.shape), can, survey.heights)
    turn = 2 * math.pi / 8 * (TURN.work + ROVER.power * TURN.run / ROVER.speed)
    for one, other, data in graph.edges(data=True):
        if one[1:] == other[1:]:
            data["weight"] = turn
        else:
            data["weight"] *= 2.0  # it has cells of half a metre
    known = networkx.multi_source_dijkstra_path_length(
        graph, {node for node in graph if list(node[1:]) == a}
    )
    best = min(cost for node, cost in known.items() if list(node[1:]) == b)
    assert least.energy == pytest.approx(best, rel=1e-4)


def test_start_is_the_goal() -> None:
    route = plan_route(level(9, 5), ROVER, drawn(MAZE), (0.1, 4.9), (0.9, 4.1))
    assert route.found and route.length == route.time == route.energy == 0.0
    assert len(route.profile.x) == 1  # type: ignore[union-attr]


def test_caution_and_small_margins_are_avoided_where_that_is_preferred() -> None:
    picture = """
.......
.ccccc.
.......
"""
    ways = {
        prefer: plan_route(level(7, 3), ROVER, drawn(picture), (0.5, 1.5), (6.5, 1.5), prefer)
        for prefer in PREFERENCES
    }
    assert ways["length"].length == pytest.approx(6) and ways["length"].verdict == Verdict.CAUTION
    assert ways["margin"].length == pytest.approx(4 + 2 * DIAGONAL)
    assert ways["margin"].verdict == Verdict.GO
    assert ways["margin"].tightest.value == pytest.approx(0.5)  # type: ignore[union-attr]
    tightest = ways["length"].tightest
    assert tightest is not None
    assert tightest.value == pytest.approx(0.1) and tightest.reason == Reason.SLIP
    assert ways["time"].time == pytest.approx(ways["margin"].time)
    even = drawn(picture, utilisation=0.5)
    assert plan_route(level(7, 3), ROVER, even, (0.5, 1.5), (6.5, 1.5)).verdict == Verdict.GO
    with pytest.raises(RequestError, match='no route by "speed"'):
        plan_route(level(7, 3), ROVER, drawn(picture), (0.5, 1.5), (6.5, 1.5), "speed")  # type: ignore[arg-type]


def ramp() -> Survey:
    """Five rows from south to north; the middle one can be driven southwards only."""
    survey = drawn("...\n" * 5)
    return barred(survey, [0, 1, 2, 6, 7], np.s_[2, :])


def test_one_way_slope_is_gone_down_and_not_up_again() -> None:
    terrain, survey = level(3, 5), ramp()
    down = plan_route(terrain, ROVER, survey, (1.5, 4.5), (1.5, 0.5), "length")
    assert down.found and down.length == pytest.approx(4)
    up = plan_route(terrain, ROVER, survey, (1.5, 0.5), (1.5, 4.5), "length")
    assert not up.found and up.length is up.time is up.energy is up.profile is None
    assert [barrier.reason for barrier in up.barriers] == [Reason.TRACTION]
    assert up.barriers[0].width == pytest.approx(1.0)
    assert up.barriers[0].bars == '/elemTree (surface "floor")'
    # it can turn its nose downhill in the middle row, but not back up there
    assert up.reached is not None and (up.reached.x, up.reached.y) == (1.5, 1.5)
    above, below = (reach(terrain, survey, (1.5, y)) for y in (4.5, 0.5))
    assert above.share == 1.0 and above.returnable == pytest.approx(6 / 15)
    assert below.share == below.returnable == pytest.approx(6 / 15)
    assert below.cells.tolist() == [[row > 2] * 3 for row in range(5)]


@pytest.mark.parametrize(("headings", "fits"), [([0, 4], True), ([2, 6], False)])
def test_narrow_gap_lets_it_through_in_one_heading_only(headings: list[int], fits: bool) -> None:
    survey = drawn(
        """
.....
##.##
.....
"""
    )
    barred(survey, [h for h in range(8) if h not in headings], np.s_[1, 2], Reason.STEP)
    terrain = level(5, 3)
    route = plan_route(terrain, ROVER, survey, (0.5, 0.5), (4.5, 2.5), "length")
    assert route.found == fits
    if fits:
        assert route.profile is not None
        there = (route.profile.x == 2.5) & (route.profile.y == 1.5)
        assert set(route.profile.heading[there].tolist()) == {0.0}
        assert route.length == pytest.approx(2 + 1 + DIAGONAL * 0 + 1 + 2)
    straight = check_route(terrain, ROVER, survey, [(2.5, 0.5), (2.5, 2.5)])
    assert straight.found == fits and not straight.planned
    slanting = check_route(terrain, ROVER, survey, [(1.5, 0.5), (3.5, 2.5)])
    assert not slanting.found


def test_backs_up_where_it_can_turn_one_way_only() -> None:
    """North into a corner, a turn to the west, and eastwards in reverse: a turn east is barred."""
    energy = np.full((8, 3, 5), 10.0)
    energy[2] = 40.0  # eastwards is uphill, whichever end is ahead
    survey = drawn("#....\n#.###\n#.###", energy=energy, slip=np.where(energy > 10, 0.5, 0.0))
    barred(survey, [1, 2, 3, 5, 6, 7], np.s_[1:, 1], Reason.STEP)
    barred(survey, [0, 1, 3, 4, 5, 7], np.s_[0, 2:], Reason.STEP)
    barred(survey, [1, 3, 4, 5], np.s_[0, 1], Reason.STEP)
    terrain = level(5, 3)
    route = plan_route(terrain, ROVER, survey, (1.5, 0.5), (4.5, 2.5), "length")
    assert route.found and route.length == pytest.approx(2 + 3)
    assert route.profile is not None
    assert route.profile.heading.tolist() == [0.0, 0.0, 0.0, 315.0, 270.0, 270.0, 270.0, 270.0]
    assert np.diff(route.profile.x).tolist() == [0, 0, 0, 0, 1, 1, 1]
    time = (2 + math.pi / 2 * TURN.run) / ROVER.speed + 3 / (0.5 * ROVER.speed)
    assert route.time == pytest.approx(time, rel=1e-6)
    work = 10 * 2 + 40 * 3 + math.pi / 2 * TURN.work
    assert route.energy == pytest.approx(work + ROVER.power * time, rel=1e-6)
    # what cannot be climbed with the nose ahead is not climbed in reverse
    barred(survey, [2], np.s_[0, 3])
    assert not plan_route(terrain, ROVER, survey, (1.5, 0.5), (4.5, 2.5), "length").found


def test_energy_and_time_on_a_plane_are_those_of_mechanics() -> None:
    """East up a plane of 1 in 10: m g Δh, resistance × length, and what is drawn all the time."""
    terrain = terrain_of(
        {
            "size": [20, 10],
            "surfTypes": {"slab": {}},
            "elemTypes": {"plane": {"x": [0, 2]}},
            "elemTree": {"type": "plane", "vScale": 1, "surface": "slab"},
        }
    )
    grid = grid_over(terrain, 0.5)
    x = np.broadcast_to(grid.columns(grid.whole), (20, 40))
    angle, resistance, slip = math.atan(0.1), 12.0, 0.2
    pitch = np.array([math.atan(0.1 * math.sin(math.pi / 4 * h)) for h in range(8)])[:, None, None]
    energy = ROVER.weight * np.sin(pitch) + resistance
    survey = drawn(
        ("." * 40 + "\n") * 20, resolution=0.5, heights=0.1 * x, pitch=pitch, energy=energy,
        slip=slip,
    )  # fmt: skip
    route = plan_route(terrain, ROVER, survey, (0.25, 5.25), (19.25, 5.25))
    run, rise = 19.0, 1.9
    length = math.hypot(run, rise)
    time = length / (ROVER.speed * (1 - slip))
    assert route.length == pytest.approx(length, rel=1e-5)
    assert route.time == pytest.approx(time, rel=1e-5)
    work = ROVER.mass * ROVER.gravity * rise + resistance * length
    assert route.energy == pytest.approx(work + ROVER.power * time, rel=1e-5)
    assert route.steepest is not None and route.steepest.value == pytest.approx(angle)
    # down again nothing is gained: as much less as the slope pulls, but never below nothing
    down = plan_route(terrain, ROVER, survey, (19.25, 5.25), (0.25, 5.25))
    assert ROVER.weight * math.sin(angle) > resistance
    assert down.energy == pytest.approx(ROVER.power * time, rel=1e-5)
    driven = check_route(terrain, ROVER, survey, [(0.25, 5.25), (19.25, 5.25)])
    assert driven.length == pytest.approx(length, rel=1e-5)
    assert driven.energy == pytest.approx(route.energy, rel=1e-5)


@pytest.mark.parametrize("rover", [ROVER, replace(ROVER, steering="wheels")])
def test_a_turn_takes_its_work_and_the_time_of_its_treads(rover: Vehicle) -> None:
    """What a way with a turn takes is that of its legs, and that of the turn, which is named."""
    survey = drawn("..\n#.", headings=4, utilisation=0.95)
    route = plan_route(level(2, 2), rover, survey, (0.5, 1.5), (1.5, 0.5))
    turn = turn_on_spot(rover, FLOOR)
    assert route.length == pytest.approx(2)
    turning = math.pi / 2 * turn.run / rover.speed
    assert route.time == pytest.approx(2 / rover.speed + turning, rel=1e-6)
    assert route.turning == pytest.approx(math.pi / 2 * turn.work + rover.power * turning)
    legs = 10.0 * 2 + rover.power * 2 / rover.speed
    assert route.energy == pytest.approx(legs + route.turning, rel=1e-6)
    assert (turn.work > 0.0) == (rover is ROVER)
    assert route.profile is not None
    assert route.profile.distance.tolist() == [0.0, 1.0, 1.0, 2.0]
    assert route.profile.heading.tolist() == [90.0, 90.0, 180.0, 180.0]


def floors(columns: str) -> Terrain:
    """Level strips of a metre from west to east, of surfaces "f", firm, and "g", grippy."""
    soils = {"f": {"cohesion": 0, "fricAngle": 20, "sinkage": 0},
             "g": {"cohesion": 0, "fricAngle": 60, "sinkage": 0}}  # fmt: skip
    strips = [
        {"type": "flat", "cellX": n, "cellY": 0, "vScale": 0, "surface": name}
        for n, name in enumerate(columns)
    ]
    return terrain_of(
        {
            "size": [len(columns), 3],
            "surfTypes": soils,
            "elemTypes": {"flat": {"x": "flat"}},
            "elemTree": {
                "type": "flat", "vScale": 0, "surface": "f",
                "cells": [len(columns), 1], "children": strips,
            },
        }
    )  # fmt: skip


def on_floors(columns: str, picture: str, **planes: Any) -> Survey:
    survey = drawn(picture, headings=4, utilisation=0.95, **planes)
    survey.surfaces[:] = [1 + "fg".index(name) for name in columns]
    return survey


CROSS = "gfg"
ROOM = "...\n...\n..."


def heading_at_turns(route: Route) -> list[float]:
    """The places, x, where a route turns."""
    assert route.profile is not None
    still = np.diff(route.profile.distance) == 0.0
    return route.profile.x[1:][still].tolist()


def test_turns_are_made_where_they_take_least() -> None:
    """From a grippy column to the slippery one, and back: the turn is made in the slippery one."""
    terrain, survey = floors(CROSS), on_floors(CROSS, ROOM)
    way = plan_route(terrain, ROVER, survey, (0.5, 0.5), (1.5, 2.5), "energy")
    other = plan_route(terrain, ROVER, survey, (1.5, 0.5), (0.5, 2.5), "energy")
    assert heading_at_turns(way) == heading_at_turns(other) == [1.5]
    firm = turn_on_spot(ROVER, Soil.of(0, 20, 0))
    assert way.turning == pytest.approx(
        math.pi / 2 * (firm.work + ROVER.power * firm.run / ROVER.speed)
    )


def test_energy_takes_a_longer_way_where_turning_is_dear() -> None:
    """Between the obstacles, with turns of 360° in all, or around them, with 180°."""
    survey = drawn(".........\n.#######.\n..#...#..\n#...#...#", utilisation=0.95)
    ends = (0.5, 1.5), (8.5, 1.5)
    skids = plan_route(level(9, 4), ROVER, survey, *ends, "energy")
    assert skids.length == pytest.approx(8 + 2 * DIAGONAL) and len(heading_at_turns(skids)) == 4
    rolls = plan_route(level(9, 4), replace(ROVER, steering="wheels"), survey, *ends, "energy")
    assert rolls.length == pytest.approx(4 + 4 * DIAGONAL) and len(heading_at_turns(rolls)) == 6


def test_where_it_cannot_turn_it_does_not() -> None:
    """Its motors turn it on the slippery strip alone: a corner on the grippy one bars the way."""
    weak = replace(ROVER, wheel=Wheel(0.1, 0.06, 2.0))
    assert turn_on_spot(weak, Soil.of(0, 20, 0)).possible
    assert turn_on_spot(weak, Soil.of(0, 60, 0)).reason == Reason.TORQUE
    terrain, survey = floors("fg"), on_floors("fg", "..\n#.\n#.")
    route = plan_route(terrain, weak, survey, (0.5, 2.5), (1.5, 0.5))
    assert not route.found and route.verdict == Verdict.NO_GO
    (bar,) = route.barriers
    assert bar.reason == Reason.TURNING and (bar.place.x, bar.place.y) == (1.5, 2.5)
    assert bar.bars == '/elemTree/children/1 (surface "g"), by motor torque'
    straight = check_route(terrain, weak, survey, [(0.5, 2.5), (1.5, 2.5), (1.5, 0.5)])
    assert [bar.reason for bar in straight.barriers] == [Reason.TURNING]
    assert plan_route(terrain, ROVER, survey, (0.5, 2.5), (1.5, 0.5)).found
    # the same corner on the slippery strip is gone round
    survey = on_floors("fg", "..\n.#\n.#")
    assert plan_route(terrain, weak, survey, (0.5, 0.5), (1.5, 2.5)).found
    beyond = reach(terrain, survey, (1.5, 2.5), weak)
    assert beyond.share == reach(terrain, survey, (1.5, 2.5)).share == pytest.approx(4 / 6)
    corner = on_floors("gf", "..\n.#\n.#")
    assert reach(floors("gf"), corner, (1.5, 2.5)).share == pytest.approx(4 / 6)
    assert reach(floors("gf"), corner, (1.5, 2.5), weak).share == pytest.approx(2 / 6)


def test_softest_and_steepest_places_are_where_the_survey_has_them() -> None:
    sinkage, pitch = np.zeros((1, 6)), np.zeros((1, 6))
    sinkage[0, 4], pitch[0, 2] = 0.05, -0.3
    survey = drawn("......", sinkage=sinkage, pitch=pitch)
    route = plan_route(level(6, 1), ROVER, survey, (0.5, 0.5), (5.5, 0.5))
    assert route.softest is not None and route.steepest is not None
    assert (route.softest.value, route.softest.place.x) == (pytest.approx(0.05), 4.5)
    assert (route.steepest.value, route.steepest.place.x) == (pytest.approx(-0.3), 2.5)
    assert route.softest.place.surface == "floor" and route.softest.place.element == "/elemTree"


def test_way_is_slower_where_wheels_slip() -> None:
    slip = np.array([[0.0, 0.5, np.nan, 0.0]])
    route = plan_route(level(4, 1), ROVER, drawn("....", slip=slip), (0.5, 0.5), (3.5, 0.5))
    seconds = 0.5 * 2 + (0.5 + 0.5) * 4 + (0.5 + 0.5) * 2 + 0.5 * 2
    assert route.time == pytest.approx(seconds)


def test_routes_need_no_scipy(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("scipy", "scipy.sparse", "scipy.sparse.csgraph"):
        monkeypatch.setitem(sys.modules, name, None)
    assert plan_route(level(9, 5), ROVER, drawn(MAZE), (0.5, 4.5), (8.5, 0.5)).found


def test_reach_counts_ground_alone() -> None:
    survey = drawn(
        """
..#.
..#
"""[:-1]
        + " \n"
    )
    found = reach(level(4, 2), survey, (0.5, 0.5))
    assert found.share == found.returnable == pytest.approx(4 / 7)
    assert found.cells.tolist() == [[True, True, False, False]] * 2
    assert found.start.surface == "floor"


@pytest.mark.parametrize(
    ("size", "width", "resolution", "coarse"),
    [
        ((30.0, 20.0), 0.6, 0.1, False),  # a sixth of its width
        ((60.0, 40.0), 0.6, None, False),  # between a sixth and a third
        ((900.0, 300.0), 0.6, None, True),
        ((4000.0, 1.0), 0.6, None, False),
    ],
)
def test_grid_is_as_fine_as_the_bound_allows(
    monkeypatch: pytest.MonkeyPatch, size: tuple[float, float], width: float,
    resolution: float | None, coarse: bool,
) -> None:  # fmt: skip
    monkeypatch.setattr(routes, "MOST_STATES", 1_000_000)
    vehicle = Vehicle(Wheel(0.1, 0.1), (Axle(0.2), Axle(-0.2)), 10.0, track_width=width - 0.1)
    grid, said = route_grid(level(*size), vehicle)
    assert 8 * grid.height * grid.width <= 1_000_000
    assert bool(said) == coarse
    if resolution:
        assert grid.resolution == pytest.approx(resolution)
    else:  # the bound is made use of
        assert 8 * grid.height * grid.width > 850_000  # but for the rounding of five rows
    assert (grid.resolution > width / 3) == coarse
    if coarse:
        assert f"{grid.resolution:.3g} m" in said and "0.6 m wide" in said


def test_grid_of_a_part_is_finer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(routes, "MOST_STATES", 1_000_000)
    terrain = level(900, 300)
    grid, said = route_grid(terrain, ROVER, bounds=(10, 20, 40, 30))
    assert (grid.west, grid.south) == (10, 20) and not said
    assert grid.resolution == pytest.approx(0.56 / 6)
    with pytest.raises(RequestError, match="miss the terrain"):
        route_grid(terrain, ROVER, bounds=(1000, 20, 1040, 30))


def test_ground_that_is_too_large_says_what_helps() -> None:
    """Nobody asked for the resolution that would be too coarse."""
    with pytest.raises(RequestError) as caught:
        route_grid(level(200_000, 150_000), ROVER)
    assert re.fullmatch(
        r"The ground of 200000 by 150000 m is too large to look for routes: their grid would have "
        r"pixels of 200 m, and wheels of radius 0.1 m take at most 3.25 m.",
        caught.value.args[0],
    )
    assert "--bounds" in caught.value.hint
    assert route_grid(level(200_000, 150_000), ROVER, bounds=(0, 0, 90, 60))[0].resolution < 0.1


def test_grid_of_a_narrow_part() -> None:
    """Bounds that are narrow beside the terrain are no reason to refuse."""
    grid, _ = route_grid(level(80, 64), ROVER, bounds=(0, 50, 30, 64))
    narrow, _ = route_grid(level(80, 64), ROVER, bounds=(0, 50.3, 30, 53.3))
    assert grid.resolution == narrow.resolution < 1


def test_tiny_terrain_has_a_grid() -> None:
    grid, said = route_grid(level(0.05, 3), ROVER)
    assert grid.width == 1 and grid.height >= 18 and not said


def test_a_map_counts_on_no_turns_that_cannot_be_made() -> None:
    """Who cannot turn gets along a line, ahead and back; the rest of level ground is cut off."""
    weak = replace(ROVER, wheel=Wheel(0.1, 0.06, 2.0), power=0.0)
    strong = replace(weak, wheel=Wheel(0.1, 0.06, 4.0))
    assert not turn_on_spot(weak, FLOOR).possible and turn_on_spot(strong, FLOOR).possible
    lost = {}
    for vehicle in (weak, strong, replace(weak, steering="wheels")):
        wanted = Request(resolution=0.2, start=(3.0, 2.0))
        report = assess(prepare_assessment(level(6, 4), vehicle, wanted))
        assert report.summary is not None and report.reach is not None
        lost[vehicle] = report.summary.fraction(GroundClass.CUT_OFF), report.reach.share
    (cut, reached), *others = lost.values()
    assert reached < 0.25 and cut > 0.25
    assert others[0] == others[1] and others[0][0] < 0.5 * cut and others[0][1] > 2 * reached
