"""Ruts at a point: which tracks hold it, how deep they are together, what the ground is in them."""

from __future__ import annotations

import numpy as np

from terratool.field.capsules import PARTS, holds
from terratool.field.primitives import ONE, device, kernel


@device
def deepened(first, passes, power):
    """Depth of a rut after so many passes, in the units of the `first`.

    z_n = z_1 · n^(1/a), `power` being 1/a: Abebe, Tanaka and Yamazaki, Soil compaction by multiple
    passes of a rigid wheel relevant for optimization of traffic, Journal of Terramechanics 26(2),
    1989, 139-148.
    """
    return first * passes**power if passes > 1.0 else first


@device
def cell_at(tracks, x, y):
    """The cell of the index that a point lies in; -1 if no track is near."""
    u = (x - tracks.frame[0]) * tracks.frame[2]
    v = (y - tracks.frame[1]) * tracks.frame[3]
    if not (0.0 <= u < tracks.shape[0] and 0.0 <= v < tracks.shape[1]):
        return np.int64(-1)
    i, j = np.int64(u), np.int64(v)
    cell = j * tracks.shape[0] + i
    part = np.uint64(int((v - j) * PARTS) * PARTS + int((u - i) * PARTS))
    return cell if (tracks.masks[np.uint64(cell)] >> part) & ONE else np.int64(-1)


@kernel
def rut_in(tracks, cell, x, y, ground):
    """As rut_at(), in a cell of the index."""
    begin, end = tracks.offsets[cell], tracks.offsets[cell + 1]
    last = np.int64(-1)
    deepest = np.int64(-1)
    worn = np.int64(-1)
    first = 0.0
    passes = 0.0
    for k in range(begin, end):
        segment = tracks.segments[np.uint64(tracks.entries[k])]
        track = np.int64(segment.track)
        if track == last or not holds(segment, x, y):
            continue
        last = track
        depth = tracks.depths[tracks.law[track], ground + 1]
        if np.isnan(depth):
            return 0.0, np.int64(-1)
        passes += tracks.passes[track]
        if deepest < 0 or depth > first:
            first, deepest = depth, track
        if tracks.surface[track] >= 0:
            worn = track
    if deepest < 0:
        return 0.0, worn
    return deepened(first, passes, tracks.power[deepest]), worn


@device
def rut_at(tracks, x, y, ground):
    """Depth of the rut at a point, and the track that decides the surface there, -1 for none.

    `ground` is the index of the ground's surface, -1 for none. In the void there is no rut.
    """
    cell = cell_at(tracks, x, y)
    if cell < 0:
        return 0.0, np.int64(-1)
    return rut_in(tracks, cell, x, y, ground)


@kernel
def near_ruts(tracks, x, y, u, v, out):
    """Which of a block of points lie where tracks may be: their indices into `out`, their number.

    `u` and `v` are scratch. No point waits for another, nor for a branch.
    """
    west, south, per_x, per_y = tracks.frame
    nx, ny = float(tracks.shape[0]), float(tracks.shape[1])
    for n in range(len(x)):  # vectorised
        u[n] = (x[n] - west) * per_x
        v[n] = (y[n] - south) * per_y
    count = 0
    for n in range(len(x)):
        within = (u[n] >= 0.0) & (u[n] < nx) & (v[n] >= 0.0) & (v[n] < ny)
        s, t = (u[n], v[n]) if within else (0.0, 0.0)
        i, j = np.int64(s), np.int64(t)
        part = np.uint64(int((t - j) * PARTS) * PARTS + int((s - i) * PARTS))
        hit = (tracks.masks[np.uint64(j * tracks.shape[0] + i)] >> part) & ONE
        out[count] = n
        count += 1 if within and hit != 0 else 0
    return count
