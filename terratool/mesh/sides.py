"""Heights from one side: what a region's elements are worth at a point of it or of its rim.

At a wall the height has one value for each region that meets there. An element's curves are held to
the stretch between two vertical steps that the region lies in, its u and v to the footprint.
"""

from __future__ import annotations

import math

import numpy as np

from terratool.field.primitives import (
    FOUR,
    MIN,
    PRODUCT,
    RADIAL,
    SUM,
    device,
    find_piece,
    kernel,
    piece_value,
    turned,
)

NEAR = 6.0
"""So many points of the lattice beside a rim or a step a vertex is on it: it was rounded."""


@device
def gauge(u, v, corners):
    """Distance of (u, v) from the middle in radii of the polygon that stands for a disc.

    It is 1 on the whole polygon. The height is that of the cone over the polygon, so that rings of
    edges stay level and a disc that ends at 0 meets the ground without a gap.
    """
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    rho = math.sqrt(a * a + b * b)
    half = math.pi / corners
    angle = math.atan2(b, a)
    angle -= 2.0 * half * math.floor(angle / (2.0 * half))  # within its sector
    return rho * math.cos(angle - half) / math.cos(half)


@device
def sector(u, v, corners):
    """Which of the triangles between the middle and the sides of a disc's polygon holds (u, v)."""
    angle = math.atan2(2.0 * v - 1.0, 2.0 * u - 1.0)
    return np.int64(math.floor(angle * corners / (2.0 * math.pi)))


@device
def faceted(kind, axis_x, element):
    """Whether a disc is drawn as a pyramid: its curve is made of straight pieces."""
    straight = axis_x.linear and not axis_x.level
    return kind.combine == RADIAL and straight and element.scale != 0.0


@device
def piece_at(plan, kind, on_y, group, t):
    """The piece of a curve that holds `t` in a group: its index, its row, and the place in it."""
    limits = plan.groups[group]
    if on_y:
        knotted, first, count, last = kind.knotted_y, kind.y_first, kind.y_count, kind.y_last
        knot, bin_ = kind.y_knot, kind.y_bin
    else:
        knotted, first, count, last = kind.knotted_x, kind.x_first, kind.x_count, kind.x_last
        knot, bin_ = kind.x_knot, kind.x_bin
    if knotted:
        i = find_piece(plan.field.curves, knot, bin_, last, t)
        i = min(max(i, limits.first), limits.last)
        s = t - plan.field.curves.knots[np.int64(knot) + i]
    else:
        i = min(max(np.int64(t * count), limits.first), limits.last)
        s = t * count - i
    return i, (np.uint64(first) + np.uint64(i)) * FOUR, s


@device
def held(plan, group, t, near):
    """`t` within a group; what is `near` to one of its ends is there."""
    limits = plan.groups[group]
    if t < limits.low + near:
        t = limits.low
    if t > limits.high - near:
        t = limits.high
    return t


@device
def curve_at(plan, kind, on_y, group, t, near):
    """Value of a curve of a kind at `t`, within the group with the index `group`."""
    _, row, s = piece_at(plan, kind, on_y, group, held(plan, group, t, near))
    return piece_value(plan.field.curves.pieces, row, s)


@device
def place(plan, index, x, y):
    """Position (u, v) in an element's primitive of a point on the lattice."""
    element = plan.field.elements[index]
    frame = plan.frames[index]
    pose = plan.field.poses[element.pose]
    u, v = (x - frame.west) * frame.per_x, (y - frame.south) * frame.per_y
    if pose.turned:
        u, v = turned(pose, u, v)
    return u, v


@device
def worth(plan, cover, u, v):
    """What an element adds to the height at (u, v), as it does in the region of the cover."""
    element = plan.field.elements[cover.element]
    kind = plan.field.kinds[element.kind]
    frame = plan.frames[cover.element]
    near = NEAR * max(frame.per_x, frame.per_y)
    if kind.combine == RADIAL:
        t = 0.5 + 0.5 * gauge(u, v, frame.corners)
        if t <= frame.rim:
            value = curve_at(plan, kind, False, cover.group_x, t, near)
        else:
            value = curve_at(plan, kind, False, cover.group_x, 1.0, near)
            before = curve_at(plan, kind, False, cover.group_x, frame.rim, near)
            value -= (value - before) * (1.0 - min(t, 1.0)) / (1.0 - frame.rim)
        return element.scale * value + element.offset
    fx = curve_at(plan, kind, False, cover.group_x, u, near)
    fy = curve_at(plan, kind, True, cover.group_y, v, near)
    if kind.combine == PRODUCT:
        value = fx * fy
    elif kind.combine == SUM:
        value = fx + fy
    else:
        value = min(fx, fy) if kind.combine == MIN else max(fx, fy)
    return element.scale * value + element.offset


@kernel
def height_in(plan, regions, region, x, y):
    """Height of a region at a point of it, or of its rim, on the lattice."""
    z = 0.0
    for k in range(regions.offsets[region], regions.offsets[region + 1]):
        cover = regions.covers[k]
        u, v = place(plan, cover.element, x, y)
        z += worth(plan, cover, u, v)
    return z - regions.drops[region]


@kernel
def corner_heights(plan, regions, points, triangles, of, out):
    """Heights of triangles at their corners, each from its own side.

    Args:
        plan: the plan.
        regions: its regions.
        points: (n, 2) int64 on the lattice.
        triangles: (m, 3) indices of points.
        of: (m,) index of each triangle's region.
        out: (m, 3) float64.
    """
    for t in range(len(triangles)):
        for c in range(3):
            p = triangles[t, c]
            out[t, c] = height_in(plan, regions, of[t], float(points[p, 0]), float(points[p, 1]))
