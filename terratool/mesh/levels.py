"""Kernels for walls: the levels at each vertex, and the strips between them."""

from __future__ import annotations

from terratool.field.primitives import device, kernel


@kernel
def find_levels(
    triangles, heights, solid, rims, base, tolerance, begins, room, levels, corners
):  # fmt: skip
    """Find the different heights at each vertex, ascending; returns the most that one is moved.

    Args:
        triangles: (m, 3) indices of vertices in the plane.
        heights: (m, 3) float64, one-sided heights at their corners.
        solid: (m,) bool, whether there is ground.
        rims: (n,) bool, where the base is a level, too: along the rim of what is solid.
        base: height of the base, below all others.
        tolerance: heights that differ by no more are one.
        begins: (n + 1,) int64; gets the index of each vertex's first level, and their number.
        room: (n + 1,) int64; where in `levels` each vertex has room for one level per corner and
            the base.
        levels: (room[n],) float64; gets the levels without gaps.
        corners: (m, 3) int32; gets the level of each corner, -1 where there is no ground.
    """
    count = len(begins) - 1
    begins[:] = 0  # first the number of levels
    for p in range(count):
        if rims[p]:
            levels[room[p]] = base
            begins[p] = 1
    for t in range(len(triangles)):
        if not solid[t]:
            continue
        for c in range(3):
            p, z = triangles[t, c], heights[t, c]
            at = first = room[p]
            end = first + begins[p]
            while at < end and levels[at] < z:
                at += 1
            if at < end and levels[at] == z:
                continue
            for k in range(end, at, -1):
                levels[k] = levels[k - 1]
            levels[at] = z
            begins[p] += 1
    for p in range(count):
        last = room[p]  # the lowest of those near to each other stands for all, in any order
        for k in range(room[p] + 1, room[p] + begins[p]):
            base_below = rims[p] and last == room[p]
            if base_below or levels[k] - levels[last] > tolerance:
                last += 1
                levels[last] = levels[k]
        if begins[p]:
            begins[p] = last + 1 - room[p]
    moved = 0.0
    for t in range(len(triangles)):
        for c in range(3):
            p, z = triangles[t, c], heights[t, c]
            if not solid[t]:
                corners[t, c] = -1
                continue
            best = room[p]
            for k in range(room[p], room[p] + begins[p]):
                if abs(levels[k] - z) < abs(levels[best] - z):
                    best = k
            corners[t, c] = best - room[p]
            moved = max(moved, abs(levels[best] - z))
    total = 0
    for p in range(count):
        own = begins[p]
        for k in range(own):
            levels[total + k] = levels[room[p] + k]
        begins[p] = total
        total += own
    begins[count] = total
    for t in range(len(triangles)):
        if solid[t]:
            for c in range(3):
                corners[t, c] += begins[triangles[t, c]]
    return moved


@device
def strip(low_p, high_p, low_q, high_q, levels, faces, n):
    """Append the wall between two chains of levels, seen from where p is to the left of q."""
    while low_p < high_p or low_q < high_q:
        up = low_q == high_q or (low_p < high_p and levels[low_p + 1] <= levels[low_q + 1])
        if n < len(faces):
            faces[n, 0], faces[n, 1] = low_p, low_q
            faces[n, 2] = low_p + 1 if up else low_q + 1
        if up:
            low_p += 1
        else:
            low_q += 1
        n += 1
    return n


@kernel
def raise_walls(neighbours, corners, levels, faces, owners):
    """Write the walls between triangles into `faces`, (n, 3) int32; returns their number.

    `owners` gets the triangle on the higher side of each. What has no room is only counted.
    """
    n = 0
    for t in range(len(neighbours)):
        for c in range(3):
            other = neighbours[t, c]
            if other < t or corners[t, 0] < 0 or corners[other, 0] < 0:
                continue
            e = 0
            while neighbours[other, e] != t:
                e += 1
            p, q = corners[t, c], corners[t, (c + 1) % 3]
            beyond_q, beyond_p = corners[other, e], corners[other, (e + 1) % 3]
            if p == beyond_p and q == beyond_q:
                continue
            before = n
            swap = -1  # from which face on the neighbour is the higher one, after all
            rise_p, rise_q = levels[p] - levels[beyond_p], levels[q] - levels[beyond_q]
            owner = t if rise_p + rise_q >= 0.0 else other
            if rise_p >= 0.0 and rise_q >= 0.0:
                n = strip(beyond_p, p, beyond_q, q, levels, faces, n)
            elif rise_p <= 0.0 and rise_q <= 0.0:
                n = strip(q, beyond_q, p, beyond_p, levels, faces, n)
            elif rise_p > 0.0:
                # the higher side changes within a few points of the lattice: closed all the same
                owner = t
                swap = n = strip(beyond_p, p, q, q, levels, faces, n)
                n = strip(q, beyond_q, beyond_p, beyond_p, levels, faces, n)
            else:
                owner = t
                swap = n = strip(p, p, beyond_q, q, levels, faces, n)
                n = strip(beyond_q, beyond_q, p, beyond_p, levels, faces, n)
            for k in range(before, min(n, len(owners))):
                owners[k] = owner if swap < 0 or k < swap else other
    return n


@kernel
def raise_skirt(triangles, corners, rim, begins, levels, faces, owners):
    """Write the walls from the base, the lowest level, up to the rim of the ground.

    Args:
        triangles: (m, 3) indices of vertices in the plane.
        corners: (m, 3) the level of each corner.
        rim: (k, 2) triangles, and which of their edges: there is no ground beyond.
        begins: (n + 1,) index of each vertex's first level.
        levels: heights of the levels.
        faces: (f, 3) int32; gets the faces, as far as it has room.
        owners: (f,) int32; gets the triangle above each.

    Returns:
        The number of faces.
    """
    n = 0
    for k in range(len(rim)):
        t, c = rim[k, 0], rim[k, 1]
        d = (c + 1) % 3
        before = n
        low_p, low_q = begins[triangles[t, c]], begins[triangles[t, d]]
        n = strip(low_p, corners[t, c], low_q, corners[t, d], levels, faces, n)
        for j in range(before, min(n, len(owners))):
            owners[j] = t
    return n
