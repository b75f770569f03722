"""Walls between pixels, and the steps and trenches that wheels meet there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_LEANING = 3.0
"""Most pixels by which a wall shifts from line to line; one farther off is another wall."""


class Gaps(NamedTuple):
    """Trenches so narrow that a wheel touches both of their edges, (pairs,) each.

    Attributes:
        width: width along the axis of the pair, m; infinity for no such trench.
        rise: height of the one edge above the other, m.
        lean: shift of the wall along the axis from its line of pixels to the next one, to the south
            or the east, pixels.
    """

    width: NDArray[np.float64]
    rise: NDArray[np.float64]
    lean: NDArray[np.float64]


class MetWalls(NamedTuple):
    """Walls and trenches that wheels of a radius meet at pairs of pixels.

    Attributes:
        jumps: (pairs,) heights of walls, m, or of the step that a wheel meets where another wall
            follows close by; infinity for a face without a wall.
        gaps: trenches between these walls.
    """

    jumps: NDArray[np.float64]
    gaps: Gaps


class Walls(NamedTuple):
    """Walls in pairs of pixels, sorted by lines of pixels and along each line.

    Attributes:
        pairs: number of pairs.
        pixel: side of a pixel, m.
        pair: (n,) index of the pair.
        line: (n,) twice the row of a pair along x, twice the column and one of a pair along y.
        place: (n,) position of a wall along its axis, m.
        jump: (n,) rise of the ground at the wall along the axis, m, below 0 for a fall.
    """

    pairs: int
    pixel: float
    pair: NDArray[np.int64]
    line: NDArray[np.int64]
    place: NDArray[np.float64]
    jump: NDArray[np.float64]


def walls_in_order(
    pairs: NDArray[np.int64],
    width: int,
    places: NDArray[np.float64],
    jumps: NDArray[np.float64],
    pixel: float,
) -> Walls:
    """Sort walls by lines of pixels and along each line.

    Args:
        pairs: (pairs,) pairs of pixels, as in `StanceGround`.
        width: width of the window, pixels.
        places: (pairs, walls) position of each wall along its axis, m.
        jumps: (pairs, walls) rise of the ground at each wall along the axis, m; 0 for no wall.
        pixel: side of a pixel, m.
    """
    index, which = np.nonzero(jumps)
    first, down = pairs[index] >> 1, pairs[index] & 1
    line = 2 * np.where(down, first % width, first // width) + down
    place, jump = places[index, which], jumps[index, which]
    order = np.lexsort([place, line])
    return Walls(len(pairs), pixel, index[order], line[order], place[order], jump[order])


def wheel_steps(walls: Walls, radius: float) -> NDArray[np.float64]:
    """The step that a wheel meets at each pair: its highest wall, or more if two are close.

    A wheel that touches the edges of two walls, the upper one h above the other and t behind it,
    touches the upper at γ + β from the downward vertical: tan γ = h/t, sin β = √(t² + h²)/D. A
    wheel touches both if t² < 2 r h − h²; else it rolls up one wall after the other.

    Args:
        walls: walls in pairs of pixels.
        radius: radius of the wheels, m.

    Returns:
        (pairs,) heights of steps, m; 0 without a wall.
    """
    _, _, index, line, place, jump = walls
    met = np.zeros(walls.pairs)
    np.maximum.at(met, index, np.abs(jump))
    apart, up = np.diff(place), jump[1:] > 0.0
    upper = np.minimum(np.abs(np.where(up, jump[1:], jump[:-1])), radius)
    both = (np.diff(line) == 0) & (up == (jump[:-1] > 0.0))
    both &= apart**2 < upper * (2.0 * radius - upper)
    chord = np.minimum(np.hypot(apart, upper) / (2.0 * radius), 1.0)
    angle = np.minimum(np.arctan2(upper, apart) + np.arcsin(chord), 0.5 * np.pi)
    height = radius * (1.0 - np.cos(angle))
    for side in (index[:-1], index[1:]):
        np.maximum.at(met, side[both], height[both])
    return met


def wheel_gaps(walls: Walls, radius: float) -> Gaps:
    """The trenches that a wheel meets: a wall down, then one up, near enough to touch both.

    Args:
        walls: walls in pairs of pixels.
        radius: radius of the wheels, m.
    """
    gaps = Gaps(np.full(walls.pairs, np.inf), *np.zeros((2, walls.pairs)))
    _, _, index, line, place, jump = walls
    width, rise = np.diff(place), np.abs(np.diff(np.abs(jump)))
    gap = (np.diff(line) == 0) & (jump[:-1] < 0.0) & (jump[1:] > 0.0)
    # an oblique wheel may touch both edges of a gap that is wider along the axis
    gap &= (width < 4.0 * radius) & (rise < radius)
    at = np.flatnonzero(gap)
    # the wider one of a pair's two gaps counts: it is put last
    at = at[np.argsort(width[at], kind="stable")]
    lean = _leans(walls, at)
    for wall in (at, at + 1):
        gaps.width[index[wall]], gaps.rise[index[wall]] = width[at], rise[at]
        gaps.lean[index[wall]] = lean
    return gaps


def meet_walls(walls: Walls, same: NDArray[np.bool_], radius: float) -> MetWalls:
    """The walls and trenches that wheels meet at pairs; pairs of the `same` label have none."""
    jumps, gaps = np.full(len(same), np.inf), np.zeros((3, len(same)))
    gaps[0] = np.inf
    jumps[~same] = wheel_steps(walls, radius)
    gaps[:, ~same] = wheel_gaps(walls, radius)
    return MetWalls(jumps, Gaps(*gaps))


def _leans(walls: Walls, at: NDArray[np.int64]) -> NDArray[np.float64]:
    """Shifts of walls from one line of pixels to the next, pixels; 0 where unknown."""
    lean = np.zeros(len(at))
    if not len(at):
        return lean
    _, pixel, _, line, place, jump = walls
    start = place.min() - 1.0
    length = place.max() - start + 1.0
    known = np.zeros(len(at), np.bool_)
    down = np.flatnonzero(jump < 0.0)
    keys = line[down] + (place[down] - start) / length
    for step in (2, -2):  # of the lines beside it the next, else the one before
        wanted = line[at] + step + (place[at] - start) / length
        after = np.searchsorted(keys, wanted)
        for near in (after - 1, after):
            other = down[np.clip(near, 0, len(down) - 1)]
            shift = (place[other] - place[at]) / pixel
            fits = (line[other] == line[at] + step) & (np.abs(shift) <= _LEANING)
            better = fits & (~known | (np.abs(shift) < np.abs(lean)))
            lean[better] = np.sign(step) * shift[better]
            known |= fits
        if known.all():
            break
    return lean
