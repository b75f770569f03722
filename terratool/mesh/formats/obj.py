"""Wavefront OBJ, with the materials in an MTL beside it."""

from __future__ import annotations

from pathlib import Path

from terratool.mesh.formats.common import (
    color_text,
    lines_of,
    origin_of,
    points_of,
    surface_parts,
    world_points_of,
    write_faces,
    write_points,
)
from terratool.mesh.types import Mesh
from terratool.report.documents import json_text


def write_obj(mesh: Mesh, path: Path, descr: str, world: bool = False) -> None:
    """Write an OBJ and its MTL: one group and one material per surface, z up, normals if any.

    Names are words of letters, digits, `_`, `-` and `.`, since neither file can quote; the true
    names stand in comments. Coordinates of the `world` have 15 digits.
    """
    materials = path.with_suffix(".mtl")
    parts = surface_parts(mesh, _fits_name)
    with open(path, "wb") as file:
        for line in lines_of(descr):
            file.write(f"# {line}\n".encode())
        file.write(f"# origin {'0 0 0' if world else origin_of(mesh)}\n# z is up\n".encode())
        file.write(f"mtllib {materials.name}\n".encode())
        write_points(file, world_points_of(mesh) if world else points_of(mesh), b"v ")
        if mesh.normals:
            write_points(file, mesh.normals.directions, b"vn ")
        for part in parts:
            if part.surface >= 0:
                file.write(f"# surface {json_text(part.name)}\n".encode())
            file.write(f"g {part.word}\nusemtl {part.word}\n".encode())
            write_faces(file, part.faces, 1, b"f ", normals=part.normals)
    with open(materials, "wb") as file:
        for part in parts:
            if part.surface >= 0:
                file.write(f"# surface {json_text(part.name)}\n".encode())
            color = color_text(part.color)
            file.write(f"newmtl {part.word}\nKa {color}\nKd {color}\nKs 0 0 0\nillum 1\n".encode())


def _fits_name(character: str) -> bool:
    """Whether a character may stand in the name of a group or a material."""
    return character.isalnum() or character in "_-."
