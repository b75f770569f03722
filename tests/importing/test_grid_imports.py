"""`import-terrain --as grid`: a short definition, and a raster of heights beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

import terratool
from terratool.field.terrain import load
from terratool.importing.terrain import request
from tests.commands import call as run
from tests.rasters import geotiff

HEIGHTS = (np.arange(54, dtype=np.float32).reshape(6, 9) ** 1.3).astype(np.float32)
CORNER = (400000.0, 5000000.0)


@pytest.fixture
def dem(tmp_path: Path) -> Path:
    """9 × 6 pixels of 2 m in UTM, one of them nodata."""
    heights = HEIGHTS.copy()
    heights[2, 3] = -9999
    path = tmp_path / "dem.tif"
    geotiff(path, heights, corner=CORNER, crs="EPSG:32633", nodata=-9999)
    return path


def imported(dem: Path, *more: Any) -> Path:
    out = dem.with_name("site.json")
    ran = run("import-terrain", dem, out, "--max-error", 0.25, "--as", "grid", *more)
    assert (ran.code, ran.err) == (0, "")
    return out


def test_the_definition_is_short_and_names_the_raster(dem: Path) -> None:
    out = imported(dem, "--preset", "dry-sand")
    written = json.loads(out.read_text())
    assert written["elemTypes"] == {"ground": {"grid": {"file": "site-heights.tif"}}}
    root = written["elemTree"]
    assert root["type"] == "ground" and root["surface"] == "dry-sand"
    assert written["surfTypes"] == {"dry-sand": {"preset": "dry-sand"}}
    assert (written["size"], written["origin"]) == ([18.0, 12.0], [400000.0, 4999988.0])
    with rasterio.open(out.with_name("site-heights.tif")) as file:
        numbers = file.read(1, masked=True)
        assert file.dtypes == ("uint16",) and file.crs.to_epsg() == 32633
        assert file.bounds == (400000, 4999988, 400018, 5000000)
    assert numbers.mask[2, 3] and numbers.mask.sum() == 1
    known = ~numbers.mask
    ours = root["vScale"] * numbers.data + root["vOffset"]
    assert np.abs(ours - HEIGHTS)[known].max() <= 0.25
    assert root["vScale"] > 0.4  # not finer than was asked for


def test_the_terrain_is_the_dem(dem: Path) -> None:
    """At the middle of each pixel, within the error, and void where that is nodata."""
    terrain = load(imported(dem))
    x, y = np.meshgrid(400001 + 2 * np.arange(9), 4999999 - 2 * np.arange(6))
    heights = terrain.height(x, y)
    void = np.zeros((6, 9), bool)
    void[2, 3] = True
    assert np.array_equal(np.isnan(heights), void)
    assert np.abs(heights - HEIGHTS)[~void].max() <= 0.25
    # the whole pixel is void, and half-open to the east and the north
    edges = terrain.height([400006, 400008, 400007, 400007], [4999995, 4999995, 4999994, 4999996])
    assert np.isnan(edges).tolist() == [True, False, True, False]


def test_a_raster_of_several_tiles_has_overviews_that_change_nothing(tmp_path: Path) -> None:
    """Means, at 2, 4 … of the pixels down to one tile; no height of the terrain is one of them."""
    heights = np.random.default_rng(2).uniform(0, 9, (130, 1030)).astype(np.float32)
    geotiff(tmp_path / "dem.tif", heights, corner=(0, 260))
    out = imported(tmp_path / "dem.tif")
    with rasterio.open(tmp_path / "site-heights.tif") as file:
        assert file.overviews(1) == [2, 4]
        numbers = file.read(1)
    with rasterio.open(tmp_path / "site-heights.tif", overview_level=0) as half:
        means = numbers.reshape(65, 2, 515, 2).mean((1, 3))
        assert np.abs(half.read(1) - means).max() <= 0.5
    x, y = np.meshgrid(1 + 2 * np.arange(1030), 259 - 2 * np.arange(130))
    found = load(out).height(x, y)
    assert np.abs(found - heights).max() <= 0.25
    root = json.loads(out.read_text())["elemTree"]
    assert np.abs(found - (numbers * root["vScale"] + root["vOffset"])).max() < 1e-9


def test_a_raster_of_one_tile_has_no_overviews(dem: Path) -> None:
    imported(dem)
    with rasterio.open(dem.with_name("site-heights.tif")) as file:
        assert file.overviews(1) == []


def test_gaps_are_filled_if_asked_for(dem: Path) -> None:
    terrain = load(imported(dem, "--fill"))
    filled = terrain.height(400007, 4999995)
    assert HEIGHTS[1, 2] < filled < HEIGHTS[3, 4]


def test_what_stands_on_it_is_added(dem: Path) -> None:
    out = imported(dem)
    before = load(out).height(400013, 4999991)
    box = '{"x":[1]}'
    written = json.loads(out.read_text())
    written["elemTypes"]["box"] = json.loads(box)
    out.write_text(json.dumps(written))
    ran = run("add", out, "--type", "box", "--at", 13, 3, "--extent", 2, 2, "--v-scale", 1.5)
    assert ran.code == 0, ran.err
    assert load(out).height(400013, 4999991) == pytest.approx(before + 1.5, abs=1e-9)


def test_large_ones_become_grids_by_themselves(dem: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request, "MOST_AS_ROWS", 53)
    out = dem.with_name("site.json")
    ran = run("import-terrain", dem, out, "--max-error", 0.25)
    assert "a grid is made of them" in ran.out.splitlines()[0]
    assert "grid" in json.loads(out.read_text())["elemTypes"]["ground"]
    for more in (["--as", "rows"], ["--method", "rows"], ["--cells", "pixels"]):
        ran = run("import-terrain", dem, out, "--max-error", 0.25, "--overwrite", *more)
        assert "a grid is made" not in ran.out
        assert "ground" not in json.loads(out.read_text())["elemTypes"]
    monkeypatch.setattr(request, "MOST_AS_ROWS", 54)
    ran = run("import-terrain", dem, out, "--max-error", 0.25, "--overwrite")
    assert "ground" not in json.loads(out.read_text())["elemTypes"]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--method", "rows"], "--method is about rows, and a grid is asked for."),
        (["--cells", "pixels"], "--cells is about rows"),
        (["--walls"], "--walls is about rows"),
        (["--max-error", "0"], "The largest error is 0."),
    ],
)
def test_what_is_about_rows_is_refused(dem: Path, more: list[str], says: str) -> None:
    out = dem.with_name("site.json")
    ran = run("import-terrain", dem, out, "--max-error", 0.25, "--as", "grid", *more)
    assert ran.code == 2 and says in ran.err
    assert sorted(path.name for path in dem.parent.iterdir()) == ["dem.tif"]


def test_no_source_is_replaced(dem: Path) -> None:
    """Not even one that is called as the raster beside the definition would be."""
    source = dem.rename(dem.with_name("site-heights.tif"))
    before = source.read_bytes()
    for more in ([], ["--overwrite"]):
        ran = run(
            "import-terrain", source, dem.with_name("site.json"), "--max-error", 0.25,
            "--as", "grid", *more,
        )  # fmt: skip
        assert ran.code == 2 and "would be written over it" in ran.err
    with pytest.raises(terratool.WriteError, match="is the same file as"):
        terratool.import_terrain(
            source, dem.with_name("site.json"), max_error=0.25, as_="grid", overwrite=True
        )
    assert source.read_bytes() == before
    # where no raster is written, it is a source as any other
    ran = run("import-terrain", source, dem.with_name("site.json"), "--max-error", 0.25)
    assert (ran.code, ran.err) == (0, "")
    terratool.import_terrain(source, dem.with_name("b.json"), max_error=0.25)


def test_sizes_are_those_of_the_files(dem: Path) -> None:
    out, raster = imported(dem), dem.with_name("site-heights.tif")
    arguments = "import-terrain", dem, out, "--max-error", 0.25, "--as", "grid", "--overwrite"
    ran, document = run(*arguments), json.loads(run(*arguments, "--json").out)
    assert f"{out}: {out.stat().st_size:,} bytes" in ran.out
    assert f"{raster}: the heights, {raster.stat().st_size:,} bytes" in ran.out
    assert (document["bytes"], document["raster"], document["raster_bytes"]) == (
        out.stat().st_size, str(raster), raster.stat().st_size
    )  # fmt: skip


def test_files_that_exist_stay(dem: Path) -> None:
    beside = dem.with_name("site-heights.tif")
    beside.write_text("mine")
    ran = run("import-terrain", dem, dem.with_name("site.json"), "--max-error", 1, "--as", "grid")
    assert ran.code == 3 and "site-heights.tif" in ran.err
    assert beside.read_text() == "mine" and not dem.with_name("site.json").exists()


def test_a_terrain_without_a_file_is_rows(dem: Path) -> None:
    terrain = terratool.import_terrain(dem, max_error=0.25)
    assert abs(terrain.height(400001, 4999999) - HEIGHTS[0, 0]) <= 0.25
    with pytest.raises(terratool.RequestError, match="no file is named"):
        terratool.import_terrain(dem, max_error=0.25, as_="grid")


@pytest.mark.parametrize(("relief", "dtype"), [(1e4, "uint16"), (1e6, "int32"), (9e8, "float64")])
def test_numbers_have_room_for_all_steps(tmp_path: Path, relief: float, dtype: str) -> None:
    heights = np.array([[0, relief, 0.25 * relief], [0.7 * relief, 1.0, relief]])
    path, out = tmp_path / "a.tif", tmp_path / "a.json"
    geotiff(path, heights)
    error = 0.2
    assert run("import-terrain", path, out, "--max-error", error, "--as", "grid").code == 0
    with rasterio.open(tmp_path / "a-heights.tif") as file:
        assert file.dtypes == (dtype,)
        root = json.loads(out.read_text())["elemTree"]
        ours = root["vScale"] * file.read(1).astype(float) + root["vOffset"]
    assert np.abs(ours - heights).max() <= error
