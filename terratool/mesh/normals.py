"""Normals of a mesh: smooth where its terrain is smooth, creased where that is creased."""

from __future__ import annotations

from dataclasses import replace

from terratool.kernels import mesh as kernels
from terratool.mesh.types import BuiltMesh, CornerNormals, Mesh


def with_normals(built: BuiltMesh) -> Mesh:
    """Return the mesh of a terrain with normals at its corners.

    Faces around a vertex share a normal, the mean of all by area (H. Gouraud, Continuous shading of
    curved surfaces, IEEE Transactions on Computers C-20, 1971), unless an edge between them is a
    crease: where they turn by more than 45 degrees, or where a smooth surface could not turn so
    much without being farther from one of them than the mesh is from its terrain. Walls are flat.

    So a slope of 1:10 that meets level ground is creased where both are wide, and a dune of as many
    faces as its error needs is smooth, whatever angles these have.
    """
    mesh = built.mesh
    found = kernels.corner_normals(mesh.vertices, mesh.faces, mesh.walls, built.error)
    return replace(mesh, normals=CornerNormals(*found))
