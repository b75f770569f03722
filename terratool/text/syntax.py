"""What to say of a text that is not JSON: what stands where, and what was most likely meant."""

from __future__ import annotations

import re

from terratool.text.display import shown

A_KEY = "a key in double quotes"
A_VALUE = "a value"
NO_TEXT = "Save the file as UTF-8; it may be UTF-16, or no text at all."

token = re.compile(r"[\w.+-]*").match
"""What hangs together as a number or a word, right or wrong."""

_number = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?").fullmatch
_hexadecimal = re.compile(r"0[xX]([0-9a-fA-F]+)").fullmatch
_found = re.compile(
    # a text in the wrong quotes, a word, the beginning of a comment, or any one character
    r"""['`‘’‚“”„]([^"'`‘’‚“”„\r\n]*)['`‘’“”]|[\w$][\w$.+-]*|//|/\*|.""",
    re.DOTALL,
).match
_formula = re.compile(r'[^],}"\r\n]*').match
_to_bracket = re.compile(r'(?:[^][{}"]++|"(?:[^"\\]++|\\.)*+")*+[][{}]', re.DOTALL).match

_QUOTES = "'`‘’‚“”„"
_COMMENTS = ("//", "/*", "#")
_NO_COMMENTS = 'JSON has no comments: put the words in "descr" or in a key that begins with x-.'
_WORDS = {
    "true": "true", "tru": "true", "false": "false", "fals": "false", "null": "null",
    "nul": "null", "nil": "null", "none": "null", "undefined": "null",
}  # fmt: skip


class JsonSyntaxError(Exception):
    """The text is no JSON.

    Attributes:
        code: of the rule that says so.
        offset: of the fault, in characters from 0.
        message: one sentence, what is wrong.
        hint: one sentence, what to do.
        inside: the message ends with "inside an object" or "inside a list", the `innermost` one.
    """

    def __init__(
        self, code: str, offset: int, message: str, hint: str, inside: bool = False
    ) -> None:
        super().__init__(message)
        self.code = code
        self.offset = offset
        self.message = message
        self.hint = hint
        self.inside = inside


def bad_encoding(data: bytes, error: UnicodeDecodeError) -> JsonSyntaxError:
    """Bytes that are no UTF-8."""
    before = data[: error.start].decode("utf-8")
    message = f"the byte 0x{data[error.start]:02X} is not valid UTF-8."
    hint = "Save the file as UTF-8."
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        message = "the file begins as UTF-16 where UTF-8 is expected."
    elif b"\0" in data:
        hint = NO_TEXT
    return JsonSyntaxError("TT109", len(before), message, hint)


def bad_number(text: str, offset: int) -> JsonSyntaxError:
    """Something at an offset that begins like a number and is none."""
    spelling = token(text, offset).group()  # type: ignore[union-attr]
    meant = _number_meant(spelling)
    hint = f"Write {meant}." if meant else "Write it like 12, -0.5 or 1e-3."
    return JsonSyntaxError("TT101", offset, f"{shown(spelling)} is no JSON number.", hint)


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
    return sign + digits if digits[:1] != "-" and _number(digits) else ""


def bad_character(text: str, offset: int) -> JsonSyntaxError:
    """A control character at an offset, inside of a text in quotes."""
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
    """A backslash at an offset, with something behind it that makes no escape."""
    char = text[offset + 1 : offset + 2]
    hint = "Write \\\\ for a backslash."
    if char == "u":
        char = re.split(r'["\\]', text[offset + 1 : offset + 6])[0]
        hint = "Write four hexadecimal digits after \\u, or \\\\ for a backslash."
    spelling = shown("\\" + char) if char.isprintable() else f'"\\" before {_name(char)}'
    message = f"{spelling} is no escape that JSON knows."
    return JsonSyntaxError("TT101", offset, message, hint)


def expected_comma(text: str, offset: int) -> JsonSyntaxError:
    """Something at an offset, behind an item, that is neither a comma nor the closing bracket."""
    char = text[offset : offset + 1]
    if char and (char in "\"'{[-" or char.isalnum()):
        # the comma belongs right behind the value before
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
    return unexpected(text, offset, '"," or "]"' if in_list else '"," or "}"', hint)


def left_over(text: str, offset: int) -> JsonSyntaxError:
    """Something at an offset behind the end of the outermost value."""
    found = _found(text, offset).group()  # type: ignore[union-attr]
    hint = "Remove it; one file holds one JSON object."
    if found in _COMMENTS:
        hint = _NO_COMMENTS
    elif found in ",]}":
        hint = "Remove it, or a bracket before it that closes too early."
    message = f"{_name(found)} stands after the end of the definition."
    return JsonSyntaxError("TT101", offset, message, hint)


def unexpected(text: str, offset: int, wanted: str, hint: str = "") -> JsonSyntaxError:
    """Something at an offset, or the end of the file, where another thing must stand."""
    begin = innermost(text, offset)
    if begin < 0:
        wanted, hint = 'the "{" of a definition', "Write a terrain or a vehicle, a JSON object."
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


def open_brackets(text: str, offset: int) -> tuple[list[int], int]:
    """Where the objects and lists begin that are open at an offset, and the last bracket ends."""
    begins: list[int] = []
    behind = 0
    while match := _to_bracket(text, behind, offset):
        behind = match.end()
        if text[behind - 1] in "{[":
            begins.append(behind - 1)
        else:
            begins.pop()
    return begins, behind


def innermost(text: str, offset: int) -> int:
    """Where the innermost object or list begins that is open at an offset; -1 outside of all."""
    begins, _ = open_brackets(text, offset)
    return begins[-1] if begins else -1


def _meant(text: str, offset: int, wanted: str) -> str:
    """What to write instead of what stands at an offset where a key or a value must stand."""
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
        return _in_double_quotes(found)
    return ""


def _in_double_quotes(found: str) -> str:
    whole = len(found) <= 60 and found.isprintable()
    return f"Write {shown(found)}." if whole else "Put it in double quotes."


def _name(found: str) -> str:
    if found == '"':
        return "a text"
    if found in _COMMENTS:
        return "a comment"
    if found[0] in _QUOTES and len(found) > 1:
        return f"{found[0]}{shown(found[1:-1])[1:-1]}{found[-1]}"
    return shown(found) if found.isprintable() else f"the character U+{ord(found[0]):04X}"
