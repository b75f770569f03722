"""Where a text stops being JSON, found without reading all of it with care.

Runs of plain members and items are skipped by regular expressions; the careful parser goes on from
the last place that is known to be good. So an error at the end of a large file is found soon.
"""

from __future__ import annotations

import re

from terratool.definition.jsontext import parse
from terratool.definition.misspelt import JsonSyntaxError

_SPACE = r"[ \t\n\r]*+"
_HEX = "[0-9a-fA-F]"
_ESCAPE = (
    r'\\(?:["\\/bfnrt]'
    rf"|u[dD][89abAB]{_HEX}{{2}}\\u[dD][c-fC-F]{_HEX}{{2}}"
    rf"|u(?![dD][89a-fA-F]){_HEX}{{4}})"
)
_TEXT = rf'"(?:[^"\\\x00-\x1f]++|{_ESCAPE})*+"'
_SCALAR = rf"(?:{_TEXT}|-?(?:0|[1-9][0-9]*+)(?:\.[0-9]++)?+(?:[eE][-+]?[0-9]++)?+|true|false|null)"
_NEXT = rf"{_SPACE},{_SPACE}"
_VECTOR = rf"\[{_SPACE}(?:{_SCALAR}(?:{_NEXT}{_SCALAR})*+)?+{_SPACE}\]"
_KEY = rf"{_TEXT}{_SPACE}:{_SPACE}"
_MEMBER = rf"{_KEY}(?:{_SCALAR}|{_VECTOR})"
_RECORD = rf"\{{{_SPACE}(?:{_MEMBER}(?:{_NEXT}{_MEMBER})*+)?+{_SPACE}\}}"

_members = re.compile(rf"(?:{_SPACE}{_MEMBER}{_SPACE},)*+").match
_items = re.compile(rf"(?:{_SPACE}(?:{_SCALAR}|{_VECTOR}|{_RECORD}){_SPACE},)*+").match
_last_member = re.compile(rf"{_SPACE}{_MEMBER}{_SPACE}(?=\}})").match
_last_item = re.compile(rf"{_SPACE}(?:{_SCALAR}|{_VECTOR}|{_RECORD}){_SPACE}(?=\])").match
_open_member = re.compile(rf"{_SPACE}{_KEY}([{{\[])").match
_open_item = re.compile(rf"{_SPACE}([{{\[])").match
_close = re.compile(rf"{_SPACE}([}}\]])").match
_comma = re.compile(rf"{_SPACE},").match
_CLOSING = {"{": "}", "[": "]"}
_DEEP = 100
"""Brackets open at once from which on only the careful parser goes."""


def explain(text: str) -> None:
    """Find the first place at which a text is no JSON.

    Raises:
        MisspeltError: there is one.
    """
    offset, stack, fresh = _skim(text)
    # what came before is replaced by the least that opens the same brackets
    before = "".join('{"":' if bracket == "{" else "[" for bracket in stack[:-1]) + stack[-1:]
    if stack and not fresh:
        before += '"":0,' if stack[-1] == "{" else "0,"
    try:
        parse(before + text[offset:])
    except JsonSyntaxError as error:
        error.offset += offset - len(before)
        raise


def _skim(text: str) -> tuple[int, str, bool]:
    """A place from which to parse on, the brackets open there, and whether the last is empty."""
    good: tuple[int, str, bool] = (0, "", True)
    offset, stack = 0, ""
    while len(stack) < _DEEP:
        inside = stack[-1:]
        run = (_members if inside == "{" else _items)(text, offset) if inside else None
        if run is not None and run.end() > offset:
            offset = run.end()
            good = offset, stack, False
        opening = (_open_member if inside == "{" else _open_item)(text, offset)
        if opening is not None:
            offset = opening.end()
            stack += opening[1]
            good = offset, stack, True
            # an empty one closes at once, unless a comma before it wants an item
            closing = _close(text, offset)
        else:
            last = (_last_member if inside == "{" else _last_item)(text, offset) if inside else None
            if last is None:
                return good
            closing = _close(text, last.end())
        while closing is not None and stack and closing[1] == _CLOSING[stack[-1]]:
            offset, stack = closing.end(), stack[:-1]
            closing = _close(text, offset)
        if stack != good[1]:
            comma = _comma(text, offset)
            if comma is None or not stack:
                return good
            offset = comma.end()
            good = offset, stack, False
    return good
