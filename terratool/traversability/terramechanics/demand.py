"""What it asks of a wheel to push: torque, share of the soil's strength, slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from terratool.kernels import traversability as kernels
from terratool.traversability.terramechanics.arrays import DEMAND, Numbers, flat_soils, members
from terratool.traversability.types import Soil, Wheel


@dataclass(frozen=True, slots=True)
class Demand:
    """What a wheel needs, in the shape that loads, soils and pulls broadcast to.

    Attributes:
        torque: N m; below 0 where it is held back.
        utilisation: U, the share of the soil's strength that is used: 1 and more is immobile,
            infinity where no strength would do.
        slip: s; above 1 is immobile. 0 where K is not known (the rule is A = 1), on rigid ground
            and for a wheel that is held back.
        sinkage: m.
    """

    torque: Numbers
    utilisation: Numbers
    slip: Numbers
    sinkage: Numbers


def demand(load: Any, soil: Soil, wheel: Wheel, pull: Any = 0.0) -> Demand:
    """What a wheel under a load needs to push with a force along its heading.

    τ = (F cos h + W sin h)/Q and σ = (W cos h − F sin h)/Q from the equilibrium of the wheel,
    T = r (F cos h + W sin h)(h/2)²/sin²(h/2), U = τ/(c + σ tan φ), and the slip s at which
    Janosi and Hanamoto's law mobilises U. On rigid ground (k = 0 or z below 1e-6 m) T = r F,
    U = F/(W tan φ) and no slip. Derived from the model of Iagnemma, Shibly and Dubowsky 2002.

    The motor does not count here: compare `torque` with `wheel.max_torque`.

    Args:
        load: W, N, 0 or more.
        soil: numbers or arrays.
        wheel: radius and width.
        pull: F, N: 0 on the level; m g sin α/N on a slope; more with wheels to tow.

    Returns:
        What it needs; nothing in it is NaN.
    """
    shape, soils, (weights, pulls) = flat_soils(soil, load, pull)
    out = np.empty(len(weights), DEMAND)
    kernels.demands(weights, soils, pulls, wheel, out)
    return Demand(**members(out, shape))
