"""Kernels that sweep a vehicle's footprint over ground, all columns of a row at a time.

Ground is (rows, phases, columns) float32: of `phases` neighbouring pixels one is a reference point,
and pixel `phases · q + p` of a row is at [p, q], so that what lies equally far from the reference
points of a row lies side by side. Where there is no ground it is minus infinity. Offsets are
(n, 3) int64: rows, phase and columns, as seen from [row, 0, 0] of a reference point.
"""

from __future__ import annotations

import numpy as np

from terratool.traversability.terramechanics.kernels import kernel

_NOTHING = np.float32(-np.inf)


@kernel
def highest(ground, first, phases, offsets, lift, out):
    """For each reference point the highest ground under offsets, each raised by its `lift`.

    `first` is the row of the first reference points, `out` (height, width).
    """
    height, width = out.shape
    for i in range(height):
        best = out[i]
        for j in range(width):
            best[j] = _NOTHING
        for n in range(len(offsets)):
            q = offsets[n, 2]
            row = ground[first + phases * i + offsets[n, 0], offsets[n, 1], q : q + width]
            raised = lift[n]
            for j in range(width):
                z = row[j] + raised
                best[j] = z if z > best[j] else best[j]


@kernel
def mean(ground, first, phases, offsets, out):
    """For each reference point the mean over offsets."""
    height, width = out.shape
    share = np.float32(1.0 / len(offsets))
    for i in range(height):
        total = out[i]
        for j in range(width):
            total[j] = 0.0
        for n in range(len(offsets)):
            q = offsets[n, 2]
            row = ground[first + phases * i + offsets[n, 0], offsets[n, 1], q : q + width]
            for j in range(width):
                total[j] += row[j]
        for j in range(width):
            total[j] *= share


@kernel
def bumps(ground, first, phases, offsets, shifts, plane, work, out):
    """For each reference point how far the ground under offsets stands above its plane at most.

    Args:
        ground: as said above.
        first: row of the first reference points.
        phases: of the ground.
        offsets: by rows.
        shifts: (n, 2) float32, how far east and north each is, m.
        plane: (3, height, width) float32: height, dz/dx, dz/dy.
        work: (width,) float32.
        out: (height, width) float32; minus infinity for no offsets.
    """
    height, width = out.shape
    for i in range(height):
        best, east, north = out[i], plane[1, i], plane[2, i]
        for j in range(width):
            best[j] = _NOTHING
        n = 0
        while n < len(offsets):
            line, dy = offsets[n, 0], shifts[n, 1]
            for j in range(width):
                work[j] = _NOTHING
            while n < len(offsets) and offsets[n, 0] == line:
                q, dx = offsets[n, 2], shifts[n, 0]
                row = ground[first + phases * i + line, offsets[n, 1], q : q + width]
                for j in range(width):
                    z = row[j] - east[j] * dx
                    work[j] = z if z > work[j] else work[j]
                n += 1
            for j in range(width):
                z = work[j] - north[j] * dy
                best[j] = z if z > best[j] else best[j]
        for j in range(width):
            best[j] -= plane[0, i, j]


@kernel
def roughness(ground, first, phases, offsets, shifts, plane, spread, work, out):
    """For each reference point the RMS distance of the ground at offsets from its plane.

    The plane is that of least squares; distances are along z. NaN where ground is missing.

    Args:
        ground: as said above.
        first: row of the first reference points.
        phases: of the ground.
        offsets: symmetric about the reference point.
        shifts: (n, 2) float32, how far east and north each is, m.
        plane: as in `bumps`; it only keeps numbers small.
        spread: (3,) float32, the inverse of the offsets' second moments: xx, xy, yy; 0 for none.
        work: (4, width) float32.
        out: (height, width) float32.
    """
    height, width = out.shape
    total, squares, by_x, by_y = work[0], work[1], work[2], work[3]
    share = np.float32(1.0 / max(1, len(offsets)))
    for i in range(height):
        level, east, north = plane[0, i], plane[1, i], plane[2, i]
        for j in range(width):
            total[j] = squares[j] = by_x[j] = by_y[j] = 0.0
        for n in range(len(offsets)):
            q, dx, dy = offsets[n, 2], shifts[n, 0], shifts[n, 1]
            row = ground[first + phases * i + offsets[n, 0], offsets[n, 1], q : q + width]
            for j in range(width):
                z = row[j] - (level[j] + east[j] * dx + north[j] * dy)
                total[j] += z
                squares[j] += z * z
                by_x[j] += z * dx
                by_y[j] += z * dy
        for j in range(width):
            x, y = by_x[j], by_y[j]
            fitted = spread[0] * x * x + np.float32(2.0) * spread[1] * x * y + spread[2] * y * y
            left = (squares[j] - total[j] * total[j] * share - fitted) * share
            out[i, j] = np.sqrt(max(left, np.float32(0.0))) if left == left else left


@kernel
def raise_steps(supports, pairs, jumps, ahead, strides, work, out):
    """Mark pixels beside walls with the step that a wheel with a heading, or its opposite, meets.

    That is the wall, or what the wheel rises or sinks within some strides before and behind it if
    that is less: it bridges narrow gaps, and goes along walls. What it rises by the slope of the
    ground is not counted: the median of its strides.

    Args:
        supports: (rows, columns) float32, how high a wheel stands; minus infinity for no ground.
        pairs: twice the index of the first pixel, and one for a pair from north to south.
        jumps: heights of the walls; infinity for a steep face without one.
        ahead: unit vector of the heading, east and north.
        strides: of a pixel's side, before and behind.
        work: (4 · strides + 1,) float64.
        out: (rows, columns) float32, 0 at first.
    """
    rows, columns = supports.shape
    for n in range(len(pairs)):
        pixel = pairs[n] >> 1
        row, column = pixel // columns, pixel % columns
        low, high = 0.5 * (pairs[n] & 1), 0.5 * (1 - (pairs[n] & 1))
        count, last = 0, np.float64(_NOTHING)
        for s in range(-strides, strides + 1):
            r = int(np.floor(row + low - s * ahead[1] + 0.5))
            c = int(np.floor(column + high + s * ahead[0] + 0.5))
            inside = 0 <= r < rows and 0 <= c < columns
            z = np.float64(supports[r, c]) if inside else np.float64(_NOTHING)
            if z > _NOTHING:
                if last > _NOTHING:
                    work[count] = z - last
                    count += 1
                last = z
        if count == 0:
            continue
        taken = work[:count]
        middle = np.sort(taken)[count // 2]
        at = least = most = 0.0
        for s in range(count):
            at += taken[s] - middle
            least, most = min(least, at), max(most, at)
        step = np.float32(min(jumps[n], most - least))
        other = pixel + (columns if pairs[n] & 1 else 1)
        for p in (pixel, other):
            r, c = p // columns, p % columns
            out[r, c] = max(out[r, c], step)
