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

from terratool.field.types import COMBINE, STEPPED

EDGE = 1e-9
"""Turned rectangles and discs are closed: this far outside still counts, in sides of the cell and
radii of the disc. Positions within a grid are also trusted only this far from an edge."""

STEP = 1e-12
"""In turned elements a vertical step begins this much before its t."""

PRODUCT, SUM, MIN, MAX, RADIAL = (COMBINE[name] for name in COMBINE)

# Unsigned indices need no test for counting from the end.
ONE, TWO, THREE, FOUR = (np.uint64(n) for n in range(1, 5))

NEAR_AN_EDGE = np.uint64(2**32 - 1)

# `_nrt=False`: the kernels make no arrays of their own, so counting references to those they are
# given is waste; without it the descent spends nine tenths of its time there.
_kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
_device = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)


# A curve's value decides about no edge, so a product and a sum in it may become one instruction.
_fused = njit(
    cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True,
    fastmath={"contract"},
)  # fmt: skip


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
def sure(grid, in_x, in_y):
    """Whether a place in a cell is far enough from its edges for its coordinates to be trusted."""
    return abs(in_x - 0.5) <= grid.sure_x and abs(in_y - 0.5) <= grid.sure_y


@_kernel
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


@_kernel
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


@_fused
def piece_value(pieces, row, s):
    """Value of the piece whose coefficients begin at `row`, at `s` in it."""
    c1, c2, c3 = pieces[row + ONE], pieces[row + TWO], pieces[row + THREE]
    return pieces[row] + s * (c1 + s * (c2 + s * c3))


@_device
def piece_slope(pieces, row, s):
    """Slope of the piece whose coefficients begin at `row`, at `s` in it."""
    c1, c2, c3 = pieces[row + ONE], pieces[row + TWO], pieces[row + THREE]
    return c1 + s * (2.0 * c2 + s * (3.0 * c3))


@_device
def even_curve(pieces, first, count, t):
    """Value and slope of a curve of evenly spaced pieces at `t`, in [0, 1] or EDGE beyond."""
    s = t * count
    i = int(s)  # `count` from t = 1 on: there is one more piece; 0 also just below t = 0
    s -= i
    row = (np.uint64(first) + np.uint64(i)) * FOUR
    return piece_value(pieces, row, s), piece_slope(pieces, row, s) * count


@_device
def find_piece(curves, knot, bin_, last, t):
    """The last piece of a knotted curve that begins at or before `t`."""
    i = np.int64(curves.bins[np.int64(bin_) + min(int(t * (last + 1.0)), np.int64(last))])
    while t >= curves.knots[np.int64(knot) + i + 1]:
        i += 1
    return i


@_device
def knotted_piece(curves, first, knot, i, t):
    """Value and slope at `t` of piece `i` of a knotted curve."""
    row = (np.uint64(first) + np.uint64(i)) * FOUR
    s = t - curves.knots[np.int64(knot) + i]
    return piece_value(curves.pieces, row, s), piece_slope(curves.pieces, row, s)


@_kernel
def knotted_curve(curves, knotted, first, knot, bin_, last, t):
    """Value and slope of a knotted curve at `t`, where no edge in the world decides about steps."""
    ahead = STEP if knotted == STEPPED else 0.0
    i = find_piece(curves, knot, bin_, last, min(t + ahead, 1.0))
    return knotted_piece(curves, first, knot, i, max(t, curves.knots[np.int64(knot) + i]))


@_kernel
def placed_curve(
    curves, first, knot, bin_, last, t, x, corner, rest, near, pitch, pitch_rest, cell, width
):
    """Value and slope of a curve with steps of an unturned element at `t`, at `x` in the world."""
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
    return knotted_piece(
        curves, first, knot, here - begin, min(max(t, knots[here]), knots[here + 1])
    )


@_device
def combine(how, fx, fx_slope, fy, fy_slope):
    """Value of two curves combined, and its slopes in u and v."""
    if how == PRODUCT:
        return fx * fy, fx_slope * fy, fx * fy_slope
    if how == SUM:
        return fx + fy, fx_slope, fy_slope
    if (fx <= fy) == (how == MIN):
        return fx, fx_slope, 0.0
    return fy, 0.0, fy_slope


@_device
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


@_kernel
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


@_kernel
def radial(curves, kind, u, v):
    """Whether (u, v) lies in the disc, and value and slopes there of the turned curve."""
    rho = math.sqrt((2.0 * u - 1.0) ** 2 + (2.0 * v - 1.0) ** 2)
    if rho > 1.0 + EDGE:
        return False, 0.0, 0.0, 0.0
    t = min(0.5 + 0.5 * rho, 1.0)
    value, slope, _, _ = any_curves(curves, kind, t, t)
    slope = slope / rho if rho > 0.0 else 0.0
    return True, value, slope * (2.0 * u - 1.0), slope * (2.0 * v - 1.0)


@_kernel
def special(curves, kind, element, pose, grid, u, v, x, y):
    """Whether a footprint holds (u, v), and value and slopes there, for any kind of primitive."""
    if kind.combine == RADIAL:
        return radial(curves, kind, u, v)
    if pose.turned:
        if max(abs(u - 0.5), abs(v - 0.5)) > 0.5 + EDGE:
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


@_device
def add_leaves(field, begin, end, in_x, in_y, sloped, z, slope_x, slope_y, winner):
    """Add the elements of a bin that have no grid and nothing special, each as wide as the cell.

    Height, slopes in cells, and the winner go in and come out.
    """
    for k in range(begin, end):
        element = field.elements[k]
        kind = field.kinds[element.kind]
        pose = field.poses[element.pose]
        # turned by nothing for most; that is quicker than to guess which ones are
        u = 0.5 + ((in_x - 0.5) * pose.cos - (in_y - 0.5) * pose.sin_v)
        v = 0.5 + ((in_x - 0.5) * pose.sin_u + (in_y - 0.5) * pose.cos)
        if max(abs(u - 0.5), abs(v - 0.5)) > 0.5 + EDGE:
            continue
        fx, fx_slope = even_curve(field.curves.pieces, kind.x_first, kind.x_count, u)
        fy, fy_slope = even_curve(field.curves.pieces, kind.y_first, kind.y_count, v)
        z += element.scale * (fx * fy) + element.offset
        winner = np.int64(k)
        if sloped:
            du, dv = fx_slope * fy, fx * fy_slope
            slope_x += element.scale * (du * pose.cos + dv * pose.sin_u)
            slope_y += element.scale * (dv * pose.cos - du * pose.sin_v)
    return z, slope_x, slope_y, winner


@_device
def void_at(field, winner):
    """Whether the surface of the winning element is void."""
    return (
        field.voids
        and winner >= 0
        and field.kinds[field.elements[np.uint64(winner)].kind].void != 0
    )


@_device
def descend(field, x, y, stack, sloped, started, z, i, j, in_x, in_y):
    """Height, winning element (-1 for none) and gradient at a point inside the bounds.

    `stack` is (pending, 3) scratch; the gradient is computed only where `sloped` holds. A descent
    that has `started` has the root's height in `z`, and the place in the root's grid.
    """
    grids, curves = field.grids, field.curves
    slope_x = 0.0
    slope_y = 0.0
    winner = np.int64(0) if started else np.int64(-1)
    pending = 0
    g = np.uint64(1) if started else np.uint64(0)
    from_x = 0.0
    from_y = 0.0
    while True:
        grid = grids[g]
        if started:
            started = False
        else:
            # the usual case: far enough from any edge of a cell
            sx = ((x - grid.x) - grid.x_rest) * grid.per_x
            sy = ((y - grid.y) - grid.y_rest) * grid.per_y
            i = int(sx)
            j = int(sy)
            in_x = sx - i
            in_y = sy - j
        if not sure(grid, in_x, in_y):
            i, in_x = settle(
                x, grid.x, grid.x_rest, grid.per_x, grid.nx, grid.near_x,
                grid.pitch_x, grid.pitch_x_rest, grid.local, from_x,
            )  # fmt: skip
            j, in_y = settle(
                y, grid.y, grid.y_rest, grid.per_y, grid.ny, grid.near_y,
                grid.pitch_y, grid.pitch_y_rest, grid.local, from_y,
            )  # fmt: skip
        slot = np.uint64(
            grid.table + (j >> grid.shift_y) * np.int64(grid.bins_x) + (i >> grid.shift_x)
        )
        descended = np.uint64(0)
        begin, end = np.uint64(field.offsets[slot]), np.uint64(field.offsets[slot + ONE])
        if grid.leaves:
            z, along_x, along_y, last = add_leaves(
                field, begin, end, in_x, in_y, sloped, z, 0.0, 0.0, np.int64(-1)
            )
            winner = max(winner, last)
            if sloped:
                slope_x += along_x * grid.per_x
                slope_y += along_y * grid.per_y
            begin = end
        for k in range(begin, end):
            index = np.uint64(field.entries[k]) if grid.listed else k
            element = field.elements[index]
            kind = field.kinds[element.kind]
            pose = field.poses[element.pose]
            u = in_x
            v = in_y
            if grid.listed:
                right = i - np.int64(element.cell_x)
                above = j - np.int64(element.cell_y)
                if right < 0 or above < 0 or right >= pose.cells_x or above >= pose.cells_y:
                    continue
                u = min((right + in_x) / pose.width, 1.0)
                v = min((above + in_y) / pose.height, 1.0)
            if element.grid:
                if descended:
                    stack[pending, 0] = descended
                    stack[pending, 1] = from_x
                    stack[pending, 2] = from_y
                    pending += 1
                descended = np.uint64(element.grid)
                from_x = u
                from_y = v
            if pose.turned:
                middle_u, middle_v = u - 0.5, v - 0.5
                u = 0.5 + (middle_u * pose.cos - middle_v * pose.sin_v)
                v = 0.5 + (middle_u * pose.sin_u + middle_v * pose.cos)
            if kind.special:
                held, value, du, dv = special(curves, kind, element, pose, grid, u, v, x, y)
                if not held:
                    continue
            else:
                if max(abs(u - 0.5), abs(v - 0.5)) > 0.5 + EDGE:
                    continue
                fx, fx_slope = even_curve(curves.pieces, kind.x_first, kind.x_count, u)
                fy, fy_slope = even_curve(curves.pieces, kind.y_first, kind.y_count, v)
                value, du, dv = fx * fy, fx_slope * fy, fx * fy_slope
            z += element.scale * value + element.offset
            winner = max(winner, np.int64(index))
            if sloped:
                along_u = du * pose.cos + dv * pose.sin_u
                along_v = dv * pose.cos - du * pose.sin_v
                slope_x += element.scale * along_u * (grid.per_x / pose.width)
                slope_y += element.scale * along_v * (grid.per_y / pose.height)
        if descended:
            g = descended
        elif pending:
            pending -= 1
            g = np.uint64(stack[pending, 0])
            from_x = stack[pending, 1]
            from_y = stack[pending, 2]
        else:
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
    z, winner, _, _ = descend(field, x, y, stack, False, False, 0.0, 0, 0, 0.0, 0.0)
    return np.nan if void_at(field, winner) else z


@_kernel
def positions(x, corner, rest, per, whole, part):
    """Positions along one axis of a grid, in whole cells and parts of them; vectorised."""
    for n in range(len(x)):
        s = ((x[n] - corner) - rest) * per
        whole[n] = math.floor(s)
        part[n] = s - math.floor(s)


@_kernel
def even_values(pieces, first, count, t, whole, out):
    """Values of a curve of evenly spaced pieces at each `t`, held to [0, 1]; `whole` is scratch."""
    row = np.uint64(first) * FOUR
    if count == 1.0 and pieces[row + ONE] == pieces[row + TWO] == pieces[row + THREE] == 0.0:
        out[:] = pieces[row]
        return
    for n in range(len(t)):  # vectorised
        s = min(max(t[n], 0.0), 1.0) * count
        whole[n] = math.floor(s)
        out[n] = s - math.floor(s)
    for n in range(len(t)):
        out[n] = piece_value(pieces, (np.uint64(first) + np.uint64(int(whole[n]))) * FOUR, out[n])


@_kernel
def block_heights(field, x, y, scratch, out):
    """Heights at a block of points; the root, which they share, is evaluated for all at once."""
    count = len(x)
    stack, work, bins = scratch
    u, v, z, cell_x, in_x, cell_y, in_y = (
        work[0, :count], work[1, :count], work[2, :count], work[3, :count], work[4, :count],
        work[5, :count], work[6, :count],
    )  # fmt: skip
    ground, grid = field.grids[0], field.grids[1]
    root = field.elements[0]
    kind = field.kinds[root.kind]
    positions(x, ground.x, ground.x_rest, ground.per_x, cell_x, u)
    positions(y, ground.y, ground.y_rest, ground.per_y, cell_y, v)
    even_values(field.curves.pieces, kind.x_first, kind.x_count, u, in_y, z)
    even_values(field.curves.pieces, kind.y_first, kind.y_count, v, in_y, in_x)
    for n in range(count):
        z[n] = root.scale * (z[n] * in_x[n]) + root.offset
        # outside and at the edges, u is made to fail the test below
        if cell_x[n] != 0.0 or cell_y[n] != 0.0:
            u[n] = 1.0
    positions(x, grid.x, grid.x_rest, grid.per_x, cell_x, in_x)
    positions(y, grid.y, grid.y_rest, grid.per_y, cell_y, in_y)
    if not grid.leaves:
        for n in range(count):
            if sure(ground, u[n], v[n]):
                out[n], winner, _, _ = descend(
                    field, x[n], y[n], stack, False, True, z[n], int(cell_x[n]), int(cell_y[n]),
                    in_x[n], in_y[n],
                )  # fmt: skip
                if void_at(field, winner):
                    out[n] = np.nan
            else:
                out[n] = height_at(field, x[n], y[n], stack)
        return
    # first where the elements of each point are, then what they are: neither waits for the other
    for n in range(count):
        bins[n, 0] = bins[n, 1] = 0
        if sure(ground, u[n], v[n]) and sure(grid, in_x[n], in_y[n]):
            slot = np.uint64(grid.table + int(cell_y[n]) * np.int64(grid.bins_x) + int(cell_x[n]))
            bins[n, 0] = field.offsets[slot]
            bins[n, 1] = field.offsets[slot + ONE]
        else:
            bins[n, 0] = NEAR_AN_EDGE
    for n in range(count):
        begin, end = np.uint64(bins[n, 0]), np.uint64(bins[n, 1])
        if begin == NEAR_AN_EDGE:
            out[n] = height_at(field, x[n], y[n], stack)
            continue
        out[n], _, _, winner = add_leaves(
            field, begin, end, in_x[n], in_y[n], False, z[n], 0.0, 0.0, np.int64(0)
        )
        if void_at(field, winner):
            out[n] = np.nan


@_kernel
def heights(field, x, y, scratch, out):
    """Heights at points: `x`, `y`, `out` are (n,) float64; the rest is scratch."""
    root = field.elements[0]
    if root.grid and not root.pose and not field.kinds[root.kind].special:
        size = scratch.work.shape[1]
        for begin in range(0, len(x), size):
            end = min(begin + size, len(x))
            block_heights(field, x[begin:end], y[begin:end], scratch, out[begin:end])
    else:
        for n in range(len(x)):
            out[n] = height_at(field, x[n], y[n], scratch.stack)


@_kernel
def grid_heights(field, x, y, scratch, out):
    """Heights at the crossings of columns `x` (n,) and rows `y` (m,) into `out` (m, n)."""
    for row in range(len(y)):
        for column in range(len(x)):
            out[row, column] = height_at(field, x[column], y[row], scratch.stack)


@_kernel
def samples(field, x, y, scratch, height, winners, gradient):
    """Everything at points: `height` (n,), `winners` (n,) int64, `gradient` (n, 2).

    The winner is the index of the element that decides the surface: -1 where there is none, -2
    outside. Height and gradient are NaN outside and in the void.
    """
    for n in range(len(x)):
        height[n] = np.nan
        gradient[n, 0] = np.nan
        gradient[n, 1] = np.nan
        winners[n] = -2
        if inside(field.bounds, x[n], y[n]):
            z, winner, slope_x, slope_y = descend(
                field, x[n], y[n], scratch.stack, True, False, 0.0, 0, 0, 0.0, 0.0
            )
            winners[n] = winner
            if not void_at(field, winner):
                height[n] = z
                gradient[n, 0] = slope_x
                gradient[n, 1] = slope_y
