"""Intervals of heights in which a mesh is solid, for each column of pixels.

A ray straight down through the centre of a pixel meets faces in order. Of a closed body those that
face up begin what is solid, and those that face down end it: the winding number counts bodies that
contain each other or cross. An open sheet, as the surface of a terrain, has no end, so what is
below it is solid all the way down.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_PIECE = 1 << 22
"""Rows of faces, and hits, that are computed at once."""


@dataclass(frozen=True, slots=True)
class Intervals:
    """Solid intervals of columns of pixels, by pixel and from below, (n,) each.

    Attributes:
        pixel: int64, row × columns + column, rows from the south.
        bottom: float64; -inf where what is solid has no end.
        top: float64.
        under: int64, number of the face at the bottom; -1 without one.
        over: int64, number of the face at the top.
    """

    pixel: Ints
    bottom: Floats
    top: Floats
    under: Ints
    over: Ints

    def __len__(self) -> int:
        return len(self.pixel)

    def some(self, which: Mask | Ints) -> Intervals:
        """Return some of the intervals, in their order."""
        return Intervals(
            self.pixel[which], self.bottom[which], self.top[which], self.under[which],
            self.over[which],
        )  # fmt: skip

    @property
    def is_lowest(self) -> Mask:
        """Which intervals are the lowest ones of their pixels, (n,)."""
        return np.concatenate([[True], self.pixel[1:] != self.pixel[:-1]])[: len(self)]


class MeshColumns(NamedTuple):
    """Columns of a mesh, and what could not be told of them.

    Attributes:
        intervals: what is solid, in the columns that were asked for.
        turned: number of columns whose faces face the wrong way, and are counted in turn.
        unclear: number of columns in which inside and outside cannot be told, so that the highest
            surface is solid all the way down.
        sheets: number of columns with a sheet over another one, likewise.
    """

    intervals: Intervals
    turned: int
    unclear: int
    sheets: int


class _Hits(NamedTuple):
    """Faces that rays meet, by pixel and from above, (n,) each.

    Attributes:
        pixel: int64.
        z: float64.
        face: int64.
        up: int64, 1 for a face that faces up, -1 for one that faces down.
    """

    pixel: Ints
    z: Floats
    face: Ints
    up: Ints


def mesh_columns(points: Floats, faces: NDArray[np.int32], asked: Mask, near: float) -> MeshColumns:
    """Find what is solid in columns of pixels.

    Args:
        points: (n, 3) float64, vertices in pixels, whole numbers at the centres; z is a height.
        faces: (m, 3) int32.
        asked: (rows, columns) bool, pixels whose columns are wanted.
        near: height below which nothing is solid, and nothing open.
    """
    hits = _cast(points, faces, asked)
    if not len(hits.pixel):
        empty = np.empty(0)
        none = np.empty(0, np.int64)
        return MeshColumns(Intervals(none, empty, empty, none, none), 0, 0, 0)
    first = np.concatenate([[True], hits.pixel[1:] != hits.pixel[:-1]])
    begins = np.flatnonzero(first)
    ends = np.append(begins[1:], len(first))
    group = np.cumsum(first) - 1
    # a mesh turned inside out as a whole
    up = -hits.up if hits.up[begins].sum() < 0 else hits.up
    winding = _running(up, begins, group)
    last = winding[ends - 1]
    # a sheet that is there twice is one
    twice = ~first & (hits.z == np.roll(hits.z, 1)) & (up > 0) & (hits.z == hits.z[ends - 1][group])
    last = last - np.add.reduceat(twice.astype(np.int64), begins)
    outward = np.minimum.reduceat(winding, begins) >= 0
    clean, sheets = outward & (last <= 1), outward & (last > 1)
    # what faces the wrong way is counted in turn, if it ends as the other columns do
    odd = (ends - begins) % 2 == 1
    endless = 2 * np.count_nonzero(last[clean] == 1) >= np.count_nonzero(clean)
    turned = ~outward & (odd == endless)
    doubtful = ~outward & (odd != endless)
    unclear = doubtful | sheets
    rank = np.arange(len(first)) - begins[group]
    inside = np.where(turned[group], rank % 2 == 0, winding > 0)
    inside |= unclear[group]
    before = np.concatenate([[False], inside[:-1]]) & ~first
    starts = np.flatnonzero(inside & ~before)
    stops = np.flatnonzero(~inside & before)
    stop = np.append(stops, len(first))[np.searchsorted(stops, starts, side="right")]
    # what is solid at the last face of a column has no end
    ended = stop < ends[group[starts]]
    stop = np.minimum(stop, len(first) - 1)
    under = np.where(ended, hits.face[stop], -1)
    bottom = np.where(ended, hits.z[stop], -np.inf)
    found = Intervals(hits.pixel[starts], bottom, hits.z[starts], under, hits.face[starts])
    found = _joined(found, near)
    turns, doubts, lays = (int(one.sum()) for one in (turned, doubtful, sheets))
    return MeshColumns(found, turns, doubts, lays)


def _running(up: Ints, begins: Ints, group: Ints) -> Ints:
    """Sums of +1 and -1 from above, each column by itself, (n,)."""
    total = np.cumsum(up)
    before = total[begins] - up[begins]
    return np.asarray(total - before[group])


def _joined(found: Intervals, near: float) -> Intervals:
    """Return intervals from below, without thin ones, and those that nearly touch as one.

    Args:
        found: intervals by pixel and from above.
        near: height of what is thin.
    """
    order = np.lexsort((-found.top, -found.pixel))[::-1]
    found = found.some(order)
    found = found.some(found.top - found.bottom > near)
    if not len(found):
        return found
    apart = np.ones(len(found), np.bool_)
    apart[1:] = (found.pixel[1:] != found.pixel[:-1]) | (found.bottom[1:] - found.top[:-1] > near)
    begins = np.flatnonzero(apart)
    ends = np.append(begins[1:], len(found)) - 1
    return Intervals(
        found.pixel[begins], found.bottom[begins], found.top[ends], found.under[begins],
        found.over[ends],
    )  # fmt: skip


# --- rays ----------------------------------------------------------------------------------------


def _cast(points: Floats, faces: NDArray[np.int32], asked: Mask) -> _Hits:
    """Faces over and under the centres of pixels, by pixel and from above.

    A face has the centres from its lower edges on to before its upper ones, and cuts of rows with
    edges follow from the edge alone, so that a closed surface is closed at each centre.
    """
    rows, columns = asked.shape
    flat = asked.ravel()
    corners = points[:, 1][faces]
    first = np.maximum(np.ceil(corners.min(axis=1)), 0.0)
    last = np.minimum(np.ceil(corners.max(axis=1)) - 1.0, rows - 1.0)
    across = points[:, 0][faces]
    some = (last >= first) & (across.max(axis=1) >= 0.0) & (across.min(axis=1) <= columns - 1.0)
    chosen = np.flatnonzero(some)
    counts = (last[chosen] - first[chosen]).astype(np.int64) + 1
    pieces = []
    for part in _parts(counts):
        pieces.extend(_cast_some(points, faces, chosen[part], first[chosen[part]], counts[part],
                                 flat, columns))  # fmt: skip
    if not pieces:
        none = np.empty(0, np.int64)
        return _Hits(none, np.empty(0), none, none)
    pixel, z, face, up = (np.concatenate(one) for one in zip(*pieces, strict=True))
    order = np.lexsort((-up, -z, pixel))  # of equal heights what begins comes first
    return _Hits(pixel[order], z[order], face[order], up[order])


def _parts(counts: Ints) -> list[slice]:
    """Slices of things that come to about a piece each."""
    total = np.cumsum(counts)
    marks = np.arange(_PIECE, int(total[-1]) + 1 if len(total) else 0, _PIECE)
    edges = {0, *(np.searchsorted(total, marks) + 1).tolist(), len(counts)}
    return [slice(a, b) for a, b in pairwise(sorted(edges))]


def _cast_some(
    points: Floats,
    faces: NDArray[np.int32],
    chosen: Ints,
    first: Floats,
    counts: Ints,
    asked: NDArray[np.bool_],
    columns: int,
) -> list[tuple[Ints, Floats, Ints, Ints]]:
    """Hits of some faces, in the order of `_Hits`."""
    corners = points[faces[chosen]]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    order = np.argsort(corners[:, :, 1], axis=1, kind="stable")
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    low, middle, high = corners[:, 0], corners[:, 1], corners[:, 2]
    begin = np.cumsum(counts) - counts
    which = np.repeat(np.arange(len(chosen)), counts)
    v = first[which] + (np.arange(len(which)) - begin[which])
    long = _cut(low[which], high[which], v)
    lower = v < middle[which, 1]
    short = np.where(
        lower[:, None],
        _cut(low[which], middle[which], v),
        _cut(middle[which], high[which], v),
    )
    turned = long[:, 0] > short[:, 0]
    west = np.where(turned[:, None], short, long)
    east = np.where(turned[:, None], long, short)
    left = np.maximum(np.ceil(west[:, 0]), 0.0)
    right = np.minimum(np.ceil(east[:, 0]) - 1.0, columns - 1.0)
    wide = np.maximum(right - left + 1.0, 0.0)
    wide = np.where((area != 0.0)[which], wide, 0.0).astype(np.int64)
    found = []
    for part in _parts(wide):
        each = np.repeat(np.arange(part.start, part.stop), wide[part])
        start = np.cumsum(wide[part]) - wide[part]
        u = left[each] + (np.arange(len(each)) - start[each - part.start])
        pixel = (v[each] * columns + u).astype(np.int64)
        kept = asked[pixel]
        each, u, pixel = each[kept], u[kept], pixel[kept]
        t = (u - west[each, 0]) / (east[each, 0] - west[each, 0])
        z = _between(west[each, 1], east[each, 1], t)
        face = which[each]
        found.append((pixel, z, chosen[face], np.where(area[face] > 0.0, 1, -1)))
    return found


def _between(a: Floats, b: Floats, t: Floats) -> Floats:
    """From a at 0 to b at 1, exact at both ends."""
    return np.where(t < 0.5, a + t * (b - a), b - (1.0 - t) * (b - a))


def _cut(a: Floats, b: Floats, v: Floats) -> Floats:
    """Columns and heights, (n, 2), where rows cut edges from a up to b, (n, 3) each."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (v - a[:, 1]) / (b[:, 1] - a[:, 1])
        return np.stack([_between(a[:, 0], b[:, 0], t), _between(a[:, 2], b[:, 2], t)], axis=1)


# --- joining --------------------------------------------------------------------------------------


class Neighbours(NamedTuple):
    """Pairs of intervals of neighbouring pixels that overlap, (n,) each.

    Attributes:
        one: int64, index of an interval.
        other: int64, index of one in the pixel to the east or to the north.
        is_north: bool, whether it is in the pixel to the north.
    """

    one: Ints
    other: Ints
    is_north: Mask

    def some(self, which: Mask) -> Neighbours:
        """Return some of the pairs."""
        return Neighbours(self.one[which], self.other[which], self.is_north[which])


def neighbours(intervals: Intervals, rows: int, columns: int) -> Neighbours:
    """Find the pairs of intervals of pixels with a common side that overlap."""
    pixel, count = intervals.pixel, len(intervals)
    begin = np.searchsorted(pixel, np.arange(rows * columns + 1))
    pairs = []
    for is_north, step in ((False, 1), (True, columns)):
        beside = pixel + step
        exists = beside < rows * columns if is_north else pixel % columns < columns - 1
        one = np.flatnonzero(exists)
        place, stop = begin[beside[one]], begin[beside[one] + 1]
        while len(one):
            there = place < stop
            one, place, stop = one[there], place[there], stop[there]
            meets = (intervals.bottom[one] < intervals.top[place]) & (
                intervals.bottom[place] < intervals.top[one]
            )
            pairs.append((one[meets], place[meets], np.full(int(meets.sum()), is_north)))
            place = place + 1
    if not count or not pairs:
        none = np.empty(0, np.int64)
        return Neighbours(none, none, np.empty(0, np.bool_))
    return Neighbours(*(np.concatenate(each) for each in zip(*pairs, strict=True)))


def joined_labels(count: int, one: Ints, other: Ints) -> Ints:
    """Label of each of `count` things, (count,) int64: the least index among those it is joined to.

    Args:
        count: number of things.
        one: (n,) int64, indices of things.
        other: (n,) int64, things that these are joined to.
    """
    label = np.arange(count)
    while True:
        a, b = label[one], label[other]
        low, high = np.minimum(a, b), np.maximum(a, b)
        apart = low != high
        if not apart.any():
            return label
        np.minimum.at(label, high[apart], low[apart])
        while True:
            shorter = label[label]
            if np.array_equal(shorter, label):
                break
            label = shorter
