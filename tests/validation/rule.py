"""The rule of a wheel on soft soil, once more and in NumPy: a second reading of its formulas.

docs/wheel-and-soil.md has them with their sources. Tests hold the kernels equal to this, and
`fit` finds the constants by it. Units N, m, Pa and rad; everything broadcasts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.presets import Preset
from terratool.kernels import traversability as kernels

Array = NDArray[np.float64]

FLATNESS = 0.4
"""Least length that a wheel shears, in radii."""


class Case(NamedTuple):
    """A wheel under a load on a soil; each a number, or an array.

    Attributes:
        load: W, N.
        sinkage: z0, at rest, m.
        radius, width, lug: r, b and h, m.
        cohesion: c, Pa.
        tan_friction: tan φ.
        modulus: K, m; 0 where unknown.
        patch: length that is known of the contact, m; 0 where none is.
    """

    load: Any
    sinkage: Any
    radius: Any
    width: Any
    lug: Any
    cohesion: Any
    tan_friction: Any
    modulus: Any
    patch: Any = 0.0

    @property
    def length(self) -> Array:
        """l: what is known of the contact, the chord between the tips of lugs, or 0.4 r."""
        chord = np.sqrt(np.square(self.radius + self.lug) - np.square(self.radius))
        least = np.maximum(2.0 * chord, FLATNESS * np.asarray(self.radius))
        return np.asarray(np.maximum(least, self.patch))

    @property
    def rest(self) -> Array:
        """t0, up to a right angle."""
        return np.asarray(np.arccos(np.maximum(1.0 - self.sinkage / np.asarray(self.radius), 0.0)))


class Hold(NamedTuple):
    """How a soil holds a wheel that has sunk in.

    Attributes:
        lean: tm, at which forces act, rad.
        friction: mu that can be mobilised.
        cohesive: C, N.
        span: X, sheared length over K.
        still: shear of rolling without slip, in units of K.
    """

    lean: Array
    friction: Array
    cohesive: Array
    span: Array
    still: Array


def bearing_factor(friction: Any) -> Array:
    """Nc of Prandtl for tan φ; 2 + π without friction."""
    tangent = np.asarray(friction, np.float64)
    safe = np.where(tangent > 1e-7, tangent, 1.0)
    growth = np.pi * safe + 2.0 * np.log(safe + np.hypot(1.0, safe))  # tan(π/4 + φ/2) by tan φ
    return np.where(tangent > 1e-7, np.expm1(growth) / safe, 2.0 + np.pi)


def rest_sinkage(soil: Preset, radius: Any, width: Any, load: Any) -> Array:
    """z0, m: both halves of the contact of a wheel at rest bear its load (Bekker)."""
    stiffness = 1e3 * (soil.cohesive + width * soil.frictional) * (3.0 - soil.exponent)
    pressed = 1.5 * np.asarray(load) / (stiffness * np.sqrt(2.0 * radius))
    return np.asarray(pressed ** (1.0 / (soil.exponent + 0.5)))


@dataclass(frozen=True)
class Rule:
    """The constants of the rule, and what it says with them.

    Attributes:
        reach: m, the length to which K of the books belongs.
        rim_friction: friction of soil on a bare rim.
        growth: rad of entry angle for each unit of slip.
        soil_friction: friction of soil that is sheared far.
        soft: rad of contact at rest beyond which ground is soft.
        full_lug: m, height of lugs that act in full.
        steady: most of X that counts without slip.
        ahead: tm over t0.
    """

    reach: float
    rim_friction: float
    growth: float
    soil_friction: float
    soft: float
    full_lug: float
    steady: float
    ahead: float

    def softness(self, rest: Array) -> Array:
        """0 on ground that does not yield, 1 on soft soil."""
        return np.asarray(1.0 - np.exp(-rest / self.soft))

    def hold(self, case: Case) -> Hold:
        """The soil's hold on a wheel."""
        rest, tangent = case.rest, np.asarray(case.tan_friction)
        lugged = np.clip(np.asarray(case.lug) / self.full_lug, 0.0, 1.0)
        most = self.rim_friction * (1.0 - lugged) + self.soil_friction * lugged
        friction = tangent - self.softness(rest) * np.maximum(tangent - most, 0.0)
        whole = np.asarray(case.cohesion * case.width * case.length)
        share = 1.0 + bearing_factor(friction) * whole / case.load
        known = np.asarray(case.modulus) > 0.0
        modulus = np.where(known, case.modulus, np.inf)
        span = np.maximum(self.reach, case.length) / modulus
        turned = np.where(rest > 1e-3, rest - np.sin(rest), rest**3 / 6.0 - rest**5 / 120.0)
        rolled = turned / np.where(rest > 0.0, rest, 1.0)
        still = rolled * np.minimum(span, self.steady)
        return Hold(self.ahead * rest, friction, whole / share, span, still)

    def mobilised(self, case: Case, slip: Any) -> Array:
        """A; 1 where K is not known."""
        hold = self.hold(case)
        sheared = slip * hold.span + (1.0 - np.asarray(slip)) * hold.still
        return np.where(np.asarray(case.modulus) > 0.0, sheared / (sheared + 2.0), 1.0)

    def traction(self, case: Case, slip: Any) -> tuple[Array, Array]:
        """Drawbar pull in N, and torque in N m."""
        hold, share = self.hold(case), self.mobilised(case, slip)
        sine, cosine = np.sin(hold.lean), np.cos(hold.lean)
        normal = (case.load - share * hold.cohesive * sine) / (
            cosine + share * hold.friction * sine
        )
        strength = share * (hold.cohesive + hold.friction * normal)
        return strength * cosine - normal * sine, strength * case.radius

    def sunk(self, case: Case, slip: Any) -> Array:
        """z, m, as the wheel slips; the axle at most."""
        rest = case.rest
        lugs = np.arccos(case.radius / (np.asarray(case.radius) + case.lug))
        entry = rest + self.softness(rest) * slip * np.hypot(self.growth, lugs)
        deep = case.radius * (1.0 - np.cos(np.minimum(entry, 0.5 * np.pi)))
        return np.asarray(np.maximum(case.sinkage, deep))

    def demand(self, case: Case, pull: Any) -> tuple[Array, Array]:
        """Share of the strength that a pull takes, and its slip; NaN from 1 on. K is known."""
        hold = self.hold(case)
        sine, cosine = np.sin(hold.lean), np.cos(hold.lean)
        along, across = pull * cosine + case.load * sine, case.load * cosine - pull * sine
        used = along / (hold.cohesive + hold.friction * across)
        sheared = 2.0 * used / np.where(used < 1.0, 1.0 - used, np.nan)
        return used, (sheared - hold.still) / (hold.span - hold.still)

    def side(self, case: Case, slip: Any, crab: Any) -> Array:
        """Force sideways, N, at a crab angle; slip is that along the wheel's heading."""
        hold = self.hold(case)
        across = (1.0 - np.asarray(slip)) * np.tan(crab)
        slid = np.hypot(slip, across)
        sheared = slid * hold.span
        most = hold.cohesive + case.load * hold.friction
        return most * sheared / (sheared + 2.0) * across / np.where(slid > 0.0, slid, 1.0)

    def climb(self, case: Case, slip: Any) -> Array:
        """Steepest slope at a slip, rad: DP(W cos α) = W sin α, sunk in as under W cos α."""
        shape = np.broadcast_shapes(*(np.shape(value) for value in case), np.shape(slip))
        low, high = np.full(shape, -0.5 * np.pi), np.full(shape, 0.5 * np.pi)
        for _ in range(64):
            angle = 0.5 * (low + high)
            lighter = case._replace(
                load=case.load * np.cos(angle), sinkage=case.sinkage * np.cos(angle)
            )
            up = self.traction(lighter, slip)[0] > case.load * np.sin(angle)
            low, high = np.where(up, angle, low), np.where(up, high, angle)
        return low


RULE = Rule(
    kernels.REACH, kernels.RIM_FRICTION, kernels.GROWTH, soil_friction=0.75, soft=0.1,
    full_lug=kernels.FULL_LUG, steady=16.0, ahead=0.5 * 2.0 ** (1.0 / 3.0),
)  # fmt: skip
"""The rule with the constants of the program, of which three are fitted."""
