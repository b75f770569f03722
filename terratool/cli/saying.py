"""Printing, in this module alone: words of others come out as inert text.

Names of files and of their content, branches, settings and errors are words of others. Terminals
obey control characters in them, marks of direction mislead people, and the log of a workflow on
GitHub obeys lines that begin with two colons. A test checks that no other module prints.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from typing import Any

import click

from terratool.report.documents import json_text
from terratool.report.inert import inert_json, without_workflow_commands
from terratool.text.display import printable

_style = re.compile(r"(\x1b\[[0-9;]*m)")


def shown_line(text: str) -> str:
    """Text on one line, as it is printed for people."""
    return _without_commands(printable(text))


def say(line: str, err: bool = False) -> None:
    """Print a line, with escapes for characters that cannot be printed.

    Args:
        line: text of the line; line feeds become escapes.
        err: whether the line goes to standard error.
    """
    click.echo(shown_line(line), err=err)


def say_block(text: str, *, err: bool = False, machine: bool = False) -> None:
    """Print several lines, each with escapes for characters that cannot be printed.

    Args:
        text: lines; colours by click.style stay. Words of others in them must have their escapes
            already, as a line feed or a colour in them would count as one of the text's.
        err: whether the lines go to standard error.
        machine: whether a program reads the text: it may have commands for GitHub then.
    """
    lines = []
    for line in text.split("\n"):
        if not line.isprintable():  # every other piece is a style
            pieces = _style.split(line)
            line = "".join(p if n % 2 else printable(p) for n, p in enumerate(pieces))
        lines.append(line if machine else _without_commands(line))
    color = False if os.environ.get("NO_COLOR") else None
    click.echo("\n".join(lines), err=err, color=color)


def say_error(message: str, hint: str = "") -> None:
    """Print an error on standard error, and the advice below it."""
    say(f"terratool: {message}", err=True)
    if hint:
        say(f"  {hint}", err=True)


def say_json(value: Any) -> None:
    """Print a value of plain types as JSON."""
    click.echo(json_text(value))


def write_json(text: str) -> None:
    """Print a piece of JSON that ends anywhere between two values."""
    click.echo(inert_json(text), nl=False)


def write_rows(rows: Iterable[Iterable[Any]]) -> None:
    """Print rows of CSV."""
    import csv

    csv.writer(_Rows(), lineterminator="\n").writerows(rows)


def write_definition(text: str) -> None:
    """Print a definition byte for byte, but on a terminal with escapes, which mean the same."""
    # as bytes, since JSON is UTF-8 in any locale
    click.echo((inert_json(text) if is_terminal() else text).encode(), nl=False)


def is_terminal() -> bool:
    """Whether standard output is a terminal."""
    return sys.stdout is not None and sys.stdout.isatty()  # None where standard output was closed


def flush() -> None:
    """Flush standard output."""
    if sys.stdout is not None:
        sys.stdout.flush()


class _Rows:
    """Writer of rows of CSV onto standard output, a line at a time."""

    def write(self, line: str) -> None:
        if sys.stdout is not None:
            sys.stdout.write(f"{shown_line(line[:-1])}\n")


def _without_commands(line: str) -> str:
    return without_workflow_commands(line, lambda sign: f"\\x{ord(sign):02x}")
