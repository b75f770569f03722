"""Cells of maps for navigation: square, over all of a terrain, and what a vehicle makes of each."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.raster.grid import Grid, count_pixels, refuse_resolution, resolution_within
from terratool.raster.prefetch import processors
from terratool.text.display import counted
from terratool.traversability.map import MapBuilder, stream_map
from terratool.traversability.results import GroundClass
from terratool.traversability.soil import turnings
from terratool.traversability.survey import Surveyor
from terratool.traversability.vehicle import Vehicle, load_vehicle

DEFAULT_SIDE = 0.05
"""The side of a cell if none is said, in units of the terrain: what maps of Nav2 mostly have."""
MOST_CELLS = 1 << 28
"""What is kept of so many takes about 2 GB."""


def cell_grid(terrain: Terrain, resolution: float | None, most: int) -> Grid:
    """Cells that cover all of a terrain, counted from its south-west corner.

    Where their side does not divide that of the terrain, the last ones reach over its edge.

    Args:
        terrain: the ground.
        resolution: side of a cell; if None `DEFAULT_SIDE`, or what makes …
        most: … so many cells on the longer side.

    Raises:
        RequestError: the resolution is no number above 0, or makes too many cells.
    """
    west, south, east, north = terrain.bounds
    width, depth = east - west, north - south
    if resolution is None:
        resolution = min(DEFAULT_SIDE, width, depth)
        if count_pixels(max(width, depth), resolution) > most:
            resolution, _ = resolution_within(width, depth, most)
    refuse_resolution(resolution)
    columns, rows = count_pixels(width, resolution), count_pixels(depth, resolution)
    if columns * rows > MOST_CELLS:
        raise RequestError(
            f"A resolution of {resolution:g} makes {counted(columns * rows, 'cell')}.",
            f"Give a coarser one with --resolution; {counted(MOST_CELLS, 'cell')} can be written.",
        )
    return Grid(west, south, resolution, rows, columns)


def ground_classes(
    terrain: Terrain, vehicle: Vehicle, grid: Grid, progress: Callable[[str], object]
) -> NDArray[np.uint8]:
    """What each cell is to a vehicle whose middle stands there.

    Args:
        terrain: the ground, with all parts written out.
        vehicle: is judged with the headings of a map of traversability.
        grid: the cells.
        progress: is called with words that say how far it is.

    Returns:
        (height, width) uint8 `GroundClass`, rows from the north; UNKNOWN where there is no ground.

    Raises:
        RequestError: the cells are too coarse or too fine for the vehicle.
    """
    surveyor = Surveyor(terrain, vehicle, grid)
    builder = MapBuilder(terrain, surveyor, False, turnings(terrain, vehicle))
    total, done = grid.width * grid.height, 0

    def told(more: int) -> None:
        nonlocal done
        done += more
        progress(f"judging {vehicle.name}, {100 * done // total} %")

    stream_map(surveyor, builder, None, processors(), told)
    classes, _ = builder.classes(None, vehicle.area)
    classes[~builder.ground] = GroundClass.UNKNOWN
    return classes


def drivable(classes: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where a vehicle can be driven to, and away from again."""
    return np.asarray((classes == GroundClass.GO) | (classes == GroundClass.CAUTION))


def classes_told(path: Path, classes: NDArray[np.uint8]) -> dict[str, Any]:
    """Which vehicle judged, and how, for a manifest."""
    counts = np.bincount(classes.ravel(), minlength=len(GroundClass)).tolist()
    return {
        "vehicle": {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()},
        "classes": {one.label: count for one, count in zip(GroundClass, counts, strict=True)},
    }


def judging(path: Path | None) -> Vehicle | None:
    """The vehicle of a file; None for none.

    Raises:
        ReadError: it cannot be read.
        DefinitionError: it has errors.
    """
    return None if path is None else load_vehicle(path)
