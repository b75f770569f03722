"""The clocks of the project in one short run, beside the last recorded ones.

    python benchmarks/clocks.py [--record]

Each is a ratio of two times of processors from this run, but for the compiler's, whose times are
those of the clock and the last build. The figure in parentheses is that of this machine. Recorded
ones stand in clocks.json; `--record` writes them.
"""

from __future__ import annotations

import gc
import json
import math
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import compiled
import msgspec
import numpy as np
import startup
import terrains
from dems import dem_of, ready, write_ready
from measure import medians, processor
from mistakes import broken

from terratool import kernels
from terratool.definition.model import Definition
from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.export import RasterRequest, export_dem
from terratool.raster.grid import grid_over
from terratool.text.source import Source

ROOT = Path(__file__).resolve().parent.parent
RECORDED = Path(__file__).with_suffix(".json")
MISTAKES = "an unknown name in every element", "a number out of range near the end"
PIXELS = 8192
POINTS = 1_000_000


class Clock(NamedTuple):
    """A ratio, the target it has, and the figure that it comes from."""

    name: str
    ratio: float
    target: str
    figure: str


def validating() -> Iterator[Clock]:
    """Check S3, with errors and without, against the bare typed decoding of the valid text."""
    data = terrains.text(terrains.s3())
    sources = {kind: Source("s3", broken(data, kind)) for kind in ("clean", *MISTAKES)}
    checks = {kind: partial(check, source) for kind, source in sources.items()}
    gc.disable()
    decode = partial(msgspec.json.decode, data, type=Definition)
    seconds = medians({"decode": decode, **checks}, runs=1, clock=processor)
    gc.enable()
    for kind in checks:
        target = "<= 3" if kind == "clean" else "<= 10"
        ratio, figure = seconds[kind] / seconds["decode"], f"{seconds[kind]:.2f} s"
        yield Clock(f"check of 10^6 elements, {kind}, over decoding", ratio, target, figure)


def expanding() -> Iterator[Clock]:
    """Write out copies, against the typed decoding of as many elements."""
    written, parts = terrains.text(terrains.s3(sides=(6, 6, 6))), terrains.shared(6)
    shared = check(Source("shared", terrains.text(parts)))
    assert shared.uses is not None
    seconds = medians(
        {
            "decode": partial(msgspec.json.decode, written, type=Definition),
            "expand": partial(Terrain, shared, share_above=math.inf),
        },
        runs=3,
        clock=processor,
    )
    each = seconds["expand"] / shared.uses.elements
    decoded = seconds["decode"] / sum(32**level for level in range(4))
    name = "expanding and compiling of copies, an element, over its decoding"
    yield Clock(name, each / decoded, "none", f"{each * 1e6:.2f} µs")


def exporting(folder: Path) -> Iterator[Clock]:
    """Write a DEM without overviews, against rasterio's writing of the ready array."""
    terrain = Terrain(check(Source("s2", terrains.text(terrains.s2()))))
    grid = grid_over(terrain, 100 / PIXELS)
    heights = ready(terrain, grid)
    request = RasterRequest(overviews=False, overwrite=True)
    seconds = medians(
        {
            "ready": lambda: write_ready(heights, grid, folder / "ready.tif"),
            "export": lambda: export_dem(terrain, grid, folder / "out.tif", request),
        },
        runs=3,
        clock=processor,
    )
    name = f"export-dem of {PIXELS}² without overviews over rasterio's writing"
    yield Clock(name, seconds["export"] / seconds["ready"], "<= 1.15", f"{seconds['export']:.2f} s")


def querying() -> Iterator[Clock]:
    """Ask for heights and samples, against compiled bilinear interpolation in a DEM of 4096²."""
    for name in ("s1", "s2"):
        terrain = Terrain(check(Source(name, terrains.text(getattr(terrains, name)()))))
        dem = dem_of(terrain, 4096)
        x, y = np.random.default_rng(0).uniform(0, 100, (2, POINTS))
        tasks = {
            "bilinear": partial(compiled.bilinear, dem, x, y, 40.96, np.empty(POINTS)),
            "heights": partial(terrain.height, x, y),
            "samples": partial(terrain.sample, x, y),
        }
        seconds = medians(tasks, clock=processor)
        for task in ("heights", "samples"):
            ratio = seconds[task] / seconds["bilinear"]
            figure = f"{seconds[task] / POINTS * 1e9:.1f} ns a point"
            target = "<= 0.5" if task == "heights" else "none"
            yield Clock(f"{task} of {name.upper()} over a DEM's", ratio, target, figure)


def starting(folder: Path) -> Iterator[Clock]:
    """Start commands on a sample, against `import click` and `import numpy` alone."""
    tasks = {
        name: partial(startup.run, sys.executable, "-m", "terratool", *arguments)
        for name, arguments in startup.commands(folder).items()
        if name in ("--help", "validate", "query")
    }
    plain = {
        name: partial(startup.run, sys.executable, "-c", f"import {name}")
        for name in startup.MODULES
    }
    seconds = medians(plain | tasks, clock=processor)
    for name, module, target in (
        ("--help", "click", "<= 2.5"), ("validate", "click", "<= 2.5"), ("query", "numpy", "<= 5")
    ):  # fmt: skip
        ratio = seconds[name] / seconds[module]
        figure = f"{seconds[name] * 1e3:.0f} ms"
        yield Clock(f"terratool {name} over import {module}", ratio, target, figure)


def compiling() -> Iterator[Clock]:
    """Read in Ninja's log how long the kernels of the variant in use took, against nanobind."""
    for path in ROOT.glob("build/cp*/.ninja_log"):
        rows = [line.split("\t") for line in path.read_text("utf-8").splitlines()[1:]]
        took = {row[3]: (int(row[1]) - int(row[0])) / 1000 for row in rows if row[3].endswith(".o")}
        ours = sum(took[name] for name in took if f"kernels_{kernels.variant}.dir" in name)
        theirs = sum(took[name] for name in took if "nanobind" in name)
        name = "one variant of the kernels over nanobind, as they were last compiled"
        yield Clock(name, ours / theirs, "none", f"{ours:.0f} s")


def main() -> None:
    recorded = json.loads(RECORDED.read_text()) if RECORDED.exists() else {}
    found = {}
    print(f"{'times of processors':82} {'ratio':>8} {'recorded':>9}   target")
    with tempfile.TemporaryDirectory(dir=Path.cwd(), prefix=".clocks-") as name:
        folder = Path(name)
        for clocks in (
            querying(), exporting(folder), starting(folder), expanding(), validating(), compiling()
        ):  # fmt: skip
            for clock in clocks:
                found[clock.name] = round(clock.ratio, 2)
                last = recorded.get(clock.name)
                before = "—" if last is None else f"{last:.2f}"
                label = f"{clock.name} ({clock.figure})"
                print(f"{label:82} {clock.ratio:8.2f} {before:>9}   {clock.target}", flush=True)
    if "--record" in sys.argv:
        RECORDED.write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n", "utf-8")
        print(f"Recorded in {RECORDED.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
