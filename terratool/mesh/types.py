"""What a mesh is, and the arrays that it is built from: every dtype and meaning, named once."""

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
"""Walls are left out that are lower than this part of the error; files of float32 lose them."""


@dataclass(frozen=True, slots=True)
class CornerNormals:
    """Which way the surface faces at the corners of faces.

    Attributes:
        directions: (n, 3) float32 different unit vectors, to three decimals.
        corners: (m, 3) int32 index of that of each corner of each face.
    """

    directions: NDArray[np.float32]
    corners: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles with shared vertices.

    Attributes:
        vertices: (n, 3) float64, relative to `origin`.
        faces: (m, 3) int32, counter-clockwise seen from outside (from above for ground).
        surfaces: (m,) int32 index into `names`, -1 for none.
        walls: (m,) bool, whether a face stands upright.
        origin: (3,) float64 world position of the local zero.
        names: names of the surfaces.
        colors: (k, 3) uint8 colours of the names.
        frictions: (k,) float64 coefficients of friction of the names, NaN where it is not known.
        normals: those of its corners; None leaves them to whoever shows it.
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
    """What a mesh loses of the ruts of a terrain. Lengths are in its units.

    Attributes:
        wall_offset: how far from where it should be a side of a rut stands, at most.
        narrow: number of tracks left out because they are too narrow for the mesh.
        shallow: number of those left out because they make no deeper ruts than was asked …
        deepest: … and the deepest that one of them makes by itself.
    """

    wall_offset: float = 0.0
    narrow: int = 0
    shallow: int = 0
    deepest: float = 0.0


class PlanLoss(NamedTuple):
    """What a plan leaves out, and how far it moves walls.

    Attributes:
        wall_offset: how far inside of its arc the wall of a disc stands, at most, in units of the
            terrain.
        small: number of elements left out because their cells are too small for the lattice.
        faint: number of elements left out because they change heights by no more than was asked …
        faintest: … and the most that one of them does.
        ruts: what is lost of ruts.
    """

    wall_offset: float = 0.0
    small: int = 0
    faint: int = 0
    faintest: float = 0.0
    ruts: RutLoss = RutLoss()


@dataclass(frozen=True, slots=True)
class BuiltMesh:
    """A mesh, and how well it shows its terrain.

    Attributes:
        mesh: the mesh.
        shell: so many of its faces, the first, are ground and walls; of a solid, skirt and base
            come after them.
        error: no less than the distance, along z, of the ground from the terrain anywhere.
        loss: what it leaves out of the terrain.
    """

    mesh: Mesh
    shell: int
    error: float
    loss: PlanLoss


@dataclass(frozen=True, slots=True)
class HeightGrid:
    """Heights at evenly spaced nodes, rows from the north.

    Attributes:
        heights: (n, m) float32.
        surfaces: (n, m) int32 index into `names`, -1 for none.
        spacing: from one node to the next along x and along y.
        origin: (3,) float64 world position of the south-west node at height 0.
        names: names of the surfaces.
        colors: (k, 3) uint8 colours of the names.
    """

    heights: NDArray[np.float32]
    surfaces: NDArray[np.int32]
    spacing: tuple[float, float]
    origin: NDArray[np.float64]
    names: tuple[str, ...]
    colors: NDArray[np.uint8]


FRAME = np.dtype(
    [
        ("low", np.float64, 2),  # the element's cell begins here, on the lattice …
        ("high", np.float64, 2),  # … and ends here
        ("per", np.float64, 2),  # 1 / (high - low)
        ("weight", np.float64, 2),  # how much a height changes where a curve changes by 1
        ("corners", np.uint32),  # of the polygon that stands for a disc
        ("drawn", np.uint8),  # large enough for the lattice, and in the part that is meshed
        ("straight_from", np.float64),  # from this t on a disc that ends too steeply is straight
    ],
    align=True,
)
"""Where an element's cell lies, in units of the lattice. Members of two are along x and y."""

AXIS = np.dtype(
    [
        ("line", np.uint32),  # the first of its lines …
        ("lines", np.uint32),  # … and their number
        ("group", np.uint32),  # the first of its groups
        ("constant", np.uint8),  # the same value everywhere
        ("linear", np.uint8),  # all of its pieces are straight
        ("inner_slope", np.float64),  # no less than its slope anywhere but close to the end
        ("slope", np.float64),  # no less than its slope anywhere
        ("steep", np.uint8),  # its tangent is, or almost, vertical somewhere
        ("ringed", np.uint8),  # of a disc: rings make a leaner mesh than triangles of equal sides
        ("smallest_crease", np.float64),  # of those that are no steps
        ("first_bounds", np.uint32),  # the first of its rows of PIECE_BOUNDS …
        ("pieces", np.uint32),  # … and how many there are of each level
        ("turn", np.uint32),  # the first of its turns
    ],
    align=True,
)
"""One curve of a kind: (kinds, 2)."""

LINE = np.dtype([("t", np.float64), ("crease", np.float64), ("group", np.uint32)], align=True)
"""Where a curve bends or steps: the crease is how far the chord over it misses, in units of the
curve, infinite for a step; the group is the one that begins at or before it."""

PIECE_BOUNDS = np.dtype(
    [("low", np.float64), ("high", np.float64), ("slope", np.float64), ("bend", np.float64)],
    align=True,
)
"""Bounds of the values of pieces of a curve, and of its first and second derivative without sign.
Level k of a curve's rows is about 2^k pieces each, beginning with each piece that has them."""

GROUP = np.dtype(
    [("low", np.float64), ("high", np.float64), ("first", np.int64), ("last", np.int64)],
    align=True,
)
"""A stretch of a curve between two vertical steps: its t and its pieces."""

COVERING_ELEMENT = np.dtype([("element", np.uint32), ("group", np.uint32, 2)])
"""An element that covers a region, and the groups of its curves that hold there."""

kernels.check_records(FRAME, AXIS, LINE, PIECE_BOUNDS, GROUP, COVERING_ELEMENT)


class RutOutlines(NamedTuple):
    """The outlines of ruts on the lattice, and an index of the rows that their edges pass.

    Attributes:
        edges: (n, 4) int64 x, y, x, y, closed around what each track holds.
        owners: (n,) uint32, the track of each.
        frame: (2,) float64, south of the index, and its rows for each point of the lattice.
        offsets: (rows + 1,) int64, for each row where its edges begin in `entries`.
        entries: uint32, indices of edges.
    """

    edges: NDArray[np.int64]
    owners: NDArray[np.uint32]
    frame: NDArray[np.float64]
    offsets: NDArray[np.int64]
    entries: NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class MeshPlan:
    """What the kernels need to know of a field to mesh it.

    Attributes:
        field: the compiled field …
        arrays: … and its arrays.
        frames: (elements,) FRAME.
        footprints: (elements, 4) float64, on the lattice the rectangles around their footprints:
            west, south, east, north.
        polygon_errors: (elements,) float64, the most that the polygon that stands for a disc
            changes the height inside of it.
        axes: (kinds, 2) AXIS.
        lines: LINE of all curves.
        groups: GROUP of all curves.
        piece_bounds: PIECE_BOUNDS of all curves.
        turns: (n, 2) float64, for each piece how much its curve's slope jumps up to its begin,
            and how much it varies within the pieces before.
        origin: (2,) float64, world position of the lattice's zero.
        pitch: side of the lattice; a power of two.
        bounds: (4,) float64 the rectangle that is meshed, on the lattice.
        error: the largest error of a height, in units of the terrain.
        rounding: how much two heights may differ by rounding, in units of the terrain.
        outlines: those of the ruts.
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
        """How much two heights may differ and still be one, in units of the terrain."""
        return max(_LOW * self.error, self.rounding)

    @cached_property
    def kept(self) -> kernels.Plan:
        """The same, checked and kept, as kernels take it."""
        return kernels.Plan(self)


class Triangulation(NamedTuple):
    """Triangles in the plane.

    Attributes:
        points: (n, 2) int64 on the lattice.
        triangles: (m, 3) int32, counter-clockwise.
        neighbours: (m, 3) int32, the triangle beyond the edge from corner c to the next; -1: none.
    """

    points: NDArray[np.int64]
    triangles: NDArray[np.int32]
    neighbours: NDArray[np.int32]


class TileBoundary(NamedTuple):
    """What the sides of a tile have in common with the tiles beyond.

    Attributes:
        sides: (4,) int64 x, y, x, y of the west, south, east and north side; -1 where no tile is
            beyond.
        edges: (n, 4) int64 x, y, x, y on the lattice, all edges that lie on those sides; each from
            west to east or south to north.
        heights: (n, 2) float64 of the ground at their two ends.
    """

    sides: NDArray[np.int64]
    edges: NDArray[np.int64]
    heights: NDArray[np.float64]


class Regions(NamedTuple):
    """Parts of the plane that the same elements and the same tracks cover.

    Attributes:
        offsets: (n + 1,) int64, where the covering elements of each begin.
        covering: COVERING_ELEMENT.
        surfaces: (n,) int32, index of the surface, -1 for none.
        voids: (n,) bool, whether there is no ground.
        affine: (n,) bool, whether the heights of all its elements are known to be affine there.
        polygon_errors: (n,) float64, how much its discs change the height by being polygons.
        rut_depths: (n,) float64.
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
        triangulation: m triangles.
        regions: the regions.
        region_of: (m,) int32, the region of each triangle.
        heights: (m, 3) float64, at the corners of each triangle as its own region has them.
    """

    triangulation: Triangulation
    regions: Regions
    region_of: NDArray[np.int32]
    heights: NDArray[np.float64]
