"""Maps of scans: fused from files, and in any form in which they are compared with a terrain."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rasterio.transform import Affine

from terratool.api.options import fill, listed, takes
from terratool.errors import RequestError
from terratool.importing.arrays import PlacedArray, sampled_array
from terratool.io.crs import read_crs
from terratool.raster.grid import Grid
from terratool.sensing.map_files import MapFile, heights_map, map_of, read_map, write_map
from terratool.sensing.map_request import MapRequest
from terratool.sensing.robot_map import RobotMap

AnyMap = str | Path | RobotMap | ArrayLike | PlacedArray
"""A map: path of its file, one of `terratool.map_scans`, or an array of heights."""
_SQUARE = 1e-9
"""Largest difference of a pixel's sides, as a share of them."""


@takes(MapRequest, called="map_scans")
def map_scans_of(
    scans: str | Path | Sequence[str | Path], output: str | Path | None = None, **options: Any
) -> RobotMap:
    """Fuse scans into the map that a robot would have made of them, as `terratool map` does.

    `level(0)` of the result has its finest cells as arrays, and `compare` of a terrain says how
    good it is.

    Args:
        scans: paths of clouds of points in the world's axes, or a single one.
        output: GeoTIFF to write, with one more for each level; None for no file.
        **options: options of `MapRequest`, by name.

    Raises:
        RequestError: an option makes no sense, points are in the axes of a sensor, or there are no
            readings or too many cells.
        ReadError, DefinitionError: a file cannot be read, or has errors.
        WriteError: a file exists, or cannot be written.
    """
    if options.get("resolution") is None:
        raise RequestError("Nothing says how large cells are.", "Give resolution.")
    request, paths = fill(MapRequest, options), listed(scans)
    if output is None:
        for name in ("bag", "crs"):
            if options.get(name) is not None:
                raise RequestError(f"{name} is about files, but none is named.", "Give output.")
        return request.read(paths)
    wanted = request.output_of(output, paths)
    made = request.read(paths)
    write_map(made, wanted)
    return made


def refuse_transform(transform: object, what: str = "a file is named") -> None:
    """Refuse a transform beside a file or a map, which have their own.

    Raises:
        RequestError: there is a transform.
    """
    if transform is not None:
        raise RequestError(f"A transform is about arrays, but {what}.", "Leave it out.")


def any_map(
    given: AnyMap, level: int = 0, transform: Affine | Sequence[float] | None = None
) -> MapFile:
    """Map in any form, as it is compared with a terrain.

    Args:
        given: path, map or heights.
        level: level of a map of `map_scans`, 0 for the finest.
        transform: affine transform of an array, as rasterio has it.

    Raises:
        ReadError: the file cannot be read.
        RequestError: there is no such level, an array has no place or pixels that are oblong, or
            there is a transform for what is no array.
    """
    if isinstance(given, RobotMap):
        refuse_transform(transform, "a map of map_scans is given")
        return map_of(given, level)
    if level:
        raise RequestError("A level is about maps of map_scans.", "Leave it out.")
    if isinstance(given, str | Path):
        refuse_transform(transform)
        return read_map(given)
    sampled = sampled_array(given, transform)
    if np.isnan(sampled.values).all():
        raise RequestError("The array has no heights.", "Give a number where there is one.")
    pixels = sampled.grid
    if abs(pixels.dx - pixels.dy) > _SQUARE * pixels.dx:
        raise RequestError(
            f"The pixels of the array are {pixels.dx:g} by {pixels.dy:g}.", "Give square ones."
        )
    grid = Grid(pixels.west, pixels.south, pixels.dx, pixels.rows, pixels.columns)
    system = None if pixels.crs is None else read_crs(pixels.crs)
    return heights_map(sampled.values[::-1], grid, system)
