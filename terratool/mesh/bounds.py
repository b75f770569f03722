"""How far an element is from a triangle between the triangle's corners: a bound that holds.

For a function with second derivatives, what its linear interpolation in a triangle misses at p is
½ Σ λᵢ (pᵢ - p)ᵀ H (pᵢ - p), with the Hessian H somewhere on the way to each corner pᵢ (Taylor's
formula at p), and Σ λᵢ (uᵢ - u)² is a variance: at most a quarter of the squared range of u. At a
crease the slope jumps by J, which adds up to J/4 times that range.
"""

from __future__ import annotations

import math

import numpy as np

from terratool.field.primitives import (
    MIN,
    PRODUCT,
    RADIAL,
    SUM,
    THREE,
    TWO,
    device,
    kernel,
    piece_slope,
    piece_value,
)
from terratool.mesh.sides import NEAR, curve_at, gauge, held, piece_at, sector

_INWARD = 1e-6
"""Corners count as this much nearer to the middle of their triangle, in parts of the way."""


@device
def stretch_reach(pieces, row, s0, s1, per):
    """Bounds of a cubic between two places: least and greatest value, slope and bend in t.

    `per` is how fast its own parameter runs with t.
    """
    f0, f1 = piece_value(pieces, row, s0), piece_value(pieces, row, s1)
    g0, g1 = piece_slope(pieces, row, s0), piece_slope(pieces, row, s1)
    c2, c3 = 2.0 * pieces[row + TWO], 6.0 * pieces[row + THREE]
    bend = max(abs(c2 + c3 * s0), abs(c2 + c3 * s1))
    # what varies by no more than v between two ends is nowhere beyond their mean by over v / 2
    slope = 0.5 * (abs(g0) + abs(g1) + bend * (s1 - s0))
    rise = slope * (s1 - s0)
    return 0.5 * (f0 + f1 - rise), 0.5 * (f0 + f1 + rise), slope * per, bend * per * per


@kernel
def curve_reach(plan, kind, axis, on_y, group, t0, t1, near):
    """Bounds of a curve between two t: least and greatest value, slope, and what a chord misses.

    A chord over a range of r misses no more than the bend times r²/8, and J r/4 for the creases; it
    also misses no more than r/4 times all that the slope varies by.
    """
    t0, t1 = held(plan, group, t0, near), held(plan, group, t1, near)
    i, row, s = piece_at(plan, kind, on_y, group, t0)
    k, last_row, end = piece_at(plan, kind, on_y, group, t1)
    pieces = plan.field.curves.pieces
    knotted = kind.knotted_y if on_y else kind.knotted_x
    per = 1.0 if knotted else np.float64(kind.y_count if on_y else kind.x_count)
    span = t1 - t0
    if i == k:
        low, high, slope, bend = stretch_reach(pieces, row, s, max(s, end), per)
        return low, high, slope, 0.125 * bend * span * span
    own = 1.0  # the length of the first piece in its own parameter
    if knotted:
        knot = np.int64(kind.y_knot if on_y else kind.x_knot) + i
        own = plan.field.curves.knots[knot + 1] - plan.field.curves.knots[knot]
    low, high, slope, bend = stretch_reach(pieces, row, s, max(s, own), per)
    varied = bend * (own - s) / per
    last_low, last_high, last_slope, last_bend = stretch_reach(pieces, last_row, 0.0, end, per)
    varied += last_bend * end / per
    low, high = min(low, last_low), max(high, last_high)
    slope, bend = max(slope, last_slope), max(bend, last_bend)
    first, last = np.int64(axis.turn) + i, np.int64(axis.turn) + k
    jumps = plan.turns[last, 0] - plan.turns[first, 0]
    varied += jumps + plan.turns[last, 1] - plan.turns[first + 1, 1]
    if k > i + 1:
        level = 0
        while (2 << level) <= k - i - 1:
            level += 1
        rows = np.int64(axis.reach) + np.int64(level) * np.int64(axis.pieces)
        one, two = plan.reaches[rows + i + 1], plan.reaches[rows + k - (1 << level)]
        low, high = min(low, one.low, two.low), max(high, one.high, two.high)
        slope = max(slope, one.slope, two.slope)
        bend = max(bend, one.bend, two.bend)
    chord = 0.125 * bend * span * span + 0.25 * jumps * span
    return low, high, slope, min(chord, 0.25 * varied * span)


@device
def radial_miss(plan, cover, u0, v0, u1, v1, u2, v2):
    """As `miss`, for a disc with a factor of 1.

    The distance from the middle is linear in each sector of the polygon. Across m of the lines
    between them its gradient turns by 2 m tan(π/n).
    """
    element = plan.field.elements[cover.element]
    kind = plan.field.kinds[element.kind]
    frame = plan.frames[cover.element]
    n = np.int64(frame.corners)
    middle_u, middle_v = (u0 + u1 + u2) / 3.0, (v0 + v1 + v2) / 3.0
    least, most = np.inf, 0.0
    wide = 2.0 * math.sqrt(
        max((u1 - u0) ** 2 + (v1 - v0) ** 2, (u2 - u1) ** 2 + (v2 - v1) ** 2,
            (u0 - u2) ** 2 + (v0 - v2) ** 2)
    )  # fmt: skip
    s0 = s1 = s2 = np.int64(-1)
    for c in range(3):
        u, v = (u0, v0) if c == 0 else ((u1, v1) if c == 1 else (u2, v2))
        rho = gauge(u, v, frame.corners)
        least, most = min(least, rho), max(most, rho)
        # a corner on the line between two sectors is in that where the triangle is
        own = sector(u + _INWARD * (middle_u - u), v + _INWARD * (middle_v - v), frame.corners)
        if rho < _INWARD:  # the middle is in all of them
            continue
        own += n if own < 0 else 0
        if c == 0:
            s0 = own
        elif c == 1:
            s1 = own
        else:
            s2 = own
    s0 = max(s0, s1) if s0 < 0 else s0
    s1 = s0 if s1 < 0 else s1
    s2 = s0 if s2 < 0 else s2
    low, high = min(s0, s1, s2), max(s0, s1, s2)
    between = s0 + s1 + s2 - low - high
    lines = n - max(between - low, high - between, low + n - high)
    half = math.pi / n
    outward = wide / math.cos(half)
    if 2 * lines < n:
        outward = min(outward, 0.5 * lines * math.tan(half) * wide)
    outward *= 0.5  # of t
    t0, t1 = max(0.5 + 0.5 * least - outward, 0.5), 0.5 + 0.5 * most
    near = NEAR * max(frame.per_x, frame.per_y)
    axis = plan.axes[element.kind, 0]
    bottom, top, slope, chord = curve_reach(
        plan, kind, axis, False, cover.group_x, min(t0, frame.rim), min(t1, frame.rim), near
    )
    if t1 > frame.rim:  # straight from there on
        before = curve_at(plan, kind, False, cover.group_x, frame.rim, near)
        last = curve_at(plan, kind, False, cover.group_x, 1.0, near)
        steep = abs(last - before) / (1.0 - frame.rim)
        if t0 >= frame.rim:
            return min(steep * outward, abs(last - before))
        bottom, top = min(bottom, last), max(top, last)
        # the bend lies in a part of the range only, but counts with all of it
        chord *= 2.0 * (t1 - t0) / (frame.rim - t0)
        chord += 0.25 * (slope + steep) * (t1 - t0)
        slope = max(slope, steep)
    return min(chord + slope * outward, top - bottom)


@device
def miss(plan, cover, u0, v0, u1, v1, u2, v2):
    """How far at most an element is from a triangle whose corners are on it.

    Corners are given in (u, v) of the element's primitive; the answer is in units of the terrain.
    """
    element = plan.field.elements[cover.element]
    kind = plan.field.kinds[element.kind]
    size = abs(element.scale)
    if size == 0.0:
        return 0.0
    if kind.combine == RADIAL:
        return size * radial_miss(plan, cover, u0, v0, u1, v1, u2, v2)
    axis_x, axis_y = plan.axes[element.kind, 0], plan.axes[element.kind, 1]
    frame = plan.frames[cover.element]
    near = NEAR * max(frame.per_x, frame.per_y)
    low_u, high_u = min(u0, u1, u2), max(u0, u1, u2)
    low_v, high_v = min(v0, v1, v2), max(v0, v1, v2)
    low_x, high_x, slope_x, along = curve_reach(
        plan, kind, axis_x, False, cover.group_x, low_u, high_u, near
    )
    low_y, high_y, slope_y, across = curve_reach(
        plan, kind, axis_y, True, cover.group_y, low_v, high_v, near
    )
    wide, tall = high_u - low_u, high_v - low_v
    rise_x, rise_y = high_x - low_x, high_y - low_y
    along, across = min(along, rise_x), min(across, rise_y)
    if kind.combine == PRODUCT:
        most_x, most_y = max(abs(low_x), abs(high_x)), max(abs(low_y), abs(high_y))
        # x y at a corner less x y is (Δx) y + x Δy + Δx Δy
        twist = min(0.25 * slope_x * wide * slope_y * tall, rise_x * rise_y)
        out = along * most_y + most_x * across + twist
        return size * min(out, rise_x * most_y + most_x * rise_y)
    if kind.combine == SUM:
        return size * (along + across)
    if low_x >= high_y:  # the other one is worth nothing
        return size * (across if kind.combine == MIN else along)
    if low_y >= high_x:
        return size * (along if kind.combine == MIN else across)
    # min(x, y) is half of x + y - |x - y|, and |d| of a linear d is missed by 2 min(d, -d) at most
    above = below = 0.0
    for c in range(3):
        u, v = (u0, v0) if c == 0 else ((u1, v1) if c == 1 else (u2, v2))
        rise = curve_at(plan, kind, False, cover.group_x, u, near)
        rise -= curve_at(plan, kind, True, cover.group_y, v, near)
        above, below = max(above, rise), max(below, -rise)
    return size * (along + across + min(above, below))
