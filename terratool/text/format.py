"""The canonical layout of JSON texts: values as they are spelled, keys in a given order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import msgspec
from msgspec import Struct, field

from terratool.text.scan import tokens

WIDTH = 120
"""Most characters of a line whose values can be broken."""
_INDENT = "  "


class Layout(Struct):
    """Canonical layout of an object or a list.

    Attributes:
        order: sort position of each key; keys are not sorted where it is empty.
        others: sort position of keys that `order` lacks.
        members: layouts of the values of some keys.
        items: layout of the values of all other keys, or of the items.
        broken: whether it never goes on one line, unless it is empty.
        rows: whether short members share a line.
        lined: whether each item of a list has a line of its own, however long.
    """

    order: Mapping[str, int] = field(default_factory=dict)
    others: float = 0.0
    members: dict[str, Layout] = field(default_factory=dict)
    items: Layout | None = None
    broken: bool = False
    rows: bool = False
    lined: bool = False

    def of(self, key: str) -> Layout:
        """Return the layout of a member's value or an item."""
        return self.members.get(key) or self.items or FREE


FREE = Layout()
"""Layout of values that the format does not define: keys in the order of the text."""


class _JsonNode(Struct):
    """A value of a JSON text with its width.

    Attributes:
        open: opening bracket, or the whole spelling of a scalar.
        layout: layout of the container; None for a scalar.
        members: spelled key, "" in a list, and value of each member.
        width: number of characters when written on one line.
        broken: whether it never goes on one line.
    """

    open: str
    layout: Layout | None = None
    members: list[tuple[str, _JsonNode]] = field(default_factory=list)
    width: int = 0
    broken: bool = False


_Line = str | tuple[_JsonNode, str, str, str]
"""A finished line, or a value with its indentation and the texts before and behind it."""


def canonical(text: str, layout: Layout) -> str:
    """Return a JSON text without syntax errors in its canonical layout, ending with a line feed."""
    return "\n".join([*_lines([(_read(text, layout), "", "", "")]), ""])


def member_lines(key: str, text: str, layout: Layout, depth: int) -> list[str]:
    """Return the lines of one member of an object, or of one item of a list.

    Args:
        key: key as it is spelled; "" for an item.
        text: JSON text of the value.
        layout: layout of the object or list.
        depth: levels of indentation of the member.
    """
    value = _read(text, layout.of(_plain(key)))
    parent = _JsonNode("{" if key else "[", layout, [(key, value)])
    return _lines(list(_rows(parent, _INDENT * depth)))


def _lines(items: list[_Line]) -> list[str]:
    lines: list[str] = []
    pending = items[::-1]  # last first
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            lines.append(item)
            continue
        node, indent, before, behind = item
        fits = not node.broken and len(indent + before + behind) + node.width <= WIDTH
        if fits or not node.members:
            lines.append(f"{indent}{before}{_on_one_line(node)}{behind}")
            continue
        lines.append(f"{indent}{before}{node.open}")
        pending.append(f"{indent}{_close(node)}{behind}")
        pending.extend(reversed(list(_rows(node, indent + _INDENT))))
    return lines


def _read(text: str, layout: Layout) -> _JsonNode:
    top = _JsonNode("[", Layout(items=layout))
    stack = [top]
    key = ""
    for token in tokens(text):
        node = stack[-1]
        if token in "{[":
            assert node.layout is not None
            stack.append(_JsonNode(token, node.layout.of(_plain(key))))
            node.members.append((key, stack[-1]))
            key = ""
        elif token in "}]":
            _finish(stack.pop())
        elif node.open == "{" and not key:
            key = token
        else:
            node.members.append((key, _JsonNode(token, width=len(token))))
            key = ""
    return top.members[0][1]


def _finish(node: _JsonNode) -> None:
    layout = node.layout
    assert layout is not None
    if layout.order and node.open == "{":
        node.members.sort(key=lambda member: layout.order.get(_plain(member[0]), layout.others))
    node.broken = bool(node.members) and (
        layout.broken
        or (layout.lined and node.open == "[")
        or any(value.broken for _, value in node.members)
    )
    inner = sum(value.width + (len(key) + 2 if key else 0) for key, value in node.members)
    padding = 2 if node.open == "{" and node.members else 0
    node.width = 2 + padding + inner + 2 * max(0, len(node.members) - 1)


def _plain(key: str) -> str:
    """Return the key that a spelling in quotes stands for; "" for an item."""
    return msgspec.json.decode(key, type=str) if key else ""


def _close(node: _JsonNode) -> str:
    return "}" if node.open == "{" else "]"


def _on_one_line(node: _JsonNode) -> str:
    parts: list[str] = []
    pending: list[str | _JsonNode] = [node]  # last first
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            parts.append(item)
        elif item.layout is None:
            parts.append(item.open)
        elif not item.members:
            parts.append(item.open + _close(item))
        else:
            space = " " if item.open == "{" else ""
            inner: list[str | _JsonNode] = [item.open + space]
            for place, (key, value) in enumerate(item.members):
                inner += [(", " if place else "") + (f"{key}: " if key else ""), value]
            pending.extend(reversed([*inner, space + _close(item)]))
    return "".join(parts)


def _rows(node: _JsonNode, indent: str) -> Iterator[_Line]:
    """Yield the lines of the members of a broken container; short members share a line."""
    row = ""
    for place, (key, value) in enumerate(node.members):
        comma = "," if place + 1 < len(node.members) else ""
        before = f"{key}: " if key else ""
        if node.open == "[" and node.layout is not None and node.layout.lined:
            yield f"{indent}{_on_one_line(value)}{comma}"
            continue
        if not _may_share_line(node, key, value):
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


def _may_share_line(node: _JsonNode, key: str, value: _JsonNode) -> bool:
    """Tell whether a member may share a line with its neighbours."""
    if value.broken or value.width > WIDTH // 2:
        return False
    if node.open == "[":
        return all(item.open not in "{[" for _, item in value.members) and value.open != "{"
    return node.layout is not None and node.layout.rows and _plain(key) != "descr"
