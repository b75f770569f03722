"""Tracks on ground: what they rest on, bridge, climb and get stuck on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.definition.vehicle import CogText, TracksText, VehicleText
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.traversability.map_results import Survey
from terratool.traversability.survey import Surveyor
from terratool.traversability.sweep import Belts
from terratool.traversability.tiles import survey_window
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.vehicle_files import vehicle_of
from terratool.traversability.verdicts import Reason, Verdict
from tests.budget import examples
from tests.conftest import terrain_of

SOUND: dict[str, Any] = {"cohesion": 0, "fricAngle": 38, "sinkage": 0}
NORTH, EAST = 0, 2


def crawler(cog: float = 0.0, clearance: float = 0.1, **tracks: float) -> Vehicle:
    """A vehicle of 60 kg, 0.7 m on the ground, 0.5 m from track to track."""
    size = {"length": 0.7, "width": 0.1, "radius": 0.1} | tracks
    return vehicle_of(
        VehicleText(
            mass=60.0, tracks=TracksText(**size), track=0.5, cog=CogText(x=cog, height=0.15),
            clearance=clearance,
        )
    )  # fmt: skip


def ground(*children: dict[str, Any], slope: float = 0.0) -> Terrain:
    """8 m from west to east and 6 m from south to north, rising to the east by a tangent."""
    return terrain_of(
        {
            "size": [8, 6],
            "surfTypes": {"rock": SOUND},
            "elemTypes": {"plane": {"x": [0, 1]}, "box": {"x": [1]}, "ridge": {"x": [0, 1, 0]}},
            "elemTree": {
                "type": "plane", "vScale": 8 * slope, "surface": "rock", "children": list(children),
            },
        }
    )  # fmt: skip


def bar(height: float, width: float, at: float = 4.0, kind: str = "box") -> dict[str, Any]:
    """A wall, trench or ridge from south to north, its middle at x."""
    return {"type": kind, "at": [at, 3], "extent": [width, 6], "vScale": height, "surface": "rock"}


def surveyed(terrain: Terrain, vehicle: Vehicle, resolution: float = 0.05) -> Survey:
    grid = Grid(0.0, 0.0, resolution, round(6 / resolution), round(8 / resolution))
    return survey_window(Surveyor(terrain, vehicle, grid), grid.whole)


def along(survey: Survey, plane: Any, heading: int = EAST) -> Any:
    """What a survey has from west to east, through the middle."""
    return plane[heading, survey.grid.height // 2]


class TestBelts:
    """The kernel against the definition of what a rigid body rests on."""

    @settings(max_examples=examples(40), deadline=None)
    @given(seed=st.integers(0, 10**6), gravity=st.floats(-0.25, 0.25))
    def test_the_centre_of_gravity_is_as_low_as_the_ground_permits(
        self, seed: int, gravity: float
    ) -> None:
        """No ground is above the plane, and no slope along the belts puts it lower."""
        random = np.random.default_rng(seed)
        places, count = 9, 40
        heights = random.normal(0.0, 0.08, (2 * places, 1, count)).astype(np.float32)
        x = np.tile(np.linspace(-0.4, 0.4, places), 2)
        y = np.repeat([0.3, -0.3], places)
        offsets = np.column_stack([np.arange(2 * places), np.zeros((2 * places, 2), np.int64)])
        belts = Belts(
            offsets, np.column_stack([x, y]).astype(np.float32), places, 0.6, gravity, 1.0, 0.0
        )
        plane = np.empty((3, 1, count), np.float32)
        kernels.rest_belts(heights, 0, belts, plane)
        level, pitch, roll = plane[:, 0].astype(np.float64)
        over = heights[:, 0] - (level + np.outer(x, pitch) + np.outer(y, roll))
        assert over.max() < 1e-5
        # each belt touches
        assert over[:places].max(axis=0) == pytest.approx(0.0, abs=1e-5)
        assert over[places:].max(axis=0) == pytest.approx(0.0, abs=1e-5)

        def low(slope: Any) -> Any:
            highest = [
                (heights[part, 0] - np.multiply.outer(x[part], slope)).max(axis=0)
                for part in (slice(0, places), slice(places, None))
            ]
            return 0.5 * (highest[0] + highest[1]) + slope * gravity

        here = low(pitch)
        for other in np.linspace(-3.0, 3.0, 401):
            assert (low(np.full(count, other)) > here - 2e-5).all()

    def test_directions_are_those_of_the_world(self) -> None:
        """Heading north-east, 0.1 higher ahead and 0.05 higher on the left."""
        x, y = np.array([0.5, -0.5, 0.5, -0.5]), np.array([0.4, 0.4, -0.4, -0.4])
        heights = (0.1 * x + 0.05 * y).astype(np.float32)[:, None, None]
        offsets = np.column_stack([np.arange(4), np.zeros((4, 2), np.int64)])
        unit = math.sqrt(0.5)
        shifts = np.column_stack([x, y]).astype(np.float32)
        plane = np.empty((3, 1, 1), np.float32)
        kernels.rest_belts(heights, 0, Belts(offsets, shifts, 2, 0.8, 0.1, unit, unit), plane)
        east, north = 0.1 * unit - 0.05 * unit, 0.1 * unit + 0.05 * unit
        assert plane[:, 0, 0] == pytest.approx([0.0, east, north], abs=1e-5)


class TestGround:
    """Tracks on terrains, place by place."""

    def test_a_slope_is_that_of_the_ground(self) -> None:
        found = surveyed(ground(slope=0.25), crawler())
        pitch, roll = along(found, found.pitch), along(found, found.roll, NORTH)
        assert pitch[30:-30] == pytest.approx(math.atan(0.25), abs=2e-3)
        assert along(found, found.roll)[30:-30] == pytest.approx(0.0, abs=2e-3)
        # the ground rises to the right of who heads north
        assert roll[30:-30] == pytest.approx(-math.atan(0.25), abs=2e-3)

    @pytest.mark.parametrize(("width", "passes"), [(0.2, True), (0.27, True), (0.45, False)])
    def test_a_gap_up_to_the_centre_of_gravity_is_bridged(self, width: float, passes: bool) -> None:
        """0.35 m from the centre of gravity to the ends, less what pixels of 0.05 m leave open."""
        found = surveyed(ground(bar(-0.5, width)), crawler())
        verdict = along(found, found.verdict)[20:-20]
        assert (verdict != Verdict.NO_GO).all() == passes
        if passes:
            assert along(found, found.pitch)[20:-20] == pytest.approx(0.0, abs=1e-3)

    def test_a_centre_of_gravity_off_the_middle_shortens_the_gap(self) -> None:
        terrain = ground(bar(-0.5, 0.22))
        for cog, passes in ((0.0, True), (0.2, False)):
            found = surveyed(terrain, crawler(cog))
            assert (along(found, found.verdict)[20:-20] != Verdict.NO_GO).all() == passes

    def test_wheels_do_not_bridge_what_tracks_do(self) -> None:
        """The same gap stops a rover with wheels of the sprockets' radius."""
        from tests.surveys import ROVER

        found = surveyed(ground(bar(-0.5, 0.22)), ROVER)
        assert (along(found, found.verdict)[20:-20] == Verdict.NO_GO).any()

    @pytest.mark.parametrize(("height", "passes"), [(0.06, True), (0.12, False)])
    def test_a_wall_up_to_the_front_is_climbed(self, height: float, passes: bool) -> None:
        found = surveyed(ground(bar(height, 4, 6.0)), crawler())
        reasons = along(found, found.reason)[20:-30]
        verdict = along(found, found.verdict)[20:-30]
        assert (verdict != Verdict.NO_GO).all() == passes
        assert (Reason.STEP in reasons[verdict == Verdict.NO_GO]) == (not passes)

    def test_a_crest_across_both_tracks_lifts_the_body_with_them(self) -> None:
        """A ridge higher than the clearance: the tracks rest on it, and the body stays above it."""
        found = surveyed(ground(bar(0.15, 1.2, kind="ridge")), crawler(clearance=0.1))
        barred = along(found, found.verdict) != Verdict.GO
        assert Reason.HIGH_CENTRED not in along(found, found.reason)[20:-20][barred[20:-20]]
        # over the crest it pitches from one side to the other
        pitch = along(found, found.pitch)
        assert np.nanmax(pitch) > math.atan(0.15) and np.nanmin(pitch) < -math.atan(0.15)

    def test_what_stands_between_the_tracks_reaches_the_body(self) -> None:
        """A post of 0.15 m between the tracks, under a body 0.1 m high."""
        post = {
            "type": "box", "at": [4, 3], "extent": [0.2, 0.2], "vScale": 0.15, "surface": "rock",
        }  # fmt: skip
        found = surveyed(ground(post), crawler())
        row, column = found.grid.height // 2, found.grid.width // 2
        assert found.reason[EAST, row, column] == Reason.HIGH_CENTRED
        assert found.verdict[EAST, row, column] == Verdict.NO_GO
        high = surveyed(ground(post), crawler(clearance=0.3))
        assert high.verdict[EAST, row, column] == Verdict.GO

    def test_opposite_headings_differ_with_the_centre_of_gravity(self) -> None:
        """Where its front hangs over an edge it tips with the weight ahead, and not behind."""
        terrain = ground(bar(-0.4, 4, 6.0))
        found = surveyed(terrain, crawler(0.2))
        column = round(3.9 / 0.05)
        ahead, back = (found.pitch[h, found.grid.height // 2, column] for h in (EAST, EAST + 4))
        assert ahead < -0.3 and back == pytest.approx(0.0, abs=1e-4)
