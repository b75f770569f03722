"""File formats of meshes by suffix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from terratool.errors import RequestError
from terratool.extras import install_command
from terratool.mesh.formats.glb import write_glb
from terratool.mesh.formats.obj import write_obj
from terratool.mesh.formats.ply import write_ply
from terratool.mesh.formats.stl import write_stl
from terratool.mesh.formats.usd import write_usd
from terratool.mesh.formats.vrml import write_vrml
from terratool.mesh.formats.x3d import write_x3d
from terratool.mesh.types import Mesh


@dataclass(frozen=True, slots=True)
class MeshFormat:
    """A file format of meshes.

    Attributes:
        write: function that writes a mesh and a description to a file.
        write_world: function that writes coordinates of the world, in float64; None where the
            format cannot keep them.
        companions: suffixes of the files that are written beside.
        surfaces: whether a file says which faces belong to which surface.
        normals: whether a file has the normals of a mesh, if the mesh has any.
        module, package, extra: module that has to be installed, its package, and the extra of
            terratool that has it; empty for nothing.
    """

    write: Callable[[Mesh, Path, str], None]
    write_world: Callable[[Mesh, Path, str], None] | None = None
    companions: tuple[str, ...] = ()
    surfaces: bool = True
    normals: bool = False
    module: str = ""
    package: str = ""
    extra: str = ""


_USD = MeshFormat(write_usd, module="pxr", package="usd-core", extra="usd")

FORMATS = {
    ".obj": MeshFormat(
        write_obj, partial(write_obj, world=True), companions=(".mtl",), normals=True
    ),
    ".wrl": MeshFormat(write_vrml),
    ".glb": MeshFormat(write_glb),
    ".stl": MeshFormat(write_stl, surfaces=False),
    ".ply": MeshFormat(write_ply, partial(write_ply, world=True)),
    ".x3d": MeshFormat(write_x3d),
    ".usdc": _USD,
    ".usda": _USD,
}


def mesh_format(path: Path, world: bool = False) -> MeshFormat:
    """Return the format of a file by its suffix.

    Args:
        path: file to write.
        world: whether coordinates are those of the world.

    Raises:
        RequestError: no format has the suffix, the format cannot hold coordinates of the world, or
            a package is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise RequestError(
            f"{path.name}: no mesh format has the suffix {suffix!r}."
            if suffix
            else f"{path.name}: has no suffix, so its format is unknown.",
            f"Try {', '.join(FORMATS)}.",
        )
    form = FORMATS[suffix]
    if world and form.write_world is None:
        able = ", ".join(suffix for suffix, one in FORMATS.items() if one.write_world)
        raise RequestError(
            f"{path.name}: numbers of this format are too short for coordinates of the world.",
            f"Ask for one of {able}, or for a mesh near 0.",
        )
    if form.package and find_spec(form.module) is None:
        raise RequestError(
            f"{path.name}: {form.package} is not installed.",
            f"Run {install_command(form.extra)}",
        )
    return form
