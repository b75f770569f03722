"""Escaping of untrusted texts for terminals, GitHub logs, spreadsheets, JSON and XML."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

from terratool.text.display import printable

_FORMULAS = ("=", "+", "-", "@", "'")
"""First characters of names that get an apostrophe in CSV; readers can remove it again, as a name's
own apostrophe gets one, too."""
_CONTROL = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""Regular expression of characters that XML forbids; not compiled on import, which is slow."""
_command = re.compile(r"^((?:\x1b\[[0-9;]*m|\s)*):(?=:)", re.MULTILINE)


def without_workflow_commands(text: str, escaped: Callable[[str], str]) -> str:
    """Return a text without workflow commands that GitHub's log would run.

    A command begins with two colons at the start of a line, or with two hashes and a bracket
    anywhere.

    Args:
        text: one line or several, perhaps with escape sequences of a terminal.
        escaped: returns the escape that replaces the first colon or hash.
    """
    if "::" in text:
        text = _command.sub(lambda found: f"{found[1]}{escaped(':')}", text)
    return text.replace("##[", f"{escaped('#')}#[")


def inert_json(text: str) -> str:
    """Return a JSON text of equal value, with unprintable characters as JSON escapes.

    Colons and hashes that begin a command in GitHub's log are escaped, too. Line feeds stay, as
    they occur only between values.
    """
    return "\n".join(
        line
        if line.isprintable()
        else "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in line)
        for line in without_workflow_commands(text, lambda sign: f"\\u{ord(sign):04x}").split("\n")
    )


def xml_text(text: str) -> str:
    """Return a text with characters that XML forbids replaced by U+FFFD."""
    return re.sub(_CONTROL, "\ufffd", text)


def inert_xml(text: str) -> str:
    """Return an XML text of equal content, with unprintable characters as references.

    Colons and hashes that begin a command in GitHub's log become references, too.
    """
    text = without_workflow_commands(text, lambda sign: f"&#{ord(sign)};")
    return "".join(c if c.isprintable() or c == "\n" else f"&#{ord(c)};" for c in text)


def inert_cell(name: str) -> str:
    """Return a name as a cell of CSV that is neither a formula nor a terminal's escape sequence.

    A backslash is doubled, so that readers can tell escapes from backslashes of the name.
    """
    text = printable(name.replace("\\", "\\\\"))
    return f"'{text}" if text.startswith(_FORMULAS) else text
