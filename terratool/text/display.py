"""Texts, values and pointers in the form that people, terminals, logs and spreadsheets get."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from msgspec import Struct

_digits = re.compile("[0-9]+").findall
_LONGEST_NUMBER = 4096
"""Most bits of a whole number whose digits are counted: Python refuses to write very long ones."""
_NEAR = 0.8
"""Least similarity, 0 to 1 as difflib counts, at which one name is taken for another."""


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


def quote(value: object) -> str:
    """Return a name, text or number for a message: one line, printable, at most 60 characters."""
    if isinstance(value, str):
        return f'"{printable(value[:60])}{"…" if len(value) > 60 else ""}"'
    if isinstance(value, int):
        if value.bit_length() > _LONGEST_NUMBER:
            return "a number of over a thousand digits"
        digits = str(abs(value))
        text = digits if len(digits) < 20 else f"{digits[0]}.{digits[1:4]}…e+{len(digits) - 1}"
        return "-" * (value < 0) + text
    return f"{value:.17g}" if repr(value) == f"{value:.17g}" else repr(value).removesuffix(".0")
