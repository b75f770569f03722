"""From a terrain to a mesh: a coarse mesh is refined, and its walls are raised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
import shapely
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.definition.findings import Bounds
from terratool.definition.presets import friction_of
from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh import seams
from terratool.mesh.plan import plan_of
from terratool.mesh.triangulate import delaunay, regions_of, triangulate
from terratool.mesh.types import (
    BuiltMesh,
    Mesh,
    MeshPlan,
    PlanLoss,
    RegionMesh,
    TileBoundary,
    Triangulation,
)

_PLANS = 3
"""Most plans of a mesh: where discs overlap too much, their polygons become finer."""
_POLYGON_SHARE = 0.6
"""Largest share of the error that polygons in place of overlapping discs may take."""
_ROUNDS = 8
"""Most rounds of refining triangles and splitting edges at which the higher side changes."""
_BATCH = 2_000
"""Triangles that a kernel examines in one call, between which the user can interrupt."""
_HOLE = np.iinfo(np.int64).min
"""Key of triangles in rectangles that are left out."""
_NO_HOLES = np.empty((0, 4), np.int64)
GREY = 160, 160, 160
"""Colour (red, green, blue) of surfaces that have none."""

Ints = NDArray[np.int32]
KeysOf = Callable[[NDArray[np.int64], Ints], NDArray[np.int64]]


def build(
    terrain: Terrain,
    max_error: float,
    bounds: Bounds | None = None,
    least: float = 0.0,
    base: float | Literal["below"] | None = None,
    holes: Sequence[Bounds] = (),
) -> BuiltMesh:
    """Mesh a terrain, with walls where its height jumps.

    With a base the mesh is closed, a solid: a skirt leads from where the ground ends, at the bounds
    and at the void, down to the base. Every edge has two faces. For that, some vertices lie at the
    same place. A program that merges vertices by place, as readers of STL do, gets edges with four
    faces and more. A mesh without a base has such edges, too, where its walls meet.

    Args:
        terrain: terrain to mesh.
        max_error: largest distance, along z, of the mesh from the terrain, in units of the terrain.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        least: largest change of heights by elements that are left out, in units of the terrain; 0
            leaves none out.
        base: height of the base, in units of the terrain; "below" for `base_below`; None for ground
            alone.
        holes: world rectangles that are left out, as if they were void.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
        RequestError: the base does not lie below all ground that is meshed.
    """
    fine = fine_mesh(terrain, max_error, bounds, least, holes)
    mesh, shell, moved = assemble(terrain, fine.plan, fine.parts, base)
    return BuiltMesh(mesh, shell, fine.error + moved, fine.loss)


class FineMesh(NamedTuple):
    """Triangles of a terrain within an error, without walls.

    Attributes:
        plan: plan of the terrain.
        loss: loss of the plan.
        parts: triangles in the plane with their heights.
        error: bound of the error of the heights, in units of the terrain.
    """

    plan: MeshPlan
    loss: PlanLoss
    parts: RegionMesh
    error: float


def fine_mesh(
    terrain: Terrain,
    max_error: float,
    bounds: Bounds | None = None,
    least: float = 0.0,
    holes: Sequence[Bounds] = (),
) -> FineMesh:
    """Mesh a terrain without walls; see `build` for arguments and errors."""
    finer = 1.0
    for _ in range(_PLANS):
        plan, loss = plan_of(terrain, max_error, bounds, least, finer)
        segments = kernels.segments_of(plan.kernel_plan, np.flatnonzero(plan.frames["drawn"]))
        coarse = coarse_mesh(plan, segments, holes=_on_lattice(plan, holes))
        most = float(coarse.regions.polygon_errors.max(initial=0.0))
        if most <= _POLYGON_SHARE * max_error:
            break
        finer *= 0.5 * _POLYGON_SHARE * max_error / most  # many discs overlap
    return FineMesh(plan, loss, *refine(plan, coarse, seams.NO_SEAMS.sides))


def coarse_mesh(
    plan: MeshPlan,
    segments: NDArray[np.int64],
    boundary: TileBoundary = seams.NO_SEAMS,
    bounds: NDArray[np.int64] | None = None,
    holes: NDArray[np.int64] = _NO_HOLES,
) -> RegionMesh:
    """Mesh the plane by triangles along segments; beside a seam they are as in the tile beyond.

    Args:
        plan: plan of the terrain.
        segments: (n, 4) int64 x, y, x, y of segments within the bounds, on the lattice.
        boundary: sides that the mesh shares with other tiles.
        bounds: (4,) west, south, east, north on the lattice; those of the plan if None.
        holes: (k, 4) west, south, east, north of rectangles on the lattice that become void.
    """
    if bounds is None:
        bounds = plan.bounds.astype(np.int64)
    keys_of: KeysOf = partial(kernels.region_keys, plan.kernel_plan)
    if len(holes):
        segments, keys_of = _with_holes(segments, keys_of, holes)
    plane, keys = triangulate(segments, bounds, keys_of, boundary)
    ends = boundary.edges.reshape(-1, 2)
    first = 2 * np.arange(len(boundary.edges), dtype=np.int32)
    along = np.column_stack([first, first, first + 1])  # their middles lie on the seams
    own = keys_of(ends, along)
    triangle, corner = seams.boundary_triangles(plane, boundary)
    keys[triangle] = own
    points = np.concatenate([ends, plane.points])
    triangles = np.concatenate([along, plane.triangles + np.int32(len(ends))])
    keys = np.concatenate([own, keys])
    regions, region_of = regions_of(plan, points, triangles, keys)
    if len(holes):
        regions.voids[region_of[keys == _HOLE]] = True
    region_of = region_of[len(along) :]
    heights = kernels.corner_heights(
        plan.kernel_plan, regions, plane.points, plane.triangles, region_of
    )
    seams.pin_heights(plane, boundary, triangle, corner, regions.voids[region_of], heights)
    return RegionMesh(plane, regions, region_of, heights)


def _on_lattice(plan: MeshPlan, holes: Sequence[Bounds]) -> NDArray[np.int64]:
    """Return world rectangles on the lattice of a plan, (n, 4)."""
    if not holes:
        return _NO_HOLES
    return np.rint((np.array(holes) - np.tile(plan.origin, 2)) / plan.pitch).astype(np.int64)


def _with_holes(
    segments: NDArray[np.int64], keys_of: KeysOf, holes: NDArray[np.int64]
) -> tuple[NDArray[np.int64], KeysOf]:
    """Return segments with the edges of rectangles and none inside, and keys that tell them apart.

    Args:
        segments: (n, 4) int64 x, y, x, y of segments on the lattice.
        keys_of: function of points and triangles that returns keys of triangles.
        holes: (k, 4) int64 west, south, east, north of rectangles on the lattice.
    """
    low, high = segments.reshape(-1, 2, 2).min(axis=1), segments.reshape(-1, 2, 2).max(axis=1)
    tree = shapely.STRtree(shapely.box(*holes.T))
    first, which = tree.query(shapely.points(0.5 * (low + high)), predicate="within")
    inside = (low[first] >= holes[which, :2]) & (high[first] <= holes[which, 2:])
    kept = np.ones(len(segments), np.bool_)
    kept[first[inside.all(axis=1)]] = False
    corners = holes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2)
    edges = np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)

    def keys_with_holes(points: NDArray[np.int64], triangles: Ints) -> NDArray[np.int64]:
        keys = keys_of(points, triangles).copy()
        middles = shapely.points(points[triangles].mean(axis=1))
        keys[tree.query(middles, predicate="within")[0]] = _HOLE
        return keys

    return np.concatenate([segments[kept], edges]), keys_with_holes


def finish(
    terrain: Terrain,
    plan: MeshPlan,
    loss: PlanLoss,
    coarse: RegionMesh,
    boundary: TileBoundary = seams.NO_SEAMS,
    base: float | Literal["below"] | None = None,
) -> BuiltMesh:
    """Refine a coarse mesh and raise its walls; see `build` and `coarse_mesh` for arguments."""
    fine, error = refine(plan, coarse, boundary.sides)
    mesh, shell, moved = assemble(terrain, plan, fine, base)
    return BuiltMesh(mesh, shell, error + moved, loss)


def refine(
    plan: MeshPlan, coarse: RegionMesh, locked: NDArray[np.int64]
) -> tuple[RegionMesh, float]:
    """Refine triangles until they are within the error; split edges where the higher side changes.

    Args:
        plan: plan of the terrain.
        coarse: triangles to refine.
        locked: (4,) int64 seams, as in `TileBoundary.sides`.

    Returns:
        The refined triangles, and a bound of their error, in units of the terrain.
    """
    plane, regions, region_of, heights = coarse
    work = kernels.Refinement(plan.kernel_plan, regions, plane, region_of, heights, locked)
    for _ in range(_ROUNDS):
        while kernels.refine(work, plan.error - plan.tolerance, _BATCH):
            pass
        if not kernels.split_crossings(work, plan.tolerance):
            break
    flat = regions.polygon_errors[regions.affine & ~regions.voids].max(initial=0.0)
    found = kernels.take(work)
    error = max(found["largest_error"], float(flat))
    plane = Triangulation(found["points"], found["triangles"], found["neighbours"])
    return RegionMesh(plane, regions, found["regions"], found["heights"]), error


# --- ground and walls, one vertex for each level --------------------------------------------------


def assemble(
    terrain: Terrain,
    plan: MeshPlan,
    parts: RegionMesh,
    base: float | Literal["below"] | None = None,
) -> tuple[Mesh, int, float]:
    """Make a mesh of triangles in the plane and the one-sided heights at their corners.

    Args:
        terrain: terrain of the mesh.
        plan: plan of the terrain.
        parts: triangles with heights.
        base: height of the base, as in `build`.

    Returns:
        The mesh, the number of its faces that are ground or walls (skirt and base come after), and
        how far a height was moved at most because a wall would be too low.

    Raises:
        RequestError: the base does not lie below all ground.
    """
    triangulation, regions, region_of, heights = parts
    points, triangles, neighbours = triangulation
    ground = ~regions.voids[region_of]
    on_boundary = np.zeros(len(points), np.bool_)
    outer = np.empty((0, 2), np.int32)
    if not ground.any():
        base = None
    if base is not None:
        lowest, highest = float(heights[ground].min()), float(heights[ground].max())
        base = base_height(base, lowest, highest, plan)
        # where the ground ends, at the hull or at the void
        outer = np.column_stack(triangulation.rim(ground)).astype(np.int32, order="C")
        edges = triangles[outer[:, :1], np.column_stack([outer[:, 1], (outer[:, 1] + 1) % 3])]
        on_boundary[edges] = True

    found = kernels.find_levels(
        triangles, heights, ground, on_boundary, base or 0.0, plan.tolerance
    )
    begins, levels, corners = found["begins"], found["levels"], found["corners"]
    walls, above = kernels.raise_walls(neighbours, corners, levels)
    skirt, over = kernels.raise_skirt(triangles, corners, outer, begins, levels)
    faces = np.concatenate([corners[ground], walls, skirt])
    owners = np.concatenate([np.flatnonzero(ground).astype(np.int32), above, over])
    surfaces = regions.surfaces[region_of[owners]]
    sources = np.arange(len(levels), dtype=np.int32)
    upright = len(walls) + len(skirt)
    floor = np.empty((0, 3), np.int32)
    if base is not None:
        below = base_of(points, edges)
        floor, more = kernels.separate_wedges(triangulation, corners, begins, faces, owners, below)
        sources = np.concatenate([sources, more])
    place = np.repeat(np.arange(len(points)), np.diff(begins))[sources]
    mesh = mesh_of(
        terrain,
        plan,
        vertices=np.column_stack([points[place] * plan.pitch, levels[sources]]),
        faces=np.concatenate([faces, floor]),
        surfaces=np.append(surfaces, np.full(len(floor), -1, np.int32)),
        walls=np.repeat([False, True, False], [len(faces) - upright, upright, len(floor)]),
    )
    return mesh, len(faces) - len(skirt), found["moved"]


def mesh_of(
    terrain: Terrain,
    plan: MeshPlan,
    *,
    vertices: NDArray[np.float64],
    faces: Ints,
    surfaces: Ints,
    walls: NDArray[np.bool_],
) -> Mesh:
    """Mesh of arrays as `Mesh` has them, with the surfaces of a terrain."""
    types = terrain.surface_types.values()
    colors = [GREY if surface.color is UNSET else surface.color for surface in types]
    return Mesh(
        vertices=vertices,
        faces=faces,
        surfaces=surfaces,
        walls=walls,
        origin=np.append(plan.origin, 0.0),
        names=terrain.surfaces,
        colors=np.array(colors, np.uint8).reshape(-1, 3),
        frictions=np.array([friction_of(one) for one in types], np.float64),
    )


def base_height(
    base: float | Literal["below"], lowest: float, highest: float, plan: MeshPlan
) -> float:
    """Height of the base of a solid, as in `build`.

    Args:
        base: what is asked for.
        lowest: lowest height of the mesh, in units of the terrain.
        highest: highest height of the mesh.
        plan: plan of the terrain.

    Raises:
        RequestError: the base does not lie below all ground.
    """
    if base == "below":
        return base_below(lowest, highest, plan.pitch * float(plan.bounds.max()))
    if not -np.inf < base < lowest - plan.rounding:
        raise RequestError(
            f"The base at {base:g} is not below the lowest ground of the mesh, which is at"
            f" {lowest:g}.",
            "Give a base that is lower.",
        )
    return base


def base_below(lowest: float, highest: float, side: float) -> float:
    """Return the default height of a base, in units of the terrain.

    The base is below the lowest level by a tenth of the relief, and by no less than a hundredth of
    the longer side, so that flat ground becomes a plate.
    """
    return lowest - max(0.1 * (highest - lowest), 0.01 * side)


def base_of(points: NDArray[np.int64], edges: Ints) -> Ints:
    """Return triangles between loops of edges, without another vertex, (b, 3), counter-clockwise.

    Args:
        points: (n, 2) vertices on the lattice.
        edges: (k, 2) indices of points; what is to be covered lies on one side of each.
    """
    if not len(edges):
        return np.empty((0, 3), np.int32)
    used, index = np.unique(edges, return_inverse=True)
    _, triangles, _ = delaunay(points[used].astype(np.float64), index.reshape(-1, 2), within=True)
    return used[triangles].astype(np.int32)
