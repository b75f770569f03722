"""The highest surface at the centres of pixels: loops over triangles and rows of pixels.

Points are in pixels: u counts columns from the west and v rows from the south, both whole numbers
at the centres. A row cuts a triangle between two of its edges. Where it cuts an edge follows from
the edge alone, taken from its lower end, so that two triangles with a common edge meet there to the
last bit, and no centre between them is missed, whatever is rounded.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
device = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)

MOST = np.uint8(255)
"""Surfaces over a pixel are not counted any further."""

UPRIGHT = 1e-6
"""A face is vertical if it is no larger from above than this part of it."""

_FLAT = 1e-12
"""A face has no area if it is lower than this part of its longest edge."""


@kernel
def to_pixels(vertices, west, south, dx, dy, points):
    """Vertices, (n, 3) float64 in the world, as points, (n, 3) float64; z stays."""
    for n in range(len(vertices)):
        points[n, 0] = (vertices[n, 0] - west) / dx - 0.5
        points[n, 1] = (vertices[n, 1] - south) / dy - 0.5
        points[n, 2] = vertices[n, 2]


@device
def between(a, b, t):
    """From a at 0 to b at 1, exact at both ends and where they are equal."""
    return a + t * (b - a) if t < 0.5 else b - (1.0 - t) * (b - a)


@device
def cut(ua, va, za, ub, vb, zb, v):
    """The u and z at which a row cuts the edge from a up to b."""
    t = (v - va) / (vb - va)
    return between(ua, ub, t), between(za, zb, t)


@device
def corners(points, faces, n):
    """The three corners of a face from the lowest v to the highest, nine numbers."""
    a, b, c = faces[n, 0], faces[n, 1], faces[n, 2]
    if points[a, 1] > points[b, 1]:
        a, b = b, a
    if points[b, 1] > points[c, 1]:
        b, c = c, b
        if points[a, 1] > points[b, 1]:
            a, b = b, a
    return (
        points[a, 0], points[a, 1], points[a, 2],
        points[b, 0], points[b, 1], points[b, 2],
        points[c, 0], points[c, 1], points[c, 2],
    )  # fmt: skip


@device
def span(u0, v0, z0, u1, v1, z1, u2, v2, z2, v):
    """Where a row cuts a triangle: u and z of the west end and of the east end.

    The corners are those of `corners`, v from v0 to v2, and v0 is less than v2.
    """
    ul, zl = cut(u0, v0, z0, u2, v2, z2, v)
    if v < v1 or v1 == v2:
        ur, zr = cut(u0, v0, z0, u1, v1, z1, v)
    else:
        ur, zr = cut(u1, v1, z1, u2, v2, z2, v)
    return (ur, zr, ul, zl) if ul > ur else (ul, zl, ur, zr)


@device
def height_at(ul, zl, ur, zr, u):
    """Height between the ends of a span; beyond them that of the nearer end."""
    if u <= ul:
        return zl
    if u >= ur:
        return zr
    return between(zl, zr, (u - ul) / (ur - ul))


@device
def facing(points, faces, n):
    """Twice the area of a face from above in pixels, below 0 if it faces down."""
    a, b, c = faces[n, 0], faces[n, 1], faces[n, 2]
    du, dv = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    return du * (points[c, 1] - points[a, 1]) - dv * (points[c, 0] - points[a, 0])


@device
def whole(low, high, count):
    """The first and last whole number from `low` to `high` that is one of so many."""
    return math.ceil(max(low, 0.0)), math.floor(min(high, count - 1.0))


@kernel
def paint(points, faces, near, heights, counts):
    """The highest surface at the centre of each pixel, and how many there are above one another.

    Args:
        points: (n, 3) float64.
        faces: (m, 3) int32, indices of points.
        near: a centre that is no farther than this from a triangle, in pixels, belongs to it.
        heights: (rows, columns) float64, NaN where there is nothing yet; gets heights.
        counts: (rows, columns) uint8; gets how many faces are over or under the centre. Of two
            faces with a common edge one counts on it, so that a sheet counts once all over.
    """
    rows, columns = heights.shape
    for n in range(len(faces)):
        u0, v0, z0, u1, v1, z1, u2, v2, z2 = corners(points, faces, n)
        first, last = whole(v0 - near, v2 + near, rows)
        if first > last:
            continue
        west, east = whole(min(u0, u1, u2) - near, max(u0, u1, u2) + near, columns)
        if west > east or facing(points, faces, n) == 0.0:
            continue
        for row in range(first, last + 1):
            v = np.float64(row)
            own = v0 <= v < v2
            ul, zl, ur, zr = span(u0, v0, z0, u1, v1, z1, u2, v2, z2, min(max(v, v0), v2))
            west, east = whole(ul - near, ur + near, columns)
            for column in range(west, east + 1):
                u = np.float64(column)
                z = height_at(ul, zl, ur, zr, u)
                if not heights[row, column] >= z:  # NaN is not
                    heights[row, column] = z
                if own and ul <= u < ur and counts[row, column] < MOST:
                    counts[row, column] += np.uint8(1)


@kernel
def look_below(points, faces, near, heights, counts, below, turned, air, lowest):
    """What lies below the highest surface, and which way it faces.

    Args:
        points: (n, 3) float64.
        faces: (m, 3) int32, indices of points.
        near: surfaces that are no lower than this below the highest one are part of it.
        heights: (rows, columns) float64, as `paint` made them.
        counts: (rows, columns) uint8, as `paint` made them; pixels with less than 2 are passed by.
        below: (rows, columns) uint8 of 0; gets how many surfaces lie below the highest one.
        turned: (2, rows, columns) int16 of 0; gets how many more of the highest surfaces, and of
            those below, face up than down.
        air: (rows, columns) float64 of 0; of surfaces below the highest one it gets the heights of
            those that face down less the heights of those that face up.
        lowest: (rows, columns) float64 of infinity; gets the height of the lowest surface.

    Returns:
        By how many pixels more the highest surface faces up than down, among all pixels.
    """
    rows, columns = heights.shape
    usual = np.int64(0)
    for n in range(len(faces)):
        u0, v0, z0, u1, v1, z1, u2, v2, z2 = corners(points, faces, n)
        first, last = whole(v0, v2, rows)
        area = facing(points, faces, n)
        if first > last or area == 0.0:
            continue
        up = 1 if area > 0.0 else -1
        for row in range(first, last + 1):
            v = np.float64(row)
            if v >= v2:
                continue
            ul, zl, ur, zr = span(u0, v0, z0, u1, v1, z1, u2, v2, z2, v)
            west, east = whole(ul, ur, columns)
            for column in range(west, east + 1):
                u = np.float64(column)
                if u >= ur:
                    continue
                z = height_at(ul, zl, ur, zr, u)
                highest = z >= heights[row, column] - near
                if highest:
                    usual += up
                if counts[row, column] < 2:
                    continue
                turned[0 if highest else 1, row, column] += np.int16(up)
                if not highest:
                    air[row, column] -= up * z
                    lowest[row, column] = min(lowest[row, column], z)
                    if below[row, column] < MOST:
                        below[row, column] += np.uint8(1)
    return usual


@kernel
def overhangs(near, below, turned, air, lowest, usual):
    """How many pixels have a surface below the highest one that is open to the air.

    Undersides and floors come in pairs with air between them, but for the lowest underside of a
    solid. Where bodies touch or are sunk into others, there is none; what faces the wrong way or
    has no partner is a sheet of its own.

    Args:
        near: less air than this is none.
        below: (rows, columns) uint8, as `look_below` made it, and so are the next three.
        turned: (2, rows, columns) int16.
        air: (rows, columns) float64.
        lowest: (rows, columns) float64.
        usual: above 0 if tops face up, below 0 if they face down, as in a mesh turned inside out.
    """
    found = 0
    rows, columns = below.shape
    sign = -1 if usual < 0 else 1
    for row in range(rows):
        for column in range(columns):
            if below[row, column] == 0:
                continue
            top, under = sign * turned[0, row, column], sign * turned[1, row, column]
            gap = sign * air[row, column] - (lowest[row, column] if under == -1 else 0.0)
            if top < 0 or under < -1 or under > 0 or gap > near:
                found += 1
    return found


@kernel
def holes(heights, queue):
    """How many pixels have no height though there is one all around them, and how many have none.

    Args:
        heights: (rows, columns) float64, NaN for none.
        queue: as many int64 as there are pixels without a height; it is used up, and `heights`
            gets infinity for NaN where a way leads out along pixels that share a side.

    Returns:
        Pixels without a height within the outline, and beyond it.
    """
    rows, columns = heights.shape
    begin = end = missing = 0
    for row in range(rows):
        for column in range(columns):
            if np.isnan(heights[row, column]):
                missing += 1
                if row in (0, rows - 1) or column in (0, columns - 1):
                    heights[row, column] = np.inf
                    queue[end] = row * columns + column
                    end += 1
    while begin < end:
        row, column = queue[begin] // columns, queue[begin] % columns
        begin += 1
        for side in range(4):
            i = row + (side == 0) - (side == 1)
            k = column + (side == 2) - (side == 3)
            if 0 <= i < rows and 0 <= k < columns and np.isnan(heights[i, k]):
                heights[i, k] = np.inf
                queue[end] = i * columns + k
                end += 1
    for n in range(end):
        heights[queue[n] // columns, queue[n] % columns] = np.nan
    return missing - end, end


@kernel
def reach(vertices, faces):
    """Least and greatest x, y and z of the corners of faces; six numbers in this order."""
    low_x = low_y = low_z = np.inf
    high_x = high_y = high_z = -np.inf
    for n in range(len(faces)):
        for corner in range(3):
            vertex = faces[n, corner]
            x, y, z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
            low_x, high_x = min(low_x, x), max(high_x, x)
            low_y, high_y = min(low_y, y), max(high_y, y)
            low_z, high_z = min(low_z, z), max(high_z, z)
    return low_x, high_x, low_y, high_y, low_z, high_z


@kernel
def survey(vertices, faces, west, south, east, north, kinds):
    """What faces are like: flat to nothing, vertical, outside of a rectangle.

    Args:
        vertices: (n, 3) float64 in the world.
        faces: (m, 3) int32.
        west: the least x of the rectangle.
        south: its least y.
        east: its greatest x.
        north: its greatest y.
        kinds: (m,) uint8; gets 0 for a face to be seen from above, 1 for a vertical one, 2 for one
            without area and 3 for one outside.

    Returns:
        The area of vertical faces that are not wholly on the rim of the rectangle.
    """
    upright = 0.0
    for n in range(len(faces)):
        a, b, c = faces[n, 0], faces[n, 1], faces[n, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        bx, by, bz = vertices[b, 0], vertices[b, 1], vertices[b, 2]
        cx, cy, cz = vertices[c, 0], vertices[c, 1], vertices[c, 2]
        x0, y0, z0 = bx - ax, by - ay, bz - az
        x1, y1, z1 = cx - ax, cy - ay, cz - az
        x2, y2, z2 = cx - bx, cy - by, cz - bz
        nx, ny, nz = y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1
        area = math.sqrt(nx * nx + ny * ny + nz * nz)
        longest = max(
            x0 * x0 + y0 * y0 + z0 * z0, x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2
        )
        if area <= _FLAT * longest:
            kinds[n] = 2
        elif (
            max(ax, bx, cx) < west
            or min(ax, bx, cx) > east
            or max(ay, by, cy) < south
            or min(ay, by, cy) > north
        ):
            kinds[n] = 3
        elif abs(nz) <= UPRIGHT * area:
            kinds[n] = 1
            if not (
                max(ax, bx, cx) <= west
                or min(ax, bx, cx) >= east
                or max(ay, by, cy) <= south
                or min(ay, by, cy) >= north
            ):
                upright += 0.5 * area
        else:
            kinds[n] = 0
    return upright
