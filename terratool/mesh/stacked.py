"""Meshes of terrains with storeys: one triangulation of the plane with a stack over each triangle."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.errors import RequestError
from terratool.field.storeys import Sheet, StoreyTable
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh.build import FineMesh, base_below, base_of, build, fine_mesh, mesh_of
from terratool.mesh.manifold import separate
from terratool.mesh.overlay import Layer, Overlay, cuts_of, hash_rows, sides_of, split
from terratool.mesh.stacks import BELOW, GROUND, NONE, Stacks, stacks_of
from terratool.mesh.strips import Sides, raise_sides
from terratool.mesh.types import BuiltMesh, MeshPlan, PlanLoss, RegionMesh

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

    The mesh is the boundary of what is solid: the tops, undersides and sides of all intervals of
    the columns. Where decks dip into the ground or into each other, and where bores come to the
    light, the mesh is cut along the line where their surfaces meet.
    """
    if terrain.storeys is None:
        return build(terrain, max_error, bounds, least, base)
    ground = fine_mesh(terrain.ground_alone, max_error, bounds, least)
    layers = [_ground_layer(ground.parts)]
    loss, error = ground.loss, ground.error
    for sheet in terrain.storeys.sheets:
        top = fine_mesh(sheet.top, max_error, bounds)
        face = fine_mesh(sheet.face, max_error, bounds)
        error = max(error, top.error, face.error)
        loss = _join(_join(loss, top.loss), face.loss)
        layers += _sheet_layers(sheet, terrain.storeys.table, top.parts, face.parts)
    plan = ground.plan
    bores = np.array([sheet.is_bore for sheet in terrain.storeys.sheets])
    mesher = _Mesher(terrain, plan, layers, bores)
    return mesher.mesh(error, loss, base)


def _join(one: PlanLoss, other: PlanLoss) -> PlanLoss:
    return one._replace(
        wall_offset=max(one.wall_offset, other.wall_offset), small=one.small + other.small
    )


def _ground_layer(parts: RegionMesh) -> Layer:
    solid = ~parts.regions.voids[parts.region_of]
    surfaces = parts.regions.surfaces[parts.region_of]
    return Layer(parts.triangulation, solid, parts.heights, surfaces)


def _storey_of(parts: RegionMesh, storeys: Ints) -> Ints:
    """Storey of each triangle, by that of each element; -1 for none."""
    regions = parts.regions
    found = np.full(len(regions.voids), -1, np.int32)
    region = np.repeat(np.arange(len(found)), np.diff(regions.offsets))
    np.maximum.at(found, region, storeys[regions.covering["element"]])
    return found[parts.region_of]


def _sheet_layers(
    sheet: Sheet, table: StoreyTable, top: RegionMesh, face: RegionMesh
) -> tuple[Layer, Layer]:
    """Layers of the tops and the other faces; void tops have NaN for heights."""
    storey = _storey_of(top, sheet.storeys)
    heights = np.where(top.regions.voids[top.region_of][:, None], np.nan, top.heights)
    surfaces = top.regions.surfaces[top.region_of]
    tops = Layer(top.triangulation, storey >= 0, heights, surfaces)
    storey = _storey_of(face, sheet.faced)
    there = (storey >= 0) & ~face.regions.voids[face.region_of]
    gaps = np.nan_to_num(table.gaps)[storey][:, None]
    heights = face.heights + (gaps if sheet.is_bore else -gaps)
    return tops, Layer(face.triangulation, there, heights, table.surface[storey])


class _Columns(NamedTuple):
    """Triangles with all surfaces over them, (n, ends, 3) heights at corners, NaN for none."""

    overlay: Overlay
    z: Floats
    voids: Bools


class _Mesher:
    def __init__(
        self, terrain: Terrain, plan: MeshPlan, layers: list[Layer], bores: Bools
    ) -> None:
        self._terrain, self._plan, self._layers, self._bores = terrain, plan, layers, bores
        self._count = len(terrain.surfaces)
        self._bounds = plan.bounds.astype(np.int64)

    def _columns(self, overlay: Overlay) -> _Columns:
        corners = overlay.corners
        found = overlay.found.astype(np.int64)
        z = np.stack(
            [layer.heights_at(found[:, k], corners) for k, layer in enumerate(self._layers)], axis=1
        )
        both = (found[:, 1::2] >= 0) & (found[:, 2::2] >= 0)
        voids = both & np.isnan(z[:, 1::2, 0])
        for k in (1, 2):
            z[:, k::2][~both] = np.nan
        return _Columns(overlay, z, voids)

    def _stacks(self, columns: _Columns) -> Stacks:
        middle = columns.z.mean(axis=2)
        return stacks_of(middle, columns.voids, self._bores, self._plan.tolerance)

    def _cut(self, columns: _Columns) -> Overlay:
        """Overlay that is cut where surfaces cross, too."""
        plane = columns.overlay.plane
        near = (columns.overlay.found[:, 1:] >= 0).any(axis=1)
        if not near.any():
            return columns.overlay
        sides, own = sides_of(plane.triangles, len(plane.points))
        which = np.flatnonzero(near)
        cuts = cuts_of(plane, sides, own, which, columns.z[which], self._plan.tolerance)
        cuts = self._with_jumps(columns, sides, own, cuts)
        t, c = columns.overlay.borders()
        segments = split(plane.points, sides, own[t, c], cuts)
        return Overlay.of(self._layers, self._bounds, segments)

    def _with_jumps(self, columns, sides, own, cuts):
        return cuts

    def mesh(
        self, error: float, loss: PlanLoss, base: float | Literal["below"] | None
    ) -> BuiltMesh:
        plan = self._plan
        columns = self._columns(Overlay.of(self._layers, self._bounds))
        columns = self._columns(self._cut(columns))
        stacks = self._stacks(columns)
        plane = columns.overlay.plane
        ends = [_heights_of(columns.z, one) for one in stacks]
        # from below, no end is lower than the one before it
        z = np.empty((len(ends[0]), 2 * stacks.tops.shape[1], 3))
        z[:, ::2], z[:, 1::2] = ends
        z = np.fmax.accumulate(z, axis=1)
        lower, upper = z[:, ::2], z[:, 1::2]
        bottoms, tops = np.argwhere(stacks.bottoms >= 0), np.argwhere(stacks.tops >= 0)
        faced = np.concatenate([bottoms, tops])
        heights = np.concatenate([lower[tuple(bottoms.T)], upper[tuple(tops.T)]])
        grounded = stacks.grounded
        outer = np.argwhere(
            grounded[:, None] & ((plane.neighbours < 0) | ~grounded[plane.neighbours])
        )
        if not len(heights):
            base = None
        on_boundary = np.zeros(len(plane.points), np.bool_)
        edges = np.empty((0, 2), np.int32)
        if base is not None:
            base = self._base(base, heights)
            t, c = outer.T
            edges = np.column_stack([plane.triangles[t, c], plane.triangles[t, (c + 1) % 3]])
            on_boundary[edges] = True
        found = kernels.find_levels(
            plane.triangles[faced[:, 0]], heights, np.ones(len(faced), np.bool_), on_boundary,
            base or 0.0, plan.tolerance,
        )  # fmt: skip
        levels, begins = found["levels"], found["begins"]
        low, high = np.full((2, *stacks.tops.shape, 3), NONE, np.int32)
        low[tuple(bottoms.T)] = found["corners"][: len(bottoms)]
        high[tuple(tops.T)] = found["corners"][len(bottoms) :]
        low[stacks.bottoms == BELOW] = BELOW
        bottom_surfaces, top_surfaces = (self._surfaces(columns.overlay, one) for one in stacks)
        below = np.argwhere((low[..., 0] >= 0) & (low != high).any(axis=2))
        shown = np.concatenate([high[stacks.tops >= 0], low[tuple(below.T)][:, ::-1]])
        surfaces = np.concatenate(
            [top_surfaces[stacks.tops >= 0], bottom_surfaces[tuple(below.T)]]
        )
        walls = raise_sides(Sides(plane, stacks, low, high, begins, levels, base is not None))
        wall_surfaces = self._wall_surfaces(columns.overlay, stacks, top_surfaces, walls)
        floor = np.empty((0, 3), np.int32)
        if base is not None:
            floor = begins[base_of(plane.points, edges)].astype(np.int32)[:, ::-1]
        faces = np.concatenate([shown, walls.faces, floor]).astype(np.int32)
        place = np.repeat(np.arange(len(plane.points)), np.diff(begins))
        vertices = np.column_stack([plane.points[place] * plan.pitch, levels])
        surfaces = np.concatenate([surfaces, wall_surfaces, np.full(len(floor), -1)])
        # tops, undersides and walls, and then what closes a solid
        rank = np.repeat([0, 1, 2], [len(shown), len(walls.faces), len(floor)])
        last = np.concatenate([np.zeros(len(shown)), walls.outer, np.ones(len(floor))])
        found_faces = separate(vertices, faces)
        order = found_faces.owners[np.argsort(last[found_faces.owners], kind="stable")]
        mesh = mesh_of(
            self._terrain, plan,
            vertices=found_faces.vertices,
            faces=found_faces.faces[np.argsort(last[found_faces.owners], kind="stable")],
            surfaces=surfaces[order].astype(np.int32),
            walls=rank[order] == 1,
        )  # fmt: skip
        shell = int((last[order] == 0).sum())
        return BuiltMesh(mesh, shell, error + found["moved"], loss)

    def _base(self, base: float | Literal["below"], heights: Floats) -> float:
        lowest, highest = float(heights.min()), float(heights.max())
        if base == "below":
            return base_below(lowest, highest, self._plan.pitch * float(self._plan.bounds.max()))
        if not -np.inf < base < lowest - self._plan.rounding:
            raise RequestError(
                f"The base at {base:g} is not below the lowest ground of the mesh, which is at"
                f" {lowest:g}.",
                "Give a base that is lower.",
            )
        return base

    def _surfaces(self, overlay: Overlay, ends: Ints) -> Ints:
        """Surface of each of the ends of intervals, (n, i); -1 for none."""
        out = np.full(ends.shape, -1, np.int32)
        for k, layer in enumerate(self._layers):
            at = np.argwhere(ends == k)
            out[tuple(at.T)] = layer.surfaces[overlay.found[at[:, 0], k]]
        out[out >= self._count] = -1
        return out

    def _wall_surfaces(self, overlay, stacks, top_surfaces, walls) -> Ints:
        out = top_surfaces[walls.owner, walls.interval]
        # what looks into a bore wears the surface of the bore
        empty, under = walls.empty, walls.under
        there = np.flatnonzero((empty >= 0) & (under >= 0))
        end = stacks.tops[empty[there], under[there]]
        sheet = (end - 1) // 2
        bore = (end > GROUND) & self._bores[np.maximum(sheet, 0)]
        bore &= stacks.tops[walls.owner[there], walls.interval[there]] != end
        for k in np.unique(sheet[bore]).tolist():
            at = there[bore & (sheet == k)]
            layer = self._layers[2 * k + 2]
            out[at] = layer.surfaces[overlay.found[empty[at], 2 * k + 2]]
        return out


def _heights_of(z: Floats, ends: Ints) -> Floats:
    """Heights of the ends of intervals at the corners of triangles, (n, i, 3)."""
    own = np.take_along_axis(z, np.maximum(ends, 0)[..., None].astype(np.int64), axis=1)
    return np.where((ends >= 0)[..., None], own, np.nan)
