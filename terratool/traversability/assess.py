"""From a terrain and a vehicle to a report: figures, map, routes, reach, and one verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain, clip_bounds
from terratool.raster.grid import DEFAULT_PIXELS, Grid, grid_over
from terratool.traversability.map import default_resolution, write_map
from terratool.traversability.results import (
    HEADINGS,
    RANKS,
    MapSummary,
    Reach,
    Reason,
    Route,
    Survey,
    TraversabilityReport,
    Verdict,
)
from terratool.traversability.route.graph import Preference, check_preference
from terratool.traversability.route.paths import check_ground, check_inside
from terratool.traversability.route.routes import (
    MOST_STATES,
    check_route,
    plan_route,
    reach,
    route_grid,
)
from terratool.traversability.soil import ASSUMPTIONS, surface_figures
from terratool.traversability.survey import Surveyor, survey
from terratool.traversability.vehicle import Vehicle

MOST_PIXELS = 1024
"""The longer side of a map that goes into no file has at most so many pixels by default."""

_PICTURE = 720
"""The longer side of the survey for a picture, where no route has one."""
_MOST_PICTURE = 1600
"""A route's survey is good for the picture up to this."""

_MAP = (
    "The map judges the vehicle at rest with its middle at each pixel's centre and each of the "
    "headings; what happens between them is not looked at."
)
_ROUTE = (
    "A route goes from pixel to pixel, backs up, and turns on the spot; its time and energy are "
    "sums over that, without acceleration and with motors that lose nothing."
)

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Request:
    """What is wanted.

    Attributes:
        routes: x and y of the start and of the goal of each.
        waypoints: (n, 2) float64 of each way that is to be checked.
        reachable: the place from which reach is wanted.
        prefer: what routes are to be the least of.
        resolution: of the map, and of routes where that is not too fine; chosen if None.
        bounds: west, south, east, north of the part that counts; all if None.
        headings: at each place.
    """

    routes: tuple[tuple[float, float, float, float], ...] = ()
    waypoints: tuple[NDArray[Any], ...] = ()
    reachable: Point | None = None
    prefer: Preference = "time"
    resolution: float | None = None
    bounds: Bounds | None = None
    headings: int = HEADINGS

    @property
    def travels(self) -> bool:
        """Whether there is anything that needs a survey of the whole at once."""
        return bool(self.routes or self.waypoints or self.reachable)


@dataclass(frozen=True, slots=True)
class PreparedRequest:
    """A request that has been checked, and the grids for it.

    Attributes:
        terrain, vehicle, request: what is wanted.
        pictured: whether the report has a picture.
        grid: of the map.
        route: grid of routes; None where there are none.
        picture: grid of the picture; None for that of the routes, or for none.
        notes: sentences on how they were chosen.
    """

    terrain: Terrain
    vehicle: Vehicle
    request: Request
    pictured: bool
    grid: Grid
    route: Grid | None
    picture: Grid | None
    notes: tuple[str, ...]

    @property
    def pixels(self) -> int:
        """Of all grids together."""
        grids = (self.grid, self.route, self.picture)
        return sum(grid.width * grid.height for grid in grids if grid is not None)


def prepare_assessment(
    terrain: Terrain,
    vehicle: Vehicle,
    request: Request,
    *,
    mapped: bool = False,
    pictured: bool = False,
) -> PreparedRequest:
    """Check a request, and choose its grids, before any long work.

    `mapped` says whether the map goes into a file, `pictured` whether the report has a picture.

    Raises:
        RequestError: what is asked for lies outside the terrain, or makes no sense.
    """
    check_preference(request.prefer)
    grid, why = _map_grid(terrain, vehicle, request, mapped)
    part = clip_bounds(terrain, request.bounds)
    for what, place in _places(request):
        check_inside(terrain, what, place, part, "the bounds that were asked for")
        # waypoints after the first may lie where nothing drives: that is what bars the way
        if not what.startswith("Waypoint") or what == "Waypoint 1":
            check_ground(terrain, what, place)
    notes = [
        f"The map has {grid.width} × {grid.height} pixels of {grid.resolution:.4g} m ({why}), "
        f"each looked at with {request.headings} headings."
    ]
    front, rear, _ = vehicle.rectangle
    if grid.resolution > front + rear:
        notes.append(
            f"Pixels of the map are longer than the vehicle, {front + rear:.3g} m: the ground "
            "between where it stands is not looked at."
        )
    route = None
    if request.travels:
        fits = grid.width * grid.height * request.headings <= MOST_STATES
        if request.resolution is not None and fits:
            route = grid
        else:
            route, note = route_grid(
                terrain, vehicle, headings=request.headings, bounds=request.bounds
            )
            notes.append(
                note
                or f"Routes are looked for on {route.width} × {route.height} pixels of "
                f"{route.resolution:.4g} m."
            )
    picture = None
    if pictured and (route is None or max(route.width, route.height) > _MOST_PICTURE):
        coarse = max(grid.resolution, max(part[2] - part[0], part[3] - part[1]) / _PICTURE)
        shorter = min(part[2] - part[0], part[3] - part[1])
        picture = grid_over(terrain, min(coarse, shorter), request.bounds)
    return PreparedRequest(terrain, vehicle, request, pictured, grid, route, picture, tuple(notes))


def assess(
    prepared: PreparedRequest,
    *,
    name: str = "",
    map_path: str | Path | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
    stack: ExitStack | None = None,
) -> TraversabilityReport:
    """Find out whether, where and why not a vehicle can drive on a terrain.

    Args:
        prepared: what is wanted, from `prepare_assessment`.
        name: of the terrain, for people.
        map_path: a .tif for the map; its numbers go to a second file beside it.
        overwrite: whether files may be there already.
        threads: number of threads; as many as there are processors if None.
        progress: called with the number of pixels that are done, of all its pixels.
        stack: the map's files take their places when it ends, if given.

    Raises:
        RequestError: a figure of a surface is too large, or the vehicle cannot stand at a start.
        WriteError: the map exists already, or cannot be written.
    """
    terrain, vehicle, request = prepared.terrain, prepared.vehicle, prepared.request
    figures = tuple(
        surface_figures(name, surface, vehicle) for name, surface in terrain.surface_types.items()
    )
    surveyor = Surveyor(terrain, vehicle, prepared.grid, request.headings)
    summary = write_map(
        surveyor, map_path, threads=threads, overwrite=overwrite, progress=progress, stack=stack
    )

    def survey_on(grid: Grid | None) -> Survey | None:
        if grid is None:
            return None
        found = survey(terrain, vehicle, grid, headings=request.headings, threads=threads)
        if progress:
            progress(grid.width * grid.height)
        return found

    route_survey, picture = survey_on(prepared.route), survey_on(prepared.picture)
    routes: list[Route] = []
    reached: Reach | None = None
    if route_survey:
        for x0, y0, x1, y1 in request.routes:
            routes.append(
                plan_route(
                    terrain, vehicle, route_survey, (x0, y0), (x1, y1), prefer=request.prefer
                )
            )
        routes += [
            check_route(terrain, vehicle, route_survey, points) for points in request.waypoints
        ]
        if request.reachable is not None:
            reached = reach(terrain, vehicle, route_survey, request.reachable)
    return TraversabilityReport(
        terrain=name,
        descr=terrain.descr,
        bounds=terrain.bounds,
        vehicle=vehicle,
        surfaces=figures,
        summary=summary,
        verdict=verdict_of(summary, routes),
        routes=tuple(routes),
        reach=reached,
        preview=(picture or route_survey) if prepared.pictured else None,
        assumptions=(*ASSUMPTIONS, _MAP, *((_ROUTE,) if request.routes else ())),
        notes=prepared.notes,
    )


def verdict_of(summary: MapSummary, routes: Sequence[Route]) -> Verdict:
    """The verdict of the worst route; without one, of the ground by its best headings.

    Ground that is all alike has that verdict. Ground that is partly go or caution is caution. What
    is left, no-go and unknown, is no-go. Places where the vehicle would stand over the edge of the
    terrain count only where there are no others.
    """
    if routes:
        return max((route.verdict for route in routes), key=RANKS.__getitem__)
    counts = {verdict: count for verdict, count in summary.counts.items() if count}
    inner = counts.get(Verdict.NO_GO, 0) - summary.reasons.get(Reason.EDGE, 0)
    if inner <= 0 and counts.keys() - {Verdict.NO_GO}:
        counts.pop(Verdict.NO_GO, None)
    if len(counts) == 1:
        return next(iter(counts))
    if counts.get(Verdict.GO) or counts.get(Verdict.CAUTION):
        return Verdict.CAUTION
    return Verdict.UNKNOWN if not counts else Verdict.NO_GO


def _map_grid(
    terrain: Terrain, vehicle: Vehicle, request: Request, mapped: bool
) -> tuple[Grid, str]:
    if request.resolution is not None:
        return grid_over(terrain, request.resolution, request.bounds), "as asked"
    most = DEFAULT_PIXELS if mapped else MOST_PIXELS
    resolution, why = default_resolution(terrain, vehicle, request.bounds, most)
    if not mapped and why.endswith("longer side"):
        why = f"{most} on the longer side, as the map goes into no file"
    return grid_over(terrain, resolution, request.bounds), why


def _places(request: Request) -> Iterator[tuple[str, Point]]:
    for x0, y0, x1, y1 in request.routes:
        yield "The route's start", (x0, y0)
        yield "The route's goal", (x1, y1)
    for points in request.waypoints:
        for number, (x, y) in enumerate(points.tolist(), 1):
            yield f"Waypoint {number}", (x, y)
    if request.reachable is not None:
        yield "The place to start from", request.reachable
