"""The assessment of a vehicle on a terrain: figures, map, routes, reach, and one verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import crew_of
from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.footprints import geojson_head
from terratool.field.relief import relief_bounds
from terratool.field.terrain import Terrain, check_overlap
from terratool.io.geotiff import TILE
from terratool.raster.grid import DEFAULT_PIXELS, Grid, Window, grid_over
from terratool.report.numbers import coordinates, per_cent, pixels
from terratool.report.wording import count_of, join_words
from terratool.tasks import thread_count
from terratool.text.display import quote
from terratool.traversability.height_error import HeightError
from terratool.traversability.keep_out import Zone, check_zones
from terratool.traversability.map import MapBuilder, begin_of, default_resolution, stream_map
from terratool.traversability.map_files import MapExtent, MapFiles, further_bands, refuse_map
from terratool.traversability.ranges import (
    SAMPLES,
    Draws,
    case_samples,
    draw,
    level_chances,
    share_error,
)
from terratool.traversability.results import (
    FINER_HEADINGS,
    RANKS,
    GroundClass,
    MapSummary,
    Preview,
    Reach,
    Route,
    Sampling,
    TraversabilityReport,
    Verdict,
)
from terratool.traversability.route.alternatives import MOST as MOST_ALTERNATIVES
from terratool.traversability.route.barriers import BlockedPlace, RouteSite, blocked_place
from terratool.traversability.route.charge import with_charge
from terratool.traversability.route.graph import Preference, check_preference, drivable, turnable
from terratool.traversability.route.headings import (
    Progress,
    WayFinder,
    finer_headings,
    first_headings,
)
from terratool.traversability.route.paths import cell_of, check_inside
from terratool.traversability.route.reach import begin_in_largest, connected_cells, heading_bits
from terratool.traversability.route.routes import (
    MOST_STATES,
    can_stand,
    reach_of,
    route_grid,
    with_way_back,
)
from terratool.traversability.soil import assumptions_of, surface_figures, turnings
from terratool.traversability.survey import (
    Surveyor,
    Uncertainty,
    parts_of,
    refuse_headings,
)
from terratool.traversability.tiles import SurveyTiles, part_of, survey_window
from terratool.traversability.vehicle import Vehicle

MOST_PIXELS = 1024
"""Most pixels on the longer side of a map that goes into no file, by default."""

_PIXELS_PER_CORRELATION = 2.0
"""Fewest ground pixels per correlation length that show the relief of a rough surface to wheels."""
_AROUND = 32
"""Pixels searched on each side of a blocked place for one where the vehicle can stand."""
_NEARLY_ALL = 0.9
"""Smallest share of judged pixels for which no note says that only some were judged."""

_MAP = (
    "The map judges the vehicle at rest with its middle at each pixel's centre and each of the "
    "headings; what happens between them is not looked at. With more headings more of the ground "
    "may be reached, and less be cut off."
)
"""Assumption of every report on its map."""
_ROUTE = (
    "A route leads by straight legs between pixels, backs up, and turns on the spot, or by arcs if "
    "it is that of a car; its time and energy are sums over that, without acceleration, and with "
    "the vehicle's efficiency. Turns on the spot are those on level ground of the surface under "
    "the vehicle's middle."
)
"""Assumption of reports on routes."""

Point = tuple[float, float]
"""World x and y, m."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request: which map, routes and reach of a vehicle to find out.

    Attributes:
        routes: x and y of the start and of the goal of each route, m.
        waypoints: (n, 2) float64 points of each way that is to be checked, m.
        returns: whether the ways back are wanted, too.
        start: x and y of the place from which reachable ground counts, m; the largest part of the
            ground counts if None.
        prefer: the quantity that routes minimise.
        alternatives: number of further ways that are wanted of each route, 0 to 9; fewer are found
            where no more differ enough.
        resolution: side of a pixel of the map, m, and of routes where that is not too fine; chosen
            if None.
        why: reason for that resolution, in words, for a note.
        keep_out: zones that nothing of the vehicle may enter.
        bounds: west, south, east, north of the part that counts, m; the whole terrain if None.
        headings: number of headings at each place; `first_headings` if None, and more where these
            show no way.
        mapped: whether the whole ground is to be judged; without routes, or with a start, it always
            is.
        threads: number of threads; as many as there are processors if None.
        dask: address of a Dask scheduler whose workers judge the map, or "local" for as many
            processes as threads; None for none.
        samples: number of samples of the soils, where their figures are ranges.
        seed: seed of the generator that draws the samples.
        height_error: standard deviation of the terrain's heights and the length over which their
            errors are correlated, m, for probabilities of go; None for exact heights.
        routes_of, start_of: where routes and start were asked for, in words; empty for the user.
    """

    routes: tuple[tuple[float, float, float, float], ...] = ()
    waypoints: tuple[NDArray[Any], ...] = ()
    returns: bool = False
    start: Point | None = None
    prefer: Preference = "time"
    alternatives: int = 0
    keep_out: tuple[Zone, ...] = ()
    resolution: float | None = None
    why: str = "as asked"
    bounds: Bounds | None = None
    headings: int | None = None
    mapped: bool = True
    threads: int | None = None
    dask: str | None = None
    samples: int = SAMPLES
    seed: int = 0
    height_error: tuple[float, float] | None = None
    routes_of: str = ""
    start_of: str = ""

    @property
    def heights(self) -> HeightError | None:
        """Errors of the terrain's heights; None for exact ones."""
        return None if self.height_error is None else HeightError(*self.height_error)

    @property
    def travels(self) -> bool:
        """Whether there are routes to plan or waypoints to check."""
        return bool(self.routes or self.waypoints)

    @property
    def maps(self) -> bool:
        """Whether the whole ground is judged."""
        return self.mapped or self.start is not None or not self.travels


@dataclass(frozen=True, slots=True)
class PreparedRequest:
    """A checked request, with the surveyor, map builder and route finder that will answer it.

    Attributes:
        terrain: the ground, with all parts written out.
        vehicle: the vehicle that is judged.
        request: the request, checked.
        surveyor: surveyor of the map's pixels, or of the routes' where there is no map.
        builder: builder of the map; None where no map is wanted.
        ways: finder of routes; None where no routes are wanted.
        notes: sentences on how grids and headings were chosen.
        draws: samples of the soils; None where no figures are ranges.
    """

    terrain: Terrain
    vehicle: Vehicle
    request: Request
    surveyor: Surveyor
    builder: MapBuilder | None
    ways: WayFinder | None
    notes: tuple[str, ...]
    draws: Draws | None = None

    @property
    def grid(self) -> Grid:
        """Pixels of the map, or of routes where there is no map."""
        return self.surveyor.grid

    @property
    def tiles(self) -> SurveyTiles | None:
        """Tiles of the survey for routes; None where no routes are wanted."""
        return None if self.ways is None else self.ways.tiles

    @property
    def shares_survey(self) -> bool:
        """Whether map and routes are judged on one grid, by one survey."""
        return self.tiles is not None and self.tiles.survey.grid == self.grid

    @property
    def pixels(self) -> int | None:
        """Number of pixels that will be judged; None where the search for routes decides it."""
        return self.grid.width * self.grid.height if self.builder else None


def check_places(request: Request, extent: Bounds) -> None:
    """Refuse starts, goals and waypoints that no map of a terrain can have.

    Args:
        request: the wanted map, routes and reach.
        extent: west, south, east and north of the terrain, m.

    Raises:
        RequestError: a place lies outside the terrain, or outside the bounds that are asked for.
    """
    parts = {"the terrain": extent}
    if request.bounds is not None:
        check_overlap(request.bounds, extent, "the terrain")
        parts["the bounds that were asked for"] = request.bounds
    for what, place in _places(request):
        check_inside(what, place, parts)


def prepare_assessment(
    terrain: Terrain,
    vehicle: Vehicle,
    request: Request,
    *,
    map_path: str | Path | None = None,
    overwrite: bool = False,
) -> PreparedRequest:
    """Check a request, and choose its grids, before any long work.

    Args:
        terrain: the ground.
        vehicle: the vehicle that is judged.
        request: the wanted map, routes and reach.
        map_path: path of the .tif that the map will be written to; None for no file.
        overwrite: whether the map's files may exist already.

    Raises:
        RequestError: a place lies outside the terrain or its part, an option makes no sense, or the
            terrain is in degrees.
        WriteError: the map exists already, or does not fit on the disk.
        DefinitionError: the map has a CRS, which is unknown.
    """
    terrain.refuse_degrees("A vehicle")
    terrain = terrain.written_out
    check_preference(request.prefer)
    if not 0 <= request.alternatives <= MOST_ALTERNATIVES:
        raise RequestError(
            f"{request.alternatives} alternatives are asked for.",
            f"Give a number from 0 to {MOST_ALTERNATIVES}.",
        )
    if request.headings is not None:
        refuse_headings(request.headings)
    thread_count(request.threads)
    if request.dask is not None and not request.maps:
        raise RequestError("--dask is about maps, but only routes are asked for.", "Add --map OUT.")
    check_places(request, terrain.bounds)
    check_zones(request.keep_out, terrain.bounds)
    draws = draw(terrain, request.samples, request.seed)
    if (off := request.heights) is not None:
        off.check()
    grid, routes, headings, notes = _grids(terrain, vehicle, request, map_path is not None)
    if map_path is not None:
        chances = draws is not None or request.height_error is not None
        further = further_bands(vehicle.feet is not None, chances)
        refuse_map(terrain, MapExtent(grid, further, headings), Path(map_path), overwrite)
    own = uncertainty(terrain, vehicle, draws, request), request.keep_out
    surveyor, shared = Surveyor(terrain, vehicle, grid, headings, *own), routes == grid
    builder = ways = None
    if request.maps:
        keep = shared and map_path is not None
        builder = MapBuilder(terrain, surveyor, keep, turnings(terrain, vehicle))
    if routes is not None:
        on_routes = surveyor if shared else Surveyor(terrain, vehicle, routes, headings, *own)
        take = builder.take if builder and shared else None
        tiles = SurveyTiles(on_routes, threads=request.threads, take=take)
        finer = () if request.headings else finer_headings(routes, headings)
        ways = WayFinder(terrain, vehicle, tiles, finer, threads=request.threads)
    return PreparedRequest(terrain, vehicle, request, surveyor, builder, ways, tuple(notes), draws)


def uncertainty(
    terrain: Terrain, vehicle: Vehicle, draws: Draws | None, request: Request
) -> Uncertainty | None:
    """Sampled soils and errors of heights that a request asks for; None where all is exact."""
    if draws is None and request.height_error is None:
        return None
    fixed = draws or Draws(request.samples, request.seed, {}, ())
    return Uncertainty(case_samples(terrain, vehicle, fixed), request.heights, request.seed)


class _Grids(NamedTuple):
    """The grids of the map and of routes, and their headings.

    Attributes:
        grid: pixels of the map, or of routes where no map is wanted.
        routes: pixels of routes, the map's own where these are fine enough; None without routes.
        headings: number of headings at each place.
        notes: sentences on how grids and headings were chosen.
    """

    grid: Grid
    routes: Grid | None
    headings: int
    notes: list[str]


def chosen_resolution(terrain: Terrain, vehicle: Vehicle, request: Request, written: bool) -> float:
    """The resolution that a request has, or gets, m; `written` says that the map goes into a file.

    Raises:
        RequestError: the bounds lie outside the terrain, or are too large for the pixels, or the
            terrain is in degrees.
    """
    terrain.refuse_degrees("A vehicle")
    return _grids(terrain.written_out, vehicle, request, written).grid.resolution


def _grids(terrain: Terrain, vehicle: Vehicle, request: Request, written: bool) -> _Grids:
    """Choose the grids of the map and of routes, with notes on the choice."""
    routes, note, fewest = None, "", first_headings(vehicle)
    if not request.travels:
        grid, why = _map_grid(terrain, vehicle, request, written)
    elif request.resolution is None:
        routes, note = _route_grid(terrain, vehicle, request)
        grid, why = routes, "chosen for the routes; --resolution chooses another"
    else:
        grid, why = _map_grid(terrain, vehicle, request, written)
        routes = grid
        if grid.width * grid.height * (request.headings or fewest) > MOST_STATES:
            routes, note = _route_grid(terrain, vehicle, request)
            grid = grid if request.maps else routes
    size = pixels(grid.width, grid.height, grid.resolution)
    headings = request.headings or _fewest_headings(terrain, vehicle, request, grid)
    notes = [f"The map has {size} ({why}), each looked at with {headings} headings."]
    if headings != (request.headings or fewest):
        notes.append(f"With {fewest} the vehicle cannot stand at the place to start from.")
    if not request.maps:
        notes = [f"Routes are looked for on {size}."]
    elif routes is not None and routes != grid:
        size = pixels(routes.width, routes.height, routes.resolution)
        notes.append(f"Routes are looked for on {size}.")
    front, rear, _ = vehicle.rectangle
    if grid.resolution > front + rear:
        notes.append(
            f"Pixels of the map are longer than the vehicle, {front + rear:.3g} m: the ground "
            "between where it stands is not looked at."
        )
    ground = grid.resolution / parts_of(vehicle, grid.resolution)
    finest = relief_bounds(terrain.arrays).finest
    if finest < _PIXELS_PER_CORRELATION * ground:
        notes.append(
            f"Rough surfaces have a correlation length of {finest:.4g} m, and the ground is looked "
            f"at every {ground:.4g} m: of their relief that is less than wheels meet."
        )
    return _Grids(grid, routes, headings, [*notes, *([note] if note else [])])


def _fewest_headings(terrain: Terrain, vehicle: Vehicle, request: Request, grid: Grid) -> int:
    """The fewest headings with which the vehicle can stand at the start; as without, if none do."""
    start = request.start
    if start is None:
        return first_headings(vehicle)
    row, column = cell_of(grid, *start)
    fewest = first_headings(vehicle)
    more = finer_headings(grid, fewest) if request.travels else FINER_HEADINGS
    for headings in (fewest, *more):
        surveyor = Surveyor(terrain, vehicle, grid, headings, zones=request.keep_out)
        seen = survey_window(surveyor, Window(row, column, 1, 1))
        if can_stand(terrain, seen, start, (0, 0)):
            return headings
    return fewest


class BlockedEnd(NamedTuple):
    """The start or goal of a route at which the vehicle cannot stand.

    Attributes:
        route: number of the route in the request, from 0.
        place: the place, with sentences on why, and on where it can.
    """

    route: int
    place: BlockedPlace


def blocked_ends(prepared: PreparedRequest) -> Iterator[BlockedEnd]:
    """Yield the starts and goals of routes at which the vehicle cannot stand."""
    for number, (x0, y0, x1, y1) in enumerate(prepared.request.routes):
        for what, place in (("start", (x0, y0)), ("goal", (x1, y1))):
            why = _blocked_place(prepared, f"the route's {what}", place, prepared.tiles)
            if why and not (prepared.ways and prepared.ways.stands(place)):
                yield BlockedEnd(number, why)


def first_look(prepared: PreparedRequest) -> Iterator[str]:
    """Sentences on routes and reach that fail as the vehicle cannot stand at a start or goal."""
    start = prepared.request.start
    for end in blocked_ends(prepared):
        yield f"There is no such route. {end.place.note}"
    if start is not None and (why := _blocked_start(prepared, start)):
        yield f"Nothing can be reached. {why.note}"


def _blocked_start(prepared: PreparedRequest, start: Point) -> BlockedPlace | None:
    """The request's start, if the vehicle cannot stand there; None if it can."""
    tiles = prepared.tiles if prepared.shares_survey else None
    return _blocked_place(prepared, "the place to start from", start, tiles)


def _blocked_place(
    prepared: PreparedRequest, what: str, place: Point, tiles: SurveyTiles | None
) -> BlockedPlace | None:
    """A place, with one nearby, if the vehicle cannot stand there; None if it can.

    The place nearby is searched in the tile that holds the place, or without tiles around it on
    the map's pixels. It lies in the largest connected part there, not on top of the wall that
    bars the vehicle.
    """
    terrain = prepared.terrain
    if tiles is not None:
        row, column = cell_of(tiles.survey.grid, *place)
        tiles.complete([row], [column])
        window = tiles.tile_of((row, column))
    else:
        row, column = cell_of(prepared.grid, *place)
        top, left = max(row - _AROUND, 0), max(column - _AROUND, 0)
        window = Window(
            top, left, min(row + _AROUND + 1, prepared.grid.height) - top,
            min(column + _AROUND + 1, prepared.grid.width) - left,
        )  # fmt: skip
        tiles = SurveyTiles.of(survey_window(prepared.surveyor, window))
        row, column = row - top, column - left
        window = tiles.survey.grid.whole
    if can_stand(terrain, tiles.survey, place, (row, column)):
        return None
    why = blocked_place(RouteSite.of(terrain, prepared.vehicle, tiles), what, place, (row, column))
    bits = heading_bits(drivable(tiles.survey, part_of(window)))
    headings, at = tiles.survey.headings, part_of(window)
    turns = turnable(tiles.survey, turnings(terrain, prepared.vehicle), at)
    radius = prepared.vehicle.turning_radius / tiles.survey.grid.resolution
    begin = begin_in_largest(bits, headings, turns=turns, radius=radius)
    part = connected_cells(bits, headings, begin, turns=turns, radius=radius).returned
    if not part.any():
        return why
    rows, columns = np.nonzero(part)
    far = np.hypot(rows + window.row - row, columns + window.column - column)
    nearest = int(np.argmin(far))
    x = float(tiles.survey.grid.columns(window)[columns[nearest]])
    y = float(tiles.survey.grid.rows(window)[rows[nearest]])
    near = coordinates((round(x, 3), round(y, 3)))
    return why._replace(note=f"{why.note} It can stand and move at {near}, near there.")


def assess(
    prepared: PreparedRequest,
    *,
    name: str = "",
    map_path: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
    stack: ExitStack | None = None,
) -> TraversabilityReport:
    """Find out whether, where and why not a vehicle can drive on a terrain.

    Each window of the ground is judged once, for the map, for routes and for the picture.

    Args:
        prepared: the checked request, from `prepare_assessment`.
        name: name of the terrain, for people.
        map_path: path of a .tif for the map, beside which its other files go; None for no file.
        overwrite: whether the map's files may exist already.
        progress: called with the number of pixels done; its `say` names the step.
        stack: exit stack at whose end the map's files take their places; None for the end of this
            call.

    Raises:
        RequestError: a figure of a surface is too large.
        WriteError: the map exists already, or cannot be written.
    """
    terrain, vehicle, request = prepared.terrain, prepared.vehicle, prepared.request
    figures = tuple(
        surface_figures(name, surface, vehicle) for name, surface in terrain.surface_types.items()
    )
    draws = prepared.draws
    if draws is not None:
        figures = tuple(
            replace(one, chances=level_chances(one.surface, draws, vehicle)) for one in figures
        )
    with nullcontext(stack) if stack else ExitStack() as opened:
        mapped = _judge_map(prepared, map_path, overwrite, progress, opened)
        routes = _plan_routes(prepared, progress)
    return TraversabilityReport(
        terrain=name,
        descr=terrain.descr,
        bounds=terrain.bounds,
        vehicle=vehicle,
        surfaces=figures,
        summary=mapped.summary if mapped else None,
        verdict=verdict_of(mapped.summary if mapped else None, routes),
        routes=routes,
        reach=mapped.reach if mapped else None,
        preview=mapped.preview if mapped else None,
        assumptions=(
            *assumptions_of(vehicle),
            _MAP,
            *((_ROUTE,) if request.routes else ()),
        ),
        notes=(
            f"Computed with the model {vehicle.model}.",
            *prepared.notes,
            *_coverage_note(prepared),
            *_headings_note(prepared, routes),
            *_alternatives_note(prepared.request, routes),
            *_zones_note(request.keep_out),
            *_sampling_note(draws),
            *_heights_note(request),
            *_loads_note(vehicle),
        ),
        geojson=geojson_head(terrain),
        sampling=_sampling(draws, request),
        keep_out=request.keep_out,
    )


def _sampling(draws: Draws | None, request: Request) -> Sampling | None:
    """Record of samples for reports; None where there were none."""
    off = request.heights
    if draws is None and off is None:
        return None
    error = share_error(request.samples)
    ranges = () if draws is None else draws.ranges
    heights = (None, None) if off is None else (off.deviation, off.correlation)
    return Sampling(request.samples, request.seed, error, ranges, *heights)


class _MapResult(NamedTuple):
    """A map in numbers and as a picture, and the reach that was asked for, None if it was not."""

    summary: MapSummary
    reach: Reach | None
    preview: Preview


def _judge_map(
    prepared: PreparedRequest, map_path: str | Path | None, overwrite: bool,
    progress: Progress | None, stack: ExitStack,
) -> _MapResult | None:  # fmt: skip
    """Judge the whole ground, and write its map; None where no map is wanted."""
    terrain, builder, start = prepared.terrain, prepared.builder, prepared.request.start
    if builder is None:
        return None
    threads, files = thread_count(prepared.request.threads), None
    if map_path is not None:
        extent = MapExtent(builder.grid, builder.further, builder.headings)
        files = MapFiles(stack, terrain, extent, Path(map_path), overwrite, threads)
    with crew_of(prepared.request.dask, threads) as crew:
        if prepared.shares_survey:
            assert prepared.tiles is not None
            prepared.tiles.progress = progress
            prepared.tiles.complete(crew=crew)
        else:
            stream_map(prepared.surveyor, builder, files, crew, progress)
    if files and prepared.shares_survey:
        for window in builder.grid.windows(TILE, TILE):
            files.write(window, builder.bands(window))
    tell: Callable[[float], object] | None = None
    if progress:
        pixels, told = builder.ground.size, progress
        told.say("finding what can be reached", pixels)
        tell = lambda more: told(more * pixels)  # noqa: E731
    classes, found = builder.classes(begin_of(builder, start), prepared.vehicle.area, tell)
    if files:
        if progress:
            progress.say("writing the map")
        files.finish(classes, builder.worst_classes(classes), builder.bits)
    reach = None
    if start is not None:
        blocked = None if found.reached.any() else _blocked_start(prepared, start)
        reach = reach_of(terrain, start, found, builder.counted(classes), blocked)
    return _MapResult(builder.summary(classes, found, start), reach, builder.preview(classes))


def _plan_routes(prepared: PreparedRequest, progress: Progress | None) -> tuple[Route, ...]:
    """Plan the requested routes and check the waypoints, each with its way back if wanted."""
    request, finder = prepared.request, prepared.ways
    if finder is None:
        return ()
    finder.progress = progress

    def plan(begin: Point, end: Point) -> Route:
        return finder.plan(begin, end, prefer=request.prefer)

    def beside(route: Route, begin: Point, end: Point) -> Route:
        ends, prefer = (begin, end), request.prefer
        return replace(
            route,
            all_go_longer=finder.all_go_longer(route, *ends, prefer),
            alternatives=finder.alternatives(route, *ends, prefer, request.alternatives),
        )

    check = finder.check
    ways: list[tuple[Callable[..., Route], tuple[Any, ...], tuple[Any, ...]]] = [
        (plan, ((x0, y0), (x1, y1)), ((x1, y1), (x0, y0))) for x0, y0, x1, y1 in request.routes
    ]
    ways += [(check, (points,), (points[::-1],)) for points in request.waypoints]
    found = []
    for find, there, back in ways:
        route = find(*there)
        if find is plan:
            route = beside(route, *there)
        if request.returns and route.found:
            route = with_way_back(route, find(*back))
        found.append(with_charge(route, prepared.vehicle, prepared.terrain))
    return tuple(found)


def _coverage_note(prepared: PreparedRequest) -> Iterator[str]:
    """A note on the share of the ground that was judged, where there is no map."""
    if prepared.builder is not None or prepared.tiles is None:
        return
    known, grid = prepared.tiles.known, prepared.grid
    share = np.count_nonzero(known) / known.size
    if share >= _NEARLY_ALL:
        return
    yield (
        f"Only the ground that matters to routes was looked at, {100.0 * share:.0f} % of "
        f"{grid.width} × {grid.height} pixels; --map, --report and --from judge all of it."
    )


def _headings_note(prepared: PreparedRequest, routes: Sequence[Route]) -> Iterator[str]:
    """A note where a route takes more headings than the map, which then shows less reached."""
    ways = [way for route in routes for way in (route, route.back) if way is not None]
    most = max((way.headings for way in ways if way.found), default=0)
    if prepared.builder is not None and most > prepared.builder.headings:
        yield (
            f"A route takes {most} headings, the map has {prepared.builder.headings}: it may show "
            "as cut-off or one-way what that route passes. "
            f"With --headings {most} both have the same."
        )


def _alternatives_note(request: Request, routes: Sequence[Route]) -> Iterator[str]:
    """Notes on routes that have fewer alternatives than were asked for."""
    for number, route in enumerate(routes, 1):
        count = len(route.alternatives)
        if route.found and route.planned and count < request.alternatives:
            which = f" to route {number}" if len(routes) > 1 else ""
            wanted = count_of(request.alternatives, "alternative")
            differ = "differ" if count > 1 else "differs"
            yield f"Of {wanted}{which}, {count or 'none'} {differ} enough."


def _zones_note(zones: Sequence[Zone]) -> Iterator[str]:
    """A note on the zones that the vehicle keeps out of, and how."""
    if zones:
        yield (
            f"It keeps out of {join_words([quote(zone.name) for zone in zones])}: nothing of its "
            "rectangle seen from above enters, with 0.71 pixels to spare, at a heading or between "
            "two."
        )


def _sampling_note(draws: Draws | None) -> Iterator[str]:
    """A note on how soil figures that are ranges were sampled."""
    if draws is None:
        return
    names = join_words([quote(name) for name in draws.surfaces])
    yield (
        f"Figures of {names} are ranges. Their middles count for verdicts, figures and routes. "
        f"Probabilities are shares of {draws.samples} samples (seed {draws.seed}), off by up to "
        f"{per_cent(draws.error, 2)} 19 times of 20 at worst; as samples are stratified, mostly "
        "by less."
    )


def _heights_note(request: Request) -> Iterator[str]:
    """A note on errors of heights."""
    error = request.heights
    if error is not None:
        yield (
            f"Heights are off by {error.deviation:.4g} m (standard deviation), and their errors "
            f"are correlated over {error.correlation:.4g} m: probabilities of go are shares of "
            f"{request.samples} samples (seed {request.seed}), off by up to "
            f"{per_cent(share_error(request.samples), 2)}. Verdicts and routes are those of the "
            "heights as they are."
        )


def _loads_note(vehicle: Vehicle) -> Iterator[str]:
    """A note on the loads that were judged."""
    if vehicle.loads:
        yield (
            f"The vehicle is judged with {len(vehicle.loads)} loads, the ends of its ranges of "
            "mass and centre of gravity; at each place the worst verdict of all counts."
        )


def verdict_of(summary: MapSummary | None, routes: Sequence[Route]) -> Verdict:
    """The verdict of the worst route; without routes, of the ground.

    Ground that is all go is go. Ground with connected pixels that are go or caution is
    caution. Other ground is no-go, or unknown if all of it is unknown. Pixels at the edge of the
    terrain, which only its end bars, count only where there are no others.
    """
    if routes:
        return max((route.verdict for route in routes), key=RANKS.__getitem__)
    assert summary is not None
    counts = {ground for ground, count in summary.counts.items() if count}
    inner = counts - {GroundClass.EDGE} if counts != {GroundClass.EDGE} else {GroundClass.NO_GO}
    if inner == {GroundClass.GO}:
        return Verdict.GO
    if inner & {GroundClass.GO, GroundClass.CAUTION}:
        return Verdict.CAUTION
    return Verdict.UNKNOWN if inner <= {GroundClass.UNKNOWN} else Verdict.NO_GO


def _route_grid(terrain: Terrain, vehicle: Vehicle, request: Request) -> tuple[Grid, str]:
    """The pixels for routes, and a note on their size."""
    return route_grid(
        terrain,
        vehicle,
        headings=request.headings or first_headings(vehicle),
        bounds=request.bounds,
    )


def _map_grid(
    terrain: Terrain, vehicle: Vehicle, request: Request, written: bool
) -> tuple[Grid, str]:
    """The pixels of the map, and in words why they have their size."""
    if request.resolution is not None:
        return grid_over(terrain, request.resolution, request.bounds), request.why
    most = DEFAULT_PIXELS if written else MOST_PIXELS
    resolution, why = default_resolution(terrain, vehicle, request.bounds, most)
    if not written and why.endswith("longer side"):
        why = f"{most} on the longer side, as the map goes into no file"
    return grid_over(terrain, resolution, request.bounds), why


def _places(request: Request) -> Iterator[tuple[str, Point]]:
    """All places of a request, x and y in m, each with its name for messages."""
    of = f" of {request.routes_of}" if request.routes_of else ""
    for x0, y0, x1, y1 in request.routes:
        yield f"The route's start{of}", (x0, y0)
        yield f"The route's goal{of}", (x1, y1)
    for points in request.waypoints:
        for number, (x, y) in enumerate(points.tolist(), 1):
            yield f"Waypoint {number}", (x, y)
    if request.start is not None:
        of = f" of {request.start_of}" if request.start_of else ""
        yield f"The place to start from{of}", request.start
