"""Pages on terrains with storeys: a picture of each sheet, and on each what lies on it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report.page import as_page
from terratool.traversability.report.wording import counted_from_line
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from tests.conftest import terrain_of
from tests.traversability.test_storey_ruts import cart, dock


def judged(**wanted: Any) -> TraversabilityReport:
    request = Request(resolution=0.1, headings=8, **wanted)
    return assess(prepare_assessment(terrain_of(dock()), cart(), request))


@pytest.mark.slow
def test_each_picture_has_the_pins_and_ways_of_its_tops() -> None:
    """From the ground to the floor over it; the way is faint where another picture has it."""
    report = judged(routes=((0.8, 8.0, 0.0, 12.0, 4.5, 0.9),), mapped=True)
    assert report.preview is not None and report.routes[0].found
    ground, (deck,) = report.preview, report.preview.storeys
    x, y = (axis(deck.grid.whole) for axis in (deck.grid.columns, deck.grid.rows))
    covered = ((x > 2) & (x < 14)) & ((y > 3) & (y < 6))[:, None]
    np.testing.assert_array_equal(np.isfinite(deck.heights), covered)
    # where the ramp is not thick enough to be off the ground both have its top
    assert np.nanmax(ground.heights) < 0.1 and np.nanmax(deck.heights) == np.float32(0.9)
    page = as_page(report)
    figures = re.findall(r"<figure>.*?</figure>", page, re.DOTALL)
    pins = [re.findall(r'class="pin" [^>]*>(\w)<', one) for one in figures]
    assert len(figures) >= 2 and pins[:2] == [["A"], ["B"]]
    ways = [
        re.findall(r'<polyline class="(way[^"]*)" points="([^"]*)"', one) for one in figures[:2]
    ]
    styles = [[style.split() for style, _ in found] for found in ways]
    assert styles == [[["way"], ["way", "faint"]], [["way", "faint"], ["way"]]]
    # in thousandths of the picture, 18 m: the ramp begins at x = 2 m, and is 0.1 m high at 2.67 m
    ends = [float(found[0][1].split()[-1].split(",")[0]) for found in ways]
    assert ends == pytest.approx([1000 * 2.67 / 18, 1000 * 2 / 18], abs=12)


@pytest.mark.slow
def test_what_is_reached_from_a_floor_is_outlined_on_each_picture() -> None:
    report = judged(start=(12.0, 4.5, 0.9))
    assert report.reach is not None and report.preview is not None
    (deck,) = report.preview.storeys
    assert report.reach.cells.shape == (report.summary.grid.height, report.summary.grid.width)
    assert deck.reached is not None and report.preview.reached is not None
    assert 0.5 < deck.reached[np.isfinite(deck.heights)].mean() < 1.0
    assert not deck.reached[np.isnan(deck.heights)].any()
    assert as_page(report).count("<figure>") >= 2


@pytest.mark.slow
def test_the_place_that_is_counted_from_can_be_given_to_from() -> None:
    """X Y,Z where it is on a floor that is not the lowest."""
    report = judged(start=None)
    assert report.summary is not None and report.summary.largest is not None
    largest = report.summary.largest
    line = counted_from_line(report)
    place = re.search(r"--from (\S+) (\S+)\.$", line)
    assert place is not None
    words = [float(place[1]), *map(float, place[2].split(","))]
    assert words == pytest.approx([round(one, 3) for one in largest.place])
