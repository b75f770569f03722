"""A survey that is computed tile by tile on demand, each tile once."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.cluster import Crew, Threads
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window, window_name
from terratool.raster.painter import id_type
from terratool.tasks import Work, thread_count
from terratool.traversability.keep_out import Zone
from terratool.traversability.layers import copy_from_owners, rings
from terratool.traversability.map_results import HEADINGS, Survey, cell_of
from terratool.traversability.survey import Surveyor, Uncertainty, WindowMeasures
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import Reason, Verdict

_LAYERED = (128, 512)
"""Rows and columns of windows in which all layers are measured one after the other."""
TILE = 64
"""Cells along each side of a tile."""

_PLANES = {
    "utilisation": kernels.UTILISATION, "pitch": kernels.PITCH, "roll": kernels.ROLL,
    "sinkage": kernels.SINKAGE, "slip": kernels.SLIP, "energy": kernels.ENERGY,
    "crab": kernels.CRAB,
    "reserve": kernels.RESERVE,
}  # fmt: skip
"""Planes of `WindowMeasures.numbers` by the attribute of `Survey` that holds them."""

Take = Callable[[Window, WindowMeasures], object]
"""A function that is called with a window and its measures."""


def survey(
    terrain: Terrain,
    vehicle: Vehicle,
    grid: Grid,
    headings: int = HEADINGS,
    *,
    threads: int | None = None,
) -> Survey:
    """Survey a vehicle at all pixel centres of a grid.

    Memory is that of the result, 30 bytes for each pixel and heading, and of the windows at work.

    Args:
        terrain: the ground.
        vehicle: a vehicle, or a wheel by itself.
        grid: pixels of the survey.
        headings: number of headings, a multiple of 4 from 4 to 64.
        threads: number of threads; as many as there are processors if None.

    Raises:
        RequestError: the resolution does not go with the vehicle, or the number of headings or of
            threads makes no sense, or a surface has figures that are too large.
    """
    return SurveyTiles(Surveyor(terrain, vehicle, grid, headings), threads=threads).complete()


def survey_window(surveyor: Surveyor, window: Window) -> Survey:
    """Survey a window of a surveyor's grid; its own grid is the window's."""
    whole, side = surveyor.grid, surveyor.grid.resolution
    _, flat = surveyor.stack.split(window)
    grid = Grid(
        whole.west + window.column * side,
        whole.south + (whole.height - flat.row - flat.height) * side,
        side, window.height, window.width,
    )  # fmt: skip
    found = _empty_survey(surveyor, grid)
    for inner in surveyor.windows(window):
        local = Window(
            inner.row - window.row, inner.column - window.column, inner.height, inner.width
        )
        _store(found, part_of(local), surveyor.measure(inner, sampled=False))
    return found


def _empty_survey(surveyor: Surveyor, grid: Grid, shape: tuple[int, int] | None = None) -> Survey:
    """A survey of zeros; the system takes no memory for zeros before they are overwritten."""
    flat = shape or (grid.height, grid.width)
    deep = (surveyor.headings, *flat)
    numbers: dict[str, Any] = {name: np.zeros(deep, np.float32) for name in _PLANES}
    return Survey(
        grid,
        np.zeros(flat, np.float32),
        np.zeros(flat, id_type(surveyor.terrain)),
        np.zeros(deep, np.uint8),
        np.zeros(deep, np.uint8),
        **numbers,
        load=np.zeros(deep, np.uint8) if surveyor.vehicle.loads else None,
    )


def _store(survey: Survey, part: Any, found: WindowMeasures) -> None:
    """Store the measures of a window in a part of a survey."""
    survey.heights[part], survey.surfaces[part] = found.heights, found.surfaces
    survey.verdict[:, *part], survey.reason[:, *part] = found.verdict, found.reason
    for name, plane in _PLANES.items():
        getattr(survey, name)[:, *part] = found.numbers[:, plane]
    if survey.load is not None and found.load is not None:
        survey.load[:, *part] = found.load


class SurveyTiles:
    """A survey of which only tiles on demand are computed; cells of other tiles mean nothing.

    Memory is 30 bytes for each cell and heading of computed tiles.

    Attributes:
        survey: the whole survey.
        known: (rows, columns) bool, tiles that are computed.
        side: side of a tile, cells.
        progress: called with the number of cells of each window that is computed; None for none.

    Args:
        surveyor: surveyor of a vehicle on a terrain, on the cells of the survey.
        threads: number of threads; as many as there are processors if None.
        take: called with each window that is computed and its measures.
    """

    def __init__(
        self, surveyor: Surveyor, *, threads: int | None = None, take: Take | None = None
    ) -> None:
        grid = surveyor.grid
        self._surveyor: Surveyor | None = surveyor
        self._threads, self._take = thread_count(threads), take
        self.side = TILE
        self.progress: Callable[[int], object] | None = None
        shape = surveyor.stack.shape
        self.known = np.zeros((-(-shape[0] // TILE), -(-shape[1] // TILE)), np.bool_)
        self.survey = _empty_survey(surveyor, grid, shape)
        self._shown: NDArray[np.int16] | None = None
        self._own = np.zeros((0, 0), np.bool_)
        if surveyor.stack.layers > 1:
            self._shown, self._own = np.full(shape, -1, np.int16), np.zeros(shape, np.bool_)

    @classmethod
    def of(cls, survey: Survey | SurveyTiles) -> SurveyTiles:
        """Wrap a survey that is known as a whole; tiles are returned as they are."""
        if isinstance(survey, SurveyTiles):
            return survey
        tiles = cls.__new__(cls)
        tiles._surveyor = tiles._shown = None
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
        """The cells of the tile that holds a cell, given by row and column."""
        return self._window(cell[0] // self.side, cell[1] // self.side, 1)

    def _window(self, row: int, column: int, count: int) -> Window:
        """The cells of `count` tiles side by side, from the tile in a row and column."""
        grid = self.survey.grid
        top, left = row * self.side, column * self.side
        height = len(self.survey.heights)
        return Window(
            top, left, min(self.side, height - top), min(count * self.side, grid.width - left)
        )

    def make(self, tile: int, goal: tuple[int, int]) -> list[int]:
        """Compute a tile, and with other threads those beside it that are nearer to a cell `goal`.

        Returns:
            Indices of the tiles that were computed.
        """
        height, width = self.known.shape
        row, column = divmod(tile, width)

        def distance(at: tuple[int, int]) -> float:
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
            if not self.known[r, c] and distance((r, c)) < distance((row, column))
        ]
        wanted = [(row, column), *sorted(beside, key=distance)[: self._threads - 1]]
        self._make([self._window(r, c, 1) for r, c in wanted])
        return [r * width + c for r, c in wanted]

    def complete(
        self, rows: ArrayLike = (), columns: ArrayLike = (), crew: Crew | None = None
    ) -> Survey:
        """Compute the tiles that hold cells, if not yet known; all tiles if no cells are given.

        Args:
            rows: (n,) rows of cells.
            columns: (n,) columns of cells.
            crew: crew that measures; threads of the survey's own if None.
        """
        if self._shown is not None:
            self._complete_layers(crew)
            return self.survey
        held = np.zeros_like(self.known)
        tiles = (np.asarray(cells, np.int64) // self.side for cells in (rows, columns))
        held[tuple(tiles)] = True
        self._make(list(self._runs(~self.known & (held if held.any() else ~held))), crew)
        return self.survey

    def _complete_layers(self, crew: Crew | None) -> None:
        """Compute all layers, if not yet known; what a layer shows of others is as they have it."""
        if self.known.all():
            return
        assert self._surveyor is not None and self._shown is not None
        stack = self._surveyor.stack
        self._measure(list(stack.windows(*_LAYERED)), crew)
        self.known[:] = True
        found, own = self.survey, self._own

        def copied(values: NDArray[Any], nothing: float = 0) -> NDArray[Any]:
            assert self._shown is not None
            return copy_from_owners(values, own, self._shown, stack, nothing)

        planes: dict[str, Any] = {
            name: copied(getattr(found, name)) for name in ("surfaces", *_PLANES)
        }
        load = None if found.load is None else copied(found.load)
        self.survey = replace(
            found, **planes, heights=copied(found.heights, np.nan),
            verdict=copied(found.verdict, Verdict.NO_GO),
            reason=copied(found.reason, Reason.NO_GROUND), load=load,
            stack=stack, twins=rings(self._shown, stack), own=own,
        )  # fmt: skip

    def cell_of(self, place: tuple[float, ...]) -> tuple[int, int]:
        """Row in all layers and column of the cell that holds a place, as `Surveyor.cell_of`."""
        row, column = cell_of(self.survey.grid, *place[:2])
        if self._shown is not None:
            self._complete_layers(None)
        stack = self.survey.stack
        number = self.survey.layer_of((row, column), *place[2:])
        return row + (0 if stack is None else number * stack.pitch), column

    @property
    def zones(self) -> tuple[Zone, ...]:
        """Zones that the vehicle keeps out of."""
        return () if self._surveyor is None else self._surveyor.zones

    @property
    def uncertainty(self) -> Uncertainty | None:
        """Samples of the surveyor; None where all is known."""
        return None if self._surveyor is None else self._surveyor.uncertainty

    def samples_passing(
        self, headings: NDArray[np.int64], rows: NDArray[np.int64], columns: NDArray[np.int64]
    ) -> NDArray[np.uint64] | None:
        """Samples on which the vehicle is go at cells; None where nothing is sampled.

        Args:
            headings: (n,) indices of headings of the survey.
            rows: (n,) rows of cells.
            columns: (n,) columns of cells.

        Returns:
            (n, words) uint64, one bit for each sample.
        """
        if self.uncertainty is None:
            return None
        assert self._surveyor is not None
        out = np.zeros((len(rows), self.uncertainty.words), np.uint64)
        rows = self.survey.own_rows(rows, columns)
        tiles = rows // self.side * self.known.shape[1] + columns // self.side
        for tile in np.unique(tiles).tolist():
            at = np.flatnonzero(tiles == tile)
            top, left = int(rows[at].min()), int(columns[at].min())
            window = Window(
                top, left, int(rows[at].max()) + 1 - top, int(columns[at].max()) + 1 - left
            )
            wanted, places = np.unique(headings[at], return_inverse=True)
            found = self._surveyor.samples_passing(window, wanted.tolist())
            assert found is not None
            out[at] = found[places, rows[at] - top, columns[at] - left]
        return out

    def _runs(self, wanted: NDArray[np.bool_]) -> Iterator[Window]:
        """Windows over wanted tiles that lie side by side; one of all where all are wanted."""
        if wanted.all():
            yield self.survey.grid.whole
            return
        for row, line in enumerate(wanted):
            edges = np.flatnonzero(np.diff(np.r_[False, line, False].astype(np.int8)))
            for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
                yield self._window(row, first, end - first)

    def _make(self, wanted: list[Window], crew: Crew | None = None) -> None:
        """Compute windows of whole tiles, and mark these as known."""
        if not wanted:
            return
        if self._shown is not None:
            self._complete_layers(crew)
            return
        self._measure(wanted, crew)
        for window in wanted:
            row, column = window.row // self.side, window.column // self.side
            rows, columns = -(-window.height // self.side), -(-window.width // self.side)
            self.known[row : row + rows, column : column + columns] = True

    def _measure(self, wanted: list[Window], crew: Crew | None = None) -> None:
        """Measure windows into the survey."""
        assert self._surveyor is not None
        windows = [inner for window in wanted for inner in self._surveyor.windows(window)]
        work = Work(_measure, (self._surveyor, self._take is not None), name=window_name)
        crew = crew or Threads(self._threads)
        with contextlib.closing(crew.run(work, windows)) as measured:
            for window, found in zip(windows, measured, strict=True):
                _store(self.survey, part_of(window), found)
                if self._shown is not None and found.shown is not None:
                    self._shown[part_of(window)] = found.shown
                    self._own[part_of(window)] = found.own
                if self._take is not None:
                    self._take(window, found)
                if self.progress:
                    self.progress(window.height * window.width)


def _measure(common: tuple[Surveyor, bool], window: Window) -> WindowMeasures:
    """Measure a window, with the probability of go where samples count."""
    surveyor, sampled = common
    return surveyor.measure(window, sampled=sampled)


def part_of(window: Window) -> Any:
    """The rows and columns of a window, as an index of arrays."""
    return np.s_[
        window.row : window.row + window.height, window.column : window.column + window.width
    ]
