"""Errors of the columns of an imported terrain against those of its mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terratool.definition.reader import load_definition
from terratool.errors import DefinitionError
from terratool.field.terrain import Terrain
from terratool.importing.terrain.decks import DeckPlan
from terratool.importing.terrain.request import DeckReport
from terratool.importing.terrain.writing import BoundError

_PIECE = 1 << 18
"""Pixels whose columns are asked for at once."""


def measure_decks(path: Path, plan: DeckPlan, max_error: float) -> DeckReport | None:
    """Compare columns of a terrain at the centres of pixels with those of a mesh.

    Args:
        path: the terrain as it was written.
        plan: decks of the mesh.
        max_error: largest error of tops and of undersides.

    Returns:
        The errors; None where the mesh has nothing over other ground.

    Raises:
        BoundError: the terrain has errors; no file appears.
    """
    grid, overhangs = plan.grid, plan.overhangs
    if overhangs is None:
        return None
    try:
        terrain = Terrain(load_definition(path))
    except DefinitionError as error:
        raise BoundError(f"its decks make errors, {error.message}") from error
    solid = overhangs.solid
    pixels = grid.rows * grid.columns
    begin = np.searchsorted(solid.pixel, np.arange(pixels + 1))
    stands = np.zeros(pixels, np.bool_)
    stands[solid.pixel[overhangs.body >= 0]] = True
    stands |= np.diff(begin) > 1
    top = under = 0.0
    columns = other = 0
    for first in range(0, pixels, _PIECE):
        pixel = np.arange(first, min(first + _PIECE, pixels))
        x = grid.west + (pixel % grid.columns + 0.5) * grid.dx
        y = grid.south + (pixel // grid.columns + 0.5) * grid.dy
        found = terrain.column(x, y)
        held = (~np.isnan(found.top)).sum(axis=1)
        wanted = begin[pixel + 1] - begin[pixel]
        counted = stands[pixel] | (held > 1)
        alike = counted & (held == wanted)
        off_top, off_under = np.zeros(len(pixel)), np.zeros(len(pixel))
        for rank in range(found.top.shape[1]):
            some = np.flatnonzero(alike & (rank < wanted))
            at = begin[pixel[some]] + rank
            high = np.abs(found.top[some, rank] - solid.top[at])
            with np.errstate(invalid="ignore"):
                low = np.abs(found.bottom[some, rank] - solid.bottom[at])
            low[(found.bottom[some, rank] == -np.inf) & (solid.bottom[at] == -np.inf)] = 0.0
            # ground of a mesh that ends below has no end in the terrain
            low[(found.bottom[some, rank] == -np.inf) & (overhangs.body[at] < 0)] = 0.0
            off_top[some] = np.maximum(off_top[some], high)
            off_under[some] = np.maximum(off_under[some], low)
        near = alike & (np.maximum(off_top, off_under) <= max_error)
        top = max(top, float(off_top[near].max(initial=0.0)))
        under = max(under, float(off_under[near].max(initial=0.0)))
        columns += int(np.count_nonzero(counted))
        other += int(np.count_nonzero(counted & ~near))
    return DeckReport(plan.rectangles, plan.grids, columns, top, under, other)
