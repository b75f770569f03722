"""The descent in the language of NVIDIA Warp, for GPUs and for the kernels of others.

It follows `kernels/field/query.hpp` and its includes step by step in float64, so that heights agree
to the last bit. Names agree where they can; the reasons stand there. Warp compiles this module at
the first launch; Python only reads the annotations.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from terratool.field.records import COMBINE, STEPPED

OPTIONS = {"enable_backward": False, "fuse_fp": False}
"""Module options: no gradients, and no fused sums, as edges need more digits than a double has."""

ZERO, HALF, ONE, TWO, THREE = (wp.constant(wp.float64(n)) for n in (0.0, 0.5, 1.0, 2.0, 3.0))
NAN = wp.constant(wp.float64(float("nan")))
EDGE = wp.constant(wp.float64(1e-9))
STEP = wp.constant(wp.float64(1e-12))
FREE_NOISE = wp.constant(wp.float64(2.0**-50))
SPLITTER = wp.constant(wp.float64(134217729.0))
NEAR_MIDDLE = wp.constant(wp.float64(2.0**-28))
PRODUCT, SUM, MIN, RADIAL, GRID = (
    wp.constant(COMBINE[how]) for how in ("product", "sum", "min", "radial", "grid")
)

PARTS = wp.constant(wp.float64(8.0))
BUMP_REACH, BUMP_SQUARE = wp.constant(wp.float64(1.5)), wp.constant(wp.float64(2.25))
BUMP_CELLS = wp.constant(4)
FARTHEST_CELL = wp.constant(wp.float64(2.0**50))
STEEPNESS = wp.constant(wp.float64(-6.0))

HASH_1 = wp.constant(wp.uint64(0x9E3779B97F4A7C15))
HASH_2 = wp.constant(wp.uint64(0xBF58476D1CE4E5B9))
HASH_3 = wp.constant(wp.uint64(0x94D049BB133111EB))
LOW_21 = wp.constant(wp.uint64(0x1FFFFF))
LOW_22 = wp.constant(wp.uint64(0x3FFFFF))
FINE = wp.constant(wp.float64(2.0**-21))
FINER = wp.constant(wp.float64(2.0**-22))


@wp.struct
class DeviceAxis:
    """One axis of a grid: `GridAxis` of the kernels.

    Within `clear` of a cell's middle, in cells, no edge is near.
    """

    corner: wp.float64
    rest: wp.float64
    per: wp.float64
    clear: wp.float64
    count: wp.float64
    near: wp.float64
    pitch: wp.float64
    pitch_rest: wp.float64
    zero: wp.float64


@wp.struct
class DeviceGrid:
    """Members that both axes of a grid share.

    `bins` is -1 for a grid in cells; `leaves` is 0 for a grid of free elements.
    """

    table: wp.int32
    row: wp.int32
    shift_x: wp.int32
    shift_y: wp.int32
    bins: wp.int32
    listed: wp.int32
    local: wp.int32
    leaves: wp.int32
    more: wp.int32


@wp.struct
class DeviceBins:
    """Bins of a grid of free elements."""

    corner: wp.vec2d
    per: wp.vec2d
    last: wp.vec2d
    slack: wp.float64


@wp.struct
class DeviceElement:
    """An element; `place` is the index of a free element's place, else -1."""

    scale: wp.float64
    offset: wp.float64
    cell_x: wp.int32
    cell_y: wp.int32
    pose: wp.int32
    kind: wp.int32
    grid: wp.int32
    place: wp.int32


@wp.struct
class DevicePose:
    """Span and turn of an element."""

    size: wp.vec2d
    cos: wp.float64
    sin_v: wp.float64
    sin_u: wp.float64
    turned: wp.int32
    cells_x: wp.int32
    cells_y: wp.int32


@wp.struct
class DevicePlace:
    """Place of a free element, and the differences of the intended numbers from its doubles."""

    at: wp.vec2d
    extent: wp.vec2d
    at_rest: wp.vec2d
    extent_rest: wp.vec2d


@wp.struct
class DeviceKind:
    """A primitive with a surface; its curves begin in the field's curves at twice its index."""

    surface: wp.int32
    combine: wp.int32
    is_void: wp.int32
    special: wp.int32
    raster: wp.int32
    classes: wp.int32


@wp.struct
class DeviceCurve:
    """Position of a curve's pieces."""

    count: wp.float64
    first: wp.int32
    last: wp.int32
    knot: wp.int32
    bin: wp.int32
    knotted: wp.int32


@wp.struct
class DeviceRaster:
    """A grid of heights, whose numbers begin at `first`, row by row from the north."""

    first: wp.int32
    columns: wp.int32
    rows: wp.int32
    pixel: wp.int32
    voids: wp.int32


@wp.struct
class DeviceClasses:
    """A raster of classes, and which of all classes it has."""

    raster: wp.int32
    first: wp.int32
    count: wp.int32


@wp.struct
class DeviceSegment:
    """A straight piece of a track."""

    start: wp.vec2d
    end: wp.vec2d
    way: wp.vec2d
    square: wp.float64
    reach_square: wp.float64
    z: wp.float64
    end_z: wp.float64
    track: wp.int32


@wp.struct
class DeviceTrack:
    """Members that all segments of a track share."""

    passes: wp.float64
    power: wp.float64
    surface: wp.int32
    law: wp.int32


@wp.struct
class DeviceRelief:
    """The relief of a rough surface."""

    per: wp.float64
    scale: wp.float64
    key: wp.uint64


@wp.struct
class DeviceField:
    """A compiled field on a device: `FieldArrays`, friction by surface, and the origin.

    Fields of tops and of other faces have the storey of each element, -1 for none, in `storeys`.
    The field of the ground has what columns need of all storeys and sheets: `gaps` by storey,
    `bores` by sheet, and the lattice.
    """

    bounds: wp.vec4d
    origin: wp.vec3d
    elements: wp.array(dtype=DeviceElement)
    axes: wp.array(dtype=DeviceAxis)
    grids: wp.array(dtype=DeviceGrid)
    bins: wp.array(dtype=DeviceBins)
    offsets: wp.array(dtype=wp.int32)
    entries: wp.array(dtype=wp.int32)
    poses: wp.array(dtype=DevicePose)
    places: wp.array(dtype=DevicePlace)
    kinds: wp.array(dtype=DeviceKind)
    curves: wp.array(dtype=DeviceCurve)
    pieces: wp.array(dtype=wp.vec4d)
    knots: wp.array(dtype=wp.float64)
    rests: wp.array(dtype=wp.float64)
    curve_bins: wp.array(dtype=wp.int32)
    rasters: wp.array(dtype=DeviceRaster)
    heights: wp.array(dtype=wp.float64)
    classes: wp.array(dtype=DeviceClasses)
    class_numbers: wp.array(dtype=wp.float64)
    class_surfaces: wp.array(dtype=wp.int32)
    class_voids: wp.array(dtype=wp.int32)
    tracks: wp.array(dtype=DeviceTrack)
    segments: wp.array(dtype=DeviceSegment)
    depths: wp.array2d(dtype=wp.float64)
    track_frame: wp.vec4d
    track_shape: wp.vec2i
    track_masks: wp.array(dtype=wp.uint64)
    track_offsets: wp.array(dtype=wp.int32)
    track_entries: wp.array(dtype=wp.int32)
    reliefs: wp.array(dtype=DeviceRelief)
    friction: wp.array(dtype=wp.float32)
    storeys: wp.array(dtype=wp.int32)
    gaps: wp.array(dtype=wp.float64)
    bores: wp.array(dtype=wp.int32)
    lattice_frame: wp.vec4d
    lattice: wp.array2d(dtype=wp.uint64)


@wp.struct
class ElementSum:
    """Sum of the elements at a point; `top` is the uppermost element, -1 for none.

    `pixel` is the column and the row of its pixel of classes, if it has these.
    """

    z: wp.float64
    slope_x: wp.float64
    slope_y: wp.float64
    top: wp.int32
    pixel: wp.vec2i


@wp.struct
class DeviceGround:
    """Ground at a point.

    Attributes:
        height: world height; NaN outside and in the void.
        gradient: gradient of the height, on an edge of its east and north side; NaN outside and in
            the void.
        surface: index into the surfaces of the terrain; -1 for none.
        friction: coefficient of friction; NaN without ground.
    """

    height: wp.float64
    gradient: wp.vec2d
    surface: wp.int32
    friction: wp.float32


@wp.struct
class DeviceRut:
    """The rut of the tracks at a point, as far as they were added.

    Attributes:
        last: the track added last; -1 for none.
        deepest: the track with the deepest first pass; -1 for none.
        surface_track: the last track that decides the surface; -1 for none.
        first: depth of the deepest first pass.
        passes: passes of all tracks.
        is_void: whether the ground is void, where there is no rut.
    """

    last: wp.int32
    deepest: wp.int32
    surface_track: wp.int32
    first: wp.float64
    passes: wp.float64
    is_void: wp.bool


@wp.struct
class DeviceShape:
    """Whether a footprint holds a point, and the primitive's value and slopes there."""

    holds: wp.bool
    value: wp.float64
    du: wp.float64
    dv: wp.float64


@wp.struct
class DeviceSpot:
    """Position of a point in an element.

    Attributes:
        in_cell: whether the element's cell, or block of cells, holds the point.
        beyond_cell: whether the footprint may hold the point outside of the cell.
        above: position in the cell, for the grids below.
        uv: position in the primitive before its turn.
        sin_u: sine of the turn that takes u into v, as in `DevicePose`.
        sin_v: sine of the turn that takes v into u, as in `DevicePose`.
        per: factors from slopes in `uv` to slopes in the world.
        axis_x: grid of the block along x.
        axis_y: grid of the block along y.
        cell: first cell of the block.
        width: cells of the block along x and y.
    """

    in_cell: wp.bool
    beyond_cell: wp.bool
    above: wp.vec2d
    uv: wp.vec2d
    sin_u: wp.float64
    sin_v: wp.float64
    per: wp.vec2d
    axis_x: DeviceAxis
    axis_y: DeviceAxis
    cell: wp.vec2d
    width: wp.vec2d


# Edges


@wp.func
def nearest_double(high: wp.float64, low: wp.float64):
    """Return the double nearest to a sum of two doubles."""
    total = high + low
    if total == ZERO:
        return total
    rest = low - (total - high)
    bits = wp.cast(total, wp.int64)
    neighbour = bits - wp.int64(1)
    if (rest > ZERO) == (total > ZERO):
        neighbour = bits + wp.int64(1)
    other = wp.cast(neighbour, wp.float64)
    gap = wp.abs(other - total)
    if wp.abs(wp.abs(rest) - HALF * gap) > gap * NEAR_MIDDLE:
        return total
    if (bits & wp.int64(1)) != wp.int64(0):
        return other
    return total


@wp.func
def exact_sum(a: wp.float64, b: wp.float64):
    """Return the sum of two doubles exactly, as two doubles."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


@wp.func
def position(high: wp.float64, low: wp.float64, zero: wp.float64):
    """Return a position as a sum of two doubles; 0 where cancellation leaves at most `zero`."""
    total = high + low
    if wp.abs(total) <= zero:
        return ZERO, ZERO
    return total, low - (total - high)


@wp.func
def edge_position(axis: DeviceAxis, k: wp.float64):
    """Return the world position of edge `k` of a grid, as a sum of two doubles."""
    high, lost = exact_sum(axis.corner, k * axis.pitch)
    low = lost + axis.rest + k * axis.pitch_rest
    zero = axis.zero
    if axis.corner == ZERO:
        zero = ZERO
    total, rest = position(high, low, zero)
    return total, rest


@wp.func
def edge_double(axis: DeviceAxis, k: wp.float64):
    """Return the double at which edge `k` of a grid stands."""
    high, low = edge_position(axis, k)
    return nearest_double(high, low)


@wp.func
def cells_from_corner(axis: DeviceAxis, x: wp.float64):
    """Return the distance of a world coordinate from the corner of a grid, in cells."""
    return ((x - axis.corner) - axis.rest) * axis.per


@wp.func
def locate_cell(x: wp.float64, axis: DeviceAxis, local: wp.int32, above: wp.float64):
    """Return the cell of a grid that holds `x`, and the position in it, by the doubles of edges."""
    s = above * axis.count
    cell = wp.floor(s)
    if local == 0:
        s = cells_from_corner(axis, x)
        cell = wp.floor(s)
        if s - cell < axis.near or s - cell > ONE - axis.near:
            k = wp.floor(s + HALF)
            at = edge_double(axis, k)
            cell = k - ONE
            if x >= at:
                cell = k
            if x == at and wp.abs(s - k) < EDGE:
                s = k
    cell = wp.clamp(cell, ZERO, axis.count - ONE)
    return wp.int32(cell), wp.clamp(s - cell, ZERO, ONE)


@wp.func
def exact_product(a: wp.float64, b: wp.float64):
    """Return the product of two doubles exactly, as two doubles."""
    product = a * b
    wide = a * SPLITTER
    a_high = wide - (wide - a)
    a_low = a - a_high
    wide = b * SPLITTER
    b_high = wide - (wide - b)
    b_low = b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


@wp.func
def is_past_step(
    x: wp.float64,
    axis: DeviceAxis,
    cell: wp.float64,
    width: wp.float64,
    t: wp.float64,
    rest: wp.float64,
):
    """Tell whether `x` has reached the double nearest to `t` + `rest` of a block of cells."""
    high, low = edge_position(axis, cell)
    side = width * axis.pitch
    product, error = exact_product(t, side)
    total, lost = exact_sum(high, product)
    low += lost + error + (t * (width * axis.pitch_rest) + rest * side)
    zero = axis.zero
    if high == ZERO:
        zero = ZERO
    nearly, more = position(total, low, zero)
    return x >= nearest_double(nearly, more)


# Curves


@wp.func
def piece_at(field: wp.array(dtype=DeviceField), row: wp.int32, s: wp.float64):
    """Return value and slope of a piece at `s` in it."""
    c = field[0].pieces[row]
    value = c[0] + s * (c[1] + s * (c[2] + s * c[3]))
    return value, c[1] + s * (TWO * c[2] + s * (THREE * c[3]))


@wp.func
def find_piece(field: wp.array(dtype=DeviceField), curve: DeviceCurve, t: wp.float64):
    """Return the last piece of a knotted curve that begins at or before `t`."""
    slot = wp.min(wp.int32(t * (wp.float64(curve.last) + ONE)), curve.last)
    i = field[0].curve_bins[curve.bin + slot]
    while t >= field[0].knots[curve.knot + i + 1]:
        i += 1
    return i


@wp.func
def any_curve(field: wp.array(dtype=DeviceField), curve: DeviceCurve, t: wp.float64):
    """Return value and slope of any curve at `t`, if no edge in the world decides about steps."""
    row = curve.first
    s = t * curve.count
    factor = curve.count
    if curve.knotted != 0:
        ahead = ZERO
        if curve.knotted == STEPPED:
            ahead = STEP
        i = find_piece(field, curve, wp.min(t + ahead, ONE))
        knot = field[0].knots[curve.knot + i]
        row += i
        s = wp.max(t, knot) - knot
        factor = ONE
    else:
        i = wp.int32(s)
        row += i
        s -= wp.float64(i)
    value, slope = piece_at(field, row, s)
    return value, slope * factor


@wp.func
def placed_curve(
    field: wp.array(dtype=DeviceField),
    curve: DeviceCurve,
    axis: DeviceAxis,
    cell: wp.float64,
    width: wp.float64,
    t: wp.float64,
    x: wp.float64,
):
    """Return value and slope of an unturned element's curve with steps at `t`, `x` in the world."""
    begin = curve.knot
    here = begin + find_piece(field, curve, t)
    while field[0].knots[here + 1] - t < axis.near:
        next_t = field[0].knots[here + 1]
        if not is_past_step(x, axis, cell, width, next_t, field[0].rests[here + 1]):
            break
        here += 1
    while here > begin and t - field[0].knots[here] < axis.near:
        own_t = field[0].knots[here]
        if is_past_step(x, axis, cell, width, own_t, field[0].rests[here]):
            break
        here -= 1
    knot = field[0].knots[here]
    s = wp.clamp(t, knot, field[0].knots[here + 1]) - knot
    value, slope = piece_at(field, curve.first + here - begin, s)
    return value, slope


@wp.func
def curve_at(
    field: wp.array(dtype=DeviceField),
    curve: DeviceCurve,
    axis: DeviceAxis,
    cell: wp.float64,
    width: wp.float64,
    t: wp.float64,
    x: wp.float64,
):
    """Return value and slope of any curve of an unturned element at `t`, `x` in the world."""
    if curve.knotted == STEPPED:
        value, slope = placed_curve(field, curve, axis, cell, width, t, x)
        return value, slope
    value, slope = any_curve(field, curve, t)
    return value, slope


# Grids of heights


@wp.func
def between(t: wp.float64, count: wp.int32, pixel: wp.int32):
    """Return the number before `t` of so many, the part of the way to the next, and numbers a side.

    The last is 0 where the nearest number goes on, so that the slope is.
    """
    last = wp.float64(count - 1)
    s = t * last
    per = last
    if pixel != 0:
        per = wp.float64(count)
        s = t * per - HALF
        if s < ZERO or s >= last:
            per = ZERO
    if count == 1:
        per = ZERO
    s = wp.clamp(s, ZERO, last)
    low = wp.min(wp.int32(s), wp.max(count - 2, 0))
    return low, s - wp.float64(low), per


@wp.func
def cells_along(raster: DeviceRaster, count: wp.int32):
    """Return the cells of a grid along an axis of so many numbers."""
    if raster.pixel != 0:
        return count
    return wp.max(count - 1, 1)


@wp.func
def cell_at(t: wp.float64, count: wp.int32):
    """Return the cell at `t` of so many."""
    return wp.clamp(wp.int32(t * wp.float64(count)), 0, count - 1)


@wp.func
def placed_cell(
    t: wp.float64,
    count: wp.int32,
    x: wp.float64,
    axis: DeviceAxis,
    cell: wp.float64,
    width: wp.float64,
):
    """Return the cell of an unturned grid at `t`, `x` in the world, by the doubles of edges."""
    n = wp.float64(count)
    k = wp.floor(t * n + HALF)
    near = wp.max(axis.near / width, EDGE) * n
    found = cell_at(t, count)
    if wp.abs(t * n - k) <= near and k > ZERO and k < n:
        edge = k / n
        product, error = exact_product(edge, n)
        rest = -((product - k) + error) / n
        found = wp.int32(k)
        if not is_past_step(x, axis, cell, width, edge, rest):
            found -= 1
    return found


@wp.func
def number_at(field: wp.array(dtype=DeviceField), r: DeviceRaster, i: wp.int32, j: wp.int32):
    """Return the number at a column from the west and a row from the south, or the last one."""
    row = r.rows - 1 - wp.min(j, r.rows - 1)
    return field[0].heights[r.first + row * r.columns + wp.min(i, r.columns - 1)]


@wp.func
def counting(field: wp.array(dtype=DeviceField), r: DeviceRaster, i: wp.int32, j: wp.int32):
    """Return a number, or the mean of its neighbours where it is void."""
    column = wp.min(i, r.columns - 1)
    row = wp.min(j, r.rows - 1)
    z = number_at(field, r, column, row)
    if not wp.isnan(z):
        return z
    total = wp.float64(0.0)
    count = wp.float64(0.0)
    for down in range(3):
        b = row + 1 - down
        for across in range(3):
            a = column - 1 + across
            if a >= 0 and a < r.columns and b >= 0 and b < r.rows:
                one = number_at(field, r, a, b)
                if not wp.isnan(one):
                    total += one
                    count += ONE
    return total / count


@wp.func
def is_void_cell(field: wp.array(dtype=DeviceField), r: DeviceRaster, i: wp.int32, j: wp.int32):
    """Tell whether a cell of a grid has no ground."""
    void = wp.isnan(number_at(field, r, i, j))
    if r.pixel == 0:
        void = void or wp.isnan(number_at(field, r, i + 1, j))
        void = void or wp.isnan(number_at(field, r, i, j + 1))
        void = void or wp.isnan(number_at(field, r, i + 1, j + 1))
    return void


@wp.func
def grid_at(
    field: wp.array(dtype=DeviceField),
    index: wp.int32,
    spot: DeviceSpot,
    turned: wp.int32,
    at: wp.vec2d,
    point: wp.vec2d,
):
    """Return value and slopes of a grid of heights at a position in its rectangle."""
    r = field[0].rasters[index]
    uv = at
    if turned != 0:
        uv = clamp_to_rectangle(at)
    west, a, per_x = between(uv[0], r.columns, r.pixel)
    south, b, per_y = between(uv[1], r.rows, r.pixel)
    if r.voids != 0:
        across = cells_along(r, r.columns)
        along = cells_along(r, r.rows)
        i = cell_at(uv[0] + STEP, across)
        j = cell_at(uv[1] + STEP, along)
        if turned == 0:
            i = placed_cell(uv[0], across, point[0], spot.axis_x, spot.cell[0], spot.width[0])
            j = placed_cell(uv[1], along, point[1], spot.axis_y, spot.cell[1], spot.width[1])
        if is_void_cell(field, r, i, j):
            return DeviceShape(True, NAN, NAN, NAN)
        if r.pixel == 0:  # the numbers of another cell, across an edge, may be void
            a = wp.clamp(a + wp.float64(west - i), ZERO, ONE)
            b = wp.clamp(b + wp.float64(south - j), ZERO, ONE)
            west = i
            south = j
    z00 = counting(field, r, west, south)
    z10 = counting(field, r, west + 1, south)
    z01 = counting(field, r, west, south + 1)
    z11 = counting(field, r, west + 1, south + 1)
    value = (ONE - b) * ((ONE - a) * z00 + a * z10) + b * ((ONE - a) * z01 + a * z11)
    east = (ONE - b) * (z10 - z00) + b * (z11 - z01)
    north = (ONE - a) * (z01 - z00) + a * (z11 - z10)
    return DeviceShape(True, value, east * per_x, north * per_y)


# Primitives


@wp.func
def combine(how: wp.int32, x: wp.float64, slope_x: wp.float64, y: wp.float64, slope_y: wp.float64):
    """Combine the values of two curves, with slopes in u and v."""
    if how == PRODUCT:
        return DeviceShape(True, x * y, slope_x * y, x * slope_y)
    if how == SUM:
        return DeviceShape(True, x + y, slope_x, slope_y)
    if (x <= y) == (how == MIN):
        return DeviceShape(True, x, slope_x, ZERO)
    return DeviceShape(True, y, ZERO, slope_y)


@wp.func
def radial(field: wp.array(dtype=DeviceField), curve: DeviceCurve, at: wp.vec2d):
    """Tell whether a point lies in the disc, with value and slopes of the curve there."""
    a = TWO * at[0] - ONE
    b = TWO * at[1] - ONE
    rho = wp.sqrt(a * a + b * b)
    if rho > ONE + EDGE:
        return DeviceShape(False, ZERO, ZERO, ZERO)
    value, slope = any_curve(field, curve, wp.min(HALF + HALF * rho, ONE))
    slope = slope / rho if rho > ZERO else ZERO
    return DeviceShape(True, value, slope * a, slope * b)


@wp.func
def turn_point(pose: DevicePose, at: wp.vec2d, sin_u: wp.float64, sin_v: wp.float64):
    """Return the position of a point of the cell in the turned rectangle."""
    a = at[0] - HALF
    b = at[1] - HALF
    return wp.vec2d(HALF + (a * pose.cos - b * sin_v), HALF + (a * sin_u + b * pose.cos))


@wp.func
def is_beyond(at: wp.vec2d):
    """Tell whether a point lies outside of the rectangle, which includes its edge."""
    return wp.max(wp.abs(at[0] - HALF), wp.abs(at[1] - HALF)) > HALF + EDGE


@wp.func
def clamp_to_rectangle(at: wp.vec2d):
    """Clamp a point that rounding put a little beyond the rectangle to its edge."""
    return wp.vec2d(wp.clamp(at[0], ZERO, ONE), wp.clamp(at[1], ZERO, ONE))


# The descent


@wp.func
def from_parent(axis: DeviceAxis, local: wp.int32, x: wp.float64, above: wp.float64):
    """Return the distance of a point from the corner of the cell that a free grid is in."""
    if local != 0:
        return above * (axis.pitch + axis.pitch_rest)
    return (x - axis.corner) - axis.rest


@wp.func
def free_axis(parent: DeviceAxis, place: DevicePlace, which: wp.int32):
    """Return an axis of the one-cell grid that a free place is in its parent's cell."""
    at = place.at[which]
    extent = place.extent[which]
    more = place.extent_rest[which]
    middle, lost = exact_sum(parent.corner, at)
    low, lost_too = exact_sum(middle, -HALF * extent)
    rests = (lost + lost_too) + parent.rest
    corner, rest = position(low, rests + (place.at_rest[which] - HALF * more), parent.zero)
    per = ONE / extent
    noise = FREE_NOISE * wp.max(wp.abs(at) + extent, wp.abs(corner))
    near = wp.max(EDGE, noise * per)
    return DeviceAxis(corner, rest, per, HALF - near, ONE, near, extent, more, parent.zero)


@wp.func
def holds_along(axis: DeviceAxis, x: wp.float64, terrain_end: wp.float64):
    """Tell whether a cell holds a coordinate: half-open, except at the terrain's own far edge."""
    if x < edge_double(axis, ZERO):
        return False
    end = edge_double(axis, ONE)
    return x < end or (x == end and end >= terrain_end)


@wp.func
def position_holds(at: wp.float64, above: wp.float64):
    """Tell whether a cell finer than doubles holds a point, by its position in the cell."""
    return at >= ZERO and (at < ONE or above == ONE)


@wp.func
def free_bin(bins: DeviceBins, axis: wp.int32, from_corner: wp.float64):
    """Return the bin of a free grid for a distance from the corner of the parent's cell."""
    s = (from_corner - bins.corner[axis]) * bins.per[axis]
    return wp.int32(wp.min(wp.max(s, ZERO), bins.last[axis]))


@wp.func
def is_inside(field: wp.array(dtype=DeviceField), x: wp.float64, y: wp.float64):
    """Tell whether a point is on the terrain, its edges included."""
    b = field[0].bounds
    return b[0] <= x and x <= b[2] and b[1] <= y and y <= b[3]


@wp.func
def free_cell_holds(
    field: wp.array(dtype=DeviceField),
    place: DevicePlace,
    axis_x: DeviceAxis,
    axis_y: DeviceAxis,
    point: wp.vec2d,
):
    """Tell whether a cell of a free grid holds a point, by the doubles of its edges."""
    along_x = free_axis(axis_x, place, 0)
    along_y = free_axis(axis_y, place, 1)
    end = field[0].bounds
    return holds_along(along_x, point[0], end[2]) and holds_along(along_y, point[1], end[3])


@wp.func
def slot_of(field: wp.array(dtype=DeviceField), g: wp.int32, above: wp.vec2d, point: wp.vec2d):
    """Return the bin of a grid that holds a point, its cell, and the position in the cell.

    In a grid of free elements, the position is measured from the corner of the parent's cell.
    """
    grid = field[0].grids[g]
    axis_x = field[0].axes[2 * g]
    axis_y = field[0].axes[2 * g + 1]
    if grid.bins >= 0:
        bins = field[0].bins[grid.bins]
        x = from_parent(axis_x, grid.local, point[0], above[0])
        y = from_parent(axis_y, grid.local, point[1], above[1])
        slot = grid.table + free_bin(bins, 1, y) * grid.row + free_bin(bins, 0, x)
        return slot, wp.vec2i(0, 0), wp.vec2d(x, y)
    s = cells_from_corner(axis_x, point[0])
    t = cells_from_corner(axis_y, point[1])
    i = wp.int32(s)
    j = wp.int32(t)
    in_x = s - wp.float64(i)
    in_y = t - wp.float64(j)
    if wp.abs(in_x - HALF) > axis_x.clear or wp.abs(in_y - HALF) > axis_y.clear:
        i, in_x = locate_cell(point[0], axis_x, grid.local, above[0])
        j, in_y = locate_cell(point[1], axis_y, grid.local, above[1])
    slot = grid.table + (j >> grid.shift_y) * grid.row + (i >> grid.shift_x)
    return slot, wp.vec2i(i, j), wp.vec2d(in_x, in_y)


@wp.func
def spot_at_place(
    field: wp.array(dtype=DeviceField),
    g: wp.int32,
    element: DeviceElement,
    at: wp.vec2d,
    above: wp.vec2d,
    point: wp.vec2d,
):
    """Return the spot of a point in a free element, `at` from the corner of the parent's cell."""
    grid = field[0].grids[g]
    axis_x = field[0].axes[2 * g]
    axis_y = field[0].axes[2 * g + 1]
    place = field[0].places[element.place]
    pose = field[0].poses[element.pose]
    spot = DeviceSpot()
    dx = at[0] - place.at[0]
    dy = at[1] - place.at[1]
    spot.per = wp.vec2d(ONE / place.extent[0], ONE / place.extent[1])
    spot.uv = wp.vec2d(HALF + dx * spot.per[0], HALF + dy * spot.per[1])
    if pose.turned == 0 or element.grid > 0:
        depth = wp.min(HALF * place.extent[0] - wp.abs(dx), HALF * place.extent[1] - wp.abs(dy))
        spot.in_cell = depth > ZERO
        if wp.abs(depth) <= field[0].bins[grid.bins].slack:
            if grid.local != 0:
                in_x = position_holds(spot.uv[0], above[0])
                spot.in_cell = in_x and position_holds(spot.uv[1], above[1])
            else:
                spot.in_cell = free_cell_holds(field, place, axis_x, axis_y, point)
    spot.above = clamp_to_rectangle(spot.uv)
    if pose.turned != 0:
        spot.beyond_cell = True
        spot.sin_v = pose.sin_v * (place.extent[1] * spot.per[0])
        spot.sin_u = pose.sin_u * (place.extent[0] * spot.per[1])
    else:
        spot.uv = spot.above
        spot.axis_x = free_axis(axis_x, place, 0)
        spot.axis_y = free_axis(axis_y, place, 1)
        spot.width = wp.vec2d(ONE, ONE)
    return spot


@wp.func
def spot_in_cell(
    field: wp.array(dtype=DeviceField),
    g: wp.int32,
    element: DeviceElement,
    cell: wp.vec2i,
    at: wp.vec2d,
):
    """Return the spot of a point in an element that stands in cells, `at` its position in one."""
    pose = field[0].poses[element.pose]
    spot = DeviceSpot()
    spot.axis_x = field[0].axes[2 * g]
    spot.axis_y = field[0].axes[2 * g + 1]
    spot.cell = wp.vec2d(wp.float64(element.cell_x), wp.float64(element.cell_y))
    spot.width = wp.vec2d(ONE, ONE)
    spot.per = wp.vec2d(spot.axis_x.per, spot.axis_y.per)
    spot.sin_u = pose.sin_u
    spot.sin_v = pose.sin_v
    spot.uv = at
    spot.in_cell = True
    if field[0].grids[g].listed != 0:
        i = cell[0] - element.cell_x
        j = cell[1] - element.cell_y
        spot.in_cell = i >= 0 and j >= 0 and i < pose.cells_x and j < pose.cells_y
        spot.width = pose.size
        spot.per = wp.vec2d(spot.per[0] / pose.size[0], spot.per[1] / pose.size[1])
        u = (wp.float64(i) + at[0]) / pose.size[0]
        v = (wp.float64(j) + at[1]) / pose.size[1]
        spot.uv = wp.vec2d(wp.min(u, ONE), wp.min(v, ONE))
    spot.above = spot.uv
    return spot


@wp.func
def shape_at(
    field: wp.array(dtype=DeviceField),
    element: DeviceElement,
    spot: DeviceSpot,
    is_leaf: wp.bool,
    point: wp.vec2d,
):
    """Tell whether a footprint holds a point, with the primitive's value and slopes along the cell.

    For leaves in cells, the position is rounded as the other kernels round it, turned or not.
    """
    pose = field[0].poses[element.pose]
    kind = field[0].kinds[element.kind]
    curve_x = field[0].curves[2 * element.kind]
    curve_y = field[0].curves[2 * element.kind + 1]
    uv = spot.uv
    if pose.turned != 0 or is_leaf:
        uv = turn_point(pose, uv, spot.sin_u, spot.sin_v)
    shape = DeviceShape(False, ZERO, ZERO, ZERO)
    if kind.combine == RADIAL:
        shape = radial(field, curve_x, uv)
    elif kind.combine == GRID:
        if pose.turned == 0 or not is_beyond(uv):
            shape = grid_at(field, kind.raster, spot, pose.turned, uv, point)
    elif pose.turned == 0:
        cell = spot.cell
        width = spot.width
        a, da = curve_at(field, curve_x, spot.axis_x, cell[0], width[0], uv[0], point[0])
        b, db = curve_at(field, curve_y, spot.axis_y, cell[1], width[1], uv[1], point[1])
        shape = combine(kind.combine, a, da, b, db)
    elif not is_beyond(uv):
        if kind.special != 0 or element.place >= 0:
            uv = clamp_to_rectangle(uv)
        a, da = any_curve(field, curve_x, uv[0])
        b, db = any_curve(field, curve_y, uv[1])
        shape = combine(kind.combine, a, da, b, db)
    if pose.turned != 0:
        du = shape.du * pose.cos + shape.dv * spot.sin_u
        shape.dv = shape.dv * pose.cos - shape.du * spot.sin_v
        shape.du = du
    return shape


@wp.func
def class_pixel(
    field: wp.array(dtype=DeviceField), element: DeviceElement, spot: DeviceSpot, point: wp.vec2d
):
    """Return column and row of the pixel of an element's classes that holds a point."""
    pose = field[0].poses[element.pose]
    kind = field[0].kinds[element.kind]
    r = field[0].rasters[field[0].classes[kind.classes].raster]
    uv = spot.uv
    if pose.turned != 0:
        uv = turn_point(pose, uv, spot.sin_u, spot.sin_v)
    if pose.turned != 0 or kind.combine == RADIAL:
        uv = clamp_to_rectangle(uv)
        return wp.vec2i(cell_at(uv[0] + STEP, r.columns), cell_at(uv[1] + STEP, r.rows))
    i = placed_cell(uv[0], r.columns, point[0], spot.axis_x, spot.cell[0], spot.width[0])
    j = placed_cell(uv[1], r.rows, point[1], spot.axis_y, spot.cell[1], spot.width[1])
    return wp.vec2i(i, j)


@wp.func
def worn_at(field: wp.array(dtype=DeviceField), element: wp.int32, pixel: wp.vec2i):
    """Return the surface of an element, in a pixel if it has classes, and whether it is void."""
    kind = field[0].kinds[field[0].elements[element].kind]
    if kind.classes >= 0:
        own = field[0].classes[kind.classes]
        number = number_at(field, field[0].rasters[own.raster], pixel[0], pixel[1])
        for k in range(own.first, own.first + own.count):
            if field[0].class_numbers[k] == number:
                return field[0].class_surfaces[k], field[0].class_voids[k]
    return kind.surface, kind.is_void


# Reliefs and tracks


@wp.func
def hash64(key: wp.uint64):
    """Hash 64 bits as the kernels do."""
    key = key * HASH_1
    key = (key ^ (key >> wp.uint64(30))) * HASH_2
    key = (key ^ (key >> wp.uint64(27))) * HASH_3
    return key ^ (key >> wp.uint64(31))


@wp.func
def relief_at(relief: DeviceRelief, x: wp.float64, y: wp.float64):
    """Return height and gradient of a relief at a point."""
    s = x * relief.per
    t = y * relief.per
    z = wp.float64(0.0)
    along = wp.float64(0.0)
    across = wp.float64(0.0)
    if relief.scale != ZERO and wp.abs(s) < FARTHEST_CELL and wp.abs(t) < FARTHEST_CELL:
        west = wp.floor(s - BUMP_REACH)
        south = wp.floor(t - BUMP_REACH)
        for j in range(BUMP_CELLS):
            row = south + wp.float64(j)
            key = hash64(relief.key ^ wp.uint64(wp.int64(row)))
            for i in range(BUMP_CELLS):
                column = west + wp.float64(i)
                bits = hash64(key ^ wp.uint64(wp.int64(column)))
                bump_x = wp.float64(bits >> wp.uint64(43)) * FINE
                bump_y = wp.float64((bits >> wp.uint64(22)) & LOW_21) * FINE
                height = wp.float64(wp.uint64(2) * (bits & LOW_22) + wp.uint64(1)) * FINER - ONE
                dx = (s - column) - bump_x
                dy = (t - row) - bump_y
                rest = wp.max(BUMP_SQUARE - (dx * dx + dy * dy), ZERO)
                part = height * (rest * rest)
                z += part * rest
                along += part * dx
                across += part * dy
    slope = STEEPNESS * relief.scale * relief.per
    return relief.scale * z, slope * along, slope * across


@wp.func
def segment_holds(segment: DeviceSegment, x: wp.float64, y: wp.float64):
    """Tell whether a point is at most half the track's width from a segment."""
    ex = x - segment.start[0]
    ey = y - segment.start[1]
    along = ex * segment.way[0] + ey * segment.way[1]
    if along <= ZERO:
        return ex * ex + ey * ey <= segment.reach_square
    if along >= segment.square:
        ex = x - segment.end[0]
        ey = y - segment.end[1]
        return ex * ex + ey * ey <= segment.reach_square
    across = ex * segment.way[1] - ey * segment.way[0]
    return across * across <= segment.reach_square * segment.square


@wp.func
def cell_near(field: wp.array(dtype=DeviceField), x: wp.float64, y: wp.float64):
    """Return the cell of the track index that a point lies in; -1 if no track is near."""
    u = (x - field[0].track_frame[0]) * field[0].track_frame[2]
    v = (y - field[0].track_frame[1]) * field[0].track_frame[3]
    columns = field[0].track_shape[0]
    rows = field[0].track_shape[1]
    if u < ZERO or u >= wp.float64(columns) or v < ZERO or v >= wp.float64(rows):
        return -1
    i = wp.int32(u)
    j = wp.int32(v)
    cell = j * columns + i
    row = wp.int32((v - wp.float64(j)) * PARTS)
    part = row * 8 + wp.int32((u - wp.float64(i)) * PARTS)
    if ((field[0].track_masks[cell] >> wp.uint64(part)) & wp.uint64(1)) == wp.uint64(0):
        return -1
    return cell


@wp.func
def empty_rut():
    """Return the rut of no track."""
    return DeviceRut(-1, -1, -1, ZERO, ZERO, False)


@wp.func
def with_track(
    field: wp.array(dtype=DeviceField), rut: DeviceRut, track: wp.int32, ground: wp.int32
):
    """Return a rut with one more track on ground of a surface."""
    own = field[0].tracks[track]
    depth = field[0].depths[own.law, ground + 1]
    rut.last = track
    rut.is_void = wp.isnan(depth)
    rut.passes += own.passes
    if rut.deepest < 0 or depth > rut.first:
        rut.first = depth
        rut.deepest = track
    if own.surface >= 0:
        rut.surface_track = track
    return rut


@wp.func
def depth_of(field: wp.array(dtype=DeviceField), rut: DeviceRut):
    """Return the depth of a rut after all passes."""
    if rut.deepest >= 0 and rut.passes > ONE:
        return rut.first * wp.pow(rut.passes, field[0].tracks[rut.deepest].power)
    return rut.first


@wp.func
def with_relief(
    field: wp.array(dtype=DeviceField), ground: DeviceGround, x: wp.float64, y: wp.float64
):
    """Return ground with the relief of its surface."""
    if field[0].reliefs.shape[0] > 0:
        z, slope_x, slope_y = relief_at(field[0].reliefs[ground.surface + 1], x, y)
        ground.height += z
        ground.gradient += wp.vec2d(slope_x, slope_y)
    return ground


@wp.func
def rut_at(field: wp.array(dtype=DeviceField), x: wp.float64, y: wp.float64, ground: wp.int32):
    """Return the rut's depth at a point, and the track that decides the surface; -1 for none."""
    cell = cell_near(field, x, y)
    if cell < 0:
        return ZERO, -1
    rut = empty_rut()
    for k in range(field[0].track_offsets[cell], field[0].track_offsets[cell + 1]):  # in order
        segment = field[0].segments[field[0].track_entries[k]]
        if segment.track == rut.last or not segment_holds(segment, x, y):
            continue
        rut = with_track(field, rut, segment.track, ground)
        if rut.is_void:
            return ZERO, -1
    return depth_of(field, rut), rut.surface_track


@wp.func
def settle(field: wp.array(dtype=DeviceField), found: ElementSum, x: wp.float64, y: wp.float64):
    """Apply tracks, reliefs and the void to the sum of the elements at a point."""
    ground = DeviceGround(found.z, wp.vec2d(found.slope_x, found.slope_y), -1, wp.float32(NAN))
    if found.top >= 0:
        surface, is_void = worn_at(field, found.top, found.pixel)
        ground.surface = surface
        if is_void != 0:
            ground.height = NAN
            ground.gradient = wp.vec2d(NAN, NAN)
            return ground
    if field[0].track_masks.shape[0] > 0:
        depth, track = rut_at(field, x, y, ground.surface)
        ground.height -= depth
        if track >= 0:
            ground.surface = field[0].tracks[track].surface
    ground = with_relief(field, ground, x, y)
    if not wp.isnan(ground.height):
        ground.friction = field[0].friction[ground.surface + 1]
    return ground


# Columns


@wp.func
def no_ground():
    """Return what is where there is no ground."""
    return DeviceGround(NAN, wp.vec2d(NAN, NAN), -1, wp.float32(NAN))


@wp.func
def sheets_near(field: wp.array(dtype=DeviceField), x: wp.float64, y: wp.float64):
    """Return the bits of the sheets that may have a storey at a point."""
    u = (x - field[0].lattice_frame[0]) * field[0].lattice_frame[2]
    v = (y - field[0].lattice_frame[1]) * field[0].lattice_frame[3]
    rows = field[0].lattice.shape[0]
    columns = field[0].lattice.shape[1]
    if u < ZERO or u >= wp.float64(columns) or v < ZERO or v >= wp.float64(rows):
        return wp.uint64(0)
    return field[0].lattice[wp.int32(v), wp.int32(u)]


@wp.func
def height_of_path(segment: DeviceSegment, x: wp.float64, y: wp.float64):
    """Return the height of a path where a segment is nearest to a point; NaN if it has none."""
    along = (x - segment.start[0]) * segment.way[0] + (y - segment.start[1]) * segment.way[1]
    part = wp.float64(0.0)
    if along > ZERO:
        part = wp.min(along / segment.square, ONE)
    return segment.z + part * (segment.end_z - segment.z)


class DeviceFunctions(NamedTuple):
    """Warp functions for descents in which a limited number of grids wait.

    Attributes:
        ground_at: the function `ground_at(field, x, y) -> DeviceGround`, for any kernel.
        ground_below: the function `ground_below(field, x, y, z) -> DeviceGround`, likewise.
        sample: the kernel for batches.
    """

    ground_at: Any
    ground_below: Any
    sample: Any


@functools.cache
def compile_kernels(room: int, sheets: int = 0) -> DeviceFunctions:
    """Compile the functions for terrains up to a size.

    Args:
        room: number of grids that may wait in a descent.
        sheets: number of sheets of storeys that a terrain may have; 0 for terrains without any.
    """
    grids_type: Any = wp.types.vector(length=room, dtype=wp.int32)
    places_type: Any = wp.types.matrix(shape=(room, 2), dtype=wp.float64)

    @wp.func
    def descend(field: wp.array(dtype=DeviceField), point: wp.vec2d):
        """Return height, gradient and top element at a point inside the bounds, without tracks."""
        waiting = grids_type()
        places = places_type()
        pending = wp.int32(0)
        found = ElementSum(ZERO, ZERO, ZERO, -1, wp.vec2i(0, 0))
        g = wp.int32(0)
        above = wp.vec2d(ZERO, ZERO)
        while g >= 0:
            grid = field[0].grids[g]
            slot, cell, at = slot_of(field, g, above, point)
            for k in range(field[0].offsets[slot], field[0].offsets[slot + 1]):
                index = k
                if grid.listed != 0:
                    index = field[0].entries[k]
                element = field[0].elements[index]
                spot = DeviceSpot()
                if element.place >= 0:
                    spot = spot_at_place(field, g, element, at, above, point)
                else:
                    spot = spot_in_cell(field, g, element, cell, at)
                if spot.in_cell and element.grid > 0:
                    waiting[pending] = element.grid
                    places[pending] = spot.above
                    pending += 1
                if not (spot.in_cell or spot.beyond_cell):
                    continue
                shape = shape_at(field, element, spot, grid.leaves != 0, point)
                if shape.holds:
                    found.z += element.scale * shape.value + element.offset
                    found.slope_x += element.scale * shape.du * spot.per[0]
                    found.slope_y += element.scale * shape.dv * spot.per[1]
                    found.top = wp.max(found.top, index)
                    if found.top == index and field[0].kinds[element.kind].classes >= 0:
                        found.pixel = class_pixel(field, element, spot, point)
            if grid.more != 0:
                g += 1
            elif pending > 0:
                pending -= 1
                g = waiting[pending]
                above = places[pending]
            else:
                g = -1
        return found

    @wp.func
    def plain_standing_at(
        field: wp.array(dtype=DeviceField), point: wp.vec2d, limited: wp.bool, z: wp.float64
    ):
        """Return the ground at a point of the world; if limited, only if it is not above `z`."""
        if not is_inside(field, point[0], point[1]):
            return no_ground()
        found = descend(field, point)
        ground = settle(field, found, point[0], point[1])
        if limited and not ground.height <= z:
            return no_ground()
        return ground

    standing_at = _storeyed(sheets, descend) if sheets else plain_standing_at

    @wp.func
    def ground_at(field: wp.array(dtype=DeviceField), x: wp.float64, y: wp.float64):
        """Return the highest ground at a point of the world."""
        return standing_at(field, wp.vec2d(x, y), False, ZERO)

    @wp.func
    def ground_below(
        field: wp.array(dtype=DeviceField), x: wp.float64, y: wp.float64, z: wp.float64
    ):
        """Return the highest ground at a point of the world that is not above `z`."""
        return standing_at(field, wp.vec2d(x, y), True, z)

    @wp.kernel(module="unique", module_options=OPTIONS)
    def sample(
        field: wp.array(dtype=DeviceField),
        each: wp.int32,
        points: wp.array2d(dtype=wp.float32),
        exact: wp.array2d(dtype=wp.float64),
        height: wp.array(dtype=wp.float32),
        normal: wp.array(dtype=wp.vec3f),
        surface: wp.array(dtype=wp.int32),
        friction: wp.array(dtype=wp.float32),
    ):
        """Sample points in float32 or float64, `each` per thread, into the arrays given.

        Of points in space, with a third column, the highest tops not above them count.
        """
        begin = wp.tid() * each
        for n in range(begin, wp.min(begin + each, height.shape[0])):
            x = wp.float64(0.0)
            y = wp.float64(0.0)
            z = wp.float64(0.0)
            if exact:
                x = exact[n, 0]
                y = exact[n, 1]
            else:
                x = wp.float64(points[n, 0])
                y = wp.float64(points[n, 1])
            limited = exact.shape[1] == 3 or points.shape[1] == 3
            if limited and exact:
                z = exact[n, 2]
            elif limited:
                z = wp.float64(points[n, 2])
            point = wp.vec2d(x + field[0].origin[0], y + field[0].origin[1])
            ground = standing_at(field, point, limited, z + field[0].origin[2])
            height[n] = wp.float32(ground.height - field[0].origin[2])
            if normal:
                a = ZERO - ground.gradient[0]
                b = ZERO - ground.gradient[1]
                long = wp.sqrt(a * a + b * b + ONE)
                normal[n] = wp.vec3f(
                    wp.float32(a / long), wp.float32(b / long), wp.float32(ONE / long)
                )
            if surface:
                surface[n] = ground.surface
            if friction:
                friction[n] = ground.friction

    return DeviceFunctions(ground_at, ground_below, sample)


def _storeyed(sheets: int, descend: Any) -> Any:
    """Return the function `standing_at` for terrains with storeys, made of the descent.

    A field of those is that of the ground, and after it, sheet by sheet, that of the tops and that
    of the other faces. Descents have one place in the code, or compilers take minutes.
    """
    floats: Any = wp.types.vector(length=sheets + 1, dtype=wp.float64)
    whole: Any = wp.types.vector(length=sheets + 1, dtype=wp.int32)

    @wp.struct
    class DeviceColumn:
        """Faces at a point in the order in which they count, the ground's first.

        Attributes:
            faces: number of faces.
            bore: whether each is of a bore, which takes what is above `low` and not above `high`;
                else what is from `low` to `high` is solid.
            low: lower ends.
            high: upper ends.
            surface: surfaces of the tops.
            slope_x: slopes of the tops along x.
            slope_y: slopes of the tops along y.
            tops: number of tops of the column.
            order: faces that have them, from below.
            grounded: whether the lowest of them is solid all the way down.
            bare: surface of the ground, void or not; -1 for none.
        """

        faces: wp.int32
        bore: whole
        low: floats
        high: floats
        surface: whole
        slope_x: floats
        slope_y: floats
        tops: wp.int32
        order: whole
        grounded: wp.bool
        bare: wp.int32

    @wp.func
    def top_of(column: DeviceColumn, k: wp.int32):
        """Return the height of the top that a face may be."""
        if column.bore[k] != 0:
            return column.low[k]
        return column.high[k]

    @wp.func
    def face_at(column: DeviceColumn, z: wp.float64):
        """Return the face that is the top of a solid at a height; -1 where none ends there.

        What is just below and just above is told apart; of equal ends the later counts.
        """
        solid = wp.bool(False)
        over = wp.bool(False)
        face = wp.int32(-1)
        for k in range(column.faces):
            low = column.low[k]
            high = column.high[k]
            from_below = low < z and z <= high
            from_above = low <= z and z < high
            if column.bore[k] != 0:
                if from_above and low == z and over:
                    face = k
                solid = solid and not from_below
                over = over and not from_above
            else:
                if from_below and high == z:
                    face = k
                solid = solid or from_below
                over = over or from_above
        if solid and not over:
            return face
        return -1

    @wp.func
    def column_at(field: wp.array(dtype=DeviceField), point: wp.vec2d):
        """Return the column at a point inside the bounds."""
        column = DeviceColumn()
        near = sheets_near(field, point[0], point[1])
        tops = ElementSum()
        storey = wp.int32(-1)
        for f in range(1 + 2 * field[0].bores.shape[0]):
            sheet = (f - 1) >> 1
            if f > 0 and (near >> wp.uint64(sheet)) & wp.uint64(1) == wp.uint64(0):
                continue
            has_faces = f > 0 and (f & 1) == 0
            if has_faces and storey < 0:
                continue
            found = descend(field[f : f + 1], point)
            if f > 0 and not has_faces:
                tops = found
                storey = wp.int32(-1)
                if found.top >= 0:
                    storey = field[f].storeys[found.top]
                continue
            k = column.faces
            surface = wp.int32(-1)
            is_void = wp.int32(0)
            low = -wp.float64(wp.inf)
            high = found.z
            if has_faces:
                if found.top < 0:
                    continue
                if field[f].storeys[found.top] != storey:
                    continue
                surface, is_void = worn_at(field[f - 1 : f], tops.top, tops.pixel)
                column.bore[k] = field[0].bores[sheet]
                gap = field[0].gaps[storey]
                if wp.isnan(gap):
                    gap = ZERO
                if column.bore[k] != 0:
                    high = found.z + gap
                    if is_void == 0 and not wp.isnan(tops.z):
                        low = tops.z
                    elif not wp.isnan(high):
                        column.grounded = False
                else:
                    low = found.z - gap
                    high = tops.z
                    if is_void != 0:
                        high = NAN
            else:
                tops = found
                if found.top >= 0:
                    surface, is_void = worn_at(field, found.top, found.pixel)
                column.bare = surface
                if is_void != 0:
                    high = NAN
                column.grounded = not wp.isnan(high)
            if high > low:
                column.faces = k + 1
                column.low[k] = low
                column.high[k] = high
                column.surface[k] = surface
                column.slope_x[k] = tops.slope_x
                column.slope_y[k] = tops.slope_y
        for k in range(column.faces):
            z = top_of(column, k)
            if face_at(column, z) == k:
                at = wp.int32(0)
                for n in range(column.tops):
                    at += wp.int32(top_of(column, column.order[n]) < z)
                for n in range(column.tops - at):
                    column.order[column.tops - n] = column.order[column.tops - n - 1]
                column.order[at] = k
                column.tops += 1
        return column

    @wp.func
    def top_under(column: DeviceColumn, z: wp.float64):
        """Return which of the tops a point of a path lies on; -1 for none."""
        if wp.isnan(z):
            if column.grounded and column.tops > 0:
                return 0
            return -1
        nearest = wp.int32(-1)
        least = wp.float64(0.0)
        for k in range(column.tops):
            away = wp.abs(top_of(column, column.order[k]) - z)
            if nearest < 0 or away < least:
                nearest = k
                least = away
        return nearest

    @wp.func
    def rut_on(
        field: wp.array(dtype=DeviceField),
        cell: wp.int32,
        column: DeviceColumn,
        top: wp.int32,
        point: wp.vec2d,
    ):
        """Return the depth of the rut on a top, and the track that decides the surface."""
        rut = empty_rut()
        ground = column.surface[column.order[top]]
        for k in range(field[0].track_offsets[cell], field[0].track_offsets[cell + 1]):
            segment = field[0].segments[field[0].track_entries[k]]
            if segment.track == rut.last or not segment_holds(segment, point[0], point[1]):
                continue
            if top_under(column, height_of_path(segment, point[0], point[1])) != top:
                continue
            rut = with_track(field, rut, segment.track, ground)
            if rut.is_void:
                return ZERO, -1
        return depth_of(field, rut), rut.surface_track

    @wp.func
    def settled(
        field: wp.array(dtype=DeviceField), column: DeviceColumn, top: wp.int32, point: wp.vec2d
    ):
        """Return a top as ground, with ruts and relief."""
        k = column.order[top]
        slope = wp.vec2d(column.slope_x[k], column.slope_y[k])
        ground = DeviceGround(top_of(column, k), slope, column.surface[k], wp.float32(NAN))
        if field[0].track_masks.shape[0] > 0:
            cell = cell_near(field, point[0], point[1])
            if cell >= 0:
                depth, track = rut_on(field, cell, column, top, point)
                ground.height -= depth
                if track >= 0:
                    ground.surface = field[0].tracks[track].surface
        ground = with_relief(field, ground, point[0], point[1])
        ground.friction = field[0].friction[ground.surface + 1]
        return ground

    @wp.func
    def standing_at(
        field: wp.array(dtype=DeviceField), point: wp.vec2d, limited: wp.bool, z: wp.float64
    ):
        """Return the highest top at a point of the world; if limited, of those not above `z`."""
        found = no_ground()
        if not is_inside(field, point[0], point[1]):
            return found
        column = column_at(field, point)
        lower = wp.int32(0)
        if not limited:
            lower = column.tops
            found.surface = column.bare
            if column.tops == 0 and field[0].track_masks.shape[0] > 0:
                _, track = rut_at(field, point[0], point[1], column.bare)
                if track >= 0:
                    found.surface = field[0].tracks[track].surface
        for step in range(column.tops + 1):  # ruts and relief may change the order of tops
            top = step
            last = step == column.tops
            if last:
                top = lower - 1
            if top >= 0 and (limited or last):
                ground = settled(field, column, top, point)
                if last:
                    found = ground
                elif ground.height <= z:
                    lower += 1
        return found

    return standing_at
