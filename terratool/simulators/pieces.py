"""The mesh of a scene as files: one for each surface."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from terratool.mesh.formats.common import (
    SurfacePart,
    ascii_word,
    plain_names,
    points_of,
    shape_of,
)
from terratool.mesh.formats.obj import write_obj
from terratool.mesh.types import CornerNormals, Mesh
from terratool.simulators.scene import Material, Scene


def write_pieces(scene: Scene, folder: Path) -> list[tuple[Material, str]]:
    """Write an OBJ with normals for each surface, with vertices of its own.

    Coordinates are those of the mesh: `scene.offset` brings them to where they belong.

    Returns:
        the material of each surface, and the name of its file.
    """
    materials = [scene.material(part.surface) for part in scene.parts]
    files = file_names(materials, "obj")
    for part, one, file in zip(scene.parts, materials, files, strict=True):
        write_obj(_piece(scene.mesh, part, one), folder / file, scene.terrain.descr)
    return list(zip(materials, files, strict=True))


def file_names(materials: Iterable[Material], ending: str) -> list[str]:
    """A file for each material; some systems take Sand.obj and sand.obj for one."""
    names = plain_names([one.word.lower() for one in materials], ascii_word, "surface")
    return [f"{name}.{ending}" for name in names]


def _piece(mesh: Mesh, part: SurfacePart, one: Material) -> Mesh:
    """The faces of one surface as a mesh."""
    vertices, faces = shape_of(points_of(mesh), part)
    normals = None
    if mesh.normals and part.normals is not None:
        own = replace(part, faces=part.normals)
        normals = CornerNormals(*shape_of(mesh.normals.directions, own))
    named = part.surface >= 0
    return Mesh(
        vertices=vertices.astype(np.float64),
        faces=faces,
        surfaces=np.full(len(faces), 0 if named else -1, np.int32),
        walls=np.zeros(len(faces), np.bool_),
        origin=mesh.origin,
        names=(part.name,) if named else (),
        colors=np.array([one.color] if named else [], np.uint8).reshape(-1, 3),
        frictions=np.array([one.friction] if named else []),
        normals=normals,
    )
