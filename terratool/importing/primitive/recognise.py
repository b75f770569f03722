"""Recognition of named curves that fit a patch as well as free values.

Freely fitted curves only suggest which named ones to try. The error of the heights decides, with
the best vScale and vOffset for each pair of curves.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from terratool.definition.expression import NAMED, evaluate, parse
from terratool.field.pieces import FUNCTIONS
from terratool.importing.primitive import fit, products
from terratool.importing.primitive.entries import PrimitiveEntry, fit_error, spell_curve
from terratool.importing.primitive.products import Floats, Patch, Points, ProductSum, basis, nodes

_CURVES = {name: parse(text) for name, text in NAMED.items()}
_RISING = ("ramp", "smoothstep")
"""Names of the curves that differ from their mirror image."""

_ENDS = np.round(np.arange(0.0, 1.0001, 0.05), 2)
_SHORTEST = 0.15
_STEPS = 0.02, 0.01, 0.005, 0.002, 0.001
_WORSE = 1.1
"""Largest ratio of a pair's error to the best one's at which the plainest pair is taken."""

_LOOSE, _SHARE = 1.25, 0.01
"""Error allowed without a tolerance: a multiple of the free fit's, or a share of the relief."""

_PIXELS = 64
_TRIED = 3


@dataclass(frozen=True, slots=True)
class NamedForm:
    """A named curve from t = low to t = high, 0 or its last value beyond; or its mirror image."""

    name: str
    low: float = 0.0
    high: float = 1.0
    mirrored: bool = False

    @property
    def is_trimmed(self) -> bool:
        """Whether the curve is shorter than the cell."""
        return (self.low, self.high) != (0.0, 1.0)

    def values(self, t: Floats) -> Floats:
        """Return the curve's values, in the shape of t."""
        s = (t - self.low) / (self.high - self.low)
        if self.name != "gauss":
            s = np.clip(s, 0.0, 1.0)
        values = evaluate(_CURVES[self.name], 1.0 - s if self.mirrored else s, FUNCTIONS)
        return np.broadcast_to(values, t.shape)

    def spell(self) -> str:
        """Return the curve's name, or an expression."""
        s = "t"
        if self.is_trimmed:
            width = f"{self.high - self.low:.6g}"
            s = f"(t - {self.low:g})/{width}" if self.low else f"t/{width}"
            if self.name != "gauss":
                s = f"min(1, max(0, {s}))" if self.low else f"min(1, {s})"
        if self.mirrored:
            s = f"1 - {s}" if not self.is_trimmed or s.startswith("min") else f"1 - ({s})"
        if s == "t":
            return self.name
        if self.name == "ramp":
            return s
        within = s if s.startswith("min") else f"({s})"
        return re.sub(r"\bt\b", lambda _: within, NAMED[self.name])


@dataclass(frozen=True, slots=True)
class RecognisedPair:
    """A pair of curves with their factor and offset; a free curve is an array of values."""

    error: float
    x: NamedForm | Floats
    y: NamedForm | Floats
    scale: float
    offset: float

    @property
    def plainness(self) -> tuple[int, int]:
        """Number of free curves, and of trimmed ones, for comparing."""
        curves = (self.x, self.y)
        return (
            sum(not isinstance(curve, NamedForm) for curve in curves),
            sum(isinstance(curve, NamedForm) and curve.is_trimmed for curve in curves),
        )


def recognise(
    patch: Patch, terms: ProductSum, error: float, tolerance: float | None
) -> PrimitiveEntry | None:
    """Return the plainest named curves for one product, or for one of its curves, that fit.

    Args:
        patch: the heights; they have a relief.
        terms: the free fit.
        error: largest error of the free fit.
        tolerance: largest error allowed; if None, 1.25 times that of the free fit or 1 % of the
            relief.

    Returns:
        The plainest pair that fits, or None.
    """
    relief = patch.relief
    limit = max(_LOOSE * error, _SHARE * relief) if tolerance is None else tolerance
    points = products.points_of(patch, _PIXELS)
    x_forms, y_forms = _suggest_forms(patch, points)
    whole = [_best_factor(points, x, y) for x, y in product(_forms(), repeat=2)]
    found = [*whole, *_pairs(points, x_forms, y_forms)]
    fitting_pairs = _close([pair for pair in found if pair.error <= limit])
    if not fitting_pairs:
        halves = _halves(points, x_forms, y_forms, terms)
        fitting_pairs = _close([pair for pair in halves if pair.error <= limit])
    for pair in fitting_pairs:
        entry = _entry(pair, terms, patch.turn, relief)
        if fit_error(patch, (entry,)).largest <= limit:
            return entry
    return None


def _close(found: list[RecognisedPair]) -> list[RecognisedPair]:
    """Sort pairs that are nearly as good as the best one by plainness; return the first few."""
    if not found:
        return []
    least = min(pair.error for pair in found)
    return sorted(
        found, key=lambda pair: (pair.error > _WORSE * least, pair.plainness, pair.error)
    )[:_TRIED]


def _forms() -> Iterator[NamedForm]:
    for name in NAMED:
        yield NamedForm(name)
        if name in _RISING:
            yield NamedForm(name, mirrored=True)


def _best_factor(points: Points, x: NamedForm, y: NamedForm) -> RecognisedPair:
    """Return the best factor and offset for two curves, by least squares and then for the error."""
    values = x.values(points.u) * y.values(points.v)
    middle, mean = float(values.mean()), float(points.z.mean())
    spread = float(((values - middle) ** 2).sum())
    scale = float(((values - middle) * (points.z - mean)).sum()) / spread if spread > 0.0 else 0.0
    error, offset = _centre(points.z - scale * values)
    return RecognisedPair(error, x, y, scale, offset)


def _centre(residuals: Floats) -> tuple[float, float]:
    """Return the largest error with the best offset, and that offset."""
    low, high = float(residuals.min()), float(residuals.max())
    return 0.5 * (high - low), 0.5 * (low + high)


def _suggest_forms(patch: Patch, points: Points) -> tuple[list[NamedForm], list[NamedForm]]:
    """Return the named curves along x and y most similar to freely fitted ones, trimmed alike."""
    rows, columns = patch.values.shape
    x_nodes, y_nodes = nodes(min(33, columns)), nodes(min(33, rows))
    begin = products.best_sums(products.grid_of(patch, _PIXELS), x_nodes, y_nodes, 1, 1)[0]
    problem = fit.problem_of(points, x_nodes, y_nodes)
    free = fit.least_squares(problem, begin, 30)
    return _alike(x_nodes, free.x[0]), _alike(y_nodes, free.y[0])


def _alike(t: Floats, values: Floats) -> list[NamedForm]:
    """Return the best trimming of each name, the most similar names first."""
    found = []
    for plain in _forms():
        tried: list[tuple[float, int, NamedForm]] = []
        for low, high in product(_ENDS.tolist(), repeat=2):
            if high - low < _SHORTEST or (plain.name == "flat" and (low, high) != (0.0, 1.0)):
                continue
            form = NamedForm(plain.name, low, high, plain.mirrored)
            tried.append((_unlike(form.values(t), values), len(tried), form))
        found.append(min(tried))
    found.sort(key=lambda each: each[0])
    return [form for _, _, form in found[:_TRIED]]


def _unlike(curve: Floats, values: Floats) -> float:
    """Return the sum of squares that the best factor and offset leave."""
    curve, values = curve - curve.mean(), values - values.mean()
    square = float(curve @ curve)
    return float(values @ values) - (float(curve @ values) ** 2 / square if square > 0.0 else 0.0)


def _pairs(
    points: Points, x_forms: list[NamedForm], y_forms: list[NamedForm]
) -> Iterator[RecognisedPair]:
    """Yield pairs of suggested curves, with ends moved to the smallest error."""
    for x, y in product(x_forms, y_forms):
        best = _best_factor(points, x, y)
        for step in _STEPS:
            improved = True
            while improved:
                improved = False
                for pair in _neighbours(best, step):
                    tried = _best_factor(points, *pair)
                    if tried.error < best.error:
                        best, improved = tried, True
        yield best


def _neighbours(pair: RecognisedPair, step: float) -> Iterator[tuple[NamedForm, NamedForm]]:
    """Yield the pairs with one end of one curve moved by a step."""
    x, y = pair.x, pair.y
    assert isinstance(x, NamedForm) and isinstance(y, NamedForm)
    for form, other, first in ((x, y, True), (y, x, False)):
        if form.name == "flat":
            continue
        for low, high in ((-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)):
            moved = NamedForm(
                form.name, round(max(0.0, form.low + low), 3), round(min(1.0, form.high + high), 3),
                form.mirrored,
            )  # fmt: skip
            if moved.high - moved.low >= _SHORTEST:
                yield (moved, other) if first else (other, moved)


def _halves(
    points: Points, x_forms: list[NamedForm], y_forms: list[NamedForm], terms: ProductSum
) -> Iterator[RecognisedPair]:
    """Yield pairs of one named curve and free values of the other."""
    for form in dict.fromkeys([*_forms(), *x_forms]):
        yield _with_values(points, form, terms.y_nodes, True)
    for form in dict.fromkeys([*_forms(), *y_forms]):
        yield _with_values(points, form, terms.x_nodes, False)


def _with_values(points: Points, form: NamedForm, free: Floats, along_x: bool) -> RecognisedPair:
    """Fit free values to the other axis of a named curve, by linear least squares."""
    named, other = (points.u, points.v) if along_x else (points.v, points.u)
    matrix = np.column_stack(
        [form.values(named)[:, None] * basis(free, other), np.ones(len(other))]
    )
    solution = np.linalg.lstsq(matrix, points.z, rcond=1e-12)[0]
    error, middle = _centre(points.z - matrix @ solution)
    values, offset = solution[:-1], float(solution[-1]) + middle
    scale = float(values[np.abs(values).argmax()]) or 1.0
    curve: Floats = np.asarray(values / scale, np.float64)
    if along_x:
        return RecognisedPair(error, form, curve, scale, offset)
    return RecognisedPair(error, curve, form, scale, offset)


def _entry(pair: RecognisedPair, terms: ProductSum, turn: float, relief: float) -> PrimitiveEntry:
    places = -int(np.floor(np.log10(1e-3 * max(pair.error, 1e-4 * relief))))
    x, y = _spell(pair.x, terms.x_nodes), _spell(pair.y, terms.y_nodes)
    if x == "flat" and y != "flat":
        x = None
    elif y == "flat":
        y = None
    return PrimitiveEntry(x, y, round(pair.scale, places), round(pair.offset, places), turn)


def _spell(curve: NamedForm | Floats, free: Floats) -> Any:
    if isinstance(curve, NamedForm):
        return curve.spell()
    return spell_curve(free, np.round(curve, 4) + 0.0, summed=True)
