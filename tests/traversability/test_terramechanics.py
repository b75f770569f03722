"""A wheel on soil: published figures, closed forms against integrals, and what must hold always."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from terratool.errors import RequestError
from terratool.kernels import traversability as kernels
from terratool.traversability import limits, wheel
from terratool.traversability.limits import Measure, judge, share_of
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from terratool.traversability.wheel import SoilArrays, demand, under_wheels
from tests.budget import examples
from tests.surveys import judged

WHEEL = Wheel(0.2, 0.1, slips=False)
SLIPPING = Wheel(0.2, 0.1)
E1 = Soil.of(1, 30, 0.1)
E2 = Soil.of(1, 30, 0.1, 0.025)
E3 = Soil.of(0.5, 25, 0.2)
ROVER = Vehicle(
    WHEEL, (Axle(0.5), Axle(-0.5)), 400 / 9.80665, track_width=0.8, cog_height=0.4, clearance=0.15
)


def printed(value: Any, text: str) -> bool:
    """Whether a value is a printed number, to its last digit."""
    number = float(text)
    digits = len(text.replace(".", "").lstrip("0"))
    return float(f"{float(value):.{digits}g}") == number


def one(torque: float = math.inf, slip: float = 1.0, load: float = 100.0) -> Vehicle:
    return Vehicle.single(Wheel(0.2, 0.1, torque, slip, slips=False), load)


# The figures of the model, worked out by hand and by integration elsewhere


@pytest.mark.parametrize(
    ("load", "soil", "slip", "expected"),
    [
        (100, E1, 1.0, "0.01 0.3175604 1 0.003168938 29107.23 17805.07 11.30837 55.71340 14.58427 "
                       "41.12913"),
        (200, E3, 1.0, "0.04 0.6435011 1 0.006379688 28455.59 13769.06 17.72081 83.33451 57.40728 "
                       "25.92723"),
    ],
    ids=["E1", "E3"],
)  # fmt: skip
def test_reference_values(load: float, soil: Soil, slip: float, expected: str) -> None:
    """Contact, stresses and forces to every printed digit."""
    here = wheel.contact(load, soil, WHEEL)
    best = wheel.traction(load, soil, WHEEL, slip)
    values = (
        here.sinkage, here.entry_angle, best.mobilised, here.effective_area, best.normal_stress,
        best.shear_stress, best.torque, best.thrust, best.resistance, best.drawbar,
    )  # fmt: skip
    for value, text in zip(values, expected.split(), strict=True):
        assert printed(value, text), (value, text)
    assert not best.motor


def test_reference_values_of_contact() -> None:
    """Area and pressure."""
    here = wheel.contact(100, E2, WHEEL)
    assert printed(here.area, "0.006244998")
    assert printed(here.pressure, "16012.82")
    assert here.length * 0.1 == here.area


def test_reference_values_of_a_weak_motor() -> None:
    """5 N m: the motor limits, and is said to."""
    best = wheel.traction(100, E1, replace(WHEEL, max_torque=5))
    assert printed(best.shear_stress, "7872.517")
    assert printed(best.normal_stress, "30697.71")
    assert printed(best.drawbar, "9.252521")
    assert best.torque == 5
    assert best.motor


def test_reference_values_of_a_demand() -> None:
    """On the level, and at 15 degrees."""
    level = demand(100, E2, WHEEL)
    assert printed(level.torque, "3.168930")
    assert printed(level.utilisation, "0.2627449")
    assert level.slip == 0
    slope = math.radians(15)
    up = demand(100 * math.cos(slope), E2, WHEEL, 100 * math.sin(slope))
    assert printed(up.torque, "8.132018")
    assert printed(up.utilisation, "0.7261252")


@pytest.mark.parametrize(
    ("vehicle", "soil", "expected", "reason"),
    [
        (one(), E1, "22.77716", Reason.TRACTION),
        (one(torque=5), E1, "5.369311", Reason.TORQUE),
        (one(), Soil.of(0, 30, 0.1), "21.21888", Reason.TRACTION),
        (one(load=200), E3, "7.470916", Reason.TRACTION),
        (ROVER, E1, "22.39744", Reason.TRACTION),
        (
            replace(ROVER, wheel=replace(WHEEL, max_torque=12)), E1, "20.25159", Reason.TORQUE,
        ),
    ],
)  # fmt: skip
def test_reference_values_of_slopes(
    vehicle: Vehicle, soil: Soil, expected: str, reason: Reason
) -> None:
    """The largest slope, and what limits it."""
    found = limits.climb(vehicle, soil)
    assert found.possible
    assert printed(math.degrees(found.angle), expected)
    assert found.reason == reason


def test_a_wheel_that_is_immobile_on_the_level_climbs_nothing() -> None:
    """Whatever a slope would take off its load."""
    found = limits.climb(one(load=200), Soil.of(2, 10, 0.2))
    assert not found.possible
    assert found.angle == 0
    assert found.reason == Reason.TRACTION


def test_a_wheel_that_lifts_ends_the_climb() -> None:
    """Friction would do; the front wheels of a top-heavy vehicle lift at atan(l_r/h_cg)."""
    tall = Vehicle(WHEEL, (Axle(0.6), Axle(-0.4)), 40.0, track_width=0.8, cog_height=1.0)
    found = limits.climb(tall, Soil.of(0, 60, 0))
    assert found.angle == pytest.approx(math.atan(0.4))
    assert found.reason == Reason.TIP_OVER


def test_the_motor_is_named_where_it_gives_less_than_slip_would_allow() -> None:
    """Just less than what it takes at a slip of 0.3 binds, just more does not."""
    takes = float(wheel.traction(100 * math.cos(0.1), E2, SLIPPING, 0.3).torque)

    def limit(torque: float) -> Reason:
        tyre = replace(SLIPPING, max_torque=torque, max_slip=0.3)
        return limits.climb(Vehicle.single(tyre, 100), E2).reason

    assert limit(0.85 * takes) == Reason.TORQUE
    assert limit(1.15 * takes) == Reason.SLIP


def test_reference_values_of_side_slip_and_tip_over() -> None:
    """With a centre of gravity at the ground loads are equal, as the closed form has it."""
    flat = Vehicle(WHEEL, ROVER.axles, ROVER.mass, track_width=0.8)
    assert printed(math.degrees(limits.side_slip(flat, E1).angle), "32.84723")
    assert printed(math.degrees(limits.tip_over(ROVER)[0]), "45")
    assert limits.side_slip(ROVER, E1).angle < limits.side_slip(flat, E1).angle


def test_reference_values_from_stresses() -> None:
    """Forces from stresses, and the way back."""
    small = Wheel(0.15, 0.08, slips=False)
    load, torque, drawbar = wheel.forces_from(20000, 12000, 1.0, small)
    assert printed(load, "136.939619")
    assert printed(torque, "10.8")
    assert printed(drawbar, "5.538047")
    back = wheel.stresses_from(load, torque, 1.0, small)
    assert back == pytest.approx((20000, 12000), rel=1e-12)


# Against the integrals that the closed forms stand for

RADII = st.floats(0.05, 1.0)
SOILS = st.builds(
    Soil.of, st.floats(0, 20), st.floats(0, 50), st.floats(0.002, 0.5),
    st.one_of(st.just(0.0), st.floats(0.005, 0.05)),
)  # fmt: skip
LOADS = st.floats(1, 2000)


def by_integrals(
    radius: float, width: float, entry: float, leave: float, normal: float, shear: float
) -> tuple[float, float, float]:
    """W, T and DP of two triangles of stress from `leave` to `entry`, by Gauss's rule."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    middle, half = 0.5 * (entry + leave), 0.5 * (entry - leave)
    low, high = leave + 0.5 * half * (nodes + 1), middle + 0.5 * half * (nodes + 1)
    angle = np.concatenate([low, high])
    rise = np.concatenate([(low - leave) / half, (entry - high) / half])
    area = np.tile(weights, 2) * 0.5 * half * radius * width
    return (
        float(np.sum(area * rise * (normal * np.cos(angle) + shear * np.sin(angle)))),
        float(np.sum(area * rise * shear) * radius),
        float(np.sum(area * rise * (shear * np.cos(angle) - normal * np.sin(angle)))),
    )


@given(RADII, st.floats(0.1, 1.5), st.floats(0, 1e5), st.floats(0, 1e5))
@settings(max_examples=examples(50))
def test_forces_are_the_integrals_of_the_stresses(
    radius: float, entry: float, normal: float, shear: float
) -> None:
    """From the angle at which the wheel meets the soil to its lowest point."""
    width = 0.3
    expected = by_integrals(radius, width, entry, 0.0, normal, shear)
    found = wheel.forces_from(normal, shear, entry, Wheel(radius, width))
    scale = radius * width * (normal + shear)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * scale)


@given(RADII, SOILS, LOADS, st.floats(0, 1), st.booleans())
@settings(max_examples=examples(100))
def test_a_driven_wheel_is_in_equilibrium(
    radius: float, soil: Soil, load: float, slip: float, slips: bool
) -> None:
    """The stresses bear the load, and the pull that they give needs the torque that they take.

    In the model `slip` their sums act at 2^(1/3)/2 of the angle of the contact at rest.
    """
    tyre = Wheel(radius, 0.3, slips=slips)
    here, at_rest = (wheel.contact(load, soil, tyre, s) for s in (slip, 0.0))
    assume(1e-9 < at_rest.sinkage < radius)
    best = wheel.traction(load, soil, tyre, slip)
    assert best.sinkage == here.sinkage
    across, along = float(best.normal_stress), float(best.shear_stress)
    if slips:
        angle, area = 2 ** (1 / 3) / 2 * at_rest.entry_angle, float(here.effective_area)
        across, along = area * across, area * along
        forces = (
            across * math.cos(angle) + along * math.sin(angle), along * radius,
            along * math.cos(angle) - across * math.sin(angle),
        )  # fmt: skip
    else:
        forces = by_integrals(radius, 0.3, float(here.entry_angle), 0.0, across, along)
    assert forces == pytest.approx((load, best.torque, best.drawbar), rel=1e-7, abs=1e-7 * load)
    assert best.normal_stress >= 0


@given(SOILS, LOADS, st.floats(0.02, 1))
@settings(max_examples=examples(100))
def test_what_a_slip_gives_needs_that_slip(soil: Soil, load: float, slip: float) -> None:
    """There and back: the same slip, torque and sinkage."""
    best = wheel.traction(load, soil, SLIPPING, slip)
    assume(soil.shear_modulus > 0 and best.sinkage < 0.2 and best.mobilised * soil.friction > 1e-3)
    need = demand(load, soil, SLIPPING, float(best.drawbar))
    assert need.utilisation == pytest.approx(best.mobilised, rel=1e-5)
    assert need.slip == pytest.approx(slip, rel=1e-3)
    assert best.torque == pytest.approx(need.torque, rel=1e-6, abs=1e-6 * load)
    assert best.sinkage == pytest.approx(need.sinkage, rel=1e-3)


@given(st.floats(0.0, 2), st.floats(0.005, 0.05), st.floats(0, 1))
@settings(max_examples=examples(100))
def test_slip_mobilises_by_kondners_hyperbola(length: float, modulus: float, slip: float) -> None:
    """On ground that does not yield: half the strength at x = 2, and Janosi's slope at first.

    Janosi and Hanamoto's mean of 1 − exp(−j/K) over a patch under which j grows from 0 to x K is
    x/2 for small x. The length of 0.59 m is that of a wheel that K of the books belongs to.
    """
    plate = Wheel(5.0, 0.1, contact_length=length)
    soil = Soil.of(0, 30, 0, modulus)
    x = slip * max(0.59, length, 0.4 * 5.0) / modulus
    found = wheel.traction(100, soil, plate, slip)
    assert found.mobilised == pytest.approx(x / (x + 2))
    assert found.drawbar == pytest.approx(x / (x + 2) * 100 * math.tan(math.radians(30)))
    small = 1e-4 * modulus / 2.0
    j = 1e-4 * (np.arange(1000) + 0.5) / 1000
    wanted = float(np.mean(-np.expm1(-j)))
    assert wheel.traction(100, soil, Wheel(5.0, 0.1), small).mobilised == pytest.approx(
        wanted, rel=1e-3
    )


@given(SOILS, LOADS, st.floats(0, 1), st.floats(0, 0.05))
@settings(max_examples=examples(50))
def test_slip_digs_a_wheel_in_by_an_angle(
    soil: Soil, load: float, slip: float, lugs: float
) -> None:
    """θ1 grows by f s √(0.305² + acos(r/(r + h))²); in the model `paper` z = k W stays."""
    tyre = Wheel(0.2, 0.1, grouser_height=lugs)
    at_rest = math.acos(1 - min(soil.sinkage * load / 0.2, 1))
    softness = 1 - math.exp(-at_rest / 0.1)
    entry = at_rest + softness * slip * math.hypot(0.305, math.acos(0.2 / (0.2 + lugs)))
    depth = max(0.2 * (1 - math.cos(min(entry, math.pi / 2))), soil.sinkage * load)
    assert wheel.contact(load, soil, tyre, slip).sinkage == pytest.approx(depth)
    assert wheel.softness(load, soil, tyre) == pytest.approx(softness)
    assert wheel.contact(load, soil, WHEEL, slip).sinkage == pytest.approx(soil.sinkage * load)


def test_cohesion_bears_no_more_than_the_soil_does() -> None:
    """In clay without friction a light wheel pulls W/5.14, whatever its size; rigid or not."""
    clay = Soil.of(60, 0, 0.001)
    for width in (0.1, 1.0):
        found = wheel.traction(10, clay, Wheel(0.2, width))
        assert found.thrust == pytest.approx(10 / (2 + math.pi), rel=0.05)
    heavy = wheel.traction(1e5, replace(clay, sinkage=0.0), Wheel(0.2, 0.1))
    assert heavy.drawbar == pytest.approx(60e3 * 0.1 * 0.08, rel=0.05)  # c b l


def test_a_bare_rim_slides_on_soft_soil_and_a_tyre_does_not() -> None:
    """tan φ up to 0.46 for a rim, 0.75 for lugs of 5 mm and treads; all of it on rigid ground."""
    strong = Soil(0.0, math.atan(0.9), 1e-3)
    for tyre, friction in (
        (Wheel(0.2, 0.1), 0.46), (Wheel(0.2, 0.1, grouser_height=0.0025), 0.605),
        (Wheel(0.2, 0.1, grouser_height=0.02), 0.75), (Wheel(0.2, 0.1, tyre=True), 0.75),
    ):  # fmt: skip
        softness = float(wheel.softness(50, strong, tyre))
        expected = 0.9 - softness * (0.9 - friction)
        assert wheel.grip(50, strong, tyre) == pytest.approx(50 * expected)
        hard = replace(strong, sinkage=0.0)
        assert wheel.grip(50, hard, tyre) == pytest.approx(45)
    weak = Soil(0.0, math.atan(0.4), 1e-3)
    assert wheel.grip(50, weak, Wheel(0.2, 0.1)) == pytest.approx(20)


@given(SOILS, LOADS, st.floats(0, 0.99), st.floats(0, 1.5))
@settings(max_examples=examples(100))
def test_a_force_sideways_shares_one_circle_with_the_pull(
    soil: Soil, load: float, slip: float, crab: float
) -> None:
    """It acts against the sliding: straight across where the wheel does not slip."""
    tyre = Wheel(0.2, 0.1)
    assume(soil.shear_modulus > 0)
    held = float(wheel.grip(load, replace(soil, shear_modulus=0.0), tyre))
    across = (1 - slip) * math.tan(crab)
    x = 0.59 / soil.shear_modulus * math.hypot(slip, across)
    found = float(wheel.side_force(load, soil, tyre, slip, crab))
    expected = x / (x + 2) * held * across / math.hypot(slip, across) if across else 0.0
    assert found == pytest.approx(expected, abs=1e-9 * load)


# What must hold for any soil and load


@given(SOILS, LOADS, st.floats(0, 1), st.floats(0.01, 5), st.floats(0.1, 10))
@settings(max_examples=examples(100))
def test_stronger_soil_never_pulls_less(
    soil: Soil, load: float, slip: float, cohesion: float, friction: float
) -> None:
    """Thrust and drawbar pull grow with cohesion and with friction, resistance does not."""
    more = Soil(soil.cohesion + 1e3 * cohesion, soil.friction, soil.sinkage, soil.shear_modulus)
    rough = Soil(
        soil.cohesion, soil.friction + math.radians(friction), soil.sinkage, soil.shear_modulus
    )
    weak = wheel.traction(load, soil, WHEEL, slip)
    for strong in (wheel.traction(load, s, WHEEL, slip) for s in (more, rough)):
        slack = 1e-9 * load
        assert strong.drawbar >= weak.drawbar - slack
        assert strong.torque >= weak.torque - slack
        assert strong.resistance <= weak.resistance + slack


@given(SOILS, LOADS, st.floats(1.01, 3), st.floats(0, 30))
@settings(max_examples=examples(100))
def test_more_load_sinks_deeper_and_resists_more(
    soil: Soil, load: float, times: float, pull: float
) -> None:
    """So it is for the same soil; and more pull needs more torque and more of its strength."""
    light, heavy = (wheel.contact(w, soil, WHEEL) for w in (load, times * load))
    assert heavy.sinkage > light.sinkage
    towed = [wheel.towed_resistance(w, soil, WHEEL) for w in (load, times * load)]
    assert towed[1] >= towed[0] * times * (1 - 1e-12)  # the same share where it sinks to its axle
    less, more = demand(load, soil, WHEEL, pull), demand(load, soil, WHEEL, pull + 1)
    assert more.torque > less.torque or more.utilisation >= 1
    assert more.utilisation >= less.utilisation * (1 - 1e-12)
    assert more.slip >= less.slip * (1 - 1e-12)


@given(SOILS, LOADS, st.floats(0, 1), st.booleans())
@settings(max_examples=examples(100))
def test_soft_ground_becomes_rigid_ground(
    soil: Soil, load: float, slip: float, slips: bool
) -> None:
    """As k falls to 0 forces tend to those of rigid ground: friction, and cohesion as it bears."""
    tyre = SLIPPING if slips else WHEEL
    hard = replace(soil, sinkage=0.0)
    expected = wheel.traction(load, hard, tyre, slip)
    share, held = float(expected.mobilised), 0.0
    if slips:
        tan = math.tan(soil.friction)
        passive = math.tan(math.pi / 4 + soil.friction / 2) ** 2
        bears = (math.exp(math.pi * tan) * passive - 1) / tan if tan > 1e-6 else 2 + math.pi
        sheared = soil.cohesion * 0.1 * 0.08
        held = load * sheared / (load + bears * sheared)
    assert expected.thrust == pytest.approx(share * (load * math.tan(soil.friction) + held))
    assert expected.torque == pytest.approx(0.2 * expected.thrust)
    assert expected.resistance == 0
    before = None
    for sinkage in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
        found = wheel.traction(load, replace(soil, sinkage=sinkage / load), tyre, slip)
        gap = abs(float(found.drawbar - expected.drawbar))
        assert before is None or gap <= before * (1 + 1e-9) + 1e-9 * load
        before = gap
    assert found.drawbar == pytest.approx(expected.drawbar, rel=1e-3, abs=1e-3 * load)


NUMBERS = st.one_of(st.just(0.0), st.floats(1e-30, 1e30), st.floats(0.01, 100))
SIZES = st.one_of(st.floats(1e-30, 1e30), st.floats(0.01, 2))
ANY_SOIL = st.builds(Soil, NUMBERS, st.one_of(st.just(0.0), st.floats(0, 1.5707)), NUMBERS, NUMBERS)


@given(
    SIZES, SIZES, NUMBERS, ANY_SOIL, st.floats(0, 1), st.floats(-1e30, 1e30), NUMBERS, st.booleans()
)
@settings(max_examples=examples(300))
def test_nothing_that_is_accepted_gives_nan(
    radius: float, width: float, load: float, soil: Soil, slip: float, pull: float, torque: float,
    slips: bool,
) -> None:  # fmt: skip
    """However large or small; 0 for each of them, too."""
    tyre = Wheel(radius, width, torque, slips=slips)
    wheel.check(load, soil, tyre)
    with np.errstate(all="ignore"):
        found = [
            wheel.contact(load, soil, tyre, slip), wheel.traction(load, soil, tyre, slip),
            demand(load, soil, tyre, pull), demand(load, soil, tyre, load * 0.3),
        ]  # fmt: skip
        singles = [
            wheel.towed_resistance(load, soil, tyre), wheel.grip(load, soil, tyre, slip),
            share_of(abs(found[2].torque), torque),
        ]  # fmt: skip
    for value in found:
        for name in value.__slots__:
            assert not math.isnan(getattr(value, name)), (type(value).__name__, name)
    assert not any(map(math.isnan, singles))


@given(st.floats(1, 1e6), ANY_SOIL, NUMBERS, st.floats(0.01, 1))
@settings(max_examples=examples(100), deadline=None)
def test_no_vehicle_gives_nan(mass: float, soil: Soil, torque: float, slip: float) -> None:
    """Slopes and shared demands are numbers, too, for any soil."""
    vehicle = Vehicle(
        Wheel(0.2, 0.1, torque, slip), (Axle(0.5), Axle(-0.4, driven=False)), mass, track_width=0.8,
        cog_height=0.4,
    )  # fmt: skip
    for found in (limits.climb(vehicle, soil), limits.side_slip(vehicle, soil)):
        assert 0 <= found.angle <= math.pi / 2
    for pull in (0.0, 0.3 * vehicle.weight, -0.3 * vehicle.weight):
        assert not any(map(math.isnan, driven(vehicle, soil, pull)))


# A load that bears nothing, and no strength at all


def test_without_load_there_are_no_forces() -> None:
    """W = 0: nothing is borne, nothing is pushed."""
    here, best = wheel.contact(0, E1, WHEEL), wheel.traction(0, E1, WHEEL)
    assert (here.sinkage, here.pressure) == (0, 0)
    assert (best.thrust, best.drawbar, best.torque) == (0, 0, 0)
    assert demand(0, E1, WHEEL).utilisation == 0
    assert demand(0, E1, WHEEL, 1).utilisation == math.inf


def test_rigid_ground_does_not_slip() -> None:
    """In the model `paper`, whatever K is; friction alone acts, and all of it."""
    rock = Soil.of(5, 35, 0, 0.01)
    found = demand(100, rock, WHEEL, np.array([0.0, 60.0]))
    assert found.slip.tolist() == [0, 0]  # type: ignore[union-attr]
    assert found.utilisation == pytest.approx([0, 0.6 / math.tan(math.radians(35))])
    assert wheel.traction(100, rock, WHEEL, 0.1).thrust == pytest.approx(70.02075)
    # in the model `slip` K counts there, too
    assert demand(100, rock, SLIPPING, 60.0).slip > 0


def test_without_strength_there_is_no_traction() -> None:
    """c = φ = 0: it only resists, as a towed wheel does."""
    water = Soil.of(0, 0, 0.1)
    best = wheel.traction(100, water, WHEEL)
    assert (best.thrust, best.torque) == (0, 0)
    assert best.drawbar == pytest.approx(-wheel.towed_resistance(100, water, WHEEL))
    assert demand(100, water, WHEEL).utilisation == math.inf
    assert not limits.climb(one(), water).possible


def test_soil_that_cohesion_alone_would_hold_up_does_not_pull_on_the_wheel() -> None:
    """b c k of 6.9: normal stress is 0, not below, and the shear stress bears the load."""
    found = wheel.traction(100, Soil.of(69, 20, 1.0), WHEEL)
    half = math.asin(math.sqrt(0.1 / 0.4))
    assert found.normal_stress == found.resistance == 0
    assert found.drawbar == pytest.approx(100 / math.tan(half))
    assert demand(100, Soil.of(69, 20, 1.0), WHEEL, 101 / math.tan(half)).utilisation == math.inf


def test_all_broadcasts() -> None:
    """Arrays of loads, soils and pulls, of different shapes; each number as if it were alone."""
    weights = np.array([0.0, 50.0, 100.0])
    soil = Soil.of(np.array([[0.0], [1.0]]), 30, np.array([[0.0], [0.1]]), 0.02)
    found = demand(weights, soil, WHEEL, 5.0)
    assert found.torque.shape == (2, 3)
    for row, column in np.ndindex(2, 3):
        alone = Soil(
            *(
                float(np.ravel(v)[row if np.ndim(v) else 0])
                for v in (soil.cohesion, soil.friction, soil.sinkage, soil.shear_modulus)
            )
        )
        expected = demand(weights[column], alone, WHEEL, 5.0)
        for name in expected.__slots__:
            assert getattr(found, name)[row, column] == getattr(expected, name)


# Soils from measurements


def test_a_soil_is_found_again_from_its_stresses() -> None:
    """Least squares over loads give c and φ back."""
    weights = np.array([50.0, 100.0, 220.0])
    best = wheel.traction(weights, E1, WHEEL)
    found = wheel.identify(best.normal_stress, best.shear_stress)
    assert found == pytest.approx((1000, math.radians(30)), rel=1e-9)


@pytest.mark.parametrize("stresses", [([1e4], [1e3]), ([1e4, 1e4], [1, 2]), ([], [])])
def test_a_soil_is_not_found_from_one_load(stresses: Any) -> None:
    """One sentence says what to measure."""
    with pytest.raises(RequestError, match=r"cannot be told apart .* two or more"):
        wheel.identify(*stresses)


@pytest.mark.parametrize(
    ("load", "soil", "tyre", "words"),
    [
        (math.nan, E1, WHEEL, "load"), (-1, E1, WHEEL, "load"), (1e31, E1, WHEEL, "load"),
        (1, Soil(-1, 0, 0), WHEEL, "cohesion"), (1, Soil(math.inf, 0, 0), WHEEL, "cohesion"),
        (1, Soil.of(0, 90, 0), WHEEL, "friction angle"),
        (1, Soil.of(0, -1, 0), WHEEL, "friction angle"),
        (1, Soil(0, 0, -1), WHEEL, "sinkage"), (1, Soil(0, 0, 0, -1), WHEEL, "shear modulus"),
        (1, E1, Wheel(0, 1), "radius"), (1, E1, Wheel(math.nan, 1), "radius"),
        (1, E1, Wheel(1, -1), "width"), (1, E1, Wheel(1, 1, -1), "torque"),
        (1, E1, Wheel(1, 1, math.nan), "torque"), (1, E1, Wheel(1, 1, 1, 0), "slip"),
        (1, E1, Wheel(1, 1, 1, 1.1), "slip"), (np.array([1, -1]), E1, WHEEL, "load"),
    ],
)  # fmt: skip
def test_refusals(load: Any, soil: Soil, tyre: Wheel, words: str) -> None:
    """One sentence names what is out of its range."""
    with pytest.raises(RequestError, match=words):
        wheel.check(load, soil, tyre)


def test_a_vehicle_without_wheels_is_refused() -> None:
    """Nobody could say what bears it."""
    with pytest.raises(RequestError, match="no wheels"):
        limits.wheel_layout(Vehicle(WHEEL, (), 40.0))


def test_remarks() -> None:
    """Angles above 50° and deep ruts are told of, nothing else."""

    def words(soil: Soil, slip: float = 0.0) -> str:
        return " ".join(wheel.remarks(100, soil, SLIPPING, slip))

    assert words(E1) == words(E2) == words(Soil.of(0, 50, 0, 0.01)) == ""
    assert "friction angle of 51°" in words(Soil.of(0, 51, 0))
    assert words(Soil.of(1, 30, 0.6)) == ""  # z/D is 0.15
    assert "accurate up to 0.15" in words(Soil.of(1, 30, 0.61))
    assert "to its axle" in words(Soil.of(1, 30, 2))
    # z 50 mm at rest, θ0 = acos 0.75; at 60 % of slip θ1 = 0.7227 + 0.6 · 0.305 and z = 77 mm
    assert words(Soil.of(1, 30, 0.5)) == ""
    assert words(Soil.of(1, 30, 0.5), 0.6).startswith(
        "At a slip of 60 % the wheel sinks in by 0.19 of its diameter; "
    )
    deep = wheel.remarks(100, Soil.of(1, 30, 0.7), WHEEL, 0.6)
    assert deep[0].startswith("The wheel sinks in by 0.17 of its diameter; ")


# Vehicles


def driven(vehicle: Vehicle, soil: Soil, pull: float, pitch: float = 0.0) -> tuple[float, ...]:
    """`kernels.drive` for a vehicle that heads up a slope."""
    plan, sinkage = limits.wheel_layout(vehicle), np.empty(vehicle.wheels)
    need = kernels.drive(plan, vehicle.weight, pitch, under_wheels(soil), pull, sinkage)
    return need["utilisation"], need["torque"], need["slip"], need["power"]


def test_a_wheel_that_could_dig_itself_in_drives_with_less() -> None:
    """At a slip of 1 it would sink in to its axle; it climbs what it can without that."""
    lugged = Wheel(0.1, 0.1, grouser_height=0.1)
    alone, soil = Vehicle.single(lugged, 100.0), Soil.of(5, 34, 0.3, 0.005)
    assert wheel.contact(100.0, soil, lugged, 1.0).sinkage >= 0.1
    need = limits.slope_demand(alone, soil)
    assert need.drives and need.depth < 0.6
    found = limits.climb(alone, soil, 1.0)
    assert found.possible and found.reason == Reason.SINKAGE
    assert limits.slope_demand(alone, soil, found.angle - 1e-6).depth == pytest.approx(1, abs=1e-3)


AXLES = st.sampled_from([
    (Axle(0.5), Axle(-0.5)),
    (Axle(0.3, driven=False), Axle(-0.6)),
    (Axle(0.7), Axle(0.1), Axle(-0.5)),
    (Axle(0.6, 1, driven=False), Axle(-0.2)),
    (Axle(0.4), Axle(-0.5, 4)),
])  # fmt: skip


@given(AXLES, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
@settings(max_examples=examples(100))
def test_loads_are_in_equilibrium(axles: tuple[Axle, ...], pitch: float, roll: float) -> None:
    """Forces and moments of wheels and weight are 0, unless a wheel would be pulled up."""
    vehicle = Vehicle(WHEEL, axles, 60.0, track_width=0.9, cog_height=0.3)
    plan = limits.wheel_layout(vehicle)
    found = limits.wheel_loads(vehicle, pitch, roll)
    # gravity as a plane z = x tan(pitch) + y tan(roll) has it
    normal = np.array([-math.tan(pitch), -math.tan(roll), 1.0])
    normal /= np.linalg.norm(normal)
    forward = np.array([math.cos(pitch), 0.0, math.sin(pitch)])
    left = np.cross(normal, forward)
    weight = np.array([0.0, 0.0, -vehicle.weight])
    assert found.sum() == pytest.approx(-weight @ normal)
    if found.min() > 0.0:
        assert found @ plan.x == pytest.approx(0.3 * (weight @ forward), abs=1e-9)
        assert found @ plan.y == pytest.approx(0.3 * (weight @ left), abs=1e-9)


def test_the_lower_wheels_bear_more() -> None:
    """Nose up loads the rear, the left side up the right; mirrored signs would be seen."""
    up = limits.wheel_loads(ROVER, pitch=0.3)
    assert up[0] == up[1] < up[2] == up[3]
    tilted = limits.wheel_loads(ROVER, roll=0.3)
    assert tilted[0] == tilted[2] < tilted[1] == tilted[3]
    sharp = limits.wheel_loads(ROVER, roll=1.2)
    assert sharp[0] == 0
    assert sharp.sum() == pytest.approx(400 * math.cos(1.2))


@pytest.mark.parametrize("pitch", [0.05, 0.2, 0.5])
def test_loads_of_two_axles_are_those_of_the_textbook(pitch: float) -> None:
    """W_front = (m g/L)(l_r cos α − h sin α), with the centre of gravity off the middle."""
    vehicle = Vehicle(WHEEL, (Axle(0.3), Axle(-0.7)), 50.0, track_width=0.6, cog_height=0.35)
    front = vehicle.weight * (0.7 * math.cos(pitch) - 0.35 * math.sin(pitch))
    rear = vehicle.weight * (0.3 * math.cos(pitch) + 0.35 * math.sin(pitch))
    found = limits.wheel_loads(vehicle, pitch)
    assert found == pytest.approx([front / 2, front / 2, rear / 2, rear / 2])


def test_tip_over_looks_to_the_edge_downhill() -> None:
    """The centre of gravity is nearer to the front: it tips forwards first."""
    vehicle = Vehicle(WHEEL, (Axle(0.3), Axle(-0.7)), 50.0, track_width=0.6, cog_height=0.4)
    expected = (math.atan(0.3 / 0.4), math.atan(0.7 / 0.4), math.atan(0.3 / 0.4))
    assert limits.tip_over(vehicle) == pytest.approx(expected)
    # with one wheel in front it tips sideways over a slanting edge, whose distance is less
    trike = Vehicle(WHEEL, (Axle(0.6, 1), Axle(-0.3)), 50.0, track_width=0.8, cog_height=0.4)
    length = math.hypot(0.9, 0.4)
    away = 0.4 * 0.6 / length  # of the edge from the centre of gravity
    assert limits.tip_over(trike)[0] == pytest.approx(math.atan(away / 0.4 * length / 0.9))
    assert limits.tip_over(one()) == (math.pi / 2,) * 3


@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))
@settings(max_examples=examples(100))
def test_it_tips_where_its_weight_leaves_the_supports(pitch: float, roll: float) -> None:
    """The line of gravity through the centre of gravity meets the plane within the rectangle."""
    vehicle = Vehicle(WHEEL, (Axle(0.3), Axle(-0.7)), 50.0, track_width=0.6, cog_height=0.4)
    slope = math.tan(pitch), math.tan(roll)
    # where the line through the centre of gravity, 0.4 above the plane, meets it
    along, normal = math.hypot(1, slope[0]), math.hypot(1, *slope)
    x, y = -0.4 * slope[0] * normal / along, -0.4 * slope[1] / along
    unknown = SoilArrays(np.array([np.nan]), *np.zeros((4, 1)), np.ones(1)), np.zeros(1)
    (reserve,) = judged(vehicle, unknown, np.array([slope]), [0] * 4)[kernels.RESERVE]
    inside = -0.7 < x < 0.3 and abs(y) < 0.3
    assert (reserve > 0) == inside


@given(SOILS, st.just(0.0) | st.floats(1e-30, 0.5))  # squares of less would vanish
@settings(max_examples=examples(60), deadline=None)
def test_four_equal_wheels_need_what_one_needs(soil: Soil, pull: float) -> None:
    """With equal loads, sharing is dividing."""
    vehicle = Vehicle(WHEEL, ROVER.axles, 40.0, track_width=0.8)
    weight = vehicle.weight / 4
    alone = demand(weight, soil, WHEEL, pull * weight)
    used, torque, slip, power = driven(vehicle, soil, 4 * pull * weight)
    assume(alone.utilisation < 1)
    assert used == pytest.approx(alone.utilisation, rel=1e-8, abs=1e-10)
    assert torque == pytest.approx(alone.torque, rel=1e-8, abs=1e-8 * weight)
    assert power == pytest.approx(4 * alone.torque / 0.2, rel=1e-8, abs=1e-8 * weight)
    assert slip == pytest.approx(alone.slip, rel=1e-6, abs=1e-6)


def test_driven_wheels_push_what_towed_ones_resist() -> None:
    """A rear-driven vehicle: the fronts resist W tan h, and each rear wheel pushes one of them."""
    vehicle = Vehicle(WHEEL, (Axle(0.5, driven=False), Axle(-0.5)), 40.0, track_width=0.8)
    weight = vehicle.weight / 4
    towed = weight * math.tan(math.asin(math.sqrt(1e-4 * weight / 0.4)))
    alone = demand(weight, E1, WHEEL, towed)
    used, torque, _, power = driven(vehicle, E1, 0.0)
    assert (used, torque) == pytest.approx((alone.utilisation, alone.torque))
    assert power == pytest.approx(2 * alone.torque / 0.2)
    all_driven = Vehicle(WHEEL, ROVER.axles, 40.0, track_width=0.8)
    assert limits.climb(vehicle, E1).angle < limits.climb(all_driven, E1).angle / 2 + 0.01


@pytest.mark.parametrize("torque", [math.inf, 12.0, 11.0])
@pytest.mark.parametrize("soil", [E1, Soil.of(0, 35, 0), Soil.of(3, 20, 0.05, 0.02)])
def test_the_largest_slope_is_where_the_demand_is_met_just_so(torque: float, soil: Soil) -> None:
    """`climb` and `drive` are of one mind: a little below it goes, a little above it does not."""
    vehicle = Vehicle(
        Wheel(0.2, 0.1, torque, 0.6), (Axle(0.5), Axle(-0.4)), 40.0, track_width=0.8, cog_height=0.4
    )
    limit = float(limits.climb(vehicle, soil).angle)
    for pitch, goes in ((limit - 1e-6, True), (limit + 1e-6, False)):
        used, most, slip, _ = driven(vehicle, soil, vehicle.weight * math.sin(pitch), pitch)
        assert (used < 1 and most <= torque and slip <= 0.6) == goes, (used, most, slip)


def test_a_wheel_at_its_motors_limit_leaves_the_rest_to_the_others() -> None:
    """The rear ones bear more; they are at their limit, and the front ones push more for it."""
    vehicle = replace(ROVER, wheel=replace(WHEEL, max_torque=12))
    pitch = math.radians(20)
    pull = vehicle.weight * math.sin(pitch)
    free = driven(ROVER, E1, pull, pitch)
    held = driven(vehicle, E1, pull, pitch)
    assert free[1] > 12
    assert held[1] == 12
    assert held[0] > free[0]
    assert driven(vehicle, E1, 1.1 * pull, pitch)[1] > 12  # too much: what it would have needed


def test_to_be_held_back_is_no_slip_but_takes_strength() -> None:
    """Downhill beyond what it resists by itself: the torque is below 0, and gives nothing back."""
    for tyre in (WHEEL, SLIPPING):
        used, torque, slip, power = driven(replace(ROVER, wheel=tyre), E2, -200.0, -0.5)
        assert 0 < used < 1
        assert torque > 0
        assert slip == power == 0
        assert demand(100, E2, tyre, -50).torque < 0


# Classes


def test_classes_of_one_measure() -> None:
    """Below the threshold go, up to the limit caution, beyond it no-go; strict ones at it."""
    go, caution, no_go = Verdict.GO, Verdict.CAUTION, Verdict.NO_GO
    shares = (0, 0.69, 0.7, 1, 1.001, math.inf)
    loose = [judge([Measure(Reason.STEP, share, 0.7)]) for share in shares]
    strict = [judge([Measure(Reason.TRACTION, share, 0.7, True)]) for share in shares]
    assert [one.verdict for one in loose] == [go, go, caution, caution, no_go, no_go]
    assert [one.verdict for one in strict] == [go, go, caution, no_go, no_go, no_go]
    assert tuple(one.utilisation for one in loose) == shares


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        ((0.5, 0.6, 0.1), (Verdict.CAUTION, Reason.SLIP, 0.6)),
        ((0.5, 1.2, 1.1), (Verdict.NO_GO, Reason.TORQUE, 1.2)),
        ((0.9, 0.95, 0.0), (Verdict.CAUTION, Reason.TORQUE, 0.95)),
    ],
)
def test_the_measure_that_binds_most_is_named(
    shares: tuple[float, ...], expected: tuple[Verdict, Reason, float]
) -> None:
    """Of those with the worst verdict the largest share; not one that is larger, but go."""
    limits = ((Reason.SLIP, 0.4), (Reason.TORQUE, 0.7), (Reason.STEP, 0.7))
    measures = [
        Measure(reason, share, go) for (reason, go), share in zip(limits, shares, strict=True)
    ]
    assert judge(measures) == expected


def test_shares_of_torque() -> None:
    """A motor that gives nothing is enough for nothing; one without limit for anything."""
    assert (share_of(0.0, 4.0), share_of(3.0, 4.0)) == (0.0, 0.75)
    assert (share_of(0.0, 0.0), share_of(1.0, 0.0)) == (0.0, math.inf)
    assert share_of(1e9, math.inf) == 0
