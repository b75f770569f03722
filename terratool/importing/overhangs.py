"""The ground of a mesh with overhangs, and what stands over it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.intervals import (
    Intervals,
    MeshColumns,
    Neighbours,
    joined_labels,
    mesh_columns,
    neighbours,
)
from terratool.importing.types import PixelGrid
from terratool.report.numbers import per_cent

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

MOST_PIXELS = 1 << 22
"""Most pixels of a mesh whose overhangs are looked at."""

MOST_BODIES = 1000
"""Most connected bodies over the ground that become decks, the largest in area."""


@dataclass(frozen=True, slots=True)
class Overhangs:
    """Solid intervals of a mesh, with the bodies of those that stand over other ground.

    Attributes:
        points: (n, 3) float64, vertices in pixels, whole numbers at the centres; z is a height.
        faces: (m, 3) int32.
        solid: intervals of all pixels.
        body: (k,) int64, number of the connected body over the ground that each interval is of,
            the largest body first; -1 for the ground, and for what is left out.
        pairs: pairs of intervals of bodies that overlap, in neighbouring pixels.
    """

    points: Floats
    faces: NDArray[np.int32]
    solid: Intervals
    body: Ints
    pairs: Neighbours

    @property
    def bodies(self) -> int:
        """Number of bodies over the ground."""
        return int(self.body.max(initial=-1)) + 1


@dataclass(frozen=True, slots=True)
class FoundOverhangs:
    """Result of a search for overhangs.

    Attributes:
        overhangs: what stands over other ground; None if nothing does.
        heights: (rows, columns) float64, heights of the ground below; NaN where there is none.
        notes: sentences on what cannot be told, and on what is left out.
    """

    overhangs: Overhangs | None
    heights: Floats
    notes: tuple[str, ...]


def find_overhangs(
    points: Floats,
    faces: NDArray[np.int32],
    highest: Floats,
    counts: NDArray[np.uint8],
    grid: PixelGrid,
    near: float,
) -> FoundOverhangs:
    """Tell the ground of a mesh from what stands over it.

    The ground of a column is what is solid all the way down. Of a mesh that ends below, as a block
    with a flat base, it is the lowest interval of the column, but where a body that stands over
    other ground reaches out over nothing.

    Args:
        points: (n, 3) float64, vertices in pixels, whole numbers at the centres.
        faces: (m, 3) int32.
        highest: (rows, columns) float64, the highest surface; NaN for none.
        counts: (rows, columns), number of surfaces of each pixel.
        grid: the pixels.
        near: height below which nothing is solid, and nothing open.
    """
    found = mesh_columns(points, faces, counts > 0, near)
    solid = _with_plain(found.intervals, highest)
    rows, columns = highest.shape
    pairs = neighbours(solid, rows, columns)
    is_ground = _ground_of(solid, pairs)
    over = ~is_ground
    kept = over[pairs.one] & over[pairs.other]
    pairs = pairs.some(kept)
    body, left = _bodies(solid, pairs, over)
    heights = np.full(highest.size, np.nan)
    heights[solid.pixel[is_ground]] = solid.top[is_ground]
    # what is left out is solid all the way down, as the highest surface is without decks
    heights[solid.pixel[left]] = solid.top[left]
    notes = tuple(_notes(found, np.unique(solid.pixel[left]).size, grid))
    if not (body >= 0).any():
        return FoundOverhangs(None, highest, notes)
    kept = (body[pairs.one] >= 0) & (body[pairs.other] >= 0)
    overhangs = Overhangs(points, faces, solid, body, pairs.some(kept))
    return FoundOverhangs(overhangs, heights.reshape(highest.shape), notes)


def _with_plain(stacked: Intervals, highest: Floats) -> Intervals:
    """Return intervals with those of pixels on the rim of a face, solid below the surface."""
    flat = highest.ravel()
    plain = ~np.isnan(flat)
    plain[stacked.pixel] = False
    pixel = np.flatnonzero(plain)
    none = np.full(len(pixel), -1)
    parts = zip(
        (stacked.pixel, stacked.bottom, stacked.top, stacked.under, stacked.over),
        (pixel, np.full(len(pixel), -np.inf), flat[pixel], none, none),
        strict=True,
    )
    order = np.argsort(np.concatenate([stacked.pixel, pixel]), kind="stable")
    return Intervals(*(np.concatenate(part)[order] for part in parts))


def _ground_of(solid: Intervals, pairs: Neighbours) -> Mask:
    """Tell which intervals are ground, (n,)."""
    lowest = solid.is_lowest
    endless = solid.bottom == -np.inf
    closed = ~endless
    joined = closed[pairs.one] & closed[pairs.other]
    label = joined_labels(len(solid), pairs.one[joined], pairs.other[joined])
    # the lowest ground that each body stands over
    upper = np.flatnonzero(~lowest)
    first = np.flatnonzero(lowest)
    below = first[np.searchsorted(solid.pixel[first], solid.pixel[upper])]
    least = np.full(len(solid), np.inf)
    np.minimum.at(least, label[upper], solid.top[below])
    return np.asarray(lowest & (endless | (solid.bottom < least[label])))


def _bodies(solid: Intervals, pairs: Neighbours, over: Mask) -> tuple[Ints, Ints]:
    """Number the bodies over the ground, the largest first.

    Returns:
        The number of each interval's body, -1 for none, and indices of the intervals of bodies
        that are too many, by pixel and from below.
    """
    label = joined_labels(len(solid), pairs.one, pairs.other)
    which = np.flatnonzero(over)
    roots, place, areas = np.unique(label[which], return_inverse=True, return_counts=True)
    rank = np.empty(len(roots), np.int64)
    rank[np.argsort(-areas, kind="stable")] = np.arange(len(roots))
    body = np.full(len(solid), -1)
    body[which] = rank[place]
    left = np.flatnonzero(body >= MOST_BODIES)
    body[left] = -1
    return body, left


def _notes(found: MeshColumns, left: int, grid: PixelGrid) -> Iterator[str]:
    pixels = grid.rows * grid.columns

    def part(count: int) -> str:
        area = count * grid.dx * grid.dy
        return f"{count:,} of {pixels:,} pixels ({per_cent(count / pixels, 2)}, {area:.4g} m²)"

    if found.turned:
        yield (
            f"In {part(found.turned)} some face points the wrong way; inside and outside are taken "
            "in turn there."
        )
    if found.unclear:
        yield (
            f"In {part(found.unclear)} the mesh is not closed, and what is inside cannot be told; "
            "only the highest surface is kept."
        )
    if found.sheets:
        yield (
            f"In {part(found.sheets)} a sheet without an underside lies over another one; only the "
            "highest is kept."
        )
    if left:
        yield (
            f"There are more than {MOST_BODIES:,} bodies over the ground; the smallest ones, over "
            f"{part(left)}, are solid down to it."
        )
