"""The assessment of a vehicle on a terrain: figures, map, routes, reach, and one verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.cluster import crew_of
from terratool.field.footprints import geojson_head
from terratool.tasks import thread_count
from terratool.traversability.blocked import blocked_start
from terratool.traversability.map import begin_of, stream_map
from terratool.traversability.map_files import MapFiles, storey_paths
from terratool.traversability.map_results import MapSummary, Preview
from terratool.traversability.notes import (
    alternatives_note,
    coverage_note,
    headings_note,
    headroom_note,
    heights_note,
    loads_note,
    sampling_note,
    storeys_note,
    zones_note,
)
from terratool.traversability.preparing import PreparedRequest
from terratool.traversability.ranges import (
    Draws,
    level_chances,
    share_error,
)
from terratool.traversability.request import Place, Request, ends_of
from terratool.traversability.results import Sampling, TraversabilityReport
from terratool.traversability.route.charge import with_charge
from terratool.traversability.route.headings import (
    Progress,
)
from terratool.traversability.route.results import Reach, Route
from terratool.traversability.route.routes import (
    reach_of,
    with_way_back,
)
from terratool.traversability.soil import assumptions_of, surface_figures
from terratool.traversability.verdicts import RANKS, GroundClass, Verdict

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
            *terrain.hidden,
            *prepared.notes,
            *coverage_note(prepared),
            *headings_note(prepared, routes),
            *alternatives_note(prepared.request, routes),
            *zones_note(request.keep_out),
            *storeys_note(terrain),
            *headroom_note(terrain, vehicle),
            *sampling_note(draws),
            *heights_note(request),
            *loads_note(vehicle),
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
    sheets: list[MapFiles] = []
    if map_path is not None:
        sheets = [
            MapFiles(stack, terrain, prepared.extent, path, overwrite, threads)
            for path in storey_paths(map_path, builder.stack.sheets)
        ]
        files = sheets[0] if builder.own is None else None
    with crew_of(prepared.request.dask, threads) as crew:
        if prepared.shares_survey:
            assert prepared.tiles is not None
            prepared.tiles.progress = progress
            prepared.tiles.complete(crew=crew)
        else:
            stream_map(prepared.surveyor, builder, files, crew, progress)
    if sheets and (prepared.shares_survey or builder.own is not None):
        for number, one in enumerate(sheets):
            builder.write(one, number)
    tell: Callable[[float], object] | None = None
    if progress:
        pixels, told = builder.ground.size, progress
        told.say("finding what can be reached", pixels)
        tell = lambda more: told(more * pixels)  # noqa: E731
    classes, found = builder.classes(begin_of(builder, start), prepared.vehicle.area, tell)
    if sheets and progress:
        progress.say("writing the map")
    for number, one in enumerate(sheets):
        planes = classes, builder.worst_classes(classes), builder.bits
        one.finish(*(builder.of_sheet(plane, number) for plane in planes))
    reach = None
    if start is not None:
        blocked = None if found.reached.any() else blocked_start(prepared, start)
        reach = reach_of(terrain, start, found, builder.counted(classes), blocked)
        reach = replace(reach, cells=builder.of_sheet(reach.cells, 0))
    reached = None if reach is None else found.reached
    preview = builder.preview(classes, reached)
    return _MapResult(builder.summary(classes, found, start), reach, preview)


def _plan_routes(prepared: PreparedRequest, progress: Progress | None) -> tuple[Route, ...]:
    """Plan the requested routes and check the waypoints, each with its way back if wanted."""
    request, finder = prepared.request, prepared.ways
    if finder is None:
        return ()
    finder.progress = progress

    def plan(begin: Place, end: Place) -> Route:
        return finder.plan(begin, end, prefer=request.prefer)

    def beside(route: Route, begin: Place, end: Place) -> Route:
        ends, prefer = (begin, end), request.prefer
        return replace(
            route,
            all_go_longer=finder.all_go_longer(route, *ends, prefer),
            alternatives=finder.alternatives(route, *ends, prefer, request.alternatives),
        )

    found = []
    for line in request.routes:
        there = ends_of(line)
        route = beside(plan(*there), *there)
        if request.returns and route.found:
            route = with_way_back(route, plan(*there[::-1]))
        found.append(route)
    for points in request.waypoints:
        route = finder.check(points)
        if request.returns and route.found:
            route = with_way_back(route, finder.check(_from_goal(route, points)))
        found.append(route)
    return tuple(with_charge(route, prepared.vehicle, prepared.terrain) for route in found)


def _from_goal(route: Route, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Waypoints back, from the floor to which a checked route leads, where they name none."""
    if points.shape[1] > 2:
        return points[::-1]
    heights = np.full(len(points), np.nan)
    heights[0] = math.nan if route.goal.height is None else route.goal.height
    return np.column_stack([points[::-1], heights])


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
