"""Edges that float32 cannot tell from a point are taken out of a mesh before it becomes a file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from terratool.mesh.formats.parts import points_of
from terratool.mesh.types import BuiltMesh, Mesh


def collapse_degenerate(built: BuiltMesh) -> BuiltMesh:
    """The same with one vertex, not two, for the ends of each edge that has no length in a file.

    Faces along such an edge are left out, so that a closed mesh stays closed. Vertices that lie at
    the same place and share no edge stay apart.
    """
    mesh = built.mesh
    roots = _roots(mesh)
    if roots is None:
        return built
    faces = roots[mesh.faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    used = np.zeros(len(roots), bool)
    used[faces[kept]] = True
    index = np.cumsum(used, dtype=np.int32) - np.int32(1)
    mesh = replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=index[faces[kept]],
        surfaces=mesh.surfaces[kept],
        walls=mesh.walls[kept],
    )
    return replace(built, mesh=mesh, shell=int(kept[: built.shell].sum()))


def _roots(mesh: Mesh) -> NDArray[np.int32] | None:
    """For each vertex the one that stands for it; None if each stands for itself."""
    with np.errstate(over="ignore"):  # what is too large for a file is refused later
        points = points_of(mesh)
    points[~np.isfinite(points)] = np.nan
    ends = []
    for k in range(3):
        a, b = mesh.faces[:, k], mesh.faces[:, (k + 1) % 3]
        same = np.flatnonzero((points[a] == points[b]).all(axis=1))
        ends.append(np.column_stack([a[same], b[same]]))
    edges = np.concatenate(ends)
    if not len(edges):
        return None
    roots = np.arange(len(points), dtype=np.int32)
    while True:
        low = roots[edges].min(axis=1)
        before = roots.copy()
        np.minimum.at(roots, edges[:, 0], low)
        np.minimum.at(roots, edges[:, 1], low)
        roots = roots[roots]
        if np.array_equal(before, roots):
            return roots
