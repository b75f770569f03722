"""Record types and arrays of a compiled field; each dtype and its members are defined here once.

Members of two numbers or rows are along x and y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.grid_files import GridSource
from terratool.errors import RequestError
from terratool.kernels import field as kernels

if TYPE_CHECKING:
    from terratool.io.grid_cache import GridFacts, MappedGrid

COMBINE = {"product": 0, "sum": 1, "min": 2, "max": 3, "radial": 4, "grid": 5}

IN_CELLS, FREE, FREE_PLAIN = 0, 1, 2
"""Placement of a grid's elements: in its cells, at places of their own, or as leaves without turns
at places of their own."""

STEPPED = 2
"""Value of `knotted` for a curve whose pieces begin at knots, with vertical steps; 1 is without
steps, 0 evenly spaced pieces."""

SAMPLES = 1 << 31
"""First number of `pieces` that counts samples: what is above it is the first sample's index."""

ELEMENT = np.dtype(
    [
        # first cell of its block in the parent's grid; of a free element the index of its place,
        # the lower half first
        ("cell", np.uint16, 2),
        ("pose", np.uint32),  # index into poses; 0 is one cell, unturned
        ("scale", np.float64),
        ("offset", np.float64),
        ("kind", np.uint32),  # index into kinds
        ("grid", np.uint32),  # index of the first grid of its children; 0 without children
    ]
)
"""Element record, 32 bytes, breadth first: of two elements the upper one has the larger index."""

POSE = np.dtype(
    [
        ("size", np.float64, 2),  # cells that the element spans
        ("cos", np.float64),
        ("sin_v", np.float64),  # sin(turn) · height/width of the cell, the part of v in u
        ("sin_u", np.float64),  # sin(turn) · width/height of the cell, the part of u in v
        ("turned", np.uint8),
        ("free", np.uint8),  # 1 if at a place rather than in a cell; the sines are for a square
        ("cells", np.uint32, 2),  # `size` as whole numbers
    ],
    align=True,
)

PLACE = np.dtype([("at", np.float64, 2), ("extent", np.float64, 2)])
"""Middle and sides of the cell of a free element, from the corner of its parent's cell.

A second PLACE has the differences of the intended numbers from these doubles.
"""

FREE_BINS = np.dtype(
    [
        ("corner", np.float64, 2),  # south-west, from the corner of the parent's cell
        ("per", np.float64, 2),  # bins per unit of length
        ("slack", np.float64),  # farther than this from all edges, a point is surely in or out
        ("shape", np.uint32, 2),  # bins along x and y
        ("places", np.int64),  # place index minus element index
    ],
    align=True,
)
"""The bins of a grid of free elements."""

KIND = np.dtype(
    [
        ("count", np.float64, 2),  # pieces of the curve; bins of a knotted curve
        # the first piece, or SAMPLES and the first sample, and the number of pieces minus 1
        ("pieces", np.uint32, (2, 2)),
        ("knots", np.uint32, (2, 2)),  # the first knot and the first bin of a knotted curve
        ("surface", np.int32),  # index into the surfaces of the terrain; -1 for none
        ("classes", np.int32),  # index into the rasters of classes; -1 for none
        ("raster", np.uint32),  # index into rasters, of a grid
        ("combine", np.uint8),
        ("knotted", np.uint8, 2),  # 1 if pieces begin at knots; STEPPED if with vertical steps
        ("is_void", np.uint8),  # the surface is void, apart from classes
        # 0 for a product of stored, evenly spaced pieces without classes, else 1
        ("special", np.uint8),
    ],
    align=True,
)
"""A primitive with a surface, or with classes besides: a kind of element."""

RASTER = np.dtype(
    [
        ("first", np.int64),  # index of its first height; 0 in a file
        ("count", np.int64, 2),  # columns and rows
        ("file", np.int32),  # index into the mapped files; -1 for heights of the text
        ("pixel", np.uint8),  # 1 where heights stand in the middle of pixels
        ("voids", np.uint8),  # 1 where some are void
        ("single", np.uint8),  # 1 where they are float32, as those of a file may be
    ],
    align=True,
)
"""Heights of a grid primitive, or classes, row by row from the north, NaN where there are none."""

CLASS_GRID = np.dtype(
    [
        ("raster", np.uint32),  # index into rasters
        ("first", np.uint32),  # index of its first class
        ("count", np.uint32),  # number of its classes
    ],
    align=True,
)
"""A raster of classes, of which some stand for surfaces."""

GRID = np.dtype(
    [
        ("corner", np.float64, (2, 2)),  # south-west corner in the world, and its remainder
        ("per", np.float64, 2),  # cells per unit of length
        ("clear", np.float64, 2),  # within this of a cell's middle, in cells, no edge is near
        ("table", np.int64),  # first index in offsets of the grid's bins
        ("row", np.uint32),  # bins in a row
        ("free", np.uint32),  # index in free_bins
        ("shift", np.uint8, 2),  # a bin is 2^shift cells long
        ("listed", np.uint8),  # the offsets count in entries rather than in elements
        ("local", np.uint8),  # finer than doubles: positions go down from the parent's
        ("leaves", np.uint8),  # 1 if no element has a grid, a span or anything special
        ("standing", np.uint8),  # IN_CELLS, FREE or FREE_PLAIN
        ("more", np.uint8),  # 1 if the next grid belongs to the same element
        ("count", np.float64, 2),  # cells along x and y
        ("near", np.float64, 2),  # nearer than this to an edge, in cells, the edge's double decides
        # side of a cell in few enough bits that k · pitch is exact, and its remainder
        ("pitch", np.float64, (2, 2)),
        ("zero", np.float64, 2),  # a position of at most this size after cancellation is 0
    ],
    align=True,
)
"""The grid of an element's children; corner and pitch are sums of two doubles.

If siblings stand alternately in cells and at free places, each run of them has a grid, and these
follow one another. A grid of free elements has one cell, that of the parent.
"""

MEMBER = np.dtype(
    [
        ("factor", np.float64),  # factor of its part on the heights of all elements in it
        # numbers of 128 bits, the lower half first: its number among the elements below its parent,
        # from 0, and the difference between the numbers of neighbouring copies
        ("first", np.uint64, 2),
        ("each", np.uint64, 2),
        ("copies", np.uint32),  # index into copies; 0 for one
    ],
    align=True,
)
"""Additional members of an ELEMENT in a field with shared parts."""

COPIES = np.dtype(
    [
        ("step", np.float64, 2),  # whole cells, or units of the terrain for a free element
        # the step in few enough bits that k · pitch is exact, and its remainder
        ("pitch", np.float64, (2, 2)),
        ("count", np.uint32, 2),
        ("across", np.uint8),  # 1 if the rows stand along y
    ],
    align=True,
)
"""Copies of an element in rows, along x and y."""

SEGMENT = np.dtype(
    [
        ("x", np.float64),  # start
        ("y", np.float64),
        ("end_x", np.float64),  # end
        ("end_y", np.float64),
        ("dx", np.float64),  # end minus start
        ("dy", np.float64),
        ("square", np.float64),  # length squared
        ("reach", np.float64),  # half the width of its track
        ("reach_square", np.float64),  # reach squared
        ("z", np.float64),  # heights of the path at start and end; NaN for a path without
        ("end_z", np.float64),
        ("track", np.uint32),
    ],
    align=True,
)
"""A straight piece of a track, in the order of the document."""

RELIEF = np.dtype(
    [
        ("per", np.float64),  # cells of its lattice per unit of length
        ("scale", np.float64),  # factor on its bumps; 0 for no relief
        ("key", np.uint64),  # key that is hashed with the numbers of a cell
    ],
    align=True,
)
"""The relief of a rough surface."""

_ALIGNMENT = 8

kernels.check_records(
    ELEMENT, GRID, POSE, PLACE, FREE_BINS, KIND, RASTER, CLASS_GRID, SEGMENT, MEMBER, COPIES, RELIEF
)


def align_arrays(value: Any) -> Any:
    """Return an array or NamedTuple with all its arrays at addresses that the kernels can read.

    Arrays in the frames of a message may lie at odd addresses; these are copied.

    Args:
        value: an array, or a NamedTuple of arrays and other values.
    """
    if isinstance(value, np.ndarray):
        return value if value.ctypes.data % _ALIGNMENT == 0 else value.copy()
    if isinstance(value, tuple) and hasattr(value, "_make"):
        return value._make(map(align_arrays, value))
    return value


def scalar_columns(values: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the scalar columns of a record array, in the order of memory; a plain array as one."""
    if values.dtype.names is None:
        return [values]
    sizes = {name: math.prod(values.dtype[name].shape) for name in values.dtype.names}
    members = (values[name].reshape(len(values), size).T for name, size in sizes.items())
    return [column for member in members for column in member]


class MappedGrids:
    """Heights of grids that stand in files; pickled as the places of these, and mapped anew."""

    def __init__(self, sources: Sequence[GridSource]) -> None:
        """Map the heights of bands of rasters.

        Raises:
            ReadError: a file has changed since its header was read, or is broken.
        """
        self.sources = tuple(sources)
        if not sources:  # NumPy alone is enough then
            self._grids: tuple[MappedGrid, ...] = ()
        else:
            from terratool.io.grid_files import numbers_of

            self._grids = tuple(map(numbers_of, sources))
        self.memory = kernels.GridMemory(
            [grid.data for grid in self._grids], [grid.blocks for grid in self._grids]
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _mapped_anew, (self.sources,)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MappedGrids) or len(self._grids) != len(other._grids):
            return False
        if self.sources == other.sources:
            return True
        files = range(len(self._grids))
        if not all(self.is_whole(n) and other.is_whole(n) for n in files):
            return False
        return all(np.array_equal(self.numbers(n), other.numbers(n), True) for n in files)

    def __hash__(self) -> int:
        return len(self._grids)

    @property
    def count(self) -> int:
        """Number of all heights."""
        return sum(source.columns * source.rows for source in self.sources)

    @property
    def nbytes(self) -> int:
        """Bytes of all heights, whether in memory or not."""
        return sum(grid.facts.nbytes for grid in self._grids)

    def facts(self, file: int) -> GridFacts:
        """Return what is known of the heights of a file by its index."""
        return self._grids[file].facts

    def is_whole(self, file: int) -> bool:
        """Return whether all heights of a file are in memory or mapped, so that all are known."""
        return self._grids[file].blocks is None

    def refuse_blocks(self, doing: str) -> None:
        """Refuse heights that are not all known for what needs all, such as "Rays".

        Raises:
            RequestError: a file is read by blocks.
        """
        for file, source in enumerate(self.sources):
            if not self.is_whole(file):
                raise RequestError(
                    f"{doing} need all {source.columns:,} × {source.rows:,} pixels of "
                    f"{source.path}, which are too many.",
                    "Ask for a part of the terrain, or crop it with gdal_translate -projwin.",
                )

    def numbers(self, file: int) -> NDArray[np.floating[Any]]:
        """Heights of a file, (rows, columns) from the north, float32 or float64; NaN if void.

        Raises:
            ReadError: the file is read by blocks, and not all can be read.
        """
        data, facts, blocks = self._grids[file]
        if blocks is not None:
            blocks.load_all()
        kind = np.float32 if facts.single else np.float64
        found: NDArray[Any] = data.view(kind).reshape(facts.source.rows, facts.source.columns)
        return found


def _mapped_anew(sources: Sequence[GridSource]) -> MappedGrids:
    """Heights of grids that a process mapped, perhaps one of another machine."""
    if sources:
        from terratool.io.grid_files import found_here

        sources = tuple(map(found_here, sources))
    return MappedGrids(sources)


class CurveArrays(NamedTuple):
    """Pieces of all curves, and the heights of all grids.

    Attributes:
        pieces: (4n,) float64, four coefficients per cubic piece; after the pieces of each evenly
            spaced curve follows an entry with its value and slope at t = 1.
        samples: (n,) float64, values of long evenly spaced curves, which are linear in between.
        knots: (n,) float64, t at which each piece of a knotted curve begins, then infinity.
        rests: (n,) float64, differences of the intended decimals from the doubles in `knots`.
        bins: (n,) uint32, for evenly spaced t the piece of a knotted curve at which a search
            begins.
        rasters: RASTER.
        heights: (n,) float64, heights of the rasters of texts.
        mapped: heights of the rasters of files.
    """

    pieces: NDArray[np.float64]
    samples: NDArray[np.float64]
    knots: NDArray[np.float64]
    rests: NDArray[np.float64]
    bins: NDArray[np.uint32]
    rasters: NDArray[Any]
    heights: NDArray[np.float64]
    mapped: MappedGrids

    def coefficients(self, first: int, count: int) -> NDArray[np.float64]:
        """Return coefficients of so many pieces of a curve from its first one on, (count, 4)."""
        if first < SAMPLES:
            return self.pieces.reshape(-1, 4)[first : first + count]
        values, out = self.samples[first - SAMPLES :][: count + 1], np.zeros((count, 4))
        out[:, 0] = values[:-1]
        np.subtract(values[1:], values[:-1], out=out[:, 1])
        return out

    @property
    def memory(self) -> kernels.GridMemory:
        """Memory of the mapped files, as the kernels keep it."""
        return self.mapped.memory


class ClassArrays(NamedTuple):
    """Rasters of classes, and the surfaces that classes stand for.

    Attributes:
        grids: CLASS_GRID.
        numbers: (n,) float64, classes, ascending within each raster.
        surfaces: (n,) int32, index into the surfaces of the terrain.
        voids: (n,) uint8, whether these are void.
    """

    grids: NDArray[Any]
    numbers: NDArray[np.float64]
    surfaces: NDArray[np.int32]
    voids: NDArray[np.uint8]

    def of(self, kind: Any) -> ClassArrays:
        """Classes of the raster of a kind, which has one."""
        index = int(kind["classes"])
        own = self.grids[index]
        part = slice(int(own["first"]), int(own["first"]) + int(own["count"]))
        return ClassArrays(
            self.grids[index : index + 1],
            self.numbers[part], self.surfaces[part], self.voids[part],
        )  # fmt: skip


class TrackArrays(NamedTuple):
    """Tracks, and an index of their segments by cells of an even grid.

    The index covers the part of the terrain that tracks may reach. Each of its cells has a mask of
    8 × 8 parts, bit 8 · row + column from the south-west; a bit is 0 where no track can lie.

    Attributes:
        segments: SEGMENT, in document order; the segments of a track are consecutive.
        first: (tracks + 1,) uint32, index of the first segment of each track.
        passes: (tracks,) float64, whole numbers of passes.
        power: (tracks,) float64, 1 / `multipass`.
        surface: (tracks,) int32, index into the surfaces of the terrain; -1 for none.
        law: (tracks,) uint32, row of `depths`.
        depths: (laws, surfaces + 1) float64, depth of the first pass by the ground's surface index
            plus one, 0 for ground without a surface; NaN where the surface is void.
        frame: (4,) float64, west and south of the index, and cells per unit of length along x and
            y.
        shape: (2,) int64, cells of the index along x and y.
        masks: (cells,) uint64, row by row from the south.
        offsets: (cells + 1,) uint32, first index in `entries` of each cell.
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
    """Additional arrays of a field with shared parts; empty for other fields.

    The elements of such a field are those of its templates, one template after the other: the
    terrain and each part, once per quarter turn and per surface that the part inherits. The roots
    of all templates come first; only the terrain's root is an element. The corners of grids are
    computed on the way down. Scales are NaN for the default, and poses are those in square cells.

    Attributes:
        elements: MEMBER, of all elements.
        copies: COPIES; entry 0 is a single copy.
        mirrors: (grids,) uint8, bits 1 and 2 where free places are mirrored along x and y.
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
    """Arrays of a compiled field.

    Attributes:
        elements: ELEMENT, breadth first.
        grids: GRID; grid 0 is the terrain itself, one cell that holds the root.
        offsets: (n,) uint32, index of the first element, or entry, of each bin of each grid; each
            grid has one more entry at its end.
        entries: (n,) uint32, element indices for grids that list them, as all grids of free
            elements.
        poses: POSE.
        places: PLACE, of the free elements in their order.
        rests: PLACE, differences of the intended numbers from the doubles in `places`.
        free_bins: FREE_BINS, of the grids of free elements.
        kinds: KIND.
        curves: pieces of the curves.
        classes: rasters of classes.
        bounds: (4,) float64 west, south, east, north.
        pending: largest number of grids that wait at a time in a descent.
        voids: whether any surface is void.
        tracks: tracks with their ruts.
        shared: additional arrays if parts are shared.
        reliefs: RELIEF by the surface's index plus one; empty where nothing is rough.
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
    classes: ClassArrays
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
        groups = self.curves, self.classes, self.tracks, self.shared
        return sum(array.nbytes for array in (*own, *(one for group in groups for one in group)))

    def worn_by(self, kind: Any) -> list[int]:
        """Surface indices that a kind has, of itself and by classes, each once and ascending."""
        own = {int(kind["surface"])} - {-1}
        if kind["classes"] >= 0:
            own.update(self.classes.of(kind).surfaces.tolist())
        return sorted(own)

    @property
    def worn(self) -> NDArray[np.int32]:
        """Surface indices of kinds, of classes and of tracks, (n,) int32; -1 for none."""
        groups = self.kinds["surface"], self.classes.surfaces, self.tracks.surface
        return np.concatenate(groups)

    @property
    def busy_nbytes(self) -> int:
        """Memory that most lookups touch, in bytes.

        That is all arrays but the segments of tracks, and the numbers of grids: a point touches
        four of these, for which sorting points takes longer than it saves.
        """
        tracks = sum(array.nbytes for array in self.tracks)
        numbers = self.curves.heights.nbytes + self.curves.mapped.nbytes
        return self.nbytes - tracks + self.tracks.masks.nbytes - numbers
