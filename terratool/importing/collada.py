"""Reader of the triangles of a COLLADA file, in metres (Khronos, COLLADA 1.4.1 and 1.5.0).

The common library for it, pycollada, keeps coordinates in single precision, which is half a metre
in UTM, has no bound for nodes that instance each other, and wants all materials to be whole. What a
terrain needs of the format is less than would have to be put around that.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.types import (
    Triangles,
    join_triangles,
    refuse_many_faces,
    refuse_missing_vertices,
)
from terratool.importing.vrml.shapes import PARTS, FaceRule, ShapeMesh, placed, rotation
from terratool.io.expat import tree_of
from terratool.kernels import importing as kernels
from terratool.text.files import open_file

MAX_NODES = 10_000
"""Most nodes that instances may come to, besides one for each byte of the file."""

Matrix = NDArray[np.float64]
"""Transformation, (4, 4) float64: a column x, y, z, 1 is multiplied by it from the right."""

_UP = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
_LEFT = {
    "brep": "surfaces of curves",
    "convex_mesh": "convex hulls",
    "instance_controller": "skins",
    "lines": "lines",
    "linestrips": "lines",
    "ph": "polygons with holes",
    "spline": "curves",
}
"""Elements that could be seen, but are left out, and what they are."""


@dataclass(frozen=True, slots=True)
class _ColladaFile:
    """A file, whose elements have names without a prefix.

    Attributes:
        path: path of the file, for messages.
        root: the element that is the whole.
        named: elements by their id.
        left: number of parts that are left out, by what they are.
        meshes: meshes by the id of their geometry.
    """

    path: Path
    root: Element
    named: dict[str, Element]
    left: Counter[str] = field(default_factory=Counter)
    meshes: dict[str, list[ShapeMesh]] = field(default_factory=dict)

    def target(self, element: Element, attribute: str, wanted: str) -> Element:
        """Return the element that another one refers to.

        Raises:
            ReadError: it lies in another file.
            ValueError: it is missing, or another one than wanted.
        """
        address = element.get(attribute, "").strip()
        if not address.startswith("#"):
            raise ReadError(
                f"{self.path}: a part of it lies in another file, {address[:60]!r}.",
                "Export it as one file; no other one is opened.",
            )
        found = self.named.get(address[1:])
        if found is None or found.tag != wanted:
            raise ValueError(f"there is no {wanted} {address[1:61]!r}")
        return found


def read_collada(path: Path) -> Triangles:
    """Read the triangles of the scene, each part in its place and as often as it is there.

    Coordinates are in metres, in the axes of the file. Without a scene the first one counts, and
    without any the geometries as they are.

    Raises:
        ReadError: a part lies in another file, nodes multiply, or there are too many faces.
        Exception: any error of expat and NumPy where the file is no COLLADA.
    """
    with open_file(path) as file:
        text = file.read()
    root = tree_of(text)
    for element in root.iter():
        element.tag = element.tag.rpartition(":")[2]
    if root.tag != "COLLADA":
        raise ValueError(f"it begins with {root.tag[:40]!r}")
    document = _ColladaFile(path, root, {each.get("id", ""): each for each in root.iter()})
    parts = list(_placed(document, MAX_NODES + len(text)))
    refuse_many_faces(path, sum(len(mesh.faces) for mesh, _ in parts))
    found = join_triangles((placed(mesh, at[:3]) for mesh, at in parts), path)
    unit = root.find("asset/unit")
    factor = 1.0 if unit is None else float(unit.get("meter", 1))
    if not 0 < factor < np.inf:
        raise ValueError("its unit has no length")
    notes = []
    if document.left:
        listed = ", ".join(f"{count:,} of {what}" for what, count in document.left.items())
        notes.append(f"Parts of the file are no triangles and were left out: {listed}.")
    if unit is not None and factor != 1.0:
        name = unit.get("name", "another unit")[:40]
        notes.append(f"Lengths are in {name}, {factor:g} m; metres were made of them.")
    up = _UP.get(root.findtext("asset/up_axis", "").strip())
    return Triangles(found.vertices * factor, found.faces, tuple(notes), up)


# --- the scene -----------------------------------------------------------------------------------


def _placed(document: _ColladaFile, most: int) -> Iterator[tuple[ShapeMesh, Matrix]]:
    """Yield all meshes that are seen, with their places in the scene.

    Raises:
        ReadError: there are more than `most` nodes.
    """
    root = document.root
    told = root.find("scene/instance_visual_scene")
    if told is not None:
        scene: Element | None = document.target(told, "url", "visual_scene")
    else:
        scene = root.find("library_visual_scenes/visual_scene")
    if scene is None:
        for geometry in root.iterfind("library_geometries/geometry"):
            yield from ((mesh, np.eye(4)) for mesh in _meshes(document, geometry))
        return
    pending = [(each, np.eye(4)) for each in reversed(scene.findall("node"))]
    while pending:
        node, at = pending.pop()
        inner = []
        for element in node:
            if (most := most - 1) < 0:
                raise ReadError(
                    f"{document.path}: its nodes hold each other without end, or too often.",
                    "Export it with fewer instances.",
                )
            kind = element.tag
            if kind in _TRANSFORMS:
                at = at @ _TRANSFORMS[kind](_numbers(element))
            elif kind == "node":
                inner.append((element, at))
            elif kind == "instance_node":
                inner.append((document.target(element, "url", "node"), at))
            elif kind == "instance_geometry":
                geometry = document.target(element, "url", "geometry")
                yield from ((mesh, at) for mesh in _meshes(document, geometry))
            elif kind in _LEFT:
                document.left[_LEFT[kind]] += 1
        pending += reversed(inner)


def _numbers(element: Element | None) -> NDArray[np.float64]:
    """Return the numbers in the text of an element, (n,) float64."""
    text = "" if element is None else element.text or ""
    return np.fromstring(text, np.float64, sep=" ") if text.strip() else np.empty(0)


def _whole_numbers(element: Element | None) -> NDArray[np.int32]:
    numbers = _numbers(element)
    if not (np.abs(numbers) < 2**31).all():
        raise ValueError("an index is too large")
    return numbers.astype(np.int32)


def _matrix(numbers: NDArray[np.float64]) -> Matrix:
    return numbers.reshape(4, 4)


def _translate(numbers: NDArray[np.float64]) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = numbers.reshape(3)
    return matrix


def _scale(numbers: NDArray[np.float64]) -> Matrix:
    return np.diag([*numbers.reshape(3), 1.0])


def _rotate(numbers: NDArray[np.float64]) -> Matrix:
    """Return the turn about an axis by an angle in degrees."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(numbers.reshape(4)[:3], float(np.radians(numbers[3])))
    return matrix


def _refuse_transform(_: NDArray[np.float64]) -> Matrix:
    raise ValueError("a node is placed by lookat or skew, which are not read")


_TRANSFORMS: dict[str, Callable[[NDArray[np.float64]], Matrix]] = {
    "lookat": _refuse_transform,
    "matrix": _matrix,
    "rotate": _rotate,
    "scale": _scale,
    "skew": _refuse_transform,
    "translate": _translate,
}


# --- meshes --------------------------------------------------------------------------------------


def _meshes(document: _ColladaFile, geometry: Element) -> list[ShapeMesh]:
    """Return the meshes of a geometry, which are read once."""
    name = geometry.get("id", "")
    if name not in document.meshes:
        mesh = geometry.find("mesh")
        parts = [] if mesh is None else [_primitive(document, each) for each in mesh]
        document.left.update(_LEFT[each.tag] for each in geometry.iter() if each.tag in _LEFT)
        document.meshes[name] = [part for part in parts if part is not None]
    return document.meshes[name]


def _primitive(document: _ColladaFile, element: Element) -> ShapeMesh | None:
    """Return the triangles of an element of a mesh; None for one that has none."""
    kind = element.tag
    if kind not in ("triangles", "polylist", "polygons", *_STRIPS):
        return None
    inputs = element.findall("input")
    offset, vertices = next(
        (int(each.get("offset", 0)), document.target(each, "source", "vertices"))
        for each in inputs
        if each.get("semantic") == "VERTEX"
    )
    stride = 1 + max(int(each.get("offset", 0)) for each in inputs)
    if not 0 <= offset < stride:
        raise ValueError("an offset is below 0")
    position = next(
        each for each in vertices.iterfind("input") if each.get("semantic") == "POSITION"
    )
    points = _points(document, document.target(position, "source", "source"))
    lists = [_whole_numbers(each).reshape(-1, stride)[:, offset] for each in element.iterfind("p")]
    joined = np.concatenate([np.empty(0, np.int32), *lists])
    refuse_missing_vertices(document.path, joined, len(points))
    counts = np.array([len(each) for each in lists], np.int32)
    if kind == "triangles":
        return ShapeMesh(points, joined[: len(joined) // 3 * 3].reshape(-1, 3))
    if kind in _STRIPS:
        return ShapeMesh(points, _STRIPS[kind].faces(joined, counts.astype(np.float64)))
    if kind == "polylist":
        counts = _whole_numbers(element.find("vcount"))
    if (counts < 0).any() or counts.sum() != len(joined):
        raise ValueError("the corners of its polygons are not as many as it says")
    if not np.isfinite(points).all():
        raise ValueError("coordinates are no numbers")
    ends = np.cumsum(counts)
    separated = np.insert(joined, ends, -1) if len(ends) else joined
    return ShapeMesh(points, kernels.triangulate(points, separated.astype(np.int32))[0])


_STRIPS: dict[str, FaceRule] = {
    "trifans": PARTS["TriangleFanSet"],
    "tristrips": PARTS["TriangleStripSet"],
}


def _points(document: _ColladaFile, source: Element) -> NDArray[np.float64]:
    """Return the points of a source, (n, 3) float64, as its accessor has them."""
    accessor = source.find("technique_common/accessor")
    if accessor is None:
        raise ValueError("a source has no accessor")
    numbers = _numbers(document.target(accessor, "source", "float_array"))
    stride, begin = int(accessor.get("stride", 1)), int(accessor.get("offset", 0))
    count = int(accessor.get("count", 0))
    places = [n for n, each in enumerate(accessor.findall("param")) if each.get("name")]
    if not len(places) >= 3 or places[2] >= stride:
        raise ValueError("its points have no x, y and z")
    if begin < 0 or not 0 <= count <= (len(numbers) - begin) // stride:
        raise ValueError(f"a source has fewer than {count:,} points")
    rows = numbers[begin : begin + count * stride].reshape(count, stride)
    return np.ascontiguousarray(rows[:, places[:3]])
