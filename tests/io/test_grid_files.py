"""Reading of rasters of grids: what is opened how often, what is too much, what lies beside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from msgspec import structs
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.transform import Affine

from terratool.definition.findings import Finding
from terratool.definition.grid_files import GridSource
from terratool.definition.reader import check
from terratool.errors import ReadError
from terratool.io import grid_cache, grid_files
from terratool.io.grid_files import Headers, numbers_of
from terratool.text.source import read_source
from tests.programs import program
from tests.rasters import geotiff

HEIGHTS = np.arange(35, dtype=np.float32).reshape(7, 5) ** 1.5


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "terratool" / "grids"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the rasters that were opened."""
    names = []
    openings = grid_files._opened

    def counted(path: str, overview: int | None = None) -> Any:
        names.append(Path(path).name)
        return openings(path, overview)

    monkeypatch.setattr(grid_files, "_opened", counted)
    return names


def source_of(path: Path, band: int = 1) -> GridSource:
    return Headers().source(os.path.realpath(path), band)


def heights_of(path: Path, band: int = 1) -> NDArray[np.floating[Any]]:
    data, facts, _ = numbers_of(source_of(path, band))
    kind = np.float32 if facts.single else np.float64
    found: NDArray[Any] = data.view(kind).reshape(facts.source.rows, facts.source.columns)
    return found


def findings(folder: Path, *grids: dict[str, Any]) -> list[Finding]:
    """Findings on rasters, of a terrain of some grids whose cell has their proportions."""
    types = {f"d{number}": {"grid": grid} for number, grid in enumerate(grids)}
    terrain = {"size": [5, 7], "elemTypes": types, "elemTree": {"type": "d0", "vScale": 1}}
    (folder / "site.json").write_text(json.dumps(terrain))
    found = check(read_source(folder / "site.json")).findings
    return [one for one in found if one.code.startswith("TT31")]


# --- how often ------------------------------------------------------------------------------------


def test_a_raster_is_opened_once_for_all_of_its_bands(tmp_path: Path, opened: list[str]) -> None:
    """Named by several primitives, under several paths, and with bands that are none."""
    geotiff(tmp_path / "dem.tif", np.stack([HEIGHTS, HEIGHTS + 1, HEIGHTS.T.reshape(7, 5)]))
    (tmp_path / "link.tif").symlink_to("dem.tif")
    grids = [{"file": "dem.tif", "band": band} for band in (1, 2, 3, 2, 4, 4)]
    found = findings(tmp_path, *grids, {"file": "link.tif"}, {"file": "./dem.tif"})
    assert opened == ["dem.tif"]
    assert [(one.code, one.pointer) for one in found] == [
        ("TT312", "/elemTypes/d4/grid/file"), ("TT312", "/elemTypes/d5/grid/file")
    ]  # fmt: skip
    assert all("has 3 bands, and no band 4" in one.message for one in found)


def test_a_file_that_is_no_raster_is_opened_once(tmp_path: Path, opened: list[str]) -> None:
    (tmp_path / "dem.tif").write_text("no raster")
    grids = [{"file": "dem.tif", "band": band} for band in (1, 2, 3)]
    assert [one.code for one in findings(tmp_path, *grids)] == ["TT312"] * 3
    assert opened == ["dem.tif"]


def test_none_is_opened_that_is_in_the_cache(tmp_path: Path, opened: list[str]) -> None:
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    heights_of(tmp_path / "dem.tif")
    del opened[:]
    assert findings(tmp_path, {"file": "dem.tif"}) == []
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), HEIGHTS) and opened == []


# --- too much -------------------------------------------------------------------------------------


def test_bands_have_a_largest_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is named twice counts once."""
    monkeypatch.setattr(grid_files, "MAX_GRIDS", 2)
    for name in "abc":
        geotiff(tmp_path / f"{name}.tif", HEIGHTS)
    names = [{"file": f"{name}.tif"} for name in "aabbabc"]
    assert findings(tmp_path, *names[:-1]) == []
    (one,) = findings(tmp_path, *names)
    assert one.code == "TT312" and one.pointer == "/elemTypes/d6/grid/file"
    assert "is one of more than 2 bands of rasters" in one.message and "gdal_merge" in one.hint


def empty(path: Path, count: int = 1) -> Path:
    """A raster of 64 × 64 pixels, none of which is in the file."""
    with rasterio.open(
        path, "w", driver="GTiff", width=64, height=64, count=count, dtype="float32",
        sparse_ok=True, transform=Affine(1, 0, 9, 0, -1, 9), compress="deflate",
    ):  # fmt: skip
        return path


def test_pixels_that_are_in_no_file_have_a_largest_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For all rasters together, and for all bands of one."""
    empty(tmp_path / "a.tif"), empty(tmp_path / "b.tif")
    empty(tmp_path / "bands.tif", 2)
    full = np.random.default_rng(1).normal(size=(64, 64))
    geotiff(tmp_path / "full.tif", full)
    monkeypatch.setattr(grid_files, "PIXELS_A_BYTE", 1)
    held = {name: (tmp_path / name).stat().st_size for name in ("a.tif", "bands.tif")}
    assert (tmp_path / "full.tif").stat().st_size >= full.size
    a, b, second = (
        {"file": "a.tif"}, {"file": "b.tif"}, {"file": "bands.tif", "band": 2}
    )  # fmt: skip
    for most, grids, wrong in [
        (2 * (64 * 64 - held["a.tif"]), [a, {"file": "full.tif"}, b, a], []),
        (2 * (64 * 64 - held["a.tif"]) - 1, [a, {"file": "full.tif"}, b, a], ["d2"]),
        (2 * 64 * 64 - held["bands.tif"], [{"file": "bands.tif"}, second], []),
        (2 * 64 * 64 - held["bands.tif"] - 1, [{"file": "bands.tif"}, second], ["d1"]),
    ]:
        monkeypatch.setattr(grid_files, "MAX_EMPTY_PIXELS", most)
        found = findings(tmp_path, *grids)
        assert [one.pointer for one in found if one.code == "TT312"] == [
            f"/elemTypes/{name}/grid/file" for name in wrong
        ], most
        for one in found:
            assert "claims 64 × 64 pixels, but has " in one.message or one.code != "TT312"


def test_heights_that_fit_nowhere_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither into the cache nor into half of the memory."""
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    monkeypatch.setattr(grid_cache, "MOST_BYTES", HEIGHTS.nbytes - 1)
    monkeypatch.setattr(grid_files, "memory_bytes", lambda: 2 * HEIGHTS.nbytes)
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), HEIGHTS)
    monkeypatch.setattr(grid_files, "memory_bytes", lambda: 2 * HEIGHTS.nbytes - 1)
    with pytest.raises(ReadError, match=r"dem\.tif: its heights take 140 bytes, for which there"):
        heights_of(tmp_path / "dem.tif")
    monkeypatch.setattr(grid_cache, "MOST_BYTES", HEIGHTS.nbytes)
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), HEIGHTS)
    monkeypatch.setattr(grid_cache, "free_bytes", lambda _: 0)
    grid_cache.clear()
    with pytest.raises(ReadError, match="for which there is no room"):
        heights_of(tmp_path / "dem.tif")


@pytest.mark.parametrize("block", [{"blockysize": 50}, {"tiled": True, "blockxsize": 64,
                                                          "blockysize": 32}])  # fmt: skip
def test_no_piece_is_larger_than_it_may_be(
    block: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a block of the file is, it is read in parts; each pixel once."""
    heights = np.random.default_rng(3).normal(size=(50, 131)).astype(np.float32)
    geotiff(tmp_path / "dem.tif", heights, compress="deflate", **block)
    monkeypatch.setattr(grid_files, "_PIECE", 70)
    sizes, read = [], grid_files._Band._heights

    def spied(band: Any, window: Any) -> Any:
        sizes.append(window.width * window.height)
        return read(band, window)

    monkeypatch.setattr(grid_files._Band, "_heights", spied)
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), heights)
    assert max(sizes) <= 70 and sum(sizes) == heights.size


def test_facts_are_those_of_all_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What only the first pieces have counts, too: extremes, a void, and a rim that is not 0."""
    monkeypatch.setattr(grid_files, "_PIECE", 8)
    heights = np.zeros((12, 9), np.float32)
    heights[1:-1, 1:-1] = 2
    heights[1, 1:4] = -7, 30, np.nan
    for name, rim in (("level", 0), ("edged", 0.5)):
        heights[0, 2] = rim
        geotiff(tmp_path / f"{name}.tif", heights)
        facts = numbers_of(source_of(tmp_path / f"{name}.tif")).facts
        assert (facts.low, facts.high, facts.voids, facts.edged) == (-7, 30, True, rim > 0)
    heights[1, 3] = 2
    geotiff(tmp_path / "whole.tif", heights)
    assert not numbers_of(source_of(tmp_path / "whole.tif")).facts.voids


@pytest.mark.parametrize("nodata", [0.1, -9999.7, -3.4028234663852886e38, 7])
def test_nodata_is_rounded_as_the_numbers_are(tmp_path: Path, nodata: float) -> None:
    heights = HEIGHTS.copy()
    heights[2, 3] = nodata
    heights[4, 1] = np.nextafter(heights[2, 3], np.float32(0), dtype=np.float32)
    geotiff(tmp_path / "dem.tif", heights, nodata=nodata)
    found = heights_of(tmp_path / "dem.tif")
    wanted = np.isnan(found) & (np.abs(heights) <= 1e30)
    assert wanted.sum() == (abs(nodata) < 1e30) and np.isnan(found[2, 3])


def test_a_raster_that_is_void_ranges_from_0_to_0(tmp_path: Path) -> None:
    """From the cache, too, which keeps no infinite numbers."""
    geotiff(tmp_path / "dem.tif", np.full((3, 4), np.nan))
    for _ in range(2):
        facts = numbers_of(source_of(tmp_path / "dem.tif")).facts
        assert (facts.low, facts.high, facts.voids, facts.edged) == (0, 0, True, True)


def test_heights_are_unpacked_anew_where_the_header_is_read_otherwise(tmp_path: Path) -> None:
    """As by another version of GDAL: the facts are those of the source that was asked for."""
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    source = source_of(tmp_path / "dem.tif")
    numbers_of(source)
    other = structs.replace(source, crs="EPSG:32633")
    assert numbers_of(other).facts.source == other
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), HEIGHTS)


# --- files beside it ------------------------------------------------------------------------------


def put_beside(path: Path) -> None:
    """Files that GDAL takes for parts of a raster: other numbers, masks, places and systems."""
    stem, folder = path.stem, path.parent
    (folder / f"{stem}.prj").write_text(CRS.from_epsg(32633).to_wkt())
    for ending in ("wld", "tfw"):
        (folder / f"{stem}.{ending}").write_text("7\n0\n0\n-3\n100\n200\n")
    (folder / f"{path.name}.aux.xml").write_text(
        "<PAMDataset><SRS>EPSG:32633</SRS><GeoTransform>9,7,0,9,0,-3</GeoTransform>"
        '<PAMRasterBand band="1"><Scale>9</Scale></PAMRasterBand></PAMDataset>'
    )
    (folder / f"{stem}.aux").write_bytes(b"no HFA")
    geotiff(folder / "msk", np.zeros((7, 5), np.uint8))
    (folder / "msk").rename(folder / f"{path.name}.msk")
    geotiff(folder / "ovr", np.full((4, 3), 99, np.float32))
    (folder / "ovr").rename(folder / f"{path.name}.ovr")


def put_traps(path: Path) -> None:
    """A pipe and text where GDAL looks for parts of a raster."""
    os.mkfifo(path.with_suffix(".prj"))
    path.with_name(f"{path.name}.ovr").write_text("no TIFF")


@pytest.mark.parametrize("beside", [put_beside, put_traps])
@pytest.mark.parametrize("driver", ["GTiff", "AAIGrid", "HFA", "BT"])
def test_files_beside_a_raster_change_nothing(
    driver: str, beside: Callable[[Path], None], tmp_path: Path, cache: Path
) -> None:
    """Neither its header nor its heights, be it in the cache or not."""
    name = {"GTiff": "dem.tif", "AAIGrid": "dem.asc", "HFA": "dem.img", "BT": "dem.bt"}[driver]
    folder = tmp_path / "own"
    folder.mkdir()
    geotiff(tmp_path / "made.tif", HEIGHTS)
    rasterio.shutil.copy(tmp_path / "made.tif", folder / name, driver=driver)
    for other in folder.iterdir():
        if other.name != name:
            other.unlink()
    alone, found = source_of(folder / name), findings(folder, {"file": name})
    heights = heights_of(folder / name).copy()
    assert "32633" not in str(alone.crs) and np.allclose(heights, HEIGHTS, rtol=1e-6)
    beside(folder / name)
    for _ in range(2):  # from the cache, and without it
        assert source_of(folder / name) == alone
        assert np.array_equal(heights_of(folder / name), heights)
        assert findings(folder, {"file": name}) == found
        grid_cache.clear()


def test_no_temporary_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And where there can be none, that is said."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    heights_of(tmp_path / "dem.tif")
    (tmp_path / "bad.tif").write_text("no raster")
    with pytest.raises(ReadError):
        source_of(tmp_path / "bad.tif")
    assert list((tmp_path / "temporary").iterdir()) == []
    (tmp_path / "temporary").rmdir()
    grid_cache.clear()
    with pytest.raises(ReadError, match=r"dem\.tif: needs a folder for temporaries") as told:
        source_of(tmp_path / "dem.tif")
    assert "TMPDIR" in told.value.hint


# --- one answer -----------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of a megabyte."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(
        [program("mount"), "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder],
        capture_output=True, check=False,
    )  # fmt: skip
    if made.returncode:
        pytest.skip("this user cannot mount a disk")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_disk_that_fills_up_is_done_without(
    small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Be that known beforehand or not; and nothing stays on it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(small_disk))
    heights = np.random.default_rng(3).normal(size=(700, 300))
    assert heights.nbytes > 1 << 20
    geotiff(tmp_path / "dem.tif", heights, compress="deflate")
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), heights)
    monkeypatch.setattr(grid_cache, "free_bytes", lambda _: 1 << 40)
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), heights)
    assert [path for path in small_disk.rglob("*") if not path.is_dir()] == []
    geotiff(tmp_path / "small.tif", HEIGHTS)
    assert np.array_equal(heights_of(tmp_path / "small.tif"), HEIGHTS)
    assert len(grid_cache.files()) == 1


def test_the_bytes_are_the_same_whence_they_come(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unpacked into the cache, mapped from it, marked or not, and unpacked into memory."""
    monkeypatch.setattr(grid_cache, "_SETTLED", -(10**10))
    heights = np.random.default_rng(3).normal(size=(300, 200)).astype(np.float32)
    heights[7:20, 9] = np.nan
    geotiff(tmp_path / "dem.tif", heights, compress="zstd", tiled=True)
    for name in ("cold", "warm", "unmarked", "marked", "in memory"):
        if name == "unmarked":
            next(cache.glob("*.whole")).unlink()
        if name == "in memory":
            grid_cache.clear()
            monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
        data, facts, _ = numbers_of(source_of(tmp_path / "dem.tif"))
        assert data.tobytes() == heights.tobytes(), name
        known = np.nanmin(heights), np.nanmax(heights), True, True
        assert (facts.low, facts.high, facts.voids, facts.edged) == known, name


TOGETHER = """
import os, sys
from terratool.io import grid_files
from tests.io.test_grid_files import heights_of
from pathlib import Path

write = grid_files._Band.write

def wait(band, put):
    facts = write(band, put)
    os.write(int(sys.argv[2]), b"x")
    os.read(int(sys.argv[3]), 1)
    return facts

grid_files._Band.write = wait
sys.stdout.buffer.write(heights_of(Path(sys.argv[1])).tobytes())
"""


@pytest.mark.nightly
def test_two_processes_that_unpack_one_raster_at_once_agree(tmp_path: Path, cache: Path) -> None:
    """Both have written all of it before either has it in the cache; one file is left."""
    geotiff(tmp_path / "dem.tif", HEIGHTS)
    (written, ready), (go, start) = os.pipe(), os.pipe()
    command = [sys.executable, "-c", TOGETHER, str(tmp_path / "dem.tif"), str(ready), str(go)]
    both = [
        subprocess.Popen(
            command, stdout=subprocess.PIPE, pass_fds=(ready, go), cwd=Path(__file__).parents[2]
        )
        for _ in range(2)
    ]
    os.close(ready)
    assert os.read(written, 1) + os.read(written, 1) == b"xx"
    os.write(start, b"go")
    assert [process.communicate()[0] for process in both] == [HEIGHTS.tobytes()] * 2
    assert [path.suffix for path in cache.iterdir()] == [".grid"]
    assert np.array_equal(heights_of(tmp_path / "dem.tif"), HEIGHTS)
    for number in (written, go, start):
        os.close(number)


@pytest.mark.parametrize("cached", [True, False])
def test_a_raster_that_changes_as_it_is_read_is_refused(
    cached: bool, tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing of both states is kept, nor given out."""
    path = tmp_path / "dem.tif"
    heights = np.random.default_rng(3).normal(size=(64, 64))
    geotiff(path, heights, tiled=True, blockxsize=16, blockysize=16)
    geotiff(tmp_path / "other.tif", heights + 1, tiled=True, blockxsize=16, blockysize=16)
    monkeypatch.setattr(grid_files, "_PIECE", 256)
    if not cached:
        monkeypatch.setattr(grid_cache, "free_bytes", lambda _: 0)
    read, count = grid_files._Band._heights, iter(range(100))

    def spied(band: Any, window: Any) -> Any:
        if next(count) == 3:
            path.write_bytes((tmp_path / "other.tif").read_bytes())
        return read(band, window)

    monkeypatch.setattr(grid_files._Band, "_heights", spied)
    with pytest.raises(ReadError, match=r"dem\.tif: has changed since its header was read"):
        heights_of(path)
    assert not grid_cache.files()
    assert np.array_equal(heights_of(path), heights + 1)


def test_a_state_is_known_by_the_time_of_its_change(tmp_path: Path) -> None:
    """Also where the middle of a file changes, and its time is set back."""
    path = tmp_path / "dem.tif"
    heights = np.random.default_rng(3).normal(size=(64, 64))
    geotiff(path, heights, compress="none")
    assert np.array_equal(heights_of(path), heights)
    before, data = path.stat(), bytearray(path.read_bytes())
    at = data.index(heights[32].tobytes())
    data[at : at + 8] = np.array([7.5]).tobytes()
    assert 4096 < at < len(data) - 4104
    with path.open("r+b") as file:
        file.write(data)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = path.stat()
    assert (after.st_ino, after.st_size, after.st_mtime_ns) == (
        before.st_ino, before.st_size, before.st_mtime_ns,
    )  # fmt: skip
    assert heights_of(path)[32, 0] == 7.5
