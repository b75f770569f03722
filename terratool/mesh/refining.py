"""Kernels that refine triangles until they are near enough to the heights of their regions.

Edges between regions are split but never turned; others are turned where that makes the triangles
rounder. Which side of an edge a vertex lies on is known exactly: no triangle ever has no area.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.primitives import device, kernel
from terratool.mesh.lattice import area, length
from terratool.mesh.missing import largest_miss
from terratool.mesh.sides import height_in

_THIN = 0.01
"""A triangle is thin if twice its area is less than this, in squares of its longest side."""
_RIM = 0.05
"""A place this near to a side, in heights of the triangle, is not inserted but the side split."""
_SHORTEST = 64.0
"""Sides shorter than so many points of the lattice are not split."""
_PATH = 1000
"""So many triangles further on at most is an edge split so that none becomes too thin."""
_LEAST = 0.25
"""This part of the error is left for triangles where many polygons that stand for discs meet."""
_LOWEST, _ANY = 2.0, 0.0
"""No triangle is made that is lower than so many points; where nothing else helps, of any area."""


class Parts(NamedTuple):
    """Triangles that change; each array has room for more.

    Attributes:
        points: (n, 2) int64 on the lattice.
        triangles: (m, 3) int32.
        neighbours: (m, 3) int32.
        of: (m,) int32, region of each triangle.
        heights: (m, 3) float64, of its corners, each from its own side.
        queue: (m,) int32, triangles to look at, round and round.
        queued: (m,) uint8, whether a triangle is in the queue.
        counts: (4,) int64, points, triangles, queued ones, and where in the queue the first is.
        checks: (n,) int32, scratch: triangles with an edge that may be turned.
        spots: (c, 6) float64, scratch: where corners are in each of the covers of a region.
        nodes: (n, 10) float64, scratch: parts of a triangle that are still to be looked into.
        largest: (1,) float64, the largest error that triangles may have.
        locked: (4,) int64 x, y, x, y of sides whose edges stay as they are; -1 for none.
    """

    points: NDArray[np.int64]
    triangles: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    of: NDArray[np.int32]
    heights: NDArray[np.float64]
    queue: NDArray[np.int32]
    queued: NDArray[np.uint8]
    counts: NDArray[np.int64]
    checks: NDArray[np.int32]
    spots: NDArray[np.float64]
    nodes: NDArray[np.float64]
    largest: NDArray[np.float64]
    locked: NDArray[np.int64]


@device
def is_locked(parts, t, e):
    """Whether an edge lies on a seam, where the tile beyond has the same edge."""
    if parts.neighbours[t, e] >= 0:
        return False
    points, a, b = parts.points, parts.triangles[t, e], parts.triangles[t, (e + 1) % 3]
    for side in range(4):
        if points[a, side % 2] == parts.locked[side] == points[b, side % 2]:
            return True
    return False


@device
def enqueue(parts, t):
    """Have a triangle looked at, again."""
    if not parts.queued[t]:
        parts.queued[t] = 1
        at = parts.counts[3] + parts.counts[2]
        if at >= len(parts.queue):
            at -= len(parts.queue)
        parts.queue[at] = t
        parts.counts[2] += 1


@device
def edge_of(parts, t, other):
    """Which edge of a triangle leads to another."""
    e = 0
    while parts.neighbours[t, e] != other:
        e += 1
    return e


@device
def write(parts, t, region, a, b, c, za, zb, zc, nab, nbc, nca):
    """Set a triangle."""
    parts.triangles[t, 0], parts.triangles[t, 1], parts.triangles[t, 2] = a, b, c
    parts.heights[t, 0], parts.heights[t, 1], parts.heights[t, 2] = za, zb, zc
    parts.neighbours[t, 0], parts.neighbours[t, 1], parts.neighbours[t, 2] = nab, nbc, nca
    parts.of[t] = region
    enqueue(parts, t)


@device
def relink(parts, t, old, new):
    """Tell a triangle that beyond one of its edges there is another one now."""
    if t >= 0:
        parts.neighbours[t, edge_of(parts, t, old)] = new


@device
def low(points, a, b, c, least=_LOWEST):
    """Whether a triangle would be lower than is allowed, have no area, or be turned over."""
    longest = max(length(points, a, b), length(points, b, c), length(points, c, a))
    twice = area(points, a, b, c)
    return twice <= 0 or float(twice) < least * longest


@device
def corners_of(parts, t, e):
    """Corners, heights and neighbours of a triangle, beginning with edge `e`."""
    f, g = (e + 1) % 3, (e + 2) % 3
    tri, z, n = parts.triangles, parts.heights, parts.neighbours
    return (
        tri[t, e], tri[t, f], tri[t, g], z[t, e], z[t, f], z[t, g], n[t, e], n[t, f], n[t, g],
    )  # fmt: skip


@kernel
def split_inside(parts, t, z):
    """Put the newest point into a triangle, if none becomes too low. Returns whether it was."""
    p = np.int32(parts.counts[0])
    points = parts.points
    a, b, c, za, zb, zc, nab, nbc, nca = corners_of(parts, t, 0)
    if low(points, a, b, p) or low(points, b, c, p) or low(points, c, a, p):
        return False
    one = np.int32(parts.counts[1])
    two = one + np.int32(1)
    parts.counts[0] += 1
    parts.counts[1] += 2
    region = parts.of[t]
    write(parts, t, region, a, b, p, za, zb, z, nab, one, two)
    write(parts, one, region, b, c, p, zb, zc, z, nbc, two, t)
    write(parts, two, region, c, a, p, zc, za, z, nca, t, one)
    relink(parts, nbc, t, one)
    relink(parts, nca, t, two)
    settle_edges(parts, t, one, two, np.int32(-1), p)
    return True


@kernel
def split_edge(parts, t, e, z, z_beyond, least=_LOWEST):
    """Put the newest point on an edge, if no triangle becomes too low. Returns whether it was.

    `z` is its height in the region of `t`, `z_beyond` in that of the neighbour.
    """
    p = np.int32(parts.counts[0])
    points = parts.points
    a, b, c, za, zb, zc, other, nbc, nca = corners_of(parts, t, e)
    if low(points, a, p, c, least) or low(points, p, b, c, least):
        return False
    k = 0
    if other >= 0:
        k = edge_of(parts, other, t)
        d = parts.triangles[other, (k + 2) % 3]
        if low(points, b, p, d, least) or low(points, p, a, d, least):
            return False
    elif area(points, a, b, p) != 0 or is_locked(parts, t, e):  # the rim is straight
        return False
    one = np.int32(parts.counts[1])
    two = np.int32(-1)
    region = parts.of[t]
    parts.counts[0] += 1
    parts.counts[1] += 1
    if other >= 0:
        two = one + np.int32(1)
        parts.counts[1] += 1
        b, a, d, zb_, za_, zd, _, nad, ndb = corners_of(parts, other, k)
        beyond = parts.of[other]
        # other keeps b-p-d, two gets p-a-d
        write(parts, other, beyond, b, p, d, zb_, z_beyond, zd, one, two, ndb)
        write(parts, two, beyond, p, a, d, z_beyond, za_, zd, t, nad, other)
        relink(parts, nad, other, two)
    # t keeps a-p-c, one gets p-b-c
    write(parts, t, region, a, p, c, za, z, zc, two, one, nca)
    write(parts, one, region, p, b, c, z, zb, zc, other, nbc, t)
    relink(parts, nbc, t, one)
    settle_edges(parts, t, one, other, two, p)
    return True


@device
def is_round(points, a, b, c, d):
    """Whether d lies outside of the circle through a, b, c, or so nearly that it may."""
    ox, oy = points[d, 0], points[d, 1]
    ax, ay = float(points[a, 0] - ox), float(points[a, 1] - oy)
    bx, by = float(points[b, 0] - ox), float(points[b, 1] - oy)
    cx, cy = float(points[c, 0] - ox), float(points[c, 1] - oy)
    aa, bb, cc = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    one, two, three = aa * (bx * cy - by * cx), bb * (ax * cy - ay * cx), cc * (ax * by - ay * bx)
    return one - two + three <= 1e-9 * (abs(one) + abs(two) + abs(three))


@kernel
def settle_edges(parts, t0, t1, t2, t3, p):
    """Turn edges opposite to a new point until all are as round as they may be."""
    points, checks = parts.points, parts.checks
    checks[0], checks[1], checks[2], checks[3] = t0, t1, t2, t3
    n = 4
    while n:
        n -= 1
        t = checks[n]
        if t < 0:
            continue
        e = 0
        while e < 3 and parts.triangles[t, (e + 2) % 3] != p:
            e += 1
        if e == 3:
            continue
        a, b, c, za, zb, zc, other, nbc, nca = corners_of(parts, t, e)
        if other < 0 or parts.of[other] != parts.of[t]:
            continue
        k = edge_of(parts, other, t)
        _, _, d, _, _, zd, _, nad, ndb = corners_of(parts, other, k)
        if is_round(points, a, b, c, d):
            continue
        if low(points, a, d, c) or low(points, d, b, c):
            continue
        region = parts.of[t]
        write(parts, t, region, a, d, c, za, zd, zc, nad, other, nca)
        write(parts, other, region, d, b, c, zd, zb, zc, ndb, nbc, t)
        relink(parts, nad, other, t)
        relink(parts, nbc, t, other)
        if n + 2 <= len(checks):
            checks[n], checks[n + 1] = t, other
            n += 2


@kernel
def split_at(plan, regions, parts, t, e, share, least=_LOWEST):
    """Split an edge at a share of it."""
    points = parts.points
    a, b = parts.triangles[t, e], parts.triangles[t, (e + 1) % 3]
    if length(points, a, b) < _SHORTEST:
        return False
    p = parts.counts[0]
    x = points[a, 0] + np.int64(np.rint(share * float(points[b, 0] - points[a, 0])))
    y = points[a, 1] + np.int64(np.rint(share * float(points[b, 1] - points[a, 1])))
    points[p, 0], points[p, 1] = x, y
    z = height_in(plan, regions, parts.of[t], float(x), float(y))
    beyond = parts.neighbours[t, e]
    z_beyond = z
    if beyond >= 0 and parts.of[beyond] != parts.of[t]:
        z_beyond = height_in(plan, regions, parts.of[beyond], float(x), float(y))
    return split_edge(parts, t, e, z, z_beyond, least)


@device
def longest_of(parts, t, free=False):
    """The longest edge of a triangle, and its length; if `free`, of those not on a seam."""
    points, tri = parts.points, parts.triangles
    edge, long = 0, 0.0
    for e in range(3):
        own = length(points, tri[t, e], tri[t, (e + 1) % 3])
        if own > long and not (free and is_locked(parts, t, e)):
            edge, long = e, own
    return edge, long


@kernel
def bisect(plan, regions, parts, t):
    """Split the longest edge of a triangle, or first that of the neighbours that are longer.

    To split an edge beside a triangle whose longest edge is another makes it ever thinner (Rivara,
    1997: the longest edge propagation path ends at an edge that is the longest of both its sides).
    """
    start = t
    for _ in range(_PATH):
        e, long = longest_of(parts, t)
        beyond = parts.neighbours[t, e]
        if beyond < 0:
            break
        k, other = longest_of(parts, beyond)
        if other <= long or parts.neighbours[beyond, k] == t:
            break
        if is_locked(parts, beyond, k):  # what lies beside a seam would become ever flatter
            t = start
            break
        t = beyond
    e, _ = longest_of(parts, t, True)
    done = split_at(plan, regions, parts, t, e, 0.5)
    if not done and t != start:  # something too low lies there
        e, _ = longest_of(parts, start, True)
        done = split_at(plan, regions, parts, start, e, 0.5)
    if done:
        enqueue(parts, start)
    return done


@device
def is_thin(parts, t):
    """Whether a triangle is better split across its longest edge than inside."""
    tri = parts.triangles
    _, long = longest_of(parts, t)
    return float(area(parts.points, tri[t, 0], tri[t, 1], tri[t, 2])) < _THIN * long**2


@device
def improve(plan, regions, parts, t, s, r):
    """Insert a point in a triangle, at or near the place with shares s and r of b and c."""
    points = parts.points
    a, b, c = parts.triangles[t, 0], parts.triangles[t, 1], parts.triangles[t, 2]
    q = 1.0 - s - r
    e = 0 if r <= min(q, s) else (1 if q <= min(s, r) else 2)
    first, second = (q, s) if e == 0 else ((s, r) if e == 1 else (r, q))
    share = second / (first + second) if first + second > 0.0 else 0.5
    share = min(max(share, 0.25), 0.75)
    if not is_thin(parts, t):
        if min(q, s, r) > _RIM:
            p = parts.counts[0]
            x = np.rint(q * points[a, 0] + s * points[b, 0] + r * points[c, 0])
            y = np.rint(q * points[a, 1] + s * points[b, 1] + r * points[c, 1])
            points[p, 0], points[p, 1] = np.int64(x), np.int64(y)
            if split_inside(parts, t, height_in(plan, regions, parts.of[t], x, y)):
                return True
        beyond = parts.neighbours[t, e]
        blunt = beyond < 0 or not is_thin(parts, beyond)
        if blunt and split_at(plan, regions, parts, t, e, share):
            return True
    if bisect(plan, regions, parts, t):
        return True
    # something beside it is too low to be split, but the error counts for more
    return split_at(plan, regions, parts, t, e, share, _ANY)


@kernel
def refine(plan, regions, parts, allowed):
    """Refine all triangles in the queue to an error; false if there is no more room."""
    counts = parts.counts
    while counts[2]:
        if counts[0] >= len(parts.points) or counts[1] + 2 > len(parts.triangles):
            return False
        # the oldest first: what is coarse before what is fine
        t = parts.queue[counts[3]]
        counts[2] -= 1
        counts[3] = counts[3] + 1 if counts[3] + 1 < len(parts.queue) else 0
        parts.queued[t] = 0
        region = parts.of[t]
        if regions.plane[region] or regions.voids[region]:
            continue
        aside = regions.asides[region]
        enough = max(allowed - aside, _LEAST * allowed)
        error, s, r = largest_miss(plan, regions, parts, t, enough)
        if error <= enough or not improve(plan, regions, parts, t, s, r):
            parts.largest[0] = max(parts.largest[0], error + aside)
    return True


@kernel
def part_crossings(plan, regions, parts, tolerance, begin):
    """Split edges where the higher side changes, with one height for both sides.

    Returns the first triangle that was not looked at for want of room.
    """
    points, counts = parts.points, parts.counts
    t = begin
    while t < counts[1]:
        if counts[0] >= len(points) or counts[1] + 2 > len(parts.triangles):
            return t
        split = False
        for e in range(3):
            a, b, _, za, zb, _, other, _, _ = corners_of(parts, t, e)
            if other < t or regions.voids[parts.of[t]] or regions.voids[parts.of[other]]:
                continue
            k = edge_of(parts, other, t)
            rise_a = za - parts.heights[other, (k + 1) % 3]
            rise_b = zb - parts.heights[other, k]
            if min(rise_a, rise_b) >= -tolerance or max(rise_a, rise_b) <= tolerance:
                continue
            low_share, high_share = 0.0, 1.0
            x0, y0 = float(points[a, 0]), float(points[a, 1])
            dx, dy = float(points[b, 0]) - x0, float(points[b, 1]) - y0
            for _ in range(40):
                share = 0.5 * (low_share + high_share)
                x, y = x0 + share * dx, y0 + share * dy
                rise = height_in(plan, regions, parts.of[t], x, y)
                rise -= height_in(plan, regions, parts.of[other], x, y)
                if (rise > 0.0) == (rise_a > 0.0):
                    low_share = share
                else:
                    high_share = share
            x, y = np.rint(x0 + low_share * dx), np.rint(y0 + low_share * dy)
            points[counts[0], 0], points[counts[0], 1] = np.int64(x), np.int64(y)
            z = height_in(plan, regions, parts.of[t], x, y)
            z = 0.5 * (z + height_in(plan, regions, parts.of[other], x, y))
            if split_edge(parts, np.int32(t), e, z, z):
                split = True
                break
        if not split:
            t += 1
    return t
