"""Rasters of decks and bores against the columns at the centres of pixels."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.raster.dem import DemOptions, GridChoice, dem_arrays, write_dem
from terratool.raster.export import RasterRequest
from terratool.raster.grid import Grid, grid_over
from terratool.raster.loss import LossCounts, LossFinder
from terratool.raster.painter import COLUMN_BANDS, HiddenPixels, Painter, Planes, most_tops
from terratool.raster.windows import WindowMaker
from tests.budget import examples
from tests.commands import call
from tests.conftest import terrain_of
from tests.storey_examples import DEFINITIONS
from tests.storey_trees import lattices, with_storeys
from tests.strategies import definitions

LAYERS = ("height", "surface", "normal", "ground", "clearance", "storeys", "columns")
BRIDGE = DEFINITIONS["bridge"]


def wanted(terrain: Terrain, grid: Grid) -> dict[str, NDArray[Any]]:
    """Bands of all layers by the columns at the centres of the pixels."""
    x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    column, top = terrain.column(x, y), terrain.sample(x, y)
    some = ~np.isnan(column.top)
    grounded = some[..., 0] & np.isneginf(column.bottom[..., 0])
    count = some.sum(axis=-1)
    found = {
        "height": top.height,
        "surface": top.surface + 1,
        "normal x": top.normal[..., 0],
        "normal y": top.normal[..., 1],
        "normal z": top.normal[..., 2],
        "ground": np.where(grounded, column.top[..., 0], np.nan),
        "clearance": np.where(grounded & (count > 1), column.clear[..., 0], np.nan),
        "storeys": count,
    }
    for k in range(int(count.max(initial=1))):
        found[f"top-{k + 1}"] = column.top[..., k]
        if k:
            found[f"bottom-{k + 1}"] = column.bottom[..., k]
    return found


def bands_of(terrain: Terrain, grid: Grid, dtype: str = "float32") -> dict[str, NDArray[Any]]:
    choice = GridChoice(grid, "", (0.0, 0.0))
    return dict(dem_arrays(terrain, choice, RasterRequest(LAYERS, dtype, threads=1)).bands)


def assert_columns(terrain: Terrain, grid: Grid) -> None:
    """Each band as the columns have it, rounded once; slopes also by their own rounding."""
    found, right = bands_of(terrain, grid), wanted(terrain, grid)
    assert set(found) == set(right)
    alone, kept = (
        Painter(terrain, grid, slopes=True, storeys=n).paint(grid.whole) for n in (0, COLUMN_BANDS)
    )
    for name in ("heights", "surfaces", "slope_x", "slope_y"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(kept, name), name)
    for name, band in found.items():
        if name.startswith("normal"):
            np.testing.assert_allclose(band, right[name], atol=2e-6, err_msg=name)
        else:
            off = np.argwhere(band != right[name].astype(band.dtype))
            off = [at for at in off if not (np.isnan(band[*at]) and np.isnan(right[name][*at]))]
            assert not off, (name, off[0], band[*off[0]], right[name][*off[0]])


def test_a_deck_stands_over_a_grid_without_data() -> None:
    """A slab over a gap of a grid is there, and the gap stays open beside it."""
    gap = [[1, 1, 1, 1], [1, None, 1, 1], [1, 1, 1, 1]]
    slab = {"type": "flat", "at": [3, 3], "extent": [4, 2], "vScale": 5}
    terrain = terrain_of(
        {
            "size": [8, 6],
            "elemTypes": {"flat": {"x": [1]}, "gap": {"grid": gap, "registration": "pixel"}},
            "elemTree": {
                "type": "flat",
                "vScale": 0,
                "cells": 1,
                "children": [
                    {"type": "gap", "cellX": 0, "cellY": 0},
                    {**slab, "deck": {"thickness": 0.5}},
                ],
            },
        }
    )
    assert np.isnan(terrain.ground(3.0, 3.5)) and terrain.height(3.0, 3.5) == 5.0
    assert_columns(terrain, grid_over(terrain, 0.25))


@pytest.mark.parametrize("name", DEFINITIONS)
def test_pixels_are_columns(name: str) -> None:
    terrain = terrain_of(DEFINITIONS[name])
    west, south, east, _ = terrain.bounds
    # centres on edges of storeys, and elsewhere
    for resolution in (0.25, (east - west) / 77):
        grid = Grid(west - 0.125, south - 0.125, resolution, 83, 91)
        assert_columns(terrain, grid)


@pytest.mark.slow
@given(definition=lattices())
@settings(max_examples=examples(25), deadline=None)
def test_pixels_where_faces_often_meet(definition: Any) -> None:
    terrain = terrain_of(definition)
    west, south, _, _ = terrain.bounds
    assert_columns(terrain, Grid(west - 0.0625, south - 0.0625, 0.125, 133, 135))


@given(definition=with_storeys(definitions()))
@settings(max_examples=examples(25), deadline=None)
def test_pixels_of_random_storeys(definition: Any) -> None:
    """By numbers that are doubles, as the ground of pixels is only as exact as rounding is."""
    terrain = terrain_of(definition)
    west, south, east, north = terrain.bounds
    side = max(east - west, north - south) / 40
    grid = grid_over(terrain, side)
    found, right = bands_of(terrain, grid, "float64"), wanted(terrain, grid)
    scale = 1e-12 * max(1.0, float(np.nanmax(np.abs(right["height"]), initial=0.0)))
    assert np.array_equal(found["storeys"], right["storeys"])
    assert np.array_equal(found["surface"], right["surface"])
    for name in set(right) - {"normal x", "normal y", "normal z"}:
        np.testing.assert_allclose(found[name], right[name], rtol=0, atol=scale, err_msg=name)


def test_windows_are_parts_of_the_whole() -> None:
    """Odd windows of all planes, and the whole in one, on a grid that is larger than a tile."""
    terrain = terrain_of(BRIDGE)
    grid = Grid(-1.0, -1.0, 0.03, 733, 1401)
    bands = COLUMN_BANDS + 2 * most_tops(terrain, grid) - 1
    painter = Painter(terrain, grid, slopes=True, labels=True, storeys=bands)
    whole = painter.paint(grid.whole)
    for window in grid.windows(257, 611):
        part = painter.paint(window)
        for name, one, all_ in zip(Planes._fields, part, whole, strict=True):
            rows = slice(window.row, window.row + window.height)
            columns = slice(window.column, window.column + window.width)
            assert np.array_equal(one, all_[..., rows, columns], equal_nan=one.dtype.kind == "f"), (
                name
            )
    heights = Painter(terrain, grid, surfaces=False, storeys=0).paint(grid.whole).heights
    assert np.array_equal(heights, whole.heights, equal_nan=True)  # also without the other planes


def test_ground_alone_is_that_without_storeys() -> None:
    terrain = terrain_of(BRIDGE)
    grid = Grid(0.0, 0.0, 0.25, 80, 160)
    x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    alone = Painter(terrain, grid).paint(grid.whole).heights
    assert np.array_equal(alone, terrain.ground_alone.height(x, y).astype(np.float32))


def test_tops_have_their_roughness_and_ruts() -> None:
    """A track on a deck and one below it, on rough ground and a rough deck."""
    rough = {"rms": 0.02, "correlation": 0.5}
    soil = {"cohesion": 1, "fricAngle": 30, "sinkage": 0.05}
    flat = {"type": "flat", "vScale": 0, "x-ignore": ["TT210"]}
    definition = {
        "size": [20, 10],
        "surfTypes": {"sand": {**soil, "roughness": rough}, "road": {**soil, "roughness": rough}},
        "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {
            **flat, "surface": "sand", "children": [
                {**flat, "at": [10, 5], "extent": [8, 6], "vOffset": 3, "surface": "road",
                 "deck": {"thickness": 0.5}},
            ],
        },
        "tracks": [
            {"path": [[1, 5], [19, 5]], "width": 1, "load": 2, "passes": 1},
            {"path": [[1, 6.5, 3], [19, 6.5, 3]], "width": 1, "load": 2, "passes": 1},
        ],
    }  # fmt: skip
    terrain = terrain_of(definition)
    grid = Grid(0.0, 0.0, 0.1, 100, 200)
    assert_columns(terrain, grid)
    flat_deck = terrain_of({**definition, "tracks": []}, roughness=False)
    found, smooth = bands_of(terrain, grid), bands_of(flat_deck, grid)
    under = (slice(35, 65), slice(70, 130))
    assert not np.array_equal(found["ground"][under], smooth["ground"][under])
    assert not np.array_equal(found["height"][under], smooth["height"][under])
    assert np.array_equal(found["bottom-2"][under], smooth["bottom-2"][under])
    # the path without heights lies below the deck, the other one on it
    assert (smooth["ground"] - found["ground"])[50, 100] > 0.02
    assert (smooth["height"] - found["height"])[35, 100] > 0.02


def test_the_statement_counts_what_is_hidden() -> None:
    """By hand: the slab is 24 × 4, but the ground is as high within 2 m of either end."""
    terrain = terrain_of(BRIDGE)
    grid = Grid(0.0, 0.0, 0.25, 80, 160)
    x, y = np.meshgrid(grid.columns(grid.whole), grid.rows(grid.whole))
    clear = terrain.column(x, y).clear
    below = np.where(np.isfinite(clear), clear, np.inf)
    total = LossCounts()
    maker = WindowMaker(terrain, grid, RasterRequest().files(terrain, grid), losses=True)
    for window in grid.windows(33, 47):
        made = maker.make(window)
        total += made.statistics.lost
        maker.reuse(made)
    assert maker.losses is not None
    hidden = maker.losses.statement(total, 0).hidden
    assert not isinstance(hidden, type(None))
    assert hidden.area == np.isfinite(below).any(axis=-1).sum() / 16
    assert hidden.most == 2
    assert hidden.clearance == below.min()
    assert hidden.at is not None
    at = terrain.column(*hidden.at).clear
    assert at[0] == below.min()
    assert hidden.unseen.count == 0


def test_storeys_that_no_pixel_shows_are_named() -> None:
    """A tunnel under a hill, a deck in the ground, one between two centres, and one beyond."""
    flat = {"type": "flat", "vScale": 0, "x-ignore": ["TT210"]}
    deck = {"deck": {"thickness": 0.1, "datum": True}}
    children = [
        {**flat, "at": [4, 4], "extent": [2, 2], "vOffset": 1, "bore": {"height": 1}},
        {**flat, "at": [12, 4], "extent": [2, 2], "vOffset": 1, **deck},
        {**flat, "at": [12, 12], "extent": [2, 0.25], "vOffset": 6, **deck},
        {**flat, "at": [4, 12], "extent": [2, 2], "vOffset": 6, **deck},
        {**flat, "at": [28, 12], "extent": [2, 2], "vOffset": 1, **deck},
    ]
    tree = {**flat, "vOffset": 5, "children": children}
    terrain = terrain_of(
        {"size": [32, 16], "surfTypes": {}, "elemTypes": {"flat": {"x": [1]}}, "elemTree": tree}
    )
    grid = Grid(0.0, 0.0, 1.0, 16, 20)
    finder = LossFinder(terrain, grid, storeys=True)
    assert finder.hidden is not None
    pixels = finder.hidden.pixels((slice(0, 16), slice(0, 20)))
    Painter(terrain, grid, storeys=0).paint(grid.whole, hidden=pixels)
    hidden = finder.hidden.loss(finder.hidden.counts(grid.whole, pixels))
    assert hidden.unseen.first == tuple(f"/elemTree/children/{k}" for k in (0, 1, 2))
    assert hidden.unseen.count == 3


def test_walls_are_those_of_the_highest_tops() -> None:
    """The rim of a turned square of 6 × 6 over level ground, which is 24 m long."""
    flat = {"type": "flat", "vScale": 0, "x-ignore": ["TT210"]}
    deck = {"at": [10.1, 8.2], "extent": [6, 6], "turnDeg": 33, "vOffset": 2,
            "deck": {"thickness": 0.5}}  # fmt: skip
    terrain = terrain_of(
        {
            "size": [20, 16], "surfTypes": {}, "elemTypes": {"flat": {"x": [1]}},
            "elemTree": {**flat, "children": [{**flat, **deck}]},
        }
    )  # fmt: skip
    grid = Grid(0.0, 0.0, 0.125, 128, 160)
    finder = LossFinder(terrain, grid, storeys=True)
    painter = Painter(terrain, grid, labels=True, storeys=0)
    lost = finder.statement(finder.of(grid.whole, painter.paint(grid.whole)), 0)
    assert lost.walls.length == pytest.approx(24, rel=0.02)
    assert lost.walls.largest_jump is not None
    assert lost.walls.largest_jump.height == pytest.approx(2)
    below = LossFinder(terrain, grid)
    alone = Painter(terrain, grid, labels=True).paint(grid.whole)
    assert below.statement(below.of(grid.whole, alone), 0).walls.pairs == 0


@pytest.mark.parametrize("end", ["tif", "npy", "img"])
def test_files_of_all_columns(end: str, tmp_path: Path) -> None:
    terrain = terrain_of(BRIDGE)
    grid = Grid(0.0, 0.0, 0.25, 80, 160)
    options = DemOptions(layers=("height", "columns", "clearance"), resolution=0.25)
    path = tmp_path / f"bridge.{end}"
    write_dem(terrain, GridChoice.of(terrain, 0.25), path, options)
    right = wanted(terrain, grid)
    names = ["height", "top-1", "bottom-2", "top-2", "clearance"]
    if end == "npy":
        found = np.load(path)
    else:
        with rasterio.open(path) as file:
            found = file.read()
            if end == "tif":
                assert list(file.descriptions) == names
    assert np.array_equal(found, np.stack([right[n] for n in names]).astype("f4"), equal_nan=True)


def test_tiles_and_threads_are_the_whole(tmp_path: Path) -> None:
    terrain = terrain_of(BRIDGE)
    choice = GridChoice.of(terrain, 0.05)
    layers = "height", "ground", "storeys", "columns"
    whole, tiles = tmp_path / "whole.tif", tmp_path / "tiles"
    one = write_dem(terrain, choice, whole, DemOptions(layers=layers, threads=1))
    options = DemOptions(layers=layers, tiles=tiles, tile_size=512, threads=2)
    other = write_dem(terrain, choice, tiles / "mosaic.vrt", options)
    with rasterio.open(whole) as a, rasterio.open(tiles / "mosaic.vrt") as b:
        assert np.array_equal(a.read(), b.read(), equal_nan=True)
    assert one.losses.hidden == other.losses.hidden  # type: ignore[union-attr]


def test_contours_run_along_decks(tmp_path: Path) -> None:
    """At a height between ground and deck a contour is the rim of the deck."""
    flat = {"type": "flat", "vScale": 0, "x-ignore": ["TT210"]}
    deck = {"at": [9, 7], "extent": [6, 4], "vOffset": 2, "deck": {"thickness": 0.5}}
    definition = {
        "size": [20, 16], "surfTypes": {}, "elemTypes": {"flat": {"x": [1]}},
        "elemTree": {**flat, "children": [{**flat, **deck}]},
    }  # fmt: skip
    path = tmp_path / "rim.geojson"
    terrain = terrain_of(definition)
    options = DemOptions(layers=("contours",), resolution=0.25, interval=1.5)
    write_dem(terrain, GridChoice.of(terrain, 0.25), path, options)
    lines = [
        np.array(f["geometry"]["coordinates"]) for f in json.loads(path.read_text())["features"]
    ]
    ends = np.concatenate(lines)
    np.testing.assert_allclose(ends.min(axis=0), [6, 5], atol=1e-6)
    np.testing.assert_allclose(ends.max(axis=0), [12, 9], atol=1e-6)


def test_terrains_without_storeys_have_the_layers(tmp_path: Path) -> None:
    sample = Path(__file__).parents[2] / "samples" / "nested-site.json"
    path = tmp_path / "site.tif"
    layers = [f"--layer={name}" for name in ("height", "ground", "clearance", "storeys", "columns")]
    said = call("export-dem", sample, path, "--resolution=2", "--json", *layers)
    assert "hidden" not in json.loads(said.out)["losses"]
    with rasterio.open(path) as file:
        height, ground, clearance, storeys, top = file.read()
        assert file.descriptions[-1] == "top-1"
    assert np.array_equal(height, ground, equal_nan=True)
    assert np.array_equal(height, top, equal_nan=True)
    assert np.isnan(clearance).all()
    assert np.array_equal(storeys, ~np.isnan(height))


def test_text_says_what_is_hidden(tmp_path: Path) -> None:
    file = tmp_path / "bridge.json"
    file.write_text(json.dumps(BRIDGE))
    arguments = ["export-dem", str(file), str(tmp_path / "out.tif"), "--resolution", "0.25"]
    said = call(*arguments).out
    assert "m² have 2 storeys or more, of which the heights show the highest" in said
    assert "the lowest clearance below is 0." in said


def test_hidden_pixels_of_nothing() -> None:
    terrain = terrain_of(BRIDGE)
    grid = Grid(0.0, 0.0, 0.5, 8, 80)  # the southernmost 4 m, which have none
    hidden = HiddenPixels.of(slice(0, 8), slice(0, 80), 2)
    Painter(terrain, grid, storeys=0).paint(grid.whole, hidden=hidden)
    assert hidden.figures[0] == 0
    assert not hidden.seen.any()
    assert most_tops(terrain, grid) == 1
