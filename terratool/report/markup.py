"""Markdown and HTML: escaping of texts, table rows, and templates."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from terratool.text.display import printable

_UNIT = re.compile(r"(?<=\d) (?=%|(?:mm|km|m|s|min|h|J|Wh|kWh|N|kg|W)\b)|(?<=\d,) (?=[\d.−-]+\))")
# characters that begin markup anywhere in a line, in table cells and HTML, too
_MARKUP = re.compile(r"([\\`*_{}\[\]<>&|~#$])")


def escape_html(text: str) -> str:
    """Escape a text for HTML, on one line, with no-break spaces in quantities and places."""
    return _UNIT.sub("\u00a0", html.escape(printable(text)))


def escape_markdown(text: str) -> str:
    """Escape a text for GitHub Flavored Markdown, on one line."""
    return _MARKUP.sub(r"\\\1", printable(text))


def markdown_row(cells: Iterable[str]) -> str:
    """Row of a Markdown table; cells are markup."""
    return f"| {' | '.join(cells)} |"


def render(template: Path, escape: Callable[[str], str], **values: Any) -> str:
    """Render a Jinja template with escaped values.

    Args:
        template: file; it may include files beside it, and the macros of this folder.
        escape: escapes a text, such as `escape_html`.
        values: values by their names in the template; `Markup` is not escaped.
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
    return environment.get_template(template.name).render(**values)
