"""A wheel on soil: contact, stresses, traction, and the demand of a push.

All functions take numbers, or arrays that broadcast together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.kernels import traversability as kernels
from terratool.report import numbers
from terratool.traversability.vehicle import Soil, Wheel

LARGEST = 1e30
"""Largest size, load or figure of a soil; 1/LARGEST is the smallest size or mass."""
STEEP_FRICTION = math.radians(50.0)
"""Friction angle above which a soil is unusual, rad."""
ERROR_BAND = math.radians(5.0)
"""Error of the slope that a wheel climbs on soft soil, rad, in the model `slip`: no measured wheel
that was left out of its fit has a larger RMS error; docs/validation.md."""
DEEP = 0.15
"""Largest z/D for which the model is accurate."""

Numbers = NDArray[np.float64] | np.float64
"""An array, or a NumPy number where all arguments are numbers."""


class SoilArrays(NamedTuple):
    """Figures of soils, (n,) float64 each, in the units of `Soil`; cohesion NaN is unknown soil."""

    cohesion: NDArray[np.float64]
    tan_friction: NDArray[np.float64]
    sinkage: NDArray[np.float64]
    shear_modulus: NDArray[np.float64]
    rolling: NDArray[np.float64]
    exponent: NDArray[np.float64]


def flatten(*values: Any) -> tuple[tuple[int, ...], list[NDArray[np.float64]]]:
    """Broadcast values together: their common shape, and each value as (n,) float64.

    Raises:
        ValueError: the shapes do not broadcast together.
    """
    arrays = np.broadcast_arrays(*(np.asarray(value, np.float64) for value in values))
    return arrays[0].shape, [np.ascontiguousarray(array).reshape(-1) for array in arrays]


def flatten_soils(
    soil: Soil, *values: Any
) -> tuple[tuple[int, ...], SoilArrays, list[NDArray[np.float64]]]:
    """Broadcast a soil and values together, as `flatten`: shape, soils, and the values."""
    shape, (cohesion, friction, sinkage, modulus, rolling, exponent, *others) = flatten(
        soil.cohesion,
        soil.friction,
        soil.sinkage,
        soil.shear_modulus,
        soil.rolling,
        soil.exponent,
        *values,
    )
    soils = SoilArrays(cohesion, np.tan(friction), sinkage, modulus, rolling, exponent)
    return shape, soils, others


def soil_numbers(soil: Soil) -> tuple[float, ...]:
    """Figures of a soil of numbers in the order of `SoilArrays`, without factors of k."""
    return (
        soil.cohesion, math.tan(soil.friction), soil.sinkage, soil.shear_modulus, soil.rolling,
        soil.exponent,
    )  # fmt: skip


def under_wheels(soil: Soil) -> SoilArrays:
    """A soil of numbers as arrays of one, or of one for each wheel if it has factors."""
    columns = np.array(soil_numbers(soil), np.float64)[:, None]
    if soil.factors is not None:
        columns = np.repeat(columns, len(soil.factors), axis=1)
        columns[2] *= soil.factors
    return SoilArrays(*columns)


def reshape(column: NDArray[np.float64], shape: tuple[int, ...]) -> Numbers:
    """Give a flat array its shape again; a number for the shape of a number."""
    return np.ascontiguousarray(column).reshape(shape)[()]


def reshape_members(records: NDArray[Any], shape: tuple[int, ...]) -> dict[str, Any]:
    """Fields of flat records by name, each in its shape again."""
    return {name: reshape(records[name], shape) for name in records.dtype.names or ()}


@dataclass(frozen=True, slots=True)
class Contact:
    """The contact of a wheel with the soil, in the shape that loads and soils broadcast to.

    Attributes:
        sinkage: sinkage z, m.
        entry_angle: angle θ1 at which the wheel enters the soil, rad, from the downward vertical.
        effective_area: Q, area on which the mean stresses act, m².
        length: length of the contact, m: 2 r sin θ0 at rest, and in the model `paper` r sin θ1.
        area: length times b, m²; 0 on rigid ground.
        pressure: mean pressure W/area, Pa; 0 where there is no area.
        shear_length: l, length along which the ground is sheared, m.
    """

    sinkage: Numbers
    entry_angle: Numbers
    effective_area: Numbers
    length: Numbers
    area: Numbers
    pressure: Numbers
    shear_length: Numbers


@dataclass(frozen=True, slots=True)
class Traction:
    """A driven wheel at its limit, in the shape that loads, soils and limits broadcast to.

    Attributes:
        mobilised: A, share of the strength that the slip mobilises.
        normal_stress: peak normal stress σm, Pa; 0 on rigid ground.
        shear_stress: peak shear stress τm, Pa; 0 on rigid ground.
        thrust: forward part of the shear stress, N.
        resistance: backward part of the normal stress, N.
        drawbar: DP, thrust less resistance, N.
        torque: torque of the wheel, N m.
        sinkage: sinkage at the slip, m.
        motor: whether the motor limits the thrust, not the soil.
    """

    mobilised: Numbers
    normal_stress: Numbers
    shear_stress: Numbers
    thrust: Numbers
    resistance: Numbers
    drawbar: Numbers
    torque: Numbers
    sinkage: Numbers
    motor: NDArray[np.bool_] | np.bool_


@dataclass(frozen=True, slots=True)
class Demand:
    """The demand of a wheel, in the shape that loads, soils and pulls broadcast to.

    Attributes:
        torque: torque, N m; below 0 where the wheel is held back.
        utilisation: share U of the soil's strength that is used: 1 and more is immobile,
            infinity where no strength would do.
        slip: slip s; above 1 is immobile. 0 where K is not known (the rule is A = 1), on rigid
            ground and for a wheel that is held back.
        sinkage: sinkage at that slip, m.
    """

    torque: Numbers
    utilisation: Numbers
    slip: Numbers
    sinkage: Numbers


TRACTION, DEMAND = (
    np.dtype(
        [(f.name, np.bool_ if f.name == "motor" else np.float64) for f in fields(kind)],
        align=True,
    )
    for kind in (Traction, Demand)
)
"""Types of records of `Traction` and `Demand`, as the kernels fill them."""

kernels.check_records(TRACTION, DEMAND)


def contact(load: Any, soil: Soil, wheel: Wheel, slip: Any = 0.0) -> Contact:
    """Sinkage and contact of a wheel, z = k W at rest: cos θ0 = 1 − z/r, and both halves bear.

    A wheel that slips by s digs itself in, to cos θ1 = 1 − z/r with θ1 = θ0 + f s √(GROWTH² +
    acos(r/(r + h))²), fitted to measured wheels. In the model `paper` z = k W, and the wheel
    touches the soil from θ1 to 0. z may exceed r; angles end at π/2. Q = 2 r b (1 − cos w)/w, w
    half of what the rim touches. l = `Wheel.shear_length`, or W/(b p) of a tyre if that is more.

    Args:
        load: load W, N.
        soil: numbers or arrays.
        wheel: a wheel.
        slip: slip s, from 0 to 1.
    """
    shape, (weights, rate, slips) = flatten(load, soil.sinkage, slip)
    sinkage, entry, effective, shear = kernels.contacts(weights, rate, slips, wheel).T
    length = (2.0 if wheel.slips else 1.0) * wheel.radius * np.sin(entry)
    area = length * wheel.width
    pressure = np.divide(weights, area, out=np.zeros_like(area), where=area > 0.0)
    return Contact(
        sinkage=reshape(sinkage, shape),
        entry_angle=reshape(entry, shape),
        effective_area=reshape(effective, shape),
        length=reshape(length, shape),
        area=reshape(area, shape),
        pressure=reshape(pressure, shape),
        shear_length=reshape(shear, shape),
    )


def traction(load: Any, soil: Soil, wheel: Wheel, slip: Any | None = None) -> Traction:
    """The traction of a driven wheel at a slip, its `max_slip` if None.

    Forces act at an angle θm: across the rim N = (W − A C sin θm)/(cos θm + A μ sin θm), along it
    S = A (C + N μ); DP = S cos θm − N sin θm, and T = S r. Friction μ, cohesive force C, the share
    A that slip mobilises and θm are those of kernels/traversability/terramechanics.hpp, which names
    their sources. In the model `paper` A = 1, μ = tan φ, C = c Q, θm = θ1/2 and T = S r w²/(2 (1 −
    cos w)) (Iagnemma, Shibly and Dubowsky 2002). σm = N/Q and τm = S/Q. A motor that is too weak
    for T gives S from its torque. N is never below 0: where cohesion alone would bear the wheel,
    only the part that bears the load acts.

    Returns:
        The wheel at its limit; no number is NaN.
    """
    shape, soils, (weights, slips, torque) = flatten_soils(
        soil, load, wheel.max_slip if slip is None else slip, wheel.max_torque
    )
    out = np.empty(len(weights), TRACTION)
    kernels.tractions(weights, soils, slips, torque, wheel, out)
    return Traction(**reshape_members(out, shape))


def towed_resistance(load: Any, soil: Soil, wheel: Wheel) -> Numbers:
    """Resistance of a wheel without torque, R = W tan θm and rolling, N."""
    shape, soils, (weights,) = flatten_soils(soil, load)
    return reshape(kernels.towing(weights, soils, wheel), shape)


def grip(load: Any, soil: Soil, wheel: Wheel, slip: Any = 1.0) -> Numbers:
    """Force that holds a wheel along and across together, A (C + W μ), N, at a slip.

    In the model `paper` it is c b r sin θ1 + W tan φ.
    """
    shape, soils, (weights, slips) = flatten_soils(soil, load, slip)
    return reshape(kernels.grips(weights, soils, slips, wheel), shape)


def side_force(load: Any, soil: Soil, wheel: Wheel, slip: Any, crab: Any) -> Numbers:
    """Force sideways, N, of a wheel that heads away from where it moves by a crab angle, rad.

    All that holds the wheel acts against the sliding q of its contact, s along and (1 − s) tan β
    across: q X/(q X + 2) (C + W μ) (1 − s) tan β/q.
    """
    shape, soils, (weights, slips, angles) = flatten_soils(soil, load, slip, crab)
    return reshape(kernels.side_forces(weights, soils, slips, angles, wheel), shape)


def softness(load: Any, soil: Soil, wheel: Wheel) -> Numbers:
    """Softness f = 1 − exp(−θ0/SOFT) of the ground under a wheel, 0 where it does not yield.

    It is 0 in the model `paper`, too.
    """
    shape, (weights, rate) = flatten(load, soil.sinkage)
    return reshape(kernels.softnesses(weights, rate, wheel), shape)


def forces_from(
    normal_stress: Any, shear_stress: Any, entry_angle: Any, wheel: Wheel
) -> tuple[Numbers, Numbers, Numbers]:
    """W, T and DP from peak stresses and θ1, above 0 (Iagnemma, Shibly and Dubowsky 2002).

    W = Q (σm cos θm + τm sin θm), DP = Q (τm cos θm − σm sin θm), T = ½ r² b (θ1 − θ2) τm.
    """
    shape, (normal, shear, entry) = flatten(normal_stress, shear_stress, entry_angle)
    load, torque, drawbar = kernels.measured_forces(normal, shear, entry, wheel).T
    return reshape(load, shape), reshape(torque, shape), reshape(drawbar, shape)


def stresses_from(
    load: Any, torque: Any, entry_angle: Any, wheel: Wheel
) -> tuple[Numbers, Numbers]:
    """Stresses σm and τm from measured W, T and θ1 > 0 of a wheel: the inverse of `forces_from`.

    τm = 2 T/(r² b (θ1 − θ2)), σm = (W/Q − τm sin θm)/cos θm.
    """
    shape, (weights, torques, entry) = flatten(load, torque, entry_angle)
    normal, shear = kernels.measured_stresses(weights, torques, entry, wheel).T
    return reshape(normal, shape), reshape(shear, shape)


def identify(normal_stress: Any, shear_stress: Any, mobilised: Any = 1.0) -> tuple[float, float]:
    """Cohesion (Pa) and friction angle (rad) from peak stresses, by least squares.

    The rows are [A, A σm]·[c, tan φ] = τm, as in Iagnemma, Shibly and Dubowsky 2002.

    Args:
        normal_stress: (n,) peak normal stresses σm, Pa.
        shear_stress: (n,) peak shear stresses τm, Pa.
        mobilised: (n,) or one A; 1 where all of the strength acts.

    Raises:
        RequestError: fewer than two different normal stresses, or a number that is not finite.
    """
    _, (normal, shear, share) = flatten(normal_stress, shear_stress, mobilised)
    if not np.isfinite([normal, shear, share]).all():
        raise RequestError(
            "A measured stress is not finite.", "Leave out measurements without a value."
        )
    scale = float(np.abs(normal).max(initial=0.0)) or 1.0  # columns of like size
    found, _, rank, _ = np.linalg.lstsq(np.stack([share, share * normal / scale], 1), shear)
    if rank < 2:
        raise RequestError(
            "Cohesion and friction cannot be told apart from these stresses.",
            "Measure at two or more different loads.",
        )
    return float(found[0]), math.atan(found[1] / scale)


def check(load: Any, soil: Soil, wheel: Wheel) -> None:
    """Refuse numbers for which the formulas do not hold.

    Raises:
        RequestError: a number is not finite, out of its range, or beyond 1e30 in size.
    """
    for name, value, words, low, inside in (
        ("wheel's radius", wheel.radius, "above 0", 1.0 / LARGEST, True),
        ("wheel's width", wheel.width, "above 0", 1.0 / LARGEST, True),
        ("load", load, "0 or more", 0.0, True),
        ("cohesion", soil.cohesion, "0 or more", 0.0, True),
        ("friction angle", soil.friction, "from 0 to below 90°", 0.0, soil.friction < math.pi / 2),
        ("sinkage", soil.sinkage, "0 or more", 0.0, True),
        ("shear modulus", soil.shear_modulus, "above 0, or 0 if it is not known", 0.0, True),
    ):  # fmt: skip
        numbers = np.asarray(value, np.float64)
        if not np.all(inside & np.isfinite(numbers) & (numbers >= low) & (numbers <= LARGEST)):
            raise RequestError(
                f"The {name} is out of its range.", f"It must be finite, {words}, and up to 1e30."
            )
    if not wheel.max_torque >= 0.0:
        raise RequestError("The largest torque is below 0.", "Give N m, 0 or more.")
    if not 0.0 < wheel.max_slip <= 1.0:
        raise RequestError("The largest slip is out of its range.", "Give a share up to 1.")


def remarks(load: float, soil: Soil, wheel: Wheel, slip: float) -> tuple[str, ...]:
    """Sentences on figures beyond the range of the model, for a wheel that slips so much."""
    found = []
    depth = float(contact(load, soil, wheel, slip).sinkage) / (2.0 * wheel.radius)
    digs = f"At a slip of {numbers.share(slip)} the" if wheel.slips else "The"
    if soil.friction > STEEP_FRICTION:
        found.append(
            f"A friction angle of {math.degrees(soil.friction):.3g}° is unusual: soils and tyres "
            "have less than 50°."
        )
    if depth >= 0.5:
        found.append(f"{digs} wheel sinks in to its axle; the model ends before that.")
    elif depth > DEEP:
        found.append(
            f"{digs} wheel sinks in by {depth:.2g} of its diameter; the model is accurate up to "
            f"{DEEP}."
        )
    return tuple(found)


def demand(load: Any, soil: Soil, wheel: Wheel, pull: Any = 0.0) -> Demand:
    """The demand of a wheel under a load that pushes with a force along its heading.

    U is the least share of the soil's strength with which DP = F, s the slip that mobilises U, x =
    2 U/(1 − U) and s = (x − x0)/(X − x0). A wheel that is held back (F below DP at U = 0) does not
    slip: S = F cos θm + W sin θm and N = W cos θm − F sin θm from the equilibrium of the wheel,
    U = |S|/(C + N μ).

    The motor does not count here: compare `torque` with `wheel.max_torque`.

    Args:
        load: load W, N, 0 or more.
        soil: numbers or arrays.
        wheel: a wheel, of which the sizes count.
        pull: F, N: 0 on the level; m g sin α/N on a slope; more with wheels to tow.

    Returns:
        The demand; no number is NaN.
    """
    shape, soils, (weights, pulls) = flatten_soils(soil, load, pull)
    out = np.empty(len(weights), DEMAND)
    kernels.demands(weights, soils, pulls, wheel, out)
    return Demand(**reshape_members(out, shape))
