"""The steepest slopes that a vehicle climbs and crosses, and what ends them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.traversability.terramechanics.arrays import Numbers, flat_soils, shaped
from terratool.traversability.terramechanics.loads import wheel_layout
from terratool.traversability.types import Soil, Vehicle


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
