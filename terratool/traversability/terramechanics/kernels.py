"""Wheel and soil, number by number: each formula of the model stands here, and only here.

The model is that of Iagnemma, Shibly and Dubowsky, "On-line terrain parameter estimation for
planetary rovers", ICRA 2002: a rigid wheel enters the soil at the angle θ1 = 2h from the downward
vertical and leaves it at 0; normal stress σ and shear stress τ rise and fall linearly with their
peaks in the middle, at h. Slip mobilises strength as in Janosi and Hanamoto 1961.

Everything is in N, m, Pa and rad. `tan_friction` is tan φ, `modulus` K (0 where it is not known:
all strength is mobilised whatever the slip). Ground into which a wheel sinks less than `RIGID` is
rigid: h = 0, and only friction acts. Of wheels that sink deeper than to their axles the model says
nothing; forces are then those at that depth, h = π/4.
"""

from __future__ import annotations

import math

from numba import njit

from terratool.traversability.results import Verdict

GO, CAUTION, NO_GO = int(Verdict.GO), int(Verdict.CAUTION), int(Verdict.NO_GO)
RIGID = 1e-6
"""m of sinkage below which ground is rigid."""
_ENOUGH = 1e-13  # relative accuracy of roots
_STEPS = 100

kernel = njit(cache=True, nogil=True, error_model="numpy")


@kernel
def contact(load, rate, radius):
    """Sinkage z = k·W, and half of the entry angle, h: sin h = √(z/D)."""
    sinkage = rate * load
    if sinkage < RIGID:
        return 0.0, 0.0
    return sinkage, math.asin(math.sqrt(min(sinkage / (2.0 * radius), 0.5)))


@kernel
def effective_area(half, radius, width):
    """Q, m²: W = Q (σm cos h + τm sin h) and DP = Q (τm cos h − σm sin h)."""
    if half == 0.0:
        return 0.0
    return 4.0 * radius * width * math.sin(0.5 * half) ** 2 / half


@kernel
def shear_displacement(half, radius, slip):
    """Displacement j at the peak, m: r [h − (1 − s)(sin θ1 − sin h)]."""
    return radius * (half - (1.0 - slip) * (math.sin(2.0 * half) - math.sin(half)))


@kernel
def mobilised(half, radius, modulus, slip):
    """A = 1 − exp(−j/K), the share of the strength that slip mobilises; 1 where K is not known."""
    if modulus == 0.0 or half == 0.0:
        return 1.0
    return -math.expm1(-max(shear_displacement(half, radius, slip), 0.0) / modulus)


@kernel
def slip_for(half, radius, modulus, utilisation):
    """Slip s that mobilises a share of the strength; above 1 where no slip does.

    0 where K is not known, and on rigid ground, whatever the share.
    """
    if modulus == 0.0 or half == 0.0:
        return 0.0
    if utilisation >= 1.0:
        return math.inf
    displacement = -modulus * math.log1p(-max(utilisation, 0.0))
    arc = math.sin(2.0 * half) - math.sin(half)
    return max(0.0, 1.0 - (half - displacement / radius) / arc)


@kernel
def stresses(load, area, half, cohesion, tan_friction, share):
    """σm and τm where a share of the strength acts: τm = A (c + σm tan φ), and W is borne.

    Where cohesion alone would bear more than W, no more of it acts than that: σm is not below 0.
    """
    sine, cosine = math.sin(half), math.cos(half)
    normal = load / area - share * cohesion * sine
    if normal <= 0.0:
        return 0.0, load / (area * sine)
    normal /= cosine + share * tan_friction * sine
    return normal, share * (cohesion + normal * tan_friction)


@kernel
def torque_of(shear, half, radius, width):
    """T = ½ r² b θ1 τm, N m."""
    return radius * radius * width * half * shear


@kernel
def stresses_under(load, torque, area, half, radius, width):
    """σm and τm from the load and the torque: τm = 2 T/(r² b θ1), σm = (W/Q − τm sin h)/cos h."""
    shear = torque / (radius * radius * width * half)
    return (load / area - shear * math.sin(half)) / math.cos(half), shear


@kernel
def forces(normal, shear, area, half):
    """W = Q (σm cos h + τm sin h); of DP, thrust Q τm cos h and resistance Q σm sin h; N."""
    sine, cosine = math.sin(half), math.cos(half)
    load = area * (normal * cosine + shear * sine)
    return load, area * shear * cosine, area * normal * sine


@kernel
def towed(load, half):
    """What a wheel without torque resists: R = W tan h, N."""
    return load * math.tan(half)


@kernel
def traction(load, half, cohesion, tan_friction, share, radius, width, max_torque):
    """A driven wheel at its limit, of a share of the soil's strength or of its motor.

    Returns:
        σm and τm (0 on rigid ground), thrust, resistance and drawbar pull (N), torque (N m), and
        whether it is the motor that limits.
    """
    if half == 0.0 or load == 0.0:
        thrust = load * tan_friction * share
        motor = max_torque < radius * thrust
        if motor:
            thrust = max_torque / radius
        return 0.0, 0.0, thrust, 0.0, thrust, radius * thrust, motor
    area = effective_area(half, radius, width)
    normal, shear = stresses(load, area, half, cohesion, tan_friction, share)
    torque = torque_of(shear, half, radius, width)
    motor = max_torque < torque
    if motor:
        torque = max_torque
        normal, shear = stresses_under(load, torque, area, half, radius, width)
    _, thrust, resistance = forces(normal, shear, area, half)
    return normal, shear, thrust, resistance, thrust - resistance, torque, motor


@kernel
def demand(load, half, cohesion, tan_friction, pull, radius, width):
    """What a wheel that pushes with `pull` asks of motor and soil; below 0 it is held back.

    Returns:
        torque (N m, below 0 for a brake), and the share U of the soil's strength: 1 and more is
        immobile, infinity where no strength would do.
    """
    if half == 0.0 or load == 0.0:
        strength = load * tan_friction
        torque = radius * pull
        if pull == 0.0:
            return torque, 0.0
        return torque, abs(pull) / strength if strength > 0.0 else math.inf
    sine, cosine = math.sin(half), math.cos(half)
    area = effective_area(half, radius, width)
    along = pull * cosine + load * sine
    across = load * cosine - pull * sine
    torque = radius * along * (0.5 * half / math.sin(0.5 * half)) ** 2
    if along == 0.0:
        return torque, 0.0
    strength = cohesion + across / area * tan_friction
    if across < 0.0 or strength <= 0.0:
        return torque, math.inf
    return torque, abs(along) / area / strength


@kernel
def grip(load, half, cohesion, tan_friction, radius, width):
    """What holds a wheel that does not turn: c b l + W tan φ, l = r sin θ1, N."""
    return cohesion * width * radius * math.sin(2.0 * half) + load * tan_friction


@kernel
def pulls(load, half, cohesion, tan_friction, driven, share, radius, width, max_torque):
    """Drawbar pull of all driven wheels (n,) at a share of strength, N, and if a motor limits."""
    total, motor = 0.0, False
    for n in range(len(load)):
        if driven[n]:
            wheel = traction(
                load[n], half[n], cohesion[n], tan_friction[n], share, radius, width, max_torque
            )
            total += wheel[4]
            motor = motor or wheel[6]
    return total, motor


@kernel
def resistances(load, half, driven):
    """What all wheels that are not driven resist, N."""
    total = 0.0
    for n in range(len(load)):
        if not driven[n]:
            total += towed(load[n], half[n])
    return total


@kernel
def common_share(load, half, cohesion, tan_friction, driven, pull, radius, width, max_torque):
    """The share of strength at which all driven wheels together push with `pull`; or infinity."""
    low, high = 0.0, 1.0
    under = pull - pulls(
        load, half, cohesion, tan_friction, driven, low, radius, width, max_torque
    )[0]  # fmt: skip
    if under <= 0.0:
        return 0.0
    over = 0.0
    for _ in range(12):
        over = pull - pulls(
            load, half, cohesion, tan_friction, driven, high, radius, width, max_torque
        )[0]  # fmt: skip
        if over <= 0.0:
            break
        low, under, high = high, over, 2.0 * high
    if over > 0.0:
        return math.inf
    side = 0
    for _ in range(_STEPS):  # false position; the end that stays has its weight halved
        middle = (low * over - high * under) / (over - under)
        if high - low <= _ENOUGH * high:
            break
        value = pull - pulls(
            load, half, cohesion, tan_friction, driven, middle, radius, width, max_torque
        )[0]  # fmt: skip
        if abs(value) <= _ENOUGH * abs(pull):
            return middle
        if value > 0.0:
            low, under = middle, value
            if side == 1:
                over *= 0.5
            side = 1
        else:
            high, over = middle, value
            if side == -1:
                under *= 0.5
            side = -1
    return high


@kernel
def drive(
    load, half, cohesion, tan_friction, modulus, driven, pull, radius, width, max_torque
):  # fmt: skip
    """What it asks of a vehicle's wheels (n,) to push with `pull`, and what the towed ones resist.

    The driven wheels share it so that each uses the same share U of its soil's strength; a wheel
    at its motor's limit leaves the rest to the others. To be held back (`pull` below what the
    wheels resist by themselves) each takes its part by load.

    Returns:
        U; the largest torque of a wheel (N m; beyond `max_torque` where motors are too weak for
        it); the largest slip (0 where no K is known); the sum of the torques (N m).
    """
    total = pull + resistances(load, half, driven)
    free = pulls(load, half, cohesion, tan_friction, driven, 0.0, radius, width, math.inf)[0]
    worst, torque, slip, torques = 0.0, 0.0, 0.0, 0.0
    if total < free:
        borne = 0.0
        for n in range(len(load)):
            if driven[n]:
                borne += load[n]
        for n in range(len(load)):
            if driven[n] and borne > 0.0:
                wheel = demand(
                    load[n], half[n], cohesion[n], tan_friction[n], total * load[n] / borne,
                    radius, width,
                )  # fmt: skip
                worst = max(worst, wheel[1])
                torque = max(torque, abs(wheel[0]))
                torques += wheel[0]
        return worst if borne > 0.0 else math.inf, torque, slip, torques
    share = common_share(load, half, cohesion, tan_friction, driven, total, radius, width, math.inf)
    limit = math.inf
    for attempt in range(2):
        acting = min(share, 1.0)
        torque, slip, torques = 0.0, 0.0, 0.0
        for n in range(len(load)):
            if driven[n]:
                wheel = traction(
                    load[n], half[n], cohesion[n], tan_friction[n], acting, radius, width, limit
                )
                torque = max(torque, wheel[5])
                torques += wheel[5]
                if load[n] > 0.0:
                    slip = max(slip, slip_for(half[n], radius, modulus[n], share))
        if torque <= max_torque or attempt == 1 or share >= 1.0:
            break
        helped = common_share(
            load, half, cohesion, tan_friction, driven, total, radius, width, max_torque
        )
        if helped >= 1.0:
            break
        share, limit = helped, max_torque
    return share, torque, slip, torques


@kernel
def gravity(along, across):
    """Direction of gravity as the body has it: its parts forward, to the left, and down.

    The body stands on a plane that rises by `along` (a tangent) where it heads and by `across` to
    its left.
    """
    forward = math.sqrt(1.0 + along * along)
    normal = math.sqrt(1.0 + along * along + across * across)
    return -along / forward, -across / (normal * forward), 1.0 / normal


@kernel
def wheel_loads(shares, weight, forward, left, down, out):
    """Loads of all wheels (n,), N, from `loads.Layout.shares`; whether one would be pulled up.

    Such a wheel bears nothing, and the others as much as there is.
    """
    total, lifted = 0.0, False
    for n in range(len(shares)):
        load = weight * (shares[n, 0] * down + shares[n, 1] * forward + shares[n, 2] * left)
        if load < 0.0:
            load, lifted = 0.0, True
        out[n] = load
        total += load
    if lifted and total > 0.0:
        for n in range(len(shares)):
            out[n] *= weight * down / total
    return lifted


@kernel
def tipping(edges, forward, left, down):
    """The share of a tip-over angle that is used, of the edge that is nearest to tipping.

    `edges` (m, 3): the direction of each edge of the supports, forward and to the left, and the
    angle about it at which it tips over, less what is kept in reserve. 1 tips over.
    """
    worst = 0.0
    for n in range(len(edges)):
        towards = edges[n, 0] * forward + edges[n, 1] * left
        if towards > 0.0:
            limit = edges[n, 2]
            angle = math.atan2(towards, down)
            worst = max(worst, angle / limit if limit > 0.0 else math.inf)
    return worst


@kernel
def tip_reserve(edges, forward, left, down):
    """How much more it may lean until it tips over the nearest edge of `tipping`, rad.

    π where there is none.
    """
    least = math.pi
    for n in range(len(edges)):
        towards = edges[n, 0] * forward + edges[n, 1] * left
        least = min(least, edges[n, 2] - math.atan2(towards, down))
    return least


@kernel
def judge(verdict, reason, worst, share, go, strict, why):
    """Verdict, reason and share after one more measure, the worst of all so far.

    Go up to the share `go` of its limit, caution up to 1 (below 1 if it is `strict`), then no-go.
    Of measures of one verdict the one that takes the largest share counts.
    """
    if share > 1.0 or (strict and share >= 1.0):
        found = NO_GO
    elif share >= go:
        found = CAUTION
    else:
        found = GO
    if found > verdict or (found == verdict and share > worst):
        reason = why
    return max(verdict, found), reason, max(worst, share)
