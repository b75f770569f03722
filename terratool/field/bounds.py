"""How far curves reach: their pieces in units of their length, their ends and their bounds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.field.records import COMBINE, FieldArrays

_LEVEL = 1e-12
"""What a curve is worth at an end, in parts of its largest value, and still counts as 0."""

Floats = NDArray[np.float64]


def curve_pieces(arrays: FieldArrays, kind: Any, axis: str) -> tuple[Floats, Floats]:
    """Where the pieces of a curve begin, (n,), and their coefficients over [0, 1], (n, 4).

    A step at t = 1 has a piece of no length behind it.
    """
    n = "xy".index(axis)
    first, count = int(kind["pieces"][n, 0]), int(kind["count"][n])
    lengths = np.ones(count)
    starts = np.arange(count) / count
    if kind["knotted"][n]:
        knots = arrays.curves.knots[int(kind["knots"][n, 0]) :]
        starts = knots[: int(np.argmax(np.isinf(knots)))]
        lengths = np.diff(np.append(starts, 1.0))
    pieces = arrays.curves.pieces.reshape(-1, 4)[first : first + len(starts)]
    return starts, pieces * lengths[:, None] ** np.arange(4)


def curve_hulls(pieces: Floats) -> Floats:
    """(4, n) numbers between the least and the greatest of which each cubic lies.

    The first and the last are its values at its ends.
    """
    c0, c1, c2, c3 = pieces.T
    return np.stack([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3])


def largest_heights(arrays: FieldArrays) -> Floats:
    """No less than what each element adds to a height, without sign; (n,)."""
    sizes = np.empty(len(arrays.kinds))
    for k, kind in enumerate(arrays.kinds):
        x, y = (np.abs(curve_hulls(curve_pieces(arrays, kind, axis)[1])).max() for axis in "xy")
        if kind["combine"] == COMBINE["product"]:
            sizes[k] = x * y
        elif kind["combine"] == COMBINE["sum"]:
            sizes[k] = x + y
        else:
            sizes[k] = max(x, y)
    elements = arrays.elements
    largest: Floats = np.abs(elements["scale"]) * sizes[elements["kind"]]
    largest += np.abs(elements["offset"])
    return largest


def nonzero_edges(arrays: FieldArrays) -> NDArray[np.uint8]:
    """For each kind, whether it is other than 0 somewhere on the edge of its whole footprint."""
    out = np.ones(len(arrays.kinds), np.uint8)
    for k, kind in enumerate(arrays.kinds):
        (x_start, x_end, x_least, x_most), (y_start, y_end, y_least, y_most) = (
            _ends(arrays, kind, axis) for axis in "xy"
        )
        level = x_start == x_end == y_start == y_end == 0.0
        if kind["combine"] == COMBINE["radial"]:  # only the right half is used
            out[k] = x_end != 0.0
        elif kind["combine"] == COMBINE["product"]:
            out[k] = not (level or x_least == x_most == 0.0 or y_least == y_most == 0.0)
        elif kind["combine"] == COMBINE["min"]:
            out[k] = not (level and min(x_least, y_least) == 0.0)
        elif kind["combine"] == COMBINE["max"]:
            out[k] = not (level and max(x_most, y_most) == 0.0)
    return out


def _ends(arrays: FieldArrays, kind: Any, axis: str) -> tuple[float, float, float, float]:
    """Size of a curve at its start and its end, and bounds of its values; 0 if almost so."""
    starts, pieces = curve_pieces(arrays, kind, axis)
    hulls = curve_hulls(pieces)
    level = _LEVEL * np.abs(hulls).max()
    # where a step stands at the very end, the curve arrives before it
    arrivals = hulls[3, starts < 1.0][-1], hulls[3, -1]
    numbers = abs(hulls[0, 0]), np.abs(arrivals).max(), hulls.min(), hulls.max()
    start, end, least, most = (0.0 if abs(n) <= level else float(n) for n in numbers)
    return start, end, least, most


def finest_details(arrays: FieldArrays, wide: Floats, tall: Floats) -> Floats:
    """Length of the shortest straight stretch in the shape of each element, (n,); inf for none.

    Stretches lie between the bends and steps of vectors and knots; formulas have none.

    Args:
        arrays: the field.
        wide: (n,) sides of the elements' cells along x …
        tall: … and along y.
    """
    stretches = _stretches(arrays)[arrays.elements["kind"]]
    shaped = arrays.elements["scale"] != 0
    details = np.minimum(stretches[:, 0] * wide, stretches[:, 1] * tall)
    return np.where(shaped, details, np.inf)


def _stretches(arrays: FieldArrays) -> NDArray[np.float64]:
    """The shortest straight stretch of the curves x and y of each kind, (kinds, 2), in t."""
    out = np.full((len(arrays.kinds), 2), np.inf)
    for k, kind in enumerate(arrays.kinds):
        radial = kind["combine"] == COMBINE["radial"]
        out[k, 0] = _shortest(arrays, kind, "x", radial)
        # a disc has its one curve in every direction
        out[k, 1] = out[k, 0] if radial else _shortest(arrays, kind, "y", False)
    return out


def _shortest(arrays: FieldArrays, kind: Any, axis: str, radial: bool) -> float:
    starts, pieces = curve_pieces(arrays, kind, axis)
    if pieces[:, 2:].any():  # curved: a formula
        return np.inf
    first, _, _, last = curve_hulls(pieces)
    lengths = np.diff(np.append(starts, 1.0))
    slopes = np.divide(last - first, lengths, out=np.zeros(len(starts)), where=lengths > 0)
    size = np.abs(np.concatenate([first, last])).max()
    bend = np.abs(np.diff(slopes)) > 1e-9 * np.abs(slopes).max()
    step = np.abs(first[1:] - last[:-1]) > 1e-9 * size
    marks = starts[1:][bend | step]
    if not len(marks):
        return np.inf
    if radial:  # the right half, turned: what is level in the middle goes on beyond it
        marks = marks[marks > 0.5]
        middle = int(np.searchsorted(starts, 0.5, side="right")) - 1
        level = abs(slopes[middle]) <= 1e-9 * np.abs(slopes).max()
        bends = np.concatenate([[0.5], marks, [1.0]])
        lengths = np.diff(bends)
        lengths[0] *= 2.0 if level else 1.0
        if not len(marks):
            return np.inf
    else:
        lengths = np.diff(np.concatenate([[0.0], marks, [1.0]]))
    return float(lengths[lengths > 0].min(initial=np.inf))
