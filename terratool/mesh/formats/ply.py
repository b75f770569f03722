"""Binary PLY: faces have the colour of their surface, its number, and whether they are walls."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terratool.io.ply import name_comments, ply_header
from terratool.mesh.formats.common import face_colors, origin_of, points_of, world_points_of
from terratool.mesh.types import Mesh

_FACE = np.dtype(
    [("count", "u1"), ("corners", "<i4", 3), ("color", "u1", 3), ("surface", "<i4"), ("wall", "u1")]
)
_BLOCK = 1 << 14


def write_ply(mesh: Mesh, path: Path, descr: str, world: bool = False) -> None:
    """Write a binary PLY, z up; its comments hold the origin and the names of the surfaces.

    Coordinates of the `world` are of type double.
    """
    comments = descr.splitlines()
    comments += [f"origin {'0 0 0' if world else origin_of(mesh)}", "z is up", "surface -1 is none"]
    comments += name_comments(mesh.names)
    axes = [f"{'double' if world else 'float'} {axis}" for axis in "xyz"]
    shades = [f"uchar {shade}" for shade in ("red", "green", "blue")]
    face = ["list uchar int vertex_indices", *shades, "int surface", "uchar wall"]
    elements = [("vertex", len(mesh.vertices), axes), ("face", len(mesh.faces), face)]
    colors = face_colors(mesh)
    with open(path, "wb") as file:
        file.write(ply_header(comments, elements))
        points = world_points_of(mesh) if world else points_of(mesh)
        file.write(points.astype(points.dtype.newbyteorder("<"), copy=False).data)
        for begin in range(0, len(mesh.faces), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            rows = np.empty(len(mesh.faces[block]), _FACE)
            rows["count"] = 3
            rows["corners"] = mesh.faces[block]
            rows["color"] = colors[block]
            rows["surface"] = mesh.surfaces[block]
            rows["wall"] = mesh.walls[block]
            file.write(rows.data)
