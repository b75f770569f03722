"""Rows of pixels: what the curves are worth along them, and loops that add it to the heights.

Every loop here runs over whole one-dimensional arrays: along `row[n]` the compiler makes vector
instructions, along `rows[begin + n]` it does not. No loop lets a product and a sum become one
instruction: what a pixel is worth does not depend on where its row begins, nor on the processor.
"""

from __future__ import annotations

import numpy as np

from terratool.field.kernels import positions
from terratool.field.primitives import (
    FOUR,
    MIN,
    ONE,
    PRODUCT,
    SUM,
    THREE,
    TWO,
    device,
    even_curve,
    kernel,
    knotted_curve,
    placed_curve,
    radius,
    settle,
    turned,
)
from terratool.field.types import STEPPED


@kernel
def lay_products(row, fx, factor, offset):
    """Row of the first element: `fx` · `factor` + `offset`."""
    for n in range(len(row)):
        row[n] = fx[n] * factor + offset


@kernel
def add_products(row, fx, factor, offset):
    """Add `fx` · `factor` + `offset`."""
    for n in range(len(row)):
        row[n] += fx[n] * factor + offset


@kernel
def add_least(row, fx, fy, scale, offset):
    """Add `scale` · min(`fx`, `fy`) + `offset`."""
    for n in range(len(row)):
        row[n] += scale * min(fx[n], fy) + offset


@kernel
def add_most(row, fx, fy, scale, offset):
    """Add `scale` · max(`fx`, `fy`) + `offset`."""
    for n in range(len(row)):
        row[n] += scale * max(fx[n], fy) + offset


@kernel
def add_constant(row, value):
    """Add the same everywhere."""
    for n in range(len(row)):
        row[n] += value


@device
def add_row(how, row, fx, fy, scale, offset):
    """Add an unturned element to a row, along which `fy` is one number."""
    if how == PRODUCT:
        add_products(row, fx, scale * fy, offset)
    elif how == SUM:
        add_products(row, fx, scale, scale * fy + offset)
    elif how == MIN:
        add_least(row, fx, fy, scale, offset)
    else:
        add_most(row, fx, fy, scale, offset)


@kernel
def add_pieces(row, u, pieces, x, x_rate, x_start, y, y_rate, y_start, scale, offset):
    """Add products of two pieces, whose coefficients begin at `x` and `y`, along a row.

    The position in a piece is rate · `u` + start.
    """
    x0, x1, x2, x3 = pieces[x], pieces[x + ONE], pieces[x + TWO], pieces[x + THREE]
    y0, y1, y2, y3 = pieces[y], pieces[y + ONE], pieces[y + TWO], pieces[y + THREE]
    for n in range(len(row)):
        s = min(max(u[n] * x_rate + x_start, 0.0), 1.0)
        t = min(max(u[n] * y_rate + y_start, 0.0), 1.0)
        fx = x0 + s * (x1 + s * (x2 + s * x3))
        fy = y0 + t * (y1 + t * (y2 + t * y3))
        row[n] += scale * (fx * fy) + offset


@kernel
def add_turned_pairs(row, u, x_rate, x_start, y_rate, y_start, pieces, x, y, scale, offset):
    """Add products of curves of at most two pieces along a row of a turned element.

    Which piece counts is chosen between numbers, not between addresses, so all of it is vectors.
    """
    x0, x1, x2, x3 = pieces[x], pieces[x + ONE], pieces[x + TWO], pieces[x + THREE]
    y0, y1, y2, y3 = pieces[y], pieces[y + ONE], pieces[y + TWO], pieces[y + THREE]
    x += FOUR
    y += FOUR
    x4, x5, x6, x7 = pieces[x], pieces[x + ONE], pieces[x + TWO], pieces[x + THREE]
    y4, y5, y6, y7 = pieces[y], pieces[y + ONE], pieces[y + TWO], pieces[y + THREE]
    for n in range(len(row)):
        s = u[n] * x_rate + x_start
        t = u[n] * y_rate + y_start
        a, b = s >= 1.0, t >= 1.0
        s = min(max(s - 1.0 if a else s, 0.0), 1.0)
        t = min(max(t - 1.0 if b else t, 0.0), 1.0)
        f3, f2, f1, f0 = x7 if a else x3, x6 if a else x2, x5 if a else x1, x4 if a else x0
        g3, g2, g1, g0 = y7 if b else y3, y6 if b else y2, y5 if b else y1, y4 if b else y0
        fx = f0 + s * (f1 + s * (f2 + s * f3))
        fy = g0 + t * (g1 + t * (g2 + t * g3))
        row[n] += scale * (fx * fy) + offset


@kernel
def add_turned_products(row, u, v, pose, pieces, x, x_count, y, y_count, scale, offset):
    """Add the product of two curves of evenly spaced pieces along a row of a turned element."""
    for n in range(len(row)):
        s, t = turned(pose, u[n], v)
        fx, _ = even_curve(pieces, x, x_count, min(max(s, 0.0), 1.0))
        fy, _ = even_curve(pieces, y, y_count, min(max(t, 0.0), 1.0))
        row[n] += scale * (fx * fy) + offset


@device
def piece_at(t, count):
    """Which of evenly spaced pieces holds `t`, held to [0, 1]."""
    return np.int64(min(min(max(t, 0.0), 1.0) * count, count - 1.0))


@device
def columns_left(t, piece, count, rate):
    """For how many columns more a curve stays in a piece, about, if `t` grows by `rate` in each."""
    if rate > 0.0:
        return ((piece + 1.0) / count - t) / rate
    if rate < 0.0:
        return (piece / count - t) / rate
    return np.inf


@kernel
def add_turned_pieces(row, u, v, step, pose, pieces, x, x_count, y, y_count, scale, offset):
    """As add_turned_products, by runs of columns in which both curves stay in one piece."""
    begin, count = 0, len(row)
    while begin < count:
        s, t = turned(pose, u[begin], v)
        i, j = piece_at(s, x_count), piece_at(t, y_count)
        ahead = min(
            columns_left(s, i, x_count, pose.cos * step),
            columns_left(t, j, y_count, pose.sin_u * step),
        )
        end = begin + 1 + int(max(min(ahead, count - 1.0 - begin), 0.0))
        while end > begin + 1:  # guessed, so it may be one too far
            s, t = turned(pose, u[end - 1], v)
            if piece_at(s, x_count) == i and piece_at(t, y_count) == j:
                break
            end -= 1
        middle, along = turned(pose, 0.0, v)
        add_pieces(
            row[begin:end], u[begin:end], pieces,
            (np.uint64(x) + np.uint64(i)) * FOUR, pose.cos * x_count, middle * x_count - i,
            (np.uint64(y) + np.uint64(j)) * FOUR, pose.sin_u * y_count, along * y_count - j,
            scale, offset,
        )  # fmt: skip
        begin = end


@kernel
def add_both(how, row, fx, fy, scale, offset):
    """Add a turned element to a row, along which both curves change."""
    if how == PRODUCT:
        for n in range(len(row)):
            row[n] += scale * (fx[n] * fy[n]) + offset
    elif how == SUM:
        for n in range(len(row)):
            row[n] += scale * (fx[n] + fy[n]) + offset
    elif how == MIN:
        for n in range(len(row)):
            row[n] += scale * min(fx[n], fy[n]) + offset
    else:
        for n in range(len(row)):
            row[n] += scale * max(fx[n], fy[n]) + offset


@kernel
def fill(row, value):
    """Set all of a row."""
    for n in range(len(row)):
        row[n] = value


@kernel
def copy(row, out):
    """Copy a row into one of its own or of another type."""
    for n in range(len(row)):
        out[n] = row[n]


@kernel
def hand_over(plane, own, out, begin, end, nothing):
    """Copy the columns from `begin` to `end` of a row of the tile; outside there is `nothing`."""
    fill(out[:begin], nothing)
    copy(plane[own + begin : own + end], out[begin:end])
    fill(out[end:], nothing)


@kernel
def blank(ids, voids, row):
    """Take away the heights where the surface is void."""
    for n in range(len(ids)):
        if voids[ids[n]]:
            row[n] = np.nan


@kernel
def place(x, corner, rest, per, count, near, pitch, pitch_rest, cell, part):
    """Cells of a grid that hold each `x`, and positions in them: settle() for many at once."""
    positions(x, corner, rest, per, cell, part)
    for n in range(len(x)):
        if part[n] < near or part[n] > 1.0 - near or cell[n] < 0.0 or cell[n] >= count:
            k, part[n] = settle(x[n], corner, rest, per, count, near, pitch, pitch_rest, False, 0.0)
            cell[n] = k


@kernel
def within_block(cell, part, first, width, out):
    """Positions in a block of cells, as the descent has them."""
    for n in range(len(cell)):
        out[n] = min(((cell[n] - first) + part[n]) / width, 1.0)


@device
def curve_values(curves, knotted, first, count, knot, bin_, last, t, out):
    """Values of a curve at each `t` in [0, 1], where no edge in the world decides about steps."""
    if knotted:
        for n in range(len(t)):
            out[n], _ = knotted_curve(curves, knotted, first, knot, bin_, last, t[n])
    else:
        for n in range(len(t)):
            out[n], _ = even_curve(curves.pieces, first, count, t[n])


@device
def placed_values(
    curves, knotted, first, count, knot, bin_, last, t, out,
    x, corner, rest, near, pitch, pitch_rest, cell, width,
):  # fmt: skip
    """Values of a curve of an unturned element at each `t`, at `x` in the world."""
    if knotted == STEPPED:
        for n in range(len(t)):
            out[n], _ = placed_curve(
                curves, first, knot, bin_, last, t[n],
                x[n], corner, rest, near, pitch, pitch_rest, cell, width,
            )  # fmt: skip
    else:
        curve_values(curves, knotted, first, count, knot, bin_, last, t, out)


@kernel
def turn_row(pose, u, v, out_u, out_v):
    """Positions in the turned rectangle of a row of points, held to [0, 1]."""
    for n in range(len(u)):
        a, b = turned(pose, u[n], v)
        out_u[n] = min(max(a, 0.0), 1.0)
        out_v[n] = min(max(b, 0.0), 1.0)


@kernel
def radii(pose, u, v, out):
    """Where the turned curve of a radial element is to be read for a row of points."""
    for n in range(len(u)):
        a, b = u[n], v
        if pose.turned:
            a, b = turned(pose, a, b)
        out[n] = min(0.5 + 0.5 * radius(a, b), 1.0)
