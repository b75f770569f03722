"""Tracks: values of the books, statics of steps, and the same formulas in the kernels."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.model import Surface
from terratool.definition.presets import PRESETS
from terratool.traversability import track
from terratool.traversability.limits import (
    climb,
    crab_angle,
    slope_demand,
    tip_over,
    wheel_loads,
)
from terratool.traversability.soil import soil_under, surface_figures
from terratool.traversability.steps import step_of
from terratool.traversability.stopping import braking
from terratool.traversability.turning import turn_on_spot
from terratool.traversability.vehicle import Axle, Soil, Tracks, Vehicle, Wheel
from terratool.traversability.verdicts import Reason
from tests.budget import examples

LOAD, WIDTH, LENGTH, SLIP = 600.0, 0.15, 0.7, 0.2
BOOK = {
    "dry-sand": (3.296, 1.345, 440.5),
    "sandy-loam-15": (0.124, 0.063, 570.3),
    "lete-sand": (0.063, 0.030, 580.5),
    "snow-us": (65.14, 21.47, 290.2),
    "lunar-nominal": (3.445, 1.476, 395.8),
}
"""Sinkage, mm, compaction resistance and drawbar pull, N, of two tracks by Bekker and Wong."""


def tracked(cog: float = 0.0, height: float = 0.2, apart: float = 0.5, **others: Any) -> Vehicle:
    """A vehicle of 600 N on tracks, its centre of gravity `cog` ahead of their middle."""
    tracks = Tracks(LENGTH, WIDTH, 0.1, others.pop("front", 0.1), math.radians(40.0), math.inf)
    tracks = replace(tracks, max_torque=others.pop("torque", math.inf))
    wheel = Wheel(
        0.1, WIDTH, tracks.max_torque, others.pop("slip", SLIP), gear=1, length=LENGTH,
        area=LENGTH * WIDTH,
    )  # fmt: skip
    half = 0.5 * (LENGTH - tracks.section)
    places = half - tracks.section * np.arange(track.SECTIONS) - cog
    return Vehicle(
        wheel, tuple(Axle(x) for x in places.tolist()), LOAD / 10.0, 10.0, track_width=apart,
        cog_height=height, tracks=tracks, **others,
    )  # fmt: skip


def pressure_shares(offset: float) -> NDArray[np.float64]:
    """Shares of the sections in the load of a track that acts so far ahead of its middle, m.

    The pressure is linear: a trapezium, or beyond a sixth of the length a triangle.
    """
    fine = 20_000 * track.SECTIONS
    ahead = LENGTH * (0.5 - (np.arange(fine) + 0.5) / fine)
    from_end = 0.5 * LENGTH - math.copysign(1.0, offset) * ahead
    pressure = 1.0 + 12.0 * offset * ahead / LENGTH**2
    if 6.0 * abs(offset) > LENGTH:
        pressure = np.maximum(3.0 * (0.5 * LENGTH - abs(offset)) - from_end, 0.0)
    assert pressure @ ahead / pressure.sum() == pytest.approx(offset, abs=1e-8)
    shares: NDArray[np.float64] = pressure.reshape(track.SECTIONS, -1).sum(axis=1) / pressure.sum()
    return shares


class TestFormulas:
    """The formulas of whole vehicles."""

    @pytest.mark.parametrize("name", BOOK)
    def test_the_values_of_the_books(self, name: str) -> None:
        preset, (sinkage, resistance, pull) = PRESETS[name], BOOK[name]
        pressure = LOAD / (2 * WIDTH * LENGTH)
        assert pressure == pytest.approx(2857.14, rel=1e-5)
        z = track.plate_sinkage(preset, pressure, WIDTH)
        assert 1e3 * z == pytest.approx(sinkage, abs=0.005 if sinkage > 1 else 6e-4)
        dragged = track.compaction_resistance(LOAD, z, LENGTH, preset.exponent)
        assert dragged == pytest.approx(resistance, abs=0.005 if resistance > 1 else 6e-4)
        # Rc as it is printed: 2 b (kc/b + kφ) z^(n + 1)/(n + 1)
        n, stiffness = preset.exponent, 1e3 * (preset.cohesive / WIDTH + preset.frictional)
        printed = 2 * WIDTH * stiffness * z ** (n + 1) / (n + 1)
        assert dragged == pytest.approx(printed, rel=1e-12)
        share = track.mobilised_mean(LENGTH, preset.shear_modulus, SLIP)
        tangent = math.tan(math.radians(preset.fric_angle))
        held = track.thrust(LOAD, 2 * WIDTH * LENGTH, 1e3 * preset.cohesion, tangent, share)
        assert held - dragged == pytest.approx(pull, abs=0.06)

    @given(length=st.floats(0.1, 3.0), modulus=st.floats(1e-3, 0.1), slip=st.floats(1e-3, 1.0))
    def test_the_share_is_the_mean_of_janosi_along_the_track(
        self, length: float, modulus: float, slip: float
    ) -> None:
        at = (np.arange(20_000) + 0.5) / 20_000 * length
        mean = float(np.mean(1.0 - np.exp(-slip * at / modulus)))
        assert track.mobilised_mean(length, modulus, slip) == pytest.approx(mean, rel=1e-4)

    def test_ends_of_the_share(self) -> None:
        assert track.mobilised_mean(0.7, 0.0, 0.1) == 1.0
        assert track.mobilised_mean(0.7, 0.02, 0.0) == 0.0
        assert track.mobilised_mean(0.7, 1e-9, 1.0) == pytest.approx(1.0)


class TestKernels:
    """Section by section the kernels give what the formulas give for the whole."""

    @pytest.mark.parametrize("name", BOOK)
    def test_figures_of_a_surface(self, name: str) -> None:
        sinkage, resistance, pull = BOOK[name]
        found = surface_figures(name, Surface(preset=name), tracked())
        assert found.sinkage is not None and found.resistance is not None
        assert found.drawbar is not None
        assert 1e3 * found.sinkage == pytest.approx(sinkage, abs=0.005 if sinkage > 1 else 6e-4)
        # of one track
        assert 2 * found.resistance == pytest.approx(
            resistance, abs=0.005 if resistance > 1 else 6e-4
        )
        assert 2 * found.drawbar == pytest.approx(pull, abs=0.06)

    @pytest.mark.parametrize("name", BOOK)
    def test_the_climb_is_where_the_pull_is_the_weight(self, name: str) -> None:
        """With the centre of gravity on the ground all sections stay equally loaded."""
        vehicle, surface = tracked(height=1e-9), Surface(preset=name)
        soil = soil_under(name, surface, vehicle)
        assert soil is not None
        angle = climb(vehicle, soil, SLIP).angle
        weight = LOAD * math.cos(angle)
        share = track.mobilised_mean(LENGTH, soil.shear_modulus, SLIP)
        held = track.thrust(
            weight, 2 * WIDTH * LENGTH, soil.cohesion, math.tan(soil.friction), share
        )
        held = min(held, track.MOST_GRIP * weight * share)
        sinkage = soil.sinkage * weight / (2 * track.SECTIONS)
        dragged = track.compaction_resistance(weight, sinkage, LENGTH, soil.exponent)
        assert held - dragged == pytest.approx(LOAD * math.sin(angle), rel=1e-6)

    def test_slip_of_a_push_is_that_of_the_mean(self) -> None:
        """Down to the slip at which 0.4 of the strength is mobilised, and back."""
        vehicle = replace(tracked(height=1e-9), wheel=replace(tracked().wheel, max_slip=1.0))
        soil = Soil.of(0.0, 30.0, 0.0, 0.02)
        slope = math.atan(0.4 * math.tan(soil.friction))
        need = slope_demand(vehicle, soil, slope)
        assert need.utilisation == pytest.approx(0.4, rel=1e-6)
        assert track.mobilised_mean(LENGTH, 0.02, need.slip) == pytest.approx(0.4, rel=1e-6)

    @settings(max_examples=examples(60))
    @given(
        cog=st.floats(-0.2, 0.2), height=st.floats(0.01, 0.3), pitch=st.floats(-0.4, 0.4),
        roll=st.floats(-0.4, 0.4),
    )  # fmt: skip
    def test_loads_are_those_of_statics(
        self, cog: float, height: float, pitch: float, roll: float
    ) -> None:
        """Sections bear the weight across the ground, and its moments where nothing tips."""
        vehicle = tracked(cog, height)
        loads = wheel_loads(vehicle, pitch, roll).reshape(-1, 2)
        along, across = math.tan(pitch), math.tan(roll)
        normal = math.sqrt(1.0 + along**2 + across**2)
        total = LOAD / normal
        assert loads.sum() == pytest.approx(total)
        e = cog - height * along * normal / math.hypot(1.0, along)
        lean = -height * across / math.hypot(1.0, along) / 0.5
        if abs(e) >= 0.49 * LENGTH or abs(lean) >= 0.5:
            return
        assert loads[:, 0].sum() / total == pytest.approx(0.5 + lean)
        shares = pressure_shares(e)
        assert loads[:, 0] / loads[:, 0].sum() == pytest.approx(shares, abs=1e-8)
        assert loads[:, 1] / loads[:, 1].sum() == pytest.approx(shares, abs=1e-8)

    def test_a_centre_of_gravity_off_the_middle_sinks_one_end(self) -> None:
        """At L/12 the outer half of an end section presses up to 1.42 of the mean."""
        surface = Surface(preset="dry-sand")
        even = surface_figures("s", surface, tracked())
        rear = surface_figures("s", surface, tracked(cog=-LENGTH / 12))
        assert even.climb is not None and rear.climb is not None
        soil = soil_under("s", surface, tracked(cog=-LENGTH / 12))
        assert soil is not None and soil.factors is not None
        need = slope_demand(tracked(cog=-LENGTH / 12), soil)
        most = pressure_shares(LENGTH / 12)[0] * track.SECTIONS
        pressure = most * LOAD / (2 * WIDTH * LENGTH)
        wanted = track.plate_sinkage(PRESETS["dry-sand"], pressure, WIDTH)
        assert need.sinkage == pytest.approx(wanted, rel=1e-6)
        # more is pressed down, so that more resists
        alike = soil_under("s", surface, tracked())
        assert alike is not None
        assert need.torque > slope_demand(tracked(), alike).torque > 0.0

    def test_a_track_stands_up_to_its_ends(self) -> None:
        sideways, backwards, ahead = tip_over(tracked(cog=0.05, height=0.25))
        assert sideways == pytest.approx(math.atan(0.25 / 0.25))
        assert backwards == pytest.approx(math.atan(0.40 / 0.25))
        assert ahead == pytest.approx(math.atan(0.30 / 0.25))

    def test_a_lifted_front_still_drives(self) -> None:
        """A track whose front is lifted on a slope climbs on, up to where it tips over."""
        vehicle, soil = tracked(height=0.4), Soil.of(0.0, 45.0, 0.0)
        steepest = climb(vehicle, soil, 1.0)
        assert math.tan(steepest.angle) == pytest.approx(0.35 / 0.4, rel=1e-3)
        assert steepest.reason == Reason.TIP_OVER
        assert (wheel_loads(vehicle, steepest.angle - 0.01) == 0.0).any()

    @settings(max_examples=examples(40))
    @given(
        cog=st.floats(-0.25, 0.25), height=st.floats(0.1, 0.5), cohesion=st.floats(0.0, 40.0),
        depth=st.sampled_from([0.0, 1e-3, 0.02]), modulus=st.sampled_from([0.0, 0.01, 0.04]),
    )  # fmt: skip
    def test_it_drives_up_to_the_climb_and_no_further(
        self, cog: float, height: float, cohesion: float, depth: float, modulus: float
    ) -> None:
        """Also where much of the tracks is lifted, and holds by no cohesion any more."""
        vehicle = tracked(cog, height, slip=0.5)
        soil = Soil.of(cohesion, 20.0, depth, modulus)
        angle = climb(vehicle, soil, 0.5).angle

        def drives(slope: float) -> bool:
            need = slope_demand(vehicle, soil, slope)
            return need.drives and need.slip < 0.5

        assert drives(angle - 1e-6) and not drives(angle + 1e-6)

    def test_tracks_brake_with_what_holds_them(self) -> None:
        """tan φ on rock, also with one end lifted; the sprockets' torque; up to the tip-over."""
        rock = Soil.of(0.0, 35.0, 0.0)
        for cog in (0.0, 0.15, -0.15):
            assert braking(tracked(cog), rock) == pytest.approx(math.tan(math.radians(35.0)))
        assert braking(tracked(torque=15.0), rock) == pytest.approx(300.0 / LOAD)
        assert braking(tracked(cog=0.05, height=0.6), rock) == pytest.approx(0.3 / 0.6, rel=1e-4)
        # c A is on top of friction, while all of the tracks touches
        clay = Soil.of(1.0, 10.0, 0.0)
        held = 1e3 * 2 * LENGTH * WIDTH / LOAD + math.tan(clay.friction)
        assert braking(tracked(height=0.1), clay) == pytest.approx(held)

    @pytest.mark.parametrize("angle", [3.0, 12.0, 25.0])
    def test_tracks_slide_sideways_by_the_mean_along_them(self, angle: float) -> None:
        """On firm ground nothing pushes ahead: m g sin β is the mean at a shear of L tan ε."""
        soil, beta = Soil.of(0.0, 30.0, 0.0, 0.03), math.radians(angle)
        sliding = math.tan(crab_angle(tracked(height=1e-9), soil, beta))
        share = track.mobilised_mean(LENGTH, soil.shear_modulus, sliding)
        assert share * math.tan(soil.friction) == pytest.approx(math.tan(beta), rel=1e-6)

    def test_motors_limit_the_pull_of_a_whole_track(self) -> None:
        """Two sprockets with 15 N m at 0.1 m pull 300 N, however loads are spread."""
        for cog in (0.0, 0.1):
            steepest = climb(tracked(cog, torque=15.0), Soil.of(0.0, 40.0, 0.0), 1.0)
            assert math.sin(steepest.angle) == pytest.approx(300.0 / LOAD, rel=1e-6)
            assert steepest.reason == Reason.TORQUE

    def test_stiff_clay_holds_no_more_than_the_largest_grip(self) -> None:
        found = surface_figures("clay", Surface(preset="heavy-clay-25"), tracked(height=1e-3))
        assert found.climb is not None and found.drawbar is not None
        assert found.climb <= math.atan(track.MOST_GRIP)
        assert found.drawbar <= track.MOST_GRIP * 0.5 * LOAD

    def test_turning_of_narrow_and_wide_tracks(self) -> None:
        """A wide pair has the sum of the books, μ W L/4; a narrow one takes less by the circle."""
        soil = Soil.of(0.0, 35.0, 0.0)
        book = math.tan(soil.friction) * LOAD * LENGTH / 4.0
        assert turn_on_spot(tracked(apart=1e5, slip=1.0), soil).resistance == pytest.approx(
            book, rel=1e-3
        )
        narrow = turn_on_spot(tracked(apart=0.5, slip=1.0), soil)
        assert 0.4 * book < narrow.resistance < 0.9 * book
        assert narrow.work > narrow.resistance and narrow.possible


def steps_of(axle: float, friction: float, most: float = math.inf, **others: float) -> Any:
    figures = {"front": 0.35, "rear": 0.35, "height": 0.15, "radius": 0.1} | others
    outline = track.TrackOutline(**figures, axle=axle, approach=math.radians(45.0))
    return track.track_step(outline, friction, most)


class TestSteps:
    """Steps that tracks climb, against closed forms of single moments."""

    def test_a_grip_beyond_bounds_leaves_the_geometry(self) -> None:
        """Largest H at which the centre of gravity gets above the edge: sin θ (a − h tan θ)."""
        tilt = np.linspace(0.0, 1.2, 100_001)
        wanted = float(np.max(np.sin(tilt) * (0.35 - 0.15 * np.tan(tilt))))
        height, reason = steps_of(0.3, 50.0)
        assert height == pytest.approx(wanted, rel=2e-3) and reason == "tip-over"

    @pytest.mark.parametrize("friction", [0.4, 0.5, 0.6])
    def test_the_tilt_at_the_top_is_the_angle_of_friction(self, friction: float) -> None:
        """With all weight on the edge the belt lies at δ: H = sin δ (a − h tan δ)."""
        delta = math.atan(friction)
        height, reason = steps_of(0.3, friction)
        assert height == pytest.approx(math.sin(delta) * (0.35 - 0.15 * friction), rel=0.01)
        assert reason == "friction"

    def test_a_front_that_is_too_low_is_not_got_over(self) -> None:
        height, reason = steps_of(0.1, 3.0)
        assert height == 0.1 and reason == "height of the track's front"

    def test_first_touch_of_an_idler(self) -> None:
        """At the first touch R sin ψ = μ-cone: x_r sin ψ = sin δ (d cos(ψ − δ) + H sin(ψ − δ))."""
        friction = 0.3
        delta, (height, reason) = math.atan(friction), steps_of(0.1, friction)
        angle = math.acos(1.0 - height / 0.1)
        arm = 0.7 + 0.1 * math.sin(angle)
        over = arm * math.cos(angle - delta) + height * math.sin(angle - delta)
        assert 0.35 * math.sin(angle) == pytest.approx(math.sin(delta) * over, rel=1e-3)
        assert reason == "friction"

    def test_motors_limit(self) -> None:
        strong, weak = steps_of(0.3, 0.75), steps_of(0.3, 0.75, 0.45)
        assert weak[0] < strong[0] and weak[1] == "motor torque"
        # with all weight on the edge the belts pull W sin θ
        assert steps_of(0.3, 0.75, math.sin(math.atan(0.75)) * 1.2) == strong

    @given(friction=st.floats(0.1, 2.0), more=st.floats(1.01, 2.0))
    def test_more_grip_and_a_lower_centre_of_gravity_never_hurt(
        self, friction: float, more: float
    ) -> None:
        assert steps_of(0.25, friction * more)[0] >= steps_of(0.25, friction)[0] - 1e-5
        assert steps_of(0.25, friction, height=0.15 / more)[0] >= steps_of(0.25, friction)[0] - 1e-5

    def test_a_gap_ends_at_the_centre_of_gravity(self) -> None:
        assert track.track_gap(0.4, 0.3) == 0.3
        found = surface_figures("c", Surface(preset="concrete"), tracked(cog=0.05))
        assert found.gap == pytest.approx(0.3)
        assert found.step == pytest.approx(
            step_of(tracked(cog=0.05), math.tan(math.radians(36.9))).height
        )
