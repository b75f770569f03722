"""Adding to the text of a definition: what was there stays as it is, byte for byte.

What is added looks like its neighbours: it stands on lines of its own if they do, is indented by
what they are indented by, and ends lines as they do. Otherwise it has the canonical layout.
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
_key = rb"%s([ \t]*:[ \t]*)" % TEXT.encode()
_colons = re.compile(_key).search
_alone = re.compile(rb"(?:^|[\r\n])[ \t]*(?:%s)?\Z" % _key).search


class Container(NamedTuple):
    """An object or a list.

    Attributes:
        open: offset of its opening bracket.
        first_gap, last_gap: the white space before its first and its last member.
        last: its last member, None if it is empty.
        size: how many there are.
        member: the member of that key, None if there is none.
    """

    open: int
    first_gap: bytes
    last_gap: bytes
    last: Member | None
    size: int
    member: Member | None


class Style(NamedTuple):
    """How a text is laid out at some place.

    Attributes:
        broken: members stand on lines of their own, …
        indent: … behind this white space.
        unit: what a level is indented by.
        line_end: LF, CRLF or CR.
        colon, comma, pad: what stands between key and value, between members, inside of braces.
    """

    broken: bool
    indent: str
    unit: str
    line_end: str
    colon: str
    comma: str
    pad: str


class Edit(NamedTuple):
    """Bytes that take the place of others: text[:begin] + new + text[end:]."""

    begin: int
    end: int
    new: bytes

    def applied(self, data: bytes) -> bytes:
        """The text with the change."""
        return data[: self.begin] + self.new + data[self.end :]


def apply_edits(data: bytes, edits: Iterable[Edit]) -> bytes:
    """A text with edits that do not overlap, in one pass."""
    parts, at = [], 0
    for edit in sorted(edits):
        parts += [data[at : edit.begin], edit.new]
        at = edit.end
    return b"".join([*parts, data[at:]])


def set_member(data: bytes, pointer: str, key: str, value: Any, layout: Layout) -> Edit:
    """What sets a member of an object: the value of that key changes, or it is added at the end.

    Args:
        data: a valid definition in UTF-8, without a byte order mark.
        pointer: JSON pointer (RFC 6901) of the object, which is there: `elemTypes`, an element, or
            "" for the definition.
        key: of the member.
        value: plain values: a primitive, the children of an element, or tracks.
        layout: of the definition.
    """
    inside = _container(data, offsets(data, [Address(pointer)])[0], key)
    style = _style(data, inside)
    if inside.member is None:
        spelled = json.dumps(key, ensure_ascii=False)
        return _added(inside, style, _text(style, pointer, spelled, value, layout))
    member = inside.member
    spelled = data[member.begin : member.key_end].decode()
    colon = ": " if style.broken else style.colon
    text = _text(style, pointer, spelled, value, layout)[len(spelled + colon) :]
    return Edit(member.value, member.end, text.encode())


def append_child(
    data: bytes, pointer: str, element: dict[str, Any], has_children: bool, layout: Layout
) -> Edit:
    """What adds an element at the end of the children of another one.

    Args:
        data: a valid definition in UTF-8, without a byte order mark.
        pointer: JSON pointer of the parent.
        element: plain values.
        has_children: whether the parent has the key `children`.
        layout: of the definition.
    """
    if not has_children:
        return set_member(data, pointer, "children", [element], layout)
    where = pointer + "/children"
    inside = _container(data, offsets(data, [Address(where)])[0], None)
    style = _style(data, inside)
    return _added(inside, style, _text(style, where, "", element, layout))


def _added(inside: Container, style: Style, text: str) -> Edit:
    """What puts a text behind the last member."""
    if inside.last is not None:
        before = style.line_end + style.indent if style.broken else style.comma[1:]
        return Edit(inside.last.end, inside.last.end, f",{before}{text}".encode())
    at = inside.open + 1
    if style.broken:
        # white space that is there already goes on to stand before the closing bracket
        behind = style.line_end + style.indent.removesuffix(style.unit)
        if _line_end(inside.first_gap):
            behind = ""
        return Edit(at, at, f"{style.line_end}{style.indent}{text}{behind}".encode())
    return Edit(at, at, f"{style.pad}{text}{'' if inside.first_gap else style.pad}".encode())


def _style(data: bytes, inside: Container) -> Style:
    """How the members of an object or a list are laid out; if it has none, its surroundings."""
    found = _line_end(data)
    line_end = found.group().decode() if found else "\n"
    outer = _indent_of(data, inside.open)
    spaced = _colon(data, inside)
    colon, comma = (spaced, ", " if spaced[1:] else ",")
    if inside.last is None:
        # on a line of its own where the key of the container begins one, or is in one that does
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
    return Style(broken, indent, unit or _unit(data), line_end, colon, comma, pad)


def _indent_of(data: bytes, at: int) -> str:
    """The white space at the beginning of a line."""
    begin = 1 + max(data.rfind(b"\n", 0, at), data.rfind(b"\r", 0, at))
    return _blank(data, begin).group().decode()  # type: ignore[union-attr]


def _unit(data: bytes) -> str:
    """What the first line that is indented is indented by; two spaces, if none is."""
    found = _indented(data)
    return found[1].decode() if found else "  "


def _colon(data: bytes, inside: Container) -> str:
    """What stands between a key and its value, in the container or else in the first member."""
    at = 0 if inside.last is None or inside.last.key_end == inside.last.begin else inside.last.begin
    found = _colons(data, at)
    return found[1].decode() if found else ": "


def _text(style: Style, where: str, key: str, value: Any, layout: Layout) -> str:
    """A member, or an item if the key is empty, from its first character to its last."""
    if not style.broken:
        return (key + style.colon if key else "") + _inline(value, style)
    # in the canonical layout, at the depth that it will have there
    depth = where.count("/") + 1
    for token in where.split("/")[1:]:
        layout = layout.of(unescape(token))
    lines = member_lines(key, json.dumps(value, ensure_ascii=False), layout, depth)
    joint = style.line_end + style.indent
    return joint.join(_indented_by(line[2 * depth :], style.unit) for line in lines)


def _indented_by(line: str, unit: str) -> str:
    bare = line.lstrip(" ")
    return unit * ((len(line) - len(bare)) // 2) + bare


def _inline(value: Any, style: Style) -> str:
    """Plain values on one line."""
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
    """The object or list that begins there, and what stands in it."""
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
