"""The descent: which elements hold a point, and what they add up to. The one edge rule is here.

A cell's edge stands at the double nearest to its exact position, so a coordinate that is typed as
the edge's decimal number lies on it. The same goes for a vertical step in a curve of an unturned
element. Positions within a grid are measured from its own corner, kept to 106 bits, so that neither
large coordinates nor deep nesting cost accuracy; grids finer than doubles go on from the position
in their parent's cell.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

EDGE = 1e-9
"""Turned rectangles and discs are closed: this far outside, in sides of the cell, still counts."""

STEP = 1e-12
"""In turned elements a vertical step begins this much before its t."""

_device = njit(cache=True, nogil=True, forceinline=True, error_model="numpy")
_kernel = njit(cache=True, nogil=True, error_model="numpy")


@_device
def edge(corner, rest, pitch, pitch_rest, k):
    """World position of edge `k` of a grid as an unevaluated sum of two doubles."""
    step = k * pitch  # exact: pitch has 36 bits, k at most 17
    high = corner + step
    back = high - corner
    low = ((corner - (high - back)) + (step - back)) + rest + k * pitch_rest
    total = high + low
    return total, low - (total - high)


@_device
def place(x, corner, rest, per, count, near, pitch, pitch_rest):
    """Position of `x` in cells of a grid, and the cell that holds it."""
    s = ((x - corner) - rest) * per
    cell = math.floor(s)
    if s - cell < near or s - cell > 1.0 - near:
        k = math.floor(s + 0.5)
        at, _ = edge(corner, rest, pitch, pitch_rest, k)
        cell = k if x >= at else k - 1.0
        if x == at:
            s = k
    return s, int(min(max(cell, 0.0), count - 1.0))


@njit(cache=True, nogil=True, error_model="numpy")
def reaches(x, corner, rest, pitch, pitch_rest, cell, width, t):
    """Whether `x` has reached the double nearest to `t` of the block that begins at `cell`."""
    high, low = edge(corner, rest, pitch, pitch_rest, cell)
    side = width * pitch
    product = t * side
    # the rounding error of the product, by Dekker's splitting
    big = 134217729.0
    t_high = t * big - (t * big - t)
    side_high = side * big - (side * big - side)
    t_low, side_low = t - t_high, side - side_high
    error = t_low * side_low - (
        ((product - t_high * side_high) - t_low * side_high) - t_high * side_low
    )
    total = high + product
    back = total - high
    low += ((high - (total - back)) + (product - back)) + error + t * (width * pitch_rest)
    return x >= total + low


@_device
def even_curve(pieces, curve, t):
    """Value and slope of a curve of evenly spaced pieces at `t` in [0, 1]."""
    s = t * curve.count
    i = min(int(s), int(curve.count) - 1)
    s -= i
    row = curve.first + i
    c1, c2, c3 = pieces[row, 1], pieces[row, 2], pieces[row, 3]
    value = pieces[row, 0] + s * (c1 + s * (c2 + s * c3))
    return value, (c1 + s * (2.0 * c2 + s * (3.0 * c3))) * curve.count


@_device
def find_piece(knots, bins, curve, t):
    """The last piece of a knotted curve that begins at or before `t`."""
    count = int(curve.count)
    i = np.int64(bins[curve.bins + min(int(t * curve.count), count - 1)])
    while t >= knots[curve.knots + i + 1]:
        i += 1
    return i


@_device
def knotted_piece(pieces, knots, curve, i, t):
    """Value and slope at `t` of piece `i` of a knotted curve."""
    row = curve.first + i
    s = t - knots[curve.knots + i]
    c1, c2, c3 = pieces[row, 1], pieces[row, 2], pieces[row, 3]
    return pieces[row, 0] + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + s * (3.0 * c3))


@_device
def turned_curve(pieces, knots, bins, curve, t):
    """Value and slope of any curve at `t`, where no edge in the world decides about steps."""
    if curve.bins < 0:
        return even_curve(pieces, curve, t)
    i = find_piece(knots, bins, curve, min(t + STEP, 1.0))
    return knotted_piece(pieces, knots, curve, i, max(t, knots[curve.knots + i]))


@_device
def placed_curve(
    pieces, knots, bins, curve, t, x, corner, rest, near, pitch, pitch_rest, cell, width
):
    """Value and slope of any curve of an unturned element at `t`, which is at `x` in the world."""
    if curve.bins < 0:
        return even_curve(pieces, curve, t)
    i = find_piece(knots, bins, curve, t)
    here = curve.knots + i
    while knots[here + 1] - t < near and reaches(
        x, corner, rest, pitch, pitch_rest, cell, width, knots[here + 1]
    ):
        here += 1
    while (
        here > curve.knots
        and t - knots[here] < near
        and not reaches(x, corner, rest, pitch, pitch_rest, cell, width, knots[here])
    ):
        here -= 1
    i = here - curve.knots
    return knotted_piece(pieces, knots, curve, i, min(max(t, knots[here]), knots[here + 1]))


@_device
def combine(how, fx, fx_slope, fy, fy_slope):
    """Value of two curves combined, and its slopes in u and v."""
    if how == 0:
        return fx * fy, fx_slope * fy, fx * fy_slope
    if how == 1:
        return fx + fy, fx_slope, fy_slope
    if (fx <= fy) == (how == 2):
        return fx, fx_slope, 0.0
    return fy, 0.0, fy_slope


@_device
def descend(field, x, y, stack, sloped):
    """Height, winning element (-1 for none) and gradient at a point inside the bounds.

    `stack` is (pending, 3) scratch; the gradient is computed only where `sloped` holds. No height
    is NaN here: what is void is for the caller to see from the winner.
    """
    elements, grids, offsets, entries = field.elements, field.grids, field.offsets, field.entries
    curves, pieces, knots, bins = field.curves, field.pieces, field.knots, field.bins
    z = 0.0
    slope_x = 0.0
    slope_y = 0.0
    winner = np.int64(-1)
    pending = 0
    g = np.int64(0)
    from_x = 0.0
    from_y = 0.0
    while True:
        grid = grids[g]
        if grid.local == 0:
            sx, i = place(
                x, grid.x, grid.x_rest, grid.per_x, grid.nx, grid.near_x,
                grid.pitch_x, grid.pitch_x_rest,
            )  # fmt: skip
            sy, j = place(
                y, grid.y, grid.y_rest, grid.per_y, grid.ny, grid.near_y,
                grid.pitch_y, grid.pitch_y_rest,
            )  # fmt: skip
        else:
            sx = from_x * grid.nx
            sy = from_y * grid.ny
            i = int(min(math.floor(sx), grid.nx - 1.0))
            j = int(min(math.floor(sy), grid.ny - 1.0))
        slot = grid.table + (j >> grid.shift_y) * np.int64(grid.bins_x) + (i >> grid.shift_x)
        listed = grid.listed
        for k in range(np.int64(offsets[slot]), np.int64(offsets[slot + 1])):
            index = np.int64(entries[k]) if listed else k
            element = elements[index]
            cell_x = np.int64(element.cell_x)
            cell_y = np.int64(element.cell_y)
            width = 1.0
            height = 1.0
            turned = False
            if element.pose == 0:
                if i != cell_x or j != cell_y:
                    continue
            else:
                pose = field.poses[element.pose]
                if not (
                    cell_x <= i < cell_x + pose.cells_x and cell_y <= j < cell_y + pose.cells_y
                ):
                    continue
                width = pose.width
                height = pose.height
                turned = pose.turned != 0
            cell_u = min(max((sx - cell_x) / width, 0.0), 1.0)
            cell_v = min(max((sy - cell_y) / height, 0.0), 1.0)
            if element.grid:
                stack[pending, 0] = element.grid
                stack[pending, 1] = cell_u
                stack[pending, 2] = cell_v
                pending += 1
            u = cell_u
            v = cell_v
            if turned:
                pose = field.poses[element.pose]
                u = 0.5 + (cell_u - 0.5) * pose.cos - (cell_v - 0.5) * pose.sin_v
                v = 0.5 + (cell_u - 0.5) * pose.sin_u + (cell_v - 0.5) * pose.cos
            kind = field.kinds[element.kind]
            if kind.combine == 4:
                rho = math.sqrt((2.0 * u - 1.0) ** 2 + (2.0 * v - 1.0) ** 2)
                if rho > 1.0 + EDGE:
                    continue
                t = min(0.5 + 0.5 * rho, 1.0)
                value, fx_slope = turned_curve(pieces, knots, bins, curves[kind.x], t)
                if sloped:
                    slope = fx_slope / rho if rho > 0.0 else 0.0
                    du = slope * (2.0 * u - 1.0)
                    dv = slope * (2.0 * v - 1.0)
            elif turned:
                if min(u, v) < -EDGE or max(u, v) > 1.0 + EDGE:
                    continue
                u = min(max(u, 0.0), 1.0)
                v = min(max(v, 0.0), 1.0)
                fx, fx_slope = turned_curve(pieces, knots, bins, curves[kind.x], u)
                fy, fy_slope = turned_curve(pieces, knots, bins, curves[kind.y], v)
                value, du, dv = combine(kind.combine, fx, fx_slope, fy, fy_slope)
            else:
                fx, fx_slope = placed_curve(
                    pieces, knots, bins, curves[kind.x], u, x, grid.x, grid.x_rest, grid.near_x,
                    grid.pitch_x, grid.pitch_x_rest, np.float64(cell_x), width,
                )  # fmt: skip
                fy, fy_slope = placed_curve(
                    pieces, knots, bins, curves[kind.y], v, y, grid.y, grid.y_rest, grid.near_y,
                    grid.pitch_y, grid.pitch_y_rest, np.float64(cell_y), height,
                )  # fmt: skip
                value, du, dv = combine(kind.combine, fx, fx_slope, fy, fy_slope)
            z += element.scale * value + element.offset
            winner = max(winner, index)
            if sloped:
                if turned:
                    pose = field.poses[element.pose]
                    du, dv = du * pose.cos + dv * pose.sin_u, dv * pose.cos - du * pose.sin_v
                slope_x += element.scale * du * (grid.per_x / width)
                slope_y += element.scale * dv * (grid.per_y / height)
        if pending == 0:
            break
        pending -= 1
        g = np.int64(stack[pending, 0])
        from_x = stack[pending, 1]
        from_y = stack[pending, 2]
    return z, winner, slope_x, slope_y


@_device
def inside(bounds, x, y):
    """Whether a point is on the terrain, its edges included."""
    return bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]


@_device
def height_at(field, x, y, stack):
    """Height at a point; NaN outside and in the void."""
    if not inside(field.bounds, x, y):
        return np.nan
    z, winner, _, _ = descend(field, x, y, stack, False)
    if winner >= 0 and field.void[field.kinds[field.elements[winner].kind].surface]:
        return np.nan
    return z


@_kernel
def heights(field, x, y, out):
    """Heights at points: `x`, `y`, `out` are (n,) float64."""
    stack = np.empty((field.pending, 3))
    for n in range(len(x)):
        out[n] = height_at(field, x[n], y[n], stack)


@_kernel
def grid_heights(field, x, y, out):
    """Heights at the crossings of columns `x` (n,) and rows `y` (m,) into `out` (m, n)."""
    stack = np.empty((field.pending, 3))
    for row in range(len(y)):
        for column in range(len(x)):
            out[row, column] = height_at(field, x[column], y[row], stack)


@_kernel
def samples(field, x, y, height, winners, gradient):
    """Everything at points: `height` (n,), `winners` (n,) int64, `gradient` (n, 2).

    The winner is the index of the element that decides the surface: -1 where there is none, -2
    outside. Height and gradient are NaN outside and in the void.
    """
    stack = np.empty((field.pending, 3))
    for n in range(len(x)):
        height[n] = np.nan
        gradient[n, 0] = np.nan
        gradient[n, 1] = np.nan
        winners[n] = -2
        if inside(field.bounds, x[n], y[n]):
            z, winner, slope_x, slope_y = descend(field, x[n], y[n], stack, True)
            winners[n] = winner
            if winner < 0 or not field.void[field.kinds[field.elements[winner].kind].surface]:
                height[n] = z
                gradient[n, 0] = slope_x
                gradient[n, 1] = slope_y
