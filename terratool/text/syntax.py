"""A strict reader of RFC 8259, and messages about texts that were meant to be JSON."""

from __future__ import annotations

import re
from typing import Any

from msgspec import Struct

from terratool.text.display import escape, quote, unescape
from terratool.text.numbers import parse_whole
from terratool.text.scan import TEXT

A_KEY = "a key in double quotes"
A_VALUE = "a value"
NO_TEXT = "Save the file as UTF-8; it may be UTF-16, or no text at all."
_OTHER_FILE = (
    "Check the name of the file; a definition is a JSON text in UTF-8. Of a DEM or a mesh "
    "terratool import-terrain makes one."
)

_word = re.compile(r"[\w.+-]*").match
"""Match the characters that form one number or word, valid or not."""

_hexadecimal = re.compile(r"0[xX]([0-9a-fA-F]+)").fullmatch
_found = re.compile(
    # a text in the wrong quotes, a word, the beginning of a comment, or any one character
    r"""['`‘’‚“”„]([^"'`‘’‚“”„\r\n]*)['`‘’“”]|[\w$][\w$.+-]*|//|/\*|.""",
    re.DOTALL,
).match
_behind_comments = re.compile(r"(?:\s++|(?://|#)[^\n]*+|/\*(?s:.*?)\*/)*+\{?").match
_formula = re.compile(r'[^],}"\r\n]*').match
_BETWEEN = rf'(?:[^][{{}}"]++|{TEXT})*+'
_LEAVES = rf"(?:{_BETWEEN}(?:\{{{_BETWEEN}\}}|\[{_BETWEEN}\]))*+"
_behind_leaves = re.compile(_LEAVES, re.DOTALL).match
_to_bracket = re.compile(rf"{_LEAVES}{_BETWEEN}[][{{}}]", re.DOTALL).match

_QUOTES = "'`‘’‚“”„"
_COMMENTS = ("//", "/*", "#")
_NO_COMMENTS = 'JSON has no comments: put the words in "descr" or in a key that begins with x-.'
_WORDS = {
    "true": "true", "tru": "true", "false": "false", "fals": "false", "null": "null",
    "nul": "null", "nil": "null", "none": "null", "undefined": "null",
}  # fmt: skip


MAX_DEPTH = 10_000
_TOKEN = 16
"""Characters of the longest token that is read at once: a pair of escapes, or a literal."""

_space = re.compile(r"[ \t\n\r]*").match
_number = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?")
_plain = re.compile(r'[^"\\\x00-\x1f]*').match
_hex4 = re.compile(r"[0-9a-fA-F]{4}").match
_nonfinite = re.compile(r"[-+]?(?:nan|inf|infinity)", re.IGNORECASE).fullmatch
_ESCAPES = {
    '"': '"', "\\": "\\", "/": "/", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t",
}  # fmt: skip
_LITERALS = {"true": True, "false": False, "null": None}


class JsonSyntaxError(Exception):
    """Fault in a text that is not valid JSON.

    Attributes:
        code: code of the rule, such as TT101.
        offset: offset of the fault in characters, from 0.
        message: one sentence on the fault.
        hint: one sentence on the remedy.
        fix: number of characters to replace from the offset on, and their replacement; None if
            unclear.
        inside: whether the message ends with "inside an object" or "inside a list", the `innermost`
            one.
    """

    def __init__(
        self, code: str, offset: int, message: str, hint: str, *, inside: bool = False,
        fix: tuple[int, str] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(message)
        self.code = code
        self.offset = offset
        self.message = message
        self.hint = hint
        self.inside = inside
        self.fix = fix


class JsonText(Struct):
    """A parsed JSON text.

    Attributes:
        text: characters of the text.
        value: plain dicts, lists, strings, numbers, booleans and None; the last of duplicates.
        duplicates: (pointer, offset) of each key that stood in its object before.
    """

    text: str
    value: Any
    duplicates: list[tuple[str, int]]
    _places: dict[int, dict[str, tuple[int, int]] | list[int]]
    _start: int

    def offset(self, pointer: str, on_key: bool = False, occurrence: int = 1) -> int:
        """Return the offset of a value (or its key) by its pointer; of its parent if absent."""
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
            elif isinstance(places, list):
                step = parse_whole(step)
                if step is None or step >= len(places):
                    break
                offset = places[step]
            else:
                break
            value = value[step]
        return offset


def parse(text: str) -> JsonText:
    """Parse a JSON text.

    Raises:
        JsonSyntaxError: the text has a character that RFC 8259 does not allow, or nests too deep;
            the error names the first fault.
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
                    raise trailing_text(text, offset)
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
            raise missing_comma(text, offset)
        comma = offset
        offset = _space(text, offset + 1).end()  # type: ignore[union-attr]
        if text.startswith(closing, offset):
            raise JsonSyntaxError(
                "TT101",
                comma,
                f'there is a comma before the closing "{closing}".',
                "Remove the comma; JSON allows none after the last item.",
                fix=(1, ""),
            )
        if closing == "}":
            key, key_at, offset = _key(text, offset)


def _key(text: str, offset: int) -> tuple[str, int, int]:
    if not text.startswith('"', offset):
        raise unexpected_token(text, offset, A_KEY)
    key, end = _string(text, offset)
    end = _space(text, end).end()  # type: ignore[union-attr]
    if not text.startswith(":", end):
        raise unexpected_token(text, end, f'the ":" after the key {quote(key)}')
    return key, offset, _space(text, end + 1).end()  # type: ignore[union-attr]


def _scalar(text: str, offset: int) -> tuple[Any, int]:
    char = text[offset : offset + 1]
    if char == '"':
        return _string(text, offset)
    match = _number.match(text, offset)
    if match is not None:
        end = match.end()
        follow = text[end : end + 1]
        if follow and (follow.isalnum() or follow in ".+-_"):
            raise bad_number(text, offset)
        spelling = match.group()
        if match.group(1) is None and match.group(2) is None:
            try:
                return int(spelling), end
            except ValueError:  # more digits than Python is set to read
                return float(spelling), end
        return float(spelling), end
    spelling = _word(text, offset).group()  # type: ignore[union-attr]
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
        raise bad_number(text, offset)
    raise unexpected_token(text, offset, A_VALUE)


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
            part, end = _read_escape(text, end)
            parts.append(part)
        elif char == "":
            raise JsonSyntaxError(
                "TT101", offset, "the text in quotes does not end.", 'Close it with ".'
            )
        else:
            raise bad_character(text, end)
        match = _plain(text, end)
        parts.append(match.group())  # type: ignore[union-attr]
        end = match.end()  # type: ignore[union-attr]


def _read_escape(text: str, offset: int) -> tuple[str, int]:
    char = text[offset + 1 : offset + 2]
    if char in _ESCAPES:
        return _ESCAPES[char], offset + 2
    match = _hex4(text, offset + 2)
    if char != "u" or match is None:
        raise bad_escape(text, offset)
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
    """Parse only the surroundings of the likely first fault of a text.

    Args:
        text: text that is JSON up to the token at `fault`.
        fault: offset in characters.

    Raises:
        JsonSyntaxError: there is a fault near; the error equals that of `parse`.
    """
    begins, behind = open_brackets(text, max(0, fault - _TOKEN))
    # replace the text before by the shortest one that opens the same brackets
    before = "".join('{"":' if text[at] == "{" else "[" for at in begins[:-1])
    before += "".join(text[at] for at in begins[-1:])
    if behind and (not begins or begins[-1] != behind - 1):  # the last bracket closed a value
        before += '"":[]' if before.endswith("{") else "[]"
    try:
        parse(before + text[behind:])
    except JsonSyntaxError as error:
        error.offset += behind - len(before)
        raise


def bad_encoding(data: bytes, error: UnicodeDecodeError) -> JsonSyntaxError:
    """Return the error for bytes that are no UTF-8."""
    before = data[: error.start].decode("utf-8")
    message = f"the byte 0x{data[error.start]:02X} is not valid UTF-8."
    hint = "Save the file as UTF-8."
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        message = "the file begins as UTF-16 where UTF-8 is expected."
    elif b"\0" in data and data.strip(b"\0 \t\r\n").startswith(b"{"):
        hint = NO_TEXT
    elif b"\0" in data:
        message = f"the file is no text: the byte 0x{data[error.start]:02X} is not valid UTF-8."
        hint = _OTHER_FILE
    return JsonSyntaxError("TT109", len(before), message, hint)


def bad_number(text: str, offset: int) -> JsonSyntaxError:
    """Return the error for a malformed number at an offset."""
    spelling = _word(text, offset).group()  # type: ignore[union-attr]
    meant = _number_meant(spelling)
    hint = f"Write {meant}." if meant else "Write it like 12, -0.5 or 1e-3."
    fix = (len(spelling), meant) if meant else None
    return JsonSyntaxError("TT101", offset, f"{quote(spelling)} is no JSON number.", hint, fix=fix)


def _number_meant(spelling: str) -> str:
    sign = "-" if spelling.startswith("-") else ""
    digits = spelling[1:] if spelling[0] in "+-" else spelling
    if len(digits) > 40:
        return ""
    digits = digits.replace("_", "")
    if match := _hexadecimal(digits):
        return sign + str(int(match[1], 16))
    digits = re.sub(r"^0+(?=[0-9])", "", digits)  # 080
    digits = re.sub(r"^\.(?=[0-9])", "0.", digits)  # .5
    digits = re.sub(r"(?<=[0-9])\.(?![0-9])", "", digits)  # 5.
    return sign + digits if digits[:1] != "-" and _number.fullmatch(digits) else ""


def bad_character(text: str, offset: int) -> JsonSyntaxError:
    """Return the error for a control character at an offset inside of a text in quotes."""
    char = text[offset]
    if char in "\r\n":
        message = "the line ends before the text in quotes does."
        hint = "Close the quotes on the same line; a line end within a text is written \\n."
    elif char == "\t":
        message, hint = "a tab stands bare inside a text.", "Write it as \\t."
    else:
        message = f"{_name(char)} stands bare inside a text."
        hint = f"Remove it, or write it as \\u{ord(char):04x}."
    return JsonSyntaxError("TT101", offset, message, hint)


def bad_escape(text: str, offset: int) -> JsonSyntaxError:
    """Return the error for a backslash at an offset that begins no valid escape."""
    char = text[offset + 1 : offset + 2]
    hint = "Write \\\\ for a backslash."
    if char == "u":
        char = re.split(r'["\\]', text[offset + 1 : offset + 6])[0]
        hint = "Write four hexadecimal digits after \\u, or \\\\ for a backslash."
    spelling = quote("\\" + char) if char.isprintable() else f'"\\" before {_name(char)}'
    message = f"{spelling} is no escape that JSON knows."
    return JsonSyntaxError("TT101", offset, message, hint)


def missing_comma(text: str, offset: int) -> JsonSyntaxError:
    """Return the error for an offset behind an item without a comma or closing bracket."""
    char = text[offset : offset + 1]
    if char and (char in "\"'{[-" or char.isalnum()):
        # the comma belongs behind the previous value
        behind = len(text[:offset].rstrip())
        hint = "Write a comma here."
        if behind == offset and text[offset - 1] == '"':
            hint = 'Write a comma here; a quote within a text is written \\".'
        return JsonSyntaxError("TT101", behind, "there is no comma between two items.", hint)
    in_list = text[innermost(text, offset)] == "["
    hint = ""
    if char == ":" and in_list:
        hint = 'Close the list with "]" before the key, or write an object, in { and }.'
    elif char and char in "+*/^(":
        hint = "JSON does no arithmetic: write the result, or an expression in double quotes."
    return unexpected_token(text, offset, '"," or "]"' if in_list else '"," or "}"', hint)


def trailing_text(text: str, offset: int) -> JsonSyntaxError:
    """Return the error for characters at an offset behind the end of the outermost value."""
    found = _found(text, offset).group()  # type: ignore[union-attr]
    hint = "Remove it; one file holds one JSON object."
    if found in _COMMENTS:
        hint = _NO_COMMENTS
    elif found in ",]}":
        hint = "Remove it, or a bracket before it that closes too early."
    message = f"{_name(found)} stands after the end of the definition."
    return JsonSyntaxError("TT101", offset, message, hint)


def unexpected_token(text: str, offset: int, wanted: str, hint: str = "") -> JsonSyntaxError:
    """Return the error for a wrong character at an offset, or the end of the file."""
    begin = innermost(text, offset)
    if begin < 0:
        wanted = 'the "{" of a definition'
        if not _is_behind_comments(text):
            begins = _found(text, offset).group()  # type: ignore[union-attr]
            if begins.isprintable():
                message = (
                    f'the file is no JSON text: it begins with {quote(begins)}, not with "{{".'
                )
                return JsonSyntaxError("TT101", offset, message, _OTHER_FILE)
    else:
        what, closing = ("an object", "}") if text[begin] == "{" else ("a list", "]")
        if offset == len(text):
            message = f"the file ends inside {what}."
            hint = f'Complete it and close it with "{closing}"; the file may have been cut off.'
            return JsonSyntaxError("TT101", offset, message, hint, inside=True)
        if text[offset] in "]}" and text[offset] != closing:
            message = f'"{text[offset]}" stands inside {what}.'
            hint = f'Complete it and close it with "{closing}" first.'
            return JsonSyntaxError("TT101", offset, message, hint, inside=True)
    found = _found(text, offset).group()  # type: ignore[union-attr]
    if found in _COMMENTS:
        hint = _NO_COMMENTS
    elif found == "\0":
        hint = NO_TEXT
    elif len(found) == 1 and not found.isprintable():
        hint = "Remove it; only spaces, tabs and line ends may stand between values."
    hint = hint or _meant(text, offset, wanted) or f"Write {wanted}."
    message = f"{_name(found)} stands where {wanted} is expected."
    return JsonSyntaxError("TT101", offset, message, hint)


def _is_behind_comments(text: str) -> bool:
    """Tell whether a text is an object behind comments, which JSON does not allow."""
    return _behind_comments(text).group().endswith("{")  # type: ignore[union-attr]


def open_brackets(text: str, offset: int) -> tuple[list[int], int]:
    """Return the offsets of the brackets open at an offset, and the end of the last one before.

    Objects and lists without others in them are skipped at the speed of C.
    """
    begins: list[int] = []
    behind = 0
    while match := _to_bracket(text, behind, offset):
        behind = match.end()
        if text[behind - 1] in "{[":
            begins.append(behind - 1)
        elif begins:
            begins.pop()
    return begins, _behind_leaves(text, behind, offset).end()  # type: ignore[union-attr]


def innermost(text: str, offset: int) -> int:
    """Return the offset of the innermost object or list open at an offset; -1 outside of all."""
    begins, _ = open_brackets(text, offset)
    return begins[-1] if begins else -1


def _meant(text: str, offset: int, wanted: str) -> str:
    """Return the sentence that says what to write at an offset in place of a wrong key or value."""
    if wanted not in (A_KEY, A_VALUE):
        return ""
    match = _found(text, offset)
    found = match.group()  # type: ignore[union-attr]
    if match[1] is not None:  # type: ignore[index]
        return _in_double_quotes(match[1])  # type: ignore[index]
    if found in _QUOTES:
        return "Put texts in double quotes."
    if found == ",":
        return f"Write {wanted} before it, or remove it."
    if wanted == A_KEY and found[0].isdigit() and text[offset - 1] == ",":
        return "Write a decimal number with a point, such as 1.5."
    if wanted == A_VALUE and found.lower() in _WORDS:
        return f"Write {_WORDS[found.lower()]}."
    if wanted == A_VALUE and found.isdecimal() and len(found) <= 40:
        return f"Write {int(found)}."  # in the digits of another script
    if found[0].isalnum() or found[0] in "_$":
        if wanted == A_VALUE:
            found = _formula(text, offset).group().strip()  # type: ignore[union-attr]
        elif not text[match.end() : match.end() + 100].lstrip().startswith(":"):  # type: ignore[union-attr]
            return "Remove it, or write a key in double quotes, a colon and a value."
        return _in_double_quotes(found)
    return ""


def _in_double_quotes(found: str) -> str:
    whole = len(found) <= 60 and found.isprintable()
    return f"Write {quote(found)}." if whole else "Put it in double quotes."


def _name(found: str) -> str:
    if found == '"':
        return "a text"
    if found in _COMMENTS:
        return "a comment"
    if found[0] in _QUOTES and len(found) > 1:
        return f"{found[0]}{quote(found[1:-1])[1:-1]}{found[-1]}"
    return quote(found) if found.isprintable() else f"the character U+{ord(found[0]):04X}"
