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
