"""Meshes as trimesh has them, for Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terratool.field.terrain import Terrain
from terratool.mesh.export import MeshOptions, fitted_mesh
from terratool.mesh.formats.common import NO_COLOR

if TYPE_CHECKING:
    import trimesh


def trimesh_of(terrain: Terrain, options: MeshOptions) -> trimesh.Trimesh:
    """Mesh of a terrain with walls, as trimesh has it, with its zero where the options have it.

    Its vertices are float64 and those that files get before they are rounded to float32. Faces
    have the colours of their surfaces. `face_attributes` has the arrays `surface`, int32, an index
    into `metadata["surfaces"]` or -1, and `wall`, bool. `metadata` has the reached `error`, too,
    and the world position of the mesh's zero, `origin`.

    Args:
        terrain: terrain to mesh.
        options: options of the mesh.

    Raises:
        RequestError: there is no ground, or an option makes no sense.
    """
    import trimesh

    fit = fitted_mesh(terrain, options).fit
    mesh = fit.built.mesh
    colors = np.array([*mesh.colors.tolist(), NO_COLOR], np.uint8)  # the last one is that of -1
    vertices, origin = mesh.vertices, mesh.origin
    if options.world:
        vertices, origin = vertices + origin, np.zeros(3)
    return trimesh.Trimesh(
        vertices=vertices,
        faces=mesh.faces,
        face_colors=colors[mesh.surfaces],
        face_attributes={"surface": mesh.surfaces, "wall": mesh.walls},
        metadata={
            "surfaces": mesh.names, "error": fit.built.error, "origin": tuple(origin.tolist()),
            "descr": terrain.descr, "crs": terrain.crs,
        },
        process=False,
    )  # fmt: skip
