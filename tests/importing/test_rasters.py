"""Rasters as sources of heights: registration, nodata, units, and what is refused."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

from terratool.errors import ReadError, RequestError
from terratool.importing.rasters import open_classes
from terratool.importing.sources import open_source
from terratool.importing.types import PixelGrid, SourceOptions
from tests import rasters

ROWS, COLUMNS = 5, 7
HEIGHTS = np.arange(ROWS * COLUMNS, dtype=float).reshape(ROWS, COLUMNS) ** 1.5  # from the north
UTM = "EPSG:32633"


def geotiff(path: Path, heights: NDArray[Any] = HEIGHTS, **options: Any) -> str:
    """Write a GeoTIFF of 2 × 3 m pixels, its north-west corner at 500000 5000000."""
    return rasters.geotiff(path, heights, (2, 3), (500000, 5000000), **{"crs": UTM, **options})


def read(name: str, **options: Any):
    """Pixels, all heights and notes of a source."""
    with open_source(name, SourceOptions(**options)) as source:
        values = source.read(0, source.grid.rows)
        return source.grid, values, source.notes


@pytest.fixture
def dem(tmp_path):
    return geotiff(tmp_path / "dem.tif")


def test_rows_count_from_the_south_and_pixels_are_areas(dem):
    grid, values, notes = read(dem)
    np.testing.assert_array_equal(values, HEIGHTS[::-1])
    assert grid.bounds == (500000, 5000000 - 15, 500014, 5000000)
    assert (grid.dx, grid.dy, grid.crs, grid.unit) == (2, 3, UTM, "")
    assert notes == ()


def test_some_rows_are_those_of_the_whole(dem):
    with open_source(dem) as source:
        np.testing.assert_array_equal(source.read(1, 2), HEIGHTS[::-1][1:3])


def test_south_up_and_mirrored_rasters_are_turned(tmp_path):
    name = geotiff(
        tmp_path / "up.tif",
        HEIGHTS[::-1, ::-1].copy(),
        transform=Affine(-2, 0, 500014, 0, 3, 5000000 - 15),
    )
    grid, values, _ = read(name)
    np.testing.assert_array_equal(values, HEIGHTS[::-1])
    assert grid.bounds == (500000, 5000000 - 15, 500014, 5000000)
    _, part, _ = read(name, bounds=(500002, 4999985, 500006, 4999991))
    np.testing.assert_array_equal(part, HEIGHTS[::-1][:2, 1:3])


def test_node_registration_lies_half_a_pixel_further_out(tmp_path):
    """A pixel is a point in these files: GDAL's grid begins half a pixel before the first."""
    point = geotiff(tmp_path / "point.tif", tags={"AREA_OR_POINT": "Point"})
    assert read(point)[0].bounds == (500000, 4999985, 500014, 5000000)
    body = "ncols 3\nnrows 2\n{0}\ncellsize 10\nNODATA_value -9999\n1 2 3\n4 5 -9999\n"
    corner, centre = tmp_path / "corner.asc", tmp_path / "centre.asc"
    corner.write_text(body.format("xllcorner 100\nyllcorner 200"))
    centre.write_text(body.format("xllcenter 100\nyllcenter 200"))
    assert read(str(corner))[0].bounds == (100, 200, 130, 220)
    assert read(str(centre))[0].bounds == (95, 195, 125, 215)
    np.testing.assert_array_equal(read(str(centre))[1], [[4, 5, math.nan], [1, 2, 3]])


def test_srtm_tiles_reach_half_a_pixel_over_their_degree(tmp_path):
    heights = np.zeros((1201, 1201), ">i2")
    heights[0, 0], heights[1200, 1200] = 11, 22  # the north-west and the south-east corner
    path = tmp_path / "N45E006.hgt"
    path.write_bytes(heights.tobytes())
    grid, values, notes = read(str(path))
    half = 0.5 / 1200
    assert grid.bounds == pytest.approx((6 - half, 45 - half, 7 + half, 46 + half), abs=1e-12)
    assert values[1200, 0] == 11
    assert values[0, 1200] == 22
    assert "degrees" in notes[0]
    assert "EPSG:32632" in notes[0]


def test_reprojection_keeps_heights_at_their_places(tmp_path):
    """A plane in UTM, brought to degrees and back by another program's transform."""
    from rasterio.warp import transform

    y, x = np.mgrid[0:60, 0:80].astype(float)
    plane = 100 + 0.5 * x - 0.25 * y
    name = geotiff(tmp_path / "plane.tif", plane, transform=Affine(10, 0, 500000, 0, -10, 5e6))
    grid, values, notes = read(name, crs="EPSG:4326")
    assert "EPSG:4326" in notes[0]
    assert grid.crs == "EPSG:4326"
    i, j = np.meshgrid(np.arange(grid.columns), np.arange(grid.rows))
    east, north = transform(
        "EPSG:4326",
        UTM,
        (grid.west + (i + 0.5) * grid.dx).ravel(),
        (grid.south + (j + 0.5) * grid.dy).ravel(),
    )
    wanted = (
        100 + 0.5 * ((np.array(east) - 500005) / 10) - 0.25 * ((5e6 - 5 - np.array(north)) / 10)
    )
    known = ~np.isnan(values.ravel())
    assert known.mean() > 0.8
    assert np.abs(values.ravel() - wanted)[known].max() < 0.1


@pytest.mark.parametrize(
    ("options", "rows", "columns"),
    [
        ({"window": (1, 2, 3, 2)}, slice(2, 4), slice(1, 4)),
        ({"window": (0, 0, 7, 5)}, slice(0, 5), slice(0, 7)),
        # centres at 500001, 500003, … and at 4999998.5, 4999995.5, …
        ({"bounds": (500002.9, 4999990, 500007.1, 4999996)}, slice(1, 3), slice(1, 4)),
        ({"bounds": (500003, 4999992.5, 500005, 4999995.5)}, slice(1, 3), slice(1, 3)),
        ({"bounds": (0, 0, 1e9, 1e9)}, slice(0, 5), slice(0, 7)),
    ],
)
def test_parts(dem, options, rows, columns):
    grid, values, _ = read(dem, **options)
    np.testing.assert_array_equal(values[::-1], HEIGHTS[rows, columns])
    assert grid.west == 500000 + 2 * columns.start
    assert grid.bounds[3] == pytest.approx(5000000 - 3 * rows.start)


def test_what_is_nodata_is_nan(tmp_path):
    heights = HEIGHTS.astype(np.float32)
    heights[0, 0] = -32768
    heights[1, 1] = math.nan
    heights[2, 2] = math.inf
    heights[3, 3] = -1
    name = geotiff(tmp_path / "holes.tif", heights, nodata=-32768)
    _, values, notes = read(name, nodata=-1.0)
    assert np.argwhere(np.isnan(values[::-1])).tolist() == [[0, 0], [1, 1], [2, 2], [3, 3]]
    assert notes == ("1 pixel is infinite: taken as nodata.",)


def test_scale_and_offset_are_applied(tmp_path):
    name = geotiff(
        tmp_path / "scaled.tif",
        np.array([[0, 10, 65535]], np.uint16),
        nodata=65535,
        band={"scales": (0.5,), "offsets": (-100.0,)},
    )
    np.testing.assert_array_equal(read(name)[1], [[-100, -95, math.nan]])


def test_units_are_said(tmp_path):
    feet = geotiff(tmp_path / "feet.tif", crs="EPSG:2263", band={"units": ("ft",)})
    grid, _, notes = read(feet)
    assert grid.unit == "ft"
    assert notes == (
        "x and y are in US survey feet, heights in feet: --units m makes metres of them, "
        "for which other commands take them.",
    )
    degrees = geotiff(
        tmp_path / "degrees.tif", crs="EPSG:4326", transform=Affine(0.1, 0, -70, 0, -0.1, -33)
    )
    assert "EPSG:32719" in read(degrees)[2][0]
    with pytest.warns(NotGeoreferencedWarning):
        nowhere = geotiff(tmp_path / "nowhere.tif", crs=None, transform=Affine.identity())
    grid, values, notes = read(nowhere)
    assert "1 × 1" in notes[0]
    assert grid.bounds == (0, 0, 7, 5)
    np.testing.assert_array_equal(values, HEIGHTS[::-1])


def test_one_band_of_several(tmp_path):
    name = geotiff(tmp_path / "two.tif", np.stack([HEIGHTS, -HEIGHTS]))
    np.testing.assert_array_equal(read(name, band=2)[1], -HEIGHTS[::-1])
    with pytest.raises(RequestError, match="--band"):
        read(name)
    with pytest.raises(RequestError, match="has 2 bands, and no band 3"):
        read(name, band=3)


def broken(tmp_path: Path, what: str) -> str:
    """A file that cannot be read as heights."""
    good = Path(geotiff(tmp_path / "good.tif", np.tile(HEIGHTS, (200, 100))))
    path = tmp_path / "broken.tif"
    small = HEIGHTS.astype(np.uint8)
    if what == "picture":
        kinds = [ColorInterp.red, ColorInterp.green, ColorInterp.blue]
        bands = np.stack([small, small, small[::-1]])
        return geotiff(path, bands, photometric="rgb", colorinterp=kinds)
    if what == "palette":
        geotiff(path, small, photometric="palette")
        with rasterio.open(path, "r+") as file:
            file.write_colormap(1, {0: (0, 0, 0, 255), 1: (9, 9, 9, 255)})
    elif what == "complex":
        geotiff(path, HEIGHTS.astype(np.complex64))
    elif what == "turned":
        geotiff(path, transform=Affine(2, 1, 500000, 1, -3, 5000000))
    elif what == "huge values":
        geotiff(path, np.where(HEIGHTS > 100, -3.4e38, HEIGHTS))
    elif what == "truncated":
        path.write_bytes(good.read_bytes()[: good.stat().st_size // 2])
    elif what == "header only":
        path.write_bytes(good.read_bytes()[:100])
    elif what == "empty":
        path.write_bytes(b"")
    elif what == "rubbish":
        path.write_bytes(bytes(range(256)) * 40)
    elif what == "folder":
        path.mkdir()
    elif what == "definition":
        path = tmp_path / "broken.json"
        path.write_text("{}")
    elif what == "text grid cut off":
        path = tmp_path / "broken.asc"
        path.write_text("ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n4")
    return str(path)


@pytest.mark.parametrize(
    "what",
    [
        "picture", "palette", "complex", "turned", "huge values", "truncated", "header only",
        "empty", "rubbish", "folder", "missing", "definition", "text grid cut off",
    ],
)  # fmt: skip
def test_what_has_no_heights_is_refused(tmp_path, what):
    with pytest.raises(ReadError) as caught:
        read(broken(tmp_path, what))
    assert caught.value.hint
    assert "broken." in caught.value.message


@pytest.mark.parametrize(
    "options",
    [
        {"window": (0, 0, 8, 5)},
        {"window": (-1, 0, 2, 2)},
        {"window": (0, 0, 0, 2)},
        {"bounds": (0, 0, 1, 1)},
        {"bounds": (500006, 4999985, 500000, 5000000)},
        {"bounds": (math.nan, 0, 1, 1)},
        {"bounds": (0, 0, math.inf, math.inf)},
        {"crs": "EPSG:0"},
        {"crs": "rubbish"},
        {"resolution": 2.0},
        {"up": "y"},
        {"scale": 2.0},
    ],
)
def test_options_that_do_not_fit_are_refused(dem, options):
    with pytest.raises(RequestError):
        read(dem, **options)


def test_a_raster_without_a_reference_system_cannot_be_reprojected(tmp_path):
    with pytest.raises(RequestError, match="reference system"):
        read(geotiff(tmp_path / "none.tif", crs=None), crs=UTM)


def test_the_number_to_give_as_nodata_is_said_to_the_last_digit(tmp_path):
    heights = np.where(HEIGHTS > 100, np.finfo(np.float32).min, HEIGHTS).astype(np.float32)
    name = geotiff(tmp_path / "wide.tif", heights)
    with pytest.raises(ReadError) as caught:
        read(name)
    number = float(caught.value.hint.split("--nodata ")[1].rstrip("."))
    assert np.isnan(read(name, nodata=number)[1]).sum() == (HEIGHTS > 100).sum()


def test_two_numbers_for_nodata_are_not_resampled(tmp_path):
    name = geotiff(tmp_path / "two.tif", nodata=-9999)
    assert not np.isnan(read(name, nodata=-9999.0, crs=UTM)[1]).any()
    with pytest.raises(RequestError, match="-9999"):
        read(name, nodata=0.0, crs=UTM)
    name = geotiff(tmp_path / "nan.tif", nodata=math.nan)
    assert np.isnan(read(name, nodata=0.0, crs=UTM)[1]).any()


def test_a_turned_raster_can_be_reprojected(tmp_path):
    name = geotiff(tmp_path / "turned.tif", transform=Affine(2, 1, 500000, 1, -3, 5000000))
    _, values, _ = read(name, crs=UTM)
    assert 0 < np.isnan(values).mean() < 1
    assert np.nanmax(values) <= HEIGHTS.max()


@pytest.mark.parametrize(("bad", "count"), [(-9999, 4), (32767, 1)])
def test_numbers_that_look_like_nodata_are_named(tmp_path, bad, count):
    heights = HEIGHTS.copy()
    heights[1, 2 : 2 + count] = bad
    name = geotiff(tmp_path / "undeclared.tif", heights)
    notes = read(name)[2]
    assert len(notes) == 1
    assert f"--nodata {bad}" in notes[0]
    assert ("1 pixel is" if count == 1 else "4 pixels are") in notes[0]
    _, values, notes = read(name, nodata=float(bad))
    assert notes == ()
    assert np.isnan(values).sum() == count


def test_rows_of_nothing_else_look_like_nodata_too(tmp_path):
    """Read a few rows at a time, as large files are."""
    heights = HEIGHTS.copy()
    heights[:2] = -9999
    with open_source(geotiff(tmp_path / "undeclared.tif", heights)) as source:
        for first in range(ROWS):
            source.read(first, 1)
        assert "14 pixels are -9999" in source.notes[0]
    constant = geotiff(tmp_path / "constant.tif", np.full((5, 7), -9999.0))
    assert read(constant)[2] == ()


def test_heights_that_only_happen_to_be_such_numbers_are_not(tmp_path):
    heights = np.linspace(9000, 11000, 35).reshape(5, 7)
    heights[0, 0] = 9999
    assert read(geotiff(tmp_path / "high.tif", heights))[2] == ()
    deep = np.linspace(-9999, -3000, 35).reshape(5, 7)
    assert read(geotiff(tmp_path / "deep.tif", deep))[2] == ()


def test_bounds_beside_a_raster_are_told_with_its_own(dem):
    """The hint says whose the sides are: a cell of 2 × 3 m, 7 columns and 5 rows of them."""
    with pytest.raises(RequestError) as caught:
        read(dem, bounds=(0, 0, 1, 1))
    sides = "500000 4999985 500014 5000000"
    assert caught.value.hint == f"Give bounds that overlap {sides}, where the raster lies."


def test_window_and_bounds_exclude_each_other(dem):
    with pytest.raises(RequestError, match="both"):
        read(dem, window=(0, 0, 2, 2), bounds=(0, 0, 1e9, 1e9))


@pytest.mark.parametrize("suffix", [".x3db", ".sdf", ".FBX"])
def test_meshes_that_are_not_read_are_named(tmp_path, suffix):
    (tmp_path / f"mesh{suffix}").write_bytes(b"x")
    with pytest.raises(ReadError, match="not read") as caught:
        read(str(tmp_path / f"mesh{suffix}"))
    assert ".glb" in caught.value.hint


def test_portable_graymaps_with_and_without_a_place(tmp_path: Path) -> None:
    """GDAL's driver leaves the place to chance where no world file gives it."""
    heights = np.arange(24).reshape(4, 6)
    path = tmp_path / "a.pgm"
    path.write_bytes(b"P5\n6 4\n65535\n" + heights.astype(">u2").tobytes())
    with open_source(str(path)) as source:
        assert source.grid == PixelGrid(0, 0, 1, 1, 6, 4, unit="")
        assert np.array_equal(source.read(0, 4)[::-1], heights)
        assert any("does not say where it lies" in note for note in source.notes)
    with open_classes(str(path), PixelGrid(0, 0, 1, 1, 6, 4)) as classes:
        assert np.array_equal(classes.read(0, 4)[::-1], heights)
    path.with_suffix(".wld").write_text("2\n0\n0\n-3\n11\n7.5\n")  # centre of the first pixel
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as file:
        file.write(path, "a.pgm")
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as file:
        file.write(path, "a.pgm")
        file.write(path.with_suffix(".wld"), "a.wld")
    for name in (str(path), f"/vsizip/{tmp_path}/b.zip/a.pgm"):
        with open_source(name) as source:
            assert source.grid == PixelGrid(10, -3, 2, 3, 6, 4, unit="")
            assert np.array_equal(source.read(0, 4)[::-1], heights)
    with open_source(f"/vsizip/{tmp_path}/a.zip/a.pgm") as source:
        assert source.grid == PixelGrid(0, 0, 1, 1, 6, 4, unit="")


def test_a_reference_system_alone_is_no_place(tmp_path: Path) -> None:
    """Pixels without a place stand the right way up, with a CRS and without one."""
    heights = np.arange(24, dtype=np.float32).reshape(4, 6)
    for name, more in (("a.tif", {}), ("b.tif", {"crs": "EPSG:32632"})):
        with (
            pytest.warns(NotGeoreferencedWarning),
            rasterio.open(tmp_path / name, "w", driver="GTiff", width=6, height=4, count=1,
                          dtype="float32", **more) as file,
        ):  # fmt: skip
            file.write(heights, 1)
        with open_source(str(tmp_path / name)) as source:
            assert np.array_equal(source.read(0, 4)[::-1], heights)
            assert any("does not say where it lies" in note for note in source.notes)
