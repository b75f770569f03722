"""A foot on soil: a disc that sinks in, is borne, and holds against sliding.

All functions take numbers, or arrays that broadcast together, in N, m, Pa and rad.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from terratool.kernels import traversability as kernels

_COHESIVE, _WEIGHING = 1.3, 0.6
"""Terzaghi's shape factors of a circle for cohesion and weight, 1943."""


class BearingFactors(NamedTuple):
    """Factors of bearing capacity: of cohesion Nc, of surcharge Nq, and of weight Nγ."""

    cohesion: Any
    surcharge: Any
    weight: Any


def bearing_factors(friction: Any) -> BearingFactors:
    """Nq = e^(π tan φ) tan²(45° + φ/2), Nc = (Nq − 1) cot φ, Nγ = 2 (Nq + 1) tan φ.

    A. S. Vesic, *Analysis of ultimate loads of shallow foundations*, Journal of the Soil Mechanics
    and Foundations Division 99, 1973; Nc is Prandtl's 2 + π where φ is 0.
    """
    tangent = np.asarray(np.tan(friction), np.float64)
    cohesion = kernels.bearing_factors(tangent.ravel()).reshape(tangent.shape)
    surcharge = 1.0 + cohesion * tangent
    return BearingFactors(cohesion[()], surcharge[()], 2.0 * (surcharge + 1.0) * tangent)


def disc_area(diameter: Any) -> Any:
    """Area of a disc, m²."""
    return 0.25 * math.pi * diameter**2


def bearing_load(cohesion: Any, friction: Any, unit_weight: Any, diameter: Any) -> Any:
    """Load that soil bears on a disc at its surface, (1.3 c Nc + 0.3 γ B Nγ) A, N.

    K. Terzaghi, *Theoretical Soil Mechanics*, 1943, with Vesic's factors. What a foot that has sunk
    in gains by the soil beside it is left out: see `borne_at`.

    Args:
        cohesion: c, Pa.
        friction: φ, rad.
        unit_weight: γ, weight of a volume of soil under the gravity there, N/m³.
        diameter: B, m.
    """
    factors = bearing_factors(friction)
    pressure = (
        _COHESIVE * cohesion * factors.cohesion
        + _WEIGHING * 0.5 * unit_weight * diameter * factors.weight
    )
    return pressure * disc_area(diameter)


def borne_at(load: Any, cohesion: Any, friction: Any, unit_weight: Any, diameter: Any) -> Any:
    """Depth at which soil bears a disc, m; 0 where it does at its surface.

    The soil beside a disc z deep adds γ z Nq (1 + tan φ) to the pressure that is borne: Terzaghi's
    term of the surcharge with the shape factor of a circle, E. E. De Beer, *Experimental
    determination of the shape factors and the bearing capacity factors of sand*, Géotechnique 20,
    1970, and Vesic, 1973. Factors of depth, which are above 1, are left out.

    Args:
        load: N, that the disc bears, N.
        cohesion: c, Pa.
        friction: φ, rad.
        unit_weight: γ, weight of a volume of soil under the gravity there, N/m³.
        diameter: B, m.
    """
    lacking = load - bearing_load(cohesion, friction, unit_weight, diameter)
    gained = unit_weight * bearing_factors(friction).surcharge * (1.0 + np.tan(friction))
    return np.maximum(lacking, 0.0) / (gained * disc_area(diameter))


def foot_grip(
    load: Any, cohesion: Any, friction: Any, area: Any, shear: Any = math.inf, modulus: Any = 0.0
) -> Any:
    """Force that a foot holds against along the ground, (c A + N tan φ)(1 − e^(−j/K)), N.

    The law of Janosi and Hanamoto, 1961, as in Ding et al., *Foot–terrain interaction mechanics for
    legged robots*, International Journal of Robotics Research 32(13), 2013. What holds at last,
    after a shear j of many K, is the limit: all of the strength.
    """
    known = np.asarray(modulus, np.float64) > 0.0
    x = np.where(known, np.asarray(shear) / np.where(known, modulus, 1.0), np.inf)
    return ((area * cohesion + load * np.tan(friction)) * -np.expm1(-x))[()]
