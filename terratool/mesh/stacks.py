"""Stacks of intervals over triangles: what is solid between surfaces of ground and storeys."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]

GROUND = 0
"""End of an interval that is the ground; top and other face of sheet k are 2k + 1 and 2k + 2."""
BELOW = -1
"""Bottom of an interval that begins below all."""
NONE = -2
"""No interval."""


class Stacks(NamedTuple):
    """Intervals over triangles, from below.

    Attributes:
        bottoms: (n, i) int32 what each interval begins with: an end, `BELOW` or `NONE`.
        tops: (n, i) int32 what each interval ends with.
    """

    bottoms: Ints
    tops: Ints

    @property
    def grounded(self) -> Bools:
        """Whether there is something solid from below, (n,)."""
        return np.asarray(self.bottoms[:, 0] == BELOW)


def stacks_of(z: Floats, voids: Bools, bores: Bools, tolerance: float) -> Stacks:
    """Intervals that ground and storeys make.

    Args:
        z: (n, 1 + 2s) heights of all ends; NaN for storeys that are not there, and for void ground.
        voids: (n, s) bool, whether the top of a storey that is there is void.
        bores: (s,) bool, whether storeys of a sheet are bores.
        tolerance: largest difference of heights that count as one.
    """
    n, ends = z.shape
    ranks = ranks_of(z, tolerance)
    deepest = ends + 1
    rows = np.arange(n)
    solid = np.zeros((n, deepest + 1), np.bool_)  # from each rank to the next; 0 is below all
    top, bottom = np.full((2, n, deepest + 2), NONE, np.int32)
    levels = np.arange(deepest + 1)
    ground = ~np.isnan(z[:, GROUND])
    solid[:] = ground[:, None] & (levels < ranks[:, :1])
    bottom[ground, 0] = BELOW
    top[rows[ground], ranks[ground, 0]] = GROUND
    for s, is_bore in enumerate(bores.tolist()):
        own, other = 2 * s + 1, 2 * s + 2
        here = ~np.isnan(z[:, other])
        if is_bore:
            low, high = np.where(voids[:, s], 0, ranks[:, own]), ranks[:, other]
            here &= voids[:, s] | ~np.isnan(z[:, own])
        else:
            low, high = ranks[:, other], ranks[:, own]
            here &= ~voids[:, s] & ~np.isnan(z[:, own])
        here &= high > low
        at = rows[here]
        low, high = low[here], high[here]
        before = solid[at]
        below, above = (
            before[np.arange(len(at)), np.maximum(low - 1, 0)] & (low > 0),
            before[np.arange(len(at)), high],
        )
        within = (levels >= low[:, None]) & (levels < high[:, None])
        if is_bore:
            solid[at] = before & ~within
            taken = before[np.arange(len(at)), low]
            floor = below & taken
            top[at[floor], low[floor]] = own
            roof = above & before[np.arange(len(at)), high - 1]
            bottom[at[roof], high[roof]] = other
        else:
            solid[at] = before | within
            bottom[at[~below], low[~below]] = other
            top[at[~above], high[~above]] = own
    return _listed(solid, bottom, top)


def ranks_of(z: Floats, tolerance: float) -> Ints:
    """Rank of each height in its row, from 1 on; those within the tolerance share one."""
    order = np.argsort(z, axis=1)
    sorted_z = np.take_along_axis(z, order, axis=1)
    steps = np.diff(sorted_z, axis=1, prepend=sorted_z[:, :1]) > tolerance
    ranks = np.empty(z.shape, np.int32)
    np.put_along_axis(ranks, order, 1 + np.cumsum(steps, axis=1, dtype=np.int32), axis=1)
    return ranks


def _listed(solid: Bools, bottom: Ints, top: Ints) -> Stacks:
    """Intervals of what is solid between ranks, by what is at these."""
    n = len(solid)
    before = np.zeros((n, solid.shape[1] + 1), np.bool_)
    before[:, 1:] = solid
    after = np.zeros_like(before)
    after[:, :-1] = solid
    found = []
    for ends, here in ((bottom, after & ~before), (top, before & ~after)):
        place = np.cumsum(here, axis=1) - 1
        row, rank = np.nonzero(here)
        found.append((row, place[row, rank], ends[row, rank]))
    wide = max(1, 1 + max(int(place.max(initial=0)) for _, place, _ in found))
    out = np.full((2, n, wide), NONE, np.int32)
    for own, (row, place, end) in zip(out, found, strict=True):
        own[row, place] = end
    return Stacks(*out)
