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
from terratool.importing.samples import HeightSource, extremes
from terratool.importing.terrains.covering import ClassRaster, open_classes
from terratool.importing.terrains.writing import Elements, element
from terratool.kernels import importing as kernels

_ROWS = 256
_VOID = int(np.iinfo(np.int64).max)
"""A class of its own, for pixels without a height."""


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
        notes: sentences about what was found.
    """

    low: float = math.inf
    high: float = -math.inf
    unknown: int = 0
    heights: NDArray[np.float64] | None = None
    cover: Elements = field(default_factory=Elements)
    surface_types: dict[str, Any] = field(default_factory=dict)
    surfaces: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def survey_of(
    source: HeightSource,
    classes: str | None,
    void: bool,
    most: int,
    progress: Callable[[int], object],
) -> Survey:
    """Read all rows once.

    Args:
        source: the DEM.
        classes: name of a raster of classes, or None.
        void: whether what is unknown is covered by the void.
        most: DEMs of up to this many pixels are kept in memory.
        progress: gets numbers of pixels.

    Raises:
        ReadError: a file is broken, or there is no height at all.
    """
    lattice = source.lattice
    survey = Survey()
    counts: dict[int, int] = {}
    with ExitStack() as stack:
        raster = None if classes is None else stack.enter_context(open_classes(classes, lattice))
        if lattice.rows * lattice.columns <= most:
            survey.heights = np.empty((lattice.rows, lattice.columns))
        # from the north, as files are read the quickest
        for first in reversed(range(0, lattice.rows, _ROWS)):
            heights = source.read(first, min(_ROWS, lattice.rows - first))
            if survey.heights is not None:
                survey.heights[first : first + len(heights)] = heights
            low, high, unknown, _ = extremes(heights)
            survey.low, survey.high = min(survey.low, low), max(survey.high, high)
            survey.unknown += unknown
            holes = np.isnan(heights) if void and unknown else None
            _cover(survey, raster, first, holes, len(heights), counts)
            progress(heights.size)
        _name(survey, raster, counts)
    if survey.unknown == lattice.rows * lattice.columns:
        raise ReadError(
            "Every pixel is nodata: there is no height.", "Take another part, band or file."
        )
    return survey


def _cover(
    survey: Survey,
    raster: ClassRaster | None,
    first: int,
    holes: NDArray[np.bool_] | None,
    count: int,
    counts: dict[int, int],
) -> None:
    """Cover some rows with rectangles, and count their pixels by class."""
    if raster is not None:
        classes = raster.read(first, count)
    elif holes is not None:
        classes = np.full(holes.shape, -1, np.int64)
    else:
        return
    if holes is not None:
        classes[holes] = _VOID
    for column, row, width, height, number in kernels.cut_rectangles(classes).tolist():
        name = "void" if number == _VOID else raster.surface(number)[0] if raster else ""
        counts[number] = counts.get(number, 0) + width * height
        cell, span = (column, first + row), (width, height)
        survey.cover.add(element("flat", cell, span, vScale=0, surface=name))


def _name(survey: Survey, raster: ClassRaster | None, counts: dict[int, int]) -> None:
    for number in sorted(counts):
        name, members = ("void", {"void": True}) if number == _VOID else ("", {})
        if raster is not None and number != _VOID:
            name, members = raster.surface(number)
        survey.surface_types[name] = members
        survey.surfaces[name] = counts[number]
    if raster is not None and raster.lacking:
        survey.notes = (f"{raster.name} has no class for {raster.lacking:,} pixels: no surface.",)
