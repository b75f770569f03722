"""Braking: how much wheels brake, stopping distances, and the speeds that these allow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.traversability.limits import wheel_layout
from terratool.traversability.map_results import Survey
from terratool.traversability.vehicle import Soil, Vehicle
from terratool.traversability.wheel import under_wheels

CRAWL = 0.01
"""Share of the speed at which a vehicle creeps where no speed lets it stop in time."""


@lru_cache(maxsize=256)  # each search for a route asks again
def braking(vehicle: Vehicle, soil: Soil) -> float:
    """Braking on level ground as a share of the weight: μ of v²/(2 g μ); 0 where nothing brakes.

    The driven wheels, the tracks or the feet brake, as far as their ground and their motors hold:
    the largest force B with B = Σ min(C + N μ, Tmax/r), and no axle lifted. N are the loads as B
    presses the vehicle forward, B h/L from the rear to the front axle of two. What the ground
    itself resists is left out. The least of the vehicle's loads counts.
    """
    ground = under_wheels(soil)
    return min(
        float(kernels.braking(wheel_layout(case), case.weight, ground)) for case in vehicle.cases
    )


def deceleration(friction: Any, gravity: float, pitch: Any = 0.0, roll: Any = 0.0) -> Any:
    """Deceleration of a vehicle that brakes, m/s²; 0 or less where it cannot stop.

    g (√((μ cos β)² − l²) + sin α), l being what pulls across as a share of the weight: along and
    across share one circle of friction. Straight downhill that is g (μ cos α − sin α).

    Args:
        friction: μ, the braking on the level as of `braking`; numbers or arrays that broadcast.
        gravity: acceleration of gravity, m/s².
        pitch: pitch α, rad, nose up is positive.
        roll: roll, rad, left side up is positive.
    """
    along, across = np.tan(pitch), np.tan(roll)
    ahead, normal = np.hypot(1.0, along), np.sqrt(1.0 + along**2 + across**2)
    hold = np.maximum((friction / normal) ** 2 - (across / (normal * ahead)) ** 2, 0.0)
    return gravity * (np.sqrt(hold) + along / ahead)


def stopping_distance(vehicle: Vehicle, slowing: Any) -> Any:
    """Distance to stop from the vehicle's speed, m: v t + v²/(2 a); infinity for a of 0 or less."""
    speed = vehicle.speed
    with np.errstate(divide="ignore"):
        run = np.where(np.asarray(slowing) > 0.0, 0.5 * speed**2 / np.maximum(slowing, 0.0), np.inf)
    return run + speed * vehicle.reaction_time


def allowed_speed(vehicle: Vehicle, slowing: Any) -> Any:
    """Largest speed from which the vehicle stops within its stopping distance d, m/s.

    −a t + √(a² t² + 2 a d), at most the vehicle's own speed; that where d is not limited; 0 for a
    deceleration a of 0 or less; NaN where that is NaN.
    """
    if not math.isfinite(vehicle.stopping_distance):
        return np.where(np.isnan(slowing), slowing, vehicle.speed)
    slowing = np.maximum(slowing, 0.0)
    late = slowing * vehicle.reaction_time
    speed = np.sqrt(late**2 + 2.0 * slowing * vehicle.stopping_distance) - late
    return np.minimum(speed, vehicle.speed)


def brakes_of(vehicle: Vehicle, soils: Sequence[Soil | None]) -> NDArray[np.float64]:
    """Braking on each surface, by id, (ids,) float64; NaN where the soil is not known."""
    return np.array([math.nan if soil is None else braking(vehicle, soil) for soil in soils])


def speeds(
    survey: Survey, vehicle: Vehicle, brakes: NDArray[np.float64], at: Any
) -> NDArray[np.float32] | float:
    """Speed of the treads at states of a survey, m/s: no more than stops in time, but `CRAWL`.

    The vehicle's own speed, as one number, where its stopping distance is not limited.

    Args:
        survey: the survey.
        vehicle: the vehicle.
        brakes: braking by id of the surface, which is that under the vehicle's middle.
        at: index of headings, rows and columns.
    """
    if not math.isfinite(vehicle.stopping_distance):
        return vehicle.speed
    ground = brakes[survey.surfaces[at[1:]]]
    slowing = deceleration(ground, vehicle.gravity, survey.pitch[at], survey.roll[at])
    allowed = np.nan_to_num(allowed_speed(vehicle, slowing), nan=vehicle.speed)
    return np.asarray(np.maximum(allowed, CRAWL * vehicle.speed), np.float32)
