"""The steepest slopes of a vehicle, straight up and straight across: the kernels of `slopes`."""

from __future__ import annotations

import math

import numpy as np

from terratool.traversability.results import Reason
from terratool.traversability.terramechanics.kernels import (
    contact,
    gravity,
    grip,
    kernel,
    mobilised,
    pulls,
    resistances,
    wheel_loads,
)

_TRACTION = int(Reason.TRACTION)
_TORQUE = int(Reason.TORQUE)
_SLIP = int(Reason.SLIP)
_SINKAGE = int(Reason.SINKAGE)
_SIDE_SLIP = int(Reason.SIDE_SLIP)
_TIP_OVER = int(Reason.TIP_OVER)

_STEP = math.radians(0.25)  # roots are looked for in steps, and then between two
_HALVINGS = 50
UPRIGHT = math.radians(89.99)


@kernel
def climb_reserve(
    angle, shares, driven, weight, cohesion, tan_friction, rate, modulus, slip,
    radius, width, max_torque,
):  # fmt: skip
    """What its wheels can push beyond what a slope asks for, N, and what limits them."""
    count = len(shares)
    load, half = np.empty(count), np.empty(count)
    forward, left, down = gravity(math.tan(angle), 0.0)
    if wheel_loads(shares, weight, forward, left, down, load):
        return -math.inf, _TIP_OVER
    share = 1.0
    for n in range(count):
        sinkage, half[n] = contact(load[n], rate, radius)
        if sinkage >= radius:
            return -math.inf, _SINKAGE
        if driven[n]:
            share = min(share, mobilised(half[n], radius, modulus, slip))
    pushed, motor = pulls(
        load, half, np.full(count, cohesion), np.full(count, tan_friction), driven, share,
        radius, width, max_torque,
    )  # fmt: skip
    reserve = pushed - resistances(load, half, driven) + weight * forward
    return reserve, _TORQUE if motor else _SLIP if share < 1.0 else _TRACTION


@kernel
def cross_reserve(angle, shares, weight, cohesion, tan_friction, rate, radius, width):
    """What holds its wheels beyond what pulls them down a slope, N, and what limits them."""
    load = np.empty(len(shares))
    forward, left, down = gravity(0.0, math.tan(angle))
    wheel_loads(shares, weight, forward, left, down, load)
    held = 0.0
    for n in range(len(load)):
        sinkage, half = contact(load[n], rate, radius)
        if sinkage >= radius:
            return -math.inf, _SINKAGE
        held += grip(load[n], half, cohesion, tan_friction, radius, width)
    return held + weight * left, _SIDE_SLIP


@kernel
def steepest(
    across, shares, driven, weight, cohesion, tan_friction, rate, modulus, slip,
    radius, width, max_torque, out,
):  # fmt: skip
    """For each soil (n,) the largest slope and what limits it, (n, 2).

    -1 where it cannot even be on the level. The first root going up counts: beyond it none does.
    """
    for n in range(len(out)):
        low, high, done, limit = 0.0, 0.0, False, 0
        halvings = 0
        while halvings < _HALVINGS:
            if across:
                reserve, why = cross_reserve(
                    high, shares, weight, cohesion[n], tan_friction[n], rate[n], radius, width
                )
            else:
                reserve, why = climb_reserve(
                    high, shares, driven, weight, cohesion[n], tan_friction[n], rate[n],
                    modulus[n], slip, radius, width, max_torque,
                )  # fmt: skip
            good = reserve > 0.0
            if not good:
                limit, top, done = why, high, True
                if high == 0.0:
                    low = -1.0
                    break
            else:
                low = high
            if done:
                halvings += 1
                high = 0.5 * (low + top)
            elif high >= UPRIGHT:
                break
            else:
                high = min(high + _STEP, UPRIGHT)
        out[n, 0], out[n, 1] = low, limit
