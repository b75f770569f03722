"""Importing: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

SPECS: dict[str, list[dict[str, Any]]]

def round_rows(
    heights: NDArray[np.float64],
    size: int,
    step: float,
    base: float,
    above: NDArray[np.int64] | None,
    counts: NDArray[np.int64],
    levels: NDArray[np.float64],
) -> None:
    """
    Round a block of rows to whole steps.

    Shapes: heights[n,w], above[w], counts[n,w], levels[n,w].
    """

def write_integers(numbers: NDArray[np.int64]) -> bytes:
    """
    Whole numbers as an array of JSON.

    Shapes: numbers[_].
    """

def cut_rectangles(classes: NDArray[np.int64]) -> NDArray[np.int64]:
    """
    Rectangles of one class each: column, row, width, height, class.

    Shapes: classes[_,_].
    """

def compare(
    heights: NDArray[np.float64], ours: NDArray[np.float64], sums: NDArray[np.float64]
) -> tuple[int, int]:
    """
    The largest difference of heights, and the sum of squares.

    Shapes: heights[n], ours[n], sums[2].
    """

def to_pixels(
    vertices: NDArray[np.float64], west: float, south: float, dx: float, dy: float
) -> NDArray[np.float64]:
    """
    Vertices as points in pixels.

    Shapes: vertices[_,3].
    """

def paint_faces(
    points: NDArray[np.float64],
    faces: NDArray[np.int32],
    tolerance: float,
    heights: NDArray[np.float64],
    counts: NDArray[np.uint8],
) -> None:
    """
    The highest surface at the centre of each pixel.

    Shapes: points[_,3], faces[_,3], heights[h,w], counts[h,w].
    """

def count_overhangs(
    points: NDArray[np.float64],
    faces: NDArray[np.int32],
    tolerance: float,
    heights: NDArray[np.float64],
    counts: NDArray[np.uint8],
) -> int:
    """
    Pixels with an open surface below the highest.

    Shapes: points[_,3], faces[_,3], heights[h,w], counts[h,w].
    """

def count_holes(heights: NDArray[np.float64]) -> tuple[int, int]:
    """
    Pixels without a height, enclosed by others and not enclosed.

    Shapes: heights[_,_].
    """

def find_extent(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """
    Least and greatest x, y and z of the corners of faces.

    Shapes: vertices[_,3], faces[_,3].
    """

def survey_faces(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    west: float,
    south: float,
    east: float,
    north: float,
) -> tuple[float, NDArray[np.int64]]:
    """
    Area of vertical faces within; how many are seen, vertical, flat, outside.

    Shapes: vertices[_,3], faces[_,3].
    """

def locate(
    nodes: NDArray[np.float64], t: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """
    The nodes before places on a curve, and the way to the next.

    Shapes: nodes[_], t[_].
    """

def residuals(problem: Any, terms: Any) -> NDArray[np.float64]:
    """Heights minus those of the terms."""

def normal_equations(
    problem: Any,
    terms: Any,
    weights: NDArray[np.float64],
    matrix: NDArray[np.float64],
    right: NDArray[np.float64],
) -> None:
    """
    Add up the normal equations of points.

    Shapes: weights[n], matrix[m,m], right[m].
    """

def worst_pixels(
    heights: NDArray[np.float64], affine: NDArray[np.float64], terms: Any, block: int
) -> tuple[NDArray[np.int64], float]:
    """
    The pixel with the largest error of each block, and the largest of all.

    Shapes: heights[_,_], affine[4].
    """

def error_range(
    heights: NDArray[np.float64], affine: NDArray[np.float64], terms: Any
) -> tuple[float, float]:
    """
    The smallest and the largest error of all pixels.

    Shapes: heights[_,_], affine[4].
    """

def solve(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> bool:
    """
    Solve a symmetric system; whether it is positive definite.

    Shapes: matrix[m,m], right[m].
    """

FLAT: int = 0

RAMP: int = 1

FALL: int = 2

TENT: int = 3

COS: int = 4

COSBELL: int = 5

DOME: int = 6

GAUSS: int = 7

RISE: int = 8

SINK: int = 9

def sample_curve(code: int, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Values of a known curve.

    Shapes: t[_].
    """

def fit_curve(
    profile: Any, begins: NDArray[np.int64], ends: NDArray[np.int64], good: float
) -> tuple[int, int, int]:
    """
    The curve and cell that fit a profile best.

    Shapes: begins[_], ends[_].
    """

def least_size(mixed: NDArray[np.float64], row: int, column: int, down: int, across: int) -> float:
    """
    The least size of a difference and its neighbours.

    Shapes: mixed[_,_].
    """

def find_strongest(
    mixed: NDArray[np.float64], down: int, across: int, block: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """
    The place in each block where the least size of neighbours is largest.

    Shapes: mixed[_,_].
    """

def read_numbers(
    text: NDArray[np.uint8], at: int, powers: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[tuple[int, int]], int]:
    """
    Numbers of a text; which of them are hard, and where they begin; where they end.

    Shapes: text[_], powers[121,2].
    """

def read_rows(
    text: NDArray[np.uint8], places: NDArray[np.int64], powers: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[tuple[int, int]], int]:
    """
    Numbers of fields of lines; which Python must read, and where; the first bad line.

    Shapes: text[_], places[_], powers[121,2].
    """

def triangulate(
    points: NDArray[np.float64], indices: NDArray[np.int32]
) -> tuple[NDArray[np.int32], int, int]:
    """
    Triangles of polygons; how many have no area, and cross themselves.

    Shapes: points[_,3], indices[_].
    """
