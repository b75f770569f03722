"""Numbers and arrays that broadcast together, laid flat for the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64] | np.float64
"""An array, or a NumPy number where all that went in were numbers."""


def flat(*values: Any) -> tuple[tuple[int, ...], list[NDArray[np.float64]]]:
    """The common shape of values, and each of them broadcast to it and laid flat, float64.

    Raises:
        ValueError: they do not broadcast together.
    """
    arrays = np.broadcast_arrays(*(np.asarray(value, np.float64) for value in values))
    return arrays[0].shape, [np.ascontiguousarray(array).reshape(-1) for array in arrays]


def shaped(column: NDArray[np.float64], shape: tuple[int, ...]) -> Numbers:
    """A flat column in its shape again; a number if there is but one."""
    return np.ascontiguousarray(column).reshape(shape)[()]
