"""A mesh becomes a file, without edges that float32 cannot tell from a point."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.mesh.formats.common import points_of
from terratool.mesh.formats.table import FORMATS, MeshFormat, mesh_format
from terratool.mesh.types import BuiltMesh, Mesh
from terratool.output import refuse_existing, refuse_missing_folder, whole_file


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


def write_mesh(
    mesh: Mesh,
    path: str | Path,
    overwrite: bool = False,
    descr: str = "",
    world: bool = False,
) -> tuple[Path, ...]:
    """Write a mesh in the format that the suffix of `path` names; returns the files, it first.

    All formats hold the same float32 coordinates relative to the origin of the mesh, and say what
    the origin is.

    Args:
        mesh: at least one face.
        path: the file that is to be.
        overwrite: whether it may be there already.
        descr: what the terrain is, in words.
        world: whether coordinates are those of the world, in float64.

    Raises:
        RequestError: no format has that suffix, or it cannot hold this mesh.
        WriteError: `path` exists and is not to be overwritten, or its folder cannot be written.
    """
    path = Path(os.path.realpath(path))
    form = check_request(path, overwrite, world)
    if not len(mesh.faces):
        raise RequestError(f"{path.name}: there is no ground to be written.")
    with np.errstate(over="ignore"):
        finite = np.isfinite(points_of(mesh)).all()
    if not finite:
        raise RequestError(f"{path.name}: some coordinates are no numbers, or beyond float32.")
    write = form.write_world if world and form.write_world else form.write
    with whole_file(path, overwrite, form.companions) as part:
        write(mesh, part, descr)
    return path, *(path.with_suffix(suffix) for suffix in form.companions)


def check_request(path: str | Path, overwrite: bool = False, world: bool = False) -> MeshFormat:
    """Refuse what can be known to fail before there is a mesh; returns the format.

    Args:
        path: the file that is to be.
        overwrite: whether it may be there already.
        world: whether coordinates are those of the world.

    Raises:
        RequestError: no format has that suffix, it cannot hold coordinates of the world, or what
            it needs is not installed.
        WriteError: `path` exists and is not to be overwritten, or its folder does not exist.
    """
    path = Path(os.path.realpath(path))
    form = mesh_format(path)
    if world and form.write_world is None:
        able = ", ".join(suffix for suffix, one in FORMATS.items() if one.write_world)
        raise RequestError(
            f"{path.name}: numbers of this format are too short for coordinates of the world.",
            f"Ask for one of {able}, or for a mesh near 0.",
        )
    if form.package and find_spec(form.module) is None:
        raise RequestError(
            f"{path.name}: {form.package} is not installed.",
            f"Run pip install 'terratool[{form.extra}]'.",
        )
    refuse_existing(path, overwrite, form.companions)
    refuse_missing_folder(path)
    return form


def rounding_of(mesh: Mesh) -> float:
    """How far a coordinate of a file is from that of the mesh, at most."""
    return float(np.abs(points_of(mesh) - mesh.vertices).max())
