"""Findings: what a reader or a rule has to say about a definition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning"]
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Remark:
    """What a rule yields; the runner adds code, severity and position.

    Attributes:
        pointer: JSON pointer (RFC 6901) of the value that is at fault.
        message: one sentence, what is wrong.
        hint: one sentence, what to do.
        on_key: the key is at fault rather than its value.
        bounds: world rectangle (west, south, east, north) that it concerns.
        missing: the key that the object at `pointer` lacks.
    """

    pointer: str
    message: str
    hint: str
    on_key: bool = False
    bounds: Rectangle | None = None
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """A remark with its code, severity and place in the file.

    Lines and columns count from 1, columns in characters; 0 where a file has no text.
    """

    file: str
    code: str
    severity: Severity
    pointer: str
    line: int
    column: int
    message: str
    hint: str
    bounds: Rectangle | None = None


def escape(key: str) -> str:
    """One reference token of a JSON pointer."""
    return key.replace("~", "~0").replace("/", "~1")


def unescape(token: str) -> str:
    """The key behind a reference token."""
    return token.replace("~1", "/").replace("~0", "~")


def shown(value: object) -> str:
    """A name, text or number as a message shows it: on one line, printable, and not too long."""
    if isinstance(value, str):
        text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in value[:60])
        return f'"{text}{"…" if len(value) > 60 else ""}"'
    if isinstance(value, int):
        digits = str(abs(value))
        text = digits if len(digits) < 20 else f"{digits[0]}.{digits[1:4]}…e+{len(digits) - 1}"
        return "-" * (value < 0) + text
    return f"{value:.17g}" if repr(value) == f"{value:.17g}" else repr(value).removesuffix(".0")
