"""Triangles in the plane are grouped into regions: what covers the middle of each is the same."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import mesh as kernels
from terratool.mesh.types import COVER, MeshPlan, Regions


def regions_of(
    plan: MeshPlan,
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
    offsets, covers, surfaces, voids, plane, asides, drops = kernels.describe_regions(
        plan.kept, points, triangles, chosen
    )
    parts = Regions(
        offsets, covers.view(COVER), surfaces, voids.view(bool), plane.view(bool), asides, drops
    )
    return parts, of.reshape(-1).astype(np.int32)
