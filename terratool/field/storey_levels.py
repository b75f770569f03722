"""Cells of the lattice of storeys over which decks have one level, so that one height says all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from terratool.field.storeys import StoreyLattice, Storeys, StoreySheet
    from terratool.field.terrain import Terrain

_MARGIN = 1e-6
"""Distance from the edge of an element that counts as within it, in cells."""
_MOST_ELEMENTS = 100_000
"""Most elements of a sheet that are looked at."""


def level_cells(storeys: Storeys) -> NDArray[np.bool_]:
    """Which cells of the lattice, (rows, columns), are within or beside each element of all sheets.

    All sheets that may have storeys there have decks of a thickness alone, and no curve in them
    that is not level.
    """
    cells = storeys.lattice.cells
    found: NDArray[np.bool_] = cells != 0
    last = len(storeys.sheets) - 1
    for k, sheet in enumerate(storeys.sheets):
        if k == 63 and last > 63:  # the last bit stands for several
            found &= (cells >> np.uint64(63)) == 0
            break
        own = (cells >> np.uint64(k)) & np.uint64(1) != 0
        if _is_level(sheet, storeys):
            found &= ~(own & _edged(sheet.top, storeys.lattice))
        else:
            found &= ~own
    return found


def _is_level(sheet: StoreySheet, storeys: Storeys) -> bool:
    """Whether a sheet has decks of a thickness, of level curves alone."""
    arrays = sheet.top.arrays
    own = sheet.storeys[sheet.storeys >= 0]
    if sheet.is_bore or len(arrays.elements) > _MOST_ELEMENTS:
        return False
    if np.isnan(storeys.table.gaps[own]).any():
        return False
    kinds = np.unique(arrays.elements["kind"][arrays.elements["scale"] != 0])
    return all(_is_constant(sheet.top, kind) for kind in kinds.tolist()) and not any(
        arrays.kinds["special"][np.unique(arrays.elements["kind"])]
    )


def _is_constant(terrain: Terrain, kind: int) -> bool:
    """Whether both curves of a kind that is not special are constant."""
    one = terrain.arrays.kinds[kind]
    for axis in (0, 1):
        pieces = terrain.arrays.curves.coefficients(
            int(one["pieces"][axis, 0]), int(one["count"][axis])
        )
        if pieces[:, 1:].any() or (pieces[:, 0] != pieces[0, 0]).any():
            return False
    return True


def _edged(terrain: Terrain, lattice: StoreyLattice) -> NDArray[np.bool_]:
    """Which cells of the lattice an edge of an element may cross."""
    rows, columns = lattice.cells.shape
    arrays = terrain.arrays
    low = (terrain.footprints().reshape(2, 2, -1) - lattice.frame[:2, None]) * (
        lattice.frame[2:, None]
    )
    turned = arrays.poses["turned"][arrays.elements["pose"]] != 0
    first, last = np.floor(low[0] - _MARGIN), np.floor(low[1] + _MARGIN)
    within, beyond = np.ceil(low[0] + _MARGIN), np.floor(low[1] - _MARGIN)
    within[:, turned], beyond[:, turned] = 0, 0
    size = np.array([[columns], [rows]])
    first, last = (np.clip(one, 0, size).astype(np.int64) for one in (first, last + 1))
    within, beyond = (np.clip(one, first, last).astype(np.int64) for one in (within, beyond))
    found = np.zeros((rows, columns), np.bool_)
    for (i, j), (i_last, j_last), (i_in, j_in), (i_out, j_out) in zip(
        first.T.tolist(), last.T.tolist(), within.T.tolist(), beyond.T.tolist(), strict=True
    ):
        if i_in >= i_out or j_in >= j_out:
            found[j:j_last, i:i_last] = True
            continue
        found[j:j_in, i:i_last] = True
        found[j_out:j_last, i:i_last] = True
        found[j:j_last, i:i_in] = True
        found[j:j_last, i_out:i_last] = True
    return found
