"""Walk through a scene of VRML or X3D that collects triangles in the coordinates of the file."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.types import Triangles
from terratool.importing.vrml import first
from terratool.importing.vrml.nodes import VRML1, VRML97, X3D
from terratool.importing.vrml.parse import UNREAD, Node, Unit, VrmlScene, parse
from terratool.importing.vrml.shapes import (
    PARTS,
    SIDES,
    Matrix,
    ShapeMesh,
    box,
    cone,
    cylinder,
    elevation_grid,
    extrusion,
    placed,
    pose,
    product,
    sphere,
)
from terratool.importing.vrml.text import PlacedText, VrmlText, short
from terratool.importing.vrml.xml import parse_xml
from terratool.kernels import importing as kernels
from terratool.text.source import Source, read_source

REPEATED = 25_000_000
"""Steps that USE may cause beyond the nodes of the text, of some 20 ns each."""

_PER_BYTE = 50
"""Additional steps that USE may cause for each byte of the text."""

_VISIT, _POSE, _MESH, _SPINE = 200, 1300, 1000, 2000
"""Steps of a visit to a node, of a Transform, of any shape, and of a point of a spine."""

_ROUND = 8
"""Steps of each triangle of a computed shape; other shapes cost one per number or triangle."""

_GROUPS = ("Anchor", "Billboard", "Collision", "Group", "Transform")
_GROUPS_OF_X3D = ("CADAssembly", "CADLayer", "CADPart", "StaticGroup")
_CHILDREN = {
    **dict.fromkeys((*_GROUPS, *_GROUPS_OF_X3D), ("children",)),
    "CADFace": ("shape",),
    "LOD": ("level", "children"),
    "Shape": ("geometry",),
    "Switch": ("choice", "children"),
}
"""Fields with visible children by node; of two names the first is that of VRML97."""

_SOLIDS = ("Box", "Cone", "Cylinder", "Sphere", "ElevationGrid", "Extrusion", "IndexedFaceSet")
_LEFT = ("IndexedLineSet", "PointSet", "Text", "LineSet", "AsciiText")
Number = TypeVar("Number", np.float64, np.int32)
_SQUARE = (1, 1, 1, -1, -1, -1, -1, 1, 1, 1)
_READ_AS = {
    "Billboard": "which turns to its viewer, as it stands in the file",
    "LOD": "its first and finest level",
    "Cone": f"as one of {SIDES} sides",
    "Cylinder": f"as one of {SIDES} sides",
    "Sphere": f"with {SIDES} sides around and {SIDES // 2} from pole to pole",
}
_HEAD = 1 << 16
"""Bytes that contain the head of an X3D file."""

_WIDE = {
    b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be",
    b"<\0": "utf-16-le", b"\0<": "utf-16-be",
}  # fmt: skip
"""Beginnings of texts in UTF-16, and their encodings."""

_KINDS = 5
"""Most kinds of unknown nodes that a note names."""

UP = "y"
"""Axis that points up in VRML97 (4.4.5), VRML 1.0 and X3D."""

_header = re.compile(
    rb"#(?=(?:VRML V2\.0|X3D V[34]\.[0-9])[ \t]+utf8(?!\S)|VRML V1\.0[ \t]+ascii(?!\S))(\S+ \S+)"
).match
_LANGUAGES = {b"VRML V2.0": VRML97, b"VRML V1.0": VRML1}
_xml = re.compile(rb"\s*<").match
_stated_in_xml = re.compile(
    rb"<meta\s+name\s*=\s*[\"']up[\"']\s+content\s*=\s*[\"']([xyz])[\"']"
).search
_declared = re.compile(r"""(\A<\?xml\s[^>]*?)(encoding\s*=\s*["'][^"'>]*["'])""").sub
_stated = re.compile(rb"(?:#[^\r\n]*+[\r\n]++)*?#[ \t]*([xyz]) is up[ \t]*[\r\n]").match


class _ScenePlace(NamedTuple):
    """A node to visit, with its pose; None for that of the world."""

    node: Node
    pose: Matrix | None


def walk(scene: VrmlScene, text: PlacedText) -> Triangles:
    """Collect all triangles of a scene, in the order of the text.

    Raises:
        ReadError: a node is invalid, lies in another file, or is repeated too often.
    """
    walker = _SceneWalker(scene, text)
    with np.errstate(all="ignore"):  # too large coordinates are refused
        if scene.language is VRML1:
            for shape in first.shapes(scene.nodes, lambda node: walker.spend(_VISIT, node)):
                walker.visit(_ScenePlace(*shape))
            return walker.triangles()
        pending = [_ScenePlace(node, None) for node in reversed(scene.nodes)]
        while pending:
            pending += reversed(walker.visit(pending.pop()))
        return _in_metres(walker.triangles(), scene.units, text)


def _in_metres(found: Triangles, units: tuple[Unit, ...], text: PlacedText) -> Triangles:
    """Return triangles in metres if the scene states its units (ISO/IEC 19775-1, 4.3.6).

    Raises:
        ReadError: angles are in another unit than radians.
    """
    for unit in units:
        if unit.category == "angle" and unit.factor != 1.0:
            raise ReadError(
                f"{text.name}: its angles are in {unit.name}, and not in radians.",
                "Export it with angles in radians.",
            )
        if unit.category == "length" and unit.factor != 1.0:
            note = f"Lengths are in {unit.name}; metres were made of them."
            found = Triangles(found.vertices * unit.factor, found.faces, (*found.notes, note))
    return found


class _Fields(NamedTuple):
    """Values of a node's fields, or their defaults."""

    node: Node

    def nodes(self, name: str) -> tuple[Node, ...]:
        """Return the nodes in a field."""
        value = self.node.fields.get(name)
        return () if value is None else value.nodes

    def numbers(self, name: str, otherwise: tuple[float, ...]) -> NDArray[np.float64]:
        """Return all numbers of a field, (n,) float64."""
        value = self.node.fields.get(name)
        return np.array(otherwise, np.float64) if value is None else value.numbers

    def number(self, name: str, otherwise: float) -> float:
        """Return the only number of a field."""
        return float(self.numbers(name, (otherwise,))[0])

    def integer(self, name: str, otherwise: int) -> int:
        """Return the only number of a field as an integer."""
        return int(self.number(name, otherwise))

    def flag(self, name: str) -> bool:
        """Return a flag of a field; the default of all flags read here is TRUE."""
        value = self.node.fields.get(name)
        return True if value is None else value.flag


class _SceneWalker:
    """Walker through a scene, with the triangles collected so far.

    Attributes:
        steps: steps that are left.
        visited: ids of the nodes visited.
        again: whether the current node was visited before.
    """

    def __init__(self, scene: VrmlScene, text: PlacedText) -> None:
        self.text = text
        self.unknown = scene.unknown
        self.steps = REPEATED + _PER_BYTE * len(text.data)
        self.visited: set[int] = set()
        self.again = False
        self.vertices: list[NDArray[np.float64]] = []
        self.faces: list[NDArray[np.int32]] = []
        self.size = 0
        self.seen: Counter[str] = Counter()
        self.flat = 0
        self.crossed = 0

    def visit(self, place: _ScenePlace) -> list[_ScenePlace]:
        """Visit a node, and return its visible children."""
        node, outer = place
        self.again = id(node) in self.visited
        self.visited.add(id(node))
        self.charge(_VISIT, node)
        kind = node.kind
        self._refuse_unread(node)
        self.seen[kind] += 1
        if kind in _SOLIDS or kind in PARTS:
            self._add(node, self._mesh(_Fields(node)), outer)
            return []
        if kind not in _CHILDREN:
            return []
        fields = _Fields(node)
        names = _CHILDREN[kind]
        children = fields.nodes(names[0])
        if not children and len(names) > 1:
            children = fields.nodes(names[1])
        if kind == "LOD":
            children = children[:1]
        elif kind == "Switch":
            which = fields.integer("whichChoice", -1)
            children = children[which : which + 1] if which >= 0 else ()
        elif kind in ("Transform", "CADPart"):
            self.charge(_POSE, node)
            own = pose(
                fields.numbers("center", (0, 0, 0)),
                fields.numbers("rotation", (0, 0, 1, 0)),
                fields.numbers("scale", (1, 1, 1)),
                fields.numbers("scaleOrientation", (0, 0, 1, 0)),
                fields.numbers("translation", (0, 0, 0)),
            )
            outer = own if outer is None else product(outer, own)
        return [_ScenePlace(child, outer) for child in children]

    def triangles(self) -> Triangles:
        """Return all triangles collected.

        Raises:
            ReadError: there are none, or their coordinates are too large.
        """
        notes = tuple(self._notes())
        if not self.size or not any(len(faces) for faces in self.faces):
            raise ReadError(
                f"{self.text.name}: no node in it has a surface.",
                " ".join(notes) or "Choose a file with an IndexedFaceSet or an ElevationGrid.",
            )
        return Triangles(_join_arrays(self.vertices), _join_arrays(self.faces), notes)

    # --- geometry -------------------------------------------------------------------------------

    def _mesh(self, fields: _Fields) -> ShapeMesh:
        kind = fields.node.kind
        self.charge(_MESH, fields.node)
        if kind == "IndexedFaceSet":
            mesh = self._face_set(fields)
        elif kind == "ElevationGrid":
            mesh = self._elevation_grid(fields)
        elif kind == "Extrusion":
            mesh = self._extrusion(fields)
        elif kind in PARTS:
            mesh = self._triangle_set(fields)
        else:
            mesh = self._solid(fields)
            self.charge(_ROUND * len(mesh.faces), fields.node)
            return mesh
        return mesh if fields.flag("ccw") else ShapeMesh(mesh.vertices, mesh.faces[:, ::-1])

    def _solid(self, fields: _Fields) -> ShapeMesh:
        kind = fields.node.kind
        if kind == "Box":
            return box(fields.numbers("size", (2, 2, 2)))
        if kind == "Sphere":
            return sphere(fields.number("radius", 1))
        height = fields.number("height", 2)
        side, bottom = fields.flag("side"), fields.flag("bottom")
        if kind == "Cone":
            return cone(fields.number("bottomRadius", 1), height, side, bottom)
        return cylinder(fields.number("radius", 1), height, side, bottom, fields.flag("top"))

    def _face_set(self, fields: _Fields) -> ShapeMesh:
        node = fields.node
        points = self._points(fields)
        numbers = self._indices(fields, "coordIndex", len(points))
        faces, flat, crossed = kernels.triangulate(points, numbers)
        self.charge(len(faces), node)
        self.flat += flat
        self.crossed += crossed
        return ShapeMesh(points, faces)

    def _triangle_set(self, fields: _Fields) -> ShapeMesh:
        """Mesh of triangles, quadrilaterals, strips or fans of X3D (ISO/IEC 19775-1, 11.4)."""
        node = fields.node
        points = self._points(fields)
        part = PARTS[node.kind]
        if part.numbers:
            numbers = self._indices(fields, part.numbers, len(points))
        else:
            numbers = np.arange(len(points), dtype=np.int32)
            self.charge(len(numbers), node)
        counts = None
        if part.counts:
            counts = fields.numbers(part.counts, ())
            if (counts < 3).any() or counts.sum() != len(numbers):
                raise self.text.error(
                    node.at,
                    f'"{part.counts}" does not fit the {len(numbers):,} points.',
                    "Write numbers from 3 on that come to as many as there are points.",
                )
        faces = part.faces(numbers, counts)
        self.charge(len(faces), node)
        return ShapeMesh(points, faces)

    def _points(self, fields: _Fields) -> NDArray[np.float64]:
        """Return the points in the field "coord", (n, 3) float64."""
        nodes = fields.nodes("coord")
        if not nodes:
            return np.empty((0, 3))
        coord = nodes[0]
        self._refuse_unread(coord)
        if coord.kind not in ("Coordinate", "CoordinateDouble"):
            raise self.text.error(
                coord.at,
                f'"coord" is a {coord.kind} and no Coordinate.',
                "Correct the node, or write the file again.",
            )
        return _Fields(coord).numbers("point", ()).reshape(-1, 3)

    def _indices(self, fields: _Fields, name: str, count: int) -> NDArray[np.int32]:
        """Return indices below `count` from a field, and its numbers below 0, int32."""
        value = fields.node.fields.get(name)
        numbers = np.empty(0) if value is None else value.numbers
        self.charge(len(numbers), fields.node)
        wrong = numbers >= count
        if wrong.any():
            assert value is not None
            index = int(np.argmax(wrong))
            last = f"the last one is {count - 1:,}" if count else "there are none"
            raise self.text.error(
                self.text.place_of(value.at, index),
                f"there is no point {int(numbers[index]):,}; {last}.",
                "Correct the index, or add the points that are missing.",
            )
        return numbers.astype(np.int32)

    def _elevation_grid(self, fields: _Fields) -> ShapeMesh:
        columns, rows = fields.integer("xDimension", 0), fields.integer("zDimension", 0)
        heights = fields.numbers("height", ())
        if min(rows, columns) < 0 or rows * columns != len(heights):
            raise self.text.error(
                fields.node.at,
                f"the ElevationGrid of {columns:,} × {rows:,} has {len(heights):,} heights.",
                "Correct xDimension and zDimension, or the list of heights.",
            )
        self.charge(3 * len(heights), fields.node)
        return elevation_grid(
            heights.reshape(rows, columns),
            fields.number("xSpacing", 1),
            fields.number("zSpacing", 1),
        )

    def _extrusion(self, fields: _Fields) -> ShapeMesh:
        section = fields.numbers("crossSection", _SQUARE).reshape(-1, 2)
        spine = fields.numbers("spine", (0, 0, 0, 0, 1, 0)).reshape(-1, 3)
        scales = fields.numbers("scale", (1, 1)).reshape(-1, 2)
        turns = fields.numbers("orientation", (0, 0, 1, 0)).reshape(-1, 4)
        for name, values in (("scale", scales), ("orientation", turns)):
            if len(values) != 1 and len(values) < len(spine):
                raise self.text.error(
                    fields.node.at,
                    f'the Extrusion has {len(values):,} values of "{name}" for {len(spine):,} '
                    "points of its spine.",
                    "Write one, or as many as the spine has points.",
                )
        if len(section) < 2 or len(spine) < 2:
            return ShapeMesh(np.empty((0, 3)), np.empty((0, 3), np.int32))
        # a single extrusion can be large, too
        self.spend(2 * len(section) * len(spine), fields.node)
        self.charge(_SPINE * len(spine), fields.node)
        caps = fields.flag("beginCap"), fields.flag("endCap")
        return extrusion(section, spine, scales, turns, *caps)

    def _add(self, node: Node, mesh: ShapeMesh, outer: Matrix | None) -> None:
        mesh = _drop_unused(mesh)
        vertices, faces = mesh if outer is None else placed(mesh, outer)
        if not np.isfinite(vertices).all():
            raise self.text.error(
                node.at,
                f"the coordinates of the {node.kind} become too large.",
                "Write smaller numbers, or smaller scales.",
            )
        if self.size + len(vertices) >= 2**31:
            raise self.text.error(
                node.at, "here the file has more than 2,147,483,647 vertices.", "Split the file."
            )
        self.vertices.append(vertices)
        self.faces.append(faces + np.int32(self.size) if self.size else faces)
        self.size += len(vertices)

    # --- limits and notes -----------------------------------------------------------------------

    def charge(self, steps: int, node: Node) -> None:
        """Count the steps of a node that was visited before."""
        if self.again:
            self.spend(steps, node)

    def spend(self, steps: int, node: Node) -> None:
        """Count steps, as USE can repeat without end.

        Raises:
            ReadError: no steps are left.
        """
        self.steps -= steps
        if self.steps < 0:
            raise self.text.error(
                node.at,
                f"with this {node.kind} USE repeats more than can be read.",
                "Write a file with fewer repetitions.",
            )

    def _refuse_unread(self, node: Node) -> None:
        """Refuse a node whose content is elsewhere.

        Raises:
            ReadError: the node is an Inline, or an instance of a prototype.
        """
        if node.kind == "Inline":
            raise self.text.error(
                node.at,
                "the Inline lies in another file.",
                "Put its content in its place, as converters of VRML do, and read that.",
            )
        if node.kind == UNREAD:
            raise self.text.error(
                node.at,
                f"a {UNREAD} stands here, and its prototype is not read.",
                "Export the file with its prototypes expanded.",
            )

    def _notes(self) -> list[str]:
        notes = []
        left = [f"{self.seen[kind]:,} {kind}" for kind in _LEFT if self.seen[kind]]
        if left:
            notes.append(f"Left out, as it has no faces: {', '.join(left)}.")
        others = [f"{count:,} {short(kind)}" for kind, count in self.unknown.items() if count]
        if len(others) > _KINDS:
            others[_KINDS:] = [f"and {len(others) - _KINDS:,} kinds more"]
        if others:
            notes.append(f"Left out, as nodes of these kinds are not read: {', '.join(others)}.")
        if self.flat:
            notes.append(f"Polygons left out, as they have no area: {self.flat:,}.")
        if self.crossed:
            notes.append(
                f"Polygons that cross themselves, so that faces overlap: {self.crossed:,}."
            )
        for kind, what in _READ_AS.items():
            if self.seen[kind]:
                notes.append(f"{kind}, {what}: {self.seen[kind]:,}.")
        return notes


def _join_arrays(parts: list[NDArray[Number]]) -> NDArray[Number]:
    return np.ascontiguousarray(parts[0]) if len(parts) == 1 else np.concatenate(parts)


def _drop_unused(mesh: ShapeMesh) -> ShapeMesh:
    """Return a mesh without vertices that no face has."""
    vertices, faces = mesh
    if 4 * faces.size < len(vertices):  # many shapes may share the points of one
        own, inverse = np.unique(faces, return_inverse=True)
        return ShapeMesh(vertices[own], inverse.reshape(faces.shape).astype(np.int32))
    used = np.zeros(len(vertices), np.bool_)
    used[faces] = True
    if used.all():
        return mesh
    numbers = (np.cumsum(used) - 1).astype(np.int32)
    return ShapeMesh(vertices[used], numbers[faces])


def read_vrml(path: str | Path) -> Triangles:
    """Read the surfaces of a VRML or X3D file, or of a gzip of one, in the file's coordinates.

    Nothing is turned: y is up by the standard (see `UP`).

    Raises:
        ReadError: the file is missing, unreadable, neither of the two, or has no surface; or needs
            other files.
    """
    source = _read_text(path)
    scene, text = _scene_of(source.name, source.data)
    return walk(scene, text)


def _read_text(path: str | Path) -> Source:
    """Read the text of a file, and convert UTF-16 to UTF-8.

    Raises:
        ReadError: the file cannot be read, or is too large.
    """
    # a pipe could not be read twice
    source = read_source(path, hint="Export a smaller part.", named=False)
    encoding = next((name for begin, name in _WIDE.items() if source.data.startswith(begin)), "")
    if not encoding:
        return source
    try:
        text = source.data.decode(encoding).removeprefix("\ufeff")
        # blank out the encoding that the text declares; all offsets stay
        text = _declared(lambda found: found[1] + " " * len(found[2]), text, count=1)
        return Source(source.name, text.encode())
    except UnicodeError as error:
        raise ReadError(
            f"{path}: begins as UTF-16, and is none.", "Save it as UTF-8, or export it again."
        ) from error


def _scene_of(name: str, data: bytes) -> tuple[VrmlScene, PlacedText]:
    """Parse a text as XML, X3D, VRML97 or VRML 1.0, by its beginning."""
    if _xml(data):
        text = PlacedText(name, data)
        return parse_xml(text), text
    match = _header(data)
    if match is None:
        raise _other(name, data)
    words = VrmlText(name, data)
    return parse(words, _LANGUAGES.get(match[1], X3D)), words


def up_axis_of(path: str | Path) -> str | None:
    """Return the up axis that a file states, as the project's own files do.

    Returns:
        "x", "y" or "z" where a comment of VRML before the first node is just "z is up", or a meta
        of
        X3D with the name "up" says so; None without one.

    Raises:
        ReadError: the file cannot be read.
    """
    data = _read_text(path).data
    head = data[:_HEAD].partition(b"<Scene")[0]
    match = _stated_in_xml(head) if _xml(data) else _stated(data)
    return match[1].decode() if match else None


def _other(name: str, data: bytes) -> ReadError:
    """Return the error about a file with an unknown beginning."""
    where = f"{name}:1:1:"
    if not data:
        return ReadError(f"{where} the file is empty.", "Write or fetch it again.")
    return ReadError(
        f'{where} the file begins neither with "#VRML V2.0 utf8" nor as VRML 1.0 or X3D do.',
        "Choose another file, or export it as VRML97 or X3D.",
    )
