"""Painting: the elements of a field over the pixels of a window, each over all its pixels at once.

A window is painted in tiles that stay in the cache. In a tile, grids are visited breadth first, and
the elements of a grid are painted in the order of the field; so of the elements over a pixel the
last one painted is the one that decides the surface, as in the descent.

Which cell of a grid a column or a row of pixels lies in is settled by `settle`, as in the descent,
once for each column and row of pixels of the grid. Grids finer than doubles are left to the
descent.
"""

from __future__ import annotations

import numpy as np

from terratool.field.canvas import HEIGHT, WIDTH
from terratool.field.footprints import disc_run, in_disc, turned_run
from terratool.field.kernels import descend
from terratool.field.patches import mark_block, mark_left, mark_run
from terratool.field.primitives import (
    FOUR,
    ONE,
    PRODUCT,
    RADIAL,
    THREE,
    TWO,
    device,
    kernel,
    turned,
)
from terratool.field.rows import (
    add_both,
    add_constant,
    add_products,
    add_row,
    add_turned_pairs,
    add_turned_pieces,
    add_turned_products,
    blank,
    curve_values,
    fill,
    hand_over,
    lay_products,
    place,
    placed_values,
    radii,
    turn_row,
    within_block,
)
from terratool.field.slopes import slope_block, slope_run
from terratool.field.treading import tread

_SHORT = 1.0 / 12.0
"""Turned curves that change their pieces less often than this per pixel are added by pieces."""


@kernel
def bins_of(cell, begin, end, shift, runs):
    """Runs of the same bin among `cell[begin:end]` into `runs`; their number."""
    count = 0
    n = begin
    while n < end:
        bin_ = int(cell[n]) >> shift
        runs[count, 0], runs[count, 1] = n, bin_
        count += 1
        n += 1
        while n < end and int(cell[n]) >> shift == bin_:
            n += 1
    runs[count, 0] = end
    return count


@kernel
def within(cell, begin, end, first, cells):
    """The part of `cell[begin:end]`, ascending, that lies in a block of cells."""
    while begin < end and cell[begin] < first:
        begin += 1
    while end > begin and cell[end - 1] >= first + cells:
        end -= 1
    return begin, end


@kernel
def inside_bounds(x, low, high):
    """Begin and end of the ascending coordinates from `low` to `high`."""
    begin, end = 0, len(x)
    while begin < end and x[begin] < low:
        begin += 1
    while end > begin and x[end - 1] > high:
        end -= 1
    return begin, end


@device
def constant(pieces, first, count):
    """Whether a curve of evenly spaced pieces is one number all along."""
    row = np.uint64(first) * FOUR
    return count == 1.0 and pieces[row + ONE] == pieces[row + TWO] == pieces[row + THREE] == 0.0


@device
def paint_block(field, canvas, index, grid, u, v, x, y, west, east, south, north):
    """Add an unturned element that fills its block of cells."""
    element = field.elements[index]
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    fx, fy = canvas.fx[west:east], canvas.fy[south:north]
    placed_values(
        field.curves, kind.knotted_x, kind.x_first, kind.x_count, kind.x_knot, kind.x_bin,
        kind.x_last, u[west:east], fx, x[west:east], grid.x, grid.x_rest,
        grid.near_x, grid.pitch_x, grid.pitch_x_rest, float(element.cell_x), pose.width,
    )  # fmt: skip
    placed_values(
        field.curves, kind.knotted_y, kind.y_first, kind.y_count, kind.y_knot, kind.y_bin,
        kind.y_last, v[south:north], fy, y[south:north], grid.y, grid.y_rest,
        grid.near_y, grid.pitch_y, grid.pitch_y_rest, float(element.cell_y), pose.height,
    )  # fmt: skip
    surface = kind.surface + 1
    lay = index == 0 and kind.combine == PRODUCT
    for j in range(north - south):
        at = (south + j) * WIDTH
        row = canvas.heights[at + west : at + east]
        fill(canvas.surfaces[at + west : at + east], surface)
        if lay:
            lay_products(row, fx, element.scale * fy[j], element.offset)
        else:
            add_row(kind.combine, row, fx, fy[j], element.scale, element.offset)
    if len(canvas.slope_x):
        slope_block(
            field, canvas, element, grid, u[west:east], v[south:north], x[west:east],
            y[south:north], west, south, lay,
        )  # fmt: skip
    if len(canvas.patches):
        mark_block(
            field, canvas, index, grid, u[west:east], v[south:north], x[west:east],
            y[south:north], west, south,
        )  # fmt: skip


@device
def add_general(field, canvas, element, kind, pose, u, v, row):
    """Add a turned or radial element of any kind to a run of pixels that it holds."""
    count = len(row)
    s, t = canvas.work_0[:count], canvas.work_1[:count]
    fx, fy = canvas.fx[:count], canvas.work_2[:count]
    if kind.combine == RADIAL:
        radii(pose, u, v, s)
    else:
        turn_row(pose, u, v, s, t)
        curve_values(
            field.curves, kind.knotted_y, kind.y_first, kind.y_count, kind.y_knot, kind.y_bin,
            kind.y_last, t, fy,
        )  # fmt: skip
    curve_values(
        field.curves, kind.knotted_x, kind.x_first, kind.x_count, kind.x_knot, kind.x_bin,
        kind.x_last, s, fx,
    )  # fmt: skip
    if kind.combine == RADIAL:
        add_products(row, fx, element.scale, element.offset)
    else:
        add_both(kind.combine, row, fx, fy, element.scale, element.offset)


@device
def paint_runs(field, canvas, index, grid, u, v, resolution, west, east, south, north):
    """Add a turned or radial element, row by row where its footprint holds the pixels."""
    element = field.elements[index]
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    pieces = field.curves.pieces
    across = u[west:east]
    # from the grid of pixels, not from the columns at hand: how a pixel is added must not depend on
    # the window
    step = resolution * grid.per_x / pose.width
    per = 1.0 / step if step > 0.0 else 0.0
    doubt = 4.0 * per * (grid.near_x / pose.width)
    flat_x = constant(pieces, kind.x_first, kind.x_count)
    flat_y = constant(pieces, kind.y_first, kind.y_count)
    changes = 0.0 if flat_x else abs(pose.cos) * kind.x_count
    changes += 0.0 if flat_y else abs(pose.sin_u) * kind.y_count
    value = element.offset + element.scale * (
        pieces[np.uint64(kind.x_first) * FOUR] * pieces[np.uint64(kind.y_first) * FOUR]
    )
    for r in range(south, north):
        whole = True
        if kind.combine == RADIAL:
            begin, end, whole = disc_run(pose, across, v[r], per, doubt)
        else:
            begin, end = turned_run(pose, across, v[r], per, doubt)
        at = r * WIDTH + west
        while begin < end:
            stop = end if whole else begin + 1
            if whole or in_disc(pose, across[begin], v[r]):
                fill(canvas.surfaces[at + begin : at + stop], kind.surface + 1)
                run, row = across[begin:stop], canvas.heights[at + begin : at + stop]
                if kind.special:
                    add_general(field, canvas, element, kind, pose, run, v[r], row)
                elif flat_x and flat_y:
                    add_constant(row, value)
                elif changes * step < _SHORT:
                    add_turned_pieces(
                        row, run, v[r], step, pose, pieces, kind.x_first, kind.x_count,
                        kind.y_first, kind.y_count, element.scale, element.offset,
                    )  # fmt: skip
                elif kind.x_count <= 2.0 and kind.y_count <= 2.0:
                    s, t = turned(pose, 0.0, v[r])
                    add_turned_pairs(
                        row, run, pose.cos * kind.x_count, s * kind.x_count,
                        pose.sin_u * kind.y_count, t * kind.y_count, pieces,
                        np.uint64(kind.x_first) * FOUR, np.uint64(kind.y_first) * FOUR,
                        element.scale, element.offset,
                    )  # fmt: skip
                else:
                    add_turned_products(
                        row, run, v[r], pose, pieces, kind.x_first, kind.x_count,
                        kind.y_first, kind.y_count, element.scale, element.offset,
                    )  # fmt: skip
                if len(canvas.slope_x) and not (flat_x and flat_y and not kind.special):
                    slope_run(field, canvas, element, grid, run, v[r], at + begin)
                if len(canvas.patches):
                    mark_run(field, canvas, index, run, v[r], at + begin)
            begin = stop


@device
def paint_element(field, canvas, index, grid, x, y, resolution, west, east, south, north):
    """Paint one element where its block of cells meets the given columns and rows.

    Returns these columns and rows.
    """
    element = field.elements[index]
    pose = field.poses[element.pose]
    u, v = canvas.in_x, canvas.in_y
    if grid.listed:
        cell_x, cell_y = float(element.cell_x), float(element.cell_y)
        west, east = within(canvas.cell_x, west, east, cell_x, pose.width)
        south, north = within(canvas.cell_y, south, north, cell_y, pose.height)
        if west == east or south == north:
            return west, west, south, south
        if pose.cells_x > 1 or pose.cells_y > 1:
            u, v = canvas.u, canvas.v
            within_block(
                canvas.cell_x[west:east], canvas.in_x[west:east], cell_x, pose.width, u[west:east]
            )
            within_block(
                canvas.cell_y[south:north], canvas.in_y[south:north], cell_y, pose.height,
                v[south:north],
            )  # fmt: skip
    if pose.turned or field.kinds[element.kind].combine == RADIAL:
        paint_runs(field, canvas, index, grid, u, v, resolution, west, east, south, north)
    else:
        paint_block(field, canvas, index, grid, u, v, x, y, west, east, south, north)
    return west, east, south, north


@kernel
def leave(canvas, west, east, south, north):
    """Leave pixels to the descent: NaN stays NaN, whatever is added to it."""
    for r in range(south, north):
        fill(canvas.heights[r * WIDTH + west : r * WIDTH + east], np.nan)


@kernel
def descend_left(field, canvas, x, y, row, column, west, east, south, north):
    """Ask the descent about the pixels that were left to it.

    `row`, counted from the north, and `column` are those of the tile's south-west pixel.
    """
    sloped = len(canvas.slope_x) > 0
    for r in range(south, north):
        for c in range(west, east):
            if np.isnan(canvas.heights[r * WIDTH + c]):
                z, winner, slope_x, slope_y = descend(
                    field, x[c], y[r], canvas.stack, sloped, False, 0.0, 0, 0, 0.0, 0.0
                )
                surface = -1
                if winner >= 0:
                    surface = field.kinds[field.elements[winner].kind].surface
                canvas.heights[r * WIDTH + c] = z
                canvas.surfaces[r * WIDTH + c] = surface + 1
                if sloped:
                    canvas.slope_x[r * WIDTH + c] = slope_x
                    canvas.slope_y[r * WIDTH + c] = slope_y
                if len(canvas.patches):
                    canvas.patches[r * WIDTH + c] = mark_left(row - r, column + c)


@kernel
def paint_tile(field, canvas, x, y, resolution, west, east, south, north):
    """Paint a part of a tile that is inside the bounds; whether the queue was long enough."""
    queue = canvas.queue
    size = len(queue)
    head, waiting = 0, 1
    queue[0] = 0, west, east, south, north
    left = False
    root = field.elements[0]
    kind = field.kinds[root.kind]
    bare = field.poses[root.pose].turned or kind.combine != PRODUCT
    for r in range(south, north):
        begin, end = r * WIDTH + west, r * WIDTH + east
        if bare:
            fill(canvas.heights[begin:end], 0.0)
            fill(canvas.surfaces[begin:end], 0)
        if bare and len(canvas.slope_x):
            fill(canvas.slope_x[begin:end], 0.0)
            fill(canvas.slope_y[begin:end], 0.0)
        if len(canvas.patches):
            fill(canvas.patches[begin:end], 0)
    while waiting:
        g, west, east, south, north = queue[head]
        head = (head + 1) % size
        waiting -= 1
        grid = field.grids[g]
        place(
            x[west:east], grid.x, grid.x_rest, grid.per_x, grid.nx, grid.near_x, grid.pitch_x,
            grid.pitch_x_rest, canvas.cell_x[west:east], canvas.in_x[west:east],
        )  # fmt: skip
        place(
            y[south:north], grid.y, grid.y_rest, grid.per_y, grid.ny, grid.near_y, grid.pitch_y,
            grid.pitch_y_rest, canvas.cell_y[south:north], canvas.in_y[south:north],
        )  # fmt: skip
        across = bins_of(canvas.cell_x, west, east, grid.shift_x, canvas.runs_x)
        along = bins_of(canvas.cell_y, south, north, grid.shift_y, canvas.runs_y)
        for j in range(along):
            for i in range(across):
                slot = (
                    grid.table + canvas.runs_y[j, 1] * np.int64(grid.bins_x) + canvas.runs_x[i, 1]
                )
                for k in range(np.int64(field.offsets[slot]), np.int64(field.offsets[slot + 1])):
                    index = np.int64(field.entries[k]) if grid.listed else k
                    w, e, s, n = paint_element(
                        field, canvas, index, grid, x, y, resolution,
                        canvas.runs_x[i, 0], canvas.runs_x[i + 1, 0],
                        canvas.runs_y[j, 0], canvas.runs_y[j + 1, 0],
                    )  # fmt: skip
                    below = np.int64(field.elements[index].grid)
                    if not below or w == e:
                        continue
                    if field.grids[below].local:
                        left = True
                        leave(canvas, w, e, s, n)
                        continue
                    if waiting == size:
                        return False, left
                    queue[(head + waiting) % size] = below, w, e, s, n
                    waiting += 1
    return True, left


@kernel
def paint_window(field, canvas, voids, x, y, resolution, corner, first, planes):
    """Paint a window from its tile `first` on.

    `x` ascends from the west, `y` from the south; `corner` is the row, counted from the north, and
    the column of the window's north-west pixel. `planes` are the window flat, its rows from the
    north: heights, surfaces, slopes along x and y, patches; all but the heights may be empty, and
    slopes and patches that are wanted are on the canvas. `voids` says which ids are void.

    Returns the tile for which the queue was too short, or -1.
    """
    heights, surfaces, slope_x, slope_y, patches = planes
    width, height = len(x), len(y)
    across = (width + WIDTH - 1) // WIDTH
    along = (height + HEIGHT - 1) // HEIGHT
    wide, tall = (width + across - 1) // across, (height + along - 1) // along
    for tile in range(first, across * along):
        column = tile % across * wide
        line = tile // across * tall
        xs, ys = x[column : column + wide], y[line : line + tall]
        west, east = inside_bounds(xs, field.bounds[0], field.bounds[2])
        south, north = inside_bounds(ys, field.bounds[1], field.bounds[3])
        if west < east and south < north:
            done, left = paint_tile(field, canvas, xs, ys, resolution, west, east, south, north)
            if not done:
                return tile
            if left:
                descend_left(
                    field, canvas, xs, ys, corner[0] + height - 1 - line, corner[1] + column,
                    west, east, south, north,
                )  # fmt: skip
            if len(field.tracks.masks):
                tread(field, canvas, xs, ys, west, east, south, north)
        else:
            west = east = south = north = 0
        for r in range(len(ys)):
            begin, end = (west, east) if south <= r < north else (0, 0)
            at, own = (height - 1 - line - r) * width + column, r * WIDTH
            stop = at + len(xs)
            hand_over(canvas.heights, own, heights[at:stop], begin, end, np.nan)
            if len(surfaces):
                hand_over(canvas.surfaces, own, surfaces[at:stop], begin, end, 0)
            if len(slope_x):
                hand_over(canvas.slope_x, own, slope_x[at:stop], begin, end, np.nan)
                hand_over(canvas.slope_y, own, slope_y[at:stop], begin, end, np.nan)
            if len(patches):
                hand_over(canvas.patches, own, patches[at:stop], begin, end, 0)
            if field.voids:
                ids = canvas.surfaces[own + begin : own + end]
                blank(ids, voids, heights[at + begin : at + end])
                if len(slope_x):
                    blank(ids, voids, slope_x[at + begin : at + end])
                    blank(ids, voids, slope_y[at + begin : at + end])
    return -1
