"""Polygons become triangles: convex ones by a fan, others by cutting off ears.

An ear is a convex corner whose triangle holds no other corner (Meisters, Polygons have ears, 1975).
Only corners that are not convex can lie in one, and these are looked up in a grid of squares, so
that long polygons take about as many steps as they have corners.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

kernel = njit(cache=True, nogil=True, error_model="numpy")
device = njit(cache=True, nogil=True, error_model="numpy")

_GOOD, _CROSSED = range(2)

_FAR = 64
"""Corners without an ear after which the next one is looked for where the last one was."""


@device
def _cross(x, y, a, b, c):
    """Twice the area of a triangle; above 0 where it is seen counterclockwise."""
    return (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])


@device
def _apart(x, y, a, b):
    """The square of a distance."""
    return (x[a] - x[b]) ** 2 + (y[a] - y[b]) ** 2


@kernel
def _project(points, loop, count, x, y):
    """Lay a polygon into the plane in which it is largest, counterclockwise.

    Its normal is Newell's (Sutherland, Sproull, Schumacker, A characterization of ten
    hidden-surface algorithms, 1974). Returns whether it has an area.
    """
    base = points[loop[0]]
    normal = np.zeros(3)
    for n in range(count):
        a, b = points[loop[n]], points[loop[(n + 1) % count]]
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            normal[axis] += (a[u] - base[u]) * (b[v] - base[v]) - (a[v] - base[v]) * (
                b[u] - base[u]
            )
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    if normal[axis] < 0:
        u, v = v, u
    for n in range(count):
        x[n] = points[loop[n], u] - base[u]
        y[n] = points[loop[n], v] - base[v]
    return normal[axis] != 0


@kernel
def _is_convex(x, y, count):
    """Whether a polygon turns left at all its corners, and once around in all."""
    falls = 0
    for n in range(count):
        before, after = (n + count - 1) % count, (n + 1) % count
        if not _cross(x, y, before, n, after) > 0:
            return False
        # around a convex polygon x begins to fall but once
        falls += x[before] <= x[n] and x[n] > x[after]
    return falls == 1


@device
def _holds(x, y, a, b, c, p, closed):
    """Whether a triangle, with its sides or without, holds a point that is none of its corners."""
    for q in (a, b, c):
        if x[p] == x[q] and y[p] == y[q]:
            return False
    first, second = _cross(x, y, a, b, p), _cross(x, y, b, c, p)
    third = _cross(x, y, c, a, p)
    if closed:
        return first >= 0 and second >= 0 and third >= 0
    return first > 0 and second > 0 and third > 0


@kernel
def _ears(x, y, count, loop, out, at):
    """Cut a polygon that is seen counterclockwise; returns where `out` ends, and how it went."""
    before = np.arange(-1, count - 1)
    before[0] = count - 1
    after = np.arange(1, count + 1)
    after[count - 1] = 0
    # corners that are not convex, in a grid
    side = min(1024, max(1, int(math.sqrt(count) / 2)))
    west, south = x[:count].min(), y[:count].min()
    across = side / max(x[:count].max() - west, 1e-300)
    along = side / max(y[:count].max() - south, 1e-300)
    heads = np.full(side * side, -1)
    behind = np.full(count, -1)
    dents = np.zeros(count, np.bool_)
    left = 0
    for n in range(count):
        if not _cross(x, y, before[n], n, after[n]) > 0:
            dents[n] = True
            left += 1
            column = min(side - 1, int((x[n] - west) * across))
            cell = min(side - 1, int((y[n] - south) * along)) * side + column
            behind[n] = heads[cell]
            heads[cell] = n
    # without a dent, and not convex, it runs around more than once
    how = _GOOD if left else _CROSSED
    near = False
    level = 0  # 0: no corner in an ear or on its sides, 1: none in it, 2: any convex, 3: any
    tried, rest, n = 0, count, 0
    while rest > 3:
        a, c = before[n], after[n]
        ear = level == 3 or _cross(x, y, a, n, c) > 0
        if ear and level < 2 and left:
            low = max(0, int((min(x[a], x[n], x[c]) - west) * across))
            high = min(side - 1, int((max(x[a], x[n], x[c]) - west) * across))
            first = max(0, int((min(y[a], y[n], y[c]) - south) * along))
            last = min(side - 1, int((max(y[a], y[n], y[c]) - south) * along))
            for row in range(first, last + 1):
                for column in range(low, high + 1):
                    p = heads[row * side + column]
                    while p >= 0 and ear:
                        if dents[p] and p not in (a, n, c):
                            ear = not _holds(x, y, a, n, c, p, level == 0)
                        p = behind[p]
                if not ear:
                    break
        if not ear:
            n = c
            tried += 1
            if tried == rest:
                level += 1
                tried = 0
                if level == 2:
                    how = _CROSSED
            continue
        out[at, 0], out[at, 1], out[at, 2] = loop[a], loop[n], loop[c]
        at += 1
        after[a], before[c] = c, a
        rest -= 1
        near = near or tried > _FAR
        tried = 0
        left -= dents[n]
        dents[n] = False
        for p in (a, c):
            if dents[p] and _cross(x, y, before[p], p, after[p]) > 0:
                dents[p] = False
                left -= 1
        # every other corner first makes better triangles; but few ears are found beside the last
        if near:
            p, q = before[a], after[c]
            n = a if _apart(x, y, p, c) <= _apart(x, y, a, q) else c
        else:
            n = after[c]
    a, c = before[n], after[n]
    area = _cross(x, y, a, n, c)
    if area < 0:
        how = _CROSSED
    if area != 0:
        out[at, 0], out[at, 1], out[at, 2] = loop[a], loop[n], loop[c]
        at += 1
    return at, how


@kernel
def _triangles(points, indices, out):
    """Triangles of all polygons; returns how many, and counts of polygons (see `triangulate`)."""
    size = len(indices)
    longest, length = 0, 0
    for n in range(size):
        length = 0 if indices[n] < 0 else length + 1
        longest = max(longest, length)
    loop = np.empty(longest, np.int32)
    x, y = np.empty(longest), np.empty(longest)
    at, flat, crossed, count = 0, 0, 0, 0
    for n in range(size + 1):
        if n < size and indices[n] >= 0:
            if count == 0 or loop[count - 1] != indices[n]:
                loop[count] = indices[n]
                count += 1
            continue
        if n == size and (size == 0 or indices[n - 1] < 0):
            break
        while count > 1 and loop[count - 1] == loop[0]:
            count -= 1
        if count == 3:
            out[at] = loop[:3]
            at += 1
        elif count < 3 or not _project(points, loop, count, x, y):
            flat += 1
        elif _is_convex(x, y, count):
            for corner in range(1, count - 1):
                out[at, 0] = loop[0]
                out[at, 1] = loop[corner]
                out[at, 2] = loop[corner + 1]
                at += 1
        else:
            at, how = _ears(x, y, count, loop, out, at)
            crossed += how == _CROSSED
        count = 0
    return at, flat, crossed


def triangulate(
    points: NDArray[np.float64], indices: NDArray[np.int32]
) -> tuple[NDArray[np.int32], int, int]:
    """Triangles of polygons, wound as these are.

    Args:
        points: (n, 3) float64.
        indices: (m,) int32, corners of polygons, each but the last ended by an index below 0.

    Returns:
        Triangles (k, 3) int32; how many polygons were left out as they have no area; and how many
        cross themselves, so that their triangles overlap.
    """
    out = np.empty((len(indices), 3), np.int32)
    count, flat, crossed = _triangles(points, indices, out)
    return out[:count].copy(), flat, crossed
