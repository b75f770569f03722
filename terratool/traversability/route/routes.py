"""Routes: ways through a survey with their costs, or the barriers where there is none."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.terrain import Terrain, check_bounds, clip_bounds
from terratool.raster.grid import Grid, grid_over
from terratool.report import numbers
from terratool.traversability.fineness import coarsest_resolution
from terratool.traversability.layers import ground_tops, top_near
from terratool.traversability.map_results import HEADINGS, Survey
from terratool.traversability.route.barriers import (
    BlockedPlace,
    Cell,
    Point,
    RouteSite,
    barriers,
    blockage_at,
    z_of,
)
from terratool.traversability.route.bends import (
    bent_path,
    corners_of,
    pulled_corners,
    reversed_corners,
    rounded,
)
from terratool.traversability.route.graph import (
    ALLOWED,
    BACKING,
    Costs,
    Preference,
    SearchResult,
    Turns,
    cheapest_way,
    check_preference,
    drivable,
    least_rate,
    pulled,
    rates,
    state_flags,
    turn_prices,
    turnable,
    turning_arc,
)
from terratool.traversability.route.outcome import leads_back, with_barriers, with_way
from terratool.traversability.route.paths import (
    Path,
    check_inside,
    driving_cost,
    graph_path,
    joined_path,
    location_at,
    profile,
    pulled_path,
    straight_path,
    worst_verdict,
)
from terratool.traversability.route.reach import (
    Connected,
    FloodPlaces,
    begin_at,
    connected_cells,
    heading_bits,
)
from terratool.traversability.route.results import (
    Barrier,
    Location,
    Reach,
    Route,
)
from terratool.traversability.soil import turnings
from terratool.traversability.tiles import SurveyTiles, part_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import RANKS, Reason, Verdict

MOST_STATES = 6_000_000
"""Most states, headings times cells, of a route's grid."""

_FINE = 6.0
"""Pixels per width of the vehicle, if MOST_STATES allow."""
_COARSE = 3.0
"""Pixels per width of the vehicle below which a note says that passages may seem closed."""
_COARSER = 1.01
"""Factor by which pixels get wider where rounding up rows and columns makes too many."""

_BARRIER_WEIGHT = 1e6
"""Weight of a metre that cannot be driven, on the way of least resistance."""


_NEAR = 2
"""Cells by which corners of an alternative move at a time, so that it stays one."""


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
        RequestError: the bounds are empty or miss the terrain; or MOST_STATES are too few.
    """
    width = _width(vehicle)
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
    coarsest = coarsest_resolution(vehicle)
    if resolution > coarsest:
        raise RequestError(
            f"The ground of {east - west:.12g} by {north - south:.12g} m is too large to look for "
            f"routes: their grid would have pixels of {resolution:.4g} m, and "
            f"{vehicle.size_words} m take at most {coarsest:.4g} m.",
            "Look at a part of it with --bounds W S E N.",
        )
    return grid, narrow_note(vehicle, resolution)


def narrow_note(vehicle: Vehicle, resolution: float) -> str:
    """A sentence where pixels are wider than a third of the vehicle; else empty."""
    width = _width(vehicle)
    if resolution <= width / _COARSE:
        return ""
    return (
        f"The route's grid has pixels of {resolution:.3g} m for a vehicle {width:.3g} m wide: "
        "narrow passages may seem closed. A smaller part, with --bounds, makes it finer."
    )


def _width(vehicle: Vehicle) -> float:
    """Width of a vehicle, m; a wheel's radius, if that is more."""
    return max(2.0 * vehicle.rectangle[2], vehicle.wheel.radius)


def plan_route(
    terrain: Terrain,
    vehicle: Vehicle,
    survey: Survey | SurveyTiles,
    start: Point,
    goal: Point,
    prefer: Preference = "time",
) -> Route:
    """Plan the best way from a start to a goal through the cells of a survey, or find barriers.

    The vehicle may begin and end with any heading, moves to the cell that it faces, backs up,
    and turns on the spot; all its states are go or caution. Energy is the sum over legs of energy
    per metre × length over ground, plus the vehicle's power × time. Time is the sum over legs of
    length / (speed × (1 − slip)). Turns take the work and the time of `turn_on_spot`. The way
    minimises the quantity `prefer`, see `graph.rates` and `graph.turn_prices`.

    A survey by tiles is computed where the search comes; the result is that of the whole survey.

    Raises:
        RequestError: start or goal is outside the terrain or the survey; there is no such
            preference.
    """
    return search_route(terrain, vehicle, survey, start, goal, prefer).route()


def search_route(
    terrain: Terrain,
    vehicle: Vehicle,
    survey: Survey | SurveyTiles,
    start: Point,
    goal: Point,
    prefer: Preference = "time",
    penalties: NDArray[np.float32] | None = None,
    most_tiles: int | None = None,
) -> RouteSearch:
    """Run the search of `plan_route` alone, without barriers.

    Costs of cells are multiplied by `penalties`, (height, width), 1 or more; by 1 if None. The
    search gives up, without a way, where it would look at more than `most_tiles`.

    Raises:
        RequestError: start or goal is outside the terrain or the survey; there is no such
            preference.
    """
    check_preference(prefer)
    tiles = SurveyTiles.of(survey)
    places = start, goal
    ends = tuple(
        _cell_inside(terrain, tiles, place, f"The route's {what}")
        for what, place in zip(("start", "goal"), places, strict=True)
    )
    tiles.complete(*np.array(ends).T)
    on = RouteSite.of(terrain, vehicle, tiles)
    stands = tuple(can_stand(terrain, tiles.survey, *end) for end in zip(places, ends, strict=True))
    if not stands[0]:
        return RouteSearch(on, places, ends, stands, None)
    costs, fill = _costs(on, prefer)
    if penalties is not None and (stack := tiles.survey.stack) is not None:
        flat, penalties = penalties, np.ones(tiles.survey.heights.shape, np.float32)
        for part in stack.parts(penalties):
            part[:] = flat
    if penalties is None:
        found = _search_tiles(on, costs, fill, ends, most_tiles)
    else:
        found = _search_tiles(on, *_penalised(costs, fill, penalties), ends, most_tiles)
        for tile in np.flatnonzero(costs.known).tolist():
            fill(part_of(tiles.window(tile)))  # the way is pulled straight by what it really costs
    near = 0 if penalties is None else _NEAR
    return RouteSearch(on, places, ends, stands, found, costs, near)


@dataclass(frozen=True, slots=True)
class RouteSearch:
    """A finished search for a route.

    Attributes:
        on: vehicle, terrain and survey.
        places: start and goal, world x and y, m.
        ends: cells of start and goal.
        stands: whether the vehicle can stand at start and goal.
        found: result of the search; None where the vehicle cannot stand at the start, and where
            the search gave up.
        costs: costs of the search; None where there was none.
        near: cells by which corners of the way move at a time when it is pulled straight; 0 for any
            number.
    """

    on: RouteSite
    places: tuple[Point, ...]
    ends: tuple[Cell, ...]
    stands: tuple[bool, ...]
    found: SearchResult | None
    costs: Costs | None = None
    near: int = 0

    @property
    def looked_at(self) -> int:
        """Number of tiles that the search looked at."""
        return 0 if self.costs is None else int(np.count_nonzero(self.costs.known))

    @property
    def is_go(self) -> bool:
        """Whether all states of the way are go."""
        assert self.found is not None
        verdict = self.on.survey.verdict[tuple(self.found.states.T)]
        return bool(np.all(verdict == Verdict.GO))

    @property
    def has_way(self) -> bool:
        """Whether there is a way."""
        return self.found is not None and len(self.found.states) > 0 and self.stands[1]

    def _way(self, route: Route) -> Route:
        """Complete a route by the way that was found, pulled straight.

        It is one-way only if the chain of moves is, too.
        """
        assert self.found is not None and self.costs is not None
        survey, radius = self.on.survey, self.on.vehicle.turning_radius
        if radius and len(self.found.states) > 1:
            return self._bent_way(route, radius / survey.grid.resolution)
        pieces = self._pieces()
        chains = [graph_path(one.states, survey) for one in pieces]
        chain = joined_path(chains)
        for both in (False, True):
            paths = []
            for piece, own in zip(pieces, chains, strict=True):
                corners = pulled(self.costs, piece, both, self.near)
                paths.append(pulled_path(corners, survey) if len(corners) > 1 else own)
            path = joined_path(paths)
            one_way = not leads_back(path, self.on)
            if one_way and leads_back(chain, self.on):
                continue
            # longer legs drift farther between two corners
            found = with_way(route, path, self.on, one_way)
            if not found.strays:
                return found
        return with_way(route, chain, self.on, not leads_back(chain, self.on))

    def _pieces(self) -> list[SearchResult]:
        """The way that was found, cut where it comes from a layer to another one."""
        assert self.found is not None
        parts = by_layer(self.found.states, self.on.survey)
        return [replace(self.found, states=one) for one in parts]

    def _bent_way(self, route: Route, radius: float) -> Route:
        """Complete a route of a vehicle that bends, as `_way` does; `radius` in sides of a cell."""
        assert self.found is not None and self.costs is not None
        survey = self.on.survey
        chain = _bent_chain(self.found.states, survey, radius)
        # which makes what lies beside it known, too
        chain_leads_back = leads_back(chain, self.on)
        pieces = self._pieces()
        for both in (False, True):
            paths, backs = [], []
            for piece in pieces:
                corners = pulled_corners(self.costs, piece, radius, both, self.near)
                if len(corners) > 1:
                    paths.append(bent_path(corners, survey))
                    backs.append(bent_path(reversed_corners(corners), survey))
                else:
                    paths.append(graph_path(piece.states, survey))
            one_way = not all(back.is_drivable(survey) for back in backs)
            if one_way and chain_leads_back and not both:
                continue
            # there is a way back beside the moves, if the car cannot back up all along
            one_way &= not chain_leads_back
            found = with_way(route, joined_path(paths), self.on, one_way)
            if not found.strays:
                return found
        return with_way(route, chain, self.on, not chain_leads_back)

    def route(self) -> Route:
        """The route with its way, or with barriers, which take a second search."""
        on, ends = self.on, self.ends
        start, goal = (location_at(on.terrain, *place) for place in self.places)
        route = Route(start, goal, False, True, Verdict.NO_GO, headings=on.survey.headings)
        note = " ".join(
            f"The vehicle cannot stand at the {what}, whatever its heading: "
            f"{blockage_at(on, place, end).words}."
            for what, place, end, can in zip(
                ("start", "goal"), self.places, ends, self.stands, strict=True
            )
            if not can
        )
        if self.found is None:
            return with_barriers(route, (_barrier_at(on, start, ends[0]),), None, note)
        if self.has_way:
            return self._way(route)
        nearest = _nearest_marked(on.terrain, on.survey, self.found.reached, ends[1])
        way = _least_resistance(on, ends[0], ends[1])
        if way is None:
            return with_barriers(route, (_apart(goal, nearest),), nearest, note)
        between = barriers(on, way)
        # the goal's cell may be reachable although the goal itself has no ground
        bars = between or (_barrier_at(on, goal, ends[1]),)
        return with_barriers(route, bars, nearest, note)


def can_stand(terrain: Terrain, survey: Survey, place: Point, cell: Cell) -> bool:
    """Whether a place has ground, and the vehicle can be at its cell with any heading."""
    return not math.isnan(top_near(terrain, *place)) and bool(drivable(survey, np.s_[cell]).any())


def _barrier_at(on: RouteSite, at: Location, cell: Cell) -> Barrier:
    """The barrier at a place where the vehicle cannot stand; its width is 0."""
    reason, ground = blockage_at(on, (at.x, at.y), cell)
    return Barrier(at, reason, ground.name, 0.0, ground.pointer)


def _apart(goal: Location, nearest: Location) -> Barrier:
    """The barrier of a goal to whose storey nothing leads; its width is 0."""
    name = f'{goal.element} (surface "{goal.surface}")' if goal.element else "no element"
    if goal.height is not None and nearest.height is not None:
        rise = goal.height - nearest.height
        name += f", {abs(rise):.2g} m {'high' if rise > 0.0 else 'deep'}"
    return Barrier(nearest, Reason.STEP, name, 0.0, re.split(r"[>[]", goal.element, maxsplit=1)[0])


def by_layer(states: NDArray[np.int64], survey: Survey) -> list[NDArray[np.int64]]:
    """Parts of a way, (n, 3) states, that lie in one layer each; the next begins where one ends."""
    if survey.stack is None:
        return [states]
    return np.split(states, np.flatnonzero(np.diff(states[:, 1] // survey.stack.pitch)) + 1)


def _bent_chain(states: NDArray[np.int64], survey: Survey, radius: float) -> Path:
    """The samples of moves and arcs of a way; `radius` in sides of a cell."""
    return joined_path(
        [
            bent_path(corners_of(one, survey.headings, radius), survey)
            if len(one) > 1
            else graph_path(one, survey)
            for one in by_layer(states, survey)
        ]
    )


def check_route(
    terrain: Terrain, vehicle: Vehicle, survey: Survey | SurveyTiles, waypoints: ArrayLike
) -> Route:
    """Check the straight legs between waypoints: their cost, or barriers on them.

    Samples are at most half a cell apart; each is judged by the headings of the survey on both
    sides of its leg's direction. Between two legs the vehicle turns on the spot; one that steers as
    cars do rounds the corner where both legs are long enough, and a note says what it misses.

    Waypoints are (n, 2), or (n, 3) with heights of the floors that they are on, NaN where none is
    given. The way begins on the top that is nearest to the height of the first, on the lowest one
    without, and goes on as the vehicle would. One that passes below or above a waypoint misses it,
    which is a barrier.

    Raises:
        RequestError: fewer than two different waypoints, or one that is outside the terrain or the
            survey.
    """
    given = np.asarray(waypoints, np.float64)
    given = given.reshape(-1, 3 if given.ndim == 2 and given.shape[1] == 3 else 2)
    points = given[:, :2]
    moved = np.r_[True, np.any(np.diff(points, axis=0) != 0.0, axis=1)][: len(points)]
    given, points = given[moved], points[moved]
    if len(points) < 2:
        raise RequestError("The route has no two different waypoints.", "Give two at least.")
    tiles = SurveyTiles.of(survey)
    begins = [
        _cell_inside(terrain, tiles, tuple(place), f"Waypoint {number}")
        for number, place in enumerate(given.tolist(), 1)
    ]
    line = rounded(points, tiles.survey.grid, vehicle.turning_radius)

    def layer_of(row: int) -> int:
        stack = tiles.survey.stack
        return 0 if stack is None else row // stack.pitch

    def path_as_known() -> Path:
        layer = layer_of(begins[0][0])
        if vehicle.turning_radius:
            return bent_path(line.corners, tiles.survey, terrain, layer)
        return straight_path(terrain, tiles.survey, points, layer)

    def backs_up() -> bool:
        """Whether one that steers as cars do can back up along its way."""
        layer = layer_of(int(path.row[-1]))
        back = bent_path(reversed_corners(line.corners), tiles.survey, terrain, layer)
        return bool(vehicle.turning_radius) and back.is_drivable(tiles.survey)

    path = path_as_known()
    tiles.complete(path.row, path.column)
    path = path_as_known()  # which of its headings is worse is known only now
    on = RouteSite.of(terrain, vehicle, tiles)
    start, goal = (
        location_at(terrain, float(x), float(y), z_of(z))
        for (x, y), z in zip(points[[0, -1]], path.height[[0, -1]], strict=True)
    )
    note = _rounding_note(line.misses, vehicle.turning_radius)
    route = Route(
        start, goal, False, False, Verdict.NO_GO, headings=tiles.survey.headings, note=note
    )
    found = barriers(on, path) or _missed(given, path, terrain)
    if not found:
        return with_way(route, path, on, not (backs_up() or leads_back(path, on)))
    at = found[0].place
    here = (path.x == at.x) & (path.y == at.y)
    if terrain.storeys is not None and at.height is not None:
        here &= path.height == at.height
    first = int(np.flatnonzero(here)[0])
    before = _place_on(path, terrain, max(first - 1, 0))
    cost = driving_cost(path, tiles.survey, vehicle, on.turns, on.brakes)
    along_it = profile(path, tiles.survey, terrain, cost)
    return replace(with_barriers(route, found, before, note), profile=along_it)


def _place_on(path: Path, terrain: Terrain, n: int) -> Location:
    """The place of a sample of a path."""
    return location_at(terrain, float(path.x[n]), float(path.y[n]), z_of(path.height[n]))


def _missed(waypoints: NDArray[np.float64], path: Path, terrain: Terrain) -> tuple[Barrier, ...]:
    """Barriers where a path passes below or above waypoints, (n, 3) with heights."""
    found = []
    for x, y, *z in waypoints.tolist():
        n = int(np.argmin(np.hypot(path.x - x, path.y - y)))
        here = _place_on(path, terrain, n)
        meant = location_at(terrain, here.x, here.y, *z)
        if z and not math.isnan(z[0]) and meant.height != here.height:
            found.append(_apart(meant, here))
    return tuple(found)


def _rounding_note(misses: NDArray[np.float64], radius: float) -> str:
    """A sentence on rounded waypoints, and on what the way misses them by; else empty."""
    if not misses.any():
        return ""
    worst = int(misses.argmax())
    others = ", others by less" if np.count_nonzero(misses) > 1 else ""
    return (
        f"Waypoints are rounded by arcs of {numbers.length(radius)}: the way misses waypoint "
        f"{worst + 1} by {numbers.length(float(misses[worst]))}{others}."
    )


def with_way_back(route: Route, back: Route) -> Route:
    """A route that was found, with the best way back: the verdict is the worse of both.

    One-way stretches are no reason for caution where there is another way back.
    """

    def own(one: Route) -> Verdict:
        """The verdict of a way by itself."""
        if one.profile is None:
            return one.verdict
        worst = worst_verdict(one.profile.verdict)
        return Verdict.CAUTION if worst == Verdict.GO and one.strays else worst

    if back.profile is not None and back.found:
        back = replace(back, one_way=False, against=(), verdict=own(back))
    both = (own(route), back.verdict if back.found else Verdict.NO_GO)
    return replace(route, back=back, verdict=max(both, key=RANKS.__getitem__))


def reach(
    terrain: Terrain, survey: Survey | SurveyTiles, start: Point, vehicle: Vehicle | None = None
) -> Reach:
    """The cells that can be reached from a start by the moves of `plan_route`, and returned from.

    Without a vehicle, turns are possible wherever driving is.

    Raises:
        RequestError: the start is outside the terrain or the survey.
    """
    tiles = SurveyTiles.of(survey)
    cell = _cell_inside(terrain, tiles, start, "The place to start from")
    seen = tiles.complete()
    bits = heading_bits(drivable(seen))
    turns = None if vehicle is None else turnable(seen, turnings(terrain, vehicle))
    begin = np.zeros_like(bits)
    if not math.isnan(top_near(terrain, *start)):
        begin = begin_at(bits, cell)
    radius = 0.0 if vehicle is None else vehicle.turning_radius / seen.grid.resolution
    found = connected_cells(
        bits, seen.headings, begin, places=FloodPlaces(turns, seen.twins), radius=radius
    )
    ground = np.isfinite(seen.heights)
    if seen.own is None or seen.stack is None:
        return reach_of(terrain, start, found, ground)
    own = reach_of(terrain, start, found, ground & seen.own)
    return replace(own, cells=ground_tops(own.cells, seen.own, ground, seen.stack))


def reach_of(
    terrain: Terrain, start: Point, found: Connected, ground: NDArray[np.bool_],
    blocked: BlockedPlace | None = None,
) -> Reach:  # fmt: skip
    """The connected cells of a start, in shares of the cells that count, (height, width) `ground`.

    `blocked` says why no cell is reached; if None, the result has a note without reasons then.
    """
    whole = max(int(np.count_nonzero(ground)), 1)
    if not found.reached.any() and blocked is None:
        place = f"the place to start from, {numbers.place(start)}"
        blocked = BlockedPlace(f"The vehicle cannot stand at {place}, whatever its heading.", "")
    return Reach(
        location_at(terrain, *start),
        np.count_nonzero(found.reached & ground) / whole,
        np.count_nonzero(found.returned & ground) / whole,
        found.reached,
        *(blocked or ()),
    )


def _costs(on: RouteSite, prefer: Preference) -> tuple[Costs, Callable[[Any], None]]:
    """Costs of ways through states that are go or caution, and what fills in those of a part."""
    survey, vehicle = on.survey, on.vehicle
    prices = turn_prices(on.turns, survey, vehicle, prefer)
    costs = Costs.of(
        np.zeros(survey.verdict.shape, np.float32), np.zeros(survey.verdict.shape, np.uint8),
        survey.heights, survey.grid.resolution, Turns(0.0, vehicle.turning_radius),
        least_rate(vehicle, prefer), on.tiles.side, survey,
    )  # fmt: skip

    def fill(part: Any) -> None:
        """Fill in the costs of a part of the cells."""
        costs.flags[:, *part] = state_flags(survey, drivable(survey, part), part)
        costs.rate[:, *part] = rates(survey, vehicle, prefer, part, on.brakes)
        costs.turn[part] = prices.fixed[survey.surfaces[part]]
        costs.runs[part] = prices.metres[survey.surfaces[part]]

    return costs, fill


def _penalised(
    costs: Costs, fill: Callable[[Any], None], penalties: NDArray[np.float32]
) -> tuple[Costs, Callable[[Any], None]]:
    """Costs whose parts are multiplied by penalties after they are filled in."""

    def fill_more(part: Any) -> None:
        fill(part)
        costs.rate[:, *part] *= penalties[part]

    return costs, fill_more


class _TooFarError(Exception):
    """A search would look at more ground than it may."""


def _search_tiles(
    on: RouteSite, costs: Costs, fill: Callable[[Any], None], ends: tuple[Cell, ...],
    most: int | None = None,
) -> SearchResult | None:  # fmt: skip
    """Search for the cheapest way; `fill` fills in the costs of each tile on demand.

    Tiles of `costs` that are known afterwards are those that the search asked for, whatever was
    known of the survey before. None where these would be more than `most`.
    """
    begin, end = ends

    def ask(tile: int) -> None:
        if most is not None and np.count_nonzero(costs.known) >= most:
            raise _TooFarError
        if not on.tiles.known.reshape(-1)[tile]:
            on.tiles.make(tile, end)
        fill(part_of(on.tiles.window(tile)))
        costs.known.reshape(-1)[tile] = True

    headings = drivable(on.survey, np.s_[begin[0], begin[1]])
    starts = [(heading, *begin) for heading in np.flatnonzero(headings).tolist()]
    try:
        ask(begin[0] // on.tiles.side * costs.known.shape[1] + begin[1] // on.tiles.side)
        return cheapest_way(costs, np.array(starts, np.int64), end, ask)
    except _TooFarError:
        return None


def _least_resistance(on: RouteSite, begin: Cell, end: Cell, bends: bool = True) -> Path | None:
    """The way with the fewest metres that cannot be driven, as seen from above; then the shortest.

    The vehicle backs up only where it can be driven. Without `bends` one that is car-like turns on
    the spot, too, where it is barred.
    """
    survey, grid = on.survey, on.survey.grid
    west, south, east, north = on.terrain.bounds
    x, y = grid.columns(grid.whole), grid.rows(grid.whole)
    inside = ((y >= south) & (y <= north))[:, None] & ((x >= west) & (x <= east))
    if survey.stack is not None:
        assert survey.own is not None
        shown = survey.own | np.isfinite(survey.heights)
        for part in survey.stack.parts(shown):
            part &= inside
        inside = shown
    inside[end] = True  # a goal at the very edge may be in a cell whose centre is beyond it
    own, radius = turning_arc(survey, on.vehicle), on.vehicle.turning_radius if bends else 0.0
    costs = Costs.of(
        np.zeros(survey.verdict.shape, np.float32), np.zeros(survey.verdict.shape, np.uint8),
        np.zeros(inside.shape, np.float32), grid.resolution, Turns(own, radius), 1.0, on.tiles.side,
        survey,
    )  # fmt: skip

    def fill(part: Any) -> None:
        """Fill in the costs of a part of the cells."""
        can = drivable(survey, part)
        costs.rate[:, *part] = np.where(can, 1.0, _BARRIER_WEIGHT)
        costs.flags[:, *part] = np.where(inside[part], ALLOWED, 0) | np.where(can, BACKING, 0)
        if (able := turnable(survey, on.turns, part)) is not None:
            costs.runs[part] *= np.where(able, 1.0, _BARRIER_WEIGHT)

    found = _search_tiles(on, costs, fill, (begin, end))
    assert found is not None
    states = found.states
    if not len(states) and not bends:
        return None  # nothing leads to its storey
    if not len(states):  # there is no room at all for its arcs
        return _least_resistance(on, begin, end, False)
    if not radius or len(states) < 2:
        return joined_path([graph_path(one, survey) for one in by_layer(states, survey)])
    return _bent_chain(states, survey, radius / grid.resolution)


def _nearest_marked(
    terrain: Terrain, survey: Survey, marked: NDArray[np.bool_], end: Cell
) -> Location:
    """The middle of the marked cell that is nearest to a cell."""
    rows, columns = np.nonzero(marked)
    flat, (goal, column) = survey.flat_rows(rows), end
    n = int(np.argmin((flat - survey.flat_rows(goal)) ** 2 + (columns - column) ** 2))
    grid, z = survey.grid, float(survey.heights[rows[n], columns[n]])
    x, y = grid.columns(grid.whole)[columns[n]], grid.rows(grid.whole)[flat[n]]
    return location_at(terrain, float(x), float(y), z)


def _cell_inside(terrain: Terrain, tiles: SurveyTiles, place: Point, what: str) -> Cell:
    """The cell of a place on the survey, whose pixels may end half a pixel before the terrain.

    Raises:
        RequestError: the place lies outside the terrain or the survey.
    """
    part = "the part of the terrain that is looked at"
    grid = tiles.survey.grid
    west, south, east, north = grid.bounds
    half = 0.5 * grid.resolution
    looked_at = west, south, east + half, north + half
    check_inside(what, place, {"the terrain": terrain.bounds, part: looked_at})
    return tiles.cell_of(place)
