"""Patches: numbers of pixels that differ wherever a wall may stand between two neighbours.

Each element whose edges may be walls adds a number of its own to the patches of its pixels; each
with vertical steps one for the piece of the curve that a pixel lies in. So two neighbours of one
patch lie on the same side of every such edge and step, but for sums that happen to be equal: one in
2³² where an edge and another change within one pixel. Sums wrap around.
"""

from __future__ import annotations

import numpy as np

from terratool.field.canvas import WIDTH
from terratool.field.primitives import (
    RADIAL,
    STEP,
    device,
    find_piece,
    kernel,
    placed_piece,
    radius,
    turned,
)
from terratool.field.types import STEPPED

_ALONG = np.uint64(1 << 62)
_ACROSS = np.uint64(1 << 63)
_LEFT = np.uint64(3 << 62)
_LOW = np.uint64(0xFFFFFFFF)


@device
def mix(key):
    """A number of 32 bits, not 0, that is as good as drawn from the key."""
    key = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.uint32((key ^ (key >> np.uint64(31))) & _LOW) | np.uint32(1)


@device
def mark(index, kind, pose, element, rims):
    """What an element adds to all of its pixels: 0 where none of its edges can be a wall."""
    # trimmed by its cell a turned element ends anywhere; whole is what a half turn leaves, or a
    # quarter or a disc in a square
    square = abs(pose.sin_u) == abs(pose.sin_v)
    whole = not pose.turned or abs(pose.cos) == 1.0
    whole = whole or (square and (pose.cos == 0.0 or kind.combine == RADIAL))
    shaped = element.scale != 0.0 and (rims[element.kind] or not whole)
    return mix(index) if shaped or element.offset != 0.0 else np.uint32(0)


@device
def stepped(kind):
    """Whether a curve of the kind has vertical steps."""
    on_y = kind.knotted_y == STEPPED and kind.combine != RADIAL
    return kind.knotted_x == STEPPED or on_y


@kernel
def add_mark(row, value):
    """Add the same to the patches of a row."""
    for n in range(len(row)):
        row[n] += value


@kernel
def add_marks(row, values, value):
    """Add values and one value more to the patches of a row."""
    for n in range(len(row)):
        row[n] += values[n] + value


@device
def mark_piece(index, along, piece):
    """What an element adds where a curve is in a piece."""
    return mix((np.uint64(index) << np.uint64(20)) + np.uint64(piece) + along)


@kernel
def mark_block(field, canvas, index, grid, u, v, x, y, west, south):
    """Add an unturned element that fills its block of cells."""
    element = field.elements[index]
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    common = mark(index, kind, pose, element, canvas.rims)
    steps = stepped(kind) and element.scale != 0.0
    if not steps and common == 0:
        return
    marks = canvas.marks[: len(u)]
    if steps:
        for n in range(len(u)):
            marks[n] = 0
            if kind.knotted_x == STEPPED:
                piece = placed_piece(
                    field.curves, kind.x_knot, kind.x_bin, kind.x_last, u[n], x[n], grid.x,
                    grid.x_rest, grid.near_x, grid.pitch_x, grid.pitch_x_rest,
                    float(element.cell_x), pose.width,
                )  # fmt: skip
                marks[n] = mark_piece(index, _ACROSS, piece)
    for j in range(len(v)):
        at = (south + j) * WIDTH + west
        row = canvas.patches[at : at + len(u)]
        value = common
        if kind.knotted_y == STEPPED and steps:
            piece = placed_piece(
                field.curves, kind.y_knot, kind.y_bin, kind.y_last, v[j], y[j], grid.y,
                grid.y_rest, grid.near_y, grid.pitch_y, grid.pitch_y_rest,
                float(element.cell_y), pose.height,
            )  # fmt: skip
            value = np.uint32(value + mark_piece(index, _ALONG, piece))
        if steps:
            add_marks(row, marks, value)
        else:
            add_mark(row, value)


@kernel
def mark_run(field, canvas, index, u, v, at):
    """Add a turned or radial element to a run of pixels that it holds."""
    element = field.elements[index]
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    row = canvas.patches[at : at + len(u)]
    common = mark(index, kind, pose, element, canvas.rims)
    if common:
        add_mark(row, common)
    if not stepped(kind) or element.scale == 0.0:
        return
    for n in range(len(u)):
        s, t = u[n], v
        if pose.turned:
            s, t = turned(pose, s, t)
        if kind.combine == RADIAL:
            s = 0.5 + 0.5 * radius(s, t)
        if kind.knotted_x == STEPPED:
            s = min(min(max(s, 0.0), 1.0) + STEP, 1.0)
            piece = find_piece(field.curves, kind.x_knot, kind.x_bin, kind.x_last, s)
            row[n] += mark_piece(index, _ACROSS, piece)
        if kind.knotted_y == STEPPED and kind.combine != RADIAL:
            t = min(min(max(t, 0.0), 1.0) + STEP, 1.0)
            piece = find_piece(field.curves, kind.y_knot, kind.y_bin, kind.y_last, t)
            row[n] += mark_piece(index, _ALONG, piece)


@device
def mark_left(row, column):
    """The patch of a pixel that is left to the descent: its own, whatever lies beside it."""
    return mix(_LEFT + (np.uint64(row) << np.uint64(31)) + np.uint64(column))
