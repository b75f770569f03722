"""Addresses of points in the nested grids: the cell of each level that holds a point, or Ψ.

The paper finds the cell of a place by thresholds, i = Ψ_m(x) and j = Ψ_m(y), and the cells of finer
levels from the remainder, Ψ_m(Res_m(x)), Res_m being the distance to the next smaller threshold
(Pryanichnikov and Shipovalov 2016, section 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.field.records import IN_CELLS, FieldArrays
from terratool.field.tracks import without_tracks
from terratool.field.types import points_of
from terratool.kernels import field as kernels

if TYPE_CHECKING:
    from terratool.field.types import TerrainField

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class CellAddress:
    """Cells that hold points, from the root's grid inwards; arrays begin with the points' shape.

    Attributes:
        cells: (…, levels, 2) int64, i from the west and j from the south on each level; -1 on
            levels below the point's last cell, and outside of the terrain.
        elements: (…, levels) int64, index of the element whose grid has the cell; -1 where there is
            no cell.
    """

    cells: Ints
    elements: Ints


def addresses(terrain: TerrainField, x: ArrayLike, y: ArrayLike) -> CellAddress:
    """Return the cells that hold points, level by level.

    The path leads from the root to the deepest element whose footprint holds the point. Each
    element with children on the path contributes one level. Nothing within the last cell holds the
    point. For an element with a span, the level has the cell of the block that holds the point.
    Elements at free places stand in no cell: the grid of an element whose children all do so has
    one cell. A cell includes its west and south edges, as in the field.

    Args:
        terrain: terrain with the grids; if its parts are shared, it is written out.
        x: world positions of the points along x.
        y: world positions of the points along y; broadcast with `x`.

    Raises:
        RequestError: the parts of the terrain come to too many elements.
    """
    whole = terrain.written_out
    x, y = points_of(x, y)
    shape, levels = x.shape, max(whole.levels - 1, 0)
    x, y = x.ravel(), y.ravel()
    arrays = whole.arrays
    grids = _grids_of(arrays)
    chain = _chains(whole.parents, _tops(whole, x, y), whole.levels)[:, :levels]
    elements = np.where((chain >= 0) & (grids[chain] >= 0), chain, -1)
    elements[_is_beside_cell(whole, grids, elements, x, y)] = -1
    cells = np.full((len(x), levels, 2), -1, np.int64)
    for level in range(levels):
        at = np.flatnonzero(elements[:, level] >= 0)
        grid = grids[elements[at, level]]
        for axis, values in enumerate((x, y)):
            cells[at, level, axis] = _cells_along(arrays, grid, axis, values[at])
    return CellAddress(cells.reshape(*shape, levels, 2), elements.reshape(*shape, levels))


def _tops(terrain: TerrainField, x: NDArray[np.float64], y: NDArray[np.float64]) -> Ints:
    """Deepest elements that hold points, tracks ignored; below 0 for none."""
    top = terrain.sample(x, y).element
    tracked = np.flatnonzero(top >= len(terrain.arrays.elements))
    if len(tracked):
        bare = kernels.Field(without_tracks(terrain.arrays))
        found, height = np.empty(len(tracked), np.int64), np.empty(len(tracked))
        places = np.ascontiguousarray(x[tracked]), np.ascontiguousarray(y[tracked])
        surface, gradient = np.empty(len(tracked), np.int32), np.empty((len(tracked), 2))
        kernels.samples(bare, *places, height, found, surface, gradient)
        top[tracked] = found
    return top


def _grids_of(arrays: FieldArrays) -> Ints:
    """Grid of cells of each element, or its only grid of free places; -1 without children."""
    first = arrays.elements["grid"].astype(np.int64)
    grid = first.copy()
    standing, more = arrays.grids["standing"], arrays.grids["more"]
    while True:
        on = (grid > 0) & (standing[grid] != IN_CELLS) & (more[grid] != 0)
        if not on.any():
            break
        grid[on] += 1
    none = (grid > 0) & (standing[grid] != IN_CELLS)
    grid[none] = first[none]
    return np.asarray(np.where(first > 0, grid, -1), np.int64)


def _chains(parents: NDArray[np.int32], tops: Ints, levels: int) -> Ints:
    """Elements from the root to each of some elements, (n, levels) int64, then -1."""
    unique, index = np.unique(np.maximum(tops, -1), return_inverse=True)
    upward = np.full((len(unique), levels), -1, np.int64)
    at = unique
    for step in range(levels):
        upward[:, step] = at
        at = np.where(at > 0, parents[np.maximum(at, 0)], -1)
    depth = (upward >= 0).sum(axis=1)
    turned = depth[:, None] - 1 - np.arange(levels)
    chain = np.take_along_axis(upward, np.maximum(turned, 0), axis=1)
    return np.asarray(np.where(turned >= 0, chain, -1)[index])


def _is_beside_cell(
    terrain: TerrainField,
    grids: Ints,
    elements: Ints,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Mask of points that lie in the footprint of a turned element, but beside its cell."""
    arrays = terrain.arrays
    poses = arrays.poses[arrays.elements["pose"][elements]]
    out = np.zeros(elements.shape, bool)
    places = np.argwhere((elements >= 0) & (poses["free"] != 0) & (poses["turned"] != 0))
    for point, level in places.tolist():
        grid = arrays.grids[grids[elements[point, level]]]
        for axis, value in enumerate((x[point], y[point])):
            low, high = (_edge(grid, axis, int(k)) for k in (0, grid["count"][axis]))
            end = terrain.bounds[axis + 2]
            held = low <= value and (value < high or value == high >= end)
            out[point, level] |= not held
    return out


def _cells_along(
    arrays: FieldArrays, grid: Ints, axis: int, values: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Cell numbers along one axis of the grids that hold values, (n,) int64."""
    own = arrays.grids[grid]
    count = own["count"][:, axis]
    corner = own["corner"][:, axis]
    place = ((values - corner[:, 0]) - corner[:, 1]) * own["per"][:, axis]
    cell = np.floor(place)
    # near an edge, the edge's double decides
    nearest = np.floor(place + 0.5)
    near = np.flatnonzero((np.abs(place - nearest) < own["near"][:, axis]) & (own["local"] == 0))
    keys, which = np.unique(
        np.stack([grid[near], nearest[near].astype(np.int64)]), axis=1, return_inverse=True
    )
    edges = np.array([_edge(arrays.grids[g], axis, k) for g, k in keys.T.tolist()], np.float64)
    if len(near):
        beyond = values[near] >= edges[which.ravel()]
        cell[near] = np.where(beyond, nearest[near], nearest[near] - 1.0)
    for point in np.flatnonzero(own["local"]).tolist():
        low, side = _exact(own[point], axis)
        cell[point] = (Fraction(float(values[point])) - low) // side
    return np.asarray(np.clip(cell, 0.0, count - 1.0), np.int64)


def _exact(grid: Any, axis: int) -> tuple[Fraction, Fraction]:
    """Corner and side of the cells of a grid along an axis, exactly."""
    low, side = (sum(map(Fraction, grid[name][axis].tolist())) for name in ("corner", "pitch"))
    return Fraction(low), Fraction(side)


def _edge(grid: Any, axis: int, number: int) -> float:
    """Return the double at which an edge stands: `nearest_double` of kernels/field/primitives.hpp.

    The side is known to about 2^-85 of its size. An edge as near as that to the middle between two
    doubles is rounded to the even one.
    """
    low, side = _exact(grid, axis)
    exact = low + number * side
    if grid["corner"][axis, 0] != 0.0 and abs(exact) <= grid["zero"][axis]:
        return 0.0  # only rounding is left
    total = float(exact)
    rest = exact - Fraction(total)
    other = math.nextafter(total, math.inf if rest > 0 else -math.inf)
    gap = abs(Fraction(other) - Fraction(total))
    if abs(abs(rest) - gap / 2) > gap / 2**28:
        return total
    return other if int(np.float64(total).view(np.uint64)) & 1 else total
