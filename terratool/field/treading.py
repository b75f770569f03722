"""Tracks pressed into a tile of pixels whose elements are painted.

Segment by segment the pixels of each row that it holds are found; where rounding might decide,
`holds` is asked. Each track counts once for a pixel, so a pixel keeps the last that it had.
"""

from __future__ import annotations

import numpy as np

from terratool.field.canvas import WIDTH
from terratool.field.capsules import holds, interval, measures, noise
from terratool.field.patches import mix
from terratool.field.primitives import ONE, device, kernel
from terratool.field.rows import fill
from terratool.field.ruts import deepened

_TRACK = np.uint64(1 << 61)
_DEPTH = np.uint64(5 << 60)
_WORD = 64
_FEW = 12
"""Of no more pixels in a row each is asked about: that is quicker than to know which are sure."""


@kernel
def mark_segments(tracks, near, west, south, east, north):
    """Set the bits of the segments in the cells of the index that a rectangle meets.

    Returns the first and the last word of `near` with a bit; none where the last is the less.
    """
    low, high = len(near), -1
    nx, ny = tracks.shape[0], tracks.shape[1]
    first_x = (west - tracks.frame[0]) * tracks.frame[2]
    last_x = (east - tracks.frame[0]) * tracks.frame[2]
    first_y = (south - tracks.frame[1]) * tracks.frame[3]
    last_y = (north - tracks.frame[1]) * tracks.frame[3]
    if not (last_x >= 0.0 and first_x < nx and last_y >= 0.0 and first_y < ny):
        return low, high
    for j in range(int(max(first_y, 0.0)), int(min(last_y, ny - 1.0)) + 1):
        for i in range(int(max(first_x, 0.0)), int(min(last_x, nx - 1.0)) + 1):
            cell = j * nx + i
            for k in range(tracks.offsets[cell], tracks.offsets[cell + 1]):
                segment = int(tracks.entries[k])
                word = segment // _WORD
                near[word] |= ONE << np.uint64(segment % _WORD)
                low, high = min(low, word), max(high, word)
    return low, high


@device
def pixels_per(x, begin, end):
    """Pixels in a unit of length; 0 where they are too near to one another to tell."""
    wide = x[end - 1] - x[begin]
    return (end - 1 - begin) / wide if wide > 0.0 else 0.0


@device
def first_from(x, begin, end, origin, at, per):
    """The first of ascending coordinates, `per` in a unit, that is at least `at` from an origin."""
    s = (at - (x[begin] - origin)) * per
    n = begin + int(min(max(s, 0.0), float(end - begin)))
    while n > begin and x[n - 1] - origin >= at:
        n -= 1
    while n < end and x[n] - origin < at:
        n += 1
    return n


@device
def press(canvas, pixel, track, depths, passes, worn, mark):
    """Let a track pass over a pixel: `depths` by the surface of the ground, `worn` if it has one.

    Neighbours mostly are new to all tracks, so what they get is written and not read.
    """
    stamp = canvas.stamps[pixel]
    if stamp == track + 1:
        return
    depth = depths[np.int64(canvas.surfaces[pixel])]
    if np.isnan(depth):  # the void
        return
    canvas.stamps[pixel] = track + 1
    if stamp == 0:
        canvas.passes[pixel] = passes
        canvas.first[pixel] = depth
        canvas.deepest[pixel] = track
        canvas.worn[pixel] = worn
    else:
        canvas.passes[pixel] += passes
        if depth > canvas.first[pixel]:
            canvas.first[pixel] = depth
            canvas.deepest[pixel] = track
        if worn:
            canvas.worn[pixel] = worn
    if len(canvas.patches):
        canvas.patches[pixel] += mark


@kernel
def tread_segment(tracks, canvas, index, x, y, per_x, per_y, west, east, south, north):
    """Let the track of a segment pass over what that holds of the given columns and rows."""
    segment = tracks.segments[index]
    track = np.int64(segment.track)
    mark = mix(_TRACK + np.uint64(track))
    depths, passes = tracks.depths[tracks.law[track]], tracks.passes[track]
    worn = track + 1 if tracks.surface[track] >= 0 else 0
    blur = noise(segment)
    outer, inner = segment.reach + blur, segment.reach - blur
    low, high = min(0.0, segment.dy) - outer, max(0.0, segment.dy) + outer
    shape = measures(segment)
    for r in range(first_from(y, south, north, segment.y, low, per_y), north):
        if y[r] - segment.y > high:
            break
        begin, end = interval(segment, outer, y[r], *shape)
        if begin > end:
            continue
        first = first_from(x, west, east, segment.x, begin, per_x)
        stop = first_from(x, first, east, segment.x, end, per_x) if first < east else first
        sure, unsure = stop, stop
        if stop - first > _FEW:
            begin, end = interval(segment, inner, y[r], *shape)
            if begin < end:
                sure = first_from(x, first, stop, segment.x, begin, per_x)
                unsure = first_from(x, sure, stop, segment.x, end, per_x) if sure < stop else stop
        at = r * WIDTH
        for c in range(first, sure):
            if holds(segment, x[c], y[r]):
                press(canvas, at + c, track, depths, passes, worn, mark)
        for c in range(sure, unsure):
            press(canvas, at + c, track, depths, passes, worn, mark)
        for c in range(unsure, stop):
            if holds(segment, x[c], y[r]):
                press(canvas, at + c, track, depths, passes, worn, mark)


@kernel
def lower(tracks, canvas, begin, end):
    """Take the ruts from the heights of a run of pixels that the tracks have passed over."""
    first, passes, deepest, rut = -1.0, 0.0, np.uint32(0), 0.0
    for p in range(begin, end):
        if canvas.stamps[p] == 0:
            continue
        if (
            canvas.first[p] != first or canvas.passes[p] != passes or canvas.deepest[p] != deepest
        ):  # neighbours mostly are alike
            first, passes, deepest = canvas.first[p], canvas.passes[p], canvas.deepest[p]
            rut = deepened(first, passes, tracks.power[deepest])
        canvas.heights[p] -= rut
        if canvas.worn[p]:
            canvas.surfaces[p] = tracks.surface[canvas.worn[p] - 1] + 1
        if len(canvas.patches) and rut != 0.0:
            canvas.patches[p] += mix(_DEPTH ^ np.float64(rut).view(np.uint64))


@kernel
def tread(field, canvas, x, y, west, east, south, north):
    """Press the tracks into a part of a tile: heights, surfaces and patches."""
    tracks, near = field.tracks, canvas.near
    low, high = mark_segments(tracks, near, x[west], y[south], x[east - 1], y[north - 1])
    if low > high:
        return
    for r in range(south, north):
        fill(canvas.stamps[r * WIDTH + west : r * WIDTH + east], 0)
    per_x, per_y = pixels_per(x, west, east), pixels_per(y, south, north)
    for word in range(low, high + 1):
        bits = near[word]
        near[word] = 0
        for bit in range(_WORD if bits else 0):
            if (bits >> np.uint64(bit)) & ONE:
                tread_segment(
                    tracks, canvas, word * _WORD + bit, x, y, per_x, per_y, west, east, south, north
                )
    for r in range(south, north):
        lower(tracks, canvas, r * WIDTH + west, r * WIDTH + east)
