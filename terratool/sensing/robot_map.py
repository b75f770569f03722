"""Elevation map of a robot, fused from the readings of its sensors, on several levels of cells.

The cell of a reading on the finest level is found by thresholds, as the paper's operational
environment Q(i, j) of i = Ψ(x), j = Ψ(y); a cell of level l holds 2^l × 2^l finest cells.

Heights are fused by the Kalman filter of elevation mapping: Fankhauser, Bloesch, Gehring, Hutter
and Siegwart, Robot-Centric Elevation Mapping with Uncertainty Estimates, CLAWAR 2014; Fankhauser,
Bloesch and Hutter, Probabilistic Terrain Mapping for Mobile Robots with Uncertain Localization,
IEEE RA-L 3(4), 2018. Two heights belong to one surface if their Mahalanobis distance is within a
gate; else the higher one is the ground. github.com/ANYbotics/elevation_mapping does so within a
scan, but keeps the old height where a later scan differs; here the higher one stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import refuse_empty
from terratool.io.clouds import reader_of
from terratool.io.points import MOST_NAMES
from terratool.raster.grid import Grid, thresholds
from terratool.report.numbers import coordinates
from terratool.report.wording import count_of
from terratool.sensing.clouds import Cloud, read_clouds
from terratool.sensing.lines import map_lines
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
GATE = 2.5
"""Default gate: standard deviations between two heights of one surface."""
SIGMA = 0.02
"""Default standard deviation of a range, m."""
LEAST = 1e-4
"""Least standard deviation of the height of a reading, m."""
RELIEF = 0.5
"""Default standard deviation of heights within a cell, as a share of its side."""
_MULTI_HEIGHT = 0.003
"""Standard deviation that a lower reading adds to a cell, m, as in elevation_mapping."""
_ROUNDS = 4
"""Iterations of the search for the top surface of a cell in a batch."""
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
    """

    cell: float
    levels: int = 3
    noise: Noise = field(default_factory=lambda: Noise(sigma=SIGMA))
    angle: float = 0.0
    gate: float = GATE
    relief: float = RELIEF

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cell) and 1e-6 <= self.cell <= 1e9):
            raise RequestError(
                f"A cell has a side of {self.cell:g} m.", "Give one from 1e-6 to 1e9 m."
            )
        if not 1 <= self.levels <= MOST_LEVELS:
            raise RequestError(
                f"A map of {self.levels} levels is none.", f"Give 1 to {MOST_LEVELS} levels."
            )
        for name in ("angle", "gate", "relief"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise RequestError(
                    f"The {name} of a map is {getattr(self, name):g}.", "Give a number from 0 on."
                )

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
    if cells > MOST_CELLS:
        raise RequestError(
            f"Cells of {options.cell:g} m over {coordinates(bounds)} are {cells:,}.",
            f"Give larger cells, or part of it by bounds; a map has up to {MOST_CELLS:,}.",
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
        cells = self.grid.width * self.grid.height
        self._height, self._variance = np.zeros(cells), np.full(cells, np.inf)
        self._low, self._high = np.full(cells, np.inf), np.full(cells, -np.inf)
        self._count, self._ranged = np.zeros(cells, np.int64), np.zeros(cells, np.int64)
        self._time, self._range = np.full(cells, -np.inf), np.zeros(cells)
        self._numbers: dict[str, int] = {}
        # votes by cell and surface: keys cell << 20 | surface, ascending
        self._voted, self._votes = np.zeros(0, np.int64), np.zeros(0, np.int64)

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
        return [*self._numbers]

    @property
    def seen(self) -> int:
        """Number of finest cells with readings."""
        return int((self._count > 0).sum())

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
        batch = _Batch.of(cell, inside, cloud, height_variance(cloud, self.options, self.origin))
        self.points += len(batch.group)
        self._note(batch, cloud)
        tau = (self.options.relief * side) ** 2
        mean, variance, member = batch.top(self.options.gate**2, tau)
        kept, replaced = self._fuse(batch.cells, mean, variance, tau)
        if cloud.surface is not None:
            self._vote(batch, cloud, member & kept[batch.group], batch.cells[replaced])

    def _note(self, batch: _Batch, cloud: Cloud) -> None:
        """Update least and largest height, count, time and range of the cells of a batch."""
        cells = batch.cells
        self._low[cells] = np.minimum(self._low[cells], batch.reduce(np.minimum, batch.heights))
        self._high[cells] = np.maximum(self._high[cells], batch.reduce(np.maximum, batch.heights))
        self._count[cells] += batch.sizes
        if cloud.time is not None:
            time = cloud.time[batch.order]
            time = np.where(np.isfinite(time), time, -np.inf)
            self._time[cells] = np.maximum(self._time[cells], batch.reduce(np.maximum, time))
        ranges, origins = cloud.range, cloud.origin if cloud.origin is not None else self.origin
        if ranges is None and origins is not None:
            ranges = np.linalg.norm(cloud.points - origins, axis=1)
        if ranges is not None:
            ranges = ranges[batch.order]
            known = np.isfinite(ranges)
            self._range[cells] += batch.reduce(np.add, np.where(known, ranges, 0.0))
            self._ranged[cells] += batch.reduce(np.add, known.astype(np.int64))

    def _fuse(
        self, cells: NDArray[np.int64], mean: Floats, variance: Floats, tau: float
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Update cells by the Kalman filter.

        Returns:
            Masks of the cells that took the batch, and of those whose height it replaced.
        """
        height, before = self._height[cells], self._variance[cells]
        known = np.isfinite(before)
        before = np.where(known, before, 0.0)
        off = mean - height
        near = known & (off**2 <= self.options.gate**2 * (before + variance + tau))
        taken = ~known | (~near & (off > 0.0))
        lower = ~near & ~taken
        gain = np.where(near, before, 0.0) / (before + variance)
        self._height[cells] = np.where(taken, mean, height + gain * off)
        after = (1.0 - gain) * before + np.where(lower, _MULTI_HEIGHT**2, 0.0)
        self._variance[cells] = np.where(taken, variance, after)
        return ~lower, taken & known

    def _vote(
        self, batch: _Batch, cloud: Cloud, member: NDArray[np.bool_], replaced: NDArray[np.int64]
    ) -> None:
        """Count the surfaces of readings that `member` marks; `replaced` cells lose their votes."""
        assert cloud.surface is not None
        for name in cloud.surfaces:
            self._numbers.setdefault(name, len(self._numbers))
        if len(self._numbers) > MOST_NAMES:
            raise RequestError(
                f"The scans name more than {MOST_NAMES:,} surfaces.",
                "Rename the column surface, if it holds something else.",
            )
        index = np.array([self._numbers[name] for name in cloud.surfaces], np.int64)
        surface = cloud.surface[batch.order]
        member = member & (surface >= 0)
        keys = batch.cells[batch.group[member]] << 20 | index[surface[member]]
        kept = slice(None) if not len(replaced) else ~np.isin(self._voted >> 20, replaced)
        found, counts = np.unique(keys, return_counts=True)
        merged = np.concatenate([self._voted[kept], found])
        self._voted, at = np.unique(merged, return_inverse=True)
        votes = np.concatenate([self._votes[kept], counts])
        self._votes = np.bincount(at, votes, len(self._voted)).astype(np.int64)

    def level(self, level: int) -> MapLevel:
        """Cells of a level; coarse cells sum up all their finest cells."""
        fine, parts = self.grid, 2**level
        grid = replace(
            fine,
            resolution=fine.resolution * parts,
            height=fine.height // parts,
            width=fine.width // parts,
        )

        def blocks(values: NDArray[Any]) -> NDArray[Any]:
            return values.reshape(grid.height, parts, grid.width, parts)

        known = self._count > 0
        seen = blocks(known).sum(axis=(1, 3))
        never = seen == 0
        some = np.maximum(seen, 1)

        def nan_where(values: NDArray[Any], where: NDArray[np.bool_] = never) -> Floats:
            return np.where(where, np.nan, values)

        ranged = blocks(self._ranged).sum(axis=(1, 3))
        time = blocks(self._time).max(axis=(1, 3))
        variance = blocks(np.where(known, self._variance, 0.0)).sum(axis=(1, 3)) / some**2
        # sums of differences from one height round less
        base = float(self._height[known][0]) if known.any() else 0.0
        height = blocks(np.where(known, self._height - base, 0.0)).sum(axis=(1, 3)) / some + base
        return MapLevel(
            level,
            grid,
            nan_where(height),
            nan_where(variance),
            nan_where(blocks(self._low).min(axis=(1, 3))),
            nan_where(blocks(self._high).max(axis=(1, 3))),
            blocks(self._count).sum(axis=(1, 3)),
            self._likeliest(grid, parts),
            nan_where(time, ~np.isfinite(time)),
            nan_where(blocks(self._range).sum(axis=(1, 3)) / np.maximum(ranged, 1), ranged == 0),
            nan_where(seen / parts**2),
            tuple(self.surfaces),
        )

    def _likeliest(self, grid: Grid, parts: int) -> NDArray[np.int32]:
        """Surface with most votes in each cell, -1 for none; of equals the first to occur."""
        fine, surface = self._voted >> 20, self._voted & (1 << 20) - 1
        row, column = np.divmod(fine, self.grid.width)
        cell = (row // parts) * grid.width + column // parts
        keys, at = np.unique(cell << 20 | surface, return_inverse=True)
        votes = np.bincount(at, self._votes, len(keys)).astype(np.int64)
        order = np.lexsort((-(keys & (1 << 20) - 1), votes, keys >> 20))
        out = np.full(grid.width * grid.height, -1, np.int32)
        out[keys[order] >> 20] = keys[order] & (1 << 20) - 1  # of several the last is kept
        return out.reshape(grid.height, grid.width)


@dataclass(frozen=True, slots=True)
class _Batch:
    """Readings of a cloud sorted by cell.

    Attributes:
        order: (n,) index of each reading in the cloud.
        cells: (m,) indices of the cells, ascending.
        starts: (m,) index of the first reading of each cell.
        sizes: (m,) number of readings of each cell.
        group: (n,) index into `cells` of each reading.
        heights: (n,) heights of the readings, m.
        variances: (n,) variances of the heights, m².
    """

    order: NDArray[np.int64]
    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    group: NDArray[np.int64]
    heights: Floats
    variances: Floats

    @classmethod
    def of(
        cls, cell: NDArray[np.int64], inside: NDArray[np.bool_], cloud: Cloud, variance: Floats
    ) -> _Batch:
        """Sort the readings that `inside` marks by their cells."""
        which = np.flatnonzero(inside)
        order = which[np.argsort(cell[which], kind="stable")]
        in_order = cell[order]
        starts = np.flatnonzero(np.concatenate([[True], in_order[1:] != in_order[:-1]]))
        sizes = np.diff(np.append(starts, len(order)))
        group = np.repeat(np.arange(len(starts)), sizes)
        heights, variances = cloud.points[order, 2], variance[order]
        return cls(order, in_order[starts], starts, sizes, group, heights, variances)

    def reduce(self, function: np.ufunc, values: NDArray[Any]) -> NDArray[Any]:
        """Reduce values, (n,), over the readings of each cell, (m,)."""
        out: NDArray[Any] = function.reduceat(values, self.starts)
        return out

    def top(self, gate: float, tau: float) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Mean and variance of the highest surface of each cell, and which readings belong to it.

        From the highest reading on, readings within the gate of the mean, or above, make the next
        mean; a few iterations find the middle of a noisy surface.

        Args:
            gate: square of the gate, in standard deviations.
            tau: variance of heights within a cell by relief, m².
        """
        highest = self.reduce(np.maximum, self.heights)
        below = self.heights - highest[self.group]
        mean = np.zeros(len(self.cells))
        variance = self.reduce(np.maximum, np.where(below == 0.0, self.variances, 0.0))
        weights = 1.0 / self.variances
        member = np.ones(len(below), bool)
        for _ in range(_ROUNDS):
            off = below - mean[self.group]
            limit = gate * (self.variances + variance[self.group] + tau)
            member = (off >= 0.0) | (off * off <= limit)
            information = self.reduce(np.add, np.where(member, weights, 0.0))
            mean = self.reduce(np.add, np.where(member, weights * below, 0.0)) / information
            variance = 1.0 / information
        return highest + mean, variance, member


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
