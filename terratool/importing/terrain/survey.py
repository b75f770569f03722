"""The first reading of a DEM: how high it is, where it is unknown, what covers it."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.rasters import ClassRaster, open_classes
from terratool.importing.sources import HeightSource, sample_range
from terratool.importing.terrain.writing import Spool, element
from terratool.kernels import importing as kernels

MOST_IN_MEMORY = 1 << 24
"""DEMs of up to this many pixels are held in memory; larger ones are read by rows, twice."""

REACH = 512
"""Pixels that GDAL looks around itself."""

_ROWS = 256
_VOID = int(np.iinfo(np.int64).max)
"""A class of its own, for pixels without a height."""

Progress = Callable[[int], object]


@dataclass(slots=True)
class Survey:
    """What one reading of all rows shows.

    Attributes:
        low, high: of the heights.
        unknown: pixels without one.
        heights: (rows, columns) float64, row 0 the southernmost, if they fit into memory.
        cover: elements in a grid of pixels that carry surfaces, and the void.
        surface_types: the surfaces by name, as the definition has them.
        surfaces: pixels of each.
        notes: sentences about the source and what was found.
    """

    low: float = math.inf
    high: float = -math.inf
    unknown: int = 0
    heights: NDArray[np.float64] | None = None
    cover: Spool = field(default_factory=Spool)
    surface_types: dict[str, Any] = field(default_factory=dict)
    surfaces: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def survey_of(source: HeightSource, classes: str | None, fill: bool, progress: Progress) -> Survey:
    """Read all rows once.

    Args:
        source: the DEM.
        classes: name of a raster of classes, or None.
        fill: whether unknown heights are filled, as far as they are held in memory; if not, the
            void covers them.
        progress: gets numbers of pixels.

    Raises:
        ReadError: a file is broken, or there is no height at all.
    """
    grid = source.grid
    survey = Survey()
    counts: dict[int, int] = {}
    with ExitStack() as stack:
        raster = None if classes is None else stack.enter_context(open_classes(classes, grid))
        if grid.rows * grid.columns <= MOST_IN_MEMORY:
            survey.heights = np.empty((grid.rows, grid.columns))
        # from the north, as files are read the quickest
        for first in reversed(range(0, grid.rows, _ROWS)):
            heights = source.read(first, min(_ROWS, grid.rows - first))
            if survey.heights is not None:
                survey.heights[first : first + len(heights)] = heights
            low, high, unknown, _ = sample_range(heights)
            survey.low, survey.high = min(survey.low, low), max(survey.high, high)
            survey.unknown += unknown
            void = not fill and unknown > 0
            if raster is not None or void:
                numbers = _classes(raster, first, heights)
                if void:
                    numbers[np.isnan(heights)] = _VOID
                for column, row, width, height, number in kernels.cut_rectangles(numbers).tolist():
                    counts[number] = counts.get(number, 0) + width * height
                    cell, span = (column, first + row), (width, height)
                    name, _ = _surface(raster, number)
                    survey.cover.add(element("flat", cell, span, vScale=0, surface=name))
            progress(heights.size)
        for number in sorted(counts):
            name, members = _surface(raster, number)
            survey.surface_types[name], survey.surfaces[name] = members, counts[number]
    if survey.unknown == grid.rows * grid.columns:
        raise ReadError(
            "Every pixel is nodata: there is no height.", "Take another part, band or file."
        )
    survey.notes = source.notes  # now, as what is read once more would be counted twice
    if raster is not None and raster.lacking:
        survey.notes += (f"{raster.name} has no class for {raster.lacking:,} pixels: no surface.",)
    if fill and survey.heights is not None:
        survey.heights = filled(survey.heights)
    elif fill and survey.unknown:
        survey.notes += (
            f"The DEM has more than {MOST_IN_MEMORY:,} pixels: unknown heights are taken from "
            "beside, not from all around.",
        )
    return survey


def _classes(
    raster: ClassRaster | None, first: int, heights: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Classes of the rows from `first` on that have these heights; -1 for none."""
    return (
        np.full(heights.shape, -1, np.int64) if raster is None else raster.read(first, len(heights))
    )


def _surface(raster: ClassRaster | None, number: int) -> tuple[str, dict[str, Any]]:
    """Name and members of the surface of a class, or of the void."""
    if number == _VOID or raster is None:
        return "void", {"void": True}
    return raster.surface(number)


def filled(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights with fewer NaN: what was unknown is weighted by inverse distances, as GDAL does it.

    Args:
        heights: (rows, columns) float64, NaN where unknown.

    Returns:
        (rows, columns) float64, NaN where no height is known within `REACH` pixels.
    """
    from rasterio.fill import fillnodata

    known = ~np.isnan(heights)
    if known.all():
        return heights
    smooth = fillnodata(
        heights.copy(),
        mask=known.astype(np.uint8),
        max_search_distance=min(REACH, max(heights.shape)),
    )
    return np.where(known, heights, smooth)
