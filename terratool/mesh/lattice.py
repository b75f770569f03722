"""Kernels on the lattice of vertices: which side of an edge, how thin, what lies next to what."""

from __future__ import annotations

import math

import numpy as np

from terratool.field.primitives import device, kernel


@device
def area(points, a, b, c):
    """Twice the signed area of a triangle, exactly: positive if it runs counter-clockwise."""
    ax, ay = points[a, 0], points[a, 1]
    return (points[b, 0] - ax) * (points[c, 1] - ay) - (points[b, 1] - ay) * (points[c, 0] - ax)


@device
def length(points, a, b):
    """Distance of two vertices."""
    dx, dy = float(points[b, 0] - points[a, 0]), float(points[b, 1] - points[a, 1])
    return math.sqrt(dx * dx + dy * dy)


@kernel
def thinnest(points, triangles):
    """The smallest distance of a corner from the longest side of its triangle, in points."""
    least = np.inf
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        longest = max(length(points, a, b), length(points, b, c), length(points, c, a))
        twice = float(area(points, a, b, c))
        least = min(least, twice / longest if longest > 0.0 else 0.0)
    return least


@kernel
def find_thin(points, triangles, near, out):
    """Write triangles lower than `near` into `out`, (n, 3): their longest side, then the corner.

    Returns their number; what has no room is only counted.
    """
    n = 0
    for t in range(len(triangles)):
        for k in range(3):
            a, b = triangles[t, k], triangles[t, (k + 1) % 3]
            c = triangles[t, (k + 2) % 3]
            long = length(points, a, b)
            if long < length(points, b, c) or long < length(points, c, a):
                continue
            if float(area(points, a, b, c)) < near * long:
                if n < len(out):
                    out[n, 0], out[n, 1], out[n, 2] = a, b, c
                n += 1
            break
    return n


@device
def _rank(points, p, limits):
    """How many of the limits of the rectangle a vertex lies on."""
    x, y = points[p, 0], points[p, 1]
    return int(x == limits[0] or x == limits[2]) + int(y == limits[1] or y == limits[3])


@kernel
def weld(points, roots, limits, seams, near):
    """For each vertex the one that it becomes, itself or one nearby; how many change.

    Args:
        points: (n, 2) int64, sorted by x, then y.
        roots: (n,) int64, each its own index; changed.
        limits: (4,) int64 west, south, east, north; vertices there stay there.
        seams: (4,) int64 those of the limits that are seams, others -1; their vertices stay.
        near: how far, along x and along y, is nearby.
    """
    count = 0
    for p in range(len(points)):
        for n in range(p + 1, len(points)):
            if points[n, 0] - points[p, 0] > near:
                break
            if n - p > 64:  # a long column of vertices: go on where they may be near
                low, high = n, len(points)
                for dx in range(near + 1):
                    low, high = p + 1, len(points)
                    x, y = points[p, 0] + dx, points[p, 1] - near
                    while low < high:
                        half = (low + high) >> 1
                        if points[half, 0] < x or (points[half, 0] == x and points[half, 1] < y):
                            low = half + 1
                        else:
                            high = half
                    while (
                        low < len(points)
                        and points[low, 0] == x
                        and points[low, 1] <= points[p, 1] + near
                    ):
                        count += _join(points, roots, p, low, limits, seams)
                        low += 1
                break
            if abs(points[n, 1] - points[p, 1]) <= near:
                count += _join(points, roots, p, n, limits, seams)
    for p in range(len(points)):
        while roots[p] != roots[roots[p]]:
            roots[p] = roots[roots[p]]
    return count


@device
def _join(points, roots, p, n, limits, seams):
    """Make two vertices one: that of a seam, that on more of the limits, or the first."""
    while roots[p] != p:
        p = roots[p]
    while roots[n] != n:
        n = roots[n]
    seam_p, seam_n = _rank(points, p, seams), _rank(points, n, seams)
    if p == n or (seam_p and seam_n):
        return 0
    if seam_n or (not seam_p and _rank(points, n, limits) > _rank(points, p, limits)):
        p, n = n, p
    roots[n] = p
    return 1
