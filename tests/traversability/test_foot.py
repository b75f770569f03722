"""Feet: values of the books, footholds, and stances on ground."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.model import Surface
from terratool.definition.presets import PRESETS
from terratool.definition.vehicle import CogText, FeetText, VehicleText
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.traversability import foot
from terratool.traversability.judge import Judge
from terratool.traversability.map import map_bands
from terratool.traversability.map_files import CHANCE, FOOTHOLD, NUMBERS, further_bands
from terratool.traversability.soil import surface_figures
from terratool.traversability.stopping import braking
from terratool.traversability.survey import Surveyor
from terratool.traversability.track import plate_sinkage
from terratool.traversability.vehicle import Soil, Vehicle
from terratool.traversability.vehicle_files import vehicle_of
from terratool.traversability.verdicts import COLORS, GroundClass, Reason, Verdict
from terratool.viewing.layers import layer_picture
from tests.conftest import terrain_of
from tests.traversability.test_belts import EAST, along, bar, crawler, ground, surveyed

LOAD, DISC = 150.0, 0.05
BOOK = {
    "dry-sand": (64.9, 75.9, 81.8),
    "sandy-loam-15": (12.7, 130.9, 86.5),
    "lete-sand": (3.09, 121.0, 93.0),
    "snow-us": (440.0, 38.7, 55.7),
    "lunar-nominal": (90.1, 23.8, 105.4),
}
"""Sinkage, mm, what the soil bears and what holds, N, of a disc of 50 mm under 150 N."""


def walker(**others: Any) -> Vehicle:
    """A quadruped of 30 kg, 0.6 m by 0.4 m, whose feet are lifted 0.2 m."""
    size = {"diameter": DISC, "length": 0.6, "step_height": 0.2} | others.pop("feet", {})
    text = {"mass": 30.0, "gravity": 10.0, "track": 0.4, "clearance": 0.3} | others
    return vehicle_of(VehicleText(feet=FeetText(**size), cog=CogText(height=0.3), **text))


class TestFormulas:
    """A foot by itself."""

    @pytest.mark.parametrize("name", BOOK)
    def test_the_values_of_the_books(self, name: str) -> None:
        preset, (sinkage, bears, holds) = PRESETS[name], BOOK[name]
        cohesion, friction = 1e3 * preset.cohesion, math.radians(preset.fric_angle)
        area = foot.disc_area(DISC)
        z = plate_sinkage(preset, LOAD / area, DISC)
        assert 1e3 * z == pytest.approx(sinkage, rel=3e-3)
        weight = 1e3 * preset.unit_weight
        found = foot.bearing_load(cohesion, friction, weight, DISC)
        assert found == pytest.approx(bears, abs=0.06)
        grip = foot.foot_grip(LOAD, cohesion, friction, area)
        assert grip == pytest.approx(holds, abs=0.06)
        # the figures of a vehicle on two feet of four say the same
        figures = surface_figures(name, Surface(preset=name), walker())
        assert figures.load == pytest.approx(LOAD)
        assert 1e3 * (figures.sinkage or 0.0) == pytest.approx(sinkage, rel=3e-3)
        assert figures.bearing == pytest.approx(bears, abs=0.06)
        assert figures.thrust == pytest.approx(holds, abs=0.06)

    @pytest.mark.parametrize("name", BOOK)
    def test_a_foot_sinks_in_until_it_is_borne(self, name: str) -> None:
        """At its depth the sum of the three terms is the load, of a circle with Vesic's factors."""
        preset = PRESETS[name]
        cohesion, friction = 1e3 * preset.cohesion, math.radians(preset.fric_angle)
        weight, tangent = 1e3 * preset.unit_weight, math.tan(friction)
        depth = foot.borne_at(LOAD, cohesion, friction, weight, DISC)
        q = math.exp(math.pi * tangent) * (1 + math.sin(friction)) / (1 - math.sin(friction))
        pressure = (
            1.3 * cohesion * (q - 1) / tangent
            + weight * depth * q * (1 + tangent)
            + 0.6 * weight * DISC * (q + 1) * tangent
        )
        assert depth > 0.0 and pressure * math.pi * DISC**2 / 4 == pytest.approx(LOAD)
        # it stands in that depth, or in Bekker's if that is more; feet are lifted 0.2 m
        figures = surface_figures(name, Surface(preset=name), walker())
        stands = max(depth, figures.sinkage or 0.0)
        assert figures.borne_at == pytest.approx(stands)
        limits = ((0.14, Verdict.GO), (0.2, Verdict.CAUTION), (math.inf, Verdict.NO_GO))
        assert figures.verdict == next(verdict for limit, verdict in limits if stands < limit)
        if figures.verdict != Verdict.GO:
            assert figures.reason == Reason.SINKAGE
        if figures.verdict == Verdict.NO_GO:
            assert figures.climb is figures.cross_slope is figures.step is None

    def test_a_surface_keeps_its_own_k(self) -> None:
        """Reports have the k of the file, for a foot as it walks, or a whole track."""
        own = Surface(cohesion=1.0, fric_angle=30.0, sinkage=0.04)
        for vehicle in (walker(), crawler()):
            figures = surface_figures("s", own, vehicle)
            assert figures.sinkage_rate == pytest.approx(0.04e-3)
            assert figures.sinkage == pytest.approx(0.04e-3 * (figures.load or 0.0))

    def test_hind_feet_find_fresh_ground(self) -> None:
        """They sink in as deep as the fore feet, so a climb ends where the rear ones reach 0.13 m.

        The rear ones bear W (cos α/2 + h sin α/L) there, h 0.3 m and L 0.6 m.
        """
        lifted = walker(feet={"step_height": 0.13})
        figures = surface_figures("s", Surface(preset="dry-sand"), lifted)
        depth, climb = figures.borne_at or 0.0, figures.climb or 0.0
        assert figures.climb_binding == Reason.SINKAGE and 0.1 < depth < 0.13
        deeper = math.cos(climb) + 2.0 * 0.3 / 0.6 * math.sin(climb)
        assert depth * deeper == pytest.approx(0.13, rel=1e-3)

    def test_stronger_soil_bears_sooner(self) -> None:
        usual = foot.borne_at(LOAD, 1e3, 0.5, 15e3, DISC)
        for changed in ((90.0, 1e3, 0.5, 15e3), (LOAD, 2e3, 0.5, 15e3), (LOAD, 1e3, 0.6, 15e3),
                        (LOAD, 1e3, 0.5, 20e3)):  # fmt: skip
            assert foot.borne_at(*changed, DISC) < usual
        assert foot.borne_at(LOAD, 1e3, 0.5, 15e3, 1.5 * DISC) < usual
        assert foot.borne_at(1.0, 1e3, 0.5, 15e3, DISC) == 0.0

    def test_feet_brake_with_what_holds_them(self) -> None:
        """tan φ, and c A of the two feet that bear it, until it tips over them: 0.3/0.3 m."""
        rock, clay = Soil.of(0.0, 35.0, 0.0), Soil.of(5.0, 20.0, 0.0)
        assert braking(walker(), rock) == pytest.approx(math.tan(math.radians(35.0)))
        held = 5e3 * foot.disc_area(DISC) / LOAD + math.tan(math.radians(20.0))
        assert braking(walker(), clay) == pytest.approx(held)
        assert braking(walker(), Soil.of(0.0, 48.0, 0.0)) == pytest.approx(1.0)

    def test_factors_of_vesic(self) -> None:
        """His table: φ 0, 20 and 30 degrees."""
        rows = {0: (5.14, 1.0, 0.0), 20: (14.83, 6.40, 5.39), 30: (30.14, 18.40, 22.40)}
        for angle, wanted in rows.items():
            assert foot.bearing_factors(math.radians(angle)) == pytest.approx(wanted, abs=0.01)

    @given(shear=st.floats(1e-4, 0.2), modulus=st.floats(1e-3, 0.1))
    def test_shear_mobilises_what_holds(self, shear: float, modulus: float) -> None:
        part = foot.foot_grip(100.0, 500.0, 0.5, 0.01, shear, modulus)
        whole = foot.foot_grip(100.0, 500.0, 0.5, 0.01)
        assert part / whole == pytest.approx(1.0 - math.exp(-shear / modulus))

    def test_fewer_feet_bear_more(self) -> None:
        """Three of four bear 100 N each, which soil that bears 121 N does at its surface."""
        found = surface_figures("s", Surface(preset="lete-sand"), walker(feet={"bearing_feet": 3}))
        assert found.load == pytest.approx(100.0) and found.borne_at == found.sinkage
        two = surface_figures("s", Surface(preset="lete-sand"), walker())
        assert (two.borne_at or 0.0) > 5 * (two.sinkage or 1.0)

    def test_a_surface_has_its_own_weight(self) -> None:
        light = surface_figures("s", Surface(preset="dry-sand", unit_weight=0.001), walker())
        cohesive = 1.3 * 1040 * foot.bearing_factors(math.radians(28)).cohesion
        assert light.bearing == pytest.approx(cohesive * foot.disc_area(DISC), rel=1e-3)

    def test_climb_ends_where_feet_slide_or_it_tips(self) -> None:
        found = surface_figures("r", Surface(cohesion=0, fric_angle=20, sinkage=0), walker())
        assert found.climb == pytest.approx(math.radians(20), abs=1e-6)
        assert found.bearing is None and found.torque is None and found.slip is None
        rough = surface_figures("r", Surface(cohesion=0, fric_angle=60, sinkage=0), walker())
        assert rough.cross_slope == pytest.approx(math.atan(0.2 / 0.3))

    def test_only_wheels_have_the_paper(self) -> None:
        for vehicle in (walker(), crawler()):
            with pytest.raises(RequestError, match="stands on") as raised:
                vehicle.by_model("paper")
            assert "--model slip" in raised.value.hint
        assert walker().by_model("slip") == walker()


def footholds(terrain: Terrain, vehicle: Vehicle, resolution: float = 0.05) -> Any:
    grid = Grid(0.0, 0.0, resolution, round(6 / resolution), round(8 / resolution))
    return Surveyor(terrain, vehicle, grid).footholds()


class TestFootholds:
    """The layer, and what a stance makes of it."""

    def test_a_slope_takes_its_share_of_friction(self) -> None:
        shares = footholds(ground(slope=0.3), walker())
        wanted = 0.3 / math.tan(math.radians(38))
        assert shares[20:-20, 20:-20] == pytest.approx(wanted, rel=1e-3)

    @pytest.mark.parametrize(("lift", "verdict"), [(0.2, Verdict.GO), (0.02, Verdict.NO_GO)])
    def test_a_map_sinks_feet_in_as_deep(self, lift: float, verdict: Verdict) -> None:
        """Sand that bears 150 N some 3 cm below its surface."""
        vehicle = walker(feet={"step_height": lift})
        terrain = terrain_of(
            {"size": [8, 6], "surfTypes": {"s": {"preset": "lete-sand"}},
             "elemTypes": {"flat": {"x": [0, 1]}},
             "elemTree": {"type": "flat", "vScale": 0, "surface": "s"}}
        )  # fmt: skip
        depth = surface_figures("s", Surface(preset="lete-sand"), walker()).borne_at
        found = surveyed(terrain, vehicle)
        row, column = found.verdict.shape[1] // 2, found.verdict.shape[2] // 2
        assert found.sinkage[EAST, row, column] == pytest.approx(depth, rel=1e-3)
        assert found.verdict[EAST, row, column] == verdict
        if verdict == Verdict.NO_GO:
            assert found.reason[EAST, row, column] == Reason.SINKAGE
        # the layer has the depth as a share of a step
        shares = footholds(terrain, vehicle)
        assert shares[row, column] == pytest.approx((depth or 0.0) / lift, rel=1e-3)

    def test_an_edge_is_no_foothold(self) -> None:
        """A wall at x = 4: only the pixels whose patch it crosses."""
        shares = footholds(ground(bar(0.1, 4, 6.0)), walker(), 0.02)
        barred = np.flatnonzero(shares[150] >= 1.0)
        centres = (barred + 0.5) * 0.02
        assert len(barred) and np.abs(centres - 4.0).max() <= 0.5 * DISC + 0.02
        assert (shares[150, np.r_[20:190, 210:380]] < 0.01).all()

    def test_feet_step_over_a_gap_within_reach(self) -> None:
        """A trench of 0.1 m is bridged by feet that reach 0.1 m, and not by those that do not."""
        terrain = ground(bar(-1.0, 0.1))
        for reach, passes in ((0.1, True), (0.0, False)):
            found = surveyed(terrain, walker(feet={"reach": reach}), 0.02)
            verdict = along(found, found.verdict)[40:-40]
            assert (verdict != Verdict.NO_GO).all() == passes

    @pytest.mark.parametrize(("height", "passes"), [(0.12, True), (0.25, False)])
    def test_a_step_up_to_the_height_of_a_foot(self, height: float, passes: bool) -> None:
        terrain = ground(bar(height, 4, 6.0))
        found = surveyed(terrain, walker(feet={"reach": 0.06}), 0.02)
        verdict = along(found, found.verdict)[40:-60]
        assert (verdict != Verdict.NO_GO).all() == passes
        if not passes:
            assert Reason.STEP in along(found, found.reason)[40:-60]

    def test_one_foot_on_a_block(self) -> None:
        """With one foot 0.25 m above the plane of the three others, and a step of 0.2 m."""
        block = {
            "type": "box", "at": [4.3, 3.2], "extent": [0.14, 0.14], "vScale": 0.25,
            "surface": "rock",
        }  # fmt: skip
        low = {**block, "vScale": 0.1}
        for child, verdict in ((block, Verdict.NO_GO), (low, Verdict.GO)):
            found = surveyed(ground(child), walker(clearance=1.0), 0.02)
            row, column = round(3.0 / 0.02), round(4.0 / 0.02)
            assert found.verdict[EAST, row, column] == verdict

    def test_a_body_without_feet_on_ground_stands_nowhere(self) -> None:
        with pytest.raises(RequestError, match="stands on tracks"):
            footholds(ground(), crawler())

    def test_maps_of_walkers_have_a_band_of_footholds(self) -> None:
        """The margin is 1 less the share; others have no such band."""
        terrain = ground(slope=0.3)
        grid = Grid(2.0, 2.0, 0.05, 8, 8)
        inside = np.ones((8, 8), np.bool_)
        numbers = []
        for vehicle in (walker(), crawler()):
            measures = Surveyor(terrain, vehicle, grid).measure(grid.whole)
            numbers.append(map_bands(measures, inside).numbers)
        assert len(numbers[0]) == len(numbers[1]) + 1 == len(NUMBERS.names) + 1
        wanted = 1.0 - 0.3 / math.tan(math.radians(38))
        assert numbers[0][-1] == pytest.approx(wanted, rel=1e-3)
        assert further_bands(walks=True, sampled=True) == (FOOTHOLD, CHANCE)

    def test_the_layer_shows_the_margin(self) -> None:
        """The brighter, the more is in reserve; a wall is in the colour of no-go."""
        judge = Judge(walker(), {"file": "walker.json"})
        grid = Grid(1.0, 1.0, 0.05, 40, 120)
        colors = [
            layer_picture(terrain, grid, "foothold", judge).colors[20]
            for terrain in (ground(bar(0.3, 3.97, 6.0)), ground(slope=0.5))
        ]
        wall = round(3.0 / 0.05)
        assert (colors[0][wall - 1 : wall + 1] == COLORS[GroundClass.NO_GO]).all(axis=1).any()
        assert colors[0][10].sum() > colors[1][10].sum()
