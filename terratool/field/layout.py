"""Kernels that lay out the grids of a field: their corners, and tables from cell to element."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from terratool.field.primitives import EDGE, edge

FINEST = 8.0
"""A grid whose cells are narrower than this many spacings of doubles is finer than doubles."""

_TINY = 1e-290
_EPSILON = 2.0**-52
_ROOM = 16
"""A grid may list its elements this many times over before its bins are made coarser."""

_kernel = njit(cache=True, nogil=True, error_model="numpy")


@_kernel
def split(value):
    """A double's leading 36 bits, so that a whole number of 17 bits times it is exact."""
    mantissa, exponent = math.frexp(value)
    return math.ldexp(math.floor(mantissa * 68719476736.0), exponent - 36)


@_kernel
def divide(high, low, k, n):
    """(high + low) · k / n as a 36-bit number and the rest; k and n are whole, up to 17 bits."""
    quotient = split((high * k + low * k) / n)
    return quotient, ((high * k - quotient * n) + low * k) / n


@_kernel
def lay_axis(grids, g, axis, parent, cell, span, count):
    """Lay out one axis of grid `g` in a block of cells of grid `parent`."""
    above = grids[parent]
    if axis == 0:
        corner, rest = edge(above.x, above.x_rest, above.pitch_x, above.pitch_x_rest, cell)
        pitch, pitch_rest = divide(above.pitch_x, above.pitch_x_rest, span, count)
    else:
        corner, rest = edge(above.y, above.y_rest, above.pitch_y, above.pitch_y_rest, cell)
        pitch, pitch_rest = divide(above.pitch_y, above.pitch_y_rest, span, count)
    return set_axis(grids, g, axis, corner, rest, pitch, pitch_rest, count)


@_kernel
def set_axis(grids, g, axis, corner, rest, pitch, pitch_rest, count):
    """Store one axis of a grid; whether it is finer than doubles."""
    grid = grids[g]
    side = pitch + pitch_rest
    spacing = _EPSILON * max(abs(corner), abs(corner + side * count))
    local = side < FINEST * spacing or side < _TINY
    per = 0.0 if local else 1.0 / side
    near = max(EDGE, spacing * per)
    sure = -1.0 if local else 0.5 - near
    if axis == 0:
        grid.x, grid.x_rest, grid.per_x, grid.nx, grid.near_x = corner, rest, per, count, near
        grid.clear_x = sure
        grid.pitch_x, grid.pitch_x_rest = pitch, pitch_rest
    else:
        grid.y, grid.y_rest, grid.per_y, grid.ny, grid.near_y = corner, rest, per, count, near
        grid.clear_y = sure
        grid.pitch_y, grid.pitch_y_rest = pitch, pitch_rest
    return local


@_kernel
def lay_grids(grids, sides, aspects, owners, home, cell, span, cells, origin, extent):
    """Corners and pitches of all grids, parents first.

    `sides` gets the sides of their cells, `aspects` height ÷ width of these, which keeps its
    meaning where the sides have become too small for doubles.
    """
    for g in range(len(grids)):
        local = False
        if g == 0:
            aspects[0] = extent[1] / extent[0]
            for axis in range(2):
                high = split(extent[axis])
                local |= set_axis(grids, 0, axis, origin[axis], 0.0, high, extent[axis] - high, 1.0)
        else:
            owner = owners[g - 1]
            parent = home[owner]
            local = grids[parent].local != 0
            blocks = span[owner, 1] / span[owner, 0]
            aspects[g] = aspects[parent] * blocks * (cells[owner, 0] / cells[owner, 1])
            for axis in range(2):
                local |= lay_axis(
                    grids, g, axis, parent, float(cell[owner, axis]), float(span[owner, axis]),
                    float(cells[owner, axis]),
                )  # fmt: skip
        grids[g].local = local
        if local:
            grids[g].clear_x = grids[g].clear_y = -1.0
        sides[g, 0] = grids[g].pitch_x + grids[g].pitch_x_rest
        sides[g, 1] = grids[g].pitch_y + grids[g].pitch_y_rest


@_kernel
def _listed(grid, first, last, cell, span):
    """Entries that the elements of a grid take in its bins."""
    total = 0
    for e in range(first, last):
        x = ((cell[e, 0] + span[e, 0] - 1) >> grid.shift_x) - (cell[e, 0] >> grid.shift_x) + 1
        y = ((cell[e, 1] + span[e, 1] - 1) >> grid.shift_y) - (cell[e, 1] >> grid.shift_y) + 1
        total += x * y
    return total


@_kernel
def size_bins(grids, dense, first, last, cell, span, sizes, lists):
    """Choose the bins of each grid: `sizes` of their tables and `lists` of their entries.

    A dense grid has a bin per cell. The others begin with about a bin per element and grow coarser
    until the elements that lie in several bins do not fill the memory.
    """
    for g in range(len(grids)):
        grid = grids[g]
        children = last[g] - first[g]
        nx, ny = int(grid.nx), int(grid.ny)
        shift_x = shift_y = 0
        total = 0
        if not dense[g]:
            room = _ROOM * children + 64
            while True:
                bins_x, bins_y = ((nx - 1) >> shift_x) + 1, ((ny - 1) >> shift_y) + 1
                grid.shift_x, grid.shift_y = shift_x, shift_y
                if bins_x * bins_y <= 2 * children + 64:
                    total = _listed(grid, first[g], last[g], cell, span)
                    if total <= room or bins_x * bins_y == 1:
                        break
                if bins_x >= bins_y:
                    shift_x += 1
                else:
                    shift_y += 1
        grid.bins_x = ((nx - 1) >> shift_x) + 1
        grid.listed = not dense[g]
        sizes[g] = np.int64(grid.bins_x) * (((ny - 1) >> shift_y) + 1) + 1
        lists[g] = total


@_kernel
def fill_bins(grids, first, last, cell, span, offsets, entries):
    """Fill the tables: element indices for dense grids, places in `entries` for the others."""
    used = 0
    for g in range(len(grids)):
        grid = grids[g]
        table = grid.table
        end = grids[g + 1].table if g + 1 < len(grids) else len(offsets)
        start = begin = used if grid.listed else first[g]
        offsets[table:end] = 0
        for e in range(first[g], last[g]):
            for j in range(
                cell[e, 1] >> grid.shift_y, ((cell[e, 1] + span[e, 1] - 1) >> grid.shift_y) + 1
            ):
                for i in range(
                    cell[e, 0] >> grid.shift_x, ((cell[e, 0] + span[e, 0] - 1) >> grid.shift_x) + 1
                ):
                    offsets[table + j * np.int64(grid.bins_x) + i] += 1
        for slot in range(table, end):
            count = offsets[slot]
            offsets[slot] = begin
            begin += count
        if not grid.listed:
            continue
        used = begin
        for e in range(first[g], last[g]):
            for j in range(
                cell[e, 1] >> grid.shift_y, ((cell[e, 1] + span[e, 1] - 1) >> grid.shift_y) + 1
            ):
                for i in range(
                    cell[e, 0] >> grid.shift_x, ((cell[e, 0] + span[e, 0] - 1) >> grid.shift_x) + 1
                ):
                    slot = table + j * np.int64(grid.bins_x) + i
                    entries[offsets[slot]] = e
                    offsets[slot] += 1
        # each offset has moved to its end, which is the next one's beginning
        for slot in range(end - 1, table, -1):
            offsets[slot] = offsets[slot - 1]
        offsets[table] = start


@_kernel
def pending(grids, offsets, entries, grid_of):
    """The most grids that wait on the stack of a descent: an upper bound, at least 1.

    At each grid wait the elements of one bin that have grids, while one of them is descended.
    """
    need = np.ones(len(grids), np.int64)
    for g in range(len(grids) - 1, -1, -1):
        end = grids[g + 1].table if g + 1 < len(grids) else len(offsets)
        for slot in range(grids[g].table, end - 1):
            waiting = 0
            deepest = 0
            for k in range(offsets[slot], offsets[slot + 1]):
                e = entries[k] if grids[g].listed else k
                if grid_of[e]:
                    waiting += 1
                    deepest = max(deepest, need[grid_of[e]])
            need[g] = max(need[g], waiting + deepest)
    return need[0]


@_kernel
def cell_rectangles(field, parents, out):
    """World rectangles of the elements' cells into `out`, (4, n) float64."""
    for e in range(len(field.elements)):
        element = field.elements[e]
        pose = field.poses[element.pose]
        grid = field.grids[field.elements[parents[e]].grid if e else 0]
        cell_x, cell_y = float(element.cell_x), float(element.cell_y)
        x = grid.x, grid.x_rest, grid.pitch_x, grid.pitch_x_rest
        y = grid.y, grid.y_rest, grid.pitch_y, grid.pitch_y_rest
        out[0, e], _ = edge(*x, cell_x)
        out[1, e], _ = edge(*y, cell_y)
        out[2, e], _ = edge(*x, cell_x + pose.width)
        out[3, e], _ = edge(*y, cell_y + pose.height)
