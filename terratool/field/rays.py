"""First hits of rays with the ground and the walls of a field."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.errors import RequestError
from terratool.field.types import real_numbers
from terratool.kernels import field as kernels

if TYPE_CHECKING:
    from terratool.field.terrain import Terrain
    from terratool.field.types import TerrainField

_SHARE = 1 << 14
"""Rays that a thread casts at a time."""


@dataclass(frozen=True, slots=True)
class RayHits:
    """First hits of rays, each array in the shape of the rays.

    Attributes:
        distance: float64, distance along the ray; inf without a hit within the range.
        point: (…, 3) float64, world position of the hit; NaN without one.
        normal: (…, 3) float64, unit normal on the side that the ray comes from; NaN without a hit.
        surface: int32, index into `Terrain.surfaces`; -1 for none.
        element: int64, index as in `PointSamples`; at a wall, of its higher side, or of the top of
            what is solid there; on an underside or a ceiling, of the storey; OUTSIDE without a hit.
        wall: bool, whether the hit is on a wall.
    """

    distance: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    surface: NDArray[np.int32]
    element: NDArray[np.int64]
    wall: NDArray[np.bool_]


class _Rays(NamedTuple):
    """Rays as the kernels take them: origins and directions (n, 3), and largest distances (n,)."""

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]
    most: NDArray[np.float64]


def ray_index(terrain: TerrainField) -> kernels.RayIndex:
    """Build the ray index of a terrain whose parts are written out.

    It holds bounds of heights and marks of changes. A million elements take some five seconds of
    one processor, and 370 bytes each.

    Raises:
        RequestError: a raster of the terrain is too large.
    """
    terrain.arrays.curves.mapped.refuse_blocks("Rays")
    return kernels.RayIndex(terrain.field, terrain.cells())


def storey_ray_index(terrain: Terrain) -> kernels.StoreyRayIndex:
    """Build the ray index of a terrain with storeys: that of its ground, and two of each sheet.

    Raises:
        RequestError: a raster of the terrain is too large, or its parts come to too many elements.
    """
    ground, storeys = terrain.written_out, terrain.storeys
    assert storeys is not None
    sheets = [
        (_lying_on(one.top, ground).ray_index, one.other_face(storeys.table.gaps).ray_index)
        for one in storeys.sheets
    ]
    return kernels.StoreyRayIndex(storeys.field, ground.ray_index, sheets)


def _lying_on(top: Terrain, ground: Terrain) -> Terrain:
    """Tops of a sheet with the tracks and the reliefs of a ground."""
    tracks, reliefs = ground.arrays.tracks, ground.arrays.reliefs
    beyond = len(top.surfaces) + 1 - tracks.depths.shape[1]  # surfaces that sheets alone have
    depths = np.append(tracks.depths, np.repeat(tracks.depths[:, :1], beyond, axis=1), axis=1)
    if len(reliefs):
        reliefs = np.append(reliefs, np.repeat(reliefs[:1], beyond))
    return top.with_arrays(
        top.arrays._replace(tracks=tracks._replace(depths=depths), reliefs=reliefs)
    )


def document_order(parents: NDArray[np.int32], document: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Number the elements in the order of the document, parents before children, (n,) int64.

    Args:
        parents: (n,) index of each element's parent, -1 for the root.
        document: (n,) place of each element among the children of its parent.
    """
    level = np.zeros(len(parents), np.int64)
    above = parents
    while (above >= 0).any():
        level += above >= 0
        above = np.where(above >= 0, parents[above], -1)
    levels = [np.flatnonzero(level == depth) for depth in range(1, int(level.max()) + 1)]
    below = np.ones(len(parents), np.int64)  # elements of each subtree, its root included
    for elements in reversed(levels):
        np.add.at(below, parents[elements], below[elements])
    numbers = np.zeros(len(parents), np.int64)
    for elements in levels:
        ordered = elements[np.lexsort((document[elements], parents[elements]))]
        parent = parents[ordered]
        before = np.cumsum(below[ordered]) - below[ordered]
        _, first, sibling = np.unique(parent, return_index=True, return_inverse=True)
        numbers[ordered] = numbers[parent] + 1 + before - before[first][sibling]
    return numbers


def cast(
    terrain: TerrainField,
    origins: ArrayLike,
    directions: ArrayLike,
    max_range: ArrayLike = np.inf,
    threads: int | None = None,
) -> RayHits:
    """Return the first hits of rays with the ground, from above or below, or with a wall.

    The ground is that of `Terrain.height` at each point. A wall stands where the height jumps
    across the ray. Rays pass through the void and outside of the terrain, whose rim has no wall. A
    ray that begins on the ground hits it there. Where there are storeys, a ray hits the first end
    of an interval of `Terrain.column`, from whichever side it comes, or the wall beside one.

    Args:
        terrain: terrain that the rays hit.
        origins: (…, 3) world positions at which rays begin.
        directions: (…, 3) directions of any length but 0.
        max_range: (…) largest distances, 0 or more; may be inf.
        threads: number of threads; all processors if None.

    Raises:
        RequestError: a number is NaN, an origin or direction infinite, a direction 0, or a range
            below 0; `threads` is below 1; or the parts of the terrain come to too many elements.
    """
    if threads is not None and threads < 1:
        raise RequestError(f"The number of threads is {threads}.", "Give 1 or more.")
    try:
        origins, directions, most = (
            real_numbers(np.asarray(one)) for one in (origins, directions, max_range)
        )
    except (TypeError, ValueError, OverflowError):
        raise RequestError(
            "An origin, direction or range is no number.", "Give numbers, or arrays of them."
        ) from None
    for name, vectors in (("origins", origins), ("directions", directions)):
        if vectors.ndim < 1 or vectors.shape[-1] != 3:
            raise RequestError(
                f"The {name} have the shape {vectors.shape}.", "Let the last axis be x, y, z."
            )
    try:
        shape = np.broadcast_shapes(origins.shape[:-1], directions.shape[:-1], most.shape)
    except ValueError:
        raise RequestError(
            f"Origins {origins.shape}, directions {directions.shape} and ranges {most.shape} do "
            "not fit together.",
            "Give as many of each, or one of what they share.",
        ) from None
    starts, ways = (
        np.broadcast_to(one, (*shape, 3)).reshape(-1, 3) for one in (origins, directions)
    )
    ranges = np.broadcast_to(most, shape).reshape(-1)
    written_out = terrain.written_out
    look = _caster(terrain)
    count = len(starts)
    found = RayHits(
        np.empty(count), np.empty((count, 3)), np.empty((count, 3)), np.empty(count, np.int32),
        np.empty(count, np.int64), np.empty(count, bool),
    )  # fmt: skip
    members = [getattr(found, one.name) for one in fields(found)]

    def share(begin: int) -> None:
        part = slice(begin, begin + _SHARE)
        rays = _Rays._make(np.ascontiguousarray(one[part]) for one in (starts, ways, ranges))
        wrong = look(rays, RayHits(*(one[part] for one in members)))
        if wrong >= 0:
            _refuse(starts[begin + wrong], ways[begin + wrong])

    begins = range(0, count, _SHARE)
    wanted = min(threads or os.cpu_count() or 1, len(begins))
    if wanted > 1:
        with ThreadPoolExecutor(wanted) as pool:
            list(pool.map(share, begins))
    else:
        for begin in begins:
            share(begin)
    if written_out is not terrain:
        found.element[:] = terrain.numbers_of(found.element)
    return RayHits(*(one.reshape((*shape, *one.shape[1:])) for one in members))


def _caster(terrain: TerrainField) -> Callable[[_Rays, RayHits], int]:
    """Function that puts what rays meet into hits, and returns the first that is no ray, or -1."""
    if terrain.storeys is None:
        return partial(kernels.cast, terrain.written_out.ray_index)
    return partial(kernels.cast_storeys, terrain.storey_ray_index)


def _refuse(origin: NDArray[np.float64], direction: NDArray[np.float64]) -> None:
    """Raise the error that says what is wrong with a ray."""
    for name, vector in (("origins", origin), ("directions", direction)):
        if not np.isfinite(vector).all():
            raise RequestError(f"The {name} have a NaN or an infinity.", "Leave those rays out.")
    if not direction.any():
        raise RequestError("A direction is 0 0 0.", "Leave that ray out.")
    raise RequestError("A range is below 0, or NaN.", "Give 0 or more; inf is no limit.")
