"""First hits of rays with the ground and the walls of a field."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.errors import RequestError
from terratool.field.types import real_numbers
from terratool.kernels import field as kernels

if TYPE_CHECKING:
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
        element: int64, index as in `PointSamples`; at a wall, of its higher side; OUTSIDE without a
            hit.
        wall: bool, whether the hit is on a wall.
    """

    distance: NDArray[np.float64]
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    surface: NDArray[np.int32]
    element: NDArray[np.int64]
    wall: NDArray[np.bool_]


def ray_index(terrain: TerrainField) -> kernels.RayIndex:
    """Build the ray index of a terrain whose parts are written out.

    It holds bounds of heights and marks of changes. A million elements take some five seconds of
    one processor, and 370 bytes each.

    Raises:
        RequestError: a raster of the terrain is too large.
    """
    terrain.arrays.curves.mapped.refuse_blocks("Rays")
    return kernels.RayIndex(terrain.field, terrain.cells())


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
    ray that begins on the ground hits it there.

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
    index, count = written_out.ray_index, len(starts)
    distance, element, surface = (
        np.empty(count),
        np.empty(count, np.int64),
        np.empty(count, np.int32),
    )
    point, normal, wall = np.empty((count, 3)), np.empty((count, 3)), np.empty(count, bool)

    contiguous = np.ascontiguousarray

    def share(begin: int) -> None:
        part = slice(begin, begin + _SHARE)
        wrong = kernels.cast(
            index, contiguous(starts[part]), contiguous(ways[part]), contiguous(ranges[part]),
            distance[part], point[part], normal[part], element[part], surface[part], wall[part],
        )  # fmt: skip
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
        element = terrain.numbers_of(element)
    return RayHits(
        distance.reshape(shape),
        point.reshape(*shape, 3),
        normal.reshape(*shape, 3),
        surface.reshape(shape),
        element.reshape(shape),
        wall.reshape(shape),
    )


def _refuse(origin: NDArray[np.float64], direction: NDArray[np.float64]) -> None:
    """Raise the error that says what is wrong with a ray."""
    for name, vector in (("origins", origin), ("directions", direction)):
        if not np.isfinite(vector).all():
            raise RequestError(f"The {name} have a NaN or an infinity.", "Leave those rays out.")
    if not direction.any():
        raise RequestError("A direction is 0 0 0.", "Leave that ray out.")
    raise RequestError("A range is below 0, or NaN.", "Give 0 or more; inf is no limit.")
