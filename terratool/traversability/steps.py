"""The highest step that each axle of a vehicle gets up, by statics in the plane of the climb."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.traversability.track import outline_of, track_step
from terratool.traversability.vehicle import Vehicle

_PARTS = 16
"""Number of steps that are tried at a time, in equal parts of the angle."""
_CLOSE = 1e-10
"""Accuracy of the angle of the highest step, rad."""
_LEAST = 1e-4
"""Angle below which a step counts as none, rad."""
_MOMENTS = np.linspace(1.0, 0.0, 3)
"""Moments of a climb: angles of the wheel at the edge, as shares of that at first touch."""
_MOST = 1e9
"""Thrust beyond that of any motor, in weights of the vehicle; stands for infinity."""


@dataclass(frozen=True, slots=True)
class StepLimit:
    """The highest step that a vehicle, or an axle, gets up.

    Attributes:
        height: height of the step, m.
        reason: measure that limits the height, in words.
        axle: index from the front of the axle that gets up no higher step; None where the body
            limits the height, or the wheel is by itself.
    """

    height: float
    reason: str
    axle: int | None = None


class _Axles(NamedTuple):
    """The axles of a vehicle, (n,) each, from the front.

    Attributes:
        x: distances ahead of the centre of gravity, m.
        above: heights of the wheels' middles over the centre of gravity on level ground, m.
        radius: radii of the wheels, m.
        driven: bool, whether an axle is driven.
        thrust: largest thrust of all motors of an axle, in weights of the vehicle.
        tilt: tilt of the body for a rise under each axle, 1/m.
        sharing: (k, n) shares of the weight, as it moves from the rearmost to the foremost axle,
            at the places between which they are linear.
    """

    x: NDArray[np.float64]
    above: NDArray[np.float64]
    radius: NDArray[np.float64]
    driven: NDArray[np.bool_]
    thrust: NDArray[np.float64]
    tilt: NDArray[np.float64]
    sharing: NDArray[np.float64]


class _Climb(NamedTuple):
    """Moments of climbs, (...) each, or (..., n) for each axle.

    Attributes:
        height: (...) height of the step, m.
        angle: (..., n) angle of the contact from the downward vertical, rad; 0 on level ground.
        lower: (..., n) bool, whether the axle stands on the lower level.
        arm: (..., n) distance of the contact ahead of the edge, m.
        gravity: (...) distance of the centre of gravity ahead of the edge, m.
    """

    height: NDArray[np.float64]
    angle: NDArray[np.float64]
    lower: NDArray[np.bool_]
    arm: NDArray[np.float64]
    gravity: NDArray[np.float64]


def step_height(radius: Any, angle: Any) -> Any:
    """H = r (1 − cos α), the step that a wheel touches at α from the downward vertical, up to r."""
    return 2.0 * radius * np.sin(0.5 * np.minimum(angle, math.pi / 2)) ** 2


def gap_width(radius: float, step: float) -> float:
    """Widest gap, m, for a wheel that climbs a step, m: 2 r sin α, α the angle at the step."""
    share = min(max(step / radius, 0.0), 1.0)
    return 2.0 * radius * math.sqrt(share * (2.0 - share))


@lru_cache(maxsize=256)
def step_of(vehicle: Vehicle, friction: float) -> StepLimit:
    """The highest step that a vehicle gets up with a friction μ: the least of its axles' steps.

    The clearance less its margin limits it, too. The step's margin is taken off at the end.
    """
    limits = _gear_steps(vehicle, friction) or list(axle_steps(vehicle, friction))
    if not vehicle.is_single and vehicle.gear == "wheels":
        limits.append(StepLimit(vehicle.clearance - vehicle.margins.clearance, "clearance"))
    least = min(limits, key=lambda each: each.height)
    return replace(least, height=max(0.0, least.height - vehicle.margins.step))


def _gear_steps(vehicle: Vehicle, friction: float) -> list[StepLimit]:
    """The highest step that tracks or feet get up; none for wheels.

    What lies between tracks or legs is above the edge as soon as these are.
    """
    if vehicle.tracks:
        most = 2.0 * vehicle.tracks.max_torque / vehicle.tracks.radius / vehicle.weight
        return [StepLimit(*track_step(outline_of(vehicle), friction, most))]
    if vehicle.feet:
        return [StepLimit(vehicle.feet.step_height, "height of a foot's step")]
    return []


def axle_steps(vehicle: Vehicle, friction: float) -> tuple[StepLimit, ...]:
    """The highest step that each axle gets up with a friction μ, (n,).

    Steps end at the radius of the smallest wheel. Axles ahead stand on the upper level, those
    behind on the lower one, and the body is tilted accordingly. At every moment of the climb there
    are forces in all contacts that hold the vehicle, each within friction (on the normal at towed
    wheels) and the motors' torque. Loads differ linearly from wheel to wheel, as those of a rigid
    body on equal springs; with two axles that is statics. Derived here.

    Raises:
        RequestError: the vehicle has no wheels.
    """
    axles = _axles(vehicle)
    return tuple(_highest_step(axles, index, friction) for index in range(len(axles.x)))


def _axles(vehicle: Vehicle) -> _Axles:
    """The axles of a vehicle as arrays."""
    wheels = [vehicle.wheel_of(axle) for axle in vehicle.axles]
    x = np.array([axle.x for axle in vehicle.axles], np.float64)
    count = np.array([axle.wheels for axle in vehicle.axles], np.float64)
    radius = np.array([wheel.radius for wheel in wheels], np.float64)
    torque = np.array([wheel.max_torque for wheel in wheels], np.float64)
    ahead = x - count @ x / count.sum()
    spread = float(count @ ahead**2)
    return _Axles(
        x, radius - vehicle.cog_height, radius,
        np.array([axle.driven for axle in vehicle.axles]),
        count * torque / radius / vehicle.weight,
        count * ahead / spread if spread > 0.0 else np.zeros_like(x),
        _load_shares(x, count),
    )  # fmt: skip


def _load_shares(x: NDArray[np.float64], count: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of the axles in a weight that moves ahead, (k, n), see `_Axles.sharing`.

    There is a row for each place at which an axle begins or ceases to bear. A body on equal
    springs loads wheels linearly; wheels that it would pull up bear nothing. So the share of an
    axle is proportional to its number of wheels times its distance to the axle that just bears
    nothing.
    """
    if x[0] == x[-1]:
        return np.tile(count / count.sum(), (2, 1))
    towards_rear = [count * np.maximum(end - x, 0.0) for end in x[-2::-1]]
    towards_front = [count * np.maximum(x - end, 0.0) for end in x[:0:-1]]
    shares = np.array([each for each in towards_rear + towards_front if each.any()])
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def _highest_step(axles: _Axles, index: int, friction: float) -> StepLimit:
    """The highest step that an axle gets up, searched from below."""
    radius = axles.radius[index]
    smallest = int(np.argmin(axles.radius))
    low, high = 0.0, math.acos(1.0 - axles.radius[smallest] / radius)
    stuck = False
    while not stuck or high - low > _CLOSE:
        angles = low + (high - low) * np.arange(1, _PARTS + 1) / _PARTS
        passed = _passes(axles, index, angles, friction)
        if not stuck and passed.all():
            which = index if radius == axles.radius[smallest] else smallest
            return StepLimit(
                float(axles.radius[smallest]), "wheel radius", _axle_index(axles, which)
            )
        stuck = True
        first = int(np.argmin(passed)) if not passed.all() else _PARTS - 1
        low, high = (low, *angles)[first], angles[first]
    height = float(step_height(radius, low)) if low > _LEAST else 0.0
    return StepLimit(height, _reason(axles, index, high, friction), _axle_index(axles, index))


def _reason(axles: _Axles, index: int, angle: float, friction: float) -> str:
    """The measure, in words, that limits an axle at a step that is a little too high.

    `angle` is that of the step, rad.
    """
    touch = np.array([angle])
    strong = axles._replace(thrust=np.full_like(axles.thrust, math.inf))
    # with boundless friction, wheels that pull at each other could hold a falling vehicle
    helped = _passes(strong, index, touch, 1.01 * friction + 0.01)[0]
    if not helped and axles.driven.any():
        return "tip-over"
    return "motor torque" if _passes(strong, index, touch, friction)[0] else "friction"


def _axle_index(axles: _Axles, index: int) -> int | None:
    """An index of an axle; None where there is but one."""
    return index if len(axles.x) > 1 else None


def _passes(
    axles: _Axles, index: int, angles: NDArray[np.float64], friction: float
) -> NDArray[np.bool_]:
    """Whether an axle gets up steps that its wheels first touch at angles, (m,) rad."""
    held = _holds(axles, _climb(axles, index, angles[:, None]), friction)
    return np.asarray(held.all(axis=1))


def _climb(axles: _Axles, index: int, touch: NDArray[np.float64]) -> _Climb:
    """The moments of an axle's climbs up steps that its wheels touch at angles, (m, 1) rad."""
    height = step_height(axles.radius[index], touch)
    turned = touch * _MOMENTS
    # middles of wheels behind the edge; wheels of near axles may be at the edge, too
    behind = axles.radius[index] * np.sin(turned)[..., None] - (axles.x - axles.x[index])
    room = np.sqrt(np.maximum(height * (2.0 * axles.radius - height), 0.0))[:, None]
    lower, at_edge = behind > room, (behind > 0.0) & (behind <= room)
    lower[..., index], at_edge[..., index] = False, True
    angle = np.where(at_edge, np.arcsin(np.clip(behind / axles.radius, 0.0, 1.0)), 0.0)
    angle[..., index] = turned
    risen = np.where(lower, 0.0, height[..., None] - step_height(axles.radius, angle))
    # sin p + (slope of the radii)·cos p = slope of the middles
    sizes = float(axles.tilt @ axles.radius)
    slope = np.clip((risen @ axles.tilt + sizes) / math.hypot(1.0, sizes), -1.0, 1.0)
    pitch = (np.arcsin(slope) - math.atan(sizes))[..., None]
    middle = axles.x * np.cos(pitch) - axles.above * np.sin(pitch)
    edge = middle[..., index] + axles.radius[index] * np.sin(turned)
    arm = np.where(at_edge, 0.0, middle - edge[..., None])
    return _Climb(np.broadcast_to(height, turned.shape), angle, lower, arm, -edge)


def _holds(axles: _Axles, climb: _Climb, friction: float) -> NDArray[np.bool_]:
    """Whether forces in all contacts can hold the vehicle, (...).

    Forces are in weights of the vehicle. Forces along the ground act at two heights, of the edge
    and of the lower level. Their moment about the edge gives the sum of those on the lower level
    for each distribution of loads. This sum, and the force ahead or back that each contact can
    bear, are piecewise linear in the loads: X is within V tan(δ − α) and −V tan(δ + α) by friction,
    and within (±Tmax/r − V sin α)/cos α by the motor.
    """
    cone = np.arctan(friction) * axles.driven
    angle, cosine = climb.angle[..., None, None, :], np.cos(climb.angle)[..., None, None, :]
    start, end = axles.sharing[:-1, None], axles.sharing[1:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        # the load at which motor and friction limit an axle's thrust alike
        equal = axles.thrust * np.cos(climb.angle - cone) / np.sin(cone)
        part = (equal[..., None, :] - start[:, 0]) / (end - start)[:, 0]
    part = np.clip(np.nan_to_num(part, nan=0.0), 0.0, 1.0)
    ends = np.zeros((*part.shape[:-1], 1))
    part = np.sort(np.concatenate([ends, part, ends + 1.0], axis=-1), axis=-1)
    loads = start + (end - start) * part[..., None]
    if len(axles.x) > 1:
        push = (climb.gravity[..., None] - climb.arm @ axles.sharing.T) / climb.height[..., None]
    else:
        push = np.zeros((*climb.gravity.shape, 2))  # who balances a single axle is not asked
    push = push[..., :-1, None] + np.diff(push)[..., None] * part
    grip = np.minimum(axles.thrust, _MOST) / cosine
    lean = loads * np.tan(angle)
    ahead = np.minimum(loads * np.tan(cone - angle), grip - lean)
    steep = np.tan(np.minimum(cone + angle, math.pi / 2))
    back = np.minimum(loads * steep, grip + lean)
    lower = climb.lower[..., None, None, :]
    margins = np.stack([
        np.sum(ahead, axis=-1, where=lower) - push,
        np.sum(back, axis=-1, where=lower) + push,
        np.sum(ahead, axis=-1, where=~lower) + push,
        np.sum(back, axis=-1, where=~lower) - push,
    ])  # fmt: skip
    return _hold_together(margins[..., :-1], margins[..., 1:])


def _hold_together(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether numbers that are linear between two points are all 0 or more at one place, (...).

    Args:
        start: (numbers, ..., pieces, points) values at the first point of each piece.
        end: (numbers, ..., pieces, points) values at the last point of each piece.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        root = start / (start - end)
    low = np.where(start < 0.0, np.where(end < 0.0, 2.0, root), 0.0).max(axis=0)
    high = np.where((end < 0.0) & (start >= 0.0), root, 1.0).min(axis=0)
    return np.asarray((low <= high).any(axis=(-1, -2)))
