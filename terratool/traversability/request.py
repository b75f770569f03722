"""Requests: which map, routes and reach of a vehicle are wanted."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.terrain import check_overlap
from terratool.traversability.height_error import HeightError
from terratool.traversability.keep_out import Zone
from terratool.traversability.ranges import (
    SAMPLES,
)
from terratool.traversability.route.graph import Preference
from terratool.traversability.route.paths import check_inside

Point = tuple[float, float] | tuple[float, float, float]
"""World x and y, m, and a height on a storey; without one the ground is meant."""

RouteLine = tuple[float, float, float, float] | tuple[float, float, float, float, float, float]
"""Start and goal of a route, x and y each, or x, y and a height; NaN for the ground."""

Place = tuple[float, ...]
"""A place as `Point`."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request: which map, routes and reach of a vehicle to find out.

    Attributes:
        routes: x and y of the start and of the goal of each route, m; each with the height of the
            storey that is meant, or without for the ground.
        waypoints: float64 points of each way that is to be checked, m: (n, 2), or (n, 3) with the
            height of the floor that each is on.
        returns: whether the ways back are wanted, too.
        start: x and y of the place from which reachable ground counts, m, and the height of its
            storey, if it is on one; the largest part of the ground counts if None.
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

    routes: tuple[RouteLine, ...] = ()
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


def ends_of(route: RouteLine) -> tuple[Place, Place]:
    """Start and goal of a route, without heights that are NaN."""
    half = len(route) // 2
    start, goal = (
        end[:2] if len(end) > 2 and math.isnan(end[2]) else end
        for end in (route[:half], route[half:])
    )
    return start, goal


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


def _places(request: Request) -> Iterator[tuple[str, Place]]:
    """All places of a request, x and y in m, each with its name for messages."""
    of = f" of {request.routes_of}" if request.routes_of else ""
    for route in request.routes:
        for what, place in zip(("start", "goal"), ends_of(route), strict=True):
            yield f"The route's {what}{of}", place
    for points in request.waypoints:
        for number, place in enumerate(points.tolist(), 1):
            yield f"Waypoint {number}", tuple(place)
    if request.start is not None:
        of = f" of {request.start_of}" if request.start_of else ""
        yield f"The place to start from{of}", request.start
