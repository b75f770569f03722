"""Sums of products of two curves, and the best of few terms for a grid by least squares."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.importing.types import SampledHeights

Floats = NDArray[np.float64]
REACH = 4.0
"""Distance, in reliefs, below the lowest and above the highest height at which offsets are sought.
"""

_OFFSETS = 49
_ROUNDS = 4
"""Rounds in which heights of missing pixels are replaced by those of the fit."""

_TINY = 1e-9
_SPARSE = 0.9
"""Share of missing heights above which scattered pixels replace columns and rows."""


@dataclass(frozen=True, slots=True)
class ProductSum:
    """Heights over the unit square: `offset` + Σₖ xₖ(u) · yₖ(v), or `offset` + x(u) + y(v).

    Attributes:
        x_nodes: (p,) ascending from 0 to 1; two equal nodes are a vertical step, a single one is a
            constant.
        y_nodes: (q,) nodes along y, as `x_nodes`.
        x: (K, p) values at the nodes, linear in between.
        y: (K, q) values at the nodes, linear in between.
        offset: height added to the sum.
        summed: whether the two curves are added; then K is 1.
    """

    x_nodes: Floats
    y_nodes: Floats
    x: Floats
    y: Floats
    offset: float
    summed: bool = False

    @property
    def count(self) -> int:
        """Number of terms, K."""
        return len(self.x)


@dataclass(frozen=True, slots=True)
class Patch:
    """Heights of pixels, and the turn of the unit square that a primitive spans over them.

    Attributes:
        samples: the pixels, row 0 the southernmost.
        turn: turn of the primitive in degrees, clockwise as seen from above.
    """

    samples: SampledHeights
    turn: float = 0.0

    @property
    def values(self) -> Floats:
        """Heights, (rows, columns) float64, NaN for none."""
        return np.ascontiguousarray(self.samples.values)

    @property
    def relief(self) -> float:
        """Highest minus lowest height."""
        return float(np.nanmax(self.values) - np.nanmin(self.values))

    @property
    def affine(self) -> Floats:
        """Changes of u and v by column and by row, (4,): docs/format.md, footprints and turning."""
        grid = self.samples.grid
        columns, rows = grid.columns, grid.rows
        if self.turn == 0.0:
            return np.array([1.0 / columns, 0.0, 0.0, 1.0 / rows])
        angle = math.radians(self.turn)
        cos, sin = math.cos(angle), math.sin(angle)
        stretch = grid.dy / grid.dx
        return np.array([cos / columns, -sin * stretch / columns, sin / stretch / rows, cos / rows])

    def unit(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return positions u and v of pixel centres, in the shape of row and column together."""
        rows, columns = self.values.shape
        dx, dy = column + 0.5 - 0.5 * columns, row + 0.5 - 0.5 * rows
        a, b, c, d = self.affine
        return 0.5 + (a * dx + b * dy), 0.5 + (c * dx + d * dy)

    def covers(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask of pixel centres in the unit square, in the shape of row and column together."""
        u, v = self.unit(row, column)
        return np.asarray((np.abs(u - 0.5) <= 0.5) & (np.abs(v - 0.5) <= 0.5))


@dataclass(frozen=True, slots=True)
class Points:
    """Scattered heights z at u and v in the unit square, (n,) float64 each."""

    u: Floats
    v: Floats
    z: Floats

    def join(self, other: Points) -> Points:
        """Return these points and others."""
        return Points(
            np.concatenate([self.u, other.u]),
            np.concatenate([self.v, other.v]),
            np.concatenate([self.z, other.z]),
        )


def nodes(count: int, steps: tuple[float, ...] = ()) -> Floats:
    """Return evenly spaced nodes from 0 to 1, with two at each step in place of nodes near it.

    Args:
        count: number of even nodes; 1 makes a constant if there are no steps.
        steps: positions of vertical steps; those at or beyond 0 and 1 are ignored.
    """
    inner = sorted({step for step in steps if 0.0 < step < 1.0})
    if count == 1 and not inner:
        return np.zeros(1)
    count = max(count, 2)
    spacing = 1.0 / (count - 1)
    even = [
        t
        for t in (np.arange(count) / (count - 1)).tolist()
        if t in (0.0, 1.0) or all(abs(t - step) > 0.5 * spacing for step in inner)
    ]
    return np.array(sorted([*even, *inner, *inner]))


@dataclass(frozen=True, slots=True)
class PatchGrid:
    """Heights at positions of the unit square in columns and rows.

    Attributes:
        u: (n,) positions of the columns, ascending.
        v: (m,) positions of the rows, ascending.
        z: (m, n) heights, NaN for none.
    """

    u: Floats
    v: Floats
    z: Floats


def grid_of(patch: Patch, most: int) -> PatchGrid:
    """Return heights at up to `most` columns and rows; of the nearest pixels if turned."""
    grid = _regular(patch, most)
    if np.isnan(grid.z).mean() <= _SPARSE:
        return grid
    points = points_of(patch, most)
    m, n = grid.z.shape
    row, column = np.minimum(points.v * m, m - 1), np.minimum(points.u * n, n - 1)
    grid.z[row.astype(np.int64), column.astype(np.int64)] = points.z
    return grid


def _regular(patch: Patch, most: int) -> PatchGrid:
    rows, columns = patch.values.shape
    if patch.turn == 0.0:
        row, column = _spread_indices(rows, most), _spread_indices(columns, most)
        u, v = (column + 0.5) / columns, (row + 0.5) / rows
        return PatchGrid(u, v, np.ascontiguousarray(patch.values[np.ix_(row, column)]))
    n, m = min(columns, most), min(rows, most)
    u, v = (np.arange(n) + 0.5) / n, (np.arange(m) + 0.5) / m
    a, b, c, d = patch.affine
    inverse = np.linalg.inv(np.array([[a, b], [c, d]]))
    x = inverse[0, 0] * (u - 0.5)[None, :] + inverse[0, 1] * (v - 0.5)[:, None] + 0.5 * columns
    y = inverse[1, 0] * (u - 0.5)[None, :] + inverse[1, 1] * (v - 0.5)[:, None] + 0.5 * rows
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    within = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    z = np.full((m, n), np.nan)
    z[within] = patch.values[row[within], column[within]]
    return PatchGrid(u, v, z)


def points_of(patch: Patch, most: int) -> Points:
    """Return pixels in the unit square that stand in `most` columns and rows at most."""
    return points_at(patch, *pick_pixels(patch, most))


def pick_pixels(patch: Patch, most: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns, (n,) each, of pixels in `most` rows and columns at most.

    If hardly any of these pixels has a height, as many pixels with a height are returned instead.
    """
    rows, columns = patch.values.shape
    row, column = np.meshgrid(
        _spread_indices(rows, most), _spread_indices(columns, most), indexing="ij"
    )
    if np.isnan(patch.values[row, column]).mean() <= _SPARSE:
        return row.ravel(), column.ravel()
    known = np.flatnonzero(~np.isnan(patch.values))
    row, column = np.divmod(known[_spread_indices(len(known), most * most)], columns)
    return row, column


def points_at(patch: Patch, row: NDArray[np.int64], column: NDArray[np.int64]) -> Points:
    """Return points at some pixels, but for those without a height or outside of the square."""
    u, v = patch.unit(row, column)
    z = patch.values[row, column]
    within = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1) & ~np.isnan(z)
    return Points(u[within], v[within], z[within])


def _spread_indices(count: int, most: int) -> NDArray[np.int64]:
    if count <= most:
        return np.arange(count)
    # the middles of equal parts: a mirrored patch gives mirrored pixels, but for rounding
    return ((np.arange(most) + 0.5) * (count / most)).astype(np.int64)


def basis(nodes: Floats, t: Floats) -> Floats:
    """Weights of the nodes' values at each t, (n, p)."""
    matrix = np.zeros((len(t), len(nodes)))
    if len(nodes) == 1:
        matrix[:] = 1.0
        return matrix
    low = np.clip(np.searchsorted(nodes, t, "right") - 1, 0, len(nodes) - 2)
    part = (t - nodes[low]) / (nodes[low + 1] - nodes[low])
    at = np.arange(len(t))
    matrix[at, low] = 1.0 - part
    matrix[at, low + 1] = part
    return matrix


def best_sums(
    grid: PatchGrid, x_nodes: Floats, y_nodes: Floats, terms: int, best: int = 3
) -> list[ProductSum]:
    """Return the best sums of products, for the offsets of smallest largest error, best first.

    A missing height is replaced by that of the fit, several times, so that it has no effect.

    Args:
        grid: heights, at least one of them known.
        x_nodes: nodes of the curves along x.
        y_nodes: nodes of the curves along y.
        terms: number of products.
        best: number of offsets.
    """
    low, high = float(np.nanmin(grid.z)), float(np.nanmax(grid.z))
    relief = high - low
    a, b = basis(x_nodes, grid.u), basis(y_nodes, grid.v)
    offsets = np.linspace(low - REACH * relief, high + REACH * relief, _OFFSETS)
    values, x, y = _products(grid, a, b, offsets, terms)
    with np.errstate(invalid="ignore"):
        worst = np.nanmax(np.abs(grid.z - values), axis=(1, 2))
    found: list[int] = []
    for n in np.argsort(worst, kind="stable"):
        # skip the neighbours of a better offset
        if all(abs(n - other) > 1 for other in found):
            found.append(int(n))
    return [ProductSum(x_nodes, y_nodes, x[n], y[n], float(offsets[n])) for n in found[:best]]


def _products(
    grid: PatchGrid, a: Floats, b: Floats, offsets: Floats, terms: int
) -> tuple[Floats, Floats, Floats]:
    """Fit heights (offsets, m, n) and curve values (offsets, K, p) and (offsets, K, q)."""
    columns, from_columns = _orthogonal(a)
    rows, from_rows = _orthogonal(b)
    missing = np.isnan(grid.z)
    terms = min(terms, columns.shape[1], rows.shape[1])
    filled = _nearest(grid.z)[None] - offsets[:, None, None]
    for _ in range(_ROUNDS if missing.any() else 1):
        u, s, vt = _svd(rows.T @ filled @ columns)
        root = np.sqrt(s[:, :terms, None])
        inner_y = u[:, :, :terms].transpose(0, 2, 1) * root
        inner_x = vt[:, :terms] * root
        fitted = (inner_y @ rows.T).transpose(0, 2, 1) @ (inner_x @ columns.T)
        filled = np.where(missing, fitted, filled)
    return fitted + offsets[:, None, None], inner_x @ from_columns.T, inner_y @ from_rows.T


def _orthogonal(matrix: Floats) -> tuple[Floats, Floats]:
    """Return an orthonormal basis of the columns' span, and its matrix to coefficients."""
    u, s, vt = _svd(matrix)
    kept = s > _TINY * s[0]
    return u[:, kept], vt[kept].T / s[kept]


def _svd(matrices: Floats) -> tuple[Floats, Floats, Floats]:
    """Reduced singular value decomposition: u (…, m, k), s (…, k), vt (…, k, n)."""
    try:
        return np.linalg.svd(matrices, full_matrices=False)
    except np.linalg.LinAlgError:  # LAPACK's gesdd gives up on one matrix in a million
        u, s, vt = np.linalg.svd(np.swapaxes(matrices, -1, -2), full_matrices=False)
        return np.swapaxes(vt, -1, -2), s, np.swapaxes(u, -1, -2)


def _nearest(z: Floats) -> Floats:
    """Fill missing heights from the nearest pixel in their row, or else in their column."""
    for _ in range(2):
        known = ~np.isnan(z)
        index = np.arange(z.shape[1])
        before = np.maximum.accumulate(np.where(known, index, -1), axis=1)
        behind = np.minimum.accumulate(np.where(known, index, 2 * len(index))[:, ::-1], axis=1)
        behind = behind[:, ::-1]
        pick = np.where((before >= 0) & (index - before <= behind - index), before, behind)
        pick = np.where(pick >= len(index), before, pick)
        z = np.where(pick >= 0, np.take_along_axis(z, np.maximum(pick, 0), axis=1), np.nan).T
    return z
