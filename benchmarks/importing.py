"""Whole DEMs: bytes against GDAL's LERC, a TIN and the dense grid at one error, and speed.

Without arguments the DEMs are generated: fractal ground of three roughnesses, and a town. Any file
that GDAL opens can be named instead. All bytes are compressed ones: our .json.gz, LERC_ZSTD or
LERC_DEFLATE at their highest levels (the smaller), pydelatin's TIN as float32 vertices and int32
faces, and the dense grid as DEFLATE with a predictor.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
import warnings
import zlib
from pathlib import Path

import numpy as np
import rasterio
from measure import line
from numpy.typing import NDArray
from pydelatin import Delatin
from rasterio.errors import NotGeoreferencedWarning
from rasterio.io import MemoryFile

from terratool.importing.sources import open_source
from terratool.importing.terrain.build import import_terrain
from terratool.importing.terrain.request import ImportOptions
from terratool.importing.types import PixelGrid, SampledHeights

Floats = NDArray[np.float64]


def fractal(rows: int, columns: int, falloff: float, seed: int) -> Floats:
    """Ground whose spectrum falls off by a power, 1000 m high."""
    rng = np.random.default_rng(seed)
    side = max(rows, columns)
    waves = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None])
    waves[0, 0] = 1.0
    noise = np.fft.rfft2(rng.standard_normal((side, side)))
    ground = np.fft.irfft2(noise * waves ** -(falloff / 2 + 0.5))[:rows, :columns]
    return np.asarray((ground - ground.min()) / np.ptp(ground) * 1000)


def town(rows: int, columns: int) -> Floats:
    """Houses at many angles on a slope, trees, and a laser's noise, 60 m high."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[0:rows, 0:columns].astype(float)
    ground = 0.02 * x + 0.01 * y
    for _ in range(rows * columns // 900):
        a, b = rng.uniform(0, columns), rng.uniform(0, rows)
        turn = rng.choice([0.0, 0.3, 0.3, 0.9])
        u = (x - a) * np.cos(turn) + (y - b) * np.sin(turn)
        v = (y - b) * np.cos(turn) - (x - a) * np.sin(turn)
        inside = (abs(u) < rng.uniform(4, 12)) & (abs(v) < rng.uniform(4, 20))
        roof = rng.uniform(4, 25) - rng.choice([0.0, 0.4]) * abs(u)
        ground[inside] = (0.02 * a + 0.01 * b + roof)[inside]
    return ground + rng.normal(0, 0.03, ground.shape)


def generated() -> dict[str, Floats]:
    """The DEMs by name."""
    return {
        "rough ground": fractal(700, 900, 1.5, 1),
        "mountains": fractal(1000, 1024, 2.2, 2),
        "smooth ground": fractal(900, 700, 3.0, 3),
        "town": town(400, 500),
    }


def lerc(heights: Floats, error: float) -> int:
    """Bytes of the smaller of GDAL's two."""
    return min(
        _geotiff(heights, max_z_error=error, compress="lerc_zstd", zstd_level=22),
        _geotiff(heights, max_z_error=error, compress="lerc_deflate", zlevel=9),
    )


def _geotiff(heights: Floats, **options: object) -> int:
    rows, columns = heights.shape
    profile = {"height": rows, "width": columns, "count": 1, "dtype": "float32", **options}
    with warnings.catch_warnings(), MemoryFile() as memory:
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with memory.open(driver="GTiff", **profile) as file:
            file.write(heights.astype(np.float32), 1)
        return len(memory.read())


def tin(heights: Floats, error: float) -> int:
    """Bytes of a TIN within the error at the pixels."""
    mesh = Delatin(heights.astype(np.float32), max_error=error)
    parts = mesh.vertices.astype(np.float32), mesh.triangles.astype(np.int32)
    return len(zlib.compress(b"".join(part.tobytes() for part in parts), 9))


def ours(heights: Floats, error: float, path: Path) -> tuple[int, str, float]:
    """Bytes, the method, and the error that was measured."""
    grid = PixelGrid(0.0, 0.0, 1.0, 1.0, heights.shape[1], heights.shape[0])
    report = import_terrain(
        SampledHeights(grid, heights), path, ImportOptions(error), overwrite=True
    )
    return report.size, report.method.sentence, report.bound


def sizes(dems: dict[str, Floats], folder: Path) -> None:
    """Compare bytes."""
    print(f"{'DEM':16} {'error':>9} {'ours':>9} {'÷ LERC':>7} {'÷ TIN':>7} {'÷ dense':>8}  method")
    for name, heights in dems.items():
        dense = _geotiff(heights, compress="deflate", predictor=3, zlevel=9)
        for share in (0.001, 0.003, 0.01, 0.03):
            error = share * float(np.ptp(heights))
            size, method, bound = ours(heights, error, folder / "out.json.gz")
            assert bound <= error
            print(
                f"{name:16} {error:9.4g} {size:9,} {size / lerc(heights, error):7.2f} "
                f"{size / tin(heights, error):7.2f} {size / dense:8.3f}  {method}",
                flush=True,
            )


def speed(folder: Path) -> None:
    """Pixels a second, against GDAL writing LERC, on one thread."""
    heights = fractal(2048, 2048, 2.2, 4)
    for share in (0.001, 0.01):
        error = share * 1000
        ours(heights, error, folder / "out.json.gz")
        pairs = []
        for _ in range(5):
            begin = time.perf_counter()
            ours(heights, error, folder / "out.json.gz")
            middle = time.perf_counter()
            _geotiff(heights, max_z_error=error, compress="lerc_deflate", zlevel=6)
            pairs.append((middle - begin, time.perf_counter() - middle))
        mine, theirs = np.median(pairs, axis=0)
        line(f"2048², error {share:.1%}: seconds against LERC_DEFLATE", mine / theirs, "-")
        print(f"   {heights.size / mine / 1e6:.1f} million pixels a second (5 asked)")


def memory(folder: Path) -> None:
    """Peak memory of a DEM that is read by rows."""
    side = 16384
    path = folder / "large.tif"
    tile = fractal(2048, 2048, 2.2, 5).astype(np.float32)
    profile = {"height": side, "width": side, "count": 1, "dtype": "float32", "tiled": True,
               "compress": "zstd", "blockxsize": 512, "blockysize": 512}  # fmt: skip
    with rasterio.open(path, "w", driver="GTiff", **profile) as file:
        for row in range(0, side, 2048):
            part = np.tile(np.concatenate([tile, tile[:, ::-1]], axis=1), side // 4096)
            file.write(part[:: -1 if row // 2048 % 2 else 1], 1,
                       window=((row, row + 2048), (0, side)))  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.perf_counter()
    with open_source(str(path)) as source:
        report = import_terrain(
            source, folder / "large.json.gz", ImportOptions(5.0), overwrite=True
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    seconds = time.perf_counter() - begin
    print(
        f"{side}²: {seconds:.0f} s, {side * side / seconds / 1e6:.1f} million pixels a second, "
        f"{report.size / 2**20:.0f} MiB written, memory from {before / 2**10:.0f} to "
        f"{peak / 2**10:.0f} MiB"
    )


def main() -> None:
    """Measure."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        dems = generated()
        if sys.argv[1:]:
            dems = {}
            for file in sys.argv[1:]:
                with open_source(file) as source:
                    heights = source.read(0, source.grid.rows)
                    dems[Path(file).stem[:16]] = np.nan_to_num(heights, nan=np.nanmin(heights))
        sizes(dems, folder)
        if not sys.argv[1:]:
            speed(folder)
            memory(folder)


if __name__ == "__main__":
    main()
