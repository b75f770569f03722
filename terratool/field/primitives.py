"""Where edges stand, and what a primitive is worth at a point of its cell. The edge rule is here.

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

from terratool.field.types import COMBINE, STEPPED

EDGE = 1e-9
"""Turned rectangles and discs are closed: this far outside still counts, in sides of the cell and
radii of the disc. Positions within a grid are also trusted only this far from an edge."""

STEP = 1e-12
"""In turned elements a vertical step begins this much before its t."""

PRODUCT, SUM, MIN, MAX, RADIAL = (COMBINE[name] for name in COMBINE)

# Unsigned indices need no test for counting from the end.
ONE, TWO, THREE, FOUR = (np.uint64(n) for n in range(1, 5))


# `_nrt=False`: the kernels make no arrays of their own, so counting references to those they are
# given is waste; without it the descent spends nine tenths of its time there.
kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
device = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)


# A curve's value decides about no edge, so a product and a sum in it may become one instruction.
fused = device


@device
def edge(corner, rest, pitch, pitch_rest, k):
    """World position of edge `k` of a grid as an unevaluated sum of two doubles."""
    step = k * pitch  # exact: pitch has 36 bits, k at most 17
    high = corner + step
    back = high - corner
    low = ((corner - (high - back)) + (step - back)) + rest + k * pitch_rest
    total = high + low
    return total, low - (total - high)


@device
def sure(grid, in_x, in_y):
    """Whether a place in a cell is far enough from its edges for its coordinates to be trusted."""
    return abs(in_x - 0.5) <= grid.clear_x and abs(in_y - 0.5) <= grid.clear_y


@kernel
def settle(x, corner, rest, per, count, near, pitch, pitch_rest, local, from_above):
    """Cell of a grid that holds `x`, and the position in it, where an edge's double decides.

    `from_above` is the position in the block of the element that the grid divides.
    """
    if local:
        s = from_above * count
        cell = math.floor(s)
    else:
        s = ((x - corner) - rest) * per
        cell = math.floor(s)
        if s - cell < near or s - cell > 1.0 - near:
            k = math.floor(s + 0.5)
            at, _ = edge(corner, rest, pitch, pitch_rest, k)
            cell = k if x >= at else k - 1.0
            if x == at and abs(s - k) < EDGE:
                s = k
    cell = min(max(cell, 0.0), count - 1.0)
    return int(cell), min(max(s - cell, 0.0), 1.0)


@kernel
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


@fused
def piece_value(pieces, row, s):
    """Value of the piece whose coefficients begin at `row`, at `s` in it."""
    c1, c2, c3 = pieces[row + ONE], pieces[row + TWO], pieces[row + THREE]
    return pieces[row] + s * (c1 + s * (c2 + s * c3))


@device
def piece_slope(pieces, row, s):
    """Slope of the piece whose coefficients begin at `row`, at `s` in it."""
    c1, c2, c3 = pieces[row + ONE], pieces[row + TWO], pieces[row + THREE]
    return c1 + s * (2.0 * c2 + s * (3.0 * c3))


@device
def even_curve(pieces, first, count, t):
    """Value and slope of a curve of evenly spaced pieces at `t`, in [0, 1] or EDGE beyond."""
    s = t * count
    i = int(s)  # `count` from t = 1 on: there is one more piece; 0 also just below t = 0
    s -= i
    row = (np.uint64(first) + np.uint64(i)) * FOUR
    return piece_value(pieces, row, s), piece_slope(pieces, row, s) * count


@device
def find_piece(curves, knot, bin_, last, t):
    """The last piece of a knotted curve that begins at or before `t`."""
    i = np.int64(curves.bins[np.int64(bin_) + min(int(t * (last + 1.0)), np.int64(last))])
    while t >= curves.knots[np.int64(knot) + i + 1]:
        i += 1
    return i


@device
def knotted_piece(curves, first, knot, i, t):
    """Value and slope at `t` of piece `i` of a knotted curve."""
    row = (np.uint64(first) + np.uint64(i)) * FOUR
    s = t - curves.knots[np.int64(knot) + i]
    return piece_value(curves.pieces, row, s), piece_slope(curves.pieces, row, s)


@kernel
def knotted_curve(curves, knotted, first, knot, bin_, last, t):
    """Value and slope of a knotted curve at `t`, where no edge in the world decides about steps."""
    ahead = STEP if knotted == STEPPED else 0.0
    i = find_piece(curves, knot, bin_, last, min(t + ahead, 1.0))
    return knotted_piece(curves, first, knot, i, max(t, curves.knots[np.int64(knot) + i]))


@device
def placed_piece(
    curves, knot, bin_, last, t, x, corner, rest, near, pitch, pitch_rest, cell, width
):  # fmt: skip
    """The piece of a curve with steps of an unturned element at `t`, at `x` in the world."""
    knots = curves.knots
    i = find_piece(curves, knot, bin_, last, t)
    begin = np.int64(knot)
    here = begin + i
    while knots[here + 1] - t < near and reaches(
        x, corner, rest, pitch, pitch_rest, cell, width, knots[here + 1]
    ):
        here += 1
    while (
        here > begin
        and t - knots[here] < near
        and not reaches(x, corner, rest, pitch, pitch_rest, cell, width, knots[here])
    ):
        here -= 1
    return here - begin


@kernel
def placed_curve(
    curves, first, knot, bin_, last, t, x, corner, rest, near, pitch, pitch_rest, cell, width
):
    """Value and slope of a curve with steps of an unturned element at `t`, at `x` in the world."""
    i = placed_piece(
        curves, knot, bin_, last, t, x, corner, rest, near, pitch, pitch_rest, cell, width
    )
    here = np.int64(knot) + i
    return knotted_piece(
        curves, first, knot, i, min(max(t, curves.knots[here]), curves.knots[here + 1])
    )


@device
def combine(how, fx, fx_slope, fy, fy_slope):
    """Value of two curves combined, and its slopes in u and v."""
    if how == PRODUCT:
        return fx * fy, fx_slope * fy, fx * fy_slope
    if how == SUM:
        return fx + fy, fx_slope, fy_slope
    if (fx <= fy) == (how == MIN):
        return fx, fx_slope, 0.0
    return fy, 0.0, fy_slope


@device
def any_curves(curves, kind, u, v):
    """Values and slopes of both curves of a kind, where no edge in the world decides."""
    if kind.knotted_x:
        fx, fx_slope = knotted_curve(
            curves, kind.knotted_x, kind.x_first, kind.x_knot, kind.x_bin, kind.x_last, u
        )
    else:
        fx, fx_slope = even_curve(curves.pieces, kind.x_first, kind.x_count, u)
    if kind.knotted_y:
        fy, fy_slope = knotted_curve(
            curves, kind.knotted_y, kind.y_first, kind.y_knot, kind.y_bin, kind.y_last, v
        )
    else:
        fy, fy_slope = even_curve(curves.pieces, kind.y_first, kind.y_count, v)
    return fx, fx_slope, fy, fy_slope


@kernel
def placed_curves(curves, kind, element, grid, width, height, u, v, x, y):
    """Values and slopes of both curves of an unturned element at (x, y) in the world."""
    fx, fx_slope, fy, fy_slope = any_curves(curves, kind, u, v)
    if kind.knotted_x == STEPPED:
        fx, fx_slope = placed_curve(
            curves, kind.x_first, kind.x_knot, kind.x_bin, kind.x_last, u, x, grid.x, grid.x_rest,
            grid.near_x, grid.pitch_x, grid.pitch_x_rest, float(element.cell_x), width,
        )  # fmt: skip
    if kind.knotted_y == STEPPED:
        fy, fy_slope = placed_curve(
            curves, kind.y_first, kind.y_knot, kind.y_bin, kind.y_last, v, y, grid.y, grid.y_rest,
            grid.near_y, grid.pitch_y, grid.pitch_y_rest, float(element.cell_y), height,
        )  # fmt: skip
    return fx, fx_slope, fy, fy_slope


@device
def radius(u, v):
    """Distance of (u, v) from the middle of the disc, in radii."""
    return math.sqrt((2.0 * u - 1.0) ** 2 + (2.0 * v - 1.0) ** 2)


@kernel
def radial(curves, kind, u, v):
    """Whether (u, v) lies in the disc, and value and slopes there of the turned curve."""
    rho = radius(u, v)
    if rho > 1.0 + EDGE:
        return False, 0.0, 0.0, 0.0
    t = min(0.5 + 0.5 * rho, 1.0)
    value, slope, _, _ = any_curves(curves, kind, t, t)
    slope = slope / rho if rho > 0.0 else 0.0
    return True, value, slope * (2.0 * u - 1.0), slope * (2.0 * v - 1.0)


@device
def turned(pose, u, v):
    """Position in the turned rectangle of a point at (u, v) of the cell."""
    a, b = u - 0.5, v - 0.5
    return (
        0.5 + (a * pose.cos - b * pose.sin_v),
        0.5 + (a * pose.sin_u + b * pose.cos),
    )


@device
def turned_slopes(pose, du, dv):
    """Slopes along the sides of the cell from those along the sides of the turned rectangle."""
    return du * pose.cos + dv * pose.sin_u, dv * pose.cos - du * pose.sin_v


@device
def beyond(u, v):
    """Whether a point lies outside of the rectangle, which is closed."""
    return max(abs(u - 0.5), abs(v - 0.5)) > 0.5 + EDGE


@kernel
def special(curves, kind, element, pose, grid, u, v, x, y):
    """Whether a footprint holds (u, v), and value and slopes there, for any kind of primitive."""
    if kind.combine == RADIAL:
        return radial(curves, kind, u, v)
    if pose.turned:
        if beyond(u, v):
            return False, 0.0, 0.0, 0.0
        fx, fx_slope, fy, fy_slope = any_curves(
            curves, kind, min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        )
    else:
        fx, fx_slope, fy, fy_slope = placed_curves(
            curves, kind, element, grid, pose.width, pose.height, u, v, x, y
        )
    value, du, dv = combine(kind.combine, fx, fx_slope, fy, fy_slope)
    return True, value, du, dv
