"""Maps as files, and what is said of how good they are."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.transform import Affine

from terratool.errors import ReadError, RequestError, WriteError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid
from terratool.sensing.clouds import Cloud
from terratool.sensing.comparison import compare
from terratool.sensing.lines import signed_metres
from terratool.sensing.map_files import BANDS, MapOutput, read_map, write_map
from terratool.sensing.robot_map import MapOptions, RobotMap
from terratool.sensing.sensor import Noise
from terratool.viewing.plan import axis_room
from tests.commands import call
from tests.conftest import terrain_of

Save = Callable[[dict[str, Any]], Path]

# 12 by 6, rising by 0.25 to a metre to the east and by nothing to the north, with a hole in the
# south-east and a slab in the north-west.
RAMP: dict[str, Any] = {
    "size": [12, 6],
    "origin": [-4, 10],
    "surfTypes": {"sand": {}, "slab": {}, "hole": {"void": True}},
    "elemTypes": {"east": {"x": [0, 1], "y": [1]}, "flat": {"x": [1]}},
    "elemTree": {
        "type": "east", "vScale": 3, "surface": "sand", "cells": [12, 6],
        "children": [
            {"cellX": 10, "cellY": 0, "span": [2, 1], "type": "flat", "surface": "hole"},
            {"cellX": 0, "cellY": 4, "span": [3, 2], "type": "flat", "vScale": 1,
             "surface": "slab"},
        ],
    },
}  # fmt: skip
GRID = Grid(-4.0, 10.0, 1.0, 6, 12)


def truth() -> NDArray[np.float64]:
    """Heights at the middles of cells of a metre, rows from the north."""
    heights = np.tile((np.arange(12) + 0.5) * 0.25, (6, 1))
    heights[:2, :3] += 1.0
    heights[5, 10:] = np.nan
    return heights


def of_heights(heights: NDArray[np.float64], **known: Any) -> RobotMap:
    """A map of one reading for each cell that has a height."""
    rows, columns = np.nonzero(np.isfinite(heights))
    points = np.column_stack([columns - 3.5, 15.5 - rows, heights[rows, columns]])
    options = MapOptions(1.0, 1, Noise(sigma=0.1))
    out = RobotMap(GRID, options)
    out.add(Cloud(points, **{name: value[rows, columns] for name, value in known.items()}))
    return out


def saved_map(robot_map: RobotMap, path: Path) -> Path:
    write_map(robot_map, MapOutput(path, robot_map.options.levels, overwrite=True))
    return path


@pytest.fixture(scope="module")
def ramp() -> Terrain:
    return terrain_of(RAMP)


def test_bands_are_named_and_lie_where_they_belong(tmp_path: Path) -> None:
    """By rasterio: names, units, nodata, tags of levels and times; rows run from the north."""
    options = MapOptions(1.0, 2)
    out = RobotMap(GRID, options)
    out.add(
        Cloud(
            np.array([[-3.5, 10.5, 7.0], [7.5, 15.5, 9.0]]),
            time=np.array([3.0, 8.0]),
            surface=np.array([1, -1], np.int32),
            surfaces=("a", "b"),
        )
    )
    files = write_map(out, MapOutput(tmp_path / "m.tif", 2, crs="EPSG:32633"))
    assert [file.name for file in files] == ["m.tif", "m.level-1.tif"]
    with rasterio.open(files[0]) as file:
        assert file.descriptions == (
            "elevation", "variance", "lowest", "highest", "count", "surface", "time", "distance",
            "seen",
        )  # fmt: skip
        assert file.units[:2] == ("m", "m2") and file.crs.to_epsg() == 32633
        assert all(np.isnan(file.nodatavals))
        tags = file.tags()
        assert json.loads(tags["TERRATOOL_MAP_SURFACES"]) == ["a", "b"]
        assert tags["TERRATOOL_MAP_FIRST_TIME"] == "3.0"
        assert tags["TERRATOOL_MAP_LAST_TIME"] == "8.0"
        assert tags["TERRATOOL_MAP_LEVELS"] == "2"
        south_west, north_east = file.sample([(-3.5, 10.5), (7.5, 15.5)])
        assert south_west[[0, 4, 5, 6, 8]].tolist() == [7, 1, 1, 3, 1]
        assert north_east[[0, 5, 6]].tolist() == [9, -1, 8]
        assert np.isfinite(file.read()).any(axis=0).sum() == 2
    with rasterio.open(files[1]) as file:
        assert file.shape == (3, 6) and file.res == (2.0, 2.0)
        assert next(iter(file.sample([(-3.5, 10.5)])))[[0, 8]].tolist() == [7, 0.25]


def test_a_map_is_read_as_it_was_written(tmp_path: Path) -> None:
    """All of it, and the same map is the same bytes."""
    out = of_heights(truth(), range=np.full((6, 12), 4.0))
    path = saved_map(out, tmp_path / "m.tif")
    first = path.read_bytes()
    found, level = read_map(path), out.level(0)
    assert found.is_map and found.level.grid == level.grid
    for name in BANDS.names:
        np.testing.assert_array_equal(getattr(found.level, name), getattr(level, name), name)
    assert saved_map(out, path).read_bytes() == first


def test_an_older_level_does_not_stay(tmp_path: Path) -> None:
    """It would be taken for one of the new map; without --overwrite it is kept, and refused."""
    out = of_heights(truth())
    old = tmp_path / "m.level-3.tif"
    old.write_bytes(b"old")
    with pytest.raises(Exception, match=r"level-3.*exists already"):
        write_map(out, MapOutput(tmp_path / "m.tif", 1))
    write_map(out, MapOutput(tmp_path / "m.tif", 1, overwrite=True))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["m.tif"]


def test_a_bag_has_a_grid_map_of_each_level(tmp_path: Path) -> None:
    """Index 0 is in the north-east of grid_map; ages count from the last reading."""
    from rosbags.highlevel import AnyReader

    out = RobotMap(GRID, MapOptions(1.0, 2))
    points = np.array([[-3.5, 10.5, 7.0], [7.5, 15.5, 9.0]])
    out.add(Cloud(points, time=np.array([1e9, 1e9 + 5.0])))
    write_map(out, MapOutput(tmp_path / "m.tif", 2, tmp_path / "map_bag"))
    with AnyReader([tmp_path / "map_bag"]) as reader:  # by the types in the bag alone
        got = {
            connection.topic: reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
        }
    assert [*got] == ["/grid_map", "/grid_map/level_1"]
    one = got["/grid_map"]
    assert (one.info.resolution, one.info.length_x, one.info.length_y) == (1.0, 12.0, 6.0)
    assert (one.info.pose.position.x, one.info.pose.position.y) == (2.0, 13.0)
    layers = {name: part.data for name, part in zip(one.layers, one.data, strict=True)}
    assert layers["elevation"][0] == 9.0 and layers["elevation"][-1] == 7.0
    assert (layers["age"][0], layers["age"][-1]) == (0.0, 5.0)
    assert np.isfinite(layers["elevation"]).sum() == 2
    assert got["/grid_map/level_1"].info.resolution == 2.0


def test_a_bag_takes_no_place_of_a_file(tmp_path: Path) -> None:
    """Neither that of a level, nor that of a folder that is no bag."""
    for name in ("m.tif", "m.level-1.tif"):
        with pytest.raises(RequestError, match="is to be the map, too"):
            MapOutput(tmp_path / "m.tif", 2, tmp_path / name).check()
    (tmp_path / "kept").mkdir()
    with pytest.raises(WriteError, match="was not written by terratool"):
        MapOutput(tmp_path / "m.tif", 2, tmp_path / "kept", overwrite=True).check()


def test_cells_never_seen_are_void_after_the_import(tmp_path: Path) -> None:
    """The way back by import-terrain: heights where there were readings, void elsewhere."""
    heights = truth()
    heights[3, 4:7] = np.nan
    path = saved_map(of_heights(heights), tmp_path / "m.tif")
    out = tmp_path / "back.json"
    ran = call("import-terrain", path, out, "--band", "1", "--max-error", "0.01")
    assert ran.code == 0, ran.err
    from terratool.field.terrain import load

    back = load(out)
    x, y = np.meshgrid(np.arange(12) - 3.5, 15.5 - np.arange(6))
    np.testing.assert_allclose(back.height(x, y), heights, atol=0.0101)


def test_a_map_of_the_truth_is_without_error(ramp: Terrain, tmp_path: Path) -> None:
    """69 cells of 70 are known; a mirrored or a turned map is far from it."""
    heights = truth()
    heights[0, 11] = np.nan
    got = compare(read_map(saved_map(of_heights(heights), tmp_path / "m.tif")), ramp)
    assert (got.ground, got.known, got.beyond) == (70, 69, 0)
    assert got.coverage == 69 / 70
    assert got.errors.worst < 1e-12 and got.within == 1.0
    for other in (heights[:, ::-1], heights[::-1], heights[::-1, ::-1]):
        wrong = compare(read_map(saved_map(of_heights(other), tmp_path / "m.tif")), ramp)
        assert wrong.errors.rmse > 0.3


def test_a_map_off_by_a_cell_is_off_by_the_slope(ramp: Terrain, tmp_path: Path) -> None:
    """On the ramp each cell is 0.25 too low; at the slab's east side once 1.25 − 0.5 too high."""
    heights = np.tile((np.arange(12) + 0.5) * 0.25, (6, 1)) - 0.25
    heights[:, 0] = np.nan
    heights[:2, :] = np.nan
    heights[4, 7] += 1.0
    got = compare(read_map(saved_map(of_heights(heights), tmp_path / "m.tif")), ramp)
    errors = np.full(42, -0.25)  # 44 cells, of which two are over the hole
    errors[0] += 1.0
    assert (got.known, got.beyond) == (42, 2)
    assert got.errors.rmse == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert got.errors.bias == pytest.approx(errors.mean())
    assert got.worst is not None
    assert (got.worst.x, got.worst.y, got.worst.surface) == (3.5, 11.5, "sand")
    assert got.worst.mapped - got.worst.true == pytest.approx(0.75)
    assert got.within == 0.0  # 0.25 is more than 2 · 0.1


def test_figures_by_surface_and_by_distance(ramp: Terrain, tmp_path: Path) -> None:
    """The slab is 0.5 too high and seen from 12 m, the rest exact and seen from 3 m."""
    heights, ranges = truth(), np.full((6, 12), 3.0)
    heights[:2, :3] += 0.5
    ranges[:2, :3] = 12.0
    surface = np.zeros((6, 12), np.int32)
    surface[0, :3] = 1
    rows, columns = np.nonzero(np.isfinite(heights))
    points = np.column_stack([columns - 3.5, 15.5 - rows, heights[rows, columns]])
    out = RobotMap(GRID, MapOptions(1.0, 1))
    out.add(
        Cloud(
            points, range=ranges[rows, columns], surface=surface[rows, columns],
            surfaces=("sand", "slab"),
        )
    )  # fmt: skip
    got = compare(read_map(saved_map(out, tmp_path / "m.tif")), ramp)
    by_name = {one.name: one for one in got.surfaces}
    assert {*by_name} == {"sand", "slab"}
    slab, sand = by_name["slab"], by_name["sand"]
    assert (slab.ground, slab.errors.cells, slab.named, slab.right) == (6, 6, 6, 3)
    assert (sand.ground, sand.errors.cells, sand.named, sand.right) == (64, 64, 64, 64)
    assert slab.errors.rmse == pytest.approx(0.5) and slab.errors.bias == pytest.approx(0.5)
    assert sand.errors.worst < 1e-12
    near, far = got.distances
    assert (near.low, near.high, near.errors.cells) == (0.0, 5.0, 64)
    assert (far.low, far.high, far.errors.cells) == (10.0, 20.0, 6)
    assert far.errors.bias == pytest.approx(0.5)


def test_coarse_levels_are_held_against_means(ramp: Terrain, tmp_path: Path) -> None:
    """Cells of 2 m of an exact map are without error, those by the wall and the hole, too."""
    options = MapOptions(1.0, 2)
    out = RobotMap(GRID, options)
    rows, columns = np.nonzero(np.isfinite(truth()))
    out.add(Cloud(np.column_stack([columns - 3.5, 15.5 - rows, truth()[rows, columns]])))
    write_map(out, MapOutput(tmp_path / "m.tif", 2))
    got = compare(read_map(tmp_path / "m.level-1.tif"), ramp)
    assert (got.ground, got.known) == (18, 18)
    assert got.errors.worst < 1e-12


def test_any_raster_of_heights_can_be_compared(ramp: Terrain, tmp_path: Path) -> None:
    """Also one that covers a part, and reaches beyond; of what is not over it nothing is known."""
    heights = truth()[:, :4].astype(np.float32)
    profile = {
        "driver": "GTiff", "dtype": "float32", "count": 1, "height": 6, "width": 4,
        "transform": Affine(1.0, 0.0, -4.0, 0.0, -1.0, 16.0),
    }  # fmt: skip
    with rasterio.open(tmp_path / "dem.tif", "w", **profile) as file:
        file.write(heights, 1)
    found = read_map(tmp_path / "dem.tif")
    got = compare(found, ramp)
    assert not found.is_map
    assert (got.ground, got.known, got.distances) == (70, 24, ())
    assert got.errors.worst < 1e-6
    with rasterio.open(tmp_path / "far.tif", "w", **profile | {
        "transform": Affine(1.0, 0.0, 400.0, 0.0, -1.0, 16.0),
    }) as file:  # fmt: skip
        file.write(heights, 1)
    with pytest.raises(RequestError, match=r"miss .*far\.tif"):
        compare(read_map(tmp_path / "far.tif"), ramp)


@pytest.mark.parametrize(
    ("ground", "error", "words"),
    [
        (1730.0, 0.0625, "1730.062 m in place of 1730 m"),
        (1730.0, -4.0, "1726 m in place of 1730 m"),
        (2.0, 0.25, "2.25 m in place of 2 m"),
        (1730.0, 0.0, "1730 m in place of 1730 m"),
    ],
)
def test_the_worst_place_shows_its_error(
    ground: float, error: float, words: str, tmp_path: Path
) -> None:
    """On level ground of 4 × 3 far from zero, one pixel is off; its place has all digits."""
    value = {
        "size": [4, 3], "origin": [575054, 4429710], "elemTypes": {"level": {"x": [1]}},
        "elemTree": {"type": "level", "vScale": ground},
    }  # fmt: skip
    terrain = tmp_path / "site.json"
    terrain.write_text(json.dumps(value), encoding="utf-8")
    heights = np.full((3, 4), ground, np.float32)
    heights[0, 2] += error
    with rasterio.open(
        tmp_path / "dem.tif", "w", driver="GTiff", dtype="float32", count=1, height=3, width=4,
        transform=Affine(1.0, 0.0, 575054.0, 0.0, -1.0, 4429713.0),
    ) as file:  # fmt: skip
        file.write(heights, 1)
    said = call("compare", tmp_path / "dem.tif", terrain).out
    assert f": {words}." in said
    if error:
        assert f"Worst at 575056.5 4429712.5: {words}." in said


@pytest.mark.slow
def test_walls_do_not_take_all_colours(saved: Save, tmp_path: Path) -> None:
    """A column of 6 cells of 70 is off by 2 m, and the others, 2 cm too high, are red all the same;
    where all is right, rounding is not drawn."""
    heights, picture = truth() + 0.02, tmp_path / "errors.png"
    heights[:, 4] += 2.0
    path, site = tmp_path / "m.tif", saved(RAMP)
    from PIL import Image

    def redness() -> float:
        assert call("compare", path, site, "--picture", picture, "--overwrite").code == 0
        pixels = np.asarray(Image.open(picture).convert("RGB")).astype(float)
        middle = pixels[pixels.shape[0] // 3, pixels.shape[1] // 2 : pixels.shape[1] * 2 // 3]
        return float((middle[:, 0] - middle[:, 2]).mean())

    saved_map(of_heights(heights), path)
    assert redness() > 60
    saved_map(of_heights(truth() + 1e-12), path)
    assert redness() < 20


def test_errors_stand_where_they_are(saved: Save, tmp_path: Path) -> None:
    """One cell is too high, in the north-east, and ringed: neither mirrored nor turned."""
    heights, picture = truth(), tmp_path / "errors.png"
    row, column = np.argwhere(np.isfinite(heights[:2, 8:]))[0] + [0, 8]
    heights[row, column] += 0.5
    saved_map(of_heights(heights), tmp_path / "m.tif")
    assert call("compare", tmp_path / "m.tif", saved(RAMP), "--picture", picture).code == 0
    from PIL import Image

    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    tall, wide = pixels.shape[:2]
    left = round(axis_room(10, 16) * 150 / 72)
    west, east, north, south = left, wide - 255, 55, tall - 159  # the margins, at 150 to an inch
    x = west + (column + 0.5) / 12 * (east - west)
    y = north + (row + 0.5) / 6 * (south - north)
    red = np.argwhere(pixels[north:south, west:east] @ [1, 0, -1] > 60) + np.array([north, west])
    assert np.abs(np.median(red, axis=0) - [y, x]).max() < 5
    black = np.argwhere(pixels.max(axis=2) < 60)
    far = np.hypot(*(black - [y, x]).T)
    assert (far < 16).sum() > 40  # the ring


def test_no_bias_has_no_minus() -> None:
    assert (signed_metres(-1e-9), signed_metres(-0.00126)) == ("+0.0000 m", "-0.0013 m")


def test_commands_end_to_end(saved: Save, tmp_path: Path) -> None:
    """From a CSV to a map, to its figures and the exit code, and a picture of the errors."""
    site, scan, out = saved(RAMP), tmp_path / "scan.csv", tmp_path / "m.tif"
    rows, columns = np.nonzero(np.isfinite(truth()))
    lines = [
        f"{c - 3.5},{15.5 - r},{truth()[r, c] + 0.5 * (c == 0)}"
        for r, c in zip(rows, columns, strict=True)
    ]
    scan.write_text("\n".join(["x,y,z", *lines]), "utf-8")
    bounds = ("--bounds", -4, 10, 8, 16)
    ran = call("map", scan, "--resolution", 1, "--levels", 2, "--output", out, *bounds, "--json")
    said = json.loads(ran.out)
    assert (said["points"], said["seen"], said["columns"], said["rows"]) == (70, 70, 12, 6)
    assert call("map", scan, "--resolution", 1, "--output", out).code == 3
    picture = tmp_path / "errors.png"
    ran = call("compare", out, site, "--json", "--picture", picture)
    figures = json.loads(ran.out)
    assert ran.code == 0 and figures["coverage"] == 1.0
    assert figures["rmse"] == pytest.approx(np.sqrt(6 * 0.25 / 70))
    assert figures["worst_place"]["x"] == -3.5
    from PIL import Image

    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    red = (pixels[..., 0] - pixels[..., 2] > 60).nonzero()
    ground = pixels.shape[1] - 122 * 150 // 72  # without the legend
    assert len(red[1]) > 1000
    assert np.quantile(red[1][red[1] < ground], 0.99) < pixels.shape[1] / 4  # in the west alone
    assert call("compare", out, site, "--max-rmse", "0.1").code == 1
    assert call("compare", out, site, "--max-rmse", "0.2", "--min-coverage", "1").code == 0
    with rasterio.open(
        tmp_path / "never.tif", "w", driver="GTiff", dtype="float32", count=1, height=6, width=12,
        transform=Affine(1.0, 0.0, -4.0, 0.0, -1.0, 16.0),
    ) as file:  # fmt: skip
        file.write(np.full((6, 12), np.nan, np.float32), 1)
    ran = call("compare", tmp_path / "never.tif", site, "--max-rmse", "9")
    assert ran.code == 1 and "so the RMSE is not shown to be within 9 m" in ran.err
    ran = call("compare", site, site)
    assert ran.code in (2, 3) and not ran.out
    ran = call("map", scan, "--resolution", "nan", "--output", tmp_path / "n.tif")
    assert ran.code == 2 and not (tmp_path / "n.tif").exists()
    ran = call("map", scan, "--resolution", 1, "--sigma", 1, "--sensor", site, "--output", "x.tif")
    assert ran.code == 2


@pytest.mark.parametrize(("columns", "rows", "block"), [(3000, 2, (16, 512)), (20, 900, (512, 32))])
def test_narrow_maps_have_narrow_blocks(
    columns: int, rows: int, block: tuple[int, int], tmp_path: Path
) -> None:
    """Blocks of full size would be hundreds of times as much as is in them."""
    options = MapOptions(1.0, 1)
    made = RobotMap(Grid(0.0, 0.0, 1.0, rows, columns), options)
    heights = np.arange(float(columns * rows)).reshape(rows, columns) % 97
    x, y = np.meshgrid(np.arange(columns) + 0.5, rows - np.arange(rows) - 0.5)
    made.add(Cloud(np.stack([x, y, heights], axis=-1).reshape(-1, 3)))
    write_map(made, MapOutput(tmp_path / "a.tif", 1))
    with rasterio.open(tmp_path / "a.tif") as file:
        assert set(file.block_shapes) == {block}
        np.testing.assert_array_equal(file.read(1), heights)


def _tagged(path: Path, **tags: str) -> Path:
    """A map of the ramp with other tags."""
    write_map(of_heights(truth()), MapOutput(path, 1))
    with rasterio.open(path, "r+") as file:
        file.update_tags(**tags)
    return path


@pytest.mark.parametrize(
    "tags",
    [
        {"TERRATOOL_MAP_LEVEL": "²"},
        {"TERRATOOL_MAP_LEVEL": "-1"},
        {"TERRATOOL_MAP_LEVEL": "9" * 5000},
        {"TERRATOOL_MAP_LEVEL": "11"},  # 72 cells of 2¹¹ × 2¹¹ are more than a map has
        {"TERRATOOL_MAP_SURFACES": "[" * 5000},
        {"TERRATOOL_MAP_SURFACES": '{"a": 1}'},
        {"TERRATOOL_MAP_SURFACES": "[1, 2]"},
    ],
)
def test_tags_that_are_no_map_s(tags: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="its tags are not those of a map"):
        read_map(_tagged(tmp_path / "a.tif", **tags))
    assert read_map(_tagged(tmp_path / "b.tif", TERRATOOL_MAP_LEVEL="8")).level.level == 8


@pytest.mark.parametrize(("count", "side"), [(9, 1100), (1, 3200)])
def test_a_map_claims_no_more_than_its_file_may_hold(count: int, side: int, tmp_path: Path) -> None:
    """Cells never seen pack to nothing, so that few bytes would be hundreds of megabytes."""
    path = tmp_path / "a.tif"
    profile = {"width": side, "height": side, "count": count, "dtype": "float64", "nodata": np.nan,
               "transform": Affine(1, 0, 0, 0, -1, side)}  # fmt: skip
    with rasterio.open(path, "w", driver="GTiff", sparse_ok=True, **profile) as file:
        file.descriptions = BANDS.names[:count]
        if count > 1:
            file.update_tags(TERRATOOL_MAP_LEVEL="0", TERRATOOL_MAP_SURFACES="[]")
    with pytest.raises(ReadError, match="comes to more than 100 times its size"):
        read_map(path)


def test_numbers_that_no_map_has(tmp_path: Path) -> None:
    """Counts and heights without end are none, and complex numbers are told."""
    path = tmp_path / "a.tif"
    write_map(of_heights(truth()), MapOutput(path, 1))
    with rasterio.open(path, "r+") as file:
        bands = file.read()
        bands[0, 0, 0], bands[4, 1, 1], bands[0, 2, 2] = 1e300, 1e25, -np.inf
        file.write(bands)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        level = read_map(path).level
    assert np.isnan(level.elevation[[0, 2], [0, 2]]).all() and level.count[1, 1] == 2**53
    with rasterio.open(path, "w", driver="GTiff", width=4, height=4, count=1, dtype="complex64",
                       transform=Affine(1, 0, 0, 0, -1, 4)) as file:  # fmt: skip
        file.write(np.ones((1, 4, 4), np.complex64))
    with pytest.raises(ReadError, match="no real numbers"):
        read_map(path)
