"""A slow, plain reading of scattered copies, for the tests to compare with (docs/format.md)."""

from __future__ import annotations

import math
from typing import NamedTuple

from terratool.definition.model import Scatter

TRIES = 50


class Copy(NamedTuple):
    """A copy that has found a place: its place in the list by size, and where it stands."""

    number: int
    side: float
    middle: tuple[float, float]
    turn: float


GOLDEN = 0x9E3779B97F4A7C15


def mixed(word: int) -> int:
    word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 % 2**64
    word = (word ^ word >> 27) * 0x94D049BB133111EB % 2**64
    return word ^ word >> 31


def drawn(seed: int, number: int, draw: int) -> float:
    """A number from 0 to 1, as docs/format.md has it."""
    for more in (number, draw):
        seed = mixed((seed + GOLDEN * (more + 1)) % 2**64)
    return (seed >> 11) / 2**53


def drawn_sizes(scatter: Scatter) -> list[float]:
    """The sizes of all copies, the largest first, whether they find a place or not."""
    least, most = scatter.sizes
    low, high = 1 / (least * least), 1 / (most * most)
    seed, count = scatter.seed, scatter.count
    assert isinstance(seed, int) and isinstance(count, int)
    sides = [1 / math.sqrt(low + (high - low) * drawn(seed, n, 0)) for n in range(count)]
    return sorted((min(max(side, least), most) for side in sides), reverse=True)


def slowly(
    scatter: Scatter, area: tuple[float, float], *, by_quarters: bool, tilted: bool
) -> list[Copy]:
    """The same by the words of docs/format.md: each copy is held against all before it."""
    seed = scatter.seed
    assert isinstance(seed, int)
    found: list[Copy] = []
    for n, side in enumerate(drawn_sizes(scatter)):
        turn = drawn(seed, n, 1) if scatter.turned is True else 0.0
        turn = 90 * math.floor(4 * turn) if by_quarters else 360 * turn
        by_any_angle = tilted or (scatter.turned is True and not by_quarters)
        keep = math.sqrt(0.5) * (1 + 1e-12) * side if by_any_angle else side / 2
        room = area[0] - 2 * keep, area[1] - 2 * keep
        for attempt in range(TRIES if isinstance(scatter.distance, float) else 1):
            if min(room) < 0:
                break
            x = keep + room[0] * drawn(seed, n, 2 + 2 * attempt)
            y = keep + room[1] * drawn(seed, n, 3 + 2 * attempt)
            root = math.sqrt(0.5)
            if isinstance(scatter.distance, float) and any(
                (x - one.middle[0]) ** 2 + (y - one.middle[1]) ** 2
                < (side * root + one.side * root + scatter.distance) ** 2
                for one in found
            ):
                continue
            found.append(Copy(n, side, (x, y), turn))
            break
    return found
