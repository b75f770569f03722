"""Every layer says at every pixel what a query says there, and files say what their bands are."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp

from terratool.cli import export_dem as command
from terratool.errors import RequestError
from terratool.io import geotiff
from terratool.raster.grid import Window, grid_over
from terratool.raster.layers import LAYERS, NO_COLOR
from terratool.raster.shading import shade_bytes
from tests.conftest import terrain_of
from tests.mosaics import export_dem, export_mosaic
from tests.programs import needs

SOIL = {
    "cohesion": "cohesion", "friction": "fricAngle", "sinkage": "sinkage", "sonar": "sonarRefl",
}  # fmt: skip

# asymmetric and oblong; a surface that lacks everything, one that is void, ground without any
SITE: dict[str, Any] = {
    "size": [12, 8],
    "origin": [-3, 20],
    "surfTypes": {
        "sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18, "color": [194, 178, 128],
                 "sonarRefl": 0.25},
        "bare": {},
        "hole": {"void": True, "cohesion": 9, "color": [1, 2, 3]},
        "rock & <ice>": {"cohesion": 0, "fricAngle": 35, "sinkage": 0, "color": [0, 0, 0]},
    },
    "elemTypes": {
        "slope": {"x": [0, 1, 1.5], "y": [1, 3]},
        "flat": {"x": [1]},
        "hill": {"x": "cosbell", "y": []},
        "cone": {"combine": "radial", "x": [0, 1, 0]},
    },
    "elemTree": {
        "type": "slope",
        "cells": [6, 4],
        "children": [
            {"type": "flat", "cellX": 4, "cellY": 2, "vScale": 5, "turnDeg": 30,
             "surface": "rock & <ice>"},
            {"type": "flat", "cellX": 0, "cellY": 3, "surface": "hole"},
            {"type": "cone", "cellX": 1, "cellY": 0, "span": [2, 1], "vScale": 2,
             "surface": "bare"},
            {"type": "hill", "cellX": 3, "cellY": 0, "vScale": 1.5, "span": [3, 2], "turnDeg": 20,
             "surface": "sand"},
        ],
    },
}  # fmt: skip


def wanted(layer: str, terrain: Any, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The bands of a layer at points by queries, in double precision; slow and plain."""
    found = terrain.sample(x, y)
    names = terrain.surface(x, y)
    ground = ~np.isnan(found.height)
    nx, ny, nz = np.moveaxis(found.normal, -1, 0)
    surfaces = SITE["surfTypes"]
    if layer in ("height", "ground", "columns"):  # without storeys these are one
        return found.height[None]
    if layer == "clearance":
        return np.full((1, *x.shape), np.nan)
    if layer == "storeys":
        return ground[None].astype(float)
    if layer == "surface":
        return np.vectorize([None, *surfaces].index, otypes=[int])(names)[None]
    if layer == "slope":
        return np.degrees(np.arccos(nz))[None]
    if layer == "aspect":  # the normal leans to where the ground falls to
        aspect = np.degrees(np.arctan2(nx, ny)) % 360
        return np.where((nx == 0) & (ny == 0), np.nan, aspect)[None]
    if layer == "normal":
        return np.stack([nx, ny, nz])
    if layer == "hillshade":
        return shaded(found.height, x[0, 1] - x[0, 0])[None]
    if layer == "color":
        colors = [
            surfaces.get(name, {}).get("color", NO_COLOR) if here else (0, 0, 0)
            for name, here in zip(names.ravel(), ground.ravel(), strict=True)
        ]
        return np.array(colors).T.reshape(3, *x.shape)
    values = [
        surfaces.get(name, {}).get(SOIL[layer], np.nan) if here else np.nan
        for name, here in zip(names.ravel(), ground.ravel(), strict=True)
    ]
    return np.array(values).reshape(1, *x.shape)


def shaded(heights: np.ndarray, side: float) -> np.ndarray:
    """1 + 254 · the cosine between light and normal, by Horn's weights; 0 for none."""
    light = math.radians(315), math.radians(45)
    sun = np.array(
        [math.sin(light[0]) * math.cos(light[1]), math.cos(light[0]) * math.cos(light[1]),
         math.sin(light[1])]
    )  # fmt: skip
    rows, columns = heights.shape
    out = np.zeros(heights.shape)

    def at(row: int, column: int, middle: float) -> float:
        inside = min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)
        value = heights[inside]
        if inside != (row, column):  # the ground goes on as it came to the rim
            value = 2 * value - heights[2 * inside[0] - row, 2 * inside[1] - column]
        return middle if math.isnan(value) else value

    for row, column in np.argwhere(~np.isnan(heights)).tolist():
        own = heights[row, column]
        near = [[at(row + j, column + i, own) for i in (-1, 0, 1)] for j in (-1, 0, 1)]
        east = np.dot([1, 2, 1], [line[2] - line[0] for line in near]) / (8 * side)
        north = np.dot([1, 2, 1], np.subtract(near[0], near[2])) / (8 * side)
        normal = np.array([-east, -north, 1]) / math.sqrt(east**2 + north**2 + 1)
        out[row, column] = round(1 + 254 * max(0.0, float(normal @ sun)))
    return out


@pytest.mark.parametrize("layer", LAYERS)
def test_a_layer_is_what_queries_say(tmp_path: Path, layer: str) -> None:
    """At every pixel centre, with nodata where there is nothing to say."""
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.11)
    export_dem(terrain, grid, tmp_path / "a.tif", [layer])
    window = Window(0, 0, grid.height, grid.width)
    x, y = np.meshgrid(grid.columns(window), grid.rows(window))
    values = wanted(layer, terrain, x, y)
    with rasterio.open(tmp_path / "a.tif") as file:
        pixels = file.read()
        assert file.descriptions == LAYERS[layer].bands
        assert {unit or "" for unit in file.units} == {LAYERS[layer].unit}
    assert pixels.shape == values.shape
    if layer == "hillshade":  # heights are rounded to single precision
        assert pixels.dtype == np.uint8 and len(np.unique(pixels)) > 50
        assert np.abs(pixels - values).max() <= 1
        assert np.array_equal(pixels == 0, values == 0)
    elif layer == "slope":  # arccos knows little of a level place
        assert np.allclose(pixels, values, rtol=0, atol=1e-4, equal_nan=True)
    else:
        assert np.allclose(pixels, values, rtol=2e-6, atol=2e-6, equal_nan=True)


def test_double_precision_on_request(tmp_path: Path) -> None:
    """Heights and slopes are those of the queries to the rounding of doubles."""
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.11)
    export_dem(terrain, grid, tmp_path / "a.tif", ["height", "normal"], dtype="float64")
    window = Window(0, 0, grid.height, grid.width)
    x, y = np.meshgrid(grid.columns(window), grid.rows(window))
    with rasterio.open(tmp_path / "a.tif") as file:
        assert set(file.dtypes) == {"float64"}
        pixels = file.read()
    assert np.allclose(pixels[0], terrain.height(x, y), rtol=1e-14, atol=1e-14, equal_nan=True)
    normal = np.moveaxis(terrain.normal(x, y), -1, 0)
    assert np.allclose(pixels[1:], normal, rtol=1e-13, atol=1e-13, equal_nan=True)


@needs("gdaldem")
def test_slope_and_aspect_mean_what_gdal_means(tmp_path: Path) -> None:
    """Of a leaning plane, where finite differences are exact, too."""
    plane = {"combine": "sum", "x": [0, 3], "y": [0, 1]}
    terrain = terrain_of(
        {"size": [12, 8], "elemTypes": {"p": plane}, "elemTree": {"type": "p", "vScale": 1}}
    )
    export_dem(terrain, grid_over(terrain, 0.5), tmp_path / "a.tif", ["height", "slope", "aspect"])
    with rasterio.open(tmp_path / "a.tif") as file:
        _, slope, aspect = file.read()
    for mode, mine in (("slope", slope), ("aspect", aspect)):
        subprocess.run(
            ["gdaldem", mode, "-q", tmp_path / "a.tif", tmp_path / "b.tif"],
            check=True, capture_output=True,
        )  # fmt: skip
        with rasterio.open(tmp_path / "b.tif") as file:
            theirs = file.read(1)
        assert np.allclose(mine[1:-1, 1:-1], theirs[1:-1, 1:-1], rtol=1e-4)
        assert mine.std() < 1e-3 * mine.mean()
    # it rises to the east more than to the north, so it falls to the west-south-west
    assert 180 + 45 < aspect[3, 3] < 270
    assert aspect[3, 3] == pytest.approx(math.degrees(math.atan2(-0.25, -0.125)) % 360)


@needs("gdaldem")
def test_the_hillshade_is_that_of_gdal(tmp_path: Path) -> None:
    """Within one count, at walls, beside the void and along the rim; corners go on otherwise."""
    terrain = terrain_of(SITE)
    export_dem(terrain, grid_over(terrain, 0.11), tmp_path / "a.tif", ["height", "hillshade"])
    subprocess.run(
        ["gdaldem", "hillshade", "-q", "-compute_edges", tmp_path / "a.tif", tmp_path / "b.tif"],
        check=True, capture_output=True,
    )  # fmt: skip
    with (
        rasterio.open(tmp_path / "a-hillshade.tif") as mine,
        rasterio.open(tmp_path / "b.tif") as theirs,
    ):
        assert mine.nodata == theirs.nodata == 0
        assert mine.colorinterp == (ColorInterp.gray,)
        one, other = mine.read(1).astype(int), theirs.read(1).astype(int)
    corners = np.ix_([0, -1], [0, -1])
    other[corners] = one[corners]
    assert np.abs(one - other).max() <= 1 and one.std() > 20
    assert np.abs(one - other[::-1]).max() > 50 and np.abs(one - other[:, ::-1]).max() > 50


@pytest.mark.slow
def test_the_shade_knows_no_seams(tmp_path: Path) -> None:
    """On curved ground the pixels beside the edges of tiles and windows are those of one file."""
    terrain = terrain_of(
        {"size": [13, 9], "elemTypes": {"hill": {"x": "cosbell", "y": "0.5 + 0.5*sin(9*t)"}},
         "elemTree": {"type": "hill", "vScale": 6}}
    )  # fmt: skip
    grid = grid_over(terrain, 0.01)
    export_dem(terrain, grid, tmp_path / "a.tif", ["height", "hillshade"])
    export_mosaic(terrain, grid, tmp_path / "t", layers=["hillshade"], tile_size=512)
    with (
        rasterio.open(tmp_path / "a.tif") as heights,
        rasterio.open(tmp_path / "a-hillshade.tif") as one,
        rasterio.open(tmp_path / "t" / "mosaic.vrt") as other,
    ):
        whole = shade_bytes(heights.read(1), 0.01)
        assert np.array_equal(one.read(1), whole) and np.array_equal(other.read(1), whole)


def test_losses_are_the_same_beside_a_shade(tmp_path: Path) -> None:
    """A window that is shaded is painted with other neighbours."""
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.009, (-2.9, 20.1, 8.3, 27.7))
    found = [
        export_dem(terrain, grid, tmp_path / "a.tif", layers, losses=True, overwrite=True).losses
        for layers in (["height"], ["hillshade"])
    ]
    assert found[0] == found[1] and found[0].walls.pairs > 0


class TestFiles:
    """Which layers share a file, and what the files say of themselves."""

    def test_numbers_share_a_file(self, tmp_path: Path) -> None:
        """Bands come in the order asked for, each layer once."""
        terrain = terrain_of(SITE)
        layers = ["slope", "surface", "height", "slope", "color", "normal"]
        report = export_dem(terrain, grid_over(terrain, 0.5), tmp_path / "a.tif", layers)
        assert [(written.path.name, written.bands.names) for written in report.files] == [
            ("a.tif", ("slope", "height", "normal x", "normal y", "normal z")),
            ("a-surface.tif", ("surface",)),
            ("a-color.tif", ("red", "green", "blue")),
        ]
        alone = tmp_path / "b.tif"
        export_dem(terrain, grid_over(terrain, 0.5), alone, ["surface", "height"])
        for name, band, other, other_band in (
            ("a-surface", 1, "b", 1), ("a", 2, "b-height", 1),
        ):  # fmt: skip
            with (
                rasterio.open(tmp_path / f"{name}.tif") as one,
                rasterio.open(tmp_path / f"{other}.tif") as two,
            ):
                assert np.array_equal(one.read(band), two.read(other_band), equal_nan=True)

    def test_surfaces_have_names_and_colours(self, tmp_path: Path) -> None:
        terrain = terrain_of(SITE)
        report = export_dem(terrain, grid_over(terrain, 0.1), tmp_path / "a.tif", ["surface"])
        with rasterio.open(tmp_path / "a.tif") as file:
            colors = file.colormap(1)
            ids = file.read(1)
            assert file.nodata == 0 and file.colorinterp == (ColorInterp.palette,)
        assert colors[0][3] == 0
        assert [colors[id_] for id_ in range(1, 5)] == [
            (194, 178, 128, 255), (*NO_COLOR, 255), (1, 2, 3, 255), (0, 0, 0, 255),
        ]  # fmt: skip
        counts = np.bincount(ids.ravel(), minlength=5)[1:]
        assert report.surfaces == dict(zip(terrain.surfaces, counts.tolist(), strict=True))

    @needs("gdalinfo")
    def test_gdal_knows_the_surfaces_by_name(self, tmp_path: Path) -> None:
        """Category names, and an attribute table with soils, as QGIS shows them."""
        terrain = terrain_of(SITE)
        for name, more in (("a", {}), ("cog", {"cog": True})):
            path = tmp_path / f"{name}.tif"
            report = export_dem(terrain, grid_over(terrain, 0.1), path, ["surface"], **more)
            done = subprocess.run(
                ["gdalinfo", "-json", path], capture_output=True, text=True, check=True
            )
            info = json.loads(done.stdout)
            (band,) = info["bands"]
            assert band["description"] == "surface" and band["colorInterpretation"] == "Palette"
            text = (tmp_path / f"{name}.tif.aux.xml").read_text()
            assert "rock &amp; &lt;ice&gt;" in text
            table = info["rat"]
            fields = {field["name"]: field["index"] for field in table["fieldDefn"]}
            rows = [row["f"] for row in table["row"]]
            assert [row[fields["Class"]] for row in rows] == ["none", *terrain.surfaces]
            assert [row[fields["Value"]] for row in rows] == [0, 1, 2, 3, 4]
            assert [row[fields["Red"]] for row in rows[1:]] == [194, NO_COLOR[0], 1, 0]
            assert [row[fields["Count"]] for row in rows[1:]] == list(report.surfaces.values())
            assert rows[1][fields["cohesion (kPa)"]] == 1.04
            plain = subprocess.run(
                ["gdalinfo", "-noct", path], capture_output=True, text=True, check=True
            ).stdout
            assert "4: rock & <ice>" in plain

    def test_numbers_say_their_units(self, tmp_path: Path) -> None:
        terrain = terrain_of(SITE)
        layers = ["height", "slope", "cohesion", "friction", "sinkage", "sonar"]
        export_dem(terrain, grid_over(terrain, 0.5), tmp_path / "a.tif", layers)
        with rasterio.open(tmp_path / "a.tif") as file:
            assert [unit or "" for unit in file.units] == [
                "m", "degree", "kPa", "degree", "m/kN", "1",
            ]  # fmt: skip
            assert all(math.isnan(nodata) for nodata in file.nodatavals)

    def test_more_surfaces_than_a_byte_holds(self, tmp_path: Path) -> None:
        names = [f"s{k}" for k in range(300)]
        children = [
            {"type": "flat", "surface": name, "cellX": k % 20, "cellY": k // 20}
            for k, name in enumerate(names)
        ]
        terrain = terrain_of(
            {"size": 20, "surfTypes": {name: {"color": [k // 256, k % 256, 7]}
                                       for k, name in enumerate(names)},
             "elemTypes": {"flat": {"x": [1]}},
             "elemTree": {"type": "flat", "cells": 20, "children": children}}
        )  # fmt: skip
        export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.tif", ["surface"])
        with rasterio.open(tmp_path / "a.tif") as file:
            assert file.dtypes == ("uint16",)
            assert file.read(1)[::-1].ravel().tolist() == [*range(1, 301)] + [0] * 100
            assert file.colormap(1)[290] == (1, 33, 7, 255)

    def test_what_surfaces_lack_is_said(self, tmp_path: Path) -> None:
        """Not of a void one: there is no ground that could lack it."""
        terrain = terrain_of(SITE)
        layers = ["height", "cohesion", "color", "sonar"]
        report = export_dem(terrain, grid_over(terrain, 0.5), tmp_path / "a.tif", layers)
        assert report.lacking == {
            "cohesion": ["bare"], "color": ["bare"], "sonar": ["bare", "rock & <ice>"],
        }  # fmt: skip

    def test_unknown_names_are_refused(self, tmp_path: Path) -> None:
        terrain = terrain_of(SITE)
        for more in ({"layers": ["hight"]}, {"dtype": "float16"}):
            with pytest.raises(RequestError, match="There is no"):
                export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.tif", **more)
        assert list(tmp_path.iterdir()) == []


def test_the_command_knows_the_layers_and_compressions() -> None:
    """They are named twice, as --help is not to import NumPy."""
    assert tuple(LAYERS) == command.LAYERS, "cli/export_dem.py has other layers, or another order"
    assert geotiff.COMPRESSIONS == command.COMPRESSIONS
