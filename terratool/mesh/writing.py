"""A mesh becomes a file."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from terratool.errors import RequestError
from terratool.mesh.formats.parts import points_of
from terratool.mesh.formats.table import FORMATS, MeshFormat, mesh_format
from terratool.mesh.types import Mesh
from terratool.output import refuse_existing, refuse_missing_folder, whole_file


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
