"""Texts that others wrote, as terminals, logs, spreadsheets and XML take them: never obeyed."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

from terratool.text.display import printable

_FORMULAS = ("=", "+", "-", "@", "'")
"""What names begin with that get an apostrophe in CSV; one of their own included, so that it is
known where to take it off."""
_CONTROL = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""Expression of characters that no XML has; it is long to compile, so not on import."""
_command = re.compile(r"^((?:\x1b\[[0-9;]*m|\s)*):(?=:)", re.MULTILINE)


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


def xml_text(text: str) -> str:
    """A text without the control characters that JSON may hold and XML may not."""
    return re.sub(_CONTROL, "\ufffd", text)


def inert_xml(text: str) -> str:
    """A text of XML that means the same, with what cannot be printed as references.

    So is what GitHub's log would take for the beginning of a command.
    """
    text = unheard(text, lambda sign: f"&#{ord(sign)};")
    return "".join(c if c.isprintable() or c == "\n" else f"&#{ord(c)};" for c in text)


def inert_cell(name: str) -> str:
    """A name that is no formula of a spreadsheet, and no more than text on a terminal.

    A backslash is doubled, so that what is escaped can be told from what is written.
    """
    text = printable(name.replace("\\", "\\\\"))
    return f"'{text}" if text.startswith(_FORMULAS) else text
