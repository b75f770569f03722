"""Slow ways to find what faster code must find too."""

from __future__ import annotations

from typing import Any

import numpy as np

from terratool.field.relief import relief_bounds
from terratool.field.terrain import Terrain


def largest_sum(terrain: Terrain) -> float:
    """More than what any elements that lie over one another add up to; no curve here reaches 5."""
    elements = terrain.arrays.elements
    tracks = terrain.arrays.tracks
    ruts = float(np.nanmax(tracks.depths, initial=0.0) * (1.0 + tracks.passes.sum()))
    ruts += relief_bounds(terrain.arrays).height
    return float((25 * np.abs(elements["scale"]) + np.abs(elements["offset"])).sum()) + ruts


def walls(terrain: Terrain, x: Any, y: Any, along_x: bool) -> np.ndarray:
    """Where a wall is between neighbours, NaN where none is, found by halving.

    The half with the larger change is kept, down to neighbouring doubles; it is a wall if the
    height changes there by far more than on either side: no slope does, nor the rim of a dome.
    """
    step = (np.s_[:, :-1], np.s_[:, 1:]) if along_x else (np.s_[1:], np.s_[:-1])
    moving, fixed = (x, y[step[0]].ravel()) if along_x else (y, x[step[0]].ravel())
    low, high = (moving[s].ravel() for s in step)

    def heights(at: Any) -> Any:
        return terrain.height(at, fixed) if along_x else terrain.height(fixed, at)

    z_low, z_high = heights(low), heights(high)
    for _ in range(70):
        middle = low + (high - low) / 2
        z = heights(middle)
        left = np.abs(z - z_low) >= np.abs(z_high - z)
        low, z_low = np.where(left, low, middle), np.where(left, z_low, z)
        high, z_high = np.where(left, middle, high), np.where(left, z, z_high)
    jump, beside = np.abs(z_high - z_low), np.zeros(len(low))
    before, after = low, high
    for _ in range(3):
        outer, further = np.nextafter(before, -np.inf), np.nextafter(after, np.inf)
        for a, b in ((outer, before), (after, further)):
            beside = np.fmax(beside, np.abs(heights(a) - heights(b)))
        before, after = outer, further
    found = (jump > 1e-6 * largest_sum(terrain)) & (jump > 20 * beside)
    return np.where(found, high, np.nan).reshape(x[step[0]].shape)
