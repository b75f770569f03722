"""Surveys and maps: terrains whose verdict is known by hand, and slow readings of the same."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window, grid_over
from terratool.traversability.footprint import directions
from terratool.traversability.ground import GroundPainter
from terratool.traversability.limits import wheel_loads
from terratool.traversability.map_results import Survey
from terratool.traversability.parameters import soil_table
from terratool.traversability.steps import gap_width, step_of
from terratool.traversability.survey import Surveyor, WindowMeasures
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Margins, Overhang, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from terratool.traversability.wheel import SoilArrays
from tests.budget import examples
from tests.conftest import terrain_of
from tests.strategies import definitions
from tests.surveys import judged

ROVER = Vehicle(
    Wheel(0.2, 0.1, slips=False),
    (Axle(0.5), Axle(-0.5)),
    mass=40.0,
    gravity=10.0,
    track_width=0.8,
    cog_height=0.1,
    clearance=0.3,
    body_width=0.7,
)
"""Four wheels with 100 N each: those of the checked reference values."""

NORTH, EAST, SOUTH, WEST = 0, 2, 4, 6
FACES = {"east": EAST, "west": WEST, "north": NORTH, "south": SOUTH}

E1: dict[str, Any] = {"cohesion": 1, "fricAngle": 30, "sinkage": 0.1}
RIGID: dict[str, Any] = {"cohesion": 0, "fricAngle": 35, "sinkage": 0}


def facing(side: str, curve: list[Any], surface: dict[str, Any], scale: float) -> Terrain:
    """A curve along 12 m of an oblong terrain, from where one comes to the side that it faces.

    What is ahead of who looks to that side comes later in the curve.
    """
    axis = "x" if side in ("east", "west") else "y"
    if side in ("west", "south"):
        curve = [[1 - t, z] for t, z in reversed(curve)]
    other = "y" if axis == "x" else "x"
    return terrain_of(
        {
            "size": [12, 9] if axis == "x" else [9, 12],
            "surfTypes": {"soil": surface},
            "elemTypes": {"curve": {axis: curve, other: [1]}},
            "elemTree": {"type": "curve", "surface": "soil", "vScale": scale},
        }
    )


def cut(side: str, along: float) -> tuple[Any, Any]:
    """Rows and columns, of a grid of 0.05 m, of the cell so far along the middle of `facing`."""
    n = round(along / 0.05 - 0.5)
    n = n if side in ("east", "south") else 239 - n
    if side == "south":
        n = round(along / 0.05 - 0.5)
    return (90, n) if side in ("east", "west") else (n, 90)


def surveyed(terrain: Terrain, vehicle: Vehicle = ROVER, resolution: float = 0.05) -> Survey:
    return survey(terrain, vehicle, grid_over(terrain, resolution), threads=1)


def slope(side: str, degrees: float, surface: dict[str, Any] = E1) -> Terrain:
    """A plane that rises to a side."""
    return facing(side, [[0, 0], [1, 1]], surface, 12 * math.tan(math.radians(degrees)))


class TestPlane:
    """A plane of known slope, facing each way."""

    @pytest.mark.parametrize("side", FACES)
    def test_pitch_and_roll(self, side: str) -> None:
        """Nose up where it faces the rise, down where it looks back, on its side in between."""
        found = survey(slope(side, 12), ROVER, grid_over(slope(side, 12), 0.25), headings=16)
        ahead = FACES[side] * 2
        middle = np.s_[:, 20, 20]
        for n in range(16):
            turned = math.radians(22.5 * (n - ahead))  # clockwise from the rise
            rise = math.tan(math.radians(12))
            pitch, roll = math.atan(rise * math.cos(turned)), math.atan(rise * math.sin(turned))
            assert found.pitch[middle][n] == pytest.approx(pitch, abs=1e-5)
            # who has turned clockwise has the rise on the left
            assert found.roll[middle][n] == pytest.approx(roll, abs=1e-5)

    @pytest.mark.parametrize("side", FACES)
    @pytest.mark.parametrize(
        ("degrees", "torque", "verdict", "reason"),
        [
            (22.3, math.inf, Verdict.CAUTION, Reason.TRACTION),
            (22.5, math.inf, Verdict.NO_GO, Reason.TRACTION),
            (20.1, 12.0, Verdict.CAUTION, Reason.TORQUE),
            (20.4, 12.0, Verdict.NO_GO, None),
        ],
    )
    def test_climbs_to_the_reference_value(
        self, side: str, degrees: float, torque: float, verdict: Verdict, reason: Reason | None
    ) -> None:
        """22.39744°, or 20.25159° with 12 N m for each wheel, and no more."""
        vehicle = replace(ROVER, cog_height=0.4, wheel=replace(ROVER.wheel, max_torque=torque))
        found = surveyed(slope(side, degrees), vehicle, 0.25)
        here = FACES[side], 20, 20
        assert found.verdict[here] == verdict
        if reason is not None:
            assert found.reason[here] == reason
        assert (found.energy[here] == math.inf) == (verdict == Verdict.NO_GO)

    @pytest.mark.parametrize(("degrees", "held"), [(34.5, True), (35.5, False)])
    @pytest.mark.parametrize("side", FACES)
    def test_rigid_ground_holds_up_to_its_friction(
        self, side: str, degrees: float, held: bool
    ) -> None:
        """At every heading, up, down and across: 35°."""
        found = surveyed(slope(side, degrees, RIGID), ROVER, 0.25)
        verdicts = found.verdict[:, 20, 20]
        assert (verdicts == (Verdict.CAUTION if held else Verdict.NO_GO)).all()
        across = found.reason[(FACES[side] + 2) % 8, 20, 20]
        assert across == Reason.SIDE_SLIP

    @pytest.mark.parametrize(("degrees", "stands"), [(30.5, True), (31.5, False)])
    def test_tips_over_sideways_only(self, degrees: float, stands: bool) -> None:
        """atan((track/2)/h) = 31°, where the wheelbase permits more."""
        high = replace(ROVER, cog_height=0.4 / math.tan(math.radians(31)))
        found = surveyed(slope("east", degrees, {**RIGID, "fricAngle": 60}), high, 0.25)
        across = found.verdict[NORTH, 20, 20], found.reason[NORTH, 20, 20]
        assert across == (Verdict.CAUTION if stands else Verdict.NO_GO, Reason.TIP_OVER)
        assert found.verdict[EAST, 20, 20] != Verdict.NO_GO

    def test_margins_come_off(self) -> None:
        """A slope margin of 5° makes 18° what 23° are."""
        kept = replace(ROVER, cog_height=0.4, margins=Margins(slope=math.radians(5)))
        assert surveyed(slope("east", 17.2), kept, 0.25).verdict[EAST, 20, 20] == Verdict.CAUTION
        assert surveyed(slope("east", 17.6), kept, 0.25).verdict[EAST, 20, 20] == Verdict.NO_GO

    def test_energy_is_the_lift_and_the_friction(self) -> None:
        """On rigid ground m g sin α for each metre along the slope; nothing downhill."""
        found = surveyed(slope("north", 10, RIGID), ROVER, 0.25)
        assert found.energy[NORTH, 20, 20] == pytest.approx(
            400 * math.sin(math.radians(10)), rel=1e-3
        )
        assert found.energy[SOUTH, 20, 20] == 0


def step(side: str, height: float) -> Terrain:
    return facing(side, [[0, 0], [0.5, 0], [0.5, 1], [1, 1]], RIGID, height)


class TestStep:
    """One kerb, 6 m along."""

    LIMIT = step_of(ROVER, math.tan(math.radians(35))).height

    @pytest.mark.parametrize("side", FACES)
    def test_below_the_limit_it_passes(self, side: str) -> None:
        """At every heading, everywhere but at the edge."""
        found = surveyed(step(side, 0.98 * self.LIMIT))
        inner = found.verdict[:, 30:-30, 30:-30]
        assert ((inner == Verdict.GO) | (inner == Verdict.CAUTION)).all()
        before = (FACES[side], *cut(side, 5.4))  # the front wheels are 0.1 m short of it
        assert found.verdict[before] == Verdict.CAUTION
        assert found.reason[before] == Reason.STEP
        assert found.utilisation[before] == pytest.approx(0.98, abs=1e-3)

    @pytest.mark.parametrize("side", FACES)
    def test_a_wall_out_of_reach_is_nothing(self, side: str) -> None:
        """Wheels that end 0.08 m before a wall are not rough; where they reach it, it is a step."""
        found = surveyed(step(side, 1.0))
        far, near = (FACES[side], *cut(side, 5.2)), (FACES[side], *cut(side, 5.4))
        assert found.verdict[far] == Verdict.GO and found.reason[far] != Reason.ROUGHNESS
        assert (found.verdict[near], found.reason[near]) == (Verdict.NO_GO, Reason.STEP)

    @pytest.mark.parametrize("side", FACES)
    def test_above_the_limit_it_bars(self, side: str) -> None:
        """Who faces it, up and down; not who goes along it, nor who has it behind."""
        found = surveyed(step(side, 1.02 * self.LIMIT))
        ahead, back = FACES[side], (FACES[side] + 4) % 8
        for heading, at in ((ahead, 5.4), (back, 6.6)):
            here = (heading, *cut(side, at))
            assert (found.verdict[here], found.reason[here]) == (Verdict.NO_GO, Reason.STEP)
            assert found.utilisation[here] == pytest.approx(1.02, abs=1e-3)
        for heading, at in ((ahead, 4.5), (ahead, 7.0), (back, 7.5), (back, 5.0)):
            assert found.verdict[(heading, *cut(side, at))] == Verdict.GO
        for at in (5.2, 5.6, 6.0, 6.4, 6.8):  # beside it and astride of it
            for heading in ((ahead + 2) % 8, (ahead + 6) % 8):
                assert found.reason[(heading, *cut(side, at))] != Reason.STEP
                assert found.verdict[(heading, *cut(side, at))] != Verdict.NO_GO

    def test_no_way_around_through_any_cell(self) -> None:
        """Each line of cells that crosses it is barred, at each heading that crosses it."""
        found = surveyed(step("east", 1.02 * self.LIMIT), resolution=0.15)
        rows = slice(12, -12)
        for heading in (1, EAST, 3):
            assert (found.verdict[heading, rows] == Verdict.NO_GO).any(axis=1).all()

    @pytest.mark.parametrize("height", [0.05, 0.11])
    def test_height_is_that_of_the_wall(self, height: float) -> None:
        """Whatever the pixels make of it, on a slope too."""
        rise = 12 * math.tan(math.radians(10))
        terrain = terrain_of(
            {
                "size": [12, 9],
                "surfTypes": {"soil": RIGID},
                "elemTypes": {
                    "kerb": {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]], "y": [1]},
                    "ramp": {"x": [[0, 0], [1, 1]], "y": [1]},
                },
                "elemTree": {
                    "type": "ramp", "surface": "soil", "vScale": rise, "cells": 1,
                    "children": [{"type": "kerb", "cellX": 0, "cellY": 0, "vScale": height}],
                },
            }
        )  # fmt: skip
        measures = Surveyor(terrain, ROVER, grid_over(terrain, 0.05)).measure(
            Window(80, 60, 20, 120)
        )
        assert measures.step[EAST].max() == pytest.approx(height, abs=0.006)
        assert measures.step[NORTH].max() < 0.1 * height

    def test_slope_along_a_wall_is_no_step(self) -> None:
        """Who climbs astride of a wall that runs with him meets none."""
        terrain = terrain_of(
            {
                "size": [12, 9],
                "surfTypes": {"soil": RIGID},
                "elemTypes": {
                    "kerb": {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]], "y": [1]},
                    "ramp": {"x": [1], "y": [0, 1]},
                },
                "elemTree": {
                    "type": "ramp", "surface": "soil", "vScale": 9 * math.tan(math.radians(15)),
                    "cells": 1,
                    "children": [{"type": "kerb", "cellX": 0, "cellY": 0, "vScale": 0.1}],
                },
            }
        )  # fmt: skip
        measures = Surveyor(terrain, ROVER, grid_over(terrain, 0.05)).measure(
            Window(80, 100, 10, 40)
        )
        assert measures.step[[NORTH, SOUTH]].max() < 0.01
        assert measures.step[EAST].max() == pytest.approx(0.1, abs=0.002)

    @pytest.mark.parametrize("side", FACES)
    @pytest.mark.parametrize(("apart", "height"), [(0.005, 0.12), (0.03, 0.12), (0.06, 0.0918)])
    @pytest.mark.parametrize(("at", "resolution"), [(6.013, 0.05), (6.013, 0.1), (6.047, 0.1)])
    def test_walls_close_by_are_one_step(
        self, side: str, apart: float, height: float, at: float, resolution: float
    ) -> None:
        """A wheel on the edges of two kerbs of 0.06 m touches the upper as high as by geometry.

        Wherever pixels fall. The chord of 0.06 m and 0.06 m lies at 45° and is 0.0849 m long, so
        the wheel touches at 45° + asin(0.0849/0.4) = 57.2°: 0.2 (1 - cos 57.2°) = 0.0918 m.
        """
        kerbs = [[0, 0], [at / 12, 0], [at / 12, 1], [(at + apart) / 12, 1],
                 [(at + apart) / 12, 2], [1, 2]]  # fmt: skip
        terrain = facing(side, kerbs, RIGID, 0.06)
        grid = grid_over(terrain, resolution)
        flat = side in ("east", "west")
        line, first, last = (round(n / resolution) for n in (4.5, 4.0, 8.0))
        window = (
            Window(line, first, 1, last - first) if flat else Window(first, line, last - first, 1)
        )
        measures = Surveyor(terrain, ROVER, grid).measure(window)
        for heading in (FACES[side], (FACES[side] + 4) % 8):
            assert measures.step[heading].max() == pytest.approx(height, abs=1e-3)

    def test_walls_far_apart_are_steps_of_their_own(self) -> None:
        """Stairs of 0.05 m every 0.15 m: a wheel stands on one before it touches the next."""
        stairs = [[0, 0]]
        for n in range(4):
            stairs += [[(6 + 0.15 * n) / 12, n], [(6 + 0.15 * n) / 12, n + 1]]
        terrain = facing("east", [*stairs, [1, 4]], RIGID, 0.05)
        measures = Surveyor(terrain, ROVER, grid_over(terrain, 0.05)).measure(Window(90, 80, 1, 80))
        assert measures.step[EAST].max() == pytest.approx(0.05, abs=1e-3)

    @pytest.mark.parametrize("place", np.linspace(0, 1, 12, endpoint=False))
    def test_no_wall_lies_between_cells_of_a_diagonal(self, place: float) -> None:
        """Coarse cells are farther apart obliquely; what is between them must be seen as well."""
        short = replace(ROVER, axles=(Axle(1e-3), Axle(-1e-3)), body_width=0.0)
        # the wall runs from north-west to south-east, through the middle of the square
        middle = {"x": [[0, 0], [0.5, 0], [0.5, 1], [1, 1]], "y": [1]}
        terrain = terrain_of(
            {
                "size": [20, 20],
                "surfTypes": {"soil": RIGID},
                "elemTypes": {"kerb": middle},
                "elemTree": {
                    "type": "kerb", "surface": "soil", "vScale": 0.5, "turnDeg": -45,
                },
            }
        )  # fmt: skip
        grid = Grid(place, place, 1.0, 19, 19)
        found = Surveyor(terrain, short, grid).measure(Window(4, 4, 11, 11))
        assert any(found.verdict[1, 10 - n, n] == Verdict.NO_GO for n in range(11))

    def test_steep_face_without_a_wall_counts(self) -> None:
        """A bank of 63° as high as the limit and a fifth more bars, though no wall stands there."""
        height = 1.2 * self.LIMIT
        bank = [[0, 0], [0.5, 0], [0.5 + 0.5 * height / 12, 1], [1, 1]]
        found = surveyed(facing("east", bank, RIGID, height))
        assert found.verdict[(EAST, *cut("east", 5.4))] == Verdict.NO_GO
        assert found.reason[(EAST, *cut("east", 5.4))] == Reason.STEP


class TestGap:
    """One trench, a metre deep, from 6 m along."""

    @pytest.mark.parametrize("side", FACES)
    @pytest.mark.parametrize(("share", "passes"), [(0.9, True), (1.1, False)])
    def test_known_width(self, side: str, share: float, passes: bool) -> None:
        """2 r sin α passes, as the wheel does not sink in deeper than the step that it climbs."""
        width = share * float(gap_width(0.2, TestStep.LIMIT))
        trench = [
            [0, 0],
            [0.5, 0],
            [0.5, -1],
            [0.5 + width / 12, -1],
            [0.5 + width / 12, 0],
            [1, 0],
        ]
        terrain = facing(side, trench, RIGID, 1.0)
        along = side in ("east", "west")
        window = Window(200, 250, 40, 150) if along else Window(250, 200, 150, 40)
        found = Surveyor(terrain, ROVER, grid_over(terrain, 0.02)).measure(window)
        lines = found.verdict[FACES[side]] == Verdict.NO_GO
        barred = lines.any(axis=1 if side in ("east", "west") else 0)
        assert barred.all() != passes
        if passes:
            assert not barred.any()


class TestRidge:
    """A crest between two planes, at 6 m."""

    @pytest.mark.parametrize("side", FACES)
    @pytest.mark.parametrize(("more", "passes"), [(-0.4, True), (0.4, False)])
    def test_breakover(self, side: str, more: float, passes: bool) -> None:
        """The exact angle between two wheels, 35.48709° for 0.15 m of clearance."""
        low = replace(ROVER, clearance=0.15)
        angle = 0.5 * (35.48709 + more)
        top = 6 * math.tan(math.radians(angle))
        terrain = facing(side, [[0, 0], [0.5, 1], [1, 0]], {**RIGID, "fricAngle": 45}, top)
        grid = grid_over(terrain, 0.05)
        # the crest runs along a line of centres
        grid = Grid(0.025, 0.025, 0.05, grid.height - 1, grid.width - 1)
        window = Window(80, 115, 10, 8) if side in ("east", "west") else Window(115, 80, 8, 10)
        found = Surveyor(terrain, low, grid).measure(window)
        middle = FACES[side], *((5, 4) if side in ("east", "west") else (4, 5))
        assert found.reason[middle] == Reason.HIGH_CENTRED
        assert found.verdict[middle] == (Verdict.CAUTION if passes else Verdict.NO_GO)

    def test_along_the_crest_it_passes(self) -> None:
        """Where both sides fall away, nothing touches."""
        terrain = facing("east", [[0, 0], [0.5, 1], [1, 0]], RIGID, 1.0)
        found = surveyed(terrain, replace(ROVER, clearance=0.15))
        assert found.verdict[(NORTH, *cut("east", 6.025))] != Verdict.NO_GO

    @pytest.mark.parametrize("side", FACES)
    def test_front_overhang_meets_a_ramp(self, side: str) -> None:
        """31.65446° for 0.3 m at 0.15 m: at its foot no steeper, and only in front."""
        long = replace(ROVER, front=Overhang(0.3, 0.15))
        for degrees, passes in ((31.0, True), (32.4, False)):
            top = 6 * math.tan(math.radians(degrees))
            terrain = facing(side, [[0, 0], [0.5, 0], [1, 1]], {**RIGID, "fricAngle": 60}, top)
            vertical = side in ("north", "south")
            grid = grid_over(terrain, 0.02)
            first = 230 if side in ("east", "south") else 290
            window = Window(first, 200, 80, 4) if vertical else Window(200, first, 4, 80)
            found = Surveyor(terrain, long, grid).measure(window)
            hit = found.reason[FACES[side]] == Reason.APPROACH
            hit &= found.verdict[FACES[side]] == Verdict.NO_GO
            assert hit.any() != passes
            # who comes down meets the level ground with it, when he is above the foot
            along = np.argwhere(found.reason[FACES[side]] == Reason.APPROACH)
            back = np.argwhere(found.reason[(FACES[side] + 4) % 8] == Reason.APPROACH)
            place = 0 if vertical else 1
            later = np.median(back[:, place]) > np.median(along[:, place])
            assert later == (side in ("east", "south"))


class TestGround:
    """No ground, no soil, the edge."""

    def test_edge(self) -> None:
        """The footprint, not the middle, must lie on the terrain: 0.7 m ahead, 0.45 m aside."""
        found = surveyed(slope("east", 0), ROVER, 0.1)
        edge = found.reason == Reason.EDGE
        assert (found.verdict[edge] == Verdict.NO_GO).all()
        for heading, rows, columns in ((NORTH, 7, 4), (EAST, 4, 7)):
            inside = ~edge[heading]
            # centres are at 0.05, 0.15, …
            want = np.zeros_like(inside)
            want[rows:-rows, columns:-columns] = True
            assert np.array_equal(inside[:, 20:-20], want[:, 20:-20])
            assert np.array_equal(inside[20:-20], want[20:-20])

    def test_hole_under_a_wheel(self) -> None:
        """Where a wheel has no ground it is no-go, though the middle has some."""
        terrain = terrain_of(
            {
                "size": [12, 9],
                "surfTypes": {"soil": RIGID, "hole": {"void": True}},
                "elemTypes": {"flat": {"x": [0]}},
                "elemTree": {
                    "type": "flat", "surface": "soil", "cells": [12, 9],
                    "children": [{"type": "flat", "surface": "hole", "cellX": 8, "cellY": 3}],
                },
            }
        )  # fmt: skip
        found = surveyed(terrain, resolution=0.1)
        # the front right wheel stands 0.5 m ahead and 0.4 m to the right
        for heading, x, y in ((NORTH, 8.1, 3.0), (EAST, 8.0, 3.9), (SOUTH, 8.9, 4.0)):
            here = heading, round((9 - y) / 0.1 - 0.5), round(x / 0.1 - 0.5)
            assert (found.verdict[here], found.reason[here]) == (Verdict.NO_GO, Reason.NO_GROUND)
        assert np.isnan(found.heights[55, 85])
        assert found.verdict[NORTH, 20, 60] == Verdict.GO

    @pytest.mark.parametrize("side", FACES)
    def test_goes_close_beside_a_tall_wall(self, side: str) -> None:
        """Half a metre from the middle a wall of 2 m is none of its business; at 0.4 m it is."""
        wall = [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]
        found = surveyed(facing(side, wall, RIGID, 2.0))
        for heading in ((FACES[side] + 2) % 8, (FACES[side] + 6) % 8):
            assert found.verdict[(heading, *cut(side, 5.5))] == Verdict.GO
            assert found.verdict[(heading, *cut(side, 5.6))] == Verdict.NO_GO

    def test_soil_that_lacks_something(self) -> None:
        """Unknown; but a step that no soil would permit is no-go even so."""
        bare = {"cohesion": 1, "fricAngle": 30}
        terrain = facing("east", [[0, 0], [0.5, 0], [0.5, 1], [1, 1]], bare, 0.5)
        found = surveyed(terrain)
        far, near = (EAST, *cut("east", 3.0)), (EAST, *cut("east", 5.4))
        assert (found.verdict[far], found.reason[far]) == (Verdict.UNKNOWN, Reason.SOIL_UNKNOWN)
        assert np.isnan(found.utilisation[far])
        assert (found.verdict[near], found.reason[near]) == (Verdict.NO_GO, Reason.STEP)

    def test_roughness(self) -> None:
        """Waves between whose crests the wheels fall in, not a plane, are rough."""
        wave = [[0, 0.0], *([n / 40, float(n % 2)] for n in range(1, 40)), [1, 0.0]]
        rough = Surveyor(*_with_grid(facing("east", wave, RIGID, 0.15), 0.05))
        flat = Surveyor(*_with_grid(slope("east", 12), 0.05))
        window = Window(80, 100, 10, 20)
        assert flat.measure(window).rough.max() < 1e-5
        # of a triangle between 0 and h the RMS is h/√12, less what wheels bridge
        assert 0.5 < np.median(rough.measure(window).rough[EAST]) / (0.15 / math.sqrt(12)) < 1.1


def _with_grid(terrain: Terrain, resolution: float) -> tuple[Terrain, Vehicle, Grid]:
    return terrain, ROVER, grid_over(terrain, resolution)


class TestSingleWheel:
    """A wheel by itself."""

    WHEEL = Vehicle.single(Wheel(0.2, 0.1, slips=False), 100.0)

    @pytest.mark.parametrize("side", FACES)
    @pytest.mark.parametrize(("degrees", "verdict"), [(22.5, 2), (23.1, 3)])
    def test_climbs(self, side: str, degrees: float, verdict: int) -> None:
        """22.77716° for E1."""
        found = surveyed(slope(side, degrees), self.WHEEL, 0.1)
        assert found.verdict[FACES[side], 45, 45] == verdict
        assert found.pitch[FACES[side], 45, 45] == pytest.approx(math.radians(degrees), abs=1e-5)

    def test_kerb_is_no_slope(self) -> None:
        """A wall under a wheel adds nothing to the slope of the ground."""
        found = surveyed(step("east", 0.1), self.WHEEL)
        assert np.abs(found.pitch[:, 30:-30, 30:-30]).max() < 1e-6
        limit = step_of(self.WHEEL, math.tan(math.radians(35))).height
        assert limit < 0.1
        assert found.reason[(EAST, *cut("east", 5.9))] == Reason.STEP


def slow(terrain: Terrain, grid: Grid, at: tuple[int, int], heading: int) -> Any:
    """Pitch, roll, clearance and loads of the rover at a pixel, read point by point.

    Wheels stand between the pixels around them. Their circles touch the centres of pixels, and
    their crests: where these lie is taken from what was painted (test_crests.py has it from the
    field), and which of them are met is worked out here.
    """
    resolution, reach = grid.resolution, 20
    east, north = directions(8)[heading]
    window = Window(at[0] - reach, at[1] - reach, 2 * reach + 1, 2 * reach + 1)
    crests = GroundPainter(terrain, grid, 0.004, False, [0.2]).paint(window).crests
    x, y = (float(v[reach]) for v in (grid.columns(window), grid.rows(window)))

    def world(along: float, left: float) -> tuple[float, float]:
        return along * east - left * north, along * north + left * east

    def around(column: int, row: int, most: int) -> tuple[Any, ...]:
        """What stands out around a pixel, so far from the reference point: centres, then crests."""
        rows, columns = (v.ravel() for v in np.mgrid[-most : most + 1, -most : most + 1])
        dx, dy = columns * resolution, rows * resolution
        z = terrain.height(x + column * resolution + dx, y + row * resolution + dy)
        up, right = reach - crests.row - row, crests.column - reach - column
        near = np.maximum(np.abs(up), np.abs(right)) <= most
        dx = np.append(dx, (right * resolution + crests.east)[near])
        dy = np.append(dy, (up * resolution + crests.north)[near])
        z = np.append(z, crests.height[near])
        return dx, dy, dx * east + dy * north, dy * east - dx * north, z

    def touched(column: int, row: int) -> float:
        _, _, along, left, z = around(column, row, 6)
        # at least a line of pixels, none twice as wide
        wide = np.abs(left) <= 0.05 + 1e-9
        wide |= np.abs(left) < 0.5 * resolution * (abs(east) + abs(north)) - 1e-7
        circle = np.sqrt(np.maximum(0.0, 0.04 - along**2)) - 0.2
        return float((z + circle)[wide & (np.abs(along) <= 0.2 + 1e-9)].max())

    rows, supports = [], []
    for ahead, aside in ((0.5, 0.4), (0.5, -0.4), (-0.5, 0.4), (-0.5, -0.4)):
        shift_x, shift_y = world(ahead, aside)
        rows.append((1.0, shift_x, shift_y))
        column, row = shift_x / resolution, shift_y / resolution
        low, below = math.floor(column + 1e-9), math.floor(row + 1e-9)
        right, up = column - low, row - below
        supports.append(
            sum(
                share * touched(low + i, below + j)
                for i, j, share in (
                    (0, 0, (1 - right) * (1 - up)), (1, 0, right * (1 - up)),
                    (0, 1, (1 - right) * up), (1, 1, right * up),
                )
            )
        )  # fmt: skip
    level, slope_x, slope_y = np.linalg.lstsq(np.array(rows), np.array(supports), rcond=None)[0]
    pitch = math.atan(slope_x * east + slope_y * north)
    roll = math.atan(slope_y * east - slope_x * north)
    dx, dy, along, left, z = around(0, 0, 12)
    under = (np.abs(along) <= 0.5 + 1e-9) & (np.abs(left) <= 0.35 + 1e-9)
    most = float((z - (level + slope_x * dx + slope_y * dy))[under].max())
    down = 1 / math.sqrt(1 + slope_x**2 + slope_y**2)
    return pitch, roll, 0.3 - max(0.0, most) * down, wheel_loads(ROVER, pitch, roll)


class TestSlowly:
    """Against readings of the field at single points."""

    @settings(max_examples=examples(12))
    @given(
        rises=st.lists(st.integers(-60, 60), min_size=8, max_size=8),
        others=st.lists(st.integers(-60, 60), min_size=6, max_size=6),
        heading=st.integers(0, 7),
    )
    def test_pose_and_clearance(self, rises: list[int], others: list[int], heading: int) -> None:
        """Pitch, roll, clearance, and by the loads what is asked of the soil.

        The crests of two curves cross anywhere under the vehicle.
        """
        along, across = (np.cumsum([0, *slopes]) / 100 for slopes in (rises, others))
        terrain = terrain_of(
            {
                "size": [12, 9],
                "surfTypes": {"soil": RIGID},
                "elemTypes": {
                    "hills": {
                        "x": along.tolist(), "y": across.tolist(),
                        "combine": "sum",
                    }
                },
                "elemTree": {"type": "hills", "surface": "soil", "vScale": 1},
            }
        )  # fmt: skip
        grid = grid_over(terrain, 0.08)
        measures = Surveyor(terrain, ROVER, grid).measure(Window(40, 50, 2, 3))
        pitch, roll, clearance, loads = slow(terrain, grid, (41, 51), heading)
        here = heading, 1, 1
        utilisation, found_pitch, found_roll = measures.numbers[heading, :3, 1, 1]
        assert (found_pitch, found_roll) == pytest.approx((pitch, roll), abs=1e-5)
        assert measures.clearance[here] == pytest.approx(clearance, abs=1e-5)
        forward = 400 * math.sin(abs(pitch))
        used = forward / (loads.sum() * math.tan(math.radians(35)))
        assert utilisation >= used - 0.01
        if measures.reason[here] == Reason.TRACTION:
            assert utilisation == pytest.approx(used, abs=0.01)


class TestTables:
    """What is interpolated, against what is computed."""

    @pytest.mark.parametrize(
        "soil", [E1, RIGID, {**E1, "shearModulus": 0.025}, {**E1, "cohesion": 20, "fricAngle": 16}]
    )
    @pytest.mark.parametrize(
        "vehicle",
        [
            replace(ROVER, cog_height=0.4),
            replace(ROVER, cog_height=0.4, wheel=Wheel(0.2, 0.1, 8.0, slips=False)),
            replace(ROVER, cog_height=0.4, wheel=Wheel(0.2, 0.1, 9.0)),
            replace(
                ROVER,
                wheel=Wheel(0.2, 0.1, grouser_height=0.02),
                axles=(Axle(0.5), Axle(-0.5, wheel=Wheel(0.15, 0.12, patch_pressure=7e3))),
            ),
            replace(ROVER, axles=(Axle(0.5), Axle(0.1, 2, False), Axle(-0.5))),
        ],
    )
    def test_near(self, soil: dict[str, Any], vehicle: Vehicle) -> None:
        """Within 0.08 everywhere, 0.03 nearly everywhere; no limit is crossed.

        Tables are for wheels that stand on one soil or on two: the same soil under three ids is
        computed.
        """
        vehicle = replace(vehicle, clearance=math.inf)
        soils, steps = soil_table(slope("east", 0, soil), vehicle)
        thrice = SoilArrays(*(np.append(column, column[[1, 1]]) for column in soils))
        table = thrice, np.append(steps, steps[[1, 1]])
        slopes = np.random.default_rng(1).uniform(-0.5, 0.5, (1500, 2))
        wheels = vehicle.wheels
        found = judged(vehicle, table, slopes, [1] * wheels)
        wanted = judged(vehicle, table, slopes, [1] * (wheels - 2) + [2, 3])
        two = judged(vehicle, table, slopes, [2] + [1] * (wheels - 1))
        assert np.array_equal(found, two, equal_nan=True)
        direct = ((found == wanted) | (np.isnan(found) & np.isnan(wanted))).all(axis=0)
        assert direct.sum() < 300
        moves = np.isfinite(wanted[kernels.ENERGY])
        assert np.array_equal(np.isfinite(found[kernels.ENERGY]), moves)
        with np.errstate(invalid="ignore"):
            off = np.abs(found - wanted)
        assert max(off[kernels.RESERVE]) < 0.02 and max(off[kernels.SINKAGE, moves]) < 1e-3
        used = off[kernels.UTILISATION, moves & ~direct]
        assert max(used) < 0.08 and np.quantile(used, 0.99) < 0.03
        assert np.nanmax(off[kernels.SLIP, moves], initial=0.0) < 0.02


NUMBERS = ("utilisation", "pitch", "roll", "sinkage", "slip", "energy")


class TestWindows:
    """Whole, windows and threads."""

    @settings(max_examples=examples(8))
    @given(definition=definitions() | definitions(free=True), parts=st.sampled_from([1, 3]))
    def test_windows_are_parts_of_the_whole(self, definition: Any, parts: int) -> None:
        """To the last bit, whatever the threads."""
        terrain = terrain_of(definition)
        radius = max(terrain.size) / 40
        vehicle = replace(
            ROVER,
            wheel=Wheel(radius, radius),
            axles=(Axle(2 * radius), Axle(-2 * radius)),
            track_width=3 * radius,
            cog_height=radius,
            clearance=radius,
            body_width=3 * radius,
            rear=Overhang(2 * radius, radius),
        )
        resolution = radius * (0.5 if parts == 1 else 1.2)
        grid = grid_over(terrain, resolution) if min(terrain.size) > 2 * resolution else None
        if grid is None:
            return
        whole = survey(terrain, vehicle, grid, threads=2)
        assert not (whole.reason[whole.verdict == Verdict.NO_GO] == Reason.NONE).any()
        assert np.array_equal(np.isnan(whole.utilisation), whole.verdict == Verdict.UNKNOWN)
        surveyor = Surveyor(terrain, vehicle, grid)
        for window in grid.windows(17, 23):
            part = surveyor.measure(window)
            rows = slice(window.row, window.row + window.height)
            columns = slice(window.column, window.column + window.width)
            mine = {name: part.numbers[:, getattr(kernels, name.upper())] for name in NUMBERS}
            mine |= {"verdict": part.verdict, "reason": part.reason, "heights": part.heights}
            for name, values in mine.items():
                theirs = getattr(whole, name)[..., rows, columns]
                assert values.tobytes() == theirs.tobytes(), name


def one_plane(terrain: Terrain, resolution: float) -> WindowMeasures:
    return Surveyor(terrain, ROVER, grid_over(terrain, resolution)).measure(Window(60, 60, 3, 4))


class TestOtherFilters:
    """The formulas of leggedrobotics' traversability_estimation, on terrains where they agree."""

    @pytest.mark.parametrize("degrees", [3, 17, 33])
    def test_slope(self, degrees: float) -> None:
        """1 − acos(n_z)/1.0 of the surface normal is 1 − slope on a plane."""
        terrain = slope("east", degrees, RIGID)
        normal_z = terrain.normal(6.0, 4.5)[2]
        theirs = 1 - math.acos(normal_z) / 1.0
        found = surveyed(terrain, ROVER, 0.25)
        assert 1 - found.pitch[EAST, 18, 24] == pytest.approx(theirs, abs=1e-5)
        assert 1 + found.roll[NORTH, 18, 24] == pytest.approx(theirs, abs=1e-5)

    @pytest.mark.parametrize("height", [0.03, 0.09])
    def test_step(self, height: float) -> None:
        """1 − (largest − smallest height of a window)/0.12, the window about a wheel at a kerb."""
        terrain = step("east", height)
        measures = Surveyor(terrain, ROVER, grid_over(terrain, 0.05)).measure(
            Window(90, 100, 1, 20)
        )
        heights = terrain.height(np.linspace(5.6, 6.4, 17), 4.5)
        theirs = 1 - (heights.max() - heights.min()) / 0.12
        assert 1 - measures.step[EAST].max() / 0.12 == pytest.approx(theirs, abs=1e-5)

    def test_roughness(self) -> None:
        """1 − RMS/0.05 about the plane fitted to a window, of waves that wheels follow."""
        curve = [[t, 0.05 * math.cos(2 * math.pi * 6 * t)] for t in np.linspace(0, 1, 241)]
        terrain = facing("east", curve, RIGID, 1.0)
        grid = grid_over(terrain, 0.05)
        measures = Surveyor(terrain, ROVER, grid).measure(Window(90, 118, 1, 1))
        x, y = grid.columns(Window(90, 118, 1, 1))[0], grid.rows(Window(90, 118, 1, 1))[0]
        dx, dy = (
            v.ravel() for v in np.meshgrid(np.arange(-10, 11) * 0.05, np.arange(-8, 9) * 0.05)
        )
        z = terrain.height(x + dx, y + dy)
        points = np.column_stack([np.ones_like(dx), dx, dy])
        rest = z - points @ np.linalg.lstsq(points, z, rcond=None)[0]
        theirs = 1 - math.sqrt(np.mean(rest**2)) / 0.05
        assert 1 - measures.rough[EAST, 0, 0] / 0.05 == pytest.approx(theirs, abs=0.05)


class TestRequests:
    """What makes no sense is said in a sentence."""

    @pytest.mark.parametrize("headings", [0, 3, 6, 68])
    def test_headings(self, headings: int) -> None:
        terrain = slope("east", 5)
        with pytest.raises(RequestError, match=r"headings is \d+\. Give a multiple of 4"):
            survey(terrain, ROVER, grid_over(terrain, 0.5), headings=headings)

    @pytest.mark.parametrize(("resolution", "word"), [(9.0, "coarse"), (0.002, "fine")])
    def test_resolution(self, resolution: float, word: str) -> None:
        terrain = slope("east", 5)
        with pytest.raises(RequestError, match=f"too {word} for .* Give at"):
            Surveyor(terrain, ROVER, grid_over(terrain, resolution))
