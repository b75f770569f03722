"""Where the copies of a scattered element stand, and how large they are: the same everywhere."""

from __future__ import annotations

import math
from array import array
from typing import Any, NamedTuple

from msgspec import UNSET

from terratool.definition.model import MAX_SCATTERED, Pair, Scatter

ALL_TRIES = 1 << 62
"""More places than are ever tried."""
_TURNINGS = {"none": 0, "quarters": 1, "any": 2}


class Strewing(NamedTuple):
    """A scattering as kernels take it.

    Attributes:
        seed: whole number from which all follows.
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
    """The copies of a scattered element, the largest first; buffers of float64, one number each.

    Attributes:
        sides: sides of the copies, units of the terrain.
        x: middles from the west side of the area; NaN for what is left out.
        y: middles from its south side.
        turns: turns of the copies, degrees.
        looked: how many copies were looked at before there were no tries left.
        left: how many tries are left.
    """

    sides: array[float]
    x: array[float]
    y: array[float]
    turns: array[float]
    looked: int
    left: int


def wanted(scatter: Scatter, lengths: Pair) -> int:
    """How many copies are asked for in a cell with these sides; one more than may be, for more."""
    if scatter.count is not UNSET:
        return scatter.count
    density = 0.0 if scatter.density is UNSET else scatter.density
    count = density * lengths[0] * lengths[1] + 0.5
    return math.floor(count) if count <= MAX_SCATTERED else MAX_SCATTERED + 1


def strewing(scatter: Scatter, area: Pair, *, by_quarters: bool, tilted: bool) -> Strewing:
    """What is asked for, as kernels take it.

    Args:
        scatter: what the text says.
        area: sides of the cell over which copies are strewn.
        by_quarters: whether copies that are turned are turned by multiples of 90 degrees.
        tilted: whether the element itself is turned by another angle.
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


def strewn(asked: Strewing, count: int, tries: int = ALL_TRIES) -> Strewn:
    """Strew so many copies; what is not looked at before all tries are used up is left out.

    A share of (least / D)² of all copies is larger than D, but for those cut off at the largest
    size. Middles are spread evenly over the places that keep the copy, however it is turned, in
    the cell, and as far from those before as is asked.
    """
    from terratool.kernels import definition as kernels

    # validating does without NumPy
    buffers: Any = [array("d", bytes(8 * count)) for _ in range(4)]
    sides, x, y, turns = buffers
    looked, left = kernels.scatter(asked, tries, sides, x, y, turns)
    return Strewn(sides, x, y, turns, looked, left)


def least_drawn(scatter: Scatter, area: Pair) -> float:
    """The side of the smallest copy, whether it finds a place or not; the largest if there is none.

    Args:
        scatter: what the text says.
        area: sides of the cell over which copies are strewn.
    """
    from terratool.kernels import definition as kernels

    count = min(wanted(scatter, area), MAX_SCATTERED)
    return kernels.least_side(strewing(scatter, area, by_quarters=False, tilted=False), count)


def share(seed: int, number: int, draw: int) -> float:
    """A number from 0 to below 1: the mixer of SplitMix64 over seed, copy and draw.

    Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    from terratool.kernels import definition as kernels

    return kernels.share(seed, number, draw)
