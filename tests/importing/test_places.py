"""Rasters without a clear place, unit or celestial body, and what the user says of them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine
from rasterio.warp import transform

import terratool
from terratool.definition.crs import metric_crs
from terratool.errors import RequestError, TerratoolError
from terratool.importing.sources import open_source
from terratool.importing.terrain.request import proposed_error
from terratool.importing.types import PixelGrid, SourceOptions
from terratool.io.crs import local_crs, radius_of, vertical_unit
from terratool.io.units import unit_text
from tests import rasters
from tests.commands import run

COUNTS = (np.arange(6)[:, None] * 40 + np.arange(9) ** 2)[::-1].astype(np.uint16)
"""Six rows from the north, of nine columns: every quarter turn and mirroring shows."""
NEW_YORK = "EPSG:2260"
"""State plane in US survey feet."""
FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937
MOON = "+proj=longlat +R=1737400 +no_defs"
MARS = "+proj=longlat +a=3396190 +b=3376200 +no_defs"


def picture(path: Path, bands: NDArray[Any], **options: Any) -> str:
    """Write a picture without a place."""
    bands = bands.reshape(-1, *bands.shape[-2:])
    kind = {".png": "PNG", ".tif": "GTiff", ".pgm": "PNM"}[path.suffix]
    rows, columns = bands.shape[1:]
    with (
        pytest.warns(NotGeoreferencedWarning),
        rasterio.open(path, "w", driver=kind, count=len(bands), height=rows, width=columns,
                      dtype=bands.dtype, **options) as file,
    ):  # fmt: skip
        file.write(bands)
    return str(path)


def read(name: str, **options: Any) -> tuple[PixelGrid, NDArray[np.float64], tuple[str, ...]]:
    """Pixels, all heights from the north, and notes of a source."""
    with open_source(name, SourceOptions(**options)) as source:
        values = source.read(0, source.grid.rows)[::-1]
        return source.grid, values, source.notes


def degrees(path: Path, heights: NDArray[Any] = COUNTS, **options: Any) -> str:
    """A raster on longitudes and latitudes, oblong pixels of about 90 m."""
    return rasters.geotiff(path, heights, (1e-3, 8e-4), (-105.5, 40.1), **options)


def feet(path: Path, **options: Any) -> str:
    """A raster of 10 × 8 feet."""
    place = {"crs": NEW_YORK, **options}
    return rasters.geotiff(path, COUNTS.astype(np.float32), (10, 8), (500000, 400000), **place)


# --- pictures ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dtype", "suffix", "most"),
    [("uint8", ".png", 255), ("uint16", ".png", 65535), ("uint16", ".pgm", 65535)],
)
def test_a_height_map_has_the_size_and_the_heights_that_are_asked_for(
    tmp_path: Path, dtype: str, suffix: str, most: int
) -> None:
    """Black is LOW and white is HIGH, whatever there is in the picture."""
    name = picture(tmp_path / f"map{suffix}", COUNTS.astype(dtype))
    grid, values, notes = read(name, size=(45.0, 12.0), height_range=(-2.0, 8.0))
    assert (grid.bounds, grid.dx, grid.dy) == ((0, 0, 45, 12), 5, 2)
    counts = COUNTS.astype(dtype)
    np.testing.assert_allclose(values, -2 + counts.astype(float) * 10 / most, atol=1e-12)
    assert notes == ()
    _, part, _ = read(name, size=(45.0, 12.0), height_range=(-2.0, 8.0), bounds=(5, 0, 25, 4))
    np.testing.assert_array_equal(part, values[4:, 1:5])


def test_the_range_of_floats_and_wide_numbers_is_that_of_the_raster(tmp_path: Path) -> None:
    """Of all of it, although a part is taken; what is nodata does not count."""
    heights = COUNTS.astype(np.float32) / 7
    heights[0, 0] = -9999
    name = picture(tmp_path / "map.tif", heights, nodata=-9999)
    known = np.where(heights == -9999, np.nan, heights)
    low, high = np.nanmin(known), np.nanmax(known)
    wanted = 3 - 4 * (known - low) / (high - low)
    for window in (None, (2, 1, 5, 4)):
        rows = slice(1, 5) if window else slice(None)
        columns = slice(2, 7) if window else slice(None)
        _, values, _ = read(name, height_range=(3.0, -1.0), window=window)
        np.testing.assert_allclose(values, wanted[rows, columns], atol=1e-6)
    wide = picture(tmp_path / "wide.tif", COUNTS.astype(np.int32) - 50)
    assert np.ptp(read(wide, height_range=(0.0, 10.0))[1]) == pytest.approx(10)
    short = picture(tmp_path / "short.tif", COUNTS.astype(np.int16))
    wanted = 65535 * (COUNTS.astype(float) + 32768) / 65535
    np.testing.assert_allclose(read(short, height_range=(0.0, 65535.0))[1], wanted)
    level = picture(tmp_path / "level.tif", np.full((3, 4), 5.0))
    assert (read(level, height_range=(2.0, 10.0))[1] == 2).all()


def test_bits_that_are_not_used_do_not_count(tmp_path: Path) -> None:
    name = picture(tmp_path / "map.tif", COUNTS, nbits=12)
    np.testing.assert_allclose(read(name, height_range=(0.0, 4095.0))[1], COUNTS)


def test_heights_of_a_picture_are_said_to_be_counts(tmp_path: Path) -> None:
    name = picture(tmp_path / "map.png", COUNTS)
    grid, values, notes = read(name)
    np.testing.assert_array_equal(values, COUNTS)
    assert grid.unit == "" and len(notes) == 2
    assert "--size X Y" in notes[0] and "raw counts" in notes[1]
    first, second = read(name, source_units="cm")[2]
    assert first == notes[0] and second.startswith("Heights are in centimetres: --units m makes")
    numbers = picture(tmp_path / "map.tif", COUNTS.astype(np.float32))
    assert "raw numbers" in read(numbers)[2][1]


def test_a_place_is_not_sized(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="has a place of its own, with pixels of 10 × 8"):
        read(feet(tmp_path / "feet.tif"), size=(1.0, 2.0))


@pytest.mark.parametrize("alpha", [False, True])
def test_a_grey_picture_of_several_channels_is_one_band(tmp_path: Path, alpha: bool) -> None:
    """Where nothing is opaque colours may differ, and there is no height."""
    grey = COUNTS.astype(np.uint8)
    bands = [grey, grey.copy(), grey]
    if alpha:
        mask = np.full(grey.shape, 255, np.uint8)
        mask[1, 2] = mask[4, 7] = 0
        bands[1][1, 2] ^= 1
        bands.append(mask)
    _, values, _ = read(picture(tmp_path / "grey.png", np.stack(bands)))
    wanted = grey.astype(float)
    if alpha:
        wanted[1, 2] = wanted[4, 7] = np.nan
    np.testing.assert_array_equal(values, wanted)


def test_one_coloured_pixel_makes_a_picture(tmp_path: Path) -> None:
    grey = np.stack([COUNTS.astype(np.uint8)] * 3)
    grey[2, 5, 8] ^= 1
    with pytest.raises(TerratoolError, match="is a picture") as caught:
        read(picture(tmp_path / "color.png", grey))
    assert "--band" in caught.value.hint and "--encoding" in caught.value.hint


HEIGHTS = np.linspace(-80, 2000, 54).reshape(6, 9) ** 1.0
ALPHA = np.full((6, 9), 255, np.uint8)
ALPHA[3, 1] = 0


def encoded(kind: str, heights: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Red, green and blue of heights, by the formulas that their publishers give."""
    step, base = {"terrarium": (1 / 256, 32768.0), "mapbox": (0.1, 10000.0)}[kind]
    whole = np.round((heights + base) / step).astype(int)
    return np.stack([whole >> 16, whole >> 8 & 255, whole & 255]).astype(np.uint8)


@pytest.mark.parametrize(("kind", "step"), [("terrarium", 1 / 256), ("mapbox", 0.1)])
def test_terrain_rgb_has_heights_in_metres(tmp_path: Path, kind: str, step: float) -> None:
    bands = np.concatenate([encoded(kind, HEIGHTS), ALPHA[None]])
    grid, values, notes = read(picture(tmp_path / "tile.png", bands), encoding=kind, size=(9, 6))
    assert (grid.unit, notes) == ("m", ())
    assert np.argwhere(np.isnan(values)).tolist() == [[3, 1]]
    known = ~np.isnan(values)
    assert np.abs(values - HEIGHTS)[known].max() <= step / 2 + 1e-9


@pytest.mark.parametrize("alpha", [False, True])
def test_terrain_rgb_is_decoded_before_it_is_resampled(tmp_path: Path, alpha: bool) -> None:
    """A channel of it may well be the number that is nodata; only all three of it are a gap."""
    x, y = np.meshgrid(np.arange(40), np.arange(30))
    plane = 250.0 + 0.5 * x - 0.25 * y  # across a step of green, from 255 to 0
    bands = encoded("terrarium", plane)
    assert bands[1].min() == 0 and bands[1].max() == 255
    kinds = [ColorInterp.red, ColorInterp.green, ColorInterp.blue]
    more: dict[str, Any] = {"nodata": 0}
    if alpha:
        opaque = np.full((1, *plane.shape), 255, np.uint8)
        opaque[0, 10:14, 20:26] = 0
        bands = np.concatenate([bands, opaque])
        more = {"colorinterp": [*kinds, ColorInterp.alpha]}
    name = rasters.geotiff(
        tmp_path / "rgb.tif", bands, 10, (500000, 4500000), crs="EPSG:32633", **more
    )
    grid, values, _ = read(name, encoding="terrarium", crs="EPSG:32634")
    row, column = np.mgrid[: grid.rows, : grid.columns]
    east = grid.west + (column.ravel() + 0.5) * grid.dx
    north = grid.bounds[3] - (row.ravel() + 0.5) * grid.dy
    at_x, at_y = transform("EPSG:32634", "EPSG:32633", east, north)
    at_x, at_y = np.array(at_x), np.array(at_y)
    wanted = 250 + 0.5 * (at_x - 500005) / 10 - 0.25 * (4499995 - at_y) / 10
    known = ~np.isnan(values.ravel())
    inside = (at_x > 500005) & (at_x < 500395) & (at_y < 4499995) & (at_y > 4499705)
    column, row = (at_x - 500000) / 10, (4500000 - at_y) / 10
    hole = alpha & (column > 21) & (column < 25) & (row > 11) & (row < 13)
    edge = alpha & (column > 18) & (column < 28) & (row > 8) & (row < 16)
    assert hole.any() == alpha and not known[hole].any() and known[inside & ~edge].all()
    assert np.abs(values.ravel() - wanted)[known].max() < 0.6


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"size": (1.0, 0.0)}, "size is 1 × 0"),
        ({"size": (math.nan, 1.0)}, "size is nan"),
        ({"height_range": (2.0, 2.0)}, "range from 2 to 2"),
        ({"height_range": (0.0, math.inf)}, "range from 0 to inf"),
        ({"encoding": "mapbox"}, "is no terrain-RGB"),
        ({"encoding": "mapbox", "height_range": (0.0, 1.0)}, "--height-range and --encoding"),
        ({"encoding": "mapbox", "band": 1}, "--band and --encoding"),
        ({"units": "m"}, "unit of its heights is not known"),
        ({"crs": "local"}, "does not say its reference system"),
        ({"crs": "local", "source_crs": "EPSG:32633"}, "does not say where it lies"),
    ],
)
def test_what_a_picture_cannot_be_is_refused(
    tmp_path: Path, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(RequestError, match=says) as caught:
        read(picture(tmp_path / "map.png", COUNTS), **options)
    assert caught.value.hint


@pytest.mark.nightly
def test_what_makes_other_heights_is_not_linked(tmp_path: Path) -> None:
    """A size is that of the definition alone, and does no harm."""
    name = picture(tmp_path / "map.tif", COUNTS)
    site = tmp_path / "site.json"
    ran = run("import-terrain", name, site, "--link", "--size", 45, 12)
    assert ran.code == 0, ran.err
    assert terratool.load(site).height(2.5, 1) == COUNTS[5, 0]
    assert terratool.load(site).height(42.5, 11) == COUNTS[0, 8]
    ran = run("import-terrain", name, tmp_path / "b.json", "--link", "--height-range", 0, 1)
    assert ran.code == 2 and "--height-range or --units" in ran.err
    tile = picture(tmp_path / "tile.tif", encoded("mapbox", HEIGHTS), photometric="rgb")
    ran = run("import-terrain", tile, tmp_path / "b.json", "--link", "--encoding", "mapbox")
    assert ran.code == 2 and "--encoding" in ran.err and not (tmp_path / "b.json").exists()


# --- units ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "symbol"),
    [
        ("m", "m"), ("Meters", "m"), ("[metre]", "m"), ("ft", "ft"), ("Foot (International)", "ft"),
        ("US survey foot", "us-ft"), ("Foot_US", "us-ft"), ("ftUS", "us-ft"), ("cm", "cm"),
        ("unspecified", ""), ("Unknown", ""), ("-", ""), (" ? ", ""), ("", ""), (None, ""),
        ("fathom", "fathom"),
    ],
)  # fmt: skip
def test_units_have_many_names(text: str | None, symbol: str) -> None:
    assert unit_text(text) == symbol


@pytest.mark.parametrize(
    ("crs", "unit", "said"),
    [
        ("EPSG:32618", "", ()),
        ("EPSG:32618", "metre", ()),
        ("EPSG:32618", "unspecified", ()),
        (None, "m", ()),
        (None, "ft", ("Heights are in feet: --units m makes metres of them, for "
            "which other commands take them.",)),
        ("EPSG:32618", "US survey foot", (
            "x and y are in metres, heights in US survey feet: --units m makes metres of them, for "
            "which other commands take them.",)),
        ("EPSG:32618", "fathom", (
            "x and y are in metres, heights in fathom; they are kept as they are.",)),
        (NEW_YORK, "US survey foot", (
            "x, y and heights are in US survey feet: --units m makes metres of them, for "
            "which other commands take them.",)),
        (NEW_YORK, "m", (
            "x and y are in US survey feet, heights in metres: --units m makes metres of them, for "
            "which other commands take them.",)),
        (NEW_YORK, "", (
            "x and y are in US survey feet, and stay so; --units m makes metres of them.",
            "The unit of the heights is not known: add --source-units, as ft, to say it.")),
    ],
)  # fmt: skip
def test_units_are_said_where_they_differ_and_never_guessed(
    tmp_path: Path, crs: str | None, unit: str, said: tuple[str, ...]
) -> None:
    grid, values, notes = read(feet(tmp_path / "a.tif", crs=crs, band={"units": (unit,)}))
    assert notes == said
    assert grid.unit == unit_text(unit)
    np.testing.assert_array_equal(values, COUNTS)


def test_feet_become_metres(tmp_path: Path) -> None:
    """Heights, and x and y: the places are those of PROJ's own system in metres."""
    name = feet(tmp_path / "feet.tif", band={"units": ("ft",)})
    grid, values, notes = read(name, units="m")
    assert (grid.unit, notes) == ("m", ())
    np.testing.assert_allclose(values, COUNTS * FOOT, rtol=1e-14)
    assert (grid.dx, grid.dy) == pytest.approx((10 * SURVEY_FOOT, 8 * SURVEY_FOOT), rel=1e-12)
    assert grid.crs == "EPSG:32111"  # New York East in metres
    (x,), (y,) = transform(NEW_YORK, grid.crs, [500000], [400000])
    assert (grid.west, grid.bounds[3]) == pytest.approx((x, y), abs=1e-6)
    with open_source(name, SourceOptions(units="m")) as source:
        assert source.stated == (NEW_YORK, "ft")


@pytest.mark.parametrize(("said", "factor"), [("us-ft", SURVEY_FOOT), ("cm", 0.01), ("m", 1)])
def test_a_unit_that_the_file_does_not_say(tmp_path: Path, said: str, factor: float) -> None:
    name = rasters.geotiff(tmp_path / "a.tif", COUNTS, 10, (0, 60), crs="EPSG:32618")
    grid, values, _ = read(name, source_units=said, units="m")
    np.testing.assert_allclose(values, COUNTS * factor, rtol=1e-14)
    assert (grid.dx, grid.crs, grid.unit) == (10, "EPSG:32618", "m")
    named = rasters.geotiff(tmp_path / "b.tif", COUNTS, 10, (0, 60), band={"units": ("foot",)})
    with pytest.raises(RequestError, match="says that its heights are in feet"):
        read(named, source_units=said)


def test_a_vertical_system_says_the_unit() -> None:
    """Of a compound, and of one of three dimensions; others say none."""
    assert unit_text(vertical_unit(CRS.from_string("EPSG:32618+6360"))) == "us-ft"
    assert unit_text(vertical_unit(CRS.from_string("EPSG:4979"))) == "m"
    assert vertical_unit(CRS.from_epsg(2260)) == ""


def test_heights_of_a_reprojected_raster_keep_an_unknown_unit(tmp_path: Path) -> None:
    name = feet(tmp_path / "feet.tif")
    reprojected, unknown = read(name, crs="EPSG:32618")[2]
    assert "Reprojected" in reprojected and "unit of the heights is not known" in unknown
    metric = rasters.geotiff(tmp_path / "m.tif", COUNTS, 10, (500000, 4500000), crs="EPSG:32617")
    assert len(read(metric, crs="EPSG:32618")[2]) == 1


@pytest.mark.slow
def test_no_unit_is_claimed_of_errors(tmp_path: Path) -> None:
    """Neither in lines nor in JSON, nor of a primitive."""
    name, out = feet(tmp_path / "feet.tif"), tmp_path / "out.json"
    ran = run("import-terrain", name, out, "--max-error", 3)
    assert ran.code == 0 and " m" not in ran.out.replace(" most", "")
    ran = run("import-terrain", name, out, "--max-error", 3, "--overwrite", "--json")
    assert json.loads(ran.out)["unit"] is None
    ran = run("import-primitive", name, "--name", "a", "--source-units", "ft")
    assert " ft (" in ran.err and " m " not in ran.err.replace("--units m ", "")


# --- degrees and other bodies --------------------------------------------------------------------


def test_degrees_without_a_system_are_seen_and_named(tmp_path: Path) -> None:
    name = degrees(tmp_path / "a.tif")
    assert "look like degrees" in read(name)[2][0]
    grid, values, notes = read(name, source_crs="EPSG:4326", crs="local")
    assert "look like degrees" not in " ".join(notes)
    assert 80 < grid.dx < 95 and np.nanmax(values) <= COUNTS.max()
    assert read(name, source_crs="EPSG:4326")[0].crs == "EPSG:4326"
    with pytest.raises(RequestError, match="names no reference system"):
        read(name, source_crs="rubbish")


@pytest.mark.parametrize(
    ("side", "corner", "scale"),
    [(1, (0, 9), 1), (1e-3, (500, 40), 1), (1e-3, (10, 100), 1), (0.01, (0, 0.06), 1e-4)],
)
def test_small_pixels_elsewhere_are_no_degrees(
    tmp_path: Path, side: float, corner: tuple[float, float], scale: float
) -> None:
    """Of a metre, out of range, or of a table in a laboratory, flatter than it is long."""
    name = rasters.geotiff(tmp_path / "a.tif", COUNTS * scale, side, corner)
    assert read(name)[2] == ()


def test_the_system_of_a_file_is_not_replaced(tmp_path: Path) -> None:
    name = degrees(tmp_path / "a.tif", crs="EPSG:4326")
    assert read(name, source_crs="EPSG:4326")[0] == read(name)[0]
    with pytest.raises(RequestError, match='EPSG:4326, which is not "EPSG:4258"'):
        read(name, source_crs="EPSG:4258")


@pytest.mark.parametrize(("crs", "radius"), [("EPSG:4326", 6378137), (MOON, 1737400),
                                             (MARS, 3396190), ("EPSG:25833", 6378137)])  # fmt: skip
def test_a_local_system_lies_about_the_middle_on_the_same_body(crs: str, radius: float) -> None:
    """A step to the east there is one of the radius in an arc, as long in metres; so to the north.

    The system of the middle is asked by rasterio alone.
    """
    source = CRS.from_string(crs)
    base = source if source.is_geographic else CRS.from_epsg(4258)
    lon, lat = 13.25, 51.5
    (x,), (y,) = transform(base, source, [lon], [lat])
    local = local_crs(source, x, y)
    assert local.is_projected and radius_of(local) == radius
    (east, there), (north, up) = transform(base, local, [lon, lon + 1e-3], [lat, lat])
    assert (east, north) == pytest.approx((0, 0), abs=1e-6)
    arc = math.radians(1e-3) * radius * math.cos(math.radians(lat))
    assert there == pytest.approx(arc, rel=4e-3) and abs(up) < 1e-2


@pytest.mark.parametrize("crs", [MOON, MARS])
def test_a_raster_of_another_body_is_reprojected_on_it(tmp_path: Path, crs: str) -> None:
    name = degrees(tmp_path / "a.tif", crs=crs)
    (note,) = read(name)[2]
    assert "--crs local to reproject" in note and "EPSG" not in note
    grid, values, _ = read(name, crs="local")
    side = math.radians(1e-3) * radius_of(CRS.from_string(crs))  # type: ignore[operator]
    assert side * math.cos(math.radians(40)) * 0.9 < grid.dx < side
    assert np.nanmean(values) == pytest.approx(COUNTS.mean(), rel=0.1)
    for target in ("EPSG:32613", "EPSG:4326", MOON if crs == MARS else MARS):
        with pytest.raises(RequestError, match="is on another celestial body") as caught:
            read(name, crs=target)
        assert len(caught.value.message) < 250 and "--crs local" in caught.value.hint


@pytest.mark.slow
def test_the_rule_on_degrees_advises_the_same(tmp_path: Path) -> None:
    site = tmp_path / "site.json"
    for crs, advice in ((MOON, "--crs local"), ("EPSG:4326", "--crs EPSG:32613")):
        assert run("import-terrain", degrees(tmp_path / "a.tif", crs=crs), site, "--max-error",
                   9, "--overwrite").code == 0  # fmt: skip
        found = run("validate", site)
        assert "TT116" in found.out and advice in found.out
        ran = run("export-sim", site, tmp_path / "sim", "--target", "mujoco")
        assert ran.code == 2 and advice in ran.err


@pytest.mark.parametrize(
    ("crs", "x", "y", "wanted"),
    [
        ("EPSG:4326", -9.3, -43.2, "EPSG:32729"),
        ("EPSG:4326", 350.7, 43.2, "EPSG:32629"),
        ("EPSG:4326", 10, 86, "local"),
        ("OGC:CRS84", 10, -81, "local"),
        ("ESRI:104903", 10, 50, "local"),
        ("IAU_2015:49900", 10, 50, "local"),
        (MARS, 10, 50, "local"),
        ({"proj": "longlat", "R": 1737400}, 10, 50, "local"),
        ({"proj": "longlat", "R": 6371000}, 10, 50, "EPSG:32632"),
    ],
)
def test_advice_has_metres_on_the_same_body(crs: Any, x: float, y: float, wanted: str) -> None:
    assert metric_crs(crs, x, y) == wanted
    if isinstance(crs, str):
        system = CRS.from_string(crs)
        assert metric_crs(system.to_wkt(), x, y) == wanted
        assert metric_crs(dict(system.to_dict(projjson=True)), x, y) == wanted


def test_classes_of_another_body_are_refused(tmp_path: Path) -> None:
    dem = degrees(tmp_path / "a.tif", crs=MOON)
    classes = degrees(tmp_path / "b.tif", COUNTS.astype(np.uint8), crs="EPSG:4326")
    ran = run("import-terrain", dem, tmp_path / "c.json", "--surfaces", classes, "--max-error", 1)
    assert ran.code == 2 and "another celestial body" in ran.err and len(ran.err) < 400


# --- the error, and where a terrain came from ----------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "error"),
    [(0, 151, 1), (-20, 480, 5), (0, 45.3, 0.2), (3, 3.5, 0.005), (7, 7, 0.001), (0, 999, 5),
     (0, 20, 0.2)],
)  # fmt: skip
def test_a_hundredth_of_the_relief_is_proposed(low: float, high: float, error: float) -> None:
    assert proposed_error(low, high) == error


@pytest.mark.slow
@pytest.mark.parametrize("form", ["rows", "grid"])
def test_the_error_that_was_taken_is_said_and_kept(tmp_path: Path, form: str) -> None:
    """344 of relief: 2, below 3.44."""
    name = rasters.geotiff(tmp_path / "dem.tif", COUNTS * 1.0, 10, (0, 60), crs="EPSG:32618",
                           band={"units": ("ft",)})  # fmt: skip
    assert np.ptp(COUNTS) == 264
    site = tmp_path / "site.json"
    ran = run("import-terrain", name, site, "--as", form)
    assert ran.code == 0
    assert "Within 2 ft, 1 % of the relief, rounded down" in ran.err
    ground = terratool.load(site)
    x, y = np.meshgrid(np.arange(9) * 10 + 5.0, np.arange(6)[::-1] * 10 + 5.0)
    assert np.abs(ground.height(x, y) - COUNTS).max() <= 2
    found = json.loads(run("info", site, "--json").out)["imported"]
    assert found.pop("method") and 0 <= found.pop("error") <= 2
    assert found == {"file": "dem.tif", "crs": "EPSG:32618", "unit": "ft", "wanted": 2.0}
    (line,) = [one for one in run("info", site).out.splitlines() if "imported from" in one]
    assert "dem.tif, EPSG:32618, heights in ft, within " in line
    run("format", site)
    assert json.loads(run("info", site, "--json").out)["imported"]["file"] == "dem.tif"
    assert run("validate", site, "--strict").code == 0 or form == "rows"


@pytest.mark.parametrize("value", [7, {}, {"file": 3}, {"file": "a", "wanted": -1}, None])
def test_what_others_write_there_is_passed_over(tmp_path: Path, value: object) -> None:
    site = tmp_path / "site.json"
    site.write_text(json.dumps({"size": 4, "x-source": value, "elemTypes": {"box": {"x": [1]}},
                                "elemTree": {"type": "box", "vScale": 1}}))  # fmt: skip
    ran = run("info", site)
    assert ran.code == 0 and "imported" not in ran.out
    assert json.loads(run("info", site, "--json").out)["imported"] is None


@pytest.mark.nightly
def test_places_from_the_corner_of_a_terrain_far_away(tmp_path: Path) -> None:
    """They are those of the world less the origin; without the option they lie outside."""
    site = tmp_path / "site.json"
    heights = np.repeat(COUNTS, 2, axis=0) / 1e3
    name = rasters.geotiff(tmp_path / "dem.tif", heights, (3, 2), (500000, 4500024),
                           crs="EPSG:32618")  # fmt: skip
    assert run("import-terrain", name, site, "--preset", "dry-sand").code == 0
    world = run("query", site, 500004.5, 4500003, 500022.5, 4500021, "--json")
    local = run("query", site, 4.5, 3, 22.5, 21, "--local", "--json")
    one, other = (json.loads(ran.out)["points"] for ran in (world, local))
    assert [(p["x"], p["y"]) for p in other] == [(4.5, 3), (22.5, 21)]
    assert [p["z"] for p in one] == [p["z"] for p in other] and one[0]["z"] != one[1]["z"]
    assert (
        run("query", site, 4.5, 3).code == 2 == run("query", site, 500004, 4500003, "--local").code
    )
    wheel = ("--wheel-radius", 0.3, "--wheel-width", 0.2, "--load", 300, "--json")
    at = (500004.5, 4500003)
    world = run("traversability", site, *wheel, "--route", *at, 500022.5, 4500018,
                "--from", *at, "--bounds", 500003, 4500002, 500027, 4500022)  # fmt: skip
    local = run("traversability", site, *wheel, "--route", 4.5, 3, 22.5, 18, "--local",
                "--from", 4.5, 3, "--bounds", 3, 2, 27, 22)  # fmt: skip
    assert world.code in (0, 1) and json.loads(world.out)["routes"]
    assert local.out == world.out
    assert run("traversability", site, *wheel, "--route", *at, 500022, 4500018, "--local").code == 2


def test_rgb_by_its_interpretation(tmp_path: Path) -> None:
    """Blue, green, red, as some cameras have it."""
    kinds = [ColorInterp.blue, ColorInterp.green, ColorInterp.red]
    bands = encoded("mapbox", HEIGHTS)[::-1]
    name = rasters.geotiff(tmp_path / "bgr.tif", bands, 10, (0, 60), colorinterp=kinds)
    assert np.abs(read(name, encoding="mapbox")[1] - HEIGHTS).max() <= 0.05 + 1e-9


def test_an_array_of_python_says_no_unit() -> None:
    made = terratool.import_primitive(COUNTS * 1.0, "a", transform=Affine(2, 0, 0, 0, -2, 12))
    assert made.unit == ""


@pytest.mark.parametrize("target", ["EPSG:32633", "local"])
def test_a_plane_is_reprojected_without_a_bias(tmp_path: Path, target: str) -> None:
    """GDAL alone is an eighth of a pixel off, all to one side."""
    x, y = np.meshgrid(15 + 1e-3 * (np.arange(120) + 0.5), 47 - 1e-3 * (np.arange(90) + 0.5))
    side = (1e-3, 1e-3)
    name = rasters.geotiff(
        tmp_path / "dem.tif", 1e4 * (x - 15) + 3e4 * (y - 47), side, (15, 47), crs="EPSG:4326"
    )
    with open_source(name, SourceOptions(crs=target)) as source:
        grid, heights = source.grid, source.read(0, source.grid.rows)
    column, row = np.meshgrid(np.arange(20, grid.columns - 20), np.arange(20, grid.rows - 20))
    from_x = grid.west + (column + 0.5) * grid.dx
    from_y = grid.south + (row + 0.5) * grid.dy
    lon, lat = transform(
        CRS.from_user_input(grid.crs), CRS.from_epsg(4326), from_x.ravel(), from_y.ravel()
    )
    wanted = 1e4 * (np.array(lon) - 15) + 3e4 * (np.array(lat) - 47)
    off = heights[row, column].ravel() - wanted
    assert np.abs(off).max() < 0.05 * 30  # of what heights change by in a pixel
    assert abs(off.mean()) < 0.002 * 30


def test_metres_have_no_system_of_feet(tmp_path: Path) -> None:
    """Or what reads an export would scale its heights again."""
    heights = np.arange(96.0).reshape(8, 12)
    name = rasters.geotiff(tmp_path / "dem.tif", heights, 10, crs="EPSG:32618+6360")
    grid, values, _ = read(name, units="m")
    assert grid.crs == "EPSG:32618"
    np.testing.assert_allclose(values, heights * 1200 / 3937, rtol=1e-12)
    assert read(name)[0].crs != "EPSG:32618"


@pytest.mark.parametrize("most", [130, 1000])
def test_white_of_a_pgm_is_what_it_says(tmp_path: Path, most: int) -> None:
    pixels = np.array([[0, most, 7], [most, 3, 0]], ">u2" if most > 255 else "u1")
    (tmp_path / "a.pgm").write_bytes(b"P5 # a map\n3 2\n%d\n" % most + pixels.tobytes())
    _, values, _ = read(str(tmp_path / "a.pgm"), size=(3, 2), height_range=(-10, 90))
    np.testing.assert_allclose(values, -10 + 100.0 * pixels.astype(float) / most)
