"""A strict RFC 8259 reader that knows where everything stands."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from terratool.text import syntax
from terratool.text.display import escape, shown, unescape
from terratool.text.source import line_starts
from terratool.text.syntax import A_KEY, A_VALUE, JsonSyntaxError, open_brackets

MAX_DEPTH = 10_000
_TOKEN = 16
"""Characters of the longest token that is read at once: a pair of escapes, or a literal."""

_space = re.compile(r"[ \t\n\r]*").match
_number = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?").match
_plain = re.compile(r'[^"\\\x00-\x1f]*').match
_hex4 = re.compile(r"[0-9a-fA-F]{4}").match
_nonfinite = re.compile(r"[-+]?(?:nan|inf|infinity)", re.IGNORECASE).fullmatch
_ESCAPES = {
    '"': '"', "\\": "\\", "/": "/", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t",
}  # fmt: skip
_tokens = re.compile(r'"(?:[^"\\]++|\\.)*+"|[-+.0-9a-zA-Z]++|[{}\[\]]').finditer
_LITERALS = {"true": True, "false": False, "null": None}


@dataclass(slots=True)
class JsonText:
    """A parsed text.

    Attributes:
        text: the characters.
        value: plain dicts, lists, strings, numbers, booleans and None; the last of duplicates.
        duplicates: (pointer, offset) of each key that stood in its object before.
    """

    text: str
    value: Any
    duplicates: list[tuple[str, int]]
    _places: dict[int, dict[str, tuple[int, int]] | list[int]]
    _start: int
    _line_starts: list[int] = field(default_factory=list)

    def offset(self, pointer: str, on_key: bool = False, occurrence: int = 1) -> int:
        """Where the value (or its key) that a pointer names begins; its parent if absent."""
        if occurrence > 1:
            again = [offset for repeated, offset in self.duplicates if repeated == pointer]
            return again[occurrence - 2]
        value, offset = self.value, self._start
        for token in pointer.split("/")[1:]:
            places = self._places.get(id(value))
            step: Any = unescape(token) if isinstance(places, dict) else token
            if isinstance(places, dict) and step in places:
                key, offset = places[step]
                offset = key if on_key else offset
            elif isinstance(places, list) and step.isdigit() and int(step) < len(places):
                step = int(step)
                offset = places[step]
            else:
                break
            value = value[step]
        return offset

    def line_column(self, offset: int) -> tuple[int, int]:
        """Line and column, both from 1, of an offset; CRLF, LF and CR end a line."""
        if not self._line_starts:
            self._line_starts.extend(line_starts(self.text))
        line = bisect_right(self._line_starts, offset)
        return line, offset - self._line_starts[line - 1] + 1


def tokens(text: str) -> Iterator[str]:
    """The brackets and scalars of a text without errors of syntax, as they are spelled."""
    for match in _tokens(text):
        yield match.group()


def parse(text: str) -> JsonText:
    """Parse a text.

    Raises:
        JsonSyntaxError: at the first character that RFC 8259 does not allow, or that nests too
            deep.
    """
    start = _space(text, 0).end()  # type: ignore[union-attr]
    if start == len(text):
        raise JsonSyntaxError(
            "TT101", start, "the file is empty.", "Write a terrain or a vehicle, a JSON object."
        )
    places: dict[int, Any] = {}
    duplicates: list[tuple[str, int]] = []
    stack: list[Any] = []
    path: list[str] = []
    container: Any = None
    marks: Any = None
    key: str | None = None
    key_at = 0
    value: Any
    offset = start
    while True:
        # a value begins at offset
        char = text[offset : offset + 1]
        begin = offset
        opened = False
        if char == "{" or char == "[":
            opened = True
            value = {} if char == "{" else []
            offset += 1
            if len(stack) >= MAX_DEPTH:
                raise JsonSyntaxError(
                    "TT108",
                    begin,
                    f"the text nests deeper than {MAX_DEPTH:,} levels.",
                    "Give elements finer grids in place of more levels.",
                )
        else:
            value, offset = _scalar(text, offset)
        if isinstance(container, dict):
            assert key is not None
            if key in container:
                duplicates.append(("".join(path) + "/" + escape(key), key_at))
            container[key] = value
            marks[key] = (key_at, begin)
        elif isinstance(container, list):
            container.append(value)
            marks.append(begin)
        else:
            top = value
        if opened:
            if container is not None:
                token = key if isinstance(container, dict) else str(len(container) - 1)
                path.append("/" + escape(token or ""))
            stack.append((container, marks))
            container = value
            marks = places[id(value)] = {} if char == "{" else []
            offset = _space(text, offset).end()  # type: ignore[union-attr]
            closing = "}" if char == "{" else "]"
            if not text.startswith(closing, offset):
                if char == "{":
                    key, key_at, offset = _key(text, offset)
                continue
        # after a value, or at the closing of an empty container
        while True:
            offset = _space(text, offset).end()  # type: ignore[union-attr]
            if container is None:
                if offset < len(text):
                    raise syntax.left_over(text, offset)
                return JsonText(text, top, duplicates, places, start)
            char = text[offset : offset + 1]
            closing = "}" if isinstance(container, dict) else "]"
            if char == closing:
                offset += 1
                container, marks = stack.pop()
                if path:
                    path.pop()
                continue
            break
        if char != ",":
            raise syntax.expected_comma(text, offset)
        comma = offset
        offset = _space(text, offset + 1).end()  # type: ignore[union-attr]
        if text.startswith(closing, offset):
            raise JsonSyntaxError(
                "TT101",
                comma,
                f'there is a comma before the closing "{closing}".',
                "Remove the comma; JSON allows none after the last item.",
            )
        if closing == "}":
            key, key_at, offset = _key(text, offset)


def _key(text: str, offset: int) -> tuple[str, int, int]:
    if not text.startswith('"', offset):
        raise syntax.unexpected(text, offset, A_KEY)
    key, end = _string(text, offset)
    end = _space(text, end).end()  # type: ignore[union-attr]
    if not text.startswith(":", end):
        raise syntax.unexpected(text, end, f'the ":" after the key {shown(key)}')
    return key, offset, _space(text, end + 1).end()  # type: ignore[union-attr]


def _scalar(text: str, offset: int) -> tuple[Any, int]:
    char = text[offset : offset + 1]
    if char == '"':
        return _string(text, offset)
    match = _number(text, offset)
    if match is not None:
        end = match.end()
        follow = text[end : end + 1]
        if follow and (follow.isalnum() or follow in ".+-_"):
            raise syntax.bad_number(text, offset)
        spelling = match.group()
        if match.group(1) is None and match.group(2) is None:
            try:
                return int(spelling), end
            except ValueError:  # more digits than Python is set to read
                return float(spelling), end
        return float(spelling), end
    spelling = syntax.token(text, offset).group()  # type: ignore[union-attr]
    if spelling in _LITERALS:
        return _LITERALS[spelling], offset + len(spelling)
    if _nonfinite(spelling):
        raise JsonSyntaxError(
            "TT107",
            offset,
            f"{spelling} is no number in JSON.",
            "Write a finite number, or leave the key out.",
        )
    if char and char in "+-.":
        raise syntax.bad_number(text, offset)
    raise syntax.unexpected(text, offset, A_VALUE)


def _string(text: str, offset: int) -> tuple[str, int]:
    match = _plain(text, offset + 1)
    end = match.end()  # type: ignore[union-attr]
    if text.startswith('"', end):
        return text[offset + 1 : end], end + 1
    parts = [text[offset + 1 : end]]
    while True:
        char = text[end : end + 1]
        if char == '"':
            return "".join(parts), end + 1
        if char == "\\":
            part, end = _escaped(text, end)
            parts.append(part)
        elif char == "":
            raise JsonSyntaxError(
                "TT101", offset, "the text in quotes does not end.", 'Close it with ".'
            )
        else:
            raise syntax.bad_character(text, end)
        match = _plain(text, end)
        parts.append(match.group())  # type: ignore[union-attr]
        end = match.end()  # type: ignore[union-attr]


def _escaped(text: str, offset: int) -> tuple[str, int]:
    char = text[offset + 1 : offset + 2]
    if char in _ESCAPES:
        return _ESCAPES[char], offset + 2
    match = _hex4(text, offset + 2)
    if char != "u" or match is None:
        raise syntax.bad_escape(text, offset)
    unit = int(match.group(), 16)
    end = offset + 6
    if 0xD800 <= unit < 0xDC00 and text.startswith("\\u", end):
        low = _hex4(text, end + 2)
        if low is not None and 0xDC00 <= int(low.group(), 16) < 0xE000:
            unit = 0x10000 + ((unit - 0xD800) << 10) + (int(low.group(), 16) - 0xDC00)
            end += 6
    if 0xD800 <= unit < 0xE000:
        raise JsonSyntaxError(
            "TT101",
            offset,
            f'"{text[offset : offset + 6]}" is half of a surrogate pair.',
            "Write the character itself, or both halves.",
        )
    return chr(unit), end


def parse_near(text: str, fault: int) -> None:
    """Read what may be the first place at which a text is no JSON, and a little before it.

    Args:
        text: the text, which is JSON up to the token at `fault`.
        fault: offset in characters.

    Raises:
        JsonSyntaxError: the same one as `parse` raises, if there is one near.
    """
    begins, behind = open_brackets(text, max(0, fault - _TOKEN))
    # what came before is replaced by the least that opens the same brackets
    before = "".join('{"":' if text[at] == "{" else "[" for at in begins[:-1])
    before += "".join(text[at] for at in begins[-1:])
    if behind and (not begins or begins[-1] != behind - 1):  # the last bracket closed a value
        before += '"":[]' if before.endswith("{") else "[]"
    try:
        parse(before + text[behind:])
    except JsonSyntaxError as error:
        error.offset += behind - len(before)
        raise
