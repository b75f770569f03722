"""Heights of grid primitives, as the kernels read them."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.definition.curves import GridShape
from terratool.definition.grid_files import GridSource
from terratool.errors import RequestError
from terratool.field.records import RASTER, MappedGrids


class RasterStore:
    """Store of the heights of grids, each grid once."""

    def __init__(self) -> None:
        self._known: dict[GridShape, int] = {}
        self._files: dict[GridSource, int] = {}

    def put(self, grid: GridShape) -> int:
        """Index of a grid among the rasters, storing a new one.

        Raises:
            RequestError: the grid is a file that was not looked for.
        """
        if grid not in self._known:
            self._known[grid] = len(self._known)
            if grid.source is not None:
                self._files.setdefault(grid.source, len(self._files))
            elif not grid.rows:
                raise RequestError(
                    "The heights of a grid stand in a file that was not looked for.",
                    "Load the definition from its file, or from its text.",
                )
        return self._known[grid]

    def curves(self) -> tuple[NDArray[Any], NDArray[np.float64], MappedGrids]:
        """All grids, RASTER, the heights of those of texts, (n,), and those of files.

        Raises:
            ReadError: a file has changed since its header was read, or is broken.
        """
        mapped = MappedGrids(tuple(self._files))
        rasters = np.zeros(len(self._known), RASTER)
        heights: list[NDArray[np.float64]] = [np.zeros(0)]
        first = 0
        for raster, grid in zip(rasters, self._known, strict=True):
            raster["pixel"] = grid.registration == "pixel"
            if grid.source is not None:
                file = self._files[grid.source]
                facts = mapped.facts(file)
                raster["file"], raster["voids"], raster["single"] = file, facts.voids, facts.single
                raster["count"] = grid.source.columns, grid.source.rows
                continue
            own = np.array(grid.rows, np.float64)  # None becomes NaN
            raster["file"], raster["first"] = -1, first
            raster["voids"], raster["count"] = np.isnan(own).any(), own.shape[::-1]
            heights.append(own.ravel())
            first += own.size
        return rasters, np.concatenate(heights), mapped


@lru_cache(maxsize=64)
def grid_digest(grid: GridShape) -> str:
    """Digest of the numbers of a grid and of where they stand, equal for rows and for a file.

    Raises:
        ReadError: the file has changed since its header was read, or is broken.
    """
    if grid.source is None:
        numbers: NDArray[Any] = np.array(grid.rows, np.float64)
    else:
        numbers = MappedGrids((grid.source,)).numbers(0)
    found = hashlib.blake2b(repr((grid.registration, numbers.shape)).encode(), digest_size=16)
    for row in numbers:
        found.update(row.astype(np.float64) + 0.0)  # 0.0 turns -0.0 into 0.0, which is equal to it
    return found.hexdigest()
