"""Requests checked, and their grids chosen, before any long work."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from terratool.errors import RequestError
from terratool.field.relief import relief_bounds
from terratool.field.terrain import Terrain
from terratool.raster.grid import DEFAULT_PIXELS, Grid, Window, grid_over
from terratool.report.numbers import pixels
from terratool.tasks import thread_count
from terratool.traversability.fineness import parts_of
from terratool.traversability.keep_out import check_zones
from terratool.traversability.layers import sheets_of
from terratool.traversability.map import MapBuilder, default_resolution
from terratool.traversability.map_files import (
    MapExtent,
    further_bands,
    refuse_map,
    storey_paths,
)
from terratool.traversability.map_results import FINER_HEADINGS, cell_of
from terratool.traversability.ranges import (
    Draws,
    case_samples,
    draw,
)
from terratool.traversability.request import Request, check_places
from terratool.traversability.route.alternatives import MOST as MOST_ALTERNATIVES
from terratool.traversability.route.graph import check_preference
from terratool.traversability.route.headings import (
    WayFinder,
    finer_headings,
    first_headings,
)
from terratool.traversability.route.routes import (
    MOST_STATES,
    can_stand,
    route_grid,
)
from terratool.traversability.soil import turnings
from terratool.traversability.survey import Surveyor, Uncertainty, refuse_headings
from terratool.traversability.tiles import SurveyTiles, survey_window
from terratool.traversability.vehicle import Vehicle

MOST_PIXELS = 1024
"""Most pixels on the longer side of a map that goes into no file, by default."""

_PIXELS_PER_CORRELATION = 2.0
"""Fewest ground pixels per correlation length that show the relief of a rough surface to wheels."""


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
    def extent(self) -> MapExtent:
        """Pixels, bands and headings of the map."""
        walks, sampled = self.vehicle.feet is not None, self.surveyor.uncertainty is not None
        roofed = self.terrain.storeys is not None
        further = further_bands(walks=walks, sampled=sampled, roofed=roofed)
        return MapExtent(self.grid, further, self.surveyor.headings)

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
        sampled = draws is not None or request.height_error is not None
        roofed, sheets = terrain.storeys is not None, sheets_of(terrain)
        further = further_bands(walks=vehicle.feet is not None, sampled=sampled, roofed=roofed)
        for path in storey_paths(map_path, sheets):
            refuse_map(terrain, MapExtent(grid, further, headings), path, overwrite)
    own = uncertainty(terrain, vehicle, draws, request), request.keep_out
    surveyor, shared = Surveyor(terrain, vehicle, grid, headings, *own), routes == grid
    builder = ways = None
    if request.maps:
        keep = (shared or terrain.storeys is not None) and map_path is not None
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
    fewest = first_headings(vehicle)
    more = finer_headings(grid, fewest) if request.travels else FINER_HEADINGS
    for headings in (fewest, *more):
        surveyor = Surveyor(terrain, vehicle, grid, headings, zones=request.keep_out)
        row, column = surveyor.cell_of(start) or cell_of(grid, *start[:2])
        seen = survey_window(surveyor, Window(row, column, 1, 1))
        if can_stand(terrain, seen, start, (0, 0)):
            return headings
    return fewest


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
