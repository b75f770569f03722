"""Hats: a DEM as few elements, each a tent along x and y at one pixel, coarse ones first.

A hat stands where the DEM differs by more than half a step from what the coarser ones make of it,
so that flat and smooth ground costs nothing. The sum is bilinear between the centres of pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.terrain.rows import BLOCK, cuts, support

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Text = tuple[bytes, bytes]


@dataclass(frozen=True, slots=True)
class Hats:
    """Hats of one fineness.

    Attributes:
        rows, columns: ascending, the rows and columns of pixels at which hats may stand.
        counts: (len(rows), len(columns)) int64, steps that each is high.
    """

    rows: Ints
    columns: Ints
    counts: Ints


def hats_of(heights: Floats, step: float, base: float) -> list[Hats]:
    """The hats that make a DEM, coarse ones first.

    Args:
        heights: (rows, columns), NaN where unknown; there they are what comes of the others.
        step: what is rounded to.
        base: the height without any hat.
    """
    axes = [np.array(cuts(count, BLOCK)) for count in heights.shape]
    levels = np.full([len(axis) for axis in axes], base)
    fresh = np.ones(levels.shape, bool)
    found = []
    size = BLOCK
    while True:
        known = heights[np.ix_(*axes)]
        counts = np.where(fresh & ~np.isnan(known), np.rint((known - levels) / step), 0.0)
        levels += counts * step
        found.append(Hats(axes[0], axes[1], counts.astype(np.int64)))
        if size == 1:
            return found
        size //= 2
        finer = [_halved(axis, size) for axis in axes]
        for axis in range(2):
            levels = _between(levels, axes[axis], finer[axis], axis)
        old = [np.isin(new, axis) for new, axis in zip(finer, axes, strict=True)]
        fresh = ~np.logical_and.outer(*old)
        axes = finer


def texts_of(some: list[Hats], shape: tuple[int, int], step: float) -> Iterator[Text]:
    """The hats that are not 0 high as text.

    Args:
        some: the hats, coarse ones first.
        shape: rows and columns of the DEM.
        step: what heights were rounded to.

    Yields:
        A primitive, empty where it came before, and one element or several with commas between.
    """
    names: dict[tuple[str, str], bytes] = {}
    for level in some:
        ys = [support(row, level.rows.tolist(), shape[0]) for row in level.rows.tolist()]
        xs = [
            support(column, level.columns.tolist(), shape[1]) for column in level.columns.tolist()
        ]
        for row in np.flatnonzero(level.counts.any(axis=1)).tolist():
            y, south, north = ys[row]
            line: list[bytes] = []
            columns = np.flatnonzero(level.counts[row])
            counts = level.counts[row, columns].tolist()
            for column, count in zip(columns.tolist(), counts, strict=True):
                x, west, east = xs[column]
                if (x, y) not in names:
                    names[x, y] = b"hat-%d" % (len(names) + 1) if names else b"hat"
                    primitive = (names[x, y], x.encode(), y.encode())
                    yield b'"%s":{"x":%s,"y":%s}' % primitive, b""
                line.append(
                    b'{"type":"%s","cellX":%d,"cellY":%d,"span":[%d,%d],"vScale":%.15g}'
                    % (names[x, y], west, south, east - west, north - south, count * step)
                )
            yield b"", b",\n".join(line)


def _halved(axis: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Positions with the middles of all gaps wider than `size`."""
    wide = np.flatnonzero(np.diff(axis) > size)
    return np.insert(axis, wide + 1, (axis[wide] + axis[wide + 1]) // 2)


def _between(levels: Floats, old: NDArray[np.int64], new: NDArray[np.int64], axis: int) -> Floats:
    """Levels at new positions along an axis, linear between those at the old ones."""
    place = np.clip(np.searchsorted(old, new, side="right") - 1, 0, max(0, len(old) - 2))
    after = np.minimum(place + 1, len(old) - 1)
    gap = np.maximum(old[after] - old[place], 1)
    share = ((new - old[place]) / gap).reshape((-1, 1) if axis == 0 else (1, -1))
    return np.asarray(
        np.take(levels, place, axis) * (1 - share) + np.take(levels, after, axis) * share
    )
