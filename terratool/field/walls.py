"""Walls between neighbouring pixels: where they may stand, whether they do, and which way they run.

A pair of neighbours is a candidate if its patches differ. Whether there is a wall is found by
halving what lies between the two centres: by the heights and slopes of the descent, and if that
finds nothing, by patches.
"""

from __future__ import annotations

import math

import numpy as np

from terratool.field.kernels import descend, inside, lowered, void_at
from terratool.field.painting import paint_tile
from terratool.field.primitives import kernel
from terratool.field.treading import tread

_HALVINGS = 30
"""A wall is looked for down to a billionth of a pixel: no slope changes the height much there …"""
_STEEPER = 4.0
"""… and neither does the rim of a dome, by so many times what its slope there would."""

_EDGES = 8
"""So many edges between two pixels are looked at for a wall."""

_ASIDE = 1.0 / 64.0
"""So far beside a wall, in pixels, it is looked for again, to see which way it runs, …"""
_REACH = 0.25
"""… up to here on either side: walls that run nearly along the pair leave it, and weigh little."""
_GRAZING = 0.5 * _ASIDE / _REACH
_BLUR = 4.0 * 2.0 ** -(_HALVINGS // 2)


@kernel
def _differing(one, other):
    count = 0
    for n in range(len(one)):
        count += one[n] != other[n]
    return count


@kernel
def count_candidates(patches, height, width):
    """Pairs of different patches, their first pixels in the first `height` rows, `width` columns.

    `patches` are (H, W) uint32; pairs go from west to east and from north to south.
    """
    count = 0
    rows, columns = patches.shape
    for r in range(height):
        row = patches[r]
        wide = min(width, columns - 1)
        count += _differing(row[:wide], row[1 : wide + 1])
        if r + 1 < rows:
            count += _differing(row[:width], patches[r + 1, :width])
    return count


@kernel
def candidates(patches, heights, height, width, pairs, rises):
    """The pairs that count_candidates() counts, but for those with NaN; returns their number.

    `pairs` gets twice the index of the first pixel, and one for a pair from north to south; `rises`
    the differences of their heights, without sign.
    """
    count = 0
    rows, columns = patches.shape
    for r in range(height):
        row, own = patches[r], heights[r]
        wide = min(width, columns - 1)
        if _differing(row[:wide], row[1 : wide + 1]):
            for c in range(wide):
                if row[c] != row[c + 1] and not np.isnan(own[c] + own[c + 1]):
                    pairs[count] = 2 * (r * columns + c)
                    rises[count] = abs(np.float64(own[c + 1]) - np.float64(own[c]))
                    count += 1
        if r + 1 < rows:
            row_below, below = patches[r + 1], heights[r + 1]
            if _differing(row[:width], row_below[:width]):
                for c in range(width):
                    if row[c] != row_below[c] and not np.isnan(own[c] + below[c]):
                        pairs[count] = 2 * (r * columns + c) + 1
                        rises[count] = abs(np.float64(below[c]) - np.float64(own[c]))
                        count += 1
    return count


@kernel
def _height(field, along_x, at, fixed, stack):
    """Height and slope along an axis; NaN outside and in the void."""
    x, y = (at, fixed) if along_x else (fixed, at)
    if not inside(field.bounds, x, y):
        return np.nan, np.nan
    z, winner, slope_x, slope_y = descend(field, x, y, stack, True, False, 0.0, 0, 0, 0.0, 0.0)
    if void_at(field, winner):
        return np.nan, np.nan
    return lowered(field, z, winner, x, y), slope_x if along_x else slope_y


@kernel
def _is_wall(z_low, slope_low, z_high, slope_high, width, level):
    """Height of what two places so near to each other have between them, 0 if it is no wall."""
    jump = abs(z_high - z_low)
    sloping = width * max(abs(slope_low), abs(slope_high))
    return jump if jump > level and jump > _STEEPER * sloping else 0.0


@kernel
def find_jump(field, along_x, low, high, fixed, halvings, level, stack):
    """A wall higher than `level` between two places on a line, by heights: where, how high or 0.

    Kept is always the half whose change its slopes explain less.
    """
    z_low, slope_low = _height(field, along_x, low, fixed, stack)
    z_high, slope_high = _height(field, along_x, high, fixed, stack)
    for _ in range(halvings):
        half = 0.5 * (high - low)
        middle = low + half
        if not low < middle < high:
            break
        z, slope = _height(field, along_x, middle, fixed, stack)
        left = abs(z - z_low - 0.5 * half * (slope_low + slope))
        right = abs(z_high - z - 0.5 * half * (slope + slope_high))
        if left >= right:
            high, z_high, slope_high = middle, z, slope
        else:
            low, z_low, slope_low = middle, z, slope
    jump = _is_wall(z_low, slope_low, z_high, slope_high, high - low, level)
    return low + 0.5 * (high - low), jump


@kernel
def _patch(field, canvas, along_x, at, fixed, resolution):
    """The patch of a place, painted as a tile of one pixel."""
    x, y = canvas.point[:1], canvas.point[1:]
    x[0], y[0] = (at, fixed) if along_x else (fixed, at)
    if not inside(field.bounds, x[0], y[0]):
        return np.uint32(0)
    paint_tile(field, canvas, x, y, resolution, 0, 1, 0, 1)
    if len(field.tracks.masks):
        tread(field, canvas, x, y, 0, 1, 0, 1)
    return canvas.patches[0]


@kernel
def find_edge(field, canvas, along_x, low, high, fixed, resolution, halvings, level):
    """As find_jump(), by patches: slower, but a low wall beside something steep is found too."""
    end, last = high, _patch(field, canvas, along_x, high, fixed, resolution)
    for _ in range(_EDGES):
        first = _patch(field, canvas, along_x, low, fixed, resolution)
        if first == last:
            break
        high = end
        for _ in range(halvings):
            middle = low + 0.5 * (high - low)
            if not low < middle < high:
                break
            if _patch(field, canvas, along_x, middle, fixed, resolution) == first:
                low = middle
            else:
                high = middle
        z_low, slope_low = _height(field, along_x, low, fixed, canvas.stack)
        z_high, slope_high = _height(field, along_x, high, fixed, canvas.stack)
        jump = _is_wall(z_low, slope_low, z_high, slope_high, high - low, level)
        if jump > 0.0:
            return low + 0.5 * (high - low), jump
        low = high  # an edge without a wall; on to the next
    return low, 0.0


@kernel
def find_wall(field, canvas, along_x, low, high, fixed, resolution, halvings, level):
    """Where between two places on a line a wall higher than `level` stands, how high or 0."""
    at, jump = find_jump(field, along_x, low, high, fixed, halvings, level, canvas.stack)
    if jump == 0.0:
        return find_edge(field, canvas, along_x, low, high, fixed, resolution, halvings, level)
    return at, jump


@kernel
def _ends(pair, x, y):
    """Whether a pair lies along x, its two places on its line, and where the line is."""
    pixel = pair >> 1
    r, c = pixel // len(x), pixel % len(x)
    if pair & 1:
        return False, y[r + 1], y[r], x[c]
    return True, x[c], x[c + 1], y[r]


@kernel
def measure(field, canvas, pairs, x, y, resolution, level, jumps, lengths):
    """For each pair the height of the wall in it, 0 if none, and for how much wall it stands.

    The `lengths` are in pixels. For each pixel of its length a wall with the normal n crosses |n_x|
    pairs along x and |n_y| along y; so pairs that count |n_x| and |n_y| add up to it, n² being 1.
    Walls along the axes, turned and round ones all have their length.
    """
    reach, aside = _REACH * resolution, _ASIDE * resolution
    for n in range(len(pairs)):
        along_x, low, high, fixed = _ends(pairs[n], x, y)
        at, jump = find_wall(field, canvas, along_x, low, high, fixed, resolution, _HALVINGS, level)
        jumps[n] = jump
        lengths[n] = 0.0 if jump == 0.0 else _GRAZING
        if jump == 0.0:
            continue
        for side in (-aside, aside):
            near, again = find_wall(
                field, canvas, along_x, at - reach, at + reach, fixed + side, resolution,
                _HALVINGS // 2, 0.5 * jump,
            )  # fmt: skip
            if again > 0.0:
                # as exactly as it was found it runs straight across the pair, or not
                shift = near - at if abs(near - at) > reach * _BLUR else 0.0
                lengths[n] = aside / math.sqrt(aside**2 + shift**2)
                break


@kernel
def first_wall(field, canvas, pairs, heights, x, y, resolution, level):
    """Index of the first pair with a wall of at least this height, and the height; -1 for none."""
    for n in range(len(pairs)):
        along_x, low, high, fixed = _ends(pairs[n], x, y)
        _, jump = find_wall(field, canvas, along_x, low, high, fixed, resolution, _HALVINGS, level)
        if jump > 0.0 and jump >= heights[n]:
            return n, jump
    return -1, 0.0


@kernel
def walls_between(field, canvas, pairs, x, y, resolution, level, places, jumps, todo):
    """Walls above `level` between the places of each pair: up to as many as there is room for.

    `places` and `jumps` are (pairs, most): where along its axis each stands, and by how much the
    ground rises there to the east or north, below 0 if it falls; 0 for no wall. In no order. More
    than one is looked for where one does not explain what rises. `todo` is scratch, (most + 2, 2).
    """
    for n in range(len(pairs)):
        along_x, low, high, fixed = _ends(pairs[n], x, y)
        jumps[n, :] = 0.0
        beside = (high - low) * 2.0 ** -(_HALVINGS - 4)
        left = _height(field, along_x, high, fixed, canvas.stack)[0]
        left -= _height(field, along_x, low, fixed, canvas.stack)[0]
        count, pending = 0, 1
        todo[0, 0], todo[0, 1] = low, high
        while pending > 0 and count < jumps.shape[1]:
            pending -= 1
            begin, end = todo[pending, 0], todo[pending, 1]
            if count == 0:
                at, jump = find_wall(
                    field, canvas, along_x, begin, end, fixed, resolution, _HALVINGS, level
                )
            else:
                at, jump = find_jump(
                    field, along_x, begin, end, fixed, _HALVINGS, level, canvas.stack
                )
            if jump == 0.0:
                continue
            after = _height(field, along_x, at + beside, fixed, canvas.stack)[0]
            if after < _height(field, along_x, at - beside, fixed, canvas.stack)[0]:
                jump = -jump
            places[n, count], jumps[n, count] = at, jump
            count += 1
            left -= jump
            if abs(left) > level:
                todo[pending, 0], todo[pending, 1] = begin, at - beside
                todo[pending + 1, 0], todo[pending + 1, 1] = at + beside, end
                pending += 2
