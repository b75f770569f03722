"""Rasters of classes of elements, as the kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.curves import GridShape
from terratool.definition.grid_files import LinkedSurfaceGrid
from terratool.definition.model import Definition, SurfaceGrid
from terratool.field.rasters import RasterStore
from terratool.field.records import CLASS_GRID, ClassArrays


class ClassColumn(NamedTuple):
    """Index of each element's raster of classes, (n,) int64, -1 for none; and all rasters."""

    of: NDArray[np.int64]
    grids: tuple[SurfaceGrid, ...]


def class_column(values: Sequence[Any]) -> ClassColumn:
    """Number the rasters of classes among values of `surface_grid`, `UNSET` for none."""
    known: dict[Any, int] = {UNSET: -1}
    for value in values:
        known.setdefault(value, len(known) - 1)
    grids = tuple(value for value in known if value is not UNSET)
    return ClassColumn(np.array([known[value] for value in values], np.int64), grids)


def class_arrays(
    grids: Sequence[SurfaceGrid], definition: Definition, rasters: RasterStore
) -> ClassArrays:
    """Return rasters of classes with the surfaces of these, and put their numbers into a store.

    Raises:
        RequestError: a raster was not looked for.
    """
    surfaces = {name: index for index, name in enumerate(definition.surfaces)}
    voids = [surface.void is True for surface in definition.surfaces.values()]
    found = np.zeros(len(grids), CLASS_GRID)
    pairs: list[tuple[int, int]] = []
    for record, grid in zip(found, grids, strict=True):
        source = grid.source if isinstance(grid, LinkedSurfaceGrid) else None
        record["raster"] = rasters.put(GridShape((), "pixel", source))
        record["first"], record["count"] = len(pairs), len(grid.names)
        pairs += sorted((int(number), surfaces[name]) for number, name in grid.names.items())
    worn = [surface for _, surface in pairs]
    return ClassArrays(
        found,
        np.array([number for number, _ in pairs], np.float64),
        np.array(worn, np.int32),
        np.array([voids[surface] for surface in worn], np.uint8),
    )
