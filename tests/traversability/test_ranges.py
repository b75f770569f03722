"""Soils of which ranges are known: how likely a vehicle goes, by surface, pixel and route."""

from __future__ import annotations

import html
import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET, structs
from numpy.typing import NDArray

import terratool
from terratool.cli.traversability import SAMPLES as OF_THE_COMMAND
from terratool.definition.model import SOIL_FIGURES, Surface, names_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window, grid_over
from terratool.traversability import ranges
from terratool.traversability.assess import assess
from terratool.traversability.map_results import CHANCE_BOUNDS
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.ranges import Draws, draw, level_chances, share_error, soil_samples
from terratool.traversability.report import document, tables
from terratool.traversability.report.page import as_markdown
from terratool.traversability.report.routes import as_geojson
from terratool.traversability.request import Request
from terratool.traversability.results import TraversabilityReport
from terratool.traversability.soil import surface_figures
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import part_of
from terratool.traversability.vehicle import Vehicle
from terratool.traversability.verdicts import GroundClass, Verdict
from tests.budget import examples
from tests.commands import ROOT, call
from tests.conftest import terrain_of
from tests.surveys import ROVER

SCHEMA = jsonschema.Draft202012Validator(terratool.schema("report"))
KEYS = dict(names_of(Surface))
SAND = {
    "cohesion": [0.3, 1.1], "fricAngle": [24, 33], "sinkage": [0.05, 0.2],
    "shearModulus": [0.01, 0.025],
}  # fmt: skip
UNSURE = {**SAND, "fricAngle": [16, 33], "sinkage": [0.05, 0.5]}
LOAM = {"cohesion": 1.7, "fricAngle": [27, 31], "sinkage": 0.04, "shearModulus": 0.02}
SOFT = {
    "cohesion": [0.3, 1.0], "fricAngle": [22, 33], "sinkage": [0.05, 0.25], "shearModulus": 0.02,
}  # fmt: skip
PATH = {"cohesion": 0, "fricAngle": 35, "sinkage": 0}


def hills(sand: Any = None, loam: Any = None, **more: Any) -> dict[str, Any]:
    """Oblong ground away from the origin: two hills, a path, loam in the south, a kerb, a rut."""
    return {
        "size": [9, 6],
        "origin": [40, -20],
        "surfTypes": {"sand": sand or SAND, "loam": loam or LOAM, "path": PATH},
        "elemTypes": {
            "flat": {"x": [0]}, "box": {"x": [1]}, "hill": {"x": "cosbell", "y": "cosbell"},
        },
        "elemTree": {
            "type": "flat", "surface": "sand", "vScale": 1, "cells": [9, 6],
            "children": [
                {"type": "hill", "cellX": 0, "cellY": 2, "span": [5, 4], "vScale": 1.3},
                {"type": "hill", "surface": "loam", "cellX": 4, "cellY": 0, "span": [5, 3],
                 "vScale": 0.8},
                {"type": "flat", "surface": "path", "cellX": 6, "cellY": 3, "span": [1, 3]},
                {"type": "box", "surface": "loam", "cellX": 8, "cellY": 4, "vScale": 0.05},
            ],
        },
        "tracks": [{"path": [[41, -19], [48, -15.5]], "width": 0.08, "depth": 0.01}],
        **more,
    }  # fmt: skip


def ramp(slope: float, soil: dict[str, Any]) -> Terrain:
    """A plane of one soil, 4 × 3, that rises to the east at an angle in degrees."""
    return terrain_of(
        {
            "size": [4, 3],
            "surfTypes": {"ground": soil},
            "elemTypes": {"ramp": {"x": "ramp"}},
            "elemTree": {
                "type": "ramp", "surface": "ground", "vScale": 4 * math.tan(math.radians(slope)),
            },
        }
    )  # fmt: skip


def drawn(terrain: Terrain, samples: int, seed: int = 0) -> Draws:
    found = draw(terrain, samples, seed)
    assert found is not None
    return found


def sampler(
    terrain: Terrain, resolution: float, samples: int = 64, seed: int = 0, vehicle: Vehicle = ROVER
) -> Surveyor:
    soils = soil_samples(terrain, vehicle, drawn(terrain, samples, seed))
    return Surveyor(terrain, vehicle, grid_over(terrain, resolution), 8, soils)


def chances(terrain: Terrain, resolution: float, **options: Any) -> NDArray[np.float32]:
    surveyor = sampler(terrain, resolution, **options)
    found = surveyor.measure(surveyor.grid.whole).chance
    assert found is not None
    return found


def goes(terrain: Terrain, grid: Grid) -> NDArray[np.bool_]:
    """Where some heading is go, of a terrain without ranges."""
    found = Surveyor(terrain, ROVER, grid, 8).measure(grid.whole)
    assert found.chance is None
    return np.asarray((found.verdict == Verdict.GO).any(axis=0))


def with_numbers(definition: dict[str, Any], draws: Draws, sample: int) -> Terrain:
    """The terrain of one sample: numbers in the place of its ranges."""
    one = json.loads(json.dumps(definition))
    for name, surfaces in draws.surfaces.items():
        figures = ((KEYS[name], getattr(surfaces[sample], name)) for name in SOIL_FIGURES)
        one["surfTypes"][name] |= {key: value for key, value in figures if value is not UNSET}
    return terrain_of(one)


class TestDraws:
    @given(st.integers(16, 200), st.integers(0, 2**63 - 1))
    def test_each_part_of_each_range_has_one_value(self, samples: int, seed: int) -> None:
        """A Latin hypercube: so many equal parts, and in each of them one value."""
        draws = drawn(terrain_of(hills()), samples, seed)
        for name, key, low, high in map(structs.astuple, draws.ranges):
            attribute = {key: name for name, key in KEYS.items()}[key]
            values = np.array([getattr(one, attribute) for one in draws.surfaces[name]])
            parts = np.floor((values - low) / (high - low) * samples + 1e-9)
            assert sorted(parts) == list(range(samples))
            assert low <= values.min()
            assert values.max() <= high

    def test_figures_are_independent(self) -> None:
        """No two of them go together, those of one surface and those of two."""
        draws = drawn(terrain_of(hills()), 1024)
        ranged = terrain_of(hills()).surface_types["sand"].ranges
        sand = np.array([[getattr(s, a) for a in ranged] for s in draws.surfaces["sand"]])
        loam = np.array([[s.fric_angle] for s in draws.surfaces["loam"]])
        together = np.corrcoef(np.hstack([sand, loam]).T) - np.eye(5)
        assert np.abs(together).max() < 4 / math.sqrt(1024)

    def test_other_surfaces_change_nothing(self) -> None:
        """What a figure gets follows from the seed and its own name, so that edits stay local."""
        both, one = (drawn(terrain_of(hills(loam=loam)), 32) for loam in (None, PATH))
        assert both.surfaces["sand"] == one.surfaces["sand"]
        assert "loam" not in one.surfaces
        assert drawn(terrain_of(hills()), 32, seed=1).surfaces["sand"] != both.surfaces["sand"]

    @pytest.mark.parametrize(("samples", "seed"), [(15, 0), (1025, 0), (64, -1), (64, 2**63)])
    def test_refuses_what_makes_no_sense(self, samples: int, seed: int) -> None:
        with pytest.raises(RequestError, match=f"{samples if samples != 64 else seed}"):
            draw(terrain_of(hills()), samples, seed)

    def test_the_command_has_the_same_limits(self) -> None:
        limits = ranges.SAMPLES, ranges.LEAST_SAMPLES, ranges.MOST_SAMPLES
        assert limits == OF_THE_COMMAND

    def test_the_error_holds_19_times_of_20(self) -> None:
        """Of many shares of ½, the worst, no more than one in 20 is off by more than is said."""
        generator = np.random.Generator(np.random.PCG64(7))
        shares = generator.binomial(256, 0.5, 20_000) / 256
        assert np.mean(np.abs(shares - 0.5) > share_error(256)) == pytest.approx(0.05, abs=0.01)


class TestMap:
    @pytest.mark.nightly
    @pytest.mark.parametrize("resolution", [0.1, 0.25])
    def test_is_the_share_of_maps_of_all_samples(self, resolution: float) -> None:
        """Each sample is written as a terrain of its own, and judged by itself."""
        text = hills(UNSURE)
        ground = terrain_of(text)
        draws = drawn(ground, 16)
        # frictions between those of which steps are worked out change pixels beside the kerb only
        found = chances(ground, resolution, samples=16)
        grid = grid_over(ground, resolution)
        maps = [goes(with_numbers(text, draws, n), grid) for n in range(16)]
        share = np.mean(maps, axis=0)
        assert ((share > 0) & (share < 1)).mean() > 0.1
        beside = (grid.columns(grid.whole) > 47)[None] & (grid.rows(grid.whole) > -17)[:, None]
        np.testing.assert_array_equal(found[~beside], share[~beside].astype(np.float32))
        assert np.mean(found[beside] != share[beside]) < 0.02

    @pytest.mark.parametrize(("slope", "low", "high"), [(15, 15, 30), (15, 20.5, 21.5), (8, 5, 40)])
    def test_has_the_analytic_share(self, slope: float, low: float, high: float) -> None:
        """On rigid ground go ends at tan α = 0.7 tan φ: the share of angles above that, to 1/n."""
        soil = {"cohesion": 0, "fricAngle": [low, high], "sinkage": 0}
        found = chances(ramp(slope, soil), 0.25, samples=100)[4:-4, 4:-4]
        critical = math.degrees(math.atan(math.tan(math.radians(slope)) / 0.7))
        assert low < critical < high
        assert found.size
        np.testing.assert_allclose(found, (high - critical) / (high - low), rtol=0, atol=0.01)

    @pytest.mark.slow
    def test_a_range_without_width_is_the_plain_verdict(self) -> None:
        """Ends that differ by the last bit give 0 or 1, and where the plain map is go, 1."""
        numbers = {"cohesion": 0.7, "fricAngle": 28.0, "sinkage": 0.11, "shearModulus": 0.018}
        tight = {key: [value, np.nextafter(value, 99)] for key, value in numbers.items()}
        loam = {**LOAM, "fricAngle": 29.0}
        plain = terrain_of(hills(numbers, loam))
        for resolution in (0.1, 0.3):
            go = goes(plain, grid_over(plain, resolution))
            assert 0.1 < go.mean() < 0.9
            found = chances(terrain_of(hills(tight, loam)), resolution)
            np.testing.assert_array_equal(found, go.astype(np.float32))

    @pytest.mark.nightly
    @given(
        st.floats(18, 32), st.floats(0.5, 8), st.floats(0, 3), st.floats(0, 3),
        st.floats(0.0, 0.15), st.floats(0.2, 2.0),
    )  # fmt: skip
    @settings(max_examples=examples(25))
    def test_stronger_soil_is_never_less_likely(
        self, low: float, width: float, more: float, wider: float, sinkage: float, cohesion: float
    ) -> None:
        """Both ends of the friction angle are raised, and no pixel's probability falls."""
        weak, strong = (
            {**SAND, "fricAngle": ends, "sinkage": sinkage, "cohesion": cohesion}
            for ends in ([low, low + width], [low + more, low + width + more + wider])
        )
        one, other = (
            chances(terrain_of(hills(soil, tracks=[])), 0.3, samples=32) for soil in (weak, strong)
        )
        assert (other >= one).all()

    @pytest.mark.nightly
    def test_windows_are_parts_of_the_whole(self) -> None:
        """Whatever is asked for first, to the bit."""
        ground = terrain_of(hills())
        whole = chances(ground, 0.1)
        surveyor = sampler(ground, 0.1)
        for window in (Window(31, 40, 20, 50), Window(0, 0, 9, 17), Window(20, 1, 33, 60)):
            part = surveyor.measure(window).chance
            assert part is not None
            np.testing.assert_array_equal(part, whole[part_of(window)])

    @pytest.mark.nightly
    def test_unknown_ground_has_no_probability(self, tmp_path: Path) -> None:
        """Where the verdict is unknown, and off the terrain; elsewhere it lies in 0 to 1."""
        definition = hills(loam={"descr": "nobody knows"})
        files = written(tmp_path, definition, "--resolution", 0.25)
        chance, verdict = files["chance"], files["verdict"]
        np.testing.assert_array_equal(np.isnan(chance), verdict == Verdict.UNKNOWN)
        assert (verdict == Verdict.UNKNOWN).any()
        assert np.nanmin(chance) >= 0
        assert np.nanmax(chance) == 1


def written(folder: Path, definition: dict[str, Any], *options: object) -> dict[str, Any]:
    """What the command writes: bytes of files by name, the bands, what it said."""
    path = folder / "t.json"
    path.write_text(json.dumps(definition))
    out = folder / "out"
    out.mkdir(exist_ok=True)
    names = [str(out / f"r{suffix}") for suffix in (".json", ".md", ".html")]
    ran = call(
        "traversability", path, "--vehicle", ROOT / "samples/vehicles/husky-a200.json",
        *(word for name in names for word in ("--report", name)), "--map", out / "m.tif",
        "--overwrite", *options,
    )  # fmt: skip
    assert ran.code in (0, 1), ran.err
    found: dict[str, Any] = {p.name: p.read_bytes() for p in out.iterdir()}
    found["said"] = ran.out
    with rasterio.open(out / "m-numbers.tif") as file:
        found["bands"] = file.descriptions
        found["chance"] = file.read(file.count)
    with rasterio.open(out / "m-classes.tif") as file:
        found["reason"] = file.read(2)
    with rasterio.open(out / "m.tif") as file:
        found["verdict"] = file.read(1)
    return found


class TestCommand:
    @pytest.mark.slow
    def test_equal_ends_change_no_byte(self, tmp_path: Path) -> None:
        """They are one number: no band, no note, no key, not a bit elsewhere."""
        numbers = {"cohesion": 0.7, "fricAngle": 28.5, "sinkage": 0.11, "shearModulus": 0.018}
        equal = {key: [value, value] for key, value in numbers.items()}
        loam = {**LOAM, "fricAngle": 29}
        found = [
            written(tmp_path, hills(sand, loam), "--resolution", 0.3, "--route", 41, -19, 47, -18)
            for sand in (numbers, equal)
        ]
        assert len(found[0]["bands"]) == 17
        for name, data in found[0].items():
            np.testing.assert_array_equal(found[1][name], data, err_msg=name)
        assert not {"sampling", "probability"} & set(json.loads(found[0]["r.json"]))
        assert b"robabilit" not in found[0]["r.md"]

    @pytest.mark.nightly
    def test_a_seed_gives_the_same_bytes_and_another_one_others(self, tmp_path: Path) -> None:
        """Whatever the number of threads."""
        asked = ("--resolution", 0.3, "--samples", 50, "--route", 41, -19, 47, -18)
        first, again, other = (
            written(tmp_path, hills(), *asked, "--threads", threads, "--seed", seed)
            for threads, seed in ((1, 3), (2, 3), (2, 4))
        )
        for name, data in first.items():
            np.testing.assert_array_equal(again[name], data, err_msg=name)
        assert not np.array_equal(other["chance"], first["chance"])
        np.testing.assert_array_equal(other["verdict"], first["verdict"])
        assert other["m.tif"] == first["m.tif"]

    @pytest.mark.slow
    def test_says_what_was_sampled(self, tmp_path: Path) -> None:
        """In the map's last band, in sentence, tables and notes, and in JSON by its schema."""
        found = written(tmp_path, hills(), "--resolution", 0.3, "--samples", 100, "--seed", 5)
        assert found["bands"][-1] == "probability of go, best heading"
        report = json.loads(found["r.json"])
        SCHEMA.validate(report)
        assert report["sampling"]["samples"] == 100
        assert report["sampling"]["seed"] == 5
        assert report["sampling"]["error"] == pytest.approx(0.098)
        assert [(one["surface"], one["key"]) for one in report["sampling"]["ranges"]] == [
            ("sand", "cohesion"), ("sand", "fricAngle"), ("sand", "sinkage"),
            ("sand", "shearModulus"), ("loam", "fricAngle"),
        ]  # fmt: skip
        ground = np.isfinite(found["chance"]) & (found["verdict"] != GroundClass.EDGE)
        edges = [1.01, *CHANCE_BOUNDS]
        counts = [
            int(np.sum((low <= found["chance"][ground]) & (found["chance"][ground] < high)))
            for high, low in pairwise(edges)
        ]
        told = report["map"]["probability"]
        assert [one["at_least"] for one in told] == list(CHANCE_BOUNDS)
        assert [one["pixels"] for one in told] == pytest.approx(counts, abs=2)
        likely = f"With a probability of 95 % or more {100 * counts[0] / ground.sum():.3g} %"
        assert likely in " ".join(found["said"].split())
        note = 'Figures of "sand" and "loam" are ranges. Their middles count'
        for text in (found["said"], found["r.md"].decode(), found["r.html"].decode()):
            plain = " ".join(html.unescape(text).replace("\\", "").split())
            assert note in plain
            assert "100 samples (seed 5), off by up to 9.8 %" in plain
        assert "| sand |" in found["r.md"].decode()
        by_name = {one["surface"]: one for one in report["surfaces"]}
        assert "probability" not in by_name["path"]
        assert by_name["loam"]["probability"]["go"] == 1
        low, high = (by_name["sand"]["probability"][f"climb_{end}_deg"] for end in ("low", "high"))
        assert low < by_name["sand"]["climb_deg"] < high

    @pytest.mark.parametrize(
        ("option", "value"), [("--samples", 15), ("--samples", 1025), ("--seed", -1)]
    )
    def test_refuses_what_makes_no_sense(self, tmp_path: Path, option: str, value: int) -> None:
        path = tmp_path / "t.json"
        path.write_text(json.dumps(hills()))
        ran = call("traversability", path, "--wheel-radius", 0.1, option, value)
        assert ran.code == 2
        assert option in ran.err


def report_of(definition: dict[str, Any], **asked: Any) -> TraversabilityReport:
    return assess(prepare_assessment(terrain_of(definition), ROVER, Request(**asked)))


class TestSurfaces:
    def test_is_the_share_of_figures_of_all_samples(self) -> None:
        """On the level, and its climb from the samples that are worse than all but 5 % to …"""
        soil = {**SAND, "fricAngle": [4, 33], "sinkage": [0.1, 1.2]}
        definition = hills(soil)
        ground = terrain_of(definition)
        draws = drawn(ground, 40)
        found = level_chances("sand", draws, ROVER)
        one_by_one = [surface_figures("sand", one, ROVER) for one in draws.surfaces["sand"]]
        verdicts = [figures.verdict for figures in one_by_one]
        climbs = sorted(-1.0 if f.climb is None else f.climb for f in one_by_one)
        assert found is not None
        assert 0 < found.go < found.drives < 1
        assert found.go == verdicts.count(Verdict.GO) / 40
        assert found.drives == pytest.approx(1 - verdicts.count(Verdict.NO_GO) / 40)
        assert found.climb_low is None
        assert climbs[2] == -1.0
        assert found.climb_high == climbs[-3]
        assert level_chances("path", draws, ROVER) is None

    def test_of_one_figure_climb_is_analytic(self) -> None:
        """On rigid ground it climbs φ: 5 % and 95 % of the range."""
        ground = ramp(0, {"cohesion": 0, "fricAngle": [20, 30], "sinkage": 0})
        found = level_chances("ground", drawn(ground, 1000), ROVER)
        assert found is not None
        assert found.climb_low is not None
        assert found.climb_high is not None
        assert math.degrees(found.climb_low) == pytest.approx(20.5, abs=0.02)
        assert math.degrees(found.climb_high) == pytest.approx(29.5, abs=0.02)

    @pytest.mark.nightly
    def test_the_table_says_none_as_a_dash(self) -> None:
        soil = {**SAND, "fricAngle": [4, 33], "sinkage": [0.1, 1.2]}
        rows = tables.chances(report_of(hills(soil), resolution=0.5)).rows
        assert [row[0] for row in rows] == ["sand", "loam"]
        assert str(rows[0][3]).startswith("– to ")
        assert "sinkage 0.1 to 1.2" in str(rows[0][4])


class TestRoutes:
    WAY = (41.0, -19.0, 47.2, -14.8)

    @pytest.mark.slow
    def test_is_that_of_the_cells_it_passes(self) -> None:
        """By the heading that it has there; the least, and that of all of it together."""
        definition = hills(
            elemTree={
                "type": "flat",
                "surface": "sand",
                "vScale": 1,
                "cells": [3, 1],
                "children": [{"type": "flat", "surface": "loam", "cellX": 1, "cellY": 0}],
            },
            sand={**SOFT, "fricAngle": [8, 20]},
            loam={**SOFT, "fricAngle": [10, 20]},
        )
        ground = terrain_of(definition)
        way = (41.0, -19.0, 44.5, -15.5)
        report = report_of(definition, routes=(way,), resolution=0.2, mapped=False, samples=24)
        (route,) = report.routes
        assert route.found
        assert route.profile is not None
        assert route.least_chance is not None
        draws = drawn(ground, 24)
        grid = grid_over(ground, 0.2)
        headings = np.round(route.profile.heading / 45).astype(int) % 8
        rows = np.floor((grid.bounds[3] - route.profile.y) / 0.2 + 1e-9).astype(int)
        columns = np.floor((route.profile.x - grid.west) / 0.2 + 1e-9).astype(int)
        # where a move passes between two cells either may be its sample: those are left out
        exact = np.isclose(grid.columns(grid.whole)[columns], route.profile.x)
        exact &= np.isclose(grid.rows(grid.whole)[rows], route.profile.y)
        going = []
        for n in range(24):
            surveyor = Surveyor(with_numbers(definition, draws, n), ROVER, grid, 8)
            verdict = surveyor.measure(grid.whole).verdict
            going.append((verdict[headings, rows, columns] == Verdict.GO)[exact])
        assert route.least_chance.value == pytest.approx(np.mean(going, axis=0).min())
        assert route.chance == pytest.approx(np.mean(np.all(going, axis=1)))
        assert 0.1 < route.chance < route.least_chance.value < 1

    @pytest.mark.nightly
    def test_a_map_changes_nothing(self) -> None:
        """Whether the ground is judged as a whole, or tile by tile for the route."""
        alone, both = (
            report_of(hills(), routes=(self.WAY,), resolution=0.2, mapped=mapped).routes
            for mapped in (False, True)
        )
        assert alone[0].chance == both[0].chance
        assert alone[0].least_chance == both[0].least_chance

    @pytest.mark.nightly
    def test_is_said(self) -> None:
        """In the sentence, with its place, in JSON and GeoJSON; the verdict is the middle's."""
        report = report_of(
            hills(), routes=(self.WAY,), waypoints=(np.array([[41, -19], [42.5, -18.8]]),),
            resolution=0.2, returns=True,
        )  # fmt: skip
        text = document.as_dict(report)
        SCHEMA.validate(text)
        (line,) = [route for route in text["routes"] if route["planned"]]
        assert line["probability"] <= line["least_probability"]["probability"]
        assert line["back"]["probability"] is not None
        place = line["least_probability"]["place"]
        where = f"({round(place['x'], 3):.12g}, −{abs(round(place['y'], 3)):.12g})"
        least = f"{100 * line['least_probability']['probability']:.3g} %"
        assert f"probability of go {100 * line['probability']:.3g} %" in text["sentence"]
        assert f"- least probability: {least} at {where} on " in as_markdown(report)
        features = json.loads(as_geojson(report))["features"]
        shares = [f["properties"].get("probability") for f in features]
        assert shares[0] == line["probability"]
        middle = {
            "cohesion": 0.7, "fricAngle": 28.5, "sinkage": 0.125, "shearModulus": 0.0175,
        }  # fmt: skip
        plain = report_of(
            hills(middle, {**LOAM, "fricAngle": 29}), routes=(self.WAY,), resolution=0.2
        )
        assert plain.routes[0].verdict == report.routes[0].verdict
        assert plain.routes[0].length == report.routes[0].length
        assert plain.routes[0].chance is None


class TestOtherCommands:
    def test_say_that_the_middle_counts(self, tmp_path: Path) -> None:
        path, way = tmp_path / "t.json", tmp_path / "way.csv"
        path.write_text(json.dumps(hills()))
        way.write_text("x,y\n42,-19\n44,-19\n")
        info = call("info", path)
        assert "loam: fricAngle 27 to 31" in info.out
        assert "the middle counts" in info.out
        assert json.loads(call("info", path, "--json").out)["ranges"][-1] == {
            "surface": "loam", "key": "fricAngle", "low": 27, "high": 31,
        }  # fmt: skip
        dem = call(
            "export-dem", path, tmp_path / "d.tif", "--layer", "friction", "--layer", "sinkage"
        )
        assert "The friction of 'sand', 'loam' is a range: its middle is written." in dem.out
        assert "The sinkage of 'sand' is a range: its middle is written." in dem.out
        ruts = call(
            "deform", path, "--vehicle", ROOT / "samples/vehicles/husky-a200.json",
            "--waypoints", way, "--output", tmp_path / "o.json",
        )  # fmt: skip
        assert 'The sinkage of "sand" is a range: its middle counts.' in ruts.out

    def test_say_nothing_without_ranges(self, tmp_path: Path) -> None:
        path = tmp_path / "t.json"
        path.write_text(json.dumps(hills(PATH, PATH)))
        assert "range" not in call("info", path).out
        assert json.loads(call("info", path, "--json").out)["ranges"] == []
        dem = call("export-dem", path, tmp_path / "d.tif", "--layer", "friction", "--json")
        assert "ranged" not in json.loads(dem.out)
