"""The arrays of a compiled field: every dtype and every meaning, named once.

Members of two numbers or rows are along x and y.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import field as kernels

COMBINE = {"product": 0, "sum": 1, "min": 2, "max": 3, "radial": 4}

IN_CELLS, FREE, FREE_PLAIN = 0, 1, 2
"""How the elements of a grid stand: in its cells, or each at a place of its own.

Plain ones are leaves without a turn.
"""

STEPPED = 2
"""A curve whose pieces begin at knots, with vertical steps; 1 without, 0 evenly spaced pieces."""

ELEMENT = np.dtype(
    [
        # first cell of its block in the parent's grid; of a free one the index of its place, the
        # lower half first
        ("cell", np.uint16, 2),
        ("pose", np.uint32),  # index into poses; 0 is one cell, unturned
        ("scale", np.float64),
        ("offset", np.float64),
        ("kind", np.uint32),  # index into kinds
        ("grid", np.uint32),  # index of its first grid; 0 for an element without children
    ]
)
"""32 bytes. Elements are in breadth-first order: the top one of two has the larger index."""

POSE = np.dtype(
    [
        ("size", np.float64, 2),  # cells that it spans
        ("cos", np.float64),
        ("sin_v", np.float64),  # sin(turn) · height/width of the cell, the part of v in u
        ("sin_u", np.float64),  # sin(turn) · width/height of the cell, the part of u in v
        ("turned", np.uint8),
        ("free", np.uint8),  # it has a place rather than a cell; the sines are those of a square
        ("cells", np.uint32, 2),  # the size again, as whole numbers
    ],
    align=True,
)

PLACE = np.dtype([("at", np.float64, 2), ("extent", np.float64, 2)])
"""Middle and sides of the cell of a free element, from the corner of its parent's cell.

Another one beside it has what its doubles lack to the numbers that they stand for.
"""

FREE_BINS = np.dtype(
    [
        ("corner", np.float64, 2),  # south-west, from the corner of the parent's cell
        ("per", np.float64, 2),  # bins per unit of length
        ("slack", np.float64),  # a point farther from all edges is inside or outside for certain
        ("shape", np.uint32, 2),  # bins along x and y
        ("places", np.int64),  # from the index of an element to that of its place
    ],
    align=True,
)
"""The bins of a grid of free elements."""

KIND = np.dtype(
    [
        ("count", np.float64, 2),  # pieces of the curve; of a knotted curve its bins
        ("pieces", np.uint32, (2, 2)),  # the first piece, and the count less one
        ("knots", np.uint32, (2, 2)),  # the first knot and the first bin of a knotted curve
        ("surface", np.int32),  # index into the surfaces of the terrain; -1 for none
        ("combine", np.uint8),
        ("knotted", np.uint8, 2),  # 1 if pieces begin at knots; STEPPED if with vertical steps
        ("is_void", np.uint8),  # the surface is void
        ("special", np.uint8),  # anything but a product of evenly spaced pieces
    ],
    align=True,
)
"""A primitive with a surface."""

GRID = np.dtype(
    [
        ("corner", np.float64, (2, 2)),  # the south-west corner in the world, and the rest of it
        ("per", np.float64, 2),  # cells per unit of length
        ("clear", np.float64, 2),  # within this of a cell's middle, in cells, no edge is near
        ("table", np.int64),  # where its table of bins begins in offsets
        ("row", np.uint32),  # bins in a row
        ("free", np.uint32),  # index of the bins of free elements
        ("shift", np.uint8, 2),  # a bin is 2^shift cells long
        ("listed", np.uint8),  # the offsets count in entries rather than in elements
        ("local", np.uint8),  # finer than doubles: positions go down from the parent's
        ("leaves", np.uint8),  # no element has a grid, a span or anything special
        ("standing", np.uint8),  # IN_CELLS, FREE or FREE_PLAIN
        ("more", np.uint8),  # the next grid belongs to the same element
        ("count", np.float64, 2),  # cells
        ("near", np.float64, 2),  # this near to an edge, in cells, the edge's double decides
        # side of a cell in few enough bits that k · pitch is exact, and the rest of it
        ("pitch", np.float64, (2, 2)),
        ("zero", np.float64, 2),  # a position is 0 if no more than this is left of what cancels
    ],
    align=True,
)
"""Corner and pitch are sums of two doubles.

Siblings that stand in cells and at free places in turn are in as many grids, one after the other; a
grid of free elements has one cell, that of its parent.
"""

MEMBER = np.dtype(
    [
        ("factor", np.float64),  # of its part: on all heights in it
        # the numbers of 128 bits, the lower half first: among the elements of its parent and what
        # is in these, the first is number 0; copies of it are so far apart
        ("first", np.uint64, 2),
        ("each", np.uint64, 2),
        ("copies", np.uint32),  # index into copies; 0 for one
    ],
    align=True,
)
"""What an element has besides in a field whose parts are shared."""

COPIES = np.dtype(
    [
        ("step", np.float64, 2),  # whole cells, or units of the terrain for a free element
        # the step in few enough bits that k · pitch is exact, and the rest of it
        ("pitch", np.float64, (2, 2)),
        ("count", np.uint32, 2),
        ("across", np.uint8),  # the rows stand along y
    ],
    align=True,
)
"""Copies of an element, along x and y."""

SEGMENT = np.dtype(
    [
        ("x", np.float64),  # where it begins …
        ("y", np.float64),
        ("end_x", np.float64),  # … and ends
        ("end_y", np.float64),
        ("dx", np.float64),  # from the one to the other
        ("dy", np.float64),
        ("square", np.float64),  # of its length
        ("reach", np.float64),  # half the width of its track …
        ("reach_square", np.float64),  # … and the square of that
        ("track", np.uint32),
    ],
    align=True,
)
"""A straight piece of a track, in the order of the document."""

RELIEF = np.dtype(
    [
        ("per", np.float64),  # cells of its lattice per unit of length
        ("scale", np.float64),  # factor on its bumps; 0 for no relief
        ("key", np.uint64),  # what is hashed with the cells
    ],
    align=True,
)
"""The relief of a rough surface."""

_ALIGNMENT = 8

kernels.check_records(ELEMENT, GRID, POSE, PLACE, FREE_BINS, KIND, SEGMENT, MEMBER, COPIES, RELIEF)


def aligned(value: Any) -> Any:
    """The same with all arrays in it at addresses where kernels read them.

    Arrays that come in the frames of a message may lie at odd ones.

    Args:
        value: an array, or a NamedTuple that holds some.
    """
    if isinstance(value, np.ndarray):
        return value if value.ctypes.data % _ALIGNMENT == 0 else value.copy()
    if isinstance(value, tuple) and hasattr(value, "_make"):
        return value._make(map(aligned, value))
    return value


def scalar_columns(values: NDArray[Any]) -> list[NDArray[Any]]:
    """The numbers of a record array, a column for each, in the order of memory; or the array."""
    if values.dtype.names is None:
        return [values]
    sizes = {name: math.prod(values.dtype[name].shape) for name in values.dtype.names}
    members = (values[name].reshape(len(values), size).T for name, size in sizes.items())
    return [column for member in members for column in member]


class CurveArrays(NamedTuple):
    """The pieces of all curves.

    Attributes:
        pieces: (4n,) float64, the four coefficients of a cubic per piece; behind the pieces of
            each evenly spaced curve stands one more, its value and slope at t = 1.
        knots: (n,) float64, t where each piece of a knotted curve begins, then infinity.
        rests: (n,) float64, what the doubles of the knots lack to the decimals that they mean.
        bins: (n,) uint32, for evenly spaced t the piece of a knotted curve to begin the search at.
    """

    pieces: NDArray[np.float64]
    knots: NDArray[np.float64]
    rests: NDArray[np.float64]
    bins: NDArray[np.uint32]


class TrackArrays(NamedTuple):
    """The tracks, and an index of their segments by cells of an even grid.

    The index covers what of the terrain the tracks may reach. Each of its cells has a mask of 8 × 8
    parts, bit 8 · row + column from the south-west: where no part of a track may lie it is 0.

    Attributes:
        segments: SEGMENT, in document order; those of a track stand side by side.
        first: (tracks + 1,) uint32, where the segments of each track begin.
        passes: (tracks,) float64, whole.
        power: (tracks,) float64, 1 / `multipass`.
        surface: (tracks,) int32, index into the surfaces of the terrain; -1 for none.
        law: (tracks,) uint32, row of `depths`.
        depths: (laws, surfaces + 1) float64, depth of the first pass by the surface of the ground
            and one, 0 for ground without a surface; NaN where that is void.
        frame: (4,) float64, west and south of the index, and its cells per unit of length.
        shape: (2,) int64, its cells along x and y.
        masks: (cells,) uint64, row by row from the south.
        offsets: (cells + 1,) uint32, for each cell where its segments begin in `entries`.
        entries: (n,) uint32, indices of segments, ascending in each cell.
    """

    segments: NDArray[Any]
    first: NDArray[np.uint32]
    passes: NDArray[np.float64]
    power: NDArray[np.float64]
    surface: NDArray[np.int32]
    law: NDArray[np.uint32]
    depths: NDArray[np.float64]
    frame: NDArray[np.float64]
    shape: NDArray[np.int64]
    masks: NDArray[np.uint64]
    offsets: NDArray[np.uint32]
    entries: NDArray[np.uint32]


class SharingArrays(NamedTuple):
    """What a field has besides whose parts are shared; of others the arrays are empty.

    Its elements are those of its templates, one after the other: of the terrain and of each part,
    once for each of its quarter turns and for each surface that it takes from around. First stand
    the roots of all of them, of which only that of the terrain is an element. Where a grid lies is
    computed on the way down. Scales are NaN for the default, and poses those in square cells.

    Attributes:
        elements: MEMBER, of all elements.
        copies: COPIES; the first is one copy.
        mirrors: (grids,) uint8, 1 and 2 where free places are mirrored along x and y.
        extent: (2,) float64, sides of the terrain.
    """

    elements: NDArray[Any]
    copies: NDArray[Any]
    mirrors: NDArray[np.uint8]
    extent: NDArray[np.float64]


NOT_SHARED = SharingArrays(
    np.zeros(0, MEMBER), np.zeros(0, COPIES), np.zeros(0, np.uint8), np.zeros(2)
)


class FieldArrays(NamedTuple):
    """A compiled field: nothing but arrays.

    Attributes:
        elements: ELEMENT, breadth first.
        grids: GRID; grid 0 is the terrain itself, one cell that holds the root.
        offsets: (n,) uint32, for each bin of each grid where its elements begin; one more at the
            end of each grid.
        entries: (n,) uint32, element indices of the grids that list them, as those of free ones do.
        poses: POSE.
        places: PLACE, of the free elements in their order.
        rests: PLACE, what the doubles of `places` lack to the numbers that they stand for.
        free_bins: FREE_BINS, of the grids of free elements.
        kinds: KIND.
        curves: the pieces of the curves.
        bounds: (4,) float64 west, south, east, north.
        pending: the most grids that a descent has to remember at a time.
        voids: whether any surface is void.
        tracks: the ruts in it.
        shared: what is shared by the places that parts stand in.
        reliefs: RELIEF by the index of the surface and one; none where nothing is rough.
    """

    elements: NDArray[Any]
    grids: NDArray[Any]
    offsets: NDArray[np.uint32]
    entries: NDArray[np.uint32]
    poses: NDArray[Any]
    places: NDArray[Any]
    rests: NDArray[Any]
    free_bins: NDArray[Any]
    kinds: NDArray[Any]
    curves: CurveArrays
    bounds: NDArray[np.float64]
    pending: int
    voids: bool
    tracks: TrackArrays
    reliefs: NDArray[Any]
    shared: SharingArrays = NOT_SHARED

    @property
    def nbytes(self) -> int:
        """Memory of all arrays, in bytes."""
        own = (array for array in self if isinstance(array, np.ndarray))
        return sum(array.nbytes for array in (*own, *self.curves, *self.tracks, *self.shared))

    @property
    def busy_nbytes(self) -> int:
        """Memory of what most points are looked up in: all but the segments of tracks."""
        tracks = sum(array.nbytes for array in self.tracks)
        return self.nbytes - tracks + self.tracks.masks.nbytes
