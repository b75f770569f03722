"""Level ground and level decks as upright boxes and cylinders, for simulators that have these."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.mesh.components import components
from terratool.mesh.stacked import StackParts
from terratool.mesh.types import Mesh

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

NEAR = 0.02
"""Distance that counts as none, in errors: levels of a mesh that are hardly apart are one."""
_MOST = 2_000
"""Most boxes and cylinders: simulators take long to load more."""
_LEVEL = 1e-6
"""Largest difference of heights of level ground, units of the terrain."""
_BELOW, _PART = 1.0, 0.1
"""Least depth of a base below the lowest ground, units of the terrain, and parts of the relief."""
_CORNERS = 8
"""Least corners of a polygon that stands for a circle."""
_SHARE = 0.5
"""Least part of level ground that boxes stand for, or none do."""
SAGITTA = 1.05
"""Largest distance of a polygon's side from the circle that it stands for, in errors."""


class Primitive(NamedTuple):
    """An upright box or cylinder with a level top, in the coordinates of a mesh.

    Attributes:
        surface: index of the surface, -1 for none.
        middle: x and y of the axis.
        half: half lengths of the first and the second side; the radius, twice, for a cylinder.
        turn: angle from x to the first side, radians, counter-clockwise.
        top: height of the top.
        under: height of the underside.
        is_round: whether it is a cylinder.
        seen: x and y of a place where the top is not within other ground.
    """

    surface: int
    middle: tuple[float, float]
    half: tuple[float, float]
    turn: float
    top: float
    under: float
    is_round: bool = False
    seen: tuple[float, float] = (math.nan, math.nan)

    @property
    def center(self) -> tuple[float, float, float]:
        """Place of the middle."""
        return *self.middle, 0.5 * (self.top + self.under)

    @property
    def size(self) -> tuple[float, float, float]:
        """Side lengths of the smallest box around it."""
        return 2.0 * self.half[0], 2.0 * self.half[1], self.top - self.under

    @property
    def axes(self) -> Floats:
        """Directions of the first and the second side, (2, 2), one a row."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return np.array([[cos, sin], [-sin, cos]])

    def corners(self, more: float = 0.0) -> Floats:
        """Return the corners of its outline seen from above, (4, 2), each side moved outwards."""
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        return np.asarray(self.middle + signs * (np.array(self.half) + more) @ self.axes)

    def holds(self, points: Floats, near: float) -> Bools:
        """Whether points, (…, 2), lie in its outline seen from above, or that near to it."""
        away = (points - self.middle) @ self.axes.T
        if self.is_round:
            return np.asarray(np.linalg.norm(away, axis=-1) <= self.half[0] + near)
        return np.asarray((np.abs(away) <= np.array(self.half) + near).all(axis=-1))


def primitives_of(ground: Mesh, parts: StackParts | None, error: float) -> list[Primitive]:
    """Return boxes and cylinders that stand for level ground, and for decks with level undersides.

    Each has the surface of its top, lies in solid ground and reaches down into it, to a base far
    below, or to the underside of its deck. It may go on under higher ground, not under ground of
    another surface at its level. What is level and neither a rectangle, nor one that others are cut
    out of, nor a circle, is left out, and so is what is smallest where there is much.

    Args:
        ground: mesh of the ground, without what stands over gaps.
        parts: ground, gaps, and what stands over these; None for a terrain without storeys.
        error: error of the mesh: a polygon that is no farther from a circle is one.
    """
    faces = _level_faces(ground, parts)
    if not len(faces.plan):
        return []
    space = _Space.of(ground, parts)
    kinds = faces.kinds()
    regions = _regions(faces.plan, kinds)
    sizes = _areas(faces.plan)
    areas = [float(sizes[own].sum()) for own in regions]
    found: list[Primitive] = []
    alike: dict[int, list[Primitive]] = {}
    for k in np.argsort(-np.array(areas), kind="stable").tolist():
        first = regions[k][0]
        region = _Region(
            faces.plan[regions[k]], float(faces.tops[first]), float(faces.undersides[first]),
            int(faces.surfaces[first]), areas[k], error,
        )  # fmt: skip
        same = alike.setdefault(int(kinds[first]), [])
        if any(one.holds(region.plan[0], region.near).all() for one in same) and any(
            one.holds(region.plan, region.near).all() for one in same
        ):
            continue
        new = list(region.primitives(space))
        same += new
        found += new
        if len(found) >= _MOST:
            break
    return found[:_MOST]


class _LevelFaces(NamedTuple):
    """Triangles with a level top, and a level underside or none.

    Attributes:
        plan: (n, 3, 2) corners seen from above.
        tops: (n,) heights of the tops.
        undersides: (n,) heights of the undersides; those of ground are at the base far below.
        surfaces: (n,) int32 index of the surface of each top.
    """

    plan: Floats
    tops: Floats
    undersides: Floats
    surfaces: NDArray[np.int32]

    def kinds(self) -> NDArray[np.int64]:
        """Return a number for each triangle, equal where surface, top and underside are, (n,)."""
        columns = np.column_stack([_ranks(self.tops), _ranks(self.undersides), self.surfaces])
        return np.unique(columns, axis=0, return_inverse=True)[1].reshape(-1)


def _level_faces(ground: Mesh, parts: StackParts | None) -> _LevelFaces:
    upper = ~ground.walls
    corners, worn = ground.vertices[ground.faces[upper]], ground.surfaces[upper]
    level = np.ptp(corners[:, :, 2], axis=1) <= _LEVEL
    corners, worn = corners[level], worn[level]
    plan, tops = corners[:, :, :2], corners[:, 0, 2]
    base = np.full(len(plan), _base(ground, parts))
    if parts is None:
        return _LevelFaces(plan, tops, base, worn)
    own = (np.ptp(parts.over[:, :, 2:], axis=1) <= _LEVEL).all(axis=1)
    decks = parts.over[own]
    return _LevelFaces(
        np.concatenate([plan, decks[:, :, :2]]),
        np.concatenate([tops, decks[:, 0, 2]]),
        np.concatenate([base, decks[:, 0, 3]]),
        np.concatenate([worn, parts.surfaces[own]]),
    )


def _base(ground: Mesh, parts: StackParts | None) -> float:
    """Return the height of a base far below all ground."""
    levels = ground.vertices[:, 2]
    if not len(levels):
        levels = np.zeros(1) if parts is None else parts.over[:, :, 2:]
    low, relief = float(levels.min()), float(np.ptp(levels))
    return low - max(_BELOW, _PART * relief)


def _ranks(values: Floats) -> Indices:
    """Return a number for each value, equal where values are hardly apart, (n,)."""
    order = np.argsort(values, kind="stable")
    ranks = np.empty(len(values), np.intp)
    ranks[order] = np.cumsum(np.diff(values[order], prepend=values[order[:1]]) > _LEVEL)
    return ranks


def _areas(plan: Floats) -> Floats:
    """Return areas of triangles, (n, 3, 2), seen from above, (n,)."""
    a, b = np.moveaxis(plan[:, 1:] - plan[:, :1], 1, 0)
    return np.asarray(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


def _sides(plan: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return the sides of triangles, (3 n, 2, 2), and a number for each, equal for equal ones."""
    points = np.ascontiguousarray(plan).reshape(-1, 2).view(np.complex128).ravel()
    names = np.unique(points, return_inverse=True)[1].reshape(-1, 3).astype(np.int64)
    sides = np.stack([plan, np.roll(plan, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    ends = np.stack([names, np.roll(names, -1, axis=1)], axis=2).reshape(-1, 2)
    return sides, ends.min(axis=1) << 32 | ends.max(axis=1)


def _outline(plan: Floats) -> Floats:
    """Return the sides that no two of some triangles share, (k, 2, 2)."""
    sides, names = _sides(plan)
    _, first, count = np.unique(names, return_index=True, return_counts=True)
    return sides[np.sort(first[count == 1])]


def _regions(plan: Floats, kinds: NDArray[np.int64]) -> list[Indices]:
    """Return the indices of triangles of one kind that share sides."""
    _, names = _sides(plan)
    owners = np.repeat(np.arange(len(plan)), 3)
    order = np.lexsort([kinds[owners], names])
    one, other = order[:-1], order[1:]
    joined = (names[one] == names[other]) & (kinds[owners[one]] == kinds[owners[other]])
    labels = components(np.column_stack([owners[one], owners[other]])[joined], len(plan))
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


@dataclass(frozen=True)
class _Space:
    """What is not solid: the air over the ground, gaps, and what is beyond the terrain.

    Attributes:
        plan: (n, 3, 2) triangles of air seen from above.
        floors: (n, 2) lowest and highest floor of each.
        ceilings: (n,) highest ceiling of each.
        surfaces: (n,) int32 index of the surface of each floor.
        rims: (k, 2, 2) sides where the air ends: beyond there is no ground.
    """

    plan: Floats
    floors: Floats
    ceilings: Floats
    surfaces: NDArray[np.int32]
    rims: Floats

    @classmethod
    def of(cls, ground: Mesh, parts: StackParts | None) -> _Space:
        """Return the space of a ground, or of a terrain with storeys."""
        if parts is None:
            upper = ~ground.walls
            air, surfaces = ground.vertices[ground.faces[upper]], ground.surfaces[upper]
            ceilings = np.full(len(air), np.inf)
            rims = _outline(air[:, :, :2])
        else:
            air, surfaces = parts.gaps[:, :, :3], parts.floors
            ceilings = parts.gaps[:, :, 3].max(axis=1)
            low, high = air[:, :, :2].min(axis=(0, 1)), air[:, :, :2].max(axis=(0, 1))
            ring = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
            rims = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
        floors = np.column_stack([air[:, :, 2].min(axis=1), air[:, :, 2].max(axis=1)])
        return cls(air[:, :, :2], floors, ceilings, surfaces, rims)

    @cached_property
    def tree(self) -> shapely.STRtree:
        """Spatial index of the triangles, and of the rims after these."""
        ends = np.concatenate([self.plan.min(axis=1), self.rims.min(axis=1)])
        others = np.concatenate([self.plan.max(axis=1), self.rims.max(axis=1)])
        return shapely.STRtree(shapely.box(*ends.T, *others.T))

    def blocking(self, region: _Region) -> tuple[Floats, Floats]:
        """Return triangles of air that a box for a region must not reach into, and rims near it."""
        near = np.sort(self.tree.query(shapely.box(*region.extent)))
        air, rims = near[near < len(self.plan)], near[near >= len(self.plan)] - len(self.plan)
        low, high = self.floors[air].T
        open_ = (low < region.top - region.near) & (self.ceilings[air] > region.under + region.near)
        level = (low >= region.top - region.near) & (high <= region.top + region.near)
        other = level & (self.surfaces[air] != region.surface)
        return self.plan[air[open_ | other]], self.rims[rims]


class _Lines(NamedTuple):
    """Lines along one axis, on which a rectangle may be cut.

    Attributes:
        at: (n,) place of each line across the axis.
        ends: (n, 2) where each begins and ends along the axis.
    """

    at: Floats
    ends: Floats


@dataclass(frozen=True)
class _Region:
    """Connected level ground of one surface, or a level deck.

    Attributes:
        plan: (n, 3, 2) triangles seen from above.
        top: height of the top.
        under: height of the underside.
        surface: index of the surface.
        area: area seen from above.
        error: error of the mesh.
    """

    plan: Floats
    top: float
    under: float
    surface: int
    area: float
    error: float

    @property
    def near(self) -> float:
        """Distance that counts as none."""
        return NEAR * self.error

    @cached_property
    def turn(self) -> float:
        """Angle of most of the outline, radians, -π/4 to π/4."""
        sides = _outline(self.plan)
        along = sides[:, 1] - sides[:, 0]
        lengths = np.linalg.norm(along, axis=1)
        quarter = 0.5 * np.pi
        angles = np.arctan2(along[:, 1], along[:, 0]) % quarter
        longest = angles[np.argmax(lengths)]
        # angles that differ by no more than what counts as none over their sides are one
        ranks = np.round((angles - longest + 0.5 * quarter) % quarter - 0.5 * quarter, 5)
        values, which = np.unique(ranks, return_inverse=True)
        best = values[np.argmax(np.bincount(which.reshape(-1), lengths))]
        longest = np.argmax(np.where(ranks == best, lengths, -1.0))
        turn = float((angles[longest] + 0.5 * quarter) % quarter - 0.5 * quarter)
        return turn if abs(turn) * float(np.ptp(self.plan)) > 1e-7 else 0.0

    @cached_property
    def axes(self) -> Floats:
        """Directions along and across `turn`, (2, 2), one a row."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return np.array([[cos, sin], [-sin, cos]])

    @cached_property
    def extent(self) -> tuple[float, ...]:
        """West, south, east, north of the smallest rectangle along `turn` around the region."""
        low, high = self._turned.min(axis=(0, 1)), self._turned.max(axis=(0, 1))
        ring = np.array([low, (high[0], low[1]), high, (low[0], high[1])]) @ self.axes
        return *ring.min(axis=0).tolist(), *ring.max(axis=0).tolist()

    @cached_property
    def _turned(self) -> Floats:
        return self.plan @ self.axes.T

    def primitives(self, space: _Space) -> Iterator[Primitive]:
        """Yield the cylinder, or the boxes, that stand for the region."""
        blocking, rims = space.blocking(self)
        air = np.concatenate([blocking, rims[:, [0, 1, 1]]])
        one = self._cylinder(air)
        if one is not None:
            yield one
            return
        level = _Triangles.of(self._turned)
        low, high = level.low.min(axis=0), level.high.max(axis=0)
        inner = _Triangles.of(air @ self.axes.T).within(low, high, self.near)
        if not len(inner.plan):
            if (high - low).min() >= self.error:
                yield self._primitive(0.5 * (low + high), 0.5 * (high - low), self._largest)
            return
        lines = _lines(np.concatenate([_outline(blocking), rims]) @ self.axes.T, self.near)
        found, covered = [], 0.0
        for low, high, near in _cut((low, high), inner, level, lines, self.error):
            areas, seen = self._seen(low, high, near)
            if areas > self.near * self.near:
                found.append(self._primitive(0.5 * (low + high), 0.5 * (high - low), seen))
                covered += areas
        # what is round has chords that a few boxes fit to
        if covered > _SHARE * self.area:
            yield from found

    def _primitive(self, middle: Floats, half: Floats, seen: Floats) -> Primitive:
        """Return the box of a rectangle, given along and across `turn`, with a place on its top."""
        (x, y), (a, b), (u, v) = (middle @ self.axes).tolist(), half.tolist(), seen.tolist()
        box = Primitive(self.surface, (x, y), (a, b), self.turn, self.top, self.under)
        return box._replace(seen=(u, v))

    @property
    def _largest(self) -> Floats:
        """Middle of the largest triangle."""
        return np.asarray(self.plan[np.argmax(_areas(self.plan))].mean(axis=0))

    def _cylinder(self, air: Floats) -> Primitive | None:
        """Return the cylinder that the region is the top of, if it is round and in no air."""
        if 3 * len(self.plan) < _CORNERS:
            return None
        hull = shapely.convex_hull(shapely.multipoints(self.plan.reshape(-1, 2)))
        ring = shapely.get_coordinates(hull)
        if len(ring) <= _CORNERS:
            return None
        away = ring[:-1] - ring[:-1].mean(axis=0)
        values = np.column_stack([2.0 * away, np.ones(len(away))])
        x, y, rest = np.linalg.lstsq(values, (away * away).sum(axis=1), rcond=None)[0].tolist()
        radius = math.sqrt(max(rest + x * x + y * y, 0.0))
        chord = float(np.linalg.norm(np.diff(ring, axis=0), axis=1).max())
        if chord >= 2.0 * radius or radius <= self.error:
            return None
        off = np.abs(np.linalg.norm(away - (x, y), axis=1) - radius).max()
        sagitta = radius - math.sqrt(radius * radius - 0.25 * chord * chord)
        if off > self.near or sagitta > SAGITTA * self.error:
            return None
        middle = ring[:-1].mean(axis=0) + (x, y)
        polygons = shapely.polygons(air) if len(air) else np.empty(0, object)
        if (shapely.distance(polygons, shapely.points(middle)) < radius - 2.0 * sagitta).any():
            return None
        (x, y), (u, v) = middle.tolist(), self._largest.tolist()
        return Primitive(
            self.surface, (x, y), (radius, radius), 0.0, self.top, self.under, True, (u, v)
        )

    def _seen(self, low: Floats, high: Floats, level: Floats) -> tuple[float, Floats]:
        """Return the area of triangles within a rectangle, and a place in the largest part."""
        parts = shapely.intersection(shapely.polygons(level), shapely.box(*low, *high))
        areas = shapely.area(parts)
        at = shapely.get_coordinates(shapely.point_on_surface(parts[np.argmax(areas)]))[0]
        return float(areas.sum()), np.asarray(at @ self.axes)


def _lines(outline: Floats, near: float) -> tuple[_Lines, _Lines]:
    """Return lines along y and along x through sides, (n, 2, 2), and around sides that slant."""
    wide = np.abs(outline[:, 1] - outline[:, 0])
    upright, level = (wide[:, k] <= near for k in (0, 1))
    slanting = outline[~(upright | level)]
    points = np.ascontiguousarray(slanting).reshape(-1, 2).view(np.complex128).ravel()
    names = np.unique(points.round(9), return_inverse=True)[1].reshape(-1, 2)
    labels = components(names, int(names.max(initial=-1)) + 1)[names[:, 0]]
    order = np.argsort(labels, kind="stable")
    begins = np.flatnonzero(np.diff(labels[order], prepend=-1))
    sorted_ = slanting[order]
    low = np.minimum.reduceat(sorted_.min(axis=1), begins) if len(begins) else np.empty((0, 2))
    high = np.maximum.reduceat(sorted_.max(axis=1), begins) if len(begins) else np.empty((0, 2))
    found = []
    for across, along, own in ((0, 1, upright), (1, 0, level)):
        straight, ends = outline[own], np.column_stack([low[:, along], high[:, along]])
        found.append(
            _Lines(
                np.concatenate([straight[:, :, across].mean(axis=1), low[:, across], high[:, across]]),
                np.concatenate([np.sort(straight[:, :, along], axis=1), ends, ends]),
            )
        )
    return found[0], found[1]


class _Triangles(NamedTuple):
    """Triangles seen from above.

    Attributes:
        plan: (n, 3, 2) corners.
        low: (n, 2) least x and y.
        high: (n, 2) largest x and y.
    """

    plan: Floats
    low: Floats
    high: Floats

    @classmethod
    def of(cls, plan: Floats) -> _Triangles:
        """Return triangles by their corners, (n, 3, 2)."""
        return cls(plan, plan.min(axis=1), plan.max(axis=1))

    def within(self, low: Floats, high: Floats, near: float) -> _Triangles:
        """Return those that reach into a rectangle along the axes by more than `near`."""
        low, high = low + near, high - near
        (west, south), (east, north) = self.low.T, self.high.T
        own = (east > low[0]) & (west < high[0]) & (north > low[1]) & (south < high[1])
        found = np.flatnonzero(own)
        # a side of a triangle may be between it and the rectangle
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        away = self.plan[found] - middle
        sides = away[:, [1, 2, 0]] - away
        normals = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
        along = normals @ away.transpose(0, 2, 1)
        reach = np.abs(normals) @ half
        out = (along.min(axis=2) > reach) | (along.max(axis=2) < -reach)
        found = found[~out.any(axis=1)]
        return _Triangles(self.plan[found], self.low[found], self.high[found])


def _cut(
    whole: tuple[Floats, Floats],
    air: _Triangles,
    level: _Triangles,
    lines: tuple[_Lines, _Lines],
    least: float,
) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Yield rectangles without air in them, cut from one along the outlines of the air.

    Args:
        whole: lower and upper ends of the rectangle to be cut.
        air: triangles of air.
        level: triangles that the rectangles are to hold.
        lines: lines along y and along x on which cuts may be made.
        least: least side length of a rectangle.

    Yields:
        Lower and upper ends of a rectangle, and the level triangles that reach into it.
    """
    near = NEAR * least
    stack = [(*whole, air, level)]
    while stack:
        low, high, air, level = stack.pop()
        if (high - low).min() < least:
            continue
        level = level.within(low, high, near)
        if not len(level.plan):
            continue
        air = air.within(low, high, near)
        if not len(air.plan):
            yield low, high, level.plan
            continue
        best: tuple[float, int, float] | None = None
        for across, some in enumerate(lines):
            found = _longest_line(some, low, high, across, near)
            if found is not None and (best is None or found[0] > best[0]):
                best = found[0], across, found[1]
        if best is not None:
            _, across, at = best
            lower, upper = high.copy(), low.copy()
            lower[across] = upper[across] = at
            stack += [(low, lower, air, level), (upper, high, air, level)]


def _longest_line(
    lines: _Lines, low: Floats, high: Floats, across: int, near: float
) -> tuple[float, float] | None:
    """Return the share of a rectangle's side that a line within it has outlines on, and its place.

    None where there is no line.
    """
    along = 1 - across
    begin = np.maximum(lines.ends[:, 0], low[along])
    lengths = np.minimum(lines.ends[:, 1], high[along]) - begin
    own = (lengths > near) & (lines.at > low[across] + near) & (lines.at < high[across] - near)
    if not own.any():
        return None
    at, lengths = lines.at[own], lengths[own]
    order = np.argsort(at, kind="stable")
    at, lengths = at[order], lengths[order]
    begins = np.flatnonzero(np.diff(at, prepend=-np.inf) > near)
    sums = np.add.reduceat(lengths, begins)
    best = int(np.argmax(sums))
    end = begins[best + 1] if best + 1 < len(begins) else len(at)
    place = begins[best] + int(np.argmax(lengths[begins[best] : end]))
    return float(sums[best] / (high[along] - low[along])), float(at[place])
