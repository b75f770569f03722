"""Where a vehicle gets to by its moves, from where, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.traversability.route.graph import moves_of
from terratool.traversability.route.paths import cell_of

Bits = NDArray[np.uint8]
"""(height, width, bytes): headings of each cell as bits, the first eight in the first byte."""


def heading_bits(states: NDArray[np.bool_]) -> Bits:
    """States, (headings, height, width), as bits of the cells."""
    return np.ascontiguousarray(
        np.packbits(states, axis=0, bitorder="little").transpose(1, 2, 0), np.uint8
    )


@dataclass(frozen=True, slots=True)
class Connected:
    """Cells that are connected by moves, (height, width) bool each.

    Attributes:
        reached: those that can be driven to from where it begins.
        returned: those of them from which that can be driven to again.
    """

    reached: NDArray[np.bool_]
    returned: NDArray[np.bool_]


def spread(bits: Bits, headings: int, begin: Bits, against: bool = False) -> Bits:
    """All states that moves lead to from those that begin; with `against`, that lead to these."""
    fresh, reached = begin & bits, np.zeros_like(bits)
    direction = kernels.AGAINST if against else kernels.ALONG
    kernels.flood(moves_of(headings), direction, bits, fresh, reached)
    return reached


def connected(bits: Bits, headings: int, begin: Bits) -> Connected:
    """What can be reached from states, and left again to any of them.

    Args:
        bits: what can be driven.
        headings: their number.
        begin: the states, alike; those that cannot be driven count for nothing.
    """
    there = spread(bits, headings, begin)
    back = there & spread(bits, headings, begin, against=True)
    return Connected(np.asarray(there.any(axis=2)), np.asarray(back.any(axis=2)))


def begin_at(bits: Bits, cell: tuple[int, int]) -> Bits:
    """All headings at a cell."""
    begin = np.zeros_like(bits)
    begin[cell] = bits[cell]
    return begin


def begin_from(bits: Bits, terrain: Terrain, grid: Grid, start: tuple[float, float]) -> Bits:
    """All headings at the cell of a place; none where the place has no ground."""
    if math.isnan(terrain.height(*start)):
        return np.zeros_like(bits)
    return begin_at(bits, cell_of(grid, *start))


def begin_in_largest(bits: Bits, headings: int) -> Bits:
    """A state of the largest part of the ground, by the number of states; none if there is none.

    A part is what is connected by moves that can each be made back at once, by backing up or
    by turning round. What is reached from it and returns to it by other ways belongs to it, too,
    but does not count.
    """
    begin = np.zeros_like(bits)
    kernels.largest_part(moves_of(headings), bits, begin, np.zeros_like(bits))
    return begin


def can_turn_back(bits: Bits, headings: int) -> NDArray[np.bool_]:
    """Cells with a heading whose opposite can be driven, too: (height, width)."""
    half = headings // 2
    states = np.unpackbits(bits, axis=2, count=headings, bitorder="little")
    pairs: Any = states[..., :half] & states[..., half:]
    return np.asarray(pairs.any(axis=2))
