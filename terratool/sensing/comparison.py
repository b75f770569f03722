"""Comparison of a robot's map with the terrain: height errors, coverage and surfaces by cell."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_overlap
from terratool.raster.geotiff import crs_of
from terratool.raster.grid import Window
from terratool.report.wording import count_of
from terratool.sensing.lines import comparison_lines, shown_metres
from terratool.sensing.map_files import MapFile
from terratool.sensing.robot_map import MapLevel
from terratool.text.display import printable

Floats = NDArray[np.float64]

MOST_CELLS = 1 << 30
"""Most finest cells over a terrain in a comparison."""
_POINTS = 1 << 20
"""Most heights queried at a time."""
_BANDS = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0)
"""Far ends of the bands of distance from the sensor, m; the last band is open."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Height errors of a set of cells, map less terrain.

    Attributes:
        cells: number of cells with a height in map and terrain.
        rmse: root mean square error, m; NaN without cells.
        bias: mean error, m; NaN without cells.
        worst: largest absolute error, m; NaN without cells.
    """

    cells: int
    rmse: float
    bias: float
    worst: float

    @classmethod
    def of(cls, errors: Floats) -> Errors:
        """Summarise the errors of cells, (n,) float64, m."""
        if not len(errors):
            return cls(0, math.nan, math.nan, math.nan)
        mean_square = float(np.square(errors).mean())
        return cls(
            len(errors), math.sqrt(mean_square), float(errors.mean()), float(np.abs(errors).max())
        )


@dataclass(frozen=True, slots=True)
class SurfaceErrors:
    """Errors of the cells of one surface of the terrain.

    Attributes:
        name: name of the surface; "" for none.
        ground: number of cells with ground of the surface.
        errors: height errors of those cells that the map knows.
        named: number of those known cells with any surface in the map.
        right: number of those known cells with this surface in the map.
    """

    name: str
    ground: int
    errors: Errors
    named: int
    right: int


@dataclass(frozen=True, slots=True)
class BandErrors:
    """Errors of the cells seen from a band of distances.

    Attributes:
        low: least distance, m, inclusive.
        high: largest distance, m, exclusive; may be inf.
        errors: height errors of the cells.
    """

    low: float
    high: float
    errors: Errors


@dataclass(frozen=True, slots=True)
class WorstCell:
    """The cell with the largest absolute error.

    Attributes:
        x, y: centre of the cell, m.
        mapped: height in the map, m.
        true: height in the terrain, m.
        surface: name of the surface in the terrain; None for none.
    """

    x: float
    y: float
    mapped: float
    true: float
    surface: str | None


@dataclass(frozen=True, slots=True)
class MapComparison:
    """Comparison of a map with its terrain.

    Attributes:
        map: compared map.
        ground: number of cells with ground over the whole terrain, on the lattice of the map.
        known: number of cells with ground that the map knows.
        beyond: number of cells that the map knows where the terrain has no ground.
        errors: errors of all known cells.
        within: share of errors within two of the map's standard deviations, ideally 0.95; NaN for a
            map without variances.
        worst: cell with the largest error; None without known cells.
        surfaces: errors by the terrain's surface at the centre of a cell.
        distances: errors by the distance that cells were seen from; empty without distances.
        truth: (height, width) float64, heights of the terrain in the cells of the map, m; NaN
            without ground.
    """

    map: MapFile
    ground: int
    known: int
    beyond: int
    errors: Errors
    within: float
    worst: WorstCell | None
    surfaces: tuple[SurfaceErrors, ...]
    distances: tuple[BandErrors, ...]
    truth: Floats

    def __repr__(self) -> str:
        said = f"{self.known:,} of {count_of(self.ground, 'cell')}"
        error = "" if self.worst is None else f", RMSE {shown_metres(self.errors.rmse)}"
        return f"<MapComparison of {printable(self.map.name)}: {said}{error}>"

    def __str__(self) -> str:
        return "\n".join(map(printable, comparison_lines(self)))

    def _repr_html_(self) -> str:
        """Lines of the comparison, for notebooks."""
        return f"<pre>{escape(str(self))}</pre>"

    @property
    def coverage(self) -> float:
        """Share of the terrain's ground that the map knows; NaN without ground."""
        return self.known / self.ground if self.ground else math.nan


def check_map(map_: MapFile, terrain: Terrain) -> None:
    """Refuse a map that cannot be compared with a terrain.

    Raises:
        RequestError: the map misses the terrain, has another reference system, or is too fine.
    """
    grid = map_.level.grid
    check_overlap(terrain.bounds, grid.bounds, map_.name)
    crs = crs_of(terrain)
    if map_.crs is not None and crs is not None and map_.crs != crs:
        raise RequestError(
            f"{map_.name}: has another reference system than the terrain.",
            "Reproject it first, as by gdalwarp -t_srs.",
        )
    lattice = _lattice(map_.level, terrain)
    cells = float(lattice.height) * lattice.width * 4.0**map_.level.level
    if cells > MOST_CELLS:
        raise RequestError(
            f"{map_.name}: its cells of {grid.resolution:g} would be {cells:,.0f} over the "
            "terrain.",
            "Compare a coarser level.",
        )


def compare(
    map_: MapFile, terrain: Terrain, progress: Callable[[int], object] = lambda _: None
) -> MapComparison:
    """Compare a map with its terrain.

    The terrain's height in a finest cell is that at the centre; in a coarse cell, the mean over the
    centres of its finest cells that have ground, as in the map. The surface is that at the centre
    of the cell.

    Args:
        map_: map to be compared.
        terrain: terrain of the map.
        progress: called with the number of cells done since its last call.

    Raises:
        RequestError: as for `check_map`.
    """
    check_map(map_, terrain)
    level, most = map_.level, len(terrain.surfaces) + 1
    grounds = np.zeros(most, np.int64)
    truth = np.full(level.elevation.shape, np.nan)
    surface = np.full(level.elevation.shape, -1, np.int32)
    for window in _windows(level, terrain):
        heights, surfaces = _truth(level, window, terrain)
        grounds += np.bincount(surfaces[np.isfinite(heights)] + 1, minlength=most)
        _put(window, truth, heights)
        _put(window, surface, surfaces)
        progress(window.height * window.width)
    return _comparison_of(map_, terrain, truth, surface, grounds)


def cells_to_compare(map_: MapFile, terrain: Terrain) -> int:
    """Number of cells that `compare` visits."""
    lattice = _lattice(map_.level, terrain)
    return lattice.height * lattice.width


def _lattice(level: MapLevel, terrain: Terrain) -> Window:
    """Window of the map's lattice that covers the terrain; row and column may be negative."""
    grid = level.grid
    west, south, east, north = terrain.bounds
    side, top = grid.resolution, grid.bounds[3]
    column, row = math.floor((west - grid.west) / side), math.floor((top - north) / side)
    width = math.ceil((east - grid.west) / side) - column
    height = math.ceil((top - south) / side) - row
    return Window(row, column, height, width)


def _windows(level: MapLevel, terrain: Terrain) -> Iterator[Window]:
    most = max(1, _POINTS >> 2 * level.level)
    lattice = _lattice(level, terrain)
    width = min(lattice.width, most)
    yield from lattice.cut(max(1, most // width), width)


def _truth(level: MapLevel, window: Window, terrain: Terrain) -> tuple[Floats, NDArray[np.int32]]:
    """Heights of cells as `compare` defines them, and surfaces at their centres, -1 for none."""
    grid, parts = level.grid, 2**level.level
    columns = window.column + np.arange(window.width)
    rows = window.row + np.arange(window.height)
    north = grid.bounds[3]

    def places(shares: Floats) -> tuple[Floats, Floats]:
        x = grid.west + (columns[:, None] + shares).ravel() * grid.resolution
        y = north - (rows[:, None] + shares).ravel() * grid.resolution
        return x[None, :], y[:, None]

    middle = terrain.sample(*places(np.array([0.5])))
    if parts == 1:
        return middle.height, middle.surface
    fine = terrain.height(*places((np.arange(parts) + 0.5) / parts))
    blocks = fine.reshape(window.height, parts, window.width, parts)
    known = np.isfinite(blocks)
    counts = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    return np.where(counts, total / np.maximum(counts, 1), np.nan), middle.surface


def _put(window: Window, whole: NDArray[Any], part: NDArray[Any]) -> None:
    """Copy the cells of a window into the map's array, as far as they overlap."""
    rows, columns = (
        (max(first, 0), min(first + count, most), first)
        for first, count, most in zip(
            (window.row, window.column), (window.height, window.width), whole.shape, strict=True
        )
    )
    if rows[0] < rows[1] and columns[0] < columns[1]:
        whole[rows[0] : rows[1], columns[0] : columns[1]] = part[
            rows[0] - rows[2] : rows[1] - rows[2],
            columns[0] - columns[2] : columns[1] - columns[2],
        ]


def _comparison_of(
    map_: MapFile, terrain: Terrain, truth: Floats, surface: NDArray[np.int32],
    grounds: NDArray[np.int64],
) -> MapComparison:  # fmt: skip
    level = map_.level
    mapped = np.isfinite(level.elevation)
    both = mapped & np.isfinite(truth)
    errors, of = (level.elevation - truth)[both], surface[both]
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.abs(errors) / np.sqrt(level.variance[both])
    sure = np.isfinite(apart)
    return MapComparison(
        map=map_,
        ground=int(grounds.sum()),
        known=len(errors),
        beyond=int((mapped & ~both).sum()),
        errors=Errors.of(errors),
        within=float((apart[sure] <= 2.0).mean()) if sure.any() else math.nan,
        worst=_worst(level, terrain, truth, surface, both),
        surfaces=tuple(_by_surface(level, terrain, of, errors, grounds, both)),
        distances=tuple(_by_distance(level.distance[both], errors)),
        truth=truth,
    )


def _worst(
    level: MapLevel, terrain: Terrain, truth: Floats, surface: NDArray[np.int32],
    both: NDArray[np.bool_],
) -> WorstCell | None:  # fmt: skip
    if not both.any():
        return None
    size = np.where(both, np.abs(level.elevation - truth), -1.0)
    row, column = np.unravel_index(int(np.argmax(size)), size.shape)
    grid = level.grid
    index = int(surface[row, column])
    return WorstCell(
        float(grid.columns(grid.whole)[column]),
        float(grid.rows(grid.whole)[row]),
        float(level.elevation[row, column]),
        float(truth[row, column]),
        terrain.surfaces[index] if index >= 0 else None,
    )


def _by_surface(
    level: MapLevel, terrain: Terrain, of: NDArray[np.int32], errors: Floats,
    grounds: NDArray[np.int64], both: NDArray[np.bool_],
) -> Iterator[SurfaceErrors]:  # fmt: skip
    names = np.array([*level.surfaces, ""], object)[level.surface[both]]
    for index, name in [*enumerate(terrain.surfaces), (-1, "")]:
        if not grounds[index + 1]:
            continue
        there = of == index
        given = names[there]
        yield SurfaceErrors(
            name,
            int(grounds[index + 1]),
            Errors.of(errors[there]),
            int((given != "").sum()),
            int(((given == name) & (given != "")).sum()),
        )


def _by_distance(distances: Floats, errors: Floats) -> Iterator[BandErrors]:
    edges = (0.0, *_BANDS, math.inf)
    for low, high in pairwise(edges):
        there = (distances >= low) & (distances < high)
        if there.any():
            yield BandErrors(low, high, Errors.of(errors[there]))
