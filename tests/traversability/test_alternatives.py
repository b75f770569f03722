"""Alternatives to a route: each differs truly, costs little more, and can be driven."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report import wording
from terratool.traversability.report.document import as_dict
from terratool.traversability.report.page import as_page
from terratool.traversability.report.routes import route_features
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.alternatives import STRETCH
from terratool.traversability.route.headings import WayFinder
from terratool.traversability.route.results import Route
from terratool.traversability.route.routes import plan_route
from terratool.traversability.tiles import SurveyTiles
from terratool.traversability.verdicts import Verdict
from tests.conftest import terrain_of
from tests.surveys import ROVER, drawn, level

FLOOR = {"cohesion": 0, "fricAngle": 35, "sinkage": 0}


def yard(blocks: list[tuple[int, int, int, int]], columns: int = 60, rows: int = 40) -> Terrain:
    """Level ground of cells of 0.25 m with blocks a metre high: column, row, width, height."""
    return terrain_of(
        {
            "size": [columns / 4, rows / 4], "surfTypes": {"floor": FLOOR},
            "elemTypes": {"flat": {"x": "flat"}},
            "elemTree": {
                "type": "flat", "vScale": 0, "surface": "floor", "cells": [columns, rows],
                "children": [
                    {"type": "flat", "vScale": 0, "vOffset": 1, "cellX": x, "cellY": y,
                     "span": [width, height]}
                    for x, y, width, height in blocks
                ],
            },
        }
    )  # fmt: skip


def asked(terrain: Terrain, **options: Any) -> TraversabilityReport:
    return assess(prepare_assessment(terrain, ROVER, Request(mapped=False, **options)))


ISLANDS = [(20, 6, 20, 10), (20, 24, 20, 10)]
"""Two islands: below, between and above them are three ways from west to east."""


def height_at(route: Route, x: float) -> float:
    """Where a way crosses a line from south to north, y."""
    assert route.profile is not None
    return float(np.interp(x, route.profile.x, route.profile.y))


@pytest.mark.slow
def test_three_ways_round_two_islands() -> None:
    """Between them, below and above: no more, and each crosses elsewhere."""
    report = asked(yard(ISLANDS), routes=((1.5, 5.0, 13.5, 5.0),), alternatives=5)
    (route,) = report.routes
    assert len(route.alternatives) == 2 and route.shared is None
    crossings = sorted(height_at(one, 7.5) for one in (route, *route.alternatives))
    assert crossings[0] < 1.5 and 4.0 < crossings[1] < 6.0 and crossings[2] > 8.5
    assert any(note == "Of 5 alternatives, 2 differ enough." for note in report.notes)
    for way in route.alternatives:
        assert way.found and way.verdict == Verdict.GO and not way.alternatives
        assert way.shared is not None and way.shared <= 0.6
        assert way.length is not None and route.length is not None
        assert route.length <= way.length and way.time <= STRETCH * route.time  # type: ignore[operator]
        assert way.profile is not None
        assert not np.any(way.profile.verdict >= Verdict.NO_GO)
        ends = [(way.profile.x[n], way.profile.y[n]) for n in (0, -1)]
        assert ends == [(route.profile.x[n], route.profile.y[n]) for n in (0, -1)]  # type: ignore[union-attr]


def test_the_second_way_is_the_shortest_on_the_other_side() -> None:
    """One island off the middle: the alternative is as long as the route with that side walled."""
    blocks = [(20, 10, 20, 16)]
    (route,) = asked(yard(blocks), routes=((1.5, 5.0, 13.5, 5.0),), alternatives=1).routes
    wall = (30, 0, 1, 10) if height_at(route, 7.5) < 5.0 else (30, 26, 1, 14)
    (other,) = asked(yard([*blocks, wall]), routes=((1.5, 5.0, 13.5, 5.0),)).routes
    (way,) = route.alternatives
    assert way.length == pytest.approx(other.length, rel=0.01)


def test_a_way_that_shares_most_of_the_best_is_none() -> None:
    """A chamber with a block in the middle of a long lane: two ways round it, else the same."""
    lane = [(x, y, 42, height) for x in (0, 58) for y, height in ((0, 12), (17, 13))]
    terrain = yard([*lane, (46, 9, 8, 11)], 100, 30)
    report = asked(terrain, routes=((1.0, 3.9, 24.0, 3.9),), alternatives=1)
    (route,) = report.routes
    assert route.found and abs(height_at(route, 12.5) - 3.9) > 1.3
    assert route.alternatives == ()


def test_open_ground_has_no_other_way() -> None:
    """Whatever is paid beside the line, pulled straight it is the line again."""
    report = asked(yard([]), routes=((1.5, 5.0, 13.5, 6.0),), alternatives=2)
    assert report.routes[0].alternatives == ()
    assert "Of 2 alternatives, none differs enough." in report.notes


def test_a_way_that_is_much_longer_is_none() -> None:
    """Round a wall that nearly closes the ground, on the far side, takes more than half again."""
    blocks = [(30, 2, 1, 16), (30, 24, 1, 16)]
    (route,) = asked(yard(blocks), routes=((6.5, 5.2, 8.6, 5.2),), alternatives=3).routes
    assert route.found and route.alternatives == ()


def test_without_a_way_there_are_none_and_nothing_is_said() -> None:
    report = asked(yard([(30, 0, 1, 40)]), routes=((1.5, 5.0, 13.5, 5.0),), alternatives=2)
    assert not report.routes[0].found and report.routes[0].alternatives == ()
    assert not any("alternatives" in note for note in report.notes)


@pytest.mark.parametrize("count", [-1, 10])
def test_numbers_out_of_range_are_refused(count: int) -> None:
    with pytest.raises(RequestError, match=f"^{count} alternatives are asked for") as caught:
        asked(yard([]), routes=((1.5, 5.0, 13.5, 5.0),), alternatives=count)
    assert caught.value.hint == "Give a number from 0 to 9."


def test_reports_have_them(tmp_path: Path) -> None:
    """JSON, GeoJSON, page and text; the page draws them under the route, and thinner."""
    request = Request(routes=((1.5, 5.0, 13.5, 5.0),), alternatives=2)
    report = assess(prepare_assessment(yard(ISLANDS), ROVER, request))
    (route,) = report.routes
    (keys,) = json.loads(json.dumps(as_dict(report)))["routes"]
    assert [one["shared"] for one in keys["alternatives"]] == pytest.approx(
        [way.shared for way in route.alternatives]
    )
    assert keys["alternatives"][0]["profile"]["x"][0] == pytest.approx(route.profile.x[0])  # type: ignore[union-attr]
    kinds = [one["properties"] for one in route_features([route])]
    lines = [one.get("alternative") for one in kinds if one["kind"] == "route"]
    assert lines == [None, 1, 2]
    page = as_page(report)
    maps = page.count('class="way"')
    assert maps and page.count('class="way thin"') == 2 * maps
    assert page.index('class="way thin"') < page.index('class="way"')
    for way in route.alternatives:
        assert wording.alternative(way).replace(" ", "\u00a0") in page.replace(" ", "\u00a0")


PUDDLE = """
.......
.ccccc.
.......
"""


def finder(picture: str, **planes: Any) -> WayFinder:
    survey = drawn(picture, **planes)
    terrain = level(survey.grid.width, survey.grid.height)
    return WayFinder(terrain, ROVER, SurveyTiles.of(survey))


def test_the_headline_names_what_margin_finds() -> None:
    """Through the puddle, or round it: as much longer as `--prefer margin` shows."""
    ways, ends = finder(PUDDLE), ((0.5, 1.5), (6.5, 1.5))
    route = ways.plan(*ends, prefer="length")
    more = ways.all_go_longer(route, *ends, "length")
    wide = plan_route(level(7, 3), ROVER, drawn(PUDDLE), *ends, "margin")
    assert route.verdict == Verdict.CAUTION and wide.verdict == Verdict.GO
    assert more == pytest.approx(wide.length - route.length) and more > 0.5  # type: ignore[operator]
    line = wording.route_line(replace(route, all_go_longer=more))
    assert f"An all-go way is {more:.3g}" in line.replace("\u00a0", " ")
    assert line.endswith("longer: --prefer margin finds it.")


@pytest.mark.parametrize(
    ("picture", "prefer"),
    [
        (PUDDLE.replace("c", "."), "length"),  # go already
        (PUDDLE, "margin"),
        (PUDDLE.replace(".", "c"), "length"),  # caution everywhere
        ("\n...c...\n...c...\n...c...\n", "time"),
    ],
)
def test_nothing_is_said_of_ways_that_are_not_there(picture: str, prefer: Any) -> None:
    ways, ends = finder(picture), ((0.5, 1.5), (6.5, 1.5))
    route = ways.plan(*ends, prefer=prefer)
    assert route.found and ways.all_go_longer(route, *ends, prefer) is None
    assert "all-go" not in wording.route_line(route)


def test_the_headline_does_not_look_all_over_the_ground() -> None:
    """A band of caution across, open at its far end: beside the start it is said, not from afar."""
    band = "\n".join(
        ["." * 210] * 15 + ["c" * 180 + "." * 30] * 40 + ["." * 210] * 15
    )  # fmt: skip
    for east, said in ((5.5, False), (170.5, True)):
        ways, ends = finder(band, utilisation=0.05), ((east, 5.5), (east, 64.5))
        route = ways.plan(*ends, prefer="length")
        assert route.verdict == Verdict.CAUTION
        assert (ways.all_go_longer(route, *ends, "length") is not None) == said
        wide = ways.plan(*ends, prefer="margin")
        assert wide.verdict == Verdict.GO


def test_a_way_that_is_go_is_not_searched_for_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    ways, ends = finder(PUDDLE.replace("c", ".")), ((0.5, 1.5), (6.5, 1.5))
    route = ways.plan(*ends)
    monkeypatch.setattr("terratool.traversability.route.headings.search_route", None)
    assert ways.all_go_longer(route, *ends) is None
