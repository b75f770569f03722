"""What a painter works on: a tile of pixels that stays in the cache, and scratch."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.types import Arrays

WIDTH, HEIGHT = 1040, 132
"""The most pixels of a tile: a little over 1024 and 128, for windows with margins.

Heights and surfaces of a tile take 1.2 MB, slopes 2.2 MB, patches 0.5 MB,
tracks 3.8 MB."""


class Canvas(NamedTuple):
    """A tile, and what is needed to paint it. Rows run from the south.

    Attributes:
        heights, surfaces: (HEIGHT · WIDTH,) float64 and the type of the ids.
        slope_x, slope_y, patches: as many float64, float64 and uint32, or none where not asked for.
        cell_x, in_x: (WIDTH,) float64, cells of a grid and positions in them, by column …
        cell_y, in_y: (HEIGHT,) float64, … and by row.
        runs_x, runs_y: (WIDTH + 1, 2), (HEIGHT + 1, 2) int64, where the columns and rows of each
            bin begin, and the bin.
        u, v, fx, fy: (WIDTH,), (HEIGHT,) float64, twice: positions in a block of cells, and values
            of curves.
        work: three of (WIDTH,) float64.
        marks: (WIDTH,) uint32, what an element adds to the patches.
        rims: (kinds,) uint8, `extents.rims`.
        point: (2,) float64, a tile of one pixel.
        queue: (n, 5) int64, grids that wait with their columns and rows: a ring.
        stack: scratch of the descent.
        stamps: (HEIGHT · WIDTH,) uint32, the last track over a pixel and one, 0 for none; this and
            the next four are empty where there are no tracks.
        first, passes: as many float64, the deepest first pass over a pixel, and all passes.
        deepest, worn: as many uint32, the track with the deepest first pass, and the last with a
            surface and one, 0 for none.
        near: a bit for each segment, all 0 but while they are looked for.
    """

    heights: NDArray[np.float64]
    surfaces: NDArray[Any]
    slope_x: NDArray[np.float64]
    slope_y: NDArray[np.float64]
    patches: NDArray[np.uint32]
    cell_x: NDArray[np.float64]
    in_x: NDArray[np.float64]
    cell_y: NDArray[np.float64]
    in_y: NDArray[np.float64]
    runs_x: NDArray[np.int64]
    runs_y: NDArray[np.int64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    fx: NDArray[np.float64]
    fy: NDArray[np.float64]
    work_0: NDArray[np.float64]
    work_1: NDArray[np.float64]
    work_2: NDArray[np.float64]
    marks: NDArray[np.uint32]
    rims: NDArray[np.uint8]
    point: NDArray[np.float64]
    queue: NDArray[np.int64]
    stack: NDArray[np.float64]
    stamps: NDArray[np.uint32]
    first: NDArray[np.float64]
    passes: NDArray[np.float64]
    deepest: NDArray[np.uint32]
    worn: NDArray[np.uint32]
    near: NDArray[np.uint64]


def canvas_for(
    arrays: Arrays, ids: np.dtype[Any], rims: NDArray[np.uint8], slopes: bool, patches: bool
) -> Canvas:
    """A canvas; each thread needs its own."""
    pixels = WIDTH * HEIGHT
    trodden = pixels * (len(arrays.tracks.masks) > 0)

    def across() -> NDArray[np.float64]:
        return np.empty(WIDTH)

    def along() -> NDArray[np.float64]:
        return np.empty(HEIGHT)

    return Canvas(
        np.empty(pixels), np.empty(pixels, ids),
        np.empty(pixels * slopes), np.empty(pixels * slopes), np.empty(pixels * patches, np.uint32),
        across(), across(), along(), along(),
        np.empty((WIDTH + 1, 2), np.int64), np.empty((HEIGHT + 1, 2), np.int64),
        across(), along(), across(), along(), across(), across(), across(),
        np.empty(WIDTH, np.uint32), rims, np.empty(2),
        np.empty((256, 5), np.int64), np.empty((arrays.pending, 3)),
        np.empty(trodden, np.uint32), np.empty(trodden), np.empty(trodden),
        np.empty(trodden, np.uint32), np.empty(trodden, np.uint32),
        np.zeros(len(arrays.tracks.segments) // 64 + 1, np.uint64),
    )  # fmt: skip
