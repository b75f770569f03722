"""Kernels for the heights along a seam: as many vertices as the chords between them need."""

from __future__ import annotations

import numpy as np

from terratool.field.primitives import device, kernel
from terratool.mesh.sides import height_in

SHORTEST = 64
"""Edges of seams are no shorter than so many points of the lattice, where heights need them."""
SHARE = 0.45
"""Chords miss by no more than this part of the error; triangles beside them have the rest."""
FINE, TARGET = 10, 0.9
"""A triangle beside a seam is tested at so many places a side; it may miss by this part of the
error."""
TESTED = 64
"""A chord is tested at the ends of so many parts of it."""


@device
def height_at(plan, regions, region, axis, at, place):
    """Height of a region at a place of a seam."""
    if axis:
        return height_in(plan, regions, region, place, float(at))
    return height_in(plan, regions, region, float(at), place)


@device
def is_bent(plan, regions, region, axis, at, begin, end, low, high):
    """Whether a triangle over an edge, half as high as it is long, is too far off on some side.

    Triangles beside the seam would want to be shorter than the edge.
    """
    half = 0.5 * (end - begin)
    for side in range(-1, 2, 2):
        top = height_at(plan, regions, region, axis, at + side * half, begin + half)
        for i in range(FINE):
            for j in range(1, FINE - i):
                s, r = i / FINE, j / FINE
                place = begin + s * (end - begin) + r * half
                z = height_at(plan, regions, region, axis, at + side * r * half, place)
                if abs(z - (low + s * (high - low) + r * (top - low))) > TARGET * plan.error:
                    return True
    return False


@device
def misses(plan, regions, region, axis, at, begin, end, low, high):
    """Whether the chord between two places with heights `low` and `high` is too far off."""
    for k in range(1, TESTED):
        share = k / TESTED
        z = height_at(plan, regions, region, axis, at, begin + share * (end - begin))
        if abs(z - (low + share * (high - low))) > SHARE * plan.error:
            return True
    return False


@kernel
def follow(plan, regions, of, axis, at, passes, beside, stack, ends, heights):
    """Edges along a seam; returns their number. What has no room is only counted.

    Args:
        plan: the plan.
        regions: those along the seam.
        of: (n - 1,) int32, which of them lies in each stretch.
        axis: 0 if x is the same all along, 1 if y is.
        at: this x or y.
        passes: (n,) int64, where the stretches begin and end.
        beside: (n,) float64, how far from each no vertices are.
        stack: (64, 2) float64, scratch.
        ends: (m,) int64, gets the place where each edge ends.
        heights: (m, 2) float64, gets the heights where it begins and ends.
    """
    n = 0
    for k in range(len(passes) - 1):
        region = of[k]
        void = regions.voids[region]
        begin = float(passes[k])
        low = 0.0 if void else height_at(plan, regions, region, axis, at, begin)
        lowest, highest = begin + beside[k], float(passes[k + 1]) - beside[k + 1]
        stack[0, 0] = float(passes[k + 1])
        stack[0, 1] = 0.0 if void else height_at(plan, regions, region, axis, at, stack[0, 0])
        pending = 1
        while pending:
            end, high = stack[pending - 1, 0], stack[pending - 1, 1]
            middle = np.rint(0.5 * (begin + end))
            if (
                not (void or regions.plane[region])
                and end - begin >= 2 * SHORTEST
                and lowest <= middle <= highest
                and pending < len(stack)
                and (
                    misses(plan, regions, region, axis, at, begin, end, low, high)
                    or is_bent(plan, regions, region, axis, at, begin, end, low, high)
                )
            ):
                stack[pending, 0] = middle
                stack[pending, 1] = height_at(plan, regions, region, axis, at, middle)
                pending += 1
                continue
            if n < len(ends):
                ends[n], heights[n, 0], heights[n, 1] = np.int64(end), low, high
            n += 1
            begin, low = end, high
            pending -= 1
    return n
