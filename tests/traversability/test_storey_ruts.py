"""Ruts on storeys: what a drive on a deck or in a bore leaves, and what the next drive finds."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from terratool.definition.reader import Checked, check
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window
from terratool.text.source import Source
from terratool.traversability.assess import assess
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.ruts import Deformed, deform
from terratool.traversability.survey import Surveyor
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.verdicts import Reason
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.storey_examples import PRIMITIVES, Json, box

SOILS: Json = {
    "grass": {"cohesion": 5, "fricAngle": 38, "sinkage": 0.1, "shearModulus": 0.01},
    "wood": {"cohesion": 5, "fricAngle": 38, "sinkage": 0.02, "shearModulus": 0.01},
    "road": {"cohesion": 5, "fricAngle": 38, "sinkage": 0.05, "shearModulus": 0.01},
}


def site(size: list[float], *children: Json, **more: Any) -> Json:
    root = {"type": "box", "vScale": 0, "surface": "grass", "children": list(children)}
    return copy.deepcopy(
        {"size": size, "surfTypes": SOILS, "elemTypes": PRIMITIVES, "elemTree": root, **more}
    )


def dock() -> Json:
    """A ramp from x = 2 to 8, m, and a floor 0.9 m high from 8 to 14, over soft ground."""
    return site(
        [18, 9],
        box(2, 3, 8, 6, type="ramp", vScale=0.9, surface="wood", deck={"thickness": 0.1}),
        box(8, 3, 14, 6, vScale=0.9, surface="wood", deck={"thickness": 0.1}),
    )


def cart() -> Vehicle:
    """400 N on four wheels 0.1 m wide, 0.5 m from front to rear, and 0.4 m from left to right."""
    return Vehicle(
        Wheel(0.15, 0.1), (Axle(0.25), Axle(-0.25)), 40.0, 10.0, track_width=0.4, cog_height=0.2,
        clearance=0.1, height=0.5,
    )  # fmt: skip


def checked(definition: Json) -> Checked:
    return check(Source("site.json", json.dumps(definition).encode()))


def driven(definition: Json, *path: tuple[float, ...]) -> tuple[Deformed, Terrain]:
    """What a drive leaves, and the terrain after it."""
    before = checked(definition)
    found = deform(before, cart(), np.array(path, float))
    assert before.terrain is not None
    terrain = msgspec.structs.replace(before.terrain, tracks=found.tracks)
    return found, Terrain(msgspec.structs.replace(before, terrain=terrain))


def sunk(definition: Json, after: Terrain, x: Any, y: Any) -> NDArray[np.float64]:
    """How much deeper tops are after a drive, from below, m."""
    before = terrain_of(definition).column(x, y)
    found = after.column(x, y)
    np.testing.assert_array_equal(found.bottom, before.bottom)
    np.testing.assert_array_equal(found.element, before.element)
    return np.asarray(before.top - found.top)


def test_a_drive_on_a_deck_lowers_its_top_alone() -> None:
    """By 0.1 kN · 0.02 m/kN, twice over 2^(1/3) of that; the ground below stays."""
    found, after = driven(dock(), (9, 4.5, 0.9), (12, 4, 0.9))
    assert {rut.surface for rut in found.ruts} == {"wood"} and found.notes == ()
    assert all(len(point) == 3 for track in found.tracks for point in track.path)
    ahead = np.array([3.0, -0.5]) / np.hypot(3.0, 0.5)
    x, y = (10.5, 4.25) + 0.2 * np.array([-ahead[1], ahead[0]])  # amid the left wheels' rut
    np.testing.assert_allclose(sunk(dock(), after, x, y), [0.0, 0.002 * 2 ** (1 / 3)], rtol=1e-4)
    np.testing.assert_array_equal(sunk(dock(), after, 10.5, 4.25), [0.0, 0.0])
    x, y = np.meshgrid(np.linspace(0.01, 17.9, 180), np.linspace(0.01, 8.9, 90))
    assert sunk(dock(), after, x, y)[..., 0].max() == 0.0


def test_a_path_without_heights_stays_on_the_ground() -> None:
    """Below a deck that no wheel has touched, which is said."""
    found, after = driven(dock(), (9, 4.5), (12, 4))
    assert {rut.surface for rut in found.ruts} == {"grass"}
    assert all(len(point) == 2 for track in found.tracks for point in track.path)
    (note,) = found.notes
    assert note.startswith("The path has no heights, so its ruts lie on the ground, below decks.")
    x, y = np.meshgrid(np.linspace(8.01, 13.9, 60), np.linspace(3.01, 5.9, 90))
    ground, deck = np.moveaxis(sunk(dock(), after, x, y), -1, 0)
    assert deck.max() == 0.0 and ground.max() == pytest.approx(0.01 * 2 ** (1 / 3))
    assert driven(dock(), (9, 8), (12, 7.5))[0].notes == ()


def test_heights_on_the_ground_are_left_out() -> None:
    """The tracks are those of a path without heights, so that driving there again adds to them."""
    plain, _ = driven(dock(), (9, 4.5), (12, 4))
    found, _ = driven(dock(), (9, 4.5, 0.1), (12, 4, -0.2))
    assert found.tracks == plain.tracks and found.notes == ()


def test_a_floor_cut_into_a_hill_is_the_ground() -> None:
    """A path without heights runs through a tunnel on its floor, and wears that."""
    hill = site(
        [18, 9], box(4, 0, 14, 9, vScale=3),
        box(3, 4, 15, 6, vScale=0, surface="road", bore={"height": 1, "datum": True}),
    )  # fmt: skip
    found, after = driven(hill, (5, 5), (13, 5))
    assert {rut.surface for rut in found.ruts} == {"road"} and found.notes != ()
    floor, top = sunk(hill, after, 9, 5.2)
    assert (floor, top) == (pytest.approx(0.005 * 2 ** (1 / 3)), 0.0)
    found, after = driven(hill, (5, 5, 3), (13, 5, 3))
    assert {rut.surface for rut in found.ruts} == {"grass"}
    assert sunk(hill, after, 9, 5.2)[0] == 0.0


def test_wheels_ahead_are_on_the_ramp_that_the_middle_comes_to() -> None:
    """Each wheel on the top that it rolls on, where ramp and ground are a hand apart."""
    found, after = driven(dock(), (0.5, 4.5, 0), (2, 4.5, 0), (8, 4.5, 0.9), (12, 4.5, 0.9))
    assert {rut.surface for rut in found.ruts} == {"grass", "wood"}
    x = np.linspace(2.8, 11.79, 500)  # from where the ramp is off the ground
    ground, deck = np.moveaxis(sunk(dock(), after, x, np.full_like(x, 4.7)), -1, 0)
    assert np.nanmax(np.abs(ground)) == 0.0
    np.testing.assert_allclose(deck, 0.002 * 2 ** (1 / 3), rtol=1e-4)
    before = sunk(dock(), after, np.linspace(0.9, 1.9, 50), np.full(50, 4.3))[:, 0]
    np.testing.assert_allclose(before, 0.01 * 2 ** (1 / 3), rtol=1e-4)


@pytest.mark.parametrize(
    ("path", "where", "away"),
    [
        # its right wheels are beside the deck
        ([(9, 3.1, 0.9), (12, 3.1, 0.9)], "9.25 2.9", "0.9 m below it"),
        # the end of the deck
        ([(12, 4.5, 0.9), (15, 4.5, 0.9)], "15.25 4.7", "0.9 m below it"),
        # a straight line from the ground to the deck passes by the ramp
        ([(9, 1.0, 0), (9, 4.5, 0.9)], "8.8 3.0", "0.9 m above it"),
    ],
)  # fmt: skip
def test_a_wheel_that_leaves_its_floor_is_refused(
    path: list[tuple[float, ...]], where: str, away: str
) -> None:
    with pytest.raises(RequestError) as error:
        driven(dock(), *path)
    said = error.value.message
    assert said.startswith("A wheel would leave the vehicle's floor at ") and away in said
    x, y = said.split(" at ")[1].split(":")[0].split()
    assert (float(x), float(y)) == pytest.approx(tuple(map(float, where.split())), abs=0.06)


def test_a_path_over_a_hole_below_a_deck_needs_heights() -> None:
    """A floor over a void bears wheels; without heights there is no ground."""
    soils = {**SOILS, "hole": {"void": True}}
    pit = site(
        [18, 9], box(4, 2, 14, 7, vScale=0, surface="hole"),
        box(3, 3, 15, 6, vScale=0.0, surface="wood", deck={"thickness": 0.1, "datum": True}),
    )  # fmt: skip
    pit["surfTypes"] = soils
    with pytest.raises(RequestError, match="over no ground"):
        driven(pit, (5, 4.5), (13, 4.5))
    found, after = driven(pit, (5, 4.5, 0), (13, 4.5, 0))
    assert {rut.surface for rut in found.ruts} == {"wood"}
    assert sunk(pit, after, 9, 4.7).max() == pytest.approx(0.002 * 2 ** (1 / 3))


TRACKS: list[Json] = [
    {"path": [[0.5, 1.1], [5.5, 0.8]], "width": 0.3, "depth": 0.006, "passes": 9},
    {"path": [[0.5, 0.9, 0.36], [5.5, 1.1, 0.9]], "width": 0.2, "depth": 0.01, "multipass": 2},
    {"path": [[2, 0.2, -0.2], [2.5, 1.8, 0.34]], "width": 0.2, "depth": 0.01, "surface": "road"},
]


@pytest.mark.parametrize("rough", [False, True])
def test_ruts_are_those_of_the_floor_that_they_lie_on(rough: bool) -> None:
    """Each layer is judged as a plain terrain that has this layer's tops and tracks alone."""
    roof = box(0, 0, 6, 2, vScale=0.7, surface="wood", deck={"thickness": 0.1})
    both = site([6, 2], roof, tracks=TRACKS)
    lower = site([6, 2], tracks=[TRACKS[0], TRACKS[2]])
    upper = site([6, 2], tracks=TRACKS[1:2])
    upper["elemTree"].update(vScale=0.7, surface="wood")
    for one in both, lower, upper:
        for track in one["tracks"]:
            track["path"] = [point if one is both else point[:2] for point in track["path"]]
        if rough:
            relief = {"roughness": {"rms": 0.004, "correlation": 0.3, "seed": 5}}
            one["surfTypes"] = {name: {**soil, **relief} for name, soil in SOILS.items()}

    grid, vehicle = Grid(0.0, 0.0, 0.1, 20, 60), replace(cart(), height=None)
    window = Window(6, 8, 8, 44)
    surveyor = Surveyor(terrain_of(both), vehicle, grid)
    for number, plain in enumerate((lower, upper)):
        wanted = Surveyor(terrain_of(plain), vehicle, grid).measure(window)
        place = Window(window.row + number * surveyor.stack.pitch, window.column, 8, 44)
        found = surveyor.measure(place)
        assert found.numbers.shape == wanted.numbers.shape and wanted.step.max() > 0.009
        soils = np.arange(kernels.PLANES) != kernels.UTILISATION
        np.testing.assert_array_equal(found.numbers[:, soils], wanted.numbers[:, soils])
        np.testing.assert_array_equal(found.heights, wanted.heights)
        np.testing.assert_array_equal(found.rough, wanted.rough)
        # sides of ruts stand amid pixels there, not at their places
        np.testing.assert_allclose(found.step, wanted.step, atol=2e-3)
        assert (found.verdict != wanted.verdict).mean() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.0, 1.0])
@pytest.mark.parametrize(
    ("points", "ends", "back"),
    [
        # below the floor, on it, and from the ground up to it, with heights and without
        ([(9, 4.5), (12, 4.5)], (0.0, 0.0), (0.0, 0.0)),
        ([(9, 4.5, 0.9), (12, 4.5, 0.8)], (0.9, 0.9), (0.9, 0.9)),
        ([(0.8, 4.5), (12, 4.5)], (0.0, 0.9), (0.9, 0.0)),
        ([(0.8, 4.5, 0), (5, 4.5, 0.5), (12, 4.5, 1)], (0.0, 0.9), (0.9, 0.0)),
        ([(0.8, 1.5, 0), (10, 1.5, 0), (10, 4.5, 0.9)], (0.0, 0.0), None),
        ([(10, 4.5, 0), (16, 4.5, 0), (16, 8, 3)], (0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_waypoints_lie_on_the_floors_of_their_heights(
    points: list[tuple[float, ...]], ends: tuple[float, float], back: Any, radius: float
) -> None:
    """A way goes on as the vehicle would, and misses a point on another floor than its own."""
    machine = replace(cart(), height=0.4, turning_radius=radius)
    wanted = Request(
        waypoints=(np.array(points),), returns=True, resolution=0.1, headings=8, mapped=False
    )
    route = assess(prepare_assessment(terrain_of(dock()), machine, wanted)).routes[0]
    assert (route.start.height, route.goal.height) == pytest.approx(ends)
    assert route.found == (back is not None)
    if route.back is not None:
        assert route.back.found
        assert (route.back.start.height, route.back.goal.height) == pytest.approx(back)
    else:
        (bar,) = route.barriers
        assert (bar.reason, bar.place.height) == (Reason.STEP, 0.0)
        assert bar.bars == '/elemTree/children/1 (surface "wood"), 0.9 m high'
        assert bar.pointer == "/elemTree/children/1"


@pytest.mark.slow
def test_a_route_that_was_found_can_be_deformed(tmp_path: Path) -> None:
    """Its line is the only route of the report, and has heights; its ruts lie where it leads."""
    file, route, out = tmp_path / "dock.json", tmp_path / "route.geojson", tmp_path / "driven.json"
    file.write_text(json.dumps(dock()), "utf-8")
    vehicle = "--vehicle", ROOT / "samples/vehicles/husky-a200.json"
    ran = call(
        "traversability", file, *vehicle, "--route", 9, 4.5, 12, "4.5,0.9", "--report", route
    )
    assert ran.code == 0
    ran = call("deform", file, *vehicle, "--waypoints", route, "-o", out, "--json")
    assert (ran.code, ran.err) == (0, "")
    said = json.loads(ran.out)
    assert [one["surface"] for one in said["surfaces"]] == ["grass", "wood"] and "notes" not in said
    tracks = json.loads(out.read_text("utf-8"))["tracks"]
    for track in tracks:
        assert track["path"][0][2] == 0.0 and track["path"][-1][2] == 0.9
    ran = call("query", out, *tracks[0]["path"][-1][:2], "--columns")
    ground, deck = (line.split(",") for line in ran.out.splitlines()[1:])
    assert float(ground[3]) == 0.0 and 0.89 < float(deck[3]) < 0.9
