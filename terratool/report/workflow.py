"""GitHub workflow commands, which annotate lines of files."""

from __future__ import annotations

from collections.abc import Mapping

from terratool.text.display import printable


def annotation(level: str, where: Mapping[str, object], text: str) -> str:
    """Return a workflow command, which GitHub shows as an annotation.

    Args:
        level: error, warning or notice.
        where: properties of the annotation, such as file, line, col and title.
        text: message of one line or several.
    """
    place = ",".join(f"{key}={_property(str(value))}" for key, value in where.items())
    return f"::{level} {place}::{_data(text)}"


def _data(text: str) -> str:
    """Escape the message of a command."""
    shown = "".join(c if c in "\r\n" else printable(c) for c in text)
    return shown.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    """Escape a property of a command."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")
