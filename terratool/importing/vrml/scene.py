"""Through a VRML97 scene: nodes become triangles in the coordinates of the file."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from terratool.errors import ReadError
from terratool.importing.sources import Triangles
from terratool.importing.vrml.parse import FieldValue, Node, Scene, parse
from terratool.importing.vrml.shapes import (
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
from terratool.importing.vrml.text import VrmlText
from terratool.kernels import importing as kernels
from terratool.text.source import read_source

REPEATED = 50_000_000
"""Steps that USE and PROTO may take beyond what was written: a number is one, a triangle is one."""

_VISIT = 25
"""Steps of a visit to a node."""

_CHILDREN = {
    **dict.fromkeys(("Anchor", "Billboard", "Collision", "Group", "Transform"), "children"),
    "LOD": "level",
    "Shape": "geometry",
    "Switch": "choice",
}
_SOLIDS = ("Box", "Cone", "Cylinder", "Sphere", "ElevationGrid", "Extrusion", "IndexedFaceSet")
_LEFT = ("IndexedLineSet", "PointSet", "Text")
Number = TypeVar("Number", np.float64, np.int32)
_SQUARE = (1, 1, 1, -1, -1, -1, -1, 1, 1, 1)
_READ_AS = {
    "Billboard": "which turns to its viewer, as it stands in the file",
    "LOD": "its first and finest level",
    "Cone": f"as one of {SIDES} sides",
    "Cylinder": f"as one of {SIDES} sides",
    "Sphere": f"with {SIDES} sides around and {SIDES // 2} from pole to pole",
}
UP = "y"
"""The axis that points up in VRML97 (4.4.5)."""

_header = re.compile(rb"#VRML V2\.0[ \t]+utf8(?!\S)").match
_stated = re.compile(rb"(?:#[^\r\n]*+[\r\n]++)*?#[ \t]*([xyz]) is up[ \t]*[\r\n]").match
_EXPORT = "Export it as VRML97, which is VRML 2.0."


class _Scope(NamedTuple):
    """A node that a PROTO declares, and the scope in which it stands."""

    node: Node
    outer: Any  # a scope, or None; a type that contains itself is none for a NamedTuple


class _Place(NamedTuple):
    """A node to be visited, whose it is, and its pose; None is the world's."""

    node: Node
    scope: _Scope | None
    pose: Matrix | None


def walk(scene: Scene, text: VrmlText) -> Triangles:
    """All triangles of a scene, in the order of the text.

    Raises:
        ReadError: a node is impossible, lies in another file, or is repeated too often.
    """
    walker = _Walker(scene, text)
    pending = [_Place(node, None, None) for node in reversed(scene.nodes)]
    with np.errstate(all="ignore"):  # what becomes too large is refused
        while pending:
            pending += reversed(walker.visit(pending.pop()))
    return walker.triangles()


class _Fields(NamedTuple):
    """Values of a node's fields, or what they are if nothing is said."""

    walker: _Walker
    node: Node
    scope: _Scope | None

    def value(self, name: str) -> tuple[FieldValue | None, _Scope | None]:
        """The value of a field, which a PROTO may pass on, and the scope of nodes in it."""
        scope = self.scope
        value = self.node.fields.get(name)
        while value is not None and value.kind == "field":
            assert scope is not None
            self.walker.spend(1, self.node)
            instance, name = scope.node, value.name
            assert instance.proto is not None
            if name in instance.fields:
                value, scope = instance.fields[name], scope.outer
            else:
                value = instance.proto.defaults.get(name)
        return value, scope

    def nodes(self, name: str) -> tuple[tuple[Node, ...], _Scope | None]:
        """The nodes in a field, and their scope."""
        value, scope = self.value(name)
        return (() if value is None else value.nodes), scope

    def numbers(self, name: str, otherwise: tuple[float, ...]) -> NDArray[np.float64]:
        """All numbers of a field, (n,) float64."""
        value, _ = self.value(name)
        return np.array(otherwise, np.float64) if value is None else value.numbers

    def number(self, name: str, otherwise: float) -> float:
        """The only number."""
        return float(self.numbers(name, (otherwise,))[0])

    def integer(self, name: str, otherwise: int) -> int:
        """The only number, which is a whole one."""
        return int(self.number(name, otherwise))

    def flag(self, name: str) -> bool:
        """A flag; all those that are asked for are TRUE if nothing is said."""
        value, _ = self.value(name)
        return True if value is None else value.flag


class _Walker:
    """What was found so far."""

    def __init__(self, scene: Scene, text: VrmlText) -> None:
        self.text = text
        self.steps = REPEATED + 2 * _VISIT * scene.written + 4 * scene.numbers
        self.vertices: list[NDArray[np.float64]] = []
        self.faces: list[NDArray[np.int32]] = []
        self.size = 0
        self.seen: Counter[str] = Counter()
        self.flat = 0
        self.crossed = 0

    def visit(self, place: _Place) -> list[_Place]:
        """Take up a node; returns those in it that are to be seen."""
        node, scope, outer = place
        self.spend(_VISIT, node)
        if node.proto is not None:
            if node.proto.external:
                raise self._elsewhere(node)
            body = node.proto.body
            return [_Place(body, _Scope(node, scope), outer)] if body else []
        kind = node.kind
        if kind == "Inline":
            raise self._elsewhere(node)
        self.seen[kind] += 1
        if kind in _SOLIDS:
            self._add(node, self._mesh(_Fields(self, node, scope)), outer)
            return []
        if kind not in _CHILDREN:
            return []
        fields = _Fields(self, node, scope)
        children, scope_of_children = fields.nodes(_CHILDREN[kind])
        if kind == "LOD":
            children = children[:1]
        elif kind == "Switch":
            which = fields.integer("whichChoice", -1)
            children = children[which : which + 1] if which >= 0 else ()
        elif kind == "Transform":
            own = pose(
                fields.numbers("center", (0, 0, 0)),
                fields.numbers("rotation", (0, 0, 1, 0)),
                fields.numbers("scale", (1, 1, 1)),
                fields.numbers("scaleOrientation", (0, 0, 1, 0)),
                fields.numbers("translation", (0, 0, 0)),
            )
            outer = own if outer is None else product(outer, own)
        return [_Place(child, scope_of_children, outer) for child in children]

    def triangles(self) -> Triangles:
        """All that was found.

        Raises:
            ReadError: nothing was, or what was found is too large for numbers.
        """
        notes = tuple(self._notes())
        if not self.size or not any(len(faces) for faces in self.faces):
            raise ReadError(
                f"{self.text.name}: no node in it has a surface.",
                " ".join(notes) or "Choose a file with an IndexedFaceSet or an ElevationGrid.",
            )
        return Triangles(_joined(self.vertices), _joined(self.faces), notes)

    # --- geometry -------------------------------------------------------------------------------

    def _mesh(self, fields: _Fields) -> ShapeMesh:
        kind = fields.node.kind
        if kind == "IndexedFaceSet":
            mesh = self._face_set(fields)
        elif kind == "ElevationGrid":
            mesh = self._elevation_grid(fields)
        elif kind == "Extrusion":
            mesh = self._extrusion(fields)
        else:
            mesh = self._solid(fields)
            self.spend(len(mesh.faces), fields.node)
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
        value, _ = fields.value("coordIndex")
        nodes, inner = fields.nodes("coord")
        coord = nodes[0] if nodes else None
        while coord is not None and coord.proto is not None:
            self.spend(_VISIT, coord)
            if coord.proto.external:
                raise self._elsewhere(coord)
            inner = _Scope(coord, inner)
            coord = coord.proto.body
        points = np.empty((0, 3))
        if coord is not None:
            if coord.kind != "Coordinate":
                raise self.text.error(
                    coord.at,
                    f'"coord" is a {coord.kind} and no Coordinate.',
                    "Correct the node, or write the file again.",
                )
            points = _Fields(self, coord, inner).numbers("point", ()).reshape(-1, 3)
        numbers = np.empty(0) if value is None else value.numbers
        self.spend(len(numbers), node)
        wrong = numbers >= len(points)
        if wrong.any():
            assert value is not None
            index = int(np.argmax(wrong))
            last = f"the last one is {len(points) - 1:,}" if len(points) else "there are none"
            raise self.text.error(
                self.text.place_of(value.at, index),
                f"there is no point {int(numbers[index]):,}; {last}.",
                "Correct the index, or add the points that are missing.",
            )
        faces, flat, crossed = kernels.triangulate(points, numbers.astype(np.int32))
        self.spend(len(faces), node)
        self.flat += flat
        self.crossed += crossed
        return ShapeMesh(points, faces)

    def _elevation_grid(self, fields: _Fields) -> ShapeMesh:
        columns, rows = fields.integer("xDimension", 0), fields.integer("zDimension", 0)
        heights = fields.numbers("height", ())
        if min(rows, columns) < 0 or rows * columns != len(heights):
            raise self.text.error(
                fields.node.at,
                f"the ElevationGrid of {columns:,} × {rows:,} has {len(heights):,} heights.",
                "Correct xDimension and zDimension, or the list of heights.",
            )
        self.spend(3 * len(heights), fields.node)
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
        self.spend(2 * len(section) * len(spine) + _VISIT * len(spine), fields.node)
        caps = fields.flag("beginCap"), fields.flag("endCap")
        return extrusion(section, spine, scales, turns, *caps)

    def _add(self, node: Node, mesh: ShapeMesh, outer: Matrix | None) -> None:
        vertices, faces = _used(mesh)
        if outer is not None:
            vertices = placed(outer, vertices)
            if np.linalg.det(outer[:, :3]) < 0:  # a mirror turns what is outside
                faces = faces[:, ::-1]
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

    def spend(self, steps: int, node: Node) -> None:
        """Count the steps of reading; USE and PROTO can repeat without end."""
        self.steps -= steps
        if self.steps < 0:
            raise self.text.error(
                node.at,
                f"with this {node.kind} USE and PROTO repeat more than can be read.",
                "Write a file with fewer repetitions.",
            )

    def _elsewhere(self, node: Node) -> ReadError:
        what = "the Inline" if node.proto is None else f"the {node.kind} of an EXTERNPROTO"
        return self.text.error(
            node.at,
            f"{what} lies in another file.",
            "Put its content in its place, as converters of VRML do, and read that.",
        )

    def _notes(self) -> list[str]:
        notes = []
        left = [f"{self.seen[kind]:,} {kind}" for kind in _LEFT if self.seen[kind]]
        if left:
            notes.append(f"Left out, as it has no faces: {', '.join(left)}.")
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


def _joined(parts: list[NDArray[Number]]) -> NDArray[Number]:
    return np.ascontiguousarray(parts[0]) if len(parts) == 1 else np.concatenate(parts)


def _used(mesh: ShapeMesh) -> ShapeMesh:
    """A mesh without the vertices that no face has."""
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
    """The surfaces of a VRML97 file, or of a gzip of one, in the coordinates of the file.

    Nothing is turned: y is up by the standard (see `UP`), whatever a file's author thought.

    Raises:
        ReadError: the file is missing, unreadable, no VRML97, or has no surface; or needs others.
    """
    source = read_source(path)
    match = _header(source.data)
    if match is None:
        raise _other(source.name, source.data)
    text = VrmlText(source.name, source.data)
    return walk(parse(text), text)


def stated_up(path: str | Path) -> str | None:
    """The axis that a comment before the first node states, as files of this project do.

    Returns:
        "x", "y" or "z" where a comment is just "z is up"; None without one.

    Raises:
        ReadError: the file cannot be read.
    """
    match = _stated(read_source(path).data)
    return match[1].decode() if match else None


def _other(name: str, data: bytes) -> ReadError:
    """What a file is that does not begin as VRML97 does."""
    where = f"{name}:1:1:"
    if not data:
        return ReadError(f"{where} the file is empty.", "Write or fetch it again.")
    if data.startswith(b"#VRML V1.0"):
        return ReadError(f"{where} this is VRML 1.0, and only VRML97 can be read.", _EXPORT)
    if data.startswith(b"#X3D") or re.match(rb"\s*<(\?xml|!DOCTYPE X3D|X3D)\b", data):
        return ReadError(f"{where} this is X3D, and only VRML97 can be read.", _EXPORT)
    return ReadError(
        f'{where} the file does not begin with "#VRML V2.0 utf8", so it is no VRML97.',
        "Choose another file, or export it as VRML97.",
    )
