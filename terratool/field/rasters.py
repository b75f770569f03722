"""Heights of grid primitives, as the kernels read them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.definition.curves import GridShape
from terratool.errors import RequestError
from terratool.field.records import RASTER, FieldArrays


def refuse_grids(arrays: FieldArrays, what: str) -> None:
    """Refuse a field with grids of heights for what does not know them, such as "A mesh".

    Raises:
        RequestError: an element of the field is a grid.
    """
    if len(arrays.curves.rasters):
        raise RequestError(
            f"{what} cannot be made of a terrain whose primitives are grids of heights.",
            "Describe the ground by curves: import-terrain makes rows of a DEM.",
        )


class RasterStore:
    """Store of the heights of grids, each grid once."""

    def __init__(self) -> None:
        self._known: dict[GridShape, int] = {}
        self._heights: list[NDArray[np.float64]] = []
        self._records: list[tuple[int, tuple[int, int], bool, bool]] = []
        self._count = 0

    def put(self, grid: GridShape) -> int:
        """Index of a grid among the rasters, storing a new one."""
        if grid not in self._known:
            heights = np.array(grid.rows, np.float64)  # None becomes NaN
            rows, columns = heights.shape
            voids = bool(np.isnan(heights).any())
            self._known[grid] = len(self._records)
            self._records.append(
                (self._count, (columns, rows), grid.registration == "pixel", voids)
            )
            self._heights.append(heights.ravel())
            self._count += heights.size
        return self._known[grid]

    def rasters(self) -> NDArray[Any]:
        """All grids, RASTER."""
        return np.array(self._records, RASTER)

    def heights(self) -> NDArray[np.float64]:
        """Heights of all grids, (n,), NaN for void ones."""
        return np.concatenate([np.zeros(0), *self._heights])
