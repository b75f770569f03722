"""Reader of the triangles of a 3MF, in metres.

A 3MF is an archive of XML files in which objects consist of objects (3MF Core Specification 1.3);
parts in files of their own follow its Production Extension.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.types import Triangles, join_triangles, refuse_many_faces
from terratool.io.expat import hardened_parser
from terratool.text.files import open_file
from terratool.text.packing import PackingError, refuse_members

_PART = 100
"""Faces that an object counts for, besides its own, as each takes time."""
_PIECE, _LARGEST = 1 << 16, 1 << 26
"""Bytes of the first piece of XML that is parsed, and of the largest; pieces double in between."""
_METRES = {
    "micron": ("micrometres", 1e-6),
    "millimeter": ("millimetres", 0.001),
    "centimeter": ("centimetres", 0.01),
    "inch": ("inches", 0.0254),
    "foot": ("feet", 0.3048),
    "meter": ("metres", 1.0),
}
"""Names of units in words, and their lengths in metres (section 3.4)."""

_PATH = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06 path"
Key = tuple[str, str]
"""File of an object in the archive, and the object's id there."""

Matrix = NDArray[np.float64]
"""Transformation, (4, 3) float64: a row x, y, z, 1 is multiplied by it from the left (section 3.3).
"""


@dataclass(frozen=True, slots=True)
class _Placement:
    """An object and its transformation."""

    key: Key
    matrix: Matrix


@dataclass(frozen=True, slots=True)
class _Object:
    """A mesh as flat lists of coordinates and vertex indices, and other objects as components."""

    points: list[float] = field(default_factory=list)
    corners: list[int] = field(default_factory=list)
    components: list[_Placement] = field(default_factory=list)


@dataclass(slots=True)
class _Model:
    """Objects, items to build and unit of an archive."""

    objects: dict[Key, _Object]
    items: list[_Placement]
    unit: str = "millimeter"


def read_3mf(path: Path) -> Triangles:
    """Read the triangles of all items to build, each in its place, in metres.

    Raises:
        ReadError: the archive is too large, an object contains itself or is missing, or there are
            too many faces.
        Exception: any error of zipfile and expat where the file is no 3MF.
    """
    with open_file(path) as file, zipfile.ZipFile(file) as archive:
        names = [name for name in archive.namelist() if name.lower().endswith(".model")]
        try:
            refuse_members(archive, archive.namelist(), path.stat().st_size)
        except PackingError as error:
            raise ReadError(f"{path}: {error.message}", error.hint) from error
        first = min(names, key=lambda name: not name.lower().endswith("3d/3dmodel.model"))
        model = _Model({}, [])
        pending, seen = [first], {first}
        while pending:
            name = pending.pop()
            with archive.open(name) as member:
                _parse(member, name, model, main=name == first)
            for key in [part.key for item in model.objects.values() for part in item.components]:
                if key[0] not in seen:
                    seen.add(key[0])
                    pending.append(key[0])
    if model.unit not in _METRES:
        raise ReadError(f"{path}: {model.unit!r} is no unit of 3MF.", "Export it again.")
    unit, factor = _METRES[model.unit]
    sizes: dict[Key, int] = {}
    refuse_many_faces(path, sum(_size(item.key, model, sizes, path) for item in model.items))
    meshes = {
        key: (np.array(item.points).reshape(-1, 3), np.array(item.corners, np.int32).reshape(-1, 3))
        for key, item in model.objects.items()
    }

    def place(placed: _Placement) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        points, faces = meshes[placed.key]
        return points @ placed.matrix[:3] + placed.matrix[3], faces

    joined = join_triangles(map(place, _spread(model.items, model)), path)
    if factor == 1.0:
        return joined
    notes = (f"The file is in {unit}; metres were made of them.",)
    return Triangles(joined.vertices * factor, joined.faces, notes)


def _spread(items: list[_Placement], model: _Model) -> Iterator[_Placement]:
    """Yield all objects with a mesh, in order, each as often as it is placed."""
    for item in items:
        own = model.objects[item.key]
        if own.corners:
            yield item
        for part in _spread(own.components, model):
            matrix = part.matrix @ item.matrix[:3]
            matrix[3] += item.matrix[3]
            yield _Placement(part.key, matrix)


def _size(key: Key, model: _Model, sizes: dict[Key, int], path: Path) -> int:
    """Number of faces of an object with its components, plus `_PART` for the time of each object.

    Raises:
        ReadError: the object contains itself, or is missing.
    """
    if key not in sizes:
        if key not in model.objects:
            raise ReadError(f"{path}: there is no object {key[1]}.", "Export it again.")
        sizes[key] = -1  # until it is known
        item = model.objects[key]
        inner = sum(_size(part.key, model, sizes, path) for part in item.components)
        sizes[key] = _PART + len(item.corners) // 3 + inner
    if sizes[key] < 0:
        raise ReadError(f"{path}: object {key[1]} holds itself.", "Export it again.")
    return sizes[key]


def _parse(file: IO[bytes], name: str, model: _Model, main: bool) -> None:
    """Add the objects of an archive's file to a model; items and unit if it is the main one."""
    current = _Object()

    def begin(tag: str, words: dict[str, str]) -> None:
        nonlocal current
        tag = tag.rpartition(" ")[2]
        if tag == "vertex":
            current.points.extend((float(words["x"]), float(words["y"]), float(words["z"])))
        elif tag == "triangle":
            current.corners.extend((int(words["v1"]), int(words["v2"]), int(words["v3"])))
        elif tag == "object":
            current = model.objects[name, words["id"]] = _Object()
        elif tag == "component":
            current.components.append(_placement_of(words, name))
        elif main and tag == "item":
            model.items.append(_placement_of(words, name))
        elif main and tag == "model":
            model.unit = words.get("unit", model.unit)

    parser = hardened_parser(" ")
    parser.StartElementHandler = begin
    step = _PIECE
    # expat rescans an unfinished comment with each piece, so pieces double
    while piece := file.read(step):
        parser.Parse(piece, False)
        step = min(2 * step, _LARGEST)
    parser.Parse(b"", True)


def _placement_of(words: dict[str, str], name: str) -> _Placement:
    """Return the object and transformation that a component or an item names."""
    numbers = [float(word) for word in words.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0").split()]
    key = words.get(_PATH, name).lstrip("/"), words["objectid"]
    return _Placement(key, np.array(numbers).reshape(4, 3))
