"""Height fields for ground without walls: coarse where it is smooth, finer where it is not."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from terratool.definition.findings import Bounds
from terratool.field.bounds import finest_details
from terratool.field.records import COMBINE
from terratool.field.terrain import Terrain
from terratool.raster.painter import Painter
from terratool.simulators.collision.height_patch import (
    Bools,
    Floats,
    HeightPatch,
    Ints,
    misses_of,
)

_CELLS = 64
"""Cells along the longer side of a block, before it is made coarser."""
_FEWEST = 8
"""Cells along the shorter side of a block, of which all other numbers are multiples, about."""
_SAMPLES = 4
"""Points along a cell's side, one end excluded, at which it is compared with the terrain."""
_STRIP = 500_000
"""Most of these points that are asked for at a time."""
_NODES = 4_000_000
"""Most nodes of all height fields together."""
_WALKED = 0.05
"""Side of the cells of ground that is rough all over, units of the terrain: each cell beneath a
body takes time at each step, and finer ones help little where none of them is right."""
_FINEST = 2.0, 10.0
"""Least side of a cell, in errors: at any rate, and where that is less than half of `_WALKED`."""
_ROUGH = 0.5
"""Share of cells too far off above which ground is rough all over."""
_BORDER = 40.0
"""Side of a cell, in errors, above which blocks are split at lines between surfaces."""
_INSIDE = 1e-8
"""Distance from the edge of an area at which its outermost nodes are asked, in its longer side."""
UPRIGHT = 5.0
"""Slope above which ground is a wall."""


@dataclass(frozen=True)
class GroundSampler:
    """Heights and surfaces of the ground at nodes of lattices.

    Attributes:
        terrain: terrain with all parts written out.
    """

    terrain: Terrain

    @cached_property
    def _painter(self) -> Painter:
        return Painter(self.terrain.ground_alone, None, np.float64)

    @cached_property
    def _sloping(self) -> Painter:
        return Painter(self.terrain.ground_alone, None, np.float64, surfaces=False, slopes=True)

    def slopes_at(self, x: Floats, y: Floats) -> Floats:
        """Return slopes to the east and to the north, (2, m, n), at nodes as those of `at`."""
        planes = self._sloping.paint_lattice(x, y)
        assert planes.slope_x is not None and planes.slope_y is not None
        return np.stack([planes.slope_x[::-1], planes.slope_y[::-1]])

    @cached_property
    def _details(self) -> tuple[Floats, Floats]:
        """Footprints of elements, (4, n), and the shortest straight stretch of each, (n,)."""
        west, south, east, north = cells = self.terrain.cells()
        return cells, finest_details(self.terrain.arrays, east - west, north - south)

    def stretch_in(self, bounds: Bounds) -> float:
        """Return the shortest straight stretch of the ground in a rectangle; inf for none."""
        (west, south, east, north), details = self._details
        here = (west < bounds[2]) & (east > bounds[0]) & (south < bounds[3]) & (north > bounds[1])
        return float(details[here].min(initial=math.inf))

    @cached_property
    def _widths(self) -> tuple[Floats, Floats]:
        """Cells of elements with a surface, (4, n), and the shorter side of each, (n,).

        Discs without height are left out: they are domes that solids stand for.
        """
        arrays, cells = self.terrain.arrays, self.terrain.cells()
        elements, kinds = arrays.elements, arrays.kinds[arrays.elements["kind"]]
        flat = (elements["scale"] == 0.0) & (elements["offset"] == 0.0)
        worn = (kinds["surface"] >= 0) & ~(flat & (kinds["combine"] == COMBINE["radial"]))
        cells = cells[:, worn]
        return cells, (cells[2:] - cells[:2]).min(axis=0)

    def narrowest_in(self, bounds: Bounds) -> float:
        """Return the shortest side of an element with a surface in a rectangle; inf for none."""
        (west, south, east, north), widths = self._widths
        here = (west < bounds[2]) & (east > bounds[0]) & (south < bounds[3]) & (north > bounds[1])
        return float(widths[here].min(initial=math.inf))

    def at(self, x: Floats, y: Floats) -> tuple[Floats, Ints]:
        """Return heights and surface indices at evenly spaced columns x and rows y, which ascend.

        Heights are those of the ground, floors of bores included, and NaN over the void.
        """
        planes = self._painter.paint_lattice(x, y)
        assert planes.surfaces is not None
        heights, surfaces = planes.heights[::-1], planes.surfaces[::-1].astype(np.int32) - 1
        storeys = self.terrain.storeys
        if storeys is None:
            return heights, surfaces
        columns, rows = (one.ravel() for one in np.meshgrid(x, y))
        near = np.flatnonzero(storeys.near(columns, rows))
        if len(near):
            column = self.terrain.column(columns[near], rows[near])
            solid = np.isneginf(column.bottom[:, 0])
            heights, surfaces = heights.copy(), surfaces.copy()
            heights[np.divmod(near, len(x))] = np.where(solid, column.top[:, 0], np.nan)
            surfaces[np.divmod(near, len(x))] = np.where(solid, column.surface[:, 0], -1)
        return heights, surfaces


@dataclass(eq=False)
class _Block:
    """A rectangle of evenly spaced nodes, or four blocks in its place.

    Attributes:
        bounds: west, south, east, north.
        cells: number of rows and of columns of cells.
        miss: measured distance from the ground along z.
        level: height and surface of a block that is all at one height; None for another.
        border: area of cells that have several surfaces, or may have.
        parts: the four blocks in its place; none for a height field.
    """

    bounds: Bounds
    cells: tuple[int, int]
    miss: float
    level: tuple[float, int] | None
    border: float
    parts: list[_Block] = field(default_factory=list)

    @property
    def nodes(self) -> int:
        return (self.cells[0] + 1) * (self.cells[1] + 1)

    @property
    def side(self) -> float:
        """Longer side of a cell."""
        west, south, east, north = self.bounds
        return max((east - west) / self.cells[1], (north - south) / self.cells[0])

    def leaves(self) -> Iterator[_Block]:
        """Yield the blocks that are height fields."""
        if not self.parts:
            yield self
        for part in self.parts:
            yield from part.leaves()


@dataclass
class Lattices:
    """Height fields of rectangles of ground, as few and as coarse as the error allows.

    The worst blocks are split in four until all are within the error, or their cells too small, or
    their nodes too many. Where ground is rough all over, cells have one size, of which its own
    straight stretches are multiples.

    Attributes:
        sampler: heights and surfaces of the ground.
        max_error: largest distance from the ground, along z.
        most: most height fields, about.
    """

    sampler: GroundSampler
    max_error: float
    most: int
    _nodes: int = 0

    def __post_init__(self) -> None:
        least, most = (times * self.max_error for times in _FINEST)
        self._finest = max(least, min(most, 0.5 * _WALKED))

    def lay(self, areas: list[Bounds], corner: Floats) -> list[HeightPatch]:
        """Return the height fields of rectangles.

        Args:
            areas: west, south, east, north of each in the world.
            corner: (2,) world position of the zero of the height fields.
        """
        found = [(area, self._uniform(area) or self._block(area, area)) for area in areas]
        self._nodes = sum(block.nodes for _, block in found)
        self._split(found, self._excess)
        self._split(found, self._border)
        if self._nodes < _NODES // 8:  # small terrains may have finer cells
            self._finest = _FINEST[0] * self.max_error
            self._split(found, self._excess)
        self._merge([block for _, block in found])
        return [self._patch(block, area, corner) for area, root in found for block in root.leaves()]

    def _excess(self, block: _Block) -> float:
        if block.side < 2.0 * self._finest:
            return 0.0
        return max(block.miss - self.max_error, 0.0)

    def _border(self, block: _Block) -> float:
        return block.border if block.side > _BORDER * self.max_error else 0.0

    def _split(
        self, found: list[tuple[Bounds, _Block]], badness: Callable[[_Block], float]
    ) -> None:
        """Split the worst block in four, until none is bad or the nodes would be too many."""
        queue: list[tuple[float, int, _Block, Bounds]] = []
        number = 0
        for area, root in found:
            for block in root.leaves():
                queue.append((-badness(block), number, block, area))
                number += 1
        heapq.heapify(queue)
        while queue and queue[0][0] < 0.0:
            _, _, worst, area = heapq.heappop(queue)
            if self._nodes + 3 * worst.nodes > _NODES:
                return
            west, south, east, north = worst.bounds
            x, y = 0.5 * (west + east), 0.5 * (south + north)
            worst.parts = [
                self._block((left, bottom, right, top), area)
                for bottom, top in ((south, y), (y, north))
                for left, right in ((west, x), (x, east))
            ]
            self._nodes += sum(part.nodes for part in worst.parts) - worst.nodes
            for part in worst.parts:
                heapq.heappush(queue, (-badness(part), number, part, area))
                number += 1

    def _merge(self, roots: list[_Block]) -> None:
        """Merge four blocks where that takes no more nodes, or while there are too many."""
        parents: dict[int, _Block] = {}
        queue: list[tuple[int, int, _Block]] = []
        numbers = itertools.count()

        def visit(block: _Block) -> int:
            for part in block.parts:
                parents[id(part)] = block
            count = sum(visit(part) for part in block.parts)
            offer(block)
            return count + (not block.parts)

        def offer(block: _Block) -> None:
            if not block.parts or any(part.parts for part in block.parts):
                return
            cost = _cells_of(block.parts)
            if cost is not None:
                nodes = (cost[0] + 1) * (cost[1] + 1) - sum(part.nodes for part in block.parts)
                heapq.heappush(queue, (nodes, next(numbers), block))

        count = sum(visit(root) for root in roots)
        while queue:
            more, _, block = heapq.heappop(queue)
            if more > 0 and (count <= self.most or self._nodes + more > 2 * _NODES):
                return
            cells = _cells_of(block.parts)
            assert cells is not None
            levels = {part.level for part in block.parts}
            block.level = levels.pop() if len(levels) == 1 else None
            block.cells, block.parts = cells, []
            self._nodes += more
            count -= 3
            if id(block) in parents:
                offer(parents[id(block)])

    def _uniform(self, area: Bounds) -> _Block | None:
        """Return the block of ground that is rough all over; None for other ground."""
        west, south, east, north = area
        stretch = min(self.sampler.stretch_in(area), 2.0 * _WALKED)
        side = stretch / max(1, math.ceil(stretch / _WALKED - 1e-6))
        if not side > 0.5 * _WALKED:
            side = _WALKED
        cells = max(1, round((north - south) / side)), max(1, round((east - west) / side))
        if math.prod(cells) > _NODES // _SAMPLES**2:
            return None
        patch = self._patch(_Block(area, cells, 0.0, None, 0.0), area, np.zeros(2))
        if np.count_nonzero(patch.misses > self.max_error) <= _ROUGH * patch.misses.size:
            return None
        return _Block(area, cells, 0.0, None, 0.0)

    def _axes(self, bounds: Bounds, area: Bounds, counts: tuple[int, int]) -> tuple[Floats, Floats]:
        """Return x and y of so many rows and columns, less one, of points in a block."""
        inside = _INSIDE * max(area[2] - area[0], area[3] - area[1])
        x, y = (
            np.linspace(
                max(bounds[axis], area[axis] + inside),
                min(bounds[axis + 2], area[axis + 2] - inside),
                count + 1,
            )
            for axis, count in ((0, counts[1]), (1, counts[0]))
        )
        return x, y

    def _block(self, bounds: Bounds, area: Bounds) -> _Block:
        """Return the block of a rectangle, as coarse as the error allows."""
        west, south, east, north = bounds
        wide, tall, longer = east - west, north - south, max(east - west, north - south)
        rows, columns = (
            _FEWEST * max(1, round(_CELLS / _FEWEST * side / longer)) for side in (tall, wide)
        )
        x, y = self._axes(bounds, area, (2 * rows, 2 * columns))
        heights, surfaces = self.sampler.at(x, y)
        own = surfaces[1::2, 1::2]
        mixed = _several(surfaces, 4)
        border = wide * tall * float(np.count_nonzero(mixed)) / mixed.size
        low, high = float(heights.min()), float(heights.max())
        if low == high and not border:
            return _Block(bounds, (1, 1), 0.0, (low, int(own[0, 0])), 0.0)
        if max(x[1] - x[0], y[1] - y[0]) > 0.5 * self.sampler.narrowest_in(bounds):
            border = wide * tall  # a surface may lie between the samples
        miss, stride = _surplus(heights), 1
        while not border and 2 * stride <= _FEWEST and miss <= self.max_error:
            # what finer nodes add is bounded by the sum of what each halving adds
            more = miss + _surplus(heights[::stride, ::stride][::2, ::2])
            if not more <= self.max_error:
                break
            miss, stride = more, 2 * stride
        return _Block(bounds, (rows // stride, columns // stride), miss, None, border)

    def _patch(self, block: _Block, area: Bounds, corner: Floats) -> HeightPatch:
        """Return the height field of a block, compared with the ground."""
        rows, columns = block.cells
        k = _SAMPLES
        x, y = self._axes(block.bounds, area, (rows * k, columns * k))
        nodes = np.empty((rows + 1, columns + 1))
        misses, near = np.empty((rows, columns)), np.zeros((rows, columns), np.bool_)
        own, mixed = np.empty((rows, columns), np.int32), np.empty((rows, columns), np.bool_)
        step = max(1, _STRIP // (k * len(x)))
        steep = UPRIGHT * (x[1] - x[0])
        for begin in range(0, rows, step):
            end = min(begin + step, rows)
            heights, surfaces = self.sampler.at(x, y[begin * k : end * k + 1])
            nodes[begin : end + 1] = heights[::k, ::k]
            misses[begin:end] = misses_of(heights, k)
            own[begin:end] = surfaces[k // 2 :: k, k // 2 :: k]
            mixed[begin:end] = _several(surfaces, k)
            near[begin:end] = _rises(heights, k) > max(steep, self.max_error)
        west, south = corner.tolist()
        bounds = block.bounds
        return HeightPatch(
            (bounds[0] - west, bounds[1] - south, bounds[2] - west, bounds[3] - south),
            nodes, np.isfinite(misses), np.zeros_like(near), near, own, mixed, misses, True,
        )  # fmt: skip


def _cells_of(parts: list[_Block]) -> tuple[int, int] | None:
    """Return rows and columns of cells of the block that four become; None if level ones differ."""
    levels = {part.level for part in parts}
    if levels != {None}:
        return (1, 1) if len(levels) == 1 else None
    return (
        2 * max(part.cells[0] for part in parts),
        2 * max(part.cells[1] for part in parts),
    )


def _surplus(heights: Floats) -> float:
    """Return the largest distance of middles of cells and edges from planes of every other node."""
    nodes = heights[::2, ::2]
    return max(
        float(np.nanmax(np.abs(between - 0.5 * (one + other)), initial=0.0))
        for between, one, other in (
            (heights[::2, 1::2], nodes[:, :-1], nodes[:, 1:]),
            (heights[1::2, ::2], nodes[:-1], nodes[1:]),
            (heights[1::2, 1::2], nodes[:-1, :-1], nodes[1:, 1:]),
        )
    )


def _several(samples: Ints, k: int) -> Bools:
    """Whether cells of k samples a side have several surfaces, ends excluded, (n, m)."""
    n, m = (samples.shape[0] - 1) // k, (samples.shape[1] - 1) // k
    if samples.min() == samples.max():
        return np.zeros((n, m), np.bool_)
    # nodes on a border may have either surface
    inner = [samples[j::k, i::k][:n, :m] for j in range(1, k) for i in range(1, k)]
    return np.asarray(np.minimum.reduce(inner) != np.maximum.reduce(inner))


def _rises(heights: Floats, k: int) -> Floats:
    """Return the largest rise between two neighbouring samples of each cell, (n, m)."""
    rises = np.abs(np.diff(heights, axis=1))[:-1]
    np.maximum(rises, np.abs(np.diff(heights, axis=0))[:, :-1], out=rises)
    return np.asarray(np.maximum.reduce([rises[j::k, i::k] for j, i in np.ndindex(k, k)]))
