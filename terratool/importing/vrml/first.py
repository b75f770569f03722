"""Shapes of VRML 1.0 (specification of 1995), in the nodes of VRML97 and with their poses.

In VRML 1.0 a node changes a state, such as the pose and the points, for all that follow it. A
Separator gives back the state that it met.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from terratool.importing.vrml.parse import FieldValue, Node
from terratool.importing.vrml.shapes import Matrix, pose, product

_POSES = ("MatrixTransform", "Rotation", "Scale", "Transform", "Translation")
_KEPT = {"Separator": True, "WWWAnchor": True, "TransformSeparator": False}
"""Nodes behind which the state is that before them: all of it, or the pose alone."""

_EVERYTHING = -3
"""Number for which a Switch shows all of its children."""


@dataclass(frozen=True, slots=True)
class _DrawState:
    """State that nodes change.

    Attributes:
        pose: pose in the world; None for that of the world itself.
        points: the last Coordinate3, as a Coordinate.
        clockwise: whether faces are seen clockwise from outside.
    """

    pose: Matrix | None = None
    points: Node | None = None
    clockwise: bool = False


@dataclass(frozen=True, slots=True)
class _Return:
    """Return to a state behind the node that kept it; to its pose alone unless `whole`."""

    state: _DrawState
    whole: bool


def shapes(
    nodes: tuple[Node, ...], spend: Callable[[Node], None]
) -> Iterator[tuple[Node, Matrix | None]]:
    """Yield shapes as nodes of VRML97, with their poses; nodes of other kinds as they are.

    Args:
        nodes: nodes outside of all others.
        spend: counts a node that is visited, as USE can repeat without end.
    """
    state = _DrawState()
    made: dict[tuple[int, int, bool], Node] = {}
    pending: list[Node | _Return] = [*reversed(nodes)]
    while pending:
        node = pending.pop()
        if isinstance(node, _Return):
            state = node.state if node.whole else replace(state, pose=node.state.pose)
            continue
        spend(node)
        kind = node.kind
        if kind in _POSES:
            own = _pose_of(node)
            state = replace(state, pose=own if state.pose is None else product(state.pose, own))
        elif kind == "Coordinate3":
            state = replace(state, points=Node("Coordinate", node.at, node.fields))
        elif kind == "ShapeHints":
            state = replace(state, clockwise=_words(node, "vertexOrdering") == ("CLOCKWISE",))
        elif kind in _SHAPES:
            key = id(node), id(state.points), state.clockwise
            if key not in made:
                made[key] = _SHAPES[kind](node, state)
            yield made[key], state.pose
        elif kind in ("Group", "LOD", "Switch", *_KEPT):
            if kind in _KEPT:
                pending.append(_Return(state, _KEPT[kind]))
            pending += reversed(_children(node))
        else:
            yield Node("Inline", node.at) if kind == "WWWInline" else node, state.pose


def _children(node: Node) -> list[Node]:
    """Return the children that are seen."""
    if node.kind == "LOD":
        return node.children[:1]
    if node.kind == "Switch":
        which = int(_numbers(node, "whichChild", (-1,))[0])
        if which != _EVERYTHING:
            return node.children[which : which + 1] if which >= 0 else []
    return node.children


def _pose_of(node: Node) -> Matrix:
    """Return the pose of a node that moves, turns or scales what follows, (3, 4)."""
    if node.kind == "MatrixTransform":  # a row x, y, z, 1 is multiplied by it from the left
        return _numbers(node, "matrix", tuple(np.eye(4).ravel())).reshape(4, 4)[:, :3].T
    return pose(
        _numbers(node, "center", (0, 0, 0)),
        _numbers(node, "rotation", (0, 0, 1, 0)),
        _numbers(node, "scaleFactor", (1, 1, 1)),
        _numbers(node, "scaleOrientation", (0, 0, 1, 0)),
        _numbers(node, "translation", (0, 0, 0)),
    )


def _numbers(node: Node, name: str, otherwise: tuple[float, ...]) -> NDArray[np.float64]:
    value = node.fields.get(name)
    return np.array(otherwise, np.float64) if value is None else value.numbers


def _words(node: Node, name: str) -> tuple[str, ...]:
    value = node.fields.get(name)
    return () if value is None else value.words


def _cube(node: Node, _: _DrawState) -> Node:
    sides = [_numbers(node, name, (2,))[0] for name in ("width", "height", "depth")]
    return Node("Box", node.at, {"size": FieldValue("numbers", node.at, np.array(sides))})


def _round(node: Node, _: _DrawState) -> Node:
    """Return a Cone, a Cylinder or a Sphere, with those of its parts that "parts" names."""
    parts = _words(node, "parts") or ("ALL",)
    flags = {
        name: FieldValue("flag", node.at, flag="ALL" in parts or word in parts)
        for name, word in (("side", "SIDES"), ("bottom", "BOTTOM"), ("top", "TOP"))
    }
    return Node(node.kind, node.at, node.fields | flags)


def _face_set(node: Node, state: _DrawState) -> Node:
    fields = dict(node.fields)
    if state.points is not None:
        fields["coord"] = FieldValue("nodes", node.at, nodes=(state.points,))
    if state.clockwise:
        fields["ccw"] = FieldValue("flag", node.at, flag=False)
    return Node(node.kind, node.at, fields)


_SHAPES: dict[str, Callable[[Node, _DrawState], Node]] = {
    "Cone": _round,
    "Cube": _cube,
    "Cylinder": _round,
    "IndexedFaceSet": _face_set,
    "Sphere": _round,
}
