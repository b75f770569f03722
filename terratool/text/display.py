"""How texts, values and pointers are shown to people."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from msgspec import Struct

_digits = re.compile("[0-9]+").findall
_NEAR = 0.8
"""Names that are alike by this share, as difflib counts, are near."""


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


def shown(value: object) -> str:
    """A name, text or number as a message shows it: on one line, printable, and not too long."""
    if isinstance(value, str):
        return f'"{printable(value[:60])}{"…" if len(value) > 60 else ""}"'
    if isinstance(value, int):
        digits = str(abs(value))
        text = digits if len(digits) < 20 else f"{digits[0]}.{digits[1:4]}…e+{len(digits) - 1}"
        return "-" * (value < 0) + text
    return f"{value:.17g}" if repr(value) == f"{value:.17g}" else repr(value).removesuffix(".0")
