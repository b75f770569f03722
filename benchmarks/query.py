"""Batch queries against a dense DEM: compiled bilinear interpolation, and scipy's map_coordinates.

All on one thread, heights at the same random points.
"""

from __future__ import annotations

import math
import sys

import numpy as np
import terrains
from compiled import bilinear
from dems import dem_of
from measure import line, medians
from scipy.ndimage import map_coordinates

from terratool.definition.reader import check
from terratool.field.terrain import Terrain
from terratool.text.source import Source


def compare(name: str, points: int, pixels: int, scipy_points: int) -> None:
    """Measure one terrain."""
    definition = check(Source(name, terrains.text(getattr(terrains, name)()))).definition
    terrain = Terrain(definition)
    dem = dem_of(terrain, pixels)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 100, (2, points))
    out = np.empty(points)
    tasks = {
        "field": lambda: terrain.height(x, y),
        "bilinear": lambda: bilinear(dem, x, y, pixels / 100, out),
    }
    seconds = medians(tasks)
    label = f"{name.upper()}: "
    per_point = seconds["field"] / points * 1e9
    target = ">= 2" if pixels == 4096 else "> 1"
    line(
        f"{label}field against compiled bilinear on {pixels}² ({per_point:.1f} ns/point)",
        seconds["bilinear"] / seconds["field"],
        target,
    )
    if scipy_points:
        few = slice(scipy_points)
        rows = np.stack([y[few], x[few]]) * (pixels / 100) - 0.5
        seconds = medians(
            {
                "field": lambda: terrain.height(x[few], y[few]),
                "scipy": lambda: map_coordinates(dem, rows, order=1, mode="nearest"),
            }
        )
        line(f"{label}field against map_coordinates", seconds["scipy"] / seconds["field"], ">= 13")
        used = dem.nbytes / terrain.nbytes
        line(f"{label}memory of the {pixels}² DEM over that of the field", used, ">= 3000")
    else:
        each = terrain.nbytes / len(terrain.arrays.elements)
        line(f"{label}bytes an element over 50", each / 50, "<= 1")


def compare_free(size: float, points: int) -> None:
    """Measure elements at free places against as many over a point in cells of a lattice."""
    count = 100_000
    over = count * 5.05**2 / size**2
    free, lattice = (
        Terrain(check(Source("free", terrains.text(made))).definition)
        for made in (terrains.scattered(size), terrains.stacked(size, over))
    )
    x, y = np.random.default_rng(0).uniform(0, size, (2, points))
    seconds = medians({"free": lambda: free.height(x, y), "cells": lambda: lattice.height(x, y)})
    label = f"{count} free elements on {size / 1000:g} km"
    line(f"{label}: time over that of cells", seconds["free"] / seconds["cells"], "<= 2")
    more = (free.nbytes - lattice.nbytes) / count
    line(f"{label}: bytes more an element over 64", more / 64, "<= 1")


def compare_shared(points: int) -> None:
    """Measure 10^12 elements in parts against S2."""
    checked = check(Source("shared", terrains.text(terrains.shared())))
    plain = Terrain(check(Source("s2", terrains.text(terrains.s2()))))
    terrain = Terrain(checked)
    x, y = np.random.default_rng(0).uniform(0, 100, (2, points))
    seconds = medians(
        {
            "shared": lambda: terrain.height(x, y),
            "s2": lambda: plain.height(x, y),
            "compile": lambda: Terrain(checked),
        }
    )
    line("10^12 shared elements: time over that of S2", seconds["shared"] / seconds["s2"], "<= 2")
    line("10^12 shared elements: compiling over 0.1 s", seconds["compile"] / 0.1, "<= 1")
    line("10^12 shared elements: memory over 1 MB", terrain.nbytes / 2**20, "<= 1")


if __name__ == "__main__":
    quick = math.inf if "--quick" not in sys.argv else 200_000
    compare("s1", int(min(5_000_000, quick)), 4096, int(min(1_000_000, quick)))
    compare("s2", int(min(5_000_000, quick)), 4096, int(min(1_000_000, quick)))
    compare("s3", int(min(5_000_000, quick)), 20000, 0)
    compare_free(3000, int(min(2_000_000, quick)))
    compare_free(1000, int(min(2_000_000, quick)))
    compare_shared(int(min(1_000_000, quick)))
