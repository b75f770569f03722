"""Segments that the edges of a mesh follow: footprints, vertical steps, creases, where min changes.

Each kernel runs twice: with an empty array to count, then to fill. Segments are clipped to the cell
of their element and to the part that is meshed, and rounded to the lattice.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.field.primitives import FOUR, MAX, MIN, PRODUCT, RADIAL, device, kernel
from terratool.mesh.sides import curve_at, faceted
from terratool.mesh.types import Plan

DRAWN = 0.5
"""A crease is an edge if the chord over it misses by more than so much of the error."""

_ROUND = 0.2
"""Polygons of rings may change the height by so much of the error."""
_AHEAD = 0.01
"""The slope at a ring is that of a secant over so much of the way to the rim."""
_SLACK = 1e-3
"""What lies outside by less, in points of the lattice, is inside."""


@device
def cut(low, high, before, after, slack):
    """Narrow a stretch of a segment to where a linear function is at most `slack`.

    `before` and `after` are its values at the two ends of the segment.
    """
    before -= slack
    after -= slack
    if before > 0.0 and after > 0.0:
        return 1.0, 0.0
    if before > 0.0:
        low = max(low, before / (before - after))
    elif after > 0.0:
        high = min(high, before / (before - after))
    return low, high


@device
def weights(plan, index):
    """How much a change of the curve x, and of the curve y, may change the height of an element."""
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    along = across = abs(element.scale)
    if kind.combine == PRODUCT:
        along *= plan.axes[element.kind, 1].most
        across *= plan.axes[element.kind, 0].most
    if kind.combine == RADIAL:
        across = 0.0
    return along, across


@device
def is_drawn(plan, line, weight):
    """Whether a line of a curve is drawn, for an element where it weighs so much."""
    return weight > 0.0 and plan.lines[line].crease * weight > DRAWN * plan.error


@device
def stretch(plan, axis, weight, t):
    """Between which drawn lines of a curve `t` lies, and in which group."""
    passed = 0
    group = np.int64(axis.group)
    for line in range(axis.line, axis.line + axis.lines):
        if plan.lines[line].t > t:
            break
        if is_drawn(plan, line, weight):
            passed += 1
        group = np.int64(plan.lines[line].group)
    return passed, group


@kernel
def put(plan, index, trimmed, x0, y0, x1, y1, out, n):
    """Append a segment on the lattice, clipped; returns the number of segments."""
    low, high = 0.0, 1.0
    b = plan.bounds
    low, high = cut(low, high, b[0] - x0, b[0] - x1, _SLACK)
    low, high = cut(low, high, x0 - b[2], x1 - b[2], _SLACK)
    low, high = cut(low, high, b[1] - y0, b[1] - y1, _SLACK)
    low, high = cut(low, high, y0 - b[3], y1 - b[3], _SLACK)
    if trimmed:
        f = plan.frames[index]
        low, high = cut(low, high, f.west - x0, f.west - x1, _SLACK)
        low, high = cut(low, high, x0 - f.east, x1 - f.east, _SLACK)
        low, high = cut(low, high, f.south - y0, f.south - y1, _SLACK)
        low, high = cut(low, high, y0 - f.north, y1 - f.north, _SLACK)
    if low >= high:
        return n
    a0, a1 = np.rint(x0 + low * (x1 - x0)), np.rint(y0 + low * (y1 - y0))
    b0, b1 = np.rint(x0 + high * (x1 - x0)), np.rint(y0 + high * (y1 - y0))
    if a0 == b0 and a1 == b1:
        return n
    if n < len(out):
        # one direction, so that the same edge of two elements is the same segment
        if a0 > b0 or (a0 == b0 and a1 > b1):
            a0, a1, b0, b1 = b0, b1, a0, a1
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = int(a0), int(a1), int(b0), int(b1)
    return n + 1


@kernel
def put_shape(plan, index, u0, v0, u1, v1, out, n):
    """Append a segment given in (u, v) of the element's primitive."""
    element = plan.field.elements[index]
    pose = plan.field.poses[element.pose]
    f = plan.frames[index]
    if pose.turned:  # back to the cell
        p, q = u0 - 0.5, v0 - 0.5
        u0, v0 = 0.5 + p * pose.cos + q * pose.sin_v, 0.5 + q * pose.cos - p * pose.sin_u
        p, q = u1 - 0.5, v1 - 0.5
        u1, v1 = 0.5 + p * pose.cos + q * pose.sin_v, 0.5 + q * pose.cos - p * pose.sin_u
    wide, tall = f.east - f.west, f.north - f.south
    return put(
        plan, index, pose.turned != 0, f.west + u0 * wide, f.south + v0 * tall, f.west + u1 * wide,
        f.south + v1 * tall, out, n,
    )  # fmt: skip


@kernel
def put_ring(plan, index, rho, stride, out, n):
    """Append the polygon that stands for a circle of so many radii of the disc.

    Only each `stride`-th corner of the disc's polygon is used.
    """
    corners = plan.frames[index].corners
    step = 2.0 * math.pi / corners
    before_u, before_v = 0.5 + 0.5 * rho, 0.5
    for k in range(stride, corners + 1, stride):
        u = 0.5 + 0.5 * rho * math.cos(k * step)
        v = 0.5 + 0.5 * rho * math.sin(k * step)
        if k == corners:
            u, v = 0.5 + 0.5 * rho, 0.5
        n = put_shape(plan, index, before_u, before_v, u, v, out, n)
        before_u, before_v = u, v
    return n


@device
def stride_of(plan, index, t):
    """How many corners of a disc's polygon the ring at `t` may go at a time."""
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    _, group = stretch(plan, plan.axes[element.kind, 0], 0.0, t)
    ahead = t + _AHEAD * (1.0 - t)
    drop = curve_at(plan, kind, False, group, t, 0.0)
    drop -= curve_at(plan, kind, False, group, ahead, 0.0)
    # the slope there, for a change of the radius, times the radius
    steep = 0.5 * abs(drop * element.scale) / (ahead - t) * (2.0 * t - 1.0)
    corners = plan.frames[index].corners
    stride = np.int64(1)
    while corners % (2 * stride) == 0 and corners >= 16 * stride:
        if steep * (1.0 - math.cos(2.0 * stride * math.pi / corners)) > _ROUND * plan.error:
            break
        stride *= 2
    return stride


@kernel
def put_chords(plan, index, on_y, out, n):
    """Append the lines where the chords of a curve meet."""
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    frame = plan.frames[index]
    first, count = np.int64(frame.chord), np.int64(frame.chords_x)
    if on_y:
        first, count = first + count, np.int64(frame.chords_y)
    for k in range(first, first + count):
        t = plan.chords[k]
        if kind.combine == RADIAL:
            n = put_ring(plan, index, 2.0 * t - 1.0, stride_of(plan, index, t), out, n)
        elif on_y:
            n = put_shape(plan, index, 0.0, t, 1.0, t, out, n)
        else:
            n = put_shape(plan, index, t, 0.0, t, 1.0, out, n)
    return n


@device
def put_spokes(plan, index, out, n):
    """Append the lines from the middle of a disc to the corners of its polygon."""
    corners = plan.frames[index].corners
    for k in range(corners):
        angle = k * (2.0 * math.pi / corners)
        u, v = 0.5 + 0.5 * math.cos(angle), 0.5 + 0.5 * math.sin(angle)
        n = put_shape(plan, index, 0.5, 0.5, u, v, out, n)
    return n


@device
def put_trims(plan, index, out, n):
    """Append the sides of the cell where they trim what is turned."""
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    pose = plan.field.poses[element.pose]
    f = plan.frames[index]
    slack = _SLACK * max(f.per_x, f.per_y)
    for side in range(4):
        a0, b0 = (0.0 if side in (0, 3) else 1.0), (0.0 if side in (0, 1) else 1.0)
        a1, b1 = (0.0 if side in (2, 3) else 1.0), (0.0 if side in (0, 3) else 1.0)
        p0 = (a0 - 0.5) * pose.cos - (b0 - 0.5) * pose.sin_v
        q0 = (a0 - 0.5) * pose.sin_u + (b0 - 0.5) * pose.cos
        p1 = (a1 - 0.5) * pose.cos - (b1 - 0.5) * pose.sin_v
        q1 = (a1 - 0.5) * pose.sin_u + (b1 - 0.5) * pose.cos
        low, high = 0.0, 1.0
        if kind.combine == RADIAL:
            half = math.pi / f.corners
            reach = 0.5 * math.cos(half)
            for k in range(f.corners):
                c, s = math.cos((2 * k + 1) * half), math.sin((2 * k + 1) * half)
                low, high = cut(low, high, p0 * c + q0 * s - reach, p1 * c + q1 * s - reach, slack)
        else:
            low, high = cut(low, high, p0 - 0.5, p1 - 0.5, slack)
            low, high = cut(low, high, -0.5 - p0, -0.5 - p1, slack)
            low, high = cut(low, high, q0 - 0.5, q1 - 0.5, slack)
            low, high = cut(low, high, -0.5 - q0, -0.5 - q1, slack)
        if low < high:
            x0, y0 = f.west + a0 * (f.east - f.west), f.south + b0 * (f.north - f.south)
            x1, y1 = f.west + a1 * (f.east - f.west), f.south + b1 * (f.north - f.south)
            n = put(
                plan, index, True, x0 + low * (x1 - x0), y0 + low * (y1 - y0),
                x0 + high * (x1 - x0), y0 + high * (y1 - y0), out, n,
            )  # fmt: skip
    return n


@device
def piece_of(plan, kind, on_y, i):
    """Begin, end, value at the begin and slope of a straight piece of a curve; t."""
    curves = plan.field.curves
    if on_y:
        first, knotted, knot, count = kind.y_first, kind.knotted_y, kind.y_knot, kind.y_count
    else:
        first, knotted, knot, count = kind.x_first, kind.knotted_x, kind.x_knot, kind.x_count
    row = (np.uint64(first) + np.uint64(i)) * FOUR
    value, slope = curves.pieces[row], curves.pieces[row + np.uint64(1)]
    if knotted:
        begin = curves.knots[np.int64(knot) + i]
        return begin, min(curves.knots[np.int64(knot) + i + 1], 1.0), value, slope
    return i / count, (i + 1) / count, value, slope * count


@device
def pieces_in(plan, kind, on_y):
    """Number of the pieces of a curve, one of no length at the end not counted."""
    knotted = kind.knotted_y if on_y else kind.knotted_x
    if not knotted:
        return np.int64(kind.y_count if on_y else kind.x_count)
    i = np.int64(0)
    knot = np.int64(kind.y_knot if on_y else kind.x_knot)
    while plan.field.curves.knots[knot + i] < 1.0:
        i += 1
    return i


@device
def put_ties(plan, index, out, n):
    """Append the lines where the two curves of a minimum or maximum are equal."""
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    along = pieces_in(plan, kind, False)
    across = pieces_in(plan, kind, True)
    for i in range(along):
        u0, u1, a, slope_a = piece_of(plan, kind, False, i)
        for j in range(across):
            v0, v1, b, slope_b = piece_of(plan, kind, True, j)
            # a + slope_a (u - u0) = b + slope_b (v - v0)
            if slope_a == 0.0 and slope_b == 0.0:
                continue
            low, high = 0.0, 1.0
            if abs(slope_b) * (v1 - v0) >= abs(slope_a) * (u1 - u0):
                begin_u, end_u = u0, u1
                begin_v = v0 + (a - b) / slope_b
                end_v = v0 + (a + slope_a * (u1 - u0) - b) / slope_b
            else:
                begin_v, end_v = v0, v1
                begin_u = u0 + (b - a) / slope_a
                end_u = u0 + (b + slope_b * (v1 - v0) - a) / slope_a
            low, high = cut(low, high, u0 - begin_u, u0 - end_u, 0.0)
            low, high = cut(low, high, begin_u - u1, end_u - u1, 0.0)
            low, high = cut(low, high, v0 - begin_v, v0 - end_v, 0.0)
            low, high = cut(low, high, begin_v - v1, end_v - v1, 0.0)
            if low < high:
                n = put_shape(
                    plan, index, begin_u + low * (end_u - begin_u),
                    begin_v + low * (end_v - begin_v), begin_u + high * (end_u - begin_u),
                    begin_v + high * (end_v - begin_v), out, n,
                )  # fmt: skip
    return n


@kernel
def put_element(plan, index, out, n):
    """Append all segments of an element."""
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    pose = plan.field.poses[element.pose]
    along, across = weights(plan, index)
    axis_x, axis_y = plan.axes[element.kind, 0], plan.axes[element.kind, 1]
    if pose.turned:
        n = put_trims(plan, index, out, n)
    if kind.combine == RADIAL:
        n = put_ring(plan, index, 1.0, 1, out, n)
        for line in range(axis_x.line, axis_x.line + axis_x.lines):
            if is_drawn(plan, line, along):
                n = put_ring(plan, index, 2.0 * plan.lines[line].t - 1.0, 1, out, n)
        if faceted(kind, axis_x, element):
            n = put_spokes(plan, index, out, n)
        return put_chords(plan, index, False, out, n)
    n = put_shape(plan, index, 0.0, 0.0, 1.0, 0.0, out, n)
    n = put_shape(plan, index, 1.0, 0.0, 1.0, 1.0, out, n)
    n = put_shape(plan, index, 1.0, 1.0, 0.0, 1.0, out, n)
    n = put_shape(plan, index, 0.0, 1.0, 0.0, 0.0, out, n)
    for line in range(axis_x.line, axis_x.line + axis_x.lines):
        if is_drawn(plan, line, along):
            t = plan.lines[line].t
            n = put_shape(plan, index, t, 0.0, t, 1.0, out, n)
    for line in range(axis_y.line, axis_y.line + axis_y.lines):
        if is_drawn(plan, line, across):
            t = plan.lines[line].t
            n = put_shape(plan, index, 0.0, t, 1.0, t, out, n)
    n = put_chords(plan, index, False, out, n)
    n = put_chords(plan, index, True, out, n)
    straight = axis_x.linear and axis_y.linear and element.scale != 0.0
    if straight and (kind.combine == MIN or kind.combine == MAX):
        n = put_ties(plan, index, out, n)
    return n


@kernel
def segments(plan, chosen, out):
    """Write segments of elements into `out`, (n, 4) int64 x, y, x, y; returns their number.

    What has no room in `out` is only counted.
    """
    n = np.int64(0)
    for k in range(len(chosen)):
        n = put_element(plan, np.int64(chosen[k]), out, n)
    return n


def segments_of(plan: Plan, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Segments of the elements with these indices and of all ruts, (n, 4) x, y, x, y."""
    count = segments(plan, chosen, np.empty((0, 4), np.int64))
    drawn = np.empty((count, 4), np.int64)
    segments(plan, chosen, drawn)
    return np.concatenate([drawn, plan.outlines.edges]) if len(plan.outlines.edges) else drawn
