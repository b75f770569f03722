"""What stands for none, what bands are measured in, and means of directions."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st

from terratool import __version__
from terratool.errors import RequestError
from terratool.io.bands import BandStatistics
from terratool.raster.grid import grid_over
from terratool.raster.statistics import band_statistics
from tests.commands import call
from tests.conftest import terrain_of
from tests.mosaics import SITE, export_dem, export_mosaic


def pixels(path: Path) -> tuple[np.ndarray, Any]:
    with rasterio.open(path) as file:
        return file.read(), file.nodata


@pytest.mark.parametrize("name", ["a.tif", "a.img", "a.asc", "a.npy", "a.nc"])
def test_a_number_stands_for_none(tmp_path: Path, name: str) -> None:
    """The other pixels are those of a file with NaN, and the statistics know of no such number."""
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.5)
    export_dem(terrain, grid, tmp_path / "nan.tif")
    plain, none = pixels(tmp_path / "nan.tif")
    assert math.isnan(none) and np.isnan(plain).any()
    report = export_dem(terrain, grid, tmp_path / name, nodata=-32767.5)
    if name == "a.npy":
        found = np.load(tmp_path / name)[None]
    else:
        found, none = pixels(tmp_path / name)
        assert none == -32767.5
    assert np.array_equal(found, np.where(np.isnan(plain), np.float32(-32767.5), plain))
    assert report.files[0].statistics[0].low == np.nanmin(plain)
    assert report.nodata == np.isnan(plain).sum()


@pytest.mark.parametrize("name", ["a.asc", "a.xyz", "a.png"])
def test_not_a_number_where_a_format_has_none(tmp_path: Path, name: str) -> None:
    """What cannot be held is refused, and not written as something else."""
    terrain = terrain_of(SITE)
    with pytest.raises(RequestError, match="for none"):
        export_dem(terrain, grid_over(terrain, 0.1), tmp_path / name, nodata=float("nan"))
    assert not list(tmp_path.iterdir())
    export_dem(terrain, grid_over(terrain, 0.1), tmp_path / "a.tif", nodata=float("nan"))


def test_of_mosaics_and_cloud_optimised_files(tmp_path: Path) -> None:
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.01)
    export_dem(terrain, grid, tmp_path / "a.tif", ["height", "slope"], nodata=-9999)
    export_dem(terrain, grid, tmp_path / "b.tif", ["height", "slope"], nodata=-9999, cog=True)
    export_mosaic(terrain, grid, tmp_path / "m", None, ["height", "slope"], nodata=-9999,
                  tile_size=512)  # fmt: skip
    one, none = pixels(tmp_path / "a.tif")
    assert none == -9999 and (one == -9999).any() and not np.isnan(one).any()
    for other in (tmp_path / "b.tif", tmp_path / "m" / "mosaic.vrt"):
        found, none = pixels(other)
        assert none == -9999 and np.array_equal(found, one)
    with rasterio.open(tmp_path / "b.tif", overview_level=0) as file:
        coarse = file.read(1)
    assert coarse[coarse != -9999].min() >= one[0][one[0] != -9999].min()  # none is averaged in
    # the same tiles with another number are other tiles
    report = export_mosaic(terrain, grid, tmp_path / "m", None, ["height", "slope"], nodata=-9999,
                           tile_size=512)  # fmt: skip
    assert report.tiles is not None and report.tiles.made == 0
    with pytest.raises(Exception, match="nodata"):
        export_mosaic(terrain, grid, tmp_path / "m", None, ["height", "slope"], tile_size=512)


@pytest.mark.parametrize(
    ("name", "layers", "nodata", "words"),
    [
        ("a.tif", ["surface"], -1, "about layers of numbers"),
        ("a.tif", ["height"], math.inf, "Infinity cannot stand for none"),
        ("a.tif", ["height"], 0.1, "No float32 is 0.1"),
        ("a.tif", ["height"], 1e300, "No float32 is 1e"),
        ("a.png", ["height"], -1, "holds whole numbers"),
        ("a.tif", ["height"], 2, "A number is 2, which stands for none"),
    ],
)
def test_numbers_that_cannot_stand_for_none(
    tmp_path: Path, name: str, layers: list[str], nodata: float, words: str
) -> None:
    """The last of them is a height of the terrain: no file appears."""
    definition = {**SITE, "elemTypes": {**SITE["elemTypes"], "two": {"x": [2]}}}
    definition["elemTree"] = {"type": "two", "vScale": 1}
    terrain = terrain_of(definition)
    with pytest.raises(RequestError, match=words):
        export_dem(terrain, grid_over(terrain, 0.5), tmp_path / name, layers, nodata=nodata)
    assert list(tmp_path.iterdir()) == []


def test_the_command_says_it(tmp_path: Path, saved: Any) -> None:
    source = saved(SITE)
    ran = call("export-dem", source, tmp_path / "a.tif", "--resolution", 1, "--nodata", -9999)
    assert f"{tmp_path / 'a.tif'}: float32, -9999 for none" in ran.out
    ran = call("export-dem", source, tmp_path / "b.tif", "--resolution", 1, "--layer", "sonar",
               "--layer", "normal", "--layer", "surface", "--json")  # fmt: skip
    first, second = json.loads(ran.out)["files"]
    assert [band["unit"] for band in first["bands"]] == ["1"] * 4
    assert (first["nodata_value"], second["nodata_value"]) == ("nan", 0)
    with rasterio.open(tmp_path / "b.tif") as file:
        assert file.units == ("1",) * 4  # shares and ratios, as UDUNITS has it
        assert file.descriptions[0] == "sonar reflectance"
        assert file.tags()["TIFFTAG_SOFTWARE"] == f"terratool {__version__}"


@pytest.mark.nightly
def test_each_file_says_who_wrote_it_but_not_when_or_where(tmp_path: Path) -> None:
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.5)
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        for name in ("a.tif", "a.nc", "a.img", "a.png", "a.asc"):
            export_dem(terrain, grid, folder / name)
            with rasterio.open(folder / name) as file:
                told = file.tags() | file.tags(ns="NC_GLOBAL")
            assert f"terratool {__version__}" in told.values()
            assert not any(str(tmp_path) in value for value in told.values())
        export_mosaic(terrain, grid, folder / "m", tile_size=512)
        with rasterio.open(folder / "m" / "mosaic.vrt") as file:
            assert file.tags()["TIFFTAG_SOFTWARE"] == f"terratool {__version__}"
    for path in (tmp_path / "one").glob("a.*"):
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes(), path.name


directions = st.lists(st.floats(0, 359.99) | st.just(math.nan), min_size=1, max_size=60)


class TestDirections:
    """Their mean lies on the shorter side."""

    @pytest.mark.parametrize(
        ("angles", "mean"),
        [([350, 10], 0), ([350, 20], 5), ([80, 100], 90), ([359, 1, 300, 60], 0), ([270], 270)],
    )
    def test_known_means(self, angles: list[float], mean: float) -> None:
        found = band_statistics(np.array([angles], np.float32), directions=True)
        assert (found.mean + 180) % 360 == pytest.approx((mean + 180) % 360, abs=1e-5)
        assert 0 <= found.mean < 360

    @given(directions, directions)
    def test_as_scipy_has_them(self, one: list[float], other: list[float]) -> None:
        """Of windows together, too; what has no mean is left out."""
        stats = pytest.importorskip("scipy.stats")
        parts = [band_statistics(np.array([a]), directions=True) for a in (one, other)]
        found = sum(parts, BandStatistics())
        known = np.array([a for a in one + other if not math.isnan(a)])
        assert found.count == len(known)
        if not len(known):
            return
        length = abs(np.exp(1j * np.radians(known)).mean())
        if length < 1e-3:
            return
        wanted = stats.circmean(known, high=360)
        assert abs((found.mean - wanted + 180) % 360 - 180) < 1e-6
        wanted = stats.circstd(known, high=360)
        assert found.deviation == pytest.approx(wanted, abs=1e-4)

    def test_of_a_file(self, tmp_path: Path) -> None:
        """A slope that falls a little to the west of north, and one a little to the east."""
        terrain = terrain_of({
            "size": [20, 10],
            "elemTypes": {"roof": {"combine": "sum", "x": [0, 0.2, 0], "y": [1, 0]}},
            "elemTree": {"type": "roof", "vScale": 1},
        })  # fmt: skip
        report = export_dem(terrain, grid_over(terrain, 0.5), tmp_path / "a.tif", ["aspect"])
        found, _ = pixels(tmp_path / "a.tif")
        assert set(np.unique(found.round())) == {349, 11}
        (part,) = report.files[0].statistics
        assert min(part.mean, 360 - part.mean) < 1e-3
        assert part.deviation == pytest.approx(math.degrees(math.atan(0.2)), rel=0.02)
        with rasterio.open(tmp_path / "a.tif") as file:
            assert float(file.tags(1)["STATISTICS_MEAN"]) == part.mean
