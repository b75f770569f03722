"""Ground as convex solids: few that stand for many triangles of a mesh, within an error."""

from __future__ import annotations

import math
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

VOID = -2
"""In place of a surface: there is no ground."""

SLIVER = 1e-9
"""Smaller areas are nothing, in square units of the terrain."""
_SNAP = 1e-7
"""What is nearer to a cut than this is on it."""
_NARROW = 2e-5
"""No strips narrower than this are cut off, in units of the terrain; a gap of it is none."""
_CUTS = 12
"""So many edges of what is in the way are tried as cuts."""
_CONSIDERED = 256
"""So many triangles of what is in the way are looked at, or walls and creases, the largest."""
_SHARES = 0.5, 0.25, 0.75, 0.375, 0.625
"""Where bent ground is cut, in parts of its width …"""
_STRIPS = 16
"""… across the direction in which so many strips of it are flattest, or more where it is long …"""
_MOST_STRIPS = 512
"""… but no more than these."""
_TOLD = 4096
"""So many triangles, about, tell how ground is bent …"""
_WAY = 32_768
"""… and so many what is in the way, and where it is cut best."""
_SAMPLE = 64
"""Ground is cut into so many pieces first, if it takes as many …"""
_GOLDEN = 0.6180339887498949
"""… and of these each is far from the one before."""
_FAR = 1.25
"""Ground is given up once it has so many times the solids that its share may have …"""
_FIRST = 0.2, 8
"""… and this part of all of them, and so many, as the first ones tell little of the rest."""
_STEEP = 0.7
"""Planes of a smaller cosine may end far above the ground at their edge."""
_MOST = 20_000
"""Ground of more triangles is no hill."""
_LARGE = 2_048
"""Ground of more triangles is halved first, as to cut off one solid by one takes long."""


class Solid(NamedTuple):
    """All that lies between a convex roof and the base far below.

    Attributes:
        top: (n, 3) float64 corners of the roof, which is the upper part of their convex hull; of a
            flat one they go round counter-clockwise seen from above.
        flat: whether they lie in a plane.
        surface: index of its surface, -1 for none.
    """

    top: Floats
    flat: bool
    surface: int


class _Plane(NamedTuple):
    """z = a x + b y + c, and how far the corners of what it stands for are from it at most.

    Distances are square to it: where ground is steep, along z they say little.
    """

    a: float
    b: float
    c: float
    miss: float

    @property
    def cosine(self) -> float:
        """Of its slope."""
        return 1.0 / math.sqrt(1.0 + self.a * self.a + self.b * self.b)

    def at(self, points: Floats) -> Floats:
        """Its heights at points, (…, 2 or 3)."""
        return np.asarray(self.a * points[..., 0] + self.b * points[..., 1] + self.c)


@dataclass(frozen=True)
class Ground:
    """The ground of a mesh.

    Attributes:
        triangles: (n, 3, 3) float64 corners, counter-clockwise seen from above.
        surfaces: (n,) int32, -1 for none, VOID where there is no ground but far below.
        sharp: (k, 2, 2) ends of walls and creases, seen from above.
    """

    triangles: Floats
    surfaces: Ints
    sharp: Floats

    @cached_property
    def tree(self) -> shapely.STRtree:
        """The triangles seen from above, by place."""
        return shapely.STRtree(shapely.polygons(self.triangles[:, :, :2]))

    @cached_property
    def void_tree(self) -> shapely.STRtree:
        """The triangles of the void, by place."""
        void = self.triangles[self.surfaces == VOID]
        return shapely.STRtree(shapely.polygons(void[:, :, :2]))

    @cached_property
    def sharp_tree(self) -> shapely.STRtree:
        """Walls and creases, by place."""
        return shapely.STRtree(shapely.linestrings(self.sharp))


class Tolerance(NamedTuple):
    """How far a solid may stand out.

    Attributes:
        height: of the ground, square to it.
        wall: of an edge over lower ground.
        seam: of an edge over other ground of about the same height.
        rim: of an edge over the void.
    """

    height: float
    wall: float
    seam: float
    rim: float


@dataclass
class Budget:
    """How many solids there may be, and how far it is.

    Attributes:
        most: so many.
        area: of all that they are for, seen from above.
        done: of what has them.
        count: so many there are.
    """

    most: int
    area: float
    done: float = 0.0
    count: int = 0

    @property
    def spent(self) -> bool:
        """Whether there are too many, or will be by far."""
        part, more = _FIRST
        by_now = (part + _FAR * self.done / max(self.area, self.done, SLIVER)) * self.most + more
        return self.count > min(by_now, self.most)


def cover(
    ground: Ground, pieces: list[Floats], surfaces: list[int], tolerance: Tolerance, budget: Budget
) -> list[Solid]:
    """Cover triangles by convex solids that rise above the ground by no more than is tolerated.

    A solid may lie under other, higher ground. What is bent is cut where that straightens it most,
    and where a solid would stand over lower ground it is cut along the edge of that.

    Args:
        ground: all of the ground.
        pieces: (m, 3, 3) triangles, or parts of them, that hang together.
        surfaces: those of the pieces.
        tolerance: how far solids may stand out.
        budget: is changed; once it is spent, what is found is not all.
    """
    found: list[Solid] = []
    # the largest are cut first, and then taken from all over: so a part of it tells of the whole
    parts = list(zip(pieces, surfaces, strict=True))
    sizes = [float(areas_of(piece).sum()) for piece in pieces]
    while 0 < len(parts) < _SAMPLE and not budget.spent:
        largest = int(np.argmax(sizes))
        piece, surface = parts.pop(largest)
        sizes.pop(largest)
        for side in _solid_or_sides(ground, piece, surface, tolerance, budget, found):
            parts.append((side, surface))
            sizes.append(float(areas_of(side).sum()))
    for k in sorted(range(len(parts)), key=lambda k: k * _GOLDEN % 1.0):
        if not budget.spent:
            found += _covered(ground, *parts[k], tolerance, budget)
    return found


def _covered(
    ground: Ground, piece: Floats, surface: int, tolerance: Tolerance, budget: Budget
) -> list[Solid]:
    found: list[Solid] = []
    for side in _solid_or_sides(ground, piece, surface, tolerance, budget, found):
        if not budget.spent:
            found += _covered(ground, side, surface, tolerance, budget)
    if len(found) > len(piece):  # no better than each by itself
        each = [
            one for one in piece if areas_of(one[None])[0] > SLIVER and not _is_narrow(one[None])
        ]
        budget.count += len(each) - len(found)
        return [Solid(one, True, surface) for one in each]
    return found


def _solid_or_sides(
    ground: Ground,
    piece: Floats,
    surface: int,
    tolerance: Tolerance,
    budget: Budget,
    found: list[Solid],
) -> list[Floats]:
    """Adds the solid that stands for a piece, or else cuts it."""
    areas = areas_of(piece)
    piece = piece[areas > SLIVER]
    if not len(piece) or _is_narrow(piece):
        budget.done += float(areas.sum())
        return []
    solid, bad = _as_one(ground, piece, surface, tolerance)
    if solid is None:
        return _divided(ground, piece, bad) if len(bad) else _bent(ground, piece)
    budget.done += float(areas.sum())
    budget.count += 1
    found.append(solid)
    return []


def _as_one(
    ground: Ground, piece: Floats, surface: int, tolerance: Tolerance
) -> tuple[Solid | None, Floats]:
    """The solid that stands for a piece, or what is in the way of a plane one, if anything is."""
    corners = piece.reshape(-1, 3)
    plane = _fit(corners)
    none = np.empty((0, 3, 3))
    alone = len(piece) == 1
    if plane.miss <= tolerance.height or alone:
        hull = _hull(corners[:, :2])
        bad = none if alone else _in_the_way(ground, hull, plane, surface, tolerance)
        if not len(bad):
            ring = shapely.get_coordinates(hull)[:-1]
            if not shapely.is_ccw(shapely.get_exterior_ring(hull)):
                ring = ring[::-1]
            return _under(ring, plane, corners, surface, tolerance.height), none
        return None, bad
    if not 3 < len(piece) <= _MOST:
        return None, none
    corners = np.unique(corners, axis=0)
    if kernels.is_roof(piece.reshape(-1, 9), corners, tolerance.height):
        hull = _hull(corners[:, :2])
        rim = hull.buffer(-tolerance.rim, join_style="mitre")
        near = ground.tree.query(rim, predicate="intersects")
        void = (ground.surfaces[near] == VOID).any()
        if not void and _fills(piece, hull.buffer(-tolerance.wall, join_style="mitre")):
            return Solid(corners, False, surface), none
    return None, none


def _fills(piece: Floats, shape: Any) -> bool:
    """Whether a piece covers a shape, but for gaps that are none."""
    triangles = shapely.polygons(piece[:, :, :2])
    shapely.prepare(shape)
    if shape.area - shapely.area(shapely.intersection(triangles, shape)).sum() <= SLIVER:
        return True
    gaps = shapely.difference(shape, shapely.union_all(triangles))
    return bool(gaps.buffer(-0.5 * _NARROW, join_style="mitre").is_empty)


def _under(ring: Floats, plane: _Plane, corners: Floats, surface: int, height: float) -> Solid:
    """The solid below a plane within a ring of corners; where it is steep, no burr rises there."""
    top = plane.at(ring)
    if plane.cosine < _STEEP:
        place = (corners[None, :, :2] == ring[:, None]).all(axis=2)
        own = np.where(place, corners[:, 2], -np.inf).max(axis=1)
        low = np.minimum(top, own + height)
        if (low < top).any():
            return Solid(np.column_stack([ring, low]), False, surface)
    return Solid(np.column_stack([ring, top]), True, surface)


def _hull(points: Floats) -> Any:
    """The convex hull of points, (n, 2); as a line they take less time than one by one."""
    return shapely.convex_hull(shapely.linestrings(np.concatenate([points, points[:1]])))


def _is_narrow(piece: Floats) -> bool:
    """Whether a piece is narrower everywhere than anything that counts."""
    hull = _hull(piece.reshape(-1, 3)[:, :2])
    return bool(hull.area <= 0.25 * _NARROW * hull.length)


def _in_the_way(
    ground: Ground, hull: Any, plane: _Plane, surface: int, tolerance: Tolerance
) -> Floats:
    """Triangles of the ground that a plane within a polygon must not cover: (n, 3, 3)."""
    near = np.sort(ground.tree.query(hull, predicate="intersects"))
    bad = np.empty((0, 3, 3))
    # where much is in the way, a part of it tells enough
    for some in (near[:: max(1, len(near) // _WAY)], near):
        if not len(bad):
            bad = _wrong(ground, some, hull, plane, surface, tolerance)
    return bad


def _wrong(
    ground: Ground, near: Indices, hull: Any, plane: _Plane, surface: int, tolerance: Tolerance
) -> Floats:
    """What of some triangles of the ground a plane within a polygon must not cover: (n, 3, 3)."""
    inner = hull.buffer(-tolerance.wall, join_style="mitre")
    found = ground.triangles[near]
    # square to the flatter of the two: over level ground a steep plane is a burr
    cosines = np.maximum(plane.cosine, _cosines(found))[:, None]
    above = cosines * (plane.at(found) - found[:, :, 2])
    other = ground.surfaces[near] != surface
    bad = []
    narrow = hull.buffer(-max(tolerance.seam, tolerance.wall), join_style="mitre")
    void = ground.surfaces[near] == VOID
    for zone, which, limit in (
        (inner, slice(None), tolerance.height + _SNAP),  # lower ground
        (hull.buffer(-tolerance.rim, join_style="mitre"), void, 0.0),
        (narrow, other, -_SNAP),  # another surface
    ):
        if zone.is_empty:
            continue
        over = above[which] - limit
        one = (over > 0.0).any(axis=1)
        parts, _ = _clip(found[which][one], over[one], 1e-12)
        parts = parts[areas_of(parts) > SLIVER]
        bad.append(parts[shapely.intersects(zone, shapely.polygons(parts[:, :, :2]))])
    return np.concatenate(bad) if bad else np.empty((0, 3, 3))


def _cosines(triangles: Floats) -> Floats:
    """Of the slopes of triangles, (n,)."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    return np.asarray(np.abs(normals[:, 2]) / lengths)


def _bent(ground: Ground, piece: Floats) -> list[Floats]:
    """A piece cut in two along a wall or crease in it, or across where it is bent most."""
    hull = _hull(piece.reshape(-1, 3)[:, :2])
    inner = hull.buffer(-_NARROW, join_style="mitre")
    near = np.sort(ground.sharp_tree.query(inner, predicate="intersects"))
    best = _best_cut(piece, _within(piece, ground.sharp[near]), _flatness)
    if best is None:
        best = _across(piece)
    sides = _cut(piece, *best)
    return sides if len(sides) > 1 else [piece[:1], piece[1:]]


def _within(piece: Floats, edges: Floats) -> Floats:
    """Edges that a piece lies on both sides of, (k, 2, 2): as many as are tried, the longest."""
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
    """Whether points lie in a piece seen from above, (k,)."""
    inside = np.empty(len(points), np.bool_)
    kernels.covered_points(piece.reshape(-1, 9), points, inside)
    return inside


def _flatness(piece: Floats, along: Floats) -> float:
    """How far the two sides of a cut are from planes; (n, 3) are distances of its corners."""
    east = along.mean(axis=1) > 0
    sides = piece[east].reshape(-1, 3), piece[~east].reshape(-1, 3)
    return sum(_fit(side).miss for side in sides if len(side))


def _best_cut(
    piece: Floats, edges: Floats, score: Callable[[Floats, Floats], float]
) -> tuple[Floats, float] | None:
    """The normal and place of the cut along an edge with the least score; None if none cuts."""
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    best: tuple[float, Floats, float] | None = None
    some = piece[:: max(1, len(piece) // _WAY)]
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


def _across(piece: Floats) -> tuple[Floats, float]:
    """The normal and place of the cut across the direction in which a piece is bent most."""
    some = max(1, len(piece) // _TOLD)
    corners = piece[::some].reshape(-1, 3)
    away = corners[:, :2] - corners[:, :2].mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    best: tuple[float, Floats, Floats] | None = None
    gap = 0.0, axes[:, 0], 0.0
    for normal in (axes[:, 1], axes[:, 0], np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        wide, at = _gap(piece[:, :, :2] @ normal)
        if wide > max(gap[0], _NARROW):
            gap = wide, normal, at
        along = corners[:, :2] @ normal
        # in many strips, as two are no better than one where the ground is a wave
        wide = np.ptp(corners[:, :2] @ [-normal[1], normal[0]])
        strips = int(np.clip(2.0 * np.ptp(along) / max(wide, 1e-300), _STRIPS, _MOST_STRIPS))
        score = _misses(corners, along, strips).mean()
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
        cuts.append((_fit(left).miss + _fit(right).miss, at))
    return normal, min(cuts)[1]


def _gap(along: Floats) -> tuple[float, float]:
    """How wide the widest gap between triangles is, by their extents along a line; and where."""
    order = np.argsort(along.min(axis=1), kind="stable")
    ends, begins = (
        np.maximum.accumulate(along.max(axis=1)[order])[:-1],
        along.min(axis=1)[order][1:],
    )
    if not len(ends):
        return 0.0, 0.0
    widest = int(np.argmax(begins - ends))
    return float(begins[widest] - ends[widest]), float(0.5 * (begins[widest] + ends[widest]))


def _misses(points: Floats, along: Floats, strips: int) -> Floats:
    """How far points in each strip are from their plane at most, as `_fit` says; without empty."""
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


def _divided(ground: Ground, piece: Floats, bad: Floats) -> list[Floats]:
    """A piece cut in two along an edge of what is in its way."""
    hull = _hull(piece.reshape(-1, 3)[:, :2])
    bad = bad[np.argsort(-areas_of(bad), kind="stable")[:_CONSIDERED]]
    outline = shapely.union_all(shapely.polygons(bad[:, :, :2]))
    outline = shapely.simplify(outline.intersection(hull), 1e-6)

    def covered(piece: Floats, along: Floats) -> float:
        corners, along = piece.reshape(-1, 3)[:, :2], along.ravel()
        sides = corners[along >= -_SNAP], corners[along <= _SNAP]
        hulls = [_hull(side) for side in sides]
        return float(shapely.area(shapely.intersection(hulls, outline)).sum())

    edges = np.concatenate([*_edges(outline), np.empty((0, 2, 2))])
    best = _best_cut(piece, edges, _uneven if len(piece) > _LARGE else covered)
    return _bent(ground, piece) if best is None else _cut(piece, *best)


def _uneven(_: Floats, along: Floats) -> float:
    """How far a cut is from halving a piece; (n, 3) are distances of its corners."""
    return abs(float(np.sign(along).sum()))


def _edges(shape: Any) -> Iterator[Floats]:
    for line in shapely.get_parts(shapely.boundary(shapely.get_parts(shape))):
        for one in shapely.get_parts(line):
            points = shapely.get_coordinates(one)
            yield np.stack([points[:-1], points[1:]], axis=1)


def _cut(piece: Floats, normal: Floats, at: float) -> list[Floats]:
    sides = _clip(piece, piece[:, :, :2] @ normal - at, _SNAP)
    return [side for side in sides if len(side)]


def _fit(points: Floats) -> _Plane:
    """The plane of least squares, moved to the middle of the highest and the lowest point."""
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


def _clip(triangles: Floats, distance: Floats, snap: float) -> tuple[Floats, Floats]:
    """Triangles cut where a linear function is 0: where it is positive, and where negative.

    Args:
        triangles: (n, 3, 3).
        distance: (n, 3) the function at their corners.
        snap: what is nearer to 0 is 0.
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
            # the corner that stands alone comes first: here, or beyond
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
    """Areas of triangles, (n, 3, 3), seen from above; (n,)."""
    a, b = np.moveaxis(triangles[:, 1:, :2] - triangles[:, :1, :2], 1, 0)
    return np.asarray(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


class Rectangle(NamedTuple):
    """A level rectangle seen from above.

    Attributes:
        middle: x and y.
        half: half of its two sides.
        turn: radians, counter-clockwise, from x to the first side.
        top: its height.
    """

    middle: tuple[float, float]
    half: tuple[float, float]
    turn: float
    top: float


def rectangle(solid: Solid) -> Rectangle | None:
    """What a solid is seen from above, however turned; None for another shape."""
    top = solid.top
    if not solid.flat or len(top) != 4 or np.ptp(top[:, 2]) > 1e-9:
        return None
    corners = top[:, :2]
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    skew = np.abs((sides * np.roll(sides, -1, axis=0)).sum(axis=1)) / lengths
    if skew.max() > 1e-6:
        return None
    first = int(np.argmax(sides[:, 0] / lengths))  # that which points most to the east
    x, y = sides[first].tolist()
    middle = corners.mean(axis=0).tolist()
    half = 0.5 * float(lengths[first]), 0.5 * float(lengths[(first + 1) % 4])
    turn = math.atan2(y, x)
    return Rectangle(
        (middle[0], middle[1]),
        half,
        turn if abs(turn) * max(half) > 1e-7 else 0.0,
        float(top[0, 2]),
    )
