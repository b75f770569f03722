"""Drift on side slopes: crab angles, their limits, and corridors along routes."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.traversability.assess import assess
from terratool.traversability.conditions import parse
from terratool.traversability.limits import crab_angle
from terratool.traversability.map_files import map_paths
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report.document import as_dict
from terratool.traversability.report.page import as_page
from terratool.traversability.report.routes import as_geojson, route_features
from terratool.traversability.report.wording import along_line, route_line
from terratool.traversability.request import Request
from terratool.traversability.route.drifting import corridor, drift_along, drift_total, stretches
from terratool.traversability.route.results import RouteProfile
from terratool.traversability.route.routes import check_route, plan_route, with_way_back
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Soil, Thresholds, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from terratool.traversability.wheel import demand, side_force
from tests.conftest import terrain_of
from tests.surveys import drawn

SAND = {"cohesion": 1, "fricAngle": 30, "sinkage": 0.02, "shearModulus": 0.02}
SOIL = Soil.of(1, 30, 0.02, 0.02)
WHEEL = Wheel(0.15, 0.1)
ROVER = Vehicle(
    WHEEL, (Axle(0.3), Axle(-0.3)), mass=40.0, gravity=10.0, track_width=0.6, cog_height=0.1,
    clearance=0.12, body_width=0.5,
)  # fmt: skip


def slope(angle: float, uphill: str = "east", surface: Any = SAND) -> Terrain:
    """A plane of 40 by 20 m that rises to a side."""
    rise = math.tan(math.radians(angle)) * (40 if uphill in ("east", "west") else 20)
    ramp = {"east": [0, 1], "west": [1, 0], "north": [0, 1], "south": [1, 0]}[uphill]
    axis = "x" if uphill in ("east", "west") else "y"
    return terrain_of(
        {
            "size": [40, 20],
            "surfTypes": {"ground": surface},
            "elemTypes": {"ramp": {"x": [1], "y": [1], axis: ramp}},
            "elemTree": {"type": "ramp", "vScale": rise, "surface": "ground"},
        }
    )


def surveyed(terrain: Terrain, vehicle: Vehicle = ROVER) -> Any:
    """A survey of the middle of it, 12 by 8 m."""
    return survey(terrain, vehicle, Grid(14.0, 6.0, 0.1, 80, 120), threads=1)


@pytest.mark.parametrize("angle", [2.0, 10.0, 20.0])
def test_what_holds_a_wheel_is_what_pulls_it_down(angle: float) -> None:
    """Its force sideways at the crab angle, by the rule of a wheel, is m g sin β."""
    beta, alone = math.radians(angle), Vehicle.single(WHEEL, 100.0)
    load = 100.0 * math.cos(beta)
    slip = float(demand(load, SOIL, WHEEL).slip)
    assert slip > 0.005
    found = crab_angle(alone, SOIL, beta)
    assert side_force(load, SOIL, WHEEL, slip, found) == pytest.approx(
        100.0 * math.sin(beta), rel=1e-6
    )
    # two side by side, with their weight on the ground, bear alike
    pair = replace(ROVER, axles=(Axle(0.0),), mass=20.0, cog_height=1e-9)
    assert crab_angle(pair, SOIL, beta) == pytest.approx(found, rel=1e-6)


def test_no_crab_angle() -> None:
    """On the level it heads where it moves; beyond what holds it no heading does; K is needed."""
    assert crab_angle(ROVER, SOIL, 0.0) == 0.0
    assert crab_angle(ROVER, SOIL, math.radians(45)) == pytest.approx(math.pi / 2)
    assert crab_angle(ROVER, Soil.of(1, 30, 0.02), math.radians(10)) == 0.0
    assert crab_angle(ROVER.by_model("paper"), SOIL, math.radians(10)) == 0.0


def test_the_survey_has_the_crab_angle_of_the_side_slope() -> None:
    """To the north across the plane; uphill there is none."""
    found = surveyed(slope(15))
    across, uphill = found.crab[0, 40, 60], found.crab[2, 40, 60]
    assert across == pytest.approx(crab_angle(ROVER, SOIL, math.radians(15)), rel=0.02)
    assert uphill == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("uphill", ["east", "west", "north", "south"])
@pytest.mark.parametrize("heading", [0, 90, 180, 270])
def test_it_drifts_downhill(uphill: str, heading: int) -> None:
    """Wherever it heads: the corridor lies downhill of its line, the crab angle points uphill."""
    up = {"east": (1, 0), "west": (-1, 0), "north": (0, 1), "south": (0, -1)}[uphill]
    way = round(math.sin(math.radians(heading))), round(math.cos(math.radians(heading)))
    middle = np.array([20.0, 10.0])
    points = np.array([middle - 3.0 * np.array(way), middle + 3.0 * np.array(way)])
    terrain = slope(12, uphill)
    route = check_route(terrain, ROVER, surveyed(terrain), points)
    profile = route.profile
    assert profile is not None and route.drift is not None and route.crab is not None
    side = up[0] * -way[1] + up[1] * way[0]  # 1 where uphill is to the left
    if side == 0:
        assert not list(corridor(profile)) and route.drift.value < 0.005
        return
    tangent = math.tan(crab_angle(ROVER, SOIL, math.radians(12)))
    assert np.sign(profile.crab[5]) == side
    assert profile.drift[-1] == pytest.approx(-side * 6.0 * tangent, rel=0.03)
    assert route.drift.value == pytest.approx(6.0 * tangent, rel=0.03) == route.drift_total
    assert (route.drift.place.x, route.drift.place.y) == tuple(points[1])
    (outline,) = corridor(profile)
    n = len(outline) // 2
    strays = outline[::-1][:n] - outline[:n]
    assert strays[-1] == pytest.approx(-route.drift.value * np.array(up), abs=1e-9)
    assert (np.diff(strays @ up) <= 1e-12).all()


class TestByHand:
    """Drift of lines whose crab angles are given."""

    def test_starts_anew_at_corners(self) -> None:
        """3 m north, 1 m east, 2 m more east after a turn on the spot: as much as each part has."""
        x = np.array([0, 0, 0, 1, 1, 3], float)
        y = np.array([0, 1, 3, 3, 3, 3], float)
        crab = np.arctan([0.1, 0.1, 0.1, -0.2, -0.2, -0.2])
        begins = np.arctan([0.1, 0.1, -0.2, 0.0, -0.2])
        found = drift_along(x, y, begins, crab[1:])
        assert found == pytest.approx([0, -0.1, -0.3, 0.2, 0, 0.4])
        assert stretches(x, y) == [(0, 2), (2, 3), (4, 5)]

    def test_each_half_of_a_leg_counts_as_its_end(self) -> None:
        x, y = np.array([0.0, 4.0]), np.array([7.0, 7.0])
        found = drift_along(x, y, np.arctan([0.3]), np.arctan([0.1]))
        assert found == pytest.approx([0.0, -0.8])
        assert drift_along(x, y, np.array([np.nan]), np.arctan([0.1])) == pytest.approx([0.0, -0.2])

    @pytest.mark.parametrize("step", [0.5, 5.0, 15.0])
    def test_an_arc_is_no_corner(self, step: float) -> None:
        """A quarter of a circle to the left, in steps of so many degrees, as a car's may be."""
        t = np.radians(np.arange(0, 90.1, step))
        x, y = 10 * np.cos(t), 10 * np.sin(t)
        assert stretches(x, y) == [(0, len(t) - 1)]
        ends = np.full(len(t) - 1, math.atan(-0.1))
        drift = drift_along(x, y, ends, ends)
        chords = 90.0 / step * 20 * math.sin(math.radians(0.5 * step))
        assert drift[-1] == pytest.approx(0.1 * chords)
        (outline,) = corridor(profiled(x, y, drift))
        # to the left is towards the middle
        aside = outline[len(t) - 1] - outline[len(t)]
        assert aside == pytest.approx([0.0, drift[-1]], abs=drift[-1] * math.radians(step))

    def test_total(self) -> None:
        """Drift to both sides adds up; the corners take nothing off."""
        x, y = np.array([0, 5, 5, 9], float), np.array([0, 0, 4, 4], float)
        assert drift_total(profiled(x, y, np.array([0, 0.3, -0.2, 0.1]))) == pytest.approx(0.6)

    def test_nowhere(self) -> None:
        one = np.array([1.0])
        assert stretches(one, one) == [] and drift_total(profiled(one, one, 0 * one)) == 0.0


def profiled(x: Any, y: Any, drift: Any) -> RouteProfile:
    """A profile of which only the line and the drift count."""
    none = np.zeros(len(x))
    bits = none.astype(np.uint8)
    names = ("",) * len(x)
    figures = (none,) * 8
    return RouteProfile(x, y, *figures, bits, bits, names, names, none, drift, *figures[:5])


class TestLimits:
    """Where go ends and caution ends."""

    @pytest.mark.parametrize(
        ("factor", "verdict"), [(1.1, Verdict.GO), (0.9, Verdict.CAUTION), (0.5, Verdict.NO_GO)]
    )
    def test_classes(self, factor: float, verdict: Verdict) -> None:
        """The crab angle of the slope, with go up to a factor of it, and caution to 1.6 of that."""
        crab = crab_angle(ROVER, SOIL, math.radians(12))
        limits = Thresholds(drift=factor * crab, caution_drift=1.6 * factor * crab)
        found = surveyed(slope(12), replace(ROVER, thresholds=limits))
        assert found.verdict[0, 40, 60] == found.verdict[4, 40, 60] == verdict
        if verdict != Verdict.GO:
            assert found.reason[0, 40, 60] == Reason.DRIFT
            assert found.utilisation[0, 40, 60] == pytest.approx(1 / (1.6 * factor), rel=0.02)
        assert found.verdict[2, 40, 60] == Verdict.GO  # uphill

    @pytest.mark.parametrize(("most", "strays"), [(0.2, True), (0.8, False)])
    def test_largest_drift(self, most: float, strays: bool) -> None:
        """What is more than a vehicle's maxDrift is caution, and said; there and back."""
        terrain = slope(12)
        vehicle = replace(ROVER, max_drift=most)
        points = np.array([(20.0, 7.0), (20.0, 13.0)])
        route = check_route(terrain, vehicle, surveyed(terrain), points)
        assert route.strays is strays and route.drift is not None
        assert route.verdict == (Verdict.CAUTION if strays else Verdict.GO)
        assert ("more than its maxDrift" in route_line(route)) is strays
        back = check_route(terrain, vehicle, surveyed(terrain), points[::-1])
        assert with_way_back(route, back).verdict == route.verdict

    def test_a_figure_to_fail_on(self) -> None:
        report = reported(slope(12), 20, 7, 20, 13)
        drift = report.routes[0].drift
        assert drift is not None
        assert parse(f"drift>{drift.value - 0.01}").why_met(report).startswith("drift is 0.")
        assert not parse(f"drift>{drift.value + 0.01}").why_met(report)


def reported(terrain: Terrain, *route: float, map_path: Path | None = None) -> Any:
    """The report of a route."""
    request = Request(routes=(route,), resolution=0.1, threads=1)  # type: ignore[arg-type]
    prepared = prepare_assessment(terrain, ROVER, request, map_path=map_path)
    return assess(prepared, map_path=map_path)


def test_reports_agree(tmp_path: Path) -> None:
    """Sentence, JSON, GeoJSON, page and map of a route to the north that drifts to the west."""
    report = reported(slope(12), 20.05, 7.05, 20.05, 13.05, map_path=tmp_path / "m.tif")
    (route,) = as_dict(report)["routes"]
    drift = route["drift"]["drift_m"]
    assert drift == pytest.approx(6.0 * math.tan(math.radians(route["crab"]["crab_deg"])), rel=0.05)
    assert route["profile"]["drift_m"][-1] == pytest.approx(drift)  # to the left
    assert route["profile"]["crab_deg"][-1] < 0.0
    assert f"drift {drift:.3g} m downhill by (20.05, 13.05) unless it heads up to" in (
        along_line(report.routes[0])
    )
    features = json.loads(as_geojson(report))["features"]
    (strip,) = (one for one in features if one["properties"]["kind"] == "drift")
    ((ring,),) = strip["geometry"]["coordinates"]
    assert ring[0] == ring[-1]
    assert min(x for x, _ in ring) == pytest.approx(20.05 - drift)
    assert max(x for x, _ in ring) == pytest.approx(20.05)
    assert strip["properties"]["drift_m"] == pytest.approx(drift)
    assert 'class="strip"' in as_page(report)
    (surface,) = as_dict(report)["surfaces"]
    curve = surface["drift_curve"]
    assert curve["slope_deg"][:3] == [0.0, 5.0, 10.0] and curve["crab_deg"][0] == 0.0
    assert curve["crab_deg"] == sorted(curve["crab_deg"])
    with rasterio.open(map_paths(tmp_path / "m.tif")[-1]) as file:
        bands = dict(zip(file.descriptions, file.read()[:, 100, 200], strict=True))
    # what takes most is to climb, and least to go across
    assert bands["drift angle, best heading"] == pytest.approx(route["crab"]["crab_deg"], abs=0.05)
    assert bands["drift angle, worst heading"] == pytest.approx(0.0, abs=0.05)


def test_level_ground_says_nothing_of_drift() -> None:
    report = reported(slope(0), 20, 7, 20, 13)
    said = f"{route_line(report.routes[0])} {along_line(report.routes[0])}"
    assert "drift" not in said and 'class="strip"' not in as_page(report)
    assert report.routes[0].drift.value == 0.0


def test_drift_is_that_of_the_survey() -> None:
    """With the left side up it drifts to the right, 0.1 m a metre."""
    rows = "....\n" * 8
    found = drawn(rows, roll=0.2, crab=math.atan(0.1))
    route = plan_route(slope(0), ROVER, found, (1.5, 1.5), (1.5, 6.5))
    assert route.profile is not None and route.found
    assert route.profile.drift[-1] == pytest.approx(-0.5)


def test_strips_are_valid_polygons() -> None:
    """A line along a ditch drifts to one side, and then to the other: no outline crosses itself."""
    from shapely.geometry import shape

    x, y = np.linspace(0.0, 12.0, 49), np.full(49, 3.0)
    drift = 0.8 * np.sin(x)
    profile = profiled(x, y, drift)
    route = replace(
        reported(slope(0), 20, 7, 20, 13).routes[0], profile=profile, crab=None, back=None
    )
    (strip,) = (one for one in route_features([route]) if one["properties"]["kind"] == "drift")
    area = shape(strip["geometry"])
    assert area.is_valid and area.geom_type == "MultiPolygon"
    assert area.area == pytest.approx(np.abs(drift).mean() * 12.0, rel=0.05)
    assert all(part.exterior.is_ccw for part in area.geoms)
