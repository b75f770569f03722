"""Ways pulled straight: as short as geometry allows, and judged metre by metre."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.traversability.assess import assess
from terratool.traversability.map_results import Survey, cells_of
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.route.graph import (
    PREFERENCES,
    drivable,
    heading_offsets,
    pulled,
    rates,
    turn_prices,
)
from terratool.traversability.route.paths import (
    graph_path,
    headings_beside,
    worst_verdict,
)
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import check_route, plan_route, search_route
from terratool.traversability.soil import turnings
from terratool.traversability.tiles import survey as survey_of
from terratool.traversability.verdicts import Verdict
from tests.budget import examples
from tests.conftest import terrain_of
from tests.surveys import ROVER, drawn, level


def corners(route: Route) -> list[tuple[float, float]]:
    """Places at which a way turns, with its ends."""
    assert route.profile is not None
    x, y = route.profile.x, route.profile.y
    still = np.flatnonzero(np.diff(route.profile.distance) == 0.0)
    ends = sorted({0, *still.tolist(), len(x) - 1})
    places = [(float(x[n]), float(y[n])) for n in ends]
    return [one for one, other in pairwise([*places, None]) if one != other and one is not None]


def open_ground(width: int, height: int, headings: int = 8) -> Survey:
    return drawn(("." * width + "\n") * height, headings=headings)


@pytest.mark.parametrize("headings", [4, 8, 16, 32])
@pytest.mark.parametrize("prefer", PREFERENCES)
@pytest.mark.parametrize("end", [(40.5, 11.5), (7.5, 20.5), (33.5, 1.5), (1.5, 20.5), (21.5, 21.5)])
def test_on_open_ground_the_way_is_the_straight_line(
    headings: int, prefer: Any, end: tuple[float, float]
) -> None:
    """To the west as to the east, however oblique: one leg, no turn, the length of the line."""
    survey, terrain = open_ground(42, 23, headings), level(42, 23)
    for start, goal in (((1.5, 1.5), end), (end, (1.5, 1.5))):
        route = plan_route(terrain, ROVER, survey, start, goal, prefer)
        assert route.length == pytest.approx(math.dist(start, goal), rel=1e-12, abs=1e-9)
        assert route.turning == 0.0 and route.time is not None
        assert route.time == pytest.approx(math.dist(start, goal) / ROVER.speed, rel=1e-9)
        assert route.profile is not None
        east, north = goal[0] - start[0], goal[1] - start[1]
        towards = math.degrees(math.atan2(east, north)) % 360.0
        assert route.profile.heading == pytest.approx(towards, abs=1e-9)


@pytest.mark.parametrize("headings", [8, 16])
def test_a_box_is_gone_round_by_its_corners(headings: int) -> None:
    """By the shortest way between the middles of cells that stays off the box, of all there are.

    Which cells a way must stay off is what moves say: at each whole step along its longer axis
    both cells beside it are free.
    """
    survey, terrain = open_ground(40, 24, headings), level(40, 24)
    survey.verdict[:, 6:19, 15:24] = Verdict.NO_GO
    start, goal = (3.5, 11.5), (36.5, 9.5)
    route = plan_route(terrain, ROVER, survey, start, goal, "length")
    assert route.length is not None
    # rows 6 to 18 from the north are the box: its cells' middles from y 5.5 to 17.5, x 15.5 to 23.5
    below = [(14.5, 5.5), (14.5, 4.5), (15.5, 4.5), (23.5, 4.5), (24.5, 4.5), (24.5, 5.5)]
    above = [(x, 23.0 - y) for x, y in below]
    box = shapely.box(14.5 + 1e-9, 4.5 + 1e-9, 24.5 - 1e-9, 18.5 - 1e-9)
    best = math.inf
    for side in (below, above):
        for n, one in enumerate(side):
            for two in side[n:]:
                line = shapely.LineString([start, one, two, goal])
                if not line.intersects(box):
                    best = min(best, line.length)
    # a move cuts the corners of cells, so the way may be a little shorter than off the middles
    assert 0.985 * best < route.length <= best + 1e-9
    octile = plan_chain(terrain, survey, start, goal)
    assert route.length < (0.97 if headings == 8 else 0.995) * octile


def plan_chain(terrain: Terrain, survey: Survey, start: Any, goal: Any) -> float:
    found = search_route(terrain, ROVER, survey, start, goal, "length").found
    assert found is not None
    return float(graph_path(found.states, survey).leg_lengths.sum())


class Slow:
    """What a way of legs takes, read off the survey as the docstrings put it."""

    def __init__(self, terrain: Terrain, survey: Survey, prefer: str) -> None:
        self.survey, self.n = survey, survey.headings
        self.can = drivable(survey)
        self.rate = rates(survey, ROVER, prefer)
        self.prices = turn_prices(turnings(terrain, ROVER), survey, ROVER, prefer)

    def leg(self, begin: tuple[int, int], end: tuple[int, int], back: bool) -> tuple[float, float]:
        """Cost and length of a leg, which must be drivable."""
        down, right = end[0] - begin[0], end[1] - begin[1]
        towards = math.degrees(math.atan2(right, -down)) % 360.0
        beside = headings_beside(towards, self.n)
        steps, cost, length = max(abs(down), abs(right)), 0.0, 0.0
        last: tuple[float, float] | None = None
        for step in range(steps + 1):
            exact = begin[0] + down * step / steps, begin[1] + right * step / steps
            cells = {
                tuple(int(f(at + e)) for at in exact)
                for f, e in ((math.floor, 1e-9), (math.ceil, -1e-9))
            }
            price = 0.0
            for cell in cells:
                for heading in beside:
                    assert self.can[heading, *cell]
                    if back:
                        assert self.can[(heading + self.n // 2) % self.n, *cell]
                    price = max(price, float(self.rate[heading, *cell]))
            near, far = min(cells), max(cells)
            share = (exact[0] - near[0]) + (exact[1] - near[1]) if len(cells) > 1 else 0.0
            low, high = (float(self.survey.heights[cell]) for cell in (near, far))
            height = low + share * (high - low)
            if last is not None:
                run = math.hypot(down, right) / steps * self.survey.grid.resolution
                way = math.hypot(run, height - last[1])
                length += way
                cost += 0.5 * way * (last[0] + price) * (1.05 if back else 1.0)
            last = price, height
        return cost, length

    def turn(self, cell: tuple[int, int], headings: list[float]) -> float:
        """Cost of a turn through directions, degrees, all headings of which must be drivable."""
        step, cost = 360.0 / self.n, 0.0
        for one, other in pairwise(headings):
            around = (other - one + 180.0) % 360.0 - 180.0
            low, high = (one, one + around) if around > 0 else (other, other - around)
            first = math.floor(low / step + 1e-9)
            pair = first % self.n, (first + 1) % self.n
            assert abs(around) <= step * (1 + 1e-9)
            assert all(self.can[h, *cell] for h in pair if high - low > 1e-9)
            surface = self.survey.surfaces[cell]
            mean = 0.5 * sum(float(self.rate[h, *cell]) for h in pair)
            price = float(self.prices.fixed[surface] + self.prices.metres[surface] * mean)
            cost += (high - low) / step * price
        return cost


def taken(slow: Slow, route: Route) -> tuple[float, float, float]:
    """Cost, length and metres of caution of a route, by its profile's places and headings."""
    profile, survey = route.profile, slow.survey
    assert profile is not None
    rows, columns = cells_of(survey.grid, profile.x, profile.y)
    cost = length = 0.0
    still = np.diff(profile.distance) == 0.0
    begin = 0
    places = [(int(r), int(c)) for r, c in zip(rows, columns, strict=True)]
    while begin < len(still):
        end = begin
        while end < len(still) and still[end] == still[begin]:
            if (
                not still[begin]
                and end > begin
                and profile.heading[end + 1] != profile.heading[end]
            ):
                break
            end += 1
        if still[begin]:
            cost += slow.turn(places[begin], profile.heading[begin : end + 1].tolist())
        else:
            down, right = (places[end][k] - places[begin][k] for k in (0, 1))
            towards = math.degrees(math.atan2(right, -down)) % 360.0
            back = abs((towards - profile.heading[end] + 180.0) % 360.0 - 180.0) > 90.0
            own = slow.leg(places[begin], places[end], back)
            cost, length = cost + own[0], length + own[1]
        begin = end
    distance = np.diff(profile.distance)
    careful = profile.verdict == Verdict.CAUTION
    return cost, length, float((0.5 * distance * (careful[1:].astype(float) + careful[:-1])).sum())


@settings(max_examples=examples(60), deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    headings=st.sampled_from([4, 8]),
    prefer=st.sampled_from(PREFERENCES),
    alike=st.booleans(),
)
def test_each_metre_is_drivable_and_nothing_costs_more(
    seed: int, headings: int, prefer: Any, alike: bool
) -> None:
    """On random ground whose headings differ, on both sides of obstacles, ahead and backwards."""
    rng = np.random.default_rng(seed)
    rows, columns = (int(side) for side in rng.integers(4, 22, 2))
    rare = float(rng.choice([0.02, 0.12]))  # open ground, whose ways are pulled far, and a thicket
    signs = rng.choice([*".c#"], (rows, columns), p=[1.0 - 2.0 * rare, rare, rare])
    shape = (headings, rows, columns) if not alike else (rows, columns)
    survey = drawn(
        "\n".join("".join(row) for row in signs), headings=headings,
        heights=rng.uniform(0.0, 0.3, (rows, columns)), slip=rng.uniform(0.0, 0.3, shape),
        energy=rng.uniform(5.0, 15.0, shape), utilisation=rng.uniform(0.2, 0.8, shape),
    )  # fmt: skip
    if not alike:
        barred = rng.random(survey.verdict.shape) < 0.5 * rare
        survey.verdict[barred] = Verdict.NO_GO
    terrain = level(columns, rows)
    free = np.argwhere(drivable(survey).any(axis=0))
    if len(free) < 2:
        return
    ends = free[rng.choice(len(free), 2, replace=False)].tolist()
    start, goal = ((c + 0.5, rows - r - 0.5) for r, c in ends)
    search = search_route(terrain, ROVER, survey, start, goal, prefer)
    route = search.route()
    if not route.found:
        return
    assert search.found is not None
    cost, length, _ = taken(Slow(terrain, survey, prefer), route)
    assert cost <= search.found.cost * (1.0 + 1e-5) + 1e-9
    chain = graph_path(search.found.states, survey)
    rise = np.diff(chain.height)
    longest = np.where(chain.leg_lengths > 0.0, np.hypot(chain.leg_lengths, rise), 0.0).sum()
    assert length <= longest * (1.0 + 1e-6) + 1e-9
    assert route.length == pytest.approx(length, rel=1e-6, abs=1e-9)
    assert route.profile is not None
    before = worst_verdict(chain.values_of(survey.verdict))
    assert worst_verdict(route.profile.verdict) <= before <= Verdict.CAUTION
    assert (route.profile.x[0], route.profile.y[0]) == start
    assert (route.profile.x[-1], route.profile.y[-1]) == goal


def test_a_heading_that_is_barred_bars_what_lies_beside_it() -> None:
    """East by 26.6° north lies between 45° and 90°: without one of them the way is a chain."""
    survey, terrain = open_ground(11, 6), level(11, 6)
    ends = (0.5, 0.5), (10.5, 5.5)
    assert len(corners(plan_route(terrain, ROVER, survey, *ends))) == 2
    for heading, left in ((1, 90.0), (2, 45.0)):
        barred = open_ground(11, 6)
        barred.verdict[heading, 2:4, 4:7] = Verdict.NO_GO
        route = plan_route(terrain, ROVER, barred, *ends)
        assert route.profile is not None and len(corners(route)) > 2
        rows, columns = cells_of(barred.grid, route.profile.x, route.profile.y)
        inside = (rows >= 2) & (rows < 4) & (columns >= 4) & (columns < 7)
        assert set(route.profile.heading[inside].tolist()) <= {left}


def test_a_slope_needs_room_between_headings() -> None:
    """What leaves less than 1 − cos 22.5° is driven along headings alone."""
    terrain = level(11, 6)
    for used, straight in ((0.92, True), (0.93, False)):
        survey = drawn(("." * 11 + "\n") * 6, utilisation=used)
        route = plan_route(terrain, ROVER, survey, (0.5, 0.5), (10.5, 5.5))
        assert (len(corners(route)) == 2) == straight
        assert set(np.unique(route.profile.heading % 45.0)) == {0.0} or straight  # type: ignore[union-attr]


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_lengths_over_ground_are_those_of_the_plane(slope: float) -> None:
    """Between middles of cells heights are interpolated: no steps from cell to cell."""
    x = np.arange(30) + 0.5
    heights = np.tile(slope * x, (17, 1))
    survey = drawn(("." * 30 + "\n") * 17, heights=heights)
    route = plan_route(level(30, 17), ROVER, survey, (1.5, 2.5), (27.5, 13.5), "length")
    wanted = math.hypot(26.0, 11.0, 26.0 * slope)
    assert route.length == pytest.approx(wanted, rel=1e-6)


def test_turns_are_between_true_directions() -> None:
    """Round the end of a wall: the turn is that of the two legs, and is paid for as such."""
    picture = ["." * 21 for _ in range(9)]
    for row in range(3, 9):
        picture[row] = picture[row][:10] + "#" + picture[row][11:]
    survey, terrain = drawn("\n".join(picture)), level(21, 9)
    route = plan_route(terrain, ROVER, survey, (0.5, 2.5), (20.5, 2.5), "length")
    places = corners(route)
    legs = [math.atan2(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(places)]
    angle = sum(abs(b - a) for a, b in pairwise(legs))
    turn = turnings(terrain, ROVER)[1]
    assert route.turning == pytest.approx(
        angle * (turn.work + ROVER.power * turn.run / ROVER.speed), rel=1e-9
    )
    assert any(math.degrees(one) % 45.0 > 1.0 for one in legs)


def test_waypoints_are_judged_by_the_headings_on_both_sides() -> None:
    """A leg of 26.6° needs 45° as it needs 0°; one of 45° needs that alone."""
    terrain = level(9, 9)
    for barred, oblique, diagonal in ((None, True, True), (0, False, True), (1, False, False)):
        survey = open_ground(9, 9)
        if barred is not None:
            survey.verdict[barred, 4, 2:6] = Verdict.NO_GO
        assert check_route(terrain, ROVER, survey, [(2.5, 2.5), (4.5, 6.5)]).found == oblique
        assert check_route(terrain, ROVER, survey, [(2.5, 2.5), (6.5, 6.5)]).found == diagonal


@pytest.mark.parametrize("headings", [8, 16])
def test_a_pulled_way_holds_as_waypoints(headings: int) -> None:
    """Its corners, read in as waypoints, are driven for the same length."""
    rng = np.random.default_rng(5)
    signs = rng.choice([*"......#"], (20, 31))
    signs[0, 0] = signs[-1, -1] = "."
    survey = drawn("\n".join("".join(row) for row in signs), headings=headings)
    terrain = level(31, 20)
    route = plan_route(terrain, ROVER, survey, (0.5, 19.5), (30.5, 0.5), "length")
    assert route.found and route.length is not None
    assert route.length < 0.99 * plan_chain(terrain, survey, (0.5, 19.5), (30.5, 0.5))
    again = check_route(terrain, ROVER, survey, corners(route))
    assert again.found and again.length == pytest.approx(route.length, rel=1e-9)


def test_a_way_that_can_be_driven_back_stays_one() -> None:
    """On slopes that are too steep to climb straight, it is not pulled down over them."""
    mud = {"cohesion": 1.0, "fricAngle": 22, "sinkage": 0.08, "shearModulus": 0.02}
    terrain = terrain_of(
        {
            "size": [24, 16],
            "surfTypes": {"mud": mud},
            "elemTypes": {"hill": {"x": "cosbell", "y": "cosbell", "combine": "product"}},
            "elemTree": {"type": "hill", "vScale": 2.6, "surface": "mud"},
        }
    )
    survey = survey_of(terrain, ROVER, grid_over(terrain, 0.2))
    for ends in (((2.1, 3.1), (21.1, 12.1)), ((12.1, 8.1), (2.1, 12.5))):
        search = search_route(terrain, ROVER, survey, *ends)
        route = search.route()
        if route.one_way:
            assert search.found is not None
            chain = graph_path(search.found.states, survey)
            places = np.column_stack([chain.x, chain.y])
            assert check_route(terrain, ROVER, survey, places).one_way


def test_a_leg_there_and_back_is_left_out() -> None:
    """East by two cells and back, between two legs to the north, and at the beginning."""
    survey = open_ground(9, 9)
    search = search_route(level(9, 9), ROVER, survey, (1.5, 1.5), (1.5, 6.5))
    assert search.found is not None and search.costs is not None
    aside = [(2, 5, 2), (2, 5, 3), (2, 5, 2), (2, 5, 1)]
    for states, length in (
        ([(0, 7, 1), (0, 6, 1), (0, 5, 1), (1, 5, 1), *aside, (1, 5, 1), (0, 5, 1), (0, 4, 1)], 3),
        ([(2, 5, 1), *aside, (1, 5, 1), (0, 5, 1), (0, 4, 1)], 1),
    ):
        found = replace(search.found, states=np.array(states, np.int64))
        places = pulled(search.costs, found)[:, :2]
        assert np.abs(np.diff(places, axis=0)).sum() == length


def test_offsets_beside_a_move() -> None:
    """A knight's move of 16 headings has its own heading, though it points 4° beside it."""
    for heading, (south, east) in enumerate(heading_offsets(16)):
        towards = math.degrees(math.atan2(east, -south)) % 360.0
        assert headings_beside(towards, 16) == (heading, heading)
    assert headings_beside(24.0, 16) == (1, 2) and headings_beside(350.0, 16) == (15, 0)
    assert headings_beside(22.5, 16) == (1, 1) and headings_beside(359.0, 8) == (7, 0)


def test_reports_follow_the_pulled_way() -> None:
    """From the command's own assessment: the route is the line between its cells."""
    report = assess(
        prepare_assessment(level(20, 12), ROVER, Request(routes=((2.0, 2.0, 18.0, 9.0),)))
    )
    (route,) = report.routes
    assert route.profile is not None and route.length is not None
    ends = [(float(route.profile.x[n]), float(route.profile.y[n])) for n in (0, -1)]
    assert route.length == pytest.approx(math.dist(*ends), rel=1e-9)
