"""Crests and trenches wherever they lie between pixels, against exact limits and the field."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid, Window
from terratool.traversability import steps
from terratool.traversability.ground import GroundPainter
from terratool.traversability.soil import surface_figures
from terratool.traversability.survey import Surveyor, WindowMeasures
from terratool.traversability.vehicle import Axle, Vehicle, Wheel
from terratool.traversability.verdicts import Reason, Verdict
from tests.budget import examples
from tests.conftest import terrain_of

ROVER = Vehicle(
    Wheel(0.2, 0.1),
    (Axle(0.5), Axle(-0.5)),
    mass=40.0,
    gravity=10.0,
    track_width=0.8,
    cog_height=0.1,
    clearance=0.15,
    body_width=0.7,
)

FIRM: dict[str, Any] = {"cohesion": 0, "fricAngle": 60, "sinkage": 0}
SOUND: dict[str, Any] = {**FIRM, "fricAngle": 35}
HEADINGS = 32

turns = st.integers(0, HEADINGS - 1)
shares = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
resolutions = st.sampled_from([0.02, 0.03, 0.05, 0.15])


def breakover(vehicle: Vehicle) -> float:
    """The exact angle between two planes that the body just clears, for equal wheels; rad."""
    radius, half = vehicle.wheel.radius, 0.5 * vehicle.wheelbase
    low = radius - vehicle.clearance
    return 2.0 * (math.asin(radius / math.hypot(half, low)) - math.atan(low / half))


def stands_out(angle: float) -> float:
    """How high a crest stands above the plane of the wheels, the rover's middle over it, m.

    Its sides fall by an angle (rad); the wheels touch them, so far from the crest as they stand.
    """
    radius, half = ROVER.wheel.radius, 0.5 * ROVER.wheelbase
    return radius + half * math.tan(angle) - radius / math.cos(angle)


def crossing(
    curve: list[Any], heading: int, surface: dict[str, Any], scale: float, free: bool = False
) -> Terrain:
    """20 m of a curve, its middle at the origin, that one crosses at a right angle when heading so.

    What comes first is behind who heads there. It is in a cell, or at a free place.
    """
    place = {"at": [20, 15], "extent": [20, 12]} if free else {"cellX": 0, "cellY": 0}
    return terrain_of(
        {
            "size": [40, 30] if free else [20, 20],
            "origin": [-20, -15] if free else [-10, -10],
            "surfTypes": {"soil": surface},
            "elemTypes": {"flat": {"x": [0]}, "curve": {"x": curve, "y": [1]}},
            "elemTree": {
                "type": "flat", "surface": "soil", "cells": 1,
                "children": [
                    {
                        "type": "curve", **place, "vScale": scale,
                        "turnDeg": 360 * heading / HEADINGS - 90,
                    }
                ],
            },
        }
    )  # fmt: skip


def measured(
    terrain: Terrain, vehicle: Vehicle, share: tuple[float, float], resolution: float, reach: float
) -> WindowMeasures:
    """The pixels around the origin, which lies at these shares of a pixel beside a centre."""
    n = math.ceil(reach / resolution)
    west, south = ((part - n - 0.5) * resolution for part in share)
    grid = Grid(west, south, resolution, 2 * n + 1, 2 * n + 1)
    return Surveyor(terrain, vehicle, grid, HEADINGS).measure(grid.whole)


def high_centred(found: WindowMeasures, heading: int) -> bool:
    here = found.verdict[heading] == Verdict.NO_GO
    return bool((found.reason[heading][here] == Reason.HIGH_CENTRED).any())


class TestRidge:
    """A crest between two planes."""

    @settings(max_examples=examples(25))
    @given(
        heading=turns,
        share=shares,
        resolution=st.sampled_from([0.01, 0.02, 0.03, 0.05]),
        free=st.booleans(),
    )
    def test_exact_limit(
        self, heading: int, share: tuple[float, float], resolution: float, free: bool
    ) -> None:
        """Within 0.1° wherever the crest runs between pixel centres, for any of its directions."""
        for more, stopped in ((-0.1, False), (0.1, True)):
            angle = 0.5 * breakover(ROVER) + math.radians(more)
            ridge = crossing([[0, 0], [0.5, 1], [1, 0]], heading, FIRM, 10 * math.tan(angle), free)
            found = measured(ridge, ROVER, share, resolution, 0.1)
            assert high_centred(found, heading) == stopped
            assert high_centred(found, (heading + HEADINGS // 2) % HEADINGS) == stopped

    @settings(max_examples=examples(15))
    @given(heading=turns, share=shares, tilt=st.floats(-8, 8))
    def test_sides_of_different_slopes(
        self, heading: int, share: tuple[float, float], tilt: float
    ) -> None:
        """It is the angle between the planes that counts, on a slope as well, and asymmetrically.

        The body is tilted half of the way, and stands square on each plane at a wheel: turned as a
        whole the same stance. So wheels are a little nearer to each other as seen from above.
        """
        level = replace(ROVER, cog_height=0.01)
        for more, stopped in ((-0.7, False), (0.7, True)):
            half = 0.5 * breakover(level) + math.radians(more)
            up, down = half + math.radians(tilt), half - math.radians(tilt)
            curve = [[0, -0.5 * math.tan(up)], [0.5, 0], [1, -0.5 * math.tan(down)]]
            found = measured(crossing(curve, heading, FIRM, 20.0), level, share, 0.05, 0.15)
            assert high_centred(found, heading) == stopped

    @settings(max_examples=examples(10))
    @given(heading=turns, share=shares, resolution=resolutions)
    def test_a_slope_takes_no_clearance(
        self, heading: int, share: tuple[float, float], resolution: float
    ) -> None:
        """Planes have no crest: what is left under the body is what the wheels leave, no less."""
        rise = math.tan(math.radians(15))
        plane = crossing([[0, 0], [1, 1]], heading, FIRM, 20 * rise)
        found = measured(plane, ROVER, share, resolution, 0.1)
        assert float(found.clearance.min()) >= 0.15 - 1e-4
        # a crest takes what it stands above the plane of the wheels, by trigonometry
        angle = math.radians(8)
        ridge = crossing([[0, 0], [0.5, 1], [1, 0]], 8, FIRM, 10 * math.tan(angle))
        found = measured(ridge, ROVER, (0.5, 0.5), 0.05, 0.1)
        assert float(found.clearance[8].min()) == pytest.approx(0.15 - stands_out(angle), abs=2e-3)

    def test_between_centres_is_as_between_columns(self) -> None:
        """The crest that passed at 18.68°: half a pixel from the centres, of 0.05 m."""
        ridge = crossing([[0, 0], [0.5, 1], [1, 0]], 8, FIRM, 10 * math.tan(math.radians(18.2)))
        for resolution in (0.05, 0.02, 0.01):
            assert high_centred(measured(ridge, ROVER, (0.5, 0.0), resolution, 0.1), 8)


def crests_of(
    terrain: Terrain, resolution: float, share: tuple[float, float], reach: float = 1.2
) -> tuple[Grid, Any]:
    """The ground of pixels around the origin."""
    n = math.ceil(reach / resolution)
    west, south = ((part - n - 0.5) * resolution for part in share)
    grid = Grid(west, south, resolution, 2 * n + 1, 2 * n + 1)
    ground = GroundPainter(terrain, grid, 0.004, False, [0.2]).paint(
        Window(0, 0, grid.height, grid.width)
    )
    return grid, ground


def highest_within(terrain: Terrain, grid: Grid) -> Any:
    """The highest ground of each pixel, at 41 × 41 places of it."""
    part = np.linspace(-0.5, 0.5, 41) * grid.resolution
    window = Window(0, 0, grid.height, grid.width)
    x = (grid.columns(window)[:, None] + part).reshape(-1)
    y = (grid.rows(window)[:, None] + part).reshape(-1)
    z = terrain.height(*np.meshgrid(x, y)).reshape(grid.height, 41, grid.width, 41)
    return np.nanmax(z, axis=(1, 3))


class TestPixels:
    """What pixels have for their highest ground."""

    SHAPES: ClassVar[dict[str, Any]] = {
        "roof": {"x": [0, 1, 0], "y": [0, 1, 0]},
        "hip": {"x": [0, 1, 0], "y": [0, 1, 0], "combine": "min"},
        "cone": {"x": [0, 1, 0], "combine": "radial"},
        "post": {"x": [[0, 0], [0.49, 0], [0.49, 1], [0.51, 1], [0.51, 0], [1, 0]], "y": [0, 1, 0]},
        "wave": {"x": "cos(12*pi*t)", "y": "sin(pi*t)"},
        "box": {"x": [1], "y": [1]},
        "heights": {"grid": [[0, 0.2, 0, 0.1, 0], [0.3, 1, 0.1, 0.4, 0], [0, 0.5, 0.9, 0.2, 0.1]]},
        "pixels": {"grid": [[0.1, 0.6, -0.5], [0.3, 0.1, 1]], "registration": "pixel"},
    }

    @pytest.mark.parametrize("shape", SHAPES)
    @settings(max_examples=examples(6))
    @given(share=shares, turn=st.floats(-180, 180), sign=st.sampled_from([1, -1]))
    def test_tops_are_found(
        self, shape: str, share: tuple[float, float], turn: float, sign: int
    ) -> None:
        """On the terrain, in their pixel, and no lower than what close sampling finds at the top.

        A pit has lips instead, where the ground around is level.
        """
        terrain = terrain_of(
            {
                "size": [4, 4],
                "origin": [-2, -2],
                "surfTypes": {"soil": FIRM},
                "elemTypes": {"flat": {"x": [0]}, "shape": self.SHAPES[shape]},
                "elemTree": {
                    "type": "flat", "surface": "soil",
                    "cells": [3, 4],
                    "children": [
                        {
                            "type": "shape", "cellX": 1,
                            "cellY": 2,
                            "vScale": 0.3 * sign, "turnDeg": turn, "surface": "soil",
                        }
                    ],
                },
            }
        )  # fmt: skip
        grid, ground = crests_of(terrain, 0.07, share)
        top = highest_within(terrain, grid)
        row, column, heights, east, north = ground.crests
        highest = max(heights.max(initial=-np.inf), ground.heights.max())
        assert highest >= top.max() - 3e-3 * 0.3
        if not len(row):
            return
        window = Window(0, 0, grid.height, grid.width)
        x = grid.columns(window)[column] + east.astype(np.float64)
        y = grid.rows(window)[row] + north.astype(np.float64)
        assert max(np.abs(east).max(), np.abs(north).max()) <= 0.5 * 0.07 + 1e-6
        # places are known to a part of a micrometre: beside a wall that may be the other side
        near = [
            terrain.height(x + dx, y + dy) for dx in (-2e-7, 0, 2e-7) for dy in (-2e-7, 0, 2e-7)
        ]
        assert np.abs(np.array(near) - heights).min(axis=0).max() < 1e-5

    @settings(max_examples=examples(20))
    @given(data=st.data(), share=shares, turn=st.sampled_from([0.0, 90.0, 33.0]))
    def test_of_grids_are_those_of_curves(
        self, data: st.DataObject, share: tuple[float, float], turn: float
    ) -> None:
        """Products of two vectors are a grid of heights, cell by cell the same ground."""
        # where a slope goes on, a grid may have a further point on a straight rim
        vectors = st.lists(st.integers(-3, 3), min_size=2, max_size=5).filter(
            lambda vector: np.diff(vector, 2).all()
        )
        x, y = np.array(data.draw(vectors)), np.array(data.draw(vectors))
        child = {"type": "shape", "at": [2.2, 1.3], "extent": [2.1, 1.4], "turnDeg": turn}
        found = []
        for shape in (
            {"x": x.tolist(), "y": y.tolist()},
            {"grid": np.outer(y, x)[::-1].tolist()},
        ):
            tree = {"type": "flat", "surface": "soil", "children": [{**child, "vScale": 0.2}]}
            terrain = terrain_of(
                {
                    "size": [5, 3],
                    "origin": [-2, -1],
                    "surfTypes": {"soil": FIRM},
                    "elemTypes": {"flat": {"x": [0]}, "shape": shape},
                    "elemTree": tree,
                }
            )
            _, ground = crests_of(terrain, 0.07, share)
            order = np.lexsort(np.round(ground.crests, 5))
            found.append(np.stack(ground.crests)[:, order])
        np.testing.assert_allclose(found[0], found[1], atol=1e-5)

    @pytest.mark.parametrize("registration", ["gridline", "pixel"])
    @given(share=shares)
    @settings(max_examples=examples(10))
    def test_the_top_beside_a_void_is_found(
        self, registration: str, share: tuple[float, float]
    ) -> None:
        """Ground rises to where it ends, between pixel centres, and nothing goes on behind."""
        rows = [[0, 0.5, 1, None, 0], [0, 0.5, 1, None, 0], [0, 0.25, 0.5, None, 0]]
        shape = {"grid": rows, "registration": registration}
        terrain = terrain_of(
            {
                "size": [5, 3],
                "origin": [-3, -1.5],
                "surfTypes": {"soil": FIRM},
                "elemTypes": {"shape": shape},
                "elemTree": {"type": "shape", "surface": "soil", "vScale": 1},
            }
        )
        _, ground = crests_of(terrain, 0.07, share)
        assert ground.crests[2].max() == pytest.approx(1, abs=1e-3)

    @given(share=shares)
    @settings(max_examples=examples(10))
    def test_a_thin_post_between_centres_stops_the_body(self, share: tuple[float, float]) -> None:
        """5 mm of it, 0.2 m high, under 0.15 m of clearance: no pixel centre shows it."""
        low, high = 0.5 - 0.0025 / 20, 0.5 + 0.0025 / 20
        thin = [[0, 0], [low, 0], [low, 1], [high, 1], [high, 0], [1, 0]]
        terrain = terrain_of(
            {
                "size": [20, 20],
                "origin": [-10, -10],
                "surfTypes": {"soil": SOUND},
                "elemTypes": {"flat": {"x": [0]}, "post": {"x": thin, "y": thin}},
                "elemTree": {
                    "type": "flat", "surface": "soil",
                    "cells": 1,
                    "children": [
                        {
                            "type": "post", "cellX": 0,
                            "cellY": 0,
                            "vScale": 0.2, "surface": "soil",
                        }
                    ],
                },
            }
        )  # fmt: skip
        found = measured(terrain, ROVER, share, 0.05, 0.1)
        assert (found.clearance.min(axis=(1, 2)) < -0.04).all()

    def test_windows_make_no_difference(self) -> None:
        """Each pixel is the same in any window, to the bit, crests on the edges of pixels too."""
        ridge = crossing([[0, 0], [0.5, 1], [1, 0]], 8, FIRM, 2.0)
        grid = Grid(-1.0, -0.8, 0.05, 30, 40)
        surveyor = Surveyor(ridge, ROVER, grid, 8)
        whole = surveyor.measure(grid.whole)
        left = 0.15 - stands_out(math.atan(0.2))
        assert whole.clearance[[2, 6]].min() == pytest.approx(left, abs=1e-3)
        part = surveyor.measure(Window(7, 11, 13, 17))
        for name in ("verdict", "reason", "numbers", "step", "rough", "clearance"):
            cropped = getattr(whole, name)[..., 7:20, 11:28]
            assert np.array_equal(cropped, getattr(part, name), equal_nan=name != "verdict")


class TestIsolated:
    """What stands by itself under the body of the rover, of any shape and turn."""

    ROVER = replace(ROVER, body_width=0.5)
    SHAPES: ClassVar[dict[str, Any]] = {
        "bell": {"x": "cosbell", "y": []},
        "round bell": {"x": "cosbell", "combine": "radial"},
        "gauss": {"x": "gauss", "y": []},
        "dome": {"x": "dome", "y": []},
        "round dome": {"x": "dome", "combine": "radial"},
        "half a cylinder": {"x": "dome"},
        "cloister vault": {"x": "dome", "y": [], "combine": "min"},
        "corner": {"x": "ramp", "y": []},
        "wedge": {"x": "ramp"},
        "two tents": {"x": "tent", "y": [], "combine": "sum"},
        "pyramid": {"x": "tent", "y": [], "combine": "min"},
        "oblong": {"x": [0, 1, 0.2, 0], "y": [[0, 0], [0.3, 1], [1, 0.1]]},
    }

    @pytest.mark.parametrize("shape", SHAPES)
    @settings(max_examples=examples(15))
    @given(
        cells=st.sampled_from([16, 20, 30, 40, 60]),
        at=st.tuples(st.integers(-1, 0), st.integers(-1, 0)),
        turn=st.sampled_from([0.0]) | st.floats(-180, 180),
        share=shares,
        resolution=st.sampled_from([0.02, 0.03, 0.05, 0.1]),
        heading=turns,
    )
    def test_body_is_held_off_the_highest(
        self, shape: str, cells: int, at: tuple[int, int], turn: float,
        share: tuple[float, float], resolution: float, heading: int,
    ) -> None:  # fmt: skip
        """Half a millimetre at most above what close sampling finds."""
        terrain = self.standing(self.SHAPES[shape], cells, at, turn)
        grid = self.grid(share, resolution)
        found = Surveyor(terrain, self.ROVER, grid, HEADINGS).measure(grid.whole)
        top = self.highest(terrain, grid, heading)
        assert float(found.clearance[heading, 1, 1]) <= 0.15 - top + 5e-4

    @pytest.mark.parametrize("shape", ["bell", "round dome", "gauss", "dome", "pyramid"])
    @settings(max_examples=examples(5))
    @given(share=shares, tilt=st.floats(-0.3, 0.3), resolution=st.sampled_from([0.02, 0.05]))
    def test_slope(
        self, shape: str, share: tuple[float, float], tilt: float, resolution: float
    ) -> None:
        """On a slope it is not the highest that counts, but what stands out most above the plane.

        The wheels touch the plane behind or ahead of their lowest points, so these hang above it.
        Clearance is square to the plane.
        """
        terrain = self.standing(self.SHAPES[shape], 30, (0, 0), 30.0, tilt)
        grid = self.grid(share, resolution)
        found = Surveyor(terrain, self.ROVER, grid, HEADINGS).measure(grid.whole)
        hang = 0.2 * (math.hypot(1.0, tilt) - 1.0)
        above = (self.highest(terrain, grid, 8, tilt) - hang) / math.hypot(1.0, tilt)
        assert float(found.clearance[8, 1, 1]) <= 0.15 - above + 5e-4

    @staticmethod
    def standing(
        shape: Any, cells: int, at: tuple[int, int], turn: float, tilt: float = 0.0
    ) -> Terrain:
        """A shape 0.13 m high in a cell of 4 m / cells, near the origin; it all rises eastwards."""
        x, y = (cells // 2 + shift for shift in at)
        return terrain_of(
            {
                "size": [4, 4],
                "origin": [-2, -2],
                "surfTypes": {"soil": FIRM},
                "elemTypes": {"plane": {"x": [[0, 0], [1, 4 * tilt]]}, "shape": shape},
                "elemTree": {
                    "type": "plane", "surface": "soil", "cells": cells,
                    "children": [
                        {
                            "type": "shape", "cellX": x, "cellY": y,
                            "vScale": 0.13, "turnDeg": turn,
                        }
                    ],
                },
            }
        )  # fmt: skip

    @staticmethod
    def grid(share: tuple[float, float], resolution: float) -> Grid:
        """Three by three pixels around the origin."""
        west, south = ((part - 1.5) * resolution for part in share)
        return Grid(west, south, resolution, 3, 3)

    @staticmethod
    def highest(terrain: Terrain, grid: Grid, heading: int, tilt: float = 0.0) -> float:
        """The highest ground under the body at the middle pixel, but a pixel along its edges, m.

        It is that above the plane that rises eastwards through the middle.
        """
        side = grid.resolution
        turn = 2.0 * math.pi * heading / HEADINGS
        along, left = np.meshgrid(
            np.arange(side - 0.5, 0.5 - side, 0.0025), np.arange(side - 0.25, 0.25 - side, 0.0025)
        )
        x = grid.west + 1.5 * side + along * math.sin(turn) - left * math.cos(turn)
        y = grid.south + 1.5 * side + along * math.cos(turn) + left * math.sin(turn)
        plane = tilt * (x - grid.west - 1.5 * side)
        level = float(terrain.height(grid.west + 1.5 * side, -1.9)) if tilt else 0.0
        return float((terrain.height(x, y) - plane).max()) - level


class TestTrench:
    """A trench with upright sides, a metre deep."""

    @pytest.mark.nightly
    @settings(max_examples=examples(25))
    @given(heading=turns, share=shares, resolution=resolutions)
    def test_report_and_map_have_one_limit(
        self, heading: int, share: tuple[float, float], resolution: float
    ) -> None:
        """The width in the report's figures passes less 0.5 %, and 0.5 % more does not."""
        wide = replace(ROVER, clearance=0.3)
        limit = None
        for more, stopped in ((-0.005, False), (0.005, True)):
            if limit is None:
                level = crossing([[0, 0], [1, 0]], 0, SOUND, 1.0)
                limit = surface_figures("soil", level.surface_types["soil"], wide).gap
                step = steps.step_of(wide, math.tan(math.radians(35))).height
                assert limit == pytest.approx(steps.gap_width(0.2, step))
            terrain = crossing(self.sides((1 + more) * limit), heading, SOUND, 1.0)
            found = measured(terrain, wide, share, resolution, 1.1)
            barred = found.verdict[heading] == Verdict.NO_GO
            assert barred.any() == stopped
            if stopped:
                assert (found.reason[heading][barred] == Reason.STEP).any()

    @pytest.mark.parametrize(
        ("depth", "width", "met"),
        [(0.03, 0.5, 0.03), (0.06, 0.5, 0.06), (0.06, 0.25, 0.2 - math.sqrt(0.04 - 0.125**2))],
    )
    def test_a_shallow_one_is_as_deep_as_its_floor(
        self, depth: float, width: float, met: float
    ) -> None:
        """Wheels that reach the floor climb out of it, others from between the edges."""
        terrain = crossing(self.sides(width), 8, SOUND, depth)
        found = measured(terrain, ROVER, (0.3, 0.2), 0.05, 0.8)
        assert found.step[8].max() == pytest.approx(met, abs=1e-3)

    def test_along_a_wide_one_nothing_is_met(self) -> None:
        """Who has it between the wheels goes along it; across it the wheels sink in."""
        terrain = crossing(self.sides(0.3), 8, SOUND, 1.0)
        found = measured(terrain, ROVER, (0.3, 0.2), 0.05, 0.1)
        assert found.step[0].max() == 0.0
        wide = measured(terrain, ROVER, (0.3, 0.2), 0.05, 0.8)
        assert wide.step[8].max() == pytest.approx(0.2 - math.sqrt(0.04 - 0.15**2), abs=1e-3)

    @staticmethod
    def sides(width: float) -> list[Any]:
        """The curve of a trench, over 20 m."""
        half = 0.5 * width / 20
        return [[0, 0], [0.5 - half, 0], [0.5 - half, -1], [0.5 + half, -1], [0.5 + half, 0],
                [1, 0]]  # fmt: skip


class TestOwnWheels:
    """A small wheel in front of a large one, and the same vehicle the other way round."""

    SMALL = Wheel(0.1, 0.06)
    AHEAD = replace(ROVER, axles=(Axle(0.5, wheel=SMALL), Axle(-0.5)))
    BEHIND = replace(ROVER, axles=(Axle(0.5), Axle(-0.5, wheel=SMALL)))
    WIDTH = 0.15

    def trench(self, surface: dict[str, Any] = SOUND) -> Terrain:
        return crossing(TestTrench.sides(self.WIDTH), 8, surface, 1.0)

    @pytest.mark.parametrize("resolution", [0.02, 0.05])
    def test_each_sinks_in_between_edges_as_far_as_it_is_round(self, resolution: float) -> None:
        """r − √(r² − (w/2)²): the step that it meets, and how it pitches the body."""
        small, large = (
            radius - math.sqrt(radius**2 - 0.25 * self.WIDTH**2) for radius in (0.1, 0.2)
        )
        for vehicle, front, rear in ((self.AHEAD, small, large), (self.BEHIND, large, small)):
            found = measured(self.trench(), vehicle, (0.0, 0.0), resolution, 0.6)
            middle = found.step.shape[1] // 2

            def at(x: float, middle: int = middle) -> tuple[int, int]:
                return middle, middle + round(x / resolution)

            before, behind = (np.s_[8, *at(x)] for x in (-0.6, 0.4))
            assert found.step[before] == pytest.approx(front, abs=1e-5)
            assert found.step[behind] == pytest.approx(rear, abs=1e-5)
            pitch = found.numbers[8, kernels.PITCH]
            assert pitch[at(-0.5)] == pytest.approx(-math.atan(front), abs=1e-5)
            assert pitch[at(0.5)] == pytest.approx(math.atan(rear), abs=1e-5)

    def test_only_the_large_one_bridges_a_trench(self) -> None:
        """Where friction is low; whichever end the small one stands at, it bars the way there."""
        slick = {**SOUND, "fricAngle": 20}
        for vehicle, bars, free in ((self.AHEAD, -0.6, 0.4), (self.BEHIND, 0.4, -0.6)):
            high = replace(vehicle, clearance=0.3)
            found = measured(self.trench(slick), high, (0.0, 0.0), 0.02, 0.7)
            middle = found.step.shape[1] // 2
            here, there = (middle + round(x / 0.02) for x in (bars, free))
            assert found.verdict[8, middle, here] == Verdict.NO_GO
            assert found.reason[8, middle, here] == Reason.STEP
            assert found.verdict[8, middle, there] != Verdict.NO_GO

    def test_what_it_covers_is_that_of_its_own_wheels(self) -> None:
        """The rectangle from above, ahead, behind and to the sides."""
        wide = Wheel(0.3, 0.2)
        axles = (Axle(0.5, wheel=self.SMALL), Axle(0.3, wheel=wide), Axle(-0.5))
        vehicle = replace(ROVER, axles=axles)
        assert vehicle.rectangle == pytest.approx((0.6, 0.7, 0.5))
        single = replace(ROVER, axles=(Axle(0.5), Axle(-0.5, 1, wheel=wide)), body_width=0.0)
        assert single.rectangle == pytest.approx((0.7, 0.8, 0.45))
