"""The canonical layout: values as they are spelled, keys in the order of the format."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import msgspec

from terratool.definition.keys import ALL_KEYS, document_kind
from terratool.definition.model import Definition, Element, Primitive, Surface, Track
from terratool.definition.vehicle import (
    AxleText,
    ClassesText,
    CogText,
    MarginsText,
    OverhangText,
    VehicleText,
    WheelsText,
)

WIDTH = 120
"""Characters of a line, where its values can be broken."""
_INDENT = "  "

_token = re.compile(
    r'[ \t\n\r]*(?:(?P<scalar>"(?:[^"\\]++|\\.)*+"|[-+.0-9a-zA-Z]++)|(?P<sign>[{}\[\],:]))'
).match

# what an object or list is, by that around it and its key; those around have names, too
_ROLES = {
    ("terrain", "surfTypes"): "surfaces",
    ("terrain", "elemTypes"): "primitives",
    ("terrain", "elemTree"): "element",
    ("element", "children"): "elements",
    ("terrain", "tracks"): "tracks",
    ("vehicle", "wheels"): "wheels",
    ("vehicle", "axles"): "axles",
    ("vehicle", "cog"): "cog",
    ("vehicle", "overhang"): "overhang",
    ("vehicle", "margins"): "margins",
    ("vehicle", "classes"): "classes",
}
_ITEMS = {
    "surfaces": "surface", "primitives": "primitive", "elements": "element", "tracks": "track",
    "axles": "axle",
}  # fmt: skip
_KINDS = {
    "terrain": Definition, "surface": Surface, "primitive": Primitive, "element": Element,
    "track": Track, "vehicle": VehicleText, "wheels": WheelsText, "axle": AxleText, "cog": CogText,
    "overhang": OverhangText, "margins": MarginsText, "classes": ClassesText,
}  # fmt: skip
_ALWAYS_BROKEN = ("terrain", "surfaces", "primitives", "vehicle")
_LAST = ("surfTypes", "elemTypes", "elemTree", "children")
"""Keys before which those that the format does not have are put."""


@dataclass(slots=True)
class _Node:
    """A value.

    Attributes:
        open: its bracket, or all of a scalar.
        role: what it is.
        members: key as it is spelled, "" in a list, and value.
        width: characters if written on one line.
        broken: it is never written on one line.
    """

    open: str
    role: str
    members: list[tuple[str, _Node]] = field(default_factory=list)
    width: int = 0
    broken: bool = False


def canonical(text: str) -> str:
    """A JSON text without errors of syntax in its canonical layout, ending with a line end."""
    kind = "vehicle" if document_kind(text.encode()) == "vehicle" else "terrain"
    lines: list[str] = []
    # what is still to be written, last first: a line, or a value with what is around it
    pending: list[str | tuple[_Node, str, str, str]] = [(_read(text, kind), "", "", "")]
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            lines.append(item)
            continue
        node, indent, before, behind = item
        if not node.broken and len(indent + before + behind) + node.width <= WIDTH:
            lines.append(f"{indent}{before}{_on_one_line(node)}{behind}")
            continue
        if not node.members:
            lines.append(f"{indent}{before}{_on_one_line(node)}{behind}")
            continue
        lines.append(f"{indent}{before}{node.open}")
        pending.append(f"{indent}{_close(node)}{behind}")
        pending.extend(reversed(list(_rows(node, indent + _INDENT))))
    return "\n".join([*lines, ""])


def _read(text: str, kind: str) -> _Node:
    top = _Node("[", "free")
    stack = [top]
    key = ""
    at = 0
    while (match := _token(text, at)) is not None:
        at = match.end()
        node = stack[-1]
        token = match["sign"] or match["scalar"]
        if token in ("{", "["):
            role = _ROLES.get((node.role, _plain(key)), _ITEMS.get(node.role, "free"))
            stack.append(_Node(token, kind if node is top else role))
            node.members.append((key, stack[-1]))
            key = ""
        elif token in ("}", "]"):
            _finish(stack.pop())
        elif match["scalar"]:
            if node.open == "{" and not key:
                key = token
            else:
                node.members.append((key, _Node(token, "scalar", width=len(token))))
                key = ""
    return top.members[0][1]


def _finish(node: _Node) -> None:
    if node.role in _KINDS and node.open == "{":
        order = {name: place for place, name in enumerate(ALL_KEYS[_KINDS[node.role]])}
        others = min((order[name] for name in _LAST if name in order), default=len(order)) - 0.5
        node.members.sort(key=lambda member: order.get(_plain(member[0]), others))
    node.broken = bool(node.members) and (
        node.role in _ALWAYS_BROKEN
        or node.role in ("elements", "tracks")
        or any(value.broken for _, value in node.members)
    )
    inner = sum(value.width + (len(key) + 2 if key else 0) for key, value in node.members)
    padding = 2 if node.open == "{" and node.members else 0
    node.width = 2 + padding + inner + 2 * max(0, len(node.members) - 1)


def _plain(key: str) -> str:
    """The key behind its spelling."""
    return msgspec.json.decode(key, type=str) if key else ""


def _close(node: _Node) -> str:
    return "}" if node.open == "{" else "]"


def _on_one_line(node: _Node) -> str:
    parts: list[str] = []
    pending: list[str | _Node] = [node]  # last first
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            parts.append(item)
        elif item.role == "scalar":
            parts.append(item.open)
        elif not item.members:
            parts.append(item.open + _close(item))
        else:
            space = " " if item.open == "{" else ""
            inner: list[str | _Node] = [item.open + space]
            for place, (key, value) in enumerate(item.members):
                inner += [(", " if place else "") + (f"{key}: " if key else ""), value]
            pending.extend(reversed([*inner, space + _close(item)]))
    return "".join(parts)


def _rows(node: _Node, indent: str) -> Iterator[str | tuple[_Node, str, str, str]]:
    """The members of a broken object or list: short ones share a line."""
    row = ""
    for place, (key, value) in enumerate(node.members):
        comma = "," if place + 1 < len(node.members) else ""
        before = f"{key}: " if key else ""
        if not _shares(node, key, value):
            if row:
                yield indent + row
                row = ""
            yield value, indent, before, comma
            continue
        piece = before + _on_one_line(value) + comma
        if row and len(f"{indent}{row} {piece}") > WIDTH:
            yield indent + row
            row = ""
        row = f"{row} {piece}" if row else piece
    if row:
        yield indent + row


def _shares(node: _Node, key: str, value: _Node) -> bool:
    """Whether a member may share a line with its neighbours."""
    if value.broken or value.width > WIDTH // 2:
        return False
    if node.open == "[":
        return all(item.open not in "{[" for _, item in value.members) and value.open != "{"
    return node.role in ("surface", "primitive", "element", "track") and _plain(key) != "descr"
