"""Regions: which elements cover a place, and with which stretch of their curves; which ruts do."""

from __future__ import annotations

import numpy as np

from terratool.field.kernels import surface_of, void_at
from terratool.field.primitives import (
    MAX,
    MIN,
    ONE,
    PRODUCT,
    RADIAL,
    SUM,
    beyond,
    device,
    kernel,
    turned,
)
from terratool.mesh.chords import chords_before
from terratool.mesh.inside import rut_of, tracks_at
from terratool.mesh.segments import DRAWN, stretch, weights
from terratool.mesh.sides import curve_at, faceted, gauge, sector

_ODD = 0x9E3779B97F4A7C15
_TRACK = 0xD1B54A32D192ED03


@device
def stir(key, more):
    """A hash of 64 bits of a hash and one number more."""
    key = (np.uint64(key) ^ np.uint64(more)) * np.uint64(_ODD)
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))


@device
def look(plan, index, x, y):
    """Whether an element covers a place, a hash of how, its groups, and whether it is affine."""
    field = plan.field
    element = field.elements[index]
    kind = field.kinds[element.kind]
    pose = field.poses[element.pose]
    f = plan.frames[index]
    none = np.uint64(0), np.int64(0), np.int64(0), False
    if not (f.west <= x < f.east and f.south <= y < f.north):
        return False, none[0], none[1], none[2], none[3]
    u, v = (x - f.west) * f.per_x, (y - f.south) * f.per_y
    if pose.turned:
        u, v = turned(pose, u, v)
    own_u, own_v = u, v
    if kind.combine == RADIAL:
        rho = gauge(u, v, f.corners)
        if rho > 1.0:
            return False, none[0], none[1], none[2], none[3]
        u = v = 0.5 + 0.5 * rho
    elif beyond(u, v):
        return False, none[0], none[1], none[2], none[3]
    along, across = weights(plan, index)
    axis_x, axis_y = plan.axes[element.kind, 0], plan.axes[element.kind, 1]
    passed_x, group_x = stretch(plan, axis_x, along, u)
    passed_x += chords_before(plan, f.chord, f.chords_x, u)
    passed_y, group_y = passed_x, group_x
    if kind.combine != RADIAL:
        passed_y, group_y = stretch(plan, axis_y, across, v)
        passed_y += chords_before(plan, f.chord + f.chords_x, f.chords_y, v)
    straight = axis_x.linear and axis_y.linear
    wins = np.uint64(0)
    if faceted(kind, axis_x, element):
        wins = np.uint64(3 + f.corners + sector(own_u, own_v, f.corners))
    if straight and (kind.combine == MIN or kind.combine == MAX) and element.scale != 0.0:
        fx = curve_at(plan, kind, False, group_x, u, 0.0)
        wins = np.uint64(1 + (fx <= curve_at(plan, kind, True, group_y, v, 0.0)))
    key = stir(stir(stir(_ODD, index), passed_x + (passed_y << 32)), wins)
    affine = straight
    if kind.combine == PRODUCT:
        affine = (axis_x.level and axis_y.linear) or (axis_y.level and axis_x.linear)
    elif kind.combine == RADIAL:
        affine = axis_x.linear and f.rim > 1.0
    elif kind.combine == SUM:
        affine = straight != 0
    faint = min(along * axis_x.faintest, across * axis_y.faintest if across > 0.0 else np.inf)
    affine = element.scale == 0.0 or (affine and faint > DRAWN * plan.error)
    return True, key, group_x, group_y, affine


@kernel
def cover(plan, x, y, stack, out):
    """Which elements cover a place on the lattice: their number is returned first.

    They are written to `out`, COVER, as far as it has room. Returned are also a hash of them, the
    element that decides the surface (-1 for none), and whether all of them are affine there.
    """
    field = plan.field
    count = 0
    key = np.uint64(1)
    winner = np.int64(-1)
    plane = True
    world_x, world_y = plan.origin[0] + x * plan.pitch, plan.origin[1] + y * plan.pitch
    pending = 0
    g = np.uint64(0)
    while True:
        grid = field.grids[g]
        i = int(max(((world_x - grid.x) - grid.x_rest) * grid.per_x, 0.0))
        j = int(max(((world_y - grid.y) - grid.y_rest) * grid.per_y, 0.0))
        i, j = min(i, int(grid.nx) - 1), min(j, int(grid.ny) - 1)
        slot = np.uint64(
            grid.table + (j >> grid.shift_y) * np.int64(grid.bins_x) + (i >> grid.shift_x)
        )
        begin, end = np.uint64(field.offsets[slot]), np.uint64(field.offsets[slot + ONE])
        for k in range(begin, end):
            index = np.uint64(field.entries[k]) if grid.listed else k
            element, f = field.elements[index], plan.frames[index]
            if element.grid and f.west <= x < f.east and f.south <= y < f.north:
                stack[pending, 0] = element.grid
                pending += 1
            if not f.drawn:
                continue
            held, own, group_x, group_y, affine = look(plan, index, x, y)
            if not held:
                continue
            if count < len(out):
                out[count].element = np.uint32(index)
                out[count].group_x = np.uint32(group_x)
                out[count].group_y = np.uint32(group_y)
            count += 1
            key += own
            winner = max(winner, np.int64(index))
            plane = plane and affine
        if not pending:
            return count, key, winner, plane
        pending -= 1
        g = np.uint64(stack[pending, 0])


@device
def middle(points, triangles, t):
    """The centroid of a triangle, on the lattice."""
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    x = (points[a, 0] + points[b, 0] + points[c, 0]) / 3.0
    y = (points[a, 1] + points[b, 1] + points[c, 1]) / 3.0
    return x, y


@kernel
def signatures(plan, points, triangles, stack, found, marks, none, keys):
    """For each triangle a hash of what covers its middle, (m,) uint64. `none` is no COVER."""
    for t in range(len(triangles)):
        x, y = middle(points, triangles, t)
        _, keys[t], _, _ = cover(plan, x, y, stack, none)
        for k in range(tracks_at(plan.outlines, x, y, found, marks)):
            keys[t] += stir(_TRACK, found[k])


@kernel
def describe(
    plan, points, triangles, chosen, stack, found, marks, offsets, covers, winners, plane, drops,
    worn,
):  # fmt: skip
    """Covers and ruts of regions, each asked in the middle of one of its triangles.

    Without room in `covers` only `offsets` are written: how many covers the regions before have.
    """
    total = 0
    for r in range(len(chosen)):
        x, y = middle(points, triangles, chosen[r])
        offsets[r] = total
        count, _, winners[r], plane[r] = cover(plan, x, y, stack, covers[total:])
        total += count
        held = tracks_at(plan.outlines, x, y, found, marks)
        drops[r], worn[r] = 0.0, -1
        if held and not void_at(plan.field, winners[r]):
            ground = surface_of(plan.field, winners[r])
            drops[r], worn[r] = rut_of(plan.field.tracks, found, held, ground)
    offsets[len(chosen)] = total
