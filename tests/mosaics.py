"""Helpers for rasters: a terrain that shows flips and shifts, exports, what a folder holds."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from terratool.field.terrain import Terrain
from terratool.raster import export, mosaic
from terratool.raster.export import RasterReport, RasterRequest
from terratool.raster.grid import Grid
from terratool.raster.journal import NAME

# asymmetric and oblong, with all that layers need; 12 × 8 at 0.01 is 1200 × 800 pixels
SITE: dict[str, Any] = {
    "size": [12, 8],
    "origin": [500000, 4649776],
    "crs": "EPSG:32633",
    "descr": "A site <&> so on",
    "surfTypes": {
        "rock": {"color": [120, 40, 30], "cohesion": 8.5, "fricAngle": 32, "sinkage": 0.03},
        "hole & void": {"void": True},
        "sand": {"color": [194, 178, 128], "cohesion": 1.04, "sonarRefl": 0.25},
    },
    "elemTypes": {
        "slope": {"x": [0, 1, 1.5], "y": [1, 3]},
        "box": {"x": [1]},
        "cone": {"combine": "radial", "x": "tent"},
    },
    "elemTree": {
        "type": "slope",
        "surface": "rock",
        "cells": [6, 4],
        "children": [
            {"type": "box", "cellX": 4, "cellY": 2, "vScale": 5, "turnDeg": 30, "surface": "sand"},
            {"type": "box", "cellX": 0, "cellY": 3, "surface": "hole & void"},
            {"type": "cone", "cellX": 1, "cellY": 0, "span": [2, 1], "vScale": 2},
        ],
    },
}
ALL = (
    "height", "surface", "slope", "aspect", "normal", "cohesion", "friction", "sinkage", "sonar",
    "color", "hillshade",
)  # fmt: skip


def export_dem(
    terrain: Terrain, grid: Grid, path: Path, layers: Any = ("height",), *,
    cog: bool = False, **options: Any,
) -> RasterReport:  # fmt: skip
    """Write a raster; the options are those of a request."""
    return export.export_dem(terrain, grid, path, RasterRequest(layers, **options), cog=cog)


def export_mosaic(
    terrain: Terrain, grid: Grid, folder: Path, index: Path | None = None,
    layers: Any = ("height",), *, tile_size: int = 512, dask: str | None = None,
    progress: Any = None, **options: Any,
) -> RasterReport:  # fmt: skip
    """Write a mosaic; the options are those of a request."""
    request = RasterRequest(layers, **options)
    return mosaic.export_mosaic(
        terrain, grid, folder, index, request, tile_size=tile_size, dask=dask, progress=progress
    )


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a mosaic but its journal, whose lines come in the order of completion."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != NAME
    }


def finished(folder: Path) -> int:
    """Tiles of which the journal has a line."""
    journal = folder / NAME
    return journal.read_bytes().count(b'\\"tile\\"') if journal.exists() else 0


def wait_until(condition: Callable[[], object], seconds: float = 120) -> None:
    """Wait for a condition that will come true."""
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "this has not come true"
        os.sched_yield()
