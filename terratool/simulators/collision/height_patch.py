"""A height field of a simulator, with its place, and its cells that stand for ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.definition.findings import Bounds

SINK = 8.0
"""Depth of a height field's unused nodes, in reliefs, so that its sides are steep."""

STEP = 0.25
"""Least height of a wall, in errors."""

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class HeightPatch:
    """A height field: heights at evenly spaced nodes, where it has any ground.

    Attributes:
        bounds: west, south, east, north of the outermost nodes.
        heights: (n, m) float64 heights of the nodes, rows from the south.
        used: (n - 1, m - 1) bool, whether the field stands for a cell's ground.
        held: (n - 1, m - 1) bool, whether solids stand for a cell's ground.
        near: (n - 1, m - 1) bool, whether a cell is at a wall, where only lower ground is meant.
        surfaces: (n - 1, m - 1) int32 index of a cell's surface, -1 for none.
        mixed: (n - 1, m - 1) bool, whether a cell has several surfaces.
        misses: (n - 1, m - 1) float64 measured distance from the terrain; NaN at the void.
        slopes: whether walls in cells `near` them are slopes, as no solids stand for them.
    """

    bounds: Bounds
    heights: Floats
    used: Bools
    held: Bools
    near: Bools
    surfaces: Ints
    mixed: Bools
    misses: Floats
    slopes: bool = False

    @property
    def error(self) -> float:
        """Largest measured distance of a used cell from the terrain, but for cells at walls."""
        return float(self.misses[self.used & ~self.near].max(initial=0.0))

    @property
    def is_level(self) -> bool:
        """Whether all nodes are at one height, and all cells used and of one surface."""
        alike = np.ptp(self.heights) == 0.0 and np.ptp(self.surfaces) == 0
        return bool(alike and self.used.all() and not self.mixed.any())

    @property
    def cell(self) -> tuple[float, float]:
        """Width and height of a cell."""
        west, south, east, north = self.bounds
        rows, columns = self.used.shape
        return (east - west) / columns, (north - south) / rows

    @property
    def uncovered(self) -> Bools:
        """Cells whose ground neither the field nor a solid stands for, (n - 1, m - 1) bool."""
        return ~(self.used | self.held)

    @property
    def used_surfaces(self) -> list[int]:
        """Indices of the surfaces of used cells, ascending."""
        worn: list[int] = np.unique(self.surfaces[self.used]).tolist()
        return worn

    def crop(self, bottom: int, top: int, left: int, right: int) -> HeightPatch:
        """Return rows of cells from `bottom` to before `top`, columns from `left` to `right`."""
        west, south, _, _ = self.bounds
        dx, dy = self.cell
        part = slice(bottom, top), slice(left, right)
        return HeightPatch(
            (west + left * dx, south + bottom * dy, west + right * dx, south + top * dy),
            self.heights[bottom : top + 1, left : right + 1],
            self.used[part],
            self.held[part],
            self.near[part],
            self.surfaces[part],
            self.mixed[part],
            self.misses[part],
            self.slopes,
        )

    def at(self, row: Indices, column: Indices) -> Floats:
        """Return x, y, z of nodes by row and column, (…, 3)."""
        west, south, _, _ = self.bounds
        dx, dy = self.cell
        return np.stack([west + column * dx, south + row * dy, self.heights[row, column]], axis=-1)


def runs(patch: HeightPatch, cells: Bools) -> NDArray[Any]:
    """Return polygons of cells, those side by side from west to east as one rectangle."""
    west, south, _, _ = patch.bounds
    dx, dy = patch.cell
    row, column = np.nonzero(cells)
    begins = np.append(True, (np.diff(row) != 0) | (np.diff(column) != 1))[: len(row)]
    begin = np.flatnonzero(begins)
    end = np.append(begin[1:], len(row))[: len(begin)] - 1
    return np.asarray(
        shapely.box(
            west + column[begin] * dx,
            south + row[begin] * dy,
            west + (column[end] + 1) * dx,
            south + (row[end] + 1) * dy,
        )
    )


def misses_of(heights: Floats, k: int) -> Floats:
    """Return the largest distances of cells from the terrain, (n, m), from k + 1 samples a side.

    MuJoCo parts each cell from its south-west to its north-east corner.
    """
    nodes = heights[::k, ::k]
    southwest, southeast = nodes[:-1, :-1], nodes[:-1, 1:]
    northwest, northeast = nodes[1:, :-1], nodes[1:, 1:]
    found = np.zeros(southwest.shape)
    n, m = heights.shape
    for j in range(k + 1):
        for i in range(k + 1):
            u, v = i / k, j / k
            if v <= u:
                level = southwest + u * (southeast - southwest) + v * (northeast - southeast)
            else:
                level = southwest + v * (northwest - southwest) + u * (northeast - northwest)
            there = heights[j : n - k + j : k, i : m - k + i : k]
            np.maximum(found, np.abs(there - level), out=found)
    return found
