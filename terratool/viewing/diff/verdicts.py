"""Comparison of a vehicle's verdicts on two terrains, on one grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import Threads
from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window
from terratool.tasks import processors
from terratool.traversability.map import stream_map
from terratool.traversability.preparing import chosen_resolution, prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.route.headings import Progress
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import GroundClass
from terratool.viewing.diff.results import ComparedGrid, Flip, VerdictChange

_RANKS = {
    GroundClass.GO: 0, GroundClass.CAUTION: 1, GroundClass.ONE_WAY: 2, GroundClass.EDGE: 3,
    GroundClass.UNKNOWN: 4, GroundClass.CUT_OFF: 5, GroundClass.NO_GO: 6,
}  # fmt: skip
"""Ranks of classes of ground, the larger, the worse."""


class _Map(NamedTuple):
    """Map of verdicts.

    Attributes:
        grid: the pixels.
        classes: (height, width) `GroundClass`.
        ground: (height, width), whether there is ground.
    """

    grid: Grid
    classes: NDArray[np.uint8]
    ground: NDArray[np.bool_]


def compare_verdicts(
    old: Terrain,
    new: Terrain,
    vehicle: Vehicle,
    *,
    bounds: Bounds,
    resolution: float | None,
    progress: Progress | None = None,
) -> VerdictChange:
    """Judge both terrains with a vehicle, and compare the classes of ground.

    Args:
        old: old terrain.
        new: new terrain.
        vehicle: vehicle that is to drive there.
        bounds: world rectangle that both terrains have.
        resolution: side of a pixel; that of a traversability map of the new terrain if None.
        progress: progress that counts pixels; None for none.

    Raises:
        RequestError: the resolution does not suit the vehicle, there are too many elements, or a
            figure of a surface is too large.
    """
    request = Request(bounds=bounds, resolution=resolution)
    if resolution is None:
        request = Request(bounds=bounds, resolution=chosen_resolution(new, vehicle, request, False))
    before = _judge(old, vehicle, request, progress)
    after = _judge(new, vehicle, request, progress)
    return _compare(vehicle.name, before, after)


def _judge(terrain: Terrain, vehicle: Vehicle, request: Request, progress: Progress | None) -> _Map:
    prepared = prepare_assessment(terrain, vehicle, request)
    builder = prepared.builder
    assert builder is not None
    if progress is not None:
        progress.say("judging", prepared.pixels)
    stream_map(prepared.surveyor, builder, None, Threads(processors()), progress)
    classes, _ = builder.classes(None, vehicle.area)
    return _Map(builder.grid, classes, builder.ground)


def _compare(name: str, before: _Map, after: _Map) -> VerdictChange:
    grid, pixel = after.grid, after.grid.resolution**2
    ground = before.ground & after.ground
    count = int(np.count_nonzero(ground))
    size = len(GroundClass)
    pairs = before.classes.astype(np.int64) * size + after.classes
    counts = np.bincount(pairs[ground], minlength=size * size).reshape(size, size)
    worse = better = 0
    flips = []
    for old in GroundClass:
        for new in GroundClass:
            number = int(counts[old, new])
            if old == new or not number:
                continue
            worse += number * (_RANKS[new] > _RANKS[old])
            better += number * (_RANKS[new] < _RANKS[old])
            first = int(np.argmax((pairs == old * size + new) & ground))
            row, column = divmod(first, grid.width)
            at = Window(row, column, 1, 1)
            x, y = float(grid.columns(at)[0]), float(grid.rows(at)[0])
            flips.append(Flip(old.label, new.label, number * pixel, number / count, x, y))
    flips.sort(key=lambda flip: (-flip.area, flip.old, flip.new))
    return VerdictChange(
        vehicle=name,
        grid=ComparedGrid(grid.bounds, grid.resolution, grid.width, grid.height),
        ground=count * pixel,
        worse=worse / count if count else 0.0,
        better=better / count if count else 0.0,
        old=_shares(counts.sum(axis=1), count),
        new=_shares(counts.sum(axis=0), count),
        flips=tuple(flips),
    )


def _shares(counts: NDArray[np.int64], whole: int) -> dict[str, float]:
    return {
        ground.label: int(number) / whole
        for ground, number in zip(GroundClass, counts, strict=True)
        if number
    }
