"""Routes on finer headings, where few headings show none."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.traversability.map_results import FINER_HEADINGS, HEADINGS
from terratool.traversability.route.alternatives import Penalties, find_alternatives
from terratool.traversability.route.barriers import Cell, Point
from terratool.traversability.route.graph import Preference, drivable
from terratool.traversability.route.reach import begin_at, spread
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import (
    MOST_STATES,
    RouteSearch,
    can_stand,
    check_route,
    search_route,
)
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import SurveyTiles, part_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import Verdict

MOST_FINER_STATES = 2 * MOST_STATES
"""Most states, headings times cells, of a survey with finer headings."""


_MORE_GROUND = 1.2, 4
"""Most tiles that the search for a way that is all go looks at: a share of those that the search
before has looked at, and so many more."""


class Progress(Protocol):
    """A listener to the progress of long work."""

    def __call__(self, more: float, /) -> object:
        """Report that `more` pixels are done."""

    def say(self, what: str, total: int | None = None, /) -> object:
        """Report the step that begins, in words, and its number of pixels if known."""


def first_headings(vehicle: Vehicle) -> int:
    """Number of headings that is tried first: HEADINGS, and twice that for car-like vehicles.

    With 8 headings an arc turns a car by 45°, which leaves out places that are near beside it.
    """
    return 2 * HEADINGS if vehicle.turning_radius else HEADINGS


def finer_headings(grid: Grid, headings: int = HEADINGS) -> tuple[int, ...]:
    """Numbers of headings to be tried after `headings`, rising, without too many states."""
    most = MOST_FINER_STATES // (grid.height * grid.width)
    return tuple(more for more in FINER_HEADINGS if headings < more <= most)


class WayFinder:
    """A planner and checker of routes on a survey, and on finer ones where that shows no way.

    Args:
        terrain: the ground.
        vehicle: the vehicle.
        tiles: the survey with the fewest headings.
        finer: numbers of headings to be tried after that, rising.
        threads: number of threads of a survey; as many as there are processors if None.

    Attributes:
        tiles: the survey with the fewest headings.
        finer: numbers of headings to be tried after that, rising.
        progress: listener to the progress; None for none.
    """

    def __init__(
        self, terrain: Terrain, vehicle: Vehicle, tiles: SurveyTiles,
        finer: tuple[int, ...] = (), *, threads: int | None = None,
    ) -> None:  # fmt: skip
        self.tiles, self.finer = tiles, finer
        self.progress: Progress | None = None
        self._terrain, self._vehicle, self._threads = terrain, vehicle, threads
        self._made = {tiles.survey.headings: tiles}
        self._looked_at: dict[tuple[Point, Point], int] = {}

    def plan(self, start: Point, goal: Point, prefer: Preference = "time") -> Route:
        """Plan a route as `plan_route` does; barriers are those of the most headings tried.

        Finer searches are left out where no heading at all lets the vehicle through.

        Raises:
            RequestError: start or goal is outside the terrain or the survey; there is no such
                preference.
        """
        ends = start, goal
        count = self.tiles.survey.headings
        first = self._search(count, ends, prefer)
        if first.has_way or not self.finer:
            return replace(first.route(), tried_headings=(count,))
        most = self.finer[-1]
        if not _may_open(first, self._survey_with(most)):
            return replace(first.route(), tried_headings=(count,), ruled_out_headings=most)
        tried: tuple[int, ...] = (count,)
        for headings in self.finer:
            tried = (*tried, headings)
            search = self._search(headings, ends, prefer)
            if search.has_way:
                break
        return replace(search.route(), tried_headings=tried)

    def _search(self, headings: int, ends: tuple[Point, Point], prefer: Preference) -> RouteSearch:
        """A search for a route with so many headings."""
        survey = self._survey_with(headings)
        search = search_route(self._terrain, self._vehicle, survey, *ends, prefer)
        self._looked_at[ends] = search.looked_at
        return search

    def all_go_longer(
        self, route: Route, start: Point, goal: Point, prefer: Preference = "time"
    ) -> float | None:
        """Difference in length, m, of the best way by margin from a route, if it alone is all go.

        It takes another search, which is made where some of the route is caution; else None. The
        search gives up where it would look at over a fifth more ground than that for the route did.
        """
        if prefer == "margin" or route.profile is None or not route.found:
            return None
        if not np.any(route.profile.verdict == Verdict.CAUTION):
            return None
        tiles, looked_at = self._survey_with(route.headings), self._looked_at.get((start, goal))
        share, few = _MORE_GROUND
        most = None if looked_at is None else int(share * looked_at) + few
        search = search_route(
            self._terrain, self._vehicle, tiles, start, goal, "margin", most_tiles=most
        )
        if not search.has_way or not search.is_go:
            return None
        wide = search.route()
        if wide.verdict != Verdict.GO or wide.length is None or route.length is None:
            return None
        return wide.length - route.length

    def alternatives(
        self, route: Route, start: Point, goal: Point, prefer: Preference, count: int
    ) -> tuple[Route, ...]:
        """Alternatives to a route that was planned, `count` at most, with its headings."""
        if not route.found or not count:
            return ()
        tiles = self._survey_with(route.headings)

        def search(penalties: Penalties) -> Route:
            found = search_route(
                self._terrain, self._vehicle, tiles, start, goal, prefer, penalties
            )
            return found.route()

        width, grid = 2.0 * self._vehicle.rectangle[2], tiles.survey.grid
        if not self._vehicle.turning_radius:
            return find_alternatives(route, grid, width, prefer, count, search)

        def barred() -> NDArray[np.bool_]:
            never, survey = (tiles.survey.verdict == Verdict.NO_GO).all(axis=0), tiles.survey
            if survey.stack is None:
                return np.asarray(never)
            return np.asarray(np.any(survey.stack.parts(never & survey.own), axis=0))

        # ways of cars are not pulled straight, and so run beside each other where they could be one
        width += 2.0 * self._vehicle.turning_radius
        return find_alternatives(route, grid, width, prefer, count, search, barred)

    def check(self, waypoints: ArrayLike) -> Route:
        """Check waypoints as `check_route` does, by the fewest headings that show a way.

        Without a way, barriers are those of the most headings.

        Raises:
            RequestError: fewer than two different waypoints, or one that is outside the terrain or
                the survey.
        """
        tried: tuple[int, ...] = ()
        for headings in (self.tiles.survey.headings, *self.finer):
            route = check_route(
                self._terrain, self._vehicle, self._survey_with(headings), waypoints
            )
            tried = (*tried, headings)
            if route.found:
                break
        return replace(route, tried_headings=tried)

    def stands(self, place: Point) -> bool:
        """Whether the vehicle can stand at a place, with any of the finest headings."""
        tiles = self._survey_with((self.tiles.survey.headings, *self.finer)[-1])
        row, column = tiles.cell_of(place)
        return can_stand(self._terrain, tiles.complete([row], [column]), place, (row, column))

    def _survey_with(self, headings: int) -> SurveyTiles:
        """The survey with a number of headings, made where it is new."""
        if self.progress:
            few = headings == self.tiles.survey.headings
            self.progress.say(f"looking for ways{'' if few else f' with {headings} headings'}")
        if headings not in self._made:
            grid, own = self.tiles.survey.grid, (self.tiles.uncertainty, self.tiles.zones)
            surveyor = Surveyor(self._terrain, self._vehicle, grid, headings, *own)
            self._made[headings] = SurveyTiles(surveyor, threads=self._threads)
        self._made[headings].progress = self.progress
        return self._made[headings]


class _Passable:
    """Cells that can be driven with some heading, as far as two surveys show it.

    Attributes:
        some: (height, width) bool, cells that some heading can drive.
        never: (height, width) bool, cells where no heading lets the vehicle stand.

    Args:
        few: a survey.
        many: a survey with more headings, computed only where `few` does not decide.
        never: (height, width) bool, cells known from the start as `never`.
    """

    def __init__(self, few: SurveyTiles, many: SurveyTiles, never: NDArray[np.bool_]) -> None:
        self.some, self.never, self._many = np.zeros_like(never), never, many
        for tiles in (few, many):
            self._note(tiles, tiles.known)

    def _note(self, tiles: SurveyTiles, made: NDArray[np.bool_]) -> None:
        """Note the cells of some tiles of a survey, (rows, columns) bool."""
        for tile in np.flatnonzero(made).tolist():
            part = part_of(tiles.window(tile))
            self.some[part] |= drivable(tiles.survey, part).any(axis=0)
            self.never[part] |= np.isnan(tiles.survey.heights[part])

    def look_closer(self, cells: NDArray[np.bool_]) -> bool:
        """Compute finer headings at cells, (height, width) bool; False where none were unknown."""
        many, (rows, columns) = self._many, np.nonzero(cells & ~self.some & ~self.never)
        unknown = ~many.known[rows // many.side, columns // many.side]
        if not unknown.any():
            return False
        before = many.known.copy()
        many.complete(rows[unknown], columns[unknown])
        self._note(many, many.known & ~before)
        return True

    def cells_around(self, start: Cell) -> NDArray[np.bool_]:
        """Cells that neighbouring ones lead to from a start, and their neighbours."""
        # eight headings at each free cell, none elsewhere: moves then lead to all free neighbours
        bits = np.where(self.some, np.uint8(255), np.uint8(0))
        reached = spread(bits, 8, begin_at(bits, start)) != 0
        padded = np.pad(reached, 1)
        views = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
        return np.asarray(views.any(axis=(2, 3)))


def _may_open(search: RouteSearch, many: SurveyTiles) -> bool:
    """Whether more headings may show a way that a search did not find.

    More headings cannot show one where no neighbouring cells, each drivable with some heading, lead
    from one end to the other: the cells that a longer move passes are neighbours, too.
    """
    (start, goal), on = search.ends, search.on
    if on.survey.stack is not None:
        return True
    never = _over_the_edge(on.terrain, on.survey.grid, on.vehicle)
    passable = _Passable(on.tiles, many, never)
    beside = np.zeros_like(passable.some)
    beside[start] = beside[goal] = True
    passable.look_closer(beside)
    while passable.some[start] and passable.some[goal]:
        beside = passable.cells_around(start)
        if beside[goal]:
            return True
        if not passable.look_closer(beside):
            return False
    return False


def _over_the_edge(terrain: Terrain, grid: Grid, vehicle: Vehicle) -> NDArray[np.bool_]:
    """Cells where the vehicle stands over the terrain's edge with any heading, (height, width)."""
    reach = (1.0 - 1e-6) * min(vehicle.rectangle)
    west, south, east, north = terrain.bounds
    x, y = grid.columns(grid.whole), grid.rows(grid.whole)
    out_x = (x < west + reach) | (x > east - reach)
    out_y = (y < south + reach) | (y > north - reach)
    return np.asarray(out_y[:, None] | out_x[None, :])
