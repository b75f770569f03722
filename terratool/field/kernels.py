"""The descent: which elements hold a point, and what they add up to."""

from __future__ import annotations

import math

import numpy as np

from terratool.field.primitives import (
    FOUR,
    ONE,
    THREE,
    TWO,
    beyond,
    device,
    even_curve,
    kernel,
    piece_value,
    settle,
    special,
    sure,
    turned,
    turned_slopes,
)
from terratool.field.ruts import near_ruts, rut_at

FINISHED = np.uint64(2**32 - 1)
"""In the place of an element: this point is taken care of."""


@device
def add_leaves(field, begin, end, in_x, in_y, sloped, z, slope_x, slope_y, winner):
    """Add the elements of a bin that have no grid and nothing special, each as wide as the cell.

    Height, slopes in cells, and the winner go in and come out.
    """
    for k in range(begin, end):
        element = field.elements[k]
        kind = field.kinds[element.kind]
        pose = field.poses[element.pose]
        # turned by nothing for most; that is quicker than to guess which ones are
        u, v = turned(pose, in_x, in_y)
        if beyond(u, v):
            continue
        fx, fx_slope = even_curve(field.curves.pieces, kind.x_first, kind.x_count, u)
        fy, fy_slope = even_curve(field.curves.pieces, kind.y_first, kind.y_count, v)
        z += element.scale * (fx * fy) + element.offset
        winner = np.int64(k)
        if sloped:
            du, dv = turned_slopes(pose, fx_slope * fy, fx * fy_slope)
            slope_x += element.scale * du
            slope_y += element.scale * dv
    return z, slope_x, slope_y, winner


@device
def void_at(field, winner):
    """Whether the surface of the winning element is void."""
    return (
        field.voids
        and winner >= 0
        and field.kinds[field.elements[np.uint64(winner)].kind].is_void != 0
    )


@device
def surface_of(field, winner):
    """Index of the surface of the winning element, -1 for none."""
    if winner < 0:
        return np.int64(-1)
    return np.int64(field.kinds[field.elements[np.uint64(winner)].kind].surface)


@device
def solid(field, z, winner):
    """The height of the elements, NaN in the void."""
    return np.nan if void_at(field, winner) else z


@device
def lowered(field, z, winner, x, y):
    """What of the height of the elements is left by tracks and the void."""
    if void_at(field, winner):
        return np.nan
    if len(field.tracks.masks):
        rut, _ = rut_at(field.tracks, x, y, surface_of(field, winner))
        return z - rut
    return z


@device
def descend(field, x, y, stack, sloped, started, z, i, j, in_x, in_y):
    """Height, winning element (-1 for none) and gradient at a point inside the bounds, untracked.

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
                u, v = turned(pose, u, v)
            if kind.special:
                held, value, du, dv = special(curves, kind, element, pose, grid, u, v, x, y)
                if not held:
                    continue
            else:
                if beyond(u, v):
                    continue
                fx, fx_slope = even_curve(curves.pieces, kind.x_first, kind.x_count, u)
                fy, fy_slope = even_curve(curves.pieces, kind.y_first, kind.y_count, v)
                value, du, dv = fx * fy, fx_slope * fy, fx * fy_slope
            z += element.scale * value + element.offset
            winner = max(winner, np.int64(index))
            if sloped:
                du, dv = turned_slopes(pose, du, dv)
                slope_x += element.scale * du * (grid.per_x / pose.width)
                slope_y += element.scale * dv * (grid.per_y / pose.height)
        if descended:
            g = descended
        elif pending:
            pending -= 1
            g = np.uint64(stack[pending, 0])
            from_x = stack[pending, 1]
            from_y = stack[pending, 2]
        else:
            return z, winner, slope_x, slope_y


@device
def inside(bounds, x, y):
    """Whether a point is on the terrain, its edges included."""
    return bounds[0] <= x <= bounds[2] and bounds[1] <= y <= bounds[3]


@device
def height_at(field, x, y, stack):
    """Height at a point; NaN outside and in the void."""
    if not inside(field.bounds, x, y):
        return np.nan
    z, winner, _, _ = descend(field, x, y, stack, False, False, 0.0, 0, 0, 0.0, 0.0)
    return lowered(field, z, winner, x, y)


@kernel
def positions(x, corner, rest, per, whole, part):
    """Positions along one axis of a grid, in whole cells and parts of them; vectorised."""
    for n in range(len(x)):
        s = ((x[n] - corner) - rest) * per
        whole[n] = math.floor(s)
        part[n] = s - math.floor(s)


@kernel
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


@kernel
def lower_block(field, x, y, scratch, out):
    """Take the ruts from the heights of a block; in `scratch.bins` are the winning elements."""
    count = len(x)
    bins = scratch.bins
    near = near_ruts(
        field.tracks, x, y, scratch.work[0, :count], scratch.work[1, :count], bins[:, 1]
    )
    for k in range(near):
        n = bins[k, 1]
        winner = bins[n, 0]
        if winner != FINISHED and not np.isnan(out[n]):
            rut, _ = rut_at(field.tracks, x[n], y[n], surface_of(field, np.int64(winner)))
            out[n] -= rut


@kernel
def block_heights(field, x, y, scratch, out):
    """Heights at a block of points; the root, which they share, is evaluated for all at once.

    They are those of the elements alone where `scratch.bins` gets the winning element, and
    complete where it gets FINISHED.
    """
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
                height, winner, _, _ = descend(
                    field, x[n], y[n], stack, False, True, z[n], int(cell_x[n]), int(cell_y[n]),
                    in_x[n], in_y[n],
                )  # fmt: skip
                out[n] = solid(field, height, winner)
                bins[n, 0] = winner
            else:
                out[n] = height_at(field, x[n], y[n], stack)
                bins[n, 0] = FINISHED
        return
    # first where the elements of each point are, then what they are: neither waits for the other
    for n in range(count):
        bins[n, 0] = bins[n, 1] = 0
        if sure(ground, u[n], v[n]) and sure(grid, in_x[n], in_y[n]):
            slot = np.uint64(grid.table + int(cell_y[n]) * np.int64(grid.bins_x) + int(cell_x[n]))
            bins[n, 0] = field.offsets[slot]
            bins[n, 1] = field.offsets[slot + ONE]
        else:
            bins[n, 0] = FINISHED
    for n in range(count):
        begin, end = np.uint64(bins[n, 0]), np.uint64(bins[n, 1])
        if begin == FINISHED:  # near an edge
            out[n] = height_at(field, x[n], y[n], stack)
            continue
        height, _, _, winner = add_leaves(
            field, begin, end, in_x[n], in_y[n], False, z[n], 0.0, 0.0, np.int64(0)
        )
        out[n] = solid(field, height, winner)
        bins[n, 0] = winner


@kernel
def heights(field, x, y, scratch, out):
    """Heights at points: `x`, `y`, `out` are (n,) float64; the rest is scratch."""
    root = field.elements[0]
    if root.grid and not root.pose and not field.kinds[root.kind].special:
        size = scratch.work.shape[1]
        for begin in range(0, len(x), size):
            end = min(begin + size, len(x))
            block_heights(field, x[begin:end], y[begin:end], scratch, out[begin:end])
            if len(field.tracks.masks):
                lower_block(field, x[begin:end], y[begin:end], scratch, out[begin:end])
    else:
        for n in range(len(x)):
            out[n] = height_at(field, x[n], y[n], scratch.stack)


@kernel
def samples(field, x, y, scratch, height, winners, gradient):
    """Everything at points: `height` (n,), `winners` (n,) int64, `gradient` (n, 2).

    The winner is the index of the element that decides the surface, or the number of elements and
    the index of the track: -1 where there is none, -2 outside. Height and gradient are NaN outside
    and in the void.
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
                if len(field.tracks.masks):
                    rut, worn = rut_at(field.tracks, x[n], y[n], surface_of(field, winner))
                    height[n] = z - rut
                    if worn >= 0:
                        winners[n] = len(field.elements) + worn
                gradient[n, 0] = slope_x
                gradient[n, 1] = slope_y
