"""Lines and columns of values in a JSON text, looked up for the few values that a message names.

Values that no pointer leads into are skipped at the speed of C.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import msgspec
from msgspec import Raw

from terratool.text.display import Excerpt, unescape
from terratool.text.numbers import parse_whole
from terratool.text.scan import first_value, members, value_end

_nested = re.compile(rb'[\[{"]').search

_ABOUT = 60
"""Most characters shown before and behind the one at fault."""

_SHORT = 500
"""Most bytes of a value whose brackets are counted; longer ones are skipped by decoding."""
_FEW = 4
"""Most items of a list of numbers that are looked up one by one."""
_LINE_ENDS = (b"\n", b"\r", b"\r\n")


class Address(NamedTuple):
    """Address of a value or key in a JSON text; `findings.Remark` explains the attributes."""

    pointer: str
    on_key: bool = False
    occurrence: int = 1


class Position(NamedTuple):
    """Line and column, both from 1, with the text around."""

    line: int
    column: int
    excerpt: Excerpt


def locate(data: bytes, addresses: Sequence[Address], repeated: bool = False) -> list[Position]:
    """Return the positions of values in a JSON text; an absent value has that of its parent.

    Args:
        data: JSON text in UTF-8.
        addresses: addresses of the values.
        repeated: whether a key may stand twice in an object; then its last value counts.
    """
    return positions_of(data, offsets(data, addresses, repeated))


def offsets(data: bytes, addresses: Sequence[Address], repeated: bool = False) -> list[int]:
    """Return the offsets in bytes of values in a JSON text, with the arguments of `locate`."""
    try:
        root = _Value(data, first_value(data), len(data))
        return [_offset(root, address, repeated) for address in addresses]
    except RecursionError:  # nested too deep for skipping
        from terratool.text.syntax import parse

        text = parse(data.decode("utf-8"))
        return [len(text.text[: text.offset(*address)].encode()) for address in addresses]


def value_at(data: bytes, pointer: str) -> bytes | None:
    """Return the text of the value that a JSON pointer names; None where there is none.

    Args:
        data: a JSON text in UTF-8, in which no key stands twice in an object.
        pointer: JSON pointer of the value, not empty.
    """
    # an absent value has its parent's offset, and no value begins where its parent does
    above, at = offsets(data, [Address(pointer.rpartition("/")[0]), Address(pointer)])
    return None if at == above else data[at : value_end(data, at, len(data))]


def positions_of(data: bytes, at: Sequence[int]) -> list[Position]:
    """Return the positions of offsets in bytes; CRLF, LF and CR end a line."""
    found = {}
    line, column, before = 1, 1, 0
    for offset in sorted(set(at)):
        begin = 1 + max(data.rfind(b"\n", before, offset), data.rfind(b"\r", before, offset))
        if begin:
            feeds, returns, pairs = (data.count(end, before, begin) for end in _LINE_ENDS)
            line, column = line + feeds + returns - pairs, 1
        column += _characters(data[begin or before : offset])
        before = offset
        found[offset] = Position(line, column, _excerpt(data, offset))
    return [found[offset] for offset in at]


def _characters(data: bytes) -> int:
    return len(data) if data.isascii() else len(data.decode("utf-8", "replace"))


def _excerpt(data: bytes, offset: int) -> Excerpt:
    size = 4 * _ABOUT + 4  # bytes of at least _ABOUT + 1 characters
    before = re.split(rb"[\r\n]", data[max(0, offset - size) : offset])[-1].decode(
        "utf-8", "ignore"
    )
    behind = re.split(rb"[\r\n]", data[offset : offset + size])[0].decode("utf-8", "replace")
    if len(before) > _ABOUT:
        before = "…" + before[1 - _ABOUT :]
    if len(behind) > _ABOUT:
        behind = behind[: _ABOUT - 1] + "…"
    before = _printable(before.lstrip())
    return Excerpt(before + _printable(behind.rstrip()), len(before))


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " if c == "\t" else "�" for c in text)


class _Value:
    """A value of a JSON text whose members are looked up on demand."""

    __slots__ = (
        "_asked", "_begins", "_data", "_found", "_inner", "_plain", "_raws", "_rest",
        "end", "start",
    )  # fmt: skip

    def __init__(self, data: bytes, start: int, end: int) -> None:
        self._data = data
        self.start = start
        self.end = end
        # of a list: its items, where those begin that were looked at, and the values among them;
        # of an object: the values of its members. None where they were not asked for
        self._raws: Any = None
        self._begins: list[int] = []
        self._inner: dict[int, _Value] = {}
        # of a list: whether it has no texts, lists and objects, and how many items were asked for
        self._plain: bool | None = None
        self._asked = 0
        # of an object: the members so far, and the others
        self._found: dict[str, list[tuple[int, _Value]]] = {}
        self._rest: Iterator[tuple[str, int, _Value]] | None = None

    def find(self, token: str, occurrence: int) -> tuple[int, _Value] | None:
        """Return the offset and the value of a member by its key, or of an item by its index.

        Args:
            token: reference token of a JSON pointer.
            occurrence: which of the members with this key, from 1; 0 is the last one.
        """
        first = self._data[self.start : self.start + 1]
        if first == b"[":
            index = parse_whole(token)
            return None if index is None else self._item(index)
        if first != b"{":
            return None
        key = unescape(token)
        self._rest = self._rest or self._members()
        while occurrence == 0 or len(self._found.get(key, ())) < occurrence:
            following = next(self._rest, None)
            if following is None:
                break
            name, at, value = following
            self._found.setdefault(name, []).append((at, value))
        found = self._found.get(key, ())
        return found[occurrence - 1] if len(found) >= max(1, occurrence) else None

    def _item(self, index: int) -> tuple[int, _Value] | None:
        if self._plain is None:
            self._plain = _nested(self._data, self.start + 1, self.end) is None
        self._asked += 1
        # each time it goes through the list, so where more are asked for all are decoded
        if self._plain and self._asked <= _FEW:
            return self._number(index)
        raws = self._values(list[Raw])
        if index >= len(raws):
            return None
        begins = self._begins
        while len(begins) <= index:
            behind = begins[-1] + _length(raws[len(begins) - 1]) if begins else self.start + 1
            begins.append(first_value(self._data, behind))
        begin = begins[index]
        if index not in self._inner:
            self._inner[index] = _Value(self._data, begin, begin + _length(raws[index]))
        return begin, self._inner[index]

    def _number(self, index: int) -> tuple[int, _Value] | None:
        """Return the offset and the value of an item of a list of numbers, `true` and the like."""
        *before, rest = self._data[self.start + 1 : self.end].split(b",", index)
        begin = first_value(self._data, self.end - len(rest))
        if len(before) < index or self._data[begin : begin + 1] == b"]":
            return None
        return begin, _Value(self._data, begin, value_end(self._data, begin, self.end))

    def _members(self) -> Iterator[tuple[str, int, _Value]]:
        for begin, key_end, value, end in members(self._data, self.start, self._end_of):
            key: str = msgspec.json.decode(self._data[begin:key_end])
            yield key, begin, _Value(self._data, value, end)

    def _end_of(self, begin: int, key_end: int, value: int) -> int:
        """Return the offset in bytes at which the value of a member ends."""
        end = value_end(self._data, value, value + _SHORT)
        if end < 0:
            raw = self._values(dict[str, Raw])[msgspec.json.decode(self._data[begin:key_end])]
            if self._data.startswith(bytes(raw), value):
                return value + _length(raw)
            # msgspec keeps only the last value of a repeated key
            end = value_end(self._data, value, len(self._data))
        return end

    def _values(self, kind: Any) -> Any:
        if self._raws is None:
            view = memoryview(self._data)[self.start : self.end]
            self._raws = msgspec.json.decode(view, type=kind)
        return self._raws


def _length(raw: Raw) -> int:
    return len(memoryview(raw))


def _offset(root: _Value, address: Address, repeated: bool) -> int:
    value, offset = root, root.start
    tokens = address.pointer.split("/")[1:]
    for depth, token in enumerate(tokens, 1):
        last = depth == len(tokens)
        wanted = address.occurrence if last and address.occurrence > 1 else 0 if repeated else 1
        found = value.find(token, wanted)
        if found is None:
            break
        key_at, value = found
        offset = key_at if last and address.on_key else value.start
    return offset
