"""Rolling resistance, the range on a charge, and the charge that routes use."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from terratool.definition.model import Surface
from terratool.raster.grid import grid_over
from terratool.traversability.conditions import parse
from terratool.traversability.limits import climb, slope_demand
from terratool.traversability.route.charge import with_charge
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import plan_route, with_way_back
from terratool.traversability.soil import surface_figures
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Battery, Soil, Vehicle
from terratool.traversability.vehicle_files import load_vehicle
from terratool.traversability.verdicts import Verdict
from terratool.traversability.wheel import towed_resistance, traction
from tests.commands import ROOT
from tests.conftest import terrain_of
from tests.surveys import ROVER

WARTHOG = load_vehicle(ROOT / "samples" / "vehicles" / "warthog.json")
ROCK = Soil(0.0, math.radians(35), 0.0, rolling=0.03)
ROLLER = replace(ROVER, wheel=replace(ROVER.wheel, rolling=0.02))


def test_by_hand() -> None:
    """280 kg on tyres with 0.02 on concrete: 54.9 N; at 5 m/s and 150 W beside, 84.9 J a metre."""
    found = surface_figures("concrete", Surface(preset="concrete"), WARTHOG)
    assert found.rolling == 0.02  # the tyre's own: that of concrete is 0.015
    assert found.energy == pytest.approx(280 * 9.80665 * 0.02 + 150 / 5)
    charged = replace(WARTHOG, battery=Battery(3.6e6, 0.25), efficiency=0.6)
    found = surface_figures("concrete", Surface(preset="concrete"), charged)
    metre = 280 * 9.80665 * 0.02 / 0.6 + 150 / 5
    assert found.energy == pytest.approx(metre)
    assert found.driving_range == pytest.approx(0.75 * 3.6e6 / metre)


@pytest.mark.parametrize(("ground", "counts"), [(0.05, 0.05), (0.01, 0.02)])
def test_the_larger_of_ground_and_wheel_counts(ground: float, counts: float) -> None:
    """Losses of one and the same rolling are not counted twice."""
    soil = replace(ROCK, rolling=ground)
    resists, held = counts * 100.0, 100.0 * math.tan(soil.friction)
    assert float(towed_resistance(100.0, soil, ROLLER.wheel)) == pytest.approx(resists)
    found = traction(100.0, soil, ROLLER.wheel)
    assert float(found.drawbar) == pytest.approx(held)
    assert float(found.torque) == pytest.approx((held + resists) * ROLLER.wheel.radius)
    paper = replace(ROLLER.wheel, slips=False)
    assert float(towed_resistance(100.0, soil, paper)) == 0.0


def test_slopes() -> None:
    """It climbs tan α = μ, is driven down to tan α = c, and held from there on.

    A motor at its limit climbs less by that.
    """
    assert climb(ROVER, ROCK).angle == pytest.approx(ROCK.friction, rel=1e-4)
    weak = replace(ROVER, wheel=replace(ROVER.wheel, max_torque=0.2 * 50.0 * ROVER.wheel.radius))
    angle = climb(weak, ROCK).angle
    assert math.sin(angle) + 0.03 * math.cos(angle) == pytest.approx(0.2, rel=1e-4)
    for slope, moves in ((0.029, True), (0.031, False)):
        need = slope_demand(ROVER, ROCK, -math.atan(slope))
        assert (need.energy > 0.0) == moves
    on_soil = Soil(500.0, 0.5, 1e-4, 0.02)
    level = slope_demand(ROVER, on_soil).energy
    rolls = slope_demand(ROVER, replace(on_soil, rolling=0.03)).energy
    assert 0.03 * ROVER.weight < rolls - level < 0.04 * ROVER.weight  # more, as it slips


def planned(vehicle: Vehicle, *, back: bool = False) -> Route:
    """From west to east on level ground, 16 m, of concrete whose tyres resist with 0.1."""
    floor = {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "rollingResistance": 0.1}
    terrain = terrain_of(
        {
            "size": [20, 4],
            "surfTypes": {"floor": floor},
            "elemTypes": {"flat": {"x": "flat"}},
            "elemTree": {"type": "flat", "vScale": 0, "surface": "floor"},
        }
    )
    seen = survey(terrain, vehicle, grid_over(terrain, 0.25))
    route = plan_route(terrain, vehicle, seen, (2, 2), (18, 2))
    if back:
        route = with_way_back(route, plan_route(terrain, vehicle, seen, (18, 2), (2, 2)))
    return with_charge(route, vehicle, terrain)


NEED = (0.1 * ROVER.weight / 0.5 + ROVER.power / ROVER.speed) * 16.0
"""Joules that the way takes with an efficiency of a half."""


@pytest.mark.parametrize(
    ("capacity", "verdict"),
    [(2.1 * NEED, Verdict.GO), (1.9 * NEED, Verdict.CAUTION), (0.8 * NEED, Verdict.NO_GO)],
)
def test_a_way_uses_a_charge(capacity: float, verdict: Verdict) -> None:
    """Go but for a reserve of a half, caution within it, no-go where the battery is empty."""
    vehicle = replace(ROVER, efficiency=0.5, battery=Battery(capacity, 0.5))
    route = planned(vehicle)
    assert route.energy == pytest.approx(NEED, rel=1e-3)
    charge, profile = route.charge, route.profile
    assert charge is not None and profile is not None
    assert charge.share == pytest.approx(NEED / capacity, rel=1e-3)
    assert (charge.verdict, route.verdict, route.holds) == (
        verdict, verdict, verdict != Verdict.NO_GO,
    )  # fmt: skip
    assert profile.energy[-1] == pytest.approx(route.energy)
    assert np.all(np.diff(profile.energy) > 0.0)
    if verdict == Verdict.NO_GO:
        assert charge.emptied is not None
        assert charge.emptied.value == pytest.approx(0.8 * 16.0, abs=0.3)
        assert charge.emptied.place.x == profile.x[0] + charge.emptied.value
    else:
        assert charge.emptied is None


def test_a_way_back_counts() -> None:
    """A battery that lasts there, but not back, is no-go; where it is empty is not said."""
    vehicle = replace(ROVER, efficiency=0.5, battery=Battery(1.5 * NEED))
    both = planned(vehicle, back=True).charge
    assert both is not None and both.share == pytest.approx(2.0 / 1.5, rel=1e-3)
    assert both.verdict == Verdict.NO_GO and both.emptied is None
    assert planned(vehicle).verdict == Verdict.GO
    assert planned(replace(ROVER, efficiency=0.5)).charge is None


def test_a_condition_on_it() -> None:
    """A share, which may be more than all of it."""
    assert parse("charge>1.5").limit == 1.5
    assert parse("charge<0.5").needs == "route"
