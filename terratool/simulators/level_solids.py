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
from terratool.simulators.collision.solids import base_below
from terratool.simulators.rectangles import NEAR, CutRectangle, PlanTriangles, cut, lines_of

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

MOST_SOLIDS = 2_000
"""Most boxes and cylinders: simulators take long to load more."""
_LEVEL = 1e-6
"""Largest difference of heights of level ground, units of the terrain."""
_CORNERS = 8
"""Least corners of a polygon that stands for a circle."""
_SHARE = 0.5
"""Least part of level ground that boxes stand for, or none do."""
SAGITTA = 1.05
"""Largest distance of a polygon's side from the circle that it stands for, in errors."""


class LevelSolid(NamedTuple):
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
    is_round: bool
    seen: tuple[float, float]

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


def level_solids_of(ground: Mesh, parts: StackParts | None, error: float) -> list[LevelSolid]:
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
    found: list[LevelSolid] = []
    alike: dict[int, list[LevelSolid]] = {}
    for k in np.argsort(-np.array(areas), kind="stable").tolist():
        first = regions[k][0]
        region = _Region(
            faces.plan[regions[k]], float(faces.tops[first]), float(faces.undersides[first]),
            int(faces.surfaces[first]), areas[k], error,
        )  # fmt: skip
        same = alike.setdefault(int(kinds[first]), [])
        # a larger one may go on under what parts the two
        ends = region.plan[0], region.plan
        if any(all(one.holds(some, region.near).all() for some in ends) for one in same):
            continue
        new = list(region.solids(space))
        same += new
        found += new
        if len(found) >= MOST_SOLIDS:
            break
    return found[:MOST_SOLIDS]


class _LevelFaces(NamedTuple):
    """PlanTriangles with a level top, and a level underside or none.

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
    """Return the level faces of a ground, and of what stands over gaps."""
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
    return base_below(float(levels.min()), float(levels.max()))


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
    return np.asarray(sides[np.sort(first[count == 1])])


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
    """The air over the ground, and gaps, in which nothing is solid.

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
            ring = PlanTriangles.of(air[:, :, :2]).extent.corners
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
        low, high = region.extent
        near = np.sort(self.tree.query(shapely.box(*low, *high)))
        air, rims = near[near < len(self.plan)], near[near >= len(self.plan)] - len(self.plan)
        low, high = self.floors[air].T
        open_ = (low < region.top - region.near) & (self.ceilings[air] > region.under + region.near)
        level = (low >= region.top - region.near) & (high <= region.top + region.near)
        other = level & (self.surfaces[air] != region.surface)
        return self.plan[air[open_ | other]], self.rims[rims]


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
    def level(self) -> PlanTriangles:
        """The triangles, along and across `turn`."""
        return PlanTriangles.of(self.plan @ self.axes.T)

    @cached_property
    def extent(self) -> CutRectangle:
        """The smallest rectangle along the axes around the smallest one along `turn`."""
        ring = self.level.extent.corners @ self.axes
        return CutRectangle(ring.min(axis=0), ring.max(axis=0))

    def solids(self, space: _Space) -> Iterator[LevelSolid]:
        """Yield the cylinder, or the boxes, that stand for the region."""
        blocking, rims = space.blocking(self)
        air = np.concatenate([blocking, rims[:, [0, 1, 1]]])
        one = self._cylinder(air)
        if one is not None:
            yield one
            return
        whole = self.level.extent
        lower = PlanTriangles.of(air @ self.axes.T).within(whole, self.near)
        if not len(lower.plan):
            if min(whole.half) >= 0.5 * self.error:
                yield self._box(whole, self._largest)
            return
        lines = lines_of(np.concatenate([_outline(blocking), rims]) @ self.axes.T, self.near)
        found, covered = [], 0.0
        for rectangle, level in cut(whole, self.level, lower, lines, self.error):
            area, seen = self._seen(rectangle, level)
            if area > self.near * self.near:
                found.append(self._box(rectangle, seen))
                covered += area
        # what is round has chords that a few boxes fit to
        if covered > _SHARE * self.area:
            yield from found

    def _box(self, rectangle: CutRectangle, seen: Floats) -> LevelSolid:
        """Return the box of a rectangle along `turn`, with a place on its top."""
        (x, y), (a, b) = (rectangle.middle @ self.axes).tolist(), rectangle.half.tolist()
        u, v = seen.tolist()
        return LevelSolid(
            self.surface, (x, y), (a, b), self.turn, self.top, self.under, False, (u, v)
        )

    @property
    def _largest(self) -> Floats:
        """Middle of the largest triangle, (2,)."""
        return np.asarray(self.plan[np.argmax(_areas(self.plan))].mean(axis=0))

    def _cylinder(self, air: Floats) -> LevelSolid | None:
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
        middle = ring[:-1].mean(axis=0) + np.array([x, y])
        polygons = shapely.polygons(air) if len(air) else np.empty(0, object)
        if (shapely.distance(polygons, shapely.points(middle)) < radius - 2.0 * sagitta).any():
            return None
        (x, y), (u, v) = middle.tolist(), self._largest.tolist()
        return LevelSolid(
            self.surface, (x, y), (radius, radius), 0.0, self.top, self.under, True, (u, v)
        )

    def _seen(self, rectangle: CutRectangle, level: Floats) -> tuple[float, Floats]:
        """Return the area of triangles in a rectangle, and a place in the largest part, (2,)."""
        box = shapely.box(*rectangle.low, *rectangle.high)
        parts = shapely.intersection(shapely.polygons(level), box)
        areas = shapely.area(parts)
        at = shapely.get_coordinates(shapely.point_on_surface(parts[np.argmax(areas)]))[0]
        return float(areas.sum()), np.asarray(at @ self.axes)
