"""What a vehicle gets over and climbs, and the share that each measure takes of its limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.traversability.arrays import Numbers, flat, flat_soils, shaped
from terratool.traversability.loads import wheel_layout
from terratool.traversability.results import Reason
from terratool.traversability.vehicle import Overhang, Soil, Vehicle
from terratool.traversability.wheel import Demand

NO_LIMIT = math.pi
"""The angle of a crest that nothing can touch."""


def step_height(radius: Any, angle: Any) -> Numbers:
    """H = r (1 − cos α), the step that a wheel touches at α from the downward vertical, up to r."""
    height: Numbers = np.where(
        angle >= np.pi / 2, radius, 2.0 * radius * np.sin(0.5 * np.minimum(angle, np.pi / 2)) ** 2
    )[()]
    return height


def step_alone(radius: Any, friction: Any) -> Numbers:
    """Step that a driven wheel by itself rolls up: r (1 − cos δ), δ = atan μ.

    Args:
        radius: r, m.
        friction: μ, tan φ of the surface.
    """
    return step_height(radius, np.arctan(friction))


def step_pushed(radius: Any, friction: Any, push: Any, driven: Any = True) -> Numbers:
    """Step of a wheel that the others push.

    The force in its contact lies within δ of the normal (on it if the wheel is not driven), and
    the push leans its load by atan(push), so α = δ + atan(push). For the front wheels of an equally
    loaded 4WD that is 2 r μ²/(1 + μ²).

    Args:
        radius: r, m.
        friction: μ.
        push: forward force of the other wheels, in loads of this one.
        driven: whether it is.
    """
    own = np.where(driven, np.arctan(friction), 0.0)
    return step_height(radius, own + np.arctan(push))


def step_torque(radius: Any, load: Any, max_torque: Any) -> Numbers:
    """Step that a motor lifts a wheel up: r (1 − cos α), α = asin(min(1, Tmax/(W r)))."""
    needed = np.maximum(np.asarray(load, np.float64) * radius, 1e-300)
    return step_height(radius, np.arcsin(np.minimum(1.0, max_torque / needed)))


def gap_width(radius: Any, step: Any) -> Numbers:
    """Gap over which a wheel rolls that climbs a step: 2 r sin α, α that of the step."""
    share = np.clip(np.asarray(step, np.float64) / radius, 0.0, 1.0)
    width: Numbers = 2.0 * radius * np.sqrt(share * (2.0 - share))
    return width


def step_of(vehicle: Vehicle, friction: float) -> tuple[float, str]:
    """The highest step that all wheels of a vehicle get up, and what limits it.

    The smallest of what friction and motors give on the axle where it is least, with level loads;
    not beyond the wheel's radius, nor the clearance less its margin. The step's margin is taken
    off at the end.

    Args:
        vehicle: what climbs.
        friction: μ, tan φ of the surface.
    """
    wheel, wheels = vehicle.wheel, wheel_layout(vehicle)
    loads = np.maximum(vehicle.weight * wheels.shares[:, 0], 0.0)
    force = np.minimum(loads * friction, wheel.max_torque / wheel.radius) * wheels.driven
    limits = [(wheel.radius, "wheel radius")]
    if not vehicle.is_single:
        limits.append((vehicle.clearance - vehicle.margins.clearance, "clearance"))
    for x in np.unique(wheels.x):
        here = wheels.x == x
        load, count = float(loads[here].sum()), int(here.sum())
        if load == 0.0:
            continue
        driven = bool(wheels.driven[here].any())
        push = float(force[~here].sum()) / load
        limits.append((float(step_pushed(wheel.radius, friction, push, driven)), "friction"))
        if driven and math.isfinite(wheel.max_torque):
            lifted = float(step_torque(wheel.radius, load / count, wheel.max_torque))
            limits.append((lifted, "motor torque"))
    height, limit = min(limits, key=lambda each: each[0])
    return max(0.0, height - vehicle.margins.step), limit


def clearance_left(clearance: Any, sinkage: Any) -> Numbers:
    """Clearance under the body of wheels that have sunk in, m; 0 and less is high-centred."""
    left: Numbers = np.subtract(clearance, sinkage, dtype=np.float64)
    return left


def breakover(wheelbase: Any, radius: Any, clearance: Any) -> Numbers:
    """The sharpest crest that passes between two axles, rad: the angle that the ground turns.

    Exact for wheels: 2 [asin(r/d) − atan((r − hc)/(L/2))], d = √((L/2)² + (r − hc)²). 0 where the
    body lies on the ground, `NO_LIMIT` where there is none, or no wheelbase.
    """
    half, size, free = np.broadcast_arrays(
        *(np.asarray(v, np.float64) for v in (0.5 * np.asarray(wheelbase), radius, clearance))
    )
    drop = size - np.where(np.isfinite(free), free, size)
    reach = np.hypot(half, drop)
    bound = np.isfinite(free) & (half > 0.0) & (reach > size)
    lean = np.arcsin(np.divide(size, reach, out=np.ones_like(reach), where=bound))
    angle = 2.0 * (lean - np.arctan2(drop, half))
    return np.where(bound, np.clip(angle, 0.0, NO_LIMIT), np.where(free > 0.0, NO_LIMIT, 0.0))[()]


def approach(radius: Any, length: Any, height: Any) -> Numbers:
    """The steepest ramp that an overhang does not touch when its wheels stand at its foot, rad.

    asin(r/d) + atan2(y − r, o), d = √(o² + (y − r)²), for the body's end at the length o beyond the
    axle and at the height y. `NO_LIMIT` where d ≤ r or nothing can touch.
    """
    size, ahead, above = np.broadcast_arrays(
        *(np.asarray(v, np.float64) for v in (radius, length, height))
    )
    rise = np.where(np.isfinite(above), above, size) - size
    reach = np.hypot(ahead, rise)
    bound = np.isfinite(above) & (reach > size)
    lean = np.arcsin(np.divide(size, reach, out=np.ones_like(reach), where=bound))
    return np.where(bound, np.clip(lean + np.arctan2(rise, ahead), 0.0, NO_LIMIT), NO_LIMIT)[()]


def overhang_angle(radius: float, overhang: Overhang) -> float:
    """`approach` of a vehicle's overhang; the angle of departure if it is the rear one."""
    return float(approach(radius, overhang.length, overhang.height))


@dataclass(frozen=True, slots=True)
class Steepest:
    """The largest slopes, in the shape that the soil's figures broadcast to.

    Attributes:
        angle: rad; 0 where it cannot even be on the level.
        possible: whether it can be on the level.
        reason: int `Reason`, what binds there; what forbids it where it is not possible.
    """

    angle: Numbers
    possible: NDArray[np.bool_] | np.bool_
    reason: NDArray[np.int64] | np.int64


def climb(vehicle: Vehicle, soil: Soil, max_slip: float | None = None) -> Steepest:
    """The largest slope that it climbs straight up: the root of Σ DP − Σ R = m g sin α.

    Loads are those of the slope (`loads.layout`). Each driven wheel pushes with the same share of
    the soil's strength: all of it where K is not known, else what `max_slip` mobilises in the one
    that mobilises least; with its motor's limit where that is less. Each towed wheel resists.
    A wheel that lifts ends the search, and so does one that sinks in to its axle.

    Args:
        vehicle: what climbs; its margins are not taken off.
        soil: numbers or arrays.
        max_slip: the largest slip; that of the wheel if it is not given.
    """
    return _steepest(vehicle, soil, False, vehicle.wheel.max_slip if max_slip is None else max_slip)


def side_slip(vehicle: Vehicle, soil: Soil) -> Steepest:
    """The largest slope across which it does not slip: Σ (c b l + W tan φ) = m g sin β.

    l = r sin θ1, from the loads on the slope; with equal loads that is N c b l + m g cos β tan φ =
    m g sin β. Derived; wheels hold as they do along.
    """
    return _steepest(vehicle, soil, True, 1.0)


def _steepest(vehicle: Vehicle, soil: Soil, across: bool, slip: float) -> Steepest:
    wheel = vehicle.wheel
    shape, soils, _ = flat_soils(soil)
    angle, reason = kernels.steepest(
        across, wheel_layout(vehicle), vehicle.weight, soils, slip, wheel, wheel.max_torque
    )
    return Steepest(
        shaped(np.maximum(angle, 0.0), shape),
        (angle >= 0.0).reshape(shape)[()],
        reason.reshape(shape)[()],
    )


@dataclass(frozen=True, slots=True)
class Measure:
    """One thing that may bind.

    Attributes:
        reason: what it is.
        share: of its limit, numbers or arrays, not NaN; infinity where nothing would help.
        go: up to this share it is go.
        strict: whether the limit itself is no-go.
    """

    reason: Reason
    share: Any
    go: float
    strict: bool = False


@dataclass(frozen=True, slots=True)
class Classes:
    """What follows from measures, in the shape that they broadcast to.

    Attributes:
        verdict: uint8 `Verdict`.
        reason: uint8 `Reason`, of the measure that binds most.
        utilisation: the largest share that any measure takes of its limit.
    """

    verdict: NDArray[np.uint8] | np.uint8
    reason: NDArray[np.uint8] | np.uint8
    utilisation: Numbers


def classify(measures: Sequence[Measure]) -> Classes:
    """The worst verdict of measures, and the one that binds: of those the largest share."""
    shape, shares = flat(*(measure.share for measure in measures))
    verdict, reason, utilisation = kernels.judge(
        np.stack(shares),
        np.array([measure.go for measure in measures], np.float64),
        np.array([measure.strict for measure in measures], np.bool_),
        np.array([measure.reason for measure in measures], np.uint8),
    )
    return Classes(
        verdict.reshape(shape)[()], reason.reshape(shape)[()], shaped(utilisation, shape)
    )


def slip_limit(vehicle: Vehicle) -> float:
    """The slip that is no-go: where caution ends, or the wheel's largest slip if that is less."""
    return min(vehicle.wheel.max_slip, vehicle.thresholds.caution_slip)


def wheel_measures(vehicle: Vehicle, need: Demand) -> tuple[Measure, ...]:
    """What a wheel may fail by: traction U < 1, slip, torque ≤ Tmax, sinkage < r."""
    limits = vehicle.thresholds
    slip = slip_limit(vehicle)
    return (
        Measure(Reason.TRACTION, need.utilisation, limits.utilisation, True),
        Measure(Reason.SLIP, np.divide(need.slip, slip), limits.slip / slip, True),
        Measure(Reason.TORQUE, torque_share(need.torque, vehicle.wheel.max_torque), limits.torque),
        Measure(
            Reason.SINKAGE, np.divide(need.sinkage, vehicle.wheel.radius), limits.geometry, True
        ),
    )  # fmt: skip


def torque_share(torque: Any, max_torque: float) -> Numbers:
    """|T|/Tmax; 0 where no torque is needed, infinity where there is none to give it."""
    size = np.abs(np.asarray(torque, np.float64))
    share = np.full_like(size, np.inf)
    if max_torque > 0.0:
        share = size / max_torque
    return np.where(size == 0.0, 0.0, share)[()]


def limit_share(value: Any, limit: Any) -> Numbers:
    """The share that a size takes of a limit: 0 where it is 0 or less, infinity beyond no limit."""
    sizes, limits = np.broadcast_arrays(
        np.asarray(value, np.float64), np.asarray(limit, np.float64)
    )
    share = np.full(sizes.shape, np.inf)
    np.divide(sizes, limits, out=share, where=limits > 0.0)
    return np.where(sizes <= 0.0, 0.0, share)[()]
