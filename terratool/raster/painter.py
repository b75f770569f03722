"""Painting of heights, surfaces, slopes and labels over windows of a grid."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from terratool.field.bounds import nonzero_edges
from terratool.field.terrain import Terrain
from terratool.kernels import field as kernels
from terratool.raster.grid import Grid, Window

GROUND_BAND, CLEARANCE_BAND, COUNT_BAND = range(3)
COLUMN_BANDS = 3
"""First bands of `Planes.columns`, before tops and bottoms."""
_ROWS = 128
"""Rows that are looked at together for the most tops."""


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
        columns: (bands, height, width) in the data type of the heights: the ground, the clearance
            over it and the number of tops, which is 0 for none; then the first top from below, the
            second bottom, the second top, and so on; NaN for none.
    """

    heights: NDArray[Any]
    surfaces: NDArray[Any] | None = None
    slope_x: NDArray[Any] | None = None
    slope_y: NDArray[Any] | None = None
    labels: NDArray[np.uint32] | None = None
    columns: NDArray[Any] | None = None

    def part(self, rows: slice, columns: slice) -> Planes:
        """Views of some rows and columns."""
        parts: Any = (None if plane is None else plane[..., rows, columns] for plane in self)
        return Planes(*parts)


class HiddenPixels(NamedTuple):
    """Pixels under storeys in a part of a window, which the kernels count.

    Attributes:
        within: (4,) int64, first and last row and column that count, the last ones exclusive.
        figures: (5,) float64: number of pixels with two tops or more, most tops, least gap between
            two, and its row and column.
        seen: (storeys,) uint8, whether a top of each storey is the highest at a pixel.
    """

    within: NDArray[np.int64]
    figures: NDArray[np.float64]
    seen: NDArray[np.uint8]

    @classmethod
    def of(cls, rows: slice, columns: slice, storeys: int) -> HiddenPixels:
        """Nothing yet, for some rows and columns of a window."""
        within = rows.start, rows.stop, columns.start, columns.stop
        nothing = 0.0, 0.0, math.inf, math.inf, math.inf
        return cls(
            np.array(within, np.int64), np.array(nothing, np.float64), np.zeros(storeys, np.uint8)
        )


class _Painted(NamedTuple):
    """Arrays that the kernels fill, as members of `Planes` and `HiddenPixels`."""

    heights: NDArray[Any]
    surfaces: NDArray[Any] | None
    slope_x: NDArray[Any] | None
    slope_y: NDArray[Any] | None
    labels: NDArray[np.uint32] | None
    columns: NDArray[Any] | None
    within: NDArray[np.int64] | None
    figures: NDArray[np.float64] | None
    seen: NDArray[np.uint8] | None


class Painter:
    """Painter of windows of a grid over a terrain; thread-safe.

    Pixel centres have the elements, heights and slopes of the queries, up to rounding of sums in
    double precision and to the data type. The value of a pixel depends neither on the window nor on
    the planes requested.

    Args:
        terrain: terrain to be painted.
        grid: pixels over the terrain; None for lattices alone.
        dtype: data type of heights and slopes, float32 or float64.
        surfaces, slopes, labels: whether to paint these planes.
        storeys: whether the highest top of each column is painted, rather than the ground alone,
            as a number of bands of `Planes.columns`: none, `COLUMN_BANDS`, or 2 n - 1 more for so
            many tops; None for the ground alone.
    """

    def __init__(
        self,
        terrain: Terrain,
        grid: Grid | None,
        dtype: DTypeLike = np.float32,
        surfaces: bool = True,
        slopes: bool = False,
        labels: bool = False,
        storeys: int | None = None,
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
        above = None if storeys is None else terrain.storeys
        self._storeys = None if above is None else above.field
        self._bands = storeys or 0
        self._flat = above is None
        self._idle: deque[kernels.Painter] = deque()

    def blank(self, window: Window) -> Planes:
        """Allocate planes for a window, uninitialised."""
        shape = (window.height, window.width)
        planes: list[Any] = [dtype and np.empty(shape, dtype) for dtype in self._dtypes]
        if self._bands:
            planes.append(np.empty((self._bands, *shape), self._dtypes[0]))
        return Planes(*planes)

    def paint(
        self, window: Window, planes: Planes | None = None, hidden: HiddenPixels | None = None
    ) -> Planes:
        """Paint a window in the calling thread, into the given planes or new ones.

        Memory use beyond the planes is bounded, whatever the window.

        Args:
            window: window of the grid.
            planes: planes to paint into.
            hidden: where to count what the highest tops hide; nothing without storeys.
        """
        if planes is None:
            planes = self.blank(window)
        else:
            self._check(window, planes)
        assert self._grid is not None
        x = self._grid.columns(window)
        y = np.ascontiguousarray(self._grid.rows(window)[::-1])
        counted = (None, None, None) if hidden is None else hidden
        columns = planes.columns
        if columns is not None:
            columns = None if self._flat else columns.reshape(-1, window.width)
        painted = _Painted(*planes[:-1], columns, *counted)
        with self._one() as painter:
            kernels.paint(painter, x, y, self._grid.resolution, window.row, window.column, painted)
        if planes.columns is not None and self._flat:
            _fill_flat(planes.heights, planes.columns)
        return planes

    def paint_lattice(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Planes:
        """Paint the nodes of a lattice other than the grid's; planes are those of `blank`.

        Args:
            x: (n,) world x of the columns, ascending, evenly spaced.
            y: (m,) world y of the rows, ascending; planes have them from the north.
        """
        planes = self.blank(Window(0, 0, len(y), len(x)))
        step = (x[-1] - x[0]) / (len(x) - 1)
        with self._one() as painter:
            kernels.paint(painter, x, y, step, 0, 0, _Painted(*planes[:-1], None, *[None] * 3))
        return planes

    @contextmanager
    def _one(self) -> Iterator[kernels.Painter]:
        """Lend a painter that no other thread uses meanwhile."""
        try:
            painter = self._idle.pop()
        except IndexError:
            painter = kernels.Painter(
                self._field, self._voids, self._slopes, self._edges, self._storeys
            )
        yield painter
        self._idle.append(painter)

    def _check(self, window: Window, planes: Planes) -> None:
        shape = (window.height, window.width)
        dtypes = *self._dtypes, self._dtypes[0] if self._bands else None
        shapes = [shape] * len(self._dtypes) + [(self._bands, *shape)]
        for plane, dtype, own in zip(planes, dtypes, shapes, strict=True):
            if (plane is None) != (dtype is None) or not (
                plane is None
                or (plane.shape == own and plane.dtype == dtype and plane.flags.c_contiguous)
            ):
                wanted = "nothing" if dtype is None else f"{dtype}"
                raise ValueError(f"{wanted} of {shape[0]} × {shape[1]}, contiguous, is wanted")


def _fill_flat(heights: NDArray[Any], columns: NDArray[Any]) -> None:
    """Fill the bands of columns of a terrain without storeys."""
    columns[:] = np.nan
    columns[GROUND_BAND] = heights
    columns[COUNT_BAND] = ~np.isnan(heights)
    columns[COLUMN_BANDS : COLUMN_BANDS + 1] = heights


def most_tops(terrain: Terrain, grid: Grid) -> int:
    """Most tops of any column at the centre of a pixel, at least one."""
    if terrain.storeys is None:
        return 1
    painter = Painter(terrain, grid, surfaces=False, storeys=0)
    most, count = 1, len(terrain.storeys.table.gaps)
    for window in grid.windows(_ROWS, grid.width):
        hidden = HiddenPixels.of(*window.within(window), count)
        painter.paint(window, hidden=hidden)
        most = max(most, int(hidden.figures[1]))
    return most
