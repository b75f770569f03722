"""Cover the ground of a mesh: plane ground, hills, height fields, and the rest at walls.

What stands over gaps is covered before, by solids alone.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.terrain import Terrain
from terratool.mesh.components import components
from terratool.mesh.stacked import StackParts
from terratool.mesh.triangulate import delaunay
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.report.numbers import metres
from terratool.report.wording import count_of
from terratool.simulators.collision.footing import rest_of
from terratool.simulators.collision.height_patch import Bools, Floats, HeightPatch, Indices, Ints
from terratool.simulators.collision.patches import CELLS, Surroundings, lay_patches, spread
from terratool.simulators.collision.solids import (
    OTHERS,
    SLIVER,
    VOID,
    Budget,
    GroundTriangles,
    Solid,
    Tolerance,
    areas_of,
    clip,
    cover,
    plane_solid,
    rectangles_under,
)

_VALLEY = 0.3
"""Sine of the turn of normals above which an edge is a valley, along which ground is parted."""
_CREASE = 0.9
"""Sine of the turn of normals above which an edge is a crease, which height fields leave out."""
_FLAT = 1e-5
"""Sine of the turn of normals below which two triangles are parallel."""
_LEVEL = 1e-7
"""Distance of a corner from a plane below which it lies in the plane, units of the terrain."""
_FACET = 0.03
"""Least sine of the turn of normals around a plane of fewer than three triangles."""
_PLAIN = 4.0
"""Least area of a plane slope that becomes solids first, in cells of a coarsest height field."""
_GROUP = 20_000
"""Most triangles of connected ground that becomes solids; more are left to height fields."""
_LEAN = 8
"""Least triangles per solid of ground that becomes solids; others are left to height fields."""
_FULL = 1e-9
"""Share by which the hull of a convex part may be larger than it."""
_SLIT = 2e-5
"""Least width of a convex part of the ground that counts, units of the terrain."""
_RECTANGLES, _MANY = 4, 500
"""Most rectangles that a level part becomes without a search for fewer, and triangles from which
any number will do."""
_SHARE = 0.5
"""Share of all solids and height fields that plane and hilly ground may take."""
_FIELDS = 1 / 3
"""Share of all solids and height fields that height fields may take."""
_RIM_OF_SEAM = 0.05
"""Largest reach of a solid over the void, in parts of a seam."""
_RIM_OF_SIDE = 1e-3
"""Largest reach of a solid over the void, in parts of the longer side."""
_SPOILT = 0.1
"""Error above which ground is spoilt, in parts of the relief: more solids are then allowed."""
_BORDER = 1e-8
"""Distance below which an edge is on the border of the terrain, in parts of its longer side."""
_HAIR = 1e-7
"""Width by which ground with solids is enlarged, so that rounding leaves no slits."""
_DEEP = -1e6
"""Height of the triangles of the void, units of the terrain; the sky is as high."""
_ALIKE = 6
"""Decimals of heights of corners over gaps that are one."""
_LATE = 0.5
"""Share of the time for the search that each further error may take when it is over."""
_LEAST = 0.1
"""Least share of the error that is left to solids, whatever the mesh takes of it."""
_SPARE = 1.25
"""Solids that ground at walls may take for each of its parts."""
_GROW = 2.0
"""Factor by which the error of solids grows while they are too many."""


class Collision(NamedTuple):
    """Solids and height fields that stand for the ground, and solids over gaps.

    Attributes:
        solids: convex solids.
        patches: height fields.
        height: largest distance of a solid's roof from the mesh, square to it.
        raised: whether `height` is more than was wanted, as the solids were too many.
        late: whether the time for the search was over, so that `height` may be more still.
    """

    solids: list[Solid]
    patches: list[HeightPatch]
    height: float
    raised: bool = False
    late: bool = False

    @property
    def worst(self) -> float:
        """Largest measured distance of a height field from the terrain, along z; 0 without any."""
        return max((patch.error for patch in self.patches), default=0.0)

    @property
    def raggedness(self) -> float:
        """Largest offset of lines between surfaces on height fields: a cell's side; 0 if none."""
        mixed = [patch for patch in self.patches if (patch.used & patch.mixed).any()]
        return max((max(patch.cell) for patch in mixed), default=0.0)

    @property
    def wall_width(self) -> float:
        """Largest width of slopes in place of walls on height fields: a cell's side; 0 if none."""
        upright = [one for one in self.patches if one.slopes and (one.used & one.near).any()]
        return max((max(patch.cell) for patch in upright), default=0.0)

    def share_over(self, error: float) -> float:
        """Return the percentage of the height fields' area that is off by more than an error."""
        over = whole = 0.0
        for patch in self.patches:
            cell = math.prod(patch.cell)
            whole += cell * np.count_nonzero(patch.used)
            over += cell * np.count_nonzero(patch.used & ~patch.near & (patch.misses > error))
        return 100.0 * over / whole


class CollisionRequest(NamedTuple):
    """Mesh whose ground is to be covered, and limits of what covers it.

    Attributes:
        terrain: terrain of the mesh.
        built: mesh; the error of solids is what its own leaves.
        max_error: largest distance of solids and height fields from the terrain.
        seam: largest reach of a solid into another surface of the same height.
        most: most solids and height fields.
        say: function that is called with a phrase at each step.
        parts: parts of a terrain with storeys, of which the mesh is the ground; None for others.
        holes: world rectangles that the mesh leaves out, as others cover them.
        seconds: time that the search for solids may take.
    """

    terrain: Terrain
    built: BuiltMesh
    max_error: float
    seam: float
    most: int
    say: Callable[[str], object] = lambda _: None
    parts: StackParts | None = None
    holes: Sequence[Bounds] = ()
    seconds: float = math.inf


def collision_of(request: CollisionRequest) -> Collision:
    """Cover the ground of a mesh by at most `most` solids and height fields.

    Plane ground and hills become solids. Height fields are laid over the rest, but for the ground
    at upper edges of walls, creases and the void, which becomes solids, too. If solids are too
    many, they may be farther from the ground. Where that spoils the ground, there are more.
    """
    terrain, built, max_error, seam, most, say, parts, _, seconds = request
    height = max(max_error - built.error, _LEAST * max_error)
    levels = built.mesh.vertices[:, 2]
    west, south, east, north = terrain.bounds
    longest = max(east - west, north - south)
    if parts is not None:
        levels = np.concatenate([levels, parts.over[:, :, 2:].ravel()])
    spoilt = max(_SPOILT * float(np.ptp(levels)), 2.0 * max_error)
    rim = min(_RIM_OF_SEAM * seam, _RIM_OF_SIDE * longest)
    limits = _Limits(
        height,
        spoilt,
        seam,
        rim,
        _PLAIN * (longest / CELLS) ** 2,
        say,
        seconds,
        time.monotonic() + seconds,
    )
    over: tuple[float, list[Solid]] = (height, [])
    if parts is not None and len(parts.over):
        over = _cover_over_gaps(parts, int(_SHARE * most), limits)
    if not len(built.mesh.faces):
        return Collision(over[1], [], over[0], over[0] > height)
    task = _task_of(request, limits)
    found = task.cover_ground(max(most - len(over[1]), 1))
    height = max(found.height, over[0])
    raised = height > limits.height
    solids = found.solids + over[1]
    return Collision(solids, found.patches, height, raised, raised and limits.is_late())


class _Limits(NamedTuple):
    """Limits of solids, units of the terrain.

    Attributes:
        height: largest distance of solids from what they stand for.
        spoilt: distance that spoils it, so that rather more solids are allowed.
        seam: largest reach of a solid into another surface of the same height.
        rim: largest reach of a solid over the void.
        area: least area of a plane slope that becomes solids before all that is curved.
        say: function that is called with a phrase at each step.
        seconds: time that the search for solids may take.
        until: time of the monotonic clock at which the search for better solids is given up.
    """

    height: float
    spoilt: float
    seam: float
    rim: float
    area: float
    say: Callable[[str], object]
    seconds: float = math.inf
    until: float = math.inf

    def is_late(self) -> bool:
        """Whether what takes long is given up."""
        return time.monotonic() > self.until


@dataclass(frozen=True)
class _Task:
    """The ground of a mesh, to be covered.

    Attributes:
        around: ground and edges for height fields.
        triangles: (n, 3, 3) float64 corners of the ground's triangles, those of the void left out.
        joints: edges between the triangles.
        groups: (n,) int32 labels of ground that is connected without valleys.
        ends: (k, 2, 2) float64 edges that no height field may cross, whatever that costs.
        extent: west, south, east, north of the ground.
        limits: limits of solids.
        patched: whether height fields may stand for some of it.
    """

    around: Surroundings
    triangles: Floats
    joints: _Joints
    groups: Ints
    ends: Floats
    extent: Bounds
    limits: _Limits
    patched: bool

    def cover_ground(self, most: int) -> Collision:
        """Cover the ground by at most `most` geoms, or more where that would spoil it."""
        ground, limits = self.around.ground, self.limits
        surfaces = ground.surfaces[: len(self.triangles)]
        planes = int(_SHARE * most) if self.patched else sys.maxsize
        cutting = _Cutting(ground, self.triangles, surfaces, planes, limits)
        done = cutting.done
        limits.say("finding plane ground")
        cutting.take_planes(self.joints)
        if self.patched and not done.all():
            limits.say("finding hills and ramps")
            cutting.take_hills(self.groups)
        if done.all():
            return Collision(cutting.solids, [], limits.height)
        if not self.patched:
            left = np.flatnonzero(~done)
            room = max(most - len(cutting.solids), 1)
            height, found = cutting.cover_rest(self.triangles[left], left, self.groups, room)
            return Collision(cutting.solids + found, [], height, height > limits.height)
        held = shapely.union_all(shapely.polygons(self.triangles[done][:, :, :2]))
        held = held.buffer(_HAIR, join_style="mitre")
        shapely.prepare(held)
        around = replace(self.around, held=held)
        # where there are too many parts at creases, height fields go on over creases
        if self._count_left_at(around.sharp, done) > (1.0 - _FIELDS) * most - len(cutting.solids):
            around = replace(around, sharp=self.ends)
        limits.say("laying height fields")
        laid = lay_patches(around, self.extent, int(_FIELDS * most), limits.spoilt)
        index, pieces = rest_of([one.footing for one in laid], ground)
        bare = (index < len(done)) & ~done[np.minimum(index, len(done) - 1)]
        index, pieces = index[bare], pieces[bare]
        room = (
            most - len(cutting.solids) - sum(len(one.footing.patch.used_surfaces) for one in laid)
        )
        height, found = cutting.cover_rest(pieces, index, self.groups, max(room, 1))
        solids = cutting.solids + found
        laid = spread(laid, most - len(solids))
        patches = [one.footing.patch for one in laid if one.footing.patch.used.any()]
        return Collision(solids, patches, height, height > limits.height)

    def _count_left_at(self, edges: Floats, done: Bools) -> int:
        """Return the number of parts of the ground without a solid that touch edges, (n, 2, 2)."""
        _, near = self.around.ground.tree.query(shapely.linestrings(edges), "intersects")
        near = near[near < len(done)]
        return len(np.unique(self.groups[near[~done[near]]]))


def _task_of(request: CollisionRequest, limits: _Limits) -> _Task:
    """Return the task of covering the mesh of a request."""
    terrain, mesh, max_error = request.terrain, request.built.mesh, request.max_error
    west, south, east, north = terrain.bounds
    extent = 0.0, 0.0, east - west, north - south
    faces = mesh.faces[~mesh.walls]
    triangles, surfaces = mesh.vertices[faces], mesh.surfaces[~mesh.walls]
    held = np.array(request.holes).reshape(-1, 4) - np.tile(mesh.origin[:2], 2)
    if request.parts is not None and len(held):  # whose mesh has no holes
        triangles, surfaces, faces = _outside(triangles, surfaces, held)
    joints = _joints(triangles, surfaces, faces)
    rims, walls = _rims(mesh, extent), _wall_ends(mesh)
    rims = rims[~_on_edges(rims, held, _BORDER * max(extent))]
    void = _void(terrain, mesh, rims, extent)
    others = _halves_of(held)
    ground = GroundTriangles(
        np.concatenate([triangles, void, others]),
        np.concatenate(
            [surfaces, np.full(len(void), VOID), np.full(len(others), OTHERS)], dtype=np.int32
        ),
        np.concatenate([joints.sharp, walls, rims]),
    )
    ends = np.concatenate([walls, rims])
    around = Surroundings(
        terrain, mesh.origin[:2], walls, ground.sharp, shapely.Polygon(), ground, max_error
    )
    groups = components(joints.pairs[joints.smooth], len(triangles))
    patched = not request.holes
    return _Task(around, triangles, joints, groups, ends, extent, limits, patched)


@dataclass
class _Cutting:
    """The ground, or what stands over gaps, while it is cut into solids.

    Attributes:
        ground: ground; its last triangles are those of the void. Or else the gaps.
        triangles: (n, 3, 3) triangles of the ground; over gaps (n, 3, 4) prisms.
        surfaces: (n,) int32 their surfaces.
        most: most solids of plane ground and hills.
        limits: limits of solids.
        solids: solids so far.
        done: (n,) bool, whether a triangle has its solid.
    """

    ground: GroundTriangles
    triangles: Floats
    surfaces: Ints
    most: int
    limits: _Limits
    solids: list[Solid] = field(default_factory=list)

    @cached_property
    def done(self) -> Bools:
        return np.zeros(len(self.triangles), np.bool_)

    def tolerance(self, height: float) -> Tolerance:
        """Return the tolerance of solids with roofs up to `height` from the ground."""
        return Tolerance(height, 0.5 * height, self.limits.seam, self.limits.rim)

    def _take(self, part: NDArray[np.intp], most: int) -> None:
        """Make a part of the ground solids, if it takes at most `most`."""
        most = min(most, self.most - len(self.solids))
        piece, surface = self.triangles[part], int(self.surfaces[part[0]])
        if most <= 0:
            return
        budget = Budget(most, float(areas_of(piece).sum()))
        tolerance = self.tolerance(self.limits.height)
        found = cover(self.ground, [piece], [surface], tolerance, budget)
        if not budget.is_spent:
            self.solids += found
            self.done[part] = True

    def take_planes(self, joints: _Joints) -> None:
        """Make level ground, and plane slopes that are large, solids, the largest first."""
        triangles, area = self.triangles, self.limits.area
        parts = _indices_by_label(components(joints.pairs[joints.plane], len(self.done)))
        bent = np.zeros(len(self.done), np.bool_)
        bent[joints.pairs[joints.bent]] = True
        each = areas_of(triangles)
        sizes = np.array([each[part].sum() for part in parts])
        level = (np.ptp(triangles[:, :, 2:], axis=1) == 0.0).all(axis=1)
        hulls = [_hull(triangles[part]) for part in parts]
        convex = np.array([hull.area for hull in hulls]) <= sizes * (1.0 + _FULL) + SLIVER
        for i in np.argsort(-sizes, kind="stable").tolist():
            part = parts[i]
            if level[part[0]]:
                plane = len(part) > 1 or sizes[i] >= area or convex[i]
            else:
                plane = sizes[i] >= area and (len(part) > 2 or not bent[part].any())
            if len(self.solids) >= self.most:
                return
            if plane and convex[i] and triangles.shape[2] == 3:
                self._take_convex(part, hulls[i])
            elif plane and not (level[part[0]] and self._take_rectangles(part)):
                self._take(part, self.most)

    def _take_convex(self, part: NDArray[np.intp], hull: Any) -> None:
        """Make a plane part of the ground that is convex a solid."""
        self.done[part] = True
        if not hull.area > SLIVER or hull.area <= 0.25 * _SLIT * hull.length:
            return
        self.solids.append(plane_solid(hull, self.triangles[part[0]], int(self.surfaces[part[0]])))

    def _take_rectangles(self, part: NDArray[np.intp]) -> bool:
        """Make a level part of the ground boxes if its edges lie along the axes; return whether."""
        if self.triangles.shape[2] > 3:
            return False
        own, surface = self.triangles[part], int(self.surfaces[part[0]])
        shape = shapely.coverage_union_all(shapely.polygons(own[:, :, :2]))
        boxes = rectangles_under(
            self.ground, shape, float(own[0, 0, 2]), surface, self.limits.height
        )
        if not boxes or (len(boxes) > _RECTANGLES and len(part) < _MANY):
            return False  # a search may find fewer
        self.solids += [plane_solid(box, own[0], surface) for box in boxes]
        self.done[part] = True
        return True

    def take_hills(self, groups: Ints) -> None:
        """Make connected ground solids, where these are few."""
        for part in _indices_by_label(groups):
            if self.limits.is_late():
                return
            if len(part) <= _GROUP and not self.done[part].all():
                self._take(part, 1 + len(part) // _LEAN)

    def cover_all(
        self, pieces: Floats, labels: Ints, surfaces: Ints, height: float, budget: Budget
    ) -> list[Solid]:
        """Return solids for triangles by label and surface; incomplete once the budget is spent."""
        parts = _indices_by_label(labels)
        worn = [int(surfaces[part[0]]) for part in parts]
        tolerance = self.tolerance(height)
        return cover(self.ground, [pieces[part] for part in parts], worn, tolerance, budget)

    def cover_rest(
        self, pieces: Floats, index: Indices, groups: Ints, room: int
    ) -> tuple[float, list[Solid]]:
        """Cover parts of triangles; return the largest distance of solids from them, and solids.

        Where solids are too many the error grows; where that spoils the ground, more are allowed.

        Args:
            pieces: (m, 3, k) parts of triangles.
            index: (m,) triangle of each part.
            groups: (n,) labels of connected triangles.
            room: most solids.
        """
        limits = self.limits
        labels, surfaces = groups[index], self.surfaces[index]
        area, fewest = float(areas_of(pieces).sum()), len(np.unique(labels))
        height = limits.height
        if fewest > room:
            limits.say(f"covering {count_of(fewest, 'part')} of the ground at walls")
        room = max(room, math.ceil(_SPARE * fewest))
        while True:
            budget = Budget(room, area, until=limits.until)
            found = self.cover_all(pieces, labels, surfaces, height, budget)
            if not budget.is_spent:
                return height, found
            if limits.is_late():
                height = min(_GROW * height, limits.spoilt)
                # the error that spoils it takes the fewest, whatever time that takes
                late = time.monotonic() + _LATE * limits.seconds
                limits = limits._replace(until=late if height < limits.spoilt else math.inf)
            elif height >= limits.spoilt:
                room = 2 * room
            else:
                height = min(_GROW * height, limits.spoilt)
            limits.say(f"covering what is near walls within {metres(height)}")


def _hull(triangles: Floats) -> Any:
    """Return the convex hull of triangles seen from above."""
    corners = triangles[:, :, :2].reshape(-1, 2)
    return shapely.convex_hull(shapely.linestrings(np.concatenate([corners, corners[:1]])))


def _cover_over_gaps(parts: StackParts, most: int, limits: _Limits) -> tuple[float, list[Solid]]:
    """Cover what stands over gaps by about `most` solids; return their distance from it, and them.

    A solid may lie within other solid ground, but not in a gap.
    """
    limits.say("covering what stands over gaps")
    cutting, joints = _over_gaps(parts, most, limits)
    cutting.take_planes(joints)
    groups = components(joints.pairs[joints.smooth], len(parts.over))
    cutting.take_hills(groups)
    left = np.flatnonzero(~cutting.done)
    if not len(left):
        return limits.height, cutting.solids
    room = max(most - len(cutting.solids), 1)
    height, found = cutting.cover_rest(parts.over[left], left, groups, room)
    return height, cutting.solids + found


def _over_gaps(parts: StackParts, most: int, limits: _Limits) -> tuple[_Cutting, _Joints]:
    """Return what stands over gaps, to be cut into solids, and edges between its prisms."""
    over, surfaces = parts.over, parts.surfaces
    corners = over.reshape(-1, 4).copy()
    corners[:, 2:] = corners[:, 2:].round(_ALIKE)
    faces = np.unique(corners, axis=0, return_inverse=True)[1].reshape(-1, 3).astype(np.int32)
    tops = _joints(over[:, :, :3], surfaces, faces)
    undersides = _joints(over[:, :, [0, 1, 3]] * (1.0, 1.0, -1.0), surfaces, faces)
    joints = _Joints(
        tops.pairs,
        tops.plane & undersides.plane,
        tops.smooth & undersides.smooth,
        tops.bent | undersides.bent,
        np.concatenate([tops.sharp, undersides.sharp]),
    )
    void = np.isneginf(parts.gaps[:, 0, 2])
    gaps = GroundTriangles(
        parts.gaps.clip(_DEEP, -_DEEP), np.where(void, VOID, parts.floors), joints.sharp
    )
    return _Cutting(gaps, over, surfaces, most, limits), joints


class _Joints(NamedTuple):
    """Edges between two triangles, and their kinds.

    Attributes:
        pairs: (n, 2) int64 indices of the two triangles of each edge.
        plane: (n,) bool, whether both have one surface and lie in one plane.
        smooth: (n,) bool, whether both have one surface and no valley between them.
        bent: (n,) bool, whether both have one surface and their normals turn a little.
        sharp: (k, 2, 2) float64 ends of creases, between any surfaces.
    """

    pairs: NDArray[np.int64]
    plane: Bools
    smooth: Bools
    bent: Bools
    sharp: Floats


def _joints(triangles: Floats, surfaces: Ints, faces: Ints) -> _Joints:
    """Return the joints of triangles, (n, 3, 3), by the vertices of their faces, (n, 3)."""
    _, key = _edges(faces)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[same], order[same + 1]
    first, second = one % len(faces), other % len(faces)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    turn = np.linalg.norm(np.cross(normals[first], normals[second]), axis=1)
    # distance of the second triangle's free corner over the plane of the first one
    tip = triangles[second, (other // len(faces) + 2) % 3]
    over = ((tip - triangles[first, 0]) * normals[first]).sum(axis=1)
    alike = surfaces[first] == surfaces[second]
    ends = np.stack(
        [triangles[first, one // len(faces)], triangles[first, (one // len(faces) + 1) % 3]], axis=1
    )
    return _Joints(
        np.column_stack([first, second]),
        alike & (np.abs(over) < _LEVEL) & (turn < _FLAT),
        alike & ~((over > 0) & (turn > _VALLEY)),
        alike & (turn > _FLAT) & (turn < _FACET),
        ends[turn > _CREASE][:, :, :2],
    )


def _edges(faces: Ints) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the edges of faces, (3 n, 2), first those from corner 0 to 1, and keys, (3 n,).

    Edges between two vertices have one key, whichever way they go.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    return edges, edges.min(axis=1) << 32 | edges.max(axis=1)


def _indices_by_label(labels: Ints) -> list[NDArray[np.intp]]:
    """Return the indices of each label that is not negative, in the order of the labels."""
    order = np.argsort(labels, kind="stable")
    order = order[np.count_nonzero(labels < 0) :]
    begins = np.flatnonzero(np.diff(labels[order])) + 1
    return [part for part in np.split(order, begins) if len(part)]


def _wall_ends(mesh: Mesh) -> Floats:
    """Return the ends of walls' faces seen from above, (n, 2, 2)."""
    corners = mesh.vertices[mesh.faces[mesh.walls]][:, :, :2]
    longest = np.argmax([((corners[:, k] - corners[:, k - 1]) ** 2).sum(1) for k in range(3)], 0)
    at = np.arange(len(corners))
    return np.stack([corners[at, longest], corners[at, longest - 1]], axis=1)


def _halves_of(rectangles: Floats) -> Floats:
    """Return the triangles of rectangles, (2 n, 3, 3), far below."""
    corners = rectangles[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]
    flat = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), _DEEP)], axis=2)


def _outside(triangles: Floats, surfaces: Ints, rectangles: Floats) -> tuple[Floats, Ints, Ints]:
    """Return triangles without what is in rectangles, their surfaces, and indices of corners."""
    left = np.concatenate([triangles, np.repeat(surfaces[:, None, None], 3, axis=1)], axis=2)
    for west, south, east, north in rectangles.tolist():
        low, high = left[:, :, :2].min(axis=1), left[:, :, :2].max(axis=1)
        near = ((low < (east, north)) & (high > (west, south))).all(axis=1)
        within, kept = left[near], [left[~near]]
        for axis, at, sign in ((0, west, 1.0), (0, east, -1.0), (1, south, 1.0), (1, north, -1.0)):
            within, beyond = clip(within, sign * (within[:, :, axis] - at), _BORDER)
            kept.append(beyond)
        left = np.concatenate(kept)
    left = left[areas_of(left) > SLIVER]
    corners = left[:, :, :3].reshape(-1, 3).round(_ALIKE)
    faces = np.unique(corners, axis=0, return_inverse=True)[1].reshape(-1, 3).astype(np.int32)
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return left[whole, :, :3], left[whole, 0, 3].round().astype(np.int32), faces[whole]


def _on_edges(ends: Floats, rectangles: Floats, near: float) -> Bools:
    """Whether edges, (n, 2, 2), lie on an edge of a rectangle, (n,)."""
    found = np.zeros(len(ends), np.bool_)
    middles = shapely.points(ends.mean(axis=1))
    for sides in (shapely.boundary(shapely.box(*rectangles.T)),) if len(rectangles) else ():
        index, _ = shapely.STRtree(sides).query(middles, predicate="dwithin", distance=near)
        found[index] = True
    return found


def _rims(mesh: Mesh, extent: Bounds) -> Floats:
    """Return the edges where the ground ends, (n, 2, 2), but for the border of the terrain."""
    edges, key = _edges(mesh.faces)
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    ends = mesh.vertices[edges[first[count == 1]]][:, :, :2]
    west, south, east, north = extent
    x, y = ends[:, :, 0], ends[:, :, 1]
    near = _BORDER * max(east - west, north - south)
    on = np.zeros(len(ends), bool)
    for along, side in ((x, west), (x, east), (y, south), (y, north)):
        on |= (np.abs(along - side) < near).all(axis=1)
    return np.asarray(ends[~on])


def _void(terrain: Terrain, mesh: Mesh, rims: Floats, extent: Bounds) -> Floats:
    """Return triangles far below where there is no ground, (n, 3, 3)."""
    if not len(rims):
        return np.empty((0, 3, 3))
    lines = [*shapely.linestrings(rims), shapely.box(*extent).exterior]
    found = []
    for face in shapely.get_parts(shapely.polygonize([shapely.union_all(lines)])):
        x, y = shapely.get_coordinates(shapely.point_on_surface(face))[0] + mesh.origin[:2]
        if not math.isnan(terrain.ground(x, y)):
            continue
        corners: list[Floats] = []
        edges: list[NDArray[np.int64]] = []
        for ring in shapely.get_rings(face):
            points = shapely.get_coordinates(ring)[:-1]
            index = np.arange(len(points)) + sum(len(one) for one in corners)
            corners.append(points)
            edges.append(np.column_stack([index, np.roll(index, -1)]))
        points, triangles, _ = delaunay(
            np.concatenate(corners), np.concatenate(edges).astype(np.int32), within=True
        )
        found.append(np.asarray(points, np.float64)[triangles])
    flat = np.concatenate([*found, np.empty((0, 3, 2))])
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), _DEEP)], axis=2)
