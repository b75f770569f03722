"""The one place that prints: what others wrote comes out as text that nobody obeys.

Names of files and of what is in them, branches, settings and errors are words of others. A terminal
obeys control characters in them, people what is turned about by marks of direction, and the log of
a workflow on GitHub lines that begin with two colons. A test holds the rest of the package to it.
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
    """A text on one line, as it is printed for people."""
    return _unheard(printable(text))


def say(line: str, err: bool = False) -> None:
    """Print a line, with what cannot be printed of the names in it as escapes.

    Args:
        line: of text, be there line feeds in it or not.
        err: whether it goes to standard error.
    """
    click.echo(shown_line(line), err=err)


def say_block(text: str, *, err: bool = False, machine: bool = False) -> None:
    """Print several lines, each as `say` does.

    Args:
        text: the lines; colours that click.style gave them stay. Words of others in them have their
            escapes already, as a line feed or a colour of theirs would be taken for one of ours.
        err: whether they go to standard error.
        machine: whether it is for one: then GitHub may be told something, as `annotation` does.
    """
    lines = []
    for line in text.split("\n"):
        if not line.isprintable():  # then every other piece is a style
            pieces = _style.split(line)
            line = "".join(p if n % 2 else printable(p) for n, p in enumerate(pieces))
        lines.append(line if machine else _unheard(line))
    color = False if os.environ.get("NO_COLOR") else None
    click.echo("\n".join(lines), err=err, color=color)


def say_error(message: str, hint: str = "") -> None:
    """Print what is wrong on standard error, and below it what to do."""
    say(f"terratool: {message}", err=True)
    if hint:
        say(f"  {hint}", err=True)


def say_json(value: Any) -> None:
    """Print a plain value as JSON."""
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
    # JSON is UTF-8, whatever the terminal speaks
    click.echo((inert_json(text) if is_terminal() else text).encode(), nl=False)


def is_terminal() -> bool:
    """Whether a person sees what is printed at once."""
    return sys.stdout is not None and sys.stdout.isatty()  # None where it was closed


def flush() -> None:
    """Have all that was printed arrive."""
    if sys.stdout is not None:
        sys.stdout.flush()


class _Rows:
    """Where rows of CSV go, line by line."""

    def write(self, line: str) -> None:
        if sys.stdout is not None:
            sys.stdout.write(f"{shown_line(line[:-1])}\n")


def _unheard(line: str) -> str:
    return without_workflow_commands(line, lambda sign: f"\\x{ord(sign):02x}")
