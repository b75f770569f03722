"""Vertices for each solid wedge, so that every edge of a closed mesh has two faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.components import components

Ints = NDArray[np.int32]


def separate(vertices: NDArray[np.float64], faces: Ints) -> tuple[Ints, Ints]:
    """Give wedges that meet in an edge vertices of their own.

    Faces around an edge with more than two are paired by angle, each two around something solid.

    Args:
        vertices: (n, 3) places.
        faces: (m, 3) faces, counter-clockwise from outside.

    Returns:
        (m, 3) faces, and (k,) index of the old vertex of each new one; the first n are the old
        ones.
    """
    count = len(vertices)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    key = ends.min(axis=1) * count + ends.max(axis=1)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    many = np.diff(np.append(first, len(key))) > 2
    sources = np.arange(count, dtype=np.int32)
    if not many.any():
        return faces, sources
    crowded = np.zeros(count, np.bool_)
    crowded[ends[order[first[many]]]] = True
    # corners at crowded vertices, joined along sides of two faces
    near = np.flatnonzero(crowded[ends].any(axis=1))
    pairs = _pairs(vertices, ends, near[np.argsort(key[near], kind="stable")], key)
    a, b = pairs.T
    after = lambda side: side - side % 3 + (side + 1) % 3  # noqa: E731
    # where one side begins the other one ends
    joined = np.concatenate([np.column_stack([a, after(b)]), np.column_stack([after(a), b])])
    joined = joined[crowded[faces.ravel()[joined[:, 0]]]]
    used, index = np.unique(
        np.concatenate([joined.ravel(), np.flatnonzero(crowded[faces].ravel())]),
        return_inverse=True,
    )
    roots = components(index[: joined.size].reshape(-1, 2), len(used))
    old = faces.ravel()[used]
    fans, fan = np.unique(roots, return_inverse=True)
    vertex = old[fans]
    # the first fan of each vertex keeps it
    _, keeper = np.unique(vertex, return_index=True)
    number = np.full(len(fans), -1)
    number[keeper] = vertex[keeper]
    new = np.flatnonzero(number < 0)
    number[new] = count + np.arange(len(new))
    out = faces.ravel().copy()
    out[used] = number[fan]
    return out.reshape(-1, 3).astype(np.int32), np.append(sources, vertex[new]).astype(np.int32)


def _pairs(vertices: NDArray[np.float64], ends: NDArray[np.int64], sides: NDArray[np.int64],
           key: NDArray[np.int64]) -> NDArray[np.int64]:  # fmt: skip
    """Pairs of sides of faces that meet around something solid, (k, 2).

    Args:
        vertices: (n, 3) places.
        ends: (s, 2) vertices from which and to which the side of each corner leads.
        sides: sides to pair, all of an edge after one another.
        key: (s,) edge of each side.
    """
    first = np.flatnonzero(np.diff(key[sides], prepend=-1))
    counts = np.diff(np.append(first, len(sides)))
    two = first[counts == 2]
    found = [np.column_stack([sides[two], sides[two + 1]])]
    for begin, many in zip(first[counts > 2].tolist(), counts[counts > 2].tolist(), strict=True):
        found.append(_wedges(vertices, ends, sides[begin : begin + many]))
    return np.concatenate(found)


def _wedges(
    vertices: NDArray[np.float64], ends: NDArray[np.int64], sides: NDArray[np.int64]
) -> NDArray[np.int64]:
    low, high = ends[sides].min(axis=1)[0], ends[sides].max(axis=1)[0]
    forth = ends[sides, 0] == low
    third = np.asarray([_third(ends, side) for side in sides.tolist()])
    along = vertices[high] - vertices[low]
    along = along / np.linalg.norm(along)
    away = vertices[third] - vertices[low]
    away -= (away @ along)[:, None] * along
    x = away[0] / np.linalg.norm(away[0])
    y = np.cross(along, x)
    angle = np.round(np.arctan2(away @ y, away @ x), 9)
    # something solid begins at a side that leads back, and ends at one that leads forth
    order = np.lexsort([forth, angle])
    order = order.tolist()
    waiting: list[int] = []
    pairs: list[tuple[int, int]] = []
    paired: set[int] = set()
    for k in order + order:
        if k in paired:
            continue
        if not forth[k]:
            if k not in waiting:
                waiting.append(k)
        elif waiting:
            other = waiting.pop()
            pairs.append((other, k))
            paired |= {other, k}
    return sides[np.array(pairs, np.int64).reshape(-1, 2)]


def _third(ends: NDArray[np.int64], side: int) -> int:
    return int(ends[side - side % 3 + (side + 1) % 3, 1])
