"""A height field straight from a grid of heights that is all ground of a terrain."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.bounds import with_holes
from terratool.field.records import COMBINE
from terratool.field.terrain import Terrain
from terratool.simulators.collision.height_patch import SINK, Bools, Floats, HeightPatch, Ints

MOST_NODES = 40_000_000
"""Most nodes of a height field; MuJoCo loads 36 million in half a second."""
_FINE_NODES = 4_000_000
"""Most nodes of a height field that is finer than its grid."""
_NEAR = 1e-6
"""Distance from a node at the void at which its ground is asked, in cells."""
_ROUNDING = 2.0**-23
"""Error of heights in float32, stretched to 0 … 1 and back, in parts of the relief."""


class _Lattice(NamedTuple):
    """Evenly spaced nodes over a terrain: those of its grid, and others between them.

    Attributes:
        bounds: west, south, east, north of the outermost nodes.
        cells: columns and rows of cells.
        aligned: whether no cell is void in part, so that nodes stand on the edges of pixels.
    """

    bounds: Bounds
    cells: tuple[int, int]
    aligned: bool

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return math.prod(count + 1 for count in self.cells)

    def lines(self, axis: int) -> Floats:
        """Return the x (axis 0) or y (axis 1) of nodes."""
        return np.linspace(self.bounds[axis], self.bounds[axis + 2], self.cells[axis] + 1)

    def middles(self, axis: int) -> Floats:
        """Return the x (axis 0) or y (axis 1) of the middles of cells."""
        lines = self.lines(axis)
        return 0.5 * (lines[:-1] + lines[1:])


def is_one_grid(terrain: Terrain) -> bool:
    """Whether all ground of a terrain is one grid of heights, on which nothing stands or lies.

    Its surfaces may differ by classes, but none of these is void.
    """
    arrays = terrain.arrays
    root, kind = arrays.elements[0], arrays.kinds[arrays.elements["kind"][0]]
    if terrain.is_shared or len(arrays.elements) > 1 or root["pose"] or terrain.tracks:
        return False
    if kind["combine"] != COMBINE["grid"] or kind["is_void"] or terrain.is_rough:
        return False
    return kind["classes"] < 0 or not arrays.classes.of(kind).voids.any()


def grid_patch(terrain: Terrain, max_error: float) -> HeightPatch | None:
    """Return a height field of the nodes of a grid, and of others between where these are too few.

    Args:
        terrain: terrain for which `is_one_grid` holds.
        max_error: largest distance from the terrain, units of the terrain; `error` of the field is
            more where that would take too many nodes.

    Returns:
        The height field, from the south-west corner of the terrain; None where the grid itself has
        too many numbers.
    """
    plain = _lattice(terrain, 1)
    if plain.nodes > MOST_NODES:
        return None
    found, spaces = _patch(terrain, plain), 1
    most = max(1, math.isqrt(_FINE_NODES // plain.nodes) // 2 * 2)
    # pixels have no nodes on their edges, and a surface as wide as a cell none of its own
    least = 2 if not plain.aligned or len(found.used_surfaces) > 1 else 1
    while spaces < most:
        # the error falls with the square of the spaces
        over = math.sqrt(found.error / max_error)
        wanted = max(least, math.ceil(spaces * min(over, most)))
        if wanted <= spaces:
            break
        spaces = min(wanted + wanted % 2, most)
        found = _patch(terrain, _lattice(terrain, spaces))
    return found


def error_of_pixels(terrain: Terrain) -> float:
    """Return the error of two triangles for each square of four numbers of a grid; 0 if too many.

    Args:
        terrain: terrain for which `is_one_grid` holds.
    """
    plain = _lattice(terrain, 1)
    return 0.0 if plain.nodes > MOST_NODES else _patch(terrain, plain).error


def _lattice(terrain: Terrain, spaces: int) -> _Lattice:
    """Return the nodes of a grid, with a number of spaces between two of them: 1 or an even one."""
    arrays = terrain.arrays
    raster = arrays.curves.rasters[arrays.kinds["raster"][arrays.elements["kind"][0]]]
    columns, rows = (int(count) for count in raster["count"])
    if not raster["pixel"]:
        cells = max(columns - 1, 1) * spaces, max(rows - 1, 1) * spaces
        return _Lattice(terrain.bounds, cells, aligned=True)
    if spaces > 1:
        return _Lattice(terrain.bounds, (columns * spaces, rows * spaces), aligned=True)
    west, south, east, north = terrain.bounds
    x, y = 0.5 * (east - west) / columns, 0.5 * (north - south) / rows
    bounds = west - x, south - y, east + x, north + y
    return _Lattice(bounds, (columns + 1, rows + 1), aligned=False)


def _patch(terrain: Terrain, lattice: _Lattice) -> HeightPatch:
    """Return the height field of nodes, with its exact error.

    A plane through three corners of a cell is off its ground, which is bilinear, by at most a
    quarter of the difference between the sums of opposite corners.
    """
    arrays = terrain.arrays
    root = arrays.elements["kind"][0]
    kind, voids = arrays.kinds[root], with_holes(arrays)[root]
    x, y, middle_x, middle_y = (ask(n) for ask in (lattice.lines, lattice.middles) for n in (0, 1))
    heights = _over(terrain, terrain.height, x, y)
    used = np.ones((len(middle_y), len(middle_x)), np.bool_)
    if voids and lattice.aligned:
        used = ~np.isnan(_over(terrain, terrain.height, middle_x, middle_y))
        _add_rims(terrain, heights, x, y)
    elif voids:
        void = np.isnan(heights)
        used = ~(void[:-1, :-1] | void[:-1, 1:] | void[1:, :-1] | void[1:, 1:])
    if kind["classes"] >= 0:
        worn = _over(terrain, lambda *at: terrain.sample(*at).surface, middle_x, middle_y)
        surfaces = worn.astype(np.int32)
    else:
        surfaces = np.full(used.shape, kind["surface"], np.int32)
    misses = heights[:-1, :-1] - heights[:-1, 1:]  # one array, as large grids fill the memory
    misses += heights[1:, 1:]
    misses -= heights[1:, :-1]
    np.abs(misses, out=misses)
    misses *= 0.25
    relief = np.nanmax(heights, initial=-np.inf) - np.nanmin(heights, initial=np.inf)
    sunk = not used.all() or len(np.unique(surfaces[used])) > 1
    misses += _ROUNDING * relief * (1.0 + SINK * sunk) + _NEAR * relief * voids
    none = np.zeros(used.shape, np.bool_)
    corner = terrain.bounds[:2] * 2
    west, south, east, north = (
        end - zero for end, zero in zip(lattice.bounds, corner, strict=True)
    )
    return HeightPatch(
        (west, south, east, north), heights, used, none, none, surfaces, _differ(surfaces), misses
    )


def _over(
    terrain: Terrain, ask: Callable[[Floats, Floats], NDArray[Any]], x: Floats, y: Floats
) -> Floats:
    """Return what is asked at each x and y, (y, x); beyond the terrain, what is on its border."""
    west, south, east, north = terrain.bounds
    out, x = np.empty((len(y), len(x))), x.clip(west, east)
    for row, at in zip(out, y.clip(south, north), strict=True):
        row[:] = ask(x, np.full(len(x), at))
    return out


def _add_rims(terrain: Terrain, heights: Floats, x: Floats, y: Floats) -> None:
    """Replace heights of nodes on the edge of the void by those that the ground beside them has."""
    # far from zero, some steps of doubles are more
    dx, dy = (
        min(max(_NEAR * (at[1] - at[0]), 8.0 * float(np.spacing(np.abs(at).max()))),
            0.5 * (at[1] - at[0]))
        for at in (x, y)
    )  # fmt: skip
    for east, north in ((dx, dy), (-dx, dy), (dx, -dy), (-dx, -dy)):
        row, column = np.nonzero(np.isnan(heights))
        heights[row, column] = terrain.height(x[column] + east, y[row] + north)


def _differ(surfaces: Ints) -> Bools:
    """Whether cells have a neighbour of another surface, and may so have several themselves."""
    out = np.zeros(surfaces.shape, np.bool_)
    for one, other in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        edge = surfaces[one] != surfaces[other]
        out[one] |= edge
        out[other] |= edge
    return out
