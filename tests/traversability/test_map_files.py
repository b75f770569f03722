"""Maps as files: what GIS programs are told, and what adds up."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp

from terratool.errors import RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, grid_over
from terratool.traversability.assess import assess
from terratool.traversability.map import default_resolution
from terratool.traversability.map_files import map_paths
from terratool.traversability.map_results import MapSummary
from terratool.traversability.preparing import prepare_assessment
from terratool.traversability.request import Request
from terratool.traversability.survey import Surveyor
from terratool.traversability.tiles import survey
from terratool.traversability.verdicts import COLORS, GroundClass, Reason, Verdict
from tests.conftest import terrain_of
from tests.traversability.test_map import ROVER


def write_map(
    terrain: Terrain, resolution: float, path: Path | None, *,
    threads: int | None = None, progress: Any = None,
) -> MapSummary:  # fmt: skip
    """The map of the rover on a terrain."""
    request = Request(resolution=resolution, threads=threads)
    prepared = prepare_assessment(terrain, ROVER, request, map_path=path)
    summary = assess(prepared, map_path=path, progress=progress).summary
    assert summary is not None
    return summary


class Told:
    """What progress is told."""

    def __init__(self) -> None:
        self.pixels: dict[str, float] = {}
        self.what = ""

    def __call__(self, more: float) -> None:
        self.pixels[self.what] = self.pixels.get(self.what, 0) + more

    def say(self, what: str, _total: int | None = None) -> None:
        self.what = what


def yard(**more: Any) -> Terrain:
    """Sand with a ramp in the south-west, a kerb in the east, a hole in the north, bare soil."""
    return terrain_of(
        {
            "size": [20, 12],
            "crs": "EPSG:32633",
            "origin": [500000, 5000000],
            "surfTypes": {
                "sand": {"cohesion": 1, "fricAngle": 30, "sinkage": 0.1, "shearModulus": 0.025},
                "rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0},
                "bare": {},
                "hole": {"void": True},
            },
            "elemTypes": {"flat": {"x": [0]}, "ramp": {"x": [0, 1], "y": [1]}, "box": {"x": [1]}},
            "elemTree": {
                "type": "flat", "surface": "sand", "cells": [10, 6],
                "children": [
                    {"type": "ramp", "cellX": 1, "cellY": 1, "span": [3, 2], "vScale": 1.5,
                     "surface": "rock"},
                    {"type": "box", "cellX": 7, "cellY": 1, "vScale": 0.15, "span": [1, 4]},
                    {"type": "flat", "cellX": 4, "cellY": 4, "surface": "hole"},
                    {"type": "flat", "cellX": 2, "cellY": 4, "surface": "bare"},
                ],
            },
            **more,
        }
    )  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A map of it, on pixels that reach beyond its east edge."""
    terrain = yard()
    grid = grid_over(terrain, 0.16)
    path = tmp_path_factory.mktemp("map") / "yard.tif"
    told = Told()
    summary = write_map(terrain, 0.16, path, progress=told)
    assert told.pixels[""] == grid.width * grid.height
    assert told.pixels["finding what can be reached"] == pytest.approx(told.pixels[""])
    return terrain, grid, path, summary


def read(path: Path) -> Any:
    with rasterio.open(path) as file:
        return file.read()


class TestFiles:
    """Five files, whole, named."""

    def test_names_units_and_classes(self, made: Any) -> None:
        _, grid, path, _ = made
        verdict, worst, bits, classes, numbers = map_paths(path)
        assert [p.name for p in (classes, numbers)] == ["yard-classes.tif", "yard-numbers.tif"]
        with rasterio.open(verdict) as file:
            assert file.descriptions == ("verdict, best heading",)
            assert file.colormap(1)[GroundClass.CUT_OFF][:3] == COLORS[GroundClass.CUT_OFF]
            assert file.colormap(1)[Verdict.GO][:3] == COLORS[GroundClass.GO]
            assert (file.nodata, file.dtypes, file.crs.to_epsg()) == (0, ("uint8",), 32633)
            assert file.bounds[0] == 500000 and file.shape == (grid.height, grid.width)
        with rasterio.open(worst) as file:
            assert file.descriptions == ("verdict, worst heading",)
            assert file.colormap(1)[Verdict.NO_GO][:3] == COLORS[GroundClass.NO_GO]
        with rasterio.open(bits) as file:
            assert (file.nodata, file.dtypes, file.count) == (0, ("uint8",), 1)
        with rasterio.open(classes) as file:
            assert ColorInterp.red not in file.colorinterp
        with rasterio.open(numbers) as file:
            units = dict(zip(file.descriptions, file.units, strict=True))
            assert units["slope along, worst heading"] == "degree"
            assert units["drawbar pull left, least"] == "N"
            assert np.isnan(file.nodata)
            tags = file.tags(file.descriptions.index("step, highest") + 1)
            assert float(tags["STATISTICS_MAXIMUM"]) == pytest.approx(1.5, abs=0.01)
        assert not bits.with_name(f"{bits.name}.aux.xml").exists()
        kinds = [Verdict, Reason, Reason]
        for file_, bands in ((verdict, [GroundClass]), (worst, [GroundClass]), (classes, kinds)):
            root = ElementTree.parse(f"{file_}.aux.xml").getroot()
            named = [[c.text for c in band.iter("Category")] for band in root]
            assert named == [[value.label for value in kind] for kind in bands]

    def test_hold_what_the_survey_finds(self, made: Any) -> None:
        """Best and worst of all headings, for pixels on the terrain; nothing beyond it."""
        terrain, grid, path, _ = made
        (verdict,), _, _, classes, numbers = (read(p) for p in map_paths(path))
        found = survey(terrain, ROVER, grid)
        assert grid.bounds[2] > terrain.bounds[2] + 0.5 * grid.resolution or grid.width == 125
        inside = np.isin(found.surfaces, [0, 4]) | ~np.isnan(found.heights)
        rank = np.array([2, 0, 1, 3])
        ranks = rank[found.verdict]
        told = inside & (verdict <= GroundClass.NO_GO)
        assert np.array_equal(rank[verdict[told]], ranks.min(axis=0)[told])
        assert (
            ranks.min(axis=0)[np.isin(verdict, [GroundClass.CUT_OFF, GroundClass.ONE_WAY])] <= 1
        ).all()
        over = found.reason == Reason.EDGE
        edge, nowhere = verdict == GroundClass.EDGE, over.all(axis=0) & inside
        assert edge[nowhere].all() and not edge[~inside].any()
        # the others can be stood on, or could if the ground went on
        assert (over.any(axis=0) | (ranks.min(axis=0) <= 1))[edge].all()
        worst = np.where(over & ~over.all(axis=0), -1, ranks).max(axis=0)
        assert np.array_equal(rank[classes[0][inside]], worst[inside])
        drives = ((found.verdict == 1) | (found.verdict == 2)).sum(axis=0)
        assert np.array_equal(numbers[0][inside], drives[inside])
        go = (found.verdict == 1).sum(axis=0)
        assert np.array_equal(numbers[14][inside], go[inside]) and (go != drives).any()
        known = ~np.isnan(found.sinkage)
        deepest = np.where(known, found.sinkage, -1).max(axis=0)
        assert np.array_equal(numbers[11][known.any(axis=0)], deepest[known.any(axis=0)])
        # where it is steepest along, it is so at the heading that is worst or best, or neither
        assert np.nanmax(numbers[5]) <= np.degrees(np.nanmax(found.pitch)) + 1e-4

    def test_places(self, made: Any) -> None:
        """What is known of the yard stands where it is: west is left, north is up."""
        _, _, path, _ = made
        (verdict,), _, _, classes, numbers = (read(p) for p in map_paths(path))

        def at(x: float, y: float) -> tuple[int, int]:
            return int((12 - y) / 0.16), int(x / 0.16)

        # it uses 0.2627449 of the strength on the level, and tips over sideways sooner
        assert verdict[at(12, 6)] == Verdict.GO and numbers[0][at(12, 6)] == 8
        assert classes[1][at(12, 6)] == Reason.TRACTION
        assert numbers[1][at(12, 6)] == pytest.approx(0.2627449, abs=1e-5)
        assert verdict[at(9, 9)] == Verdict.NO_GO and classes[1][at(9, 9)] == Reason.NO_GROUND
        assert verdict[at(5, 9)] == Verdict.UNKNOWN
        assert classes[1][at(5, 9)] == Reason.SOIL_UNKNOWN
        assert classes[0][at(13.5, 6)] == Verdict.NO_GO  # facing the kerb
        assert classes[2][at(13.5, 6)] == Reason.STEP
        assert numbers[7][at(13.5, 6)] == pytest.approx(0.15)
        # on the ramp, 1.5 in 6 m, the best heading is along, the worst across or up
        ramp = np.degrees(np.arctan(0.25))
        slopes = numbers[3:7, *at(5, 4)]
        assert np.abs(slopes[:2]).max() == pytest.approx(ramp, abs=0.01)
        assert np.isnan(numbers[10]).all()  # it has no overhangs

    def test_summary_counts_pixels_with_ground(self, made: Any) -> None:
        terrain, grid, path, summary = made
        (verdict,), _, _, classes, _ = (read(p) for p in map_paths(path))
        heights = survey(terrain, ROVER, grid).heights
        ground = ~np.isnan(heights)
        assert summary.pixels == ground.sum()
        counts = Counter(verdict[ground].tolist())
        assert {int(k): n for k, n in summary.counts.items() if n} == counts
        worst = Counter(np.where(verdict <= 3, classes[0], verdict)[ground].tolist())
        assert {int(k): n for k, n in summary.worst_counts.items() if n} == worst
        reasons = Counter(classes[1][ground & np.isin(verdict, [2, 3])].tolist())
        assert {int(k): n for k, n in summary.reasons.items()} == reasons
        assert set(summary.by_surface) == {"sand", "rock", "bare"}
        assert sum(sum(c.values()) for c in summary.by_surface.values()) == summary.pixels
        assert summary.by_surface["bare"][Verdict.GO] == 0

    def test_threads_and_no_file_make_no_difference(self, made: Any, tmp_path: Path) -> None:
        terrain, grid, path, summary = made
        assert write_map(terrain, grid.resolution, None, threads=1) == summary
        write_map(terrain, grid.resolution, tmp_path / "yard.tif", threads=1)
        for one, other in zip(map_paths(path), map_paths(tmp_path / "yard.tif"), strict=True):
            assert one.read_bytes() == other.read_bytes()


class TestRefusals:
    """One sentence, and nothing is left behind."""

    def test_no_tif(self, tmp_path: Path) -> None:
        terrain = yard()
        with pytest.raises(RequestError, match=r"a map is a GeoTIFF"):
            write_map(terrain, 0.5, tmp_path / "map.png")
        assert not list(tmp_path.iterdir())

    def test_exists(self, tmp_path: Path) -> None:
        """Any of the five."""
        terrain = yard()
        (tmp_path / "map-numbers.tif").write_text("mine")
        with pytest.raises(WriteError, match=r"map-numbers\.tif: exists already"):
            write_map(terrain, 0.5, tmp_path / "map.tif")
        assert [p.name for p in tmp_path.iterdir()] == ["map-numbers.tif"]

    def test_interrupted(self, tmp_path: Path) -> None:
        """Nothing half-written."""
        terrain = yard()

        class Stop(Told):
            def __call__(self, _: float) -> None:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            write_map(terrain, 0.5, tmp_path / "map.tif", progress=Stop())
        assert not list(tmp_path.iterdir())

    def test_unknown_crs_leaves_nothing(self, tmp_path: Path) -> None:
        terrain = yard(crs="EPSG:1")
        with pytest.raises(Exception, match="unknown"):
            write_map(terrain, 0.5, tmp_path / "map.tif")
        assert not list(tmp_path.iterdir())


class TestResolution:
    """What is chosen when nobody says."""

    def test_quarter_of_a_wheel(self) -> None:
        assert default_resolution(yard(), ROVER) == (0.05, "a quarter of the wheel's radius")

    def test_no_more_pixels_than_a_dem_has(self) -> None:
        size, why = default_resolution(yard(size=[20480, 1000]), ROVER)
        assert (size, why) == (5.0, "4096 pixels on the longer side")

    def test_bounds_are_what_counts(self) -> None:
        """A small part of a large terrain is looked at as closely as a small terrain."""
        terrain = yard(size=[204800, 1000])
        west, south, _, _ = terrain.bounds
        part = (west + 100, south + 100, west + 160, south + 130)
        assert default_resolution(terrain, ROVER, part)[0] == pytest.approx(0.05)
        assert default_resolution(terrain, ROVER, part, 600)[0] == pytest.approx(0.1)
        with pytest.raises(RequestError, match="miss the terrain"):
            default_resolution(terrain, ROVER, (-9, -9, -1, -1))

    def test_too_large_for_one_map(self) -> None:
        """Nobody asked for the resolution that would be too coarse; bounds help."""
        with pytest.raises(RequestError, match="204800 m long, too long for the 4096") as caught:
            default_resolution(yard(size=[204800, 1000]), ROVER)
        assert "--bounds" in caught.value.hint and "--resolution" in caught.value.hint

    def test_coarse_grids_see_what_lies_between_centres(self) -> None:
        """A wall between two pixels 1.2 m apart, narrower than they are, is found."""
        terrain = terrain_of(
            {
                "size": [24, 12],
                "surfTypes": {"rock": {"cohesion": 0, "fricAngle": 35, "sinkage": 0}},
                "elemTypes": {"flat": {"x": [0]}, "box": {"x": [1]}},
                "elemTree": {
                    "type": "flat", "surface": "rock", "cells": [60, 1],
                    "children": [{"type": "box", "cellX": 30, "cellY": 0, "vScale": 0.5}],
                },
            }
        )  # fmt: skip
        found = Surveyor(terrain, ROVER, grid := Grid(0, 0, 1.2, 10, 20)).measure(grid.whole)
        barred = found.verdict[2] == Verdict.NO_GO
        assert barred[1:-1, 8:11].any(axis=1).all()
        assert (found.verdict[2, 2:-2, 2:8] == Verdict.GO).all()


def test_the_origin_makes_no_difference() -> None:
    """Neither does the reference system."""
    plain = yard(crs="EPSG:32632", origin=[0, 0])
    summary = write_map(plain, 0.32, None)
    moved = yard()
    there = write_map(moved, 0.32, None)
    assert summary.counts == there.counts
