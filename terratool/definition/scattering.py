"""Where the copies of a scattered element stand, and how large they are: the same everywhere.

All numbers follow from the seed by whole numbers of 64 bits, and by sums, products, quotients and
square roots of doubles, which IEEE 754 rounds alike on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.model import MAX_SCATTERED, Pair, Scatter

_TRIES = 50
"""So many places are tried for a copy that has to keep its distance."""
_WORD = (1 << 64) - 1


class Strewn(NamedTuple):
    """One copy: its middle in the cell, its side, and its turn in degrees."""

    middle: Pair
    side: float
    turn: float


def wanted(scatter: Scatter, lengths: Pair) -> int:
    """How many copies are asked for in a cell with these sides; one more than may be, for more."""
    if scatter.count is not UNSET:
        return scatter.count
    density = 0.0 if scatter.density is UNSET else scatter.density
    count = density * lengths[0] * lengths[1] + 0.5
    return math.floor(count) if count <= MAX_SCATTERED else MAX_SCATTERED + 1


def strewn(
    scatter: Scatter, lengths: Pair, *, by_quarters: bool = False, tilted: bool = False
) -> Iterator[Strewn]:
    """The copies in a cell, the largest first; those for which no place is found are left out.

    A share of (least / D)² of all copies is larger than D, but for those cut off at the largest
    size. Middles are spread evenly over the places that keep the copy, however it is turned, in
    the cell, and as far from those before as is asked.

    Args:
        scatter: what is asked for.
        lengths: sides of the cell.
        by_quarters: turns are multiples of 90 degrees.
        tilted: the element itself is turned by another angle.
    """
    for copy, _ in sown(scatter, lengths, by_quarters=by_quarters, tilted=tilted):
        if copy is not None:
            yield copy


def sown(
    scatter: Scatter, lengths: Pair, *, by_quarters: bool, tilted: bool
) -> Iterator[tuple[Strewn | None, int]]:
    """All copies as `strewn` has them, None for those left out, and how often each was tried."""
    least, most = scatter.sizes
    seed = 0 if scatter.seed is UNSET else scatter.seed
    low, high = 1.0 / (least * least), 1.0 / (most * most)
    sides = sorted(
        (
            min(max(1.0 / math.sqrt(low + (high - low) * share(seed, n, 0)), least), most)
            for n in range(wanted(scatter, lengths))
        ),
        reverse=True,
    )
    turned = scatter.turned is True
    any_turn = tilted or (turned and not by_quarters)
    near = None if scatter.distance is UNSET else _Near(scatter.distance)
    for n, side in enumerate(sides):
        turn = 0.0
        if turned:
            turn = share(seed, n, 1)
            turn = 90.0 * math.floor(4.0 * turn) if by_quarters else 360.0 * turn
        reach = side * (_HALF_DIAGONAL if any_turn else 0.5)
        room = lengths[0] - 2.0 * reach, lengths[1] - 2.0 * reach
        if min(room) < 0.0:
            yield None, 0
            continue
        for attempt in range(1 if near is None else _TRIES):
            middle = (
                reach + room[0] * share(seed, n, 2 + 2 * attempt),
                reach + room[1] * share(seed, n, 3 + 2 * attempt),
            )
            if near is None or near.takes(middle, side):
                yield Strewn(middle, side, turn), attempt + 1
                break
        else:
            yield None, attempt + 1


_HALF_DIAGONAL = math.sqrt(0.5) * (1.0 + 1e-12)


class _Near:
    """The copies that stand already, by size and by cells of a grid; each is a disc around it.

    The largest come first, so that a copy meets none that is smaller. Of the sizes between two
    powers of 2 there are few in a cell that is as wide as the largest of them.
    """

    def __init__(self, distance: float) -> None:
        self._distance = distance
        self._there: dict[int, dict[tuple[int, int], list[tuple[Pair, float]]]] = {}

    def takes(self, middle: Pair, side: float) -> bool:
        """Whether a copy keeps its distance; then it stands there."""
        radius = side * math.sqrt(0.5)
        for size, there in self._there.items():
            x, y = self._cell(middle, size)
            for i in (x - 1, x, x + 1):
                for j in (y - 1, y, y + 1):
                    for other, their in there.get((i, j), ()):
                        dx, dy = middle[0] - other[0], middle[1] - other[1]
                        apart = radius + their + self._distance
                        if dx * dx + dy * dy < apart * apart:
                            return False
        size = math.frexp(radius)[1]
        cells = self._there.setdefault(size, {})
        cells.setdefault(self._cell(middle, size), []).append((middle, radius))
        return True

    def _cell(self, middle: Pair, size: int) -> tuple[int, int]:
        pitch = 2.0 * math.ldexp(1.0, size) + self._distance
        return math.floor(middle[0] / pitch), math.floor(middle[1] / pitch)


def share(seed: int, number: int, draw: int) -> float:
    """A number from 0 to below 1: the mixer of SplitMix64 over seed, copy and draw.

    Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA 2014.
    """
    state = seed
    for more in (number, draw):
        state = _mixed((state + 0x9E3779B97F4A7C15 * (more + 1)) & _WORD)
    return (state >> 11) * 2.0**-53


def _mixed(word: int) -> int:
    word = ((word ^ (word >> 30)) * 0xBF58476D1CE4E5B9) & _WORD
    word = ((word ^ (word >> 27)) * 0x94D049BB133111EB) & _WORD
    return word ^ (word >> 31)
