"""Triangles in the plane are grouped into regions: what covers the middle of each is the same."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.mesh import regions
from terratool.mesh.types import COVER, Plan, Regions

_NONE = np.empty(0, COVER)


def keys_of(
    plan: Plan, points: NDArray[np.int64], triangles: NDArray[np.int32]
) -> NDArray[np.int64]:
    """For each triangle a number that is the same where the same covers its middle, (m,)."""
    keys = np.empty(len(triangles), np.uint64)
    regions.signatures(plan, points, triangles, *_scratch(plan), _NONE, keys)
    return keys.view(np.int64)


def regions_of(
    plan: Plan,
    points: NDArray[np.int64],
    triangles: NDArray[np.int32],
    keys: NDArray[np.int64],
) -> tuple[Regions, NDArray[np.int32]]:
    """The regions of triangles with numbers, each as it is in its first triangle; which is whose.

    Args:
        plan: the plan.
        points: (n, 2) on the lattice.
        triangles: (m, 3).
        keys: (m,) their numbers.

    Returns:
        The regions, and (m,) the index of each triangle's.
    """
    _, chosen, of = np.unique(keys, return_index=True, return_inverse=True)
    offsets, winners = np.empty(len(chosen) + 1, np.int64), np.empty(len(chosen), np.int64)
    affine, worn = np.empty(len(chosen), bool), np.empty(len(chosen), np.int64)
    drops = np.empty(len(chosen))
    description = plan, points, triangles, chosen, *_scratch(plan), offsets
    regions.describe(*description, _NONE, winners, affine, drops, worn)
    covers = np.empty(offsets[-1], COVER)
    regions.describe(*description, covers, winners, affine, drops, worn)
    kinds = plan.field.kinds[plan.field.elements["kind"][np.maximum(winners, 0)]]
    surfaces = np.where(winners < 0, -1, kinds["surface"]).astype(np.int32)
    surfaces[worn >= 0] = plan.field.tracks.surface[worn[worn >= 0]]
    voids = (winners >= 0) & (kinds["is_void"] != 0)
    asides = np.zeros(len(covers) + 1)
    np.cumsum(plan.frames["aside"][covers["element"]], out=asides[1:])
    asides = asides[offsets[1:]] - asides[offsets[:-1]]
    parts = Regions(offsets, covers, surfaces, voids, affine, asides, drops)
    return parts, of.reshape(-1).astype(np.int32)


def _scratch(plan: Plan) -> tuple[NDArray[Any], ...]:
    """Space for a descent, and for the tracks at a place."""
    tracks = len(plan.field.tracks.passes)
    stack = np.empty((plan.field.pending + 2, 3))
    return stack, np.empty(tracks, np.int64), np.zeros(tracks, np.uint8)
