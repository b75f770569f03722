"""Elevation map of a robot, fused from the readings of its sensors, on several levels of cells.

The cell of a reading on the finest level is found by thresholds, as the paper's operational
environment Q(i, j) of i = Ψ(x), j = Ψ(y); a cell of level l holds 2^l × 2^l finest cells.

Readings of a cell are fused into one height, or into a height for each patch of the cell, so that
what stands over other ground is seen as such.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import refuse_empty
from terratool.io.clouds import reader_of
from terratool.raster.grid import Grid, thresholds
from terratool.report.numbers import coordinates
from terratool.report.wording import count_of
from terratool.sensing.clouds import Cloud, read_clouds
from terratool.sensing.fusion import Batch, Fusion
from terratool.sensing.lines import map_lines
from terratool.sensing.patches import GAP, Patches, storeys_of
from terratool.sensing.sensor import Noise
from terratool.text.display import printable
from terratool.text.files import is_pipe

Floats = NDArray[np.float64]

MOST_CELLS = 1 << 24
"""Most finest cells of a map, of some 100 bytes each."""
FREE_CELLS = 1 << 20
"""Cells that a map without bounds may have, whatever its readings."""
CELLS_EACH = 100
"""Cells per reading that a larger map without bounds may have; outliers would make millions."""
MOST_LEVELS = 12
"""Most levels of a map."""
MOST_STOREYS = 16
"""Most patches of a cell that a map keeps."""
GATE = 2.5
"""Default gate: standard deviations between two heights of one surface."""
SIGMA = 0.02
"""Default standard deviation of a range, m."""
LEAST = 1e-4
"""Least standard deviation of the height of a reading, m."""
RELIEF = 0.5
"""Default standard deviation of heights within a cell, as a share of its side."""
_FAR = 1e9
"""Bound on heights and on coordinates of a sensor, m, exclusive."""
_SAME = 1e-3
"""Largest difference between a range and the distance of its rounded point, m."""


@dataclass(frozen=True, slots=True)
class MapOptions:
    """Cells and fusion parameters of a map.

    Attributes:
        cell: side of the finest cells, m, 1e-6 to 1e9.
        levels: number of levels, 1 to MOST_LEVELS; cells double in side from level to level.
        noise: noise of the ranges.
        angle: standard deviation of the direction of a ray, rad.
        gate: standard deviations between two heights of one surface.
        relief: standard deviation of heights within a cell, as a share of its side.
        storeys: most patches of a cell, 1 to MOST_STOREYS, the lowest ones; None for cells of one
            height.
        gap: distance of heights up to which readings are of one patch, m.
    """

    cell: float
    levels: int = 3
    noise: Noise = field(default_factory=lambda: Noise(sigma=SIGMA))
    angle: float = 0.0
    gate: float = GATE
    relief: float = RELIEF
    storeys: int | None = None
    gap: float = GAP

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cell) and 1e-6 <= self.cell <= 1e9):
            raise RequestError(
                f"A cell has a side of {self.cell:g} m.", "Give one from 1e-6 to 1e9 m."
            )
        if not 1 <= self.levels <= MOST_LEVELS:
            raise RequestError(
                f"A map of {self.levels} levels is none.", f"Give 1 to {MOST_LEVELS} levels."
            )
        if self.storeys is not None and not 1 <= self.storeys <= MOST_STOREYS:
            raise RequestError(
                f"A map of {self.storeys} storeys is none.", f"Give 1 to {MOST_STOREYS} storeys."
            )
        for name in ("angle", "gate", "relief", "gap"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise RequestError(
                    f"The {name} of a map is {getattr(self, name):g}.", "Give a number from 0 on."
                )

    @property
    def heights(self) -> int:
        """Most heights of a cell."""
        return 1 if self.storeys is None else self.storeys

    @property
    def coarsest(self) -> float:
        """Side of the cells of the last level, m."""
        return math.ldexp(self.cell, self.levels - 1)


@dataclass(frozen=True, slots=True)
class MapLevel:
    """Cells of one level, in arrays of (height, width), rows from the north.

    Arrays are float64 unless stated, with NaN in cells without readings.

    Attributes:
        level: number of the level, 0 for the finest.
        grid: cells as pixels of a grid.
        elevation: fused height, m; in a coarse cell the mean over its seen finest cells.
        variance: variance of the elevation by the noise of the readings, m².
        lowest, highest: least and largest height of all readings, m.
        count: int64, number of readings.
        surface: int32, index into `surfaces` that most readings of the fused height have; -1 for
            none.
        time: largest time of a reading, s; NaN where no reading has a time.
        distance: mean range of the readings, m; NaN where no reading has a range.
        seen: share of the finest cells that have readings.
        surfaces: names of surfaces.
    """

    level: int
    grid: Grid
    elevation: Floats
    variance: Floats
    lowest: Floats
    highest: Floats
    count: NDArray[np.int64]
    surface: NDArray[np.int32]
    time: Floats
    distance: Floats
    seen: Floats
    surfaces: tuple[str, ...]

    @property
    def depth(self) -> Floats:
        """From the elevation down to the lowest reading, m."""
        return np.maximum(self.elevation - self.lowest, 0.0)


def map_grid(bounds: Bounds, options: MapOptions, *, anchored: bool = True) -> Grid:
    """Grid of the finest cells of a map, in whole cells of the coarsest level.

    Args:
        bounds: west, south, east and north of the map, m.
        options: cells of the map.
        anchored: whether cell edges are multiples of the coarsest cell from (0, 0); else cells
            count from the south-west corner of the bounds.

    Raises:
        RequestError: the bounds are empty, or the cells too many or too small.
    """
    # bounds without width, as of a single reading, are allowed
    refuse_empty((bounds[0], bounds[1], bounds[2] + 1.0, bounds[3] + 1.0))
    side, parts = options.coarsest, 2 ** (options.levels - 1)
    if max(map(abs, bounds)) / side > 2**40:
        raise RequestError(
            f"Cells of {options.cell:g} m are too small for places as far off as these.",
            "Give larger cells.",
        )
    starts, counts = [], []
    for low, high in (bounds[::2], bounds[1::2]):
        if anchored:
            first, last = math.floor(low / side), math.floor(high / side)
            starts.append(first * side)
            counts.append(max(last + 1 - first, 1))
        else:
            starts.append(low)
            counts.append(max(math.ceil((high - low) / side - 1e-6), 1))
    cells = counts[0] * counts[1] * parts * parts
    if cells * options.heights > MOST_CELLS:
        storeys = "" if options.storeys is None else f", with {options.storeys} storeys each"
        raise RequestError(
            f"Cells of {options.cell:g} m over {coordinates(bounds)} are {cells:,}{storeys}.",
            "Give larger cells, or part of it by bounds; a map has up to "
            f"{MOST_CELLS // options.heights:,}.",
        )
    return Grid(starts[0], starts[1], options.cell, counts[1] * parts, counts[0] * parts)


def height_variance(cloud: Cloud, options: MapOptions, origin: Floats | None = None) -> Floats:
    """Variances of the heights of readings, (n,) float64, m².

    σ_z² = σ_r² u_z² + (r σ_a)² (1 − u_z²), with the direction u of the ray, its range r and the
    standard deviations of range and angle: the covariance of a reading in the world, along z
    (Fankhauser and others 2014, 2018; without that of the pose). Range noise affects heights less
    by a grazing ray than by a steep one.

    Args:
        cloud: readings; their own variances take precedence.
        options: noise of range and angle.
        origin: sensor position (3,) for readings without one; if None, too, rays are vertical.
    """
    if cloud.variance is not None:
        return np.maximum(np.nan_to_num(cloud.variance, nan=SIGMA**2), LEAST**2)
    origins = cloud.origin if cloud.origin is not None else origin
    down = np.ones(len(cloud.points))
    ranges = cloud.range
    if origins is not None:
        way = cloud.points - origins
        length = np.linalg.norm(way, axis=1)
        down = np.where(length > 0.0, np.abs(way[:, 2]) / np.maximum(length, 1e-300), 1.0)
        ranges = length if ranges is None else ranges
    ranges = np.zeros(len(down)) if ranges is None else np.nan_to_num(ranges)
    along, across = options.noise.deviation(ranges), ranges * options.angle
    variance = (along * down) ** 2 + (across**2) * (1.0 - down**2)
    return np.maximum(variance, LEAST**2)


@dataclass
class RobotMap:
    """Elevation map, filled batch by batch.

    Within the gate the order of batches matters only by rounding. Elsewhere a higher surface
    replaces the height of a cell, and a lower one only adds to its variance.

    Attributes:
        grid: grid of the finest cells.
        options: cells and fusion parameters.
        origin: sensor position (3,), m, for readings without one; None if unknown.
        points: number of fused readings.
        outside: number of readings beyond the cells.
    """

    grid: Grid
    options: MapOptions
    origin: Floats | None = None
    points: int = 0
    outside: int = 0

    def __post_init__(self) -> None:
        options = self.options
        slots = self.grid.width * self.grid.height if options.storeys is None else 0
        self._fused = Fusion(slots, options.gate**2, (options.relief * options.cell) ** 2)
        self._patches = None if options.storeys is None else Patches(options.gap, self._fused)

    def __repr__(self) -> str:
        sides = f"{self.grid.width:,} × {self.grid.height:,} cells of {self.grid.resolution:g} m"
        return f"<RobotMap of {sides}: {count_of(self.points, 'reading')}>"

    def __str__(self) -> str:
        return "\n".join(map(printable, map_lines(self, "the map")))

    def _repr_html_(self) -> str:
        """Lines of the map, for notebooks."""
        return f"<pre>{escape(str(self))}</pre>"

    @property
    def surfaces(self) -> list[str]:
        """Names of surfaces in order of first occurrence."""
        return [*self._fused.numbers]

    @property
    def seen(self) -> int:
        """Number of finest cells with readings."""
        if self._patches is not None:
            return len(np.unique(self._patches.cell))
        return int((self._fused.count > 0).sum())

    @property
    def patches(self) -> NDArray[np.int64] | None:
        """Numbers of finest cells with 1, 2, … patches, those left out included; None without."""
        if self._patches is None:
            return None
        _, counts = np.unique(self._patches.cell, return_counts=True)
        return np.bincount(counts)[1:]

    def add(self, cloud: Cloud) -> None:
        """Fuse a batch: its readings within each cell first, then these with the cell."""
        grid, side = self.grid, self.options.cell
        column = thresholds(cloud.points[:, 0], grid.west, side, grid.width)
        row = thresholds(cloud.points[:, 1], grid.south, side, grid.height)
        inside = (column >= 0) & (row >= 0) & (np.abs(cloud.points[:, 2]) < _FAR)
        self.outside += int((~inside).sum())
        if not inside.any():
            return
        cell = (grid.height - 1 - row) * grid.width + column
        slot, rises = cell, None
        if self._patches is not None:
            slot = np.full(len(cell), -1)
            slot[inside] = self._patches.place(cell[inside], cloud.points[inside, 2])
            rises = self._rises(cloud)
            self._fused = self._patches.fusion
        variance = height_variance(cloud, self.options, self.origin)
        batch = Batch.of(slot, inside, cloud, variance, rises)
        self.points += len(batch.group)
        self._fused.add(batch, cloud, self.origin)

    def _rises(self, cloud: Cloud) -> NDArray[np.bool_] | None:
        """Whether the ray of each reading rises; None where no place of the sensor is known."""
        origins = cloud.origin if cloud.origin is not None else self.origin
        return None if origins is None else cloud.points[:, 2] > origins[..., 2]

    def level(self, level: int) -> MapLevel:
        """Cells of a level; coarse cells sum up all their finest cells.

        Of a map of patches these are the lowest ones; `storeys` has all.
        """
        if self._patches is not None:
            return self.storeys(level)[0]
        grid, parts, fused = self._grid_of(level), 2**level, self._fused

        def blocks(values: NDArray[Any]) -> NDArray[Any]:
            return values.reshape(grid.height, parts, grid.width, parts)

        known = fused.count > 0
        seen = blocks(known).sum(axis=(1, 3))
        never = seen == 0
        some = np.maximum(seen, 1)

        def nan_where(values: NDArray[Any], where: NDArray[np.bool_] = never) -> Floats:
            return np.where(where, np.nan, values)

        ranged = blocks(fused.ranged).sum(axis=(1, 3))
        time = blocks(fused.time).max(axis=(1, 3))
        variance = blocks(np.where(known, fused.variance, 0.0)).sum(axis=(1, 3)) / some**2
        # sums of differences from one height round less
        base = float(fused.height[known][0]) if known.any() else 0.0
        height = blocks(np.where(known, fused.height - base, 0.0)).sum(axis=(1, 3)) / some + base
        return MapLevel(
            level,
            grid,
            nan_where(height),
            nan_where(variance),
            nan_where(blocks(fused.low).min(axis=(1, 3))),
            nan_where(blocks(fused.high).max(axis=(1, 3))),
            blocks(fused.count).sum(axis=(1, 3)),
            fused.likeliest(partial(self._larger, level=level), never.size).reshape(never.shape),
            nan_where(time, ~np.isfinite(time)),
            nan_where(blocks(fused.range).sum(axis=(1, 3)) / np.maximum(ranged, 1), ranged == 0),
            nan_where(seen / parts**2),
            tuple(self.surfaces),
        )

    def storeys(self, level: int) -> tuple[MapLevel, ...]:
        """Cells of a level for each storey: their lowest patches first, then what is over these.

        Patches of a coarse cell are those of all readings in it. The height of one is the mean of
        those of its highest patch in each finest cell.
        """
        if self._patches is None:
            return (self.level(level),)
        grid, fused = self._grid_of(level), self._patches.fusion
        patches = self._patches.of_level(self._larger(self._patches.cell, level))
        shape = self.options.heights, grid.height, grid.width
        label, top, seen = patches.label, patches.top, patches.seen
        first = np.searchsorted(np.sort(label), np.arange(len(seen)))
        order = np.argsort(label, kind="stable")

        def over(function: np.ufunc, values: NDArray[Any]) -> NDArray[Any]:
            out: NDArray[Any] = function.reduceat(values[order], first) if len(order) else values
            return out

        def placed(values: NDArray[Any], empty: float = math.nan) -> NDArray[Any]:
            return storeys_of(values, patches, shape, empty)

        # sums of differences from one height round less
        base = fused.height[order][first]
        height = over(np.add, np.where(top, fused.height - base[label], 0.0)) / seen + base
        variance = over(np.add, np.where(top, fused.variance, 0.0)) / seen**2
        time, ranged = over(np.maximum, fused.time), over(np.add, fused.ranged)
        ranges = np.where(ranged, over(np.add, fused.range) / np.maximum(ranged, 1), np.nan)
        bands = {
            "elevation": placed(height),
            "variance": placed(variance),
            "lowest": placed(over(np.minimum, fused.low)),
            "highest": placed(over(np.maximum, fused.high)),
            "count": placed(over(np.add, fused.count), 0),
            "surface": placed(fused.likeliest(label.__getitem__, len(seen)), -1),
            "time": placed(np.where(np.isfinite(time), time, np.nan)),
            "distance": placed(ranges),
            "seen": placed(seen / 4.0**level),
        }
        surfaces = tuple(self.surfaces)
        return tuple(
            MapLevel(
                level, grid, surfaces=surfaces, **{name: band[k] for name, band in bands.items()}
            )
            for k in range(self.options.heights)
        )

    def _grid_of(self, level: int) -> Grid:
        """Grid of the cells of a level."""
        fine, parts = self.grid, 2**level
        return replace(
            fine,
            resolution=fine.resolution * parts,
            height=fine.height // parts,
            width=fine.width // parts,
        )

    def _larger(self, cell: NDArray[np.int64], level: int) -> NDArray[np.int64]:
        """Cells of a level that hold finest cells, (n,) indices each."""
        row, column = np.divmod(cell, self.grid.width)
        return (row >> level) * (self.grid.width >> level) + (column >> level)


def map_scans(
    paths: Sequence[str | Path],
    options: MapOptions,
    bounds: Bounds | None = None,
    origin: Sequence[float] | None = None,
    progress: Callable[[str], object] = lambda _: None,
) -> RobotMap:
    """Map scans in files, fused in their order.

    Args:
        paths: files, as for `terratool.sensing.clouds.read_clouds`.
        options: cells and fusion parameters.
        bounds: west, south, east and north of the map, m; those of all readings if None, which are
            then read twice.
        origin: x, y and z of the sensor, m, for scans without it; None if unknown.
        progress: called with a description of each step.

    Raises:
        RequestError: a suffix is of no format, points are in sensor axes, there are no readings or
            too many cells, or, without bounds, a file is a pipe or cells far outnumber readings.
        ReadError: a file cannot be read.
    """
    for path in paths:
        reader_of(Path(path))
        if bounds is None and is_pipe(path):
            raise RequestError(
                f"{path}: is a pipe, and is read twice to find where its points are.",
                "Say by bounds what the map holds, or save it as a file.",
            )
    if origin is not None and not all(abs(value) < _FAR for value in origin):
        raise RequestError(
            f"The origin {coordinates(origin)} is nowhere.",
            f"Give x, y and z below {_FAR:g} m.",
        )
    if bounds is None:
        around, readings = _around(paths, progress)
        grid = map_grid(around, options)
        _refuse_empty_cells(grid, readings, around)
    else:
        refuse_empty(bounds)
        grid = map_grid(bounds, options, anchored=False)
    place = None if origin is None else np.array(origin, np.float64)
    robot_map = RobotMap(grid, options, place)
    for path in paths:
        for cloud in read_clouds(path):
            progress(f"fusing {Path(path).name}, {robot_map.points:,} points")
            if place is None and in_sensor_axes(cloud):
                raise RequestError(
                    f"{path}: its points are as far from 0 as they were from the sensor.",
                    "Scan with --frame world; if the sensor was at 0, say --sensor-at 0 0 0.",
                )
            robot_map.add(cloud)
    if not robot_map.points:
        raise RequestError(
            "No reading lies within the bounds." if bounds else "The scans hold no readings.",
            "Give other bounds." if bounds else "Give scans that met something.",
        )
    return robot_map


def in_sensor_axes(cloud: Cloud) -> bool:
    """Return whether points are in sensor axes: all are their range away from (0, 0, 0).

    A sensor known to have been at (0, 0, 0) is excepted; of terratool's files only .npz hold the
    position of the sensor, and most do not state their axes.
    """
    if cloud.range is None:
        return False
    known = np.isfinite(cloud.range)
    far = np.linalg.norm(cloud.points[known], axis=1)
    same = np.abs(far - cloud.range[known]) <= _SAME
    elsewhere = cloud.origin is None or bool(cloud.origin.any())
    return bool(known.any() and same.all()) and elsewhere


def _refuse_empty_cells(grid: Grid, readings: int, bounds: Bounds) -> None:
    """Refuse a grid with far more cells than readings.

    Raises:
        RequestError: the cells exceed FREE_CELLS and CELLS_EACH per reading.
    """
    cells = grid.width * grid.height
    if cells > max(FREE_CELLS, CELLS_EACH * readings):
        around = coordinates(bounds)
        raise RequestError(
            f"{readings:,} readings are too few for {cells:,} cells of {grid.resolution:g} m.",
            f"Give larger cells, or say what the map holds by bounds: {around} is all of it.",
        )


def _around(paths: Sequence[str | Path], progress: Callable[[str], object]) -> tuple[Bounds, int]:
    """Bounds of all readings, m, and their number."""
    low, high, count = np.full(2, np.inf), np.full(2, -np.inf), 0
    for path in paths:
        progress(f"looking where the points of {Path(path).name} are")
        for cloud in read_clouds(path):
            low = np.minimum(low, cloud.points[:, :2].min(axis=0))
            high = np.maximum(high, cloud.points[:, :2].max(axis=0))
            count += len(cloud.points)
    if not np.isfinite(low).all():
        raise RequestError("The scans hold no readings.", "Give scans that met something.")
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1])), count
