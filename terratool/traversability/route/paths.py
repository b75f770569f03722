"""A path as samples of a survey: places, headings, and the cost of driving.

Between two samples lies a leg: a stretch that is driven, or a turn on the spot from one heading to
the next.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.report import numbers
from terratool.report.numbers import coordinates
from terratool.traversability.layers import sample_near, top_near
from terratool.traversability.map_results import Survey, cells_of
from terratool.traversability.route.drifting import drift_along
from terratool.traversability.route.graph import (
    cells_between,
    drivable,
    heading_offsets,
    joules_per_metre,
    seconds_per_metre,
)
from terratool.traversability.route.results import Extreme, Location, RouteProfile
from terratool.traversability.stopping import deceleration, speeds, stopping_distance
from terratool.traversability.turning import Turning
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import RANKS, Reason, Verdict

_PER_CELL = 2
"""Samples per side of a cell along a straight leg."""
_SAME = 1e-9
"""Largest difference of directions that are the same, degrees."""


@dataclass(frozen=True, slots=True)
class Path:
    """Samples along a way, (n,) each.

    Attributes:
        x, y: world coordinates, m.
        height: height of the ground, m; NaN where there is none.
        row, column: cell of the survey, int64.
        heading: index of the survey's heading nearest to where the vehicle looks, int64.
        judged: index of the heading by which a sample is judged, int64: the worse of those beside
            the direction of the leg to it; opposite ones where the vehicle has backed up to it.
        direction: where the vehicle looks, degrees clockwise from north, below 360.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    height: NDArray[np.float64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    heading: NDArray[np.int64]
    judged: NDArray[np.int64]
    direction: NDArray[np.float64]

    @property
    def leg_lengths(self) -> NDArray[np.float64]:
        """Length of each leg seen from above, (n − 1,); 0 for turns."""
        return np.hypot(np.diff(self.x), np.diff(self.y))

    def values_of(self, plane: NDArray[Any]) -> NDArray[Any]:
        """Values of a plane of the survey, (headings, height, width), at the samples, (n,)."""
        return np.asarray(plane[self.judged, self.row, self.column])

    def is_drivable(self, survey: Survey) -> bool:
        """Whether all samples are go or caution, and have ground."""
        states = self.judged, self.row, self.column
        return bool(_can(survey, *states).all())


@dataclass(frozen=True, slots=True)
class DrivingCost:
    """The cost of driving a path.

    Attributes:
        length: length over ground, m.
        time: driving time, s.
        energy: energy of the wheels and of the power drawn all the time, J.
        turning: part of the energy that turns on the spot take, J.
        times: (n,) time since the start at each sample, s.
        energies: (n,) energy since the start at each sample, J.
        speed: (n,) speed of the treads at each sample, m/s, as of `stopping.speeds`.
        stopping: (n,) distance to stop from the vehicle's speed at each sample, m; NaN on unknown
            soil.
    """

    length: float
    time: float
    energy: float
    turning: float
    times: NDArray[np.float64]
    energies: NDArray[np.float64]
    speed: NDArray[np.float64]
    stopping: NDArray[np.float64]


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
    y = grid.bounds[3] - (survey.flat_rows(exact[:, 0]) + 0.5) * grid.resolution
    height = survey.heights[rows, columns].astype(np.float64)
    direction = headings * (360.0 / survey.headings)
    return Path(x, y, height, rows, columns, headings, judgements, direction)


class Leg(NamedTuple):
    """A straight leg from its first sample on, whose end is the first sample of the next one.

    Attributes:
        x, y: world coordinates of the samples, (n,) m.
        cells: (n, k, 2) int64 rows and columns of the k cells that each sample is judged by.
        towards: direction in which the leg is driven, degrees clockwise from north.
        sign: 1 where it is driven ahead, −1 backwards.
        side: 1 where the vehicle turns clockwise before the leg, −1 anticlockwise.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    cells: NDArray[np.int64]
    towards: float
    sign: int = 1
    side: int = 1

    @property
    def facing(self) -> float:
        """Where the vehicle looks, degrees clockwise from north, below 360."""
        return self.towards if self.sign > 0 else (self.towards + 180.0) % 360.0


def _snapped(direction: float, headings: int) -> float:
    """A direction, degrees from 0 to below 360, that is a heading's own where it is as good as."""
    step = 360.0 / headings
    near = round(direction / step) * step
    return (near if abs(direction - near) < _SAME else direction) % 360.0


@lru_cache(maxsize=16)
def _move_directions(headings: int) -> NDArray[np.float64]:
    """Directions of the moves of headings, (headings,) degrees clockwise from north."""
    down, right = np.array(heading_offsets(headings)).T
    return np.asarray(np.degrees(np.arctan2(right, -down)) % 360.0)


def headings_beside(direction: float, headings: int) -> tuple[int, int]:
    """The headings of a survey that a direction, degrees, is judged by.

    One heading, twice, for its own direction and for that of its move; else both neighbours.
    """
    at = (direction * headings / 360.0) % headings
    moves = np.abs((_move_directions(headings) - direction + 180.0) % 360.0 - 180.0)
    if moves.min() < _SAME:
        return (int(moves.argmin()),) * 2
    if abs(at - round(at)) < 1e-9:
        return (round(at) % headings,) * 2
    return int(at), (int(at) + 1) % headings


def legs_path(legs: Sequence[Leg], survey: Survey) -> Path:
    """The samples of straight legs, and of the turns on the spot between them; without heights.

    A turn has a sample at each heading of the survey that it passes. Where several headings or
    cells judge a sample, it has the worst of them.
    """
    count = survey.headings
    step = 360.0 / count
    parts: list[NDArray[np.float64]] = []
    for n, leg in enumerate(legs):
        beside = headings_beside(leg.towards, count)
        cells, wide = leg.cells, leg.cells.shape[1]
        options = np.empty((len(leg.x), 2 * wide, 3), np.int64)
        options[:, :, 0] = np.repeat(beside, wide)
        options[:, :, 1:] = np.tile(cells, (1, 2, 1))
        chosen = worst_of(options, survey)
        nearest = round(leg.facing / step) % count
        if n:
            cell = parts[-1][-1, 2:4]
            place = leg.x[0], leg.y[0], *cell
            turn = _turned(legs[n - 1].facing, leg.facing, leg.side, step)
            for at in turn:
                heading = round(at / step) % count
                parts.append(np.array([[*place, heading, heading, at]]))
            own = np.array(headings_beside(leg.facing, count))
            there = np.column_stack([own, np.broadcast_to(cell, (2, 2)).astype(np.int64)])
            judged = worst_of(there[None], survey)[0, 0]
            if legs[n - 1].facing != leg.facing:
                parts.append(np.array([[*place, nearest, judged, leg.facing]]))
        first = 1 if n else 0
        facing = np.full(len(leg.x), leg.facing)
        rows = [leg.x, leg.y, chosen[:, 1], chosen[:, 2], np.full(len(leg.x), nearest),
                chosen[:, 0], facing]  # fmt: skip
        parts.append(np.column_stack(rows)[first:])
    x, y, row, column, heading, judged, direction = np.concatenate(parts).T
    return Path(
        x, y, np.full_like(x, np.nan), row.astype(np.int64), column.astype(np.int64),
        heading.astype(np.int64), judged.astype(np.int64), direction,
    )  # fmt: skip


def _turned(before: float, after: float, side: int, step: float) -> list[float]:
    """Directions of headings passed by a turn to a side, degrees, without its ends."""
    if before == after:
        return []
    angle = (after - before) * side % 360.0
    first = (
        math.floor(before / step + _SAME) + 1 if side > 0 else math.ceil(before / step - _SAME) - 1
    )
    found = []
    while abs(first * step - before) < angle - _SAME:
        found.append(first * step % 360.0)
        first += side
    return found


def _can(
    survey: Survey, heading: NDArray[np.int64], row: NDArray[np.int64], column: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether states can be driven, in their shape, as `graph.drivable` has it."""
    verdict = survey.verdict[heading, row, column]
    can = (verdict == Verdict.GO) | (verdict == Verdict.CAUTION)
    ground = np.isfinite(survey.heights[row, column])
    return np.asarray(can & ground & np.isfinite(survey.energy[heading, row, column]))


def worst_of(options: NDArray[np.int64], survey: Survey) -> NDArray[np.int64]:
    """The worst of states, (n, k, 3) heading, row and column: (n, 3).

    It is one that cannot be driven, or has the worst verdict, or of equal ones the least margin.
    """
    heading, row, column = options.transpose(2, 0, 1)
    verdict = survey.verdict[heading, row, column]
    can = _can(survey, heading, row, column)
    used = np.clip(np.nan_to_num(survey.utilisation[heading, row, column]), 0.0, 10.0)
    score = np.where(can, 0.0, 1e4) + 100.0 * RANKS[verdict] + used
    return np.asarray(options[np.arange(len(options)), score.argmax(axis=1)])


def pulled_path(corners: NDArray[np.int64], survey: Survey) -> Path:
    """The samples of a way that is pulled straight.

    Samples lie at each step along the longer axis of a leg; where a leg passes between two cells
    both count, and the height lies between theirs.

    Args:
        corners: (n, 4) int64, as `kernels.pull` returns them, n ≥ 2.
        survey: the survey of which these are cells.
    """
    grid, legs, heights = survey.grid, [], []
    for n, (begin, end) in enumerate(pairwise(corners.tolist())):
        (row, column, _, side), (to_row, to_column, sign, _) = begin, end
        down, right = to_row - row, to_column - column
        steps = max(abs(down), abs(right))
        step = np.arange(steps + 1)
        # in whole numbers, as the kernel does it
        rows, rest_down = np.divmod(down * step, steps)
        columns, rest_right = np.divmod(right * step, steps)
        near = np.stack([row + rows, column + columns], axis=-1)
        other = near + np.stack([rest_down > 0, rest_right > 0], axis=-1)
        share = np.maximum(rest_down, rest_right) / steps
        low, high = (survey.heights[tuple(at.T)].astype(np.float64) for at in (near, other))
        x = grid.west + (column + right * step / steps + 0.5) * grid.resolution
        y = grid.bounds[3] - (survey.flat_rows(row + down * step / steps) + 0.5) * grid.resolution
        towards = _snapped(math.degrees(math.atan2(right, -down)) % 360.0, survey.headings)
        cells = np.stack([near, other], axis=1)
        legs.append(Leg(x, y, cells, towards, sign, side))
        between = np.where(np.isnan(high - low), low, low + share * (high - low))
        heights.append(between[1 if n else 0 :])
    path = legs_path(legs, survey)
    # turns have the height of where they are made
    moved = np.r_[True, path.leg_lengths > 0.0]
    height = np.concatenate(heights)[np.cumsum(moved) - 1]
    return replace(path, height=height)


def straight_path(
    terrain: Terrain, survey: Survey, points: NDArray[np.float64], layer: int = 0
) -> Path:
    """The samples of straight legs between points, (n, 2), none of which repeats the one before.

    A leg is judged by the headings of the survey on both sides of its direction, and counts as the
    worse. Between two legs the vehicle turns on the spot, the shorter way round. It begins in the
    survey's `layer`.
    """
    legs: list[Leg] = []
    for (x, y), (to_x, to_y) in pairwise(points.tolist()):
        towards = _snapped(math.degrees(math.atan2(to_x - x, to_y - y)) % 360.0, survey.headings)
        steps = math.ceil(_PER_CELL * math.hypot(to_x - x, to_y - y) / survey.grid.resolution)
        share = np.arange(steps + 1) / steps
        xs, ys = x + share * (to_x - x), y + share * (to_y - y)
        xs[-1], ys[-1] = to_x, to_y
        rows, columns = cells_of(survey.grid, xs, ys)
        if survey.stack is not None:
            rows = followed(survey, rows, columns, layer)
            layer = int(rows[-1]) // survey.stack.pitch
        cells = np.stack([rows, columns], axis=-1)[:, None]
        turn = (towards - legs[-1].towards) % 360.0 if legs else 0.0
        legs.append(Leg(xs, ys, cells, towards, side=1 if turn < 180.0 else -1))
    path = legs_path(legs, survey)
    return replace(path, height=path_heights(path, survey, terrain))


def path_heights(path: Path, survey: Survey, terrain: Terrain) -> NDArray[np.float64]:
    """Heights of the tops that a path lies on, (n,) m."""
    if survey.stack is None:
        return np.asarray(terrain.height(path.x, path.y), np.float64)
    return np.asarray(top_near(terrain, path.x, path.y, survey.heights[path.row, path.column]))


def followed(
    survey: Survey, rows: NDArray[np.int64], columns: NDArray[np.int64], layer: int
) -> NDArray[np.int64]:
    """Rows in all layers of cells of the grid one after the other, from a layer on.

    From cell to cell the vehicle stays on what its layer shows.
    """
    assert survey.stack is not None
    out = np.empty_like(rows)
    for n, (row, column) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
        out[n] = row + layer * survey.stack.pitch
        if not math.isnan(survey.heights[out[n], column]):
            out[n] = survey.own_rows(out[n : n + 1], columns[n : n + 1])[0]
            layer = int(out[n]) // survey.stack.pitch
    return out


def joined_path(paths: Sequence[Path]) -> Path:
    """Paths one after the other, each of which begins where the one before ends."""
    if len(paths) == 1:
        return paths[0]
    kept = [paths[0]]
    for before, path in pairwise(paths):
        same = abs(before.direction[-1] - path.direction[0]) < _SAME
        kept.append(Path(*(getattr(path, one.name)[1 if same else 0 :] for one in fields(path))))
    return Path(*(np.concatenate([getattr(p, one.name) for p in kept]) for one in fields(Path)))


def reversed_path(path: Path, headings: int) -> Path:
    """A path from its end to its beginning, judged by the opposite headings."""
    turned = (path.judged[::-1] + headings // 2) % headings
    # the first sample of a leg is judged as the leg that ends there, not as that which begins
    judged = np.r_[turned[:1], turned[:-1]]
    return Path(
        path.x[::-1], path.y[::-1], path.height[::-1], path.row[::-1], path.column[::-1],
        judged, judged, (path.direction[::-1] + 180.0) % 360.0,
    )  # fmt: skip


def driving_cost(
    path: Path, survey: Survey, vehicle: Vehicle, turns: Sequence[Turning],
    brakes: NDArray[np.float64],
) -> DrivingCost:  # fmt: skip
    """The cost of driving a path.

    One half of each leg is driven as at its beginning, the other as at its end. The length of a leg
    over ground takes in the heights of its ends. A turn takes the work and the time of
    `turn_on_spot` on the surface under the vehicle's middle, `turns` by id, as on the level. Speeds
    are those that stop in time by `brakes`, by id of the surface.
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
    ends = [
        (path.judged[1:], path.row[:-1], path.column[:-1]),
        (path.judged[1:], path.row[1:], path.column[1:]),
    ]
    fast = [np.broadcast_to(speeds(survey, vehicle, brakes, at), run.shape)[driven] for at in ends]
    seconds = [
        seconds_per_metre(slip, speed)
        for slip, speed in zip(values_at_ends(survey.slip), fast, strict=True)
    ]
    joules = [joules_per_metre(energy, vehicle) for energy in values_at_ends(survey.energy)]
    own_time, own_energy = way * (seconds[0] + seconds[1]), way * (joules[0] + joules[1])
    time = float(own_time.sum())
    energy = float(own_energy.sum()) + vehicle.power * time
    on = survey.surfaces[path.row[1:], path.column[1:]][~driven]
    turned = (np.diff(path.direction)[~driven] + 180.0) % 360.0 - 180.0
    angle = np.radians(np.abs(turned))
    turn_time = angle / vehicle.speed * np.array([turns[surface].run for surface in on])
    turn_work = angle / vehicle.efficiency * np.array([turns[surface].work for surface in on])
    turning_time = float(turn_time.sum())
    turning = float(turn_work.sum()) + vehicle.power * turning_time
    by_leg = np.zeros((2, len(run)))
    by_leg[0, driven], by_leg[0, ~driven] = own_time, turn_time
    by_leg[1, driven], by_leg[1, ~driven] = own_energy, turn_work
    by_leg[1] += vehicle.power * by_leg[0]
    states = path.judged, path.row, path.column
    ground = brakes[survey.surfaces[path.row, path.column]]
    slowing = deceleration(ground, vehicle.gravity, survey.pitch[states], survey.roll[states])
    speed = np.broadcast_to(speeds(survey, vehicle, brakes, states), path.x.shape)
    times, energies = np.cumsum(np.pad(by_leg, ((0, 0), (1, 0))), axis=1)
    return DrivingCost(
        float(length.sum()), time + turning_time, energy + turning, turning, times, energies,
        speed.astype(np.float64),
        np.where(np.isnan(slowing), np.nan, stopping_distance(vehicle, slowing)),
    )  # fmt: skip


def profile(path: Path, survey: Survey, terrain: Terrain, cost: DrivingCost) -> RouteProfile:
    """The profile of a path for reports, with what its driving costs."""
    names = ("", *terrain.surfaces)
    facing = path.heading, path.row, path.column
    # the slopes of the plane under the vehicle, along and across the direction it looks in
    aside = np.radians(path.direction - path.heading * (360.0 / survey.headings))
    along, left = (
        np.tan(plane[facing].astype(np.float64)) for plane in (survey.pitch, survey.roll)
    )

    def uphill(judged: NDArray[np.int64], cells: slice) -> NDArray[np.float64]:
        """Crab angles to the left; a roll above 0 has the left side up."""
        at = judged, path.row[cells], path.column[cells]
        return np.copysign(survey.crab[at], survey.roll[at]).astype(np.float64)

    crab = uphill(path.judged, np.s_[:])
    begins = uphill(path.judged[1:], np.s_[:-1])
    return RouteProfile(
        path.x,
        path.y,
        path.direction,
        np.r_[0.0, np.cumsum(path.leg_lengths)],
        path.height,
        path.values_of(survey.sinkage).astype(np.float64),
        np.arctan(along * np.cos(aside) - left * np.sin(aside)),
        np.arctan(left * np.cos(aside) + along * np.sin(aside)),
        path.values_of(survey.slip).astype(np.float64),
        path.values_of(survey.utilisation).astype(np.float64),
        path.values_of(survey.verdict),
        path.values_of(survey.reason),
        tuple(names[i] for i in survey.surfaces[path.row, path.column].tolist()),
        tuple(
            terrain.pointer(element) or "" if element >= 0 else ""
            for element in sample_near(terrain, path.x, path.y, path.height).element.tolist()
        ),
        crab,
        drift_along(path.x, path.y, begins, crab[1:]),
        path.values_of(survey.reserve).astype(np.float64),
        cost.stopping, cost.speed, cost.times, cost.energies,
    )  # fmt: skip


def find_extreme(
    terrain: Terrain, values: NDArray[np.float64], profile: RouteProfile, *, of_size: bool = False
) -> Extreme | None:
    """The largest value of a measure, or of its size, along a profile; None where all is NaN."""
    if np.all(np.isnan(values)):
        return None
    n = int(np.nanargmax(np.abs(values) if of_size else values))
    place = location_at(terrain, float(profile.x[n]), float(profile.y[n]), float(profile.height[n]))
    return Extreme(float(values[n]), place, Reason(int(profile.reason[n])))


def worst_verdict(verdicts: NDArray[np.uint8]) -> Verdict:
    """The verdict of a whole way: no-go if any is, else unknown if any is, else the worst."""
    if np.any(verdicts == Verdict.NO_GO):
        return Verdict.NO_GO
    return Verdict(int(verdicts.max())) if np.all(verdicts) else Verdict.UNKNOWN


def location_at(terrain: Terrain, x: float, y: float, z: float | None = None) -> Location:
    """The height, surface and element at a point: of the top nearest to z, the lowest if None."""
    found = sample_near(terrain, x, y, z)
    height, surface = float(found.height), int(found.surface)
    return Location(
        x,
        y,
        None if math.isnan(height) else height,
        terrain.surfaces[surface] if surface >= 0 else "",
        terrain.pointer(int(found.element)) or "",
        terrain.storeys is not None and bool(height > top_near(terrain, x, y)),
    )


def check_inside(what: str, place: tuple[float, ...], parts: Mapping[str, Bounds]) -> None:
    """Refuse a place outside the terrain, or outside a part of it.

    Args:
        what: name of the place, for people.
        place: x and y, m, and a height where it has one.
        parts: west, south, east and north of the terrain and of the part, m, by their names for
            people.

    Raises:
        RequestError: the place lies outside one of them, or is no number.
    """
    x, y = place[:2]
    for name, (west, south, east, north) in parts.items():
        if not (west <= x <= east and south <= y <= north):
            sides = coordinates((west, south, east, north))
            raise RequestError(
                f"{what}, {numbers.place(place)}, lies outside {name}.",
                f"Give x and y within west south east north {sides}.",
            )
