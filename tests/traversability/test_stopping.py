"""Braking, stopping distances, and speeds that stop in time, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.raster.grid import grid_over
from terratool.traversability.figures import Figures
from terratool.traversability.limits import slope_demand
from terratool.traversability.route.routes import plan_route
from terratool.traversability.soil import surface_figures
from terratool.traversability.stopping import (
    allowed_speed,
    braking,
    deceleration,
    stopping_distance,
)
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Load, Soil, Vehicle, Wheel
from tests.conftest import terrain_of

ROCK = Soil(0.0, math.atan(0.7), 0.0)
LONG = Vehicle(
    Wheel(0.2, 0.1), (Axle(0.4), Axle(-0.6)), 100.0, 10.0, track_width=0.8, cog_height=0.3,
    clearance=0.2, speed=2.0,
)  # fmt: skip
"""Its centre of gravity is nearer to the front."""


def test_all_wheels_brake_with_their_friction() -> None:
    """B = μ W where all are driven, however the load moves ahead."""
    assert braking(LONG, ROCK) == pytest.approx(0.7)
    assert braking(replace(LONG, cog_height=0.5), ROCK) == pytest.approx(0.7)


@pytest.mark.parametrize("front", [True, False])
def test_one_axle_brakes_with_what_it_bears(front: bool) -> None:
    """As the force B presses the vehicle ahead, the front bears B h/L more: μ b/(L − μ h) of W,
    and the rear B h/L less: μ a/(L + μ h)."""
    axles = Axle(0.4, driven=front), Axle(-0.6, driven=not front)
    expected = 0.7 * 0.6 / (1.0 - 0.7 * 0.3) if front else 0.7 * 0.4 / (1.0 + 0.7 * 0.3)
    assert braking(replace(LONG, axles=axles), ROCK) == pytest.approx(expected)


def test_motors_and_balance_limit_it() -> None:
    """Tmax/r of each driven wheel; and the rear axle lifts at a/h of the weight."""
    weak = replace(LONG, wheel=replace(LONG.wheel, max_torque=10.0))
    assert braking(weak, ROCK) == pytest.approx(4 * 10.0 / 0.2 / 1000.0)
    tall = replace(LONG, cog_height=0.8)
    assert braking(tall, ROCK) == pytest.approx(0.4 / 0.8)
    laden = replace(LONG, loads=(Load(100.0, 0.3), Load(100.0, 0.8), Load(400.0, 0.3)))
    assert braking(laden, ROCK) == pytest.approx(0.5)


@given(st.floats(0.1, 0.9), st.floats(-30.0, 30.0))
def test_straight_down_a_slope(friction: float, degrees: float) -> None:
    """v²/(2 g (μ cos α − sin α)) downhill, and with + sin α uphill."""
    slope = math.radians(degrees)
    slowing = 9.81 * (friction * math.cos(slope) + math.sin(slope))
    assert float(deceleration(friction, 9.81, slope)) == pytest.approx(slowing)
    stops = float(stopping_distance(LONG, slowing))
    assert stops == (pytest.approx(4.0 / (2.0 * slowing)) if slowing > 0.0 else math.inf)


def test_across_a_slope_friction_is_shared() -> None:
    """On a cross-slope as steep as friction nothing is left to brake with; on neither side."""
    for side in (1.0, -1.0):
        assert float(deceleration(0.7, 10.0, 0.0, side * math.atan(0.7))) == pytest.approx(
            0.0, abs=1e-6
        )
        # a 3-4-5 triangle: 0.6 across of a hold of 1 leaves 0.8
        roll = math.atan(0.75)
        left = float(deceleration(1.25, 10.0, 0.0, side * roll))
        assert left == pytest.approx(10.0 * 0.8)


def test_the_brake_check_of_maps_ends_where_it_cannot_stop() -> None:
    """On rigid ground the steepest slope down which it is held is that of no deceleration."""
    slope = math.atan(0.7)
    for more in (-1e-4, 1e-4):
        held = slope_demand(LONG, ROCK, -(slope + more)).utilisation < 1.0
        assert held == (float(deceleration(braking(LONG, ROCK), 10.0, -(slope + more))) > 0.0)


@given(st.floats(0.5, 8.0), st.floats(0.0, 2.0), st.floats(0.05, 20.0))
def test_the_allowed_speed_stops_in_time(slowing: float, late: float, distance: float) -> None:
    """From it the way to stop is the distance, unless the vehicle is slower anyway."""
    fast = replace(LONG, speed=100.0, reaction_time=late, stopping_distance=distance)
    speed = float(allowed_speed(fast, slowing))
    run = float(stopping_distance(replace(fast, speed=speed), slowing))
    assert run == pytest.approx(distance, rel=1e-6)
    assert float(allowed_speed(replace(fast, speed=0.01), slowing)) <= 0.01
    assert float(allowed_speed(fast, -1.0)) == 0.0


def ramp() -> dict[str, object]:
    """20 m level ground of concrete, then 20 m that fall by 4 m to the east, 6 m wide."""
    return {
        "size": [40, 6],
        "surfTypes": {"floor": {"cohesion": 0, "fricAngle": 35, "sinkage": 0}},
        "elemTypes": {"hill": {"x": [[0, 1], [0.5, 1], [1, 0]], "y": [1]}},
        "elemTree": {"type": "hill", "vScale": 4, "surface": "floor"},
    }


def test_a_route_is_slower_where_it_could_not_stop() -> None:
    """On the level √(2 g d μ), downhill √(2 g d (μ cos α − sin α)); back up it is not slower."""
    terrain = terrain_of(ramp())
    vehicle = replace(LONG, speed=5.0, stopping_distance=1.0)
    seen = survey(terrain, vehicle, grid_over(terrain, 0.25))
    there = plan_route(terrain, vehicle, seen, (3, 3), (37, 3))
    profile, slope = there.profile, math.atan(0.2)
    assert profile is not None and there.slowest is not None and there.stop is not None
    friction = math.tan(math.radians(35))
    level = math.sqrt(2.0 * 10.0 * friction)
    down = math.sqrt(2.0 * 10.0 * (friction * math.cos(slope) - math.sin(slope)))
    assert profile.speed[10] == pytest.approx(level, rel=1e-3)
    assert there.slowest.value == pytest.approx(down, rel=1e-3)
    assert there.slowest.place.x > 20.0
    assert there.stop.value == pytest.approx(25.0 / down**2, rel=1e-2)
    back = plan_route(terrain, vehicle, seen, (37, 3), (3, 3))
    assert back.slowest is not None and back.slowest.value == pytest.approx(level, rel=1e-3)
    assert there.time is not None and back.time is not None and there.time > 1.15 * back.time
    assert profile.time[-1] == pytest.approx(there.time)
    free = plan_route(terrain, replace(vehicle, stopping_distance=math.inf), seen, (3, 3), (37, 3))
    assert free.time == pytest.approx(there.length / 5.0, rel=1e-3)
    assert free.slowest is None


def test_figures_have_it() -> None:
    """Braking, distance and speed on the level of each surface; unknown soil has none."""
    surface = terrain_of(ramp()).surface_types["floor"]
    found: Figures = surface_figures("floor", surface, replace(LONG, stopping_distance=0.2))
    friction = math.tan(math.radians(35))
    assert found.braking == pytest.approx(friction)
    assert found.stopping == pytest.approx(4.0 / (2.0 * 10.0 * friction))
    assert found.speed_limit == pytest.approx(math.sqrt(2.0 * 10.0 * friction * 0.2))
    assert surface_figures("floor", surface, LONG).speed_limit is None
    assert np.isnan(deceleration(math.nan, 10.0))
