"""Painting heights and surfaces against a plain fill of the two arrays, on one and two threads.

And what slopes, labels and the statement of loss cost beside them.
"""

from __future__ import annotations

import math
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import terrains
from compiled import busy
from measure import line, medians

from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, Window, grid_over
from terratool.raster.loss import LossCounts, LossFinder
from terratool.raster.painter import Painter, Planes
from terratool.text.source import Source


def on_two_threads(rounds: int) -> None:
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(busy, [rounds // 2, rounds // 2]))


def paint_rows(painter: Painter, window: Window, planes: Planes) -> None:
    """Bands of rows on two threads."""

    def paint(part: Window) -> None:
        rows = slice(part.row, part.row + part.height)
        painter.paint(part, Planes(planes.heights[rows], planes.surfaces[rows]))

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(paint, window.cut(132, window.width)))


def compare(name: str, terrain: Terrain, pixels: int, runs: int) -> None:
    """Measure one terrain."""
    grid = grid_over(terrain, 100 / pixels)
    window = Window(0, 0, pixels, pixels)
    painter = Painter(terrain, grid)
    planes = painter.blank(window)
    assert planes.surfaces is not None
    sloped = Painter(terrain, grid, slopes=True)
    labelled = Painter(terrain, grid, slopes=True, labels=True)
    more = labelled.blank(window)

    def fill() -> None:
        planes.heights.fill(1.0)
        planes.surfaces.fill(1)

    rounds = 200_000_000
    seconds = medians(
        {
            "fill": fill,
            "one": lambda: painter.paint(window, planes),
            "two": lambda: paint_rows(painter, window, planes),
            "slopes": lambda: sloped.paint(window, more._replace(labels=None)),
            "labels": lambda: labelled.paint(window, more),
            "alone": lambda: busy(rounds),
            "together": lambda: on_two_threads(rounds),
        },
        runs,
    )
    speed = pixels * pixels / seconds["one"] / 1e6
    target = ("<= 16" if name == "s3" else "<= 4") if pixels == 16384 else "none"
    label = f"{name.upper()} {pixels}²: "
    line(
        f"{label}painting against the fill ({speed:.0f} Mpixel/s)",
        seconds["one"] / seconds["fill"],
        target,
    )
    line(
        f"{label}two threads ({seconds['alone'] / seconds['together']:.2f} for mere arithmetic)",
        seconds["one"] / seconds["two"],
        ">= 1.7" if pixels == 16384 else "none",
    )
    line(f"{label}with slopes against without", seconds["slopes"] / seconds["one"], "none")
    line(
        f"{label}with slopes and labels against without",
        seconds["labels"] / seconds["one"],
        "none",
    )


def compare_losses(name: str, terrain: Terrain, pixels: int, runs: int) -> None:
    """What it costs to say what the pixels lose, window by window as files are written."""
    grid = grid_over(terrain, 100 / pixels)
    windows = list(grid.windows(512, 8192))
    painter, labelled = Painter(terrain, grid), Painter(terrain, grid, labels=True)
    found = LossFinder(terrain, grid)
    around = [found.with_neighbours(window) for window in windows]
    planes = [labelled.paint(window) for window in around]
    whole = sum(map(found.of, windows, planes), LossCounts())
    seconds = medians(
        {
            "paint": lambda: [painter.paint(window) for window in windows],
            "labels": lambda: [labelled.paint(window) for window in around],
            "losses": lambda: [found.of(*pair) for pair in zip(windows, planes, strict=True)],
            "statement": lambda: found.statement(whole, 0),
        },
        runs,
    )
    label = f"{name.upper()} {pixels}²: "
    added = seconds["labels"] - seconds["paint"] + seconds["losses"] + seconds["statement"]
    line(f"{label}losses against painting", added / seconds["paint"], "none")
    line(
        f"{label}… of which the statement ({seconds['statement']:.2f} s)",
        seconds["statement"] / seconds["paint"],
        "none",
    )


def compare_shared(runs: int) -> None:
    """Parts that are shared against the same 10^6 elements written out, and 10^12 alone."""
    checked, many = (
        check(Source("shared", terrains.text(terrains.shared(count)))) for count in (10, 100)
    )
    shared, plain = Terrain(checked, share_above=0), Terrain(checked, share_above=math.inf)
    for pixels in (256, 1024, 4096):
        grid = grid_over(shared, 100 / pixels)
        tasks = {}
        for name, terrain in (("shared", shared), ("plain", plain)):
            painter = Painter(terrain, grid)
            tasks[name] = partial(painter.paint, grid.whole, painter.blank(grid.whole))
        seconds = medians(tasks, runs)
        ratio = seconds["shared"] / seconds["plain"]
        line(f"10^6 shared elements, {pixels}²: time over that written out", ratio, "<= 1.5")
    terrain = Terrain(many)
    for zoom in (1, 100, 10_000):
        grid = Grid(37.0, 21.0, 60.0 / zoom / 4096, 4096, 4096)
        painter = Painter(terrain, grid)
        paint = partial(painter.paint, grid.whole, painter.blank(grid.whole))
        seconds = medians({"paint": paint}, 1)
        speed = 4096**2 / seconds["paint"] / 1e6
        line(f"10^12 shared elements, {zoom} times as large: Mpixel/s", speed, "none")


if __name__ == "__main__":
    sizes = (1024,) if "--quick" in sys.argv else (4096, 16384)
    for name in ("s1", "s2", "s3"):
        definition = check(Source(name, terrains.text(getattr(terrains, name)()))).definition
        terrain = Terrain(definition)
        for pixels in sizes:
            compare(name, terrain, pixels, runs=7)
        compare_losses(name, terrain, sizes[0], runs=3)
    compare_shared(runs=3)
