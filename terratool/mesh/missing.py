"""How far a triangle is from the heights of its region: by branch and bound, for certain.

A triangle is quartered where the bounds do not yet show that it is near enough. So the
largest error is found with few heights, and what is accepted holds everywhere, not only where it
was tested.
"""

from __future__ import annotations

import numpy as np

from terratool.field.primitives import device, kernel
from terratool.mesh.bounds import miss
from terratool.mesh.sides import place, worth

DEEPEST = 6
"""A triangle is quartered so often at most."""
COARSE = 3
"""As often where it is known already that it is too far off."""
_ENOUGH = 1.0
"""The place of the largest error is known well enough where no other error is this much larger."""


@device
def height_at(plan, regions, region, spots, s, r):
    """Height of a region in a triangle, with shares s and r of the corners b and c."""
    z = 0.0
    begin = regions.offsets[region]
    q = 1.0 - s - r
    for k in range(regions.offsets[region + 1] - begin):
        u = q * spots[k, 0] + s * spots[k, 2] + r * spots[k, 4]
        v = q * spots[k, 1] + s * spots[k, 3] + r * spots[k, 5]
        z += worth(plan, regions.covers[begin + k], u, v)
    return z - regions.drops[region]


@device
def bound(plan, regions, region, spots, node, enough):
    """How far a region is from a part of a triangle with its corners on it; inf beyond `enough`."""
    total = 0.0
    begin = regions.offsets[region]
    s0, r0, s1, r1, s2, r2 = node[0], node[1], node[2], node[3], node[4], node[5]
    q0, q1, q2 = 1.0 - s0 - r0, 1.0 - s1 - r1, 1.0 - s2 - r2
    for k in range(regions.offsets[region + 1] - begin):
        ua, va, ub, vb, uc, vc = (
            spots[k, 0], spots[k, 1], spots[k, 2], spots[k, 3], spots[k, 4], spots[k, 5],
        )  # fmt: skip
        total += miss(
            plan, regions.covers[begin + k],
            q0 * ua + s0 * ub + r0 * uc, q0 * va + s0 * vb + r0 * vc,
            q1 * ua + s1 * ub + r1 * uc, q1 * va + s1 * vb + r1 * vc,
            q2 * ua + s2 * ub + r2 * uc, q2 * va + s2 * vb + r2 * vc,
        )  # fmt: skip
        if total > enough:
            return np.inf
    return total


@kernel
def largest_miss(plan, regions, parts, t, enough):
    """How far a triangle is from its region, and where: shares of its corners b and c.

    If the answer is at most `enough`, nothing in the triangle is farther. Otherwise it is an error
    found there, or a bound that no finer look brought below `enough`.
    """
    spots, nodes, region = parts.spots, parts.nodes, parts.of[t]
    begin = regions.offsets[region]
    for k in range(regions.offsets[region + 1] - begin):
        for c in range(3):
            p = parts.triangles[t, c]
            x, y = float(parts.points[p, 0]), float(parts.points[p, 1])
            u, v = place(plan, regions.covers[begin + k].element, x, y)
            spots[k, 2 * c], spots[k, 2 * c + 1] = u, v
    za, zb, zc = parts.heights[t, 0], parts.heights[t, 1], parts.heights[t, 2]
    nodes[0, :] = 0.0  # corners as shares, errors there, depth
    nodes[0, 2] = nodes[0, 5] = 1.0
    n = 1
    most = at_s = at_r = 0.0  # the largest error found
    sure = 0.0  # no less than all errors that were looked into
    doubt = doubt_s = doubt_r = 0.0  # the largest bound that was not
    while n:
        n -= 1
        node = nodes[n]
        depth = node[9]
        own = max(abs(node[6]), abs(node[7]), abs(node[8]))
        need = max(enough, _ENOUGH * most)
        error = own + bound(plan, regions, region, spots, node, need - own)
        if error <= need:
            sure = max(sure, error)
            continue
        if depth >= (COARSE if most > enough else DEEPEST):
            error = own + bound(plan, regions, region, spots, node, np.inf)
            if error > doubt:
                doubt = error
                doubt_s = (node[0] + node[2] + node[4]) / 3.0
                doubt_r = (node[1] + node[3] + node[5]) / 3.0
            continue
        s0, r0, s1, r1, s2, r2 = node[0], node[1], node[2], node[3], node[4], node[5]
        e0, e1, e2 = node[6], node[7], node[8]
        s01, r01 = 0.5 * (s0 + s1), 0.5 * (r0 + r1)
        s12, r12 = 0.5 * (s1 + s2), 0.5 * (r1 + r2)
        s20, r20 = 0.5 * (s2 + s0), 0.5 * (r2 + r0)
        e01 = height_at(plan, regions, region, spots, s01, r01)
        e01 -= za + s01 * (zb - za) + r01 * (zc - za)
        e12 = height_at(plan, regions, region, spots, s12, r12)
        e12 -= za + s12 * (zb - za) + r12 * (zc - za)
        e20 = height_at(plan, regions, region, spots, s20, r20)
        e20 -= za + s20 * (zb - za) + r20 * (zc - za)
        if abs(e01) > most:
            most, at_s, at_r = abs(e01), s01, r01
        if abs(e12) > most:
            most, at_s, at_r = abs(e12), s12, r12
        if abs(e20) > most:
            most, at_s, at_r = abs(e20), s20, r20
        n = push(nodes, n, depth, s0, r0, s01, r01, s20, r20, e0, e01, e20)
        n = push(nodes, n, depth, s01, r01, s1, r1, s12, r12, e01, e1, e12)
        n = push(nodes, n, depth, s20, r20, s12, r12, s2, r2, e20, e12, e2)
        n = push(nodes, n, depth, s12, r12, s20, r20, s01, r01, e12, e20, e01)
    if most > enough:
        return most, at_s, at_r
    if doubt > 0.0:
        return doubt, doubt_s, doubt_r
    return sure, at_s, at_r


@device
def push(nodes, n, depth, s0, r0, s1, r1, s2, r2, e0, e1, e2):
    """Put a quarter on the stack; returns the number of those on it."""
    node = nodes[n]
    node[0], node[1], node[2], node[3], node[4], node[5] = s0, r0, s1, r1, s2, r2
    node[6], node[7], node[8], node[9] = e0, e1, e2, depth + 1.0
    return n + 1
