"""Ground and walls put together, one vertex for each level; and what closes a mesh."""

from __future__ import annotations

from typing import Literal

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.field.terrain import Terrain
from terratool.kernels import mesh as kernels
from terratool.mesh.triangulate import delaunay
from terratool.mesh.types import Mesh, MeshPlan, RegionMesh

GREY = 160, 160, 160
"""The colour of surfaces that have none."""

Ints = NDArray[np.int32]


def assemble(
    terrain: Terrain,
    plan: MeshPlan,
    parts: RegionMesh,
    base: float | Literal["below"] | None = None,
) -> tuple[Mesh, int, float]:
    """Make a mesh of triangles in the plane and the one-sided heights at their corners.

    Args:
        terrain: the terrain.
        plan: its plan.
        parts: the triangles.
        base: see `build.build`.

    Raises:
        RequestError: the base does not lie below all ground.

    Returns:
        The mesh, the number of its faces that are ground or walls (skirt and base come after), and
        how far a height was moved at most because a wall would be too low.
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
        if base == "below":
            base = base_below(lowest, highest, plan.pitch * float(plan.bounds.max()))
        if not -np.inf < base < lowest - plan.rounding:
            raise RequestError(
                f"The base at {base:g} is not below the lowest ground of the mesh, which is at"
                f" {lowest:g}.",
                "Give a base that is lower.",
            )
        outer = outer_edges(neighbours, ground)
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
    mesh = Mesh(
        vertices=np.column_stack([points[place] * plan.pitch, levels[sources]]),
        faces=np.concatenate([faces, floor]),
        surfaces=np.append(surfaces, np.full(len(floor), -1, np.int32)),
        walls=np.repeat([False, True, False], [len(faces) - upright, upright, len(floor)]),
        origin=np.append(plan.origin, 0.0),
        names=terrain.surfaces,
        colors=np.array(
            [
                GREY if surface.color is UNSET else surface.color
                for surface in terrain.surface_types.values()
            ],
            np.uint8,
        ).reshape(-1, 3),
    )
    return mesh, len(faces) - len(skirt), found["moved"]


def base_below(lowest: float, highest: float, side: float) -> float:
    """Where a base lies if none is given, in units of the terrain.

    Below the lowest level by a tenth of the relief, and by no less than a hundredth of the longer
    side, so that flat ground becomes a plate.
    """
    return lowest - max(0.1 * (highest - lowest), 0.01 * side)


def outer_edges(neighbours: Ints, ground: NDArray[np.bool_]) -> Ints:
    """Edges that the ground ends at, at the hull or at the void.

    Args:
        neighbours: (m, 3) triangles beyond edges, -1 for none.
        ground: (m,) whether a triangle is ground.

    Returns:
        (k, 2) triangle, and which of its edges.
    """
    ends = ground[:, None] & ((neighbours < 0) | ~ground[neighbours])
    return np.argwhere(ends).astype(np.int32, order="C")


def base_of(points: NDArray[np.int64], edges: Ints) -> Ints:
    """Triangles between loops of edges, without another vertex: (b, 3), counter-clockwise.

    Args:
        points: (n, 2) on the lattice.
        edges: (k, 2) indices of points; what is to be covered lies on one side of each.
    """
    if not len(edges):
        return np.empty((0, 3), np.int32)
    used, index = np.unique(edges, return_inverse=True)
    _, triangles, _ = delaunay(points[used].astype(np.float64), index.reshape(-1, 2), within=True)
    return used[triangles].astype(np.int32)
