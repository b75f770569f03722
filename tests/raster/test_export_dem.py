"""The DEM is the query at its pixel centres, and other programs read it."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given
from hypothesis import strategies as st

from terratool import output
from terratool.errors import DefinitionError, RequestError, WriteError
from terratool.io.geotiff import gdal_write_errors
from terratool.io.opening import gdal_errors
from terratool.raster import export
from terratool.raster.geotiff import crs_of
from terratool.raster.grid import Grid, Window, default_resolution, grid_over
from tests.commands import call
from tests.conftest import terrain_of
from tests.mosaics import SITE, export_dem
from tests.programs import needs


def read(path: Path) -> tuple[np.ndarray, Any]:
    with rasterio.open(path) as file:
        return file.read(1), file.profile


@pytest.mark.parametrize("resolution", [0.25, 0.7, 2, 3, 5])
def test_every_pixel_is_the_height_at_its_centre(tmp_path: Path, resolution: float) -> None:
    """Also where the resolution divides neither side."""
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, resolution)
    written = export_dem(terrain, grid, tmp_path / "a.tif")
    pixels, profile = read(tmp_path / "a.tif")
    rows, columns = np.indices(pixels.shape)
    x, y = rasterio.transform.xy(profile["transform"], rows.ravel(), columns.ravel())
    wanted = terrain.height(np.array(x), np.array(y)).astype(np.float32).reshape(pixels.shape)
    assert np.array_equal(pixels, wanted, equal_nan=True)
    assert written.nodata == np.isnan(pixels).sum()
    (part,) = written.files[0].statistics
    assert (part.low, part.high) == (np.nanmin(pixels), np.nanmax(pixels))
    exactly = pixels.astype(np.float64)
    assert part.mean == pytest.approx(np.nanmean(exactly), rel=1e-12)
    assert part.deviation == pytest.approx(np.nanstd(exactly), rel=1e-9)
    west, south, east, north = grid.bounds
    assert (west, south) == (500000, 4649776)
    assert abs(east - 500012) <= resolution / 2 and abs(north - 4649784) <= resolution / 2


def test_the_file_says_what_it_is(tmp_path: Path) -> None:
    terrain = terrain_of(SITE)
    export_dem(terrain, grid_over(terrain, 0.01), tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.driver == "GTiff" and file.dtypes == ("float32",)
        assert file.crs.to_epsg() == 32633
        assert np.isnan(file.nodata)
        assert file.transform[:6] == (0.01, 0, 500000, 0, -0.01, 4649784)
        assert file.block_shapes == [(512, 512)]
        assert file.tags(ns="IMAGE_STRUCTURE")["COMPRESSION"] == "ZSTD"
        assert file.tags(ns="IMAGE_STRUCTURE")["PREDICTOR"] == "3"
        assert file.tags()["AREA_OR_POINT"] == "Area"


def test_bytes_are_the_same_from_run_to_run(tmp_path: Path) -> None:
    """With several threads and several windows."""
    terrain = terrain_of(SITE)
    grid = grid_over(terrain, 0.005)
    for name in "ab":
        export_dem(terrain, grid, tmp_path / f"{name}.tif", threads=3)
    assert (tmp_path / "a.tif").read_bytes() == (tmp_path / "b.tif").read_bytes()


@needs("gdalinfo")
def test_gdalinfo_reads_it(tmp_path: Path) -> None:
    """Debian's GDAL is older than the one inside rasterio."""
    terrain = terrain_of(SITE)
    written = export_dem(terrain, grid_over(terrain, 0.25), tmp_path / "a.tif")
    told = subprocess.run(
        ["gdalinfo", "-json", "-stats", tmp_path / "a.tif"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    info = json.loads(told.stdout)
    band = info["bands"][0]
    assert info["size"] == [48, 32]
    assert info["cornerCoordinates"]["lowerLeft"] == [500000, 4649776]
    assert info["cornerCoordinates"]["upperRight"] == [500012, 4649784]
    assert "32633" in info["coordinateSystem"]["wkt"]
    assert (band["type"], band["noDataValue"]) == ("Float32", "NaN")
    (part,) = written.files[0].statistics
    assert band["minimum"] == pytest.approx(part.low, abs=1e-3)
    assert band["maximum"] == pytest.approx(part.high, abs=1e-3)


class TestGrid:
    """Resolution and bounds."""

    def test_default_is_a_tenth_of_the_smallest_cell(self) -> None:
        assert default_resolution(terrain_of(SITE)) == (0.2, "a tenth of the smallest cell")

    def test_default_is_bounded(self) -> None:
        small = {**SITE["elemTree"], "cells": [1200, 800]}
        terrain = terrain_of({**SITE, "elemTree": small})
        resolution, why = default_resolution(terrain)
        assert resolution == 12 / 4095
        assert why.startswith("4095 pixels on the longer side; a tenth of the smallest cell")
        grid = grid_over(terrain, resolution)
        assert grid.bounds == pytest.approx(terrain.bounds, abs=1e-6)  # whole pixels on both sides
        assert (grid.width, grid.height) == (4095, 2730)

    def test_default_fits_a_long_narrow_terrain(self) -> None:
        road = {**SITE["elemTree"], "cells": [10000, 1], "children": []}
        terrain = terrain_of({**SITE, "size": [50000, 5], "elemTree": {**road, "children": [
            {"type": "box", "cellX": 7, "cellY": 0}]}})  # fmt: skip
        resolution, _ = default_resolution(terrain)
        assert grid_over(terrain, resolution).height == 1

    def test_bounds_partly_outside_carry_nodata(self, tmp_path: Path) -> None:
        terrain = terrain_of(SITE)
        grid = grid_over(terrain, 1, (499998, 4649780, 500004, 4649790))
        assert (grid.height, grid.width) == (10, 6)
        written = export_dem(terrain, grid, tmp_path / "a.tif")
        pixels, _ = read(tmp_path / "a.tif")
        ground = np.zeros((10, 6), bool)
        ground[6:, 2:] = True  # the terrain ends at north 4649784 and begins at east 500000
        ground[6:8, 2:4] = False  # the hole
        assert np.array_equal(~np.isnan(pixels), ground)
        assert written.nodata == 60 - 12

    def test_one_pixel(self, tmp_path: Path) -> None:
        terrain = terrain_of(SITE)
        export_dem(terrain, grid_over(terrain, 12), tmp_path / "a.tif")
        pixels, _ = read(tmp_path / "a.tif")
        assert pixels.tolist() == [[terrain.height(500006, 4649782)]]

    @pytest.mark.parametrize(
        ("resolution", "bounds", "words"),
        [
            (0, None, "resolution is 0"),
            (-1, None, "resolution is -1"),
            (float("nan"), None, "resolution is nan"),
            (40, None, "no pixel has its centre"),
            (1e-9, None, "more than a file can hold"),
            (1, (0, 0, 1, 1), "miss the terrain"),
            (1, (500012, 4649776, 500020, 4649780), "miss the terrain"),
            (1, (500003, 4649776, 500001, 4649780), "are empty"),
            (1, (float("nan"), 4649776, 500001, 4649780), "bounds are nan"),
        ],
    )
    def test_refused(self, resolution: float, bounds: Any, words: str) -> None:
        with pytest.raises(RequestError, match=re.escape(words)):
            grid_over(terrain_of(SITE), resolution, bounds)

    @given(st.integers(1, 5000), st.floats(1e-3, 1e3))
    def test_a_resolution_that_divides_gives_whole_pixels(self, count: int, step: float) -> None:
        """However the quotient rounds."""
        terrain = terrain_of({**SITE, "origin": [0, 0], "size": [count * step, step]})
        grid = grid_over(terrain, step)
        assert (grid.width, grid.height) == (count, 1)

    def test_rows_run_from_the_north(self) -> None:
        grid = Grid(10, 20, 0.5, 4, 3)
        assert grid.rows(Window(1, 0, 3, 1)).tolist() == [21.25, 20.75, 20.25]
        assert grid.columns(Window(0, 1, 1, 2)).tolist() == [10.75, 11.25]


class TestWholeOrNotAtAll:
    """Nothing half-written, ever."""

    def test_an_existing_file_is_kept(self, tmp_path: Path, saved: Callable[..., Path]) -> None:
        out = tmp_path / "a.tif"
        out.write_text("mine")
        refused = call("export-dem", saved(SITE), out)
        assert refused.code == 3 and "--overwrite" in refused.err
        assert out.read_text() == "mine"
        assert call("export-dem", saved(SITE), out, "--overwrite").code == 0
        assert read(out)[0].shape == (40, 60)

    def test_what_stands_behind_a_name_is_respected(
        self, tmp_path: Path, saved: Callable[..., Path]
    ) -> None:
        """The definition itself and what is no regular file are kept; a link keeps being one."""
        source = saved(SITE)
        text = source.read_bytes()
        os.mkfifo(tmp_path / "pipe")
        for out in (source, tmp_path / "pipe"):
            assert call("export-dem", source, out, "--overwrite").code == 3
        assert source.read_bytes() == text and (tmp_path / "pipe").is_fifo()
        (tmp_path / "link.tif").symlink_to(tmp_path / "real.tif")
        assert call("export-dem", source, tmp_path / "link.tif").code == 0
        assert (tmp_path / "link.tif").is_symlink() and read(tmp_path / "real.tif")[0].size

    def test_a_failure_in_the_middle_leaves_nothing(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(*_: Any) -> Any:
            yield from ()
            raise KeyboardInterrupt

        monkeypatch.setattr(export, "prefetch", fail)
        terrain = terrain_of(SITE)
        with pytest.raises(KeyboardInterrupt):
            export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.tif")
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    def test_a_signal_leaves_nothing(
        self, tmp_path: Path, saved: Callable[..., Path], number: signal.Signals
    ) -> None:
        """The signal is sent when the temporary file is there, long before it is complete."""
        folder = tmp_path / "out"
        folder.mkdir()
        command = [sys.executable, "-m", "terratool", "export-dem", saved(SITE), folder / "a.tif"]
        with subprocess.Popen(
            [*command, "--resolution", "0.0005"], stderr=subprocess.PIPE, text=True
        ) as process:
            until = time.monotonic() + 60
            while not list(folder.iterdir()) and process.poll() is None:
                assert time.monotonic() < until
                os.sched_yield()
            process.send_signal(number)
            _, told = process.communicate(timeout=60)
        assert process.returncode == 128 + number
        assert "Traceback" not in told
        assert list(folder.iterdir()) == []

    @pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit])
    @pytest.mark.parametrize("error", [SystemError, ValueError])
    def test_an_interruption_within_gdal_is_one(
        self, tmp_path: Path, kind: type[BaseException], error: type[Exception]
    ) -> None:
        """C code that a signal comes to ends by an error of its own."""
        for block in (gdal_write_errors(tmp_path / "a.tif"), gdal_errors("a.tif")):
            with pytest.raises(kind), block:
                raise error("returned a result with an exception set") from kind(143)
        with pytest.raises(WriteError), gdal_write_errors(tmp_path / "a.tif"):
            raise error("no space") from RuntimeError()

    def test_a_full_disk_is_refused_early(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(export, "free_bytes", lambda _: 5_000)
        terrain = terrain_of(SITE)
        with pytest.raises(WriteError, match=r"48 × 32 pixels may take 6,144 bytes, but 5,000 are"):
            export_dem(terrain, grid_over(terrain, 0.25), tmp_path / "a.tif")
        assert list(tmp_path.iterdir()) == []

    def test_the_disk_is_that_of_the_file(self, tmp_path: Path) -> None:
        """Behind a link, and of a folder that is there."""
        (tmp_path / "there").mkdir()
        (tmp_path / "link.tif").symlink_to(tmp_path / "there" / "a.tif")
        seen: list[Path] = []

        def usage(path: Path) -> Any:
            seen.append(Path(path))
            return shutil._ntuple_diskusage(9, 9, 9)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(output.shutil, "disk_usage", usage)
            output.free_bytes(tmp_path / "link.tif")
            output.free_bytes(tmp_path / "there")
            output.free_bytes(tmp_path / "new.tif")
        assert seen == [tmp_path / "there", tmp_path / "there", tmp_path]

    @pytest.mark.slow
    @pytest.mark.parametrize("suffix", ["tif", "npy"])
    def test_a_disk_that_fills_leaves_nothing(
        self, tmp_path: Path, saved: Callable[..., Path], suffix: str
    ) -> None:
        """A sentence, no crash: the largest file may have 20 kB here."""
        source = saved(SITE)
        folder = tmp_path / "out"
        folder.mkdir()
        code = (
            "import resource, signal, sys\n"
            "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
            "from terratool.cli.main import main\n"
            f"sys.argv = ['terratool', 'export-dem', {str(source)!r}, "
            f"{str(folder / f'a.{suffix}')!r}, '--resolution', '0.02']\n"
            "main()"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False
        )
        assert done.returncode == 3, done.stderr
        assert "terratool: a." in done.stderr or "out/a." in done.stderr
        assert "Traceback" not in done.stderr
        assert list(folder.iterdir()) == []

    @pytest.mark.parametrize(
        ("heights", "words"), [((-1e9, 1e9), "beyond 3.4e38"), ((0, 1e9), "beyond 3.4e38")]
    )
    def test_numbers_beyond_the_type(
        self, tmp_path: Path, heights: tuple[float, float], words: str
    ) -> None:
        """Refused in single precision, written in double."""
        terrain = terrain_of(
            {"size": 4, "elemTypes": {"p": {"x": list(heights)}},
             "elemTree": {"type": "p", "vScale": 1e30}}
        )  # fmt: skip
        with pytest.raises(RequestError, match=words):
            export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.tif")
        assert list(tmp_path.iterdir()) == []
        export_dem(terrain, grid_over(terrain, 1), tmp_path / "a.tif", dtype="float64")

    def test_a_name_that_is_no_text_is_refused(
        self, tmp_path: Path, saved: Callable[..., Path]
    ) -> None:
        name = os.fsencode(tmp_path) + b"/bad\xff.tif"
        command = [sys.executable, "-m", "terratool", "export-dem", saved(SITE), name]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 3 and "is no name in UTF-8" in done.stderr

    def test_a_closed_standard_error_is_no_matter(
        self, tmp_path: Path, saved: Callable[..., Path]
    ) -> None:
        command = f"{sys.executable} -m terratool export-dem {saved(SITE)} {tmp_path}/a.tif 2>&-"
        assert subprocess.run(command, shell=True, check=False).returncode == 0
        assert (tmp_path / "a.tif").exists()

    @pytest.mark.parametrize(
        ("crs", "code"),
        [("EPSG:99999999", 1), ("+proj=nonsense", 1), ("EPSG:4326", 0), (32633, 0)],
    )
    def test_unknown_crs(
        self, tmp_path: Path, saved: Callable[..., Path], crs: Any, code: int
    ) -> None:
        done = call("export-dem", saved({**SITE, "crs": crs}), tmp_path / "a.tif")
        assert done.code == code
        assert (tmp_path / "a.tif").exists() == (code == 0)
        assert ("unknown" in done.err) == (code == 1)

    def test_unknown_crs_raises(self) -> None:
        with pytest.raises(DefinitionError, match="nonsense"):
            crs_of(terrain_of({**SITE, "crs": "+proj=nonsense"}))

    @pytest.mark.parametrize(
        ("arguments", "code"),
        [
            (["missing.json", "a.tif"], 3),
            (["{good}", "no/such/folder/a.tif"], 3),
            (["{good}", "."], 3),
            (["{bad}", "a.tif"], 1),
            (["{good}", "a.tif", "--resolution", "-1"], 2),
            (["{good}", "a.tif", "--resolution", "one"], 2),
            (["{good}", "a.tif", "--bounds", "0", "0", "1", "1"], 2),
            (["{good}", "a.tif", "--resolution", "1e-9"], 2),
            (["{good}", "a.tif", "--resolution", "0.00002"], 3),
            (["{good}"], 2),
        ],
        ids=str,
    )
    def test_every_way_of_being_wrong(
        self, tmp_path: Path, saved: Callable[..., Path], monkeypatch: pytest.MonkeyPatch,
        arguments: list[str], code: int,
    ) -> None:  # fmt: skip
        """One sentence and a hint on stderr, the right exit code, and no output file."""
        names = {
            "good": saved(SITE, "good.json"),
            "bad": saved({**SITE, "size": -1}, "bad.json"),
        }
        before = sorted(tmp_path.rglob("*"))
        monkeypatch.chdir(tmp_path)
        done = call("export-dem", *(a.format(**names) for a in arguments))
        assert (done.code, done.out) == (code, ""), done.err
        assert len(done.err.strip().splitlines()) >= 2
        assert sorted(tmp_path.rglob("*")) == before


def test_the_command_says_what_it_did(tmp_path: Path, saved: Callable[..., Path]) -> None:
    done = call("export-dem", saved(SITE), tmp_path / "a.tif", "--json")
    report = json.loads(done.out)
    pixels, _ = read(tmp_path / "a.tif")
    assert report["format_version"] == 2
    assert (report["width"], report["height"], report["resolution"]) == (60, 40, 0.2)
    assert report["bounds"] == [500000, 4649776, 500012, 4649784]
    assert report["nodata"] == np.isnan(pixels).sum() == 100
    (file,) = report["files"]
    (band,) = file["bands"]
    assert band["low"] == np.nanmin(pixels) and band["high"] == np.nanmax(pixels)
    assert (band["name"], band["unit"], file["dtype"]) == ("height", "m", "float32")
    text = call("export-dem", saved(SITE), tmp_path / "b.tif").out
    assert "60 × 40 pixels of 0.2 (a tenth of the smallest cell)" in text
