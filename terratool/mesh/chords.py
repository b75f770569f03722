"""Where the chords of a curve meet: lines beside which triangles need no refinement.

They are drawn where triangles of equal sides would be many more: where the other curve is level,
and where a tangent is vertical, as at the edge of a dome.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terratool.field.primitives import PRODUCT, RADIAL, SUM, device, kernel
from terratool.mesh.sides import curve_at
from terratool.mesh.types import Plan

_CHORD = 0.95
"""Chords of curves may miss them by so much of the error …"""
_STEEP = 0.25
"""… where a tangent is vertical by so much …"""
_RINGS = 0.45
"""… and in a disc by so much."""
_HALVINGS, _TESTS = 30, 8
"""The end of a chord is found by so many halvings, each tested at so many places."""
_LINES = 4096
"""No curve has more chords between two steps."""


@device
def chords_before(plan, first, count, t):
    """How many of some chords end at or before `t`."""
    low, high = np.int64(first), np.int64(first) + np.int64(count)
    while low < high:
        half = (low + high) >> 1
        if plan.chords[half] <= t:
            low = half + 1
        else:
            high = half
    return low - np.int64(first)


@kernel
def chord_end(plan, kind, on_y, group, t, allowed):
    """The largest t to which a chord from `t` misses a curve by no more than `allowed`."""
    low, high = t, plan.groups[group].high
    end = high
    for _ in range(_HALVINGS):
        begin_z = curve_at(plan, kind, on_y, group, t, 0.0)
        end_z = curve_at(plan, kind, on_y, group, end, 0.0)
        fits = True
        for k in range(1, _TESTS):
            z = curve_at(plan, kind, on_y, group, t + (end - t) * k / _TESTS, 0.0)
            fits = fits and abs(z - begin_z - (end_z - begin_z) * k / _TESTS) <= allowed
        if fits:
            low = end
        else:
            high = end
        if low >= high:
            break
        end = 0.5 * (low + high)
    return low


@kernel
def find_chords(plan, index, on_y, other, out, n):
    """Append where chords of a curve end; returns the number of all.

    `other` is the most that the other curve is worth.
    """
    element = plan.field.elements[index]
    kind = plan.field.kinds[element.kind]
    axis = plan.axes[element.kind, np.int64(on_y)]
    share = _STEEP if axis.steep else _CHORD
    if kind.combine == RADIAL:
        share = _RINGS
    allowed = share * plan.error / (abs(element.scale) * other)
    for line in range(-1, np.int64(axis.lines)):
        group = np.int64(axis.group)
        if line >= 0:
            group = np.int64(plan.lines[axis.line + line].group)
            if not math.isinf(plan.lines[axis.line + line].crease):
                continue
        t, end = plan.groups[group].low, plan.groups[group].high
        if kind.combine == RADIAL:
            t, end = max(t, 0.5), min(end, plan.frames[index].rim)
        for _ in range(_LINES):
            before = t
            t = min(chord_end(plan, kind, on_y, group, t, allowed), end)
            if t <= before or t >= plan.groups[group].high:
                break
            if n < len(out):
                out[n] = t
            n += 1
    return n


@kernel
def find_all(plan, out):
    """Write the chords of all elements to `out`, those of x before those of y of each.

    Their numbers are written to the frames. What has no room is only counted.
    """
    n = np.int64(0)
    for index in range(len(plan.frames)):
        element = plan.field.elements[index]
        kind = plan.field.kinds[element.kind]
        axis_x, axis_y = plan.axes[element.kind, 0], plan.axes[element.kind, 1]
        plan.frames[index].chord = np.uint32(n)
        if not plan.frames[index].drawn or element.scale == 0.0:
            continue
        begin = n
        product = kind.combine == PRODUCT
        # what has children has their edges in it
        lone = element.grid == 0 and (product or kind.combine == SUM)
        if kind.combine == RADIAL:
            if axis_x.ringed:
                n = find_chords(plan, np.int64(index), False, 1.0, out, n)
        elif axis_x.steep or (lone and axis_y.level and not axis_x.linear):
            other = axis_y.most if product else 1.0
            n = find_chords(plan, np.int64(index), False, other, out, n)
        plan.frames[index].chords_x = np.uint32(n - begin)
        begin = n
        if kind.combine != RADIAL and (
            axis_y.steep or (lone and axis_x.level and not axis_y.linear)
        ):
            other = axis_x.most if product else 1.0
            n = find_chords(plan, np.int64(index), True, other, out, n)
        plan.frames[index].chords_y = np.uint32(n - begin)
    return n


def chords_of(plan: Plan) -> NDArray[np.float64]:
    """Where chords of all elements end, in t, (n,); the frames tell which are whose."""
    out = np.empty(find_all(plan, np.empty(0)))
    find_all(plan, out)
    return out
