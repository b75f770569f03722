"""Firmer and stronger soil, and larger wheels, never climb worse: over thousands of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from terratool.traversability import limits
from terratool.traversability.soil import step_friction
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel

CASES = 400
Case = tuple[Wheel, Soil, float]


def climb(wheel: Wheel, soil: Soil, load: float) -> float:
    """What a wheel by itself climbs at a slip up to 0.6, rad; below 0 where it is immobile."""
    found = limits.climb(Vehicle.single(wheel, load), soil, 0.6)
    return float(found.angle) if found.possible else -1.0


def cases(slips: bool) -> list[Case]:
    """Wheels of 5 cm to 1 m on soils from sand to clay, and rigid ones; smooth, lugged, tyres."""
    rng = np.random.default_rng(18)
    found = []
    for _ in range(CASES):
        radius = float(np.exp(rng.uniform(math.log(0.05), 0.0)))
        wheel = Wheel(
            radius,
            radius * float(rng.uniform(0.2, 1.2)),
            grouser_height=radius * float(rng.choice([0.0, rng.uniform(0.01, 0.3)])),
            contact_length=radius * float(rng.choice([0.0, rng.uniform(0.1, 1.5)])),
            tyre=bool(rng.random() < 0.3),
            slips=slips,
        )
        load = 2e4 * radius**2 * float(rng.uniform(0.05, 1.0))
        depth = float(rng.choice([0.0, np.exp(rng.uniform(math.log(1e-7), math.log(0.4)))]))
        soil = Soil.of(
            float(rng.choice([0.0, rng.uniform(0, 3), rng.uniform(0, 70)])),
            float(rng.uniform(5, 45)),
            depth * radius / load * 1e3,
            float(rng.choice([0.0, np.exp(rng.uniform(math.log(0.002), math.log(0.06)))])),
        )
        found.append((wheel, soil, load))
    return found


BETTER: dict[str, Callable[[Wheel, Soil, float], tuple[Wheel, Soil]]] = {
    "k": lambda wheel, soil, share: (wheel, replace(soil, sinkage=soil.sinkage * (1 - share))),
    "k, to 0": lambda wheel, soil, _: (wheel, replace(soil, sinkage=0.0)),
    "c": lambda wheel, soil, share: (wheel, replace(soil, cohesion=soil.cohesion + 5e3 * share)),
    "φ": lambda wheel, soil, share: (wheel, replace(soil, friction=soil.friction + 0.2 * share)),
    "K": lambda wheel, soil, share: (
        wheel, replace(soil, shear_modulus=soil.shear_modulus * (1 - 0.9 * share))
    ),
    "b": lambda wheel, soil, share: (replace(wheel, width=wheel.width * (1 + share)), soil),
    "r": lambda wheel, soil, share: (replace(wheel, radius=wheel.radius * (1 + share)), soil),
    "contact length": lambda wheel, soil, share: (
        replace(wheel, contact_length=wheel.contact_length + wheel.radius * share), soil
    ),
    "lugs": lambda wheel, soil, share: (
        replace(wheel, grouser_height=wheel.grouser_height + 0.2 * wheel.radius * share), soil
    ),
    "pressure": lambda wheel, soil, share: (replace(wheel, patch_pressure=3e4 * (1 - share)), soil),
}  # fmt: skip


@pytest.mark.parametrize("slips", [True, False], ids=["slip", "paper"])
@pytest.mark.parametrize("what", BETTER)
def test_better_never_climbs_worse(what: str, slips: bool) -> None:
    """Less k and K, more of all else. A tyre's pressure is that of wheels that have one before.

    In the model `paper` cohesion acts where the wheel touches, which is less on firmer soil.
    """
    rng = np.random.default_rng(len(what))
    gains = 0
    for case in cases(slips):
        wheel, soil, load = case
        if what == "pressure":
            wheel = replace(wheel, patch_pressure=3e4)
        before = climb(wheel, soil, load)
        if not slips and what[0] == "k":
            soil = replace(soil, cohesion=0.0)
            before = climb(wheel, soil, load)
        after = climb(*BETTER[what](wheel, soil, float(rng.uniform(0.02, 0.9))), load)
        assert after >= before - 1e-9, (wheel, soil, load)
        gains += after > before + 1e-6
    of_slip_alone = ("K", "contact length", "lugs", "pressure")
    assert (gains > CASES // 10) == (slips or what not in of_slip_alone)


@pytest.mark.parametrize("slip", [0.05, 0.6])
@pytest.mark.parametrize("what", ["k", "k, to 0", "c", "φ", "K"])
def test_a_step_is_climbed_as_well_on_better_soil(what: str, slip: float) -> None:
    """An edge is rigid: what rolling shears as the wheel sinks into soil counts for nothing."""
    rng = np.random.default_rng(len(what))
    for wheel, soil, load in cases(True):
        limited = replace(wheel, max_slip=slip)
        better = BETTER[what](limited, soil, float(rng.uniform(0.02, 0.9)))[1]
        before, after = (
            step_friction(Vehicle.single(limited, load), each) for each in (soil, better)
        )
        assert after >= before * (1.0 - 1e-12), (wheel, soil, load)


def test_the_husky_on_firmer_and_firmer_ground() -> None:
    """What was 33° at k = 0 and 0.5° at 1e-5 m/kN: the climb only rises, without a jump."""
    vehicle = Vehicle(
        Wheel(0.1651, 0.1143), (Axle(0.256), Axle(-0.256)), 50.0, track_width=0.5708,
        cog_height=0.194, clearance=0.13,
    )  # fmt: skip
    rates = [0.0, 1e-8, 8e-6, 1e-5, 1e-4, 0.003, 0.01, 0.03, 0.1]
    found = [limits.climb(vehicle, Soil.of(0, 33, rate, 0.01), 0.6).angle for rate in rates]
    assert all(a >= b - 1e-9 for a, b in pairwise(found))
    assert found[0] - found[1] < 1e-3
    assert math.degrees(found[0]) > 25
