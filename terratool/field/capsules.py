"""What a track holds: points no farther than half its width from its polyline. Index and rows.

A segment of a track is a capsule, a strip with round ends. `holds` decides about every point that
anything asks about; the other kernels only tell where that is certain, and leave out the rest.
"""

from __future__ import annotations

import math

import numpy as np

from terratool.field.primitives import device, kernel

_NOISE = 1e-13
"""No rounding in `holds` is worth more, in lengths of the segment and its width."""
_UPRIGHT = 1e-290
"""A segment that goes less far along an axis does not go along it."""
PARTS = 8
"""Each cell of the index has so many parts along both axes, a bit of its mask each."""
_GAP = 1e-6
"""How far around a capsule parts of the index are marked, in sides of a part."""
_ULPS = 1e-15
_ROOM = 16
"""A segment may lie in so many cells on average before these are made larger."""


@device
def holds(segment, x, y):
    """Whether a point is no farther from a segment than half the width of its track.

    Squares are compared, in double precision, and nothing is divided.
    """
    ex, ey = x - segment.x, y - segment.y
    along = ex * segment.dx + ey * segment.dy
    if along <= 0.0:
        return ex * ex + ey * ey <= segment.reach_square
    if along >= segment.square:
        ex, ey = x - segment.end_x, y - segment.end_y
        return ex * ex + ey * ey <= segment.reach_square
    across = ex * segment.dy - ey * segment.dx
    return across * across <= segment.reach_square * segment.square


@device
def noise(segment):
    """How near to its edge rounding may decide whether a segment holds a point."""
    return _NOISE * (abs(segment.dx) + abs(segment.dy) + segment.reach)


@device
def _disc(reach, height):
    """Half the chord of a disc at a height over its middle; negative where it has none."""
    square = (reach - height) * (reach + height)
    return math.sqrt(square) if square >= 0.0 else -1.0


@device
def measures(segment):
    """Length of a segment, and 1 / dx and 1 / dy, 0 where it runs along the other axis."""
    over_x = 1.0 / segment.dx if abs(segment.dx) > _UPRIGHT else 0.0
    over_y = 1.0 / segment.dy if abs(segment.dy) > _UPRIGHT else 0.0
    return math.sqrt(segment.square), over_x, over_y


@device
def interval(segment, reach, y, length, over_x, over_y):
    """West and east end of the points at `y` within `reach` of a segment, with its `measures`.

    They count from the segment's beginning. Where there are none, the west end is the greater.
    """
    ey = y - segment.y
    west, east = math.inf, -math.inf
    if reach < 0.0:
        return west, east
    half = _disc(reach, abs(ey))
    if half >= 0.0:
        west, east = -half, half
    half = _disc(reach, abs(y - segment.end_y))
    if half >= 0.0:
        west, east = min(west, segment.dx - half), max(east, segment.dx + half)
    # the strip: 0 <= along <= square, |across| <= reach · length
    low, high = min(0.0, segment.dx) - reach, max(0.0, segment.dx) + reach
    along = ey * segment.dy
    if over_x != 0.0:
        one, other = -along * over_x, (segment.square - along) * over_x
        low, high = max(low, min(one, other)), min(high, max(one, other))
    elif not 0.0 <= along <= segment.square:
        return west, east
    middle, wide = ey * segment.dx, reach * length
    if over_y != 0.0:
        one, other = (middle - wide) * over_y, (middle + wide) * over_y
        low, high = max(low, min(one, other)), min(high, max(one, other))
    elif abs(middle) > wide:
        return west, east
    if low <= high:
        west, east = min(west, low), max(east, high)
    return west, east


@kernel
def reached(segment, low, high, beyond):
    """West and east end of what a segment may hold between two heights, and `beyond` around it."""
    reach = segment.reach + beyond + noise(segment)
    one, other = 0.0, 1.0
    if segment.dy != 0.0:
        first = (low - reach - segment.y) / segment.dy
        last = (high + reach - segment.y) / segment.dy
        one, other = max(0.0, min(first, last)), min(1.0, max(first, last))
    elif segment.y < low - reach or segment.y > high + reach:
        return math.inf, -math.inf
    if one > other:
        return math.inf, -math.inf
    begin, end = segment.x + one * segment.dx, segment.x + other * segment.dx
    return min(begin, end) - reach, max(begin, end) + reach


@device
def _cell(coordinate, start, per, count):
    """Which of the `count` cells along an axis, the first or last where it lies beyond them."""
    return int(min(max((coordinate - start) * per, 0.0), count - 1.0))


@device
def rows_of(segment, start, per, count, beyond):
    """First and last row of cells that a segment may reach; none where the last is the less."""
    reach = segment.reach + beyond + noise(segment)
    low = min(segment.y, segment.end_y) - reach
    high = max(segment.y, segment.end_y) + reach
    if not ((high - start) * per >= 0.0 and (low - start) * per < count):
        return 0, -1
    return _cell(low, start, per, count), _cell(high, start, per, count)


@device
def columns_of(segment, row, frame, parts, nx, beyond):
    """First and last column that a segment may reach in a row, as `rows_of`.

    Each cell of the frame counts as `parts` along both axes.
    """
    per_x, per_y = frame[2] * parts, frame[3] * parts
    low = frame[1] + row / per_y
    west, east = reached(segment, low, low + 1.0 / per_y, beyond)
    if not ((east - frame[0]) * per_x >= 0.0 and (west - frame[0]) * per_x < nx):
        return 0, -1
    return _cell(west, frame[0], per_x, nx), _cell(east, frame[0], per_x, nx)


@device
def margin(frame, shape, parts):
    """How far around what it holds a segment is put into the index: more than is ever rounded."""
    wide, tall = shape[0] / frame[2], shape[1] / frame[3]
    side = 1.0 / (parts * min(frame[2], frame[3]))
    return _GAP * side + _ULPS * (abs(frame[0]) + abs(frame[1]) + wide + tall)


@kernel
def count_entries(segments, frame, shape, limit):
    """Cells of the index that the segments may reach, all together; beyond `limit` if so many."""
    total = 0
    nx, ny = shape[0], shape[1]
    beyond = margin(frame, shape, 1.0)
    for s in range(len(segments)):
        low, high = rows_of(segments[s], frame[1], frame[3], ny, beyond)
        for row in range(low, high + 1):
            first, last = columns_of(segments[s], row, frame, 1.0, nx, beyond)
            total += max(0, last - first + 1)
            if total > limit:
                return total
    return total


@kernel
def choose_cells(segments, extent, frame, shape):
    """Choose the cells of the index, `frame[2:]` and `shape`, and return its entries.

    It begins with about a cell a segment, and makes them larger until the entries do not fill
    the memory. The last cell along an axis is half beyond the frame: nothing within is.
    """
    room = _ROOM * len(segments) + 64
    most = len(segments) + 64.0
    side = max(math.sqrt(extent[0] * (extent[1] / most)), max(extent[0], extent[1]) / most)
    while True:
        for axis in range(2):
            shape[axis] = int(extent[axis] / side) + 1
            frame[2 + axis] = (shape[axis] - 0.5) / extent[axis]
        total = count_entries(segments, frame, shape, room)
        if total <= room or shape[0] * shape[1] == 1:
            return total
        side *= 2.0


@kernel
def fill_index(segments, frame, shape, masks, offsets, entries):
    """Fill the index: `masks` and `offsets` are to be 0."""
    nx, ny = shape[0], shape[1]
    beyond = margin(frame, shape, 1.0)
    for s in range(len(segments)):
        low, high = rows_of(segments[s], frame[1], frame[3], ny, beyond)
        for row in range(low, high + 1):
            first, last = columns_of(segments[s], row, frame, 1.0, nx, beyond)
            for column in range(first, last + 1):
                offsets[row * nx + column] += 1
    begin = 0
    for slot in range(len(offsets)):
        count = offsets[slot]
        offsets[slot] = begin
        begin += count
    for s in range(len(segments)):
        low, high = rows_of(segments[s], frame[1], frame[3], ny, beyond)
        for row in range(low, high + 1):
            first, last = columns_of(segments[s], row, frame, 1.0, nx, beyond)
            for column in range(first, last + 1):
                slot = row * nx + column
                entries[offsets[slot]] = s
                offsets[slot] += 1
    # each offset has moved to its end, which is the next one's beginning
    for slot in range(len(offsets) - 1, 0, -1):
        offsets[slot] = offsets[slot - 1]
    offsets[0] = 0
    _fill_masks(segments, frame, shape, masks)


@kernel
def _fill_masks(segments, frame, shape, masks):
    nx, ny = shape[0], shape[1]
    beyond = margin(frame, shape, float(PARTS))
    for s in range(len(segments)):
        low, high = rows_of(segments[s], frame[1], frame[3] * PARTS, ny * PARTS, beyond)
        for row in range(low, high + 1):
            first, last = columns_of(segments[s], row, frame, float(PARTS), nx * PARTS, beyond)
            for column in range(first, last + 1):
                bit = np.uint64((row % PARTS) * PARTS + column % PARTS)
                masks[row // PARTS * nx + column // PARTS] |= np.uint64(1) << bit
