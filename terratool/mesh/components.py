"""What hangs together by edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def components(edges: NDArray[np.integer], count: int) -> NDArray[np.int32]:
    """For each of so many things the least of those that it hangs together with.

    Args:
        edges: (n, 2) indices of two things each.
        count: so many things.

    Returns:
        (count,) int32.
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
