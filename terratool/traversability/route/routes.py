"""Routes: is there a way, what does it cost, and if there is none, what bars it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.raster.grid import Grid, grid_over
from terratool.text.display import shown
from terratool.traversability.limits import level_demand
from terratool.traversability.results import (
    HEADINGS,
    RANKS,
    Barrier,
    Location,
    Reach,
    Reason,
    Route,
    Survey,
    Verdict,
)
from terratool.traversability.route.graph import (
    ALLOWED,
    BACKING,
    TURN_LENGTH,
    Costs,
    Found,
    Preference,
    cheapest_way,
    check_preference,
    drivable,
    least_rate,
    rates,
    turning_arc,
)
from terratool.traversability.route.paths import (
    Path,
    cell_of,
    check_ground,
    check_inside,
    driving_cost,
    find_extreme,
    graph_path,
    location_at,
    profile,
    reversed_path,
    straight_path,
    worst_verdict,
)
from terratool.traversability.route.reach import (
    Connected,
    begin_at,
    connected,
    heading_bits,
    spread,
)
from terratool.traversability.soil import soils
from terratool.traversability.tiles import SurveyTiles, part_of
from terratool.traversability.vehicle import Vehicle

_PER_RADIUS = 4.0
"""Samples for each wheel radius …"""
_MOST = 256
"""… and along each side of the rectangle at most."""

_SHAPES = frozenset(
    {Reason.STEP, Reason.HIGH_CENTRED, Reason.APPROACH, Reason.ROUGHNESS, Reason.TIP_OVER}
)

_SLOPES = frozenset(
    {Reason.TRACTION, Reason.TORQUE, Reason.SLIP, Reason.SIDE_SLIP, Reason.TIP_OVER}
)
_HALVINGS = 40
_LEVEL = 1.0
"""Degrees below which a slope is not mentioned."""

MOST_STATES = 6_000_000
"""Headings times cells of a route's grid at most."""

_FINE, _COARSE = 6.0, 3.0
"""A vehicle is so many pixels wide where there is room, and so many at least if that can be."""
_COARSER = 1.01
"""Where rows and columns that only cover the rest make it too many, pixels get wider by this."""

_BARRED = 1e6
"""A metre that cannot be driven weighs so many that can, on the way of least resistance."""

Cell = tuple[int, int]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Site:
    """A vehicle on a terrain, and what is known of it there."""

    terrain: Terrain
    vehicle: Vehicle
    tiles: SurveyTiles

    @property
    def survey(self) -> Survey:
        """Of the tiles."""
        return self.tiles.survey


def barriers(on: Site, path: Path) -> tuple[Barrier, ...]:
    """The stretches of a path that cannot be driven, in its order.

    Of a leg with one end that cannot be driven a half counts; of a turn, its arc. Where it is too
    steep for the soil, the motors or the vehicle's balance, `bars` says how steep, too.
    """
    terrain, vehicle, survey = on.terrain, on.vehicle, on.survey
    no_ground = np.isnan(path.height)
    blocked = no_ground | ~path.sampled(drivable(survey))
    reasons = np.where(no_ground, np.uint8(Reason.NO_GROUND), path.sampled(survey.reason))
    run = path.leg_lengths
    way = np.where(run > 0.0, run, turning_arc(survey, vehicle))
    width = 0.5 * (np.r_[0.0, way] + np.r_[way, 0.0])
    edges = np.flatnonzero(np.diff(np.r_[False, blocked, False].astype(np.int8)))
    found = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        reason = Reason(int(reasons[first]))
        x, y = float(path.x[first]), float(path.y[first])
        heading = 2.0 * math.pi * int(path.judged[first]) / survey.headings
        name = bars(terrain, vehicle, reason, Pose(x, y, heading), survey.grid.resolution)
        slope = _slope(survey, path, first) if reason in _SLOPES else 0.0
        found.append(
            Barrier(
                location_at(terrain, x, y),
                reason,
                f"{name}, on a slope of {slope:.0f}°" if slope >= _LEVEL else name,
                float(width[first:end].sum()),
            )
        )
    return tuple(found)


class Pose(NamedTuple):
    """Where a vehicle's middle is, and its heading, rad clockwise from north."""

    x: float
    y: float
    heading: float


def bars(terrain: Terrain, vehicle: Vehicle, reason: Reason, pose: Pose, cell: float) -> str:
    """What decides the ground that bars a vehicle, for people: element and surface, and how high.

    For steps, and whatever else the shape of the ground does, it is the element of the higher side
    where heights differ most under the vehicle's rectangle, with half a cell around it and a wheel
    radius (a cell, if that is more) ahead; unless the lower side's element is one of the higher
    one's children, and so a hole in it. For soil it is the weakest that a wheel stands on.

    `cell` is the side of the survey's cells, m.
    """
    if reason == Reason.EDGE:
        return "the edge of the terrain"
    rise = 0.0
    if reason in _SHAPES:
        element, rise = _rising(terrain, vehicle, pose, cell)
    elif reason == Reason.NO_GROUND:
        element = _missing(terrain, vehicle, pose, cell)
    else:
        element = _weakest(terrain, vehicle, reason, pose)
    if element < 0:
        return "ground without an element" if reason != Reason.NO_GROUND else "no element"
    surface = int(terrain.surface_of(np.array([element]))[0])
    name = f"surface {shown(terrain.surfaces[surface])}" if surface >= 0 else "no surface"
    size = f", {abs(rise):.2g} m {'high' if rise > 0.0 else 'deep'}" if rise else ""
    return f"{terrain.pointer(element)} ({name})" + size * (reason == Reason.STEP)


def _slope(survey: Survey, path: Path, sample: int) -> float:
    """How far the vehicle is tilted, degrees, whichever way; 0 where it cannot stand."""
    at = path.judged[sample], path.row[sample], path.column[sample]
    tilt = math.hypot(math.tan(float(survey.pitch[at])), math.tan(float(survey.roll[at])))
    return 0.0 if math.isnan(tilt) else math.degrees(math.atan(tilt))


def _rectangle(
    vehicle: Vehicle, pose: Pose, cell: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World x and y of a lattice over what the vehicle covers, and what it drives against."""
    front, rear, side = vehicle.rectangle
    front += max(cell, vehicle.wheel.radius)
    rear, side = rear + 0.5 * cell, side + 0.5 * cell
    step = max(vehicle.wheel.radius / _PER_RADIUS, max(front + rear, 2.0 * side) / _MOST)
    along = np.arange(-rear, front + step, step)
    across = np.arange(-side, side + step, step)
    return _turned(pose, along[:, None], across[None, :])


def _turned(
    pose: Pose, along: NDArray[np.float64], across: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """World x and y of places ahead and to the right of a vehicle."""
    sine, cosine = math.sin(pose.heading), math.cos(pose.heading)
    return pose.x + along * sine + across * cosine, pose.y + along * cosine - across * sine


def _rising(terrain: Terrain, vehicle: Vehicle, pose: Pose, cell: float) -> tuple[int, float]:
    """The element that decides the higher side of the largest difference of heights, and the wall.

    Of a hole it is the lower side's, and the height of the wall is below 0; 0 where there is none.
    """
    xs, ys = _rectangle(vehicle, pose, cell)
    found = terrain.sample(xs, ys)
    height, element = found.height, found.element
    rises = [np.abs(np.diff(height, axis=axis)) for axis in (0, 1)]
    largest = [0.0 if np.all(np.isnan(rise)) else float(np.nanmax(rise)) for rise in rises]
    axis = int(largest[1] > largest[0])
    if largest[axis] == 0.0:
        return int(element[element.shape[0] // 2, element.shape[1] // 2]), 0.0
    row, column = np.unravel_index(int(np.nanargmax(rises[axis])), rises[axis].shape)
    one, other = (row, column), (row + (axis == 0), column + (axis == 1))
    high, low = (one, other) if height[one] > height[other] else (other, one)
    higher, lower = int(element[high]), int(element[low])
    hole = f"{terrain.pointer(lower) or ''}/".startswith(f"{terrain.pointer(higher) or ''}/")
    wall = _wall(terrain, np.array([xs[high], ys[high]]), np.array([xs[low], ys[low]]))
    return (lower, -wall) if hole else (higher, wall)


def _wall(terrain: Terrain, high: NDArray[np.float64], low: NDArray[np.float64]) -> float:
    """Height of the wall between two places, found by halving; 0 where the ground just slopes."""
    top, foot = float(terrain.height(*high)), float(terrain.height(*low))
    rise = top - foot
    for _ in range(_HALVINGS):
        middle = 0.5 * (high + low)
        between = float(terrain.height(*middle))
        if top - between >= between - foot:
            low, foot = middle, between
        else:
            high, top = middle, between
    return top - foot if top - foot > 0.5 * rise else 0.0


def _missing(terrain: Terrain, vehicle: Vehicle, pose: Pose, cell: float) -> int:
    """Index of the element of the nearest place on the terrain that has no ground; -1 for none."""
    xs, ys = _rectangle(vehicle, pose, cell)
    found = terrain.sample(xs, ys)
    void = np.isnan(found.height) & (found.element >= 0)
    if not void.any():
        return -1
    distance = np.where(void, np.hypot(xs - pose.x, ys - pose.y), np.inf)
    return int(found.element.ravel()[int(np.argmin(distance))])


def _weakest(terrain: Terrain, vehicle: Vehicle, reason: Reason, pose: Pose) -> int:
    """Index of the element under the wheel on the soil that bears least; -1 for none."""
    offset, side = vehicle.middle, 0.5 * vehicle.track_width
    along = np.array([axle.x - offset for axle in vehicle.axles for _ in (0, 1)])
    across = np.array([side * sign for _ in vehicle.axles for sign in (-1.0, 1.0)])
    found = terrain.sample(*_turned(pose, along, across))
    known = soils(terrain, vehicle)

    def weakness(surface: int) -> float:
        soil = known[surface + 1]
        if soil is None:
            return math.inf
        if reason == Reason.SIDE_SLIP:
            return -float(soil.friction)
        need = level_demand(vehicle, soil)
        return need.sinkage if reason == Reason.SINKAGE else need.utilisation

    weakest = max(range(len(along)), key=lambda n: weakness(int(found.surface[n])))
    return int(found.element[weakest])


def route_grid(
    terrain: Terrain,
    vehicle: Vehicle,
    *,
    headings: int = HEADINGS,
    bounds: Bounds | None = None,
) -> tuple[Grid, str]:
    """The grid for a route: a sixth of the vehicle's width, or as fine as MOST_STATES allow.

    Returns:
        The grid, and a sentence where its pixels are wider than a third of the vehicle; else empty.

    Raises:
        RequestError: the bounds are empty or miss the terrain.
    """
    width = max(2.0 * vehicle.rectangle[2], vehicle.wheel.radius)
    if bounds is not None:
        check_bounds(bounds, terrain)
    west, south, east, north = clip_bounds(terrain, bounds)
    shorter = min(east - west, north - south)
    least = math.sqrt((east - west) * (north - south) * headings / MOST_STATES)
    resolution = min(max(width / _FINE, least), shorter)
    grid = grid_over(terrain, resolution, bounds)
    while headings * grid.height * grid.width > MOST_STATES and resolution < shorter:
        resolution = min(_COARSER * resolution, shorter)
        grid = grid_over(terrain, resolution, bounds)
    note = ""
    if resolution > width / _COARSE:
        note = (
            f"The route's grid has pixels of {resolution:.3g} m for a vehicle {width:.3g} m wide: "
            "narrow passages may seem closed; smaller bounds would make it finer."
        )
    return grid, note


def plan_route(
    terrain: Terrain,
    vehicle: Vehicle,
    survey: Survey | SurveyTiles,
    start: Point,
    goal: Point,
    prefer: Preference = "time",
) -> Route:
    """The best way from a start to a goal through the cells of a survey, or what bars it.

    The vehicle may begin and end with any heading, moves to the cell that it faces, backs up,
    and turns on the spot; it is where the survey says go or caution. Its energy is the sum over
    legs of energy per metre × length over ground, plus the vehicle's power × time; the time that of
    length / (speed × (1 − slip)), and for a turn that of the arc that its wheels run. `prefer` says
    what the way is the least of, see `graph.rates`.

    Of a survey by tiles those are made that the search comes to, and its result is that of all.

    Raises:
        RequestError: start or goal is outside the terrain or the survey, or on no ground; there is
            no such preference.
    """
    check_preference(prefer)
    tiles = SurveyTiles.of(survey)
    ends = [
        _cell(terrain, tiles.survey, place, f"The route's {what}")
        for what, place in (("start", start), ("goal", goal))
    ]
    tiles.complete(*np.array(ends).T)
    route = Route(
        location_at(terrain, *start), location_at(terrain, *goal), False, True, Verdict.NO_GO
    )
    on = Site(terrain, vehicle, tiles)
    stands = [drivable(tiles.survey, np.s_[row, column]).any() for row, column in ends]
    note = " ".join(
        f"The vehicle cannot stand at the {what}, whatever its heading: {_why(on, place, end)[1]}."
        for what, place, end, can in zip(
            ("start", "goal"), (start, goal), ends, stands, strict=True
        )
        if not can
    )
    if not stands[0]:
        reason, why = _why(on, start, ends[0])
        by = why.partition(", by ")[2]
        return _barred(route, (Barrier(route.start, reason, by, 0.0),), None, note)
    found = _search(on, prefer, *ends)
    if len(found.states):
        return _driven(route, graph_path(found.states, tiles.survey), on)
    nearest = _nearest(terrain, tiles.survey, found.reached, ends[1])
    return _barred(route, barriers(on, _least_resistance(on, *ends)), nearest, note)


def check_route(
    terrain: Terrain, vehicle: Vehicle, survey: Survey | SurveyTiles, waypoints: ArrayLike
) -> Route:
    """Drive the straight legs between waypoints, (n, 2), and say what they cost or what bars them.

    Samples are at most half a cell apart; each is judged by the heading of the survey that is
    nearest to its leg's direction. Between two legs the vehicle turns on the spot.

    Raises:
        RequestError: fewer than two different waypoints, or one that is outside the terrain or the
            survey.
    """
    points = np.asarray(waypoints, np.float64).reshape(-1, 2)
    points = points[np.r_[True, np.any(np.diff(points, axis=0) != 0.0, axis=1)][: len(points)]]
    if len(points) < 2:
        raise RequestError("The route has no two different waypoints.", "Give two at least.")
    tiles = SurveyTiles.of(survey)
    places = [(float(x), float(y)) for x, y in points]
    for number, place in enumerate(places, 1):
        _inside(terrain, tiles.survey, place, f"Waypoint {number}")
    path = straight_path(terrain, tiles.survey, points)
    tiles.complete(path.row, path.column)
    on = Site(terrain, vehicle, tiles)
    start, goal = location_at(terrain, *places[0]), location_at(terrain, *places[-1])
    route = Route(start, goal, False, False, Verdict.NO_GO)
    found = barriers(on, path)
    if not found:
        return _driven(route, path, on)
    at = (found[0].place.x, found[0].place.y)
    first = int(np.flatnonzero((path.x == at[0]) & (path.y == at[1]))[0])
    before = location_at(
        terrain, float(path.x[max(first - 1, 0)]), float(path.y[max(first - 1, 0)])
    )
    return replace(_barred(route, found, before), profile=profile(path, tiles.survey, terrain))


def with_way_back(route: Route, back: Route) -> Route:
    """A route that was found, with the best way back: the verdict is the worse of both.

    What is one-way there is no reason for caution any more where there is another way back.
    """
    if back.profile is not None and back.found:
        back = replace(back, one_way=False, against=(), verdict=worst_verdict(back.profile.verdict))
    own = route.verdict if route.profile is None else worst_verdict(route.profile.verdict)
    both = (own, back.verdict if back.found else Verdict.NO_GO)
    return replace(route, back=back, verdict=max(both, key=RANKS.__getitem__))


def reach(terrain: Terrain, survey: Survey | SurveyTiles, start: Point) -> Reach:
    """What can be reached from a start by the moves of `plan_route`, and what can be returned from.

    Raises:
        RequestError: the start is outside the terrain or the survey, or on no ground.
    """
    seen = SurveyTiles.of(survey).complete()
    cell = _cell(terrain, seen, start, "The place to start from")
    bits = heading_bits(drivable(seen))
    found = connected(bits, seen.headings, begin_at(bits, cell))
    return reach_of(terrain, start, found, np.isfinite(seen.heights))


def reach_of(terrain: Terrain, start: Point, found: Connected, ground: NDArray[np.bool_]) -> Reach:
    """What is connected to a start, in shares of the cells with ground."""
    whole = max(int(np.count_nonzero(ground)), 1)
    note = ""
    if not found.reached.any():
        note = "The vehicle cannot stand at the place to start from, whatever its heading."
    return Reach(
        location_at(terrain, *start),
        np.count_nonzero(found.reached) / whole,
        np.count_nonzero(found.returned) / whole,
        found.reached,
        note,
    )


def _search(on: Site, prefer: Preference, begin: Cell, end: Cell) -> Found:
    """The cheapest way where the survey says go or caution."""
    survey, vehicle = on.survey, on.vehicle
    arc = turning_arc(survey, vehicle) * (TURN_LENGTH if prefer == "length" else 1.0)
    costs = Costs.of(
        np.zeros(survey.verdict.shape, np.float32), np.zeros(survey.verdict.shape, np.uint8),
        survey.heights, survey.grid.resolution, arc, least_rate(vehicle, prefer), on.tiles.side,
    )  # fmt: skip

    def fill(part: Any) -> None:
        can = drivable(survey, part)
        costs.flags[:, *part] = np.where(can, ALLOWED | BACKING, 0)
        costs.rate[:, *part] = rates(survey, vehicle, prefer, part)

    return _filled(on, costs, fill, begin, end)


def _filled(on: Site, costs: Costs, fill: Callable[[Any], None], begin: Cell, end: Cell) -> Found:
    """Search, and fill in the costs of each tile that it comes to."""

    def know(made: Iterable[int]) -> None:
        for tile in made:
            fill(part_of(on.tiles.window(tile)))
            costs.known.reshape(-1)[tile] = True

    def ask(tile: int) -> None:
        known = on.tiles.known.reshape(-1)[tile]
        know([tile] if known else on.tiles.make(tile, end))

    ask(begin[0] // on.tiles.side * costs.known.shape[1] + begin[1] // on.tiles.side)
    headings = drivable(on.survey, np.s_[begin[0], begin[1]])
    starts = [(heading, *begin) for heading in np.flatnonzero(headings).tolist()]
    return cheapest_way(costs, np.array(starts, np.int64), end, ask)


def _driven(route: Route, path: Path, on: Site) -> Route:
    """The route with what a way costs, where it is steepest, softest and tightest.

    Whether it can be driven back the same way is looked for among the cells of the way.
    """
    terrain, survey = on.terrain, on.survey
    along_it, cost = profile(path, survey, terrain), driving_cost(path, survey, on.vehicle)
    steepest = find_extreme(terrain, along_it.pitch, along_it, of_size=True)
    softest = find_extreme(terrain, along_it.sinkage, along_it)
    tightest = find_extreme(terrain, along_it.utilisation, along_it)
    verdict, one_way = worst_verdict(along_it.verdict), not _returns(path, on)
    if one_way and RANKS[verdict] < RANKS[Verdict.CAUTION]:
        verdict = Verdict.CAUTION
    return replace(
        route,
        found=True,
        verdict=verdict,
        length=cost.length,
        energy=cost.energy,
        time=cost.time,
        steepest=steepest and replace(steepest, reason=Reason.NONE),
        softest=softest and replace(softest, reason=Reason.NONE),
        tightest=tightest and replace(tightest, value=1.0 - tightest.value),
        profile=along_it,
        one_way=one_way,
        against=barriers(on, reversed_path(path, survey.headings)) if one_way else (),
    )


def _returns(path: Path, on: Site) -> bool:
    """Whether the cells of a path, and those beside them, can be driven back to its beginning."""
    grid = on.survey.grid
    top, left = max(path.row.min() - 1, 0), max(path.column.min() - 1, 0)
    own = np.zeros(
        (min(path.row.max() + 2, grid.height) - top, min(path.column.max() + 2, grid.width) - left),
        np.bool_,
    )
    rows, columns = path.row - top, path.column - left
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            own[
                np.clip(rows + down, 0, own.shape[0] - 1),
                np.clip(columns + right, 0, own.shape[1] - 1),
            ] = True
    at = np.nonzero(own)
    survey = on.tiles.complete(at[0] + top, at[1] + left)
    part = np.s_[top : top + own.shape[0], left : left + own.shape[1]]
    bits = heading_bits(drivable(survey, part) & own)
    begin = begin_at(bits, (int(rows[-1]), int(columns[-1])))
    return bool(spread(bits, survey.headings, begin)[rows[0], columns[0]].any())


def _barred(
    route: Route, found: tuple[Barrier, ...], nearest: Location | None, note: str = ""
) -> Route:
    """The route with what bars it; unknown where nothing but unknown soil does."""
    unknown = all(barrier.reason == Reason.SOIL_UNKNOWN for barrier in found)
    verdict = Verdict.UNKNOWN if unknown else Verdict.NO_GO
    return replace(route, verdict=verdict, barriers=found, reached=nearest, note=note)


def _least_resistance(on: Site, begin: Cell, end: Cell) -> Path:
    """The way with the fewest metres that cannot be driven, as seen from above; then the shortest.

    Only where it can be driven does the vehicle back up on it.
    """
    survey, grid = on.survey, on.survey.grid
    west, south, east, north = on.terrain.bounds
    x, y = grid.columns(grid.whole), grid.rows(grid.whole)
    inside = ((y >= south) & (y <= north))[:, None] & ((x >= west) & (x <= east))
    inside[end] = True  # a goal at the very edge may be in a cell whose centre is beyond it
    costs = Costs.of(
        np.zeros(survey.verdict.shape, np.float32), np.zeros(survey.verdict.shape, np.uint8),
        np.zeros(inside.shape, np.float32), grid.resolution, turning_arc(survey, on.vehicle), 1.0,
        on.tiles.side,
    )  # fmt: skip

    def fill(part: Any) -> None:
        can = drivable(survey, part)
        costs.rate[:, *part] = np.where(can, 1.0, _BARRED)
        costs.flags[:, *part] = np.where(inside[part], ALLOWED, 0) | np.where(can, BACKING, 0)

    return graph_path(_filled(on, costs, fill, begin, end).states, survey)


def _nearest(terrain: Terrain, survey: Survey, marked: NDArray[np.bool_], end: Cell) -> Location:
    """The middle of the marked cell that is nearest to another one."""
    rows, columns = np.nonzero(marked)
    n = int(np.argmin((rows - end[0]) ** 2 + (columns - end[1]) ** 2))
    grid = survey.grid
    x, y = grid.columns(grid.whole)[columns[n]], grid.rows(grid.whole)[rows[n]]
    return location_at(terrain, float(x), float(y))


def _inside(terrain: Terrain, survey: Survey, place: Point, what: str) -> Cell:
    """The cell of a place; refuses what lies outside."""
    part = "the part of the terrain that is looked at"
    check_inside(terrain, what, place, survey.grid.bounds, part)
    return cell_of(survey.grid, *place)


def _cell(terrain: Terrain, survey: Survey, place: Point, what: str) -> Cell:
    """The cell of a place; refuses what lies outside or on no ground."""
    cell = _inside(terrain, survey, place, what)
    check_ground(terrain, what, place)
    return cell


def _why(on: Site, place: Point, cell: Cell) -> tuple[Reason, str]:
    """What binds at a cell at the heading that is best there, and with what decides the ground."""
    survey = on.survey
    used = np.nan_to_num(survey.utilisation[:, *cell], nan=np.inf, posinf=np.inf)
    heading = int(np.argmin(used))
    reason = Reason(int(survey.reason[heading, *cell]))
    angle = 2.0 * math.pi * heading / survey.headings
    by = bars(on.terrain, on.vehicle, reason, Pose(*place, angle), survey.grid.resolution)
    return reason, reason.label if reason == Reason.EDGE else f"{reason.label}, by {by}"
