"""What is written of a fit, and how far it is from the patch on the compiled field."""

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
"""Rounding may make the error so many times as large, …"""

_ALWAYS = 1e-6
"""… or this part of the relief."""

_FINE = 1e-4
"""Factors have decimals for a thousandth of the error, or of this part of the relief."""

_T_DECIMALS = 9
_PIXELS = 1 << 20
"""Heights are asked of so many pixels at a time, about."""


@dataclass(frozen=True, slots=True)
class PrimitiveEntry:
    """A primitive, and the element that stands it on the ground.

    Attributes:
        x, y: curves as a definition has them; None where left out.
        scale, offset: `vScale` and `vOffset` of the element, units of the terrain.
        turn: `turnDeg` of the element.
        summed: the curves are added.
    """

    x: Any
    y: Any
    scale: float
    offset: float = 0.0
    turn: float = 0.0
    summed: bool = False

    def primitive(self) -> dict[str, Any]:
        """The value of its entry in `elemTypes`."""
        low = any(value < 0.0 for value in (*_heights(self.x), *_heights(self.y)))
        return _given(
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
        """An element of this type, in cells from the given one on."""
        return _given(
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


def _given(members: dict[str, Any]) -> dict[str, Any]:
    """Members but for those that are None."""
    return {key: value for key, value in members.items() if value is not None}


def entries_of(
    terms: ProductSum,
    turn: float,
    relief: float,
    error: Callable[[ProductSum], tuple[float, ProductSum]],
) -> tuple[PrimitiveEntry, ...]:
    """The terms as primitives, with as few decimals as serve.

    Args:
        terms: the fit.
        turn: in degrees.
        relief: of the heights, above 0.
        error: the largest error of terms, with the offset that makes it smallest, and those.
    """
    terms, factors = _normal(terms)
    limit = max(_WORSE * error(_scaled(terms, factors))[0], _ALWAYS * relief)
    for decimals in _DECIMALS:
        rounded = replace(terms, x=_rounded(terms.x, decimals), y=_rounded(terms.y, decimals))
        after, fitted = error(_scaled(rounded, factors))
        if after <= limit:
            break
    unit = 1e-3 * max(after, _FINE * relief)
    places = -math.floor(math.log10(unit))
    found = []
    for k in range(terms.count):
        x = spelled(rounded.x_nodes, rounded.x[k], terms.summed)
        y = spelled(rounded.y_nodes, rounded.y[k], terms.summed)
        if x is None and y is None:
            x = [1]
        offset = fitted.offset if k == 0 else 0.0
        scale, offset = round(float(factors[k]), places), round(offset, places)
        if scale == 0.0 and k > 0:
            continue  # the others are exact without it
        found.append(PrimitiveEntry(x, y, scale, offset, turn, terms.summed))
    return tuple(found)


def _normal(terms: ProductSum) -> tuple[ProductSum, Floats]:
    """Curves of size 1 at most, those of a sum from 0 on; and the (K,) factors for them."""
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
    """If one curve is constant, the other one as it begins at 0: the offset takes the rest."""
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


def _scaled(terms: ProductSum, factors: Floats) -> ProductSum:
    """Terms with their factors in the curves."""
    y = terms.y * factors[:, None] if terms.summed else terms.y
    return replace(terms, x=terms.x * factors[:, None], y=y)


def _rounded(values: Floats, decimals: int) -> Floats:
    return np.round(values, decimals) + 0.0  # no negative zeros


def spelled(nodes: Floats, values: Floats, summed: bool) -> list[Any] | None:
    """A curve in JSON: numbers where nodes are even, otherwise knots; None for 1 everywhere."""
    heights = [_plain(z) for z in values.tolist()]
    if len(set(heights)) == 1:
        return None if heights[0] == 1 and not summed else heights[:1]
    if (np.diff(nodes) > 0.0).all():
        return heights
    times = [_plain(round(t, _T_DECIMALS)) for t in nodes.tolist()]
    return [[t, z] for t, z in zip(times, heights, strict=True)]


def _plain(number: float) -> float | int:
    """A number as it is spelled best: whole ones without a point."""
    return int(number) if number.is_integer() and abs(number) < 1e15 else number


def _heights(curve: Any) -> list[float]:
    """The values of a curve that is no text."""
    if not isinstance(curve, list):
        return []
    return [item[1] if isinstance(item, list) else item for item in curve]


@dataclass(frozen=True, slots=True)
class FitError:
    """How far the heights are from the pixels that primitives cover.

    Attributes:
        largest: the largest difference, without sign.
        rms: the root of the mean of their squares.
        x, y: world position of the pixel with the largest one.
        pixels: how many have a height and are covered.
        bare: how many have a height and are not covered.
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
        """A size in per cent of the relief."""
        return 100.0 * size / self.relief if self.relief > 0.0 else 0.0

    def to_json(self) -> dict[str, Any]:
        """The same for programs."""
        return {
            **asdict(self),
            "largestPercent": self.share(self.largest),
            "rmsPercent": self.share(self.rms),
        }


def fit_error(patch: Patch, entries: tuple[PrimitiveEntry, ...]) -> FitError:
    """Compile a terrain with the primitives in a cell of the patch's size, and compare it."""
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
