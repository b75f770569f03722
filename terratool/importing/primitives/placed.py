"""How far primitives are from a patch, asked of the compiled terrain, as a user would see it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import msgspec
import numpy as np

from terratool.importing.primitives.entries import PrimitiveEntry
from terratool.importing.primitives.terms import Patch

_PIXELS = 1 << 20
"""Heights are asked of so many pixels at a time, about."""


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
    from terratool.definition.source import Source
    from terratool.field.terrain import Terrain

    lattice = patch.samples.lattice
    checked = check(Source("patch", msgspec.json.encode(_definition(patch, entries))))
    assert checked.definition is not None, checked.findings
    terrain = Terrain(checked.definition)
    x = (np.arange(lattice.columns) + 0.5) * lattice.dx
    largest, squares, pixels, bare = 0.0, 0.0, 0, 0
    at = 0, 0
    step = max(1, _PIXELS // lattice.columns)
    for first in range(0, lattice.rows, step):
        row = np.arange(first, min(first + step, lattice.rows))
        y = (row + 0.5) * lattice.dy
        z = patch.values[row]
        known = ~np.isnan(z)
        u, v = patch.unit(row[:, None], np.arange(lattice.columns)[None, :])
        covered = known & (np.abs(u - 0.5) <= 0.5) & (np.abs(v - 0.5) <= 0.5)
        pixels += int(covered.sum())
        bare += int((known & ~covered).sum())
        off = np.where(covered, np.abs(terrain.height(x[None, :], y[:, None]) - z), 0.0)
        squares += float((off * off).sum())
        worst = int(off.argmax())
        if off.flat[worst] > largest:
            largest = float(off.flat[worst])
            at = first + worst // lattice.columns, worst % lattice.columns
    relief = float(np.nanmax(patch.values) - np.nanmin(patch.values))
    return FitError(
        largest,
        math.sqrt(squares / max(pixels, 1)),
        lattice.west + (at[1] + 0.5) * lattice.dx,
        lattice.south + (at[0] + 0.5) * lattice.dy,
        pixels,
        bare,
        relief,
    )


def _definition(patch: Patch, entries: tuple[PrimitiveEntry, ...]) -> dict[str, Any]:
    lattice = patch.samples.lattice
    names = [f"p{k}" for k in range(len(entries))]
    return {
        "size": [lattice.columns * lattice.dx, lattice.rows * lattice.dy],
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
