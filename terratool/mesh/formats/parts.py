"""A mesh by its surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terratool.kernels import mesh as kernels
from terratool.mesh.types import Mesh

NO_COLOR = (128, 128, 128)
"""Colour of faces without a surface."""

NO_NAME = "none"
"""Name of what is made of them, where there must be one."""


@dataclass(frozen=True, slots=True)
class SurfacePart:
    """The faces of one surface, at least one.

    Attributes:
        surface: index into the names of the mesh; -1 for none.
        name: of the surface, as in the definition; `NO_NAME` for none.
        color: of the surface.
        faces: (m, 3) int32 indices of vertices of the mesh.
    """

    surface: int
    name: str
    color: tuple[int, int, int]
    faces: NDArray[np.int32]


def points_of(mesh: Mesh) -> NDArray[np.float32]:
    """Vertices as all files have them: (n, 3) float32, relative to the origin of the mesh."""
    return np.ascontiguousarray(mesh.vertices, np.float32)


def world_points_of(mesh: Mesh) -> NDArray[np.float64]:
    """The same vertices where they are in the world: (n, 3) float64."""
    return points_of(mesh) + mesh.origin


def surface_parts(mesh: Mesh) -> list[SurfacePart]:
    """A mesh by its surfaces, in their order; what has none comes last."""
    count = len(mesh.names)
    # -1 is the last of so many
    places = np.where(mesh.surfaces < 0, np.int32(count), mesh.surfaces)
    counts = np.bincount(places, minlength=count + 1)
    ends = np.cumsum(counts)
    faces = mesh.faces
    if np.count_nonzero(counts) > 1:
        faces = kernels.sort_faces(faces, places, counts)
    parts = []
    for place in range(count + 1):
        own = faces[ends[place] - counts[place] : ends[place]]
        if not len(own):
            continue
        if place == count:
            parts.append(SurfacePart(-1, NO_NAME, NO_COLOR, own))
        else:
            red, green, blue = mesh.colors[place].tolist()
            parts.append(SurfacePart(place, mesh.names[place], (red, green, blue), own))
    return parts


def shape_of(
    points: NDArray[np.float32], part: SurfacePart
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """A part with vertices of its own, (n, 3), and faces of these, (m, 3).

    Programs that take parts for separate meshes copy all vertices that a part can see.
    """
    return kernels.take_vertices(points, part.faces)


def face_colors(mesh: Mesh) -> NDArray[np.uint8]:
    """Colour of each face, (m, 3)."""
    # -1 is the last one
    table = np.concatenate([mesh.colors.reshape(-1, 3), np.array([NO_COLOR], np.uint8)])
    return table[mesh.surfaces]
