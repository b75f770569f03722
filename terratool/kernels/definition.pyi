"""Definition: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

SPECS: dict[str, list[dict[str, Any]]]

def may_repeat_keys(text: NDArray[np.uint8]) -> bool:
    """
    Whether a key stands twice in an object of a JSON text, or has an escape.

    Shapes: text[_].
    """

def survey(
    operations: NDArray[np.uint8],
    operands: NDArray[np.float64],
    limits: NDArray[np.float64],
    places: NDArray[np.float64],
) -> tuple[float, float, float, int]:
    """
    How well pieces can keep to a formula: how many, how far off, where, and places to check.

    Shapes: operations[n], operands[n], limits[7], places[_].
    """
