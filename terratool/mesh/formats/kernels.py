"""Loops over vertices and faces: numbers as text, faces by surface, triangles.

A float32 becomes the shortest decimal number that reads back as the same float32: the first that
does so of its 6, 7, 8 and 9 significant digits, without the zeros at their end. Whatever has at
most 6 digits survives float32, so no shorter one is missed, but for subnormal numbers.

A float64 becomes its 15 significant digits without the zeros at their end; whatever has at most as
many survives float64.
"""

from __future__ import annotations

import numpy as np
from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
device = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)

NUMBER_BYTES = 24
"""No number of these needs more."""

SINGLE, DOUBLE = (6, 9), (15, 15)
"""The fewest and the most digits of a float32 and of a float64."""

_MIDDLE = 60
_POWERS = np.array([float(f"1e{n}") for n in range(-_MIDDLE, _MIDDLE + 1)])

_ZERO, _TEN, _POINT, _MINUS = np.uint64(48), np.uint64(10), np.uint8(46), np.uint8(45)
_E = np.uint8(101)

_PLAIN = (-5, 15)
"""Decimal exponents of numbers that are written without one."""


@device
def put_digits(out, end, number, count):
    """The last `count` digits of an unsigned number, before `end`; returns what is left of it."""
    for _ in range(count):
        end -= 1
        rest = number // _TEN
        out[end] = np.uint8(_ZERO + (number - rest * _TEN))
        number = rest
    return number


@device
def length(number):
    """How many digits an unsigned number has."""
    digits = 1
    limit = _TEN
    while number >= limit:
        digits += 1
        limit *= _TEN
    return digits


@device
def put_integer(out, at, number):
    """An integer that is not negative; returns where it ends."""
    rest = np.uint64(number)
    end = at + length(rest)
    put_digits(out, end, rest, end - at)
    return end


@device
def digits_of(exact, fewest, most):
    """Digits and decimals of a positive number: digits / 10 ** decimals.

    As few digits as read back as the same float32, but at least `fewest` and at most `most`; of
    these none are zeros at the end.
    """
    value = np.float32(exact)
    exponent = 0
    while exact >= _POWERS[exponent + 1 + _MIDDLE]:
        exponent += 1
    while exact < _POWERS[exponent + _MIDDLE]:
        exponent -= 1
    digits, decimals = np.uint64(0), 0
    for count in range(fewest, most + 1):
        decimals = count - 1 - exponent
        # powers up to 22 are exact, so divide by them rather than multiply by their inverse
        if decimals >= 0:
            digits = np.uint64(exact * _POWERS[decimals + _MIDDLE] + 0.5)
            back = np.float64(digits) / _POWERS[decimals + _MIDDLE]
        else:
            digits = np.uint64(exact / _POWERS[_MIDDLE - decimals] + 0.5)
            back = np.float64(digits) * _POWERS[_MIDDLE - decimals]
        if np.float32(back) == value:
            break
    rest = digits // _TEN
    while digits == rest * _TEN:
        digits = rest
        decimals -= 1
        rest = digits // _TEN
    return digits, decimals


@device
def put_number(out, at, value, limits):
    """A finite number of as many digits as `digits_of` says; returns where it ends."""
    if value == 0:
        out[at] = _ZERO
        return at + 1
    if value < 0:
        out[at] = _MINUS
        at += 1
        value = -value
    digits, decimals = digits_of(np.float64(value), limits[0], limits[1])
    count = length(digits)
    exponent = count - 1 - decimals
    if exponent < _PLAIN[0] or exponent > _PLAIN[1]:
        first = at
        if count > 1:
            digits = put_digits(out, at + count + 1, digits, count - 1)
            out[at + 1] = _POINT
            at += count
        out[first] = np.uint8(_ZERO + digits)
        out[at + 1] = _E
        at += 2
        if exponent < 0:
            out[at] = _MINUS
            at += 1
            exponent = -exponent
        return put_integer(out, at, exponent)
    if decimals <= 0:
        put_digits(out, at + count, digits, count)
        at += count
        for _ in range(-decimals):
            out[at] = _ZERO
            at += 1
        return at
    whole = max(1, count - decimals)
    digits = put_digits(out, at + whole + 1 + decimals, digits, decimals)
    out[at + whole] = _POINT
    put_digits(out, at + whole, digits, whole)
    return at + whole + 1 + decimals


@device
def put_bytes(out, at, text):
    """Bytes as they are; returns where they end."""
    for n in range(len(text)):
        out[at + n] = text[n]
    return at + len(text)


@kernel
def put_points(out, points, limits, before, after):
    """Lines of points, (n, 3), each between two texts; returns where they end.

    `limits` are SINGLE for float32 and DOUBLE for float64 below 1e45 and not below 1e-45.
    """
    at = 0
    for n in range(len(points)):
        at = put_bytes(out, at, before)
        at = put_number(out, at, points[n, 0], limits)
        out[at] = 32
        at = put_number(out, at + 1, points[n, 1], limits)
        out[at] = 32
        at = put_number(out, at + 1, points[n, 2], limits)
        at = put_bytes(out, at, after)
    return at


@kernel
def put_faces(out, faces, first, before, after):
    """Lines of faces, (n, 3) int32, each between two texts; returns where they end.

    `first` is the number of the first vertex.
    """
    at = 0
    for n in range(len(faces)):
        at = put_bytes(out, at, before)
        at = put_integer(out, at, faces[n, 0] + first)
        out[at] = 32
        at = put_integer(out, at + 1, faces[n, 1] + first)
        out[at] = 32
        at = put_integer(out, at + 1, faces[n, 2] + first)
        at = put_bytes(out, at, after)
    return at


@kernel
def sort_faces(faces, surfaces, begins, sorted_faces):
    """Faces, (m, 3), in the order of their surfaces, otherwise as they were.

    `surfaces` are (m,) places in `begins`, (k,), where the faces of each begin; it is used up.
    """
    for n in range(len(faces)):
        place = begins[surfaces[n]]
        begins[surfaces[n]] = place + 1
        for corner in range(3):
            sorted_faces[place, corner] = faces[n, corner]


@kernel
def take_vertices(points, faces, places, own_points, own_faces):
    """Vertices that faces use, in the order of their use; returns how many.

    `places` are (n,) of -1, one for each point; `own_points` holds as many as there can be, and
    `own_faces`, (m, 3), are of these.
    """
    count = 0
    for n in range(len(faces)):
        for corner in range(3):
            vertex = faces[n, corner]
            place = places[vertex]
            if place < 0:
                place = places[vertex] = count
                for axis in range(3):
                    own_points[place, axis] = points[vertex, axis]
                count += 1
            own_faces[n, corner] = place
    return count


@kernel
def put_triangles(points, faces, out):
    """Normals and corners, (m, 12) float32, of faces, (m, 3), of points, (n, 3) float32.

    A face that has no area has no normal: zeros, as readers expect.
    """
    for n in range(len(faces)):
        a, b, c = points[faces[n, 0]], points[faces[n, 1]], points[faces[n, 2]]
        ux, uy, uz = np.float64(b[0]) - a[0], np.float64(b[1]) - a[1], np.float64(b[2]) - a[2]
        vx, vy, vz = np.float64(c[0]) - a[0], np.float64(c[1]) - a[1], np.float64(c[2]) - a[2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = np.sqrt(x * x + y * y + z * z)
        inverse = 1 / length if length > 0 else 0.0
        out[n, 0], out[n, 1], out[n, 2] = x * inverse, y * inverse, z * inverse
        for axis in range(3):
            out[n, 3 + axis], out[n, 6 + axis], out[n, 9 + axis] = a[axis], b[axis], c[axis]
