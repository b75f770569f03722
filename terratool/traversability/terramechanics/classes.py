"""Go, caution or no-go, from the share that each measure takes of its limit.

A share of 1 is the limit; up to which share it is go is one of the vehicle's `Thresholds`. These
functions say what the shares are; `classify` what follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.traversability.results import Reason
from terratool.traversability.terramechanics.arrays import Numbers, flat, shaped
from terratool.traversability.terramechanics.demand import Demand
from terratool.traversability.types import Vehicle


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
