"""Binary glTF 2.0."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terratool.errors import RequestError
from terratool.mesh.formats.common import (
    SurfacePart,
    encodable_text,
    linear_color,
    points_of,
    shape_of,
    surface_parts,
)
from terratool.mesh.types import Mesh

_FLOAT, _UNSIGNED = 5126, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_LIMIT = 1 << 32


def write_glb(mesh: Mesh, path: Path, descr: str) -> None:
    """Write a GLB: one mesh, one primitive and one material per surface, y up.

    A point (x, y, z) of the mesh is (x, z, -y) in the file. There are no normals, so that viewers
    shade each face flat. The extras of the asset hold the origin, in the axes of the mesh (those of
    a node may be no lists for assimp).

    Raises:
        RequestError: the file would be larger than 4 GB.
    """
    arrays: list[NDArray[Any]] = []
    views: list[dict[str, object]] = []
    accessors: list[dict[str, object]] = []
    primitives: list[dict[str, object]] = []
    materials: list[dict[str, object]] = []
    size = 0

    def add(array: NDArray[Any], target: int, accessor: dict[str, object]) -> int:
        """Append an array; return the number of its accessor."""
        nonlocal size
        arrays.append(array)
        views.append(
            {"buffer": 0, "byteOffset": size, "byteLength": array.nbytes, "target": target}
        )
        accessors.append({"bufferView": len(views) - 1, **accessor})
        size += array.nbytes
        return len(accessors) - 1

    points = points_of(mesh)
    turned = np.empty(points.shape, np.float32)
    turned[:, 0], turned[:, 1] = points[:, 0], points[:, 2]
    turned[:, 2] = 0 - points[:, 1]  # unlike minus, this makes no -0
    for part in surface_parts(mesh):
        own, faces = shape_of(turned, part)
        position = add(
            own.astype("<f4", copy=False),
            _ARRAY_BUFFER,
            {
                "componentType": _FLOAT,
                "count": len(own),
                "type": "VEC3",
                "min": own.min(axis=0).astype(np.float64).tolist(),
                "max": own.max(axis=0).astype(np.float64).tolist(),
            },
        )
        indices = add(
            faces.view(np.uint32).astype("<u4", copy=False),
            _ELEMENT_ARRAY_BUFFER,
            {"componentType": _UNSIGNED, "count": faces.size, "type": "SCALAR"},
        )
        primitives.append(
            {
                "attributes": {"POSITION": position},
                "indices": indices,
                "material": len(materials),
                "mode": 4,
            }
        )
        materials.append(_material(part))
    extras: dict[str, object] = {"origin": mesh.origin.tolist(), "axes": "x, z, -y"}
    if descr:
        extras["description"] = encodable_text(descr)
    text = {
        "asset": {"version": "2.0", "generator": "terratool", "extras": extras},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "terrain", "mesh": 0}],
        "meshes": [{"name": "terrain", "primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": size}],
    }
    head = json.dumps(text, separators=(",", ":")).encode()
    head += b" " * (-len(head) % 4)
    total = 12 + 8 + len(head) + 8 + size
    if total >= _LIMIT:
        raise RequestError(
            f"{path.name}: a .glb holds 4 GB at most, and this would be {total / 1e9:.1f}.",
            "Ask for a .ply instead, or for a larger error.",
        )
    with open(path, "wb") as file:
        file.write(struct.pack("<4sIIII", b"glTF", 2, total, len(head), 0x4E4F534A))
        file.write(head)
        file.write(struct.pack("<II", size, 0x004E4942))
        for array in arrays:
            file.write(array.data)


def _material(part: SurfacePart) -> dict[str, object]:
    """Return a material of glTF: dull, in the colour of the surface, seen from both sides."""
    return {
        "name": encodable_text(part.name),
        "pbrMetallicRoughness": {
            "baseColorFactor": [*(round(shade, 6) for shade in linear_color(part.color)), 1],
            "metallicFactor": 0,
            "roughnessFactor": 1,
        },
        "doubleSided": True,
        "extras": {"surface": part.surface},
    }
