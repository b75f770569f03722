"""GitHub's workflow commands: lines of a log that it shows beside files."""

from __future__ import annotations

from collections.abc import Mapping

from terratool.text.display import printable


def annotation(level: str, where: Mapping[str, object], text: str) -> str:
    """Return a line that GitHub shows as an annotation.

    Args:
        level: error, warning or notice.
        where: properties such as file, line, col and title.
        text: message of one line or several.
    """
    place = ",".join(f"{key}={_property(str(value))}" for key, value in where.items())
    return f"::{level} {place}::{_data(text)}"


def _data(text: str) -> str:
    shown = "".join(c if c in "\r\n" else printable(c) for c in text)
    return shown.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
