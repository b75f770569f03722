"""Comparison of a robot's map with the terrain: height errors, coverage and surfaces by cell.

A cell of a map of patches has several heights, each of which is held against the face of the
terrain's column that is nearest to it: a top, or an underside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
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
from terratool.sensing.faces import GROUND, TOP, UNDERSIDE, CellPlaces, Truth, truth
from terratool.sensing.lines import Face, comparison_lines, shown_metres
from terratool.sensing.map_files import MapFile
from terratool.sensing.patches import GAP
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
        ground: number of cells with ground of the surface; of tops, for a map of patches.
        known: number of those that the map knows.
        errors: height errors of what the map has there.
        named: number of those known cells with any surface in the map.
        right: number of those known cells with this surface in the map.
    """

    name: str
    ground: int
    known: int
    errors: Errors
    named: int
    right: int


@dataclass(frozen=True, slots=True)
class FaceErrors:
    """Errors of the patches that are nearest to faces of one kind.

    Attributes:
        kind: GROUND, TOP or UNDERSIDE.
        errors: height errors of the patches.
    """

    kind: int
    errors: Errors


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
        face: what its heights were held against.
        ground: number of cells with ground over the whole terrain, on the lattice of the map; of
            tops in these cells, if patches were held against the nearest faces.
        known: number of those that the map knows; a patch knows a top by that or by its underside.
        beyond: number of cells, or of patches, that the map has where the terrain has no ground.
        errors: errors of all heights of the map over ground.
        within: share of errors within two of the map's standard deviations, ideally 0.95; NaN for a
            map without variances.
        worst: cell with the largest error; None without known cells.
        surfaces: errors by the terrain's surface at the centre of a cell.
        distances: errors by the distance that cells were seen from; empty without distances.
        faces: errors by the kind of the nearest face; empty if others were not looked for.
        storeys: number of decks and bores of the terrain.
        truth: (height, width) float64, heights of the terrain in the cells of the map, m; NaN
            without ground. (storeys, height, width) for a map of patches, NaN without one.
    """

    map: MapFile
    face: Face
    ground: int
    known: int
    beyond: int
    errors: Errors
    within: float
    worst: WorstCell | None
    surfaces: tuple[SurfaceErrors, ...]
    distances: tuple[BandErrors, ...]
    faces: tuple[FaceErrors, ...]
    storeys: int
    truth: Floats

    def __repr__(self) -> str:
        said = f"{self.known:,} of {count_of(self.ground, self.unit)}"
        error = "" if self.worst is None else f", RMSE {shown_metres(self.errors.rmse)}"
        return f"<MapComparison of {printable(self.map.name)}: {said}{error}>"

    def __str__(self) -> str:
        return "\n".join(map(printable, comparison_lines(self)))

    def _repr_html_(self) -> str:
        """Lines of the comparison, for notebooks."""
        return f"<pre>{escape(str(self))}</pre>"

    @property
    def unit(self) -> str:
        """Word for what is counted as ground: cell, or top."""
        return "top" if self.face == "nearest" else "cell"

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
    map_: MapFile,
    terrain: Terrain,
    progress: Callable[[int], object] = lambda _: None,
    face: Face | None = None,
) -> MapComparison:
    """Compare a map with its terrain.

    The terrain's height in a finest cell is that at the centre; in a coarse cell, the mean over the
    centres of its finest cells that have ground, as in the map. The surface is that at the centre
    of the cell.

    Against the nearest face each patch is held against what is nearest to its height in the column
    there, a top or an underside. In a coarse cell these are the nearest faces at the centres of
    its finest cells that are no farther from the patch than the gap.

    Args:
        map_: map to be compared.
        terrain: terrain of the map.
        progress: called with the number of cells done since its last call.
        face: what its heights are held against; what the map says, if None.

    Raises:
        RequestError: as for `check_map`.
    """
    check_map(map_, terrain)
    face = map_.face if face is None else face
    level, most = map_.level, len(terrain.surfaces) + 1
    gap = GAP if map_.gap is None else map_.gap
    shape = len(map_.storeys), *level.elevation.shape
    whole = Truth(
        np.full(shape, np.nan), np.full(shape, -1, np.int32), np.full(shape, -1, np.int8),
        np.full(shape, -1), np.empty((0, 0, 0), np.int32),
    )  # fmt: skip
    grounds, knowns = np.zeros((2, most), np.int64)
    for window in _windows(level, terrain):
        places = CellPlaces(level, window)
        patches = [_cut(one, window) for one in map_.storeys]
        part = truth(face, places, patches, gap, terrain)
        counts = part.tops[part.tops > -2]
        grounds += np.bincount(counts + 1, minlength=most)
        knowns += np.bincount(part.known(patches) + 1, minlength=most)
        for name in ("height", "surface", "kind"):
            _put(window, getattr(whole, name), getattr(part, name))
        progress(window.height * window.width)
    return _Compared(map_, terrain, face, whole, grounds, knowns).comparison


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


def _overlap(window: Window, shape: tuple[int, ...]) -> tuple[tuple[slice, ...], ...]:
    """Rows and columns of an array that a window overlaps, and those of the window there."""
    ends = [
        (first, max(first, 0), max(max(first, 0), min(first + count, most)))
        for first, count, most in zip(
            (window.row, window.column), (window.height, window.width), shape, strict=True
        )
    ]
    return (
        tuple(slice(begin, end) for _, begin, end in ends),
        tuple(slice(begin - first, end - first) for first, begin, end in ends),
    )


def _put(window: Window, whole: NDArray[Any], part: NDArray[Any]) -> None:
    """Copy cells of a window, (n, rows, columns), into an array of the map, where they overlap."""
    there, here = _overlap(window, whole.shape[-2:])
    whole[:, *there] = part[:, *here]


def _cut(level: MapLevel, window: Window) -> MapLevel:
    """Heights of the cells of a window; NaN beyond the map."""

    def cut(values: Floats) -> Floats:
        out = np.full((window.height, window.width), np.nan)
        there, here = _overlap(window, values.shape)
        out[here] = values[there]
        return out

    return replace(level, elevation=cut(level.elevation), lowest=cut(level.lowest))


class _Compared:
    """A map and what the terrain has in its cells.

    Args:
        map_: the map.
        terrain: the terrain.
        face: what heights are held against.
        true: what the terrain has there.
        grounds: (surfaces + 1,) number of cells, or tops, by surface, those of none first.
        knowns: the same of those that the map knows.
    """

    def __init__(
        self, map_: MapFile, terrain: Terrain, face: Face, true: Truth,
        grounds: NDArray[np.int64], knowns: NDArray[np.int64],
    ) -> None:  # fmt: skip
        self._map, self._terrain, self._face, self._true = map_, terrain, face, true
        self._grounds, self._knowns = grounds, knowns
        self._mapped = self._band("elevation")
        self._both = np.isfinite(self._mapped) & np.isfinite(true.height)
        self._errors = (self._mapped - true.height)[self._both]

    def _band(self, name: str) -> NDArray[Any]:
        """Values of all patches, (storeys, height, width)."""
        return np.stack([getattr(one, name) for one in self._map.storeys])

    @property
    def comparison(self) -> MapComparison:
        """The comparison."""
        errors, both, storeys = self._errors, self._both, self._terrain.storeys
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.abs(errors) / np.sqrt(self._band("variance")[both])
        sure = np.isfinite(apart)
        heights = self._true.height
        return MapComparison(
            map=self._map,
            face=self._face,
            ground=int(self._grounds.sum()),
            known=int(self._knowns.sum()),
            beyond=int((np.isfinite(self._mapped) & ~both).sum()),
            errors=Errors.of(errors),
            within=float((apart[sure] <= 2.0).mean()) if sure.any() else math.nan,
            worst=self._worst(),
            surfaces=tuple(self._by_surface()),
            distances=tuple(_by_distance(self._band("distance")[both], errors)),
            faces=tuple(self._by_face()) if self._face == "nearest" else (),
            storeys=0 if storeys is None else storeys.decks + storeys.bores,
            truth=heights[0] if self._map.gap is None else heights,
        )

    def _worst(self) -> WorstCell | None:
        if not self._both.any():
            return None
        size = np.where(self._both, np.abs(self._mapped - self._true.height), -1.0)
        at = np.unravel_index(int(np.argmax(size)), size.shape)
        _, row, column = at
        grid, surfaces = self._map.level.grid, self._terrain.surfaces
        index = int(self._true.surface[at])
        return WorstCell(
            float(grid.columns(grid.whole)[column]),
            float(grid.rows(grid.whole)[row]),
            float(self._mapped[at]),
            float(self._true.height[at]),
            surfaces[index] if index >= 0 else None,
        )

    def _by_surface(self) -> Iterator[SurfaceErrors]:
        known = self._band("surface")[self._both]
        names = np.array([*self._map.level.surfaces, ""], object)[known]
        of = self._true.surface[self._both]
        for index, name in [*enumerate(self._terrain.surfaces), (-1, "")]:
            there = of == index
            if not self._grounds[index + 1] and not (self._face == "nearest" and there.any()):
                continue
            given = names[there]
            yield SurfaceErrors(
                name,
                int(self._grounds[index + 1]),
                int(self._knowns[index + 1]),
                Errors.of(self._errors[there]),
                int((given != "").sum()),
                int(((given == name) & (given != "")).sum()),
            )

    def _by_face(self) -> Iterator[FaceErrors]:
        kinds = self._true.kind[self._both]
        for kind in (GROUND, TOP, UNDERSIDE):
            if (kinds == kind).any():
                yield FaceErrors(kind, Errors.of(self._errors[kinds == kind]))


def _by_distance(distances: Floats, errors: Floats) -> Iterator[BandErrors]:
    edges = (0.0, *_BANDS, math.inf)
    for low, high in pairwise(edges):
        there = (distances >= low) & (distances < high)
        if there.any():
            yield BandErrors(low, high, Errors.of(errors[there]))
