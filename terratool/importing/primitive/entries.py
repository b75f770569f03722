"""Primitives and elements as written to a definition, and their error on the compiled field."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import msgspec
import numpy as np

from terratool.importing.primitive.products import Floats, Patch, ProductSum

_DECIMALS = range(3, 10)
_WORSE = 1.001
"""Largest ratio of errors after and before rounding."""

_ALWAYS = 1e-6
"""Error that rounding may always reach, as a share of the relief."""

_FINE = 1e-4
"""Share of the relief; factors have decimals for a thousandth of the error, or of this share."""

_T_DECIMALS = 9
_PIXELS = 1 << 20
"""Pixels whose heights are evaluated at a time, about."""


@dataclass(frozen=True, slots=True)
class PrimitiveEntry:
    """A primitive, and the scale, offset and turn of its element.

    Attributes:
        x: curve along x as a definition has it; None if it is left out.
        y: curve along y as a definition has it; None if it is left out.
        scale: `vScale` of the element, units of the terrain.
        offset: `vOffset` of the element, units of the terrain.
        turn: `turnDeg` of the element.
        summed: whether the curves are added rather than multiplied.
    """

    x: Any
    y: Any
    scale: float
    offset: float = 0.0
    turn: float = 0.0
    summed: bool = False

    def primitive(self) -> dict[str, Any]:
        """Return the value of the primitive in `elemTypes`."""
        low = any(value < 0.0 for value in (*_heights(self.x), *_heights(self.y)))
        return _without_none(
            {
                "x": self.x,
                "y": self.y,
                "combine": "sum" if self.summed else None,
                "x-ignore": ["TT306"] if low else None,
            }
        )

    def element(
        self, name: str, cell: tuple[int, int] | None = None, span: tuple[int, int] = (1, 1)
    ) -> dict[str, Any]:
        """Return an element of type `name` in a cell with a span; None leaves the cell out."""
        return _without_none(
            {
                "cellX": cell and cell[0],
                "cellY": cell and cell[1],
                "span": list(span) if cell and span != (1, 1) else None,
                "type": name,
                "vScale": _plain(self.scale),
                "vOffset": _plain(self.offset) or None,
                "turnDeg": _plain(self.turn) or None,
            }
        )


def _without_none(members: dict[str, Any]) -> dict[str, Any]:
    """Return members without those that are None."""
    return {key: value for key, value in members.items() if value is not None}


def entries_of(
    terms: ProductSum,
    turn: float,
    relief: float,
    error: Callable[[ProductSum], tuple[float, ProductSum]],
) -> tuple[PrimitiveEntry, ...]:
    """Return the terms as primitives, with as few decimals as suffice.

    Args:
        terms: the fit.
        turn: turn in degrees.
        relief: highest minus lowest height, above 0.
        error: returns the largest error of terms with their best offset, and the terms with it.
    """
    terms, factors = _normal(terms)
    limit = max(_WORSE * error(_apply_factors(terms, factors))[0], _ALWAYS * relief)
    for decimals in _DECIMALS:
        rounded = replace(terms, x=_round(terms.x, decimals), y=_round(terms.y, decimals))
        after, fitted = error(_apply_factors(rounded, factors))
        if after <= limit:
            break
    unit = 1e-3 * max(after, _FINE * relief)
    places = -math.floor(math.log10(unit))
    found = []
    for k in range(terms.count):
        x = spell_curve(rounded.x_nodes, rounded.x[k], terms.summed)
        y = spell_curve(rounded.y_nodes, rounded.y[k], terms.summed)
        if x is None and y is None:
            x = [1]
        offset = fitted.offset if k == 0 else 0.0
        scale, offset = round(float(factors[k]), places), round(offset, places)
        if scale == 0.0 and k > 0:
            continue  # the other terms are exact without this one
        found.append(PrimitiveEntry(x, y, scale, offset, turn, terms.summed))
    return tuple(found)


def _normal(terms: ProductSum) -> tuple[ProductSum, Floats]:
    """Scale curves to size 1 at most, a sum's from 0 on; return them with their factors, (K,)."""
    if terms.summed:
        low_x, low_y = float(terms.x.min()), float(terms.y.min())
        x, y = terms.x - low_x, terms.y - low_y
        factor = max(float(x.max()), float(y.max())) or 1.0
        offset = terms.offset + low_x + low_y
        return replace(terms, x=x / factor, y=y / factor, offset=offset), np.array([factor])
    terms = _from_zero(terms)
    # the value of largest size becomes 1
    by_x = np.take_along_axis(terms.x, np.abs(terms.x).argmax(axis=1)[:, None], axis=1)
    by_y = np.take_along_axis(terms.y, np.abs(terms.y).argmax(axis=1)[:, None], axis=1)
    factors = (by_x * by_y)[:, 0]
    by_x, by_y = np.where(by_x == 0.0, 1.0, by_x), np.where(by_y == 0.0, 1.0, by_y)
    return replace(terms, x=terms.x / by_x, y=terms.y / by_y), factors


def _from_zero(terms: ProductSum) -> ProductSum:
    """If one curve is constant, shift the other to begin at 0, and the offset by the difference."""
    if terms.count > 1 or 1 not in (len(terms.x_nodes), len(terms.y_nodes)):
        return terms
    one = np.ones((1, 1))
    if len(terms.y_nodes) == 1:
        curve = terms.x * terms.y[0, 0]
        low = float(curve.min())
        return replace(terms, x=curve - low, y=one, offset=terms.offset + low)
    curve = terms.y * terms.x[0, 0]
    low = float(curve.min())
    return replace(terms, x=one, y=curve - low, offset=terms.offset + low)


def _apply_factors(terms: ProductSum, factors: Floats) -> ProductSum:
    """Multiply terms by their factors, (K,)."""
    y = terms.y * factors[:, None] if terms.summed else terms.y
    return replace(terms, x=terms.x * factors[:, None], y=y)


def _round(values: Floats, decimals: int) -> Floats:
    return np.round(values, decimals) + 0.0  # no negative zeros


def spell_curve(nodes: Floats, values: Floats, summed: bool) -> list[Any] | None:
    """Return a curve as JSON: numbers at even nodes, else knots; None for 1 everywhere."""
    heights = [_plain(z) for z in values.tolist()]
    if len(set(heights)) == 1:
        return None if heights[0] == 1 and not summed else heights[:1]
    if (np.diff(nodes) > 0.0).all():
        return heights
    times = [_plain(round(t, _T_DECIMALS)) for t in nodes.tolist()]
    return [[t, z] for t, z in zip(times, heights, strict=True)]


def _plain(number: float) -> float | int:
    """Return a number as it is spell_curve best: a whole one without a point."""
    return int(number) if number.is_integer() and abs(number) < 1e15 else number


def _heights(curve: Any) -> list[float]:
    """Values of a curve; none for a named curve or expression."""
    if not isinstance(curve, list):
        return []
    return [item[1] if isinstance(item, list) else item for item in curve]


@dataclass(frozen=True, slots=True)
class FitError:
    """Error of primitives at the pixels that they cover.

    Attributes:
        largest: largest difference of heights, without sign.
        rms: root mean square of the differences.
        x: world position along x of the pixel with the largest difference.
        y: world position along y of the pixel with the largest difference.
        pixels: number of covered pixels with a height.
        bare: number of pixels with a height that are not covered.
        relief: highest minus lowest height of all pixels.
    """

    largest: float
    rms: float
    x: float
    y: float
    pixels: int
    bare: int
    relief: float

    def share(self, size: float) -> float:
        """Return a size as a percentage of the relief."""
        return 100.0 * size / self.relief if self.relief > 0.0 else 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the error as JSON values, with percentages."""
        return {
            **asdict(self),
            "largestPercent": self.share(self.largest),
            "rmsPercent": self.share(self.rms),
        }


def fit_error(patch: Patch, entries: tuple[PrimitiveEntry, ...]) -> FitError:
    """Compile the primitives in one cell of the patch's size, and measure their error."""
    from terratool.definition.reader import check
    from terratool.field.terrain import Terrain
    from terratool.text.source import Source

    grid = patch.samples.grid
    checked = check(Source("patch", msgspec.json.encode(_definition(patch, entries))))
    terrain = Terrain(checked)
    x = (np.arange(grid.columns) + 0.5) * grid.dx
    largest, squares, pixels, bare = 0.0, 0.0, 0, 0
    at = 0, 0
    step = max(1, _PIXELS // grid.columns)
    for first in range(0, grid.rows, step):
        row = np.arange(first, min(first + step, grid.rows))
        y = (row + 0.5) * grid.dy
        z = patch.values[row]
        known = ~np.isnan(z)
        covered = known & patch.covers(row[:, None], np.arange(grid.columns)[None, :])
        pixels += int(covered.sum())
        bare += int((known & ~covered).sum())
        off = np.where(covered, np.abs(terrain.height(x[None, :], y[:, None]) - z), 0.0)
        squares += float((off * off).sum())
        worst = int(off.argmax())
        if off.flat[worst] > largest:
            largest = float(off.flat[worst])
            at = first + worst // grid.columns, worst % grid.columns
    rms = math.sqrt(squares / max(pixels, 1))
    return FitError(largest, rms, *grid.centre(*at), pixels, bare, patch.relief)


def _definition(patch: Patch, entries: tuple[PrimitiveEntry, ...]) -> dict[str, Any]:
    grid = patch.samples.grid
    names = [f"p{k}" for k in range(len(entries))]
    return {
        "size": list(grid.size),
        "elemTypes": {
            "ground": {"x": [0]},
            **{name: entry.primitive() for name, entry in zip(names, entries, strict=True)},
        },
        "elemTree": {
            "type": "ground",
            "cells": 1,
            "children": [
                entry.element(name, (0, 0)) for name, entry in zip(names, entries, strict=True)
            ],
        },
    }
