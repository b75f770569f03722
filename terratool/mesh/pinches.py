"""Kernels that part vertices where solid wedges touch in an upright edge.

Two boxes that touch corner to corner share an edge that four walls run along. All faces that meet
in such an edge are walls around one place in the plane, between two levels of it; the triangles
around the place say in which directions there is something solid between these levels. Each run of
such triangles is a wedge, and gets vertices of its own.
"""

from __future__ import annotations

from terratool.field.primitives import device, kernel
from terratool.mesh.lattice import area


@kernel
def find_fans(triangles, neighbours, fans):
    """For each vertex a triangle around it, on the hull the one to begin with: fans, (n,) int32."""
    fans[:] = -1
    for t in range(len(triangles)):
        for c in range(3):
            p = triangles[t, c]
            if fans[p] < 0 or neighbours[t, c] < 0:
                fans[p] = t


@device
def corner_of(triangles, t, p):
    """Which corner of a triangle a vertex is."""
    c = 0
    while triangles[t, c] != p:
        c += 1
    return c


@device
def next_around(triangles, neighbours, t, p):
    """The next triangle around a vertex, counter-clockwise; -1 beyond the hull."""
    return neighbours[t, (corner_of(triangles, t, p) + 2) % 3]


@device
def walk(triangles, neighbours, corners, begins, p, first, around, tops):
    """Triangles around a vertex, and up to which of its levels there is something solid; a number.

    `tops` is -1 where there is no ground, or no triangle.
    """
    n = 0
    t = first
    while True:
        level = corners[t, corner_of(triangles, t, p)]
        around[n], tops[n] = t, -1 if level < 0 else level - begins[p]
        n += 1
        t = next_around(triangles, neighbours, t, p)
        if t == first:
            return n
        if t < 0:
            around[n], tops[n] = -1, -1
            return n + 1


@device
def peaks(tops, n):
    """How often, once around, `tops` rises and falls again."""
    rising = False
    count = 0
    for k in range(2 * n):
        here, after = tops[k % n], tops[(k + 1) % n]
        if after > here:
            rising = True
        elif after < here:
            count += rising and k >= n
            rising = False
    return count


@kernel
def part(
    triangles, neighbours, corners, begins, fans, around, tops, chains, tables, sources
):  # fmt: skip
    """Give each wedge vertices of its own.

    The wedges below a level decide about it; about the base, those above it: there is ground on it
    wherever there is any. What has no room in `tables` and `sources` is only counted.

    Args:
        triangles: (m, 3) indices of vertices in the plane.
        neighbours: (m, 3) triangles beyond their edges.
        corners: (m, 3) index of the level of each corner, -1 where there is no ground.
        begins: (n + 1,) index of each vertex's first level.
        fans: (n,) from find_fans.
        around: scratch, as long as triangles are around a vertex and one more.
        tops: the same.
        chains: (m, 3) int64; gets for each corner where in `tables` its levels begin, -1 if all
            stay as they are.
        tables: int32; gets for the levels of a vertex, seen from a triangle, vertices of the mesh.
        sources: int32; gets the level that each new vertex is another of.

    Returns:
        The numbers of entries in `tables` and in `sources`.
    """
    chains[:] = -1
    used = made = 0
    total = begins[len(begins) - 1]
    for p in range(len(begins) - 1):
        count = begins[p + 1] - begins[p]
        if count < 2:
            continue
        n = walk(triangles, neighbours, corners, begins, p, fans[p], around, tops)
        if peaks(tops, n) < 2:
            continue
        for k in range(n):
            if around[k] >= 0:
                chains[around[k], corner_of(triangles, around[k], p)] = used + k * count
        for level in range(count):
            start = 0  # a triangle that is no part of a wedge
            while start < n and tops[start] >= level:
                start += 1
            run, inside = -1 if start < n else 0, start == n
            for k in range(n):
                at = (start + k) % n
                if tops[at] >= level and not inside:
                    run += 1
                    if run > 0:
                        if made < len(sources):
                            sources[made] = begins[p] + level
                        made += 1
                inside = tops[at] >= level
                if used + at * count + level < len(tables):
                    vertex = begins[p] + level if run <= 0 else total + made - 1
                    tables[used + at * count + level] = vertex
        used += n * count
    return used, made


@kernel
def part_faces(triangles, begins, places, chains, tables, owners, faces):
    """Put the vertices of wedges into `faces`, (f, 3), of ground and walls.

    `owners` are their triangles, those on the higher side of walls; `places` the vertex in the
    plane of each level.
    """
    for f in range(len(faces)):
        t = owners[f]
        for k in range(3):
            level = faces[f, k]
            p = places[level]
            chain = chains[t, corner_of(triangles, t, p)]
            if chain >= 0:
                faces[f, k] = tables[chain + level - begins[p]]


@kernel
def part_base(points, triangles, neighbours, begins, fans, chains, tables, below, faces):
    """Write the base's triangles `below`, (b, 3) vertices in the plane, into `faces`: downwards."""
    for f in range(len(below)):
        for k in range(3):
            p, q = below[f, k], below[f, (k + 1) % 3]
            vertex = begins[p]
            # the triangle of the ground that lies to the left of the edge from p to q, at p
            t = fans[p]
            while True:
                c = corner_of(triangles, t, p)
                chain = chains[t, c]
                right, left = triangles[t, (c + 1) % 3], triangles[t, (c + 2) % 3]
                if area(points, p, right, q) >= 0 and area(points, p, q, left) > 0:
                    if chain >= 0:
                        vertex = tables[chain]
                    break
                t = next_around(triangles, neighbours, t, p)
            faces[f, 2 - k] = vertex
