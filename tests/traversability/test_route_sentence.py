"""The sentence on a route: short, what matters most first, and said once."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from terratool.traversability.report import tables, wording
from terratool.traversability.report.drawing import chart
from terratool.traversability.report.lines import as_lines
from terratool.traversability.report.page import as_markdown, as_page
from terratool.traversability.route.results import Extreme
from terratool.traversability.vehicle import Load
from terratool.traversability.verdicts import Reason, Verdict
from tests import reports

WAY = replace(
    reports.CHARGED, all_go_longer=5.05, one_way=True, chance=0.652, slowest=None, load=None,
    against=reports.NO_WAY.barriers[:1],
)  # fmt: skip


def test_what_matters_comes_first() -> None:
    """Length, time and charge; where it is tight, and why; drift; the all-go way; the way back."""
    line = wording.route_line(WAY)
    parts = [
        "There is a way from (105, 202) to (130, 212): 27.3 m, ",
        "82 % of a charge",
        "probability of go 65.2 %.",
        "Least margin 27 % (slip) at ",
        "; caution on ",
        "It drifts 0.8 m downhill unless steered uphill.",
        "An all-go way is 5.05 m longer: --prefer margin finds it.",
        "It is one-way: ",
    ]
    places = [line.index(part) for part in parts]
    assert places == sorted(places)
    # elements and the shares of the energy stand in the route's own section
    assert "/elemTree" not in line and "turns on the spot" not in line


def test_the_reason_of_caution_is_said_once() -> None:
    """Where all caution is by what the least margin is of."""
    assert "of it: slip" in wording.caution_length(WAY)
    assert wording.route_line(WAY).count("slip") == 1
    other = replace(WAY, tightest=Extreme(0.27, reports.place(), Reason.STEP), against=())
    assert "(step)" in wording.route_line(other) and "of it: slip" in wording.route_line(other)


@pytest.mark.parametrize(("drift", "said"), [(0.04, 0), (0.49, 1), (0.51, 2)])
def test_drift_that_is_little_stands_in_the_section_alone(drift: float, said: int) -> None:
    route = replace(WAY, drift=Extreme(drift, reports.place()))
    assert ("drifts" in wording.route_line(route)) + bool(wording.drift(route)) == said
    # a limit of the vehicle makes it matter, however short
    strays = replace(route, drift=Extreme(0.2, reports.place()), strays=True)
    assert "It drifts 0.2 m downhill, more than its maxDrift." in wording.route_line(strays)


def test_what_bars_an_end_is_said_once() -> None:
    """A note says what bars a start or goal, and stands behind the sentence."""
    note = "The vehicle cannot stand at the goal, whatever its heading: step."
    report = reports.report(routes=(replace(reports.NO_WAY, note=note),), reach=None)
    route = report.routes[0]
    assert wording.route_line(route) == f"There is no way from {wording.ends(route)}."
    assert wording.conclusion(report) == f"{wording.route_line(route)} {note}"


def test_a_page_on_one_route_says_its_sentence_once() -> None:
    report = reports.report(routes=(WAY,), verdict=Verdict.CAUTION, reach=None, preview=None)
    begin = "There is a way from (105,"
    assert as_page(report).count(begin) == 1
    assert as_markdown(report).replace("\\", "").count(begin) == 1
    lines = "\n".join(as_lines(report))
    assert lines.count("There is a way") == 1 and "Along it: turns on the spot take" in lines
    # of several each has its own
    both = reports.report(routes=(WAY, reports.NO_WAY), reach=None)
    assert as_page(both).count(begin) == 1


def test_a_page_shows_where_a_way_is_tight() -> None:
    """A pin at the place of the least margin, west of the middle and in the southern half."""
    tight = Extreme(0.27, reports.place(112.0, 203.5), Reason.SLIP)
    page = as_page(reports.report(routes=(replace(WAY, tightest=tight),), reach=None))
    west, south, east, north = reports.GRID.bounds
    left, top = 100 * (112.0 - west) / (east - west), 100 * (north - 203.5) / (north - south)
    assert f'<span class="pin tight" style="left:{left:.2f}%;top:{top:.2f}%"' in page
    assert "T is where the margin of a way is least." in page
    assert "pin tight" not in as_page(reports.report(routes=(reports.NO_WAY,), reach=None))


def test_a_page_says_which_load_it_holds_for() -> None:
    """Where the load differs, tables and routes say so instead."""
    plain = reports.report()
    loaded = replace(plain.vehicle, loads=(Load(40.0, 0.2, 0.0), Load(50.0, 0.3, 0.0)))
    said = f"holds for a mass of {plain.vehicle.mass:.3g}"
    for text in (as_page, as_markdown):
        assert said in text(plain).replace("\u00a0", " ")
        assert "holds for a mass of" not in text(replace(plain, vehicle=loaded))


def test_tables_leave_out_what_only_wheels_have() -> None:
    """No column of stresses where no surface has any, and each of the others."""
    whole = tables.contact(reports.report())
    bare = [
        replace(one, normal_stress=None, shear_stress=None) for one in reports.report().surfaces
    ]
    titles = [column.title for column in whole.columns]
    few = tables.contact(reports.report(surfaces=tuple(bare)))
    gone = {"σmax, kPa", "τmax, kPa"}
    assert gone < set(titles)
    assert [column.title for column in few.columns] == [one for one in titles if one not in gone]
    assert all(len(row) == len(few.columns) for row in few.rows)


@pytest.mark.parametrize("lean", [0.3, 4.0, 13.8, 44.0])
def test_pitch_and_roll_can_be_read(lean: float) -> None:
    """Both ends of the axis and its middle have numbers, and the ends hold all there is."""
    profile = replace(reports.profile(), roll=np.full(200, np.radians(lean)))
    picture = chart(profile, 600)
    upper, lower = (picture.index(title) for title in ("pitch, and roll", "margin to the"))
    texts = re.findall(r'text-anchor="end">(\S+?)</text>', picture[:upper])
    ends = [float(text.replace("−", "-")) for text in texts[-3:]]
    assert ends[0] == -ends[2] and ends[1] == 0.0 and lower > upper
    assert ends[2] >= max(lean, float(np.degrees(np.abs(profile.pitch).max())))
