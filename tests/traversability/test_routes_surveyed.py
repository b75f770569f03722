"""Routes over surveys of real terrains, where mechanics says what must come out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.traversability.map_results import Survey, cells_of
from terratool.traversability.report.routes import route_features
from terratool.traversability.route.graph import PREFERENCES, Preference
from terratool.traversability.route.paths import worst_verdict
from terratool.traversability.route.results import RouteProfile
from terratool.traversability.route.routes import (
    check_route,
    plan_route,
    reach,
    route_grid,
    with_way_back,
)
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import SurveyTiles, survey
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from tests.budget import examples
from tests.conftest import terrain_of

ROVER = Vehicle(
    Wheel(0.15, 0.1),
    (Axle(0.3), Axle(-0.3)),
    mass=40.0,
    gravity=9.81,
    track_width=0.6,
    cog_height=0.2,
    clearance=0.2,
    body_width=0.5,
    speed=0.5,
    power=5.0,
)


def plane(slope: float, sinkage: float = 0.0) -> Terrain:
    """A plane that rises to the east."""
    return terrain_of(
        {
            "size": [12, 5],
            "surfTypes": {"slab": {"cohesion": 0, "fricAngle": 35, "sinkage": sinkage}},
            "elemTypes": {"plane": {"x": [0, 12 * slope]}},
            "elemTree": {"type": "plane", "vScale": 1, "surface": "slab"},
        }
    )


def walled(height: float) -> Terrain:
    """Level ground with a low kerb on the way, and a wall of 0.2 m across it."""
    floor = {"cohesion": 0, "fricAngle": 35, "sinkage": 0}
    return terrain_of(
        {
            "size": [8, 4],
            "surfTypes": {"floor": floor, "kerb": floor, "brick": floor},
            "elemTypes": {"slab": {"x": "flat"}},
            "elemTree": {
                "type": "slab",
                "vScale": 0,
                "surface": "floor",
                "cells": [40, 20],
                "children": [
                    block(12, 0, 1, 20, surface="kerb", vOffset=0.02),
                    block(25, 0, 1, 20, surface="brick", vOffset=height),
                ],
            },
        }
    )


def block(x: int, y: int, width: int, height: int, **more: Any) -> dict[str, Any]:
    return {"type": "slab", "cellX": x, "cellY": y, "span": [width, height], "vScale": 0} | more


def seen(terrain: Terrain, vehicle: Vehicle = ROVER) -> Survey:
    return survey(terrain, vehicle, grid_over(terrain, 0.2))


def test_work_on_a_rigid_slope_is_weight_times_height() -> None:
    terrain = plane(0.2)
    surveyed = seen(terrain)
    up = plan_route(terrain, ROVER, surveyed, (1.5, 2.5), (10.5, 2.5))
    down = plan_route(terrain, ROVER, surveyed, (10.5, 2.5), (1.5, 2.5))
    length = 9 * math.hypot(1, 0.2)
    assert up.length == pytest.approx(length, rel=1e-5) == down.length
    assert up.time == pytest.approx(length / ROVER.speed, rel=1e-5)
    idle = ROVER.power * length / ROVER.speed
    assert up.energy == pytest.approx(ROVER.weight * 9 * 0.2 + idle, rel=1e-4)
    assert down.energy == pytest.approx(idle, rel=1e-4)
    assert up.steepest is not None and down.steepest is not None
    assert up.steepest.value == pytest.approx(math.atan(0.2), rel=1e-4)
    assert down.steepest.value == pytest.approx(-math.atan(0.2), rel=1e-4)


def test_work_on_soft_ground_is_the_torque_that_the_wheels_need() -> None:
    terrain, rover = plane(0.0, sinkage=0.05), ROVER.by_model("paper")
    route = plan_route(terrain, rover, seen(terrain, rover), (1.5, 2.5), (10.5, 2.5))
    load, radius = ROVER.weight / 4, ROVER.wheel.radius
    half = math.asin(math.sqrt(0.05e-3 * load / (2 * radius)))
    torque = radius * load * math.sin(half) * (half / 2) ** 2 / math.sin(half / 2) ** 2
    work = 4 * torque / radius * 9
    assert route.time is not None
    assert route.energy == pytest.approx(work + ROVER.power * route.time, rel=1e-4)
    assert route.softest is not None
    assert route.softest.value == pytest.approx(0.05e-3 * load, rel=1e-4)


def test_wall_bars_and_is_named_and_a_kerb_does_not() -> None:
    for height, bars in ((0.4, True), (0.02, False)):
        terrain = walled(height)
        surveyed = seen(terrain)
        for route in (
            plan_route(terrain, ROVER, surveyed, (1.1, 2.1), (6.9, 2.1)),
            check_route(terrain, ROVER, surveyed, [(1.1, 2.1), (6.9, 2.1)]),
        ):
            assert route.found != bars
            if bars:
                assert route.verdict == Verdict.NO_GO
                named = {barrier.bars for barrier in route.barriers}
                assert named == {'/elemTree/children/1 (surface "brick"), 0.4 m high'}
                assert {barrier.reason for barrier in route.barriers} <= {
                    Reason.STEP, Reason.HIGH_CENTRED, Reason.APPROACH, Reason.ROUGHNESS,
                }  # fmt: skip
                assert 3.5 < route.barriers[0].place.x < 5.0
                assert route.reached is not None and route.reached.x < 5.0


@pytest.mark.parametrize(("share", "climbs"), [(1.3, True), (0.9, False)])
def test_slope_beyond_the_motors_is_one_way(share: float, climbs: bool) -> None:
    """Motors a little stronger or weaker than four wheels need on 1 in 5, by m g sin α r/4."""
    needed = ROVER.weight * math.sin(math.atan(0.2)) * ROVER.wheel.radius / 4
    # to skid takes more, here as much as they have: see test_routes.py
    wheel = replace(ROVER.wheel, max_torque=share * needed)
    vehicle = replace(ROVER, wheel=wheel, steering="wheels")
    terrain = plane(0.2)
    surveyed = seen(terrain, vehicle)
    low, high = (1.5, 2.5), (10.5, 2.5)
    assert plan_route(terrain, vehicle, surveyed, high, low).found
    straight = check_route(terrain, vehicle, surveyed, [low, high])
    assert straight.found == climbs
    if not climbs:
        (barrier,) = straight.barriers
        assert barrier.reason == Reason.TORQUE and barrier.place.x == 1.5
        assert barrier.width == pytest.approx(9.0)
        assert barrier.bars == '/elemTree (surface "slab"), on a slope of 11°'
    # slanting it gets up either way, as only a part of the slope lies along its heading
    assert plan_route(terrain, vehicle, surveyed, low, high).found
    assert reach(terrain, surveyed, low).returnable > 0.5


@st.composite
def hills(draw: st.DrawFn) -> dict[str, Any]:
    """Slopes that may be too steep one way, walls and holes, on soft or hard ground."""
    surfaces = {
        "slab": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
        "mud": {"cohesion": 1.0, "fricAngle": 22, "sinkage": 0.08, "shearModulus": 0.02},
        "hole": {"void": True},
        "untold": {},
    }
    whole = st.integers
    blocks = [
        block(
            draw(whole(0, 20)), draw(whole(0, 8)), draw(whole(1, 4)), draw(whole(1, 6)),
            surface=draw(st.sampled_from(sorted(surfaces))),
            vOffset=draw(st.sampled_from([0.0, 0.03, 0.3])),
        )
        for _ in range(draw(whole(0, 6)))
    ]  # fmt: skip
    for one in blocks:
        one["span"] = [
            min(one["span"][0], 24 - one["cellX"]),
            min(one["span"][1], 10 - one["cellY"]),
        ]
    rise = draw(st.floats(-3.0, 3.0))
    return {
        "size": [12, 5],
        "surfTypes": surfaces,
        "elemTypes": {"slab": {"x": "flat"}, "plane": {"x": [0, 1]}},
        "elemTree": {
            "type": "plane", "vScale": rise, "surface": draw(st.sampled_from(["slab", "mud"])),
            "cells": [24, 10], "children": blocks,
        },
    }  # fmt: skip


@settings(max_examples=examples(25), deadline=None)
@given(
    definition=hills(),
    ends=st.tuples(*[st.floats(0.1, 0.9)] * 4),
    prefer=st.sampled_from(PREFERENCES),
    side=st.sampled_from([3, 8, 64]),
)
def test_what_tiles_show_is_what_the_whole_shows(
    definition: dict[str, Any], ends: tuple[float, ...], prefer: Preference, side: int
) -> None:
    """Route, barriers, profile and way back: equal to those of a survey of all, to the last bit."""
    terrain = terrain_of(definition)
    grid = grid_over(terrain, 0.3)
    start, goal = ((12 * ends[n], 5 * ends[n + 1]) for n in (0, 2))
    on_ground = [math.isfinite(terrain.height(*place)) for place in (start, goal)]
    if not all(on_ground) or start == goal:
        return
    with patch("terratool.traversability.tiles.TILE", side):
        tiles = SurveyTiles(Surveyor(terrain, ROVER, grid), threads=2)
        found = plan_route(terrain, ROVER, tiles, start, goal, prefer)
        checked = check_route(terrain, ROVER, tiles, [start, goal])
    for way in (found, checked):
        # whether it can be driven back is looked for beside it, too
        if way.found and way.profile is not None:
            rows, columns = cells_of(grid, way.profile.x, way.profile.y)
            for down, right in np.ndindex(3, 3):
                row = np.clip(rows + down - 1, 0, grid.height - 1) // side
                column = np.clip(columns + right - 1, 0, grid.width - 1) // side
                assert tiles.known[row, column].all()
    whole = survey(terrain, ROVER, grid)
    for one, other in (
        (found, plan_route(terrain, ROVER, whole, start, goal, prefer)),
        (checked, check_route(terrain, ROVER, whole, [start, goal])),
    ):
        assert list(route_features([one])) == list(route_features([other]))
        assert replace(one, profile=None) == replace(other, profile=None)
        if one.profile and other.profile:
            for name in RouteProfile.__slots__:
                np.testing.assert_array_equal(
                    getattr(one.profile, name), getattr(other.profile, name)
                )


def test_down_what_cannot_be_climbed_is_one_way() -> None:
    """1 in 3 on mud: there is a way down and none back; on the level, it is driven back."""
    mud = {"cohesion": 1.0, "fricAngle": 22, "sinkage": 0.08, "shearModulus": 0.02}
    definition = {
        "size": [12, 5],
        "surfTypes": {"mud": mud},
        # level for a quarter on either side
        "elemTypes": {"slope": {"x": [[0, 0], [0.25, 0], [0.75, 1], [1, 1]]}},
        "elemTree": {"type": "slope", "vScale": 2.0, "surface": "mud"},
    }
    terrain = terrain_of(definition)
    seen_ = seen(terrain)
    top, foot = (11.0, 2.5), (1.0, 2.5)
    down = plan_route(terrain, ROVER, seen_, top, foot)
    assert down.found and down.one_way and down.verdict == Verdict.CAUTION
    assert down.against and 2.5 < down.against[0].place.x < 9.5
    assert down.against[0].reason in {Reason.SLIP, Reason.TRACTION}
    up = plan_route(terrain, ROVER, seen_, foot, top)
    assert not up.found
    both = with_way_back(down, up)
    assert both.verdict == Verdict.NO_GO and not both.holds and both.found
    level = {**definition, "elemTree": {"type": "slope", "vScale": 0.0, "surface": "mud"}}
    flat = terrain_of(level)
    there = plan_route(flat, ROVER, seen(flat), top, foot)
    assert there.found and not there.one_way and not there.against
    back = plan_route(flat, ROVER, seen(flat), foot, top)
    assert with_way_back(there, back).verdict == there.verdict
    assert with_way_back(there, back).holds


def test_another_way_back_is_found_by_a_detour() -> None:
    """The same slope in mud and, beside it, rock: down the mud, back up with wheels on the rock."""
    terrain = terrain_of(
        {
            "size": [12, 6],
            "surfTypes": {
                "mud": {"cohesion": 0.1, "fricAngle": 21, "sinkage": 0.2, "shearModulus": 0.02},
                "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
            },
            "elemTypes": {"slope": {"x": [[0, 0], [0.25, 0], [0.75, 1], [1, 1]]}},
            "elemTree": {
                "type": "slope", "vScale": 0, "surface": "mud", "cells": [1, 2],
                "children": [
                    {"type": "slope", "cellX": 0, "cellY": 0, "vScale": 2.0},
                    {"type": "slope", "cellX": 0, "cellY": 1, "vScale": 2.0, "surface": "rock"},
                ],
            },
        }
    )  # fmt: skip
    seen_ = seen(terrain)
    down = plan_route(terrain, ROVER, seen_, (11, 1.5), (1, 1.5), "length")
    back = plan_route(terrain, ROVER, seen_, (1, 1.5), (11, 1.5), "length")
    assert down.found and down.one_way and back.found
    assert down.length is not None and back.length is not None
    assert back.length > down.length + 0.5
    assert down.profile is not None and down.profile.y.max() < 2
    assert back.profile is not None and back.profile.y.max() > 2.5  # half its wheels are on rock
    both = with_way_back(down, back)
    assert both.holds and both.back is not None and not both.back.one_way
    worst = max(worst_verdict(r.profile.verdict) for r in (down, back) if r.profile)
    assert both.verdict == worst


def test_grid_for_a_route_suits_the_survey() -> None:
    terrain = walled(0.4)
    grid, said = route_grid(terrain, ROVER)
    assert not said and grid.resolution == pytest.approx(0.7 / 6)
    route = plan_route(terrain, ROVER, survey(terrain, ROVER, grid), (1.1, 2.1), (4.1, 1.1))
    assert route.found and route.length is not None
    straight = math.hypot(3, 1)
    assert 0.95 * straight < route.length < straight / math.cos(math.pi / 8) + 2 * grid.resolution
