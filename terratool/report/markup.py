"""Markdown and HTML: texts that are no markup there, rows of tables, and templates."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from terratool.text.display import printable

_UNIT = re.compile(r"(?<=\d) (?=%|(?:mm|km|m|s|min|h|J|Wh|kWh|N|kg|W)\b)")
# what begins markup anywhere in a line, a cell of a table and HTML included
_MARKUP = re.compile(r"([\\`*_{}\[\]<>&|~#$])")


def escaped_html(text: str) -> str:
    """A text on one line, none of it markup, with numbers and their units kept together."""
    return _UNIT.sub("\u00a0", html.escape(printable(text)))


def escaped_markdown(text: str) -> str:
    """A text on one line, none of it markup in GitHub's flavour of Markdown."""
    return _MARKUP.sub(r"\\\1", printable(text))


def markdown_row(cells: Iterable[str]) -> str:
    """A row of a table in Markdown; cells are markup already."""
    return f"| {' | '.join(cells)} |"


def rendered(template: Path, escape: Callable[[str], str], **told: Any) -> str:
    """The text of a template of Jinja with what it tells, of which nothing is markup.

    Args:
        template: the file; it may include what lies beside it, and the macros of this folder.
        escape: makes a text that is no markup, as `escaped_html` does.
        told: values by their names in the template; `Markup` is put in as it is.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    def finalize(value: object) -> Markup:
        return value if isinstance(value, Markup) else Markup(escape(str(value)))

    environment = Environment(
        loader=FileSystemLoader([template.parent, Path(__file__).parent]),
        autoescape=True, finalize=finalize, keep_trailing_newline=True, lstrip_blocks=True,
        trim_blocks=True, undefined=StrictUndefined,
    )  # fmt: skip
    return environment.get_template(template.name).render(**told)
