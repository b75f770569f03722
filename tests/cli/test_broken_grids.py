"""Rasters of grids that are broken, or that strangers made: a sentence, or the right heights."""

from __future__ import annotations

import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from rasterio.transform import Affine

from tests.commands import COMMAND, ENVIRONMENT, Ran, not_for_ever, run
from tests.rasters import geotiff

HEIGHTS = np.random.default_rng(8).integers(1000, 2000, (120, 80)) / 1000
PICTURE = np.round(HEIGHTS * 100).astype(np.uint8)
QUERY = 0.35, 0.15
"""The middle of the fourth pixel of the last row but one."""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A definition of a raster that is not there yet."""
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "site.json").write_text(
        json.dumps(
            {
                "size": [8, 12],
                "elemTypes": {"dem": {"grid": {"file": "dem.tif"}}},
                "elemTree": {"type": "dem", "vScale": 1},
            }
        )
    )
    return folder / "site.json"


def cut(path: Path, share: float) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


def claim(path: Path, width: int | None = None, height: int | None = None) -> None:
    """Write another size into the header of a TIFF."""
    data = bytearray(path.read_bytes())
    for tag, size in ((256, width), (257, height)):
        if size is not None:
            at = data.rindex(struct.pack("<HHI", tag, 3, 1))
            data[at : at + 12] = struct.pack("<HHII", tag, 4, 1, size)
    path.write_bytes(data)


def copied(path: Path, driver: str, heights: np.ndarray = HEIGHTS) -> None:
    """The heights in a file of another driver, whatever its name."""
    geotiff(path.with_name("other.tif"), heights)
    rasterio.shutil.copy(path.with_name("other.tif"), path, driver=driver)


def shortened(**options: object) -> Callable[[Path], None]:
    """A GeoTIFF whose directory stands before its numbers, of which the last are missing."""

    def make(path: Path) -> None:
        copied(path, "COG")
        cut(path, 0.8)

    def packed(path: Path) -> None:
        geotiff(path, HEIGHTS, **options)
        claim(path, height=240)

    return packed if options else make


def netcdf(path: Path) -> None:
    copied(path, "netCDF")
    assert path.read_bytes().startswith(b"CDF")
    cut(path, 0.9)


def png(path: Path) -> None:
    copied(path, "PNG", PICTURE)
    cut(path, 0.99)


def rows(path: Path) -> None:
    copied(path, "AAIGrid")
    for beside in (path.with_suffix(".prj"), path.with_name("dem.tif.aux.xml")):
        beside.unlink(missing_ok=True)
    cut(path, 0.7)


def outside(path: Path) -> None:
    geotiff(path.parents[1] / "outside.tif", HEIGHTS)
    path.symlink_to("../outside.tif")


def ask(site: Path) -> Ran:
    return run("query", site, *QUERY)


BROKEN: dict[str, tuple[Callable[[Path], object], int, str]] = {
    "cut": (shortened(), 3, "cannot be read as a raster"),
    "more rows": (shortened(compress="none"), 3, "cannot be read as a raster"),
    "more tiles": (
        shortened(compress="lzw", tiled=True, blockxsize=16, blockysize=16),
        3, "cannot be read as a raster",
    ),
    "cut PNG": (png, 1, "has no end"),
    "cut rows": (rows, 1, "cannot be read as a raster"),
    "nothing": (lambda path: path.write_bytes(b""), 1, "cannot be read as a raster"),
    "no directory": (
        lambda path: path.write_bytes(b"II*\0\xff\xff\xff\x7f"), 1, "cannot be read as a raster"
    ),
    "link": (outside, 1, "lies outside of the folders"),
    "pipe": (os.mkfifo, 1, "is no regular file"),
    "folder": (Path.mkdir, 1, "is a folder"),
    "device": (lambda path: path.symlink_to("/dev/zero"), 1, "lies outside of the folders"),
    "complex": (
        lambda path: geotiff(path, HEIGHTS.astype(np.complex128)),
        1, "holds complex numbers in band 1",
    ),
    "palette": (
        lambda path: geotiff(path, PICTURE, photometric="palette"), 1, "holds colours of a palette"
    ),
}  # fmt: skip
SLOW: dict[str, tuple[Callable[[Path], object], int, str]] = {
    "cut netCDF": (netcdf, 1, " bytes, but its variables take ")
}
"""Those that GDAL reads in a process of their own first."""


@pytest.mark.parametrize(
    ("make", "code", "words"),
    [
        *(pytest.param(*case, id=name) for name, case in BROKEN.items()),
        *(pytest.param(*case, id=name, marks=pytest.mark.nightly) for name, case in SLOW.items()),
    ],
)
def test_a_broken_raster_is_told_in_a_sentence(
    make: Callable[[Path], object], code: int, words: str, site: Path
) -> None:
    """With the file's name and what to do, and nothing else; no file is left in the cache."""
    make(site.with_name("dem.tif"))
    ran = ask(site)
    assert (ran.code, ran.out) == (code, "")
    first, second, *more = ran.err.splitlines()
    assert first.startswith("terratool: ") and "dem.tif" in first and words in first
    assert (
        first.endswith(".") and second.startswith("  ") and second.endswith((".", "OLD NEW.tif."))
    )
    assert not more and "/tmp/terratool-" not in ran.err


@pytest.mark.slow
def test_numbers_that_are_none_are_void(site: Path) -> None:
    """NaN and infinite ones, each pixel by itself."""
    for number, none in enumerate((math.nan, math.inf, -math.inf)):
        heights = HEIGHTS.copy()
        heights[117 + number, 2 + number] = none
        geotiff(site.with_name("dem.tif"), heights)
        at = 0.1 * (2.5 + number), 0.1 * (2.5 - number)
        (line,) = run("query", site, *at).out.splitlines()[1:]
        assert line.startswith(f"{at[0]},{at[1]},,") and "void" in line, line
        beside = run("query", site, at[0] + 0.1, at[1]).out.splitlines()[1]
        assert float(beside.split(",")[2]) == HEIGHTS[117 + number, 3 + number]


def sparse(path: Path, side: int, count: int = 1) -> None:
    """A TIFF of some kilobytes that says of each of its tiles that it is empty."""
    with rasterio.open(
        path, "w", driver="GTiff", width=side, height=side, count=count, dtype="float64",
        tiled=True, blockxsize=1024, blockysize=1024, sparse_ok=True,
        transform=Affine(1, 0, 9, 0, -1, 9),
    ):  # fmt: skip
        pass


def many(path: Path) -> None:
    """Bands that are harmless each, and too much together."""
    sparse(path, 2000, 40)
    site = json.loads(path.with_name("site.json").read_text())
    grids = {f"d{band}": {"grid": {"file": "dem.tif", "band": band}} for band in range(2, 41)}
    site["elemTypes"] |= grids
    path.with_name("site.json").write_text(json.dumps(site))


MEASURING = """
import os, sys
child = os.posix_spawn(sys.argv[2], sys.argv[2:], os.environ)
_, status, used = os.wait4(child, 0)
open(sys.argv[1], "w").write(str(used.ru_maxrss << 10))
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""A program between, as a process counts the memory of the one that it was split from."""


def measured(*words: object) -> tuple[Ran, int]:
    """What a process of its own leaves behind, and the most memory that it had, in bytes."""
    with tempfile.NamedTemporaryFile("r") as memory:
        command = [sys.executable, "-S", "-c", MEASURING, memory.name, *COMMAND, *map(str, words)]
        with not_for_ever(60):
            done = subprocess.run(
                command, capture_output=True, text=True, env=ENVIRONMENT, check=False
            )
        return Ran(done.returncode, done.stdout, done.stderr), int(memory.read())


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("make", "refused"),
    [
        (lambda path: (geotiff(path, HEIGHTS), claim(path, 10**6, 10**6)), True),
        (lambda path: sparse(path, 31_000), False),  # read by blocks, which are empty
        (many, True),
    ],
    ids=["claim", "sparse", "many bands"],
)
def test_a_small_file_takes_little(
    make: Callable[[Path], object], refused: bool, site: Path
) -> None:
    """Neither memory nor the disk, whatever it claims."""
    make(site.with_name("dem.tif"))
    assert site.with_name("dem.tif").stat().st_size < 100_000
    for command in (("validate", site), ("query", site, *QUERY)):
        ran, memory = measured(*command)
        assert ran.code == refused and (" pixels, but has " in ran.out + ran.err) == refused
        assert "Traceback" not in ran.err and memory < 200 << 20


@pytest.mark.nightly
def test_a_cache_that_is_not_as_it_should_be_changes_no_answer(site: Path, tmp_path: Path) -> None:
    geotiff(site.with_name("dem.tif"), HEIGHTS, compress="deflate")
    base = tmp_path / "cache"
    grids, elsewhere = base / "terratool" / "grids", tmp_path / "elsewhere"

    def answer() -> Ran:
        return run("query", site, *QUERY, XDG_CACHE_HOME=str(base))

    def damage(grid: Path) -> None:
        data = bytearray(grid.read_bytes())
        data[-HEIGHTS.nbytes :] = bytes(reversed(data[-HEIGHTS.nbytes :]))
        grid.write_bytes(data)

    def link(grid: Path) -> None:
        shutil.move(grids, elsewhere)
        damage(elsewhere / grid.name)
        grids.symlink_to(elsewhere)

    def give_away(grid: Path) -> None:
        damage(grid)
        grid.chmod(0o666)
        if os.geteuid() == 0:
            os.chown(grid, 12345, -1)

    def open_folder(grid: Path) -> None:
        damage(grid)
        grids.chmod(0o777)

    right = answer()
    assert right.code == 0 and right.err == "" and f"{HEIGHTS[-2, 3]}" in right.out
    for spoil in (damage, give_away, open_folder, link):
        (grid,) = grids.glob("*.grid")
        spoil(grid)
        assert answer() == right, spoil.__name__
    shutil.rmtree(base)
    base.write_text("no folder")
    assert answer() == right
