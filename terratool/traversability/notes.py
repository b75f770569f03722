"""Notes of a report: how its results were computed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from terratool.field.terrain import Terrain
from terratool.report.numbers import per_cent
from terratool.report.wording import count_of, decks_and_bores, join_words
from terratool.text.display import quote
from terratool.traversability.keep_out import Zone
from terratool.traversability.preparing import PreparedRequest
from terratool.traversability.ranges import (
    Draws,
    share_error,
)
from terratool.traversability.request import Request
from terratool.traversability.route.results import Route
from terratool.traversability.vehicle import Vehicle

_NEARLY_ALL = 0.9
"""Smallest share of judged pixels for which no note says that only some were judged."""


def coverage_note(prepared: PreparedRequest) -> Iterator[str]:
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


def headings_note(prepared: PreparedRequest, routes: Sequence[Route]) -> Iterator[str]:
    """A note where a route takes more headings than the map, which then shows less reached."""
    ways = [way for route in routes for way in (route, route.back) if way is not None]
    most = max((way.headings for way in ways if way.found), default=0)
    if prepared.builder is not None and most > prepared.builder.headings:
        yield (
            f"A route takes {most} headings, the map has {prepared.builder.headings}: it may show "
            "as cut-off or one-way what that route passes. "
            f"With --headings {most} both have the same."
        )


def alternatives_note(request: Request, routes: Sequence[Route]) -> Iterator[str]:
    """Notes on routes that have fewer alternatives than were asked for."""
    for number, route in enumerate(routes, 1):
        count = len(route.alternatives)
        if route.found and route.planned and count < request.alternatives:
            which = f" to route {number}" if len(routes) > 1 else ""
            wanted = count_of(request.alternatives, "alternative")
            differ = "differ" if count > 1 else "differs"
            yield f"Of {wanted}{which}, {count or 'none'} {differ} enough."


def zones_note(zones: Sequence[Zone]) -> Iterator[str]:
    """A note on the zones that the vehicle keeps out of, and how."""
    if zones:
        yield (
            f"It keeps out of {join_words([quote(zone.name) for zone in zones])}: nothing of its "
            "rectangle seen from above enters, with 0.71 pixels to spare, at a heading or between "
            "two."
        )


def storeys_note(terrain: Terrain) -> Iterator[str]:
    """A note on how storeys were judged."""
    if terrain.storeys is not None:
        counts = decks_and_bores(terrain.storeys.decks, terrain.storeys.bores)
        yield (
            f"The terrain has {counts}. All tops are judged and count in shares; decks and "
            "bores have maps of their own."
        )


def headroom_note(terrain: Terrain, vehicle: Vehicle) -> Iterator[str]:
    """A note where headroom below storeys is not judged."""
    if terrain.storeys is not None and vehicle.height is None:
        yield (
            "Headroom is not judged, as the height of the vehicle is not known: what is over it is "
            'passed under, however low. Give the vehicle its "height".'
        )


def sampling_note(draws: Draws | None) -> Iterator[str]:
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


def heights_note(request: Request) -> Iterator[str]:
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


def loads_note(vehicle: Vehicle) -> Iterator[str]:
    """A note on the loads that were judged."""
    if vehicle.loads:
        yield (
            f"The vehicle is judged with {len(vehicle.loads)} loads, the ends of its ranges of "
            "mass and centre of gravity; at each place the worst verdict of all counts."
        )
