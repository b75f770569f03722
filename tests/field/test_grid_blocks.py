"""Rasters that are read by blocks: the answers of whole ones, from what was asked for."""

from __future__ import annotations

import gc
import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from terratool.errors import ReadError, RequestError
from terratool.field.coarse import coarse
from terratool.field.rays import cast
from terratool.field.summary import height_range, summarise
from terratool.field.terrain import Terrain, load
from terratool.io import grid_blocks, grid_files
from terratool.mesh.build import build
from terratool.raster.grid import grid_over
from terratool.raster.painter import Painter
from tests.rasters import geotiff

SHAPE = (300, 520)
"""Rows and columns; blocks of the tests have 64 × 64."""


@pytest.fixture(autouse=True)
def small_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks so small that there are many; a cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(grid_blocks, "_PIXELS", 12)


def heights() -> np.ndarray:
    """Waves that no mirror or turn leaves as they are, with void pixels."""
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    found = np.sin(column / 30) * np.cos(row / 17) + row / 100 + column / 900
    found[200:230, 300:333] = np.nan
    return np.asarray(found, np.float32)


def site(folder: Path, values: np.ndarray | None = None, **options: Any) -> Path:
    """A definition with a raster that is turned by a half, and another beside it."""
    tiles = {"tiled": True, "blockxsize": 64, "blockysize": 64, "compress": "zstd"}
    geotiff(folder / "dem.tif", heights() if values is None else values, **tiles | options)
    child = {"type": "dem", "at": [70, 30], "extent": [50, 30], "turnDeg": 180, "vScale": 2}
    root = {"type": "dem", "vScale": 1, "children": [child]}
    definition = {"size": [104, 60], "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}}}
    (folder / "site.json").write_text(json.dumps(definition | {"elemTree": root}))
    return folder / "site.json"


def by_blocks(path: Path, monkeypatch: pytest.MonkeyPatch) -> Terrain:
    """The terrain, whose raster is too large to be unpacked."""
    with monkeypatch.context() as patched:
        patched.setattr(grid_files, "MOST_UNPACKED", 10_000)
        patched.setenv("XDG_CACHE_HOME", str(path.parent / "none"))
        terrain = load(path)
    assert not terrain.arrays.curves.mapped.is_whole(0)
    return terrain


def blocks_of(terrain: Terrain) -> Any:
    return terrain.arrays.curves.mapped._grids[0].blocks


def test_points_pixels_and_meshes_are_those_of_the_whole_raster(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = site(tmp_path)
    whole = load(path)
    x, y = np.random.default_rng(3).uniform((0, 0), (104, 60), (5000, 2)).T
    wanted, found = (terrain.sample(x, y) for terrain in (whole, by_blocks(path, monkeypatch)))
    assert np.isnan(wanted.height).any()
    assert np.array_equal(found.height, wanted.height, equal_nan=True)
    assert np.array_equal(found.normal, wanted.normal, equal_nan=True)
    grid = grid_over(whole, 0.3)
    painted = [
        Painter(one, grid, slopes=True).paint(grid.whole)
        for one in (whole, by_blocks(path, monkeypatch))
    ]
    for one, other in zip(*painted, strict=True):
        assert one is None or np.array_equal(one, other, equal_nan=True)
    terrain = by_blocks(path, monkeypatch)
    built = build(terrain, 0.05, (2, 3, 25, 12))
    assert blocks_of(terrain)._loaded <= {9 * row + column for row in (3, 4) for column in range(3)}
    x, y, z = (built.mesh.vertices + built.mesh.origin).T
    assert built.error <= 0.05 and len(x) > 100
    assert np.allclose(z, whole.height(x, y), rtol=0, atol=1e-4)


def test_a_point_reads_the_blocks_around_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here of the root alone; a second point beside it reads nothing more."""
    terrain = by_blocks(site(tmp_path), monkeypatch)
    blocks = blocks_of(terrain)
    assert blocks.count == 5 * 9 and not blocks._loaded
    terrain.height(104 * 100.5 / 520, 60 * 10.5 / 300)  # column 100 and row 289 from the north
    assert blocks._loaded == {4 * 9 + 1}
    terrain.height(104 * 101.5 / 520, 60 * 11.5 / 300)
    assert blocks._loaded == {4 * 9 + 1}


def test_threads_may_ask_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = site(tmp_path)
    x, y = np.random.default_rng(5).uniform((0, 0), (104, 60), (8, 2000, 2)).transpose(2, 0, 1)
    terrain = by_blocks(path, monkeypatch)
    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(terrain.height, x, y))
    assert np.array_equal(found, load(path).height(x, y), equal_nan=True)


def test_a_pickle_reads_by_blocks_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = by_blocks(site(tmp_path), monkeypatch)
    monkeypatch.setattr(grid_files, "MOST_UNPACKED", 10_000)
    other = pickle.loads(pickle.dumps(terrain))
    assert other.height(30.3, 20.2) == terrain.height(30.3, 20.2)
    assert blocks_of(other).count == 45 and len(blocks_of(other)._loaded) == 1


@pytest.mark.parametrize("place", [(30.3, 20.2), ([1.1, 88.8], [2.2, 55.5])], ids=str)
def test_a_raster_that_changes_meanwhile_is_refused(
    place: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the thread that asks, from within the kernel; answers of two states are never mixed."""
    terrain = by_blocks(site(tmp_path), monkeypatch)
    terrain.height(50, 50)
    site(tmp_path, heights() + 1)
    with pytest.raises(ReadError, match=r"dem\.tif: has changed since its header was read"):
        terrain.height(*place)


def test_blocks_take_a_share_of_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And give it back with their terrain, whoever collects that."""
    terrain = by_blocks(site(tmp_path), monkeypatch)
    terrain.height(30.3, 20.2)
    taken = grid_blocks.GridBlocks._taken
    monkeypatch.setattr(grid_blocks, "memory_bytes", lambda: 2 * taken + 6 * 64 * 64 * 4)
    terrain.height(50, 55)
    with pytest.raises(ReadError, match="than memory holds") as caught:
        terrain.height(np.linspace(0, 104, 300), np.linspace(0, 60, 300))
    assert "Ask for a part" in caught.value.hint
    before = set(blocks_of(terrain)._loaded)
    with pytest.raises(ReadError, match="than memory holds"):
        terrain.arrays.curves.mapped.numbers(0)
    assert blocks_of(terrain)._loaded == before, "what does not fit is not begun"
    terrain.height(50, 55)  # is still there
    del terrain, caught
    gc.collect()
    other = by_blocks(site(tmp_path), monkeypatch)
    other.height(np.linspace(0, 104, 300)[:3], np.full(3, 1.0))
    assert grid_blocks.GridBlocks._taken < taken


def test_a_terrain_may_be_collected_while_a_block_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the garbage collector, in the very thread that reads."""
    path = site(tmp_path)
    gone, terrain = by_blocks(path, monkeypatch), by_blocks(path, monkeypatch)
    gone.height(1, 1)
    blocks = blocks_of(terrain)
    reads = blocks._read
    holders: list[Any] = [gone]
    holders.append(holders)  # which only the collector frees
    del gone

    def read(*window: int) -> Any:
        holders.clear()
        gc.collect()
        return reads(*window)

    blocks._read = read
    assert terrain.height(50, 55) == load(path).height(50, 55)


def test_heights_that_are_too_large_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Floats say nothing of their range, which the finding of walls goes by."""
    values = heights()
    values[100, 100] = 3e7
    terrain = by_blocks(site(tmp_path, values), monkeypatch)
    terrain.height(80, 40)
    with pytest.raises(ReadError, match="heights beyond 10,000,000"):
        terrain.height(104 * 100.5 / 520, 60 * 199.5 / 300)


def test_one_large_block_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = site(tmp_path, tiled=False, blockysize=300)
    with pytest.raises(ReadError, match="520 × 300 pixels in one block"):
        by_blocks(path, monkeypatch)


def test_strips_are_read_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = site(tmp_path, tiled=False, blockysize=5)
    terrain = by_blocks(path, monkeypatch)
    assert (blocks_of(terrain).across, blocks_of(terrain).count) == (1, 38)  # of 8 rows
    x, y = np.random.default_rng(3).uniform((0, 0), (104, 60), (500, 2)).T
    assert np.array_equal(terrain.height(x, y), load(path).height(x, y), equal_nan=True)


def test_overviews_are_seen_where_all_is_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their heights are averages; a small part is looked at as it is."""
    path = site(tmp_path)
    with rasterio.open(tmp_path / "dem.tif", "r+") as file:
        file.build_overviews([2, 4], rasterio.enums.Resampling.average)
    monkeypatch.setattr("terratool.field.coarse.MOST_NUMBERS", 20_000)
    monkeypatch.setattr("terratool.field.coarse._OVERVIEW", 20_000)
    terrain = by_blocks(path, monkeypatch)
    seen, notes = coarse(terrain)
    assert notes == ("dem.tif is seen by its overview of 130 × 75 pixels.",)
    x, y = 104 * (np.arange(130) + 0.5) / 130, np.full(130, 60 * 10.5 / 75)
    row = heights()[4 * 64 : 4 * 65].reshape(4, 130, 4).mean(axis=(0, 2))
    assert np.allclose(seen.height(x, y)[:50], row[:50], atol=1e-6)
    assert not blocks_of(terrain)._loaded
    assert coarse(terrain, (0, 0, 20, 20)) == (terrain, ())
    height = summarise(terrain).height
    assert height.low == pytest.approx(-0.66, abs=0.2) and height.notes == notes


def test_what_cannot_be_looked_at_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terratool.field.coarse.MOST_NUMBERS", 20_000)
    terrain = by_blocks(site(tmp_path), monkeypatch)
    height = summarise(terrain).height
    assert (height.low, height.high, height.points) == (None, None, 0)
    assert "no overview" in height.notes[0]
    with pytest.raises(RequestError, match=r"Meshes need all 520 × 300 pixels of .*dem\.tif"):
        build(terrain, 0.1)
    assert not blocks_of(terrain)._loaded
    with pytest.raises(RequestError, match=r"Rays need all 520 × 300 pixels of .*dem\.tif"):
        cast(terrain, [[1, 1, 5]], [[0, 0, -1]])


def test_classes_are_not_seen_by_overviews(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mean of two classes is a third one; here there is no ground where that is."""
    classes = np.ones((64, 96), np.uint8)
    classes[:, ::2] = 3
    geotiff(tmp_path / "classes.tif", classes, tiled=True, blockxsize=16, blockysize=16)
    with rasterio.open(tmp_path / "classes.tif", "r+") as file:
        file.build_overviews([2, 4], rasterio.enums.Resampling.average)
    names = {"1": "rock", "2": "hole", "3": "rock"}
    root = {"type": "b", "surfaceGrid": {"file": "classes.tif", "names": names}}
    surfaces = {"rock": {"descr": "hard"}, "hole": {"void": True}}
    definition = {"size": [9, 6], "surfTypes": surfaces, "elemTypes": {"b": {"x": [1]}}}
    (tmp_path / "site.json").write_text(json.dumps(definition | {"elemTree": root}))
    monkeypatch.setattr("terratool.field.coarse.MOST_NUMBERS", 100)
    monkeypatch.setattr(grid_files, "MOST_UNPACKED", 1000)
    terrain = load(tmp_path / "site.json")
    assert not terrain.arrays.curves.mapped.is_whole(0)
    height = summarise(terrain).height
    assert (height.low, height.high, height.notes) == (1, 1, ())


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_an_overview_needs_no_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a grid does not, whose raster may lie nowhere."""
    path = site(tmp_path)
    options = {"driver": "GTiff", "width": SHAPE[1], "height": SHAPE[0], "count": 1}
    with rasterio.open(
        tmp_path / "dem.tif", "w", dtype="float32", tiled=True, blockxsize=64, blockysize=64,
        **options,
    ) as file:  # fmt: skip
        file.write(heights(), 1)
    with rasterio.open(tmp_path / "dem.tif", "r+") as file:
        file.build_overviews([2], rasterio.enums.Resampling.average)
    monkeypatch.setattr("terratool.field.coarse.MOST_NUMBERS", 1000)
    seen, notes = coarse(by_blocks(path, monkeypatch))
    assert len(notes) == 1 and not np.isnan(seen.height(1, 1))


def test_a_small_part_is_looked_at_by_its_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the raster lies counts, not how large the terrain is."""
    path = site(tmp_path)
    definition = json.loads(path.read_text())
    flat = {"type": "flat", "children": [{"type": "dem", "at": [700, 500], "extent": [104, 60]}]}
    definition |= {"size": [1000, 1000], "elemTree": flat}
    definition["elemTypes"]["flat"] = {"x": [0]}
    path.write_text(json.dumps(definition))
    monkeypatch.setattr("terratool.field.coarse.MOST_NUMBERS", 20_000)
    terrain = by_blocks(path, monkeypatch)
    assert height_range(terrain, (640, 460, 760, 540)) == (None, None, 0)
    low, high, points = height_range(terrain, (650, 472, 658, 478))
    assert points and low is not None and high is not None and low < high
    assert len(blocks_of(terrain)._loaded) <= 4
