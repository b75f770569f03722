"""Turning on the spot: its resistance, its work, and whether the motors suffice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from terratool.kernels import traversability as kernels
from terratool.traversability.limits import wheel_layout, wheel_loads
from terratool.traversability.vehicle import Soil, Vehicle
from terratool.traversability.verdicts import Reason
from terratool.traversability.wheel import towed_resistance, under_wheels


@dataclass(frozen=True, slots=True)
class Turning:
    """Turning on the spot by a radian, on level ground.

    Where the vehicle cannot turn, figures are the largest that are reached.

    Attributes:
        resistance: moment that resists, N m, of skidding and rolling.
        skidding: moment of skidding alone, N m.
        work: work of the wheels, J; more than `resistance` by the slip of their treads.
        run: length that the outermost treads run, m.
        slip: slip of the outermost treads.
        torque: largest torque of a wheel, N m.
        reason: measure that forbids turning; NONE where the vehicle can turn.
    """

    resistance: float = 0.0
    skidding: float = 0.0
    work: float = 0.0
    run: float = 0.0
    slip: float = 0.0
    torque: float = 0.0
    reason: Reason = Reason.NONE

    @property
    def possible(self) -> bool:
        """Whether the vehicle can turn."""
        return self.reason == Reason.NONE


def turn_on_spot(vehicle: Vehicle, soil: Soil) -> Turning:
    """Turn a vehicle on the spot, on level ground of one soil.

    A vehicle that skids: the treads of its left and right wheels run against each other at one
    speed. The grip of a wheel, S = C + W μ, acts against the direction in which its contact
    slides, and its share A is mobilised by the sliding x = (sliding/tread speed) X. With
    a push F and a force H sideways, F² + H² = (A S)²: one circle of friction. The slip of the
    treads is the least with which Σ F y = Σ H |x − c| + Σ R y, c the place where Σ H is in balance.
    A motor that is too weak lets its wheel push less. On rigid ground with two axles and equal
    loads that is Σ H |x − c| = (μ W L/2) B/√(B² + L²) and a slip of L²/(B² + L²).

    Wheels that are turned into their ways only roll: Σ R √(x² + y²) about the middle. Feet are
    lifted and set anew, and do neither.

    Returns:
        The turning by a radian; a wheel by itself turns without resistance.
    """
    if vehicle.is_single:
        return Turning()
    if vehicle.turning_radius:
        return Turning(reason=Reason.TURNING)  # it never does
    layout = wheel_layout(vehicle)
    if vehicle.steering == "wheels" or vehicle.feet:
        loads = wheel_loads(vehicle)
        away = np.hypot(layout.x - vehicle.middle, layout.y)
        factors = soil.factors or (1.0,) * len(loads)
        rolling = [
            float(towed_resistance(load, replace(soil, sinkage=soil.sinkage * factor), wheel))
            for wheel, load, factor in zip(vehicle.all_wheels, loads, factors, strict=True)
        ]
        moment = float(np.dot(rolling, away))
        torque = max(
            force * radius for force, radius in zip(rolling, layout.wheels.radius, strict=True)
        )
        return Turning(moment, 0.0, moment, float(away.max()), 0.0, float(torque))
    found = kernels.turn_on_spot(
        layout, layout.x, layout.y, vehicle.weight, under_wheels(soil), vehicle.wheel.max_slip
    )
    return Turning(**{**found, "reason": Reason(found["reason"])})
