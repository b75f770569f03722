"""Ground that has been pressed: wheels that follow others, and wheels in ruts."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from terratool.definition.reader import load_checked
from terratool.field.terrain import Terrain
from terratool.kernels import traversability as kernels
from terratool.raster.grid import Grid
from terratool.traversability.limits import climb, level_demand, wheel_loads
from terratool.traversability.map_results import Survey
from terratool.traversability.ruts import DeformOptions, deform
from terratool.traversability.tiles import survey
from terratool.traversability.vehicle import Axle, Soil, Vehicle, Wheel
from terratool.traversability.wheel import SoilArrays
from tests.surveys import judged
from tests.traversability.test_ruts import rutted

SAND = Soil.of(1.0, 30.0, 0.1)
WHEEL = Wheel(0.2, 0.1)
NORTH, EAST = 0, 2


def machine(*places: float, mass: float = 40.0, wheel: Wheel = WHEEL, **more: Any) -> Vehicle:
    """A vehicle with its axles at places ahead of its centre of gravity."""
    axles = tuple(Axle(x) for x in sorted(places or (0.5, -0.5), reverse=True))
    return Vehicle(wheel, axles, mass, 10.0, track_width=0.8, cog_height=0.3, **more)


class TestFollowing:
    """Wheels one behind the other."""

    @given(places=st.lists(st.integers(-9, 9), min_size=1, max_size=5, unique=True))
    def test_equal_wheels_make_the_rut_of_so_many_passes(self, places: list[int]) -> None:
        """z_n = z_1 n^(1/3), which `deform` and docs/format.md have too."""
        places = [*places, *(-x for x in places if -x not in places)]  # loads are equal
        vehicle = machine(*(0.1 * x for x in places))
        first = float(SAND.sinkage) * 400.0 / vehicle.wheels
        count = len(vehicle.axles)
        assert level_demand(vehicle, SAND).sinkage == pytest.approx(first * count ** (1 / 3))

    @given(ahead=st.floats(0.25, 0.75))
    def test_unequal_wheels(self, ahead: float) -> None:
        """The deepest first pass counts, and how many there are; no wheel bears next to nothing."""
        vehicle = machine(ahead, ahead - 1.0)
        deepest = float(SAND.sinkage) * float(wheel_loads(vehicle).max())
        assert level_demand(vehicle, SAND).sinkage == pytest.approx(deepest * 2 ** (1 / 3))

    def test_only_what_runs_in_one_line_counts(self) -> None:
        """A wheel between the others' lines finds fresh ground, as do four on one axle."""
        for axles, passes in (
            ((Axle(0.5), Axle(-1.0, 1)), 1), ((Axle(0.0, 4),), 1),
            ((Axle(0.5, 4), Axle(-0.5, 4)), 2),
        ):  # fmt: skip
            vehicle = replace(machine(), axles=axles)
            first = float(SAND.sinkage) * 400.0 / vehicle.wheels
            want = first * passes ** (1 / 3)
            assert level_demand(vehicle, SAND).sinkage == pytest.approx(want), axles

    def test_it_needs_less(self) -> None:
        """A wheel in a track resists less than one of the same load on fresh ground."""
        soil = Soil.of(1.0, 30.0, 0.5)
        inline = machine(0.5, -0.5)
        abreast = replace(inline, axles=(Axle(0.5), Axle(-0.5, 2)), track_width=0.8)
        wide = replace(abreast, axles=(Axle(0.0, 4),))
        assert level_demand(inline, soil).utilisation < 0.8 * level_demand(wide, soil).utilisation
        inline_climb = climb(replace(inline, cog_height=0.0), soil).angle
        assert inline_climb > climb(replace(wide, cog_height=0.0), soil).angle + math.radians(1.0)

    def test_the_paper_knows_no_second_pass(self) -> None:
        """z = k W in the model `paper`, for every wheel."""
        vehicle = machine(wheel=replace(WHEEL, slips=False))
        assert level_demand(vehicle, SAND).sinkage == pytest.approx(float(SAND.sinkage) * 100.0)


def flat(folder: Path, **soil: Any) -> Path:
    """24 × 30 m of one soil, and a soil for ruts."""
    path = folder / "flat.json"
    surfaces = {
        "sand": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.2, **soil},
        "packed": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.05},
    }
    tree = {"type": "plain", "vScale": 0, "surface": "sand"}
    types = {"plain": {"x": [1, 1]}}
    path.write_text(
        json.dumps({"size": [24, 30], "surfTypes": surfaces, "elemTypes": types, "elemTree": tree})
    )
    return path


def driven(path: Path, vehicle: Vehicle, passes: int, route: Any, **options: Any) -> Terrain:
    """The terrain after drives along a route."""
    site = load_checked(path)
    wanted = DeformOptions(passes=passes, **options)
    result = deform(site, vehicle, np.array(route, float), wanted)
    return Terrain(rutted(site, result))


def around(terrain: Terrain, vehicle: Vehicle, x: float, y: float) -> Survey:
    """The vehicle on nine pixels, a place in the middle of them."""
    return survey(terrain, vehicle, Grid(x - 0.15, y - 0.15, 0.1, 3, 3))


LINES = {NORTH: [[12.0, 3.0], [12.0, 27.0]], EAST: [[3.0, 15.0], [21.0, 15.0]]}


class TestRuts:
    """Wheels in tracks that stand in the definition."""

    @pytest.mark.parametrize("heading", [NORTH, EAST])
    @pytest.mark.parametrize("passes", [1, 2, 7])
    @pytest.mark.parametrize("multipass", [None, 2.0, 4.5])
    @pytest.mark.parametrize("ahead", [0.5, 0.3, 0.7])
    def test_a_drive_sinks_in_by_what_it_adds(
        self, tmp_path: Path, heading: int, passes: int, multipass: float | None, ahead: float
    ) -> None:
        """The verdict's sinkage on a rutted terrain is how much deeper the next drive makes it.

        Whether the wheels bear the same, or those ahead or behind more.
        """
        path, vehicle, line = flat(tmp_path), machine(ahead, ahead - 1.0), LINES[heading]
        before, after = (
            driven(path, vehicle, count, line, multipass=multipass)
            for count in (passes, passes + 1)
        )
        # the wheel's line is 0.4 m from that of the middle
        x, y = (12.4, 15.0) if heading == NORTH else (12.0, 15.4)
        grown = float(before.height(x, y) - after.height(x, y))
        found = around(before, vehicle, 12.0, 15.0)
        assert found.sinkage[heading, 1, 1] == pytest.approx(grown, rel=1e-4)
        a = 3.0 if multipass is None else multipass
        first = 2e-4 * float(wheel_loads(vehicle).max())
        want = first * ((2 * passes + 2) ** (1 / a) - (2 * passes) ** (1 / a))
        assert found.sinkage[heading, 1, 1] == pytest.approx(want, rel=1e-4)
        fresh = around(Terrain(load_checked(path)), vehicle, 12.0, 15.0)
        assert fresh.sinkage[heading, 1, 1] == pytest.approx(first * 2 ** (1 / 3), rel=1e-4)
        assert found.energy[heading, 1, 1] < 0.8 * fresh.energy[heading, 1, 1]

    def test_beside_the_ruts_it_is_fresh(self, tmp_path: Path) -> None:
        """A wheel out of the ruts, or one that crosses them, takes no part in them."""
        vehicle = machine()
        terrain = driven(flat(tmp_path), vehicle, 1, LINES[NORTH])
        fresh = 2e-4 * 100.0 * 2 ** (1 / 3)
        beside = around(terrain, vehicle, 12.2, 15.0)
        assert beside.sinkage[NORTH, 1, 1] == pytest.approx(fresh, rel=1e-5)
        assert around(terrain, vehicle, 12.0, 15.0).sinkage[EAST, 1, 1] == pytest.approx(
            fresh, rel=1e-5
        )

    def test_a_rut_with_a_surface_is_what_that_says(self, tmp_path: Path) -> None:
        """The packed soil's own k counts, and nothing else."""
        vehicle = machine()
        terrain = driven(flat(tmp_path), vehicle, 1, LINES[NORTH], surface="packed")
        found = around(terrain, vehicle, 12.0, 15.0).sinkage[NORTH, 1, 1]
        assert found == pytest.approx(5e-5 * 100.0 * 2 ** (1 / 3), rel=1e-5)

    def test_the_paper_knows_no_ruts(self, tmp_path: Path) -> None:
        """In the model `paper` k W counts there, too."""
        vehicle = machine(wheel=replace(WHEEL, slips=False))
        terrain = driven(flat(tmp_path), vehicle, 3, LINES[NORTH])
        found = around(terrain, vehicle, 12.0, 15.0).sinkage[NORTH, 1, 1]
        assert found == pytest.approx(2e-4 * 100.0, rel=1e-5)


def table(soil: Soil, vehicle: Vehicle) -> Any:
    """One soil under three ids, and steps."""
    numbers = (
        soil.cohesion, math.tan(soil.friction), soil.sinkage, soil.shear_modulus, soil.rolling,
        soil.exponent,
    )  # fmt: skip
    columns = [np.full(4, number, np.float64) for number in numbers]
    return SoilArrays(*columns), np.full(4, 1.0)


SOILS = st.builds(
    Soil.of,
    st.floats(0.0, 5.0),
    st.floats(15.0, 40.0),
    st.floats(0.0, 0.6),
    st.sampled_from([0.0, 0.02]),
)
DEPTHS = st.lists(st.floats(0.0, 0.3), min_size=4, max_size=4)
LEVEL = np.zeros((1, 2))


class TestLaw:
    """What all ruts have in common."""

    @given(
        soil=SOILS, depths=DEPTHS, deeper=st.floats(0.0, 0.2), passes=st.integers(1, 9),
        a=st.floats(3.0, 6.0),
    )  # fmt: skip
    def test_pressed_ground_never_holds_less(
        self, soil: Soil, depths: list[float], deeper: float, passes: int, a: float
    ) -> None:
        """Ruts are no worse than fresh ground, and more passes no worse than fewer.

        Where a pass in them counts for no less than one behind another on fresh ground; and more
        passes where they were no lighter than this wheel, which else makes them all as deep as it.
        """
        vehicle = machine(clearance=math.inf)
        soils = table(soil, vehicle)

        def asked(ruts: list[tuple[float, float, float]]) -> Any:
            return judged(vehicle, soils, LEVEL, [1, 1, 2, 3], ruts)[:, 0]

        once, often = (
            asked([(np.float32(d + deeper), passes + more, a) for d in depths]) for more in (0, 5)
        )
        fresh = asked([(0.0, 0.0, 0.0)] * 4)
        pairs = [(once, fresh), (often, fresh)]
        if min(depths) + deeper >= float(soil.sinkage) * 100.0:
            pairs.append((often, once))
        for plane in (kernels.UTILISATION, kernels.SINKAGE, kernels.ENERGY):
            for less, more in pairs:
                assert less[plane] <= more[plane] * (1 + 1e-5) + 1e-9
        assert often[kernels.DRAWBAR] >= fresh[kernels.DRAWBAR] - 1e-3

    @given(soil=SOILS, light=st.floats(0.001, 1.0), a=st.floats(1.0, 6.0))
    def test_no_wheel_sinks_further_than_into_fresh_ground(
        self, soil: Soil, light: float, a: float
    ) -> None:
        """Also a light one in the deep rut of a heavy one."""
        vehicle = machine(clearance=math.inf, mass=40.0 * light)
        soils = table(replace(soil, shear_modulus=0.0), vehicle)
        ruts = [(1.0, 3.0, a)] * 4
        found = judged(vehicle, soils, LEVEL, [1, 1, 2, 3], ruts)[kernels.SINKAGE, 0]
        fresh = judged(vehicle, soils, LEVEL, [1, 1, 2, 3])[kernels.SINKAGE, 0]
        # the wheels behind stand where those ahead have sunk in as far again
        assert found <= 2.0 * fresh * (1 + 1e-5)

    @pytest.mark.parametrize("vehicle", [machine(), machine(0.6, 0.1, -0.6)])
    def test_tables(self, vehicle: Vehicle) -> None:
        """What is interpolated where wheels stand in ruts is near what is computed there."""
        vehicle = replace(vehicle, clearance=math.inf)
        soils = table(Soil.of(1.0, 30.0, 0.3, 0.02), vehicle)
        slopes = np.random.default_rng(2).uniform(-0.3, 0.3, (500, 2))
        count = vehicle.wheels
        ruts = [(0.04, 1.0, 2.5), (0.0, 0.0, 0.0)] * (count // 2)
        found = judged(vehicle, soils, slopes, [1] * count, ruts)
        wanted = judged(vehicle, soils, slopes, [1] * (count - 2) + [2, 3], ruts)
        other = judged(vehicle, soils, slopes, [1] * count, ruts[::-1])
        moves = np.isfinite(wanted[kernels.ENERGY])
        off = np.abs(found[:, moves] - wanted[:, moves])
        assert moves.sum() > 200
        assert off[kernels.UTILISATION].max() < 0.08 and off[kernels.SINKAGE].max() < 1e-3
        # right and left are told apart
        assert np.abs(found[kernels.SINKAGE, moves] - other[kernels.SINKAGE, moves]).max() > 2e-3
