"""Curves as cubic pieces, which the kernels evaluate."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.definition.accuracy import MAX_PIECES, survey
from terratool.definition.curves import Curve, FormulaCurve, KnotCurve, SampledCurve
from terratool.definition.exact import rests_of
from terratool.definition.expression import CHECK_POINTS, MAX_VALUE, Expression, evaluate
from terratool.definition.vectors import LEAST, Vector
from terratool.field.rasters import RasterStore
from terratool.field.records import SAMPLES, STEPPED, CurveArrays

Floats = NDArray[np.float64]

_EVEN_LEVELS = 10  # the finest, 512 pieces, has 8 checked points in each
_ROUNDING = 2.0**-47
_MAX_HALVINGS = 60
_FINEST_START = 1024  # pieces to halve from: each quarter of one is a checked point
_MAX_BINS = 4096
_THIRDS = np.array([0.0, 1 / 3, 2 / 3, 1.0])
_TO_CUBIC = np.array([
    [1.0, 0.0, 0.0, 0.0], [-5.5, 9.0, -4.5, 1.0], [9.0, -22.5, 18.0, -4.5],
    [-4.5, 13.5, -13.5, 4.5],
])  # fmt: skip
"""Weights, (4, 4), that turn a cubic's values at `_THIRDS` into its coefficients."""

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "pow": np.power,
    "neg": np.negative, "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin,
    "acos": np.arccos, "atan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh,
    "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs,
    "min": lambda *values: np.minimum.reduce(np.broadcast_arrays(*values)),
    "max": lambda *values: np.maximum.reduce(np.broadcast_arrays(*values)),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CurvePieces:
    """A curve as cubic pieces.

    Attributes:
        starts: (n,) t at which each piece begins, from 0; two are equal where a piece has no length
            (a step at t = 1).
        rests: (n,) differences of the intended decimals from the doubles in `starts`.
        coefficients: (n, 4) c0 to c3; the value at t is c0 + s·(c1 + s·(c2 + s·c3)), with s = t −
            start for knotted curves and s = n·t − i for evenly spaced ones.
        end: value at t = 1.
        even: whether the pieces are evenly spaced.
        stepped: whether there are vertical steps.
    """

    starts: Floats
    rests: Floats
    coefficients: Floats
    end: float
    even: bool
    stepped: bool = False

    def __len__(self) -> int:
        """Return the number of rows of the kernels: of the pieces, and of the end."""
        return len(self.coefficients) + 1

    @property
    def last_slope(self) -> float:
        """Slope at the end of the last piece, per length of the piece where they are even."""
        _, c1, c2, c3 = self.coefficients[-1].tolist()
        return float(c1 + 2.0 * c2 + 3.0 * c3)


def pieces_of(curve: KnotCurve | FormulaCurve) -> CurvePieces:
    """Cut a curve into pieces."""
    if isinstance(curve, KnotCurve):
        return _knots(np.array(curve.points, np.float64))
    return _formula(curve.expression)


def _values(curve: SampledCurve) -> Floats:
    """Values of a curve at the ends of its pieces, two or more."""
    values = curve.values
    array = values.array if isinstance(values, Vector) else np.array(values, np.float64)
    return array if len(array) > 1 else np.repeat(array, 2)


def _knots(points: Floats) -> CurvePieces:
    t, z = points[:, 0], points[:, 1]
    length = np.diff(t)
    keep = length > 0
    starts, firsts = t[:-1][keep], z[:-1][keep]
    with np.errstate(over="ignore"):
        slopes = np.nan_to_num(np.diff(z)[keep] / length[keep])
    if t[-2] == 1.0:  # a step at the very end: a piece of no length holds the value on its right
        starts, firsts, slopes = (
            np.append(starts, 1.0),
            np.append(firsts, z[-1]),
            np.append(slopes, 0.0),
        )
    coefficients = np.zeros((len(starts), 4))
    coefficients[:, 0] = firsts
    coefficients[:, 1] = slopes
    stepped = not keep.all()
    return CurvePieces(starts, rests_of(starts), coefficients, z[-1], False, stepped)


def values_of(expression: Expression, t: Floats) -> Floats:
    """Values of an expression at `t`, within ±MAX_VALUE; NaN becomes 0."""
    with np.errstate(all="ignore"):
        values = np.asarray(evaluate(expression, t, FUNCTIONS), np.float64)
    bounded: Floats = np.clip(np.nan_to_num(values, nan=0.0), -MAX_VALUE, MAX_VALUE)
    return np.broadcast_to(bounded, t.shape)


def _formula(expression: Expression) -> CurvePieces:
    t = np.linspace(0.0, 1.0, CHECK_POINTS)
    values = values_of(expression, t)
    known = survey(expression)
    tolerance = known.tolerance
    places = np.array(known.places)
    for level in range(_EVEN_LEVELS):
        starts = np.arange(1 << level) / (1 << level)
        coefficients = _cubics(expression, starts, np.full(1 << level, 1.0 / (1 << level)))
        if _error(coefficients, values) <= tolerance and (
            _error_between(expression, starts, coefficients) <= tolerance
            and _error_at(expression, places, starts, coefficients) <= tolerance
        ):
            return CurvePieces(starts, np.zeros(len(starts)), coefficients, values[-1], True)
    starts, lengths, coefficients = _halve(expression, tolerance, places)
    coefficients = coefficients / lengths[:, None] ** np.arange(4)
    return CurvePieces(starts, np.zeros(len(starts)), coefficients, values[-1], False)


def _cubics(expression: Expression, starts: Floats, lengths: Floats) -> Floats:
    """Coefficients, (n, 4), of the cubics through four points of each piece, s from 0 to 1."""
    t = np.minimum(starts[:, None] + lengths[:, None] * _THIRDS, 1.0)
    values = values_of(expression, t)
    # BLAS would add in an order that differs from processor to processor
    coefficients = np.zeros((len(starts), 4))
    for column, weights in zip(values.T, _TO_CUBIC.T, strict=True):
        coefficients += column[:, None] * weights
    # straight pieces stay straight: a level floor has no slope of 1e-15
    straight = np.abs(coefficients[:, 2:]).max(axis=1) <= _ROUNDING * np.abs(values).max(axis=1)
    coefficients[straight, 1] = (values[:, 3] - values[:, 0])[straight]
    coefficients[straight, 2:] = 0.0
    return coefficients


def _at(coefficients: Floats, s: Floats) -> Floats:
    c = coefficients
    return c[:, :1] + s * (c[:, 1:2] + s * (c[:, 2:3] + s * c[:, 3:]))


def _error(coefficients: Floats, values: Floats) -> float:
    per_piece = (len(values) - 1) // len(coefficients)
    s = np.arange(per_piece) / per_piece
    return float(np.abs(_at(coefficients, s[None, :]) - values[:-1].reshape(-1, per_piece)).max())


def _error_between(expression: Expression, starts: Floats, coefficients: Floats) -> float:
    """Largest error at three places per piece that are no checked points."""
    s = np.array([0.1372549, 0.4142135, 0.7236067])
    values = values_of(expression, starts[:, None] + s / len(starts))
    return float(np.abs(_at(coefficients, s[None, :]) - values).max())


def _error_at(
    expression: Expression, places: Floats, starts: Floats, coefficients: Floats
) -> float:
    """Largest error at the places where the formula is known to change suddenly."""
    if not len(places):
        return 0.0
    miss = _misses(expression, places, starts, np.full(len(starts), 1 / len(starts)), coefficients)
    return float(miss.max())


def _misses(
    expression: Expression,
    places: Floats,
    starts: Floats,
    lengths: Floats,
    coefficients: Floats,
) -> Floats:
    """Largest error of each piece at some places t; 0 for pieces without one."""
    order = np.argsort(starts)
    piece = order[np.maximum(np.searchsorted(starts[order], places, side="right") - 1, 0)]
    s = (places - starts[piece]) / lengths[piece]
    mine = (s >= 0.0) & (s <= 1.0)
    apart = np.abs(_at(coefficients[piece], s[:, None])[:, 0] - values_of(expression, places))
    found = np.zeros(len(starts))
    np.maximum.at(found, piece[mine], apart[mine])
    return found


def _halve(
    expression: Expression, tolerance: float, places: Floats
) -> tuple[Floats, Floats, Floats]:
    inside = np.array([0.02, 0.1, 0.25, 0.45, 0.5, 0.55, 0.75, 0.9, 0.98])
    starts = np.arange(_FINEST_START) / _FINEST_START
    lengths = np.full(_FINEST_START, 1 / _FINEST_START)
    done: list[tuple[Floats, Floats, Floats]] = []
    total = 0
    for halving in range(_MAX_HALVINGS):
        coefficients = _cubics(expression, starts, lengths)
        t = np.minimum(starts[:, None] + lengths[:, None] * inside, 1.0)
        miss = np.abs(_at(coefficients, inside[None, :]) - values_of(expression, t)).max(axis=1)
        if len(places):
            miss = np.maximum(miss, _misses(expression, places, starts, lengths, coefficients))
        # a piece that doubles cannot halve is left as it is
        good = (miss <= tolerance) | (starts + lengths / 2 <= starts)
        if halving == _MAX_HALVINGS - 1 or total + 2 * len(starts) > MAX_PIECES:
            good[:] = True
        done.append((starts[good], lengths[good], coefficients[good]))
        total += int(good.sum())
        starts, lengths = starts[~good], lengths[~good] / 2
        if not len(starts):
            break
        starts = np.concatenate([starts, starts + lengths])
        lengths = np.concatenate([lengths, lengths])
    starts, lengths, coefficients = (np.concatenate(part) for part in zip(*done, strict=True))
    order = np.argsort(starts, kind="stable")
    return starts[order], lengths[order], coefficients[order]


def bins_of(starts: Floats) -> NDArray[np.uint32]:
    """For evenly spaced bins of t, the last piece that begins at or before each bin, uint32."""
    count = min(_MAX_BINS, 1 << max(0, math.ceil(math.log2(len(starts)))) + 1)
    edges = np.arange(count) / count
    return (np.searchsorted(starts, edges, side="right") - 1).astype(np.uint32)


def _in_a_row(arrays: list[Floats]) -> Floats:
    """Return arrays in one, which is not copied where they follow one another in another one."""
    if not arrays:
        return np.zeros(0)
    whole, end = arrays[0].base, arrays[0].ctypes.data
    begin = end
    for array in arrays:
        follows = array.base is whole and array.ctypes.data == end
        if not (follows and array.flags.c_contiguous and isinstance(whole, np.ndarray)):
            return np.concatenate(arrays)
        end += array.nbytes
    assert isinstance(whole, np.ndarray)
    joined = whole[(begin - whole.ctypes.data) // 8 : (end - whole.ctypes.data) // 8]
    joined.flags.writeable = False
    return joined


class CurveStore:
    """Store of the pieces of curves, each curve once."""

    def __init__(self) -> None:
        self._known: dict[Curve, dict[str, Any]] = {}
        self._pieces: list[CurvePieces | Floats] = []
        self._samples: list[Floats] = []
        self._samples_count = 0
        self._knots: list[NDArray[np.float64]] = [np.zeros(1)]
        self._rests: list[NDArray[np.float64]] = [np.zeros(1)]
        self._bins: list[NDArray[np.uint32]] = [np.zeros(1, np.uint32)]
        self._counts = [0, 1, 1]

    def put(self, kind: Any, axis: int, curve: Curve) -> None:
        """Write the position of a curve's pieces into one axis of a KIND, storing new curves."""
        place = self._known.get(curve)  # hashing long vectors is slow: look up once
        if place is None:
            add = self._add_values if isinstance(curve, SampledCurve) else self._add_pieces
            place = self._known[curve] = add(curve)  # type: ignore[arg-type]
        for name, value in place.items():
            kind[name][axis] = value

    def _add_values(self, curve: SampledCurve) -> dict[str, Any]:
        first, knot, bin_ = self._counts
        values = _values(curve)
        count = len(values) - 1
        if len(values) >= LEAST:
            first = SAMPLES + self._samples_count
            self._samples.append(values)
            self._samples_count += len(values)
        else:
            self._pieces.append(values)
            self._counts[0] += len(values)
        pieces = first, count - 1
        return {"count": count, "pieces": pieces, "knots": (knot, bin_), "knotted": 0}

    def _add_pieces(self, formula: KnotCurve | FormulaCurve) -> dict[str, Any]:
        first, knot, bin_ = self._counts
        curve = pieces_of(formula)
        count = len(curve.coefficients)
        self._pieces.append(curve)
        self._counts[0] += count + 1
        if not curve.even:
            bins = bins_of(curve.starts)
            count = len(bins)
            self._bins.append(bins)
            self._knots.append(np.append(curve.starts, np.inf))
            self._rests.append(np.append(curve.rests, 0.0))
            self._counts[1] += len(self._knots[-1])
            self._counts[2] += count
        return {
            "count": count,
            "pieces": (first, count - 1),
            "knots": (knot, bin_),
            "knotted": 0 if curve.even else STEPPED if curve.stepped else 1,
        }

    def curves(self, rasters: RasterStore) -> CurveArrays:
        """Return all pieces, knots and bins that were stored, and the heights of grids."""
        rows, end = np.zeros((self._counts[0], 4)), 0
        for curve in self._pieces:
            begin, end = end, end + len(curve)
            if isinstance(curve, CurvePieces):
                rows[begin : end - 1] = curve.coefficients
                rows[end - 1, :2] = curve.end, curve.last_slope
            else:
                rows[begin:end, 0] = curve
                np.subtract(curve[1:], curve[:-1], out=rows[begin : end - 1, 1])
                rows[end - 1, 1] = rows[end - 2, 1] + 0.0
        return CurveArrays(
            rows.reshape(-1),
            _in_a_row(self._samples),
            np.concatenate(self._knots),
            np.concatenate(self._rests),
            np.concatenate(self._bins),
            *rasters.curves(),
        )
