"""Turning on the spot: closed forms, limits, and an independent way to compute it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terratool.traversability.limits import wheel_layout, wheel_loads
from terratool.traversability.soil import surface_figures
from terratool.traversability.turning import Turning, turn_on_spot
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel
from terratool.traversability.verdicts import Reason
from terratool.traversability.wheel import grip, towed_resistance
from tests.budget import examples
from tests.surveys import level

MU = math.tan(math.radians(35.0))
RIGID = Soil.of(0.0, 35.0, 0.0)
SAND = Soil.of(1.0, 30.0, 0.02, 0.02)


def skidder(
    xs: tuple[float, ...] = (0.3, -0.3), track: float = 0.5, wheel: Wheel | None = None,
    **others: Any,
) -> Vehicle:  # fmt: skip
    axles = tuple(Axle(x) for x in xs)
    return Vehicle(wheel or Wheel(0.1, 0.06), axles, 20.0, 10.0, track_width=track, **others)


def scaled(turning: Turning) -> tuple[float, ...]:
    return turning.resistance, turning.work, turning.run, turning.slip


class TestClosedForms:
    """What can be worked out with a pencil."""

    @settings(max_examples=examples(50))
    @given(base=st.floats(0.1, 3.0), track=st.floats(0.1, 3.0), angle=st.floats(5.0, 60.0))
    def test_two_axles_on_rigid_ground(self, base: float, track: float, angle: float) -> None:
        """Each wheel slides where it would be pushed: F/H = L/B, and F² + H² = (μ W/4)²."""
        found = turn_on_spot(skidder((0.5 * base, -0.5 * base), track), Soil.of(0, angle, 0))
        mu, diagonal = math.tan(math.radians(angle)), math.hypot(base, track)
        moment = mu * 200.0 * 0.5 * base * track / diagonal
        slip = (base / diagonal) ** 2
        wanted = moment, moment / (1 - slip), 0.5 * track / (1 - slip), slip
        assert scaled(found) == pytest.approx(wanted, rel=1e-6)
        assert found.skidding == pytest.approx(moment, rel=1e-6) and found.possible
        assert found.torque == pytest.approx(0.1 * mu * 50.0 * base / diagonal, rel=1e-6)

    @pytest.mark.parametrize("axles", [2, 3, 8, 64])
    def test_a_wide_track_leaves_the_sums_of_wong(self, axles: int) -> None:
        """μ Σ W |x|: μ W L/2 for two axles, and for many what a track has, μ W L/4."""
        xs = tuple(np.linspace(0.5, -0.5, axles).tolist())
        found = turn_on_spot(skidder(xs, 1e5), RIGID)
        assert found.resistance == pytest.approx(MU * 200.0 * np.mean(np.abs(xs)), rel=1e-6)
        if axles == 64:
            assert found.resistance == pytest.approx(MU * 200.0 * 1.0 / 4, rel=0.02)

    def test_one_axle_only_rolls(self) -> None:
        """On rigid ground for nothing; in soil for what its wheels resist."""
        assert scaled(turn_on_spot(skidder((0.0,)), RIGID)) == (0.0, 0.0, 0.25, 0.0)
        found = turn_on_spot(skidder((0.0,)), SAND)
        rolling = 2 * float(towed_resistance(100.0, SAND, Wheel(0.1, 0.06))) * 0.25
        assert found.resistance == pytest.approx(rolling) and found.skidding == 0.0
        assert found.work == pytest.approx(rolling / (1 - found.slip)) and 0.0 < found.slip < 0.2

    def test_no_wheel_runs_in_the_track_of_another(self) -> None:
        """Straight ahead the rear wheels do, and roll more easily; in a turn each rolls afresh."""
        found = turn_on_spot(skidder(), SAND)
        rolling = 4 * float(towed_resistance(50.0, SAND, Wheel(0.1, 0.06))) * 0.25
        assert found.resistance - found.skidding == pytest.approx(rolling)

    def test_a_wheel_by_itself_turns_for_nothing(self) -> None:
        assert turn_on_spot(Vehicle.single(Wheel(0.1, 0.06), 50.0), SAND) == Turning()

    def test_wheels_that_are_turned_into_their_ways_only_roll(self) -> None:
        """Oblong, so that track and wheelbase are not taken for each other."""
        rover = skidder((0.7, 0.1, -0.7), 1.0, steering="wheels")
        assert scaled(turn_on_spot(rover, RIGID)) == (
            0.0,
            0.0,
            pytest.approx(math.hypot(0.7, 0.5)),
            0.0,
        )
        loads = wheel_loads(rover)
        away = np.hypot(wheel_layout(rover).x, 0.5)
        wanted = float(np.dot(towed_resistance(loads, SAND, rover.wheel), away))
        found = turn_on_spot(rover, SAND)
        assert found.resistance == found.work == pytest.approx(wanted)
        assert found.skidding == 0.0
        assert turn_on_spot(replace(rover, steering="skid"), SAND).resistance > 2 * wanted


@st.composite
def skidders(draw: st.DrawFn) -> Vehicle:
    """Of two to four axles anywhere, so that loads differ."""
    xs = sorted(draw(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=4)), reverse=True)
    xs = [xs[0] + 0.5, *xs[1:]]
    middle, track = sum(xs) / len(xs), draw(st.floats(0.5, 2.0))
    off = draw(st.floats(-0.1, 0.1))
    driven = [True, *(draw(st.booleans()) for _ in xs[1:])]
    axles = (Axle(x - middle + off, 2, drives) for x, drives in zip(xs, driven, strict=True))
    return replace(skidder(track=track), axles=tuple(axles))


def least_loss(vehicle: Vehicle) -> float:
    """Radians for each metre of tread, as the motion in which the least is lost by friction.

    Coulomb's friction is the slope of what it loses, so that the motion in balance is the one that
    loses least, of all turns about places in the middle. The loss is convex in how far it turns
    and how far its middle goes aside: the best of these is looked for in thirds, for each of many
    turns, and then again between the neighbours of the best turn.
    """
    layout, loads = wheel_layout(vehicle), wheel_loads(vehicle)

    def lost(turn: Any, aside: Any) -> Any:
        return sum(
            load * np.hypot(drives * (np.sign(y) - turn * y), turn * x - aside)
            for x, y, drives, load in zip(layout.x, layout.y, layout.driven, loads, strict=True)
        )

    least, most = 0.0, 2.0 / vehicle.track_width  # treads do not slip at all
    for _ in range(8):
        turn = np.linspace(least, most, 41)
        low, high = np.full(41, -10.0), np.full(41, 10.0)
        for _ in range(90):
            one, other = low + (high - low) / 3, high - (high - low) / 3
            better = lost(turn, one) < lost(turn, other)
            low, high = np.where(better, low, one), np.where(better, other, high)
        best = int(np.argmin(lost(turn, 0.5 * (low + high))))
        least, most = float(turn[max(best - 1, 0)]), float(turn[min(best + 1, 40)])
    return 0.5 * (least + most)


@settings(max_examples=examples(25))
@given(vehicle=skidders())
def test_friction_loses_the_least_that_it_can(vehicle: Vehicle) -> None:
    """For any axles and loads: how far it turns for a metre of its treads, and what that loses."""
    assume(wheel_loads(vehicle).min() > 0.0)
    found = turn_on_spot(vehicle, RIGID)
    if not found.possible:
        assert least_loss(vehicle) == pytest.approx(0.0, abs=1e-6)
        return
    assert 1.0 / found.run == pytest.approx(least_loss(vehicle), rel=1e-4)
    assert found.resistance == pytest.approx(found.work * (1 - found.slip), rel=1e-6)


class TestMonotone:
    """More of what resists is never less of it."""

    @settings(max_examples=examples(60))
    @given(
        low=st.floats(1.0, 50.0), more=st.floats(0.0, 20.0), load=st.floats(1.0, 3.0),
        longer=st.floats(1.0, 3.0), modulus=st.sampled_from([0.0, 0.005, 0.025]),
    )  # fmt: skip
    def test_in_friction_weight_and_length(
        self, low: float, more: float, load: float, longer: float, modulus: float
    ) -> None:
        vehicle, soil = skidder(), Soil.of(0, low, 0, modulus)
        base = turn_on_spot(vehicle, soil)
        for other, ground in (
            (vehicle, Soil.of(0, low + more, 0, modulus)),
            (replace(vehicle, mass=load * vehicle.mass), soil),
            (skidder((0.3 * longer, -0.3 * longer)), soil),
        ):
            found = turn_on_spot(other, ground)
            assert found.resistance >= base.resistance * (1 - 1e-9)
            assert found.work >= base.work * (1 - 1e-9)

    def test_what_gives_holds_less(self) -> None:
        """Down from all strength with K, and continuous into K = 0."""
        found = [
            turn_on_spot(skidder(), Soil.of(0, 35, 0, modulus)).resistance
            for modulus in (0.0, 1e-9, 0.02, 0.1, 0.3)
        ]
        assert found[1] == pytest.approx(found[0], rel=1e-6)
        assert found[1:] == sorted(found[1:], reverse=True) and found[-1] < 0.7 * found[0]

    def test_cohesion_resists_with_the_grip_of_its_wheels(self) -> None:
        """S = C + W tan φ takes the place of μ W."""
        clay = Soil.of(20, 10, 0)
        ratio = float(grip(50.0, clay, Wheel(0.1, 0.06))) / (MU * 50.0)
        found = turn_on_spot(skidder(), clay).resistance
        assert found == pytest.approx(ratio * turn_on_spot(skidder(), RIGID).resistance)


class TestCannot:
    """What forbids a turn, and exactly from where on."""

    @pytest.mark.parametrize(("share", "reason"), [(0.999, Reason.TORQUE), (1.001, Reason.NONE)])
    def test_motors(self, share: float, reason: Reason) -> None:
        needed = 0.1 * MU * 50.0 * 0.6 / math.hypot(0.5, 0.6)
        found = turn_on_spot(skidder(wheel=Wheel(0.1, 0.06, share * needed)), RIGID)
        assert found.reason == reason and found.possible == (reason == Reason.NONE)
        assert found.torque <= share * needed * (1 + 1e-9)

    def test_a_motor_at_its_limit_is_helped_by_others(self) -> None:
        """Weak ones in front alone: those behind push more; weak ones everywhere do not."""
        needed = turn_on_spot(skidder(), RIGID).torque
        weak = Wheel(0.1, 0.06, 0.8 * needed)
        one = replace(skidder(), axles=(Axle(0.3, wheel=weak), Axle(-0.3)))
        found = turn_on_spot(one, RIGID)
        assert found.possible and found.torque > needed
        assert not turn_on_spot(skidder(wheel=weak), RIGID).possible

    @pytest.mark.parametrize(("more", "reason"), [(-1e-3, Reason.SLIP), (1e-3, Reason.NONE)])
    def test_slip(self, more: float, reason: Reason) -> None:
        slip = 0.36 / (0.36 + 0.25)
        wheel = Wheel(0.1, 0.06, max_slip=slip + more)
        assert turn_on_spot(skidder(wheel=wheel), RIGID).reason == reason

    def test_towed_wheels_are_pushed_sideways(self) -> None:
        """Before and behind a driven axle they skid whatever its treads do."""
        axles = (Axle(0.3, driven=False), Axle(0.0), Axle(-0.3, driven=False))
        narrow, wide = (replace(skidder(track=track), axles=axles) for track in (1.19, 1.21))
        assert turn_on_spot(narrow, RIGID).reason == Reason.TRACTION
        found = turn_on_spot(wide, RIGID)
        assert found.possible and found.skidding == pytest.approx(MU * 200 * 2 / 3 * 0.3)
        assert turn_on_spot(replace(narrow, steering="wheels"), RIGID).possible

    def test_sinking_in_to_the_axle(self) -> None:
        assert turn_on_spot(skidder(), Soil.of(1, 30, 3)).reason == Reason.SINKAGE

    def test_figures_say_so(self) -> None:
        """In a sentence that names the surface, beside the moment that resists."""
        surface = level(2, 2).surface_types["floor"]
        weak = skidder(wheel=Wheel(0.1, 0.06, 1.0))
        found = surface_figures("floor", surface, weak)
        assert found.turning_binding == Reason.TORQUE and found.turning_work is None
        assert found.warnings[-1].startswith('It cannot turn on the spot on "floor": motor torque.')
        # one that steers as cars do never turns: that is no matter of the ground
        car = replace(weak, turning_radius=2.0)
        assert not any("turn" in said for said in surface_figures("floor", surface, car).warnings)
        able = surface_figures("floor", surface, skidder())
        turning = turn_on_spot(skidder(), RIGID)
        assert able.turning == pytest.approx(turning.resistance)
        assert able.turning_work == pytest.approx(turning.work * math.pi / 2)
        assert able.turning_binding == Reason.NONE and not able.warnings
