"""Mesh: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

NUMBER_BYTES: int = 24

SHORTEST_SEAM: int = 64

def check_records(
    frame: np.dtype[Any],
    axis: np.dtype[Any],
    line: np.dtype[Any],
    piece: np.dtype[Any],
    group: np.dtype[Any],
    covering: np.dtype[Any],
) -> None:
    """Refuse dtypes that are not the structs of the kernels."""

class Plan:
    """The plan of a mesh: its arrays, checked once."""

    def __init__(self, arrays: object) -> None: ...

class Refinement:
    """Triangles that are refined."""

    def __init__(
        self,
        plan: object,
        regions: object,
        triangulation: object,
        region_of: object,
        heights: object,
        locked: object,
    ) -> None: ...

SPECS: dict[str, list[dict[str, Any]]]

def index_rows(
    edges: NDArray[np.int64], frame: NDArray[np.float64], rows: int
) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """
    For each row of places the edges that pass it.

    Shapes: edges[_,4], frame[2].
    """

def segments_of(plan: Plan, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """
    Segments of elements and all ruts: x, y, x, y.

    Shapes: chosen[_].
    """

def count_segments(plan: Plan, chosen: NDArray[np.int64]) -> int:
    """
    How many segments elements have.

    Shapes: chosen[_].
    """

def weld(
    points: NDArray[np.int64], limits: NDArray[np.int64], seams: NDArray[np.int64], near: int
) -> NDArray[np.int64]:
    """
    For each vertex the one that it becomes.

    Shapes: points[_,2], limits[4], seams[4].
    """

def find_thin(
    points: NDArray[np.int64], triangles: NDArray[np.int32], near: float
) -> NDArray[np.int64]:
    """
    Triangles lower than `near`: their longest side, then the corner.

    Shapes: points[_,2], triangles[_,3].
    """

def region_keys(
    plan: Plan, points: NDArray[np.int64], triangles: NDArray[np.int32]
) -> NDArray[np.int64]:
    """
    For each triangle a number of what covers its middle.

    Shapes: points[_,2], triangles[_,3].
    """

def describe_regions(
    plan: Plan, points: NDArray[np.int64], triangles: NDArray[np.int32], chosen: NDArray[np.int64]
) -> dict[str, Any]:
    """
    Regions, from a triangle of each.

    Shapes: points[_,2], triangles[_,3], chosen[_].
    """

def corner_heights(
    plan: Plan,
    regions: Any,
    points: NDArray[np.int64],
    triangles: NDArray[np.int32],
    region_of: NDArray[np.int32],
) -> NDArray[np.float64]:
    """
    Heights of triangles at their corners.

    Shapes: points[_,2], triangles[m,3], region_of[m].
    """

def divide_seam(
    plan: Plan,
    regions: Any,
    region_of: NDArray[np.int32],
    axis: int,
    at: int,
    passes: NDArray[np.int64],
    clearance: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """
    Where edges along a seam end, and heights at both of their ends.

    Shapes: region_of[k], passes[k+1], clearance[k+1].
    """

def refine(refinement: Refinement, allowed: float, most: int) -> bool:
    """Refine some triangles; whether there are more."""

def split_crossings(refinement: Refinement, tolerance: float) -> bool:
    """
    Split edges where the higher side changes; whether there are triangles to refine.
    """

def take(refinement: Refinement) -> dict[str, Any]:
    """All triangles; the end of it."""

def find_levels(
    triangles: NDArray[np.int32],
    heights: NDArray[np.float64],
    solid: NDArray[np.bool_],
    on_boundary: NDArray[np.bool_],
    base: float,
    tolerance: float,
) -> dict[str, Any]:
    """
    The different heights at each vertex.

    Shapes: triangles[m,3], heights[m,3], solid[m].
    """

def raise_walls(
    neighbours: NDArray[np.int32], corners: NDArray[np.int32], levels: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """
    The walls between triangles.

    Shapes: neighbours[m,3], corners[m,3].
    """

def raise_skirt(
    triangles: NDArray[np.int32],
    corners: NDArray[np.int32],
    outer_edges: NDArray[np.int32],
    begins: NDArray[np.int64],
    levels: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """
    The walls from the base up to where the ground ends.

    Shapes: triangles[m,3], corners[m,3], outer_edges[_,2].
    """

def separate_wedges(
    triangulation: Any,
    corners: NDArray[np.int32],
    begins: NDArray[np.int64],
    faces: NDArray[np.int32],
    owners: NDArray[np.int32],
    below: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """
    Give each solid wedge vertices of its own.

    Shapes: corners[m,3], faces[f,3], owners[f], below[_,3].
    """

def corner_normals(
    points: NDArray[np.float64], faces: NDArray[np.int32], walls: NDArray[np.bool_], error: float
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """
    Different normals, and that of each corner of faces.

    Shapes: points[_,3], faces[m,3], walls[m].
    """

def is_roof(triangles: NDArray[np.float64], corners: NDArray[np.float64], height: float) -> bool:
    """
    Whether no corner lies above the plane of any triangle by more than a height.

    Shapes: triangles[_,9], corners[_,3].
    """

def covered_points(
    triangles: NDArray[np.float64], points: NDArray[np.float64], out: NDArray[np.bool_]
) -> None:
    """
    Whether points lie in triangles, seen from above.

    Shapes: triangles[_,9], points[n,2], out[n].
    """

def put_points(
    out: NDArray[np.uint8],
    points: NDArray[np.float32] | NDArray[np.float64],
    before: NDArray[np.uint8],
    after: NDArray[np.uint8],
) -> int:
    """
    Lines of points; returns where they end.

    Shapes: points[_,3].
    """

def put_faces(
    out: NDArray[np.uint8],
    faces: NDArray[np.int32],
    first: int,
    before: NDArray[np.uint8],
    after: NDArray[np.uint8],
) -> int:
    """
    Lines of faces; returns where they end.

    Shapes: faces[_,3].
    """

def put_corners(
    out: NDArray[np.uint8],
    faces: NDArray[np.int32],
    normals: NDArray[np.int32],
    first: int,
    before: NDArray[np.uint8],
    after: NDArray[np.uint8],
) -> int:
    """
    Lines of faces with normals; returns where they end.

    Shapes: faces[m,3], normals[m,3].
    """

def sort_faces(
    faces: NDArray[np.int32], places: NDArray[np.int32], counts: NDArray[np.int64]
) -> NDArray[np.int32]:
    """
    Faces in the order of their surfaces.

    Shapes: faces[m,3], places[m].
    """

def take_vertices(
    points: NDArray[np.float32], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """
    Vertices that faces use, and faces of these.

    Shapes: points[_,3], faces[_,3].
    """

def stl_faces(points: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.uint8]:
    """
    Faces as a binary STL has them.

    Shapes: points[_,3], faces[_,3].
    """
