"""Kernels: what the slope under a vehicle and the soil under its wheels ask of it.

The same numbers are wanted for every pixel and heading, and take some ten microseconds. So for each
soil they are tabulated by slope, and interpolated where all wheels stand on the same.
"""

from __future__ import annotations

import math

import numpy as np

from terratool.traversability.terramechanics.kernels import (
    contact,
    drive,
    gravity,
    grip,
    kernel,
    mobilised,
    pulls,
    resistances,
    tip_reserve,
    tipping,
    wheel_loads,
)

SHARE, TORQUE, SLIP, ENERGY, DRAWBAR, DEEPEST, SLIDING, TIPPING, RESERVE = range(9)
"""Numbers of a `stand`."""
NUMBERS = 9
SMOOTH = 0.08
"""Numbers are not interpolated where shares or slips differ by more between neighbours."""

_STEEP = math.radians(89.9)

STEPS = 50
"""Of a table for a tangent of 1 …"""
STEEPEST = 1.0
"""… up to which it goes, ahead both ways, and to the sides, which are alike."""


@kernel
def share_of(size, limit):
    """The share that a size takes of a limit."""
    if size <= 0.0:
        return 0.0
    return size / limit if limit > 0.0 else math.inf


@kernel
def _upright(angle):
    """An angle that has a tangent."""
    return min(max(angle, -_STEEP), _STEEP)


@kernel
def _sink(vehicle, load, cohesion, tan_friction, rate, half):
    """Fill `half` (wheels,); how deep the wheels sink at most, m, and what holds them, N."""
    deepest, held = 0.0, 0.0
    for n in range(len(load)):
        sinkage, half[n] = contact(load[n], rate[n], vehicle.radius)
        deepest = max(deepest, sinkage)
        held += grip(load[n], half[n], cohesion[n], tan_friction[n], vehicle.radius, vehicle.width)
    return deepest, held


@kernel
def stand(vehicle, along, across, soils, under, load, half, out):
    """A vehicle on a plane slope.

    Args:
        vehicle: `vehicles.Numbers`.
        along: tangent of the slope where it heads.
        across: and to its left.
        soils: (surfaces + 1, 5) float64: cohesion (Pa; NaN for a soil that is not known), tan φ,
            sinkage (m/N), shear modulus (m; 0 for none), highest step (m).
        under: (wheels,) rows of `soils`.
        load: (wheels,) float64, scratch.
        half: likewise.
        out: (NUMBERS,) float64: share of the soil's strength; torque of a wheel, N m; slip (0
            where it is not known); energy for a metre of ground, J; drawbar pull that is left, N;
            deepest sinkage, m; shares of the slopes on which it slides and tips over; how much more
            it may lean until it tips over, rad.
    """
    v = vehicle
    cohesion, tan_friction = soils[:, 0][under], soils[:, 1][under]
    rate, modulus = soils[:, 2][under], soils[:, 3][under]
    forward, left, down = gravity(along, across)
    wheel_loads(v.shares, v.weight, forward, left, down, load)
    deepest, held = _sink(v, load, cohesion, tan_friction, rate, half)
    pull = -v.weight * forward
    share, torque, slip, torques = drive(
        load, half, cohesion, tan_friction, modulus, v.driven, pull,
        v.radius, v.width, v.max_torque,
    )  # fmt: skip
    moves = share < 1.0 and slip < 1.0 and torque <= v.max_torque
    out[ENERGY] = max(0.0, torques) / (v.radius * (1.0 - slip)) if moves else math.inf
    mobile, tilt_along, tilt_across = 1.0, along, across
    for n in range(len(load)):
        tilt_along -= v.fit_along[n] * rate[n] * load[n]
        tilt_across -= v.fit_across[n] * rate[n] * load[n]
        if v.driven[n]:
            mobile = min(mobile, mobilised(half[n], v.radius, modulus[n], v.max_slip))
    pushed, _ = pulls(
        load, half, cohesion, tan_friction, v.driven, mobile, v.radius, v.width, v.max_torque
    )
    out[DRAWBAR], out[DEEPEST] = pushed - resistances(load, half, v.driven) - pull, deepest
    slope = math.hypot(along, across)
    if v.slope_margin > 0.0:
        # what it must be able to do is that on slopes steeper by so much
        steeper = math.atan(along) + v.slope_margin * (1.0 if along >= 0.0 else -1.0)
        forward, left, down = gravity(math.tan(_upright(steeper)), across)
        wheel_loads(v.shares, v.weight, forward, left, down, load)
        _sink(v, load, cohesion, tan_friction, rate, half)
        share, torque, slip, _ = drive(
            load, half, cohesion, tan_friction, modulus, v.driven, -v.weight * forward,
            v.radius, v.width, v.max_torque,
        )  # fmt: skip
        steepest = math.tan(_upright(math.atan(slope) + v.slope_margin))
        east, north = (along / slope, across / slope) if slope > 0.0 else (0.0, 1.0)
        forward, left, down = gravity(steepest * east, steepest * north)
        wheel_loads(v.shares, v.weight, forward, left, down, load)
        _, held = _sink(v, load, cohesion, tan_friction, rate, half)
        slope = steepest
    out[SHARE], out[TORQUE], out[SLIP] = share, torque, slip
    out[SLIDING] = share_of(v.weight * math.sin(math.atan(slope)), held)
    forward, left, down = gravity(tilt_along, tilt_across)
    out[TIPPING] = tipping(v.edges, forward, left, down)
    out[RESERVE] = tip_reserve(v.edges, forward, left, down)


@kernel
def tabulate(vehicle, soils, soil, out):
    """Fill the table of a soil: (2·n + 1, n + 1, NUMBERS), n = STEPS·STEEPEST, by tangents."""
    count = len(vehicle.shares)
    load, half, under = np.empty(count), np.empty(count), np.full(count, soil)
    middle = len(out) // 2
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            stand(vehicle, (i - middle) / STEPS, j / STEPS, soils, under, load, half, out[i, j])


@kernel
def _kind(number, max_torque):
    """Whether a vehicle moves (1), does not (0), or what it would take is not finite (-1)."""
    if number[SHARE] < 1.0 and number[SLIP] < 1.0 and number[TORQUE] <= max_torque:
        return 1
    total = number[SHARE] + number[TORQUE] + number[SLIDING] + number[TIPPING]
    return 0 if abs(total) < math.inf else -1


@kernel
def looked_up(vehicle, table, along, across, out):
    """Interpolate between slopes; False where that would be none.

    That is where limits lie in between, or where soil's strength and slip change much.
    """
    x, y = (along + STEEPEST) * STEPS, abs(across) * STEPS
    if not (0.0 <= x < table.shape[0] - 1 and y < table.shape[1] - 1):
        return False
    i, j = int(x), int(y)
    s, t = x - i, y - j
    one, two, three, four = table[i, j], table[i, j + 1], table[i + 1, j], table[i + 1, j + 1]
    kind = _kind(one, vehicle.max_torque)
    if kind < 0 or not (
        _kind(two, vehicle.max_torque) == kind
        and _kind(three, vehicle.max_torque) == kind
        and _kind(four, vehicle.max_torque) == kind
    ):
        return False
    if kind == 1:
        for n in (SHARE, SLIP):
            least = min(min(one[n], two[n]), min(three[n], four[n]))
            most = max(max(one[n], two[n]), max(three[n], four[n]))
            if most - least > SMOOTH:
                return False
    for n in range(NUMBERS):
        low = one[n] + (two[n] - one[n]) * t if t > 0.0 else one[n]
        high = three[n] + (four[n] - three[n]) * t if t > 0.0 else three[n]
        out[n] = low + (high - low) * s if s > 0.0 else low
    if kind == 0:
        out[ENERGY] = math.inf
        if not out[SLIP] < math.inf:
            out[SLIP] = math.inf
    return True
