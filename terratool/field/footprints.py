"""Which pixels of a row a turned rectangle or a disc holds: solved, then made exact.

The ends of a run are guessed by arithmetic and moved to where the tests of the descent, the same
operations on the same numbers, change their answer. What a guess is worth is a matter of time only.
"""

from __future__ import annotations

import math

from terratool.field.primitives import EDGE, device, kernel, radius, turned

_SLACK = 1e-9
"""Constraints that miss each other by more than this leave no pixel, however they are rounded."""


@device
def side(pose, u, v):
    """Where a point lies in its row: -1 west of the turned rectangle, 1 east of it, 0 in it.

    It is 0 where `beyond` is false. Each side of the rectangle bounds a row from one end only, also
    when rounded, so along a row come first the -1, then the 0, then the 1.
    """
    p, q = turned(pose, u, v)
    p -= 0.5
    q -= 0.5
    if abs(p) > 0.5 + EDGE:
        return 1 if (p > 0.0) == (pose.cos > 0.0) or pose.cos == 0.0 else -1
    if abs(q) > 0.5 + EDGE:
        return 1 if (q > 0.0) == (pose.sin_u > 0.0) or pose.sin_u == 0.0 else -1
    return 0


@device
def strip(factor, part):
    """The interval of a in which |factor · a + part| <= 1/2 + EDGE, and the size of its numbers.

    Empty intervals end before they begin.
    """
    reach = 0.5 + EDGE
    if factor == 0.0:  # all or nothing
        far = -math.inf if abs(part) > reach + _SLACK else math.inf
        return -far, far, 0.0
    middle, half = -part / factor, reach / abs(factor)
    return middle - half, middle + half, abs(middle) + half


@device
def whole_column(u, at, per):
    """The first column at or after `at`, about, and how far the answer is from changing.

    `per` columns lie in a unit of `u`; so far in columns.
    """
    s = min(max((at - u[0]) * per, -0.5), len(u) + 0.5)
    column = math.ceil(s)
    return min(max(int(column), 0), len(u)), min(column - s, s + 1.0 - column)


@device
def turned_run(pose, u, v, per, doubt):
    """Begin and end of the columns that a turned rectangle holds, in a row of points `u` at `v`.

    `doubt` is how far, in columns, `u` may be from evenly spaced, rounding included.
    """
    b = v - 0.5
    low_u, high_u, size_u = strip(pose.cos, -b * pose.sin_v)
    low_v, high_v, size_v = strip(pose.sin_u, b * pose.cos)
    low, high = max(low_u, low_v), min(high_u, high_v)
    slack = _SLACK * (1.0 + size_u + size_v)
    if low - high > slack:
        return 0, 0
    count = len(u)
    begin, clear = whole_column(u, low + 0.5, per)
    end, clear_too = whole_column(u, high + 0.5, per)
    if not min(clear, clear_too) > doubt + slack * per:
        while begin > 0 and side(pose, u[begin - 1], v) >= 0:
            begin -= 1
        while begin < count and side(pose, u[begin], v) < 0:
            begin += 1
        end = max(end, begin)
        while end < count and side(pose, u[end], v) <= 0:
            end += 1
        while end > begin and side(pose, u[end - 1], v) > 0:
            end -= 1
    return begin, end


@device
def in_disc(pose, u, v):
    """Whether the disc of a radial element, turned or not, holds a point of the cell."""
    if pose.turned:
        u, v = turned(pose, u, v)
    return not radius(u, v) > 1.0 + EDGE


@kernel
def disc_run(pose, u, v, per, doubt):
    """Begin and end of the columns that a disc holds, and whether it holds all of them.

    Where a row only just touches the disc, or the pixels are hardly apart, rounding may leave gaps:
    then each column is to be looked at.
    """
    b = v - 0.5
    count = len(u)
    # (2p)² + (2q)² <= reach² with p = a·cos − b·sin_v, q = a·sin_u + b·cos, and since
    # cos² + sin_u·sin_v = 1
    square = pose.cos**2 + pose.sin_u**2
    half = b * pose.cos * (pose.sin_u - pose.sin_v)
    inner = 0.25 * square * (1.0 + EDGE) ** 2 - b * b
    if inner < -_SLACK * (square + 1.0):
        return 0, 0, True
    root = math.sqrt(max(inner, 0.0))
    noise = 1e-14 * (1.0 + abs(pose.sin_u) + abs(pose.sin_v))
    if per == 0.0 or doubt > 0.1 or inner < 1e-12 * (square + 1.0) or root < noise * per:
        return 0, count, False
    begin, _ = whole_column(u, 0.5 + (-half - root) / square, per)
    end, _ = whole_column(u, 0.5 + (-half + root) / square, per)
    end = max(begin, end)
    while begin > 0 and in_disc(pose, u[begin - 1], v):
        begin -= 1
    while begin < end and not in_disc(pose, u[begin], v):
        begin += 1
    while end < count and in_disc(pose, u[end], v):
        end += 1
    while end > begin and not in_disc(pose, u[end - 1], v):
        end -= 1
    return begin, end, True
