"""Cells that a vehicle reaches by its moves, and can return from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import traversability as kernels
from terratool.traversability.route.graph import moves_of

Bits = NDArray[np.unsignedinteger[Any]]
"""(height, width) uint8, 16, 32 or 64: headings of each cell as bits, the first in the lowest."""


class FloodPlaces(NamedTuple):
    """Turning and twins of the cells of a flood, (height, width) each.

    Attributes:
        turns: bool, cells at which the vehicle can turn on the spot; all of them if None.
        twins: int64, the next cell that is the same place, round; all differ if None.
    """

    turns: NDArray[np.bool_] | None = None
    twins: NDArray[np.int64] | None = None


EVERYWHERE = FloodPlaces()
"""The vehicle can turn on the spot at all cells, and all differ."""

Progress = Callable[[float], object]
"""A function that is called with the further share of the states that is done."""

_PARTS = 25
"""Approximate number of reports of progress."""


def bits_type(headings: int) -> np.dtype[Any]:
    """The smallest unsigned type, lowest byte first, that has a bit for each heading."""
    size = next(size for size in (1, 2, 4, 8) if headings <= 8 * size)
    return np.dtype(f"<u{size}")


def heading_bits(states: NDArray[np.bool_]) -> Bits:
    """Pack states, (headings, height, width) bool, into bits of the cells."""
    packed = np.packbits(states, axis=0, bitorder="little")
    dtype = bits_type(len(states))
    out = np.zeros((*states.shape[1:], dtype.itemsize), np.uint8)
    out[..., : len(packed)] = packed.transpose(1, 2, 0)
    return np.asarray(out.view(dtype)[..., 0])


@dataclass(frozen=True, slots=True)
class Connected:
    """Cells that are connected by moves, (height, width) bool each.

    Attributes:
        reached: cells that can be driven to from the first states.
        returned: reached cells from which the first states can be driven to again.
    """

    reached: NDArray[np.bool_]
    returned: NDArray[np.bool_]


def spread(
    bits: Bits,
    headings: int,
    begin: Bits,
    against: bool = False,
    progress: Progress | None = None,
    places: FloodPlaces = EVERYWHERE,
    radius: float = 0.0,
) -> Bits:
    """All states that moves lead to from the states `begin`; with `against`, that lead to these."""
    fresh, reached = begin & bits, np.zeros_like(bits)
    direction = kernels.AGAINST if against else kernels.ALONG
    moves = moves_of(headings, radius)
    _run_in_parts(
        bits.size * headings,
        lambda states: kernels.flood(moves, direction, bits, places, fresh, reached, states),
        progress,
    )
    return reached


def _run_in_parts(states: int, go_on: Callable[[int], int], progress: Progress | None) -> None:
    """Run `go_on`, a kernel over at most `states` states, in parts, and report after each.

    Between parts a user can stop it.
    """
    part, left = max(states // _PARTS, 1), 1.0
    while (done := go_on(part)) >= part:
        if progress:
            more = min(done / states, left)
            left -= more
            progress(more)
    if progress:
        progress(left)


def connected_cells(
    bits: Bits,
    headings: int,
    begin: Bits,
    progress: Progress | None = None,
    places: FloodPlaces = EVERYWHERE,
    radius: float = 0.0,
) -> Connected:
    """Cells that can be reached from states, and from which any of them can be reached again.

    Args:
        bits: states that can be driven.
        headings: number of headings.
        begin: states to begin from, as bits; those that cannot be driven count for nothing.
        progress: called with shares that add to 1 for the way there, and to 1 for the way back.
        places: what is known of the cells.
        radius: least radius in which it turns, in sides of a cell; 0 if it turns on the spot.
    """
    there = spread(bits, headings, begin, False, progress, places, radius)
    back = there & spread(bits, headings, begin, True, progress, places, radius)
    return Connected(there != 0, back != 0)


def begin_at(bits: Bits, cell: tuple[int, int]) -> Bits:
    """All states at a cell that can be driven, as bits."""
    begin = np.zeros_like(bits)
    begin[cell] = bits[cell]
    return begin


def begin_in_largest(
    bits: Bits, headings: int, progress: Progress | None = None, places: FloodPlaces = EVERYWHERE,
    radius: float = 0.0,
) -> Bits:  # fmt: skip
    """A state of the part of the ground with the most states, as bits; none without a part.

    A part is connected by moves that can each be undone at once, by backing up or by turning
    round. States that are reached from a part and return to it by other ways belong to the part,
    but do not count.
    """
    moves, parts = moves_of(headings, radius), np.zeros((2, 3), np.int64)
    begin, reached = np.zeros_like(bits), np.zeros_like(bits)
    _run_in_parts(
        bits.size * headings,
        lambda states: kernels.find_parts(moves, bits, places, begin, reached, parts, states),
        progress,
    )
    cell, heading, states = parts[1].tolist()
    if states:
        begin.flat[cell] = 1 << heading
    return begin


def can_turn_back(bits: Bits, headings: int) -> NDArray[np.bool_]:
    """Cells with a heading whose opposite can be driven, too, (height, width) bool."""
    half = headings // 2
    return np.asarray(bits & (bits >> half) & ((1 << half) - 1) != 0)


def place_in(
    bits: Bits, headings: int, found: Connected, places: FloodPlaces = EVERYWHERE
) -> tuple[int, int]:
    """A cell of connected ground near its middle, if possible one that leads to all of the ground.

    A cell leads to the whole part, and to nothing else, if the vehicle can turn there to all
    headings that can be driven.
    """
    before = ((bits << 1) | (bits >> (headings - 1))) & bits.dtype.type((1 << headings) - 1)
    first = bits & ~before
    together = found.returned & (first & (first - (first != 0)) == 0)
    if places.turns is not None:
        together &= places.turns
    inside = together if together.any() else found.returned
    middle = [
        float(np.average(np.arange(len(count)), weights=count))
        for count in (np.count_nonzero(inside, axis=1), np.count_nonzero(inside, axis=0))
    ]
    least, best = math.inf, (0, 0)
    for row in sorted(range(len(inside)), key=lambda row: abs(row - middle[0])):
        if abs(row - middle[0]) > least:
            break
        columns = np.flatnonzero(inside[row])
        if not len(columns):
            continue
        column = int(columns[np.argmin(abs(columns - middle[1]))])
        far = math.hypot(row - middle[0], column - middle[1])
        if far < least:
            least, best = far, (row, column)
    return best
