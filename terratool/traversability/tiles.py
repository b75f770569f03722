"""A survey that is made tile by tile as it is asked for, each tile once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.export import checked_threads
from terratool.raster.grid import Grid, Window
from terratool.raster.painter import id_type
from terratool.raster.prefetch import prefetch
from terratool.traversability.results import HEADINGS, Survey
from terratool.traversability.survey import SoilSamples, Surveyor, WindowMeasures
from terratool.traversability.vehicle import Vehicle

TILE = 64
"""Cells along each side of a tile."""

_PLANES = {
    "utilisation": kernels.UTILISATION, "pitch": kernels.PITCH, "roll": kernels.ROLL,
    "sinkage": kernels.SINKAGE, "slip": kernels.SLIP, "energy": kernels.ENERGY,
}  # fmt: skip

Take = Callable[[Window, WindowMeasures], object]


def survey(
    terrain: Terrain,
    vehicle: Vehicle,
    grid: Grid,
    headings: int = HEADINGS,
    *,
    threads: int | None = None,
) -> Survey:
    """A vehicle at the pixel centres of a grid.

    Memory is that of the result (26 bytes for each pixel and heading) and of ground under windows.

    Args:
        terrain: the ground.
        vehicle: a vehicle, or a wheel by itself.
        grid: the pixels.
        headings: a multiple of 4 from 4 to 64.
        threads: number of threads; as many as there are processors if None.

    Raises:
        RequestError: the resolution does not go with the vehicle, or the number of headings or of
            threads makes no sense, or a surface has figures that are too large.
    """
    return SurveyTiles(Surveyor(terrain, vehicle, grid, headings), threads=threads).complete()


def survey_window(surveyor: Surveyor, window: Window) -> Survey:
    """As `survey`, of a window of a surveyor's grid alone."""
    whole, side = surveyor.grid, surveyor.grid.resolution
    grid = Grid(
        whole.west + window.column * side,
        whole.south + (whole.height - window.row - window.height) * side,
        side, window.height, window.width,
    )  # fmt: skip
    found = _blank(surveyor, grid)
    for inner in surveyor.windows(window):
        local = Window(
            inner.row - window.row, inner.column - window.column, inner.height, inner.width
        )
        _put(found, part_of(local), surveyor.measure(inner, sampled=False))
    return found


def _blank(surveyor: Surveyor, grid: Grid) -> Survey:
    """A survey of nothing; memory that is 0 is not taken until it is written to."""
    flat = (grid.height, grid.width)
    deep = (surveyor.headings, *flat)
    return Survey(
        grid,
        np.zeros(flat, np.float32),
        np.zeros(flat, id_type(surveyor.terrain)),
        np.zeros(deep, np.uint8),
        np.zeros(deep, np.uint8),
        **{name: np.zeros(deep, np.float32) for name in _PLANES},
    )


def _put(survey: Survey, part: Any, found: WindowMeasures) -> None:
    """Put what was found out about a window into a survey."""
    survey.heights[part], survey.surfaces[part] = found.heights, found.surfaces
    survey.verdict[:, *part], survey.reason[:, *part] = found.verdict, found.reason
    for name, plane in _PLANES.items():
        getattr(survey, name)[:, *part] = found.numbers[:, plane]


class SurveyTiles:
    """A survey of which only what was asked for is known; its other cells mean nothing.

    Memory is that of the survey, 26 bytes for each cell and heading, where tiles are known.

    Attributes:
        survey: all of it.
        known: (rows, columns) bool, tiles that were made.
        side: of a tile, in cells.
        progress: is called with the number of cells of each window that is made.

    Args:
        surveyor: of a vehicle on a terrain, on the cells of the survey.
        threads: number of threads; as many as there are processors if None.
        take: is called, by several threads, with each window that is made and all that was found
            out about it.
    """

    def __init__(
        self, surveyor: Surveyor, *, threads: int | None = None, take: Take | None = None
    ) -> None:
        grid = surveyor.grid
        self._surveyor: Surveyor | None = surveyor
        self._threads, self._take = checked_threads(threads), take
        self.side = TILE
        self.progress: Callable[[int], object] | None = None
        self.known = np.zeros((-(-grid.height // TILE), -(-grid.width // TILE)), np.bool_)
        self.survey = _blank(surveyor, grid)

    @classmethod
    def of(cls, survey: Survey | SurveyTiles) -> SurveyTiles:
        """Of a survey that is all known."""
        if isinstance(survey, SurveyTiles):
            return survey
        tiles = cls.__new__(cls)
        tiles._surveyor = None
        height, width = survey.heights.shape
        tiles.survey, tiles.side = survey, TILE
        tiles.known = np.ones((-(-height // TILE), -(-width // TILE)), np.bool_)
        tiles.progress = None
        return tiles

    def window(self, tile: int) -> Window:
        """The cells of a tile, by its index row by row."""
        row, column = divmod(tile, self.known.shape[1])
        return self._window(row, column, 1)

    def tile_of(self, cell: tuple[int, int]) -> Window:
        """The cells of the tile that holds one."""
        return self._window(cell[0] // self.side, cell[1] // self.side, 1)

    def _window(self, row: int, column: int, count: int) -> Window:
        grid = self.survey.grid
        top, left = row * self.side, column * self.side
        return Window(
            top, left, min(self.side, grid.height - top),
            min(count * self.side, grid.width - left),
        )  # fmt: skip

    def make(self, tile: int, goal: tuple[int, int]) -> list[int]:
        """Make a tile, and as many of those beside it as there are other threads.

        These are the ones that lie nearer to the cell `goal`. The tiles that were made.
        """
        height, width = self.known.shape
        row, column = divmod(tile, width)

        def far(at: tuple[int, int]) -> float:
            return float(
                np.hypot(
                    (at[0] + 0.5) * self.side - goal[0] - 0.5,
                    (at[1] + 0.5) * self.side - goal[1] - 0.5,
                )
            )

        beside = [
            (r, c)
            for r in range(max(row - 1, 0), min(row + 2, height))
            for c in range(max(column - 1, 0), min(column + 2, width))
            if not self.known[r, c] and far((r, c)) < far((row, column))
        ]
        wanted = [(row, column), *sorted(beside, key=far)[: self._threads - 1]]
        self._make([self._window(r, c, 1) for r, c in wanted])
        return [r * width + c for r, c in wanted]

    def complete(self, rows: ArrayLike = (), columns: ArrayLike = ()) -> Survey:
        """Make what is not yet known of the tiles that hold cells; of all, where none are given."""
        held = np.zeros_like(self.known)
        tiles = (np.asarray(cells, np.int64) // self.side for cells in (rows, columns))
        held[tuple(tiles)] = True
        self._make(list(self._runs(~self.known & (held if held.any() else ~held))))
        return self.survey

    @property
    def samples(self) -> SoilSamples | None:
        """Of the soils; None where these are not sampled."""
        return None if self._surveyor is None else self._surveyor.samples

    def going(
        self, headings: NDArray[np.int64], rows: NDArray[np.int64], columns: NDArray[np.int64]
    ) -> NDArray[np.uint64] | None:
        """On which samples of the soils the vehicle is go, as bits; None where none are sampled.

        Args:
            headings: (n,) of the survey.
            rows: (n,) of its cells.
            columns: likewise.

        Returns:
            (n, words).
        """
        if self.samples is None:
            return None
        assert self._surveyor is not None
        out = np.zeros((len(rows), -(-len(self.samples.steps) // 64)), np.uint64)
        tiles = rows // self.side * self.known.shape[1] + columns // self.side
        for tile in np.unique(tiles).tolist():
            at = np.flatnonzero(tiles == tile)
            top, left = int(rows[at].min()), int(columns[at].min())
            window = Window(
                top, left, int(rows[at].max()) + 1 - top, int(columns[at].max()) + 1 - left
            )
            wanted, places = np.unique(headings[at], return_inverse=True)
            found = self._surveyor.going(window, wanted.tolist())
            assert found is not None
            out[at] = found[places, rows[at] - top, columns[at] - left]
        return out

    def _runs(self, wanted: NDArray[np.bool_]) -> Iterator[Window]:
        """Windows over tiles that lie side by side; one of all where all are wanted."""
        if wanted.all():
            yield self.survey.grid.whole
            return
        for row, line in enumerate(wanted):
            edges = np.flatnonzero(np.diff(np.r_[False, line, False].astype(np.int8)))
            for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
                yield self._window(row, first, end - first)

    def _make(self, wanted: list[Window]) -> None:
        if not wanted:
            return
        assert self._surveyor is not None
        windows = [inner for window in wanted for inner in self._surveyor.windows(window)]
        for window in prefetch(self._measured, windows, self._threads):
            if self.progress:
                self.progress(window.height * window.width)
        for window in wanted:
            row, column = window.row // self.side, window.column // self.side
            rows, columns = -(-window.height // self.side), -(-window.width // self.side)
            self.known[row : row + rows, column : column + columns] = True

    def _measured(self, window: Window) -> Window:
        """Make a window; windows do not overlap, so that threads do not meet."""
        assert self._surveyor is not None
        found = self._surveyor.measure(window, sampled=self._take is not None)
        _put(self.survey, part_of(window), found)
        if self._take is not None:
            self._take(window, found)
        return window


def part_of(window: Window) -> Any:
    """The rows and columns of a window, as an index."""
    return np.s_[
        window.row : window.row + window.height, window.column : window.column + window.width
    ]
