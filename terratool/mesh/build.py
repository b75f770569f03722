"""From a terrain to a mesh: the steps, in order."""

from __future__ import annotations

from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh import seams, walls
from terratool.mesh.plan import PlanOmissions, plan_of
from terratool.mesh.triangulate import Triangulation, regions_of, triangulate
from terratool.mesh.types import BuiltMesh, MeshPlan, Regions, TileBoundary

_PLANS = 3
"""Where discs overlap too much, their polygons are planned again, so often."""
_ASIDE = 0.6
"""Discs that overlap may take up so much of the error by being polygons."""
_ROUNDS = 8
"""Where edges were split because the higher side changes, triangles are refined again, so often."""
_BATCH = 200_000
"""So many triangles are looked at before others get their turn, such as who interrupts."""


class CoarseMesh(NamedTuple):
    """Triangles before they are refined.

    Attributes:
        plane: m triangles.
        parts: the regions.
        of: (m,) int32, the region of each triangle.
        heights: (m, 3) float64, one-sided, at their corners.
    """

    plane: Triangulation
    parts: Regions
    of: NDArray[np.int32]
    heights: NDArray[np.float64]


def build(
    terrain: Terrain,
    max_error: float,
    bounds: tuple[float, float, float, float] | None = None,
    least: float = 0.0,
    base: float | Literal["below"] | None = None,
) -> BuiltMesh:
    """Mesh a terrain, with walls where its height jumps.

    With a base the mesh is closed, a solid: a skirt leads from where the ground ends, at the rim
    and at the void, down to the base. Every edge has two faces; for that some vertices lie at the
    same place, and whoever merges vertices by place, as one who reads an STL file must, has edges
    with four faces and more again. So has a mesh without a base, where its walls meet.

    Args:
        terrain: the terrain.
        max_error: the largest distance, along z, of the mesh from the terrain, in its units.
        bounds: world rectangle west, south, east, north to mesh; the whole terrain if None.
        least: elements that change heights by no more are left out, unless it is 0.
        base: height of the base, in units of the terrain; "below" for `solid.base_below`.

    Raises:
        ValueError: the error is not positive, or the bounds hold nothing of the terrain.
        RequestError: the base does not lie below all ground that is meshed.
    """
    finer = 1.0
    for _ in range(_PLANS):
        plan, left = plan_of(terrain, max_error, bounds, least, finer)
        drawn = kernels.segments_of(plan.kept, np.flatnonzero(plan.frames["drawn"]))
        arranged = coarse_mesh(plan, drawn, seams.NO_SEAMS)
        most = float(arranged.parts.asides.max(initial=0.0))
        if most <= _ASIDE * max_error:
            break
        finer *= 0.5 * _ASIDE * max_error / most  # many discs overlap
    return assemble_mesh(terrain, plan, left, arranged, seams.NO_SEAMS, base)


def build_part(
    terrain: Terrain,
    plan: MeshPlan,
    left: PlanOmissions,
    drawn: NDArray[np.int64],
    rim: TileBoundary,
    bounds: NDArray[np.int64],
) -> BuiltMesh:
    """Mesh a part of what a plan is for.

    Args:
        terrain: the terrain.
        plan: its plan.
        left: what that leaves out.
        drawn: (n, 4) int64 segments within the part.
        rim: what its sides have in common with other meshes.
        bounds: (4,) west, south, east, north of the part on the lattice.
    """
    return assemble_mesh(terrain, plan, left, coarse_mesh(plan, drawn, rim, bounds), rim)


def assemble_mesh(
    terrain: Terrain,
    plan: MeshPlan,
    left: PlanOmissions,
    arranged: CoarseMesh,
    rim: TileBoundary,
    base: float | Literal["below"] | None = None,
) -> BuiltMesh:
    """Refine what is arranged, and put the mesh together; arguments as above."""
    plane, parts, of, heights = arranged
    plane, of, heights, error = refine(plan, parts, plane, of, heights, rim.sides)
    mesh, shell, moved = walls.assemble(terrain, plan, plane, parts, of, heights, base)
    return BuiltMesh(mesh, shell, error + moved, *left)


def coarse_mesh(
    plan: MeshPlan,
    drawn: NDArray[np.int64],
    rim: TileBoundary,
    bounds: NDArray[np.int64] | None = None,
) -> CoarseMesh:
    """Triangles whose edges follow segments, the regions, and the region of each triangle.

    Beside a seam it is the region that holds along the seam, as in the tile beyond. Bounds on the
    lattice may be narrower than those of the plan.
    """
    if bounds is None:
        bounds = plan.bounds.astype(np.int64)
    keys_of = partial(kernels.keys_of, plan.kept)
    plane, keys = triangulate(drawn, bounds, keys_of, rim)
    ends = rim.edges.reshape(-1, 2)
    first = 2 * np.arange(len(rim.edges), dtype=np.int32)
    along = np.column_stack([first, first, first + 1])  # their middles lie on the seams
    own = keys_of(ends, along)
    beside, corner = seams.boundary_triangles(plane, rim)
    keys[beside] = own
    points = np.concatenate([ends, plane.points])
    triangles = np.concatenate([along, plane.triangles + np.int32(len(ends))])
    parts, of = regions_of(plan, points, triangles, np.concatenate([own, keys]))
    of = of[len(along) :]
    heights = kernels.corner_heights(plan.kept, parts, plane.points, plane.triangles, of)
    seams.pin_heights(plane, rim, beside, corner, parts.voids[of], heights)
    return CoarseMesh(plane, parts, of, heights)


def refine(
    plan: MeshPlan,
    parts: Regions,
    plane: Triangulation,
    of: NDArray[np.int32],
    heights: NDArray[np.float64],
    locked: NDArray[np.int64],
) -> tuple[Triangulation, NDArray[np.int32], NDArray[np.float64], float]:
    """Refine triangles until they are within the error; split edges where the higher side changes.

    Takes and returns triangles, the region of each, and the one-sided heights at their corners;
    returns also the largest error that there may be. `locked` are the seams, as in `Rim.sides`.
    """
    work = kernels.Refinement(plan.kept, parts, plane, of, heights, locked)
    tolerance = walls.tolerance_of(plan)
    for _ in range(_ROUNDS):
        while kernels.refine(work, plan.error - tolerance, _BATCH):
            pass
        if not kernels.part_crossings(work, tolerance):
            break
    level = parts.asides[parts.plane & ~parts.voids].max(initial=0.0)
    error = max(kernels.largest_error(work), float(level))
    points, triangles, neighbours, of, heights = kernels.take(work)
    return Triangulation(points, triangles, neighbours), of, heights, error
