"""Kinds of cells of a tree: cells with the same sides are of one kind."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from msgspec import UNSET

from terratool.definition.exact import Sides, sides
from terratool.definition.model import Pair, pair_of
from terratool.definition.tree import Tree

FREE = -1
"""Kind of the cell around a free place, whose sides are its own."""


class CellOrigin(NamedTuple):
    """Derivation of the sides of a kind of cells.

    Attributes:
        around: kind of the parent's cell, or `FREE`.
        span: columns and rows of the parent's grid that the cell takes; its sides at a free place.
        grid: columns and rows of the parent's grid.
    """

    around: int
    span: Pair
    grid: tuple[int, int]


class CellKinds(NamedTuple):
    """Cells of all elements of a tree, by kind.

    Attributes:
        of: (elements,) kind of each element's cell; a root's kind is its own index.
        origins: (kinds,) derivation of each kind's sides, always from an earlier kind; None for a
            root.
    """

    of: list[int]
    origins: list[CellOrigin | None]


def cell_kinds(tree: Tree) -> CellKinds:
    """Kinds of the cells of a tree, computed once for each tree."""
    known: CellKinds | None = tree.notes.get("cell kinds")
    if known is None:
        known = tree.notes["cell kinds"] = _number_cells(tree)
    return known


def _number_cells(tree: Tree) -> CellKinds:
    roots = min(len(tree.roots), len(tree))
    of = list(range(roots))
    numbers: dict[CellOrigin, int] = {}
    extents = tree.column("extent") if tree.distinct("extent") != {UNSET} else None
    all_single = extents is None and tree.distinct("span") == {UNSET}

    def number(origin: CellOrigin) -> int:
        return numbers.setdefault(origin, roots + len(numbers))

    for parent, begin, end in tree.families:
        around, grid = of[parent], tree.grid(parent)
        if all_single:
            of += [number(CellOrigin(around, (1, 1), grid))] * (end - begin)
            continue
        for index in range(begin, end):
            if extents is not None and extents[index] is not UNSET:
                origin = CellOrigin(FREE, pair_of(extents[index], math.nan), (1, 1))
            else:
                origin = CellOrigin(around, tree.block(index)[2:], grid)
            of.append(number(origin))
    return CellKinds(of, [*[None] * roots, *numbers])


def shares_of(kinds: CellKinds, size: Pair) -> list[Pair]:
    """Sides (x, y) of each kind of cells over those of the terrain, whose sides are `size`.

    A part is taken as if it covered the terrain.
    """
    shares: list[Pair] = []
    for origin in kinds.origins:
        if origin is None:
            shares.append((1.0, 1.0))
            continue
        (w, h), grid = origin.span, origin.grid
        if origin.around == FREE:
            shares.append((w / size[0], h / size[1]))
        else:
            width, height = shares[origin.around]
            shares.append((width * w / grid[0], height * h / grid[1]))
    return shares


def default_scales(kinds: CellKinds, size: Pair) -> Iterator[float]:
    """Yield the vScale of elements without one for each kind of cells, to the bit of the field.

    A part is taken as if it covered the terrain, whose sides are `size`.
    """
    whole = sides(size)
    cells: list[Sides] = []
    for origin in kinds.origins:
        if origin is None:
            cells.append(whole)
            lengths = size
        elif origin.around == FREE:
            cells.append(sides(origin.span))
            lengths = origin.span
        else:
            around, (columns, rows) = cells[origin.around], map(int, origin.span)
            cells.append(around.block((columns, rows), origin.grid))
            pitch = around.block((1, 1), origin.grid).lengths
            lengths = (pitch[0] * columns, pitch[1] * rows)
        yield min(lengths[0] / size[0], lengths[1] / size[1])
