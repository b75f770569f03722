"""How texts, values and pointers are shown to people."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

_digits = re.compile("[0-9]+").findall
_NEAR = 0.8
"""Names that are alike by this share, as difflib counts, are near."""
_FORMULAS = ("=", "+", "-", "@", "'")
"""What names begin with that get an apostrophe in CSV; one of their own included, so that it is
known where to take it off."""
_CONTROL = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""Characters that no XML has: an expression that takes long to compile."""
_command = re.compile(r"^((?:\x1b\[[0-9;]*m|\s)*):(?=:)", re.MULTILINE)


class Excerpt(Struct, frozen=True):
    """A piece of the line that a finding is in.

    Attributes:
        text: printable characters; "…" where the line goes on.
        caret: index in `text` of the character at fault, or just behind its end.
    """

    text: str
    caret: int


def escape(key: str) -> str:
    """One reference token of a JSON pointer."""
    return key.replace("~", "~0").replace("/", "~1")


def unescape(token: str) -> str:
    """The key behind a reference token."""
    return token.replace("~1", "/").replace("~0", "~")


def printable(text: str) -> str:
    """A text on one line, with what cannot be printed as escapes."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def unheard(text: str, escaped: Callable[[str], str]) -> str:
    """A text in which GitHub's log hears no command of a workflow.

    A command begins with two colons at the beginning of a line, or anywhere with two hashes and a
    bracket.

    Args:
        text: one line or several, perhaps with styles of a terminal.
        escaped: gives the escape that stands for the first colon or hash.
    """
    if "::" in text:
        text = _command.sub(lambda found: f"{found[1]}{escaped(':')}", text)
    return text.replace("##[", f"{escaped('#')}#[")


def inert_json(text: str) -> str:
    """A text of JSON that means the same, with what cannot be printed as escapes of JSON.

    So are hashes that GitHub's log would take for a command. Line feeds stay: they stand between
    values, never within one.
    """
    return "\n".join(
        line
        if line.isprintable()
        else "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in line)
        for line in unheard(text, lambda sign: f"\\u{ord(sign):04x}").split("\n")
    )


def json_text(value: Any, indent: int | None = 2) -> str:
    """A plain value as JSON that a terminal, a log and UTF-8 can have, whatever it says."""
    return inert_json(json.dumps(value, indent=indent, ensure_ascii=False))


def xml_text(text: str) -> str:
    """A text without the control characters that JSON may hold and XML may not."""
    return re.sub(_CONTROL, "\ufffd", text)


def inert_xml(text: str) -> str:
    """A text of XML that means the same, with what cannot be printed as references.

    So is what GitHub's log would take for the beginning of a command.
    """
    text = unheard(text, lambda sign: f"&#{ord(sign)};")
    return "".join(c if c.isprintable() or c == "\n" else f"&#{ord(c)};" for c in text)


def columns_of(char: str) -> int:
    """Columns that a terminal gives a character."""
    if char.isascii():
        return 1
    import unicodedata

    if unicodedata.combining(char) or unicodedata.category(char) in ("Mn", "Me", "Cf"):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1


def _swapped(name: str, other: str) -> bool:
    """Whether two neighbouring letters have changed places."""
    return any(
        name == other[:k] + other[k + 1] + other[k] + other[k + 2 :] for k in range(len(other) - 1)
    )


def only_answer(name: str, close: Sequence[str]) -> str:
    """The one name that another one must have meant, as JSON; empty where there are two or none.

    Args:
        name: as it is written.
        close: the two names that are nearest, or those that differ in their case alone.
    """
    from difflib import get_close_matches

    near = [other for other in close if other.lower() == name.lower()]
    if not near:
        alike = get_close_matches(name, close, 2, _NEAR)
        near = alike + [other for other in close if other not in alike and _swapped(name, other)]
    # rock10 is not meant by rock1
    if any(_digits(other) != _digits(name) for other in near):
        return ""
    return json.dumps(near[0], ensure_ascii=False) if len(near) == 1 else ""


def plain(value: Any) -> Any:
    """What msgspec cannot encode by itself, as what it can: paths as texts, NumPy's numbers.

    Raises:
        TypeError: it is something else.
    """
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not to be encoded")


def counted(count: int, noun: str) -> str:
    """A number of things in words: 1 file, 2,000 files, 3 libraries, 4 boxes."""
    plural = "es" if noun.endswith(("x", "sh")) else "s"
    many = f"{noun[:-1]}ies" if noun.endswith("ry") else f"{noun}{plural}"
    return f"{count:,} {noun if count == 1 else many}"


def many(count: int) -> str:
    """A whole number, however large, in words: 2,000, or about 10^450."""
    return f"{count:,}" if count < 10**30 else f"about 10^{round(count.bit_length() * 0.30103)}"


def listed(words: Sequence[str]) -> str:
    """Words with commas and an "and"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if words[1:] else "".join(words)


def length(metres: float) -> str:
    """A length in words, to three digits, or to a metre from a kilometre on."""
    return f"{metres:.3g} m" if abs(metres) < 1000 else f"{metres:,.0f} m"


def shown(value: object) -> str:
    """A name, text or number as a message shows it: on one line, printable, and not too long."""
    if isinstance(value, str):
        return f'"{printable(value[:60])}{"…" if len(value) > 60 else ""}"'
    if isinstance(value, int):
        digits = str(abs(value))
        text = digits if len(digits) < 20 else f"{digits[0]}.{digits[1:4]}…e+{len(digits) - 1}"
        return "-" * (value < 0) + text
    return f"{value:.17g}" if repr(value) == f"{value:.17g}" else repr(value).removesuffix(".0")


def inert_cell(name: str) -> str:
    """A name that is no formula of a spreadsheet, and no more than text on a terminal.

    A backslash is doubled, so that what is escaped can be told from what is written.
    """
    text = printable(name.replace("\\", "\\\\"))
    return f"'{text}" if text.startswith(_FORMULAS) else text
