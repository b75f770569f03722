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
    surface_parts,
)
from terratool.mesh.formats.obj import write_obj
from terratool.mesh.types import CornerNormals, Mesh
from terratool.report.wording import count_of, join_words
from terratool.simulators.level_solids import MOST_SOLIDS, LevelSolid
from terratool.simulators.naming import ContactNames
from terratool.simulators.scene import Material, Scene
from terratool.simulators.uncovered import uncovered

CONTACTS = "collision"
"""Folder of meshes that collide, where these are not those that are seen."""
_SOLIDS = (
    "Level ground and level decks collide as boxes and cylinders, with the friction of their"
    f" surface. What is left of a mesh then is in the folder `{CONTACTS}`; what is seen is the"
    " whole of it. Boxes may go on under higher ground."
)
_FULL = (
    f"There are {MOST_SOLIDS:,} boxes and cylinders at most, for the largest level ground; the"
    " rest of it is left to meshes."
)


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


class NamedSolid(NamedTuple):
    """A box or cylinder with the name of its collision.

    Attributes:
        name: name in the files, different from those of others.
        shape: box or cylinder, in the coordinates of the mesh.
    """

    name: str
    shape: LevelSolid

    def center(self, scene: Scene) -> tuple[float, float, float]:
        """Return the place of the middle in the files."""
        x, y, z = np.add(scene.offset, self.shape.center).tolist()
        return x, y, z


class SurfaceContact(NamedTuple):
    """Files and solids of a surface, to be seen and to collide.

    Attributes:
        material: figures of the surface.
        name: begin of the names of what it has.
        seen: file of the mesh that is seen.
        file: file of the mesh that collides; None where solids stand for all of it.
        solids: boxes and cylinders.
    """

    material: Material
    name: str
    seen: str
    file: str | None
    solids: list[NamedSolid]


class Contacts(NamedTuple):
    """Meshes, boxes and cylinders that collide, by surface.

    Attributes:
        surfaces: each surface.
        boxes: number of boxes.
        cylinders: number of cylinders.
        faces: number of faces of meshes that collide.
        meshed: share of the ground that is left to meshes, walls and undersides apart, 0 to 1.
    """

    surfaces: list[SurfaceContact]
    boxes: int
    cylinders: int
    faces: int
    meshed: float

    @property
    def summary(self) -> str:
        """Meshes, boxes and cylinders in a few words."""
        kinds = ((self.boxes, "box"), (self.cylinders, "cylinder"))
        words = [count_of(count, kind) for count, kind in kinds if count]
        if self.faces:
            words.append(f"meshes of {count_of(self.faces, 'face')}")
        return join_words(words)

    @property
    def reduced(self) -> bool:
        """Whether there are solids."""
        return self.boxes + self.cylinders > 0

    @property
    def facts(self) -> dict[str, object]:
        """Figures for programs."""
        return {"boxes": self.boxes, "cylinders": self.cylinders, "meshed": self.meshed}

    @property
    def losses(self) -> tuple[str, ...]:
        """Sentence on level ground that is left to meshes; none where no more was to be had."""
        return (_FULL,) * (self.boxes + self.cylinders >= MOST_SOLIDS)

    @property
    def note(self) -> tuple[str, ...]:
        """Paragraph on solids; none without any."""
        return (_SOLIDS,) * self.reduced


def write_contacts(scene: Scene, folder: Path) -> Contacts:
    """Write an OBJ for each surface that is seen, and of what is left of it where that is less."""
    pieces = write_pieces(scene, folder)
    left = uncovered(scene.mesh, scene.level_solids, scene.options.max_error)
    parts = {part.surface: part for part in surface_parts(left)}
    named = _named(scene)
    found = []
    for part, (one, seen) in zip(scene.parts, pieces, strict=True):
        solids = [own for own in named if own.shape.surface == part.surface]
        own, file = parts.get(part.surface), None
        if not solids and own is not None:
            file = seen
        elif own is not None:
            (folder / CONTACTS).mkdir(exist_ok=True)
            file = f"{CONTACTS}/{seen}"
            write_obj(_piece(left, own, one), folder / file, scene.terrain.descr)
        found.append(SurfaceContact(one, f"{scene.name}/{one.word}", seen, file, solids))
    cylinders = sum(shape.is_round for shape in scene.level_solids)
    boxes = len(scene.level_solids) - cylinders
    whole = _ground_area(scene.mesh)
    return Contacts(found, boxes, cylinders, len(left.faces), _ground_area(left) / whole)


def _named(scene: Scene) -> list[NamedSolid]:
    """Return the solids of a scene with their names, by the elements that their tops are of."""
    shapes = scene.level_solids
    places = [np.array([(*shape.seen, shape.top)]) for shape in shapes]
    names = ContactNames(scene).at([shape.surface for shape in shapes], places)
    return [NamedSolid(*pair) for pair in zip(names, shapes, strict=True)]


def _ground_area(mesh: Mesh) -> float:
    """Return the area of the faces of a mesh that look up and are no walls."""
    corners = mesh.vertices[mesh.faces[~mesh.walls]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * float(np.linalg.norm(normals[normals[:, 2] > 0.0], axis=1).sum())


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
