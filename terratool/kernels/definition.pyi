"""Definition: the kernels in C++. Written by `make stubs`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_EXPONENT: int = 60

SPECS: dict[str, list[dict[str, Any]]]

def decimal_rests(
    text: NDArray[np.uint8],
    powers: NDArray[np.float64],
    numbers: NDArray[np.float64],
    rests: NDArray[np.float64],
) -> None:
    """
    What doubles lack to their shortest decimals, which stand in a JSON array of numbers.

    Shapes: text[_], powers[121,2], numbers[n], rests[n].
    """

def survey_keys(
    text: NDArray[np.uint8], names: NDArray[np.uint8], present: NDArray[np.uint8]
) -> bool:
    """
    Whether a key of a JSON text may stand twice in an object; marks lines that may be keys.

    Shapes: text[_], names[_], present[n].
    """

def find_vectors(text: NDArray[np.uint8], least: int) -> NDArray[np.int64]:
    """
    Begin, end and count of each list behind a key x or y that may be numbers alone.

    Shapes: text[_].
    """

def read_vector(
    text: NDArray[np.uint8], powers: NDArray[np.float64], most: float, numbers: NDArray[np.float64]
) -> bool:
    """
    Read a vector's numbers; whether all are numbers of JSON, not too large, surely rounded.

    Shapes: text[_], powers[121,2], numbers[n].
    """

TRIES: int = 50

def scatter(
    asked: Any,
    tries: int,
    sides: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    turns: NDArray[np.float64],
) -> tuple[int, int]:
    """
    Sides, middles and turns of scattered copies; how many were looked at, and tries left.

    Shapes: sides[n], x[n], y[n], turns[n].
    """

def share(seed: int, number: int, draw: int) -> float:
    """A number from 0 to below 1 that follows from three."""

def least_side(asked: Any, count: int) -> float:
    """The side of the smallest of so many scattered copies."""

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
