"""Starts and goals of a request at which the vehicle cannot stand, and places nearby."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from terratool.raster.grid import Window
from terratool.report import numbers
from terratool.traversability.layers import top_near
from terratool.traversability.map_results import cell_of
from terratool.traversability.preparing import PreparedRequest
from terratool.traversability.request import Place, ends_of
from terratool.traversability.route.barriers import BlockedPlace, RouteSite, blocked_place
from terratool.traversability.route.graph import drivable, turnable
from terratool.traversability.route.reach import (
    FloodPlaces,
    begin_in_largest,
    connected_cells,
    heading_bits,
)
from terratool.traversability.route.routes import (
    can_stand,
)
from terratool.traversability.soil import turnings
from terratool.traversability.tiles import SurveyTiles, part_of, survey_window

_AROUND = 32
"""Pixels searched on each side of a blocked place for one where the vehicle can stand."""
_SAME_TOP = 1e-3
"""Difference of heights of a top that are rounded otherwise, m."""


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
    for number, route in enumerate(prepared.request.routes):
        for what, place in zip(("start", "goal"), ends_of(route), strict=True):
            why = _blocked_place(prepared, f"the route's {what}", place, prepared.tiles)
            if why and not (prepared.ways and prepared.ways.stands(place)):
                yield BlockedEnd(number, why)


def first_look(prepared: PreparedRequest) -> Iterator[str]:
    """Sentences on routes and reach that fail as the vehicle cannot stand at a start or goal."""
    start = prepared.request.start
    for end in blocked_ends(prepared):
        yield f"There is no such route. {end.place.note}"
    if start is not None and (why := blocked_start(prepared, start)):
        yield f"Nothing can be reached. {why.note}"


def blocked_start(prepared: PreparedRequest, start: Place) -> BlockedPlace | None:
    """The request's start, if the vehicle cannot stand there; None if it can."""
    tiles = prepared.tiles if prepared.shares_survey else None
    return _blocked_place(prepared, "the place to start from", start, tiles)


def _blocked_place(
    prepared: PreparedRequest, what: str, place: Place, tiles: SurveyTiles | None
) -> BlockedPlace | None:
    """A place, with one nearby, if the vehicle cannot stand there; None if it can.

    The place nearby is searched in the tile that holds the place, or without tiles around it on
    the map's pixels. It lies in the largest connected part there, not on top of the wall that
    bars the vehicle.
    """
    terrain = prepared.terrain
    if tiles is not None:
        row, column = tiles.cell_of(place)
        tiles.complete([row], [column])
        window = tiles.tile_of((row, column))
    else:
        surveyor, grid = prepared.surveyor, prepared.grid
        row, column = surveyor.cell_of(place) or cell_of(grid, *place[:2])
        number, cell = surveyor.stack.split(Window(row, column, 1, 1))
        first = number * surveyor.stack.pitch
        top, left = first + max(cell.row - _AROUND, 0), max(column - _AROUND, 0)
        window = Window(
            top, left, first + min(cell.row + _AROUND + 1, grid.height) - top,
            min(column + _AROUND + 1, grid.width) - left,
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
    begin = begin_in_largest(bits, headings, places=FloodPlaces(turns), radius=radius)
    part = connected_cells(bits, headings, begin, places=FloodPlaces(turns), radius=radius).returned
    if not part.any():
        return why
    rows, columns = np.nonzero(part)
    far = np.hypot(rows + window.row - row, columns + window.column - column)
    nearest = int(np.argmin(far))
    x = float(tiles.survey.grid.columns(window)[columns[nearest]])
    flat = replace(window, row=int(tiles.survey.flat_rows(window.row)))
    y = float(tiles.survey.grid.rows(flat)[rows[nearest]])
    z = float(tiles.survey.heights[at][rows[nearest], columns[nearest]])
    above = terrain.storeys is not None and z - float(top_near(terrain, x, y)) > _SAME_TOP
    near = numbers.place(round(one, 3) for one in ((x, y, z) if above else (x, y)))
    return why._replace(note=f"{why.note} It can stand and move at {near}, near there.")
