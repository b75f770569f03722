"""Every format holds the same pixels, or says by how much it cannot."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import rasterio
from rio_cogeo.cogeo import cog_validate

from terratool.errors import RequestError, WriteError
from terratool.io.geotiff import COMPRESSIONS, Compression
from terratool.raster.grid import Grid, grid_over
from tests.conftest import terrain_of
from tests.mosaics import export_dem, export_mosaic
from tests.programs import needs
from tests.raster.test_layers import SITE


def heights(folder: Path, resolution: float = 0.11) -> tuple[Any, Grid, np.ndarray]:
    """A terrain, a grid and its heights from a plain GeoTIFF."""
    terrain = terrain_of({**SITE, "crs": "EPSG:32633"})
    grid = grid_over(terrain, resolution)
    export_dem(terrain, grid, folder / "plain.tif", compress="none")
    with rasterio.open(folder / "plain.tif") as file:
        return terrain, grid, file.read(1)


def info(path: Path) -> Any:
    """What Debian's GDAL, older than the one inside rasterio, says of a file."""
    done = subprocess.run(
        ["gdalinfo", "-json", "-checksum", path], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


class TestGeoTiff:
    """Compressions, and the cloud-optimised kind."""

    @pytest.mark.parametrize("cog", [False, True])
    @pytest.mark.parametrize("name", COMPRESSIONS)
    def test_compressions_lose_nothing(self, tmp_path: Path, name: str, cog: bool) -> None:
        terrain, grid, plain = heights(tmp_path)
        path = tmp_path / "a.tif"
        report = export_dem(terrain, grid, path, compress=name, cog=cog)
        assert report.files[0].difference == 0
        with rasterio.open(path) as file:
            assert np.array_equal(file.read(1), plain, equal_nan=True)
            said = file.tags(ns="IMAGE_STRUCTURE").get("COMPRESSION", "NONE").lower()
            assert said == {"lerc": "lerc_zstd"}.get(name, name)
            assert file.tags()["AREA_OR_POINT"] == "Area"
            assert float(file.tags(1)["STATISTICS_MEAN"]) == report.files[0].statistics[0].mean
            assert file.crs.to_epsg() == 32633 and np.isnan(file.nodata)

    @pytest.mark.parametrize("cog", [False, True])
    def test_lerc_loses_no_more_than_allowed(self, tmp_path: Path, cog: bool) -> None:
        terrain, grid, plain = heights(tmp_path)
        path = tmp_path / "a.tif"
        report = export_dem(terrain, grid, path, compress="lerc", max_error=0.01, cog=cog)
        with rasterio.open(path) as file:
            pixels = file.read(1)
        assert np.array_equal(np.isnan(pixels), np.isnan(plain))
        assert 0.002 < np.nanmax(abs(pixels - plain)) <= 0.01 == report.files[0].difference

    @pytest.mark.parametrize(
        "layers", [["height", "slope"], ["surface"], ["color"], ["aspect"], ["hillshade"]]
    )
    def test_cogs_are_valid(self, tmp_path: Path, layers: list[str]) -> None:
        """As rio-cogeo sees them, with overviews, and the same pixels."""
        terrain = terrain_of(SITE)
        grid = grid_over(terrain, 0.01)
        export_dem(terrain, grid, tmp_path / "plain.tif", layers)
        export_dem(terrain, grid, tmp_path / "cog.tif", layers, cog=True)
        valid, errors, warnings = cog_validate(tmp_path / "cog.tif", strict=True)
        assert (valid, errors, warnings) == (True, [], [])
        with (
            rasterio.open(tmp_path / "plain.tif") as plain,
            rasterio.open(tmp_path / "cog.tif") as cog,
        ):
            assert np.array_equal(plain.read(), cog.read(), equal_nan=plain.dtypes[0] != "uint8")
            assert cog.overviews(1) == [2, 4]
            assert cog.descriptions == plain.descriptions and cog.units == plain.units
            assert cog.colorinterp == plain.colorinterp

    def test_overviews_of_surfaces_are_surfaces(self, tmp_path: Path) -> None:
        """A mean of two numbers of surfaces would be a third surface."""
        terrain = terrain_of(SITE)
        export_dem(terrain, grid_over(terrain, 0.01), tmp_path / "a.tif", ["surface"], cog=True)
        with rasterio.open(tmp_path / "a.tif", overview_level=0) as file:
            coarse = file.read(1)
        grid = grid_over(terrain, 0.02)
        export_dem(terrain, grid, tmp_path / "b.tif", ["surface"])
        with rasterio.open(tmp_path / "b.tif") as file:
            assert (coarse == file.read(1)).mean() > 0.99

    @needs("gdalinfo")
    @pytest.mark.parametrize("cog", [False, True])
    @pytest.mark.parametrize("name", COMPRESSIONS)
    def test_gdalinfo_agrees(self, tmp_path: Path, name: str, cog: bool) -> None:
        """Corners, CRS, statistics, nodata, and the checksum of the pixels themselves."""
        terrain, grid, plain = heights(tmp_path)
        path = tmp_path / "a.tif"
        export_dem(terrain, grid, path, compress=name, cog=cog)
        told, (band,) = info(path), info(path)["bands"]
        west, south, east, north = grid.bounds
        assert told["cornerCoordinates"]["lowerLeft"] == pytest.approx([west, south])
        assert told["cornerCoordinates"]["upperRight"] == pytest.approx([east, north])
        assert "32633" in told["coordinateSystem"]["wkt"]
        assert told["metadata"][""]["AREA_OR_POINT"] == "Area"
        assert (band["type"], band["noDataValue"], band["unit"]) == ("Float32", "NaN", "m")
        assert band["checksum"] == info(tmp_path / "plain.tif")["bands"][0]["checksum"]
        assert band["minimum"] == pytest.approx(np.nanmin(plain), abs=1e-3)
        assert float(band["metadata"][""]["STATISTICS_VALID_PERCENT"]) == pytest.approx(
            100 * (~np.isnan(plain)).mean(), rel=1e-3
        )

    @pytest.mark.parametrize(
        ("name", "error", "words"),
        [
            ("zip", 0, "no compression 'zip'"),
            ("zstd", 0.1, "makes no error"),
            ("lerc", -1, "largest error is -1"),
            ("lerc", float("nan"), "largest error is nan"),
        ],
    )
    def test_refused(self, name: str, error: float, words: str) -> None:
        with pytest.raises(RequestError, match=words):
            Compression(name, error)


class TestOthers:
    """Formats by suffix."""

    @pytest.mark.parametrize("dtype", ["float32", "float64"])
    def test_asc_is_exact(self, tmp_path: Path, dtype: str) -> None:
        """Read by hand: six lines of header, then numbers from the north."""
        terrain, grid, _ = heights(tmp_path)
        export_dem(terrain, grid, tmp_path / "plain.tif", dtype=dtype, overwrite=True)
        with rasterio.open(tmp_path / "plain.tif") as file:
            plain = file.read(1)
        report = export_dem(terrain, grid, tmp_path / "a.asc", dtype=dtype)
        lines = (tmp_path / "a.asc").read_text().splitlines()
        header = dict(line.split() for line in lines[:6])
        assert (int(header["ncols"]), int(header["nrows"])) == (grid.width, grid.height)
        corner = [float(header[key]) for key in ("xllcorner", "yllcorner", "cellsize")]
        assert corner == pytest.approx([-3, 20, 0.11])
        assert float(header["NODATA_value"]) == -9999
        pixels = np.array([[float(n) for n in line.split()] for line in lines[6:]]).astype(dtype)
        assert np.array_equal(np.where(pixels == -9999, np.nan, pixels), plain, equal_nan=True)
        assert report.files[0].difference == 0

    def test_npy_is_exact(self, tmp_path: Path) -> None:
        """One band has two axes, several have three."""
        terrain, grid, plain = heights(tmp_path)
        export_dem(terrain, grid, tmp_path / "a.npy")
        assert np.array_equal(np.load(tmp_path / "a.npy"), plain, equal_nan=True)
        export_dem(terrain, grid, tmp_path / "b.npy", ["slope", "height"])
        both = np.load(tmp_path / "b.npy")
        assert both.shape == (2, grid.height, grid.width) and both.dtype == np.float32
        assert np.array_equal(both[1], plain, equal_nan=True)

    def test_png_says_its_scale(self, tmp_path: Path) -> None:
        """65,535 levels over the range of the heights, 0 for none; half a level is lost."""
        terrain, grid, plain = heights(tmp_path)
        report = export_dem(terrain, grid, tmp_path / "a.png")
        (written,) = report.files
        with rasterio.open(tmp_path / "a.png") as file:
            pixels = file.read(1)
            assert file.dtypes == ("uint16",) and file.nodata == 0
            assert file.scales == pytest.approx((written.coding.scale,), rel=1e-12)
            assert file.offsets == pytest.approx((written.coding.offset,), rel=1e-12)
        assert np.array_equal(pixels == 0, np.isnan(plain))
        ground = pixels > 0
        assert (pixels[ground].min(), pixels.max()) == (1, 65535)
        read = pixels[ground] * written.coding.scale + written.coding.offset
        difference = abs(read - plain[ground]).max()
        assert 0 < difference <= written.difference * (1 + 1e-6)
        assert written.difference == pytest.approx(np.ptp(plain[ground]) / 65534 / 2, rel=1e-6)

    def test_png_of_a_level_place(self, tmp_path: Path) -> None:
        terrain = terrain_of(
            {"size": 4, "elemTypes": {"p": {"x": [3]}}, "elemTree": {"type": "p", "vScale": 1}}
        )
        (written,) = export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.png").files
        with rasterio.open(tmp_path / "a.png") as file:
            assert np.all(file.read(1) * written.coding.scale + written.coding.offset == 3)
        assert written.difference == 0

    @pytest.mark.parametrize("layer", ["surface", "color", "hillshade"])
    def test_png_of_bytes_is_exact(self, tmp_path: Path, layer: str) -> None:
        terrain, grid, _ = heights(tmp_path)
        for suffix in ("tif", "png"):
            export_dem(terrain, grid, tmp_path / f"a.{suffix}", [layer])
        with (
            rasterio.open(tmp_path / "a.tif") as tif,
            rasterio.open(tmp_path / "a.png") as png,
        ):
            assert png.driver == "PNG"
            assert np.array_equal(tif.read(), png.read())
            if layer == "surface":
                assert png.colormap(1)[1] == (194, 178, 128, 255)

    @pytest.mark.parametrize("suffix", ["img", "bil", "nc", "xyz", "rst", "sdat"])
    def test_other_drivers(self, tmp_path: Path, suffix: str) -> None:
        """Whatever GDAL writes: what it cannot keep exactly is said."""
        terrain, grid, plain = heights(tmp_path, 0.5)
        (written,) = export_dem(terrain, grid, tmp_path / f"a.{suffix}").files
        with rasterio.open(tmp_path / f"a.{suffix}") as file:
            pixels = file.read(1).astype(np.float64)
            nodata = written.coding.nodata if file.nodata is None else file.nodata
        pixels[pixels == nodata] = np.nan
        assert np.array_equal(np.isnan(pixels), np.isnan(plain))
        assert np.nanmax(abs(pixels - plain)) <= written.difference + 1e-12

    def test_a_degree_of_hgt(self, tmp_path: Path) -> None:
        """A tile of points as the Shuttle mission left them: whole metres, only where it fits."""
        terrain = terrain_of(
            {"size": [1.01, 1.01], "origin": [6.995, 45.995], "crs": "EPSG:4326",
             "elemTypes": {"p": {"combine": "sum", "x": [0, 400], "y": [0, 90]}},
             "elemTree": {"type": "p", "vScale": 1}}
        )  # fmt: skip
        step = 1 / 1200
        grid = Grid(7 - step / 2, 46 - step / 2, step, 1201, 1201)
        (written,) = export_dem(terrain, grid, tmp_path / "N46E007.hgt").files
        points = np.fromfile(tmp_path / "N46E007.hgt", ">i2").reshape(1201, 1201)
        x, y = 7 + 300 * step, 46 + 900 * step
        assert abs(points[300, 300] - terrain.height(x, y)) <= 0.5 == written.difference
        for other, name in (
            (grid, "N46E008.hgt"),
            (grid, "points.hgt"),
            (Grid(7, 46, step, 1201, 1201), "N46E007.hgt"),
            (grid_over(terrain, 0.1), "N46E007.hgt"),
        ):
            with pytest.raises(RequestError, match="hgt is a degree in EPSG:4326"):
                export_dem(terrain, other, tmp_path / name, overwrite=True)
        high = terrain_of(
            {"size": [1.01, 1.01], "origin": [6.995, 45.995], "crs": "EPSG:4326",
             "elemTypes": {"p": {"x": [1]}},
             "elemTree": {"type": "p", "vScale": 1, "vOffset": 40000}}
        )  # fmt: skip
        with pytest.raises(RequestError, match="not between -32768 and 32767"):
            export_dem(high, grid, tmp_path / "N46E007.hgt", overwrite=True)

    @pytest.mark.parametrize(
        ("name", "layers", "words"),
        [
            ("a", ["height"], "no suffix"),
            ("a.foo", ["height"], "no raster format has the suffix '.foo'"),
            ("a.vrt", ["height"], "no raster format"),
            ("a.png", ["height", "slope"], "holds one band"),
            ("a.asc", ["normal"], "holds one band, but these are 3"),
            ("a.asc", ["color"], "holds one band, but these are 3"),
            ("a.tif", [], "No layer is asked for"),
        ],
    )
    def test_refused(self, tmp_path: Path, name: str, layers: list[str], words: str) -> None:
        terrain = terrain_of(SITE)
        with pytest.raises(RequestError, match=words):
            export_dem(terrain, grid_over(terrain, 1), tmp_path / name, layers)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.nightly
    def test_what_a_driver_refuses_is_a_sentence(self, tmp_path: Path) -> None:
        """And leaves nothing behind, nor of the files that go with it."""
        terrain = terrain_of(SITE)
        for name, layers, words in (
            ("a.jpg", ["height"], r"a\.jpg: cannot be written \(JPEG driver doesn't"),
            ("a.jpg", ["color"], r"a\.jpg: its format does not keep the colors"),
            ("a.gpkg", ["height"], r"a\.gpkg: cannot be written"),
            ("a.bil", ["surface"], r"a\.bil: cannot be written \(GDAL does not say why\)"),
            ("a.dat", ["height"], r"a\.dat: its format does not keep"),
            ("a.map", ["surface"], r"a\.map: its format does not keep"),
        ):
            with pytest.raises(WriteError, match=words):
                export_dem(terrain, grid_over(terrain, 0.7), tmp_path / name, layers)
            assert list(tmp_path.iterdir()) == [], name

    @pytest.mark.parametrize("crs", ["EPSG:2056", "EPSG:27700", "IAU_2015:30100", "EPSG:4326"])
    @pytest.mark.parametrize("suffix", ["asc", "png", "img", "bil", "nc"])
    def test_any_reference_system_is_written_or_refused(
        self, tmp_path: Path, suffix: str, crs: str
    ) -> None:
        """GDAL's netCDF ends its process where it does not know a projection; ours goes on."""
        terrain = terrain_of({**SITE, "crs": crs})
        path = tmp_path / f"a.{suffix}"
        try:
            export_dem(terrain, grid_over(terrain, 0.7), path)
        except WriteError as error:  # as of GDAL 3.10 of EPSG:2056
            assert suffix == "nc" and "a.nc: cannot be written" in str(error)
            assert list(tmp_path.iterdir()) == []
            return
        with rasterio.open(path) as file:
            assert file.crs is not None and file.crs.is_geographic == (
                crs[-5:] in (":4326", "30100")
            )

    def test_a_height_that_stands_for_none_is_refused(self, tmp_path: Path) -> None:
        terrain = terrain_of(
            {"size": 4, "elemTypes": {"p": {"x": [1]}},
             "elemTree": {"type": "p", "vScale": 1, "vOffset": -10000}}
        )  # fmt: skip
        with pytest.raises(RequestError, match="A number is -9999, which stands for none"):
            export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.asc")
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.slow
    def test_png_of_many_surfaces(self, tmp_path: Path) -> None:
        """Two bytes then, without colours."""
        terrain = terrain_of(
            {"size": 20, "surfTypes": {f"s{k}": {} for k in range(300)},
             "elemTypes": {"p": {"x": [1]}}, "elemTree": {"type": "p", "surface": "s299"}}
        )  # fmt: skip
        export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.png", ["surface"])
        with rasterio.open(tmp_path / "a.png") as file:
            assert file.dtypes == ("uint16",) and (file.read(1) == 300).all()

    def test_a_cog_is_a_tif(self, tmp_path: Path) -> None:
        terrain = terrain_of(SITE)
        with pytest.raises(RequestError, match=r"cloud-optimised GeoTIFF is a \.tif"):
            export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.png", cog=True)


def test_companions_of_an_older_file_are_removed(tmp_path: Path) -> None:
    """GDAL would believe its statistics; and companions of strangers are kept."""
    terrain, grid, _ = heights(tmp_path, 0.5)
    (tmp_path / "plain.tif.aux.xml").write_text("<PAMDataset/>")
    (tmp_path / "plain.tif.ovr").write_text("old")
    export_dem(terrain, grid, tmp_path / "plain.tif", overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["plain.tif"]
    with pytest.raises(RequestError, match="is compressed as one likes"):
        export_dem(terrain, grid, tmp_path / "a.png", compress="lerc", max_error=0.1)
    (tmp_path / "a.prj").write_text("mine")
    with pytest.raises(WriteError, match=r"a\.prj: exists already"):
        export_dem(terrain, grid, tmp_path / "a.asc")
    assert (tmp_path / "a.prj").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.prj", "plain.tif"]
    export_dem(terrain, grid, tmp_path / "a.asc", overwrite=True)
    assert "32633" in (tmp_path / "a.prj").read_text() or "UTM" in (tmp_path / "a.prj").read_text()
    nowhere = terrain_of(SITE)
    export_dem(nowhere, grid, tmp_path / "a.asc", overwrite=True)
    assert not (tmp_path / "a.prj").exists()


def test_control_characters_of_json_do_not_break_xml(tmp_path: Path) -> None:
    """Names and descriptions may hold them; XML may not."""
    terrain = terrain_of(
        {"size": 4, "descr": "a\u0001b\u0000c", "surfTypes": {"d\u0002<e>": {}},
         "elemTypes": {"p": {"x": [1]}}, "elemTree": {"type": "p", "surface": "d\u0002<e>"}}
    )  # fmt: skip
    export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.tif", ["surface", "height"])
    tree = ElementTree.parse(tmp_path / "a.tif.aux.xml")
    assert [name.text for name in tree.iter("Category")] == ["none", "d\ufffd<e>"]
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.tags()["TIFFTAG_IMAGEDESCRIPTION"] == "a\ufffdb\ufffdc"
    export_mosaic(terrain, grid_over(terrain, 1), tmp_path / "tiles", None, ["surface"])
    with rasterio.open(tmp_path / "tiles" / "mosaic.vrt") as file:
        assert (file.read(1) == 1).all()
