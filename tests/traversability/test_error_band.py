"""The error band of climbs, the margin that keeps it in reserve, and vehicles that do not move."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terratool.definition.model import Surface
from terratool.raster.grid import Grid
from terratool.traversability.report.curves import as_svg, slip_lines
from terratool.traversability.report.document import as_dict
from terratool.traversability.report.lines import as_lines
from terratool.traversability.report.page import as_markdown, as_page
from terratool.traversability.soil import on_the_safe_side, surface_figures
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Margins, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from terratool.traversability.wheel import ERROR_BAND
from tests.commands import call
from tests.conftest import terrain_of
from tests.reports import report as report_of

ROOT = Path(__file__).parents[2]
HUSKY = ROOT / "samples/vehicles/husky-a200.json"
ROVER = Vehicle(
    Wheel(0.2, 0.1), (Axle(0.4), Axle(-0.4)), mass=40.0, gravity=10.0, track_width=0.8,
    cog_height=0.1, clearance=0.15,
)  # fmt: skip
SAND = Surface(cohesion=1.0, fric_angle=30.0, sinkage=0.1, shear_modulus=0.02)
ROCK = Surface(cohesion=0.0, fric_angle=30.0, sinkage=0.0)
BOG = Surface(cohesion=0.0, fric_angle=2.0, sinkage=0.4, shear_modulus=0.02)


def test_the_band_is_that_of_the_softness() -> None:
    """100 N on 0.1 m/kN sink in by 10 mm: θ0 = acos 0.95 = 0.3176, and 5° (1 − exp(−3.176))."""
    found = surface_figures("sand", SAND, ROVER)
    band = 5 * (1 - math.exp(-3.176))
    assert math.degrees(found.climb_error or 0.0) == pytest.approx(band, rel=1e-4)
    assert math.degrees(ERROR_BAND) == pytest.approx(5.0)
    assert surface_figures("rock", ROCK, ROVER).climb_error == 0.0
    assert surface_figures("sand", SAND, ROVER.by_model("paper")).climb_error == 0.0


def test_the_margin_takes_the_band_off() -> None:
    """Off the climb and the cross-slope on soil, and off nothing on rock; then no band is left."""
    safe = on_the_safe_side(ROVER)
    plain, kept = (surface_figures("sand", SAND, one) for one in (ROVER, safe))
    for name in ("climb", "cross_slope"):
        assert getattr(kept, name) == pytest.approx(getattr(plain, name) - plain.climb_error)
    assert kept.climb_error == 0.0
    rock = [surface_figures("rock", ROCK, one).climb for one in (ROVER, safe)]
    assert rock[0] == rock[1]


@pytest.mark.parametrize(("below", "drives"), [(1.0, False), (6.0, True)])
def test_the_map_keeps_it_too(below: float, drives: bool) -> None:
    """On a slope a little below the climb, and on one below that by more than the band."""
    plain = surface_figures("sand", SAND, ROVER)
    assert plain.climb is not None
    angle = plain.climb - math.radians(below)
    terrain = terrain_of(
        {
            "size": [12, 12],
            "surfTypes": {
                "sand": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.1, "shearModulus": 0.02}
            },
            "elemTypes": {"ramp": {"x": [0, 1]}},
            "elemTree": {"type": "ramp", "vScale": 12 * math.tan(angle), "surface": "sand"},
        }
    )
    grid = Grid(5.95, 5.95, 0.1, 1, 1)
    found = (survey(terrain, one, grid) for one in (ROVER, on_the_safe_side(ROVER)))
    assert [one.verdict[2, 0, 0] != Verdict.NO_GO for one in found] == [True, drives]


@pytest.mark.parametrize("margins", [Margins(soil=ERROR_BAND), Margins(slope=math.radians(6))])
@pytest.mark.parametrize("friction", [10.0, 13.0, 18.0, 24.0, 34.0])
def test_the_level_is_judged_as_the_map_judges_it(margins: Margins, friction: float) -> None:
    """The margin counts on the level, too: what could not climb it is no-go there."""
    mud = {"cohesion": 0, "fricAngle": friction, "sinkage": 0.1, "shearModulus": 0.02}
    terrain = terrain_of(
        {
            "size": [12, 12], "surfTypes": {"mud": mud}, "elemTypes": {"flat": {"x": [1]}},
            "elemTree": {"type": "flat", "vScale": 0, "surface": "mud"},
        }
    )  # fmt: skip
    kept = replace(ROVER, margins=margins)
    found = survey(terrain, kept, Grid(5.95, 5.95, 0.1, 1, 1))
    figures = surface_figures("mud", terrain.surface_types["mud"], kept)
    assert figures.verdict == Verdict(found.verdict[0, 0, 0])
    assert figures.reason in (Reason.NONE, Reason(found.reason[0, 0, 0]))
    assert (figures.verdict == Verdict.NO_GO) == (figures.climb == 0.0 or figures.climb is None)


def test_all_formats_have_the_band(tmp_path: Path) -> None:
    """The table of a terminal, Markdown, the page, JSON and the picture."""
    figures = replace(
        surface_figures("sand", SAND, ROVER), climb=math.radians(13.4), climb_error=math.radians(5)
    )
    report = report_of(surfaces=(figures, surface_figures("rock", ROCK, ROVER)))
    assert "13.4° ± 5.0°" in "\n".join(as_lines(report))
    assert "13.4° ± 5.0°" in as_page(report) and "13.4° ± 5.0°" in as_markdown(report)
    keys = [one["climb_error_deg"] for one in as_dict(report)["surfaces"]]
    assert keys == pytest.approx([5.0, 0.0])
    picture = as_svg(report)
    assert "sand 13.4° ± 5.0°" in picture
    assert picture.count('class="band') == 1


def test_the_area_of_the_picture_is_as_wide_as_the_band() -> None:
    """5° to both sides of the curve, at the same slip, but no farther than the picture."""
    figures = replace(surface_figures("sand", SAND, ROVER), climb_error=math.radians(5))
    report = report_of(surfaces=(figures,))
    text = as_svg(report)
    (points,) = re.findall(r'class="band s0" points="([^"]*)"', text)
    x, y = np.array([point.split(",") for point in points.split()], float).T
    half = len(x) // 2
    assert y[:half].tolist() == y[half:][::-1].tolist()
    wide = (x[half:][::-1] - x[:half])[y[:half] < 250]
    (line,) = slip_lines(report)
    able, beyond = line.spans()
    low, high = -10.0, 5.0 * math.ceil([*able, *beyond][-1][0] / 5.0)
    pixels = (900 - 52 - 14) / (high - low)
    assert wide[0] == pytest.approx(10 * pixels, abs=0.2)
    assert (wide <= 10 * pixels + 0.2).all() and x.max() <= 900 - 14 + 0.05


def test_what_does_not_move_crosses_and_climbs_nothing() -> None:
    """On a bog with a friction of 2° it is stuck: nothing else is promised, and the reason said."""
    found = surface_figures("bog", BOG, ROVER)
    assert found.climb is None and found.verdict == Verdict.NO_GO
    assert (found.cross_slope, found.step, found.gap, found.climb_error) == (None,) * 4
    assert found.cross_slope_binding == found.climb_binding != Reason.NONE
    assert found.step_binding == found.climb_binding.label and found.step_axle is None
    report = report_of(surfaces=(found,))
    (keys,) = as_dict(report)["surfaces"]
    names = "climb_deg", "cross_slope_deg", "step_m", "gap_m"
    assert [keys[name] for name in names] == [None] * 4
    assert keys["cross_slope_binding"] == keys["step_binding"] == found.climb_binding.label
    text = "\n".join(as_lines(report))
    assert re.search(r"^bog .* –  +–  +–  ", text, re.MULTILINE) and "Steps are limited" not in text


def test_the_option(tmp_path: Path) -> None:
    """--margin lowers climbs on soil by the band, and says what is kept in reserve."""
    site = tmp_path / "site.json"
    site.write_text(
        json.dumps(
            {
                "size": [6, 5],
                "surfTypes": {
                    "sand": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.1, "shearModulus": 0.02}
                },
                "elemTypes": {"flat": {"x": [1]}},
                "elemTree": {"type": "flat", "vScale": 0, "surface": "sand"},
            }
        ),
        "utf-8",
    )
    words: tuple[Any, ...] = ("traversability", site, "--vehicle", HUSKY, "--json")
    plain, kept = (json.loads(call(*words, *more).out) for more in ((), ("--margin",)))
    before, after = (one["surfaces"][0] for one in (plain, kept))
    assert after["climb_deg"] == pytest.approx(before["climb_deg"] - before["climb_error_deg"])
    assert after["climb_error_deg"] == 0.0 < before["climb_error_deg"] < 5.0
    assert (plain["vehicle"]["margins"]["soil_deg"], kept["vehicle"]["margins"]["soil_deg"]) == (
        0.0, pytest.approx(5.0),
    )  # fmt: skip
    paper = call(*words, "--margin", "--model", "paper")
    assert paper.code == 2 and "The model paper has no error band" in paper.err
