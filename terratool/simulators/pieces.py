"""The mesh of a scene as files, one for each surface."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from terratool.mesh.formats.common import (
    SurfacePart,
    is_ascii_word,
    plain_names,
    points_of,
    shape_of,
)
from terratool.mesh.formats.obj import write_obj
from terratool.mesh.types import CornerNormals, Mesh
from terratool.simulators.boxes import CONTACTS, faces_on
from terratool.simulators.collision.solids import PlanRectangle
from terratool.simulators.scene import Material, Scene


def write_pieces(scene: Scene, folder: Path) -> list[tuple[Material, str]]:
    """Write an OBJ with normals for each surface, with vertices of its own.

    Coordinates are those of the mesh; `scene.offset` moves them to their place in the files.

    Returns:
        Material and file name of each surface.
    """
    materials = [scene.material(part.surface) for part in scene.parts]
    files = file_names(materials, "obj")
    for part, one, file in zip(scene.parts, materials, files, strict=True):
        write_obj(_piece(scene.mesh, part, one), folder / file, scene.terrain.descr)
    return list(zip(materials, files, strict=True))


class SurfaceContact(NamedTuple):
    """Mesh and boxes of a surface that collide.

    Attributes:
        file: mesh; None where boxes stand for all of its faces.
        boxes: exact boxes of level decks, in the coordinates of the mesh.
    """

    file: str | None
    boxes: list[PlanRectangle]


def write_contacts(
    scene: Scene, folder: Path, pieces: list[tuple[Material, str]]
) -> list[SurfaceContact]:
    """Write an OBJ without the faces of boxes for each surface that has such.

    Returns:
        What collides of each of the surfaces that `write_pieces` has returned.
    """
    on = faces_on(scene.mesh, [box for _, box in scene.boxes], scene.options.max_error)
    found = []
    for part, (one, file) in zip(scene.parts, pieces, strict=True):
        boxes = [box for surface, box in scene.boxes if surface == part.surface]
        own = np.flatnonzero(scene.mesh.surfaces == part.surface)
        kept = ~on[own]
        if kept.all():
            found.append(SurfaceContact(file, boxes))
        elif not kept.any():
            found.append(SurfaceContact(None, boxes))
        else:
            (folder / CONTACTS).mkdir(exist_ok=True)
            # Gazebo reads no mesh without normals
            normals = None if part.normals is None else part.normals[kept]
            left = replace(part, faces=part.faces[kept], normals=normals)
            write_obj(_piece(scene.mesh, left, one), folder / CONTACTS / file, scene.terrain.descr)
            found.append(SurfaceContact(f"{CONTACTS}/{file}", boxes))
    return found


def file_names(materials: Iterable[Material], ending: str) -> list[str]:
    """Return a file name for each material, in lower case, as some systems ignore the case."""
    names = plain_names([one.word.lower() for one in materials], is_ascii_word, "surface")
    return [f"{name}.{ending}" for name in names]


def _piece(mesh: Mesh, part: SurfacePart, one: Material) -> Mesh:
    """Return the faces of one surface as a mesh."""
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
