"""Kernels on sums of products of two piecewise linear curves: values, normal equations, misfits.

A model of K terms is `offset` + Σₖ xₖ(u) · yₖ(v), or `offset` + x(u) + y(v) if `summed`. The values
of xₖ and yₖ at their nodes are rows of (K, p) and (K, q) arrays; nodes ascend from 0 to 1, two
equal ones are a step, a single one is a constant. All arrays are float64, indices int64.
"""

from __future__ import annotations

import math

import numpy as np

from terratool.field.primitives import device, kernel


@device
def _interval(nodes, t):
    """The node before t, and how far t lies on the way to the next; right of a step, as queries."""
    last = len(nodes) - 2
    if last < 0:
        return 0, 0.0
    low = min(max(np.searchsorted(nodes, t, "right") - 1, 0), last)
    return low, (t - nodes[low]) / (nodes[low + 1] - nodes[low])


@kernel
def intervals(nodes, t, index, fraction):
    """Write, for each t, the node before it and how far it lies on the way to the next."""
    for n in range(len(t)):
        index[n], fraction[n] = _interval(nodes, t[n])


@device
def _on(values, low, part):
    if part == 0.0:
        return values[low]
    return values[low] + part * (values[low + 1] - values[low])


@device
def _model(x, y, offset, summed, i, f, j, g):
    total = offset
    for k in range(len(x)):
        a, b = _on(x[k], i, f), _on(y[k], j, g)
        total += a + b if summed else a * b
    return total


@kernel
def residuals(i, f, j, g, z, x, y, offset, summed, out):
    """Write z minus the model into `out`, (n,), for points at i + f along u and j + g along v."""
    for n in range(len(z)):
        out[n] = z[n] - _model(x, y, offset, summed, i[n], f[n], j[n], g[n])


@kernel
def normal_equations(i, f, j, g, z, w, x, y, offset, summed, where, slopes, matrix, right):
    """Add up JᵀWJ and JᵀWr of the points; unknowns are x row by row, y row by row, the offset.

    The (n,) points lie at i + f along u and at j + g along v, and have heights z and weights w.
    `where` and `slopes` are scratch, (4 K + 1,) int64 and float64. `matrix` and `right` are (M, M)
    and (M,), M = K (p + q) + 1; only the upper triangle is filled.
    """
    terms, p = x.shape
    q = y.shape[1]
    size = 4 * terms + 1
    matrix[:] = 0.0
    right[:] = 0.0
    where[size - 1] = terms * (p + q)
    slopes[size - 1] = 1.0
    for n in range(len(z)):
        if w[n] <= 0.0:
            continue
        total = offset
        # a single node has no next one, and its slope there is 0
        right_i, right_j = min(i[n] + 1, p - 1), min(j[n] + 1, q - 1)
        for k in range(terms):
            a, b = _on(x[k], i[n], f[n]), _on(y[k], j[n], g[n])
            total += a + b if summed else a * b
            by_x, by_y = (1.0, 1.0) if summed else (b, a)
            at = 4 * k
            where[at], slopes[at] = k * p + i[n], by_x * (1.0 - f[n])
            where[at + 1], slopes[at + 1] = k * p + right_i, by_x * f[n]
            first = terms * p + k * q
            where[at + 2], slopes[at + 2] = first + j[n], by_y * (1.0 - g[n])
            where[at + 3], slopes[at + 3] = first + right_j, by_y * g[n]
        r = z[n] - total
        for a in range(size):
            weighted = w[n] * slopes[a]
            right[where[a]] += weighted * r
            for b in range(size):
                if where[b] >= where[a]:
                    matrix[where[a], where[b]] += weighted * slopes[b]


@kernel
def _misfit(z, row, column, affine, x_nodes, x, y_nodes, y, offset, summed):
    """Height minus the model at a pixel; NaN without a height or beyond the curves."""
    rows, columns = z.shape
    dx, dy = column + 0.5 - 0.5 * columns, row + 0.5 - 0.5 * rows
    u = 0.5 + (affine[0] * dx + affine[1] * dy)
    v = 0.5 + (affine[2] * dx + affine[3] * dy)
    if math.isnan(z[row, column]) or u < 0.0 or u > 1.0 or v < 0.0 or v > 1.0:
        return math.nan
    i, f = _interval(x_nodes, u)
    j, g = _interval(y_nodes, v)
    return z[row, column] - _model(x, y, offset, summed, i, f, j, g)


@kernel
def worst_pixels(z, affine, x_nodes, x, y_nodes, y, offset, summed, block, which, size):
    """Write the pixel with the largest misfit of each block of `block` × `block` pixels.

    `z` are (rows, columns) heights, NaN for none; `affine` (4,) how u and v change: u by column, u
    by row, v by column, v by row. `which` is (rows / block, columns / block) int64 for the index of
    the pixel, -1 for none; `size` the same for its misfit.
    """
    rows, columns = z.shape
    which[:] = -1
    size[:] = -1.0
    for row in range(rows):
        for column in range(columns):
            off = abs(_misfit(z, row, column, affine, x_nodes, x, y_nodes, y, offset, summed))
            if math.isnan(off):
                continue
            at = row // block, column // block
            if off > size[at]:
                size[at] = off
                which[at] = row * columns + column


@kernel
def range_of_misfits(z, affine, x_nodes, x, y_nodes, y, offset, summed):
    """Smallest and largest height minus the model, of all pixels; arguments as `worst_pixels`."""
    rows, columns = z.shape
    low, high = np.inf, -np.inf
    for row in range(rows):
        for column in range(columns):
            off = _misfit(z, row, column, affine, x_nodes, x, y_nodes, y, offset, summed)
            if math.isnan(off):
                continue
            low, high = min(low, off), max(high, off)
    return low, high


@kernel
def solve(matrix, right):
    """Solve a symmetric system by Cholesky's method; `right` becomes the solution.

    Only the upper triangle of `matrix` is read, and overwritten. By rows, as LAPACK's threads take
    longer for systems of this size when other programs run.

    Returns:
        Whether the matrix is positive definite.
    """
    size = len(right)
    for k in range(size):
        if not matrix[k, k] > 0.0:
            return False
        root = math.sqrt(matrix[k, k])
        for n in range(k, size):
            matrix[k, n] /= root
        right[k] /= root
        for i in range(k + 1, size):
            factor = matrix[k, i]
            if factor != 0.0:
                for n in range(i, size):
                    matrix[i, n] -= factor * matrix[k, n]
                right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        for n in range(k + 1, size):
            right[k] -= matrix[k, n] * right[n]
        right[k] /= matrix[k, k]
    return True
