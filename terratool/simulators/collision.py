"""Ground as few convex solids and height fields, for simulators that collide only with such."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.mesh.triangulate import delaunay
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.simulators.prisms import VOID, Floats, Ground, Ints, Solid, cover
from terratool.text.display import length

Bools = NDArray[np.bool_]

_VALLEY = 0.3
"""Ground is parted along valleys where its normal turns by more than this, a sine …"""
_CREASE = 0.9
"""… and a height field leaves out cells with such a crease."""
_FACET = 0.03
"""A plane has fewer than three triangles only where the normals around it are turned so much."""
_CELLS = 96
"""Cells of a height field along its longer side."""
_SAMPLES = 4
"""Each cell is held against the terrain at so many points a side."""
_MARGIN = 0.3
"""Cells are left out that are nearer than this part of their side to a wall."""
_NODES = 4_000_000
"""So many nodes all height fields have together, about."""
_PLAIN = 4.0
"""Plane ground of more than so many cells of the coarsest height field is one solid."""
_GROUP = 20_000
"""Ground that hangs together of more triangles is for height fields …"""
_LEAN = 8
"""… and so is that where a solid stands for fewer of them than this."""
_SEAM = 0.02
"""How far a solid may reach into another surface of the same height, in units of the terrain."""
_SINK = 8.0
"""What a height field leaves out lies so many reliefs below, so that its sides are steep."""
_BORDER = 1e-8
"""What is nearer to the border of the terrain than this part of its side is on it."""
_FEWEST = 4
"""Beside the void, fewer rows of cells are no height field."""
_DEEP = -1e6
"""The height of what is no ground."""
_LEAST = 0.1
"""Solids may take no less of the error than this part."""
_GROW = 1.5
"""By this factor the error grows where there are too many solids."""


@dataclass(frozen=True)
class HeightPatch:
    """A height field: heights at evenly spaced nodes, where it has any ground.

    Attributes:
        bounds: west, south, east, north of its nodes.
        heights: (n, m) float64, rows from the south.
        used: (n - 1, m - 1) bool, the cells that it stands for.
        surfaces: (n - 1, m - 1) int32 of these, -1 for none.
        misses: (n - 1, m - 1) how far they are from the terrain, as measured.
    """

    bounds: tuple[float, float, float, float]
    heights: Floats
    used: Bools
    surfaces: Ints
    misses: Floats

    @property
    def error(self) -> float:
        """How far any used cell is from the terrain, as measured."""
        return float(self.misses[self.used].max(initial=0.0))

    @property
    def worn(self) -> list[int]:
        """The surfaces of used cells."""
        worn: list[int] = np.unique(self.surfaces[self.used]).tolist()
        return worn

    def cropped(self, bottom: int, top: int, left: int, right: int) -> HeightPatch:
        """The rows from `bottom` to before `top`, and columns likewise."""
        west, south, east, north = self.bounds
        n, m = self.used.shape
        dx, dy = (east - west) / m, (north - south) / n
        rows, columns = slice(bottom, top), slice(left, right)
        return HeightPatch(
            (west + left * dx, south + bottom * dy, west + right * dx, south + top * dy),
            self.heights[bottom : top + 1, left : right + 1],
            self.used[rows, columns],
            self.surfaces[rows, columns],
            self.misses[rows, columns],
        )


class Collision(NamedTuple):
    """What stands for the ground.

    Attributes:
        solids: convex.
        patches: height fields.
        height: how far a roof of a solid may be from the mesh, square to it.
    """

    solids: list[Solid]
    patches: list[HeightPatch]
    height: float

    @property
    def worst(self) -> float:
        """How far any height field is from the terrain, along z, as measured."""
        return max((patch.error for patch in self.patches), default=0.0)

    def share_over(self, error: float) -> float:
        """On how much of them they are by more than so much, in percent of their area."""
        over = whole = 0.0
        for patch in self.patches:
            west, south, east, north = patch.bounds
            cell = (east - west) * (north - south) / patch.used.size
            whole += cell * np.count_nonzero(patch.used)
            over += cell * np.count_nonzero(patch.used & (patch.misses > error))
        return 100.0 * over / whole


class _Sharp(NamedTuple):
    """Where a height field cannot follow: (n, 2, 2) ends of walls, rims of the ground, creases."""

    ends: Floats


def collision_of(
    terrain: Terrain,
    built: BuiltMesh,
    max_error: float,
    most: int,
    say: Callable[[str], object] = lambda _: None,
) -> Collision:
    """Cover the ground of a mesh by at most so many solids and height fields, about.

    Args:
        terrain: the terrain.
        built: its mesh; solids may take what its error leaves.
        max_error: how far they may be from the terrain, along z.
        most: so many.
        say: is called with words that say how far it is.
    """
    mesh, rest_error = built.mesh, max(max_error - built.error, _LEAST * max_error)
    upright = mesh.walls
    faces = mesh.faces[~upright]
    triangles, surfaces = mesh.vertices[faces], mesh.surfaces[~upright]
    joints = _joints(triangles, surfaces, faces)
    west, south, east, north = terrain.bounds
    extent = 0.0, 0.0, east - west, north - south
    rims = _rims(mesh, extent)
    sharp = np.concatenate([joints.sharp, _wall_ends(mesh), rims])
    void = _void(terrain, mesh, rims, extent)
    ground = Ground(
        np.concatenate([triangles, void]),
        np.append(surfaces, np.full(len(void), VOID, np.int32)),
        sharp,
    )
    coarsest = max(extent) / _CELLS

    say("finding plane ground")
    planes = _parts(_components(joints.pairs[joints.plane], len(faces)))
    soft = np.zeros(len(faces), bool)
    soft[joints.pairs[joints.soft]] = True
    area = _areas(triangles)
    sizes = np.array([area[part].sum() for part in planes])
    tilted = triangles[:, :, 2].max(axis=1) > triangles[:, :, 2].min(axis=1)
    solids: list[Solid] = []
    done = np.zeros(len(faces), bool)
    for i in np.argsort(-sizes, kind="stable").tolist():
        part = planes[i]
        if tilted[part[0]] and len(part) < 3 and soft[part].any():
            continue
        if sizes[i] < _PLAIN * coarsest**2 and (len(part) < 2 or tilted[part[0]]):
            continue
        found = cover(ground, part, rest_error, _SEAM, max(most // 2 - len(solids), 0))
        if found is None:
            continue
        solids += found
        done[part] = True
    say("finding hills and ramps")
    for part in _parts(_components(joints.pairs[joints.smooth], len(faces))):
        room = most // 2 - len(solids)
        if done[part].all() or len(part) > _GROUP:
            continue
        found = cover(ground, part, rest_error, _SEAM, min(1 + len(part) // _LEAN, room))
        if found is not None:
            solids += found
            done[part] = True
    patches: list[HeightPatch] = []
    if not done.all():
        say("laying height fields")
        held = shapely.union_all(shapely.polygons(triangles[done][:, :, :2]))
        held = held.buffer(1e-7, join_style="mitre")
        patches = _patches(terrain, mesh, extent, sharp, held, max_error, most)
        # what no cell of a height field holds
        rest = _beside(triangles, patches, done, held)
        height = rest_error
        room = most - len(solids) - sum(len(patch.worn) for patch in patches)
        smooth = _components(joints.pairs[joints.smooth], len(faces))
        while (more := _edges(ground, np.where(rest, smooth, -1), height, room)) is None:
            height *= _GROW
            say(f"covering edges by solids within {length(height)}")
        return Collision(solids + more, patches, height)
    return Collision(solids, patches, rest_error)


def _edges(
    ground: Ground, labels: NDArray[np.int64], height: float, most: int
) -> list[Solid] | None:
    """Solids for the triangles of each label that is not negative; None if there are more."""
    found: list[Solid] = []
    for part in _parts(labels):
        more = cover(ground, part, height, _SEAM, most - len(found))
        if more is None:
            return None
        found += more
    return found


class _Joints(NamedTuple):
    """Edges between two triangles of one surface, and what they are.

    Attributes:
        pairs: (n, 2) the two triangles.
        plane: (n,) bool, whether they lie in one plane.
        smooth: (n,) bool, whether there is no valley.
        sharp: (k, 2, 2) ends of those with a crease, of any surface.
    """

    pairs: NDArray[np.int64]
    plane: Bools
    smooth: Bools
    soft: Bools
    sharp: Floats


def _joints(triangles: Floats, surfaces: Ints, faces: Ints) -> _Joints:
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    key = edges.min(axis=1) << 32 | edges.max(axis=1)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[same], order[same + 1]
    first, second = one % len(faces), other % len(faces)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    turn = np.linalg.norm(np.cross(normals[first], normals[second]), axis=1)
    # the corner of the second that is not on the edge, over the plane of the first
    tip = triangles[second, (other // len(faces) + 2) % 3]
    over = ((tip - triangles[first, 0]) * normals[first]).sum(axis=1)
    alike = surfaces[first] == surfaces[second]
    ends = np.stack(
        [triangles[first, one // len(faces)], triangles[first, (one // len(faces) + 1) % 3]], axis=1
    )
    return _Joints(
        np.column_stack([first, second]),
        alike & (np.abs(over) < 1e-7) & (turn < 1e-5),
        alike & ~((over > 0) & (turn > _VALLEY)),
        alike & (turn > 1e-5) & (turn < _FACET),
        ends[turn > _CREASE][:, :, :2],
    )


def _components(pairs: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """For each of so many things the least of those that it hangs together with."""
    roots = np.arange(count)
    first, second = pairs.T
    while True:
        before = roots.copy()
        low = np.minimum(roots[first], roots[second])
        for end in (roots[first], roots[second], first, second):
            np.minimum.at(roots, end, low)
        roots = roots[roots]
        if np.array_equal(before, roots):
            return roots


def _parts(labels: NDArray[np.int64]) -> list[NDArray[np.intp]]:
    """The indices of each label that is not negative, in the order of their first."""
    order = np.argsort(labels, kind="stable")
    order = order[np.count_nonzero(labels < 0) :]
    begins = np.flatnonzero(np.diff(labels[order])) + 1
    return [part for part in np.split(order, begins) if len(part)]


def _areas(triangles: Floats) -> Floats:
    a, b = np.moveaxis(triangles[:, 1:, :2] - triangles[:, :1, :2], 1, 0)
    return np.asarray(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


def _wall_ends(mesh: Mesh) -> Floats:
    """(n, 2, 2) where the faces of walls stand."""
    corners = mesh.vertices[mesh.faces[mesh.walls]][:, :, :2]
    longest = np.argmax([((corners[:, k] - corners[:, k - 1]) ** 2).sum(1) for k in range(3)], 0)
    at = np.arange(len(corners))
    return np.stack([corners[at, longest], corners[at, longest - 1]], axis=1)


def _rims(mesh: Mesh, extent: tuple[float, float, float, float]) -> Floats:
    """(n, 2, 2) edges where the ground ends, but for the rim of the terrain."""
    faces = mesh.faces.astype(np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    key = edges.min(axis=1) << 32 | edges.max(axis=1)
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    ends = mesh.vertices[edges[first[count == 1]]][:, :, :2]
    west, south, east, north = extent
    x, y = ends[:, :, 0], ends[:, :, 1]
    near = _BORDER * max(east - west, north - south)
    on = np.zeros(len(ends), bool)
    for along, side in ((x, west), (x, east), (y, south), (y, north)):
        on |= (np.abs(along - side) < near).all(axis=1)
    return np.asarray(ends[~on])


def _void(
    terrain: Terrain, mesh: Mesh, rims: Floats, extent: tuple[float, float, float, float]
) -> Floats:
    """Triangles far below where there is no ground, (n, 3, 3)."""
    if not len(rims):
        return np.empty((0, 3, 3))
    lines = [*shapely.linestrings(rims), shapely.box(*extent).exterior]
    found = []
    for face in shapely.get_parts(shapely.polygonize([shapely.union_all(lines)])):
        x, y = shapely.get_coordinates(shapely.point_on_surface(face))[0] + mesh.origin[:2]
        if not math.isnan(terrain.height(x, y)):
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


# --- height fields -------------------------------------------------------------------------------


def _patches(
    terrain: Terrain,
    mesh: Mesh,
    extent: tuple[float, float, float, float],
    sharp: Floats,
    held: shapely.Geometry,
    max_error: float,
    most: int,
) -> list[HeightPatch]:
    """Height fields, split in four where they are worst, until they are good or too many."""
    shapely.prepare(held)
    queue: list[tuple[float, int, HeightPatch]] = []
    number = 0
    nodes = 0

    def add(bounds: tuple[float, float, float, float]) -> None:
        nonlocal number, nodes
        patch = _patch(terrain, mesh, bounds, sharp, held)
        for part in _without_void(patch):
            number += 1
            nodes += part.heights.size
            heapq.heappush(queue, (-part.error, number, part))

    add(extent)
    while queue and -queue[0][0] > max_error:
        if len(queue) > most // 3 or nodes > _NODES:
            break
        _, _, worst = heapq.heappop(queue)
        nodes -= worst.heights.size
        west, south, east, north = worst.bounds
        x, y = 0.5 * (west + east), 0.5 * (south + north)
        for part in (
            (west, south, x, y),
            (x, south, east, y),
            (west, y, x, north),
            (x, y, east, north),
        ):
            add(part)
    return [patch for _, _, patch in sorted(queue, key=lambda one: one[1])]


def _patch(
    terrain: Terrain,
    mesh: Mesh,
    bounds: tuple[float, float, float, float],
    sharp: Floats,
    held: shapely.Geometry,
) -> HeightPatch:
    west, south, east, north = bounds
    longer = max(east - west, north - south)
    columns = max(4, round(_CELLS * (east - west) / longer))
    rows = max(4, round(_CELLS * (north - south) / longer))
    k = _SAMPLES
    # at the nodes, and between them
    x = west + (east - west) * np.arange(columns * k + 1) / (columns * k)
    y = south + (north - south) * np.arange(rows * k + 1) / (rows * k)
    x[-1], y[-1] = east, north
    ox, oy = mesh.origin[:2]
    z = terrain.height(x[None, :] + ox, y[:, None] + oy)
    nodes = z[::k, ::k]
    # two triangles a cell, parted from the south-west to the north-east
    s = np.arange(k + 1) / k
    u, v = s[None, :], s[:, None]
    a, b = nodes[:-1, :-1, None, None], nodes[:-1, 1:, None, None]
    c, d = nodes[1:, :-1, None, None], nodes[1:, 1:, None, None]
    lower = a + u * (b - a) + v * (d - b)
    upper = a + v * (c - a) + u * (d - c)
    level = np.where(v <= u, lower, upper)
    index = np.arange(k + 1)
    fine = z[
        (np.arange(rows) * k)[:, None, None, None] + index[None, None, :, None],
        (np.arange(columns) * k)[None, :, None, None] + index[None, None, None, :],
    ]
    with np.errstate(invalid="ignore"):
        miss = np.abs(fine - level).max(axis=(2, 3))
    used = np.isfinite(miss)
    cell = (east - west) / columns, (north - south) / rows
    used &= ~_near(sharp, bounds, rows, columns, cell)
    middles = np.stack(
        np.meshgrid(x[k // 2 :: k][:columns], y[k // 2 :: k][:rows]), axis=-1
    ).reshape(-1, 2)
    boxes = shapely.box(
        middles[:, 0] - 0.5 * cell[0],
        middles[:, 1] - 0.5 * cell[1],
        middles[:, 0] + 0.5 * cell[0],
        middles[:, 1] + 0.5 * cell[1],
    )
    used &= ~shapely.covers(held, boxes).reshape(rows, columns)
    surfaces = terrain.sample(middles[:, 0] + ox, middles[:, 1] + oy).surface.reshape(rows, columns)
    return HeightPatch(bounds, nodes, used, surfaces, miss)


def _without_void(patch: HeightPatch) -> Iterator[HeightPatch]:
    """Parts of a patch that have no cell without ground, as a height field has no holes."""
    void = np.isnan(patch.heights)
    void = void[:-1, :-1] | void[:-1, 1:] | void[1:, :-1] | void[1:, 1:]
    rows, columns = np.flatnonzero(void.any(axis=1)), np.flatnonzero(void.any(axis=0))
    if not patch.used.any():
        return
    if not len(rows):
        yield patch
        return
    n, m = void.shape
    bottom, top, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    around = [(0, bottom, 0, m), (top, n, 0, m), (bottom, top, 0, left), (bottom, top, right, m)]
    for a, b, c, d in around:
        if a < b and c < d:
            yield from _without_void(patch.cropped(a, b, c, d))
    middle = patch.cropped(bottom, top, left, right)
    if min(middle.used.shape) < _FEWEST or void[bottom:top, left:right].all():
        return
    n, m = middle.used.shape
    if n > m:
        halves = (0, n // 2, 0, m), (n // 2, n, 0, m)
    else:
        halves = (0, n, 0, m // 2), (0, n, m // 2, m)
    for half in halves:
        yield from _without_void(middle.cropped(*half))


def _near(
    sharp: Floats,
    bounds: tuple[float, float, float, float],
    rows: int,
    columns: int,
    cell: tuple[float, float],
) -> Bools:
    """(rows, columns) whether a cell is near to what a height field cannot follow."""
    out = np.zeros((rows, columns), bool)
    west, south, east, north = bounds
    low, high = sharp.min(axis=1), sharp.max(axis=1)
    margin = _MARGIN * np.array(cell)
    far, near = np.array([east, north]) + margin, np.array([west, south]) - margin
    here = ((low < far) & (high > near)).all(axis=1)
    ends = sharp[here]
    steps = np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / (0.25 * min(cell)))
    steps = np.maximum(steps.astype(np.int64), 1) + 1
    which = np.repeat(np.arange(len(ends)), steps)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)) / np.maximum(
        np.repeat(steps, steps) - 1, 1
    )
    points = ends[which, 0] + share[:, None] * (ends[which, 1] - ends[which, 0])
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            at = np.floor((points + margin * [dx, dy] - [west, south]) / cell).astype(np.int64)
            inside = ((at >= 0) & (at < [columns, rows])).all(axis=1)
            out[at[inside, 1], at[inside, 0]] = True
    return out


def _beside(
    triangles: Floats, patches: list[HeightPatch], done: Bools, solid: shapely.Geometry
) -> Bools:
    """Which triangles some part of is held by no cell of a height field and by no solid."""
    rest = np.zeros(len(done), bool)
    held = [np.array([solid])]
    for patch in patches:
        west, south, east, north = patch.bounds
        rows, columns = patch.used.shape
        i, j = np.nonzero(patch.used)
        dx, dy = (east - west) / columns, (north - south) / rows
        # runs of cells along x
        begin = np.flatnonzero(np.append(True, (np.diff(i) != 0) | (np.diff(j) != 1)))
        end = np.append(begin[1:], len(i)) - 1
        held.append(
            shapely.box(
                west + j[begin] * dx,
                south + i[begin] * dy,
                west + (j[end] + 1) * dx,
                south + (i[end] + 1) * dy,
            )
        )
    region = shapely.union_all(np.concatenate(held))
    left = np.flatnonzero(~done)
    inside = shapely.covers(
        region.buffer(1e-7, join_style="mitre"), shapely.polygons(triangles[left][:, :, :2])
    )
    rest[left[~inside]] = True
    return rest
