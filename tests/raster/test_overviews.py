"""Overviews: what they show, who has them, and that nothing else changes."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.enums import Resampling
from rasterio.transform import Affine

import terratool
from terratool.errors import RequestError
from terratool.raster.grid import grid_over
from terratool.raster.overviews import OVERVIEWS_FROM
from tests.commands import call
from tests.conftest import terrain_of
from tests.mosaics import ALL, export_dem
from tests.programs import program

Pixels = NDArray[np.float64]


def ridges(width: float = 42.02, depth: float = 7.51) -> terratool.Terrain:
    """Slopes to all sides, and a hole; oblong, so that a mirrored one is caught."""
    return terrain_of({
        "size": [width, depth],
        "surfTypes": {
            "sand": {"sonarRefl": 0.25, "color": [200, 100, 0], "cohesion": 1},
            "rock": {"sonarRefl": 0.5, "color": [0, 90, 30]},
            "hole": {"void": True},
        },
        "elemTypes": {
            "waves": {"combine": "sum", "x": "sin(25*t)", "y": "cos(7*t)+t/2"},
            "hill": {"combine": "radial", "x": "cosbell"},
        },
        "elemTree": {
            "type": "waves", "vScale": 1, "surface": "sand", "cells": [12, 3],
            "children": [
                {"type": "hill", "cellX": 2, "cellY": 1, "vScale": 1, "surface": "hole"},
                {"type": "hill", "cellX": 7, "cellY": 2, "vScale": 2, "surface": "rock"},
            ],
        },
    })  # fmt: skip


def level(path: Path, number: int | None = None) -> Pixels:
    """Bands of an overview, or of the file itself, NaN for none."""
    options = {} if number is None else {"overview_level": number}
    with rasterio.open(path, **options) as file:
        pixels = file.read().astype(np.float64)
        if file.nodata is not None:
            pixels[pixels == file.nodata] = np.nan
    return pixels


def averaged(bands: Pixels, folder: Path) -> Pixels:
    """The same at half the resolution, as GDAL averages."""
    path = folder / "reference.tif"
    profile: dict[str, Any] = {
        "driver": "GTiff", "count": len(bands), "height": bands.shape[1], "width": bands.shape[2],
        "dtype": "float64", "nodata": np.nan, "transform": Affine(1, 0, 9, 0, -1, 0),
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as file:
        file.write(bands)
    with rasterio.open(path, "r+") as file:
        file.build_overviews([2], Resampling.average)
    return level(path, 0)


@pytest.fixture(scope="module")
def numbers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Heights, aspects, normals and sonar in one file, plain and cloud-optimised."""
    folder = tmp_path_factory.mktemp("overviews")
    terrain, layers = ridges(), ["height", "aspect", "sonar", "normal"]
    paths = {name: folder / f"{name}.tif" for name in ("plain", "cog", "value")}
    grid = grid_over(terrain, 0.02)
    export_dem(terrain, grid, paths["plain"], layers, overviews=True)
    export_dem(terrain, grid, paths["cog"], layers, cog=True)
    export_dem(terrain, grid, paths["value"], layers, nodata=-9999, overviews=True)
    return paths


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["plain", "cog", "value"])
def test_each_is_the_mean_of_the_one_before(
    numbers: dict[str, Path], name: str, tmp_path: Path
) -> None:
    """Of directions by unit vectors, of normals at length 1; what is not known has no part.

    GDAL averages the vectors here; sides are odd at some levels.
    """
    with rasterio.open(numbers[name]) as file:
        assert all(file.overviews(band) == [2, 4, 8] for band in file.indexes)
        assert (file.width, file.height) == (2101, 375)
    fine = level(numbers[name])
    assert np.isnan(fine[0]).any()
    for number in range(3):
        coarse = level(numbers[name], number)
        height, aspect, sonar, *normal = coarse
        angles = np.radians(fine[1])
        known = [fine[0], fine[2], *fine[3:], np.sin(angles), np.cos(angles)]
        means = averaged(np.stack(known), tmp_path)
        assert np.allclose(height, means[0], rtol=1e-6, atol=1e-6, equal_nan=True)
        assert np.allclose(sonar, means[1], atol=1e-6, equal_nan=True)
        assert np.allclose(
            normal, means[2:5] / np.linalg.norm(means[2:5], axis=0), atol=1e-5, equal_nan=True
        )
        sure = np.hypot(means[5], means[6]) > 1e-3
        apart = (aspect - np.degrees(np.arctan2(means[5], means[6])) + 180) % 360 - 180
        assert np.abs(apart[sure]).max() < 1e-3
        assert np.nanmin(aspect) >= 0 and np.nanmax(aspect) < 360
        fine = coarse


@pytest.mark.nightly
def test_north_is_between_its_neighbours(numbers: dict[str, Path]) -> None:
    """An arithmetic mean of aspects around north would be south."""
    fine, coarse = level(numbers["plain"])[1], level(numbers["plain"], 0)[1]
    four = np.stack([fine[i:374:2, j:2100:2] for i in (0, 1) for j in (0, 1)])
    near = coarse[:187, :1050]
    northern = (np.abs((four + 180) % 360 - 180) < 10).all(axis=0)
    crossing = northern & (four.min(axis=0) < 10) & (four.max(axis=0) > 350)
    assert crossing.sum() > 20
    assert (np.abs((near[crossing] + 180) % 360 - 180) < 15).all()


def test_heights_alone_are_averaged_by_gdal(tmp_path: Path) -> None:
    terrain = ridges()
    export_dem(terrain, grid_over(terrain, 0.02), tmp_path / "a.tif", nodata=-9999, overviews=True)
    fine = level(tmp_path / "a.tif")
    for number in range(3):
        coarse = level(tmp_path / "a.tif", number)
        fine = averaged(fine, tmp_path)
        # where sides are odd, the parts of pixels that GDAL takes are not the same for all windows
        assert np.nanmax(np.abs(coarse - fine)) < 2e-2
        if number == 0:
            assert np.nanmedian(np.abs(coarse - fine)) < 1e-6


def test_surfaces_and_colours(tmp_path: Path) -> None:
    """Surfaces are those of pixels, colours are mixed."""
    terrain = ridges()
    export_dem(terrain, grid_over(terrain, 0.02), tmp_path / "a.tif", ["surface", "color"],
               overviews=True)  # fmt: skip
    with (
        rasterio.open(tmp_path / "a.tif", overview_level=0) as coarse,
        rasterio.open(tmp_path / "a.tif") as file,
    ):
        assert set(np.unique(coarse.read())) == {1, 2, 3}
        assert coarse.colormap(1) == file.colormap(1)
        fine, half = file.read(1), coarse.read(1)
        near = fine[:374:2, :2100:2], fine[:374:2, 1:2100:2]
        equal = (half[:187, :1050] == near[0]) | (half[:187, :1050] == near[1])
        assert equal[:150, :1000].mean() > 0.99
    fine, half = level(tmp_path / "a-color.tif"), level(tmp_path / "a-color.tif", 0)
    assert np.abs(half - averaged(fine, tmp_path)).max() <= 1


def test_who_has_them(tmp_path: Path) -> None:
    terrain = ridges(10.0, 2.0)
    edge = grid_over(terrain, 10 / OVERVIEWS_FROM)
    more = grid_over(terrain, 10 / (OVERVIEWS_FROM + 1))
    assert (edge.width, more.width) == (OVERVIEWS_FROM, OVERVIEWS_FROM + 1)
    for grid, options, wanted in (
        (edge, {}, 0), (more, {}, 4), (edge, {"overviews": True}, 3),
        (more, {"overviews": False}, 0), (more, {"overviews": False, "layers": ["aspect"]}, 0),
        (grid_over(terrain, 0.1), {"overviews": True, "layers": ["aspect"]}, 0),
        (grid_over(terrain, 10 / 513), {"overviews": True, "layers": ["aspect"]}, 1),
    ):  # fmt: skip
        report = export_dem(terrain, grid, tmp_path / "a.tif", overwrite=True, **options)
        with rasterio.open(tmp_path / "a.tif") as file:
            assert len(file.overviews(1)) == wanted == len(report.files[0].overviews or ())
        assert [path.name for path in tmp_path.iterdir()] == ["a.tif"]


def test_what_does_not_go_together(tmp_path: Path) -> None:
    terrain = ridges()
    grid = grid_over(terrain, 0.5)
    for name, options, words in (
        ("a.png", {"overviews": True}, "Only a .tif"),
        ("a.tif", {"overviews": False, "cog": True}, "cloud-optimised GeoTIFF has overviews"),
    ):
        with pytest.raises(RequestError, match=words):
            export_dem(terrain, grid, tmp_path / name, **options)
    sample = tmp_path / "a.json"
    sample.write_text(json.dumps({"size": 1, "elemTypes": {"a": {"x": [1]}},
                                  "elemTree": {"type": "a"}}))  # fmt: skip
    ran = call("export-dem", sample, "--tiles", tmp_path / "m", "--overviews")
    assert ran.code == 2 and "gdaladdo" in ran.err
    ran = call("export-dem", sample, tmp_path / "one.tif", "--overviews")
    assert "one.tif: float32, one tile, which needs no overviews\n" in ran.out
    assert "overviews" not in call("export-dem", sample, tmp_path / "two.tif").out


@pytest.mark.nightly
def test_all_else_is_the_same(tmp_path: Path) -> None:
    """Pixels, places, names, units, statistics, compression; and bytes from run to run."""
    terrain = ridges()
    layers = [name for name in ALL if name not in ("surface", "color")]
    grid = grid_over(terrain, 0.02)
    for name, options in (
        ("without", {}),
        ("with", {"overviews": True}),
        ("again", {"overviews": True, "threads": 1}),
    ):
        export_dem(terrain, grid, tmp_path / f"{name}.tif", layers, **options)
    one, other = (rasterio.open(tmp_path / f"{name}.tif") for name in ("with", "without"))
    with one, other:
        assert np.array_equal(one.read(), other.read(), equal_nan=True)
        for what in ("bounds", "crs", "descriptions", "units", "dtypes", "block_shapes",
                     "compression", "interleaving", "colorinterp"):  # fmt: skip
            assert getattr(one, what) == getattr(other, what), what
        assert one.tags() == other.tags()
        assert all(one.tags(band) == other.tags(band) for band in one.indexes)
    assert (tmp_path / "with.tif").read_bytes() == (tmp_path / "again.tif").read_bytes()


def test_lossy_compression_says_so(tmp_path: Path) -> None:
    """Overviews of our own are made of exact pixels; the file keeps to its error."""
    terrain = ridges()
    grid = grid_over(terrain, 0.02)
    report = export_dem(
        terrain, grid, tmp_path / "a.tif", ["height", "aspect"],
        compress="lerc", max_error=0.01, overviews=True,
    )  # fmt: skip
    export_dem(terrain, grid, tmp_path / "b.tif", ["height", "aspect"])
    found, exact = level(tmp_path / "a.tif"), level(tmp_path / "b.tif")
    assert 1e-3 < np.nanmax(np.abs(found - exact)) <= 0.01 + 2e-5
    assert report.files[0].difference == 0.01


@pytest.mark.parametrize("name", ["cog", "plain"])
def test_others_accept_them(numbers: dict[str, Path], name: str) -> None:
    """The validator of COGs, and gdalinfo."""
    cogeo = pytest.importorskip("rio_cogeo")
    if name == "cog":
        assert cogeo.cog_validate(numbers[name], strict=True) == (True, [], [])
    plain = {key: value for key, value in os.environ.items() if key != "GDAL_SKIP"}
    told = subprocess.run(
        [program("gdalinfo"), numbers[name]], capture_output=True, text=True, check=True, env=plain
    )
    assert told.stderr == ""
    assert told.stdout.count("Overviews: 1051x188, 526x94, 263x47") == 6


def test_the_command_says_how_many(tmp_path: Path) -> None:
    sample = tmp_path / "a.json"
    sample.write_text(json.dumps({"size": 2, "elemTypes": {"a": {"x": [0, 1]}},
                                  "elemTree": {"type": "a"}}))  # fmt: skip
    ran = call("export-dem", sample, tmp_path / "a.tif", "--resolution", 0.002, "--overviews")
    assert "float32, 1 overview\n" in ran.out
    ran = call("export-dem", sample, tmp_path / "b.tif", "--resolution", 0.002, "--cog", "--json")
    assert json.loads(ran.out)["files"][0]["overviews"] == [2]
