"""Routes over surveys of real terrains, where mechanics says what must come out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.traversability.results import Reason, Survey, Verdict
from terratool.traversability.route.routes import check_route, plan_route, reach, route_grid
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
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
    terrain = plane(0.0, sinkage=0.05)
    route = plan_route(terrain, ROVER, seen(terrain), (1.5, 2.5), (10.5, 2.5))
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
    vehicle = replace(ROVER, wheel=replace(ROVER.wheel, max_torque=share * needed))
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


def test_grid_for_a_route_suits_the_survey() -> None:
    terrain = walled(0.4)
    grid, said = route_grid(terrain, ROVER)
    assert not said and grid.resolution == pytest.approx(0.7 / 6)
    route = plan_route(terrain, ROVER, survey(terrain, ROVER, grid), (1.1, 2.1), (4.1, 1.1))
    assert route.found and route.length is not None
    straight = math.hypot(3, 1)
    assert 0.95 * straight < route.length < straight / math.cos(math.pi / 8) + 2 * grid.resolution
