"""Edits of the text of a definition that leave all other bytes as they are.

An added member follows its neighbours: it stands on a line of its own if they do, with their
indentation and line ends. Otherwise it gets the canonical layout.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

from terratool.text.display import unescape
from terratool.text.format import Layout, member_lines
from terratool.text.locate import Address, offsets
from terratool.text.scan import TEXT, Member, first_value, members, value_end

_line_end = re.compile(rb"\r\n|\n|\r").search
_blank = re.compile(rb"[ \t]*").match
_indented = re.compile(rb"[\r\n]([ \t]+)[^ \t\r\n]").search
_pad = re.compile(rb"\{?([ \t]*)").match
_key = rb"%s([ \t]*:[ \t]*)" % TEXT.encode()
_colons = re.compile(_key).search
_alone = re.compile(rb"(?:^|[\r\n])[ \t]*(?:%s)?\Z" % _key).search


class Container(NamedTuple):
    """An object or a list in a JSON text.

    Attributes:
        open: offset in bytes of the opening bracket.
        first_gap: white space before the first member.
        last_gap: white space before the last member.
        last: last member; None if the container is empty.
        size: number of members.
        member: member of the key that is looked for; None if there is none.
    """

    open: int
    first_gap: bytes
    last_gap: bytes
    last: Member | None
    size: int
    member: Member | None


class Style(NamedTuple):
    """Layout of the members of one container.

    Attributes:
        broken: whether each member stands on a line of its own.
        indent: white space before a member on its own line.
        unit: white space of one level of indentation.
        line_end: LF, CRLF or CR.
        colon: characters between a key and its value.
        comma: characters between two members.
        pad: white space inside of braces.
    """

    broken: bool
    indent: str
    unit: str
    line_end: str
    colon: str
    comma: str
    pad: str


class Edit(NamedTuple):
    """Replacement of a range of bytes: text[:begin] + new + text[end:]."""

    begin: int
    end: int
    new: bytes

    def apply(self, data: bytes) -> bytes:
        """Return a text with this edit made."""
        return data[: self.begin] + self.new + data[self.end :]


def apply_edits(data: bytes, edits: Iterable[Edit]) -> bytes:
    """Return a text with edits made that do not overlap, in one pass."""
    parts, at = [], 0
    for edit in sorted(edits):
        parts += [data[at : edit.begin], edit.new]
        at = edit.end
    return b"".join([*parts, data[at:]])


def set_member(data: bytes, pointer: str, key: str, value: Any, layout: Layout) -> Edit:
    """Return the edit that sets a member of an object, in place or as its new last member.

    Args:
        data: a valid definition in UTF-8, without a byte order mark.
        pointer: JSON pointer (RFC 6901) of the object, which exists: `elemTypes`, an element, or ""
            for the definition.
        key: key of the member.
        value: plain value: a primitive, the children of an element, or tracks.
        layout: canonical layout of the definition.
    """
    inside = _container(data, offsets(data, [Address(pointer)])[0], key)
    style = _style(data, inside)
    if inside.member is None:
        spelled = json.dumps(key, ensure_ascii=False)
        return _insertion(inside, style, _text(style, pointer, spelled, value, layout))
    member = inside.member
    spelled = data[member.begin : member.key_end].decode()
    colon = ": " if style.broken else style.colon
    text = _text(style, pointer, spelled, value, layout)[len(spelled + colon) :]
    return Edit(member.value, member.end, text.encode())


def insert_member(data: bytes, pointer: str, key: str, value: Any, layout: Layout) -> Edit:
    """Return the edit that adds a member to an object where the canonical order has it.

    Args:
        data: a valid definition in UTF-8, without a byte order mark.
        pointer: JSON pointer of the object, which lacks the key.
        key: key of the member, one of the canonical order.
        value: plain value.
        layout: canonical layout of the definition.
    """
    start, own = offsets(data, [Address(pointer)])[0], layout
    for token in pointer.split("/")[1:]:
        own = own.of(unescape(token))
    for member in members(data, start, lambda _, __, value: value_end(data, value, len(data))):
        name = json.loads(data[member.begin : member.key_end])
        if own.order.get(name, own.others) > own.order[key]:
            break
    else:
        return set_member(data, pointer, key, value, layout)
    style = _style(data, _container(data, start, None))
    text = _text(style, pointer, json.dumps(key, ensure_ascii=False), value, layout)
    gap = style.line_end + style.indent if style.broken else style.comma[1:]
    return Edit(member.begin, member.begin, f"{text},{gap}".encode())


def append_child(
    data: bytes, pointer: str, element: dict[str, Any], has_children: bool, layout: Layout
) -> Edit:
    """Return the edit that adds an element as the last child of another one.

    Args:
        data: a valid definition in UTF-8, without a byte order mark.
        pointer: JSON pointer of the parent.
        element: the new element in plain values.
        has_children: whether the parent has the key `children`.
        layout: canonical layout of the definition.
    """
    if not has_children:
        return set_member(data, pointer, "children", [element], layout)
    return append_item(data, pointer + "/children", element, layout)


def append_item(data: bytes, pointer: str, item: Any, layout: Layout) -> Edit:
    """Return the edit that adds an item at the end of a list.

    Args:
        data: a valid definition in UTF-8, without a byte order mark.
        pointer: JSON pointer of the list.
        item: plain value.
        layout: canonical layout of the definition.
    """
    inside = _container(data, offsets(data, [Address(pointer)])[0], None)
    style = _style(data, inside)
    return _insertion(inside, style, _text(style, pointer, "", item, layout))


def _insertion(inside: Container, style: Style, text: str) -> Edit:
    """Return the edit that inserts a text behind the last member of a container."""
    if inside.last is not None:
        before = style.line_end + style.indent if style.broken else style.comma[1:]
        return Edit(inside.last.end, inside.last.end, f",{before}{text}".encode())
    at = inside.open + 1
    if style.broken:
        # existing white space stays before the closing bracket
        behind = style.line_end + style.indent.removesuffix(style.unit)
        if _line_end(inside.first_gap):
            behind = ""
        return Edit(at, at, f"{style.line_end}{style.indent}{text}{behind}".encode())
    return Edit(at, at, f"{style.pad}{text}{'' if inside.first_gap else style.pad}".encode())


def _style(data: bytes, inside: Container) -> Style:
    """Return the layout of the members of a container, or of its surroundings if it is empty."""
    found = _line_end(data)
    line_end = found.group().decode() if found else "\n"
    outer = _indent_of(data, inside.open)
    spaced = _colon(data, inside)
    colon, comma = (spaced, ", " if spaced[1:] else ",")
    if inside.last is None:
        # members get lines of their own if the container's key begins a line
        alone = found is not None and _alone(data[: inside.open]) is not None
        broken = alone or bool(_line_end(inside.first_gap))
        unit = _unit(data)
        pad = " " if comma != "," and data[inside.open : inside.open + 1] == b"{" else ""
        return Style(broken, outer + unit, unit, line_end, colon, comma, pad)
    gap = inside.last_gap if _line_end(inside.last_gap) else inside.first_gap
    broken = bool(_line_end(gap))
    indent = re.split(rb"[\r\n]", gap)[-1].decode() if broken else outer
    if not broken and inside.size > 1:
        comma = "," + inside.last_gap.decode()
    unit = indent.removeprefix(outer) if indent.startswith(outer) and indent != outer else ""
    pad = "" if broken else inside.first_gap.decode()
    if not broken and data[inside.open : inside.open + 1] == b"[":  # as the last object in it
        pad = _pad(data, inside.last.begin).group(1).decode()  # type: ignore[union-attr]
    return Style(broken, indent, unit or _unit(data), line_end, colon, comma, pad)


def _indent_of(data: bytes, at: int) -> str:
    """Return the white space at the beginning of the line that holds an offset."""
    begin = 1 + max(data.rfind(b"\n", 0, at), data.rfind(b"\r", 0, at))
    return _blank(data, begin).group().decode()  # type: ignore[union-attr]


def _unit(data: bytes) -> str:
    """Return the indentation of the first indented line; two spaces if there is none."""
    found = _indented(data)
    return found[1].decode() if found else "  "


def _colon(data: bytes, inside: Container) -> str:
    """Return the characters between a key and its value in a container, or else in the text."""
    at = 0 if inside.last is None or inside.last.key_end == inside.last.begin else inside.last.begin
    found = _colons(data, at)
    return found[1].decode() if found else ": "


def _text(style: Style, where: str, key: str, value: Any, layout: Layout) -> str:
    """Return the text of a member, or of an item if the key is empty, without commas around it."""
    if not style.broken:
        return (key + style.colon if key else "") + _inline(value, style)
    # the canonical layout at the depth of the place
    depth = where.count("/") + 1
    for token in where.split("/")[1:]:
        layout = layout.of(unescape(token))
    lines = member_lines(key, json.dumps(value, ensure_ascii=False), layout, depth)
    joint = style.line_end + style.indent
    return joint.join(_reindent(line[2 * depth :], style.unit) for line in lines)


def _reindent(line: str, unit: str) -> str:
    bare = line.lstrip(" ")
    return unit * ((len(line) - len(bare)) // 2) + bare


def _inline(value: Any, style: Style) -> str:
    """Return a plain value as JSON on one line."""
    if isinstance(value, dict):
        members = (
            json.dumps(key, ensure_ascii=False) + style.colon + _inline(item, style)
            for key, item in value.items()
        )
        return "{" + style.pad + style.comma.join(members) + style.pad + "}"
    if isinstance(value, list):
        return "[" + style.comma.join(_inline(item, style) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False)


def _container(data: bytes, start: int, key: str | None) -> Container:
    """Return the object or list that begins at an offset, with its member of a key."""
    inside = list(members(data, start, lambda _, __, value: value_end(data, value, len(data))))
    if not inside:
        gap = data[start + 1 : first_value(data, start + 1)]
        return Container(start, gap, gap, None, 0, None)
    first_gap = last_gap = data[start + 1 : inside[0].begin]
    if len(inside) > 1:
        last_gap = data[inside[-2].end : inside[-1].begin].partition(b",")[2]
    found = None
    for member in inside:
        if key is not None and json.loads(data[member.begin : member.key_end]) == key:
            found = member
    return Container(start, first_gap, last_gap, inside[-1], len(inside), found)
