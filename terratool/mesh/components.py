"""Connected components of a graph."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def components(edges: NDArray[np.integer], count: int) -> NDArray[np.int32]:
    """Return the connected component of each node, named by its least node.

    Args:
        edges: (n, 2) pairs of nodes.
        count: number of nodes.

    Returns:
        (count,) int32 least node of each node's component.
    """
    roots = np.arange(count, dtype=np.int32)
    first, second = edges.T
    while True:
        before = roots.copy()
        low = np.minimum(roots[first], roots[second])
        for end in (roots[first], roots[second], first, second):
            np.minimum.at(roots, end, low)
        roots = roots[roots]
        if np.array_equal(before, roots):
            return roots
