"""A path as samples of a survey: places, headings, and the cost of driving.

Between two samples lies a leg: a stretch that is driven, or a turn on the spot from one heading to
the next.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.report.numbers import coordinates
from terratool.traversability.results import (
    Extreme,
    Location,
    Reason,
    RouteProfile,
    Survey,
    Verdict,
)
from terratool.traversability.route.drifting import drift_along
from terratool.traversability.route.graph import (
    cells_between,
    drivable,
    heading_offsets,
    joules_per_metre,
    seconds_per_metre,
)
from terratool.traversability.turning import Turning
from terratool.traversability.vehicle import Vehicle

_PER_CELL = 2
"""Samples per side of a cell along a straight leg."""


@dataclass(frozen=True, slots=True)
class Path:
    """Samples along a way, (n,) each.

    Attributes:
        x, y: world coordinates, m.
        height: height of the ground, m; NaN where there is none.
        row, column: cell of the survey, int64.
        heading: index of the vehicle's heading, int64.
        judged: index of the heading by which a sample is judged, int64: the opposite heading where
            the vehicle has backed up to the sample.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    height: NDArray[np.float64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    heading: NDArray[np.int64]
    judged: NDArray[np.int64]

    @property
    def leg_lengths(self) -> NDArray[np.float64]:
        """Length of each leg seen from above, (n − 1,); 0 for turns."""
        return np.hypot(np.diff(self.x), np.diff(self.y))

    def values_of(self, plane: NDArray[Any]) -> NDArray[Any]:
        """Values of a plane of the survey, (headings, height, width), at the samples, (n,)."""
        return np.asarray(plane[self.judged, self.row, self.column])


@dataclass(frozen=True, slots=True)
class DrivingCost:
    """The cost of driving a path.

    Attributes:
        length: length over ground, m.
        time: driving time, s.
        energy: energy of the wheels and of the power drawn all the time, J.
        turning: part of the energy that turns on the spot take, J.
    """

    length: float
    time: float
    energy: float
    turning: float


def graph_path(states: NDArray[np.int64], survey: Survey) -> Path:
    """The samples of states, (n, 3), in order, and of the cells that moves pass.

    Where a move passes between two cells, a cell that cannot be driven is the sample, if any.
    """
    towards = heading_offsets(survey.headings)

    def is_drivable(heading: int, cell: tuple[int, int]) -> bool:
        return bool(drivable(survey, np.s_[cell[0], cell[1]])[heading])

    places: list[tuple[float, float]] = []
    samples: list[tuple[int, int, int, int]] = []
    last = (0, 0)
    for heading, row, column in states.tolist():
        move = (row - last[0], column - last[1]) if samples else (0, 0)
        backing = move not in ((0, 0), towards[heading])
        judged = (heading + survey.headings // 2 * backing) % survey.headings
        passed = cells_between(move)
        for step, (near, other) in enumerate(passed, 1):
            share = step / (len(passed) + 1)
            places.append((last[0] + share * move[0], last[1] + share * move[1]))
            second = (last[0] + other[0], last[1] + other[1])
            cell = (last[0] + near[0], last[1] + near[1]) if is_drivable(judged, second) else second
            samples.append((*cell, heading, judged))
        places.append((row, column))
        samples.append((row, column, heading, judged))
        last = (row, column)
    exact = np.array(places, np.float64)
    rows, columns, headings, judgements = np.array(samples, np.int64).T
    grid = survey.grid
    x = grid.west + (exact[:, 1] + 0.5) * grid.resolution
    y = grid.bounds[3] - (exact[:, 0] + 0.5) * grid.resolution
    height = survey.heights[rows, columns].astype(np.float64)
    return Path(x, y, height, rows, columns, headings, judgements)


def straight_path(terrain: Terrain, survey: Survey, points: NDArray[np.float64]) -> Path:
    """The samples of straight legs between points, (n, 2), none of which repeats the one before.

    A leg has the heading of the survey that is nearest to its direction. Between two legs the
    vehicle turns on the spot, the shorter way round.
    """
    east, north = np.diff(points, axis=0).T
    count = survey.headings
    towards = np.round(np.arctan2(east, north) * (count / (2.0 * math.pi))).astype(np.int64) % count
    samples: list[tuple[float, float, int]] = []
    facing = int(towards[0])
    for n, heading in enumerate(towards.tolist()):
        (x, y), (to_x, to_y) = points[n].tolist(), points[n + 1].tolist()
        samples.append((x, y, facing))
        side = 1 if (heading - facing) % count < count / 2 else -1
        while facing != heading:
            facing = (facing + side) % count
            samples.append((x, y, facing))
        steps = math.ceil(_PER_CELL * math.hypot(to_x - x, to_y - y) / survey.grid.resolution)
        for step in range(1, steps):
            share = step / steps
            samples.append((x + share * (to_x - x), y + share * (to_y - y), facing))
    samples.append((*points[-1].tolist(), facing))
    x, y, headings = (np.array(part) for part in zip(*samples, strict=True))
    row, column = cells_of(survey.grid, x, y)
    return Path(x, y, terrain.height(x, y), row, column, headings, headings)


def reversed_path(path: Path, headings: int) -> Path:
    """A path from its end to its beginning, judged by the opposite headings."""
    turned = (path.judged[::-1] + headings // 2) % headings
    # the first sample of a leg is judged as the leg that ends there, not as that which begins
    judged = np.r_[turned[:1], turned[:-1]]
    return Path(
        path.x[::-1], path.y[::-1], path.height[::-1], path.row[::-1], path.column[::-1],
        judged, judged,
    )  # fmt: skip


def cell_of(grid: Grid, x: float, y: float) -> tuple[int, int]:
    """Row and column of the cell that holds a point; beyond the edges, the nearest cell's."""
    row, column = cells_of(grid, x, y)
    return int(row), int(column)


def cells_of(grid: Grid, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rows and columns, int64, of the cells that hold points; of the nearest beyond the edges."""
    column = np.floor((np.asarray(x) - grid.west) / grid.resolution)
    row = np.floor((grid.bounds[3] - np.asarray(y)) / grid.resolution)
    return (
        np.clip(row, 0, grid.height - 1).astype(np.int64),
        np.clip(column, 0, grid.width - 1).astype(np.int64),
    )


def driving_cost(
    path: Path, survey: Survey, vehicle: Vehicle, turns: Sequence[Turning]
) -> DrivingCost:
    """The cost of driving a path.

    One half of each leg is driven as at its beginning, the other as at its end. The length of a leg
    over ground takes in the heights of its ends. A turn takes the work and the time of
    `turn_on_spot` on the surface under the vehicle's middle, `turns` by id, as on the level.
    """
    run = path.leg_lengths
    rise = np.nan_to_num(np.diff(path.height))
    length = np.where(run > 0.0, np.hypot(run, rise), 0.0)

    def values_at_ends(
        plane: NDArray[np.float32],
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        begin = plane[path.judged[1:], path.row[:-1], path.column[:-1]]
        return begin[driven], path.values_of(plane)[1:][driven]

    driven = run > 0.0
    way = 0.5 * length[driven]
    seconds = [seconds_per_metre(slip, vehicle) for slip in values_at_ends(survey.slip)]
    joules = [joules_per_metre(energy) for energy in values_at_ends(survey.energy)]
    time = float((way * (seconds[0] + seconds[1])).sum())
    energy = float((way * (joules[0] + joules[1])).sum()) + vehicle.power * time
    on = survey.surfaces[path.row[1:], path.column[1:]][~driven]
    angle = 2.0 * math.pi / survey.headings
    turning_time = angle * float(sum(turns[surface].run for surface in on)) / vehicle.speed
    turning = angle * float(sum(turns[surface].work for surface in on))
    turning += vehicle.power * turning_time
    return DrivingCost(float(length.sum()), time + turning_time, energy + turning, turning)


def profile(path: Path, survey: Survey, terrain: Terrain) -> RouteProfile:
    """The profile of a path for reports."""
    names = ("", *terrain.surfaces)
    facing = path.heading, path.row, path.column

    def uphill(judged: NDArray[np.int64], cells: slice) -> NDArray[np.float64]:
        """Crab angles to the left; a roll above 0 has the left side up."""
        at = judged, path.row[cells], path.column[cells]
        return np.copysign(survey.crab[at], survey.roll[at]).astype(np.float64)

    crab = uphill(path.judged, np.s_[:])
    begins = uphill(path.judged[1:], np.s_[:-1])
    return RouteProfile(
        path.x,
        path.y,
        path.heading.astype(np.float64) * (360.0 / survey.headings),
        np.r_[0.0, np.cumsum(path.leg_lengths)],
        path.height,
        path.values_of(survey.sinkage).astype(np.float64),
        survey.pitch[facing].astype(np.float64),
        survey.roll[facing].astype(np.float64),
        path.values_of(survey.slip).astype(np.float64),
        path.values_of(survey.utilisation).astype(np.float64),
        path.values_of(survey.verdict),
        path.values_of(survey.reason),
        tuple(names[i] for i in survey.surfaces[path.row, path.column].tolist()),
        tuple(
            terrain.pointer(element) or "" if element >= 0 else ""
            for element in terrain.sample(path.x, path.y).element.tolist()
        ),
        crab,
        drift_along(path.x, path.y, begins, crab[1:]),
    )


def find_extreme(
    terrain: Terrain, values: NDArray[np.float64], profile: RouteProfile, *, of_size: bool = False
) -> Extreme | None:
    """The largest value of a measure, or of its size, along a profile; None where all is NaN."""
    if np.all(np.isnan(values)):
        return None
    n = int(np.nanargmax(np.abs(values) if of_size else values))
    place = location_at(terrain, float(profile.x[n]), float(profile.y[n]))
    return Extreme(float(values[n]), place, Reason(int(profile.reason[n])))


def worst_verdict(verdicts: NDArray[np.uint8]) -> Verdict:
    """The verdict of a whole way: no-go if any is, else unknown if any is, else the worst."""
    if np.any(verdicts == Verdict.NO_GO):
        return Verdict.NO_GO
    return Verdict(int(verdicts.max())) if np.all(verdicts) else Verdict.UNKNOWN


def location_at(terrain: Terrain, x: float, y: float) -> Location:
    """The height, surface and element at a point."""
    found = terrain.sample(x, y)
    height, surface = float(found.height), int(found.surface)
    return Location(
        x,
        y,
        None if math.isnan(height) else height,
        terrain.surfaces[surface] if surface >= 0 else "",
        terrain.pointer(int(found.element)) or "",
    )


def check_inside(what: str, place: tuple[float, float], parts: Mapping[str, Bounds]) -> None:
    """Refuse a place outside the terrain, or outside a part of it.

    Args:
        what: name of the place, for people.
        place: x and y, m.
        parts: west, south, east and north of the terrain and of the part, m, by their names for
            people.

    Raises:
        RequestError: the place lies outside one of them, or is no number.
    """
    x, y = place
    for name, (west, south, east, north) in parts.items():
        if not (west <= x <= east and south <= y <= north):
            sides = coordinates((west, south, east, north))
            raise RequestError(
                f"{what}, {coordinates(place)}, lies outside {name}.",
                f"Give x and y within west south east north {sides}.",
            )
