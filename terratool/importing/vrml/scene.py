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
from terratool.importing.vrml.parse import FieldValue, Node, Scene
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
_ROUND = ("Cone", "Cylinder", "Sphere")
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
        self._spend(_VISIT, node)
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
            self._add(node, self._mesh(node, scope), outer)
            return []
        if kind not in _CHILDREN:
            return []
        children, scope_of_children = self._nodes(node, scope, _CHILDREN[kind])
        if kind == "LOD":
            children = children[:1]
        elif kind == "Switch":
            which = self._integer(node, scope, "whichChoice", -1)
            children = children[which : which + 1] if which >= 0 else ()
        elif kind == "Transform":
            own = pose(
                self._numbers(node, scope, "center", (0, 0, 0)),
                self._numbers(node, scope, "rotation", (0, 0, 1, 0)),
                self._numbers(node, scope, "scale", (1, 1, 1)),
                self._numbers(node, scope, "scaleOrientation", (0, 0, 1, 0)),
                self._numbers(node, scope, "translation", (0, 0, 0)),
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

    def _mesh(self, node: Node, scope: _Scope | None) -> ShapeMesh:
        kind = node.kind
        if kind == "IndexedFaceSet":
            return self._face_set(node, scope)
        if kind == "ElevationGrid":
            return self._elevation_grid(node, scope)
        if kind == "Extrusion":
            return self._extrusion(node, scope)
        flag = {name: self._flag(node, scope, name) for name in ("side", "bottom", "top")}
        if kind == "Box":
            mesh = box(self._numbers(node, scope, "size", (2, 2, 2)))
        elif kind == "Cone":
            radius = self._number(node, scope, "bottomRadius", 1)
            height = self._number(node, scope, "height", 2)
            mesh = cone(radius, height, flag["side"], flag["bottom"])
        elif kind == "Cylinder":
            radius = self._number(node, scope, "radius", 1)
            height = self._number(node, scope, "height", 2)
            mesh = cylinder(radius, height, flag["side"], flag["bottom"], flag["top"])
        else:
            mesh = sphere(self._number(node, scope, "radius", 1))
        self._spend(len(mesh.faces), node)
        return mesh

    def _face_set(self, node: Node, scope: _Scope | None) -> ShapeMesh:
        value, _ = self._value(node, scope, "coordIndex")
        nodes, inner = self._nodes(node, scope, "coord")
        coord = nodes[0] if nodes else None
        while coord is not None and coord.proto is not None:
            self._spend(_VISIT, coord)
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
            points = self._numbers(coord, inner, "point", ()).reshape(-1, 3)
        numbers = np.empty(0) if value is None else value.numbers
        self._spend(len(numbers), node)
        wrong = numbers >= len(points)
        if wrong.any():
            assert value is not None
            index = int(np.argmax(wrong))
            raise self.text.error(
                self.text.place_of(value.at, index),
                f"there is no point {int(numbers[index]):,}; {_points(len(points))}.",
                "Correct the index, or add the points that are missing.",
            )
        faces, flat, crossed = kernels.triangulate(points, numbers.astype(np.int32))
        self._spend(len(faces), node)
        self.flat += flat
        self.crossed += crossed
        return _wound(ShapeMesh(points, faces), self._flag(node, scope, "ccw"))

    def _elevation_grid(self, node: Node, scope: _Scope | None) -> ShapeMesh:
        columns = self._integer(node, scope, "xDimension", 0)
        rows = self._integer(node, scope, "zDimension", 0)
        heights = self._numbers(node, scope, "height", ())
        if min(rows, columns) < 0 or rows * columns != len(heights):
            raise self.text.error(
                node.at,
                f"the ElevationGrid of {columns:,} × {rows:,} has {len(heights):,} heights.",
                "Correct xDimension and zDimension, or the list of heights.",
            )
        self._spend(3 * len(heights), node)
        mesh = elevation_grid(
            heights.reshape(rows, columns),
            self._number(node, scope, "xSpacing", 1),
            self._number(node, scope, "zSpacing", 1),
        )
        return _wound(mesh, self._flag(node, scope, "ccw"))

    def _extrusion(self, node: Node, scope: _Scope | None) -> ShapeMesh:
        section = self._numbers(node, scope, "crossSection", _SQUARE).reshape(-1, 2)
        spine = self._numbers(node, scope, "spine", (0, 0, 0, 0, 1, 0)).reshape(-1, 3)
        scales = self._numbers(node, scope, "scale", (1, 1)).reshape(-1, 2)
        turns = self._numbers(node, scope, "orientation", (0, 0, 1, 0)).reshape(-1, 4)
        for name, values in (("scale", scales), ("orientation", turns)):
            if len(values) != 1 and len(values) < len(spine):
                raise self.text.error(
                    node.at,
                    f'the Extrusion has {len(values):,} values of "{name}" for {len(spine):,} '
                    "points of its spine.",
                    "Write one, or as many as the spine has points.",
                )
        if len(section) < 2 or len(spine) < 2:
            return ShapeMesh(np.empty((0, 3)), np.empty((0, 3), np.int32))
        self._spend(2 * len(section) * len(spine) + _VISIT * len(spine), node)
        caps = [self._flag(node, scope, name) for name in ("beginCap", "endCap")]
        mesh = extrusion(section, spine, scales, turns, *caps)
        return _wound(mesh, self._flag(node, scope, "ccw"))

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

    # --- fields ---------------------------------------------------------------------------------

    def _value(
        self, node: Node, scope: _Scope | None, name: str
    ) -> tuple[FieldValue | None, _Scope | None]:
        """The value of a field, which a PROTO may pass on, and the scope of nodes in it."""
        value = node.fields.get(name)
        while value is not None and value.kind == "field":
            assert scope is not None
            self._spend(1, node)
            instance, name = scope.node, value.name
            assert instance.proto is not None
            if name in instance.fields:
                value, scope = instance.fields[name], scope.outer
            else:
                value = instance.proto.defaults.get(name)
        return value, scope

    def _nodes(
        self, node: Node, scope: _Scope | None, name: str
    ) -> tuple[tuple[Node, ...], _Scope | None]:
        value, scope = self._value(node, scope, name)
        return (() if value is None else value.nodes), scope

    def _numbers(
        self, node: Node, scope: _Scope | None, name: str, otherwise: tuple[float, ...]
    ) -> NDArray[np.float64]:
        value, _ = self._value(node, scope, name)
        return np.array(otherwise, np.float64) if value is None else value.numbers

    def _number(self, node: Node, scope: _Scope | None, name: str, otherwise: float) -> float:
        return float(self._numbers(node, scope, name, (otherwise,))[0])

    def _integer(self, node: Node, scope: _Scope | None, name: str, otherwise: int) -> int:
        return int(self._number(node, scope, name, otherwise))

    def _flag(self, node: Node, scope: _Scope | None, name: str) -> bool:
        """A flag; all those that are asked for are TRUE if nothing is said."""
        value, _ = self._value(node, scope, name)
        return True if value is None else value.flag

    # --- limits and notes -----------------------------------------------------------------------

    def _spend(self, steps: int, node: Node) -> None:
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


def _points(count: int) -> str:
    return f"the last one is {count - 1:,}" if count else "there are none"


def _wound(mesh: ShapeMesh, counterclockwise: bool) -> ShapeMesh:
    return mesh if counterclockwise else ShapeMesh(mesh.vertices, mesh.faces[:, ::-1])


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
    # heavy, and of no use for what is no VRML
    from terratool.importing.vrml.parse import parse
    from terratool.importing.vrml.text import VrmlText

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
