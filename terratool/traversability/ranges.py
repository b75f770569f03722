"""Samples of soils whose figures are ranges, and probabilities of driving on these."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from terratool.definition.model import Pair, Range, Surface, ranges_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.traversability.figures import Chances
from terratool.traversability.limits import climb, judge_level, level_demand, slip_limit, tip_over
from terratool.traversability.parameters import SoilSamples, soil_table
from terratool.traversability.soil import (
    largest_slope,
    slope_margin,
    soil_under,
    step_friction,
)
from terratool.traversability.steps import step_of
from terratool.traversability.vehicle import Soil, Vehicle
from terratool.traversability.verdicts import Verdict
from terratool.traversability.wheel import soil_numbers

SAMPLES = 256
"""Default number of samples."""
LEAST_SAMPLES, MOST_SAMPLES = 16, 1024
"""Smallest and largest number of samples."""
MOST_SEED = 2**63 - 1
"""Largest seed."""

_TAIL = 0.05
"""Share of samples beyond each end of the interval of climbs."""
_STEPS = 33
"""Number of frictions of a range at which the highest step is computed, not interpolated."""


@dataclass(frozen=True, slots=True)
class Draws:
    """Samples of the surfaces of a terrain that have ranges.

    Attributes:
        samples: number of samples.
        seed: seed of the generator.
        surfaces: (samples,) copies of each surface with numbers in the place of ranges, by name.
        ranges: ranges that were sampled.
    """

    samples: int
    seed: int
    surfaces: dict[str, tuple[Surface, ...]]
    ranges: tuple[Range, ...]

    @property
    def error(self) -> float:
        """Largest error of a share of the samples, at 95 % confidence."""
        return share_error(self.samples)


def share_error(samples: int) -> float:
    """Largest error of a share that is estimated by a number of samples, at 95 % confidence.

    1.96 √(p (1 − p)/n) with p = ½, as if samples were independent. They are stratified, which never
    makes the variance of a share larger by more than n/(n − 1), and mostly less (Owen, "Monte Carlo
    variance of scrambled net quadrature", SIAM Journal on Numerical Analysis 34, 1997); with one
    range a share is off by 1/n at most.
    """
    return 0.98 / math.sqrt(samples)


def draw(terrain: Terrain, samples: int = SAMPLES, seed: int = 0) -> Draws | None:
    """Sample all surfaces that have ranges; None where none has.

    A Latin hypercube (McKay, Beckman and Conover 1979): of each figure one value lies in each of
    `samples` equal parts of its range, in an order of its own. The values of a figure depend on
    the seed and on the names of surface and key alone, so that other surfaces do not change them.

    Raises:
        RequestError: the number of samples or the seed makes no sense.
    """
    if not LEAST_SAMPLES <= samples <= MOST_SAMPLES:
        raise RequestError(
            f"The number of samples is {samples}.",
            f"Give one from {LEAST_SAMPLES} to {MOST_SAMPLES}.",
        )
    if not 0 <= seed <= MOST_SEED:
        raise RequestError(f"The seed is {seed}.", "Give a whole number from 0 to 2^63 - 1.")
    surfaces = {}
    for name, surface in terrain.surface_types.items():
        if not surface.ranges:
            continue
        figures = {
            attribute: _stratified_values(name, attribute, ends, samples, seed).tolist()
            for attribute, ends in surface.ranges.items()
        }
        surfaces[name] = tuple(
            msgspec.structs.replace(surface, **dict(zip(figures, values, strict=True)))
            for values in zip(*figures.values(), strict=True)
        )
    if not surfaces:
        return None
    return Draws(samples, seed, surfaces, ranges_of(terrain.surface_types))


def _stratified_values(
    name: str, attribute: str, ends: Pair, samples: int, seed: int
) -> NDArray[np.float64]:
    """Draw a value in each of `samples` equal parts of a range, in random order; (samples,)."""
    words = [seed & 0xFFFFFFFF, seed >> 32, *f"{name}/{attribute}".encode()]
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))
    places = (generator.permutation(samples) + generator.random(samples)) / samples
    low, high = ends
    return np.minimum(low + places * (high - low), high)


def sampled_soils(name: str, draws: Draws, vehicle: Vehicle) -> tuple[Soil | None, ...]:
    """The soil of a surface, sample by sample; None where the surface lacks a key."""
    return tuple(soil_under(name, surface, vehicle) for surface in draws.surfaces[name])


def case_samples(
    terrain: Terrain, vehicle: Vehicle, draws: Draws | None
) -> tuple[SoilSamples, ...]:
    """Sampled soils of a terrain for each of the vehicle's loads; none where none are sampled."""
    if draws is None:
        return ()
    return tuple(soil_samples(terrain, case, draws) for case in vehicle.cases)


def soil_samples(terrain: Terrain, vehicle: Vehicle, draws: Draws) -> SoilSamples:
    """Sampled soils of a terrain, by sample and by id, the surface's index and one."""
    soils, steps = soil_table(terrain, vehicle)
    tables = [
        np.repeat(np.asarray(values)[None], draws.samples, axis=0) for values in (*soils, steps)
    ]
    for id_, name in enumerate(terrain.surface_types, 1):
        if name not in draws.surfaces:
            continue
        found = [soil for soil in sampled_soils(name, draws, vehicle) if soil is not None]
        if not found:
            continue
        members = np.array([soil_numbers(one) for one in found])
        highest = _steps(vehicle, [step_friction(vehicle, one) for one in found])
        for table, values in zip(tables, (*members.T, highest), strict=True):
            table[:, id_] = values
    return SoilSamples(*tables)


def _steps(vehicle: Vehicle, friction: Sequence[float]) -> NDArray[np.float64]:
    """Highest steps by coefficient of friction, m: computed at `_STEPS`, else interpolated."""
    low, high = min(friction), max(friction)
    known = np.linspace(low, high, _STEPS) if low < high else np.array([low])
    return np.interp(friction, known, [step_of(vehicle, one).height for one in known.tolist()])


def level_chances(name: str, draws: Draws, vehicle: Vehicle) -> Chances | None:
    """Probabilities of driving on level ground of a surface with ranges; None without ranges.

    Climbs have the vehicle's margins taken off, as in `surface_figures`. Of several loads each
    figure is that of the worst.
    """
    if name not in draws.surfaces:
        return None
    found = [_level_chances(name, draws, case) for case in vehicle.cases]
    known = [one for one in found if one is not None]
    if len(known) < 2:
        return found[0]
    go, drives = min(one.go for one in known), min(one.drives for one in known)

    def least(angles: Iterable[float | None]) -> float | None:
        return min(angles, key=lambda angle: -1.0 if angle is None else angle)

    low, high = least(one.climb_low for one in known), least(one.climb_high for one in known)
    return Chances(go, drives, low, high)


def _level_chances(name: str, draws: Draws, vehicle: Vehicle) -> Chances | None:
    """Probabilities of driving on level ground of a surface, with the vehicle's load as it is."""
    soils = [soil for soil in sampled_soils(name, draws, vehicle) if soil is not None]
    if not soils:
        return None
    verdicts = [judge_level(vehicle, level_demand(vehicle, soil)).verdict for soil in soils]
    slip, (_, backwards, _) = slip_limit(vehicle), tip_over(vehicle)
    tips = backwards - vehicle.margins.tip
    climbs = [
        largest_slope(climb(vehicle, soil, slip), slope_margin(vehicle, soil), tips)[0]
        for soil in soils
    ]
    ranked = sorted(climbs, key=lambda angle: -1.0 if angle is None else angle)
    beyond = math.floor(_TAIL * len(ranked))
    return Chances(
        go=verdicts.count(Verdict.GO) / len(soils),
        drives=sum(one in (Verdict.GO, Verdict.CAUTION) for one in verdicts) / len(soils),
        climb_low=ranked[beyond],
        climb_high=ranked[-1 - beyond],
    )
