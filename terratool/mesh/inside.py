"""Which ruts hold a place on the lattice, by the edges that are drawn, and how deep they are."""

from __future__ import annotations

import numpy as np

from terratool.field.primitives import device, kernel
from terratool.field.ruts import deepened

_ODD, _SEEN = 1, 2


@kernel
def fill_rows(edges, frame, offsets, entries):
    """For each row of places the edges that pass it: `offsets`, (rows + 1,), are to be 0.

    Returns their number; what has no room in `entries` is only counted.
    """
    rows = len(offsets) - 1
    total = 0
    for e in range(len(edges)):
        first, last = _rows_of(edges, e, frame, rows)
        total += last - first + 1
        for row in range(first, last + 1):
            offsets[row] += 1
    if total > len(entries):
        return total
    begin = 0
    for row in range(rows + 1):
        count = offsets[row]
        offsets[row] = begin
        begin += count
    for e in range(len(edges)):
        first, last = _rows_of(edges, e, frame, rows)
        for row in range(first, last + 1):
            entries[offsets[row]] = e
            offsets[row] += 1
    # each offset has moved to the next one's place
    for row in range(rows, 0, -1):
        offsets[row] = offsets[row - 1]
    offsets[0] = 0
    return total


@device
def _row(frame, rows, y):
    """The row of a place, the first or the last where it lies beyond them."""
    return np.int64(min(max((y - frame[0]) * frame[1], 0.0), rows - 1.0))


@device
def _rows_of(edges, e, frame, rows):
    """The first and the last row that an edge passes; a level one passes none."""
    y0, y1 = edges[e, 1], edges[e, 3]
    if y0 == y1:
        return np.int64(0), np.int64(-1)
    return _row(frame, rows, float(min(y0, y1))), _row(frame, rows, float(max(y0, y1)))


@kernel
def tracks_at(outlines, x, y, found, marks):
    """The tracks that hold a place, in `found` in any order; returns their number.

    A place is inside where a ray to the west passes an odd number of a track's edges.

    Args:
        outlines: the edges.
        x: place on the lattice.
        y: place on the lattice.
        found: (tracks,) int64.
        marks: (tracks,) uint8, scratch, 0; is so again.
    """
    rows = len(outlines.offsets) - 1
    if rows < 1:
        return 0
    row = _row(outlines.frame, rows, y)
    seen = 0
    for k in range(outlines.offsets[row], outlines.offsets[row + 1]):
        e = outlines.entries[k]
        x0, y0 = float(outlines.edges[e, 0]), float(outlines.edges[e, 1])
        x1, y1 = float(outlines.edges[e, 2]), float(outlines.edges[e, 3])
        if (y0 <= y) == (y1 <= y):
            continue
        if min(x0, x1) > x:
            continue
        if max(x0, x1) > x:
            across = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)
            if (across > 0.0) == (y1 > y0):
                continue
        track = np.int64(outlines.owners[e])
        if not marks[track]:
            found[seen] = track
            seen += 1
        marks[track] = (marks[track] ^ _ODD) | _SEEN
    count = 0
    for k in range(seen):
        track = found[k]
        if marks[track] & _ODD:
            found[count] = track
            count += 1
        marks[track] = 0
    return count


@device
def rut_of(tracks, found, count, ground):
    """Depth of the rut that tracks make together, and which decides the surface, -1 for none.

    As `field.ruts.rut_at`; `ground` is the index of the ground's surface, -1 for none.
    """
    first, passes = -1.0, 0.0
    deepest, worn = np.int64(-1), np.int64(-1)
    for k in range(count):
        track = found[k]
        depth = tracks.depths[tracks.law[track], ground + 1]
        if np.isnan(depth):  # the void
            return 0.0, np.int64(-1)
        passes += tracks.passes[track]
        if depth > first or (depth == first and track < deepest):
            first, deepest = depth, track
        if tracks.surface[track] >= 0:
            worn = max(worn, track)
    if deepest < 0:
        return 0.0, worn
    return deepened(first, passes, tracks.power[deepest]), worn
