"""Scattering: places and sizes of the copies of an element, the same on every machine."""

from __future__ import annotations

import math
from array import array
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.model import MAX_SCATTERED, Pair, Scatter

ALL_TRIES = 1 << 62
"""Number of tries beyond all that are ever needed."""
_TURNINGS = {"none": 0, "quarters": 1, "any": 2}


class Strewing(NamedTuple):
    """Parameters of a scattering, in the order of the kernels.

    Attributes:
        seed: seed of the random numbers.
        least: smallest side of a copy, units of the terrain.
        most: largest side of a copy, units of the terrain.
        wide: side of the area along x, units of the terrain.
        tall: side of the area along y, units of the terrain.
        distance: least room between two copies, each taken as the disc around its square; NaN
            where copies may overlap.
        turning: 0 for copies that are not turned, 1 by quarters, 2 by any angle.
        tilted: whether the element itself is turned by no multiple of 90 degrees.
    """

    seed: int
    least: float
    most: float
    wide: float
    tall: float
    distance: float
    turning: int
    tilted: bool


class Strewn(NamedTuple):
    """Copies of a scattered element, the largest first, as buffers of (n,) float64.

    Attributes:
        sides: sides of the copies, units of the terrain.
        x: distances of the middles from the area's west side; NaN for copies without a place.
        y: distances of the middles from the area's south side; NaN for copies without a place.
        turns: turns of the copies, degrees.
        looked: number of copies that were tried before no tries were left.
        left: number of tries left.
    """

    sides: array[float]
    x: array[float]
    y: array[float]
    turns: array[float]
    looked: int
    left: int


def copy_count(scatter: Scatter, lengths: Pair) -> int:
    """Number of copies asked for in a cell with these sides; MAX_SCATTERED + 1 for more."""
    if scatter.count is not UNSET:
        return scatter.count
    density = 0.0 if scatter.density is UNSET else scatter.density
    count = density * lengths[0] * lengths[1] + 0.5
    return math.floor(count) if count <= MAX_SCATTERED else MAX_SCATTERED + 1


def strewing_of(scatter: Scatter, area: Pair, *, by_quarters: bool, tilted: bool) -> Strewing:
    """Parameters of the scattering of an element, in the order of the kernels.

    Args:
        scatter: value of `scatter`.
        area: sides of the cell over which copies are strewn.
        by_quarters: whether copies that are turned are turned by multiples of 90 degrees.
        tilted: whether the element itself is turned by no multiple of 90 degrees.
    """
    turning = "none" if scatter.turned is not True else "quarters" if by_quarters else "any"
    return Strewing(
        seed=0 if scatter.seed is UNSET else scatter.seed,
        least=scatter.sizes[0],
        most=scatter.sizes[1],
        wide=area[0],
        tall=area[1],
        distance=math.nan if scatter.distance is UNSET else scatter.distance,
        turning=_TURNINGS[turning],
        tilted=tilted,
    )


def strew(asked: Strewing, count: int, tries: int = ALL_TRIES) -> Strewn:
    """Place copies of a scattered element; copies that find no place before the tries end have NaN.

    A share of (least / D)² of all copies is larger than D, but for those cut off at the largest
    size. Middles are spread evenly over the places that keep the copy, however it is turned, in
    the cell, and at least the distance asked for from the copies before.
    """
    from terratool.kernels import definition as kernels

    # `array`, as checks of a text do without NumPy
    buffers: Any = [array("d", bytes(8 * count)) for _ in range(4)]
    sides, x, y, turns = buffers
    looked, left = kernels.scatter(asked, tries, sides, x, y, turns)
    return Strewn(sides, x, y, turns, looked, left)


def smallest_side(scatter: Scatter, area: Pair) -> float:
    """Side of the smallest copy, whether it finds a place or not; the largest side without copies.

    Args:
        scatter: value of `scatter`.
        area: sides of the cell over which copies are strewn.
    """
    from terratool.kernels import definition as kernels

    count = min(copy_count(scatter, area), MAX_SCATTERED)
    return kernels.least_side(strewing_of(scatter, area, by_quarters=False, tilted=False), count)


def share(seed: int, number: int, draw: int) -> float:
    """Random number from 0 to below 1: the mixer of SplitMix64 over seed, copy and draw.

    Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    from terratool.kernels import definition as kernels

    return kernels.share(seed, number, draw)
