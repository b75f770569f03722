"""Grids of heights in files beside the definition: the answers of rows, however they are read."""

from __future__ import annotations

import json
import math
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terratool.definition.reader import check, load_checked
from terratool.errors import ReadError
from terratool.field.bounds import largest_heights, nonzero_edges
from terratool.field.terrain import Terrain
from terratool.io import grid_cache
from terratool.text.source import Source
from tests.budget import examples
from tests.conftest import terrain_of, text_of
from tests.oracle import Oracle
from tests.rasters import geotiff
from tests.strategies import definitions, landmarks, rims

SIZE = (7, 4)
HEIGHTS = np.array([[0, 1, 4], [9, 2, 3], [5, 5, 8], [7, 6, 0], [1, 12, 11]], np.float64)
"""Five rows of three, none like another from any side."""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "terratool" / "grids"


def definition_of(grid: Any, registration: str | None = None, **element: Any) -> dict[str, Any]:
    """A terrain of one grid, oblong and not of the grid's proportions."""
    primitive = {"grid": grid} | ({"registration": registration} if registration else {})
    root = {"type": "dem", "vScale": 1, **element}
    return {"size": list(SIZE), "elemTypes": {"dem": primitive}, "elemTree": root}


def loaded(folder: Path, definition: dict[str, Any]) -> Terrain:
    """The terrain of a definition in a folder."""
    (folder / "site.json").write_text(json.dumps(definition))
    return Terrain(load_checked(folder / "site.json"))


def places() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points all over the terrain, on all edges of cells and pixels, and beside them."""
    x, y = (
        {0.0, side} | {side * k / n for n in (2, 3, 4, 5, 7) for k in range(n)} for side in SIZE
    )
    x |= {math.nextafter(v, w) for v in x for w in (0, 9)}
    y |= {math.nextafter(v, w) for v in y for w in (0, 9)}
    return tuple(a.ravel() for a in np.meshgrid(sorted(x), sorted(y)))  # type: ignore[return-value]


def rows_of(heights: NDArray[np.float64]) -> list[list[float | None]]:
    return [[None if math.isnan(z) else z for z in row] for row in heights.tolist()]


TYPES = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "int64", "float32", "float64"]


@pytest.mark.parametrize("registration", ["gridline", "pixel"])
@pytest.mark.parametrize("kind", TYPES)
def test_a_file_is_what_its_numbers_are_as_rows(
    kind: str, registration: str, tmp_path: Path
) -> None:
    """Of all types, to the last bit, with heights, slopes and elements; nodata is void."""
    heights = HEIGHTS.copy()
    heights[1, 2] = math.nan
    raw = np.where(np.isnan(heights), 77, heights).astype(kind)
    geotiff(tmp_path / "dem.tif", raw, nodata=77)
    rows = terrain_of(definition_of(rows_of(heights), registration))
    file = loaded(tmp_path, definition_of({"file": "dem.tif"}, registration))
    x, y = places()
    wanted, found = rows.sample(x, y), file.sample(x, y)
    assert np.isnan(wanted.height).any() and not np.isnan(wanted.height).all()
    assert np.array_equal(found.height, wanted.height, equal_nan=True)
    assert np.array_equal(found.normal, wanted.normal, equal_nan=True)
    oracle = Oracle(definition_of(rows_of(heights), registration))
    for place in [(0.3, 0.2), (6.9, 0.1), (3.3, 3.9), (2.0, 2.5)]:
        z = oracle.at(*place).z
        assert file.height(*place) == pytest.approx(z, abs=1e-12, nan_ok=True)


def test_rows_are_gridline_and_files_pixels_by_default(tmp_path: Path) -> None:
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    x, y = places()
    for grid, registration in (({"file": "dem.tif"}, "pixel"), (HEIGHTS.tolist(), "gridline")):
        left_out = loaded(tmp_path, definition_of(grid)).height(x, y)
        said = loaded(tmp_path, definition_of(grid, registration)).height(x, y)
        assert np.array_equal(left_out, said, equal_nan=True)


@pytest.mark.parametrize("kind", ["int16", "float32", "float64"])
def test_scale_and_offset_are_applied_in_doubles(kind: str, tmp_path: Path) -> None:
    geotiff(
        tmp_path / "dem.tif", HEIGHTS.astype(kind), nodata=12,
        band={"scales": (0.1,), "offsets": (-3.7,)},
    )  # fmt: skip
    heights = np.where(HEIGHTS == 12, math.nan, HEIGHTS * 0.1 + -3.7)
    x, y = places()
    file = loaded(tmp_path, definition_of({"file": "dem.tif"})).height(x, y)
    rows = terrain_of(definition_of(rows_of(heights), "pixel")).height(x, y)
    assert np.array_equal(file, rows, equal_nan=True)


def test_what_is_no_height_is_void(tmp_path: Path) -> None:
    """NaN, infinite numbers, ones beyond the format, and what a mask leaves out."""
    heights = HEIGHTS.copy()
    heights[0, 0], heights[2, 1], heights[4, 2], heights[3, 0] = math.inf, -math.inf, 1e31, math.nan
    geotiff(tmp_path / "dem.tif", heights)
    void = np.where(np.abs(heights) <= 1e30, heights, math.nan)
    x, y = places()
    rows = terrain_of(definition_of(rows_of(void), "pixel")).height(x, y)
    file = loaded(tmp_path, definition_of({"file": "dem.tif"})).height(x, y)
    assert np.isnan(file).any() and np.array_equal(file, rows, equal_nan=True)


@pytest.mark.parametrize("compress", ["none", "zstd"])
def test_what_a_mask_in_the_file_leaves_out_is_void(compress: str, tmp_path: Path) -> None:
    mask = np.full(HEIGHTS.shape, 255, np.uint8)
    mask[1, 2] = mask[4, 0] = 0
    name = geotiff(tmp_path / "dem.tif", HEIGHTS.astype(np.int16), compress=compress)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(name, "r+") as file:
        file.write_mask(mask)
    assert [path.name for path in tmp_path.glob("*.tif*")] == ["dem.tif"]
    rows = terrain_of(definition_of(rows_of(np.where(mask, HEIGHTS, math.nan)), "pixel"))
    x, y = places()
    file_heights = loaded(tmp_path, definition_of({"file": "dem.tif"})).height(x, y)
    assert np.array_equal(file_heights, rows.height(x, y), equal_nan=True)


def test_the_rim_and_the_size_of_heights_are_those_of_rows(tmp_path: Path) -> None:
    """Of a low valley whose rim is level but for one place, or all of it."""
    for number, place in enumerate([(0, 1), (4, 1), (2, 0), (2, 2), (2, 1)]):
        heights = np.zeros((5, 3))
        heights[2, 1], heights[place] = 3, -7
        geotiff(tmp_path / f"{number}.tif", heights)
        file = loaded(tmp_path, definition_of({"file": f"{number}.tif"})).arrays
        rows = terrain_of(definition_of(heights.tolist(), "pixel")).arrays
        assert largest_heights(file).tolist() == largest_heights(rows).tolist() == [7]
        assert nonzero_edges(file).tolist() == nonzero_edges(rows).tolist() == [number < 4]


def test_the_band_that_is_named_counts(tmp_path: Path) -> None:
    geotiff(tmp_path / "dem.tif", np.stack([HEIGHTS, 2 * HEIGHTS]).astype(np.float32))
    x, y = places()
    one, two = (
        loaded(tmp_path, definition_of({"file": "dem.tif", "band": band})).height(x, y)
        for band in (1, 2)
    )
    assert np.array_equal(two, 2 * one, equal_nan=True) and np.nanmax(one) > 0


@pytest.mark.parametrize(
    "options",
    [
        {"compress": "zstd", "tiled": True, "blockxsize": 16, "blockysize": 32, "predictor": 3},
        {"compress": "deflate", "blockysize": 3},
        {"tiled": True, "blockxsize": 64, "blockysize": 16, "interleave": "pixel"},
        {"endianness": "big"},
        {"blockysize": 70},
    ],
    ids=str,
)  # fmt: skip
def test_blocks_and_windows_change_nothing(
    options: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of any shape, and read in pieces far smaller than a row."""
    heights = np.random.default_rng(3).normal(size=(70, 131)).astype(np.float32)
    geotiff(tmp_path / "dem.tif", heights, **options)
    monkeypatch.setattr("terratool.io.grid_files._PIECE", 700)
    terrain = loaded(tmp_path, definition_of({"file": "dem.tif"}))
    numbers = terrain.arrays.curves.mapped.numbers(0)
    assert np.array_equal(numbers, heights)


def test_cold_and_warm_and_no_cache_agree(tmp_path: Path, cache: Path) -> None:
    """And a file of the cache that is cut short, or belongs to others, is not taken."""
    geotiff(tmp_path / "dem.tif", HEIGHTS, compress="zstd")
    definition = definition_of({"file": "dem.tif"})
    x, y = places()
    cold = loaded(tmp_path, definition).height(x, y)
    (kept,) = cache.glob("*.grid")
    assert kept.stat().st_mode & 0o777 == 0o600 and cache.stat().st_mode & 0o777 == 0o700
    before = kept.read_bytes()
    assert np.array_equal(loaded(tmp_path, definition).height(x, y), cold, equal_nan=True)
    assert kept.read_bytes() == before
    for broken in (before[:-1], before[:60], b"", before.replace(b"\x28\x40", b"\x29\x40")):
        assert broken != before
        kept.write_bytes(broken)
        assert np.array_equal(loaded(tmp_path, definition).height(x, y), cold, equal_nan=True)
        assert kept.read_bytes() == before, "it is written anew"
    for mode in (0o755, 0o770):
        cache.chmod(mode)
        kept.unlink(missing_ok=True)
        assert np.array_equal(loaded(tmp_path, definition).height(x, y), cold, equal_nan=True)
        assert not kept.exists(), "the folder is not this user's alone"


def test_a_cache_that_cannot_be_written_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    (tmp_path / "file").write_text("")
    x, y = places()
    wanted = loaded(tmp_path, definition_of({"file": "dem.tif"})).height(x, y)
    for place in ("file", "none"):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / place))
        if place == "none":
            monkeypatch.setattr(grid_cache, "free_bytes", lambda _: 10)
        found = loaded(tmp_path, definition_of({"file": "dem.tif"}))
        assert np.array_equal(found.height(x, y), wanted, equal_nan=True)
        assert not grid_cache.files()


def test_a_link_in_the_cache_is_not_followed(tmp_path: Path, cache: Path) -> None:
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    definition = definition_of({"file": "dem.tif"})
    loaded(tmp_path, definition)
    (kept,) = cache.glob("*.grid")
    target = tmp_path / "target"
    kept.rename(target)
    kept.symlink_to(target)
    loaded(tmp_path, definition)
    assert not kept.is_symlink() and target.exists()


def test_pickled_terrains_carry_places_rather_than_numbers(tmp_path: Path, cache: Path) -> None:
    """They are mapped anew, unpacked anew where the cache is gone, and refused if they changed."""
    heights = np.random.default_rng(5).normal(size=(300, 200))
    geotiff(tmp_path / "dem.tif", heights)
    terrain = loaded(tmp_path, definition_of({"file": "dem.tif"}))
    pickled = pickle.dumps(terrain)
    assert len(pickled) < heights.nbytes / 10
    x, y = places()
    wanted = terrain.height(x, y)
    assert np.array_equal(pickle.loads(pickled).height(x, y), wanted, equal_nan=True)
    grid_cache.clear()
    assert np.array_equal(pickle.loads(pickled).height(x, y), wanted, equal_nan=True)
    geotiff(tmp_path / "dem.tif", heights + 1)
    with pytest.raises(ReadError, match="has changed since"):
        pickle.loads(pickled)
    assert np.array_equal(terrain.height(x, y), wanted, equal_nan=True), (
        "what is mapped stays what it was"
    )


def test_a_file_that_changes_between_header_and_numbers_is_refused(tmp_path: Path) -> None:
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    (tmp_path / "site.json").write_text(json.dumps(definition_of({"file": "dem.tif"})))
    checked = load_checked(tmp_path / "site.json")
    geotiff(tmp_path / "dem.tif", HEIGHTS[:4])
    with pytest.raises(ReadError, match="has changed since"):
        Terrain(checked)


def test_two_processes_at_once_agree(tmp_path: Path, cache: Path) -> None:
    heights = np.random.default_rng(4).normal(size=(400, 300)).astype(np.float32)
    geotiff(tmp_path / "dem.tif", heights, compress="zstd", tiled=True)
    (tmp_path / "site.json").write_text(json.dumps(definition_of({"file": "dem.tif"})))
    code = (
        "import sys; from terratool.field.terrain import load;"
        "print(float(load(sys.argv[1]).height(3.3, 1.7)).hex())"
    )
    both = [
        subprocess.Popen(
            [sys.executable, "-c", code, str(tmp_path / "site.json")], stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    said = [process.communicate()[0] for process in both]
    wanted = Terrain(load_checked(tmp_path / "site.json")).height(3.3, 1.7)
    assert said == [f"{float(wanted).hex()}\n"] * 2
    assert len(grid_cache.files()) == 1


def test_libraries_parts_and_folders(tmp_path: Path) -> None:
    """A path begins at the folder of its own file, in shared terrains and in expanded ones."""
    (tmp_path / "kit" / "data").mkdir(parents=True)
    geotiff(tmp_path / "kit" / "data" / "dem.tif", HEIGHTS)
    geotiff(tmp_path / "dem.tif", HEIGHTS[::-1])
    kit = {
        "elemTypes": {"hill": {"grid": {"file": "data/dem.tif"}}},
        "parts": {"site": {"type": "hill", "vScale": 1}},
    }
    (tmp_path / "kit" / "kit.json").write_text(json.dumps(kit))
    site = {
        "size": [14, 4], "use": ["kit/kit.json"],
        "elemTypes": {"flat": {"x": [0, 0]}, "own": {"grid": {"file": "dem.tif"}}},
        "elemTree": {"type": "flat", "vScale": 1, "cells": [2, 1], "children": [
            {"cellX": 0, "cellY": 0, "part": "site"},
            {"cellX": 1, "cellY": 0, "type": "own", "vScale": 1}]},
    }  # fmt: skip
    (tmp_path / "site.json").write_text(json.dumps(site))
    checked = load_checked(tmp_path / "site.json")
    x, y = places()
    inside = x < 7
    x, y = x[inside], y[inside]
    for share_above in (math.inf, 0):
        terrain = Terrain(checked, share_above=share_above)
        for moved, heights in ((0, HEIGHTS), (7, HEIGHTS[::-1])):
            alone = terrain_of(definition_of(heights.tolist(), "pixel"))
            here, there = terrain.height(x + moved, y), alone.height(x, y)
            assert np.allclose(here, there, rtol=0, atol=1e-9, equal_nan=True)


@settings(max_examples=examples(40))
@given(st.data())
def test_terrains_of_files_are_those_of_rows(data: st.DataObject) -> None:
    """Whatever stands on them, turned, scaled, painted and asked point by point."""
    definition = data.draw(definitions(gridded=True, free=data.draw(st.booleans())))
    grids = {
        name: primitive
        for name, primitive in definition["elemTypes"].items()
        if "grid" in primitive
    }
    folder = Path(os.environ["XDG_CACHE_HOME"]).parent
    filed = json.loads(json.dumps(definition))
    for number, (name, primitive) in enumerate(grids.items()):
        kind = data.draw(st.sampled_from(["float64", "float64", "float32"]))
        heights = np.array(primitive["grid"], np.float64).astype(kind)
        definition["elemTypes"][name]["grid"] = rows_of(heights.astype(np.float64))
        geotiff(folder / f"{number}.tif", heights)
        filed["elemTypes"][name]["grid"] = {"file": f"{number}.tif"}
        filed["elemTypes"][name].setdefault("registration", "gridline")
    checked = check(Source(str(folder / "t.json"), text_of(filed).encode()))
    rows, files = terrain_of(definition), Terrain(checked)
    x, y = np.array(landmarks(definition)[:80] + rims(definition)).T
    assert np.array_equal(rows.height(x, y), files.height(x, y), equal_nan=True)
    wanted, found = rows.sample(x, y), files.sample(x, y)
    for bound in (largest_heights, nonzero_edges):
        assert np.array_equal(bound(rows.arrays), bound(files.arrays))
    assert np.array_equal(wanted.element, found.element)
    assert np.array_equal(wanted.normal, found.normal, equal_nan=True)
