"""Binary PLY: faces have the colour of their surface, its number, and whether they are walls."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

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
    # a header is ASCII
    comments = [line.encode("ascii", "replace").decode() for line in descr.splitlines()]
    comments += [f"origin {'0 0 0' if world else origin_of(mesh)}", "z is up", "surface -1 is none"]
    comments += [f"surface {n} {json.dumps(name)}" for n, name in enumerate(mesh.names)]
    # some readers look for end_header anywhere
    comments = [line.replace("end_header", "end\\u005fheader") for line in comments]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {line}".rstrip() for line in comments),
        f"element vertex {len(mesh.vertices)}",
        *(f"property {'double' if world else 'float'} {axis}" for axis in "xyz"),
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        *(f"property uchar {shade}" for shade in ("red", "green", "blue")),
        "property int surface",
        "property uchar wall",
        "end_header",
    ]
    colors = face_colors(mesh)
    with open(path, "wb") as file:
        file.write("".join(f"{line}\n" for line in header).encode())
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
