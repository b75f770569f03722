"""Triangles in space: what the readers of meshes return."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Triangles:
    """A soup of triangles; neither closed, nor wound one way, nor in one part need it be.

    Attributes:
        vertices: (n, 3) float64, x east, y north, z up unless the reader was told otherwise.
        faces: (m, 3) int32, indices of vertices.
        notes: sentences about what was left out, in numbers.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    notes: tuple[str, ...] = ()
