"""Grids of heights of 36 million and 10¹⁰ pixels: each command against a program that does as much.

Seconds are those of processors, of whole processes in turn; the first run of each is not counted,
but where the cache is empty. Heights are fractal ground of 300 m over 6 km, in centimetres.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rasterio
from compiled import bilinear
from rasterio.windows import Window

from terratool.field.terrain import load
from terratool.mesh.build import build

SIDE, PLANET = 6000, 100_000
RUNS = 3
TILED = {"tiled": True, "blockxsize": 512, "blockysize": 512, "compress": "zstd"}
PLACED = {"crs": "EPSG:32633", "transform": rasterio.Affine(1, 0, 500_000, 0, -1, 5_500_000)}

_POINT = """
import sys, rasterio
from rasterio.windows import Window
with rasterio.open(sys.argv[1]) as file:
    print(file.read(1, window=Window(1000, 3000, 2, 2)).mean())
"""
_COPY = """
import sys, rasterio
from rasterio.enums import Resampling
with rasterio.Env(GDAL_NUM_THREADS="ALL_CPUS", GDAL_TIFF_OVR_BLOCKSIZE="512"):
    with rasterio.open(sys.argv[1]) as file:
        options = dict(
            file.profile, compress="zstd", zstd_level=1, predictor=3, tiled=True, blockxsize=512,
            blockysize=512, num_threads="ALL_CPUS", bigtiff="if_safer",
        )
        heights = file.read(1)
    with rasterio.open(sys.argv[2], "w", **options) as copy:
        copy.write(heights, 1)
    with rasterio.open(sys.argv[2], "r+") as copy:
        copy.build_overviews([2, 4, 8, 16], Resampling.average)
"""


class Used(NamedTuple):
    """What a process took: seconds of processors and of the clock, and its largest memory, MB."""

    seconds: float
    wall: float
    memory: float


def run(command: list[str | Path], cache: Path) -> Used:
    """Run a command to its end; its output is left out."""
    begin = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, env={**os.environ, "XDG_CACHE_HOME": str(cache)}
    )
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(map(str, command))} failed")
    wall = time.perf_counter() - begin
    return Used(used.ru_utime + used.ru_stime, wall, used.ru_maxrss / 1024)


def terratool(*words: str | Path) -> list[str | Path]:
    """Command line of terratool."""
    return [sys.executable, "-m", "terratool", *words]


def in_turn(commands: dict[str, list[str | Path]], cache: Path) -> dict[str, Used]:
    """What each command takes: the medians of `RUNS` in turn, after one that is not counted."""
    found: dict[str, list[Used]] = {name: [] for name in commands}
    for turn in range(RUNS + 1):
        for name, command in commands.items():
            used = run(command, cache)
            if turn:
                found[name].append(used)
    return {
        name: Used(*map(statistics.median, zip(*every, strict=True)))
        for name, every in found.items()
    }


def tell(what: str, used: Used, target: str, other: Used | None = None) -> None:
    """Print what a command took, and beside another one if it is given."""
    ratio = "" if other is None else f"{used.seconds / other.seconds:6.2f} ×"
    print(
        f"{what:44} {used.seconds:6.2f} s {used.wall:6.2f} s {used.memory:6.0f} MB {ratio:9} "
        f"  target {target}",
        flush=True,
    )


def ground(side: int) -> np.ndarray:
    """Fractal ground of 300 m, (side, side) float32."""
    along, across = np.fft.rfftfreq(side)[None], np.fft.fftfreq(side)[:, None]
    pace = np.hypot(along, across)
    pace[0, 0] = np.inf
    waves = np.random.default_rng(1).standard_normal((2, side, side // 2 + 1))
    found = np.fft.irfft2((waves[0] + 1j * waves[1]) * pace**-1.9, s=(side, side))
    return np.asarray((300 * (found - found.min()) / np.ptp(found)).round(2), np.float32)


def planet(path: Path) -> None:
    """10¹⁰ pixels, of which four million have ground that is not level."""
    options = {"driver": "GTiff", "dtype": "float32", "count": 1, "sparse_ok": True}
    rows, columns = np.mgrid[:2048, :2048]
    heights = (300 * np.sin(columns / 200) * np.cos(rows / 300)).astype(np.float32)
    with rasterio.open(
        path, "w", width=PLANET, height=PLANET, bigtiff="yes", **options, **TILED, **PLACED
    ) as file:
        file.write(heights, 1, window=Window(51_200, 40_960, 2048, 2048))


def definition(path: Path, raster: str, side: int) -> None:
    path.write_text(
        json.dumps(
            {
                "size": side,
                "elemTypes": {"g": {"grid": {"file": raster}}},
                "elemTree": {"type": "g", "vScale": 1},
            }
        )
    )


def make(folder: Path) -> None:
    """Write both rasters and their definitions."""
    options = {"driver": "GTiff", "dtype": "float32", "count": 1, "predictor": 3}
    with rasterio.open(
        folder / "dem.tif", "w", width=SIDE, height=SIDE, **options, **TILED, **PLACED
    ) as file:
        file.write(ground(SIDE), 1)
    definition(folder / "site.json", "dem.tif", SIDE)
    planet(folder / "planet.tif")
    definition(folder / "planet.json", "planet.tif", PLANET)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder, cache = Path(name), Path(name, "cache")
        # in a process of its own: what this one takes would count as memory of the commands
        subprocess.run([sys.executable, __file__, "make", folder], check=True)
        print("36 million pixels: processors, clock, memory, beside the other program", flush=True)
        whole(folder, cache)
        print("10¹⁰ pixels", flush=True)
        large(folder, cache)
        points_and_mesh(folder, cache)


def whole(folder: Path, cache: Path) -> None:
    """Commands on the whole raster and on parts of it."""
    site, dem, out = folder / "site.json", folder / "dem.tif", folder / "out.tif"
    point = terratool("query", site, "1001", "2999")
    raw = ["gdal_translate", "-q", "-of", "ENVI", dem, folder / "raw"]
    unpacked = run(raw, cache) if shutil.which("gdal_translate") else None
    tell("query, which unpacks", run(point, cache), "none")
    export = terratool("export-dem", site, out, "--resolution", "1", "--overwrite")
    window = ["--bounds", "3000", "2000", "3512", "2512"]
    found = in_turn(
        {
            "point": [sys.executable, "-c", _POINT, dem],
            "copy": [sys.executable, "-c", _COPY, dem, folder / "copy.tif"],
            "gdaldem": ["gdaldem", "slope", "-q", dem, folder / "slope.tif"],
            "query": point,
            "validate": terratool("validate", site),
            "window": [*export, *window],
            "export": export,
            "slope": [*export, "--layer", "slope"],
            "render": terratool("render", site, folder / "out.png", "--overwrite"),
        },
        cache,
    )
    shutil.rmtree(cache)
    if unpacked is not None:
        fresh = run(point, cache)
        unpacking = fresh._replace(seconds=fresh.seconds - found["query"].seconds)
        tell("unpacking, beside gdal_translate to raw", unpacking, "<= 1.5", unpacked)
    tell("query, beside rasterio", found["query"], "0.5 s, 150 MB", found["point"])
    tell("validate", found["validate"], "0.5 s")
    tell("export-dem of 512²", found["window"], "0.6 s")
    tell("export-dem, beside rasterio's copy", found["export"], "<= 1.5, 500 MB", found["copy"])
    tell("slope, beside gdaldem", found["slope"], "<= 2", found["gdaldem"])
    tell("render", found["render"], "3 s")


def points_and_mesh(folder: Path, cache: Path) -> None:
    """Points in memory beside a compiled function, and a mesh beside pydelatin, in this process."""
    os.environ["XDG_CACHE_HOME"] = str(cache)
    terrain = load(folder / "site.json")
    with rasterio.open(folder / "dem.tif") as file:
        heights = file.read(1)
    x, y = np.random.default_rng(2).uniform(1, SIDE - 1, (2, 1_000_000))
    terrain.height(x, y)
    taken: dict[str, list[float]] = {"terratool": [], "compiled": []}
    flipped, out = np.ascontiguousarray(heights[::-1]), np.empty(len(x))
    for _ in range(RUNS):
        for name, task in (
            ("terratool", lambda: terrain.height(x, y)),
            ("compiled", lambda: bilinear(flipped, x, y, 1.0, out)),
        ):
            begin = time.process_time()
            task()
            taken[name].append(time.process_time() - begin)
    ours, theirs = (statistics.median(taken[name]) for name in taken)
    print(f"10⁶ points, beside a compiled function: {ours / theirs:.2f} ×   target 1")
    begin = time.process_time()
    faces = len(build(terrain, 3.0).mesh.faces)
    own = time.process_time() - begin
    if importlib.util.find_spec("pydelatin") is None:
        print(f"mesh within 1 %: {own:.2f} s, {faces:,} faces; pydelatin is not installed")
        return
    from pydelatin import Delatin

    begin = time.process_time()
    other = len(Delatin(heights, max_error=3.0).triangles)
    other_seconds = time.process_time() - begin
    print(
        f"mesh within 1 %, beside pydelatin: {own / other_seconds:.2f} × for {faces:,} of "
        f"{other:,} faces   target 1"
    )


def large(folder: Path, cache: Path) -> None:
    """A point, a window and the facts of a raster that no memory holds."""
    planet, out = folder / "planet.json", folder / "out.tif"
    window = ["--bounds", "51300", "57100", "51812", "57612", "--resolution", "1", "--overwrite"]
    for what, words in (
        ("query", terratool("query", planet, "51301", "57101")),
        ("validate", terratool("validate", planet)),
        ("export-dem of 512²", terratool("export-dem", planet, out, *window)),
        ("info", terratool("info", planet)),
    ):
        tell(what, in_turn({what: words}, cache)[what], "1 s, 300 MB")


if __name__ == "__main__":
    if sys.argv[1:2] == ["make"]:
        make(Path(sys.argv[2]))
    else:
        main()
