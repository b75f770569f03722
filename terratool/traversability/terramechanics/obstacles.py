"""Steps, gaps and crests: what a vehicle's shape gets over. Broadcast over arrays; SI units.

Derived from the statics of a rigid wheel at an edge, unless said otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from terratool.traversability.terramechanics.arrays import Numbers
from terratool.traversability.terramechanics.loads import wheel_layout
from terratool.traversability.types import Overhang, Vehicle

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
