"""Meshes of terrains with storeys: one triangulation of the plane, stacks over its triangles."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.field.storeys import Storeys, StoreySheet
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh.build import FineMesh, base_height, base_of, build, fine_mesh, mesh_of
from terratool.mesh.manifold import separate
from terratool.mesh.overlay import MeshLayer, Overlay, cuts_of, sides_of, split
from terratool.mesh.stacks import BELOW, NONE, Stacks, ranks_of, stacks_of
from terratool.mesh.strips import StackSides, StackWalls, raise_sides
from terratool.mesh.tops import seen_tops
from terratool.mesh.types import BuiltMesh, MeshPlan, MeshStoreys, PlanLoss, RegionMesh

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


def build_all(
    terrain: Terrain,
    max_error: float,
    bounds: Bounds | None = None,
    least: float = 0.0,
    base: float | Literal["below"] | None = None,
) -> BuiltMesh:
    """Mesh a terrain with its storeys; see `build` for arguments and errors.

    The mesh is the boundary of what is solid: tops, undersides and sides of all intervals of the
    columns. Where decks dip into the ground or into each other, and where bores come to the light,
    it is cut along the lines where their surfaces meet. Sides of what stands over a gap are always
    closed, and every edge of a solid has two faces.
    """
    if terrain.storeys is None:
        return build(terrain, max_error, bounds, least, base)
    layers = _layers(terrain, terrain.storeys, max_error, bounds, least)
    columns = _columns(layers, _cut(layers, Overlay.of(layers.all, layers.bounds)))
    return _raise(terrain, terrain.storeys, layers, columns, base)


class StackParts(NamedTuple):
    """Ground of a terrain with storeys, what stands over gaps, and the gaps.

    Coordinates are those of the mesh of the ground. Triangles are counter-clockwise from above.

    Attributes:
        ground: mesh of what is solid from below.
        over: (n, 3, 4) float64 x, y, top, bottom at the corners of solid prisms over gaps.
        surfaces: (n,) int32 index of the surface of each top; -1 for none.
        gaps: (m, 3, 4) float64 x, y, floor, ceiling at the corners of prisms of air; the floor is
            -inf for the void, the ceiling inf for the sky.
        floors: (m,) int32 index of the surface of each floor; -1 for none.
    """

    ground: BuiltMesh
    over: Floats
    surfaces: Ints
    gaps: Floats
    floors: Ints


def build_parts(terrain: Terrain, storeys: Storeys, max_error: float) -> StackParts:
    """Mesh the ground of a terrain with storeys, with what stands over gaps apart from it."""
    layers = _layers(terrain, storeys, max_error, None, 0.0)
    columns = _columns(layers, _cut(layers, Overlay.of(layers.all, layers.bounds)))
    ground = _raise(terrain, storeys, layers, columns.ground(), None)
    stacks = columns.stacks
    place = columns.overlay.corners * layers.plan.pitch

    def prisms(rows: Longs, *faces: Floats) -> Floats:
        return np.concatenate([place[rows], *(face[..., None] for face in faces)], axis=2)

    thick = (stacks.bottoms >= 0) & (columns.high > columns.low).any(axis=2)
    over = np.argwhere(thick)
    row, interval = np.nonzero(stacks.tops >= 0)
    first = np.flatnonzero(~stacks.grounded)
    # the air over each interval, then that under all of them where nothing is solid from below
    rows, above = np.append(row, first), np.append(interval + 1, np.zeros(len(first), np.int64))
    bottoms = np.pad(columns.low, ((0, 0), (0, 1), (0, 0)), constant_values=np.nan)[rows, above]
    floors = np.full((len(rows), 3), -np.inf)
    floors[: len(row)] = columns.high[row, interval]
    worn = np.full(len(rows), -1, np.int32)
    worn[: len(row)] = _surfaces(layers, columns, columns.shown, np.column_stack([row, interval]))
    surfaces = _surfaces(layers, columns, columns.shown, over)
    for one in (surfaces, worn):
        one[one >= len(terrain.surfaces)] = -1
    return StackParts(
        ground,
        prisms(over[:, 0], columns.high[tuple(over.T)], columns.low[tuple(over.T)]),
        surfaces,
        prisms(rows, floors, np.where(np.isnan(bottoms), np.inf, bottoms)),
        worn,
    )


# --- layers: the meshes of ground and sheets ------------------------------------------------------


class _Layers(NamedTuple):
    """Meshes of the ground and of the sheets, on one lattice.

    Attributes:
        all: those that decide what is solid, in the order of the ends of stacks, then others.
        ends: number of the first ones.
        low: index of the layer that shows the top of something solid from below, for each end.
        high: index of the layer that shows the top of what stands over a gap, for each end.
        bores: for each sheet whether it has bores.
        plan: plan of the ground.
        loss: loss of all.
        error: bound of the error of all heights.
    """

    all: list[MeshLayer]
    ends: int
    low: Longs
    high: Longs
    bores: Bools
    plan: MeshPlan
    loss: PlanLoss
    error: float

    @property
    def bounds(self) -> Longs:
        """West, south, east, north of the mesh on the lattice."""
        return self.plan.bounds.astype(np.int64)


def _layers(
    terrain: Terrain, storeys: Storeys, max_error: float, bounds: Bounds | None, least: float
) -> _Layers:
    known: dict[int, FineMesh] = {}

    def fine(one: Terrain, least: float = 0.0) -> FineMesh:
        if id(one) not in known:
            known[id(one)] = fine_mesh(one, max_error, bounds, least)
        return known[id(one)]

    seen = seen_tops(terrain, storeys)
    shown = seen.low[0]
    ground = fine(shown, least)
    bare = terrain.bare if terrain.tracks or terrain.is_rough else shown
    found = [_ground_layer(fine(bare, least).parts)]
    for sheet in storeys.sheets:
        found.append(_top_layer(sheet, fine(sheet.top).parts))
        found.append(_face_layer(sheet, storeys, fine(sheet.face).parts))
    ends = len(found)
    low, high = np.arange(ends), np.arange(ends)
    if bare is not shown:
        for tops, layer in ((seen.low, low), (seen.high, high)):
            layer[0] = len(found)
            found.append(_ground_layer(fine(tops[0], least).parts))
            for k, sheet in enumerate(storeys.sheets):
                layer[2 * k + 1] = len(found)
                found.append(_top_layer(sheet, fine(tops[k + 1]).parts))
    loss = ground.loss
    for one in known.values():
        if one is not ground:
            loss = loss._replace(wall_offset=max(loss.wall_offset, one.loss.wall_offset))
    for sheet in storeys.sheets:  # what is too small is so in all meshes
        loss = loss._replace(small=loss.small + fine(sheet.top).loss.small)
    return _Layers(
        found, ends, low, high, np.array([sheet.is_bore for sheet in storeys.sheets]),
        ground.plan, loss, max(one.error for one in known.values()),
    )  # fmt: skip


def _ground_layer(parts: RegionMesh) -> MeshLayer:
    solid = ~parts.regions.voids[parts.region_of]
    surfaces = parts.regions.surfaces[parts.region_of]
    return MeshLayer(parts.triangulation, solid, parts.heights, surfaces)


def _top_layer(sheet: StoreySheet, parts: RegionMesh) -> MeshLayer:
    """Layer of the tops of storeys; the heights of void ones are NaN."""
    voids = parts.regions.voids[parts.region_of]
    heights = np.where(voids[:, None], np.nan, parts.heights)
    surfaces = parts.regions.surfaces[parts.region_of]
    return MeshLayer(parts.triangulation, _storey_of(parts, sheet.storeys) >= 0, heights, surfaces)


def _face_layer(sheet: StoreySheet, storeys: Storeys, parts: RegionMesh) -> MeshLayer:
    """Layer of the other faces of storeys."""
    storey = _storey_of(parts, sheet.faced)
    there = (storey >= 0) & ~parts.regions.voids[parts.region_of]
    gaps = np.nan_to_num(storeys.table.gaps)[storey][:, None]
    heights = parts.heights + (gaps if sheet.is_bore else -gaps)
    return MeshLayer(parts.triangulation, there, heights, storeys.table.surface[storey])


def _storey_of(parts: RegionMesh, storeys: Ints) -> Ints:
    """Storey of each triangle, by that of each element; -1 for none."""
    regions = parts.regions
    found = np.full(len(regions.voids), -1, np.int32)
    region = np.repeat(np.arange(len(found)), np.diff(regions.offsets))
    np.maximum.at(found, region, storeys[regions.covering["element"]])
    return found[parts.region_of]


# --- columns over the triangles of an overlay -----------------------------------------------------


class _Columns(NamedTuple):
    """Intervals over the triangles of an overlay, i at most.

    Attributes:
        overlay: the triangles.
        stacks: what the intervals begin and end with.
        shown: (m, i) int64 layer that shows each top.
        low: (m, i, 3) heights of the bottoms at the corners; NaN for none.
        high: (m, i, 3) heights of the tops at the corners; NaN for none.
    """

    overlay: Overlay
    stacks: Stacks
    shown: Longs
    low: Floats
    high: Floats

    def ground(self) -> _Columns:
        """The intervals that begin below all."""
        bottoms, tops = (
            np.where(self.stacks.grounded, ends[:, 0], NONE)[:, None] for ends in self.stacks
        )
        high = np.where(self.stacks.grounded[:, None, None], self.high[:, :1], np.nan)
        stacks = Stacks(bottoms, tops)
        return _Columns(self.overlay, stacks, self.shown[:, :1], self.low[:, :1], high)


def _storeys_at(layers: _Layers, found: Ints) -> Bools:
    """Whether triangles are in the footprints of storeys of each sheet, (m, s)."""
    return np.asarray((found[:, 1 : layers.ends : 2] >= 0) & (found[:, 2 : layers.ends : 2] >= 0))


def _ends(layers: _Layers, found: Ints, points: NDArray[Any]) -> tuple[Floats, Bools]:
    """Heights of all ends at points of triangles, and whether the top of a storey is void, (m, s).

    Args:
        layers: the layers.
        found: (m, layers) triangle of each layer, as in `Overlay`.
        points: (m, k, 2) places on the lattice.

    Returns:
        (m, ends, k) heights, NaN where there is none: a storey is where both of its faces are.
    """
    z = np.empty((len(found), layers.ends, points.shape[1]))
    for k, layer in enumerate(layers.all[: layers.ends]):
        z[:, k] = layer.heights_at(found[:, k], points)
    there = _storeys_at(layers, found)
    voids = there & np.isnan(z[:, 1::2, 0])
    z[:, 1::2][~there] = np.nan
    z[:, 2::2][~there] = np.nan
    return z, voids


def _cut(layers: _Layers, overlay: Overlay) -> Overlay:
    """Overlay that is cut where surfaces cross, too."""
    plane = overlay.plane
    near = np.flatnonzero(_storeys_at(layers, overlay.found).any(axis=1))
    if not len(near):
        return overlay
    sides, own = sides_of(plane.triangles, len(plane.points))
    z, _ = _ends(layers, overlay.found, overlay.corners)
    cuts = cuts_of(plane, sides, own, near, z[near], layers.plan.tolerance)
    if not len(cuts.edge):
        return overlay
    t, c = overlay.borders()

    def order_at(middles: Floats, found: Ints) -> Ints:
        z, _ = _ends(layers, found, middles[:, None])
        return ranks_of(z[..., 0], layers.plan.tolerance)

    segments = split(plane.points, sides, own[t, c], cuts)
    return Overlay.of(layers.all, layers.bounds, segments, order_at)


def _columns(layers: _Layers, overlay: Overlay) -> _Columns:
    corners = overlay.corners
    z, voids = _ends(layers, overlay.found, corners)
    stacks = stacks_of(z.mean(axis=2), voids, layers.bores, layers.plan.tolerance)
    bottoms, tops = stacks
    ends = np.stack([bottoms, tops], axis=2).reshape(len(tops), -1)
    own = np.take_along_axis(z, np.maximum(ends, 0)[..., None].astype(np.int64), axis=1)
    # from below, no end is lower than the one before it
    own = np.fmax.accumulate(np.where((ends >= 0)[..., None], own, np.nan), axis=1)
    low, high = own[:, ::2], own[:, 1::2]
    low[bottoms < 0], high[tops < 0] = np.nan, np.nan
    shown = np.where(bottoms == BELOW, layers.low[tops], layers.high[tops])
    for k in range(layers.ends, len(layers.all)):
        row, interval = np.nonzero((shown == k) & (tops >= 0))
        seen = layers.all[k].heights_at(overlay.found[row, k].astype(np.int64), corners[row])
        there = ~np.isnan(seen[:, 0])
        high[row[there], interval[there]] = seen[there]
        row, interval = row[~there], interval[~there]
        shown[row, interval] = tops[row, interval]
    # a relief grows into nothing, and no rut leads through a deck
    high[:, :-1] = np.fmin(high[:, :-1], low[:, 1:])
    high = np.where(bottoms[..., None] == BELOW, high, np.maximum(high, low))
    return _Columns(overlay, stacks, shown, low, high)


# --- faces ----------------------------------------------------------------------------------------


def _raise(
    terrain: Terrain,
    storeys: Storeys,
    layers: _Layers,
    columns: _Columns,
    base: float | Literal["below"] | None,
) -> BuiltMesh:
    """Mesh of columns: tops, undersides and sides of their intervals, and the base of a solid."""
    plan, plane, stacks = layers.plan, columns.overlay.plane, columns.stacks
    tops, bottoms = np.argwhere(stacks.tops >= 0), np.argwhere(stacks.bottoms >= 0)
    heights = np.concatenate([columns.high[tuple(tops.T)], columns.low[tuple(bottoms.T)]])
    edges = np.empty((0, 2), np.int32)
    on_boundary = np.zeros(len(plane.points), np.bool_)
    floor_z = 0.0
    if base is not None and len(heights):
        floor_z = base_height(base, float(heights.min()), float(heights.max()), plan)
        t, c = plane.rim(stacks.grounded)
        edges = np.column_stack([plane.triangles[t, c], plane.triangles[t, (c + 1) % 3]])
        on_boundary[edges] = True
    found = kernels.find_levels(
        np.concatenate([plane.triangles[tops[:, 0]], plane.triangles[bottoms[:, 0]]]),
        heights, np.ones(len(heights), np.bool_), on_boundary,
        floor_z, plan.tolerance,
    )  # fmt: skip
    begins, levels = found["begins"], found["levels"]
    low, high = np.full((2, *stacks.tops.shape, 3), NONE, np.int32)
    high[tuple(tops.T)], low[tuple(bottoms.T)] = np.split(found["corners"], [len(tops)])
    low[stacks.bottoms == BELOW] = BELOW

    thick = (low != high).any(axis=2)  # others are two faces in one place
    tops, bottoms = tops[thick[tuple(tops.T)]], bottoms[thick[tuple(bottoms.T)]]
    walls = raise_sides(StackSides(plane, stacks, low, high, begins, levels, base is not None))
    floor = begins[base_of(plane.points, edges)].astype(np.int32)
    faces = np.concatenate(
        [high[tuple(tops.T)], low[tuple(bottoms.T)][:, ::-1], walls.faces, floor[:, ::-1]]
    )
    surfaces = np.concatenate(
        [
            _surfaces(layers, columns, columns.shown, tops),
            _surfaces(layers, columns, stacks.bottoms, bottoms),
            _wall_surfaces(layers, columns, walls),
            np.full(len(floor), -1, np.int32),
        ]
    )
    surfaces[surfaces >= len(terrain.surfaces)] = -1
    level = len(tops) + len(bottoms)
    outer = np.concatenate([np.zeros(level), walls.outer, np.ones(len(floor))])
    upright = np.repeat([False, True, False], [level, len(walls.faces), len(floor)])

    place = np.repeat(np.arange(len(plane.points)), np.diff(begins))
    apart = separate(np.column_stack([plane.points[place] * plan.pitch, levels]), faces)
    order = np.argsort(outer[apart.owners], kind="stable")
    own = apart.owners[order]
    mesh = mesh_of(
        terrain, plan, vertices=apart.vertices, faces=apart.faces[order], surfaces=surfaces[own],
        walls=upright[own],
    )  # fmt: skip
    return BuiltMesh(
        mesh,
        int((outer[own] == 0).sum()),
        layers.error + found["moved"],
        layers.loss,
        _summary(storeys, layers, columns),
    )


def _surfaces(layers: _Layers, columns: _Columns, ends: NDArray[np.integer], which: Longs) -> Ints:
    """Surface of some ends of intervals, (n,), by their layers and triangle and interval."""
    out = np.full(len(which), -1, np.int32)
    layer_of = ends[tuple(which.T)]
    for k in np.unique(layer_of).tolist():
        own = np.flatnonzero(layer_of == k)
        out[own] = layers.all[k].surfaces[columns.overlay.found[which[own, 0], k]]
    return out


def _wall_surfaces(layers: _Layers, columns: _Columns, walls: StackWalls) -> Ints:
    """Surfaces of walls: those of the tops of what they are sides of, but of a bore within it."""
    out = _surfaces(layers, columns, columns.shown, np.column_stack([walls.owner, walls.interval]))
    tops = columns.stacks.tops
    there = np.flatnonzero((walls.empty >= 0) & (walls.under >= 0))
    end = tops[walls.empty[there], walls.under[there]]
    within = (end > 0) & layers.bores[np.maximum(end - 1, 0) // 2]
    within &= tops[walls.owner[there], walls.interval[there]] != end
    faces = np.where(within, end + 1, -1)
    for k in np.unique(faces[within]).tolist():
        own = there[faces == k]
        out[own] = layers.all[k].surfaces[columns.overlay.found[walls.empty[own], k]]
    return out


def _summary(storeys: Storeys, layers: _Layers, columns: _Columns) -> MeshStoreys:
    over = columns.stacks.bottoms >= 0
    thick = np.where(over, (columns.high - columns.low).mean(axis=2), 0.0)
    a, b, c = np.moveaxis(columns.overlay.corners * layers.plan.pitch, 1, 0)
    u, v = b - a, c - a
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    return MeshStoreys(
        storeys.decks,
        storeys.bores,
        float(area[over.any(axis=1)].sum()),
        float((area * thick.sum(axis=1)).sum()),
    )
