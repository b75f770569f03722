"""Scanner of valid JSON texts: offsets of members and values, without decoding the values."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

TEXT = r'"(?:[^"\\]++|\\.)*+"'
"""Regular expression of a text in double quotes."""
_TEXT = TEXT.encode()

_tokens = re.compile(TEXT + r"|[-+.0-9a-zA-Z]++|[{}\[\]]").finditer
_gap = re.compile(rb"[ \t\n\r,]*").match
_key = re.compile(rb"(%s)[ \t\n\r]*:[ \t\n\r]*" % _TEXT).match
_text = re.compile(_TEXT).match
_scalar = re.compile(rb"[^,\]} \t\n\r]+").match
_bracket = re.compile(rb'%s|[{}\[\]"]' % _TEXT).finditer


def tokens(text: str) -> Iterator[str]:
    """Yield the brackets and scalars of a JSON text, as they are spelled."""
    for match in _tokens(text):
        yield match.group()


class Member(NamedTuple):
    """Offsets in bytes of a member of an object or an item of a list; an item's key is empty."""

    begin: int
    key_end: int
    value: int
    end: int


def first_value(data: bytes, at: int = 0) -> int:
    """Return the offset of the next value or key behind white space and commas."""
    return _gap(data, at).end()  # type: ignore[union-attr]


def value_end(data: bytes, begin: int, limit: int) -> int:
    """Return the offset of a value's end; -1 if an object, list or text goes beyond a limit."""
    first = data[begin : begin + 1]
    if first == b'"':
        match = _text(data, begin, limit)
        return match.end() if match else -1
    if first not in (b"{", b"["):
        return _scalar(data, begin).end()  # type: ignore[union-attr]
    depth = 0
    for match in _bracket(data, begin, limit):
        sign = match.group()
        if sign == b'"':  # an unfinished text, whatever it contains
            return -1
        depth += (sign in (b"{", b"[")) - (sign in (b"}", b"]"))
        if depth == 0:
            return match.end()
    return -1


def members(data: bytes, start: int, end_of: Callable[[int, int, int], int]) -> Iterator[Member]:
    """Yield the members of the object, or the items of the list, that begins at an offset.

    Args:
        data: a text in UTF-8.
        start: offset of the opening bracket.
        end_of: returns the end of a value by the first three offsets of its `Member`.
    """
    listed = data[start : start + 1] == b"["
    at = start + 1
    while True:
        begin = key_end = value = first_value(data, at)
        if data[begin : begin + 1] in (b"}", b"]"):
            return
        if not listed:
            key = _key(data, begin)
            key_end, value = key.end(1), key.end()  # type: ignore[union-attr]
        at = end_of(begin, key_end, value)
        yield Member(begin, key_end, value, at)
