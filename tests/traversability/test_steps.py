"""Steps, axle by axle: against closed forms, and linear programs that know of contacts only."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.model import Surface
from terratool.traversability.figures import Figures
from terratool.traversability.report import wording
from terratool.traversability.soil import surface_figures
from terratool.traversability.steps import StepLimit, axle_steps, gap_width, step_height, step_of
from terratool.traversability.vehicle import Axle, Margins, Vehicle, Wheel
from tests.budget import examples

WHEEL = Wheel(0.2, 0.1)
WEIGHT = 400.0


def rover(*axles: Axle, torque: float = math.inf, height: float = 0.3) -> Vehicle:
    wheel = replace(WHEEL, max_torque=torque)
    mass = WEIGHT / 9.80665
    return Vehicle(wheel, axles, mass, track_width=0.8, cog_height=height)


def mirrored(vehicle: Vehicle) -> Vehicle:
    axles = tuple(replace(axle, x=-axle.x) for axle in vehicle.axles[::-1])
    return replace(vehicle, axles=axles)


# An outside reference


def can_stand(
    vehicle: Vehicle, climbing: int, step: float, risen: float, friction: float, way: int = 1
) -> bool:
    """Whether forces hold a vehicle that drives to x = ±∞ with one axle at an edge, by HiGHS.

    The unknowns are normal and tangential force of each axle; of three axles and more the upward
    forces are linear along the body. The edge is at x = 0, and `risen` of the step is climbed.
    """
    axles = vehicle.axles
    count = len(axles)
    radius = np.array([vehicle.wheel_of(axle).radius for axle in axles])
    x = np.array([axle.x for axle in axles])
    wheels = np.array([axle.wheels for axle in axles])
    ahead = way * (x - x[climbing]) > 0.0
    ground = np.where(ahead, step, 0.0)
    ground[climbing] = risen
    body = np.array([x, radius - vehicle.cog_height])  # of wheels' middles, from the gravity's

    def slope_left(turn: float) -> Any:
        """The slope of what is left between the body's heights and those of the wheels."""
        heights = np.sin(turn) * body[0] + np.cos(turn) * body[1]
        return np.polyfit(x, ground + radius - heights, 1, w=np.sqrt(wheels))[0]

    from scipy.optimize import brentq, linprog

    turn = brentq(slope_left, -1.4, 1.4, xtol=1e-14)
    middles = np.cos(turn) * body[0] - np.sin(turn) * body[1]
    angle = math.acos(1.0 - (step - risen) / radius[climbing])
    edge = middles[climbing] + way * radius[climbing] * math.sin(angle)
    places = np.array([middles - edge, np.where(ahead, step, 0.0)])
    normals = np.array([np.zeros(count), np.ones(count)])
    places[:, climbing] = 0.0, step
    normals[:, climbing] = -way * math.sin(angle), math.cos(angle)
    along = np.array([normals[1], -normals[0]])

    def rows(forces: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([*forces, places[0] * forces[1] - places[1] * forces[0]])

    equal = [*np.hstack([rows(normals), rows(along)])]
    right = [0.0, 1.0, -edge]
    for k in range(1, count - 1):  # as much a wheel as on the line between those of both ends
        share = (x[k] - x[0]) / (x[-1] - x[0])
        upward = np.zeros((2, count))
        upward[:, k] = np.array([normals[1, k], along[1, k]]) / wheels[k]
        for end, part in ((0, 1.0 - share), (-1, share)):
            upward[:, end] -= part * np.array([normals[1, end], along[1, end]]) / wheels[end]
        equal.append(upward.ravel())
        right.append(0.0)
    cones, bounds = [], [(0.0, None)] * count
    for k, axle in enumerate(axles):
        grip = friction if axle.driven else 0.0
        for sign in (1.0, -1.0):
            cone = np.zeros(2 * count)
            cone[k], cone[count + k] = -grip, sign
            cones.append(cone)
        wheel = vehicle.wheel_of(axle)
        most = axle.wheels * wheel.max_torque / wheel.radius / vehicle.weight
        bounds.append((-most, most) if math.isfinite(most) else (None, None))
    found = linprog(
        np.zeros(2 * count), cones, np.zeros(2 * count), equal, right, bounds, method="highs"
    )
    return bool(found.status == 0)


def gets_up(vehicle: Vehicle, axle: int, step: float, friction: float, way: int = 1) -> bool:
    """Whether the reference can stand at nine moments of the climb."""
    radius = vehicle.wheel_of(vehicle.axles[axle]).radius
    touch = math.acos(max(1.0 - step / radius, 0.0))
    moments = (step - radius * (1.0 - math.cos(touch * part / 8)) for part in range(9))
    return all(can_stand(vehicle, axle, step, risen, friction, way) for risen in moments)


def agrees(vehicle: Vehicle, axle: int, found: StepLimit, friction: float, way: int = 1) -> None:
    """The reference gets up 0.1 % less, and not 0.1 % more unless the wheels are too small."""
    assert found.height == 0 or gets_up(vehicle, axle, 0.999 * found.height, friction, way)
    if found.reason != "wheel radius":
        more = 1.001 * found.height + 1e-6
        assert not gets_up(vehicle, axle, more, friction, way)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high)


@st.composite
def rovers(draw: st.DrawFn, axles: int = 2) -> Vehicle:
    """Axles with wheels of their own, centre of gravity anywhere between them."""
    sizes = [draw(numbers(0.1, 0.3)) for _ in range(axles)]
    x = [0.0]
    for _ in range(axles - 1):
        x.append(x[-1] - draw(numbers(0.62, 2)))
    middle = draw(numbers(0.1, 0.9)) * x[-1]
    torque = st.one_of(st.just(math.inf), numbers(1, 80))
    placed = tuple(
        Axle(
            place - middle, draw(st.integers(1, 3)), draw(st.integers(0, 3)) > 0,
            Wheel(size, 0.1, draw(torque)),
        )
        for place, size in zip(x, sizes, strict=True)
    )  # fmt: skip
    return rover(*placed, height=draw(numbers(0.1, 0.8)))


FRICTIONS = numbers(0.05, 1.5)


@settings(max_examples=examples(25), deadline=None)
@given(rovers(), FRICTIONS)
def test_two_axles_against_a_linear_program(vehicle: Vehicle, friction: float) -> None:
    """Front and rear axle, driven or towed, whatever their wheels and motors."""
    pytest.importorskip("scipy")
    for axle, found in enumerate(axle_steps(vehicle, friction)):
        agrees(vehicle, axle, found, friction)


@settings(max_examples=examples(12), deadline=None)
@given(rovers(), FRICTIONS)
def test_a_mirrored_vehicle_is_one_that_drives_backwards(vehicle: Vehicle, friction: float) -> None:
    """The reference drives the vehicle as it is to the other side."""
    pytest.importorskip("scipy")
    backwards = axle_steps(mirrored(vehicle), friction)[::-1]
    for axle, found in enumerate(backwards):
        agrees(vehicle, axle, found, friction, way=-1)


SIX = rover(Axle(1.1), Axle(-0.1), Axle(-1.0), torque=30, height=0.5)


@pytest.mark.parametrize(
    "vehicle",
    [
        replace(SIX, wheel=WHEEL), SIX,
        replace(SIX, axles=(Axle(1.1), Axle(0.2, 4), Axle(-1.0, 1, False, Wheel(0.12, 0.1)))),
        replace(SIX, axles=(Axle(0.9, driven=False), Axle(0.2), Axle(-0.5), Axle(-1.4))),
    ],
    ids=["soil", "motors", "castor", "four axles"],
)  # fmt: skip
@pytest.mark.parametrize("friction", [0.3, 0.6])
def test_more_axles_against_a_linear_program(vehicle: Vehicle, friction: float) -> None:
    """Loads are linear from wheel to wheel; pushes are shared at will."""
    pytest.importorskip("scipy")
    for axle, found in enumerate(axle_steps(vehicle, friction)):
        agrees(vehicle, axle, found, friction)


# Closed forms


@pytest.mark.parametrize("height", [0.2, 0.3, 0.4])
def test_the_front_axle_whatever_the_height_of_the_centre_of_gravity(height: float) -> None:
    """At the first touch the body is level, and three forces meet.

    With all friction used, the front's force leans ahead of it by α − δ, the rear's by δ. Moments
    about the rear contact: sin δ [(L + r sin α) cos β + H sin β] = l_r sin α, β = α − δ.
    """
    front, _ = axle_steps(rover(Axle(0.5), Axle(-0.5), height=height), 0.7)
    angle, cone = math.acos(1 - front.height / 0.2), math.atan(0.7)
    lean = angle - cone
    arm = (1 + 0.2 * math.sin(angle)) * math.cos(lean) + front.height * math.sin(lean)
    assert math.sin(cone) * arm == pytest.approx(0.5 * math.sin(angle), abs=1e-9)
    assert front.height == pytest.approx(0.1944, abs=5e-5)


@pytest.mark.parametrize(("height", "expected"), [(0.2, 0.0987), (0.3, 0.0959), (0.4, 0.0934)])
def test_the_rear_axle_gets_up_less(height: float, expected: float) -> None:
    """Half of the front's, and less the higher the centre of gravity: pitch loads the rear."""
    vehicle = rover(Axle(0.5), Axle(-0.5), height=height)
    assert axle_steps(vehicle, 0.7)[1].height == pytest.approx(expected, abs=5e-5)
    assert step_of(vehicle, 0.7) == axle_steps(vehicle, 0.7)[1]


@given(FRICTIONS)
def test_long_wheelbases(friction: float) -> None:
    """2 r μ²/(1 + μ²) is the limit of both axles as they move apart."""
    far = rover(Axle(1e5), Axle(-1e5))
    expected = min(2 * 0.2 * friction**2 / (1 + friction**2), 0.2)
    for found in axle_steps(far, friction):
        assert found.height == pytest.approx(expected, rel=1e-4)


@given(FRICTIONS, numbers(0.1, 100))
def test_a_wheel_by_itself(friction: float, torque: float) -> None:
    """r (1 − cos α), α that of friction δ or asin(Tmax/(W r)), whichever is less."""
    cone, lifted = math.atan(friction), math.asin(min(1.0, torque / (100 * 0.2)))
    assume(abs(cone - lifted) > 1e-6)
    found = step_of(Vehicle.single(replace(WHEEL, max_torque=torque), 100), friction)
    assert found.height == pytest.approx(0.2 * (1 - math.cos(min(cone, lifted))), abs=1e-9)
    assert (found.reason, found.axle) == ("friction" if cone < lifted else "motor torque", None)


@given(FRICTIONS)
def test_towed_wheels_do_not_help(friction: float) -> None:
    """A driven axle with nobody to push or pull it is like a wheel by itself."""
    alone = 0.2 * (1 - math.cos(math.atan(friction)))
    front, _ = axle_steps(rover(Axle(0.5), Axle(-0.5, driven=False)), friction)
    _, rear = axle_steps(rover(Axle(0.5, driven=False), Axle(-0.5)), friction)
    assert front.height == pytest.approx(alone, abs=1e-9)
    assert rear.height == pytest.approx(alone, abs=1e-9)


def test_a_tall_vehicle_falls_back_later_on() -> None:
    """At first touch all is well; the front has no load any more when the body is steep enough.

    That is where the centre of gravity is above the rear contact, tan p = l_r/(h − r).
    """
    vehicle = rover(Axle(0.8), Axle(-0.05), height=1.0)
    front, _ = axle_steps(vehicle, 5.0)
    pitch = math.atan2(0.05, 1.0 - 0.2)
    assert front.height == pytest.approx(0.85 * math.sin(pitch), abs=1e-9)
    assert (front.reason, front.axle) == ("tip-over", 0)


def test_nothing_drives_nothing_climbs() -> None:
    """No friction, no motor: not even the least step; and no step is a small number."""
    for vehicle in (
        rover(Axle(0.5, driven=False), Axle(-0.5, driven=False)),
        rover(Axle(0.5), Axle(-0.5), torque=0.0),
    ):
        assert step_of(vehicle, 0.7).height == 0
    assert step_of(rover(Axle(0.5), Axle(-0.5)), 0.0) == StepLimit(0.0, "friction", 0)


# What holds for every vehicle


@settings(max_examples=examples(60), deadline=None)
@given(st.integers(1, 4).flatmap(rovers), FRICTIONS, numbers(1, 3), numbers(1, 3))
def test_more_friction_or_torque_is_never_worse(
    vehicle: Vehicle, friction: float, grip: float, power: float
) -> None:
    """For each axle by itself."""
    stronger = replace(
        vehicle,
        axles=tuple(
            replace(axle, wheel=replace(axle.wheel, max_torque=power * axle.wheel.max_torque))
            for axle in vehicle.axles
            if axle.wheel
        ),
    )
    before = axle_steps(vehicle, friction)
    for after in (axle_steps(vehicle, grip * friction), axle_steps(stronger, friction)):
        for one, other in zip(before, after, strict=True):
            assert other.height >= one.height - 1e-9


@given(numbers(0.05, 1.0), st.integers(2, 5), numbers(0.5, 20))
def test_scale_and_weight_alone_change_nothing(friction: float, factor: int, torque: float) -> None:
    """Twice as large: twice the step. Twice as heavy, with twice the torque: the same."""
    vehicle = rover(Axle(0.7), Axle(-0.4, 1), torque=torque)
    heavy = replace(
        vehicle, mass=factor * vehicle.mass,
        wheel=replace(vehicle.wheel, max_torque=factor * torque),
    )  # fmt: skip
    large = replace(
        vehicle, cog_height=0.3 * factor,
        wheel=replace(vehicle.wheel, radius=0.2 * factor, max_torque=factor * torque),
        axles=(Axle(0.7 * factor), Axle(-0.4 * factor, 1)),
    )  # fmt: skip
    for one, two, three in zip(
        *(axle_steps(each, friction) for each in (vehicle, heavy, large)), strict=True
    ):
        assert two.height == pytest.approx(one.height, abs=1e-9)
        assert three.height == pytest.approx(factor * one.height, abs=1e-8)


def test_an_axle_that_bears_nothing_does_not_matter() -> None:
    """Linear loads would pull the foremost of three up: the others do what they do without it."""
    three = rover(Axle(3.8), Axle(0.9), Axle(-0.1))
    two = rover(*three.axles[1:])
    found = axle_steps(replace(three, cog_height=0.2), 0.4)
    # with the centre of gravity at the height of the axles pitch moves no load
    expected = axle_steps(replace(two, cog_height=0.2), 0.4)
    for one, other in zip(found[1:], expected, strict=True):
        assert one.height == pytest.approx(other.height, rel=0.03)
    assert found[0].reason == "wheel radius"


# What binds, and reports


def test_what_binds() -> None:
    """Friction, motors, the smallest wheel or the body, and at which axle."""
    assert step_of(rover(Axle(0.5), Axle(-0.5)), 0.7).axle == 1
    towed = step_of(rover(Axle(0.2, driven=False), Axle(-0.5)), 0.3)
    assert (towed.reason, towed.axle) == ("friction", 0)
    weak = step_of(rover(Axle(0.5), Axle(-0.5), torque=5), 0.7)
    assert (weak.reason, weak.axle) == ("motor torque", 1)
    small = replace(WHEEL, radius=0.05)
    castor = step_of(rover(Axle(0.5, wheel=small), Axle(-0.5)), 9.0)
    assert (castor.height, castor.reason, castor.axle) == (0.05, "wheel radius", 0)
    low = replace(rover(Axle(0.5), Axle(-0.5)), clearance=0.08)
    assert step_of(low, 0.7) == StepLimit(0.08, "clearance")
    kept = replace(low, margins=Margins(clearance=0.02, step=0.01))
    assert step_of(kept, 0.7).height == pytest.approx(0.05)


def test_figures_and_words_name_the_axle() -> None:
    """Counted from the front, in words where there are few."""
    rock = Surface(cohesion=0, fric_angle=35, sinkage=0)
    vehicle = rover(Axle(0.5), Axle(-0.5))
    found = surface_figures("rock", rock, vehicle)
    assert (found.step_binding, found.step_axle) == ("friction", 2)
    assert wording.step_limit(found, vehicle) == "friction at the rear axle"
    body = Figures("rock", step_binding="clearance")
    assert wording.step_limit(body, vehicle) == "clearance"
    assert [wording.axle(n, 3) for n in (1, 2, 3)] == ["front", "middle", "rear"]
    assert [wording.axle(n, 30) for n in (2, 3, 4, 11, 12, 13, 21, 22, 23, 30)] == [
        "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "22nd", "23rd", "rear",
    ]  # fmt: skip


def test_gaps_are_those_of_the_smallest_wheel() -> None:
    """2 r sin α, with r (1 − cos α) the step."""
    assert gap_width(0.2, step_height(0.2, 0.6)) == pytest.approx(0.4 * math.sin(0.6))
    rock = Surface(cohesion=0, fric_angle=35, sinkage=0)
    found = surface_figures("rock", rock, rover(Axle(0.5), Axle(-0.5, wheel=Wheel(0.12, 0.1))))
    assert found.step is not None and found.gap == pytest.approx(gap_width(0.12, found.step))
