"""Meshes, and the arrays that they are built from: every dtype and meaning, named once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from terratool.field.records import FieldArrays
from terratool.kernels import field as fields
from terratool.kernels import mesh as kernels

_LOW = 0.01
"""Least height of a wall, in parts of the error; files of float32 lose lower ones."""


@dataclass(frozen=True, slots=True)
class CornerNormals:
    """Normals of the surface at the corners of faces.

    Attributes:
        directions: (n, 3) float32 different unit vectors, to three decimals.
        corners: (m, 3) int32 index of the direction at each corner of each face.
    """

    directions: NDArray[np.float32]
    corners: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles with shared vertices.

    Attributes:
        vertices: (n, 3) float64 x, y, z, relative to `origin`, units of the terrain.
        faces: (m, 3) int32 vertices, counter-clockwise from outside (from above for ground).
        surfaces: (m,) int32 index into `names` of each face's surface, -1 for none.
        walls: (m,) bool, whether a face stands upright.
        origin: (3,) float64 world position of the local zero.
        names: names of the surfaces.
        colors: (k, 3) uint8 colours (red, green, blue) of the surfaces.
        frictions: (k,) float64 coefficients of friction of the surfaces, NaN for unknown ones.
        normals: normals at the corners; None leaves them to whoever shows the mesh.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    surfaces: NDArray[np.int32]
    walls: NDArray[np.bool_]
    origin: NDArray[np.float64]
    names: tuple[str, ...]
    colors: NDArray[np.uint8]
    frictions: NDArray[np.float64]
    normals: CornerNormals | None = None


class RutLoss(Struct, frozen=True, rename={"wall_offset": "beside"}):
    """Loss of the ruts of a terrain by a mesh. Lengths are in units of the terrain.

    Attributes:
        wall_offset: largest distance of a rut's side from its true place.
        narrow: number of tracks left out because they are too narrow for the mesh.
        shallow: number of tracks left out because their ruts are no deeper than was asked for.
        deepest: depth of the deepest rut that a shallow track makes by itself.
    """

    wall_offset: float = 0.0
    narrow: int = 0
    shallow: int = 0
    deepest: float = 0.0


class PlanLoss(NamedTuple):
    """Loss of a plan: elements that are left out, and offsets of walls, in units of the terrain.

    Attributes:
        wall_offset: largest distance of a disc's wall to the inside of its arc.
        small: number of elements left out because their cells are too small for the lattice.
        faint: number of elements left out because they change heights no more than was asked for.
        faintest: largest change of heights by a faint element.
        ruts: loss of ruts.
    """

    wall_offset: float = 0.0
    small: int = 0
    faint: int = 0
    faintest: float = 0.0
    ruts: RutLoss = RutLoss()


class MeshStoreys(Struct, frozen=True):
    """Decks and bores of a mesh. Lengths are in units of the terrain.

    Attributes:
        decks: number of decks of the terrain.
        bores: number of bores of the terrain.
        area: area over which something stands over a gap, seen from above.
        volume: volume of all that stands over a gap.
    """

    decks: int
    bores: int
    area: float
    volume: float


@dataclass(frozen=True, slots=True)
class BuiltMesh:
    """A mesh, and how well it shows its terrain.

    Attributes:
        mesh: mesh of the terrain.
        shell: number of the first faces that are ground, storeys and walls; skirt and base of a
            solid come after them.
        error: bound of the distance, along z, of the ground from the terrain, in its units.
        loss: loss of the plan.
        storeys: decks and bores of the mesh; None for a terrain without.
    """

    mesh: Mesh
    shell: int
    error: float
    loss: PlanLoss
    storeys: MeshStoreys | None = None


@dataclass(frozen=True, slots=True)
class HeightGrid:
    """Heights at evenly spaced nodes, rows from the north.

    Attributes:
        heights: (n, m) float32 heights of the nodes, units of the terrain.
        surfaces: (n, m) int32 index into `names` of each node's surface, -1 for none.
        spacing: distance of one node from the next along x and along y.
        origin: (3,) float64 world position of the south-west node at height 0.
        names: names of the surfaces.
        colors: (k, 3) uint8 colours (red, green, blue) of the surfaces.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[np.int32]
    spacing: tuple[float, float]
    origin: NDArray[np.float64]
    names: tuple[str, ...]
    colors: NDArray[np.uint8]


FRAME = np.dtype(
    [
        ("low", np.float64, 2),  # where the element's cell begins, on the lattice
        ("high", np.float64, 2),  # where the element's cell ends, on the lattice
        ("per", np.float64, 2),  # 1 / (high - low)
        ("weight", np.float64, 2),  # change of a height where a curve changes by 1
        ("corners", np.uint32),  # corners of the polygon that stands for a disc
        ("drawn", np.uint8),  # large enough for the lattice, and in the part that is meshed
        ("straight_from", np.float64),  # t from which on a disc that ends too steeply is straight
    ],
    align=True,
)
"""Place of an element's cell, in points of the lattice. Members of two are along x and y."""

AXIS = np.dtype(
    [
        ("line", np.uint32),  # index of the first line
        ("lines", np.uint32),  # number of lines
        ("group", np.uint32),  # index of the first group
        ("constant", np.uint8),  # one value everywhere
        ("linear", np.uint8),  # straight pieces only
        ("inner_slope", np.float64),  # bound of the slope without sign but close to the end
        ("slope", np.float64),  # bound of the slope without sign
        ("steep", np.uint8),  # a tangent is vertical somewhere, or almost
        ("ringed", np.uint8),  # for a disc: rings make a leaner mesh than triangles of equal sides
        ("smallest_crease", np.float64),  # smallest crease that is no step
        ("first_bounds", np.uint32),  # index of the first row of PIECE_BOUNDS
        ("pieces", np.uint32),  # number of rows of PIECE_BOUNDS at each level
        ("turn", np.uint32),  # index of the first turn
    ],
    align=True,
)
"""One curve of a kind, along x or y: (kinds, 2)."""

LINE = np.dtype([("t", np.float64), ("crease", np.float64), ("group", np.uint32)], align=True)
"""Bend or step of a curve at t: the crease is the distance of the chord over the bend, in units of
the curve, infinite for a step; the group is the one that begins at or before t."""

PIECE_BOUNDS = np.dtype(
    [("low", np.float64), ("high", np.float64), ("slope", np.float64), ("bend", np.float64)],
    align=True,
)
"""Bounds of the values of pieces of a curve, and of its first and second derivative without sign.
Rows of level k are about 2^k pieces each, beginning with each piece that is followed by as many."""

GROUP = np.dtype(
    [("low", np.float64), ("high", np.float64), ("first", np.int64), ("last", np.int64)],
    align=True,
)
"""A stretch of a curve between two vertical steps: first and last t, first and last piece."""

COVERING_ELEMENT = np.dtype([("element", np.uint32), ("group", np.uint32, 2)])
"""An element that covers a region, and the groups of its curves that hold there."""

kernels.check_records(FRAME, AXIS, LINE, PIECE_BOUNDS, GROUP, COVERING_ELEMENT)


class RutOutlines(NamedTuple):
    """The outlines of ruts on the lattice, and an index of the rows that their edges pass.

    Attributes:
        edges: (n, 4) int64 x, y, x, y, closed around the ruts of each track.
        owners: (n,) uint32 index of each edge's track.
        frame: (2,) float64 south end of the index, and rows for each point of the lattice.
        offsets: (rows + 1,) int64 index in `entries` where the edges of each row begin.
        entries: uint32 indices of edges, row by row.
    """

    edges: NDArray[np.int64]
    owners: NDArray[np.uint32]
    frame: NDArray[np.float64]
    offsets: NDArray[np.int64]
    entries: NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class MeshPlan:
    """Description of a field for the kernels that mesh it.

    Attributes:
        field: compiled field.
        arrays: arrays of the field.
        frames: (elements,) FRAME of each element.
        footprints: (elements, 4) float64 west, south, east, north of the footprints, on the
            lattice.
        polygon_errors: (elements,) float64 largest change of a disc's heights by the polygon that
            stands for the disc.
        axes: (kinds, 2) AXIS of each curve.
        lines: LINE of all curves.
        groups: GROUP of all curves.
        piece_bounds: PIECE_BOUNDS of all curves.
        turns: (n, 2) float64 sum of the jumps of a curve's slope up to the begin of each piece, and
            of its variation within the pieces before.
        origin: (2,) float64 world position of the lattice's zero.
        pitch: distance between points of the lattice, in units of the terrain; a power of two.
        bounds: (4,) float64 west, south, east, north of the meshed rectangle, on the lattice.
        error: largest error of a height, in units of the terrain.
        rounding: largest difference of two heights by rounding, in units of the terrain.
        outlines: outlines of the ruts.
    """

    field: fields.Field
    arrays: FieldArrays
    frames: NDArray[Any]
    footprints: NDArray[np.float64]
    polygon_errors: NDArray[np.float64]
    axes: NDArray[Any]
    lines: NDArray[Any]
    groups: NDArray[Any]
    piece_bounds: NDArray[Any]
    turns: NDArray[np.float64]
    origin: NDArray[np.float64]
    pitch: float
    bounds: NDArray[np.float64]
    error: float
    rounding: float
    outlines: RutOutlines

    @property
    def tolerance(self) -> float:
        """Largest difference of two heights that count as one, in units of the terrain."""
        return max(_LOW * self.error, self.rounding)

    @cached_property
    def kernel_plan(self) -> kernels.Plan:
        """The plan as kernels take it, checked once."""
        return kernels.Plan(self)


class Triangulation(NamedTuple):
    """Triangles in the plane.

    Attributes:
        points: (n, 2) int64 vertices on the lattice.
        triangles: (m, 3) int32 indices of vertices, counter-clockwise.
        neighbours: (m, 3) int32 index of the triangle beyond the edge from each corner to the next,
            -1 for none.
    """

    points: NDArray[np.int64]
    triangles: NDArray[np.int32]
    neighbours: NDArray[np.int32]

    def sides(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """All sides, each once: a triangle, and the corner from which the side leads."""
        own = np.arange(len(self.triangles))[:, None]
        t, c = np.nonzero((self.neighbours < 0) | (own < self.neighbours))
        return t, c

    def rim(self, some: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Sides where some triangles end: the triangle, and the corner from which the side leads.

        Args:
            some: (m,) bool, which triangles.
        """
        ends = (self.neighbours < 0) | ~some[self.neighbours]
        t, c = np.nonzero(some[:, None] & ends)
        return t, c


class TileBoundary(NamedTuple):
    """Sides that a tile shares with the tiles beyond.

    Attributes:
        sides: (4,) int64 x, y, x, y of the west, south, east and north side; -1 where no tile is
            beyond.
        edges: (n, 4) int64 x, y, x, y on the lattice of all edges on the shared sides, each from
            west to east or south to north.
        heights: (n, 2) float64 heights of the ground at the two ends of each edge.
    """

    sides: NDArray[np.int64]
    edges: NDArray[np.int64]
    heights: NDArray[np.float64]


class Regions(NamedTuple):
    """Parts of the plane that the same elements and the same tracks cover.

    Attributes:
        offsets: (n + 1,) int64 index in `covering` where the elements of each region begin.
        covering: COVERING_ELEMENT of all regions.
        surfaces: (n,) int32 index of the surface, -1 for none.
        voids: (n,) bool, whether a region has no ground.
        affine: (n,) bool, whether the heights of all elements of a region are known to be affine.
        polygon_errors: (n,) float64 change of heights by the polygons that stand for discs.
        rut_depths: (n,) float64 depth of the ruts, in units of the terrain.
    """

    offsets: NDArray[np.int64]
    covering: NDArray[Any]
    surfaces: NDArray[np.int32]
    voids: NDArray[np.bool_]
    affine: NDArray[np.bool_]
    polygon_errors: NDArray[np.float64]
    rut_depths: NDArray[np.float64]


class RegionMesh(NamedTuple):
    """Triangles in the plane, each in a region, with heights.

    Attributes:
        triangulation: triangulation of m triangles.
        regions: regions of the triangles.
        region_of: (m,) int32 index of each triangle's region.
        heights: (m, 3) float64 heights at the corners of each triangle, within its own region.
    """

    triangulation: Triangulation
    regions: Regions
    region_of: NDArray[np.int32]
    heights: NDArray[np.float64]
