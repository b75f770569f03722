"""Texts, values and pointers in the form that people, terminals, logs and spreadsheets get."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

_digits = re.compile("[0-9]+").findall
_NEAR = 0.8
"""Least similarity, 0 to 1 as difflib counts, at which one name is taken for another."""
_FORMULAS = ("=", "+", "-", "@", "'")
"""First characters of names that get an apostrophe in CSV; the apostrophe itself is one of them, so
that readers know where to remove it."""
_control = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_command = re.compile(r"^((?:\x1b\[[0-9;]*m|\s)*):(?=:)", re.MULTILINE)


class Excerpt(Struct, frozen=True):
    """Part of the line that a finding is in.

    Attributes:
        text: printable characters; "…" where the line continues.
        caret: index in `text` of the character at fault, or of the end.
    """

    text: str
    caret: int


def escape(key: str) -> str:
    """Return a key as one reference token of a JSON pointer (RFC 6901)."""
    return key.replace("~", "~0").replace("/", "~1")


def unescape(token: str) -> str:
    """Return the key that a reference token of a JSON pointer stands for."""
    return token.replace("~1", "/").replace("~0", "~")


def printable(text: str) -> str:
    """Return a text on one line, characters that cannot be printed as escapes of Python."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def without_workflow_commands(text: str, escaped: Callable[[str], str]) -> str:
    """Return a text without workflow commands that GitHub's log would run.

    Such a command begins with two colons at the beginning of a line, or anywhere with two hashes
    and a bracket.

    Args:
        text: one line or several, perhaps with escape sequences of a terminal.
        escaped: returns the escape that replaces the first colon or hash.
    """
    if "::" in text:
        text = _command.sub(lambda found: f"{found[1]}{escaped(':')}", text)
    return text.replace("##[", f"{escaped('#')}#[")


def inert_json(text: str) -> str:
    """Return a JSON text of the same value, unprintable characters as escapes of JSON.

    Hashes that GitHub's log would take for a command are escaped, too. Line feeds stay: they stand
    between values, never within one.
    """
    return "\n".join(
        line
        if line.isprintable()
        else "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in line)
        for line in without_workflow_commands(text, lambda sign: f"\\u{ord(sign):04x}").split("\n")
    )


def json_text(value: Any, indent: int | None = 2) -> str:
    """Encode a plain value as JSON that is safe for a terminal, a log and UTF-8."""
    return inert_json(json.dumps(value, indent=indent, ensure_ascii=False))


def xml_text(text: str) -> str:
    """Return a text without the control characters that JSON allows and XML does not."""
    return _control.sub("\ufffd", text)


def inert_xml(text: str) -> str:
    """Return an XML text of the same meaning, unprintable characters as references.

    Colons and hashes with which GitHub's log would begin a command become references, too.
    """
    text = without_workflow_commands(text, lambda sign: f"&#{ord(sign)};")
    return "".join(c if c.isprintable() or c == "\n" else f"&#{ord(c)};" for c in text)


def columns_of(char: str) -> int:
    """Return the columns that a terminal gives a character: 0, 1 or 2."""
    if char.isascii():
        return 1
    import unicodedata

    if unicodedata.combining(char) or unicodedata.category(char) in ("Mn", "Me", "Cf"):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1


def _is_swap_of(name: str, other: str) -> bool:
    """Tell whether two names differ by one swap of neighbouring letters."""
    return any(
        name == other[:k] + other[k + 1] + other[k] + other[k + 2 :] for k in range(len(other) - 1)
    )


def only_answer(name: str, close: Sequence[str]) -> str:
    """Return the one name that a misspelled one must have meant, as JSON; empty where unclear.

    Args:
        name: name as it is written.
        close: the two nearest names, or all that differ from it by case alone.
    """
    from difflib import get_close_matches

    near = [other for other in close if other.lower() == name.lower()]
    if not near:
        alike = get_close_matches(name, close, 2, _NEAR)
        near = alike + [other for other in close if other not in alike and _is_swap_of(name, other)]
    # rock1 does not mean rock10
    if any(_digits(other) != _digits(name) for other in near):
        return ""
    return json.dumps(near[0], ensure_ascii=False) if len(near) == 1 else ""


def plain(value: Any) -> Any:
    """Convert a value that msgspec cannot encode: a path to text, a NumPy number to Python's.

    Raises:
        TypeError: the value is of another type.
    """
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not to be encoded")


def counted(count: int, noun: str) -> str:
    """Return a number and its noun in words: 1 file, 2,000 files, 3 libraries, 4 boxes."""
    plural = "es" if noun.endswith(("x", "sh")) else "s"
    many = f"{noun[:-1]}ies" if noun.endswith("ry") else f"{noun}{plural}"
    return f"{count:,} {noun if count == 1 else many}"


def many(count: int) -> str:
    """Return a whole number, however large, in words: 2,000, or about 10^450."""
    return f"{count:,}" if count < 10**30 else f"about 10^{round(count.bit_length() * 0.30103)}"


def listed(words: Sequence[str]) -> str:
    """Join words by commas and an "and"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if words[1:] else "".join(words)


def length(metres: float) -> str:
    """Return a length in metres in words, to three digits, from a kilometre on to a metre."""
    return f"{metres:.3g} m" if abs(metres) < 1000 else f"{metres:,.0f} m"


def shown(value: object) -> str:
    """Return a name, text or number for a message: one line, printable, at most 60 characters."""
    if isinstance(value, str):
        return f'"{printable(value[:60])}{"…" if len(value) > 60 else ""}"'
    if isinstance(value, int):
        digits = str(abs(value))
        text = digits if len(digits) < 20 else f"{digits[0]}.{digits[1:4]}…e+{len(digits) - 1}"
        return "-" * (value < 0) + text
    return f"{value:.17g}" if repr(value) == f"{value:.17g}" else repr(value).removesuffix(".0")


def inert_cell(name: str) -> str:
    """Return a name as a cell of CSV that is neither a formula nor a terminal's escape sequence.

    A backslash is doubled, so that readers can tell escapes from backslashes of the name.
    """
    text = printable(name.replace("\\", "\\\\"))
    return f"'{text}" if text.startswith(_FORMULAS) else text
