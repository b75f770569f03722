"""Ways of cars pulled straight: what they cost, where they bend, and how waypoints are rounded."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.raster.grid import Grid
from terratool.report import numbers
from terratool.traversability.route.bends import (
    bent_path,
    corners_of,
    pulled_corners,
    reversed_corners,
)
from terratool.traversability.route.graph import (
    ALLOWED,
    BACKING,
    BETWEEN,
    Costs,
    Turns,
    cheapest_way,
    drivable,
    heading_offsets,
)
from terratool.traversability.route.paths import worst_verdict
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import check_route, plan_route, search_route
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import SurveyTiles
from terratool.traversability.tiles import survey as survey_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import Reason, Verdict
from tests.budget import examples
from tests.conftest import terrain_of
from tests.surveys import ROVER, drawn, level
from tests.traversability.reeds_shepp import shortest


def car(radius: float) -> Vehicle:
    return replace(ROVER, turning_radius=radius)


def gears(route: Route) -> NDArray[np.float64]:
    """1 for each leg that is driven ahead, −1 backwards, by the heading of its end."""
    assert route.profile is not None
    heading = np.radians(route.profile.heading)
    east, north = np.diff(route.profile.x), np.diff(route.profile.y)
    return np.sign(east * np.sin(heading[1:]) + north * np.cos(heading[1:]))


def check_bends(route: Route, radius: float) -> None:
    """It goes where it looks, and bends no more than its radius lets it."""
    profile = route.profile
    assert profile is not None
    x, y, heading = profile.x, profile.y, np.radians(profile.heading)
    run = np.hypot(np.diff(x), np.diff(y))
    assert np.all(run > 0.0)
    turned = (np.diff(heading) + math.pi) % (2.0 * math.pi) - math.pi
    # a chord of an arc is 2 R sin(angle / 2)
    assert np.all(2.0 * radius * np.sin(0.5 * np.abs(turned)) <= run * (1.0 + 1e-6) + 1e-9)
    # the chord lies between both headings, a rest of a leg on either side allowed
    towards = np.arctan2(np.diff(x), np.diff(y)) + math.pi * (gears(route) < 0.0)
    aside = (towards - heading[:-1] + math.pi) % (2.0 * math.pi) - math.pi
    low, high = np.minimum(turned, 0.0), np.maximum(turned, 0.0)
    assert np.all((aside >= low - 1e-6) & (aside <= high + 1e-6))


def check_ground(route: Route, can: NDArray[np.bool_], resolution: float, height: float) -> None:
    """A tenth of a cell at a time, the nearest cell can be driven with the nearest heading."""
    profile = route.profile
    assert profile is not None
    count = len(can)
    facing = np.radians(profile.heading)
    for n, gear in enumerate(gears(route).tolist()):
        begin, end = (np.array([profile.x[k], profile.y[k]]) for k in (n, n + 1))
        turned = (facing[n + 1] - facing[n] + math.pi) % (2.0 * math.pi) - math.pi
        for share in np.linspace(0.0, 1.0, 12)[1:-1]:
            place = begin + share * (end - begin)
            # an arc bows out of its chord, to the side that it turns away from
            chord = end - begin
            left = np.array([-chord[1], chord[0]])
            place = place + gear * 0.5 * turned * share * (1.0 - share) * left
            looks = facing[n] + share * turned
            at = round(looks * count / (2.0 * math.pi)) % count
            free = can[at] & can[(at + count // 2) % count] if gear < 0.0 else can[at]
            # corners of cells that are cut by a twentieth do not count
            down = (height - place[1]) / resolution + np.array([-0.05, 0.05])
            right = place[0] / resolution + np.array([-0.05, 0.05])
            rows = down.astype(int).clip(0, len(free) - 1)
            columns = right.astype(int).clip(0, free.shape[1] - 1)
            assert free[np.ix_(rows, columns)].any()


@settings(max_examples=examples(60), deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    headings=st.sampled_from([8, 16]),
    radius=st.sampled_from([0.7, 1.6, 3.0]),
    alike=st.booleans(),
)
def test_each_metre_is_drivable_and_nothing_is_longer(
    seed: int, headings: int, radius: float, alike: bool
) -> None:
    """On oblong random ground whose headings differ: curvature, ground, length and caution."""
    rng = np.random.default_rng(seed)
    rows, columns = (int(side) for side in rng.integers(8, 34, 2))
    rare = float(rng.choice([0.005, 0.03]))
    signs = rng.choice([*".c#"], (rows, columns), p=[1.0 - 2.0 * rare, rare, rare])
    heights = rng.uniform(0.0, 0.2, (rows, columns))
    survey = drawn(
        "\n".join("".join(row) for row in signs), headings=headings, heights=heights,
        resolution=0.5,
    )  # fmt: skip
    if not alike:
        survey.verdict[rng.random(survey.verdict.shape) < 0.5 * rare] = Verdict.NO_GO
    height = 0.5 * rows
    terrain, vehicle = level(0.5 * columns, height), car(radius)
    free = np.argwhere(drivable(survey).any(axis=0))
    ends = free[rng.choice(len(free), 2, replace=False)].tolist()
    start, goal = ((0.5 * c + 0.25, height - 0.5 * r - 0.25) for r, c in ends)
    search = search_route(terrain, vehicle, survey, start, goal, "length")
    route = search.route()
    if not route.found:
        return
    assert search.found is not None and route.length is not None and route.profile is not None
    corners = corners_of(search.found.states, headings, 2.0 * radius)
    chain = bent_path(corners, survey)
    rise = np.diff(chain.height)
    longest = float(np.hypot(chain.leg_lengths, rise).sum())
    assert route.length <= longest * (1.0 + 1e-3)  # both by the chords of their arcs
    assert worst_verdict(route.profile.verdict) <= worst_verdict(chain.values_of(survey.verdict))
    assert (route.profile.x[0], route.profile.y[0]) == pytest.approx(start)
    assert (route.profile.x[-1], route.profile.y[-1]) == pytest.approx(goal)
    check_bends(route, radius)
    check_ground(route, drivable(survey), 0.5, height)


def length_of(corners: NDArray[np.float64]) -> float:
    """Length of a way with arcs, in sides of a cell."""
    total = 0.0
    for n, (before, at) in enumerate(pairwise(corners), 1):
        total += math.dist(before[:2], at[:2]) - before[4] - at[3]
        if at[5]:
            one, two = at[:2] - before[:2], corners[n + 1, :2] - at[:2]
            cosine = float(one @ two / math.hypot(*one) / math.hypot(*two))
            angle = math.acos(max(-1.0, min(1.0, cosine)))
            rests = at[3] + at[4] - 2.0 * at[5] * math.tan(0.5 * angle)
            total += rests + at[5] * angle
    return total


@pytest.mark.parametrize(("headings", "gap", "mean"), [(8, 0.06, 0.02), (16, 0.06, 0.02)])
def test_lengths_on_open_ground_are_near_the_shortest(
    headings: int, gap: float, mean: float
) -> None:
    """Between Reeds and Shepp's and the search's, from four radii on by a hundredth more."""
    rng = np.random.default_rng(3)
    side, radius, over, before = 121, 8.0, [], []
    shape = (headings, side, side)
    middle = side // 2
    offsets = heading_offsets(headings)
    for _ in range(30):
        begin = int(rng.integers(headings))
        row, column = rng.integers(5, side - 5, 2).tolist()
        flags = np.full(shape, ALLOWED | BACKING | BETWEEN, np.uint8)
        # one heading and its opposite at the start
        lane = [begin, (begin + headings // 2) % headings]
        flags[np.setdiff1d(np.arange(headings), lane), middle, middle] = 0
        costs = replace(
            Costs.of(
                np.ones(shape, np.float32), flags, np.zeros(shape[1:], np.float32), 1.0,
                Turns(0.3, radius), 1.0,
            ),
            backward=1.0, shift=0.0,
        )  # fmt: skip
        found = cheapest_way(costs, np.array([(begin, middle, middle)], np.int64), (row, column))
        assert length_of(corners_of(found.states, headings, radius)) == pytest.approx(found.cost)
        corners = pulled_corners(costs, found, radius)
        length = length_of(corners)
        assert length <= found.cost * (1.0 + 1e-9)
        towards = math.atan2(offsets[begin][1], -offsets[begin][0])
        north, east = middle - row, column - middle
        ahead = north * math.cos(towards) + east * math.sin(towards)
        left = north * math.sin(towards) - east * math.cos(towards)
        least = min(
            shortest(ahead, left, towards - end, radius)
            for end in np.linspace(0.0, 2.0 * math.pi, 91)
        )
        assert length >= least * (1.0 - 1e-3)
        if math.hypot(north, east) > 4.0 * radius:
            over.append(length / least - 1.0)
            before.append(found.cost / least - 1.0)
    assert max(over) < gap and np.mean(over) < min(mean, 0.5 * np.mean(before)) and len(over) > 15


def test_a_car_drives_straight_on_open_ground() -> None:
    """Whatever the direction: with any heading at both ends there is nothing to bend for."""
    survey, terrain = drawn(("." * 60 + "\n") * 40), level(60, 40)
    for goal in ((58.5, 21.5), (7.5, 38.5), (30.5, 1.5)):
        route = plan_route(terrain, car(5.0), survey, (2.5, 3.5), goal)
        assert route.length == pytest.approx(math.dist((2.5, 3.5), goal), rel=1e-6)
        assert route.profile is not None
        assert np.ptp(route.profile.heading) < 1e-6


def test_a_car_rounds_the_end_of_a_wall_by_its_radius() -> None:
    """Tangent, arc about the wall's end and tangent, no longer than one more cell around it."""
    picture = ["." * 60 for _ in range(60)]
    for row in range(20, 60):
        picture[row] = picture[row][:30] + "#" + picture[row][31:]
    survey, terrain, radius = drawn("\n".join(picture), resolution=0.25), level(15, 15), 2.0
    ends = (2.125, 4.125), (12.875, 4.125)
    route = plan_route(terrain, car(radius), survey, *ends, "length")
    check_bends(route, radius)
    assert route.length is not None
    # about a circle whose top is above the wall's top cell by some cells: tangents and an arc
    best = math.inf
    for clear in np.arange(0.25, 1.01, 0.05):
        middle = np.array([7.625, 10.0 + clear - radius])
        one = np.array(ends[0]) - middle
        far = math.hypot(*one)
        tangent = math.sqrt(far**2 - radius**2)
        angle = math.atan2(-one[0], one[1]) - math.acos(radius / far)
        # the arc must lie beyond the sides of the wall, half a cell and one aside
        if radius - math.sqrt(radius**2 - 0.375**2) <= clear - 0.25:
            best = min(best, 2.0 * (tangent + radius * angle))
    assert 0.99 * best < route.length < 1.02 * best


def test_gears_change_in_line() -> None:
    """Out of one lane and into another beside it: at each change it looks where it did."""
    picture = ["." * 30 for _ in range(14)] + ["#" * 12 + "." + "##" + "." + "#" * 14] * 10
    survey, terrain = drawn("\n".join(picture), resolution=0.5), level(15, 12)
    survey.verdict[4, 14:, 12] = survey.verdict[0, 14:, 15] = Verdict.NO_GO
    route = plan_route(terrain, car(2.0), survey, (6.25, 0.75), (7.75, 0.75), "length")
    check_bends(route, 2.0)
    assert np.count_nonzero(np.diff(gears(route))) >= 1


def test_a_way_backed_up_is_the_way_in_reverse() -> None:
    """Corners turned round twice are the same; places are those of the way, backwards."""
    survey = drawn(("." * 30 + "\n") * 20)
    corners = np.array(
        [[2, 3, 0, 0, 0, 0, 0], [12, 3, 1, 3, 3, 3, 0], [12, 20, 1, 0, 0, 0, 0],
         [12, 9, -1, 0, 0, 0, 0]], float,
    )  # fmt: skip
    back = reversed_corners(corners)
    assert back[1:, 2].tolist() == [1.0, -1.0, -1.0]
    assert reversed_corners(back) == pytest.approx(corners)
    one, two = bent_path(corners, survey), bent_path(back, survey)
    assert one.x == pytest.approx(two.x[::-1]) and one.y == pytest.approx(two.y[::-1])
    assert one.direction == pytest.approx(two.direction[::-1])


def test_a_way_down_a_slope_that_is_not_climbed_is_one_way() -> None:
    """Barred to the north in a strip across: to the south it is driven, and not backed up."""
    survey, terrain = drawn(("." * 20 + "\n") * 30), level(20, 30)
    survey.verdict[[7, 0, 1], 14:16] = Verdict.NO_GO
    down = plan_route(terrain, car(2.0), survey, (5.5, 28.5), (11.5, 2.5))
    assert down.found and down.one_way and down.against[0].place.y == pytest.approx(14.0, abs=1.5)
    assert not plan_route(terrain, car(2.0), survey, (11.5, 2.5), (5.5, 28.5)).found
    free = drawn(("." * 20 + "\n") * 30)
    assert not plan_route(terrain, car(2.0), free, (5.5, 28.5), (11.5, 2.5)).one_way


class TestWaypoints:
    """Corners between waypoints, rounded by arcs."""

    @pytest.mark.parametrize("corner", [(12.0, 4.0), (12.0, 12.0), (4.0, 12.0)])
    def test_a_corner_is_rounded_and_missed_by_what_the_note_says(
        self, corner: tuple[float, float]
    ) -> None:
        points = [(2.0, 4.0), corner, (13.0, 18.0)]
        route = check_route(level(20, 20), car(2.0), drawn(("." * 20 + "\n") * 20), points)
        assert route.found and route.profile is not None and route.turning == 0.0
        check_bends(route, 2.0)
        gap = np.hypot(route.profile.x - corner[0], route.profile.y - corner[1]).min()
        one, two = (np.subtract(b, a) for a, b in pairwise(points))
        angle = math.acos(one @ two / math.hypot(*one) / math.hypot(*two))
        missed = 2.0 / math.cos(0.5 * angle) - 2.0
        assert missed - 1e-9 <= gap <= math.hypot(missed, 0.26)
        assert route.length == pytest.approx(
            math.hypot(*one) + math.hypot(*two) + 2.0 * angle - 4.0 * math.tan(0.5 * angle),
            rel=1e-3,
        )
        said = f"arcs of 2 m: the way misses waypoint 2 by {numbers.length(missed)}."
        assert said in route.note

    def test_legs_that_are_too_short_bar(self) -> None:
        """By 90° an arc of 2 m takes 2 m of each: of two corners 3.9 m apart one remains."""
        survey, terrain = drawn(("." * 20 + "\n") * 20), level(20, 20)
        for apart, found in ((3.9, False), (4.1, True)):
            points = [(2.0, 4.0), (9.0, 4.0), (9.0, 4.0 + apart), (16.0, 4.0 + apart)]
            for way in (points, points[::-1]):
                route = check_route(terrain, car(2.0), survey, way)
                assert route.found == found
                if not found:
                    (bar,) = route.barriers
                    assert bar.reason == Reason.TURNING
                    assert (bar.place.x, bar.place.y) == pytest.approx(way[2])

    @pytest.mark.parametrize("degrees", [5.0, 30.0, 67.0])
    def test_what_a_car_can_back_out_of_is_not_one_way(self, degrees: float) -> None:
        """Whatever its direction, between headings, too; a strip that is not climbed bars it."""
        survey, terrain = drawn(("." * 60 + "\n") * 60, resolution=0.5), level(30, 30)
        along = np.array([math.sin(math.radians(degrees)), math.cos(math.radians(degrees))])
        points = [(2.0, 2.0), tuple(np.array([2.0, 2.0]) + 25.0 * along)]
        assert check_route(terrain, car(12.0), survey, points).verdict == Verdict.GO
        survey.verdict[3:7, 30:32] = survey.verdict[3:7, :, 30:32] = Verdict.NO_GO
        assert check_route(terrain, car(12.0), survey, points).one_way

    def test_a_line_is_not_rounded(self) -> None:
        """Three points in a line, and a way there and back, which no arc can turn."""
        survey, terrain = drawn(("." * 20 + "\n") * 20), level(20, 20)
        line = check_route(terrain, car(2.0), survey, [(2, 4), (9, 4), (16, 4)])
        assert line.found and not line.note and line.length == pytest.approx(14.0)
        assert not check_route(terrain, car(2.0), survey, [(2, 4), (9, 4), (2, 4)]).found

    def test_an_arc_over_barred_ground_is_barred(self) -> None:
        """The corner itself is free, what the arc cuts off is not."""
        picture = [["."] * 20 for _ in range(20)]
        picture[14][10] = "#"  # 0.7 m from the corner, to the inside
        survey = drawn("\n".join("".join(row) for row in picture))
        points = [(2.5, 4.5), (11.5, 4.5), (11.5, 15.5)]
        assert check_route(level(20, 20), ROVER, survey, points).found
        route = check_route(level(20, 20), car(4.0), survey, points)
        assert not route.found and route.barriers[0].reason == Reason.STEP
        assert "rounded" in route.note


def test_waypoints_are_judged_by_the_worse_heading_on_ground_that_is_not_known_yet() -> None:
    """Up a slope at 60°: 45° can be driven, 90° cannot; the survey is made when it is asked for."""
    mud = {"cohesion": 1.0, "fricAngle": 22, "sinkage": 0.08, "shearModulus": 0.02}
    terrain = terrain_of(
        {
            "size": [30, 20],
            "surfTypes": {"mud": mud},
            "elemTypes": {"ramp": {"x": [0, 1], "y": [1]}},
            "elemTree": {
                "type": "ramp", "vScale": 30.0 * math.tan(math.radians(15.0)), "surface": "mud",
            },
        }
    )  # fmt: skip
    grid = Grid(5.0, 5.0, 0.25, 40, 60)
    whole = survey_of(terrain, ROVER, grid)
    can = drivable(whole)[:, 20, 30]
    assert can[1] and not can[2]
    points: list[Any] = [(8.0, 7.0), (15.0, 11.0)]
    wanted = check_route(terrain, ROVER, whole, points)
    found = check_route(terrain, ROVER, SurveyTiles(Surveyor(terrain, ROVER, grid, 8)), points)
    assert not wanted.found and found.barriers == wanted.barriers
