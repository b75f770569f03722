"""Vertices for each solid wedge, so that every edge of a closed mesh has two faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.components import components

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Floats = NDArray[np.float64]

_SAME_ANGLE = 9
"""Decimals of angles, rad, by which faces around an edge are put in order."""


class Manifold(NamedTuple):
    """Faces of which two meet in each edge.

    Attributes:
        vertices: (n, 3) places.
        faces: (m, 3) vertices.
        owners: (m,) index of the face that each one was, or is a part of.
    """

    vertices: Floats
    faces: Ints
    owners: Longs


def separate(vertices: Floats, faces: Ints) -> Manifold:
    """Give wedges that meet in an edge vertices of their own.

    Faces around an edge with more than two are paired by angle, each two around something solid.
    Where pairs meet again around both ends of the edge, all but one are halved there.

    Args:
        vertices: (n, 3) places.
        faces: (m, 3) faces, counter-clockwise from outside, in edges with as many to each side.
    """
    found = Manifold(vertices, faces, np.arange(len(faces)))
    pairs = _crowded_pairs(vertices, faces)
    if len(pairs):
        found = _with_fans(found, pairs)
    while len(pairs):
        pairs, before = _crowded_pairs(found.vertices, found.faces), found
        found = _halved(found, pairs)
        if len(found.faces) == len(before.faces):
            break
    return found


def _side_ends(faces: Ints) -> Longs:
    """Vertices from which and to which the side after each corner leads, (3 m, 2)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)


def _crowded_pairs(vertices: Floats, faces: Ints) -> Longs:
    """Sides of faces around something solid at edges of more than two faces, (k, 2)."""
    ends = _side_ends(faces)
    key = ends.min(axis=1) * len(vertices) + ends.max(axis=1)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    counts = np.diff(np.append(first, len(key)))
    many = counts > 2
    found = [
        _wedges(vertices, faces, ends, order[begin : begin + count])
        for begin, count in zip(first[many].tolist(), counts[many].tolist(), strict=True)
    ]
    return np.concatenate(found) if found else np.empty((0, 2), np.int64)


def _wedges(vertices: Floats, faces: Ints, ends: Longs, sides: Longs) -> Longs:
    """Pairs of sides of faces at one edge that meet around something solid, (k, 2)."""
    low, high = int(ends[sides].min()), int(ends[sides].max())
    forth = ends[sides, 0] == low
    third = faces[sides // 3, (sides + 2) % 3]
    along = vertices[high] - vertices[low]
    along /= np.linalg.norm(along)
    away = vertices[third] - vertices[low]
    away -= (away @ along)[:, None] * along
    x = away[0] / np.linalg.norm(away[0])
    angle = np.round(np.arctan2(away @ np.cross(along, x), away @ x), _SAME_ANGLE)
    # something solid begins at a side that leads back, and ends at the next one that leads forth
    order = np.lexsort([forth, angle]).tolist()
    waiting: list[int] = []
    pairs: dict[int, int] = {}
    for k in order + order:
        if not forth[k]:
            if k not in waiting and k not in pairs:
                waiting.append(k)
        elif waiting and k not in pairs.values():
            pairs[waiting.pop()] = k
    return sides[np.array([*pairs.items()], np.int64).reshape(-1, 2)]


def _with_fans(mesh: Manifold, pairs: Longs) -> Manifold:
    """Mesh with a vertex for each fan of faces around the ends of crowded edges."""
    vertices, faces, owners = mesh
    count = len(vertices)
    ends = _side_ends(faces)
    crowded = np.zeros(count, np.bool_)
    crowded[ends[pairs.ravel()]] = True
    # sides of two faces, at these vertices
    near = np.setdiff1d(np.flatnonzero(crowded[ends].any(axis=1)), pairs)
    key = ends[near].min(axis=1) * count + ends[near].max(axis=1)
    order = np.argsort(key, kind="stable")
    two = np.flatnonzero(np.diff(key[order]) == 0)
    pairs = np.concatenate([pairs, np.column_stack([near[order[two]], near[order[two + 1]]])])
    a, b = pairs.T
    next_a, next_b = (side - side % 3 + (side + 1) % 3 for side in (a, b))
    # where one side begins the other one ends
    joined = np.concatenate([np.column_stack([a, next_b]), np.column_stack([next_a, b])])
    vertex_of = faces.ravel()
    joined = joined[crowded[vertex_of[joined[:, 0]]]]
    corners = np.flatnonzero(crowded[vertex_of])
    fans, fan = np.unique(
        components(np.searchsorted(corners, joined), len(corners)), return_inverse=True
    )
    vertex = vertex_of[corners[fans]]
    _, keeper = np.unique(vertex, return_index=True)  # the first fan keeps the vertex
    number = np.full(len(fans), -1)
    number[keeper] = vertex[keeper]
    new = np.flatnonzero(number < 0)
    number[new] = count + np.arange(len(new))
    out = vertex_of.copy()
    out[corners] = number[fan]
    return Manifold(np.concatenate([vertices, vertices[vertex[new]]]), out.reshape(-1, 3), owners)


def _halved(mesh: Manifold, pairs: Longs) -> Manifold:
    """Mesh in which the faces of pairs are halved at the middle of their sides.

    One pair of each edge stays; of the others those whose faces are not halved already.
    """
    vertices, faces, owners = mesh
    faces = faces.copy()
    more: list[tuple[int, Ints]] = []
    at: list[Floats] = []
    ends = _side_ends(mesh.faces)
    seen: set[tuple[int, int]] = set()
    busy: set[int] = set()
    for pair in pairs.tolist():
        low, high = sorted(ends[pair[0]].tolist())
        own = {side // 3 for side in pair}
        if (low, high) not in seen:
            seen.add((low, high))
            continue
        if own & busy:
            continue
        busy |= own
        middle = len(vertices) + len(at)
        at.append(0.5 * (vertices[low] + vertices[high]))
        for side in pair:
            face, corner = divmod(side, 3)
            other = faces[face].copy()
            faces[face, (corner + 1) % 3] = middle
            other[corner] = middle
            more.append((face, other))
    return Manifold(
        np.concatenate([vertices, np.array(at).reshape(-1, 3)]),
        np.concatenate([faces, np.array([other for _, other in more], np.int32).reshape(-1, 3)]),
        np.append(owners, owners[np.array([face for face, _ in more], np.int64)]),
    )
