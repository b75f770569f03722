"""Mosaics: what a tile costs, alone and by Dask, what the terrain's journey does, and a planet."""

from __future__ import annotations

import functools
import pickle
import resource
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import terrains
from measure import line, medians
from painting import busy, on_two_threads

from terratool.cluster import local_cluster
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.export import RasterRequest, export_dem
from terratool.raster.grid import Grid, grid_over
from terratool.raster.mosaic import TILE_SIZE, export_mosaic
from terratool.text.source import Source

PLANET = 1.44e14
"""Square metres of Mars."""


def said(what: str, value: str) -> None:
    """Print a number that is no ratio."""
    print(f"{what:66} {value}", flush=True)


def compiled(text: bytes) -> Terrain:
    return Terrain(check(Source("benchmark", text)))


def mosaic(
    terrain: Terrain, grid: Grid, folder: Path, tile_size: int, dask: str | None = None,
    **options: Any,
) -> None:  # fmt: skip
    """Write a mosaic; the options are those of a request."""
    export_mosaic(
        terrain, grid, folder, request=RasterRequest(**options), tile_size=tile_size, dask=dask
    )


def tiles(name: str, terrain: Terrain, grid: Grid, folder: Path, address: str, runs: int) -> float:
    """Measure ways to make the same tiles; seconds of one thread for a tile of 4096²."""
    fresh: Callable[..., object] = functools.partial(
        mosaic, terrain, grid, tile_size=min(TILE_SIZE, grid.width // 2), overwrite=True
    )
    kept = folder / "kept"
    fresh(kept)
    rounds = 200_000_000
    seconds = medians(
        {
            "file": lambda: export_dem(
                terrain,
                grid,
                folder / "one.tif",
                RasterRequest(threads=2, overviews=False, overwrite=True),
            ),
            "one": lambda: fresh(folder / "tiles", threads=1),
            "two": lambda: fresh(folder / "tiles", threads=2),
            "dask": lambda: fresh(folder / "tiles", dask=address),
            "kept": lambda: fresh(kept, threads=1, overwrite=False),
            "alone": lambda: busy(rounds),
            "together": lambda: on_two_threads(rounds),
        },
        runs,
    )
    label = f"{name.upper()} {grid.width}²: "
    ratio = seconds["alone"] / seconds["together"]
    line(
        f"{label}tiles against a single file, two threads",
        seconds["two"] / seconds["file"],
        "<= 1.15",
    )
    line(
        f"{label}two threads against one ({ratio:.2f} for mere arithmetic)",
        seconds["one"] / seconds["two"],
        ">= 1.7",
    )
    line(
        f"{label}two workers of Dask against two threads",
        seconds["dask"] / seconds["two"],
        "<= 1.15",
    )
    line(
        f"{label}tiles that are kept against made ones", seconds["kept"] / seconds["one"], "<= 0.25"
    )
    count = grid.width * grid.height / TILE_SIZE**2
    said(f"{label}one thread for a tile of {TILE_SIZE}²", f"{seconds['one'] / count:8.2f} s")
    size = sum(path.stat().st_size for path in kept.glob("tile-*.tif")) / count
    said(f"{label}a tile of {TILE_SIZE}² on the disk", f"{size / 1e6:8.1f} MB")
    return seconds["one"] / count


def errand(terrain: Terrain, grid: Grid, folder: Path, address: str, runs: int) -> None:
    """Measure what Dask itself takes for a tile: many small ones that need only be looked at."""
    again = functools.partial(mosaic, terrain, grid, folder, tile_size=512, losses=False)
    again(threads=2)
    seconds = medians({"two": lambda: again(threads=2), "dask": lambda: again(dask=address)}, runs)
    count = len(list(folder.glob("tile-*.tif")))
    said(
        f"Dask itself, for each of {count} tiles",
        f"{(seconds['dask'] - seconds['two']) / count * 1000:8.2f} ms",
    )


def journey(name: str, text: bytes, terrain: Terrain, cluster: object, runs: int) -> None:
    """Measure how the terrain could reach two workers."""
    from distributed import Client

    packed = pickle.dumps(terrain, 5)
    with Client(cluster, set_as_default=False) as client:

        def sent(value: bytes, then: Callable[[bytes], object]) -> None:
            there = client.scatter(value, broadcast=True, hash=False)
            done = [
                client.submit(_length, then, there, workers=[worker], pure=False)
                for worker in client.nthreads()
            ]
            client.gather(done)

        seconds = medians({"compiled": lambda: sent(packed, pickle.loads)}, runs)
        # takes so long, where it matters, that once is enough
        seconds |= medians({"text": lambda: sent(text, compiled)}, 1)
    label = f"{name.upper()} to two workers: "
    line(
        f"{label}compiled against text that each compiles",
        seconds["compiled"] / seconds["text"],
        "<= 1",
    )
    said(f"{label}compiled, {len(packed) / 1e6:.1f} MB", f"{seconds['compiled']:8.3f} s")
    said(f"{label}text, {len(text) / 1e6:.1f} MB", f"{seconds['text']:8.3f} s")


def _length(then: Callable[[bytes], object], value: bytes) -> int:
    then(value)
    return len(value)


def main() -> None:
    quick = "--quick" in sys.argv
    pixels, runs = (1024, 1) if quick else (8192, 3)
    seconds = {}
    with (
        local_cluster(2) as cluster,
        tempfile.TemporaryDirectory(dir=".", prefix=".scaling-") as name,
    ):
        for terrain_name in ("s1", "s3"):
            text = terrains.text(getattr(terrains, terrain_name)())
            terrain = compiled(text)
            grid = grid_over(terrain, 100 / pixels)
            address = cluster.scheduler_address
            seconds[terrain_name] = tiles(terrain_name, terrain, grid, Path(name), address, runs)
            journey(terrain_name, text, terrain, cluster, runs)
            if terrain_name == "s1":
                errand(terrain, grid, Path(name) / "small", address, runs)
            shutil.rmtree(Path(name) / "tiles")
            shutil.rmtree(Path(name) / "kept")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    said("Most memory of this process, S3 and its text included", f"{peak:8.0f} MB")
    count = PLANET / TILE_SIZE**2
    said(f"Mars at 1 m: tiles of {TILE_SIZE}²", f"{count / 1e6:8.2f} million")
    for terrain_name, each in seconds.items():
        days = count * each / 86400
        said(
            f"Mars at 1 m, tiles like those of {terrain_name.upper()}",
            f"{days:8.0f} core-days, {days * 24 / 1000:.1f} hours of 1000 cores",
        )


if __name__ == "__main__":
    main()
