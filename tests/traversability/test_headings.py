"""Ways that few headings do not show: they are looked for with more, and this is said."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st

import terratool
from terratool.field.terrain import Terrain
from terratool.raster.grid import grid_over
from terratool.traversability.assess import assess
from terratool.traversability.blocked import first_look
from terratool.traversability.map_results import FINER_HEADINGS
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report import wording
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route import headings
from terratool.traversability.route.headings import WayFinder, finer_headings
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import plan_route, search_route, with_way_back
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import SurveyTiles, survey
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import load_vehicle
from tests.budget import examples
from tests.commands import call
from tests.conftest import terrain_of
from tests.surveys import level

Saved = Callable[..., Path]
Block = tuple[int, int, int, int]
"""Column and row of its south-west corner, columns and rows."""

CELL = 0.1
LONG: dict[str, Any] = {
    "mass": 50, "wheels": {"radius": 0.15, "width": 0.1}, "wheelbase": 2.0, "track": 0.5,
    "cog": {"height": 0.2}, "clearance": 0.15,
}  # fmt: skip
"""2.3 m long and 0.6 m wide: its wheels reach as far as its rectangle."""
FLOOR = {"cohesion": 0, "fricAngle": 35, "sinkage": 0}
CHECKED = jsonschema.Draft202012Validator(terratool.schema("report"))

drive = partial(call, "traversability")


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Vehicle:
    path = tmp_path_factory.mktemp("vehicle") / "long.json"
    path.write_text(json.dumps(LONG))
    return load_vehicle(path)


def walled(columns: int, rows: int, blocks: list[Block]) -> dict[str, Any]:
    """Level ground with walls of a metre, in cells of 0.1 m."""
    return {
        "size": [columns * CELL, rows * CELL],
        "surfTypes": {"floor": FLOOR, "brick": FLOOR},
        "elemTypes": {"flat": {"x": "flat"}},
        "elemTree": {
            "type": "flat", "surface": "floor", "vScale": 0, "cells": [columns, rows],
            "children": [
                {"type": "flat", "surface": "brick", "vScale": 0, "vOffset": 1, "cellX": column,
                 "cellY": row, "span": [wide, high]}
                for column, row, wide, high in blocks
            ],
        },
    }  # fmt: skip


class Bend:
    """A corridor from the south that bends to the east, oblong, turned and mirrored as wanted.

    Attributes:
        definition: of the terrain.
        ends: x and y of a start and of a goal in its two legs.
        walls: what cannot be driven, as a polygon.
    """

    def __init__(self, width: float, turns: int = 0, mirrored: bool = False) -> None:
        wide = round(width / CELL)
        columns, rows = wide + 38, wide + 32  # two cells of wall to the west and the north
        blocks = [
            (0, 0, 2, rows), (2, rows - 2, columns - 2, 2),
            (2 + wide, 0, columns - 2 - wide, rows - 2 - wide),
        ]  # fmt: skip
        ends = [(2 + wide / 2, 18.0), (columns - 18.0, rows - 2 - wide / 2)]
        if mirrored:
            blocks = [(columns - c - w, r, w, h) for c, r, w, h in blocks]
            ends = [(columns - x, y) for x, y in ends]
        for _ in range(turns):
            blocks = [(rows - r - h, c, h, w) for c, r, w, h in blocks]
            ends = [(rows - y, x) for x, y in ends]
            columns, rows = rows, columns
        self.definition = walled(columns, rows, blocks)
        self.ends = tuple((CELL * x, CELL * y) for x, y in ends)
        boxes = [shapely.box(c, r, c + w, r + h) for c, r, w, h in blocks]
        self.walls = shapely.affinity.scale(shapely.union_all(boxes), CELL, CELL, origin=(0, 0))

    @property
    def way(self) -> tuple[float, float, float, float]:
        """The ends as the command takes them."""
        return (*self.ends[0], *self.ends[1])


def slot() -> tuple[Terrain, tuple[float, float], float]:
    """A slot at 22.5° east of north that holds the vehicle: terrain, its middle, its heading."""
    middle, angle = (3.2, 2.9), math.pi / 8
    blocks: list[Block] = []
    for row, column in np.ndindex(58, 64):
        x, y = CELL * (column + 0.5) - middle[0], CELL * (row + 0.5) - middle[1]
        across = abs(x * math.cos(angle) - y * math.sin(angle))
        along = abs(x * math.sin(angle) + y * math.cos(angle))
        if 0.45 < across < 0.62 and along < 1.3:
            blocks.append((column, row, 1, 1))
    return terrain_of(walled(64, 58, blocks)), middle, angle


def looked_for(
    terrain: Terrain, vehicle: Vehicle, *ways: tuple[float, ...], **more: Any
) -> TraversabilityReport:
    """A report on routes alone."""
    request = Request(**({"routes": ways, "mapped": False} | more))
    return assess(prepare_assessment(terrain, vehicle, request))


def rectangles(route: Route, vehicle: Vehicle) -> Iterator[shapely.Polygon]:
    """What the vehicle covers at the samples of a route."""
    front, rear, side = vehicle.rectangle
    own = shapely.box(-side, -rear, side, front)
    assert route.profile is not None
    for x, y, heading in zip(route.profile.x, route.profile.y, route.profile.heading, strict=True):
        turned = shapely.affinity.rotate(own, -heading, origin=(0, 0))
        yield shapely.affinity.translate(turned, x, y)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turns", range(4))
def test_bend_that_8_headings_do_not_show_is_found_with_16(
    long: Vehicle, turns: int, mirrored: bool
) -> None:
    """2.3 × 0.6 m in a bend of 2.1 m; nowhere on its way does it stand in a wall."""
    bend = Bend(2.1, turns, mirrored)
    terrain = terrain_of(bend.definition)
    (few,) = looked_for(terrain, long, bend.way, headings=8).routes
    assert not few.found and few.tried_headings == (8,) and few.headings == 8
    (route,) = looked_for(terrain, long, bend.way).routes
    assert route.found and route.tried_headings == (8, 16) and route.headings == 16
    assert route.ruled_out_headings is None
    assert "It takes 16 headings at each place; 8 do not show it." in wording.route_line(route)
    legs = sum(abs(one - other) for one, other in zip(bend.ends[0], bend.ends[1], strict=True))
    straight = math.dist(*bend.ends)
    assert route.length is not None and straight < route.length < 1.1 * legs
    # as far as walls are known: to a pixel of the ground on which footprints are laid out
    inside = [one.intersection(bend.walls).area for one in rectangles(route, long)]
    assert max(inside) < 0.15 * CELL
    assert any(heading % 45.0 for heading in route.profile.heading)  # type: ignore[union-attr]


def test_narrower_bend_takes_32(long: Vehicle) -> None:
    bend = Bend(1.4)
    (route,) = looked_for(terrain_of(bend.definition), long, bend.way, returns=True).routes
    assert route.found and route.tried_headings == (8, 16, 32) and route.headings == 32
    assert "32 headings at each place; 8 and 16 do not show it." in wording.route_line(route)
    assert route.back is not None and route.back.found
    assert route.back.tried_headings == (8, 16, 32)
    assert wording.route_line(route).count("8 and 16 do not show it.") == 1
    open_ground = plan_route(
        level(9, 9), long, survey(level(9, 9), long, grid_over(level(9, 9), 0.5)), (3, 3), (6, 6)
    )
    only_back = with_way_back(replace(open_ground, tried_headings=(8,)), route.back)
    assert wording.return_line(only_back).endswith("; 8 and 16 do not show it.")
    lost = replace(route.back, found=False, ruled_out_headings=32)
    assert wording.return_line(with_way_back(open_ground, lost)).endswith(", do not change that.")


def test_bend_that_is_too_narrow_stays_so_and_says_what_was_tried(long: Vehicle) -> None:
    """It can stand at each place on its way, but not turn: only the searches themselves show it."""
    bend = Bend(1.3)
    terrain = terrain_of(bend.definition)
    (route,) = looked_for(terrain, long, bend.way).routes
    assert not route.found and route.barriers and route.reached is not None
    assert route.tried_headings == (8, 16, 32) and route.headings == 32
    line = wording.route_line(route)
    assert line.endswith("This holds with 8, 16 and 32 headings at each place.")


@pytest.mark.parametrize(("given", "more"), [(4, True), (16, True), (32, True), (64, False)])
def test_a_number_that_was_given_is_kept(long: Vehicle, given: int, more: bool) -> None:
    bend = Bend(1.2)
    report = looked_for(terrain_of(bend.definition), long, bend.way, headings=given)
    (route,) = report.routes
    assert not route.found and route.tried_headings == (given,) and route.headings == given
    line = wording.route_line(route)
    assert f"This holds with {given} headings at each place" in line
    assert ("more may show a way, up to --headings 64." in line) == more


def test_where_no_heading_helps_this_is_said_and_not_searched_for(
    long: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wall across: only the tiles along it are looked at again, all at once with 32 headings."""
    terrain = terrain_of(walled(400, 60, [(230, 0, 5, 60)]))
    made: list[int] = []
    measure = Surveyor.measure

    def noted(self: Surveyor, window: Any, **options: Any) -> Any:
        made.extend([self.headings] * (window.width * window.height))
        return measure(self, window, **options)

    monkeypatch.setattr(Surveyor, "measure", noted)
    (route,) = looked_for(terrain, long, (2.0, 3.1, 38.0, 3.1), resolution=0.1).routes
    assert not route.found and route.tried_headings == (8,)
    assert route.ruled_out_headings == 32 and route.headings == 8
    assert [bar.bars.split(" ")[0] for bar in route.barriers] == ["/elemTree/children/0"]
    assert "More headings at each place, up to 32, do not change that." in wording.route_line(route)
    assert set(made) == {8, 32} and made.count(32) <= 3 * 64 * 60 < made.count(8)


def test_goal_where_no_heading_fits_is_ruled_out(long: Vehicle) -> None:
    terrain = terrain_of(walled(100, 60, [(70, 20, 10, 10)]))
    (route,) = looked_for(terrain, long, (2.0, 3.0, 7.5, 2.5)).routes
    assert not route.found and route.ruled_out_headings == 32
    assert "cannot stand at the goal, whatever its heading" in route.note


@st.composite
def fields(draw: st.DrawFn) -> tuple[dict[str, Any], tuple[float, float, float, float]]:
    """Blocks on level ground, and two places."""
    whole = st.integers
    blocks = [
        (draw(whole(0, 52)), draw(whole(0, 36)), draw(whole(1, 8)), draw(whole(1, 4)))
        for _ in range(draw(whole(2, 14)))
    ]
    ends = (*(draw(st.floats(0.2, 0.8)) * side for side in (6.0, 4.0, 6.0, 4.0)),)
    return walled(60, 40, blocks), ends


@pytest.mark.slow
@settings(max_examples=examples(40), deadline=None)
@given(field=fields())
def test_answers_are_those_of_searches_over_all(
    field: tuple[dict[str, Any], tuple[float, float, float, float]], long: Vehicle
) -> None:
    """The first number that shows a way; and where more are ruled out, none of them does."""
    definition, (x0, y0, x1, y1) = field
    terrain = terrain_of(definition)
    grid = grid_over(terrain, 0.2)
    tiles = SurveyTiles(Surveyor(terrain, long, grid), threads=1)
    finder = WayFinder(terrain, long, tiles, finer_headings(grid), threads=1)
    route = finder.plan((x0, y0), (x1, y1))
    shown = [
        count
        for count in (8, *FINER_HEADINGS)
        if plan_route(terrain, long, survey(terrain, long, grid, count), (x0, y0), (x1, y1)).found
    ]
    assert route.found == bool(shown)
    if shown:
        assert route.headings == route.tried_headings[-1] == shown[0]
        whole = plan_route(terrain, long, survey(terrain, long, grid, shown[0]), (x0, y0), (x1, y1))
        assert (whole.length, whole.time) == (route.length, route.time)
    assert route.tried_headings in {(8,), (8, 16), (8, 16, 32)}
    assert not (shown and route.ruled_out_headings)
    if not route.found:
        assert route.barriers
        assert (len(route.tried_headings) == 3) == (route.ruled_out_headings is None)


def test_waypoints_are_judged_by_more_headings(long: Vehicle) -> None:
    """Straight through a slot at 22.5°: neither 0° nor 45° fits."""
    terrain, (x, y), angle = slot()
    ahead = np.array([math.sin(angle), math.cos(angle)])
    points = np.array([(x, y) - 0.8 * ahead, (x, y) + 0.8 * ahead])
    grid = grid_over(terrain, 0.1)
    assert not search_route(
        terrain, long, SurveyTiles(Surveyor(terrain, long, grid)), (x, y), (x, y)
    ).has_way
    for asked, tried in ((8, (8,)), (16, (16,)), (None, (8, 16))):
        (route,) = looked_for(
            terrain, long, routes=(), waypoints=(points,), headings=asked, resolution=0.1
        ).routes
        assert route.found == (asked != 8) and not route.planned
        assert route.tried_headings == tried and route.headings == tried[-1]
    blocked = points + np.array([0.3, 0.0])
    (route,) = looked_for(terrain, long, routes=(), waypoints=(blocked,), resolution=0.1).routes
    assert not route.found and route.headings == 32 and route.ruled_out_headings is None
    assert "This holds with 8, 16 and 32 headings" in wording.route_line(route)


def test_place_to_start_from_that_takes_16_headings(long: Vehicle) -> None:
    """The map gets them too, and says why; nothing is said of a place that cannot be stood on."""
    terrain, middle, _ = slot()
    few = prepare_assessment(terrain, long, Request(start=middle, resolution=0.1, headings=8))
    assert [line for line in first_look(few) if "cannot stand" in line]
    planned = prepare_assessment(terrain, long, Request(start=middle, resolution=0.1))
    assert not list(first_look(planned))
    assert "With 8 the vehicle cannot stand at the place to start from." in planned.notes
    report = assess(planned)
    assert report.summary is not None and report.summary.headings == 16
    assert report.reach is not None and report.reach.share > 0.0 and not report.reach.note
    away = prepare_assessment(terrain, long, Request(start=(5.0, 1.5), resolution=0.1))
    assert away.surveyor.headings == 8


def test_route_from_a_place_that_takes_16_headings_is_no_early_no(long: Vehicle) -> None:
    terrain, middle, _ = slot()
    request = Request(routes=((*middle, 5.2, 4.5),), mapped=False)
    planned = prepare_assessment(terrain, long, request)
    assert not list(first_look(planned))
    kept = prepare_assessment(terrain, long, replace(request, headings=8))
    assert [line for line in first_look(kept) if "cannot stand at the route's start" in line]


def test_map_keeps_its_headings_and_says_so(long: Vehicle) -> None:
    bend = Bend(2.1)
    terrain = terrain_of(bend.definition)
    report = looked_for(terrain, long, bend.way, mapped=True)
    assert report.routes[0].headings == 16
    assert report.summary is not None and report.summary.headings == 8
    less = "it may show as cut-off or one-way what that route passes."
    (note,) = (note for note in report.notes if less in note)
    assert "takes 16 headings, the map has 8" in note and "--headings 16" in note
    open_ground = looked_for(terrain_of(walled(80, 60, [])), long, (2, 3, 6, 3), mapped=True)
    assert not any(less in note for note in open_ground.notes)
    for one in (report, open_ground):
        assert any("With more headings" in sentence for sentence in one.assumptions)


def test_ground_that_is_too_large_for_more_headings(
    long: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    bend = Bend(1.4)
    terrain = terrain_of(bend.definition)
    cells = prepare_assessment(terrain, long, Request(routes=(bend.way,), mapped=False)).grid
    for most, tried in ((31, (8, 16)), (15, (8,))):
        monkeypatch.setattr(headings, "MOST_FINER_STATES", most * cells.width * cells.height)
        (route,) = looked_for(terrain, long, bend.way).routes
        assert not route.found and route.tried_headings == tried
        assert "more may show a way, up to --headings 64." in wording.route_line(route)


class Told:
    """Keeps what it is told of."""

    def __init__(self) -> None:
        self.pixels, self.said = 0.0, [""]

    def __call__(self, more: float) -> None:
        self.pixels += more

    def say(self, what: str, _: int | None = None) -> None:
        self.said.append(what)


def test_progress_says_with_how_many_headings(long: Vehicle) -> None:
    told = Told()
    bend = Bend(1.4)
    request = Request(routes=(bend.way,), mapped=False)
    assess(prepare_assessment(terrain_of(bend.definition), long, request), progress=told)
    assert told.said[1] == "looking for ways"
    assert [what for what in told.said if "16" in what] == ["looking for ways with 16 headings"]
    assert "looking for ways with 32 headings" in told.said


def test_command_says_and_writes_it(saved: Saved, tmp_path: Path) -> None:
    bend = Bend(2.1, turns=1)
    site = (saved(bend.definition, "bend.json"), "--vehicle", saved(LONG, "long.json"))
    names = [tmp_path / name for name in ("a.json", "a.md", "a.html", "a.geojson")]
    reports = [part for name in names for part in ("--report", name)]
    ran = drive(*site, "--route", *bend.way, *reports)
    assert (ran.code, ran.err) == (0, "")
    assert "It takes 16 headings at each place; 8 do not show it." in " ".join(ran.out.split())
    document = json.loads(names[0].read_text("utf-8"))
    assert not list(CHECKED.iter_errors(document))
    (route,) = document["routes"]
    assert (route["headings"], route["tried_headings"]) == (16, [8, 16])
    assert route["ruled_out_headings"] is None and document["map"]["headings"] == 8
    for name in names[1:3]:
        assert "16 headings at each place" in name.read_text("utf-8").replace("\u00a0", " ")
    features = json.loads(names[3].read_text("utf-8"))["features"]
    assert [one["properties"]["headings"] for one in features
            if one["properties"]["kind"] == "route"] == [16]  # fmt: skip
    kept = drive(*site, "--route", *bend.way, "--headings", 8, "--json")
    assert kept.code == 1
    document = json.loads(kept.out)
    assert document["routes"][0]["tried_headings"] == [8]
    assert "This holds with 8 headings at each place; more may show a way" in document["sentence"]
