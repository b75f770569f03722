"""Ground, and what stands over gaps, as convex solids: few for many triangles, within an error.

A piece has corners x, y, z of triangles of the ground, or x, y, top, bottom of prisms over a gap.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.kernels import mesh as kernels

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Indices = NDArray[np.intp]

BELOW = 1.0
"""Least depth of a base below the lowest ground, units of the terrain."""
_PART = 0.1
"""Least depth of a base below the lowest ground, in parts of the relief."""
VOID = -2
"""Index of a surface that stands for no ground."""
OTHERS = -3
"""Index of a surface that stands for ground which others cover, and no solid may."""

SLIVER = 1e-9
"""Least area that counts, square units of the terrain."""
_SNAP = 1e-7
"""Distance below which a point is on a cut, or two heights are one, units of the terrain."""
_NARROW = 2e-5
"""Least width of strips that are cut off, and of gaps that count, units of the terrain."""
_STRAIGHT = 1e-6
"""Distance of a corner from a straight edge below which it lies in it, over gaps, units."""
_LEVEL = 1e-9
"""Tangent of a slope below which a plane over a gap is level."""
_CUTS = 12
"""Most edges that are tried as cuts of a piece."""
_CONSIDERED = 256
"""Most obstructing triangles, or walls and creases, that are considered, the largest first."""
_SHARES = 0.5, 0.25, 0.75, 0.375, 0.625
"""Places where cuts of bent ground are tried, in parts of its width."""
_STRIPS = 16
"""Least strips of a piece whose flatness says in which direction it is bent."""
_MOST_STRIPS = 512
"""Most strips of a piece whose flatness says in which direction it is bent."""
_BEND_SAMPLE = 4096
"""Triangles of a piece, about, that say in which direction it is bent."""
_CUT_SAMPLE = 32_768
"""Triangles, about, among which obstructions are sought, and that say where a cut is best."""
_PIECES = 64
"""Pieces into which ground is cut before each is covered by itself."""
_GOLDEN = 0.6180339887498949
"""Golden ratio: order of pieces in which each is far from the one before."""
_FAR = 1.25
"""Abort a region when its solids exceed this many times its share."""
_FIRST_SHARE = 0.2
"""Part of all solids that a region may have beyond its share, as its first ones tell little."""
_FIRST_SOLIDS = 8
"""Number of solids that a region may have beyond its share, as its first ones tell little."""
_STEEP = 0.7
"""Cosine of a plane's slope below which its edges are lowered to the ground's."""
_CORNERS = 512
"""Most corners of level ground, about, that rectangles along the axes are sought for."""
_MOST = 20_000
"""Most triangles of a piece that becomes one solid with a convex roof."""
_LARGE = 2_048
"""Most triangles of a piece whose cuts are scored by obstructions; larger ones are halved."""


class Solid(NamedTuple):
    """A convex solid between a roof and an underside, or the base far below.

    Attributes:
        top: (n, 3) float64 corners of the roof, which is the upper part of their convex hull; those
            of a flat roof are counter-clockwise seen from above.
        flat: whether the corners lie in a plane.
        surface: index of the surface, -1 for none.
        under: (m, 3) float64 corners of the underside; None for ground.
    """

    top: Floats
    flat: bool
    surface: int
    under: Floats | None = None


def base_below(low: float, high: float) -> float:
    """Return the height of the base of solids for ground from a lowest to a highest height."""
    return low - max(BELOW, _PART * (high - low))


class _Plane(NamedTuple):
    """A plane z = a x + b y + c that stands for points.

    Attributes:
        a: slope along x.
        b: slope along y.
        c: height at x = y = 0.
        miss: largest distance of the points, square to the plane: where ground is steep, distances
            along z say little.
    """

    a: float
    b: float
    c: float
    miss: float

    @property
    def cosine(self) -> float:
        """Cosine of the slope."""
        return 1.0 / math.sqrt(1.0 + self.a * self.a + self.b * self.b)

    @property
    def slope(self) -> float:
        """Tangent of the slope."""
        return math.hypot(self.a, self.b)

    def at(self, points: Floats) -> Floats:
        """Return heights of the plane at points, (…, 2 or 3)."""
        return np.asarray(self.a * points[..., 0] + self.b * points[..., 1] + self.c)


@dataclass(frozen=True)
class GroundTriangles:
    """The ground of a mesh as triangles, or the gaps of one, with spatial indices.

    Attributes:
        triangles: (n, 3, 3) float64 corners, counter-clockwise seen from above; of gaps (n, 3, 4):
            x, y, floor, ceiling.
        surfaces: (n,) int32 surface indices, -1 for none; VOID or OTHERS where it counts as far
            below.
        sharp: (k, 2, 2) float64 ends of walls and creases, seen from above.
    """

    triangles: Floats
    surfaces: Ints
    sharp: Floats

    @cached_property
    def tree(self) -> shapely.STRtree:
        """Spatial index of the triangles seen from above."""
        return shapely.STRtree(shapely.polygons(self.triangles[:, :, :2]))

    @cached_property
    def void_tree(self) -> shapely.STRtree:
        """Spatial index of the triangles of the void."""
        void = self.triangles[self.surfaces == VOID]
        return shapely.STRtree(shapely.polygons(void[:, :, :2]))

    @cached_property
    def sharp_tree(self) -> shapely.STRtree:
        """Spatial index of walls and creases."""
        return shapely.STRtree(shapely.linestrings(self.sharp))


class Tolerance(NamedTuple):
    """Largest distances by which a solid may stand out, units of the terrain.

    Attributes:
        height: distance of the roof from the ground, square to it.
        wall: reach of an edge over lower ground.
        seam: reach of an edge over another surface of about the same height.
        rim: reach of an edge over the void.
    """

    height: float
    wall: float
    seam: float
    rim: float


@dataclass
class Budget:
    """Number of solids that some ground may take, and progress in covering it.

    Attributes:
        most: most solids.
        area: area of the ground, seen from above.
        done: area of the ground that is covered.
        count: number of solids so far.
        until: time of the monotonic clock at which it is spent.
    """

    most: int
    area: float
    done: float = 0.0
    count: int = 0
    until: float = math.inf

    @property
    def is_spent(self) -> bool:
        """Whether there are too many solids, or will be by far."""
        if time.monotonic() > self.until:
            return True
        share = _FIRST_SHARE + _FAR * self.done / max(self.area, self.done, SLIVER)
        return self.count > min(share * self.most + _FIRST_SOLIDS, self.most)


def cover(
    ground: GroundTriangles,
    pieces: list[Floats],
    surfaces: list[int],
    tolerance: Tolerance,
    budget: Budget,
) -> list[Solid]:
    """Cover triangles by convex solids that rise above the ground by no more than is tolerated.

    A solid may lie under other, higher ground. Bent ground is cut where that straightens it most;
    a piece whose solid would stand over lower ground is cut along the edge of that ground. So is
    what stands over gaps, whose solids may lie within other solid ground, and reach into no gap.

    Args:
        ground: all of the ground, or all gaps.
        pieces: connected triangles, or parts of triangles, (m, 3, 3) each; over gaps (m, 3, 4).
        surfaces: surface index of each piece.
        tolerance: largest distances by which solids may stand out.
        budget: budget of all pieces, which is updated; once it is spent, solids are missing.
    """
    found: list[Solid] = []
    # the largest are cut first, and then taken from all over, so that a few tell of the whole
    parts = list(zip(pieces, surfaces, strict=True))
    sizes = [float(areas_of(piece).sum()) for piece in pieces]
    while 0 < len(parts) < _PIECES and not budget.is_spent:
        largest = int(np.argmax(sizes))
        piece, surface = parts.pop(largest)
        sizes.pop(largest)
        for side in _solid_or_sides(ground, piece, surface, tolerance, budget, found):
            parts.append((side, surface))
            sizes.append(float(areas_of(side).sum()))
    for k in sorted(range(len(parts)), key=lambda k: k * _GOLDEN % 1.0):
        if not budget.is_spent:
            found += _cover_piece(ground, *parts[k], tolerance, budget)
    return found


def _cover_piece(
    ground: GroundTriangles, piece: Floats, surface: int, tolerance: Tolerance, budget: Budget
) -> list[Solid]:
    """Cover a piece by solids, each triangle by one of its own where that takes fewer."""
    found: list[Solid] = []
    for side in _solid_or_sides(ground, piece, surface, tolerance, budget, found):
        if not budget.is_spent:
            found += _cover_piece(ground, side, surface, tolerance, budget)
    if len(found) > len(piece):  # no better than one for each triangle
        each = [
            one for one in piece if areas_of(one[None])[0] > SLIVER and not _is_narrow(one[None])
        ]
        budget.count += len(each) - len(found)
        return [Solid(one[:, :3], True, surface, _underside(one)) for one in each]
    return found


def _solid_or_sides(
    ground: GroundTriangles,
    piece: Floats,
    surface: int,
    tolerance: Tolerance,
    budget: Budget,
    found: list[Solid],
) -> list[Floats]:
    """Add the solid that stands for a piece to `found`, or else cut the piece into sides."""
    areas = areas_of(piece)
    piece = piece[areas > SLIVER]
    if not len(piece) or _is_narrow(piece):
        budget.done += float(areas.sum())
        return []
    solid, bad = _single_solid(ground, piece, surface, tolerance)
    if solid is None:
        return _cut_around(ground, piece, bad) if len(bad) else _cut_bent(ground, piece)
    budget.done += float(areas.sum())
    budget.count += 1
    found.append(solid)
    return []


def _single_solid(
    ground: GroundTriangles, piece: Floats, surface: int, tolerance: Tolerance
) -> tuple[Solid | None, Floats]:
    """Return the solid that stands for a piece, or triangles in the way of a plane one, if any."""
    corners = _corners_of(piece)
    planes = _planes(corners)
    none = np.empty((0, 3, 3))
    alone = len(piece) == 1
    if alone or all(plane.miss <= tolerance.height for plane in planes):
        hull = _hull(corners[:, :2])
        bad = none if alone else _obstructions(ground, hull, planes, surface, tolerance)
        if not len(bad):
            boxed = None
            if len(planes) > 1 and max(plane.slope for plane in planes) < _LEVEL:
                boxed = hull.minimum_rotated_rectangle  # posts may have taken its corners
                if len(_obstructions(ground, boxed, planes, surface, tolerance)):
                    boxed = None
            ring = shapely.get_coordinates(boxed or hull)[:-1]
            if not shapely.is_ccw(shapely.get_exterior_ring(boxed or hull)):
                ring = ring[::-1]
            if len(planes) > 1:
                ring = _straightened(ring)
            solid = _solid_under(ring, planes[0], corners, surface, tolerance.height)
            if len(planes) > 1:
                low = np.minimum(planes[1].at(ring), solid.top[:, 2])
                solid = solid._replace(under=np.column_stack([ring, low]))
            return solid, none
        return None, bad
    if not 3 < len(piece) <= _MOST:
        return None, none
    corners = np.unique(corners, axis=0)
    if _is_convex(piece, corners, tolerance.height):
        hull = _hull(corners[:, :2])
        rim = hull.buffer(-tolerance.rim, join_style="mitre")
        near = ground.tree.query(rim, predicate="intersects")
        void = len(planes) == 1 and (ground.surfaces[near] <= VOID).any()
        if not void and _fills(piece, hull.buffer(-tolerance.wall, join_style="mitre")):
            return Solid(corners[:, :3], False, surface, _underside(corners)), none
    return None, none


def plane_solid(shape: Any, triangle: Floats, surface: int) -> Solid:
    """Return the solid of a convex polygon in the plane of a triangle, (3, 3)."""
    ring = shapely.get_coordinates(shape)[:-1]
    if not shapely.is_ccw(shapely.get_exterior_ring(shape)):
        ring = ring[::-1]
    plane = _fit(triangle)
    return Solid(np.column_stack([ring, plane.at(ring)]), True, surface)


def rectangles_under(
    ground: GroundTriangles, shape: Any, top: float, surface: int, height: float
) -> list[Any]:
    """Return rectangles along the axes that cover level ground, and reach under higher ground.

    None are returned where other edges than such along the axes bound them.

    Args:
        ground: all of the ground.
        shape: polygon of the level ground seen from above.
        top: height of the level ground.
        surface: surface of the level ground.
        height: largest height over lower ground.
    """
    if shape.geom_type != "Polygon":
        return []
    whole = shapely.polygons(shapely.get_exterior_ring(shape))
    if len(shapely.get_coordinates(whole)) > _CORNERS or not _is_straight(whole):
        return []
    near = np.sort(ground.tree.query(whole, predicate="intersects"))
    found, worn = ground.triangles[near], ground.surfaces[near]
    low = found[:, :, 2].min(axis=1)
    bars = (low < top - height) | (worn <= VOID) | ((worn != surface) & (low < top + _SNAP))
    barred = shapely.union_all(ground.tree.geometries[near[bars]])
    free = shapely.difference(whole, barred)
    pieces = [part for part in shapely.get_parts(free) if part.geom_type == "Polygon"]
    if not all(_is_straight(part) for part in pieces):
        return []
    corners = np.concatenate([shapely.get_coordinates(part) for part in pieces])
    x, y = (np.unique(corners[:, axis]) for axis in (0, 1))
    if len(x) * len(y) > _CORNERS**2:
        return []
    shapely.prepare(free)
    within = shapely.contains_xy(free, *np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])))
    within &= (np.diff(x)[None, :] > _NARROW) & (np.diff(y)[:, None] > _NARROW)
    runs: list[list[int]] = []  # first and last column, first and last row
    growing: dict[tuple[int, int], list[int]] = {}
    for row, own in enumerate(within):
        step = np.diff(np.concatenate([[0], own.astype(np.int8), [0]]))
        last, growing = growing, {}
        for run in zip(
            np.flatnonzero(step > 0).tolist(), np.flatnonzero(step < 0).tolist(), strict=True
        ):
            one = last.get(run)
            if one is None:
                runs.append(one := [*run, row, row])
            one[3], growing[run] = row + 1, one
    boxes = shapely.box(*(np.array([[x[a], y[c], x[b], y[d]] for a, b, c, d in runs]).T))
    shapely.prepare(shape)
    return list(boxes[shapely.intersects(shape, shapely.buffer(boxes, -_NARROW))])


def _is_straight(shape: Any) -> bool:
    """Whether all edges of a polygon lie along the axes."""
    edges = np.concatenate(list(_edges(shape)))
    return bool((np.abs(edges[:, 0] - edges[:, 1]).min(axis=1) <= _SNAP).all())


def _is_convex(piece: Floats, corners: Floats, height: float) -> bool:
    """Whether triangles are the roof of a convex solid, and over a gap the underside of one, too.

    Args:
        piece: triangles.
        corners: all corners of them, (n, 3) or (n, 4).
        height: largest distance of a face from the solid.
    """
    faces = zip(_faces_of(piece), _faces_of(corners), (1.0, -1.0), strict=False)
    return all(
        kernels.is_roof((tops * (1.0, 1.0, up)).reshape(-1, 9), ends * (1.0, 1.0, up), height)
        for tops, ends, up in faces
    )


def _faces_of(corners: Floats) -> list[Floats]:
    """Return x, y, z of corners, (…, 3), at their tops and, over a gap, at their undersides."""
    columns = ([0, 1, 2], [0, 1, 3])[: corners.shape[-1] - 2]
    return [np.ascontiguousarray(corners[..., own]) for own in columns]


def _corners_of(piece: Floats) -> Floats:
    """Return all corners of triangles, (3 n, 3) or (3 n, 4)."""
    return piece.reshape(-1, piece.shape[-1])


def _underside(corners: Floats) -> Floats | None:
    """Return the corners of the underside of what stands over a gap; None for ground."""
    return corners[:, [0, 1, 3]] if corners.shape[1] > 3 else None


def _planes(corners: Floats) -> list[_Plane]:
    """Return the plane of the tops of corners and, over a gap, that of the undersides."""
    return [_fit(face) for face in _faces_of(corners)]


def _fills(piece: Floats, shape: Any) -> bool:
    """Whether a piece covers a shape, but for gaps too narrow to count."""
    triangles = shapely.polygons(piece[:, :, :2])
    shapely.prepare(shape)
    if shape.area - shapely.area(shapely.intersection(triangles, shape)).sum() <= SLIVER:
        return True
    gaps = shapely.difference(shape, shapely.union_all(triangles))
    return bool(gaps.buffer(-0.5 * _NARROW, join_style="mitre").is_empty)


def _solid_under(
    ring: Floats, plane: _Plane, corners: Floats, surface: int, height: float
) -> Solid:
    """Return the solid below a plane within a ring; edges of a steep one are lowered to corners."""
    top = plane.at(ring)
    if plane.cosine < _STEEP:
        place = (corners[None, :, :2] == ring[:, None]).all(axis=2)
        own = np.where(place, corners[:, 2], -np.inf).max(axis=1)
        low = np.minimum(top, own + height)
        if (low < top).any():
            return Solid(np.column_stack([ring, low]), False, surface)
    return Solid(np.column_stack([ring, top]), True, surface)


def _hull(points: Floats) -> Any:
    """Return the convex hull of points, (n, 2), by way of a line, which is faster."""
    return shapely.convex_hull(shapely.linestrings(np.concatenate([points, points[:1]])))


def _straightened(ring: Floats) -> Floats:
    """Return a convex ring, (n, 2), without corners that are all but straight.

    Where several meshes are laid over each other, places on a straight edge are rounded apart.
    """
    into, out = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    turn = np.arctan2(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0], (into * out).sum(axis=1))
    ring = np.roll(ring, -int(np.argmax(turn)), axis=0)
    line = shapely.linestrings(np.concatenate([ring, ring[:1]]))
    straight = shapely.get_coordinates(shapely.simplify(line, _STRAIGHT))[:-1]
    return straight if len(straight) > 2 else ring


def _is_narrow(piece: Floats) -> bool:
    """Whether a piece is everywhere too narrow to count."""
    hull = _hull(_corners_of(piece)[:, :2])
    return bool(hull.area <= 0.25 * _NARROW * hull.length)


def _obstructions(
    ground: GroundTriangles, hull: Any, planes: list[_Plane], surface: int, tolerance: Tolerance
) -> Floats:
    """Return triangles of the ground that a solid within a polygon must not cover, (n, 3, 3)."""
    near = np.sort(ground.tree.query(hull, predicate="intersects"))
    bad = np.empty((0, 3, 3))
    # where much is near, a sample of it tells enough
    for some in (near[:: max(1, len(near) // _CUT_SAMPLE)], near):
        if not len(bad):
            bad = _obstructing_parts(ground, some, hull, planes, surface, tolerance)
    return bad


def _obstructing_parts(
    ground: GroundTriangles,
    near: Indices,
    hull: Any,
    planes: list[_Plane],
    surface: int,
    tolerance: Tolerance,
) -> Floats:
    """Return parts of given triangles that a solid within a polygon must not cover, (n, 3, 3)."""
    inner = hull.buffer(-tolerance.wall, join_style="mitre")
    found, plane = ground.triangles[near], planes[0]
    # distances are square to the flatter of the two: a steep plane over level ground is a burr
    cosines = np.maximum(plane.cosine, _cosines(found[:, :, :3]))[:, None]
    above = cosines * (plane.at(found) - found[:, :, 2])
    other = ground.surfaces[near] != surface
    bad = []
    narrow = hull.buffer(-max(tolerance.seam, tolerance.wall), join_style="mitre")
    void = ground.surfaces[near] <= VOID
    for zone, which, limit in (
        (inner, slice(None), tolerance.height + _SNAP),  # lower ground
        (hull.buffer(-tolerance.rim, join_style="mitre"), void, 0.0),
        (narrow, other, -_SNAP),  # another surface
    ):
        if zone.is_empty:
            continue
        over = above[which] - limit
        one = (over > 0.0).any(axis=1)
        parts, _ = clip(found[which][one], over[one], 1e-12)
        for under in planes[1:]:  # a gap that ends below the solid is not in its way
            steep = np.maximum(under.cosine, _cosines(parts[:, :, [0, 1, 3]]))[:, None]
            reach = steep * (parts[:, :, 3] - under.at(parts)) - (tolerance.height + _SNAP)
            parts, _ = clip(parts, reach, 1e-12)
        parts = parts[areas_of(parts) > SLIVER][:, :, :3]
        bad.append(parts[shapely.intersects(zone, shapely.polygons(parts[:, :, :2]))])
    return np.concatenate(bad) if bad else np.empty((0, 3, 3))


def _cosines(triangles: Floats) -> Floats:
    """Return the cosines of the slopes of triangles, (n,)."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    return np.asarray(np.abs(normals[:, 2]) / lengths)


def _cut_bent(ground: GroundTriangles, piece: Floats) -> list[Floats]:
    """Cut a piece in two along a wall or crease in it, or across where it is bent most."""
    hull = _hull(_corners_of(piece)[:, :2])
    inner = hull.buffer(-_NARROW, join_style="mitre")
    near = np.sort(ground.sharp_tree.query(inner, predicate="intersects"))
    best = _best_cut(piece, _edges_within(piece, ground.sharp[near]), _flatness)
    if best is None:
        best = _line_across(piece)
    sides = _cut(piece, *best)
    return sides if len(sides) > 1 else [piece[:1], piece[1:]]


def _edges_within(piece: Floats, edges: Floats) -> Floats:
    """Return the longest edges that a piece lies on both sides of, (k, 2, 2), up to `_CUTS`."""
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    edges = edges[np.argsort(-lengths, kind="stable")[:_CONSIDERED]]
    found = edges[:0]
    for k in range(0, len(edges), 2 * _CUTS):
        some = edges[k : k + 2 * _CUTS]
        along = some[:, 1] - some[:, 0]
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        aside = _NARROW * np.stack([-along[:, 1], along[:, 0]], axis=1)
        middles = some.mean(axis=1)
        both = _holds(piece, middles + aside) & _holds(piece, middles - aside)
        found = np.concatenate([found, some[both]])[:_CUTS]
        if len(found) == _CUTS:
            break
    return found


def _holds(piece: Floats, points: Floats) -> NDArray[np.bool_]:
    """Whether points lie in a piece seen from above, (k,) bool."""
    inside = np.empty(len(points), np.bool_)
    triangles = np.ascontiguousarray(piece[:, :, :3])
    kernels.covered_points(triangles.reshape(-1, 9), points, inside)
    return inside


def _flatness(piece: Floats, along: Floats) -> float:
    """Return the sum of planes' misses on both sides of a cut; `along`: (n, 3) distances."""
    east = along.mean(axis=1) > 0
    sides = _corners_of(piece[east]), _corners_of(piece[~east])
    return sum(_miss(side) for side in sides if len(side))


def _miss(corners: Floats) -> float:
    """Return the largest distance of corners from the plane of their tops, or of undersides."""
    return max(plane.miss for plane in _planes(corners))


def _best_cut(
    piece: Floats, edges: Floats, score: Callable[[Floats, Floats], float]
) -> tuple[Floats, float] | None:
    """Return normal and place of the cut along an edge with the least score; None if none cuts."""
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    best: tuple[float, Floats, float] | None = None
    some = piece[:: max(1, len(piece) // _CUT_SAMPLE)]
    for i in np.argsort(-lengths, kind="stable")[:_CUTS].tolist():
        if lengths[i] < 1e-6:
            break
        dx, dy = (edges[i, 1] - edges[i, 0]) / lengths[i]
        normal = np.array([-dy, dx])
        at = float(edges[i].mean(axis=0) @ normal)
        along = some[:, :, :2] @ normal - at
        if along.max() < _NARROW or along.min() > -_NARROW:
            continue
        cost = score(some, along)
        if best is None or cost < best[0]:
            best = cost, normal, at
    return None if best is None else best[1:]


def _line_across(piece: Floats) -> tuple[Floats, float]:
    """Return normal and place of a cut in a gap, or across the way a piece is bent most."""
    some = max(1, len(piece) // _BEND_SAMPLE)
    corners = _corners_of(piece[::some])
    away = corners[:, :2] - corners[:, :2].mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    best: tuple[float, Floats, Floats] | None = None
    gap = 0.0, axes[:, 0], 0.0
    for normal in (axes[:, 1], axes[:, 0], np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        wide, at = _widest_gap(piece[:, :, :2] @ normal)
        if wide > max(gap[0], _NARROW):
            gap = wide, normal, at
        along = corners[:, :2] @ normal
        # many strips, as two are no better than one where the ground is a wave
        wide = np.ptp(corners[:, :2] @ [-normal[1], normal[0]])
        strips = int(np.clip(2.0 * np.ptp(along) / max(wide, 1e-300), _STRIPS, _MOST_STRIPS))
        score = max(_strip_misses(face, along, strips).mean() for face in _faces_of(corners))
        if best is None or score < best[0] - 1e-12:
            best = float(score), normal, along
    assert best is not None
    if gap[0] > 0.0:
        return gap[1:]
    _, normal, along = best
    low, high = float(along.min()), float(along.max())
    cuts = []
    for share in _SHARES:
        at = low + share * (high - low)
        left, right = corners[along <= at], corners[along >= at]
        cuts.append((_miss(left) + _miss(right), at))
    return normal, min(cuts)[1]


def _widest_gap(along: Floats) -> tuple[float, float]:
    """Return width and place of the widest gap between triangles, by corners along a line."""
    order = np.argsort(along.min(axis=1), kind="stable")
    ends, begins = (
        np.maximum.accumulate(along.max(axis=1)[order])[:-1],
        along.min(axis=1)[order][1:],
    )
    if not len(ends):
        return 0.0, 0.0
    widest = int(np.argmax(begins - ends))
    return float(begins[widest] - ends[widest]), float(0.5 * (begins[widest] + ends[widest]))


def _strip_misses(points: Floats, along: Floats, strips: int) -> Floats:
    """Return the miss of the plane of each strip of points, as of `_fit`; empty ones left out."""
    low, high = along.min(), along.max()
    strip = np.minimum((strips * (along - low) / max(high - low, 1e-300)).astype(int), strips - 1)
    order = np.argsort(strip, kind="stable")
    begins = np.flatnonzero(np.append(True, np.diff(strip[order]) > 0))
    count = np.diff(np.append(begins, len(points)))
    sums = np.add.reduceat(points[order].T, begins, axis=1)
    x, y, z = away = points[order].T - np.repeat(sums / count, count, axis=1)
    xx, xy, xz = np.add.reduceat(away * x, begins, axis=1)
    _, yy, yz = np.add.reduceat(away * y, begins, axis=1)
    size = xx * yy - xy * xy
    flat = size <= 1e-12 * (xx + yy) ** 2
    size = np.where(flat, np.inf, size)
    a, b = (xz * yy - yz * xy) / size, (yz * xx - xz * xy) / size
    rest = z - np.repeat(a, count) * x - np.repeat(b, count) * y
    spread = np.maximum.reduceat(rest, begins) - np.minimum.reduceat(rest, begins)
    return np.asarray(0.5 * spread / np.sqrt(1.0 + a * a + b * b))


def _cut_around(ground: GroundTriangles, piece: Floats, bad: Floats) -> list[Floats]:
    """Cut a piece in two along an edge of the triangles in its way."""
    hull = _hull(_corners_of(piece)[:, :2])
    bad = bad[np.argsort(-areas_of(bad), kind="stable")[:_CONSIDERED]]
    outline = shapely.union_all(shapely.polygons(bad[:, :, :2]))
    outline = shapely.simplify(outline.intersection(hull), 1e-6)

    def covered_area(piece: Floats, along: Floats) -> float:
        corners, along = _corners_of(piece)[:, :2], along.ravel()
        sides = corners[along >= -_SNAP], corners[along <= _SNAP]
        hulls = [_hull(side) for side in sides]
        return float(shapely.area(shapely.intersection(hulls, outline)).sum())

    edges = np.concatenate([*_edges(outline), np.empty((0, 2, 2))])
    best = _best_cut(piece, edges, _imbalance if len(piece) > _LARGE else covered_area)
    return _cut_bent(ground, piece) if best is None else _cut(piece, *best)


def _imbalance(_: Floats, along: Floats) -> float:
    """Return the imbalance of corners on both sides of a cut; `along`: (n, 3) distances."""
    return abs(float(np.sign(along).sum()))


def _edges(shape: Any) -> Iterator[Floats]:
    """Yield the edges of each line around a shape, (n, 2, 2)."""
    for line in shapely.get_parts(shapely.boundary(shapely.get_parts(shape))):
        for one in shapely.get_parts(line):
            points = shapely.get_coordinates(one)
            yield np.stack([points[:-1], points[1:]], axis=1)


def _cut(piece: Floats, normal: Floats, at: float) -> list[Floats]:
    """Cut a piece by a line, given by normal and place; return the sides with triangles."""
    sides = clip(piece, piece[:, :, :2] @ normal - at, _SNAP)
    return [side for side in sides if len(side)]


def _fit(points: Floats) -> _Plane:
    """Return the plane of least squares, moved midway between highest and lowest point."""
    middle = points.mean(axis=0)
    x, y, z = (points - middle).T
    xx, xy, yy = float(x @ x), float(x @ y), float(y @ y)
    xz, yz = float(x @ z), float(y @ z)
    size = xx * yy - xy * xy
    a = b = 0.0
    if size > 1e-12 * (xx + yy) ** 2:
        a, b = (xz * yy - yz * xy) / size, (yz * xx - xz * xy) / size
    rest = z - a * x - b * y
    low, high = float(rest.min()), float(rest.max())
    c = float(middle[2] - a * middle[0] - b * middle[1]) + 0.5 * (low + high)
    return _Plane(a, b, c, 0.5 * (high - low) / math.sqrt(1.0 + a * a + b * b))


def clip(triangles: Floats, distance: Floats, snap: float) -> tuple[Floats, Floats]:
    """Cut triangles where a linear function is 0; return the positive and the negative side.

    Args:
        triangles: (n, 3, k) corners of triangles.
        distance: (n, 3) values of the function at the corners.
        snap: largest magnitude of a value that counts as 0.
    """
    distance = np.where(np.abs(distance) <= snap, 0.0, distance)
    above = ~(distance < 0).any(axis=1)
    below = ~(distance > 0).any(axis=1) & ~above
    mixed = ~(above | below)
    sides = [triangles[above]], [triangles[below]]
    cut, at = triangles[mixed], distance[mixed]
    for side, sign in zip(sides, (1.0, -1.0), strict=True):
        d = sign * at
        single = (d > 0).sum(axis=1) == 1
        for one in (True, False) if len(d) else ():
            e, p = d[single == one], cut[single == one]
            # the corner that is alone on its side comes first
            first = np.argmax(e, axis=1) if one else np.argmin(e, axis=1)
            order = (first[:, None] + np.arange(3)) % 3
            e = np.take_along_axis(e, order, axis=1)
            a, b, c = np.moveaxis(np.take_along_axis(p, order[:, :, None], axis=1), 1, 0)
            ab = a + (e[:, 0] / (e[:, 0] - e[:, 1]))[:, None] * (b - a)
            ac = a + (e[:, 0] / (e[:, 0] - e[:, 2]))[:, None] * (c - a)
            if one:
                side.append(np.stack([a, ab, ac], axis=1))
            else:
                side += [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
    return np.concatenate(sides[0]), np.concatenate(sides[1])


def areas_of(triangles: Floats) -> Floats:
    """Return areas of triangles, (n, 3, k), seen from above, (n,)."""
    a, b = np.moveaxis(triangles[:, 1:, :2] - triangles[:, :1, :2], 1, 0)
    return np.asarray(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


class PlanRectangle(NamedTuple):
    """A level rectangle seen from above, the top of a box.

    Attributes:
        middle: x and y of the middle.
        half: half lengths of the first and the second side.
        turn: angle from x to the first side, radians, counter-clockwise.
        top: height of the rectangle.
        under: height of the underside of the box; None for ground.
    """

    middle: tuple[float, float]
    half: tuple[float, float]
    turn: float
    top: float
    under: float | None


def plan_rectangle(solid: Solid) -> PlanRectangle | None:
    """Return the level rectangle that a solid is seen from above; None for another shape."""
    top, under = solid.top, solid.under
    if not solid.flat or len(top) != 4 or np.ptp(top[:, 2]) > 1e-9:
        return None
    if under is not None and np.ptp(under[:, 2]) > 1e-9:
        return None
    corners = top[:, :2]
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    skew = np.abs((sides * np.roll(sides, -1, axis=0)).sum(axis=1)) / lengths
    if skew.max() > 1e-6:
        return None
    first = int(np.argmax(sides[:, 0] / lengths))  # the side that points most to the east
    x, y = sides[first].tolist()
    middle = corners.mean(axis=0).tolist()
    half = 0.5 * float(lengths[first]), 0.5 * float(lengths[(first + 1) % 4])
    turn = math.atan2(y, x)
    return PlanRectangle(
        (middle[0], middle[1]),
        half,
        turn if abs(turn) * max(half) > 1e-7 else 0.0,
        float(top[0, 2]),
        None if under is None else float(under[0, 2]),
    )
