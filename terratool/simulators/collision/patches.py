"""Height fields for curved ground, split where they are worst."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain
from terratool.simulators.collision.continuation import continue_ground
from terratool.simulators.collision.footing import Footing, footing_of, with_misses_at
from terratool.simulators.collision.height_patch import (
    STEP,
    Bools,
    Floats,
    HeightPatch,
    Ints,
    misses_of,
)
from terratool.simulators.collision.solids import VOID, GroundTriangles

CELLS = 96
"""Cells of a height field along its longer side."""
_SAMPLES = 4
"""Points along a cell's side, one end excluded, at which it is compared with the terrain."""
_CURVED = 0.75
"""Share of all height fields up to which curved ground and lines between surfaces split them."""
_STEEP = 2.0
"""Least side of a cell, in errors, of a field split for its error; smaller ones err at steps."""
_FINEST = 40.0
"""Least side of a cell, in errors, of a field split at lines between surfaces, or at walls."""
_PLENTY = 600
"""Height fields that are allowed at least, where fewer would spoil the ground."""
_NODES = 4_000_000
"""Most nodes of all height fields together."""
_FEWEST = 4
"""Least rows and columns of cells of a height field."""


@dataclass(frozen=True)
class Surroundings:
    """Ground that height fields stand for, and edges that they keep away from.

    Attributes:
        terrain: terrain, for heights and surfaces.
        corner: (2,) float64 world position of the zero of all other coordinates.
        walls: (k, 2, 2) float64 ends of walls, seen from above.
        sharp: (m, 2, 2) float64 ends of the edges that height fields leave out: walls, creases and
            those of the void.
        held: prepared area of the ground that has solids.
        ground: all of the ground, void included.
        max_error: largest distance of height fields from the terrain, along z.
    """

    terrain: Terrain
    corner: Floats
    walls: Floats
    sharp: Floats
    held: shapely.Geometry
    ground: GroundTriangles
    max_error: float

    @cached_property
    def points(self) -> Floats:
        """Corners of the ground, each once, (n, 3) float64, x ascending."""
        here = self.ground.surfaces > VOID
        return np.unique(self.ground.triangles[here].reshape(-1, 3), axis=0)

    @cached_property
    def wall_tree(self) -> shapely.STRtree:
        """Spatial index of the walls."""
        return shapely.STRtree(shapely.linestrings(self.walls))

    @cached_property
    def sharp_tree(self) -> shapely.STRtree:
        """Spatial index of the edges that height fields leave out."""
        return shapely.STRtree(shapely.linestrings(self.sharp))

    def height(self, x: Floats, y: Floats) -> Floats:
        """Return heights of the ground at x and y, floors of bores included; NaN at the void."""
        return np.asarray(self.terrain.ground(x + self.corner[0], y + self.corner[1]))

    def surface(self, x: Floats, y: Floats) -> Ints:
        """Return surface indices at columns x and rows y, which ascend, (rows, columns)."""
        near = self.ground.tree.query(shapely.box(x[0], y[0], x[-1], y[-1]))
        worn = np.unique(self.ground.surfaces[near])
        worn = worn[worn > VOID]
        if len(worn) == 1:
            return np.full((len(y), len(x)), worn[0])
        at = x[None, :] + self.corner[0], y[:, None] + self.corner[1]
        if self.terrain.storeys is None:
            return self.terrain.sample(*at).surface
        column = self.terrain.column(*at)
        return np.where(np.isneginf(column.bottom[..., 0]), column.surface[..., 0], -1)


@dataclass(frozen=True)
class LaidPatch:
    """A height field with measures of how well it stands for the ground.

    Attributes:
        patch: height field.
        around: ground and edges around it.
    """

    patch: HeightPatch
    around: Surroundings

    @cached_property
    def footing(self) -> Footing:
        """The height field without cells above the ground at walls."""
        return footing_of(self.patch, self.around.ground, self.around.max_error)

    @property
    def excess(self) -> float:
        """Error above the allowed one, away from walls; 0 if its cells are too small to split."""
        if min(self.patch.cell) < _STEEP * self.around.max_error:
            return 0.0
        return max(self.patch.error - self.around.max_error, 0.0)

    @property
    def border(self) -> float:
        """Area of cells of several surfaces; 0 if the cells are too small to split."""
        if min(self.patch.cell) < _FINEST * self.around.max_error:
            return 0.0
        mixed = self.patch.used & self.patch.mixed
        return float(math.prod(self.patch.cell) * np.count_nonzero(mixed))

    @property
    def rest(self) -> float:
        """Area of ground at walls without height field; 0 if the cells are too small to split."""
        if min(self.patch.cell) < _FINEST * self.around.max_error:
            return 0.0
        return float(shapely.area(self.footing.parts).sum())


def lay_patches(around: Surroundings, extent: Bounds, most: int, spoilt: float) -> list[LaidPatch]:
    """Lay height fields over the ground that solids do not stand for.

    The worst fields are split in four, until all are good or they are too many: first those far
    from the ground, then those where surfaces meet, then those with much ground left at walls.

    Args:
        around: ground and edges around the height fields.
        extent: west, south, east, north of the ground.
        most: most height fields, where these do not spoil the ground.
        spoilt: error above which the ground is spoilt, and more height fields are allowed.
    """
    laid = list(_lay(around, extent))
    far = spoilt - around.max_error
    laid = _split(laid, lambda one: max(one.excess - far, 0.0), max(most, _PLENTY))
    laid = _split(laid, lambda one: one.excess, int(_CURVED * most))
    laid = _split(laid, lambda one: one.border, int(_CURVED * most))
    return _split(laid, lambda one: one.rest, most)


def spread(laid: list[LaidPatch], most: int) -> list[LaidPatch]:
    """Split the worst height fields away from walls, until there are `most`."""
    most -= sum(len(one.footing.patch.used_surfaces) - len(one.patch.used_surfaces) for one in laid)
    laid = _split(laid, lambda one: 0.0 if one.patch.near.any() else one.excess, most)
    return _split(laid, lambda one: 0.0 if one.patch.near.any() else one.border, most)


def _lay(around: Surroundings, bounds: Bounds) -> Iterator[LaidPatch]:
    """Yield the height fields of a rectangle, the void left out."""
    for patch in _without_void(_patch(around, bounds)):
        yield LaidPatch(with_misses_at(patch, around.points), around)


def _split(
    laid: list[LaidPatch], badness: Callable[[LaidPatch], float], most: int
) -> list[LaidPatch]:
    """Split the worst height field in four, until none is bad or they would be too many."""
    queue = [(-badness(one), number, one) for number, one in enumerate(laid)]
    heapq.heapify(queue)
    number, size = len(queue), _size(laid)
    while queue[0][0] < 0.0:
        _, _, worst = queue[0]
        west, south, east, north = worst.patch.bounds
        x, y = 0.5 * (west + east), 0.5 * (south + north)
        parts = [
            one
            for bottom, top in ((south, y), (y, north))
            for left, right in ((west, x), (x, east))
            for one in _lay(worst.around, (left, bottom, right, top))
        ]
        size += _size(parts) - _size([worst])
        if (size > (_NODES, most)).any():
            break
        heapq.heappop(queue)
        for one in parts:
            number += 1
            heapq.heappush(queue, (-badness(one), number, one))
    return [one for _, _, one in sorted(queue, key=lambda item: item[1])]


def _size(laid: list[LaidPatch]) -> NDArray[np.intp]:
    """Return the number of nodes of height fields, and of fields, one for each surface: (2,)."""
    used = [one.patch for one in laid if one.patch.used.any()]
    return np.array(
        [sum(one.heights.size for one in used), sum(len(one.used_surfaces) for one in used)]
    )


def _patch(around: Surroundings, bounds: Bounds) -> HeightPatch:
    """Return the height field of a rectangle, compared with the terrain."""
    west, south, east, north = bounds
    longer = max(east - west, north - south)
    columns = max(_FEWEST, round(CELLS * (east - west) / longer))
    rows = max(_FEWEST, round(CELLS * (north - south) / longer))
    k = _SAMPLES
    x, y = np.linspace(west, east, columns * k + 1), np.linspace(south, north, rows * k + 1)
    heights = around.height(x[None, :], y[:, None])
    cell = (east - west) / columns, (north - south) / rows
    left, bottom = np.meshgrid(x[:-1:k], y[:-1:k])
    boxes = shapely.box(left, bottom, left + cell[0], bottom + cell[1])
    low = _lower_at_walls(around, heights[::k, ::k], x[::k], y[::k])
    nodes, near = _continue_behind_walls(around, low, bounds, cell)
    misses = misses_of(heights, k)
    # walls of the mesh are chords: the terrain's own walls may lie on their other side
    e = around.max_error
    wide = shapely.box(left - e, bottom - e, left + cell[0] + e, bottom + cell[1] + e)
    sharp, _ = around.sharp_tree.query(wide.ravel(), predicate="intersects")
    near.flat[sharp] = True
    held = shapely.covers(around.held, boxes)
    misses[_void_cells(around.ground, left, bottom, cell)] = np.nan
    surfaces, mixed = _surfaces(around.surface(x, y), k)
    return HeightPatch(
        bounds, nodes, np.isfinite(misses) & ~held, held, near, surfaces, mixed, misses
    )


def _lower_at_walls(around: Surroundings, nodes: Floats, x: Floats, y: Floats) -> Floats:
    """Return heights at nodes, where those at a wall of the mesh are on the lower ground beside.

    The chord of a round wall has some of the higher ground before it.
    """
    if not len(around.walls):
        return nodes
    e = around.max_error
    columns, rows = np.meshgrid(x, y)
    places = shapely.points(columns, rows).ravel()
    at = np.unique(around.wall_tree.query(places, predicate="dwithin", distance=e)[0])
    out = nodes.copy()
    for east, north in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        beside = around.height(columns.flat[at] + 2.0 * e * east, rows.flat[at] + 2.0 * e * north)
        out.flat[at] = np.fmin(out.flat[at], beside)
    out[np.isnan(nodes)] = np.nan
    return out


def _surfaces(samples: Ints, k: int) -> tuple[Ints, Bools]:
    """Return surfaces at cell middles, (n, m) int32, and whether cells have several, (n, m)."""
    n, m = samples.shape
    low, high = (
        least.reduce([samples[j : n - k + j : k, i : m - k + i : k] for j, i in np.ndindex(k, k)])
        for least in (np.minimum, np.maximum)
    )
    return samples[k // 2 :: k, k // 2 :: k], low != high


def _void_cells(
    ground: GroundTriangles, left: Floats, bottom: Floats, cell: tuple[float, float]
) -> Bools:
    """Whether cells have any void, (n, m), however narrow."""
    found = np.zeros(left.shape, np.bool_)
    dx, dy = cell
    around = shapely.box(left[0, 0], bottom[0, 0], left[-1, -1] + dx, bottom[-1, -1] + dy)
    if not len(ground.void_tree.query(around)):
        return found
    inset = 1e-6 * dx, 1e-6 * dy
    inner = shapely.box(
        left + inset[0], bottom + inset[1], left + dx - inset[0], bottom + dy - inset[1]
    )
    found.flat[ground.void_tree.query(inner.ravel(), predicate="intersects")[0]] = True
    return found


def _continue_behind_walls(
    around: Surroundings, nodes: Floats, bounds: Bounds, cell: tuple[float, float]
) -> tuple[Floats, Bools]:
    """Return nodes, where lower ground goes on behind walls, and the cells that this changes."""
    west, south, east, north = bounds
    low, high = around.walls.min(axis=1), around.walls.max(axis=1)
    margin = np.array(cell)
    here = (low < np.array([east, north]) + margin) & (high > np.array([west, south]) - margin)
    walls = (around.walls[here.all(axis=1)] - [west, south]) / cell

    def height(x: Floats, y: Floats) -> Floats:
        return around.height(west + x * cell[0], south + y * cell[1])

    found = continue_ground(nodes, walls, height, STEP * around.max_error)
    changed = (found != nodes) & np.isfinite(nodes)
    cells = changed[:-1, :-1] | changed[1:, :-1] | changed[:-1, 1:] | changed[1:, 1:]
    return found, cells


def _without_void(patch: HeightPatch) -> Iterator[HeightPatch]:
    """Yield the parts of a patch without void cells, as a height field has no holes."""
    void = np.isnan(patch.misses)
    rows, columns = np.flatnonzero(void.any(axis=1)), np.flatnonzero(void.any(axis=0))
    if not len(rows) or not patch.used.any():
        yield patch
        return
    n, m = void.shape
    bottom, top, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    around = [(0, bottom, 0, m), (top, n, 0, m), (bottom, top, 0, left), (bottom, top, right, m)]
    for a, b, c, d in around:
        if a < b and c < d:
            yield from _without_void(patch.crop(a, b, c, d))
    middle = patch.crop(bottom, top, left, right)
    if min(middle.used.shape) < _FEWEST or np.isnan(middle.misses).all():
        yield replace(middle, used=np.zeros_like(middle.used))
        return
    n, m = middle.used.shape
    if n > m:
        halves = (0, n // 2, 0, m), (n // 2, n, 0, m)
    else:
        halves = (0, n, 0, m // 2), (0, n, m // 2, m)
    for half in halves:
        yield from _without_void(middle.crop(*half))
