"""Decks and bores that change nothing: a deck within the ground, a bore that meets none."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import UnseenStorey
from terratool.definition.reader import Checked
from terratool.errors import TerratoolError
from terratool.field.storeys import FIRST_STOREY, Storeys
from terratool.field.terrain import SHARE_ABOVE, Terrain

_MOST_ELEMENTS = SHARE_ABOVE
"""Most elements of a terrain that is looked at."""
_MOST_POINTS = 200_000
"""Most points in all storeys together, children's middles aside."""
_SIDES = 5, 33
"""Least and most points along a side of a storey."""
_link = re.compile(r">(?=(?:[^>]*#)?/parts/)")
"""Pattern between two names of a chain."""
_copy = re.compile(r"(?<=/children/)(\d+)\[[^\]/]*\]")
"""Pattern of an element that stands for several, with the number of one of these."""


def unseen_storeys(checked: Checked) -> tuple[UnseenStorey, ...]:
    """Decks and bores of a valid terrain none of whose faces is met at any of many points.

    Args:
        checked: the terrain, whose findings do not count.
    """
    uses = checked.uses
    if uses is None or not uses.has_storeys or uses.elements > _MOST_ELEMENTS:
        return ()
    try:
        terrain = Terrain(checked, roughness=False)
    except TerratoolError:  # other rules say what is wrong with parts, copies and rasters
        return ()
    if terrain.storeys is None:
        return ()
    return tuple(_unseen(terrain, terrain.storeys))


def _unseen(terrain: Terrain, storeys: Storeys) -> Iterator[UnseenStorey]:
    numbers = storeys.table.numbers
    side = math.isqrt(_MOST_POINTS // len(numbers))
    if side < _SIDES[0]:
        return
    home = np.full(len(storeys.written), -1)
    parts = []
    for sheet in storeys.sheets:
        inner = np.flatnonzero(sheet.storeys >= 0)
        home[sheet.numbers[inner] - FIRST_STOREY] = sheet.storeys[inner]
        places = sheet.top.footprints()[:, inner]
        own = sheet.numbers[inner] == numbers[sheet.storeys[inner]]
        parts += [_grid(places[:, own], sheet.storeys[inner][own], min(side, _SIDES[1]))]
        parts += [_grid(places[:, ~own], sheet.storeys[inner][~own], 1)]
    x, y, storey = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    column = terrain.column(x, y)
    ends = np.hstack([column.element, column.under])
    of = np.where(ends >= FIRST_STOREY, home[np.maximum(ends - FIRST_STOREY, 0)], -1)
    met = np.zeros(len(numbers), np.bool_)
    met[storey[(of == storey[:, None]).any(axis=1)]] = True
    met |= _cut_through(terrain, storeys, x, y, storey)
    points = np.bincount(storey, minlength=len(numbers))
    counts: dict[str, int] = {}
    for number, is_met, count in zip(numbers.tolist(), met, points.tolist(), strict=True):
        pointer = _copy.sub(r"\1", _link.split(storeys.pointer(number))[-1])
        before = counts.get(pointer, 0)
        counts[pointer] = -1 if is_met or before < 0 else before + count
    yield from (UnseenStorey(pointer, count) for pointer, count in counts.items() if count > 0)


def _cut_through(
    terrain: Terrain,
    storeys: Storeys,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    storey: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Mask of the bores that may leave no face of their own, as they go through all that is there.

    Args:
        terrain: the terrain.
        storeys: its storeys.
        x: (n,) world positions.
        y: (n,) world positions.
        storey: (n,) number of the storey that each point is of.
    """
    ground = terrain.ground_alone.height(x, y)
    numbers, parent = storeys.table.numbers - FIRST_STOREY, storeys.written.parent
    is_own = np.zeros(len(parent), np.bool_)
    is_own[numbers] = True
    found = np.zeros(len(numbers), np.bool_)
    for sheet in storeys.sheets:
        if not sheet.is_bore:
            continue
        own = np.unique(sheet.storeys[sheet.storeys >= 0])
        here = np.flatnonzero(np.isin(storey, own))
        floor = sheet.top.height(x[here], y[here])
        deep = ~np.isnan(sheet.face.height(x[here], y[here]))
        found[storey[here[deep & ~(floor >= ground[here]) & ~np.isnan(ground[here])]]] = True
        for number in own.tolist():  # of those in storeys, nothing is said
            above = int(parent[numbers[number]])
            while above >= 0 and not is_own[above]:
                above = int(parent[above])
            found[number] |= above >= 0
    return found


def _grid(
    places: NDArray[np.float64], storey: NDArray[np.int32], side: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Centres of `side` × `side` pixels in each rectangle, (4, n), with the storey of each."""
    share = (np.arange(side) + 0.5) / side
    west, south, east, north = places[..., None, None]
    x = west + (east - west) * share
    y = south + (north - south) * share[:, None]
    shape = len(storey), side, side
    return (
        np.broadcast_to(x, shape).ravel(),
        np.broadcast_to(y, shape).ravel(),
        np.repeat(storey.astype(np.int64), side * side),
    )
