"""Painting of heights, surfaces, slopes and labels over windows of a grid."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from terratool.field.bounds import nonzero_edges
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window


def id_type(terrain: Terrain) -> np.dtype[Any]:
    """Smallest unsigned type for surface ids: index + 1, 0 for no surface."""
    return np.min_scalar_type(len(terrain.surfaces))


class Planes(NamedTuple):
    """Arrays painted over a window: (height, width), C-contiguous, rows from the north.

    Planes other than the heights are None unless requested.

    Attributes:
        heights: float32 or float64, world units; NaN outside the terrain and in the void.
        surfaces: surface ids of type `id_type(terrain)`: index + 1, 0 for none.
        slope_x, slope_y: analytic slopes dz/dx to the east and dz/dy to the north, in the data type
            of the heights; NaN where these are.
        labels: uint32. Neighbours of equal label have no wall between them, except within a
            feature wholly between their centres; neighbours of unequal label may have one.
    """

    heights: NDArray[Any]
    surfaces: NDArray[Any] | None = None
    slope_x: NDArray[Any] | None = None
    slope_y: NDArray[Any] | None = None
    labels: NDArray[np.uint32] | None = None

    def part(self, rows: slice, columns: slice) -> Planes:
        """Views of some rows and columns."""
        parts: Any = (None if plane is None else plane[rows, columns] for plane in self)
        return Planes(*parts)


class Painter:
    """Painter of windows of a grid over a terrain; thread-safe.

    Pixel centres have the elements, heights and slopes of the queries, up to rounding of sums in
    double precision and to the data type. The value of a pixel depends neither on the window nor on
    the planes requested.

    Args:
        terrain: terrain to be painted.
        grid: pixels over the terrain.
        dtype: data type of heights and slopes, float32 or float64.
        surfaces, slopes, labels: whether to paint these planes.
    """

    def __init__(
        self,
        terrain: Terrain,
        grid: Grid,
        dtype: DTypeLike = np.float32,
        surfaces: bool = True,
        slopes: bool = False,
        labels: bool = False,
    ) -> None:
        self._field = terrain.field
        self._grid = grid
        dtype = np.dtype(dtype)
        self._dtypes = (
            dtype,
            id_type(terrain) if surfaces else None,
            dtype if slopes else None,
            dtype if slopes else None,
            np.dtype(np.uint32) if labels else None,
        )
        types = terrain.surface_types.values()
        self._voids = np.array([False, *(surface.void is True for surface in types)])
        self._slopes = slopes
        self._edges = nonzero_edges(terrain.arrays) if labels else None
        self._idle: deque[kernels.Painter] = deque()

    def blank(self, window: Window) -> Planes:
        """Allocate planes for a window, uninitialised."""
        shape = (window.height, window.width)
        planes: Any = (dtype and np.empty(shape, dtype) for dtype in self._dtypes)
        return Planes(*planes)

    def paint(self, window: Window, planes: Planes | None = None) -> Planes:
        """Paint a window in the calling thread, into the given planes or new ones.

        Memory use beyond the planes is bounded, whatever the window.
        """
        if planes is None:
            planes = self.blank(window)
        else:
            self._check(window, planes)
        x = self._grid.columns(window)
        y = np.ascontiguousarray(self._grid.rows(window)[::-1])
        try:
            painter = self._idle.pop()
        except IndexError:
            painter = kernels.Painter(self._field, self._voids, self._slopes, self._edges)
        kernels.paint(painter, x, y, self._grid.resolution, window.row, window.column, planes)
        self._idle.append(painter)
        return planes

    def _check(self, window: Window, planes: Planes) -> None:
        shape = (window.height, window.width)
        for plane, dtype in zip(planes, self._dtypes, strict=True):
            if (plane is None) != (dtype is None) or not (
                plane is None
                or (plane.shape == shape and plane.dtype == dtype and plane.flags.c_contiguous)
            ):
                wanted = "nothing" if dtype is None else f"{dtype}"
                raise ValueError(f"{wanted} of {shape[0]} × {shape[1]}, contiguous, is wanted")
