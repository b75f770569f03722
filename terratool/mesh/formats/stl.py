"""Binary STL: triangles and their normals, without surfaces."""

from __future__ import annotations

import struct
from pathlib import Path

from terratool.kernels import mesh as kernels
from terratool.mesh.formats.common import origin_of, points_of
from terratool.mesh.types import Mesh

_HEADER_BYTES = 80
_BLOCK = 1 << 14


def write_stl(mesh: Mesh, path: Path, descr: str) -> None:
    """Write a binary STL, z up; the header holds the origin and as much of `descr` as fits."""
    # readers take a file that begins with "solid" for an STL of text
    header = f"STL, z up, origin {origin_of(mesh)}; {' '.join(descr.split())}".rstrip("; ")
    points = points_of(mesh)
    with open(path, "wb") as file:
        file.write(header.encode("ascii", "replace")[:_HEADER_BYTES].ljust(_HEADER_BYTES))
        file.write(struct.pack("<I", len(mesh.faces)))
        for begin in range(0, len(mesh.faces), _BLOCK):
            file.write(kernels.stl_faces(points, mesh.faces[begin : begin + _BLOCK]).data)
