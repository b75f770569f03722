"""Raster: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

SPECS: dict[str, list[dict[str, Any]]]

def first_number(pixels: NDArray[np.float32] | NDArray[np.float64]) -> float:
    """
    The first pixel that is not NaN, or 0.

    Shapes: pixels[_,_].
    """

def gather(
    pixels: NDArray[np.float32] | NDArray[np.float64], shift: float, sums: NDArray[np.float64]
) -> None:
    """
    Statistics of pixels by column.

    Shapes: pixels[_,_], sums[5,_].
    """

def nearest_faces(
    points: NDArray[np.float64],
    faces: NDArray[np.int32],
    depths: NDArray[np.float64],
    nearest: NDArray[np.int32],
) -> None:
    """
    The face with the largest z at the centre of each pixel.

    Shapes: points[_,3], faces[_,3], depths[h,w], nearest[h,w].
    """
