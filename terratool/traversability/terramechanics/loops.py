"""The formulas of `kernels` over flat arrays: what `wheel`, `demand` and `slopes` call."""

from __future__ import annotations

from terratool.traversability.terramechanics.kernels import (
    contact,
    demand,
    effective_area,
    forces,
    grip,
    judge,
    kernel,
    mobilised,
    shear_displacement,
    slip_for,
    stresses_under,
    torque_of,
    towed,
    traction,
)


@kernel
def contacts(load, rate, radius, width, out):
    """(n, 3): sinkage, half angle, effective area."""
    for n in range(len(load)):
        out[n, 0], out[n, 1] = contact(load[n], rate[n], radius)
        out[n, 2] = effective_area(out[n, 1], radius, width)


@kernel
def mobilisations(half, modulus, slip, radius, out):
    """(n, 2): shear displacement, share of the strength that is mobilised."""
    for n in range(len(half)):
        out[n, 0] = shear_displacement(half[n], radius, slip[n])
        out[n, 1] = mobilised(half[n], radius, modulus[n], slip[n])


@kernel
def tractions(
    load, cohesion, tan_friction, rate, modulus, slip, max_torque, radius, width, out
):  # fmt: skip
    """(n, 8): the share mobilised, then what `traction` gives."""
    for n in range(len(load)):
        half = contact(load[n], rate[n], radius)[1]
        share = mobilised(half, radius, modulus[n], slip[n])
        found = traction(
            load[n], half, cohesion[n], tan_friction[n], share, radius, width, max_torque[n]
        )
        out[n, 0] = share
        out[n, 1], out[n, 2], out[n, 3], out[n, 4], out[n, 5], out[n, 6], out[n, 7] = found


@kernel
def demands(load, cohesion, tan_friction, rate, modulus, pull, radius, width, out):
    """(n, 4): torque, share of the strength, slip, sinkage."""
    for n in range(len(load)):
        sinkage, half = contact(load[n], rate[n], radius)
        torque, used = demand(load[n], half, cohesion[n], tan_friction[n], pull[n], radius, width)
        out[n, 0], out[n, 1], out[n, 3] = torque, used, sinkage
        # a wheel that is held back is not said to slip
        out[n, 2] = slip_for(half, radius, modulus[n], used if torque > 0.0 or used >= 1.0 else 0.0)


@kernel
def towing(load, rate, radius, out):
    """(n,) resistance of a wheel without torque."""
    for n in range(len(load)):
        out[n] = towed(load[n], contact(load[n], rate[n], radius)[1])


@kernel
def grips(load, cohesion, tan_friction, rate, radius, width, out):
    """(n,) what holds a wheel that does not turn."""
    for n in range(len(load)):
        half = contact(load[n], rate[n], radius)[1]
        out[n] = grip(load[n], half, cohesion[n], tan_friction[n], radius, width)


@kernel
def measured_forces(normal, shear, half, radius, width, out):
    """(n, 3): load, torque, drawbar pull."""
    for n in range(len(half)):
        area = effective_area(half[n], radius, width)
        load, thrust, resistance = forces(normal[n], shear[n], area, half[n])
        out[n, 0], out[n, 2] = load, thrust - resistance
        out[n, 1] = torque_of(shear[n], half[n], radius, width)


@kernel
def measured_stresses(load, torque, half, radius, width, out):
    """(n, 2): normal and shear stress."""
    for n in range(len(half)):
        area = effective_area(half[n], radius, width)
        out[n, 0], out[n, 1] = stresses_under(load[n], torque[n], area, half[n], radius, width)


@kernel
def judgements(shares, go, strict, why, out):
    """(n, 3): verdict, reason and largest share of measures (m, n)."""
    for n in range(len(out)):
        verdict, reason, worst = 0, 0, 0.0
        for m in range(len(shares)):
            verdict, reason, worst = judge(
                verdict, reason, worst, shares[m, n], go[m], strict[m], why[m]
            )
        out[n, 0], out[n, 1], out[n, 2] = verdict, reason, worst
