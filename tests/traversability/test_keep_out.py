"""Keep-out zones: what files hold, in which states a vehicle would enter, and what follows."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.errors import ReadError, RequestError
from terratool.raster.grid import grid_over
from terratool.traversability.assess import assess
from terratool.traversability.blocked import first_look
from terratool.traversability.keep_out import KeptOut, Zone
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.report import wording
from terratool.traversability.report.document import as_dict
from terratool.traversability.report.page import as_page
from terratool.traversability.report.routes import as_geojson
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.route.zones import read_keep_out
from terratool.traversability.survey import Surveyor
from terratool.traversability.vehicle import Overhang, Vehicle
from terratool.traversability.verdicts import GroundClass, Reason, Verdict
from tests.budget import examples
from tests.surveys import ROVER, level

LONG = replace(ROVER, front=Overhang(0.9, 0.2))
"""Much longer ahead of its middle than behind it, and than wide."""
SQUARE = [[4, 3], [7, 3], [7, 5], [4, 5], [4, 3]]
HOLE = [[5, 3.5], [6, 3.5], [6, 4.5], [5, 4.5], [5, 3.5]]


def polygon(*rings: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": list(rings)}


def feature(geometry: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def collection(*features: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}


def line(*points: Any) -> dict[str, Any]:
    return {"type": "LineString", "coordinates": list(points)}


def read(folder: Path, value: Any) -> tuple[Zone, ...]:
    path = folder / "zones.geojson"
    path.write_text(value if isinstance(value, str) else json.dumps(value), "utf-8")
    return read_keep_out(path)


def test_zones_are_read(tmp_path: Path) -> None:
    """Polygons with holes, several polygons, and corridors of a width; names where there are."""
    second = [[[0, 0], [1, 0], [0, 1], [0, 0]]]
    zones = read(
        tmp_path,
        collection(
            feature(polygon(SQUARE, HOLE), name="pond"),
            feature({"type": "MultiPolygon", "coordinates": [[SQUARE], second]}),
            feature(line([10, 0], [10, 5, 99]), name="cable", width=2),
        ),
    )
    assert [zone.name for zone in zones] == ["pond", "2", "cable"]
    assert [zone.shape.area for zone in zones[:2]] == pytest.approx([6 - 1, 6 + 0.5])
    circle = math.pi + 2 * 5
    assert circle <= zones[2].shape.area < 1.01 * circle
    assert zones[2].shape.bounds == pytest.approx((9, -1, 11, 6), abs=2e-3)
    (bare,) = read(tmp_path, "\ufeff" + json.dumps(polygon(SQUARE)))
    assert bare.name == "1" and bare.shape.area == pytest.approx(6)


BOW = [[0, 0], [2, 2], [2, 0], [0, 2], [0, 0]]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("", ":1: is no JSON"),
        ("1,2\n3,4\n", ": is no JSON" if False else ":1: is no JSON"),
        ("[]", ": is no GeoJSON."),
        ('{"size": [8, 6]}', ": is no GeoJSON."),
        ("[" * 100_000, ": is no "),
        (collection(), ": holds no zones."),
        ({"type": "FeatureCollection", "features": 5}, ": the features are no list."),
        (collection(3), ": feature 1 is no object."),
        (collection(feature(None, name="a")), ': zone "a" has no geometry.'),
        (collection({"type": "Feature", "properties": 3, "geometry": line()}), "feature 1 are no"),
        (feature({"type": "Point", "coordinates": [1, 2]}), ': zone "1" is "Point", no area.'),
        (feature(line([0, 0], [1, 1]), name="c"), ': zone "c" has no width.'),
        (feature(line([0, 0], [1, 1]), width=0), 'has the width "0".'),
        (feature(line([0, 0], [1, 1]), width="2"), 'has the width "2".'),
        (feature(line([0, 0], [1, 1]), width=True), 'has the width "True".'),
        ('{"type": "Feature", "properties": {"width": NaN}, "geometry": '
         '{"type": "LineString", "coordinates": [[0, 0], [1, 1]]}}', 'has the width "nan".'),
        (feature(line([0, 0]), width=1), "has 1 positions."),
        (polygon(), ': zone "1" is empty.'),
        (polygon([]), "has 0 positions."),
        (polygon(SQUARE[:-1]), "has a ring that is not closed."),
        (polygon([[0, 0], [1, 1], [0, 0]]), "has 3 positions."),
        (polygon([[0, 0], [1, 1], [2, 2], [0, 0]]), 'zone "1" '),
        (polygon(BOW), 'zone "1" crosses itself at 1 1.'),
        (polygon(SQUARE, [[x + 9, y] for x, y in HOLE]), 'zone "1" is no polygon (hole lies'),
        ('{"type": "Polygon", "coordinates": [[[0, 0], [NaN, 1], [1, 1], [0, 0]]]}',
         "has a position 1, "),
        (polygon([[0, 0], [1, "a"], [1, 1], [0, 0]]), "has a position 1, "),
        (polygon([[0, 0], [1, 1e40], [1, 1], [0, 0]]), "has a position 1, "),
        ({"type": "Polygon", "coordinates": 5}, 'zone "1" is empty.'),
        ({"type": "MultiPolygon", "coordinates": [5]}, 'zone "1" is empty.'),
        ({"type": "Polygon", "coordinates": [5]}, "has no coordinates."),
    ],
)  # fmt: skip
def test_what_are_no_zones_is_said(tmp_path: Path, value: Any, message: str) -> None:
    with pytest.raises(ReadError) as error:
        read(tmp_path, value)
    assert message in error.value.message
    assert error.value.message.startswith(str(tmp_path / "zones.geojson"))
    assert error.value.hint


def test_zones_elsewhere_are_refused() -> None:
    """As those in degrees; one that only overlaps is not."""
    away = Zone("far", shapely.box(100, 3, 101, 4))
    with pytest.raises(RequestError, match=r'zone "far", 100 3 101 4, lies outside the terrain'):
        prepare_assessment(level(12, 8), ROVER, Request(keep_out=(away,)))
    over = Zone("over", shapely.box(11, 3, 101, 4))
    prepare_assessment(level(12, 8), ROVER, Request(keep_out=(over,)))


def rectangle(vehicle: Vehicle, x: float, y: float, degrees: float) -> shapely.Polygon:
    front, rear, side = vehicle.rectangle
    own = shapely.box(-side, -rear, side, front)
    return shapely.affinity.translate(
        shapely.affinity.rotate(own, -degrees, origin=(0, 0)), x, y
    )  # fmt: skip


@settings(max_examples=examples(15), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), headings=st.sampled_from([4, 8, 16]))
def test_a_free_state_holds_nothing_of_a_zone_and_a_barred_one_is_near_it(
    seed: int, headings: int
) -> None:
    """At each heading, and at directions up to half a step beside it.

    The front is much longer, so that mirrored directions are seen.
    """
    rng = np.random.default_rng(seed)
    grid = grid_over(level(9, 6), 0.3)
    points = rng.uniform((1, 1), (8, 5), (5, 2))
    zone = shapely.MultiPoint(points).convex_hull
    zone = zone.difference(zone.centroid.buffer(0.4))
    kept = KeptOut((Zone("a", zone),), LONG, grid, headings)
    x, y = grid.columns(grid.whole), grid.rows(grid.whole)
    for heading in range(headings):
        barred = kept(grid.whole, heading)
        assert barred is not None and barred.any() and not barred.all()
        for row, column in rng.integers(0, barred.shape, (40, 2)).tolist():
            aside = float(rng.uniform(-180.0, 180.0)) / headings
            own = rectangle(LONG, x[column], y[row], 360.0 * heading / headings + aside)
            if not barred[row, column]:
                assert not own.intersects(zone)
            else:  # as far as the corners swing, and between pixels
                reach = 0.3 + 2.0 * math.hypot(*LONG.rectangle[::2]) * math.sin(
                    1.5 * math.pi / headings
                )
                assert own.distance(zone) < reach


def asked(zones: tuple[Zone, ...], **options: Any) -> TraversabilityReport:
    request = Request(**({"keep_out": zones, "mapped": False} | options))
    return assess(prepare_assessment(level(12, 8), ROVER, request))


POND = Zone('the "old" pond', shapely.Polygon(SQUARE, [HOLE]))


def test_ways_keep_out(tmp_path: Path) -> None:
    """By the vehicle's rectangle at each sample and at each turn, and no more than they need."""
    (free,) = asked((), routes=((1.0, 4.0, 10.5, 4.2),)).routes
    (route,) = asked((POND,), routes=((1.0, 4.0, 10.5, 4.2),), returns=True).routes
    assert route.found and route.back is not None and route.back.found
    assert route.length is not None and free.length is not None
    assert free.length + 0.2 < route.length < free.length + 2.0
    for way in (route, route.back):
        assert way.profile is not None
        places = zip(way.profile.x, way.profile.y, way.profile.heading, strict=True)
        assert not any(rectangle(ROVER, *place).intersects(POND.shape) for place in places)


@pytest.mark.slow
def test_a_barrier_names_its_zone() -> None:
    wall = Zone("cable", shapely.LineString([(6, -1), (6, 9)]).buffer(0.5))
    report = asked((POND, wall), routes=((1.0, 6.0, 10.5, 6.2),))
    (route,) = report.routes
    assert not route.found and report.verdict == Verdict.NO_GO
    (bar,) = route.barriers
    assert bar.reason == Reason.KEEP_OUT and bar.bars == 'zone "cable"' and bar.pointer == ""
    assert 4.5 < bar.place.x < 5.5 and 1.0 < bar.width < 3.0
    assert "keep-out at (" in wording.barrier(bar) and 'zone "cable"' in wording.barrier(bar)
    points = np.array([(1.0, 7.0), (10.5, 7.0)])
    (checked,) = asked((wall,), waypoints=(points,)).routes
    assert [bar.reason for bar in checked.barriers] == [Reason.KEEP_OUT]


def test_a_goal_in_a_zone_is_said_at_once() -> None:
    request = Request(routes=((1.0, 4.0, 4.5, 4.0),), keep_out=(POND,), mapped=False)
    (said,) = first_look(prepare_assessment(level(12, 8), ROVER, request))
    assert "cannot stand at the route's goal" in said and 'keep-out, by zone "the ' in said


def test_shares_and_reach_are_those_of_what_is_left() -> None:
    """A corridor from rim to rim cuts the ground in two; the map has its own reason."""
    wall = Zone("cable", shapely.LineString([(4, -1), (4, 9)]).buffer(0.5))
    report = asked((wall,), mapped=True, resolution=0.1, start=(8.0, 4.0))
    summary = report.summary
    assert summary is not None and report.reach is not None
    assert summary.reasons[Reason.KEEP_OUT] / summary.counted > 0.1
    barred = summary.fraction(GroundClass.NO_GO)
    cut = summary.fraction(GroundClass.CUT_OFF)
    # west of the corridor 3.5 m less the vehicle, east 7.5 m, of 12 m
    assert 0.1 < barred < 0.25 and 0.15 < cut < 0.3
    assert report.reach.share == pytest.approx(1.0 - barred - cut, abs=0.02)
    assert report.reach.cells[:, :38].sum() == 0
    free = asked((), mapped=True, resolution=0.1, start=(8.0, 4.0))
    assert free.summary is not None and Reason.KEEP_OUT not in free.summary.reasons


@pytest.mark.slow
def test_reports_show_them() -> None:
    report = asked((POND,), mapped=True, routes=((1.0, 4.0, 10.5, 4.2),))
    assert as_dict(report)["keep_out"] == [{"name": POND.name, "area_m2": 5.0}]
    features = json.loads(as_geojson(report))["features"]
    (zone,) = [one for one in features if one["properties"]["kind"] == "keep-out"]
    assert zone["properties"]["name"] == POND.name
    assert shapely.geometry.shape(zone["geometry"]).equals(POND.shape)
    page = as_page(report)
    assert page.count('class="zone"') and "White dashed outlines: keep-out" in page
    assert any("keeps out of" in note for note in report.notes)
    assert 'class="zone"' not in as_page(asked((), mapped=True))


def test_surveyors_keep_their_zones_when_they_are_sent() -> None:
    """To other processes, as Dask does."""
    import pickle

    grid = grid_over(level(12, 8), 0.3)
    own = Surveyor(level(12, 8), ROVER, grid, 8, zones=(POND,))
    terrain, *rest = own.__reduce__()[1]
    again = Surveyor(terrain, *pickle.loads(pickle.dumps(tuple(rest))))
    one, two = (each.measure(grid.whole) for each in (own, again))
    assert np.array_equal(one.reason, two.reason) and (one.reason == Reason.KEEP_OUT).any()
